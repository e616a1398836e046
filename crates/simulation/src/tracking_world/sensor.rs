//! The sensor of a scene, and what a tracker is told of it.

use std::f64::consts::PI;

use northing_recording::tracking::{Detection, SensorSettings};
use serde::Serialize;

use super::{OwnShipError, SceneClass};
use crate::signals::{Draws, exponential};

/// A sensor of ranges and bearings.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SceneSensor {
    /// From one scan to the next, s.
    pub scan_interval_s: f64,
    /// Standard deviation of a range, m.
    pub range_std_m: f64,
    /// Of a bearing, deg.
    pub bearing_std_deg: f64,
    /// Of the echo's place on the target on each axis, m.
    pub extent_std_m: f64,
    /// Share of that which is kept from scan to scan; 0: new each time.
    pub echo_kept: f64,
    /// How far it sees, m.
    pub range_m: f64,
    /// Probability that a target close by is detected in a scan.
    pub detection_probability: f64,
    /// Share of it that is lost at the end of the range.
    pub fading: f64,
    /// Mean of the false detections in a scan.
    pub clutter_per_scan: f64,
    /// Whether they are crowded near the own ship, even over the range instead of over the area.
    pub clutter_near: bool,
}

/// What a tracker is told of the sensor.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SensorTold {
    /// Told standard deviations of range and bearing over the true ones.
    pub noise_ratio: f64,
    /// Told probability of a miss over the mean true one over the area.
    pub miss_ratio: f64,
    /// Told density of false detections over the mean true one.
    pub clutter_ratio: f64,
}

/// What sensors of a class are drawn from: lowest and highest.
struct Bounds {
    scan_interval_s: [f64; 2],
    range_std_m: [f64; 2],
    bearing_std_deg: [f64; 2],
    extent_std_m: [f64; 2],
    range_m: [f64; 2],
}

impl Bounds {
    const fn of(class: SceneClass) -> Self {
        let [
            scan_interval_s,
            range_std_m,
            bearing_std_deg,
            extent_std_m,
            range_m,
        ] = match class {
            SceneClass::Pedestrians => [
                [0.05, 0.2],
                [0.02, 0.15],
                [0.1, 1.5],
                [0.08, 0.2],
                [15.0, 80.0],
            ],
            SceneClass::Boats => [
                [1.0, 3.0],
                [2.0, 10.0],
                [0.4, 2.0],
                [0.5, 4.0],
                [300.0, 2e3],
            ],
            SceneClass::Ships => [
                [2.0, 4.0],
                [10.0, 50.0],
                [0.2, 1.0],
                [5.0, 30.0],
                [8e3, 24e3],
            ],
            SceneClass::Aircraft => [
                [4.0, 12.0],
                [30.0, 150.0],
                [0.05, 0.25],
                [3.0, 10.0],
                [60e3, 200e3],
            ],
        };
        Self {
            scan_interval_s,
            range_std_m,
            bearing_std_deg,
            extent_std_m,
            range_m,
        }
    }
}

impl SceneSensor {
    /// `echo` is drawn from for the echoes alone.
    pub(super) fn draw(class: SceneClass, draws: &mut Draws, echo: &mut Draws) -> Self {
        let bounds = Bounds::of(class);
        let mut between = |[low, high]: [f64; 2]| draws.log_uniform(low, high);
        let [
            scan_interval_s,
            range_std_m,
            bearing_std_deg,
            extent_std_m,
            range_m,
        ] = [
            bounds.scan_interval_s,
            bounds.range_std_m,
            bounds.bearing_std_deg,
            bounds.extent_std_m,
            bounds.range_m,
        ]
        .map(&mut between);
        let clutter_per_scan = between([0.3, 30.0]);
        Self {
            scan_interval_s,
            range_std_m,
            bearing_std_deg,
            extent_std_m,
            range_m,
            clutter_per_scan,
            echo_kept: if draws.chance(0.3) {
                exponential(-1.0 / echo.log_uniform(3.0, 50.0))
            } else {
                0.0
            },
            detection_probability: draws.uniform(0.6, 0.98),
            fading: if draws.chance(0.25) { 0.4 } else { 0.0 },
            clutter_near: draws.chance(0.3),
        }
    }

    /// Probability of detection at this range.
    pub(super) fn probability_at(&self, range_m: f64) -> f64 {
        let share = range_m / self.range_m;
        self.detection_probability * (1.0 - self.fading * share * share)
    }

    /// The same, the mean over the area.
    fn mean_probability(&self) -> f64 {
        self.detection_probability * (1.0 - 0.5 * self.fading)
    }

    /// Variance of a detection's place over both axes at a squared range (m^2), with that of the own ship's pose, m^2.
    pub(super) fn place_variance(&self, square: f64, own: Option<OwnShipError>) -> f64 {
        let (position, heading) = own.map_or((0.0, 0.0), |own| {
            (own.position_std_m, own.heading_std_deg.to_radians())
        });
        let bearing = self.bearing_std_deg.to_radians();
        self.range_std_m.powi(2)
            + 2.0 * (self.extent_std_m.powi(2) + position.powi(2))
            + square * (bearing.powi(2) + heading.powi(2))
    }

    /// Those of one scan.
    pub(super) fn false_detections(&self, draws: &mut Draws) -> Vec<Detection> {
        let count = poisson(self.clutter_per_scan, draws);
        let one = |_| {
            // Not at the own ship, where a bearing is none.
            let share = draws.uniform(1e-3, 1.0);
            let share = if self.clutter_near {
                share
            } else {
                share.sqrt()
            };
            Detection::RangeBearing {
                range_m: self.range_m * share,
                bearing_rad: draws.uniform(-PI, PI),
            }
        };
        (0..count).map(one).collect()
    }
}

/// A number of events that happen independently, with this mean.
fn poisson(mean: f64, draws: &mut Draws) -> usize {
    let (mut count, mut waited) = (0, -crate::signals::logarithm(draws.uniform(1e-300, 1.0)));
    while waited < mean {
        count += 1;
        waited -= crate::signals::logarithm(draws.uniform(1e-300, 1.0));
    }
    count
}

fn is_one(ratio: f64) -> bool {
    (ratio - 1.0).abs() < f64::EPSILON
}

impl SensorTold {
    pub(super) fn draw(sensor: &SceneSensor, draws: &mut Draws) -> Self {
        if !draws.chance(1.0 / 3.0) {
            return Self {
                noise_ratio: 1.0,
                miss_ratio: 1.0,
                clutter_ratio: 1.0,
            };
        }
        let misses = 1.0 - sensor.mean_probability();
        Self {
            noise_ratio: draws.log_uniform(0.6, 1.6),
            // No probability above 0.99 or below 0.4.
            miss_ratio: draws
                .log_uniform(0.5, 2.0)
                .clamp(0.01 / misses, 0.6 / misses),
            clutter_ratio: draws.log_uniform(1.0 / 3.0, 3.0),
        }
    }

    /// Whether all of it is true.
    #[must_use]
    pub fn is_true(&self) -> bool {
        let ratios = [self.noise_ratio, self.miss_ratio, self.clutter_ratio];
        ratios.into_iter().all(is_one)
    }

    /// Whether the noise is.
    #[must_use]
    pub fn is_noise_true(&self) -> bool {
        is_one(self.noise_ratio)
    }

    /// As a manifest says it.
    pub(super) fn settings(&self, sensor: &SceneSensor) -> SensorSettings {
        let area_km2 = PI * (sensor.range_m * 1e-3).powi(2);
        SensorSettings {
            range_std_m: sensor.range_std_m * self.noise_ratio,
            bearing_std_deg: sensor.bearing_std_deg * self.noise_ratio,
            extent_std_m: sensor.extent_std_m,
            detection_probability: 1.0 - self.miss_ratio * (1.0 - sensor.mean_probability()),
            clutter_per_km2: Some(self.clutter_ratio * sensor.clutter_per_scan / area_km2),
            clutter_per_rad: None,
            largest_range_m: sensor.range_m,
            covers_all: true,
            initiates: true,
            used: true,
        }
    }
}
