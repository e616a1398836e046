//! How far the estimates that a board has printed are from the truth.

use crate::output::{Sentence, of_kind};
use crate::walk::{Truth, place};

/// Root mean squares over printed estimates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Errors {
    /// Horizontal position, m.
    pub position_m: f64,
    /// Roll and pitch together, rad.
    pub tilt: f64,
    /// Heading, rad.
    pub heading: f64,
}

/// The errors of the estimates after the first 20 seconds.
///
/// # Panics
/// When there are hardly any.
#[must_use]
pub fn errors(said: &[Sentence], truth: &[Truth]) -> Errors {
    let origin = of_kind(said, 'O').next().unwrap();
    let [origin_north, origin_east] = place(origin.number(0), origin.number(1));
    let mut sums = [0.0; 3];
    let mut count = 0.0;
    for estimate in of_kind(said, 'E') {
        let ms: usize = estimate.number(0);
        if ms < 20_000 {
            continue;
        }
        // The first frame begins the time.
        let truth = &truth[ms / 20];
        let [roll, pitch, yaw] = estimate.vector(1, 1e-3).map(f64::to_radians);
        let [true_roll, true_pitch, true_yaw] = <[f64; 3]>::from(truth.attitude.euler_angles());
        let wrapped = (yaw - true_yaw).sin().asin();
        let [north, east, _] = estimate.vector(8, 1e-3);
        let off = [
            origin_north + north - truth.position.x,
            origin_east + east - truth.position.y,
        ];
        let squares = [
            off[0] * off[0] + off[1] * off[1],
            (roll - true_roll).powi(2) + (pitch - true_pitch).powi(2),
            wrapped * wrapped,
        ];
        for (sum, square) in sums.iter_mut().zip(squares) {
            *sum += square;
        }
        count += 1.0;
    }
    assert!(count > 100.0);
    let [position_m, tilt, heading] = sums.map(|sum: f64| (sum / count).sqrt());
    Errors {
        position_m,
        tilt,
        heading,
    }
}
