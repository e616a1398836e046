//! Embeds the pages: takes `web/dist`, builds it with npm when it is missing or older than
//! its sources, and otherwise embeds a page that says how to build it.
//!
//! The network is asked only where `web/node_modules` is missing. Releases and source packages carry
//! `web/dist`, so that nobody who builds them needs npm. `NORTHING_WEB_BUILD=0` never runs npm.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::SystemTime;

/// The folders of `web/dist`; every file in them is embedded.
const FOLDERS: [&str; 4] = ["lab", "phone", "join", "report"];
/// The file of each folder that is written last.
const LAST: [&str; 4] = [
    "lab/lab.js.gz",
    "phone/phone.js.gz",
    "join/join.js.gz",
    "report/report.js.gz",
];

/// What the pages are made of.
const SOURCES: [&str; 9] = [
    "lab",
    "phone",
    "join",
    "report",
    "instrument",
    "words",
    "scripts",
    "package-lock.json",
    "tsconfig.json",
];

fn main() -> io::Result<()> {
    println!("cargo:rerun-if-env-changed=NORTHING_WEB_BUILD");
    let web = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../web");
    for source in SOURCES.iter().chain(&["dist"]) {
        println!("cargo:rerun-if-changed={}", web.join(source).display());
    }
    if web.is_dir() && !is_fresh(&web) && std::env::var("NORTHING_WEB_BUILD").as_deref() != Ok("0")
    {
        build(&web);
    }
    let out = PathBuf::from(std::env::var_os("OUT_DIR").ok_or(io::ErrorKind::NotFound)?);
    fs::write(out.join("assets.rs"), assets(&web.join("dist"))?)
}

/// The table of embedded files as Rust text.
fn assets(dist: &Path) -> io::Result<String> {
    let mut text = String::from("&[\n");
    for folder in FOLDERS {
        let entries = fs::read_dir(dist.join(folder)).into_iter().flatten();
        let mut paths: Vec<_> = entries.flatten().map(|entry| entry.path()).collect();
        paths.sort();
        for path in paths.iter().filter(|path| path.is_file()) {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            let (file, path) = (format!("{folder}/{name}"), fs::canonicalize(path)?);
            text.push_str(&format!("    ({file:?}, include_bytes!({path:?})),\n"));
        }
    }
    text.push(']');
    Ok(text)
}

/// Whether every page is there and no source is newer.
fn is_fresh(web: &Path) -> bool {
    let oldest = LAST
        .iter()
        .map(|file| modified(&web.join("dist").join(file)))
        .min();
    let newest = SOURCES.iter().map(|name| newest_in(&web.join(name))).max();
    oldest > Some(SystemTime::UNIX_EPOCH) && oldest >= newest
}

fn modified(path: &Path) -> SystemTime {
    let time = fs::metadata(path).and_then(|metadata| metadata.modified());
    time.unwrap_or(SystemTime::UNIX_EPOCH)
}

/// Of a file, or of everything in a folder.
fn newest_in(path: &Path) -> SystemTime {
    if !path.is_dir() {
        return modified(path);
    }
    let entries = fs::read_dir(path).into_iter().flatten().flatten();
    let times = entries.map(|entry| newest_in(&entry.path()));
    times.max().unwrap_or(SystemTime::UNIX_EPOCH)
}

fn build(web: &Path) {
    let run = |arguments: &[&str]| {
        let output = Command::new("npm")
            .args(arguments)
            .current_dir(web)
            .output();
        match output {
            Ok(output) if output.status.success() => true,
            Ok(output) => {
                let said = String::from_utf8_lossy(&output.stderr).into_owned();
                // npm warns about much before it says what failed.
                let line = said.lines().find(|line| !line.starts_with("npm warn"));
                warn(&format!(
                    "the pages of the lab are not built: `npm {}` in web/ failed: {}",
                    arguments.join(" "),
                    line.unwrap_or("no message")
                ));
                false
            }
            Err(_) => {
                warn(
                    "npm was not found, so the pages of the lab are not built. Install Node.js 18 or newer \
                     (Debian: apt-get install nodejs npm) and build again; or build without the lab, with \
                     --no-default-features.",
                );
                false
            }
        }
    };
    if web.join("node_modules").is_dir() || run(&["ci", "--no-audit", "--no-fund"]) {
        run(&["run", "build"]);
    }
}

fn warn(text: &str) {
    println!("cargo:warning={text}");
}
