//! Positions of a GNSS receiver from its NMEA sentences GGA and RMC, in integers.
//!
//! Sentences of one instant make one fix: GGA brings position, quality, satellites and HDOP, RMC
//! validity, speed and course. A receiver that sends no RMC gives fixes without velocity, a little
//! later ([`RMC_WAIT_US`]). The parser is our own because numbers must not go through floating point:
//! a degree in `f32` steps by half a metre, and double precision costs a chip without FPU more flash
//! than the filters.

use crate::number::{scaled, whole};

/// Longest sentence that the standard allows, with `$` and checksum, without its end.
pub const LONGEST_LINE: usize = 82;
/// Bits a second on the line.
pub const BAUD: u32 = 9_600;
/// So long an RMC is waited for, microseconds: at 9600 baud the sentences of one instant take this.
pub const RMC_WAIT_US: u32 = 450_000;
/// Fewest satellites of a fix that is used; one more after fixes were missed.
const FEWEST_SATELLITES: u8 = 4;
/// Largest horizontal dilution of precision, hundredths.
const LARGEST_HDOP: u16 = 400;

/// One position fix.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Fix {
    /// Time of day, UTC, ms.
    pub utc_ms: u32,
    /// Latitude, 1e-7 deg, north positive.
    pub latitude_e7: i32,
    /// Longitude, 1e-7 deg, east positive.
    pub longitude_e7: i32,
    /// Height above the ellipsoid, mm; above the geoid when the receiver does not know the separation.
    pub height_mm: i32,
    /// Satellites used.
    pub satellites: u8,
    /// Horizontal dilution of precision, hundredths.
    pub hdop_hundredths: u16,
    /// Speed over ground, mm/s, and course, hundredths of a degree clockwise from true north.
    pub speed_course: Option<(u32, u32)>,
}

/// What an RMC says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rmc {
    /// Time of day, UTC, ms.
    pub utc_ms: u32,
    /// Whether the receiver calls it valid.
    pub valid: bool,
    /// As [`Fix::speed_course`].
    pub speed_course: Option<(u32, u32)>,
}

/// A sentence that was understood.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sentence {
    /// Time (UTC, ms of the day) and position; `None` when the receiver has no fix.
    Gga(u32, Option<Fix>),
    /// Motion.
    Rmc(Rmc),
    /// A sound sentence of another kind.
    Other,
}

/// Reads a sentence; `None` when it is damaged.
#[must_use]
pub fn read(line: &[u8]) -> Option<Sentence> {
    let body = checked(line)?;
    let mut fields = body.split(|byte| *byte == b',');
    let address = fields.next()?;
    match address {
        [_, _, b'G', b'G', b'A'] => gga(fields),
        [_, _, b'R', b'M', b'C'] => rmc(fields),
        _ => Some(Sentence::Other),
    }
}

/// What stands between `$` and `*`, when the checksum behind is right.
fn checked(line: &[u8]) -> Option<&[u8]> {
    let rest = line.strip_prefix(b"$")?;
    let star = rest.iter().position(|byte| *byte == b'*')?;
    let (body, sum) = (rest.get(..star)?, rest.get(star..)?);
    let [b'*', high, low] = sum else {
        return None;
    };
    let stated = hex(*high)? * 16 + hex(*low)?;
    let computed = body.iter().fold(0, |sum, byte| sum ^ byte);
    (stated == computed).then_some(body)
}

fn hex(digit: u8) -> Option<u8> {
    match digit {
        b'0'..=b'9' => Some(digit - b'0'),
        b'A'..=b'F' => Some(digit - b'A' + 10),
        b'a'..=b'f' => Some(digit - b'a' + 10),
        _ => None,
    }
}

fn gga<'a>(mut fields: impl Iterator<Item = &'a [u8]>) -> Option<Sentence> {
    let time = fields.next()?;
    let [latitude, north, longitude, east] = [
        fields.next()?,
        fields.next()?,
        fields.next()?,
        fields.next()?,
    ];
    let [quality, satellites, hdop] = [fields.next()?, fields.next()?, fields.next()?];
    let [altitude, _, separation] = [fields.next()?, fields.next()?, fields.next()?];
    if time.is_empty() {
        // A receiver that does not know the time yet has no fix either.
        return Some(Sentence::Other);
    }
    let utc_ms = time_of_day(time)?;
    if whole(quality)? == 0 {
        return Some(Sentence::Gga(utc_ms, None));
    }
    let above_geoid = scaled(altitude, 3)?;
    let geoid = if separation.is_empty() {
        0
    } else {
        scaled(separation, 3)?
    };
    let fix = Fix {
        utc_ms,
        latitude_e7: angle(latitude, north, [b"N", b"S"], 90)?,
        longitude_e7: angle(longitude, east, [b"E", b"W"], 180)?,
        height_mm: above_geoid.checked_add(geoid)?,
        satellites: u8::try_from(whole(satellites)?).ok()?,
        hdop_hundredths: u16::try_from(scaled(hdop, 2)?).ok()?,
        speed_course: None,
    };
    Some(Sentence::Gga(utc_ms, Some(fix)))
}

fn rmc<'a>(mut fields: impl Iterator<Item = &'a [u8]>) -> Option<Sentence> {
    let [time, status] = [fields.next()?, fields.next()?];
    let [speed, course] = [fields.nth(4)?, fields.next()?];
    if time.is_empty() {
        return Some(Sentence::Other);
    }
    let motion = if speed.is_empty() {
        None
    } else {
        // One knot is 1852/3600 m/s. Without a course there is no motion to speak of.
        let knots = u32::try_from(scaled(speed, 3)?).ok()?;
        let mm_s = u32::try_from((u64::from(knots) * 1852 + 1800) / 3600).ok()?;
        let course = if course.is_empty() {
            0
        } else {
            scaled(course, 2)?
        };
        Some((mm_s, u32::try_from(course).ok().filter(|c| *c <= 36_000)?))
    };
    Some(Sentence::Rmc(Rmc {
        utc_ms: time_of_day(time)?,
        valid: status == b"A",
        speed_course: motion,
    }))
}

/// `hhmmss.sss` as milliseconds.
fn time_of_day(text: &[u8]) -> Option<u32> {
    let hours = whole(text.get(..2)?)?;
    let minutes = whole(text.get(2..4)?)?;
    let ms = u32::try_from(scaled(text.get(4..)?, 3)?).ok()?;
    let sensible = hours < 24 && minutes < 60 && ms < 61_000;
    sensible.then_some((hours * 60 + minutes) * 60_000 + ms)
}

/// `dddmm.mmmm` in 1e-7 deg.
fn angle(text: &[u8], side: &[u8], [positive, negative]: [&[u8]; 2], most: i32) -> Option<i32> {
    let point = text
        .iter()
        .position(|byte| *byte == b'.')
        .unwrap_or(text.len());
    let cut = point.checked_sub(2)?;
    let degrees = i32::try_from(whole(text.get(..cut)?)?).ok()?;
    let minutes_e6 = scaled(text.get(cut..)?, 6).filter(|m| (0..60_000_000).contains(m))?;
    if degrees > most {
        return None;
    }
    let value = degrees * 10_000_000 + (minutes_e6 + 3) / 6;
    if value > most * 10_000_000 {
        None
    } else if side == positive {
        Some(value)
    } else if side == negative {
        Some(-value)
    } else {
        None
    }
}

/// Makes fixes of sentences.
#[derive(Debug, Clone, Default)]
pub struct Receiver {
    /// Position that waits for its RMC, and the counter when it came.
    position: Option<(Fix, u32)>,
    /// The last RMC, for receivers that send it first.
    motion: Option<Rmc>,
    /// Time of the last fix that was given out: no instant counts twice.
    last_utc_ms: Option<u32>,
    /// Whether fixes were refused or missed since the last one.
    lost: bool,
    /// Fixes that were refused: no quality, not valid, too few satellites, a poor geometry. Wrapping.
    pub refused: u32,
}

impl Receiver {
    /// Takes a sentence that came at `now_us`; gives the fix that it completes.
    pub fn take(&mut self, sentence: &Sentence, now_us: u32) -> Option<Fix> {
        match *sentence {
            Sentence::Gga(utc_ms, None) => {
                self.refuse();
                self.position = None;
                self.last_utc_ms = Some(utc_ms);
                None
            }
            Sentence::Gga(utc_ms, Some(fix)) => {
                if self.last_utc_ms == Some(utc_ms) {
                    return None;
                }
                self.position = Some((fix, now_us));
                match self.motion {
                    Some(rmc) if rmc.utc_ms == utc_ms => self.complete(rmc.valid, rmc.speed_course),
                    _ => None,
                }
            }
            Sentence::Rmc(rmc) => {
                self.motion = Some(rmc);
                match self.position {
                    Some((fix, _)) if fix.utc_ms == rmc.utc_ms => {
                        self.complete(rmc.valid, rmc.speed_course)
                    }
                    _ => None,
                }
            }
            Sentence::Other => None,
        }
    }

    /// The fix whose RMC did not come within its time.
    pub fn poll(&mut self, now_us: u32) -> Option<Fix> {
        let (_, came_us) = self.position?;
        if now_us.wrapping_sub(came_us) < RMC_WAIT_US {
            return None;
        }
        self.complete(true, None)
    }

    /// Says that no fix came for long: the next must be better.
    pub fn say_lost(&mut self) {
        self.lost = true;
    }

    fn complete(&mut self, valid: bool, motion: Option<(u32, u32)>) -> Option<Fix> {
        let (fix, _) = self.position.take()?;
        self.last_utc_ms = Some(fix.utc_ms);
        let fewest = FEWEST_SATELLITES + u8::from(self.lost);
        if !valid || fix.satellites < fewest || fix.hdop_hundredths > LARGEST_HDOP {
            self.refuse();
            return None;
        }
        self.lost = false;
        Some(Fix {
            speed_course: motion,
            ..fix
        })
    }

    fn refuse(&mut self) {
        self.refused = self.refused.wrapping_add(1);
        self.lost = true;
    }
}

#[cfg(test)]
mod tests;
