//! The pages: embedded in the program, or from a folder while they are being developed.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use axum::http::{HeaderName, StatusCode, header};
use axum::response::{IntoResponse, Response};

/// The files that the build script found, by name such as `lab/index.html`.
const EMBEDDED: &[(&str, &[u8])] = include!(concat!(env!("OUT_DIR"), "/assets.rs"));

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
        let full = format!("{page}/{name}");
        let embedded = EMBEDDED.iter().find(|(known, _)| *known == full);
        match embedded {
            Some((_, bytes)) => Some((Cow::Borrowed(*bytes), kind)),
            None if name == "index.html" => Some((Cow::Borrowed(NOT_BUILT.as_bytes()), kind)),
            None => None,
        }
    }
}

impl Assets {
    /// The file `name` of `page` as an answer, with the lab's name in its title.
    pub(crate) fn answer(&self, page: &str, name: &str, lab: &str) -> Response {
        let Some((bytes, kind)) = self.get(page, name) else {
            return StatusCode::NOT_FOUND.into_response();
        };
        let headers = [
            (header::CONTENT_TYPE, kind),
            (header::CACHE_CONTROL, "no-cache"),
        ];
        (headers, titled(bytes, name, lab)).into_response()
    }
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
        _ => "application/octet-stream",
    }
}

#[cfg(test)]
mod tests {
    use super::{Assets, titled};

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
