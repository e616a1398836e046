//! Recordings of elsewhere, opened in the lab: kept in the folder for data, played as a device, or run as experiments.
//!
//! They are read by the reader of `northing run`, and what it refuses is refused in its words. A file that cannot be used is not kept.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use northing_evaluation::EstimatorKind;
use northing_recording::mcap::describe;
use northing_recording::{Event, OpenOptions, Recording, SensorKind, lab_session, open};
use serde::Serialize;

use crate::experiments::{Finished, utc};
use crate::lab::Lab;
use crate::private;
use crate::replay::{self, Speed};
use crate::session::DeviceSession;
use crate::session::experiment::{Experiment, MOST_EVENTS};

/// Largest file that is taken, bytes.
pub const LARGEST: u64 = 1 << 30;
/// Longest name of a file that is kept, bytes.
const LONGEST_NAME: usize = 120;
/// What the identifiers of experiments' devices begin with where these are files.
const DEVICE: &str = "file";

/// The identifier of what stands for the device of an opened file.
#[must_use]
pub fn device_of(name: &str) -> String {
    format!("{DEVICE}-{name}")
}

/// Whether an identifier is one of an opened file. Devices cannot have such a one.
#[must_use]
pub fn is_file(device: &str) -> bool {
    device
        .split_once('-')
        .is_some_and(|(kind, _)| kind == DEVICE)
}

/// A file of the list.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct OpenedFile {
    /// Its name.
    pub name: String,
    /// Its length.
    pub bytes: u64,
    /// When it was taken, UTC.
    pub at: Option<String>,
}

/// What is in a file.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Contents {
    /// Its name in the folder, which may be another than the one it came with.
    pub name: String,
    /// Its format.
    pub format: String,
    /// From the first to the last sample, s; null where it holds several recordings.
    pub duration_s: Option<f64>,
    /// The sensors in it; none where it holds several recordings.
    pub sensors: Vec<SensorKind>,
    /// The recordings in it.
    pub recordings: usize,
}

/// The experiments that were made of a file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Made {
    /// Their identifiers.
    pub experiments: Vec<String>,
    /// A sentence about each recording in it that could not be run.
    pub refused: Vec<String>,
}

/// A name under which a file can be kept: its last part, without what folders or devices are named with.
///
/// # Errors
/// Nothing of it is left, or it is a manifest, in a sentence.
pub fn safe_name(given: &str) -> Result<String, String> {
    let last = given.rsplit(['/', '\\']).next().unwrap_or_default();
    let plain = |c: char| !c.is_control() && !"<>:\"|?*%#".contains(c);
    let kept: String = last
        .chars()
        .map(|c| if plain(c) { c } else { '_' })
        .collect();
    let kept = kept.trim_matches(['.', ' ']);
    let (stem, extension) = split(kept);
    if stem.is_empty() {
        return Err(format!("`{given}` is no name of a file"));
    }
    if extension.eq_ignore_ascii_case(".toml") {
        return Err(format!(
            "{kept}: a manifest describes other files on the disk, and the page sends only this one; use `northing run {kept}`"
        ));
    }
    let room = LONGEST_NAME.saturating_sub(extension.len());
    let mut end = stem.len().min(room);
    while !stem.is_char_boundary(end) {
        end -= 1;
    }
    Ok(format!("{}{extension}", &stem[..end]))
}

/// Stem and extension with its dot; what is long or has a space is no extension.
fn split(name: &str) -> (&str, &str) {
    match name.rfind('.') {
        Some(dot) if name.len() - dot <= 12 && !name[dot..].contains(' ') => name.split_at(dot),
        _ => (name, ""),
    }
}

/// A file of the folder, in it a file of this name that is not there yet, for what is being taken.
///
/// # Errors
/// What the system says.
pub fn begin(folder: &Path, name: &str) -> io::Result<(tempfile::TempDir, std::fs::File)> {
    private::create_folder(folder)?;
    // In a folder of its own, so that the reader sees its name; the folder goes with whoever holds it.
    let aside = tempfile::Builder::new()
        .prefix(".taking-")
        .tempdir_in(folder)?;
    let file = private::create_new(&aside.path().join(name))?;
    Ok((aside, file))
}

/// Reads what has been taken and keeps it, under another name where this one is taken: nothing is written over.
///
/// # Errors
/// It is no recording of motion sensors, in the words of the reader; it is gone then.
#[expect(
    clippy::needless_pass_by_value,
    reason = "the folder aside ends with it"
)]
pub fn keep(folder: &Path, aside: tempfile::TempDir, name: &str) -> Result<Contents, String> {
    let path = aside.path().join(name);
    let mut contents = contents(&path, name)?;
    let (stem, extension) = split(name);
    for number in 1..10_000_u32 {
        let wanted = match number {
            1 => name.to_owned(),
            _ => format!("{stem}-{number}{extension}"),
        };
        let place = folder.join(&wanted);
        match private::create_new(&place) {
            Ok(_) => {
                std::fs::rename(&path, &place)
                    .map_err(|error| format!("{wanted} cannot be kept: {error}"))?;
                contents.name = wanted;
                return Ok(contents);
            }
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            Err(error) => return Err(format!("{wanted} cannot be kept: {error}")),
        }
    }
    Err(format!(
        "{name} cannot be kept: ten thousand files have this name"
    ))
}

/// The files of the folder, the newest first.
#[must_use]
pub fn list(folder: &Path) -> Vec<OpenedFile> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut files: Vec<OpenedFile> = entries
        .filter_map(|entry| {
            let name = entry.file_name().into_string().ok()?;
            let about = entry.metadata().ok()?;
            let is_shown = about.is_file() && !name.starts_with('.');
            is_shown.then(|| OpenedFile {
                name,
                bytes: about.len(),
                at: about.modified().ok().and_then(unix_ns).map(utc),
            })
        })
        .collect();
    files.sort_by(|a, b| (&b.at, &a.name).cmp(&(&a.at, &b.name)));
    files
}

fn unix_ns(time: std::time::SystemTime) -> Option<i64> {
    let since = time.duration_since(std::time::UNIX_EPOCH).ok()?;
    i64::try_from(since.as_nanos()).ok()
}

/// The file of this name in the folder; `None` for anything that is not listed.
#[must_use]
pub fn path_of(folder: &Path, name: &str) -> Option<PathBuf> {
    // Compared with what is there, so no name can lead elsewhere.
    let is_there = list(folder).iter().any(|file| file.name == name);
    is_there.then(|| folder.join(name))
}

/// What in a file a reader has to choose from: devices of a recording of the lab, experiments of a session. One `None` where
/// there is nothing to choose.
fn parts(path: &Path) -> Result<Vec<Option<String>>, String> {
    let devices = describe(path)
        .map(|about| about.devices)
        .unwrap_or_default();
    let experiments = lab_session::experiments(path).map_err(|error| error.to_string())?;
    let mut parts: Vec<Option<String>> = devices.into_iter().chain(experiments).map(Some).collect();
    if parts.is_empty() {
        parts.push(None);
    }
    Ok(parts)
}

fn opened(path: &Path, part: Option<String>) -> Result<Recording, String> {
    let options = OpenOptions {
        device: part,
        ..OpenOptions::default()
    };
    open(path, &options).map_err(|error| error.to_string())
}

/// Every event, if there are not too many.
fn events(recording: &mut Recording, name: &str) -> Result<Vec<Event>, String> {
    let mut events = Vec::new();
    for event in recording {
        let event = event.map_err(|error| error.to_string())?;
        if events.len() >= MOST_EVENTS {
            return Err(format!(
                "{name} holds more than {MOST_EVENTS} samples, which an experiment of the lab does not; use `northing run`"
            ));
        }
        events.push(event);
    }
    let has = |kind: SensorKind| events.iter().any(|e: &Event| e.sample.kind() == kind);
    if has(SensorKind::Gyroscope) {
        return Ok(events);
    }
    let others: Vec<&str> = SensorKind::ALL
        .into_iter()
        .filter(|k| has(*k))
        .map(SensorKind::name)
        .collect();
    Err(format!(
        "{name} holds no gyroscope sample, without which the lab estimates nothing; it holds {}",
        others.join(", ")
    ))
}

/// Reads a file to its end.
fn contents(path: &Path, name: &str) -> Result<Contents, String> {
    // People know the name, not where it lies while it is read.
    let shown = |text: String| match path.parent() {
        Some(folder) => text.replace(&format!("{}/", folder.display()), ""),
        None => text,
    };
    let parts = parts(path).map_err(shown)?;
    let mut contents = Contents {
        name: name.to_owned(),
        format: String::new(),
        duration_s: None,
        sensors: Vec::new(),
        recordings: parts.len(),
    };
    for part in parts {
        let mut recording = opened(path, part).map_err(shown)?;
        contents.format.clone_from(&recording.metadata().format);
        if contents.recordings > 1 {
            // Each is read when it is run.
            break;
        }
        let made = Experiment {
            events: events(&mut recording, name).map_err(shown)?,
            ..Experiment::default()
        };
        contents.duration_s = Some(made.duration_s());
        contents.sensors = made.sensors();
    }
    Ok(contents)
}

/// Plays a file as devices of its own, in the time in which it was measured.
///
/// # Errors
/// It cannot be read, it is being played, or the lab is full.
pub async fn play(lab: &Arc<Lab>, path: &Path) -> Result<(), String> {
    replay::play_beside(lab, path, Speed::Real).await
}

/// Runs a file as finished experiments: one for each recording in it, with the settings that devices start with.
///
/// # Errors
/// None of it can be run, in a sentence.
pub fn experiments(lab: &Lab, path: &Path, name: &str) -> Result<Made, String> {
    let mut made = Made {
        experiments: Vec::new(),
        refused: Vec::new(),
    };
    for part in parts(path)? {
        match experiment(lab, path, name, part) {
            Ok(id) => made.experiments.push(id),
            Err(text) => made.refused.push(text),
        }
    }
    match made.experiments.is_empty() {
        true => Err(made.refused.join(" ")),
        false => Ok(made),
    }
}

fn experiment(lab: &Lab, path: &Path, name: &str, part: Option<String>) -> Result<String, String> {
    let mut recording = opened(path, part.clone())?;
    let events = events(&mut recording, name)?;
    let mut options = lab.options.clone();
    options.world_frame = recording.metadata().world_frame;
    let session = DeviceSession::new(options.clone()).map_err(|error| error.to_string())?;
    let whose = recording.metadata().device.clone().or_else(|| part.clone());
    let title = match &part {
        Some(part) => format!("{} ({part})", recording.metadata().name),
        None => recording.metadata().name.clone(),
    };
    let mut run = Experiment {
        name: title,
        events,
        ..Experiment::default()
    };
    run.seconds = run.duration_s();
    let finished = Finished {
        id: lab.experiments.next_id(),
        device: device_of(&part.map_or_else(|| name.to_owned(), |part| format!("{name} {part}"))),
        device_name: whose.unwrap_or_else(|| name.to_owned()),
        at: utc(lab.now_ns()),
        options,
        estimators: session.estimators(),
        subject: session.subject().unwrap_or(EstimatorKind::Mekf),
        summaries: Default::default(),
        hash: String::new(),
        originals: Default::default(),
        experiment: run,
    };
    let mut finished = finished.evaluated()?;
    let issues = recording.issues().sentences();
    for summary in finished.summaries.values_mut() {
        summary.issues.splice(0..0, issues.clone());
    }
    let finished = lab.experiments.add(finished);
    lab.tell(&finished.message());
    lab.tell(&lab.experiments_message());
    lab.experiments.save(&finished);
    Ok(finished.id.clone())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_lead_nowhere_else() {
        for (given, kept) in [
            ("walk.csv", "walk.csv"),
            ("../../etc/passwd", "passwd"),
            ("C:\\data\\walk.mcap", "walk.mcap"),
            (".hidden", "hidden"),
            ("Zoë's walk (2).zip", "Zoë's walk (2).zip"),
            ("a%2fb?.csv", "a_2fb_.csv"),
        ] {
            assert_eq!(safe_name(given).unwrap(), kept);
        }
        for none in ["", "..", "a/", "..."] {
            assert!(safe_name(none).is_err(), "{none}");
        }
        let refused = safe_name("walk.csv.TOML").unwrap_err();
        assert!(refused.contains("northing run walk.csv.TOML"), "{refused}");
        let long = safe_name(&format!("{}.mcap", "é".repeat(200))).unwrap();
        assert!(
            long.len() <= LONGEST_NAME && long.ends_with("é.mcap"),
            "{long}"
        );
    }

    #[test]
    fn a_file_of_the_same_name_is_kept_beside_the_first() {
        let folder = tempfile::tempdir().unwrap();
        let text =
            "t_s,gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s\n0,0.1,0,0\n0.01,0.1,0,0\n0.02,0.1,0,0\n";
        let mut names = Vec::new();
        for _ in 0..3 {
            let (aside, mut file) = begin(folder.path(), "walk.csv").unwrap();
            io::Write::write_all(&mut file, text.as_bytes()).unwrap();
            let kept = keep(folder.path(), aside, "walk.csv").unwrap();
            assert_eq!(kept.sensors, [SensorKind::Gyroscope]);
            names.push(kept.name);
        }
        assert_eq!(names, ["walk.csv", "walk-2.csv", "walk-3.csv"]);
        assert_eq!(list(folder.path()).len(), 3);
        // What was taken aside is gone.
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 3);
    }

    #[test]
    fn what_the_reader_refuses_is_not_kept_and_said_in_its_words() {
        let folder = tempfile::tempdir().unwrap();
        for (text, said) in [
            ("hello\n", "walk.csv"),
            (
                "t_s,gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s\n0,0.1,zero,0\n",
                "line 2",
            ),
        ] {
            let (aside, mut file) = begin(folder.path(), "walk.csv").unwrap();
            io::Write::write_all(&mut file, text.as_bytes()).unwrap();
            let path = aside.path().join("walk.csv");
            let own = open(&path, &OpenOptions::default())
                .err()
                .map(|e| e.to_string());
            let refused = keep(folder.path(), aside, "walk.csv").unwrap_err();
            assert!(refused.contains(said), "{refused}");
            assert!(refused.starts_with("walk.csv"), "{refused}");
            if let Some(own) = own {
                assert!(own.ends_with(&refused), "{own} against {refused}");
            }
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
