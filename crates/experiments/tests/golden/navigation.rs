//! Navigation estimators on a simulated drive.

use std::convert::Infallible;

use northing_core::earth::Geodetic;
use northing_core::earth::wgs84::LocalFrame;
use northing_core::geometry::rotation;
use northing_evaluation::navigation::{
    NavigationEstimate, NavigationKind, NavigationObserver, NavigationOptions, run_navigation,
};
use northing_recording::{
    Event, GnssPosition, GnssQuality, GnssVelocity, Sample, TrueHeading, WaterVelocity, WorldFrame,
};
use northing_simulation::ground::{Ground, GroundSample, GroundSensors, simulate};

use crate::Trace;

const COLUMNS: &str = "time_s,north_m,east_m,down_m,north_std,east_std,down_std,\
    v_north,v_east,v_down,q_w,q_x,q_y,q_z,heading_std";

struct Rows(Trace);

impl NavigationObserver for Rows {
    fn interval_ns(&self) -> i64 {
        1_500_000_000
    }

    fn estimate(&mut self, estimate: &NavigationEstimate) {
        let std = estimate.position_covariance.diagonal().map(f64::sqrt);
        let q = estimate
            .ned_from_body
            .map_or([None; 4], |q| rotation::to_wxyz(&q).map(Some));
        let vectors = [estimate.position, std, estimate.velocity];
        let numbers = vectors.iter().flat_map(|v| [v.x, v.y, v.z]).map(Some);
        let row = [Some(estimate.time_ns as f64 * 1e-9)]
            .into_iter()
            .chain(numbers)
            .chain(q)
            .chain([estimate.heading_std]);
        self.0.row(row);
    }
}

/// What the sensors say at one instant; a ship's instruments, too, without errors of their own.
fn samples(sample: &GroundSample, frame: &LocalFrame) -> Vec<Sample> {
    let body = sample.ned_from_body.inverse() * sample.velocity;
    let (_, _, yaw) = sample.ned_from_body.euler_angles();
    let mut all = vec![
        Sample::AngularRate(sample.angular_rate),
        Sample::SpecificForce(sample.specific_force),
        Sample::MagneticField(sample.magnetic_field),
        Sample::TrueHeading(TrueHeading {
            heading_rad: yaw,
            std_rad: Some(0.01),
        }),
        Sample::WaterVelocity(WaterVelocity {
            forward_m_s: body.x,
            starboard_m_s: Some(body.y),
        }),
    ];
    if let Some([position, velocity]) = sample.fix {
        let place = frame.geodetic(&position);
        all.push(Sample::GnssPosition(GnssPosition {
            latitude_rad: place.latitude_rad,
            longitude_rad: place.longitude_rad,
            height_m: Some(place.height_m),
            std_m: Some([2.5, 2.5, 5.0]),
            hdop: None,
            satellites: None,
            quality: GnssQuality::Autonomous,
        }));
        all.push(Sample::GnssVelocity(GnssVelocity {
            north_m_s: velocity.x,
            east_m_s: velocity.y,
            down_m_s: Some(velocity.z),
            std_m_s: Some([0.1; 3]),
        }));
    }
    all
}

fn events() -> Vec<Event> {
    let frame = LocalFrame::new(Geodetic::from_degrees(47.0, 8.0, 400.0).unwrap());
    let drive = simulate(Ground::Drive, &GroundSensors::default(), 60.0, 15);
    let of = |sample: &GroundSample| {
        let time_ns = (sample.time_s * 1e9).round() as i64;
        samples(sample, &frame)
            .into_iter()
            .map(move |sample| Event { time_ns, sample })
    };
    drive.iter().flat_map(of).collect()
}

#[test]
fn every_navigation_estimator_as_committed() {
    let events = events();
    for kind in NavigationKind::ALL {
        // It repeats what a recording says.
        if kind == NavigationKind::Device {
            continue;
        }
        let options = NavigationOptions {
            estimator: kind,
            ..NavigationOptions::default()
        };
        let mut rows = Rows(Trace::new(COLUMNS));
        let samples = events.iter().map(|event| Ok::<_, Infallible>(*event));
        run_navigation(samples, "drive", WorldFrame::Ned, &options, &mut rows).unwrap();
        rows.0.check(&format!("navigation_{}", kind.name()));
    }
}
