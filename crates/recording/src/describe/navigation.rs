//! Columns of satellite receivers and of a barometer.

use super::names::{Single, single, unit};
use super::table::Table;
use super::turns::median;
use super::{Confidence, Found, Section};
use crate::manifest::SpeedUnit;
use crate::tracking::LocalPlane;

/// The columns that stand for themselves.
struct Columns<'a> {
    table: &'a Table,
    used: Vec<usize>,
    lines: Vec<String>,
}

impl Columns<'_> {
    fn find(&self, wanted: Single) -> Option<usize> {
        let mut columns = self.table.columns.iter();
        columns.position(|column| {
            single(&column.name) == Some(wanted) && column.numbers.iter().any(|x| x.is_finite())
        })
    }

    /// Writes `key = column` where there is one.
    fn put(&mut self, key: &str, wanted: Single) -> Option<usize> {
        let place = self.find(wanted)?;
        self.lines
            .push(format!("{key} = {}", self.table.called(place)));
        self.used.push(place);
        Some(place)
    }

    /// Writes `key = [columns]` where all three are there.
    fn put_three(&mut self, key: &str, wanted: [Single; 3]) -> bool {
        let [Some(a), Some(b), Some(c)] = wanted.map(|wanted| self.find(wanted)) else {
            return false;
        };
        let names = [a, b, c].map(|place| self.table.called(place)).join(", ");
        self.lines.push(format!("{key} = [{names}]"));
        self.used.extend([a, b, c]);
        true
    }

    fn largest(&self, place: usize) -> f64 {
        let numbers = self.table.columns[place].numbers.iter();
        numbers
            .filter(|x| x.is_finite())
            .fold(0.0, |most, x| most.max(x.abs()))
    }

    fn told(&self, place: usize) -> Option<&'static str> {
        unit(&self.table.columns[place].name).1
    }

    fn section(self, key: &'static str, found: Found) -> Section {
        Section {
            key,
            lines: self.lines,
            columns: self.used,
            found,
        }
    }
}

/// Every section of navigation that a table has.
pub(super) fn sections(table: &Table, seconds: &[f64]) -> Vec<Section> {
    let columns = || Columns {
        table,
        used: Vec::new(),
        lines: Vec::new(),
    };
    let mut sections = Vec::new();
    sections.extend(position(columns()));
    sections.extend(velocity(columns(), seconds));
    sections.extend(pressure(columns()));
    sections
}

fn position(mut columns: Columns<'_>) -> Option<Section> {
    let latitude = columns.put("latitude", Single::Latitude)?;
    let longitude = columns.put("longitude", Single::Longitude)?;
    let (north, east) = (columns.largest(latitude), columns.largest(longitude));
    let told = columns
        .told(latitude)
        .filter(|unit| matches!(*unit, "deg" | "rad" | "1e-7-deg"));
    let (unit, mut why, mut confidence) = match told {
        Some(unit) => (
            unit,
            format!("named so, in {unit} by the header"),
            Confidence::Certain,
        ),
        None if north > 180.0 * 1e4 => {
            let why = "named so; integers as large as ten-millionths of a degree";
            ("1e-7-deg", why.to_owned(), Confidence::Likely)
        }
        // Near the equator and the prime meridian degrees are as small.
        None if north <= 1.6 && east <= 3.2 => {
            let why = format!(
                "named so; not beyond {north:.3} and {east:.3}, so radians; degrees only near 0, 0"
            );
            ("rad", why, Confidence::Likely)
        }
        None if north <= 90.0 && east <= 360.0 => (
            "deg",
            "named so, and within the degrees of the Earth".to_owned(),
            Confidence::Certain,
        ),
        None => return None,
    };
    columns.lines.push(format!("unit = \"{unit}\""));
    if let Some(height) = columns.put("height", Single::Height) {
        /// Higher than any balloon, m; and than any ground, where a receiver tells integers.
        const HIGHEST_M: f64 = 60_000.0;
        const HIGHEST_GROUND_M: f64 = 9_000.0;
        let told = columns
            .told(height)
            .filter(|told| matches!(*told, "mm" | "ft"));
        let highest = columns.largest(height);
        let most = match unit {
            "1e-7-deg" => HIGHEST_GROUND_M,
            _ => HIGHEST_M,
        };
        let unit = told.or_else(|| (highest > most).then_some("mm"));
        if told.is_none() && unit.is_some() {
            why.push_str("; heights as large as millimetres");
            confidence = Confidence::Likely;
        }
        columns
            .lines
            .extend(unit.map(|unit| format!("height_unit = \"{unit}\"")));
    }
    let std = [Single::StdNorth, Single::StdEast, Single::StdVertical];
    let accuracy = [Single::HorizontalAccuracy, Single::VerticalAccuracy];
    if !columns.put_three("std", std)
        && let [Some(horizontal), Some(vertical)] = accuracy.map(|wanted| columns.find(wanted))
    {
        let [h, v] = [horizontal, vertical].map(|place| columns.table.called(place));
        columns.lines.push(format!("accuracy = [{h}, {v}]"));
        columns.used.extend([horizontal, vertical]);
    }
    columns.put("hdop", Single::Hdop);
    columns.put("satellites", Single::Satellites);
    Some(columns.section("gnss_position", Found::new(why, confidence)))
}

fn velocity(mut columns: Columns<'_>, seconds: &[f64]) -> Option<Section> {
    use Single as Is;
    let [north, east, up] = [Is::VelocityNorth, Is::VelocityEast, Is::VelocityUp];
    let std = [
        Is::StdVelocityNorth,
        Is::StdVelocityEast,
        Is::StdVelocityVertical,
    ];
    let (n, e, v) = (std[0], std[1], std[2]);
    for (order, std, axes) in [
        ([north, east, Is::VelocityDown], std, "ned"),
        ([east, north, up], [e, n, v], "enu"),
    ] {
        if columns.put_three("columns", order) {
            columns.lines.push(format!("axes = \"{axes}\""));
            columns.put_three("std", std);
            let found = Found::new("named so; taken in m/s", Confidence::Likely);
            return Some(columns.section("gnss_velocity", found));
        }
    }
    let speed = columns.find(Single::Speed)?;
    columns.find(Single::Course)?;
    let told = columns
        .told(speed)
        .filter(|unit| matches!(*unit, "m-per-s" | "km-per-h" | "knots"));
    let (unit, mut found) = match (told, speed_of_positions(&columns, speed, seconds)) {
        (Some(unit), _) => (
            unit,
            Found::new("the header names the unit", Confidence::Certain),
        ),
        (None, Some((unit, ratio))) => {
            let why = format!(
                "the positions move {ratio:.2} times as fast as these numbers say in {unit}"
            );
            (unit, Found::new(why, Confidence::Likely))
        }
        (None, None) => {
            let why = "nothing tells the unit of the speed; m-per-s is taken";
            ("m-per-s", Found::new(why, Confidence::Assumed))
        }
    };
    columns.put("speed", Single::Speed);
    columns.lines.push(format!("speed_unit = \"{unit}\""));
    let course = columns.put("course", Single::Course)?;
    match columns.told(course) {
        Some("rad") => columns.lines.push("course_unit = \"rad\"".to_owned()),
        Some("deg") => {}
        _ => found.why = format!("{}; the course is taken in deg", found.why),
    }
    Some(columns.section("gnss_velocity", found))
}

/// The unit in which a speed is that of the positions, and how well: over moving rows the median of the quotients.
fn speed_of_positions(
    columns: &Columns<'_>,
    speed: usize,
    seconds: &[f64],
) -> Option<(&'static str, f64)> {
    let numbers = |place: usize| &columns.table.columns[place].numbers;
    let latitude = numbers(columns.find(Single::Latitude)?);
    let longitude = numbers(columns.find(Single::Longitude)?);
    if latitude.iter().any(|x| x.abs() > 90.0) {
        return None;
    }
    // Rows in which the position is new.
    let mut rows: Vec<usize> = Vec::new();
    for row in 0..columns.table.rows {
        let is_new = rows
            .last()
            .is_none_or(|last| (latitude[*last] - latitude[row]).abs() > 0.0);
        if is_new && latitude[row].is_finite() && longitude[row].is_finite() {
            rows.push(row);
        }
    }
    let mut quotients: Vec<f64> = Vec::new();
    for pair in rows.windows(2) {
        let (from, to) = (pair[0], pair[1]);
        let origin = LocalPlane {
            latitude_deg: latitude[from],
            longitude_deg: longitude[from],
        };
        let (north, east) = origin.place(latitude[to], longitude[to]);
        let moved = north.hypot(east) / (seconds[to] - seconds[from]);
        let said = numbers(speed)[to];
        if moved > 2.0 && said > 1.0 && moved.is_finite() {
            quotients.push(moved / said);
        }
    }
    if quotients.len() < 20 {
        return None;
    }
    let quotient = median(&mut quotients);
    SpeedUnit::ALL.into_iter().find_map(|unit| {
        let ratio = quotient / unit.to_m_per_s();
        (0.85..1.18)
            .contains(&ratio)
            .then_some((unit.name(), ratio))
    })
}

fn pressure(mut columns: Columns<'_>) -> Option<Section> {
    let place = columns.put("column", Single::Pressure)?;
    let mut numbers = columns.table.columns[place].numbers.clone();
    let middle = median(&mut numbers);
    // The atmosphere up to 9 km and down to the Dead Sea.
    let unit = match middle {
        3e4..1.1e5 => "pa",
        300.0..1100.0 => "hpa",
        30.0..110.0 => "kpa",
        _ => return None,
    };
    columns.lines.push(format!("unit = \"{unit}\""));
    let why = format!("named so; {middle:.1} is the atmosphere's in {unit}");
    Some(columns.section("pressure", Found::new(why, Confidence::Likely)))
}
