//! The radar scenario over range, precision of the radar and of the compass: where a linearised update is not consistent.

use std::error::Error;

use northing_experiments::radar::{Campaign, CampaignOutcome, Shard, TrackerKind};
use northing_simulation::scenario::ScenarioFile;

const SCENARIO: &str = include_str!("../../../../../scenarios/tracking/wilthil_brekke.toml");

/// Standard deviation of the start velocity that the trackers assume, m/s on each axis.
const VELOCITY_STD_M_S: f64 = 8.0;
/// Where a target is at the start, m.
const RANGES_M: [f64; 6] = [100.0, 500.0, 3600.0, 14_000.0, 36_000.0, 50_000.0];
/// Standard deviations of range, m, and bearing, deg.
const RADARS: [(f64, f64); 4] = [(20.0, 1.0), (1.0, 0.05), (5.0, 5.0), (0.1, 0.2)];
/// Standard deviation of each reading of the compass, deg.
const COMPASSES_DEG: [f64; 4] = [0.0, 1.0, 3.0, 10.0];

/// One setting.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cell {
    pub(crate) range_m: f64,
    pub(crate) range_std_m: f64,
    pub(crate) bearing_std_deg: f64,
    pub(crate) compass_std_deg: f64,
}

impl Cell {
    /// All of them.
    pub(crate) fn all() -> impl Iterator<Item = Self> {
        let each = move |range_m| {
            RADARS
                .into_iter()
                .flat_map(move |(range_std_m, bearing_std_deg)| {
                    COMPASSES_DEG.into_iter().map(move |compass_std_deg| Self {
                        range_m,
                        range_std_m,
                        bearing_std_deg,
                        compass_std_deg,
                    })
                })
        };
        RANGES_M.into_iter().flat_map(each)
    }

    /// A campaign in this setting. The target approaches as fast as it crosses, each as fast as its standard deviation
    /// says, so that NEES has its mean from the start on and at every range.
    pub(crate) fn outcome(
        &self,
        trackers: &[TrackerKind],
        runs: u64,
    ) -> Result<CampaignOutcome, Box<dyn Error>> {
        let (sin, cos) = 0.6_f64.sin_cos();
        let place = [self.range_m * cos, self.range_m * sin];
        let velocity = [
            VELOCITY_STD_M_S * (sin - cos),
            -VELOCITY_STD_M_S * (sin + cos),
        ];
        // An exact compass is one that errs by a hundredth of the finest radar.
        let compass = self.compass_std_deg.max(5e-4);
        let text = format!(
            "{SCENARIO}\n[variant.cell]\ntarget.position_m = {place:?}\ntarget.velocity_m_s = {velocity:?}\n\
             track_init.velocity_std_m_s = {VELOCITY_STD_M_S:?}\n\
             radar.sigma_range_m = {:?}\nradar.sigma_bearing_deg = {:?}\n\
             gps_compass.heading_std_deg = {compass:?}\n",
            self.range_std_m, self.bearing_std_deg,
        );
        let scenario = ScenarioFile::parse("cell.toml", &text)?.scenario(Some("cell"))?;
        let part = Campaign::new(&scenario, trackers, 77, runs)?.run(Shard::WHOLE, &|| ())?;
        Ok(CampaignOutcome::of(&part))
    }
}
