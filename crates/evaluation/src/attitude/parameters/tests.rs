//! Names, defaults, settings.

use northing_core::attitude::bounded_velocity::ScaleStates;

use super::*;

#[test]
fn parameters_carry_the_defaults_of_each_profile() {
    let all = parameters();
    let std = all.iter().find(|p| p.name == "accelerometer_std").unwrap();
    let expected = [AttitudeConfig::hand_held(), AttitudeConfig::lab()];
    for ((_, value), config) in std.defaults.iter().zip(expected) {
        assert_eq!(value.as_f64(), Some(config.accelerometer_std));
    }
}

#[test]
fn every_estimator_has_the_parameters_that_it_reads() {
    let count = |kind| parameters_of(kind).len();
    let named = |start: &str| {
        parameters()
            .iter()
            .filter(|p| p.name.starts_with(start))
            .count()
    };
    let (observers, position) = (named("complementary_"), named(set::CASCADE));
    assert_eq!(count(EstimatorKind::BoundedVelocity), named(set::BOUNDED));
    let ekf = count(EstimatorKind::QuaternionEkf);
    assert_eq!(
        ekf,
        parameters().len() - observers - position - named(set::BOUNDED)
    );
    // Without the norm of four free numbers; without a gyroscope bias.
    assert_eq!(count(EstimatorKind::Mekf), ekf - 1);
    assert_eq!(count(EstimatorKind::Mekf3), ekf - 3);
    // With the use of the magnetometer.
    assert_eq!(count(EstimatorKind::ComplementaryPassive), observers + 1);
    // Without a choice of rotation; with every parameter of the EKF and the three that a filter behind it has.
    assert_eq!(count(EstimatorKind::Cascade), observers + 1 + position - 1);
    assert_eq!(count(EstimatorKind::CascadeEkf), ekf + 3 + position);
    assert!(parameters_of(EstimatorKind::Integration).is_empty());
}

#[test]
fn settings_change_what_they_name_and_nothing_else() {
    let mut config = Parameters::default();
    assert_eq!(
        apply_setting(&mut config, "accelerometer_std = 0.3").unwrap(),
        "accelerometer_std"
    );
    assert_eq!(
        apply_setting(&mut config, "gate_timeout_s=5").unwrap(),
        "gate_timeout_s"
    );
    assert_eq!(
        apply_setting(&mut config, "magnetometer_use=heading").unwrap(),
        "magnetometer_use"
    );
    assert_eq!(
        apply_setting(&mut config, "cascade_pole=0.5").unwrap(),
        "cascade_pole"
    );
    apply_setting(&mut config, "cascade_rotation=reconstructed").unwrap();
    apply_setting(&mut config, "bounded_scale_states=diagonal").unwrap();
    let attitude = AttitudeConfig {
        accelerometer_std: 0.3,
        gate_timeout_s: 5.0,
        magnetometer_use: northing_core::attitude::MagnetometerUse::Heading,
        ..AttitudeConfig::default()
    };
    let cascade = CascadeConfig {
        pole: 0.5,
        ..CascadeConfig::default()
    };
    let bounded_velocity = BoundedVelocityConfig {
        scale_states: ScaleStates::Diagonal,
        ..BoundedVelocityConfig::default()
    };
    let expected = Parameters {
        attitude,
        bounded_velocity,
        cascade,
        rotation: CascadeRotation::Reconstructed,
    };
    assert_eq!(config, expected);
}

#[test]
fn bad_settings_say_what_was_expected_and_change_nothing() {
    let mut config = Parameters::default();
    let mut error = |text: &str| apply_setting(&mut config, text).unwrap_err().to_string();
    assert!(error("accelerometer_std").contains("expected NAME=VALUE"));
    let unknown = error("acc_std=1");
    assert!(unknown.contains("`acc_std`"), "{unknown}");
    assert!(error("accelerometer_std=a").contains("expected a number"));
    assert!(error("accelerometer_std=inf").contains("expected a number from 1e-6 to 10000"));
    let mistyped = error("acelerometer_std=1");
    assert!(
        mistyped.contains("did you mean `accelerometer_std`?"),
        "{mistyped}"
    );
    let renamed = error("cascade_position_std=1");
    assert!(
        renamed.contains("it is now called `cascade_position_std_m`"),
        "{renamed}"
    );
    assert!(error("accelerometer_std=-1").contains("from 1e-6 to 10000"));
    let word = error("magnetometer_use=both");
    assert!(
        word.contains("vector") && word.contains("heading"),
        "{word}"
    );
    assert!(error("cascade_pole=0").contains("from 0.001 to 100"));
    assert!(error("bounded_scale_states=all").contains("diagonal"));
    assert!(error("bounded_prediction_s=1").contains("from -0.1 to 0.1"));
    assert!(error("cascade_rotation=best").contains("reconstructed"));
    assert_eq!(config, Parameters::default());
}

#[test]
fn profiles_are_found_by_name() {
    assert_eq!("lab".parse::<Profile>().unwrap(), Profile::Lab);
    assert_eq!(Profile::default().name(), "hand-held");
    let error = "car".parse::<Profile>().unwrap_err().to_string();
    assert_eq!(
        error,
        "unknown profile `car`; expected one of: hand-held, lab"
    );
}
