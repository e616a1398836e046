//! The motion that all wire fixtures encode, and the comparison with it.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use northing_recording::{Event, Sample, SensorKind};

/// One row of the truth.
struct Row {
    rate: Vector3<f64>,
    force: Vector3<f64>,
    field: Vector3<f64>,
    attitude: UnitQuaternion<f64>,
}

/// The truth, by time from its start, ns.
pub(crate) struct Truth(BTreeMap<i64, Row>);

/// The largest error of a component, or of the angle.
pub(crate) struct Tolerance {
    pub(crate) rate_rad_s: f64,
    pub(crate) force_m_s2: f64,
    pub(crate) field_ut: f64,
    pub(crate) attitude_rad: f64,
    pub(crate) heading_rad: f64,
}

impl Truth {
    pub(crate) fn read(dir: &Path) -> Self {
        let text = fs::read_to_string(dir.join("truth.csv")).expect("the truth is there");
        let rows = text.lines().skip(1).map(|line| {
            let v: Vec<f64> = line
                .split(',')
                .map(|cell| cell.parse().expect("a number"))
                .collect();
            let row = Row {
                rate: Vector3::new(v[1], v[2], v[3]),
                force: Vector3::new(v[4], v[5], v[6]),
                field: Vector3::new(v[7], v[8], v[9]),
                attitude: UnitQuaternion::new_normalize(Quaternion::new(
                    v[10], v[11], v[12], v[13],
                )),
            };
            ((v[0] * 1e9).round() as i64, row)
        });
        let truth = Self(rows.collect());
        assert_eq!(truth.0.len(), 301);
        truth
    }

    /// Compares the events that fall on a row of the truth (which starts at `start_ns` on their
    /// clock); how many of each sensor did.
    pub(crate) fn assert_equal(
        &self,
        events: &[Event],
        start_ns: i64,
        tolerance: &Tolerance,
    ) -> BTreeMap<SensorKind, usize> {
        let mut seen = BTreeMap::new();
        for event in events {
            // Some devices cut their stamps to a microsecond's fraction.
            let near_ns = event.time_ns - start_ns;
            let Some((_, row)) = self.0.range(near_ns - 1000..=near_ns + 1000).next() else {
                continue;
            };
            let (error, most) = match &event.sample {
                Sample::AngularRate(v) => ((v - row.rate).amax(), tolerance.rate_rad_s),
                Sample::SpecificForce(v) => ((v - row.force).amax(), tolerance.force_m_s2),
                Sample::MagneticField(v) => ((v - row.field).amax(), tolerance.field_ut),
                Sample::DeviceOrientation(q) => {
                    let difference = row.attitude.inverse() * q;
                    let angle = 2.0 * difference.imag().norm().min(1.0).asin();
                    (angle, tolerance.attitude_rad)
                }
                Sample::CompassHeading(c) => {
                    let top = row.attitude * Vector3::y();
                    let apart = c.heading_rad - top.x.atan2(top.y);
                    (apart.sin().atan2(apart.cos()).abs(), tolerance.heading_rad)
                }
                other => panic!("{other:?} is not in the truth"),
            };
            assert!(
                error <= most,
                "{:?} at {near_ns} ns is {error:e} off, more than {most:e}",
                event.sample
            );
            *seen.entry(event.sample.kind()).or_default() += 1;
        }
        seen
    }
}
