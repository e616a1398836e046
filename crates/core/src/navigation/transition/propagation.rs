//! How a covariance goes on over an interval: sheared by the transition's blocks, in place, and white noise added.

use nalgebra::{SMatrix, Vector3};

use super::{ErrorTransition, ToAttitude, ToPosition, ToVelocity};
use crate::kalman::shear::{
    Takes, Triple, add_known, add_mirrored, add_rows, cross, finish, plus, shear, times,
};
use crate::navigation::{ACCELEROMETER_BIAS, ATTITUDE, GYROSCOPE_BIAS, POSITION, STATES, VELOCITY};
use crate::scalar::{Scalar, lit};

/// A covariance by its columns.
type Columns<T> = [[T; STATES]; STATES];

/// White noises that drive the errors, as variances for each second.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::navigation) struct ProcessNoise<T> {
    /// Gyroscope, rad^2/s.
    pub(in crate::navigation) gyroscope: T,
    /// Accelerometer, (m/s)^2/s.
    pub(in crate::navigation) accelerometer: T,
    /// Walk of the gyroscope bias, (rad/s)^2/s.
    pub(in crate::navigation) gyroscope_bias: T,
    /// Walk of the accelerometer bias, (m/s^2)^2/s.
    pub(in crate::navigation) accelerometer_bias: T,
}

/// What the position error takes up in half a sample, s, with the velocity as it is.
struct HalfWay<T>(T);

impl<T: Scalar> Takes<T> for HalfWay<T> {
    #[inline(always)]
    fn takes<const L: usize>(&self, part: impl Fn(usize) -> Triple<T, L>) -> Triple<T, L> {
        part(VELOCITY).map(|rows| rows.map(|v| v * self.0))
    }
}

/// What the velocity error takes up in a sample from the attitude error at its middle.
struct AtMidSample<'a, T: Scalar>(&'a ErrorTransition<T>);

impl<T: Scalar> Takes<T> for AtMidSample<'_, T> {
    #[inline(always)]
    fn takes<const L: usize>(&self, part: impl Fn(usize) -> Triple<T, L>) -> Triple<T, L> {
        let turned = cross(&self.0.velocity_from_attitude, part(ATTITUDE));
        plus(
            turned,
            times(&self.0.integrated_axes, part(ACCELEROMETER_BIAS)),
        )
    }
}

impl<T: Scalar> ErrorTransition<T> {
    /// `P <- Phi P Phi^T + Q`, in place (E8, E9). The covariance is symmetric to the bit, and stays so.
    #[inline]
    pub(in crate::navigation) fn propagate_covariance(
        &self,
        p: &mut SMatrix<T, STATES, STATES>,
        noise: &ProcessNoise<T>,
    ) {
        if self.is_one_sample {
            self.shear_one_sample(&mut p.data.0);
        } else {
            self.shear_samples::<STATES, 6, 9, 12>(&mut p.data.0);
        }
        self.add_noise(&mut p.data.0, noise);
    }

    /// `Phi P Phi^T` by one shear for position, velocity and attitude each, in this order: each needs the others as
    /// they were. Of the `N` states so many stand behind the position, the velocity and the attitude; those beyond the
    /// 15 stay as they are.
    // Not inlined: on a chip its memory is then free again for what follows.
    #[inline(never)]
    pub(in crate::navigation) fn shear_samples<
        const N: usize,
        const BEHIND_POSITION: usize,
        const BEHIND_VELOCITY: usize,
        const BEHIND_ATTITUDE: usize,
    >(
        &self,
        p: &mut [[T; N]; N],
    ) {
        let axes = &self.integrated_axes;
        let sources = [ATTITUDE, VELOCITY, ACCELEROMETER_BIAS, GYROSCOPE_BIAS];
        shear::<T, N, POSITION, BEHIND_POSITION, 4>(p, sources, &ToPosition(self));
        let sources = [ATTITUDE, ACCELEROMETER_BIAS, GYROSCOPE_BIAS];
        shear::<T, N, VELOCITY, BEHIND_VELOCITY, 3>(p, sources, &ToVelocity(self));
        let to_attitude = ToAttitude { axes };
        shear::<T, N, ATTITUDE, BEHIND_ATTITUDE, 1>(p, [GYROSCOPE_BIAS], &to_attitude);
    }

    /// The same over one sample, for a third less: the velocity changes with the attitude of mid-sample, and the
    /// position with the mean of the velocities before and after, so that `B` and `a` say it all.
    #[inline(never)]
    fn shear_one_sample(&self, p: &mut Columns<T>) {
        let half_way = HalfWay(self.duration * lit(0.5));
        let axes = &(self.integrated_axes * lit::<T>(0.5));
        let half_turn = ToAttitude { axes };

        shear::<T, STATES, POSITION, 6, 1>(p, [VELOCITY], &half_way);
        add_rows::<T, STATES, 3>(p, ATTITUDE, VELOCITY, &half_turn);
        let first_half = add_rows::<T, STATES, 9>(p, ATTITUDE, POSITION, &half_turn);
        finish::<T, STATES, ATTITUDE, 1>(p, [GYROSCOPE_BIAS], &half_turn);

        let sources = [ATTITUDE, ACCELEROMETER_BIAS];
        shear::<T, STATES, VELOCITY, 9, 2>(p, sources, &AtMidSample(self));

        // The second half of the turn; what the velocity has nothing to do with is as in the first.
        add_rows::<T, STATES, 3>(p, ATTITUDE, VELOCITY, &half_turn);
        add_known(p, ATTITUDE, POSITION, &first_half);
        finish::<T, STATES, ATTITUDE, 1>(p, [GYROSCOPE_BIAS], &half_turn);
        shear::<T, STATES, POSITION, 6, 1>(p, [VELOCITY], &half_way);
    }

    /// Adds `Q` for white noise and a specific force that is constant over the interval (E9). The
    /// walks of the biases enter their own variance only; over one aiding interval their effect on
    /// velocity and attitude is beyond the digits that matter.
    #[inline(never)]
    fn add_noise(&self, c: &mut Columns<T>, noise: &ProcessNoise<T>) {
        let t = self.duration;
        if t <= T::zero() {
            return;
        }
        // A t = [-a]x with the mean specific force in A = [f]x.
        let a = &self.velocity_from_attitude;
        let gyroscope = noise.gyroscope * t;
        let accelerometer = noise.accelerometer * t;
        let velocity_attitude = a * (gyroscope * lit(0.5));
        let position_attitude = velocity_attitude * (t * lit(1.0 / 3.0));
        // A A^T t^2 = |a|^2 I - a a^T, times what velocity, their product and position have of it.
        let g = a * (gyroscope * lit(1.0 / 3.0));
        let (xx, yy, zz) = (a.x * g.x, a.y * g.y, a.z * g.z);
        let aat = [
            yy + zz,
            zz + xx,
            xx + yy,
            -a.x * g.y,
            -a.y * g.z,
            -a.z * g.x,
        ];
        for i in 0..3 {
            c[ATTITUDE + i][ATTITUDE + i] += gyroscope;
        }
        add_cross(c, VELOCITY, &velocity_attitude);
        add_cross(c, POSITION, &position_attitude);
        let position_velocity = t * lit(0.375);
        let position = position_velocity * t * lit(0.4);
        let white = accelerometer * t * lit(0.5);
        add_symmetric(c, VELOCITY, VELOCITY, &aat, accelerometer);
        add_symmetric(
            c,
            POSITION,
            VELOCITY,
            &aat.map(|x| x * position_velocity),
            white,
        );
        let third = white * t * lit(2.0 / 3.0);
        add_symmetric(c, POSITION, POSITION, &aat.map(|x| x * position), third);
        let (force, rate) = (noise.accelerometer_bias * t, noise.gyroscope_bias * t);
        for i in 0..3 {
            c[ACCELEROMETER_BIAS + i][ACCELEROMETER_BIAS + i] += force;
            c[GYROSCOPE_BIAS + i][GYROSCOPE_BIAS + i] += rate;
        }
    }
}

/// Adds `[v]x` to the block of three states from `row` on and the attitude, and to its mirror image.
fn add_cross<T: Scalar>(columns: &mut Columns<T>, row: usize, v: &Vector3<T>) {
    for (i, j, value) in [(1, 0, v.z), (2, 1, v.x), (0, 2, v.y)] {
        add_mirrored(columns, row + i, ATTITUDE + j, value);
        add_mirrored(columns, row + j, ATTITUDE + i, -value);
    }
}

/// Adds a symmetric block, given as its diagonal and the elements (0, 1), (1, 2), (2, 0), and `white` on its
/// diagonal, at `row` and `column`, and its mirror image.
fn add_symmetric<T: Scalar>(
    columns: &mut Columns<T>,
    row: usize,
    column: usize,
    [xx, yy, zz, xy, yz, zx]: &[T; 6],
    white: T,
) {
    for (i, value) in [*xx, *yy, *zz].into_iter().enumerate() {
        add_mirrored(columns, row + i, column + i, value + white);
    }
    for (i, j, value) in [(0, 1, *xy), (1, 2, *yz), (2, 0, *zx)] {
        add_mirrored(columns, row + i, column + j, value);
        if row != column {
            add_mirrored(columns, row + j, column + i, value);
        }
    }
}
