//! What the files of one draft say of each other: the accelerometer beside orientations, times that have nothing in common, and
//! whether a rate of rows is of use to any.

use nalgebra::Vector3;

use super::draft::Described;
use super::turns::{Series, median};
use crate::error::{RecordingError, Result};
use crate::metadata::BodyAxes;

/// Says which files have no time in common with the one of the gyroscope, or of the first sensor where there is none.
pub(super) fn other_times(files: &[Described]) -> Vec<String> {
    let timed = files.iter().filter(|file| !file.has_no_sensor());
    let timed = timed.filter_map(|file| Some((file, file.time.as_ref()?.span_s()?)));
    let timed: Vec<_> = timed.collect();
    let has_rates = |(file, _): &&(&Described, [f64; 2])| {
        file.sections.iter().any(|one| one.key == "gyroscope")
    };
    let Some((main, [from, to])) = timed.iter().find(has_rates).or(timed.first()) else {
        return Vec::new();
    };
    let apart = timed
        .iter()
        .filter(|(_, span)| span[0] > *to || span[1] < *from);
    let told = apart.map(|(file, [first, last])| {
        format!(
            "{} has times from {first:.3} to {last:.3} s, {} from {from:.3} to {to:.3} s: they have none in common. Put what is to be \
             added to the times of a source in it as `time_offset_s`.",
            file.name(),
            main.name()
        )
    });
    told.collect()
}

/// The accelerometer of the files, and its numbers over time.
pub(super) struct Forces {
    /// The file that has it.
    pub(super) file: usize,
    pub(super) columns: Vec<usize>,
    series: Series,
    /// Within so much of a time a sample is of it, s.
    near_s: f64,
    /// Whether its rows have stamps, by which rows of other files are found.
    pub(super) is_stamped: bool,
}

impl Forces {
    pub(super) fn of(files: &[Described]) -> Option<Self> {
        let section = |file: &Described| {
            let mut sections = file.sections.iter();
            let found = sections.find(|one| one.key == "accelerometer")?;
            Some(found.columns.clone())
        };
        let (file, columns) = files
            .iter()
            .enumerate()
            .find_map(|(place, file)| Some((place, section(file)?)))?;
        let series = files[file].series(&columns);
        let mut steps: Vec<f64> = series
            .windows(2)
            .map(|pair| pair[1].0 - pair[0].0)
            .collect();
        Some(Self {
            near_s: median(&mut steps),
            is_stamped: files[file].is_stamped(),
            file,
            columns,
            series,
        })
    }

    /// The body axes of a unit whose z points down, if z reads as that of one: a share of all samples has gravity against it.
    pub(super) fn body_axes(&self, files: &[Described]) -> Option<BodyAxes> {
        /// A vehicle may lean, and turn over now and then.
        const AGAINST: f64 = -0.7;
        const SHARE: f64 = 0.9;
        let has_axes = |file: &Described| {
            let is_orientation = |key| key == "reference" || key == "device_orientation";
            file.table.is_none() || file.sections.iter().any(|one| is_orientation(one.key))
        };
        if files.iter().any(has_axes) {
            return None;
        }
        let is_against = |(_, force): &&(f64, Vector3<f64>)| force.z < AGAINST * force.norm();
        let against = self.series.iter().filter(is_against).count();
        let share = against as f64 / self.series.len().max(1) as f64;
        (share > SHARE).then_some(BodyAxes::Frd)
    }

    /// The one nearest to a time.
    pub(super) fn at(&self, seconds: f64) -> Option<Vector3<f64>> {
        let behind = self.series.partition_point(|(t, _)| *t < seconds);
        let near = [behind.checked_sub(1), Some(behind)].into_iter().flatten();
        let near = near.filter_map(|place| self.series.get(place));
        let (t, force) =
            near.min_by(|a, b| (a.0 - seconds).abs().total_cmp(&(b.0 - seconds).abs()))?;
        ((t - seconds).abs() <= self.near_s).then_some(*force)
    }
}

/// Refuses a rate that no file had a use for.
pub(super) fn check_rate(files: &[Described], unused_hz: Option<f64>) -> Result<()> {
    let stamped = files.iter().find_map(|file| {
        let time = file.time.as_ref().filter(|time| !time.columns.is_empty())?;
        Some((file, file.table.as_ref()?.shown(*time.columns.first()?)))
    });
    let (Some(_), Some((file, column))) = (unused_hz, stamped) else {
        return Ok(());
    };
    Err(RecordingError::unsupported(
        file.path.display().to_string(),
        format!(
            "its rows have time stamps of their own, in column `{column}`, so a rate of rows has no effect; leave --rate out"
        ),
    ))
}
