//! Clock offset and misalignment of a reference, found from angular rates alone.
//!
//! The norm of the angular rate is the same in every frame, so its correlation between gyroscope and reference finds the offset
//! of the clocks without knowing how the two are mounted. Stretches of ten seconds each find their own; where they agree there is
//! one offset, where they lie on a line the clock runs at another rate, where they lie on two levels it jumped. The offset, the
//! constant rotation between the bodies and the gyroscope's bias are then refined together by least squares on the rate vectors,
//! `w_gyro(t + tau) = M w_ref(t) + b`, started from Wahba's problem (Davenport, Markley). The residuals give their
//! uncertainty; their correlation in time is allowed for.
//!
//! A device that rests says nothing about its clock: then nothing is concluded.

use nalgebra::{Matrix3, SMatrix, SVector, UnitQuaternion, Vector3};
use northing_core::geometry::{rotation, so3};
use serde::Serialize;

use crate::attitude::reference::clock::{self, Clock};
use crate::attitude::reference::rates::{Series, Window};
use crate::attitude::reference::reading::Reading;

/// Fewer windows than this, or less turning, say nothing.
const FEWEST_WINDOWS: usize = 100;
/// Standard deviation of the rate, rad/s, below which the device counts as resting.
pub(super) const LEAST_MOTION_RAD_S: f64 = 0.1;
/// Correlation of the rate vectors below which they are of different motions.
const LEAST_CORRELATION: f64 = 0.6;
/// Correlation of the rate vectors from which on they are of one motion.
const SURE_CORRELATION: f64 = 0.9;
/// Steps of the least squares.
const STEPS: usize = 6;
/// Half the span over which the derivative with respect to the offset is taken, s.
const DIFFERENCE_S: f64 = 0.01;
/// Share of the rates' products that an unrotated body is worth in Wahba's problem.
const PRIOR_SHARE: f64 = 1e-3;
/// Standard deviation, rad, of a rotation about an axis that the rates say nothing of.
const UNKNOWN_RAD: f64 = 1.8;
/// So many times the noise that residuals show is taken from what the rates say of the rotation.
const NOISE_MARGIN: f64 = 1.5;
/// Residuals beyond so many standard deviations count less.
const HUBER: f64 = 2.0;

/// Clock offset and misalignment of a reference against the gyroscope.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct ReferenceAlignment {
    /// What is added to the reference's stamps to get the sensors' time, s.
    pub clock_offset_s: f64,
    /// Its standard deviation, s.
    pub clock_offset_std_s: f64,
    /// Rotation vector of `sensor_from_reference_body`, deg.
    pub misalignment_deg: [f64; 3],
    /// Standard deviation about each axis of the sensor, deg.
    pub misalignment_std_deg: [f64; 3],
    /// Correlation of the rate vectors once both are taken out.
    pub correlation: f64,
    /// RMS of the rate, deg/s: an offset of the clock costs so much error a second.
    pub rate_rms_deg_s: f64,
    /// Windows compared.
    pub windows: usize,
}

/// Why a reference cannot be that of the recording's sensors.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum ReferenceProblem {
    /// It shows another motion.
    #[error(
        "its angular rates and those of the gyroscope correlate by {correlation:.2} at best: it belongs to another recording or \
         another body, or its numbers are no quaternions in the order and direction that they are read in"
    )]
    OtherMotion {
        /// The best correlation, over all offsets of the clocks.
        correlation: f64,
    },
    /// Its quaternions are read in another order, or the other way, than they were written.
    #[error(
        "its angular rates and those of the gyroscope correlate by {correlation:.2}, but by {reread:.2} where its quaternions \
         are read {reading}; a manifest says so (`northing describe` drafts one)"
    )]
    OtherReading {
        /// How they have to be read.
        reading: Reading,
        /// Correlation as they are read.
        correlation: f64,
        /// Correlation when they are read so.
        reread: f64,
    },
    /// What it calls up the estimate calls down, whichever way the body lies.
    #[error(
        "its up is the estimate's down, over its {samples} samples: a half turn about a level axis lies between them, as \
         where the z axis of its world, or of the recording's, points the other way than it is read (say which: a comment \
         `# world_frame: ned` or `enu` of CSV and TUM, or `world_frame` in a manifest), or where all signs of the accelerometer are reversed{}",
        if *turns { "" } else { ", or, as it turns too little to tell, where its quaternions are read in another order than they were written" }
    )]
    UpsideDown {
        /// Samples that were compared.
        samples: u64,
        /// Whether it turns as the gyroscope says, so that its quaternions are read as they were written.
        turns: bool,
    },
    /// Its clock runs at another rate.
    #[error(
        "its clock runs {:.3} % {} than that of the sensors: its offset changes by {:.3} s in {span_s:.0} s",
        100.0 * rate.abs(), if *rate > 0.0 { "slower" } else { "faster" }, rate * span_s
    )]
    ClockRate {
        /// Change of the offset a second.
        rate: f64,
        /// Time over which that was seen, s.
        span_s: f64,
    },
    /// Its clock jumps.
    #[error("its clock jumps by {by_s:.3} s at {at_s:.0} s")]
    ClockJump {
        /// Change of the offset, s.
        by_s: f64,
        /// When, s after the first sample.
        at_s: f64,
    },
}

impl ReferenceAlignment {
    /// `sensor_from_reference_body`.
    #[must_use]
    pub fn misalignment(&self) -> UnitQuaternion<f64> {
        so3::exp(&Vector3::from(self.misalignment_deg).map(f64::to_radians))
    }

    /// Angle of the misalignment, deg.
    #[must_use]
    pub fn misalignment_angle_deg(&self) -> f64 {
        Vector3::from(self.misalignment_deg).norm()
    }

    /// Both with their standard deviations, in words.
    #[must_use]
    pub fn in_words(&self) -> String {
        let [x, y, z] = self.misalignment_deg;
        let std = Vector3::from(self.misalignment_std_deg).norm();
        format!(
            "clock offset {:+.4} s (standard deviation {:.4} s), misalignment {:.2} deg ({x:.2}, {y:.2}, {z:.2}; standard \
             deviation {std:.2} deg), correlation of the rates {:.3}",
            self.clock_offset_s,
            self.clock_offset_std_s,
            self.misalignment_angle_deg(),
            self.correlation
        )
    }

    /// What of it matters for a score that does not allow for it, in words.
    #[must_use]
    pub fn remark(&self) -> Option<String> {
        const SURE: f64 = 5.0;
        /// Error that an offset causes at the RMS rate, deg, from which on it is said.
        const ERROR_DEG: f64 = 0.5;
        const MISALIGNMENT_DEG: f64 = 1.0;
        let offset = self.clock_offset_s.abs();
        let error_deg = offset * self.rate_rms_deg_s;
        let late = error_deg > ERROR_DEG && offset > SURE * self.clock_offset_std_s;
        let angle = self.misalignment_angle_deg();
        let std = Vector3::from(self.misalignment_std_deg).norm();
        let turned = angle > MISALIGNMENT_DEG && angle > SURE * std;
        let mut parts = Vec::new();
        if late {
            let word = if self.clock_offset_s > 0.0 {
                "behind"
            } else {
                "ahead of"
            };
            parts.push(format!(
                "its clock is {offset:.4} s {word} that of the sensors (standard deviation {:.4} s), which costs {error_deg:.1} \
                 deg at the RMS rate",
                self.clock_offset_std_s
            ));
        }
        if turned {
            parts.push(format!(
                "its body is turned by {angle:.1} deg against the sensor's (standard deviation {std:.1} deg)"
            ));
        }
        (!parts.is_empty()).then(|| {
            format!(
                "The reference is scored as it is, but by its angular rates {}; --align-reference takes this out.",
                parts.join(", and ")
            )
        })
    }
}

/// Finds offset and misalignment; `None` where there is too little motion to say anything.
///
/// # Errors
/// The reference cannot be that of these sensors.
pub(crate) fn find(series: &Series<'_>) -> Result<Option<ReferenceAlignment>, ReferenceProblem> {
    let moving = spread(series.windows.iter().map(|w| w.rate.norm()));
    if series.windows.len() < FEWEST_WINDOWS || moving < LEAST_MOTION_RAD_S {
        return Ok(None);
    }
    let offset = match clock::compare(series) {
        Clock::Unknown => return Ok(None),
        Clock::Offset(offset) => offset,
        Clock::Rate { rate, span_s } => return Err(ReferenceProblem::ClockRate { rate, span_s }),
        Clock::Jump { by_s, at_s } => return Err(ReferenceProblem::ClockJump { by_s, at_s }),
        Clock::Different { correlation } => {
            return Err(ReferenceProblem::OtherMotion { correlation });
        }
    };
    let found = Fit::start(series, offset).and_then(|fit| fit.refined(series));
    match found {
        Some(found) if found.correlation < LEAST_CORRELATION => {
            Err(other_reading(series, offset, found.correlation))
        }
        found => Ok(found),
    }
}

/// Whether another reading of the quaternions explains rates that are as fast as the gyroscope's, but about other axes.
///
/// Norms of rates are the same in each reading, so that their clock is found in all of them: an inverse turns as fast, and
/// numbers in another order are a rotation of the quaternion's four dimensions.
fn other_reading(series: &Series<'_>, offset_s: f64, correlation: f64) -> ReferenceProblem {
    let read = |reading: Reading| {
        let windows: Vec<Window> = series.windows.iter().map(|w| reading.of(w)).collect();
        let again = series.with(&windows);
        let found = Fit::start(&again, offset_s).and_then(|fit| fit.refined(&again))?;
        (found.correlation > SURE_CORRELATION).then_some((reading, found))
    };
    // An inverse in another order is the attitude between two constant rotations, so that more than one reading fits: the one with the
    // smaller rotation is it.
    let fitting = Reading::ALL.into_iter().filter_map(read);
    let angle = |found: &ReferenceAlignment| found.misalignment_angle_deg();
    match fitting.min_by(|(_, a), (_, b)| angle(a).total_cmp(&angle(b))) {
        Some((reading, found)) => ReferenceProblem::OtherReading {
            reading,
            correlation,
            reread: found.correlation,
        },
        None => ReferenceProblem::OtherMotion { correlation },
    }
}

/// Standard deviation.
pub(super) fn spread(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let count = values.clone().count().max(1) as f64;
    let mean = values.clone().sum::<f64>() / count;
    (values.map(|v| (v - mean).powi(2)).sum::<f64>() / count).sqrt()
}

/// The parameters: offset, `sensor_from_reference_body`, bias.
struct Fit {
    offset_s: f64,
    rotation: UnitQuaternion<f64>,
    bias: Vector3<f64>,
}

/// Pairs of rates, of the gyroscope and of the reference.
fn pairs<'a>(
    series: &'a Series<'_>,
    offset_s: f64,
) -> impl Iterator<Item = (Window, Vector3<f64>)> + 'a {
    series.windows.iter().filter_map(move |window| {
        let rate = series.gyroscope(window.from_s + offset_s, window.to_s + offset_s)?;
        Some((*window, rate))
    })
}

impl Fit {
    /// Wahba's problem on the deviations of the rates from their means, which have no bias.
    fn start(series: &Series<'_>, offset_s: f64) -> Option<Self> {
        let all: Vec<_> = pairs(series, offset_s).collect();
        let count = all.len() as f64;
        let means = all.iter().fold([Vector3::zeros(); 2], |[a, b], (w, g)| {
            [a + w.rate / count, b + g / count]
        });
        let products = all
            .iter()
            .map(|(w, g)| (g - means[1]) * (w.rate - means[0]).transpose());
        let products = products.sum::<Matrix3<f64>>();
        // About an axis that the rates say nothing of, the rotation is the smallest one.
        let prior = Matrix3::identity() * (PRIOR_SHARE * products.norm());
        let svd = (products + prior).svd(true, true);
        let (u, v_t) = (svd.u?, svd.v_t?);
        let sign = Vector3::new(1.0, 1.0, (u * v_t).determinant().signum());
        let rotation = rotation::from_matrix(&(u * Matrix3::from_diagonal(&sign) * v_t));
        (all.len() >= FEWEST_WINDOWS).then(|| Self {
            offset_s,
            rotation,
            bias: means[1] - rotation * means[0],
        })
    }

    /// Gauss-Newton with Huber's weights, and what it comes to.
    fn refined(mut self, series: &Series<'_>) -> Option<ReferenceAlignment> {
        let mut scale = f64::INFINITY;
        for _ in 0..STEPS {
            let normal = self.normal_equations(series, scale);
            let step = normal.covariance()? * normal.vector;
            self.offset_s += step[0];
            self.rotation = so3::exp(&step.fixed_rows::<3>(1).into_owned()) * self.rotation;
            self.bias += step.fixed_rows::<3>(4);
            scale = normal.residual_std();
        }
        let end = self.normal_equations(series, scale);
        let variances =
            end.without_noise().covariance()?.diagonal() * end.variance() * end.inflation();
        let std = |i: usize| variances[i].max(0.0).sqrt();
        let axis = so3::log(&self.rotation).map(f64::to_degrees);
        let found = ReferenceAlignment {
            clock_offset_s: self.offset_s,
            clock_offset_std_s: std(0),
            misalignment_deg: axis.into(),
            misalignment_std_deg: [1, 2, 3].map(|i| std(i).to_degrees()),
            correlation: (1.0 - end.squares / end.variation).max(0.0).sqrt(),
            rate_rms_deg_s: (end.rate_squares / end.count).sqrt().to_degrees(),
            windows: end.count as usize,
        };
        found.clock_offset_s.is_finite().then_some(found)
    }

    fn normal_equations(&self, series: &Series<'_>, scale: f64) -> Normal {
        let mut normal = Normal::default();
        let mean = {
            let (sum, count) = pairs(series, self.offset_s)
                .fold((Vector3::zeros(), 0.0), |(sum, count), (_, g)| {
                    (sum + g, count + 1.0)
                });
            sum / f64::max(count, 1.0)
        };
        let mut last: Option<Vector3<f64>> = None;
        for (window, rate) in pairs(series, self.offset_s) {
            let at = |shift: f64| {
                let offset = self.offset_s + shift;
                series.gyroscope(window.from_s + offset, window.to_s + offset)
            };
            let (Some(after), Some(before)) = (at(DIFFERENCE_S), at(-DIFFERENCE_S)) else {
                continue;
            };
            let turned = self.rotation * window.rate;
            let residual = rate - turned - self.bias;
            let weight = (HUBER * scale / residual.norm().max(f64::MIN_POSITIVE)).min(1.0);
            // Of the model less the measurement: -dg/dtau, d(Exp(d) M w)/dd = -[M w]x, I.
            let mut jacobian = SMatrix::<f64, 3, 7>::zeros();
            jacobian.set_column(0, &((before - after) / (2.0 * DIFFERENCE_S)));
            jacobian
                .fixed_view_mut::<3, 3>(0, 1)
                .copy_from(&(-so3::skew(&turned)));
            jacobian
                .fixed_view_mut::<3, 3>(0, 4)
                .copy_from(&Matrix3::identity());
            normal.matrix += jacobian.transpose() * jacobian * weight;
            normal.vector += jacobian.transpose() * residual * weight;
            normal.count += 1.0;
            normal.squares += residual.norm_squared();
            normal.weighted += weight * residual.norm_squared();
            normal.variation += (rate - mean).norm_squared();
            normal.rate_squares += rate.norm_squared();
            normal.lagged += last.map_or(0.0, |last| last.dot(&residual));
            last = Some(residual);
        }
        normal
    }
}

/// Normal equations, and sums over the residuals.
#[derive(Clone, Copy)]
struct Normal {
    matrix: SMatrix<f64, 7, 7>,
    vector: SVector<f64, 7>,
    count: f64,
    squares: f64,
    weighted: f64,
    variation: f64,
    rate_squares: f64,
    /// Of each residual with the one before.
    lagged: f64,
}

impl Default for Normal {
    fn default() -> Self {
        Self {
            matrix: SMatrix::zeros(),
            vector: SVector::zeros(),
            count: 0.0,
            squares: 0.0,
            weighted: 0.0,
            variation: 0.0,
            rate_squares: 0.0,
            lagged: 0.0,
        }
    }
}

impl Normal {
    /// Of the parameters, but for the variance of the residuals. What the rates say nothing of is known to
    /// [`UNKNOWN_RAD`].
    fn covariance(&self) -> Option<SMatrix<f64, 7, 7>> {
        let mut information = self.matrix;
        for i in 1..4 {
            information[(i, i)] += self.variance() / UNKNOWN_RAD.powi(2);
        }
        information.try_inverse()
    }

    /// With no more information about the rotation than the motion gives: of a device that turns about one axis, the noise
    /// of the reference would seem to turn about the others, by at most what the residuals show.
    fn without_noise(&self) -> Self {
        let mut matrix = self.matrix;
        let mut block = matrix.fixed_view_mut::<3, 3>(1, 1);
        let eigen = block.clone_owned().symmetric_eigen();
        let noise = NOISE_MARGIN * 2.0 / 3.0 * self.squares;
        let values = eigen.eigenvalues.map(|value| (value - noise).max(0.0));
        let axes = eigen.eigenvectors;
        block.copy_from(&(axes * Matrix3::from_diagonal(&values) * axes.transpose()));
        Self { matrix, ..*self }
    }

    /// Variance of a residual per axis, above what numbers can tell.
    fn variance(&self) -> f64 {
        self.residual_std().powi(2).max(1e-10)
    }

    /// Standard deviation of a residual per axis.
    fn residual_std(&self) -> f64 {
        (self.weighted / (3.0 * self.count - 7.0).max(1.0)).sqrt()
    }

    /// How many times larger variances are because residuals resemble the ones before; smaller where they alternate, as
    /// the noise of a reference does once it is differentiated.
    fn inflation(&self) -> f64 {
        let c = (self.lagged / self.squares.max(f64::MIN_POSITIVE)).clamp(-0.5, 0.98);
        (1.0 + c) / (1.0 - c)
    }
}
