//! What a run told, kept in memory to be played: estimates at most 60 times a second, innovations, fixes and lamps.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use northing_core::earth::LocalFrame;
use northing_core::kalman::{Innovation, Outcome};
use northing_core::navigation::Validity;
use northing_evaluation::navigation::{AidKind, NavigationEstimate, NavigationObserver};
use northing_evaluation::statistics::lamp::{LampWindow, Remark};
use northing_evaluation::statistics::thinned::Thinned;
use northing_evaluation::{EstimateRecord, InnovationRecord, RunObserver, RunOptions};
use northing_recording::{SensorKind, TrackPoint, WorldFrame};

use crate::topics::Told;

/// An estimate is kept when the last one is so old, ns: a viewer draws 60 a second.
const ESTIMATES_EVERY: i64 = 15_000_000;
/// Estimates, and innovations of a sensor, that are kept: an hour of the first. Of more every second one is.
const MOST: usize = 216_000;

/// What a run told, in the order of time.
#[derive(Debug, Default)]
pub struct PlayedRun {
    told: Vec<(i64, Told)>,
}

impl PlayedRun {
    fn new(mut told: Vec<(i64, Told)>) -> Self {
        // Stable: what was told of one instant stays in its order.
        told.sort_by_key(|(time_ns, _)| *time_ns);
        Self { told }
    }

    /// First and last stamp, ns; `None` where nothing was told.
    #[must_use]
    pub fn span_ns(&self) -> Option<[i64; 2]> {
        Some([self.told.first()?.0, self.told.last()?.0])
    }

    /// Everything, with its stamps, ns.
    pub(crate) fn all(&self) -> &[(i64, Told)] {
        &self.told
    }

    /// What was told after the first instant and not after the second.
    pub(crate) fn between(&self, [from, to]: [i64; 2]) -> &[(i64, Told)] {
        let after = |instant: i64| {
            self.told
                .partition_point(|(time_ns, _)| *time_ns <= instant)
        };
        let (from, to) = (after(from), after(to));
        &self.told[from.min(to)..to]
    }

    /// The state at an instant: the newest of each subject.
    pub(crate) fn state_at(&self, time_ns: i64) -> Vec<&(i64, Told)> {
        let mut newest = BTreeMap::new();
        for entry in &self.told[..self.told.partition_point(|(t, _)| *t <= time_ns)] {
            newest.insert(entry.1.subject(), entry);
        }
        newest.into_values().collect()
    }
}

/// Estimates at the rate of a viewer.
#[derive(Debug)]
struct Estimates {
    kept: Thinned<(i64, Told)>,
    last_ns: Option<i64>,
}

impl Estimates {
    fn new() -> Self {
        Self {
            kept: Thinned::new(MOST),
            last_ns: None,
        }
    }

    /// Whether one of this time is to be kept.
    fn is_due(&mut self, time_ns: i64) -> bool {
        let since = |last: i64| time_ns.saturating_sub(last);
        if self
            .last_ns
            .is_some_and(|last| since(last) < ESTIMATES_EVERY)
        {
            return false;
        }
        self.last_ns = Some(time_ns);
        true
    }
}

fn all<'a>(series: impl IntoIterator<Item = &'a Thinned<(i64, Told)>>) -> Vec<(i64, Told)> {
    let items = series.into_iter().flat_map(Thinned::items);
    items.cloned().collect()
}

/// Keeps an attitude run.
#[derive(Debug)]
pub struct AttitudeRecorder {
    world: WorldFrame,
    estimates: Estimates,
    biases: Thinned<(i64, Told)>,
    innovations: BTreeMap<SensorKind, Thinned<(i64, Told)>>,
    windows: Vec<(SensorKind, LampWindow)>,
    lamps: Vec<(i64, Told)>,
}

impl AttitudeRecorder {
    /// For a run with these options over a recording in this frame.
    #[must_use]
    pub fn new(options: &RunOptions, world: WorldFrame) -> Self {
        let window = |sensor: SensorKind| {
            let lasts = options.correlation_time_s(sensor)?;
            Some((sensor, LampWindow::new(sensor, lasts)))
        };
        Self {
            world,
            estimates: Estimates::new(),
            biases: Thinned::new(MOST),
            innovations: BTreeMap::new(),
            windows: SensorKind::ALL.into_iter().filter_map(window).collect(),
            lamps: Vec::new(),
        }
    }

    /// What was kept.
    #[must_use]
    pub fn finish(self) -> PlayedRun {
        let series = [&self.estimates.kept, &self.biases];
        let mut told = all(series.into_iter().chain(self.innovations.values()));
        told.extend(self.lamps);
        PlayedRun::new(told)
    }

    /// A lamp is told when it says something else than before, and its numbers once a window.
    fn lamp(&mut self, time_ns: i64, sensor: SensorKind, innovation: &Innovation<f64>) {
        let Some((_, window)) = self.windows.iter_mut().find(|(kind, _)| *kind == sensor) else {
            return;
        };
        let before = window.lamp().cloned();
        window.add(innovation, None);
        let now = window.lamp();
        if let Some(lamp) = now.filter(|now| before.as_ref() != Some(*now)) {
            let told = Told::Lamp {
                sensor: sensor.name(),
                tone: lamp.tone,
                text: lamp.text.clone(),
                nis: lamp.nis_mean.zip(lamp.nis_expected),
            };
            self.lamps.push((time_ns, told));
        }
    }
}

impl RunObserver for AttitudeRecorder {
    fn estimate(&mut self, record: &EstimateRecord) {
        if !self.estimates.is_due(record.time_ns) {
            return;
        }
        let time_ns = record.time_ns;
        let pose = || (time_ns, Told::Pose(Box::new(record.pose(self.world))));
        self.estimates.kept.push(pose);
        if let Some((bias, covariance)) = &record.gyroscope_bias {
            let std = covariance.diagonal().map(|v| v.max(0.0).sqrt());
            let [bias, std] = [*bias, std].map(|v| v.map(f64::to_degrees).into());
            let told = || (time_ns, Told::GyroscopeBias(bias, Some(std)));
            self.biases.push(told);
        }
    }

    fn innovation(&mut self, record: &InnovationRecord) {
        let (time_ns, sensor) = (record.time_ns, record.sensor);
        // It waits for the next one, with which it is fused.
        if record.innovation.degrees_of_freedom > 0 || is_refusal(&record.innovation) {
            let series = self.innovations.entry(sensor);
            let series = series.or_insert_with(|| Thinned::new(MOST));
            series.push(|| {
                (
                    time_ns,
                    Told::Innovation(sensor.name(), (&record.innovation).into()),
                )
            });
        }
        self.lamp(time_ns, sensor, &record.innovation);
    }
}

/// Whether a measurement was looked at and left out, and does not wait for the next one.
fn is_refusal(innovation: &Innovation<f64>) -> bool {
    use northing_core::kalman::SkipReason::{Accumulated, NotDue};
    !matches!(innovation.outcome, Outcome::Skipped(Accumulated | NotDue))
}

/// Keeps a navigation run.
#[derive(Debug)]
pub struct NavigationRecorder {
    origin: Option<LocalFrame>,
    estimates: Estimates,
    innovations: BTreeMap<AidKind, Thinned<(i64, Told)>>,
    fixes: Thinned<(i64, Told)>,
    validity: Option<Validity>,
    lamps: Vec<(i64, Told)>,
}

impl Default for NavigationRecorder {
    fn default() -> Self {
        Self {
            origin: None,
            estimates: Estimates::new(),
            innovations: BTreeMap::new(),
            fixes: Thinned::new(MOST),
            validity: None,
            lamps: Vec::new(),
        }
    }
}

impl NavigationRecorder {
    /// What was kept.
    #[must_use]
    pub fn finish(self) -> PlayedRun {
        let series = [&self.estimates.kept, &self.fixes];
        let mut told = all(series.into_iter().chain(self.innovations.values()));
        told.extend(self.lamps);
        PlayedRun::new(told)
    }
}

impl NavigationObserver for NavigationRecorder {
    fn interval_ns(&self) -> i64 {
        ESTIMATES_EVERY
    }

    fn estimate(&mut self, estimate: &NavigationEstimate) {
        let time_ns = estimate.time_ns;
        if self.validity != Some(estimate.validity) {
            self.validity = Some(estimate.validity);
            let remark = Remark::of_validity(estimate.validity);
            let told = Told::Lamp {
                sensor: "position",
                tone: remark.tone,
                text: remark.text,
                nis: None,
            };
            self.lamps.push((time_ns, told));
        }
        if self.estimates.is_due(time_ns) {
            let origin = self.origin.unwrap_or(estimate.frame);
            let pose = || (time_ns, Told::Pose(Box::new(estimate.pose(&origin))));
            self.estimates.kept.push(pose);
        }
    }

    fn fix(&mut self, time_ns: i64, ned: &Vector3<f64>, _: bool) {
        let Some(origin) = self.origin else { return };
        let place = origin.geodetic(ned);
        let point = TrackPoint {
            time_ns,
            latitude_rad: place.latitude_rad,
            longitude_rad: place.longitude_rad,
            height_m: place.height_m,
            std_m: None,
            attitude: None,
        };
        self.fixes.push(|| (time_ns, Told::Fix(point)));
    }

    fn innovation(&mut self, time_ns: i64, aid: AidKind, innovation: &Innovation<f64>) {
        if innovation.degrees_of_freedom > 0 || is_refusal(innovation) {
            let series = self.innovations.entry(aid);
            let series = series.or_insert_with(|| Thinned::new(MOST));
            series.push(|| (time_ns, Told::Innovation(aid.name(), innovation.into())));
        }
    }

    fn origin(&mut self, frame: &LocalFrame) {
        self.origin = Some(*frame);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use northing_core::kalman::SkipReason;
    use northing_recording::PoseEstimate;

    fn pose(time_ns: i64) -> (i64, Told) {
        let pose = PoseEstimate {
            time_ns,
            ..PoseEstimate::default()
        };
        (time_ns, Told::Pose(Box::new(pose)))
    }

    fn skipped(time_ns: i64, sensor: &'static str) -> (i64, Told) {
        let innovation = Innovation::skipped(SkipReason::NotFinite);
        (time_ns, Told::Innovation(sensor, (&innovation).into()))
    }

    fn stamps<'a>(told: impl IntoIterator<Item = &'a (i64, Told)>) -> Vec<i64> {
        told.into_iter().map(|(time_ns, _)| *time_ns).collect()
    }

    #[test]
    fn what_is_due_is_told_once() {
        let run = PlayedRun::new((0..10).map(pose).collect());
        let mut told = stamps(run.state_at(0));
        for window in [[0, 3], [3, 3], [3, 9]] {
            told.extend(stamps(run.between(window)));
        }
        assert_eq!(told, (0..10).collect::<Vec<_>>());
        assert_eq!(run.between([7, 2]).len(), 0);
        assert_eq!(run.span_ns(), Some([0, 9]));
    }

    #[test]
    fn the_state_is_the_newest_of_each_subject() {
        let told = vec![
            skipped(1, "magnetometer"),
            pose(4),
            skipped(2, "accelerometer"),
            pose(2),
            skipped(9, "magnetometer"),
        ];
        let run = PlayedRun::new(told);
        assert_eq!(stamps(run.state_at(5)), [4, 2, 1]);
        assert!(run.state_at(0).is_empty());
    }
}
