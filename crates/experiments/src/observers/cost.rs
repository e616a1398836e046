//! Nanoseconds per step of each scheme: timed in turns on this machine, so that only ratios travel.

use std::hint::black_box;
use std::time::Instant;

use northing_core::attitude::AttitudeEstimator;
use northing_core::attitude::complementary::{Complementary, ComplementaryForm};
use northing_core::attitude::ekf_reconstruction::EkfReconstruction;
use northing_core::attitude::quaternion_ekf::QuaternionEkf;
use northing_core::navigation::cascade::{Cascade, CascadeConfig};
use northing_simulation::world::specific_force_at_rest;
use serde::Serialize;

use super::data::ObserverData;
use super::schemes::{Form, Gains, settings};
use northing_evaluation::EvaluationError;

/// Rounds of all kernels; the least time of each counts.
const ROUNDS: usize = 9;

/// Nanoseconds per step, one gyroscope sample with a sample of each sensor that is used.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Cost {
    /// Explicit complementary filter.
    pub original: f64,
    /// Passive filter behind the quaternion EKF.
    pub modified: f64,
    /// The quaternion EKF alone.
    pub ekf: f64,
    /// The original with the position observer behind it; where there are positions.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cascade: Option<f64>,
    /// The modified with the position observer behind it; where there are positions.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cascade_ekf: Option<f64>,
}

/// Times the schemes over `data`.
///
/// # Errors
/// The gains are invalid.
pub fn measure(data: &ObserverData, gains: &Gains) -> Result<Cost, EvaluationError> {
    let config = settings(data, gains, Form::Northing);
    let start = data.initial_state();
    let mut explicit = Complementary::new(ComplementaryForm::Explicit, config)?;
    let mut passive = EkfReconstruction::new(config)?;
    let mut ekf = QuaternionEkf::new(config)?;
    explicit.initialize(&start);
    passive.initialize(&start);
    ekf.initialize(&start);
    let mut least = [f64::INFINITY; 5];
    for _ in 0..ROUNDS {
        let times = [
            time(data, explicit, false),
            time(data, passive, false),
            time(data, ekf, false),
            time(data, explicit, true),
            time(data, passive, true),
        ];
        for (least, time) in least.iter_mut().zip(times) {
            *least = least.min(time);
        }
    }
    let [original, modified, ekf, cascade, cascade_ekf] = least;
    let with_positions = |ns: f64| data.position.as_ref().map(|_| ns);
    Ok(Cost {
        original,
        modified,
        ekf,
        cascade: with_positions(cascade),
        cascade_ekf: with_positions(cascade_ekf),
    })
}

fn time(data: &ObserverData, mut filter: impl AttitudeEstimator<f64>, with_position: bool) -> f64 {
    let config = CascadeConfig::lab();
    let position = data.position.as_ref().filter(|_| with_position);
    let mut observer = Cascade::new(config, specific_force_at_rest()).ok();
    let mut fixes = position.map_or(&[][..], |p| &p.measured).iter().peekable();
    let begun = Instant::now();
    for (k, rate) in data.angular_rate.iter().enumerate() {
        filter.propagate(rate, data.interval_s);
        filter.update_accelerometer(&data.specific_force[k]);
        if let Some(field) = data.magnetic_field.get(k) {
            filter.update_magnetometer(field);
        }
        if let (Some(observer), Some(_)) = (&mut observer, position) {
            let attitude = filter.attitude();
            let _ = observer.propagate(&attitude, &data.specific_force[k], data.interval_s);
            if let Some((_, fix)) = fixes.next_if(|(index, _)| *index == k) {
                let rate = rate - filter.rate_at_rest();
                observer.update_position(fix, 0.0, &attitude, &rate);
            }
        }
    }
    let elapsed = begun.elapsed();
    black_box((filter.attitude(), observer));
    elapsed.as_secs_f64() * 1e9 / data.angular_rate.len().max(1) as f64
}
