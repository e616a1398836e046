//! The build `axis-filters`: the paper's filters, one an axis, for attitude and for position.

use northing_core::attitude::axis_filters::{AngleFilter, AxisFilters, AxisFiltersConfig};
use northing_core::nalgebra::Vector3;
use northing_core::navigation::axis_filters::{PositionAxisConfig, PositionAxisFilters};

use super::{
    Attitude, Estimate, Inertial, Motion, Navigator, Position, Validity, angles_at_rest, std_of,
};

/// Standard gravity, m/s^2.
const GRAVITY: f32 = 9.806_65;

/// Roll, pitch, yaw; north, east, down.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisNavigator {
    attitude: AxisFilters<f32>,
    position: PositionAxisFilters<f32>,
    /// Of the last sound frame.
    specific_force: Vector3<f32>,
}

impl Navigator for AxisNavigator {
    const NAME: &'static [u8] = b"axis-filters";

    fn start(rest: &Inertial) -> Option<Self> {
        let angles = angles_at_rest(rest)?;
        Some(Self {
            attitude: AxisFilters::new(AxisFiltersConfig::default(), angles).ok()?,
            position: PositionAxisFilters::new(PositionAxisConfig::default()).ok()?,
            specific_force: rest.specific_force?,
        })
    }

    fn step(&mut self, inertial: &Inertial, position: Option<&Position>) {
        // Refusals change nothing: what the sensors say is checked by the filters themselves.
        let _ = self
            .attitude
            .propagate(&inertial.angular_rate, inertial.dt_s());
        if let Some(force) = &inertial.specific_force {
            let _ = self.attitude.update_accelerometer(force);
            self.specific_force = *force;
            if let Some(push) = &inertial.push {
                // The next force is itself again.
                self.specific_force += push / inertial.dt_s();
            }
        } else if inertial.unseen.force {
            self.specific_force = self.force_at_rest();
        }
        if let Some(field) = &inertial.magnetic_field {
            let _ = self.attitude.update_magnetometer(field);
        }
        let force_ned = self.attitude.turned_to_ned(&self.specific_force);
        let _ = self
            .position
            .propagate_in_ned(&force_ned, GRAVITY, inertial.dt_s());
        if let Some(fix) = position {
            let _ = self
                .position
                .update_position(u64::from(fix.number), &fix.ned);
        }
    }

    /// That of the Euler angles' rates, which is the body's when it is level.
    fn gyroscope_bias(&self) -> Vector3<f32> {
        Vector3::from(self.attitude.axes().map(|axis| axis.bias))
    }

    fn estimate(&self) -> Estimate {
        let angles = self.attitude.axes();
        let axes = self.position.axes();
        let validity = self.position.validity();
        let motion = Motion {
            position: self.position.position(),
            velocity: self.position.velocity(),
            position_std: Vector3::from(axes.map(|axis| std_of(axis.covariance.m11))),
        };
        Estimate {
            attitude: Some(Attitude {
                angles: Vector3::from(angles.map(|axis| axis.angle)),
                std: Vector3::from(angles.map(
                    |AngleFilter {
                         covariance: [v, ..],
                         ..
                     }| std_of(v),
                )),
            }),
            motion: (validity != Validity::Aligning).then_some(motion),
            validity,
        }
    }

    fn is_sound(&self) -> bool {
        let mut sum = 0.0;
        self.state_bits(|x| sum += x);
        sum.is_finite()
    }

    fn state_bits(&self, mut take: impl FnMut(f32)) {
        for axis in self.attitude.axes() {
            take(axis.angle);
            take(axis.bias);
            axis.covariance.iter().copied().for_each(&mut take);
        }
        for axis in self.position.axes() {
            axis.state.iter().copied().for_each(&mut take);
            axis.covariance.iter().copied().for_each(&mut take);
        }
    }
}

impl AxisNavigator {
    /// Up, in body axes: how far down each of them points.
    #[cold]
    fn force_at_rest(&mut self) -> Vector3<f32> {
        let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
        Vector3::from(axes.map(|axis| self.attitude.turned_to_ned(&axis).z * -GRAVITY))
    }
}
