//! The origin of the local frame is where the first fixes agree: a stale first fix does not move it.

#![allow(clippy::unwrap_used)]

use std::convert::Infallible;

use nalgebra::Vector3;
use northing_core::earth::Geodetic;
use northing_core::earth::wgs84::LocalFrame;
use northing_evaluation::EvaluationError;
use northing_evaluation::navigation::{
    NavigationKind, NavigationOptions, NavigationSummary, run_navigation,
};
use northing_recording::{
    Event, GnssPosition, GnssQuality, Sample, TrueHeading, WaterVelocity, WorldFrame,
};

const ESTIMATORS: [NavigationKind; 3] = [
    NavigationKind::ErrorState,
    NavigationKind::AxisFilters,
    NavigationKind::DeadReckoning,
];
const DURATION_S: i64 = 120;
const AT_REST_S: f64 = 10.0;
const HEADING: f64 = 0.6;

fn place(latitude_deg: f64, longitude_deg: f64) -> GnssPosition {
    GnssPosition {
        latitude_rad: latitude_deg.to_radians(),
        longitude_rad: longitude_deg.to_radians(),
        height_m: Some(0.0),
        std_m: Some([1.0, 1.0, 2.0]),
        quality: GnssQuality::Autonomous,
        ..GnssPosition::default()
    }
}

fn home() -> LocalFrame {
    LocalFrame::new(Geodetic {
        latitude_rad: 47.0_f64.to_radians(),
        longitude_rad: 8.0_f64.to_radians(),
        height_m: 0.0,
    })
}

/// Metres from home that the boat has gone straight ahead, and its speed.
fn motion(t: f64) -> [f64; 3] {
    let since = (t - AT_REST_S).max(0.0);
    let speeding_up = since.min(10.0);
    let acceleration = if since > 0.0 && since < 10.0 {
        0.4
    } else {
        0.0
    };
    let way = 0.2 * speeding_up * speeding_up + 4.0 * (since - speeding_up);
    [way, 0.4 * speeding_up, acceleration]
}

/// The boat at `t` seconds.
fn truth(t: f64) -> GnssPosition {
    let [way, ..] = motion(t);
    let ned = Vector3::new(HEADING.cos(), HEADING.sin(), 0.0) * way;
    let Geodetic {
        latitude_rad,
        longitude_rad,
        height_m,
    } = home().geodetic(&ned);
    GnssPosition {
        latitude_rad,
        longitude_rad,
        height_m: Some(height_m),
        ..place(0.0, 0.0)
    }
}

/// A boat at rest that then goes straight; some of its fixes are replaced.
fn voyage(replaced: impl Fn(i64) -> Option<GnssPosition>) -> Vec<Event> {
    let mut events = Vec::new();
    for k in 0..DURATION_S * 50 {
        let time_ns = k * 20_000_000;
        let t = k as f64 * 0.02;
        let [_, speed, acceleration] = motion(t);
        let mut push = |sample| events.push(Event { time_ns, sample });
        push(Sample::AngularRate(Vector3::zeros()));
        push(Sample::SpecificForce(Vector3::new(
            acceleration,
            0.0,
            -9.80665,
        )));
        if k % 50 != 0 {
            continue;
        }
        push(Sample::TrueHeading(TrueHeading {
            heading_rad: HEADING,
            std_rad: Some(0.01),
        }));
        push(Sample::WaterVelocity(WaterVelocity {
            forward_m_s: speed,
            starboard_m_s: Some(0.0),
        }));
        let mut measured = truth(t);
        // A millimetre of noise: at rest, too, the receiver measures again.
        measured.latitude_rad += 1.5e-10 * (k / 50 % 3) as f64;
        push(Sample::GnssPosition(replaced(k / 50).unwrap_or(measured)));
        push(Sample::ReferencePosition(truth(t)));
    }
    events
}

fn run(kind: NavigationKind, events: Vec<Event>) -> Result<NavigationSummary, EvaluationError> {
    let options = NavigationOptions {
        estimator: kind,
        score_from_s: 30.0,
        ..NavigationOptions::default()
    };
    let events = events.into_iter().map(Ok::<_, Infallible>);
    run_navigation(events, "voyage", WorldFrame::Ned, &options, &mut ())
}

/// What the summary says of fixes adds up, and is what was used.
fn check_counts(summary: &NavigationSummary) {
    let aid = summary
        .aids
        .iter()
        .find(|(kind, _)| kind.name() == "gnss-position");
    let (_, aid) = aid.unwrap();
    assert_eq!(summary.fixes_used, aid.updates.fused, "{summary:?}");
    let unusable: u64 = summary.fixes_unusable.values().sum();
    assert_eq!(summary.fixes, summary.fixes_given + unusable);
}

#[test]
fn a_stale_first_fix_does_not_move_the_origin() {
    for kind in ESTIMATORS {
        let clean = run(kind, voyage(|_| None)).unwrap();
        check_counts(&clean);
        assert_eq!(clean.issues, Vec::<String>::new());
        let clean = clean.position.unwrap().horizontal_rmse_m;
        for (stale, km) in [(place(0.01, 0.01), "5,"), (place(40.7, -74.0), "6,")] {
            let summary = run(kind, voyage(|k| (k == 0).then_some(stale))).unwrap();
            check_counts(&summary);
            assert!(summary.fixes_used > 80, "{kind}: {summary:?}");
            assert_eq!(summary.fixes_unusable.values().sum::<u64>(), 1);
            let [issue] = &summary.issues[..] else {
                panic!("{kind}: {:?}", summary.issues)
            };
            let begins = format!("1 fix at 0.0 s is {km}");
            assert!(issue.starts_with(&begins), "{issue}");
            assert!(
                issue.ends_with("00 km from those after it: left out."),
                "{issue}"
            );
            let origin = summary.origin.unwrap();
            assert!((origin.latitude_deg - 47.0).abs() < 1e-3, "{origin:?}");
            let error = summary.position.unwrap().horizontal_rmse_m;
            assert!(error < 1.3 * clean + 0.05, "{kind}: {error} m, {clean} m");
        }
    }
}

#[test]
fn a_place_that_a_receiver_repeats_before_it_finds_itself_is_left_out() {
    for kind in ESTIMATORS {
        let summary = run(kind, voyage(|k| (k < 6).then(|| place(0.01, 0.01)))).unwrap();
        check_counts(&summary);
        assert!(summary.issues[0].starts_with("6 fixes from 0.0 s to 5.0 s are 5,"));
        assert!(summary.position.unwrap().horizontal_rmse_m < 3.0, "{kind}");
    }
}

#[test]
fn one_fix_and_fixes_that_never_agree() {
    let mut one = voyage(|_| None);
    let mut seen = false;
    one.retain(|event| match event.sample {
        Sample::GnssPosition(_) => !core::mem::replace(&mut seen, true),
        _ => true,
    });
    let summary = run(NavigationKind::DeadReckoning, one).unwrap();
    assert_eq!((summary.fixes, summary.fixes_used), (1, 1));
    // Compass and log carry the boat on from it.
    assert!(summary.position.unwrap().horizontal_rmse_m < 5.0);

    let wild = voyage(|k| Some(place(0.5 + (k * 7 % 80) as f64, (k * 37 % 170) as f64)));
    let message = run(NavigationKind::ErrorState, wild)
        .unwrap_err()
        .to_string();
    assert!(message.contains("no two of the 120 fixes"), "{message}");
}

/// Between its epochs a table may have zeros.
#[test]
fn latitudes_and_longitudes_of_zero_are_no_fixes() {
    for kind in ESTIMATORS {
        let summary = run(kind, voyage(|k| (k % 3 != 1).then(|| place(0.0, 0.0)))).unwrap();
        check_counts(&summary);
        let reason = "latitude and longitude are both exactly 0";
        assert_eq!(summary.fixes_unusable, [(reason, 80)].into(), "{kind}");
        assert!(summary.position.unwrap().horizontal_rmse_m < 5.0, "{kind}");
    }
}

#[test]
fn fixes_that_none_is_used_of_are_told_with_what_they_state() {
    let metres = |k: i64| GnssPosition {
        std_m: Some([1500.0, 1500.0, 2000.0]),
        ..truth(k as f64)
    };
    let refused = run(NavigationKind::ErrorState, voyage(|k| Some(metres(k))));
    let message = refused.unwrap_err().to_string();
    assert!(
        message.contains(
            "far out of range; the standard deviations that they state are 1500.000 to 1500.000 m"
        ),
        "{message}"
    );
}
