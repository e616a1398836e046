//! What a role may ask for. What is not permitted to a student by name is the teacher's alone.

use crate::lab::Lab;
use crate::messages::Request;
use crate::roles::Role;

/// Why a student may not.
pub const TEACHERS: &str = "only the teacher may do this: a student steers and sees its own phone";
/// It is another's device.
pub const OTHER_DEVICE: &str =
    "this is not your phone: a student steers and sees only the phone that it joined with";
/// It is of another's device, or there is none: who may not see it is not told which.
pub const OTHER_EXPERIMENT: &str = "there is no such experiment of your phone";

/// Whether a role may ask for this.
///
/// # Errors
/// It may not, in a sentence.
pub fn check(role: &Role, lab: &Lab, request: &Request) -> Result<(), &'static str> {
    if *role == Role::Teacher {
        return Ok(());
    }
    match request {
        Request::DisplayRate { .. } | Request::Watch { device: None } => Ok(()),
        Request::Watch {
            device: Some(device),
        }
        | Request::Calibrate { device, .. }
        | Request::Experiment { device, .. }
        | Request::Stop { device }
        | Request::Settings { device, .. }
        | Request::Sensors { device, .. }
        | Request::Estimators { device, .. }
        | Request::Subject { device, .. }
        | Request::CalibrateMagnetometer { device, .. }
        | Request::Rename { device, .. } => of_device(role, device),
        Request::WhatIf { id, .. } | Request::Tune { id, .. } | Request::Allan { id, .. } => {
            of_experiment(role, lab, id)
        }
        _ => Err(TEACHERS),
    }
}

/// Whether a device is this role's.
///
/// # Errors
/// It is not, in a sentence.
pub fn of_device(role: &Role, device: &str) -> Result<(), &'static str> {
    match role.owns(device) {
        true => Ok(()),
        false => Err(OTHER_DEVICE),
    }
}

/// Whether an experiment is of this role's device.
///
/// # Errors
/// It is not, or there is none, in a sentence.
pub fn of_experiment(role: &Role, lab: &Lab, id: &str) -> Result<(), &'static str> {
    match role.device() {
        None => Ok(()),
        Some(own) if lab.experiments.device_of(id).as_deref() == Some(own) => Ok(()),
        Some(_) => Err(OTHER_EXPERIMENT),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use northing_evaluation::RunOptions;
    use serde_json::{Value, json};

    /// Every request that there is, about `device` or the experiment `id`.
    fn requests(device: &str, id: &str) -> Vec<(Value, bool)> {
        vec![
            (json!({"type": "display_rate", "hz": 5.0}), true),
            (json!({"type": "watch"}), true),
            (json!({"type": "watch", "device": device}), true),
            (
                json!({"type": "calibrate", "device": device, "seconds": 5.0}),
                true,
            ),
            (
                json!({"type": "experiment", "device": device, "seconds": 5.0}),
                true,
            ),
            (json!({"type": "stop", "device": device}), true),
            (
                json!({"type": "settings", "device": device, "profile": "lab"}),
                true,
            ),
            (
                json!({"type": "sensors", "device": device, "use": {}}),
                true,
            ),
            (
                json!({"type": "estimators", "device": device, "use": ["mekf"]}),
                true,
            ),
            (
                json!({"type": "subject", "device": device, "estimator": "mekf"}),
                true,
            ),
            (
                json!({"type": "calibrate_magnetometer", "device": device, "action": "start"}),
                true,
            ),
            (
                json!({"type": "rename", "device": device, "name": "A"}),
                true,
            ),
            (json!({"type": "what_if", "id": id}), true),
            (json!({"type": "tune", "id": id}), true),
            (json!({"type": "allan", "id": id}), true),
            (
                json!({"type": "archive_experiment", "id": id, "archived": true}),
                false,
            ),
            (json!({"type": "calibrate_all", "seconds": 5.0}), false),
            (json!({"type": "experiment_all", "seconds": 5.0}), false),
            (json!({"type": "stop_all"}), false),
            (json!({"type": "delete_experiment", "id": id}), false),
            (json!({"type": "remove", "device": device}), false),
            (json!({"type": "virtual_phone", "action": "add"}), false),
            (
                json!({"type": "virtual_phone", "action": "remove", "device": device}),
                false,
            ),
            (
                json!({"type": "input", "action": "add", "kind": "linkoping"}),
                false,
            ),
            (
                json!({"type": "input", "action": "remove", "id": "x"}),
                false,
            ),
        ]
    }

    fn check_json(role: &Role, lab: &Lab, request: &Value) -> Result<(), &'static str> {
        check(role, lab, &serde_json::from_value(request.clone()).unwrap())
    }

    #[test]
    fn a_student_may_what_is_its_own_and_the_teacher_everything() {
        let lab = Lab::new(RunOptions::default());
        let student = Role::Student {
            device: "anna".into(),
        };
        for (request, is_students) in requests("anna", "e1") {
            assert_eq!(
                check_json(&Role::Teacher, &lab, &request),
                Ok(()),
                "{request}"
            );
            let is_of_experiment = request.get("id").is_some();
            // There is no experiment here: that of another and none are refused alike.
            let permitted = is_students && !is_of_experiment;
            let answer = check_json(&student, &lab, &request);
            assert_eq!(answer.is_ok(), permitted, "{request}: {answer:?}");
        }
        for (request, _) in requests("ben", "e1") {
            let is_of_nobody = request.get("device").is_none() && request.get("id").is_none();
            let answer = check_json(&student, &lab, &request);
            let is_of_the_page = request["type"] == "display_rate" || request["type"] == "watch";
            let harmless = is_of_nobody && is_of_the_page;
            assert_eq!(answer.is_ok(), harmless, "{request}: {answer:?}");
        }
    }
}
