//! The GNSS/INS sample by sample: every update returns its innovation; the state is pickled and goes on to the bit.

use std::sync::{Arc, Mutex, PoisonError, Weak};

use nalgebra::Vector3;
use northing_core::Restorable;
use northing_core::earth::{Geodetic, LocalFrame};
use northing_core::geometry::rotation;
use northing_core::kalman::{
    ErrorListener, ErrorPropagation, Innovation as CoreInnovation, ScalarCorrection, SkipReason,
};
use northing_core::navigation::aiding::barometer::pressure_height;
use northing_core::navigation::gnss_ins::{GnssIns as CoreGnssIns, GnssInsState, PoseWithErrors};
use northing_core::navigation::{ERRORS, GnssPosition, GnssVelocity, STATES};
use northing_core::tracking::SchmidtKalman;
use northing_evaluation::navigation::magnetic_model;
use northing_evaluation::navigation::moving_frame::{Move, MovingFrame, MovingFrameState};
use northing_recording::GnssPosition as Fix;
use northing_recording::device_navigation::validity_word;
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use serde::{Deserialize, Serialize};

use crate::configs::GnssInsConfig;
use crate::errors::refused;
use crate::streams::Innovation;

/// Inertial samples kept for late fixes, as in a run over a recording.
const HISTORY: usize = 128;

/// A target that a tracker follows from this navigation filter.
pub(crate) type Follower = Mutex<SchmidtKalman<f64, ERRORS>>;

/// The trackers that are told what the filter does to its errors; those that are gone are forgotten.
#[derive(Default)]
pub(crate) struct Followers(Vec<Weak<Follower>>);

impl Followers {
    fn each(&mut self, tell: impl Fn(&mut SchmidtKalman<f64, ERRORS>)) {
        self.0.retain(|follower| {
            let there = follower.upgrade();
            if let Some(follower) = &there {
                tell(&mut follower.lock().unwrap_or_else(PoisonError::into_inner));
            }
            there.is_some()
        });
    }
}

impl ErrorListener<f64, ERRORS> for Followers {
    fn propagated(&mut self, transition: &impl ErrorPropagation<f64, ERRORS>) {
        self.each(|one| one.propagated(transition));
    }
    fn corrected<const E: usize>(&mut self, correction: &ScalarCorrection<f64, ERRORS, E>) {
        self.each(|one| one.corrected(correction));
    }
    fn recentred(&mut self, angle: &Vector3<f64>) {
        self.each(|one| one.recentred(angle));
    }
    fn restarted(&mut self) {
        self.each(ErrorListener::restarted);
    }
}

/// Everything that the next step depends on, but for the parameters.
#[derive(Serialize, Deserialize)]
struct State {
    filter: GnssInsState<f64, HISTORY>,
    frame: Option<MovingFrameState>,
}

/// GNSS/INS: body axes forward, right, down; world north, east, down.
#[pyclass(module = "northing._northing")]
pub(crate) struct GnssIns {
    ins: Box<CoreGnssIns<f64, HISTORY, Followers>>,
    frame: Option<MovingFrame>,
}

impl GnssIns {
    /// Pose and errors of now; `None` before the start.
    pub(crate) fn pose(&mut self) -> Option<PoseWithErrors<f64>> {
        Some(self.ins.pose_and_listener()?.0)
    }

    /// Tells a tracker from now on what happens to the errors.
    pub(crate) fn follow(&mut self, follower: &Arc<Follower>) {
        self.ins.listener_mut().0.push(Arc::downgrade(follower));
    }

    fn has_followers(&mut self) -> bool {
        let followers = &mut self.ins.listener_mut().0;
        followers.retain(|follower| follower.strong_count() > 0);
        !followers.is_empty()
    }

    fn learn_declination(&mut self, frame: &LocalFrame, time_ns: i64) {
        if self.ins.config().declination.is_some() {
            return;
        }
        if let Some(declination) = magnetic_model::declination(frame.origin(), time_ns) {
            self.ins.set_declination(declination);
        }
    }

    fn moved(&mut self, time_ns: i64, moved: Option<Move>) {
        if let Some(moved) = moved {
            self.ins.move_origin(&moved.change);
            self.learn_declination(&moved.frame, time_ns);
        }
    }

    /// Without fixes the origin goes along with the estimate.
    fn follow_estimate(&mut self, time_ns: i64) {
        let due = self
            .frame
            .is_some_and(|frame| frame.awaits_estimate(time_ns));
        if !due || self.has_followers() {
            return;
        }
        let position = self.ins.antenna_position().map(|(position, _)| position);
        let frame = self.frame.as_mut();
        let moved = frame.and_then(|frame| frame.follow_estimate(time_ns, position.as_ref()));
        self.moved(time_ns, moved);
    }

    /// Metres from the origin of now; the first fix is the first origin.
    fn place(&mut self, time_ns: i64, fix: &Fix) -> Vector3<f64> {
        let follows = !self.has_followers();
        if let Some(frame) = self.frame.as_mut().filter(|_| follows) {
            let moved = frame.follow_fix(time_ns, fix);
            self.moved(time_ns, moved);
        }
        let height_m = self
            .frame
            .map_or(0.0, |frame| frame.now().origin().height_m);
        let place = Geodetic {
            latitude_rad: fix.latitude_rad,
            longitude_rad: fix.longitude_rad,
            height_m: fix.height_m.unwrap_or(height_m),
        };
        if let Some(frame) = &mut self.frame {
            frame.is_at(&place);
            return frame.now().ned(&place);
        }
        let frame = LocalFrame::new(place);
        self.frame = Some(MovingFrame::new(frame, time_ns, fix));
        self.learn_declination(&frame, time_ns);
        Vector3::zeros()
    }
}

/// Standard deviations north, east and down: one for all three, or three.
#[derive(FromPyObject)]
pub(crate) enum Stds {
    All(f64),
    Each([f64; 3]),
}

impl From<Stds> for Vector3<f64> {
    fn from(stds: Stds) -> Self {
        match stds {
            Stds::All(std) => Self::repeat(std),
            Stds::Each(stds) => stds.into(),
        }
    }
}

fn array<'py, const N: usize>(py: Python<'py>, vector: [f64; N]) -> Bound<'py, PyArray1<f64>> {
    PyArray1::from_slice(py, &vector)
}

#[pymethods]
impl GnssIns {
    #[new]
    #[pyo3(signature = (config=None))]
    fn new(config: Option<GnssInsConfig>) -> PyResult<Self> {
        let config = config.unwrap_or_default().0;
        let ins = CoreGnssIns::listened_to(config, Followers::default());
        Ok(Self {
            ins: Box::new(ins.map_err(|error| refused(error.to_string()))?),
            frame: None,
        })
    }

    /// Takes an angular rate, rad/s, and a specific force, m/s^2, of one stamp; why they were skipped, if they were.
    fn imu(
        &mut self,
        time_ns: i64,
        angular_rate: [f64; 3],
        specific_force: [f64; 3],
    ) -> Option<&'static str> {
        self.follow_estimate(time_ns);
        let taken = self
            .ins
            .imu(time_ns, &angular_rate.into(), &specific_force.into());
        taken.err().map(|reason| reason.description())
    }

    /// Takes a fix: deg, deg, height above the ellipsoid in m if there is one, standard deviations in m.
    #[pyo3(signature = (time_ns, latitude_deg, longitude_deg, height_m=None, *, std))]
    fn gnss_position(
        &mut self,
        time_ns: i64,
        latitude_deg: f64,
        longitude_deg: f64,
        height_m: Option<f64>,
        std: Stds,
    ) -> (Innovation, Innovation) {
        let std = Vector3::from(std);
        let height_m = height_m.filter(|height| !height.is_nan());
        let known = height_m.unwrap_or(0.0);
        let Some(place) = Geodetic::from_degrees(latitude_deg, longitude_deg, known) else {
            let finite = latitude_deg.is_finite() && longitude_deg.is_finite();
            let reason = if finite {
                SkipReason::OutOfRange
            } else {
                SkipReason::NotFinite
            };
            let skipped = || Innovation(CoreInnovation::skipped(reason));
            return (skipped(), skipped());
        };
        let fix = Fix {
            latitude_rad: place.latitude_rad,
            longitude_rad: place.longitude_rad,
            height_m,
            std_m: Some(std.into()),
            ..Fix::default()
        };
        let ned = self.place(time_ns, &fix);
        let has_height = height_m.is_some();
        let told = self.ins.gnss_position(
            time_ns,
            &GnssPosition {
                ned,
                std,
                has_height,
            },
        );
        (Innovation(told.horizontal), Innovation(told.vertical))
    }

    /// Takes a velocity over ground, m/s north, east, down; down may be NaN.
    #[pyo3(signature = (time_ns, ned, *, std))]
    fn gnss_velocity(&mut self, time_ns: i64, ned: [f64; 3], std: Stds) -> Innovation {
        let has_vertical = !ned[2].is_nan();
        let ned = Vector3::new(ned[0], ned[1], if has_vertical { ned[2] } else { 0.0 });
        let ned = self.frame.map_or(ned, |frame| frame.velocity(&ned));
        let fix = GnssVelocity {
            ned,
            std: std.into(),
            has_vertical,
        };
        Innovation(self.ins.gnss_velocity(time_ns, &fix))
    }

    /// Takes a true heading of the forward axis, rad clockwise from north.
    #[pyo3(signature = (time_ns, heading, *, std))]
    fn heading(&mut self, time_ns: i64, heading: f64, std: f64) -> Innovation {
        Innovation(self.ins.heading(time_ns, heading, std))
    }

    /// Takes a magnetic field, microtesla.
    fn magnetometer(&mut self, time_ns: i64, magnetic_field: [f64; 3]) -> Innovation {
        Innovation(self.ins.magnetometer(time_ns, &magnetic_field.into()))
    }

    /// Takes a static pressure, Pa.
    fn barometer(&mut self, time_ns: i64, pressure: f64) -> Innovation {
        Innovation(match pressure_height(pressure) {
            Some(height) => self.ins.barometer(time_ns, height),
            None => CoreInnovation::skipped(SkipReason::OutOfRange),
        })
    }

    /// Takes a speed along the forward axis, m/s, negative backwards.
    #[pyo3(signature = (time_ns, forward, *, std))]
    fn speed(&mut self, time_ns: i64, forward: f64, std: f64) -> Innovation {
        Innovation(self.ins.speed(time_ns, forward, std))
    }

    /// The solution status.
    #[getter]
    fn validity(&self) -> &'static str {
        validity_word(self.ins.validity())
    }

    /// Stamp of the state, ns.
    #[getter]
    fn time_ns(&self) -> Option<i64> {
        self.ins.time_ns()
    }

    /// Latitude and longitude of the antenna, deg, and its height above the ellipsoid, m.
    #[getter]
    fn geodetic<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        let (position, _) = self.ins.antenna_position()?;
        let place = self.frame?.now().geodetic(&position);
        let [latitude, longitude] = place.degrees();
        Some(array(py, [latitude, longitude, place.height_m]))
    }

    /// Position of the antenna, m north, east, down of the first fix.
    #[getter]
    fn ned<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        let (position, _) = self.ins.antenna_position()?;
        let from_the_first = self.frame?.seen_from_the_first(&position);
        Some(array(py, from_the_first.into()))
    }

    /// Covariance of the position of the antenna, m^2.
    #[getter]
    fn position_covariance<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        let covariance = self.ins.antenna_position();
        let square = |(_, p): (_, nalgebra::Matrix3<f64>)| {
            PyArray1::from_slice(py, p.transpose().as_slice()).reshape([3, 3])
        };
        covariance.map(square).transpose()
    }

    /// Velocity of the antenna, m/s north, east, down.
    #[getter]
    fn velocity<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        let state = self.ins.state()?;
        let rate = self
            .ins
            .last_sample()
            .map_or_else(Vector3::zeros, |(rate, _)| rate);
        let arm = Vector3::from(self.ins.config().lever_arm_m);
        let swing = state.ned_from_body * (rate - state.gyroscope_bias).cross(&arm);
        Some(array(py, (state.velocity + swing).into()))
    }

    /// `ned_from_body`, w, x, y, z.
    #[getter]
    fn quat<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        let attitude = self.ins.state()?.ned_from_body;
        Some(array(py, rotation::to_wxyz(&attitude)))
    }

    /// Gyroscope bias, rad/s.
    #[getter]
    fn gyro_bias<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        Some(array(py, self.ins.state()?.gyroscope_bias.into()))
    }

    /// Accelerometer bias, m/s^2.
    #[getter]
    fn accelerometer_bias<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        Some(array(py, self.ins.state()?.accelerometer_bias.into()))
    }

    /// Covariance of the 15 errors: attitude, velocity, position, accelerometer bias, gyroscope bias.
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        let covariance = self.ins.state().map(|state| &state.covariance);
        let square = |p: &nalgebra::SMatrix<f64, STATES, STATES>| {
            PyArray1::from_slice(py, p.transpose().as_slice()).reshape([STATES, STATES])
        };
        covariance.map(square).transpose()
    }

    /// Its parameters.
    #[getter]
    fn config(&self) -> GnssInsConfig {
        GnssInsConfig(*self.ins.config())
    }

    /// Everything that the next step depends on, but for the parameters.
    #[getter]
    fn state(&self) -> PyResult<String> {
        let state = State {
            filter: self.ins.save(),
            frame: self.frame.map(|frame| frame.save()),
        };
        serde_json::to_string(&state).map_err(|error| refused(error.to_string()))
    }

    /// Continues from a saved state; trackers that follow it lose what they share with its errors.
    #[setter]
    fn set_state(&mut self, state: &str) -> PyResult<()> {
        let state: State =
            serde_json::from_str(state).map_err(|error| refused(format!("state: {error}")))?;
        let places = || refused("state: its frame has numbers that are no places");
        let frame = state.frame.map(|frame| MovingFrame::restored(&frame));
        let frame = frame.map(|frame| frame.ok_or_else(places)).transpose()?;
        let restored = self.ins.restore(state.filter);
        restored.map_err(|error| refused(format!("state: {error}")))?;
        self.frame = frame;
        Ok(())
    }

    fn __reduce__<'py>(
        slf: &Bound<'py, Self>,
    ) -> PyResult<(Bound<'py, PyAny>, (GnssInsConfig, String))> {
        let own = slf.borrow();
        let parts = (own.config(), own.state()?);
        Ok((slf.get_type().getattr("_continued")?, parts))
    }

    #[staticmethod]
    fn _continued(config: GnssInsConfig, state: &str) -> PyResult<Self> {
        let mut ins = Self::new(Some(config))?;
        ins.set_state(state)?;
        Ok(ins)
    }
}
