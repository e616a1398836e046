//! Starts the lab: three listeners, one for the lab page, one for phones, one for native apps.

use std::io;
use std::net::{IpAddr, Ipv4Addr, SocketAddr, TcpListener};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::middleware::from_fn_with_state;
use axum_server::Handle;
use axum_server::tls_rustls::RustlsConfig;
use hyper_util::rt::TokioTimer;
use northing_evaluation::RunOptions;

use crate::assets::Assets;
use crate::ingest::{self, Ingest};
use crate::lab::Lab;
use crate::lab_api::{self, Facts, LabApi};
use crate::security::{Names, guard};
use crate::tls::{Certificate, TlsError};
use crate::token::Token;

/// A client must have sent its request's head within so long.
const HEAD_TIMEOUT: Duration = Duration::from_secs(10);
/// Open requests get so long to end when the lab closes.
const GRACE: Duration = Duration::from_millis(500);

/// What a lab is started with.
#[derive(Debug, Clone)]
pub struct LiveConfig {
    /// Port of the lab page; phones use the next, native apps the one after. 0 takes three free ones.
    pub port: u16,
    /// Where certificate and key are kept.
    pub data_dir: PathBuf,
    /// A folder with pages to use in place of the embedded ones.
    pub web_dir: Option<PathBuf>,
    /// Whether phones in the network may connect; otherwise only this computer.
    pub network: bool,
    /// The options that every device starts with.
    pub options: RunOptions,
}

/// What can go wrong at the start.
#[derive(Debug, thiserror::Error)]
pub enum StartError {
    /// A port is taken, or may not be used.
    #[error("port {port}: {error}; choose another with --port")]
    Port {
        /// The port.
        port: u16,
        /// What the system said.
        error: io::Error,
    },
    /// The certificate.
    #[error(transparent)]
    Tls(#[from] TlsError),
    /// The system gives no random numbers.
    #[error("the system gives no random numbers: {0}")]
    Random(String),
    /// There are no three free ports one after the other.
    #[error("three free ports: {0}; choose one with --port")]
    Ports(String),
}

/// A lab that runs.
#[derive(Debug)]
pub struct Running {
    /// The lab.
    pub lab: Arc<Lab>,
    /// Address of the lab page.
    pub lab_url: String,
    /// Addresses of the phone page with the token, the likeliest first.
    pub phone_urls: Vec<String>,
    /// Addresses for native apps with the token, the likeliest first.
    pub ingest_urls: Vec<String>,
    /// The token.
    pub token: Arc<Token>,
    /// SHA-256 of the certificate.
    pub fingerprint: String,
    handles: Vec<Handle<SocketAddr>>,
}

/// Starts the lab. It runs until [`Running::stop`] or until the runtime ends.
///
/// # Errors
/// See [`StartError`].
pub async fn start(config: LiveConfig) -> Result<Running, StartError> {
    let addresses = if config.network {
        lan_addresses()
    } else {
        Vec::new()
    };
    let certificate = Certificate::load_or_make(&config.data_dir, &addresses)?;
    let tls = RustlsConfig::from_config(certificate.server_config()?);
    let token = Token::random().map_err(|error| StartError::Random(error.to_string()))?;
    let token = Arc::new(token);
    let (listeners, port) = listen(config.port, config.network)?;
    let [for_lab, for_phones, for_apps] = listeners;
    let lab = Lab::new(config.options);
    let assets = Arc::new(Assets::new(config.web_dir));
    let shown = if addresses.is_empty() {
        vec![IpAddr::V4(Ipv4Addr::LOCALHOST)]
    } else {
        addresses.clone()
    };
    let urls = |scheme: &str, port: u16, path: &str| -> Vec<String> {
        let url = |address: &IpAddr| {
            let host = SocketAddr::new(*address, port);
            format!("{scheme}://{host}{path}{}", token.as_str())
        };
        shown.iter().map(url).collect()
    };
    let facts = Facts {
        phone_urls: urls("https", port[1], "/p#t="),
        ingest_urls: urls("http", port[2], "/in/"),
        fingerprint: certificate.fingerprint(),
    };
    let ingest = Ingest {
        lab: lab.clone(),
        token: token.clone(),
        assets: assets.clone(),
    };
    let api = LabApi {
        lab: lab.clone(),
        facts: Arc::new(facts.clone()),
        assets,
    };
    let guarded = |router: Router, scheme, port, others: &[IpAddr], origin| {
        router.layer(from_fn_with_state(
            Names::new(scheme, port, others, origin),
            guard,
        ))
    };
    let handles: Vec<Handle<SocketAddr>> = (0..3).map(|_| Handle::new()).collect();
    let lab_router = guarded(lab_api::router(api), "http", port[0], &[], true);
    serve(for_lab, port[0], lab_router, handles[0].clone())?;
    let phone_router = ingest::phone_router(ingest.clone());
    let phone_router = guarded(phone_router, "https", port[1], &addresses, true);
    serve_tls(for_phones, port[1], phone_router, tls, handles[1].clone())?;
    let app_router = guarded(
        ingest::app_router(ingest),
        "http",
        port[2],
        &addresses,
        false,
    );
    serve(for_apps, port[2], app_router, handles[2].clone())?;
    Ok(Running {
        lab,
        lab_url: format!("http://127.0.0.1:{}/", port[0]),
        phone_urls: facts.phone_urls,
        ingest_urls: facts.ingest_urls,
        token,
        fingerprint: facts.fingerprint,
        handles,
    })
}

impl Running {
    /// Closes the listeners and waits a moment for open requests.
    pub async fn stop(&self) {
        for handle in &self.handles {
            handle.graceful_shutdown(Some(GRACE));
        }
        tokio::time::sleep(GRACE / 5).await;
    }
}

fn serve(
    listener: TcpListener,
    port: u16,
    router: Router,
    handle: Handle<SocketAddr>,
) -> Result<(), StartError> {
    let server = axum_server::from_tcp(listener);
    let mut server = server
        .map_err(|error| StartError::Port { port, error })?
        .handle(handle);
    limit_head(server.http_builder());
    tokio::spawn(server.serve(router.into_make_service()));
    Ok(())
}

fn serve_tls(
    listener: TcpListener,
    port: u16,
    router: Router,
    tls: RustlsConfig,
    handle: Handle<SocketAddr>,
) -> Result<(), StartError> {
    let server = axum_server::from_tcp_rustls(listener, tls);
    let mut server = server
        .map_err(|error| StartError::Port { port, error })?
        .handle(handle);
    limit_head(server.http_builder());
    tokio::spawn(server.serve(router.into_make_service()));
    Ok(())
}

fn limit_head(
    builder: &mut hyper_util::server::conn::auto::Builder<hyper_util::rt::TokioExecutor>,
) {
    builder
        .http1()
        .timer(TokioTimer::new())
        .header_read_timeout(HEAD_TIMEOUT);
}

/// Three listeners on ports one after the other, and the ports.
fn listen(port: u16, network: bool) -> Result<([TcpListener; 3], [u16; 3]), StartError> {
    if port != 0 {
        return three(port, network);
    }
    let mut last = String::new();
    for _ in 0..50 {
        let free = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).and_then(|l| l.local_addr());
        match free {
            Ok(address) => match three(address.port(), network) {
                Ok(listeners) => return Ok(listeners),
                Err(error) => last = error.to_string(),
            },
            Err(error) => last = error.to_string(),
        }
    }
    Err(StartError::Ports(last))
}

fn three(port: u16, network: bool) -> Result<([TcpListener; 3], [u16; 3]), StartError> {
    let outside = if network {
        Ipv4Addr::UNSPECIFIED
    } else {
        Ipv4Addr::LOCALHOST
    };
    let past_the_end = || StartError::Ports("the port must be below 65534".to_owned());
    let next = port.checked_add(1).ok_or_else(past_the_end)?;
    let last = port.checked_add(2).ok_or_else(past_the_end)?;
    let bind = |address: Ipv4Addr, port: u16| -> Result<TcpListener, StartError> {
        let failed = |error| StartError::Port { port, error };
        let listener = TcpListener::bind((address, port)).map_err(failed)?;
        listener.set_nonblocking(true).map_err(failed)?;
        Ok(listener)
    };
    let listeners = [
        bind(Ipv4Addr::LOCALHOST, port)?,
        bind(outside, next)?,
        bind(outside, last)?,
    ];
    Ok((listeners, [port, next, last]))
}

/// The addresses of this computer that phones can reach: IPv4, private networks first.
#[must_use]
pub fn lan_addresses() -> Vec<IpAddr> {
    let interfaces = if_addrs::get_if_addrs().unwrap_or_default();
    let mut addresses: Vec<Ipv4Addr> = interfaces
        .iter()
        .filter_map(|interface| match interface.ip() {
            IpAddr::V4(v4) if !v4.is_loopback() && !v4.is_link_local() => Some(v4),
            _ => None,
        })
        .collect();
    addresses.sort_by_key(|address| (!address.is_private(), *address));
    addresses.dedup();
    addresses.into_iter().map(IpAddr::V4).collect()
}
