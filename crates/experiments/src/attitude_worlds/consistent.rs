//! What an estimator would have that is consistent to the letter: how often its coverage over one world lies in the band.
//!
//! Its normalised errors are first-order Gauss-Markov processes of unit variance, sampled as those of the worlds are. The
//! shorter a world is beside the time over which its errors last, the less a coverage over it says.

use std::collections::BTreeMap;

use northing_simulation::random::{standard_normal, stream};

use crate::scoring::{EVERY_S, is_consistent};

/// Worlds that are made for one share.
const WORLDS: usize = 500;
/// Errors that last longer are constant, s.
const LONGEST_S: f64 = 1e4;

/// Shares that have been computed: degrees of freedom, instants, grade of correlation.
#[derive(Debug, Default)]
pub struct ConsistentShares(BTreeMap<(u8, usize, i32), f64>);

impl ConsistentShares {
    /// The share of worlds of so many instants with coverage in the band, for errors of this correlation time.
    pub fn share(&mut self, freedom: u8, instants: usize, correlation_time_s: f64) -> f64 {
        // Half octaves and fifties of instants: finer says nothing more.
        let grade = (2.0 * correlation_time_s.clamp(0.01, LONGEST_S).log2()).round() as i32;
        let instants = (instants.max(50) + 25) / 50 * 50;
        let share = || computed(freedom, instants, 2.0_f64.powf(0.5 * f64::from(grade)));
        *self
            .0
            .entry((freedom, instants, grade))
            .or_insert_with(share)
    }
}

fn computed(freedom: u8, instants: usize, correlation_time_s: f64) -> f64 {
    let mut noise = stream(1, "consistent");
    let kept = (-EVERY_S / correlation_time_s).exp();
    let fresh = (1.0 - kept * kept).sqrt();
    let bound = quantile_95(freedom);
    let in_band = |_: &usize| {
        let mut error: Vec<f64> = (0..freedom).map(|_| standard_normal(&mut noise)).collect();
        let mut inside = 0;
        for _ in 0..instants {
            inside += usize::from(error.iter().map(|e| e * e).sum::<f64>() <= bound);
            for e in &mut error {
                *e = kept * *e + fresh * standard_normal(&mut noise);
            }
        }
        is_consistent(inside as f64 / instants as f64)
    };
    (0..WORLDS).filter(in_band).count() as f64 / WORLDS as f64
}

/// 95 % of chi-square with one or two degrees of freedom.
#[must_use]
pub const fn quantile_95(freedom: u8) -> f64 {
    match freedom {
        1 => 3.841,
        _ => 5.991,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_errors_are_always_in_the_band_and_constant_ones_never() {
        let mut shares = ConsistentShares::default();
        assert!(shares.share(2, 1000, 0.05) > 0.99);
        assert!(shares.share(2, 1000, 1e9) < 0.02);
        let between = shares.share(1, 1000, 3.0);
        assert!((0.4..0.95).contains(&between), "{between}");
        assert_eq!(shares.0.len(), 3);
        assert!((shares.share(1, 1010, 3.1) - between).abs() < 1e-12);
    }
}
