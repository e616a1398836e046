//! Cells of satellite receivers and reference tracks whose numbers are not simply columns.

use nalgebra::{Rotation3, UnitQuaternion, Vector3};
use northing_core::earth::Geodetic;

use super::{Cells, Channel};
use crate::error::Result;
use crate::event::{Reference, Sample, SensorKind, quaternion_from_file};
use crate::gnss::{GnssPosition, GnssQuality, GnssVelocity};

/// A pose in Earth-centred, Earth-fixed axes; its parts are samples of their own.
#[derive(Debug, Clone, Copy)]
pub(crate) struct EcefPose {
    pub(crate) position: [usize; 3],
    pub(crate) part: EcefPart,
}

/// What of a pose a channel gives, with the columns beside those of the position.
#[derive(Debug, Clone, Copy)]
pub(crate) enum EcefPart {
    Position,
    Velocity([usize; 3]),
    /// w, x, y, z; `inverse` when the file holds body-from-ECEF.
    Attitude {
        columns: [usize; 4],
        inverse: bool,
    },
}

impl EcefPose {
    pub(super) fn columns(&self) -> Vec<usize> {
        match self.part {
            EcefPart::Position => self.position.to_vec(),
            EcefPart::Velocity(columns) => columns.to_vec(),
            EcefPart::Attitude { columns, .. } => columns.to_vec(),
        }
    }

    pub(super) fn kind(&self) -> SensorKind {
        match self.part {
            EcefPart::Position => SensorKind::ReferencePosition,
            EcefPart::Velocity(_) => SensorKind::ReferenceVelocity,
            EcefPart::Attitude { .. } => SensorKind::Reference,
        }
    }
}

impl Cells<'_> {
    /// The row's sample of the channels of this file; `None` when its cells are empty.
    pub(super) fn navigation(&self, channel: &Channel) -> Result<Option<Sample>> {
        match channel {
            Channel::PressureHeight { column } => {
                let height = self.number(*column)?;
                Ok(height.map(|h| Sample::Pressure(standard_pressure(h))))
            }
            Channel::RtklibPosition { columns, factors } => {
                let sample = self.row_of(SensorKind::GnssPosition, columns, factors)?;
                let Some(Sample::GnssPosition(mut fix)) = sample else {
                    return Ok(sample);
                };
                let code = columns[8].map_or(Ok(None), |column| self.number(column))?;
                fix.quality = code.map_or(GnssQuality::Unknown, rtklib_quality);
                Ok(Some(Sample::GnssPosition(fix)))
            }
            Channel::SpeedAndCourse {
                speed,
                course,
                std,
                to_m_per_s,
                to_rad,
            } => {
                let Some([speed, course]) = self.numbers(&[*speed, *course])? else {
                    return Ok(None);
                };
                let std = std.map_or(Ok(None), |column| self.number(column))?;
                let velocity = GnssVelocity::from_course(speed * to_m_per_s, course * to_rad);
                Ok(Some(Sample::GnssVelocity(GnssVelocity {
                    std_m_s: std.map(|std| [std * to_m_per_s; 3]),
                    ..velocity
                })))
            }
            Channel::Ecef(pose) => self.ecef(pose),
            _ => Ok(None),
        }
    }

    fn ecef(&self, pose: &EcefPose) -> Result<Option<Sample>> {
        let Some([x, y, z]) = self.numbers(&pose.position)? else {
            return Ok(None);
        };
        let place = Geodetic::from_ecef(&Vector3::new(x, y, z));
        let ned_from_ecef = place.ned_from_ecef();
        Ok(match pose.part {
            EcefPart::Position => Some(Sample::ReferencePosition(GnssPosition {
                latitude_rad: place.latitude_rad,
                longitude_rad: place.longitude_rad,
                height_m: Some(place.height_m),
                std_m: None,
                hdop: None,
                satellites: None,
                quality: GnssQuality::Unknown,
            })),
            EcefPart::Velocity(columns) => self
                .numbers(&columns)?
                .map(|[x, y, z]| Sample::ReferenceVelocity(ned_from_ecef * Vector3::new(x, y, z))),
            EcefPart::Attitude { columns, inverse } => {
                self.numbers(&columns)?.map(|[w, x, y, z]| {
                    let read = quaternion_from_file(w, x, y, z);
                    let ecef_from_body = if inverse { read.inverse() } else { read };
                    let rotation = Rotation3::from_matrix_unchecked(ned_from_ecef);
                    let ned_from_ecef = UnitQuaternion::from_rotation_matrix(&rotation);
                    Sample::Reference(Reference {
                        attitude: ned_from_ecef * ecef_from_body,
                        scored: true,
                    })
                })
            }
        })
    }
}

/// The quality of RTKLIB's number.
fn rtklib_quality(code: f64) -> GnssQuality {
    // A float as an integer saturates.
    match code as u8 {
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
