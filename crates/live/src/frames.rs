//! Frames on their way to the pages. A page that wants few frames a second still gets every
//! innovation: those of the frames it does not see are kept for the next one it does.

use std::collections::{BTreeMap, HashMap, VecDeque};
use std::time::{Duration, Instant};

use northing_evaluation::EstimatorKind;

use crate::lab::MOST_DEVICES;
use crate::session::frame::Frame;
use crate::to_page::ToPage;

/// Innovations kept for one page and device: ten seconds of fast sensors. The oldest go first.
const MOST_PENDING: usize = 5000;

/// A frame as JSON, in two parts, so that each page can be given the innovations it has missed.
#[derive(Debug)]
pub struct FrameText {
    /// The device.
    pub device: String,
    /// When the newest samples in it came, ns; `None` where there are none since the last frame.
    pub arrival_ns: Option<i64>,
    /// The estimator that the innovations are of.
    subject: Option<EstimatorKind>,
    /// The frame without innovations and samples.
    head: String,
    /// The subject's estimate and the lamps alone, for pages that watch another device.
    brief: String,
    /// Each innovation.
    innovations: Vec<String>,
    /// The samples of each sensor.
    samples: Vec<(&'static str, Vec<String>)>,
}

impl FrameText {
    /// Writes a frame with samples that came at `arrival_ns`.
    ///
    /// # Errors
    /// It cannot be written as JSON.
    pub fn new(mut frame: Frame, arrival_ns: Option<i64>) -> Result<Self, serde_json::Error> {
        let innovations = std::mem::take(&mut frame.innovations);
        let innovations: Result<Vec<String>, _> =
            innovations.iter().map(serde_json::to_string).collect();
        let samples = std::mem::take(&mut frame.samples).into_iter();
        let samples = samples.map(|(sensor, rows)| {
            let rows: Result<_, _> = rows.iter().map(serde_json::to_string).collect();
            Ok((sensor, rows?))
        });
        let samples: Result<Vec<_>, serde_json::Error> = samples.collect();
        let (device, subject) = (frame.device.clone(), frame.subject);
        let head = serde_json::to_string(&ToPage::Frame(Box::new(frame.clone())))?;
        let name = subject.map(EstimatorKind::name);
        frame.estimates.retain(|of, _| Some(*of) == name);
        frame.between_deg.clear();
        frame.truth = None;
        Ok(Self {
            device,
            subject,
            head,
            brief: serde_json::to_string(&ToPage::Frame(Box::new(frame)))?,
            arrival_ns,
            innovations: innovations?,
            samples: samples?,
        })
    }
}

/// The frames of one page.
#[derive(Debug)]
pub struct PageFrames {
    interval: Duration,
    watched: Watched,
    devices: HashMap<String, Pending>,
}

/// The devices that a page gets everything of.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum Watched {
    /// All, without samples: a page that has not said what it watches.
    #[default]
    All,
    /// None: a wall.
    None,
    /// One, with its samples.
    One(String),
}

/// What one page has not seen of one device.
#[derive(Debug, Default)]
struct Pending {
    samples: BTreeMap<&'static str, VecDeque<String>>,
    sent: Option<Instant>,
    subject: Option<EstimatorKind>,
    innovations: VecDeque<String>,
}

impl PageFrames {
    /// For a page that wants so many frames a second.
    #[must_use]
    pub fn new(hz: f64) -> Self {
        Self {
            interval: Duration::from_secs_f64(1.0 / hz),
            watched: Watched::default(),
            devices: HashMap::new(),
        }
    }

    /// From now on the page wants so many frames a second.
    pub fn set_rate(&mut self, hz: f64) {
        self.interval = Duration::from_secs_f64(1.0 / hz);
    }

    /// From now on the page gets everything of these devices, and of others only what a wall shows.
    pub fn watch(&mut self, watched: Watched) {
        self.watched = watched;
        self.devices.clear();
    }

    /// Takes a frame; gives the message if one is due.
    pub fn take(&mut self, frame: &FrameText, now: Instant) -> Option<String> {
        if self.devices.len() > 2 * MOST_DEVICES {
            // Devices come and go; those still there are back with their next frame.
            self.devices.clear();
        }
        let (is_whole, has_samples) = match &self.watched {
            Watched::All => (true, false),
            Watched::None => (false, false),
            Watched::One(device) => (*device == frame.device, *device == frame.device),
        };
        let pending = match self.devices.get_mut(&frame.device) {
            Some(pending) => pending,
            None => self.devices.entry(frame.device.clone()).or_default(),
        };
        if pending.subject != frame.subject {
            // Those of another estimator would be taken for its own.
            pending.subject = frame.subject;
            pending.innovations.clear();
        }
        if is_whole {
            keep(&mut pending.innovations, &frame.innovations);
        }
        if has_samples {
            for (sensor, rows) in &frame.samples {
                keep(pending.samples.entry(sensor).or_default(), rows);
            }
        }
        // A little early is in time: frames come in steps of their own.
        let wait = self.interval.mul_f64(0.8);
        let soon = |sent: Instant| now.saturating_duration_since(sent) < wait;
        if pending.sent.is_some_and(soon) {
            return None;
        }
        pending.sent = Some(now);
        let head = if is_whole { &frame.head } else { &frame.brief };
        let head = head.strip_suffix('}').unwrap_or(head);
        let mut text = format!(
            "{head},\"innovations\":[{}]",
            drained(&mut pending.innovations)
        );
        if has_samples {
            let series = pending.samples.iter_mut();
            let series: Vec<String> = series
                .map(|(sensor, rows)| format!("\"{sensor}\":[{}]", drained(rows)))
                .collect();
            text.push_str(&format!(",\"samples\":{{{}}}", series.join(",")));
        }
        text.push('}');
        Some(text)
    }
}

/// Adds to what is pending; the oldest go when there are too many.
fn keep(pending: &mut VecDeque<String>, new: &[String]) {
    pending.extend(new.iter().cloned());
    let excess = pending.len().saturating_sub(MOST_PENDING);
    pending.drain(..excess);
}

/// Everything that is pending, as the items of a list.
fn drained(pending: &mut VecDeque<String>) -> String {
    pending.drain(..).collect::<Vec<_>>().join(",")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::session::DeviceSession;
    use northing_evaluation::{EstimatorKind, Profile, RunOptions};
    use northing_recording::Event;
    use northing_simulation::{VirtualPhone, VirtualPhoneConfig};
    use serde_json::Value;

    /// Frames of two seconds of a virtual phone, one every 20 ms.
    fn frames() -> Vec<(FrameText, usize)> {
        let options = RunOptions::new(EstimatorKind::Mekf, Profile::Lab);
        let mut session = DeviceSession::new(options).unwrap();
        let phone = VirtualPhone::new(VirtualPhoneConfig::default()).unwrap();
        let events: Vec<Event> = phone.events().collect();
        let mut frames = Vec::new();
        for k in 0..100 {
            let due = |e: &&Event| e.time_ns / 20_000_000 == k;
            session.take(&mut events.iter().filter(due).copied().collect::<Vec<_>>());
            let frame = session.frame("phone");
            let count = frame.innovations.len();
            frames.push((FrameText::new(frame, None).unwrap(), count));
        }
        frames
    }

    #[test]
    fn every_innovation_arrives_at_every_display_rate() {
        let frames = frames();
        let made: usize = frames.iter().map(|(_, count)| count).sum();
        assert!(made > 150, "{made}");
        for hz in [1.0, 5.0, 60.0] {
            let mut page = PageFrames::new(hz);
            let start = Instant::now();
            let (mut sent, mut told) = (0, 0);
            for (k, (frame, _)) in frames.iter().enumerate() {
                let now = start + Duration::from_millis(20) * k as u32;
                if let Some(text) = page.take(frame, now) {
                    let message: Value = serde_json::from_str(&text).unwrap();
                    assert_eq!(message["type"], "frame");
                    sent += 1;
                    told += message["innovations"].as_array().unwrap().len();
                }
            }
            let late = page.devices["phone"].innovations.len();
            assert_eq!(told + late, made, "{hz} Hz");
            assert!(
                sent as f64 <= 2.0 * hz * 1.25 + 1.0,
                "{sent} frames at {hz} Hz"
            );
        }
    }

    #[test]
    fn a_page_that_never_asks_again_costs_bounded_memory() {
        let frames = frames();
        let mut page = PageFrames::new(1.0);
        let now = Instant::now();
        for (frame, _) in frames.iter().cycle().take(20_000) {
            page.take(frame, now);
        }
        assert!(page.devices["phone"].innovations.len() <= MOST_PENDING);
    }
}
