//! The lab report of an experiment: settings, numbers, verdicts, plots, and the recording's hash.

use northing_evaluation::consistency::NoiseVerdict;
use northing_evaluation::final_test::{FinalSummary, FinalVerdict};
use northing_evaluation::nis::{NisSummary, UpdateCounts};
use northing_evaluation::parameters::parameters_of;
use northing_evaluation::report::{
    Fact, FinalTest, RunReport, SensorUpdates, Setting, Tone, Verdict,
};
use northing_evaluation::summary::RunSummary;
use northing_evaluation::trace::Trace;

use crate::experiments::Finished;

/// The page.
#[must_use]
pub fn render(finished: &Finished, summary: &RunSummary, trace: &Trace) -> String {
    let mut report = RunReport::new(format!("Experiment {}", finished.title()), trace);
    report.estimator = summary.estimator.to_string();
    report.recording.clone_from(&summary.recording);
    report.summary = facts(finished, summary);
    report.verdicts = verdicts(summary);
    report.updates = updates(summary);
    report.final_test = summary.final_test.as_ref().map(final_test);
    report.recording_facts = recording_facts(finished, summary);
    report.issues.clone_from(&summary.issues);
    report.settings = settings(finished, summary);
    report.render()
}

fn facts(finished: &Finished, summary: &RunSummary) -> Vec<Fact> {
    let degrees = |v: f64| format!("{v:.2} deg");
    let mut facts = Vec::new();
    if let Some(test) = &summary.final_test {
        facts.push(Fact::new(
            "calculated error",
            degrees(test.calculated_error_deg),
        ));
        facts.extend(
            test.estimated_error_deg
                .map(|e| Fact::new("estimated error", degrees(e))),
        );
    }
    if let Some(error) = &summary.error_deg {
        facts.push(Fact::new("attitude error, RMS", degrees(error.total_rmse)));
    }
    for (name, other) in &finished.summaries {
        if *name == summary.estimator.name() {
            continue;
        }
        if let Some(test) = &other.final_test {
            let label = format!("calculated error of {name}");
            facts.push(Fact::new(label, degrees(test.calculated_error_deg)));
        }
    }
    facts.push(Fact::new(
        "duration",
        format!("{:.1} s", summary.duration_s),
    ));
    facts
}

fn verdicts(summary: &RunSummary) -> Vec<Verdict> {
    let sensors = summary.verdicts.iter().map(|verdict| {
        let tone = match verdict.verdict {
            NoiseVerdict::Honest => Tone::Good,
            _ => Tone::Warn,
        };
        Verdict::new(tone, verdict.sentences.join(" "))
    });
    let test = summary.final_test.as_ref().and_then(final_verdict);
    let unobservable = summary.unobservable.iter();
    let unobservable = unobservable.map(|text| Verdict::new(Tone::Warn, text.as_str()));
    sensors.chain(test).chain(unobservable).collect()
}

fn final_verdict(test: &FinalSummary) -> Option<Verdict> {
    let tone = match test.verdict? {
        FinalVerdict::Consistent => Tone::Good,
        FinalVerdict::Optimistic | FinalVerdict::Pessimistic => Tone::Warn,
    };
    Some(Verdict::new(tone, test.sentence.as_str()))
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

fn updates(summary: &RunSummary) -> Vec<SensorUpdates> {
    let one = |name: &str, counts: &UpdateCounts, nis: Option<&NisSummary>| SensorUpdates {
        sensor: name.to_owned(),
        fused: counts.fused,
        gated: counts.gated,
        skipped: counts.skipped,
        nis_mean: nis.map(|nis| nis.mean),
        nis_expected: nis.map(|nis| f64::from(nis.degrees_of_freedom)),
    };
    let (nis, counts) = (&summary.nis, &summary.updates);
    vec![
        one("gyroscope", &counts.gyroscope, None),
        one(
            "accelerometer",
            &counts.accelerometer,
            nis.accelerometer.as_ref(),
        ),
        one(
            "magnetometer",
            &counts.magnetometer,
            nis.magnetometer.as_ref(),
        ),
    ]
}

fn recording_facts(finished: &Finished, summary: &RunSummary) -> Vec<Fact> {
    let mut facts = vec![
        Fact::new("device", finished.device_name.as_str()),
        Fact::new("ended", finished.at.as_str()),
        Fact::new("SHA-256 of the samples", finished.hash.as_str()),
    ];
    for (kind, count) in &summary.samples_per_sensor {
        let rate = *count as f64 / summary.duration_s.max(1e-9);
        facts.push(Fact::new(
            kind.name(),
            format!("{count} samples, {rate:.1} a second"),
        ));
    }
    facts.extend(
        summary
            .calibration
            .as_ref()
            .map(|text| Fact::new("calibration", text.as_str())),
    );
    facts
}

fn settings(finished: &Finished, summary: &RunSummary) -> Vec<Setting> {
    let values = serde_json::to_value(finished.settings).unwrap_or_default();
    let parameters = parameters_of(summary.estimator).into_iter();
    let setting = parameters.map(|parameter| {
        let value = &values[parameter.name.as_str()];
        Setting {
            value: value
                .as_str()
                .map_or_else(|| value.to_string(), str::to_owned),
            name: parameter.name,
            unit: parameter.unit.to_owned(),
            meaning: parameter.meaning.to_owned(),
        }
    });
    setting.collect()
}
