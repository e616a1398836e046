//! One run: a navigation filter, and every tracker on the same measurements.

use nalgebra::{Matrix3, Vector3, Vector4};
use northing_core::ConfigError;
use northing_core::geometry::trigonometry::wrap;
use northing_core::kalman::{ErrorListener as _, Outcome};
use northing_core::navigation::{ERRORS, GnssCompassFix, STATES};
use northing_core::tracking::own_ship::PoseErrorCorrelation;
use northing_core::tracking::{
    ConstantVelocity, RadarDetection, RadarNoise, TrackEstimate, TrackerConfig,
};
use northing_simulation::scenario::TrackingRun;
use northing_simulation::scenario::schema::{NavigationFilter, StartCross, TrackStart};
use northing_simulation::scenario::world::{OwnTruth, TrackingWorld};

use super::navigators::{GnssInsNavigator, Navigator, PaperNavigator, Scan};
use super::trackers::{AnyTracker, Contestant, Start, TrackerKind};

/// What one tracker thought at a scan, and what was true.
#[derive(Debug, Clone, Copy)]
pub struct TrackRecord {
    /// The tracker.
    pub kind: TrackerKind,
    /// Its estimate; `None` when it never started.
    pub estimate: Option<TrackEstimate<f64>>,
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
    /// What the radar saw; `None` when it missed the target.
    pub detection: Option<RadarDetection<f64>>,
}

/// Watches a run.
pub trait RunWatcher {
    /// The navigation at a scan, and the target's true state.
    fn scan(&mut self, step: usize, navigation: &NavigationRecord, target: &Vector4<f64>);
    /// A tracker at that scan; `index` is its place in the list of trackers.
    fn tracker(&mut self, step: usize, index: usize, record: &TrackRecord, target: &Vector4<f64>);
}

fn pose_of(truth: &OwnTruth) -> Vector3<f64> {
    Vector3::new(truth.position.x, truth.position.y, wrap(truth.heading_rad))
}

/// The trackers' settings in a scenario.
#[must_use]
pub fn tracker_config(world: &TrackingWorld) -> (TrackerConfig<f64>, PoseErrorCorrelation<f64>) {
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
    let lifetimes = PoseErrorCorrelation {
        position_s: blackbox.tau_position_s,
        heading_s: blackbox.tau_heading_s,
    };
    (config, lifetimes)
}

/// Carries out one run of a campaign.
pub fn run(
    world: &TrackingWorld,
    kinds: &[TrackerKind],
    seed: u64,
    number: u64,
    watcher: &mut impl RunWatcher,
) {
    let run = world.run(seed, number);
    match world.scenario().navigation.filter {
        NavigationFilter::ErrorState => {
            run_with::<STATES, PaperNavigator>(world, kinds, run, watcher);
        }
        NavigationFilter::GnssIns => {
            run_with::<ERRORS, GnssInsNavigator>(world, kinds, run, watcher);
        }
    }
}

/// Whether the navigation filter starts with what the scenario says.
///
/// # Errors
/// The parameter that it refuses.
pub(super) fn check_navigation(world: &TrackingWorld, seed: u64) -> Result<(), ConfigError> {
    let run = world.run(seed, 0);
    match world.scenario().navigation.filter {
        NavigationFilter::ErrorState => PaperNavigator::new(world, &run).map(|_| ()),
        NavigationFilter::GnssIns => GnssInsNavigator::new(world, &run).map(|_| ()),
    }
}

fn run_with<const N: usize, V: Navigator<N>>(
    world: &TrackingWorld,
    kinds: &[TrackerKind],
    mut run: TrackingRun<'_>,
    watcher: &mut impl RunWatcher,
) {
    // What is refused is refused before the first run.
    let Ok(mut shared) = V::new(world, &run) else {
        return;
    };
    let mut own = kinds
        .contains(&TrackerKind::Joint)
        .then(|| V::new(world, &run).ok())
        .flatten();
    let first = start(world, kinds, &mut run, &mut shared, own.as_mut());
    report((0, first), world, &mut shared, own.as_mut(), &run, watcher);
    let authors = kinds.contains(&TrackerKind::SchmidtAuthors);
    for step in 1..=world.scans() {
        for _ in 0..world.fixes_per_scan() {
            one_fix(world, &mut run, &mut shared, own.as_mut());
        }
        run.next_scan();
        let detection = run
            .detection()
            .map(|[range, bearing]| RadarDetection { range, bearing });
        let true_pose = pose_of(&world.own_at_scan(step));
        let ahead = authors.then(|| shared.ahead()).flatten();
        let (mut scan, followers) = shared.scan();
        (scan.true_pose, scan.ahead) = (true_pose, ahead);
        for contestant in &mut followers.contestants {
            contestant.scan(world.scan_s(), detection.as_ref(), &scan);
        }
        if let Some(own) = &mut own {
            scan_jointly(world.scan_s(), detection.as_ref(), own);
        }
        let scanned = (step, detection);
        report(scanned, world, &mut shared, own.as_mut(), &run, watcher);
        shared.scanned();
    }
}

/// Starts all trackers at the first detection, each beside its navigation; that detection comes back.
fn start<const N: usize, V: Navigator<N>>(
    world: &TrackingWorld,
    kinds: &[TrackerKind],
    run: &mut TrackingRun<'_>,
    shared: &mut V,
    mut own: Option<&mut V>,
) -> Option<RadarDetection<f64>> {
    let (config, lifetimes) = tracker_config(world);
    let table = &world.scenario().track_init;
    let seen = run.detection();
    let seen = seen.map(|[range, bearing]| RadarDetection { range, bearing });
    let start = match table.mode {
        TrackStart::OnePoint => seen.map(|detection| {
            let correlated = table.cross_covariance == StartCross::FromConversion;
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
    let (mut scan, followers) = shared.scan();
    scan.true_pose = pose_of(&world.own_at_scan(0));
    for (index, kind) in kinds.iter().copied().enumerate() {
        let tracker = start
            .as_ref()
            .and_then(|start| AnyTracker::start(kind, config, lifetimes, start, &scan).ok());
        let contestant = Contestant {
            kind,
            index,
            tracker,
            skipped: false,
        };
        let beside = match (kind, own.as_deref_mut()) {
            (TrackerKind::Joint, Some(own)) => own.scan().1,
            _ => &mut *followers,
        };
        beside.contestants.push(contestant);
    }
    seen
}

/// The inertial samples up to a fix, and the fix.
fn one_fix<const N: usize, V: Navigator<N>>(
    world: &TrackingWorld,
    run: &mut TrackingRun<'_>,
    shared: &mut V,
    own: Option<&mut V>,
) {
    let dt = world.sample_s();
    let mut navigators = [Some(shared), own];
    while let Some([rate, force]) = run.next_sample() {
        for navigator in navigators.iter_mut().flatten() {
            navigator.sample(&rate, &force, dt);
        }
    }
    let noises = world.noises();
    let fix = run.fix().map(|fix| GnssCompassFix {
        position: fix.position,
        position_std: noises.position_std,
        ned_from_body: fix.ned_from_body,
        attitude_std: noises.attitude_std,
    });
    for navigator in navigators.into_iter().flatten() {
        navigator.fix(fix.as_ref());
    }
}

impl<const N: usize> Contestant<N> {
    fn scan(&mut self, dt_s: f64, detection: Option<&RadarDetection<f64>>, scan: &Scan<N>) {
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
}

/// The joint estimator corrects its navigation, too.
fn scan_jointly<const N: usize>(
    dt_s: f64,
    detection: Option<&RadarDetection<f64>>,
    own: &mut impl Navigator<N>,
) {
    let (scan, followers) = own.scan();
    let Some(contestant) = followers.contestants.first_mut() else {
        return;
    };
    contestant.skipped = false;
    let Some(AnyTracker::Joint(tracker)) = &mut contestant.tracker else {
        return;
    };
    if tracker.predict(dt_s).is_err() {
        contestant.skipped = true;
        return;
    }
    let Some(detection) = detection else {
        return;
    };
    let (innovation, outside) = tracker.update(detection, &scan.own_ship());
    contestant.skipped = matches!(innovation.outcome, Outcome::Skipped(_));
    if let Some(outside) = outside {
        let angle = own.correct_from_outside(&outside);
        own.scan().1.recentred(&angle);
    }
}

fn report<const N: usize, V: Navigator<N>>(
    (step, detection): (usize, Option<RadarDetection<f64>>),
    world: &TrackingWorld,
    shared: &mut V,
    own: Option<&mut V>,
    run: &TrackingRun<'_>,
    watcher: &mut impl RunWatcher,
) {
    let (scan, followers) = shared.scan();
    let record = NavigationRecord {
        pose: scan.pose,
        true_pose: pose_of(&world.own_at_scan(step)),
        covariance: scan.pose_covariance,
        heading_factor: followers.heading_factor(),
        detection,
    };
    let target = run.target();
    watcher.scan(step, &record, &target);
    let joint = own.map(|own| own.scan().1);
    let all = [Some(followers), joint].into_iter().flatten();
    for contestant in all.flat_map(|followers| &followers.contestants) {
        let record = TrackRecord {
            kind: contestant.kind,
            estimate: contestant.tracker.as_ref().map(AnyTracker::track),
            skipped: contestant.skipped,
        };
        watcher.tracker(step, contestant.index, &record, &target);
    }
}
