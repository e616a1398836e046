//! What is found again, what is not taken and said, and a disk that refuses.

use northing_evaluation::{EstimatorKind, Profile, RunOptions};
use northing_recording::lab_session::SAMPLES;
use northing_simulation::{VirtualPhone, VirtualPhoneConfig};
use tokio::sync::broadcast::Receiver;

use super::*;
use crate::session::DeviceSession;
use crate::session::experiment::ExperimentRun;

fn opened(folder: &Path) -> (Opened, Receiver<Told>) {
    let (pages, told) = broadcast::channel(16);
    (open(folder, pages), told)
}

fn saved(id: &str, name: &str) -> SavedDevice {
    let session = DeviceSession::new(RunOptions::new(EstimatorKind::Mekf, Profile::Lab));
    let name = Some(name.to_owned());
    SavedDevice::of(id, name, &session.unwrap(), CalibrationTimes::default())
}

fn finished(id: &str) -> Finished {
    let phone = VirtualPhone::new(VirtualPhoneConfig {
        duration_s: Some(3.0),
        ..VirtualPhoneConfig::default()
    });
    let mut run = ExperimentRun::new(3.0, "swing").unwrap();
    run.begin(0, Vec::new());
    run.note_change("the sensors in use");
    phone.unwrap().events().for_each(|event| {
        run.add(&event);
    });
    let finished = Finished {
        id: id.to_owned(),
        device: "anna".to_owned(),
        device_name: "Anna".to_owned(),
        at: "then".to_owned(),
        options: RunOptions::new(EstimatorKind::Mekf, Profile::Lab),
        estimators: vec![EstimatorKind::Integration, EstimatorKind::Mekf],
        subject: EstimatorKind::Mekf,
        summaries: Default::default(),
        hash: String::new(),
        originals: Default::default(),
        experiment: run.finish(),
    };
    finished.evaluated().unwrap()
}

#[test]
fn devices_and_experiments_are_found_again() {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path().join("lab");
    let (first, _told) = opened(&folder);
    assert!(first.notes.is_empty(), "{:?}", first.notes);
    let persistence = first.persistence.unwrap();
    let before = finished("e7");
    for name in ["A", "An", "Anna"] {
        persistence.save_device(saved("anna/../é", name));
    }
    assert!(persistence.save_experiment(&before));
    persistence.close();
    let (second, _told) = opened(&folder);
    assert!(second.notes.is_empty(), "{:?}", second.notes);
    assert_eq!(second.last_number, 7);
    let persistence = second.persistence.unwrap();
    let device = persistence.device("anna/../é").unwrap();
    assert_eq!(device, saved("anna/../é", "Anna"));
    let [experiment] = &second.experiments[..] else {
        panic!("{:?}", second.experiments);
    };
    assert_eq!(experiment, &SavedExperiment::of(&before));
    let again = experiment
        .finished(&persistence.experiment_folder("e7"))
        .unwrap();
    assert_eq!(again.experiment.events, before.experiment.events);
    assert_eq!(
        (&again.summaries, &again.hash),
        (&before.summaries, &before.hash)
    );
    assert_eq!(SavedExperiment::of(&again), SavedExperiment::of(&before));
    assert_eq!(again.message(), before.message());
    persistence.delete_experiment("e7").unwrap();
    persistence.close();
    assert!(opened(&folder).0.experiments.is_empty());
}

#[test]
fn samples_that_are_gone_or_others_are_a_reason() {
    let root = tempfile::tempdir().unwrap();
    let persistence = opened(root.path()).0.persistence.unwrap();
    let experiment = finished("e1");
    assert!(persistence.save_experiment(&experiment));
    let (saved, folder) = (
        SavedExperiment::of(&experiment),
        persistence.experiment_folder("e1"),
    );
    let reason = || saved.finished(&folder).unwrap_err();
    let others = northing_recording::wire::events::encode(&experiment.experiment.events[1..]);
    std::fs::write(folder.join(SAMPLES), others).unwrap();
    assert!(
        reason().contains("not the samples that were measured"),
        "{}",
        reason()
    );
    std::fs::remove_file(folder.join(SAMPLES)).unwrap();
    assert!(reason().contains("not there any more"), "{}", reason());
    let mut others = saved.clone();
    std::fs::write(
        folder.join(SAMPLES),
        northing_recording::wire::events::encode(&experiment.experiment.events),
    )
    .unwrap();
    others.subject = "mine.py:Mine".to_owned();
    assert!(
        others
            .finished(&folder)
            .unwrap_err()
            .contains("mine.py:Mine")
    );
}

#[test]
fn what_is_damaged_foreign_or_newer_is_said_and_kept_under_another_name() {
    let root = tempfile::tempdir().unwrap();
    let persistence = opened(root.path()).0.persistence.unwrap();
    let experiment = finished("e3");
    assert!(persistence.save_experiment(&experiment));
    for id in ["anna", "ben", "cleo"] {
        persistence.save_device(saved(id, id));
    }
    persistence.close();
    let devices = devices_of(root.path());
    let (anna, ben) = (
        devices.join(device_file("anna")),
        devices.join(device_file("ben")),
    );
    std::fs::write(&anna, "{ half of").unwrap();
    let newer = std::fs::read_to_string(&ben).unwrap();
    let newer = newer.replacen("\"version\": 1", "\"version\": 2", 1);
    std::fs::write(&ben, &newer).unwrap();
    std::fs::write(devices.join("holiday.txt"), "a photograph").unwrap();
    let facts = experiments_of(root.path()).join("e3").join(FACTS);
    std::fs::write(&facts, [0xff, 0xfe]).unwrap();

    let (again, _told) = opened(root.path());
    assert_eq!(again.notes.len(), 4, "{:?}", again.notes);
    assert!(
        again
            .notes
            .iter()
            .all(|note| note.contains(" is kept as ") && !note.contains('\n'))
    );
    assert!(
        again
            .notes
            .iter()
            .any(|note| note.contains("newer version"))
    );
    assert!(again.experiments.is_empty());
    assert_eq!(again.last_number, 3, "its number is not given again");
    let persistence = again.persistence.unwrap();
    assert!(persistence.device("anna").is_none() && persistence.device("ben").is_none());
    assert_eq!(persistence.device("cleo"), Some(saved("cleo", "cleo")));
    // Written anew, beside what was there.
    persistence.save_device(saved("ben", "Ben"));
    persistence.close();
    let text = |name: &str| std::fs::read_to_string(devices.join(name)).unwrap();
    assert_eq!(
        text(&format!("{}.set-aside", device_file("anna"))),
        "{ half of"
    );
    assert_eq!(text(&format!("{}.set-aside", device_file("ben"))), newer);
    assert_eq!(text("holiday.txt.set-aside"), "a photograph");
    let (third, _told) = opened(root.path());
    assert!(third.notes.is_empty(), "said once: {:?}", third.notes);
    assert!(third.persistence.unwrap().device("ben").is_some());
}

/// A folder that cannot be written stands for a full disk: the same way through the program. Root may write anywhere, so a file
/// stands where the folder should be.
#[test]
fn a_disk_that_refuses_is_said_once_and_used_again_when_it_can_be() {
    let root = tempfile::tempdir().unwrap();
    let (opened, mut told) = opened(root.path());
    let persistence = opened.persistence.unwrap();
    let devices = devices_of(root.path());
    std::fs::remove_dir(&devices).unwrap();
    let wait = |done: &dyn Fn() -> bool| {
        let since = Instant::now();
        while !done() {
            assert!(since.elapsed() < Duration::from_secs(20));
            std::thread::sleep(Duration::from_millis(10));
        }
    };
    persistence.save_device(saved("anna", "Anna"));
    wait(&|| persistence.problem().is_some());
    persistence.save_device(saved("ben", "Ben"));
    std::thread::sleep(3 * GATHER);
    let text = told.try_recv().unwrap();
    assert!(text.contains("until it can be written"), "{text}");
    assert!(told.try_recv().is_err(), "once");
    private::create_folder(&devices).unwrap();
    persistence.save_device(saved("anna", "Anna"));
    wait(&|| persistence.problem().is_none());
    assert!(devices.join(device_file("anna")).is_file());
}

#[test]
fn a_folder_that_cannot_be_made_or_is_another_labs_is_said() {
    let root = tempfile::tempdir().unwrap();
    let file = root.path().join("file");
    std::fs::write(&file, "").unwrap();
    let (refused, _told) = opened(&file.join("lab"));
    assert!(refused.persistence.is_none() && refused.notes.len() == 1);
    let folder = root.path().join("lab");
    let first = opened(&folder).0;
    let (second, _told) = opened(&folder);
    assert!(second.persistence.is_none());
    assert!(
        second.notes[0].starts_with("Another lab writes"),
        "{:?}",
        second.notes
    );
    first.persistence.unwrap().close();
    assert!(opened(&folder).0.persistence.is_some());
}
