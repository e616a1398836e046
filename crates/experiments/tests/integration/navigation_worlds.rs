//! Random worlds: the same for the same seed, and judged by the right numbers. How good the filter is on them is not tested here.

use std::convert::Infallible;

use nalgebra::{Vector2, Vector3};
use northing_core::navigation::gnss_ins::GnssInsConfig;
use northing_evaluation::navigation::{NavigationOptions, run_navigation};
use northing_experiments::navigation_worlds::{WorldRun, Worlds, events};
use northing_recording::WorldFrame;
use northing_simulation::navigation_world::{FaultKind, NavigationWorld, WorldClass};

const FEW: Worlds = Worlds {
    seed: 1,
    first: 0,
    count: 24,
    class: None,
};

#[test]
fn a_seed_is_one_result_with_a_row_a_class() {
    let outcome = FEW.run(&|| ());
    // Once more in two shards: worlds do not depend on their company.
    let shard = |first, count| {
        Worlds {
            first,
            count,
            ..FEW
        }
        .run(&|| ())
        .worlds
    };
    assert_eq!(outcome.worlds, [shard(0, 10), shard(10, 14)].concat());
    assert_eq!(outcome.classes.len(), WorldClass::ALL.len());
    assert_eq!(
        outcome.classes.iter().map(|row| row.worlds).sum::<usize>(),
        24
    );
    assert_eq!(outcome.total.worlds, 24);
    assert_eq!(
        outcome.classes.iter().map(|row| row.lost).sum::<usize>(),
        outcome.total.lost
    );
    assert_eq!(outcome.worst.len(), 10);
    for world in &outcome.worlds {
        let score = &world.all;
        let number = world.description.number;
        for value in [score.rms_m, score.extrapolation_rms_m, score.hold_rms_m] {
            assert_eq!(
                value.is_some(),
                world.first_estimate_s.is_some(),
                "{number}"
            );
            assert!(value.is_none_or(|v| v.is_finite() && v >= 0.0), "{number}");
        }
        assert!(
            score
                .coverage
                .is_none_or(|share| (0.0..=1.0).contains(&share))
        );
        assert!(
            score.instants >= world.can_be_known.instants
                && score.heading_inside <= score.heading_instants
        );
    }
    let ships = Worlds {
        class: Some(WorldClass::Ship),
        ..FEW
    };
    assert_eq!(ships.numbers(), [7, 16]);
}

#[test]
fn extrapolation_is_as_good_as_its_receiver() {
    // A world with velocities, its receiver made perfect: what is left is what moved within an interval.
    let world = |number| NavigationWorld::draw(3, number);
    let fitting = |world: &NavigationWorld| {
        let receiver = &world.description.receiver;
        receiver.faults.is_empty() && receiver.rate_hz >= 5.0 && receiver.velocity_std_m_s.is_some()
    };
    let mut world = (0..200).map(world).find(fitting).unwrap();
    world.description.receiver.latency_s = 0.0;
    for fix in &mut world.fixes {
        let truth = world
            .samples
            .iter()
            .find(|s| (s.time_s - fix.time_s).abs() < 1e-9)
            .unwrap();
        fix.stamp_ns = truth.stamp_ns;
        fix.position[0] = truth.antenna;
        fix.velocity = Some([truth.velocity, fix.velocity.unwrap()[1]]);
    }
    let run = WorldRun::in_world(world, GnssInsConfig::default());
    let score = run.outcome().all;
    let (extrapolated, held) = (
        score.extrapolation_rms_m.unwrap(),
        score.hold_rms_m.unwrap(),
    );
    let top = run.description.top_speed_m_s;
    assert!(
        extrapolated < 0.2 && extrapolated < held,
        "{extrapolated} {held}"
    );
    assert!(
        held < top * 0.2,
        "no older than an interval: {held} at {top} m/s"
    );
}

#[test]
fn what_nobody_can_know_is_marked_and_nothing_else() {
    let worlds = (0..400).map(|number| NavigationWorld::draw(1, number));
    let drift = |world: &NavigationWorld| {
        let faults = &world.description.receiver.faults;
        let drifts = faults.iter().filter(|f| f.kind == FaultKind::Drift).count();
        drifts == 1 && world.description.receiver.correlated_fraction < 0.9
    };
    let mut drifting = worlds.filter(drift);
    let world = drifting.next().unwrap();
    let faults = world.description.receiver.faults.clone();
    let [from, until] = faults
        .iter()
        .find(|f| f.kind == FaultKind::Drift)
        .map(|f| [f.from_s, f.until_s + 20.0])
        .unwrap();
    let run = WorldRun::in_world(world, GnssInsConfig::default());
    let marked = run.instants.iter().filter(|i| !i.can_be_known);
    assert!(marked.clone().count() > 100);
    assert!(
        run.instants
            .iter()
            .all(|i| i.can_be_known != (from..until).contains(&i.time_s))
    );
    let outcome = run.outcome();
    assert_eq!(
        outcome.all.instants,
        outcome.can_be_known.instants + marked.count()
    );
}

/// Course less heading, over all instants at which the vehicle moves, degrees.
fn true_direction(world: &NavigationWorld) -> f64 {
    let moving = world.samples.iter().filter(|s| s.velocity.norm() > 1.0);
    let sum = moving.fold(Vector2::zeros(), |sum: Vector2<f64>, sample| {
        let forward = sample.ned_from_unit * Vector3::x();
        let (forward, along) = (forward.xy(), sample.velocity.xy());
        sum + Vector2::new(forward.dot(&along), forward.perp(&along)).normalize()
    });
    sum.y.atan2(sum.x).to_degrees()
}

/// Units are mounted anyhow, and their receivers err: where a run says which way the vehicle moved, it did.
#[test]
fn the_direction_that_a_vehicle_keeps_to_is_told_rightly() {
    let mut told = 0;
    for number in 0..90 {
        let world = NavigationWorld::draw(3, number);
        let events = events(&world).into_iter().map(Ok::<_, Infallible>);
        let options = NavigationOptions::default();
        let Ok(summary) = run_navigation(events, "world", WorldFrame::Ned, &options, &mut ())
        else {
            continue;
        };
        let Some(travel) = summary.travel else {
            continue;
        };
        let off = travel.right_deg - true_direction(&world);
        let off = (off + 540.0).rem_euclid(360.0) - 180.0;
        // A heading is known to 8 deg, and that of what is driven much better.
        let driven = [
            WorldClass::CarSmooth,
            WorldClass::CarRough,
            WorldClass::CarPhone,
            WorldClass::Bicycle,
        ];
        let most = if driven.contains(&world.description.class) {
            4.0
        } else {
            16.0
        };
        assert!(
            off.abs() < most,
            "world {number}: {travel:?} is {off:.1} deg off"
        );
        told += 1;
    }
    assert!(told >= 30, "{told}");
}
