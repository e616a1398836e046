//! The columns of a table of tracks, and a track's row.

use super::super::LocalPlane;
use super::TargetPoint;

/// What a column holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Type {
    Number,
    /// A whole number that may be missing.
    Whole,
    Text,
}

/// A cell.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Cell<'a> {
    /// A stamp, ns, that is told in seconds.
    Time(i64),
    Number(f64),
    Whole(Option<i64>),
    Text(&'a str),
}

use Type::{Number, Text, Whole};

/// Names and types; the places on the Earth come behind where they are known.
pub(super) const COLUMNS: [(&str, Type); 37] = [
    ("t_s", Number),
    ("track", Whole),
    ("north_m", Number),
    ("east_m", Number),
    ("vel_n_m_s", Number),
    ("vel_e_m_s", Number),
    ("cov_nn_m2", Number),
    ("cov_ne_m2", Number),
    ("cov_ee_m2", Number),
    ("vel_cov_nn_m2_s2", Number),
    ("vel_cov_ne_m2_s2", Number),
    ("vel_cov_ee_m2_s2", Number),
    ("cov_n_vel_n_m2_s", Number),
    ("cov_n_vel_e_m2_s", Number),
    ("cov_e_vel_n_m2_s", Number),
    ("cov_e_vel_e_m2_s", Number),
    ("turn_rate_rad_s", Number),
    ("turn_rate_var_rad2_s2", Number),
    ("cov_n_turn_m_rad_s", Number),
    ("cov_e_turn_m_rad_s", Number),
    ("cov_vel_n_turn_m_rad_s2", Number),
    ("cov_vel_e_turn_m_rad_s2", Number),
    ("existence", Number),
    ("visibility", Number),
    ("reported", Whole),
    ("model_straight", Number),
    ("model_turning", Number),
    ("model_manoeuvring", Number),
    ("sensor", Text),
    ("scan", Whole),
    ("detections_in_gate", Whole),
    ("detection", Whole),
    ("detection_probability", Number),
    ("missed_probability", Number),
    ("end", Text),
    ("latitude_deg", Number),
    ("longitude_deg", Number),
];

/// The columns of a recording with or without a place on the Earth.
pub(super) fn columns(plane: Option<&LocalPlane>) -> &'static [(&'static str, Type)] {
    match plane {
        Some(_) => &COLUMNS,
        None => &COLUMNS[..COLUMNS.len() - 2],
    }
}

/// The row of a track, a cell for each column.
pub(super) fn cells<'a>(
    time_ns: i64,
    target: &'a TargetPoint,
    plane: Option<&LocalPlane>,
) -> Vec<Cell<'a>> {
    let p = &target.covariance;
    let whole = |number: usize| Cell::Whole(i64::try_from(number).ok());
    let (detection, probability) = target.detection.unzip();
    let mut out = vec![Cell::Time(time_ns), Cell::Whole(Some(target.track.into()))];
    let state = [target.place_m, target.velocity_m_s].concat();
    out.extend(state.into_iter().map(Cell::Number));
    let covariances = [
        (0, 0),
        (0, 2),
        (2, 2),
        (1, 1),
        (1, 3),
        (3, 3),
        (0, 1),
        (0, 3),
        (2, 1),
        (2, 3),
    ];
    out.extend(covariances.map(|(row, column)| Cell::Number(p[row][column])));
    out.push(Cell::Number(target.turn_rate_rad_s));
    out.extend([4, 0, 2, 1, 3].map(|row| Cell::Number(p[row][4])));
    out.extend([target.existence, target.visibility].map(Cell::Number));
    out.push(Cell::Whole(Some(target.is_reported.into())));
    out.extend(target.models.map(Cell::Number));
    out.push(Cell::Text(&target.sensor));
    out.push(Cell::Whole(target.scan));
    out.push(whole(target.detections_in_gate));
    out.push(Cell::Whole(detection.map(i64::from)));
    out.push(Cell::Number(probability.unwrap_or(f64::NAN)));
    out.push(Cell::Number(target.missed_probability));
    out.push(Cell::Text(target.end.as_deref().unwrap_or_default()));
    if let Some(plane) = plane {
        out.extend(
            plane
                .degrees(target.place_m[0], target.place_m[1])
                .map(Cell::Number),
        );
    }
    out
}
