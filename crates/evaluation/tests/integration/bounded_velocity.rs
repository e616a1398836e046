//! The bounded-velocity filter against its prototype, trial by trial, on the uniformly sampled input
//! that the prototype took.

use crate::uniform;

use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use northing_core::attitude::alignment::level_covariance;
use northing_core::attitude::bounded_velocity::steps::StepObserver;
use northing_core::attitude::bounded_velocity::{BoundedVelocity, BoundedVelocityConfig};
use northing_core::attitude::{AttitudeEstimator, InitialState, References, wahba};
use northing_evaluation::attitude::rts_smoother::Smoother;
use northing_evaluation::attitude::rts_smoother::bounded_velocity::Steps;
use northing_evaluation::statistics::metrics::{ErrorStatistics, HeadingReference};
use northing_recording::test_data::data_dir;
use uniform::{Field, Uniform};

/// What the prototype reached.
struct Expected {
    folder: &'static str,
    magnetometer: &'static str,
    trial: &'static str,
    total_deg: f64,
    nees: f64,
}

fn expected() -> impl Iterator<Item = Expected> {
    let rows = include_str!("uniform/expected.csv").lines().skip(1);
    rows.map(|row| {
        let mut cells = row.split(',');
        let mut cell = || cells.next().expect("five columns");
        Expected {
            folder: cell(),
            magnetometer: cell(),
            trial: cell(),
            total_deg: cell().parse().expect("a number"),
            nees: cell().parse().expect("a number"),
        }
    })
}

impl Expected {
    fn path(&self, data: &Path) -> PathBuf {
        data.join("attitude")
            .join(self.folder)
            .join(format!("{}.parquet", self.trial))
    }
}

fn mean(values: &[Vector3<f64>]) -> Vector3<f64> {
    values.iter().sum::<Vector3<f64>>() / values.len() as f64
}

/// As the prototype started: TRIAD of the means over the first half second.
fn start(u: &Uniform, field: &Field, config: &BoundedVelocityConfig<f64>) -> InitialState<f64> {
    let n = u.start_samples();
    let (force, field) = (mean(&u.force[..n]), mean(&field.values[..n]));
    let attitude = wahba::triad(&force, &field, &Vector3::z(), &Vector3::y()).expect("a start");
    let level = attitude * field;
    let (tilt, heading) = (config.initial_tilt_std, config.initial_heading_std);
    InitialState {
        attitude,
        attitude_covariance: level_covariance(&attitude, &Vector3::z(), tilt, heading),
        gyroscope_bias: Vector3::zeros(),
        gyroscope_bias_std: config.initial_gyroscope_bias_std,
        north_known: false,
        references: References {
            specific_force: Vector3::z() * 9.81,
            magnetic_field: Some(level),
        },
    }
}

/// The prototype's settings, which the defaults round.
fn prototype() -> BoundedVelocityConfig<f64> {
    BoundedVelocityConfig {
        gyroscope_noise_density: 0.075_f64.to_radians(),
        initial_gyroscope_bias_std: 1_f64.to_radians(),
        field_dip_scale: 4_f64.to_radians(),
        rest_angular_rate: 2_f64.to_radians(),
        rest_rate_noise_density: 0.1_f64.to_radians(),
        initial_tilt_std: 8_f64.to_radians(),
        initial_heading_std: 20_f64.to_radians(),
        update_interval_s: 0.02,
        // What it did not have: a noise that is learnt, rests that are doubted, samples that are averaged, a search for hard iron.
        initial_velocity_psd: 0.0,
        largest_velocity_psd: 0.0,
        // All so fast that no hypothesis of the speed is told from another.
        hand_velocity_std: 1e4,
        drifting_bias_weight: 0.0,
        rest_bias_doubt: 0.0,
        unexpected_hard_iron: 0.0,
        gyroscope_bias_freedom: 0.0,
        rest_slow_motion_gain: 0.0,
        rest_smoothing_s: 1e-6,
        ..BoundedVelocityConfig::lab()
    }
}

/// Runs over a uniform stream. The prototype took the newest field of each update interval at its
/// end; `record` gets every estimate.
fn run<O: StepObserver<f64>>(
    u: &Uniform,
    field: &Field,
    filter: &mut BoundedVelocity<f64, O>,
    mut record: impl FnMut(usize, &BoundedVelocity<f64, O>),
) {
    let config = *filter.config();
    filter.initialize(&start(u, field, &config));
    let (mut since, mut newest) = (0.0, None);
    for k in 0..u.rate.len() {
        filter.propagate(&u.rate[k], u.interval_s);
        filter.update_accelerometer(&u.force[k]);
        since += u.interval_s;
        if field.fresh[k] {
            newest = Some(field.values[k]);
        }
        if since >= config.update_interval_s - 0.5 * u.interval_s {
            since = 0.0;
            if let Some(field) = newest.take() {
                filter.update_magnetometer(&field);
            }
        }
        record(k, filter);
    }
}

/// RMS of the total error, deg, and NEES per degree of freedom.
fn score(u: &Uniform, field: &Field, config: BoundedVelocityConfig<f64>) -> (f64, f64) {
    let mut statistics = ErrorStatistics::default();
    let mut filter = BoundedVelocity::new(config).expect("valid settings");
    run(u, field, &mut filter, |k, filter| {
        if let Some(reference) = &u.reference[k] {
            let covariance = filter.attitude_covariance();
            statistics.add(&filter.attitude(), covariance.as_ref(), reference);
        }
    });
    result(&statistics)
}

/// As [`score`], smoothed.
fn score_smoothed(u: &Uniform, field: &Field, config: BoundedVelocityConfig<f64>) -> (f64, f64) {
    let mut filter = BoundedVelocity::observed(config, Steps::default()).expect("valid settings");
    let mut estimates = Vec::new();
    run(u, field, &mut filter, |_, filter| {
        estimates.push((filter.node(), filter.attitude()));
    });
    let nodes = filter.smooth();
    let mut statistics = ErrorStatistics::default();
    for ((node, filtered), reference) in estimates.iter().zip(&u.reference) {
        if let Some(reference) = reference {
            let node = &nodes[*node];
            let attitude = node.attitude(filtered);
            let covariance = node.attitude_covariance(&attitude);
            statistics.add(&attitude, Some(&covariance), reference);
        }
    }
    result(&statistics)
}

fn result(statistics: &ErrorStatistics) -> (f64, f64) {
    let total = statistics
        .summary(HeadingReference::Measured)
        .expect("a scored trial")
        .total_rmse;
    (
        total,
        statistics
            .nees(HeadingReference::Measured)
            .map(|nees| nees.mean)
            .expect("a covariance"),
    )
}

/// What the prototype took for one magnetometer of a table's line, and the hard iron's prior; `None`
/// where the recordings for its calibration are held out.
fn input(u: &mut Uniform, e: &Expected, data: &Path) -> Option<(Field, f64)> {
    Some(match e.magnetometer {
        "raw" => {
            let mut field = u.uncalibrated.clone().expect("a raw stream");
            let n = u.start_samples();
            let offset = mean(&field.values[..n]) - mean(&u.field.values[..n]);
            field.values.iter_mut().for_each(|v| *v -= offset);
            (field, 12.0)
        }
        "own" => {
            let day = calibration_day(u.calibration_day.as_deref().expect("a day"));
            if !recording(data, &format!("calib_mag_{day}")).is_file() {
                return None;
            }
            if day.starts_with("iPhone") {
                let bias = uniform::rest_bias(&recording(data, &format!("calib_gyr_{day}")));
                u.rate.iter_mut().for_each(|rate| *rate -= bias);
            }
            let (soft, hard) = uniform::ellipsoid(&recording(data, &format!("calib_mag_{day}")));
            let mut field = u.uncalibrated.clone().expect("a raw stream");
            for value in &mut field.values {
                *value = soft * (*value - hard);
            }
            (field, 2.0)
        }
        "device" => (u.field.clone(), 3.0),
        _ => (u.field.clone(), 0.0),
    })
}

/// The files' word for phone and day, from that of the recordings.
fn calibration_day(short: &str) -> String {
    let (phone, day) = short.split_at(2);
    let phone = match phone {
        "i4" => "iPhone4S",
        "i5" => "iPhone5",
        _ => "Nexus5",
    };
    format!("{phone}_{day}")
}

fn recording(data: &Path, name: &str) -> PathBuf {
    data.join(format!("attitude/smartphone/{name}.parquet"))
}

/// How a stream is run and scored.
type Score = fn(&Uniform, &Field, BoundedVelocityConfig<f64>) -> (f64, f64);

/// Runs a line of the table; total error and NEES.
fn reproduce(e: &Expected, data: &Path, score: Score) -> Option<(f64, f64)> {
    let mut u = Uniform::read(&e.path(data));
    let (field, initial_hard_iron_std_ut) = input(&mut u, e, data)?;
    let config = BoundedVelocityConfig {
        initial_hard_iron_std_ut,
        ..prototype()
    };
    Some(score(&u, &field, config))
}

/// Acceptance tests (a) and (c): the total error of each trial within 0.05 deg, NEES on BROAD.
fn check_against_prototype(test: &str, magnetometer: &str, trials: usize) {
    let Some(data) = data_dir(test) else {
        return;
    };
    let (mut sums, mut count) = ([0.0; 2], 0);
    for e in expected().filter(|e| e.magnetometer == magnetometer) {
        let Some((total, nees)) = reproduce(&e, &data, score) else {
            continue;
        };
        let (name, expected) = (e.trial, (e.total_deg, e.nees));
        let what = format!("{name}: {total} deg, NEES {nees} for {expected:?}");
        assert!((total - e.total_deg).abs() < 0.05, "{what}");
        assert!((nees / e.nees - 1.0).abs() < 0.02, "{what}");
        sums[0] += total;
        sums[1] += nees;
        count += 1;
    }
    assert_eq!(count, trials);
    let [total, nees] = sums.map(|sum| sum / trials as f64);
    eprintln!("{magnetometer}: mean total {total:.3} deg, mean NEES {nees:.3}");
    if magnetometer == "calibrated" {
        assert!((0.4..1.2).contains(&nees), "mean NEES {nees}");
    }
}

#[test]
fn prototype_on_wearables() {
    check_against_prototype("prototype_on_wearables", "calibrated", 14);
}

#[test]
fn prototype_on_phones_with_the_raw_magnetometer() {
    check_against_prototype("prototype_on_phones_with_the_raw_magnetometer", "raw", 42);
}

#[test]
fn prototype_on_phones_with_the_systems_magnetometer() {
    check_against_prototype(
        "prototype_on_phones_with_the_systems_magnetometer",
        "device",
        42,
    );
}

#[test]
fn prototype_on_phones_with_both_sensors_calibrated() {
    check_against_prototype(
        "prototype_on_phones_with_both_sensors_calibrated",
        "own",
        40,
    );
}

/// Acceptance test (g): the mean total error, smoothed.
fn check_smoothing(test: &str, magnetometer: &str, trials: usize, limit_deg: f64) {
    let Some(data) = data_dir(test) else {
        return;
    };
    let (mut sums, mut count) = ([0.0; 2], 0);
    for e in expected().filter(|e| e.magnetometer == magnetometer) {
        let Some((total, nees)) = reproduce(&e, &data, score_smoothed) else {
            continue;
        };
        eprintln!("{}: {total:.3} deg, filter {:.3}", e.trial, e.total_deg);
        sums[0] += total;
        sums[1] += nees;
        count += 1;
    }
    assert_eq!(count, trials);
    let [total, nees] = sums.map(|sum| sum / trials as f64);
    eprintln!("{magnetometer}, smoothed: mean total {total:.3} deg, mean NEES {nees:.3}");
    assert!(total <= limit_deg, "{total} deg");
}

#[test]
fn smoothing_on_wearables() {
    check_smoothing("smoothing_on_wearables", "calibrated", 14, 2.0);
}

#[test]
fn smoothing_on_phones_with_both_sensors_calibrated() {
    check_smoothing(
        "smoothing_on_phones_with_both_sensors_calibrated",
        "own",
        40,
        3.0,
    );
}

/// Acceptance test (e): a magnet on the device is a hard iron.
#[test]
fn an_attached_magnet_is_learnt() {
    let Some(data) = data_dir("an_attached_magnet_is_learnt") else {
        return;
    };
    for (trial, limit) in [
        ("32_disturbed_attached_magnet_1cm", 1.0),
        ("36_disturbed_attached_magnet_5cm", 1.4),
    ] {
        let u = Uniform::read(&data.join(format!("attitude/broad/{trial}.parquet")));
        let config = BoundedVelocityConfig {
            initial_hard_iron_std_ut: 2.0,
            ..BoundedVelocityConfig::lab()
        };
        let (total, _) = score(&u, &u.field, config);
        println!("{trial}: {total:.3} deg");
        assert!(total < limit, "{trial}: {total} deg");
    }
}
