//! `northing describe`: the manifest of tables that do not open by themselves, drafted.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::Args;
use northing_recording::atomic_file::write_whole;
use northing_recording::describe::{Draft, draft};
use northing_recording::{Contents, OpenOptions, manifest};
use serde::Serialize;

use crate::commands::info;
use crate::files::output::{check_free, check_not_input, print, print_json};
use crate::files::shown;
use crate::invocation::called;
use crate::progress::watched;
use crate::text::table::Table;

/// Arguments of `describe`.
#[derive(Debug, Args)]
#[command(
    long_about = "Drafts the manifest of one or several tables: what separates the cells, which columns are the time and \
                  the sensors, their units, axes and orders. Names tell what they can; the rest is told by physics: a \
                  resting accelerometer shows gravity, a magnetometer the Earth's field, gravity turns as the gyroscope \
                  says, and positions move at the receiver's speed. Every guess has its reason and says how sure it is. \
                  The files are then read by it. Without --out the manifest goes to standard output and the rest to \
                  standard error.",
    after_help = "\
Examples:
  northing describe imu.txt                        # look at the guesses
  northing describe imu.txt --out imu.toml
  northing run imu.toml
  northing run imu.txt --describe                  # guess, say so and run
  northing describe gyro.csv accel.csv gps.csv --out walk.toml
  northing describe saved_by_numpy.csv --rate 285.7 --out imu.toml"
)]
pub(crate) struct DescribeArgs {
    /// The tables: text with rows of numbers. A file that opens by itself is taken along as it is
    #[arg(value_name = "FILE", required = true)]
    files: Vec<PathBuf>,
    /// Write the manifest to this file, whose name ends in .toml
    #[arg(long, value_name = "FILE.toml")]
    out: Option<PathBuf>,
    /// Overwrite the manifest if it exists
    #[arg(long)]
    force: bool,
    /// Rows in a second, of tables without time stamps or with stamps that many rows share
    #[arg(long, value_name = "HZ", value_parser = rate)]
    rate: Option<f64>,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
}

fn rate(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(rate) if (1e-3..=1e6).contains(&rate) => Ok(rate),
        _ => Err("expected rows in a second, 0.001 to 1000000, e.g. 100".to_owned()),
    }
}

/// The document.
#[derive(Serialize)]
struct Json<'a> {
    #[serde(flatten)]
    draft: &'a Draft,
    duration_s: f64,
    sensors: Vec<northing_recording::SensorContents>,
}

/// Drafts and reads.
pub(crate) fn execute(args: &DescribeArgs) -> Result<()> {
    if let Some(out) = &args.out {
        if out.extension().is_none_or(|ending| ending != "toml") {
            bail!(
                "{}: a manifest is known by its ending; name a file that ends in .toml",
                shown(out)
            );
        }
        for file in &args.files {
            check_not_input(out, file, None)?;
        }
        check_free(out, args.force)?;
    }
    // A draft that is not written stands for one in the current folder.
    let place = args
        .out
        .clone()
        .unwrap_or_else(|| PathBuf::from("the draft"));
    let folder = place.parent().unwrap_or(Path::new(""));
    let draft = draft(&args.files, folder, args.rate)?;
    if let ([one], true) = (&args.files[..], draft.guesses.is_empty()) {
        let (called, one) = (called(), shown(one));
        bail!(
            "{one}: it opens by itself and needs no manifest; what it holds: {called} info {one}"
        );
    }
    if let Some(out) = &args.out {
        write_whole(out, draft.manifest.as_bytes(), args.force)?;
    } else if !args.json {
        print(&draft.manifest)?;
    }
    let mut contents = Contents::default();
    let read = manifest::open_text(&draft.manifest, &place, &OpenOptions::default());
    let read = read.and_then(|mut recording| {
        contents.read(&mut watched(&mut recording, "reading"))?;
        Ok(recording.issues().sentences())
    });
    let issues = read.context("the files do not read by this draft; correct it")?;
    if args.json {
        return print_json(&Json {
            draft: &draft,
            duration_s: contents.duration_s(),
            sensors: contents.sensors(),
        });
    }
    let told = told(args, &draft, &contents, &issues);
    if args.out.is_some() {
        return print(&told);
    }
    // Without a standard error nobody reads it.
    let _ = std::io::stderr().lock().write_all(told.as_bytes());
    Ok(())
}

/// What was guessed, what was read by it, and what comes next.
fn told(args: &DescribeArgs, draft: &Draft, contents: &Contents, issues: &[String]) -> String {
    let mut text = String::from("Guessed:\n");
    let mut guesses = Table::new(&["<what", "<sure", "<taken", "<columns", "<file"]);
    for guess in &draft.guesses {
        guesses.row([
            guess.key.to_owned(),
            guess.confidence.name().to_owned(),
            guess.taken.clone(),
            guess.columns.clone(),
            guess.file.clone(),
        ]);
    }
    text.push_str(&guesses.render("  "));
    for (file, columns) in &draft.left_out {
        text.push_str(&format!("  {file}: not used: {columns}\n"));
    }
    for remark in &draft.remarks {
        text.push_str(&format!("  {remark}\n"));
    }
    let seconds = contents.duration_s();
    text.push_str(&format!("\nRead by it: {seconds:.3} s of samples\n"));
    text.push_str(&info::table(&contents.sensors()));
    for sentence in issues {
        text.push_str(&format!("  {sentence}\n"));
    }
    let next = match (&args.out, &args.files[..]) {
        (Some(out), _) => format!(
            "\nWritten to {}, with the reason of every guess. Next: {} run {}\n",
            shown(out),
            called(),
            shown(out)
        ),
        (None, [one]) => format!(
            "\nReasons are in the comments above. Keep it with --out FILE.toml, or run by it at once: {} run {} --describe\n",
            called(),
            shown(one)
        ),
        (None, _) => {
            "\nReasons are in the comments above. Keep it with --out FILE.toml\n".to_owned()
        }
    };
    text.push_str(&next);
    text
}
