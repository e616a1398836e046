//! What is known of the gyroscope's bias about the vertical where there is no magnetometer.

use super::*;

/// Stated standard deviation and error (rad/s) of the bias about the vertical after somebody has walked to and fro for a minute
/// and a half without a magnetometer, at a speed (m/s), leaning this way and that, with a bias (rad/s).
fn walked(config: BoundedVelocityConfig<f64>, speed: f64, bias: &Vector3<f64>) -> [f64; 2] {
    let mut f = BoundedVelocity::new(config).unwrap();
    let mut start = initial(TangentFrame::Enu, UnitQuaternion::identity());
    start.references.magnetic_field = None;
    f.initialize(&start);
    let dt = 0.01;
    let attitude =
        |t: f64| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), 0.3 * (0.9 * t).sin());
    for k in 0..9000 {
        let t = f64::from(k) * dt;
        let (from, to) = (attitude(t), attitude(t + dt));
        let rate = (from.inverse() * to).scaled_axis() / dt;
        let force = Vector3::new(0.5 * speed * (0.5 * t).cos(), 0.0, 9.81);
        f.propagate(&(rate + bias), dt);
        f.update_accelerometer(&(to.inverse() * force));
    }
    let up = f.attitude().inverse() * Vector3::z();
    let (estimate, covariance) = f.gyroscope_bias().unwrap();
    let std = up.dot(&(covariance * up)).sqrt();
    [std, up.dot(&(estimate - bias))]
}

fn hand_held(freedom: f64) -> BoundedVelocityConfig<f64> {
    BoundedVelocityConfig {
        gyroscope_bias_freedom: freedom,
        ..BoundedVelocityConfig::hand_held()
    }
}

/// GIVEN no magnetometer WHEN somebody walks to and fro THEN the velocity, which lasts, tells nothing of the
/// bias about the vertical, while the same swaying of a hand does.
#[test]
fn a_velocity_that_lasts_tells_nothing_of_the_bias_about_the_vertical() {
    let prior = hand_held(0.0).initial_gyroscope_bias_without_magnetometer_std;
    let [std, error] = walked(hand_held(0.0), 1.4, &Vector3::zeros());
    let [of_hand, _] = walked(hand_held(0.0), 0.0, &Vector3::zeros());
    assert!(std > 0.95 * prior, "{std} {prior}");
    assert!(of_hand < 0.8 * prior, "{of_hand} {prior}");
    assert!(error.abs() < 0.3 * prior, "{error} {prior}");
}

/// GIVEN no magnetometer WHEN the level axes show that their biases are small THEN so is what is expected of the third; where they
/// show large ones, the prior stays.
#[test]
fn the_axes_that_show_their_bias_say_how_large_the_others_are() {
    let std = |freedom: f64, bias: f64| {
        let config = hand_held(freedom);
        let level = Vector3::new(bias, -bias, 0.0);
        walked(config, 1.4, &level)[0] / config.initial_gyroscope_bias_without_magnetometer_std
    };
    let (taken, learnt) = (std(0.0, 1e-4), std(0.25, 1e-4));
    assert!(learnt < 0.6 * taken, "{learnt} {taken}");
    let (taken, large) = (std(0.0, 0.02), std(0.25, 0.02));
    assert!(large > 0.95 * taken, "{large} {taken}");
}

/// GIVEN a bias that a rest measured, or that was learnt before the attitude is aligned again WHEN the device moves on THEN nothing is
/// assumed of its size: it is as without that; where nothing is known of it, it is not.
#[test]
fn a_bias_that_is_known_is_not_drawn_to_zero() {
    let after = |freedom: f64, bias: Vector3<f64>, std: f64| {
        let mut f = BoundedVelocity::new(hand_held(freedom)).unwrap();
        let mut start = initial(TangentFrame::Enu, UnitQuaternion::identity());
        start.references.magnetic_field = None;
        start.gyroscope_bias = bias;
        start.gyroscope_bias_std = std;
        f.initialize(&start);
        for k in 0..2000 {
            let sway = Vector3::x() * (0.3 * (f64::from(k) * 0.02).sin());
            f.propagate(&(bias + sway), 0.01);
            let up = f.attitude().inverse() * Vector3::z();
            f.update_accelerometer(&(up * 9.81));
        }
        f.gyroscope_bias().unwrap()
    };
    let bias = Vector3::new(0.02, -0.01, 0.0);
    assert_eq!(after(0.25, bias, 1e-3), after(0.0, bias, 1e-3));
    assert_eq!(after(0.25, bias, 1.0), after(0.0, bias, 1.0));
    let unknown = Vector3::zeros();
    assert_ne!(after(0.25, unknown, 1.0), after(0.0, unknown, 1.0));
}

/// GIVEN no magnetometer, and a bias that is known from before WHEN a car is found to be one THEN the filter goes on from the hypothesis of a
/// vehicle, and knows as much of the bias about the vertical as before.
#[test]
fn a_vehicle_that_is_found_leaves_the_bias_about_the_vertical_as_it_was() {
    const STD: f64 = 1e-3;
    let config = BoundedVelocityConfig {
        drifting_bias_weight: 0.0,
        ..BoundedVelocityConfig::hand_held()
    };
    let mut f = BoundedVelocity::new(config).unwrap();
    let mut start = initial(TangentFrame::Enu, UnitQuaternion::identity());
    start.references.magnetic_field = None;
    start.gyroscope_bias = Vector3::new(2e-3, -1e-3, 3e-3);
    start.gyroscope_bias_std = STD;
    start.attitude_covariance = Matrix3::identity() * 1e-4;
    f.initialize(&start);
    for k in 0..3000 {
        let t = f64::from(k) * 0.01;
        // Off to 20 m/s, and through bends.
        let forward = if t < 10.0 { 2.0 } else { 0.0 };
        let turning = 0.1 * (0.4 * t).sin();
        f.propagate(&(start.gyroscope_bias + Vector3::z() * turning), 0.01);
        f.update_accelerometer(&Vector3::new(forward, 20.0 * turning, 9.81));
        let (estimate, covariance) = f.gyroscope_bias().unwrap();
        let (std, error) = (covariance[(2, 2)].sqrt(), estimate.z - 3e-3);
        assert!(
            std < 1.2 * STD && error.abs() < 2.0 * STD,
            "{t} s: {error} {std}"
        );
    }
    assert!(f.state.speed_hypotheses.is_vehicle());
}
