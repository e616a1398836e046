//! How the sensors are mounted, as `tf_static` and the frames of their messages tell it.

use std::collections::BTreeMap;

use northing_recording::mcap::{Mounting, Role, StaticTransforms};

use crate::messages::Message;

/// What is known of frames so far, and what follows from it.
#[derive(Debug, Default)]
pub(crate) struct Mounted {
    transforms: StaticTransforms,
    frames: BTreeMap<Role, String>,
    pub(crate) mounting: Mounting,
}

impl Mounted {
    /// Takes a message of static transforms; whether the mounting is another now.
    pub(crate) fn transforms(&mut self, bytes: &[u8]) -> bool {
        // What is none says nothing.
        self.transforms.take(bytes).is_some() && self.follows()
    }

    /// Takes the frame of a sensor's first message; whether the mounting is another now.
    pub(crate) fn frame(&mut self, message: &Message) -> bool {
        let frame = message.frame.as_ref().filter(|frame| !frame.is_empty());
        let Some(frame) = frame.filter(|_| !self.frames.contains_key(&message.role)) else {
            return false;
        };
        self.frames.insert(message.role, frame.clone());
        self.follows()
    }

    fn follows(&mut self) -> bool {
        let mounting = Mounting::of_sensors(&self.transforms, &self.frames);
        let is_another = mounting != self.mounting;
        self.mounting = mounting;
        is_another
    }
}
