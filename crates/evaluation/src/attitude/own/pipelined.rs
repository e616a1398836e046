//! An estimator on a live stream that does not wait for it: samples go to a thread of its own, what comes back is shown when it
//! comes. One that is too slow for its samples is said to be, and never holds up another.

use std::collections::VecDeque;
use std::fmt::Debug;
use std::sync::mpsc::{Receiver, SyncSender, TryRecvError, TrySendError, channel, sync_channel};

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use northing_core::attitude::{
    AttitudeEstimator, CompassHeading, InitialState, Propagation, StartUncertainty,
};
use northing_core::kalman::{Innovation, SkipReason};

use super::OwnEstimator;
use super::protocol::Request;

/// Requests that may wait: three sensors at 400 Hz for two seconds. One that is further behind does not keep up.
const MOST_WAITING: usize = 2400;

/// What the estimator said after a request.
#[derive(Debug)]
struct Said {
    attitude: UnitQuaternion<f64>,
    covariance: Option<Matrix3<f64>>,
    bias: Option<(Vector3<f64>, Matrix3<f64>)>,
    innovation: Option<(usize, Innovation<f64>)>,
    failure: Option<String>,
}

/// The estimator that nobody waits for.
#[derive(Debug)]
pub(super) struct Pipelined {
    name: String,
    uncertainty: StartUncertainty<f64>,
    requests: Option<SyncSender<Request>>,
    answers: Receiver<Said>,
    attitude: UnitQuaternion<f64>,
    covariance: Option<Matrix3<f64>>,
    bias: Option<(Vector3<f64>, Matrix3<f64>)>,
    rate_at_rest: Vector3<f64>,
    /// Innovations that came, by sensor: accelerometer, magnetometer, compass.
    innovations: [VecDeque<Innovation<f64>>; 3],
    answered: u64,
    failure: Option<String>,
}

impl Pipelined {
    /// One that `begin` makes on a thread of its own; `name` stands for it in messages.
    pub(super) fn new<E: OwnEstimator>(
        begin: impl FnOnce() -> E + Send + 'static,
        name: &str,
        uncertainty: StartUncertainty<f64>,
    ) -> Self {
        let (requests, waiting) = sync_channel::<Request>(MOST_WAITING);
        let (send, answers) = channel();
        // It ends when the requests do.
        std::thread::spawn(move || {
            let mut estimator = begin();
            for request in waiting {
                let said = serve(&mut estimator, &request);
                let failed = said.failure.is_some();
                if send.send(said).is_err() || failed {
                    return;
                }
            }
        });
        Self {
            name: name.to_owned(),
            uncertainty,
            requests: Some(requests),
            answers,
            attitude: UnitQuaternion::identity(),
            covariance: None,
            bias: None,
            rate_at_rest: Vector3::zeros(),
            innovations: Default::default(),
            answered: 0,
            failure: None,
        }
    }

    /// Takes what has come, and hands a request over.
    fn ask(&mut self, request: Request) {
        self.take_answers();
        let Some(requests) = &self.requests else {
            return;
        };
        match requests.try_send(request) {
            Ok(()) => {}
            Err(TrySendError::Full(_)) => self.fails(format!(
                "{} does not keep up: it has answered {} calls, and {MOST_WAITING} more wait",
                self.name, self.answered
            )),
            Err(TrySendError::Disconnected(_)) => self.take_answers(),
        }
    }

    fn take_answers(&mut self) {
        loop {
            match self.answers.try_recv() {
                Ok(said) => self.take(said),
                Err(TryRecvError::Empty) => return,
                Err(TryRecvError::Disconnected) => {
                    if self.failure.is_none() {
                        self.fails(format!("{} has ended", self.name));
                    }
                    return;
                }
            }
        }
    }

    fn take(&mut self, said: Said) {
        if let Some(failure) = said.failure {
            self.fails(failure);
            return;
        }
        self.answered += 1;
        (self.attitude, self.covariance, self.bias) = (said.attitude, said.covariance, said.bias);
        if let Some((bias, _)) = &self.bias {
            self.rate_at_rest = *bias;
        }
        if let Some((sensor, innovation)) = said.innovation {
            self.innovations[sensor].push_back(innovation);
        }
    }

    fn fails(&mut self, reason: String) {
        self.requests = None;
        self.failure.get_or_insert(reason);
    }

    /// Hands a measurement over and tells what the one before it told, or one before that.
    fn update(&mut self, sensor: usize, request: Request) -> Innovation<f64> {
        self.ask(request);
        let waiting = Innovation::skipped(SkipReason::Accumulated);
        self.innovations[sensor].pop_front().unwrap_or(waiting)
    }
}

fn serve(estimator: &mut impl OwnEstimator, request: &Request) -> Said {
    let mut innovation = None;
    match request {
        Request::Start(state) => estimator.initialize(state),
        Request::Gyroscope(rate, dt) => {
            // Why it did not move on is in its failure.
            let _ = estimator.propagate(rate, *dt);
        }
        Request::Accelerometer(force) => {
            innovation = Some((0, estimator.update_accelerometer(force)));
        }
        Request::Magnetometer(field) => {
            innovation = Some((1, estimator.update_magnetometer(field)));
        }
        Request::Compass(heading) => innovation = Some((2, estimator.update_compass(heading))),
        Request::Unseen(variance) => estimator.add_attitude_variance(*variance),
    }
    Said {
        attitude: estimator.attitude(),
        covariance: estimator.attitude_covariance(),
        bias: estimator.gyroscope_bias(),
        innovation,
        failure: estimator.failure(),
    }
}

impl AttitudeEstimator<f64> for Pipelined {
    fn initialize(&mut self, initial: &InitialState<f64>) {
        if initial.is_usable() {
            // Until it answers it is where it starts.
            self.attitude = initial.attitude;
            self.rate_at_rest = initial.gyroscope_bias;
            self.ask(Request::Start(*initial));
        }
    }

    fn propagate(&mut self, angular_rate: &Vector3<f64>, dt: f64) -> Propagation {
        if !(angular_rate.norm().is_finite() && dt.is_finite()) {
            return Propagation::Skipped(SkipReason::NotFinite);
        }
        if dt <= 0.0 {
            return Propagation::Skipped(SkipReason::NotNewer);
        }
        self.ask(Request::Gyroscope(*angular_rate, dt));
        match self.failure {
            None => Propagation::Done,
            Some(_) => Propagation::Skipped(SkipReason::NotUsed),
        }
    }

    fn update_accelerometer(&mut self, specific_force: &Vector3<f64>) -> Innovation<f64> {
        match specific_force.norm().is_finite() {
            true => self.update(0, Request::Accelerometer(*specific_force)),
            false => Innovation::skipped(SkipReason::NotFinite),
        }
    }

    fn update_magnetometer(&mut self, magnetic_field: &Vector3<f64>) -> Innovation<f64> {
        match magnetic_field.norm().is_finite() {
            true => self.update(1, Request::Magnetometer(*magnetic_field)),
            false => Innovation::skipped(SkipReason::NotFinite),
        }
    }

    fn update_compass(&mut self, heading: &CompassHeading<f64>) -> Innovation<f64> {
        self.update(2, Request::Compass(*heading))
    }

    fn add_attitude_variance(&mut self, variance: f64) {
        if variance > 0.0 && variance.is_finite() {
            self.ask(Request::Unseen(variance));
        }
    }

    fn attitude(&self) -> UnitQuaternion<f64> {
        self.attitude
    }

    fn attitude_covariance(&self) -> Option<Matrix3<f64>> {
        self.covariance
    }

    fn gyroscope_bias(&self) -> Option<(Vector3<f64>, Matrix3<f64>)> {
        self.bias
    }

    fn start_uncertainty(&self) -> StartUncertainty<f64> {
        self.uncertainty
    }

    fn rate_at_rest(&self) -> Vector3<f64> {
        self.rate_at_rest
    }
}

impl OwnEstimator for Pipelined {
    fn failure(&self) -> Option<String> {
        self.failure.clone()
    }
}
