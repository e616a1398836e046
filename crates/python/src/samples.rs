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

/// A sensor on its way into a recording.
struct Source {
    sample: fn(Vector3<f64>) -> Sample,
    stream: Stream,
    /// The row that comes next.
    next: usize,
}

impl Source {
    fn new(sample: fn(Vector3<f64>) -> Sample, stream: Stream) -> Self {
        Self {
            sample,
            stream,
            next: 0,
        }
    }

    fn next_ns(&self) -> Option<i64> {
        self.stream.time_ns.get(self.next).copied()
    }
}

/// Up to three sensors, merged by their stamps.
struct Merged(Vec<Source>);

impl Iterator for Merged {
    type Item = Result<Event, RecordingError>;

    fn next(&mut self) -> Option<Self::Item> {
        let waiting = self.0.iter_mut();
        let waiting = waiting.filter_map(|source| Some((source.next_ns()?, source)));
        // Of equal stamps the first: the gyroscope, then the accelerometer.
        let (time_ns, source) = waiting.min_by_key(|(time_ns, _)| *time_ns)?;
        let vector = source.stream.vectors[source.next];
        source.next += 1;
        Some(Ok(Event {
            time_ns,
            sample: (source.sample)(vector.into()),
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
    let mut sources = vec![Source::new(Sample::AngularRate, gyroscope)];
    if let Some(stream) = accelerometer {
        sensors.push(SensorKind::Accelerometer);
        sources.push(Source::new(Sample::SpecificForce, stream));
    }
    if let Some(stream) = magnetometer {
        sensors.push(SensorKind::Magnetometer);
        sources.push(Source::new(Sample::MagneticField, stream));
    }
    let metadata = Metadata {
        name: NAME.to_owned(),
        format: NAME.to_owned(),
        world_frame,
        ..Metadata::default()
    };
    Recording::from_events(metadata, &sensors, Merged(sources), options)
}
