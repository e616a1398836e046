//! Tests of the smoother: Monte Carlo gain and consistency, and the borders of its memory.

use super::*;
use northing_core::attitude::References;
use northing_simulation::random::{normal_vector, stream};
use northing_simulation::{AttitudeTrial, AttitudeTrialConfig};

fn start(trial: &AttitudeTrial, seed: u64) -> InitialState<f64> {
    let error = normal_vector(&mut stream(seed, "initial attitude"), 0.1);
    InitialState {
        attitude: trial.world_from_body[0] * so3::exp(&error),
        attitude_covariance: Matrix3::identity() * 0.01,
        gyroscope_bias: Vector3::zeros(),
        gyroscope_bias_std: 0.02,
        north_known: false,
        references: References {
            specific_force: trial.specific_force_world,
            magnetic_field: Some(trial.magnetic_field_world_ut),
        },
    }
}

fn run(trial: &AttitudeTrial, recorder: &mut Recorder) -> Vec<SmoothedState> {
    for k in 0..trial.len() {
        assert_eq!(
            recorder.propagate(&trial.gyroscope[k], trial.dt_s),
            Propagation::Done
        );
        recorder.update_accelerometer(&trial.accelerometer[k]);
        recorder.update_magnetometer(&trial.magnetometer[k]);
    }
    recorder.smooth()
}

/// Squared errors of attitude (rad) and bias (rad/s) and NEES(6) of a state.
fn errors(state: &SmoothedState, truth: &UnitQuaternion<f64>, bias: &Vector3<f64>) -> [f64; 3] {
    let a = so3::log(&(state.attitude.inverse() * truth));
    let b = bias - state.gyroscope_bias;
    let mut x = Vector6::zeros();
    x.fixed_rows_mut::<3>(0).copy_from(&a);
    x.fixed_rows_mut::<3>(3).copy_from(&b);
    let nees = x.dot(&state.covariance.cholesky().unwrap().solve(&x));
    [a.norm_squared(), b.norm_squared(), nees]
}

/// Specification of the lab, 5.10 and test (e): 0.0876 -> 0.0539 deg, bias 0.045 -> 0.027 deg/s,
/// NEES 5.90 of 6.
#[test]
fn smoothing_lowers_the_error_by_a_third_and_stays_consistent() {
    // The first two seconds, where the filter still converges, do not count in either.
    const SETTLED: usize = 200;
    let config = AttitudeTrialConfig {
        gyroscope_bias_random_walk_rad_s_sqrt_s: 2e-4,
        ..AttitudeTrialConfig::default()
    };
    let filter_config = AttitudeConfig {
        accelerometer_gate_nis: 0.0,
        magnetometer_gate_nis: 0.0,
        ..AttitudeConfig::lab()
    };
    let (mut filtered, mut smoothed, mut count) = ([0.0; 3], [0.0; 3], 0.0);
    for seed in 0..50 {
        let trial = AttitudeTrial::simulate(seed, &config);
        let mut recorder = Recorder::new(filter_config).unwrap();
        recorder.initialize(&start(&trial, seed));
        let first = recorder.node();
        let smoothed_states = run(&trial, &mut recorder);
        assert!(recorder.steps[first..].iter().all(|step| step.propagated));
        let own = recorder.steps[first..].iter().map(|step| &step.filtered);
        let states = own.zip(&smoothed_states[first..]).enumerate().skip(SETTLED);
        for (k, (own, smoothed_states)) in states {
            let (truth, bias) = (&trial.world_from_body[k], &trial.gyroscope_bias[k]);
            for (sum, state) in [(&mut filtered, own), (&mut smoothed, smoothed_states)] {
                for (s, e) in sum.iter_mut().zip(errors(state, truth, bias)) {
                    *s += e;
                }
            }
            count += 1.0;
        }
    }
    let rms_deg = |sum: f64| (sum / count).sqrt().to_degrees();
    let attitude = [filtered[0], smoothed[0]].map(rms_deg);
    let bias = [filtered[1], smoothed[1]].map(rms_deg);
    let nees = [filtered[2], smoothed[2]].map(|sum| sum / count);
    println!("attitude {attitude:.4?} deg, bias {bias:.4?} deg/s, NEES {nees:.3?} of 6");
    assert!(
        (0.60..=0.65).contains(&(attitude[1] / attitude[0])),
        "{attitude:?}"
    );
    assert!((attitude[1] / 0.0539 - 1.0).abs() < 0.05, "{attitude:?}");
    assert!(bias[1] / bias[0] < 0.65, "{bias:?}");
    assert!((5.6..6.4).contains(&nees[1]), "{nees:?}");
}

#[test]
fn every_node_is_at_most_as_uncertain_as_the_filter_was() {
    let config = AttitudeTrialConfig {
        duration_s: 5.0,
        ..AttitudeTrialConfig::default()
    };
    let trial = AttitudeTrial::simulate(1, &config);
    let mut recorder = Recorder::new(AttitudeConfig::lab()).unwrap();
    recorder.initialize(&start(&trial, 1));
    let smoothed_states = run(&trial, &mut recorder);
    assert_eq!(smoothed_states.len(), recorder.node() + 1);
    for (step, smoothed) in recorder.steps.iter().zip(&smoothed_states).skip(1) {
        let filtered = &step.filtered;
        // Traces, as re-centring at an update turns the axes of the covariance.
        let attitude = |s: &SmoothedState| s.attitude_covariance().trace();
        let bias = |s: &SmoothedState| s.bias_covariance().trace();
        assert!(attitude(smoothed) <= attitude(filtered) * (1.0 + 1e-9));
        assert!(bias(smoothed) <= bias(filtered) * (1.0 + 1e-9));
    }
    assert_eq!(
        smoothed_states.last(),
        Some(&SmoothedState::of(&recorder.mekf))
    );
}

#[test]
fn nothing_is_carried_back_across_a_new_start() {
    let config = AttitudeTrialConfig {
        duration_s: 1.0,
        ..AttitudeTrialConfig::default()
    };
    let trial = AttitudeTrial::simulate(2, &config);
    let mut recorder = Recorder::new(AttitudeConfig::lab()).unwrap();
    recorder.initialize(&start(&trial, 2));
    let alone = run(&trial, &mut recorder);
    let border = recorder.node();
    recorder.initialize(&start(&trial, 3));
    let both = run(&trial, &mut recorder);
    assert_eq!(both[..=border], alone[..]);
}

#[test]
fn a_gap_is_a_node_of_its_own() {
    let config = AttitudeTrialConfig {
        duration_s: 1.0,
        ..AttitudeTrialConfig::default()
    };
    let trial = AttitudeTrial::simulate(4, &config);
    let mut recorder = Recorder::new(AttitudeConfig::lab()).unwrap();
    recorder.initialize(&start(&trial, 4));
    run(&trial, &mut recorder);
    let before = recorder.node();
    recorder.add_attitude_variance(0.5);
    assert_eq!(recorder.node(), before + 1);
    let blind = recorder.smooth();
    // What comes after a gap as wide as half a radian says next to nothing about before it.
    assert!(blind[before].attitude_covariance().trace() < 1e-4);
    assert!(blind[before + 1].attitude_covariance().trace() > 1.4);
}
