//! Which sign a phone gives its accelerations: specific force (Android, W3C) or its opposite (iOS).
//!
//! Nothing in the messages says it for certain, so evidence decides, the strongest first: the
//! phone's own orientation knows which way is up; then the platform; then gravity at rest, taking
//! the screen to be up. What was decided is said.

use nalgebra::{UnitQuaternion, Vector3};

use super::{Decoded, Tone};
use crate::options::STANDARD_GRAVITY_M_S2;

/// How a device writes accelerations.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ForceSign {
    /// Specific force: gravity at rest is positive on the axis that points up (Android, W3C).
    Standard,
    /// The opposite on all axes (iOS).
    Opposite,
}

impl ForceSign {
    /// Factor from the device's number to specific force.
    #[must_use]
    pub const fn factor(self) -> f64 {
        match self {
            Self::Standard => 1.0,
            Self::Opposite => -1.0,
        }
    }

    const fn words(self) -> &'static str {
        match self {
            Self::Standard => "as Android and the standard have it",
            Self::Opposite => "as iPhones have it (inverted)",
        }
    }
}

/// Why a sign was chosen, the strongest reason last.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Reason {
    Gravity,
    Platform,
    Orientation,
}

impl Reason {
    const fn words(self) -> &'static str {
        match self {
            Self::Gravity => "by gravity at rest, if the screen was up then",
            Self::Platform => "by the kind of phone",
            Self::Orientation => "by the phone's own orientation, which knows the way up",
        }
    }
}

/// Readings near rest that a verdict needs.
const ENOUGH: u32 = 5;
/// Old evidence fades once there is this much.
const PLENTY: u32 = 400;
/// An orientation speaks for accelerations this near in time, ns.
const NEAR_NS: i64 = 100_000_000;

/// Evidence: the mean of a cosine that is near +1 or -1 when it tells.
#[derive(Debug, Clone, Copy, Default)]
struct Evidence {
    sum: f64,
    count: u32,
}

impl Evidence {
    fn add(&mut self, cosine: f64) {
        if cosine.is_finite() {
            self.sum += cosine;
            self.count += 1;
        }
        if self.count >= PLENTY {
            self.sum /= 2.0;
            self.count /= 2;
        }
    }

    fn verdict(self) -> Option<ForceSign> {
        let mean = self.sum / f64::from(self.count.max(1));
        (self.count >= ENOUGH && mean.abs() > 0.8).then_some(if mean > 0.0 {
            ForceSign::Standard
        } else {
            ForceSign::Opposite
        })
    }
}

/// Decides the sign as evidence comes in.
#[derive(Debug, Clone, Default)]
pub(super) struct SignRule {
    /// What the platform implies.
    pub(super) platform: Option<ForceSign>,
    up: Option<(i64, Vector3<f64>)>,
    orientation: Evidence,
    gravity: Evidence,
    decided: Option<(ForceSign, Reason)>,
}

impl SignRule {
    /// The device's own orientation, in any world frame whose z axis points up.
    pub(super) fn see_orientation(&mut self, time_ns: i64, world_from_body: &UnitQuaternion<f64>) {
        let up = world_from_body.inverse() * Vector3::z();
        if up.iter().all(|x| x.is_finite()) {
            self.up = Some((time_ns, up));
        }
    }

    /// An acceleration with gravity as the device wrote it, m/s^2.
    pub(super) fn see_force(&mut self, time_ns: i64, written: &Vector3<f64>) {
        let norm = written.norm();
        // A NaN is not near rest either.
        let near_rest = (norm - STANDARD_GRAVITY_M_S2).abs() < 1.0;
        if !near_rest {
            return;
        }
        self.gravity.add(written.z / norm);
        if let Some((up_ns, up)) = self.up
            && time_ns.abs_diff(up_ns) <= NEAR_NS as u64
        {
            self.orientation.add(written.dot(&up) / norm);
        }
    }

    /// The sign by all that was seen; says so when it is new.
    pub(super) fn decide(&mut self, out: &mut Decoded) -> ForceSign {
        let fresh = [
            (self.orientation.verdict(), Reason::Orientation),
            (self.platform, Reason::Platform),
            (self.gravity.verdict(), Reason::Gravity),
        ]
        .into_iter()
        .find_map(|(sign, reason)| Some((sign?, reason)));
        let Some((sign, reason)) = fresh else {
            return self.decided.map_or(ForceSign::Standard, |(sign, _)| sign);
        };
        match self.decided {
            // Lying screen up once is all that gravity can tell; afterwards the phone may lie as it likes.
            Some((known, known_reason)) if reason < known_reason || reason == Reason::Gravity => {
                return known;
            }
            Some((known, _)) if known == sign => self.decided = Some((sign, reason)),
            Some(_) => {
                self.decided = Some((sign, reason));
                let text = format!(
                    "The sign of the accelerations changes: from here on it is taken {}, {}. Calibrate and start again.",
                    sign.words(),
                    reason.words()
                );
                out.warn(text);
            }
            None => {
                self.decided = Some((sign, reason));
                let text = format!(
                    "The sign of the accelerations is taken {}, {}.",
                    sign.words(),
                    reason.words()
                );
                let contradicts = self.platform.is_some_and(|platform| platform != sign);
                out.note(
                    if contradicts {
                        Tone::Warning
                    } else {
                        Tone::Info
                    },
                    text,
                );
            }
        }
        sign
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const G: f64 = STANDARD_GRAVITY_M_S2;

    fn rest(rule: &mut SignRule, force: Vector3<f64>, orientation: Option<UnitQuaternion<f64>>) {
        for index in 0..10 {
            if let Some(q) = &orientation {
                rule.see_orientation(index, q);
            }
            rule.see_force(index, &force);
        }
    }

    #[test]
    fn orientation_beats_platform_beats_gravity() {
        let mut out = Decoded::default();
        let mut rule = SignRule::default();
        assert_eq!(rule.decide(&mut out), ForceSign::Standard);
        assert!(out.notices.is_empty(), "nothing is decided yet");
        rest(&mut rule, Vector3::new(0.0, 0.0, -G), None);
        assert_eq!(rule.decide(&mut out), ForceSign::Opposite);
        rule.platform = Some(ForceSign::Standard);
        assert_eq!(rule.decide(&mut out), ForceSign::Standard);
        // Screen down, with a positive sign on the axis that points down: inverted after all.
        let upside_down = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
        rest(&mut rule, Vector3::new(0.0, 0.0, G), Some(upside_down));
        assert_eq!(rule.decide(&mut out), ForceSign::Opposite);
        assert_eq!(out.notices.len(), 3, "{:?}", out.notices);
    }

    #[test]
    fn turning_the_phone_over_later_changes_nothing() {
        let mut out = Decoded::default();
        let mut rule = SignRule::default();
        rest(&mut rule, Vector3::new(0.0, 0.0, G), None);
        assert_eq!(rule.decide(&mut out), ForceSign::Standard);
        for _ in 0..100 {
            rest(&mut rule, Vector3::new(0.0, 0.0, -G), None);
            assert_eq!(rule.decide(&mut out), ForceSign::Standard);
        }
    }

    #[test]
    fn motion_and_nonsense_are_no_evidence() {
        let mut out = Decoded::default();
        let mut rule = SignRule::default();
        for force in [
            Vector3::new(0.0, 0.0, -2.0 * G),
            Vector3::zeros(),
            Vector3::repeat(f64::NAN),
            Vector3::new(G, 0.0, 0.0),
        ] {
            rest(&mut rule, force, None);
        }
        assert_eq!(rule.decide(&mut out), ForceSign::Standard);
        assert!(out.notices.is_empty());
    }
}
