//! One world: every estimator and VQF on its samples, and what they estimated ten times a second.

use northing_evaluation::attitude::{CompassUse, EstimateRecord, RunObserver};
use northing_evaluation::{RunOptions, RunSummary, SensorSelection, run};
use northing_recording::{Event, RecordingError};
use northing_simulation::attitude_world::{
    AttitudeWorld, AttitudeWorldDescription, HeadingSource, WorldFault,
};
use serde::Serialize;

use super::cause;
use super::score::{EstimatorScore, Moment, Verdicts, WorldInstant, WorldOutcome};
use super::truth::Truth;
use super::{Sensing, baseline};
use crate::scoring::Thinned;

/// Stamps of worlds are exact to the nanosecond.
const TOLERANCE_S: f64 = 1e-9;

/// What one estimator made of a world.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EstimatorRun {
    /// How it is judged.
    pub score: EstimatorScore,
    /// Scored instants.
    pub instants: Vec<WorldInstant>,
}

/// A world and what was made of it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WorldRun {
    /// What the world has.
    pub description: AttitudeWorldDescription,
    /// Every estimator and VQF, with all sensors and with gyroscope and accelerometer.
    pub runs: Vec<EstimatorRun>,
}

impl WorldRun {
    /// Runs estimators with these options in the world with this number.
    #[must_use]
    pub fn of(seed: u64, number: u64, options: &[RunOptions]) -> Self {
        let world = AttitudeWorld::draw(seed, number);
        let has_fault = world.description.fault != WorldFault::None;
        let mended = has_fault.then(|| AttitudeWorld::draw_without_fault(seed, number));
        Self::in_world(&world, mended.as_ref(), options)
    }

    /// Runs estimators with these options in a world; `mended` is the same without its fault, if it has one.
    #[must_use]
    pub fn in_world(
        world: &AttitudeWorld,
        mended: Option<&AttitudeWorld>,
        options: &[RunOptions],
    ) -> Self {
        let (description, mut runs) = (&world.description, Vec::new());
        let truth = Truth::of(world, mended);
        for sensing in sensings(description) {
            for options in options {
                runs.push(estimator(world, options, sensing, &truth));
            }
            runs.push(vqf(world, sensing));
        }
        Self {
            description: description.clone(),
            runs,
        }
    }

    /// How it is judged.
    #[must_use]
    pub fn outcome(self) -> WorldOutcome {
        WorldOutcome::of(self)
    }
}

/// Without a source of heading all sensors are gyroscope and accelerometer.
fn sensings(world: &AttitudeWorldDescription) -> impl Iterator<Item = Sensing> + use<> {
    let has_heading = !matches!(world.board.heading, HeadingSource::None);
    let wanted = move |sensing: &Sensing| has_heading || *sensing == Sensing::Inertial;
    Sensing::ALL.into_iter().filter(wanted)
}

/// Takes an estimate each tenth of a second.
struct Watch {
    thinned: Thinned,
    moments: Vec<Moment>,
}

impl Watch {
    const fn new() -> Self {
        Self {
            thinned: Thinned::new(TOLERANCE_S),
            moments: Vec::new(),
        }
    }

    fn take(&mut self, moment: Moment) {
        if self.thinned.takes(moment.time_s) {
            self.moments.push(moment);
        }
    }
}

impl RunObserver for Watch {
    fn estimate(&mut self, record: &EstimateRecord) {
        if let Some(reference) = record.reference {
            self.take(Moment {
                time_s: record.time_s,
                estimate: record.attitude,
                covariance: record.attitude_covariance,
                truth: reference.attitude,
            });
        }
    }
}

fn estimator(
    world: &AttitudeWorld,
    options: &RunOptions,
    sensing: Sensing,
    truth: &Truth<'_>,
) -> EstimatorRun {
    let (watch, summary) = watched(world, options, sensing);
    let name = options.estimator.name();
    let has_north = sensing.has_north(&world.description.board.heading);
    let run = |verdicts| EstimatorRun::of(name, sensing, has_north, &watch.moments, verdicts);
    let Some(summary) = summary.filter(cause::has_verdicts) else {
        return run(None);
    };
    let without = run(None).score;
    let costs = |world: &AttitudeWorld, options: &RunOptions| {
        let (watch, _) = watched(world, options, sensing);
        let mended = EstimatorRun::of(name, sensing, has_north, &watch.moments, None);
        cause::is_felt(&without, &mended.score)
    };
    run(Some(Verdicts {
        named: cause::named_cause(&summary),
        blamed_inside_the_band: cause::blamed_inside_the_band(&summary),
        true_causes: truth.causes(options, sensing, costs),
    }))
}

/// Runs an estimator in a world; what cannot be run has no instants, and counts as such.
fn watched(
    world: &AttitudeWorld,
    options: &RunOptions,
    sensing: Sensing,
) -> (Watch, Option<RunSummary>) {
    let mut options = options.clone();
    if sensing == Sensing::Inertial {
        options.sensors = inertial();
    }
    let mut watch = Watch::new();
    let events = world.events.iter();
    let events = events.map(|event| Ok::<Event, RecordingError>(*event));
    let summary = run(events, &options, &mut watch).ok();
    (watch, summary)
}

fn inertial() -> SensorSelection {
    SensorSelection {
        magnetometer: false,
        compass: CompassUse::Never,
        ..SensorSelection::default()
    }
}

fn vqf(world: &AttitudeWorld, sensing: Sensing) -> EstimatorRun {
    let mut watch = Watch::new();
    baseline::estimates(&world.description, &world.events, sensing, |moment| {
        watch.take(moment);
    });
    let has_north = baseline::has_north(&world.description, sensing);
    EstimatorRun::of(baseline::NAME, sensing, has_north, &watch.moments, None)
}
