//! The covariance of a GNSS/INS brought up to its state: augmented states, biases that relax, gaps, and the restart.

use super::start_without_inertial::{LevelStart, TILT_STD_ASSUMED};
use super::{Aid, CovarianceStep, ERRORS, ErrorListener, GnssIns, LONGEST_GAP_S, seconds};
use crate::kalman::CountedGate;
use crate::navigation::ErrorTransition;
use crate::navigation::augmented_states::{
    AUGMENTED_STATES, AugmentedStates, AugmentedStep, BAROMETER_OFFSET, GNSS_OFFSET,
    MAGNETIC_OFFSET,
};
use crate::navigation::gauss_markov_bias::GaussMarkovBias;
use crate::navigation::history::Instant;
use crate::scalar::{Scalar, lit};

/// The covariance follows the state at least so often, s.
const COVARIANCE_INTERVAL_S: f64 = 0.1;

impl<T: Scalar, const HISTORY: usize, L: ErrorListener<T, ERRORS>> GnssIns<T, HISTORY, L> {
    /// Whether [`Self::settle`] has something to do: the covariance is 0.1 s behind, or a window or interval is over in
    /// which the filter constrains itself.
    pub fn is_due(&self) -> bool {
        let behind = self.pending_s() >= lit(COVARIANCE_INTERVAL_S);
        self.memory.started
            && (behind || self.memory.due_window.is_some() || self.is_constraint_due())
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
        &self.memory.last_step
    }

    /// Brings the covariance up to the state.
    pub fn catch_up(&mut self) {
        if self.pending_s() > T::zero() {
            let transition = self.filter.catch_up_without_limits();
            self.follow(&transition);
        }
    }

    /// Brings what is beside the filter along.
    fn follow(&mut self, transition: &ErrorTransition<T>) {
        let duration = transition.duration_s();
        let mut step = AugmentedStep {
            decay: [T::one(); AUGMENTED_STATES],
            added: [T::zero(); AUGMENTED_STATES],
        };
        let kept = (-duration / self.config.position_correlation_time_s).exp();
        for i in 0..3 {
            step.decay[GNSS_OFFSET + i] = kept;
            step.added[GNSS_OFFSET + i] = self.memory.slow_variance[i] * (T::one() - kept * kept);
        }
        if self.memory.side.is_used(BAROMETER_OFFSET) {
            let walk = self.config.barometer_offset_random_walk;
            step.added[BAROMETER_OFFSET] = walk * walk * duration;
        }
        if self.memory.side.is_used(MAGNETIC_OFFSET) {
            let walk = self.config.magnetic_offset_random_walk_ut;
            for i in 0..3 {
                step.added[MAGNETIC_OFFSET + i] = walk * walk * duration;
            }
        }
        self.memory.side.propagate(transition, &step);
        let kept = |std: T, time: T| {
            if std > T::zero() {
                (-duration / time).exp()
            } else {
                T::one()
            }
        };
        let c = &self.config;
        self.memory.last_step = CovarianceStep {
            transition: *transition,
            bias_kept: [
                kept(
                    c.accelerometer_gauss_markov_std,
                    c.accelerometer_gauss_markov_time_s,
                ),
                kept(
                    c.gyroscope_gauss_markov_std,
                    c.gyroscope_gauss_markov_time_s,
                ),
            ],
            side_kept: step.decay,
        };
        self.relax_biases(duration);
        let step = self.memory.last_step;
        let (side, mut listener) = self.memory.followed(&mut self.listener);
        listener.propagated(&step);
        self.filter.limit_covariance(side, &mut listener);
        if !(self.filter.state().is_sound() && self.memory.side.is_usable()) {
            self.restart();
        }
    }

    fn relax_biases(&mut self, duration: T) {
        let c = &self.config;
        let settings = [
            GaussMarkovBias {
                std: c.accelerometer_gauss_markov_std,
                time_s: c.accelerometer_gauss_markov_time_s,
                walk: c.accelerometer_bias_random_walk,
            },
            GaussMarkovBias {
                std: c.gyroscope_gauss_markov_std,
                time_s: c.gyroscope_gauss_markov_time_s,
                walk: c.gyroscope_bias_random_walk,
            },
        ];
        self.filter.relax_biases(
            &mut self.memory.at_rest,
            &settings,
            duration,
            &mut self.memory.side,
        );
    }

    pub(super) fn hold_velocity(&mut self, duration: T) {
        self.catch_up();
        let walks = [
            self.config.gap_attitude_random_walk,
            self.config.gap_velocity_random_walk,
        ];
        let transition = self.filter.hold_velocity(duration, walks);
        self.follow(&transition);
    }

    /// Moves the time on where there is no inertial unit.
    pub(super) fn go_on_without_samples(&mut self, time_ns: i64) {
        let now = self.memory.now_ns.unwrap_or(time_ns);
        let duration: T = seconds(now, time_ns);
        if duration <= T::zero() && self.memory.now_ns.is_some() {
            if duration < T::zero() {
                self.note_stamp_behind(time_ns, now);
            }
            return;
        }
        self.memory.behind = 0;
        self.memory.now_ns = Some(time_ns);
        if duration > lit(LONGEST_GAP_S) {
            self.restart();
        }
        if self.memory.started {
            self.hold_velocity(duration);
            let tilt = lit(TILT_STD_ASSUMED);
            let (side, mut listener) = self.memory.followed(&mut self.listener);
            self.filter.hold_level(side, tilt, &mut listener);
            self.memory.since_velocity += duration;
            self.memory.since_constraint += duration;
            self.constrain();
            self.damp(duration);
        }
    }

    /// Forgets the state and aligns again.
    pub(super) fn restart(&mut self) {
        self.memory.restarts = self
            .memory
            .restarts
            .saturating_add(u32::from(self.memory.started));
        self.memory.started = false;
        self.memory.aligning = true;
        self.alignment.forget();
        (self.memory.unfed_s, self.memory.unfed) = (T::zero(), 0);
        self.memory.aligned_fix_ns = None;
        self.memory.aligned_since_ns = None;
        self.memory.held_velocity = None;
        self.memory.level = LevelStart::default();
        self.memory.noise_scale = [T::one(); 3];
        self.memory.disagreeing = 0;
        self.memory.side = AugmentedStates::default();
        self.memory.history.clear();
        self.memory.due_window = None;
        self.memory.last_fix_ns = None;
        self.memory.last_magnetic_ns = None;
        self.memory.gates = [CountedGate::default(); Aid::ALL.len()];
        self.memory.standing_rate_gate = CountedGate::default();
    }

    /// The state when a measurement was valid whose stamp is `time_ns` and which is `latency` late.
    pub(super) fn instant(&self, time_ns: i64, latency: T) -> Instant<T> {
        let now = self.memory.now_ns.unwrap_or(time_ns);
        let age = seconds::<T>(time_ns, now) + latency;
        self.memory
            .history
            .at(self.filter.state(), self.config.gravity, age)
    }
}
