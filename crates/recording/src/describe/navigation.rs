//! Columns of satellite receivers and of a barometer.

use super::names::{Single, single, unit};
use super::position::{degrees, position, position_unit};
use super::table::Table;
use super::turns::median;
use super::{Confidence, Found, Section};
use crate::manifest::{CoordinateUnit, SpeedUnit};
use crate::tracking::LocalPlane;

/// The columns that stand for themselves.
pub(super) struct Columns<'a> {
    pub(super) table: &'a Table,
    pub(super) used: Vec<usize>,
    pub(super) lines: Vec<String>,
}

impl Columns<'_> {
    pub(super) fn find(&self, wanted: Single) -> Option<usize> {
        let mut columns = self.table.columns.iter();
        columns.position(|column| {
            single(&column.name) == Some(wanted) && column.numbers.iter().any(|x| x.is_finite())
        })
    }

    /// Writes `key = column` where there is one.
    pub(super) fn put(&mut self, key: &str, wanted: Single) -> Option<usize> {
        let place = self.find(wanted)?;
        self.lines
            .push(format!("{key} = {}", self.table.called(place)));
        self.used.push(place);
        Some(place)
    }

    /// Writes `key = [columns]` where all three are there.
    pub(super) fn put_three(&mut self, key: &str, wanted: [Single; 3]) -> bool {
        let [Some(a), Some(b), Some(c)] = wanted.map(|wanted| self.find(wanted)) else {
            return false;
        };
        let names = [a, b, c].map(|place| self.table.called(place)).join(", ");
        self.lines.push(format!("{key} = [{names}]"));
        self.used.extend([a, b, c]);
        true
    }

    pub(super) fn largest(&self, place: usize) -> f64 {
        let numbers = self.table.columns[place].numbers.iter();
        numbers
            .filter(|x| x.is_finite())
            .fold(0.0, |most, x| most.max(x.abs()))
    }

    /// Whether every number is a whole one.
    pub(super) fn is_whole(&self, place: usize) -> bool {
        let numbers = self.table.columns[place].numbers.iter();
        numbers
            .filter(|x| x.is_finite())
            .all(|x| x.fract().abs() <= 0.0)
    }

    pub(super) fn told(&self, place: usize) -> Option<&'static str> {
        unit(&self.table.columns[place].name).1
    }

    pub(super) fn section(self, key: &'static str, found: Found) -> Section {
        Section {
            key,
            lines: self.lines,
            columns: self.used,
            found,
        }
    }
}

/// Every section of navigation that a table has, and why columns that are named as a position are not taken.
pub(super) fn sections(table: &Table, seconds: &[f64]) -> (Vec<Section>, Option<String>) {
    let columns = || Columns {
        table,
        used: Vec::new(),
        lines: Vec::new(),
    };
    let mut sections = Vec::new();
    let position = position(columns());
    let problem = position.as_ref().err().cloned();
    sections.extend(position.ok().flatten());
    sections.extend(velocity(columns(), seconds));
    sections.extend(pressure(columns()));
    (sections, problem)
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
            let (unit, found) = unit_of_components(&columns, order, seconds);
            if unit != SpeedUnit::MPerS.name() {
                columns.lines.push(format!("speed_unit = \"{unit}\""));
            }
            columns.put_three("std", std);
            return Some(columns.section("gnss_velocity", found));
        }
    }
    let speed = columns.find(Single::Speed)?;
    columns.find(Single::Course)?;
    let told = columns
        .told(speed)
        .filter(|told| SpeedUnit::ALL.into_iter().any(|unit| unit.name() == *told));
    let speeds = &columns.table.columns[speed].numbers;
    let moved = speed_of_positions(&columns, &|row| speeds[row], seconds);
    let (unit, mut found) = match (told, moved) {
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

/// The unit of three components of a velocity: the header's, that in which the positions move as fast, or mm/s beside whole
/// ten-millionths of a degree, as u-blox receivers write them.
fn unit_of_components(
    columns: &Columns<'_>,
    order: [Single; 3],
    seconds: &[f64],
) -> (&'static str, Found) {
    let places = order.map(|wanted| columns.find(wanted));
    let [Some(first), Some(second), Some(third)] = places else {
        return ("m-per-s", Found::new("named so", Confidence::Assumed));
    };
    let told = columns.told(first);
    if let Some(unit) = SpeedUnit::ALL
        .into_iter()
        .find(|unit| Some(unit.name()) == told)
    {
        let why = "named so, and the header names the unit";
        return (unit.name(), Found::new(why, Confidence::Certain));
    }
    let [a, b] = [first, second].map(|place| &columns.table.columns[place].numbers);
    let speed = |row: usize| a[row].hypot(b[row]);
    if let Some((unit, ratio)) = speed_of_positions(columns, &speed, seconds) {
        let why = format!(
            "named so; the positions move {ratio:.2} times as fast as these numbers say in {unit}"
        );
        return (unit, Found::new(why, Confidence::Likely));
    }
    let is_whole = [first, second, third]
        .iter()
        .all(|place| columns.is_whole(*place));
    let unit = position_unit(columns).map(|(_, _, unit)| unit);
    if is_whole && unit == Some(CoordinateUnit::TenMillionths) {
        let why = "named so; whole numbers beside ten-millionths of a degree, taken in mm/s as u-blox receivers write them";
        return ("mm-per-s", Found::new(why, Confidence::Likely));
    }
    (
        "m-per-s",
        Found::new("named so; taken in m/s", Confidence::Likely),
    )
}

/// The unit in which a speed is that of the positions, and how well: over moving rows the median of the quotients.
fn speed_of_positions(
    columns: &Columns<'_>,
    speed: &dyn Fn(usize) -> f64,
    seconds: &[f64],
) -> Option<(&'static str, f64)> {
    let (latitude, longitude, unit) = position_unit(columns)?;
    let at = |place: usize, row: usize| degrees(unit, columns.table.columns[place].numbers[row]);
    // Rows in which the position is new.
    let mut rows: Vec<usize> = Vec::new();
    for row in (0..columns.table.rows).filter(|row| columns.has_position(*row, latitude, longitude))
    {
        let is_new = rows
            .last()
            .is_none_or(|last| (at(latitude, *last) - at(latitude, row)).abs() > 0.0);
        if is_new {
            rows.push(row);
        }
    }
    let mut quotients: Vec<f64> = Vec::new();
    for pair in rows.windows(2) {
        let (from, to) = (pair[0], pair[1]);
        let origin = LocalPlane {
            latitude_deg: at(latitude, from),
            longitude_deg: at(longitude, from),
        };
        let (north, east) = origin.place(at(latitude, to), at(longitude, to));
        let moved = north.hypot(east) / (seconds[to] - seconds[from]);
        let said = speed(to);
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
