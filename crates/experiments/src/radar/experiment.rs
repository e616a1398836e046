//! One run: a navigation filter, and every tracker on the same measurements.

use nalgebra::{Matrix3, SMatrix, Vector3, Vector4};
use northing_core::kalman::{ErrorPropagation as _, Outcome};
use northing_core::navigation::error_state::GnssCompassUpdate;
use northing_core::navigation::{
    ErrorStateConfig, ErrorStateFilter, ErrorTransition, GnssCompassFix, NavigationState, STATES,
};
use northing_core::tracking::own_ship::PoseMemory;
use northing_core::tracking::radar::wrap;
use northing_core::tracking::{
    ConstantVelocity, RadarDetection, RadarNoise, TrackEstimate, TrackerConfig,
};
use northing_simulation::scenario::TrackingRun;
use northing_simulation::scenario::schema::{StartCross, TrackStart};
use northing_simulation::scenario::world::{OwnTruth, TrackingWorld};

use super::trackers::{AnyTracker, Scan, Start, TrackerKind};

/// What one tracker thought at a scan, and what was true.
#[derive(Debug, Clone, Copy)]
pub struct TrackRecord<'a> {
    /// The tracker.
    pub kind: TrackerKind,
    /// Its estimate; `None` when it never started.
    pub estimate: Option<&'a TrackEstimate<f64>>,
    /// Whether it skipped this scan's detection.
    pub skipped: bool,
}

/// How the navigation stood at a scan.
#[derive(Debug, Clone, Copy)]
pub struct NavigationRecord {
    /// Pose: north, east (m), heading (rad).
    pub pose: Vector3<f64>,
    /// True pose.
    pub true_pose: Vector3<f64>,
    /// Covariance of the pose.
    pub covariance: Matrix3<f64>,
    /// What the closed loop left of the heading error since the scan before.
    pub heading_factor: f64,
}

/// Watches a run.
pub trait RunWatcher {
    /// The navigation at a scan, and the target's true state.
    fn scan(&mut self, step: usize, navigation: &NavigationRecord, target: &Vector4<f64>);
    /// A tracker at that scan; `index` is its place in the list of trackers.
    fn tracker(
        &mut self,
        step: usize,
        index: usize,
        record: &TrackRecord<'_>,
        target: &Vector4<f64>,
    );
}

/// A navigation filter and its error's closed loop since the last scan.
struct Navigation {
    filter: ErrorStateFilter<f64>,
    rows: SMatrix<f64, 3, STATES>,
    since_scan: ErrorTransition<f64>,
    heading: SMatrix<f64, STATES, 1>,
}

impl Navigation {
    fn new(world: &TrackingWorld, run: &TrackingRun<'_>) -> Option<Self> {
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
        let config = ErrorStateConfig {
            accelerometer_noise_density: noises.filter_accelerometer_density,
            gyroscope_noise_density: noises.filter_gyroscope_density,
            gravity: world.scenario().meta.gravity_m_s2,
            reset_jacobian: world.scenario().navigation.reset_jacobian,
            ..ErrorStateConfig::default()
        };
        let state = NavigationState {
            ned_from_body: start.ned_from_body,
            velocity: start.velocity,
            position: start.position,
            accelerometer_bias: Vector3::zeros(),
            gyroscope_bias: Vector3::zeros(),
            covariance,
            pending: ErrorTransition::default(),
            skipped: 0,
        };
        let filter = ErrorStateFilter::new(config, state).ok()?;
        Some(Self {
            rows: filter.pose_from_error(),
            filter,
            since_scan: ErrorTransition::default(),
            heading: unit_heading(),
        })
    }

    /// A fix, or the time for one. Gives the transition, and the update if there was one.
    fn fix(
        &mut self,
        fix: Option<&GnssCompassFix<f64>>,
    ) -> (ErrorTransition<f64>, Option<GnssCompassUpdate<f64>>) {
        let update = fix.map(|fix| self.filter.update_gnss_compass(fix));
        let transition = update
            .as_ref()
            .map_or_else(|| self.filter.catch_up(), |update| update.transition);
        self.since_scan = self.since_scan.then(&transition);
        transition.map_rows(&mut self.heading);
        if let Some(update) = &update {
            update.feedback.map_rows(&mut self.heading);
        }
        (transition, update)
    }

    fn scanned(&mut self) {
        self.since_scan = ErrorTransition::default();
        self.heading = unit_heading();
    }
}

fn unit_heading() -> SMatrix<f64, STATES, 1> {
    SMatrix::from_fn(|i, _| if i == 2 { 1.0 } else { 0.0 })
}

fn pose_of(truth: &OwnTruth) -> Vector3<f64> {
    Vector3::new(truth.position.x, truth.position.y, wrap(truth.heading_rad))
}

/// The trackers' settings in a scenario.
#[must_use]
pub fn tracker_config(world: &TrackingWorld) -> (TrackerConfig<f64>, PoseMemory<f64>) {
    let radar = world.noises().radar_std;
    let config = TrackerConfig::new(
        ConstantVelocity {
            acceleration_std: world.scenario().target.sigma_accel_m_s2,
        },
        RadarNoise {
            range_std: radar.x,
            bearing_std: radar.y,
        },
    );
    let blackbox = &world.scenario().blackbox;
    let lifetimes = PoseMemory {
        position_s: blackbox.tau_position_s,
        heading_s: blackbox.tau_heading_s,
    };
    (config, lifetimes)
}

/// One tracker of a run. The joint estimator has a navigation of its own.
struct Contestant {
    kind: TrackerKind,
    tracker: Option<AnyTracker>,
    skipped: bool,
}

/// Carries out one run of a campaign.
pub fn run(
    world: &TrackingWorld,
    kinds: &[TrackerKind],
    seed: u64,
    number: u64,
    watcher: &mut impl RunWatcher,
) {
    let mut run = world.run(seed, number);
    let Some(mut shared) = Navigation::new(world, &run) else {
        return;
    };
    let mut own = kinds
        .contains(&TrackerKind::Joint)
        .then(|| Navigation::new(world, &run))
        .flatten();
    let mut contestants = start(world, kinds, &mut run, &shared);
    report(0, world, &shared, &run, &contestants, watcher);
    let authors = kinds.contains(&TrackerKind::SchmidtAuthors);
    for step in 1..=world.scans() {
        for _ in 0..world.fixes_per_scan() {
            one_fix(world, &mut run, &mut shared, own.as_mut(), &mut contestants);
        }
        run.next_scan();
        let detection = run
            .detection()
            .map(|[range, bearing]| RadarDetection { range, bearing });
        shared.rows = shared.filter.pose_from_error();
        let ahead = authors.then(|| shared.filter.predicted_covariance(&shared.since_scan));
        let true_pose = pose_of(&world.own_at_scan(step));
        let scan = Scan::new(&shared.filter, &shared.rows, true_pose, ahead.as_ref());
        for contestant in &mut contestants {
            match (contestant.kind, own.as_mut()) {
                (TrackerKind::Joint, Some(own)) => {
                    contestant.scan_jointly(world.scan_s(), detection.as_ref(), own, true_pose);
                }
                _ => contestant.scan(world.scan_s(), detection.as_ref(), &scan),
            }
        }
        report(step, world, &shared, &run, &contestants, watcher);
        shared.scanned();
    }
}

/// Starts all trackers at the first detection.
fn start(
    world: &TrackingWorld,
    kinds: &[TrackerKind],
    run: &mut TrackingRun<'_>,
    navigation: &Navigation,
) -> Vec<Contestant> {
    let (config, lifetimes) = tracker_config(world);
    let table = &world.scenario().track_init;
    let seen = run.detection();
    let start = match table.mode {
        TrackStart::OnePoint => seen.map(|[range, bearing]| {
            let correlated = table.cross_covariance == StartCross::FromConversion;
            let detection = RadarDetection { range, bearing };
            Start::Detection(detection, table.velocity_std_m_s, correlated)
        }),
        TrackStart::Prior => {
            let (p, v) = (table.position_std_m, table.velocity_std_m_s);
            let std = Vector4::new(p, v, p, v);
            Some(Start::Prior(TrackEstimate {
                state: run.target() - run.prior_draw().component_mul(&std),
                covariance: nalgebra::Matrix4::from_diagonal(&std.component_mul(&std)),
            }))
        }
    };
    let true_pose = pose_of(&world.own_at_scan(0));
    let scan = Scan::new(&navigation.filter, &navigation.rows, true_pose, None);
    let begin = |kind: &TrackerKind| Contestant {
        kind: *kind,
        tracker: start
            .as_ref()
            .and_then(|start| AnyTracker::start(*kind, config, lifetimes, start, &scan).ok()),
        skipped: false,
    };
    kinds.iter().map(begin).collect()
}

/// The inertial samples up to a fix, the fix, and what it means for the trackers.
fn one_fix(
    world: &TrackingWorld,
    run: &mut TrackingRun<'_>,
    shared: &mut Navigation,
    mut own: Option<&mut Navigation>,
    contestants: &mut [Contestant],
) {
    let dt = world.sample_s();
    while let Some([rate, force]) = run.next_sample() {
        // A sample that is refused is counted by the filter.
        let _ = shared.filter.propagate(&rate, &force, dt);
        if let Some(own) = own.as_deref_mut() {
            let _ = own.filter.propagate(&rate, &force, dt);
        }
    }
    let noises = world.noises();
    let fix = run.fix().map(|fix| GnssCompassFix {
        position: fix.position,
        position_std: noises.position_std,
        ned_from_body: fix.ned_from_body,
        attitude_std: noises.attitude_std,
    });
    let (transition, update) = shared.fix(fix.as_ref());
    let of_own = own.map(|own| own.fix(fix.as_ref()));
    for contestant in contestants {
        let Some(tracker) = &mut contestant.tracker else {
            continue;
        };
        match (contestant.kind, &of_own) {
            (TrackerKind::Joint, Some((transition, update))) => {
                tracker.navigation_moved(transition, update.as_ref());
            }
            _ => tracker.navigation_moved(&transition, update.as_ref()),
        }
    }
}

impl Contestant {
    fn scan(&mut self, dt_s: f64, detection: Option<&RadarDetection<f64>>, scan: &Scan<'_>) {
        self.skipped = false;
        let Some(tracker) = &mut self.tracker else {
            return;
        };
        if tracker.predict(dt_s).is_err() {
            self.skipped = true;
            return;
        }
        if let Some(detection) = detection {
            let innovation = tracker.update(self.kind, detection, scan);
            self.skipped = matches!(innovation.outcome, Outcome::Skipped(_));
        }
    }

    /// The joint estimator corrects its navigation, too.
    fn scan_jointly(
        &mut self,
        dt_s: f64,
        detection: Option<&RadarDetection<f64>>,
        own: &mut Navigation,
        true_pose: Vector3<f64>,
    ) {
        self.skipped = false;
        let Some(AnyTracker::Joint(tracker)) = &mut self.tracker else {
            return;
        };
        if tracker.predict(dt_s).is_err() {
            self.skipped = true;
            return;
        }
        let Some(detection) = detection else {
            return;
        };
        own.rows = own.filter.pose_from_error();
        let scan = Scan::new(&own.filter, &own.rows, true_pose, None);
        let (innovation, outside) = tracker.update(detection, &scan.own_ship());
        self.skipped = matches!(innovation.outcome, Outcome::Skipped(_));
        if let Some(outside) = outside {
            let angle = own.filter.correct_from_outside(&outside);
            tracker.navigation_recentred(&angle);
        }
    }
}

fn report(
    step: usize,
    world: &TrackingWorld,
    navigation: &Navigation,
    run: &TrackingRun<'_>,
    contestants: &[Contestant],
    watcher: &mut impl RunWatcher,
) {
    let rows = &navigation.rows;
    let record = NavigationRecord {
        pose: navigation.filter.pose(),
        true_pose: pose_of(&world.own_at_scan(step)),
        covariance: rows * navigation.filter.state().covariance * rows.transpose(),
        heading_factor: navigation.heading[2],
    };
    let target = run.target();
    watcher.scan(step, &record, &target);
    for (index, contestant) in contestants.iter().enumerate() {
        let record = TrackRecord {
            kind: contestant.kind,
            estimate: contestant.tracker.as_ref().map(AnyTracker::track),
            skipped: contestant.skipped,
        };
        watcher.tracker(step, index, &record, &target);
    }
}
