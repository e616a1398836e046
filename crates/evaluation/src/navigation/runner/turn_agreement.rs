//! Cross-correlation of the gyroscope's turns with those of the course: clocks apart, rates in degrees, axes mirrored.
//!
//! A vehicle that goes where it points turns as its course does. Where both clearly agree, but with another delay, scale or
//! sign than they should, that is said. Where they do not, as on a drone that flies sideways, nothing is.

use std::ops::RangeInclusive;

use nalgebra::{Vector2, Vector3};
use northing_core::earth::FrameChange;
use northing_core::geometry::trigonometry::wrap;

use crate::statistics::seconds_between;

/// Seconds kept of each: the first hour and a bit.
const MOST_SECONDS: usize = 4096;
/// Time constant of the mean force, which points up, s.
const LEVEL_S: f64 = 1.0;
/// Longest interval between inertial samples, s, and between courses.
const LONGEST_STEP_S: f64 = 0.2;
const LONGEST_COURSE_S: f64 = 3.0;
/// Least interval between courses, s.
const SHORTEST_COURSE_S: f64 = 0.9;
/// A way shorter than this, m, or than twice the standard deviation of its ends has no course.
const SHORTEST_WAY_M: f64 = 2.0;
/// Slower than this there is no course, m/s.
const SLOWEST: f64 = 2.0;
/// Seconds in which both must be known.
const FEWEST_SECONDS: usize = 40;
/// Root mean square of the course's rate from which it turns, rad/s.
const TURNING: f64 = 0.03;
/// Correlation from which both agree ...
const AGREE: f64 = 0.85;
/// ... how much better another delay than that of the stamps must be ...
const BETTER_BY: f64 = 0.2;
/// ... and share of its correlation that no other may reach.
const AMBIGUOUS: f64 = 0.9;
/// How much more the gyroscope turns than the course if its rates are in degrees, at least.
const DEGREES: f64 = 20.0;
/// Delays nearer than this are one, s.
const SAME_DELAY_S: i64 = 10;
/// Seconds that are averaged: the noise of two courses is in each of their differences.
const AVERAGED: usize = 5;

/// Mean rates of whole seconds; not a number where they are not known.
#[derive(Debug, Clone, Default)]
struct Rates {
    first_ns: Option<i64>,
    seconds: Vec<Sum>,
}

/// A turn (rad) in a time (s).
#[derive(Debug, Clone, Copy, Default)]
struct Sum {
    turn: f64,
    time: f64,
}

impl Rates {
    /// Adds a turn (rad) that took `dt` seconds from `time_ns` on.
    fn add(&mut self, time_ns: i64, turn: f64, dt: f64) {
        let first = *self.first_ns.get_or_insert(time_ns);
        let second = seconds_between(first, time_ns).floor();
        if !(0.0..MOST_SECONDS as f64).contains(&second) {
            return;
        }
        let second = second as usize;
        if self.seconds.len() <= second {
            self.seconds.resize(second + 1, Sum::default());
        }
        self.seconds[second].turn += turn;
        self.seconds[second].time += dt;
    }

    /// Moving averages, from the first second on.
    fn rates(&self) -> Vec<f64> {
        let rate = |sum: &Sum| {
            if sum.time > 0.5 {
                sum.turn / sum.time
            } else {
                f64::NAN
            }
        };
        let mean = |seconds: &[Sum]| seconds.iter().map(rate).sum::<f64>() / AVERAGED as f64;
        self.seconds.windows(AVERAGED).map(mean).collect()
    }
}

/// Gathers both while a run goes on.
#[derive(Debug, Clone, Default)]
pub(super) struct TurnAgreement {
    gyroscope: Rates,
    course: Rates,
    /// Mean force, body axes.
    up: Option<Vector3<f64>>,
    inertial_ns: Option<i64>,
    last_fix: Option<(i64, Vector2<f64>)>,
    last_course: Option<(i64, f64)>,
    has_velocity: bool,
}

/// How well both agree with one delay.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Agreement {
    /// Seconds after the first second of the course at which the gyroscope begins.
    delay_s: i64,
    correlation: f64,
    /// Gyroscope over course.
    scale: f64,
}

impl TurnAgreement {
    /// An inertial sample, forward, right, down.
    pub(super) fn inertial(&mut self, time_ns: i64, rate: &Vector3<f64>, force: &Vector3<f64>) {
        let last = self.inertial_ns.replace(time_ns);
        let passed = last.map_or(0.0, |last| seconds_between(last, time_ns));
        if !(rate.norm_squared() + force.norm_squared()).is_finite() {
            return;
        }
        let up = self.up.get_or_insert(*force);
        if passed <= 0.0 || passed > LONGEST_STEP_S {
            return;
        }
        *up += (force - *up) * (passed / LEVEL_S).min(1.0);
        let norm = up.norm();
        if norm > 0.0 {
            let turn = -rate.dot(up) / norm * passed;
            let from_ns = last.unwrap_or(time_ns);
            self.gyroscope.add(from_ns, turn, passed);
        }
    }

    /// A usable fix, m, with its horizontal standard deviation.
    pub(super) fn fix(&mut self, time_ns: i64, ned: &Vector3<f64>, std: f64) {
        let place = ned.xy();
        let Some((before_ns, before)) = self.last_fix else {
            self.last_fix = Some((time_ns, place));
            return;
        };
        let passed = seconds_between(before_ns, time_ns);
        if passed < SHORTEST_COURSE_S {
            return;
        }
        self.last_fix = Some((time_ns, place));
        let way: Vector2<f64> = place - before;
        let clear = way.norm() > SHORTEST_WAY_M.max(2.0 * std);
        if !self.has_velocity && clear && passed < LONGEST_COURSE_S {
            let middle_ns = before_ns + (time_ns - before_ns) / 2;
            self.course(middle_ns, way.y.atan2(way.x));
        }
    }

    /// Positions are of another local frame from now on.
    pub(super) fn move_origin(&mut self, change: &FrameChange<f64>) {
        if let Some((_, place)) = &mut self.last_fix {
            *place = change.position(&place.push(0.0)).xy();
        }
    }

    /// A velocity of the receiver.
    pub(super) fn velocity(&mut self, time_ns: i64, ned: &Vector3<f64>) {
        if !self.has_velocity {
            // Both kinds of course are of different instants.
            self.has_velocity = true;
            self.last_course = None;
        }
        let due = |(before, _): &(i64, f64)| seconds_between(*before, time_ns) >= SHORTEST_COURSE_S;
        if ned.xy().norm() > SLOWEST && self.last_course.as_ref().is_none_or(due) {
            self.course(time_ns, ned.y.atan2(ned.x));
        }
    }

    fn course(&mut self, time_ns: i64, course: f64) {
        let Some((before_ns, before)) = self.last_course.replace((time_ns, course)) else {
            return;
        };
        let passed = seconds_between(before_ns, time_ns);
        if passed > 0.0 && passed < LONGEST_COURSE_S {
            self.course.add(before_ns, wrap(course - before), passed);
        }
    }

    /// What is odd, a sentence.
    pub(super) fn issue(&self) -> Option<String> {
        let (gyroscope_ns, course_ns) = (self.gyroscope.first_ns?, self.course.first_ns?);
        let (gyroscope, course) = (self.gyroscope.rates(), self.course.rates());
        // The gyroscope's first second is so many after that of the course by the stamps.
        let stated = seconds_between(course_ns, gyroscope_ns);
        let at =
            |delays: RangeInclusive<i64>| delays.filter_map(|d| agreement(&gyroscope, &course, d));
        let near = stated.round() as i64;
        let clearest = |a: &Agreement, b: &Agreement| {
            f64::total_cmp(&a.correlation.abs(), &b.correlation.abs())
        };
        let now = at(near - 1..=near + 1).max_by(clearest);
        if let Some(now) = now.filter(|now| now.correlation >= AGREE) {
            return wrong_scale(&now);
        }
        let against = now.filter(|now| now.correlation <= -AGREE);
        let others = self.another_clock(&gyroscope, &course, stated, now);
        match (against, others) {
            (Some(against), clock) => {
                let all = at(-(gyroscope.len() as i64)..=course.len() as i64);
                let clock = match clock {
                    Some((offset_s, correlation)) => format!(
                        ", or the clock of the inertial samples is {:.0} s {} the receiver's (then correlation {correlation:.2})",
                        offset_s.abs(),
                        behind_or_ahead(offset_s),
                    ),
                    // Which one, the motion does not say.
                    None if all.map(|a| a.correlation).fold(0.0, f64::max) >= AGREE => {
                        ", or the clocks of inertial samples and receiver are apart".to_owned()
                    }
                    None => String::new(),
                };
                Some(self.against_in_words(&against, &clock))
            }
            (None, Some((offset, correlation))) => Some(apart_in_words(offset, correlation)),
            (None, None) => None,
        }
    }

    /// The offset of the clocks (s) with which both clearly agree, better than now, and no other does; and their correlation.
    fn another_clock(
        &self,
        gyroscope: &[f64],
        course: &[f64],
        stated: f64,
        now: Option<Agreement>,
    ) -> Option<(f64, f64)> {
        let at =
            |delays: RangeInclusive<i64>| delays.filter_map(|d| agreement(gyroscope, course, d));
        let clearest =
            |a: &Agreement, b: &Agreement| f64::total_cmp(&a.correlation, &b.correlation);
        let all = at(-(gyroscope.len() as i64)..=course.len() as i64);
        let all: Vec<Agreement> = all.filter(|a| a.correlation > 0.0).collect();
        let best = all.iter().copied().max_by(clearest)?;
        let apart = |a: &&Agreement| (a.delay_s - best.delay_s).abs() > SAME_DELAY_S;
        let unique = |a: &Agreement| a.correlation < AMBIGUOUS * best.correlation;
        let better_by = best.correlation - now.map_or(0.0, |now| now.correlation);
        if best.correlation < AGREE
            || better_by < BETTER_BY
            || !all.iter().filter(apart).all(unique)
        {
            return None;
        }
        // Between seconds it is the top of the parabola through the neighbours.
        let beside = |d: i64| at(d..=d).next().map_or(best.correlation, |a| a.correlation);
        let top = top_of([
            beside(best.delay_s - 1),
            best.correlation,
            beside(best.delay_s + 1),
        ]);
        let offset = stated - (best.delay_s as f64 + top);
        Some((offset, best.correlation))
    }

    /// A sentence about turns that go against each other, with all that it can be.
    fn against_in_words(&self, now: &Agreement, clock: &str) -> String {
        let course = match self.has_velocity {
            true => "north and east of the receiver's velocity",
            false => "latitude and longitude of the fixes",
        };
        format!(
            "The gyroscope turns against the course over ground (correlation {:.2}): the gyroscope's axes are mirrored or its signs \
             exchanged, or those of the accelerometer, which says where up is, or {course} are exchanged{clock}.",
            now.correlation,
        )
    }
}

/// Where the parabola through three equidistant values has its top, from the middle one; 0 without any.
fn top_of([before, middle, after]: [f64; 3]) -> f64 {
    let bend = before - 2.0 * middle + after;
    if bend < 0.0 {
        0.5 * (before - after) / bend
    } else {
        0.0
    }
}

const fn behind_or_ahead(offset_s: f64) -> &'static str {
    if offset_s < 0.0 { "behind" } else { "ahead of" }
}

/// A sentence about clocks that are so many seconds apart; the inertial samples' is ahead.
fn apart_in_words(offset_s: f64, correlation: f64) -> String {
    let way = behind_or_ahead(offset_s);
    let offset_s = offset_s.abs();
    format!(
        "The clock of the inertial samples is {offset_s:.0} s {way} the receiver's: with that taken out, the turns of the \
         gyroscope are those of the course (correlation {correlation:.2}). In a manifest `time_offset_s` shifts a table."
    )
}

/// A sentence about turns that agree in time, but not in size.
fn wrong_scale(now: &Agreement) -> Option<String> {
    (now.scale > DEGREES).then(|| {
        format!(
            "The gyroscope turns {:.0} times as far as the course: its rates are in degrees per second; say --gyroscope-unit \
             deg-per-s.",
            now.scale
        )
    })
}

/// Correlation where the gyroscope's first second is `delay_s` after that of the course; `None` where there is too little.
fn agreement(gyroscope: &[f64], course: &[f64], delay_s: i64) -> Option<Agreement> {
    let pairs = || {
        let pair = |(k, x): (usize, &f64)| {
            let index = usize::try_from(k as i64 - delay_s).ok()?;
            Some((*x, *gyroscope.get(index)?)).filter(|(x, y)| x.is_finite() && y.is_finite())
        };
        course.iter().enumerate().filter_map(pair)
    };
    let n = pairs().count();
    if n < FEWEST_SECONDS {
        return None;
    }
    let mean = |value: fn((f64, f64)) -> f64| pairs().map(value).sum::<f64>() / n as f64;
    let (mx, my) = (mean(|(x, _)| x), mean(|(_, y)| y));
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for (x, y) in pairs() {
        xx += (x - mx) * (x - mx);
        xy += (x - mx) * (y - my);
        yy += (y - my) * (y - my);
    }
    let turns = (xx / n as f64).sqrt() > TURNING;
    (turns && yy > 0.0).then(|| Agreement {
        delay_s,
        correlation: xy / (xx * yy).sqrt(),
        scale: xy / xx,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A vehicle at 10 m/s whose gyroscope has another clock (s later), scale, and heading across its way.
    fn drive(later_s: f64, scale: f64, sideways: bool) -> TurnAgreement {
        let mut turns = TurnAgreement::default();
        // A street every 6 s: left, right or straight on, as if by chance.
        let rate = |t: f64| 0.15 * ((7.3 * ((t / 6.0).floor() + 1.0).powi(2)).sin() * 2.0).round();
        let (mut course, mut place) = (0.5_f64, Vector3::zeros());
        let later_ns = (later_s * 1e9) as i64;
        let up = Vector3::new(0.0, 0.0, -9.81);
        for k in 0..10_000_i64 {
            let (t, time_ns) = (k as f64 * 0.02, k * 20_000_000);
            let turn = if sideways {
                0.3 * (0.77 * t).sin()
            } else {
                rate(t)
            };
            turns.inertial(time_ns + later_ns, &(Vector3::z() * turn * scale), &up);
            if k % 50 == 0 {
                turns.fix(time_ns, &place, 0.5);
            }
            course += rate(t) * 0.02;
            place += Vector3::new(course.cos(), course.sin(), 0.0) * 0.2;
        }
        turns
    }

    #[test]
    fn turns_that_agree_are_no_issue_and_sideways_flight_says_nothing() {
        assert_eq!(drive(0.0, 1.0, false).issue(), None);
        assert_eq!(drive(0.3, 1.1, false).issue(), None);
        assert_eq!(drive(0.0, 1.0, true).issue(), None);
        assert_eq!(TurnAgreement::default().issue(), None);
    }

    #[test]
    fn clocks_apart_are_found_with_their_offset() {
        for (later_s, expected) in [
            (3.0, "is 3 s ahead of the receiver's"),
            (20.0, "is 20 s ahead of the receiver's"),
            (-130.0, "is 130 s behind the receiver's"),
            (86_400.0, "is 86400 s ahead of the receiver's"),
        ] {
            let issue = drive(later_s, 1.0, false).issue().unwrap();
            assert!(issue.contains(expected), "{issue}");
        }
    }

    #[test]
    fn degrees_and_mirrored_axes_are_found() {
        let issue = drive(0.0, 57.3, false).issue().unwrap();
        assert!(
            issue.contains("57 times") && issue.contains("deg-per-s"),
            "{issue}"
        );
        let issue = drive(0.0, -1.0, false).issue().unwrap();
        assert!(
            issue.contains("mirrored") && issue.contains("those of the accelerometer"),
            "{issue}"
        );
        assert!(
            issue.contains("latitude and longitude of the fixes are exchanged")
                && !issue.contains("clock"),
            "{issue}"
        );
    }

    #[test]
    fn hours_are_kept_in_bounded_memory() {
        let mut turns = TurnAgreement::default();
        for k in 0..100_000_i64 {
            let time_ns = k * 100_000_000;
            turns.inertial(time_ns, &Vector3::z(), &-Vector3::z());
            turns.velocity(time_ns, &Vector3::new(10.0, 0.0, 0.0));
        }
        assert_eq!(turns.gyroscope.seconds.len(), MOST_SECONDS);
        assert_eq!(turns.issue(), None);
    }
}
