//! The file that a student hands in: everything with which anybody gets the same numbers.
//!
//! A zip with `hand_in.json` (who, which card, answers, setup), `samples.bin` (the samples to the bit) and, for other
//! programs, `recording.csv`. Whoever judges it runs it again; what the file says about its own numbers is compared and never
//! trusted.

use std::collections::BTreeMap;
use std::io::{Cursor, Read, Seek, Write};

use northing_recording::wire::events;
use northing_recording::{Event, Metadata, SensorKind, WorldFrame};
use serde::{Deserialize, Serialize};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

use super::answers::{LONGEST, line};
use super::cards::Card;
use super::judgement::Judgement;
use super::work::{Answers, Start, Work};
use crate::attitude::EstimatorKind;
use crate::attitude::alterations::Alterations;
use crate::attitude::setup::{self, RunSetup};
use crate::used_parameters::PROGRAM;

const FACTS: &str = "hand_in.json";
const SAMPLES: &str = "samples.bin";
const TABLE: &str = "recording.csv";
const FORMAT: &str = "northing-hand-in";
const VERSION: u32 = 1;
/// No part of a hand-in is larger, bytes: an hour of a fast phone.
const LARGEST: u64 = 256 << 20;
/// Nor its facts.
const LARGEST_FACTS: u64 = 4 << 20;

/// Why a file is no hand-in.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct HandInError(String);

impl HandInError {
    fn new(text: impl Into<String>) -> Self {
        Self(text.into())
    }
}

/// What is handed in.
#[derive(Debug, Clone)]
pub struct HandIn {
    /// Who hands it in.
    pub student: String,
    /// Of which exercise.
    pub card: Card,
    /// When, UTC.
    pub at: String,
    /// What was answered.
    pub answers: Answers,
    /// What the experiment is run with; the estimator is the subject.
    pub setup: RunSetup,
    /// States of the estimators at the first sample.
    pub starts: Vec<(EstimatorKind, setup::Start)>,
    /// What was done to the samples in a what-if.
    pub alterations: Alterations,
    /// The world that attitudes refer to.
    pub world_frame: WorldFrame,
    /// What was measured.
    pub events: Vec<Event>,
}

/// A hand-in as it is written, beside its samples.
#[derive(Debug, Serialize, Deserialize)]
struct Facts {
    format: String,
    version: u32,
    program: String,
    student: String,
    card: Card,
    at: String,
    answers: Answers,
    setup: RunSetup,
    starts: Vec<(EstimatorKind, setup::Start)>,
    #[serde(default)]
    alterations: Alterations,
    #[serde(default)]
    world_frame: WorldFrame,
    /// SHA-256 of the samples, in hexadecimal, by whoever wrote the file.
    samples: String,
    /// What the program judged when it was handed in.
    judgement: Judgement,
}

/// A hand-in that was judged.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Judged {
    /// Who handed it in.
    pub student: String,
    /// Of which exercise.
    pub card: Card,
    /// When, UTC.
    pub at: String,
    /// The judgement of now.
    pub judgement: Judgement,
    /// Whether the file says the same about itself.
    pub as_claimed: bool,
    /// What tells these samples from all others.
    pub samples: String,
}

impl HandIn {
    /// Judges it: the card's check, on the samples run again.
    ///
    /// # Errors
    /// Its setup is none that can be run.
    pub fn judge(&self) -> Result<Judgement, HandInError> {
        let options = self.setup.clone().options();
        let mut options = options.map_err(|error| HandInError::new(error.to_string()))?;
        options.world_frame = self.world_frame;
        let starts: Option<Vec<Start>> = self
            .starts
            .iter()
            .map(|(kind, start)| Some((*kind, start.state()?)))
            .collect();
        let starts = starts
            .ok_or_else(|| HandInError::new("it starts from a state that no estimator can have"))?;
        self.alterations.check().map_err(HandInError::new)?;
        Ok(self.card.check(&Work {
            events: &self.events,
            options: &options,
            starts: &starts,
            alterations: &self.alterations,
            answers: &self.answers,
        }))
    }

    /// What its file is called, without the ending: no letter in it that a file system or a shell minds.
    #[must_use]
    pub fn name_of(card: Card, student: &str) -> String {
        let plain = |c: char| if c.is_alphanumeric() { c } else { '-' };
        let student: String = student.chars().take(40).map(plain).collect();
        format!("{}-{}", card.name(), student.to_lowercase())
    }

    /// Whether whoever judges it has its estimator.
    ///
    /// # Errors
    /// It is one that somebody brought along, in a sentence.
    pub fn check_estimator(kind: EstimatorKind) -> Result<(), HandInError> {
        match kind {
            EstimatorKind::Own(_) => Err(HandInError(format!(
                "`{kind}` cannot be handed in: whoever judges it does not have it; take an estimator of the program"
            ))),
            _ => Ok(()),
        }
    }

    /// The file.
    ///
    /// # Errors
    /// It cannot be judged or written.
    pub fn to_bytes(&self) -> Result<Vec<u8>, HandInError> {
        self.sealed().map(|(bytes, _)| bytes)
    }

    /// Judges it: the file, and what whoever reads it finds.
    ///
    /// # Errors
    /// It cannot be judged or written.
    pub fn sealed(&self) -> Result<(Vec<u8>, Judged), HandInError> {
        let samples = events::encode(&self.events);
        let judged = Judged {
            student: line(&self.student, LONGEST),
            card: self.card,
            at: line(&self.at, LONGEST),
            judgement: self.judge()?,
            as_claimed: true,
            samples: fingerprint(&samples),
        };
        let facts = Facts {
            format: FORMAT.to_owned(),
            version: VERSION,
            program: PROGRAM.to_owned(),
            student: self.student.clone(),
            card: self.card,
            at: self.at.clone(),
            answers: self.answers.clone(),
            setup: self.setup.clone(),
            starts: self.starts.clone(),
            alterations: self.alterations,
            world_frame: self.world_frame,
            samples: judged.samples.clone(),
            judgement: judged.judgement.clone(),
        };
        Ok((self.zipped(&facts, samples)?, judged))
    }

    fn zipped(&self, facts: &Facts, samples: Vec<u8>) -> Result<Vec<u8>, HandInError> {
        let failed = |error: &dyn std::fmt::Display| HandInError::new(error.to_string());
        let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
        let options = SimpleFileOptions::default().compression_method(CompressionMethod::Deflated);
        let parts = [
            (
                FACTS,
                serde_json::to_vec_pretty(facts).map_err(|e| failed(&e))?,
            ),
            (SAMPLES, samples),
            (TABLE, self.table()?),
        ];
        for (name, bytes) in parts {
            zip.start_file(name, options).map_err(|e| failed(&e))?;
            zip.write_all(&bytes).map_err(|e| failed(&e))?;
        }
        Ok(zip.finish().map_err(|e| failed(&e))?.into_inner())
    }

    /// The samples as a table that other programs read.
    fn table(&self) -> Result<Vec<u8>, HandInError> {
        let failed =
            |error: northing_recording::RecordingError| HandInError::new(error.to_string());
        let kinds: Vec<SensorKind> = SensorKind::ALL
            .into_iter()
            .filter(|kind| self.events.iter().any(|e| e.sample.kind() == *kind))
            .collect();
        let metadata = Metadata {
            name: format!("{} {}", self.student, self.card.name()),
            format: "live".to_owned(),
            world_frame: self.world_frame,
            ..Metadata::default()
        };
        let folder = tempfile::tempdir()
            .map_err(|error| HandInError::new(format!("a temporary folder: {error}")))?;
        let path = folder.path().join(TABLE);
        let mut writer =
            northing_recording::create(&path, &metadata, &kinds, false).map_err(failed)?;
        for event in &self.events {
            writer.write(event).map_err(failed)?;
        }
        writer.finish().map_err(failed)?;
        std::fs::read(&path).map_err(|error| HandInError::new(format!("{TABLE}: {error}")))
    }

    /// Reads a file and judges it anew.
    ///
    /// # Errors
    /// It is no hand-in, is damaged, or cannot be run, in a sentence.
    pub fn read(input: impl Read + Seek) -> Result<(Self, Judged), HandInError> {
        let mut zip = ZipArchive::new(input)
            .map_err(|error| HandInError::new(format!("it is no zip: {error}")))?;
        let text = part(&mut zip, FACTS, LARGEST_FACTS)?;
        let facts: Facts = serde_json::from_slice(&text)
            .map_err(|error| HandInError::new(format!("{FACTS}: {error}")))?;
        if facts.format != FORMAT || facts.version != VERSION {
            return Err(HandInError::new(format!(
                "{FACTS} says `{}`, version {}; this program reads `{FORMAT}`, version {VERSION}",
                facts.format, facts.version
            )));
        }
        let samples = part(&mut zip, SAMPLES, LARGEST)?;
        let fingerprint = fingerprint(&samples);
        if fingerprint != facts.samples {
            return Err(HandInError::new(format!(
                "{SAMPLES} is not the one that {FACTS} was written for"
            )));
        }
        let events = events::decode(&samples)
            .map_err(|error| HandInError::new(format!("{SAMPLES}: {error}")))?;
        let read = Self {
            student: line(&facts.student, LONGEST),
            card: facts.card,
            at: line(&facts.at, LONGEST),
            answers: facts
                .answers
                .iter()
                .map(|(name, text)| (line(name, LONGEST), line(text, LONGEST)))
                .collect(),
            setup: facts.setup,
            starts: facts.starts,
            alterations: facts.alterations,
            world_frame: facts.world_frame,
            events,
        };
        let judgement = read.judge()?;
        let judged = Judged {
            student: read.student.clone(),
            card: read.card,
            at: read.at.clone(),
            as_claimed: judgement == facts.judgement,
            judgement,
            samples: fingerprint,
        };
        Ok((read, judged))
    }
}

/// A part of the zip; one that grows beyond its limit is refused before it has.
fn part(
    zip: &mut ZipArchive<impl Read + Seek>,
    name: &str,
    most: u64,
) -> Result<Vec<u8>, HandInError> {
    let file = zip
        .by_name(name)
        .map_err(|_| HandInError::new(format!("there is no {name} in it: it is no hand-in")))?;
    let mut bytes = Vec::new();
    let read = file.take(most + 1).read_to_end(&mut bytes);
    read.map_err(|error| HandInError::new(format!("{name}: {error}")))?;
    if bytes.len() as u64 > most {
        return Err(HandInError::new(format!(
            "{name} is larger than {most} bytes"
        )));
    }
    Ok(bytes)
}

/// What tells these samples from all others: a hash of their bytes.
fn fingerprint(bytes: &[u8]) -> String {
    use sha2::Digest as _;
    let digest = sha2::Sha256::digest(bytes);
    digest.iter().map(|b| format!("{b:02x}")).collect()
}

/// The same samples from two people, by what tells samples apart.
pub(super) fn shared(judged: &[Judged]) -> BTreeMap<&str, Vec<&str>> {
    let mut by_samples: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for one in judged {
        let students = by_samples.entry(&one.samples).or_default();
        if !students.contains(&one.student.as_str()) {
            students.push(&one.student);
        }
    }
    by_samples.retain(|_, students| students.len() > 1);
    by_samples
}
