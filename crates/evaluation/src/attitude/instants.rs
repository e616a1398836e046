//! Instants: events of one time stamp, taken together.

use nalgebra::{UnitQuaternion, Vector3};
use northing_recording::{
    CompassHeading, Event, GnssPosition, GnssVelocity, Reference, Sample, SensorKind,
};

use crate::attitude::sampling_times::{Arrived, SamplingTimes};
use crate::error::EvaluationError;

/// Everything measured at one time stamp.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Instant {
    /// Time stamp, ns; where samples come in bunches, the time at which they were taken.
    pub time_ns: i64,
    /// How much later than that their stamps are, ns.
    pub late_ns: i64,
    /// Angular rate, rad/s.
    pub angular_rate: Option<Vector3<f64>>,
    /// Specific force, m/s^2.
    pub specific_force: Option<Vector3<f64>>,
    /// Magnetic field as the device calibrated it, microtesla.
    pub magnetic_field: Option<Vector3<f64>>,
    /// Magnetic field without the device's calibration, microtesla.
    pub magnetic_field_uncalibrated: Option<Vector3<f64>>,
    /// Position in the recording's world frame, m.
    pub position: Option<Vector3<f64>>,
    /// The heading that the device reports.
    pub compass: Option<CompassHeading>,
    /// The device's own orientation, if finite.
    pub device: Option<UnitQuaternion<f64>>,
    /// The reference, if finite.
    pub reference: Option<Reference>,
    /// A fix of a satellite receiver, if finite.
    pub fix: Option<GnssPosition>,
    /// A velocity over ground, if finite.
    pub ground_velocity: Option<GnssVelocity>,
    /// Which sensors had a sample at all: bit [`SensorKind::order`].
    pub present: u32,
    /// Angular rates of this very stamp before [`Self::angular_rate`], which differ from it.
    pub rates_before: u32,
}

impl Instant {
    /// Of the events of one stamp; of none it is empty, at 0.
    pub(crate) fn of(events: impl IntoIterator<Item = Event>) -> Self {
        let mut instant = Self::default();
        for event in events {
            instant.time_ns = event.time_ns;
            instant.take(&event);
        }
        instant
    }

    /// Empties it, for the events of another stamp.
    pub fn begin(&mut self, time_ns: i64) {
        let Self {
            time_ns: stamp,
            late_ns,
            angular_rate,
            specific_force,
            magnetic_field,
            magnetic_field_uncalibrated,
            position,
            compass,
            device,
            reference,
            fix,
            ground_velocity,
            present,
            rates_before,
        } = self;
        // One by one: numbers that are none need not be written.
        for vector in [
            angular_rate,
            specific_force,
            magnetic_field,
            magnetic_field_uncalibrated,
            position,
        ] {
            *vector = None;
        }
        (*compass, *device, *reference) = (None, None, None);
        (*fix, *ground_velocity) = (None, None);
        (*stamp, *late_ns, *present, *rates_before) = (time_ns, 0, 0, 0);
    }

    /// Takes an event of this stamp.
    pub fn take(&mut self, event: &Event) {
        let sensor = event.sample.kind();
        if let Some(vector) = event.sample.vector() {
            return self.take_vector(sensor, vector);
        }
        self.present |= 1 << sensor.order();
        match event.sample {
            Sample::CompassHeading(c) => self.compass = Some(c),
            Sample::DeviceOrientation(q) if event.sample.is_finite() => self.device = Some(q),
            Sample::Reference(r) if event.sample.is_finite() => self.reference = Some(r),
            Sample::GnssPosition(fix) if event.sample.is_finite() => self.fix = Some(fix),
            Sample::GnssVelocity(v) if event.sample.is_finite() => self.ground_velocity = Some(v),
            _ => {}
        }
    }

    /// Takes a vector of this stamp, in the unit of its sensor.
    pub fn take_vector(&mut self, sensor: SensorKind, vector: Vector3<f64>) {
        self.present |= 1 << sensor.order();
        match sensor {
            SensorKind::Gyroscope => {
                let before = self.angular_rate.replace(vector);
                self.rates_before += u32::from(before.is_some_and(|before| before != vector));
            }
            SensorKind::Accelerometer => self.specific_force = Some(vector),
            SensorKind::Magnetometer => self.magnetic_field = Some(vector),
            SensorKind::MagnetometerUncalibrated => self.magnetic_field_uncalibrated = Some(vector),
            SensorKind::Position => self.position = Some(vector),
            _ => {}
        }
    }

    /// The sensors that had a sample.
    pub fn sensors(&self) -> impl Iterator<Item = SensorKind> + use<> {
        let present = self.present;
        SensorKind::ALL
            .into_iter()
            .filter(move |kind| present & (1 << kind.order()) != 0)
    }
}

/// Instants in time order. Each is written where it is read from: handed on by value, so large a thing costs more than what is
/// done with it.
pub trait InstantSource {
    /// Puts the next instant in the place of the last one; false at the end.
    ///
    /// # Errors
    /// Those of what the instants are of.
    fn read(&mut self, instant: &mut Instant) -> Result<bool, EvaluationError>;
}

impl<I: Iterator<Item = Result<Instant, EvaluationError>>> InstantSource for I {
    fn read(&mut self, instant: &mut Instant) -> Result<bool, EvaluationError> {
        let Some(next) = self.next().transpose()? else {
            return Ok(false);
        };
        *instant = next;
        Ok(true)
    }
}

/// Gathers events of one time. Where a sensor's samples come in bunches that is the time at which they were taken, which its clock tells;
/// else it is their stamp. After an error it ends.
#[derive(Debug)]
pub struct Instants<I, X> {
    events: SamplingTimes<I, X>,
    next: Option<Arrived>,
    over: bool,
}

impl<I, X> Instants<I, X>
where
    I: Iterator<Item = Result<Event, X>>,
{
    /// Gathers these events, which must be in time order.
    pub fn new(events: impl IntoIterator<IntoIter = I>) -> Self {
        Self {
            events: SamplingTimes::new(events.into_iter()),
            next: None,
            over: false,
        }
    }
}

impl<I, X> Iterator for Instants<I, X>
where
    I: Iterator<Item = Result<Event, X>>,
{
    type Item = Result<Instant, X>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.over {
            return None;
        }
        let mut instant: Option<Instant> = None;
        loop {
            let arrived = match self.next.take().map(Ok).or_else(|| self.events.next()) {
                Some(Ok(arrived)) => arrived,
                Some(Err(error)) => {
                    self.over = true;
                    return Some(Err(error));
                }
                None => {
                    self.over = true;
                    return instant.map(Ok);
                }
            };
            let event = &arrived.event;
            let gathered = instant.get_or_insert_with(|| Instant {
                time_ns: event.time_ns,
                late_ns: arrived.arrived_ns.saturating_sub(event.time_ns),
                ..Instant::default()
            });
            if gathered.time_ns != event.time_ns {
                self.next = Some(arrived);
                return Some(Ok(*gathered));
            }
            gathered.take(event);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn events_of_one_stamp_come_together_and_an_error_ends_it() {
        let event = |time_ns, sample| Ok::<_, &str>(Event { time_ns, sample });
        let rate = Sample::AngularRate(Vector3::x());
        let force = Sample::SpecificForce(Vector3::z());
        let events = vec![
            event(1, rate),
            event(1, force),
            event(1, Sample::Pressure(1e5)),
            event(2, force),
            Err("broken"),
            event(3, rate),
        ];
        let got: Vec<_> = Instants::new(events).collect();
        let first = got[0].unwrap();
        assert_eq!((first.time_ns, first.angular_rate), (1, Some(Vector3::x())));
        let sensors: Vec<_> = first.sensors().collect();
        assert_eq!(
            sensors,
            [
                SensorKind::Gyroscope,
                SensorKind::Accelerometer,
                SensorKind::Pressure
            ]
        );
        assert_eq!(
            got[1],
            Err("broken"),
            "the instant that an error cuts short is dropped"
        );
        assert_eq!(got.len(), 2);
    }

    #[test]
    fn orientations_that_are_not_finite_do_not_count_and_vectors_are_passed_on() {
        let nan = UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(f64::NAN, 0.0, 0.0, 0.0));
        let events = [
            Sample::AngularRate(Vector3::new(f64::NAN, 0.0, 0.0)),
            Sample::DeviceOrientation(nan),
            Sample::Reference(Reference {
                attitude: nan,
                scored: true,
            }),
        ];
        let events = events.map(|sample| Ok::<_, &str>(Event { time_ns: 0, sample }));
        let instant = Instants::new(events).next().unwrap().unwrap();
        assert!(instant.angular_rate.unwrap().x.is_nan());
        assert_eq!((instant.device, instant.reference), (None, None));
        assert_eq!(instant.sensors().count(), 3);
    }
}
