//! Recordings as uniformly sampled streams: what open filters take and what the prototype took.
//!
//! A recording whose sensors share their instants is taken as it is; otherwise everything is
//! interpolated linearly at the gyroscope's median rate.

use std::path::Path;

use nalgebra::{DMatrix, DVector, Matrix3, UnitQuaternion, Vector3};
use northing_core::geometry::so3;
use northing_recording::{OpenOptions, Sample, open};

/// A recording at a fixed rate.
pub(crate) struct Uniform {
    pub(crate) interval_s: f64,
    pub(crate) rate: Vec<Vector3<f64>>,
    pub(crate) force: Vec<Vector3<f64>>,
    pub(crate) field: Field,
    pub(crate) uncalibrated: Option<Field>,
    /// The reference where it is known and counts.
    pub(crate) reference: Vec<Option<UnitQuaternion<f64>>>,
    /// Which calibration recordings belong to it.
    pub(crate) calibration_day: Option<String>,
}

/// One magnetometer stream.
#[derive(Clone)]
pub(crate) struct Field {
    pub(crate) values: Vec<Vector3<f64>>,
    /// Whether the sensor has delivered since the sample before.
    pub(crate) fresh: Vec<bool>,
}

/// The scored part begins after so many seconds.
const SKIP_S: f64 = 5.0;

/// One sensor's samples with their times.
#[derive(Default)]
struct Track {
    time: Vec<f64>,
    values: Vec<Vector3<f64>>,
}

impl Track {
    fn push(&mut self, time: f64, value: Vector3<f64>) {
        self.time.push(time);
        self.values.push(value);
    }

    /// Linear interpolation; the ends hold.
    fn at(&self, time: f64) -> Vector3<f64> {
        let next = self.time.partition_point(|t| *t <= time);
        if next == 0 {
            return self.values[0];
        }
        if next == self.time.len() {
            return self.values[next - 1];
        }
        let (t0, t1) = (self.time[next - 1], self.time[next]);
        let share = (time - t0) / (t1 - t0);
        self.values[next - 1].lerp(&self.values[next], share)
    }

    fn field(&self, grid: &[f64]) -> Field {
        let mut seen = 0;
        let fresh = grid.iter().map(|t| {
            let before = seen;
            seen = self.time.partition_point(|time| time <= t);
            seen > before
        });
        Field {
            fresh: fresh.collect(),
            values: grid.iter().map(|t| self.at(*t)).collect(),
        }
    }
}

/// All that a recording holds, sensor by sensor.
#[derive(Default)]
struct Tracks {
    rate: Track,
    force: Track,
    field: Track,
    uncalibrated: Track,
    reference: Vec<(f64, UnitQuaternion<f64>, bool)>,
    /// Instants at which a reference could stand.
    instants: Vec<f64>,
}

fn read(path: &Path) -> (Tracks, Option<String>) {
    let recording = open(path, &OpenOptions::default()).expect("a recording");
    let day = recording.metadata().extra.get("calibration_day").cloned();
    let mut tracks = Tracks::default();
    for event in recording {
        let event = event.expect("an event");
        let t = event.time_ns as f64 * 1e-9;
        match event.sample {
            Sample::AngularRate(v) => tracks.rate.push(t, v),
            Sample::SpecificForce(v) => tracks.force.push(t, v),
            Sample::MagneticField(v) => tracks.field.push(t, v),
            Sample::MagneticFieldUncalibrated(v) => tracks.uncalibrated.push(t, v),
            Sample::Reference(r) => tracks.reference.push((t, r.attitude, r.scored)),
            _ => {}
        }
        if matches!(
            event.sample,
            Sample::AngularRate(_) | Sample::DeviceOrientation(_)
        ) && tracks.instants.last() != Some(&t)
        {
            tracks.instants.push(t);
        }
    }
    (tracks, day)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let half = values.len() / 2;
    if values.len() % 2 == 1 {
        values[half]
    } else {
        0.5 * (values[half - 1] + values[half])
    }
}

impl Uniform {
    /// Reads a recording.
    pub(crate) fn read(path: &Path) -> Self {
        let (tracks, calibration_day) = read(path);
        let times = &tracks.rate.time;
        let interval_s = median(times.windows(2).map(|w| w[1] - w[0]).collect());
        let together = tracks.force.time == *times && tracks.field.time == *times;
        let grid: Vec<f64> = if together {
            times.clone()
        } else {
            let all = [&tracks.rate, &tracks.force, &tracks.field];
            let first = all.map(|t| t.time[0]).into_iter().fold(f64::MIN, f64::max);
            let last = all.map(|t| t.time[t.time.len() - 1]);
            let last = last.into_iter().fold(f64::MAX, f64::min);
            let count = ((last - first) / interval_s).ceil() as usize;
            (0..count).map(|k| first + k as f64 * interval_s).collect()
        };
        let at = |track: &Track| grid.iter().map(|t| track.at(*t)).collect::<Vec<_>>();
        let raw = (!tracks.uncalibrated.time.is_empty()).then(|| tracks.uncalibrated.field(&grid));
        Self {
            interval_s,
            rate: at(&tracks.rate),
            force: at(&tracks.force),
            field: tracks.field.field(&grid),
            uncalibrated: raw,
            reference: tracks.references(&grid),
            calibration_day,
        }
    }

    /// Samples in half a second: what the start is averaged over.
    pub(crate) fn start_samples(&self) -> usize {
        ((0.5 / self.interval_s) as usize).max(1)
    }
}

impl Tracks {
    /// The scored reference on the grid: between two neighbouring instants that both carry it.
    fn references(&self, grid: &[f64]) -> Vec<Option<UnitQuaternion<f64>>> {
        let of = |t: f64| {
            let place = self.reference.partition_point(|r| r.0 < t);
            let found = self.reference.get(place).filter(|r| r.0 <= t);
            found.filter(|r| r.2).map(|r| r.1)
        };
        let between = |t: f64| {
            let next = self.instants.partition_point(|time| *time <= t);
            let before = *self.instants.get(next.checked_sub(1)?)?;
            let q0 = of(before)?;
            if before >= t {
                return Some(q0);
            }
            let after = *self.instants.get(next)?;
            let turn = so3::log(&(q0.inverse() * of(after)?));
            Some(q0 * so3::exp(&(turn * ((t - before) / (after - before)))))
        };
        let scored = grid.iter().map(|t| {
            let late = *t - grid[0] >= SKIP_S;
            between(*t).filter(|_| late)
        });
        scored.collect()
    }
}

/// Bias of a gyroscope at rest, rad/s: the median over windows of a hundred samples that hardly vary.
pub(crate) fn rest_bias(path: &Path) -> Vector3<f64> {
    let rate = read(path).0.rate.values;
    let mut means = Vec::new();
    for window in rate.chunks_exact(100) {
        let mean = window.iter().sum::<Vector3<f64>>() / 100.0;
        let square = |v: &Vector3<f64>| (v - mean).map(|x| x * x);
        let variance = window.iter().map(square).sum::<Vector3<f64>>() / 100.0;
        if variance.max().sqrt() < 1_f64.to_radians() {
            means.push(mean);
        }
    }
    Vector3::from_fn(|i, _| median(means.iter().map(|mean| mean[i]).collect()))
}

/// Soft and hard iron (microtesla) of a phone that was turned: the quadric through its uncalibrated
/// field by plain least squares, scaled to the local field's 47.06 microtesla.
pub(crate) fn ellipsoid(path: &Path) -> (Matrix3<f64>, Vector3<f64>) {
    let samples = read(path).0.uncalibrated.values;
    let size = samples.iter().map(|v| v.amax()).fold(0.0, f64::max);
    let rows = DMatrix::from_fn(samples.len(), 9, |row, column| {
        let v = samples[row] / size;
        [
            v.x * v.x,
            v.y * v.y,
            v.z * v.z,
            2.0 * v.x * v.y,
            2.0 * v.x * v.z,
            2.0 * v.y * v.z,
            2.0 * v.x,
            2.0 * v.y,
            2.0 * v.z,
        ][column]
    });
    let ones = DVector::from_element(samples.len(), 1.0);
    let p = rows.svd(true, true).solve(&ones, 1e-15).expect("a fit");
    let q = Matrix3::new(p[0], p[3], p[4], p[3], p[1], p[5], p[4], p[5], p[2]);
    let centre = -(q
        .lu()
        .solve(&Vector3::new(p[6], p[7], p[8]))
        .expect("a centre"));
    let shape = (q / (1.0 + centre.dot(&(q * centre)))).symmetric_eigen();
    let root = Matrix3::from_diagonal(&shape.eigenvalues.map(f64::sqrt));
    let soft = shape.eigenvectors * root * shape.eigenvectors.transpose() * (47.06 / size);
    (soft, centre * size)
}
