//! From the outcome of a run to the data of its page: what every page about a run says alike.

use crate::attitude::run_report::{FinalTest, RunReport, SensorUpdates};
use crate::page::facts::{Fact, Tone, Verdict};
use crate::page::html::capitalised;
use northing_evaluation::attitude::final_test::{FinalSummary, FinalVerdict};
use northing_evaluation::attitude::{RunSummary, Trace};
use northing_evaluation::statistics::consistency::{NoiseVerdict, is_consistent_nees};
use northing_evaluation::statistics::nis::{NisSummary, UpdateCounts};

impl<'a> RunReport<'a> {
    /// The page of a run; `trace` is what it draws. What only the caller knows (command, device, hash) is
    /// added to the fields.
    #[must_use]
    pub fn of_run(title: impl Into<String>, summary: &RunSummary, trace: &'a Trace) -> Self {
        Self {
            estimator: summary.estimator.to_string(),
            recording: summary.recording.clone(),
            summary: facts(summary),
            verdicts: verdicts(summary),
            updates: updates(summary),
            final_test: summary.final_test.as_ref().map(final_test),
            recording_facts: recording_facts(summary),
            issues: summary.issues.clone(),
            settings: summary.parameters.clone(),
            heading_offset_deg: removed_offset(summary),
            ..Self::new(title, trace)
        }
    }
}

/// The constant part of the heading error, deg, where it is none of the estimate's.
pub(crate) fn removed_offset(summary: &RunSummary) -> Option<f64> {
    let error = summary.error_deg.filter(|e| e.heading_offset_removed)?;
    Some(error.heading_offset)
}

fn facts(summary: &RunSummary) -> Vec<Fact> {
    let degrees = |value: f64| format!("{value:.2} deg");
    let mut facts = Vec::new();
    if let Some(error) = &summary.error_deg {
        facts.extend(match error.heading_offset_removed {
            true => [
                Fact::new("inclination error, RMS", degrees(error.inclination_rmse)),
                Fact::new("heading drift, RMS", degrees(error.heading_drift_rmse)),
                Fact::new(
                    "heading error after a constant offset, RMS",
                    degrees(error.heading_rmse),
                ),
            ],
            false => [
                Fact::new("attitude error, RMS", degrees(error.total_rmse)),
                Fact::new("heading error, RMS", degrees(error.heading_rmse)),
                Fact::new("inclination error, RMS", degrees(error.inclination_rmse)),
            ],
        });
    }
    if let Some(nees) = summary.nees {
        let label = match nees.degrees_of_freedom {
            2 => "NEES of the tilt per degree of freedom (1 is ideal)",
            _ => "NEES per degree of freedom (1 is ideal)",
        };
        facts.push(Fact::new(label, format!("{:.2}", nees.mean)));
    }
    if let Some(test) = &summary.final_test {
        let (calculated, estimated) = test.judged_deg();
        let of = match test.degrees_of_freedom {
            2 => " of the tilt",
            _ => "",
        };
        let label = format!("final test, calculated error{of}");
        facts.push(Fact::new(label, degrees(calculated)));
        let label = format!("final test, estimated error{of}");
        facts.extend(estimated.map(|error| Fact::new(label, degrees(error))));
    }
    if let Some(rms) = summary.position.as_ref().and_then(|p| p.innovation_rms_m) {
        let [horizontal, vertical] = [rms.horizontal, rms.vertical];
        facts.push(Fact::new(
            "measured minus estimated position, RMS per axis",
            format!("{horizontal:.2} m, vertically {vertical:.2} m"),
        ));
    }
    facts.push(Fact::new(
        "duration",
        format!("{:.1} s", summary.duration_s),
    ));
    facts.push(Fact::new("samples", summary.samples.to_string()));
    facts
}

fn verdicts(summary: &RunSummary) -> Vec<Verdict> {
    let nees = summary.nees.map(|nees| {
        let tone = match is_consistent_nees(nees.mean) {
            true => Tone::Good,
            false => Tone::Warn,
        };
        Verdict::new(tone, sentence(&nees.in_words()))
    });
    let sensors = summary.verdicts.iter().map(|verdict| {
        let tone = match verdict.verdict {
            NoiseVerdict::Consistent => Tone::Good,
            NoiseVerdict::Undetermined => Tone::Info,
            _ => Tone::Warn,
        };
        Verdict::new(tone, verdict.sentences.join(" "))
    });
    let test = summary.final_test.as_ref().and_then(final_verdict);
    let unobservable = summary.unobservable.iter();
    let unobservable = unobservable.map(|text| Verdict::new(Tone::Warn, text.as_str()));
    // R has the word of its sensor.
    let causes = summary
        .findings
        .iter()
        .filter(|finding| finding.cause.is_mendable());
    let causes = causes.map(|finding| Verdict::new(Tone::Warn, finding.sentence.as_str()));
    nees.into_iter()
        .chain(causes)
        .chain(sensors)
        .chain(test)
        .chain(unobservable)
        .collect()
}

/// With a capital and a full stop.
fn sentence(text: &str) -> String {
    format!("{}.", capitalised(text))
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
    let (counts, nis) = (&summary.updates, &summary.nis);
    let (acc, mag) = (nis.accelerometer.as_ref(), nis.magnetometer.as_ref());
    let mut updates = vec![
        one("gyroscope", &counts.gyroscope, None),
        one("accelerometer", &counts.accelerometer, acc),
        one("magnetometer", &counts.magnetometer, mag),
        one("compass-heading", &counts.compass, nis.compass.as_ref()),
    ];
    let position = summary.position.as_ref();
    updates.extend(position.map(|position| one("position", &position.updates, None)));
    updates
}

fn final_test(test: &FinalSummary) -> FinalTest {
    FinalTest {
        calculated_error_deg: Some(test.calculated_error_deg),
        estimated_error_deg: test.estimated_error_deg,
        axis_std_deg: test.estimated_std_deg,
        tilt_deg: (test.degrees_of_freedom == 2).then(|| {
            let estimated = test.estimated_tilt_deg.unwrap_or(f64::NAN);
            [test.calculated_tilt_deg, estimated]
        }),
        nees: test.normalised_square,
        verdict: final_verdict(test),
    }
}

fn final_verdict(test: &FinalSummary) -> Option<Verdict> {
    let tone = match test.verdict? {
        FinalVerdict::Consistent => Tone::Good,
        FinalVerdict::Overconfident | FinalVerdict::Conservative => Tone::Warn,
    };
    Some(Verdict::new(tone, test.sentence.as_str()))
}

fn recording_facts(summary: &RunSummary) -> Vec<Fact> {
    let sensors = summary.samples_per_sensor.iter().map(|(kind, count)| {
        let rate = *count as f64 / summary.duration_s.max(1e-9);
        Fact::new(kind.name(), format!("{count} samples, {rate:.1} a second"))
    });
    let calibrations = [
        ("calibration", &summary.calibration),
        (
            "magnetometer calibration",
            &summary.magnetometer_calibration,
        ),
    ];
    let calibrations = calibrations
        .into_iter()
        .filter_map(|(label, text)| Some(Fact::new(label, text.as_deref()?)));
    let bias = summary.position.as_ref().map(|position| {
        let [x, y, z] = position.accelerometer_bias_m_s2;
        let value = format!("{x:.3}, {y:.3}, {z:.3} m/s\u{00b2}");
        Fact::new("accelerometer bias at the end", value)
    });
    sensors.chain(calibrations).chain(bias).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use northing_evaluation::attitude::kinds::EstimatorKind;
    use northing_evaluation::attitude::options::RunOptions;
    use northing_evaluation::attitude::parameters::Profile;
    use northing_evaluation::attitude::runner::run;
    use northing_recording::RecordingError;
    use northing_simulation::{VirtualPhone, VirtualPhoneConfig};

    #[test]
    fn a_run_fills_every_part_of_its_page() {
        let phone = VirtualPhone::new(VirtualPhoneConfig::default()).unwrap();
        let events = phone.events().map(Ok::<_, RecordingError>);
        let options = RunOptions {
            calibrate_first_s: Some(9.0),
            recording: "lab.csv".to_owned(),
            ..RunOptions::new(EstimatorKind::Mekf, Profile::HandHeld)
        };
        let summary = run(events, &options, &mut ()).unwrap();
        let trace = Trace::new(10);
        let report = RunReport::of_run("Lab", &summary, &trace);
        assert_eq!(
            (report.estimator.as_str(), report.recording.as_str()),
            ("mekf", "lab.csv")
        );
        let labels: Vec<&str> = report.summary.iter().map(|f| f.label.as_str()).collect();
        assert_eq!(labels[0], "attitude error, RMS");
        assert_eq!(labels[labels.len() - 2..], ["duration", "samples"]);
        // NEES, two sensors, the final test.
        assert_eq!(report.verdicts.len(), 4, "{:?}", report.verdicts);
        assert!(report.verdicts[0].text.starts_with("Mean NEES"));
        let used: Vec<u64> = report.updates.iter().map(|u| u.fused).collect();
        assert_eq!(used[1], summary.updates.accelerometer.fused);
        assert!(report.final_test.is_some());
        let calibrated = report
            .recording_facts
            .iter()
            .find(|f| f.label == "calibration");
        assert!(calibrated.unwrap().value.starts_with("from the first 9 s"));
        let std = report
            .settings
            .iter()
            .find(|s| s.name == "accelerometer_std");
        let std = std.unwrap().value.as_f64().unwrap();
        assert!((std - options.config.attitude.accelerometer_std).abs() < 1e-12);
    }
}
