//! Where is the other ship, seen by radar every 4 s from a ship that lies still and whose compass errs by 2 degrees?
//! Asked for: its position and velocity, with deviations that contain the errors of the own ship's navigation.
#![allow(clippy::print_stdout, missing_docs, unreachable_pub)]
use northing_core::kalman::ErrorListener as _;
use northing_core::nalgebra::{UnitQuaternion, Vector3, Vector4};
use northing_core::navigation::{ErrorStateFilter, GnssCompassFix, NavigationState};
use northing_core::tracking::{ConstantVelocity, RadarDetection, RadarNoise};
use northing_core::tracking::{SchmidtKalman, TrackerConfig};

pub fn main() -> Result<(), Box<dyn std::error::Error>> {
    let heading = |error| UnitQuaternion::from_euler_angles(0.0, 0.0, error);
    let start = NavigationState::new(heading(0.03), Vector3::zeros(), Vector3::zeros());
    let start = start.with_std([0.05, 0.5, 1.5, 0.01, 1e-3]);
    let mut navigation = ErrorStateFilter::<f64>::new(Default::default(), start)?;
    let config = TrackerConfig::new(ConstantVelocity::new(0.02), RadarNoise::new(10.0, 0.01));
    let seen = |k: u32| {
        let (north, east) = (2000.0 - 0.5 * f64::from(k), 1000.0_f64);
        RadarDetection::new(north.hypot(east), east.atan2(north))
    };
    let own = navigation.navigation_pose();
    let mut tracker = SchmidtKalman::from_detection(config, &seen(0), 10.0, &own)?;
    for k in 1..=1200 {
        navigation.propagate(&Vector3::zeros(), &Vector3::new(0.0, 0.0, -9.806_65), 0.1)?;
        if k % 20 == 0 {
            let ned_from_body = heading(0.03 * f64::from(k).sin());
            let fix = GnssCompassFix::new(Vector3::zeros(), 1.5, ned_from_body, 0.05);
            navigation.update_gnss_compass(&fix).tell(&mut tracker);
        }
        if k % 40 == 0 {
            tracker.propagated(&navigation.catch_up());
            tracker.scan(4.0, &seen(k), &navigation.navigation_pose());
        }
    }
    let (state, std) = (tracker.track().state, tracker.track().std());
    println!("north, v_north, east, v_east: {:.1?}", state.data.0);
    println!("standard deviations: {:.1?}", std.data.0);
    let off = state - Vector4::new(1400.0, -5.0, 1000.0, 0.0);
    assert!((0..4).all(|i| off[i].abs() < 3.0 * std[i]), "off by {off}");
    Ok(())
}
