//! What the name of a column says: a quantity, which part of it, and a unit.

use std::collections::BTreeMap;

use super::table::Column;

/// What a column or three or four of them hold, by their name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Quantity {
    Gyroscope,
    Accelerometer,
    /// Without gravity, which no estimator can use.
    LinearAcceleration,
    Magnetometer,
    MagnetometerUncalibrated,
    Orientation,
    Reference,
    /// Nothing that is known.
    Other,
}

impl Quantity {
    /// Whether it is a magnetic field.
    pub(super) const fn is_field(self) -> bool {
        matches!(self, Self::Magnetometer | Self::MagnetometerUncalibrated)
    }
}

/// A column that stands for itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Single {
    Time,
    Latitude,
    Longitude,
    Height,
    HorizontalAccuracy,
    VerticalAccuracy,
    StdNorth,
    StdEast,
    StdVertical,
    StdVelocityNorth,
    StdVelocityEast,
    StdVelocityVertical,
    Hdop,
    Satellites,
    Speed,
    Course,
    VelocityNorth,
    VelocityEast,
    VelocityDown,
    VelocityUp,
    Pressure,
}

/// Columns that belong together.
#[derive(Debug, Clone)]
pub(super) struct Group {
    pub(super) quantity: Quantity,
    /// Three, or four of a quaternion in the order w, x, y, z, as far as the names tell it.
    pub(super) columns: Vec<usize>,
    /// Of a quaternion: whether the names say which number is w.
    pub(super) is_ordered: bool,
    pub(super) unit: Option<&'static str>,
}

/// Spellings of units, and the name that a manifest has for each; those that it has none for begin with `!`.
const UNITS: [(&str, &[&str]); 31] = [
    (
        "rad-per-s",
        &[
            "rad/s",
            "rad s-1",
            "rad s^-1",
            "rad_s",
            "rad_per_s",
            "rads",
            "radps",
            "rad/sec",
        ],
    ),
    (
        "deg-per-s",
        &[
            "deg/s",
            "°/s",
            "deg s-1",
            "deg s^-1",
            "deg_s",
            "deg_per_s",
            "dps",
            "degs",
            "degps",
            "deg/sec",
        ],
    ),
    (
        "m-per-s2",
        &[
            "m/s^2", "m/s²", "m/s2", "m s^-2", "m s-2", "m_s2", "m_s_2", "ms2", "ms-2", "mps2",
            "m_per_s2", "m/s/s", "m/ss",
        ],
    ),
    ("!mg", &["mg"]),
    ("g", &["g", "gs"]),
    ("microtesla", &["ut", "µt", "μt", "microtesla"]),
    ("nanotesla", &["nt", "nanotesla"]),
    ("milligauss", &["mgauss", "milligauss"]),
    ("millitesla", &["mt", "millitesla"]),
    ("gauss", &["gauss", "ga"]),
    ("tesla", &["t", "tesla"]),
    ("s", &["s", "sec", "secs", "second", "seconds"]),
    ("ms", &["ms", "msec", "millis", "milliseconds"]),
    ("us", &["us", "µs", "μs", "usec", "micros", "microseconds"]),
    ("ns", &["ns", "nsec", "nanos", "nanoseconds"]),
    ("pa", &["pa"]),
    ("hpa", &["hpa", "mbar", "mb"]),
    ("kpa", &["kpa"]),
    ("deg", &["deg", "°", "degrees", "degree"]),
    ("rad", &["rad", "radians"]),
    ("1e-7-deg", &["1e-7 deg", "1e7", "dege7", "1e-7deg"]),
    ("km-per-h", &["km/h", "kmh", "kph", "km_h", "kmph"]),
    ("knots", &["kn", "kt", "kts", "knots", "knot"]),
    (
        "m-per-s",
        &["m/s", "m_s", "mps", "m s^-1", "m s-1", "m_per_s"],
    ),
    ("cm-per-s", &["cm/s", "cm_s"]),
    ("mm-per-s", &["mm/s", "mm_s"]),
    ("mm", &["mm"]),
    ("ft", &["ft", "feet", "foot"]),
    ("m", &["m", "meters", "metres", "meter"]),
    ("!uncalibrated", &["a.u.", "au", "lsb", "counts", "raw"]),
    ("!other", &["°c", "degc", "c", "%", "v", "hz", "k"]),
];

/// The unit of a spelling in small letters.
fn known(text: &str) -> Option<&'static str> {
    let text = text.trim();
    let mut units = UNITS.iter();
    units.find_map(|(unit, spellings)| spellings.contains(&text).then_some(*unit))
}

/// Whether the cells of a line are units, as a line below the names has them: at least one, and else what stands for none.
pub(super) fn are_units(cells: &[String]) -> bool {
    const NONE: [&str; 9] = ["", "-", "--", "1", "none", "n/a", "na", "utc", "gps"];
    let bare = |cell: &String| {
        let inside = cell.trim_matches(|c| matches!(c, '[' | ']' | '(' | ')' | '#'));
        inside.trim().to_lowercase()
    };
    let cells: Vec<String> = cells.iter().map(bare).collect();
    let is_unit = |cell: &String| known(cell).is_some();
    cells.iter().any(is_unit)
        && cells
            .iter()
            .all(|cell| is_unit(cell) || NONE.contains(&cell.as_str()))
}

/// Divides a name into what is named and its unit.
pub(super) fn unit(name: &str) -> (String, Option<&'static str>) {
    let lower = name.to_lowercase();
    for (open, close) in [('(', ')'), ('[', ']')] {
        let Some((before, rest)) = lower.split_once(open) else {
            continue;
        };
        let inside = rest.split(close).next().unwrap_or_default();
        let length = before.len();
        let kept = name.get(..length).unwrap_or(before).trim().to_owned();
        return (kept, known(inside));
    }
    // Behind a blank or underscore the longest ending that is a unit.
    let places = lower
        .char_indices()
        .filter(|(_, c)| matches!(c, '_' | ' ' | '.'));
    for (place, _) in places {
        if place > 0
            && let Some(unit) = known(&lower[place + 1..])
        {
            return (
                name.get(..place).unwrap_or(&lower[..place]).to_owned(),
                Some(unit),
            );
        }
    }
    (
        name.to_owned(),
        known(&lower).filter(|unit| matches!(*unit, "s" | "ms" | "us" | "ns")),
    )
}

/// The words of a name, small: `userAccelerationX` is user, acceleration, x.
fn words(name: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut before = ' ';
    for c in name.chars() {
        let is_new = c.is_uppercase() && before.is_lowercase()
            || c.is_ascii_digit() != before.is_ascii_digit() && before.is_alphanumeric();
        if !c.is_alphanumeric() || is_new {
            words.push(String::new());
        }
        if c.is_alphanumeric() {
            let last = words.len() - 1;
            words[last].extend(c.to_lowercase());
        }
        before = c;
    }
    words.retain(|word| !word.is_empty());
    words
}

/// Beginnings to which x, y or z is written without a gap.
const SHORT: [&str; 23] = [
    "a", "acc", "accel", "b", "f", "g", "gf", "gyr", "gyro", "m", "mag", "magn", "omega", "q",
    "quat", "rot", "w", "lin", "linacc", "field", "rate", "angvel", "uacc",
];

/// Which part of a vector or quaternion a name tells, and the words without it.
fn part(name: &str) -> Option<(Vec<String>, char)> {
    let mut words = words(name);
    let one = |word: &str| match word.as_bytes() {
        [c @ (b'w' | b'x' | b'y' | b'z' | b'0'..=b'4')] => Some(char::from(*c)),
        _ => None,
    };
    // `w_x` is x of w: the last one counts.
    if let Some(place) = words.iter().rposition(|word| one(word).is_some()) {
        let found = one(&words[place])?;
        words.remove(place);
        return Some((words, found));
    }
    let last = words.last_mut()?;
    let end = last.chars().last()?;
    let begin = last.chars().next()?;
    let axis = |c| matches!(c, 'w' | 'x' | 'y' | 'z');
    if axis(end) && SHORT.contains(&&last[..last.len() - 1]) {
        last.pop();
        return Some((words, end));
    }
    if axis(begin) && SHORT.contains(&&last[1..]) {
        last.remove(0);
        return Some((words, begin));
    }
    None
}

/// The vectors and quaternions of a header. Columns that are called x, y, z alone are what the file is called.
pub(super) fn groups(columns: &[Column], file: &str) -> Vec<Group> {
    let mut found: BTreeMap<_, Vec<(char, usize)>> = BTreeMap::new();
    for (place, column) in columns.iter().enumerate() {
        let (name, unit) = unit(&column.name);
        if let Some((words, part)) = part(&name) {
            let words = if words.is_empty() {
                self::words(file)
            } else {
                words
            };
            found
                .entry((words.join(" "), unit))
                .or_default()
                .push((part, place));
        }
    }
    let mut groups: Vec<Group> = found
        .into_iter()
        .filter_map(|((name, unit), parts)| group(&name, unit, &parts))
        .collect();
    groups.sort_by_key(|group| group.columns[0]);
    groups
}

/// Three or four columns with the same name but for their part.
fn group(name: &str, unit: Option<&'static str>, parts: &[(char, usize)]) -> Option<Group> {
    let of = |wanted: &str| -> Option<Vec<usize>> {
        let column = |part| Some(parts.iter().find(|(p, _)| *p == part)?.1);
        wanted.chars().map(column).collect()
    };
    let is_four = parts.len() == 4;
    let (columns, is_ordered) = match of("wxyz").or_else(|| of("0123")) {
        Some(four) if is_four => (four, true),
        _ => match of("1234") {
            Some(four) if is_four => (four, false),
            _ => (of("xyz").or_else(|| of("012")).or_else(|| of("123"))?, true),
        },
    };
    let quantity = match columns.len() {
        4 if is_reference(name) => Quantity::Reference,
        4 => Quantity::Orientation,
        _ => vector(name, unit),
    };
    Some(Group {
        quantity,
        columns,
        is_ordered,
        unit,
    })
}

/// Whether a name is of something that estimates are compared with.
pub(super) fn is_reference(name: &str) -> bool {
    const WORDS: [&str; 9] = [
        "ref",
        "reference",
        "truth",
        "gt",
        "groundtruth",
        "opti",
        "optitrack",
        "mocap",
        "vicon",
    ];
    let name = name.to_lowercase();
    let mut words = name.split(|c: char| !c.is_alphanumeric());
    words.any(|word| WORDS.contains(&word))
}

/// Which vector a name or a unit tells.
fn vector(name: &str, unit: Option<&str>) -> Quantity {
    let has = |text: &str| name.contains(text);
    let is = |word: &str| name.split(' ').any(|w| w == word);
    // A phone's estimate of gravity is no measurement.
    if has("bias") || has("offset") || has("grav") || is_reference(name) {
        return Quantity::Other;
    }
    if has("gyr") || has("angular") || has("angvel") || has("omega") || is("w") || is("rate") {
        return Quantity::Gyroscope;
    }
    if has("lin") || has("user") {
        return Quantity::LinearAcceleration;
    }
    if has("mag") || has("field") || is("b") || is("m") {
        return match has("uncal") || has("raw") {
            true => Quantity::MagnetometerUncalibrated,
            false => Quantity::Magnetometer,
        };
    }
    if has("acc") || has("force") || is("a") || is("f") || is("gf") {
        return Quantity::Accelerometer;
    }
    match unit {
        Some("rad-per-s" | "deg-per-s") => Quantity::Gyroscope,
        Some("m-per-s2" | "g" | "!mg") => Quantity::Accelerometer,
        Some("microtesla" | "nanotesla" | "gauss" | "milligauss" | "millitesla" | "tesla") => {
            Quantity::Magnetometer
        }
        _ if is("g") || is("rot") => Quantity::Gyroscope,
        _ => Quantity::Other,
    }
}

/// Whether a name is that of a fix's accuracy and of nothing else: `gps_speed_accuracy` is none.
fn is_accuracy_of_fix(words: &[String]) -> bool {
    const FIX: [&str; 6] = ["gps", "gnss", "loc", "location", "pos", "position"];
    let is_accuracy = |word: &String| matches!(word.as_str(), "accuracy" | "acc");
    let is_of_fix = |word: &String| FIX.contains(&word.as_str());
    let is_told = words == ["accuracy"] || words.iter().any(is_of_fix);
    is_told && words.iter().any(is_accuracy) && words.iter().all(|w| is_accuracy(w) || is_of_fix(w))
}

/// What a column that stands for itself holds.
pub(super) fn single(name: &str) -> Option<Single> {
    let (kept, unit) = unit(name);
    let words = words(&kept);
    let is = |names: &[&str]| words.iter().any(|word| names.contains(&word.as_str()));
    let has = |text: &str| words.iter().any(|word| word.contains(text));
    let is_time_unit = matches!(unit, Some("s" | "ms" | "us" | "ns"));
    let accuracy = has("accuracy") || is(&["acc", "hacc", "vacc", "std", "sd", "sigma"]);
    let is_time = has("time") || has("stamp") || is_time_unit && words.len() == 1;
    let found = if is_time || is(&["t", "utc", "epoch", "date", "elapsed", "tow", "sow"]) {
        Single::Time
    } else if accuracy && (is(&["hacc", "h"]) || has("hor")) {
        Single::HorizontalAccuracy
    } else if accuracy && (is(&["vacc", "v"]) || has("ver") || has("alt")) {
        Single::VerticalAccuracy
    } else if is_accuracy_of_fix(&words) {
        Single::HorizontalAccuracy
    } else if accuracy || is(&["sdn", "sde", "sdu"]) {
        return deviation(&words);
    } else if is(&["lat", "latitude"]) {
        Single::Latitude
    } else if is(&["lon", "lng", "long", "longitude"]) {
        Single::Longitude
    } else if has("altitude") || is(&["alt", "height", "hgt", "ele", "elevation", "h"]) {
        Single::Height
    } else if is(&["hdop"]) {
        Single::Hdop
    } else if has("satellites") || is(&["sats", "nsat", "numsats", "numsv"]) {
        Single::Satellites
    } else if is(&["speed", "spd", "sog", "gspeed", "groundspeed"]) {
        Single::Speed
    } else if is(&["course", "cog", "bearing", "headmot"]) {
        Single::Course
    } else if has("press") || has("baro") || matches!(unit, Some("pa" | "hpa" | "kpa")) {
        Single::Pressure
    } else {
        return velocity(&words);
    };
    Some(found)
}

/// A standard deviation of a position or velocity.
fn deviation(words: &[String]) -> Option<Single> {
    let name = words.concat();
    let begin = ["sigma", "std", "sd"].iter();
    let axis = begin.filter_map(|begin| name.strip_prefix(begin)).next()?;
    match axis {
        "n" | "north" | "lat" => Some(Single::StdNorth),
        "e" | "east" | "lon" => Some(Single::StdEast),
        "u" | "up" | "d" | "down" | "h" | "alt" => Some(Single::StdVertical),
        "vn" => Some(Single::StdVelocityNorth),
        "ve" => Some(Single::StdVelocityEast),
        "vu" | "vd" => Some(Single::StdVelocityVertical),
        _ => None,
    }
}

/// A component of a velocity over ground.
fn velocity(words: &[String]) -> Option<Single> {
    let name = words.concat();
    let rest = ["velocity", "vel", "v"].iter();
    let axis = rest.filter_map(|begin| name.strip_prefix(begin)).next()?;
    match axis {
        "n" | "north" => Some(Single::VelocityNorth),
        "e" | "east" => Some(Single::VelocityEast),
        "d" | "down" => Some(Single::VelocityDown),
        "u" | "up" => Some(Single::VelocityUp),
        _ => None,
    }
}
