//! Random worlds: the same for the same seed, and judged by the right numbers. How good the filter is on them is not tested here.

use northing_core::navigation::gnss_ins::GnssInsConfig;
use northing_experiments::navigation_worlds::{WorldRun, Worlds};
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
