//! Detects fixes that cannot be: swapped coordinates, degrees for radians, a velocity in knots or with up for down, and counts jumps
//! and repetitions.
//!
//! Numbers beyond a pole tell at once. Numbers that could be a place are compared with the receiver's own
//! velocity: over stretches of some metres the way between fixes must be the way that the velocity
//! went. Several hypotheses compete, "the numbers are right", latitude and longitude swapped, radians, west positive, north and east of
//! the velocity swapped, its unit another one; only a clear win of another one refuses the recording, so a receiver at rest, or one
//! without velocity, passes. Heights and the velocity down are compared in the same way (`vertical.rs`).

use northing_core::earth::Radii;

use super::vertical::VerticalCheck;
use super::{Doubt, Verdict};
use crate::event::SensorKind;
use crate::gnss::{GnssPosition, GnssVelocity};
use crate::issues::Issues;

/// The checks of the fixes of one recording.
#[derive(Debug, Clone, Default)]
pub(super) struct PositionCheck {
    last: Option<(i64, GnssPosition)>,
    velocity: Option<(i64, GnssVelocity)>,
    stretch: Option<Stretch>,
    stretches: u32,
    /// Sums of the squared relative errors: as the numbers are, of the other readings, and of the velocity in other units.
    errors: [f64; 1 + READINGS.len() + UNITS.len()],
    /// Sums over stretches: the way of the fixes along that of the velocity, and the square of that, m^2.
    along: [f64; 2],
    vertical: VerticalCheck,
    jumps: u64,
    largest_jump_m: f64,
    repeats: u64,
}

/// What speaks for each other reading of the numbers, and what to do.
const READINGS: [(&str, &str); 4] = [
    (
        "latitude and longitude look swapped, or north and east of the velocity",
        "if so, exchange the columns in the manifest",
    ),
    (
        "the coordinates look like radians under the name of degrees",
        "if so, say unit = \"rad\" in the manifest",
    ),
    (
        "longitudes look as if west were positive",
        "if so, turn the sign of the longitude, or exchange east and west of the velocity",
    ),
    (
        "north and east of the velocity look swapped, or latitude and longitude",
        "if so, exchange the columns in the manifest",
    ),
];
/// Other units of a velocity, m/s.
const UNITS: [(f64, &str); 4] = [
    (0.514_444, "knots"),
    (1.0 / 3.6, "km/h"),
    (0.447_04, "miles an hour"),
    (0.01, "cm/s"),
];

/// A comparison in progress.
#[derive(Debug, Clone, Copy)]
struct Stretch {
    start: [f64; 2],
    /// The way that the velocity went, north and east, m.
    way: [f64; 2],
}

impl PositionCheck {
    /// A comparison is made when the velocity has gone so far, m, and the fixes as well, or the velocity so many times as far: its
    /// numbers may be of a smaller unit.
    const LEAST_WAY_M: f64 = 20.0;
    const SMALLER_UNIT: f64 = 4.0;
    /// Fixes further apart than this, s, are not compared.
    const LONGEST_PAUSE_S: f64 = 2.5;
    /// Evidence: number of stretches, and the mean squared relative errors of a hypothesis that is
    /// wrong and of one that is right.
    const STRETCHES: u32 = 5;
    const WRONG: f64 = 0.25;
    const RIGHT: f64 = 0.04;
    /// The same of a velocity in m/s where another unit is right: knots go half as far.
    const WRONG_UNIT: f64 = 0.15;
    /// A fix is a jump when it is farther than this from where the velocity leads, m, beside six
    /// standard deviations and an acceleration of `JUMP_M_S2`.
    const JUMP_M: f64 = 30.0;
    const JUMP_M_S2: f64 = 10.0;
    /// Without a velocity: faster than anything on the road or in the air, m/s.
    const FASTEST_M_S: f64 = 340.0;
    /// A receiver that says it is faster than this, m/s, does not stay where it is.
    const MOVES_M_S: f64 = 1.0;

    /// A velocity; the fix of the same instant has come before it.
    pub(super) fn velocity(&mut self, time_ns: i64, velocity: &GnssVelocity) {
        self.velocity = Some((time_ns, *velocity));
    }

    /// A fix.
    ///
    /// # Errors
    /// [`RecordingError::ImplausibleUnit`] once the evidence is in.
    pub(super) fn position(&mut self, time_ns: i64, fix: &GnssPosition) -> Verdict {
        in_range(fix)?;
        let Some((last_ns, last)) = self.last.replace((time_ns, *fix)) else {
            return Ok(());
        };
        let dt = time_ns.saturating_sub(last_ns) as f64 * 1e-9;
        // The velocity told with the fix before this one.
        let velocity = self
            .velocity
            .filter(|(told_ns, _)| time_ns.saturating_sub(*told_ns) as f64 * 1e-9 < 2.0 * dt + 0.1);
        let down = velocity.and_then(|(_, v)| v.down_m_s);
        let velocity = velocity.map(|(_, v)| [v.north_m_s, v.east_m_s]);
        self.watch(&last, fix, dt, velocity);
        match velocity {
            Some(velocity) if dt <= Self::LONGEST_PAUSE_S => {
                self.compare(&last, fix, dt, velocity);
                self.vertical
                    .compare([last.height_m, fix.height_m], dt, down);
                self.judge()?;
                self.vertical.judge()
            }
            _ => {
                self.stretch = None;
                self.vertical.pause();
                Ok(())
            }
        }
    }

    /// Counts jumps and repetitions.
    fn watch(
        &mut self,
        last: &GnssPosition,
        fix: &GnssPosition,
        dt: f64,
        velocity: Option<[f64; 2]>,
    ) {
        let [north, east] = way(last, [fix.latitude_rad, fix.longitude_rad]);
        let std = |fix: &GnssPosition| fix.std_m.map_or(0.0, |[n, e, _]| n.hypot(e));
        let uncertain_m = 6.0 * std(last).hypot(std(fix)) + Self::JUMP_M;
        let (off_m, allowed_m) = match velocity {
            Some([v_north, v_east]) => (
                (north - v_north * dt).hypot(east - v_east * dt),
                uncertain_m + 0.5 * Self::JUMP_M_S2 * dt * dt,
            ),
            None => (north.hypot(east), uncertain_m + Self::FASTEST_M_S * dt),
        };
        if off_m > allowed_m {
            self.jumps += 1;
            self.largest_jump_m = self.largest_jump_m.max(off_m);
        }
        let stays = north.abs() <= 0.0 && east.abs() <= 0.0;
        let moves = velocity.is_some_and(|[n, e]| n.hypot(e) > Self::MOVES_M_S);
        self.repeats += u64::from(stays && moves);
    }

    fn compare(&mut self, last: &GnssPosition, fix: &GnssPosition, dt: f64, v: [f64; 2]) {
        let stretch = self.stretch.get_or_insert(Stretch {
            start: [last.latitude_rad, last.longitude_rad],
            way: [0.0; 2],
        });
        stretch.way[0] += v[0] * dt;
        stretch.way[1] += v[1] * dt;
        let [north, east] = stretch.way;
        let length = north.hypot(east);
        if length < Self::LEAST_WAY_M {
            return;
        }
        let start = stretch.start;
        let end = [fix.latitude_rad, fix.longitude_rad];
        let as_is = between(start, end);
        let is_short = as_is[0].hypot(as_is[1]) < Self::LEAST_WAY_M;
        if is_short && length < Self::SMALLER_UNIT * Self::LEAST_WAY_M {
            return;
        }
        self.stretch = None;
        self.stretches += 1;
        let scaled =
            |[latitude, longitude]: [f64; 2]| [latitude.to_degrees(), longitude.to_degrees()];
        let swapped = |[latitude, longitude]: [f64; 2]| [longitude, latitude];
        let ways = [
            as_is,
            between(swapped(start), swapped(end)),
            between(scaled(start), scaled(end)),
            [as_is[0], -as_is[1]],
            swapped(as_is),
        ];
        self.along[0] += as_is[0] * north + as_is[1] * east;
        self.along[1] += length * length;
        let in_units = UNITS.map(|(unit, _)| as_is.map(|metres| metres / unit));
        for (error, way) in self.errors.iter_mut().zip(ways.into_iter().chain(in_units)) {
            let off = (way[0] - north).hypot(way[1] - east) / length;
            // One jump shall not outweigh everything.
            *error += off.min(2.0).powi(2);
        }
    }

    fn judge(&self) -> Verdict {
        let stretches = f64::from(self.stretches);
        let wrong = self.errors[0] / stretches;
        if self.stretches < Self::STRETCHES || wrong < Self::WRONG_UNIT {
            return Ok(());
        }
        let others = self.errors[1..].iter().enumerate();
        let best = others
            .filter(|(other, _)| wrong >= Self::WRONG || *other >= READINGS.len())
            .min_by(|a, b| a.1.total_cmp(b.1));
        let Some((best, _)) = best.filter(|(_, error)| **error < Self::RIGHT * stretches) else {
            return Ok(());
        };
        if let Some((looks, hint)) = READINGS.get(best) {
            return implausible(
                format!(
                    "over {stretches} stretches the fixes do not go where the receiver's own velocity goes; {looks}"
                ),
                hint,
            );
        }
        let (_, name) = UNITS[best - READINGS.len()];
        let ratio = self.along[0] / self.along[1];
        implausible(
            format!(
                "over {stretches} stretches the fixes go {ratio:.2} times as far as the receiver's own velocity; the velocity looks \
                 like {name} under the name of m/s"
            ),
            "if so, give it in m/s, or speed and course with their unit in a manifest (`northing describe` drafts one)",
        )
    }

    /// Tells what was counted.
    pub(super) fn tell(&self, issues: &mut Issues) {
        if self.jumps > 0 {
            issues.notes.push(format!(
                "The fixes jump {} time(s), by up to {:.0} m from where the velocity leads; estimators gate them.",
                self.jumps, self.largest_jump_m
            ));
        }
        if self.repeats > 0 {
            issues.notes.push(format!(
                "{} fix(es) repeat the position before them to the last digit although the receiver says that it moves.",
                self.repeats
            ));
        }
        self.vertical.tell(issues);
    }
}

/// Refuses what is no place on the Earth.
fn in_range(fix: &GnssPosition) -> Verdict {
    use std::f64::consts::{FRAC_PI_2, PI, TAU};
    /// Rounding at a pole or at the date line.
    const ROUNDING: f64 = 1e-9;
    let (latitude, longitude) = (fix.latitude_rad.abs(), fix.longitude_rad.abs());
    if latitude <= FRAC_PI_2 + ROUNDING && longitude <= TAU + ROUNDING {
        return Ok(());
    }
    if latitude <= PI + ROUNDING && longitude <= FRAC_PI_2 + ROUNDING {
        let [latitude, longitude] = [fix.latitude_rad, fix.longitude_rad].map(f64::to_degrees);
        return implausible(
            format!(
                "a latitude of {latitude:.4} deg is beyond the pole, the longitude is {longitude:.4} deg; the two look swapped"
            ),
            "if so, exchange `latitude` and `longitude` in the manifest",
        );
    }
    if latitude <= 90.0 && longitude <= 360.0 {
        return implausible(
            format!(
                "latitude {:.4} rad and longitude {:.4} rad are no place; they look like degrees under the name of radians",
                fix.latitude_rad, fix.longitude_rad
            ),
            "if so, say unit = \"deg\" in the manifest",
        );
    }
    let [latitude, longitude] = [fix.latitude_rad, fix.longitude_rad].map(f64::to_degrees);
    implausible(
        format!(
            "latitude {latitude:.4} deg and longitude {longitude:.4} deg are no place on the Earth"
        ),
        "check the columns and their unit (`1e-7-deg` for integers of ten-millionths of a degree)",
    )
}

pub(super) fn implausible(evidence: String, hint: &'static str) -> Verdict {
    let sensor = SensorKind::GnssPosition;
    Err(Doubt {
        sensor,
        evidence,
        hint,
    })
}

fn way(from: &GnssPosition, to: [f64; 2]) -> [f64; 2] {
    between([from.latitude_rad, from.longitude_rad], to)
}

/// Metres north and east from one place to another near it, both latitude and longitude in rad.
fn between(from: [f64; 2], to: [f64; 2]) -> [f64; 2] {
    let radii = Radii::at(from[0]);
    let half_turn = std::f64::consts::PI;
    // The short way across the date line.
    let east = (to[1] - from[1] + half_turn).rem_euclid(2.0 * half_turn) - half_turn;
    [
        (to[0] - from[0]) * radii.meridian_m,
        east * radii.prime_vertical_m * from[0].cos(),
    ]
}
