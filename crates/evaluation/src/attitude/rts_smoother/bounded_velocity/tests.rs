//! Tests of the smoother: gain and consistency on simulated motion, constants, and the borders of its
//! memory.

use super::*;
use approx::assert_relative_eq;
use northing_core::attitude::bounded_velocity::BoundedVelocityConfig;
use northing_core::attitude::{AttitudeEstimator, InitialState, Propagation, References};
use northing_simulation::random::{normal_vector, stream};
use northing_simulation::{AttitudeTrial, AttitudeTrialConfig};

type Recorder = BoundedVelocity<f64, Steps>;

/// All 22 states, without prediction, so that the estimate is the state.
fn config() -> BoundedVelocityConfig<f64> {
    BoundedVelocityConfig {
        initial_hard_iron_std_ut: 2.0,
        initial_gyroscope_bias_std: 0.02,
        prediction_s: 0.0,
        ..BoundedVelocityConfig::lab()
    }
}

/// What the simulated sensors really are, so that the covariance has to be right: white noise alone,
/// a field as stated, a device that does not move away.
fn consistent() -> BoundedVelocityConfig<f64> {
    let simulated = AttitudeTrialConfig::default();
    let density = |std: f64| std / simulated.rate_hz.sqrt();
    BoundedVelocityConfig {
        update_interval_s: simulated.rate_hz.recip(),
        gyroscope_noise_density: density(simulated.gyroscope_noise_std_rad_s),
        gyroscope_scale_noise: 0.0,
        scale_states: ScaleStates::Off,
        accelerometer_noise_density: density(simulated.accelerometer_noise_std_m_s2),
        accelerometer_scale_noise: 0.0,
        // Its velocity is zero: far less than what the accelerometer adds in one interval.
        velocity_psd: 1e-12,
        velocity_psd_gain: 0.0,
        initial_velocity_psd: 0.0,
        largest_velocity_psd: 0.0,
        rest_slow_motion_gain: 0.0,
        magnetometer_std_ut: simulated.magnetometer_noise_std_ut,
        magnetometer_correlation_time_s: 0.0,
        field_strength_scale_ut: 1e6,
        field_dip_scale: 10.0,
        magnetometer_student_freedom: 0.0,
        initial_field_std_ut: 0.0,
        initial_hard_iron_std_ut: 0.0,
        ..config()
    }
}

fn trial(seed: u64, duration_s: f64) -> AttitudeTrial {
    let config = AttitudeTrialConfig {
        duration_s,
        gyroscope_bias_random_walk_rad_s_sqrt_s: 1e-5,
        ..AttitudeTrialConfig::default()
    };
    AttitudeTrial::simulate(seed, &config)
}

fn started(trial: &AttitudeTrial, seed: u64, config: BoundedVelocityConfig<f64>) -> Recorder {
    let mut recorder = Recorder::observed(config, Steps::default()).unwrap();
    recorder.initialize(&start(trial, seed));
    recorder
}

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

/// What the filter knew at a sample.
struct Known {
    node: usize,
    attitude: UnitQuaternion<f64>,
    covariance: Matrix3<f64>,
}

fn run(trial: &AttitudeTrial, recorder: &mut Recorder) -> Vec<Known> {
    let mut known = Vec::new();
    for k in 0..trial.len() {
        let propagation = recorder.propagate(&trial.gyroscope[k], trial.dt_s);
        assert_eq!(propagation, Propagation::Done);
        recorder.update_accelerometer(&trial.accelerometer[k]);
        recorder.update_magnetometer(&trial.magnetometer[k]);
        known.push(Known {
            node: recorder.node(),
            attitude: recorder.attitude(),
            covariance: recorder.attitude_covariance().unwrap(),
        });
    }
    known
}

/// Squared error (rad) and NEES(3) of an attitude.
fn errors(
    attitude: &UnitQuaternion<f64>,
    covariance: &Matrix3<f64>,
    truth: &UnitQuaternion<f64>,
) -> [f64; 2] {
    let a = so3::log(&(attitude.inverse() * truth));
    let nees = a.dot(&covariance.cholesky().unwrap().solve(&a));
    [a.norm_squared(), nees]
}

#[test]
fn smoothing_lowers_the_error_and_stays_consistent() {
    // While the filter still converges, the smoother wins too easily.
    const SETTLED: usize = 200;
    let (mut filtered, mut smoothed, mut count) = ([0.0; 2], [0.0; 2], 0.0);
    for seed in 0..24 {
        let trial = trial(seed, 40.0);
        let mut recorder = started(&trial, seed, consistent());
        let known = run(&trial, &mut recorder);
        let nodes = recorder.smooth();
        for (known, truth) in known.iter().zip(&trial.world_from_body[1..]).skip(SETTLED) {
            let node = &nodes[known.node];
            let estimate = Recorder::smoothed_estimate(node, &known.attitude);
            let (attitude, covariance) = (estimate.attitude, estimate.attitude_covariance);
            for (sum, e) in [
                (
                    &mut filtered,
                    errors(&known.attitude, &known.covariance, truth),
                ),
                (&mut smoothed, errors(&attitude, &covariance, truth)),
            ] {
                sum[0] += e[0];
                sum[1] += e[1];
            }
            count += 1.0;
        }
    }
    let rms = [filtered, smoothed].map(|sum| (sum[0] / count).sqrt().to_degrees());
    let nees = [filtered, smoothed].map(|sum| sum[1] / count / 3.0);
    println!("attitude {rms:.4?} deg, NEES/3 {nees:.3?}");
    assert!(rms[1] < 0.7 * rms[0], "{rms:?} deg");
    assert!((0.9..1.1).contains(&nees[1]), "{nees:?}");
}

/// Scale and hard iron without walk, and the bias, are constants: the smoother knows them at every
/// node as at the last.
#[test]
fn what_does_not_change_is_known_from_the_first_node_as_at_the_last() {
    let config = BoundedVelocityConfig {
        gyroscope_bias_random_walk: 0.0,
        ..config()
    };
    let trial = trial(1, 20.0);
    let mut recorder = started(&trial, 1, config);
    run(&trial, &mut recorder);
    let nodes = recorder.smooth();
    let (bias, covariance) = recorder.gyroscope_bias().unwrap();
    for node in &nodes {
        assert_relative_eq!(node.gyroscope_bias, bias, epsilon = 1e-7);
        assert_relative_eq!(
            node.bias_covariance,
            covariance,
            max_relative = 1e-3,
            epsilon = 1e-9
        );
    }
    assert!(nodes.len() > 450);
}

#[test]
fn the_last_node_is_the_filters_and_no_node_is_less_certain_than_the_filter_was() {
    let trial = trial(2, 10.0);
    let mut recorder = started(&trial, 2, config());
    let known = run(&trial, &mut recorder);
    let nodes = recorder.smooth();
    assert_eq!(nodes.len(), recorder.node() + 1);
    let last = Recorder::smoothed_estimate(nodes.last().unwrap(), &recorder.attitude());
    let (bias, bias_covariance) = recorder.gyroscope_bias().unwrap();
    assert_relative_eq!(last.attitude, recorder.attitude(), epsilon = 1e-14);
    let own = recorder.attitude_covariance().unwrap();
    assert_relative_eq!(last.attitude_covariance, own, epsilon = 1e-16);
    assert_eq!(
        (last.gyroscope_bias, last.bias_covariance),
        (bias, bias_covariance)
    );
    for known in &known {
        let smoothed = nodes[known.node].turn_covariance.trace();
        assert!(smoothed <= known.covariance.trace() * (1.0 + 1e-6));
    }
}

#[test]
fn memory_grows_with_the_updates_and_not_with_the_samples() {
    let trial = trial(3, 10.0);
    let with_interval = |update_interval_s| {
        let config = BoundedVelocityConfig {
            update_interval_s,
            ..config()
        };
        let mut recorder = started(&trial, 3, config);
        run(&trial, &mut recorder);
        recorder
    };
    let [often, seldom] = [0.02, 0.1].map(|interval| with_interval(interval).node() as f64);
    assert!(
        (often - 500.0).abs() <= 2.0 && (seldom - 100.0).abs() <= 2.0,
        "{often} {seldom}"
    );
    let recorder = with_interval(0.02);
    let recorded = &recorder.observer().recorded[7];
    assert_eq!(
        recorded.node.covariance.0.len(),
        CAPACITY * (CAPACITY + 1) / 2
    );
    let bytes = size_of::<Recorded>() + 2 * 8 * recorded.node.covariance.0.len();
    assert!(bytes < 5200, "{bytes}");
}

#[test]
fn nothing_is_carried_back_across_a_new_start() {
    let trial = trial(4, 3.0);
    let mut recorder = started(&trial, 4, config());
    run(&trial, &mut recorder);
    let alone = recorder.smooth();
    recorder.initialize(&start(&trial, 5));
    run(&trial, &mut recorder);
    let both = recorder.smooth();
    assert_eq!(both[..alone.len()], alone[..]);
}

#[test]
fn a_pause_and_a_gap_are_nodes_of_their_own() {
    let trial = trial(6, 3.0);
    let mut recorder = started(&trial, 6, config());
    run(&trial, &mut recorder);
    // Without accelerometer: then the velocity is unknown, and it starts again.
    for k in 0..trial.len().min(100) {
        recorder.propagate(&trial.gyroscope[k], trial.dt_s);
    }
    let before = recorder.node();
    recorder.update_accelerometer(&trial.accelerometer[0]);
    assert_eq!(recorder.node(), before + 2);
    assert_eq!(
        recorder.observer().recorded[before + 1]
            .step
            .as_ref()
            .unwrap()
            .0,
        Step::VelocityForgotten
    );
    recorder.add_attitude_variance(0.5);
    assert_eq!(recorder.node(), before + 3);
    let nodes = recorder.smooth();
    assert!(nodes[before].turn_covariance.trace() < 0.1);
    assert!(nodes[before + 3].turn_covariance.trace() > 1.4);
}

#[test]
fn nothing_recorded_is_nothing_smoothed() {
    let recorder = Recorder::observed(config(), Steps::default()).unwrap();
    assert_eq!((recorder.node(), recorder.smooth().len()), (0, 0));
}
