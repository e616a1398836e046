//! Writes a run report, a comparison report and the README picture from made-up traces, to look at.
//!
//! `cargo run -p northing-report --example report_gallery -- FOLDER` writes `run.html`,
//! `comparison.html` and `hero.svg` into the folder. Nothing in them was measured.

use std::path::Path;

use northing_core::kalman::Outcome;
use northing_evaluation::attitude::{InnovationPoint, Trace, TracePoint};
use northing_evaluation::{Origin, UsedParameter};
use northing_report::{
    Best, Cell, Column, ComparedRun, ComparisonReport, Distribution, Fact, FinalTest, HeroPicture,
    RunReport, SensorUpdates, Table, Tone, Verdict, hero_svg,
};

/// A stream of numbers that look like Gaussian noise: sums of a linear congruential generator.
struct Noise(u64);

impl Noise {
    fn uniform(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn gaussian(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}

/// How a made-up estimator errs.
struct Character {
    std_deg: f64,
    drift_deg_s: f64,
    covariance: bool,
    seed: u64,
}

const SECONDS: f64 = 120.0;
const RATE_HZ: f64 = 100.0;

/// Heading turning on and on, pitch and roll in a slow dance; deg.
fn truth(t: f64) -> [f64; 3] {
    let turning = smooth(t, 12.0, 20.0) * 3.2 * (t - 12.0).max(0.0);
    let heading = 40.0 + turning + 35.0 * (t / 9.0).sin() * smooth(t, 12.0, 16.0);
    let dance = smooth(t, 10.0, 15.0);
    [
        wrap(heading),
        28.0 * (t / 5.3).sin() * dance,
        46.0 * (t / 7.1).sin() * dance - 3.0,
    ]
}

fn smooth(t: f64, from: f64, to: f64) -> f64 {
    let x = ((t - from) / (to - from)).clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

fn wrap(angle: f64) -> f64 {
    (angle + 180.0).rem_euclid(360.0) - 180.0
}

fn disturbed(t: f64) -> bool {
    (46.0..54.0).contains(&t)
}

fn trace(character: &Character) -> Trace {
    let mut noise = Noise(character.seed);
    let mut trace = Trace::new(4000);
    let (mut error, mut bias) = ([0.0_f64; 3], [0.0_f64; 3]);
    for k in 0..(SECONDS * RATE_HZ) as u64 {
        let t = k as f64 / RATE_HZ;
        let start = 5.0 * (-t / 1.5).exp();
        let held = if disturbed(t) { 1.7 } else { 1.0 };
        let std = [1.0, 0.35, 0.35].map(|s| s * character.std_deg * held + start);
        for i in 0..3 {
            let kick = std[i] * (2.0 * 0.012_f64).sqrt() * noise.gaussian();
            error[i] += kick - 0.012 * error[i];
            bias[i] += 0.002 * ([0.42, -0.18, 0.07][i] - bias[i]) + 2e-4 * noise.gaussian();
        }
        let drifts = [1.0, 0.22, 0.3]
            .map(|f| f * character.drift_deg_s * t * (1.0 + 0.1 * (t / 11.0).sin()));
        let angles = truth(t);
        let off = [0, 1, 2].map(|i| error[i] + drifts[i]);
        let inclination = off[1].hypot(off[2]);
        let bias_std = 0.02 + 0.3 * (-t / 12.0).exp();
        trace.points.push(|| TracePoint {
            time_s: t,
            angles_deg: [0, 1, 2].map(|i| wrap(angles[i] + off[i])),
            angles_std_deg: character.covariance.then_some(std),
            reference_deg: (!(70.0..74.0).contains(&t)).then_some(angles),
            device_deg: Some([
                wrap(angles[0] + 9.0 * (t / 31.0).sin() - 6.0),
                angles[1] + 1.2,
                angles[2] - 0.8,
            ]),
            error_deg: (!(70.0..74.0).contains(&t)).then_some([
                off[0].hypot(inclination),
                wrap(off[0]),
                inclination,
            ]),
            error_std_deg: character.covariance.then_some([
                std[0].hypot(std[1]).hypot(std[2]),
                std[0],
                std[1].hypot(std[2]),
            ]),
            bias_deg_s: character.covariance.then_some(bias),
            bias_std_deg_s: character.covariance.then_some([bias_std; 3]),
            position_m: None,
        });
        if character.covariance {
            innovations(&mut trace, &mut noise, t, k);
        }
    }
    trace
}

fn innovations(trace: &mut Trace, noise: &mut Noise, t: f64, k: u64) {
    let stds = [[0.35, 0.35, 0.42], [1.1, 1.2, 1.0]];
    for (sensor, std) in stds.into_iter().enumerate() {
        if sensor == 1 && k % 2 == 1 {
            continue;
        }
        let factor = match sensor {
            1 if disturbed(t) => 9.0 * ((t - 46.0) / 8.0 * std::f64::consts::PI).sin(),
            0 => 1.5,
            _ => 0.95,
        };
        let unit = [0, 1, 2].map(|i| {
            let push = if factor > 2.0 {
                factor * [0.8, -0.5, 0.3][i]
            } else {
                0.0
            };
            noise.gaussian() * factor.clamp(0.9, 1.6) + push
        });
        let nis: f64 = unit.iter().map(|u| u * u).sum();
        let outcome = match nis {
            n if n < 16.27 => Outcome::Fused,
            _ if t > 52.5 && sensor == 1 => Outcome::Inflated,
            _ => Outcome::Gated,
        };
        let residual = [0, 1, 2].map(|i| unit[i] * std[i]);
        trace.innovations[sensor].1.push(|| InnovationPoint {
            time_s: t,
            residual,
            std,
            nis,
            degrees_of_freedom: 3,
            outcome,
        });
    }
}

fn setting(name: &str, value: &str, unit: &'static str, meaning: &'static str) -> UsedParameter {
    UsedParameter {
        name: name.to_owned(),
        value: value.into(),
        unit,
        origin: Origin::Default,
        meaning,
    }
}

fn settings() -> Vec<UsedParameter> {
    vec![
        setting(
            "gyroscope_noise_density",
            "0.003",
            "rad/s/\u{221a}Hz",
            "White noise of the angular rate. Larger: the filter follows accelerometer and magnetometer more.",
        ),
        setting(
            "gyroscope_bias_random_walk",
            "0.0002",
            "rad/s\u{00b2}/\u{221a}Hz",
            "How fast the bias may drift. Larger: the bias settles sooner and is noisier.",
        ),
        setting(
            "accelerometer_std",
            "0.35",
            "m/s\u{00b2}",
            "Noise of the specific force, movements included. Larger: tilt is corrected more slowly.",
        ),
        setting(
            "magnetometer_std",
            "1.1",
            "\u{00b5}T",
            "Noise of the magnetic field, disturbances included.",
        ),
        setting(
            "nis_gate",
            "16.27",
            "",
            "NIS above which a measurement is refused (99.9 % for three components).",
        ),
        setting(
            "gate_timeout_s",
            "3",
            "s",
            "After this long without an accepted measurement they are used again, with inflated noise.",
        ),
    ]
}

fn run_report(trace: &Trace) -> RunReport<'_> {
    RunReport {
        estimator: "mekf (6 states: attitude error, gyroscope bias)".to_owned(),
        recording: "made-up-lab.parquet".to_owned(),
        command: Some("northing run made-up-lab.parquet --estimator mekf --report run.html".to_owned()),
        summary: vec![
            Fact::new("total error, RMS", "1.83 deg"),
            Fact::new("heading error, RMS", "1.71 deg"),
            Fact::new("inclination error, RMS", "0.65 deg"),
            Fact::new("NEES, per component (ideal 1)", "1.08"),
            Fact::new("duration", "120.0 s"),
        ],
        verdicts: vec![
            Verdict::new(Tone::Good, "The covariance is consistent: NEES is 1.08 per component, between the bounds 0.91 and 1.10."),
            Verdict::new(Tone::Warn, "Your accelerometer R is about 2.2 times too small: its mean NIS is 6.7 where 3 is expected."),
            Verdict::new(Tone::Bad, "The magnetometer was refused for 6.1 s on end; heading relied on the gyroscope alone meanwhile."),
        ],
        updates: vec![
            SensorUpdates { sensor: "accelerometer".to_owned(), fused: 11_403, gated: 597, skipped: 0, nis_mean: Some(6.71), nis_expected: Some(3.0) },
            SensorUpdates { sensor: "magnetometer".to_owned(), fused: 5_512, gated: 488, skipped: 12, nis_mean: Some(2.71), nis_expected: Some(3.0) },
        ],
        final_test: Some(FinalTest {
            calculated_error_deg: Some(1.21),
            estimated_error_deg: Some(0.94),
            axis_std_deg: Some([0.31, 0.32, 0.83]),
            tilt_deg: None,
            nees: Some(4.2),
            verdict: Some(Verdict::new(Tone::Good, "Consistent: the calculated error is what the filter expects.")),
        }),
        recording_facts: vec![
            Fact::new("device", "a phone that does not exist"),
            Fact::new("gyroscope", "12 000 samples, 100.0 Hz"),
            Fact::new("magnetometer", "6 012 samples, 50.0 Hz"),
            Fact::new("world frame", "enu"),
        ],
        issues: vec!["The gyroscope pauses for more than 0.5 s once; the longest gap lasts 0.812 s and starts 70.100 s into the recording.".to_owned()],
        settings: settings(),
        ..RunReport::new("A walk around the laboratory", trace)
    }
}

fn comparison<'a>(runs: &[(&'a str, &'a Trace)]) -> ComparisonReport<'a> {
    let mut noise = Noise(5);
    let mut spread = |median: f64| -> Vec<f64> {
        (0..39)
            .map(|_| median * (0.55 * noise.gaussian()).exp())
            .collect()
    };
    let row = |name: &str, values: [f64; 4]| {
        let mut row = vec![Cell::text(name)];
        row.extend(values.map(|v| Cell::number(Some(v), 2)));
        row
    };
    ComparisonReport {
        title: "Four estimators on one walk".to_owned(),
        recording: "made-up-lab.parquet".to_owned(),
        verdicts: vec![Verdict::new(
            Tone::Good,
            "mekf is the best of all by total error, and its covariance is consistent.",
        )],
        tables: vec![Table {
            title: "Errors".to_owned(),
            caption:
                "Root mean square over the scored samples; lower is better, NEES is best at 1."
                    .to_owned(),
            columns: vec![
                Column::new("Estimator", "", None),
                Column::new("Total", "deg", Some(Best::Lowest)),
                Column::new("Heading", "deg", Some(Best::Lowest)),
                Column::new("Inclination", "deg", Some(Best::Lowest)),
                Column::new("NEES per component", "", Some(Best::Nearest(1.0))),
            ],
            rows: vec![
                row("mekf", [1.83, 1.71, 0.65, 1.08]),
                row("usque", [1.91, 1.78, 0.64, 1.17]),
                row("device", [6.40, 6.23, 1.44, f64::NAN]),
                row("integration", [34.2, 31.0, 9.7, f64::NAN]),
            ],
        }],
        distributions: vec![
            Distribution {
                name: "mekf".to_owned(),
                errors_deg: spread(3.1),
            },
            Distribution {
                name: "usque".to_owned(),
                errors_deg: spread(3.2),
            },
            Distribution {
                name: "quaternion-ekf".to_owned(),
                errors_deg: spread(3.6),
            },
            Distribution {
                name: "integration".to_owned(),
                errors_deg: spread(31.0),
            },
        ],
        runs: runs
            .iter()
            .map(|(name, trace)| ComparedRun {
                name,
                trace,
                heading_offset_deg: None,
            })
            .collect(),
        settings: vec![("mekf".to_owned(), settings())],
        ..ComparisonReport::default()
    }
}

fn main() -> std::io::Result<()> {
    let folder = std::env::args().nth(1).unwrap_or_else(|| ".".to_owned());
    let folder = Path::new(&folder);
    let made = |std_deg, drift_deg_s, covariance, seed| {
        trace(&Character {
            std_deg,
            drift_deg_s,
            covariance,
            seed,
        })
    };
    let mekf = made(1.6, 0.0, true, 1);
    let usque = made(1.9, 0.0, true, 2);
    let device = made(6.0, 0.0, false, 3);
    let integration = made(0.3, 0.42, false, 4);
    let runs = [
        ("mekf", &mekf),
        ("usque", &usque),
        ("device", &device),
        ("integration", &integration),
    ];
    std::fs::create_dir_all(folder)?;
    std::fs::write(folder.join("run.html"), run_report(&mekf).render())?;
    std::fs::write(folder.join("comparison.html"), comparison(&runs).render())?;
    let picture = HeroPicture {
        title: "A phone knows which way it points, and how sure it is",
        subtitle: "Made-up data: the filter stays inside its own 3\u{03c3} band, gyroscope integration drifts away",
        filter: ("Kalman filter (mekf)", &mekf),
        drifting: ("gyroscope alone", &integration),
        other: None,
    };
    std::fs::write(folder.join("hero.svg"), hero_svg(&picture))
}
