//! GNSS/INS: stamped samples of an inertial unit and of a receiver in, position, velocity and attitude out, with covariance
//! and solution status.
//!
//! *Read first:* `docs/derivations/error_state.md`; Groves (2013), chapters 14 to 16.
//!
//! Use it wherever there is an inertial unit and a receiver: a car, a boat, a drone, on a host or on a chip. The
//! filter is [`ErrorStateFilter`] with [`AugmentedStates`]; this adds time, alignment, gates, outages. Use
//! [`super::axis_filters`] where 15 states do not fit.
//!
//! ```
//! use northing_core::nalgebra::Vector3;
//! use northing_core::navigation::aiding::{gnss_position::GnssPosition, gnss_velocity::GnssVelocity};
//! use northing_core::navigation::gnss_ins::{GnssIns, GnssInsConfig};
//! use northing_core::navigation::validity::Validity;
//!
//! // A car that stands for two seconds and then drives north at 2 m/s^2, seen at 100 Hz and 1 Hz.
//! let mut ins = GnssIns::<f32>::new(GnssInsConfig::default()).unwrap();
//! for k in 1..=1000_i64 {
//!     let time_ns = k * 10_000_000;
//!     let t = (k as f32 * 0.01 - 2.0).max(0.0);
//!     let acceleration = if t > 0.0 { 2.0 } else { 0.0 };
//!     ins.imu(time_ns, &Vector3::zeros(), &Vector3::new(acceleration, 0.0, -9.806_65)).unwrap();
//!     if k % 100 == 0 {
//!         let std = Vector3::new(2.0, 2.0, 4.0);
//!         let ned = Vector3::new(t * t, 0.0, 0.0);
//!         ins.gnss_position(time_ns, &GnssPosition { ned, std, has_height: true });
//!         let (ned, std) = (Vector3::new(2.0 * t, 0.0, 0.0), Vector3::repeat(0.1));
//!         ins.gnss_velocity(time_ns, &GnssVelocity { ned, std, has_vertical: true });
//!     }
//! }
//! let state = ins.state().unwrap();
//! // Eight seconds straight on do not show where it points; position and velocity are good all the same.
//! assert_eq!(ins.validity(), Validity::HeadingUnknown);
//! assert!((state.position - Vector3::new(64.0, 0.0, 0.0)).norm() < 1.0);
//! ```
//!
//! Positions are metres north, east and down of an origin: [`crate::earth::LocalFrame`] makes them of latitude and
//! longitude. The frame is fixed to the Earth, so there is no transport rate; Earth rate and Coriolis force are an
//! option, and gravity turns with the distance from the origin. Who travels takes the origin along every kilometre or so
//! ([`GnssIns::move_origin`]).
//!
//! - Samples and fixes come in the order of their stamps (integer nanoseconds of one clock). A fix is compared
//!   with where the body was when it was valid: stamp less latency. The last `HISTORY` samples are kept for that;
//!   at 100 Hz the default reaches 0.3 s back.
//! - Every measurement returns its innovation and is counted. What is not finite changes nothing.
//! - It starts in any motion, at the first fix, and states the heading as unknown until accelerations have shown it:
//!   [`Validity::HeadingUnknown`]. Nothing is taken to stand still or to point where it moves.
//! - Fixes are weighed by how far they are off, and the receiver's noise is learnt. When fixes disagree for long it aligns
//!   again ([`GnssIns::realignments`]).
//! - A bias that steps is found by what the fixes say of it, goes into the state and is told ([`GnssIns::take_fault`]).
//! - A gap of inertial samples of up to 10 s is gone over by what the motion before was like (`docs/derivations/faults.md`, section 8); after a
//!   longer one it starts again.
//! - In an outage its variance grows, and [`GnssIns::validity`] says when to stop believing it. A covariance that is no
//!   longer one starts it again.
//!
//! Cost, limits: see [`ErrorStateFilter`] and, until the heading is known, [`super::in_motion_alignment`]. Memory in single
//! precision: 32 KB, of which 20 KB are the alignment's and 6 KB those of steps of a bias, and 36 bytes a sample of history.

mod bias_step;
mod clock;
mod config;
mod constraints;
mod counts;
mod inertial;
mod memory;
mod moved_origin;
mod propagation;
mod receiver;
mod sample_faults;
mod solution;
mod start;
mod start_without_inertial;
mod stillness;
mod updates;
mod vibration;
mod weighting;

#[cfg(test)]
mod tests;

use nalgebra::{Matrix3, SMatrix, UnitQuaternion, Vector3};

pub use config::{GnssInsConfig, ImuSamples};
pub use constraints::{CONSTRAINT_INTERVAL_S, STANDING_STD};
pub use counts::{Aid, AidCounts};
pub use memory::GnssInsState;
pub use receiver::{ErrorShares, GnssPositionUpdate};

use self::memory::Memory;
use self::sample_faults::SampleFaults;
use super::augmented_states::{AUGMENTED_STATES, AugmentedStates};
use super::error_state::{ErrorStateConfig, ErrorStateFilter};
use super::in_motion_alignment::AlignmentStatus;
use super::validity::Validity;
use super::{
    ACCELEROMETER_BIAS, ERRORS, ErrorTransition, GYROSCOPE_BIAS, NavigationState, POSITION, STATES,
};
use crate::kalman::{ErrorListener, ErrorPropagation, NavigationPose};
use crate::parameters::ConfigError;
use crate::scalar::{Scalar, lit, seconds};

/// Longest interval between inertial samples that counts as continuous, s.
pub const GAP_LIMIT_S: f64 = 0.5;
/// A longer gap (s) is the end: it aligns again.
pub const LONGEST_GAP_S: f64 = 10.0;

/// How the errors went on over one step of the covariance: the 15 by the transition, then the biases and the
/// augmented states shrunk.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct CovarianceStep<T: Scalar> {
    /// Of the 15 errors.
    pub transition: ErrorTransition<T>,
    /// What is left of the accelerometer's and of the gyroscope's bias error.
    pub bias_kept: [T; 2],
    /// What is left of the augmented states.
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::array"))]
    pub side_kept: [T; AUGMENTED_STATES],
}

impl<T: Scalar> ErrorPropagation<T, ERRORS> for CovarianceStep<T> {
    /// (E33).
    fn map_rows<const C: usize>(&self, rows: &mut SMatrix<T, ERRORS, C>) {
        let [force, rate] = self.bias_kept;
        for column in &mut rows.data.0 {
            let Some((errors, side)) = column.split_first_chunk_mut::<STATES>() else {
                return;
            };
            self.transition.map_column(errors);
            for (i, error) in errors.iter_mut().enumerate().skip(ACCELEROMETER_BIAS) {
                *error *= if i < GYROSCOPE_BIAS { force } else { rate };
            }
            for (error, kept) in side.iter_mut().zip(&self.side_kept) {
                *error *= *kept;
            }
        }
    }
}

/// Pose of a GNSS/INS with the covariance of all its errors: what a tracker needs at a scan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseWithErrors<T: Scalar> {
    /// Position north and east (m) and heading (rad, clockwise from north).
    pub pose: Vector3<T>,
    /// Covariance of the 15 errors and of the augmented states behind them.
    pub covariance: SMatrix<T, ERRORS, ERRORS>,
    /// The rows that make the error of the pose from them (E13).
    pub pose_from_error: SMatrix<T, 3, ERRORS>,
}

impl<T: Scalar> PoseWithErrors<T> {
    /// As trackers take it.
    pub fn navigation_pose(&self) -> NavigationPose<'_, T, ERRORS> {
        NavigationPose {
            pose: self.pose,
            covariance: &self.covariance,
            pose_from_error: self.pose_from_error,
        }
    }
}

/// The GNSS/INS; `HISTORY` samples are kept for fixes that come late. The listener `L` follows its errors; `()` for nobody.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GnssIns<T: Scalar, const HISTORY: usize = 32, L = ()> {
    config: GnssInsConfig<T>,
    filter: ErrorStateFilter<T>,
    alignment: start::Alignment<T>,
    memory: Memory<T, HISTORY>,
    listener: L,
}

impl<T: Scalar, const HISTORY: usize> GnssIns<T, HISTORY> {
    /// One that waits for its first samples.
    ///
    /// # Errors
    /// The first parameter outside its permitted range.
    pub fn new(config: GnssInsConfig<T>) -> Result<Self, ConfigError> {
        Self::listened_to(config, ())
    }
}

impl<T: Scalar, const HISTORY: usize, L: ErrorListener<T, ERRORS>> GnssIns<T, HISTORY, L> {
    /// As [`GnssIns::new`], with a listener that is correlated with its errors, such as a Schmidt-Kalman tracker: all
    /// that this filter does to them reaches it, in order.
    ///
    /// # Errors
    /// The first parameter outside its permitted range.
    pub fn listened_to(config: GnssInsConfig<T>, listener: L) -> Result<Self, ConfigError> {
        config.validate()?;
        let settings = ErrorStateConfig {
            accelerometer_noise_density: config.accelerometer_noise_density,
            gyroscope_noise_density: config.gyroscope_noise_density,
            // A Gauss-Markov bias is moved by `gauss_markov_bias` instead.
            accelerometer_bias_random_walk: if config.accelerometer_gauss_markov_std > T::zero() {
                T::zero()
            } else {
                config.accelerometer_bias_random_walk
            },
            gyroscope_bias_random_walk: if config.gyroscope_gauss_markov_std > T::zero() {
                T::zero()
            } else {
                config.gyroscope_bias_random_walk
            },
            gravity: config.gravity,
            reset_jacobian: true,
        };
        let nowhere = NavigationState {
            ned_from_body: UnitQuaternion::identity(),
            velocity: Vector3::zeros(),
            position: Vector3::zeros(),
            accelerometer_bias: Vector3::zeros(),
            gyroscope_bias: Vector3::zeros(),
            covariance: SMatrix::identity(),
            pending: ErrorTransition::default(),
            skipped: 0,
        };
        Ok(Self {
            config,
            filter: ErrorStateFilter::new(settings, nowhere)?,
            alignment: start::alignment(&config)?,
            memory: Memory {
                faults: SampleFaults::new(config.gap_attitude_random_walk),
                ..Memory::default()
            },
            listener,
        })
    }

    /// Who follows the errors.
    pub fn listener(&self) -> &L {
        &self.listener
    }

    /// The same, to move its targets on or to put in another. Whoever comes new and is correlated with the errors must be
    /// so with those of now: see [`Self::pose_and_listener`].
    pub fn listener_mut(&mut self) -> &mut L {
        &mut self.listener
    }

    /// Pose and errors of this instant, with the covariance brought up to it, and the listener, to fuse what was seen from
    /// there; `None` before the start.
    pub fn pose_and_listener(&mut self) -> Option<(PoseWithErrors<T>, &mut L)> {
        if self.memory.started {
            self.catch_up();
        }
        if !self.memory.started {
            return None;
        }
        let mut covariance = SMatrix::<T, ERRORS, ERRORS>::zeros();
        let (own, side) = (&self.filter.state().covariance, &self.memory.side);
        covariance
            .fixed_view_mut::<STATES, STATES>(0, 0)
            .copy_from(own);
        covariance
            .fixed_view_mut::<STATES, AUGMENTED_STATES>(0, STATES)
            .copy_from(&side.cross);
        covariance
            .fixed_view_mut::<AUGMENTED_STATES, STATES>(STATES, 0)
            .tr_copy_from(&side.cross);
        covariance
            .fixed_view_mut::<AUGMENTED_STATES, AUGMENTED_STATES>(STATES, STATES)
            .copy_from(&side.covariance);
        let mut pose_from_error = SMatrix::<T, 3, ERRORS>::zeros();
        pose_from_error
            .fixed_view_mut::<3, STATES>(0, 0)
            .copy_from(&self.filter.pose_from_error());
        let pose = PoseWithErrors {
            pose: self.filter.pose(),
            covariance,
            pose_from_error,
        };
        Some((pose, &mut self.listener))
    }

    /// The settings.
    pub fn config(&self) -> &GnssInsConfig<T> {
        &self.config
    }

    /// The state once it has started: position, velocity, attitude and biases at [`Self::time_ns`]. Its covariance
    /// is at most 0.1 s older.
    pub fn state(&self) -> Option<&NavigationState<T>> {
        self.memory.started.then(|| self.filter.state())
    }

    /// The states beside: the receiver's slow error, time offset, barometer's offset, mount angles, the
    /// magnetometer's iron.
    pub fn augmented_states(&self) -> &AugmentedStates<T> {
        &self.memory.side
    }

    /// Tells the magnetic declination (rad, east positive) of the place; one in the settings stands above it, and what is
    /// not an angle changes nothing. To be told before the start: a heading that began from a magnetometer stays where it is.
    pub fn set_declination(&mut self, declination: T) {
        if declination.abs() <= lit(4.0) {
            self.memory.declination = declination;
        }
    }

    /// Time of the state, ns.
    pub fn time_ns(&self) -> Option<i64> {
        self.memory.now_ns
    }

    /// Angular rate of the last sample as it was measured, rad/s, body axes.
    pub fn angular_rate(&self) -> Option<&Vector3<T>> {
        self.memory.last_imu.as_ref().map(|(_, rate, _)| rate)
    }

    /// Stamp of the last position that was fused, ns.
    pub fn last_fix_ns(&self) -> Option<i64> {
        self.memory.last_fix_ns
    }

    /// What the position is worth.
    pub fn validity(&self) -> Validity {
        let Some((state, now)) = self.state().zip(self.memory.now_ns) else {
            return Validity::Aligning;
        };
        let since = self.memory.last_fix_ns.map(|fix| seconds(fix, now));
        let p = &state.covariance;
        let north = p[(POSITION, POSITION)];
        let east = p[(POSITION + 1, POSITION + 1)];
        // A maximum would hide what is not a number.
        let variance = if north > east { north } else { east };
        let worth = self
            .config
            .validity
            .judge(since, variance + T::zero() * north);
        let in_doubt = if self.memory.aligning {
            self.alignment.status() != AlignmentStatus::Aligned
        } else {
            self.memory.disagreeing >= weighting::DOUBTED_FROM
        };
        if worth == Validity::Aided && in_doubt {
            Validity::HeadingUnknown
        } else {
            worth
        }
    }

    /// Position of a point fixed to the body (m, NED), `arm` metres from the unit (body axes): the antenna, to
    /// compare with a receiver.
    pub fn position_of(&self, arm: &Vector3<T>) -> Option<Vector3<T>> {
        let state = self.state()?;
        Some(state.position + state.ned_from_body * arm)
    }

    /// Position (m, NED) of the antenna as the receiver dates it, with its covariance (m^2): what its fixes are to be compared
    /// with.
    pub fn antenna_position(&self) -> Option<(Vector3<T>, Matrix3<T>)> {
        let arm = Vector3::from(self.config.lever_arm_m);
        let state = self.state()?;
        Some(state.antenna_position(&self.memory.side, &arm))
    }

    /// What became of the measurements of an aid.
    pub fn counts(&self, aid: Aid) -> &AidCounts<T> {
        &self.memory.counts[aid as usize]
    }

    /// Inertial samples refused: not finite, not newer, out of range.
    pub fn imu_skipped(&self) -> u32 {
        self.memory.imu_skipped
    }

    /// Gaps of more than [`GAP_LIMIT_S`] between inertial samples.
    pub fn gaps(&self) -> u32 {
        self.memory.gaps
    }

    /// How often it had to start again: after [`LONGEST_GAP_S`], a clock that went back, or a covariance that was none.
    pub fn restarts(&self) -> u32 {
        self.memory.restarts
    }

    /// How often it aligned again, because the fixes disagreed with its state for long.
    pub fn realignments(&self) -> u32 {
        self.memory.realignments
    }

    /// How often the state was taken over from the alignment: at each fix until the heading is known well. It then jumps.
    pub fn take_overs(&self) -> u32 {
        self.memory.take_overs
    }

    /// What the receiver's stated standard deviations are multiplied by, as its fixes have shown: of a horizontal position, a
    /// height, a velocity; from 1 on.
    pub fn noise_scales(&self) -> [T; 3] {
        if self.memory.aligning {
            let scale = self.alignment.noise_scale();
            [scale, scale, T::one()]
        } else {
            self.memory.noise_scale
        }
    }

    /// Noise densities of gyroscope and accelerometer that it expects now, (rad/s)/sqrt(Hz) and (m/s^2)/sqrt(Hz): those of the
    /// settings, or what the samples show.
    pub fn noise_densities(&self) -> [T; 2] {
        let c = self.filter.config();
        [c.gyroscope_noise_density, c.accelerometer_noise_density]
    }

    /// Whether the unit was found at rest in the last half second.
    pub fn is_still(&self) -> bool {
        self.memory.still_windows > 0
    }
}
