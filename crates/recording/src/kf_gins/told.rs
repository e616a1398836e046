//! Which of KF-GINS's tables a text is, told by its first numbers.

/// Columns of either table.
const COLUMNS: usize = 7;
/// Fewer rows tell nothing.
const FEWEST_ROWS: usize = 3;
/// Seconds of a week, and a day more for files that went on.
const LATEST_S: f64 = 691_200.0;
/// Intervals between inertial samples, s.
const INTERVALS_S: [f64; 2] = [2e-4, 0.2];
/// An interval may differ by this factor from the middle one: a millisecond clock, a sample that was lost.
const UNEVEN: f64 = 3.0;
/// What a body on the Earth feels, m/s^2, its mean over the rows.
const FORCES: [f64; 2] = [5.0, 20.0];
/// No body turns faster, rad/s.
const FASTEST_TURN: f64 = 40.0;
/// Heights, m.
const HEIGHTS: [f64; 2] = [-1000.0, 50_000.0];
/// The largest standard deviation of a position, m.
const LARGEST_STD: f64 = 1000.0;
/// Nothing changes its latitude and longitude faster, degrees a second: coordinates in metres do.
const FASTEST_DEG_S: f64 = 0.02;
/// Digits after the point that degrees need to tell places: 1 m.
const FEWEST_DIGITS: usize = 5;

/// A kind of table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Table {
    /// Seconds of the week, increments of angle (rad) and of velocity (m/s), x, y, z.
    Increments,
    /// Seconds of the week, latitude, longitude (deg), height (m), standard deviations north, east, down (m).
    Positions,
}

/// A row, and the digits after the point of its second and third number.
struct Row {
    values: [f64; COLUMNS],
    digits: [usize; 2],
}

impl Table {
    /// What it has in it, in words.
    pub(super) const fn what(self) -> &'static str {
        match self {
            Self::Increments => "inertial increments",
            Self::Positions => "positions",
        }
    }

    /// As [`Self::of`], of the first bytes of a file.
    pub(crate) fn of_bytes(head: &[u8]) -> Option<Self> {
        Self::of(std::str::from_utf8(head).ok()?)
    }

    /// Which table begins so; the last line counts only with its end. Three whole rows at least, seven numbers each, and
    /// seconds of the week that rise. Increments: even intervals, over which the velocity gains what gravity gives
    /// and no axis turns faster than anything does. Positions: degrees with digits behind the point that move no
    /// faster than anything does, and positive standard deviations.
    pub(crate) fn of(head: &str) -> Option<Self> {
        let rows = rows(head)?;
        let rises = |pair: &[Row]| pair[1].values[0] > pair[0].values[0];
        let in_week = |row: &Row| (0.0..=LATEST_S).contains(&row.values[0]);
        if !(rows.iter().all(in_week) && rows.windows(2).all(rises)) {
            return None;
        }
        if are_increments(&rows) {
            Some(Self::Increments)
        } else {
            are_positions(&rows).then_some(Self::Positions)
        }
    }
}

/// How many columns the first rows have, where they are numbers and nothing else.
pub(crate) fn columns_of_numbers(head: &str) -> Option<usize> {
    let mut lines = lines(head);
    let count = |line: &str| {
        let mut cells = cells(line);
        let all = cells.all(|cell| cell.parse::<f64>().is_ok());
        all.then(|| self::cells(line).count())
    };
    let columns = count(lines.next()?)?;
    lines
        .all(|line| count(line) == Some(columns))
        .then_some(columns)
}

/// The whole lines that say something.
fn lines(head: &str) -> impl Iterator<Item = &str> {
    let whole = head.rfind('\n').map_or("", |end| &head[..end]);
    let lines = whole.trim_start_matches('\u{feff}').lines();
    lines.filter(|line| !line.trim().is_empty() && !line.starts_with('#'))
}

fn cells(line: &str) -> impl Iterator<Item = &str> {
    let cells = line.split([',', ' ', '\t', '\r']);
    cells.filter(|cell| !cell.is_empty())
}

/// The rows; `None` where one is no row of either table, and of too few.
fn rows(head: &str) -> Option<Vec<Row>> {
    let rows: Option<Vec<Row>> = lines(head).map(row).collect();
    rows.filter(|rows| rows.len() >= FEWEST_ROWS)
}

fn row(line: &str) -> Option<Row> {
    let mut row = Row {
        values: [0.0; COLUMNS],
        digits: [0; 2],
    };
    let mut cells = cells(line);
    for column in 0..COLUMNS {
        let cell = cells.next()?;
        let value: f64 = cell.parse().ok()?;
        if !value.is_finite() {
            return None;
        }
        row.values[column] = value;
        if let Some(digits) = column.checked_sub(1).and_then(|i| row.digits.get_mut(i)) {
            *digits = cell.split_once('.').map_or(0, |(_, behind)| behind.len());
        }
    }
    cells.next().is_none().then_some(row)
}

fn are_increments(rows: &[Row]) -> bool {
    let intervals = rows
        .windows(2)
        .map(|pair| pair[1].values[0] - pair[0].values[0]);
    let intervals: Vec<f64> = intervals.collect();
    let mut sorted = intervals.clone();
    sorted.sort_unstable_by(f64::total_cmp);
    let middle = sorted[sorted.len() / 2];
    let [shortest, longest] = INTERVALS_S;
    let even = |interval: &f64| (middle / UNEVEN..=middle * UNEVEN).contains(interval);
    if !((shortest..=longest).contains(&middle) && intervals.iter().all(even)) {
        return false;
    }
    let length = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    let mut force = 0.0;
    for (row, interval) in rows[1..].iter().zip(&intervals) {
        if length(&row.values[1..4]) / interval > FASTEST_TURN {
            return false;
        }
        force += length(&row.values[4..7]) / interval / intervals.len() as f64;
    }
    let [least, most] = FORCES;
    (least..=most).contains(&force)
}

fn are_positions(rows: &[Row]) -> bool {
    let [lowest, highest] = HEIGHTS;
    let is_place = |row: &Row| {
        let [_, latitude, longitude, height, std @ ..] = row.values;
        latitude.abs() <= 90.0
            && longitude.abs() <= 360.0
            && (lowest..=highest).contains(&height)
            && std.iter().all(|std| *std > 0.0 && *std <= LARGEST_STD)
            && row.digits.iter().all(|digits| *digits >= FEWEST_DIGITS)
    };
    let goes_on = |pair: &[Row]| {
        let [from, to] = [&pair[0].values, &pair[1].values];
        let farthest = FASTEST_DEG_S * (to[0] - from[0]);
        (1..3).all(|i| (to[i] - from[i]).abs() <= farthest)
    };
    rows.iter().all(is_place) && rows.windows(2).all(goes_on)
}
