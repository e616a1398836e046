//! The smooth step from 0 to 1 that motions are blended with.

/// Value, first and second derivative of `x^3 (10 - 15 x + 6 x^2)`, held at 0 before 0 and at 1
/// after 1. Both derivatives vanish at both ends, so what it blends starts and stops without a jump
/// in velocity or acceleration.
pub(super) fn smooth_step(x: f64) -> (f64, f64, f64) {
    let x = x.clamp(0.0, 1.0);
    let rest = 1.0 - x;
    (
        x * x * x * (10.0 + x * (6.0 * x - 15.0)),
        30.0 * x * x * rest * rest,
        60.0 * x * rest * (rest - x),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_are_exact_and_derivatives_agree_with_differences() {
        assert_eq!(smooth_step(-1.0), (0.0, 0.0, 0.0));
        assert_eq!(smooth_step(2.0), (1.0, 0.0, 0.0));
        let h = 1e-5;
        for i in 1..20 {
            let x = f64::from(i) / 20.0;
            let (before, now, after) = (smooth_step(x - h), smooth_step(x), smooth_step(x + h));
            assert!(((after.0 - before.0) / (2.0 * h) - now.1).abs() < 1e-8);
            assert!(((after.1 - before.1) / (2.0 * h) - now.2).abs() < 1e-7);
        }
    }
}
