//! The outcome of a run as the data of its HTML report.

use northing_core::attitude::AttitudeConfig;
use northing_evaluation::consistency::NoiseVerdict;
use northing_evaluation::estimators::EstimatorKind;
use northing_evaluation::final_test::{FinalSummary, FinalVerdict};
use northing_evaluation::nis::{NisSummary, UpdateCounts};
use northing_evaluation::parameters::parameters_of;
use northing_evaluation::report::{
    Fact, FinalTest, RunReport, SensorUpdates, Setting, Tone, Verdict,
};
use northing_evaluation::summary::RunSummary;
use northing_evaluation::trace::Trace;
use northing_recording::Metadata;

use crate::summary_text::{is_honest, nees_in_words};

/// The page of a run; `config` are the parameters that it ran with.
pub(crate) fn render(
    summary: &RunSummary,
    config: &AttitudeConfig<f64>,
    metadata: &Metadata,
    trace: &Trace,
) -> String {
    let mut report = RunReport::new(format!("Attitude of {}", metadata.name), trace);
    report.estimator = summary.estimator.to_string();
    report.recording.clone_from(&summary.recording);
    report.command = Some(command_line());
    report.summary = facts(summary);
    report.verdicts = verdicts(summary);
    report.updates = updates(summary);
    report.final_test = summary.final_test.as_ref().map(final_test);
    report.recording_facts = recording_facts(summary, metadata);
    report.issues.clone_from(&summary.issues);
    report.settings = settings(summary.estimator, config);
    report.render()
}

/// The command as it was typed.
pub(crate) fn command_line() -> String {
    let arguments = std::env::args_os().skip(1);
    let words = arguments.map(|word| {
        let word = word.to_string_lossy().into_owned();
        if word.contains(char::is_whitespace) {
            format!("'{word}'")
        } else {
            word
        }
    });
    std::iter::once("northing".to_owned())
        .chain(words)
        .collect::<Vec<_>>()
        .join(" ")
}

fn facts(summary: &RunSummary) -> Vec<Fact> {
    let mut facts = Vec::new();
    if let Some(error) = &summary.error_deg {
        facts.push(Fact::new(
            "attitude error, RMS",
            format!("{:.2} deg", error.total_rmse),
        ));
        facts.push(Fact::new(
            "heading error, RMS",
            format!("{:.2} deg", error.heading_rmse),
        ));
        facts.push(Fact::new(
            "inclination error, RMS",
            format!("{:.2} deg", error.inclination_rmse),
        ));
    }
    if let Some(nees) = summary.nees_mean {
        facts.push(Fact::new(
            "NEES per degree of freedom (1 is ideal)",
            format!("{nees:.2}"),
        ));
    }
    if let Some(test) = &summary.final_test {
        facts.push(Fact::new(
            "final test, calculated error",
            format!("{:.2} deg", test.calculated_error_deg),
        ));
        if let Some(estimated) = test.estimated_error_deg {
            facts.push(Fact::new(
                "final test, estimated error",
                format!("{estimated:.2} deg"),
            ));
        }
    }
    facts.push(Fact::new(
        "duration",
        format!("{:.1} s", summary.duration_s),
    ));
    facts.push(Fact::new("samples", summary.samples.to_string()));
    facts
}

fn verdicts(summary: &RunSummary) -> Vec<Verdict> {
    let mut verdicts = Vec::new();
    if let Some(nees) = summary.nees_mean {
        let tone = if is_honest(nees) {
            Tone::Good
        } else {
            Tone::Warn
        };
        verdicts.push(Verdict::new(tone, sentence(&nees_in_words(nees))));
    }
    for verdict in &summary.verdicts {
        let tone = match verdict.verdict {
            NoiseVerdict::Honest => Tone::Good,
            _ => Tone::Warn,
        };
        verdicts.push(Verdict::new(tone, verdict.sentences.join(" ")));
    }
    if let Some(verdict) = summary.final_test.as_ref().and_then(final_verdict) {
        verdicts.push(verdict);
    }
    let warn = |text: &String| Verdict::new(Tone::Warn, text.as_str());
    verdicts.extend(summary.unobservable.iter().map(warn));
    verdicts
}

/// With a capital and a full stop.
fn sentence(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters
        .next()
        .map(|c| c.to_uppercase().to_string())
        .unwrap_or_default();
    format!("{first}{}.", letters.as_str())
}

fn updates(summary: &RunSummary) -> Vec<SensorUpdates> {
    let one = |name: &str, counts: &UpdateCounts, nis: Option<&NisSummary>| SensorUpdates {
        sensor: name.to_owned(),
        fused: counts.fused,
        gated: counts.gated,
        skipped: counts.skipped,
        nis_mean: nis.map(|nis| nis.mean),
        nis_expected: nis.map(|nis| f64::from(nis.degrees_of_freedom)),
    };
    let nis = &summary.nis;
    vec![
        one("gyroscope", &summary.updates.gyroscope, None),
        one(
            "accelerometer",
            &summary.updates.accelerometer,
            nis.accelerometer.as_ref(),
        ),
        one(
            "magnetometer",
            &summary.updates.magnetometer,
            nis.magnetometer.as_ref(),
        ),
    ]
}

fn final_test(test: &FinalSummary) -> FinalTest {
    FinalTest {
        calculated_error_deg: Some(test.calculated_error_deg),
        estimated_error_deg: test.estimated_error_deg,
        axis_std_deg: test.estimated_std_deg,
        nees: test.normalised_square,
        verdict: final_verdict(test),
    }
}

fn final_verdict(test: &FinalSummary) -> Option<Verdict> {
    let tone = match test.verdict? {
        FinalVerdict::Consistent => Tone::Good,
        FinalVerdict::Optimistic | FinalVerdict::Pessimistic => Tone::Warn,
    };
    Some(Verdict::new(tone, test.sentence.as_str()))
}

fn recording_facts(summary: &RunSummary, metadata: &Metadata) -> Vec<Fact> {
    let mut facts = vec![
        Fact::new("format", metadata.format.as_str()),
        Fact::new("world frame", metadata.world_frame.name()),
    ];
    if let Some(device) = &metadata.device {
        facts.push(Fact::new("device", device.as_str()));
    }
    for (kind, count) in &summary.samples_per_sensor {
        let rate = *count as f64 / summary.duration_s.max(1e-9);
        facts.push(Fact::new(
            kind.name(),
            format!("{count} samples, {rate:.1} a second"),
        ));
    }
    if let Some(calibration) = &summary.calibration {
        facts.push(Fact::new("calibration", calibration.as_str()));
    }
    facts
}

/// Every parameter of the estimator with the value it ran with.
pub(crate) fn settings(estimator: EstimatorKind, config: &AttitudeConfig<f64>) -> Vec<Setting> {
    let values = serde_json::to_value(config).unwrap_or_default();
    let setting = |parameter: northing_evaluation::parameters::ParameterInfo| {
        let value = &values[parameter.name.as_str()];
        Setting {
            value: value
                .as_str()
                .map_or_else(|| value.to_string(), str::to_owned),
            name: parameter.name,
            unit: parameter.unit.to_owned(),
            meaning: parameter.meaning.to_owned(),
        }
    };
    parameters_of(estimator).into_iter().map(setting).collect()
}
