//! An attitude estimator on a stream: its error and NEES ten times a second.

use nalgebra::{Matrix3, Vector3};
use northing_evaluation::attitude::{RunObserver, ScoredRecord};
use northing_evaluation::{EstimatorKind, Profile, RunOptions, run};
use northing_recording::{Event, RecordingError};

use super::judge::{Instant, STAMP_TOLERANCE_S, Track};
use super::stream::Stream;
use crate::attitude_worlds::score::{Judged, Moment};
use crate::scoring::Thinned;

/// What an estimator makes of these events of a stream; nothing where it cannot run.
pub(super) fn track(kind: EstimatorKind, stream: &Stream, events: &[Event]) -> Track {
    let options = RunOptions {
        world_frame: stream.metadata.world_frame,
        recording: stream.name.clone(),
        ..RunOptions::new(kind, Profile::HandHeld)
    };
    let mut watch = Watch {
        stream,
        thinned: Thinned::new(STAMP_TOLERANCE_S),
        start: None,
        instants: Vec::new(),
    };
    let events = events
        .iter()
        .map(|event| Ok::<Event, RecordingError>(*event));
    // What ends with an error has said something before it.
    let summary = run(events, &options, &mut watch).ok();
    let found = summary.as_ref().map(|summary| summary.faults.as_slice());
    Track::of(watch.instants, found)
}

struct Watch<'a> {
    stream: &'a Stream,
    thinned: Thinned,
    /// From here headings count where nothing says where north is.
    start: Option<Moment>,
    instants: Vec<Instant>,
}

impl RunObserver for Watch<'_> {
    fn scored(&mut self, record: &ScoredRecord) {
        let time_s = self.stream.seconds(record.time_ns);
        let truth = record.reference.attitude;
        let known = record.reference.scored && truth.coords.iter().all(|x| x.is_finite());
        if !known || !self.thinned.takes(time_s) {
            return;
        }
        let moment = Moment {
            time_s,
            estimate: record.attitude,
            covariance: record.attitude_covariance,
            truth,
        };
        let (error, nees) = if self.stream.has_north {
            whole(&moment)
        } else {
            let start = *self.start.get_or_insert(moment);
            tilt(&moment, &start)
        };
        self.instants.push(Instant {
            time_s,
            error,
            nees,
        });
    }
}

/// The angle of the whole error, deg, and its NEES per degree of freedom.
fn whole(moment: &Moment) -> (f64, Option<f64>) {
    let error: Vector3<f64> = (moment.estimate.inverse() * moment.truth).scaled_axis();
    let squared = |covariance: Matrix3<f64>| {
        let root = covariance.cholesky()?;
        Some(error.dot(&root.solve(&error)) / 3.0)
    };
    (
        error.norm().to_degrees(),
        moment.covariance.and_then(squared),
    )
}

/// The tilt error, deg, and the NEES per degree of freedom of tilt and heading's drift.
fn tilt(moment: &Moment, start: &Moment) -> (f64, Option<f64>) {
    let judged = Judged::of(moment, Some(start));
    let nees = judged.tilt.map(|tilt| match judged.heading {
        Some(heading) => (tilt.norm_squared() + heading.norm_squared()) / 3.0,
        None => tilt.norm_squared() / 2.0,
    });
    (judged.instant.tilt_error_deg, nees)
}
