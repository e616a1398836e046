//! Return-to-start test of the paper: the device is back in its first pose; is the estimate too?
//!
//! Read first: Utrera & Vazquez (2021), section 4. The *calculated* error is the angle of
//! `q_e = q_start^-1 q_end` (M26), which would be zero. `q_start` is the estimate just before the motion, when the
//! filter had settled, and it is itself only known as well as `P_start` says, so what judges is `P = P_start + P_end`: the
//! *estimated* error is `sqrt(tr P)` (M26b), and with the local error `a = log(q_e)` the square `a^T P^-1 a` lies between
//! 0.22 and 9.35 in 95 % of all cases when the filter is consistent (M26c).
//!
//! Where nothing said where north is, the heading drifts by a bias that is not observable, and its covariance counts
//! from an arbitrary start: then the tilt alone is judged, with two degrees of freedom (0.051 to 7.38), and the heading's part
//! of the error is stated beside it.
//!
//! The test applies when the device rested in the same pose for a second at both ends. Whether it
//! did is read from the sensors, not from the estimate. What a satellite receiver saw travelling comes back to the same heading
//! only where a field or a reference says so.

use std::collections::VecDeque;

use nalgebra::{Matrix3, Rotation2, UnitQuaternion, Vector3};
use northing_core::attitude::wahba;
use northing_core::geometry::{rotation, so3};
use northing_core::kalman::covariance::normalized_square;
use serde::{Deserialize, Serialize};

use crate::attitude::Instant;
use crate::statistics::attitude_std::{AttitudeStd, tilt_covariance};
use crate::statistics::ground_motion::GroundMotion;
use crate::statistics::metrics::{AttitudeError, attitude_nees, tilt_error};

/// 95 % of chi-square with 3 degrees of freedom lie between these, ...
const BOUNDS: [f64; 2] = [0.22, 9.35];
/// ... and these of chi-square with 2.
const TILT_BOUNDS: [f64; 2] = [0.051, 7.38];
/// Length of a rest, ns.
const WINDOW_NS: i64 = 1_000_000_000;
/// Largest deviation of a rate from its mean at rest, rad/s.
const STILL_RAD_S: f64 = 0.1;
/// Largest change of a second's mean rate at rest, rad/s: more is a slow turn.
const TURNING_RAD_S: f64 = 0.02;
/// Largest mean rate that can still be a gyroscope bias, rad/s (23 deg/s): of the common ones the worst is sold with up to 20 deg/s.
const LARGEST_BIAS_RAD_S: f64 = 0.4;
/// Largest angle between the directions of gravity, and of the references, of the same pose, deg.
const SAME_POSE_DEG: f64 = 3.0;
/// Largest turn that the magnetic field may show between the two rests, deg: fields change indoors.
const SAME_HEADING_DEG: f64 = 10.0;
/// Above this error, deg, the hand is no excuse and is not mentioned.
const HAND_NOTE_DEG: f64 = 3.0;
/// A window never holds more samples than this, however many share a second.
const MOST_SAMPLES: usize = 5000;

crate::named! {
    /// Whether the covariance at the end fits the error at the end.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
    #[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
    #[serde(rename_all = "kebab-case")]
    pub enum FinalVerdict {
        /// The error is as large as the filter says.
        Consistent = "consistent",
        /// The error is larger than the filter says.
        Overconfident = "overconfident",
        /// The error is smaller than the filter says.
        Conservative = "conservative",
    }
}

/// The outcome of the final test: `final` in a summary.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct FinalSummary {
    /// Angle between the estimates at the first and at the last instant, deg.
    pub calculated_error_deg: f64,
    /// The calculated error quaternion `q_start^-1 q_end`: w, x, y, z with w >= 0.
    pub calculated_error_wxyz: [f64; 4],
    /// Its part about a horizontal axis, deg.
    pub calculated_tilt_deg: f64,
    /// Its part about the vertical, deg, signed.
    pub calculated_heading_deg: f64,
    /// `sqrt(tr P)`, deg, of `P = P_start + P_end`, which the verdict is made with; null for estimators without
    /// covariance.
    pub estimated_error_deg: Option<f64>,
    /// The estimated error as a quaternion: a turn by one standard deviation about each axis, whose
    /// angle is [`Self::estimated_error_deg`]; the signs of its axes are not known. w, x, y, z.
    pub estimated_error_wxyz: Option<[f64; 4]>,
    /// Square roots of the diagonal of `P`, deg, body axes.
    pub estimated_std_deg: Option<[f64; 3]>,
    /// The part of the estimated error about horizontal axes, deg.
    pub estimated_tilt_deg: Option<f64>,
    /// How many components are judged: 3, or 2 (tilt alone) where the heading is arbitrary.
    pub degrees_of_freedom: u8,
    /// `a^T P^-1 a` over the components that are judged: when consistent between 0.22 and 9.35 in 95 % of all cases,
    /// for the tilt alone between 0.051 and 7.38.
    pub normalised_square: Option<f64>,
    /// The verdict; null for estimators without covariance.
    pub verdict: Option<FinalVerdict>,
    /// The verdict in words.
    pub sentence: String,
}

impl FinalSummary {
    /// The error that is judged, deg, and its predicted standard deviation: of the attitude, or of the tilt alone.
    #[must_use]
    pub fn judged_deg(&self) -> (f64, Option<f64>) {
        match self.degrees_of_freedom {
            2 => (self.calculated_tilt_deg, self.estimated_tilt_deg),
            _ => (self.calculated_error_deg, self.estimated_error_deg),
        }
    }
}

/// Attitude and its covariance.
type Estimate = (UnitQuaternion<f64>, Option<Matrix3<f64>>);

/// Watches the sensors and the estimates, and tests at the end.
#[derive(Debug, Clone, Default)]
pub struct FinalTest {
    start: Option<Pose>,
    window: Window,
    first_ns: Option<i64>,
    /// Whether the device has left the rest it began in.
    moved: bool,
    /// The newest estimate of the rest at the start: the reference pose, as well as it was known
    /// before the motion.
    first_estimate: Option<Estimate>,
    /// An estimate that becomes the reference pose if the device rests for a second more.
    candidate: Option<(i64, Estimate)>,
    last_estimate: Option<Estimate>,
}

impl FinalTest {
    /// Takes what was measured at one instant; `field` is of the magnetometer in use.
    pub fn measured(&mut self, instant: &Instant, field: Option<Vector3<f64>>) {
        let first_ns = *self.first_ns.get_or_insert(instant.time_ns);
        if self.start.is_none() && instant.time_ns.saturating_sub(first_ns) >= WINDOW_NS {
            self.start = Some(self.window.pose());
        }
        self.window.add(instant, field);
    }

    /// Takes the estimate at one instant.
    pub fn estimated(&mut self, attitude: &UnitQuaternion<f64>, covariance: Option<Matrix3<f64>>) {
        let now = (*attitude, covariance);
        self.first_estimate.get_or_insert(now);
        self.last_estimate = Some(now);
        if !self.moved {
            self.follow_the_rest(now);
        }
    }

    /// Takes an estimate of the rest at the start as the reference pose once the second after it
    /// has shown that the device still rested.
    fn follow_the_rest(&mut self, now: Estimate) {
        let time_ns = self.window.now_ns;
        let Some((since_ns, candidate)) = self.candidate else {
            self.candidate = Some((time_ns, now));
            return;
        };
        if time_ns.saturating_sub(since_ns) < WINDOW_NS {
            return;
        }
        let (pose, start) = (self.window.pose(), self.start.as_ref());
        let rests = start.is_none_or(|s| s.still && (pose.rate - s.rate).amax() < TURNING_RAD_S);
        self.moved = !(pose.still && rests);
        if !self.moved {
            self.first_estimate = Some(candidate);
            self.candidate = Some((time_ns, now));
        }
    }

    /// The outcome; `None` where the device did not rest in the same pose at both ends. Where the heading is not known,
    /// the tilt alone is judged.
    #[must_use]
    pub fn summary(&self, heading_known: bool) -> Option<FinalSummary> {
        let (start, end) = (self.start.as_ref()?, self.window.pose());
        let (first, last) = (self.first_estimate?, self.last_estimate?);
        same_pose(start, &end).then(|| compare(&first, &last, heading_known))?
    }
}

fn compare(
    (first, first_covariance): &Estimate,
    (last, covariance): &Estimate,
    heading_known: bool,
) -> Option<FinalSummary> {
    let error = AttitudeError::between(last, first);
    let first_covariance = first_covariance.unwrap_or_default();
    // Both are in the same pose, hence in the same body axes.
    let both = covariance.map(|p| p + first_covariance);
    // An arbitrary heading may have any variance: each is turned by its own attitude, so that nothing of it gets into
    // the tilt, and the first by the drift of the heading between them.
    let drift = Rotation2::new(error.heading).into_inner();
    let tilt_at_first = drift * tilt_covariance(first, &first_covariance) * drift.transpose();
    let tilt = covariance.map(|p| tilt_covariance(last, &p) + tilt_at_first);
    let square = match heading_known {
        true => both.and_then(|p| attitude_nees(last, &p, first)),
        false => tilt.and_then(|p| normalized_square(&tilt_error(last, first), &p)),
    };
    let square = square.filter(|s| s.is_finite());
    let [low, high] = if heading_known { BOUNDS } else { TILT_BOUNDS };
    let verdict = square.map(|s| match s {
        s if s < low => FinalVerdict::Conservative,
        s if s > high => FinalVerdict::Overconfident,
        _ => FinalVerdict::Consistent,
    });
    let std = both.map(|p| AttitudeStd::of(last, &p));
    let axes = std.map(|std| Vector3::from(std.body));
    let mut summary = FinalSummary {
        calculated_error_deg: error.total.to_degrees(),
        calculated_error_wxyz: rotation::to_wxyz(&(first.inverse() * last)),
        calculated_tilt_deg: error.inclination.to_degrees(),
        calculated_heading_deg: error.heading.to_degrees(),
        estimated_error_deg: std.map(|std| std.total.to_degrees()),
        estimated_error_wxyz: axes.map(|std| rotation::to_wxyz(&so3::exp(&std))),
        estimated_std_deg: axes.map(|std| std.map(f64::to_degrees).into()),
        estimated_tilt_deg: tilt.map(|p| p.trace().max(0.0).sqrt().to_degrees()),
        degrees_of_freedom: if heading_known { 3 } else { 2 },
        normalised_square: square,
        verdict,
        sentence: String::new(),
    };
    summary.sentence = sentence(&summary);
    error.is_finite().then_some(summary)
}

fn sentence(summary: &FinalSummary) -> String {
    let (error, predicted) = summary.judged_deg();
    let prediction = match (predicted, summary.verdict) {
        (Some(predicted), Some(verdict)) => {
            format!("predicted {predicted:.2} deg: {}.", verdict.name())
        }
        _ => "no prediction: this estimator has no covariance.".to_owned(),
    };
    let mut text = match summary.degrees_of_freedom {
        2 => format!(
            "Back in the first pose: tilt error {error:.2} deg, {prediction} The heading drifted by {:.2} deg, which is \
             not judged: nothing said where north is.",
            summary.calculated_heading_deg
        ),
        _ => format!("Back in the first pose: error {error:.2} deg, {prediction}"),
    };
    if error <= HAND_NOTE_DEG {
        text.push_str(
            " Repositioning by hand is repeatable to about 0.5 to 1 deg; an error of that size is \
             no evidence against the filter.",
        );
    }
    text
}

/// What the sensors said in one second.
#[derive(Debug, Clone, Default)]
struct Pose {
    still: bool,
    /// Mean rate, rad/s: the gyroscope's bias if it was still.
    rate: Vector3<f64>,
    force: Option<Vector3<f64>>,
    field: Option<Vector3<f64>>,
    reference: Option<UnitQuaternion<f64>>,
    /// Whether it has travelled before, as a satellite receiver says.
    travelled: bool,
}

fn same_pose(start: &Pose, end: &Pose) -> bool {
    let (Some(f0), Some(f1)) = (start.force, end.force) else {
        return false;
    };
    let level = f0.angle(&f1).to_degrees() < SAME_POSE_DEG;
    let same_reference = match (start.reference, end.reference) {
        (Some(q0), Some(q1)) => q0.angle_to(&q1).to_degrees() < SAME_POSE_DEG,
        _ => true,
    };
    let same_field = match (start.field, end.field) {
        (Some(m0), Some(m1)) => turn_deg([&f0, &m0], [&f1, &m1]) < SAME_HEADING_DEG,
        _ => true,
    };
    let shows_heading = end.field.is_some() || end.reference.is_some();
    let may_be_back = shows_heading || !end.travelled;
    start.still && end.still && level && same_reference && same_field && may_be_back
}

/// How far gravity and field say that the body turned, deg; zero where they are parallel.
fn turn_deg([f0, m0]: [&Vector3<f64>; 2], [f1, m1]: [&Vector3<f64>; 2]) -> f64 {
    wahba::triad(f0, m0, f1, m1).map_or(0.0, |turn| turn.angle().to_degrees())
}

/// The samples of the last second.
#[derive(Debug, Clone, Default)]
struct Window {
    rates: VecDeque<(i64, Vector3<f64>)>,
    forces: VecDeque<(i64, Vector3<f64>)>,
    fields: VecDeque<(i64, Vector3<f64>)>,
    reference: Option<(i64, UnitQuaternion<f64>)>,
    motion: GroundMotion,
    travelled: bool,
    now_ns: i64,
}

impl Window {
    fn add(&mut self, instant: &Instant, field: Option<Vector3<f64>>) {
        self.now_ns = instant.time_ns;
        push(&mut self.rates, instant.time_ns, instant.angular_rate);
        push(&mut self.forces, instant.time_ns, instant.specific_force);
        push(&mut self.fields, instant.time_ns, field);
        if let Some(fix) = &instant.fix {
            self.motion.position(instant.time_ns, fix);
        }
        if let Some(velocity) = &instant.ground_velocity {
            self.motion.velocity(instant.time_ns, velocity);
        }
        self.travelled |= self.motion.is_moving(instant.time_ns);
        if let Some(reference) = instant.reference {
            self.reference = Some((instant.time_ns, reference.attitude));
        }
    }

    fn pose(&self) -> Pose {
        let since = self.now_ns.saturating_sub(WINDOW_NS);
        let rate = mean(&self.rates, since);
        Pose {
            still: rate.is_some_and(|rate| self.is_still(&rate))
                && !self.motion.is_moving(self.now_ns),
            rate: rate.unwrap_or_default(),
            force: mean(&self.forces, since),
            field: mean(&self.fields, since),
            reference: self.reference.filter(|(t, _)| *t >= since).map(|(_, q)| q),
            travelled: self.travelled,
        }
    }

    fn is_still(&self, mean: &Vector3<f64>) -> bool {
        let steady = self
            .rates
            .iter()
            .all(|(_, rate)| (rate - mean).amax() < STILL_RAD_S);
        steady && mean.norm() < LARGEST_BIAS_RAD_S && self.rates.len() >= 10
    }
}

fn push(samples: &mut VecDeque<(i64, Vector3<f64>)>, now: i64, sample: Option<Vector3<f64>>) {
    if let Some(sample) = sample.filter(|v| v.norm_squared().is_finite()) {
        samples.push_back((now, sample));
    }
    let old = |t: i64| now.saturating_sub(t) > WINDOW_NS;
    while samples.len() > MOST_SAMPLES || samples.front().is_some_and(|(t, _)| old(*t)) {
        samples.pop_front();
    }
}

fn mean(samples: &VecDeque<(i64, Vector3<f64>)>, since: i64) -> Option<Vector3<f64>> {
    let recent = || samples.iter().filter(|(t, _)| *t >= since);
    let count = recent().count();
    (count > 0).then(|| recent().map(|(_, v)| v).sum::<Vector3<f64>>() / count as f64)
}

#[cfg(test)]
mod tests;
