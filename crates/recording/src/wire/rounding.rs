//! Notices that a browser rounds its readings, which a calibration must know.

use super::Decoded;

/// Numbers other than zero that a verdict needs.
const ENOUGH: u32 = 30;

/// Watches whether all numbers of a sensor are multiples of a step.
#[derive(Debug, Clone)]
pub(super) struct Rounding {
    /// In the unit of the numbers.
    step: f64,
    sensor: &'static str,
    /// The step for people.
    step_words: &'static str,
    /// Numbers other than zero so far; none any more once the verdict is out.
    multiples: Option<u32>,
}

impl Rounding {
    pub(super) const fn new(step: f64, sensor: &'static str, step_words: &'static str) -> Self {
        Self {
            step,
            sensor,
            step_words,
            multiples: Some(0),
        }
    }

    /// Looks at a reading as it was written.
    pub(super) fn see<'a>(
        &mut self,
        numbers: impl IntoIterator<Item = &'a f64>,
        out: &mut Decoded,
    ) {
        for number in numbers {
            let Some(multiples) = &mut self.multiples else {
                return;
            };
            let steps = number / self.step;
            if !steps.is_finite() || steps.abs() < 0.5 {
                // Zero is a multiple of everything.
                continue;
            }
            if (steps - steps.round()).abs() > 1e-3 {
                self.multiples = None;
                return;
            }
            *multiples += 1;
            if *multiples == ENOUGH {
                self.multiples = None;
                out.info(format!(
                        "The browser rounds the {} to {}; a calibration must count that as noise. An app such as Sensor Logger gives finer values.",
                        self.sensor, self.step_words
                    ),
                );
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounded_numbers_are_noticed_once_and_fine_ones_never() {
        let mut coarse = Rounding::new(0.1, "accelerometer", "0.1 m/s^2");
        let mut fine = coarse.clone();
        let (mut coarse_out, mut fine_out) = (Decoded::default(), Decoded::default());
        for index in 0..200 {
            let number = f64::from(index) * 0.1;
            coarse.see(&[number, 0.0, f64::NAN], &mut coarse_out);
            fine.see(&[number + 0.0123], &mut fine_out);
        }
        assert_eq!(coarse_out.notices.len(), 1);
        assert_eq!(coarse_out.notices[0].count, 1);
        assert!(fine_out.notices.is_empty());
    }
}
