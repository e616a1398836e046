//! GNSS/INS: stamped samples of an inertial unit and of a receiver in, position, velocity and attitude out, with
//! what they are worth.
//!
//! *Read first:* `docs/derivations/error_state.md`; Groves (2013), chapters 14 to 16.
//!
//! Use it wherever there is an inertial unit and a receiver: a car, a boat, a drone, on a host or on a chip. The
//! filter is [`ErrorStateFilter`] with [`SideStates`]; this adds time, alignment, gates, outages. Use
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
//! Cost, limits: see [`ErrorStateFilter`]. Memory in single precision: 2.4 KB, and 28 bytes a sample of history.

mod alignment;
mod clock;
mod config;
mod counts;
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
use super::bias_wander::{BiasAtRest, WanderSettings};
use super::error_state::{ErrorStateConfig, ErrorStateFilter};
use super::history::{ImuHistory, Instant};
use super::side_states::{
    BAROMETER_OFFSET, GNSS_OFFSET, MAGNETIC_OFFSET, SIDE_STATES, SideStates, SideStep,
};
use super::validity::Validity;
use super::{ErrorTransition, NavigationState, POSITION};
use crate::kalman::innovation::check_vector;
use crate::kalman::{CountedGate, SkipReason};
use crate::scalar::{Scalar, lit};

/// Longest interval between inertial samples that counts as continuous, s.
pub const GAP_LIMIT_S: f64 = 0.5;
/// A longer gap (s) is the end: it aligns again.
pub const LONGEST_GAP_S: f64 = 10.0;
/// The covariance follows the state at least so often, s.
const COVARIANCE_INTERVAL_S: f64 = 0.1;
/// Earth's mean radius, m: how gravity turns and falls with position.
const EARTH_RADIUS_M: f64 = 6.371e6;

/// How the errors went on over one step of the covariance: the 15 by the transition, then the biases and the side
/// states shrunk.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CovarianceStep<T: Scalar> {
    /// Of the 15 errors.
    pub transition: ErrorTransition<T>,
    /// What is left of the accelerometer's and of the gyroscope's bias error.
    pub bias_kept: [T; 2],
    /// What is left of the side states.
    pub side_kept: [T; SIDE_STATES],
}

/// The GNSS/INS; `HISTORY` samples are kept to look back by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GnssIns<T: Scalar, const HISTORY: usize = 32> {
    config: GnssInsConfig<T>,
    filter: ErrorStateFilter<T>,
    side: SideStates<T>,
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
}

impl<T: Scalar, const HISTORY: usize> GnssIns<T, HISTORY> {
    /// One that waits for its first samples.
    ///
    /// # Errors
    /// The name of the first setting that makes no sense.
    pub fn new(config: GnssInsConfig<T>) -> Result<Self, &'static str> {
        if let Some(name) = config.senseless() {
            return Err(name);
        }
        let settings = ErrorStateConfig {
            accelerometer_noise_density: config.accelerometer_noise_density,
            gyroscope_noise_density: config.gyroscope_noise_density,
            // What wanders is moved by `bias_wander` instead.
            accelerometer_bias_random_walk: if config.accelerometer_wander_std > T::zero() {
                T::zero()
            } else {
                config.accelerometer_bias_random_walk
            },
            gyroscope_bias_random_walk: if config.gyroscope_wander_std > T::zero() {
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
            side: SideStates::default(),
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
            at_rest: [BiasAtRest::new(Vector3::zeros(), T::zero()); 2],
            last_step: CovarianceStep {
                transition: ErrorTransition::default(),
                bias_kept: [T::one(); 2],
                side_kept: [T::one(); SIDE_STATES],
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
        })
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
    pub fn side_states(&self) -> &SideStates<T> {
        &self.side
    }

    /// Tells the magnetic declination (rad, east positive) of the place; one in the settings stands above it, and what is
    /// not an angle changes nothing.
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

    /// Takes an angular rate (rad/s) and specific force (m/s^2) of one stamp, body axes.
    ///
    /// # Errors
    /// Why the sample was refused; it is counted and changes nothing.
    pub fn imu(
        &mut self,
        time_ns: i64,
        angular_rate: &Vector3<T>,
        specific_force: &Vector3<T>,
    ) -> Result<(), SkipReason> {
        let newer = self.last_imu.is_none_or(|(last, _, _)| time_ns > last);
        let checked = check_vector(angular_rate, T::zero(), lit(100.0))
            .and_then(|()| check_vector(specific_force, T::zero(), lit(1e3)))
            .and(if newer {
                Ok(())
            } else {
                Err(SkipReason::NotNewer)
            });
        let used = self.config.imu_samples != ImuSamples::None;
        let checked = checked.and(if used {
            Ok(())
        } else {
            Err(SkipReason::NotUsed)
        });
        if let Err(reason) = checked {
            self.imu_skipped = self.imu_skipped.saturating_add(1);
            if let (SkipReason::NotNewer, Some((last, _, _))) = (reason, self.last_imu) {
                self.note_stamp_behind(time_ns, last);
            }
            return Err(reason);
        }
        self.behind = 0;
        let last = self
            .last_imu
            .replace((time_ns, *angular_rate, *specific_force));
        let now = self.now_ns.replace(time_ns);
        let Some((last_ns, last_rate, last_force)) = last else {
            return Ok(());
        };
        let dt: T = seconds(last_ns, time_ns);
        if dt > lit(GAP_LIMIT_S) {
            self.bridge(seconds(now.unwrap_or(last_ns), time_ns));
            return Ok(());
        }
        self.settle();
        let half = lit::<T>(0.5);
        let (rate, force) = match self.config.imu_samples {
            ImuSamples::Instants => (
                (angular_rate + last_rate) * half,
                (specific_force + last_force) * half,
            ),
            ImuSamples::Means | ImuSamples::None => (*angular_rate, *specific_force),
        };
        self.step(&rate, &force, dt);
        Ok(())
    }

    /// Moves on by `dt` with a rate and force that held over it.
    fn step(&mut self, rate: &Vector3<T>, force: &Vector3<T>, dt: T) {
        let window = self.window.add(rate, force, self.config.gravity, dt);
        if let Some(alignment) = &mut self.aligning {
            alignment.propagate(rate, force, dt);
            if let Some(window) = &window {
                alignment.window(window);
                let is_still = alignment.is_still;
                self.see_window(window, is_still);
            }
            self.try_to_start();
            return;
        }
        if let Some(window) = &window {
            let stands = self.stands_until_ns >= self.now_ns && window.may_be_still;
            self.see_window(window, stands);
        }
        let (rate, force) = self.on_the_earth(rate, force);
        // Cannot be refused: checked above, and the interval is positive and short.
        if self.filter.propagate(&rate, &force, dt).is_ok() {
            self.history.push(&rate, &force, dt);
        }
        self.since_velocity += dt;
        self.since_constraint += dt;
        self.due_window = window.or(self.due_window);
    }

    /// Counts windows at rest, and learns from those in which it is `known` to stand.
    fn see_window(&mut self, window: &Window<T>, known: bool) {
        if known {
            self.quiet.learn(window);
        }
        let still = known || self.quiet.agrees(window);
        self.still_windows = if still {
            self.still_windows.saturating_add(1)
        } else {
            0
        };
    }

    /// Takes out of a sample what the filter's plane does not know: Earth rate, Coriolis force, and gravity that
    /// turns and falls with the distance from the origin (E27).
    fn on_the_earth(&self, rate: &Vector3<T>, force: &Vector3<T>) -> (Vector3<T>, Vector3<T>) {
        let state = self.filter.state();
        let per_metre = if self.config.earth_curvature {
            self.config.gravity / lit(EARTH_RADIUS_M)
        } else {
            T::zero()
        };
        let p = &state.position;
        let mut extra = Vector3::new(-p.x, -p.y, p.z + p.z) * per_metre;
        let earth = Vector3::from(self.config.earth_rate_rad_s);
        let turns = earth.norm_squared() > T::zero();
        if turns {
            extra -= earth.cross(&state.velocity) * lit::<T>(2.0);
        }
        let body_from_ned = state.ned_from_body.inverse();
        let rate = if turns {
            rate - body_from_ned * earth
        } else {
            *rate
        };
        (rate, force + body_from_ned * extra)
    }

    /// Whether [`Self::settle`] has something to do: the covariance is 0.1 s behind, or a window or interval is over in
    /// which the filter constrains itself.
    pub fn is_due(&self) -> bool {
        let behind = self.pending_s() >= lit(COVARIANCE_INTERVAL_S);
        self.aligning.is_none() && (behind || self.due_window.is_some() || self.is_constraint_due())
    }

    /// Brings the covariance up to the state if it is due, and applies what the filter knows without being told. The
    /// next sample or measurement does it anyway; a smoother does it itself, to see what happens between.
    pub fn settle(&mut self) {
        if self.is_due() {
            self.catch_up();
            self.constrain();
        }
    }

    /// Seconds that the state is ahead of its covariance.
    pub fn pending_s(&self) -> T {
        self.filter.state().pending.duration_s()
    }

    /// The last step of the covariance: how the errors went on over it.
    pub fn last_step(&self) -> &CovarianceStep<T> {
        &self.last_step
    }

    /// Brings the covariance up to the state.
    pub fn catch_up(&mut self) {
        if self.pending_s() > T::zero() {
            let transition = self.filter.catch_up();
            self.follow(&transition);
        }
    }

    /// Brings what is beside the filter along.
    fn follow(&mut self, transition: &ErrorTransition<T>) {
        let duration = transition.duration_s();
        let mut step = SideStep {
            decay: [T::one(); SIDE_STATES],
            added: [T::zero(); SIDE_STATES],
        };
        let kept = (-duration / self.config.position_slow_time_s).exp();
        for i in 0..3 {
            step.decay[GNSS_OFFSET + i] = kept;
            step.added[GNSS_OFFSET + i] = self.slow_variance[i] * (T::one() - kept * kept);
        }
        if self.side.is_used(BAROMETER_OFFSET) {
            let walk = self.config.barometer_offset_random_walk;
            step.added[BAROMETER_OFFSET] = walk * walk * duration;
        }
        if self.side.is_used(MAGNETIC_OFFSET) {
            let walk = self.config.magnetic_offset_random_walk_ut;
            for i in 0..3 {
                step.added[MAGNETIC_OFFSET + i] = walk * walk * duration;
            }
        }
        self.side.propagate(transition, &step);
        let kept = |std: T, time: T| {
            if std > T::zero() {
                (-duration / time).exp()
            } else {
                T::one()
            }
        };
        let c = &self.config;
        self.last_step = CovarianceStep {
            transition: *transition,
            bias_kept: [
                kept(c.accelerometer_wander_std, c.accelerometer_wander_time_s),
                kept(c.gyroscope_wander_std, c.gyroscope_wander_time_s),
            ],
            side_kept: step.decay,
        };
        self.relax_biases(duration);
        self.filter.limit_covariance(&mut self.side);
        if !(self.filter.state().is_usable() && self.side.is_usable()) {
            self.restart();
        }
    }

    fn relax_biases(&mut self, duration: T) {
        let c = &self.config;
        let settings = [
            WanderSettings {
                std: c.accelerometer_wander_std,
                time_s: c.accelerometer_wander_time_s,
                walk: c.accelerometer_bias_random_walk,
            },
            WanderSettings {
                std: c.gyroscope_wander_std,
                time_s: c.gyroscope_wander_time_s,
                walk: c.gyroscope_bias_random_walk,
            },
        ];
        self.filter
            .relax_biases(&mut self.at_rest, &settings, duration, &mut self.side);
    }

    /// Goes on over a time without inertial samples: the velocity is held and everything grows uncertain.
    fn bridge(&mut self, duration: T) {
        self.gaps = self.gaps.saturating_add(1);
        self.history.clear();
        self.window = StillnessWindow::default();
        self.still_windows = 0;
        if duration > lit(LONGEST_GAP_S) {
            self.restart();
        } else if self.aligning.is_some() {
            // North is another arbitrary one: what was seen against the old one is over.
            self.aligning = Some(Alignment::default());
            self.seen = Seen::default();
        } else if duration > T::zero() {
            self.hold_velocity(duration);
        }
    }

    fn hold_velocity(&mut self, duration: T) {
        self.catch_up();
        let walks = [
            self.config.gap_attitude_random_walk,
            self.config.gap_velocity_random_walk,
        ];
        let transition = self.filter.hold_velocity(duration, walks);
        self.follow(&transition);
    }

    /// Moves the time on where there is no inertial unit.
    fn go_on_without_samples(&mut self, time_ns: i64) {
        let now = self.now_ns.unwrap_or(time_ns);
        let duration: T = seconds(now, time_ns);
        if duration <= T::zero() && self.now_ns.is_some() {
            if duration < T::zero() {
                self.note_stamp_behind(time_ns, now);
            }
            return;
        }
        self.behind = 0;
        self.now_ns = Some(time_ns);
        if duration > lit(LONGEST_GAP_S) {
            self.restart();
        }
        match &mut self.aligning {
            Some(alignment) => alignment.assume_level(),
            None => {
                self.hold_velocity(duration);
                let tilt = lit(alignment::TILT_STD_ASSUMED);
                self.filter.hold_level(&mut self.side, tilt);
                self.since_velocity += duration;
                self.since_constraint += duration;
                self.constrain();
                self.damp(duration);
            }
        }
    }

    /// Forgets the state and aligns again.
    fn restart(&mut self) {
        self.restarts = self
            .restarts
            .saturating_add(u32::from(self.aligning.is_none()));
        self.aligning = Some(Alignment::default());
        self.seen = Seen::default();
        self.side = SideStates::default();
        self.history.clear();
        self.due_window = None;
        self.last_fix_ns = None;
        self.last_magnetic_ns = None;
        self.gates = [CountedGate::default(); Aid::ALL.len()];
        self.standing_rate_gate = CountedGate::default();
    }

    /// The state when a measurement was valid whose stamp is `time_ns` and which is `latency` late.
    fn instant(&self, time_ns: i64, latency: T) -> Instant<T> {
        let now = self.now_ns.unwrap_or(time_ns);
        let age = seconds::<T>(time_ns, now) + latency;
        self.history
            .at(self.filter.state(), self.config.gravity, age)
    }
}

/// Seconds between two stamps.
fn seconds<T: Scalar>(from_ns: i64, to_ns: i64) -> T {
    lit(to_ns.saturating_sub(from_ns) as f64 * 1e-9)
}
