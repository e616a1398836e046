//! Return-to-start test of the paper: the device is back in its first pose; is the estimate too?
//!
//! Read first: Utrera & Vazquez (2021), section 4. The *calculated* error is the angle of
//! `q_e = q_start^-1 q_end` (M26), which would be zero; the *estimated* error is what the filter's
//! covariance says, `sqrt(tr P)` (M26b). `q_start` is the estimate just before the motion, when the
//! filter had settled, and its covariance counts as well: with the local error `a = log(q_e)` the
//! square `a^T (P + P_start)^-1 a` lies between 0.22 and 9.35 in 95 % of all cases when the filter
//! is consistent (M26c).
//!
//! The test applies when the device rested in the same pose for a second at both ends. Whether it
//! did is read from the sensors, not from the estimate.

use std::collections::VecDeque;

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use northing_core::attitude::wahba;
use northing_core::geometry::{rotation, so3};
use northing_core::kalman::covariance::normalized_square;
use serde::Serialize;

use crate::attitude::Instant;

/// 95 % of chi-square with 3 degrees of freedom lie between these.
const BOUNDS: [f64; 2] = [0.22, 9.35];
/// Length of a rest, ns.
const WINDOW_NS: i64 = 1_000_000_000;
/// Largest deviation of a rate from its mean at rest, rad/s.
const STILL_RAD_S: f64 = 0.1;
/// Largest change of a second's mean rate at rest, rad/s: more is a slow turn.
const TURNING_RAD_S: f64 = 0.02;
/// Largest mean rate that can still be a gyroscope bias, rad/s (11 deg/s).
const LARGEST_BIAS_RAD_S: f64 = 0.2;
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
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
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
    /// `sqrt(tr P)` at the end, deg; null for estimators without covariance.
    pub estimated_error_deg: Option<f64>,
    /// The estimated error as a quaternion: a turn by one standard deviation about each axis, whose
    /// angle is [`Self::estimated_error_deg`]; the signs of its axes are not known. w, x, y, z.
    pub estimated_error_wxyz: Option<[f64; 4]>,
    /// Square roots of the diagonal of `P`, deg, body axes.
    pub estimated_std_deg: Option<[f64; 3]>,
    /// `a^T P^-1 a`: between 0.22 and 9.35 in 95 % of all cases when consistent.
    pub normalised_square: Option<f64>,
    /// The verdict; null for estimators without covariance.
    pub verdict: Option<FinalVerdict>,
    /// The verdict in words.
    pub sentence: String,
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

    /// The outcome; `None` where the device did not rest in the same pose at both ends.
    #[must_use]
    pub fn summary(&self) -> Option<FinalSummary> {
        let (start, end) = (self.start.as_ref()?, self.window.pose());
        let (first, last) = (self.first_estimate?, self.last_estimate?);
        same_pose(start, &end).then(|| compare(&first, &last))?
    }
}

fn compare(
    (first, first_covariance): &Estimate,
    (last, covariance): &Estimate,
) -> Option<FinalSummary> {
    let covariance = *covariance;
    let a = so3::log(&(last.inverse() * first));
    // The reference pose is itself only known as well as the estimate before the motion. Both are
    // in the same pose, hence in the same body axes.
    let both = covariance.map(|p| p + first_covariance.unwrap_or_default());
    let square = both
        .and_then(|p| normalized_square(&a, &p))
        .filter(|s| s.is_finite());
    let verdict = square.map(|s| match s {
        s if s < BOUNDS[0] => FinalVerdict::Conservative,
        s if s > BOUNDS[1] => FinalVerdict::Overconfident,
        _ => FinalVerdict::Consistent,
    });
    let calculated_error_deg = a.norm().to_degrees();
    let deg = |p: Matrix3<f64>| p.trace().max(0.0).sqrt().to_degrees();
    let estimated_error_deg = covariance.map(deg);
    let std = covariance.map(|p| p.diagonal().map(|v| v.max(0.0).sqrt()));
    calculated_error_deg.is_finite().then(|| FinalSummary {
        calculated_error_deg,
        calculated_error_wxyz: rotation::to_wxyz(&(first.inverse() * last)),
        estimated_error_deg,
        estimated_error_wxyz: std.map(|std| rotation::to_wxyz(&so3::exp(&std))),
        estimated_std_deg: std.map(|std| std.map(f64::to_degrees).into()),
        normalised_square: square,
        verdict,
        sentence: sentence(calculated_error_deg, both.map(deg), verdict),
    })
}

/// `predicted` is the standard deviation, deg, that the verdict was made with.
fn sentence(calculated: f64, predicted: Option<f64>, verdict: Option<FinalVerdict>) -> String {
    let word = verdict.map_or("", FinalVerdict::name);
    let judged = match predicted.filter(|_| verdict.is_some()) {
        Some(predicted) => format!("predicted {predicted:.2} deg: {word}."),
        None => "no prediction: this estimator has no covariance.".to_owned(),
    };
    let judged = format!("Back in the first pose: error {calculated:.2} deg, {judged}");
    if calculated > HAND_NOTE_DEG {
        return judged;
    }
    format!(
        "{judged} Repositioning by hand is repeatable to about 0.5 to 1 deg; an error of that size is \
         no evidence against the filter."
    )
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
    start.still && end.still && level && same_reference && same_field
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
    now_ns: i64,
}

impl Window {
    fn add(&mut self, instant: &Instant, field: Option<Vector3<f64>>) {
        self.now_ns = instant.time_ns;
        push(&mut self.rates, instant.time_ns, instant.angular_rate);
        push(&mut self.forces, instant.time_ns, instant.specific_force);
        push(&mut self.fields, instant.time_ns, field);
        if let Some(reference) = instant.reference {
            self.reference = Some((instant.time_ns, reference.attitude));
        }
    }

    fn pose(&self) -> Pose {
        let since = self.now_ns.saturating_sub(WINDOW_NS);
        let rate = mean(&self.rates, since);
        Pose {
            still: rate.is_some_and(|rate| self.is_still(&rate)),
            rate: rate.unwrap_or_default(),
            force: mean(&self.forces, since),
            field: mean(&self.fields, since),
            reference: self.reference.filter(|(t, _)| *t >= since).map(|(_, q)| q),
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
mod tests {
    use super::*;

    fn instant(k: i64, rate: f64, attitude: &UnitQuaternion<f64>) -> Instant {
        Instant {
            time_ns: k * 10_000_000,
            angular_rate: Some(Vector3::new(rate, 0.02, 0.0)),
            specific_force: Some(attitude.inverse() * Vector3::new(0.0, 0.0, 9.81)),
            magnetic_field: Some(attitude.inverse() * Vector3::new(0.0, 22.0, -42.0)),
            ..Instant::default()
        }
    }

    /// Rest, motion, rest; the sensors see `end` in the last rest, where the rate is `end_rate`.
    fn test_after(end: &UnitQuaternion<f64>, end_rate: impl Fn(i64) -> f64) -> FinalTest {
        let mut test = FinalTest::default();
        let start = UnitQuaternion::identity();
        for k in 0..1000 {
            let rested = instant(k, 0.01, &start);
            let now = match k {
                0..200 => rested,
                200..800 => instant(k, (k as f64 * 0.1).sin(), &so3::exp(&Vector3::x())),
                _ => instant(k, end_rate(k), end),
            };
            test.measured(&now, now.magnetic_field);
        }
        test.estimated(&start, None);
        test
    }

    fn verdict(error_rad: f64, std_rad: f64) -> FinalSummary {
        let mut test = test_after(&UnitQuaternion::identity(), |_| 0.01);
        let last = so3::exp(&Vector3::new(0.0, error_rad, 0.0));
        test.estimated(&last, Some(Matrix3::identity() * std_rad * std_rad));
        test.summary().unwrap()
    }

    #[test]
    fn the_verdict_follows_the_bounds_of_chi_square() {
        let consistent = verdict(0.01, 0.01);
        assert_eq!(consistent.verdict, Some(FinalVerdict::Consistent));
        approx::assert_relative_eq!(
            consistent.calculated_error_deg,
            0.01_f64.to_degrees(),
            epsilon = 1e-9
        );
        let expected = (3.0_f64.sqrt() * 0.01).to_degrees();
        approx::assert_relative_eq!(
            consistent.estimated_error_deg.unwrap(),
            expected,
            epsilon = 1e-9
        );
        approx::assert_relative_eq!(consistent.normalised_square.unwrap(), 1.0, epsilon = 1e-9);
        assert!(
            consistent
                .sentence
                .contains("Repositioning by hand is repeatable to about 0.5 to 1 deg")
        );
        assert_eq!(
            verdict(0.04, 0.01).verdict,
            Some(FinalVerdict::Overconfident)
        );
        assert_eq!(
            verdict(0.004, 0.01).verdict,
            Some(FinalVerdict::Conservative)
        );
    }

    /// Both quaternions turn by the angles beside them, the calculated one about the axis of the error.
    #[test]
    fn the_error_quaternions_turn_by_the_errors() {
        let summary = verdict(0.02, 0.01);
        let angle = |q: [f64; 4]| rotation::from_wxyz(q).unwrap().angle().to_degrees();
        let calculated = summary.calculated_error_wxyz;
        approx::assert_relative_eq!(
            angle(calculated),
            summary.calculated_error_deg,
            epsilon = 1e-9
        );
        approx::assert_relative_eq!(calculated[2], 0.01_f64.sin(), epsilon = 1e-12);
        let estimated = summary.estimated_error_wxyz.unwrap();
        approx::assert_relative_eq!(
            angle(estimated),
            summary.estimated_error_deg.unwrap(),
            epsilon = 1e-9
        );
        approx::assert_relative_eq!(estimated[1], estimated[3], epsilon = 1e-12);
    }

    #[test]
    fn without_covariance_there_is_an_error_and_no_verdict() {
        let mut test = test_after(&UnitQuaternion::identity(), |_| 0.01);
        test.estimated(&so3::exp(&Vector3::new(0.1, 0.0, 0.0)), None);
        let summary = test.summary().unwrap();
        assert_eq!((summary.verdict, summary.estimated_error_deg), (None, None));
        assert!(
            summary
                .sentence
                .contains("this estimator has no covariance")
        );
    }

    #[test]
    fn it_applies_only_to_a_device_that_rests_where_it_rested() {
        let here = UnitQuaternion::identity();
        assert!(test_after(&here, |_| 0.01).summary().is_some());
        let tilted = so3::exp(&Vector3::new(0.1, 0.0, 0.0));
        assert_eq!(
            test_after(&tilted, |_| 0.01).summary(),
            None,
            "tilted by 6 deg"
        );
        let turned = so3::exp(&Vector3::new(0.0, 0.0, 0.5));
        assert_eq!(
            test_after(&turned, |_| 0.01).summary(),
            None,
            "turned by 29 deg"
        );
        let shaking = |k: i64| if k % 2 == 0 { 0.3 } else { -0.3 };
        assert_eq!(test_after(&here, shaking).summary(), None, "shaken");
        assert_eq!(
            test_after(&here, |_| 0.5).summary(),
            None,
            "turning steadily"
        );
    }

    #[test]
    fn a_reference_that_ends_elsewhere_overrules_the_sensors() {
        let mut test = FinalTest::default();
        for k in 0..400_i64 {
            let mut now = instant(k, 0.0, &UnitQuaternion::identity());
            let attitude = so3::exp(&Vector3::new(0.0, 0.0, if k < 200 { 0.0 } else { 0.1 }));
            now.reference = Some(northing_recording::Reference {
                attitude,
                scored: true,
            });
            test.measured(&now, None);
        }
        test.estimated(&UnitQuaternion::identity(), None);
        assert_eq!(test.summary(), None);
    }
}
