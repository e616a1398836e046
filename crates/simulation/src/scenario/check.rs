//! What no scenario may say: the rules that types cannot express.

use super::file::ScenarioTables;
use super::schema::{Scenario, StartCross, TrackStart};
use crate::settings::{named_values, rule, rules};

/// Inertial samples of a run: the truth of each is kept, 48 bytes.
const MOST_SAMPLES: f64 = 2e7;

impl ScenarioTables for Scenario {
    fn set_name(&mut self, name: &str) {
        name.clone_into(&mut self.meta.name);
    }

    fn check(&self) -> Result<(), String> {
        self.numbers()?;
        self.sensor_errors()?;
        self.rates()?;
        self.choices()?;
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
    fn numbers(&self) -> Result<(), String> {
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
        let positive = before.into_iter().chain(fixes).chain(after);
        rules(positive, "a finite number above zero", |value| value > 0.0)?;
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
        let finite = finite.into_iter().chain(own).chain(target).chain(velocity);
        rules(finite, "a finite number", |_| true)
    }

    /// Errors that may be there or not.
    fn sensor_errors(&self) -> Result<(), String> {
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
        rules(not_negative, "zero or more", |value| value >= 0.0)?;
        let periods = gps.latency_s * gps.rate_hz;
        let is_whole =
            periods.is_finite() && periods >= 0.0 && (periods - periods.round()).abs() <= 1e-9;
        let expected = "a whole number of periods of the GPS compass, zero or more";
        rule(is_whole, "gps_compass.latency_s", gps.latency_s, expected)?;
        let (lost, expected) = (gps.dropout_probability, "at least 0, below 1");
        rule(
            (0.0..1.0).contains(&lost),
            "gps_compass.dropout_probability",
            lost,
            expected,
        )
    }

    /// Rates must divide, so that all sensors share instants.
    fn rates(&self) -> Result<(), String> {
        let (imu, gps, radar) = (
            self.imu.rate_hz,
            self.gps_compass.rate_hz,
            self.radar.rate_hz,
        );
        let whole = |ratio: f64| ratio >= 1.0 && (ratio - ratio.round()).abs() < 1e-9;
        let expected = "a multiple of gps_compass.rate_hz";
        rule(whole(imu / gps), "imu.rate_hz", imu, expected)?;
        let expected = "a multiple of radar.rate_hz";
        rule(whole(gps / radar), "gps_compass.rate_hz", gps, expected)?;
        let duration_s = self.meta.duration_s;
        let scans = duration_s * radar;
        let duration = |holds, expected| rule(holds, "meta.duration_s", duration_s, expected);
        let expected = "one to a million whole periods of the radar";
        duration(whole(scans) && scans <= 1e6, expected)?;
        let expected = "at most 20 million inertial samples in a run";
        duration(duration_s * imu <= MOST_SAMPLES, expected)?;
        let first = f64::from(self.track_init.first_scored_step);
        let expected = "a step of the run: it ends before";
        rule(
            first <= scans,
            "track_init.first_scored_step",
            first,
            expected,
        )
    }

    fn choices(&self) -> Result<(), String> {
        let zero = |key, value: f64, expected| rule(value.abs() <= 0.0, key, value, expected);
        let (radar, navigation) = (&self.radar, &self.navigation);
        let (key, probability) = ("radar.detection_probability", radar.detection_probability);
        let is_probable = probability > 0.0 && probability <= 1.0;
        rule(is_probable, key, probability, "above 0, at most 1")?;
        let expected = "0: these trackers take every detection for the target";
        zero("radar.clutter_per_scan", radar.clutter_per_scan, expected)?;
        zero("navigation.warmup_s", navigation.warmup_s, "0")?;
        let key = "navigation.initial_bias_estimate";
        zero(key, navigation.initial_bias_estimate, "0")?;
        let noise = self.target.sigma_accel_m_s2;
        rule(
            noise >= 0.0,
            "target.sigma_accel_m_s2",
            noise,
            "zero or more",
        )?;
        let dof = self.nees.dof.unwrap_or(4);
        let expected = "4: position and velocity in two axes";
        rule(dof == 4, "nees.dof", f64::from(dof), expected)?;
        let runs = self.meta.monte_carlo_runs;
        rule(runs > 0, "meta.monte_carlo_runs", 0.0, "at least 1")?;
        let mut spans = self
            .faults
            .iter()
            .map(|fault| (fault.from_s, fault.until_s));
        spans.try_for_each(|(from, until)| {
            rule(from < until, "faults.until_s", until, "later than from_s")
        })
    }
}
