//! Which study a part is of: what all of its parts agree on, what differs between two, and its runs by number.

use northing_evaluation::PROGRAM;
use serde::{Deserialize, Serialize};
use serde_json::Value as Json;
use sha2::{Digest as _, Sha256};

use super::StudyError;
use super::file::{Seeds, StudyFile, StudyOptions, StudyQuestion, WorldsTable};
use super::grid::{Design, Points};
use super::scores;

/// Most runs of one study: weeks of computing.
pub const MOST_RUNS: u64 = 10_000_000;
/// Most samples of a Latin hypercube: their places are kept in memory.
const MOST_SAMPLES: u64 = 1_000_000;

/// A file and the hash of what is in it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HashedSource {
    /// Its name, as the study has it: no machine's folders.
    pub name: String,
    /// SHA-256 of its bytes, and of those of the files that it names.
    pub sha256: String,
}

/// What is run over.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Sources {
    /// Recordings.
    Recordings(Vec<HashedSource>),
    /// Random worlds.
    Worlds(WorldsTable),
    /// A scenario.
    Scenario {
        /// The file.
        file: HashedSource,
        /// Its variant.
        variant: Option<String>,
    },
}

impl Sources {
    /// How many.
    #[must_use]
    pub fn count(&self) -> u64 {
        match self {
            Self::Recordings(all) => all.len() as u64,
            Self::Worlds(worlds) => worlds.count,
            Self::Scenario { .. } => 1,
        }
    }

    /// The hash of the data of one; empty for what is drawn from a seed.
    #[must_use]
    pub fn sha256(&self, source: u64) -> &str {
        match self {
            Self::Recordings(all) => all.get(source as usize).map_or("", |one| &one.sha256),
            Self::Worlds(_) => "",
            Self::Scenario { file, .. } => &file.sha256,
        }
    }
}

/// What a study is: parts agree on all of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StudyKey {
    /// Program and version.
    pub program: String,
    /// Its name.
    pub name: String,
    /// What is estimated.
    pub question: StudyQuestion,
    /// What is run over.
    pub sources: Sources,
    /// The estimators.
    pub estimators: Vec<String>,
    /// The seeds.
    pub seeds: Seeds,
    /// Parameters that all runs share.
    pub parameters: Vec<(String, Json)>,
    /// Parameters that are varied.
    pub design: Design,
    /// What else is asked for.
    pub options: StudyOptions,
}

impl StudyKey {
    pub(super) fn of(file: &StudyFile, sources: Sources) -> Self {
        Self {
            program: PROGRAM.to_owned(),
            name: file.name.clone(),
            question: file.question,
            sources,
            estimators: file.estimators.clone(),
            seeds: file.seeds.clone(),
            parameters: file.parameters.clone(),
            design: file.design.clone(),
            options: file.options.clone(),
        }
    }

    /// How many runs it has.
    ///
    /// # Errors
    /// More than [`MOST_RUNS`], or none.
    pub fn runs(&self) -> Result<u64, StudyError> {
        let others = [
            self.sources.count(),
            self.seeds.count(),
            self.estimators.len() as u64,
        ];
        let runs = others
            .into_iter()
            .fold(self.design.points(), |product, count| {
                product.saturating_mul(u128::from(count))
            });
        if let Design::LatinHypercube { samples, .. } = &self.design
            && *samples > MOST_SAMPLES
        {
            return Err(StudyError::TooMany {
                what: "samples of a Latin hypercube",
                count: u128::from(*samples),
                most: MOST_SAMPLES,
            });
        }
        match u64::try_from(runs) {
            Ok(0) => Err(StudyError::Refused("this study has no runs".to_owned())),
            Ok(runs) if runs <= MOST_RUNS => Ok(runs),
            _ => Err(StudyError::TooMany {
                what: "runs",
                count: runs,
                most: MOST_RUNS,
            }),
        }
    }

    /// Names of the scores of its runs, each with its unit.
    #[must_use]
    pub fn scores(&self) -> &'static [&'static str] {
        scores::names(self.question, &self.sources)
    }

    /// SHA-256 of everything in it.
    #[must_use]
    pub fn sha256(&self) -> String {
        sha256(as_json(self))
    }

    /// What differs first, with both.
    #[must_use]
    pub fn difference(&self, other: &Self) -> Option<String> {
        let two = |what: &str, a: &dyn std::fmt::Display, b: &dyn std::fmt::Display| {
            Some(format!("{what} ({a} and {b})"))
        };
        if self.program != other.program {
            return two("the version of the program", &self.program, &other.program);
        }
        if let Some(what) = self.sources.difference(&other.sources) {
            return Some(what);
        }
        if self.name != other.name {
            return two("the name", &self.name, &other.name);
        }
        if self.estimators != other.estimators {
            let names = |key: &Self| key.estimators.join(",");
            return two("the list of estimators", &names(self), &names(other));
        }
        let json = [
            (
                "the question",
                as_json(&self.question),
                as_json(&other.question),
            ),
            ("the seeds", as_json(&self.seeds), as_json(&other.seeds)),
            (
                "the parameters",
                as_json(&self.parameters),
                as_json(&other.parameters),
            ),
            (
                "the varied parameters",
                as_json(&self.design),
                as_json(&other.design),
            ),
            (
                "the options",
                as_json(&self.options),
                as_json(&other.options),
            ),
        ];
        let other = json.iter().find(|(_, a, b)| a != b);
        other.and_then(|(what, a, b)| two(what, a, b))
    }
}

impl Sources {
    /// What differs first, with both.
    fn difference(&self, other: &Self) -> Option<String> {
        let files = |sources: &Self| match sources {
            Self::Recordings(all) => all.clone(),
            Self::Scenario { file, .. } => vec![file.clone()],
            Self::Worlds(_) => Vec::new(),
        };
        for (a, b) in files(self).iter().zip(&files(other)) {
            if a.name == b.name && a.sha256 != b.sha256 {
                let (name, a, b) = (&a.name, short(&a.sha256), short(&b.sha256));
                return Some(format!("the data of {name} (SHA-256 {a} and {b})"));
            }
        }
        (self != other).then(|| {
            format!(
                "the list of sources ({} and {})",
                as_json(self),
                as_json(other)
            )
        })
    }
}

/// The first digits of a hash, for people.
#[must_use]
pub fn short(sha256: &str) -> &str {
    sha256.get(..12).unwrap_or(sha256)
}

/// SHA-256 of bytes, in hexadecimal digits.
pub(super) fn sha256(bytes: impl AsRef<[u8]>) -> String {
    hex(Sha256::digest(bytes.as_ref()).as_slice())
}

pub(super) fn hex(digest: &[u8]) -> String {
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// A value as JSON; of these types none is refused.
pub(super) fn as_json(value: &impl Serialize) -> String {
    serde_json::to_string(value).unwrap_or_default()
}

/// Where a run stands in a study.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RunPlace {
    /// Place of the source.
    pub source: u64,
    /// The seed.
    pub seed: u64,
    /// Number of the point.
    pub point: u64,
    /// Place of the estimator.
    pub estimator: usize,
}

/// A study whose runs can be told by their numbers: sources change slowest, then seeds, points and estimators.
#[derive(Debug, Clone)]
pub struct Plan {
    key: StudyKey,
    runs: u64,
    points: Points,
}

impl Plan {
    /// Of a study.
    ///
    /// # Errors
    /// As [`StudyKey::runs`].
    pub fn of(key: StudyKey) -> Result<Self, StudyError> {
        Ok(Self {
            runs: key.runs()?,
            points: Points::of(&key.design),
            key,
        })
    }

    /// What study it is.
    #[must_use]
    pub const fn key(&self) -> &StudyKey {
        &self.key
    }

    /// How many runs there are.
    #[must_use]
    pub const fn runs(&self) -> u64 {
        self.runs
    }

    /// Its points.
    #[must_use]
    pub const fn points(&self) -> &Points {
        &self.points
    }

    /// Where a run stands.
    #[must_use]
    pub fn place(&self, run: u64) -> RunPlace {
        let estimators = self.key.estimators.len() as u64;
        let points = self.key.design.points() as u64;
        let seeds = self.key.seeds.count();
        let (rest, estimator) = (run / estimators, run % estimators);
        let (rest, point) = (rest / points, rest % points);
        RunPlace {
            source: rest / seeds,
            seed: self.key.seeds.seed(rest % seeds),
            point,
            estimator: estimator as usize,
        }
    }

    /// Name of a source.
    #[must_use]
    pub fn source_name(&self, source: u64) -> String {
        match &self.key.sources {
            Sources::Recordings(all) => all
                .get(source as usize)
                .map_or_else(String::new, |one| one.name.clone()),
            Sources::Worlds(worlds) => {
                format!("world {}", super::source::world_number(worlds, source))
            }
            Sources::Scenario { file, variant } => match variant {
                Some(variant) => format!("{} {variant}", file.name),
                None => file.name.clone(),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::studies::grid::{Axis, Levels};

    fn key() -> StudyKey {
        let file = StudyFile::parse(
            "s.toml",
            "question = 'attitude'\nestimators = ['mekf', 'usque']\nseeds = [7, 9]\n[sources]\nrecordings = ['a', 'b']\n\
             [grid]\naccelerometer_std = [1, 2, 3]\n",
        );
        let source = |name: &str| HashedSource {
            name: name.to_owned(),
            sha256: sha256(name),
        };
        let sources = Sources::Recordings(vec![source("a"), source("b")]);
        StudyKey::of(&file.unwrap(), sources)
    }

    #[test]
    fn sources_change_slowest_then_seeds_points_and_estimators() {
        let plan = Plan::of(key()).unwrap();
        assert_eq!(plan.runs(), 24);
        let place = |run| {
            let RunPlace {
                source,
                seed,
                point,
                estimator,
            } = plan.place(run);
            (source, seed, point, estimator)
        };
        assert_eq!(place(0), (0, 7, 0, 0));
        assert_eq!(place(1), (0, 7, 0, 1));
        assert_eq!(place(2), (0, 7, 1, 0));
        assert_eq!(place(6), (0, 9, 0, 0));
        assert_eq!(place(23), (1, 9, 2, 1));
        assert_eq!(plan.source_name(1), "b");
    }

    #[test]
    fn what_differs_is_said_with_both_and_any_difference_changes_the_hash() {
        let mine = key();
        assert_eq!(mine.difference(&key()), None);
        let differs = |change: &dyn Fn(&mut StudyKey), parts: &[&str]| {
            let mut other = key();
            change(&mut other);
            assert_ne!(other.sha256(), mine.sha256());
            let what = mine.difference(&other).unwrap();
            assert!(parts.iter().all(|part| what.contains(part)), "{what}");
        };
        differs(
            &|key| key.program = "northing 9.9.9".to_owned(),
            &["the version of the program", PROGRAM, "northing 9.9.9"],
        );
        differs(
            &|key| {
                if let Sources::Recordings(all) = &mut key.sources {
                    all[1].sha256 = sha256("else");
                }
            },
            &["the data of b", short(&sha256("b")), short(&sha256("else"))],
        );
        differs(
            &|key| key.seeds = Seeds::List(vec![7]),
            &["the seeds", "[7,9]", "[7]"],
        );
        differs(
            &|key| {
                key.design = Design::Grid(vec![Axis {
                    parameter: "accelerometer_std".to_owned(),
                    values: Levels::List(vec![Json::from(1)]),
                }]);
            },
            &["the varied parameters"],
        );
        differs(&|key| drop(key.estimators.pop()), &["mekf,usque", "mekf)"]);
    }

    #[test]
    fn a_key_comes_back_from_its_json() {
        let text = as_json(&key());
        assert_eq!(serde_json::from_str::<StudyKey>(&text).unwrap(), key());
    }
}
