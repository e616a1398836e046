//! Runs a navigation estimator over a stream of events.
//!
//! The first usable fix is the origin of a local frame, north, east, down; everything inside is metres
//! from there. Fixes can be thinned and kept back, and what is kept back is scored at. Memory does not grow
//! with the recording, unless the estimates look back.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, UnitQuaternion, Vector2, Vector3};
use northing_core::earth::wgs84::{Geodetic, LocalFrame};
use northing_core::geometry::frames::{flu_from_frd, flu_from_phone, ned_from_enu};
use northing_core::geometry::rotation::from_matrix;
use northing_core::kalman::Innovation;
use northing_recording::{
    DeviceNavigation, Event, GnssPosition, GnssQuality, GnssVelocity, Reference, Sample,
    SensorKind, WorldFrame,
};

use super::axis_navigator::AxisNavigator;
use super::device_navigator::DeviceNavigator;
use super::hindsight::{self, Scored};
use super::ins_navigator::InsNavigator;
use super::navigator::{Aid, AidKind, NavigationEstimate, Navigator, Told};
use super::options::{NavigationKind, NavigationOptions};
use super::score::{LastFix, ScorePoint, Scorer, seconds_between};
use super::ship_navigator::ShipNavigator;
use super::summary::{AidSummary, NavigationSummary, Origin, ValidityTimes};
use crate::error::EvaluationError;
use crate::nis::{NisStatistics, UpdateCounts};

/// Error of a range to a satellite, m: with a dilution of 1 half the fixes are within 3 m.
const RANGE_ERROR_M: f64 = 3.6;
/// The vertical dilution where only the horizontal one is known.
const VERTICAL_DILUTION: f64 = 1.7;
/// Above this dilution a fix is not worth using.
const LARGEST_HDOP: f64 = 8.0;
/// Fewer satellites give no position.
const FEWEST_SATELLITES: u8 = 4;
/// Standard deviations of a velocity where the receiver states none, m/s: across, down.
const VELOCITY_STD: [f64; 2] = [0.15, 0.25];
/// Standard deviation of a heading where the sensor states none, rad.
const HEADING_STD: f64 = 0.01;
/// A velocity this much older than a fix does not belong to it, s.
const SAME_FIX_S: f64 = 1.5;

/// How wrong a position was, and how wrong the estimator said that it might be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScoredPoint {
    /// Time of validity, ns.
    pub time_ns: i64,
    /// Estimate minus truth, m, north, east, down.
    pub error: Vector3<f64>,
    /// Root of the horizontal variances' sum that the estimator stated, m.
    pub horizontal_std: f64,
    /// That of the height, m.
    pub vertical_std: f64,
    /// Whether the truth of the height is known.
    pub vertical: bool,
}

/// What watches a navigation run.
pub trait NavigationObserver {
    /// How often an estimate is wanted, ns; 0 for each sample. Each costs a look at the covariance.
    fn interval_ns(&self) -> i64 {
        100_000_000
    }

    /// An estimate.
    fn estimate(&mut self, _estimate: &NavigationEstimate) {}

    /// A fix, m from the origin, and whether the estimator got it.
    fn fix(&mut self, _time_ns: i64, _ned: &Vector3<f64>, _used: bool) {}

    /// A place to score against.
    fn reference(&mut self, _time_ns: i64, _ned: &Vector3<f64>) {}

    /// How wrong a position was.
    fn scored(&mut self, _point: &ScoredPoint) {}

    /// What an aid told.
    fn innovation(&mut self, _time_ns: i64, _aid: AidKind, _innovation: &Innovation<f64>) {}

    /// Inertial samples: angular rate and specific force, body axes.
    fn inertial(&mut self, _time_ns: i64, _rate: &Vector3<f64>, _force: &Vector3<f64>) {}

    /// A sample of the magnetic field, body axes.
    fn magnetic_field(&mut self, _time_ns: i64, _field: &Vector3<f64>) {}

    /// What the device itself said, whatever the estimator.
    fn device(&mut self, _estimate: &NavigationEstimate) {}

    /// The origin of the local frame is known.
    fn origin(&mut self, _frame: &LocalFrame) {}
}

/// Watches nothing.
impl NavigationObserver for () {
    fn interval_ns(&self) -> i64 {
        i64::MAX
    }
}

/// Runs the estimator of `options` over `events`, which must be in time order; `name` stands for the
/// recording, `world` is its frame: north, east, down with a body of forward, right, down, or east, north, up
/// with the axes of a phone.
///
/// # Errors
/// The options make no sense, the events end in an error, or there was not one usable fix.
pub fn run_navigation<I, X>(
    events: I,
    name: &str,
    world: WorldFrame,
    options: &NavigationOptions,
    observer: &mut dyn NavigationObserver,
) -> Result<NavigationSummary, EvaluationError>
where
    I: IntoIterator<Item = Result<Event, X>>,
    X: std::error::Error + Send + Sync + 'static,
{
    options.check()?;
    let mut session = Session::new(options, world, observer)?;
    for event in events {
        let event = event.map_err(|error| EvaluationError::Recording(Box::new(error)))?;
        session.take(&event);
    }
    session.flush_inertial();
    if options.smooth {
        session.look_back();
    }
    session.finish(name)
}

fn navigator(options: &NavigationOptions) -> Result<Box<dyn Navigator>, EvaluationError> {
    let p = &options.parameters;
    let made: Result<Box<dyn Navigator>, &'static str> = match options.estimator {
        NavigationKind::ErrorState => InsNavigator::new(p.error_state, options.smooth)
            .map(|n| Box::new(n) as Box<dyn Navigator>),
        NavigationKind::AxisFilters => AxisNavigator::new(p.attitude_axes, p.position_axes)
            .map(|n| Box::new(n) as Box<dyn Navigator>),
        NavigationKind::DeadReckoning => {
            ShipNavigator::new(p.dead_reckoning).map(|n| Box::new(n) as Box<dyn Navigator>)
        }
        NavigationKind::Device => Ok(Box::new(DeviceNavigator::default())),
    };
    made.map_err(|name| EvaluationError::BadValue {
        name: name.to_owned(),
        value: String::new(),
        problem: "it makes no sense".to_owned(),
    })
}

/// One estimator on its way through one recording.
struct Session<'a> {
    options: &'a NavigationOptions,
    world: WorldFrame,
    observer: &'a mut dyn NavigationObserver,
    navigator: Box<dyn Navigator>,
    frame: Option<LocalFrame>,
    inertial: Inertial,
    scorer: Scorer,
    has_reference: bool,
    /// Usable fixes so far.
    fix_index: u64,
    /// Whether the receiver's present epoch is kept back.
    withheld: bool,
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
    /// What is to be scored, kept until the estimates have looked back.
    kept: Vec<Scored>,
    observed_ns: Option<i64>,
}

/// Counts for the summary.
#[derive(Default)]
struct Counts {
    first_ns: Option<i64>,
    last_ns: i64,
    inertial: u64,
    fixes: u64,
    used: u64,
    unusable: BTreeMap<&'static str, u64>,
    aids: BTreeMap<AidKind, (UpdateCounts, NisStatistics)>,
    validity: ValidityTimes,
    last_validity_ns: Option<i64>,
    scored_at_reference: bool,
}

/// Pairs rates and forces of one instant; a force that is missing is the one before.
#[derive(Default)]
struct Inertial {
    waiting: Option<(i64, Vector3<f64>)>,
    force: Option<Vector3<f64>>,
}

impl<'a> Session<'a> {
    fn new(
        options: &'a NavigationOptions,
        world: WorldFrame,
        observer: &'a mut dyn NavigationObserver,
    ) -> Result<Self, EvaluationError> {
        Ok(Self {
            options,
            world,
            observer,
            navigator: navigator(options)?,
            frame: None,
            inertial: Inertial::default(),
            scorer: Scorer::new(options.score_from_s, &options.outages),
            has_reference: false,
            fix_index: 0,
            withheld: false,
            unusable: false,
            last_fix: None,
            counts: Counts::default(),
            told: Vec::new(),
            has_field: false,
            device_attitude: None,
            device_estimates: 0,
            turn_rate: 0.0,
            kept: Vec::new(),
            observed_ns: None,
        })
    }

    fn take(&mut self, event: &Event) {
        let time_ns = event.time_ns;
        self.counts.first_ns.get_or_insert(time_ns);
        self.counts.last_ns = time_ns;
        self.navigator.advance_to(time_ns);
        self.book_validity(time_ns);
        let same_instant = self.inertial.waiting.is_some_and(|(at, _)| at == time_ns);
        if !(same_instant && event.sample.kind() == SensorKind::Accelerometer) {
            self.flush_inertial();
        }
        match event.sample {
            Sample::AngularRate(rate) => {
                self.inertial.waiting = Some((time_ns, self.body(&rate)));
            }
            Sample::SpecificForce(force) => {
                self.inertial.force = Some(self.body(&force));
                if same_instant {
                    self.flush_inertial();
                }
            }
            Sample::GnssPosition(fix) => self.gnss_position(time_ns, &fix),
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

    /// Body axes of the recording as forward, right, down.
    fn body(&self, v: &Vector3<f64>) -> Vector3<f64> {
        match self.world {
            WorldFrame::Ned => *v,
            WorldFrame::Enu => flu_from_frd(&flu_from_phone(v)),
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

    /// What the device itself said, in the frame of the first fix.
    fn device(&mut self, time_ns: i64, said: &DeviceNavigation) {
        let Some(frame) = self.frame.filter(|_| said.is_usable()) else {
            return;
        };
        let attitude = self.device_attitude.filter(|(at, _)| *at == time_ns);
        let variances = Vector3::from(said.std_m.map(|std| std * std));
        let estimate = NavigationEstimate {
            time_ns,
            ned_from_body: attitude.map(|(_, attitude)| attitude),
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
        self.turn_rate = rate.norm();
        self.navigator
            .inertial(time_ns, &rate, &force, &mut self.told);
        self.observer.inertial(time_ns, &rate, &force);
        self.count_told(time_ns);
        self.observe(time_ns);
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
            let (updates, nis) = self.counts.aids.entry(kind).or_default();
            updates.add(innovation.outcome);
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

    fn gnss_position(&mut self, time_ns: i64, fix: &GnssPosition) {
        self.counts.fixes += 1;
        if let Some(reason) = unusable(fix) {
            *self.counts.unusable.entry(reason).or_default() += 1;
            self.unusable = true;
            return;
        }
        self.unusable = false;
        let ned = self.place(fix);
        self.scorer.fix_came(time_ns);
        let thinned = !self
            .fix_index
            .is_multiple_of(u64::from(self.options.gnss_every));
        self.fix_index += 1;
        let left_out = self.options.without.contains(&AidKind::GnssPosition);
        self.withheld = thinned || left_out || self.scorer.in_outage(time_ns);
        self.observer.fix(time_ns, &ned, !self.withheld);
        let std = position_std(fix);
        let vertical = fix.height_m.is_some();
        if self.withheld {
            if !self.has_reference {
                self.score_position(time_ns, &ned, std.x.max(std.y), vertical);
            }
            return;
        }
        self.counts.used += 1;
        self.score(Scored::FixUsed);
        self.remember(time_ns, &ned);
        let vertical = vertical && !self.options.without.contains(&AidKind::GnssHeight);
        let stated = fix.std_m.is_some();
        let aid = Aid::Position {
            ned,
            std,
            vertical,
            stated,
        };
        self.aid(time_ns, &aid);
    }

    /// Metres from the origin, which the first usable fix is.
    fn place(&mut self, fix: &GnssPosition) -> Vector3<f64> {
        let height = self.frame.as_ref().map_or(0.0, |f| f.origin().height_m);
        let place = Geodetic {
            latitude_rad: fix.latitude_rad,
            longitude_rad: fix.longitude_rad,
            height_m: fix.height_m.unwrap_or(height),
        };
        let frame = self.frame.get_or_insert_with(|| LocalFrame::new(place));
        if self.fix_index == 0 {
            self.observer.origin(frame);
        }
        frame.ned(&place)
    }

    /// Keeps a fix for the answers that need no filter; its velocity is the way from the one before until
    /// the receiver tells it.
    fn remember(&mut self, time_ns: i64, ned: &Vector3<f64>) {
        let velocity = self.last_fix.map_or_else(Vector3::zeros, |last| {
            let passed = seconds_between(last.time_ns, time_ns);
            if passed > 0.0 {
                (ned - last.ned) / passed
            } else {
                last.velocity
            }
        });
        self.last_fix = Some(LastFix {
            time_ns,
            ned: *ned,
            velocity,
        });
    }

    fn gnss_velocity(&mut self, time_ns: i64, velocity: &GnssVelocity) {
        // What comes with a fix that nobody should use is no measurement either.
        if self.frame.is_none() || self.unusable || !velocity.is_finite() {
            return;
        }
        let vertical = velocity.down_m_s.is_some();
        let ned = Vector3::new(
            velocity.north_m_s,
            velocity.east_m_s,
            velocity.down_m_s.unwrap_or(0.0),
        );
        if !self.has_reference {
            if self.withheld {
                self.score(Scored::Velocity(time_ns, ned, vertical));
            }
            self.score(Scored::Course(time_ns, ned, self.turn_rate));
        }
        if self.withheld {
            return;
        }
        if let Some(last) = &mut self.last_fix
            && seconds_between(last.time_ns, time_ns).abs() < SAME_FIX_S
        {
            last.velocity = ned;
        }
        let [across, down] = VELOCITY_STD;
        let std = velocity
            .std_m_s
            .map_or_else(|| Vector3::new(across, across, down), Vector3::from);
        self.aid(time_ns, &Aid::Velocity { ned, std, vertical });
    }

    fn reference_position(&mut self, time_ns: i64, place: &GnssPosition) {
        self.has_reference = true;
        let Some(frame) = self.frame.filter(|_| place.is_usable()) else {
            return;
        };
        let height = place.height_m.unwrap_or(frame.origin().height_m);
        let ned = frame.ned(&Geodetic {
            latitude_rad: place.latitude_rad,
            longitude_rad: place.longitude_rad,
            height_m: height,
        });
        self.observer.reference(time_ns, &ned);
        let std = place.std_m.map_or(0.0, |[north, east, _]| north.max(east));
        self.score_position(time_ns, &ned, std, place.height_m.is_some());
    }

    fn score_position(&mut self, time_ns: i64, ned: &Vector3<f64>, std: f64, vertical: bool) {
        self.counts.scored_at_reference = self.has_reference;
        let latency_s = self.options.parameters.error_state.position_latency_s;
        let latency_ns = (latency_s * 1e9) as i64;
        let point = ScorePoint {
            time_ns: time_ns.saturating_sub(latency_ns),
            ned: *ned,
            std,
            vertical,
            last_fix: self.last_fix,
        };
        self.score(Scored::Position(point));
    }

    /// Scores with the estimate of now, or keeps it for hindsight.
    fn score(&mut self, scored: Scored) {
        if self.options.smooth {
            self.kept.push(scored);
        } else {
            let estimate = self.navigator.estimate();
            self.score_with(&scored, estimate.as_ref());
        }
    }

    fn score_with(&mut self, scored: &Scored, estimate: Option<&NavigationEstimate>) {
        let error = scored.score(&mut self.scorer, estimate);
        if let (Some(error), Some(estimate), Scored::Position(point)) = (error, estimate, scored) {
            let c = &estimate.position_covariance;
            self.observer.scored(&ScoredPoint {
                time_ns: point.time_ns,
                error,
                horizontal_std: (c.m11 + c.m22).max(0.0).sqrt(),
                vertical_std: c.m33.max(0.0).sqrt(),
                vertical: point.vertical,
            });
        }
    }

    /// Scores and shows what the estimates know once they have looked back.
    fn look_back(&mut self) {
        let nodes = self.navigator.smoothed();
        for scored in core::mem::take(&mut self.kept) {
            let time_ns = scored.time_ns().unwrap_or_default();
            self.score_with(&scored, hindsight::at(&nodes, time_ns).as_ref());
        }
        if self.observer.interval_ns() < i64::MAX {
            for node in &nodes {
                self.observer.estimate(node);
            }
        }
    }

    fn reference_attitude(&mut self, time_ns: i64, reference: &Reference) {
        if reference.scored && reference.attitude.coords.iter().all(|x| x.is_finite()) {
            let ned_from_frd = self.ned_from_frd(&reference.attitude);
            self.score(Scored::Attitude(time_ns, ned_from_frd));
        }
    }

    /// An attitude of the recording as `ned_from_body` with a body of forward, right, down.
    fn ned_from_frd(&self, world_from_body: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
        match self.world {
            WorldFrame::Ned => *world_from_body,
            WorldFrame::Enu => {
                // The axes of the body one by one: forward, right, down of a phone are its y, x, -z.
                let axis = |v: Vector3<f64>| ned_from_enu(&(world_from_body * v));
                let columns = [Vector3::y(), Vector3::x(), -Vector3::z()].map(axis);
                from_matrix(&Matrix3::from_columns(&columns))
            }
        }
    }

    fn finish(self, name: &str) -> Result<NavigationSummary, EvaluationError> {
        let counts = self.counts;
        let Some(frame) = self.frame else {
            return Err(EvaluationError::NoFix {
                fixes: counts.fixes,
            });
        };
        let kind = self.options.estimator;
        if kind == NavigationKind::Device {
            if self.device_estimates == 0 {
                return Err(EvaluationError::NoDeviceNavigation);
            }
        } else if counts.inertial == 0 && kind != NavigationKind::DeadReckoning {
            return Err(EvaluationError::NoInertialSamples {
                estimator: self.options.estimator.name(),
            });
        }
        let first = counts.first_ns.unwrap_or(counts.last_ns);
        let position = self.scorer.position_score();
        let outages = self.scorer.outage_scores();
        let scored = position.is_some() || outages.iter().any(|o| o.horizontal_error_m.is_some());
        let against = if counts.scored_at_reference {
            "reference"
        } else {
            "withheld fixes"
        };
        let heading = self.scorer.heading_score();
        let mut issues = self.navigator.issues();
        if position.is_none() && self.scorer.too_early() > 0 {
            issues.push(format!(
                "{} points could be scored, all in the first {:.0} s after the first fix: --score-from 10 counts \
                 those after 10 s.",
                self.scorer.too_early(),
                self.options.score_from_s
            ));
        }
        let own = self.navigator.own_counts().into_iter();
        let own = own.map(|(kind, updates)| (kind, (updates, NisStatistics::default())));
        let summarized = |(updates, nis): (UpdateCounts, NisStatistics)| AidSummary {
            updates,
            nis: nis.summary(),
        };
        Ok(NavigationSummary {
            estimator: self.options.estimator,
            recording: name.to_owned(),
            smoothed: self.options.smooth,
            duration_s: seconds_between(first, counts.last_ns),
            inertial_samples: counts.inertial,
            fixes: counts.fixes,
            fixes_used: counts.used,
            fixes_unusable: counts.unusable,
            origin: Some(Origin::from(frame.origin())),
            scored_against: scored.then_some(against),
            position,
            velocity_rmse_mps: self.scorer.velocity_rmse(),
            heading_rmse_deg: heading.map(|h| h.rmse_deg),
            tilt_rmse_deg: self.scorer.tilt_rmse_deg(),
            heading,
            outages,
            aids: counts
                .aids
                .into_iter()
                .chain(own)
                .map(|(kind, aid)| (kind, summarized(aid)))
                .collect(),
            validity: counts.validity,
            issues,
        })
    }
}

/// Why a fix is not to be used.
fn unusable(fix: &GnssPosition) -> Option<&'static str> {
    if matches!(fix.quality, GnssQuality::Invalid) {
        Some("the receiver calls it invalid")
    } else if matches!(fix.quality, GnssQuality::Estimated) {
        Some("dead reckoning of the receiver")
    } else if !fix.is_usable() {
        Some("not a place on the Earth")
    } else if fix.satellites.is_some_and(|n| n < FEWEST_SATELLITES) {
        Some("fewer than 4 satellites")
    } else if fix.hdop.is_some_and(|hdop| hdop > LARGEST_HDOP) {
        Some("dilution of precision above 8")
    } else {
        None
    }
}

/// Standard deviations of a fix, m, north, east, down: the receiver's, or from its dilution.
fn position_std(fix: &GnssPosition) -> Vector3<f64> {
    if let Some(std) = fix.std_m {
        return Vector3::from(std);
    }
    let hdop = fix.hdop.unwrap_or(1.0).max(0.5);
    let across = RANGE_ERROR_M * hdop * std::f64::consts::FRAC_1_SQRT_2;
    Vector3::new(across, across, RANGE_ERROR_M * VERTICAL_DILUTION * hdop)
}
