//! Our own events as bytes, exact to the bit: what virtual phones and replays deliver.
//!
//! A payload is the byte 1 (the version) and then, for each event: the sensor's byte in the
//! table of sensors, a flag (1 byte; of a reference whether it is scored), the stamp
//! (`i64`, ns), and the numbers of the sample (`f64`): three of a vector, four of a quaternion in the
//! order w, x, y, z with the sign it has inside, two of a compass heading, one of a pressure, and so on (NaN
//! where a number is absent). Little-endian throughout.

use nalgebra::{Quaternion, UnitQuaternion};

use super::WireError;
use crate::event::{Event, Reference, Sample, SensorKind, quaternion_from_file};
use crate::numbers::{self, numbers};

const VERSION: u8 = 1;
/// Sensor, flag, stamp.
const HEAD: usize = 10;
/// A quaternion whose norm is farther than this from 1 was not written by this program.
const NORM_TOLERANCE: f64 = 1e-6;

/// The events as bytes.
#[must_use]
pub fn encode(events: &[Event]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(1 + events.len() * (HEAD + 32));
    bytes.push(VERSION);
    for event in events {
        let (numbers, count) = numbers(&event.sample);
        let scored = matches!(
            event.sample,
            Sample::Reference(Reference { scored: true, .. })
        );
        bytes.push(event.sample.kind().code());
        bytes.push(u8::from(scored));
        bytes.extend_from_slice(&event.time_ns.to_le_bytes());
        for number in &numbers[..count] {
            bytes.extend_from_slice(&number.to_le_bytes());
        }
    }
    bytes
}

/// The events of a payload.
///
/// # Errors
/// A line when the version is another, a sensor is unknown, or the bytes end within an event.
pub fn decode(bytes: &[u8]) -> Result<Vec<Event>, WireError> {
    let mut events = Vec::with_capacity(bytes.len() / (HEAD + 24));
    read(bytes, |event| events.push(event))?;
    Ok(events)
}

/// Shows the events of a payload, one after the other; errors as of [`decode`].
pub(crate) fn read(bytes: &[u8], mut see: impl FnMut(Event)) -> Result<(), WireError> {
    let Some((&VERSION, mut rest)) = bytes.split_first() else {
        return Err(WireError::new(format!(
            "these are no events of this program: they start with the byte {VERSION}"
        )));
    };
    let mut count = 0;
    while !rest.is_empty() {
        let event = next(&mut rest).ok_or_else(|| {
            WireError::new(format!(
                "the events cannot be read beyond number {count}: an unknown sensor, or bytes are missing"
            ))
        })?;
        see(event);
        count += 1;
    }
    Ok(())
}

/// Where the events begin in a payload.
pub(crate) const FIRST: usize = 1;

/// The next event, which is taken off; none at the end or where it cannot be read.
pub(crate) fn next(rest: &mut &[u8]) -> Option<Event> {
    let [sensor, flag] = take::<2>(rest)?;
    let kind = SensorKind::of_code(sensor)?;
    let time_ns = i64::from_le_bytes(take(rest)?);
    let sample = match kind {
        SensorKind::DeviceOrientation => Sample::DeviceOrientation(quaternion(rest)?),
        SensorKind::Reference => Sample::Reference(Reference {
            attitude: quaternion(rest)?,
            scored: flag != 0,
        }),
        _ => {
            let mut row = [0.0; numbers::MOST];
            let row = &mut row[..numbers::widths(kind).0];
            for value in row.iter_mut() {
                *value = number(rest)?;
            }
            numbers::sample(kind, row, true)?
        }
    };
    Some(Event { time_ns, sample })
}

fn take<const N: usize>(rest: &mut &[u8]) -> Option<[u8; N]> {
    let (head, tail) = rest.split_first_chunk::<N>()?;
    *rest = tail;
    Some(*head)
}

fn number(rest: &mut &[u8]) -> Option<f64> {
    take(rest).map(f64::from_le_bytes)
}

fn quaternion(rest: &mut &[u8]) -> Option<UnitQuaternion<f64>> {
    let [w, x, y, z] = [number(rest)?, number(rest)?, number(rest)?, number(rest)?];
    let q = Quaternion::new(w, x, y, z);
    // As it was: normalising again would change the last bits.
    if (q.norm() - 1.0).abs() < NORM_TOLERANCE {
        return Some(UnitQuaternion::new_unchecked(q));
    }
    Some(quaternion_from_file(w, x, y, z))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device_navigation::{DeviceNavigation, validity_of};
    use crate::event::{CompassHeading, TrueHeading, WaterVelocity};
    use crate::gnss::{GnssPosition, GnssQuality, GnssVelocity};
    use nalgebra::Vector3;

    /// Samples with and without what may be absent.
    fn navigation() -> Vec<Event> {
        let full = GnssPosition {
            latitude_rad: 0.7,
            longitude_rad: -1.0 / 3.0,
            height_m: Some(-1.5),
            std_m: Some([0.01, 0.02, 0.03]),
            hdop: Some(0.9),
            satellites: Some(21),
            quality: GnssQuality::RtkFloat,
        };
        let bare = GnssPosition {
            height_m: None,
            std_m: None,
            hdop: None,
            satellites: None,
            quality: GnssQuality::Unknown,
            ..full
        };
        let velocity = GnssVelocity {
            north_m_s: 1.0,
            east_m_s: -2.0,
            down_m_s: None,
            std_m_s: None,
        };
        let samples = [
            Sample::GnssPosition(full),
            Sample::ReferencePosition(bare),
            Sample::GnssVelocity(velocity),
            Sample::GnssVelocity(GnssVelocity {
                down_m_s: Some(0.1),
                std_m_s: Some([0.1; 3]),
                ..velocity
            }),
            Sample::DeviceNavigation(DeviceNavigation {
                latitude_rad: 0.7,
                longitude_rad: -1.0 / 3.0,
                height_m: -1.5,
                std_m: [1.0 / 3.0, 2.0, 3.0],
                velocity_m_s: [0.1, -0.2, 0.3],
                heading_std_rad: 0.1,
                validity: validity_of(2),
            }),
            Sample::ForwardSpeed(-0.5),
            Sample::WaterVelocity(WaterVelocity {
                forward_m_s: 4.0,
                starboard_m_s: None,
            }),
            Sample::TrueHeading(TrueHeading {
                heading_rad: 6.0,
                std_rad: Some(0.01),
            }),
        ];
        samples.map(|sample| event(3, sample)).to_vec()
    }

    #[test]
    fn every_sensor_has_one_byte_of_its_own() {
        for (place, kind) in SensorKind::ALL.into_iter().enumerate() {
            assert_eq!(kind.order(), place);
            assert_eq!(SensorKind::of_code(kind.code()), Some(kind));
        }
    }

    fn event(time_ns: i64, sample: Sample) -> Event {
        Event { time_ns, sample }
    }

    #[test]
    fn every_kind_comes_back_to_the_bit() {
        let q = UnitQuaternion::from_euler_angles(0.1, -2.0, 3.0);
        let minus = UnitQuaternion::new_unchecked(-q.into_inner());
        let v = Vector3::new(0.1 + 0.2, -0.0, f64::MIN_POSITIVE / 3.0);
        let mut events: Vec<Event> = SensorKind::ALL
            .into_iter()
            .filter_map(|kind| Sample::from_vector(kind, v))
            .map(|sample| event(i64::MIN, sample))
            .collect();
        events.push(event(-1, Sample::DeviceOrientation(minus)));
        events.push(event(i64::MAX, Sample::Pressure(1e5 / 3.0)));
        let (heading_rad, std_rad) = (2.0 / 3.0, 0.1);
        let heading = CompassHeading {
            heading_rad,
            std_rad,
        };
        events.push(event(7, Sample::CompassHeading(heading)));
        events.extend(navigation());
        for scored in [true, false] {
            let reference = Reference {
                attitude: q,
                scored,
            };
            events.push(event(0, Sample::Reference(reference)));
        }
        let bytes = encode(&events);
        let back = decode(&bytes).unwrap();
        assert_eq!(encode(&back), bytes);
        assert_eq!(back, events);
        let nan = [event(
            0,
            Sample::Pressure(f64::from_bits(0x7ff8_0000_dead_beef)),
        )];
        assert_eq!(encode(&decode(&encode(&nan)).unwrap()), encode(&nan));
    }

    #[test]
    fn what_was_cut_or_comes_from_elsewhere_is_refused() {
        let bytes = encode(&[event(5, Sample::Pressure(1.0))]);
        for cut in 2..bytes.len() {
            assert!(decode(&bytes[..cut]).is_err(), "{cut}");
        }
        assert_eq!(decode(&bytes[..1]).unwrap(), []);
        for bad in [&b""[..], b"{}", &[2, 0, 0], &[1, 99, 0, 0]] {
            assert!(decode(bad).is_err(), "{bad:?}");
        }
    }
}
