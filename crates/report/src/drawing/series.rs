//! Series: thinning to what a screen can show, and cutting lines where they must not be drawn.
//!
//! A value that is not finite lifts the pen. So does a step of more than half a turn in a series
//! marked as an angle: 179 deg to -179 deg is a turn of 2 deg, not a vertical line.

/// One point of a curve: time, value.
pub(crate) type Point = [f64; 2];
/// One point of a band: time, lower, upper.
pub(crate) type BandPoint = [f64; 3];

/// At most `limit` points: of each bucket of consecutive points its lowest and highest value, in
/// their order, so that spikes survive.
pub(crate) fn thin(points: &[Point], limit: usize) -> Vec<Point> {
    if points.len() <= limit.max(2) {
        return points.to_vec();
    }
    let size = points.len().div_ceil((limit / 2).max(1));
    let mut kept = Vec::with_capacity(limit);
    for bucket in points.chunks(size) {
        let (mut low, mut high) = (0, 0);
        for (i, point) in bucket.iter().enumerate() {
            if !point[1].is_finite() {
                continue;
            }
            if point[1] < bucket[low][1] || bucket[low][1].is_nan() {
                low = i;
            }
            if point[1] > bucket[high][1] || bucket[high][1].is_nan() {
                high = i;
            }
        }
        kept.push(bucket[low.min(high)]);
        if low != high {
            kept.push(bucket[low.max(high)]);
        }
    }
    kept
}

/// At most `limit` points of a band: of each bucket its hull, at the bucket's middle time.
pub(crate) fn thin_band(points: &[BandPoint], limit: usize) -> Vec<BandPoint> {
    if points.len() <= limit.max(2) {
        return points.to_vec();
    }
    let size = points.len().div_ceil(limit.max(1));
    let hull = |bucket: &[BandPoint]| {
        let middle = bucket[bucket.len() / 2];
        // A bucket across the wrap of an angle would span the whole circle: take its middle alone.
        let centre = |p: &BandPoint| 0.5 * (p[1] + p[2]);
        if bucket
            .iter()
            .any(|p| (centre(p) - centre(&middle)).abs() > 180.0)
        {
            return middle;
        }
        bucket.iter().fold(middle, |hull, p| {
            [hull[0], hull[1].min(p[1]), hull[2].max(p[2])]
        })
    };
    points.chunks(size).map(hull).collect()
}

/// At most `limit` points, evenly picked: for clouds of dots.
pub(crate) fn pick(points: &[Point], limit: usize) -> Vec<Point> {
    let step = points.len().div_ceil(limit.max(1)).max(1);
    points.iter().copied().step_by(step).collect()
}

/// Cuts a series into lines where a value is not finite, or an angle wraps.
pub(crate) fn split<const N: usize>(points: &[[f64; N]], angle: bool) -> Vec<Vec<[f64; N]>> {
    let mut lines: Vec<Vec<[f64; N]>> = vec![Vec::new()];
    for point in points {
        let finite = point.iter().all(|v| v.is_finite());
        let line = lines.last().map_or(&[][..], |l| &l[..]);
        let wraps = angle
            && line
                .last()
                .is_some_and(|last| (last[1] - point[1]).abs() > 180.0);
        if (wraps || !finite) && !line.is_empty() {
            lines.push(Vec::new());
        }
        if let (true, Some(line)) = (finite, lines.last_mut()) {
            line.push(*point);
        }
    }
    lines.retain(|line| !line.is_empty());
    lines
}

/// This many empty windows in a row are a gap, and lift the pen.
const GAP_WINDOWS: usize = 3;

/// Root mean square of a series in `count` windows of equal time, at the windows' middles.
/// Windows without values are left out.
pub(crate) fn windowed_rms(points: &[Point], count: usize) -> Vec<Point> {
    let finite = points.iter().filter(|p| p.iter().all(|v| v.is_finite()));
    let finite: Vec<&Point> = finite.collect();
    let (Some(first), Some(last)) = (finite.first(), finite.last()) else {
        return Vec::new();
    };
    let width = ((last[0] - first[0]) / count.max(1) as f64).max(1e-9);
    let mut windows = vec![(0.0, 0_u32); count.max(1)];
    for point in &finite {
        let window = (((point[0] - first[0]) / width) as usize).min(windows.len() - 1);
        windows[window].0 += point[1] * point[1];
        windows[window].1 += 1;
    }
    let mut curve: Vec<Point> = Vec::new();
    let mut empty = 0;
    for (i, (sum, n)) in windows.into_iter().enumerate() {
        let middle = first[0] + (i as f64 + 0.5) * width;
        empty = if n == 0 { empty + 1 } else { 0 };
        if n > 0 {
            curve.push([middle, (sum / f64::from(n)).sqrt()]);
        } else if empty == GAP_WINDOWS {
            curve.push([middle, f64::NAN]);
        }
    }
    curve
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_keeps_the_limit_and_the_spikes() {
        let points: Vec<Point> = (0..100_000)
            .map(|i| {
                [
                    f64::from(i),
                    if i == 54_321 {
                        9.0
                    } else {
                        f64::from(i % 7) / 7.0
                    },
                ]
            })
            .collect();
        let kept = thin(&points, 2000);
        assert!(kept.len() <= 2000 && kept.len() > 900, "{}", kept.len());
        assert!(kept.iter().any(|p| p[1] > 8.9));
        assert!(kept.windows(2).all(|w| w[0][0] < w[1][0]));
    }

    #[test]
    fn thinned_band_holds_all_of_it() {
        let band: Vec<BandPoint> = (0..9000)
            .map(|i| [f64::from(i), -1.0 - f64::from(i % 5), f64::from(i % 3)])
            .collect();
        let kept = thin_band(&band, 500);
        assert!(kept.len() <= 500);
        assert!(kept[..499].iter().all(|p| p[1] <= -5.0 && p[2] >= 2.0));
    }

    #[test]
    fn lines_break_at_the_wrap_and_at_gaps() {
        let heading = [
            [0.0, 178.0],
            [1.0, 179.5],
            [2.0, -179.0],
            [3.0, f64::NAN],
            [4.0, -170.0],
        ];
        let lengths =
            |angle| -> Vec<usize> { split(&heading, angle).iter().map(Vec::len).collect() };
        assert_eq!(lengths(true), [2, 1, 1]);
        assert_eq!(lengths(false), [3, 1]);
        assert!(split::<2>(&[], true).is_empty());
    }

    #[test]
    fn windows_lift_the_pen_once_in_a_gap() {
        let times = (0..100).filter(|t| !(40..60).contains(t));
        let points: Vec<Point> = times.map(|t| [f64::from(t), 1.0]).collect();
        let rms = windowed_rms(&points, 50);
        assert_eq!(rms.iter().filter(|p| p[1].is_nan()).count(), 1);
        assert_eq!(split(&rms, false).len(), 2);
    }

    #[test]
    fn windows_give_the_root_mean_square() {
        let points: Vec<Point> = (0..100)
            .map(|i| [f64::from(i), if i % 2 == 0 { 3.0 } else { -3.0 }])
            .collect();
        let rms = windowed_rms(&points, 10);
        assert_eq!(rms.len(), 10);
        assert!(rms.iter().all(|p| (p[1] - 3.0).abs() < 1e-12));
    }
}
