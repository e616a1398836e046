//! Where the nodes of the batch smoother stand, and which measurements belong to them.

use northing_core::navigation::gnss_ins::GAP_LIMIT_S;

use super::pass::Attached;
use super::recorder::{Measured, Measurement, Segment};
use crate::statistics::seconds_between;

/// Nodes are at most so far apart, ns.
const NODE_EVERY_NS: i64 = 100_000_000;

/// Times of the nodes, and the measurements at them: one at each position and velocity, at the ends of gaps, and at least every
/// tenth of a second, from the first position to the last sample.
pub(super) fn nodes(segment: &Segment) -> (Vec<i64>, Vec<Attached>) {
    let (Some(first), Some(last)) = (segment.samples.first(), segment.samples.last()) else {
        return (Vec::new(), Vec::new());
    };
    let within = |m: &&Measurement| (first.time_ns..=last.time_ns).contains(&m.time_ns);
    let mut measurements: Vec<Measurement> = segment
        .measurements
        .iter()
        .filter(within)
        .copied()
        .collect();
    measurements.sort_by_key(|m| m.time_ns);
    let is_position = |m: &&Measurement| matches!(m.measured, Measured::Position(..));
    let Some(begin_ns) = measurements.iter().find(is_position).map(|m| m.time_ns) else {
        return (Vec::new(), Vec::new());
    };
    measurements.retain(|m| m.time_ns >= begin_ns);
    let of_receiver =
        |m: &&Measurement| matches!(m.measured, Measured::Position(..) | Measured::Velocity(_));
    let fixes = measurements.iter().filter(of_receiver).map(|m| m.time_ns);
    let gaps = segment.samples.windows(2).filter_map(|pair| match pair {
        [a, b] => {
            let is_gap = seconds_between(a.time_ns, b.time_ns) > GAP_LIMIT_S;
            is_gap.then_some([a.time_ns, b.time_ns])
        }
        _ => None,
    });
    let mut marks: Vec<i64> = fixes.chain(gaps.flatten()).chain([last.time_ns]).collect();
    marks.retain(|mark| *mark >= begin_ns);
    marks.sort_unstable();
    let mut times_ns = vec![begin_ns];
    let mut at = begin_ns;
    for mark in marks {
        while at < mark {
            at = mark.min(at.saturating_add(NODE_EVERY_NS));
            times_ns.push(at);
        }
    }
    let attach = |measurement: Measurement| {
        let node = times_ns.partition_point(|time| *time < measurement.time_ns);
        let age_s = seconds_between(measurement.time_ns, *times_ns.get(node)?);
        Some(Attached {
            node,
            age_s,
            measurement,
            weight: measurement.weight,
        })
    };
    let attached = measurements.into_iter().filter_map(attach).collect();
    (times_ns, attached)
}
