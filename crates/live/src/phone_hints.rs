//! What the lab tells the person with the phone, in the answers to the phone's batches.
//!
//! Only what that person can act on. The phone shows the sentences of the latest answer.

use serde_json::{Value, json};

use crate::messages::{DeviceStatus, UnderWay};
use northing_evaluation::statistics::lamp::Tone;

/// The end of an experiment is near: the phone goes back where it lay.
const GO_BACK_S: f64 = 8.0;

/// What is said to a phone whose identifier another page has, too.
pub const SHARED_IDENTIFIER: &str = "Another page has this phone's identity, perhaps a second tab. \
    The lab shows this one as a device of its own: give it its own name, or close the other page.";

/// The `commands` of an answer.
#[must_use]
pub fn commands(status: &DeviceStatus, shared: bool) -> Vec<Value> {
    let mut commands = Vec::new();
    // A page has words of its own for these, in its own language.
    if let Some(under_way) = &status.under_way {
        commands.push(json!({"say": under_way.sentence(), "under_way": under_way}));
    }
    if shared {
        commands.push(json!({"say": SHARED_IDENTIFIER, "shared": true}));
    }
    let broken = status.session.health.iter().filter(|r| r.tone == Tone::Bad);
    commands.extend(broken.map(|remark| json!({"say": remark.text})));
    commands
}

impl UnderWay {
    fn sentence(&self) -> String {
        match *self {
            Self::Calibration { remaining_s } => {
                let seconds = remaining_s.ceil();
                format!("Calibrating: do not touch the phone. {seconds:.0} s left.")
            }
            Self::Experiment { remaining_s } if remaining_s > GO_BACK_S => format!(
                "Experiment: move the phone, then lay it back where it was. {:.0} s left.",
                remaining_s.ceil()
            ),
            Self::Experiment { remaining_s } => format!(
                "Experiment: lay the phone back where it was, now. {:.0} s left.",
                remaining_s.ceil()
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use northing_evaluation::statistics::lamp::Remark;

    fn said(status: &DeviceStatus, shared: bool) -> Vec<String> {
        let commands = commands(status, shared);
        let text = |command: &Value| command["say"].as_str().unwrap().to_owned();
        commands.iter().map(text).collect()
    }

    #[test]
    fn a_phone_hears_what_is_under_way_and_what_is_broken() {
        let mut status = DeviceStatus::default();
        status.session.health = vec![
            Remark::new(Tone::Good, "All sensors deliver."),
            Remark::new(Tone::Warn, "Coarse values."),
        ];
        assert!(said(&status, false).is_empty());
        status.under_way = Some(UnderWay::Calibration { remaining_s: 3.2 });
        assert_eq!(
            said(&status, false),
            ["Calibrating: do not touch the phone. 4 s left."]
        );
        status.under_way = Some(UnderWay::Experiment { remaining_s: 20.0 });
        let gone = "The gyroscope has stopped delivering.";
        status.session.health.push(Remark::new(Tone::Bad, gone));
        let all = said(&status, true);
        assert!(all[0].contains("move the phone"), "{all:?}");
        assert_eq!(all[1..], [SHARED_IDENTIFIER, gone]);
        status.under_way = Some(UnderWay::Experiment { remaining_s: 2.0 });
        assert!(said(&status, false)[0].contains("now"));
    }
}
