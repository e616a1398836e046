//! The three schemes, run over data: original, modified, EKF alone, each with the same position observer.

use nalgebra::{UnitQuaternion, Vector3};
use northing_core::attitude::complementary::{Complementary, ComplementaryForm};
use northing_core::attitude::quaternion_ekf::QuaternionEkf;
use northing_core::attitude::{
    AttitudeConfig, AttitudeEstimator as _, MagnetometerUse, QuaternionNorm,
};
use northing_core::navigation::cascade::{Cascade, CascadeConfig};
use northing_simulation::scenario::flight_schema::Metric;
use northing_simulation::world::specific_force_at_rest;
use serde::Serialize;

use super::data::{ObserverData, PositionData};
use northing_evaluation::EvaluationError;
use northing_evaluation::statistics::metrics::AttitudeError;

/// An error below this counts as settled, deg.
pub const SETTLED_DEG: f64 = 3.0;
/// A number that no field and no bias reaches: what it bounds is not bounded.
const UNBOUNDED: f64 = 1e3;
/// A position that no observer is off by: none counts as an outlier.
const NO_OUTLIERS_M: f64 = 1e6;

/// What is tuned.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Gains {
    /// `k_P` of the complementary filter, 1/s.
    #[serde(rename = "attitude_gain_per_s")]
    pub attitude_gain: f64,
    /// `k_I`, 1/s^2.
    #[serde(rename = "bias_gain_per_s2")]
    pub bias_gain: f64,
    /// Weight of the accelerometer in the explicit form.
    pub accelerometer_weight: f64,
    /// Accelerations that the EKF takes for errors of gravity, m/s^2 per axis.
    #[serde(rename = "linear_acceleration_std_m_s2")]
    pub linear_acceleration_std: f64,
    /// Error of the field per axis beside its noise, microtesla.
    #[serde(rename = "field_std_ut")]
    pub field_std: f64,
}

/// Whose form of the schemes runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// The literature's: a sample is compared with the estimate of the sample before, so that the
    /// observer leads by up to one interval's turn; the EKF normalises its quaternion without telling
    /// its covariance.
    Printed,
    /// Northing's: a sample is compared with the estimate of its own instant, and the EKF's covariance
    /// is projected as the quaternion is normalised.
    Northing,
}

/// Root mean square errors over what is scored.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Score {
    /// Whole attitude error, deg.
    pub total_deg: f64,
    /// Inclination error, deg.
    pub inclination_deg: f64,
    /// Heading error, deg.
    pub heading_deg: f64,
    /// Position error, m; 0 without positions.
    pub position_m: f64,
    /// Velocity error, m/s; 0 without positions.
    pub velocity_m_s: f64,
    /// When the total error went below three degrees for good, s; the end of what is scored where it
    /// did not.
    pub settled_s: f64,
}

impl Score {
    /// The error that counts.
    #[must_use]
    pub fn of(&self, metric: Metric) -> f64 {
        match metric {
            Metric::Total => self.total_deg,
            Metric::Inclination => self.inclination_deg,
        }
    }
}

/// One estimate: attitude and rate without bias.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// `world_from_body`.
    pub attitude: UnitQuaternion<f64>,
    /// Angular rate without bias, rad/s.
    pub angular_rate: Vector3<f64>,
}

/// The settings that data and gains ask for. Nothing is gated: the schemes are compared, not their
/// gates.
#[must_use]
pub fn settings(data: &ObserverData, gains: &Gains, form: Form) -> AttitudeConfig<f64> {
    let noise = &data.noise;
    AttitudeConfig {
        gyroscope_noise_density: noise.rate_std * data.interval_s.sqrt(),
        gyroscope_bias_random_walk: noise.bias_random_walk,
        accelerometer_std: noise.force_std.hypot(gains.linear_acceleration_std),
        accelerometer_gate_nis: 0.0,
        magnetometer_std_ut: noise.field_std.hypot(gains.field_std).max(1e-3),
        magnetometer_gate_nis: 0.0,
        magnetometer_use: MagnetometerUse::Vector,
        quaternion_norm: match form {
            Form::Printed => QuaternionNorm::Free,
            Form::Northing => QuaternionNorm::Projected,
        },
        complementary_attitude_gain: gains.attitude_gain,
        complementary_bias_gain: gains.bias_gain,
        complementary_accelerometer_weight: gains.accelerometer_weight,
        complementary_magnetometer_weight: 1.0,
        complementary_field_tolerance: UNBOUNDED,
        complementary_bias_limit: UNBOUNDED,
        ..AttitudeConfig::lab()
    }
}

fn observer(
    form: ComplementaryForm,
    data: &ObserverData,
    gains: &Gains,
) -> Result<Complementary<f64>, EvaluationError> {
    // The fixed gains know nothing of the EKF's form.
    let mut filter = Complementary::new(form, settings(data, gains, Form::Northing))?;
    filter.initialize(&data.initial_state());
    Ok(filter)
}

/// The original: vectors straight into a complementary filter, explicit, or against TRIAD.
///
/// # Errors
/// The gains are invalid.
pub fn original(
    data: &ObserverData,
    innovation: ComplementaryForm,
    gains: &Gains,
    form: Form,
) -> Result<Vec<Estimate>, EvaluationError> {
    let mut filter = observer(innovation, data, gains)?;
    let correct = |filter: &mut Complementary<f64>, k: usize| {
        // The field first: TRIAD takes it when gravity comes.
        if let Some(field) = data.magnetic_field.get(k) {
            filter.update_magnetometer(field);
        }
        filter.update_accelerometer(&data.specific_force[k]);
    };
    let rates = data.angular_rate.iter().enumerate();
    Ok(rates
        .map(|(k, rate)| {
            let before = filter.rate_at_rest();
            if form == Form::Printed {
                correct(&mut filter, k);
            }
            filter.propagate(rate, data.interval_s);
            if form == Form::Northing {
                correct(&mut filter, k);
            }
            Estimate {
                attitude: filter.attitude(),
                angular_rate: rate - before,
            }
        })
        .collect())
}

/// The EKF alone: what the modified scheme takes for the measured rotation.
///
/// # Errors
/// The gains are invalid.
pub fn ekf(
    data: &ObserverData,
    gains: &Gains,
    form: Form,
) -> Result<Vec<Estimate>, EvaluationError> {
    let mut filter = QuaternionEkf::new(settings(data, gains, form))?;
    filter.initialize(&data.initial_state());
    let rates = data.angular_rate.iter().enumerate();
    Ok(rates
        .map(|(k, rate)| {
            filter.propagate(rate, data.interval_s);
            filter.update_accelerometer(&data.specific_force[k]);
            if let Some(field) = data.magnetic_field.get(k) {
                filter.update_magnetometer(field);
            }
            Estimate {
                attitude: filter.attitude(),
                angular_rate: rate - filter.rate_at_rest(),
            }
        })
        .collect())
}

/// The modified scheme: a passive filter that follows the rotation that the EKF reconstructed.
///
/// # Errors
/// The gains are invalid.
pub fn modified(
    data: &ObserverData,
    reconstructed: &[Estimate],
    gains: &Gains,
    form: Form,
) -> Result<Vec<Estimate>, EvaluationError> {
    let mut filter = observer(ComplementaryForm::Passive, data, gains)?;
    let mut last = data.start;
    let steps = data.angular_rate.iter().zip(reconstructed);
    Ok(steps
        .map(|(rate, now)| {
            let before = filter.rate_at_rest();
            let measured = match form {
                Form::Northing => std::mem::replace(&mut last, now.attitude),
                Form::Printed => now.attitude,
            };
            filter.follow(&measured, data.interval_s);
            filter.propagate(rate, data.interval_s);
            Estimate {
                attitude: filter.attitude(),
                angular_rate: rate - before,
            }
        })
        .collect())
}

/// The errors of estimates, position and velocity included where there are positions.
///
/// # Errors
/// The pole of the data is invalid.
pub fn score(data: &ObserverData, estimates: &[Estimate]) -> Result<Score, EvaluationError> {
    let mut squares = [0.0_f64; 3];
    let (mut count, mut settled) = (0.0_f64, 0);
    for (k, (estimate, truth)) in estimates.iter().zip(&data.truth).enumerate() {
        let Some(truth) = truth else { continue };
        let error = AttitudeError::between(&estimate.attitude, truth);
        let parts = [error.total, error.inclination, error.heading];
        for (sum, part) in squares.iter_mut().zip(parts) {
            *sum += part * part;
        }
        count += 1.0;
        if error.total.to_degrees() > SETTLED_DEG {
            settled = k + 1;
        }
    }
    let [total_deg, inclination_deg, heading_deg] =
        squares.map(|s| (s / count.max(1.0)).sqrt().to_degrees());
    let [position_m, velocity_m_s] = match &data.position {
        Some(position) => position_errors(data, position, estimates, true)?,
        None => [0.0; 2],
    };
    Ok(Score {
        total_deg,
        inclination_deg,
        heading_deg,
        position_m,
        velocity_m_s,
        settled_s: settled as f64 * data.interval_s,
    })
}

/// Root mean square errors of position (m) and velocity (m/s) of the position observer behind
/// attitude estimates, with or without its rotation-rate term.
///
/// # Errors
/// The pole is invalid.
pub fn position_errors(
    data: &ObserverData,
    position: &PositionData,
    estimates: &[Estimate],
    rotation_rate_term: bool,
) -> Result<[f64; 2], EvaluationError> {
    let config = CascadeConfig {
        pole: position.pole,
        position_std_m: NO_OUTLIERS_M,
        rotation_rate_term,
        bias_limit: UNBOUNDED,
    };
    let mut observer = Cascade::new(config, specific_force_at_rest())?;
    observer.update_position(&position.start, 0.0, &data.start, &Vector3::zeros());
    let mut fixes = position.measured.iter().peekable();
    let mut squares = [0.0_f64; 2];
    let mut count = 0.0_f64;
    for (k, estimate) in estimates.iter().enumerate() {
        let force = &data.specific_force[k];
        // What is refused leaves the state as it is, and the error grows: it shows in the score.
        let _ = observer.propagate(&estimate.attitude, force, data.interval_s);
        if let Some((_, fix)) = fixes.next_if(|(index, _)| *index == k) {
            observer.update_position(fix, 0.0, &estimate.attitude, &estimate.angular_rate);
        }
        if let (Some(state), Some(_)) = (observer.state(), data.truth[k]) {
            let (p, v) = &position.truth[k];
            squares[0] += (state.position - p).norm_squared();
            squares[1] += (state.velocity - v).norm_squared();
            count += 1.0;
        }
    }
    Ok(squares.map(|s| (s / count.max(1.0)).sqrt()))
}
