//! Tests of the Allan deviation: the definition, known noise recovered, consistent bounds, refusals.

use super::*;
use approx::assert_relative_eq;
use nalgebra::Vector3;
use northing_core::attitude::AttitudeConfig;
use northing_simulation::random::{Stream, standard_normal, stream};
use northing_simulation::sensors::{ErrorModel, SensorErrors};

/// The definition, word for word: half the mean square of the difference between the means of
/// neighbouring stretches of `m` values, over every pair of stretches that `step` allows.
fn by_definition(values: &[f64], m: usize, step: usize) -> f64 {
    let average = |from: usize| values[from..from + m].iter().sum::<f64>() / m as f64;
    let mut squares = Vec::new();
    let mut from = 0;
    while from + 2 * m <= values.len() {
        squares.push((average(from + m) - average(from)).powi(2));
        from += step;
    }
    squares.iter().sum::<f64>() / (2 * squares.len()) as f64
}

fn white(count: usize, stream: &mut Stream) -> Vec<f64> {
    (0..count).map(|_| standard_normal(stream)).collect()
}

/// The nine frequencies with which NBS Monograph 140 shows the method: its deviation at one sample
/// is 91.22945, at two 115.8082 without overlap; the overlapping one follows from the definition.
#[test]
fn the_classic_nine_values_have_their_deviations() {
    let values = [
        892.0, 809.0, 823.0, 798.0, 671.0, 644.0, 883.0, 903.0, 677.0,
    ];
    let ours = |m| overlapping_variance(&integral(&values), m).sqrt();
    assert_relative_eq!(ours(1), 91.22945, epsilon = 1e-5);
    assert_relative_eq!(
        by_definition(&values, 2, 2).sqrt(),
        115.8082,
        epsilon = 1e-4
    );
    assert_relative_eq!(
        ours(2),
        by_definition(&values, 2, 1).sqrt(),
        epsilon = 1e-10
    );
    assert_relative_eq!(ours(2), 85.95287, epsilon = 1e-5);
}

#[test]
fn the_running_sum_gives_what_the_definition_gives() {
    let mut values = white(500, &mut stream(1, "allan"));
    for (k, value) in values.iter_mut().enumerate() {
        *value += 1e3 + 0.01 * k as f64;
    }
    for m in [1, 2, 7, 50, 125, 250] {
        let ours = overlapping_variance(&integral(&values), m);
        assert_relative_eq!(ours, by_definition(&values, m, 1), max_relative = 1e-9);
    }
}

/// Twice the squared mean over the variance of many estimates is their degrees of freedom.
#[test]
fn degrees_of_freedom_are_those_of_many_records() {
    let (count, records) = (1000, 1500);
    for (kind, m) in [
        (NoiseKind::White, 1),
        (NoiseKind::White, 10),
        (NoiseKind::White, 100),
        (NoiseKind::RandomWalk, 10),
        (NoiseKind::RandomWalk, 100),
    ] {
        let mut noise = stream(2, "degrees");
        let variances: Vec<f64> = (0..records)
            .map(|_| {
                let mut values = white(count, &mut noise);
                if kind == NoiseKind::RandomWalk {
                    values = integral(&values);
                    values.pop();
                }
                overlapping_variance(&integral(&values), m)
            })
            .collect();
        let n = f64::from(records);
        let mean = variances.iter().sum::<f64>() / n;
        let variance = variances.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n;
        let found = 2.0 * mean * mean / variance;
        let stated = kind.degrees_of_freedom(count, m);
        // Standard deviation of a variance of 1500: 4 % and more for its few degrees of freedom.
        assert!(
            (found / stated - 1.0).abs() < 0.25,
            "{kind:?} {m}: {found}, stated {stated}"
        );
    }
}

/// A gyroscope at rest at 100 Hz.
fn gyroscope(seed: u64, seconds: usize, noise_density: f64, bias_random_walk: f64) -> RestSamples {
    let model = ErrorModel {
        noise_density,
        bias_random_walk,
        bias: [0.01, -0.02, 0.005],
        ..ErrorModel::default()
    };
    let mut errors = SensorErrors::new(seed, "gyroscope", &model, 100.0);
    let mut samples = RestSamples::new(SensorKind::Gyroscope);
    for k in 0..seconds as i64 * 100 {
        assert!(samples.add(k * 10_000_000, &errors.measure(&Vector3::zeros())));
    }
    samples
}

fn report(samples: &RestSamples) -> AllanReport {
    analyze(samples, &AllanConfig::default()).unwrap()
}

const N: f64 = 2e-3;
const K: f64 = 1e-4;

#[test]
fn white_noise_and_random_walk_are_recovered() {
    let report = report(&gyroscope(1, 3600, N, K));
    let (n, k) = (
        report.coefficients.noise_density.unwrap(),
        report.coefficients.random_walk.unwrap(),
    );
    assert!(
        (n.value - N).abs() < 3.0 * n.std && n.std < 0.03 * N,
        "{n:?}"
    );
    assert!(
        (k.value - K).abs() < 3.0 * k.std && k.std < 0.2 * K,
        "{k:?}"
    );
    assert_eq!(report.coefficients.quantisation, None);
    // The two lines cross at sqrt(3) N / K = 35 s.
    assert!(report.floor.is_reached && (20.0..60.0).contains(&report.floor.tau_s));
    assert_relative_eq!(report.duration_s, 3600.0, epsilon = 1e-6);
    assert_relative_eq!(report.rate_hz, 100.0, epsilon = 1e-9);
    for axis in report.axis_coefficients {
        assert_relative_eq!(axis.noise_density.unwrap().value, N, max_relative = 0.08);
    }
    assert!(report.worst_misfit < 1.3, "{}", report.worst_misfit);
}

/// Over 60 records: are errors as large as stated, and do 95 % bounds hold 95 %?
#[test]
fn coefficients_and_bounds_are_consistent() {
    let (mut squares, mut seen, mut inside, mut points) = ([0.0; 2], [0.0; 2], 0, 0);
    for seed in 0..60 {
        let report = report(&gyroscope(100 + seed, 600, N, 4.0 * K));
        let found = [
            report.coefficients.noise_density,
            report.coefficients.random_walk,
        ];
        for (axis, (found, truth)) in found.into_iter().zip([N, 4.0 * K]).enumerate() {
            if let Some(c) = found {
                squares[axis] += ((c.value - truth) / c.std).powi(2);
                seen[axis] += 1.0;
            }
        }
        for point in report.trusted().filter(|point| point.tau_s > 0.1) {
            let truth = N * N / point.tau_s + 16.0 * K * K * point.tau_s / 3.0;
            points += 1;
            inside += usize::from((point.lower..point.upper).contains(&truth.sqrt()));
        }
    }
    assert!(seen[0] > 59.0 && seen[1] > 55.0, "{seen:?}");
    let [n, k] = [squares[0] / seen[0], squares[1] / seen[1]];
    // Deliberately cautious about N: five percent are allowed to the model of the sensor.
    assert!(n > 0.02 && n < 1.5, "{n}");
    assert!(k > 0.3 && k < 2.5, "{k}");
    let share = inside as f64 / points as f64;
    assert!((0.90..0.99).contains(&share), "{share} of {points}");
}

/// Rates whose integral, the angle, is known to a step only: Q = step / sqrt(12).
#[test]
fn quantisation_is_recovered() {
    let step = 1e-3;
    let mut noise = stream(4, "quantisation");
    let mut samples = RestSamples::new(SensorKind::Gyroscope);
    let (mut angle, mut last) = (Vector3::<f64>::zeros(), Vector3::<f64>::zeros());
    for k in 0..60_000 {
        angle += Vector3::from_fn(|_, _| standard_normal(&mut noise)) * N * 0.1;
        let shown = angle.map(|x| (x / step).round() * step);
        samples.add(k * 10_000_000, &((shown - last) / 0.01));
        last = shown;
    }
    let config = AllanConfig {
        motion_limit: Some(1.0),
        ..AllanConfig::default()
    };
    let report = analyze(&samples, &config).unwrap();
    let q = report.coefficients.quantisation.unwrap();
    assert_relative_eq!(q.value, step / 12_f64.sqrt(), max_relative = 0.1);
    assert_relative_eq!(
        report.coefficients.noise_density.unwrap().value,
        N,
        max_relative = 0.1
    );
    assert_eq!(report.curve[0].kind, NoiseKind::Quantisation);
}

/// Flicker as a sum of many exponentially correlated noises of equal variance, one a factor of
/// three in time: flat in between.
#[test]
fn a_flat_floor_is_bias_instability_and_gives_the_filter_a_walk() {
    let mut noise = stream(5, "flicker");
    let times: Vec<f64> = (-4..9).map(|k| 3_f64.powi(k)).collect();
    let dt = 0.02_f64;
    let mut states = [Vector3::<f64>::zeros(); 13];
    let mut samples = RestSamples::new(SensorKind::Gyroscope);
    for k in 0..540_000 {
        let mut rate = Vector3::from_fn(|_, _| standard_normal(&mut noise)) * 1e-3 / dt.sqrt();
        for (state, time) in states.iter_mut().zip(&times) {
            let keep = (-dt / time).exp();
            let fresh = Vector3::from_fn(|_, _| standard_normal(&mut noise));
            *state = *state * keep + fresh * 1e-3 * (1.0 - keep * keep).sqrt();
            rate += *state;
        }
        samples.add(k * 20_000_000, &rate);
    }
    let report = report(&samples);
    let b = report.coefficients.bias_instability.expect("a floor");
    assert_relative_eq!(b.value * 0.664, report.floor.deviation, max_relative = 0.2);
    assert!(report.floor.is_reached);
    let mut config = AttitudeConfig::lab();
    let said = report.fill(&mut config);
    assert_relative_eq!(config.gyroscope_noise_density, 1e-3, max_relative = 0.1);
    // The walk's line meets the floor at some seconds.
    let meets = 3.0 * (report.floor.deviation / config.gyroscope_bias_random_walk).powi(2);
    assert!((0.3..300.0).contains(&meets), "{meets}");
    assert!(said[1].contains("flat part") || report.coefficients.random_walk.is_some());
}

#[test]
fn a_filter_is_filled_with_what_the_record_shows() {
    let mut config = AttitudeConfig::lab();
    let said = report(&gyroscope(1, 3600, N, K)).fill(&mut config);
    assert_relative_eq!(config.gyroscope_noise_density, N, max_relative = 0.05);
    assert_relative_eq!(config.gyroscope_bias_random_walk, K, max_relative = 0.4);
    assert!(said[0].starts_with("gyroscope_noise_density = ") && said[1].contains("rise"));

    let mut config = AttitudeConfig::lab();
    let before = config.gyroscope_bias_random_walk;
    let short = report(&gyroscope(2, 120, N, 0.0));
    let said = short.fill(&mut config);
    assert_eq!(
        config.gyroscope_bias_random_walk.to_bits(),
        before.to_bits()
    );
    assert!(said[1].contains("unchanged"), "{said:?}");
    assert!(!short.floor.is_reached);
}

#[test]
fn a_student_reads_where_each_noise_is_seen() {
    let report = report(&gyroscope(1, 3600, N, K));
    let text = report.sentences.join("\n");
    for part in [
        "White noise: 0.0020 rad/s/sqrt(Hz) (6.9 deg/sqrt(h)) +- ",
        "passes tau = 1 s; averaging four times as long halves it.",
        "because the bias has moved by then",
        "the bias walks by ",
        "the record of 60 minutes is too short to say anything",
    ] {
        assert!(text.contains(part), "{part} is missing in\n{text}");
    }
    let short = super::tests::report(&gyroscope(2, 120, N, 0.0))
        .sentences
        .join("\n");
    assert!(
        short.contains("still falls where the record ends"),
        "{short}"
    );
}

/// Every thousandth sample missing changes nothing but is said; a long gap cuts.
#[test]
fn gaps_are_filled_or_cut_and_said() {
    let whole = gyroscope(3, 300, N, 0.0);
    let mut thinned = RestSamples::new(SensorKind::Gyroscope);
    for (k, (time, value)) in whole.pairs().enumerate() {
        if k % 1000 != 500 {
            thinned.add(time, &value);
        }
    }
    let (whole, thinned) = (report(&whole), report(&thinned));
    assert_eq!((whole.filled_samples, thinned.filled_samples), (0, 30));
    for (a, b) in whole.trusted().zip(thinned.trusted()) {
        assert_relative_eq!(a.deviation, b.deviation, max_relative = 0.01);
    }
    let text = thinned.sentences.join("\n");
    assert!(text.contains("30 of 30000 samples were missing"), "{text}");

    let mut cut = RestSamples::new(SensorKind::Gyroscope);
    for (time, value) in gyroscope(3, 300, N, 0.0).pairs() {
        let late = if time > 100_000_000_000 {
            5_000_000_000
        } else {
            0
        };
        cut.add(time + late, &value);
    }
    let cut = report(&cut);
    assert_relative_eq!(cut.duration_s, 200.0, epsilon = 0.1);
    let text = cut.sentences.join("\n");
    assert!(
        text.contains("2 pieces; the longest, 105.0 s to 305.0 s"),
        "{text}"
    );
}

#[test]
fn jittered_stamps_and_useless_samples_do_no_harm() {
    let mut jitter = stream(6, "jitter");
    let mut samples = RestSamples::new(SensorKind::Gyroscope);
    for (k, (time, value)) in gyroscope(3, 120, N, 0.0).pairs().enumerate() {
        let late = (standard_normal(&mut jitter) * 1e6).clamp(-3e6, 3e6) as i64;
        assert!(samples.add(time + late, &value));
        if k == 700 {
            assert!(!samples.add(time - 1_000_000_000, &value));
            assert!(!samples.add(time + 5_000_000, &Vector3::repeat(f64::NAN)));
        }
    }
    let jittered = report(&samples);
    assert_eq!((jittered.filled_samples, jittered.ignored_samples), (0, 2));
    let plain = report(&gyroscope(3, 120, N, 0.0));
    let value = |r: &AllanReport| r.coefficients.noise_density.unwrap().value;
    assert_relative_eq!(value(&jittered), value(&plain), max_relative = 1e-3);
}

fn refused(samples: &RestSamples) -> String {
    analyze(samples, &AllanConfig::default())
        .unwrap_err()
        .to_string()
}

#[test]
fn what_is_no_rest_is_refused_with_what_to_do() {
    let none = refused(&RestSamples::new(SensorKind::Gyroscope));
    assert!(none.contains("no gyroscope samples"), "{none}");
    let short = refused(&gyroscope(7, 30, N, 0.0));
    assert!(
        short.starts_with("too short: 30.0 s of gyroscope samples"),
        "{short}"
    );
    assert!(short.contains("ten minutes or more"));

    let with = |change: &dyn Fn(f64) -> Vector3<f64>| {
        let mut samples = RestSamples::new(SensorKind::Gyroscope);
        for (time, value) in gyroscope(7, 120, N, 0.0).pairs() {
            samples.add(time, &(value + change(time as f64 * 1e-9)));
        }
        refused(&samples)
    };
    let turned =
        with(&|t| Vector3::new(0.0, if (60.0..63.0).contains(&t) { 0.3 } else { 0.0 }, 0.0));
    assert!(turned.starts_with("the device moved at 60.0 s"), "{turned}");
    assert!(
        turned.contains("limit 0.0") && turned.contains("rad/s"),
        "{turned}"
    );
    let shaken = with(&|t| {
        let shake = if (30.0..31.0).contains(&t) { 0.5 } else { 0.0 };
        Vector3::new(
            (t * 2.0 * std::f64::consts::PI * 8.0).sin() * shake,
            0.0,
            0.0,
        )
    });
    assert!(
        shaken.starts_with("the device was shaken at 30.0 s"),
        "{shaken}"
    );

    let mut constant = RestSamples::new(SensorKind::Gyroscope);
    (0..10_000).for_each(|k| assert!(constant.add(k * 10_000_000, &Vector3::x())));
    assert!(refused(&constant).contains("repeated one value 10000 times"));

    let mut thin = RestSamples::new(SensorKind::Gyroscope);
    for (k, (time, value)) in gyroscope(7, 120, N, 0.0).pairs().enumerate() {
        if k % 4 != 0 {
            thin.add(time, &value);
        }
    }
    assert!(refused(&thin).contains("% of the gyroscope samples are missing"));
}

#[test]
fn settings_that_are_invalid_are_named() {
    let samples = gyroscope(1, 60, N, 0.0);
    let refused = |config| analyze(&samples, &config).unwrap_err().to_string();
    let default = AllanConfig::default();
    let text = refused(AllanConfig {
        confidence: 1.0,
        ..default
    });
    assert_eq!(text, "confidence is 1; expected between 0 and 1");
    assert!(
        refused(AllanConfig {
            points_per_decade: 0,
            ..default
        })
        .contains("1 to 100")
    );
    assert!(
        refused(AllanConfig {
            minimum_duration_s: f64::NAN,
            ..default
        })
        .contains("NaN")
    );
    let text = refused(AllanConfig {
        sensor: SensorKind::Pressure,
        ..default
    });
    assert!(text.contains("`pressure`"), "{text}");
}

#[test]
fn an_accelerometer_has_its_own_unit_and_fills_nothing() {
    let mut samples = RestSamples::new(SensorKind::Accelerometer);
    for (time, value) in gyroscope(8, 120, N, 0.0).pairs() {
        samples.add(time, &(value + Vector3::new(0.0, 0.0, 9.81)));
    }
    let config = AllanConfig {
        sensor: SensorKind::Accelerometer,
        ..AllanConfig::default()
    };
    let report = analyze(&samples, &config).unwrap();
    assert_eq!(report.unit, "m/s^2");
    assert!(
        report.sentences[0].contains("m/s^2/sqrt(Hz) +- "),
        "{}",
        report.sentences[0]
    );
    let mut settings = AttitudeConfig::lab();
    let said = report.fill(&mut settings);
    assert_eq!(settings, AttitudeConfig::lab());
    assert!(said[0].contains("unchanged"));
}

impl RestSamples {
    fn pairs(&self) -> impl Iterator<Item = (i64, Vector3<f64>)> + '_ {
        let (times, values) = self.parts();
        times.iter().copied().zip(values.iter().copied())
    }
}
