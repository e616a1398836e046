//! How an estimator is judged in one world: errors of tilt and heading, coverage of what it states, cause it names.

use nalgebra::{Matrix2, Matrix3, UnitQuaternion, Vector2, Vector3};
use northing_evaluation::statistics::metrics::AttitudeError;
use northing_simulation::attitude_world::AttitudeWorldDescription;
use serde::Serialize;

use super::cause::Cause;
use super::consistent::quantile_95;
use super::run::{EstimatorRun, WorldRun};
use super::{Sensing, baseline};
use crate::scoring::{self, EVERY_S};

/// An error beyond so many standard deviations is no chance.
const FAR: f64 = 5.0;
/// A heading with a larger standard deviation than this is stated to be unknown, rad.
const UNKNOWN_RAD: f64 = 1.0;

/// An estimate and the truth.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Moment {
    pub(crate) time_s: f64,
    pub(crate) estimate: UnitQuaternion<f64>,
    /// Of the local error in body axes, rad^2.
    pub(crate) covariance: Option<Matrix3<f64>>,
    pub(crate) truth: UnitQuaternion<f64>,
}

/// What the verdicts of a run say.
#[derive(Debug, Clone)]
pub(crate) struct Verdicts {
    pub(super) named: Cause,
    pub(super) blamed_inside_the_band: bool,
    pub(super) true_causes: Vec<Cause>,
}

/// An instant as plots show it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct WorldInstant {
    /// s.
    pub time_s: f64,
    /// Angle between estimated and true up, deg.
    pub tilt_error_deg: f64,
    /// Stated standard deviation in the direction of that error, deg.
    pub tilt_std_deg: Option<f64>,
    /// Heading error, from north or from the first scored instant, deg.
    pub heading_error_deg: f64,
    /// Its stated standard deviation, deg.
    pub heading_std_deg: Option<f64>,
    /// Angle of the whole error, deg.
    pub total_error_deg: f64,
}

/// What was stated of tilt or heading, against the truth.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct StatedScore {
    /// Instants at which it was stated.
    pub instants: usize,
    /// Share of them inside the stated 95 %.
    pub coverage: f64,
    /// Mean NEES per degree of freedom.
    pub nees: f64,
    /// Whether the error was ever beyond five standard deviations.
    pub beyond_five: bool,
    /// How long errors last, s: that of a first-order Gauss-Markov process with their correlation from instant to instant.
    pub correlation_time_s: f64,
}

/// An estimator in a world.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EstimatorScore {
    /// Its name.
    pub estimator: &'static str,
    /// What it was given.
    pub sensing: Sensing,
    /// Whether headings count from north.
    pub has_north: bool,
    /// Scored instants; none: it did not run.
    pub instants: usize,
    /// Root mean square of the tilt error, deg.
    pub tilt_rms_deg: Option<f64>,
    /// The same of the heading.
    pub heading_rms_deg: Option<f64>,
    /// The same of the whole error.
    pub total_rms_deg: Option<f64>,
    /// What it stated of the tilt.
    pub tilt: Option<StatedScore>,
    /// What it stated of the heading.
    pub heading: Option<StatedScore>,
    /// What its verdicts named; none for what has no verdicts.
    pub named: Option<Cause>,
    /// What they could rightly have named, the main cause first.
    pub true_causes: Vec<Cause>,
    /// Whether a sensor was blamed while its mean NIS was in its band.
    pub blamed_inside_the_band: bool,
}

/// A world and its judgement.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WorldOutcome {
    /// What the world has.
    pub description: AttitudeWorldDescription,
    /// Every estimator, with all sensors and with gyroscope and accelerometer.
    pub scores: Vec<EstimatorScore>,
}

impl WorldOutcome {
    pub(super) fn of(run: WorldRun) -> Self {
        Self {
            description: run.description,
            scores: run.runs.into_iter().map(|run| run.score).collect(),
        }
    }

    /// The score of an estimator with these sensors.
    #[must_use]
    pub fn score(&self, estimator: &str, sensing: Sensing) -> Option<&EstimatorScore> {
        let mut scores = self.scores.iter();
        scores.find(|score| score.estimator == estimator && score.sensing == sensing)
    }

    /// That of VQF.
    #[must_use]
    pub fn vqf(&self, sensing: Sensing) -> Option<&EstimatorScore> {
        self.score(baseline::NAME, sensing)
    }
}

impl EstimatorScore {
    /// Whether what the verdicts named is a true cause.
    #[must_use]
    pub fn is_right(&self) -> Option<bool> {
        self.named.map(|named| self.true_causes.contains(&named))
    }

    /// Whether something is named that is no true cause.
    #[must_use]
    pub fn is_false_reason(&self) -> bool {
        self.is_right() == Some(false) && self.named != Some(Cause::NONE)
    }

    /// Whether nothing is named while the truth is beyond five standard deviations.
    #[must_use]
    pub fn is_green_beyond_five(&self) -> bool {
        let far = |stated: &Option<StatedScore>| stated.is_some_and(|s| s.beyond_five);
        self.named == Some(Cause::NONE) && (far(&self.tilt) || far(&self.heading))
    }

    /// The larger it is the worse: NEES of the tilt, or without one the tilt error in degrees; what did not run is worst.
    #[must_use]
    pub fn badness(&self) -> f64 {
        let tilt = self.tilt.map(|tilt| tilt.nees);
        tilt.or(self.tilt_rms_deg).unwrap_or(f64::INFINITY)
    }
}

impl EstimatorRun {
    pub(crate) fn of(
        estimator: &'static str,
        sensing: Sensing,
        has_north: bool,
        moments: &[Moment],
        verdicts: Option<Verdicts>,
    ) -> Self {
        let start = moments.first().filter(|_| !has_north);
        let judged: Vec<_> = moments.iter().map(|m| Judged::of(m, start)).collect();
        let stated = |freedom, of: fn(&Judged) -> Option<Vector2<f64>>| {
            StatedScore::of(freedom, judged.iter().filter_map(of))
        };
        let instants: Vec<_> = judged.iter().map(|judged| judged.instant).collect();
        let rms = |of: fn(&WorldInstant) -> f64| scoring::rms(instants.iter().map(of));
        let score = EstimatorScore {
            estimator,
            sensing,
            has_north,
            instants: instants.len(),
            tilt_rms_deg: rms(|i| i.tilt_error_deg),
            heading_rms_deg: rms(|i| i.heading_error_deg),
            total_rms_deg: rms(|i| i.total_error_deg),
            tilt: stated(2, |judged| judged.tilt),
            heading: stated(1, |judged| judged.heading),
            named: verdicts.as_ref().map(|v| v.named),
            blamed_inside_the_band: verdicts.as_ref().is_some_and(|v| v.blamed_inside_the_band),
            true_causes: verdicts.map_or_else(Vec::new, |v| v.true_causes),
        };
        Self { score, instants }
    }
}

/// A moment with its errors, also in units of what was stated.
pub(crate) struct Judged {
    pub(crate) instant: WorldInstant,
    /// Whitened tilt error.
    pub(crate) tilt: Option<Vector2<f64>>,
    /// Heading error over its standard deviation, and zero.
    pub(crate) heading: Option<Vector2<f64>>,
}

impl Judged {
    /// `start` is the moment from which headings count, where nothing says where north is.
    pub(crate) fn of(moment: &Moment, start: Option<&Moment>) -> Self {
        let heading_of = |m: &Moment| AttitudeError::between(&m.estimate, &m.truth).heading;
        let zero = start.map_or(0.0, heading_of);
        let turned = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), -zero) * moment.estimate;
        let error = AttitudeError::between(&turned, &moment.truth);
        let tilt_error = tilt_error(moment);
        let world = moment
            .covariance
            .map(|body| world_covariance(moment, &body));
        let tilt = world.and_then(|world| whitened(&tilt_error, &world));
        let heading_std = world.and_then(|world| heading_std(&world, start));
        // Below a rounding error there is nothing to compare with.
        let along = tilt.map(|t| tilt_error.norm() / t.norm().max(1e-9));
        Self {
            instant: WorldInstant {
                time_s: moment.time_s,
                tilt_error_deg: tilt_error.norm().to_degrees(),
                tilt_std_deg: along.map(f64::to_degrees),
                heading_error_deg: error.heading.to_degrees(),
                heading_std_deg: heading_std.map(f64::to_degrees),
                total_error_deg: error.total.to_degrees(),
            },
            tilt,
            heading: heading_std.map(|std| Vector2::new(error.heading / std, 0.0)),
        }
    }
}

/// The turn about level axes of the estimate that takes estimated up to true up, rad: free of the heading.
fn tilt_error(moment: &Moment) -> Vector2<f64> {
    let up = moment.estimate * (moment.truth.inverse() * Vector3::z());
    let level = Vector2::new(up.y, -up.x);
    let sine = level.norm();
    let angle = sine.atan2(up.z);
    if sine > 1e-12 {
        level * (angle / sine)
    } else {
        level
    }
}

/// Covariance of the error in world axes.
fn world_covariance(moment: &Moment, body: &Matrix3<f64>) -> Matrix3<f64> {
    let axes = moment.estimate.to_rotation_matrix();
    axes * body * axes.transpose()
}

/// The error in units of what was stated: its square is the NEES.
fn whitened(error: &Vector2<f64>, world: &Matrix3<f64>) -> Option<Vector2<f64>> {
    let level: Matrix2<f64> = world.fixed_view::<2, 2>(0, 0).into_owned();
    let root = level.cholesky()?;
    root.l().solve_lower_triangular(error)
}

/// Standard deviation of the heading from north, or of its drift since the start.
fn heading_std(world: &Matrix3<f64>, start: Option<&Moment>) -> Option<f64> {
    let mut variance = world[(2, 2)];
    if let Some(start) = start {
        let before = world_covariance(start, &start.covariance?)[(2, 2)];
        if before > UNKNOWN_RAD * UNKNOWN_RAD {
            return None;
        }
        variance -= before;
    }
    (variance > 0.0).then(|| variance.sqrt())
}

impl StatedScore {
    /// Of whitened errors, one an instant.
    fn of(freedom: u8, errors: impl Iterator<Item = Vector2<f64>>) -> Option<Self> {
        let bound = quantile_95(freedom);
        let (mut inside, mut instants, mut nees, mut far) = (0, 0, 0.0, false);
        let (mut products, mut squares, mut last) = (0.0, 0.0, None::<Vector2<f64>>);
        for error in errors {
            let square = error.norm_squared();
            instants += 1;
            inside += usize::from(square <= bound);
            nees += square;
            far |= square > FAR * FAR;
            if let Some(last) = last {
                products += error.dot(&last);
                squares += 0.5 * (square + last.norm_squared());
            }
            last = Some(error);
        }
        let count = instants.max(1) as f64;
        (instants > 0).then(|| Self {
            instants,
            coverage: f64::from(u32::try_from(inside).unwrap_or(u32::MAX)) / count,
            nees: nees / (count * f64::from(freedom)),
            beyond_five: far,
            correlation_time_s: correlation_time(products, squares),
        })
    }
}

/// How long errors with this correlation from one instant to the next last, s; at most three hours.
fn correlation_time(products: f64, squares: f64) -> f64 {
    let correlation = if squares > 0.0 {
        products / squares
    } else {
        0.0
    };
    -EVERY_S / correlation.clamp(1e-6, 1.0 - 1e-5).ln()
}

#[cfg(test)]
mod tests {
    use super::*;
    use northing_simulation::random::{standard_normal, stream};

    fn turn(x: f64, y: f64, z: f64) -> UnitQuaternion<f64> {
        UnitQuaternion::from_scaled_axis(Vector3::new(x, y, z))
    }

    fn moment(time_s: f64, error: UnitQuaternion<f64>, std: [f64; 3]) -> Moment {
        let truth = turn(0.7, -0.4, 1.9);
        let estimate = error.inverse() * truth;
        let axes = estimate.to_rotation_matrix();
        let world = Matrix3::from_diagonal(&Vector3::from(std.map(|s| s * s)));
        Moment {
            time_s,
            estimate,
            covariance: Some(axes.transpose() * world * axes),
            truth,
        }
    }

    #[test]
    fn tilt_and_heading_are_compared_with_their_own_deviations() {
        let judged = Judged::of(&moment(0.0, turn(0.02, 0.0, 0.0), [0.01, 0.1, 1.0]), None);
        assert!((judged.tilt.unwrap().norm() - 2.0).abs() < 1e-3);
        assert!((judged.instant.tilt_error_deg.to_radians() - 0.02).abs() < 1e-9);
        assert!((judged.instant.tilt_std_deg.unwrap().to_radians() - 0.01).abs() < 1e-5);
        assert!(judged.heading.unwrap().norm() < 1e-3);
        let judged = Judged::of(&moment(0.0, turn(0.0, 0.0, -0.3), [0.01, 0.1, 0.1]), None);
        assert!((judged.heading.unwrap().norm() - 3.0).abs() < 1e-6);
        assert!(judged.tilt.unwrap().norm() < 1e-6);
    }

    #[test]
    fn tilt_does_not_know_of_a_heading_that_is_a_quarter_turn_off() {
        let off = turn(0.0, 0.0, 1.57) * turn(0.02, 0.0, 0.0);
        let judged = Judged::of(&moment(0.0, off, [0.01, 0.01, 3.0]), None);
        assert!((judged.instant.tilt_error_deg.to_radians() - 0.02).abs() < 1e-6);
    }

    #[test]
    fn without_north_headings_count_from_the_first_instant() {
        let start = moment(5.0, turn(0.0, 0.0, 0.8), [0.01, 0.01, 0.3]);
        let later = moment(6.0, turn(0.0, 0.0, 1.0), [0.01, 0.01, 0.5]);
        let judged = Judged::of(&later, Some(&start));
        assert!((judged.instant.heading_error_deg.to_radians() + 0.2).abs() < 1e-9);
        assert!((judged.instant.total_error_deg.to_radians() - 0.2).abs() < 1e-9);
        // sqrt(0.25 - 0.09)
        assert!((judged.heading.unwrap().norm() - 0.5).abs() < 1e-6);
        let unknown = moment(5.0, turn(0.0, 0.0, 0.8), [0.01, 0.01, 1.8]);
        assert!(Judged::of(&later, Some(&unknown)).heading.is_none());
    }

    #[test]
    fn coverage_and_correlation_are_those_of_the_errors() {
        let mut noise = stream(3, "score");
        let mut error = Vector2::zeros();
        let kept = (-EVERY_S / 2.0_f64).exp();
        let errors: Vec<_> = (0..60_000)
            .map(|_| {
                let fresh = Vector2::new(standard_normal(&mut noise), standard_normal(&mut noise));
                error = error * kept + fresh * (1.0 - kept * kept).sqrt();
                error
            })
            .collect();
        let score = StatedScore::of(2, errors.iter().copied()).unwrap();
        assert!((score.coverage - 0.95).abs() < 0.01, "{score:?}");
        assert!((score.nees - 1.0).abs() < 0.05 && !score.beyond_five);
        assert!((score.correlation_time_s - 2.0).abs() < 0.2, "{score:?}");
        let far = StatedScore::of(1, [Vector2::new(5.1, 0.0)].into_iter()).unwrap();
        assert!(far.beyond_five && far.coverage < 0.5);
        assert!(StatedScore::of(1, [].into_iter()).is_none());
    }
}
