//! Who hears what: a teacher everything, a student what is of its own device.

use std::fmt;
use std::ops::Deref;
use std::sync::Arc;

use crate::lab::Lab;
use crate::lab_api::{Facts, hello};
use crate::roles::Role;
use crate::to_page::ToPage;

/// Which students hear what all teachers hear.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Audience {
    /// None.
    Teachers,
    /// The student of this device.
    Device(Arc<str>),
    /// Each student its own part of the table of experiments.
    Experiments,
    /// Each student its own part of what there is.
    Facts,
}

/// A message to all pages, as it travels, and who hears it.
#[derive(Debug, Clone)]
pub struct Told {
    text: Arc<str>,
    audience: Audience,
}

impl Told {
    /// A message to whom its content is about.
    #[must_use]
    pub fn new(message: &ToPage) -> Self {
        Self {
            text: message.json().into(),
            audience: Audience::of(message),
        }
    }

    /// A message that a student hears, too.
    #[must_use]
    pub fn about(device: &str, message: &ToPage) -> Self {
        Self {
            text: message.json().into(),
            audience: Audience::Device(device.into()),
        }
    }
}

impl Deref for Told {
    type Target = str;

    fn deref(&self) -> &str {
        &self.text
    }
}

impl fmt::Display for Told {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl Audience {
    fn of(message: &ToPage) -> Self {
        let device = |device: &str| Self::Device(device.into());
        match message {
            ToPage::Frame(frame) => device(&frame.device),
            ToPage::Calibration(calibration) => device(&calibration.device),
            ToPage::Experiment(experiment) => device(&experiment.device),
            ToPage::Magnetometer(magnetometer) => device(&magnetometer.device),
            ToPage::Experiments { .. } => Self::Experiments,
            ToPage::Hello(_) => Self::Facts,
            // Whatever is not known to be a student's is not.
            _ => Self::Teachers,
        }
    }
}

/// What a page of this role hears of a message to all pages.
pub(crate) fn heard(role: &Role, told: &Told, lab: &Lab, facts: &Facts) -> Option<String> {
    if *role == Role::Teacher {
        return Some(told.to_string());
    }
    match &told.audience {
        Audience::Device(device) => role.owns(device).then(|| told.to_string()),
        Audience::Experiments => Some(experiments(role, lab).json()),
        Audience::Facts => Some(hello(facts, role).json()),
        Audience::Teachers => None,
    }
}

/// What a page of this role hears first.
pub(crate) fn first(role: &Role, lab: &Lab, facts: &Facts) -> Vec<ToPage> {
    let mut first = vec![
        hello(facts, role),
        devices(role, lab),
        experiments(role, lab),
    ];
    if *role == Role::Teacher {
        first.push(lab.recording_status().message());
        first.extend(lab.persistence_problem().map(ToPage::error));
    }
    first
}

/// The devices that a page of this role sees.
pub(crate) fn devices(role: &Role, lab: &Lab) -> ToPage {
    let mut devices = lab.statuses();
    devices.retain(|device| role.owns(&device.id));
    ToPage::Devices { devices }
}

/// The experiments that a page of this role sees.
pub(crate) fn experiments(role: &Role, lab: &Lab) -> ToPage {
    match role.device() {
        None => lab.experiments_message(),
        // Who is better than whom is not for students to see.
        Some(device) => ToPage::Experiments {
            rows: lab.experiments.rows_of(device),
            board: Vec::new(),
        },
    }
}
