//! Many targets: run the tracker over a recording, score it against true positions.
//!
//! | file | what is in it |
//! |---|---|
//! | [`matching`] | which track is which target: optimal assignment; GOSPA |
//! | [`run`](mod@run) | the tracker over a recording, with own-ship uncertainty stated or injected |
//! | [`score`] | coverage, loss, switches, false tracks, error, share inside the 95 % ellipse |
//! | [`injection`] | a heading error drawn for each run: which tracker knows what it does not know |

pub mod injection;
pub mod matching;
pub mod run;
pub mod score;

pub use injection::{InjectedTracker, InjectionOptions, InjectionSummary, inject_heading};
pub use run::{OwnShipStd, TrackEpoch, TrackOptions, TrackedTarget, TrackerKind, run};
pub use score::{TargetSummary, TrackSummary};
