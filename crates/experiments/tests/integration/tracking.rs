//! Campaigns on the scenario of Wilthil & Brekke against expected values of an independent
//! reproduction, and against themselves on other numbers of threads and shards.

#![allow(clippy::unwrap_used)]

use crate::tracking_expected;
use crate::tracking_ranges;

use std::collections::BTreeMap;

use northing_experiments::radar::campaign::merge;
use northing_experiments::radar::outcome::nees_band;
use northing_experiments::radar::{
    Campaign, CampaignError, CampaignOutcome, Part, Shard, TrackerKind,
};
use northing_simulation::scenario::schema::NavigationFilter;
use northing_simulation::scenario::{Scenario, ScenarioFile};

use tracking_expected::{agreement, comparison, metric, tracker};

const SCENARIO: &str = include_str!("../../../../scenarios/tracking/wilthil_brekke.toml");

fn scenario(variant: &str) -> Scenario {
    let file = ScenarioFile::parse("wilthil_brekke.toml", SCENARIO).unwrap();
    let variant = (variant != "consistent").then_some(variant);
    file.scenario(variant).unwrap()
}

fn campaign(variant: &str, trackers: &[TrackerKind], seed: u64, runs: u64) -> Part {
    let campaign = Campaign::new(&scenario(variant), trackers, seed, runs).unwrap();
    campaign.run(Shard::WHOLE, &|| ()).unwrap()
}

/// One experiment of 100 runs for each seed.
fn experiments(variant: &str, seeds: u64) -> Vec<Part> {
    let kinds = TrackerKind::ALL;
    (1..=seeds)
        .map(|seed| campaign(variant, &kinds, seed, 100))
        .collect()
}

fn outcomes(parts: &[Part]) -> Vec<CampaignOutcome> {
    parts.iter().map(CampaignOutcome::of).collect()
}

/// Experiments of a variant against the table; `rows` is how many rows it has at least.
fn assert_agrees(variant: &str, parts: &[Part], rows: usize) -> Vec<CampaignOutcome> {
    let outcomes = outcomes(parts);
    let found = agreement(variant, &outcomes);
    assert!(found.off.is_empty(), "{variant}: {:#?}", found.off);
    assert!(found.rows >= rows, "{variant}: only {} rows", found.rows);
    // The ways out are for a few.
    assert!(
        20 * (found.within_errors + found.within_arc) <= found.rows,
        "{variant}: {found:?}"
    );
    outcomes
}

/// Mean over experiments of a tracker's number.
fn mean_of(outcomes: &[CampaignOutcome], kind: TrackerKind, what: &str) -> f64 {
    let values = outcomes.iter().map(|o| metric(tracker(o, kind), what));
    values.sum::<f64>() / outcomes.len() as f64
}

#[test]
fn consistent_agrees_and_the_exact_trackers_are_consistent() {
    let parts = experiments("consistent", 8);
    assert_agrees("consistent", &parts, 100);

    // All 800 runs together: the NEES stays in its band from 20 s on.
    let pooled = parts
        .iter()
        .skip(1)
        .fold(parts[0].sums.clone(), |a, b| a.merged(&b.sums));
    let pooled = CampaignOutcome::of(&Part {
        sums: pooled,
        ..parts[0].clone()
    });
    assert_eq!(pooled.runs, 800);
    let [low, high] = nees_band(800, 4);
    for kind in [TrackerKind::Schmidt, TrackerKind::SchmidtFeedForward] {
        let series = &tracker(&pooled, kind).series;
        let settled: Vec<f64> = series
            .time_s
            .iter()
            .zip(&series.nees)
            .filter(|(t, _)| **t >= 20.0)
            .map(|(_, nees)| *nees)
            .collect();
        let inside = settled
            .iter()
            .filter(|nees| (low..=high).contains(*nees))
            .count();
        let share = inside as f64 / settled.len() as f64;
        assert!(share >= 0.95, "{}: {share}", kind.name());
    }
    let position = |kind| tracker(&pooled, kind).position_rmse_m;
    let forward = position(TrackerKind::SchmidtFeedForward);
    assert!(forward <= 0.92 * position(TrackerKind::Converted));
    assert!(forward <= 1.03 * position(TrackerKind::Joint));
    // The literal recursion loses the target where the models are right, and its "covariance" so far
    // its sign that the mean NEES is negative.
    let literal = tracker(&pooled, TrackerKind::SchmidtLiteral);
    assert!(literal.position_rmse_m > 1000.0 && literal.nees_mean < 0.0);
}

#[test]
fn the_paper_s_claims_hold_in_its_own_setting() {
    let outcomes = assert_agrees("paper", &experiments("paper", 4), 80);
    let value = |kind, what| mean_of(&outcomes, kind, what);
    let ratio = |name| {
        let values = outcomes.iter().map(|o| comparison(o, name, true).unwrap());
        values.sum::<f64>() / outcomes.len() as f64
    };
    use TrackerKind as K;
    // Position errors about equal, converted lower in the transient.
    assert!((1.03..1.09).contains(&ratio("UC/CM rmse_p ratio")));
    let transient = |kind| value(kind, "rmse_p_tr");
    assert!(transient(K::Converted) < transient(K::UncompensatedConverted));
    // Velocity transient better by a factor 1.5, as a peak.
    assert!((1.35..1.75).contains(&ratio("UC/CM rmse_v ratio max(1-60s)")));
    // The authors' Schmidt-Kalman is worse than no compensation in steady state; exact is not.
    assert!(ratio("UC/SK-authors rmse_v ratio mean(>200s)") < 1.0);
    assert!(ratio("UC/SK-exact rmse_v ratio mean(>200s)") >= 1.12);
    assert!(value(K::Schmidt, "rmse_v_ss") <= 0.85 * value(K::SchmidtAuthors, "rmse_v_ss"));
    // True pose and Schmidt mostly inside the band of two degrees of freedom, never in the right one.
    assert!(
        value(K::TruePoseConverted, "inside2dof") > 0.7
            && value(K::SchmidtAuthors, "inside2dof") > 0.5
    );
    assert!(
        value(K::TruePoseConverted, "inside") < 0.01 && value(K::SchmidtAuthors, "inside") < 0.01
    );
    // Converted slightly above, uncompensated far above.
    let nees = |kind| value(kind, "nees");
    assert!(nees(K::SchmidtAuthors) < 2.411 && 2.411 < nees(K::Converted));
    assert!(nees(K::Converted) + 1.0 < nees(K::UncompensatedConverted));
}

#[test]
fn halving_the_navigation_noise_helps_the_uncompensated_most() {
    let halved = assert_agrees("paper_halved", &experiments("paper_halved", 4), 70);
    let nees = |kind| mean_of(&halved, kind, "nees");
    assert!(nees(TrackerKind::UncompensatedConverted) < 3.3);
    assert!((2.0..2.2).contains(&nees(TrackerKind::TruePoseConverted)));
}

#[test]
fn mems_agrees() {
    assert_agrees("mems", &experiments("mems", 8), 80);
}

#[test]
fn perstep_agrees() {
    assert_agrees("perstep", &experiments("perstep", 8), 80);
}

const FEW: [TrackerKind; 3] = [
    TrackerKind::Converted,
    TrackerKind::Schmidt,
    TrackerKind::Joint,
];

#[test]
fn neither_threads_nor_shards_change_a_bit() {
    let whole = campaign("consistent", &FEW, 5, 12);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .unwrap();
    let alone = pool.install(|| campaign("consistent", &FEW, 5, 12));
    assert_eq!(whole.sums, alone.sums);
    let campaign = Campaign::new(&scenario("consistent"), &FEW, 5, 12).unwrap();
    for count in [2, 5, 12] {
        let mut parts: Vec<(String, Part)> = (1..=count)
            .map(|index| {
                let part = campaign.run(Shard { index, count }, &|| ()).unwrap();
                (format!("part{index}"), part)
            })
            .collect();
        parts.reverse();
        let merged = merge(parts).unwrap();
        assert_eq!(merged.sums, whole.sums);
        assert_eq!(
            merged.ranges.iter().map(|r| r.end - r.start).sum::<u64>(),
            12
        );
    }
    // Who else is in the race does not matter either.
    let one = Campaign::new(&scenario("consistent"), &FEW[1..2], 5, 12).unwrap();
    let one = one.run(Shard::WHOLE, &|| ()).unwrap();
    assert_eq!(one.sums.trackers[0], whole.sums.trackers[1]);
}

/// Beside the product's navigation filter: it and the exact trackers are consistent, the open loop is not, and what looks
/// into the paper's filter is refused.
#[test]
fn the_gnss_ins_carries_the_campaign_and_its_trackers_are_consistent() {
    let beside = |variant: &str| {
        let mut scenario = scenario(variant);
        scenario.navigation.filter = NavigationFilter::GnssIns;
        scenario
    };
    for variant in ["consistent", "mems"] {
        let all = Campaign::new(&beside(variant), &[], 3, 100).unwrap();
        let refused = [TrackerKind::SchmidtAuthors, TrackerKind::Joint];
        assert!(!all.trackers().iter().any(|kind| refused.contains(kind)));
        let outcome = CampaignOutcome::of(&all.run(Shard::WHOLE, &|| ()).unwrap());
        let nees = |kind| tracker(&outcome, kind).nees_mean;
        let [low, high] = outcome.nees_band;
        for kind in [
            TrackerKind::TruePose,
            TrackerKind::Schmidt,
            TrackerKind::SchmidtFeedForward,
        ] {
            let nees = nees(kind);
            assert!((low..high).contains(&nees), "{variant}, {kind:?}: {nees}");
        }
        let uncompensated = nees(TrackerKind::Uncompensated);
        assert!(uncompensated > high, "{variant}: {uncompensated}");
        let [low, high] = nees_band(100, 3);
        let pose = outcome.navigation.pose_nees_mean;
        assert!((low..high).contains(&pose), "{variant}, pose: {pose}");
    }
    let joint = Campaign::new(&beside("consistent"), &[TrackerKind::Joint], 1, 2).unwrap_err();
    assert!(joint.to_string().contains("`joint`"), "{joint}");
}

#[test]
fn parts_that_do_not_belong_together_are_refused() {
    let part = |seed, runs, shard: &str| {
        let mut short = scenario("consistent");
        short.meta.duration_s = 5.0;
        let campaign = Campaign::new(&short, &FEW[..1], seed, runs).unwrap();
        campaign.run(Shard::parse(shard).unwrap(), &|| ()).unwrap()
    };
    let merged = |a: Part, b: Part| merge(vec![("a".into(), a), ("b".into(), b)]);
    let first = part(1, 4, "1/2");
    assert!(merged(first.clone(), part(1, 4, "2/2")).is_ok());
    let seed = merged(first.clone(), part(2, 4, "2/2")).unwrap_err();
    assert_eq!(
        seed.to_string(),
        "b is of another campaign than a: the seed (1 and 2) differs"
    );
    let runs = merged(first.clone(), part(1, 6, "2/2")).unwrap_err();
    assert!(
        runs.to_string().contains("the number of runs (4 and 6)"),
        "{runs}"
    );
    let twice = merged(first.clone(), part(1, 4, "1/4")).unwrap_err();
    assert!(
        matches!(twice, CampaignError::Overlap { run: 0, .. }),
        "{twice}"
    );
    let mut other = part(1, 4, "2/2");
    other.key.scenario.radar.sigma_range_m = 1.0;
    assert!(
        merged(first, other)
            .unwrap_err()
            .to_string()
            .contains("the scenario")
    );
    assert_eq!(merge(Vec::new()).unwrap_err(), CampaignError::NoParts);
    for bad in ["0/2", "3/2", "1/0", "a/b", "1", ""] {
        assert!(Shard::parse(bad).is_err(), "{bad}");
    }
    let none = Campaign::new(&scenario("consistent"), &[], 1, 0).unwrap_err();
    assert_eq!(none, CampaignError::NoRuns);
    assert!(
        TrackerKind::parse("kalman")
            .unwrap_err()
            .to_string()
            .contains("schmidt-feed-forward")
    );
}

/// Faults of every sensor, a target through the own ship: no panic, what is unusable is skipped.
#[test]
fn faults_and_a_target_through_the_own_ship_are_survived() {
    let faults = "
[[faults]]\nsensor = \"gyroscope\"\nfrom_s = 5.0\nuntil_s = 5.5\nwhat = { kind = \"not-a-number\" }
[[faults]]\nsensor = \"gps-position\"\nfrom_s = 8.0\nuntil_s = 9.0\nwhat = { kind = \"offset\", value = [1e5] }
[[faults]]\nsensor = \"gps-compass\"\nfrom_s = 10.0\nuntil_s = 11.0\nwhat = { kind = \"drop\" }
[[faults]]\nsensor = \"radar\"\nfrom_s = 12.0\nuntil_s = 14.5\nwhat = { kind = \"not-a-number\" }
";
    let text = SCENARIO.replace("# variants:", &format!("{faults}# variants:"));
    let mut bad = ScenarioFile::parse("s", &text)
        .unwrap()
        .scenario(None)
        .unwrap();
    bad.meta.duration_s = 40.0;
    bad.radar.detection_probability = 0.7;
    // Meets the own ship, exactly, after 20 s.
    bad.target.position_m = [400.0, 0.0];
    bad.target.velocity_m_s = [-10.0, 0.0];
    bad.target.truth_process_noise = false;
    let part = Campaign::new(&bad, &[], 1, 4)
        .unwrap()
        .run(Shard::WHOLE, &|| ())
        .unwrap();
    let outcome = CampaignOutcome::of(&part);
    let skipped: BTreeMap<_, _> = outcome
        .trackers
        .iter()
        .map(|(n, t)| (n, t.skipped_updates))
        .collect();
    assert!(skipped.values().all(|n| *n >= 1), "{skipped:?}");
    let healthy = &outcome.trackers["true-pose"];
    assert!(healthy.position_rmse_m.is_finite(), "{healthy:?}");
}

/// Where the linearised update was hundreds of standard deviations off: far away, with a precise radar, with a bad compass, and close by.
#[test]
fn trackers_are_consistent_at_every_range_and_precision_and_with_every_compass() {
    let trackers = [
        TrackerKind::TruePose,
        TrackerKind::Schmidt,
        TrackerKind::SchmidtFeedForward,
        TrackerKind::Joint,
    ];
    let mut off = Vec::new();
    for cell in tracking_ranges::Cell::all() {
        let outcome = cell.outcome(&trackers, 12).unwrap();
        for kind in trackers {
            let nees = outcome.trackers[kind.name()].nees_mean;
            // Errors of one run last, so that 12 runs are little more than 12 numbers: 99.9 % of their means.
            if !(1.9..7.2).contains(&nees) {
                off.push(format!("{cell:?} {}: {nees:.2}", kind.name()));
            }
        }
    }
    assert!(off.is_empty(), "{off:#?}");
}
