//! The live lab: phones and virtual phones deliver samples, estimators run on them at once, and
//! calibrations, experiments and what-if follow the laboratory of the paper.
//!
//! | I look for | file |
//! |---|---|
//! | starting it: ports, addresses, certificate | [`server`], [`addresses`], [`tls`], [`token`] |
//! | who may ask, how much, and for how long | [`security`], [`limits`], [`connections`] |
//! | teacher and students: who they are, what they may do and hear | [`roles`], [`credentials`], [`permissions`], [`audience`], [`join`] |
//! | what phones and apps talk to, and hear | [`ingest`], [`identities`], [`phone_hints`] |
//! | what the lab page talks to, and the messages | [`lab_api`], [`messages`] |
//! | the devices and what they share | [`lab`], [`device`] |
//! | one device: events in, estimates, calibration, experiment out | [`engine`], [`session`] |
//! | frames for the pages | [`frames`] |
//! | a whole class at once, and who is consistent | [`everyone`], [`board`] |
//! | recordings of elsewhere | [`opened`] |
//! | finished experiments, what-if, fit of Q and R, Allan deviation, files, report | [`experiments`], [`what_if`], [`tune`], [`allan`], [`export`], [`report`] |
//! | exercises of the course: handing in, and the table of the class | [`hand_ins`] |
//! | devices without a phone | [`virtual_phones`], [`replay`] |
//! | recording everything as it arrives | [`recorder`] |
//! | what outlives the lab, and a session as one file | [`persistence`], [`session_export`] |
//! | apps with a server, ports that wait, serial lines | [`inputs`] |
//! | the pages and the QR code | [`assets`], [`qr`] |
//!
//! A sample's way: a listener reads a batch and hands its bytes to the task of its device, whose engine
//! puts batches in order, decodes them, and runs the session. Queues are bounded: when a device is
//! busy, its phone is told to send again, so samples are never dropped; frames for drawing are.

pub mod addresses;
pub mod allan;
pub mod assets;
pub mod audience;
pub mod board;
pub mod connections;
pub mod credentials;
pub mod device;
pub mod engine;
pub mod everyone;
mod experiment_table;
pub mod experiments;
pub mod export;
mod file_limit;
pub mod frames;
mod guesses;
mod hand_in_api;
pub mod hand_ins;
pub mod identities;
pub mod ingest;
pub mod inputs;
pub mod join;
pub mod lab;
pub mod lab_api;
pub mod latency;
pub mod limits;
pub mod mdns;
pub mod messages;
mod mine;
pub mod opened;
mod opened_api;
mod page;
pub mod permissions;
pub mod persistence;
pub mod phone_hints;
mod private;
#[cfg(test)]
mod protocol;
mod pulse;
pub mod qr;
pub mod recorder;
mod recordings_api;
pub mod replay;
pub mod report;
pub mod roles;
pub mod security;
pub mod server;
pub mod session;
pub mod session_export;
mod silence;
pub mod tls;
pub mod to_page;
pub mod token;
pub mod tune;
pub mod virtual_phones;
pub mod what_if;
