//! The tables of `docs/results/navigation.md`.

use std::fmt::Write as _;

use northing_simulation::ground::{Ground, ReceiverError};

use super::experiment::{Experiment, OUTAGES_S, OutageScore, TrackingScore};

/// All tables as Markdown.
#[must_use]
pub fn markdown(experiment: &Experiment) -> String {
    let mut text = String::new();
    for (kind, name) in [(Ground::Walk, "On foot"), (Ground::Drive, "By car")] {
        for (receiver, error) in [
            (ReceiverError::White, "white receiver errors"),
            (ReceiverError::Correlated, "receiver errors that last 60 s"),
        ] {
            let _ = writeln!(text, "{name}, {error}:\n");
            tracking(&mut text, &experiment.tracking(kind, receiver));
        }
        let _ = writeln!(text, "{name}, outages (median / 90 %, m):\n");
        outages(&mut text, &experiment.outages(kind));
    }
    text
}

fn tracking(text: &mut String, scores: &[TrackingScore]) {
    text.push_str(
        "| scheme | horizontal m | vertical m | velocity m/s | tilt deg | heading deg |\n",
    );
    text.push_str("|---|---:|---:|---:|---:|---:|\n");
    let cell = |value: Option<f64>| value.map_or_else(String::new, |value| format!("{value:.2}"));
    for score in scores {
        let _ = writeln!(
            text,
            "| {} | {:.2} | {:.2} | {} | {} | {} |",
            score.scheme.name(),
            score.horizontal_m,
            score.vertical_m,
            cell(score.velocity_m_s),
            cell(score.tilt_deg),
            cell(score.heading_deg)
        );
    }
    text.push('\n');
}

fn outages(text: &mut String, scores: &[OutageScore]) {
    let head = OUTAGES_S.map(|seconds| format!(" {seconds} s |")).concat();
    let _ = writeln!(text, "| scheme |{head}\n|---|---:|---:|---:|");
    for score in scores {
        let cells = score.median_m.iter().zip(&score.ninety_m);
        let cells: String = cells.map(|(a, b)| format!(" {a:.1} / {b:.1} |")).collect();
        let _ = writeln!(text, "| {} |{cells}", score.scheme.name());
    }
    text.push('\n');
}
