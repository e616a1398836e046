//! The Schmidt-Kalman tracker scan by scan, beside a pose with its covariance or a GNSS/INS.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use nalgebra::{Matrix3, SMatrix, Vector3};
use northing_core::Restorable;
use northing_core::kalman::{Innovation as CoreInnovation, NavigationPose, SkipReason};
use northing_core::navigation::ERRORS;
use northing_core::tracking::initiation::one_point;
use northing_core::tracking::own_ship::PoseErrorCorrelation;
use northing_core::tracking::{
    BlackBoxSchmidt, ConstantVelocity, Coupling, OwnShip as CoreOwnShip, RadarDetection,
    RadarNoise, SchmidtKalman as CoreSchmidtKalman, TrackEstimate, TrackerConfig,
};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::errors::refused;
use crate::navigation_stream::{Follower, GnssIns};
use crate::streams::Innovation;

/// Pose of the own ship with the covariance of its error.
#[pyclass(frozen, module = "northing._northing", from_py_object)]
#[derive(Clone, Copy)]
pub(crate) struct OwnShip(pub(crate) CoreOwnShip<f64>);

#[pymethods]
impl OwnShip {
    #[new]
    #[pyo3(signature = (north, east, heading, *, std=None, covariance=None))]
    fn new(
        north: f64,
        east: f64,
        heading: f64,
        std: Option<[f64; 3]>,
        covariance: Option<[[f64; 3]; 3]>,
    ) -> PyResult<Self> {
        let exact = CoreOwnShip::exact(north, east, heading);
        let ship = match (std, covariance) {
            (Some(_), Some(_)) => return Err(refused("give std or covariance, not both")),
            (None, None) => {
                return Err(refused(
                    "how well is the pose known? give std=(north, east, heading) in m, m and rad, or covariance=; \
                     std=(0, 0, 0) where it is exact",
                ));
            }
            (Some([north, east, heading]), None) => exact.with_std(north, east, heading),
            (None, Some(rows)) => CoreOwnShip {
                covariance: Matrix3::from(rows).transpose(),
                ..exact
            },
        };
        ship.is_valid().then_some(Self(ship)).ok_or_else(|| {
            refused(
                "no pose of a ship: expected north and east in m, heading in rad, and a covariance that is symmetric \
                 and positive semidefinite",
            )
        })
    }

    /// North, east, m, and heading, rad clockwise from north.
    #[getter]
    fn pose<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.vector().as_slice())
    }

    /// Covariance of its error.
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        square(py, &self.0.covariance)
    }
}

impl OwnShip {
    fn vector(&self) -> Vector3<f64> {
        Vector3::new(self.0.north_m, self.0.east_m, self.0.heading_rad)
    }
}

/// Row by row.
fn square<'py, const R: usize, const C: usize>(
    py: Python<'py>,
    matrix: &SMatrix<f64, R, C>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let rows = matrix.transpose();
    PyArray1::from_slice(py, rows.as_slice()).reshape([R, C])
}

/// What the detections are measured from.
#[derive(FromPyObject)]
enum Own {
    Pose(OwnShip),
    Filter(Py<GnssIns>),
}

/// The tracker, by what is known of the own ship.
enum Tracker {
    /// Its pose with a covariance.
    BlackBox(Box<BlackBoxSchmidt<f64>>),
    /// Its navigation filter, all of whose errors are followed.
    Follows(Arc<Follower>, Py<GnssIns>),
}

/// What the tracker was made with; a part of its pickle.
#[derive(Clone, Serialize, Deserialize)]
struct Settings {
    config: TrackerConfig<f64>,
    coupling: Coupling,
    memory: PoseErrorCorrelation<f64>,
}

/// Everything that the next step depends on, but for the own ship's filter.
#[derive(Serialize, Deserialize)]
struct State {
    time_ns: i64,
    settings: Settings,
    tracker: Value,
}

/// A tracker's state as text, and the filter that it follows.
type Pickled = (String, Option<Py<GnssIns>>);

/// One target seen by radar from a ship whose own pose is uncertain.
#[pyclass(module = "northing._northing")]
pub(crate) struct SchmidtKalman {
    time_ns: i64,
    settings: Settings,
    tracker: Tracker,
}

fn locked(follower: &Follower) -> MutexGuard<'_, CoreSchmidtKalman<f64, ERRORS>> {
    follower.lock().unwrap_or_else(PoisonError::into_inner)
}

fn coupling(word: &str) -> PyResult<Coupling> {
    match word {
        "exact" => Ok(Coupling::Exact),
        "feed-forward" => Ok(Coupling::FeedForward),
        "open-loop" => Ok(Coupling::OpenLoop),
        other => Err(refused(format!(
            "coupling=\"{other}\": expected exact, feed-forward or open-loop"
        ))),
    }
}

/// Seconds from one stamp to a later one.
fn seconds(from_ns: i64, to_ns: i64) -> f64 {
    to_ns.saturating_sub(from_ns) as f64 * 1e-9
}

impl SchmidtKalman {
    fn estimate(&self) -> TrackEstimate<f64> {
        match &self.tracker {
            Tracker::BlackBox(tracker) => tracker.track(),
            Tracker::Follows(follower, _) => locked(follower).track(),
        }
    }

    fn predict(&mut self, dt: f64) -> Result<(), SkipReason> {
        match &mut self.tracker {
            Tracker::BlackBox(tracker) => tracker.predict(dt),
            Tracker::Follows(follower, _) => locked(follower).predict(dt),
        }
    }
}

#[pymethods]
impl SchmidtKalman {
    /// Starts a track from its first detection.
    #[new]
    #[pyo3(signature = (time_ns, range, bearing, own, *, range_std, bearing_std, acceleration_std, velocity_std,
        gate_nis=0.0, coupling="exact", position_correlation_s=300.0, heading_correlation_s=1e4))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments of Python")]
    fn new(
        py: Python<'_>,
        time_ns: i64,
        range: f64,
        bearing: f64,
        own: Own,
        range_std: f64,
        bearing_std: f64,
        acceleration_std: f64,
        velocity_std: f64,
        gate_nis: f64,
        coupling: &str,
        position_correlation_s: f64,
        heading_correlation_s: f64,
    ) -> PyResult<Self> {
        let (motion, radar) = (
            ConstantVelocity::new(acceleration_std),
            RadarNoise::new(range_std, bearing_std),
        );
        let config = TrackerConfig {
            gate_nis,
            ..TrackerConfig::new(motion, radar)
        };
        let memory = PoseErrorCorrelation {
            position_s: position_correlation_s,
            heading_s: heading_correlation_s,
        };
        let settings = Settings {
            config,
            coupling: self::coupling(coupling)?,
            memory,
        };
        let bad = |error: northing_core::ConfigError| refused(error.to_string());
        config.validate().map_err(bad)?;
        let seen = RadarDetection::new(range, bearing);
        let first = |reason: SkipReason| {
            refused(format!(
                "the first detection, range={range} m and bearing={bearing} rad: {}",
                reason.description()
            ))
        };
        let tracker = match own {
            Own::Pose(ship) => {
                if settings.coupling != Coupling::Exact {
                    return Err(refused(
                        "coupling: a pose alone leaves nothing to choose; leave it out, or follow a GnssIns",
                    ));
                }
                let pose = NavigationPose::new(ship.vector(), &ship.0.covariance);
                let (track, cross) =
                    one_point(&seen, &radar, velocity_std, &pose).map_err(first)?;
                let tracker =
                    BlackBoxSchmidt::new(config, memory, track, cross, &ship.0.covariance);
                Tracker::BlackBox(Box::new(tracker.map_err(bad)?))
            }
            Own::Filter(ins) => {
                let mut filter = ins.borrow_mut(py);
                let pose = filter.pose().ok_or_else(|| {
                    refused("own: the GnssIns has no position yet, so nothing can be seen from it")
                })?;
                let pose = pose.navigation_pose();
                let (track, cross) =
                    one_point(&seen, &radar, velocity_std, &pose).map_err(first)?;
                let tracker = CoreSchmidtKalman::new(config, settings.coupling, track, cross);
                let follower = Arc::new(Mutex::new(tracker.map_err(bad)?));
                filter.follow(&follower);
                drop(filter);
                Tracker::Follows(follower, ins)
            }
        };
        Ok(Self {
            time_ns,
            settings,
            tracker,
        })
    }

    /// Takes a detection: moves the target on to its stamp and fuses. A GNSS/INS must have come to that stamp.
    #[pyo3(signature = (time_ns, range, bearing, own=None))]
    fn scan(
        &mut self,
        py: Python<'_>,
        time_ns: i64,
        range: f64,
        bearing: f64,
        own: Option<OwnShip>,
    ) -> PyResult<Innovation> {
        let pose = match (&self.tracker, own) {
            (Tracker::BlackBox(_), None) => {
                return Err(refused(
                    "own is missing: from which pose was this seen? give an OwnShip",
                ));
            }
            (Tracker::Follows(..), Some(_)) => {
                return Err(refused(
                    "own: this target is seen from its GnssIns; leave it out",
                ));
            }
            (Tracker::Follows(_, ins), None) => {
                Some(ins.borrow_mut(py).pose().ok_or_else(|| {
                    refused("the GnssIns has started again and has no position yet")
                })?)
            }
            (Tracker::BlackBox(_), Some(_)) => None,
        };
        if let Err(reason) = self.predict(seconds(self.time_ns, time_ns)) {
            return Ok(Innovation(CoreInnovation::skipped(reason)));
        }
        self.time_ns = time_ns;
        let seen = RadarDetection::new(range, bearing);
        let told = match (&mut self.tracker, own, pose) {
            (Tracker::BlackBox(tracker), Some(ship), _) => {
                tracker.update(&seen, &ship.vector(), &ship.0.covariance)
            }
            (Tracker::Follows(follower, _), _, Some(pose)) => {
                locked(follower).update(&seen, &pose.navigation_pose())
            }
            _ => CoreInnovation::skipped(SkipReason::NotUsed),
        };
        Ok(Innovation(told))
    }

    /// Moves the target on to a stamp at which nothing was seen; why not, if so.
    fn move_on(&mut self, time_ns: i64) -> Option<&'static str> {
        match self.predict(seconds(self.time_ns, time_ns)) {
            Ok(()) => {
                self.time_ns = time_ns;
                None
            }
            Err(reason) => Some(reason.description()),
        }
    }

    /// Stamp of the estimate, ns.
    #[getter]
    fn time_ns(&self) -> i64 {
        self.time_ns
    }

    /// North (m), its rate (m/s), east (m), its rate (m/s).
    #[getter]
    fn track<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.estimate().state.as_slice())
    }

    /// Its covariance.
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        square(py, &self.estimate().covariance)
    }

    /// Standard deviations of the track.
    #[getter]
    fn std<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.estimate().std().as_slice())
    }

    /// Covariance of the own ship's errors (rows) with the track (columns).
    #[getter]
    fn cross_covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        match &self.tracker {
            Tracker::BlackBox(tracker) => square(py, &tracker.save().tracker.cross),
            Tracker::Follows(follower, _) => square(py, locked(follower).cross_covariance()),
        }
    }

    /// Semi-axes (m) of the ellipse that holds the target with this probability, and the direction of the first, rad from north.
    #[pyo3(signature = (probability=0.95))]
    fn ellipse(&self, probability: f64) -> PyResult<(f64, f64, f64)> {
        if !(0.0..1.0).contains(&probability) {
            return Err(refused(format!(
                "probability={probability}: expected 0 or above and below 1, e.g. 0.95"
            )));
        }
        let ([long, short], direction) = self.estimate().position_ellipse(probability);
        Ok((long, short, direction))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Pickled)> {
        let own = slf.borrow();
        let wrong = |error: serde_json::Error| refused(error.to_string());
        let (tracker, ins) = match &own.tracker {
            Tracker::BlackBox(tracker) => (serde_json::to_value(tracker.save()), None),
            Tracker::Follows(follower, ins) => (
                serde_json::to_value(locked(follower).save()),
                Some(ins.clone_ref(slf.py())),
            ),
        };
        let state = State {
            time_ns: own.time_ns,
            settings: own.settings.clone(),
            tracker: tracker.map_err(wrong)?,
        };
        let text = serde_json::to_string(&state).map_err(wrong)?;
        Ok((slf.get_type().getattr("_continued")?, (text, ins)))
    }

    #[staticmethod]
    fn _continued(py: Python<'_>, state: &str, ins: Option<Py<GnssIns>>) -> PyResult<Self> {
        let wrong = |error: serde_json::Error| refused(format!("state: {error}"));
        let bad = |error: northing_core::ConfigError| refused(format!("state: {error}"));
        let invalid = |error: northing_core::InvalidState| refused(format!("state: {error}"));
        let state: State = serde_json::from_str(state).map_err(wrong)?;
        let Settings {
            config,
            coupling,
            memory,
        } = state.settings;
        let tracker = match ins {
            None => {
                let saved: <BlackBoxSchmidt<f64> as Restorable>::State =
                    serde_json::from_value(state.tracker).map_err(wrong)?;
                let (track, cross) = (saved.tracker.track, saved.tracker.cross);
                let made =
                    BlackBoxSchmidt::new(config, memory, track, cross, &saved.pose_covariance);
                let mut tracker = made.map_err(bad)?;
                tracker.restore(saved).map_err(invalid)?;
                Tracker::BlackBox(Box::new(tracker))
            }
            Some(ins) => {
                let saved: <CoreSchmidtKalman<f64, ERRORS> as Restorable>::State =
                    serde_json::from_value(state.tracker).map_err(wrong)?;
                let made = CoreSchmidtKalman::new(config, coupling, saved.track, saved.cross)
                    .map_err(bad)?;
                let follower = Arc::new(Mutex::new(made));
                ins.borrow_mut(py).follow(&follower);
                Tracker::Follows(follower, ins)
            }
        };
        Ok(Self {
            time_ns: state.time_ns,
            settings: state.settings,
            tracker,
        })
    }
}
