//! Association gate: an ellipse of the Schmidt innovation covariance, so that an uncertain own ship widens it.
//!
//! Equations: `docs/derivations/association.md`, section 3.

use crate::scalar::{Scalar, lit};

/// Limit of a normalised innovation squared, stated as standard deviations of one component.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AssociationGate<T> {
    /// Radius of the ellipse, in standard deviations.
    pub sigmas: T,
}

impl<T: Scalar> AssociationGate<T> {
    /// Whether a normalised innovation squared lies inside.
    pub fn contains(&self, nis: T) -> bool {
        nis <= self.sigmas * self.sigmas
    }

    /// Probability that the target's own detection lies inside (G1): `1 - exp(-g^2/2)` for two
    /// components, `erf(g / sqrt(2))` for one.
    pub fn probability(&self, degrees_of_freedom: u8) -> T {
        let half = self.sigmas * self.sigmas * lit(0.5);
        if degrees_of_freedom == 2 {
            T::one() - (-half).exp()
        } else {
            error_function(half.sqrt())
        }
    }
}

/// `erf` for positive arguments; Abramowitz and Stegun 7.1.26, error below 1.5e-7.
fn error_function<T: Scalar>(x: T) -> T {
    let t = T::one() / (T::one() + lit::<T>(0.327_591_1) * x);
    let tail = crate::scalar::polynomial(
        t,
        [
            0.0,
            0.254_829_592,
            -0.284_496_736,
            1.421_413_741,
            -1.453_152_027,
            1.061_405_429,
        ],
    );
    T::one() - tail * (-x * x).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn probabilities_are_those_of_the_chi_square_tables() {
        // chi-square 95 % quantiles: 5.991465 (2), 3.841459 (1)
        let two = AssociationGate {
            sigmas: 5.991_465_f64.sqrt(),
        };
        let one = AssociationGate {
            sigmas: 3.841_459_f64.sqrt(),
        };
        assert!((two.probability(2) - 0.95).abs() < 1e-6);
        assert!((one.probability(1) - 0.95).abs() < 1e-6);
        assert!(two.contains(5.99) && !two.contains(6.0));
    }
}
