//! What a page draws of one device: a frame, and the state of the device.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use northing_core::attitude::AttitudeEstimator;
use northing_core::calibration::magnetometer::MagnetometerCalibration;
use northing_core::geometry::rotation;
use northing_core::kalman::Innovation;
use northing_evaluation::EstimatorKind;
use northing_evaluation::attitude::kinds::AnyEstimator;
use northing_evaluation::attitude::observer::angles_covariance;
use northing_recording::SensorKind;
use serde::Serialize;

use super::aids::{STOPPED_S, SensorStatus};
use super::bounded_velocity::Surroundings;
use super::raw::Series;
use super::subject::TruthError;
use super::{DeviceSession, health};
use northing_evaluation::statistics::lamp::{Lamp, Remark};

/// One estimator's estimate.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Estimate {
    /// `world_from_body`: w, x, y, z with w >= 0.
    pub q: [f64; 4],
    /// Standard deviation of yaw, pitch, roll, deg.
    pub std_deg: Option<[f64; 3]>,
    /// Yaw, pitch, roll, deg.
    pub angles_deg: [f64; 3],
    /// Gyroscope bias, deg/s, where it is estimated.
    pub bias_deg_s: Option<[f64; 3]>,
    /// Its standard deviation, deg/s.
    pub bias_std_deg_s: Option<[f64; 3]>,
    /// Covariance of the attitude error, body axes, deg^2, rows first; null without a covariance.
    pub covariance_deg2: Option<[[f64; 3]; 3]>,
    /// What the bounded-velocity filter knows beside it.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(test, ts(optional))]
    pub surroundings: Option<Surroundings>,
}

/// The truth, where it is known.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct TruthPose {
    /// `world_from_body`: w, x, y, z with w >= 0.
    pub q: [f64; 4],
    /// How far the subject is from it; `None` while the subject aligns itself.
    pub error: Option<TruthError>,
}

/// One measurement and what the subject made of it.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct InnovationPoint {
    /// The sensor.
    pub sensor: SensorKind,
    /// Seconds since the device's first sample.
    pub t_s: f64,
    /// Measured minus predicted, body axes, in the sensor's unit.
    pub residual: [f64; 3],
    /// Its standard deviation as the filter expects it.
    pub std: [f64; 3],
    /// Normalised innovation squared.
    pub nis: f64,
    /// Degrees of freedom; 0 when skipped.
    pub dof: u8,
    /// `fused`, `inflated`, `gated` or `skipped`.
    #[cfg_attr(test, ts(type = "\"fused\" | \"inflated\" | \"gated\" | \"skipped\""))]
    pub outcome: &'static str,
    /// Kalman gain in the space of the measurement, `H P H^T S^-1`, mean over the two directions that a vector shows:
    /// 1 follows the sample, 0 the prediction; null where the estimator is not of this form.
    pub gain: Option<f64>,
}

impl InnovationPoint {
    /// The point of one innovation.
    #[must_use]
    pub fn new(sensor: SensorKind, t_s: f64, innovation: &Innovation<f64>) -> Self {
        Self {
            gain: None,
            sensor,
            t_s,
            residual: innovation.residual.into(),
            std: innovation.residual_std().into(),
            nis: innovation.nis,
            dof: innovation.degrees_of_freedom,
            outcome: innovation.outcome.name(),
        }
    }
}

/// What a page draws of one device at one moment.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Frame {
    /// The device.
    pub device: String,
    /// Seconds since the device's first sample.
    pub t_s: f64,
    /// The estimator that innovations and lamps are about; `None` while none runs.
    pub subject: Option<EstimatorKind>,
    /// Estimates by name of the estimator.
    pub estimates: BTreeMap<&'static str, Estimate>,
    /// The truth, where it is known.
    pub truth: Option<TruthPose>,
    /// Angles between pairs of estimates, deg, keys such as `mekf|integration`; the subject comes first.
    pub between_deg: BTreeMap<String, f64>,
    /// The last angular rate as measured, rad/s.
    pub rate_rad_s: [f64; 3],
    /// Samples of gyroscope (rad/s), accelerometer (m/s^2) and magnetometer (microtesla) since the last frame: seconds since
    /// the device's first sample, x, y, z. Only for pages that watch this device.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    #[cfg_attr(test, ts(as = "Option<_>", optional))]
    pub samples: Series,
    /// Innovations of the subject since the last frame.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub innovations: Vec<InnovationPoint>,
    /// Whether the stated noise of each sensor fits.
    pub lamp: Vec<Lamp>,
}

/// How a device is.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct SessionStatus {
    /// In words, the worst first.
    pub health: Vec<Remark>,
    /// Samples a second of each sensor.
    pub rates_hz: BTreeMap<&'static str, f64>,
    /// Smallest step of sensors with coarse values, in the sensor's unit.
    pub resolution: BTreeMap<&'static str, f64>,
    /// Samples received.
    pub received: u64,
    /// Samples whose stamp repeated the one before.
    pub duplicated: u64,
    /// Samples refused: not finite or absurd.
    pub refused: u64,
    /// Samples that were too late for the live estimate.
    pub late: u64,
    /// Seconds from the first to the newest sample.
    pub duration_s: f64,
    /// The estimators that run, by name.
    pub estimators: Vec<EstimatorKind>,
    /// The one of them that lamps, innovations, results and reports are about.
    pub subject: Option<EstimatorKind>,
    /// The sensors that estimators can use.
    pub sensors: Vec<SensorStatus>,
    /// Whether a calibration at rest is under way.
    pub is_calibrating: bool,
    /// Whether an experiment is under way.
    pub is_experimenting: bool,
    /// Whether a magnetometer calibration is under way.
    pub is_turned: bool,
    /// Whether a calibration at rest is in force.
    pub is_calibrated: bool,
    /// The magnetometer calibration in force.
    #[cfg_attr(test, ts(as = "Option<crate::to_page::MagnetometerFit>"))]
    pub magnetometer: Option<MagnetometerCalibration<f64>>,
}

fn estimate(
    q: &UnitQuaternion<f64>,
    covariance: Option<Matrix3<f64>>,
    bias: Option<(Vector3<f64>, Matrix3<f64>)>,
) -> Estimate {
    let std = |p: Matrix3<f64>| -> [f64; 3] {
        let angles = angles_covariance(q, &p);
        angles
            .diagonal()
            .map(|v| v.max(0.0).sqrt().to_degrees())
            .into()
    };
    Estimate {
        q: rotation::to_wxyz(q),
        std_deg: covariance.map(std),
        angles_deg: rotation::to_yaw_pitch_roll(q).map(f64::to_degrees),
        bias_deg_s: bias.map(|(b, _)| b.map(f64::to_degrees).into()),
        bias_std_deg_s: bias.map(|(_, p)| {
            let std = p.diagonal().map(|v| v.max(0.0).sqrt().to_degrees());
            std.into()
        }),
        covariance_deg2: covariance.map(|p| {
            let scale = 1_f64.to_degrees().powi(2);
            [0, 1, 2].map(|i| [0, 1, 2].map(|j| p[(i, j)] * scale))
        }),
        surroundings: None,
    }
}

impl DeviceSession {
    /// Estimates by name, the device's own orientation included.
    #[must_use]
    pub fn estimates(&self) -> BTreeMap<&'static str, Estimate> {
        let mut estimates = BTreeMap::new();
        for track in self.tracks.iter().filter(|t| t.driver.is_started()) {
            let estimator = track.driver.estimator();
            let bias = estimator.gyroscope_bias();
            let q = estimator.attitude();
            let covariance = estimator.attitude_covariance();
            let mut estimate = estimate(&q, covariance, bias);
            if let AnyEstimator::BoundedVelocity(filter) = estimator {
                estimate.surroundings = Some(Surroundings::of(filter.state()));
            }
            estimates.insert(track.kind.name(), estimate);
        }
        if let Some(q) = &self.device {
            estimates.insert("device", estimate(q, None, None));
        }
        estimates
    }

    /// The attitude of one running estimator.
    #[must_use]
    pub fn attitude(&self, name: &str) -> Option<UnitQuaternion<f64>> {
        let track = self.tracks.iter().find(|t| t.kind.name() == name)?;
        track.driver.attitude()
    }

    /// The next frame. It takes the innovations gathered since the last one.
    pub fn frame(&mut self, device: &str) -> Frame {
        Frame {
            device: device.to_owned(),
            t_s: self.duration_s(),
            subject: self.subject(),
            estimates: self.estimates(),
            truth: self.truth.map(|q| TruthPose {
                q: rotation::to_wxyz(&q),
                error: self.judged.truth.clone(),
            }),
            between_deg: self.between_deg(),
            rate_rad_s: self.rate_rad_s.into(),
            samples: self.raw.take(),
            innovations: self.judged.take_innovations(),
            lamp: self.lamps(),
        }
    }

    fn between_deg(&self) -> BTreeMap<String, f64> {
        let mut poses: Vec<(&str, UnitQuaternion<f64>)> = Vec::new();
        for track in &self.tracks {
            if let Some(q) = track.driver.attitude() {
                poses.push((track.kind.name(), q));
            }
        }
        poses.extend(self.device.map(|q| ("device", q)));
        poses.extend(self.truth.map(|q| ("truth", q)));
        // The subject first: it is what the others are compared with.
        let subject = self.subject().map(EstimatorKind::name);
        poses.sort_by_key(|(name, _)| Some(*name) != subject);
        let mut angles = BTreeMap::new();
        for (i, (a, p)) in poses.iter().enumerate() {
            for (b, q) in &poses[i + 1..] {
                let angle = rotation::angle_between(p, q).to_degrees();
                angles.insert(format!("{a}|{b}"), angle);
            }
        }
        angles
    }

    /// How the device is.
    #[must_use]
    pub fn status(&self, lost_batches: u64) -> SessionStatus {
        let intake = &self.intake;
        let stopped = intake.stopped(self.now_ns, STOPPED_S);
        SessionStatus {
            health: health::remarks(intake, &stopped, self.options.sensors.compass, lost_batches),
            rates_hz: intake.rates_hz().map(|(k, v)| (k.name(), v)).collect(),
            resolution: intake.resolutions().map(|(k, v)| (k.name(), v)).collect(),
            received: intake.received(),
            duplicated: intake.duplicated(),
            refused: intake.refused(),
            late: intake.late(),
            duration_s: self.duration_s(),
            estimators: self.estimators(),
            subject: self.subject(),
            sensors: self.sensors(),
            is_calibrating: self.calibration.is_some(),
            is_experimenting: self.experiment.is_some(),
            is_turned: self.magnetometer_run.is_some(),
            is_calibrated: self.options.calibration.is_some(),
            magnetometer: self.magnetometer,
        }
    }
}
