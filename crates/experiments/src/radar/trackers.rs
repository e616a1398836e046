//! The trackers by name, and any of them behind one type.

use nalgebra::{Matrix3, SMatrix, Vector3};
use northing_core::kalman::{Innovation, SkipReason};
use northing_core::navigation::error_state::GnssCompassUpdate;
use northing_core::navigation::{ErrorStateFilter, ErrorTransition, STATES};
use northing_core::tracking::initiation::one_point;
use northing_core::tracking::own_ship::PoseMemory;
use northing_core::tracking::{
    BlackBoxSchmidt, Conversion, ConvertedMeasurement, Coupling, JointEkf, NavigationPose, PoseAsKnown,
    RadarDetection, SchmidtKalman, TrackEstimate, TrackerConfig,
};

use super::CampaignError;

type Cross = SMatrix<f64, STATES, 4>;

/// The trackers of the experiment.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum TrackerKind {
    /// Extended Kalman filter, told the true pose.
    TruePose,
    /// Converted measurements, told the true pose.
    TruePoseConverted,
    /// Extended Kalman filter that takes the navigation's pose as true.
    Uncompensated,
    /// Converted measurements that take the navigation's pose as true.
    UncompensatedConverted,
    /// Converted measurements, pose covariance added.
    Converted,
    /// The same with the conversion's bias taken out.
    ConvertedDebiased,
    /// Schmidt-Kalman as the authors' published simulation does it.
    SchmidtAuthors,
    /// Schmidt-Kalman to the letter of the paper.
    SchmidtLiteral,
    /// Schmidt-Kalman with the closed loop of the navigation: exact.
    Schmidt,
    /// Schmidt-Kalman that sees pose and pose covariance only.
    SchmidtBlackBox,
    /// Exact Schmidt-Kalman with the navigation's corrections fed forward.
    SchmidtFeedForward,
    /// Target and navigation estimated together.
    Joint,
}

impl TrackerKind {
    /// All of them.
    pub const ALL: [Self; 12] = [
        Self::TruePose,
        Self::TruePoseConverted,
        Self::Uncompensated,
        Self::UncompensatedConverted,
        Self::Converted,
        Self::ConvertedDebiased,
        Self::SchmidtAuthors,
        Self::SchmidtLiteral,
        Self::Schmidt,
        Self::SchmidtBlackBox,
        Self::SchmidtFeedForward,
        Self::Joint,
    ];

    /// The name for people and files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::TruePose => "true-pose",
            Self::TruePoseConverted => "true-pose-converted",
            Self::Uncompensated => "uncompensated",
            Self::UncompensatedConverted => "uncompensated-converted",
            Self::Converted => "converted",
            Self::ConvertedDebiased => "converted-debiased",
            Self::SchmidtAuthors => "schmidt-authors",
            Self::SchmidtLiteral => "schmidt-literal",
            Self::Schmidt => "schmidt",
            Self::SchmidtBlackBox => "schmidt-black-box",
            Self::SchmidtFeedForward => "schmidt-feed-forward",
            Self::Joint => "joint",
        }
    }

    /// What it is, in a few words.
    #[must_use]
    pub const fn description(self) -> &'static str {
        match self {
            Self::TruePose => "EKF, told the true own pose: the yardstick",
            Self::TruePoseConverted => "converted measurements, told the true own pose",
            Self::Uncompensated => "EKF that takes the navigation's pose as true",
            Self::UncompensatedConverted => "converted measurements, navigation's pose as true",
            Self::Converted => "converted measurements, pose covariance added (paper)",
            Self::ConvertedDebiased => "converted measurements, conversion bias removed",
            Self::SchmidtAuthors => "Schmidt-Kalman as the authors' simulation does it",
            Self::SchmidtLiteral => {
                "Schmidt-Kalman to the letter of the paper: no covariance recursion"
            }
            Self::Schmidt => "Schmidt-Kalman, exact",
            Self::SchmidtBlackBox => "Schmidt-Kalman beside a navigation that shows its pose only",
            Self::SchmidtFeedForward => {
                "Schmidt-Kalman, exact, navigation's corrections fed forward"
            }
            Self::Joint => "target and navigation estimated together: the bound",
        }
    }

    /// The tracker of this name.
    ///
    /// # Errors
    /// There is none; the message lists the names.
    pub fn parse(name: &str) -> Result<Self, CampaignError> {
        let found = Self::ALL.into_iter().find(|kind| kind.name() == name);
        found.ok_or_else(|| CampaignError::UnknownTracker {
            name: name.to_owned(),
            valid: Self::ALL.map(Self::name).join(", "),
        })
    }
}

/// What trackers are told at a scan.
#[derive(Debug)]
pub(super) struct Scan<'a> {
    /// The own pose as the navigation has it.
    pub(super) pose: Vector3<f64>,
    /// The true own pose.
    pub(super) true_pose: Vector3<f64>,
    pub(super) covariance: &'a SMatrix<f64, STATES, STATES>,
    pub(super) pose_from_error: &'a SMatrix<f64, 3, STATES>,
    /// Covariance of the pose.
    pub(super) pose_covariance: Matrix3<f64>,
    /// The covariance one scan later without corrections, for `schmidt-authors`.
    pub(super) ahead: Option<&'a SMatrix<f64, STATES, STATES>>,
}

impl<'a> Scan<'a> {
    pub(super) fn new(
        navigation: &'a ErrorStateFilter<f64>,
        rows: &'a SMatrix<f64, 3, STATES>,
        true_pose: Vector3<f64>,
        ahead: Option<&'a SMatrix<f64, STATES, STATES>>,
    ) -> Self {
        let covariance = &navigation.state().covariance;
        Self {
            pose: navigation.pose(),
            true_pose,
            covariance,
            pose_from_error: rows,
            pose_covariance: rows * covariance * rows.transpose(),
            ahead,
        }
    }

    pub(super) fn own_ship(&self) -> NavigationPose<'a, f64, STATES> {
        NavigationPose {
            pose: self.pose,
            covariance: self.covariance,
            pose_from_error: *self.pose_from_error,
        }
    }
}

/// How tracks start.
#[derive(Debug, Clone, Copy)]
pub(super) enum Start {
    /// From this detection, with this standard deviation of the velocity (m/s), and the
    /// cross-covariance of the conversion or none.
    Detection(RadarDetection<f64>, f64, bool),
    /// From this estimate, uncorrelated with the navigation.
    Prior(TrackEstimate<f64>),
}

/// Any tracker.
#[derive(Debug, Clone)]
pub(super) enum AnyTracker {
    Known(PoseAsKnown<f64>),
    Converted(ConvertedMeasurement<f64>),
    Schmidt(Box<SchmidtKalman<f64, STATES>>),
    BlackBox(Box<BlackBoxSchmidt<f64>>),
    Joint(Box<JointEkf<f64, STATES>>),
}

impl AnyTracker {
    /// Starts a tracker.
    pub(super) fn start(
        kind: TrackerKind,
        config: TrackerConfig<f64>,
        lifetimes: PoseMemory<f64>,
        start: &Start,
        scan: &Scan<'_>,
    ) -> Result<Self, SkipReason> {
        let (track, cross) = start.track(kind, config, scan)?;
        let schmidt = |coupling, cross| {
            Self::Schmidt(Box::new(SchmidtKalman::new(config, coupling, track, cross)))
        };
        let converted =
            |conversion| Self::Converted(ConvertedMeasurement::new(config, conversion, track));
        Ok(match kind {
            TrackerKind::TruePose | TrackerKind::Uncompensated => {
                Self::Known(PoseAsKnown::new(config, track))
            }
            TrackerKind::TruePoseConverted
            | TrackerKind::UncompensatedConverted
            | TrackerKind::Converted => converted(Conversion::Linearized),
            TrackerKind::ConvertedDebiased => converted(Conversion::Debiased),
            TrackerKind::SchmidtAuthors => schmidt(Coupling::OpenLoop, Cross::zeros()),
            TrackerKind::SchmidtLiteral => schmidt(Coupling::OpenLoop, cross),
            TrackerKind::Schmidt => schmidt(Coupling::Exact, cross),
            TrackerKind::SchmidtFeedForward => schmidt(Coupling::FeedForward, cross),
            TrackerKind::SchmidtBlackBox => Self::BlackBox(Box::new(BlackBoxSchmidt::new(
                config,
                lifetimes,
                track,
                scan.pose_from_error * cross,
                &scan.pose_covariance,
            ))),
            TrackerKind::Joint => Self::Joint(Box::new(JointEkf::new(config, track, cross))),
        })
    }

    pub(super) fn track(&self) -> &TrackEstimate<f64> {
        match self {
            Self::Known(tracker) => tracker.track(),
            Self::Converted(tracker) => tracker.track(),
            Self::Schmidt(tracker) => tracker.track(),
            Self::BlackBox(tracker) => tracker.track(),
            Self::Joint(tracker) => tracker.track(),
        }
    }

    /// The navigation has propagated, and corrected itself when there was a fix.
    pub(super) fn navigation_moved(
        &mut self,
        transition: &ErrorTransition<f64>,
        update: Option<&GnssCompassUpdate<f64>>,
    ) {
        match self {
            Self::Schmidt(tracker) => {
                tracker.navigation_propagated(transition);
                if let Some(update) = update {
                    tracker.navigation_corrected(&update.feedback);
                }
            }
            Self::Joint(tracker) => {
                tracker.navigation_propagated(transition);
                if let Some(update) = update {
                    tracker.navigation_corrected(&update.feedback);
                }
            }
            Self::Known(_) | Self::Converted(_) | Self::BlackBox(_) => {}
        }
    }

    pub(super) fn predict(&mut self, dt_s: f64) -> Result<(), SkipReason> {
        match self {
            Self::Known(tracker) => tracker.predict(dt_s),
            Self::Converted(tracker) => tracker.predict(dt_s),
            Self::Schmidt(tracker) => tracker.predict(dt_s),
            Self::BlackBox(tracker) => tracker.predict(dt_s),
            Self::Joint(tracker) => tracker.predict(dt_s),
        }
    }

    /// Fuses a detection. Only the joint estimator touches the navigation, which is its own.
    pub(super) fn update(
        &mut self,
        kind: TrackerKind,
        detection: &RadarDetection<f64>,
        scan: &Scan<'_>,
    ) -> Innovation<f64> {
        let known = matches!(kind, TrackerKind::TruePose | TrackerKind::TruePoseConverted);
        let pose = if known { scan.true_pose } else { scan.pose };
        match self {
            Self::Known(tracker) => tracker.update(detection, &pose),
            Self::Converted(tracker) => {
                let compensated = matches!(
                    kind,
                    TrackerKind::Converted | TrackerKind::ConvertedDebiased
                );
                let covariance = if compensated {
                    scan.pose_covariance
                } else {
                    Matrix3::zeros()
                };
                tracker.update(detection, &pose, &covariance)
            }
            Self::Schmidt(tracker) => {
                let mut own = scan.own_ship();
                if let (TrackerKind::SchmidtAuthors, Some(ahead)) = (kind, scan.ahead) {
                    own.covariance = ahead;
                }
                tracker.update(detection, &own)
            }
            Self::BlackBox(tracker) => tracker.update(detection, &pose, &scan.pose_covariance),
            Self::Joint(tracker) => tracker.update(detection, &scan.own_ship()).0,
        }
    }
}

impl Start {
    /// The track of a kind, and its covariance with the navigation error.
    fn track(
        &self,
        kind: TrackerKind,
        config: TrackerConfig<f64>,
        scan: &Scan<'_>,
    ) -> Result<(TrackEstimate<f64>, Cross), SkipReason> {
        let (detection, velocity_std, correlated) = match self {
            Self::Prior(track) => return Ok((*track, Cross::zeros())),
            Self::Detection(detection, velocity_std, correlated) => {
                (detection, *velocity_std, *correlated)
            }
        };
        let certain = SMatrix::<f64, STATES, STATES>::zeros();
        let mut own = scan.own_ship();
        match kind {
            TrackerKind::TruePose | TrackerKind::TruePoseConverted => {
                own.pose = scan.true_pose;
                own.covariance = &certain;
            }
            TrackerKind::Uncompensated | TrackerKind::UncompensatedConverted => {
                own.covariance = &certain;
            }
            _ => {}
        }
        let (track, cross) = one_point(detection, &config.radar, velocity_std, &own)?;
        Ok((track, if correlated { cross } else { Cross::zeros() }))
    }
}
