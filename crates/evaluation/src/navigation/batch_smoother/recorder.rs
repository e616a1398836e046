//! What the batch smoother keeps of a run: inertial samples, measurements, and the filter's states as a first guess.

use nalgebra::Vector3;
use northing_core::earth::{FrameChange, LocalFrame};
use northing_core::navigation::error_state::robust_weight;
use northing_core::navigation::gnss_ins::{
    CONSTRAINT_INTERVAL_S, ErrorShares, GnssIns, GnssInsConfig, LONGEST_GAP_S,
};
use northing_core::navigation::{ATTITUDE, GnssPosition, GnssVelocity};

use super::state::State;
use super::{BatchSolution, solver};
use crate::navigation::navigator::no_frame;
use crate::statistics::seconds_between;

/// A batch goes so far, m: beyond, the plane is no longer level.
const FURTHEST_M: f64 = 1e5;
/// A state of the filter is kept so often, s.
const KEPT_EVERY_S: f64 = 0.1;
/// Windows in which standstill and damping are looked at, s.
const WINDOW_S: f64 = 0.5;

/// Which part of a position.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// North and east.
    Horizontal,
    /// Down.
    Vertical,
}

/// What was measured, in the terms of [`GnssIns`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Measured {
    /// A part of a position, and how its stated standard deviation divides.
    Position(GnssPosition<f64>, ErrorShares<f64>, Part),
    /// A velocity.
    Velocity(GnssVelocity<f64>),
    /// A true heading with its standard deviation, rad.
    Heading(f64, f64),
    /// A magnetic field, microtesla, body axes, and the declination, rad.
    MagneticField(Vector3<f64>, f64),
    /// A barometric height, m.
    Height(f64),
    /// A speed along the vehicle's forward axis with its standard deviation, m/s.
    Speed(f64, f64),
    /// A velocity that is zero.
    Rest,
    /// A mean angular rate that is a bias, rad/s, and its variance.
    RateAtRest(Vector3<f64>, f64),
    /// A vehicle on wheels, which moves neither sideways nor up.
    NonHolonomic,
    /// A velocity that is zero with this variance, (m/s)^2.
    Damping(f64),
}

impl Measured {
    /// The same in another local frame near by: a height only where its origin is, since that is level.
    fn moved(self, change: &FrameChange<f64>) -> Self {
        match self {
            Self::Position(mut fix, shares, part) => {
                fix.ned = change.position(&fix.ned);
                Self::Position(fix, shares, part)
            }
            Self::Velocity(mut fix) => {
                fix.ned = change.vector(&fix.ned);
                Self::Velocity(fix)
            }
            Self::Heading(heading, std) => Self::Heading(heading + change.heading(), std),
            Self::MagneticField(field, declination) => {
                Self::MagneticField(field, declination + change.heading())
            }
            // Where the origin of the one is, is so much below the plane of the other.
            Self::Height(height) => Self::Height(height - change.position(&Vector3::zeros()).z),
            other => other,
        }
    }
}

/// A measurement at the instant when it was valid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Measurement {
    pub(super) time_ns: i64,
    pub(super) measured: Measured,
    /// Weight that the filter gave it, 0 to 1.
    pub(super) weight: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ImuSample {
    pub(super) time_ns: i64,
    pub(super) rate: Vector3<f64>,
    pub(super) force: Vector3<f64>,
}

/// What the filter said and expected at an instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Causal {
    pub(super) time_ns: i64,
    /// Its state and the standard deviation of its heading, rad; `None` before the start.
    pub(super) state: Option<(State, f64)>,
    /// Noise densities of gyroscope and accelerometer.
    pub(super) noise_densities: [f64; 2],
    pub(super) realignments: u32,
}

/// What belongs together: no gap of more than 10 s, and no more than 100 km.
#[derive(Debug, Clone)]
pub(super) struct Segment {
    /// The local frame of all states and measurements.
    pub(super) frame: LocalFrame,
    pub(super) samples: Vec<ImuSample>,
    pub(super) measurements: Vec<Measurement>,
    pub(super) causal: Vec<Causal>,
}

/// Keeps what a GNSS/INS is given, for [`Self::smooth`].
#[derive(Debug, Clone)]
pub struct BatchRecorder {
    pub(super) segments: Vec<Segment>,
    /// The local frame of now, and how it is seen from that of the segment.
    frame: LocalFrame,
    to_segment: FrameChange<f64>,
    has_frame: bool,
    last_rest: Option<Vector3<f64>>,
    last_damping_ns: Option<i64>,
    last_constraint_ns: Option<i64>,
}

impl Default for BatchRecorder {
    fn default() -> Self {
        let frame = no_frame();
        Self {
            segments: Vec::new(),
            frame,
            to_segment: FrameChange::between(&frame, &frame),
            has_frame: false,
            last_rest: None,
            last_damping_ns: None,
            last_constraint_ns: None,
        }
    }
}

impl Segment {
    pub(super) fn new(frame: LocalFrame) -> Self {
        Self {
            frame,
            samples: Vec::new(),
            measurements: Vec::new(),
            causal: Vec::new(),
        }
    }
}

impl BatchRecorder {
    /// To be called when the local frame of the filter is another one: what follows is in it.
    pub fn frame(&mut self, frame: &LocalFrame) {
        if !core::mem::replace(&mut self.has_frame, true) {
            for segment in &mut self.segments {
                segment.frame = *frame;
            }
        }
        self.frame = *frame;
        let Some(segment) = self.segments.last() else {
            return;
        };
        self.to_segment = FrameChange::between(frame, &segment.frame);
        if self.to_segment.distance() > FURTHEST_M {
            let mut next = Segment::new(*frame);
            next.samples.extend(segment.samples.last().copied());
            self.segments.push(next);
            self.to_segment = FrameChange::between(frame, frame);
        }
    }

    /// To be called after each inertial sample that `ins` took.
    pub fn imu<const H: usize>(
        &mut self,
        time_ns: i64,
        angular_rate: &Vector3<f64>,
        specific_force: &Vector3<f64>,
        ins: &GnssIns<f64, H>,
    ) {
        let last = self.segments.last().and_then(|s| s.samples.last());
        let goes_on = last.is_some_and(|last| {
            let dt = seconds_between(last.time_ns, time_ns);
            dt > 0.0 && dt <= LONGEST_GAP_S
        });
        if !goes_on {
            self.segments.push(Segment::new(self.frame));
            self.to_segment = FrameChange::between(&self.frame, &self.frame);
            (self.last_damping_ns, self.last_constraint_ns) = (None, None);
        }
        let own = self.own_aids(time_ns, ins);
        let Some(segment) = self.segments.last_mut() else {
            return;
        };
        segment.samples.push(ImuSample {
            time_ns,
            rate: *angular_rate,
            force: *specific_force,
        });
        segment.measurements.extend(own.into_iter().flatten());
        segment.keep(time_ns, ins, &self.to_segment);
    }

    /// A measurement that `ins` took, stamped `time_ns`; `squared`: its squared normalised innovation and the degrees of freedom
    /// of that, where the filter knew.
    pub fn measurement(
        &mut self,
        time_ns: i64,
        measured: Measured,
        squared: Option<(f64, u8)>,
        config: &GnssInsConfig<f64>,
    ) {
        let latency = match measured {
            Measured::Position(..) => config.position_latency_s,
            Measured::Velocity(_) => config.velocity_latency_s,
            _ => 0.0,
        };
        let weight = squared.map_or(1.0, |(nis, degrees)| robust_weight(nis, degrees.into()));
        let measured = measured.moved(&self.to_segment);
        if let Some(segment) = self.segments.last_mut() {
            segment.measurements.push(Measurement {
                time_ns: time_ns.saturating_sub((latency * 1e9) as i64),
                measured,
                weight,
            });
        }
    }

    /// What the filter assumes by itself: that it stands, that it does not slide, that it is no rocket.
    fn own_aids<const H: usize>(
        &mut self,
        time_ns: i64,
        ins: &GnssIns<f64, H>,
    ) -> [Option<Measurement>; 4] {
        let due = |last: &mut Option<i64>, interval: f64| {
            let is_due = last.is_none_or(|last| seconds_between(last, time_ns) >= interval);
            *last = if is_due { Some(time_ns) } else { *last };
            is_due
        };
        let damping = due(&mut self.last_damping_ns, WINDOW_S);
        let damping = damping.then(|| ins.damping_variance(WINDOW_S)).flatten();
        let on_wheels =
            ins.config().non_holonomic && due(&mut self.last_constraint_ns, CONSTRAINT_INTERVAL_S);
        // A window stays until the next sample, or longer before the start.
        let rest = ins.rest_window();
        let rest = rest.filter(|(rate, _)| self.last_rest.replace(*rate) != Some(*rate));
        let made = [
            rest.map(|_| Measured::Rest),
            rest.map(|(rate, variance)| Measured::RateAtRest(rate, variance)),
            on_wheels.then_some(Measured::NonHolonomic),
            damping.map(Measured::Damping),
        ];
        made.map(|made| {
            made.map(|measured| Measurement {
                time_ns,
                measured,
                weight: 1.0,
            })
        })
    }

    /// Smooths what was kept, with the settings of the filter.
    #[must_use]
    pub fn smooth(&self, config: &GnssInsConfig<f64>) -> BatchSolution {
        solver::smooth(&self.segments, config)
    }
}

impl Segment {
    fn keep<const H: usize>(
        &mut self,
        time_ns: i64,
        ins: &GnssIns<f64, H>,
        to_segment: &FrameChange<f64>,
    ) {
        let realignments = ins.realignments();
        let last = self.causal.last();
        let is_due = last.is_none_or(|last| {
            let since = seconds_between(last.time_ns, time_ns);
            since >= KEPT_EVERY_S || last.realignments != realignments
        });
        if is_due {
            let side = &ins.augmented_states().values;
            let state = ins.state().map(|state| {
                let variance = state.covariance[(ATTITUDE + 2, ATTITUDE + 2)];
                let state = State::of_filter(state, side).moved(to_segment);
                (state, variance.max(0.0).sqrt())
            });
            self.causal.push(Causal {
                time_ns,
                state,
                noise_densities: ins.noise_densities(),
                realignments,
            });
        }
    }
}
