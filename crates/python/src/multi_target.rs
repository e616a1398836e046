//! The multi-target tracker scan by scan, the tracker of `northing track`: its settings follow from the sensors as there.

use std::collections::BTreeMap;

use northing_core::tracking::{Scan, SensorScale};
use northing_evaluation::Origin;
use northing_evaluation::tracking::{
    FollowedTrack, ScanTracker, SensorLooks, TargetAssociation, TrackOptions, TrackerKind,
};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::errors::refused;
use crate::scan_sensor::ScanSensor;
use crate::target_tracks::{ScanRecord, TargetTrack};
use crate::tracking_stream::OwnShip;

/// The name of the only sensor.
const SENSOR: &str = "sensor";

type Sensors = BTreeMap<String, ScanSensor>;

/// Sensors, tracker, parameters and state of a tracker.
type Pickled = (Sensors, &'static str, Vec<String>, String);

/// One sensor, or several by name.
#[derive(FromPyObject)]
enum Given {
    One(ScanSensor),
    Named(Sensors),
}

/// Everything that the next scan depends on, but for sensors and parameters.
#[derive(Serialize, Deserialize)]
struct State {
    start_ns: Option<i64>,
    time_ns: Option<i64>,
    tracker: Value,
    associations: Vec<TargetAssociation>,
}

/// Many targets in clutter, seen from a ship whose own pose is uncertain.
#[pyclass(module = "northing._northing")]
pub(crate) struct MultiTarget {
    sensors: Sensors,
    options: TrackOptions,
    tracker: ScanTracker,
    /// From which seconds count.
    start_ns: Option<i64>,
    /// Of the last scan that was used.
    time_ns: Option<i64>,
    tracks: Vec<FollowedTrack>,
}

/// How the sensor that starts tracks sees the scene.
fn scale(sensors: &Sensors) -> PyResult<SensorScale<f64>> {
    let looks: Vec<SensorLooks> = sensors.values().map(ScanSensor::looks).collect();
    let Some(scale) = SensorLooks::scale(&looks) else {
        let mut starting = sensors.iter().filter(|(_, s)| s.looks().starts_tracks());
        return Err(refused(match starting.next() {
            None => {
                "no sensor starts tracks: one needs initiates=True and detections with a place, \
                     range_std= or extent_std= above 0"
                    .to_owned()
            }
            Some((name, sensor)) if sensor.looks().scan_interval_s.is_none() => format!(
                "`{name}` starts tracks: how often does it look? give scan_interval=, the seconds from one look at a \
                 target to the next"
            ),
            Some((name, _)) => format!(
                "`{name}` starts tracks: how far does it see? give largest_range=, beyond which it detects nothing, or \
                 typical_range=, within which nearly all of its detections lie, m"
            ),
        }));
    };
    let fits = scale.motion().is_some() && scale.settings().is_some();
    fits.then_some(scale).ok_or_else(|| {
        refused(format!(
            "no settings follow from scan_interval={}, a standard deviation of {} m and a range of {} m: one of them is \
             too small or too large for a sensor",
            scale.scan_interval_s, scale.position_std_m, scale.range_m
        ))
    })
}

/// `NAME=VALUE` of an argument; in Python `existence_lifetime_s` is `existence.lifetime_s`.
fn setting(options: &TrackOptions, name: &str, value: &Bound<'_, PyAny>) -> PyResult<String> {
    let text = if let Ok(flag) = value.extract::<bool>() {
        flag.to_string()
    } else {
        let number: PyResult<f64> = value.extract();
        number
            .map_err(|_| PyTypeError::new_err(format!("{name}={value}: expected a number")))?
            .to_string()
    };
    let known = options.parameters();
    let meant = known.iter().find(|one| one.name.replace('.', "_") == name);
    let name = meant.map_or(name, |one| &one.name);
    Ok(format!("{name}={text}"))
}

impl MultiTarget {
    /// With these settings, and those that follow from the sensors.
    fn made<'a>(
        sensors: Sensors,
        mut options: TrackOptions,
        settings: impl IntoIterator<Item = &'a String>,
    ) -> PyResult<Self> {
        let bad = |error: northing_evaluation::EvaluationError| refused(error.to_string());
        for setting in settings {
            options.set_from(setting, Origin::Set).map_err(bad)?;
        }
        let options = options.derived(Some(scale(&sensors)?));
        let tracker = ScanTracker::new(options.config(), 0).map_err(bad)?;
        Ok(Self {
            sensors,
            options,
            tracker,
            start_ns: None,
            time_ns: None,
            tracks: Vec::new(),
        })
    }

    fn sensor(&self, name: Option<&str>) -> PyResult<(String, ScanSensor)> {
        let mut all = self.sensors.iter();
        let found = match name {
            Some(name) => self.sensors.get_key_value(name),
            None => all.next().filter(|_| all.next().is_none()),
        };
        let names = || self.sensors.keys().cloned().collect::<Vec<_>>().join(", ");
        let found = found.ok_or_else(|| match name {
            Some(name) => refused(format!("sensor=\"{name}\": expected one of {}", names())),
            None => refused(format!("sensor= is missing: which one looked? {}", names())),
        });
        found.map(|(name, sensor)| (name.clone(), *sensor))
    }
}

#[pymethods]
impl MultiTarget {
    #[new]
    #[pyo3(signature = (sensors, *, tracker="schmidt", start_ns=None, **parameters))]
    fn new(
        sensors: Given,
        tracker: &str,
        start_ns: Option<i64>,
        parameters: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let sensors = match sensors {
            Given::One(sensor) => Sensors::from([(SENSOR.to_owned(), sensor)]),
            Given::Named(sensors) => sensors,
        };
        let tracker: TrackerKind = tracker.parse().map_err(|error: String| refused(error))?;
        let options = TrackOptions {
            tracker,
            ..TrackOptions::default()
        };
        let each = parameters.into_iter().flatten();
        let settings =
            each.map(|(name, value)| setting(&options, &name.extract::<String>()?, &value));
        let settings: Vec<String> = settings.collect::<PyResult<_>>()?;
        let made = Self::made(sensors, options, &settings)?;
        Ok(Self { start_ns, ..made })
    }

    /// Takes everything that one sensor reports at one instant, seen from this pose.
    #[pyo3(signature = (time_ns, detections, own, *, sensor=None))]
    fn update(
        &mut self,
        py: Python<'_>,
        time_ns: i64,
        detections: Option<&Bound<'_, PyAny>>,
        own: OwnShip,
        sensor: Option<&str>,
    ) -> PyResult<ScanRecord> {
        let (name, sensor) = self.sensor(sensor)?;
        let mut own = own.0;
        if self.options.tracker == TrackerKind::Uncompensated {
            own.covariance.fill(0.0);
        }
        let detections = sensor.detections(detections, &own)?;
        let start_ns = *self.start_ns.get_or_insert(time_ns);
        let scan = Scan {
            time_s: time_ns.saturating_sub(start_ns) as f64 * 1e-9,
            sensor: &sensor.sensor(),
            own_ship: &own,
            detections: &detections,
        };
        let tracker = &mut self.tracker;
        let (taken, tracks) = py
            .detach(|| {
                tracker.make_room(detections.len())?;
                let taken = tracker.scan(&scan);
                let tracks = taken.is_ok().then(|| tracker.tracks());
                Ok((taken, tracks))
            })
            .map_err(|error: northing_evaluation::EvaluationError| refused(error.to_string()))?;
        let mut ended = Vec::new();
        if let Some(tracks) = tracks {
            self.tracks = tracks;
            self.time_ns = Some(time_ns);
            ended = self.tracker.ended();
        }
        Ok(ScanRecord {
            time_ns,
            sensor: name,
            error: taken.err(),
            tracks: self.tracks.clone(),
            ended,
        })
    }

    /// Every track after the last scan that was used, tentative ones too.
    #[getter]
    fn tracks(&self) -> Vec<TargetTrack> {
        self.tracks.iter().copied().map(TargetTrack).collect()
    }

    /// Stamp of that scan, ns.
    #[getter]
    fn time_ns(&self) -> Option<i64> {
        self.time_ns
    }

    /// The sensors by name.
    #[getter]
    fn sensors(&self) -> Sensors {
        self.sensors.clone()
    }

    /// `schmidt`, `converted` or `uncompensated`.
    #[getter]
    fn tracker(&self) -> &'static str {
        self.options.tracker.name()
    }

    /// Every parameter with its value, those that followed from the sensors too.
    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        for used in self.options.parameters() {
            match used.value.as_bool() {
                Some(flag) => dict.set_item(used.name, flag)?,
                None => dict.set_item(used.name, used.value.as_f64())?,
            }
        }
        Ok(dict)
    }

    /// What was used and what was refused so far.
    #[getter]
    fn counts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let counts = serde_json::to_value(self.tracker.counts());
        let counts = counts.map_err(|error| refused(error.to_string()))?;
        let dict = PyDict::new(py);
        for (name, count) in counts.as_object().into_iter().flatten() {
            dict.set_item(name, count.as_u64())?;
        }
        Ok(dict)
    }

    /// Everything that the next scan depends on, but for sensors and parameters.
    #[getter]
    fn state(&self) -> PyResult<String> {
        let tracker = self.tracker.save();
        let each = self.tracks.iter();
        let state = State {
            start_ns: self.start_ns,
            time_ns: self.time_ns,
            tracker: tracker.map_err(|error| refused(error.to_string()))?,
            associations: each.map(|track| track.target.association).collect(),
        };
        serde_json::to_string(&state).map_err(|error| refused(error.to_string()))
    }

    /// Continues from a saved state.
    #[setter]
    fn set_state(&mut self, state: &str) -> PyResult<()> {
        let state: State =
            serde_json::from_str(state).map_err(|error| refused(format!("state: {error}")))?;
        let tracker = ScanTracker::restored(self.options.config(), state.tracker)
            .map_err(|error| refused(error.to_string()))?;
        let mut tracks = tracker.tracks();
        if tracks.len() != state.associations.len() {
            return Err(refused("state: its associations are not of its tracks"));
        }
        for (track, association) in tracks.iter_mut().zip(state.associations) {
            track.target.association = association;
        }
        (self.start_ns, self.time_ns) = (state.start_ns, state.time_ns);
        (self.tracker, self.tracks) = (tracker, tracks);
        Ok(())
    }

    fn __repr__(&self) -> String {
        let sensors: Vec<&str> = self.sensors.keys().map(String::as_str).collect();
        format!(
            "<MultiTarget {} of {}: {} tracks>",
            self.tracker(),
            sensors.join(", "),
            self.tracks.len()
        )
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Pickled)> {
        let own = slf.borrow();
        let parameters = own.options.parameters();
        let setting = |used: &northing_evaluation::UsedParameter| {
            format!("{}={}", used.name, used.value_text())
        };
        let parts = (
            own.sensors.clone(),
            own.tracker(),
            parameters.iter().map(setting).collect(),
            own.state()?,
        );
        Ok((slf.get_type().getattr("_continued")?, parts))
    }

    #[staticmethod]
    fn _continued(
        sensors: Sensors,
        tracker: &str,
        settings: Vec<String>,
        state: &str,
    ) -> PyResult<Self> {
        let options = TrackOptions {
            tracker: tracker.parse().map_err(|error: String| refused(error))?,
            ..TrackOptions::default()
        };
        let mut made = Self::made(sensors, options, &settings)?;
        made.set_state(state)?;
        Ok(made)
    }
}
