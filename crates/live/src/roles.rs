//! Who asks: a teacher, or the student of one device. On this computer everybody is the teacher; elsewhere a cookie says it.

use std::sync::Arc;

use axum::Json;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, Method, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Redirect, Response};
use serde::Serialize;
use serde_json::json;

use crate::credentials::Credentials;
use crate::token::Token;

/// The cookie of a page that has joined. Browsers send a cookie of this prefix only over TLS and only to the host that set it.
pub const COOKIE: &str = "__Host-northing";
/// How long a browser keeps it, s: a day of lessons.
const COOKIE_S: u32 = 12 * 3600;
/// Where a browser without a cookie can say what it knows.
pub const JOIN: &str = "/join";

/// Why a browser without a cookie gets nothing.
pub const NOT_JOINED: &str =
    "this browser has not joined the lab: start its phone page, or open /join with a code";

/// Who asks.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Role {
    /// Sees and steers everything.
    Teacher,
    /// Sees and steers one device and its experiments.
    Student {
        /// The device.
        device: Arc<str>,
    },
}

/// The name of a role, for pages.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(rename_all = "lowercase")]
pub enum RoleName {
    /// Sees and steers everything.
    Teacher,
    /// Sees and steers one device and its experiments.
    Student,
}

impl Role {
    /// Its name.
    #[must_use]
    pub const fn name(&self) -> RoleName {
        match self {
            Self::Teacher => RoleName::Teacher,
            Self::Student { .. } => RoleName::Student,
        }
    }

    /// The one device of a student.
    #[must_use]
    pub fn device(&self) -> Option<&str> {
        match self {
            Self::Teacher => None,
            Self::Student { device } => Some(device),
        }
    }

    /// Whether a device is this role's to see and to steer.
    #[must_use]
    pub fn owns(&self, device: &str) -> bool {
        self.device().is_none_or(|own| own == device)
    }
}

/// The keys that a request's cookies name; a browser sends one, unless somebody meddles.
fn keys(headers: &HeaderMap) -> impl Iterator<Item = &str> {
    let lines = headers.get_all(header::COOKIE).iter();
    let pairs = lines.filter_map(|line| line.to_str().ok());
    let pairs = pairs.flat_map(|line| line.split(';'));
    pairs.filter_map(|pair| pair.trim().strip_prefix(COOKIE)?.strip_prefix('='))
}

/// The header that makes a browser keep a key.
pub(crate) fn set_cookie(key: &Token) -> [(header::HeaderName, String); 1] {
    let cookie = format!(
        "{COOKIE}={}; Path=/; Max-Age={COOKIE_S}; Secure; HttpOnly; SameSite=Strict",
        key.as_str()
    );
    [(header::SET_COOKIE, cookie)]
}

/// Lets a request through whose cookie says who asks. A page is sent to where it can join, other requests are refused.
pub(crate) async fn authenticate(
    State(credentials): State<Arc<Credentials>>,
    mut request: Request,
    next: Next,
) -> Response {
    let role = keys(request.headers()).find_map(|key| credentials.role(key));
    if let Some(role) = role {
        request.extensions_mut().insert(role);
        return next.run(request).await;
    }
    if request.method() == Method::GET && request.uri().path().starts_with("/lab") {
        return Redirect::to(JOIN).into_response();
    }
    refused(StatusCode::UNAUTHORIZED, NOT_JOINED)
}

/// Lets a teacher's request through.
pub(crate) async fn for_teachers(request: Request, next: Next) -> Response {
    match request.extensions().get::<Role>() {
        Some(Role::Teacher) => next.run(request).await,
        // Who is not known to be the teacher is none.
        _ => refused(StatusCode::FORBIDDEN, crate::permissions::TEACHERS),
    }
}

/// A refusal in a sentence.
pub(crate) fn refused(status: StatusCode, text: &str) -> Response {
    (status, Json(json!({"error": text}))).into_response()
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderValue;

    #[test]
    fn the_key_is_found_among_other_cookies_and_never_in_them() {
        let found = |line: &'static str| -> Vec<String> {
            let headers = [(header::COOKIE, HeaderValue::from_static(line))];
            let headers = HeaderMap::from_iter(headers);
            keys(&headers).map(str::to_owned).collect()
        };
        assert_eq!(found("__Host-northing=abc"), ["abc"]);
        assert_eq!(found("a=b; __Host-northing=abc;c=d"), ["abc"]);
        assert_eq!(
            found("__Host-northing=abc; __Host-northing=x"),
            ["abc", "x"]
        );
        for line in [
            "",
            "northing=abc",
            "x=__Host-northing=abc",
            "__Host-northing2=abc",
        ] {
            assert!(found(line).is_empty(), "{line}");
        }
    }

    #[test]
    fn a_cookie_stays_with_its_host_over_tls_and_out_of_scripts() {
        let [(_, cookie)] = set_cookie(&Token::random().unwrap());
        for needed in [
            "__Host-",
            "; Path=/;",
            "; Secure",
            "; HttpOnly",
            "; SameSite=Strict",
        ] {
            assert!(cookie.contains(needed), "{cookie}");
        }
        assert!(!cookie.contains("Domain"));
    }

    #[test]
    fn a_student_owns_one_device() {
        let student = Role::Student {
            device: "anna".into(),
        };
        assert!(student.owns("anna") && !student.owns("ann") && !student.owns("anna+2"));
        assert!(Role::Teacher.owns("anna"));
    }
}
