//! Where are the others: the multi-target tracker over recordings, scored against true positions.
//!
//! | file | what is in it |
//! |---|---|
//! | [`kinds`] | the trackers by name |
//! | [`options`] | what a run can be asked for |
//! | [`runner`] | the tracker over a recording, with own-ship uncertainty stated or injected |
//! | `scan_tracker.rs` | the tracker scan by scan, with as much room as the scans need |
//! | [`matching`] | which track is which target: optimal assignment; GOSPA |
//! | [`trajectories`] | T-GOSPA: over time, with a cost of changes of track |
//! | [`outcome`] | coverage, loss, switches, false tracks, error, share inside the 95 % ellipse |
//! | `scale.rs` | the settings and the cut-off that follow from sensor and scene |
//! | [`injection`] | a heading error drawn for each run: which tracker knows what it does not know |

mod epoch;
pub mod injection;
pub mod kinds;
pub mod matching;
pub mod options;
pub mod outcome;
pub mod runner;
mod scale;
mod scan_tracker;
pub mod trajectories;

pub use epoch::{
    EpochScan, FollowedTrack, TargetAssociation, TrackEpoch, TrackedTarget, end_reason,
};
pub use injection::{InjectedTracker, InjectionOptions, InjectionSummary, inject_heading};
pub use kinds::TrackerKind;
pub use northing_core::tracking::multi_target::{EndedTrack, TrackEnd, TrackStatus};
pub use options::{OwnShipStd, TrackOptions};
pub use outcome::{TargetSummary, TrackSummary};
pub use runner::{detection, run};
pub use scale::SensorLooks;
pub use scan_tracker::ScanTracker;
