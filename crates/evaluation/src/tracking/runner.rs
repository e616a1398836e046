//! The tracker over a recording.

use std::collections::BTreeSet;
use std::time::Instant;

use northing_core::tracking::detection::{Detection, DetectionNoise};
use northing_core::tracking::multi_target::{Scan, ScanSensor, TrackStatus};
use northing_core::tracking::own_ship::OwnShip;
use northing_recording::tracking::{
    Detection as Seen, OwnShipPose, SensorSettings, TargetTruth, TrackingEvent, TrackingIssues,
    TrackingRecording, TrackingSample,
};

use super::epoch::{EpochScan, TrackEpoch};
use super::kinds::TrackerKind;
use super::matching::Place;
use super::options::TrackOptions;
use super::outcome::{Counts, Score, TrackSummary};
use super::scale::{self, SensorLooks};
use super::scan_tracker::ScanTracker;
use crate::error::EvaluationError;
use crate::used_parameters::{UsedParameter, VERSION};

/// Runs the tracker over a recording; `watch` gets every instant with a scan.
///
/// # Errors
/// A parameter of the tracker is outside its permitted range.
pub fn run(
    recording: &TrackingRecording,
    options: &TrackOptions,
    mut watch: impl FnMut(TrackEpoch),
) -> Result<TrackSummary, EvaluationError> {
    let started = Instant::now();
    let mut runner = Runner::new(recording, options)?;
    for event in &recording.events {
        runner.finish_epoch_before(event.time_ns, &mut watch);
        runner.take(event.time_ns, &event.sample);
    }
    runner.finish_epoch_before(i64::MAX, &mut watch);
    Ok(runner.summary(recording, started))
}

/// What a run carries from event to event.
struct Runner {
    options: TrackOptions,
    /// What the tracker was configured with.
    parameters: Vec<UsedParameter>,
    sensors: Vec<Option<ScanSensor<f64>>>,
    names: Vec<String>,
    ais: Option<usize>,
    tracker: ScanTracker,
    own: OwnShip<f64>,
    score: Score,
    first_ns: i64,
    epoch: Option<Gathered>,
}

/// The instant being gathered: its scans come one after the other, and the truth behind them.
struct Gathered {
    time_ns: i64,
    epoch: TrackEpoch,
    /// The scans of it that were used.
    scans: Vec<i64>,
}

impl Gathered {
    /// Takes a true position that belongs to a used scan, once for each target.
    fn truth(&mut self, truth: &TargetTruth) {
        let mut known = self.epoch.truth.iter().map(|(target, _)| *target);
        if self.scans.contains(&truth.scan) && known.all(|target| target != truth.target) {
            let place = [truth.north_m, truth.east_m];
            self.epoch.truth.push((truth.target, place));
        }
    }
}

impl Runner {
    fn new(recording: &TrackingRecording, options: &TrackOptions) -> Result<Self, EvaluationError> {
        let used = |name: &String, settings: &SensorSettings| match &options.sensors {
            Some(chosen) => chosen.contains(name),
            None => settings.used,
        };
        let each = recording.sensors.iter();
        let sensors: Vec<_> = each
            .clone()
            .map(|(name, settings)| used(name, settings).then(|| sensor(settings)))
            .collect();
        let names = each.zip(&sensors).filter(|(_, sensor)| sensor.is_some());
        let used: Vec<bool> = sensors.iter().map(Option::is_some).collect();
        let options = options.derived(SensorLooks::scale(&scale::looks(recording, &sensors)));
        let cutoff_m = options
            .cutoff_m
            .or_else(|| scale::cutoff_m(recording, &used));
        Ok(Self {
            parameters: options.parameters(),
            names: names.map(|((name, _), _)| name.clone()).collect(),
            sensors,
            ais: recording.sensors.iter().position(|(name, _)| name == "ais"),
            tracker: ScanTracker::new(options.config(), most_detections(recording))?,
            own: OwnShip::exact(0.0, 0.0, 0.0),
            score: Score::new(cutoff_m, recording.truth_std_m),
            first_ns: recording.events.first().map_or(0, |event| event.time_ns),
            epoch: None,
            options,
        })
    }

    fn take(&mut self, time_ns: i64, sample: &TrackingSample) {
        match sample {
            TrackingSample::OwnShip(pose) => self.own = self.own_ship(pose),
            TrackingSample::Scan(scan) => {
                let seen: Vec<_> = scan.detections.iter().map(|d| self.detection(d)).collect();
                let which = EpochScan {
                    sensor: scan.sensor,
                    scan: Some(scan.id),
                };
                if self.scan(time_ns, which, &seen)
                    && let Some(gathered) = &mut self.epoch
                {
                    gathered.scans.push(scan.id);
                }
            }
            TrackingSample::Ais(report) => {
                let place = Detection::Position {
                    north_m: report.north_m,
                    east_m: report.east_m,
                };
                if let Some(sensor) = self.ais {
                    let which = EpochScan { sensor, scan: None };
                    self.scan(time_ns, which, &[place]);
                }
            }
            TrackingSample::Truth(truth) => {
                if let Some(gathered) = &mut self.epoch {
                    gathered.truth(truth);
                }
            }
            _ => {}
        }
    }

    /// Names of the sensors in use, with their noise.
    fn noises(&self) -> Vec<(String, DetectionNoise<f64>)> {
        let used = self.sensors.iter().flatten();
        let each = self.names.iter().zip(used);
        each.map(|(name, sensor)| (name.clone(), sensor.noise))
            .collect()
    }

    fn own_ship(&self, pose: &OwnShipPose) -> OwnShip<f64> {
        let stated = self
            .options
            .own_ship_std
            .map(|std| [std.position_m, std.position_m, std.heading_rad]);
        let std = match self.options.tracker {
            TrackerKind::Uncompensated => [0.0; 3],
            _ => stated.or(pose.std).unwrap_or([0.0; 3]),
        };
        let heading = pose.heading_rad + self.options.heading_error_rad;
        OwnShip::exact(pose.north_m, pose.east_m, heading).with_std(std[0], std[1], std[2])
    }

    /// A detection as the tracker takes it. An injected error is in the pose and not in here.
    fn detection(&self, seen: &Seen) -> Detection<f64> {
        let own = OwnShip {
            heading_rad: self.own.heading_rad - self.options.heading_error_rad,
            ..self.own
        };
        detection(seen, &own)
    }

    /// Hands a scan to the tracker; false when its sensor is not used or the scan was refused.
    fn scan(&mut self, time_ns: i64, which: EpochScan, detections: &[Detection<f64>]) -> bool {
        let Some(sensor) = self.sensors.get(which.sensor).and_then(Option::as_ref) else {
            return false;
        };
        let time_s = (time_ns - self.first_ns) as f64 * 1e-9;
        let taken = self.tracker.scan(&Scan {
            time_s,
            sensor,
            own_ship: &self.own,
            detections,
        });
        if taken.is_err() {
            return false;
        }
        let gathered = self.epoch.get_or_insert_with(|| Gathered {
            time_ns,
            epoch: TrackEpoch {
                time_ns,
                time_s,
                own_ship: [self.own.north_m, self.own.east_m],
                detections: Vec::new(),
                tracks: Vec::new(),
                doubtful: Vec::new(),
                scan: which,
                updated: Some(BTreeSet::new()),
                ended: Vec::new(),
                truth: Vec::new(),
            },
            scans: Vec::new(),
        });
        let epoch = &mut gathered.epoch;
        epoch
            .detections
            .extend(detections.iter().filter_map(|d| placed(d, &self.own)));
        [epoch.tracks, epoch.doubtful] = self.tracker.confirmed();
        if sensor.covers_all {
            epoch.updated = None;
        }
        if let Some(updated) = &mut epoch.updated {
            let all = epoch.tracks.iter().chain(&epoch.doubtful);
            let seen = all.filter(|track| track.association.in_gate > 0);
            updated.extend(seen.map(|track| track.id));
        }
        epoch.scan = which;
        let ended = self.tracker.ended().into_iter();
        let ended = ended.filter(|track| track.status == TrackStatus::Confirmed);
        epoch.ended.extend(ended);
        true
    }

    /// Scores the instant being gathered, if it lies before `time_ns`.
    fn finish_epoch_before(&mut self, time_ns: i64, watch: &mut impl FnMut(TrackEpoch)) {
        let Some(Gathered { epoch, .. }) = self.epoch.take_if(|g| g.time_ns < time_ns) else {
            return;
        };
        if epoch.truth.is_empty() {
            self.score.seen(&epoch.tracks);
        } else {
            let TrackEpoch {
                truth,
                tracks,
                detections,
                ..
            } = &epoch;
            self.score.epoch(epoch.time_s, truth, tracks, detections);
        }
        watch(epoch);
    }

    fn summary(&self, recording: &TrackingRecording, started: Instant) -> TrackSummary {
        let last_ns = recording.events.last().map_or(0, |event| event.time_ns);
        let over_time = self.score.trajectory_distance();
        TrackSummary {
            recording: recording.name.clone(),
            tracker: self.options.tracker.name(),
            sensors: self.names.clone(),
            duration_s: (last_ns - self.first_ns) as f64 * 1e-9,
            elapsed_s: started.elapsed().as_secs_f64(),
            targets: self.score.targets(),
            confirmed_tracks: self.score.confirmed.len(),
            scored_tracks: self.score.scored.len(),
            false_tracks: self.score.false_tracks(),
            false_track_epochs: self.score.false_epochs,
            false_tracks_per_hour: self.score.false_tracks_per_hour(),
            cutoff_m: self.score.cutoff_m(),
            gospa_m: self.score.gospa_m(),
            ospa_m: self.score.ospa_m(),
            tgospa_m: over_time.map(|distance| distance.at_most_m),
            tgospa_at_least_m: over_time.map(|distance| distance.at_least_m),
            learnt: self.tracker.learnt(&self.noises()),
            counts: Counts::from(self.tracker.counts()),
            left_out: left_out(recording, self.tracker.counts().scans),
            parameters: self.parameters.clone(),
            version: VERSION,
        }
    }
}

/// What the reader left out and remarked on, and true positions that nothing was scored against because no scan was used.
fn left_out(recording: &TrackingRecording, scans: u64) -> TrackingIssues {
    let mut issues = recording.issues.clone();
    let is_truth = |event: &TrackingEvent| matches!(event.sample, TrackingSample::Truth(_));
    if scans == 0 && recording.events.iter().any(is_truth) {
        let remark = "no scan was used, so there is no score, although there are true positions";
        issues.remarks.push(remark.to_owned());
    }
    issues
}

/// A detection as the tracker takes it: relative to the bow of the own ship, from which it was seen.
#[must_use]
pub fn detection(seen: &Seen, own: &OwnShip<f64>) -> Detection<f64> {
    let offset = |north: f64, east: f64| Detection::RangeBearing {
        range_m: north.hypot(east),
        bearing_rad: east.atan2(north) - own.heading_rad,
    };
    match *seen {
        Seen::RangeBearing {
            range_m,
            bearing_rad,
        } => Detection::RangeBearing {
            range_m,
            bearing_rad,
        },
        Seen::Bearing { bearing_rad } => Detection::Bearing { bearing_rad },
        Seen::Relative { north_m, east_m } => offset(north_m, east_m),
        Seen::Placed { north_m, east_m } => offset(north_m - own.north_m, east_m - own.east_m),
        // A kind that came later: not finite, so it is refused and counted.
        _ => offset(f64::NAN, f64::NAN),
    }
}

/// Detections in the longest scan.
fn most_detections(recording: &TrackingRecording) -> usize {
    let each = recording.events.iter().map(|event| match &event.sample {
        TrackingSample::Scan(scan) => scan.detections.len(),
        _ => 1,
    });
    each.max().unwrap_or(0)
}

fn sensor(settings: &SensorSettings) -> ScanSensor<f64> {
    ScanSensor {
        noise: DetectionNoise {
            range_std_m: settings.range_std_m,
            bearing_std_rad: settings.bearing_std_deg.to_radians(),
            extent_std_m: settings.extent_std_m,
        },
        detection_probability: settings.detection_probability,
        clutter_density: settings.clutter_density(),
        largest_range_m: settings.largest_range_m,
        covers_all: settings.covers_all,
        initiates: settings.initiates,
    }
}

/// Where a detection is, for plots.
fn placed(detection: &Detection<f64>, own: &OwnShip<f64>) -> Option<Place> {
    let place = match *detection {
        Detection::RangeBearing {
            range_m,
            bearing_rad,
        } => {
            let direction = bearing_rad + own.heading_rad;
            [
                own.north_m + range_m * direction.cos(),
                own.east_m + range_m * direction.sin(),
            ]
        }
        Detection::Position { north_m, east_m } => [north_m, east_m],
        Detection::Bearing { .. } => return None,
    };
    place.iter().all(|v| v.is_finite()).then_some(place)
}
