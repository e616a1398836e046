//! Magnetometer calibration: hard iron, soft iron, and how much of the sphere was seen.
//!
//! Read first: `docs/derivations/magnetometer_calibration.md` (C1-C10); Taubin (1991) for the fit;
//! Gebre-Egziabher et al. (2006) for ellipsoids and magnetometers.
//!
//! Use it on a device that is turned by hand through as many directions as possible, on one spot,
//! away from iron, for 20 seconds or more; on the uncalibrated stream where there is one. Do not
//! use it on a stream that the device calibrates itself while you turn it, nor while walking: the
//! field must be the same all the time.
//!
//! # Model
//!
//! ```text
//! y = A B u + h + noise, |u| = 1:   (y - h)^T S (y - h) = 1                       (C1, C2)
//! x^T Q x + 2 q^T x + c = v . phi(x);  minimise mean((v . phi)^2) / mean(|grad|^2)   (C3, C5)
//! h = -Q^-1 q,  S = Q / (h^T Q h - c),  W = F sqrt(S),  calibrated = W (y - h)       (C7, C9)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | `y` | `measured_ut` | microtesla |
//! | `h` | `hard_iron_ut` | microtesla |
//! | `W` | `soft_iron`, symmetric | - |
//! | `F` | `field_strength_ut` | microtesla |
//! | `sigma` | `residual_std_ut` | microtesla |
//!
//! Streaming: 55 sums and one sample for each of 72 directions are kept, 2.8 KB in `f64` and half
//! in `f32`. A sample costs about 200 operations, every 128th a fit of a sphere. Sums are taken
//! about the first sample, in units of 50 microtesla, so that single precision bears hard iron of
//! hundreds of microtesla. Limits: the rotation between magnetometer and device cannot be seen
//! from the field alone; `hard_iron_std_ut` counts noise and, for a sphere, soft iron of three
//! percent, not a field that varies in space.

use nalgebra::Vector3;

use crate::scalar::{Scalar, lit};

pub mod coverage;
mod moments;
mod passes;
mod quadric;
mod result;
mod verdict;

pub use coverage::Coverage;
use moments::Moments;
pub use passes::calibrate;
use quadric::{Precision, Surface};
pub use result::{MagnetometerCalibration, MagnetometerModel};
pub use verdict::{MagnetometerError, MagnetometerLimits};

/// Microtesla to one inside: about the radius that is expected.
const UNIT_UT: f64 = 50.0;

/// Microtesla beyond which a number is no measurement of a magnetometer.
const RANGE_UT: f64 = 1e4;

/// Takes samples of a device that is turned through all directions and fits an ellipsoid.
///
/// ```
/// use northing_core::calibration::magnetometer::{MagnetometerCalibrator, MagnetometerLimits};
/// use northing_core::nalgebra::Vector3;
/// let mut calibrator = MagnetometerCalibrator::<f64>::new();
/// for k in 0..500 {
///     let (turn, z) = (2.4 * f64::from(k), f64::from(2 * k + 1) / 500.0 - 1.0);
///     let across = (1.0 - z * z).sqrt();
///     let field = Vector3::new(across * turn.cos(), across * turn.sin(), z) * 48.0;
///     calibrator.add(&(field + Vector3::new(300.0, -20.0, 5.0)));
/// }
/// let calibration = calibrator.finish(&MagnetometerLimits::default()).unwrap();
/// assert!((calibration.hard_iron() - Vector3::new(300.0, -20.0, 5.0)).norm() < 1e-6);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MagnetometerCalibrator<T: Scalar> {
    moments: Moments<T>,
    /// Where the moments are counted from, microtesla.
    origin: Option<Vector3<T>>,
    last: Vector3<T>,
    lowest: Vector3<T>,
    highest: Vector3<T>,
    coverage: Coverage<T>,
    sphere: Option<Surface<T>>,
    norm_mean: T,
    norm_squares: T,
    ignored: u32,
    repeated: u32,
}

impl<T: Scalar> Default for MagnetometerCalibrator<T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Scalar> MagnetometerCalibrator<T> {
    /// Nothing seen yet.
    pub fn new() -> Self {
        Self {
            moments: Moments::new(),
            origin: None,
            last: Vector3::zeros(),
            lowest: Vector3::zeros(),
            highest: Vector3::zeros(),
            coverage: Coverage::new(Vector3::zeros()),
            sphere: None,
            norm_mean: T::zero(),
            norm_squares: T::zero(),
            ignored: 0,
            repeated: 0,
        }
    }

    /// Nothing seen yet, but hard iron is expected near `hard_iron_ut` (microtesla): sums are taken
    /// about it, and the coverage is right from the start.
    pub fn with_expected(hard_iron_ut: Vector3<T>) -> Self {
        Self {
            origin: Some(hard_iron_ut),
            coverage: Coverage::new(hard_iron_ut),
            ..Self::new()
        }
    }

    /// Adds a measured field, microtesla.
    ///
    /// Returns `false` and ignores the sample when it is zero (a sensor that is not ready), not
    /// finite, beyond 10000 microtesla, or the same as the one before.
    pub fn add(&mut self, measured_ut: &Vector3<T>) -> bool {
        let norm = measured_ut.norm();
        if !(norm > T::zero() && norm < lit(RANGE_UT)) || self.samples() == u32::MAX {
            self.ignored = self.ignored.saturating_add(1);
            return false;
        }
        if self.samples() > 0 && *measured_ut == self.last {
            self.repeated = self.repeated.saturating_add(1);
            return false;
        }
        self.last = *measured_ut;
        let origin = *self.origin.get_or_insert(*measured_ut);
        self.moments
            .add(&((measured_ut - origin) / lit::<T>(UNIT_UT)));
        self.note_norm(norm);
        self.note_extent(measured_ut);
        self.coverage.add(measured_ut);
        if self.is_time_to_fit() {
            self.fit_sphere();
        }
        true
    }

    /// Welford's recursion for the length of the samples as they come.
    fn note_norm(&mut self, norm: T) {
        let before = norm - self.norm_mean;
        self.norm_mean += before / lit::<T>(f64::from(self.samples()));
        self.norm_squares += before * (norm - self.norm_mean);
    }

    fn note_extent(&mut self, sample: &Vector3<T>) {
        if self.samples() == 1 {
            (self.lowest, self.highest) = (*sample, *sample);
        }
        self.lowest = self.lowest.inf(sample);
        self.highest = self.highest.sup(sample);
    }

    /// Often at first, while the picture changes with every turn.
    fn is_time_to_fit(&self) -> bool {
        let interval = if self.samples() < 256 { 16 } else { 128 };
        self.samples().is_multiple_of(interval)
    }

    /// Moves the centre of the coverage where the samples say it is.
    fn fit_sphere(&mut self) {
        self.sphere = self.current_sphere();
        let (centre, radius) = match &self.sphere {
            Some(sphere) => (sphere.centre, sphere.radius),
            None => {
                let (extent, half) = (self.highest - self.lowest, lit::<T>(0.5));
                (self.lowest + extent * half, extent.norm() * half)
            }
        };
        if (centre - self.coverage.centre()).norm() > radius * lit(0.1) {
            self.coverage = self.coverage.about(centre);
        }
    }

    /// The best sphere, microtesla, if it is well determined and credible.
    fn current_sphere(&self) -> Option<Surface<T>> {
        let means = self.moments.means();
        let sphere = quadric::fit_sphere(&means)?;
        let precision = sphere.sphere_precision(&means)?;
        let sphere = self.in_microtesla(&sphere);
        let credible = sphere.radius > lit(10.0) && sphere.radius < lit(150.0);
        (credible && precision.condition < lit(30.0)).then_some(sphere)
    }

    /// Samples used.
    pub fn samples(&self) -> u32 {
        self.moments.count()
    }

    /// Samples ignored: zero, not finite, out of range, or the same as the one before.
    pub fn ignored_samples(&self) -> u32 {
        self.ignored.saturating_add(self.repeated)
    }

    /// Which directions have been seen about the centre as it is now known; for a live picture.
    pub fn coverage(&self) -> &Coverage<T> {
        &self.coverage
    }

    /// Centre and radius (microtesla) of the sphere as it is now known; `None` while the samples
    /// do not determine one. Renewed every 16 samples, later every 128.
    pub fn sphere_ut(&self) -> Option<(Vector3<T>, T)> {
        self.sphere.map(|sphere| (sphere.centre, sphere.radius))
    }

    /// The calibration, if the samples allow one: an ellipsoid where enough of the sphere was
    /// seen, otherwise a sphere. It can be asked for at any time, and more samples added.
    ///
    /// # Errors
    /// [`MagnetometerError`] says what was wrong, by how much, and what to do.
    pub fn finish(
        &self,
        limits: &MagnetometerLimits<T>,
    ) -> Result<MagnetometerCalibration<T>, MagnetometerError<T>> {
        limits.validate().map_err(MagnetometerError::Limits)?;
        self.check_samples(limits)?;
        let fit = self.fit(limits)?;
        let radius = fit.surface.radius;
        if !(radius >= limits.field_minimum_ut && radius <= limits.field_maximum_ut) {
            return Err(MagnetometerError::NotTheEarthsField {
                measured_ut: radius,
                minimum_ut: limits.field_minimum_ut,
                maximum_ut: limits.field_maximum_ut,
            });
        }
        self.check_residual(&fit, limits)?;
        let strength = limits.field_strength_ut.unwrap_or(radius);
        let soft_iron = result::soft_iron(&fit.surface, strength).ok_or(MagnetometerError::Flat)?;
        Ok(self.summary(&fit, soft_iron, strength))
    }

    fn check_samples(&self, limits: &MagnetometerLimits<T>) -> Result<(), MagnetometerError<T>> {
        let samples = self.samples();
        if samples == 1 && self.repeated > 0 {
            return Err(MagnetometerError::Constant {
                samples: self.repeated.saturating_add(1),
            });
        }
        let required = limits.minimum_samples.max(10);
        if samples < required {
            return Err(MagnetometerError::TooFewSamples {
                samples,
                required,
                ignored: self.ignored,
            });
        }
        Ok(())
    }

    /// The surface that the coverage allows.
    fn fit(&self, limits: &MagnetometerLimits<T>) -> Result<Fit<T>, MagnetometerError<T>> {
        let means = self.moments.means();
        let sphere = quadric::fit_sphere(&means);
        let precision = sphere.and_then(|s| s.sphere_precision(&means));
        let well = precision.filter(|p| p.condition <= limits.condition_number);
        let (Some(sphere), Some(precision)) = (sphere, well) else {
            return Err(self.undetermined(sphere, limits));
        };
        let sphere = self.judged(MagnetometerModel::Sphere, &sphere, precision);
        let fit = self.fit_ellipsoid(limits, &sphere).unwrap_or(sphere);
        match self.too_little(fit.share, limits) {
            Some(error) => Err(error),
            None => Ok(fit),
        }
    }

    /// The ellipsoid, if it is credible, enough of it was seen, and its centre is not much less
    /// certain than that of the sphere.
    fn fit_ellipsoid(&self, limits: &MagnetometerLimits<T>, sphere: &Fit<T>) -> Option<Fit<T>> {
        let means = self.moments.means();
        let ellipsoid = quadric::fit_ellipsoid(&means, &quadric::fit_sphere(&means)?)?;
        let precision = ellipsoid.ellipsoid_precision(&means)?;
        let fit = self.judged(MagnetometerModel::Ellipsoid, &ellipsoid, precision);
        let credible = fit.surface.axis_ratio <= limits.axis_ratio
            && fit.share >= limits.ellipsoid_coverage
            && precision.condition <= limits.condition_number;
        let bearable = sphere.centre_std.max() * lit(1.5) + lit(0.1);
        (credible && fit.centre_std.max() <= bearable).then_some(fit)
    }

    /// A surface in inner units with how well it is known, in microtesla.
    fn judged(
        &self,
        model: MagnetometerModel,
        inner: &Surface<T>,
        precision: Precision<T>,
    ) -> Fit<T> {
        let surface = self.in_microtesla(inner);
        let residual_std = self.residual_std(model, &surface);
        let n = lit::<T>(f64::from(self.samples().max(1)));
        let noise = precision.centre_variance * (residual_std * residual_std / n);
        let soft_iron = precision.soft_iron_variance * (surface.radius * surface.radius);
        Fit {
            model,
            surface,
            residual_std,
            centre_std: (noise + soft_iron).map(|v| v.sqrt()),
            condition: precision.condition,
            share: self.coverage_about(&surface).share(),
        }
    }

    /// Why no sphere is determined: too little seen, scatter, or a turn about one axis.
    fn undetermined(
        &self,
        sphere: Option<Surface<T>>,
        limits: &MagnetometerLimits<T>,
    ) -> MagnetometerError<T> {
        if let Some(error) = self.too_little(self.coverage.share(), limits) {
            return error;
        }
        let std_ut = sphere.map_or(T::zero(), |s| s.mean_square.sqrt() * lit(UNIT_UT));
        let limit_ut = limits.residual_std_ut;
        if std_ut > limit_ut {
            MagnetometerError::ResidualTooLarge { std_ut, limit_ut }
        } else {
            MagnetometerError::Flat
        }
    }

    fn too_little(&self, share: T, limits: &MagnetometerLimits<T>) -> Option<MagnetometerError<T>> {
        let required = limits.sphere_coverage;
        (share < required).then_some(MagnetometerError::NotEnoughCoverage { share, required })
    }

    /// Coverage about the centre of a surface; sorted again only where the centre has moved so far
    /// that it matters.
    fn coverage_about(&self, surface: &Surface<T>) -> Coverage<T> {
        let moved = (surface.centre - self.coverage.centre()).norm();
        if moved > surface.radius * lit(0.1) {
            self.coverage.about(surface.centre)
        } else {
            self.coverage
        }
    }

    fn check_residual(
        &self,
        fit: &Fit<T>,
        limits: &MagnetometerLimits<T>,
    ) -> Result<(), MagnetometerError<T>> {
        let (std_ut, limit_ut) = (fit.residual_std, limits.residual_std_ut);
        if std_ut <= limit_ut {
            Ok(())
        } else if fit.model == MagnetometerModel::Sphere && fit.share >= limits.ellipsoid_coverage {
            Err(MagnetometerError::NotAnEllipsoid { std_ut, limit_ut })
        } else {
            Err(MagnetometerError::ResidualTooLarge { std_ut, limit_ut })
        }
    }

    /// Unbiased: the parameters fitted take their share of the scatter (C8b).
    fn residual_std(&self, model: MagnetometerModel, surface: &Surface<T>) -> T {
        let parameters = match model {
            MagnetometerModel::Ellipsoid => 9,
            MagnetometerModel::Sphere => 4,
        };
        let n = lit::<T>(f64::from(self.samples()));
        let degrees = lit::<T>(f64::from(self.samples().saturating_sub(parameters).max(1)));
        (surface.mean_square * n / degrees).sqrt()
    }

    /// A surface of inner units in microtesla about the sensor's zero.
    fn in_microtesla(&self, surface: &Surface<T>) -> Surface<T> {
        let unit = lit::<T>(UNIT_UT);
        Surface {
            centre: surface.centre * unit + self.origin.unwrap_or_else(Vector3::zeros),
            shape: surface.shape / (unit * unit),
            radius: surface.radius * unit,
            axis_ratio: surface.axis_ratio,
            mean_square: surface.mean_square * unit * unit,
        }
    }

    fn summary(
        &self,
        fit: &Fit<T>,
        soft_iron: [[T; 3]; 3],
        strength: T,
    ) -> MagnetometerCalibration<T> {
        let n = lit::<T>(f64::from(self.samples()));
        MagnetometerCalibration {
            model: fit.model,
            samples: self.samples(),
            ignored_samples: self.ignored_samples(),
            rejected_samples: 0,
            coverage: fit.share,
            hard_iron_ut: fit.surface.centre.into(),
            hard_iron_std_ut: fit.centre_std.into(),
            soft_iron,
            field_strength_ut: strength,
            radius_ut: fit.surface.radius,
            residual_std_ut: fit.residual_std,
            uncalibrated_norm_std_ut: (self.norm_squares / n).sqrt(),
            condition_number: fit.condition,
        }
    }
}

/// A surface and how well it is known, microtesla.
struct Fit<T: Scalar> {
    model: MagnetometerModel,
    surface: Surface<T>,
    residual_std: T,
    centre_std: Vector3<T>,
    condition: T,
    share: T,
}

#[cfg(test)]
mod tests;
