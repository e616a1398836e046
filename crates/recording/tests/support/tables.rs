//! Tables of a simulated device, written in many ways.

use std::fmt::Write as _;

use nalgebra::{UnitQuaternion, Vector3};

const STANDARD_GRAVITY: f64 = 9.80665;

/// A generator of random numbers, the same everywhere.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    pub(crate) fn below(&mut self, end: usize) -> usize {
        (self.next() >> 16) as usize % end
    }

    /// -1 to 1.
    pub(crate) fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    pub(crate) fn vector(&mut self) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.unit())
    }

    pub(crate) fn of<T: Copy>(&mut self, choices: &[T]) -> T {
        choices[self.below(choices.len())]
    }
}

/// A row of a recording: time, angular rate, specific force, field, attitude.
pub(crate) struct Row {
    pub(crate) t: f64,
    pub(crate) rate: Vector3<f64>,
    pub(crate) force: Vector3<f64>,
    pub(crate) field: Vector3<f64>,
    pub(crate) attitude: UnitQuaternion<f64>,
}

/// A device in a hand, or in a vehicle that accelerates: z is up.
pub(crate) fn recording(random: &mut Random, rate_hz: f64, seconds: f64) -> Vec<Row> {
    let mut attitude = UnitQuaternion::new(random.vector());
    let turning = 0.4 + 0.8 * random.unit().abs();
    let shaking = 2.0 * random.unit().abs();
    let speed = random.vector() + Vector3::new(1.3, 0.9, 1.1);
    let bias = random.vector() * 0.01;
    let rows = 0..(seconds * rate_hz) as u32;
    rows.map(|k| {
        let t = f64::from(k) / rate_hz;
        let rate = turning * (speed * t).map(f64::sin);
        let acceleration = shaking * (speed * (2.0 * t)).map(f64::cos);
        let row = Row {
            t,
            rate: rate + bias + 0.005 * random.vector(),
            force: attitude.inverse() * (acceleration + Vector3::z() * 9.81)
                + 0.2 * random.vector(),
            field: attitude.inverse() * Vector3::new(3.0, 21.0, -42.0) + 0.5 * random.vector(),
            attitude,
        };
        attitude *= UnitQuaternion::new(rate / rate_hz);
        row
    })
    .collect()
}

/// A column: its name and its numbers.
type Column = (String, Vec<f64>);

/// How the names of the three sensors are written; `{}` stands for the axis.
const NAMES: [[&str; 3]; 8] = [
    ["gyro_{}", "acc_{}", "mag_{}"],
    ["g{}", "a{}", "m{}"],
    ["w{}", "f{}", "b{}"],
    ["Gyroscope {}", "Accelerometer {}", "Magnetometer {}"],
    [
        "angular_velocity.{}",
        "linear_acceleration.{}",
        "magnetic_field.{}",
    ],
    ["GYR_{}", "ACC_{}", "MAG_{}"],
    ["{}gyro", "{}acc", "{}mag"],
    ["imu0/gyro/{}", "imu0/accel/{}", "imu0/mag/{}"],
];

/// A unit: what one of ours is in it, and how headers write it; empty where they do not.
type Unit = (f64, &'static [&'static str]);
const RATES: [Unit; 2] = [
    (1.0, &["", "rad/s", "rad s^-1"]),
    (180.0 / std::f64::consts::PI, &["", "deg/s", "dps", "°/s"]),
];
const FORCES: [Unit; 3] = [
    (1.0, &["", "m/s^2", "m s^-2", "m/s²"]),
    (1.0 / STANDARD_GRAVITY, &["", "g"]),
    (1000.0 / STANDARD_GRAVITY, &["", "mg"]),
];
const FIELDS: [Unit; 4] = [
    (1.0, &["", "uT", "µT"]),
    (0.01, &["", "gauss"]),
    (10.0, &["", "mGauss"]),
    (1000.0, &["", "nT"]),
];
const TIMES: [(f64, &[&str]); 4] = [
    (1.0, &["", "s"]),
    (1e3, &["", "ms"]),
    (1e6, &["", "us"]),
    (1e9, &["", "ns"]),
];

/// The columns of a vector.
fn vector(
    random: &mut Random,
    name: &str,
    units: &[Unit],
    values: impl Iterator<Item = Vector3<f64>>,
) -> Vec<Column> {
    let (factor, spellings) = random.of(units);
    let spelling = random.of(spellings);
    let values: Vec<Vector3<f64>> = values.collect();
    (0..3)
        .map(|axis| {
            let name = name.replace("{}", ["x", "y", "z"][axis]);
            let name = match spelling {
                "" => name,
                unit => format!("{name} ({unit})"),
            };
            (name, values.iter().map(|v| v[axis] * factor).collect())
        })
        .collect()
}

/// A table in one of many ways.
pub(crate) fn table(random: &mut Random, rows: &[Row]) -> String {
    let names = random.of(&NAMES);
    let (factor, spellings) = random.of(&TIMES);
    let start = random.of(&[0.0, 46_408.5, 1.7e9]);
    let time = match random.of(spellings) {
        "" => random
            .of(&["t", "time", "timestamp", "Timestamp"])
            .to_owned(),
        unit => format!("time [{unit}]"),
    };
    let mut groups: Vec<Vec<Column>> = vec![
        vec![(
            time,
            rows.iter().map(|row| (row.t + start) * factor).collect(),
        )],
        vector(random, names[0], &RATES, rows.iter().map(|row| row.rate)),
        vector(random, names[1], &FORCES, rows.iter().map(|row| row.force)),
    ];
    if random.below(2) == 0 {
        groups.push(vector(
            random,
            names[2],
            &FIELDS,
            rows.iter().map(|row| row.field),
        ));
    }
    for (name, numbers) in [
        (
            "index",
            (0..rows.len()).map(|k| k as f64).collect::<Vec<_>>(),
        ),
        (
            "temperature_c",
            rows.iter().map(|row| 21.0 + 0.001 * row.t).collect(),
        ),
        ("battery", vec![3.7; rows.len()]),
    ] {
        if random.below(3) == 0 {
            groups.push(vec![(name.to_owned(), numbers)]);
        }
    }
    for place in (1..groups.len()).rev() {
        groups.swap(place, random.below(place + 1));
    }
    let columns: Vec<Column> = groups.into_iter().flatten().collect();
    let delimiter = random.of(&[',', ';', '\t']);
    let decimal_comma = delimiter != ',' && random.below(2) == 0;
    let mut text = random
        .of(&[
            "",
            "Logger 7\n",
            "Exported 12:30\nby somebody, for nobody\n\n",
        ])
        .to_owned();
    let header: Vec<&str> = columns.iter().map(|(name, _)| name.as_str()).collect();
    text.push_str(&header.join(&delimiter.to_string()));
    let end = random.of(&["\n", "\r\n"]);
    text.push_str(end);
    for row in 0..rows.len() {
        for (place, (_, numbers)) in columns.iter().enumerate() {
            if place > 0 {
                text.push(delimiter);
            }
            let number = format!("{}", numbers[row]);
            let number = if decimal_comma {
                number.replace('.', ",")
            } else {
                number
            };
            text.push_str(&number);
        }
        text.push_str(end);
    }
    text
}

/// The rows as text.
pub(crate) fn plain(rows: &[Row], row: impl Fn(&Row) -> Vec<f64>) -> String {
    let mut text = String::new();
    for one in rows {
        let cells: Vec<String> = row(one).iter().map(f64::to_string).collect();
        let _ = writeln!(text, "{}", cells.join(","));
    }
    text
}
