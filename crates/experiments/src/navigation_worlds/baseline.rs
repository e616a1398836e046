//! Baselines without inertial sensors: the last fix held, and the last fix moved on with a velocity.

use nalgebra::Vector2;
use northing_simulation::navigation_world::{FaultKind, WorldFix};

/// Fixes that are differenced lie at least so far apart, s: the noise of faster ones would be all that there is.
const LEAST_DIFFERENCE_S: f64 = 1.0;

/// What can be said from the last fixes alone.
#[derive(Debug, Clone, Default)]
pub struct Baseline {
    /// Stamp (s), horizontal position and velocity of the fixes of the last seconds, the newest at the end.
    recent: Vec<(f64, Vector2<f64>, Option<Vector2<f64>>)>,
}

impl Baseline {
    /// Takes a fix; outliers and stale ones are left out.
    pub fn take(&mut self, fix: &WorldFix) {
        if matches!(fix.fault, Some(FaultKind::Outlier | FaultKind::Stale)) {
            return;
        }
        let stamp = fix.stamp_ns as f64 * 1e-9;
        let velocity = fix.velocity.map(|[velocity, _]| velocity.xy());
        self.recent.push((stamp, fix.position[0].xy(), velocity));
        // Only the newest that is far enough behind, and what came after it.
        let far = self
            .recent
            .iter()
            .rposition(|(t, ..)| stamp - t >= LEAST_DIFFERENCE_S);
        self.recent.drain(..far.unwrap_or(0));
    }

    /// How old the last fix is, s.
    #[must_use]
    pub fn age_s(&self, time_s: f64) -> Option<f64> {
        self.recent.last().map(|(stamp, ..)| time_s - stamp)
    }

    /// The last fix.
    #[must_use]
    pub fn held(&self) -> Option<Vector2<f64>> {
        self.recent.last().map(|(_, position, _)| *position)
    }

    /// The last fix, moved on to `time_s` with the receiver's velocity, or with the difference to the fix a second or more
    /// before; before there is one, held.
    #[must_use]
    pub fn extrapolated(&self, time_s: f64) -> Option<Vector2<f64>> {
        let (stamp, position, measured) = self.recent.last()?;
        let differenced = || {
            let (before, from, _) = self.recent.first()?;
            let over = stamp - before;
            (over >= LEAST_DIFFERENCE_S - 1e-6).then(|| (position - from) / over)
        };
        let velocity = measured.or_else(differenced).unwrap_or_else(Vector2::zeros);
        Some(position + velocity * (time_s - stamp))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn fix(time_s: f64, north: f64, velocity: Option<f64>) -> WorldFix {
        WorldFix {
            time_s,
            stamp_ns: (time_s * 1e9) as i64,
            position: [Vector3::new(north, 1.0, -3.0), Vector3::repeat(1.0)],
            velocity: velocity.map(|v| [Vector3::new(v, 0.0, 9.0), Vector3::repeat(0.1)]),
            fault: None,
        }
    }

    #[test]
    fn it_moves_on_with_the_receivers_velocity_or_with_a_difference_over_a_second() {
        let mut baseline = Baseline::default();
        assert!(baseline.held().is_none() && baseline.extrapolated(1.0).is_none());
        baseline.take(&fix(1.0, 10.0, Some(2.0)));
        assert_eq!(baseline.held(), Some(Vector2::new(10.0, 1.0)));
        assert!((baseline.extrapolated(1.5).unwrap().x - 11.0).abs() < 1e-9);

        let mut baseline = Baseline::default();
        for k in 0..11_u32 {
            // Every 0.2 s, 3 m/s.
            let t = f64::from(k) * 0.2;
            baseline.take(&fix(t, 3.0 * t, None));
            let expected = if k < 5 { 3.0 * t } else { 3.0 * (t + 0.1) };
            let north = baseline.extrapolated(t + 0.1).unwrap().x;
            assert!((north - expected).abs() < 1e-6, "{k}: {north} {expected}");
        }
        assert!(baseline.recent.len() < 8, "bounded memory");
    }

    #[test]
    fn it_is_not_given_outliers() {
        let mut baseline = Baseline::default();
        baseline.take(&fix(1.0, 10.0, None));
        let far = WorldFix {
            fault: Some(FaultKind::Outlier),
            ..fix(2.0, 1e6, None)
        };
        baseline.take(&far);
        assert_eq!(baseline.held(), Some(Vector2::new(10.0, 1.0)));
    }
}
