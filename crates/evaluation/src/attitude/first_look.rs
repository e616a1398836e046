//! What the first half second of a recording says about its magnetometers, before anything runs.
//!
//! Phones deliver two streams: the one that their system calibrated, and the uncalibrated one, whose
//! hard iron is hundreds of microtesla. The difference of their means over the start is the offset
//! that the system knew; taken from the uncalibrated stream it leaves a few microtesla to a filter
//! that estimates hard iron, and a usable field to those that do not. What the offset misses is what
//! such a filter has to expect; that follows from the stream.
//!
//! Where the choice is left to the program, a filter that estimates hard iron takes the uncalibrated
//! stream if both are there: what a system takes away and adds while a recording lasts, no filter can
//! follow; what iron does to the sensor stays.

use std::collections::VecDeque;

use nalgebra::Vector3;
use northing_core::calibration::RestCalibration;

use crate::attitude::calibrated_start::is_of_this_place;
use crate::attitude::{EstimatorKind, Instant, InstantSource, RunOptions};
use crate::calibration::magnetometer::MagnetometerSource;
use crate::error::EvaluationError;
use crate::used_parameters::Origin;

/// The parameter that follows from the stream unless somebody sets it.
pub const PRIOR: &str = "bounded_initial_hard_iron_std_ut";
/// Hard iron that is left, microtesla per axis: by a calibration of the magnetometer, ...
pub const LEFT_BY_A_CALIBRATION_UT: f64 = 2.0;
/// ... in the stream that a phone's system calibrated, ...
const LEFT_BY_THE_SYSTEM_UT: f64 = 3.0;
/// ... and in the uncalibrated stream less the system's offset.
const LEFT_UNCALIBRATED_UT: f64 = 12.0;

impl RunOptions {
    /// Sets the standard deviation of the hard iron that the stream in use leaves to a filter, unless
    /// somebody has set it: `has_uncalibrated` tells a phone, whose system calibrates, from a sensor.
    pub fn expect_hard_iron(&mut self, has_uncalibrated: bool) {
        if self.is_explicit(PRIOR) {
            return;
        }
        let prior = &mut self.config.bounded_velocity.initial_hard_iron_std_ut;
        let left = if self.magnetometer_calibration.is_some() {
            LEFT_BY_A_CALIBRATION_UT
        } else if self.sensors.magnetometer_source == MagnetometerSource::Uncalibrated {
            LEFT_UNCALIBRATED_UT
        } else if has_uncalibrated && *prior <= 0.0 {
            LEFT_BY_THE_SYSTEM_UT
        } else {
            return;
        };
        *prior = left;
        self.origins.insert(PRIOR.to_owned(), Origin::Learnt);
    }
}

/// The instants of a recording, the first of which have been looked at.
pub(crate) struct FirstLook<'a> {
    looked_at: VecDeque<Instant>,
    /// What ended them early.
    failed: Option<EvaluationError>,
    rest: &'a mut dyn InstantSource,
    means: [Mean; 2],
    /// Taken from every uncalibrated sample.
    offset: Option<Vector3<f64>>,
    stream: MagnetometerSource,
    /// Whether the stream is another than the one that the options name.
    chosen: bool,
}

#[derive(Debug, Clone, Copy, Default)]
struct Mean {
    sum: Vector3<f64>,
    count: u32,
}

impl Mean {
    fn add(&mut self, value: Option<Vector3<f64>>) {
        if let Some(value) = value.filter(|v| v.norm_squared().is_finite()) {
            self.sum += value;
            self.count += 1;
        }
    }

    fn value(self) -> Option<Vector3<f64>> {
        (self.count > 0).then(|| self.sum / f64::from(self.count))
    }
}

impl<'a> FirstLook<'a> {
    /// Looks at the time over which a run averages its start.
    pub(crate) fn new(instants: &'a mut dyn InstantSource, options: &RunOptions) -> Self {
        let mut look = Self {
            looked_at: VecDeque::new(),
            failed: None,
            rest: instants,
            means: [Mean::default(); 2],
            offset: None,
            stream: options.sensors.magnetometer_source,
            chosen: false,
        };
        look.failed = look.look(options.driver.alignment_s).err();
        let offset = look.offset_for(options);
        if options.choose_magnetometer
            && options.estimator == EstimatorKind::BoundedVelocity
            && offset.is_some()
        {
            look.chosen = look.stream != MagnetometerSource::Uncalibrated;
            look.stream = MagnetometerSource::Uncalibrated;
        }
        look.offset = offset.filter(|_| look.stream == MagnetometerSource::Uncalibrated);
        look
    }

    /// Takes what comes first, for so long (s).
    fn look(&mut self, seconds: f64) -> Result<(), EvaluationError> {
        let window_ns = (seconds * 1e9) as i64;
        let mut instant = Instant::default();
        while self.rest.read(&mut instant)? {
            self.means[0].add(instant.magnetic_field);
            self.means[1].add(instant.magnetic_field_uncalibrated);
            self.looked_at.push_back(instant);
            let first_ns = self.looked_at[0].time_ns;
            if instant.time_ns.saturating_sub(first_ns) > window_ns {
                break;
            }
        }
        Ok(())
    }

    /// The offset, where the uncalibrated stream can be used as it comes. Where a calibration knows a
    /// field, or a state is taken over, it was made without this one.
    fn offset_for(&self, options: &RunOptions) -> Option<Vector3<f64>> {
        let corrected = options.magnetometer_calibration.is_some();
        let knows_field = |c: &RestCalibration<f64>| c.magnetic_field_ut.is_some();
        let taken_over =
            options.calibration.as_ref().is_some_and(knows_field) && is_of_this_place(options);
        let taken_over = taken_over || options.start.is_some();
        let [system, uncalibrated] = self.means.map(Mean::value);
        (options.sensors.magnetometer && !corrected && !taken_over)
            .then(|| Some(uncalibrated? - system?))
            .flatten()
    }

    /// The options with the stream in use, and the hard iron's prior of it.
    pub(crate) fn options(&self, options: &RunOptions) -> RunOptions {
        let mut options = options.clone();
        options.sensors.magnetometer_source = self.stream;
        // Where there is none in use, the other stream says that the device has a system that calibrates.
        options.expect_hard_iron(self.means[1].count > 0);
        options
    }

    /// What was taken from the uncalibrated field, and who chose it, in a sentence.
    pub(crate) fn sentence(&self) -> Option<String> {
        let v = self.offset?;
        let why = if self.chosen {
            " It was chosen because this estimator finds the hard iron that is left; --magnetometer \
             device takes the device's own."
        } else {
            ""
        };
        Some(format!(
            "The uncalibrated magnetometer is used less the offset that the device's own calibration \
             had at the start: ({:.1}, {:.1}, {:.1}) uT.{why}",
            v.x, v.y, v.z
        ))
    }
}

impl InstantSource for FirstLook<'_> {
    fn read(&mut self, instant: &mut Instant) -> Result<bool, EvaluationError> {
        if let Some(first) = self.looked_at.pop_front() {
            *instant = first;
        } else if let Some(error) = self.failed.take() {
            return Err(error);
        } else if !self.rest.read(instant)? {
            return Ok(false);
        }
        if let (Some(offset), Some(field)) = (self.offset, &mut instant.magnetic_field_uncalibrated)
        {
            *field -= offset;
        }
        Ok(true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, UnitQuaternion};
    use northing_core::attitude::{InitialState, References};

    fn state() -> InitialState<f64> {
        InitialState {
            attitude: UnitQuaternion::identity(),
            attitude_covariance: Matrix3::identity(),
            gyroscope_bias: Vector3::zeros(),
            gyroscope_bias_std: 0.1,
            north_known: false,
            references: References {
                specific_force: Vector3::z(),
                magnetic_field: None,
            },
        }
    }

    /// A phone at 50 Hz whose uncalibrated stream is off by (300, -100, 20) microtesla.
    fn phone(uncalibrated: bool) -> impl Iterator<Item = Result<Instant, EvaluationError>> {
        (0..100).map(move |k| {
            let field = Vector3::new(0.0, 20.0 + f64::from(k % 2), -40.0);
            let raw = field + Vector3::new(300.0, -100.0, 20.0);
            Ok(Instant {
                time_ns: 20_000_000 * i64::from(k),
                magnetic_field: Some(field),
                magnetic_field_uncalibrated: uncalibrated.then_some(raw),
                ..Instant::default()
            })
        })
    }

    fn uncalibrated() -> RunOptions {
        let mut options = RunOptions::default();
        options.sensors.magnetometer_source = MagnetometerSource::Uncalibrated;
        options
    }

    fn prior(options: &RunOptions, both: bool) -> f64 {
        let mut phone = phone(both);
        let options = FirstLook::new(&mut phone, options).options(options);
        options.config.bounded_velocity.initial_hard_iron_std_ut
    }

    #[test]
    fn the_systems_offset_is_taken_from_the_uncalibrated_stream_and_said() {
        let options = uncalibrated();
        let mut phone = phone(true);
        let mut look = FirstLook::new(&mut phone, &options);
        let sentence = look.sentence().unwrap();
        assert!(sentence.contains("(300.0, -100.0, 20.0) uT"), "{sentence}");
        let mut count = 0;
        let mut instant = Instant::default();
        while look.read(&mut instant).unwrap() {
            let left =
                instant.magnetic_field_uncalibrated.unwrap() - instant.magnetic_field.unwrap();
            assert!(left.amax() < 1e-9, "{left}");
            count += 1;
        }
        assert_eq!(count, 100, "nothing is lost");
    }

    #[test]
    fn other_streams_and_calibrations_are_left_alone() {
        let sentence = |both, options: &RunOptions| {
            let mut phone = phone(both);
            FirstLook::new(&mut phone, options).sentence()
        };
        assert_eq!(sentence(true, &RunOptions::default()), None);
        let mut taken_over = uncalibrated();
        taken_over.start = Some(state());
        assert_eq!(sentence(true, &taken_over), None);
        let mut phone = phone(false);
        let mut missing = FirstLook::new(&mut phone, &uncalibrated());
        assert_eq!(missing.sentence(), None);
        let mut instant = Instant::default();
        assert!((0..100).all(|_| missing.read(&mut instant).unwrap()));
        assert!(!missing.read(&mut instant).unwrap());
    }

    #[test]
    fn the_prior_follows_from_the_stream_unless_it_is_set() {
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} for {b}");
        near(prior(&RunOptions::default(), false), 0.0);
        near(prior(&RunOptions::default(), true), LEFT_BY_THE_SYSTEM_UT);
        near(prior(&uncalibrated(), true), LEFT_UNCALIBRATED_UT);
        let mut set = uncalibrated();
        set.set("bounded_initial_hard_iron_std_ut=5").unwrap();
        near(prior(&set, true), 5.0);
    }

    #[test]
    fn where_the_choice_is_free_a_filter_of_hard_iron_takes_the_uncalibrated_stream() {
        let mut free = RunOptions {
            choose_magnetometer: true,
            ..RunOptions::default()
        };
        let taken = |options: &RunOptions, both: bool| {
            let mut phone = phone(both);
            let look = FirstLook::new(&mut phone, options);
            let sentence = look.sentence();
            (look.options(options).sensors.magnetometer_source, sentence)
        };
        let (stream, sentence) = taken(&free, true);
        assert_eq!(stream, MagnetometerSource::Uncalibrated);
        assert!(sentence.unwrap().contains("It was chosen because"));
        assert_eq!(taken(&free, false), (MagnetometerSource::Device, None));
        free.estimator = EstimatorKind::Mekf;
        assert_eq!(taken(&free, true), (MagnetometerSource::Device, None));
        free.estimator = EstimatorKind::BoundedVelocity;
        free.start = Some(state());
        assert_eq!(taken(&free, true), (MagnetometerSource::Device, None));
    }

    #[test]
    fn an_error_at_the_start_comes_out_where_it_was() {
        let failed = || Err(EvaluationError::NoDeviceOrientation);
        let mut instants = phone(true).take(3).chain(std::iter::once_with(failed));
        let mut look = FirstLook::new(&mut instants, &uncalibrated());
        let mut instant = Instant::default();
        assert!((0..3).all(|_| look.read(&mut instant).unwrap()));
        assert!(look.read(&mut instant).is_err());
        assert!(!look.read(&mut instant).unwrap());
    }
}
