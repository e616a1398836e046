//! Hard iron that nobody expected, of a magnetometer that is said to be calibrated: how the field turns with the device (B19b to B19d).
//!
//! Over two seconds the Earth's field goes through the body's axes as the gyroscope says; an offset stays where it is. The difference is
//! a measurement of the offset, whatever the field, the heading and their errors are. Where many of them agree, it becomes a state.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use crate::scalar::{Scalar, lit};

/// A pair of samples is so far apart, s, ...
const APART_S: f64 = 2.0;
/// ... or by so much turning back and forth, rad.
const TURNING_RAD: f64 = 4.0;
/// A turn is off by this share of the angle, or of this share of what was turned back and forth.
const TURN_SHARE: f64 = 0.006;
const BACK_AND_FORTH: f64 = 0.3;
/// A smaller one says nothing, rad: a bias of the gyroscope that is not known would make an offset of the whole field.
const LEAST_TURN_RAD: f64 = 0.2;
/// What pairs are off by until it is known, and at least; an offset before anything is known; microtesla.
const OWN_STD_UT: f64 = 5.0;
const LEAST_STD_UT: f64 = 0.5;
const OFFSET_STD_UT: f64 = 30.0;
/// Pairs that the variance of residuals remembers, and the degrees of freedom of Student's t.
const MEMORY: u16 = 16;
const FREEDOM: f64 = 4.0;
/// So many pairs, and so much evidence (chi-square with three degrees of freedom), are enough.
const FEWEST: u16 = 6;
const EVIDENCE: f64 = 30.0;
/// It explains at least this share of what pairs are off: near a magnet the place explains more than the pose.
const EXPLAINED: f64 = 0.75;
/// Fields of a room differ from place to place: pairs are off in the same way as those beside them, so many of them like one.
const DEPENDENT: f64 = 4.0;
/// Standard deviations of an offset that is there.
const SIGMAS: f64 = 4.0;

/// Watches for an offset of the magnetometer.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct HardIronWatch<T: Scalar> {
    /// The first field of the pair under way (microtesla, body axes), and the attitude then in level axes, corrected since as the present one.
    base: Option<Vector3<T>>,
    #[cfg_attr(feature = "serde", serde(with = "crate::geometry::rotation::wxyz"))]
    level_from_base: UnitQuaternion<T>,
    /// Since then: time, s, and what was turned back and forth, rad.
    since: T,
    turning: T,
    /// Least squares of the offset.
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::rows"))]
    normal: Matrix3<T>,
    right: Vector3<T>,
    /// What it is so far, microtesla.
    offset: Vector3<T>,
    /// Squares of what pairs are off, weighed as they are there, microtesla^2.
    squares: T,
    /// Variance of a residual, per axis, microtesla^2, and how many there were.
    variance: T,
    pairs: u16,
}

/// An offset that is there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Offset<T: Scalar> {
    /// microtesla, body axes.
    pub(super) offset: Vector3<T>,
    /// microtesla^2.
    pub(super) covariance: Matrix3<T>,
}

impl<T: Scalar> Default for HardIronWatch<T> {
    fn default() -> Self {
        Self {
            base: None,
            level_from_base: UnitQuaternion::identity(),
            since: T::zero(),
            turning: T::zero(),
            normal: Matrix3::zeros(),
            right: Vector3::zeros(),
            offset: Vector3::zeros(),
            squares: T::zero(),
            variance: lit(OWN_STD_UT * OWN_STD_UT),
            pairs: 0,
        }
    }
}

impl<T: Scalar> HardIronWatch<T> {
    pub(super) fn numbers(&self) -> impl Iterator<Item = &T> {
        let vectors = self
            .base
            .iter()
            .flatten()
            .chain(&self.right)
            .chain(&self.offset);
        let scalars = [&self.since, &self.turning, &self.squares, &self.variance];
        vectors.chain(&self.normal).chain(scalars)
    }

    /// The turn of the pair under way is not known.
    pub(super) fn interrupt(&mut self) {
        self.base = None;
    }

    /// The filter has turned its attitude: that is no turn of the device.
    #[inline]
    pub(super) fn corrected(&mut self, turn: &UnitQuaternion<T>) {
        if self.base.is_some() {
            self.level_from_base = turn * self.level_from_base;
        }
    }

    /// Takes a field (microtesla, body axes), `dt` seconds after the last one, at a rate of turn (rad/s). Gives an offset larger than
    /// `least` (microtesla) that is there. A pair may `wait` for a step with less to do.
    #[inline]
    pub(super) fn field(
        &mut self,
        level_from_body: &UnitQuaternion<T>,
        field: &Vector3<T>,
        rate: T,
        dt: T,
        least: T,
        wait: bool,
    ) -> Option<Offset<T>> {
        self.since += dt;
        self.turning += rate * dt;
        let then = self.base;
        let short = self.since < lit(APART_S) && self.turning < lit(TURNING_RAD);
        if then.is_some() && (short || wait) {
            return None;
        }
        let offset = then.and_then(|then| self.pair(&then, field, level_from_body, least));
        self.base = Some(*field);
        self.level_from_base = *level_from_body;
        self.since = T::zero();
        self.turning = T::zero();
        offset
    }

    /// Two fields, and what the gyroscope says between them. With the turn `C` the offset shows as `I - C` times it, and
    /// `(I - C)^T (I - C) = 2 I - C - C^T`.
    fn pair(
        &mut self,
        then: &Vector3<T>,
        now: &Vector3<T>,
        level_from_body: &UnitQuaternion<T>,
        least: T,
    ) -> Option<Offset<T>> {
        let turn = level_from_body.inverse() * self.level_from_base;
        let angle = turn.angle();
        if angle < lit(LEAST_TURN_RAD) {
            return None;
        }
        let turn = turn.to_rotation_matrix().into_inner();
        let difference = now - turn * then;
        let residual = difference - self.offset + turn * self.offset;
        let residual2 = residual.norm_squared();
        let off = angle.max(self.turning * lit(BACK_AND_FORTH)) * lit(TURN_SHARE);
        let share = self.variance / (self.variance + off * off * then.norm_squared());
        let sigmas2 = residual2 * share / self.variance;
        let student = (lit::<T>(FREEDOM + 3.0) / (sigmas2 + lit(FREEDOM))).min(T::one());
        let weight = share * student;
        let both = turn + turn.transpose();
        self.normal += (Matrix3::from_diagonal_element(lit(2.0)) - both) * weight;
        self.right += (difference - turn.tr_mul(&difference)) * weight;
        self.squares += difference.norm_squared() * weight;
        self.pairs = self.pairs.saturating_add(1);
        let memory = lit::<T>(f64::from(self.pairs.min(MEMORY)) + 1.0);
        // While it is not known how far pairs are off, none is off by too much.
        let counts = if self.pairs < MEMORY { share } else { weight };
        self.variance += (residual2 * counts / lit(3.0) - self.variance) / memory;
        self.variance = self.variance.max(lit(LEAST_STD_UT * LEAST_STD_UT));
        self.fit(least)
    }

    /// The offset that all pairs say, and whether it is there.
    fn fit(&mut self, least: T) -> Option<Offset<T>> {
        let prior = self.variance / lit(OFFSET_STD_UT * OFFSET_STD_UT);
        let normal = self.normal + Matrix3::from_diagonal_element(prior);
        let inverse = normal.try_inverse()?;
        self.offset = inverse * self.right;
        let offset = self.offset;
        let (size2, explained) = (offset.norm_squared(), self.right.dot(&offset));
        let may_be = self.pairs >= FEWEST
            && size2 > least * least
            && explained > self.variance * lit(EVIDENCE)
            && explained > self.squares * lit(EXPLAINED);
        if !may_be {
            return None;
        }
        let own = inverse * self.variance;
        let along = offset.dot(&(own * offset)) * lit(SIGMAS * SIGMAS);
        let covariance = own * lit::<T>(DEPENDENT);
        (along < size2 * size2).then_some(Offset { offset, covariance })
    }
}

#[cfg(test)]
mod tests {
    use rand::RngExt as _;
    use rand_distr::StandardNormal;
    use rand_pcg::Pcg64;

    use super::*;
    use crate::geometry::so3;

    const LEAST_UT: f64 = 5.0;

    /// A device that turns about all axes, or sways only, for so many seconds, in axes that a bias of the gyroscope (rad/s) turns away; after
    /// how many seconds an offset of its magnetometer is found, and what it is found to be.
    fn found(
        seconds: f64,
        swing_rad: f64,
        hard_iron: &Vector3<f64>,
        noise_ut: f64,
        bias: f64,
    ) -> Option<(f64, Offset<f64>)> {
        let (mut watch, mut draws, dt) = (HardIronWatch::default(), Pcg64::new(3, 5), 0.04);
        let field = Vector3::new(0.0, 20.0, -40.0);
        let attitude = |t: f64| {
            let angles = [0.5, 0.3, 0.21].map(|rate: f64| swing_rad * (rate * t).sin());
            so3::exp(&Vector3::z_axis().scale(angles[0]))
                * so3::exp(&Vector3::y_axis().scale(angles[1]))
                * so3::exp(&Vector3::x_axis().scale(angles[2]))
        };
        for k in 0..(seconds / dt) as u32 {
            let t = f64::from(k) * dt;
            let truth = attitude(t);
            let mut noise = || noise_ut * draws.sample::<f64, _>(StandardNormal);
            let noise = Vector3::new(noise(), noise(), noise());
            let measured = truth.inverse() * field + hard_iron + noise;
            let thought = truth * so3::exp(&Vector3::new(bias * t, 0.0, 0.0));
            let rate = (attitude(t + dt).inverse() * truth).angle() / dt;
            if let Some(offset) = watch.field(&thought, &measured, rate, dt, LEAST_UT, false) {
                return Some((t, offset));
            }
        }
        None
    }

    #[test]
    fn an_offset_is_found_where_the_device_turns() {
        let hard_iron = Vector3::new(9.0, -6.0, 7.0);
        let (after_s, found) = found(120.0, 1.5, &hard_iron, 0.5, 0.0).unwrap();
        assert!(after_s < 40.0, "{after_s}");
        let error = found.offset - hard_iron;
        let nees = error.dot(&(found.covariance.try_inverse().unwrap() * error));
        assert!(error.norm() < 1.5 && nees < 16.0, "{error} {nees}");
    }

    #[test]
    fn what_is_no_offset_is_not_found() {
        let none = Vector3::zeros();
        // Noise, a small offset, a device that hardly turns, a gyroscope whose bias is off by three degrees a second.
        assert_eq!(found(600.0, 1.5, &none, 10.0, 0.0), None);
        assert_eq!(
            found(600.0, 1.5, &Vector3::new(2.0, -1.0, 1.0), 0.5, 0.0),
            None
        );
        assert_eq!(
            found(600.0, 0.05, &Vector3::new(9.0, -6.0, 7.0), 0.5, 0.0),
            None
        );
        assert_eq!(found(600.0, 0.0, &none, 0.5, 0.05), None);
    }

    /// GIVEN a pair under way WHEN the filter corrects its attitude THEN the pair says what it would have said.
    #[test]
    fn a_correction_is_no_turn() {
        let field = Vector3::new(0.0, 20.0, -40.0);
        let run = |correct: bool| {
            let (mut watch, mut off) =
                (HardIronWatch::<f64>::default(), UnitQuaternion::identity());
            for k in 0..400 {
                let t = f64::from(k) * 0.04;
                let truth = so3::exp(&Vector3::new(0.0, 1.0 * (0.7 * t).sin(), 0.4 * t));
                let measured = truth.inverse() * field + Vector3::new(1.0, 2.0, 3.0);
                watch.field(&(off * truth), &measured, 0.6, 0.04, 1e3, false);
                if correct {
                    let turn = so3::exp(&Vector3::new(0.001, -0.002, 0.01));
                    watch.corrected(&turn);
                    off = turn * off;
                }
            }
            watch.offset
        };
        let (free, corrected) = (run(false), run(true));
        assert!((free - corrected).norm() < 1e-9, "{free} {corrected}");
        assert!((free - Vector3::new(1.0, 2.0, 3.0)).norm() < 0.2, "{free}");
    }
}
