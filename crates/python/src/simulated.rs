//! Recordings of virtual phones and vehicles: samples as arrays, with the truth beside them, or as a file.

use std::path::PathBuf;

use northing_core::geometry::rotation;
use northing_experiments::navigation_worlds::{events, world_frame};
use northing_recording::{Event, Metadata, Sample, SensorKind, WorldFrame, create};
use northing_simulation::navigation_world::{NavigationWorld, WorldClass};
use northing_simulation::virtual_phone::{Disturbance, Motion};
use northing_simulation::{VirtualPhone, VirtualPhoneConfig};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::attitude_run::{push_vector, rows};
use crate::errors::{of_recording, refused};

/// The longest recording that is kept in memory, s: a day.
const LONGEST_S: f64 = 86_400.0;

/// Columns of numbers, each of rows of one width.
struct Column {
    name: &'static str,
    width: usize,
    values: Vec<f64>,
}

/// A recording that was simulated.
#[pyclass(frozen, module = "northing._northing")]
pub(crate) struct VirtualRecording {
    metadata: Metadata,
    events: Vec<Event>,
    sensors: Vec<SensorKind>,
    description: String,
    /// Of the vehicle.
    world: Option<NavigationWorld>,
}

fn one_of<T: Copy>(
    argument: &str,
    name: &str,
    all: &[T],
    of: fn(T) -> &'static str,
) -> PyResult<T> {
    let known = all.iter().copied().find(|one| of(*one) == name);
    known.ok_or_else(|| {
        let names: Vec<&str> = all.iter().map(|one| of(*one)).collect();
        refused(format!(
            "{argument}=\"{name}\": expected one of {}",
            names.join(", ")
        ))
    })
}

fn check_duration(seconds: f64) -> PyResult<f64> {
    let good = seconds > 0.0 && seconds <= LONGEST_S;
    good.then_some(seconds).ok_or_else(|| {
        refused(format!(
            "duration={seconds}: expected seconds, above 0 and up to a day"
        ))
    })
}

#[pymethods]
impl VirtualRecording {
    /// A phone, as `northing demo --record-only` has it.
    #[staticmethod]
    fn phone(
        py: Python<'_>,
        seed: u64,
        duration: Option<f64>,
        motion: &str,
        disturbance: &str,
    ) -> PyResult<Self> {
        let config = VirtualPhoneConfig {
            seed,
            duration_s: duration.map(check_duration).transpose()?,
            motion: one_of("motion", motion, &Motion::ALL, Motion::name)?,
            disturbance: one_of(
                "disturbance",
                disturbance,
                &Disturbance::ALL,
                Disturbance::name,
            )?,
            ..VirtualPhoneConfig::default()
        };
        let phone = VirtualPhone::new(config).map_err(|error| refused(error.to_string()))?;
        Ok(Self {
            metadata: phone.metadata(),
            events: py.detach(|| phone.events().collect()),
            sensors: vec![
                SensorKind::Gyroscope,
                SensorKind::Accelerometer,
                SensorKind::Magnetometer,
                SensorKind::DeviceOrientation,
                SensorKind::Reference,
            ],
            description: format!("a phone, {motion}, disturbance {disturbance}, seed {seed}"),
            world: None,
        })
    }

    /// A vehicle with inertial unit and receiver.
    #[staticmethod]
    fn vehicle(
        py: Python<'_>,
        kind: &str,
        seed: u64,
        duration: Option<f64>,
        faults: bool,
    ) -> PyResult<Self> {
        let class = one_of("kind", kind, &WorldClass::ALL, WorldClass::name)?;
        let number = WorldClass::ALL.iter().position(|one| *one == class);
        let number = number.unwrap_or_default() as u64;
        if faults && duration.is_some() {
            return Err(refused(
                "duration: a vehicle with faults has a duration of its own; leave it out",
            ));
        }
        let seconds = check_duration(duration.unwrap_or(180.0))?;
        let (world, events) = py.detach(|| {
            let world = match faults {
                true => NavigationWorld::draw(seed, number),
                false => NavigationWorld::draw_healthy(seed, number, seconds),
            };
            let events = events(&world);
            (world, events)
        });
        let mut sensors = vec![
            SensorKind::Gyroscope,
            SensorKind::Accelerometer,
            SensorKind::GnssPosition,
            SensorKind::ReferencePosition,
        ];
        if world.description.receiver.velocity_std_m_s.is_some() {
            sensors.push(SensorKind::GnssVelocity);
        }
        Ok(Self {
            metadata: Metadata {
                name: format!("{kind} {seed}"),
                world_frame: WorldFrame::Ned,
                ..Metadata::default()
            },
            events,
            sensors,
            description: world.description.to_string(),
            world: Some(world),
        })
    }

    /// What it is, in words.
    #[getter]
    fn description(&self) -> &str {
        &self.description
    }

    /// Its world frame.
    #[getter]
    fn frame(&self) -> String {
        self.metadata.world_frame.name().to_lowercase()
    }

    /// Samples and truth by name, rows of three or four numbers; the stamps of each under its name with `_time_ns`.
    fn arrays<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let arrays = PyDict::new(py);
        for (name, stamps, columns) in self.tables() {
            arrays.set_item(format!("{name}_time_ns"), PyArray1::from_vec(py, stamps))?;
            for Column {
                name,
                width,
                values,
            } in columns
            {
                let array = rows(py, values, width)?;
                arrays.set_item(name, array)?;
            }
        }
        Ok(arrays)
    }

    /// Writes it, by extension: .csv, .parquet or .mcap.
    fn save(&self, py: Python<'_>, path: PathBuf, force: bool) -> PyResult<()> {
        py.detach(|| {
            let mut writer = create(&path, &self.metadata, &self.sensors, force)?;
            self.events
                .iter()
                .try_for_each(|event| writer.write(event))?;
            writer.finish()
        })
        .map_err(|error| of_recording(&error))
    }
}

impl VirtualRecording {
    fn tables(&self) -> Vec<(&'static str, Vec<i64>, Vec<Column>)> {
        let mut tables: Vec<(&'static str, Vec<i64>, Vec<Column>)> = Vec::new();
        let table = |name: &'static str, columns: &[(&'static str, usize)]| {
            let column = |(name, width): &(&'static str, usize)| Column {
                name,
                width: *width,
                values: Vec::new(),
            };
            (name, Vec::new(), columns.iter().map(column).collect())
        };
        let mut of = [
            table("gyr", &[("gyr", 3)]),
            table("acc", &[("acc", 3)]),
            table("mag", &[("mag", 3)]),
            table("device_quat", &[("device_quat", 4)]),
            table(
                "gnss",
                &[("gnss_geodetic", 3), ("gnss_ned", 3), ("gnss_std", 3)],
            ),
            table(
                "gnss_velocity",
                &[("gnss_velocity", 3), ("gnss_velocity_std", 3)],
            ),
            table("true", &[("true_quat", 4)]),
        ];
        let frame = world_frame();
        let three = |values: Option<[f64; 3]>| values.unwrap_or([f64::NAN; 3]);
        for event in &self.events {
            let (at, numbers): (usize, Vec<Vec<f64>>) = match &event.sample {
                Sample::AngularRate(v) => (0, vec![v.as_slice().to_vec()]),
                Sample::SpecificForce(v) => (1, vec![v.as_slice().to_vec()]),
                Sample::MagneticField(v) => (2, vec![v.as_slice().to_vec()]),
                Sample::DeviceOrientation(q) => (3, vec![rotation::to_wxyz(q).to_vec()]),
                Sample::GnssPosition(fix) => {
                    let place = northing_core::earth::Geodetic {
                        latitude_rad: fix.latitude_rad,
                        longitude_rad: fix.longitude_rad,
                        height_m: fix.height_m.unwrap_or(0.0),
                    };
                    let [latitude, longitude] = place.degrees();
                    let geodetic = vec![latitude, longitude, place.height_m];
                    let ned = frame.ned(&place).as_slice().to_vec();
                    (4, vec![geodetic, ned, three(fix.std_m).to_vec()])
                }
                Sample::GnssVelocity(v) => {
                    let ned = vec![v.north_m_s, v.east_m_s, v.down_m_s.unwrap_or(f64::NAN)];
                    (5, vec![ned, three(v.std_m_s).to_vec()])
                }
                Sample::Reference(truth) => (6, vec![rotation::to_wxyz(&truth.attitude).to_vec()]),
                _ => continue,
            };
            let (_, stamps, columns): &mut (&str, Vec<i64>, Vec<Column>) = &mut of[at];
            stamps.push(event.time_ns);
            for (column, numbers) in columns.iter_mut().zip(numbers) {
                column.values.extend(numbers);
            }
        }
        tables.extend(of.into_iter().filter(|(_, stamps, _)| !stamps.is_empty()));
        tables.extend(self.world.as_ref().map(truth_of));
        tables
    }
}

/// Where the vehicle truly was at every inertial sample.
fn truth_of(world: &NavigationWorld) -> (&'static str, Vec<i64>, Vec<Column>) {
    let names = ["true_ned", "true_velocity", "true_antenna_ned"];
    let mut columns = names.map(|name| Column {
        name,
        width: 3,
        values: Vec::new(),
    });
    let mut quat = Vec::new();
    for sample in &world.samples {
        let vectors = [&sample.position, &sample.velocity, &sample.antenna];
        for (column, vector) in columns.iter_mut().zip(vectors) {
            push_vector(&mut column.values, Some(vector));
        }
        quat.extend(rotation::to_wxyz(&sample.ned_from_unit));
    }
    let quat = Column {
        name: "true_quat",
        width: 4,
        values: quat,
    };
    let stamps = world.samples.iter().map(|sample| sample.stamp_ns).collect();
    ("true", stamps, columns.into_iter().chain([quat]).collect())
}
