//! The estimators that use positions: `cascade` and `cascade-ekf`.

use crate::support::{Lab, contains};
use serde_json::Value;

const MANIFEST: &str = r#"
name = "flight"
[time]
column = "t"
unit = "s"
[gyroscope]
columns = ["wx", "wy", "wz"]
[accelerometer]
columns = ["ax", "ay", "az"]
[magnetometer]
columns = ["mx", "my", "mz"]
[position]
columns = ["east", "north", "up"]
"#;

/// A number between -1 and 1 that looks drawn.
fn noise(k: usize, salt: usize) -> f64 {
    let mixed = (k * 7919 + salt * 104_729 + (k / 7) * 31_337) % 2003;
    mixed as f64 / 1001.0 - 1.0
}

/// A minute at 100 Hz, level, on a path of slow sines that begins at rest; a position good to 0.1 m
/// every tenth row. `change` gets the row's number and its cells: time, rates, forces, field, position.
fn flight(change: impl Fn(usize, &mut [String; 13])) -> String {
    let mut text = "t,wx,wy,wz,ax,ay,az,mx,my,mz,east,north,up\n".to_owned();
    for k in 0..6000 {
        let t = k as f64 * 0.01;
        let (ce, cn) = ((0.4 * t).cos(), (0.3 * t).cos());
        let truth = [2.0 * (1.0 - ce), 1.5 * (1.0 - cn), 0.0];
        let acceleration = [0.32 * ce, 0.135 * cn, 9.80665];
        let mut row = std::array::from_fn(|i| {
            let n = noise(k, i);
            match i {
                0 => format!("{t:.2}"),
                1..=3 => (0.005 * n).to_string(),
                4..=6 => (acceleration[i - 4] + 0.05 * n).to_string(),
                7..=9 => ([0.0, 27.0, -33.0][i - 7] + 0.5 * n).to_string(),
                _ if k % 10 == 0 => (truth[i - 10] + 0.1 * n).to_string(),
                _ => String::new(),
            }
        });
        change(k, &mut row);
        text += &row.join(",");
        text.push('\n');
    }
    text
}

pub(crate) fn lab(change: impl Fn(usize, &mut [String; 13])) -> Lab {
    let lab = Lab::new();
    lab.write("flight.toml", MANIFEST);
    lab.write("flight.csv", flight(change));
    lab
}

fn run(lab: &Lab, estimator: &str) -> Value {
    let flight = ["run", "flight.csv", "--manifest", "flight.toml"];
    let more = ["--estimator", estimator, "--profile", "lab", "--json"];
    lab.json(&[&flight[..], &more].concat())
}

#[test]
fn positions_of_a_manifest_are_used_told_and_drawn() {
    let lab = lab(|_, _| {});
    for estimator in ["cascade", "cascade-ekf"] {
        let json = run(&lab, estimator);
        let position = &json["position"];
        assert_eq!(position["updates"]["fused"], 595, "{position}");
        for axis in ["horizontal", "vertical"] {
            let rms = position["innovation_rms_m"][axis].as_f64().unwrap();
            assert!((0.04..0.15).contains(&rms), "{estimator}, {axis}: {rms}");
        }
        assert_eq!(
            position["accelerometer_bias_m_s2"]
                .as_array()
                .unwrap()
                .len(),
            3
        );
    }
    assert!(run(&lab, "mekf").get("position").is_none());
    let text = lab.succeeds(&[
        "run",
        "flight.csv",
        "--manifest",
        "flight.toml",
        "--estimator",
        "cascade",
        "--profile",
        "lab",
        "--report",
        "flight.html",
        "--out",
        "flight.tum",
    ]);
    contains(
        &text,
        &[
            "position",
            "595 fused",
            "m RMS per horizontal axis",
            "Accelerometer bias",
        ],
    );
    contains(
        &lab.read("flight.html"),
        &[
            "Where it was, seen from above.",
            "north upwards, m",
            "cascade_position_std_m",
        ],
    );
    let tum = lab.read("flight.tum");
    let last: Vec<f64> = tum
        .lines()
        .last()
        .unwrap()
        .split(' ')
        .map(|v| v.parse().unwrap())
        .collect();
    let east = 2.0 * (1.0 - (0.4 * 59.99_f64).cos());
    assert!((last[1] - east).abs() < 0.3, "{last:?}");
}

#[test]
fn columns_of_position_are_there_where_the_estimator_has_one() {
    let lab = Lab::with_phone();
    let header = |estimator: &str, file: &str| {
        let text = lab.succeeds(&["run", "phone.csv", "--estimator", estimator, "--out", file]);
        let first = lab.read(file).lines().next().unwrap().to_owned();
        (
            text,
            first.contains("pos_x_m") && first.contains("vel_z_m_s"),
        )
    };
    let (text, has_columns) = header("cascade", "cascade.csv");
    assert!(has_columns);
    contains(
        &text,
        &["The recording has no positions: the attitude ran, and the position observer waited."],
    );
    assert!(!header("mekf", "mekf.csv").1);
}

#[test]
fn settings_of_the_position_observer_are_checked() {
    let lab = Lab::with_phone();
    let refused = |estimator: &str, setting: &str| {
        lab.refuses(&[
            "run",
            "phone.csv",
            "--estimator",
            estimator,
            "--set",
            setting,
        ])
    };
    contains(
        &refused("cascade", "cascade_pole=0"),
        &["`cascade_pole`", "from 0.001 to 100"],
    );
    contains(
        &refused("cascade-ekf", "cascade_rotation=best"),
        &["estimated", "reconstructed"],
    );
    contains(
        &refused("cascade", "cascade_poles=1"),
        &["unknown parameter", "did you mean `cascade_pole`?"],
    );
    contains(
        &refused("cascade", "cascade_rotation=reconstructed"),
        &["has no effect on `cascade`", "cascade_position_std_m"],
    );
    contains(
        &refused("mekf", "cascade_pole=1"),
        &["has no effect on `mekf`"],
    );
}

/// What can be wrong with a recording ends in a summary that counts it, not in numbers that are none.
#[test]
fn bad_positions_and_sensors_are_counted() {
    fn clear(cells: &mut [String]) {
        cells.fill(String::new());
    }
    type Change = fn(usize, &mut [String; 13]);
    let place = |json: &Value| json["position"]["updates"].clone();
    let cases: [(&str, Change, &str, u64); 6] = [
        (
            "jumps once",
            |k, row| {
                if k == 3000 {
                    row[10] = "1000".into();
                }
            },
            "gated",
            1,
        ),
        (
            "jumps for good",
            |k, row| {
                if k >= 3000 && k % 10 == 0 {
                    row[10] = format!("{}", 1000.0 + noise(k, 3) * 0.1);
                }
            },
            "inflated",
            1,
        ),
        (
            "stops for a minute",
            |k, row| {
                if (1000..5000).contains(&k) {
                    clear(&mut row[10..]);
                }
            },
            "fused",
            150,
        ),
        (
            "silent accelerometer",
            |k, row| {
                if k > 2000 {
                    row[4..7].fill("0".into());
                }
            },
            "fused",
            500,
        ),
        (
            "saturated accelerometer",
            |k, row| {
                if k > 2000 {
                    row[6] = "9".into();
                }
            },
            "fused",
            200,
        ),
        (
            "field along gravity",
            |_, row| row[7..9].fill("0".into()),
            "fused",
            200,
        ),
    ];
    for (what, change, count, least) in cases {
        let lab = lab(change);
        for estimator in ["cascade", "cascade-ekf"] {
            let json = run(&lab, estimator);
            let updates = place(&json);
            assert!(
                updates[count].as_u64().unwrap() >= least,
                "{what}, {estimator}: {updates}"
            );
            let bias = json["position"]["accelerometer_bias_m_s2"]
                .as_array()
                .unwrap();
            assert!(
                bias.iter().all(|b| b.as_f64().unwrap().abs() <= 0.5),
                "{what}: {bias:?}"
            );
        }
    }
    // Held in every row between measurements.
    let last = std::cell::RefCell::new([const { String::new() }; 3]);
    let held = lab(|k, row| {
        let mut last = last.borrow_mut();
        if k % 10 == 0 {
            last.clone_from_slice(&row[10..]);
        } else {
            row[10..].clone_from_slice(&*last);
        }
    });
    let updates = place(&run(&held, "cascade"));
    assert_eq!(
        (
            &updates["fused"],
            &updates["skipped_because"]["the same numbers again"]
        ),
        (&595.into(), &5355.into())
    );
    // Time that stands still for a second, and rows that come late: the reader counts them.
    let still = lab(|k, row| {
        if (3000..3100).contains(&k) {
            row[0] = "30.00".into();
        }
    });
    let json = run(&still, "cascade");
    assert!(
        json["issues"].to_string().contains("stamp"),
        "{}",
        json["issues"]
    );
    assert_eq!(place(&json)["fused"], 586);
}
