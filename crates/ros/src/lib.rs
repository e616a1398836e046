//! A node of ROS 2 without ROS: sensors come in and estimates go out by DDS, as other nodes of ROS 2 speak it.
//!
//! | I look for | file |
//! |---|---|
//! | starting and stopping the node, its topics | `node.rs` |
//! | messages as bytes of CDR | `bytes.rs` |
//! | the messages in the order in which an estimator takes them | `messages.rs` |
//! | the samples of several topics in the order of their stamps | `order.rs` |
//! | how the sensors are mounted | `mounted.rs` |
//! | what is published of each estimate | `publish.rs` |
//! | the state of inputs and estimator, once a second | `diagnostics.rs` |
//!
//! Read first: `docs/ros.md`. The messages themselves are those of bags: `northing_recording::mcap`. Stamps are those of the
//! messages, so simulated time needs nothing; a stamp of zero is none, and the message has that of its arrival.

#![deny(rustdoc::broken_intra_doc_links)]

mod bytes;
mod diagnostics;
mod messages;
mod mounted;
mod node;
mod order;
mod publish;

pub use diagnostics::Diagnostics;
pub use messages::{Ended, Message, Messages};
pub use node::{Check, Node, NodeConfig, NodeError, Reliability, TRANSFORMS, usual_topic};
pub use publish::{AttitudePublisher, Frames, NavigationPublisher};
