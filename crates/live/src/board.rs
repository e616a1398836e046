//! The results board: the newest experiment of each device, ranked by consistency and not by the size of its error.
//!
//! A filter is good when its error is as large as it says. So the verdict of the final test comes first (consistent, conservative,
//! overconfident, none), then how far the mean NIS is from what it is when consistent: 3 for a vector, 1 for a heading.

use std::cmp::Ordering;
use std::collections::BTreeMap;

use northing_evaluation::attitude::final_test::FinalVerdict;
use serde::Serialize;

use crate::opened;
use crate::to_page::{ExperimentRow, ResultCell};

/// Mean NIS of a vector and of a heading when the filter is consistent.
const VECTOR: f64 = 3.0;
const HEADING: f64 = 1.0;
/// Departures that differ by less than this share a place: they are shown with two digits.
const ALIKE: f64 = 0.005;

/// A device's place on the board.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Standing {
    /// Its place, from 1; the equally consistent share one.
    pub place: usize,
    /// The experiment.
    pub experiment: String,
    /// The device.
    pub device_id: String,
    /// The verdict of the final test on the subject.
    pub verdict: Option<FinalVerdict>,
    /// By what factor the mean NIS of the sensor that fits worst is off, 1 or more; null without NIS.
    pub nis_factor: Option<f64>,
    /// Whether the mean NIS of that sensor is larger than expected.
    pub is_nis_large: bool,
}

/// The board of a table of experiments, the oldest first. Archived experiments and files opened from elsewhere are not on it.
#[must_use]
pub fn standings(rows: &[ExperimentRow]) -> Vec<Standing> {
    let mut newest: BTreeMap<&str, &ExperimentRow> = BTreeMap::new();
    let ranked = |row: &&ExperimentRow| !row.is_archived && !opened::is_file(&row.device_id);
    for row in rows.iter().filter(ranked) {
        newest.insert(&row.device_id, row);
    }
    let mut board: Vec<Standing> = newest.into_values().map(standing).collect();
    board.sort_by(|a, b| compared(a, b).then_with(|| a.device_id.cmp(&b.device_id)));
    for i in 0..board.len() {
        board[i].place = match i.checked_sub(1).map(|before| &board[before]) {
            Some(before) if is_level(before, &board[i]) => before.place,
            _ => i + 1,
        };
    }
    board
}

fn standing(row: &ExperimentRow) -> Standing {
    let cell = row.results.get(&row.subject);
    let departure = cell.and_then(nis_departure);
    Standing {
        place: 0,
        experiment: row.id.clone(),
        device_id: row.device_id.clone(),
        verdict: cell.and_then(|cell| cell.verdict),
        nis_factor: departure.map(|d| d.abs().exp()),
        is_nis_large: departure.is_some_and(|d| d > 0.0),
    }
}

/// Logarithm of mean NIS over expected NIS, of the sensor where it is farthest from 0.
fn nis_departure(cell: &ResultCell) -> Option<f64> {
    let sensors = [
        (cell.nis_acc, VECTOR),
        (cell.nis_mag, VECTOR),
        (cell.nis_compass, HEADING),
    ];
    let departures = sensors.into_iter().filter_map(|(nis, expected)| {
        let nis = nis.filter(|nis| nis.is_finite() && *nis > 0.0)?;
        Some((nis / expected).ln())
    });
    departures.max_by(|a, b| a.abs().total_cmp(&b.abs()))
}

fn rank(verdict: Option<FinalVerdict>) -> u8 {
    match verdict {
        Some(FinalVerdict::Consistent) => 0,
        Some(FinalVerdict::Conservative) => 1,
        Some(FinalVerdict::Overconfident) => 2,
        None => 3,
    }
}

fn compared(a: &Standing, b: &Standing) -> Ordering {
    let off = |s: &Standing| s.nis_factor.unwrap_or(f64::INFINITY);
    let by_verdict = rank(a.verdict).cmp(&rank(b.verdict));
    by_verdict.then_with(|| off(a).total_cmp(&off(b)))
}

fn is_level(a: &Standing, b: &Standing) -> bool {
    let alike = match (a.nis_factor, b.nis_factor) {
        (Some(a), Some(b)) => (a - b).abs() < ALIKE,
        (a, b) => a.is_none() && b.is_none(),
    };
    a.verdict == b.verdict && alike
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::messages::SensorUse;
    use northing_evaluation::attitude::options::SensorSelection;

    fn row(
        device: &str,
        verdict: Option<FinalVerdict>,
        error: f64,
        nis: [f64; 2],
    ) -> ExperimentRow {
        let cell = ResultCell {
            calculated_error_deg: Some(error),
            estimated_error_deg: Some(0.2),
            degrees_of_freedom: Some(3),
            calculated_tilt_deg: Some(error),
            estimated_tilt_deg: Some(0.1),
            verdict,
            nis_acc: Some(nis[0]),
            nis_mag: Some(nis[1]),
            nis_compass: None,
            error_deg: Some(error),
        };
        ExperimentRow {
            id: format!("e-{device}-{error}"),
            device: device.to_owned(),
            device_id: device.to_owned(),
            name: String::new(),
            at: String::new(),
            duration_s: 30.0,
            asked_s: 30.0,
            settings: serde_json::Value::Null,
            subject: "mekf".to_owned(),
            sensors: Vec::new(),
            used: SensorUse::of(&SensorSelection::default()),
            results: BTreeMap::from([("mekf".to_owned(), cell)]),
            is_earlier: false,
            has_samples: true,
            is_archived: false,
        }
    }

    fn order(board: &[Standing]) -> Vec<(usize, &str)> {
        board
            .iter()
            .map(|s| (s.place, s.device_id.as_str()))
            .collect()
    }

    #[test]
    fn consistency_ranks_and_not_the_size_of_the_error() {
        use FinalVerdict::{Conservative, Consistent, Overconfident};
        let rows = [
            // The smallest error of all, and a covariance that promises far too little of it.
            row("boaster", Some(Overconfident), 0.01, [3.0, 3.0]),
            row("shy", Some(Conservative), 0.02, [3.0, 3.0]),
            row("consistent", Some(Consistent), 2.5, [3.1, 2.9]),
            // Its error fits, its R does not: by a factor of 2, in either direction alike.
            row("large", Some(Consistent), 0.1, [6.0, 3.0]),
            row("small", Some(Consistent), 0.1, [3.0, 1.5]),
            row("unmoved", None, 0.0, [3.0, 3.0]),
        ];
        let board = standings(&rows);
        let expected = [
            (1, "consistent"),
            (2, "large"),
            (2, "small"),
            (4, "shy"),
            (5, "boaster"),
            (6, "unmoved"),
        ];
        assert_eq!(order(&board), expected);
        let large = &board[1];
        assert!((large.nis_factor.unwrap() - 2.0).abs() < 1e-12 && large.is_nis_large);
        assert!((board[2].nis_factor.unwrap() - 2.0).abs() < 1e-12 && !board[2].is_nis_large);
    }

    #[test]
    fn the_newest_of_each_device_counts_and_what_is_archived_or_opened_does_not() {
        use FinalVerdict::{Consistent, Overconfident};
        let mut archived = row("anna", Some(Consistent), 0.3, [3.0, 3.0]);
        archived.is_archived = true;
        let rows = [
            row("anna", Some(Consistent), 0.1, [3.0, 3.0]),
            row("anna", Some(Overconfident), 0.2, [9.0, 3.0]),
            archived,
            row(
                &opened::device_of("walk.csv"),
                Some(Consistent),
                0.1,
                [3.0, 3.0],
            ),
        ];
        let board = standings(&rows);
        assert_eq!(order(&board), [(1, "anna")]);
        assert_eq!(board[0].experiment, "e-anna-0.2");
        // A filter whose NIS is not known is behind those whose is.
        let mut none = row("ben", Some(Overconfident), 0.2, [9.0, 3.0]);
        if let Some(cell) = none.results.get_mut("mekf") {
            (cell.nis_acc, cell.nis_mag) = (None, None);
        }
        let board = standings(&[rows[1].clone(), none]);
        assert_eq!(order(&board), [(1, "anna"), (2, "ben")]);
    }
}
