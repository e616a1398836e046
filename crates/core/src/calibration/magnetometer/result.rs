//! A finished magnetometer calibration: what it holds and how it is applied.

use nalgebra::{Matrix3, SymmetricEigen, Vector3};

use super::quadric::Surface;
use crate::kalman::covariance::cholesky;
use crate::parameters::{ConfigError, Range};
use crate::scalar::Scalar;

/// The surface on which the samples were taken to lie.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename_all = "kebab-case")
)]
pub enum MagnetometerModel {
    /// Hard and soft iron.
    Ellipsoid,
    /// Hard iron only: too little of the sphere was seen for more.
    Sphere,
}

impl MagnetometerModel {
    /// Its name in lower case.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Ellipsoid => "ellipsoid",
            Self::Sphere => "sphere",
        }
    }
}

/// A magnetometer calibration, `calibrated = soft_iron * (measured - hard_iron)`. Flat and of plain
/// arrays, to be written to a file as it stands; body axes.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(
        deny_unknown_fields,
        bound(
            serialize = "T: serde::Serialize",
            deserialize = "T: serde::Deserialize<'de>"
        )
    )
)]
pub struct MagnetometerCalibration<T> {
    /// The surface fitted.
    pub model: MagnetometerModel,
    /// Samples used.
    pub samples: u32,
    /// Samples ignored: zero, not finite, out of range, or a repetition of the one before.
    pub ignored_samples: u32,
    /// Samples left out as outliers by a later pass; 0 after the first.
    pub rejected_samples: u32,
    /// Share of the sphere seen, 0 to 1.
    pub coverage: T,
    /// Centre of the surface, microtesla: the hard iron, `measured = true + hard iron`.
    pub hard_iron_ut: [T; 3],
    /// Its standard deviation if the residuals were independent noise, microtesla; for a sphere
    /// with what soft iron of three percent does to it where only a part of the sphere was seen.
    pub hard_iron_std_ut: [T; 3],
    /// Symmetric positive matrix, rows, that turns the ellipsoid into a sphere; for a sphere a
    /// multiple of the identity.
    pub soft_iron: [[T; 3]; 3],
    /// Length of a calibrated sample, microtesla.
    pub field_strength_ut: T,
    /// Mean radius (of the ellipsoid: geometric mean of the semi-axes) as measured, microtesla.
    pub radius_ut: T,
    /// Standard deviation of the samples' distance from the surface, microtesla.
    pub residual_std_ut: T,
    /// Standard deviation of the length of the samples before calibration, microtesla.
    pub uncalibrated_norm_std_ut: T,
    /// Condition number of the design matrix: 3.2 for an ellipsoid and 1.2 for a sphere seen from
    /// all sides; the larger, the more the least certain parameter is left to chance.
    pub condition_number: T,
}

impl<T: Scalar> MagnetometerCalibration<T> {
    /// Hard iron, microtesla, body axes.
    pub fn hard_iron(&self) -> Vector3<T> {
        self.hard_iron_ut.into()
    }

    /// The matrix that takes the soft iron away.
    pub fn soft_iron(&self) -> Matrix3<T> {
        let rows = &self.soft_iron;
        Matrix3::from_fn(|i, j| rows[i][j])
    }

    /// The calibrated field, microtesla. A sample that is not finite stays so.
    pub fn apply(&self, measured_ut: &Vector3<T>) -> Vector3<T> {
        self.soft_iron() * (measured_ut - self.hard_iron())
    }

    /// By how much the calibrated sample is longer than the field, microtesla: for the rejection
    /// of outliers in a second pass.
    pub fn residual(&self, measured_ut: &Vector3<T>) -> T {
        self.apply(measured_ut).norm() - self.field_strength_ut
    }

    /// Checks numbers that come from a file.
    ///
    /// # Errors
    /// The first field that no calibration can have.
    pub fn validate(&self) -> Result<(), ConfigError> {
        let finite = |v: &[T; 3]| v.iter().all(|x| x.is_finite());
        let positive = |x: T| x > T::zero() && x.is_finite();
        let soft = self.soft_iron();
        let asymmetry = (soft - soft.transpose()).amax();
        let tolerance = T::default_epsilon().sqrt() * soft.amax();
        let refuse = |field, words| {
            let range = Range::Described(words);
            Err(ConfigError { field, range })
        };
        if !finite(&self.hard_iron_ut) {
            return refuse("hard_iron_ut", "three finite numbers");
        }
        if !soft.iter().all(|x| x.is_finite()) || asymmetry > tolerance || cholesky(&soft).is_none()
        {
            return refuse("soft_iron", "a symmetric, positive definite matrix");
        }
        if !positive(self.field_strength_ut) {
            return refuse("field_strength_ut", "above 0");
        }
        if !(self.residual_std_ut >= T::zero() && self.residual_std_ut.is_finite()) {
            return refuse("residual_std_ut", "0 or above");
        }
        Ok(())
    }
}

/// `strength * sqrt(shape)`, symmetric: it turns the surface into a sphere of that radius (C9).
pub(super) fn soft_iron<T: Scalar>(surface: &Surface<T>, strength: T) -> Option<[[T; 3]; 3]> {
    let eigen = SymmetricEigen::try_new(surface.shape, T::default_epsilon(), 300)?;
    let vectors = eigen.eigenvectors;
    let roots = Matrix3::from_diagonal(&eigen.eigenvalues.map(|x| x.sqrt() * strength));
    let matrix = vectors * roots * vectors.transpose();
    let half = crate::scalar::lit::<T>(0.5);
    let entry = |i: usize, j: usize| (matrix[(i, j)] + matrix[(j, i)]) * half;
    let rows = [0, 1, 2].map(|i| [entry(i, 0), entry(i, 1), entry(i, 2)]);
    rows.iter().flatten().all(|x| x.is_finite()).then_some(rows)
}
