//! Settings of the GNSS/INS; the defaults are one configuration for a car with a cheap unit, found on a real drive
//! with 1 Hz fixes of centimetres and of metres and with outages (`docs/results/navigation.md`).

use crate::navigation::validity::ValidityLimits;
use crate::scalar::{Scalar, lit};

/// What one inertial sample is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename_all = "kebab-case")
)]
pub enum ImuSamples {
    /// Read at its stamp, as most sensors do: the mean of two samples stands for the time between them.
    #[default]
    Instants,
    /// The mean since the sample before: increments divided by their interval.
    Means,
    /// There is no inertial unit: a ship's bridge with receiver, gyrocompass and log. The body is taken to be level,
    /// velocity and heading walk by [`GnssInsConfig::gap_velocity_random_walk`] and
    /// [`GnssInsConfig::gap_attitude_random_walk`], and every measurement moves the time on.
    None,
}

/// Settings; angles in radians, vectors in body axes (forward, right, down).
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(
        default,
        deny_unknown_fields,
        bound(
            serialize = "T: serde::Serialize",
            deserialize = "T: Scalar + serde::Deserialize<'de>"
        )
    )
)]
pub struct GnssInsConfig<T: Scalar> {
    /// What one inertial sample is, default `instants`.
    pub imu_samples: ImuSamples,
    /// White noise of the accelerometer as a density, (m/s^2)/sqrt(Hz), default 0.015: an engine's vibration of 0.15
    /// m/s^2, read at 100 Hz. Raising it follows fixes more quickly and grows faster in an outage.
    pub accelerometer_noise_density: T,
    /// White noise of the gyroscope as a density, (rad/s)/sqrt(Hz), default 0.0025: vibration of 1.4 deg/s at 100 Hz,
    /// between axes and rest of a car; the sensor alone has a twentieth. Raising it learns the tilt faster from fixes.
    pub gyroscope_noise_density: T,
    /// Random walk of the accelerometer bias (at rest), (m/s^2)/sqrt(s), default 0.001: warming up, 0.06 m/s^2 in an hour.
    /// Raising it lets the bias move.
    pub accelerometer_bias_random_walk: T,
    /// Random walk of the gyroscope bias (at rest), (rad/s)/sqrt(s), default 3e-5: 0.1 deg/s in an hour.
    pub gyroscope_bias_random_walk: T,
    /// Standard deviation (m/s^2) of offsets that come and go on top of it, default 0.02: vibration that is sampled too
    /// slowly returns as an offset. 0: there are none. Raising it trusts the accelerometer less in an outage.
    pub accelerometer_wander_std: T,
    /// For how long they last, s, default 60.
    pub accelerometer_wander_time_s: T,
    /// Standard deviation (rad/s) of those of the gyroscope, default 0.002 (0.11 deg/s): what vibration does to a cheap
    /// one. 0: there are none, as for a sensor on foot. Raising it trusts the gyroscope less in an outage.
    pub gyroscope_wander_std: T,
    /// For how long they last, s, default 20: until the next gear or speed.
    pub gyroscope_wander_time_s: T,
    /// Standard deviation of the accelerometer bias at the start, m/s^2, default 0.15: consumer sensors.
    pub accelerometer_bias_std: T,
    /// Standard deviation of the gyroscope bias at the start, rad/s, when it never stood still; default 0.02.
    pub gyroscope_bias_std: T,
    /// Gravity, m/s^2, default 9.80665. Take [`crate::earth::normal_gravity`] of the place, unless the
    /// accelerometer is scaled in units of standard gravity.
    pub gravity: T,
    /// Earth rate in NED (rad/s), default zero: left out. [`crate::earth::earth_rate_ned`] of the place also
    /// brings in Coriolis force. Worth it for gyroscopes better than some 10 deg/h.
    pub earth_rate_rad_s: [T; 3],
    /// Whether gravity turns and falls with the distance from the origin, default yes: 0.0015 m/s^2 a kilometre.
    pub earth_curvature: bool,
    /// From the unit to the antenna, m, default zero.
    pub lever_arm_m: [T; 3],
    /// How long before its stamp a position was valid, s, default 0; negative when it was valid after it.
    pub position_latency_s: T,
    /// The same of a velocity, default 0.
    pub velocity_latency_s: T,
    /// Standard deviation of what both latencies are off by, s, default 0: not estimated. Raising it learns a
    /// time offset from accelerations and turns.
    pub time_offset_std_s: T,
    /// Jitter of the stamps between the two clocks, s, default 0.001: adds speed times jitter to the noise of a position.
    pub time_jitter_s: T,
    /// Share of a position's stated standard deviation that changes from fix to fix, default 0.8.
    pub position_white_share: T,
    /// Share of it that goes on from fix to fix, default 0.7: receivers' errors are of the sky and last a minute. 0: none
    /// is estimated, and an average of many fixes is believed too much. Raising it believes the mean of many fixes less.
    pub position_slow_share: T,
    /// For how long it goes on, s, default 60.
    pub position_slow_time_s: T,
    /// Least standard deviation of a horizontal position, m, default 0.01; of a height two and a half times that.
    pub position_std_floor_m: T,
    /// Least standard deviation of a velocity, m/s, default 0.1: receivers smooth it, and state what is left.
    pub velocity_std_floor_m_s: T,
    /// Standard deviation of a magnetometer's heading, rad, default 0.09 (5 degrees).
    pub magnetic_heading_std: T,
    /// Least time between two headings of the magnetometer, s, default 5: iron and bridges beside a road last longer than a
    /// sample, and many samples of the same error must not count as many. 0, and without inertial unit:
    /// every sample counts.
    pub magnetic_interval_s: T,
    /// Standard deviation (microtesla, each body axis) of the hard iron around the magnetometer that its calibration
    /// has left, default 10; a car can have 25, which is found. 0: there is none, and none is estimated, as for a calibrated
    /// unit in its place. Raising it learns the iron faster, and tells less of the heading until then.
    pub magnetic_offset_std_ut: T,
    /// Random walk of it, microtesla/sqrt(s), default 0.02.
    pub magnetic_offset_random_walk_ut: T,
    /// Magnetic declination, rad, east positive. Default `None`: what [`super::GnssIns::set_declination`] is told, a magnetic
    /// model's of the place, and zero until then.
    pub declination: Option<T>,
    /// Standard deviation of a barometer's height from sample to sample, m, default 0.5.
    pub barometer_std_m: T,
    /// Random walk of its offset, m/sqrt(s), default 0.02.
    pub barometer_offset_random_walk: T,
    /// Horizontal speed (m/s, one standard deviation an axis) that is prior knowledge, default 15: 76 km/h in all, a road
    /// vehicle. It damps the velocity in an outage, when nothing else measures it. 0: no damping. Raising it lets dead
    /// reckoning run away further; lowering it below the speeds that are driven pulls them down.
    pub damping_speed_m_s: T,
    /// How long a speed lasts, s, default 15: once in that time the prior counts as a measurement.
    pub damping_time_s: T,
    /// Whether zero velocity is fused when the unit is found at rest, default no.
    pub zero_velocity: bool,
    /// Whether the vehicle is taken not to move sideways or up and down, default no. Only for what rolls on wheels.
    pub non_holonomic: bool,
    /// Standard deviation of its sideways and vertical velocity, m/s, taken at 5 Hz, default 0.3: five of them a second are
    /// not independent, and tyres slip.
    pub non_holonomic_std_m_s: T,
    /// From the unit to the point that does not move sideways (middle of the rear axle), m, default zero.
    pub vehicle_arm_m: [T; 3],
    /// Standard deviation of pitch and yaw of the mount, rad, default 0.12 (7 degrees).
    pub mount_std: T,
    /// True heading at the start (rad) and its standard deviation, if known.
    pub initial_heading: Option<[T; 2]>,
    /// Standard deviation of heading against course at the start, rad: crab and mount. Default 0.15.
    pub course_std: T,
    /// How the attitude wanders while there are no inertial samples, rad/sqrt(s), default 0.3; for a ship without
    /// any 0.02.
    pub gap_attitude_random_walk: T,
    /// How the velocity wanders then, m/s/sqrt(s), default 2; for a ship without any 0.1.
    pub gap_velocity_random_walk: T,
    /// When a position is dead reckoning, and when it is nothing.
    pub validity: ValidityLimits<T>,
}

impl<T: Scalar> Default for GnssInsConfig<T> {
    fn default() -> Self {
        Self {
            imu_samples: ImuSamples::Instants,
            accelerometer_noise_density: lit(0.015),
            gyroscope_noise_density: lit(2.5e-3),
            accelerometer_bias_random_walk: lit(1e-3),
            gyroscope_bias_random_walk: lit(3e-5),
            accelerometer_wander_std: lit(0.02),
            accelerometer_wander_time_s: lit(60.0),
            gyroscope_wander_std: lit(2e-3),
            gyroscope_wander_time_s: lit(20.0),
            accelerometer_bias_std: lit(0.15),
            gyroscope_bias_std: lit(0.02),
            gravity: lit(9.806_65),
            earth_rate_rad_s: [T::zero(); 3],
            earth_curvature: true,
            lever_arm_m: [T::zero(); 3],
            position_latency_s: T::zero(),
            velocity_latency_s: T::zero(),
            time_offset_std_s: T::zero(),
            time_jitter_s: lit(0.001),
            position_white_share: lit(0.8),
            position_slow_share: lit(0.7),
            position_slow_time_s: lit(60.0),
            position_std_floor_m: lit(0.01),
            velocity_std_floor_m_s: lit(0.1),
            magnetic_heading_std: lit(0.09),
            magnetic_interval_s: lit(5.0),
            magnetic_offset_std_ut: lit(10.0),
            magnetic_offset_random_walk_ut: lit(0.02),
            declination: None,
            barometer_std_m: lit(0.5),
            barometer_offset_random_walk: lit(0.02),
            damping_speed_m_s: lit(15.0),
            damping_time_s: lit(15.0),
            zero_velocity: false,
            non_holonomic: false,
            non_holonomic_std_m_s: lit(0.3),
            vehicle_arm_m: [T::zero(); 3],
            mount_std: lit(0.12),
            initial_heading: None,
            course_std: lit(0.15),
            gap_attitude_random_walk: lit(0.3),
            gap_velocity_random_walk: lit(2.0),
            validity: ValidityLimits::default(),
        }
    }
}

impl<T: Scalar> GnssInsConfig<T> {
    /// Name of the first setting that makes no sense: not finite, negative where that means nothing, or beyond
    /// any sensor.
    pub fn senseless(&self) -> Option<&'static str> {
        let within = |x: T, limit: f64| x >= T::zero() && x <= lit(limit);
        let above = |x: T, limit: f64| x > T::zero() && x <= lit(limit);
        let finite = |v: &[T; 3], limit: f64| v.iter().all(|x| x.abs() <= lit(limit));
        let (rest, limits) = (lit::<T>(1e9), &self.validity);
        let checks = [
            (
                "accelerometer_noise_density",
                above(self.accelerometer_noise_density, 10.0),
            ),
            (
                "gyroscope_noise_density",
                above(self.gyroscope_noise_density, 1.0),
            ),
            (
                "accelerometer_bias_random_walk",
                within(self.accelerometer_bias_random_walk, 1.0),
            ),
            (
                "gyroscope_bias_random_walk",
                within(self.gyroscope_bias_random_walk, 1.0),
            ),
            (
                "accelerometer_wander_std",
                within(self.accelerometer_wander_std, 10.0),
            ),
            (
                "accelerometer_wander_time_s",
                above(self.accelerometer_wander_time_s, 1e6),
            ),
            (
                "gyroscope_wander_std",
                within(self.gyroscope_wander_std, 1.0),
            ),
            (
                "gyroscope_wander_time_s",
                above(self.gyroscope_wander_time_s, 1e6),
            ),
            (
                "accelerometer_bias_std",
                above(self.accelerometer_bias_std, 10.0),
            ),
            ("gyroscope_bias_std", above(self.gyroscope_bias_std, 1.0)),
            ("gravity", within(self.gravity, 100.0)),
            ("earth_rate_rad_s", finite(&self.earth_rate_rad_s, 1e-3)),
            ("lever_arm_m", finite(&self.lever_arm_m, 100.0)),
            (
                "position_latency_s",
                self.position_latency_s.abs() <= lit(2.0),
            ),
            (
                "velocity_latency_s",
                self.velocity_latency_s.abs() <= lit(2.0),
            ),
            ("time_offset_std_s", within(self.time_offset_std_s, 1.0)),
            ("time_jitter_s", within(self.time_jitter_s, 1.0)),
            (
                "position_white_share",
                above(self.position_white_share, 100.0),
            ),
            (
                "position_slow_share",
                within(self.position_slow_share, 100.0),
            ),
            (
                "position_slow_time_s",
                above(self.position_slow_time_s, 1e6),
            ),
            (
                "position_std_floor_m",
                above(self.position_std_floor_m, 1e3),
            ),
            (
                "velocity_std_floor_m_s",
                above(self.velocity_std_floor_m_s, 1e3),
            ),
            (
                "magnetic_heading_std",
                above(self.magnetic_heading_std, 10.0),
            ),
            ("magnetic_interval_s", within(self.magnetic_interval_s, 1e3)),
            (
                "magnetic_offset_std_ut",
                within(self.magnetic_offset_std_ut, 1e3),
            ),
            (
                "magnetic_offset_random_walk_ut",
                within(self.magnetic_offset_random_walk_ut, 1e2),
            ),
            (
                "declination",
                self.declination.is_none_or(|angle| angle.abs() <= lit(4.0)),
            ),
            ("barometer_std_m", above(self.barometer_std_m, 1e3)),
            (
                "barometer_offset_random_walk",
                within(self.barometer_offset_random_walk, 1e3),
            ),
            ("damping_speed_m_s", within(self.damping_speed_m_s, 1e4)),
            ("damping_time_s", above(self.damping_time_s, 1e6)),
            (
                "non_holonomic_std_m_s",
                above(self.non_holonomic_std_m_s, 1e3),
            ),
            ("vehicle_arm_m", finite(&self.vehicle_arm_m, 100.0)),
            ("mount_std", within(self.mount_std, 1.0)),
            (
                "initial_heading",
                self.initial_heading
                    .is_none_or(|[heading, std]| heading.abs() <= lit(10.0) && above(std, 10.0)),
            ),
            ("course_std", above(self.course_std, 1.0)),
            (
                "gap_attitude_random_walk",
                within(self.gap_attitude_random_walk, 100.0),
            ),
            (
                "gap_velocity_random_walk",
                within(self.gap_velocity_random_walk, 1e3),
            ),
            (
                "validity.dead_reckoning_after_s",
                limits.dead_reckoning_after_s > T::zero(),
            ),
            (
                "validity.invalid_after_s",
                limits.invalid_after_s > T::zero(),
            ),
            (
                "validity.invalid_above_m",
                limits.invalid_above_m > T::zero() && limits.invalid_above_m < rest,
            ),
        ];
        checks.iter().find(|(_, good)| !good).map(|(name, _)| *name)
    }
}
