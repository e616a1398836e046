//! Who may ask: names under which the lab answers, pages that may talk to it, and protecting headers.
//!
//! A foreign page in the same browser can send requests to the lab, and by rebinding its name to
//! this computer it can read the answers too. Hence every listener answers only to names that are
//! really this computer's, compared exactly, and the lab page's WebSocket and posts come only from
//! the lab page.

use std::net::IpAddr;

use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

/// The headers of every answer.
const HEADERS: [(HeaderName, &str); 6] = [
    (
        header::CONTENT_SECURITY_POLICY,
        "default-src 'self'; connect-src 'self'; img-src 'self' data:; base-uri 'none'; \
         form-action 'none'; frame-ancestors 'none'; object-src 'none'",
    ),
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (header::REFERRER_POLICY, "no-referrer"),
    (
        HeaderName::from_static("cross-origin-opener-policy"),
        "same-origin",
    ),
    (
        HeaderName::from_static("cross-origin-resource-policy"),
        "same-origin",
    ),
    (
        HeaderName::from_static("permissions-policy"),
        "accelerometer=(self), gyroscope=(self), magnetometer=(self), camera=(), microphone=(), geolocation=()",
    ),
];

/// The names under which one listener answers.
#[derive(Debug, Clone)]
pub struct Names {
    hosts: Vec<String>,
    /// Whether a foreign `Origin` is refused.
    check_origin: bool,
    scheme: &'static str,
}

impl Names {
    /// Names of a listener on `port`: this computer itself, and `addresses`.
    #[must_use]
    pub fn new(scheme: &'static str, port: u16, addresses: &[IpAddr], check_origin: bool) -> Self {
        let local = [
            "localhost".to_owned(),
            "127.0.0.1".to_owned(),
            "[::1]".to_owned(),
        ];
        let others = addresses.iter().map(|address| match address {
            IpAddr::V4(v4) => v4.to_string(),
            IpAddr::V6(v6) => format!("[{v6}]"),
        });
        let hosts = local.into_iter().chain(others);
        Self {
            hosts: hosts.map(|host| format!("{host}:{port}")).collect(),
            check_origin,
            scheme,
        }
    }

    fn knows_host(&self, headers: &HeaderMap) -> bool {
        let host = headers.get(header::HOST).and_then(|h| h.to_str().ok());
        host.is_some_and(|host| self.hosts.iter().any(|h| h.eq_ignore_ascii_case(host)))
    }

    /// Browsers always say the origin of a WebSocket and of a post; programs need not.
    fn knows_origin(&self, headers: &HeaderMap) -> bool {
        let Some(origin) = headers.get(header::ORIGIN) else {
            return true;
        };
        let Ok(origin) = origin.to_str() else {
            return false;
        };
        let own = |host: &String| format!("{}://{host}", self.scheme).eq_ignore_ascii_case(origin);
        !self.check_origin || self.hosts.iter().any(own)
    }
}

/// Refuses what is not for us, and adds the headers to what is.
pub async fn guard(State(names): State<Names>, request: Request, next: Next) -> Response {
    let headers = request.headers();
    let mut response = if !names.knows_host(headers) {
        let text = "this address is not one of the lab's; open the one that the program printed\n";
        (StatusCode::FORBIDDEN, text).into_response()
    } else if !names.knows_origin(headers) {
        (
            StatusCode::FORBIDDEN,
            "another page may not talk to the lab\n",
        )
            .into_response()
    } else {
        next.run(request).await
    };
    for (name, value) in HEADERS {
        response
            .headers_mut()
            .entry(name)
            .or_insert(HeaderValue::from_static(value));
    }
    response
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(name: HeaderName, value: &str) -> HeaderMap {
        HeaderMap::from_iter([(name, HeaderValue::from_str(value).unwrap())])
    }

    #[test]
    fn only_exact_names_are_known() {
        let lan = [IpAddr::from([192, 168, 1, 5])];
        let names = Names::new("http", 7770, &lan, true);
        for host in [
            "localhost:7770",
            "127.0.0.1:7770",
            "[::1]:7770",
            "192.168.1.5:7770",
        ] {
            assert!(names.knows_host(&headers(header::HOST, host)), "{host}");
            let origin = format!("http://{host}");
            assert!(
                names.knows_origin(&headers(header::ORIGIN, &origin)),
                "{origin}"
            );
        }
        for host in [
            "localhost",
            "localhost:7771",
            "evil.example:7770",
            "localhost:7770.evil",
            "",
        ] {
            assert!(!names.knows_host(&headers(header::HOST, host)), "{host}");
            let origin = format!("http://{host}");
            assert!(
                !names.knows_origin(&headers(header::ORIGIN, &origin)),
                "{origin}"
            );
        }
        assert!(!names.knows_host(&HeaderMap::new()));
        assert!(names.knows_origin(&HeaderMap::new()));
        assert!(!names.knows_origin(&headers(header::ORIGIN, "null")));
    }
}
