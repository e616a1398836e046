//! The build `error-state`: the 15-state error-state filter, aided by positions, velocities and the
//! magnetometer's heading.
//!
//! Work is spread over frames, so that no step does everything. A frame that brings a fix or a field
//! brings the covariance up to its instant; the next one fuses it, before it moves on. That is the
//! same instant, so nothing is late. The velocity of a fix comes two frames later: what it is off by is
//! taken at its instant, and 40 ms hardly change the error. A field is used five times a second, when
//! nothing else is.
//! [`northing_core::navigation::gnss_ins`] does more, on chips with more memory.

use northing_core::geometry::trigonometry::{atan2, sin_cos};
use northing_core::kalman::{CountedGate, Innovation};
use northing_core::nalgebra::{
    ComplexField, Quaternion, SMatrix, SVector, UnitQuaternion, Vector3,
};
use northing_core::navigation::aiding::heading;
use northing_core::navigation::error_state::{Row, SparseMeasurement};
use northing_core::navigation::history::Instant;
use northing_core::navigation::validity::ValidityLimits;
use northing_core::navigation::{
    ATTITUDE, AugmentedStates, ErrorStateConfig, ErrorStateFilter, ErrorTransition,
    NavigationState, POSITION, STATES, VELOCITY,
};

use super::{
    Attitude, Estimate, Inertial, Motion, Navigator, Position, Unseen, angles_at_rest, std_of,
};

/// Standard deviation of a position at a dilution of 1, m: 3 m of circular error probable, per axis.
const POSITION_STD_M: f32 = 2.55;
/// How much larger the vertical one is.
const VERTICAL_FACTOR: f32 = 2.0;
/// Standard deviation of a velocity from speed and course, m/s.
const VELOCITY_STD_M_S: f32 = 0.15;
/// Standard deviation of a heading from the field, rad: iron near by does not average out.
const HEADING_STD: f32 = 0.15;
/// 99.9 % of chi-square with one, two, three degrees of freedom.
const GATES: [f32; 3] = [10.8, 13.8, 16.3];
/// A field is used in one of so many frames: 5 Hz.
const FIELD_EVERY: u32 = 10;
/// The covariance follows at least so often, s.
const CATCH_UP_S: f32 = 0.3;
/// A rest that turns faster than this (rad/s) was none, and tells no bias.
const FASTEST_REST: f32 = 0.1;

/// White noise of gyroscope and accelerometer, rad/s and m/s^2 per sqrt(Hz) ...
const NOISE_DENSITIES: [f32; 2] = [1e-3, 0.02];
/// ... and of what stands for them while they are not seen: a turn of 1 rad/s that lasts for 0.2 s, a stride.
const UNSEEN_DENSITIES: [f32; 2] = [0.6, 2.0];

/// What is known at the start, as standard deviations: tilt and heading (rad), velocity (m/s), position (m),
/// biases (m/s^2, rad/s).
const START_STD: [f32; STATES] = [
    0.02, 0.02, 0.1, 0.5, 0.5, 0.5, 30.0, 30.0, 30.0, 0.15, 0.15, 0.15, 3e-3, 3e-3, 3e-3,
];

/// The filter, and what waits for the next frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorStateNavigator {
    filter: ErrorStateFilter<f32>,
    /// None is in use.
    side: AugmentedStates<f32>,
    /// Of heading, velocity, position.
    gates: [CountedGate; 3],
    waiting: Waiting,
    /// The velocity of a fix that was just fused: for the frame after the next.
    velocity: Option<[f32; 2]>,
    frames_since_field: u32,
    specific_force: Vector3<f32>,
    since_fix_s: Option<f32>,
    unseen: Unseen,
}

/// What is fused before the next frame moves on.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Waiting {
    Nothing,
    Fix(Position),
    Field(Vector3<f32>),
    /// What a velocity was off by, north and east, m/s.
    Velocity([f32; 2]),
}

impl Navigator for ErrorStateNavigator {
    const NAME: &'static [u8] = b"error-state";

    fn start(rest: &Inertial) -> Option<Self> {
        let [roll, pitch, yaw] = angles_at_rest(rest)?;
        let is_rest = rest.angular_rate.norm_squared() < FASTEST_REST * FASTEST_REST;
        let state = NavigationState {
            ned_from_body: attitude_of([roll, pitch, yaw]),
            velocity: Vector3::zeros(),
            position: Vector3::zeros(),
            accelerometer_bias: Vector3::zeros(),
            gyroscope_bias: if is_rest {
                rest.angular_rate
            } else {
                Vector3::zeros()
            },
            covariance: SMatrix::from_diagonal(&SVector::from(START_STD.map(|std| std * std))),
            pending: ErrorTransition::default(),
            skipped: 0,
        };
        let [gyroscope_noise_density, accelerometer_noise_density] = NOISE_DENSITIES;
        let config = ErrorStateConfig {
            accelerometer_noise_density,
            gyroscope_noise_density,
            accelerometer_bias_random_walk: 1e-3,
            gyroscope_bias_random_walk: 3e-5,
            ..ErrorStateConfig::default()
        };
        Some(Self {
            filter: ErrorStateFilter::new(config, state).ok()?,
            side: AugmentedStates::default(),
            gates: [CountedGate::default(); 3],
            waiting: Waiting::Nothing,
            velocity: None,
            frames_since_field: 0,
            specific_force: rest.specific_force?,
            since_fix_s: None,
            unseen: Unseen::default(),
        })
    }

    fn step(&mut self, inertial: &Inertial, position: Option<&Position>) {
        let velocity = self.velocity.take();
        match core::mem::replace(&mut self.waiting, Waiting::Nothing) {
            Waiting::Nothing => {}
            Waiting::Fix(fix) => self.fuse_fix(&fix),
            Waiting::Field(field) => self.fuse_field(&field),
            Waiting::Velocity(off_by) => self.fuse_velocity(off_by),
        }
        if self.unseen != inertial.unseen {
            self.expect(inertial.unseen);
        }
        let dt_s = inertial.dt_s();
        let force = self.force(inertial);
        self.since_fix_s = self.since_fix_s.map(|since| (since + dt_s).min(1e6));
        // A frame that stands for no time is refused and counted, as one that is not finite.
        let _ = self.filter.propagate(&inertial.angular_rate, &force, dt_s);

        self.frames_since_field = self.frames_since_field.saturating_add(1);
        let is_field_due = self.frames_since_field >= FIELD_EVERY && self.velocity.is_none();
        self.waiting = match (position, velocity, inertial.magnetic_field) {
            (Some(fix), _, _) => Waiting::Fix(*fix),
            (None, Some(off_by), _) => Waiting::Velocity(off_by),
            (None, None, Some(field)) if is_field_due => {
                self.frames_since_field = 0;
                Waiting::Field(field)
            }
            _ => Waiting::Nothing,
        };
        let pending_s = self.filter.state().pending.duration_s();
        if self.waiting != Waiting::Nothing || pending_s > CATCH_UP_S {
            self.catch_up();
        }
    }

    fn gyroscope_bias(&self) -> Vector3<f32> {
        self.filter.state().gyroscope_bias
    }

    fn estimate(&self) -> Estimate {
        let state = self.filter.state();
        let variances = state.covariance.diagonal();
        let std = |first: usize| variances.fixed_rows::<3>(first).map(std_of);
        let [north, east] = [
            variances.fixed_rows::<1>(POSITION),
            variances.fixed_rows::<1>(POSITION + 1),
        ]
        .map(|v| v.x);
        let motion = Motion {
            position: state.position,
            velocity: state.velocity,
            position_std: std(POSITION),
        };
        Estimate {
            attitude: Some(Attitude {
                angles: angles_of(&state.ned_from_body),
                std: std(ATTITUDE),
            }),
            motion: self.since_fix_s.map(|_| motion),
            validity: ValidityLimits::default().judge(self.since_fix_s, north.max(east)),
        }
    }

    fn is_sound(&self) -> bool {
        let state = self.filter.state();
        // A sum is finite when all are; variances are never negative.
        let sum = state.position.sum() + state.velocity.sum() + state.ned_from_body.coords.sum();
        let variances = state.covariance.diagonal();
        (sum + variances.sum()).is_finite() && variances.iter().all(|v| *v >= 0.0)
    }

    fn state_bits(&self, mut take: impl FnMut(f32)) {
        let state = self.filter.state();
        state
            .ned_from_body
            .coords
            .iter()
            .copied()
            .for_each(&mut take);
        for vector in [
            &state.velocity,
            &state.position,
            &state.accelerometer_bias,
            &state.gyroscope_bias,
        ] {
            vector.iter().copied().for_each(&mut take);
        }
        state.covariance.iter().copied().for_each(&mut take);
    }
}

impl ErrorStateNavigator {
    /// Brings the covariance up to the last sample. One copy: it is large.
    #[inline(never)]
    fn catch_up(&mut self) {
        // Nobody here is correlated with the errors.
        let _ = self.filter.catch_up();
    }

    /// Expects from now on the noise of what is seen, and of what is not.
    fn expect(&mut self, unseen: Unseen) {
        self.unseen = unseen;
        // What has come so far had the noise of before.
        self.catch_up();
        let [rate, force] = NOISE_DENSITIES;
        let [any_rate, any_force] = UNSEEN_DENSITIES;
        self.filter.set_noise_densities([
            if unseen.rate { any_rate } else { rate },
            if unseen.force { any_force } else { force },
        ]);
    }

    /// The force to move on with: the last sound one, or that of a body at rest.
    fn force(&mut self, inertial: &Inertial) -> Vector3<f32> {
        if let Some(force) = inertial.specific_force {
            self.specific_force = force;
        } else if inertial.unseen.force {
            let state = self.filter.state();
            let up = Vector3::z() * -self.filter.config().gravity;
            self.specific_force = state.ned_from_body.inverse() * up + state.accelerometer_bias;
        }
        match &inertial.push {
            Some(push) => self.specific_force + push / inertial.dt_s(),
            None => self.specific_force,
        }
    }

    fn fuse_fix(&mut self, fix: &Position) {
        let std = POSITION_STD_M * fix.hdop;
        let [across, down] = [std * std, std * std * VERTICAL_FACTOR * VERTICAL_FACTOR];
        let position = SparseMeasurement {
            rows: [0, 1, 2].map(|i| Row::of_state(POSITION + i)),
            residual: fix.ned - self.filter.state().position,
            variance: Vector3::new(across, across, down),
            freed: [POSITION, POSITION + 1, POSITION + 2],
        };
        if self.fuse(&position).outcome.is_fused() {
            self.since_fix_s = Some(0.0);
        }
        let velocity = self.filter.state().velocity;
        self.velocity = fix
            .velocity
            .map(|[north, east]| [north - velocity.x, east - velocity.y]);
    }

    fn fuse_velocity(&mut self, [north, east]: [f32; 2]) {
        let measured = SparseMeasurement {
            rows: [0, 1].map(|i| Row::of_state(VELOCITY + i)),
            residual: SVector::<f32, 2>::new(north, east),
            variance: SVector::<f32, 2>::repeat(VELOCITY_STD_M_S * VELOCITY_STD_M_S),
            freed: [VELOCITY, VELOCITY + 1],
        };
        self.fuse(&measured);
    }

    fn fuse_field(&mut self, field: &Vector3<f32>) {
        let state = self.filter.state();
        let now = Instant {
            ned_from_body: state.ned_from_body,
            velocity: state.velocity,
            position: state.position,
            angular_rate: Vector3::zeros(),
            acceleration: Vector3::zeros(),
            age_s: 0.0,
            force_integral: Vector3::zeros(),
        };
        if let Ok(measured) = heading::magnetic(&now, field, 0.0, HEADING_STD * HEADING_STD) {
            self.fuse(&measured);
        }
    }

    /// Fuses a measurement through the gate of as many components.
    fn fuse<const M: usize>(&mut self, measured: &SparseMeasurement<f32, M>) -> Innovation<f32> {
        let [one, two, three] = &mut self.gates;
        let [of_one, of_two, of_three] = GATES;
        let (gate, threshold) = match M {
            1 => (one, of_one),
            2 => (two, of_two),
            _ => (three, of_three),
        };
        self.filter
            .fuse_sparse(&mut self.side, measured, gate, threshold, &mut ())
    }
}

/// The attitude with these angles of roll, pitch and yaw. Here and below in single precision, unlike the library's.
fn attitude_of(angles: [f32; 3]) -> UnitQuaternion<f32> {
    let [(sr, cr), (sp, cp), (sy, cy)] = angles.map(|angle| sin_cos(angle * 0.5));
    UnitQuaternion::new_unchecked(Quaternion::new(
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    ))
}

/// Roll, pitch and yaw of an attitude.
fn angles_of(attitude: &UnitQuaternion<f32>) -> Vector3<f32> {
    let forward = attitude * Vector3::x();
    let down = attitude.inverse() * Vector3::z();
    let level = ComplexField::sqrt(forward.x * forward.x + forward.y * forward.y);
    Vector3::new(
        atan2(down.y, down.z),
        atan2(-forward.z, level),
        atan2(forward.y, forward.x),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_are_those_of_the_library() {
        for angles in [[0.3, -1.2, 3.0], [-2.9, 0.8, -1.4], [0.0; 3]] {
            let attitude = attitude_of(angles);
            let [roll, pitch, yaw] = angles;
            let expected = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
            assert!(attitude.angle_to(&expected) < 1e-6, "{attitude} {expected}");
            let off = angles_of(&attitude) - Vector3::from(angles);
            assert!(off.amax() < 2e-6, "{off}");
        }
    }
}
