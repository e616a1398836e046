//! Why a record gives no Allan deviation; each message is one line and says what to do.

use northing_recording::SensorKind;

/// A record that cannot be analysed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AllanError {
    /// The sensor has no three axes at rest to analyse.
    #[error("`{0}` has no Allan deviation here; expected gyroscope, accelerometer or magnetometer")]
    NotASensor(&'static str),
    /// A setting that is invalid.
    #[error("{name} is {value}; expected {expected}")]
    BadSetting {
        /// The setting.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What would make sense.
        expected: &'static str,
    },
    /// The recording has no samples of the sensor.
    #[error("the recording has no {} samples; record this sensor, or choose another", .0.name())]
    NoSamples(SensorKind),
    /// The longest piece without a gap is too short.
    #[error(
        "too short: {seconds:.1} s of {} samples without a gap, at least {required:.0} s needed; let the \
         device lie still for ten minutes or more (an hour shows the bias)",
        .sensor.name()
    )]
    TooShort {
        /// The sensor.
        sensor: SensorKind,
        /// Length of the longest piece, s.
        seconds: f64,
        /// Length needed, s.
        required: f64,
    },
    /// Too many samples are missing.
    #[error(
        "{:.0} % of the {} samples are missing, at most {:.0} % may be; close other programs or lower \
         the rate, and record again",
        .share * 100.0, .sensor.name(), .limit * 100.0
    )]
    TooManyMissing {
        /// The sensor.
        sensor: SensorKind,
        /// Share missing, 0 to 1.
        share: f64,
        /// Share allowed.
        limit: f64,
    },
    /// Every sample is the same.
    #[error(
        "the {} repeated one value {samples} times; check that it is connected and running",
        .sensor.name()
    )]
    Constant {
        /// The sensor.
        sensor: SensorKind,
        /// Samples seen.
        samples: usize,
    },
    /// The device moved.
    #[error(
        "the device moved at {time_s:.1} s: the mean {} of that second is off by {deviation:.4} {unit}, limit \
         {limit:.4}; cut the recording there, or put the device on a firm table and record again",
        .sensor.name()
    )]
    Moved {
        /// The sensor.
        sensor: SensorKind,
        /// When, s after the first sample.
        time_s: f64,
        /// Deviation of a one-second mean from their median, unit of the sensor.
        deviation: f64,
        /// The limit, same unit.
        limit: f64,
        /// The unit.
        unit: &'static str,
    },
    /// The device was shaken.
    #[error(
        "the device was shaken at {time_s:.1} s: the {} scatters by {std:.4} {unit} in that second, usual is \
         {usual:.4}; put it on a firm table away from steps and fans, and record again",
        .sensor.name()
    )]
    Shaken {
        /// The sensor.
        sensor: SensorKind,
        /// When, s after the first sample.
        time_s: f64,
        /// Standard deviation within that second, unit of the sensor.
        std: f64,
        /// The median of the seconds.
        usual: f64,
        /// The unit.
        unit: &'static str,
    },
}
