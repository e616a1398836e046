//! Heights of fixes against the receiver's own velocity down: up for down is refused, anything else that is apart is told.

use super::Verdict;
use super::position::implausible;
use crate::issues::Issues;

/// Compares heights with the velocity down, over climbs and descents of some metres.
#[derive(Debug, Clone, Default)]
pub(super) struct VerticalCheck {
    /// Height at the start of a stretch, m, and how far the velocity has gone down since.
    stretch: Option<[f64; 2]>,
    stretches: u32,
    /// Sums of the squared relative errors: as the numbers are, and with up for down.
    errors: [f64; 2],
    /// How far the heights, and the velocity, went up in all stretches, m.
    up_m: [f64; 2],
}

impl VerticalCheck {
    /// A comparison is made when the velocity has gone up or down so far, m.
    const LEAST_CLIMB_M: f64 = 10.0;
    /// Evidence, as for the way over ground.
    const STRETCHES: u32 = 5;
    const WRONG: f64 = 0.25;
    const RIGHT: f64 = 0.04;
    /// Noise of heights of so many metres is common, and makes stretches of its own.
    const NOISE_M: f64 = 20.0;

    /// Fixes of two instants `dt` apart, and the velocity between them.
    pub(super) fn compare(&mut self, heights: [Option<f64>; 2], dt: f64, down: Option<f64>) {
        let ([Some(before), Some(now)], Some(down)) = (heights, down) else {
            self.pause();
            return;
        };
        let [start, gone] = self.stretch.get_or_insert([before, 0.0]);
        *gone += down * dt;
        let (climbed, up) = (now - *start, -*gone);
        if up.abs() < Self::LEAST_CLIMB_M {
            return;
        }
        self.stretch = None;
        self.stretches += 1;
        self.up_m[0] += climbed;
        self.up_m[1] += up;
        for (error, up) in self.errors.iter_mut().zip([up, -up]) {
            // One jump shall not outweigh everything.
            *error += ((climbed - up) / up).abs().min(2.0).powi(2);
        }
    }

    /// Nothing is compared over a pause.
    pub(super) fn pause(&mut self) {
        self.stretch = None;
    }

    fn is_apart(&self) -> bool {
        self.stretches >= Self::STRETCHES
            && self.errors[0] >= Self::WRONG * f64::from(self.stretches)
    }

    /// # Errors
    /// [`RecordingError::ImplausibleUnit`](crate::RecordingError::ImplausibleUnit) where up for down is clearly right.
    pub(super) fn judge(&self) -> Verdict {
        let stretches = self.stretches;
        if !self.is_apart() || self.errors[1] >= Self::RIGHT * f64::from(stretches) {
            return Ok(());
        }
        implausible(
            format!(
                "over {stretches} climbs and descents the heights go down where the receiver's own velocity goes up; the velocity \
                 down looks as if up were positive"
            ),
            "if so, say axes = \"neu\" or \"enu\" of `gnss_velocity` in a manifest, or turn the sign of the column",
        )
    }

    /// Says how far heights and velocity went, if that is not the same.
    pub(super) fn tell(&self, issues: &mut Issues) {
        let [heights, velocity] = self.up_m;
        let apart_m = (heights - velocity).abs();
        if self.is_apart() && apart_m > Self::NOISE_M + 0.5 * heights.abs() {
            issues.notes.push(format!(
                "The receiver's velocity goes {} where its heights go {}, over {} stretches together: at least one of the two is \
                 off, and an estimate of the height that uses both may be.",
                way_up(velocity),
                way_up(heights),
                self.stretches,
            ));
        }
    }
}

/// `12 m up`.
fn way_up(metres: f64) -> String {
    let way = if metres < 0.0 { "down" } else { "up" };
    format!("{:.0} m {way}", metres.abs())
}
