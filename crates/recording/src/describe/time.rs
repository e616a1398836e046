//! Which column has the time stamps, and in what unit.

use super::names::{Single, single, unit};
use super::table::{Column, Table, is_date, is_time_of_day};
use super::turns::{Fit, median};
use super::{Confidence, Found};
use crate::error::shown;
use crate::stamp;

/// The time of a table.
#[derive(Debug, Clone)]
pub(super) struct Time {
    /// The columns of the stamps; none where the rows are counted.
    pub(super) columns: Vec<usize>,
    /// The unit's name, of one column.
    pub(super) unit: &'static str,
    /// Of every row, s; without stamps the number of the row until the rate is known.
    pub(super) seconds: Vec<f64>,
    /// Of rows that are counted, once it is known.
    pub(super) rate_hz: Option<f64>,
    /// How it was found; without stamps, why what looks like a time is none, or that nothing does.
    pub(super) found: Found,
}

/// Units of time with their seconds.
const UNITS: [(&str, f64); 4] = [("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)];

/// Rows a second of inertial sensors, and of receivers alone.
const INERTIAL_HZ: std::ops::RangeInclusive<f64> = 4.0..=4000.0;
const RECEIVER_HZ: std::ops::RangeInclusive<f64> = 0.05..=20.0;
/// Rates that somebody may have chosen, and those that a header must be wrong about.
const CONCEIVABLE_HZ: std::ops::RangeInclusive<f64> = 0.5..=8000.0;
const POSSIBLE_HZ: std::ops::RangeInclusive<f64> = 0.01..=20_000.0;

impl Time {
    /// Looks for the stamps of a table.
    pub(super) fn of(table: &Table, is_inertial: bool) -> Self {
        let (date, number) = (Self::date(table), Self::number(table, is_inertial));
        let found = match (date, number) {
            // Dates that are cut off at the second beside a clock that is finer, and is named so.
            (Some(date), Some(number)) => {
                let stamps = |time: &Self| growing(&time.seconds).unwrap_or(0);
                let is_clock =
                    |place: &usize| single(&table.columns[*place].name) == Some(Single::Time);
                let is_finer = stamps(&date) < stamps(&number);
                Some(if is_finer && number.columns.iter().all(is_clock) {
                    number
                } else {
                    date
                })
            }
            (date, number) => date.or(number),
        };
        found.unwrap_or_else(|| Self {
            columns: Vec::new(),
            unit: "",
            seconds: (0..table.rows).map(|row| row as f64).collect(),
            rate_hz: None,
            found: Found::new(without_stamps(table), Confidence::Assumed),
        })
    }

    /// The same with its rows counted, where its stamps are cut off: as many rows of every stamp, and all stamps as far apart.
    pub(super) fn counted(&self, table: &Table) -> Option<Self> {
        let column = self.columns.first()?;
        let (rows, apart_s) = rows_of_stamps(&self.seconds).filter(|_| self.has_samples(table))?;
        let rate_hz = (1e4 * rows / apart_s).round() / 1e4;
        let why = format!(
            "column `{}` has one stamp for about {rows:.0} rows, {apart_s:.3} s apart, so its times are cut off; the rows are counted in place \
             of it",
            table.shown(*column)
        );
        Some(self.with_rate(rate_hz, Found::new(why, Confidence::Likely)))
    }

    /// Whether rows with the stamp of the row before have other samples than that: they are neither held nor another sensor's.
    fn has_samples(&self, table: &Table) -> bool {
        let others = (0..table.columns.len()).filter(|place| !self.columns.contains(place));
        let others: Vec<&[f64]> = others
            .map(|place| &table.columns[place].numbers[..])
            .collect();
        let shared = (1..table.rows).filter(|row| self.is_shared(*row));
        let (new, all) = shared.fold((0, 0), |(new, all), row| {
            let is_new = others
                .iter()
                .any(|column| (column[row] - column[row - 1]).abs() > 0.0);
            (new + usize::from(is_new), all + 1)
        });
        10 * new > 9 * all
    }

    /// Whether a row has the stamp of the one before.
    fn is_shared(&self, row: usize) -> bool {
        (self.seconds[row] - self.seconds[row - 1]).abs() <= 0.0
    }

    /// Whether most rows have the stamp of the one before.
    pub(super) fn repeats(&self) -> bool {
        let rows = self.seconds.len();
        2 * (1..rows).filter(|row| self.is_shared(*row)).count() > rows
    }

    /// The first and the last stamp, s, of a table that has some.
    pub(super) fn span_s(&self) -> Option<[f64; 2]> {
        let finite = self.seconds.iter().copied().filter(|t| t.is_finite());
        let [first, last] = finite.fold([f64::INFINITY, f64::NEG_INFINITY], |[first, last], t| {
            [first.min(t), last.max(t)]
        });
        (!self.columns.is_empty() && first <= last).then_some([first, last])
    }

    /// Without its stamps, the rows at a rate, Hz.
    pub(super) fn with_rate(&self, rate_hz: f64, found: Found) -> Self {
        Self {
            columns: Vec::new(),
            unit: "",
            seconds: (0..self.seconds.len())
                .map(|row| row as f64 / rate_hz)
                .collect(),
            rate_hz: Some(rate_hz),
            found,
        }
    }

    /// Dates with a time of day, in one column or two.
    fn date(table: &Table) -> Option<Self> {
        let is_text = |column: &&Column| column.words * 2 > table.rows;
        let text: Vec<usize> = (table.columns.iter().enumerate())
            .filter(|(_, column)| is_text(column))
            .map(|(place, _)| place)
            .collect();
        let first = |place: usize| table.columns[place].first.as_str();
        let whole = |place: &usize| stamp::parse_date_time(first(*place).as_bytes()).is_some();
        let columns = if let Some(place) = text.iter().copied().find(|place| whole(place)) {
            vec![place]
        } else {
            let date = text.iter().copied().find(|place| is_date(first(*place)));
            let clock = text
                .iter()
                .copied()
                .find(|place| is_time_of_day(first(*place)))?;
            let Some(date) = date else {
                return Some(Self::time_of_day(table, clock));
            };
            vec![date, clock]
        };
        let what = match columns.len() {
            1 => "it holds dates with a time of day; UTC, as no zone is said, or the zone that is",
            _ => "one column holds dates, the other times of day; taken as UTC",
        };
        let dates = |row: usize| {
            columns
                .iter()
                .map(|place| table.columns[*place].dates[row])
                .sum()
        };
        Some(Self {
            seconds: (0..table.rows).map(dates).collect(),
            columns,
            unit: "date-time",
            rate_hz: None,
            found: Found::new(what, Confidence::Certain),
        })
    }

    /// Times of day in one column.
    fn time_of_day(table: &Table, place: usize) -> Self {
        const DAY_S: f64 = 86_400.0;
        let (mut midnights, mut before) = (0.0, f64::NEG_INFINITY);
        let on = |clock: &f64| {
            if clock + midnights * DAY_S < before - 0.5 * DAY_S {
                midnights += 1.0;
            }
            let seconds = clock + midnights * DAY_S;
            before = if seconds.is_finite() { seconds } else { before };
            seconds
        };
        Self {
            seconds: table.columns[place].dates.iter().map(on).collect(),
            columns: vec![place],
            unit: "time-of-day",
            rate_hz: None,
            found: Found::new(
                "it holds times of day; of which day is not said",
                Confidence::Certain,
            ),
        }
    }

    /// A column of numbers.
    fn number(table: &Table, is_inertial: bool) -> Option<Self> {
        let mut best: Option<(bool, usize, usize)> = None;
        for (place, column) in table.columns.iter().enumerate() {
            let is_named = single(&column.name) == Some(Single::Time);
            let Some(different) = growing(&column.numbers) else {
                continue;
            };
            // Rows that are counted are no clock.
            if !is_named && is_count(&column.numbers) {
                continue;
            }
            if best.is_none_or(|(named, most, _)| (is_named, different) > (named, most)) {
                best = Some((is_named, different, place));
            }
        }
        let (is_named, _, place) = best?;
        let column = &table.columns[place];
        let (unit, seconds, found) = time_unit(column, is_named, is_inertial)?;
        let times = column.numbers.iter().map(|x| x * seconds);
        Some(Self {
            columns: vec![place],
            unit,
            seconds: times.collect(),
            rate_hz: None,
            found,
        })
    }
}

/// How many rows share a stamp, and how far stamps are apart, s, where many do and steadily.
fn rows_of_stamps(seconds: &[f64]) -> Option<(f64, f64)> {
    /// Stamps from which a rate is told; each has its rows to so large a part.
    const FEWEST_STAMPS: usize = 5;
    const STEADY: f64 = 0.1;
    let (mut stamps, mut before): (Vec<(f64, f64)>, _) = (Vec::new(), f64::NAN);
    for now in seconds {
        match stamps.last_mut() {
            Some((_, rows)) if (now - before).abs() <= 0.0 => *rows += 1.0,
            _ => stamps.push((*now, 1.0)),
        }
        before = *now;
    }
    // The first and the last one may be cut.
    let inner = stamps.get(1..stamps.len().saturating_sub(1))?;
    if inner.len() < FEWEST_STAMPS {
        return None;
    }
    let rows = inner.iter().map(|(_, rows)| rows).sum::<f64>() / inner.len() as f64;
    let mut steps: Vec<f64> = stamps
        .windows(2)
        .map(|pair| pair[1].0 - pair[0].0)
        .collect();
    let is_steady = inner
        .iter()
        .all(|(_, n)| (n - rows).abs() <= (STEADY * rows).max(1.0));
    let [least, most] = [f64::min, f64::max].map(|of| steps.iter().copied().fold(steps[0], of));
    let apart_s = median(&mut steps);
    let is_even = least > 0.99 * apart_s && most < 1.01 * apart_s;
    (rows >= 2.0 && is_steady && is_even && apart_s > 0.0).then_some((rows, apart_s))
}

/// Why a table has no stamps: what is called a time, or looks like one, and why it is none.
fn without_stamps(table: &Table) -> String {
    let called = (table.columns.iter().enumerate())
        .find(|(_, column)| single(&column.name) == Some(Single::Time));
    let Some((place, column)) = called else {
        return "no column of time stamps".to_owned();
    };
    let name = table.shown(place);
    if column.words * 2 > table.rows {
        return format!(
            "column `{name}` is called a time, but `{}` is none that can be read (of a date it must be clear which number is the month)",
            shown(&column.first)
        );
    }
    let finite = column.numbers.iter().filter(|x| x.is_finite()).count();
    if finite * 2 < table.rows {
        return format!("column `{name}` is called a time, but is empty in most rows");
    }
    format!(
        "column `{name}` is called a time, but its numbers do not go on from row to row: they repeat, go back or count rows"
    )
}

/// How many different numbers there are, where they grow.
fn growing(numbers: &[f64]) -> Option<usize> {
    let finite: Vec<f64> = numbers.iter().copied().filter(|x| x.is_finite()).collect();
    if finite.len() * 2 < numbers.len() || finite.len() < 3 {
        return None;
    }
    let back = finite.windows(2).filter(|pair| pair[1] < pair[0]).count();
    let ahead = finite.windows(2).filter(|pair| pair[1] > pair[0]).count();
    (back * 1000 <= finite.len() && ahead * 20 > finite.len()).then_some(ahead + 1)
}

/// Whether every number is one more than that before it.
fn is_count(numbers: &[f64]) -> bool {
    numbers
        .windows(2)
        .all(|pair| (pair[1] - pair[0] - 1.0).abs() < 1e-9)
}

/// A unit of time: its name and its seconds.
type Unit = (&'static str, f64);

/// The unit of a column of time, its seconds, and why.
fn time_unit(
    column: &Column,
    is_named: bool,
    is_inertial: bool,
) -> Option<(&'static str, f64, Found)> {
    let steps = column.numbers.windows(2).map(|pair| pair[1] - pair[0]);
    let mut steps: Vec<f64> = steps.filter(|step| *step > 0.0).collect();
    let step = median(&mut steps);
    let rate = |unit: &Unit| 1.0 / (step * unit.1);
    let usual = if is_inertial {
        INERTIAL_HZ
    } else {
        RECEIVER_HZ
    };
    let is_usual = |unit: &&Unit| usual.contains(&rate(unit));
    let named = unit(&column.name).1;
    let told = UNITS.iter().find(|(name, _)| Some(*name) == named);
    // Numbers since 1970.
    let first = column.numbers.iter().copied().find(|x| x.is_finite())?;
    let is_epoch = |(_, seconds): &&Unit| (1e9..4e9).contains(&(first * seconds));
    let epoch = UNITS.iter().find(is_epoch).filter(is_usual);
    let found =
        |unit: &Unit, why: String, confidence| Some((unit.0, unit.1, Found::new(why, confidence)));
    if let Some(told) = told.filter(|unit| POSSIBLE_HZ.contains(&rate(unit)))
        && epoch.is_none_or(|epoch| epoch == told || is_usual(&told))
    {
        let why = format!(
            "the header names the unit; rows come at {:.4} Hz",
            rate(told)
        );
        let confidence = match is_usual(&told) {
            true => Confidence::Certain,
            false => Confidence::Likely,
        };
        return found(told, why, confidence);
    }
    let other = told.map_or(String::new(), |told| {
        format!(
            "; the header says {}, in which they would come at {:.4} Hz",
            told.0,
            rate(told)
        )
    });
    let assumed_without_name = match is_named {
        true => Confidence::Likely,
        false => Confidence::Assumed,
    };
    if let Some(epoch) = epoch {
        let why = format!(
            "rows come at {:.4} Hz in this unit, and numbers count from 1970{other}",
            rate(epoch)
        );
        return found(epoch, why, assumed_without_name);
    }
    let best = UNITS.iter().find(is_usual)?;
    let mut why = format!("rows come at {:.4} Hz in this unit{other}", rate(best));
    let is_other = |unit: &&Unit| *unit != best && CONCEIVABLE_HZ.contains(&rate(unit));
    let mut confidence = assumed_without_name;
    if let Some(also) = UNITS.iter().find(is_other) {
        why = format!("{why}; in {} it would be {:.4} Hz", also.0, rate(also));
        confidence = Confidence::Assumed;
    }
    found(best, why, confidence)
}

/// The rate of rows without time stamps by the turns of gravity, where the time of a row is taken as 1: the gyroscope's
/// unit is that of the header, or the one with which the rate is a sensor's.
pub(super) fn rate_of_rows(without: &str, unit: Option<&str>, fit: Fit) -> Option<(f64, Found)> {
    const RATES_HZ: std::ops::Range<f64> = 20.0..2000.0;
    let of_unit = |unit: &str| match unit {
        "deg-per-s" => 1_f64.to_radians() / fit.factor,
        _ => 1.0 / fit.factor,
    };
    let mut rates = match unit {
        Some(unit) => vec![of_unit(unit)],
        None => vec![of_unit("rad-per-s"), of_unit("deg-per-s")],
    }
    .into_iter();
    let rate_hz = rates.find(|rate| RATES_HZ.contains(rate))?;
    // Three digits are more than it is good for.
    let digits = 10_f64.powi(2 - rate_hz.log10().floor() as i32);
    let rate_hz = (rate_hz * digits).round() / digits;
    let why = format!(
        "{without}; at this rate of the rows gravity turns as the gyroscope says, which is good to some per \
         cent ({:.1} % by noise alone): put in the true rate, or say it with --rate",
        300.0 * fit.std / fit.factor
    );
    Some((rate_hz, Found::new(why, Confidence::Assumed)))
}
