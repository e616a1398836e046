//! Parameters of the in-motion alignment; one configuration for cars, drones, ships and phones, whatever the receiver.

use crate::parameters::parameters;

parameters! {
    /// Parameters of the in-motion alignment; angles in radians, vectors in body axes (forward, right, down).
    pub struct InMotionAlignmentConfig;

    accelerometer_noise_density: T, "(m/s^2)/sqrt(Hz)", From(1e-6, 10.0), [0.03],
        "white noise of the accelerometer",
        "Vibration included. Raising it takes longer to find the heading.";
    gyroscope_noise_density: T, "(rad/s)/sqrt(Hz)", From(1e-9, 1.0), [2.5e-3],
        "white noise of the gyroscope",
        "Vibration included. Raising it forgets sooner what earlier accelerations said of the heading.";
    accelerometer_bias_random_walk: T, "(m/s^2)/sqrt(s)", From(0.0, 1e3), [4e-3],
        "random walk of the accelerometer bias";
    gyroscope_bias_random_walk: T, "(rad/s)/sqrt(s)", From(0.0, 100.0), [2e-4],
        "random walk of the gyroscope bias";
    accelerometer_bias_std: T, "m/s^2", From(1e-6, 20.0), [0.15],
        "standard deviation of the accelerometer bias at the start";
    gyroscope_bias_std: T, "rad/s", From(1e-8, 2.0), [0.02],
        "standard deviation of the gyroscope bias at the start";
    gravity: T, "m/s^2", From(0.1, 100.0), [9.806_65],
        "gravity";
    lever_arm_m: [T; 3], "m", Vector(&From(-100.0, 100.0)), [[0.0; 3]],
        "from the unit to the antenna";
    lever_arm_std_m: T, "m", From(0.0, 100.0), [0.1],
        "standard deviation of what the lever arm is off by, part of each position's noise",
        "0.02 where it was measured.";
    position_latency_s: T, "s", From(-2.0, 2.0), [0.0],
        "how long before its stamp a position was valid";
    time_offset_std_s: T, "s", From(0.0, 1.0), [0.03],
        "standard deviation of what the latency is off by; 0: not estimated",
        "Raising it learns a larger offset from changes of velocity.";
    time_jitter_s: T, "s", From(0.0, 1.0), [0.005],
        "jitter of the stamps between the two clocks",
        "Adds speed times jitter to the noise of a position.";
    position_uncorrelated_fraction: T, "-", From(1e-3, 100.0), [0.8],
        "fraction of a position's stated standard deviation that is independent from fix to fix";
    position_correlated_fraction: T, "-", From(0.0, 100.0), [0.7],
        "fraction of it that stays correlated from fix to fix";
    position_correlation_time_s: T, "s", From(1e-3, 1e6), [60.0],
        "correlation time of that fraction";
    position_std_floor_m: T, "m", From(1e-4, 1e3), [0.01],
        "least standard deviation of a position";
    velocity_std_floor_m_s: T, "m/s", From(1e-4, 1e3), [0.1],
        "least standard deviation of a velocity",
        "Receivers smooth it, and state what is left.";
    levelling_time_s: T, "s", From(1e-3, 60.0), [1.0],
        "time over which the specific force is averaged for the first level";
    levelling_acceleration_m_s2: T, "m/s^2", From(1e-6, 100.0), [2.0],
        "standard deviation of the vehicle's mean acceleration over that time",
        "Divided by gravity it is the standard deviation of the first level. Raising it trusts that level less.";
    speed_std_m_s: T, "m/s", From(1e-4, 1e3), [20.0],
        "standard deviation of the first velocity, that of the difference of the first two positions",
        "Wide on purpose: the fixes of the window decide. Raising it costs digits in single precision.";
    shortest_interval_s: T, "s", From(0.0, 60.0), [0.9],
        "least time between two positions that are used",
        "The window is so many times this long. Raising it looks further back, and takes longer to begin.";
    student_dof: T, "-", From(1e-3, 1e6), [4.0],
        "degrees of freedom of the Student-t distribution of a fix's errors",
        "Raising it gives outliers more weight; normal errors at infinity.";
    evidence_power: T, "-", Above(0.0, 1.0), [0.5],
        "power of the evidence in the weight of a hypothesis",
        "Below one since errors of fixes and samples are correlated. Raising it decides sooner.";
    drop_log_evidence: T, "-", From(1e-3, 1e3), [14.0],
        "log evidence behind the best hypothesis at which one is dropped";
    accepted_heading_std: T, "rad", From(1e-6, 3.0), [0.15],
        "standard deviation of the heading at which it counts as known";
    accepted_tilt_std: T, "rad", From(1e-6, 1.0), [0.06],
        "standard deviation of the tilt for that";
    accepted_nis: T, "-", From(1e-3, 100.0), [2.5],
        "largest mean NIS of the window for a component for that",
        "One where the noise is as stated; beyond this nothing explains the fixes.";
    least_noise_scale: T, "-", From(1e-3, 1.0), [1.0],
        "least that the receiver's stated standard deviations are multiplied by, as the fixes show",
        "Of that part which is independent from fix to fix; what is correlated cannot be seen.";
    largest_noise_scale: T, "-", From(1.0, 1e3), [20.0],
        "most that they are multiplied by";
    gap_attitude_random_walk: T, "rad/sqrt(s)", From(0.0, 100.0), [0.3],
        "random walk of the attitude over a gap of inertial samples";
    gap_velocity_random_walk: T, "m/s/sqrt(s)", From(0.0, 1e3), [2.0],
        "random walk of the velocity then";
}
