//! A detection that was surely a target's own, less what was expected of it: what two or three of them in a row teach ([`super::echo`],
//! [`super::pose_error`]).

use nalgebra::Vector2;

use super::coordinated_turn::TargetState;
use super::detection::{Detection, DetectionKind, SchmidtInnovation};
use super::echo::Echo;
use super::multi_target::Scan;
use super::pose_error::{Change, Changes};
use crate::scalar::Scalar;

/// Looks at a target from more scans before are not compared with.
pub(super) const FARTHEST_APART: u8 = 4;

/// A detection of a target, less what was expected of it.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(
        serialize = "T: Scalar + serde::Serialize",
        deserialize = "T: Scalar + serde::Deserialize<'de>"
    ))
)]
pub(super) struct Seen<T> {
    pub(super) time_s: T,
    /// Place of the sensor in [`super::echo::EchoMemory`].
    pub(super) sensor: u8,
    pub(super) kind: DetectionKind,
    pub(super) residual: Vector2<T>,
    /// Variance of its components but for what the own ship and the echo's place add, which changes little from scan to scan.
    pub(super) spread: Vector2<T>,
    /// What the echo's place adds to them where it is new in every scan.
    pub(super) extent: Vector2<T>,
    /// What is left of it after the update; not where the own ship's pose is exact.
    #[cfg_attr(feature = "serde", serde(default))]
    pub(super) left: Option<Vector2<T>>,
    /// How the measured less the expected changed since the last such detection of the same sensor, some scans before.
    #[cfg_attr(feature = "serde", serde(default))]
    pub(super) change: Option<Change<T>>,
}

impl<T: Scalar> Seen<T> {
    /// Of an innovation of a target at this range (m) with this noise; `None` of a bearing alone, which moves with the target's range.
    pub(super) fn new(
        (kind, innovation): (DetectionKind, &SchmidtInnovation<T>),
        (scan, echo): (&Scan<'_, T>, &Echo<T>),
        (sensor, range): (u8, T),
    ) -> Option<Self> {
        let std = scan.sensor.noise.extent_std_m;
        let extent = match kind {
            DetectionKind::RangeBearing => Vector2::new(std, std / range),
            DetectionKind::Position => Vector2::repeat(std),
            DetectionKind::Bearing => return None,
        };
        let extent = extent.component_mul(&extent);
        if !extent.iter().all(|variance| variance.is_finite()) {
            return None;
        }
        let mut pose = scan.own_ship.covariance;
        for i in 0..3 {
            if pose[(i, i)] <= T::zero() {
                pose[(i, i)] = T::one();
            }
        }
        let o = &innovation.pose_covariance;
        let of_pose = o.transpose() * pose.cholesky()?.solve(o);
        let of_echo = match &innovation.echo_covariance {
            Some(e) => (e.transpose() * e / echo.lasting).diagonal(),
            None => extent,
        };
        Some(Self {
            time_s: scan.time_s,
            sensor,
            kind,
            residual: innovation.residual,
            spread: innovation.covariance.diagonal() - of_pose.diagonal() - of_echo,
            extent,
            left: None,
            change: None,
        })
    }

    /// What it says of the own ship's error, of a track at `states` before and after its update with this detection, so many scans of
    /// the sensor after `last`; kept for the next.
    pub(super) fn compare(
        &mut self,
        last: Option<(&Self, u8)>,
        (detection, scan): (&Detection<T>, &Scan<'_, T>),
        states: [&TargetState<T>; 2],
    ) -> Option<Changes<T>> {
        let [before, after] = states.map(|state| {
            let noise = &scan.sensor.noise;
            self.kind.predict(state, scan.own_ship, noise)
        });
        let ((expected, prediction), (left, _)) = (before?, after?);
        self.left = Some(detection.minus(&left));
        let (last, scans) = last?;
        let now = detection.minus(&expected);
        let by = self.kind.difference(&now, last.left.as_ref()?);
        self.change = Some(Change { by, scans });
        let before = last.change.map(|before| Change {
            by: before.by + by,
            scans: before.scans.saturating_add(scans),
        });
        Some(Changes {
            since_last: Change { by, scans },
            since_before: before,
            jacobian: prediction.pose_jacobian,
            spread: self.spread + self.extent,
        })
    }
}
