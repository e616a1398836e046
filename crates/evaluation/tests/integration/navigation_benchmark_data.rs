//! The navigation benchmark on real recordings: what is held out, what is scored at, and the answers without a filter.

#![allow(clippy::unwrap_used)]

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use northing_evaluation::navigation::NavigationKind;
use northing_evaluation::navigation::benchmark::{BenchmarkOptions, Row, Totals, benchmark};
use northing_recording::OpenOptions;
use northing_recording::test_data::data_dir;

fn run(paths: &[PathBuf], data: &Path) -> Vec<Row> {
    let options = BenchmarkOptions {
        estimator: NavigationKind::ErrorState,
        smooth: false,
        open: OpenOptions {
            data: Some(data.to_owned()),
            ..OpenOptions::default()
        },
    };
    let finished = AtomicUsize::new(0);
    let count = || {
        finished.fetch_add(1, Ordering::Relaxed);
    };
    let runs = benchmark(paths, &options, &count);
    assert_eq!(finished.into_inner(), paths.len());
    assert!(runs.iter().map(|run| &run.path).eq(paths));
    runs.into_iter().map(|run| run.outcome.unwrap()).collect()
}

/// Holding the last of one fix a second and extrapolating from it have 2.2 m and 1.5 m in the median.
#[test]
fn flights_are_scored_at_their_reference() {
    let Some(data) = data_dir("flights_are_scored_at_their_reference") else {
        return;
    };
    let mut paths: Vec<PathBuf> = std::fs::read_dir(data.join("nav/quad"))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == "csv"))
        .collect();
    paths.sort();
    let rows = run(&paths, &data);
    for row in &rows {
        assert_eq!((row.gnss_every, row.scored_against), (1, Some("reference")));
        assert_eq!(row.fixes_given, row.fixes);
        assert!(row.fixes_used <= row.fixes_given && row.heading_rmse_deg.is_some());
        let position = row.position.as_ref().unwrap();
        let extrapolation = position.extrapolation_rmse_m.unwrap();
        let is_worse = position.horizontal_rmse_m > extrapolation;
        assert_eq!(row.worse_than_extrapolation, is_worse, "{}", row.recording);
        let batch = row.batch.unwrap();
        assert!(batch.converged && batch.inside_95 > 0.9, "{batch:?}");
        assert!(batch.horizontal_rmse_m < position.horizontal_rmse_m);
        // An outage of 10 s begins after 20 s.
        assert_eq!(
            row.outages.is_some(),
            row.duration_s > 31.0,
            "{}",
            row.recording
        );
    }
    let totals = Totals::of(&rows.iter().collect::<Vec<_>>());
    assert_eq!((totals.recordings, totals.scored), (18, 18));
    let [hold, extrapolation] =
        [totals.hold_rmse_m, totals.extrapolation_rmse_m].map(Option::unwrap);
    assert!((2.1..2.4).contains(&hold), "{hold}");
    assert!((1.3..1.6).contains(&extrapolation), "{extrapolation}");
    // 0.044 m; the batch solution of GTSAM has 0.17 m.
    assert!(totals.batch_rmse_m.unwrap() < 0.06, "{totals:?}");
}

#[test]
fn a_drive_without_reference_is_scored_at_the_fixes_that_were_held_out() {
    let name = "a_drive_without_reference_is_scored_at_the_fixes_that_were_held_out";
    let Some(data) = data_dir(name) else { return };
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/recordings");
    let rows = run(&[examples.join("car_rtk.toml")], &data);
    let [row] = &rows[..] else { panic!("one row") };
    assert_eq!(
        (row.gnss_every, row.scored_against),
        (4, Some("held-out fixes"))
    );
    assert_eq!((row.fixes, row.fixes_given), (1601, 401));
    let position = row.position.as_ref().unwrap();
    assert!(position.horizontal_rmse_m < 0.066, "{position:?}");
    let outages = row.outages.unwrap();
    // The first begins after 20 s, when the filter may not have aligned yet.
    assert!(outages.made == 7 && outages.scored >= 6, "{outages:?}");
    assert!(outages.horizontal_rmse_m < outages.extrapolation_rmse_m.unwrap());
    assert!(!row.lost && !row.worse_than_extrapolation);
}
