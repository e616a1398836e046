//! Clean streams of samples that faults are laid over: simulated worlds with healthy sensors, and recordings.

use northing_evaluation::registry::Question;
use northing_recording::{Event, Metadata, Recording, Sample, WorldFrame};
use northing_simulation::attitude_world::{AttitudeWorld, WorldMotion};
use northing_simulation::navigation_world::NavigationWorld;
use serde::Serialize;

use crate::navigation_worlds::events;

/// How long a world of attitude lasts, s: a fault after a third, and a minute and more after it.
const ATTITUDE_S: f64 = 120.0;
/// The same of navigation, s, of even and of odd numbers: a GNSS/INS is at the first third still in its alignment, or goes on alone.
const NAVIGATION_S: [f64; 2] = [180.0, 420.0];
/// So much of a recording is taken, s.
const RECORDED_S: f64 = 180.0;
/// Recordings that are shorter say nothing of the minute after a fault, s.
const LEAST_RECORDED_S: f64 = 90.0;
/// Motions of what people carry and lay down.
const MOTIONS: [WorldMotion; 4] = [
    WorldMotion::PutDown,
    WorldMotion::Walking,
    WorldMotion::Desk,
    WorldMotion::Swinging,
];

/// Where a stream comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Origin {
    /// A simulated world.
    Simulated,
    /// A recording.
    Recorded,
}

impl Origin {
    /// In words.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Simulated => "simulated worlds",
            Self::Recorded => "recordings",
        }
    }
}

/// A clean stream of samples, with what it is scored against.
#[derive(Debug, Clone)]
pub struct Stream {
    /// Motion and number of the world, or name of the recording.
    pub name: String,
    /// Where it comes from.
    pub origin: Origin,
    /// Number of the world or of the recording.
    pub number: u64,
    /// What is estimated.
    pub question: Question,
    /// Whether a magnetometer or a compass says where north is.
    pub has_north: bool,
    /// What the recording knows about itself.
    pub metadata: Metadata,
    /// The samples, and references among them.
    pub events: Vec<Event>,
}

impl Stream {
    /// The world with this number.
    #[must_use]
    pub fn world(question: Question, seed: u64, number: u64) -> Self {
        if question == Question::Navigation {
            return Self::navigation_world(seed, number);
        }
        let motion = MOTIONS[(number % MOTIONS.len() as u64) as usize];
        let world = AttitudeWorld::draw_healthy(seed, number, motion, ATTITUDE_S);
        Self::simulated(
            number,
            motion.name(),
            question,
            WorldFrame::Enu,
            world.events,
        )
    }

    fn navigation_world(seed: u64, number: u64) -> Self {
        let length = NAVIGATION_S[(number % 2) as usize];
        let world = NavigationWorld::draw_healthy(seed, number, length);
        let class = world.description.class.name();
        Self::simulated(
            number,
            class,
            Question::Navigation,
            WorldFrame::Ned,
            events(&world),
        )
    }

    fn simulated(
        number: u64,
        what: &str,
        question: Question,
        world_frame: WorldFrame,
        events: Vec<Event>,
    ) -> Self {
        Self {
            name: format!("{what} {number}"),
            origin: Origin::Simulated,
            number,
            question,
            has_north: question == Question::Attitude,
            metadata: Metadata {
                world_frame,
                ..Metadata::default()
            },
            events,
        }
    }

    /// The first minutes of a recording; `None` for one that is too short, damaged there, or has no gyroscope or nothing to score
    /// against: a reference attitude, a reference position, or fixes, of which every other is held out.
    #[must_use]
    pub fn recorded(recording: &mut Recording, number: u64) -> Option<Self> {
        let metadata = recording.metadata().clone();
        let mut events: Vec<Event> = Vec::new();
        for event in &mut *recording {
            let event = event.ok()?;
            let first = events.first().map_or(event.time_ns, |first| first.time_ns);
            if (event.time_ns - first) as f64 * 1e-9 > RECORDED_S {
                break;
            }
            events.push(event);
        }
        let length = events.last()?.time_ns - events.first()?.time_ns;
        let has = |of: fn(&Sample) -> bool| events.iter().any(|event| of(&event.sample));
        let has_fixes = has(|s| matches!(s, Sample::GnssPosition(_)));
        let has_attitude = has(|s| matches!(s, Sample::Reference(_)));
        let has_rates = has(|s| matches!(s, Sample::AngularRate(_)));
        let is_sound = (length as f64 * 1e-9) > LEAST_RECORDED_S && has_rates;
        if !is_sound || !(has_fixes || has_attitude) {
            return None;
        }
        let has_position = has(|s| matches!(s, Sample::ReferencePosition(_)));
        let has_north = has(|s| matches!(s, Sample::MagneticField(_) | Sample::CompassHeading(_)));
        if has_fixes && !has_position {
            hold_out(&mut events);
        }
        Some(Self {
            name: metadata.name.clone(),
            origin: Origin::Recorded,
            number,
            question: if has_fixes {
                Question::Navigation
            } else {
                Question::Attitude
            },
            has_north,
            metadata,
            events,
        })
    }

    /// Seconds of an instant of this stream.
    pub(super) fn seconds(&self, time_ns: i64) -> f64 {
        let first = self.events.first().map_or(0, |event| event.time_ns);
        time_ns.saturating_sub(first) as f64 * 1e-9
    }
}

/// Every other fix becomes what is scored against.
fn hold_out(events: &mut [Event]) {
    let fixes = events.iter_mut().filter_map(|event| match event.sample {
        Sample::GnssPosition(fix) => Some((event, fix)),
        _ => None,
    });
    for (event, fix) in fixes.skip(1).step_by(2) {
        event.sample = Sample::ReferencePosition(fix);
    }
}
