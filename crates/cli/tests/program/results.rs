//! The tables of `docs/results` that take less than a minute are what their commands print today.

use std::env::consts::EXE_SUFFIX;
use std::fs;
use std::path::Path;
use std::process::Command;

use northing_recording::test_data::{assert_as_committed, data_dir};

/// Runs `./scripts/results --quick` with the programs of this build, and compares every page. Where there are no
/// recordings, the tables of simulations are left to compare.
#[test]
fn quick_tables_of_results_are_as_committed() {
    let _ = data_dir("quick tables of docs/results on recordings");
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let program = Path::new(env!("CARGO_BIN_EXE_northing"));
    let programs = program.parent().unwrap();
    // Tests of the whole workspace have built them.
    if !programs
        .join(format!("examples/ground_results{EXE_SUFFIX}"))
        .exists()
    {
        let build = ["build", "-p", "northing-experiments", "--examples"];
        let mut cargo = Command::new(env!("CARGO"));
        assert!(
            cargo
                .args(build)
                .current_dir(&root)
                .status()
                .unwrap()
                .success()
        );
    }
    let made = tempfile::tempdir().unwrap();
    let output = Command::new(root.join("scripts/results"))
        .arg("--quick")
        .env("NORTHING_PROGRAMS", programs)
        .env("NORTHING_RESULTS_TO", made.path())
        .output()
        .unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    let mut pages = 0;
    for page in fs::read_dir(root.join("docs/results")).unwrap() {
        let page = page.unwrap().path();
        let made = fs::read_to_string(made.path().join(page.file_name().unwrap())).unwrap();
        assert_as_committed(&page, &made, |committed, made| committed == made);
        pages += 1;
    }
    assert!(pages > 5, "only {pages} pages");
}
