//! More than there is room for: what is chosen, and that the order of a scan's detections decides nothing.

use rand::seq::SliceRandom as _;

use super::*;

/// Radar of a scene with this many false detections in a square of 2 km.
fn cluttered(false_ones: usize) -> ScanSensor<f64> {
    ScanSensor {
        clutter_density: false_ones as f64 / 4e6,
        ..RADAR
    }
}

/// Scans after which a confirmed track is near a target that crosses the scene behind `false_ones`; `tail` is `birth_speed_tail`.
fn followed<const N: usize, const D: usize>(false_ones: usize, seed: u64, tail: f64) -> usize {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let own = OwnShip::exact(0.0, 0.0, 0.0);
    let sensor = cluttered(false_ones);
    let mut config = MultiTargetConfig::default();
    config.settings.birth_speed_tail = tail;
    let mut tracker = MultiTargetTracker::<f64, 3, N, D>::new(config).unwrap();
    let mut followed = 0;
    for k in 0..80 {
        let time_s = 2.0 * f64::from(k);
        let target = Vector2::new(500.0 - 4.0 * time_s, 300.0);
        // the true detection stands last
        let mut detections = observe(&[], false_ones, &mut rng);
        detections.extend(observe(&[target], 0, &mut rng));
        let scan = Scan {
            sensor: &sensor,
            ..scan(time_s, &own, &detections)
        };
        tracker.scan(&scan).unwrap();
        let confirmed = |t: &&Track<f64, 3>| t.status == TrackStatus::Confirmed;
        followed += usize::from(tracker.tracks().filter(confirmed).any(|track| {
            let x = track.estimate().state;
            (x[0] - target.x).hypot(x[2] - target.y) < 30.0
        }));
    }
    followed
}

#[test]
fn false_detections_in_front_of_the_true_one_do_not_hide_it() {
    for seed in 0..4 {
        let scans = followed::<64, 16>(150, seed, 1.0);
        assert!(scans > 50, "150 false ones, seed {seed}: {scans} of 80");
    }
    // New tracks that may be faster gather more of them: not every seed, but the mean.
    let scans: Vec<_> = (0..12)
        .map(|seed| followed::<64, 16>(150, seed, 3.0))
        .collect();
    let mean = scans.iter().sum::<usize>() / scans.len();
    assert!(mean > 50, "150 false ones: {scans:?} of 80");
}

#[test]
fn a_place_is_drawn_by_lot_where_false_detections_outnumber_them() {
    // Six false ones for every place: each scan gives the target one chance in six to begin.
    let scans: Vec<_> = (0..6)
        .map(|seed| followed::<24, 16>(150, seed, 3.0))
        .collect();
    let found = scans.iter().filter(|scans| **scans > 20).count();
    assert!(found >= 5, "{scans:?} of 80");
}

#[test]
fn the_order_of_detections_decides_nothing() {
    let mut rng = Pcg64Mcg::seed_from_u64(3);
    let own = OwnShip::exact(0.0, 0.0, 0.0).with_std(2.0, 2.0, 0.01);
    let mut trackers: [Tracker; 2] =
        core::array::from_fn(|_| Tracker::new(MultiTargetConfig::default()).unwrap());
    for k in 0..40 {
        let t = f64::from(k);
        let targets = [
            Vector2::new(300.0 + 4.0 * t, 200.0),
            Vector2::new(330.0 + 3.0 * t, 240.0 - t),
        ];
        let mut detections = observe(&targets, 4, &mut rng);
        for tracker in &mut trackers {
            tracker.scan(&scan(t, &own, &detections)).unwrap();
            detections.shuffle(&mut rng);
        }
        let states = |tracker: &Tracker| {
            let mut out: Vec<[f64; 2]> = (confirmed(tracker).iter())
                .map(|track| [track.estimate().state[0], track.estimate().state[2]])
                .collect();
            out.sort_by(|a, b| a[0].total_cmp(&b[0]));
            out
        };
        let (a, b) = (states(&trackers[0]), states(&trackers[1]));
        assert_eq!(a.len(), b.len());
        for (a, b) in a.iter().flatten().zip(b.iter().flatten()) {
            assert_relative_eq!(a, b, epsilon = 1e-6);
        }
    }
    assert!(confirmed(&trackers[0]).len() >= 2);
}

#[test]
fn a_crowded_gate_keeps_the_likeliest_and_counts_the_others() {
    let own = OwnShip::exact(0.0, 0.0, 0.0);
    let mut tracker =
        MultiTargetTracker::<f64, 3, 64, 4>::new(MultiTargetConfig::default()).unwrap();
    for k in 0..6 {
        let one = [radar(500.0, 0.3)];
        tracker.scan(&scan(f64::from(k), &own, &one)).unwrap();
    }
    // from far to near, within two standard deviations
    let crowd: Vec<_> = (0..20)
        .map(|i| radar(506.0 - 0.3 * f64::from(i), 0.3))
        .collect();
    tracker.scan(&scan(6.0, &own, &crowd)).unwrap();
    assert_eq!(tracker.counts().detections_beyond_capacity, 16);
    let track = tracker.tracks().min_by_key(|track| track.id).unwrap();
    let residual = track.innovation.residual[0];
    assert!(residual.abs() < 1.5, "the nearest were kept: {residual}");
}

#[test]
fn tracks_for_which_there_is_no_room_are_counted() {
    let own = OwnShip::exact(0.0, 0.0, 0.0);
    let mut tracker = Tracker::new(MultiTargetConfig::default()).unwrap();
    let many: Vec<_> = (0..40)
        .map(|i| radar(100.0 * f64::from(i + 1), 0.1))
        .collect();
    tracker.scan(&scan(0.0, &own, &many)).unwrap();
    assert_eq!(tracker.counts().detections_beyond_capacity, 0);
    assert_eq!(tracker.counts().tracks_beyond_capacity, 16);
    assert_eq!(tracker.tracks().count(), 24);
    // those that are missed make room for what is seen now
    tracker.scan(&scan(2.0, &own, &many[30..])).unwrap();
    let seen = |range_m: f64| {
        let near = |t: &Track<f64, 3>| {
            let x = t.estimate().state;
            (x[0].hypot(x[2]) - range_m).abs() < 1.0
        };
        tracker.tracks().any(near)
    };
    assert!((31..=40).all(|i| seen(100.0 * f64::from(i))));
}

#[test]
fn what_a_scan_did_to_a_track_is_told() {
    let own = OwnShip::exact(0.0, 0.0, 0.0);
    let mut tracker = Tracker::new(MultiTargetConfig::default()).unwrap();
    let shares = |tracker: &Tracker| -> Vec<(u32, Vec<u32>, f64)> {
        let each = tracker.associations().map(|(track, association)| {
            let candidates = association.candidates();
            let detections = candidates.iter().map(|c| c.detection).collect();
            let sum = candidates
                .iter()
                .fold(association.missed, |s, c| s + c.weight);
            (track.id, detections, sum)
        });
        each.collect()
    };
    let seen = [radar(900.0, 1.0), radar(500.0, 0.3)];
    tracker.scan(&scan(0.0, &own, &seen)).unwrap();
    assert_eq!(
        shares(&tracker),
        [(1, std::vec![0], 1.0), (2, std::vec![1], 1.0)]
    );
    for k in 1..6 {
        tracker.scan(&scan(f64::from(k), &own, &seen[1..])).unwrap();
    }
    let [(2, detections, sum)] = &shares(&tracker)[..] else {
        panic!("{:?}", shares(&tracker));
    };
    assert_eq!(detections, &[0]);
    assert_relative_eq!(*sum, 1.0, epsilon = 1e-12);
    // The confirmed target is not seen any more, until it is given up.
    let mut ends = Vec::new();
    for k in 6..300 {
        tracker.scan(&scan(f64::from(k), &own, &[])).unwrap();
        ends.extend(tracker.ended().copied());
    }
    let [
        EndedTrack {
            id: 2,
            status: TrackStatus::Confirmed,
            end,
        },
    ] = ends[..]
    else {
        panic!("{ends:?}");
    };
    assert!(matches!(end, TrackEnd::Existence | TrackEnd::Uncertain));
    assert_eq!(tracker.counts().deleted_confirmed, 1);
}

#[test]
fn a_tracker_that_grows_goes_on_to_the_bit() {
    let mut rng = Pcg64Mcg::seed_from_u64(3);
    let own = OwnShip::exact(0.0, 0.0, 0.0);
    let config = MultiTargetConfig::default();
    let mut large = MultiTargetTracker::<f64, 3, 64, 16>::new(config).unwrap();
    let mut small = MultiTargetTracker::<f64, 3, 32, 16>::new(config).unwrap();
    let mut grown = MultiTargetTracker::<f64, 3, 64, 16>::new(config).unwrap();
    for k in 0..12 {
        let target = Vector2::new(400.0 + 6.0 * f64::from(k), 100.0);
        let seen = observe(&[target], 3, &mut rng);
        let scan = scan(2.0 * f64::from(k), &own, &seen);
        large.scan(&scan).unwrap();
        if k == 6 {
            grown.restore(small.save().resized().unwrap()).unwrap();
        }
        if k < 6 {
            small.scan(&scan).unwrap();
        } else {
            grown.scan(&scan).unwrap();
        }
    }
    assert!(large.tracks().count() > 2);
    assert_eq!(grown.save(), large.save());
    assert!(
        large.save().resized::<1>().is_none(),
        "tracks would be lost"
    );
}
