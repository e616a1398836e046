//! A request to every device at once: calibrate, start, stop; and what each one that refuses says.

use std::sync::Arc;

use serde::Serialize;
use serde_json::Value;
use tokio::task::JoinSet;

use crate::lab::{Device, Lab, lock};
use crate::messages::{Command, Request};

/// What a page asks of a whole class.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(rename_all = "snake_case")]
pub enum Asked {
    /// Calibrate at rest.
    Calibrate,
    /// Begin an experiment.
    Experiment,
    /// End what is under way.
    Stop,
}

/// One request to every device.
#[derive(Debug, Clone, PartialEq)]
pub struct WholeClass {
    asked: Asked,
    command: Command,
}

/// What became of it. It answers the page that asked.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Everyone {
    /// What was asked.
    pub asked: Asked,
    /// Devices that do it.
    pub done: usize,
    /// Devices that do not, by name.
    pub refused: Vec<Refusal>,
    /// The number of the request that it answers.
    #[cfg_attr(test, ts(type = "unknown"))]
    pub request: Value,
}

/// A device that does not do what was asked.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Refusal {
    /// The device.
    pub device: String,
    /// What people call it.
    pub name: String,
    /// Why not, in a sentence.
    pub text: String,
}

impl WholeClass {
    /// The request, if it is one to every device.
    pub(crate) fn of(request: &Request) -> Option<Self> {
        let (asked, command) = match request {
            Request::CalibrateAll { seconds } => (Asked::Calibrate, Command::Calibrate(*seconds)),
            Request::ExperimentAll { seconds, name } => (
                Asked::Experiment,
                Command::Experiment(*seconds, name.clone()),
            ),
            Request::StopAll => (Asked::Stop, Command::Stop),
            _ => return None,
        };
        Some(Self { asked, command })
    }
}

/// Asks every device, all at the same time: a slow one holds nobody up.
pub(crate) async fn ask(lab: &Arc<Lab>, what: WholeClass, request: Value) -> Everyone {
    let mut answers = JoinSet::new();
    for device in lab.devices() {
        let (lab, what) = (lab.clone(), what.clone());
        answers.spawn(async move {
            let answer = ask_one(&lab, &device, what).await;
            let name = lock(&device.status).name.clone();
            answer.map_err(|text| Refusal {
                device: device.id.clone(),
                name,
                text,
            })
        });
    }
    let mut told = Everyone {
        asked: what.asked,
        done: 0,
        refused: Vec::new(),
        request,
    };
    while let Some(answer) = answers.join_next().await {
        match answer {
            Ok(Ok(())) => told.done += 1,
            Ok(Err(refusal)) => told.refused.push(refusal),
            // A device that broke off is told by the lab.
            Err(_) => {}
        }
    }
    told.refused
        .sort_by(|a, b| (&a.name, &a.device).cmp(&(&b.name, &b.device)));
    told
}

/// A device that is silent is not begun with: it would wait for samples while the others measure.
async fn ask_one(lab: &Lab, device: &Device, what: WholeClass) -> Result<(), String> {
    let silence = {
        let status = lock(&device.status);
        (!status.delivers).then(|| status.silence.clone())
    };
    match silence {
        Some(silence) if what.asked != Asked::Stop => Err(silence),
        _ => device.command(what.command, lab.now_ns()).await,
    }
}

#[cfg(test)]
mod tests {
    use northing_evaluation::RunOptions;
    use northing_simulation::VirtualPhoneConfig;
    use serde_json::json;

    use super::*;
    use crate::virtual_phones;

    fn request(value: Value) -> WholeClass {
        WholeClass::of(&serde_json::from_value(value).unwrap()).unwrap()
    }

    async fn until(lab: &Lab, what: impl Fn(&Lab) -> bool) {
        for _ in 0..600 {
            if what(lab) {
                return;
            }
            tokio::time::sleep(std::time::Duration::from_millis(50)).await;
        }
        panic!("waited half a minute");
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn all_that_send_begin_together_and_each_that_does_not_says_why() {
        let lab = Lab::new(RunOptions::default());
        for _ in 0..3 {
            virtual_phones::add(&lab, VirtualPhoneConfig::default(), None).unwrap();
        }
        lab.device("locked", "Ada's phone", "phyphox").unwrap();
        until(&lab, |lab| {
            lab.statuses().iter().filter(|d| d.delivers).count() == 3
        })
        .await;

        let calibrate = request(json!({"type": "calibrate_all", "seconds": 60}));
        let told = ask(&lab, calibrate, json!(7)).await;
        assert_eq!((told.asked, told.done), (Asked::Calibrate, 3));
        assert_eq!(told.request, json!(7));
        let [refused] = &told.refused[..] else {
            panic!("{told:?}")
        };
        assert_eq!(refused.name, "Ada's phone");
        assert!(
            refused.text.starts_with("No sample has come yet."),
            "{refused:?}"
        );
        let calibrating = |lab: &Lab| -> usize {
            let all = lab.statuses();
            all.iter().filter(|d| d.session.is_calibrating).count()
        };
        assert_eq!(calibrating(&lab), 3);

        let stop = request(json!({"type": "stop_all"}));
        let told = ask(&lab, stop, Value::Null).await;
        assert_eq!((told.done, told.refused.len()), (4, 0));
        assert_eq!(calibrating(&lab), 0);

        // One is busy already: the others start, and it says so in its own words.
        let busy = lab.find("virtual-2").unwrap();
        let own = Command::Experiment(60.0, "own".to_owned());
        busy.command(own, lab.now_ns()).await.unwrap();
        let start = request(json!({"type": "experiment_all", "seconds": 60, "name": "Turn"}));
        let told = ask(&lab, start, Value::Null).await;
        assert_eq!(told.done, 2);
        let said: Vec<(&str, &str)> = told
            .refused
            .iter()
            .map(|r| (r.name.as_str(), r.text.as_str()))
            .collect();
        assert_eq!(said[0].0, "Ada's phone");
        assert_eq!(
            said[1],
            (
                "Virtual phone 2",
                "an experiment is under way; stop it first"
            )
        );

        // What no device takes is refused by each.
        let told = ask(
            &lab,
            request(json!({"type": "calibrate_all", "seconds": -1})),
            Value::Null,
        )
        .await;
        assert_eq!((told.done, told.refused.len()), (0, 4));
    }
}
