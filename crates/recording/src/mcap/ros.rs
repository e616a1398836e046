//! ROS 2 messages `sensor_msgs/Imu` and `sensor_msgs/MagneticField` as bytes, and our samples of them.
//!
//! Read first: REP 145 (topics, frames) and the comments in the message definitions. SI units, field
//! in tesla; orientation `world_from_body`, world axes ENU (REP 103), in the order x, y, z, w.
//! Covariances are row-major; all zeros means that they are not known, -1 in the first place that the
//! quantity itself is not there.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use super::cdr::{CdrReader, CdrWriter};
use crate::event::quaternion_from_file;
use crate::writer::quaternion_to_file;

/// The name of the schema of [`Imu`].
pub(crate) const IMU: &str = "sensor_msgs/msg/Imu";
/// The name of the schema of [`MagneticField`].
pub(crate) const MAGNETIC_FIELD: &str = "sensor_msgs/msg/MagneticField";
/// What viewers need to read [`Imu`], with the messages that it is made of.
pub(crate) const IMU_DEFINITION: &str = include_str!("imu.msg");
/// The same of [`MagneticField`].
pub(crate) const MAGNETIC_FIELD_DEFINITION: &str = include_str!("magnetic_field.msg");

/// "All zeros": the covariance is not known.
const NOT_KNOWN: [f64; 9] = [0.0; 9];
/// "-1 in the first place": the quantity is not there.
const NOT_THERE: [f64; 9] = [-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
const MICROTESLA_PER_TESLA: f64 = 1e6;
const NS_PER_S: i64 = 1_000_000_000;

/// One `sensor_msgs/Imu`: what was measured at one instant.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Imu {
    pub(crate) time_ns: i64,
    /// `enu_from_body` and, where known, the covariance of its error about the axes of the world,
    /// rad^2.
    pub(crate) orientation: Option<(UnitQuaternion<f64>, Option<Matrix3<f64>>)>,
    /// rad/s.
    pub(crate) angular_rate: Option<Vector3<f64>>,
    /// m/s^2.
    pub(crate) specific_force: Option<Vector3<f64>>,
}

/// One `sensor_msgs/MagneticField`.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct MagneticField {
    pub(crate) time_ns: i64,
    /// Microtesla, as everywhere here.
    pub(crate) field_ut: Vector3<f64>,
}

impl Imu {
    /// The message; `None` when the stamp is beyond what ROS can hold.
    pub(crate) fn encode(&self, frame: &str) -> Option<Vec<u8>> {
        let mut out = CdrWriter::new();
        header(&mut out, self.time_ns, frame)?;
        match &self.orientation {
            Some((q, covariance)) => {
                let [w, x, y, z] = quaternion_to_file(q);
                out.f64s(&[x, y, z, w]);
                out.f64s(&covariance.map_or(NOT_KNOWN, row_major));
            }
            None => {
                out.f64s(&[0.0, 0.0, 0.0, 1.0]);
                out.f64s(&NOT_THERE);
            }
        }
        for vector in [self.angular_rate, self.specific_force] {
            // Whoever does not look at the covariance shall not take a zero for a measurement.
            out.f64s(vector.unwrap_or(Vector3::repeat(f64::NAN)).as_slice());
            out.f64s(&vector.map_or(NOT_THERE, |_| NOT_KNOWN));
        }
        Some(out.into_bytes())
    }

    /// Reads a message; a stamp of zero is replaced by `log_time_ns`.
    pub(crate) fn decode(bytes: &[u8], log_time_ns: i64) -> Option<Self> {
        let mut input = CdrReader::new(bytes)?;
        let time_ns = stamp(&mut input, log_time_ns)?;
        let [x, y, z, w] = input.f64s()?;
        let covariance = input.f64s::<9>()?;
        let q = quaternion_from_file(w, x, y, z);
        let orientation =
            (is_there(&covariance) && q.coords.iter().all(|c| c.is_finite())).then(|| {
                (
                    q,
                    is_known(&covariance).then(|| Matrix3::from_row_slice(&covariance)),
                )
            });
        let mut vector = || -> Option<Option<Vector3<f64>>> {
            let v = Vector3::from(input.f64s::<3>()?);
            let covariance = input.f64s::<9>()?;
            Some(is_there(&covariance).then_some(v))
        };
        Some(Self {
            time_ns,
            orientation,
            angular_rate: vector()?,
            specific_force: vector()?,
        })
    }
}

impl MagneticField {
    /// The message; `None` when the stamp is beyond what ROS can hold.
    pub(crate) fn encode(&self, frame: &str) -> Option<Vec<u8>> {
        let mut out = CdrWriter::new();
        header(&mut out, self.time_ns, frame)?;
        out.f64s((self.field_ut / MICROTESLA_PER_TESLA).as_slice());
        out.f64s(&NOT_KNOWN);
        Some(out.into_bytes())
    }

    /// Reads a message; a stamp of zero is replaced by `log_time_ns`.
    pub(crate) fn decode(bytes: &[u8], log_time_ns: i64) -> Option<Self> {
        let mut input = CdrReader::new(bytes)?;
        let time_ns = stamp(&mut input, log_time_ns)?;
        let field_t = Vector3::from(input.f64s::<3>()?);
        input.f64s::<9>()?;
        Some(Self {
            time_ns,
            field_ut: field_t * MICROTESLA_PER_TESLA,
        })
    }
}

pub(crate) fn header(out: &mut CdrWriter, time_ns: i64, frame: &str) -> Option<()> {
    out.i32(i32::try_from(time_ns.div_euclid(NS_PER_S)).ok()?);
    out.u32(u32::try_from(time_ns.rem_euclid(NS_PER_S)).ok()?);
    out.string(frame);
    Some(())
}

pub(crate) fn stamp(input: &mut CdrReader<'_>, log_time_ns: i64) -> Option<i64> {
    let time_ns = time(input)?;
    input.skip_string()?;
    Some(if time_ns == 0 { log_time_ns } else { time_ns })
}

/// The frame of a header, whose stamp is passed over.
pub(crate) fn header_frame<'a>(input: &mut CdrReader<'a>) -> Option<&'a str> {
    let _stamp = time(input)?;
    input.string()
}

/// The stamp alone.
fn time(input: &mut CdrReader<'_>) -> Option<i64> {
    if input.is_ros_1() {
        let _sequence = input.u32()?;
    }
    let (seconds, ns) = (input.i32()?, input.u32()?);
    Some(i64::from(seconds) * NS_PER_S + i64::from(ns))
}

/// The frame in the header of a message: CDR behind its four bytes of encapsulation.
#[must_use]
pub fn frame(bytes: &[u8]) -> Option<&str> {
    header_frame(&mut CdrReader::new(bytes)?)
}

fn is_there(covariance: &[f64; 9]) -> bool {
    covariance[0] >= 0.0
}

fn is_known(covariance: &[f64; 9]) -> bool {
    covariance.iter().any(|c| *c > 0.0)
}

fn row_major(m: Matrix3<f64>) -> [f64; 9] {
    std::array::from_fn(|index| m[(index / 3, index % 3)])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn f64_at(bytes: &[u8], at: usize) -> f64 {
        f64::from_le_bytes(bytes[at..at + 8].try_into().unwrap())
    }

    #[test]
    fn an_imu_message_has_the_layout_worked_out_by_hand() {
        let q = UnitQuaternion::from_euler_angles(0.1, 0.2, 0.3);
        let p = Matrix3::new(1.0, 2.0, 3.0, 2.0, 5.0, 6.0, 3.0, 6.0, 9.0);
        let imu = Imu {
            time_ns: 1_500_000_000,
            orientation: Some((q, Some(p))),
            angular_rate: Some(Vector3::new(0.1, 0.2, 0.3)),
            specific_force: None,
        };
        let bytes = imu.encode("imu").unwrap();
        // Header 4; stamp 8; string 4 + 4; then 4 + 9 + 3 + 9 + 3 + 9 numbers.
        assert_eq!(bytes.len(), 4 + 16 + 37 * 8);
        assert_eq!(bytes[..12], [0, 1, 0, 0, 1, 0, 0, 0, 0, 0x65, 0xcd, 0x1d]);
        assert_eq!(bytes[12..20], [4, 0, 0, 0, b'i', b'm', b'u', 0]);
        let number = |index: usize| f64_at(&bytes, 20 + 8 * index);
        let expected = [
            q.i, q.j, q.k, q.w, 1.0, 2.0, 3.0, 2.0, 5.0, 6.0, 3.0, 6.0, 9.0, 0.1,
        ];
        for (index, value) in expected.into_iter().enumerate() {
            assert_eq!(number(index).to_bits(), value.to_bits(), "{index}");
        }
        assert!(number(25).is_nan() && (number(28) + 1.0).abs() < 1e-15);
        assert_eq!(Imu::decode(&bytes, 0).unwrap(), imu);
        for cut in 0..bytes.len() {
            assert_eq!(Imu::decode(&bytes[..cut], 0), None, "{cut}");
        }
    }

    #[test]
    fn a_field_is_in_tesla_and_stamps_may_be_negative_or_missing() {
        let field = MagneticField {
            time_ns: -1,
            field_ut: Vector3::new(0.0, 22.0, -42.0),
        };
        let bytes = field.encode("imu").unwrap();
        assert_eq!(bytes.len(), 4 + 16 + 12 * 8);
        // -1 s and 999999999 ns.
        assert_eq!(
            bytes[4..12],
            [0xff, 0xff, 0xff, 0xff, 0xff, 0xc9, 0x9a, 0x3b]
        );
        approx::assert_relative_eq!(f64_at(&bytes, 28), 22e-6, max_relative = 1e-15);
        let back = MagneticField::decode(&bytes, 9).unwrap();
        assert_eq!(back.time_ns, -1);
        approx::assert_relative_eq!(back.field_ut, field.field_ut, max_relative = 1e-15);
        let mut unstamped = bytes;
        unstamped[4..12].fill(0);
        assert_eq!(MagneticField::decode(&unstamped, 9).unwrap().time_ns, 9);
        let late = MagneticField {
            time_ns: i64::MAX,
            ..field
        };
        assert_eq!(late.encode("imu"), None);
    }

    #[test]
    fn definitions_are_complete() {
        for (definition, parts) in [(IMU_DEFINITION, 4), (MAGNETIC_FIELD_DEFINITION, 3)] {
            let names: Vec<&str> = definition
                .lines()
                .filter_map(|line| line.strip_prefix("MSG: "))
                .collect();
            assert_eq!(names.len(), parts, "{names:?}");
            for line in definition.lines() {
                let kind = line.split([' ', '[']).next().unwrap_or_default();
                if kind.contains('/') {
                    assert!(names.contains(&kind), "{kind}");
                }
            }
        }
    }
}
