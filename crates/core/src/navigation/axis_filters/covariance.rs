//! The covariance of position, velocity and bias of one axis: six numbers, propagated and updated without
//! the zeros of its matrices. Equation numbers are those of the parent module.

use nalgebra::{Matrix3, Vector3};

use crate::kalman::covariance::rounding_reserve;
use crate::scalar::{Scalar, lit};

/// Largest variances: position m^2, velocity m^2/s^2, bias m^2/s^4. Beyond nothing is known.
const LARGEST: [f64; 3] = [1e10, 1e6, 100.0];

/// The upper triangle; `s` position, `v` velocity, `b` bias.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct AxisCovariance<T> {
    pub(super) ss: T,
    sv: T,
    sb: T,
    vv: T,
    vb: T,
    bb: T,
}

/// What a step of one length adds (A7).
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct AxisProcess<T> {
    ss: T,
    sv: T,
    vv: T,
    bb: T,
}

impl<T: Scalar> AxisProcess<T> {
    pub(super) fn numbers(&self) -> [&T; 4] {
        [&self.ss, &self.sv, &self.vv, &self.bb]
    }

    /// Of an acceleration with a variance of one, held over `dt` seconds, and a bias that walks as much.
    pub(super) fn of_ones_over(dt: T) -> Self {
        let vv = dt * dt;
        let half = vv * lit(0.5);
        Self {
            ss: half * half,
            sv: half * dt,
            vv,
            bb: dt,
        }
    }

    /// The same for this variance of the acceleration, and this one that a second adds to the bias.
    pub(super) fn scaled(&self, [acceleration, walk]: [T; 2]) -> Self {
        Self {
            ss: self.ss * acceleration,
            sv: self.sv * acceleration,
            vv: self.vv * acceleration,
            bb: self.bb * walk,
        }
    }
}

impl<T: Scalar> AxisCovariance<T> {
    pub(super) fn starting_at(position: T) -> Self {
        let zero = T::zero();
        Self {
            ss: position,
            sv: zero,
            sb: zero,
            vv: T::one(),
            vb: zero,
            bb: lit(0.1),
        }
    }

    pub(super) fn matrix(&self) -> Matrix3<T> {
        let Self {
            ss,
            sv,
            sb,
            vv,
            vb,
            bb,
        } = *self;
        Matrix3::new(ss, sv, sb, sv, vv, vb, sb, vb, bb)
    }

    /// `A P A^T + Q` (A6). Rows of `A P` and columns of `A P A^T` are made from the last to the first:
    /// `v - T b`, then `s + T/2 (v + (v - T b))`.
    pub(super) fn propagate(&mut self, dt: T, noise: &AxisProcess<T>) {
        let half = dt * lit(0.5);
        let p = *self;
        // The column of the bias.
        let vb = p.vb - dt * p.bb;
        let vb_sum = p.vb + vb;
        let sb = p.sb + half * vb_sum;
        // Rows of velocity and position, before their columns.
        let row_vv = p.vv - dt * p.vb;
        let row_vs = p.sv - dt * p.sb;
        let row_sv = p.sv + half * (p.vv + row_vv);
        let sv = row_sv - dt * sb;
        *self = Self {
            ss: p.ss + half * ((p.sv + row_vs) + (row_sv + sv)) + noise.ss,
            sv: sv + noise.sv,
            sb,
            vv: p.vv - dt * vb_sum + noise.vv,
            vb,
            bb: p.bb + noise.bb,
        };
        // One by one: a loop over the table would convert at run time.
        let [ss, vv, bb]: [T; 3] = [lit(LARGEST[0]), lit(LARGEST[1]), lit(LARGEST[2])];
        if self.ss > ss || self.vv > vv || self.bb > bb {
            self.cap([ss, vv, bb]);
        }
    }

    /// Holds variances where numbers still mean something; correlations stay.
    fn cap(&mut self, limits: [T; 3]) {
        let scale = |variance: T, limit: T| {
            if variance > limit {
                (limit / variance).sqrt()
            } else {
                T::one()
            }
        };
        let [ss, vv, bb] = limits;
        let (s, v, b) = (scale(self.ss, ss), scale(self.vv, vv), scale(self.bb, bb));
        self.ss *= s * s;
        self.sv *= s * v;
        self.sb *= s * b;
        self.vv *= v * v;
        self.vb *= v * b;
        self.bb *= b * b;
    }

    /// Takes a position of variance `r` into account, `inverse` being that of `ss + r`. Gives the gain.
    pub(super) fn update(&mut self, r: T, inverse: T) -> Vector3<T> {
        let p = *self;
        let gain = Vector3::new(p.ss, p.sv, p.sb) * inverse;
        *self = Self {
            // (1 - ss / (ss + r)) of the first row, without the difference.
            ss: r * gain.x,
            sv: r * gain.y,
            sb: r * gain.z,
            vv: p.vv - gain.y * p.sv + rounding_reserve(gain.y * p.sv),
            vb: p.vb - gain.y * p.sb,
            bb: p.bb - gain.z * p.sb + rounding_reserve(gain.z * p.sb),
        };
        gain
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against the matrices themselves.
    #[test]
    fn six_numbers_do_what_the_matrices_do() {
        let mut p = AxisCovariance {
            ss: 3.0_f64,
            sv: 0.7,
            sb: -0.2,
            vv: 1.3,
            vb: 0.1,
            bb: 0.4,
        };
        let (r, noise) = (2.0, [1.7, 0.3]);
        for dt in [0.02, 0.5, 2.0] {
            let half = dt * dt * 0.5;
            let a = Matrix3::new(1.0, dt, -half, 0.0, 1.0, -dt, 0.0, 0.0, 1.0);
            let input = Vector3::new(half, dt, 0.0);
            let mut dense = a * p.matrix() * a.transpose() + input * input.transpose() * noise[0];
            dense.m33 += noise[1] * dt;
            p.propagate(dt, &AxisProcess::of_ones_over(dt).scaled(noise));
            assert!((p.matrix() - dense).amax() < 1e-13, "{dense} {p:?}");

            let column = dense.column(0) / (dense.m11 + r);
            let gain = p.update(r, 1.0 / (dense.m11 + r));
            assert!((gain - column).amax() < 1e-13);
            let removed = column * dense.row(0);
            let mut updated = dense - removed;
            for i in 1..3 {
                updated[(i, i)] += rounding_reserve(removed[(i, i)]);
            }
            assert!((p.matrix() - updated).amax() < 1e-13, "{updated} {p:?}");
        }
    }

    #[test]
    fn what_grows_too_large_is_held_with_its_correlations() {
        let mut p = AxisCovariance {
            ss: 4e10_f64,
            sv: 1e8,
            sb: 1e6,
            vv: 5e5,
            vb: 100.0,
            bb: 400.0,
        };
        let correlation = p.sb * p.sb / (p.ss * p.bb);
        p.cap(LARGEST);
        assert!((p.ss - 1e10).abs() < 1.0 && (p.bb - 100.0).abs() < 1e-9);
        assert!((p.vv - 5e5).abs() < 1e-9);
        assert!((p.sb * p.sb / (p.ss * p.bb) - correlation).abs() < 1e-12);
    }
}
