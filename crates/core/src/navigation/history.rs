//! History of inertial samples: where the body was when a late fix was valid.
//!
//! *Read first:* `docs/derivations/error_state.md`, section 8 (E18-E20).
//!
//! The strapdown step can be undone exactly, so the past is not stored: the samples are, and the present state,
//! with all corrections it has had since, is run backwards through them. A ring of `N` samples, no allocation;
//! 36 bytes each in single precision.

use nalgebra::{UnitQuaternion, Vector3};

use super::NavigationState;
use crate::earth::FrameChange;
use crate::geometry::so3;
use crate::restorable::{InvalidState, expect};
use crate::scalar::{Scalar, lit};

/// What held over an interval, as it was given to the filter.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct HeldSample<T: Scalar> {
    /// Angular rate, rad/s, body axes.
    pub angular_rate: Vector3<T>,
    /// Specific force, m/s^2, body axes.
    pub specific_force: Vector3<T>,
    /// The interval, s.
    pub dt: T,
    /// Noise densities of gyroscope, (rad/s)/sqrt(Hz), and accelerometer, (m/s^2)/sqrt(Hz), where something stands for a sample that
    /// was not measured; 0 where it was.
    pub unseen: [T; 2],
}

/// The last samples.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(
        serialize = "T: Scalar + serde::Serialize",
        deserialize = "T: Scalar + serde::Deserialize<'de>"
    ))
)]
pub struct ImuHistory<T: Scalar, const N: usize> {
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::array"))]
    steps: [HeldSample<T>; N],
    next: usize,
    len: usize,
}

/// The navigation state at an instant near the present, and how it hangs together with the present.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Instant<T: Scalar> {
    /// Attitude then, `ned_from_body`.
    pub ned_from_body: UnitQuaternion<T>,
    /// Velocity then, m/s, NED.
    pub velocity: Vector3<T>,
    /// Position then, m, NED.
    pub position: Vector3<T>,
    /// Angular rate then without bias, rad/s, body axes.
    pub angular_rate: Vector3<T>,
    /// Acceleration then, m/s^2, NED.
    pub acceleration: Vector3<T>,
    /// How long ago it was, s; negative: it is yet to come.
    pub age_s: T,
    /// Integral of the specific force in NED from then to the present, m/s.
    pub force_integral: Vector3<T>,
}

impl<T: Scalar, const N: usize> Default for ImuHistory<T, N> {
    fn default() -> Self {
        let none = HeldSample {
            angular_rate: Vector3::zeros(),
            specific_force: Vector3::zeros(),
            dt: T::zero(),
            unseen: [T::zero(); 2],
        };
        Self {
            steps: [none; N],
            next: 0,
            len: 0,
        }
    }
}

impl<T: Scalar, const N: usize> ImuHistory<T, N> {
    /// Keeps a sample; the oldest one goes.
    #[inline]
    pub fn push(&mut self, sample: &HeldSample<T>) {
        if let Some(place) = self.steps.get_mut(self.next) {
            *place = *sample;
            self.next = (self.next + 1) % N;
            self.len = (self.len + 1).min(N);
        }
    }

    /// Whether a saved one can be continued from.
    pub(super) fn check(&self) -> Result<(), InvalidState> {
        let numbers = |step: &HeldSample<T>| {
            let vectors = step.angular_rate.norm_squared() + step.specific_force.norm_squared();
            let [gyroscope, accelerometer] = step.unseen;
            (vectors + gyroscope + accelerometer).is_finite() && step.dt.is_finite()
        };
        expect("history", self.steps.iter().all(numbers), "finite")?;
        let in_place = self.len <= N && self.next < N.max(1);
        expect("history", in_place, "of the length of the filter's")
    }

    /// Goes on in another local frame, in which the present state is `state`: the samples are those that the filter of that
    /// frame, whose down is another direction, would have had (E43).
    pub(super) fn move_origin(
        &mut self,
        change: &FrameChange<T>,
        state: &NavigationState<T>,
        gravity: T,
    ) {
        let down = Vector3::z() * gravity;
        let felt = change.vector(&down) - down;
        let mut attitude = state.ned_from_body;
        for back in 1..=self.len {
            let Some(step) = self.steps.get_mut((self.next + N - back) % N) else {
                return;
            };
            let rate = step.angular_rate - state.gyroscope_bias;
            let half_turn = so3::exp(&(rate * (-step.dt * lit(0.5))));
            let middle = attitude * half_turn;
            step.specific_force += middle.inverse() * felt;
            attitude = middle * half_turn;
        }
    }

    /// Forgets all: the state has moved by other means.
    pub fn clear(&mut self) {
        self.len = 0;
    }

    /// The samples of the last `age_s` seconds, oldest first; of the oldest only the part that is within.
    pub fn since(&self, age_s: T) -> impl Iterator<Item = HeldSample<T>> {
        let (mut count, mut left) = (0, age_s);
        for step in self.newest_first() {
            if left <= T::zero() {
                break;
            }
            left -= step.dt;
            count += 1;
        }
        // What the oldest one has before.
        let mut before = -left.min(T::zero());
        (1..=count).rev().filter_map(move |back| {
            let mut step = *self.steps.get((self.next + N - back) % N)?;
            step.dt -= core::mem::replace(&mut before, T::zero());
            Some(step)
        })
    }

    /// Seconds of the newest `samples` samples.
    pub fn duration_s(&self, samples: usize) -> T {
        let newest = self.newest_first().take(samples);
        newest.fold(T::zero(), |sum, step| sum + step.dt)
    }

    /// Samples kept.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    fn newest_first(&self) -> impl Iterator<Item = &HeldSample<T>> {
        (1..=self.len).filter_map(move |back| self.steps.get((self.next + N - back) % N))
    }

    /// The state `age_s` seconds before the present `state` (E18). Beyond the samples kept, and before the
    /// present by a negative age, the nearest sample is held. `gravity` as the filter has it.
    pub fn at(&self, state: &NavigationState<T>, gravity: T, age_s: T) -> Instant<T> {
        let mut then = Instant {
            ned_from_body: state.ned_from_body,
            velocity: state.velocity,
            position: state.position,
            angular_rate: Vector3::zeros(),
            acceleration: Vector3::zeros(),
            age_s: T::zero(),
            force_integral: Vector3::zeros(),
        };
        let down = Vector3::z() * gravity;
        let mut left = age_s;
        let mut last = None;
        for step in self.newest_first() {
            last = Some(*step);
            let dt = left.min(step.dt);
            then.undo(state, step, &down, dt);
            left -= dt;
            if left <= T::zero() {
                return then;
            }
        }
        match last {
            Some(step) => then.undo(state, &step, &down, left),
            // Nothing is known but the velocity.
            None => {
                then.position -= then.velocity * left;
                then.age_s += left;
            }
        }
        then
    }
}

impl<T: Scalar> Instant<T> {
    /// Goes back by `dt` under a sample (E18); forth when `dt` is negative.
    #[inline]
    fn undo(&mut self, state: &NavigationState<T>, step: &HeldSample<T>, down: &Vector3<T>, dt: T) {
        let half = lit::<T>(0.5);
        self.angular_rate = step.angular_rate - state.gyroscope_bias;
        let half_turn = so3::exp(&(self.angular_rate * (-dt * half)));
        let middle = self.ned_from_body * half_turn;
        let force = middle * (step.specific_force - state.accelerometer_bias);
        self.acceleration = force + down;
        let gained = self.acceleration * dt;
        self.velocity -= gained;
        self.position -= (self.velocity + gained * half) * dt;
        self.ned_from_body = middle * half_turn;
        self.force_integral += force * dt;
        self.age_s += dt;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::rotation;
    use crate::navigation::{ErrorStateConfig, ErrorStateFilter, ErrorTransition};
    use approx::assert_relative_eq;
    use nalgebra::SMatrix;

    const DT: f64 = 0.01;

    fn start() -> NavigationState<f64> {
        NavigationState {
            ned_from_body: rotation::from_yaw_pitch_roll([0.7, 0.1, -0.2]),
            velocity: Vector3::new(8.0, 5.0, 0.1),
            position: Vector3::new(100.0, -50.0, 1.0),
            accelerometer_bias: Vector3::new(0.02, -0.01, 0.03),
            gyroscope_bias: Vector3::new(1e-3, -2e-3, 5e-4),
            covariance: SMatrix::identity(),
            pending: ErrorTransition::default(),
            skipped: 0,
        }
    }

    fn held(rate: &Vector3<f64>, force: &Vector3<f64>) -> HeldSample<f64> {
        HeldSample {
            angular_rate: *rate,
            specific_force: *force,
            dt: DT,
            unseen: [0.0; 2],
        }
    }

    fn sample(k: i32) -> (Vector3<f64>, Vector3<f64>) {
        let t = f64::from(k) * DT;
        let rate = Vector3::new(0.3 * t.sin(), 0.2, 0.4 * (2.0 * t).cos());
        (rate, Vector3::new(1.0, 0.4 * (3.0 * t).sin(), -9.7))
    }

    #[test]
    fn the_past_is_what_it_was() {
        let mut filter = ErrorStateFilter::new(ErrorStateConfig::default(), start()).unwrap();
        let mut history = ImuHistory::<f64, 16>::default();
        let mut states = std::vec::Vec::new();
        for k in 0..40 {
            states.push(*filter.state());
            let (rate, force) = sample(k);
            filter.propagate(&rate, &force, DT).unwrap();
            history.push(&held(&rate, &force));
        }
        let gravity = filter.config().gravity;
        for back in [1, 7, 16] {
            let was = &states[40 - back];
            let then = history.at(filter.state(), gravity, back as f64 * DT);
            assert_relative_eq!(then.position, was.position, epsilon = 1e-9);
            assert_relative_eq!(then.velocity, was.velocity, epsilon = 1e-9);
            assert!(rotation::angle_between(&then.ned_from_body, &was.ned_from_body) < 1e-9);
            assert_relative_eq!(then.age_s, back as f64 * DT, epsilon = 1e-12);
        }
        // Between two samples: half of the last one undone.
        let half = history.at(filter.state(), gravity, 0.5 * DT);
        let mean = (states[39].position + filter.state().position) * 0.5;
        assert_relative_eq!(half.position, mean, epsilon = 1e-4);
    }

    #[test]
    fn the_samples_of_the_last_seconds_come_oldest_first() {
        let mut history = ImuHistory::<f64, 4>::default();
        for k in 0..6 {
            let (rate, force) = sample(k);
            history.push(&held(&rate, &force));
        }
        let all: std::vec::Vec<_> = history.since(1.0).collect();
        assert_eq!(all.len(), 4);
        assert_eq!(all[0].angular_rate, sample(2).0);
        let last: std::vec::Vec<_> = history.since(1.25 * DT).collect();
        assert_eq!(last.len(), 2);
        assert_eq!(last[1].specific_force, sample(5).1);
        assert_relative_eq!(last[0].dt, 0.25 * DT, epsilon = 1e-12);
        assert_relative_eq!(history.duration_s(3), 3.0 * DT, epsilon = 1e-12);
        assert_eq!(history.since(-1.0).count(), 0);
    }

    #[test]
    fn beyond_what_is_kept_and_ahead_the_nearest_sample_is_held() {
        let mut filter = ErrorStateFilter::new(ErrorStateConfig::default(), start()).unwrap();
        let mut history = ImuHistory::<f64, 4>::default();
        let (rate, force) = sample(0);
        let mut states = std::vec::Vec::new();
        for _ in 0..20 {
            states.push(*filter.state());
            filter.propagate(&rate, &force, DT).unwrap();
            history.push(&held(&rate, &force));
        }
        let gravity = filter.config().gravity;
        let then = history.at(filter.state(), gravity, 0.1);
        assert_relative_eq!(then.position, states[10].position, epsilon = 1e-3);
        let ahead = history.at(&states[19], gravity, -DT);
        assert_relative_eq!(ahead.position, filter.state().position, epsilon = 1e-6);
        assert_relative_eq!(ahead.velocity, filter.state().velocity, epsilon = 1e-6);
        history.clear();
        let blind = history.at(filter.state(), gravity, 0.1);
        let expected = filter.state().position - filter.state().velocity * 0.1;
        assert_relative_eq!(blind.position, expected, epsilon = 1e-12);
    }
}
