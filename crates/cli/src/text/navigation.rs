//! The outcome of a navigation run for people: a short sheet, numbers with words.

use northing_evaluation::navigation::NavigationSummary;
use northing_evaluation::navigation::batch_smoother::SmoothingSummary;
use northing_evaluation::navigation::score::OutageScore;
use northing_report::navigation_verdicts;

use crate::text::sheet::Sheet;
use crate::text::used;

/// The sheet of a run.
pub(crate) fn describe(summary: &NavigationSummary) -> String {
    describe_with(summary, &str::to_owned)
}

/// The same with every text of it changed.
pub(crate) fn describe_with(
    summary: &NavigationSummary,
    change: &dyn Fn(&str) -> String,
) -> String {
    let mut sheet = Sheet::default();
    sheet.row("position", position(summary));
    if let Some(velocity) = summary.velocity_rmse_m_s {
        sheet.row("velocity", format!("{velocity:.3} m/s RMS"));
    }
    if let Some(heading) = &summary.heading {
        let text = if heading.against_course {
            format!(
                "{:.2} deg RMS about the course on straight parts ({} instants; the unit points {:.2} deg to the right of it)",
                heading.rmse_deg, heading.samples, heading.mean_deg
            )
        } else {
            format!(
                "{:.2} deg RMS ({:.2} deg in the mean), tilt {:.2} deg RMS, over {} instants",
                heading.rmse_deg,
                heading.mean_deg,
                summary.tilt_rmse_deg.unwrap_or(f64::NAN),
                heading.samples
            )
        };
        sheet.row("heading", text);
    }
    for (index, outage) in summary.outages.iter().enumerate() {
        sheet.row(if index == 0 { "outages" } else { "" }, of_outage(outage));
    }
    for (kind, aid) in &summary.aids {
        let mut text = used(&aid.updates);
        if let Some(nis) = &aid.nis {
            text.push_str(&format!(
                " Mean NIS {:.2} of {} expected.",
                nis.mean, nis.degrees_of_freedom
            ));
        }
        sheet.row(kind.name(), text);
    }
    if let Some(smoothing) = &summary.smoothing {
        sheet.row("smoother", of_smoothing(smoothing));
    }
    let v = &summary.validity;
    sheet.row(
        "solution status",
        format!(
            "aided {:.1} s, heading unknown {:.1} s, dead reckoning {:.1} s, invalid {:.1} s, aligning {:.1} s",
            v.aided_s, v.heading_unknown_s, v.dead_reckoning_s, v.invalid_s, v.aligning_s
        ),
    );
    let verdicts: Vec<String> = navigation_verdicts(summary)
        .into_iter()
        .map(|verdict| verdict.text)
        .collect();
    sheet.sentences("verdict", &verdicts);
    for (reason, count) in &summary.fixes_unusable {
        let fixes = if *count == 1 { "fix" } else { "fixes" };
        sheet.row("not used", format!("{count} {fixes}: {reason}"));
    }
    sheet.parameters(&summary.parameters);
    sheet.sentences("recording", &summary.issues);
    sheet.change(change);
    let smoothed = if summary.smoothed { ", smoothed" } else { "" };
    format!(
        "{}: {}{smoothed} over {:.1} s, {} inertial samples, {} of {} fixes used\n\n{}",
        summary.recording,
        summary.estimator,
        summary.duration_s,
        summary.inertial_samples,
        summary.fixes_used,
        summary.fixes,
        sheet.render()
    )
}

fn of_smoothing(s: &SmoothingSummary) -> String {
    let how = if s.converged {
        "converged in"
    } else {
        "not converged after"
    };
    let [x, y, z] = s.lever_arm_m;
    format!(
        "{how} {} passes; {} of {} positions count less; time offset of the receiver {:.3} s, lever arm {x:.2} {y:.2} {z:.2} m",
        s.iterations, s.fixes_down_weighted, s.fixes, s.time_offset_s
    )
}

fn position(summary: &NavigationSummary) -> String {
    let Some(score) = &summary.position else {
        let left_out = !summary.outages.is_empty() || summary.fixes_given < summary.fixes;
        let reason = if left_out {
            "no reference, and no fix held out outside outages, where scores count"
        } else {
            "every fix was used, and there is no reference where scores count"
        };
        return format!("not scored: {reason}");
    };
    let vertical = score
        .vertical_rmse_m
        .map_or_else(String::new, |v| format!(", {v:.3} m vertically"));
    let against = match summary.scored_against {
        Some("reference") => "the reference",
        other => other.unwrap_or("held-out fixes"),
    };
    let mut text = format!(
        "{:.3} m RMS horizontally{vertical}, against {} at {} points; {:.1} % inside the 95 % ellipse.",
        score.horizontal_rmse_m,
        against,
        score.scored_fixes,
        100.0 * score.inside_95
    );
    if let (Some(hold), Some(line)) = (score.hold_rmse_m, score.extrapolation_rmse_m) {
        text.push_str(&format!(
            " Without a filter: {hold:.3} m holding the last fix, {line:.3} m moving on from it."
        ));
    }
    text
}

fn of_outage(outage: &OutageScore) -> String {
    let span = format!(
        "{:.0} s to {:.0} s:",
        outage.start_s,
        outage.start_s + outage.duration_s
    );
    match (outage.horizontal_error_m, outage.predicted_std_m) {
        (Some(error), Some(std)) => {
            let inside = match outage.inside_95 {
                Some(true) => "inside",
                _ => "outside",
            };
            format!(
                "{span} {} off at the end, {} predicted; {inside} the 95 % ellipse",
                metres(error),
                metres(std)
            )
        }
        _ => format!("{span} nothing to score at"),
    }
}

/// Metres to a tenth, or to a millimetre where a tenth says nothing.
fn metres(value: f64) -> String {
    if value < 1.0 {
        format!("{value:.3} m")
    } else {
        format!("{value:.1} m")
    }
}
