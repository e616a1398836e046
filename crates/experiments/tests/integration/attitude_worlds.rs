//! Attitude on random worlds end to end: one result for a seed, worlds free of their company, sound scores, perfect sensors.

use northing_evaluation::EstimatorKind;
use northing_evaluation::attitude::{Profile, RunOptions};
use northing_experiments::attitude_worlds::{Cause, Sensing, WorldRun, Worlds, baseline};
use northing_recording::Sample;
use northing_simulation::attitude_world::{AttitudeWorld, HeadingSource, WorldFault, WorldMotion};

fn few() -> Worlds {
    Worlds {
        first: 4,
        count: 12,
        estimators: vec![EstimatorKind::BoundedVelocity, EstimatorKind::Complementary],
        ..Worlds::thousand()
    }
}

#[test]
fn a_seed_is_one_result_with_a_row_a_motion() {
    let outcome = few().run(&|| ()).unwrap();
    // Once more in two shards: worlds do not depend on their company.
    let shard = |first, count| {
        let shard = Worlds {
            first,
            count,
            ..few()
        };
        shard.run(&|| ()).unwrap().worlds
    };
    assert_eq!(outcome.worlds, [shard(4, 5), shard(9, 7)].concat());
    assert_eq!(outcome.subject(), "bounded-velocity");
    let of = |name, sensing| outcome.estimator(name, sensing).unwrap();
    for name in ["bounded-velocity", "complementary", baseline::NAME] {
        let inertial = of(name, Sensing::Inertial);
        assert_eq!(inertial.total.worlds, 12);
        assert_eq!(
            inertial.motions.iter().map(|row| row.worlds).sum::<usize>(),
            12
        );
        assert_eq!(inertial.motions.len(), WorldMotion::ALL.len());
        assert_eq!(inertial.total.without_estimate, 0);
        let with_heading = outcome
            .worlds
            .iter()
            .filter(|world| !matches!(world.description.board.heading, HeadingSource::None));
        assert_eq!(of(name, Sensing::All).total.worlds, with_heading.count());
        assert_eq!(inertial.worst.len(), 10);
    }
    // VQF is as good as itself, and states nothing.
    let vqf = of(baseline::NAME, Sensing::Inertial);
    assert_eq!(vqf.total.tilt_over_vqf, Some(1.0));
    assert!(vqf.total.tilt.is_none() && vqf.confusion.is_none());
    let subject = of("bounded-velocity", Sensing::All);
    let stated = subject.total.tilt.unwrap();
    assert!((0.0..=1.0).contains(&stated.pooled_coverage));
    assert!((0.0..=1.0).contains(&stated.expected_share));
    let confusion = subject.confusion.as_ref().unwrap();
    let counted: usize = confusion.rows.iter().flat_map(|(_, counts)| counts).sum();
    assert_eq!(counted, subject.total.worlds);
    let running = Worlds {
        motion: Some(WorldMotion::Running),
        ..few()
    };
    assert_eq!(running.numbers(), [12]);
}

#[test]
fn settings_reach_the_estimators_and_bad_ones_are_refused() {
    let with = |setting: &str| Worlds {
        count: 1,
        estimators: vec![EstimatorKind::Mekf],
        settings: vec![setting.to_owned()],
        ..Worlds::thousand()
    };
    let tilt = |setting| {
        let outcome = with(setting).run(&|| ()).unwrap();
        let of = outcome.estimator("mekf", Sensing::Inertial).unwrap();
        of.total.tilt.unwrap().median_nees
    };
    assert!(tilt("accelerometer_std=0.02") > 2.0 * tilt("accelerometer_std=2"));
    assert!(with("accelerometer_std=-1").run(&|| ()).is_err());
    assert!(with("no_such=1").run(&|| ()).is_err());
}

/// A world without a fault whose sensors are made perfect.
fn perfect(motion: WorldMotion) -> AttitudeWorld {
    let fits = |world: &AttitudeWorld| {
        let description = &world.description;
        description.motion == motion
            && description.fault == WorldFault::None
            && description.board.gyroscope.rate_hz >= 100.0
            && description.board.heading.name() == "magnetometer"
    };
    let worlds = (0..500).filter(|number| WorldMotion::of(*number) == motion);
    let mut world = (worlds.map(|number| AttitudeWorld::draw(2, number)))
        .find(fits)
        .expect("one of five hundred");
    let (gravity, field) = (world.description.gravity_m_s2, world.description.field_ut);
    let mut truth = None;
    for event in world.events.iter_mut().rev() {
        let up = nalgebra::Vector3::z() * gravity;
        match (&mut event.sample, truth) {
            (Sample::Reference(reference), _) => truth = Some(reference.attitude),
            (Sample::SpecificForce(force), Some(q)) => *force = q.inverse() * up,
            (Sample::MagneticField(measured), Some(q)) => {
                *measured = q.inverse() * nalgebra::Vector3::from(field);
            }
            _ => {}
        }
    }
    world
}

#[test]
fn with_perfect_forces_and_fields_everybody_is_right() {
    let options = few().options().unwrap();
    let run = WorldRun::in_world(&perfect(WorldMotion::Walking), None, &options);
    for score in run.runs.iter().map(|run| &run.score) {
        let (tilt, heading) = (score.tilt_rms_deg.unwrap(), score.heading_rms_deg.unwrap());
        let name = (score.estimator, score.sensing);
        assert!(tilt < 1.5, "{name:?}: {tilt}");
        let has_north = score.sensing == Sensing::All;
        assert_eq!(score.has_north, has_north);
        assert!(!has_north || heading < 3.0, "{name:?}: {heading}");
    }
}

#[test]
fn true_causes_are_faults_or_what_does_not_fit() {
    let worlds = Worlds {
        count: 140,
        motion: Some(WorldMotion::Desk),
        estimators: vec![EstimatorKind::Mekf, EstimatorKind::BoundedVelocity],
        ..Worlds::thousand()
    };
    let outcome = worlds.run(&|| ()).unwrap();
    for world in &outcome.worlds {
        let fault = world.description.fault;
        let magnetic = matches!(
            fault,
            WorldFault::MagnetometerNoise | WorldFault::MagneticDisturbance | WorldFault::HardIron
        );
        for score in world.scores.iter().filter(|score| score.named.is_some()) {
            let causes = &score.true_causes;
            let shows =
                fault != WorldFault::None && !(magnetic && score.sensing == Sensing::Inertial);
            if shows {
                assert_eq!(causes[0], Cause::Fault(fault));
            } else if score.estimator == "mekf" {
                // Nothing moves, and the accelerometer's R is made for a hand.
                assert_eq!(causes[0], Cause::AccelerometerRTooLarge);
            } else if score.sensing == Sensing::Inertial {
                assert_eq!(causes[0], Cause::NONE);
            }
        }
    }
}

/// A fault is the only true cause where the estimate is worse for it, and one beside nothing where it is not.
#[test]
fn a_fault_that_costs_nothing_need_not_be_named() {
    let worlds = Worlds {
        count: 126,
        motion: Some(WorldMotion::FastTurns),
        estimators: vec![EstimatorKind::BoundedVelocity],
        ..Worlds::thousand()
    };
    let outcome = worlds.run(&|| ()).unwrap();
    let mut felt = [0, 0];
    for world in &outcome.worlds {
        let score = world.score("bounded-velocity", Sensing::Inertial).unwrap();
        let nothing = score.true_causes.contains(&Cause::NONE);
        match world.description.fault {
            WorldFault::Hole => assert!(!nothing, "{:?}", score.true_causes),
            WorldFault::None => assert!(nothing),
            // A magnetometer that is not used has no fault.
            WorldFault::HardIron => assert_eq!(score.true_causes[0], Cause::NONE),
            _ => felt[usize::from(!nothing)] += 1,
        }
    }
    assert!(felt[0] > 0 && felt[1] > 0, "{felt:?}");
}

/// Slow turns and noise: offsets of stretches scatter, and once a rate or a jump of the clock was seen in them.
#[test]
fn a_true_reference_is_not_refused_for_its_clock() {
    for number in [919, 1438, 2950] {
        let events = AttitudeWorld::draw(1, number).events;
        let events = events.into_iter().map(Ok::<_, std::io::Error>);
        let options = RunOptions::new(EstimatorKind::Mekf, Profile::default());
        let summary = northing_evaluation::run(events, &options, &mut ()).unwrap();
        assert!(summary.error_deg.is_some(), "world {number}");
    }
}
