//! The pages: embedded in the program, or from a folder while they are being developed.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use axum::http::{HeaderMap, HeaderName, StatusCode, header};
use axum::response::{IntoResponse, Response};

/// What is shown where the pages were not built.
const NOT_BUILT: &str = "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>Northing</title>\
<h1>The pages are not built</h1><p>This program was built without its pages. Install Node.js, run \
<code>npm ci</code> and <code>npm run build</code> in the folder <code>web</code>, and build the program again. \
The lab itself runs: see <code>/api/status</code>.</p></html>";

/// Where pages come from.
#[derive(Debug, Clone, Default)]
pub struct Assets {
    folder: Option<PathBuf>,
}

impl Assets {
    /// The embedded pages, or those of a folder such as `web/dist`.
    #[must_use]
    pub fn new(folder: Option<PathBuf>) -> Self {
        Self { folder }
    }

    /// The file `name` of `page` (`lab` or `phone`) and its content type.
    #[must_use]
    pub fn get(&self, page: &str, name: &str) -> Option<(Cow<'static, [u8]>, &'static str)> {
        // Names only, no paths: nothing outside the folder can be asked for.
        if name.is_empty() || name.starts_with('.') || name.contains(['/', '\\', '\0']) {
            return None;
        }
        let kind = content_type(name);
        if let Some(folder) = &self.folder {
            let bytes = std::fs::read(folder.join(page).join(name)).ok()?;
            return Some((Cow::Owned(bytes), kind));
        }
        match northing_pages::file(&format!("{page}/{name}")) {
            Some(bytes) => Some((Cow::Borrowed(bytes), kind)),
            None if name == "index.html" => Some((Cow::Borrowed(NOT_BUILT.as_bytes()), kind)),
            None => None,
        }
    }
}

impl Assets {
    /// The file `name` of `page` as an answer, with the lab's name in its title; compressed for who reads that.
    pub(crate) fn answer(&self, page: &str, name: &str, lab: &str, asked: &HeaderMap) -> Response {
        let Some((bytes, kind)) = self.get(page, name) else {
            return StatusCode::NOT_FOUND.into_response();
        };
        // Parts of a page have the hash of their content in their names.
        let caching = match name.contains('-') {
            true => "public, max-age=31536000, immutable",
            false => "no-cache",
        };
        let headers = [
            (header::CONTENT_TYPE, kind),
            (header::CACHE_CONTROL, caching),
            (header::VARY, "accept-encoding"),
        ];
        let has_title = name == "index.html" && !lab.is_empty();
        let packed = !has_title && accepts_gzip(asked);
        if packed && let Some((bytes, _)) = self.get(page, &format!("{name}.gz")) {
            let packed = [(header::CONTENT_ENCODING, "gzip")];
            return (headers, packed, bytes.into_owned()).into_response();
        }
        (headers, titled(bytes, name, lab)).into_response()
    }
}

fn accepts_gzip(asked: &HeaderMap) -> bool {
    let accepted = asked.get(header::ACCEPT_ENCODING);
    let accepted = accepted.and_then(|value| value.to_str().ok()).unwrap_or("");
    let mut codings = accepted
        .split(',')
        .map(|coding| coding.trim().to_ascii_lowercase());
    codings
        .any(|coding| coding == "gzip" || coding.starts_with("gzip;") && !coding.ends_with("q=0"))
}

/// The headers of a file to be kept under a name.
pub(crate) fn attachment(kind: &str, name: &str) -> [(HeaderName, String); 2] {
    let disposition = format!("attachment; filename=\"{name}\"");
    [
        (header::CONTENT_TYPE, kind.to_owned()),
        (header::CONTENT_DISPOSITION, disposition),
    ]
}

/// A page with the lab's name in its title, where it has one; other files as they are.
#[must_use]
pub fn titled(bytes: Cow<'static, [u8]>, file: &str, lab: &str) -> Vec<u8> {
    let whole = bytes.into_owned();
    if lab.is_empty() || file != "index.html" {
        return whole;
    }
    let Ok(text) = String::from_utf8(whole) else {
        return Vec::new();
    };
    let escaped = lab.replace('&', "&amp;").replace('<', "&lt;");
    text.replacen("<title>", &format!("<title>{escaped} · "), 1)
        .into_bytes()
}

fn content_type(name: &str) -> &'static str {
    let extension = Path::new(name).extension().and_then(|e| e.to_str());
    match extension {
        Some("html") => "text/html; charset=utf-8",
        Some("js") => "text/javascript; charset=utf-8",
        Some("css") => "text/css; charset=utf-8",
        Some("svg") => "image/svg+xml",
        Some("json") => "application/json",
        _ => "application/octet-stream",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderValue;

    #[tokio::test]
    async fn what_is_compressed_is_the_same_file() {
        let assets = Assets::default();
        let answer = |accepted: &'static str| {
            let asked = [(header::ACCEPT_ENCODING, HeaderValue::from_static(accepted))];
            assets.answer("lab", "lab.js", "", &HeaderMap::from_iter(asked))
        };
        let plain = answer("identity");
        if plain.status() == StatusCode::NOT_FOUND {
            return; // Built without the pages.
        }
        assert!(!plain.headers().contains_key(header::CONTENT_ENCODING));
        let length = |answer: Response| async {
            axum::body::to_bytes(answer.into_body(), usize::MAX)
                .await
                .unwrap()
                .len()
        };
        let plain = length(plain).await;
        for accepted in ["gzip", "br, gzip;q=0.8", "deflate, GZIP"] {
            let packed = answer(accepted);
            assert_eq!(packed.headers()[header::CONTENT_ENCODING], "gzip");
            assert!(length(packed).await * 2 < plain);
        }
        assert!(
            !answer("gzip;q=0")
                .headers()
                .contains_key(header::CONTENT_ENCODING)
        );
    }

    #[test]
    fn pages_are_found_by_name_and_nothing_else_is() {
        let assets = Assets::default();
        assert!(assets.get("lab", "index.html").is_some());
        let page = || assets.get("lab", "index.html").unwrap().0;
        let titled = |name| String::from_utf8(titled(page(), "index.html", name)).unwrap();
        assert!(titled("A & <b>").contains("<title>A &amp; &lt;b> · Northing"));
        assert_eq!(titled("").into_bytes(), page().into_owned());
        for name in ["", "../lab/index.html", "..", "a/b", "no.js"] {
            assert!(assets.get("lab", name).is_none(), "{name}");
        }
    }
}
