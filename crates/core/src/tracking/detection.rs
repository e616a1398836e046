//! What radar, lidar, camera and AIS report, and what a target and an uncertain own ship would
//! have made them report.
//!
//! Read first: `docs/derivations/association.md`, section 1 (equations D1 to D5).
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | `z` | [`Detection`] | m, rad |
//! | `H_t` | [`Prediction::target_jacobian`] | by the target's five states |
//! | `H_o` | [`Prediction::pose_jacobian`] | by north, east, heading of the own ship |
//! | `R` | [`Prediction::noise`] | m^2, rad^2 |
//! | `X` | cross-covariance of target and own ship, target rows | |
//! | `S` | [`SchmidtInnovation::covariance`] | |

use nalgebra::{Matrix2, Matrix2x3, Matrix3x2, SMatrix, Vector2};

use super::FARTHEST;
use super::coordinated_turn::{STATES, TargetCovariance, TargetState};
use super::echo::EchoCovariance;
use super::own_ship::OwnShip;
use super::radar::MOST_BEARING_RAD;
use crate::geometry::trigonometry::wrap;
use crate::scalar::{Scalar, lit};

/// Cross-covariance of a target's error with the own ship's (north, east, heading).
pub type CrossCovariance<T> = SMatrix<T, STATES, 3>;

/// One detection, not yet assigned to a target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Detection<T> {
    /// Radar or lidar: range and bearing from the own ship.
    RangeBearing {
        /// Distance, m.
        range_m: T,
        /// Angle clockwise from the bow as the own ship's heading has it, rad.
        bearing_rad: T,
    },
    /// Camera: bearing only.
    Bearing {
        /// Angle clockwise from the bow as the own ship's heading has it, rad.
        bearing_rad: T,
    },
    /// AIS: the target's own position, independent of the own ship's errors.
    Position {
        /// North, m.
        north_m: T,
        /// East, m.
        east_m: T,
    },
}

/// Noise of a sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct DetectionNoise<T> {
    /// Range, m.
    pub range_std_m: T,
    /// Bearing, rad.
    pub bearing_std_rad: T,
    /// Where on a target's hull the echo comes from (and a reported position's error), m, on each
    /// axis. Bounds how precise a bearing is at short range.
    pub extent_std_m: T,
}

/// What was measured minus what a target would have caused, with the Jacobians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prediction<T> {
    /// Measured minus predicted, angles wrapped. A bearing stands first, its second row is empty.
    pub residual: Vector2<T>,
    /// By the target's states.
    pub target_jacobian: SMatrix<T, 2, STATES>,
    /// By the own ship's north, east, heading.
    pub pose_jacobian: Matrix2x3<T>,
    /// Noise of the sensor; the empty row of a bearing has one, which changes nothing.
    pub noise: Matrix2<T>,
    /// Components measured: 1 or 2.
    pub degrees_of_freedom: u8,
}

/// A detection weighed against one target with the uncertainty of target, own ship and sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SchmidtInnovation<T> {
    /// Measured minus predicted.
    pub residual: Vector2<T>,
    /// `S = H_t P H_t' + H_t X H_o' + H_o X' H_t' + H_o P_o H_o' + R`.
    pub covariance: Matrix2<T>,
    /// `residual' S^-1 residual`.
    pub nis: T,
    /// Probability density of the residual, in 1/(unit of the measurement).
    pub likelihood: T,
    /// `K = (P H_t' + X H_o') S^-1`: moves the target, never the own ship.
    pub gain: SMatrix<T, STATES, 2>,
    /// `X' H_t' + P_o H_o'`: what the own ship would have learned; keeps `X` exact.
    pub pose_covariance: Matrix3x2<T>,
    /// `E' H_t' + P_e H_e'`: the same of the place where the echo comes from; `None` where that is new in every scan.
    pub echo_covariance: Option<Matrix2<T>>,
    /// Components measured.
    pub degrees_of_freedom: u8,
}

impl<T: Scalar> Detection<T> {
    /// Whether every number is finite and a range is positive.
    pub fn is_valid(&self) -> bool {
        match *self {
            Self::RangeBearing {
                range_m,
                bearing_rad,
            } => {
                range_m > T::zero()
                    && range_m <= lit(FARTHEST)
                    && bearing_rad.abs() <= lit(MOST_BEARING_RAD)
            }
            Self::Bearing { bearing_rad } => bearing_rad.abs() <= lit(MOST_BEARING_RAD),
            Self::Position { north_m, east_m } => {
                north_m.abs() <= lit(FARTHEST) && east_m.abs() <= lit(FARTHEST)
            }
        }
    }

    /// What it consists of.
    pub fn kind(&self) -> DetectionKind {
        match self {
            Self::RangeBearing { .. } => DetectionKind::RangeBearing,
            Self::Bearing { .. } => DetectionKind::Bearing,
            Self::Position { .. } => DetectionKind::Position,
        }
    }

    /// Compares with a target at `x`; `None` when target and own ship are in one place and the
    /// bearing has no direction.
    pub fn predict(
        &self,
        x: &TargetState<T>,
        own: &OwnShip<T>,
        noise: &DetectionNoise<T>,
    ) -> Option<Prediction<T>> {
        let (expected, mut out) = self.kind().predict(x, own, noise)?;
        out.residual = self.minus(&expected);
        Some(out)
    }

    /// This minus an expected one of its kind, angles wrapped.
    pub(super) fn minus(&self, expected: &Vector2<T>) -> Vector2<T> {
        let measured = match *self {
            Self::RangeBearing {
                range_m,
                bearing_rad,
            } => Vector2::new(range_m, bearing_rad),
            Self::Bearing { bearing_rad } => Vector2::new(bearing_rad, T::zero()),
            Self::Position { north_m, east_m } => Vector2::new(north_m, east_m),
        };
        self.kind().difference(&measured, expected)
    }
}

/// What a detection consists of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum DetectionKind {
    /// [`Detection::RangeBearing`].
    RangeBearing,
    /// [`Detection::Bearing`].
    Bearing,
    /// [`Detection::Position`].
    Position,
}

impl DetectionKind {
    /// One detection of this kind less another, or one residual less another; angles wrapped.
    #[inline]
    pub(super) fn difference<T: Scalar>(self, a: &Vector2<T>, b: &Vector2<T>) -> Vector2<T> {
        let change = a - b;
        match self {
            Self::RangeBearing => Vector2::new(change.x, wrap(change.y)),
            Self::Bearing => Vector2::new(wrap(change.x), change.y),
            Self::Position => change,
        }
    }

    /// The detection that a target at `x` causes without noise, its components in the order of the residual, and a
    /// prediction without residual. `None` where target and own ship are in one place and the bearing has no direction.
    pub(super) fn predict<T: Scalar>(
        self,
        x: &TargetState<T>,
        own: &OwnShip<T>,
        noise: &DetectionNoise<T>,
    ) -> Option<(Vector2<T>, Prediction<T>)> {
        let extent = noise.extent_std_m * noise.extent_std_m;
        if self == Self::Position {
            return Some((Vector2::new(x[0], x[2]), position(extent)));
        }
        let (dn, de) = (x[0] - own.north_m, x[2] - own.east_m);
        let r2 = dn * dn + de * de;
        if !(r2 > lit::<T>(1e-6) && r2.is_finite()) {
            return None;
        }
        let r = r2.sqrt();
        let bearing = de.atan2(dn) - own.heading_rad;
        let bearing_variance = noise.bearing_std_rad * noise.bearing_std_rad + extent / r2;
        // (D2): rows by north and east of the target; the own ship's are the opposite
        let (range_row, bearing_row) = ([dn / r, de / r], [-de / r2, dn / r2]);
        let mut out = Prediction {
            residual: Vector2::zeros(),
            target_jacobian: SMatrix::zeros(),
            pose_jacobian: Matrix2x3::zeros(),
            noise: Matrix2::identity(),
            degrees_of_freedom: 2,
        };
        let mut expected = Vector2::new(r, bearing);
        let mut bearing_at = 1;
        if self == Self::RangeBearing {
            out.set_row(0, range_row);
            out.noise[(0, 0)] = noise.range_std_m * noise.range_std_m + extent;
        } else {
            out.degrees_of_freedom = 1;
            expected = Vector2::new(bearing, T::zero());
            bearing_at = 0;
        }
        out.set_row(bearing_at, bearing_row);
        out.pose_jacobian[(bearing_at, 2)] = -T::one();
        out.noise[(bearing_at, bearing_at)] = bearing_variance;
        Some((expected, out))
    }
}

fn position<T: Scalar>(variance: T) -> Prediction<T> {
    let mut target_jacobian = SMatrix::zeros();
    target_jacobian[(0, 0)] = T::one();
    target_jacobian[(1, 2)] = T::one();
    Prediction {
        residual: Vector2::zeros(),
        target_jacobian,
        pose_jacobian: Matrix2x3::zeros(),
        noise: Matrix2::identity() * variance,
        degrees_of_freedom: 2,
    }
}

impl<T: Scalar> Prediction<T> {
    fn set_row(&mut self, row: usize, [north, east]: [T; 2]) {
        self.target_jacobian[(row, 0)] = north;
        self.target_jacobian[(row, 2)] = east;
        self.pose_jacobian[(row, 0)] = -north;
        self.pose_jacobian[(row, 1)] = -east;
    }

    /// Weighs the residual; `None` when its covariance is not positive.
    pub fn weigh(
        &self,
        p: &TargetCovariance<T>,
        x: &CrossCovariance<T>,
        own: &OwnShip<T>,
    ) -> Option<SchmidtInnovation<T>> {
        let none = (&EchoCovariance::zeros(), T::zero());
        self.scale(p, x, own, none)?.innovation(self.residual)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use nalgebra::SVector;
    use num_dual::jacobian;
    use proptest::prelude::*;

    fn noise<D: Scalar>() -> DetectionNoise<D> {
        DetectionNoise {
            range_std_m: lit(5.0),
            bearing_std_rad: lit(0.03),
            extent_std_m: lit(2.0),
        }
    }

    /// Residual of a detection of the origin's north, by target and pose, negated: the prediction.
    fn predicted<D: Scalar>(kind: u8, v: &SVector<D, 8>) -> Vector2<D> {
        let detection = match kind {
            0 => Detection::RangeBearing {
                range_m: lit(100.0),
                bearing_rad: lit(0.0),
            },
            1 => Detection::Bearing {
                bearing_rad: lit(0.0),
            },
            _ => Detection::Position {
                north_m: lit(0.0),
                east_m: lit(0.0),
            },
        };
        let target = v.fixed_rows::<5>(0).into_owned();
        let own = OwnShip::exact(v[5], v[6], v[7]);
        -detection.predict(&target, &own, &noise()).unwrap().residual
    }

    proptest! {
    #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(27), ..ProptestConfig::default() })]
            #[test]
            fn jacobians_equal_dual_numbers(
                v in prop::array::uniform8(-50.0..50.0f64), kind in 0..3u8, heading in -1.0..1.0f64,
            ) {
                let mut v = SVector::from(v);
                v[7] = heading;
                let (dn, de) = (v[0] - v[5], v[2] - v[6]);
                let bearing = wrap(f64::atan2(de, dn) - heading);
                prop_assume!(dn.hypot(de) > 1.0 && bearing.abs() < 3.0);
                let (_, expected) = jacobian(|w| predicted(kind, &w), &v);
                let own = OwnShip::exact(v[5], v[6], v[7]);
                let detection = match kind {
                    0 => Detection::RangeBearing { range_m: 1.0, bearing_rad: 0.0 },
                    1 => Detection::Bearing { bearing_rad: 0.0 },
                    _ => Detection::Position { north_m: 0.0, east_m: 0.0 },
                };
                let p = detection
                    .predict(&v.fixed_rows::<5>(0).into_owned(), &own, &noise())
                    .unwrap();
                prop_assert!((p.target_jacobian - expected.fixed_columns::<5>(0)).abs().max() < 1e-9);
                prop_assert!((p.pose_jacobian - expected.fixed_columns::<3>(5)).abs().max() < 1e-9);
            }
        }

    #[test]
    fn innovation_equals_the_joint_filter_of_target_and_pose() {
        let mut joint = SMatrix::<f64, 8, 8>::from_fn(|i, j| {
            0.3 * ((i * 7 + j * 3) as f64).sin() + if i == j { 3.0 } else { 0.0 }
        });
        joint = joint * joint.transpose();
        let own = OwnShip {
            covariance: joint.fixed_view::<3, 3>(5, 5).into_owned(),
            ..OwnShip::exact(1.0, 2.0, 0.1)
        };
        let target = TargetState::from([60.0, 1.0, 80.0, 0.0, 0.0]);
        let detection = Detection::RangeBearing {
            range_m: 103.0,
            bearing_rad: 0.8,
        };
        let prediction = detection.predict(&target, &own, &noise()).unwrap();
        let mut h = SMatrix::<f64, 2, 8>::zeros();
        h.fixed_columns_mut::<5>(0)
            .copy_from(&prediction.target_jacobian);
        h.fixed_columns_mut::<3>(5)
            .copy_from(&prediction.pose_jacobian);
        let s = h * joint * h.transpose() + prediction.noise;
        let k = joint * h.transpose() * s.try_inverse().unwrap();
        let i = prediction
            .weigh(
                &joint.fixed_view::<5, 5>(0, 0).into_owned(),
                &joint.fixed_view::<5, 3>(0, 5).into_owned(),
                &own,
            )
            .unwrap();
        assert_relative_eq!(i.covariance, s, epsilon = 1e-9, max_relative = 1e-9);
        let gain = k.fixed_rows::<5>(0).into_owned();
        assert_relative_eq!(i.gain, gain, epsilon = 1e-9, max_relative = 1e-9);
        let density = (-0.5 * i.nis).exp() / (core::f64::consts::TAU * s.determinant().sqrt());
        assert_relative_eq!(i.likelihood, density, max_relative = 1e-9);
    }

    #[test]
    fn a_target_on_the_own_ship_has_no_bearing() {
        let own = OwnShip::exact(3.0, 4.0, 0.0_f64);
        let target = TargetState::from([3.0, 1.0, 4.0, 1.0, 0.0]);
        let radar = Detection::RangeBearing {
            range_m: 1.0,
            bearing_rad: 0.0,
        };
        let camera = Detection::Bearing { bearing_rad: 0.0 };
        assert!(radar.predict(&target, &own, &noise()).is_none());
        assert!(camera.predict(&target, &own, &noise()).is_none());
    }

    #[test]
    fn a_covariance_that_is_not_positive_weighs_nothing() {
        let own = OwnShip::exact(0.0, 0.0, 0.0_f64);
        let target = TargetState::from([30.0, 0.0, 40.0, 0.0, 0.0]);
        let camera = Detection::Bearing { bearing_rad: 0.9 };
        let p = camera.predict(&target, &own, &noise()).unwrap();
        for bad in [-1e9, f64::NAN] {
            let covariance = TargetCovariance::identity() * bad;
            assert!(
                p.weigh(&covariance, &CrossCovariance::zeros(), &own)
                    .is_none()
            );
        }
    }
}
