//! References on a clock of their own, arbitrary headings: what `northing run` says, and what it refuses.

use crate::support::{Lab, contains};

/// Angle about the vertical and its rate.
fn turn(t: f64) -> (f64, f64) {
    let sines = [
        (0.8, 1.1, 0.0),
        (0.5, 2.3, 1.0),
        (0.3, 4.1, 2.5),
        (0.9, 0.37, 0.4),
    ];
    let angle = sines.iter().map(|(a, w, p)| a * (w * t + p).sin()).sum();
    let rate = sines
        .iter()
        .map(|(a, w, p)| a * w * (w * t + p).cos())
        .sum();
    (angle, rate)
}

/// A minute on a turntable: inertial unit at 40 Hz, reference at 30 Hz with the stamps of its own clock.
fn turntable(stamp: impl Fn(f64) -> f64, angle: impl Fn(f64) -> f64) -> String {
    let mut rows: Vec<(f64, String)> = (0..2400)
        .map(|k| {
            let t = f64::from(k) / 40.0;
            (t, format!("0,0,{},0,0,9.81,,,,", turn(t).1))
        })
        .collect();
    rows.extend((0..1800).map(|k| {
        let t = (f64::from(k) + 0.37) / 30.0;
        let (sine, cosine) = (0.5 * (angle(t) + 1.5)).sin_cos();
        (stamp(t), format!(",,,,,,{cosine},0,0,{sine}"))
    }));
    rows.sort_by(|a, b| a.0.total_cmp(&b.0));
    let header = "t_s,gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s,acc_x_m_s2,acc_y_m_s2,acc_z_m_s2,ref_qw,ref_qx,ref_qy,ref_qz\n";
    let rows = rows.into_iter().filter(|row| row.0 >= 0.0);
    rows.fold(header.to_owned(), |text, (t, row)| {
        format!("{text}{t:.9},{row}\n")
    })
}

fn lab(stamp: impl Fn(f64) -> f64) -> Lab {
    let lab = Lab::new();
    lab.write("turntable.csv", turntable(stamp, |t| turn(t).0));
    lab
}

/// Without magnetometer the heading is arbitrary: 86 deg of offset are no error, and every sample of the reference counts.
#[test]
fn without_magnetometer_tilt_and_drift_are_stated() {
    let lab = lab(|t| t);
    let text = lab.succeeds(&["run", "turntable.csv"]);
    contains(
        &text,
        &[
            "inclination error",
            "heading error",
            "since the first scored sample",
            "of the tilt alone",
        ],
    );
    assert!(!text.contains("attitude error"), "{text}");
    let json = lab.json(&["run", "turntable.csv", "--json"]);
    assert_eq!(json["heading"], "arbitrary");
    assert_eq!(json["nees"]["degrees_of_freedom"], 2);
    let error = &json["error_deg"];
    assert_eq!(error["heading_offset_removed"], true);
    assert!(error["total_rmse"].as_f64().unwrap() < 5.0, "{error}");
    assert!(
        error["heading_offset"].as_f64().unwrap().abs() > 60.0,
        "{error}"
    );
    assert!(error["scored_samples"].as_u64().unwrap() > 1600, "{error}");
    assert_eq!(json["reference"]["in_gaps"], 0);
    let table = lab.succeeds(&["compare", "turntable.csv", "--estimators", "mekf"]);
    contains(&table, &["Nothing said where north is"]);
}

#[test]
fn an_offset_is_said_and_taken_out_when_asked() {
    let lab = lab(|t| t - 0.15);
    let text = lab.succeeds(&["run", "turntable.csv"]);
    contains(
        &text,
        &["s behind that of the sensors", "--align-reference"],
    );
    let text = lab.succeeds(&["run", "turntable.csv", "--align-reference"]);
    contains(
        &text,
        &[
            "aligned by its angular rates",
            "clock offset +0.15",
            "standard deviation",
        ],
    );
    let of = |arguments: &[&str]| {
        let json = lab.json(arguments);
        json["error_deg"]["heading_aligned_rmse"].as_f64().unwrap()
    };
    let (plain, aligned) = (
        of(&["run", "turntable.csv", "--json"]),
        of(&["run", "turntable.csv", "--json", "--align-reference"]),
    );
    assert!(plain > 5.0 && aligned < 1.0, "{plain} and {aligned}");
    let refused = lab.refuses(&["run", "-", "--align-reference", "--format", "csv"]);
    contains(&refused, &["reads the recording twice", "file"]);
    let refused = lab.refuses(&[
        "run",
        "turntable.csv",
        "--align-reference",
        "--ignore-reference",
    ]);
    contains(&refused, &["cannot be used with"]);
}

/// Exit code 2, the file, the number, and what to do.
#[test]
fn references_of_another_clock_or_motion_are_refused() {
    let faster = lab(|t| 0.995 * t);
    let text = faster.refuses(&["run", "turntable.csv"]);
    contains(
        &text,
        &[
            "turntable.csv",
            "its clock runs",
            "% slower",
            "--ignore-reference",
        ],
    );
    let jump = lab(|t| if t < 30.0 { t } else { t + 0.9 });
    contains(
        &jump.refuses(&["run", "turntable.csv"]),
        &["its clock jumps by -0.9"],
    );
    let other = Lab::new();
    let another = |t: f64| 1.3 * (0.31 * t * (1.0 + 0.02 * t)).sin() + 0.4 * (2.9 * t).cos();
    other.write("turntable.csv", turntable(|t| t, another));
    let text = other.refuses(&["run", "turntable.csv", "--align-reference"]);
    contains(&text, &["correlate by 0.", "another recording"]);
    let text = other.succeeds(&["run", "turntable.csv", "--ignore-reference"]);
    contains(&text, &["no reference to score against"]);
}

/// A world with z down goes through a trajectory and back; of one that does not say so, the verticals do.
#[test]
fn a_trajectory_says_which_way_its_world_points() {
    let lab = Lab::new();
    let up = turntable(|t| t, |t| turn(t).0);
    let down = up.replace("0,0,9.81,", "0,0,-9.81,");
    lab.write("down.csv", format!("# world_frame: ned\n{down}"));
    lab.succeeds(&["convert", "down.csv", "truth.tum"]);
    lab.succeeds(&["run", "down.csv", "--out", "estimate.tum"]);
    for reference in ["truth.tum", "estimate.tum"] {
        let text = lab.read(reference);
        assert!(text.contains("# world_frame: ned\n"), "{text:.200}");
        let json = lab.json(&["run", "down.csv", "--reference", reference, "--json"]);
        let error = json["error_deg"]["inclination_rmse"].as_f64();
        assert!(error.is_some_and(|error| error < 1.0), "{json}");
        contains(&json["issues"].to_string(), &["z axis taken as down"]);
    }
    let without = lab.read("truth.tum").replace("# world_frame: ned\n", "");
    lab.write("other.tum", &without);
    let refused = lab.refuses(&["run", "down.csv", "--reference", "other.tum"]);
    contains(
        &refused,
        &["up is the estimate's down", "`# world_frame: ned`"],
    );
    lab.write("odd.tum", format!("# world_frame: nwu\n{without}"));
    let refused = lab.refuses(&["run", "down.csv", "--reference", "odd.tum"]);
    contains(&refused, &["odd.tum", "line 1", "expected enu or ned"]);
}
