//! Settings that follow from the sensor: how often it looks, how precisely, how far.
//!
//! A pedestrian before a laser scanner, a boat in a harbour, a ship on the horizon and an aircraft differ by factors of a
//! thousand in length. What they have in common: a sensor is built so that targets move by a few of its standard deviations from one
//! look to the next, and accelerations, which friction bounds, are those of a fraction of gravity for all of them. So times are counted in
//! scans, accelerations stay, and lengths come from the sensor's noise and range: a scene stretched by a factor, with times by
//! its root, is tracked in the same way (`docs/derivations/association.md`, section 8).

use super::{MotionModels, MultiTargetSettings};
use crate::parameters::Table as _;
use crate::scalar::{Scalar, lit};
use crate::tracking::association::ipda::ExistenceModel;
use crate::tracking::own_ship::PoseLimits;

/// Scan interval of the default settings, s.
const USUAL_SCAN_INTERVAL_S: f64 = 2.0;

/// How the sensor that starts tracks sees the scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorScale<T> {
    /// Time from one look at a target to the next, s.
    pub scan_interval_s: T,
    /// Standard deviation of a detection along its range, the echo's place on the target included, m.
    pub position_std_m: T,
    /// Range to which targets are seen, m.
    pub range_m: T,
    /// False detections of a scan in a square metre.
    pub clutter_density: T,
}

impl<T: Scalar> SensorScale<T> {
    /// Motion models for it (Z1): dwell times and turns in scans, accelerations as they are. `None` where a setting would leave its
    /// permitted range, as one of a scan interval of zero does.
    pub fn motion(&self) -> Option<MotionModels<T>> {
        let scans = self.scan_interval_s / lit(USUAL_SCAN_INTERVAL_S);
        let usual = MotionModels::<T>::default();
        // An acceleration that lasts for a while is white noise with the root of that time as a factor.
        let root = scans.max(T::zero()).sqrt();
        let models = MotionModels {
            straight_acceleration_noise_density: usual.straight_acceleration_noise_density * root,
            turning_acceleration_noise_density: usual.turning_acceleration_noise_density * root,
            manoeuvring_acceleration_noise_density: usual.manoeuvring_acceleration_noise_density
                * root,
            straight_dwell_s: usual.straight_dwell_s * scans,
            turning_dwell_s: usual.turning_dwell_s * scans,
            manoeuvring_dwell_s: usual.manoeuvring_dwell_s * scans,
            turn_rate_std_rad_s: usual.turn_rate_std_rad_s / scans,
            turn_rate_time_s: usual.turn_rate_time_s * scans,
        };
        models.check().is_ok().then_some(models)
    }

    /// The other settings for it (Z1 to Z4); `None` as for [`Self::motion`].
    pub fn settings(&self) -> Option<MultiTargetSettings<T>> {
        let interval = self.scan_interval_s;
        let scans = interval / lit(USUAL_SCAN_INTERVAL_S);
        let usual = MultiTargetSettings::<T>::default();
        let by_noise = lit::<T>(2.0) * self.position_std_m;
        let by_range = self.range_m / lit(200.0);
        let by_sensor = (by_noise * by_noise + by_range * by_range).sqrt() / interval;
        // A start whose gate holds more false detections than that is lost among them, whatever it follows.
        let gate = usual.gate_sigmas * usual.birth_speed_tail * interval;
        let alone = T::one() / (T::pi() * self.clutter_density).sqrt() / gate;
        let speed = if alone < by_sensor { alone } else { by_sensor };
        let settings = MultiTargetSettings {
            existence: ExistenceModel {
                lifetime_s: usual.existence.lifetime_s * scans,
                visible_s: usual.existence.visible_s * scans,
                hidden_s: usual.existence.hidden_s * scans,
            },
            pose_limits: PoseLimits {
                speed_m_s: self.range_m / (lit::<T>(5.0) * interval),
                turn_rad_s: usual.pose_limits.turn_rad_s / scans,
                correction_m: lit::<T>(4.0) * self.position_std_m,
            },
            birth_speed_std_m_s: speed,
            largest_position_std_m: lit::<T>(10.0) * speed * interval,
            longest_gap_s: usual.longest_gap_s * scans,
            ..usual
        };
        settings.check().is_ok().then_some(settings)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    /// Laser scanner and pedestrians, harbour radar and boats, coastal radar and ships, aircraft.
    const SENSORS: [[f64; 4]; 4] = [
        [0.1, 0.1, 50.0, 1.5],
        [2.0, 6.0, 700.0, 7.0],
        [2.5, 25.0, 2e4, 10.0],
        [8.0, 80.0, 1e5, 220.0],
    ];

    fn scale([scan_interval_s, position_std_m, range_m, _]: [f64; 4]) -> SensorScale<f64> {
        SensorScale {
            scan_interval_s,
            position_std_m,
            range_m,
            clutter_density: 0.0,
        }
    }

    #[test]
    fn targets_of_every_world_can_be_born() {
        for sensor in SENSORS {
            let (speed, birth) = (sensor[3], scale(sensor).settings().unwrap());
            let sigmas = speed / birth.birth_speed_std_m_s;
            assert!((0.2..4.0).contains(&sigmas), "{sensor:?}: {sigmas}");
            // Known no better than by the first detection and a scan of flight, a track still has a place.
            let young = f64::hypot(sensor[1], birth.birth_speed_std_m_s * sensor[0]);
            assert!(birth.largest_position_std_m > 3.0 * young, "{sensor:?}");
        }
    }

    #[test]
    fn the_usual_scan_has_the_default_motion() {
        let motion = scale([2.0, 5.0, 500.0, 0.0]).motion().unwrap();
        assert_eq!(motion, MotionModels::default());
    }

    #[test]
    fn a_stretched_scene_has_stretched_settings() {
        let [near, far] = [1.0, 40.0].map(|s: f64| {
            let scale = scale([2.0 * s.sqrt(), 6.0 * s, 700.0 * s, 0.0]);
            (scale.motion().unwrap(), scale.settings().unwrap())
        });
        let (s, root) = (40.0, f64::sqrt(40.0));
        let same = |near: f64, factor: f64, far: f64| {
            assert_relative_eq!(near * factor, far, max_relative = 1e-12);
        };
        let ((a, b), (c, d)) = (near, far);
        same(a.straight_dwell_s, root, c.straight_dwell_s);
        same(a.turn_rate_std_rad_s, 1.0 / root, c.turn_rate_std_rad_s);
        let density = |m: &MotionModels<f64>| m.manoeuvring_acceleration_noise_density;
        same(density(&a), root.sqrt(), density(&c));
        same(b.birth_speed_std_m_s, root, d.birth_speed_std_m_s);
        same(b.largest_position_std_m, s, d.largest_position_std_m);
        same(b.existence.hidden_s, root, d.existence.hidden_s);
        same(b.pose_limits.speed_m_s, root, d.pose_limits.speed_m_s);
        same(b.pose_limits.correction_m, s, d.pose_limits.correction_m);
    }

    #[test]
    fn where_false_detections_crowd_the_gate_of_a_new_track_holds_one() {
        let crowded = SensorScale {
            clutter_density: 3.3e-6,
            ..scale([2.5, 25.0, 2e4, 0.0])
        };
        let settings = crowded.settings().unwrap();
        let radius = 3.5 * 3.0 * settings.birth_speed_std_m_s * 2.5;
        assert_relative_eq!(
            std::f64::consts::PI * radius * radius * 3.3e-6,
            1.0,
            epsilon = 1e-9
        );
        let alone = scale([2.5, 25.0, 2e4, 0.0]).settings().unwrap();
        assert!(alone.birth_speed_std_m_s > 3.0 * settings.birth_speed_std_m_s);
    }

    #[test]
    fn a_sensor_that_says_nothing_gives_nothing() {
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(scale([bad, 6.0, 700.0, 0.0]).motion(), None, "{bad}");
            assert_eq!(scale([bad, 6.0, 700.0, 0.0]).settings(), None, "{bad}");
        }
        assert_eq!(scale([2.0, 0.0, 0.0, 0.0]).settings(), None);
        assert_eq!(scale([2.0, f64::NAN, 700.0, 0.0]).settings(), None);
    }
}
