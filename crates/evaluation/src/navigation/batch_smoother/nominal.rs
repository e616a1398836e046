//! The first trajectory of the batch smoother, from the filter's states: the attitude of where the heading was known, carried
//! back by the gyroscope to where it was not.

use nalgebra::{UnitQuaternion, Vector3};
use northing_core::ConfigError;

use super::motion::{History, SlowError, Strapdown};
use super::recorder::Segment;
use super::state::State;
use crate::statistics::seconds_between;

/// A heading is known from this standard deviation on, rad.
const KNOWN_HEADING_STD: f64 = 0.15;
/// Before a realignment the filter's heading is not taken for so long, s.
const DOUBTED_BEFORE_S: f64 = 30.0;

/// The first trajectory, and at which nodes the filter's weights of fixes are a first guess.
pub(super) struct Nominal {
    pub(super) states: Vec<State>,
    pub(super) is_known: Vec<bool>,
}

/// A trajectory through `times_ns`; `None` where the filter never had a state.
pub(super) fn nominal(
    strapdown: &Strapdown<'_>,
    times_ns: &[i64],
) -> Result<Option<Nominal>, ConfigError> {
    let states = filter_states(strapdown.segment);
    let Some(last) = states.last() else {
        return Ok(None);
    };
    let constant = last.state;
    let mut walk = Walk {
        strapdown,
        states: &states,
        next: 0,
    };
    let mut nominal = Nominal {
        states: Vec::with_capacity(times_ns.len()),
        is_known: Vec::with_capacity(times_ns.len()),
    };
    let mut before = None;
    for time_ns in times_ns {
        let (mut state, is_known) = walk.at(*time_ns, before)?;
        // Constants, as well as the filter knew them at the end.
        state.side = constant.side;
        state.side.fixed_rows_mut::<3>(0).fill(0.0);
        state.lever_arm = Vector3::from(strapdown.config.lever_arm_m);
        before = Some((*time_ns, state, is_known));
        nominal.states.push(state);
        nominal.is_known.push(is_known);
    }
    nominal.carry_back(strapdown, times_ns)?;
    Ok(Some(nominal))
}

/// A state of the filter, and whether its heading is taken.
struct Known {
    time_ns: i64,
    state: State,
    is_known: bool,
}

fn filter_states(segment: &Segment) -> Vec<Known> {
    let pairs = segment.causal.windows(2);
    let realigned = pairs.filter_map(|pair| match pair {
        [a, b] => (a.realignments != b.realignments).then_some(b.time_ns),
        _ => None,
    });
    let realigned: Vec<i64> = realigned.collect();
    let is_doubted = |time_ns: i64| {
        let next = realigned.partition_point(|at| *at <= time_ns);
        let next = realigned.get(next);
        next.is_some_and(|next| seconds_between(time_ns, *next) < DOUBTED_BEFORE_S)
    };
    let stds = segment.causal.iter().filter_map(|kept| Some(kept.state?.1));
    let threshold = stds.fold(f64::INFINITY, f64::min).max(KNOWN_HEADING_STD);
    let known = segment.causal.iter().filter_map(|kept| {
        let (state, std) = kept.state?;
        Some(Known {
            time_ns: kept.time_ns,
            state,
            is_known: std <= threshold && !is_doubted(kept.time_ns),
        })
    });
    known.collect()
}

/// The filter's states along the nodes.
struct Walk<'a> {
    strapdown: &'a Strapdown<'a>,
    states: &'a [Known],
    next: usize,
}

impl Walk<'_> {
    /// The newest state of the filter, or the node before where there is no newer one, moved on to `time_ns`.
    fn at(
        &mut self,
        time_ns: i64,
        before: Option<(i64, State, bool)>,
    ) -> Result<(State, bool), ConfigError> {
        let mut from = before;
        while let Some(known) = self.states.get(self.next).filter(|k| k.time_ns <= time_ns) {
            from = Some((known.time_ns, known.state, known.is_known));
            self.next += 1;
        }
        let Some((from_ns, state, is_known)) = from else {
            // Before the filter's first state: that one, moved back with its velocity.
            let first = &self.states[0];
            let mut state = first.state;
            state.position -= state.velocity * seconds_between(time_ns, first.time_ns);
            return Ok((state, false));
        };
        let state = moved(self.strapdown, &state, [from_ns, time_ns])?;
        Ok((state, is_known))
    }
}

fn moved(
    strapdown: &Strapdown<'_>,
    state: &State,
    span_ns: [i64; 2],
) -> Result<State, ConfigError> {
    let slow = SlowError {
        kept: Vector3::repeat(1.0),
        added: Vector3::zeros(),
    };
    let motion = strapdown.advance(state, span_ns, &slow, &mut History::default())?;
    let biases = (state.accelerometer_bias, state.gyroscope_bias);
    Ok(State {
        accelerometer_bias: biases.0,
        gyroscope_bias: biases.1,
        ..motion.end
    })
}

impl Nominal {
    /// Where the heading was not known, the attitude of where it was next, or last, carried there by the gyroscope.
    fn carry_back(
        &mut self,
        strapdown: &Strapdown<'_>,
        times_ns: &[i64],
    ) -> Result<(), ConfigError> {
        let count = self.states.len();
        let mut reached = self.is_known.clone();
        for k in (1..count).rev() {
            if reached[k] && !reached[k - 1] {
                self.carry(strapdown, times_ns, [k, k - 1])?;
                reached[k - 1] = true;
            }
        }
        for k in 1..count {
            if reached[k - 1] && !reached[k] {
                self.carry(strapdown, times_ns, [k - 1, k])?;
                reached[k] = true;
            }
        }
        Ok(())
    }

    /// Attitude and biases of one node to the one beside it.
    fn carry(
        &mut self,
        strapdown: &Strapdown<'_>,
        times_ns: &[i64],
        [from, to]: [usize; 2],
    ) -> Result<(), ConfigError> {
        let known = self.states[from];
        let still = State {
            ned_from_body: UnitQuaternion::identity(),
            ..known
        };
        let span_ns = [times_ns[from.min(to)], times_ns[from.max(to)]];
        let turned = moved(strapdown, &still, span_ns)?.ned_from_body;
        let turned = if from < to { turned } else { turned.inverse() };
        let state = &mut self.states[to];
        state.ned_from_body = known.ned_from_body * turned;
        state.accelerometer_bias = known.accelerometer_bias;
        state.gyroscope_bias = known.gyroscope_bias;
        state.bias_at_rest = known.bias_at_rest;
        Ok(())
    }
}
