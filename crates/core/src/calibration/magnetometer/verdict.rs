//! When a magnetometer calibration is refused, and how the refusal reads.

use core::fmt;

use crate::parameters::{ConfigError, parameters};
use crate::scalar::{Scalar, lit};

parameters! {
    /// Limits beyond which a calibration is refused, and what is known beforehand.
    pub struct MagnetometerLimits;

    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
    field_strength_ut: Option<T>, "microtesla", Optional(&From(1e-4, 1e6)), [None],
        "strength of the field at this place, to which calibrated samples are scaled",
        "None: the mean radius that the sensor itself shows.";
    minimum_samples: u32, "-", Count(0), [100],
        "fewest different samples",
        "Raising it asks for longer recordings.";
    ellipsoid_coverage: T, "-", From(0.0, 1e6), [0.45],
        "fraction of the sphere that an ellipsoid needs",
        "With less, or where the sphere's centre is much better known, a sphere is fitted. Raising it asks for more",
        "turning and refuses soft iron found from half a view; above 1 a sphere is fitted always.";
    sphere_coverage: T, "-", From(0.0, 1.0), [0.35],
        "fraction of the sphere that a sphere needs; with less nothing is fitted";
    condition_number: T, "-", From(1.0, 1e12), [60.0],
        "largest condition number of a fit",
        "A full view has 3.2 for an ellipsoid and 1.2 for a sphere. Raising it accepts directions that happen to leave",
        "a parameter open.";
    axis_ratio: T, "-", From(1e-3, 1e6), [2.0],
        "largest ratio of the ellipsoid's longest and shortest axis; beyond it no ellipsoid is accepted";
    residual_std_ut: T, "microtesla", From(1e-4, 1e6), [3.0],
        "largest standard deviation of the calibrated samples' distance from the surface",
        "Raising it accepts disturbed surroundings.";
    field_minimum_ut: T, "microtesla", From(0.0, 1e6), [20.0],
        "weakest mean radius",
        "The Earth's field is 22 to 67.";
    field_maximum_ut: T, "microtesla", From(1e-4, 1e6), [80.0],
        "strongest mean radius",
        "Sensors may be some percent too sensitive.";
}

/// Why a magnetometer calibration is refused. The text is one line that ends with what to do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum MagnetometerError<T> {
    /// Too few samples that differ from the one before.
    TooFewSamples {
        /// Samples used.
        samples: u32,
        /// Samples needed.
        required: u32,
        /// Samples ignored: zero, not finite, or out of every magnetometer's range.
        ignored: u32,
    },
    /// The sensor repeats one value: it does not run.
    Constant {
        /// Samples seen.
        samples: u32,
    },
    /// Too little of the sphere was seen.
    NotEnoughCoverage {
        /// Share seen, 0 to 1.
        share: T,
        /// Share needed.
        required: T,
    },
    /// The directions leave a parameter open, as those of a turn about one axis do.
    Flat,
    /// The field's strength is not that of the Earth.
    NotTheEarthsField {
        /// Mean radius, microtesla.
        measured_ut: T,
        /// Weakest allowed, microtesla.
        minimum_ut: T,
        /// Strongest allowed, microtesla.
        maximum_ut: T,
    },
    /// The samples do not lie on the surface.
    ResidualTooLarge {
        /// Standard deviation of the distance, microtesla.
        std_ut: T,
        /// The limit, microtesla.
        limit_ut: T,
    },
    /// The samples lie neither on a credible ellipsoid nor on a sphere.
    NotAnEllipsoid {
        /// Standard deviation of the distance from the best sphere, microtesla.
        std_ut: T,
        /// The limit, microtesla.
        limit_ut: T,
    },
    /// A limit is outside its permitted range.
    Limits(ConfigError),
}

impl<T: fmt::Display + Scalar> fmt::Display for MagnetometerError<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let percent = |share: &T| *share * lit(100.0);
        match self {
            Self::TooFewSamples {
                samples,
                required,
                ignored,
            } => {
                write!(
                    f,
                    "too short: {samples} different magnetometer samples, at least {required} needed"
                )?;
                if *ignored > 0 {
                    write!(f, " ({ignored} were zero or not finite)")?;
                }
                f.write_str("; turn the device through all directions for 20 seconds or more")
            }
            Self::Constant { samples } => write!(
                f,
                "the magnetometer repeated one value {samples} times; check that it is connected and running"
            ),
            Self::NotEnoughCoverage { share, required } => write!(
                f,
                "turn the device through more directions: only {:.1} % of the sphere seen, at least {:.0} % needed",
                percent(share),
                percent(required)
            ),
            Self::Flat => f.write_str(
                "the directions seen lie in one plane, which leaves the hard iron across it open; turn the \
                 device about another axis too",
            ),
            Self::NotTheEarthsField {
                measured_ut,
                minimum_ut,
                maximum_ut,
            } => write!(
                f,
                "the samples fit a field of {measured_ut:.1} uT, expected {minimum_ut:.0} to {maximum_ut:.0}; turn the device \
                 through all directions (at rest they show noise alone), move away from iron, or check the unit (uT)"
            ),
            Self::ResidualTooLarge { std_ut, limit_ut } => write!(
                f,
                "the samples scatter by {std_ut:.1} uT about the best fit, limit {limit_ut:.1}: a magnet or a \
                 moving car nearby; go elsewhere and turn the device on the spot"
            ),
            Self::NotAnEllipsoid { std_ut, limit_ut } => write!(
                f,
                "the samples fit no ellipsoid, and scatter by {std_ut:.1} uT about the best sphere, limit \
                 {limit_ut:.1}; turn through more directions, away from magnets, cars and cables"
            ),
            Self::Limits(error) => write!(f, "limits of the calibration: {error}"),
        }
    }
}

impl<T: fmt::Debug + fmt::Display + Scalar> core::error::Error for MagnetometerError<T> {}
