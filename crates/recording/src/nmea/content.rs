//! What a sentence says, in our units: the `nmea` crate reads the standard ones, a few others are read here.

use chrono::{NaiveDate, NaiveTime, Timelike};
use nalgebra::UnitQuaternion;
use nmea::ParseResult;
use nmea::sentences::gsa::GsaMode2;
use nmea::sentences::rmc::RmcStatusOfFix;
use nmea::sentences::{FaaMode, FixType};

use super::line::Sentence;
use crate::event::{Sample, TrueHeading, WaterVelocity};
use crate::gnss::GnssQuality;
use crate::options::KNOT;

/// What a sentence says.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Content {
    /// A part of a fix.
    Part(Part),
    /// The receiver's clock alone.
    Clock {
        time_of_day_ns: i64,
        date: Option<NaiveDate>,
    },
    /// A measurement that has nothing to do with satellites.
    Sample(Sample),
    /// Nothing that is used here.
    Other,
}

/// What one sentence knows of a fix.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Part {
    /// UTC time of day of the fix, ns.
    pub(super) time_of_day_ns: Option<i64>,
    pub(super) date: Option<NaiveDate>,
    /// Latitude and longitude, rad.
    pub(super) position_rad: Option<[f64; 2]>,
    /// Above the ellipsoid where the sentence tells the geoid too.
    pub(super) height_m: Option<f64>,
    pub(super) quality: Option<GnssQuality>,
    pub(super) hdop: Option<f64>,
    pub(super) satellites: Option<u8>,
    /// The height is not observed.
    pub(super) is_flat: bool,
    /// Whether a system of satellites observes the height, too.
    pub(super) is_solid: bool,
    /// Speed over ground, m/s.
    pub(super) speed_m_s: Option<f64>,
    /// Course over ground, rad.
    pub(super) course_rad: Option<f64>,
}

/// Reads a sentence; an error when its fields are not as the standard has them.
pub(super) fn read(sentence: &Sentence<'_>) -> Result<Content, ()> {
    let address = sentence.address();
    match address {
        "PSXN" => return seapath(sentence),
        "PUHAW" => return water_track(sentence),
        _ => {}
    }
    // A talker of two letters and a kind of three; everything else belongs to a maker.
    if address.len() != 5 || !address.is_ascii() {
        return Ok(Content::Other);
    }
    match &address[2..] {
        "THS" => ths(sentence),
        // Time, status, mode; time zone.
        "GLL" => standard(&complete(sentence, &[",", ",A", ","])),
        "ZDA" => standard(&complete(sentence, &[",", ","])),
        "GGA" | "GNS" | "GSA" | "HDT" | "RMC" | "VHW" | "VTG" => standard(sentence.body),
        _ => Ok(Content::Other),
    }
}

/// A sentence of the standard, through the crate.
fn standard(body: &str) -> Result<Content, ()> {
    let sum = body.bytes().fold(0, |sum, byte| sum ^ byte);
    let sentence = format!("${body}*{sum:02X}");
    let part = match nmea::parse_str(&sentence).map_err(drop)? {
        ParseResult::GGA(gga) => Part {
            time_of_day_ns: of_day(gga.fix_time),
            position_rad: position(gga.latitude, gga.longitude)?,
            height_m: height(gga.altitude, gga.geoid_separation),
            quality: gga.fix_type.map(quality),
            hdop: finite(gga.hdop),
            satellites: gga.fix_satellites.and_then(|n| u8::try_from(n).ok()),
            ..Part::default()
        },
        ParseResult::GNS(gns) => Part {
            time_of_day_ns: of_day(gns.fix_time),
            position_rad: position(gns.lat, gns.lon)?,
            height_m: height(gns.alt, gns.geoid_separation),
            quality: Some(quality(FixType::from(gns.faa_modes))),
            hdop: finite(gns.hdop),
            satellites: u8::try_from(gns.nsattelites).ok(),
            ..Part::default()
        },
        ParseResult::RMC(rmc) => Part {
            time_of_day_ns: of_day(rmc.fix_time),
            date: rmc.fix_date,
            position_rad: position(rmc.lat, rmc.lon)?,
            quality: match rmc.status_of_fix {
                RmcStatusOfFix::Invalid => Some(GnssQuality::Invalid),
                _ => rmc.faa_mode.map(of_mode),
            },
            speed_m_s: finite(rmc.speed_over_ground).map(|v| v * KNOT),
            course_rad: finite(rmc.true_course).map(f64::to_radians),
            ..Part::default()
        },
        ParseResult::GLL(gll) => Part {
            time_of_day_ns: of_day(gll.fix_time),
            position_rad: position(gll.latitude, gll.longitude)?,
            quality: if gll.valid {
                gll.faa_mode.map(of_mode)
            } else {
                Some(GnssQuality::Invalid)
            },
            ..Part::default()
        },
        ParseResult::GSA(gsa) => Part {
            // One comes for each system of satellites, "no fix" for those not in use: GGA and RMC judge the fix.
            is_flat: gsa.mode2 == GsaMode2::Fix2D,
            is_solid: gsa.mode2 == GsaMode2::Fix3D,
            hdop: finite(gsa.hdop),
            ..Part::default()
        },
        ParseResult::VTG(vtg) => Part {
            speed_m_s: finite(vtg.speed_over_ground).map(|v| v * KNOT),
            course_rad: finite(vtg.true_course).map(f64::to_radians),
            ..Part::default()
        },
        ParseResult::ZDA(zda) => {
            return Ok(match of_day(zda.utc_time) {
                Some(time_of_day_ns) => Content::Clock {
                    time_of_day_ns,
                    date: zda.utc_date(),
                },
                None => Content::Other,
            });
        }
        ParseResult::HDT(hdt) => return Ok(heading(finite(hdt.heading))),
        ParseResult::VHW(vhw) => {
            let forward = vhw.relative_speed_knots.filter(|v| v.is_finite());
            return Ok(forward.map_or(Content::Other, |knots| {
                Content::Sample(Sample::WaterVelocity(WaterVelocity {
                    forward_m_s: knots * KNOT,
                    starboard_m_s: None,
                }))
            }));
        }
        _ => return Ok(Content::Other),
    };
    Ok(Content::Part(part))
}

/// A sentence with the last fields that older receivers leave out: `all` are those behind the first four.
fn complete(sentence: &Sentence<'_>, all: &[&str]) -> String {
    let mut body = sentence.body.to_owned();
    let present = sentence.fields().count();
    for missing in all.iter().skip(present.saturating_sub(4)) {
        body.push_str(missing);
    }
    body
}

/// True heading and status.
fn ths(sentence: &Sentence<'_>) -> Result<Content, ()> {
    let mut fields = sentence.fields();
    let degrees = number(fields.next())?;
    // A autonomous; E estimated, M typed in, S simulated, V not valid.
    let is_measured = fields.next().is_none_or(|mode| mode == "A");
    Ok(heading(degrees.filter(|_| is_measured)))
}

/// `PSXN,23,roll,pitch,heading,heave` of a Seapath: starboard down, bow up, clockwise from true north, deg.
fn seapath(sentence: &Sentence<'_>) -> Result<Content, ()> {
    let mut fields = sentence.fields();
    if fields.next() != Some("23") {
        return Ok(Content::Other);
    }
    let mut angle = || number(fields.next());
    let (Some(roll), Some(pitch), Some(yaw)) = (angle()?, angle()?, angle()?) else {
        return Ok(Content::Other);
    };
    let [roll, pitch, yaw] = [roll, pitch, yaw].map(f64::to_radians);
    let ned_from_body = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
    Ok(Content::Sample(Sample::DeviceOrientation(ned_from_body)))
}

/// `PUHAW,UVH,u,v,heading`: velocity through the water east and north, knots, and heading, deg.
fn water_track(sentence: &Sentence<'_>) -> Result<Content, ()> {
    let mut fields = sentence.fields();
    if fields.next() != Some("UVH") {
        return Ok(Content::Other);
    }
    let mut next = || number(fields.next());
    let (Some(east), Some(north), Some(degrees)) = (next()?, next()?, next()?) else {
        return Ok(Content::Other);
    };
    let (sin, cos) = degrees.to_radians().sin_cos();
    Ok(Content::Sample(Sample::WaterVelocity(WaterVelocity {
        forward_m_s: (north * cos + east * sin) * KNOT,
        starboard_m_s: Some((east * cos - north * sin) * KNOT),
    })))
}

fn heading(degrees: Option<f64>) -> Content {
    degrees.map_or(Content::Other, |degrees| {
        Content::Sample(Sample::TrueHeading(TrueHeading {
            heading_rad: degrees.to_radians(),
            std_rad: None,
        }))
    })
}

/// The number of a field; `None` when it is empty or missing.
fn number(field: Option<&str>) -> Result<Option<f64>, ()> {
    let text = field.unwrap_or_default().trim();
    if text.is_empty() {
        return Ok(None);
    }
    let number: f64 = text.parse().map_err(drop)?;
    if number.is_finite() {
        Ok(Some(number))
    } else {
        Err(())
    }
}

/// Nanoseconds since midnight.
fn of_day(time: Option<NaiveTime>) -> Option<i64> {
    let time = time?;
    Some(i64::from(time.num_seconds_from_midnight()) * 1_000_000_000 + i64::from(time.nanosecond()))
}

/// Degrees as radians; an error for a place that is not on the Earth.
fn position(latitude: Option<f64>, longitude: Option<f64>) -> Result<Option<[f64; 2]>, ()> {
    let (Some(latitude), Some(longitude)) = (latitude, longitude) else {
        return Ok(None);
    };
    if latitude.abs() <= 90.0 && longitude.abs() <= 180.0 {
        Ok(Some([latitude.to_radians(), longitude.to_radians()]))
    } else {
        Err(())
    }
}

/// Above the ellipsoid; above the geoid where the receiver does not tell the difference.
fn height(altitude: Option<f32>, separation: Option<f32>) -> Option<f64> {
    Some(finite(altitude)? + finite(separation).unwrap_or(0.0))
}

fn finite(x: Option<f32>) -> Option<f64> {
    x.filter(|x| x.is_finite()).map(f64::from)
}

fn quality(fix: FixType) -> GnssQuality {
    match fix {
        FixType::Invalid | FixType::Manual => GnssQuality::Invalid,
        FixType::Gps | FixType::Pps => GnssQuality::Autonomous,
        FixType::DGps => GnssQuality::Differential,
        FixType::Rtk => GnssQuality::RtkFixed,
        FixType::FloatRtk => GnssQuality::RtkFloat,
        FixType::Estimated => GnssQuality::Estimated,
        FixType::Simulation => GnssQuality::Unknown,
    }
}

fn of_mode(mode: FaaMode) -> GnssQuality {
    quality(FixType::from(mode))
}
