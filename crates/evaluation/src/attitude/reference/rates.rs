//! Rates of the gyroscope and of the reference side by side: what their clocks and mountings are compared by.
//!
//! The gyroscope is kept as the angle turned in cells of 10 ms, so that its mean rate over any interval is a difference of
//! two sums. The reference is differentiated over windows of 50 ms or its own interval, whichever is longer: over less, its
//! noise would be all there is. What its samples show to be no measurement, or clipped, is a pause: a fault of the gyroscope
//! says nothing of the reference. Memory is bounded by the length that is looked at.

use nalgebra::{UnitQuaternion, Vector3};
use northing_core::faults::sample_check::{Checked, SampleCheck};
use northing_core::geometry::so3;

use crate::attitude::Instant;
use crate::statistics::seconds_between;

/// Length of a cell, s.
const CELL_S: f64 = 0.01;
/// Shortest window over which the reference is differentiated, s.
const WINDOW_S: f64 = 0.05;
/// Longest window, s, and longest interval of the gyroscope: above it there is a pause.
const LONGEST_S: f64 = 0.3;
/// Cells are made ahead of a pause up to this length only, s.
const LONGEST_FILL_S: f64 = 600.0;

/// Gathers rates over the first part of a recording.
#[derive(Debug, Clone)]
pub(crate) struct Rates {
    longest_s: f64,
    first_ns: Option<i64>,
    check: SampleCheck<f64>,
    last_rate: Option<LastRate>,
    /// Angle turned in each cell, rad; NaN in a pause.
    cells: Vec<[f32; 3]>,
    last_reference: Option<(f64, UnitQuaternion<f64>)>,
    windows: Vec<Window>,
}

/// The last sample of the gyroscope.
#[derive(Debug, Clone, Copy)]
struct LastRate {
    time_s: f64,
    rate: Vector3<f64>,
    is_measured: bool,
}

/// Mean rate of the reference between two of its samples, its own body axes, rad/s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Window {
    pub(crate) from_s: f64,
    pub(crate) to_s: f64,
    pub(crate) rate: Vector3<f64>,
    /// At both ends, as they were read.
    pub(crate) attitudes: [UnitQuaternion<f64>; 2],
}

impl Window {
    pub(crate) fn middle_s(&self) -> f64 {
        0.5 * (self.from_s + self.to_s)
    }
}

impl Default for Rates {
    /// Looks at nothing.
    fn default() -> Self {
        Self::new(0.0)
    }
}

impl Rates {
    /// Looks at the first so many seconds.
    pub(crate) fn new(longest_s: f64) -> Self {
        Self {
            longest_s,
            first_ns: None,
            check: SampleCheck::of_gyroscope(),
            last_rate: None,
            cells: Vec::new(),
            last_reference: None,
            windows: Vec::new(),
        }
    }

    /// Takes what was measured at one instant.
    pub(crate) fn add(&mut self, instant: &Instant) {
        let first_ns = *self.first_ns.get_or_insert(instant.time_ns);
        let now_s = seconds_between(first_ns, instant.time_ns);
        if now_s > self.longest_s {
            return;
        }
        let finite = |rate: &Vector3<f64>| rate.norm_squared().is_finite();
        if let Some(rate) = instant.angular_rate.filter(finite) {
            self.add_rate(instant.time_ns, now_s, rate);
        }
        if let Some(reference) = instant.reference {
            self.add_reference(now_s, reference.attitude);
        }
    }

    fn add_rate(&mut self, time_ns: i64, now_s: f64, rate: Vector3<f64>) {
        if self.last_rate.is_some_and(|last| now_s <= last.time_s) {
            return;
        }
        let checked = self.check.check(time_ns, &rate);
        let is_clipped = matches!(checked, Checked::Saturated { .. });
        let now = LastRate {
            time_s: now_s,
            rate,
            is_measured: checked.is_measured() && !is_clipped,
        };
        let Some(last) = self.last_rate.replace(now) else {
            return;
        };
        let last_s = last.time_s;
        let interval = now_s - last_s;
        let needed = (now_s / CELL_S) as usize + 1;
        if interval > LONGEST_FILL_S || needed > (self.longest_s / CELL_S) as usize + 2 {
            return;
        }
        self.cells.resize(needed, [0.0; 3]);
        let pause = interval > LONGEST_S || !(last.is_measured && now.is_measured);
        // The rate is linear between samples: of each cell the part that the interval covers.
        let mut from = last_s;
        for index in (last_s / CELL_S) as usize..needed {
            let to = now_s.min((index as f64 + 1.0) * CELL_S);
            let share = (0.5 * (from + to) - last_s) / interval;
            let turned = last.rate.lerp(&now.rate, share) * (to - from).max(0.0);
            for (cell, turned) in self.cells[index].iter_mut().zip(turned.iter()) {
                *cell += if pause { f32::NAN } else { *turned as f32 };
            }
            from = to;
        }
    }

    fn add_reference(&mut self, now_s: f64, now: UnitQuaternion<f64>) {
        let Some((last_s, last)) = self.last_reference else {
            self.last_reference = Some((now_s, now));
            return;
        };
        let interval = now_s - last_s;
        if interval < WINDOW_S - 1e-6 {
            return;
        }
        if interval <= LONGEST_S {
            self.windows.push(Window {
                from_s: last_s,
                to_s: now_s,
                rate: so3::log(&(last.inverse() * now)) / interval,
                attitudes: [last, now],
            });
        }
        self.last_reference = Some((now_s, now));
    }

    /// The rates gathered so far.
    pub(crate) fn series(&self) -> Series<'_> {
        let mut sums = Vec::with_capacity(self.cells.len() + 1);
        let mut sum = Vector3::zeros();
        let mut pauses = vec![0_u32];
        sums.push(sum);
        for cell in &self.cells {
            let turned = Vector3::from(cell.map(f64::from));
            let is_pause = !turned.x.is_finite();
            if !is_pause {
                sum += turned;
            }
            sums.push(sum);
            pauses.push(pauses[pauses.len() - 1] + u32::from(is_pause));
        }
        Series {
            windows: &self.windows,
            sums,
            pauses,
        }
    }
}

/// Rates that can be compared.
#[derive(Debug)]
pub(crate) struct Series<'a> {
    /// Of the reference, in time order.
    pub(crate) windows: &'a [Window],
    /// Angle turned before each cell, rad.
    sums: Vec<Vector3<f64>>,
    /// Cells in a pause before each cell.
    pauses: Vec<u32>,
}

impl Series<'_> {
    /// The same gyroscope beside other windows.
    pub(crate) fn with<'a>(&self, windows: &'a [Window]) -> Series<'a> {
        Series {
            windows,
            sums: self.sums.clone(),
            pauses: self.pauses.clone(),
        }
    }

    /// Length of the gyroscope's part, s.
    pub(crate) fn duration_s(&self) -> f64 {
        self.pauses.len() as f64 * CELL_S
    }

    /// Mean rate of the gyroscope over an interval, rad/s; `None` outside the recording and in its pauses.
    pub(crate) fn gyroscope(&self, from_s: f64, to_s: f64) -> Option<Vector3<f64>> {
        let last = self.sums.len().checked_sub(2)?;
        let (from, to) = (from_s / CELL_S, to_s / CELL_S);
        if !(from >= 0.0 && to <= last as f64) {
            return None;
        }
        if self.pauses[to as usize + 1] > self.pauses[from as usize] {
            return None;
        }
        let turned = |cells: f64| {
            let whole = cells as usize;
            self.sums[whole].lerp(&self.sums[whole + 1], cells - whole as f64)
        };
        Some((turned(to) - turned(from)) / (to_s - from_s))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use northing_recording::Reference;

    fn instant(k: i64, rate: Vector3<f64>, reference: Option<UnitQuaternion<f64>>) -> Instant {
        let scored = |attitude| Reference {
            attitude,
            scored: true,
        };
        Instant {
            time_ns: k * 10_000_000,
            angular_rate: Some(rate),
            reference: reference.map(scored),
            ..Instant::default()
        }
    }

    /// A rate that grows linearly, at 40 Hz: its mean over any interval is that in the middle.
    #[test]
    fn means_over_any_interval_follow_from_the_cells() {
        let mut rates = Rates::new(60.0);
        let at = |t: f64| Vector3::new(0.1 * t, -0.2, 0.0);
        for k in 0..400_i64 {
            let t = k as f64 * 0.025;
            rates.add(&Instant {
                time_ns: k * 25_000_000,
                ..instant(0, at(t), None)
            });
        }
        let series = rates.series();
        for from in [0.013, 3.3, 7.777] {
            let got = series.gyroscope(from, from + 0.08).unwrap();
            assert!((got - at(from + 0.04)).amax() < 2e-4, "{got} at {from}");
        }
        assert_eq!(series.gyroscope(9.95, 10.03), None);
        assert_eq!(series.gyroscope(-0.1, 0.1), None);
    }

    #[test]
    fn a_pause_has_no_rate_and_a_reference_is_differentiated_over_windows() {
        let mut rates = Rates::new(60.0);
        for k in (0..100_i64).chain(200..300) {
            let q = UnitQuaternion::from_scaled_axis(Vector3::z() * (0.02 * k as f64));
            rates.add(&instant(k, Vector3::z() * 2.0, Some(q)));
        }
        let series = rates.series();
        assert_eq!(series.gyroscope(0.9, 1.1), None);
        assert!(series.gyroscope(0.2, 0.3).is_some() && series.gyroscope(2.2, 2.3).is_some());
        assert!(
            (38..=40).contains(&series.windows.len()),
            "{}",
            series.windows.len()
        );
        for window in series.windows {
            assert!((window.rate - Vector3::z() * 2.0).amax() < 1e-9);
            assert!((window.to_s - window.from_s - 0.05).abs() < 1e-6);
        }
    }

    /// A spin beyond the range: what the gyroscope shows is not how it turned.
    #[test]
    fn a_gyroscope_at_the_end_of_its_range_has_no_rate() {
        let mut rates = Rates::new(60.0);
        for k in 0..900_i64 {
            let t = k as f64 * 0.01;
            let spin = if (400..700).contains(&k) { 60.0 } else { 0.0 };
            let rate = Vector3::new(
                1.3 * (3.1 * t).sin(),
                (2.3 * t).cos(),
                spin + (1.7 * t).sin(),
            );
            rates.add(&instant(k, rate.map(|x| x.clamp(-35.0, 35.0)), None));
        }
        let series = rates.series();
        assert!(series.gyroscope(3.0, 3.9).is_some() && series.gyroscope(7.1, 8.9).is_some());
        assert_eq!(series.gyroscope(5.0, 5.1), None);
    }

    #[test]
    fn what_comes_later_than_the_limit_is_not_kept() {
        let mut rates = Rates::new(2.0);
        for k in 0..10_000_i64 {
            rates.add(&instant(k, Vector3::z(), Some(UnitQuaternion::identity())));
        }
        assert!(rates.cells.len() <= 202 && rates.windows.len() <= 41);
    }
}
