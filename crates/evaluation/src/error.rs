//! What can go wrong when recordings are evaluated; each message is one line and says what to do.

use northing_core::ConfigError;

/// A run that cannot be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EvaluationError {
    /// No estimator has this name.
    #[error("unknown estimator `{name}`; expected one of: {valid}")]
    UnknownEstimator {
        /// What was asked for.
        name: String,
        /// The names there are.
        valid: String,
    },
    /// An estimator that somebody brought along cannot be used, or has failed.
    #[error("{sentence}")]
    OwnEstimator {
        /// Which, and what it did.
        sentence: String,
    },
    /// One that estimates positions where one of the attitude alone is meant.
    #[error(
        "`{name}` estimates positions from fixes; expected an estimator of the attitude alone, one of: {valid}"
    )]
    EstimatorOfPositions {
        /// What was asked for.
        name: String,
        /// The names there are.
        valid: String,
    },
    /// No profile has this name.
    #[error("unknown profile `{name}`; expected one of: {valid}")]
    UnknownProfile {
        /// What was asked for.
        name: String,
        /// The names there are.
        valid: String,
    },
    /// No sensor that can be chosen has this name.
    #[error("unknown sensor `{name}`; expected a list of: {valid}")]
    UnknownSensor {
        /// What was asked for.
        name: String,
        /// The names there are.
        valid: String,
    },
    /// A choice of sensors without gyroscope.
    #[error("the gyroscope is missing in `{text}`; every estimator needs it, e.g. gyro,acc")]
    GyroscopeNotChosen {
        /// The choice.
        text: String,
    },
    /// A setting that is not `name=value`.
    #[error("`{text}` is not a setting; expected NAME=VALUE, e.g. accelerometer_std=0.3")]
    NotASetting {
        /// What was given.
        text: String,
    },
    /// No parameter has this name.
    #[error("unknown parameter `{name}`; {hint}")]
    UnknownParameter {
        /// What was asked for.
        name: String,
        /// What was meant, or the names there are.
        hint: String,
    },
    /// A parameter has a value it cannot have.
    #[error("parameter `{name}`: `{value}` does not fit: {problem}")]
    BadValue {
        /// The parameter.
        name: String,
        /// What was given.
        value: String,
        /// Why not.
        problem: String,
    },
    /// A parameter outside its permitted range.
    #[error("configuration: {name} must be {range}")]
    Config {
        /// The parameter.
        name: String,
        /// What is permitted.
        range: String,
    },
    /// The device's own orientation was to be evaluated, and the recording has none.
    #[error(
        "the recording has no orientation of the device itself; leave the estimator `device` out"
    )]
    NoDeviceOrientation,
    /// Smoothing was asked of an estimator that has no smoother.
    #[error(
        "there is no smoother for `{estimator}`; smoothing works with the estimators mekf, bounded-velocity and error-state"
    )]
    NoSmoother {
        /// The estimator.
        estimator: &'static str,
    },
    /// The device did not rest, or something else made its calibration useless.
    #[error("calibration from the first {seconds} s: {reason}")]
    CalibrationRejected {
        /// How long a rest was promised, s.
        seconds: f64,
        /// Why it was refused.
        reason: String,
    },
    /// A span of a recording gives no calibration at rest.
    #[error("{0}")]
    RestCalibration(String),
    /// The samples do not give a magnetometer calibration.
    #[error("magnetometer calibration: {0}")]
    MagnetometerStreamCalibration(String),
    /// The recording has no samples of the magnetometer asked for.
    #[error(
        "the recording has no samples of the magnetometer `{stream}`; record one, or choose the other with \
         --magnetometer"
    )]
    NoMagnetometer {
        /// The stream.
        stream: &'static str,
    },
    /// A magnetometer calibration is of another stream than the one in use.
    #[error(
        "the magnetometer calibration is of the stream `{calibrated}`, and `{used}` is in use; choose one of them"
    )]
    OtherMagnetometer {
        /// The stream that was calibrated.
        calibrated: &'static str,
        /// The stream in use.
        used: &'static str,
    },
    /// No calibration of a folder belongs to a recording.
    #[error(
        "no calibration of {wanted} in {place}; there are {named}; expected names that end with the device, or device \
         and day, such as magnetometer_iPhone5_d3.toml"
    )]
    NoCalibration {
        /// Device and day, as far as the recording says.
        wanted: String,
        /// The folder.
        place: String,
        /// Names of the calibrations in it.
        named: String,
    },
    /// The calibration does not give what a start needs.
    #[error("calibration: {problem}")]
    UnusableCalibration {
        /// What is missing, and what to do.
        problem: String,
    },
    /// There are two calibrations.
    #[error("a calibration is given and another is to be taken from the first seconds; choose one")]
    TwoCalibrations,
    /// An attitude was to be estimated from a recording without angular rates.
    #[error(
        "no gyroscope sample in the recording: an attitude is estimated from angular rates; for the position alone, \
         from the fixes of a satellite receiver, choose --estimator dead-reckoning"
    )]
    NoGyroscope,
    /// The recording ended before anything could be estimated.
    #[error(
        "too short: {seconds:.3} s of samples; an estimate starts after {needed:.3} s \
         (alignment or calibration)"
    )]
    TooShort {
        /// Length of the recording, s.
        seconds: f64,
        /// What is needed, s.
        needed: f64,
    },
    /// A navigation run without one usable fix.
    #[error(
        "no usable fix of a satellite receiver in the recording ({fixes} in all{because}): a navigation estimator needs \
         positions to start from; for attitude alone choose another --estimator, e.g. mekf"
    )]
    NoFix {
        /// Fixes there were, the unusable ones.
        fixes: u64,
        /// Why they are unusable, as `; 3: fewer than 4 satellites`; empty without any.
        because: String,
    },
    /// A navigation run over inertial samples and fixes of different times.
    #[error(
        "the inertial samples are of {:.0} s to {:.0} s and the fixes of {:.0} s to {:.0} s: from first to first their clocks are \
         {apart_s:.0} s apart; in a manifest `time_offset_s` shifts a table",
        inertial_s[0], inertial_s[1], fixes_s[0], fixes_s[1]
    )]
    NoCommonTime {
        /// First and last of the inertial samples, s since the start of the recording.
        inertial_s: [f64; 2],
        /// First and last of the usable fixes.
        fixes_s: [f64; 2],
        /// From the first of one to the first of the other, s.
        apart_s: f64,
    },
    /// A navigation run in which the estimator used no fix, and so gave no estimate.
    #[error(
        "not one estimate: the estimator could use none of the {given} fixes it got ({because})"
    )]
    NoFixUsed {
        /// Fixes that it got.
        given: u64,
        /// Why it used none.
        because: String,
    },
    /// A navigation run over fixes of which none could have been travelled to from another.
    #[error(
        "no two of the {fixes} fixes lie so that a vehicle below 600 m/s could have been at both: expected fixes of one \
         way, with times in the unit of the format; look at their latitudes, longitudes and times"
    )]
    NoConsensus {
        /// Usable fixes there were.
        fixes: u64,
    },
    /// A navigation run without gyroscope and accelerometer.
    #[error(
        "the recording has no gyroscope with accelerometer, which `{estimator}` needs; choose --estimator \
         dead-reckoning"
    )]
    NoInertialSamples {
        /// The estimator.
        estimator: &'static str,
    },
    /// Measurements were to be kept from a filter that had run already.
    #[error(
        "`device` is what the device reported while it ran with all that it measured: nothing can be kept from it now; \
         leave --gnss-every, --outage and --without out, or choose --estimator error-state or axis-filters"
    )]
    DeviceHadEverything,
    /// The device's own position was to be evaluated, and the recording has none.
    #[error(
        "the recording has no position that the device itself estimated; boards with our firmware print one \
         (docs/wire_formats.md); otherwise choose --estimator error-state or axis-filters"
    )]
    NoDeviceNavigation,
    /// Noise parameters were to be fitted for an estimator that has none.
    #[error(
        "`{estimator}` has no parameters to fit; choose another --estimator: mekf, bounded-velocity or usque for the \
         attitude, error-state, axis-filters or dead-reckoning where there are fixes"
    )]
    NothingToFit {
        /// The estimator.
        estimator: &'static str,
    },
    /// Noise parameters were to be fitted, and no innovation has a likelihood.
    #[error(
        "`{estimator}` stated no covariance of an innovation over the part of the recording that is fitted, so that \
         there is no likelihood (bounded-velocity states one of a magnetometer alone, a complementary filter none); \
         choose another --estimator, e.g. mekf"
    )]
    NoLikelihood {
        /// The estimator.
        estimator: &'static str,
    },
    /// Noise parameters were to be fitted to predictions that the fitted part of the recording is too short for.
    #[error(
        "no innovation of the fitted part comes behind a prediction of {prediction_s} s: the first one would end after four \
         times that, and the fitted part lasts {fitted_s:.1} s; predict for less than {:.1} s (--prediction), or fit to a longer \
         recording",
        (fitted_s * 2.5).floor() / 10.0
    )]
    PredictionTooLong {
        /// Seconds of gyroscope alone that were asked for.
        prediction_s: f64,
        /// How long the part lasts that the fit sees, s.
        fitted_s: f64,
    },
    /// The system started no thread.
    #[error("the system starts no thread: {problem}")]
    NoThread {
        /// What it says.
        problem: String,
    },
    /// A saved state that cannot be continued from.
    #[error("state: {problem}")]
    BrokenState {
        /// What is wrong with it.
        problem: String,
    },
    /// Somebody asked for an end before it was reached.
    #[error("interrupted")]
    Interrupted,
    /// The reference cannot be that of the recording's sensors.
    #[error("the reference is refused: {0}; --ignore-reference runs without it")]
    Reference(Box<dyn std::error::Error + Send + Sync>),
    /// The alignment of a reference was asked for, and nothing shows it.
    #[error(
        "the clock of the reference cannot be found: expected a reference and a gyroscope that turn together for 10 s or \
         more; leave --align-reference out"
    )]
    ReferenceAtRest,
    /// The recording cannot be read, or its reader refuses it.
    #[error("{0}")]
    Recording(Box<dyn std::error::Error + Send + Sync>),
}

impl From<ConfigError> for EvaluationError {
    fn from(error: ConfigError) -> Self {
        Self::Config {
            name: error.field.to_owned(),
            range: error.range.to_string(),
        }
    }
}
