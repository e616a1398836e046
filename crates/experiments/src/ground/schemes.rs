//! Schemes that are compared: each estimates every sample of a trajectory.

use nalgebra::{UnitQuaternion, Vector3};
use northing_core::attitude::axis_filters::{
    AxisAngles, AxisFilters, AxisFiltersConfig, AxisNoise, tilt_compensated_heading, tilt_of,
};
use northing_core::navigation::aiding::gnss_position::GnssPosition;
use northing_core::navigation::aiding::gnss_velocity::GnssVelocity;
use northing_core::navigation::axis_filters::{
    PositionAxisConfig, PositionAxisFilters, PositionNoise,
};
use northing_core::navigation::gnss_ins::{GnssIns, GnssInsConfig, ImuSamples};
use northing_evaluation::named;
use northing_simulation::ground::{Ground, GroundSample, GroundSensors, RATE_HZ};

/// Samples at rest that give biases and first angles: 10 s.
const AT_REST: usize = 500;
/// The magnetometer is fused every so many samples by the error-state filter.
const EVERY_FIELD: usize = 5;
/// Standard deviation of its heading, rad.
const HEADING_STD: f64 = 0.087;

/// What is known of one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Position, m.
    pub position: Vector3<f64>,
    /// Velocity, m/s; `None` where the scheme has none.
    pub velocity: Option<Vector3<f64>>,
    /// Attitude `ned_from_body`; `None` where the scheme has none.
    pub attitude: Option<UnitQuaternion<f64>>,
}

named! {
    /// A way to make positions out of sensors.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub enum Scheme {
        /// The last fix.
        Hold = "last fix held",
        /// The last fix and the receiver's velocity since.
        HoldVelocity = "last fix and velocity",
        /// Axis filters with the noises of the paper to the letter.
        Printed = "axis filters, noises as printed",
        /// The same with the names of the deviations exchanged back.
        NamesSwapped = "axis filters, names of the noises exchanged back",
        /// The same, and the held fix taken for a new one with every sample.
        HeldFixReused = "the same, held fix taken for new",
        /// Axis filters with physical noises that fit no particular motion.
        Physical = "axis filters, physical noises, not tuned",
        /// The same, tuned to the motion.
        Tuned = "axis filters, physical noises, tuned",
        /// The same with rates of Euler angles, the exact pitch, and a gate on accelerated samples.
        TunedFixed = "the same with rates, pitch and gate put right",
        /// Error-state filter: positions and magnetometer.
        ErrorState = "error-state filter, position",
        /// Error-state filter: positions, velocities and magnetometer.
        ErrorStateVelocity = "error-state filter, position and velocity",
    }
}

impl Scheme {
    /// Runs over a way. `blind` says at which samples (from, to) fixes are held out.
    #[must_use]
    pub fn run(
        self,
        kind: Ground,
        sensors: &GroundSensors,
        way: &[GroundSample],
        blind: [usize; 2],
    ) -> Vec<Estimate> {
        let seen = |k: usize| {
            let sample = way.get(k)?;
            sample.fix.filter(|_| !(blind[0]..blind[1]).contains(&k))
        };
        match self {
            Self::Hold | Self::HoldVelocity => held(way, seen, self == Self::HoldVelocity),
            Self::ErrorState => error_state(sensors, way, seen, false),
            Self::ErrorStateVelocity => error_state(sensors, way, seen, true),
            _ => self.axis_filters(kind, sensors, way, seen),
        }
    }

    fn attitude_config(self, kind: Ground, sensors: &GroundSensors) -> AxisFiltersConfig<f64> {
        let paper = AxisFiltersConfig {
            gyroscope_std: sensors.gyroscope_std,
            angle_std: 2_f64.to_radians(),
            angles: AxisAngles::Printed,
            euler_rates: false,
            norm_gain: 0.0,
            ..AxisFiltersConfig::default()
        };
        let physical = AxisFiltersConfig {
            angle_std: 10_f64.to_radians(),
            ..paper
        };
        let tuned = match kind {
            Ground::Walk => physical,
            Ground::Drive => AxisFiltersConfig {
                angle_std: 30_f64.to_radians(),
                ..paper
            },
        };
        match self {
            Self::Printed => AxisFiltersConfig {
                noise: AxisNoise::Printed,
                ..paper
            },
            Self::NamesSwapped | Self::HeldFixReused => AxisFiltersConfig {
                noise: AxisNoise::PrintedNamesSwapped,
                ..paper
            },
            Self::Tuned => tuned,
            Self::TunedFixed => AxisFiltersConfig {
                angles: AxisAngles::Exact,
                euler_rates: true,
                norm_gain: 4.0,
                ..tuned
            },
            _ => physical,
        }
    }

    fn position_config(self, kind: Ground, sensors: &GroundSensors) -> PositionAxisConfig<f64> {
        let [horizontal, vertical] = sensors.position_std;
        let physical = PositionAxisConfig {
            acceleration_std: 0.6,
            bias_random_walk: 3e-3,
            position_std: horizontal,
            vertical_position_std: vertical,
            noise: PositionNoise::Physical,
            outlier_nis: 0.0,
        };
        match self {
            Self::Printed => PositionAxisConfig {
                acceleration_std: sensors.accelerometer_std,
                noise: PositionNoise::Printed,
                ..physical
            },
            Self::NamesSwapped | Self::HeldFixReused => PositionAxisConfig {
                acceleration_std: 0.3,
                noise: PositionNoise::PrintedNamesSwapped,
                ..physical
            },
            Self::Tuned | Self::TunedFixed => match kind {
                Ground::Walk => PositionAxisConfig {
                    acceleration_std: 1.5,
                    ..physical
                },
                Ground::Drive => PositionAxisConfig {
                    acceleration_std: 3.0,
                    bias_random_walk: 2e-2,
                    ..physical
                },
            },
            _ => physical,
        }
    }

    fn axis_filters(
        self,
        kind: Ground,
        sensors: &GroundSensors,
        way: &[GroundSample],
        seen: impl Fn(usize) -> Option<[Vector3<f64>; 2]>,
    ) -> Vec<Estimate> {
        let rest = AtRest::of(way);
        let attitude = self.attitude_config(kind, sensors);
        let filters = AxisFilters::new(attitude, rest.angles).and_then(|a| {
            Ok((
                a,
                PositionAxisFilters::new(self.position_config(kind, sensors))?,
            ))
        });
        // The settings are constants that make sense.
        let Ok((mut angles, mut positions)) = filters else {
            return Vec::new();
        };
        let dt = 1.0 / RATE_HZ;
        let mut last = None;
        let mut number = 0;
        let mut made = Vec::with_capacity(way.len());
        for (k, sample) in way.iter().enumerate() {
            let force = sample.specific_force;
            // The paper's signs fit a board whose accelerometer is turned half about z.
            let wired = match attitude.angles {
                AxisAngles::Printed => Vector3::new(-force.x, -force.y, force.z),
                AxisAngles::Exact => force,
            };
            let rate = sample.angular_rate - rest.rate;
            // None of these is refused: the samples are finite and the step is short.
            let _ = angles.propagate(&rate, dt);
            angles.update_accelerometer(&wired);
            angles.update_magnetometer(&sample.magnetic_field);
            let ned_from_body = angles.attitude();
            let _ = positions.propagate(&ned_from_body, &force, 9.806_65, dt);
            let new = seen(k);
            last = new.or(last);
            let taken = if self == Self::HeldFixReused {
                last
            } else {
                new
            };
            if let Some([position, _]) = taken {
                number += 1;
                positions.update_position(number, &position);
            }
            made.push(Estimate {
                position: positions.position(),
                velocity: Some(positions.velocity()),
                attitude: Some(ned_from_body),
            });
        }
        made
    }
}

/// What a standstill tells.
struct AtRest {
    rate: Vector3<f64>,
    /// Roll, pitch, yaw.
    angles: [f64; 3],
}

impl AtRest {
    fn of(way: &[GroundSample]) -> Self {
        let first = way.get(..AT_REST).unwrap_or(way);
        let n = first.len().max(1) as f64;
        let mean =
            |of: fn(&GroundSample) -> Vector3<f64>| first.iter().map(of).sum::<Vector3<f64>>() / n;
        let force = mean(|s| s.specific_force);
        let (roll, pitch) = tilt_of(&force, AxisAngles::Exact);
        let roll = roll.unwrap_or(0.0);
        let yaw = tilt_compensated_heading(&mean(|s| s.magnetic_field), roll, pitch);
        Self {
            rate: mean(|s| s.angular_rate),
            angles: [roll, pitch, yaw.unwrap_or(0.0)],
        }
    }
}

fn held(
    way: &[GroundSample],
    seen: impl Fn(usize) -> Option<[Vector3<f64>; 2]>,
    moves: bool,
) -> Vec<Estimate> {
    let mut last = ([Vector3::zeros(); 2], 0.0);
    let each = way.iter().enumerate().map(|(k, sample)| {
        if let Some(fix) = seen(k) {
            last = (fix, sample.time_s);
        }
        let ([position, velocity], since) = last;
        let age = if moves { sample.time_s - since } else { 0.0 };
        Estimate {
            position: position + velocity * age,
            velocity: moves.then_some(velocity),
            attitude: None,
        }
    });
    each.collect()
}

/// Settings of the error-state filter for these sensors, without what they do not need: no Gauss-Markov biases, no
/// damping; the receiver's error is taken for white, as it is by the axis filters.
pub(super) fn error_state_config(sensors: &GroundSensors) -> GnssInsConfig<f64> {
    let root = (1.0 / RATE_HZ).sqrt();
    GnssInsConfig {
        imu_samples: ImuSamples::Means,
        // Twice the sensor's: what a sampled motion leaves out.
        accelerometer_noise_density: 2.0 * sensors.accelerometer_std * root,
        gyroscope_noise_density: sensors.gyroscope_std * root,
        accelerometer_bias_random_walk: 1e-3,
        gyroscope_bias_random_walk: 3e-5,
        accelerometer_gauss_markov_std: 0.0,
        gyroscope_gauss_markov_std: 0.0,
        position_uncorrelated_fraction: 1.0,
        position_correlated_fraction: 0.0,
        magnetic_heading_std: HEADING_STD,
        // Calibrated, and white.
        magnetic_interval_s: 0.0,
        magnetic_offset_std_ut: 0.0,
        damping_speed_m_s: 0.0,
        // Errors are as stated.
        time_offset_std_s: 0.0,
        lever_arm_std_m: Some(0.0),
        least_noise_scale: 1.0,
        largest_noise_scale: 1.0,
        robust_weights: false,
        vibration_noise: false,
        // The simulated ground is flat.
        earth_curvature: false,
        ..GnssInsConfig::default()
    }
}

/// The error-state filter, and what `look` sees after each sample.
pub(super) fn run_error_state(
    config: GnssInsConfig<f64>,
    sensors: &GroundSensors,
    way: &[GroundSample],
    seen: impl Fn(usize) -> Option<[Vector3<f64>; 2]>,
    velocity: bool,
    mut look: impl FnMut(&GnssIns<f64>, &GroundSample),
) {
    let Ok(mut ins) = GnssIns::<f64>::new(config) else {
        return;
    };
    let [horizontal, vertical] = sensors.position_std;
    let std = Vector3::new(horizontal, horizontal, vertical);
    for (k, sample) in way.iter().enumerate() {
        let time_ns = (sample.time_s * 1e9).round() as i64;
        // What is refused is counted; here nothing is.
        let _ = ins.imu(time_ns, &sample.angular_rate, &sample.specific_force);
        if k % EVERY_FIELD == 0 {
            ins.magnetometer(time_ns, &sample.magnetic_field);
        }
        if let Some([position, measured]) = seen(k) {
            let fix = GnssPosition {
                ned: position,
                std,
                has_height: true,
            };
            ins.gnss_position(time_ns, &fix);
            if velocity {
                let fix = GnssVelocity {
                    ned: measured,
                    std: Vector3::repeat(1.5 * sensors.velocity_std),
                    has_vertical: false,
                };
                ins.gnss_velocity(time_ns, &fix);
            }
        }
        look(&ins, sample);
    }
}

fn error_state(
    sensors: &GroundSensors,
    way: &[GroundSample],
    seen: impl Fn(usize) -> Option<[Vector3<f64>; 2]>,
    velocity: bool,
) -> Vec<Estimate> {
    let mut made = Vec::with_capacity(way.len());
    let config = error_state_config(sensors);
    run_error_state(config, sensors, way, seen, velocity, |ins, _| {
        made.push(match ins.state() {
            Some(state) => Estimate {
                position: state.position,
                velocity: Some(state.velocity),
                attitude: Some(state.ned_from_body),
            },
            None => Estimate {
                position: Vector3::zeros(),
                velocity: None,
                attitude: None,
            },
        });
    });
    made
}
