//! Probabilistic data association: one target, several detections, and the update with all of them.
//!
//! Read first: Bar-Shalom, Daum, Huang, *The Probabilistic Data Association Filter*, IEEE Control
//! Systems Magazine 29 (2009); `docs/derivations/association.md`, section 3.
//!
//! The detections in the gate are weighed, the state moves by the weighted residual, and the
//! covariance grows by the spread of what the detections would have done. The own ship's estimate
//! is never moved (Schmidt), so its cross-covariance has no spread term: (P4).

use crate::kalman::covariance::symmetrize;
use crate::scalar::Scalar;
use crate::tracking::coordinated_turn::{TargetCovariance, TargetState};
use crate::tracking::detection::{CrossCovariance, SchmidtInnovation};
use crate::tracking::echo::EchoCovariance;
use crate::tracking::imm::Mode;

/// Weights of one target without competitors: the probability of no detection, then of each. `ratios`
/// are likelihood over clutter density; `results` takes one probability each.
///
/// `existence` is that of the target, `detection_probability` includes the gate (P1).
pub fn weights<T: Scalar>(
    detection_probability: T,
    existence: T,
    ratios: &[T],
    results: &mut [T],
) -> T {
    let caused = detection_probability * existence;
    let missed = T::one() - caused;
    let sum = ratios.iter().fold(missed, |s, l| s + caused * *l);
    for (result, ratio) in results.iter_mut().zip(ratios) {
        *result = caused * *ratio / sum;
    }
    missed / sum
}

/// The update of one motion model with all detections of a scan, gathered one at a time.
#[derive(Debug, Clone, Copy)]
pub struct PdaUpdate<T> {
    shift: TargetState<T>,
    /// Sum of `beta (K nu)(K nu)'`.
    spread: TargetCovariance<T>,
    /// Sum of `beta K S K'`.
    shrink: TargetCovariance<T>,
    /// Sum of `beta K o'`.
    cross: CrossCovariance<T>,
    /// The same of the echo's place.
    echo: EchoCovariance<T>,
}

impl<T: Scalar> Default for PdaUpdate<T> {
    fn default() -> Self {
        Self {
            shift: TargetState::zeros(),
            spread: TargetCovariance::zeros(),
            shrink: TargetCovariance::zeros(),
            cross: CrossCovariance::zeros(),
            echo: EchoCovariance::zeros(),
        }
    }
}

impl<T: Scalar> PdaUpdate<T> {
    /// Adds one detection with its probability of having come from this target.
    pub fn add(&mut self, probability: T, innovation: &SchmidtInnovation<T>) {
        let k = &innovation.gain;
        let step = k * innovation.residual;
        self.shift += step * probability;
        self.spread += step * step.transpose() * probability;
        self.shrink += k * innovation.covariance * k.transpose() * probability;
        self.cross += k * innovation.pose_covariance.transpose() * probability;
        if let Some(echo) = &innovation.echo_covariance {
            self.echo += k * echo.transpose() * probability;
        }
    }

    /// Moves the belief (P2, P3, P4). `total` is what the probabilities of all detections and of none
    /// sum to: one, or under several motion models the new probability of this one.
    pub fn apply(&self, mode: &mut Mode<T>, total: T) {
        if total <= T::zero() {
            return;
        }
        let scale = T::one() / total;
        let shift = self.shift * scale;
        mode.state += shift;
        mode.covariance += (self.spread - self.shrink) * scale - shift * shift.transpose();
        symmetrize(&mut mode.covariance);
        mode.cross -= self.cross * scale;
        mode.echo -= self.echo * scale;
        mode.hold();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tracking::coordinated_turn::STATES;
    use crate::tracking::detection::{Detection, DetectionNoise};
    use crate::tracking::own_ship::OwnShip;
    use approx::assert_relative_eq;
    use nalgebra::SMatrix;

    #[test]
    fn weights_of_a_certain_target_are_those_of_the_textbook() {
        // beta_i = e_i / (b + sum e), e_i = l_i, b = lambda (1 - P_D) / P_D, in units of lambda
        let (pd, ratios) = (0.8, [3.0, 0.5]);
        let b = 0.2 / 0.8;
        let mut results = [0.0; 2];
        let missed = weights(pd, 1.0, &ratios, &mut results);
        let sum = b + 3.5;
        assert_relative_eq!(missed, b / sum, epsilon = 1e-12);
        assert_relative_eq!(results[0], 3.0 / sum, epsilon = 1e-12);
        assert_relative_eq!(results[1], 0.5 / sum, epsilon = 1e-12);
    }

    fn joint() -> SMatrix<f64, 8, 8> {
        let a = SMatrix::<f64, 8, 8>::from_fn(|i, j| {
            0.2 * ((3 * i + 5 * j) as f64).cos() + if i == j { 2.0 } else { 0.0 }
        });
        a * a.transpose()
    }

    fn mode() -> Mode<f64> {
        let joint = joint();
        Mode {
            probability: 1.0,
            state: TargetState::from([60.0, 1.0, 80.0, 0.0, 0.0]),
            covariance: joint.fixed_view::<STATES, STATES>(0, 0).into_owned(),
            cross: joint.fixed_view::<STATES, 3>(0, 5).into_owned(),
            echo: EchoCovariance::zeros(),
        }
    }

    fn seen(mode: &Mode<f64>, range_m: f64) -> SchmidtInnovation<f64> {
        let own = OwnShip {
            covariance: joint().fixed_view::<3, 3>(5, 5).into_owned(),
            ..OwnShip::exact(0.0, 0.0, 0.0)
        };
        let noise = DetectionNoise {
            range_std_m: 4.0,
            bearing_std_rad: 0.02,
            extent_std_m: 0.0,
        };
        Detection::RangeBearing {
            range_m,
            bearing_rad: 0.9,
        }
        .predict(&mode.state, &own, &noise)
        .unwrap()
        .weigh(&mode.covariance, &mode.cross, &own)
        .unwrap()
    }

    #[test]
    fn one_certain_detection_is_the_schmidt_update() {
        let before = mode();
        let i = seen(&before, 103.0);
        let mut after = before;
        let mut update = PdaUpdate::default();
        update.add(1.0, &i);
        update.apply(&mut after, 1.0);
        assert_relative_eq!(
            after.state,
            before.state + i.gain * i.residual,
            epsilon = 1e-12
        );
        let p = before.covariance - i.gain * i.covariance * i.gain.transpose();
        assert_relative_eq!(after.covariance, p, epsilon = 1e-9);
        let x = before.cross - i.gain * i.pose_covariance.transpose();
        assert_relative_eq!(after.cross, x, epsilon = 1e-9);
    }

    #[test]
    fn the_update_has_the_moments_of_the_mixture() {
        let before = mode();
        let (a, b) = (seen(&before, 95.0), seen(&before, 108.0));
        let (missed, pa, pb) = (0.2, 0.5, 0.3);
        let mut after = before;
        let mut update = PdaUpdate::default();
        update.add(pa, &a);
        update.add(pb, &b);
        update.apply(&mut after, 1.0);
        let (da, db) = (a.gain * a.residual, b.gain * b.residual);
        let mean = da * pa + db * pb;
        let posterior = |i: &SchmidtInnovation<f64>| {
            before.covariance - i.gain * i.covariance * i.gain.transpose()
        };
        let moment = before.covariance * missed
            + (posterior(&a) + da * da.transpose()) * pa
            + (posterior(&b) + db * db.transpose()) * pb
            - mean * mean.transpose();
        assert_relative_eq!(after.state, before.state + mean, epsilon = 1e-12);
        assert_relative_eq!(after.covariance, moment, epsilon = 1e-9);
    }

    #[test]
    fn no_detection_leaves_the_belief() {
        let mut after = mode();
        PdaUpdate::default().apply(&mut after, 0.7);
        assert_eq!(after, mode());
        PdaUpdate::default().apply(&mut after, 0.0);
        assert_eq!(after, mode());
    }
}
