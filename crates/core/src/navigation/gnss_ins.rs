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
//!     ins.imu(time_ns, &Vector3::zeros(), &Vector3::new(acceleration, 0.0, -9.806_65));
//!     if k % 100 == 0 {
//!         let std = Vector3::new(2.0, 2.0, 4.0);
//!         let ned = Vector3::new(t * t, 0.0, 0.0);
//!         ins.gnss_position(time_ns, &GnssPosition { ned, std, has_height: true });
//!         let (ned, std) = (Vector3::new(2.0 * t, 0.0, 0.0), Vector3::repeat(0.1));
//!         ins.gnss_velocity(time_ns, &GnssVelocity { ned, std, has_vertical: true });
//!     }
//! }
//! let state = ins.state().unwrap();
//! assert_eq!(ins.validity(), Validity::Aided);
//! assert!((state.position - Vector3::new(64.0, 0.0, 0.0)).norm() < 1.0);
//! ```
//!
//! Positions are metres north, east and down of an origin: [`crate::earth::LocalFrame`] makes them of latitude and
//! longitude. The frame is fixed to the Earth, so there is no transport rate; Earth rate and Coriolis force are an
//! option, and gravity turns with the distance from the origin.
//!
//! - Samples and fixes come in the order of their stamps (integer nanoseconds of one clock). A fix is compared
//!   with where the body was when it was valid: stamp less latency. The last `HISTORY` samples are kept for that;
//!   at 100 Hz the default reaches 0.3 s back.
//! - Every measurement returns its innovation and is counted. What is not finite changes nothing.
//! - Before the start it aligns; in an outage its variance grows, and [`GnssIns::validity`] says when to stop
//!   believing it. A covariance that is no longer one starts it again.
//!
//! Cost, limits: see [`ErrorStateFilter`]. Memory in single precision: 3.7 KB, and 28 bytes a sample of history.

mod alignment;
mod clock;
mod config;
mod counts;
mod inertial;
mod propagation;
mod starting;
mod stillness;
mod updates;

#[cfg(test)]
mod tests;

use nalgebra::{SMatrix, UnitQuaternion, Vector3};

pub use config::{GnssInsConfig, ImuSamples};
pub use counts::{Aid, AidCounts};
pub use updates::{ErrorShares, GnssPositionUpdate};

use self::alignment::Alignment;
use self::starting::Seen;
use self::stillness::{Quiet, StillnessWindow, Window};
use super::augmented_states::{AUGMENTED_STATES, AugmentedStates};
use super::error_state::{ErrorStateConfig, ErrorStateFilter};
use super::gauss_markov_bias::BiasAtRest;
use super::history::ImuHistory;
use super::validity::Validity;
use super::{
    ACCELEROMETER_BIAS, ERRORS, ErrorTransition, GYROSCOPE_BIAS, NavigationState, POSITION, STATES,
};
use crate::kalman::{CountedGate, ErrorListener, ErrorPropagation};
use crate::parameters::ConfigError;
use crate::scalar::{Scalar, lit};

/// Longest interval between inertial samples that counts as continuous, s.
pub const GAP_LIMIT_S: f64 = 0.5;
/// A longer gap (s) is the end: it aligns again.
pub const LONGEST_GAP_S: f64 = 10.0;

/// How the errors went on over one step of the covariance: the 15 by the transition, then the biases and the side
/// states shrunk.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CovarianceStep<T: Scalar> {
    /// Of the 15 errors.
    pub transition: ErrorTransition<T>,
    /// What is left of the accelerometer's and of the gyroscope's bias error.
    pub bias_kept: [T; 2],
    /// What is left of the augmented states.
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

/// The GNSS/INS; `HISTORY` samples are kept to look back by. The listener `L` follows its errors; `()` for nobody.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GnssIns<T: Scalar, const HISTORY: usize = 32, L = ()> {
    config: GnssInsConfig<T>,
    filter: ErrorStateFilter<T>,
    side: AugmentedStates<T>,
    history: ImuHistory<T, HISTORY>,
    /// What the alignment has, while it aligns.
    aligning: Option<Alignment<T>>,
    seen: Seen<T>,
    window: StillnessWindow<T>,
    quiet: Quiet<T>,
    /// Windows at rest in a row.
    still_windows: u32,
    /// Until when the receiver's last velocity says that it stands.
    stands_until_ns: Option<i64>,
    /// Time of the state.
    now_ns: Option<i64>,
    last_imu: Option<(i64, Vector3<T>, Vector3<T>)>,
    last_fix_ns: Option<i64>,
    /// Stamp of the last magnetic field that was fused.
    last_magnetic_ns: Option<i64>,
    /// Magnetic declination where the settings have none.
    declination: T,
    /// Variance that the receiver's slow error is held to have, m^2.
    slow_variance: Vector3<T>,
    /// Values at rest of the accelerometer's and the gyroscope's bias.
    at_rest: [BiasAtRest<T>; 2],
    last_step: CovarianceStep<T>,
    /// A finished window that has not been used yet.
    due_window: Option<Window<T>>,
    since_constraint: T,
    /// Seconds since something measured the velocity.
    since_velocity: T,
    gates: [CountedGate; Aid::ALL.len()],
    /// That of the angular rate at rest: its refusals are not those of the velocity.
    standing_rate_gate: CountedGate,
    counts: [AidCounts<T>; Aid::ALL.len()],
    stamps: [Option<i64>; Aid::ALL.len()],
    imu_skipped: u32,
    /// Stamps in a row that are of a time long past.
    behind: u8,
    gaps: u32,
    restarts: u32,
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
            side: AugmentedStates::default(),
            history: ImuHistory::default(),
            aligning: Some(Alignment::default()),
            seen: Seen::default(),
            window: StillnessWindow::default(),
            quiet: Quiet::default(),
            still_windows: 0,
            stands_until_ns: None,
            now_ns: None,
            last_imu: None,
            last_fix_ns: None,
            last_magnetic_ns: None,
            declination: T::zero(),
            slow_variance: Vector3::zeros(),
            at_rest: [BiasAtRest::new(Vector3::zeros(), Vector3::zeros()); 2],
            last_step: CovarianceStep {
                transition: ErrorTransition::default(),
                bias_kept: [T::one(); 2],
                side_kept: [T::one(); AUGMENTED_STATES],
            },
            due_window: None,
            since_constraint: T::zero(),
            since_velocity: T::zero(),
            gates: [CountedGate::default(); Aid::ALL.len()],
            standing_rate_gate: CountedGate::default(),
            counts: [AidCounts::default(); Aid::ALL.len()],
            stamps: [None; Aid::ALL.len()],
            imu_skipped: 0,
            behind: 0,
            gaps: 0,
            restarts: 0,
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
        if self.aligning.is_none() {
            self.catch_up();
        }
        if self.aligning.is_some() {
            return None;
        }
        let mut covariance = SMatrix::<T, ERRORS, ERRORS>::zeros();
        let (own, side) = (&self.filter.state().covariance, &self.side);
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
        self.aligning.is_none().then(|| self.filter.state())
    }

    /// The states beside: the receiver's slow error, time offset, barometer's offset, mount angles, the
    /// magnetometer's iron.
    pub fn augmented_states(&self) -> &AugmentedStates<T> {
        &self.side
    }

    /// Tells the magnetic declination (rad, east positive) of the place; one in the settings stands above it, and what is
    /// not an angle changes nothing. To be told before the start: a heading that began from a magnetometer stays where it is.
    pub fn set_declination(&mut self, declination: T) {
        if declination.abs() <= lit(4.0) {
            self.declination = declination;
        }
    }

    /// Time of the state, ns.
    pub fn time_ns(&self) -> Option<i64> {
        self.now_ns
    }

    /// Angular rate of the last sample as it was measured, rad/s, body axes.
    pub fn angular_rate(&self) -> Option<&Vector3<T>> {
        self.last_imu.as_ref().map(|(_, rate, _)| rate)
    }

    /// Stamp of the last position that was fused, ns.
    pub fn last_fix_ns(&self) -> Option<i64> {
        self.last_fix_ns
    }

    /// What the position is worth.
    pub fn validity(&self) -> Validity {
        let Some((state, now)) = self.state().zip(self.now_ns) else {
            return Validity::Aligning;
        };
        let since = self.last_fix_ns.map(|fix| seconds(fix, now));
        let p = &state.covariance;
        let north = p[(POSITION, POSITION)];
        let east = p[(POSITION + 1, POSITION + 1)];
        // A maximum would hide what is not a number.
        let variance = if north > east { north } else { east };
        self.config
            .validity
            .judge(since, variance + T::zero() * north)
    }

    /// Position of a point fixed to the body (m, NED), `arm` metres from the unit (body axes): the antenna, to
    /// compare with a receiver.
    pub fn position_of(&self, arm: &Vector3<T>) -> Option<Vector3<T>> {
        let state = self.state()?;
        Some(state.position + state.ned_from_body * arm)
    }

    /// What became of the measurements of an aid.
    pub fn counts(&self, aid: Aid) -> &AidCounts<T> {
        &self.counts[aid as usize]
    }

    /// Inertial samples refused: not finite, not newer, out of range.
    pub fn imu_skipped(&self) -> u32 {
        self.imu_skipped
    }

    /// Gaps of more than [`GAP_LIMIT_S`] between inertial samples.
    pub fn gaps(&self) -> u32 {
        self.gaps
    }

    /// How often it had to start again: after [`LONGEST_GAP_S`], a clock that went back, or a covariance that was none.
    pub fn restarts(&self) -> u32 {
        self.restarts
    }

    /// Whether the unit was found at rest in the last half second.
    pub fn is_still(&self) -> bool {
        self.still_windows > 0
    }
}

/// Seconds between two stamps.
fn seconds<T: Scalar>(from_ns: i64, to_ns: i64) -> T {
    lit(to_ns.saturating_sub(from_ns) as f64 * 1e-9)
}
