//! Notices that a browser rounds its readings, which a calibration must know.

use super::Decoded;

/// Numbers other than zero that a verdict needs.
const ENOUGH: u32 = 30;
/// The step, in the unit of the numbers.
const STEP: f64 = 0.1;

/// Watches whether all numbers of a sensor are multiples of a step.
#[derive(Debug, Clone, Default)]
pub(super) struct Rounding {
    /// Numbers other than zero so far.
    multiples: u32,
    judged: bool,
}

impl Rounding {
    /// Looks at a reading as it was written, of a sensor whose step is said in words.
    pub(super) fn see<'a>(
        &mut self,
        [sensor, step]: [&str; 2],
        numbers: impl IntoIterator<Item = &'a f64>,
        out: &mut Decoded,
    ) {
        for number in numbers {
            if self.judged {
                return;
            }
            let steps = number / STEP;
            if !steps.is_finite() || steps.abs() < 0.5 {
                // Zero is a multiple of everything.
                continue;
            }
            if (steps - steps.round()).abs() > 1e-3 {
                self.judged = true;
                return;
            }
            self.multiples += 1;
            if self.multiples == ENOUGH {
                self.judged = true;
                out.info(format!(
                        "The browser rounds the {sensor} to {step}; a calibration must count that as noise. An app such as Sensor Logger gives finer values."
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
        const FORCE: [&str; 2] = ["accelerometer", "0.1 m/s^2"];
        let mut coarse = Rounding::default();
        let mut fine = coarse.clone();
        let (mut coarse_out, mut fine_out) = (Decoded::default(), Decoded::default());
        for index in 0..200 {
            let number = f64::from(index) * 0.1;
            coarse.see(FORCE, &[number, 0.0, f64::NAN], &mut coarse_out);
            fine.see(FORCE, &[number + 0.0123], &mut fine_out);
        }
        assert_eq!(coarse_out.notices.len(), 1);
        assert_eq!(coarse_out.notices[0].count, 1);
        assert!(fine_out.notices.is_empty());
    }
}
