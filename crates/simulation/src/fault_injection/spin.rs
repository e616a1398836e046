//! A spin of the device laid over its motion: faster than a gyroscope's range, and over after whole turns.

use core::f64::consts::TAU;

use nalgebra::{UnitQuaternion, Vector3};
use northing_recording::{Event, Sample};

use super::within;
use crate::rotation::exp;

/// How long a spin takes to reach its rate, and to end, s.
const RAMP_S: f64 = 0.25;

/// A turn about one axis of the body that begins and ends softly, after whole turns: biases are again where they were.
pub(super) struct Spin {
    axis: Vector3<f64>,
    /// rad/s.
    pub(super) rate: f64,
    span: [i64; 2],
}

impl Spin {
    pub(super) fn new(axis: usize, about_rad_s: f64, span: [i64; 2]) -> Self {
        let steady_s = (span[1] - span[0]) as f64 * 1e-9 - RAMP_S;
        let turns = (about_rad_s * steady_s / TAU).round();
        Self {
            axis: Vector3::ith(axis, 1.0),
            rate: turns * TAU / steady_s,
            span,
        }
    }

    /// Rate (rad/s) and angle (rad) at an instant.
    fn at(&self, time_ns: i64) -> [f64; 2] {
        let seconds = |ns: i64| ns as f64 * 1e-9;
        let length = seconds(self.span[1] - self.span[0]);
        let now = seconds(time_ns - self.span[0]).clamp(0.0, length);
        let slope = self.rate / RAMP_S;
        let steady = self.rate * (length - RAMP_S);
        if now < RAMP_S {
            [slope * now, 0.5 * slope * now * now]
        } else if now < length - RAMP_S {
            [self.rate, self.rate * (now - 0.5 * RAMP_S)]
        } else {
            let left = length - now;
            [slope * left, steady - 0.5 * slope * left * left]
        }
    }

    /// The event of the device that spins. The sensors lie in the axis.
    pub(super) fn of(&self, event: &Event) -> Event {
        if !within(self.span, event) {
            return *event;
        }
        let [rate, angle] = self.at(event.time_ns);
        let old_from_new: UnitQuaternion<f64> = exp(&(self.axis * angle));
        let turned = |v: &Vector3<f64>| old_from_new.inverse() * v;
        let sample = match event.sample {
            Sample::Reference(mut reference) => {
                reference.attitude *= old_from_new;
                Sample::Reference(reference)
            }
            Sample::AngularRate(v) => Sample::AngularRate(turned(&v) + self.axis * rate),
            Sample::SpecificForce(v) => Sample::SpecificForce(turned(&v)),
            Sample::MagneticField(v) => Sample::MagneticField(turned(&v)),
            other => other,
        };
        Event { sample, ..*event }
    }
}
