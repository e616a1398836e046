//! Real recordings, where they are at hand (`NORTHING_DATA`).

use northing_recording::test_data::data_dir;

use crate::support::{Lab, contains};

#[test]
fn phones_and_laboratories_are_compared_in_one_table() {
    let Some(data) = data_dir("phones_and_laboratories_are_compared_in_one_table") else {
        return;
    };
    let file = |name: &str| {
        data.join("attitude")
            .join(name)
            .to_str()
            .unwrap()
            .to_owned()
    };
    let broad = file("broad/01_undisturbed_slow_rotation_A.parquet");
    let phone = file("smartphone/Guillaume_Nexus5_NoDist_AR.parquet");
    let text = Lab::new().succeeds(&["compare", &broad, &phone, "--estimators", "mekf,device"]);
    contains(
        &text,
        &["broad", "smartphone", "mekf", "device", "mean / median"],
    );
    let json = Lab::new().json(&[
        "compare",
        &broad,
        &phone,
        "--estimators",
        "mekf,device",
        "--json",
    ]);
    let error = |i: usize| json[i]["error_deg"]["total_rmse"].as_f64();
    assert!(error(0).unwrap() < 10.0 && error(2).unwrap() < 30.0);
    // The laboratory's sensor has no orientation of its own.
    assert_eq!(error(1), None);
    assert!(error(3).is_some());
}

#[test]
fn a_phone_recording_gives_a_report() {
    let Some(data) = data_dir("a_phone_recording_gives_a_report") else {
        return;
    };
    let lab = Lab::new();
    let phone = data.join("attitude/smartphone/Guillaume_Nexus5_NoDist_AR.parquet");
    lab.succeeds(&[
        "run",
        phone.to_str().unwrap(),
        "--report",
        "r.html",
        "--magnetometer",
        "uncalibrated",
    ]);
    let report = lab.read("r.html");
    contains(
        &report,
        &["<svg", "Errors", "Innovations", "Gyroscope bias"],
    );
    assert!(report.len() < 3_000_000, "{}", report.len());
}
