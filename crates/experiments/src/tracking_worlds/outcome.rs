//! What came out over all scenes: a row for each class and tracker, the worst.

use northing_simulation::tracking_world::{SceneClass, SceneDescription};
use serde::Serialize;
use statrs::distribution::{ContinuousCDF as _, StudentsT};

use super::run::{SceneOutcome, TrackerScore};
use crate::scoring::median;

/// A mean over scenes and its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Interval {
    /// The mean.
    pub mean: f64,
    /// Half the width of the interval.
    pub half_width: f64,
}

/// One tracker over scenes that have something in common.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TrackerRow {
    /// What they have in common: a class, or a property.
    pub scenes_with: String,
    /// Name of the tracker.
    pub tracker: &'static str,
    /// How many scenes.
    pub scenes: usize,
    /// GOSPA in cut-offs.
    pub gospa: Interval,
    /// OSPA in cut-offs.
    pub ospa: Interval,
    /// Share of the targets' instants with a track within half a cut-off, the mean over scenes.
    pub coverage: Interval,
    /// Targets, and those of them covered in less than half of their instants.
    pub targets: usize,
    /// The latter.
    pub lost: usize,
    /// Changes of a target's track for each target.
    pub switches: Interval,
    /// Tracks that followed no target for each 100 scans.
    pub false_tracks: Interval,
    /// Scenes in which consistency can be judged.
    pub judged: usize,
    /// Share of these whose ANEES is in its band.
    pub consistent_share: Option<f64>,
    /// Share of these whose ANEES is above it: overconfident.
    pub overconfident_share: Option<f64>,
    /// Median of their ANEES.
    pub median_anees: Option<f64>,
    /// Mean share of their matched instants inside the 95 % ellipse.
    pub inside_95: Option<f64>,
}

/// What came out.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ScenesOutcome {
    /// Seed of the scenes.
    pub seed: u64,
    /// A row for each class and tracker, and for all classes together.
    pub classes: Vec<TrackerRow>,
    /// The default tracker by what scenes have in common.
    pub features: Vec<TrackerRow>,
    /// Numbers of the scenes with the largest GOSPA of the default tracker, the worst first.
    pub worst: Vec<u64>,
    /// Every scene, by number.
    pub scenes: Vec<SceneOutcome>,
}

/// A question that a scene answers with yes or no.
type Question = (&'static str, fn(&SceneDescription) -> bool);

/// What scenes are told apart by.
const FEATURES: [Question; 14] = [
    ("exact own ship", |d| d.own_ship_error.is_none()),
    ("own ship's error told", |d| {
        d.own_ship_error.is_some_and(|error| error.is_told)
    }),
    ("own ship's error not told", |d| {
        d.own_ship_error.is_some_and(|error| !error.is_told)
    }),
    ("one target", |d| d.targets == 1),
    ("8 targets or more", |d| d.targets >= 8),
    ("pairs", |d| d.pairs),
    ("10 false detections or more", |d| {
        d.sensor.clutter_per_scan >= 10.0
    }),
    ("below 3 false detections", |d| {
        d.sensor.clutter_per_scan < 3.0
    }),
    ("crowded false detections", |d| d.sensor.clutter_near),
    ("detected below 0.75", |d| {
        d.sensor.detection_probability < 0.75
    }),
    ("detected above 0.9", |d| {
        d.sensor.detection_probability > 0.9
    }),
    ("detected less far away", |d| d.sensor.fading > 0.0),
    ("echoes that drift", |d| d.sensor.echo_kept > 0.0),
    ("told wrongly", |d| !d.told.is_true()),
];

impl ScenesOutcome {
    /// What these scenes say together.
    #[must_use]
    pub fn of(seed: u64, scenes: Vec<SceneOutcome>) -> Self {
        let trackers: Vec<&'static str> = scenes.first().map_or_else(Vec::new, |scene| {
            scene.trackers.iter().map(|score| score.tracker).collect()
        });
        let all = "all";
        let mut classes = Vec::new();
        for name in SceneClass::ALL
            .map(SceneClass::name)
            .into_iter()
            .chain([all])
        {
            let of_class = |s: &&SceneOutcome| name == all || s.description.class.name() == name;
            let chosen: Vec<_> = scenes.iter().filter(of_class).collect();
            let rows = trackers.iter().enumerate();
            classes.extend(rows.filter_map(|(at, _)| TrackerRow::of(name, &chosen, at)));
        }
        // The default is the last of the trackers.
        let default = trackers.len().saturating_sub(1);
        let feature = |(name, asked): &Question| {
            let having: Vec<_> = scenes.iter().filter(|s| asked(&s.description)).collect();
            TrackerRow::of(name, &having, default)
        };
        let mut by_score: Vec<_> = scenes
            .iter()
            .filter_map(|s| Some((s.trackers.get(default)?.gospa, s.description.number)))
            .collect();
        by_score.sort_by(|a, b| b.0.total_cmp(&a.0));
        Self {
            seed,
            classes,
            features: FEATURES.iter().filter_map(feature).collect(),
            worst: by_score.into_iter().take(10).map(|(_, n)| n).collect(),
            scenes,
        }
    }

    /// The worst scenes, the worst first.
    pub fn worst_scenes(&self) -> impl Iterator<Item = &SceneOutcome> {
        let find = |number: &u64| self.scenes.iter().find(|s| s.description.number == *number);
        self.worst.iter().filter_map(find)
    }
}

impl TrackerRow {
    /// Of the tracker at this place; none without scenes.
    fn of(name: &str, scenes: &[&SceneOutcome], at: usize) -> Option<Self> {
        let pairs: Vec<(&SceneDescription, &TrackerScore)> = scenes
            .iter()
            .filter_map(|scene| Some((&scene.description, scene.trackers.get(at)?)))
            .collect();
        let (_, first) = pairs.first()?;
        let interval =
            |of: fn(&TrackerScore) -> f64| Interval::of(pairs.iter().map(|(_, s)| of(s)));
        let judged: Vec<&TrackerScore> = pairs
            .iter()
            .filter(|(scene, score)| can_be_consistent(scene) && score.anees.is_some())
            .map(|(_, score)| *score)
            .collect();
        let share = |asked: fn(&TrackerScore) -> bool| {
            let count = judged.iter().filter(|s| asked(s)).count();
            (!judged.is_empty()).then(|| count as f64 / judged.len() as f64)
        };
        let inside: Vec<f64> = judged.iter().filter_map(|s| s.inside_95).collect();
        Some(Self {
            scenes_with: name.to_owned(),
            tracker: first.tracker,
            scenes: pairs.len(),
            gospa: interval(|s| s.gospa),
            ospa: interval(|s| s.ospa),
            coverage: interval(|s| s.coverage),
            targets: pairs.iter().map(|(scene, _)| scene.targets).sum(),
            lost: pairs.iter().map(|(_, s)| s.lost).sum(),
            switches: interval(|s| s.switches),
            false_tracks: interval(|s| s.false_tracks),
            judged: judged.len(),
            consistent_share: share(|s| s.is_consistent() == Some(true)),
            overconfident_share: share(|s| s.anees.is_some_and(|anees| anees > s.anees_band[1])),
            median_anees: median(judged.iter().filter_map(|s| s.anees).collect()),
            inside_95: (!inside.is_empty())
                .then(|| inside.iter().sum::<f64>() / inside.len() as f64),
        })
    }
}

/// Whether the tracker is told what it needs to state its errors.
fn can_be_consistent(scene: &SceneDescription) -> bool {
    scene.told.is_noise_true() && scene.own_ship_error.is_none_or(|error| error.is_told)
}

impl Interval {
    fn of(values: impl Iterator<Item = f64> + Clone) -> Self {
        let count = values.clone().count().max(1) as f64;
        let mean = values.clone().sum::<f64>() / count;
        let squares: f64 = values.map(|v| (v - mean) * (v - mean)).sum();
        let variance = squares / (count - 1.0).max(1.0) / count;
        Self {
            mean,
            half_width: quantile_95(count) * variance.sqrt(),
        }
    }
}

/// Half the width of the 95 % interval of a mean of so many numbers, in its standard deviations: Student's t. One number has no interval.
fn quantile_95(count: f64) -> f64 {
    StudentsT::new(0.0, 1.0, count - 1.0).map_or(f64::NAN, |t| t.inverse_cdf(0.975))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interval_of_known_numbers() {
        let interval = Interval::of([1.0, 2.0, 3.0, 4.0].into_iter());
        assert!((interval.mean - 2.5).abs() < 1e-12);
        // Student's t of three degrees of freedom.
        let half = 3.182 * f64::sqrt(5.0 / 3.0 / 4.0);
        assert!((interval.half_width / half - 1.0).abs() < 0.01);
        for (count, t) in [(2.0, 12.706), (3.0, 4.303), (11.0, 2.228), (31.0, 2.042)] {
            assert!((quantile_95(count) / t - 1.0).abs() < 0.01, "{count}");
        }
        assert!(Interval::of([1.0].into_iter()).half_width.is_nan());
    }
}
