//! Scenes have what their descriptions say.

#![allow(clippy::unwrap_used)]

use northing_recording::tracking::{Detection, TrackingSample};

use super::*;

/// The first scenes of all classes.
fn worlds() -> impl Iterator<Item = TrackingScene> {
    (0..48).map(|number| TrackingScene::draw(3, number))
}

fn events(world: &TrackingScene) -> impl Iterator<Item = &TrackingSample> {
    world.recording.events.iter().map(|event| &event.sample)
}

#[test]
fn a_scene_is_the_same_each_time_and_no_two_are() {
    let [one, again, other] = [(1, 5), (1, 5), (2, 5)].map(|(s, n)| TrackingScene::draw(s, n));
    assert_eq!(one, again);
    assert_ne!(one.recording.events, other.recording.events);
    assert_ne!(one.description.sensor, other.description.sensor);
}

#[test]
fn numbers_are_finite_and_targets_in_range() {
    for world in worlds() {
        let sensor = world.description.sensor;
        let mut own = OwnShipPose::default();
        assert!(world.description.cutoff_m > 2.0 * sensor.range_std_m);
        for event in events(&world) {
            match event {
                TrackingSample::OwnShip(pose) => own = *pose,
                TrackingSample::Scan(scan) => {
                    for detection in &scan.detections {
                        let Detection::RangeBearing { range_m, .. } = *detection else {
                            panic!("{detection:?}");
                        };
                        assert!(range_m > 0.0 && range_m < 1.2 * sensor.range_m);
                    }
                }
                TrackingSample::Truth(truth) if world.description.own_ship_error.is_none() => {
                    let range = (truth.north_m - own.north_m).hypot(truth.east_m - own.east_m);
                    assert!(range <= sensor.range_m, "{range}");
                }
                _ => {}
            }
        }
    }
}

#[test]
fn targets_are_no_faster_than_their_class() {
    for world in worlds() {
        let class = world.description.class;
        // Companions that cross move against their leader.
        if world.description.pairs {
            continue;
        }
        let interval = world.description.sensor.scan_interval_s;
        let mut before = std::collections::BTreeMap::new();
        for event in events(&world) {
            let TrackingSample::Truth(truth) = event else {
                continue;
            };
            let place = [truth.north_m, truth.east_m];
            let Some((scan, last)) = before.insert(truth.target, (truth.scan, place)) else {
                continue;
            };
            let way = (place[0] - last[0]).hypot(place[1] - last[1]);
            let speed = way / ((truth.scan - scan) as f64 * interval);
            let top = motion::top_speed_m_s(class);
            assert!(speed < 1.001 * top, "{class:?} {speed}");
        }
    }
}

#[test]
fn as_many_false_detections_and_misses_as_described() {
    for world in worlds() {
        let about = &world.description;
        let (mut detections, mut present) = (0, 0);
        for event in events(&world) {
            match event {
                TrackingSample::Scan(scan) => detections += scan.detections.len(),
                TrackingSample::Truth(_) => present += 1,
                _ => {}
            }
        }
        let clutter = about.sensor.clutter_per_scan * about.scans as f64;
        let p = about.sensor.detection_probability;
        let most = clutter + p * f64::from(present);
        // Fading takes up to 0.4, a shadow 25 scans of a target.
        let least = clutter + 0.6 * p * (f64::from(present) - 25.0 * about.targets as f64).max(0.0);
        let chance = 5.0 * most.sqrt() + 5.0;
        let found = detections as f64;
        assert!(
            (least - chance..most + chance).contains(&found),
            "{}: {least} {found} {most}",
            about.number
        );
    }
}

#[test]
fn the_error_of_the_pose_has_its_standard_deviation() {
    let error = OwnShipError {
        position_std_m: 3.0,
        heading_std_deg: 2.0,
        correlation_scans: 5.0,
        is_told: true,
    };
    let mut walk = error.walk(Draws::new(7, "walk"));
    let (mut north, mut heading) = (0.0, 0.0);
    for _ in 0..20_000 {
        let pose = walk.next(OwnShipPose::default());
        north += pose.north_m * pose.north_m;
        heading += pose.heading_rad.to_degrees().powi(2);
        assert!((pose.std.unwrap()[0] - 3.0).abs() < 1e-12);
    }
    assert!((f64::sqrt(north / 2e4) - 3.0).abs() < 0.15);
    assert!((f64::sqrt(heading / 2e4) - 2.0).abs() < 0.1);
}
