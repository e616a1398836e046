//! Browsers elsewhere: requests over TLS with their cookie, WebSockets, and phones that deliver and join.
#![allow(dead_code, unreachable_pub)] // every test file uses its own part

use std::net::TcpStream;
use std::sync::Arc;
use std::time::Duration;

use northing_recording::Event;
use rustls::client::danger::{HandshakeSignatureValid, ServerCertVerified, ServerCertVerifier};
use rustls::crypto::{CryptoProvider, ring, verify_tls12_signature, verify_tls13_signature};
use rustls::pki_types::{CertificateDer, ServerName, UnixTime};
use rustls::{ClientConfig, ClientConnection, DigitallySignedStruct, SignatureScheme, StreamOwned};
use serde_json::{Value, json};
use tokio_tungstenite::tungstenite::client::IntoClientRequest as _;
use tokio_tungstenite::tungstenite::{Message, WebSocket};

use crate::support::{Answer, TestLab, batch, exchange, wait_for};

type Stream = StreamOwned<ClientConnection, TcpStream>;

/// Takes the one certificate whose fingerprint the lab shows, as a person does.
#[derive(Debug)]
struct Shown {
    fingerprint: String,
    provider: CryptoProvider,
}

impl ServerCertVerifier for Shown {
    fn verify_server_cert(
        &self,
        certificate: &CertificateDer<'_>,
        _: &[CertificateDer<'_>],
        _: &ServerName<'_>,
        _: &[u8],
        _: UnixTime,
    ) -> Result<ServerCertVerified, rustls::Error> {
        let digest = ::ring::digest::digest(&::ring::digest::SHA256, certificate);
        let bytes: Vec<String> = digest.as_ref().iter().map(|b| format!("{b:02X}")).collect();
        match bytes.join(":") == self.fingerprint {
            true => Ok(ServerCertVerified::assertion()),
            false => Err(rustls::Error::General("another certificate".to_owned())),
        }
    }

    fn verify_tls12_signature(
        &self,
        message: &[u8],
        certificate: &CertificateDer<'_>,
        signed: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, rustls::Error> {
        let known = &self.provider.signature_verification_algorithms;
        verify_tls12_signature(message, certificate, signed, known)
    }

    fn verify_tls13_signature(
        &self,
        message: &[u8],
        certificate: &CertificateDer<'_>,
        signed: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, rustls::Error> {
        let known = &self.provider.signature_verification_algorithms;
        verify_tls13_signature(message, certificate, signed, known)
    }

    fn supported_verify_schemes(&self) -> Vec<SignatureScheme> {
        let known = &self.provider.signature_verification_algorithms;
        known.supported_schemes()
    }
}

/// A browser elsewhere, with a cookie once it has one.
#[derive(Clone)]
pub struct Browser {
    host: String,
    config: Arc<ClientConfig>,
    pub cookie: Option<String>,
}

impl Browser {
    pub fn new(lab: &TestLab) -> Self {
        let shown = Shown {
            fingerprint: lab.running.fingerprint.clone(),
            provider: ring::default_provider(),
        };
        let config = ClientConfig::builder_with_provider(Arc::new(ring::default_provider()))
            .with_safe_default_protocol_versions()
            .unwrap()
            .dangerous()
            .with_custom_certificate_verifier(Arc::new(shown))
            .with_no_client_auth();
        Self {
            host: lab.phone_host(),
            config: Arc::new(config),
            cookie: None,
        }
    }

    /// The same browser at another lab, with its cookie.
    pub fn at(&self, lab: &TestLab) -> Self {
        Self {
            cookie: self.cookie.clone(),
            ..Self::new(lab)
        }
    }

    fn stream(&self) -> Stream {
        let socket = TcpStream::connect(&self.host).unwrap();
        let patience = Some(Duration::from_secs(30));
        socket.set_read_timeout(patience).unwrap();
        let name = ServerName::try_from("127.0.0.1").unwrap();
        let session = ClientConnection::new(self.config.clone(), name).unwrap();
        StreamOwned::new(session, socket)
    }

    /// One request; a cookie that the answer sets is kept.
    pub fn ask(
        &mut self,
        method: &str,
        path: &str,
        headers: &[(&str, &str)],
        body: &[u8],
    ) -> Answer {
        let cookie = self.cookie.clone().unwrap_or_default();
        let mut all = headers.to_vec();
        if self.cookie.is_some() {
            all.push(("cookie", &cookie));
        }
        let answer = exchange(self.stream(), &self.host, method, path, &all, body);
        let set = answer.head.lines().find_map(|line| {
            let (name, value) = line.split_once(": ")?;
            name.eq_ignore_ascii_case("set-cookie").then_some(value)
        });
        if let Some(set) = set {
            for needed in ["__Host-", "Secure", "HttpOnly", "SameSite=Strict", "Path=/"] {
                assert!(set.contains(needed), "{set}");
            }
            self.cookie = set.split(';').next().map(str::to_owned);
        }
        answer
    }

    pub fn get(&mut self, path: &str) -> Answer {
        self.ask("GET", path, &[], b"")
    }

    pub fn post(&mut self, path: &str, body: &Value) -> Answer {
        let headers = [("content-type", "application/json")];
        self.ask("POST", path, &headers, body.to_string().as_bytes())
    }

    /// The key in its cookie.
    pub fn key(&self) -> String {
        let cookie = self.cookie.as_deref().unwrap();
        cookie.split_once('=').unwrap().1.to_owned()
    }

    /// The lab page's WebSocket, if the lab opens it.
    pub fn socket(&self) -> Result<Page, Box<dyn std::error::Error>> {
        let mut request = format!("wss://{}/api/ws", self.host).into_client_request()?;
        if let Some(cookie) = &self.cookie {
            request.headers_mut().insert("cookie", cookie.parse()?);
        }
        let (socket, _) = tokio_tungstenite::tungstenite::client(request, self.stream())
            .map_err(|error| error.to_string())?;
        Ok(Page { socket })
    }
}

/// An open lab page.
pub struct Page {
    socket: WebSocket<Stream>,
}

impl Page {
    pub fn say(&mut self, message: &Value) {
        let text = Message::text(message.to_string());
        self.socket.send(text).unwrap();
    }

    /// Everything up to the first message for which `wanted` holds, that one included.
    pub fn until(&mut self, what: &str, wanted: impl Fn(&Value) -> bool) -> Vec<Value> {
        let mut heard = Vec::new();
        while heard.len() < 20_000 {
            match self.socket.read() {
                Ok(Message::Text(text)) => heard.push(serde_json::from_str(&text).unwrap()),
                Ok(_) => continue,
                Err(error) => panic!("no {what}: {error}"),
            }
            if heard.last().is_some_and(&wanted) {
                return heard;
            }
        }
        panic!("no {what} among 20000 messages");
    }
}

/// A phone with its page.
pub struct Phone {
    pub browser: Browser,
    pub device: String,
    pub session: String,
    pub secret: String,
    events: Vec<Event>,
    seq: u64,
}

impl Phone {
    pub fn new(lab: &TestLab, name: &str, events: Vec<Event>) -> Self {
        Self {
            browser: Browser::new(lab),
            device: format!("{name}-identifier"),
            session: format!("{name}-session"),
            secret: format!("{name}-secret-that-nobody-else-knows"),
            events,
            seq: 0,
        }
    }

    /// Sends the next samples, as so many batches; whether there were as many.
    pub fn send(&mut self, lab: &TestLab, batches: usize) {
        for _ in 0..batches {
            assert!(self.events.len() >= 60, "more samples are needed");
            let chunk: Vec<Event> = self.events.drain(..60).collect();
            let body = batch(&self.device, &self.session, self.seq, &chunk);
            self.seq += 1;
            let token = lab.token().to_owned();
            wait_for("room for a batch", || {
                let headers = [("x-northing-token", token.as_str())];
                let answer = self.browser.ask("POST", "/in", &headers, &body);
                assert!(matches!(answer.status, 200 | 429), "{}", answer.text());
                (answer.status == 200).then_some(())
            });
        }
    }

    /// Tells the lab its secret.
    pub fn join(&mut self, lab: &TestLab) -> Answer {
        let token = lab.token().to_owned();
        self.join_with(&token)
    }

    pub fn join_with(&mut self, token: &str) -> Answer {
        let body = json!({"device": self.device, "session": self.session, "secret": self.secret});
        let headers = [("x-northing-token", token)];
        let body = body.to_string();
        self.browser
            .ask("POST", "/join/phone", &headers, body.as_bytes())
    }

    pub fn mine(&mut self) -> Value {
        let answer = self.browser.get("/api/mine");
        assert_eq!(answer.status, 200, "{}", answer.text());
        answer.json()
    }

    /// Asks for something of its own device.
    pub fn ask(&mut self, request: &Value) -> Answer {
        self.browser.post("/api/ask", request)
    }
}
