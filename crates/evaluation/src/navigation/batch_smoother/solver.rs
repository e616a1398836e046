//! Passes of the batch smoother until nothing changes, with the weights of the measurements and the noise scales of the receiver
//! (E48, E49).

use nalgebra::{Matrix3, SMatrix, Vector3};
use northing_core::ConfigError;
use northing_core::earth::LocalFrame;
use northing_core::geometry::so3;
use northing_core::navigation::augmented_states::{BAROMETER_OFFSET, GNSS_OFFSET, TIME_OFFSET};
use northing_core::navigation::error_state::{LEAST_WEIGHT, robust_weight};
use northing_core::navigation::gnss_ins::GnssInsConfig;
use northing_core::navigation::{ATTITUDE, POSITION, STATES, VELOCITY};

use super::aids::{Aids, floored};
use super::motion::{SlowError, Strapdown};
use super::nominal::{Nominal, nominal};
use super::pass::{Attached, Linearization, Smoothed};
use super::prior::prior_covariance;
use super::recorder::{Measured, Measurement, Part, Segment};
use super::state::State;
use super::timeline::nodes;
use super::{
    ALL, BatchSolution, Covariance, Errors, LEVER_ARM, SmoothedNavigation, SmoothingSummary,
};
use crate::statistics::seconds_between;

/// Most passes.
const MOST_PASSES: u32 = 30;
/// A pass that moves no state by more than this many standard deviations, ...
const SETTLED_SIGMAS: f64 = 0.1;
/// ... no weight, and no logarithm of a noise scale by more than this, is the last.
const SETTLED_WEIGHT: f64 = 0.05;
const SETTLED_SCALE: f64 = 0.02;
/// A pass turns no attitude by more than this, rad: beyond it is not linear.
const LARGEST_TURN: f64 = 0.5;
/// Least weight: variances divided by it are numbers still.
const SMALLEST_WEIGHT: f64 = 1e-15;

/// Smooths every segment.
pub(super) fn smooth(segments: &[Segment], config: &GnssInsConfig<f64>) -> BatchSolution {
    let mut solution = BatchSolution::default();
    for segment in segments {
        // The settings are those that the filter was made with.
        if let Ok(Some((nodes, summary))) = solve(segment, config) {
            solution.nodes.extend(nodes);
            solution.summary = Some(match solution.summary {
                Some(before) => before.with(&summary),
                None => summary,
            });
        }
    }
    solution
}

impl SmoothingSummary {
    fn with(&self, next: &Self) -> Self {
        Self {
            iterations: self.iterations.max(next.iterations),
            converged: self.converged && next.converged,
            batches: self.batches + next.batches,
            fixes: self.fixes + next.fixes,
            fixes_down_weighted: self.fixes_down_weighted + next.fixes_down_weighted,
            ..*next
        }
    }
}

type Solved = (Vec<SmoothedNavigation>, SmoothingSummary);

fn solve(segment: &Segment, config: &GnssInsConfig<f64>) -> Result<Option<Solved>, ConfigError> {
    let strapdown = Strapdown { segment, config };
    let (times_ns, mut attached) = nodes(segment);
    if times_ns.len() < 2 {
        return Ok(None);
    }
    let Some(first) = nominal(&strapdown, &times_ns)? else {
        return Ok(None);
    };
    first_weights(&mut attached, &first);
    if let Some([heading, std]) = config.initial_heading {
        attached.insert(0, initial_heading(times_ns[0], heading, std));
    }
    let mut batch = Batch::new(&strapdown, times_ns, attached, first.states);
    let mut summary = batch.summary();
    let mut nodes = Vec::new();
    for iteration in 1..=MOST_PASSES {
        // Those of the pass before are not needed: memory for one of both.
        drop(core::mem::take(&mut nodes));
        let passed = batch.pass()?;
        let settled = passed.as_ref().is_some_and(|(_, settled)| *settled);
        summary = SmoothingSummary {
            iterations: iteration,
            converged: settled,
            ..batch.summary()
        };
        let has_failed = passed.is_none();
        nodes = passed.map_or_else(Vec::new, |(nodes, _)| nodes);
        if settled || has_failed {
            break;
        }
    }
    Ok(Some((nodes, summary)))
}

fn initial_heading(time_ns: i64, heading: f64, std: f64) -> Attached {
    Attached {
        node: 0,
        age_s: 0.0,
        measurement: Measurement {
            time_ns,
            measured: Measured::Heading(heading, std),
            weight: 1.0,
        },
        weight: 1.0,
    }
}

/// The filter's weights are a first guess where its heading was known.
fn first_weights(attached: &mut [Attached], nominal: &Nominal) {
    for one in attached {
        let is_known = nominal.is_known.get(one.node) == Some(&true);
        one.weight = if is_known {
            one.measurement.weight.max(SMALLEST_WEIGHT)
        } else {
            1.0
        };
    }
}

/// A batch on its way to the solution.
struct Batch<'a> {
    strapdown: &'a Strapdown<'a>,
    times_ns: Vec<i64>,
    attached: Vec<Attached>,
    states: Vec<State>,
    /// Mean and covariance of the first node before any measurement.
    prior: (State, Covariance),
    noise_scales: [f64; 3],
}

impl<'a> Batch<'a> {
    fn new(
        strapdown: &'a Strapdown<'a>,
        times_ns: Vec<i64>,
        attached: Vec<Attached>,
        mut states: Vec<State>,
    ) -> Self {
        let height = attached
            .iter()
            .find_map(|one| match one.measurement.measured {
                Measured::Height(height) => Some(height + states.get(one.node)?.position.z),
                _ => None,
            });
        for state in &mut states {
            state.side[BAROMETER_OFFSET] = height.unwrap_or_default();
        }
        let first = states[0];
        let mut prior = State {
            accelerometer_bias: Vector3::zeros(),
            gyroscope_bias: Vector3::zeros(),
            bias_at_rest: [Vector3::zeros(); 2],
            side: first.side * 0.0,
            ..first
        };
        prior.side[BAROMETER_OFFSET] = height.unwrap_or_default();
        let covariance = prior_covariance(strapdown.config, &attached);
        Self {
            strapdown,
            times_ns,
            attached,
            states,
            prior: (prior, covariance),
            noise_scales: [1.0; 3],
        }
    }

    /// One pass: the smoothed nodes, and whether it has changed nothing any more; `None` where the numbers have failed.
    fn pass(&mut self) -> Result<Option<(Vec<SmoothedNavigation>, bool)>, ConfigError> {
        let config = self.strapdown.config;
        let aids = Aids {
            config,
            noise_scales: self.noise_scales,
        };
        let (slow, slow_variance) = self.slow_errors();
        let mut covariance = self.prior.1;
        for i in 0..3 {
            let state = STATES + GNSS_OFFSET + i;
            covariance[(state, state)] = slow_variance[i];
        }
        let linearization = Linearization {
            strapdown: self.strapdown,
            aids: &aids,
            times_ns: &self.times_ns,
            states: &self.states,
            attached: &self.attached,
            slow: &slow,
            prior: (self.prior.0.minus(&self.states[0]), covariance),
        };
        let Some(forward) = linearization.forward()? else {
            return Ok(None);
        };
        let mut smoothed = Vec::with_capacity(self.states.len());
        let mut errors = Vec::with_capacity(self.states.len());
        let mut largest = 0.0_f64;
        let squares = linearization.backward(forward, |node| {
            let time_ns = self.times_ns[node.node];
            let frame = self.strapdown.segment.frame;
            let (said, sigmas) = in_words(time_ns, frame, &self.states[node.node], node);
            largest = largest.max(sigmas);
            smoothed.push(said);
            errors.push(node.error);
        });
        if !largest.is_finite() {
            return Ok(None);
        }
        smoothed.reverse();
        errors.reverse();
        self.correct(&errors);
        let settled = self.weigh(&squares) && largest < SETTLED_SIGMAS;
        self.note_fixes(&mut smoothed);
        Ok(Some((smoothed, settled)))
    }

    /// Moves every state, as far as that is linear.
    fn correct(&mut self, errors: &[Errors]) {
        let turns = errors.iter().map(|x| x.fixed_rows::<3>(ATTITUDE).norm());
        let share = (LARGEST_TURN / turns.fold(LARGEST_TURN, f64::max)).min(1.0);
        for (state, error) in self.states.iter_mut().zip(errors) {
            *state = state.corrected(&(error * share));
        }
    }

    /// How the receiver's correlated error goes on to each next node (E43), and its variance at the first: held to what the
    /// receiver states, and begun anew where that falls by half.
    fn slow_errors(&self) -> (Vec<SlowError>, Vector3<f64>) {
        let c = self.strapdown.config;
        let mut fixes = self.attached.iter().filter_map(|one| {
            let Measured::Position(fix, shares, Part::Horizontal) = &one.measurement.measured
            else {
                return None;
            };
            let [flat, high, _] = self.noise_scales.map(|s| s.max(1.0) * shares.slow);
            let std = floored(fix, c).component_mul(&Vector3::new(flat, flat, high));
            Some((one.node, std.component_mul(&std)))
        });
        let mut next = fixes.next();
        let first = next.map_or_else(Vector3::zeros, |(_, variance)| variance);
        let mut variance = first;
        let steps = self.times_ns.windows(2).enumerate().map(|(k, pair)| {
            let duration = seconds_between(pair[0], pair[1]);
            let kept = (-duration / c.position_correlation_time_s).exp();
            let mut slow = SlowError {
                kept: Vector3::repeat(kept),
                added: variance * (1.0 - kept * kept),
            };
            while let Some((node, stated)) = next.filter(|(node, _)| *node <= k + 1) {
                for i in 0..3 {
                    if node < k + 1 {
                    } else if stated[i] < variance[i] * 0.25 {
                        slow.kept[i] = 0.0;
                        slow.added[i] = stated[i];
                    } else {
                        slow.added[i] += (stated[i] - variance[i]).max(0.0);
                    }
                }
                variance = stated;
                next = fixes.next();
            }
            slow
        });
        (steps.collect(), first)
    }

    /// Weighs every measurement by what its noise turned out to be (E48), and scales the receiver's (E49). Whether neither has
    /// changed.
    fn weigh(&mut self, squares: &[(f64, u8)]) -> bool {
        let c = self.strapdown.config;
        let mut settled = true;
        let mut sums = [(0.0, 0.0); 3];
        for (one, (square, count)) in self.attached.iter_mut().zip(squares) {
            let measured = &one.measurement.measured;
            let is_prior = matches!(measured, Measured::Damping(_));
            if *count == 0 || is_prior {
                continue;
            }
            let robust = robust_weight(*square, usize::from(*count)).max(SMALLEST_WEIGHT);
            let weight = if c.robust_weights { robust } else { 1.0 };
            settled &= (weight - one.weight).abs() < SETTLED_WEIGHT;
            one.weight = weight;
            if let Some((sum, n)) = measured.noise_scale().and_then(|i| sums.get_mut(i)) {
                *sum += weight * square;
                *n += f64::from(*count);
            }
        }
        for (scale, (sum, n)) in self.noise_scales.iter_mut().zip(sums) {
            if n > 0.0 {
                let before = *scale;
                let next = before * (sum / n).sqrt();
                *scale = next.clamp(c.least_noise_scale, c.largest_noise_scale);
                settled &= (*scale / before).ln().abs() < SETTLED_SCALE;
            }
        }
        settled
    }

    /// Tells each node how far the nearest fix is that was not rejected.
    fn note_fixes(&self, nodes: &mut [SmoothedNavigation]) {
        let fixes = self.positions().filter(|one| one.weight >= LEAST_WEIGHT);
        let fixes: Vec<i64> = fixes.map(|one| one.measurement.time_ns).collect();
        for node in nodes {
            let next = fixes.partition_point(|fix| *fix < node.time_ns);
            let around = [next.checked_sub(1), Some(next)].into_iter().flatten();
            let around = around.filter_map(|i| fixes.get(i));
            let nearest = around.map(|fix| fix.abs_diff(node.time_ns)).min();
            node.since_fix_s = nearest.map(|ns| ns as f64 * 1e-9);
        }
    }

    fn positions(&self) -> impl Iterator<Item = &Attached> {
        let flat = |one: &&Attached| {
            matches!(
                one.measurement.measured,
                Measured::Position(_, _, Part::Horizontal)
            )
        };
        self.attached.iter().filter(flat)
    }

    fn summary(&self) -> SmoothingSummary {
        let last = self.states.last().unwrap_or(&self.prior.0);
        let down_weighted = self.positions().filter(|one| one.weight < 1.0);
        SmoothingSummary {
            iterations: 0,
            converged: false,
            batches: 1,
            fixes: self.positions().count() as u64,
            fixes_down_weighted: down_weighted.count() as u64,
            noise_scales: self.noise_scales,
            time_offset_s: last.side[TIME_OFFSET],
            lever_arm_m: last.lever_arm.into(),
        }
    }
}

/// What a pass says about a node whose state was `before`, and by how many standard deviations it moves it at most.
fn in_words(
    time_ns: i64,
    frame: LocalFrame,
    before: &State,
    node: &Smoothed<'_>,
) -> (SmoothedNavigation, f64) {
    let state = before.corrected(&node.error);
    let rows = SMatrix::<f64, STATES, ALL>::identity();
    let covariance = node.covariance_of(&rows);
    let mut sigmas = 0.0_f64;
    for i in 0..STATES {
        let std = covariance[(i, i)].max(f64::MIN_POSITIVE).sqrt();
        sigmas = sigmas.max(node.error[i].abs() / std);
    }
    let (antenna, rows) = antenna(&state);
    let said = SmoothedNavigation {
        time_ns,
        frame,
        position: state.position,
        velocity: state.velocity,
        ned_from_body: state.ned_from_body,
        angular_rate: node.angular_rate,
        accelerometer_bias: state.accelerometer_bias,
        gyroscope_bias: state.gyroscope_bias,
        lever_arm: state.lever_arm,
        antenna,
        antenna_covariance: node.covariance_of(&rows),
        covariance,
        since_fix_s: None,
    };
    (said, sigmas)
}

/// The antenna as its receiver dates it, and the rows that make its error (E39).
fn antenna(state: &State) -> (Vector3<f64>, SMatrix<f64, 3, ALL>) {
    let late = state.side[TIME_OFFSET];
    let axes = state.ned_from_body.to_rotation_matrix().into_inner();
    let arm = axes * state.lever_arm;
    let mut rows = SMatrix::<f64, 3, ALL>::zeros();
    let blocks = [
        (ATTITUDE, -so3::skew(&arm)),
        (VELOCITY, Matrix3::from_diagonal_element(-late)),
        (POSITION, Matrix3::identity()),
        (LEVER_ARM, axes),
    ];
    for (first, block) in blocks {
        rows.fixed_view_mut::<3, 3>(0, first).copy_from(&block);
    }
    rows.set_column(STATES + TIME_OFFSET, &-state.velocity);
    (state.position + arm - state.velocity * late, rows)
}
