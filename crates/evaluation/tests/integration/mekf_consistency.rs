//! Monte-Carlo consistency of the attitude filters: is the error as large as the filter says?
//!
//! The expected values are those of an independent NumPy prototype of the same equations; the
//! derivation is `docs/derivations/mekf.md`. Every campaign is seeded, so the results are fixed.

#![allow(clippy::unwrap_used, clippy::print_stdout)]

use nalgebra::{Matrix3, SMatrix, SVector, UnitQuaternion, Vector3};
use northing_core::attitude::integration::Integration;
use northing_core::attitude::mekf::Mekf;
use northing_core::attitude::mekf3::Mekf3;
use northing_core::attitude::quaternion_ekf::QuaternionEkf;
use northing_core::attitude::usque::Usque;
use northing_core::attitude::{
    AttitudeConfig, AttitudeEstimator, InitialState, ProcessNoise, References,
};
use northing_core::geometry::so3;
use northing_core::kalman::covariance::normalized_square;
use northing_simulation::monte_carlo::{AttitudeTrial, AttitudeTrialConfig};
use northing_simulation::random::{normal_vector, stream};
use rayon::prelude::*;

/// Runs one closure a seed on all cores; the order of results does not depend on threads.
fn campaign<R: Send>(seeds: std::ops::Range<u64>, run: impl Fn(u64) -> R + Sync + Send) -> Vec<R> {
    seeds.into_par_iter().map(run).collect()
}

fn mean(values: impl IntoIterator<Item = f64>) -> f64 {
    let (sum, n) = values
        .into_iter()
        .fold((0.0, 0.0), |(s, n), v| (s + v, n + 1.0));
    sum / n
}

/// Degrees of the root of a mean of squares (rad^2).
fn rms_deg(mean_square: f64) -> f64 {
    mean_square.sqrt().to_degrees()
}

fn within(value: f64, expected: f64, relative: f64, what: &str) {
    assert!(
        (value - expected).abs() <= relative * expected,
        "{what}: {value:.4}, expected {expected} within {:.0} %",
        relative * 100.0
    );
}

/// Settings that are exactly the trial's statistics, gates off.
fn consistent(trial: &AttitudeTrialConfig) -> AttitudeConfig<f64> {
    AttitudeConfig {
        gyroscope_noise_density: trial.gyroscope_noise_std_rad_s / trial.rate_hz.sqrt(),
        gyroscope_bias_random_walk: trial.gyroscope_bias_random_walk_rad_s_sqrt_s,
        accelerometer_std: trial.accelerometer_noise_std_m_s2,
        magnetometer_std_ut: trial.magnetometer_noise_std_ut,
        accelerometer_gate_nis: 0.0,
        magnetometer_gate_nis: 0.0,
        ..AttitudeConfig::lab()
    }
}

fn initial(
    trial: &AttitudeTrial,
    attitude: UnitQuaternion<f64>,
    std: f64,
    bias_std: f64,
) -> InitialState<f64> {
    InitialState {
        attitude,
        attitude_covariance: Matrix3::identity() * (std * std),
        gyroscope_bias: Vector3::zeros(),
        gyroscope_bias_std: bias_std,
        north_known: false,
        references: References {
            specific_force: trial.specific_force_world,
            magnetic_field: Some(trial.magnetic_field_world_ut),
        },
    }
}

/// Local attitude error `a` with `q_true = q * dq(a)`, rad.
fn attitude_error<E: AttitudeEstimator<f64>>(
    filter: &E,
    truth: &UnitQuaternion<f64>,
) -> Vector3<f64> {
    so3::to_gibbs(&(filter.attitude().inverse() * truth))
}

/// Feeds a whole trial; `score` sees the filter and the two NIS after each step.
fn feed<E: AttitudeEstimator<f64>>(
    filter: &mut E,
    trial: &AttitudeTrial,
    mut score: impl FnMut(usize, &E, [f64; 2]),
) {
    for k in 0..trial.len() {
        filter.propagate(&trial.gyroscope[k], trial.dt_s);
        let a = filter.update_accelerometer(&trial.accelerometer[k]).nis;
        let m = filter.update_magnetometer(&trial.magnetometer[k]).nis;
        score(k, filter, [a, m]);
    }
}

/// One run of the six-state campaign: start 0.1 rad off, bias unknown to 0.02 rad/s.
fn walking_bias() -> AttitudeTrialConfig {
    AttitudeTrialConfig {
        gyroscope_bias_random_walk_rad_s_sqrt_s: 2e-4,
        ..AttitudeTrialConfig::default()
    }
}

fn start_off(seed: u64, trial: &AttitudeTrial) -> InitialState<f64> {
    let off = normal_vector(&mut stream(seed, "initial-error"), 0.1);
    initial(trial, trial.world_from_body[0] * so3::exp(&off), 0.1, 0.02)
}

/// (b) NEES of the six states 5.0 to 7.0 over 50 runs (prototype 5.87), NIS 2.9 to 3.1 (2.997, 2.994).
#[test]
fn mekf_nees_and_nis_are_inside_their_bands() {
    let config = walking_bias();
    let runs = campaign(5000..5050, |seed| {
        let trial = AttitudeTrial::simulate(seed, &config);
        let mut filter = Mekf::new(consistent(&config)).unwrap();
        filter.initialize(&start_off(seed, &trial));
        let (mut nees, mut nis, mut square) = (vec![], [vec![], vec![]], vec![]);
        feed(&mut filter, &trial, |k, f, [a, m]| {
            if k < 200 {
                return;
            }
            let e = attitude_error(f, &trial.world_from_body[k + 1]);
            let db = trial.gyroscope_bias[k + 1] - f.state().gyroscope_bias;
            let x = SVector::<f64, 6>::from([e.x, e.y, e.z, db.x, db.y, db.z]);
            nees.push(normalized_square(&x, &f.state().covariance).unwrap());
            nis[0].push(a);
            nis[1].push(m);
            square.push(e.norm_squared());
        });
        [
            mean(nees),
            mean(nis[0].iter().copied()),
            mean(nis[1].iter().copied()),
            mean(square),
        ]
    });
    let average = |i: usize| mean(runs.iter().map(|r| r[i]));
    let (nees, acc, mag, rms) = (average(0), average(1), average(2), rms_deg(average(3)));
    println!(
        "NEES(6) {nees:.3}, NIS accelerometer {acc:.3}, magnetometer {mag:.3}, RMS {rms:.4} deg"
    );
    assert!((5.0..7.0).contains(&nees), "NEES {nees}");
    assert!(
        (2.9..3.1).contains(&acc) && (2.9..3.1).contains(&mag),
        "NIS {acc} {mag}"
    );
    within(rms, 0.0876, 0.05, "attitude RMS");
}

/// (d) MEKF, USQUE and quaternion EKF agree in the steady state within 2 %.
#[test]
fn three_filters_share_one_steady_state() {
    fn rms<E: AttitudeEstimator<f64>>(
        make: impl Fn(AttitudeConfig<f64>) -> E + Sync + Send,
    ) -> f64 {
        let config = walking_bias();
        let runs = campaign(5000..5020, |seed| {
            let trial = AttitudeTrial::simulate(seed, &config);
            let mut filter = make(consistent(&config));
            filter.initialize(&start_off(seed, &trial));
            let mut square = vec![];
            feed(&mut filter, &trial, |k, f, _| {
                if k >= 1000 {
                    square.push(attitude_error(f, &trial.world_from_body[k + 1]).norm_squared());
                }
            });
            mean(square)
        });
        rms_deg(mean(runs))
    }
    let mekf = rms(|c| Mekf::new(c).unwrap());
    let usque = rms(|c| Usque::new(c).unwrap());
    let ekf = rms(|c| QuaternionEkf::new(c).unwrap());
    println!("steady RMS: mekf {mekf:.5}, usque {usque:.5}, quaternion-ekf {ekf:.5} deg");
    within(usque, mekf, 0.02, "usque against mekf");
    within(ekf, mekf, 0.02, "quaternion EKF against mekf");
}

/// What a rest calibration of `n` samples gives the paper's filter.
struct Calibrated {
    bias: Vector3<f64>,
    references: References<f64>,
    std: [f64; 3],
}

fn calibrate(
    seed: u64,
    trial: &AttitudeTrial,
    config: &AttitudeTrialConfig,
    n: usize,
) -> Calibrated {
    let mut rest = stream(seed, "calibration");
    let mut sensor = |mean_value: Vector3<f64>, std: f64| {
        let samples: Vec<_> = (0..n)
            .map(|_| mean_value + normal_vector(&mut rest, std))
            .collect();
        let m = samples.iter().sum::<Vector3<f64>>() / n as f64;
        let spread = samples.iter().map(|s| (s - m).norm_squared()).sum::<f64>();
        (m, (spread / (3.0 * (n as f64 - 1.0))).sqrt())
    };
    let (bias, g) = sensor(trial.gyroscope_bias[0], config.gyroscope_noise_std_rad_s);
    let (force, a) = sensor(
        trial.specific_force_world,
        config.accelerometer_noise_std_m_s2,
    );
    let (field, m) = sensor(
        trial.magnetic_field_world_ut,
        config.magnetometer_noise_std_ut,
    );
    let references = References {
        specific_force: force,
        magnetic_field: Some(field),
    };
    Calibrated {
        bias,
        references,
        std: [g, a, m],
    }
}

/// NEES(3), attitude RMS, final calculated and final estimated error (deg) of the paper's filter.
fn paper_campaign(process_noise: ProcessNoise) -> [f64; 4] {
    let config = AttitudeTrialConfig {
        gyroscope_bias_random_walk_rad_s_sqrt_s: 0.0,
        ..AttitudeTrialConfig::default()
    };
    let runs = campaign(1000..1100, |seed| {
        let trial = AttitudeTrial::simulate(seed, &config);
        let calibrated = calibrate(seed, &trial, &config, 1000);
        let [g, a, m] = calibrated.std;
        let mut filter = Mekf3::new(AttitudeConfig {
            gyroscope_noise_density: g / config.rate_hz.sqrt(),
            accelerometer_std: a,
            magnetometer_std_ut: m,
            process_noise,
            gyroscope_sample_interval_s: trial.dt_s,
            ..consistent(&config)
        })
        .unwrap();
        filter.initialize(&InitialState {
            gyroscope_bias: calibrated.bias,
            north_known: false,
            references: calibrated.references,
            ..initial(&trial, UnitQuaternion::identity(), 1e-3, 0.0)
        });
        let (mut nees, mut square) = (vec![], vec![]);
        for k in 0..trial.len() {
            filter.propagate(&trial.gyroscope[k], trial.dt_s);
            filter.update_joint(Some(&trial.accelerometer[k]), Some(&trial.magnetometer[k]));
            if k >= 100 {
                let e = attitude_error(&filter, &trial.world_from_body[k + 1]);
                let p: SMatrix<f64, 3, 3> = filter.state().covariance;
                nees.push(normalized_square(&e, &p).unwrap());
                square.push(e.norm_squared());
            }
        }
        let calculated = filter.attitude().angle();
        let estimated = filter.state().covariance.trace();
        [mean(nees), mean(square), calculated * calculated, estimated]
    });
    let average = |i: usize| mean(runs.iter().map(|r| r[i]));
    [
        average(0),
        rms_deg(average(1)),
        rms_deg(average(2)),
        rms_deg(average(3)),
    ]
}

/// The gyroscope alone after the same calibration: RMS and final error (deg).
fn integration_campaign() -> [f64; 2] {
    let config = AttitudeTrialConfig {
        gyroscope_bias_random_walk_rad_s_sqrt_s: 0.0,
        ..AttitudeTrialConfig::default()
    };
    let runs = campaign(1000..1100, |seed| {
        let trial = AttitudeTrial::simulate(seed, &config);
        let calibrated = calibrate(seed, &trial, &config, 1000);
        let mut filter = Integration::default();
        filter.initialize(&InitialState {
            gyroscope_bias: calibrated.bias,
            ..initial(&trial, UnitQuaternion::identity(), 1e-3, 0.0)
        });
        let mut square = vec![];
        feed(&mut filter, &trial, |k, f, _| {
            if k >= 100 {
                square.push(attitude_error(f, &trial.world_from_body[k + 1]).norm_squared());
            }
        });
        [mean(square), filter.attitude().angle().powi(2)]
    });
    [0, 1].map(|i| rms_deg(mean(runs.iter().map(|r| r[i]))))
}

/// (c) The paper's Q read literally is conservative, the discrete one nearly consistent.
#[test]
fn literal_and_discrete_process_noise_reproduce_the_known_table() {
    let literal = paper_campaign(ProcessNoise::PaperLiteral);
    let discrete = paper_campaign(ProcessNoise::Discrete);
    let [rms, last] = integration_campaign();
    println!("gyroscope alone, RMS {rms:.2}, final calculated {last:.2} deg");
    within(rms, 0.46, 0.15, "gyroscope alone, RMS");
    within(last, 0.74, 0.15, "gyroscope alone, final");
    println!(
        "literal  NEES(3) {:.2}, RMS {:.3}, final calculated {:.3}, estimated {:.3} deg",
        literal[0], literal[1], literal[2], literal[3]
    );
    println!(
        "discrete NEES(3) {:.2}, RMS {:.3}, final calculated {:.3}, estimated {:.3} deg",
        discrete[0], discrete[1], discrete[2], discrete[3]
    );
    for (found, expected) in [
        (literal, [1.64, 0.160, 0.156, 0.216]),
        (discrete, [3.75, 0.081, 0.085, 0.069]),
    ] {
        for (i, what) in ["NEES", "RMS", "final calculated", "final estimated"]
            .iter()
            .enumerate()
        {
            within(found[i], expected[i], 0.15, what);
        }
    }
}

/// Attitude RMS (deg) under bursts, with a gate and a norm gain.
fn disturbed(acceleration: f64, magnetic: f64, gate: [f64; 2], norm_gain: f64) -> f64 {
    let config = AttitudeTrialConfig {
        acceleration_burst_m_s2: acceleration,
        magnetic_burst_ut: magnetic,
        ..AttitudeTrialConfig::default()
    };
    let [nis, timeout] = gate;
    let runs = campaign(9000..9030, |seed| {
        let trial = AttitudeTrial::simulate(seed, &config);
        let mut filter = Mekf::new(AttitudeConfig {
            accelerometer_gate_nis: nis,
            magnetometer_gate_nis: nis,
            gate_timeout_s: timeout,
            accelerometer_norm_gain: norm_gain,
            magnetometer_norm_gain: norm_gain,
            ..consistent(&config)
        })
        .unwrap();
        filter.initialize(&initial(&trial, trial.world_from_body[0], 0.02, 0.02));
        let mut square = vec![];
        feed(&mut filter, &trial, |k, f, _| {
            if k >= 200 {
                square.push(attitude_error(f, &trial.world_from_body[k + 1]).norm_squared());
            }
        });
        mean(square)
    });
    rms_deg(mean(runs))
}

/// (i) The gating table: none, reject, inflate at once, adaptive R; within 30 %.
#[test]
fn gating_table() {
    const OPEN: [f64; 2] = [0.0, 3.0];
    const REJECT: [f64; 2] = [11.344_867, 10.0];
    const INFLATE: [f64; 2] = [11.344_867, 0.0];
    let expected = [
        ("undisturbed", 0.0, 0.0, [0.078, 0.078, 0.078, 0.091]),
        ("acceleration", 2.0, 0.0, [2.73, 0.148, 0.257, 1.37]),
        ("magnetic", 0.0, 20.0, [16.8, 0.089, 0.459, 0.358]),
        ("both", 2.0, 20.0, [17.0, 0.154, 0.570, 1.43]),
    ];
    let mut table = vec![];
    for (name, acc, mag, row) in expected {
        let found = [
            disturbed(acc, mag, OPEN, 0.0),
            disturbed(acc, mag, REJECT, 0.0),
            disturbed(acc, mag, INFLATE, 0.0),
            disturbed(acc, mag, OPEN, 4.0),
        ];
        println!(
            "{name:<14} none {:.3}, reject {:.3}, inflate {:.3}, adaptive {:.3} deg",
            found[0], found[1], found[2], found[3]
        );
        table.push((name, found, row));
    }
    for (name, found, row) in table {
        for (i, what) in ["none", "reject", "inflate", "adaptive"].iter().enumerate() {
            within(found[i], row[i], 0.3, &format!("{name}, {what}"));
        }
    }
}
