//! Embeds the pages of the lab: takes `web/dist`, builds it with npm when it is missing or older than
//! its sources, and otherwise embeds a page that says how to build it.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::SystemTime;

/// The files of the pages, as `web/README.md` names them.
const FILES: [&str; 8] = [
    "lab/index.html",
    "lab/lab.js",
    "lab/lab.css",
    "lab/icon.svg",
    "phone/index.html",
    "phone/phone.js",
    "phone/phone.css",
    "phone/icon.svg",
];

fn main() -> io::Result<()> {
    println!("cargo:rerun-if-env-changed=NORTHING_WEB_BUILD");
    let web = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../web");
    for source in ["lab", "phone", "scripts", "package-lock.json", "dist"] {
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
    for file in FILES {
        let path = dist.join(file);
        if path.is_file() {
            let path = fs::canonicalize(path)?;
            text.push_str(&format!("    ({file:?}, include_bytes!({path:?})),\n"));
        }
    }
    text.push(']');
    Ok(text)
}

/// Whether every page is there and no source is newer.
fn is_fresh(web: &Path) -> bool {
    let oldest = FILES
        .iter()
        .map(|file| modified(&web.join("dist").join(file)))
        .min();
    let newest = ["lab", "phone", "scripts"]
        .into_iter()
        .map(|folder| newest_in(&web.join(folder)))
        .max();
    oldest > Some(SystemTime::UNIX_EPOCH) && oldest >= newest
}

fn modified(path: &Path) -> SystemTime {
    let time = fs::metadata(path).and_then(|metadata| metadata.modified());
    time.unwrap_or(SystemTime::UNIX_EPOCH)
}

fn newest_in(folder: &Path) -> SystemTime {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let times = entries.map(|entry| match entry.path() {
        path if path.is_dir() => newest_in(&path),
        path => modified(&path),
    });
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
                let line = said.lines().next().unwrap_or("no message").to_owned();
                warn(&format!(
                    "`npm {}` in web/ failed: {line}",
                    arguments.join(" ")
                ));
                false
            }
            Err(_) => {
                warn(
                    "npm was not found, so the pages of the lab are not built. Install Node.js and build again.",
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
