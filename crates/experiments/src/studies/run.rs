//! One run of a study: an estimator with its parameters over a source.

use northing_evaluation::attitude::parameters::parameters_of;
use northing_evaluation::attitude::{RunObserver, ScoredRecord};
use northing_evaluation::by_name;
use northing_evaluation::navigation::{NavigationKind, NavigationOptions, run_navigation};
use northing_evaluation::tracking::{self, OwnShipStd, TrackOptions};
use northing_evaluation::used_parameters::UsedParameter;
use northing_evaluation::{EstimatorKind, EvaluationError, Origin, Profile, RunOptions, attitude};
use northing_recording::tracking::TrackingRecording;
use northing_recording::{
    Event, Metadata, OpenOptions, Recording, RecordingError, WorldFrame, open,
};
use northing_simulation::random::{standard_normal, stream};
use serde_json::Value as Json;

use super::file::{AttitudeTable, NavigationTable, StudyFile, StudyQuestion, TrackingTable};
use super::scores;
use super::{StudyError, scenario};
use crate::attitude_worlds::score::Moment;
use crate::attitude_worlds::{EstimatorRun, Sensing};
use crate::scoring::Thinned;

/// A parameter and its value.
pub(super) type Setting = (String, Json);

/// What a run came to: its scores, and every parameter that it used.
pub(super) type Scored = (Vec<f64>, Vec<UsedParameter>);

/// An estimator with the options that all its runs share.
#[derive(Debug, Clone)]
pub(super) enum Setup {
    /// Of attitude.
    Attitude(Box<RunOptions>),
    /// Of navigation.
    Navigation(Box<NavigationOptions>),
    /// Of targets in recordings.
    Tracking(Box<TrackOptions>),
    /// Of one target in a scenario.
    Scenario(crate::radar::TrackerKind),
}

/// As `NAME=VALUE`.
fn text((name, value): &Setting) -> String {
    format!("{name}={}", by_name::text(value))
}

impl Setup {
    /// Of the estimator of this name.
    ///
    /// # Errors
    /// There is none, or an option does not fit.
    pub(super) fn of(file: &StudyFile, name: &str, has_scenario: bool) -> Result<Self, StudyError> {
        Ok(match file.question {
            StudyQuestion::Attitude => Self::Attitude(Box::new(attitude_options(
                attitude_kind(name)?,
                &file.options.attitude,
            )?)),
            StudyQuestion::Navigation => Self::Navigation(Box::new(navigation_options(
                name.parse()?,
                &file.options.navigation,
            )?)),
            StudyQuestion::Tracking if has_scenario => Self::Scenario(
                crate::radar::TrackerKind::parse(name)
                    .map_err(|error| StudyError::Refused(error.to_string()))?,
            ),
            StudyQuestion::Tracking => {
                let mut options = tracking_options(&file.options.tracking)?;
                options.tracker = name.parse().map_err(StudyError::Refused)?;
                Self::Tracking(Box::new(options))
            }
        })
    }

    /// Refuses a parameter that this estimator does not have, and a value that it cannot have. Those of scenarios are
    /// checked with the scenario.
    ///
    /// # Errors
    /// The name is unknown (the nearest one is named), has no effect, or the value does not fit.
    pub(super) fn check(&self, setting: &Setting) -> Result<(), StudyError> {
        let text = text(setting);
        match self {
            Self::Attitude(options) => {
                let mut options = options.clone();
                options.set(&text)?;
                has_effect(options.estimator, &setting.0)?;
                options.check()?;
            }
            Self::Navigation(options) => {
                let mut options = options.clone();
                options.set_from(&text, Origin::Set)?;
                options.check()?;
            }
            Self::Tracking(options) => options.clone().set_from(&text, Origin::Set)?,
            Self::Scenario(_) => {}
        }
        Ok(())
    }
}

/// One of ours: what others bring along has no version that a row could state.
fn attitude_kind(name: &str) -> Result<EstimatorKind, EvaluationError> {
    let known = EstimatorKind::ALL
        .into_iter()
        .find(|kind| kind.name() == name);
    known.ok_or_else(|| EvaluationError::UnknownEstimator {
        name: name.to_owned(),
        valid: EstimatorKind::ALL.map(EstimatorKind::name).join(", "),
    })
}

fn has_effect(kind: EstimatorKind, name: &str) -> Result<(), StudyError> {
    let known = parameters_of(kind);
    if known.iter().any(|parameter| parameter.name == name) {
        return Ok(());
    }
    Err(StudyError::Refused(format!(
        "the parameter `{name}` has no effect on `{kind}`; leave the estimator out, or make a study of its own for it \
         (`northing estimators {kind}` lists its parameters)"
    )))
}

fn attitude_options(
    kind: EstimatorKind,
    table: &AttitudeTable,
) -> Result<RunOptions, EvaluationError> {
    let profile = table
        .profile
        .as_deref()
        .map_or(Ok(Profile::HandHeld), str::parse)?;
    let mut options = RunOptions::new(kind, profile);
    if let Some(sensors) = &table.sensors {
        options.sensors = sensors.parse()?;
    }
    Ok(options)
}

fn navigation_options(
    kind: NavigationKind,
    table: &NavigationTable,
) -> Result<NavigationOptions, StudyError> {
    let usual = NavigationOptions::default();
    let outages = table.outages.iter().map(|outage| outage.parse());
    let options = NavigationOptions {
        estimator: kind,
        gnss_every: table.gnss_every.unwrap_or(usual.gnss_every),
        outages: outages
            .collect::<Result<_, String>>()
            .map_err(StudyError::Refused)?,
        score_from_s: table.score_from_s.unwrap_or(usual.score_from_s),
        ..usual
    };
    options.check()?;
    Ok(options)
}

fn tracking_options(table: &TrackingTable) -> Result<TrackOptions, StudyError> {
    let numbers = [
        ("cutoff_m", table.cutoff_m),
        ("own_ship_position_std_m", table.own_ship_position_std_m),
        ("own_ship_heading_std_deg", table.own_ship_heading_std_deg),
        ("injected_heading_std_deg", table.injected_heading_std_deg),
    ];
    for (name, value) in numbers {
        let is_cutoff = name == "cutoff_m";
        let fits = |value: f64| value.is_finite() && (value > 0.0 || (value == 0.0 && !is_cutoff));
        if let Some(value) = value.filter(|value| !fits(*value)) {
            let expected = if is_cutoff {
                "above zero"
            } else {
                "zero or above"
            };
            return Err(StudyError::Refused(format!(
                "tracking.{name} is {value}, expected a number {expected}"
            )));
        }
    }
    // Trackers are told the error that is injected, unless something else is stated.
    let heading = table
        .own_ship_heading_std_deg
        .or(table.injected_heading_std_deg);
    let stated = table.own_ship_position_std_m.is_some() || heading.is_some();
    let own_ship_std = stated.then(|| OwnShipStd {
        position_m: table.own_ship_position_std_m.unwrap_or(0.0),
        heading_rad: heading.unwrap_or(0.0).to_radians(),
    });
    Ok(TrackOptions {
        own_ship_std,
        sensors: table.sensors.clone(),
        cutoff_m: table.cutoff_m,
        ..TrackOptions::default()
    })
}

/// Keeps what is scored ten times a second.
struct Watch {
    thinned: Thinned,
    moments: Vec<Moment>,
}

impl RunObserver for Watch {
    fn scored(&mut self, record: &ScoredRecord) {
        let truth = record.reference.attitude;
        let known = record.reference.scored && truth.coords.iter().all(|x| x.is_finite());
        if known && self.thinned.takes(record.time_s) {
            self.moments.push(Moment {
                time_s: record.time_s,
                estimate: record.attitude,
                covariance: record.attitude_covariance,
                truth,
            });
        }
    }
}

/// Stamps are exact to this, s.
const TOLERANCE_S: f64 = 1e-6;

/// What an attitude run is over.
pub(super) enum Over<'a> {
    /// The events of a world.
    World(&'a [Event]),
    /// A recording, opened for this run.
    Recording(Box<Recording>),
}

impl Over<'_> {
    /// A recording.
    pub(super) fn recording(path: &std::path::Path, options: &OpenOptions) -> Result<Self, String> {
        let recording = open(path, options).map_err(|error| error.to_string())?;
        Ok(Self::Recording(Box::new(recording)))
    }
}

/// Events of memory as a recording has them.
fn as_read(events: &[Event]) -> impl Iterator<Item = Result<Event, RecordingError>> {
    events.iter().map(|event| Ok(*event))
}

/// An attitude run.
pub(super) fn attitude(
    options: &RunOptions,
    settings: &[Setting],
    over: Over<'_>,
) -> Result<Scored, EvaluationError> {
    let mut options = options.clone();
    for setting in settings {
        options.set(&text(setting))?;
    }
    let mut watch = Watch {
        thinned: Thinned::new(TOLERANCE_S),
        moments: Vec::new(),
    };
    let summary = match over {
        Over::World(events) => attitude::runner::run(as_read(events), &options, &mut watch),
        Over::Recording(mut recording) => {
            attitude::runner::run_recording(&mut recording, &options, &mut watch)
        }
    }?;
    let has_north = summary.heading.is_known();
    let name = options.estimator.name();
    let run = EstimatorRun::of(name, Sensing::All, has_north, &watch.moments, None);
    Ok((scores::attitude(&summary, &run.score), summary.parameters))
}

/// A navigation run.
pub(super) fn navigation(
    options: &NavigationOptions,
    settings: &[Setting],
    over: Over<'_>,
) -> Result<Scored, EvaluationError> {
    let of = |metadata: &Metadata| {
        let of = NavigationOptions::of_recording(options.estimator, metadata);
        let mut of = NavigationOptions {
            gnss_every: options.gnss_every,
            outages: options.outages.clone(),
            score_from_s: options.score_from_s,
            ..of
        };
        for setting in settings {
            of.set_from(&text(setting), Origin::Set)?;
        }
        Ok::<_, EvaluationError>(of)
    };
    let summary = match over {
        Over::World(events) => {
            let options = of(&Metadata::default())?;
            run_navigation(as_read(events), "world", WorldFrame::Ned, &options, &mut ())
        }
        Over::Recording(mut recording) => {
            let options = of(recording.metadata())?;
            let name = recording.metadata().name.clone();
            let frames = recording.metadata().frames();
            run_navigation(recording.by_ref(), &name, frames, &options, &mut ())
        }
    }?;
    Ok((scores::navigation(&summary), summary.parameters))
}

/// A run of a tracker over a recording; the heading's error is drawn from the seed.
pub(super) fn tracking(
    options: &TrackOptions,
    settings: &[Setting],
    recording: &TrackingRecording,
    injected: Option<(f64, u64)>,
) -> Result<Scored, EvaluationError> {
    let mut options = options.clone();
    for setting in settings {
        options.set_from(&text(setting), Origin::Set)?;
    }
    if let Some((std_deg, seed)) = injected {
        let draw = standard_normal(&mut stream(seed, "heading"));
        options.heading_error_rad = std_deg.to_radians() * draw;
    }
    let summary = tracking::run(recording, &options, |_| {})?;
    Ok((scores::tracking(&summary), summary.parameters))
}

/// A run of a tracker in a scenario; every key of the scenario is a parameter.
pub(super) fn scenario(
    kind: crate::radar::TrackerKind,
    settings: &[Setting],
    base: &northing_simulation::scenario::Scenario,
    seed: u64,
) -> Result<(Vec<f64>, String), StudyError> {
    let scenario = scenario::with(base, settings)?;
    let used = super::key::as_json(&scenario);
    Ok((scenario::scores(&scenario, kind, seed), used))
}
