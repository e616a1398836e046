//! The trackers by name, and any of them behind one type.

use nalgebra::{Matrix3, SMatrix, Vector3};
use northing_core::ConfigError;
use northing_core::kalman::{
    ErrorListener, ErrorPropagation, Innovation, ScalarCorrection, SkipReason,
};
use northing_core::tracking::initiation::one_point;
use northing_core::tracking::own_ship::PoseErrorCorrelation;
use northing_core::tracking::{
    BlackBoxSchmidt, Conversion, ConvertedMeasurement, Coupling, JointEkf, PoseAsKnown,
    RadarDetection, SchmidtKalman, SeenTrack, TrackEstimate, TrackerConfig,
};

use northing_evaluation::estimators;
use northing_evaluation::registry::ParameterInfo;
use northing_simulation::scenario::schema::NavigationFilter;

use super::CampaignError;
use super::navigators::Scan;

type Cross<const N: usize> = SMatrix<f64, N, 4>;

estimators! {
    /// The trackers of the experiment. Error states: of the Schmidt-Kalman filters and the joint one with the navigation's.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
    pub enum TrackerKind for Tracking, "montecarlo --trackers", no_parameters {
        /// Extended Kalman filter with the true pose.
        TruePose = "true-pose", 4, "EKF, given the true own pose: the baseline",
            "docs/derivations/schmidt_kalman.md", "the baseline without pose error";
        /// Converted measurements with the true pose.
        TruePoseConverted = "true-pose-converted", 4, "converted measurements with the true own pose",
            "docs/derivations/schmidt_kalman.md", "the baseline without pose error";
        /// Extended Kalman filter that takes the navigation's pose as true.
        Uncompensated = "uncompensated", 4, "EKF that takes the navigation's pose as true",
            "docs/derivations/schmidt_kalman.md", "the baseline";
        /// Converted measurements that take the navigation's pose as true.
        UncompensatedConverted = "uncompensated-converted", 4, "converted measurements, navigation's pose as true",
            "docs/derivations/schmidt_kalman.md", "the baseline";
        /// Converted measurements, pose covariance added.
        Converted = "converted", 4, "converted measurements, pose covariance added (paper)",
            "docs/derivations/schmidt_kalman.md", "to compare with";
        /// The same with the conversion's bias taken out.
        ConvertedDebiased = "converted-debiased", 4, "converted measurements, conversion bias removed",
            "docs/derivations/schmidt_kalman.md", "to compare with";
        /// Schmidt-Kalman as the authors' published simulation does it.
        SchmidtAuthors = "schmidt-authors", 19, "Schmidt-Kalman as the authors' simulation does it",
            "docs/derivations/schmidt_kalman.md", "to repeat the paper";
        /// Schmidt-Kalman to the letter of the paper.
        SchmidtLiteral = "schmidt-literal", 19,
            "Schmidt-Kalman to the letter of the paper: no covariance recursion",
            "docs/derivations/schmidt_kalman.md", "to repeat the paper";
        /// Schmidt-Kalman with the closed loop of the navigation: exact.
        Schmidt = "schmidt", 19, "Schmidt-Kalman, exact",
            "docs/derivations/schmidt_kalman.md", "own ship's navigation filter at hand";
        /// Schmidt-Kalman that sees pose and pose covariance only.
        SchmidtBlackBox = "schmidt-black-box", 7, "Schmidt-Kalman beside a navigation that shows its pose only",
            "docs/derivations/schmidt_kalman.md", "only pose and covariance at hand";
        /// Exact Schmidt-Kalman with the navigation's corrections fed forward.
        SchmidtFeedForward = "schmidt-feed-forward", 19,
            "Schmidt-Kalman, exact, navigation's corrections fed forward",
            "docs/derivations/schmidt_kalman.md", "own ship's navigation filter at hand";
        /// Target and navigation estimated together.
        Joint = "joint", 19, "target and navigation estimated together: the bound",
            "docs/derivations/schmidt_kalman.md", "the bound: targets correct the navigation, too";
    }
}

/// They have none to set.
fn no_parameters(_: TrackerKind) -> Vec<ParameterInfo> {
    Vec::new()
}

impl TrackerKind {
    /// Whether it can follow this navigation filter: the authors' variant looks ahead with the paper's, and the joint
    /// estimator corrects it.
    #[must_use]
    pub fn goes_with(self, filter: NavigationFilter) -> bool {
        let needs_paper = matches!(self, Self::SchmidtAuthors | Self::Joint);
        filter == NavigationFilter::ErrorState || !needs_paper
    }

    /// The tracker of this name.
    ///
    /// # Errors
    /// There is none; the message lists the names.
    pub fn parse(name: &str) -> Result<Self, CampaignError> {
        Self::named(name).ok_or_else(|| CampaignError::UnknownTracker {
            name: name.to_owned(),
            valid: Self::names(),
        })
    }
}

/// One tracker of a run. The joint estimator has a navigation of its own.
pub(super) struct Contestant<const N: usize> {
    pub(super) kind: TrackerKind,
    /// Its place in the list of trackers.
    pub(super) index: usize,
    /// `None` when it never started.
    pub(super) tracker: Option<AnyTracker<N>>,
    pub(super) skipped: bool,
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
pub(super) enum AnyTracker<const N: usize> {
    Known(PoseAsKnown<f64>),
    Converted(ConvertedMeasurement<f64>),
    Schmidt(Box<SchmidtKalman<f64, N>>),
    BlackBox(Box<BlackBoxSchmidt<f64>>),
    Joint(Box<JointEkf<f64, N>>),
}

impl<const N: usize> AnyTracker<N> {
    /// Starts a tracker.
    pub(super) fn start(
        kind: TrackerKind,
        config: TrackerConfig<f64>,
        lifetimes: PoseErrorCorrelation<f64>,
        start: &Start,
        scan: &Scan<N>,
    ) -> Result<Self, SkipReason> {
        let (track, cross) = start.track(kind, config, scan)?;
        let schmidt = |coupling, cross| {
            let tracker = SchmidtKalman::new(config, coupling, track, cross)?;
            Ok(Self::Schmidt(Box::new(tracker)))
        };
        let converted = |conversion| {
            ConvertedMeasurement::new(config, conversion, track.tangent).map(Self::Converted)
        };
        let made: Result<Self, ConfigError> = match kind {
            TrackerKind::TruePose | TrackerKind::Uncompensated => {
                PoseAsKnown::new(config, track).map(Self::Known)
            }
            TrackerKind::TruePoseConverted
            | TrackerKind::UncompensatedConverted
            | TrackerKind::Converted => converted(Conversion::Linearized),
            TrackerKind::ConvertedDebiased => converted(Conversion::Debiased),
            TrackerKind::SchmidtAuthors => schmidt(Coupling::OpenLoop, Cross::<N>::zeros()),
            TrackerKind::SchmidtLiteral => schmidt(Coupling::OpenLoop, cross),
            TrackerKind::Schmidt => schmidt(Coupling::Exact, cross),
            TrackerKind::SchmidtFeedForward => schmidt(Coupling::FeedForward, cross),
            TrackerKind::SchmidtBlackBox => BlackBoxSchmidt::new(
                config,
                lifetimes,
                track,
                scan.pose_from_error * cross,
                &scan.pose_covariance,
            )
            .map(|tracker| Self::BlackBox(Box::new(tracker))),
            TrackerKind::Joint => {
                JointEkf::new(config, track, cross).map(|tracker| Self::Joint(Box::new(tracker)))
            }
        };
        // A campaign's configuration is checked before it starts.
        made.map_err(|_| SkipReason::OutOfRange)
    }

    pub(super) fn track(&self) -> TrackEstimate<f64> {
        match self {
            Self::Known(tracker) => tracker.track(),
            Self::Converted(tracker) => tracker.track(),
            Self::Schmidt(tracker) => tracker.track(),
            Self::BlackBox(tracker) => tracker.track(),
            Self::Joint(tracker) => tracker.track(),
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
        scan: &Scan<N>,
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
                if let (TrackerKind::SchmidtAuthors, Some(ahead)) = (kind, &scan.ahead) {
                    own.covariance = ahead;
                }
                tracker.update(detection, &own)
            }
            Self::BlackBox(tracker) => tracker.update(detection, &pose, &scan.pose_covariance),
            Self::Joint(tracker) => tracker.update(detection, &scan.own_ship()).0,
        }
    }
}

/// The exact trackers follow the errors of the navigation; the others have nothing to follow.
impl<const N: usize> ErrorListener<f64, N> for AnyTracker<N> {
    fn propagated(&mut self, transition: &impl ErrorPropagation<f64, N>) {
        match self {
            Self::Schmidt(tracker) => tracker.propagated(transition),
            Self::Joint(tracker) => tracker.propagated(transition),
            Self::Known(_) | Self::Converted(_) | Self::BlackBox(_) => {}
        }
    }

    fn corrected<const E: usize>(&mut self, correction: &ScalarCorrection<f64, N, E>) {
        match self {
            Self::Schmidt(tracker) => tracker.corrected(correction),
            Self::Joint(tracker) => tracker.corrected(correction),
            Self::Known(_) | Self::Converted(_) | Self::BlackBox(_) => {}
        }
    }

    fn recentred(&mut self, angle: &Vector3<f64>) {
        match self {
            Self::Schmidt(tracker) => tracker.recentred(angle),
            Self::Joint(tracker) => tracker.recentred(angle),
            Self::Known(_) | Self::Converted(_) | Self::BlackBox(_) => {}
        }
    }

    fn restarted(&mut self) {
        match self {
            Self::Schmidt(tracker) => tracker.restarted(),
            Self::Joint(tracker) => tracker.restarted(),
            Self::Known(_) | Self::Converted(_) | Self::BlackBox(_) => {}
        }
    }
}

impl Start {
    /// The track of a kind, and its covariance with the navigation error.
    fn track<const N: usize>(
        &self,
        kind: TrackerKind,
        config: TrackerConfig<f64>,
        scan: &Scan<N>,
    ) -> Result<(SeenTrack<f64>, Cross<N>), SkipReason> {
        let (detection, velocity_std, correlated) = match self {
            Self::Prior(track) => return Ok(((*track).into(), Cross::<N>::zeros())),
            Self::Detection(detection, velocity_std, correlated) => {
                (detection, *velocity_std, *correlated)
            }
        };
        let certain = SMatrix::<f64, N, N>::zeros();
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
        Ok((
            track,
            if correlated {
                cross
            } else {
                Cross::<N>::zeros()
            },
        ))
    }
}
