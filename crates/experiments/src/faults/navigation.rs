//! A navigation estimator on a stream: its horizontal error and NEES ten times a second.

use northing_evaluation::navigation::{
    NavigationKind, NavigationObserver, NavigationOptions, ScoredPoint, run_navigation,
};
use northing_recording::{Event, RecordingError};

use super::judge::{Instant, STAMP_TOLERANCE_S, Track};
use super::stream::Stream;
use crate::scoring::Thinned;

/// What an estimator makes of these events of a stream; nothing where it cannot run.
pub(super) fn track(kind: NavigationKind, stream: &Stream, events: &[Event]) -> Track {
    let options = NavigationOptions {
        score_from_s: 0.0,
        ..NavigationOptions::of_recording(kind, &stream.metadata)
    };
    let mut watch = Watch {
        stream,
        thinned: Thinned::new(STAMP_TOLERANCE_S),
        instants: Vec::new(),
    };
    let events = events
        .iter()
        .map(|event| Ok::<Event, RecordingError>(*event));
    let frame = stream.metadata.world_frame;
    // What ends with an error has said something before it.
    let summary = run_navigation(events, &stream.name, frame, &options, &mut watch).ok();
    // A ship's log and compass have no inertial samples to look at.
    let looks = kind != NavigationKind::DeadReckoning;
    let found = summary.as_ref().filter(|_| looks);
    Track::of(
        watch.instants,
        found.map(|summary| summary.faults.as_slice()),
    )
}

struct Watch<'a> {
    stream: &'a Stream,
    thinned: Thinned,
    instants: Vec<Instant>,
}

impl NavigationObserver for Watch<'_> {
    fn interval_ns(&self) -> i64 {
        i64::MAX
    }

    fn scored(&mut self, point: &ScoredPoint) {
        let time_s = self.stream.seconds(point.time_ns);
        if self.thinned.takes(time_s) {
            let error = point.error.xy().norm();
            // The truth of a held-out fix has an error of its own, on each axis.
            let variance = point.horizontal_std.powi(2) + 2.0 * point.truth_std.powi(2);
            let nees = (variance > 0.0).then(|| error * error / variance);
            self.instants.push(Instant {
                time_s,
                error,
                nees,
            });
        }
    }
}
