//! Who may ask: names under which the lab answers, pages that may talk to it, and protecting headers.
//!
//! A foreign page in the same browser can send requests to the lab, and by rebinding its name to
//! this computer it can read the answers too. Hence every listener answers only to names that are
//! really this computer's, compared exactly, and the lab page's WebSocket and posts come only from
//! the lab page.

use std::sync::Arc;

use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

use crate::addresses::Reach;

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
    scheme: &'static str,
    port: u16,
    /// The addresses of this computer, where phones may come.
    reach: Option<Arc<Reach>>,
    /// Further names that somebody asked for.
    allowed: Vec<String>,
    /// Whether a foreign `Origin` is refused.
    check_origin: bool,
}

impl Names {
    /// Names of a listener on `port`: this computer itself, and what `reach` knows.
    #[must_use]
    pub fn new(
        scheme: &'static str,
        port: u16,
        reach: Option<Arc<Reach>>,
        check_origin: bool,
    ) -> Self {
        Self {
            scheme,
            port,
            reach,
            allowed: Vec::new(),
            check_origin,
        }
    }

    /// These names, too.
    #[must_use]
    pub fn and(mut self, hosts: &[String]) -> Self {
        self.allowed.extend_from_slice(hosts);
        self
    }

    /// Whether `host:port` is us. Browsers leave out the port that the scheme has by itself.
    fn knows(&self, host: &str) -> bool {
        let usual = if self.scheme == "https" { 443 } else { 80 };
        let with_port = host
            .strip_suffix(&self.port.to_string())
            .and_then(|rest| rest.strip_suffix(':'));
        let Some(name) = with_port.or((self.port == usual).then_some(host)) else {
            return false;
        };
        let local = ["localhost", "127.0.0.1", "[::1]"];
        local.iter().any(|own| own.eq_ignore_ascii_case(name))
            || self
                .allowed
                .iter()
                .any(|own| own.eq_ignore_ascii_case(name))
            || self.reach.as_ref().is_some_and(|reach| reach.is_own(name))
    }

    fn knows_host(&self, headers: &HeaderMap) -> bool {
        let host = headers.get(header::HOST).and_then(|h| h.to_str().ok());
        host.is_some_and(|host| self.knows(host))
    }

    /// Browsers always say the origin of a WebSocket and of a post; programs need not.
    fn knows_origin(&self, headers: &HeaderMap) -> bool {
        let Some(origin) = headers.get(header::ORIGIN) else {
            return true;
        };
        if !self.check_origin {
            return true;
        }
        let origin = origin.to_str().ok();
        let parts = origin.and_then(|origin| origin.split_once("://"));
        parts.is_some_and(|(scheme, host)| {
            scheme.eq_ignore_ascii_case(self.scheme) && self.knows(host)
        })
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
    use crate::addresses::Addresses;
    use crate::token::Token;

    fn headers(name: HeaderName, value: &str) -> HeaderMap {
        HeaderMap::from_iter([(name, HeaderValue::from_str(value).unwrap())])
    }

    fn reach() -> Arc<Reach> {
        let lan = vec![std::net::IpAddr::from([192, 168, 1, 5])];
        let addresses = Addresses {
            shown: lan.clone(),
            own: lan,
        };
        let token = Arc::new(Token::random().unwrap());
        let name = Some("laptop.local".to_owned());
        Arc::new(Reach::new(addresses, name, [443, 80], token))
    }

    /// Browsers write `Host: localhost` and `Origin: https://localhost` then.
    #[test]
    fn the_usual_port_may_be_left_out_and_no_other() {
        for (scheme, port) in [("http", 80), ("https", 443)] {
            let names = Names::new(scheme, port, Some(reach()), true);
            for host in ["localhost", "[::1]", "192.168.1.5", "laptop.local"] {
                for host in [host.to_owned(), format!("{host}:{port}")] {
                    assert!(names.knows_host(&headers(header::HOST, &host)), "{host}");
                    let origin = format!("{scheme}://{host}");
                    assert!(names.knows_origin(&headers(header::ORIGIN, &origin)));
                }
            }
            assert!(!names.knows_host(&headers(header::HOST, "localhost:7770")));
            assert!(!names.knows_host(&headers(header::HOST, "evil.example")));
        }
    }

    #[test]
    fn only_exact_names_are_known() {
        let names = Names::new("http", 7770, Some(reach()), true);
        let more = names.clone().and(&["lab.example".to_owned()]);
        assert!(more.knows_host(&headers(header::HOST, "Lab.example:7770")));
        assert!(!more.knows_host(&headers(header::HOST, "x.lab.example:7770")));
        assert!(!names.knows_host(&headers(header::HOST, "lab.example:7770")));
        for host in [
            "localhost:7770",
            "127.0.0.1:7770",
            "[::1]:7770",
            "192.168.1.5:7770",
            "laptop.local:7770",
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
            "localhost:07770",
            "localhost::7770",
            "localhost:7770:7770",
            "192.168.1.6:7770",
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
