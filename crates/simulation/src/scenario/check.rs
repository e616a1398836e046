//! What no scenario may say: the rules that types cannot express.

use super::file::ScenarioTables;
use super::schema::{Scenario, StartCross, TrackStart};
use crate::settings::named_values;

/// A key, its value, and what was expected.
type Complaint = (&'static str, f64, &'static str);

/// Inertial samples of a run: the truth of each is kept, 48 bytes.
const MOST_SAMPLES: f64 = 2e7;

impl ScenarioTables for Scenario {
    fn set_name(&mut self, name: &str) {
        name.clone_into(&mut self.meta.name);
    }

    fn check(&self) -> Result<(), String> {
        let complaint = self
            .numbers()
            .or_else(|| self.sensor_errors())
            .or_else(|| self.rates())
            .or_else(|| self.choices());
        if let Some((key, value, expected)) = complaint {
            return Err(format!("{key} is {value}, expected {expected}"));
        }
        let correlated = self.track_init.cross_covariance == StartCross::FromConversion;
        if correlated && self.track_init.mode == TrackStart::Prior {
            return Err("track_init.cross_covariance is \"from_conversion\", expected \"zero\" with mode = \"prior\"".to_owned());
        }
        let bad = self.ownship.manoeuvres.iter().find_map(|m| m.problem());
        if let Some(problem) = bad {
            return Err(format!("ownship.manoeuvres: {problem}"));
        }
        Ok(())
    }
}

impl Scenario {
    fn numbers(&self) -> Option<Complaint> {
        let before = named_values![self =>
            meta.duration_s,
            imu.rate_hz,
            imu.sigma_accel_m_s2,
            imu.sigma_gyro_deg_s,
            imu.accel_bias_std_m_s2,
            imu.gyro_bias_std_deg_s,
            gps_compass.rate_hz,
        ];
        let fixes = self
            .gps_compass
            .position_std_m
            .map(|std| ("gps_compass.position_std_m", std));
        let after = named_values![self =>
            gps_compass.heading_std_deg,
            gps_compass.roll_pitch_std_deg,
            navigation.initial_velocity_std_m_s,
            navigation.noise_factor,
            radar.rate_hz,
            radar.sigma_range_m,
            radar.sigma_bearing_deg,
            track_init.velocity_std_m_s,
            track_init.position_std_m,
            blackbox.tau_heading_s,
            blackbox.tau_position_s,
            ownship.roll_period_s,
            ownship.pitch_period_s,
        ];
        let bad = |value: f64| !(value.is_finite() && value > 0.0);
        let mut positive = before.into_iter().chain(fixes).chain(after);
        let found = positive.find(|(_, value)| bad(*value));
        if let Some((key, value)) = found {
            return Some((key, value, "a finite number above zero"));
        }
        let finite = named_values![self =>
            meta.gravity_m_s2,
            ownship.heading_deg,
            ownship.speed_m_s,
            ownship.turn_start_s,
            ownship.turn_rate_deg_s,
            ownship.turn_angle_deg,
            target.sigma_accel_m_s2,
        ];
        let own = self.ownship.position_m.map(|x| ("ownship.position_m", x));
        let target = self.target.position_m.map(|x| ("target.position_m", x));
        let velocity = self.target.velocity_m_s.map(|x| ("target.velocity_m_s", x));
        let mut all = finite.into_iter().chain(own).chain(target).chain(velocity);
        let found = all.find(|(_, value)| !value.is_finite());
        found.map(|(key, value)| (key, value, "a finite number"))
    }

    /// Errors that may be there or not.
    fn sensor_errors(&self) -> Option<Complaint> {
        let gps = &self.gps_compass;
        let not_negative = named_values![self =>
            imu.accel_bias_random_walk_m_s2_sqrt_s,
            imu.gyro_bias_random_walk_deg_s_sqrt_s,
            imu.accel_scale_error_std,
            imu.gyro_scale_error_std,
            imu.accel_resolution_m_s2,
            imu.gyro_resolution_deg_s,
            imu.accel_range_m_s2,
            imu.gyro_range_deg_s,
        ];
        let bad = |value: f64| !(value.is_finite() && value >= 0.0);
        if let Some((key, value)) = not_negative.into_iter().find(|(_, value)| bad(*value)) {
            return Some((key, value, "zero or more"));
        }
        let periods = gps.latency_s * gps.rate_hz;
        if bad(periods) || (periods - periods.round()).abs() > 1e-9 {
            let expected = "a whole number of periods of the GPS compass, zero or more";
            return Some(("gps_compass.latency_s", gps.latency_s, expected));
        }
        let lost = gps.dropout_probability;
        let expected = "at least 0, below 1";
        (!(0.0..1.0).contains(&lost)).then_some(("gps_compass.dropout_probability", lost, expected))
    }

    /// Rates must divide, so that all sensors share instants.
    fn rates(&self) -> Option<Complaint> {
        let (imu, gps) = (self.imu.rate_hz, self.gps_compass.rate_hz);
        let radar = self.radar.rate_hz;
        let whole = |ratio: f64| ratio >= 1.0 && (ratio - ratio.round()).abs() < 1e-9;
        if !whole(imu / gps) {
            return Some(("imu.rate_hz", imu, "a multiple of gps_compass.rate_hz"));
        }
        if !whole(gps / radar) {
            return Some(("gps_compass.rate_hz", gps, "a multiple of radar.rate_hz"));
        }
        let scans = self.meta.duration_s * radar;
        if !whole(scans) || scans > 1e6 {
            return Some((
                "meta.duration_s",
                self.meta.duration_s,
                "one to a million whole periods of the radar",
            ));
        }
        if self.meta.duration_s * imu > MOST_SAMPLES {
            let expected = "at most 20 million inertial samples in a run";
            return Some(("meta.duration_s", self.meta.duration_s, expected));
        }
        let first = f64::from(self.track_init.first_scored_step);
        (first > scans).then_some((
            "track_init.first_scored_step",
            first,
            "a step of the run: it ends before",
        ))
    }

    fn choices(&self) -> Option<Complaint> {
        let probability = self.radar.detection_probability;
        let not_negative = |value: f64| value >= 0.0;
        if !(probability > 0.0 && probability <= 1.0) {
            let key = "radar.detection_probability";
            return Some((key, probability, "above 0, at most 1"));
        }
        if self.radar.clutter_per_scan.abs() > 0.0 {
            let clutter = self.radar.clutter_per_scan;
            let key = "radar.clutter_per_scan";
            return Some((
                key,
                clutter,
                "0: these trackers take every detection for the target",
            ));
        }
        if self.navigation.warmup_s.abs() > 0.0 {
            let key = "navigation.warmup_s";
            return Some((key, self.navigation.warmup_s, "0"));
        }
        if self.navigation.initial_bias_estimate.abs() > 0.0 {
            let key = "navigation.initial_bias_estimate";
            return Some((key, self.navigation.initial_bias_estimate, "0"));
        }
        if !not_negative(self.target.sigma_accel_m_s2) {
            let key = "target.sigma_accel_m_s2";
            return Some((key, self.target.sigma_accel_m_s2, "zero or more"));
        }
        let dof = self
            .nees
            .dof
            .map(f64::from)
            .filter(|dof| (dof - 4.0).abs() > 0.0);
        if let Some(dof) = dof {
            return Some(("nees.dof", dof, "4: position and velocity in two axes"));
        }
        if self.meta.monte_carlo_runs == 0 {
            return Some(("meta.monte_carlo_runs", 0.0, "at least 1"));
        }
        let later = |from: f64, until: f64| from < until;
        let fault = self.faults.iter().find(|f| !later(f.from_s, f.until_s));
        fault.map(|fault| ("faults.until_s", fault.until_s, "later than from_s"))
    }
}
