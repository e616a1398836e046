//! Parameters shared by the attitude filters: noise, gates, initial uncertainty.
//!
//! One table for MEKF, USQUE, quaternion EKF and complementary filters, so that a comparison compares filters and
//! not their settings.

use nalgebra::Vector3;

use crate::kalman::Gate;
use crate::parameters::{Choice, choices, parameters};
use crate::scalar::Scalar;

choices! {
    /// How a filter uses the magnetometer.
    pub enum MagnetometerUse {
        /// All three components against the reference field (the paper): a wrong field tilts the
        /// estimate too.
        #[default]
        Vector = "vector",
        /// Only the direction of its horizontal part: a wrong field can turn the heading, never the
        /// tilt.
        Heading = "heading",
    }
}

choices! {
    /// How the gyroscope's noise becomes process noise.
    pub enum ProcessNoise {
        /// The density is the density: `Q_d = density^2 dt`.
        #[default]
        Discrete = "discrete",
        /// The paper's eq (21) read literally, with the sample covariance of the gyroscope as the
        /// continuous `Q`: `Q_d = (density^2 / sample interval) dt`. It overstates the noise by one
        /// over the sample interval (100 times at 100 Hz); for comparison only.
        PaperLiteral = "paper-literal",
    }
}

choices! {
    /// What the additive quaternion EKF does about the norm of its four components.
    pub enum QuaternionNorm {
        /// The covariance is projected as the quaternion is normalised: nothing along it is uncertain.
        #[default]
        Projected = "projected",
        /// The textbook's, and the paper's on the cascade: the quaternion is normalised, the covariance is
        /// left as it was. It keeps a fifth uncertain direction, which swallows errors of length; for comparison.
        Free = "free",
    }
}

// Who reads a parameter: every EKF, those with a gyroscope bias, those of four free numbers; observers that see
// vectors, and also the one behind an EKF, which sees none.
const EKF: &[&str] = &["mekf3", "mekf", "usque", "quaternion-ekf", "cascade-ekf"];
const EKF_WITH_BIAS: &[&str] = &["mekf", "usque", "quaternion-ekf", "cascade-ekf"];
const QUATERNION_EKF: &[&str] = &["quaternion-ekf", "cascade-ekf"];
const OBSERVER: &[&str] = &[
    "complementary",
    "complementary-passive",
    "complementary-direct",
    "cascade",
];
const ANY_OBSERVER: &[&str] = &[
    "complementary",
    "complementary-passive",
    "complementary-direct",
    "cascade",
    "cascade-ekf",
];
const EKF_AND_OBSERVER: &[&str] = &[
    "mekf3",
    "mekf",
    "usque",
    "quaternion-ekf",
    "cascade-ekf",
    "complementary",
    "complementary-passive",
    "complementary-direct",
    "cascade",
];

parameters! {
    /// Parameters of an attitude filter. [`Default`] is [`Self::hand_held`].
    pub struct AttitudeConfig, profiles {
        /// A phone or wearable in real use: accelerations and indoor fields whose errors last for
        /// seconds, and a gyroscope whose bias nobody calibrated.
        ///
        /// Samples under acceleration keep their full weight on purpose: the accelerations of a hand
        /// average to zero over seconds, and weighing samples by their length spoils that average
        /// (it favours those whose length happens to be right while their direction is wrong).
        hand_held = 0,
        /// A device moved gently in a laboratory, its sensors as good as at rest.
        lab = 1,
    };

    gyroscope_noise_density: T, "rad/s/sqrt(Hz)", From(1e-9, 10.0), [1.3e-3, 5e-4], for EKF,
        "white noise of the gyroscope",
        "5e-4 is 0.005 rad/s per sample at 100 Hz. Raising it trusts the gyroscope less: faster corrections,",
        "noisier attitude.";
    process_noise: ProcessNoise, "-", Words(ProcessNoise::WORDS), [ProcessNoise::Discrete], for EKF,
        "how that noise enters the covariance",
        "`paper-literal` reproduces the paper's reading and its pessimism.";
    gyroscope_sample_interval_s: T, "s", From(1e-6, 10.0), [0.01], for EKF,
        "interval of gyroscope samples; only for paper-literal";
    gyroscope_scale_noise: T, "rad/(rad/s)/sqrt(s)", From(0.0, 10.0), [1.5e-3, 0.0], for EKF,
        "extra angle noise per rate: scale and misalignment errors; 0 is off",
        "Raising it widens the covariance during fast motion only.";
    gyroscope_bias_random_walk: T, "rad/s/sqrt(s)", From(0.0, 1.0), [1e-5, 2e-4], for EKF_WITH_BIAS,
        "random walk of the gyroscope bias",
        "Raising it lets the bias follow faster, and be fooled faster by accelerations and magnetic disturbance.";
    accelerometer_std: T, "m/s^2", From(1e-6, 1e4), [1.0, 0.05], for EKF,
        "accelerometer error per sample and axis",
        "0.05 is noise at rest; a hand-held device accelerates: 0.3 to 0.5 and more. Raising it trusts gravity less.";
    accelerometer_gate_nis: T, "-", From(0.0, 1e6), [0.0, 11.34], for EKF,
        "NIS above which a sample is refused; 0 is no gate",
        "11.34 is 99 % of 3 degrees of freedom. Raising it lets more disturbed samples in.";
    accelerometer_correlation_time_s: T, "s", From(0.0, 1e9), [0.5, 0.0], for EKF,
        "correlation time of accelerometer errors; 0 is white",
        "A sample that comes sooner after the last counts for only that share of an independent one. Raising it",
        "smooths over longer accelerations.";
    accelerometer_norm_gain: T, "-", From(0.0, 1e6), [0.0], for EKF,
        "adds gain * (|f| - g)^2 to the accelerometer variance; 0 is off",
        "Raising it trusts samples whose length is not g less.";
    magnetometer_std_ut: T, "microtesla", From(1e-4, 1e6), [3.0, 0.5], for EKF,
        "magnetometer error per sample and axis",
        "0.5 is noise at rest; 2 to 3 with soft iron and indoor fields. Raising it trusts the field less.";
    magnetometer_gate_nis: T, "-", From(0.0, 1e6), [0.0, 11.34], for EKF,
        "NIS above which a sample is refused; 0 is no gate",
        "11.34 is 99 % of 3 degrees of freedom; 6.63 is 99 % for `heading`.";
    magnetometer_correlation_time_s: T, "s", From(0.0, 1e9), [1.0, 0.0], for EKF,
        "correlation time of magnetometer errors; 0 is white",
        "As for the accelerometer.";
    magnetometer_norm_gain: T, "-", From(0.0, 1e6), [1.0, 0.0], for EKF,
        "adds gain * (deviation of the field)^2 to the magnetometer variance; 0 is off",
        "The deviation is that of the field's strength, for `heading` that of its strength and dip.";
    magnetometer_use: MagnetometerUse, "-", Words(MagnetometerUse::WORDS),
        [MagnetometerUse::Heading, MagnetometerUse::Vector], for EKF_AND_OBSERVER,
        "whole field, or only its direction on the horizon";
    compass_std: T, "rad", From(1e-6, 10.0), [0.17, 0.1], for EKF,
        "smallest standard deviation of a compass heading; what the device states counts where it is larger",
        "Raising it trusts the compass less.";
    compass_gate_nis: T, "-", From(0.0, 1e6), [0.0, 6.63], for EKF,
        "NIS above which a heading is refused; 0 is no gate",
        "6.63 is 99 % of 1 degree of freedom.";
    compass_correlation_time_s: T, "s", From(0.0, 1e9), [5.0, 1.0], for EKF,
        "correlation time of compass errors; 0 is white",
        "A compass is slow and filtered. Raising it lets the heading follow the compass less.";
    gate_timeout_s: T, "s", From(0.0, 1e9), [3.0], for EKF,
        "after so long of nothing but rejections a gate inflates instead",
        "Raising it survives longer disturbances and recovers later from a wrong state.";
    initial_tilt_std: T, "rad", From(1e-6, 10.0), [0.14, 0.1], for EKF,
        "standard deviation of the tilt at the start, per axis";
    initial_heading_std: T, "rad", From(1e-6, 10.0), [0.35, 0.1], for EKF,
        "standard deviation of the heading at the start";
    initial_gyroscope_bias_std: T, "rad/s", From(0.0, 10.0), [0.02], for EKF_WITH_BIAS,
        "standard deviation of the gyroscope bias at the start, per axis",
        "Raising it lets the filter learn a large bias, at the price of a slower start.";
    maximum_attitude_std: T, "rad", From(1e-3, 10.0), [1.8], for EKF,
        "largest standard deviation per axis: beyond it nothing is known",
        "and single precision fails. A quaternion EKF of free norm has no axes and keeps none.";
    quaternion_norm: QuaternionNorm, "-", Words(QuaternionNorm::WORDS), [QuaternionNorm::Projected],
        for QUATERNION_EKF,
        "whether the quaternion EKF projects its covariance as it normalises; free: the textbook's",
        "No other filter has the choice.";
    complementary_attitude_gain: T, "1/s", From(0.0, 10.0), [0.8, 1.0], for ANY_OBSERVER,
        "how fast a complementary filter follows its vectors (k_P)",
        "Errors go as `exp(-k_P t)`. Raising it follows the vectors faster, noise and accelerations included. Above the",
        "permitted range the longest step of a correction would overshoot.";
    complementary_bias_gain: T, "1/s^2", From(0.0, 10.0), [0.0, 0.3], for ANY_OBSERVER,
        "how fast its gyroscope bias follows (k_I); 0 keeps the bias",
        "The damping is `k_P / (2 sqrt(k_I))`. Raising it learns the bias faster, and accelerations as a bias.";
    complementary_accelerometer_weight: T, "-", From(0.0, 1e6), [1.0], for OBSERVER,
        "weight of the accelerometer in a complementary filter";
    complementary_magnetometer_weight: T, "-", From(0.0, 1e6), [1.0], for OBSERVER,
        "weight of magnetometer or compass in a complementary filter";
    complementary_field_tolerance: T, "-", From(0.0, 1000.0), [0.3], for OBSERVER,
        "fraction by which a field's strength may be off and still count in a complementary filter",
        "Raising it lets more disturbed samples in.";
    complementary_bias_limit: T, "rad/s", From(0.0, 1000.0), [0.2], for ANY_OBSERVER,
        "largest gyroscope bias per axis in a complementary filter",
        "What winds up beyond is no bias.";
}

impl<T: Scalar> AttitudeConfig<T> {
    /// The accelerometer's gate.
    #[inline]
    pub fn accelerometer_gate(&self) -> Gate<T> {
        Gate {
            nis_threshold: self.accelerometer_gate_nis,
            timeout_s: self.gate_timeout_s,
        }
    }

    /// The magnetometer's gate.
    #[inline]
    pub fn magnetometer_gate(&self) -> Gate<T> {
        Gate {
            nis_threshold: self.magnetometer_gate_nis,
            timeout_s: self.gate_timeout_s,
        }
    }

    /// The compass's gate.
    #[inline]
    pub fn compass_gate(&self) -> Gate<T> {
        Gate {
            nis_threshold: self.compass_gate_nis,
            timeout_s: self.gate_timeout_s,
        }
    }

    /// Power spectral density ((rad/s)^2/Hz) of the angle noise at the rate `angular_rate` (rad/s).
    #[inline]
    pub fn angle_noise_psd(&self, angular_rate: &Vector3<T>) -> T {
        let density = self.gyroscope_noise_density;
        let white = match self.process_noise {
            ProcessNoise::Discrete => density * density,
            ProcessNoise::PaperLiteral => density * density / self.gyroscope_sample_interval_s,
        };
        let scale = self.gyroscope_scale_noise;
        white + scale * scale * angular_rate.norm_squared()
    }

    /// Power spectral density of the bias random walk, (rad/s)^2/s.
    #[inline]
    pub fn bias_walk_psd(&self) -> T {
        self.gyroscope_bias_random_walk * self.gyroscope_bias_random_walk
    }
}
