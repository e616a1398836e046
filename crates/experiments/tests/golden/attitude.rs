//! Attitude estimators on a virtual phone that rests and is then turned briskly.

use std::convert::Infallible;

use nalgebra::Vector3;
use northing_core::geometry::rotation;
use northing_evaluation::{EstimateRecord, EstimatorKind, Profile, RunObserver, RunOptions, run};
use northing_recording::{Event, Sample};
use northing_simulation::virtual_phone::{Disturbance, Motion};
use northing_simulation::{VirtualPhone, VirtualPhoneConfig};

use crate::Trace;

const COLUMNS: &str = "time_s,q_w,q_x,q_y,q_z,std_x,std_y,std_z,bias_x,bias_y,bias_z,\
    bias_std_x,bias_std_y,bias_std_z,east_m,north_m,up_m,v_east,v_north,v_up";
/// Time between two rows, ns.
const EVERY_NS: i64 = 500_000_000;

/// Rows at even times.
struct Rows {
    trace: Trace,
    next_ns: i64,
}

impl RunObserver for Rows {
    fn estimate(&mut self, record: &EstimateRecord) {
        if record.time_ns < self.next_ns {
            return;
        }
        self.next_ns = record.time_ns + EVERY_NS;
        let root = |v: Vector3<f64>| v.map(f64::sqrt);
        let three = |v: Option<Vector3<f64>>| -> [Option<f64>; 3] {
            v.map_or([None; 3], |v| [Some(v.x), Some(v.y), Some(v.z)])
        };
        let bias = record.gyroscope_bias;
        let row = [Some(record.time_s)]
            .into_iter()
            .chain(rotation::to_wxyz(&record.attitude).map(Some))
            .chain(three(
                record.attitude_covariance.map(|p| root(p.diagonal())),
            ))
            .chain(three(bias.map(|(bias, _)| bias)))
            .chain(three(bias.map(|(_, p)| root(p.diagonal()))))
            .chain(three(record.position))
            .chain(three(record.velocity));
        self.trace.row(row);
    }
}

/// Twenty seconds with shaking, magnetic disturbance, and a fix once a second for those who take them.
fn events() -> Vec<Event> {
    let phone = VirtualPhone::new(VirtualPhoneConfig {
        seed: 15,
        motion: Motion::Brisk,
        disturbance: Disturbance::Both,
        rest_before_s: 3.0,
        motion_s: 15.0,
        rest_after_s: 2.0,
        ..VirtualPhoneConfig::default()
    })
    .unwrap();
    let mut events: Vec<Event> = phone.events().collect();
    for k in 0..20_i64 {
        let t = k as f64;
        let place = Vector3::new((0.3 * t).sin(), 0.5 * (0.2 * t).cos(), 0.1 * t);
        events.push(Event {
            time_ns: k * 1_000_000_000,
            sample: Sample::Position(place),
        });
    }
    events.sort_by_key(|event| event.time_ns);
    events
}

#[test]
fn every_attitude_estimator_as_committed() {
    let events = events();
    for kind in EstimatorKind::ALL {
        let options = RunOptions::new(kind, Profile::HandHeld);
        let mut rows = Rows {
            trace: Trace::new(COLUMNS),
            next_ns: 0,
        };
        let samples = events.iter().map(|event| Ok::<_, Infallible>(*event));
        run(samples, &options, &mut rows).unwrap();
        rows.trace.check(&format!("attitude_{}", kind.name()));
    }
}
