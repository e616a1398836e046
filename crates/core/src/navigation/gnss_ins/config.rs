//! Parameters of the GNSS/INS; the defaults are one configuration for a car with a cheap unit, found on a real drive
//! with 1 Hz fixes of centimetres and of metres and with outages (`docs/results/navigation.md`).

use crate::navigation::validity::ValidityLimits;
use crate::parameters::{Choice, choices, parameters};

choices! {
    /// What one inertial sample is.
    pub enum ImuSamples {
        /// Read at its stamp, as most sensors do: the mean of two samples stands for the time between them.
        #[default]
        Instants = "instants",
        /// The mean since the sample before: increments divided by their interval.
        Means = "means",
        /// There is no inertial unit: a ship's bridge with receiver, gyrocompass and log. The body is taken to be
        /// level, velocity and heading walk by [`GnssInsConfig::gap_velocity_random_walk`] and
        /// [`GnssInsConfig::gap_attitude_random_walk`], and every measurement moves the time on.
        None = "none",
    }
}

parameters! {
    /// Parameters of the GNSS/INS; angles in radians, vectors in body axes (forward, right, down).
    pub struct GnssInsConfig, groups {
        validity: ValidityLimits, [ValidityLimits::default()],
            "when a position is dead reckoning, and when it is invalid";
    };

    imu_samples: ImuSamples, "-", Words(ImuSamples::WORDS), [ImuSamples::Instants],
        "what one inertial sample is: read at its stamp, the mean since the one before, or none at all";
    accelerometer_noise_density: T, "(m/s^2)/sqrt(Hz)", From(1e-6, 10.0), [0.015],
        "white noise of the accelerometer",
        "An engine's vibration of 0.15 m/s^2, read at 100 Hz. Raising it follows fixes more quickly and grows faster",
        "in an outage.";
    gyroscope_noise_density: T, "(rad/s)/sqrt(Hz)", From(1e-9, 1.0), [2.5e-3],
        "white noise of the gyroscope",
        "Vibration of 1.4 deg/s at 100 Hz, between axes and rest of a car; the sensor alone has a twentieth. Raising",
        "it learns the tilt faster from fixes.";
    accelerometer_bias_random_walk: T, "(m/s^2)/sqrt(s)", From(0.0, 1.0), [1e-3],
        "random walk of the accelerometer bias (at rest)",
        "Warming up, 0.06 m/s^2 in an hour. Raising it lets the bias move.";
    gyroscope_bias_random_walk: T, "(rad/s)/sqrt(s)", From(0.0, 1.0), [3e-5],
        "random walk of the gyroscope bias (at rest)",
        "0.1 deg/s in an hour. Raising it lets the bias move.";
    accelerometer_gauss_markov_std: T, "m/s^2", From(0.0, 10.0), [0.02], was "accelerometer_wander_std",
        "first-order Gauss-Markov bias of the accelerometer on top of it, standard deviation; 0: none",
        "Vibration that is sampled too slowly returns as an offset. Raising it trusts the accelerometer less in an",
        "outage.";
    accelerometer_gauss_markov_time_s: T, "s", From(1e-3, 1e6), [60.0], was "accelerometer_wander_time_s",
        "its correlation time";
    gyroscope_gauss_markov_std: T, "rad/s", From(0.0, 1.0), [2e-3], was "gyroscope_wander_std",
        "first-order Gauss-Markov bias of the gyroscope, standard deviation; 0: none",
        "0.11 deg/s: what vibration does to a cheap one; none for a sensor on foot. Raising it trusts the gyroscope",
        "less in an outage.";
    gyroscope_gauss_markov_time_s: T, "s", From(1e-3, 1e6), [20.0], was "gyroscope_wander_time_s",
        "its correlation time",
        "Until the next gear or speed.";
    accelerometer_bias_std: T, "m/s^2", From(1e-6, 10.0), [0.15],
        "standard deviation of the accelerometer bias at the start",
        "Consumer sensors.";
    gyroscope_bias_std: T, "rad/s", From(1e-8, 1.0), [0.02],
        "standard deviation of the gyroscope bias at the start, when it never stood still";
    gravity: T, "m/s^2", From(0.0, 100.0), [9.806_65],
        "gravity",
        "Take [`crate::earth::normal_gravity`] of the place, unless the accelerometer is scaled in units of standard",
        "gravity.";
    earth_rate_rad_s: [T; 3], "rad/s", Vector(&From(-1e-3, 1e-3)), [[0.0; 3]],
        "Earth rate in NED; zero: left out",
        "[`crate::earth::earth_rate_ned`] of the place also brings in Coriolis force. Worth it for gyroscopes better",
        "than some 10 deg/h.";
    earth_curvature: bool, "-", Flag, [true],
        "whether gravity turns and falls with the distance from the origin",
        "0.0015 m/s^2 a kilometre.";
    lever_arm_m: [T; 3], "m", Vector(&From(-100.0, 100.0)), [[0.0; 3]],
        "from the unit to the antenna";
    lever_arm_std_m: Option<T>, "m", Optional(&From(0.0, 100.0)), [None],
        "standard deviation of what the lever arm is off by; none: 0.02 where there is one, 0.1 where it is zero",
        "Part of the noise of each position.";
    position_latency_s: T, "s", From(-2.0, 2.0), [0.0],
        "how long before its stamp a position was valid; negative when it was valid after it";
    velocity_latency_s: T, "s", From(-2.0, 2.0), [0.0],
        "the same of a velocity";
    time_offset_std_s: T, "s", From(0.0, 1.0), [0.1],
        "standard deviation of what both latencies are off by; 0: not estimated",
        "Raising it learns a time offset from accelerations and turns.";
    time_jitter_s: T, "s", From(0.0, 1.0), [0.005],
        "jitter of the stamps between the two clocks",
        "Adds speed times jitter to the noise of a position.";
    position_uncorrelated_fraction: T, "-", From(1e-3, 100.0), [0.8], was "position_white_share",
        "fraction of a position's stated standard deviation that is independent from fix to fix";
    position_correlated_fraction: T, "-", From(0.0, 100.0), [0.7], was "position_slow_share",
        "fraction of it that stays correlated from fix to fix; 0: none is estimated",
        "Receivers' errors are of the sky and last a minute. Without it an average of many fixes is overconfident.",
        "Raising it trusts the mean of many fixes less.";
    position_correlation_time_s: T, "s", From(1e-3, 1e6), [60.0], was "position_slow_time_s",
        "correlation time of that fraction";
    position_std_floor_m: T, "m", From(1e-4, 1e3), [0.01],
        "least standard deviation of a horizontal position; of a height two and a half times that";
    least_noise_scale: T, "-", From(1e-3, 1.0), [1.0],
        "least that a receiver's stated standard deviations are multiplied by, as its fixes show",
        "Of the fraction that is independent from fix to fix. 1, and 1 for the largest: they are taken as stated.";
    largest_noise_scale: T, "-", From(1.0, 1e3), [20.0],
        "most that they are multiplied by";
    robust_weights: bool, "-", Flag, [true],
        "whether a fix that is further off than 97 of 100 counts less, as Student's t distribution says",
        "Without it the errors of fixes are taken to be normal, and none is left out.";
    vibration_noise: bool, "-", Flag, [true],
        "whether the noise that the inertial samples themselves show is expected where it is above the noise densities";
    velocity_std_floor_m_s: T, "m/s", From(1e-4, 1e3), [0.1],
        "least standard deviation of a velocity",
        "Receivers smooth it, and state what is left.";
    magnetic_heading_std: T, "rad", From(1e-6, 10.0), [0.09],
        "standard deviation of a magnetometer's heading",
        "5 degrees.";
    magnetic_interval_s: T, "s", From(0.0, 1e3), [5.0],
        "least time between two headings of the magnetometer",
        "Iron and bridges beside a road last longer than a sample, and many samples of the same error must not count as",
        "many. 0, and without inertial unit: every sample counts.";
    magnetic_offset_std_ut: T, "microtesla", From(0.0, 1e3), [10.0],
        "standard deviation of the hard iron that the magnetometer's calibration has left, per axis; 0: none",
        "A car can have 25, which is found; a calibrated unit that stays where it was calibrated has none. Raising it",
        "learns the iron faster, and learns less of the heading until then.";
    magnetic_offset_random_walk_ut: T, "microtesla/sqrt(s)", From(0.0, 1e2), [0.02],
        "random walk of it";
    declination: Option<T>, "rad", Optional(&From(-4.0, 4.0)), [None],
        "magnetic declination, east positive; none: that of the magnetic model at the place",
        "Without either ([`super::GnssIns::set_declination`]) it is zero.";
    barometer_std_m: T, "m", From(1e-4, 1e3), [0.5],
        "standard deviation of a barometer's height from sample to sample";
    barometer_offset_random_walk: T, "m/sqrt(s)", From(0.0, 1e3), [0.02],
        "random walk of its offset";
    damping_speed_m_s: T, "m/s", From(0.0, 1e4), [15.0],
        "horizontal speed that is prior knowledge, one standard deviation an axis; 0: no damping",
        "76 km/h in all, a road vehicle; the fastest of the last minutes, as well as that is known, where that was slower. It damps the velocity in an outage, when nothing else measures it. Raising it",
        "lets dead reckoning run away further; lowering it below the speeds that are driven pulls them down.";
    damping_time_s: T, "s", From(1e-3, 1e6), [15.0],
        "how long a speed lasts: once in that time the prior counts as a measurement";
    zero_velocity: bool, "-", Flag, [false],
        "whether zero velocity is fused when the unit is found at rest";
    non_holonomic: bool, "-", Flag, [false],
        "whether the vehicle is taken not to move sideways or up and down",
        "Only for what rolls on wheels.";
    non_holonomic_std_m_s: T, "m/s", From(1e-4, 1e3), [0.3],
        "standard deviation of its sideways and vertical velocity, taken at 5 Hz",
        "Five of them a second are not independent, and tyres slip.";
    vehicle_arm_m: [T; 3], "m", Vector(&From(-100.0, 100.0)), [[0.0; 3]],
        "from the unit to the point that does not move sideways (middle of the rear axle)";
    mount_std: T, "rad", From(0.0, 1.0), [0.12],
        "standard deviation of pitch and yaw of the mount",
        "7 degrees.";
    initial_heading: Option<[T; 2]>, "rad", Optional(&Pair(&From(-10.0, 10.0), &From(1e-6, 10.0))), [None],
        "true heading at the start and its standard deviation, if known";
    course_std: T, "rad", From(1e-6, 1.0), [0.15],
        "standard deviation of heading against course at the start without inertial unit: crab and mount";
    gap_attitude_random_walk: T, "rad/sqrt(s)", From(0.0, 100.0), [0.3],
        "random walk of the attitude while there are no inertial samples",
        "With a gyroscope it is that of the motion before as soon as that is known. 0.02 for a ship without any.";
    gap_velocity_random_walk: T, "m/s/sqrt(s)", From(0.0, 1e3), [2.0],
        "random walk of the velocity then",
        "0.1 for a ship without any.";
}
