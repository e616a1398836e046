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

/// GIVEN a bias that a rest measured WHEN it says that it is known THEN nothing is assumed of its size.
#[test]
fn a_measured_bias_is_not_drawn_to_zero() {
    let measured = 0.02;
    let mut f = BoundedVelocity::new(hand_held(0.25)).unwrap();
    let mut start = initial(TangentFrame::Enu, UnitQuaternion::identity());
    start.references.magnetic_field = None;
    start.gyroscope_bias = Vector3::repeat(measured);
    start.gyroscope_bias_std = 1e-3;
    f.initialize(&start);
    let before = f.gyroscope_bias().unwrap().1;
    for k in 0..1000 {
        let sway = 0.3 * (f64::from(k) * 0.02).sin();
        f.propagate(&Vector3::new(sway + measured, measured, measured), 0.01);
    }
    let (bias, after) = f.gyroscope_bias().unwrap();
    assert_eq!(bias, Vector3::repeat(measured));
    assert!(after[(2, 2)] >= before[(2, 2)]);
}
