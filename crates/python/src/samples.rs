//! Arrays of sensors as the events of a recording, so that they pass the checks that every file passes.

use nalgebra::Vector3;
use northing_recording::{
    Event, Metadata, OpenOptions, Recording, RecordingError, Sample, SensorKind, WorldFrame,
};
use numpy::{PyReadonlyArray1, PyReadonlyArray2};

/// What stands for arrays where a recording has its name.
pub(crate) const NAME: &str = "arrays";

/// The samples of one sensor: stamps in ns and vectors.
pub(crate) struct Stream {
    time_ns: Vec<i64>,
    vectors: Vec<[f64; 3]>,
}

impl Stream {
    /// Copied, for another thread may change an array while the interpreter is free to run it.
    pub(crate) fn of(
        time_ns: &PyReadonlyArray1<'_, i64>,
        vectors: &PyReadonlyArray2<'_, f64>,
    ) -> Self {
        let rows = vectors.as_array();
        Self {
            time_ns: time_ns.as_array().to_vec(),
            vectors: rows
                .outer_iter()
                .map(|row| [row[0], row[1], row[2]])
                .collect(),
        }
    }

    /// The stamps.
    pub(crate) fn stamps(&self) -> &[i64] {
        &self.time_ns
    }
}

/// Up to three sensors, merged by their stamps.
struct Merged {
    streams: Vec<(fn(Vector3<f64>) -> Sample, Stream, usize)>,
}

impl Iterator for Merged {
    type Item = Result<Event, RecordingError>;

    fn next(&mut self) -> Option<Self::Item> {
        let next_ns = |(_, stream, at): &(_, Stream, usize)| stream.time_ns.get(*at).copied();
        let waiting = self.streams.iter_mut();
        let waiting = waiting.filter_map(|stream| Some((next_ns(stream)?, stream)));
        // Of equal stamps the first: the gyroscope, then the accelerometer.
        let (time_ns, (sample, stream, at)) = waiting.min_by_key(|(time_ns, _)| *time_ns)?;
        let vector = stream.vectors[*at];
        *at += 1;
        Some(Ok(Event {
            time_ns,
            sample: sample(vector.into()),
        }))
    }
}

/// The recording of gyroscope, accelerometer and magnetometer.
pub(crate) fn recording(
    gyroscope: Stream,
    accelerometer: Option<Stream>,
    magnetometer: Option<Stream>,
    world_frame: WorldFrame,
    options: &OpenOptions,
) -> Recording {
    let mut sensors = vec![SensorKind::Gyroscope];
    let mut streams: Vec<(fn(Vector3<f64>) -> Sample, Stream, usize)> =
        vec![(Sample::AngularRate, gyroscope, 0)];
    if let Some(stream) = accelerometer {
        sensors.push(SensorKind::Accelerometer);
        streams.push((Sample::SpecificForce, stream, 0));
    }
    if let Some(stream) = magnetometer {
        sensors.push(SensorKind::Magnetometer);
        streams.push((Sample::MagneticField, stream, 0));
    }
    let metadata = Metadata {
        name: NAME.to_owned(),
        format: NAME.to_owned(),
        world_frame,
        ..Metadata::default()
    };
    Recording::from_events(metadata, &sensors, Merged { streams }, options)
}
