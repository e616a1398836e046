//! Arrays of sensors as the events of a recording, so that they pass the checks that every file passes.

use std::iter::{Peekable, Zip};
use std::slice;
use std::sync::Arc;

use nalgebra::Vector3;
use northing_core::faults::sampling_clock::SamplingClock;
use northing_evaluation::attitude::{Instant, InstantSource, Instants, RunObserver, RunOptions};
use northing_evaluation::{EvaluationError, estimate, estimate_instants};
use northing_recording::plausibility::Plausibility;
use northing_recording::{
    Event, Metadata, OpenOptions, Recording, RecordingError, Sample, SensorKind, WorldFrame,
};
use numpy::{PyReadonlyArray1, PyReadonlyArray2};

/// What stands for arrays where a recording has its name.
pub(crate) const NAME: &str = "arrays";

/// What is known of arrays as a recording.
pub(crate) fn metadata(world_frame: WorldFrame) -> Metadata {
    Metadata {
        name: NAME.to_owned(),
        format: NAME.to_owned(),
        world_frame,
        ..Metadata::default()
    }
}

/// The samples of one sensor: stamps in ns and vectors.
pub(crate) struct Stream {
    time_ns: Arc<[i64]>,
    vectors: Vec<[f64; 3]>,
}

/// Stamps in ns, copied as [`Stream::of`] does.
pub(crate) fn stamps(time_ns: &PyReadonlyArray1<'_, i64>) -> Arc<[i64]> {
    match time_ns.as_slice() {
        Ok(stamps) => stamps.into(),
        Err(_) => time_ns.as_array().iter().copied().collect(),
    }
}

impl Stream {
    /// Copied, for another thread may change an array while the interpreter is free to run it.
    pub(crate) fn of(time_ns: Arc<[i64]>, vectors: &PyReadonlyArray2<'_, f64>) -> Self {
        let rows = vectors.as_array();
        let vectors = match rows.as_slice() {
            Some(numbers) => numbers.as_chunks().0.to_vec(),
            None => {
                let rows = rows.outer_iter();
                rows.map(|row| [row[0], row[1], row[2]]).collect()
            }
        };
        Self { time_ns, vectors }
    }
}

/// What vectors of a sensor are.
type MakeSample = fn(Vector3<f64>) -> Sample;

/// A sensor on its way into a recording.
struct Source {
    sample: MakeSample,
    stream: Arc<Stream>,
    /// The row that comes next.
    next: usize,
}

impl Source {
    fn new(sample: MakeSample, stream: &Arc<Stream>) -> Self {
        Self {
            sample,
            stream: Arc::clone(stream),
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

/// A sensor on its way into instants: rows that are still to come, stamp and vector.
struct Column<'a> {
    sensor: SensorKind,
    rows: Peekable<Zip<slice::Iter<'a, i64>, slice::Iter<'a, [f64; 3]>>>,
}

impl<'a> Column<'a> {
    fn new(sensor: SensorKind, stream: &'a Stream) -> Self {
        let rows = stream.time_ns.iter().zip(&stream.vectors).peekable();
        Self { sensor, rows }
    }
}

/// The instants of arrays as a recording of them would give them: each sensor's stamps increase and its samples are finite, so that of
/// a recording's checks those of the units are left.
struct Gathered<'a> {
    columns: Vec<Column<'a>>,
    plausibility: Plausibility,
}

impl Gathered<'_> {
    fn gather(&mut self, instant: &mut Instant) -> Result<bool, RecordingError> {
        let waiting = self.columns.iter_mut();
        let waiting = waiting.filter_map(|column| column.rows.peek().map(|(time_ns, _)| **time_ns));
        let Some(time_ns) = waiting.min() else {
            return self.plausibility.finish(NAME).map(|()| false);
        };
        instant.begin(time_ns);
        for Column { sensor, rows } in &mut self.columns {
            if let Some((_, vector)) = rows.next_if(|(row_ns, _)| **row_ns == time_ns) {
                let vector = (*vector).into();
                self.plausibility
                    .check_vector(time_ns, *sensor, &vector, NAME)?;
                instant.take_vector(*sensor, vector);
            }
        }
        Ok(true)
    }
}

impl InstantSource for Gathered<'_> {
    fn read(&mut self, instant: &mut Instant) -> Result<bool, EvaluationError> {
        self.gather(instant)
            .map_err(|error| EvaluationError::Recording(Box::new(error)))
    }
}

fn comes_in_bunches(stream: &Stream) -> bool {
    let mut clock = SamplingClock::<f64>::default();
    stream.time_ns.iter().any(|stamp| {
        clock.arrived(*stamp);
        clock.is_bunched()
    })
}

/// The samples of gyroscope, accelerometer and magnetometer, to be read as often as they are wanted.
pub(crate) struct Arrays {
    gyroscope: Arc<Stream>,
    accelerometer: Option<Arc<Stream>>,
    magnetometer: Option<Arc<Stream>>,
    world_frame: WorldFrame,
    options: OpenOptions,
    /// Whether samples of any of them are used at other times than their stamps: a recording sees to that.
    in_bunches: bool,
}

impl Arrays {
    /// The world of the reference and of the estimates.
    pub(crate) fn world_frame(&self) -> WorldFrame {
        self.world_frame
    }

    /// Of these streams, read with these options.
    pub(crate) fn new(
        gyroscope: Stream,
        accelerometer: Option<Stream>,
        magnetometer: Option<Stream>,
        world_frame: WorldFrame,
        options: OpenOptions,
    ) -> Self {
        let others = accelerometer.iter().chain(&magnetometer);
        // Stamps that all have in common are looked at once.
        let others = others.filter(|other| !Arc::ptr_eq(&other.time_ns, &gyroscope.time_ns));
        let in_bunches = [&gyroscope].into_iter().chain(others).any(comes_in_bunches);
        Self {
            in_bunches,
            gyroscope: Arc::new(gyroscope),
            accelerometer: accelerometer.map(Arc::new),
            magnetometer: magnetometer.map(Arc::new),
            world_frame,
            options,
        }
    }

    /// Runs an estimator over them and tells the observer what [`estimate`] does; how many estimates there were.
    ///
    /// # Errors
    /// Those of the run.
    pub(crate) fn estimate(
        &self,
        options: &RunOptions,
        observer: &mut dyn RunObserver,
    ) -> Result<u64, EvaluationError> {
        let asked = &self.options;
        let streams = [
            (SensorKind::Gyroscope, Some(&self.gyroscope)),
            (SensorKind::Accelerometer, self.accelerometer.as_ref()),
            (SensorKind::Magnetometer, self.magnetometer.as_ref()),
        ];
        let is_as_it_is = asked.gyroscope_unit.is_none()
            && asked.accelerometer_unit.is_none()
            && asked.magnetometer_unit.is_none()
            && options.magnetometer_calibration.is_none()
            && !self.in_bunches;
        if !is_as_it_is {
            return estimate(self.recording(), options, observer);
        }
        let columns = streams.into_iter();
        let columns = columns.filter_map(|(sensor, stream)| Some(Column::new(sensor, stream?)));
        let mut gathered = Gathered {
            columns: columns.collect(),
            plausibility: Plausibility::new(asked),
        };
        estimate_instants(&mut gathered, options, observer)
    }

    /// When the samples of the gyroscope were taken: their stamps, unless they come in bunches.
    pub(crate) fn stamps(&self) -> Arc<[i64]> {
        if !self.in_bunches {
            return Arc::clone(&self.gyroscope.time_ns);
        }
        // What is wrong with them the run itself says.
        let instants = Instants::new(self.recording()).map_while(Result::ok);
        let rates = instants.filter(|instant| instant.angular_rate.is_some());
        rates.map(|instant| instant.time_ns).collect()
    }

    /// As a recording.
    pub(crate) fn recording(&self) -> Recording {
        let mut sensors = vec![SensorKind::Gyroscope];
        let mut sources = vec![Source::new(Sample::AngularRate, &self.gyroscope)];
        if let Some(stream) = &self.accelerometer {
            sensors.push(SensorKind::Accelerometer);
            sources.push(Source::new(Sample::SpecificForce, stream));
        }
        if let Some(stream) = &self.magnetometer {
            sensors.push(SensorKind::Magnetometer);
            sources.push(Source::new(Sample::MagneticField, stream));
        }
        let metadata = metadata(self.world_frame);
        Recording::from_events(metadata, &sensors, Merged(sources), &self.options)
    }
}
