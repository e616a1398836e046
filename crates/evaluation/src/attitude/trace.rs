//! Trace of a run for plots, thinned as it grows so that memory stays bounded.

use northing_core::kalman::Outcome;
use northing_recording::SensorKind;

use crate::statistics::thinned::Thinned;

/// The estimate at one instant. Angles in degrees: heading, pitch, roll of the aerospace order
/// (yaw, pitch, roll) in the recording's world frame.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct TracePoint {
    /// Seconds since the first sample of the recording.
    pub time_s: f64,
    /// Yaw, pitch, roll of the estimate, deg.
    pub angles_deg: [f64; 3],
    /// Standard deviation of each of those angles, deg; `None` for estimators without covariance.
    pub angles_std_deg: Option<[f64; 3]>,
    /// Yaw, pitch, roll of the reference, deg.
    pub reference_deg: Option<[f64; 3]>,
    /// Yaw, pitch, roll of the device's own orientation, deg.
    pub device_deg: Option<[f64; 3]>,
    /// Total, heading and inclination error against the reference, deg (heading is signed).
    pub error_deg: Option<[f64; 3]>,
    /// Predicted standard deviation of the total error (root of the covariance's trace), of the heading error, and of the
    /// inclination error (root of the sum of two variances), deg.
    pub error_std_deg: Option<[f64; 3]>,
    /// Gyroscope bias estimate, deg/s, body axes.
    pub bias_deg_s: Option<[f64; 3]>,
    /// Its standard deviation, deg/s.
    pub bias_std_deg_s: Option<[f64; 3]>,
    /// Estimated position, east, north, up, m.
    pub position_m: Option<[f64; 3]>,
}

impl TracePoint {
    /// The same with the constant part of the heading error taken out, deg: out of the errors, and of the reference, which
    /// is turned to where the estimate counts its heading from.
    #[must_use]
    pub fn without_heading_offset(mut self, offset_deg: f64) -> Self {
        let wrapped = |angle: f64| angle - 360.0 * (angle / 360.0).round();
        if let Some([yaw, ..]) = &mut self.reference_deg {
            *yaw = wrapped(*yaw + offset_deg);
        }
        if let Some([total, heading, inclination]) = &mut self.error_deg {
            *heading = wrapped(*heading - offset_deg);
            let half = |angle: f64| (0.5 * angle.to_radians()).cos();
            let cosine = (half(*heading) * half(*inclination)).clamp(-1.0, 1.0);
            *total = (2.0 * cosine.acos()).to_degrees();
        }
        self
    }
}

/// One measured position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PositionPoint {
    /// When it was true, seconds since the first sample of the recording.
    pub time_s: f64,
    /// The position, east, north, up, m.
    pub measured_m: [f64; 3],
    /// Measured minus estimated, east, north, up, m.
    pub residual_m: [f64; 3],
    /// What was done with it.
    pub outcome: Outcome,
}

/// One innovation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InnovationPoint {
    /// Seconds since the first sample of the recording.
    pub time_s: f64,
    /// Measured minus predicted (m/s^2, microtesla, or rad for a heading).
    pub residual: [f64; 3],
    /// What the filter expected: square roots of the diagonal of S.
    pub std: [f64; 3],
    /// Normalised innovation squared.
    pub nis: f64,
    /// Components measured: 3, or 1 for a heading.
    pub degrees_of_freedom: u8,
    /// What was done with it.
    pub outcome: Outcome,
}

/// What plots need of one run.
#[derive(Debug, Clone)]
pub struct Trace {
    /// Estimates over time.
    pub points: Thinned<TracePoint>,
    /// The estimate at the instants of the reference, with reference and error.
    pub scored: Thinned<TracePoint>,
    /// Innovations of each sensor that was updated with.
    pub innovations: Vec<(SensorKind, Thinned<InnovationPoint>)>,
    /// Measured positions, where the estimator looked at them.
    pub positions: Thinned<PositionPoint>,
}

impl Trace {
    /// An empty trace that keeps at most `capacity` points a series.
    #[must_use]
    pub fn new(capacity: usize) -> Self {
        let series = |kind| (kind, Thinned::new(capacity));
        Self {
            points: Thinned::new(capacity),
            scored: Thinned::new(capacity),
            innovations: vec![
                series(SensorKind::Accelerometer),
                series(SensorKind::Magnetometer),
            ],
            positions: Thinned::new(capacity),
        }
    }

    /// The points with a reference: of the estimates where the two share their instants, otherwise those at the
    /// reference's own. `heading_offset_deg` is taken out where it is given.
    #[must_use]
    pub fn against_reference(&self, heading_offset_deg: Option<f64>) -> Vec<TracePoint> {
        let shared = self.points.items().iter();
        let shared = shared.filter(|point| point.reference_deg.is_some()).count();
        let points = if 2 * shared >= self.scored.items().len() {
            &self.points
        } else {
            &self.scored
        };
        let one = |point: &TracePoint| match heading_offset_deg {
            Some(offset) => point.without_heading_offset(offset),
            None => *point,
        };
        points.items().iter().map(one).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::metrics::AttitudeError;
    use northing_core::geometry::rotation;

    /// The errors of the turned reference are those that the metric finds against it.
    #[test]
    fn an_offset_of_the_heading_is_taken_out_of_errors_and_reference() {
        let turn = |deg: [f64; 3]| rotation::from_yaw_pitch_roll(deg.map(f64::to_radians));
        let (estimate, reference) = ([150.0, 10.0, -20.0], [60.0, 7.0, -25.0]);
        let error = |reference: [f64; 3]| {
            let e = AttitudeError::between(&turn(estimate), &turn(reference));
            [e.total, e.heading, e.inclination].map(f64::to_degrees)
        };
        let point = TracePoint {
            angles_deg: estimate,
            reference_deg: Some(reference),
            error_deg: Some(error(reference)),
            ..TracePoint::default()
        };
        let aligned = point.without_heading_offset(88.0);
        let turned = aligned.reference_deg.unwrap();
        assert!((turned[0] - 148.0).abs() < 1e-9, "{turned:?}");
        for (got, expected) in aligned.error_deg.unwrap().iter().zip(error(turned)) {
            assert!((got - expected).abs() < 1e-9, "{got} for {expected}");
        }
    }

    #[test]
    fn the_series_with_the_reference_is_the_one_drawn_against_it() {
        let at = |time_s: f64, reference: bool| TracePoint {
            time_s,
            reference_deg: reference.then_some([0.0; 3]),
            ..TracePoint::default()
        };
        let mut trace = Trace::new(100);
        for k in 0..20_u32 {
            trace.points.push(|| at(f64::from(k), k % 10 == 0));
            trace.scored.push(|| at(f64::from(k) + 0.5, true));
        }
        assert!((trace.against_reference(None)[0].time_s - 0.5).abs() < 1e-12);
        let mut shared = Trace::new(100);
        shared.points.push(|| at(1.0, true));
        shared.points.push(|| at(2.0, false));
        shared.scored.push(|| at(1.0, true));
        assert_eq!(shared.against_reference(None).len(), 2);
    }
}
