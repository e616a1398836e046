//! Studies: estimators x parameters x seeds over recordings, random worlds or scenarios, a row a run, split over machines as one likes.
//!
//! | I look for | file |
//! |---|---|
//! | the file `study.toml` | [`file`](mod@file) |
//! | a grid, a Latin hypercube | [`grid`] |
//! | which study a part is of, runs by number | [`key`] |
//! | rows, what is missing, the hash | [`part`] |
//! | recordings and their hashes, worlds | [`source`] |
//! | one run | `run`, `scenario`, `scores` |
//! | what all rows say together | [`outcome`] |
//!
//! A run depends on the study and its number alone, and a study is told by a hash of its file, its data and the version of the
//! program. So rows are the same on one process, on shards in any order, and on a study that was cut off and went on. Runs are
//! in the order of sources, seeds, points, estimators: what shares its data is together, and with the same seed every point sees the
//! same errors, which makes differences between points small (common random numbers).

pub mod file;
pub mod grid;
pub mod key;
pub mod outcome;
pub mod part;
mod run;
mod scenario;
mod scores;
pub mod source;

use std::ops::Range;
use std::path::PathBuf;

use northing_evaluation::EvaluationError;
use northing_recording::OpenOptions;
use northing_simulation::scenario::{Scenario, ScenarioFile};
use rayon::prelude::*;

pub use file::{SourceEntries, StudyFile, StudyQuestion};
pub use key::{Plan, StudyKey};
pub use outcome::{StudyOutcome, StudySums};
pub use part::{Row, RowsHash};
pub use source::FoundRecording;

use self::key::{HashedSource, RunPlace, Sources, as_json, sha256};
use self::run::{Over, Setting, Setup};
use self::source::{Loaded, Shelf};
use crate::shard::ShardError;

/// Why a study or a merge cannot be.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StudyError {
    /// A file is not as it should be.
    #[error("{place}: {problem}")]
    File {
        /// The file.
        place: String,
        /// What is wrong.
        problem: String,
    },
    /// Something that cannot be asked for.
    #[error("{0}")]
    Refused(String),
    /// More than any computer is for.
    #[error(
        "this study has {count} {what}, at most {most}; take fewer values, or [latin_hypercube] with fewer samples"
    )]
    TooMany {
        /// What is counted.
        what: &'static str,
        /// How many.
        count: u128,
        /// The most.
        most: u64,
    },
    /// An estimator, a parameter or a value.
    #[error(transparent)]
    Evaluation(#[from] EvaluationError),
    /// A shard that there is not.
    #[error(transparent)]
    Shard(#[from] ShardError),
    /// Nothing to merge.
    #[error("no parts to merge")]
    NoParts,
    /// Parts that are not of one study.
    #[error("{file} is of another study than {first}: {what} differs")]
    OtherStudy {
        /// The part.
        file: String,
        /// What it is compared with.
        first: String,
        /// What differs, with both.
        what: String,
    },
    /// Parts that hold the same run.
    #[error("{file} and {other} both hold run {run}; leave one of them out")]
    Overlap {
        /// A part.
        file: String,
        /// Another.
        other: String,
        /// A run in both.
        run: u64,
    },
}

impl StudyError {
    fn file(place: &str, problem: &str) -> Self {
        Self::File {
            place: place.to_owned(),
            problem: problem.to_owned(),
        }
    }
}

/// What the entries of a study's file lead to.
#[derive(Debug, Clone)]
pub enum FoundSources {
    /// Recordings, and the folder of the files that manifests name.
    Recordings(Vec<FoundRecording>, Option<PathBuf>),
    /// Worlds need no file.
    Worlds,
    /// A scenario: its text.
    Scenario(String),
}

/// A study that can be run.
#[derive(Debug)]
pub struct Study {
    plan: Plan,
    setups: Vec<Setup>,
    recordings: Vec<FoundRecording>,
    open: OpenOptions,
    scenario: Option<Scenario>,
    shelf: Shelf,
}

impl Study {
    /// Of a file and what its sources lead to.
    ///
    /// # Errors
    /// It has too many runs; an estimator or a parameter is unknown, or a value is not permitted; a recording cannot be read.
    pub fn new(file: &StudyFile, found: FoundSources) -> Result<Self, StudyError> {
        let counted = StudyKey::of(file, unhashed(file, &found)?);
        counted.runs()?;
        let scenario = read_scenario(file, &found)?;
        let named = file.estimators.iter();
        let setups: Vec<_> = named
            .map(|name| Setup::of(file, name, scenario.is_some()))
            .collect::<Result<_, _>>()?;
        check_parameters(file, &setups, scenario.as_ref())?;
        check_seeds(file, &counted)?;
        let (recordings, data) = match found {
            FoundSources::Recordings(all, data) => (all, data),
            _ => (Vec::new(), None),
        };
        let sources = hashed(counted.sources, &recordings, data.as_deref())?;
        Ok(Self {
            plan: Plan::of(StudyKey::of(file, sources))?,
            setups,
            recordings,
            open: OpenOptions {
                data,
                ..OpenOptions::default()
            },
            scenario,
            shelf: Shelf::default(),
        })
    }

    /// Its runs.
    #[must_use]
    pub const fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Runs a range of runs on the threads of the current pool; `go_on` says after each run whether to. `None` when it did not.
    pub fn run_while(
        &self,
        runs: Range<u64>,
        go_on: &(dyn Fn() -> bool + Sync),
    ) -> Option<Vec<Row>> {
        let one = |number: u64| {
            let row = self.run(number);
            go_on().then_some(row)
        };
        runs.into_par_iter().map(one).collect()
    }

    /// One run.
    #[must_use]
    pub fn run(&self, number: u64) -> Row {
        let key = self.plan.key();
        let place = self.plan.place(number);
        let values = self.plan.points().values(place.point);
        let names = key.design.parameters().into_iter().map(str::to_owned);
        let mut settings: Vec<Setting> = key.parameters.clone();
        settings.extend(names.zip(values));
        match self.scored(&place, &settings) {
            Ok((scores, used)) => Row {
                run: number,
                scores,
                parameters_sha256: sha256(used),
                error: String::new(),
            },
            Err(error) => Row {
                run: number,
                scores: vec![f64::NAN; key.scores().len()],
                parameters_sha256: String::new(),
                error,
            },
        }
    }

    /// Scores and parameters of a run, or why there are none, without the folders of this machine.
    fn scored(&self, place: &RunPlace, settings: &[Setting]) -> Result<(Vec<f64>, String), String> {
        let found = self.recordings.get(place.source as usize);
        let scored = match self.setups.get(place.estimator) {
            Some(Setup::Attitude(options)) => self.over(place, |over| {
                run::attitude(options, settings, over).map_err(|error| error.to_string())
            }),
            Some(Setup::Navigation(options)) => self.over(place, |over| {
                run::navigation(options, settings, over).map_err(|error| error.to_string())
            }),
            Some(Setup::Tracking(options)) => self.tracking(place, options, settings),
            Some(Setup::Scenario(kind)) => {
                let base = self.scenario.as_ref().ok_or("no scenario")?;
                return run::scenario(*kind, settings, base, place.seed)
                    .map_err(|error| error.to_string());
            }
            None => Err("no estimator".to_owned()),
        };
        let scored = scored.map(|(scores, used)| (scores, as_json(&used)));
        scored.map_err(|error| match found {
            Some(found) => error.replace(&found.path.display().to_string(), &found.name),
            None => error,
        })
    }

    /// Gives a run what it is over.
    fn over(
        &self,
        place: &RunPlace,
        run: impl Fn(Over<'_>) -> Result<run::Scored, String>,
    ) -> Result<run::Scored, String> {
        let Sources::Worlds(worlds) = &self.plan.key().sources else {
            let found = self.recordings.get(place.source as usize);
            let found = found.ok_or("no recording")?;
            return run(Over::recording(&found.path, &self.open)?);
        };
        let number = source::world_number(worlds, place.source);
        let load = || match self.plan.key().question {
            StudyQuestion::Navigation => Loaded::navigation_world(place.seed, number),
            _ => Loaded::attitude_world(place.seed, number),
        };
        let slot = self.shelf.get((place.source, place.seed), load);
        match slot.get() {
            Some(Loaded::Events(events)) => run(Over::World(events)),
            _ => Err("no world".to_owned()),
        }
    }

    fn tracking(
        &self,
        place: &RunPlace,
        options: &northing_evaluation::tracking::TrackOptions,
        settings: &[Setting],
    ) -> Result<run::Scored, String> {
        let found = self.recordings.get(place.source as usize);
        let found = found.ok_or("no recording")?;
        let load = || Loaded::tracking(&found.path, self.open.data.as_deref());
        let slot = self.shelf.get((place.source, 0), load);
        let recording = match slot.get() {
            Some(Loaded::Tracking(recording)) => recording.as_ref().map_err(String::clone)?,
            _ => return Err("no recording of targets".to_owned()),
        };
        let std_deg = self.plan.key().options.tracking.injected_heading_std_deg;
        let injected = std_deg.map(|std_deg| (std_deg, place.seed));
        run::tracking(options, settings, recording, injected).map_err(|error| error.to_string())
    }
}

/// The sources without their hashes: enough to count runs.
fn unhashed(file: &StudyFile, found: &FoundSources) -> Result<Sources, StudyError> {
    let source = |name: &String, sha256: String| HashedSource {
        name: name.clone(),
        sha256,
    };
    match (&file.sources, found) {
        (SourceEntries::Worlds(worlds), _) => {
            source::check_worlds(worlds, file.question)?;
            Ok(Sources::Worlds(worlds.clone()))
        }
        (SourceEntries::Scenario(table), FoundSources::Scenario(text)) => {
            if file.question != StudyQuestion::Tracking {
                let message = "sources.scenario: scenarios are of the question `tracking`";
                return Err(StudyError::Refused(message.to_owned()));
            }
            Ok(Sources::Scenario {
                file: source(&table.file, sha256(text)),
                variant: table.variant.clone(),
            })
        }
        (SourceEntries::Recordings { .. }, FoundSources::Recordings(all, _)) => {
            let each = all.iter().map(|found| source(&found.name, String::new()));
            Ok(Sources::Recordings(each.collect()))
        }
        _ => Err(StudyError::Refused("sources: nothing was found".to_owned())),
    }
}

/// The same with the hash of each recording.
fn hashed(
    sources: Sources,
    recordings: &[FoundRecording],
    data: Option<&std::path::Path>,
) -> Result<Sources, StudyError> {
    if recordings.is_empty() {
        return Ok(sources);
    }
    let one = |found: &FoundRecording| {
        Ok(HashedSource {
            name: found.name.clone(),
            sha256: source::hash_of_recording(&found.path, data)?,
        })
    };
    let all: Result<_, StudyError> = recordings.par_iter().map(one).collect();
    Ok(Sources::Recordings(all?))
}

fn read_scenario(file: &StudyFile, found: &FoundSources) -> Result<Option<Scenario>, StudyError> {
    let (SourceEntries::Scenario(table), FoundSources::Scenario(text)) = (&file.sources, found)
    else {
        return Ok(None);
    };
    let refused = |error: northing_simulation::scenario::ScenarioError| {
        StudyError::Refused(error.to_string())
    };
    let scenarios = ScenarioFile::parse(&table.file, text).map_err(refused)?;
    let scenario = scenarios.scenario(table.variant.as_deref());
    scenario.map(Some).map_err(refused)
}

/// Refuses parameters that there are not, values that they cannot have, and one that is both fixed and varied.
fn check_parameters(
    file: &StudyFile,
    setups: &[Setup],
    scenario: Option<&Scenario>,
) -> Result<(), StudyError> {
    let varied = file.design.parameters();
    if let Some((name, _)) = file
        .parameters
        .iter()
        .find(|(name, _)| varied.contains(&name.as_str()))
    {
        let message = format!("the parameter `{name}` is both fixed and varied; leave one out");
        return Err(StudyError::Refused(message));
    }
    let extremes = file
        .design
        .extremes()
        .into_iter()
        .flat_map(|(name, values)| {
            let name = name.to_owned();
            values.into_iter().map(move |value| (name.clone(), value))
        });
    for setting in file.parameters.iter().cloned().chain(extremes) {
        for setup in setups {
            setup.check(&setting)?;
        }
        if let Some(scenario) = scenario {
            scenario::with(scenario, std::slice::from_ref(&setting))?;
        }
    }
    Ok(())
}

/// Several seeds over what is the same for all of them would be the same rows again.
fn check_seeds(file: &StudyFile, key: &StudyKey) -> Result<(), StudyError> {
    let is_drawn = !matches!(key.sources, Sources::Recordings(_))
        || file.options.tracking.injected_heading_std_deg.is_some();
    if key.seeds.count() > 1 && !is_drawn {
        return Err(StudyError::Refused(
            "seeds: a recording is the same for every seed; leave `seeds` out (what is drawn from them are worlds, scenarios, \
             and tracking.injected_heading_std_deg)"
                .to_owned(),
        ));
    }
    Ok(())
}
