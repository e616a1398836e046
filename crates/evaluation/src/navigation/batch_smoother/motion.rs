//! From one node of the batch smoother to the next: strapdown integration, transition and process noise (E5-E9, E28-E30, E43).

use nalgebra::{SMatrix, Vector3};
use northing_core::ConfigError;
use northing_core::kalman::ErrorPropagation as _;
use northing_core::navigation::augmented_states::{BAROMETER_OFFSET, GNSS_OFFSET, MAGNETIC_OFFSET};
use northing_core::navigation::gnss_ins::{GAP_LIMIT_S, GnssInsConfig, ImuSamples};
use northing_core::navigation::history::{HeldSample, ImuHistory};
use northing_core::navigation::{
    ACCELEROMETER_BIAS, ATTITUDE, ErrorStateConfig, ErrorStateFilter, ErrorTransition,
    GYROSCOPE_BIAS, POSITION, STATES, VELOCITY,
};

use super::recorder::Segment;
use super::state::State;
use super::{ALL, BIAS_AT_REST, Errors};
use crate::statistics::seconds_between;

/// Samples kept for measurements that were valid before their node.
pub(super) const HISTORY: usize = 128;
pub(super) type History = ImuHistory<f64, HISTORY>;

/// The variance of the receiver's correlated error over a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SlowError {
    /// What is left of the error, an axis each; zero: another one begins.
    pub(super) kept: Vector3<f64>,
    /// What comes to its variance, m^2.
    pub(super) added: Vector3<f64>,
}

/// How all errors go on over a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Step {
    transition: ErrorTransition<f64>,
    /// What is left of the biases about their values at rest.
    bias_kept: [f64; 2],
    slow_kept: Vector3<f64>,
}

/// A step and what comes of it.
pub(super) struct Motion {
    pub(super) end: State,
    pub(super) step: Step,
    /// Process noise of the 15 errors.
    pub(super) noise: SMatrix<f64, STATES, STATES>,
    /// Process noise of all others, on the diagonal.
    pub(super) added: Errors,
}

impl Step {
    /// `F m` (E35, E43).
    pub(super) fn map<const C: usize>(&self, m: &mut SMatrix<f64, ALL, C>) {
        let mut errors = m.fixed_view::<STATES, C>(0, 0).into_owned();
        self.transition.map_rows(&mut errors);
        for (i, mut row) in errors.row_iter_mut().enumerate().skip(ACCELEROMETER_BIAS) {
            let kept = self.bias_kept[(i - ACCELEROMETER_BIAS) / 3];
            let rest = m.row(BIAS_AT_REST + i - ACCELEROMETER_BIAS);
            row *= kept;
            row += rest * (1.0 - kept);
        }
        m.fixed_view_mut::<STATES, C>(0, 0).copy_from(&errors);
        for (i, kept) in self.slow_kept.iter().enumerate() {
            m.row_mut(STATES + GNSS_OFFSET + i).scale_mut(*kept);
        }
    }

    /// `F^T m`.
    pub(super) fn map_transposed<const C: usize>(&self, m: &mut SMatrix<f64, ALL, C>) {
        for (i, kept) in self.slow_kept.iter().enumerate() {
            m.row_mut(STATES + GNSS_OFFSET + i).scale_mut(*kept);
        }
        for i in 0..6 {
            let kept = self.bias_kept[i / 3];
            let row = m.row(ACCELEROMETER_BIAS + i).into_owned();
            let mut rest = m.row_mut(BIAS_AT_REST + i);
            rest += row * (1.0 - kept);
            m.row_mut(ACCELEROMETER_BIAS + i).copy_from(&(row * kept));
        }
        let errors = m.fixed_view::<STATES, C>(0, 0).into_owned();
        let mapped = self.transition.to_matrix().tr_mul(&errors);
        m.fixed_view_mut::<STATES, C>(0, 0).copy_from(&mapped);
    }
}

/// The inertial samples of a segment as the filter integrates them.
pub(super) struct Strapdown<'a> {
    pub(super) segment: &'a Segment,
    pub(super) config: &'a GnssInsConfig<f64>,
}

impl Strapdown<'_> {
    /// Moves `state` on from `from_ns` to `to_ns`, which lie within one gap or outside all; samples go to `history`.
    ///
    /// # Errors
    /// The settings are invalid.
    pub(super) fn advance(
        &self,
        state: &State,
        [from_ns, to_ns]: [i64; 2],
        slow: &SlowError,
        history: &mut History,
    ) -> Result<Motion, ConfigError> {
        let duration = seconds_between(from_ns, to_ns);
        let (end, transition, noise) = if self.is_in_gap(from_ns) {
            history.clear();
            self.hold(state, duration)
        } else {
            self.integrate(state, [from_ns, to_ns], history)?
        };
        let (step, added) = self.beside(transition, slow);
        let mut motion = Motion {
            end,
            step,
            noise,
            added,
        };
        motion.relax(state);
        Ok(motion)
    }

    /// Whether what follows `time_ns` is a gap between inertial samples.
    fn is_in_gap(&self, time_ns: i64) -> bool {
        let samples = &self.segment.samples;
        let next = samples.partition_point(|sample| sample.time_ns <= time_ns);
        let around = next.checked_sub(1).map(|before| samples.get(before..=next));
        matches!(around, Some(Some([a, b])) if seconds_between(a.time_ns, b.time_ns) > GAP_LIMIT_S)
    }

    /// The velocity goes on, and attitude and velocity walk at random.
    fn hold(
        &self,
        state: &State,
        duration: f64,
    ) -> (State, ErrorTransition<f64>, SMatrix<f64, STATES, STATES>) {
        let mut end = *state;
        end.position += state.velocity * duration;
        let attitude = self.config.gap_attitude_random_walk.powi(2) * duration;
        let velocity = self.config.gap_velocity_random_walk.powi(2) * duration;
        let mut noise = SMatrix::<f64, STATES, STATES>::zeros();
        for i in 0..3 {
            noise[(ATTITUDE + i, ATTITUDE + i)] = attitude;
            noise[(VELOCITY + i, VELOCITY + i)] = velocity;
            noise[(POSITION + i, POSITION + i)] = velocity * duration * duration / 3.0;
            noise[(VELOCITY + i, POSITION + i)] = velocity * duration / 2.0;
            noise[(POSITION + i, VELOCITY + i)] = velocity * duration / 2.0;
        }
        (end, ErrorTransition::without_samples(duration), noise)
    }

    /// Strapdown integration through the samples, cut at both ends.
    fn integrate(
        &self,
        state: &State,
        [from_ns, to_ns]: [i64; 2],
        history: &mut History,
    ) -> Result<(State, ErrorTransition<f64>, SMatrix<f64, STATES, STATES>), ConfigError> {
        let mut filter = ErrorStateFilter::new(self.settings(from_ns), state.navigation())?;
        let samples = &self.segment.samples;
        let mut next = samples.partition_point(|sample| sample.time_ns <= from_ns);
        let mut at_ns = from_ns;
        while at_ns < to_ns {
            let Some([before, after]) = next.checked_sub(1).and_then(|i| samples.get(i..=next))
            else {
                break;
            };
            let until_ns = after.time_ns.min(to_ns);
            let dt = seconds_between(at_ns, until_ns);
            let (rate, force) = match self.config.imu_samples {
                ImuSamples::Instants => (
                    (before.rate + after.rate) * 0.5,
                    (before.force + after.force) * 0.5,
                ),
                ImuSamples::Means | ImuSamples::None => (after.rate, after.force),
            };
            let now = filter.state();
            let moved = [&now.position, &now.velocity];
            let (rate, force) =
                self.config
                    .on_the_plane(moved, &now.ned_from_body, [&rate, &force]);
            // Cannot be refused: the filter took it.
            let _ = filter.propagate(&rate, &force, dt);
            history.push(&HeldSample {
                angular_rate: rate,
                specific_force: force,
                dt,
                unseen: [0.0; 2],
            });
            (at_ns, next) = (until_ns, next + 1);
        }
        let transition = filter.catch_up();
        let moved = filter.state();
        let end = State {
            ned_from_body: moved.ned_from_body,
            velocity: moved.velocity,
            position: moved.position,
            ..*state
        };
        Ok((end, transition, moved.covariance))
    }

    /// With the noise that the filter expected then; the biases are moved by `beside`.
    fn settings(&self, time_ns: i64) -> ErrorStateConfig<f64> {
        let causal = &self.segment.causal;
        let after = causal.partition_point(|kept| kept.time_ns <= time_ns);
        let kept = causal.get(after).or(causal.last());
        let c = self.config;
        let stated = [c.gyroscope_noise_density, c.accelerometer_noise_density];
        let [gyroscope, accelerometer] = kept.map_or(stated, |kept| kept.noise_densities);
        ErrorStateConfig {
            accelerometer_noise_density: accelerometer,
            gyroscope_noise_density: gyroscope,
            accelerometer_bias_random_walk: 0.0,
            gyroscope_bias_random_walk: 0.0,
            gravity: c.gravity,
            reset_jacobian: false,
        }
    }

    /// How biases and augmented states go on, and the noise that comes to them.
    fn beside(&self, transition: ErrorTransition<f64>, slow: &SlowError) -> (Step, Errors) {
        let c = self.config;
        let duration = transition.duration_s();
        let mut added = Errors::zeros();
        let biases = [
            (
                c.accelerometer_gauss_markov_std,
                c.accelerometer_gauss_markov_time_s,
                c.accelerometer_bias_random_walk,
            ),
            (
                c.gyroscope_gauss_markov_std,
                c.gyroscope_gauss_markov_time_s,
                c.gyroscope_bias_random_walk,
            ),
        ];
        let mut bias_kept = [1.0; 2];
        for (sensor, (std, time_s, walk)) in biases.into_iter().enumerate() {
            let walked = walk * walk * duration;
            let now = [ACCELEROMETER_BIAS, GYROSCOPE_BIAS][sensor];
            let mut noise = |first: usize, variance: f64| {
                added.fixed_rows_mut::<3>(first).fill(variance);
            };
            if std > 0.0 {
                let kept = (-duration / time_s).exp();
                bias_kept[sensor] = kept;
                noise(now, std * std * (1.0 - kept * kept));
                noise(BIAS_AT_REST + 3 * sensor, walked);
            } else {
                noise(now, walked);
            }
        }
        added
            .fixed_rows_mut::<3>(STATES + GNSS_OFFSET)
            .copy_from(&slow.added);
        added[STATES + BAROMETER_OFFSET] = c.barometer_offset_random_walk.powi(2) * duration;
        let iron = c.magnetic_offset_random_walk_ut.powi(2) * duration;
        added
            .fixed_rows_mut::<3>(STATES + MAGNETIC_OFFSET)
            .fill(iron);
        let step = Step {
            transition,
            bias_kept,
            slow_kept: slow.kept,
        };
        (step, added)
    }
}

impl Motion {
    /// What biases and the receiver's error become of those of `from`.
    fn relax(&mut self, from: &State) {
        let [force, rate] = self.step.bias_kept;
        let [force_rest, rate_rest] = from.bias_at_rest;
        self.end.accelerometer_bias = force_rest + (from.accelerometer_bias - force_rest) * force;
        self.end.gyroscope_bias = rate_rest + (from.gyroscope_bias - rate_rest) * rate;
        for (i, kept) in self.step.slow_kept.iter().enumerate() {
            self.end.side[GNSS_OFFSET + i] = from.side[GNSS_OFFSET + i] * kept;
        }
    }
}
