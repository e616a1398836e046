//! Assignment of tracks to targets, and GOSPA: the distance between two sets of positions.
//!
//! GOSPA: Rahmathullah, Garcia-Fernandez, Svensson, *Generalized Optimal Sub-Pattern Assignment
//! Metric*, FUSION (2017), with p = 2 and alpha = 2. The assignment comes from a library (Kuhn and
//! Munkres), on whole billionths of the squared cut-off because it wants exact arithmetic.

use pathfinding::kuhn_munkres::kuhn_munkres;
use pathfinding::matrix::Matrix;

/// A position: north and east, m.
pub type Place = [f64; 2];

/// Distance of two places, m.
#[must_use]
pub fn distance(a: Place, b: Place) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// For each target the index of its track, or `None`: the assignment with the smallest sum of squared
/// distances, where a target without track costs as much as one `cutoff_m` away.
#[must_use]
pub fn assign(targets: &[Place], tracks: &[Place], cutoff_m: f64) -> Vec<Option<usize>> {
    /// Gain of a track on its target.
    const MOST: f64 = 1e9;
    if targets.is_empty() || tracks.is_empty() {
        return vec![None; targets.len()];
    }
    // Columns without gain stand for no track: every target can have one.
    let columns = tracks.len() + targets.len();
    let gain = |(row, column): (usize, usize)| {
        let away = tracks
            .get(column)
            .map_or(f64::INFINITY, |track| distance(targets[row], *track));
        if away < cutoff_m {
            let share = away / cutoff_m;
            ((1.0 - share * share) * MOST) as i64
        } else {
            0
        }
    };
    let gains = Matrix::from_fn(targets.len(), columns, gain);
    let (_, chosen) = kuhn_munkres(&gains);
    chosen
        .into_iter()
        .enumerate()
        .map(|(row, column)| (gains[(row, column)] > 0).then_some(column))
        .collect()
}

/// GOSPA and what it is made of, all in m^2: `distance^2 = localisation + missed + false`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Gospa {
    /// Squared distances of the assigned pairs.
    pub localisation: f64,
    /// Half a squared cut-off for each target without track.
    pub missed: f64,
    /// Half a squared cut-off for each track without target.
    pub false_tracks: f64,
}

/// OSPA (Schuhmacher, Vo, Vo 2008) with p = 2: the root of the mean squared distance over the larger of the two sets, where what has no
/// partner is one cut-off away. The assignment that is best for GOSPA is best for it, too.
#[must_use]
pub fn ospa_m(gospa: &Gospa, targets: usize, tracks: usize, cutoff_m: f64) -> f64 {
    let most = targets.max(tracks);
    if most == 0 {
        return 0.0;
    }
    let square = cutoff_m * cutoff_m;
    let without = |cost: f64| 2.0 * cost / square;
    let alone = without(gospa.missed).max(without(gospa.false_tracks));
    ((gospa.localisation + alone * square) / most as f64).sqrt()
}

impl Gospa {
    /// The parts of one epoch with its assignment.
    #[must_use]
    pub fn new(
        targets: &[Place],
        tracks: &[Place],
        assignment: &[Option<usize>],
        cutoff_m: f64,
    ) -> Self {
        let pairs = targets.iter().zip(assignment);
        let mut out = Self::default();
        let mut assigned = 0;
        for (target, track) in pairs {
            match track {
                Some(track) => {
                    let away = distance(*target, tracks[*track]);
                    out.localisation += away * away;
                    assigned += 1;
                }
                None => out.missed += 0.5 * cutoff_m * cutoff_m,
            }
        }
        let left = tracks.len().saturating_sub(assigned);
        out.false_tracks = 0.5 * cutoff_m * cutoff_m * left as f64;
        out
    }

    /// The distance, m.
    #[must_use]
    pub fn distance_m(&self) -> f64 {
        (self.localisation + self.missed + self.false_tracks).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn the_sum_decides_and_not_the_nearest_pair() {
        // the first target is nearest to the first track, but the second has only that one
        let targets = [[0.0, 0.0], [0.0, 10.0]];
        let tracks = [[0.0, 4.0], [0.0, -6.0]];
        assert_eq!(assign(&targets, &tracks, 40.0), [Some(1), Some(0)]);
        assert_eq!(assign(&targets, &tracks, 5.0), [Some(0), None]);
        assert_eq!(assign(&targets, &[], 40.0), [None, None]);
        assert!(assign(&[], &tracks, 40.0).is_empty());
    }

    #[test]
    fn a_track_serves_one_target_and_none_beyond_the_cutoff() {
        let targets = [[0.0, 0.0], [1.0, 0.0], [500.0, 0.0]];
        let tracks = [[0.9, 0.0]];
        assert_eq!(assign(&targets, &tracks, 40.0), [None, Some(0), None]);
        assert_eq!(assign(&targets, &[[f64::NAN, 0.0]], 40.0), [None; 3]);
    }

    #[test]
    fn gospa_by_hand() {
        let targets = [[0.0, 0.0], [100.0, 0.0]];
        let tracks = [[3.0, 4.0], [0.0, 300.0], [0.0, 400.0]];
        let assignment = assign(&targets, &tracks, 40.0);
        let gospa = Gospa::new(&targets, &tracks, &assignment, 40.0);
        // 5^2 + one missed 800 + two false 1600
        assert_relative_eq!(gospa.localisation, 25.0, epsilon = 1e-9);
        assert_relative_eq!(gospa.missed, 800.0, epsilon = 1e-9);
        assert_relative_eq!(gospa.false_tracks, 1600.0, epsilon = 1e-9);
        assert_relative_eq!(gospa.distance_m(), f64::sqrt(2425.0), epsilon = 1e-9);
        let nothing = Gospa::new(&[], &[], &[], 40.0);
        assert_relative_eq!(nothing.distance_m(), 0.0);
    }
}
