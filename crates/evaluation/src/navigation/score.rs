//! Position scores at held-out fixes, at a reference and in outages.
//!
//! Every score point is compared with the last estimate before it, moved on by its own velocity: causal
//! to the millisecond. Beside the estimator two answers that need no filter are scored at the same
//! points: holding the last fix, and moving on from it with its velocity.

use nalgebra::{Matrix2, UnitQuaternion, Vector2, Vector3};
use northing_core::earth::LocalFrame;
use northing_core::geometry::trigonometry::wrap;
use serde::Serialize;

use super::navigator::NavigationEstimate;
use super::options::Outage;
use crate::statistics::metrics::AttitudeError;
use crate::statistics::seconds_between;

/// 95 % of two degrees of freedom.
pub const CHI_SQUARE_95: f64 = 5.991_464_547;
/// 95 % of a normal distribution, standard deviations.
const NORMAL_95: f64 = 1.959_963_985;
/// A course is a heading above this speed, m/s ...
const COURSE_ABOVE: f64 = 3.0;
/// ... and where the vehicle turns slower than this, rad/s.
const STRAIGHT: f64 = 0.035;

/// A place to score at.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScorePoint {
    /// Time of validity, ns.
    pub time_ns: i64,
    /// The local frame.
    pub frame: LocalFrame,
    /// Where the antenna was, m, north, east, down.
    pub ned: Vector3<f64>,
    /// Standard deviation of that per horizontal axis, m.
    pub std: f64,
    /// Standard deviation of its height, m; `None` where no height is known.
    pub vertical_std: Option<f64>,
    /// The last fix that the estimator got before.
    pub last_fix: Option<LastFix>,
}

/// The last fix that an estimator got.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LastFix {
    /// Time of validity, ns.
    pub time_ns: i64,
    /// Position, m.
    pub ned: Vector3<f64>,
    /// Velocity, m/s.
    pub velocity: Vector3<f64>,
}

/// A running root mean square.
#[derive(Debug, Clone, Copy, Default)]
struct Rms {
    squares: f64,
    sum: f64,
    count: u64,
}

impl Rms {
    fn add(&mut self, value: f64) {
        if value.is_finite() {
            self.squares += value * value;
            self.sum += value;
            self.count += 1;
        }
    }

    fn value(&self) -> Option<f64> {
        (self.count > 0).then(|| (self.squares / self.count as f64).sqrt())
    }

    fn mean(&self) -> Option<f64> {
        (self.count > 0).then(|| self.sum / self.count as f64)
    }

    /// Root mean square about the mean.
    fn spread(&self) -> Option<f64> {
        let mean = self.mean()?;
        let about = self.squares / self.count as f64 - mean * mean;
        Some(about.max(0.0).sqrt())
    }
}

/// Scores of the position.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PositionScore {
    /// Root mean square of the horizontal distance, m.
    pub horizontal_rmse_m: f64,
    /// The same vertically, m; `None` where no height was known.
    pub vertical_rmse_m: Option<f64>,
    /// Points scored.
    pub scored_fixes: u64,
    /// Share of them inside the 95 % ellipse that the estimator stated, 0 to 1.
    pub inside_95: f64,
    /// Share of the heights inside the 95 % band that the estimator stated, 0 to 1; `None` where no height was known.
    pub vertical_inside_95: Option<f64>,
    /// Mean of the vertical error, m, down positive.
    pub vertical_mean_m: Option<f64>,
    /// Horizontal root mean square of the last fix held, m.
    pub hold_rmse_m: Option<f64>,
    /// Horizontal root mean square of the last fix moved on with its velocity, m.
    pub extrapolation_rmse_m: Option<f64>,
}

/// The end of an outage.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct OutageScore {
    /// Its start, s after the first fix.
    pub start_s: f64,
    /// How long it lasted, s.
    pub duration_s: f64,
    /// Horizontal error at the last point inside it, m; `None` without any.
    pub horizontal_error_m: Option<f64>,
    /// Standard deviation that the estimator stated there, root of the horizontal variances' sum, m.
    pub predicted_std_m: Option<f64>,
    /// Whether the error was inside the 95 % ellipse.
    pub inside_95: Option<bool>,
    /// Error of the last fix held, m.
    pub hold_error_m: Option<f64>,
    /// Error of the last fix moved on with its velocity, m.
    pub extrapolation_error_m: Option<f64>,
}

/// Scores of the heading.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct HeadingScore {
    /// Root mean square of the error, degrees; against a course with its mean removed: how the unit sits
    /// in the vehicle is not known.
    pub rmse_deg: f64,
    /// Mean of the error, degrees.
    pub mean_deg: f64,
    /// Instants scored.
    pub samples: u64,
    /// Whether against the course over ground on straight parts (or a reference attitude).
    pub against_course: bool,
}

/// Gathers scores.
#[derive(Debug, Clone, Default)]
pub(crate) struct Scorer {
    from_s: f64,
    first_fix_ns: Option<i64>,
    outages: Vec<(Outage, OutageScore)>,
    /// The vehicle has not had a fix since the last outage.
    recovering: bool,
    horizontal: Rms,
    vertical: Rms,
    hold: Rms,
    extrapolation: Rms,
    inside: u64,
    inside_vertically: u64,
    too_early: u64,
    velocity: Rms,
    heading: Rms,
    course: Rms,
    tilt: Rms,
}

impl Scorer {
    pub(crate) fn new(from_s: f64, outages: &[Outage]) -> Self {
        let blank = |outage: &Outage| {
            let score = OutageScore {
                start_s: outage.start_s,
                duration_s: outage.duration_s,
                ..OutageScore::default()
            };
            (*outage, score)
        };
        Self {
            from_s,
            outages: outages.iter().map(blank).collect(),
            ..Self::default()
        }
    }

    /// Seconds since the first fix; below zero before it.
    pub(crate) fn since_first_fix_s(&self, time_ns: i64) -> f64 {
        let first = self.first_fix_ns;
        first.map_or(f64::NEG_INFINITY, |first| seconds_between(first, time_ns))
    }

    /// A fix has come, whether used or not; the first one starts the clock.
    pub(crate) fn fix_came(&mut self, time_ns: i64) {
        self.first_fix_ns.get_or_insert(time_ns);
    }

    /// Whether the fixes of this time are kept from the estimator.
    pub(crate) fn in_outage(&self, time_ns: i64) -> bool {
        let since = self.since_first_fix_s(time_ns);
        self.outages.iter().any(|(outage, _)| outage.covers(since))
    }

    /// The estimator got a fix.
    pub(crate) fn fix_used(&mut self) {
        self.recovering = false;
    }

    /// Points that came before scores count.
    pub(crate) fn too_early(&self) -> u64 {
        self.too_early
    }

    fn counts(&self, time_ns: i64) -> bool {
        self.since_first_fix_s(time_ns) >= self.from_s
    }

    /// Scores a position; gives the error, estimate minus truth, m.
    pub(crate) fn position(
        &mut self,
        point: &ScorePoint,
        estimate: &NavigationEstimate,
    ) -> Vector3<f64> {
        let estimate = &estimate.in_frame(&point.frame);
        let ahead = seconds_between(estimate.time_ns, point.time_ns);
        let error = estimate.position_after(ahead) - point.ned;
        let horizontal = error.xy().norm();
        let inside = inside_95(&error.xy(), estimate, point.std);
        let simple = point.last_fix.map(|fix| without_filter(point, &fix));
        let since = self.since_first_fix_s(point.time_ns);
        for (outage, score) in &mut self.outages {
            if outage.covers(since) {
                self.recovering = true;
                score.horizontal_error_m = Some(horizontal);
                let variance = estimate.position_covariance.m11 + estimate.position_covariance.m22;
                score.predicted_std_m = Some(variance.max(0.0).sqrt());
                score.inside_95 = Some(inside);
                score.hold_error_m = simple.map(|[hold, _]| hold);
                score.extrapolation_error_m = simple.map(|[_, line]| line);
            }
        }
        if !self.counts(point.time_ns) {
            self.too_early += 1;
            return error;
        }
        if self.recovering {
            return error;
        }
        self.horizontal.add(horizontal);
        self.inside += u64::from(inside);
        if let Some(std) = point.vertical_std {
            let stated = estimate.position_covariance.m33.max(0.0).sqrt();
            let is_inside = error.z.abs() <= NORMAL_95 * stated.hypot(std);
            self.inside_vertically += u64::from(is_inside);
            self.vertical.add(error.z);
        }
        if let Some([hold, line]) = simple {
            self.hold.add(hold);
            self.extrapolation.add(line);
        }
        error
    }

    /// Scores a velocity (m/s). `vertical`: whether its third component is known.
    pub(crate) fn velocity(
        &mut self,
        time_ns: i64,
        ned: &Vector3<f64>,
        vertical: bool,
        estimate: &NavigationEstimate,
    ) {
        if self.recovering || !self.counts(time_ns) {
            return;
        }
        let mut error = estimate.velocity - ned;
        if !vertical {
            error.z = 0.0;
        }
        self.velocity.add(error.norm());
    }

    /// On straight parts (`turn_rate`, rad/s) the course over ground is what the heading is compared with.
    pub(crate) fn course(
        &mut self,
        time_ns: i64,
        ned: &Vector3<f64>,
        turn_rate: f64,
        estimate: &NavigationEstimate,
    ) {
        if self.recovering || !self.counts(time_ns) {
            return;
        }
        let straight = turn_rate < STRAIGHT && ned.xy().norm() > COURSE_ABOVE;
        if let Some(heading) = estimate.heading().filter(|_| straight) {
            let off = wrap(heading - ned.y.atan2(ned.x));
            // About the mean so far, so that a unit mounted backwards is not cut in two.
            let mean = self.course.mean().unwrap_or(off);
            self.course.add(mean + wrap(off - mean));
        }
    }

    /// Scores an attitude.
    pub(crate) fn attitude(
        &mut self,
        time_ns: i64,
        reference: &UnitQuaternion<f64>,
        estimate: &NavigationEstimate,
    ) {
        if self.recovering || !self.counts(time_ns) {
            return;
        }
        if let Some(attitude) = estimate.ned_from_body {
            let error = AttitudeError::between(&attitude, reference);
            self.heading.add(error.heading.to_degrees());
            self.tilt.add(error.inclination.to_degrees());
        }
    }

    pub(crate) fn position_score(&self) -> Option<PositionScore> {
        Some(PositionScore {
            horizontal_rmse_m: self.horizontal.value()?,
            vertical_rmse_m: self.vertical.value(),
            scored_fixes: self.horizontal.count,
            inside_95: self.inside as f64 / self.horizontal.count as f64,
            vertical_inside_95: (self.vertical.count > 0)
                .then(|| self.inside_vertically as f64 / self.vertical.count as f64),
            vertical_mean_m: self.vertical.mean(),
            hold_rmse_m: self.hold.value(),
            extrapolation_rmse_m: self.extrapolation.value(),
        })
    }

    pub(crate) fn velocity_rmse(&self) -> Option<f64> {
        self.velocity.value()
    }

    pub(crate) fn tilt_rmse_deg(&self) -> Option<f64> {
        self.tilt.value()
    }

    pub(crate) fn heading_score(&self) -> Option<HeadingScore> {
        let score = |rms: &Rms, against_course: bool, rmse_deg, scale: f64| {
            Some(HeadingScore {
                rmse_deg,
                // Differences of directions are unwrapped while they are added.
                mean_deg: wrap((rms.mean()? * scale).to_radians()).to_degrees(),
                samples: rms.count,
                against_course,
            })
        };
        match self.heading.value() {
            Some(rmse) => score(&self.heading, false, rmse, 1.0),
            None => {
                let spread = self.course.spread()?.to_degrees();
                score(&self.course, true, spread, 1f64.to_degrees())
            }
        }
    }

    pub(crate) fn outage_scores(&self) -> Vec<OutageScore> {
        self.outages.iter().map(|(_, score)| *score).collect()
    }
}

/// Horizontal errors (m) of holding the last fix and of moving on from it.
fn without_filter(point: &ScorePoint, fix: &LastFix) -> [f64; 2] {
    let since = seconds_between(fix.time_ns, point.time_ns);
    let line = fix.ned + fix.velocity * since;
    [fix.ned, line].map(|place| (place - point.ned).xy().norm())
}

/// Whether a horizontal error is inside the 95 % ellipse of the estimate and of the point together.
fn inside_95(error: &Vector2<f64>, estimate: &NavigationEstimate, std: f64) -> bool {
    let stated = estimate.position_covariance.fixed_view::<2, 2>(0, 0);
    let covariance = stated + Matrix2::identity() * (std * std);
    covariance
        .try_inverse()
        .is_some_and(|inverse| error.dot(&(inverse * error)) <= CHI_SQUARE_95)
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix3;
    use northing_core::navigation::Validity;

    use super::*;

    fn estimate(time_s: f64, x: f64) -> NavigationEstimate {
        NavigationEstimate {
            time_ns: (time_s * 1e9) as i64,
            frame: crate::navigation::navigator::no_frame(),
            ned_from_body: Some(UnitQuaternion::from_euler_angles(0.0, 0.0, 0.3)),
            attitude_covariance: None,
            velocity_covariance: None,
            heading_std: None,
            position: Vector3::new(x, 0.0, 0.0),
            position_covariance: Matrix3::identity(),
            velocity: Vector3::new(10.0, 0.0, 0.0),
            validity: Validity::Aided,
        }
    }

    fn point(time_s: f64, x: f64) -> ScorePoint {
        ScorePoint {
            time_ns: (time_s * 1e9) as i64,
            frame: crate::navigation::navigator::no_frame(),
            ned: Vector3::new(x, 0.0, 0.5),
            std: 0.0,
            vertical_std: Some(0.0),
            last_fix: Some(LastFix {
                time_ns: 0,
                ned: Vector3::zeros(),
                velocity: Vector3::new(9.0, 0.0, 0.0),
            }),
        }
    }

    #[test]
    fn the_estimate_is_moved_on_to_the_point_and_the_simple_answers_stand_beside() {
        let mut scorer = Scorer::new(1.0, &[]);
        scorer.fix_came(0);
        scorer.position(&point(0.5, 99.0), &estimate(0.5, 0.0));
        scorer.position(&point(2.0, 21.0), &estimate(1.9, 19.0));
        let score = scorer.position_score().unwrap();
        assert_eq!(score.scored_fixes, 1, "the first is before the start");
        approx::assert_relative_eq!(score.horizontal_rmse_m, 1.0, epsilon = 1e-9);
        approx::assert_relative_eq!(score.vertical_rmse_m.unwrap(), 0.5);
        approx::assert_relative_eq!(score.hold_rmse_m.unwrap(), 21.0);
        approx::assert_relative_eq!(score.extrapolation_rmse_m.unwrap(), 3.0);
        approx::assert_relative_eq!(score.inside_95, 1.0);
    }

    #[test]
    fn an_outage_is_scored_at_its_end_and_apart_from_the_rest() {
        let outage = Outage {
            start_s: 10.0,
            duration_s: 5.0,
        };
        let mut scorer = Scorer::new(0.0, &[outage]);
        scorer.fix_came(0);
        assert!(scorer.in_outage(12_000_000_000) && !scorer.in_outage(15_000_000_000));
        for (time_s, off) in [(9.0, 1.0), (11.0, 50.0), (14.0, 7.0), (15.2, 70.0)] {
            let x = time_s * 10.0;
            scorer.position(&point(time_s, x + off), &estimate(time_s, x));
        }
        scorer.fix_used();
        scorer.position(&point(17.0, 171.0), &estimate(17.0, 170.0));
        let score = scorer.position_score().unwrap();
        assert_eq!(score.scored_fixes, 2);
        approx::assert_relative_eq!(score.horizontal_rmse_m, 1.0, epsilon = 1e-9);
        let [outage] = scorer.outage_scores()[..] else {
            panic!("one outage");
        };
        approx::assert_relative_eq!(outage.horizontal_error_m.unwrap(), 7.0, epsilon = 1e-9);
        approx::assert_relative_eq!(outage.predicted_std_m.unwrap(), 2f64.sqrt());
        assert_eq!(outage.inside_95, Some(false));
    }

    #[test]
    fn the_mount_does_not_count_against_a_course_and_curves_are_left_out() {
        let mut scorer = Scorer::new(0.0, &[]);
        scorer.fix_came(0);
        for degrees in [1.0_f64, -1.0, 1.0, -1.0] {
            let course = 0.2 + degrees.to_radians();
            let velocity = Vector3::new(course.cos(), course.sin(), 0.0) * 10.0;
            scorer.course(1, &velocity, 0.0, &estimate(0.0, 0.0));
        }
        let across = Vector3::new(0.0, 10.0, 0.0);
        scorer.course(1, &across, 0.5, &estimate(0.0, 0.0));
        let score = scorer.heading_score().unwrap();
        assert_eq!((score.samples, score.against_course), (4, true));
        approx::assert_relative_eq!(score.rmse_deg, 1.0, epsilon = 1e-6);
        approx::assert_relative_eq!(score.mean_deg, 0.1f64.to_degrees(), epsilon = 1e-6);
    }
}
