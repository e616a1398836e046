//! Navigation over arrays: inertial samples and fixes as the events of a recording, so that they pass the checks that every file passes.

use nalgebra::Vector3;
use northing_recording::{Event, GnssPosition, GnssVelocity, Sample, SensorKind, WorldFrame};
use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::attitude::Reading;
use crate::navigation_run::{NavigationRun, Source};
use crate::recordings::AskedNavigation;
use crate::samples;

/// Stamps in ns, and rows.
type Samples<'py> = (PyReadonlyArray1<'py, i64>, PyReadonlyArray2<'py, f64>);

/// What is measured: rows of three numbers each, of fixes and velocities six.
#[derive(FromPyObject)]
pub(crate) struct Measured<'py> {
    gyroscope: Samples<'py>,
    accelerometer: Samples<'py>,
    magnetometer: Option<Samples<'py>>,
    /// Latitude and longitude, deg, height, m, and standard deviations north, east and down, m; NaN for what is not known.
    fixes: Samples<'py>,
    /// North, east, down, m/s, and standard deviations; NaN for what is not known.
    velocities: Option<Samples<'py>>,
}

/// Runs a navigation estimator over arrays.
///
/// # Errors
/// What is refused of arrays and options, as `ValueError`.
#[pyfunction]
pub(crate) fn navigation(
    py: Python<'_>,
    measured: Measured<'_>,
    estimator: &str,
    smooth: bool,
    settings: Vec<String>,
    asked: AskedNavigation,
    reading: Reading,
) -> PyResult<NavigationRun> {
    let reading = reading.options()?;
    let metadata = samples::metadata(WorldFrame::Ned);
    let options = asked.options(estimator, smooth, &settings, &metadata)?;
    let (events, sensors) = measured.events();
    NavigationRun::new(py, Source::Arrays(events.into(), sensors), reading, options)
}

impl Measured<'_> {
    /// In the order of time, of one instant inertial samples first; and the sensors that there are.
    fn events(&self) -> (Vec<Event>, Vec<SensorKind>) {
        type Make = fn(&[f64]) -> Sample;
        let columns: [(SensorKind, Option<&Samples<'_>>, Make); 5] = [
            (SensorKind::Gyroscope, Some(&self.gyroscope), |row| {
                Sample::AngularRate(Vector3::from_column_slice(row))
            }),
            (
                SensorKind::Accelerometer,
                Some(&self.accelerometer),
                |row| Sample::SpecificForce(Vector3::from_column_slice(row)),
            ),
            (
                SensorKind::Magnetometer,
                self.magnetometer.as_ref(),
                |row| Sample::MagneticField(Vector3::from_column_slice(row)),
            ),
            (SensorKind::GnssPosition, Some(&self.fixes), position),
            (SensorKind::GnssVelocity, self.velocities.as_ref(), velocity),
        ];
        let (mut events, mut sensors) = (Vec::new(), Vec::new());
        for (kind, samples, make) in columns {
            let Some((stamps, rows)) = samples else {
                continue;
            };
            sensors.push(kind);
            let rows = rows.as_array();
            let each = stamps.as_array().into_iter().zip(rows.outer_iter());
            events.extend(each.map(|(time_ns, row)| Event {
                time_ns: *time_ns,
                sample: make(&row.to_vec()),
            }));
        }
        events.sort_by_key(|event| event.time_ns);
        (events, sensors)
    }
}

fn stated(std: &[f64]) -> Option<[f64; 3]> {
    let [north, east, down] = std.try_into().ok()?;
    // Without a vertical one there is nothing vertical, and it is not used.
    let down = known(down).unwrap_or(f64::max(north, east));
    [north, east, down]
        .iter()
        .all(|std| std.is_finite())
        .then_some([north, east, down])
}

fn known(number: f64) -> Option<f64> {
    number.is_finite().then_some(number)
}

fn position(row: &[f64]) -> Sample {
    Sample::GnssPosition(GnssPosition {
        latitude_rad: row[0].to_radians(),
        longitude_rad: row[1].to_radians(),
        height_m: known(row[2]),
        std_m: stated(&row[3..]),
        ..GnssPosition::default()
    })
}

fn velocity(row: &[f64]) -> Sample {
    Sample::GnssVelocity(GnssVelocity {
        north_m_s: row[0],
        east_m_s: row[1],
        down_m_s: known(row[2]),
        std_m_s: stated(&row[3..]),
    })
}
