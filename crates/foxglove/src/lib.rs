//! A server for Foxglove and other viewers of its protocol: topics for what estimators tell, parameters that a viewer sets, and
//! of a run over a recording playback that it controls.
//!
//! | I look for | file |
//! |---|---|
//! | topics, their messages and schemas | `topics.rs` |
//! | what a run told, kept to be played | `played_run.rs` |
//! | the same as a file | `file.rs` |
//! | play, pause, seek, speed | `playback.rs` |
//! | the server, its parameters and requests | `server.rs` |
//! | a played run behind a server | `player.rs` |
//!
//! Read first: `docs/foxglove.md`.

#![deny(rustdoc::broken_intra_doc_links)]

mod file;
mod playback;
mod played_run;
mod player;
mod server;
mod topics;

pub use file::{FileError, RunFile};
pub use played_run::{AttitudeRecorder, NavigationRecorder, PlayedRun};
pub use player::{Player, Source};
pub use server::{Server, ServerError, SetRequest, Setting};
pub use topics::{InnovationTold, Told, Topics};
