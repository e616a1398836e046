//! The position observer behind an attitude estimator: when it moves on, and by which positions.
//!
//! Everything of one instant comes in the order gyroscope, accelerometer, magnetometer, position. The
//! newest specific force is held over the time to the instant; where it is older than a gap of the
//! gyroscope may be, or was none (an accelerometer that is silent shows zero), the velocity is held.
//! A position older than the state is compared with the estimate of its own time.

use nalgebra::{UnitQuaternion, Vector3};
use northing_core::attitude::AttitudeEstimator;
use northing_core::attitude::driver::AttitudeDriver;
use northing_core::kalman::{Innovation, SkipReason};
use northing_core::navigation::cascade::{Cascade, CascadeConfig, CascadeState};

use crate::attitude::options::tangent_frame;
use crate::attitude::{Instant, PositionRms, PositionSummary, RunOptions, RunSummary};
use crate::error::EvaluationError;
use crate::statistics::nis::UpdateCounts;
use crate::statistics::seconds_between;

/// Specific forces shorter than this are of an accelerometer that is off, m/s^2.
const SILENCE_M_S2: f64 = 1e-3;
/// A velocity is held no longer than this over one pause, s: after it, where the body is is what the
/// next position says.
const LONGEST_HOLD_S: f64 = 10.0;
/// The same numbers within this time are a position that a receiver holds, s; later they may be those
/// of a body that rests.
const HELD_S: f64 = 2.0;

/// The observer, its clock, and what it has counted.
pub(super) struct PositionObserver<E> {
    cascade: Cascade<f64>,
    config: CascadeConfig<f64>,
    /// Unit vector up in the world frame, and the specific force at rest, m/s^2.
    up: Vector3<f64>,
    force_at_rest: Vector3<f64>,
    /// Where the attitude comes from.
    rotation: fn(&E) -> UnitQuaternion<f64>,
    /// How long a force may be held, s.
    gap_limit_s: f64,
    /// Time of the observer's state.
    now_ns: Option<i64>,
    /// The newest specific force and its time.
    force: Option<(i64, Vector3<f64>)>,
    /// The newest rate without bias, rad/s.
    rate: Vector3<f64>,
    /// The newest position that was not a repetition, and its time.
    last: Option<(i64, Vector3<f64>)>,
    updates: UpdateCounts,
    residuals: Residuals,
}

/// Sums of squares of the innovations used, m^2.
#[derive(Debug, Clone, Copy, Default)]
struct Residuals {
    horizontal: f64,
    vertical: f64,
    count: u64,
}

impl<E: AttitudeEstimator<f64>> PositionObserver<E> {
    /// An observer that waits for attitude and positions.
    ///
    /// # Errors
    /// A setting is invalid.
    pub(super) fn new(
        options: &RunOptions,
        rotation: fn(&E) -> UnitQuaternion<f64>,
    ) -> Result<Self, EvaluationError> {
        let config = options.config.cascade;
        let up = tangent_frame(options.world_frame).up();
        let calibrated = options.calibration.as_ref().and_then(|c| c.gravity());
        let force_at_rest = up * calibrated.unwrap_or(options.driver.prior.gravity);
        Ok(Self {
            cascade: observer(config, force_at_rest)?,
            config,
            up,
            force_at_rest,
            rotation,
            gap_limit_s: options.driver.gap_limit_s,
            now_ns: None,
            force: None,
            rate: Vector3::zeros(),
            last: None,
            updates: UpdateCounts::default(),
            residuals: Residuals::default(),
        })
    }

    /// Takes gravity (m/s^2) as a rest at the start has shown it.
    ///
    /// # Errors
    /// It is none.
    pub(super) fn measured_gravity(&mut self, gravity: f64) -> Result<(), EvaluationError> {
        self.force_at_rest = self.up * gravity;
        self.cascade = observer(self.config, self.force_at_rest)?;
        Ok(())
    }

    /// The estimate; `None` before the first position.
    pub(super) fn state(&self) -> Option<&CascadeState<f64>> {
        self.cascade.state()
    }

    /// Takes an instant at which there is no attitude yet.
    pub(super) fn wait(&mut self, instant: &Instant) -> Option<(Vector3<f64>, Innovation<f64>)> {
        let innovation = Innovation::skipped(SkipReason::NotInitialized);
        let position = instant.position?;
        self.updates.add(innovation.outcome);
        Some((position, innovation))
    }

    /// Takes an instant that the attitude estimator has taken, its rate or not (`turned`); gives its
    /// position and what it told.
    pub(super) fn step(
        &mut self,
        instant: &Instant,
        force: Option<Vector3<f64>>,
        turned: bool,
        driver: &AttitudeDriver<f64, E>,
    ) -> Option<(Vector3<f64>, Innovation<f64>)> {
        if !driver.is_started() {
            return self.wait(instant);
        }
        let time_ns = instant.time_ns;
        let attitude = (self.rotation)(&driver.estimator);
        if let Some(rate) = instant.angular_rate.filter(|_| turned) {
            self.forget_the_future(time_ns);
            self.rate = rate - driver.estimator.rate_at_rest();
        }
        let is_news = self.now_ns.is_none_or(|now| time_ns >= now);
        if let Some(force) = force.filter(|f| is_news && f.norm() >= SILENCE_M_S2) {
            self.force = Some((time_ns, force));
        }
        self.advance(time_ns, &attitude);
        let position = instant.position?;
        let is_first = self.state().is_none();
        let innovation = self.take(time_ns, &position, &attitude);
        self.updates.add(innovation.outcome);
        if innovation.outcome.is_fused() && !is_first {
            self.residuals.add(&innovation.residual);
        }
        Some((position, innovation))
    }

    /// A gyroscope sample from long before the state says that the stamp that led there was false.
    fn forget_the_future(&mut self, time_ns: i64) {
        if self
            .now_ns
            .is_some_and(|now| seconds_between(time_ns, now) > self.gap_limit_s)
        {
            self.now_ns = Some(time_ns);
            self.force = None;
        }
    }

    fn advance(&mut self, time_ns: i64, attitude: &UnitQuaternion<f64>) {
        let dt = self.now_ns.map_or(0.0, |now| seconds_between(now, time_ns));
        if dt < 0.0 {
            return;
        }
        self.now_ns = Some(time_ns);
        if let Some((at_ns, force)) = self.force
            && seconds_between(at_ns, time_ns).max(dt) <= self.gap_limit_s
            && self.cascade.propagate(attitude, &force, dt).is_ok()
        {
            return;
        }
        let bias = self.state().map(|state| state.accelerometer_bias);
        let still = attitude.inverse() * self.force_at_rest + bias.unwrap_or_default();
        // It refuses only what is not finite, and neither of them ever is.
        let _ = self
            .cascade
            .propagate(attitude, &still, dt.min(LONGEST_HOLD_S));
    }

    fn take(
        &mut self,
        time_ns: i64,
        position: &Vector3<f64>,
        attitude: &UnitQuaternion<f64>,
    ) -> Innovation<f64> {
        if let Some((last_ns, last)) = self.last
            && last == *position
            && seconds_between(last_ns, time_ns).abs() < HELD_S
        {
            return Innovation::skipped(SkipReason::Repeated);
        }
        self.last = Some((time_ns, *position));
        let age = self.now_ns.map_or(0.0, |now| seconds_between(time_ns, now));
        self.cascade
            .update_position(position, age, attitude, &self.rate)
    }

    /// Adds what became of the positions, or that there were none.
    pub(super) fn conclude(&self, summary: &mut RunSummary) {
        if self.updates == UpdateCounts::default() {
            summary.issues.push(
                "The recording has no positions: the attitude ran, and the position observer waited."
                    .to_owned(),
            );
            return;
        }
        let bias = self.state().map(|state| state.accelerometer_bias);
        summary.position = Some(PositionSummary {
            updates: self.updates.clone(),
            innovation_rms_m: self.residuals.rms(),
            accelerometer_bias_m_s2: bias.unwrap_or_default().into(),
        });
    }
}

impl Residuals {
    /// The third axis is the vertical one in either world frame.
    fn add(&mut self, residual: &Vector3<f64>) {
        self.horizontal += 0.5 * (residual.x * residual.x + residual.y * residual.y);
        self.vertical += residual.z * residual.z;
        self.count += 1;
    }

    fn rms(&self) -> Option<PositionRms> {
        let rms = |sum: f64| (sum / self.count as f64).sqrt();
        (self.count > 0).then(|| PositionRms {
            horizontal: rms(self.horizontal),
            vertical: rms(self.vertical),
        })
    }
}

fn observer(
    config: CascadeConfig<f64>,
    force_at_rest: Vector3<f64>,
) -> Result<Cascade<f64>, EvaluationError> {
    Ok(Cascade::new(config, force_at_rest)?)
}
