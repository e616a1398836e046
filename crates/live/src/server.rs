//! Starts the lab: three listeners, one for the lab page, one for phones, one for native apps.

use std::io;
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::path::PathBuf;
use std::sync::{Arc, Weak};
use std::time::Duration;

use axum::Router;
use axum::middleware::from_fn_with_state;
use axum_server::Handle;
use axum_server::tls_rustls::{RustlsAcceptor, RustlsConfig};
use hyper_util::rt::TokioTimer;
use northing_evaluation::RunOptions;
use tokio::time::MissedTickBehavior;

use crate::addresses::{Addresses, Reach, local_name};
use crate::assets::Assets;
use crate::connections::{Gate, Patience, Places};
use crate::credentials::Credentials;
use crate::file_limit::Shares;
use crate::hand_in_api::HandInApi;
use crate::hand_ins::HandIns;
use crate::ingest::{self, Ingest};
use crate::inputs::Inputs;
use crate::join::{self, Joining};
use crate::lab::Lab;
use crate::lab_api::{self, Facts, LabApi};
use crate::limits::Peer;
use crate::mdns::{self, Announcement, Where};
use crate::opened_api;
use crate::recorder;
use crate::recordings_api;
use crate::roles::Role;
use crate::security::{Names, guard};
use crate::tls::{Certificate, CertificateFiles, TlsError};
use crate::token::Token;

/// A client must have sent its request's head within so long.
const HEAD_TIMEOUT: Duration = Duration::from_secs(10);
/// Open requests get so long to end when the lab closes.
const GRACE: Duration = Duration::from_millis(500);
/// How often the addresses of this computer are looked at.
const LOOK_INTERVAL: Duration = Duration::from_secs(3);

/// What a lab is started with.
#[derive(Debug, Clone, Default)]
pub struct LiveConfig {
    /// Port of the lab page; phones use the next, native apps the one after. 0 takes three free ones.
    pub port: u16,
    /// Where certificate and key are kept.
    pub data_dir: PathBuf,
    /// A certificate that phones trust already, in place of a self-made one.
    pub certificate: Option<CertificateFiles>,
    /// A folder with pages to use in place of the embedded ones.
    pub web_dir: Option<PathBuf>,
    /// Whether phones in the network may connect; otherwise only this computer.
    pub network: bool,
    /// How long silent connections are kept.
    pub patience: Patience,
    /// Where everything is recorded; `None` for no recording, and then nothing else is kept in `data_dir` either.
    pub recordings: Option<PathBuf>,
    /// The options that every device starts with.
    pub options: RunOptions,
    /// What people call this lab: pages show it. May be empty.
    pub name: String,
    /// Whether a teacher may come from elsewhere, by a link.
    pub teacher_link: bool,
    /// Further names under which the listeners answer, such as `lab.example.org`, without port.
    pub allowed_hosts: Vec<String>,
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
    /// The folder for data could not be read.
    #[error("the folder for data: {0}")]
    Data(String),
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
    /// Address of the lab page for a teacher elsewhere, where one may be.
    pub teacher_url: Option<String>,
    /// What the lab goes out for or listens for.
    pub inputs: Arc<Inputs>,
    /// SHA-256 of the certificate.
    pub fingerprint: String,
    /// A sentence about each recording that was found unfinished, and about what else in the folder for data could not be
    /// taken.
    pub recovered: Vec<String>,
    credentials: Arc<Credentials>,
    handles: Vec<Handle<SocketAddr>>,
    /// The lab's name goes with it.
    _announcement: Option<Announcement>,
}

/// Starts the lab. It runs until [`Running::stop`] or until the runtime ends.
///
/// # Errors
/// See [`StartError`].
pub async fn start(config: LiveConfig) -> Result<Running, StartError> {
    let (addresses, name) = if config.network {
        (Addresses::now(), local_name())
    } else {
        (Addresses::default(), None)
    };
    let lab_name = config.network.then(|| mdns::NAME.to_owned());
    let names = name.iter().chain(&lab_name).chain(&config.allowed_hosts);
    let names: Vec<String> = names.cloned().collect();
    let certificate = match &config.certificate {
        Some(files) => Certificate::read(files)?,
        None => Certificate::load_or_make(&config.data_dir, &addresses.shown, &names)?,
    };
    let tls = RustlsConfig::from_config(certificate.server_config()?);
    let (listeners, port) = listen(config.port, config.network)?;
    let [for_lab, for_phones, for_apps] = listeners;
    let mut recovered = recovered(config.recordings.clone()).await;
    let lab = lab(&config).await?;
    recovered.extend(lab.notes.iter().cloned());
    let opened = Credentials::open(lab.persistence.clone(), config.teacher_link);
    let (credentials, note) = opened.map_err(|error| StartError::Random(error.to_string()))?;
    recovered.extend(note);
    let credentials = Arc::new(credentials);
    let token = credentials.lab().clone();
    let reach = Reach::new(addresses, name, [port[1], port[2]], token.clone());
    let reach = Arc::new(reach);
    let assets = Arc::new(Assets::new(config.web_dir));
    let inputs = Inputs::new(lab.clone(), config.network.then(|| reach.clone()));
    let facts = Arc::new(Facts {
        reach: reach.clone(),
        fingerprint: certificate.fingerprint(),
        name: shortened(&config.name),
        inputs: inputs.clone(),
    });
    let ingest = Ingest {
        lab: lab.clone(),
        token: token.clone(),
        assets: assets.clone(),
        addresses: Arc::default(),
        name: facts.name.as_str().into(),
    };
    let of_data = |name: &str| {
        let keeps = config.recordings.is_some();
        keeps.then(|| config.data_dir.join(name))
    };
    let api = LabApi {
        hand_ins: HandInApi::new(lab.clone(), HandIns::new(of_data("hand-ins"))),
        lab: lab.clone(),
        facts: facts.clone(),
        assets,
    };
    let guarded = |router: Router, scheme, port, reach, origin| {
        let names = Names::new(scheme, port, reach, origin).and(&config.allowed_hosts);
        router.layer(from_fn_with_state(names, guard))
    };
    let shares = Shares::raised();
    // Behind one address a class may be.
    let places = Places::new(shares.phones, shares.phones / 2);
    let gate = |tls, places: &Arc<Places>| Gate::new(tls, places.clone(), config.patience);
    let handles: Vec<Handle<SocketAddr>> = (0..3).map(|_| Handle::new()).collect();
    let opened = opened_api::router(&lab, of_data("opened"), config.recordings.clone());
    let files = recordings_api::router(config.recordings.clone()).merge(opened);
    let router = lab_api::router(api.clone(), files.clone());
    let router = guarded(router, "http", port[0], None, true);
    let lab_gate = gate(None, &Places::new(shares.pages, shares.pages));
    serve(for_lab, port[0], router, lab_gate, handles[0].clone())?;
    let joining = Joining {
        credentials: credentials.clone(),
        ingest: ingest.clone(),
    };
    let shared = lab_api::shared_router(api, files, credentials.clone());
    let router = ingest::phone_router(ingest.clone())
        .merge(join::router(joining))
        .merge(shared);
    let router = guarded(router, "https", port[1], Some(reach.clone()), true);
    let phone_gate = gate(Some(RustlsAcceptor::new(tls)), &places);
    serve(for_phones, port[1], router, phone_gate, handles[1].clone())?;
    let router = ingest::app_router(ingest);
    let router = guarded(router, "http", port[2], Some(reach.clone()), false);
    serve(
        for_apps,
        port[2],
        router,
        gate(None, &places),
        handles[2].clone(),
    )?;
    if config.network {
        tokio::spawn(follow_addresses(Arc::downgrade(&lab), facts.clone()));
    }
    let announcement = config
        .network
        .then(|| announced(port[1], &lab, &facts))
        .flatten();
    Ok(Running {
        lab,
        lab_url: format!("http://127.0.0.1:{}/", port[0]),
        phone_urls: reach.phone_urls(),
        ingest_urls: reach.ingest_urls(),
        teacher_url: credentials.teacher().map(|token| reach.teacher_url(token)),
        token,
        credentials,
        inputs,
        fingerprint: facts.fingerprint.clone(),
        recovered,
        handles,
        _announcement: announcement,
    })
}

/// Answers for the lab's name on the network, and tells the pages once it does.
fn announced(port: u16, lab: &Arc<Lab>, facts: &Arc<Facts>) -> Option<Announcement> {
    // A label of DNS has no more than 63 bytes; dots part labels.
    let name = facts.name.replace('.', " ");
    let instance = match name.floor_char_boundary(60) {
        0 => "Northing lab",
        end => &name[..end],
    };
    let (told_lab, told_facts) = (Arc::downgrade(lab), Arc::downgrade(facts));
    let told = move || {
        if let (Some(lab), Some(facts)) = (told_lab.upgrade(), told_facts.upgrade()) {
            lab.tell(&lab_api::hello(&facts, &Role::Teacher));
        }
    };
    Announcement::begin(port, instance, Where::Networks, &facts.reach, told)
}

/// Looks again and again under which addresses this computer is reached, and tells the pages when
/// that changes: a hotspot was turned on, another network was joined. The certificate stays, so
/// that phones that have accepted it are not asked again.
async fn follow_addresses(lab: Weak<Lab>, facts: Arc<Facts>) {
    let mut tick = tokio::time::interval(LOOK_INTERVAL);
    tick.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        tick.tick().await;
        let Ok(addresses) = tokio::task::spawn_blocking(Addresses::now).await else {
            return;
        };
        let Some(lab) = lab.upgrade() else { return };
        if facts.reach.update(addresses) {
            lab.tell(&lab_api::hello(&facts, &Role::Teacher));
        }
    }
}

impl Running {
    /// Closes the listeners, waits a moment for open requests, and completes the recording.
    pub async fn stop(&self) {
        for handle in &self.handles {
            handle.graceful_shutdown(Some(GRACE));
        }
        tokio::time::sleep(GRACE / 5).await;
        let (lab, credentials) = (self.lab.clone(), self.credentials.clone());
        let end = move || {
            credentials.forget();
            lab.close_recording();
        };
        // A thread that cannot be had leaves the file to the next start.
        let _ = tokio::task::spawn_blocking(end).await;
    }
}

/// The lab with what earlier starts have left in the folder for data; nothing is kept where nothing is to be recorded.
async fn lab(config: &LiveConfig) -> Result<Arc<Lab>, StartError> {
    let (options, recordings) = (config.options.clone(), config.recordings.clone());
    let saved = recordings.is_some().then(|| config.data_dir.join("lab"));
    let opening = tokio::task::spawn_blocking(move || Lab::persistent(options, recordings, saved));
    opening
        .await
        .map_err(|error| StartError::Data(error.to_string()))
}

/// Makes unfinished recordings whole, aside.
async fn recovered(folder: Option<PathBuf>) -> Vec<String> {
    let Some(folder) = folder else {
        return Vec::new();
    };
    let work = tokio::task::spawn_blocking(move || recorder::recover_all(&folder));
    work.await.unwrap_or_default()
}

/// A name as pages can show it.
fn shortened(name: &str) -> String {
    let shown = name.chars().filter(|c| !c.is_control());
    shown.take(60).collect::<String>().trim().to_owned()
}

fn serve(
    listener: TcpListener,
    port: u16,
    router: Router,
    gate: Gate,
    handle: Handle<SocketAddr>,
) -> Result<(), StartError> {
    let server = axum_server::from_tcp(listener);
    let server = server.map_err(|error| StartError::Port { port, error })?;
    let mut server = server.acceptor(gate).handle(handle);
    limit_head(server.http_builder());
    let service = router.into_make_service_with_connect_info::<Peer>();
    tokio::spawn(server.serve(service));
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
