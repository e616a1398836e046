//! One flight of a scenario: truth and samples, drawn from file, seed and run number.

use nalgebra::{UnitQuaternion, Vector3};

use super::flight_schema::FlightScenario;
use crate::random::{normal_vector, run_seed, stream};
use crate::rotation::exp;
use crate::sensors::{ErrorModel, SensorErrors};
use crate::trajectory::{Flight, Spin, Trajectory, Truth, mean_rate};
use crate::world::magnetic_field_ut;

/// What a flight was, and what was measured on it. Sample `k` stands for the end of the interval `k`.
#[derive(Debug, Clone, PartialEq)]
pub struct FlightRun {
    /// From one sample to the next, s.
    pub interval_s: f64,
    /// Truth at the start.
    pub start: Truth,
    /// What the observers are told of it, `world_from_body`.
    pub start_attitude: UnitQuaternion<f64>,
    /// Position at the start as measured, m.
    pub start_position: Vector3<f64>,
    /// Truth at each sample.
    pub truth: Vec<Truth>,
    /// Mean angular rate since the last sample, rad/s, body axes.
    pub angular_rate: Vec<Vector3<f64>>,
    /// Specific force, m/s^2, body axes.
    pub specific_force: Vec<Vector3<f64>>,
    /// Magnetic field, microtesla, body axes; empty without a magnetometer.
    pub magnetic_field: Vec<Vector3<f64>>,
    /// Positions with the index of the sample they belong to, m.
    pub positions: Vec<(usize, Vector3<f64>)>,
    /// The accelerometer's bias, m/s^2.
    pub accelerometer_bias: Vector3<f64>,
    /// The undisturbed field, microtesla, east, north, up.
    pub reference_field: Vector3<f64>,
}

impl FlightRun {
    /// The run of this number under a seed: the same whoever asks for it.
    #[must_use]
    pub fn simulate(scenario: &FlightScenario, campaign_seed: u64, number: u64) -> Self {
        let seed = run_seed(campaign_seed, number);
        let motion = motion(scenario, seed);
        let rate_hz = scenario.gyroscope.rate_hz;
        let interval_s = 1.0 / rate_hz;
        let count = (scenario.meta.duration_s * rate_hz).round() as usize;
        let sensor = |name: &str, model: &ErrorModel| SensorErrors::new(seed, name, model, rate_hz);
        let mut gyroscope = sensor("gyroscope", &gyroscope_errors(scenario));
        let mut accelerometer = sensor("accelerometer", &accelerometer_errors(scenario));
        let mut magnetometer = sensor(
            "magnetometer",
            &ErrorModel {
                noise_std: scenario.magnetometer.noise_std_ut,
                ..ErrorModel::default()
            },
        );
        let mut fixes = stream(seed, "position");
        let mut measured = |truth: &Truth| {
            truth.position + normal_vector(&mut fixes, scenario.position.noise_std_m)
        };
        let field = &scenario.magnetometer;
        let reference_field = magnetic_field_ut(field.strength_ut, field.dip_deg);
        let start = motion.at(0.0);
        let mut run = Self {
            interval_s,
            start,
            start_attitude: start.world_from_body * start_error(scenario, seed),
            start_position: measured(&start),
            truth: Vec::with_capacity(count),
            angular_rate: Vec::with_capacity(count),
            specific_force: Vec::with_capacity(count),
            magnetic_field: Vec::new(),
            positions: Vec::new(),
            accelerometer_bias: accelerometer.bias(),
            reference_field,
        };
        let mut before = start.world_from_body;
        for k in 1..=count {
            let t_s = k as f64 * interval_s;
            let truth = motion.at(t_s);
            let rate = mean_rate(&before, &truth.world_from_body, interval_s);
            before = truth.world_from_body;
            run.angular_rate.push(gyroscope.measure(&rate));
            let force = accelerometer.measure(&truth.specific_force_body());
            run.specific_force.push(force);
            if field.used {
                let burst = t_s % field.burst_period_s > field.burst_period_s * 2.0 / 3.0;
                let east = if burst { field.burst_ut } else { 0.0 };
                let world = reference_field + Vector3::new(east, 0.0, 0.0);
                let body = truth.world_from_body.inverse() * world;
                run.magnetic_field.push(magnetometer.measure(&body));
            }
            if k % scenario.position.every_samples as usize == 0 {
                run.positions.push((k - 1, measured(&truth)));
            }
            run.truth.push(truth);
        }
        run
    }
}

fn motion(scenario: &FlightScenario, seed: u64) -> Box<dyn Trajectory> {
    let motion = &scenario.motion;
    if motion.spin_rad_s.abs() > 0.0 {
        return Box::new(Spin {
            rate_rad_s: motion.spin_rad_s,
        });
    }
    let mut drawn = stream(seed, "motion");
    let rms = motion.acceleration_rms_m_s2;
    Box::new(Flight::random(&mut drawn, motion.attitude, rms))
}

fn gyroscope_errors(scenario: &FlightScenario) -> ErrorModel {
    ErrorModel {
        noise_std: scenario.gyroscope.noise_std_rad_s,
        bias_std: scenario.gyroscope.bias_std_rad_s,
        bias_random_walk: scenario.gyroscope.bias_random_walk_rad_s_sqrt_s,
        ..ErrorModel::default()
    }
}

fn accelerometer_errors(scenario: &FlightScenario) -> ErrorModel {
    ErrorModel {
        noise_std: scenario.accelerometer.noise_std_m_s2,
        bias_std: scenario.accelerometer.bias_std_m_s2,
        ..ErrorModel::default()
    }
}

/// A turn by the angle of the scenario about an axis that is drawn.
fn start_error(scenario: &FlightScenario, seed: u64) -> UnitQuaternion<f64> {
    let axis = normal_vector(&mut stream(seed, "start"), 1.0);
    exp(&(axis.normalize() * scenario.start.attitude_error_deg.to_radians()))
}

#[cfg(test)]
mod tests {
    use super::super::FlightScenarioFile;
    use super::*;

    fn scenario(variant: &str) -> FlightScenario {
        let text = include_str!("../../../../scenarios/observers/cascade.toml");
        let file = FlightScenarioFile::parse("cascade.toml", text).unwrap();
        file.scenario(Some(variant)).unwrap()
    }

    #[test]
    fn a_run_is_determined_by_seed_and_number() {
        let scenario = scenario("free-1.5");
        let run = FlightRun::simulate(&scenario, 1, 3);
        assert_eq!(run, FlightRun::simulate(&scenario, 1, 3));
        assert_ne!(
            run.angular_rate,
            FlightRun::simulate(&scenario, 1, 4).angular_rate
        );
        assert_ne!(
            run.angular_rate,
            FlightRun::simulate(&scenario, 2, 3).angular_rate
        );
    }

    #[test]
    fn samples_are_truth_and_the_noise_that_was_asked_for() {
        let scenario = scenario("free-1.5");
        let run = FlightRun::simulate(&scenario, 1, 0);
        assert_eq!(run.truth.len(), 12_000);
        assert_eq!(run.positions.len(), 1200);
        let n = run.truth.len() as f64;
        let force: f64 = run
            .truth
            .iter()
            .zip(&run.specific_force)
            .map(|(t, f)| {
                (f - t.specific_force_body() - run.accelerometer_bias).norm_squared() / 3.0
            })
            .sum();
        assert!(((force / n).sqrt() / 0.05 - 1.0).abs() < 0.03);
        let field: f64 = run
            .truth
            .iter()
            .zip(&run.magnetic_field)
            .map(|(t, m)| (t.world_from_body * m - run.reference_field).norm_squared() / 3.0)
            .sum();
        assert!(((field / n).sqrt() / 0.6 - 1.0).abs() < 0.03);
        let fixes: f64 = run
            .positions
            .iter()
            .map(|(k, p)| (p - run.truth[*k].position).norm_squared() / 3.0)
            .sum();
        assert!(((fixes / 1200.0).sqrt() / 0.1 - 1.0).abs() < 0.05);
    }

    #[test]
    fn bursts_disturb_a_third_of_the_time_and_the_start_is_off_as_asked() {
        let bursts = FlightRun::simulate(&scenario("magnetic-bursts"), 1, 0);
        let disturbed = bursts
            .truth
            .iter()
            .zip(&bursts.magnetic_field)
            .filter(|(t, m)| (t.world_from_body * **m).x > 10.0);
        let share = disturbed.count() as f64 / bursts.truth.len() as f64;
        assert!((share - 1.0 / 3.0).abs() < 0.001, "{share}");
        let startup = FlightRun::simulate(&scenario("start-up"), 1, 0);
        let off = startup
            .start
            .world_from_body
            .angle_to(&startup.start_attitude);
        assert!((off.to_degrees() - 60.0).abs() < 1e-9, "{off}");
    }
}
