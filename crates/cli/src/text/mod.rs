//! Outcomes as text for people.

#[cfg(feature = "ros")]
pub(crate) mod advice;
pub(crate) mod attitude;
pub(crate) mod exercise;
pub(crate) mod navigation;
pub(crate) mod rest_calibration;
pub(crate) mod sheet;
pub(crate) mod table;

use std::fmt::Write as _;

use northing_core::kalman::SkipReason;
use northing_evaluation::statistics::nis::UpdateCounts;

/// How many samples were used and how many not, and why not. What is accumulated takes effect later.
fn used(counts: &UpdateCounts) -> String {
    let of = |reason: SkipReason| counts.skipped_because.get(reason.description());
    let accumulated = of(SkipReason::Accumulated).copied().unwrap_or_default();
    let mut text = format!("{} fused, {} gated, ", counts.fused, counts.gated);
    if accumulated > 0 {
        let _ = write!(text, "{accumulated} accumulated for a later update, ");
    }
    let _ = write!(text, "{} skipped.", counts.skipped - accumulated);
    // What is skipped before the start needs no word; anything else does.
    let unsaid = [SkipReason::Accumulated, SkipReason::NotInitialized].map(SkipReason::description);
    for (reason, count) in &counts.skipped_because {
        if !unsaid.contains(reason) {
            let _ = write!(text, " {count} of them: {reason}.");
        }
    }
    text
}
