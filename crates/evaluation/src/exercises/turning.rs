//! Turns of a recording: where it rests, what the gyroscope reads there, and what it adds up to between two rests.

use nalgebra::{UnitQuaternion, Vector3};
use northing_core::geometry::so3;
use northing_recording::{Event, Sample};

/// A rest lasts at least so long, ns.
const SHORTEST_REST_NS: i64 = 1_000_000_000;
/// The rate stays this close to the rest's mean, rad/s.
const STILL_RAD_S: f64 = 0.05;
/// A rate beyond this is no bias, rad/s.
const LARGEST_BIAS_RAD_S: f64 = 0.2;

/// A while without motion.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rest {
    pub(super) from_ns: i64,
    pub(super) until_ns: i64,
    /// Mean rate of its middle half: the bias, rad/s.
    pub(super) mean_rad_s: Vector3<f64>,
}

impl Rest {
    /// Its middle half, ns: a rest is found with a little of the motion at its ends.
    pub(super) fn core(&self) -> [i64; 2] {
        let quarter = self.until_ns.saturating_sub(self.from_ns) / 4;
        [self.from_ns + quarter, self.until_ns - quarter]
    }
}

/// The rates of a recording.
pub(super) fn rates(events: &[Event]) -> Vec<(i64, Vector3<f64>)> {
    let rate = |event: &Event| match event.sample {
        Sample::AngularRate(rate) => Some((event.time_ns, rate)),
        _ => None,
    };
    events.iter().filter_map(rate).collect()
}

/// The rests of a recording, the first first.
pub(super) fn rests(rates: &[(i64, Vector3<f64>)]) -> Vec<Rest> {
    let mut found = Vec::new();
    let mut from = 0;
    while from < rates.len() {
        let until = still_until(rates, from);
        let (first, last) = (rates[from].0, rates[until].0);
        if last.saturating_sub(first) >= SHORTEST_REST_NS {
            let mut rest = Rest {
                from_ns: first,
                until_ns: last,
                mean_rad_s: Vector3::zeros(),
            };
            let [from_ns, until_ns] = rest.core();
            let inside = rates[from..=until]
                .iter()
                .filter(|(t, _)| (from_ns..=until_ns).contains(t));
            let (sum, count) = inside.fold((Vector3::zeros(), 0), |(sum, count), (_, rate)| {
                (sum + rate, count + 1)
            });
            rest.mean_rad_s = sum / f64::from(count.max(1));
            found.push(rest);
            from = until + 1;
        } else {
            from += 1;
        }
    }
    found
}

/// The last sample that still belongs to a rest that begins with the one at `from`.
fn still_until(rates: &[(i64, Vector3<f64>)], from: usize) -> usize {
    let mut sum = Vector3::zeros();
    let mut until = from;
    for (k, (_, rate)) in rates[from..].iter().enumerate() {
        let mean = if k == 0 { *rate } else { sum / k as f64 };
        if (rate - mean).amax() > STILL_RAD_S || mean.amax() > LARGEST_BIAS_RAD_S {
            break;
        }
        sum += rate;
        until = from + k;
    }
    until
}

/// What the gyroscope adds up to between two times, its bias taken away: the turn, and the angle about each axis of the body
/// summed without regard to the turns in between, rad. Rates are taken as constant halfway to their neighbours.
pub(super) fn turned(
    rates: &[(i64, Vector3<f64>)],
    [from_ns, until_ns]: [i64; 2],
    bias: Vector3<f64>,
) -> (UnitQuaternion<f64>, Vector3<f64>) {
    let (mut turn, mut about) = (UnitQuaternion::identity(), Vector3::zeros());
    for pair in rates.windows(2) {
        let [(start, before), (end, after)] = pair else {
            continue;
        };
        if *start < from_ns || *end > until_ns {
            continue;
        }
        let step = ((before + after) / 2.0 - bias) * (end.saturating_sub(*start) as f64 * 1e-9);
        turn *= so3::exp(&step);
        about += step;
    }
    (turn, about)
}

/// The whole way that the device turned, rad: the length of the path and not of its end.
pub(super) fn path(rates: &[(i64, Vector3<f64>)], bias: Vector3<f64>) -> f64 {
    let step = |pair: &[(i64, Vector3<f64>)]| {
        (pair[0].1 - bias).norm() * (pair[1].0.saturating_sub(pair[0].0) as f64 * 1e-9).min(0.5)
    };
    rates.windows(2).map(step).sum()
}
