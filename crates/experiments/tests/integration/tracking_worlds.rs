//! Random scenes for trackers: the same for the same seed, judged by the right numbers, and what holds for every scene. How good the trackers
//! are on the mean is in docs/results/tracking_worlds.md.

#![allow(clippy::unwrap_used)]

use northing_experiments::tracking_worlds::{Scenes, ScenesOutcome};
use northing_simulation::tracking_world::SceneClass;

const FEW: Scenes = Scenes {
    seed: 1,
    first: 0,
    count: 12,
    class: None,
};

/// Without times, which differ from run to run.
fn untimed(mut outcome: ScenesOutcome) -> ScenesOutcome {
    for scene in &mut outcome.scenes {
        for score in &mut scene.trackers {
            score.s_per_scan = 0.0;
        }
    }
    outcome
}

#[test]
fn a_seed_is_one_result_with_a_row_for_each_class_and_tracker() {
    let outcome = untimed(FEW.run(&|| ()));
    // Once more in two parts: scenes do not depend on their company.
    let part = |first, count| {
        let part = Scenes {
            first,
            count,
            ..FEW
        };
        untimed(part.run(&|| ())).scenes
    };
    assert_eq!(outcome.scenes, [part(0, 5), part(5, 7)].concat());
    assert_eq!(outcome.classes.len(), 3 * (SceneClass::ALL.len() + 1));
    let all: Vec<_> = outcome
        .classes
        .iter()
        .filter(|row| row.scenes_with == "all")
        .collect();
    assert_eq!(all.len(), 3);
    for row in all {
        let of_classes = outcome
            .classes
            .iter()
            .filter(|one| one.tracker == row.tracker && one.scenes_with != "all");
        assert_eq!(of_classes.map(|one| one.scenes).sum::<usize>(), row.scenes);
        assert_eq!(row.scenes, 12);
        assert!((0.0..=1.0).contains(&row.coverage.mean));
        assert!(row.gospa.mean > 0.0 && row.gospa.half_width > 0.0);
    }
    let boats = Scenes {
        class: Some(SceneClass::Boats),
        ..FEW
    };
    assert_eq!(boats.numbers(), [1, 5, 9]);
    assert_eq!(outcome.worst.len(), 10);
    let gospa = |number: &u64| outcome.scenes[*number as usize].trackers[2].gospa;
    assert!(
        outcome
            .worst
            .windows(2)
            .all(|pair| gospa(&pair[0]) >= gospa(&pair[1]))
    );
}

#[test]
fn no_scene_leaves_the_tracker_without_room_or_without_numbers() {
    for scene in (Scenes { seed: 4, ..FEW }).run(&|| ()).scenes {
        for score in &scene.trackers {
            assert_eq!(score.without_room, 0, "{}", scene.description);
            let numbers = [score.gospa, score.ospa, score.coverage, score.switches];
            assert!(numbers.iter().all(|value| value.is_finite()), "{score:?}");
        }
    }
}
