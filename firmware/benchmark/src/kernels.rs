//! What is counted: each filter's step, on the same motion.

use core::hint::black_box;

use cortex_m_semihosting::hprintln;
use northing_core::attitude::bounded_velocity::{BoundedVelocity, BoundedVelocityConfig};
use northing_core::attitude::{AttitudeEstimator, InitialState, References};
use northing_core::nalgebra::{ComplexField, Matrix3, SMatrix, UnitQuaternion, Vector3};
use northing_core::navigation::{
    ErrorStateConfig, ErrorStateFilter, ErrorTransition, NavigationState,
};
use northing_firmware::navigator::{AxisNavigator, ErrorStateNavigator, Position, Unseen};
use northing_firmware::sample_faults::SampleFaults;
use northing_firmware::{Inertial, Navigator};

use crate::{Counter, STEPS};

/// Steps between two fixes: 1 Hz.
const FIX_EVERY: u32 = 50;

/// Counts every filter and says so.
pub(crate) fn all(counter: &Counter) {
    faults(counter);
    navigator::<AxisNavigator>("axis-filters", counter);
    navigator::<ErrorStateNavigator>("error-state", counter);
    prediction(counter);
    bounded_velocity(counter);
}

/// A build's step, with a fix each second.
fn navigator<N: Navigator>(name: &str, counter: &Counter) {
    let Some(mut filter) = N::start(&inertial(0)) else {
        hprintln!("{} does not start", name);
        return;
    };
    let mut worst = 0;
    let mut sum = 0;
    for step in 1..=STEPS {
        let inertial = black_box(inertial(step));
        let position = black_box(fix(step));
        let count = counter.instructions(|| filter.step(&inertial, position.as_ref()));
        worst = worst.max(count);
        sum += count;
    }
    black_box(filter.fingerprint());
    say(name, worst, sum / STEPS);
}

/// Fault detection, which stands in front of both builds' filters.
fn faults(counter: &Counter) {
    let mut faults = SampleFaults::default();
    let mut found = 0;
    let mut worst = 0;
    let mut sum = 0;
    for step in 1..=STEPS {
        let mut inertial = black_box(inertial(step));
        let still = black_box(Vector3::zeros());
        let count =
            counter.instructions(|| faults.usable(&mut inertial, &still, &mut |_| found += 1));
        black_box(&inertial);
        worst = worst.max(count);
        sum += count;
    }
    if found > 0 {
        hprintln!(
            "fault-detection finds {} faults where there are none",
            found
        );
    }
    say("fault-detection", worst, sum / STEPS);
}

/// The error-state filter's prediction alone: a sample, and the whole covariance over it.
fn prediction(counter: &Counter) {
    let state = NavigationState {
        ned_from_body: UnitQuaternion::identity(),
        velocity: Vector3::new(1.0, -0.5, 0.0),
        position: Vector3::zeros(),
        accelerometer_bias: Vector3::zeros(),
        gyroscope_bias: Vector3::zeros(),
        covariance: SMatrix::identity() * 0.01,
        pending: ErrorTransition::default(),
        skipped: 0,
    };
    let config = ErrorStateConfig {
        accelerometer_bias_random_walk: 1e-3,
        gyroscope_bias_random_walk: 3e-5,
        ..ErrorStateConfig::default()
    };
    let Ok(mut filter) = ErrorStateFilter::<f32>::new(config, state) else {
        hprintln!("error-state-prediction does not start");
        return;
    };
    let mut worst = 0;
    let mut sum = 0;
    for step in 1..=STEPS {
        let inertial = black_box(inertial(step));
        let force = inertial.specific_force.unwrap_or_default();
        let count = counter.instructions(|| {
            let _ = filter.propagate(&inertial.angular_rate, &force, inertial.dt_s());
            let _ = filter.catch_up();
        });
        worst = worst.max(count);
        sum += count;
    }
    black_box(filter.state());
    say("error-state-prediction", worst, sum / STEPS);
}

/// The bounded-velocity filter with its default states, one sample of each sensor a step.
fn bounded_velocity(counter: &Counter) {
    let Ok(mut filter) = BoundedVelocity::<f32>::new(BoundedVelocityConfig::lab()) else {
        hprintln!("bounded-velocity does not start");
        return;
    };
    let up = Vector3::new(0.0, 0.0, 9.806_65);
    let earth_field = Vector3::new(0.0, 20.0, -45.0);
    filter.initialize(&InitialState {
        attitude: UnitQuaternion::identity(),
        attitude_covariance: Matrix3::from_diagonal_element(0.01),
        gyroscope_bias: Vector3::zeros(),
        gyroscope_bias_std: 0.02,
        north_known: true,
        references: References {
            specific_force: up,
            magnetic_field: Some(earth_field),
        },
    });
    let (mut worst, mut sum) = (0, 0);
    let mut attitude = UnitQuaternion::identity();
    for step in 1..=STEPS {
        // Level axes are east, north, up there. A field that did not turn with the device would be hard iron.
        let inertial = black_box(inertial(step));
        let upright = |v: Vector3<f32>| Vector3::new(v.y, v.x, -v.z);
        let rate = upright(inertial.angular_rate);
        attitude *= UnitQuaternion::from_scaled_axis(rate * inertial.dt_s());
        let sway = upright(inertial.specific_force.unwrap_or_default()) - up;
        let force = black_box(attitude.inverse() * up + sway);
        let field = black_box(attitude.inverse() * earth_field);
        let count = counter.instructions(|| {
            let _ = filter.propagate(&rate, inertial.dt_s());
            let _ = filter.update_accelerometer(&force);
            let _ = filter.update_magnetometer(&field);
        });
        worst = worst.max(count);
        sum += count / 16;
    }
    black_box(filter.attitude());
    say("bounded-velocity", worst, sum / (STEPS / 16));
}

fn say(name: &str, worst: u32, mean: u32) {
    hprintln!("{} {} {}", name, worst, mean);
}

/// Of a hand that swings and turns.
fn inertial(step: u32) -> Inertial {
    let t = step as f32 * 0.02;
    let [slow, fast] = [ComplexField::sin(t * 0.7), ComplexField::sin(t * 5.0)];
    Inertial {
        dt_ms: if step == 0 { 0 } else { 20 },
        angular_rate: Vector3::new(0.3 * fast, 0.2 * slow, 0.5 * slow - 0.1 * fast),
        specific_force: Some(Vector3::new(1.5 * slow, 0.8 * fast, -9.8 + 0.5 * fast)),
        magnetic_field: Some(Vector3::new(20.0 + slow, 3.0 * fast, 45.0)),
        push: None,
        unseen: Unseen::default(),
    }
}

fn fix(step: u32) -> Option<Position> {
    let number = step / FIX_EVERY;
    step.is_multiple_of(FIX_EVERY).then(|| Position {
        number,
        ned: Vector3::new(number as f32, number as f32 * -0.5, 0.3),
        velocity: Some([1.0, -0.5]),
        hdop: 1.2,
    })
}
