//! Tracking scenarios: one run scan by scan, and Monte Carlo campaigns that split and merge to the last digit.

use std::panic::resume_unwind;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use northing_experiments::radar::campaign::merge;
use northing_experiments::radar::{Campaign, CampaignOutcome, Part as CorePart, Shard, SingleRun};
use northing_experiments::radar::{CampaignError, TrackerKind};
use northing_recording::atomic_file::write_whole;
use northing_recording::limits::read_description;
use northing_report::{campaign_outcome, campaign_part};
use northing_simulation::scenario::schema::NavigationFilter;
use northing_simulation::scenario::{Scenario, ScenarioFile};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::errors::{of_file, of_recording, refused};

/// Scenarios that come with the module, by name.
const BUILT_IN: [(&str, &str); 1] = [(
    "wilthil-brekke",
    include_str!("../../../scenarios/tracking/wilthil_brekke.toml"),
)];
/// How often a campaign looks whether somebody wants it to end.
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// What is asked of a scenario; as the program's options about it.
#[derive(FromPyObject)]
pub(crate) struct Asked {
    scenario: PathBuf,
    variant: Option<String>,
    seed: Option<u64>,
    navigation: Option<String>,
    trackers: Vec<String>,
}

impl Asked {
    fn scenario(&self) -> PyResult<Scenario> {
        let name = self.scenario.display().to_string();
        let built_in = BUILT_IN.iter().find(|(known, _)| *known == name);
        let text = match built_in.filter(|_| !self.scenario.exists()) {
            Some((_, text)) => (*text).to_owned(),
            None => read_description(&self.scenario).map_err(|error| not_there(&error, &name))?,
        };
        let file = ScenarioFile::parse(&name, &text).map_err(|error| refused(error.to_string()))?;
        let scenario = file.scenario(self.variant.as_deref());
        let mut scenario: Scenario = scenario.map_err(|error| refused(error.to_string()))?;
        if let Some(filter) = &self.navigation {
            scenario.navigation.filter = match filter.as_str() {
                "error-state" => NavigationFilter::ErrorState,
                "gnss-ins" => NavigationFilter::GnssIns,
                other => {
                    return Err(refused(format!(
                        "navigation=\"{other}\": expected error-state or gnss-ins"
                    )));
                }
            };
        }
        Ok(scenario)
    }

    fn trackers(&self) -> PyResult<Vec<TrackerKind>> {
        let parsed = self.trackers.iter().map(|name| TrackerKind::parse(name));
        parsed.collect::<Result<_, _>>().map_err(of_campaign)
    }

    fn seed(&self, scenario: &Scenario) -> u64 {
        self.seed.unwrap_or(scenario.meta.seed)
    }
}

fn not_there(error: &northing_recording::RecordingError, name: &str) -> PyErr {
    let said = of_recording(error);
    let names: Vec<&str> = BUILT_IN.iter().map(|(name, _)| *name).collect();
    let is_name = !name.contains(['.', '/', '\\']);
    match is_name {
        true => refused(format!(
            "scenario=\"{name}\": no such file, and no scenario of the module: these are {}",
            names.join(", ")
        )),
        false => said,
    }
}

#[expect(clippy::needless_pass_by_value, reason = "as map_err hands it over")]
fn of_campaign(error: CampaignError) -> PyErr {
    refused(error.to_string())
}

/// One run of a campaign: its summary as JSON, and a row a scan.
#[pyfunction]
pub(crate) fn simulate<'py>(
    py: Python<'py>,
    asked: Asked,
    run: u64,
) -> PyResult<(String, Bound<'py, PyDict>)> {
    let scenario = asked.scenario()?;
    let seed = asked.seed(&scenario);
    let campaign = Campaign::new(&scenario, &asked.trackers()?, seed, 1).map_err(of_campaign)?;
    let made = py.detach(|| SingleRun::of(&campaign, &scenario.meta.name, seed, run));
    let summary = serde_json::to_string(&made.summary);
    let columns = PyDict::new(py);
    for (name, values) in made.columns {
        columns.set_item(name, PyArray1::from_vec(py, values))?;
    }
    Ok((
        summary.map_err(|error| refused(error.to_string()))?,
        columns,
    ))
}

/// Runs of a campaign, as exact sums: parts of the same campaign can be merged.
#[pyclass(frozen, module = "northing._northing")]
pub(crate) struct Part(CorePart);

/// Runs a campaign, or a shard of one, on all processors or so many threads.
#[pyfunction]
pub(crate) fn montecarlo(
    py: Python<'_>,
    asked: Asked,
    runs: Option<u64>,
    shard: Option<String>,
    threads: Option<usize>,
) -> PyResult<Part> {
    let scenario = asked.scenario()?;
    let runs = runs.unwrap_or_else(|| u64::from(scenario.meta.monte_carlo_runs));
    let shard = match shard {
        Some(text) => Shard::parse(&text).map_err(|error| of_campaign(error.into()))?,
        None => Shard::WHOLE,
    };
    let seed = asked.seed(&scenario);
    let campaign = Campaign::new(&scenario, &asked.trackers()?, seed, runs).map_err(of_campaign)?;
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads.unwrap_or(0))
        .build()
        .map_err(|error| refused(format!("threads: {error}")))?;
    let part =
        py.detach(|| unless_interrupted(|go_on| pool.install(|| campaign.run_while(shard, go_on))));
    let part = part?.map_err(of_campaign)?;
    // Only an interruption ends it early, and that is raised already.
    part.map(Part)
        .ok_or_else(|| refused("the campaign was ended"))
}

/// Runs something long on a thread of its own, while this one listens to Ctrl-C.
fn unless_interrupted<R: Send>(
    long: impl FnOnce(&(dyn Fn() -> bool + Sync)) -> R + Send,
) -> PyResult<R> {
    let interrupted = AtomicBool::new(false);
    let go_on = || !interrupted.load(Ordering::Relaxed);
    std::thread::scope(|scope| {
        let running = scope.spawn(|| long(&go_on));
        let mut signalled = Ok(());
        while !running.is_finished() {
            std::thread::sleep(LOOK_EVERY);
            if signalled.is_ok() {
                signalled = Python::attach(|py| py.check_signals());
                interrupted.store(signalled.is_err(), Ordering::Relaxed);
            }
        }
        let ended = running.join().unwrap_or_else(|panic| resume_unwind(panic));
        signalled.map(|()| ended)
    })
}

#[pymethods]
impl Part {
    /// What the program prints with `montecarlo --json`.
    fn summary_json(&self) -> PyResult<String> {
        let outcome = CampaignOutcome::of(&self.0);
        serde_json::to_string(&outcome).map_err(|error| refused(error.to_string()))
    }

    /// Runs that it holds, and runs of the whole campaign.
    #[getter]
    fn runs(&self) -> (u64, u64) {
        (self.0.sums.runs, self.0.key.runs)
    }

    /// This and other parts as one.
    fn merged(&self, others: Vec<Py<Self>>) -> PyResult<Self> {
        let numbered = |(i, part): (usize, &CorePart)| (format!("part {i}"), part.clone());
        let all = std::iter::once(&self.0).chain(others.iter().map(|part| &part.get().0));
        let parts = all.enumerate().map(numbered).collect();
        merge(parts).map(Self).map_err(of_campaign)
    }

    /// Writes it as `montecarlo --out` does (.parquet).
    fn save(&self, path: PathBuf, force: bool) -> PyResult<()> {
        campaign_part::write(&path, &self.0, force).map_err(of_file)
    }

    /// Reads what was written.
    #[staticmethod]
    fn load(path: PathBuf) -> PyResult<Self> {
        if !Path::exists(&path) {
            let said = format!("{}: there is no such file", path.display());
            return Err(pyo3::exceptions::PyFileNotFoundError::new_err(said));
        }
        let part = campaign_part::read(&path).map_err(|error| refused(format!("{error:#}")));
        Ok(Self(part?))
    }

    /// Writes the program's page about it.
    fn report(&self, py: Python<'_>, path: PathBuf, force: bool) -> PyResult<()> {
        py.detach(|| {
            let html = campaign_outcome::render(&self.0, &CampaignOutcome::of(&self.0));
            write_whole(&path, html.as_bytes(), force).map_err(|error| of_recording(&error))
        })
    }
}
