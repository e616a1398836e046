//! `northing live`: the lab on this computer, phones deliver into it.

#[cfg_attr(not(feature = "foxglove"), path = "live/without_foxglove.rs")]
mod foxglove;

use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use anyhow::{Context, Result, anyhow, bail};
use clap::{Args, ValueEnum};
use northing_evaluation::attitude::own;
use northing_evaluation::{EstimatorKind, Profile, RunOptions, RunSummary};
use northing_live::audience::Told;
use northing_live::inputs::{InputKind, InputSpec};
use northing_live::replay::{self, Speed};
use northing_live::server::{self, LiveConfig, Running, StartError};
use northing_live::tls::CertificateFiles;
use northing_live::{lab::Lab, qr};
use serde_json::{Value, json};

use crate::files::output::print;
use crate::interrupt;

/// Who reads the events so slowly is not waited for at the end.
const LAST_WORDS: Duration = Duration::from_secs(2);
/// How often a running lab looks whether Ctrl-C was pressed.
const LOOK_INTERVAL: Duration = Duration::from_millis(100);

/// Port of the lab page, unless another is asked for.
const PORT: u16 = 7770;

/// Arguments of `live`.
#[derive(Debug, Default, Args)]
#[command(
    long_about = "Starts the lab: a page on this computer, and an address for phones. Scan the QR code with a \
                  phone in the same network and accept the certificate once; or add a virtual phone on the \
                  page. Who sits at this computer is the teacher and sees and steers every device. A student sees and steers \
                  its own phone: on the phone, or on a laptop with a code that the phone shows. Nothing is fetched \
                  from elsewhere.",
    after_help = "\
Examples:
  northing live
  northing live --port 8000 --no-open
  northing live --input sensorserver=192.168.1.20:8080 --input linkoping
  northing live --replay walk.csv
  northing live --estimator mine.py:Mine
  northing live --no-open --json
  northing live --replay walk.csv --speed max --exit --json | tail -n 1

Ports: the lab page on N (this computer only), the phone page on N+1 (TLS), and there the lab page for students and for
whoever has the address of --teacher-link; uploads of apps on N+2.
Inputs: apps with a server of their own, and apps that connect to this computer (these have no token: anybody in
the network can send; with --local only this computer). They can be added on the page, too."
)]
pub(crate) struct LiveArgs {
    /// Port of the lab page; phones use the next, apps the one after; 0 takes free ones [default: 7770, or free
    /// ones if it is taken]
    #[arg(long, value_name = "N")]
    port: Option<u16>,
    /// Do not open the lab page in a browser
    #[arg(long)]
    no_open: bool,
    /// Print one JSON line when ready and one for each event, and open no browser
    #[arg(long)]
    json: bool,
    /// Listen on this computer only: no phones, but virtual ones
    #[arg(long)]
    local: bool,
    /// Play a recording into the lab
    #[arg(long, value_name = "FILE")]
    replay: Option<PathBuf>,
    /// How fast a recording is played
    #[arg(long, value_enum, default_value_t = ReplaySpeed::Real, requires = "replay")]
    speed: ReplaySpeed,
    /// The device of the summary, where the recording holds several
    #[arg(long, value_name = "NAME", requires = "exit")]
    device: Option<String>,
    /// Record nothing
    #[arg(long)]
    no_recording: bool,
    /// Folder for recordings of everything that arrives; default: `recordings` in the folder for data
    #[arg(long, value_name = "FOLDER", conflicts_with = "no_recording")]
    recordings: Option<PathBuf>,
    /// End when the recording has ended, with the summary of `northing run`
    #[arg(long, requires = "replay")]
    exit: bool,
    /// Take samples from this input, too (repeatable): sensorserver=HOST:PORT, phyphox=HOST:PORT,
    /// linkoping[=PORT], hyperimu[=PORT], sensorstreamer[=PORT], razor=DEVICE, northing=DEVICE (or DEVICE@BAUD)
    #[arg(long = "input", value_name = "KIND=ADDRESS")]
    inputs: Vec<InputSpec>,
    /// An estimator of your own beside ours: a class of Python in a file, such as mine.py:Mine (repeatable); it runs in a
    /// process of its own
    #[arg(long = "estimator", value_name = "FILE:CLASS", value_parser = own_estimator)]
    estimators: Vec<EstimatorKind>,
    /// A board with Northing's firmware on this serial line (as --input northing=DEVICE)
    #[arg(long, value_name = "DEVICE")]
    serial: Option<String>,
    /// Be a server for Foxglove, too: transforms, innovations and lamps of all devices, parameters to set; without an
    /// address on this computer alone, port 8765
    #[cfg(feature = "foxglove")]
    #[arg(long, value_name = "HOST:PORT", num_args = 0..=1, require_equals = true,
          default_missing_value = "127.0.0.1:8765", value_parser = crate::arguments::address::host_and_port)]
    foxglove: Option<std::net::SocketAddr>,
    /// Print an address with which a teacher uses the lab's page from another computer; whoever has it may do everything
    #[arg(long, conflicts_with = "local")]
    teacher_link: bool,
    /// What people call this lab; the pages show it
    #[arg(
        long,
        value_name = "NAME",
        default_value = "",
        hide_default_value = true
    )]
    name: String,
    /// A further name of this computer under which pages may be opened (repeatable)
    #[arg(long = "allowed-host", value_name = "HOST", value_parser = host_name)]
    allowed_hosts: Vec<String>,
    /// Folder for the certificate; default: the user's folder for data
    #[arg(long, value_name = "FOLDER")]
    data_dir: Option<PathBuf>,
    /// A certificate that the phones trust already (PEM), in place of a self-made one
    #[arg(long, value_name = "FILE", requires = "key")]
    cert: Option<PathBuf>,
    /// The private key of --cert (PEM)
    #[arg(long, value_name = "FILE", requires = "cert")]
    key: Option<PathBuf>,
    /// Pages from this folder in place of the built-in ones
    #[arg(long, value_name = "FOLDER")]
    web_dir: Option<PathBuf>,
}

/// How fast a recording is played.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
enum ReplaySpeed {
    /// As it was measured
    #[default]
    Real,
    /// As fast as it goes
    Max,
}

impl LiveArgs {
    /// What `northing` alone starts. A browser opens where somebody looks.
    pub(crate) fn alone() -> Self {
        Self {
            no_open: !std::io::stdout().is_terminal(),
            ..Self::default()
        }
    }
}

/// A class of Python in a file; every device has it from then on.
fn own_estimator(text: &str) -> Result<EstimatorKind, String> {
    own::register_python(text).map_err(|error| error.to_string())
}

/// A host name or address without port.
fn host_name(text: &str) -> Result<String, String> {
    let is_label = |b: u8| b.is_ascii_alphanumeric() || b == b'.' || b == b'-';
    let bare = text.strip_prefix('[').and_then(|t| t.strip_suffix(']'));
    let is_v6 = bare.is_some_and(|v6| v6.parse::<std::net::Ipv6Addr>().is_ok());
    if is_v6 || (!text.is_empty() && text.bytes().all(is_label)) {
        return Ok(text.to_owned());
    }
    Err(
        "expected a name or an address of this computer without port, e.g. lab.example.org"
            .to_owned(),
    )
}

/// Runs the lab until Ctrl-C, or until the recording has ended.
pub(crate) fn execute(args: &LiveArgs) -> Result<()> {
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .build()
        .context("the lab's threads")?;
    let outcome = runtime.block_on(run(args));
    runtime.shutdown_timeout(Duration::from_secs(1));
    outcome
}

async fn run(args: &LiveArgs) -> Result<()> {
    if !args.estimators.is_empty() && args.speed == ReplaySpeed::Max {
        bail!(
            "--speed max is faster than an estimator of your own may follow; leave it out, or use northing compare"
        );
    }
    let options = match args.replay {
        // What `northing run` takes.
        Some(_) => RunOptions::default(),
        None => RunOptions::new(EstimatorKind::Mekf, Profile::Lab),
    };
    let data_dir = args.data_dir.clone().map_or_else(data_dir, Ok)?;
    let config = LiveConfig {
        port: args.port.unwrap_or(PORT),
        recordings: recordings(args, &data_dir),
        data_dir,
        certificate: match (&args.cert, &args.key) {
            (Some(certificate), Some(key)) => Some(CertificateFiles {
                certificate: certificate.clone(),
                key: key.clone(),
            }),
            _ => None,
        },
        web_dir: args.web_dir.clone(),
        network: !args.local,
        patience: Default::default(),
        options: options.clone(),
        name: args.name.clone(),
        teacher_link: args.teacher_link,
        allowed_hosts: args.allowed_hosts.clone(),
    };
    let running = start(config, args.port.is_none()).await?;
    let events = running.lab.listen();
    let foxglove = foxglove::start(args, &running.lab)?;
    ready(
        args,
        &running,
        foxglove.as_ref().map(foxglove::Viewers::url),
    )?;
    let board = args.serial.as_deref();
    let board = board.map(|device| InputSpec::new(InputKind::Northing, device));
    for input in args.inputs.iter().chain(&board.transpose()?) {
        let added = running.inputs.add(input.clone());
        added.map_err(|text| anyhow!(text))?;
    }
    let (end, ended) = tokio::sync::oneshot::channel();
    let telling = tokio::spawn(tell(events, ended, args.json));
    let outcome = work(args, &running.lab, &options).await;
    running.stop().await;
    if let Some(viewers) = foxglove {
        viewers.stop().await;
    }
    // The summary comes last.
    drop(end);
    let _ = tokio::time::timeout(LAST_WORDS, telling).await;
    match outcome? {
        Some(summary) if args.json => print(&format!("{}\n", serde_json::to_string(&summary)?)),
        Some(summary) => print(&crate::text::attitude::describe(&summary)),
        None => Ok(()),
    }
}

/// Starts the lab; where nobody asked for its port and it is taken, on free ones.
async fn start(config: LiveConfig, any_port: bool) -> Result<Running> {
    match server::start(config.clone()).await {
        Err(StartError::Port { .. }) if any_port => {
            Ok(server::start(LiveConfig { port: 0, ..config }).await?)
        }
        started => Ok(started?),
    }
}

/// Plays what is to be played, then waits. Ctrl-C ends both.
async fn work(
    args: &LiveArgs,
    lab: &std::sync::Arc<Lab>,
    options: &RunOptions,
) -> Result<Option<RunSummary>> {
    if let Some(path) = &args.replay {
        let speed = match args.speed {
            ReplaySpeed::Real => Speed::Real,
            ReplaySpeed::Max => Speed::Max,
        };
        let ended = tokio::select! {
            played = replay::play(lab, path, speed) => {
                played.map_err(|text| anyhow!(text))?;
                true
            }
            () = interrupted() => false,
        };
        if !ended {
            return Ok(None);
        }
        if args.exit {
            let name = path.display().to_string();
            let (path, options) = (path.clone(), options.clone());
            let device = args.device.clone();
            let summary = tokio::task::spawn_blocking(move || {
                replay::summary(&path, device.as_deref(), &options)
            });
            let mut summary = summary.await.context("the summary")??;
            // The name that `northing run` gives it.
            summary.recording = name;
            return Ok(Some(summary));
        }
    }
    interrupted().await;
    Ok(None)
}

async fn interrupted() {
    while !interrupt::happened() {
        tokio::time::sleep(LOOK_INTERVAL).await;
    }
}

/// Where everything is recorded; a recording that is played is not recorded again.
fn recordings(args: &LiveArgs, data_dir: &Path) -> Option<PathBuf> {
    if args.no_recording || args.replay.is_some() {
        return None;
    }
    let folder = args.recordings.clone();
    Some(folder.unwrap_or_else(|| data_dir.join("recordings")))
}

/// Says where the lab is.
fn ready(args: &LiveArgs, running: &Running, foxglove: Option<String>) -> Result<()> {
    let phone = running.phone_urls.first().map_or("", String::as_str);
    let app = running.ingest_urls.first().map_or("", String::as_str);
    if args.json {
        let mut line = json!({
            "event": "ready", "lab": running.lab_url, "phone": phone, "ingest": app,
            "phones": running.phone_urls, "ingests": running.ingest_urls,
            "token": running.token.as_str(), "fingerprint": running.fingerprint,
        });
        if let Some(url) = &running.teacher_url {
            line["teacher"] = json!(url);
        }
        if let Some(url) = foxglove {
            line["foxglove"] = json!(url);
        }
        print(&format!("{line}\n"))?;
        for text in &running.recovered {
            print(&format!(
                "{}\n",
                json!({"event": "recovered", "text": text})
            ))?;
        }
        return Ok(());
    }
    let mut text = format!("The lab is at {}\n\n", running.lab_url);
    if !args.local {
        let join = phone.split_once("/p#").map_or(phone, |(base, _)| base);
        text.push_str(&qr::terminal(phone).unwrap_or_default());
        text.push_str(&format!(
            "\nPhones in the same network: scan the code, or open\n  {}\n\
             The phone warns once, because the certificate is made by this computer: go on.\n\
             Laptops of students: {join}/join, with the code that their phone shows\n\
             Apps that push (Sensor Logger): {app}\n",
            running.phone_urls.join("\n  ")
        ));
    }
    if let Some(url) = &running.teacher_url {
        text.push_str(&format!(
            "A teacher elsewhere (whoever has this address may do everything):\n  {url}\n"
        ));
    }
    if let Some(url) = foxglove {
        text.push_str(&format!("Foxglove: {url}\n"));
    }
    for sentence in &running.recovered {
        text.push_str(&format!("{sentence}\n"));
    }
    text.push_str("No phone at hand? Add a virtual one on the page. Ctrl-C ends the lab.\n");
    print(&text)?;
    if !args.no_open {
        open_browser(&running.lab_url);
    }
    Ok(())
}

/// Opens the page where there is a browser; the address has been printed in any case.
fn open_browser(url: &str) {
    let mut command = if cfg!(target_os = "macos") {
        Command::new("open")
    } else if cfg!(windows) {
        let mut command = Command::new("cmd");
        command.args(["/C", "start", ""]);
        command
    } else {
        Command::new("xdg-open")
    };
    let quiet = command
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    let _ = quiet.arg(url).spawn();
}

/// Prints one line for each event until `ended`, or, for people, what they must know at once. Whoever reads slowly, or not at all, holds up a
/// thread of its own and not the lab.
async fn tell(
    mut events: tokio::sync::broadcast::Receiver<Told>,
    mut ended: tokio::sync::oneshot::Receiver<()>,
    json: bool,
) {
    use tokio::sync::broadcast::error::RecvError;
    loop {
        let received = tokio::select! {
            received = events.recv() => received,
            _ = &mut ended => return,
        };
        let text = match received {
            Ok(text) => text,
            Err(RecvError::Lagged(_)) => continue,
            Err(RecvError::Closed) => return,
        };
        let mut message: Value = serde_json::from_str(&text).unwrap_or_default();
        if !json {
            let failed = message["type"] == "recording" && message["state"] == "failed";
            let text = message["text"].as_str().filter(|_| failed);
            if text.is_some_and(|text| print(&format!("{text}\n")).is_err()) {
                return;
            }
            continue;
        }
        if let Some(object) = message.as_object_mut()
            && let Some(kind) = object.remove("type")
        {
            object.insert("event".to_owned(), kind);
        }
        let printed = tokio::task::spawn_blocking(move || print(&format!("{message}\n"))).await;
        if !matches!(printed, Ok(Ok(()))) {
            return;
        }
    }
}

/// The user's folder for data of this program.
fn data_dir() -> Result<PathBuf> {
    let variable = |name: &str| {
        std::env::var_os(name)
            .filter(|v| !v.is_empty())
            .map(PathBuf::from)
    };
    let home = || std::env::home_dir().filter(|home| home.is_absolute());
    let base = if cfg!(target_os = "macos") {
        home().map(|home| home.join("Library/Application Support"))
    } else if cfg!(windows) {
        variable("LOCALAPPDATA")
    } else {
        variable("XDG_DATA_HOME").or_else(|| home().map(|home| home.join(".local/share")))
    };
    let base = base.context("no folder for the user's data; name one with --data-dir")?;
    Ok(base.join("northing"))
}
