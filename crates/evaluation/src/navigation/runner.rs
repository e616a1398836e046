//! Runs a navigation estimator over a stream of events.
//!
//! The first fix that a later one confirms is the origin of a local frame, north, east, down, which moves along with the
//! vehicle; everything inside is metres from there. Fixes can be thinned and held out, and what is held out is scored at. Memory does not grow
//! with the recording, unless the estimates are smoothed.

mod axes_agreement;
pub(super) mod consensus;
mod finish;
mod moving_origin;
pub(super) mod receiver;
mod scoring;
mod travel_direction;
mod turn_agreement;

use std::collections::BTreeMap;

use nalgebra::{Matrix3, UnitQuaternion, Vector2, Vector3};
use northing_core::earth::wgs84::Geodetic;
use northing_core::geometry::frames::{flu_from_frd, flu_from_phone};
use northing_core::kalman::{Outcome, SkipReason};
use northing_core::navigation::gnss_ins::GAP_LIMIT_S;
use northing_recording::{BodyAxes, DeviceNavigation, Event, Frames, Sample, SensorKind};

use self::axes_agreement::AxesAgreement;
use self::consensus::{FixConsensus, Step};
use self::travel_direction::Travel;
use self::turn_agreement::TurnAgreement;
use super::axis_navigator::AxisNavigator;
use super::batch_smoother::SmoothingSummary;
use super::device_navigator::DeviceNavigator;
use super::ins_navigator::InsNavigator;
use super::kinds::NavigationKind;
use super::moving_frame::MovingFrame;
use super::navigator::{Aid, AidKind, NavigationEstimate, Navigator, Told};
use super::observer::NavigationObserver;
use super::options::NavigationOptions;
use super::outcome::{NavigationSummary, ValidityTimes};
use super::score::{LastFix, Scorer};
use super::ship_navigator::ShipNavigator;
use super::smoothed::Scored;
use crate::error::EvaluationError;
use crate::events::{Events, of_one_error};
use crate::statistics::faults::FaultTally;
use crate::statistics::nis::{NisStatistics, UpdateCounts};
use crate::statistics::seconds_between;
use crate::used_parameters::{Origin, UsedParameter};

/// Standard deviation of a heading where the sensor states none, rad.
const HEADING_STD: f64 = 0.01;

/// Runs the estimator of `options` over `events`, which must be in time order; `name` stands for the
/// recording, `frames` are its world and the axes of its sensors ([`northing_recording::Metadata::frames`]), or its world
/// alone with the axes that belong to it.
///
/// # Errors
/// The options are invalid, the events end in an error, there was not one usable fix, or no two agree.
pub fn run_navigation<I, X>(
    events: I,
    name: &str,
    frames: impl Into<Frames>,
    options: &NavigationOptions,
    observer: &mut dyn NavigationObserver,
) -> Result<NavigationSummary, EvaluationError>
where
    I: IntoIterator<Item = Result<Event, X>>,
    X: std::error::Error + Send + Sync + 'static,
{
    run_whole(
        &mut of_one_error(events),
        name,
        frames.into(),
        options,
        observer,
    )
}

fn run_whole(
    events: &mut Events<'_>,
    name: &str,
    frames: Frames,
    options: &NavigationOptions,
    observer: &mut dyn NavigationObserver,
) -> Result<NavigationSummary, EvaluationError> {
    options.check()?;
    let mut session = Session::new(options, frames, observer)?;
    for event in events {
        session.take(&event?);
    }
    session.end()?;
    session.flush_inertial();
    if options.smooth {
        session.smooth();
    }
    session.finish(name)
}

/// Whether a measurement changed the state, or will with a later one.
fn is_used(outcome: Outcome) -> bool {
    let accumulated = Outcome::Skipped(SkipReason::Accumulated);
    matches!(outcome, Outcome::Fused | Outcome::Inflated) || outcome == accumulated
}

fn navigator(options: &NavigationOptions) -> Result<Box<dyn Navigator>, EvaluationError> {
    let p = &options.parameters;
    Ok(match options.estimator {
        NavigationKind::ErrorState => Box::new(InsNavigator::new(p.error_state, options.smooth)?),
        NavigationKind::AxisFilters => {
            Box::new(AxisNavigator::new(p.attitude_axes, p.position_axes)?)
        }
        NavigationKind::DeadReckoning => Box::new(ShipNavigator::new(p.dead_reckoning)?),
        NavigationKind::Device => Box::new(DeviceNavigator::default()),
    })
}

/// One estimator on its way through one recording.
struct Session<'a> {
    options: &'a NavigationOptions,
    /// What the estimator was configured with.
    parameters: Vec<UsedParameter>,
    frames: Frames,
    observer: &'a mut dyn NavigationObserver,
    navigator: Box<dyn Navigator>,
    consensus: FixConsensus,
    frame: Option<MovingFrame>,
    /// The declination (rad) of the first origin, where the navigator took it.
    declination: Option<f64>,
    inertial: Inertial,
    turns: TurnAgreement,
    axes: AxesAgreement,
    travel: Travel,
    scorer: Scorer,
    has_reference: bool,
    /// Usable fixes so far.
    fix_index: u64,
    /// Whether the receiver's present epoch is held out.
    held_out: bool,
    /// Whether nobody should use it.
    unusable: bool,
    last_fix: Option<LastFix>,
    counts: Counts,
    told: Vec<Told>,
    has_field: bool,
    /// The orientation that the device reported last, `ned_from_body`.
    device_attitude: Option<(i64, UnitQuaternion<f64>)>,
    device_estimates: u64,
    /// How fast the body turns, rad/s.
    turn_rate: f64,
    /// What is to be scored, kept until the estimates are smoothed.
    kept: Vec<Scored>,
    /// How smoothing went.
    smoothing: Option<SmoothingSummary>,
    observed_ns: Option<i64>,
}

/// Counts for the summary.
#[derive(Default)]
struct Counts {
    faults: FaultTally,
    first_ns: Option<i64>,
    last_ns: i64,
    inertial: u64,
    inertial_ns: Span,
    fixes: u64,
    /// Of usable fixes.
    fixes_ns: Span,
    /// Fixes that state a standard deviation that is not above zero.
    zero_std: u64,
    /// Smallest and largest standard deviation that the fixes it got state horizontally, m.
    stated_std_m: Option<[f64; 2]>,
    /// Fixes that the estimator got.
    given: u64,
    /// Those of them that changed its state, or will.
    used: u64,
    unusable: BTreeMap<&'static str, u64>,
    aids: BTreeMap<AidKind, (UpdateCounts, NisStatistics)>,
    validity: ValidityTimes,
    last_validity_ns: Option<i64>,
    scored_at_reference: bool,
}

impl Counts {
    /// A fix that was given states a standard deviation, m.
    fn states(&mut self, std_m: f64) {
        let [least, most] = self.stated_std_m.unwrap_or([std_m; 2]);
        self.stated_std_m = Some([least.min(std_m), most.max(std_m)]);
    }
}

/// The first and the last stamp of something.
#[derive(Debug, Clone, Copy, Default)]
struct Span(Option<[i64; 2]>);

impl Span {
    fn add(&mut self, time_ns: i64) {
        let [first, _] = self.0.unwrap_or([time_ns; 2]);
        self.0 = Some([first, time_ns]);
    }
}

/// Pairs rates and forces of one instant; a force that is missing is the one before.
#[derive(Default)]
struct Inertial {
    waiting: Option<(i64, Vector3<f64>)>,
    force: Option<Vector3<f64>>,
    /// Stamp of the last rate, and the forces since then while that may be a pause of the gyroscope.
    last_rate_ns: Option<i64>,
    since_rate: Vec<(i64, Vector3<f64>)>,
}

impl Inertial {
    /// Takes a force that no rate of its instant waits for; forces of a pause of the gyroscope, once it is one.
    fn without_rate(&mut self, time_ns: i64, force: Vector3<f64>) -> Vec<(i64, Vector3<f64>)> {
        let Some(last_ns) = self.last_rate_ns else {
            return Vec::new();
        };
        self.since_rate.push((time_ns, force));
        if seconds_between(last_ns, time_ns) > GAP_LIMIT_S {
            return std::mem::take(&mut self.since_rate);
        }
        Vec::new()
    }
}

impl<'a> Session<'a> {
    fn new(
        options: &'a NavigationOptions,
        frames: Frames,
        observer: &'a mut dyn NavigationObserver,
    ) -> Result<Self, EvaluationError> {
        Ok(Self {
            options,
            parameters: options.used_parameters(),
            frames,
            observer,
            navigator: navigator(options)?,
            consensus: FixConsensus::default(),
            frame: None,
            declination: None,
            inertial: Inertial::default(),
            turns: TurnAgreement::default(),
            axes: AxesAgreement::default(),
            travel: Travel::default(),
            scorer: Scorer::new(options.score_from_s, &options.outages),
            has_reference: false,
            fix_index: 0,
            held_out: false,
            unusable: false,
            last_fix: None,
            counts: Counts::default(),
            told: Vec::new(),
            has_field: false,
            device_attitude: None,
            device_estimates: 0,
            turn_rate: 0.0,
            kept: Vec::new(),
            smoothing: None,
            observed_ns: None,
        })
    }

    /// Takes an event, or lets it wait until it is known where the origin is.
    fn take(&mut self, event: &Event) {
        match self.consensus.look_at(event) {
            Step::Take => self.process(event, false),
            Step::Wait => self.take_waiting(),
        }
    }

    fn take_waiting(&mut self) {
        while let Some((event, left_out)) = self.consensus.next() {
            self.process(&event, left_out);
        }
    }

    /// There are no more events: what still waits is taken.
    fn end(&mut self) -> Result<(), EvaluationError> {
        self.consensus.end()?;
        self.take_waiting();
        Ok(())
    }

    /// Takes an event now; `left_out`: it is a fix that those after it contradict.
    fn process(&mut self, event: &Event, left_out: bool) {
        let time_ns = event.time_ns;
        self.counts.first_ns.get_or_insert(time_ns);
        self.counts.last_ns = time_ns;
        self.navigator.advance_to(time_ns);
        self.book_validity(time_ns);
        self.follow_estimate(time_ns);
        let same_instant = self.inertial.waiting.is_some_and(|(at, _)| at == time_ns);
        if !(same_instant && event.sample.kind() == SensorKind::Accelerometer) {
            self.flush_inertial();
        }
        match event.sample {
            Sample::AngularRate(rate) => {
                self.inertial.waiting = Some((time_ns, self.body(&rate)));
                self.inertial.last_rate_ns = Some(time_ns);
                self.inertial.since_rate.clear();
            }
            Sample::SpecificForce(force) => {
                let force = self.body(&force);
                self.inertial.force = Some(force);
                if same_instant {
                    self.flush_inertial();
                } else {
                    self.force_without_rate(time_ns, force);
                }
            }
            Sample::GnssPosition(fix) => self.gnss_position(time_ns, &fix, left_out),
            Sample::GnssVelocity(velocity) => self.gnss_velocity(time_ns, &velocity),
            Sample::ReferencePosition(place) => self.reference_position(time_ns, &place),
            Sample::ReferenceVelocity(velocity) => {
                let vertical = velocity.z.is_finite();
                self.score(Scored::Velocity(time_ns, velocity, vertical));
                self.score(Scored::Course(time_ns, velocity, self.turn_rate));
            }
            Sample::Reference(reference) => self.reference_attitude(time_ns, &reference),
            Sample::DeviceOrientation(attitude) if event.sample.is_finite() => {
                self.device_attitude = Some((time_ns, self.ned_from_frd(&attitude)));
            }
            Sample::DeviceNavigation(said) => self.device(time_ns, &said),
            other => {
                if let Some(aid) = self.other_aid(time_ns, &other) {
                    self.aid(time_ns, &aid);
                }
            }
        }
    }

    /// Keeps a parameter that the estimator has learnt.
    fn learnt(&mut self, name: &str, value: f64) {
        let known = self.parameters.iter_mut().find(|used| used.name == name);
        if let Some(used) = known {
            (used.value, used.origin) = (value.into(), Origin::Learnt);
        }
    }

    /// Body axes of the recording as forward, right, down.
    fn body(&self, v: &Vector3<f64>) -> Vector3<f64> {
        match self.frames.body {
            BodyAxes::Frd => *v,
            BodyAxes::Flu => flu_from_frd(v),
            BodyAxes::Phone => flu_from_frd(&flu_from_phone(v)),
        }
    }

    fn other_aid(&mut self, time_ns: i64, sample: &Sample) -> Option<Aid> {
        match sample {
            Sample::MagneticField(field) => {
                self.has_field = true;
                Some(self.field(time_ns, field))
            }
            Sample::MagneticFieldUncalibrated(field) if !self.has_field => {
                Some(self.field(time_ns, field))
            }
            Sample::TrueHeading(heading) => Some(Aid::Heading {
                heading: heading.heading_rad,
                std: heading.std_rad.unwrap_or(HEADING_STD),
            }),
            Sample::Pressure(pressure) => Some(Aid::Pressure(*pressure)),
            Sample::ForwardSpeed(speed) => Some(Aid::ForwardSpeed(*speed)),
            Sample::WaterVelocity(water) => Some(Aid::WaterVelocity(Vector2::new(
                water.forward_m_s,
                water.starboard_m_s.unwrap_or(0.0),
            ))),
            _ => None,
        }
    }

    fn field(&mut self, time_ns: i64, field: &Vector3<f64>) -> Aid {
        let field = self.body(field);
        self.observer.magnetic_field(time_ns, &field);
        Aid::MagneticField(field)
    }

    /// What the device itself said.
    fn device(&mut self, time_ns: i64, said: &DeviceNavigation) {
        let Some(frame) = self.frame.map(|frame| *frame.now()) else {
            return;
        };
        if !said.is_usable() {
            return;
        }
        let attitude = self.device_attitude.filter(|(at, _)| *at == time_ns);
        let variances = Vector3::from(said.std_m.map(|std| std * std));
        let estimate = NavigationEstimate {
            time_ns,
            frame,
            ned_from_body: attitude.map(|(_, attitude)| attitude),
            attitude_covariance: None,
            velocity_covariance: None,
            heading_std: Some(said.heading_std_rad),
            position: frame.ned(&Geodetic {
                latitude_rad: said.latitude_rad,
                longitude_rad: said.longitude_rad,
                height_m: said.height_m,
            }),
            position_covariance: Matrix3::from_diagonal(&variances),
            velocity: Vector3::from(said.velocity_m_s),
            validity: said.validity,
        };
        self.device_estimates += 1;
        self.navigator.device(&estimate);
        self.observer.device(&estimate);
        self.observe(time_ns);
    }

    /// Gives the estimator the rate that waits, with the newest force.
    fn flush_inertial(&mut self) {
        let Some((time_ns, rate)) = self.inertial.waiting.take() else {
            return;
        };
        let Some(force) = self.inertial.force else {
            return;
        };
        self.counts.inertial += 1;
        self.counts.inertial_ns.add(time_ns);
        self.turns.inertial(time_ns, &rate, &force);
        self.axes.inertial(time_ns, &rate, &force);
        self.turn_rate = rate.norm();
        self.navigator
            .inertial(time_ns, &rate, &force, &mut self.told);
        self.take_faults();
        self.observer.inertial(time_ns, &rate, &force);
        self.count_told(time_ns);
        self.observe(time_ns);
    }

    /// Gives the estimator forces of a pause of the gyroscope.
    fn force_without_rate(&mut self, time_ns: i64, force: Vector3<f64>) {
        for (at_ns, force) in self.inertial.without_rate(time_ns, force) {
            self.navigator.force_without_rate(at_ns, &force);
            self.take_faults();
            self.observe(at_ns);
        }
    }

    fn take_faults(&mut self) {
        while let Some(fault) = self.navigator.take_fault() {
            let first_ns = self.counts.first_ns.unwrap_or(fault.until_ns);
            self.counts.faults.add(first_ns, &fault);
        }
    }

    fn aid(&mut self, time_ns: i64, aid: &Aid) {
        if self.options.without.contains(&aid.kind()) {
            return;
        }
        self.navigator.aid(time_ns, aid, &mut self.told);
        self.count_told(time_ns);
        self.observe(time_ns);
    }

    fn count_told(&mut self, time_ns: i64) {
        for (kind, innovation) in self.told.drain(..) {
            let outcome = innovation.outcome;
            self.counts.used += u64::from(kind == AidKind::GnssPosition && is_used(outcome));
            let (updates, nis) = self.counts.aids.entry(kind).or_default();
            updates.add(outcome);
            nis.add(&innovation);
            self.observer.innovation(time_ns, kind, &innovation);
        }
    }

    /// Counts what the position was worth since the event before.
    fn book_validity(&mut self, time_ns: i64) {
        if let Some(last) = self.counts.last_validity_ns.replace(time_ns) {
            let seconds = seconds_between(last, time_ns);
            self.counts.validity.add(self.navigator.validity(), seconds);
        }
    }

    /// Shows an estimate where one is due.
    fn observe(&mut self, time_ns: i64) {
        let interval = self.observer.interval_ns();
        let due = self
            .observed_ns
            .is_none_or(|last| time_ns.saturating_sub(last) >= interval);
        if interval == i64::MAX || !due || self.options.smooth {
            return;
        }
        if let Some(estimate) = self.navigator.estimate() {
            // The device says each of its estimates once; between them there is nothing new.
            if self.options.estimator == NavigationKind::Device && estimate.time_ns != time_ns {
                return;
            }
            self.observed_ns = Some(time_ns);
            self.observer.estimate(&estimate);
        }
    }
}
