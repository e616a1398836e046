//! Statistics of errors and innovations: what every kind of estimator is judged by.
//!
//! | I look for | file |
//! |---|---|
//! | error metrics and NEES of an attitude | [`metrics`] |
//! | faults that were found in the samples | [`faults`] |
//! | whether a receiver says that it moves | [`ground_motion`] |
//! | tilt, heading and body-axis standard deviations of an attitude | [`attitude_std`] |
//! | heading errors without their constant part | [`heading_errors`] |
//! | NIS, counts of updates, quantiles of chi-square | [`nis`] |
//! | "your accelerometer R is about 9 times too small" | [`consistency`] |
//! | the same of the last seconds: the lamp of a sensor | [`lamp`] |
//! | one step back of RTS smoothing, whatever the states | `rts_step.rs` |
//! | a series of bounded length for plots | [`thinned`] |
//! | the causes of a wrong verdict: holes, rounding, saturation, disturbance | [`verdict`] |

pub mod attitude_std;
pub mod consistency;
pub mod faults;
pub mod ground_motion;
pub mod heading_errors;
pub mod lamp;
pub mod metrics;
pub mod nis;
pub(crate) mod rts_step;
pub mod thinned;
pub mod verdict;

/// Seconds from one stamp to another.
pub(crate) fn seconds_between(from_ns: i64, to_ns: i64) -> f64 {
    to_ns.saturating_sub(from_ns) as f64 * 1e-9
}

/// Median of sorted values; `None` without any.
#[must_use]
pub fn median(sorted: &[f64]) -> Option<f64> {
    let half = sorted.len() / 2;
    let upper = *sorted.get(half)?;
    let odd = !sorted.len().is_multiple_of(2);
    Some(if odd {
        upper
    } else {
        0.5 * (sorted[half - 1] + upper)
    })
}
