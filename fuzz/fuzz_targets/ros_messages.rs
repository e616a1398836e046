//! Messages of ROS of any bytes, of every type and for every use of it: read or refused, never a panic. The first byte chooses.
#![no_main]

use std::collections::BTreeMap;

use libfuzzer_sys::fuzz_target;
use northing_recording::LocalPlace;
use northing_recording::manifest::{Origin, VelocityAxes};
use northing_recording::mcap::{Mounting, Role, StaticTransforms, frame_id, measured};

const ROLES: [Role; 10] = [
    Role::Inertial,
    Role::Field,
    Role::Fix,
    Role::Velocity,
    Role::Pressure,
    Role::Reference,
    Role::DeviceOrientation,
    Role::LocalPosition,
    Role::Position,
    Role::ForwardSpeed,
];

fuzz_target!(|bytes: &[u8]| {
    let Some((first, bytes)) = bytes.split_first() else {
        return;
    };
    let origin = Origin {
        latitude_deg: 48.0,
        longitude_deg: 9.0,
        height_m: 300.0,
    };
    let place = LocalPlace::new(&origin, VelocityAxes::Enu, None, "fuzz").unwrap();
    let role = ROLES[usize::from(first % 16).min(ROLES.len() - 1)];
    let mut transforms = StaticTransforms::default();
    let _ = transforms.take(bytes);
    let frames = [Role::Inertial, Role::Field, Role::Fix];
    let frames: BTreeMap<Role, String> = frames
        .into_iter()
        .zip(["imu", "mag", "gps"])
        .map(|(role, frame)| (role, frame.to_owned()))
        .collect();
    let mounting = Mounting::of_sensors(&transforms, &frames);
    let schema = role.schemas()[usize::from(first / 16) % role.schemas().len()];
    let _ = frame_id(bytes);
    if let Some(events) = measured(role, schema, bytes, 0, Some(&place)) {
        for event in events {
            let _ = mounting.turned_of(role, event);
        }
    }
});
