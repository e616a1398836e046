//! What is said of a navigation run that nothing was scored in: only what the run knows.
#![allow(clippy::unwrap_used)] // helpers of tests unwrap like tests

use std::convert::Infallible;

use northing_evaluation::navigation::{
    NavigationKind, NavigationOptions, NavigationSummary, run_navigation,
};
use northing_recording::metadata::WorldFrame;
use northing_recording::{Event, GnssPosition, GnssQuality, Sample};
use northing_report::navigation_verdicts;

/// Ten fixes a second apart, to the north.
fn walk() -> NavigationSummary {
    let fix = |second: i64| GnssPosition {
        latitude_rad: 0.8 + 2e-7 * second as f64,
        longitude_rad: 0.1,
        height_m: Some(300.0),
        std_m: Some([2.0, 2.0, 4.0]),
        hdop: None,
        satellites: None,
        quality: GnssQuality::Autonomous,
    };
    let events = (0..10).map(|second| {
        Ok::<_, Infallible>(Event {
            time_ns: second * 1_000_000_000,
            sample: Sample::GnssPosition(fix(second)),
        })
    });
    let options = NavigationOptions {
        estimator: NavigationKind::DeadReckoning,
        ..NavigationOptions::default()
    };
    run_navigation(events, "walk", WorldFrame::Ned, &options, &mut ()).unwrap()
}

fn said(summary: &NavigationSummary) -> String {
    let verdicts = navigation_verdicts(summary);
    let texts: Vec<&str> = verdicts
        .iter()
        .map(|verdict| verdict.text.as_str())
        .collect();
    texts.join(" ")
}

#[test]
fn holding_fixes_out_is_advised_only_where_none_was() {
    let all_used = walk();
    assert_eq!((all_used.fixes, all_used.fixes_given), (10, 10));
    assert!(said(&all_used).contains("--gnss-every 2"));
    // As of --gnss-every 4 with no estimate at the fixes that were held out.
    let held_out = NavigationSummary {
        fixes_given: 8,
        fixes_used: 5,
        ..all_used
    };
    let text = said(&held_out);
    assert!(!text.contains("--gnss-every"), "{text}");
    assert!(
        text.contains("of 2 held-out fixes none was scored")
            && text.contains("used 5 of the 8 fixes"),
        "{text}"
    );
}
