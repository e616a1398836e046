//! Heading errors without their constant part: offset, what is left of it, and drift, in constant memory.
//!
//! Where nothing says where north is, the heading counts from an arbitrary direction: of its error only the changes say
//! something. The offset is the mean direction of the errors (Mardia & Jupp 2000, section 2.2). As it is known at the end only,
//! errors are kept as moments in bins of a degree; their squares about any offset follow exactly, but for the one bin in which
//! an error wraps round.

use std::f64::consts::{PI, TAU};

/// Bins of a turn.
const BINS: usize = 360;

/// Heading errors gathered over a run.
#[derive(Debug, Clone)]
pub struct HeadingErrors {
    bins: Vec<Bin>,
    sine: f64,
    cosine: f64,
    first: Option<f64>,
    /// The newest error less the first, continued over half turns.
    drift: f64,
    drift_squares: f64,
    count: u64,
}

/// Moments of the errors in one bin, about its middle.
#[derive(Debug, Clone, Copy, Default)]
struct Bin {
    count: f64,
    sum: f64,
    squares: f64,
    /// Of the inclination errors that came with them.
    inclination_squares: f64,
}

/// Errors after their offset is removed, rad.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AlignedErrors {
    /// The offset: mean direction of the heading errors, -pi to pi.
    pub offset: f64,
    /// RMS of the heading errors without it.
    pub heading_rms: f64,
    /// RMS of the total errors without it.
    pub total_rms: f64,
}

impl Default for HeadingErrors {
    fn default() -> Self {
        Self {
            bins: vec![Bin::default(); BINS],
            sine: 0.0,
            cosine: 0.0,
            first: None,
            drift: 0.0,
            drift_squares: 0.0,
            count: 0,
        }
    }
}

impl HeadingErrors {
    /// Adds the heading and the inclination error of one estimate, rad, in time order; they must be finite.
    pub fn add(&mut self, heading: f64, inclination: f64) {
        let first = *self.first.get_or_insert(heading);
        self.drift += wrapped(heading - first - self.drift);
        self.drift_squares += self.drift * self.drift;
        self.count += 1;
        self.sine += heading.sin();
        self.cosine += heading.cos();
        let index = ((heading + PI) / TAU * BINS as f64) as usize % BINS;
        let offset = wrapped(heading - middle(index));
        let bin = &mut self.bins[index];
        bin.count += 1.0;
        bin.sum += offset;
        bin.squares += offset * offset;
        bin.inclination_squares += inclination * inclination;
    }

    /// Change of the error since the first one, rad; beyond half a turn it counts on.
    #[must_use]
    pub fn drift(&self) -> f64 {
        self.drift
    }

    /// RMS of that change over all errors, rad; 0 without any.
    #[must_use]
    pub fn drift_rms(&self) -> f64 {
        (self.drift_squares / self.count.max(1) as f64).sqrt()
    }

    /// The errors without their offset; `None` without any.
    #[must_use]
    pub fn aligned(&self) -> Option<AlignedErrors> {
        let offset = self.sine.atan2(self.cosine);
        let [mut heading, mut total] = [0.0; 2];
        for (index, bin) in self.bins.iter().enumerate().filter(|(_, b)| b.count > 0.0) {
            let from = wrapped(middle(index) - offset);
            let squares = bin.squares + 2.0 * from * bin.sum + from * from * bin.count;
            heading += squares;
            let [h, i] =
                [squares, bin.inclination_squares].map(|s| (s / bin.count).max(0.0).sqrt());
            let angle = 2.0 * ((0.5 * h).cos() * (0.5 * i).cos()).clamp(-1.0, 1.0).acos();
            total += angle * angle * bin.count;
        }
        let count = self.count as f64;
        (self.count > 0).then(|| AlignedErrors {
            offset,
            heading_rms: (heading / count).sqrt(),
            total_rms: (total / count).sqrt(),
        })
    }
}

/// The angle in the middle of a bin, rad.
fn middle(index: usize) -> f64 {
    (index as f64 + 0.5) * TAU / BINS as f64 - PI
}

/// An angle between -pi and pi, rad.
fn wrapped(angle: f64) -> f64 {
    angle - TAU * (angle / TAU).round()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::metrics::AttitudeError;
    use nalgebra::{UnitQuaternion, Vector3};
    use northing_simulation::random::{normal_vector, stream};

    /// Large errors in both parts, against the definition on every one of them.
    #[test]
    fn moments_in_bins_say_what_every_single_error_says() {
        let mut random = stream(3, "headings");
        let errors: Vec<UnitQuaternion<f64>> = (0..20_000)
            .map(|_| {
                let v = normal_vector(&mut random, 1.0);
                let tilt =
                    UnitQuaternion::from_scaled_axis(Vector3::new(0.2 * v.x, 0.2 * v.y, 0.0));
                UnitQuaternion::from_scaled_axis(Vector3::z() * (2.6 + 0.5 * v.z)) * tilt
            })
            .collect();
        let identity = UnitQuaternion::identity();
        let mut gathered = HeadingErrors::default();
        for error in &errors {
            let parts = AttitudeError::between(error, &identity);
            gathered.add(parts.heading, parts.inclination);
        }
        let got = gathered.aligned().unwrap();
        assert!((wrapped(got.offset - 2.6)).abs() < 0.02, "{got:?}");
        let back = UnitQuaternion::from_scaled_axis(Vector3::z() * -got.offset);
        let of = |part: fn(&AttitudeError) -> f64| {
            let square = |e| part(&AttitudeError::between(&(back * e), &identity)).powi(2);
            (errors.iter().map(square).sum::<f64>() / errors.len() as f64).sqrt()
        };
        let (heading, total) = (of(|e| e.heading), of(|e| e.total));
        assert!(
            (got.heading_rms / heading - 1.0).abs() < 1e-6,
            "{got:?}, {heading}"
        );
        assert!(
            (got.total_rms / total - 1.0).abs() < 1e-4,
            "{got:?}, {total}"
        );
    }

    #[test]
    fn a_drift_counts_on_over_half_a_turn() {
        let mut gathered = HeadingErrors::default();
        assert_eq!(gathered.aligned(), None);
        for k in 0..=700 {
            gathered.add(wrapped(3.0 - 0.01 * f64::from(k)), 0.0);
        }
        assert!(
            (gathered.drift() + 7.0).abs() < 1e-9,
            "{}",
            gathered.drift()
        );
        assert!((gathered.drift_rms() - 7.0 / 3.0_f64.sqrt()).abs() < 0.01);
    }
}
