use super::*;

fn fix(time_s: f64, [latitude, longitude]: [f64; 2], std: f64) -> Event {
    let fix = GnssPosition {
        latitude_rad: latitude.to_radians(),
        longitude_rad: longitude.to_radians(),
        height_m: Some(500.0),
        std_m: Some([std; 3]),
        ..GnssPosition::default()
    };
    Event {
        time_ns: (time_s * 1e9) as i64,
        sample: Sample::GnssPosition(fix),
    }
}

fn rate(time_s: f64) -> Event {
    Event {
        time_ns: (time_s * 1e9) as i64,
        sample: Sample::AngularRate(Vector3::zeros()),
    }
}

/// Times of the fixes that are taken and of those that are left out, s.
fn fates(events: &[Event]) -> Result<[Vec<f64>; 2], EvaluationError> {
    let mut consensus = FixConsensus::default();
    let mut fates = [Vec::new(), Vec::new()];
    let mut order = Vec::new();
    let mut take = |(event, left_out): (Event, bool)| {
        order.push(event.time_ns);
        if matches!(event.sample, Sample::GnssPosition(_)) {
            fates[usize::from(left_out)].push(event.time_ns as f64 * 1e-9);
        }
    };
    for event in events {
        match consensus.look_at(event) {
            Step::Take => take((*event, false)),
            Step::Wait => core::iter::from_fn(|| consensus.next()).for_each(&mut take),
        }
    }
    consensus.end()?;
    core::iter::from_fn(|| consensus.next()).for_each(&mut take);
    assert!(order.is_sorted() && order.len() == events.len());
    Ok(fates)
}

const HERE: [f64; 2] = [47.0, 8.0];
/// 110 m to the north of it.
const NEAR: [f64; 2] = [47.001, 8.0];
const NEW_YORK: [f64; 2] = [40.7, -74.0];

#[test]
fn fixes_that_agree_are_taken_from_the_first_on() {
    let events = [
        rate(0.0),
        fix(0.5, HERE, 2.0),
        rate(1.0),
        fix(1.5, NEAR, 2.0),
        fix(2.5, HERE, 2.0),
    ];
    assert_eq!(fates(&events).unwrap(), [vec![0.5, 1.5, 2.5], vec![]]);
}

#[test]
fn stale_and_repeated_first_fixes_are_left_out() {
    let events = [
        fix(0.0, NEW_YORK, 5.0),
        fix(1.0, HERE, 2.0),
        fix(2.0, NEAR, 2.0),
    ];
    assert_eq!(fates(&events).unwrap(), [vec![1.0, 2.0], vec![0.0]]);
    // One place again and again is no agreement.
    let mut events: Vec<_> = (0..10)
        .map(|k| fix(f64::from(k), [0.01, 0.01], 5.0))
        .collect();
    events.extend([fix(10.0, HERE, 2.0), rate(10.5), fix(11.0, NEAR, 2.0)]);
    let [taken, left_out] = fates(&events).unwrap();
    assert_eq!((taken, left_out.len()), (vec![10.0, 11.0], 10));
    // Nor does a fix that knows nothing agree with everything.
    let events = [
        fix(0.0, [0.01, 0.01], 9e4),
        fix(1.0, HERE, 2.0),
        fix(2.0, NEAR, 2.0),
    ];
    assert_eq!(fates(&events).unwrap()[1], [0.0]);
    // One between two that agree.
    let events = [
        fix(0.0, HERE, 2.0),
        fix(1.0, NEW_YORK, 2.0),
        fix(2.0, NEAR, 2.0),
    ];
    assert_eq!(fates(&events).unwrap(), [vec![0.0, 2.0], vec![1.0]]);
}

#[test]
fn one_place_counts_where_nothing_contradicts_it() {
    assert_eq!(fates(&[fix(0.0, HERE, 2.0), rate(9.0)]).unwrap()[0], [0.0]);
    let same: Vec<_> = (0..100).map(|k| fix(f64::from(k), HERE, 2.0)).collect();
    assert_eq!(fates(&same).unwrap()[0].len(), 100);
    assert_eq!(fates(&[rate(0.0)]).unwrap()[0], [0.0; 0]);
    // A fix a minute, of a car.
    let slow: Vec<_> = (0..5)
        .map(|k| fix(60.0 * f64::from(k), [47.0 + 0.01 * f64::from(k), 8.0], 2.0))
        .collect();
    assert_eq!(fates(&slow).unwrap()[0].len(), 5);
}

#[test]
fn fixes_that_never_agree_are_an_error() {
    let wild: Vec<_> = (0..200)
        .map(|k| {
            fix(
                f64::from(k),
                [0.5 + f64::from(k % 80), f64::from(k * 37 % 170)],
                2.0,
            )
        })
        .collect();
    let message = fates(&wild).unwrap_err().to_string();
    assert!(message.contains("200 fixes"), "{message}");
}

#[test]
fn what_waits_is_bounded_and_one_place_then_counts() {
    let mut consensus = FixConsensus::default();
    assert_eq!(consensus.look_at(&fix(0.0, HERE, 2.0)), Step::Wait);
    let mut most = 0;
    let mut released = 0;
    for k in 1..=(MOST_WAITING as i64 + 10) {
        let event = rate(k as f64 * 0.005);
        if consensus.look_at(&event) == Step::Take {
            released += 1;
        }
        while let Some((event, left_out)) = consensus.next() {
            assert!(!left_out, "{event:?}");
            released += 1;
        }
        most = most.max(consensus.waiting.len());
    }
    assert!(most <= MOST_WAITING + 1);
    assert_eq!(released, MOST_WAITING as i64 + 11);
}

#[test]
fn a_long_silence_between_fixes_that_disagree_lets_the_oldest_go() {
    let mut consensus = FixConsensus::default();
    consensus.look_at(&fix(0.0, NEW_YORK, 2.0));
    consensus.look_at(&fix(1.0, HERE, 2.0));
    let mut left_out = 0;
    for k in 0..MOST_WAITING {
        consensus.look_at(&rate(1.0 + k as f64 * 0.005));
        while let Some((_, is_left_out)) = consensus.next() {
            left_out += u64::from(is_left_out);
        }
    }
    assert_eq!(left_out, 2);
    consensus.look_at(&fix(1400.0, NEAR, 2.0));
    assert!(consensus.found);
}

#[test]
fn distances_are_of_two_digits() {
    for (metres, words) in [
        (4_321.0, "4321 m"),
        (12_345.0, "12 km"),
        (123_456.0, "120 km"),
        (9_234_000.0, "9,200 km"),
        (12_034_000.0, "12,000 km"),
    ] {
        assert_eq!(distance(metres), words);
    }
}
