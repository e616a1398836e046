//! A receiver that is late is scored where it was true; a reference is true when its stamp says so.

#![allow(clippy::unwrap_used)]

use std::convert::Infallible;

use nalgebra::Vector3;
use northing_core::earth::Geodetic;
use northing_core::earth::wgs84::LocalFrame;
use northing_evaluation::navigation::{
    NavigationKind, NavigationOptions, NavigationSummary, run_navigation,
};
use northing_recording::{Event, GnssPosition, GnssQuality, Sample, WorldFrame};

const LATENCY_S: f64 = 0.5;

fn place(frame: &LocalFrame, north: f64) -> GnssPosition {
    let Geodetic {
        latitude_rad,
        longitude_rad,
        height_m,
    } = frame.geodetic(&Vector3::new(north, 0.0, 0.0));
    GnssPosition {
        latitude_rad,
        longitude_rad,
        height_m: Some(height_m),
        std_m: Some([0.1, 0.1, 0.2]),
        hdop: None,
        satellites: None,
        quality: GnssQuality::Autonomous,
    }
}

/// Stands for 5 s, reaches 20 m/s northwards and goes on; fixes are half a second late.
fn drive(has_reference: bool) -> NavigationSummary {
    let frame = LocalFrame::new(Geodetic::from_degrees(47.0, 8.0, 400.0).unwrap());
    let north = |t: f64| {
        let driving = (t - 5.0).max(0.0);
        let faster = driving.min(10.0);
        faster * faster + 20.0 * (driving - faster)
    };
    let mut events = Vec::new();
    for k in 0..6000_i64 {
        let (t, time_ns) = (k as f64 * 0.01, k * 10_000_000);
        let forward = if (5.0..15.0).contains(&t) { 2.0 } else { 0.0 };
        let mut put = |sample| events.push(Ok::<_, Infallible>(Event { time_ns, sample }));
        put(Sample::AngularRate(Vector3::zeros()));
        put(Sample::SpecificForce(Vector3::new(forward, 0.0, -9.806_65)));
        if k % 100 == 0 {
            put(Sample::GnssPosition(place(&frame, north(t - LATENCY_S))));
        }
        if has_reference && k % 100 == 40 {
            put(Sample::ReferencePosition(place(&frame, north(t))));
        }
    }
    let mut options = NavigationOptions {
        estimator: NavigationKind::ErrorState,
        gnss_every: if has_reference { 1 } else { 2 },
        score_from_s: 20.0,
        ..NavigationOptions::default()
    };
    options.parameters.error_state.position_latency_s = LATENCY_S;
    run_navigation(events, "drive", WorldFrame::Ned, &options, &mut ()).unwrap()
}

#[test]
fn latency_is_the_receivers_and_not_the_references() {
    for has_reference in [true, false] {
        let position = drive(has_reference).position.unwrap();
        // At 20 m/s half a second is 10 m.
        let held = position.hold_rmse_m.unwrap();
        let moved_on = position.extrapolation_rmse_m.unwrap();
        assert!(
            position.horizontal_rmse_m < 0.5,
            "{has_reference}: {position:?}"
        );
        assert!(moved_on < 0.5, "{has_reference}: {position:?}");
        let expected = if has_reference { 0.9 * 20.0 } else { 20.0 };
        assert!(
            (held - expected).abs() < 0.5,
            "{has_reference}: {position:?}"
        );
    }
}
