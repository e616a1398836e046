//! The navigation filters of the experiment. Whatever a filter does to its own errors reaches the trackers beside it.

use nalgebra::{Matrix3, SMatrix, Vector3};
use northing_core::kalman::{ErrorListener, ErrorPropagation, OutsideCorrection, ScalarCorrection};
use northing_core::navigation::aiding::gnss_position::GnssPosition;
use northing_core::navigation::gnss_ins::ImuSamples;
use northing_core::navigation::{
    ERRORS, ErrorStateConfig, ErrorStateFilter, ErrorTransition, GnssCompassFix, GnssIns,
    GnssInsConfig, NavigationState, STATES,
};
use northing_core::parameters::{ConfigError, Range};
use northing_core::tracking::NavigationPose;
use northing_simulation::scenario::TrackingRun;
use northing_simulation::scenario::world::TrackingWorld;

use super::trackers::Contestant;

/// A navigation filter of `N` errors, with the trackers that follow them.
pub(super) trait Navigator<const N: usize>: Sized {
    /// One that starts as the scenario says, without trackers; an error when its settings are refused.
    fn new(world: &TrackingWorld, run: &TrackingRun<'_>) -> Result<Self, ConfigError>;
    /// An inertial sample: rad/s, m/s^2, s. One that is refused is counted by the filter.
    fn sample(&mut self, rate: &Vector3<f64>, force: &Vector3<f64>, dt: f64);
    /// A fix, or the time for one.
    fn fix(&mut self, fix: Option<&GnssCompassFix<f64>>);
    /// The navigation of this instant and the trackers.
    fn scan(&mut self) -> (Scan<N>, &mut Followers<N>);
    /// The covariance that the transition since the last scan would make of the present one, where that can be had.
    fn ahead(&self) -> Option<SMatrix<f64, N, N>>;
    /// A scan is over.
    fn scanned(&mut self);
    /// What a joint estimator has learnt of the errors; gives the angle at which they were re-centred.
    fn correct_from_outside(&mut self, outside: &OutsideCorrection<f64, N>) -> Vector3<f64>;
}

/// What trackers are told at a scan.
#[derive(Debug)]
pub(super) struct Scan<const N: usize> {
    /// The own pose as the navigation has it.
    pub(super) pose: Vector3<f64>,
    /// The true own pose.
    pub(super) true_pose: Vector3<f64>,
    pub(super) covariance: SMatrix<f64, N, N>,
    pub(super) pose_from_error: SMatrix<f64, 3, N>,
    /// Covariance of the pose.
    pub(super) pose_covariance: Matrix3<f64>,
    /// The covariance one scan later without corrections, for `schmidt-authors`.
    pub(super) ahead: Option<SMatrix<f64, N, N>>,
}

impl<const N: usize> Scan<N> {
    fn new(
        pose: Vector3<f64>,
        covariance: SMatrix<f64, N, N>,
        pose_from_error: SMatrix<f64, 3, N>,
    ) -> Self {
        Self {
            pose,
            true_pose: pose,
            pose_covariance: pose_from_error * covariance * pose_from_error.transpose(),
            covariance,
            pose_from_error,
            ahead: None,
        }
    }

    pub(super) fn own_ship(&self) -> NavigationPose<'_, f64, N> {
        NavigationPose {
            pose: self.pose,
            covariance: &self.covariance,
            pose_from_error: self.pose_from_error,
        }
    }
}

/// The trackers beside a navigation filter, and what its closed loop left of the heading error since the last scan.
pub(super) struct Followers<const N: usize> {
    pub(super) contestants: Vec<Contestant<N>>,
    heading: SMatrix<f64, N, 1>,
}

impl<const N: usize> Followers<N> {
    fn none() -> Self {
        Self {
            contestants: Vec::new(),
            heading: unit_heading(),
        }
    }

    /// What is left of the heading error.
    pub(super) fn heading_factor(&self) -> f64 {
        self.heading[2]
    }
}

fn unit_heading<const N: usize>() -> SMatrix<f64, N, 1> {
    SMatrix::from_fn(|i, _| if i == 2 { 1.0 } else { 0.0 })
}

impl<const N: usize> ErrorListener<f64, N> for Followers<N> {
    fn propagated(&mut self, transition: &impl ErrorPropagation<f64, N>) {
        transition.map_rows(&mut self.heading);
        for contestant in &mut self.contestants {
            contestant.tracker.propagated(transition);
        }
    }

    fn corrected<const E: usize>(&mut self, correction: &ScalarCorrection<f64, N, E>) {
        correction.map_rows(&mut self.heading);
        for contestant in &mut self.contestants {
            contestant.tracker.corrected(correction);
        }
    }

    fn recentred(&mut self, angle: &Vector3<f64>) {
        northing_core::kalman::feedback::reset_rows(&mut self.heading, angle);
        for contestant in &mut self.contestants {
            contestant.tracker.recentred(angle);
        }
    }

    fn restarted(&mut self) {
        self.heading.fill(0.0);
        for contestant in &mut self.contestants {
            contestant.tracker.restarted();
        }
    }
}

/// The start of a run, with the covariance of its draw.
fn start(world: &TrackingWorld, run: &TrackingRun<'_>) -> NavigationState<f64> {
    let noises = world.noises();
    let start = run.navigation_start();
    let square = |std: f64| std * std;
    let mut covariance = SMatrix::<f64, STATES, STATES>::zeros();
    for i in 0..3 {
        let variances = [
            square(noises.attitude_std[i]),
            square(noises.velocity_std),
            square(noises.position_std[i]),
            square(noises.accelerometer_bias_std),
            square(noises.gyroscope_bias_std),
        ];
        for (block, variance) in variances.into_iter().enumerate() {
            covariance[(3 * block + i, 3 * block + i)] = variance;
        }
    }
    NavigationState {
        ned_from_body: start.ned_from_body,
        velocity: start.velocity,
        position: start.position,
        accelerometer_bias: Vector3::zeros(),
        gyroscope_bias: Vector3::zeros(),
        covariance,
        pending: ErrorTransition::default(),
        skipped: 0,
    }
}

/// The paper's: the error-state filter with a GNSS compass.
pub(super) struct PaperNavigator {
    filter: ErrorStateFilter<f64>,
    followers: Followers<STATES>,
    since_scan: ErrorTransition<f64>,
}

impl Navigator<STATES> for PaperNavigator {
    fn new(world: &TrackingWorld, run: &TrackingRun<'_>) -> Result<Self, ConfigError> {
        let noises = world.noises();
        let config = ErrorStateConfig {
            accelerometer_noise_density: noises.filter_accelerometer_density,
            gyroscope_noise_density: noises.filter_gyroscope_density,
            gravity: world.scenario().meta.gravity_m_s2,
            reset_jacobian: world.scenario().navigation.reset_jacobian,
            ..ErrorStateConfig::default()
        };
        Ok(Self {
            filter: ErrorStateFilter::new(config, start(world, run))?,
            followers: Followers::none(),
            since_scan: ErrorTransition::default(),
        })
    }

    fn sample(&mut self, rate: &Vector3<f64>, force: &Vector3<f64>, dt: f64) {
        let _ = self.filter.propagate(rate, force, dt);
    }

    fn fix(&mut self, fix: Option<&GnssCompassFix<f64>>) {
        let transition = match fix {
            Some(fix) => {
                let update = self.filter.update_gnss_compass(fix);
                update.tell(&mut self.followers);
                update.transition
            }
            None => {
                let transition = self.filter.catch_up();
                self.followers.propagated(&transition);
                transition
            }
        };
        self.since_scan = self.since_scan.then(&transition);
    }

    fn scan(&mut self) -> (Scan<STATES>, &mut Followers<STATES>) {
        let filter = &self.filter;
        let covariance = filter.state().covariance;
        let scan = Scan::new(filter.pose(), covariance, filter.pose_from_error());
        (scan, &mut self.followers)
    }

    fn ahead(&self) -> Option<SMatrix<f64, STATES, STATES>> {
        Some(self.filter.predicted_covariance(&self.since_scan))
    }

    fn scanned(&mut self) {
        self.since_scan = ErrorTransition::default();
        self.followers.heading = unit_heading();
    }

    fn correct_from_outside(&mut self, outside: &OutsideCorrection<f64, STATES>) -> Vector3<f64> {
        self.filter.correct_from_outside(outside)
    }
}

/// The product's: the GNSS/INS, from the position and the heading of the same fixes.
pub(super) struct GnssInsNavigator {
    ins: GnssIns<f64, 32, Followers<ERRORS>>,
    time_s: f64,
}

impl GnssInsNavigator {
    fn time_ns(&self) -> i64 {
        (self.time_s * 1e9).round() as i64
    }
}

impl Navigator<ERRORS> for GnssInsNavigator {
    fn new(world: &TrackingWorld, run: &TrackingRun<'_>) -> Result<Self, ConfigError> {
        let noises = world.noises();
        let config = GnssInsConfig {
            imu_samples: ImuSamples::Means,
            accelerometer_noise_density: noises.filter_accelerometer_density,
            gyroscope_noise_density: noises.filter_gyroscope_density,
            gravity: world.scenario().meta.gravity_m_s2,
            // The world is flat, its biases are constant, its fixes white and on time.
            earth_curvature: false,
            accelerometer_bias_random_walk: 0.0,
            gyroscope_bias_random_walk: 0.0,
            accelerometer_gauss_markov_std: 0.0,
            gyroscope_gauss_markov_std: 0.0,
            position_uncorrelated_fraction: 1.0,
            position_correlated_fraction: 0.0,
            position_std_floor_m: 1e-3,
            time_jitter_s: 0.0,
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
        };
        let mut ins = GnssIns::listened_to(config, Followers::none())?;
        let has_started = ins.start_at(0, &start(world, run));
        has_started
            .then_some(Self { ins, time_s: 0.0 })
            .ok_or(ConfigError {
                field: "start",
                range: Range::Described("a rotation and finite numbers, with a covariance"),
            })
    }

    fn sample(&mut self, rate: &Vector3<f64>, force: &Vector3<f64>, dt: f64) {
        self.time_s += dt;
        let _ = self.ins.imu(self.time_ns(), rate, force);
    }

    fn fix(&mut self, fix: Option<&GnssCompassFix<f64>>) {
        let Some(fix) = fix else {
            return;
        };
        let time_ns = self.time_ns();
        let position = GnssPosition {
            ned: fix.position,
            std: fix.position_std,
            has_height: true,
        };
        self.ins.gnss_position(time_ns, &position);
        let forward = fix.ned_from_body * Vector3::x();
        let heading = forward.y.atan2(forward.x);
        self.ins.heading(time_ns, heading, fix.attitude_std.z);
    }

    fn scan(&mut self) -> (Scan<ERRORS>, &mut Followers<ERRORS>) {
        let scan = self.ins.pose_and_listener().map_or_else(
            // It has lost itself and aligns again: nobody can use a pose that is not a number.
            || {
                let nothing = SMatrix::repeat(f64::NAN);
                Scan::new(Vector3::repeat(f64::NAN), nothing, SMatrix::zeros())
            },
            |(own, _)| Scan::new(own.pose, own.covariance, own.pose_from_error),
        );
        (scan, self.ins.listener_mut())
    }

    fn ahead(&self) -> Option<SMatrix<f64, ERRORS, ERRORS>> {
        None
    }

    fn scanned(&mut self) {
        self.ins.listener_mut().heading = unit_heading();
    }

    fn correct_from_outside(&mut self, _: &OutsideCorrection<f64, ERRORS>) -> Vector3<f64> {
        // Refused with the campaign: it takes no corrections from outside.
        Vector3::zeros()
    }
}
