//! Parts of a fix that belong to one instant of UTC, put together; and times of day on a calendar.

use chrono::{Datelike as _, NaiveDate};

use super::content::Part;
use crate::event::Sample;
use crate::gnss::{GnssPosition, GnssQuality, GnssVelocity};

const DAY_NS: i64 = 86_400_000_000_000;

/// The parts of one fix.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Epoch {
    pub(super) time_of_day_ns: i64,
    pub(super) arrival_ns: Option<i64>,
    /// The receiver's date, if it has told one.
    pub(super) date: Option<NaiveDate>,
    merged: Part,
    is_invalid: bool,
}

impl Epoch {
    pub(super) fn new(time_of_day_ns: i64, arrival_ns: Option<i64>) -> Self {
        Self {
            time_of_day_ns,
            arrival_ns,
            ..Self::default()
        }
    }

    /// Adds what a sentence knows. What is known already stays: positions of one fix are the same, and
    /// GGA comes with its quality.
    pub(super) fn add(&mut self, part: &Part) {
        let merged = &mut self.merged;
        // A sentence that says "invalid" is right about the whole fix.
        self.is_invalid |= part.quality == Some(GnssQuality::Invalid);
        // The date of the fix before that of the clock.
        self.date = part.date.or(self.date);
        merged.position_rad = merged.position_rad.or(part.position_rad);
        merged.height_m = merged.height_m.or(part.height_m);
        merged.hdop = merged.hdop.or(part.hdop);
        merged.satellites = merged.satellites.or(part.satellites);
        merged.is_flat |= part.is_flat;
        merged.is_solid |= part.is_solid;
        merged.speed_m_s = merged.speed_m_s.or(part.speed_m_s);
        merged.course_rad = merged.course_rad.or(part.course_rad);
        merged.quality = match (merged.quality, part.quality) {
            // RMC of an older receiver cannot say more than "autonomous".
            (Some(GnssQuality::Autonomous) | None, Some(better)) => Some(better),
            (known, _) => known,
        };
    }

    /// The fix; `None` without a position.
    pub(super) fn position(&self) -> Option<GnssPosition> {
        let [latitude_rad, longitude_rad] = self.merged.position_rad?;
        Some(GnssPosition {
            latitude_rad,
            longitude_rad,
            height_m: self
                .merged
                .height_m
                .filter(|_| self.merged.is_solid || !self.merged.is_flat),
            std_m: None,
            hdop: self.merged.hdop,
            satellites: self.merged.satellites,
            quality: if self.is_invalid {
                GnssQuality::Invalid
            } else {
                self.merged.quality.unwrap_or_default()
            },
        })
    }

    /// The velocity; none of an invalid fix.
    pub(super) fn velocity(&self) -> Option<GnssVelocity> {
        let speed = self.merged.speed_m_s.filter(|_| !self.is_invalid)?;
        // Receivers at rest have no course; then it does not matter.
        let course = match self.merged.course_rad {
            Some(course) => course,
            None if speed <= 0.0 => 0.0,
            None => return None,
        };
        Some(GnssVelocity::from_course(speed, course))
    }

    /// The samples of the epoch; none where the receiver has no position.
    pub(super) fn samples(&self) -> Option<impl Iterator<Item = Sample> + use<>> {
        let position = self.position()?;
        let velocity = self.velocity().map(Sample::GnssVelocity);
        Some(std::iter::once(Sample::GnssPosition(position)).chain(velocity))
    }
}

/// Puts times of day on days. A receiver's date may be off by 1024 weeks, so it is only accepted where
/// nothing better is known.
#[derive(Debug, Clone, Default)]
pub(super) struct Calendar {
    last_ns: Option<i64>,
    /// The first date that contradicts the arrival, and the arrival's day.
    pub(super) contradiction: Option<[NaiveDate; 2]>,
}

impl Calendar {
    /// Nanoseconds since 1970 of a time of day.
    pub(super) fn place(
        &mut self,
        time_of_day_ns: i64,
        date: Option<NaiveDate>,
        arrival_ns: Option<i64>,
    ) -> i64 {
        let day = match (arrival_ns, self.last_ns) {
            (Some(arrival), _) => {
                let day = nearest_day(time_of_day_ns, arrival);
                self.compare(day, date);
                day
            }
            (None, Some(last)) => {
                let day = nearest_day(time_of_day_ns, last);
                let own = date.map_or(day, day_of);
                // Only a date can tell a log that goes on another day from a clock that goes back.
                let goes_back = day * DAY_NS + time_of_day_ns < last;
                if goes_back && own > day { own } else { day }
            }
            (None, None) => date.map_or(0, day_of),
        };
        let time_ns = day.saturating_mul(DAY_NS).saturating_add(time_of_day_ns);
        self.last_ns = Some(self.last_ns.map_or(time_ns, |last| last.max(time_ns)));
        time_ns
    }

    fn compare(&mut self, day: i64, date: Option<NaiveDate>) {
        let Some(date) = date else { return };
        // A day of difference is a matter of midnight.
        if self.contradiction.is_none() && (day_of(date) - day).abs() > 1 {
            let days = i32::try_from(day + UNIX_EPOCH_DAY);
            let arrival = days.ok().and_then(NaiveDate::from_num_days_from_ce_opt);
            self.contradiction = arrival.map(|arrival| [date, arrival]);
        }
    }
}

/// Days from the first of January of the year 1 to that of 1970, as chrono counts.
const UNIX_EPOCH_DAY: i64 = 719_163;

/// Days since 1970.
fn day_of(date: NaiveDate) -> i64 {
    i64::from(date.num_days_from_ce()) - UNIX_EPOCH_DAY
}

/// The day on which the time of day is nearest to an instant.
fn nearest_day(time_of_day_ns: i64, instant_ns: i64) -> i64 {
    (instant_ns.saturating_sub(time_of_day_ns))
        .saturating_add(DAY_NS / 2)
        .div_euclid(DAY_NS)
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOUR_NS: i64 = DAY_NS / 24;

    fn date(year: i32, month: u32, day: u32) -> Option<NaiveDate> {
        NaiveDate::from_ymd_opt(year, month, day)
    }

    #[test]
    fn midnight_and_a_rolled_over_week_do_not_disturb_differences() {
        let mut calendar = Calendar::default();
        let first = calendar.place(23 * HOUR_NS, date(1994, 12, 15), None);
        assert_eq!(
            first,
            day_of(date(1994, 12, 15).unwrap()) * DAY_NS + 23 * HOUR_NS
        );
        assert_eq!(
            calendar.place(HOUR_NS, date(2014, 8, 1), None) - first,
            2 * HOUR_NS
        );
        // A sentence from before midnight that comes late.
        assert_eq!(calendar.place(23 * HOUR_NS, None, None), first);
        assert_eq!(calendar.place(2 * HOUR_NS, None, None) - first, 3 * HOUR_NS);
        // The log goes on two days later, in the morning.
        let later = calendar.place(HOUR_NS, date(1994, 12, 18), None);
        assert_eq!(later - first, 2 * DAY_NS + 2 * HOUR_NS);
    }

    #[test]
    fn the_arrival_knows_the_day() {
        let arrival = day_of(date(2014, 8, 1).unwrap()) * DAY_NS + 241_000_000;
        let mut calendar = Calendar::default();
        let time = calendar.place(DAY_NS - 774_000_000, date(1994, 12, 15), Some(arrival));
        assert_eq!(arrival - time, 1_015_000_000);
        let [told, known] = calendar.contradiction.unwrap();
        // The time of day is that of the evening before.
        assert_eq!((known - told).num_weeks(), 1024);
    }

    #[test]
    fn one_sentence_that_says_invalid_is_enough() {
        let place = Part {
            position_rad: Some([0.1, 0.2]),
            quality: Some(GnssQuality::Differential),
            height_m: Some(5.0),
            speed_m_s: Some(3.0),
            course_rad: Some(0.0),
            ..Part::default()
        };
        let mut epoch = Epoch::new(0, None);
        epoch.add(&place);
        assert_eq!(epoch.position().unwrap().quality, GnssQuality::Differential);
        assert_eq!(epoch.samples().unwrap().count(), 2);
        epoch.add(&Part {
            is_flat: true,
            ..Part::default()
        });
        assert_eq!(epoch.position().unwrap().height_m, None);
        epoch.add(&Part {
            quality: Some(GnssQuality::Invalid),
            ..Part::default()
        });
        epoch.add(&place);
        assert!(!epoch.position().unwrap().is_usable());
        assert_eq!(epoch.velocity(), None);
    }
}
