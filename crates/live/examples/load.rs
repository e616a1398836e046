//! A class of simulated phones against the program in a process of its own, in real time: is anything
//! lost, does memory grow, what does it cost, and how soon is an estimate on its way to the page?
//!
//! `./scripts/load [--phones 30] [--rate 100] [--minutes 10]` builds the program and runs this.

#[path = "../tests/support/class.rs"]
mod class;

use std::error::Error;
use std::io::{BufRead as _, BufReader, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use class::{Class, Connection, Seen, Sent, Watcher};
use serde_json::Value;

/// What is hoped for on a quiet machine, ms: median and 99th percentile.
const TARGETS_MS: [f64; 2] = [5.0, 25.0];
/// Memory is looked at again after this share of the time, and at the end.
const WARM_UP: f64 = 0.2;

type Outcome<T> = Result<T, Box<dyn Error>>;

/// What is asked for.
struct Asked {
    program: PathBuf,
    class: Class,
}

fn main() -> Outcome<()> {
    let asked = arguments()?;
    let class = asked.class;
    say(&format!(
        "{} phones, {} Hz for each of three sensors, {:.1} minutes in real time",
        class.phones,
        class.rate_hz,
        class.seconds / 60.0
    ))?;
    let folder = tempfile::tempdir()?;
    let mut server = Server::start(&asked.program, folder.path())?;
    let watcher = Watcher::open(&server.lab);
    let meter = server.meter(class.seconds);
    let sent = class.play(&server.app, &server.path);
    // The answers to the last batches are in; their frames may still be on their way.
    thread::sleep(Duration::from_millis(300));
    let seen = watcher.close();
    let status = server.status()?;
    let complete = counts(&sent, &status, &seen)?;
    let measured = meter.join().map_err(|_| "the meter broke off")?;
    server.end()?;
    costs(&measured, class.seconds)?;
    latency(&status)?;
    if !complete {
        return Err("samples were lost, came twice, or frames came out of order".into());
    }
    Ok(())
}

fn say(text: &str) -> Outcome<()> {
    writeln!(std::io::stdout().lock(), "{text}")?;
    Ok(())
}

fn arguments() -> Outcome<Asked> {
    let mut class = Class {
        phones: 30,
        rate_hz: 100.0,
        seconds: 600.0,
    };
    let mut program = None;
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        let value = words.next().ok_or(format!("{word}: a value is missing"))?;
        match word.as_str() {
            "--phones" => class.phones = value.parse()?,
            "--rate" => class.rate_hz = value.parse()?,
            "--minutes" => class.seconds = 60.0 * value.parse::<f64>()?,
            "--program" => program = Some(PathBuf::from(value)),
            _ => {
                return Err(format!(
                    "{word}: expected --program FILE, --phones, --rate (Hz) or --minutes"
                )
                .into());
            }
        }
    }
    let is_sensible = (1..=64).contains(&class.phones)
        && (1.0..=1000.0).contains(&class.rate_hz)
        && (1.0..=86_400.0).contains(&class.seconds);
    if !is_sensible {
        return Err("expected 1 to 64 phones, 1 to 1000 Hz, a second to a day".into());
    }
    let program = program.ok_or("--program FILE: the northing to test is missing")?;
    Ok(Asked { program, class })
}

/// The program as a lab in a process of its own.
struct Server {
    child: Child,
    lab: String,
    app: String,
    path: String,
}

impl Server {
    fn start(program: &Path, data: &Path) -> Outcome<Self> {
        let mut child = Command::new(program)
            .args([
                "live",
                "--local",
                "--no-open",
                "--json",
                "--port",
                "0",
                "--data-dir",
            ])
            .arg(data)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .spawn()?;
        let mut lines = BufReader::new(child.stdout.take().ok_or("no output")?);
        let mut line = String::new();
        lines.read_line(&mut line)?;
        // Whoever does not read what a program says stops it in the end.
        thread::spawn(move || std::io::copy(&mut lines, &mut std::io::sink()));
        let ready: Value = serde_json::from_str(&line)?;
        let place = |key: &str| -> Outcome<(String, String)> {
            let url = ready[key].as_str().ok_or(format!("no address `{key}`"))?;
            let (_, rest) = url.split_once("://").ok_or("an address")?;
            let (host, path) = rest.split_once('/').ok_or("an address")?;
            Ok((host.to_owned(), format!("/{path}")))
        };
        let ((lab, _), (app, path)) = (place("lab")?, place("ingest")?);
        Ok(Self {
            child,
            lab,
            app,
            path,
        })
    }

    fn status(&self) -> Outcome<Value> {
        let (_, body) = Connection::open(&self.lab).get(&self.lab, "/api/status");
        Ok(serde_json::from_slice(&body)?)
    }

    /// Measures the process while the phones send.
    fn meter(&self, seconds: f64) -> thread::JoinHandle<Measured> {
        let process = self.child.id();
        thread::spawn(move || {
            let start = (Instant::now(), cpu_s(process));
            let before = memory_mb(process);
            thread::sleep(Duration::from_secs_f64(seconds * WARM_UP));
            let warm = memory_mb(process);
            thread::sleep(Duration::from_secs_f64(seconds * (1.0 - WARM_UP)));
            let used = cpu_s(process).zip(start.1).map(|(end, start)| end - start);
            Measured {
                memory_mb: [before, warm, memory_mb(process)],
                cores: used.map(|used| used / start.0.elapsed().as_secs_f64()),
            }
        })
    }

    fn end(&mut self) -> Outcome<()> {
        self.child.kill()?;
        self.child.wait()?;
        Ok(())
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        // It has ended already, unless something went wrong.
        let _ = self.child.kill();
    }
}

/// What the process cost.
struct Measured {
    /// Resident memory at the start, after the warm-up, at the end.
    memory_mb: [Option<f64>; 3],
    /// Processor time over time.
    cores: Option<f64>,
}

/// Resident memory of a process, where the system tells.
fn memory_mb(process: u32) -> Option<f64> {
    let text = std::fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = text.lines().find(|line| line.starts_with("VmRSS:"))?;
    let kilobytes: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kilobytes / 1024.0)
}

/// Processor time that a process has used, s; Linux counts it in hundredths.
fn cpu_s(process: u32) -> Option<f64> {
    let text = std::fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    // The name may hold spaces; what follows its parenthesis does not.
    let (_, rest) = text.rsplit_once(')')?;
    let ticks = |n: usize| rest.split_whitespace().nth(n)?.parse::<f64>().ok();
    Some((ticks(11)? + ticks(12)?) / 100.0)
}

/// Prints what became of every phone's samples; returns whether all is complete and in order.
fn counts(sent: &[Sent], status: &Value, seen: &Seen) -> Outcome<bool> {
    say("\nphone      sent  received  lost  twice  late  refused  asked to wait  frames")?;
    let devices = status["devices"].as_array().ok_or("no devices")?;
    let mut complete = seen.disorder.is_empty();
    for phone in sent {
        let device = devices.iter().find(|d| d["id"] == *phone.device);
        let count = |key: &str| device.and_then(|d| d[key].as_u64());
        let [received, lost, late, refused] =
            ["received", "lost", "late", "refused"].map(|key| count(key).unwrap_or(0));
        let twice = count("duplicated").unwrap_or(0) + count("duplicated_batches").unwrap_or(0);
        complete &= received == phone.samples && lost + twice + late + refused == 0;
        let (frames, _) = seen.frames.get(&phone.device).copied().unwrap_or_default();
        say(&format!(
            "{:<9}{:>6}{received:>10}{lost:>6}{twice:>7}{late:>6}{refused:>9}{:>15}{frames:>8}",
            phone.device, phone.samples, phone.again
        ))?;
    }
    for line in seen.disorder.iter().take(10) {
        say(&format!("out of order: {line}"))?;
    }
    Ok(complete)
}

fn costs(measured: &Measured, seconds: f64) -> Outcome<()> {
    let shown =
        |value: Option<f64>| value.map_or("not known here".to_owned(), |v| format!("{v:.1} MB"));
    let [before, warm, end] = measured.memory_mb.map(shown);
    let warm_s = seconds * WARM_UP;
    say(&format!(
        "\nmemory: {before} at the start, {warm} after {warm_s:.0} s, {end} at the end"
    ))?;
    match measured.cores {
        Some(cores) => say(&format!("processor: {:.1} % of one core", 100.0 * cores)),
        None => say("processor: not known here"),
    }
}

/// From the arrival of a batch's last sample to the moment its estimate has been sent to the page.
fn latency(status: &Value) -> Outcome<()> {
    let latency = &status["latency"];
    let number = |key: &str| latency[key].as_f64().unwrap_or(f64::NAN);
    say(&format!(
        "latency from a batch to the page: median {:.2} ms, p99 {:.2} ms, longest {:.2} ms of {} frames \
         (hoped for: median below {} ms, p99 below {} ms)",
        number("median_ms"),
        number("p99_ms"),
        number("longest_ms"),
        latency["frames"],
        TARGETS_MS[0],
        TARGETS_MS[1]
    ))
}
