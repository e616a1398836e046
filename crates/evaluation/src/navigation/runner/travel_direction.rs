//! Which way the vehicle moves, seen from the sensors: a unit whose x points forward, read with the axes of a phone, has a
//! heading that is 90 degrees off, and only the course shows it.

use nalgebra::Vector3;
use northing_core::navigation::Validity;
use northing_recording::BodyAxes;

use crate::navigation::navigator::NavigationEstimate;
use crate::navigation::outcome::TravelDirection;

/// A velocity counts that is so many times its standard deviation: its direction is known to 0.2 rad.
const OVER_NOISE: f64 = 5.0;
/// Fixes that are needed.
const FEWEST: u32 = 20;
/// A direction of so small a spread is one, rad; a vehicle that goes anywhere, or reverses a twentieth of the time, has none.
const SPREAD: f64 = 0.35;
/// What is less level than this (sine of the angle from the vertical) has no direction in the plane.
const LEVEL: f64 = 0.7;
/// Nearer than this to the forward axis nothing is said, degrees: another axis is no better.
const FORWARD_DEG: f64 = 45.0;
/// An axis of the sensors is meant where a direction is within so much of it, rad.
const ALONG: f64 = 0.5;

/// Gathers the directions while a run goes on.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Travel {
    /// Sums of unit vectors, forward, right, down in the body: of the velocity, and up.
    moved: Vector3<f64>,
    up: Vector3<f64>,
    fixes: u32,
}

impl Travel {
    /// An estimate that has just used a fix.
    pub(super) fn estimate(&mut self, estimate: &NavigationEstimate) {
        let (Some(attitude), Some(covariance)) =
            (estimate.ned_from_body, estimate.velocity_covariance)
        else {
            return;
        };
        let speed = estimate.velocity.norm();
        let known = speed > OVER_NOISE * covariance.trace().max(0.0).sqrt();
        if estimate.validity != Validity::Aided || !known {
            return;
        }
        self.moved += attitude.inverse() * (estimate.velocity / speed);
        self.up -= attitude.inverse() * Vector3::z();
        self.fixes += 1;
    }

    /// The direction, if it is one.
    pub(super) fn direction(&self) -> Option<TravelDirection> {
        let n = self.fixes;
        if n < FEWEST {
            return None;
        }
        let [moved, up] = [&self.moved, &self.up].map(|sum| one_direction(sum, n));
        let (moved, up) = (moved?, up?);
        // Forward, and the direction of travel, in the level plane.
        let [forward, along] = [Vector3::x(), moved].map(|v| v - up * v.dot(&up));
        if forward.norm().min(along.norm()) < LEVEL {
            return None;
        }
        let right = (-up.dot(&forward.cross(&along))).atan2(forward.dot(&along));
        let spread = (2.0 * (1.0 - self.moved.norm() / f64::from(n))).sqrt();
        Some(TravelDirection {
            right_deg: right.to_degrees(),
            spread_deg: spread.to_degrees(),
            fixes: n,
        })
    }

    /// What is odd about the axes of the sensors, a sentence.
    pub(super) fn issue(&self, axes: BodyAxes) -> Option<String> {
        let TravelDirection {
            right_deg,
            spread_deg,
            fixes,
        } = self.direction()?;
        if right_deg.abs() < FORWARD_DEG {
            return None;
        }
        let side = if right_deg > 0.0 { "right" } else { "left" };
        let named = axis_ahead(axes);
        let seen = format!(
            "In {fixes} fixes the vehicle moved {:.0} deg to the {side} of the sensors' forward axis ({named}), with a spread of \
             {spread_deg:.0} deg",
            right_deg.abs()
        );
        let better = named_axes(axes, &self.moved.normalize(), &self.up.normalize());
        Some(match better {
            Some(better) => format!(
                "{seen}: along {}. The heading is that of {named}. If the sensors' x, y, z point {}, body_axes = \"{}\" \
                 (docs/formats.md) makes it the vehicle's.",
                axis_ahead(better),
                better.in_words(),
                better.name()
            ),
            None => {
                format!("{seen}: its course is that much from the heading, which is the unit's.")
            }
        })
    }
}

/// The axis of the sensors that points forward.
fn axis_ahead(axes: BodyAxes) -> &'static str {
    match axes {
        BodyAxes::Phone => "y",
        BodyAxes::Flu | BodyAxes::Frd => "x",
    }
}

/// The mean of unit vectors whose sum is this, if they are nearly one.
fn one_direction(sum: &Vector3<f64>, n: u32) -> Option<Vector3<f64>> {
    let resultant = sum.norm() / f64::from(n);
    (resultant > 1.0 - 0.5 * SPREAD * SPREAD).then(|| sum.normalize())
}

/// The axes with which what moves along `moved` moves forward, and what points up is up; both in the body of `axes`.
fn named_axes(axes: BodyAxes, moved: &Vector3<f64>, up: &Vector3<f64>) -> Option<BodyAxes> {
    let [forward, right, down] = axes.forward_right_down();
    let turned = |v: &Vector3<f64>| forward * v.x + right * v.y + down * v.z;
    let (moved, up) = (turned(moved), turned(up));
    let all = [BodyAxes::Phone, BodyAxes::Flu, BodyAxes::Frd];
    all.into_iter().find(|&other| {
        let [forward, _, down] = other.forward_right_down();
        moved.dot(&forward) > ALONG.cos() && -up.dot(&down) > ALONG.cos()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, UnitQuaternion};
    use northing_core::earth::{Geodetic, LocalFrame};
    use northing_core::geometry::rotation::from_yaw_pitch_roll;

    fn estimate(attitude: UnitQuaternion<f64>, velocity: Vector3<f64>) -> NavigationEstimate {
        NavigationEstimate {
            time_ns: 0,
            frame: LocalFrame::new(Geodetic::from_degrees(47.0, 8.0, 400.0).unwrap()),
            ned_from_body: Some(attitude),
            heading_std: Some(0.03),
            attitude_covariance: None,
            position: Vector3::zeros(),
            position_covariance: Matrix3::identity(),
            velocity,
            velocity_covariance: Some(Matrix3::identity() * 0.04),
            validity: Validity::Aided,
        }
    }

    /// A vehicle in winding streets that goes where its nose is, but for what it drifts, rad; the body is turned in it by yaw, pitch, roll.
    fn drive(mount: [f64; 3], drift: fn(f64) -> f64) -> Travel {
        let mut travel = Travel::default();
        for k in 0..100 {
            let t = f64::from(k);
            let heading = 1.2 * (0.21 * t).sin() + 0.05 * t;
            let vehicle = from_yaw_pitch_roll([heading, 0.03 * t.sin(), 0.05 * (0.7 * t).cos()]);
            let course = heading + drift(t);
            let velocity = Vector3::new(course.cos(), course.sin(), 0.0) * 8.0;
            travel.estimate(&estimate(vehicle * from_yaw_pitch_roll(mount), velocity));
        }
        travel
    }

    const QUARTER: f64 = std::f64::consts::FRAC_PI_2;
    const HALF: f64 = std::f64::consts::PI;
    const AHEAD: fn(f64) -> f64 = |_| 0.0;

    #[test]
    fn a_unit_that_points_ahead_is_no_issue() {
        for axes in [BodyAxes::Phone, BodyAxes::Flu, BodyAxes::Frd] {
            let ahead = drive([0.0; 3], AHEAD);
            assert_eq!(ahead.issue(axes), None);
            assert!(ahead.direction().unwrap().right_deg.abs() < 1.0);
            assert_eq!(drive([0.5, 0.3, -0.2], AHEAD).issue(axes), None);
        }
    }

    #[test]
    fn the_axes_that_the_unit_has_are_named() {
        // What forward, left, up is if its x, y, z are taken for right, forward, up: turned left by a quarter.
        let flu = drive([-QUARTER, 0.0, 0.0], AHEAD);
        let said = flu.issue(BodyAxes::Phone).unwrap();
        assert!(
            said.starts_with("In 100 fixes the vehicle moved 90 deg to the right of the sensors' forward axis (y), with a spread of"),
            "{said}"
        );
        assert!(
            said.contains("point forward, left, up, body_axes = \"flu\""),
            "{said}"
        );
        // And forward, right, down: upside down besides.
        let frd = drive([QUARTER, 0.0, HALF], AHEAD);
        let said = frd.issue(BodyAxes::Phone).unwrap();
        assert!(
            said.contains(": along x. The heading is that of y."),
            "{said}"
        );
        assert!(
            said.contains("point forward, right, down, body_axes = \"frd\""),
            "{said}"
        );
        // A phone's, read as those of a vehicle's unit.
        let phone = drive([QUARTER, 0.0, 0.0], AHEAD);
        let said = phone.issue(BodyAxes::Flu).unwrap();
        assert!(
            said.contains("90 deg to the left of the sensors' forward axis (x)"),
            "{said}"
        );
        assert!(said.contains("body_axes = \"phone\""), "{said}");
    }

    /// Named axes would not put it right.
    #[test]
    fn a_unit_that_looks_elsewhere_is_only_said_to() {
        for (mount, off) in [(HALF, "180 deg"), (-0.75 * HALF, "135 deg to the right")] {
            let said = drive([mount, 0.0, 0.0], AHEAD)
                .issue(BodyAxes::Phone)
                .unwrap();
            assert!(said.contains(off) && !said.contains("body_axes"), "{said}");
        }
    }

    /// A vehicle without a direction, a phone whose forward axis points up, a heading or a speed that nobody knows.
    #[test]
    fn where_there_is_no_direction_nothing_is_said() {
        let to_and_fro = drive(
            [QUARTER, 0.0, 0.0],
            |t| if t % 7.0 < 3.0 { HALF } else { 0.0 },
        );
        assert_eq!(to_and_fro.issue(BodyAxes::Phone), None);
        let anywhere = drive([QUARTER, 0.0, 0.0], |t| 2.0 * (0.4 * t).sin());
        assert_eq!(anywhere.issue(BodyAxes::Phone), None);
        let upright = drive([0.0, QUARTER, 0.0], AHEAD);
        assert_eq!(upright.issue(BodyAxes::Phone), None);
        assert_eq!(Travel::default().issue(BodyAxes::Phone), None);
        let mut unknown = Travel::default();
        let sideways = estimate(UnitQuaternion::identity(), Vector3::y() * 8.0);
        for _ in 0..100 {
            unknown.estimate(&NavigationEstimate {
                validity: Validity::HeadingUnknown,
                ..sideways
            });
            unknown.estimate(&NavigationEstimate {
                velocity: Vector3::y(),
                ..sideways
            });
            unknown.estimate(&NavigationEstimate {
                velocity_covariance: None,
                ..sideways
            });
        }
        assert_eq!(unknown.issue(BodyAxes::Phone), None);
    }
}
