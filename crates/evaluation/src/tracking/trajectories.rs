//! T-GOSPA: the distance between the true and the estimated trajectories, in which a change of track costs something.
//!
//! Garcia-Fernandez, Rahmathullah, Svensson, *A Metric on the Space of Finite Sets of Trajectories for Evaluation of
//! Multi-Target Tracking Algorithms*, IEEE Transactions on Signal Processing 68 (2020), with p = 2 and alpha = 2. Each target is
//! assigned a track, or none, at every instant; an instant costs its squared GOSPA with that assignment. To begin or to end with
//! a track costs half the square of `gamma`, to change it the whole. Here gamma is the cut-off, and the sum is divided by the
//! instants, so that without changes it is the root mean square of GOSPA.
//!
//! One target alone is a shortest path. That a track serves no two targets is what couples them; where two shortest paths share
//! one, prices on tracks and instants (Lagrange multipliers, found by subgradients) give the bound from below of the
//! paper's linear program, and paths found one after the other an assignment, which is the bound from above.

use std::collections::BTreeMap;

use super::epoch::TrackedTarget;
use super::matching::{Place, distance};

/// Cost of a change between a track and none, in squared cut-offs: half of gamma squared.
const HALF_SWITCH: f64 = 0.5;
/// The bounds are one where they differ by less, relatively.
const EQUAL: f64 = 1e-6;
/// Rounds of prices: so many at most, and no more steps of paths than this.
const MOST_ROUNDS: usize = 200;
const MOST_STEPS: usize = 50_000_000;
/// Instants times tracks: with more the distance is not calculated, for want of memory.
const MOST_CELLS: usize = 20_000_000;

/// The distance between two sets of trajectories, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrajectoryDistance {
    /// Of the best assignment that was found.
    pub at_most_m: f64,
    /// No assignment is nearer. The same where the best is known.
    pub at_least_m: f64,
}

/// How near tracks were to targets, instant by instant.
#[derive(Debug, Clone, Default)]
pub(super) struct Trajectories {
    instants: u32,
    /// Targets and tracks, summed over the instants.
    present: usize,
    /// For each target and track: the instants at which they are nearer than the cut-off, and what is gained by assigning
    /// them: one less the squared distance in cut-offs.
    gains: BTreeMap<u32, BTreeMap<u32, Vec<(u32, f64)>>>,
}

impl Trajectories {
    /// Takes one instant.
    pub(super) fn take(&mut self, truth: &[(u32, Place)], tracks: &[TrackedTarget], cutoff_m: f64) {
        for (target, place) in truth {
            for track in tracks {
                let share = distance(*place, track.place) / cutoff_m;
                if share < 1.0 {
                    let of_target = self.gains.entry(*target).or_default();
                    let of_pair = of_target.entry(track.id).or_default();
                    of_pair.push((self.instants, 1.0 - share * share));
                }
            }
        }
        self.instants += 1;
        self.present += truth.len() + tracks.len();
    }

    /// The distance, `None` before the first instant, and where instants times tracks are too many.
    pub(super) fn distance(&self, cutoff_m: f64) -> Option<TrajectoryDistance> {
        let [least, most] = Problem::new(self)?.gain();
        let of = |gain: f64| {
            let alone = 0.5 * self.present as f64;
            cutoff_m * ((alone - gain).max(0.0) / f64::from(self.instants)).sqrt()
        };
        (self.instants > 0).then(|| TrajectoryDistance {
            at_most_m: of(least),
            at_least_m: of(most),
        })
    }
}

/// The assignment of tracks to targets over time. Between instants at which something can be gained nothing changes.
struct Problem {
    /// Instants at which something can be gained.
    instants: usize,
    tracks: usize,
    /// Those targets that are near a track at some time.
    targets: Vec<Target>,
}

/// Cost of a change from one track, or none, to another.
fn change(from_none: bool, to_none: bool) -> f64 {
    if from_none || to_none {
        HALF_SWITCH
    } else {
        2.0 * HALF_SWITCH
    }
}

/// One target's tracks, and what is gained by each at each instant: a row of all tracks for each instant.
struct Target {
    tracks: Vec<usize>,
    gains: Vec<f64>,
}

/// A target's tracks over time, `None` where it has none, and what they gain less the cost of changes.
struct Path {
    tracks: Vec<Option<usize>>,
    gain: f64,
}

impl Problem {
    /// `None` where it has too many cells.
    fn new(seen: &Trajectories) -> Option<Self> {
        let pairs = || seen.gains.values().flatten();
        let numbered = |mut all: Vec<u32>| -> BTreeMap<u32, usize> {
            all.sort_unstable();
            all.dedup();
            all.into_iter().zip(0..).collect()
        };
        let when = numbered(pairs().flat_map(|(_, at)| at).map(|(at, _)| *at).collect());
        let tracks = numbered(pairs().map(|(track, _)| *track).collect());
        if when.len().saturating_mul(tracks.len()) > MOST_CELLS {
            return None;
        }
        let target = |near: &BTreeMap<u32, Vec<(u32, f64)>>| {
            let mut gains = vec![0.0; when.len() * near.len()];
            for (column, gained) in near.values().enumerate() {
                for (at, gain) in gained {
                    gains[when[at] * near.len() + column] = *gain;
                }
            }
            Target {
                tracks: near.keys().map(|track| tracks[track]).collect(),
                gains,
            }
        };
        Some(Self {
            instants: when.len(),
            tracks: tracks.len(),
            targets: seen.gains.values().map(target).collect(),
        })
    }

    /// What the best assignment gains, at least and at most, in squared cut-offs.
    fn gain(&self) -> [f64; 2] {
        let mut prices = vec![0.0; self.instants * self.tracks];
        let mut found = 0.0_f64;
        let mut bound = f64::INFINITY;
        let mut scale = 1.0;
        let each = self.targets.iter().map(|target| target.gains.len() + 1);
        let rounds = (MOST_STEPS / each.sum::<usize>().max(1)).clamp(1, MOST_ROUNDS);
        for _ in 0..rounds {
            let paths: Vec<Path> = self.targets.iter().map(|t| t.path(&prices, self)).collect();
            let paid: f64 = prices.iter().sum();
            let now = paths.iter().map(|path| path.gain).sum::<f64>() + paid;
            // A step that made it worse was too long.
            scale *= if now < bound { 1.0 } else { 0.7 };
            bound = bound.min(now);
            for first in [true, false] {
                found = found.max(self.one_after_the_other(&paths, &prices, first));
            }
            if bound - found <= EQUAL * (1.0 + bound) {
                return [found, found.max(bound)];
            }
            self.raise(&mut prices, &paths, scale * (now - found));
        }
        [found, bound]
    }

    /// Moves prices up where several have a track, and down where nobody has one: by a step that would close this gap.
    fn raise(&self, prices: &mut [f64], paths: &[Path], gap: f64) {
        let mut wanted = vec![-1.0; prices.len()];
        for path in paths {
            for (at, track) in path.tracks.iter().enumerate() {
                if let Some(track) = track {
                    wanted[at * self.tracks + track] += 1.0;
                }
            }
        }
        // A price of nothing stays where nobody pays.
        for (want, price) in wanted.iter_mut().zip(prices.iter()) {
            if *want < 0.0 && *price == 0.0 {
                *want = 0.0;
            }
        }
        let square: f64 = wanted.iter().map(|want| want * want).sum();
        if square > 0.0 {
            for (price, want) in prices.iter_mut().zip(&wanted) {
                *price = (*price + gap / square * want).max(0.0);
            }
        }
    }

    /// Gain of paths chosen one after the other at these prices, the most profitable target first or last, each with the tracks
    /// that are left, and then each once more with those that the others leave.
    fn one_after_the_other(&self, paths: &[Path], prices: &[f64], first: bool) -> f64 {
        let mut order: Vec<usize> = (0..paths.len()).collect();
        order.sort_by(|a, b| paths[*b].gain.total_cmp(&paths[*a].gain));
        if !first {
            order.reverse();
        }
        let mut taken = prices.to_vec();
        let mut chosen: Vec<Option<Path>> = paths.iter().map(|_| None).collect();
        for target in &order {
            let path = self.targets[*target].path(&taken, self);
            self.mark(&mut taken, &path, f64::INFINITY);
            chosen[*target] = Some(path);
        }
        // Without prices; what is taken is not to be had.
        for cell in &mut taken {
            *cell = if cell.is_finite() { 0.0 } else { *cell };
        }
        let mut gain = 0.0;
        for target in order {
            if let Some(path) = &chosen[target] {
                self.mark(&mut taken, path, 0.0);
            }
            let path = self.targets[target].path(&taken, self);
            self.mark(&mut taken, &path, f64::INFINITY);
            gain += path.gain;
        }
        gain
    }

    fn mark(&self, prices: &mut [f64], path: &Path, price: f64) {
        for (at, track) in path.tracks.iter().enumerate() {
            if let Some(track) = track {
                prices[at * self.tracks + track] = price;
            }
        }
    }
}

impl Target {
    /// The best path at these prices of tracks and instants.
    fn path(&self, prices: &[f64], problem: &Problem) -> Path {
        // The last column is no track.
        let columns = self.tracks.len() + 1;
        let none = columns - 1;
        let gain = |at: usize, column: usize| match self.tracks.get(column) {
            Some(track) => self.gains[at * none + column] - prices[at * problem.tracks + track],
            None => 0.0,
        };
        let mut best: Vec<f64> = (0..columns).map(|column| gain(0, column)).collect();
        let mut came_from = vec![0_u32; problem.instants * columns];
        for at in 1..problem.instants {
            let before = best.clone();
            let first = (0..columns).max_by(|a, b| before[*a].total_cmp(&before[*b]));
            let first = first.unwrap_or(none);
            for column in 0..columns {
                // To stay is preferred to what is as good.
                let mut from = (column, before[column]);
                for other in [none, first] {
                    let value = before[other] - change(other == none, column == none);
                    if other != column && value > from.1 {
                        from = (other, value);
                    }
                }
                best[column] = from.1 + gain(at, column);
                came_from[at * columns + column] = from.0 as u32;
            }
        }
        self.traced(&best, &came_from, problem.instants)
    }

    /// The path that ends best, from its end to its beginning.
    fn traced(&self, best: &[f64], came_from: &[u32], instants: usize) -> Path {
        let columns = best.len();
        let ends = (0..columns).max_by(|a, b| best[*a].total_cmp(&best[*b]));
        let mut column = ends.unwrap_or(columns - 1);
        let gain = best[column];
        let mut tracks = vec![None; instants];
        for at in (0..instants).rev() {
            tracks[at] = self.tracks.get(column).copied();
            column = came_from[at * columns + column] as usize;
        }
        Path { tracks, gain }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use rand::{RngExt as _, SeedableRng as _};
    use rand_distr::{Distribution as _, StandardNormal};

    /// Positions on a line; one number a target or a track, NaN where it is not there.
    fn seen(truth: &[&[f64]], tracks: &[&[f64]], cutoff_m: f64) -> Trajectories {
        let mut seen = Trajectories::default();
        let instants = truth.iter().chain(tracks).map(|line| line.len()).max();
        for at in 0..instants.unwrap_or(0) {
            let there = |lines: &[&[f64]]| -> Vec<(u32, Place)> {
                let each = (0..).zip(lines).map(|(id, line)| (id, [line[at], 0.0]));
                each.filter(|(_, place)| !place[0].is_nan()).collect()
            };
            let tracks: Vec<_> = there(tracks)
                .into_iter()
                .map(|(id, place)| TrackedTarget::at(id, place))
                .collect();
            seen.take(&there(truth), &tracks, cutoff_m);
        }
        seen
    }

    fn distance_m(truth: &[&[f64]], tracks: &[&[f64]], cutoff_m: f64) -> f64 {
        let found = seen(truth, tracks, cutoff_m).distance(cutoff_m).unwrap();
        assert_relative_eq!(found.at_least_m, found.at_most_m, max_relative = 1e-5);
        found.at_most_m
    }

    #[test]
    fn one_track_all_the_time_is_the_rms_of_gospa() {
        let far = distance_m(&[&[0.0; 4]], &[&[3.0, 4.0, 3.0, 4.0]], 10.0);
        assert_relative_eq!(far, 12.5_f64.sqrt(), epsilon = 1e-9);
    }

    #[test]
    fn a_change_of_track_costs_a_cutoff() {
        const N: f64 = f64::NAN;
        let split: [&[f64]; 2] = [&[0.0, 0.0, N, N], &[N, N, 0.0, 0.0]];
        let far = distance_m(&[&[0.0; 4]], &split, 10.0);
        assert_relative_eq!(far, (100.0_f64 / 4.0).sqrt(), epsilon = 1e-9);
        // A target that is missed for one instant keeps its track.
        let far = distance_m(&[&[0.0; 4]], &[&[0.0, N, 0.0, 0.0]], 10.0);
        assert_relative_eq!(far, (50.0_f64 / 4.0).sqrt(), epsilon = 1e-9);
        // Two that swap for one instant are worth no change: 2 * 36 is less than four changes.
        let swap: [&[f64]; 2] = [&[0.0, 6.0, 0.0, 0.0], &[6.0, 0.0, 6.0, 6.0]];
        let far = distance_m(&[&[0.0; 4], &[6.0; 4]], &swap, 10.0);
        assert_relative_eq!(far, (72.0_f64 / 4.0).sqrt(), epsilon = 1e-9);
    }

    #[test]
    fn what_would_need_too_much_memory_is_not_calculated() {
        let mut seen = Trajectories::default();
        // Each track is near for one instant.
        for id in 0..5000 {
            seen.take(
                &[(0, [0.0, 0.0])],
                &[TrackedTarget::at(id, [1.0, 0.0])],
                10.0,
            );
        }
        assert_eq!(seen.distance(10.0), None);
    }

    #[test]
    fn nothing_has_no_distance_and_alone_costs_half() {
        assert_eq!(Trajectories::default().distance(10.0), None);
        let far = distance_m(&[&[0.0; 4]], &[], 10.0);
        assert_relative_eq!(far, 50.0_f64.sqrt(), epsilon = 1e-9);
        let far = distance_m(&[], &[&[0.0; 4]], 10.0);
        assert_relative_eq!(far, 50.0_f64.sqrt(), epsilon = 1e-9);
    }

    /// The least cost over all assignments of two targets to two tracks, in squared cut-offs: by trying each of them.
    fn by_trying(truth: &[&[f64]; 2], tracks: &[&[f64]; 2], cutoff_m: f64) -> f64 {
        const BOTH: [[Option<usize>; 2]; 7] = [
            [None, None],
            [Some(0), None],
            [Some(1), None],
            [None, Some(0)],
            [None, Some(1)],
            [Some(0), Some(1)],
            [Some(1), Some(0)],
        ];
        let instants = truth[0].len();
        let mut costs = [0.0; 7];
        for at in 0..instants {
            let there = |line: &[f64]| f64::from(u8::from(!line[at].is_nan()));
            let alone = 0.5 * (truth.iter().chain(tracks).map(|line| there(line))).sum::<f64>();
            costs = std::array::from_fn(|now| {
                let gain = |(target, track): (usize, &Option<usize>)| {
                    let share =
                        track.map(|track| (truth[target][at] - tracks[track][at]) / cutoff_m);
                    share.filter(|s| s.abs() < 1.0).map_or(0.0, |s| 1.0 - s * s)
                };
                let gained: f64 = BOTH[now].iter().enumerate().map(gain).sum();
                let from = (0..7).map(|before| {
                    let changes = BOTH[before]
                        .iter()
                        .zip(&BOTH[now])
                        .map(|(a, b)| match (a, b) {
                            _ if a == b || at == 0 => 0.0,
                            (Some(_), Some(_)) => 1.0,
                            _ => HALF_SWITCH,
                        });
                    costs[before] + changes.sum::<f64>()
                });
                from.fold(f64::INFINITY, f64::min) + alone - gained
            });
        }
        costs.into_iter().fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn two_targets_and_two_tracks_as_by_trying_every_assignment() {
        let mut random = rand_pcg::Pcg64Mcg::seed_from_u64(3);
        let mut apart = 0;
        for _ in 0..400 {
            let mut line = |std: f64| -> Vec<f64> {
                let mut at = 0.0;
                let mut walk = |by: f64| -> f64 {
                    let step: f64 = StandardNormal.sample(&mut random);
                    at += by * step;
                    if random.random_bool(0.15) {
                        f64::NAN
                    } else {
                        at
                    }
                };
                walk(5.0);
                (0..12).map(|_| walk(std)).collect()
            };
            let lines: [Vec<f64>; 4] = [2.0, 2.0, 4.0, 4.0].map(&mut line);
            let [a, b, c, d] = lines.each_ref().map(Vec::as_slice);
            let best = 10.0 * (by_trying(&[a, b], &[c, d], 10.0) / 12.0).sqrt();
            let found = seen(&[a, b], &[c, d], 10.0).distance(10.0).unwrap();
            assert!(found.at_least_m <= best + 1e-9, "{found:?} {best}");
            assert!(found.at_most_m >= best - 1e-9, "{found:?} {best}");
            apart += usize::from(found.at_most_m > best * 1.001);
        }
        assert!(apart <= 8, "{apart} of 400 are not the best");
    }
}
