//! The checks of the cards, and what they share.

pub(super) mod samples;
pub(super) mod settings;

use nalgebra::Vector3;
use northing_core::calibration::RestCalibration;
use northing_recording::Event;

use super::cards::Card;
use super::judgement::{Judgement, decimals};
use super::turning::{path, rates, rests};
use super::work::Work;
use crate::RunSummary;

/// Turning less than this all in all is no motion, deg.
pub(in crate::exercises) const LEAST_TURN_DEG: f64 = 90.0;
/// An experiment is at least so long, s.
pub(in crate::exercises) const SHORTEST_S: f64 = 20.0;

/// `None` as soon as something does not hold.
pub(super) type Found = Option<()>;

fn demand<const N: usize>(
    judgement: &mut Judgement,
    holds: bool,
    key: &str,
    values: [(&str, String); N],
) -> Found {
    judgement.find(holds, key, values).then_some(())
}

/// The key of a question's text.
fn question(card: Card, name: &str) -> String {
    format!("card.{}.{name}", card.name())
}

/// A number that must have been answered.
fn answered(work: &Work<'_>, judgement: &mut Judgement, card: Card, name: &str) -> Option<f64> {
    let value = work.number(name);
    if value.is_none() {
        let values = [("question", question(card, name))];
        judgement.find(false, "reason.unanswered", values);
    }
    value
}

/// A choice that must have been made.
fn chosen<'a>(
    work: &Work<'a>,
    judgement: &mut Judgement,
    card: Card,
    name: &str,
) -> Option<&'a str> {
    let choices = card.choices(name);
    let value = work.choice(name);
    if choices.contains(&value) {
        return Some(value);
    }
    let values = [
        ("question", question(card, name)),
        ("choices", choices.join(", ")),
    ];
    judgement.find(false, "reason.unchosen", values);
    None
}

/// The run of the hand-in, or why there is none.
fn summary(work: &Work<'_>, events: &[Event], judgement: &mut Judgement) -> Option<RunSummary> {
    match work.run(events, work.options.estimator, &mut ()) {
        Ok(summary) => Some(summary),
        Err(error) => {
            judgement.find(false, "reason.noRun", [("error", error.to_string())]);
            None
        }
    }
}

/// The calibration at rest that is in force, or why there is none.
fn calibration(work: &Work<'_>, judgement: &mut Judgement) -> Option<RestCalibration<f64>> {
    match work.calibration() {
        Ok(found) => {
            demand(judgement, found.is_some(), "reason.calibrated", [])?;
            found
        }
        Err(error) => {
            let values = [("error", error.to_string())];
            judgement.find(false, "reason.notCalibrated", values);
            None
        }
    }
}

fn moved(work: &Work<'_>, judgement: &mut Judgement) -> Found {
    let rates = rates(work.events);
    let bias = rests(&rates)
        .first()
        .map_or_else(Vector3::zeros, |rest| rest.mean_rad_s);
    let seconds = match (rates.first(), rates.last()) {
        (Some(first), Some(last)) => last.0.saturating_sub(first.0) as f64 * 1e-9,
        _ => 0.0,
    };
    demand(
        judgement,
        seconds >= SHORTEST_S,
        "reason.length",
        [
            ("seconds", decimals(seconds, 0)),
            ("least", decimals(SHORTEST_S, 0)),
        ],
    )?;
    let turned_deg = path(&rates, bias).to_degrees();
    demand(
        judgement,
        turned_deg >= LEAST_TURN_DEG,
        "reason.motion",
        [
            ("turned", decimals(turned_deg, 0)),
            ("least", decimals(LEAST_TURN_DEG, 0)),
        ],
    )
}
