//! Every table at once: defaults, names, setting by name, files.

use std::string::ToString;
use std::vec::Vec;

use super::*;
use crate::attitude::AttitudeConfig;
use crate::attitude::axis_filters::AxisFiltersConfig;
use crate::attitude::bounded_velocity::BoundedVelocityConfig;
use crate::calibration::magnetometer::MagnetometerLimits;
use crate::calibration::rest::RestLimits;
use crate::navigation::axis_filters::PositionAxisConfig;
use crate::navigation::cascade::CascadeConfig;
use crate::navigation::{DeadReckoningConfig, ErrorStateConfig, GnssInsConfig, ValidityLimits};
use crate::tracking::association::ipda::ExistenceModel;
use crate::tracking::multi_target::MultiTargetSettings;
use crate::tracking::own_ship::{PoseErrorCorrelation, PoseLimits};

/// Calls a generic function for the tables of a precision.
macro_rules! every_table {
    ($scalar:ty, $check:ident) => {
        $check::<AttitudeConfig<$scalar>>();
        $check::<BoundedVelocityConfig<$scalar>>();
        $check::<AxisFiltersConfig<$scalar>>();
        $check::<PositionAxisConfig<$scalar>>();
        $check::<CascadeConfig<$scalar>>();
        $check::<ErrorStateConfig<$scalar>>();
        $check::<DeadReckoningConfig<$scalar>>();
        $check::<GnssInsConfig<$scalar>>();
        $check::<ValidityLimits<$scalar>>();
        $check::<PoseErrorCorrelation<$scalar>>();
        $check::<PoseLimits<$scalar>>();
        $check::<ExistenceModel<$scalar>>();
        $check::<MultiTargetSettings<$scalar>>();
        $check::<RestLimits<$scalar>>();
        $check::<MagnetometerLimits<$scalar>>();
    };
}

#[test]
fn defaults_are_valid_in_both_precisions_and_the_first_profile_is_the_default() {
    fn check<C: Table + fmt::Debug>() {
        for (name, profile) in C::PROFILES {
            assert_eq!(profile().check(), Ok(()), "{name}");
        }
        assert_eq!(C::PROFILES[0].1(), C::default());
    }
    every_table!(f32, check);
    every_table!(f64, check);
}

#[test]
fn names_are_unique_and_every_row_says_what_it_is() {
    fn check<C: Table>() {
        let mut names: Vec<_> = C::PARAMETERS.iter().map(|p| p.name).collect();
        names.extend(C::PARAMETERS.iter().filter_map(|p| p.formerly));
        names.sort_unstable();
        let all = names.len();
        names.dedup();
        assert_eq!(names.len(), all);
        for row in C::PARAMETERS {
            assert!(!row.name.is_empty() && !row.unit.is_empty() && !row.meaning.is_empty());
            assert!(
                !row.note.contains("  ") && !row.note.ends_with(' '),
                "{}",
                row.name
            );
        }
    }
    every_table!(f64, check);
}

/// Values that a range permits, and values that it does not.
fn samples(range: &Range) -> (Vec<Value<f64>>, Vec<Value<f64>>) {
    use Value::{Absent, Count, Flag, Number, Pair, Vector, Word};
    let numbers = |good: &[f64], bad: &[f64]| {
        let all = |list: &[f64]| list.iter().map(|x| Number(*x)).collect::<Vec<_>>();
        let never = [f64::NAN, f64::INFINITY, -f64::INFINITY];
        (all(good), [all(bad), all(&never)].concat())
    };
    let (good, mut bad) = match *range {
        // Both ends, and the numbers next to them.
        Range::From(a, b) => numbers(
            &[a, a.next_up(), 0.5 * (a + b), b.next_down(), b],
            &[a.next_down(), b.next_up(), a - 1.0, b + 1.0, -1e38, 1e38],
        ),
        Range::Above(a, b) => numbers(
            &[a.next_up(), 0.5 * (a + b), b.next_down(), b],
            &[a, a.next_down(), b.next_up(), a - 1.0, -1e38, 1e38],
        ),
        Range::Count(0) => (Vec::from([Count(0), Count(9)]), Vec::new()),
        Range::Count(least) => (Vec::from([Count(least)]), Vec::from([Count(least - 1)])),
        Range::Flag => (Vec::from([Flag(true), Flag(false)]), Vec::new()),
        Range::Words(words) => (
            words.iter().map(|w| Word(w)).collect(),
            Vec::from([Word("?")]),
        ),
        Range::Vector(each) => {
            let spread = |list: Vec<Value<f64>>, others: f64| {
                let one = |value| match value {
                    Number(x) => Vector([others, x, others]),
                    other => other,
                };
                list.into_iter().map(one).collect::<Vec<_>>()
            };
            let (good, bad) = samples(each);
            (spread(good, 0.0), spread(bad, 0.0))
        }
        Range::Optional(inner) => {
            let (mut good, bad) = samples(inner);
            good.push(Absent);
            (good, bad)
        }
        Range::Pair(..) => (
            Vec::from([Pair([1.0, 0.1])]),
            Vec::from([Pair([1.0, 0.0]), Pair([11.0, 0.1]), Pair([f64::NAN, 1.0])]),
        ),
        Range::Described(_) => unreachable!("no row is described in words alone"),
    };
    bad.retain(|value| !good.contains(value));
    (good, bad)
}

#[test]
fn every_row_can_be_set_and_read_and_refuses_what_is_outside_its_range() {
    fn check<C: Table<Number = f64> + fmt::Debug>() {
        for row in C::PARAMETERS {
            let (good, bad) = samples(&row.range);
            for value in good {
                let mut config = C::default();
                assert_eq!(config.set_parameter(row.name, value), Ok(()), "{row:?}");
                assert_eq!(config.parameter(row.name), Some(value), "{row:?}");
                assert_eq!(config.check(), Ok(()), "{row:?}");
                // Nothing else has changed.
                let (name, before) = (row.name, C::default().parameter(row.name));
                config.set_parameter(name, before.unwrap()).unwrap();
                assert_eq!(config, C::default(), "{row:?}");
            }
            for value in bad {
                let mut config = C::default();
                let error = config.set_parameter(row.name, value).unwrap_err();
                assert_eq!(
                    (error.field, error.range),
                    (row.name, row.range),
                    "{value:?}"
                );
                let message = std::format!("{} must be {}", row.name, row.range);
                assert_eq!(error.to_string(), message);
                assert_eq!(config, C::default());
            }
        }
        let mut config = C::default();
        assert_eq!(config.parameter("no_such"), None);
        let error = config.set_parameter("no_such", Value::Flag(true));
        assert_eq!(error, Err(ConfigError::UNKNOWN_NAME));
        assert_eq!(config, C::default());
    }
    every_table!(f64, check);
}

#[test]
fn another_kind_of_value_is_refused() {
    let mut config = GnssInsConfig::<f64>::default();
    for (name, value) in [
        ("gravity", Value::Flag(true)),
        ("zero_velocity", Value::Number(1.0)),
        ("imu_samples", Value::Number(1.0)),
        ("lever_arm_m", Value::Pair([1.0; 2])),
        ("declination", Value::Pair([1.0; 2])),
        ("initial_heading", Value::Number(1.0)),
    ] {
        let error = config.set_parameter(name, value).unwrap_err();
        assert_eq!(error.field, name);
    }
    assert_eq!(config, GnssInsConfig::default());
}

#[test]
fn errors_name_field_and_range_with_the_group() {
    let mut config = GnssInsConfig::<f64>::default();
    config.validity.invalid_after_s = f64::NAN;
    assert_eq!(
        config.validate().unwrap_err().to_string(),
        "validity.invalid_after_s must be from 0.001 to 1e9"
    );
    let mut config = BoundedVelocityConfig::<f32> {
        prediction_s: 1.0,
        ..BoundedVelocityConfig::default()
    };
    assert_eq!(
        config.validate().unwrap_err().to_string(),
        "prediction_s must be from -0.1 to 0.1"
    );
    config.prediction_s = 0.0;
    // In single precision its square is no number.
    config.compass_std = 1e30;
    assert_eq!(
        config.validate().unwrap_err().to_string(),
        "compass_std must be from 1e-6 to 10"
    );
}

#[test]
fn texts_become_values_of_the_kind_of_the_range() {
    let row = |name: &str| {
        let rows = GnssInsConfig::<f64>::PARAMETERS;
        rows.iter().find(|p| p.name == name).unwrap().range
    };
    for (name, text, value) in [
        ("gravity", " 9.8 ", Some(Value::Number(9.8))),
        ("gravity", "inf", None),
        ("gravity", "fast", None),
        ("non_holonomic", "true", Some(Value::Flag(true))),
        ("non_holonomic", "1", None),
        ("imu_samples", "means", Some(Value::Word("means"))),
        ("imu_samples", "mean", None),
        (
            "lever_arm_m",
            "0,-0.05, 1",
            Some(Value::Vector([0.0, -0.05, 1.0])),
        ),
        ("lever_arm_m", "0,1", None),
        ("lever_arm_m", "0,1,2,3", None),
        ("initial_heading", "1.5,0.1", Some(Value::Pair([1.5, 0.1]))),
        ("declination", "0.1", Some(Value::Number(0.1))),
        ("declination", "none", Some(Value::Absent)),
    ] {
        assert_eq!(row(name).read(text), value, "{name}={text}");
    }
}

#[cfg(feature = "serde")]
mod files {
    use super::*;
    use std::format;
    use std::string::String;

    use serde_json::{Map, Value as Json};

    /// Keys of a file with those of its groups, dotted.
    fn keys(map: &Map<String, Json>, start: &str) -> Vec<String> {
        let dotted = |(name, value): (&String, &Json)| match value {
            Json::Object(inner) => keys(inner, &format!("{start}{name}.")),
            _ => Vec::from([format!("{start}{name}")]),
        };
        map.iter().flat_map(dotted).collect()
    }

    #[test]
    fn the_keys_of_files_are_the_names_of_the_rows_and_old_keys_are_read() {
        fn check<C>()
        where
            C: Table + fmt::Debug + serde::Serialize + serde::de::DeserializeOwned,
        {
            let file = serde_json::to_value(C::default()).unwrap();
            let mut in_file = keys(file.as_object().unwrap(), "");
            let mut in_table: Vec<_> = C::PARAMETERS.iter().map(|p| p.name.to_string()).collect();
            // What is not set may be left out of a file.
            let unset = |name: &String| C::default().parameter(name) == Some(Value::Absent);
            in_table.retain(|name| in_file.contains(name) || !unset(name));
            in_file.sort();
            in_table.sort();
            assert_eq!(in_file, in_table);
            assert_eq!(
                serde_json::from_value::<C>(file.clone()).unwrap(),
                C::default()
            );
            for row in C::PARAMETERS {
                let Some(old) = row.formerly else { continue };
                let text = file.to_string().replace(row.name, old);
                assert_ne!(text, file.to_string());
                assert_eq!(serde_json::from_str::<C>(&text).unwrap(), C::default());
            }
            for (_, profile) in C::PROFILES {
                let text = serde_json::to_string(&profile()).unwrap();
                assert_eq!(serde_json::from_str::<C>(&text).unwrap(), profile());
            }
            assert!(serde_json::from_str::<C>("{\"no_such\": 1}").is_err());
        }
        every_table!(f64, check);
    }
}
