//! The linearised measurements of the multiplicative filters: rows, residuals, noise, record.
//!
//! Read first: `docs/derivations/mekf.md`, M9-M11 (vector), M17 (heading), M17e (compass). The predicted vector
//! makes the row, not the measured one: the measured one is noisy, and its sign convention is the
//! classical mistake.

use nalgebra::{Matrix3, SMatrix, SVector, UnitQuaternion, Vector3};

use super::config::{AttitudeConfig, MagnetometerUse};
use super::heading::{CompassHeading, Heading, HeadingReference};
use super::vector_sensor::{References, VectorSensor, Weighed};
use crate::kalman::innovation::{Innovation, SkipReason};
use crate::kalman::scalar_update::{update_cross_product, update_leading3};
use crate::restorable::{InvalidState, finite};
use crate::scalar::Scalar;

/// Accelerometer and magnetometer as a filter sees them; part of a filter's state.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct VectorSensors<T: Scalar> {
    /// Reference, gate and history of the accelerometer.
    pub accelerometer: VectorSensor<T>,
    /// Reference, gate and history of the magnetometer.
    pub magnetometer: VectorSensor<T>,
    /// Gate and history of the compass.
    pub compass: VectorSensor<T>,
    /// What a heading is measured against; `None` without a magnetic reference.
    pub heading: Option<HeadingReference<T>>,
    magnetometer_use: MagnetometerUse,
}

impl<T: Scalar> VectorSensors<T> {
    /// Whether a saved one can be continued from.
    pub(super) fn check(&self) -> Result<(), InvalidState> {
        self.accelerometer.check("accelerometer")?;
        self.magnetometer.check("magnetometer")?;
        self.compass.check("compass")?;
        let heading = self.heading.iter().flat_map(HeadingReference::numbers);
        finite("heading reference", heading)
    }
}

/// One measurement, ready for scalar updates on the local attitude error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinearMeasurement<T: Scalar> {
    /// The record to return.
    pub innovation: Innovation<T>,
    /// Rows on the attitude error; as many count as the innovation has degrees of freedom.
    pub rows: [Vector3<T>; 3],
    /// The predicted vector `v`, where the rows are those of `[v]x`.
    pub predicted: Option<Vector3<T>>,
    /// Noise variance per row; `None` when the measurement is not to be fused.
    pub variance: Option<T>,
}

impl<T: Scalar> LinearMeasurement<T> {
    fn skipped(reason: SkipReason) -> Self {
        let innovation = Innovation::skipped(reason);
        Self {
            innovation,
            rows: [Vector3::zeros(); 3],
            predicted: None,
            variance: None,
        }
    }

    /// Fuses it into a covariance and a pending correction whose first three states are the local
    /// attitude error; `false` when it is not to be fused or numerics refuse it.
    #[inline]
    pub fn fuse<const N: usize>(
        &self,
        covariance: &mut SMatrix<T, N, N>,
        correction: &mut SVector<T, N>,
    ) -> bool {
        let Some(variance) = self.variance else {
            return false;
        };
        let residual = &self.innovation.residual;
        match &self.predicted {
            Some(v) => update_cross_product(covariance, correction, v, residual, variance),
            None => update_leading3(covariance, correction, &self.rows[0], residual.x, variance),
        }
    }

    /// Row, residual and variance of each scalar to fuse; nothing when it is not to be fused.
    #[inline]
    pub fn scalars(&self) -> impl Iterator<Item = (&Vector3<T>, T, T)> {
        let count = if self.variance.is_some() {
            usize::from(self.innovation.degrees_of_freedom)
        } else {
            0
        };
        let r = self.variance.unwrap_or_else(T::zero);
        let residuals = self.innovation.residual.iter();
        self.rows
            .iter()
            .zip(residuals)
            .take(count)
            .map(move |(row, z)| (row, *z, r))
    }

    /// The record, or that of a measurement that numerics refused unless `fused`.
    #[inline]
    pub fn conclude(&self, fused: bool) -> Innovation<T> {
        if self.variance.is_some() && !fused {
            Innovation::skipped(SkipReason::Numerical)
        } else {
            self.innovation
        }
    }
}

impl<T: Scalar> VectorSensors<T> {
    /// Sensors without references, as `config` describes them.
    pub fn new(config: &AttitudeConfig<T>) -> Self {
        Self {
            accelerometer: VectorSensor::accelerometer(config),
            magnetometer: VectorSensor::magnetometer(config),
            compass: VectorSensor::compass(config),
            heading: None,
            magnetometer_use: config.magnetometer_use,
        }
    }

    /// Sets the references and forgets gates and history.
    pub fn start(&mut self, references: &References<T>) {
        self.accelerometer.start(Some(references.specific_force));
        self.magnetometer.start(references.magnetic_field);
        self.compass.start(None);
        self.heading = HeadingReference::new(references);
    }

    /// Lets `dt` seconds pass.
    #[inline]
    pub fn advance(&mut self, dt: T) {
        self.accelerometer.advance(dt);
        self.magnetometer.advance(dt);
        self.compass.advance(dt);
    }

    /// The accelerometer's measurement at `attitude` with error covariance `p` (body axes).
    #[inline]
    pub fn accelerometer(
        &mut self,
        attitude: &UnitQuaternion<T>,
        p: &Matrix3<T>,
        measured: &Vector3<T>,
    ) -> LinearMeasurement<T> {
        vector(&mut self.accelerometer, attitude, p, measured)
    }

    /// The magnetometer's measurement at `attitude` with error covariance `p` (body axes).
    #[inline]
    pub fn magnetometer(
        &mut self,
        attitude: &UnitQuaternion<T>,
        p: &Matrix3<T>,
        measured: &Vector3<T>,
    ) -> LinearMeasurement<T> {
        match self.magnetometer_use {
            MagnetometerUse::Vector => vector(&mut self.magnetometer, attitude, p, measured),
            MagnetometerUse::Heading => heading(
                &mut self.magnetometer,
                self.heading.as_ref(),
                attitude,
                p,
                measured,
            ),
        }
    }
}

impl<T: Scalar> VectorSensors<T> {
    /// The compass's measurement at `attitude` with error covariance `p` (body axes). Its noise is
    /// what the device states, and at least what the configuration does.
    #[inline]
    pub fn compass(
        &mut self,
        attitude: &UnitQuaternion<T>,
        p: &Matrix3<T>,
        measured: &CompassHeading<T>,
    ) -> LinearMeasurement<T> {
        match measured.measure(attitude) {
            Ok(heading) => {
                let variance = heading.variance.max(self.compass.variance());
                scalar(
                    &mut self.compass,
                    &Heading {
                        variance,
                        ..heading
                    },
                    p,
                )
            }
            Err(reason) => LinearMeasurement::skipped(reason),
        }
    }
}

/// All three components: `residual = y - v`, `H = [v]x` with `v = q^-1 ref` (M9, M10).
#[inline]
fn vector<T: Scalar>(
    sensor: &mut VectorSensor<T>,
    attitude: &UnitQuaternion<T>,
    p: &Matrix3<T>,
    measured: &Vector3<T>,
) -> LinearMeasurement<T> {
    let reference = match sensor.reference_for(measured) {
        Ok(reference) => reference,
        Err(reason) => return LinearMeasurement::skipped(reason),
    };
    let v = attitude.inverse() * reference;
    let zero = T::zero();
    let rows = [
        Vector3::new(zero, -v.z, v.y),
        Vector3::new(v.z, zero, -v.x),
        Vector3::new(-v.y, v.x, zero),
    ];
    let predicted = predicted_covariance(&v, p);
    let variance = sensor.sample_variance(measured);
    let Weighed {
        innovation,
        variance,
    } = sensor.weigh(measured - v, &predicted, variance);
    LinearMeasurement {
        innovation,
        rows,
        predicted: Some(v),
        variance,
    }
}

/// `[v]x P [v]x^T`: what the attitude's uncertainty does to the predicted vector. Two rounds of
/// cross products with the columns, since `P` is symmetric.
#[inline]
fn predicted_covariance<T: Scalar>(v: &Vector3<T>, p: &Matrix3<T>) -> Matrix3<T> {
    let turned = [
        cross_column(v, p, 0),
        cross_column(v, p, 1),
        cross_column(v, p, 2),
    ];
    let row = |i: usize| v.cross(&Vector3::new(turned[0][i], turned[1][i], turned[2][i]));
    Matrix3::from_columns(&[row(0), row(1), row(2)])
}

#[inline]
fn cross_column<T: Scalar>(v: &Vector3<T>, p: &Matrix3<T>, j: usize) -> Vector3<T> {
    v.cross(&Vector3::new(p[(0, j)], p[(1, j)], p[(2, j)]))
}

/// The heading alone: `residual` about up, `h` = up in body axes (M17).
#[inline]
fn heading<T: Scalar>(
    sensor: &mut VectorSensor<T>,
    reference: Option<&HeadingReference<T>>,
    attitude: &UnitQuaternion<T>,
    p: &Matrix3<T>,
    measured: &Vector3<T>,
) -> LinearMeasurement<T> {
    if let Err(reason) = sensor.reference_for(measured) {
        return LinearMeasurement::skipped(reason);
    }
    match reference.and_then(|r| r.measure(attitude, measured, sensor)) {
        Some(heading) => scalar(sensor, &heading, p),
        None => LinearMeasurement::skipped(SkipReason::Unobservable),
    }
}

/// One row, weighed by its sensor.
#[inline]
fn scalar<T: Scalar>(
    sensor: &mut VectorSensor<T>,
    heading: &Heading<T>,
    p: &Matrix3<T>,
) -> LinearMeasurement<T> {
    let Heading {
        residual,
        variance,
        row,
    } = *heading;
    let Weighed {
        innovation,
        variance,
    } = sensor.weigh_scalar(residual, row.dot(&(p * row)), variance);
    let rows = [row, Vector3::zeros(), Vector3::zeros()];
    LinearMeasurement {
        innovation,
        rows,
        predicted: None,
        variance,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::so3;
    use approx::assert_relative_eq;
    use nalgebra::SVector;
    use num_dual::{DualSVec64, jacobian};

    /// `z = C(q dq(a)) ref` linearised: `H = +[v]x`, for both parametrisations of the error.
    #[test]
    fn vector_rows_equal_dual_numbers() {
        let reference = Vector3::new(3.0, -20.0, 40.0);
        for r in [
            Vector3::zeros(),
            Vector3::new(0.4, -1.2, 2.0),
            Vector3::new(3.0, 0.5, -0.1),
        ] {
            let q = so3::exp(&r);
            let predict = |turn: fn(&Vector3<DualSVec64<3>>) -> UnitQuaternion<DualSVec64<3>>| {
                jacobian(
                    |a: SVector<DualSVec64<3>, 3>| {
                        (q.cast::<DualSVec64<3>>() * turn(&a)).inverse()
                            * reference.map(DualSVec64::from)
                    },
                    &Vector3::zeros(),
                )
                .1
            };
            let mut sensors = VectorSensors::new(&AttitudeConfig::lab());
            sensors.start(&References {
                specific_force: reference,
                magnetic_field: None,
            });
            let v = q.inverse() * reference;
            let m = sensors.accelerometer(&q, &Matrix3::identity(), &v);
            let rows = Matrix3::from_rows(&m.rows.map(|row| row.transpose()));
            assert_relative_eq!(rows, predict(so3::exp), epsilon = 1e-12);
            assert_relative_eq!(rows, predict(so3::from_gibbs), epsilon = 1e-12);
            assert_relative_eq!(rows, so3::skew(&v), epsilon = 1e-12);
        }
    }

    #[test]
    fn predicted_covariance_is_the_matrix_product() {
        let m = Matrix3::from_fn(|i, j| ((2 * i + 5 * j) as f64).sin());
        let (p, v) = (m * m.transpose(), Vector3::new(1.0, -2.0, 3.0));
        let h = so3::skew(&v);
        assert_relative_eq!(
            predicted_covariance(&v, &p),
            h * p * h.transpose(),
            epsilon = 1e-13
        );
    }

    #[test]
    fn innovation_covariance_is_hph_plus_r() {
        let mut sensors = VectorSensors::new(&AttitudeConfig::lab());
        let up = Vector3::new(0.0, 0.0, 10.0);
        sensors.start(&References {
            specific_force: up,
            magnetic_field: None,
        });
        let p = Matrix3::from_diagonal(&Vector3::new(0.01, 0.02, 0.03));
        let m = sensors.accelerometer(&UnitQuaternion::identity(), &p, &up);
        let expected = Matrix3::from_diagonal(&Vector3::new(2.0025, 1.0025, 0.0025));
        assert_relative_eq!(m.innovation.covariance, expected, epsilon = 1e-12);
        assert_relative_eq!(m.innovation.nis, 0.0, epsilon = 1e-12);
        assert_eq!(m.scalars().count(), 3);
    }
}
