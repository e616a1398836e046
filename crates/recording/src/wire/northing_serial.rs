//! What a microcontroller with Northing's firmware sends: `$PNOR..` sentences of sensors, fixes and
//! estimates, over a serial line.
//!
//! Read first: `docs/wire_formats.md`, section "Northing boards". The board's axes are forward, right,
//! down, its world north, east, down; [`Axes`] says whether they stay so, as files have them, or become
//! those of all wire formats.

use std::str::FromStr;

use nalgebra::{UnitQuaternion, Vector3};
use northing_core::earth::wgs84::{Geodetic, LocalFrame};
use northing_core::geometry::frames::{enu_from_ned, enu_from_ned_rotation};
use northing_core::navigation::Validity;

use super::Decoded;
use super::lines::Lines;
use crate::device_navigation::{DeviceNavigation, validity_of};
use crate::event::{Event, Sample, SensorKind};
use crate::gnss::{GnssPosition, GnssQuality, GnssVelocity};

/// Version of the sentences that is understood.
const VERSION: &str = "1";
/// From the last stamp before a start of the board to the first after it, ns.
const PAUSE_NS: i64 = 1_000_000_000;

/// In which axes events are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Axes {
    /// Right, forward, up; east, north, up: as a phone's.
    #[default]
    Phone,
    /// Forward, right, down; north, east, down: as the board has them.
    Board,
}

/// The decoder of one board.
#[derive(Debug, Clone, Default)]
pub struct NorthingSerial {
    axes: Axes,
    lines: Lines,
    /// The board's last stamp (ms, wrapping), and what it is here, ns.
    last: Option<(u32, i64)>,
    /// The board has started again: its stamps begin anew.
    restarted: bool,
    /// The place from which the board's positions count, once it has told it.
    origin: Option<LocalFrame>,
}

impl NorthingSerial {
    /// A decoder that gives events in these axes.
    #[must_use]
    pub fn new(axes: Axes) -> Self {
        Self {
            axes,
            ..Self::default()
        }
    }

    /// Decodes the next bytes of the serial line, cut anywhere.
    pub fn push(&mut self, bytes: &[u8]) -> Decoded {
        let mut out = Decoded::default();
        let mut lines = std::mem::take(&mut self.lines);
        let too_long = lines.push(bytes, |line| self.line(line, &mut out));
        self.lines = lines;
        out.bad_many(
            "A line that does not end was left out: is the line's speed 230400 baud?",
            too_long,
        );
        out
    }

    fn line(&mut self, line: &[u8], out: &mut Decoded) {
        let Some((kind, fields)) = sentence(line) else {
            let text =
                "A line is no sound sentence of Northing's firmware ($PNOR..*hh); it was left out.";
            out.bad(text);
            return;
        };
        let fields = Fields(fields.split(',').collect());
        let used = match kind {
            b'B' => self.start(&fields, out),
            b'I' => self.frame(&fields, out),
            b'G' => self.fix(&fields, out),
            b'E' => self.estimate(&fields, out),
            b'O' => self.origin(&fields),
            b'F' => self.fault(&fields, out),
            // Counts, which the next status repeats.
            b'S' => Some(()),
            _ => None,
        };
        if used.is_none() {
            let text = "A sentence of Northing's firmware lacks a number; it was left out.";
            out.bad(text);
        }
    }

    fn start(&mut self, fields: &Fields<'_>, out: &mut Decoded) -> Option<()> {
        let (version, build, cause) = (fields.text(0)?, fields.text(1)?, fields.text(2)?);
        self.restarted = self.last.is_some();
        self.origin = None;
        out.info(format!(
            "The board has started: {}.",
            crate::error::shown(build)
        ));
        if cause == "watchdog" {
            let text = "The board's watchdog had to reset it: its program hung.";
            out.warn(text);
        }
        if version != VERSION {
            let text = format!("The board's sentences are of another version than {VERSION}.");
            out.warn(text);
        }
        Some(())
    }

    fn frame(&mut self, fields: &Fields<'_>, out: &mut Decoded) -> Option<()> {
        let time_ns = self.time_ns(fields)?;
        // The interval stands between stamp and force.
        let units = [
            (2, SensorKind::Accelerometer, 1e-4),
            (5, SensorKind::Gyroscope, 1e-5),
            (8, SensorKind::Magnetometer, 1e-2),
        ];
        for (first, kind, unit) in units {
            if let Some(v) = fields.vector(first, unit)? {
                out.vector(time_ns, kind, self.body(v));
            }
        }
        Some(())
    }

    fn fix(&mut self, fields: &Fields<'_>, out: &mut Decoded) -> Option<()> {
        let time_ns = self.time_ns(fields)?;
        let place = fields.place(2)?;
        let position = GnssPosition {
            latitude_rad: place.latitude_rad,
            longitude_rad: place.longitude_rad,
            height_m: Some(place.height_m),
            std_m: None,
            hdop: Some(fields.number(6)? * 1e-2),
            satellites: fields.text(5)?.parse().ok(),
            quality: GnssQuality::Autonomous,
        };
        if position.is_usable() {
            let sample = Sample::GnssPosition(position);
            out.events.push(Event { time_ns, sample });
        }
        if let (Some(speed), Some(course)) = (fields.number(7), fields.number(8)) {
            let velocity = GnssVelocity::from_course(speed * 1e-3, (course * 1e-2).to_radians());
            let sample = Sample::GnssVelocity(velocity);
            out.events.push(Event { time_ns, sample });
        }
        Some(())
    }

    fn estimate(&mut self, fields: &Fields<'_>, out: &mut Decoded) -> Option<()> {
        let time_ns = self.time_ns(fields)?;
        if let Some(angles) = fields.vector(1, 1e-3)? {
            let [roll, pitch, yaw] = <[f64; 3]>::from(angles).map(f64::to_radians);
            let ned_from_frd = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
            out.attitude(time_ns, self.attitude(ned_from_frd));
        }
        let validity = validity_of(fields.text(7)?.parse().ok()?);
        let motion = [8, 11, 14].map(|first| fields.vector(first, 1e-3));
        let [Some(position), Some(velocity), Some(std)] = motion else {
            return None;
        };
        let (Some(position), Some(velocity), Some(std)) = (position, velocity, std) else {
            return Some(());
        };
        // A line that was joined late has not told the origin yet; within ten seconds it does.
        let Some(origin) = self.origin.filter(|_| validity != Validity::Aligning) else {
            return Some(());
        };
        let place = origin.geodetic(&position);
        let estimate = DeviceNavigation {
            latitude_rad: place.latitude_rad,
            longitude_rad: place.longitude_rad,
            height_m: place.height_m,
            std_m: std.into(),
            velocity_m_s: velocity.into(),
            heading_std_rad: (fields.number(6)? * 1e-3).to_radians(),
            validity,
        };
        if estimate.is_usable() {
            let sample = Sample::DeviceNavigation(estimate);
            out.events.push(Event { time_ns, sample });
        }
        Some(())
    }

    /// A fault of the board's sensors, which becomes a remark.
    fn fault(&mut self, fields: &Fields<'_>, out: &mut Decoded) -> Option<()> {
        let (sensor, kind) = (fields.text(1)?, fields.text(2)?);
        let (unit, scale) = match sensor {
            "gyroscope" => ("rad/s", 1e-5),
            "accelerometer" => ("m/s^2", 1e-4),
            "magnetometer" => ("uT", 1e-2),
            _ => return None,
        };
        let is_over = match fields.text(3)? {
            "found" => false,
            "over" => true,
            _ => return None,
        };
        let (now_ms, from_ms): (u32, u32) = (fields.parsed(0)?, fields.parsed(4)?);
        let size = fields.number(5)?;
        let until_ns = self.time_ns(fields)?;
        let lasted_ms = now_ms.wrapping_sub(from_ms);
        let from_s = until_ns as f64 * 1e-9 - f64::from(lasted_ms) * 1e-3;
        let until = if is_over {
            format!(" to {:.2} s", until_ns as f64 * 1e-9)
        } else {
            String::new()
        };
        let size = size * scale;
        let what = match kind {
            "spike" => format!("a spike of {size:.3} {unit} after {from_s:.2} s, left out"),
            "stuck" => {
                format!("the same numbers from {from_s:.2} s{until}, not used as measurements")
            }
            "noise" => {
                format!("nothing but noise from {from_s:.2} s{until}, not used as measurements")
            }
            "saturated" => format!(
                "clipped ({size:.3} {unit}) from {from_s:.2} s{until}; what lies beyond was not seen"
            ),
            "missing" => format!("no samples from {from_s:.2} s{until}"),
            "stamp" => format!("a stamp far ahead after {from_s:.2} s, left out"),
            "bias-step" => {
                let at_s = until_ns as f64 * 1e-9;
                format!("its bias changed by {size:.3} {unit}, found at {at_s:.2} s")
            }
            _ => return None,
        };
        out.warn(format!(
            "The board has found a fault of its {sensor}: {what}."
        ));
        Some(())
    }

    fn origin(&mut self, fields: &Fields<'_>) -> Option<()> {
        let place = fields.place(0)?;
        let on_earth = place.latitude_rad.abs() <= std::f64::consts::FRAC_PI_2;
        self.origin = on_earth.then(|| LocalFrame::new(place));
        Some(())
    }

    /// The stamp of a sentence. The board counts milliseconds in 32 bits, from zero at each start.
    fn time_ns(&mut self, fields: &Fields<'_>) -> Option<i64> {
        let ms: u32 = fields.parsed(0)?;
        let time_ns = match self.last {
            None => i64::from(ms) * 1_000_000,
            Some((_, last_ns)) if self.restarted => last_ns.saturating_add(PAUSE_NS),
            Some((last_ms, last_ns)) => {
                let passed = ms.wrapping_sub(last_ms) as i32;
                last_ns.saturating_add(i64::from(passed) * 1_000_000)
            }
        };
        self.restarted = false;
        self.last = Some((ms, time_ns));
        Some(time_ns)
    }

    fn body(&self, v: Vector3<f64>) -> Vector3<f64> {
        match self.axes {
            Axes::Phone => enu_from_ned(&v),
            Axes::Board => v,
        }
    }

    fn attitude(&self, ned_from_frd: UnitQuaternion<f64>) -> UnitQuaternion<f64> {
        // It takes NED to ENU and our body axes to FRD alike.
        let swap = enu_from_ned_rotation();
        match self.axes {
            Axes::Phone => swap * ned_from_frd * swap,
            Axes::Board => ned_from_frd,
        }
    }
}

/// Whether a text begins as such a board's output does.
pub(crate) fn recognises(text: &str) -> bool {
    text.lines()
        .take(20)
        .any(|line| sentence(line.as_bytes()).is_some())
}

/// The letter behind `$PNOR` and the fields, when the checksum is right.
fn sentence(line: &[u8]) -> Option<(u8, &str)> {
    let text = std::str::from_utf8(line.trim_ascii()).ok()?;
    let (body, sum) = text.strip_prefix('$')?.split_once('*')?;
    let stated = u8::from_str_radix(sum, 16)
        .ok()
        .filter(|_| sum.len() == 2)?;
    let computed = body.bytes().fold(0, |sum, byte| sum ^ byte);
    let (address, fields) = body.split_once(',')?;
    let kind = address.strip_prefix("PNOR")?.as_bytes();
    match kind {
        [kind] if stated == computed => Some((*kind, fields)),
        _ => None,
    }
}

/// What stands between the commas.
struct Fields<'a>(Vec<&'a str>);

impl<'a> Fields<'a> {
    fn text(&self, place: usize) -> Option<&'a str> {
        self.0.get(place).copied()
    }

    fn parsed<T: FromStr>(&self, place: usize) -> Option<T> {
        self.text(place)?.parse().ok()
    }

    fn number(&self, place: usize) -> Option<f64> {
        self.parsed::<i32>(place).map(f64::from)
    }

    /// Latitude and longitude (1e-7 deg) and height (mm).
    fn place(&self, first: usize) -> Option<Geodetic> {
        Some(Geodetic {
            latitude_rad: (self.number(first)? * 1e-7).to_radians(),
            longitude_rad: (self.number(first + 1)? * 1e-7).to_radians(),
            height_m: self.number(first + 2)? * 1e-3,
        })
    }

    /// Three numbers times `unit`; `Some(None)` when they are empty.
    fn vector(&self, first: usize, unit: f64) -> Option<Option<Vector3<f64>>> {
        if self.text(first)?.is_empty() {
            return Some(None);
        }
        let v = Vector3::new(
            self.number(first)?,
            self.number(first + 1)?,
            self.number(first + 2)?,
        );
        Some(Some(v * unit))
    }
}
