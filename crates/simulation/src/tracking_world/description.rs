//! What a scene has, in words.

use std::fmt;

use super::SceneDescription;

impl SceneDescription {
    /// What makes it hard, item by item: for tables.
    #[must_use]
    pub fn features(&self) -> Vec<String> {
        let sensor = &self.sensor;
        let mut features = vec![
            format!("{} targets", self.targets),
            format!("{:.1} false detections a scan", sensor.clutter_per_scan),
            format!("detected {:.2}", sensor.detection_probability),
        ];
        let mut put = |is_so: bool, what: &str| {
            if is_so {
                features.push(what.to_owned());
            }
        };
        put(self.pairs, "pairs");
        put(sensor.fading > 0.0, "detected less far away");
        put(sensor.clutter_near, "false detections crowded near");
        put(sensor.echo_kept > 0.0, "echoes that drift");
        if let Some(error) = &self.own_ship_error {
            let told = if error.is_told { "" } else { ", not told" };
            features.push(format!(
                "own ship {:.2} deg and {:.3} m off{told}",
                error.heading_std_deg, error.position_std_m
            ));
        }
        if !self.told.is_true() {
            features.push(format!(
                "told noise {:.2}, misses {:.2}, false detections {:.2} times the true ones",
                self.told.noise_ratio, self.told.miss_ratio, self.told.clutter_ratio
            ));
        }
        features
    }
}

impl fmt::Display for SceneDescription {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let sensor = &self.sensor;
        writeln!(
            f,
            "Scene {}: {}, {} scans, one in {:.2} s, to {:.0} m, {:.3} m and {:.2} deg (one sigma), echoes {:.2} m",
            self.number,
            self.class.name(),
            self.scans,
            sensor.scan_interval_s,
            sensor.range_m,
            sensor.range_std_m,
            sensor.bearing_std_deg,
            sensor.extent_std_m,
        )?;
        write!(f, "{}", self.features().join("; "))
    }
}
