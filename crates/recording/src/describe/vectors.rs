//! Which three columns are the accelerometer, the magnetometer and the gyroscope, and their units by their lengths.

use nalgebra::Vector3;

use super::names::{Group, Quantity};
use super::table::Table;
use super::turns::{Fit, Series, Turns, median};
use super::{Confidence, Found};
use crate::options::RateUnit;
use crate::signed_axes::SignedAxes;

/// A vector sensor that was found.
#[derive(Debug, Clone)]
pub(super) struct Vector {
    pub(super) columns: Vec<usize>,
    pub(super) unit: &'static str,
    pub(super) scale: Option<f64>,
    pub(super) axes: SignedAxes,
    /// How badly the numbers fit: of sensors without names the best one is taken.
    pub(super) misfit: f64,
    pub(super) found: Found,
}

/// The numbers of three columns over the time of their rows.
pub(super) fn series(table: &Table, columns: &[usize], seconds: &[f64]) -> Series {
    let number = |column: usize, row: usize| table.columns[columns[column]].numbers[row];
    let rows = (0..table.rows).map(|row| {
        let value = Vector3::from_fn(|axis, _| number(axis, row));
        (seconds[row], value)
    });
    rows.filter(|(t, value)| t.is_finite() && value.iter().all(|x| x.is_finite()))
        .collect()
}

/// The median length, and how much lengths differ from it by the median.
fn length(series: &Series) -> (f64, f64) {
    let mut norms: Vec<f64> = series.iter().map(|(_, value)| value.norm()).collect();
    let middle = median(&mut norms);
    let mut apart: Vec<f64> = norms.iter().map(|norm| (norm - middle).abs()).collect();
    (middle, median(&mut apart) / middle)
}

/// Whether vectors turn, and more than their length changes: a field in the axes of a device does, whatever else has three numbers
/// of some length (a latitude, a longitude and a height) does not.
fn turns_at_one_length(series: &Series) -> bool {
    /// Less is noise, rad.
    const LEAST_TURN: f64 = 0.1;
    const TURN_BY_CHANGE: f64 = 2.0;
    let directions = series
        .iter()
        .filter_map(|(_, value)| value.try_normalize(0.0));
    let (sum, count) = directions.fold((Vector3::zeros(), 0_usize), |(sum, n), v: Vector3<f64>| {
        (sum + v, n + 1)
    });
    // Of directions that scatter by an angle the mean is shorter than 1 by half its square.
    let angle = (2.0 * (1.0 - sum.norm() / count.max(1) as f64))
        .max(0.0)
        .sqrt();
    let (_, spread) = length(series);
    angle > LEAST_TURN && angle > TURN_BY_CHANGE * spread
}

/// Units by lengths: name, scale, from, to.
type Lengths = [(&'static str, Option<f64>, f64, f64)];

const GRAVITY: [(&str, Option<f64>, f64, f64); 3] = [
    ("m-per-s2", None, 8.0, 12.0),
    ("g", None, 0.8, 1.25),
    ("g", Some(1e-3), 850.0, 1200.0),
];
const FIELD: [(&str, Option<f64>, f64, f64); 6] = [
    ("microtesla", None, 15.0, 100.0),
    ("milligauss", None, 150.0, 1000.0),
    ("nanotesla", None, 1.5e4, 1e5),
    ("gauss", None, 0.15, 0.9),
    ("millitesla", None, 0.015, 0.1),
    ("tesla", None, 1.5e-5, 1e-4),
];

/// The unit in which a length is plausible.
fn by_length(lengths: &Lengths, length: f64) -> Option<(&'static str, Option<f64>)> {
    let mut lengths = lengths.iter();
    lengths.find_map(|(unit, scale, from, to)| {
        (*from..*to).contains(&length).then_some((*unit, *scale))
    })
}

/// The unit as a manifest and as people write it.
fn spelled(unit: &str, scale: Option<f64>) -> String {
    match scale {
        Some(scale) if (scale - 1e-3).abs() < 1e-12 => format!("m{unit}"),
        Some(scale) => format!("{scale:.4e} {unit}"),
        None => unit.to_owned(),
    }
}

/// A sensor whose unit is told by the lengths of its numbers, beside what the header says.
fn of_length(group: &Group, lengths: &Lengths, series: &Series, what: &str) -> Option<Vector> {
    let (middle, spread) = length(series);
    let found = by_length(lengths, middle).filter(|_| spread < 0.3);
    let (unit, scale) = found?;
    let told = group.unit.map(|unit| match unit.trim_start_matches('!') {
        // The unit is read without regard to case, and nobody measures fields in g.
        "g" if group.quantity.is_field() => "gauss",
        "mg" if group.quantity.is_field() => "milligauss",
        unit => unit,
    });
    let agrees = told == Some(spelled(unit, scale).as_str());
    let name = spelled(unit, scale);
    let (why, confidence) = match told {
        _ if agrees => (
            format!("the header names the unit, and the median length of {middle:.4} is {what}'s"),
            Confidence::Certain,
        ),
        Some(told) => (
            format!(
                "the median length of {middle:.4} is {what}'s in {name}, not in {told} as the header says"
            ),
            Confidence::Likely,
        ),
        None => (
            format!("the median length of {middle:.4} is {what}'s in {name}"),
            if group.quantity == Quantity::Other {
                Confidence::Assumed
            } else {
                Confidence::Likely
            },
        ),
    };
    Some(Vector {
        columns: group.columns.clone(),
        unit,
        scale,
        axes: SignedAxes::AS_THEY_ARE,
        misfit: spread,
        found: Found::new(why, confidence),
    })
}

/// Counts of converters for 1 g, of ranges of 2, 4, 8 and 16 g at 16 bits and of 10 bits, and for a degree a second, of
/// ranges of 250 to 2000 at 16 bits by makers that divide the range, and of those that give 8.75, 17.5 and 70 mdeg/s.
const COUNTS_OF_G: [f64; 5] = [16384.0, 8192.0, 4096.0, 2048.0, 256.0];
const COUNTS_OF_DEG_PER_S: [f64; 7] = [131.0, 65.5, 32.8, 16.4, 114.29, 57.14, 14.286];

/// Those that differ from what was measured by less than a sensor's scale does.
fn usual_counts(usual: &[f64], measured: f64) -> Option<f64> {
    let mut usual = usual.iter().copied();
    usual.find(|counts| (counts / measured - 1.0).abs() < 0.04)
}

/// The accelerometer: numbers with the length of gravity.
pub(super) fn accelerometer(group: &Group, series: &Series) -> Option<Vector> {
    let fits = of_length(group, &GRAVITY, series, "gravity");
    if fits.is_some() || group.quantity != Quantity::Accelerometer {
        return fits;
    }
    // Counts of a converter: gravity is what they have in common.
    let (middle, spread) = length(series);
    let is_counts = spread < 0.1 && middle > 200.0;
    let usual = usual_counts(&COUNTS_OF_G, middle);
    let why = match usual {
        Some(counts) => format!(
            "a median length of {middle:.0} fits no unit, but gravity in counts of a converter with {counts} for 1 g"
        ),
        None => format!(
            "a median length of {middle:.1} fits no unit and is taken as 1 g, so a scale error remains; better divide \
             by what the data sheet says"
        ),
    };
    is_counts.then(|| Vector {
        columns: group.columns.clone(),
        unit: "g",
        scale: Some(1.0 / usual.unwrap_or(middle)),
        axes: SignedAxes::AS_THEY_ARE,
        misfit: spread,
        found: Found::new(why, Confidence::Assumed),
    })
}

/// The magnetometer: numbers with the length of the Earth's field.
pub(super) fn magnetometer(group: &Group, series: &Series) -> Option<Vector> {
    if group.quantity == Quantity::Other && !turns_at_one_length(series) {
        return None;
    }
    of_length(group, &FIELD, series, "the Earth's field")
}

/// The gyroscope: what the header says, and how it fits the turns of gravity.
pub(super) fn gyroscope(group: &Group, rates: &Series, forces: Option<&Series>) -> Vector {
    let turns = forces.map(|forces| Turns::of(rates, forces));
    let plain = turns
        .as_ref()
        .and_then(|turns| turns.fit(SignedAxes::AS_THEY_ARE));
    let best = turns.as_ref().and_then(Turns::best_axes);
    // Axes are doubted only where others fit far better.
    let (axes, fit) = match (plain, best) {
        (Some(plain), Some((axes, fit)))
            if axes != SignedAxes::AS_THEY_ARE
                && fit.correlation > 0.5
                && plain.correlation < 0.5 * fit.correlation =>
        {
            (axes, Some(fit))
        }
        (plain, _) => (SignedAxes::AS_THEY_ARE, plain),
    };
    let fit = fit.filter(Fit::tells);
    let (unit, scale, mut found) = match fit.and_then(|fit| counts(group, rates, fit)) {
        Some((scale, found)) => ("deg-per-s", Some(scale), found),
        None => {
            let (unit, found) = rate_unit(group, rates, fit);
            (unit, None, found)
        }
    };
    if axes != SignedAxes::AS_THEY_ARE {
        found.confidence = Confidence::Likely;
        found.why = format!(
            "{}; as the axes stand they do not fit the accelerometer's",
            found.why
        );
    }
    Vector {
        columns: group.columns.clone(),
        unit,
        scale,
        axes,
        misfit: -fit.map_or(0.0, |fit| fit.correlation),
        found,
    }
}

/// Counts of a converter, which are too large for any unit: their scale by the turns of gravity.
fn counts(group: &Group, rates: &Series, fit: Fit) -> Option<(f64, Found)> {
    let measured = 1_f64.to_radians() / fit.factor;
    let is_counts = group.unit.is_none() && fit.correlation > 0.5 && fastest(rates) > 1000.0;
    if !is_counts || measured < 5.0 {
        return None;
    }
    let usual = usual_counts(&COUNTS_OF_DEG_PER_S, measured);
    let why = match usual {
        Some(counts) => format!(
            "too large for any unit; gravity turns as if {measured:.1} counts of a converter were 1 deg/s, and \
             {counts} are usual"
        ),
        None => format!(
            "too large for any unit; gravity turns as if {measured:.1} counts of a converter were 1 deg/s, good to some \
             per cent; better divide by what the data sheet says"
        ),
    };
    let scale = 1.0 / usual.unwrap_or(measured);
    Some((scale, Found::new(why, Confidence::Assumed)))
}

fn fastest(rates: &Series) -> f64 {
    rates
        .iter()
        .map(|(_, rate)| rate.norm())
        .fold(0.0, f64::max)
}

/// Faster than any gyroscope turns, rad/s.
const FASTEST: f64 = 70.0;

fn rate_unit(group: &Group, rates: &Series, fit: Option<Fit>) -> (&'static str, Found) {
    let units = RateUnit::ALL.map(|unit| (unit.name(), unit.to_rad_per_s()));
    let is_near = |factor: f64, expected: f64| (factor / expected).ln().abs() < 1.5_f64.ln();
    let told = units.iter().find(|(name, _)| Some(*name) == group.unit);
    if let Some(fit) = fit {
        let seen = units
            .iter()
            .find(|(_, factor)| is_near(fit.factor, *factor));
        if let Some((unit, factor)) = seen {
            let ratio = fit.factor / factor;
            let why = format!("gravity turns {ratio:.2} times as these numbers say in {unit}");
            let (why, confidence) = match told {
                Some((name, _)) if name == unit => (
                    format!("the header names the unit, and {why}"),
                    Confidence::Certain,
                ),
                Some((name, _)) => (
                    format!("{why}, not in {name} as the header says"),
                    Confidence::Likely,
                ),
                None => (why, Confidence::Likely),
            };
            return (unit, Found::new(why, confidence));
        }
    }
    // Vehicles accelerate as they turn, which is some part of what is seen.
    let odd = fit.filter(|fit| fit.correlation > 0.7);
    let odd = odd.map_or(String::new(), |fit| {
        let ratio = fit.factor;
        format!(" (gravity turns {ratio:.3} times as the numbers say in rad-per-s, which fits no unit: check the time)")
    });
    if let Some((unit, _)) = told {
        let why = format!("the header names the unit; no turns of gravity confirm it{odd}");
        return (unit, Found::new(why, Confidence::Likely));
    }
    let most = fastest(rates);
    if most > FASTEST.to_degrees() {
        let why = format!(
            "the fastest is {most:.0}, more than any gyroscope measures in deg-per-s too: perhaps counts of a converter, \
             whose scale no turn of gravity tells; put it in as `scale`{odd}"
        );
        return ("deg-per-s", Found::new(why, Confidence::Assumed));
    }
    if most > FASTEST {
        let why =
            format!("the fastest is {most:.0}, more than any gyroscope measures in rad-per-s{odd}");
        return ("deg-per-s", Found::new(why, Confidence::Likely));
    }
    let why =
        format!("neither a header nor a turn of gravity tells the unit; rad-per-s is taken{odd}");
    ("rad-per-s", Found::new(why, Confidence::Assumed))
}
