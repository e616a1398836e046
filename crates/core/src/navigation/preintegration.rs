//! Preintegration: the inertial samples between two fixes as one increment of attitude, velocity and position, with its
//! sensitivity to the biases and its covariance.
//!
//! *Read first:* `docs/derivations/in_motion_alignment.md`, section 1 (W1-W6).
//!
//! Samples are integrated in the body axes of the beginning of the interval. Attitude, velocity and position there are
//! not needed, so one preintegration serves any number of hypotheses of them, and any number of passes over a window
//! of intervals; biases that differ from those subtracted are made up for to first order.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | `dR`, `dv`, `dp` | [`Increment`] | -, m/s, m |
//! | `J` | [`Preintegration::bias_jacobian`] | |
//! | `Q` | [`Preintegration::covariance`] | |
//!
//! Of `J` four blocks are stored, as the [`ErrorTransition`] that they are; of `Q` 28 numbers, since white noise of one
//! density on all axes makes the block of the attitude a multiple of the identity, and those beside it cross products.
//!
//! Cost: about 400 multiplications a sample. Memory in single precision: 330 bytes.

use nalgebra::{Matrix3, SMatrix, UnitQuaternion, Vector3};

use super::transition::ErrorTransition;
use crate::geometry::{rotation, so3};
use crate::kalman::SkipReason;
use crate::kalman::innovation::check_vector;
use crate::restorable::{InvalidState, finite, unit};
use crate::scalar::{Scalar, lit};

/// Largest angular rate (rad/s) and specific force (m/s^2) that a sensor can have measured.
const FASTEST_RATE: f64 = 100.0;
const LARGEST_FORCE: f64 = 1e3;
/// Longest interval of one sample, s.
const LONGEST_STEP_S: f64 = 10.0;

/// White noise of an inertial unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SampleNoise<T> {
    /// Noise density of the gyroscope, (rad/s)/sqrt(Hz).
    pub gyroscope_noise_density: T,
    /// Noise density of the accelerometer, (m/s^2)/sqrt(Hz).
    pub accelerometer_noise_density: T,
}

/// What an interval has brought, in the body axes of its beginning.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Increment<T: Scalar> {
    /// Attitude: turns body axes of the end into those of the beginning.
    pub rotation: UnitQuaternion<T>,
    /// Integral of the specific force, m/s.
    pub velocity: Vector3<T>,
    /// Double integral of the specific force, m.
    pub position: Vector3<T>,
}

/// Covariance of the increment's errors `[attitude, velocity, position]`.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct IncrementCovariance<T: Scalar> {
    /// The attitude's block is this times the identity.
    pub(super) attitude: T,
    /// Velocity with attitude is the cross product with this, `[u]x`.
    pub(super) velocity_attitude: Vector3<T>,
    /// Position with attitude is `[s]x`.
    pub(super) position_attitude: Vector3<T>,
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::rows"))]
    pub(super) velocity: Matrix3<T>,
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::rows"))]
    pub(super) position_velocity: Matrix3<T>,
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::rows"))]
    pub(super) position: Matrix3<T>,
}

/// The samples of an interval.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Preintegration<T: Scalar> {
    #[cfg_attr(feature = "serde", serde(with = "crate::geometry::rotation::wxyz"))]
    rotation: UnitQuaternion<T>,
    /// `J`, and with it `dv` and `dp`: in the axes of the beginning they are what the attitude error acts on.
    sensitivity: ErrorTransition<T>,
    covariance: IncrementCovariance<T>,
    accelerometer_bias: Vector3<T>,
    gyroscope_bias: Vector3<T>,
}

/// `[a]x [b]x`.
fn product<T: Scalar>(a: &Vector3<T>, b: &Vector3<T>) -> Matrix3<T> {
    b * a.transpose() - Matrix3::from_diagonal_element(a.dot(b))
}

impl<T: Scalar> IncrementCovariance<T> {
    fn zeros() -> Self {
        Self {
            attitude: T::zero(),
            velocity_attitude: Vector3::zeros(),
            position_attitude: Vector3::zeros(),
            velocity: Matrix3::zeros(),
            position_velocity: Matrix3::zeros(),
            position: Matrix3::zeros(),
        }
    }

    /// `Q <- F Q F^T` and the noise of the sample (W4, W5): force `a` in the axes of the beginning, over `dt`.
    fn add(&mut self, a: &Vector3<T>, dt: T, noise: &SampleNoise<T>) {
        let (half, sixth) = (lit::<T>(0.5), lit::<T>(1.0 / 6.0));
        let density = noise.gyroscope_noise_density;
        let gyroscope = density * density * dt;
        let density = noise.accelerometer_noise_density;
        let accelerometer = density * density * dt;
        let dt2 = dt * dt;
        let (q, u, s) = (
            self.attitude,
            self.velocity_attitude,
            self.position_attitude,
        );
        // A A^T = -[a]x [a]x; au = [a]x [u]x, and its transpose [u]x [a]x.
        let (aa, au) = (-product(a, a), product(a, &u));
        let sa = product(&s, a);
        let both = au + au.transpose();

        self.position += (self.position_velocity + self.position_velocity.transpose()) * dt
            + self.velocity * dt2
            + (sa + sa.transpose()) * (half * dt2)
            + both * (half * dt2 * dt)
            + aa * (dt2 * dt2 * (q * lit(0.25) + gyroscope * lit(0.05)));
        self.position_velocity += self.velocity * dt
            + au * (half * dt2)
            + sa * dt
            + au.transpose() * dt2
            + aa * (dt2 * dt * (q * half + gyroscope * lit(0.125)));
        self.velocity += both * dt + aa * (dt2 * (q + gyroscope * lit(1.0 / 3.0)));
        self.position_attitude += u * dt - a * (dt2 * (q * half + gyroscope * sixth));
        self.velocity_attitude -= a * (dt * (q + gyroscope * half));
        self.attitude += gyroscope;
        for i in 0..3 {
            self.velocity[(i, i)] += accelerometer;
            self.position_velocity[(i, i)] += accelerometer * dt * half;
            self.position[(i, i)] += accelerometer * dt2 * lit(1.0 / 3.0);
        }
    }

    fn numbers(&self) -> impl Iterator<Item = &T> {
        let vectors = self.velocity_attitude.iter().chain(&self.position_attitude);
        let blocks = [&self.velocity, &self.position_velocity, &self.position];
        vectors
            .chain(blocks.into_iter().flatten())
            .chain([&self.attitude])
    }
}

impl<T: Scalar> Preintegration<T> {
    /// An interval that begins; these biases (m/s^2, rad/s, body axes) will be subtracted from its samples.
    pub fn new(accelerometer_bias: Vector3<T>, gyroscope_bias: Vector3<T>) -> Self {
        Self {
            rotation: UnitQuaternion::identity(),
            sensitivity: ErrorTransition::default(),
            covariance: IncrementCovariance::zeros(),
            accelerometer_bias,
            gyroscope_bias,
        }
    }

    /// Integrates an angular rate (rad/s) and a specific force (m/s^2), body axes, that held on average over `dt`
    /// seconds (W1-W5).
    ///
    /// # Errors
    /// Why the sample was refused; nothing has changed then. Rates up to 100 rad/s, forces up to 1000 m/s^2 and
    /// intervals up to 10 s are permitted.
    pub fn add(
        &mut self,
        angular_rate: &Vector3<T>,
        specific_force: &Vector3<T>,
        dt: T,
        noise: &SampleNoise<T>,
    ) -> Result<(), SkipReason> {
        check_sample(angular_rate, specific_force, dt)?;
        let half_turn = (angular_rate - self.gyroscope_bias) * (dt * lit(0.5));
        let middle = self.rotation * so3::exp(&half_turn);
        let axes = rotation::to_matrix(&middle);
        let force = axes * (specific_force - self.accelerometer_bias);
        self.covariance.add(&force, dt, noise);
        self.sensitivity.accumulate(&axes, &force, dt);
        self.rotation = rotation::turned(&middle, &half_turn);
        Ok(())
    }

    /// Length of the interval, s.
    pub fn duration_s(&self) -> T {
        self.sensitivity.duration_s()
    }

    /// The increment for other biases than were subtracted, to first order in the difference (W6).
    pub fn corrected(
        &self,
        accelerometer_bias: &Vector3<T>,
        gyroscope_bias: &Vector3<T>,
    ) -> Increment<T> {
        let force = accelerometer_bias - self.accelerometer_bias;
        let rate = gyroscope_bias - self.gyroscope_bias;
        let [b, d, f, e] = self.sensitivity.bias_blocks();
        let [velocity, position] = self.sensitivity.increments();
        Increment {
            rotation: so3::exp(&(b * rate)) * self.rotation,
            velocity: velocity + b * force + d * rate,
            position: position + f * force + e * rate,
        }
    }

    /// The increment for the biases that were subtracted.
    pub fn increment(&self) -> Increment<T> {
        self.corrected(&self.accelerometer_bias, &self.gyroscope_bias)
    }

    /// `J`: rows attitude (rotation vector in the axes of the beginning), velocity, position; columns accelerometer and
    /// gyroscope bias.
    pub fn bias_jacobian(&self) -> SMatrix<T, 9, 6> {
        let [b, d, f, e] = self.sensitivity.bias_blocks();
        let mut jacobian = SMatrix::<T, 9, 6>::zeros();
        for (row, column, block) in [(0, 3, b), (3, 0, b), (3, 3, d), (6, 0, f), (6, 3, e)] {
            jacobian
                .fixed_view_mut::<3, 3>(row, column)
                .copy_from(block);
        }
        jacobian
    }

    /// `Q`: covariance of the increment's errors, in the order of the rows of `J`.
    pub fn covariance(&self) -> SMatrix<T, 9, 9> {
        let c = &self.covariance;
        let mut q = SMatrix::<T, 9, 9>::zeros();
        let blocks = [
            (0, 0, Matrix3::from_diagonal_element(c.attitude)),
            (3, 0, so3::skew(&c.velocity_attitude)),
            (6, 0, so3::skew(&c.position_attitude)),
            (3, 3, c.velocity),
            (6, 3, c.position_velocity),
            (6, 6, c.position),
        ];
        for (row, column, block) in blocks {
            q.fixed_view_mut::<3, 3>(row, column).copy_from(&block);
            q.fixed_view_mut::<3, 3>(column, row).tr_copy_from(&block);
        }
        q
    }

    /// The transition of the 15 errors over an interval that begins with the attitude `axes` and brings this increment. Where it
    /// does not show the heading, nothing horizontal is turned by an error of the attitude.
    pub(super) fn transition(
        &self,
        axes: &Matrix3<T>,
        increment: &Increment<T>,
        shows_heading: bool,
    ) -> ErrorTransition<T> {
        let share = if shows_heading { T::one() } else { T::zero() };
        let changes = [increment.velocity, increment.position].map(|change| {
            let change = axes * change;
            Vector3::new(change.x * share, change.y * share, change.z)
        });
        self.sensitivity.turned(axes, &changes)
    }

    /// The covariance as it is stored.
    pub(super) fn increment_covariance(&self) -> &IncrementCovariance<T> {
        &self.covariance
    }

    /// Whether a saved one can be continued from.
    pub(super) fn check(&self) -> Result<(), InvalidState> {
        unit("increment of attitude", &self.rotation)?;
        let biases = self.accelerometer_bias.iter().chain(&self.gyroscope_bias);
        let numbers = self.sensitivity.numbers().chain(self.covariance.numbers());
        finite("preintegration", numbers.chain(biases))
    }
}

/// Refuses what cannot be a sample.
pub(super) fn check_sample<T: Scalar>(
    angular_rate: &Vector3<T>,
    specific_force: &Vector3<T>,
    dt: T,
) -> Result<(), SkipReason> {
    check_vector(angular_rate, T::zero(), lit(FASTEST_RATE))?;
    check_vector(specific_force, T::zero(), lit(LARGEST_FORCE))?;
    if !dt.is_finite() {
        return Err(SkipReason::NotFinite);
    }
    if dt <= T::zero() {
        return Err(SkipReason::NotNewer);
    }
    if dt > lit(LONGEST_STEP_S) {
        return Err(SkipReason::TooLate);
    }
    Ok(())
}

#[cfg(test)]
mod tests;
