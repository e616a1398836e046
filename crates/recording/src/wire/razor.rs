//! Razor 9DOF AHRS boards: text lines or binary frames over a serial line, 57600 baud.
//!
//! Read first: `docs/wire_formats.md`, section "Razor AHRS". The firmware has no clock in its
//! output: stamps count its frames ([`RazorConfig::frame_interval_ns`]). Its axes are forward,
//! right, down and its accelerations point along gravity; ours are right, forward, up (a phone's)
//! and specific force.

use nalgebra::{UnitQuaternion, Vector3};
use northing_core::geometry::frames::{enu_from_ned, enu_from_ned_rotation};

use super::Decoded;
use super::lines::Lines;
use crate::event::SensorKind;
use crate::options::STANDARD_GRAVITY_M_S2;

/// Bytes of a binary frame: nine little-endian `f32`.
const FRAME: usize = 36;

/// What the board was told to send.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum RazorOutput {
    /// Text lines of any kind: `#A-C=`, `#YPR=`, `!ANG:` (`#ot`, `#osct`, `#osrt`).
    #[default]
    Text,
    /// Binary frames of acceleration, field, rate (`#oscb`); without marks between them.
    BinarySensors,
}

/// Scales of the board and the kind of its output.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RazorConfig {
    /// Text or binary. Default: text.
    pub output: RazorOutput,
    /// Time from frame to frame, ns. Default: 20 ms, the firmware's.
    pub frame_interval_ns: i64,
    /// Counts of the accelerometer at 1 g. Default: 256.
    pub counts_per_g: f64,
    /// Angular rate of one count of the gyroscope, deg/s. Default: 0.06957.
    pub rate_deg_s_per_count: f64,
    /// Counts of the magnetometer at 1 microtesla. Default: 10. The firmware's calibration scales the
    /// field so that only its direction counts; raw fields depend on the board's chip.
    pub counts_per_ut: f64,
}

impl Default for RazorConfig {
    fn default() -> Self {
        Self {
            output: RazorOutput::Text,
            frame_interval_ns: 20_000_000,
            counts_per_g: 256.0,
            rate_deg_s_per_count: 0.06957,
            counts_per_ut: 10.0,
        }
    }
}

/// The decoder of one board.
#[derive(Debug, Clone, Default)]
pub struct Razor {
    config: RazorConfig,
    lines: Lines,
    /// Bytes of the binary frame under way.
    partial: Vec<u8>,
    alignment: Alignment,
    /// Norms of force and field in the frame before, counts.
    norms: Option<(f64, f64)>,
    clock: FrameClock,
}

/// Whether the start of the binary frames is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Alignment {
    /// The line was opened in the middle of something.
    #[default]
    Unknown,
    Found,
    /// For so many bytes.
    Lost(u32),
}

const BYTES_LOST: &str =
    "A byte was left out to find the next binary frame: bytes were lost on the serial line.";

/// Force, field and rate of a binary frame as the board counts them.
type Counts = [Vector3<f64>; 3];

/// Counts frames: one ends when a kind of line comes again.
#[derive(Debug, Clone, Default)]
struct FrameClock {
    frame: i64,
    seen: [bool; KINDS],
}

/// Kinds of lines: acceleration, field, rate, angles.
const KINDS: usize = 4;

impl FrameClock {
    fn frame_of(&mut self, kind: usize) -> i64 {
        if std::mem::replace(&mut self.seen[kind], true) {
            self.frame += 1;
            self.seen = [false; KINDS];
            self.seen[kind] = true;
        }
        self.frame
    }
}

impl Razor {
    /// A decoder for a board with these scales.
    #[must_use]
    pub fn new(config: RazorConfig) -> Self {
        Self {
            config,
            ..Self::default()
        }
    }

    /// Decodes the next bytes of the serial line, cut anywhere.
    pub fn push(&mut self, bytes: &[u8]) -> Decoded {
        let mut out = Decoded::default();
        match self.config.output {
            RazorOutput::Text => self.push_text(bytes, &mut out),
            RazorOutput::BinarySensors => self.push_binary(bytes, &mut out),
        }
        out
    }

    fn push_text(&mut self, bytes: &[u8], out: &mut Decoded) {
        let Self {
            config,
            lines,
            clock,
            ..
        } = self;
        let too_long = lines.push(bytes, |text| line(text, config, clock, out));
        out.bad_many("A line that does not end was left out: the board may be sending binary frames, or at another speed than 57600 baud.", too_long);
    }

    fn push_binary(&mut self, bytes: &[u8], out: &mut Decoded) {
        let mut buffer = std::mem::take(&mut self.partial);
        buffer.extend_from_slice(bytes);
        let mut rest = buffer.as_slice();
        while let Some((frame, after)) = rest.split_first_chunk::<FRAME>() {
            let Some(verdict) = self.starts_here(frame, after) else {
                break;
            };
            let Some([force, field, rate]) = verdict else {
                self.miss(out);
                rest = &rest[1..];
                continue;
            };
            self.alignment = Alignment::Found;
            self.norms = Some((force.norm(), field.norm()));
            let time_ns = self.config.time_ns(self.clock.frame_of(0));
            self.config.force(time_ns, force, out);
            self.config.rate(time_ns, rate, out);
            self.config
                .field(time_ns, SensorKind::Magnetometer, field, out);
            rest = after;
        }
        self.partial = rest.to_vec();
    }

    /// The frame when one starts here, `Some(None)` when none does, `None` when more bytes must tell.
    fn starts_here(&self, bytes: &[u8; FRAME], after: &[u8]) -> Option<Option<Counts>> {
        let Some(frame) = accepted(bytes) else {
            return Some(None);
        };
        if self.alignment == Alignment::Found {
            // Nothing marks a frame; but the field's strength hardly changes from one to the next.
            let steady = self
                .norms
                .is_none_or(|(_, field)| near(frame[1].norm(), field, 2.0));
            return Some(steady.then_some(frame));
        }
        if !self.is_familiar(&frame) {
            return Some(None);
        }
        // Where frames start is told by two in a row.
        let next = accepted(after.first_chunk()?);
        Some(next.filter(|next| self.is_familiar(next)).map(|_| frame))
    }

    /// Whether force and field are as strong as before, or the force about 1 g at the start.
    fn is_familiar(&self, frame: &Counts) -> bool {
        const FACTOR: f64 = 1.4;
        let (force, field) = self
            .norms
            .map_or((self.config.counts_per_g, None), |(force, field)| {
                (force, Some(field))
            });
        near(frame[0].norm(), force, FACTOR)
            && field.is_none_or(|field| near(frame[1].norm(), field, FACTOR))
    }

    /// No frame starts at this byte.
    fn miss(&mut self, out: &mut Decoded) {
        /// After so many bytes the board itself may have changed: start as if new.
        const PATIENCE: u32 = 40 * FRAME as u32;
        self.alignment = match self.alignment {
            Alignment::Unknown => return,
            Alignment::Found => Alignment::Lost(1),
            Alignment::Lost(PATIENCE..) => {
                self.norms = None;
                Alignment::Unknown
            }
            Alignment::Lost(bytes) => Alignment::Lost(bytes + 1),
        };
        out.bad(BYTES_LOST);
    }
}

impl RazorConfig {
    fn time_ns(&self, frame: i64) -> i64 {
        frame.saturating_mul(self.frame_interval_ns)
    }

    fn force(&self, time_ns: i64, counts: Vector3<f64>, out: &mut Decoded) {
        let force = enu_from_ned(&counts) * (-STANDARD_GRAVITY_M_S2 / self.counts_per_g);
        out.vector(time_ns, SensorKind::Accelerometer, force);
    }

    fn rate(&self, time_ns: i64, counts: Vector3<f64>, out: &mut Decoded) {
        let rate = enu_from_ned(&counts) * self.rate_deg_s_per_count.to_radians();
        out.vector(time_ns, SensorKind::Gyroscope, rate);
    }

    fn field(&self, time_ns: i64, kind: SensorKind, counts: Vector3<f64>, out: &mut Decoded) {
        out.vector(time_ns, kind, enu_from_ned(&counts) / self.counts_per_ut);
    }
}

fn line(text: &[u8], config: &RazorConfig, clock: &mut FrameClock, out: &mut Decoded) {
    const FIELD: SensorKind = SensorKind::Magnetometer;
    const RAW_FIELD: SensorKind = SensorKind::MagnetometerUncalibrated;
    let values = |prefix: &str| text.strip_prefix(prefix.as_bytes()).map(three);
    if let Some(v) = values("#A-C=").or_else(|| values("#A-R=")) {
        config.force(config.time_ns(clock.frame_of(0)), v, out);
    } else if let Some(v) = values("#M-C=") {
        config.field(config.time_ns(clock.frame_of(1)), FIELD, v, out);
    } else if let Some(v) = values("#M-R=") {
        config.field(config.time_ns(clock.frame_of(1)), RAW_FIELD, v, out);
    } else if let Some(v) = values("#G-C=").or_else(|| values("#G-R=")) {
        config.rate(config.time_ns(clock.frame_of(2)), v, out);
    } else if let Some(v) = values("#YPR=") {
        angles(config.time_ns(clock.frame_of(3)), [v.x, v.y, v.z], out);
    } else if let Some(v) = values("!ANG:") {
        // The old firmware's order: roll, pitch, yaw.
        angles(config.time_ns(clock.frame_of(3)), [v.z, v.y, v.x], out);
    } else if !text.starts_with(b"#SYNCH") {
        out.info("A line is not one of the Razor firmware's (#A-C=, #M-C=, #G-C=, #YPR=, !ANG:); it was left out.",
        );
    }
}

/// The first three numbers of a comma-separated list, NaN where missing.
fn three(text: &[u8]) -> Vector3<f64> {
    let mut fields = text.split(|&byte| byte == b',');
    let mut value = || {
        let text = std::str::from_utf8(fields.next()?).ok()?;
        text.trim().parse().ok()
    };
    Vector3::from([value(), value(), value()].map(|v| v.unwrap_or(f64::NAN)))
}

/// Yaw, pitch, roll, deg, of forward-right-down axes in north-east-down.
fn angles(time_ns: i64, angles_deg: [f64; 3], out: &mut Decoded) {
    let [yaw, pitch, roll] = angles_deg.map(f64::to_radians);
    let ned_from_frd = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw)
        * UnitQuaternion::from_axis_angle(&Vector3::y_axis(), pitch)
        * UnitQuaternion::from_axis_angle(&Vector3::x_axis(), roll);
    // It takes NED to ENU and our body axes to FRD alike.
    let swap = enu_from_ned_rotation();
    out.attitude(time_ns, swap * ned_from_frd * swap);
}

/// Whether two norms are within a factor of each other.
fn near(norm: f64, reference: f64, factor: f64) -> bool {
    norm < reference * factor && norm * factor > reference
}

/// The three vectors of a binary frame, unless a number cannot be one of this board's: then the
/// frame does not start here.
fn accepted(frame: &[u8; FRAME]) -> Option<Counts> {
    /// Beyond what 16 bits can count, with room for the firmware's calibration.
    const LARGEST: f32 = 100_000.0;
    /// Smaller numbers than this come from bytes that belong to two numbers.
    const SMALLEST: f32 = 1e-25;
    /// Neither gravity nor the Earth's field vanishes: the smallest norm in counts.
    const SMALLEST_NORM: f64 = 1.0;
    let mut numbers = [0.0; FRAME / 4];
    for (number, bytes) in numbers.iter_mut().zip(frame.as_chunks::<4>().0) {
        let value = f32::from_le_bytes(*bytes);
        let magnitude = value.abs();
        let is_count = magnitude <= LARGEST && (magnitude >= SMALLEST || value == 0.0);
        if !is_count {
            return None;
        }
        *number = f64::from(value);
    }
    let [ax, ay, az, mx, my, mz, gx, gy, gz] = numbers;
    let force = Vector3::new(ax, ay, az);
    let field = Vector3::new(mx, my, mz);
    let is_frame = force.norm() > SMALLEST_NORM && field.norm() > SMALLEST_NORM;
    is_frame.then_some([force, field, Vector3::new(gx, gy, gz)])
}
