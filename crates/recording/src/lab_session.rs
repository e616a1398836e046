//! What a lab exports: a session with several experiments, or a hand-in of the course with one. A zip with samples to the bit.
//!
//! A session holds `session.json` and for each experiment a folder `experiments/ID` with `experiment.json` and `samples.bin`
//! (`wire/events.rs`); a hand-in holds `hand_in.json` and `samples.bin`.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{Read, Seek};
use std::path::Path;

use serde::Deserialize;
use zip::ZipArchive;

use crate::error::{RecordingError, Result, join};
use crate::event::{Event, SensorKind};
use crate::issues::Issues;
use crate::limits::Limit;
use crate::metadata::{Metadata, WorldFrame};
use crate::recording::{EventSource, Opened};
use crate::wire::events;

/// The file that makes a zip a session.
pub const SESSION: &str = "session.json";
/// What it says of itself.
pub const FORMAT: &str = "northing-session";
/// The samples of an experiment.
pub const SAMPLES: &str = "samples.bin";
/// The file that makes a zip a hand-in.
const HAND_IN: &str = "hand_in.json";
/// The samples of an experiment are held in memory as they are written: six hours of four sensors at 100 a second.
const LARGEST: Limit = Limit {
    what: "the samples of the experiment",
    most: 192 << 20,
    unit: "bytes",
    advice: "divide the experiment",
};
/// Its tables, bytes.
const TABLE: Limit = Limit {
    what: "a table of the session",
    most: 8 << 20,
    unit: "bytes",
    advice: "export fewer experiments",
};

/// As much of a session as a reader needs.
#[derive(Debug, Deserialize)]
struct Session {
    format: String,
    experiments: Vec<Row>,
}

/// One experiment of its table.
#[derive(Debug, Clone, Deserialize)]
struct Row {
    id: String,
    name: String,
    /// What people called the device.
    device: String,
}

/// As much of an experiment as a reader needs.
#[derive(Debug, Deserialize)]
struct Experiment {
    #[serde(default)]
    world_frame: WorldFrame,
}

/// As much of a hand-in.
#[derive(Debug, Deserialize)]
struct HandIn {
    student: String,
    card: String,
    #[serde(default)]
    world_frame: WorldFrame,
}

/// Samples that are in memory, as they are written.
struct Samples {
    bytes: Vec<u8>,
    at: usize,
}

impl EventSource for Samples {
    fn next_event(&mut self, _: &mut Issues) -> Result<Option<Event>> {
        let mut rest = self.bytes.get(self.at..).unwrap_or_default();
        let event = events::next(&mut rest);
        self.at = self.bytes.len() - rest.len();
        Ok(event)
    }
}

/// The identifiers of the experiments of a session; none when the file is no session.
///
/// # Errors
/// It is a session, and its table cannot be read.
pub fn experiments(path: &Path) -> Result<Vec<String>> {
    let file = path.display().to_string();
    let input = File::open(path).map_err(|error| RecordingError::io(&file, "open it", error))?;
    let Ok(mut zip) = ZipArchive::new(input) else {
        return Ok(Vec::new());
    };
    if zip.by_name(SESSION).is_err() {
        return Ok(Vec::new());
    }
    let session: Session = json(&mut zip, SESSION, &file)?;
    Ok(session.experiments.into_iter().map(|row| row.id).collect())
}

/// Opens a session or a hand-in; `None` when the file is neither. Of a session's experiments the `wanted` one: by its
/// identifier, its name or its device, where these are told apart by it.
pub(crate) fn open_file(
    path: &Path,
    file: &str,
    metadata: &Metadata,
    wanted: Option<&str>,
) -> Result<Option<Opened>> {
    let input = File::open(path).map_err(|error| RecordingError::io(file, "open it", error))?;
    open(input, file, metadata, wanted)
}

/// As [`open_file`], of anything that can be jumped in.
pub(crate) fn open(
    input: impl Read + Seek,
    file: &str,
    metadata: &Metadata,
    wanted: Option<&str>,
) -> Result<Option<Opened>> {
    // What is no zip is for others to judge.
    let Ok(mut zip) = ZipArchive::new(input) else {
        return Ok(None);
    };
    let mut metadata = metadata.clone();
    metadata.format = "northing-session".to_owned();
    let samples = if zip.by_name(SESSION).is_ok() {
        let session: Session = json(&mut zip, SESSION, file)?;
        if session.format != FORMAT {
            let problem = format!(
                "{SESSION} says `{}`; this program reads `{FORMAT}`",
                session.format
            );
            return Err(RecordingError::unsupported(file, problem));
        }
        let row = one_of(session.experiments, wanted, file)?;
        let folder = format!("experiments/{}", row.id);
        let experiment: Experiment = json(&mut zip, &format!("{folder}/experiment.json"), file)?;
        metadata.world_frame = experiment.world_frame;
        metadata.name = row.name;
        metadata.device = Some(row.device);
        part(&mut zip, &format!("{folder}/{SAMPLES}"), LARGEST, file)?
    } else if zip.by_name(HAND_IN).is_ok() {
        let hand_in: HandIn = json(&mut zip, HAND_IN, file)?;
        metadata.world_frame = hand_in.world_frame;
        metadata.name = hand_in.card;
        metadata.device = Some(hand_in.student);
        part(&mut zip, SAMPLES, LARGEST, file)?
    } else {
        return Ok(None);
    };
    let mut kinds = BTreeSet::new();
    events::read(&samples, |event| {
        kinds.insert(event.sample.kind());
    })
    .map_err(|error| RecordingError::damaged(file, error.to_string()))?;
    let is_there = |kind: &SensorKind| kinds.contains(kind);
    let sensors = SensorKind::ALL.into_iter().filter(is_there).collect();
    let source = Box::new(Samples {
        bytes: samples,
        at: events::FIRST,
    });
    Ok(Some(Opened::new(metadata, sensors, source)))
}

/// The wanted experiment, or the only one.
fn one_of(rows: Vec<Row>, wanted: Option<&str>, file: &str) -> Result<Row> {
    let listed = |rows: &[Row]| {
        let one = |row: &Row| format!("`{}` ({} of {})", row.id, row.name, row.device);
        join(
            rows.iter()
                .map(one)
                .collect::<Vec<_>>()
                .iter()
                .map(String::as_str),
        )
    };
    let refused = |problem: String| Err(RecordingError::unsupported(file, problem));
    let Some(wanted) = wanted else {
        return match <[Row; 1]>::try_from(rows) {
            Ok([row]) => Ok(row),
            Err(rows) if rows.is_empty() => refused("the session holds no experiment".to_owned()),
            Err(rows) => refused(format!(
                "the session holds {} experiments; choose one with --device: {}",
                rows.len(),
                listed(&rows)
            )),
        };
    };
    // What is more exact comes first.
    let ways: [fn(&Row) -> &str; 3] = [|row| &row.id, |row| &row.name, |row| &row.device];
    for way in ways {
        let found: Vec<Row> = rows
            .iter()
            .filter(|row| way(row) == wanted)
            .cloned()
            .collect();
        match <[Row; 1]>::try_from(found) {
            Ok([row]) => return Ok(row),
            Err(found) if found.is_empty() => {}
            Err(found) => {
                let problem = format!("`{wanted}` is more than one experiment: {}", listed(&found));
                return refused(problem);
            }
        }
    }
    refused(format!(
        "the session holds no experiment `{wanted}`; it holds {}",
        listed(&rows)
    ))
}

fn json<T: for<'de> Deserialize<'de>>(
    zip: &mut ZipArchive<impl Read + Seek>,
    name: &str,
    file: &str,
) -> Result<T> {
    let bytes = part(zip, name, TABLE, file)?;
    serde_json::from_slice(&bytes)
        .map_err(|error| RecordingError::damaged(file, format!("{name}: {error}")))
}

/// A part; one that grows beyond the limit is refused before it has.
fn part(
    zip: &mut ZipArchive<impl Read + Seek>,
    name: &str,
    limit: Limit,
    file: &str,
) -> Result<Vec<u8>> {
    let damaged =
        |error: &dyn std::fmt::Display| RecordingError::damaged(file, format!("{name}: {error}"));
    let part = zip.by_name(name).map_err(|error| damaged(&error))?;
    let mut bytes = Vec::new();
    let read = part.take(limit.most + 1).read_to_end(&mut bytes);
    read.map_err(|error| damaged(&error))?;
    limit.check(bytes.len() as u64, file, &format!("/{name}"))?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::io::{Cursor, Write as _};

    use nalgebra::Vector3;

    use super::*;
    use crate::event::Sample;
    use crate::{OpenOptions, open, read_bytes};

    fn events(x: f64) -> Vec<Event> {
        let rate = |k: i64| Event {
            time_ns: k * 10_000_000,
            sample: Sample::AngularRate(Vector3::new(x, 0.1, 1.0 / 3.0)),
        };
        (0..50).map(rate).collect()
    }

    fn zip(parts: &BTreeMap<String, Vec<u8>>) -> Vec<u8> {
        let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
        for (name, bytes) in parts {
            zip.start_file(name.as_str(), zip::write::SimpleFileOptions::default())
                .unwrap();
            zip.write_all(bytes).unwrap();
        }
        zip.finish().unwrap().into_inner()
    }

    fn session() -> BTreeMap<String, Vec<u8>> {
        let facts = r#"{"format": "northing-session", "version": 1, "experiments": [
            {"id": "e1", "name": "First", "device": "Anna", "more": 1}, {"id": "e2", "name": "First", "device": "Ben"}]}"#;
        let mut parts = BTreeMap::from([(SESSION.to_owned(), facts.into())]);
        for (id, x) in [("e1", 1.0), ("e2", 2.0)] {
            parts.insert(
                format!("experiments/{id}/samples.bin"),
                events::encode(&events(x)),
            );
            parts.insert(
                format!("experiments/{id}/experiment.json"),
                br#"{"world_frame": "ned", "id": "x"}"#.to_vec(),
            );
        }
        parts
    }

    fn read(
        parts: &BTreeMap<String, Vec<u8>>,
        device: Option<&str>,
    ) -> std::result::Result<(String, Vec<Event>), String> {
        let options = OpenOptions {
            device: device.map(str::to_owned),
            ..OpenOptions::default()
        };
        let recording =
            read_bytes(zip(parts), "session.zip", &options).map_err(|e| e.to_string())?;
        let device = recording.metadata().device.clone().unwrap_or_default();
        Ok((device, recording.map(Result::unwrap).collect()))
    }

    #[test]
    fn an_experiment_of_a_session_is_read_to_the_bit() {
        for wanted in ["e2", "Ben"] {
            let (device, read) = read(&session(), Some(wanted)).unwrap();
            assert_eq!((device.as_str(), read), ("Ben", events(2.0)));
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("session.zip");
        std::fs::write(&path, zip(&session())).unwrap();
        assert_eq!(experiments(&path).unwrap(), ["e1", "e2"]);
        let options = OpenOptions {
            device: Some("e1".to_owned()),
            ..OpenOptions::default()
        };
        let recording = open(&path, &options).unwrap();
        assert_eq!(recording.metadata().world_frame, WorldFrame::Ned);
        assert_eq!(
            recording.map(Result::unwrap).collect::<Vec<_>>(),
            events(1.0)
        );
    }

    #[test]
    fn a_session_with_several_says_what_to_choose_from() {
        let error = read(&session(), None).unwrap_err();
        assert!(
            error.contains("--device") && error.contains("`e1` (First of Anna)"),
            "{error}"
        );
        let error = read(&session(), Some("First")).unwrap_err();
        assert!(error.contains("more than one"), "{error}");
        let error = read(&session(), Some("Cleo")).unwrap_err();
        assert!(error.contains("no experiment `Cleo`"), "{error}");
    }

    #[test]
    fn a_hand_in_is_a_recording() {
        let facts = br#"{"student": "Anna", "card": "bias", "setup": {}}"#.to_vec();
        let parts = BTreeMap::from([
            (HAND_IN.to_owned(), facts),
            (SAMPLES.to_owned(), events::encode(&events(3.0))),
        ]);
        let (device, read) = read(&parts, None).unwrap();
        assert_eq!((device.as_str(), read), ("Anna", events(3.0)));
    }

    #[test]
    fn what_is_damaged_says_where() {
        let mut parts = session();
        parts.insert("experiments/e1/samples.bin".to_owned(), vec![1, 2, 3]);
        assert!(
            read(&parts, Some("e1"))
                .unwrap_err()
                .contains("cannot be read beyond")
        );
        parts.insert("experiments/e1/experiment.json".to_owned(), b"{".to_vec());
        assert!(
            read(&parts, Some("e1"))
                .unwrap_err()
                .contains("experiment.json")
        );
        parts.remove("experiments/e2/samples.bin");
        assert!(
            read(&parts, Some("e2"))
                .unwrap_err()
                .contains("samples.bin")
        );
        parts.insert(
            SESSION.to_owned(),
            br#"{"format": "other", "experiments": []}"#.to_vec(),
        );
        assert!(
            read(&parts, Some("e2"))
                .unwrap_err()
                .contains("northing-session")
        );
    }
}
