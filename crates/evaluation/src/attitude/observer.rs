//! Observer interface of a run: estimates and innovations; and an observer that keeps a trace.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use northing_core::geometry::frames::{
    TangentFrame, covariance_in_reference, enu_from_ned, enu_from_ned_rotation,
};
use northing_core::geometry::rotation;
use northing_core::kalman::{Innovation, Outcome};
use northing_recording::{PoseEstimate, Reference, SensorKind, WorldFrame};

use crate::attitude::options::tangent_frame;
use crate::attitude::{InnovationPoint, PositionPoint, ScoredRecord, Trace, TracePoint};
use crate::observers::observers;
use crate::statistics::attitude_std::AttitudeStd;
use crate::statistics::metrics::AttitudeError;

/// The estimate at the instant of a gyroscope sample, after everything measured at that instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EstimateRecord {
    /// Time stamp of the recording, ns.
    pub time_ns: i64,
    /// Seconds since the first sample of the recording.
    pub time_s: f64,
    /// `world_from_body`.
    pub attitude: UnitQuaternion<f64>,
    /// Covariance (rad^2) of its local error in body axes.
    pub attitude_covariance: Option<Matrix3<f64>>,
    /// Gyroscope bias (rad/s, body axes) and its covariance, where it is estimated.
    pub gyroscope_bias: Option<(Vector3<f64>, Matrix3<f64>)>,
    /// Position in the world frame, m, where it is estimated and a first one has come.
    pub position: Option<Vector3<f64>>,
    /// Velocity in the world frame, m/s, where it is estimated.
    pub velocity: Option<Vector3<f64>>,
    /// The reference where it has a sample at this very instant; all of them are told as [`ScoredRecord`].
    pub reference: Option<Reference>,
    /// The newest orientation that the device itself reported.
    pub device: Option<UnitQuaternion<f64>>,
}

impl EstimateRecord {
    /// In the axes of ROS: the world east, north, up; the body as the recording has it.
    #[must_use]
    pub fn pose(&self, world: WorldFrame) -> PoseEstimate {
        let is_down = world == WorldFrame::Ned;
        let turn = match is_down {
            true => enu_from_ned_rotation(),
            false => UnitQuaternion::identity(),
        };
        let vector = |v: Vector3<f64>| if is_down { enu_from_ned(&v) } else { v };
        let attitude = turn * self.attitude;
        let covariance = self.attitude_covariance.as_ref();
        let about_world = covariance.map(|p| covariance_in_reference(&attitude, p));
        PoseEstimate {
            time_ns: self.time_ns,
            attitude: Some((attitude, about_world)),
            position: self.position.map(|p| (vector(p), None)),
            velocity: self.velocity.map(|v| (vector(v), None)),
            ..PoseEstimate::default()
        }
    }
}

/// One measurement and what it told.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InnovationRecord {
    /// Time stamp of the recording, ns.
    pub time_ns: i64,
    /// Seconds since the first sample of the recording.
    pub time_s: f64,
    /// The sensor.
    pub sensor: SensorKind,
    /// What it told.
    pub innovation: Innovation<f64>,
}

/// A measured position and what it told.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PositionRecord {
    /// Time stamp of the recording, ns: when the position was true.
    pub time_ns: i64,
    /// Seconds since the first sample of the recording.
    pub time_s: f64,
    /// The position, world frame, m.
    pub measured: Vector3<f64>,
    /// What it told: measured minus estimated, m, without a statement about its covariance.
    pub innovation: Innovation<f64>,
}

observers! {
    /// Something that watches a run. Every method has an empty default.
    pub trait RunObserver {
        /// The estimate at a gyroscope sample, in time order.
        tells estimate(record: &EstimateRecord);

        /// A reference sample and the estimate at its instant, in time order; also those that do not count in scores.
        tells scored(record: &ScoredRecord);

        /// An accelerometer or magnetometer sample, in time order; also those that were refused or
        /// skipped. A smoothed run tells the filter's innovations first and then the estimates.
        tells innovation(record: &InnovationRecord);

        /// A position, where the estimator uses them; also those that were refused or skipped, but not those
        /// of a calibration at rest.
        tells position(record: &PositionRecord);
    }
}

/// Watches nothing.
impl RunObserver for () {}

/// Keeps what plots need, thinned so that memory stays bounded.
#[derive(Debug, Clone)]
pub struct TraceObserver {
    trace: Trace,
    frame: TangentFrame,
}

impl TraceObserver {
    /// Keeps at most `capacity` points a series; `frame` is the one of the recording.
    #[must_use]
    pub fn new(capacity: usize, frame: WorldFrame) -> Self {
        Self {
            trace: Trace::new(capacity),
            frame: tangent_frame(frame),
        }
    }

    /// What was kept so far.
    #[must_use]
    pub fn trace(&self) -> &Trace {
        &self.trace
    }

    /// What was kept.
    #[must_use]
    pub fn into_trace(self) -> Trace {
        self.trace
    }
}

impl RunObserver for TraceObserver {
    fn estimate(&mut self, record: &EstimateRecord) {
        let frame = self.frame;
        self.trace.points.push(|| trace_point(record, frame));
    }

    fn scored(&mut self, record: &ScoredRecord) {
        let frame = self.frame;
        self.trace.scored.push(|| {
            trace_point(
                &EstimateRecord {
                    time_ns: record.time_ns,
                    time_s: record.time_s,
                    attitude: record.attitude,
                    attitude_covariance: record.attitude_covariance,
                    gyroscope_bias: None,
                    position: None,
                    velocity: None,
                    reference: Some(record.reference),
                    device: None,
                },
                frame,
            )
        });
    }

    fn position(&mut self, record: &PositionRecord) {
        let outcome = record.innovation.outcome;
        if matches!(outcome, Outcome::Skipped(_)) {
            return;
        }
        let frame = self.frame;
        self.trace.positions.push(|| PositionPoint {
            time_s: record.time_s,
            measured_m: east_north_up(frame, &record.measured),
            residual_m: east_north_up(frame, &record.innovation.residual),
            outcome,
        });
    }

    fn innovation(&mut self, record: &InnovationRecord) {
        let series = self
            .trace
            .innovations
            .iter_mut()
            .find(|(kind, _)| *kind == record.sensor);
        if let Some((_, points)) = series
            && record.innovation.degrees_of_freedom > 0
        {
            points.push(|| InnovationPoint {
                time_s: record.time_s,
                residual: record.innovation.residual.into(),
                std: record.innovation.residual_std().into(),
                nis: record.innovation.nis,
                degrees_of_freedom: record.innovation.degrees_of_freedom,
                outcome: record.innovation.outcome,
            });
        }
    }
}

fn east_north_up(frame: TangentFrame, v: &Vector3<f64>) -> [f64; 3] {
    match frame {
        TangentFrame::Enu => (*v).into(),
        TangentFrame::Ned => enu_from_ned(v).into(),
    }
}

fn trace_point(record: &EstimateRecord, frame: TangentFrame) -> TracePoint {
    let angles = |q: &UnitQuaternion<f64>| rotation::to_yaw_pitch_roll(q).map(f64::to_degrees);
    let std = |m: &Matrix3<f64>| -> [f64; 3] {
        m.diagonal().map(|v| v.max(0.0).sqrt().to_degrees()).into()
    };
    let covariance = record.attitude_covariance.as_ref();
    TracePoint {
        time_s: record.time_s,
        angles_deg: angles(&record.attitude),
        angles_std_deg: covariance.map(|p| std(&angles_covariance(&record.attitude, p))),
        reference_deg: record.reference.map(|r| angles(&r.attitude)),
        device_deg: record.device.as_ref().map(angles),
        error_deg: record.reference.map(|r| {
            let e = AttitudeError::between(&record.attitude, &r.attitude);
            [e.total, e.heading, e.inclination].map(f64::to_degrees)
        }),
        error_std_deg: covariance.map(|p| {
            let std = AttitudeStd::of(&record.attitude, p);
            [std.total, std.heading, std.tilt].map(f64::to_degrees)
        }),
        bias_deg_s: record
            .gyroscope_bias
            .map(|(b, _)| b.map(f64::to_degrees).into()),
        bias_std_deg_s: record.gyroscope_bias.map(|(_, p)| std(&p)),
        position_m: record.position.map(|p| east_north_up(frame, &p)),
    }
}

/// Covariance (rad^2) of yaw, pitch and roll from that of the local error in body axes: the same
/// linear map that turns body rates into angle rates. Yaw and roll are not told apart looking
/// straight up or down; there the map is held at 0.6 degrees from it.
#[must_use]
pub fn angles_covariance(
    world_from_body: &UnitQuaternion<f64>,
    body: &Matrix3<f64>,
) -> Matrix3<f64> {
    let [_, pitch, roll] = rotation::to_yaw_pitch_roll(world_from_body);
    let (sin_roll, cos_roll) = roll.sin_cos();
    let cos_pitch = pitch.cos().max(0.01);
    let tan_pitch = pitch.sin() / cos_pitch;
    #[rustfmt::skip]
    let rates = Matrix3::new(
        0.0, sin_roll / cos_pitch, cos_roll / cos_pitch,
        0.0, cos_roll, -sin_roll,
        1.0, sin_roll * tan_pitch, cos_roll * tan_pitch,
    );
    rates * body * rates.transpose()
}

#[cfg(test)]
mod tests {
    use super::*;
    use northing_core::geometry::so3;
    use northing_core::kalman::{Outcome, SkipReason};

    /// The map against differences of the angles themselves.
    #[test]
    fn angle_deviations_are_those_of_small_turns() {
        let q = rotation::from_yaw_pitch_roll([2.0, -0.7, 0.9]);
        for axis in 0..3 {
            let mut a = Vector3::zeros();
            a[axis] = 1e-6;
            let body = a * a.transpose();
            let covariance = angles_covariance(&q, &body);
            let turned = rotation::to_yaw_pitch_roll(&(q * so3::exp(&a)));
            let before = rotation::to_yaw_pitch_roll(&q);
            for angle in 0..3 {
                let expected = (turned[angle] - before[angle]).abs();
                let got = covariance[(angle, angle)].sqrt();
                assert!((got - expected).abs() < 1e-11, "axis {axis}, angle {angle}");
            }
        }
    }

    fn record() -> EstimateRecord {
        let attitude = rotation::from_yaw_pitch_roll([0.5, 0.0, 0.0]);
        let truth = rotation::from_yaw_pitch_roll([0.4, 0.0, 0.0]);
        EstimateRecord {
            time_ns: 2_000_000_000,
            time_s: 1.5,
            attitude,
            attitude_covariance: Some(Matrix3::from_diagonal(&Vector3::new(1e-4, 4e-4, 9e-4))),
            gyroscope_bias: Some((Vector3::new(0.1, 0.0, 0.0), Matrix3::identity() * 1e-4)),
            position: None,
            velocity: None,
            reference: Some(Reference {
                attitude: truth,
                scored: true,
            }),
            device: None,
        }
    }

    #[test]
    fn a_trace_point_is_in_degrees_and_its_heading_error_is_signed() {
        let mut observer = TraceObserver::new(10, WorldFrame::Enu);
        observer.estimate(&record());
        let point = observer.trace().points.items()[0];
        approx::assert_relative_eq!(point.angles_deg[0], 0.5_f64.to_degrees(), epsilon = 1e-9);
        let [total, heading, inclination] = point.error_deg.unwrap();
        approx::assert_relative_eq!(heading, 0.1_f64.to_degrees(), epsilon = 1e-9);
        approx::assert_relative_eq!(total, heading, epsilon = 1e-9);
        assert!(inclination.abs() < 1e-9);
        let [trace, heading_std, tilt_std] = point.error_std_deg.unwrap();
        approx::assert_relative_eq!(trace, 14e-4_f64.sqrt().to_degrees(), epsilon = 1e-9);
        approx::assert_relative_eq!(heading_std, 0.03_f64.to_degrees(), epsilon = 1e-9);
        approx::assert_relative_eq!(tilt_std, 5e-4_f64.sqrt().to_degrees(), epsilon = 1e-9);
        approx::assert_relative_eq!(point.bias_deg_s.unwrap()[0], 0.1_f64.to_degrees());
        assert_eq!(point.device_deg, None);
    }

    #[test]
    fn skipped_samples_have_no_place_in_a_plot_of_innovations() {
        let mut observer = TraceObserver::new(10, WorldFrame::Enu);
        let fused = crate::statistics::nis::tests::innovation(Vector3::x(), Outcome::Fused);
        for innovation in [fused, Innovation::skipped(SkipReason::NotFinite)] {
            observer.innovation(&InnovationRecord {
                time_ns: 0,
                time_s: 0.0,
                sensor: SensorKind::Accelerometer,
                innovation,
            });
        }
        let (kind, points) = &observer.into_trace().innovations[0];
        assert_eq!(
            (*kind, points.items().len()),
            (SensorKind::Accelerometer, 1)
        );
    }
}
