//! `study.toml`: sources, estimators, parameters and seeds of a study, read with messages that name the line.

use northing_evaluation::named;
use serde::{Deserialize, Serialize};
use serde_json::Value as Json;

use super::StudyError;
use super::grid::{Axis, Design, Levels, Scale, Span, number};

named! {
    /// What is estimated in a study.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum StudyQuestion {
        /// Which way does it point?
        Attitude = "attitude",
        /// Where is it?
        Navigation = "navigation",
        /// Where are the others?
        Tracking = "tracking",
    }
}

/// A study as its file says it.
#[derive(Debug, Clone, PartialEq)]
pub struct StudyFile {
    /// Its name, for people.
    pub name: String,
    /// What is estimated.
    pub question: StudyQuestion,
    /// The estimators by name.
    pub estimators: Vec<String>,
    /// What they run over.
    pub sources: SourceEntries,
    /// Seeds of what is random.
    pub seeds: Seeds,
    /// Parameters that all runs share, with their values.
    pub parameters: Vec<(String, Json)>,
    /// Parameters that are varied.
    pub design: Design,
    /// What else is asked for.
    pub options: StudyOptions,
}

/// What the file says of the sources.
#[derive(Debug, Clone, PartialEq)]
pub enum SourceEntries {
    /// Recordings and folders of recordings, from the file's folder; and the folder of the files that manifests name.
    Recordings {
        /// Files and folders.
        entries: Vec<String>,
        /// Where the files are that manifests name; `None`: beside the manifest.
        data: Option<String>,
    },
    /// Random worlds.
    Worlds(WorldsTable),
    /// A tracking scenario, from the file's folder, and its variant.
    Scenario(ScenarioTable),
}

/// Which random worlds.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WorldsTable {
    /// Number of the first, default 0.
    #[serde(default)]
    pub first: u64,
    /// How many.
    pub count: u64,
    /// Only those of this motion (attitude).
    pub motion: Option<String>,
    /// Only those of this class (navigation).
    pub class: Option<String>,
}

/// Which scenario.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScenarioTable {
    /// Its file.
    pub file: String,
    /// Its variant, default the base.
    pub variant: Option<String>,
}

/// The seeds: a list, or so many from a first one.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Seeds {
    /// These.
    List(Vec<u64>),
    /// From the first on.
    From {
        /// The first.
        first: u64,
        /// How many.
        count: u64,
    },
}

impl Seeds {
    /// How many.
    #[must_use]
    pub fn count(&self) -> u64 {
        match self {
            Self::List(seeds) => seeds.len() as u64,
            Self::From { count, .. } => *count,
        }
    }

    /// One of them.
    #[must_use]
    pub fn seed(&self, place: u64) -> u64 {
        match self {
            Self::List(seeds) => seeds.get(place as usize).copied().unwrap_or(0),
            Self::From { first, .. } => first.wrapping_add(place),
        }
    }
}

/// What is asked for beside parameters; a table of another question than the study's is refused.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct StudyOptions {
    /// Of attitude.
    pub attitude: AttitudeTable,
    /// Of navigation.
    pub navigation: NavigationTable,
    /// Of tracking.
    pub tracking: TrackingTable,
}

/// Options of attitude runs.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct AttitudeTable {
    /// The profile that parameters start from, default `hand-held`.
    pub profile: Option<String>,
    /// The sensors to use, such as `gyro,acc`; default all.
    pub sensors: Option<String>,
}

/// Options of navigation runs.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct NavigationTable {
    /// One of so many fixes is used, the others are held out and scored at; default 1.
    pub gnss_every: Option<u32>,
    /// Times without fixes, `START:DURATION` in seconds after the first fix.
    pub outages: Vec<String>,
    /// Scores count from so many seconds after the first fix, default 60.
    pub score_from_s: Option<f64>,
}

/// Options of tracking runs over recordings.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TrackingTable {
    /// The sensors to use, default those that the manifest marks.
    pub sensors: Option<Vec<String>>,
    /// Distance beyond which a track is no track of a target, m; default from sensor and scene.
    pub cutoff_m: Option<f64>,
    /// Stated standard deviation of the own ship's position, m.
    pub own_ship_position_std_m: Option<f64>,
    /// Stated standard deviation of the own ship's heading, deg.
    pub own_ship_heading_std_deg: Option<f64>,
    /// An error of the own ship's heading drawn from each seed, deg (one sigma).
    pub injected_heading_std_deg: Option<f64>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    name: Option<String>,
    question: String,
    estimators: Vec<String>,
    sources: SourcesTable,
    seeds: Option<toml::Value>,
    #[serde(default)]
    parameters: toml::Table,
    grid: Option<toml::Table>,
    latin_hypercube: Option<HypercubeTable>,
    attitude: Option<AttitudeTable>,
    navigation: Option<NavigationTable>,
    tracking: Option<TrackingTable>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct SourcesTable {
    recordings: Option<Vec<String>>,
    data: Option<String>,
    worlds: Option<WorldsTable>,
    scenario: Option<ScenarioTable>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct HypercubeTable {
    samples: u64,
    #[serde(default = "first_seed")]
    seed: u64,
    parameters: toml::Table,
}

const fn first_seed() -> u64 {
    1
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct StepsTable {
    from: f64,
    to: f64,
    steps: u64,
    #[serde(default)]
    scale: Scale,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct FirstAndCount {
    first: u64,
    count: u64,
}

impl StudyFile {
    /// Reads the text of a file; `place` is what messages call it.
    ///
    /// # Errors
    /// It is no TOML, has unknown keys or lacks some, or a list is empty.
    pub fn parse(place: &str, text: &str) -> Result<Self, StudyError> {
        let document: Document = toml::from_str(text).map_err(|error| {
            let start = error.span().map_or(0, |span| span.start.min(text.len()));
            let before = text.as_bytes()[..start].iter();
            let line = before.filter(|byte| **byte == b'\n').count() + 1;
            StudyError::file(place, &format!("line {line}: {}", error.message()))
        })?;
        let file = |problem: String| StudyError::file(place, &problem);
        document.into_study(place).map_err(file)
    }
}

impl Document {
    fn into_study(self, place: &str) -> Result<StudyFile, String> {
        let Some(question) = StudyQuestion::named(&self.question) else {
            let (asked, known) = (&self.question, StudyQuestion::names());
            return Err(format!(
                "unknown question `{asked}`; expected one of: {known}"
            ));
        };
        let tables = [
            ("attitude", StudyQuestion::Attitude, self.attitude.is_some()),
            (
                "navigation",
                StudyQuestion::Navigation,
                self.navigation.is_some(),
            ),
            ("tracking", StudyQuestion::Tracking, self.tracking.is_some()),
        ];
        if let Some((name, _, _)) = tables.iter().find(|(_, of, is)| *is && *of != question) {
            let asked = question.name();
            return Err(format!(
                "[{name}] is of another question than `{asked}`; leave it out"
            ));
        }
        distinct("estimators", &self.estimators)?;
        let stem = std::path::Path::new(place).file_stem();
        let stem = stem.map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
        Ok(StudyFile {
            name: self.name.unwrap_or(stem),
            question,
            estimators: self.estimators,
            sources: self.sources.entries()?,
            seeds: seeds(self.seeds)?,
            parameters: flat(&self.parameters)
                .into_iter()
                .map(|(name, value)| Ok((name.clone(), json(&name, &value)?)))
                .collect::<Result<_, String>>()?,
            design: design(self.grid, self.latin_hypercube)?,
            options: StudyOptions {
                attitude: self.attitude.unwrap_or_default(),
                navigation: self.navigation.unwrap_or_default(),
                tracking: self.tracking.unwrap_or_default(),
            },
        })
    }
}

/// Refuses an empty list and one with the same twice.
fn distinct(what: &str, names: &[String]) -> Result<(), String> {
    if names.is_empty() {
        return Err(format!("{what}: the list is empty; name one or more"));
    }
    let twice = |(place, name): &(usize, &String)| names[..*place].contains(name);
    match names.iter().enumerate().find(twice) {
        Some((_, name)) => Err(format!("{what}: `{name}` is named twice")),
        None => Ok(()),
    }
}

impl SourcesTable {
    fn entries(self) -> Result<SourceEntries, String> {
        if self.data.is_some() && self.recordings.is_none() {
            return Err(
                "sources: `data` is the folder of recordings; name `recordings`".to_owned(),
            );
        }
        match (self.recordings, self.worlds, self.scenario) {
            (Some(entries), None, None) => {
                distinct("sources.recordings", &entries)?;
                let data = self.data;
                Ok(SourceEntries::Recordings { entries, data })
            }
            (None, Some(worlds), None) => match worlds.count {
                0 => Err("sources.worlds: count is 0, expected at least 1".to_owned()),
                _ => Ok(SourceEntries::Worlds(worlds)),
            },
            (None, None, Some(scenario)) => Ok(SourceEntries::Scenario(scenario)),
            _ => Err("sources: expected one of `recordings`, `worlds` and `scenario`".to_owned()),
        }
    }
}

fn seeds(value: Option<toml::Value>) -> Result<Seeds, String> {
    let Some(value) = value else {
        return Ok(Seeds::List(vec![first_seed()]));
    };
    let expected = |error: toml::de::Error| {
        let problem = error.message().to_owned();
        format!(
            "seeds: {problem}; expected a list such as [1, 2, 3], or {{ first = 1, count = 100 }}"
        )
    };
    let seeds = if value.is_table() {
        let FirstAndCount { first, count } = value.try_into().map_err(expected)?;
        Seeds::From { first, count }
    } else {
        let list: Vec<u64> = value.try_into().map_err(expected)?;
        let names: Vec<String> = list.iter().map(u64::to_string).collect();
        distinct("seeds", &names)?;
        Seeds::List(list)
    };
    let last = (seeds.count().checked_sub(1))
        .and_then(|last| match &seeds {
            Seeds::From { first, .. } => first.checked_add(last),
            Seeds::List(list) => list.iter().max().copied(),
        })
        .filter(|last| i64::try_from(*last).is_ok());
    match last {
        Some(_) => Ok(seeds),
        None => Err("seeds: expected one or more, from 0 to 9223372036854775807".to_owned()),
    }
}

fn design(grid: Option<toml::Table>, hypercube: Option<HypercubeTable>) -> Result<Design, String> {
    match (grid, hypercube) {
        (Some(_), Some(_)) => {
            Err("[grid] and [latin_hypercube] are two studies; leave one out".to_owned())
        }
        (Some(grid), None) => {
            let axes: Vec<_> = flat(&grid)
                .into_iter()
                .map(|(parameter, value)| {
                    let values = levels(&parameter, value)?;
                    Ok(Axis { parameter, values })
                })
                .collect::<Result<_, String>>()?;
            match axes.is_empty() {
                true => Err("[grid] is empty; name a parameter, or leave it out".to_owned()),
                false => Ok(Design::Grid(axes)),
            }
        }
        (None, Some(table)) => {
            if table.samples == 0 {
                return Err("latin_hypercube.samples is 0, expected at least 1".to_owned());
            }
            let axes: Vec<_> = flat(&table.parameters)
                .into_iter()
                .map(|(parameter, value)| {
                    let values = span(&parameter, value)?;
                    Ok(Axis { parameter, values })
                })
                .collect::<Result<_, String>>()?;
            if axes.is_empty() {
                return Err("[latin_hypercube.parameters] is empty; name a parameter".to_owned());
            }
            let (samples, seed) = (table.samples, table.seed);
            Ok(Design::LatinHypercube {
                samples,
                seed,
                axes,
            })
        }
        (None, None) => Ok(Design::Grid(Vec::new())),
    }
}

/// The values of a table by dotted names; a table that has `from` is a value.
fn flat(table: &toml::Table) -> Vec<(String, toml::Value)> {
    let mut all = Vec::new();
    for (name, value) in table {
        match value {
            toml::Value::Table(inner) if !inner.contains_key("from") => {
                let inner = flat(inner).into_iter();
                all.extend(inner.map(|(rest, value)| (format!("{name}.{rest}"), value)));
            }
            value => all.push((name.clone(), value.clone())),
        }
    }
    all
}

const EXPECTED_LEVELS: &str =
    "expected a list of values, or { from = 0.1, to = 10, steps = 5, scale = \"log\" }";

fn levels(parameter: &str, value: toml::Value) -> Result<Levels, String> {
    match value {
        toml::Value::Array(values) if values.is_empty() => Err(format!(
            "grid.{parameter}: the list is empty; {EXPECTED_LEVELS}"
        )),
        toml::Value::Array(values) => {
            let values: Vec<Json> = values
                .iter()
                .map(|value| json(parameter, value))
                .collect::<Result<_, _>>()?;
            let texts: Vec<String> = values.iter().map(Json::to_string).collect();
            distinct(&format!("grid.{parameter}"), &texts)?;
            Ok(Levels::List(values))
        }
        value @ toml::Value::Table(_) => {
            let table: StepsTable = value.try_into().map_err(|error: toml::de::Error| {
                format!("grid.{parameter}: {}; {EXPECTED_LEVELS}", error.message())
            })?;
            let span = Span {
                from: table.from,
                to: table.to,
                scale: table.scale,
            };
            if table.steps < 2 {
                let steps = table.steps;
                return Err(format!(
                    "grid.{parameter}: steps is {steps}, expected 2 or more"
                ));
            }
            match span.problem() {
                Some(problem) => Err(format!("grid.{parameter}: {problem}")),
                None => Ok(Levels::Steps(span, table.steps)),
            }
        }
        _ => Err(format!("grid.{parameter}: {EXPECTED_LEVELS}")),
    }
}

fn span(parameter: &str, value: toml::Value) -> Result<Span, String> {
    let place = format!("latin_hypercube.parameters.{parameter}");
    let span: Span = value.try_into().map_err(|error: toml::de::Error| {
        let problem = error.message();
        format!("{place}: {problem}; expected {{ from = 0.1, to = 10, scale = \"log\" }}")
    })?;
    match span.problem() {
        Some(problem) => Err(format!("{place}: {problem}")),
        None => Ok(span),
    }
}

/// A value of TOML as settings have it.
fn json(parameter: &str, value: &toml::Value) -> Result<Json, String> {
    Ok(match value {
        toml::Value::String(text) => Json::from(text.as_str()),
        toml::Value::Integer(integer) => Json::from(*integer),
        toml::Value::Float(float) => number(*float),
        toml::Value::Boolean(flag) => Json::from(*flag),
        toml::Value::Array(items) => {
            let items = items.iter().map(|item| json(parameter, item));
            Json::Array(items.collect::<Result<_, _>>()?)
        }
        toml::Value::Datetime(_) | toml::Value::Table(_) => {
            return Err(format!(
                "`{parameter}` is no number, word or list of numbers"
            ));
        }
    })
}

#[cfg(test)]
mod tests {
    use super::{SourceEntries, StudyFile};

    /// What the page shows is taken as it stands.
    #[test]
    fn the_sources_of_the_page_are_read() {
        let page = include_str!("../../../../docs/studies.md");
        let section = page.split("## Sources").nth(1).unwrap();
        let shown = section.split("```toml").nth(1).unwrap();
        let shown = shown.split("```").next().unwrap();
        let study = format!("question = \"attitude\"\nestimators = [\"mekf\"]\n{shown}");
        let study = StudyFile::parse("study.toml", &study).unwrap();
        let SourceEntries::Recordings { entries, .. } = &study.sources else {
            panic!("{:?}", study.sources);
        };
        assert_eq!(entries.len(), 2);
    }
}
