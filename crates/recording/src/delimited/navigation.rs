//! Cells whose numbers are not simply those of a sample.

use nalgebra::{Rotation3, UnitQuaternion, Vector3};
use northing_core::earth::Geodetic;

use super::{Cells, Form};
use crate::error::Result;
use crate::event::{Reference, Sample};
use crate::gnss::{GnssPosition, GnssQuality, GnssVelocity};
use crate::numbers::MOST;

impl Cells<'_> {
    /// The sample that is meant by the numbers of a form, of which `sample` was made as if they were plain.
    pub(super) fn converted(
        &self,
        sample: Sample,
        form: Form,
        row: &[f64; MOST],
    ) -> Result<Option<Sample>> {
        Ok(match (form, sample) {
            (Form::Increment, vector) => {
                // Over how long the first row's increment was gained nobody knows.
                let rate = vector.vector().zip(self.interval_s).map(|(v, s)| v / s);
                rate.and_then(|rate| Sample::from_vector(vector.kind(), rate))
            }
            (Form::Inverse, Sample::DeviceOrientation(q)) => {
                Some(Sample::DeviceOrientation(q.inverse()))
            }
            (Form::Inverse, Sample::Reference(reference)) => Some(Sample::Reference(Reference {
                attitude: reference.attitude.inverse(),
                ..reference
            })),
            (Form::PressureHeight, _) => Some(Sample::Pressure(standard_pressure(row[0]))),
            (Form::RtklibPosition, Sample::GnssPosition(fix)) => {
                let quality = rtklib_quality(row[8]);
                Some(Sample::GnssPosition(GnssPosition { quality, ..fix }))
            }
            (Form::DegreesMinutes, Sample::GnssPosition(fix)) => {
                Some(Sample::GnssPosition(GnssPosition {
                    latitude_rad: of_degrees_minutes(fix.latitude_rad).to_radians(),
                    longitude_rad: of_degrees_minutes(fix.longitude_rad).to_radians(),
                    ..fix
                }))
            }
            (Form::SpeedAndCourse, _) => {
                let [speed, course, std, ..] = *row;
                Some(Sample::GnssVelocity(GnssVelocity {
                    std_m_s: (!std.is_nan()).then_some([std; 3]),
                    ..GnssVelocity::from_course(speed, course)
                }))
            }
            (Form::RollPitchYaw, _) => {
                let [roll, pitch, yaw, ..] = *row;
                Some(Sample::DeviceOrientation(
                    UnitQuaternion::from_euler_angles(roll, pitch, yaw),
                ))
            }
            (Form::Local(place), Sample::GnssPosition(fix)) => {
                let [north, east, down, ..] = *row;
                let fix = place.fix_ned([north, east, down], fix);
                Some(Sample::GnssPosition(fix))
            }
            (Form::Ecef { place, inverse }, sample) => self.of_ecef(place, inverse, sample)?,
            (_, plain) => Some(plain),
        })
    }

    /// A sample in north, east, down of one in Earth-centred, Earth-fixed axes.
    fn of_ecef(&self, place: [usize; 3], inverse: bool, read: Sample) -> Result<Option<Sample>> {
        let mut ecef = Vector3::repeat(f64::NAN);
        for (x, column) in ecef.iter_mut().zip(place) {
            *x = self.number(column)?.unwrap_or(f64::NAN);
        }
        if ecef.iter().all(|x| x.is_nan()) {
            return Ok(None);
        }
        let place = Geodetic::from_ecef(&ecef);
        let ned_from_ecef = place.ned_from_ecef();
        Ok(match read {
            Sample::ReferencePosition(_) => Some(Sample::ReferencePosition(GnssPosition {
                latitude_rad: place.latitude_rad,
                longitude_rad: place.longitude_rad,
                height_m: Some(place.height_m),
                ..GnssPosition::default()
            })),
            Sample::ReferenceVelocity(v) => Some(Sample::ReferenceVelocity(ned_from_ecef * v)),
            Sample::Reference(Reference { attitude, scored }) => {
                let ecef_from_body = if inverse {
                    attitude.inverse()
                } else {
                    attitude
                };
                let rotation = Rotation3::from_matrix_unchecked(ned_from_ecef);
                let ned_from_ecef = UnitQuaternion::from_rotation_matrix(&rotation);
                let attitude = ned_from_ecef * ecef_from_body;
                Some(Sample::Reference(Reference { attitude, scored }))
            }
            _ => None,
        })
    }
}

/// Degrees of a number that is a hundred times the degrees plus the minutes; both have its sign.
pub(crate) fn of_degrees_minutes(number: f64) -> f64 {
    let degrees = (number / 100.0).trunc();
    degrees + (number - 100.0 * degrees) / 60.0
}

/// The quality of RTKLIB's number; NaN where there is none.
fn rtklib_quality(code: f64) -> GnssQuality {
    // A float as an integer saturates.
    match code as u8 {
        _ if code.is_nan() => GnssQuality::Unknown,
        0 => GnssQuality::Invalid,
        1 => GnssQuality::RtkFixed,
        2 => GnssQuality::RtkFloat,
        3 | 4 | 6 => GnssQuality::Differential,
        5 => GnssQuality::Autonomous,
        _ => GnssQuality::Unknown,
    }
}

/// Pressure (Pa) at a height (m) in the lowest layer of the International Standard Atmosphere.
pub(crate) fn standard_pressure(height_m: f64) -> f64 {
    const SEA_LEVEL_PA: f64 = 101_325.0;
    // T0 / lapse rate = 288.15 K / 0.0065 K/m; exponent g0 M / (R lapse rate).
    const SCALE_M: f64 = 288.15 / 0.0065;
    const EXPONENT: f64 = 5.255_88;
    SEA_LEVEL_PA * (1.0 - height_m / SCALE_M).powf(EXPONENT)
}
