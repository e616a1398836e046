//! The columns of a position: the unit of latitude and longitude, of the height and of the accuracies.

use super::names::Single;
use super::navigation::Columns;
use super::turns::median;
use super::{Confidence, Found, Section};
use crate::delimited::of_degrees_minutes;
use crate::error::shown;
use crate::manifest::CoordinateUnit;

impl Columns<'_> {
    /// Whether a row has a position: numbers that are not both 0, which stand for none.
    pub(super) fn has_position(&self, row: usize, latitude: usize, longitude: usize) -> bool {
        let [north, east] =
            [latitude, longitude].map(|place| self.table.columns[place].numbers[row]);
        (north + east).is_finite() && (north.abs() > 0.0 || east.abs() > 0.0)
    }

    /// Says in how many rows latitude and longitude are 0.
    fn at_zero(&self, latitude: usize, longitude: usize) -> Option<String> {
        let number = |place: usize, row: usize| self.table.columns[place].numbers[row];
        let rows = (0..self.table.rows)
            .filter(|row| (number(latitude, *row) + number(longitude, *row)).is_finite());
        let (zeros, rows) = rows.fold((0, 0), |(zeros, rows), row| {
            let is_zero = !self.has_position(row, latitude, longitude);
            (zeros + usize::from(is_zero), rows + 1)
        });
        (zeros > 0).then(|| {
            format!("both are exactly 0 in {zeros} of {rows} rows, which is taken as no fix")
        })
    }
}

/// The unit of latitude and longitude, and why; why none.
fn coordinates(
    columns: &Columns<'_>,
    latitude: usize,
    longitude: usize,
) -> Result<(CoordinateUnit, String, Confidence), String> {
    use CoordinateUnit as Unit;
    let (north, east) = (columns.largest(latitude), columns.largest(longitude));
    let told = columns.told(latitude);
    let told = Unit::ALL.into_iter().find(|unit| Some(unit.name()) == told);
    if let Some(unit) = told {
        let why = format!("named so, in {} by the header", unit.name());
        return Ok((unit, why, Confidence::Certain));
    }
    let likely = |unit, why: String| Ok((unit, why, Confidence::Likely));
    if north <= 0.0 && east <= 0.0 {
        return Err("they are 0 in every row".to_owned());
    }
    if north > 180.0 * 1e4 {
        let why = "named so; integers as large as ten-millionths of a degree";
        return likely(Unit::TenMillionths, why.to_owned());
    }
    // Near the equator and the prime meridian degrees are as small.
    if north <= 1.6 && east <= 3.2 {
        let why = format!(
            "named so; not beyond {north:.3} and {east:.3}, so radians; degrees only near 0, 0"
        );
        return likely(Unit::Radians, why);
    }
    if north <= 90.0 && east <= 360.0 {
        let why = "named so, and within the degrees of the Earth".to_owned();
        return Ok((Unit::Degrees, why, Confidence::Certain));
    }
    let minutes = |place: usize| {
        let numbers = columns.table.columns[place].numbers.iter();
        numbers
            .filter(|x| x.is_finite())
            .fold(0.0, |most: f64, x| most.max((x % 100.0).abs()))
    };
    if north <= 9000.0 && east <= 18_000.0 && minutes(latitude) < 60.0 && minutes(longitude) < 60.0
    {
        let why = "named so; beyond degrees, and as large as a hundred times the degrees plus minutes, as NMEA writes them";
        return likely(Unit::DegreesMinutes, why.to_owned());
    }
    Err(format!(
        "they go up to {north:.4} and {east:.4}, which are no degrees, radians, ten-millionths of a degree or degrees with minutes \
         (4841.9998) of any place"
    ))
}

/// The column beside one that says south or west: a manifest has no sign for it.
fn hemisphere(columns: &Columns<'_>, place: usize) -> Option<String> {
    let beside = columns.table.columns.get(place + 1)?;
    let has_sign = columns.table.columns[place]
        .numbers
        .iter()
        .any(|x| *x < 0.0);
    let is_other = !has_sign && matches!(beside.first.to_uppercase().as_str(), "S" | "W");
    is_other.then(|| {
        format!(
            "`{}` beside it says {}, which a manifest cannot take: write numbers of south and west below zero",
            columns.table.shown(place + 1),
            shown(&beside.first)
        )
    })
}

pub(super) fn position(mut columns: Columns<'_>) -> Result<Option<Section>, String> {
    let (Some(latitude), Some(longitude)) = (
        columns.put("latitude", Single::Latitude),
        columns.put("longitude", Single::Longitude),
    ) else {
        return Ok(None);
    };
    let [north, east] = [latitude, longitude].map(|place| columns.table.shown(place));
    let unused =
        |why: String| format!("{north}, {east} are called a position, but are not used: {why}");
    for place in [latitude, longitude] {
        if let Some(why) = hemisphere(&columns, place) {
            return Err(unused(why));
        }
    }
    let (unit, mut why, mut confidence) =
        coordinates(&columns, latitude, longitude).map_err(unused)?;
    columns.lines.push(format!("unit = \"{}\"", unit.name()));
    let (mut remarks, is_mm) = height(&mut columns, unit);
    let std = [Single::StdNorth, Single::StdEast, Single::StdVertical];
    if !columns.put_three("std", std) {
        remarks.extend(accuracy(&mut columns, unit, is_mm));
    }
    if !remarks.is_empty() {
        confidence = Confidence::Likely;
    }
    remarks.extend(columns.at_zero(latitude, longitude));
    remarks.iter().for_each(|remark| {
        why.push_str("; ");
        why.push_str(remark);
    });
    columns.put("hdop", Single::Hdop);
    columns.put("satellites", Single::Satellites);
    Ok(Some(
        columns.section("gnss_position", Found::new(why, confidence)),
    ))
}

/// Writes the height; what its size tells of its unit, and whether that is millimetres.
fn height(columns: &mut Columns<'_>, coordinates: CoordinateUnit) -> (Vec<String>, bool) {
    /// Higher than any balloon, m; and than any ground, where a receiver tells integers.
    const HIGHEST_M: f64 = 60_000.0;
    const HIGHEST_GROUND_M: f64 = 9_000.0;
    let Some(height) = columns.put("height", Single::Height) else {
        return (Vec::new(), false);
    };
    let told = columns
        .told(height)
        .filter(|told| matches!(*told, "mm" | "ft"));
    let most = match coordinates {
        CoordinateUnit::TenMillionths => HIGHEST_GROUND_M,
        _ => HIGHEST_M,
    };
    let unit = told.or_else(|| (columns.largest(height) > most).then_some("mm"));
    columns
        .lines
        .extend(unit.map(|unit| format!("height_unit = \"{unit}\"")));
    let is_guessed = told.is_none() && unit.is_some();
    let remark = is_guessed.then(|| "heights as large as millimetres".to_owned());
    (remark.into_iter().collect(), unit == Some("mm"))
}

/// Writes the accuracies; what was taken for granted, and what tells their unit beside the header. Receivers of u-blox write whole
/// millimetres with ten-millionths of a degree.
fn accuracy(
    columns: &mut Columns<'_>,
    coordinates: CoordinateUnit,
    height_in_mm: bool,
) -> Vec<String> {
    /// Less accurate than any fix that is of use, m.
    const WORST_M: f64 = 100.0;
    let Some(horizontal) = columns.find(Single::HorizontalAccuracy) else {
        return Vec::new();
    };
    let vertical = columns.find(Single::VerticalAccuracy);
    let places: Vec<_> = [horizontal].into_iter().chain(vertical).collect();
    let names: Vec<_> = (places.iter().map(|place| columns.table.called(*place))).collect();
    columns
        .lines
        .push(format!("accuracy = [{}]", names.join(", ")));
    columns.used.extend(&places);
    let mut remarks = Vec::new();
    if vertical.is_none() {
        let name = &names[0];
        remarks.push(format!(
            "{name} is taken as the radius that 68 % are within"
        ));
    }
    let told = columns.told(horizontal);
    if let Some(told) = told.filter(|told| matches!(*told, "mm" | "ft")) {
        columns.lines.push(format!("accuracy_unit = \"{told}\""));
        return remarks;
    }
    let is_whole = coordinates == CoordinateUnit::TenMillionths
        && places.iter().all(|place| columns.is_whole(*place));
    let mut numbers = columns.table.columns[horizontal].numbers.clone();
    if told.is_none() && is_whole && (height_in_mm || median(&mut numbers) > WORST_M) {
        columns.lines.push("accuracy_unit = \"mm\"".to_owned());
        let mm = "accuracies are whole numbers, taken in mm as u-blox receivers write them";
        remarks.push(mm.to_owned());
    }
    remarks
}

/// A latitude or longitude in degrees.
pub(super) fn degrees(unit: CoordinateUnit, number: f64) -> f64 {
    match unit {
        CoordinateUnit::DegreesMinutes => of_degrees_minutes(number),
        unit => (number * unit.to_rad()).to_degrees(),
    }
}

/// The columns of latitude and longitude, and their unit.
pub(super) fn position_unit(columns: &Columns<'_>) -> Option<(usize, usize, CoordinateUnit)> {
    let latitude = columns.find(Single::Latitude)?;
    let longitude = columns.find(Single::Longitude)?;
    let (unit, ..) = coordinates(columns, latitude, longitude).ok()?;
    Some((latitude, longitude, unit))
}
