//! Schmidt-Kalman trackers that listen to the GNSS/INS: against a dense filter of target and navigation, and against
//! chance.

#![allow(clippy::unwrap_used)]

use approx::assert_relative_eq;
use nalgebra::{Matrix3, Matrix4, SMatrix, SVector, UnitQuaternion, Vector3, Vector4};
use northing_core::Restorable as _;
use northing_core::kalman::{ErrorListener, ErrorPropagation, Outcome, ScalarCorrection};
use northing_core::navigation::aiding::gnss_position::GnssPosition;
use northing_core::navigation::aiding::gnss_velocity::GnssVelocity;
use northing_core::navigation::augmented_states::{BAROMETER_OFFSET, GNSS_OFFSET, MAGNETIC_OFFSET};
use northing_core::navigation::gnss_ins::{ImuSamples, PoseWithErrors};
use northing_core::navigation::{
    ACCELEROMETER_BIAS, ERRORS, ErrorStateConfig, ErrorStateFilter, ErrorTransition, GnssIns,
    GnssInsConfig, NavigationState, STATES,
};
use northing_core::tracking::initiation::one_point;
use northing_core::tracking::radar::PredictedDetection;
use northing_core::tracking::{
    ConstantVelocity, Coupling, RadarDetection, RadarNoise, SchmidtKalman, TrackEstimate,
    TrackerConfig,
};
use rand::{RngExt as _, SeedableRng as _};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

use crate::polar;

type M15 = SMatrix<f64, STATES, STATES>;
type M25 = SMatrix<f64, ERRORS, ERRORS>;
type Tracker = SchmidtKalman<f64, ERRORS>;

/// Target and all errors of the navigation.
const ALL: usize = 4 + ERRORS;
type Joint = SMatrix<f64, ALL, ALL>;

const DEG: f64 = core::f64::consts::PI / 180.0;
const DT: f64 = 0.02;
const RADAR: RadarNoise<f64> = RadarNoise {
    range_std: 10.0,
    bearing_std: 0.5 * DEG,
};
/// Standard deviations of the 15 errors at the start, three each.
const START: [f64; 5] = [2.0 * DEG, 0.5, 3.0, 0.05, 0.05 * DEG];
const ACCELERATION_STD: f64 = 0.05;
const TARGET_SPEED_STD: f64 = 5.0;
const LATENCY: f64 = 0.1;
const ARM: [f64; 3] = [2.0, -1.0, -8.0];

fn config() -> GnssInsConfig<f64> {
    GnssInsConfig {
        imu_samples: ImuSamples::Means,
        accelerometer_noise_density: 0.02,
        gyroscope_noise_density: 1e-3,
        accelerometer_gauss_markov_std: 0.0,
        gyroscope_gauss_markov_std: 0.0,
        accelerometer_bias_random_walk: 1e-4,
        gyroscope_bias_random_walk: 1e-5,
        earth_curvature: false,
        lever_arm_m: ARM,
        position_latency_s: LATENCY,
        time_jitter_s: 0.0,
        position_uncorrelated_fraction: 0.8,
        position_correlated_fraction: 0.6,
        velocity_std_floor_m_s: 0.01,
        magnetic_offset_std_ut: 0.0,
        damping_speed_m_s: 0.0,
        // Errors are as stated.
        time_offset_std_s: 0.0,
        lever_arm_std_m: Some(0.0),
        least_noise_scale: 1.0,
        largest_noise_scale: 1.0,
        robust_weights: false,
        vibration_noise: false,
        ..GnssInsConfig::default()
    }
}

fn tracker_config() -> TrackerConfig<f64> {
    let acceleration_std = ACCELERATION_STD;
    TrackerConfig::new(ConstantVelocity { acceleration_std }, RADAR)
}

/// A ship that turns, pitches and speeds up past a target; the models of the filters are those of the truth.
struct World {
    rng: Pcg64Mcg,
    own: NavigationState<f64>,
    past: Vec<NavigationState<f64>>,
    target: Vector4<f64>,
    slow: Vector3<f64>,
    /// True angular rate of the last sample.
    rate: Vector3<f64>,
    time_ns: i64,
}

impl World {
    fn new(seed: u64) -> Self {
        let own = NavigationState {
            ned_from_body: UnitQuaternion::from_euler_angles(0.05, -0.03, 0.4),
            velocity: Vector3::new(8.0, 3.0, 0.0),
            position: Vector3::zeros(),
            accelerometer_bias: Vector3::zeros(),
            gyroscope_bias: Vector3::zeros(),
            covariance: M15::zeros(),
            pending: ErrorTransition::default(),
            skipped: 0,
        };
        let mut world = Self {
            rng: Pcg64Mcg::seed_from_u64(seed),
            past: vec![own; 2],
            own,
            target: Vector4::new(1500.0, 0.0, 1200.0, 0.0),
            slow: Vector3::zeros(),
            rate: Vector3::zeros(),
            time_ns: 1_000_000_000,
        };
        world.slow = world.normal(1.0).component_mul(&world.slow_std());
        let velocity = world.normal(TARGET_SPEED_STD);
        (world.target[1], world.target[3]) = (velocity.x, velocity.y);
        world
    }

    fn normal(&mut self, std: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| std * self.rng.sample::<f64, _>(StandardNormal))
    }

    fn slow_std(&self) -> Vector3<f64> {
        fix_std() * config().position_correlated_fraction
    }

    /// A start that is off by what it says.
    fn start(&mut self) -> NavigationState<f64> {
        let errors = START.map(|std| self.normal(std));
        let own = &self.own;
        NavigationState {
            ned_from_body: UnitQuaternion::from_scaled_axis(-errors[0]) * own.ned_from_body,
            velocity: own.velocity - errors[1],
            position: own.position - errors[2],
            accelerometer_bias: own.accelerometer_bias - errors[3],
            gyroscope_bias: own.gyroscope_bias - errors[4],
            covariance: M15::from_diagonal(&SVector::from_fn(|i, _| START[i / 3].powi(2))),
            ..*own
        }
    }

    /// The next inertial sample as it is measured.
    fn sample(&mut self) -> [Vector3<f64>; 2] {
        let c = config();
        let t = self.time_ns as f64 * 1e-9;
        let rate = Vector3::new(
            0.05 * t.cos(),
            0.04 * (0.7 * t).cos(),
            0.06 * (0.2 * t).sin(),
        );
        let force = self.own.ned_from_body.inverse() * Vector3::new(0.0, 0.0, -c.gravity)
            + Vector3::new(0.4 * (0.3 * t).cos(), 0.3 * (0.25 * t).sin(), 0.1 * t.sin());
        self.rate = rate;
        // The biases are part of the truth: what is measured has them, the ideal filter takes them out again.
        let measured = [
            rate + self.own.gyroscope_bias,
            force + self.own.accelerometer_bias,
        ];
        let settings = ErrorStateConfig {
            gravity: c.gravity,
            ..ErrorStateConfig::default()
        };
        let mut ideal = ErrorStateFilter::new(settings, self.own).unwrap();
        ideal.propagate(&measured[0], &measured[1], DT).unwrap();
        self.own = NavigationState {
            pending: ErrorTransition::default(),
            ..*ideal.state()
        };
        let walks = [
            c.accelerometer_bias_random_walk,
            c.gyroscope_bias_random_walk,
        ];
        let [force_walk, rate_walk] = walks.map(|walk| self.normal(walk * DT.sqrt()));
        self.own.accelerometer_bias += force_walk;
        self.own.gyroscope_bias += rate_walk;
        self.past.push(self.own);
        self.time_ns += (DT * 1e9) as i64;
        let kept = (-DT / c.position_correlation_time_s).exp();
        let fresh = self.normal((1.0 - kept * kept).sqrt());
        self.slow = self.slow * kept + fresh.component_mul(&self.slow_std());
        let white = |density: f64| density / DT.sqrt();
        [
            measured[0] + self.normal(white(c.gyroscope_noise_density)),
            measured[1] + self.normal(white(c.accelerometer_noise_density)),
        ]
    }

    /// The antenna's position, as late as the settings say.
    fn fix(&mut self) -> GnssPosition<f64> {
        let then = self.past[self.past.len() - 1 - (LATENCY / DT).round() as usize];
        let std = fix_std();
        let white = self.normal(config().position_uncorrelated_fraction);
        let antenna = then.position + then.ned_from_body * Vector3::from(ARM);
        GnssPosition {
            ned: antenna + self.slow + white.component_mul(&std),
            std,
            has_height: true,
        }
    }

    fn antenna_velocity(&self) -> Vector3<f64> {
        self.own.velocity + self.own.ned_from_body * self.rate.cross(&Vector3::from(ARM))
    }

    fn heading(&mut self) -> f64 {
        self.own_pose().z + self.normal(DEG).x
    }

    fn own_pose(&self) -> Vector3<f64> {
        let truth = ErrorStateFilter::new(ErrorStateConfig::default(), self.own).unwrap();
        truth.pose()
    }

    fn detection(&mut self) -> RadarDetection<f64> {
        let exact = PredictedDetection::new(&self.target, &self.own_pose()).unwrap();
        let noise = self.normal(1.0);
        RadarDetection {
            range: exact.detection.range + RADAR.range_std * noise.x,
            bearing: exact.detection.bearing + RADAR.bearing_std * noise.y,
        }
    }

    fn step_target(&mut self) {
        let a = self.normal(ACCELERATION_STD);
        for (axis, a) in [(0, a.x), (2, a.y)] {
            self.target[axis] += self.target[axis + 1] + 0.5 * a;
            self.target[axis + 1] += a;
        }
    }
}

fn fix_std() -> Vector3<f64> {
    Vector3::new(2.0, 2.0, 4.0)
}

fn tracker(
    own: &PoseWithErrors<f64>,
    coupling: Coupling,
    detection: &RadarDetection<f64>,
) -> Tracker {
    let (track, cross) =
        one_point(detection, &RADAR, TARGET_SPEED_STD, &own.navigation_pose()).unwrap();
    SchmidtKalman::new(tracker_config(), coupling, track, cross).unwrap()
}

/// Mean NEES of navigation (15 errors) and of each tracker (4) over `runs`, a row for each scan.
fn consistency(runs: u64, scans: usize) -> Vec<[f64; 4]> {
    let couplings = [Coupling::Exact, Coupling::FeedForward, Coupling::OpenLoop];
    let mut sums = vec![[0.0; 4]; scans];
    for seed in 0..runs {
        let mut world = World::new(seed);
        let mut ins =
            GnssIns::<f64, 32, [Option<Tracker>; 3]>::listened_to(config(), [None; 3]).unwrap();
        assert!(ins.start_at(world.time_ns, &world.start()));
        let detection = world.detection();
        let (own, trackers) = ins.pose_and_listener().unwrap();
        *trackers = couplings.map(|c| Some(tracker(&own, c, &detection)));
        for sum in &mut sums {
            for k in 1..=50 {
                let [rate, force] = world.sample();
                ins.imu(world.time_ns, &rate, &force).unwrap();
                if k % 25 == 0 {
                    ins.gnss_position(world.time_ns, &world.fix());
                    ins.heading(world.time_ns, world.heading(), DEG);
                }
            }
            world.step_target();
            let detection = world.detection();
            let (own, trackers) = ins.pose_and_listener().unwrap();
            for (tracker, nees) in trackers.iter_mut().flatten().zip(&mut sum[1..]) {
                tracker.predict(1.0).unwrap();
                let innovation = tracker.update(&detection, &own.navigation_pose());
                // The open loop loses the sign of its covariance.
                let fused = innovation.outcome == Outcome::Fused;
                assert!(fused || tracker.coupling() == Coupling::OpenLoop);
                let error = world.target - tracker.track().state;
                let inverse = tracker.track().covariance.try_inverse().unwrap();
                *nees += (error.transpose() * inverse * error)[0] / runs as f64;
            }
            let error = error(&world.own, ins.state().unwrap());
            let inverse = ins.state().unwrap().covariance.try_inverse().unwrap();
            sum[0] += (error.transpose() * inverse * error)[0] / runs as f64;
        }
    }
    sums
}

/// True minus estimate.
fn error(truth: &NavigationState<f64>, estimate: &NavigationState<f64>) -> SVector<f64, STATES> {
    let turn = (truth.ned_from_body * estimate.ned_from_body.inverse()).scaled_axis();
    let parts = [
        turn,
        truth.velocity - estimate.velocity,
        truth.position - estimate.position,
        truth.accelerometer_bias - estimate.accelerometer_bias,
        truth.gyroscope_bias - estimate.gyroscope_bias,
    ];
    SVector::from_fn(|i, _| parts[i / 3][i % 3])
}

/// Bounds of the mean of `runs` chi-square variables at so many standard normal deviations (Wilson and Hilferty).
fn bounds(degrees_of_freedom: f64, runs: f64, sigmas: f64) -> [f64; 2] {
    let n = degrees_of_freedom * runs;
    let spread = (2.0 / (9.0 * n)).sqrt();
    [-sigmas, sigmas].map(|z| degrees_of_freedom * (1.0 - spread * spread + z * spread).powi(3))
}

#[test]
fn navigation_and_its_trackers_are_consistent_in_a_closed_loop() {
    let (runs, scans) = (100, 40);
    let nees = consistency(runs, scans);
    let mean = |i: usize| nees.iter().map(|row| row[i]).sum::<f64>() / scans as f64;
    for (i, name, freedom) in [
        (0, "navigation", 15.0),
        (1, "exact", 4.0),
        (2, "feed-forward", 4.0),
    ] {
        // The scans of a run are correlated: the mean over them has the bounds of one scan at most.
        let [low, high] = bounds(freedom, runs as f64, 1.96);
        let inside = nees
            .iter()
            .filter(|row| (low..high).contains(&row[i]))
            .count();
        let share = inside as f64 / scans as f64;
        assert!(
            (low..high).contains(&mean(i)) && share > 0.85,
            "{name}: {} in {low} to {high}, {share} of the scans inside",
            mean(i)
        );
    }
    // Who does not follow the corrections is overconfident or has no covariance at all.
    let [low, high] = bounds(4.0, runs as f64, 5.0);
    assert!(!(low..high).contains(&mean(3)), "open loop: {}", mean(3));
}

/// What the navigation did to its errors, in full.
#[allow(clippy::large_enum_variant)] // a few events of one test
enum Event {
    /// `Phi`.
    Map(Box<M25>),
    /// `H`, `K`, `S`.
    Correction(SVector<f64, ERRORS>, SVector<f64, ERRORS>, f64),
    Recentred(Vector3<f64>),
    Restarted,
}

/// A tracker, and a record of what it was given.
struct Recorded {
    tracker: Option<Tracker>,
    events: Vec<Event>,
}

impl ErrorListener<f64, ERRORS> for Recorded {
    fn propagated(&mut self, transition: &impl ErrorPropagation<f64, ERRORS>) {
        let mut phi = Box::new(M25::identity());
        transition.map_rows(&mut phi);
        self.events.push(Event::Map(phi));
        self.tracker.propagated(transition);
    }

    fn corrected<const E: usize>(&mut self, correction: &ScalarCorrection<f64, ERRORS, E>) {
        let h = correction.measured(&M25::identity());
        let (gain, variance) = (correction.gain, correction.variance);
        self.events.push(Event::Correction(h, gain, variance));
        self.tracker.corrected(correction);
    }

    fn recentred(&mut self, angle: &Vector3<f64>) {
        self.events.push(Event::Recentred(*angle));
        self.tracker.recentred(angle);
    }

    fn restarted(&mut self) {
        self.events.push(Event::Restarted);
        self.tracker.restarted();
    }
}

type Ins = GnssIns<f64, 32, Recorded>;

/// The filter of target and navigation in full: 29 states, Joseph form, the target's gain zero when the navigation is
/// corrected and the navigation's when the target is.
struct Dense {
    p: Joint,
    /// Variances of the two biases' values at rest (E29).
    at_rest: [Vector3<f64>; 2],
}

impl Dense {
    /// (E8, E9, E14, E28-E30), with what the settings say of the noises. `slow` is the variance of the receiver's slow
    /// error.
    fn propagate(&mut self, ins: &Ins, phi: &M25, slow: &Vector3<f64>) {
        let (c, step) = (ins.config(), ins.last_step());
        let t = step.transition.duration_s();
        let mut f = Joint::identity();
        f.fixed_view_mut::<ERRORS, ERRORS>(4, 4).copy_from(phi);
        self.p = f * self.p * f.transpose();
        let settings = ErrorStateConfig {
            accelerometer_noise_density: c.accelerometer_noise_density,
            gyroscope_noise_density: c.gyroscope_noise_density,
            ..ErrorStateConfig::default()
        };
        let nothing = NavigationState {
            covariance: M15::zeros(),
            ..*ins.state().unwrap()
        };
        let certain = ErrorStateFilter::new(settings, nothing).unwrap();
        let noise = certain.predicted_covariance(&step.transition);
        let mut own = self.p.fixed_view_mut::<STATES, STATES>(4, 4);
        own += noise;
        let biases = [
            (
                c.accelerometer_gauss_markov_std,
                c.accelerometer_gauss_markov_time_s,
                c.accelerometer_bias_random_walk,
            ),
            (
                c.gyroscope_gauss_markov_std,
                c.gyroscope_gauss_markov_time_s,
                c.gyroscope_bias_random_walk,
            ),
        ];
        for (sensor, (std, time, walk)) in biases.into_iter().enumerate() {
            let kept = (-t / time).exp();
            assert_relative_eq!(step.bias_kept[sensor], kept, epsilon = 1e-12);
            for i in 0..3 {
                let state = 4 + ACCELEROMETER_BIAS + 3 * sensor + i;
                let v = self.at_rest[sensor][i];
                // Before it relaxed.
                let bias = self.p[(state, state)] / (kept * kept);
                let k = v / (v + bias + std * std) * (t / time);
                let v = v * (1.0 - k) + walk * walk * t;
                self.at_rest[sensor][i] = v;
                self.p[(state, state)] += (std * std + v) * (1.0 - kept * kept);
            }
        }
        let kept = (-t / c.position_correlation_time_s).exp();
        for i in 0..3 {
            let state = 4 + STATES + GNSS_OFFSET + i;
            self.p[(state, state)] += slow[i] * (1.0 - kept * kept);
        }
        let state = 4 + STATES + BAROMETER_OFFSET;
        if self.p[(state, state)] > 0.0 {
            self.p[(state, state)] += c.barometer_offset_random_walk.powi(2) * t;
        }
        for i in 0..3 {
            let state = 4 + STATES + MAGNETIC_OFFSET + i;
            self.p[(state, state)] += c.magnetic_offset_random_walk_ut.powi(2) * t;
        }
    }

    /// One scalar of variance `r`, which corrects the navigation alone. Gives gain and `S`.
    fn correct(&mut self, h: &SVector<f64, ALL>, r: f64) -> (SVector<f64, ALL>, f64) {
        let s = (h.transpose() * self.p * h)[0] + r;
        let mut k = self.p * h / s;
        k.fixed_rows_mut::<4>(0).fill(0.0);
        let left = Joint::identity() - k * h.transpose();
        self.p = left * self.p * left.transpose() + k * k.transpose() * r;
        (k, s)
    }

    /// Goes through what the navigation said it did, with the variances of what it measured.
    fn follow(&mut self, ins: &mut Ins, variances: &[f64], slow: &Vector3<f64>) {
        let events = std::mem::take(&mut ins.listener_mut().events);
        let mut variances = variances.iter();
        for event in &events {
            match event {
                Event::Map(phi) if phi.diagonal().iter().any(|kept| *kept == 0.0) => {
                    // An augmented state starts anew, with a variance of its own.
                    let mut f = Joint::identity();
                    f.fixed_view_mut::<ERRORS, ERRORS>(4, 4).copy_from(&**phi);
                    self.p = f * self.p * f.transpose();
                    for i in 0..ERRORS {
                        if phi[(i, i)] == 0.0 {
                            self.p[(4 + i, 4 + i)] = variance_at_start(i);
                        }
                    }
                }
                Event::Map(phi) => self.propagate(ins, phi, slow),
                Event::Correction(h, gain, variance) => {
                    let mut full = SVector::<f64, ALL>::zeros();
                    full.fixed_rows_mut::<ERRORS>(4).copy_from(h);
                    let units = self.p.diagonal().map(f64::sqrt);
                    let (k, s) = self.correct(&full, *variances.next().unwrap());
                    assert_relative_eq!(s, *variance, max_relative = 1e-9);
                    for i in 0..ERRORS {
                        let off = (gain[i] - k[4 + i]) * s.sqrt();
                        assert!(off.abs() <= 1e-9 * units[4 + i], "gain of {i}: {off}");
                    }
                }
                Event::Recentred(angle) => {
                    let turn = Matrix3::identity() + angle.cross_matrix() * 0.5;
                    let mut g = Joint::identity();
                    g.fixed_view_mut::<3, 3>(4, 4).copy_from(&turn);
                    self.p = g * self.p * g.transpose();
                }
                Event::Restarted => panic!("it has not started again"),
            }
        }
        assert_eq!(variances.len(), 0, "all that was measured has been fused");
    }

    /// A scan: the target moves on, and is seen.
    fn scan(&mut self, own: &PoseWithErrors<f64>, track: &TrackEstimate<f64>) {
        let mut f = Joint::identity();
        (f[(0, 1)], f[(2, 3)]) = (1.0, 1.0);
        self.p = f * self.p * f.transpose();
        for axis in [0, 2] {
            for (i, j, share) in [(0, 0, 0.25), (0, 1, 0.5), (1, 0, 0.5), (1, 1, 1.0)] {
                self.p[(axis + i, axis + j)] += share * ACCELERATION_STD.powi(2);
            }
        }
        let predicted = PredictedDetection::new(&track.state, &own.pose).unwrap();
        let mut h = SMatrix::<f64, 2, ALL>::zeros();
        h.fixed_view_mut::<2, 4>(0, 0)
            .copy_from(&predicted.by_target);
        h.fixed_view_mut::<2, ERRORS>(0, 4)
            .copy_from(&(predicted.by_pose * own.pose_from_error));
        let s = h * self.p * h.transpose() + RADAR.covariance();
        let mut k = self.p * h.transpose() * s.try_inverse().unwrap();
        k.fixed_view_mut::<ERRORS, 2>(4, 0).fill(0.0);
        let left = Joint::identity() - k * h;
        self.p = left * self.p * left.transpose() + k * RADAR.covariance() * k.transpose();
    }

    /// The target has moved on the arc about the own ship.
    fn turn(&mut self, map: &Matrix4<f64>) {
        let mut all = Joint::identity();
        all.fixed_view_mut::<4, 4>(0, 0).copy_from(map);
        self.p = all * self.p * all.transpose();
    }
}

/// Variance that an augmented state has when it starts on the way.
fn variance_at_start(state: usize) -> f64 {
    match state.checked_sub(STATES) {
        Some(BAROMETER_OFFSET) => 1e4,
        Some(i @ 0..=2) => (fix_std()[i] * config().position_correlated_fraction).powi(2),
        other => panic!("{other:?} does not start"),
    }
}

fn joint(tracker: &Tracker, own: &PoseWithErrors<f64>) -> Joint {
    let mut p = Joint::zeros();
    let cross = tracker.cross_covariance();
    p.fixed_view_mut::<4, 4>(0, 0)
        .copy_from(&tracker.save().track.tangent.covariance);
    p.fixed_view_mut::<ERRORS, 4>(4, 0).copy_from(cross);
    p.fixed_view_mut::<4, ERRORS>(0, 4)
        .copy_from(&cross.transpose());
    p.fixed_view_mut::<ERRORS, ERRORS>(4, 4)
        .copy_from(&own.covariance);
    p
}

/// With everything that a GNSS/INS estimates: slow errors, biases that relax, a barometer's offset, iron, the receiver's
/// time offset, a lever arm and late fixes.
#[test]
fn the_joint_covariance_equals_that_of_the_dense_filter() {
    let everything = GnssInsConfig {
        accelerometer_gauss_markov_std: 0.02,
        gyroscope_gauss_markov_std: 1e-3,
        time_offset_std_s: 0.02,
        magnetic_offset_std_ut: 10.0,
        ..config()
    };
    let nobody = Recorded {
        tracker: None,
        events: Vec::new(),
    };
    let mut world = World::new(1);
    let mut ins = Ins::listened_to(everything, nobody).unwrap();
    assert!(ins.start_at(world.time_ns, &world.start()));
    let (detection, field) = (world.detection(), Vector3::new(18.0, 1.0, 42.0));
    let (own, listener) = ins.pose_and_listener().unwrap();
    listener.events.clear();
    let tracker = listener
        .tracker
        .insert(tracker(&own, Coupling::Exact, &detection));
    let rest = [START[3], START[4]].map(|std| Vector3::repeat(std * std));
    let mut dense = Dense {
        p: joint(tracker, &own),
        at_rest: rest,
    };
    let mut slow = Vector3::zeros();
    for scan in 0..20 {
        for k in 1..=50 {
            let [rate, force] = world.sample();
            ins.imu(world.time_ns, &rate, &force).unwrap();
            dense.follow(&mut ins, &[], &slow);
            if k % 25 == 0 {
                let fix = world.fix();
                let update = ins.gnss_position(world.time_ns, &fix);
                let outcomes = [update.horizontal.outcome, update.vertical.outcome];
                assert_eq!(outcomes, [Outcome::Fused; 2]);
                // What comes before the fix is of the slow error before it.
                let white = fix
                    .std
                    .map(|std| (std * everything.position_uncorrelated_fraction).powi(2));
                dense.follow(&mut ins, white.as_slice(), &slow);
                slow = fix
                    .std
                    .map(|std| (std * everything.position_correlated_fraction).powi(2));
            }
            if k % 10 == 5 {
                let fix = GnssVelocity {
                    ned: world.antenna_velocity() + world.normal(0.1),
                    std: Vector3::repeat(0.1),
                    has_vertical: true,
                };
                let outcome = ins.gnss_velocity(world.time_ns, &fix).outcome;
                // One in a thousand is gated, and changes nothing.
                assert!(matches!(outcome, Outcome::Fused | Outcome::Gated));
                let fused = if outcome == Outcome::Fused { 3 } else { 0 };
                dense.follow(&mut ins, &[0.01; 3][..fused], &slow);
            }
            if k % 10 == 7 {
                let height = 20.0 - world.own.position.z + world.normal(0.5).x;
                let outcome = ins.barometer(world.time_ns, height).outcome;
                assert_eq!(outcome, Outcome::Fused);
                dense.follow(&mut ins, &[everything.barometer_std_m.powi(2)], &slow);
            }
            if k == 33 && scan % 5 == 0 {
                let iron = Vector3::new(3.0, -2.0, 1.0);
                let measured = world.own.ned_from_body.inverse() * field + iron;
                let outcome = ins.magnetometer(world.time_ns, &measured).outcome;
                assert_eq!(outcome, Outcome::Fused);
                dense.follow(&mut ins, &[everything.magnetic_heading_std.powi(2)], &slow);
            }
        }
        world.step_target();
        let detection = world.detection();
        let (own, listener) = ins.pose_and_listener().unwrap();
        let tracker = listener.tracker.as_mut().unwrap();
        tracker.predict(1.0).unwrap();
        let track = tracker.track();
        assert!(
            tracker
                .update(&detection, &own.navigation_pose())
                .outcome
                .is_fused()
        );
        let map = polar::map_of_errors(&track.state, &tracker.track().state, &own.pose);
        let sparse = joint(tracker, &own);
        // The covariance has caught up for the scan.
        dense.follow(&mut ins, &[], &slow);
        dense.scan(&own, &track);
        dense.turn(&map);
        let units = dense
            .p
            .diagonal()
            .map(|v| if v > 0.0 { 1.0 / v.sqrt() } else { 0.0 });
        let scale = Joint::from_diagonal(&units);
        let off = (scale * (sparse - dense.p) * scale).abs().max();
        assert!(off < 1e-9, "scan {scan}: {off:e}");
    }
    // Not by being nothing: the target shares its error with the augmented states, too.
    let cross = ins.listener().tracker.unwrap();
    let iron = cross
        .cross_covariance()
        .fixed_rows::<3>(STATES + MAGNETIC_OFFSET)
        .abs()
        .max();
    let slow = cross
        .cross_covariance()
        .fixed_rows::<3>(STATES + GNSS_OFFSET)
        .abs()
        .max();
    assert!(iron > 0.1 && slow > 0.1, "{iron} {slow}");
}

/// A restored state has errors of its own: who listens is no longer correlated with them, unless restored too.
#[test]
fn a_restored_navigation_keeps_only_a_listener_that_is_restored_too() {
    let mut world = World::new(7);
    let mut ins = GnssIns::<f64, 32, Option<Tracker>>::listened_to(config(), None).unwrap();
    assert!(ins.start_at(world.time_ns, &world.start()));
    let detection = world.detection();
    let (own, listener) = ins.pose_and_listener().unwrap();
    *listener = Some(tracker(&own, Coupling::Exact, &detection));
    let (saved, tracker) = (ins.save(), ins.listener().unwrap().save());
    assert!(tracker.cross.norm() > 0.1);

    let mut broken = saved;
    broken.navigation.velocity.x = f64::NAN;
    assert!(ins.restore(broken).is_err());
    assert_eq!(ins.listener().unwrap().save(), tracker);

    ins.restore(saved).unwrap();
    let left = ins.listener().unwrap().save();
    assert_eq!((left.track, left.cross.norm()), (tracker.track, 0.0));
    ins.listener_mut()
        .as_mut()
        .unwrap()
        .restore(tracker)
        .unwrap();
    assert_eq!(ins.save(), saved);
    assert_eq!(ins.listener().unwrap().save(), tracker);
}
