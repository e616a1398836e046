//! The batch smoother on simulated drives: nearer than the filter, consistent, across gaps, outliers and a wrong start.

use std::collections::HashMap;

use nalgebra::{SVector, Vector3};
use northing_core::geometry::so3;
use northing_core::kalman::SkipReason;
use northing_core::navigation::gnss_ins::{ErrorShares, GnssIns, GnssInsConfig, ImuSamples};
use northing_core::navigation::{GnssPosition, NavigationState};
use northing_simulation::ground::{Ground, GroundSample, GroundSensors, simulate};

use super::{BatchRecorder, BatchSolution, Measured, Part, SmoothedNavigation};

const SHARES: ErrorShares<f64> = ErrorShares {
    white: 1.0,
    slow: 0.0,
};

/// The settings of a simulated drive's own noises, without what the simulation does not have.
fn config(sensors: &GroundSensors) -> GnssInsConfig<f64> {
    let root = 0.02_f64.sqrt();
    GnssInsConfig {
        imu_samples: ImuSamples::Means,
        accelerometer_noise_density: sensors.accelerometer_std * root,
        gyroscope_noise_density: sensors.gyroscope_std * root,
        accelerometer_bias_random_walk: 1e-4,
        gyroscope_bias_random_walk: sensors.gyroscope_bias_random_walk,
        accelerometer_gauss_markov_std: 0.0,
        gyroscope_gauss_markov_std: 0.0,
        position_uncorrelated_fraction: SHARES.white,
        position_correlated_fraction: SHARES.slow,
        time_offset_std_s: 0.0,
        time_jitter_s: 0.0,
        lever_arm_std_m: Some(0.0),
        damping_speed_m_s: 0.0,
        earth_curvature: false,
        vibration_noise: false,
        ..GnssInsConfig::default()
    }
}

fn time_ns(sample: &GroundSample) -> i64 {
    (sample.time_s * 1e9).round() as i64
}

/// A run of filter and smoother.
struct Run {
    config: GnssInsConfig<f64>,
    sensors: GroundSensors,
    /// What the receiver says of a fix; `None`: nothing.
    receiver: fn(&GroundSample, Vector3<f64>) -> Option<Vector3<f64>>,
    /// Whether there is an inertial sample.
    has_imu: fn(f64) -> bool,
    /// How far the heading is off at the start, rad, where that is given.
    start: Option<f64>,
}

impl Run {
    fn new(sensors: GroundSensors) -> Self {
        Self {
            config: config(&sensors),
            sensors,
            receiver: |_, ned| Some(ned),
            has_imu: |_| true,
            start: None,
        }
    }

    /// The solution, the truth and the filter's positions by time.
    fn go(&self, seed: u64) -> (BatchSolution, HashMap<i64, (GroundSample, Vector3<f64>)>) {
        let way = simulate(Ground::Drive, &self.sensors, 180.0, seed);
        let mut ins = GnssIns::<f64>::new(self.config).unwrap();
        if let Some(off) = self.start {
            let first = &way[0];
            let attitude = so3::exp(&(Vector3::z() * off)) * first.ned_from_body;
            let state = NavigationState::new(attitude, first.velocity, first.position);
            let state = state.with_std([0.05, 0.1, 5.0, 0.15, 0.02]);
            assert!(ins.start_at(time_ns(first) - 20_000_000, &state));
        }
        let mut recorder = BatchRecorder::default();
        let mut truth = HashMap::new();
        for sample in way {
            let at = time_ns(&sample);
            if !(self.has_imu)(sample.time_s) {
                continue;
            }
            let (rate, force) = (&sample.angular_rate, &sample.specific_force);
            let taken = ins.imu(at, rate, force);
            if taken == Err(SkipReason::Suspect) {
                // The first sample behind a long gap, whose stamp may be false.
                continue;
            }
            taken.unwrap();
            recorder.imu(at, rate, force, &ins);
            let said = sample
                .fix
                .and_then(|[ned, _]| (self.receiver)(&sample, ned));
            if let Some(ned) = said {
                let [h, v] = self.sensors.position_std;
                let fix = GnssPosition::new(ned, Vector3::new(h, h, v));
                ins.gnss_position(at, &fix);
                for part in [Part::Horizontal, Part::Vertical] {
                    let measured = Measured::Position(fix, SHARES, part);
                    recorder.measurement(at, measured, None, &self.config);
                }
            }
            let filtered = ins.state().map(|state| state.position);
            truth.insert(at, (sample, filtered.unwrap_or_default()));
        }
        (recorder.smooth(&self.config), truth)
    }
}

fn horizontal(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    (a - b).xy().norm()
}

/// Truth less estimate, as the 15 errors.
fn error(truth: &GroundSample, node: &SmoothedNavigation) -> SVector<f64, 15> {
    let turn = so3::log(&(truth.ned_from_body * node.ned_from_body.inverse()));
    let [rate, force] = truth.biases;
    let parts = [
        turn,
        truth.velocity - node.velocity,
        truth.position - node.position,
        force - node.accelerometer_bias,
        rate - node.gyroscope_bias,
    ];
    SVector::from_iterator(parts.iter().flatten().copied())
}

/// Squared horizontal errors of filter and smoother, the largest in an outage, and error squared over variance.
#[test]
fn smoothing_is_nearer_bridges_an_outage_and_is_consistent() {
    let mut run = Run::new(GroundSensors::default());
    let is_out = |t: f64| (100.0..130.0).contains(&t);
    run.receiver = |sample, ned| (!(100.0..130.0).contains(&sample.time_s)).then_some(ned);
    let mut squares = [0.0; 2];
    let mut worst = [0.0; 2];
    let (mut over_variance, mut n) = (0.0, 0.0);
    for seed in 1..=8 {
        let (solution, truth) = run.go(seed);
        let summary = solution.summary.unwrap();
        assert!(summary.converged && summary.batches == 1, "{summary:?}");
        assert!(solution.nodes.is_sorted_by_key(|node| node.time_ns));
        let mut largest = [0.0_f64; 2];
        for node in &solution.nodes {
            let Some((truth, filtered)) = truth.get(&node.time_ns) else {
                continue;
            };
            let errors = [filtered, &node.position].map(|p| horizontal(p, &truth.position));
            if is_out(truth.time_s) {
                for (worst, error) in largest.iter_mut().zip(errors) {
                    *worst = worst.max(error);
                }
            } else if (40.0..160.0).contains(&truth.time_s) {
                for (sum, error) in squares.iter_mut().zip(errors) {
                    *sum += error * error;
                }
                let p = &node.covariance;
                over_variance += errors[1] * errors[1] / (p[(6, 6)] + p[(7, 7)]);
                n += 1.0;
            }
        }
        for (sum, largest) in worst.iter_mut().zip(largest) {
            *sum += largest;
        }
    }
    let ratio = (squares[1] / squares[0]).sqrt();
    assert!(ratio < 0.75, "smoother to filter: {ratio}");
    let [filter, smoother] = worst;
    assert!(
        smoother < 0.35 * filter,
        "in the outage {smoother} of {filter} m"
    );
    let share = over_variance / n;
    assert!(
        (0.6..1.4).contains(&share),
        "error squared over variance: {share}"
    );
}

/// Started 20 degrees off, behind a receiver of centimetres: one linearisation is far from enough.
#[test]
fn a_wrong_start_converges_to_the_truth_and_the_covariance_is_consistent() {
    let sensors = GroundSensors {
        position_std: [0.05, 0.1],
        ..GroundSensors::default()
    };
    let mut run = Run::new(sensors);
    run.start = Some(20_f64.to_radians());
    let seeds = 12_u64;
    let mut nees = 0.0;
    let mut n = 0.0;
    for seed in 1..=seeds {
        let (solution, truth) = run.go(seed);
        let summary = solution.summary.unwrap();
        assert!(summary.converged, "seed {seed}: {summary:?}");
        for at in [2_i64, 20, 60, 100, 140, 178] {
            let is_next = |node: &&SmoothedNavigation| {
                node.time_ns >= at * 1_000_000_000 && truth.contains_key(&node.time_ns)
            };
            let node = solution.nodes.iter().find(is_next).unwrap();
            let error = error(&truth[&node.time_ns].0, node);
            let heading = error[2].abs().to_degrees();
            assert!(heading < 1.5, "seed {seed} at {at}: {heading} deg");
            let known = node.covariance.cholesky().unwrap().solve(&error);
            nees += error.dot(&known) / 15.0;
            n += 1.0;
        }
    }
    let mean = nees / n;
    assert!((0.6..1.4).contains(&mean), "NEES {mean}");
}

#[test]
fn fixes_far_off_count_less_and_move_nothing() {
    let sensors = GroundSensors {
        position_std: [0.5, 1.0],
        ..GroundSensors::default()
    };
    let mut run = Run::new(sensors);
    let (clean, truth) = run.go(3);
    run.receiver = |sample, ned| {
        let off = match sample.time_s.round() as i64 {
            50 => Vector3::new(2e6, 0.0, 0.0),
            90 | 92 => Vector3::new(0.0, 40.0, 0.0),
            _ => Vector3::zeros(),
        };
        Some(ned + off)
    };
    let (solution, _) = run.go(3);
    let [summary, before] = [&solution, &clean].map(|s| s.summary.unwrap());
    assert!(summary.converged, "{summary:?}");
    assert!(summary.fixes_down_weighted >= 3 && before.fixes_down_weighted < 12);
    let (mut largest, mut furthest) = (0.0_f64, 0.0_f64);
    for node in &solution.nodes {
        if let Some((truth, _)) = truth.get(&node.time_ns) {
            largest = largest.max(horizontal(&node.position, &truth.position));
        }
        let since = node.since_fix_s.unwrap();
        assert!(since < 1.01, "{since} s");
        furthest = furthest.max(since);
    }
    // The fix on another continent is none, nor are those 40 m beside.
    assert!(furthest > 0.99, "{furthest} s");
    assert!(largest < 1.0, "{largest} m");
}

#[test]
fn a_gap_of_seconds_is_crossed_and_one_of_more_begins_another_batch() {
    let sensors = GroundSensors {
        position_std: [0.05, 0.1],
        ..GroundSensors::default()
    };
    let mut run = Run::new(sensors);
    run.has_imu = |t| !(80.0..83.0).contains(&t) && !(120.0..135.0).contains(&t);
    let (solution, truth) = run.go(5);
    let summary = solution.summary.unwrap();
    assert!(summary.converged && summary.batches == 2, "{summary:?}");
    let within = |from: f64, to: f64| {
        let nodes = solution.nodes.iter();
        nodes.filter(move |node| (from..to).contains(&(node.time_ns as f64 * 1e-9)))
    };
    assert!(within(80.0, 83.0).count() >= 29);
    assert_eq!(within(120.1, 134.9).count(), 0);
    for node in within(70.0, 119.0).chain(within(145.0, 170.0)) {
        let Some((truth, _)) = truth.get(&node.time_ns) else {
            continue;
        };
        let error = horizontal(&node.position, &truth.position);
        let p = &node.covariance;
        let std = (p[(6, 6)] + p[(7, 7)]).sqrt();
        assert!(
            error < 4.0 * std,
            "{error} m at {} s, {std} m",
            truth.time_s
        );
    }
}

#[test]
fn without_a_fix_there_is_nothing_to_smooth() {
    let mut run = Run::new(GroundSensors::default());
    run.receiver = |_, _| None;
    let (solution, _) = run.go(1);
    assert_eq!(solution, BatchSolution::default());
}
