//! An estimator that answers requests: what it says is checked, and becomes what every estimator says.

use std::fmt::Debug;

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use northing_core::attitude::{
    AttitudeEstimator, CompassHeading, InitialState, Propagation, StartUncertainty,
};
use northing_core::kalman::covariance::{is_covariance, normalized_square};
use northing_core::kalman::{Innovation, Outcome, SkipReason};

use super::OwnEstimator;
use super::protocol::{Answer, Request};

/// How far the norm of a quaternion may be from one.
const NORM_TOLERANCE: f64 = 1e-3;
/// By how much a covariance may miss symmetry and sign, as a correlation.
const COVARIANCE_TOLERANCE: f64 = 1e-6;

/// The way to an estimator and back.
pub trait Channel: Debug + Send {
    /// Asks, and waits for the answer.
    ///
    /// # Errors
    /// Why there is none: what it raised, or that it does not answer.
    fn ask(&mut self, request: &Request) -> Result<Answer, String>;
}

/// An estimator at the other end of a channel.
#[derive(Debug)]
pub struct Remote<C> {
    channel: C,
    name: String,
    uncertainty: StartUncertainty<f64>,
    attitude: UnitQuaternion<f64>,
    covariance: Option<Matrix3<f64>>,
    bias: Option<(Vector3<f64>, Matrix3<f64>)>,
    /// The bias that it removes.
    rate_at_rest: Vector3<f64>,
    requests: u64,
    failure: Option<String>,
}

impl<C: Channel> Remote<C> {
    /// One that has said nothing yet; `name` stands for it in messages.
    pub fn new(channel: C, name: &str, uncertainty: StartUncertainty<f64>) -> Self {
        Self {
            channel,
            name: name.to_owned(),
            uncertainty,
            attitude: UnitQuaternion::identity(),
            covariance: None,
            bias: None,
            rate_at_rest: Vector3::zeros(),
            requests: 0,
            failure: None,
        }
    }

    /// Asks, and takes over what it says, if that can be.
    fn ask(&mut self, request: &Request) -> Option<Answer> {
        if self.failure.is_some() {
            return None;
        }
        self.requests += 1;
        let answer = self.channel.ask(request);
        let checked = answer.and_then(|answer| self.check(&answer).map(|()| answer));
        match checked {
            Ok(answer) => Some(answer),
            Err(reason) => {
                let (name, number) = (&self.name, self.requests);
                self.failure = Some(format!("{name} {reason} (call {number})"));
                None
            }
        }
    }

    fn check(&mut self, answer: &Answer) -> Result<(), String> {
        let q = answer.attitude;
        let norm = q.norm();
        let is_rotation = (norm - 1.0).abs() <= NORM_TOLERANCE;
        if !is_rotation {
            let [w, x, y, z] = [q.w, q.i, q.j, q.k];
            return Err(format!(
                "says an attitude that is no rotation: quaternion ({w:.4}, {x:.4}, {y:.4}, {z:.4}), norm {norm:.4}"
            ));
        }
        let covariances = [
            ("its covariance", answer.covariance),
            (
                "the covariance of its bias",
                answer.bias.and_then(|(_, p)| p),
            ),
        ];
        for (what, covariance) in covariances {
            if covariance.is_some_and(|p| !is_covariance(&p, COVARIANCE_TOLERANCE)) {
                return Err(format!(
                    "says what cannot be: {what} is not finite, symmetric and positive semidefinite"
                ));
            }
        }
        if answer.bias.is_some_and(|(b, _)| !b.norm().is_finite()) {
            return Err("says a gyroscope bias that is not finite".to_owned());
        }
        self.attitude = UnitQuaternion::new_normalize(q);
        self.covariance = answer.covariance;
        self.rate_at_rest = answer.bias.map_or(self.rate_at_rest, |(bias, _)| bias);
        self.bias = answer.bias.and_then(|(bias, p)| Some((bias, p?)));
        Ok(())
    }

    fn update(&mut self, request: &Request) -> Innovation<f64> {
        let Some(answer) = self.ask(request) else {
            return Innovation::skipped(SkipReason::NotUsed);
        };
        let Some((residual, covariance)) = answer.innovation else {
            return Innovation::skipped(SkipReason::NotUsed);
        };
        let (number, name) = (self.requests, self.name.clone());
        let mut fails = |what: &str| {
            self.failure = Some(format!(
                "{name} says what cannot be: {what} (call {number})"
            ));
            Innovation::skipped(SkipReason::Numerical)
        };
        if !residual.norm().is_finite() {
            return fails("its innovation is not finite");
        }
        let Some(s) = covariance else {
            return Innovation {
                residual,
                covariance: Matrix3::zeros(),
                nis: 0.0,
                degrees_of_freedom: 0,
                outcome: Outcome::Fused,
            };
        };
        let nis = is_covariance(&s, COVARIANCE_TOLERANCE)
            .then(|| normalized_square(&residual, &s))
            .flatten();
        let Some(nis) = nis else {
            return fails(
                "the covariance of its innovation is not symmetric and positive definite",
            );
        };
        Innovation {
            residual,
            covariance: s,
            nis,
            degrees_of_freedom: 3,
            outcome: Outcome::Fused,
        }
    }
}

impl<C: Channel> AttitudeEstimator<f64> for Remote<C> {
    fn initialize(&mut self, initial: &InitialState<f64>) {
        if initial.is_usable() {
            self.rate_at_rest = initial.gyroscope_bias;
            self.attitude = initial.attitude;
            self.ask(&Request::Start(*initial));
        }
    }

    fn propagate(&mut self, angular_rate: &Vector3<f64>, dt: f64) -> Propagation {
        if !(angular_rate.norm().is_finite() && dt.is_finite()) {
            return Propagation::Skipped(SkipReason::NotFinite);
        }
        if dt <= 0.0 {
            return Propagation::Skipped(SkipReason::NotNewer);
        }
        match self.ask(&Request::Gyroscope(*angular_rate, dt)) {
            Some(_) => Propagation::Done,
            None => Propagation::Skipped(SkipReason::NotUsed),
        }
    }

    fn update_accelerometer(&mut self, specific_force: &Vector3<f64>) -> Innovation<f64> {
        match specific_force.norm().is_finite() {
            true => self.update(&Request::Accelerometer(*specific_force)),
            false => Innovation::skipped(SkipReason::NotFinite),
        }
    }

    fn update_magnetometer(&mut self, magnetic_field: &Vector3<f64>) -> Innovation<f64> {
        match magnetic_field.norm().is_finite() {
            true => self.update(&Request::Magnetometer(*magnetic_field)),
            false => Innovation::skipped(SkipReason::NotFinite),
        }
    }

    fn update_compass(&mut self, heading: &CompassHeading<f64>) -> Innovation<f64> {
        let mut innovation = self.update(&Request::Compass(*heading));
        // A heading is one number.
        innovation.degrees_of_freedom = innovation.degrees_of_freedom.min(1);
        innovation
    }

    fn add_attitude_variance(&mut self, variance: f64) {
        if variance > 0.0 && variance.is_finite() {
            self.ask(&Request::Unseen(variance));
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

impl<C: Channel> OwnEstimator for Remote<C> {
    fn failure(&self) -> Option<String> {
        self.failure.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Quaternion;
    use northing_core::attitude::References;

    /// Says what it is told to say.
    #[derive(Debug)]
    struct Parrot(Vec<Result<Answer, String>>);

    impl Channel for Parrot {
        fn ask(&mut self, _: &Request) -> Result<Answer, String> {
            self.0.remove(0)
        }
    }

    const GOOD: Answer = Answer {
        attitude: Quaternion::new(1.0, 0.0, 0.0, 0.0),
        covariance: None,
        bias: None,
        innovation: None,
    };

    fn remote(says: Vec<Result<Answer, String>>) -> Remote<Parrot> {
        let uncertainty = StartUncertainty {
            tilt_std: 0.1,
            heading_std: 0.1,
            unknown_std: 3.0,
            gyroscope_bias_std: 0.01,
            compass_std: 0.1,
        };
        Remote::new(Parrot(says), "mine", uncertainty)
    }

    fn start() -> InitialState<f64> {
        InitialState {
            attitude: UnitQuaternion::identity(),
            attitude_covariance: Matrix3::identity() * 0.01,
            gyroscope_bias: Vector3::zeros(),
            gyroscope_bias_std: 0.01,
            north_known: true,
            references: References {
                specific_force: Vector3::z() * 9.81,
                magnetic_field: None,
            },
        }
    }

    #[test]
    fn what_it_says_is_what_an_estimator_says() {
        let told = Answer {
            covariance: Some(Matrix3::identity() * 0.04),
            bias: Some((
                Vector3::new(0.1, 0.0, 0.0),
                Some(Matrix3::identity() * 1e-4),
            )),
            innovation: Some((
                Vector3::new(0.2, 0.0, 0.0),
                Some(Matrix3::identity() * 0.01),
            )),
            ..GOOD
        };
        let mut mine = remote(vec![Ok(GOOD), Ok(GOOD), Ok(told), Ok(GOOD)]);
        mine.initialize(&start());
        assert!(mine.attitude_covariance().is_none() && mine.gyroscope_bias().is_none());
        assert!(mine.propagate(&Vector3::x(), 0.01).is_done());
        let innovation = mine.update_accelerometer(&Vector3::z());
        assert_eq!(innovation.outcome, Outcome::Fused);
        assert!((innovation.nis - 4.0).abs() < 1e-12 && innovation.degrees_of_freedom == 3);
        assert_eq!(mine.rate_at_rest(), Vector3::new(0.1, 0.0, 0.0));
        assert!(mine.attitude_covariance().is_some() && mine.gyroscope_bias().is_some());
        let unused = mine.update_magnetometer(&Vector3::x());
        assert_eq!(unused.outcome, Outcome::Skipped(SkipReason::NotUsed));
        assert_eq!(mine.failure(), None);
    }

    #[test]
    fn samples_that_are_none_never_reach_it() {
        let mut mine = remote(Vec::new());
        let nan = Vector3::new(f64::NAN, 0.0, 0.0);
        assert!(!mine.propagate(&nan, 0.01).is_done());
        assert!(!mine.propagate(&Vector3::x(), 0.0).is_done());
        let told = [
            mine.update_accelerometer(&nan),
            mine.update_magnetometer(&nan),
        ];
        let not_finite = Outcome::Skipped(SkipReason::NotFinite);
        assert!(told.iter().all(|told| told.outcome == not_finite));
        mine.add_attitude_variance(f64::NAN);
        assert_eq!(mine.failure(), None);
    }

    #[test]
    fn nonsense_and_what_it_raises_end_it_with_the_reason() {
        let attitude = |w: f64| Answer {
            attitude: Quaternion::new(w, 0.0, 0.0, 0.0),
            ..GOOD
        };
        let covariance = |p: Matrix3<f64>| Answer {
            covariance: Some(p),
            ..GOOD
        };
        let innovation = |r: f64, s: Option<Matrix3<f64>>| Answer {
            innovation: Some((Vector3::new(r, 0.0, 0.0), s)),
            ..GOOD
        };
        let negative = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, 1.0));
        for (said, reason) in [
            (Ok(attitude(2.0)), "an attitude that is no rotation"),
            (Ok(attitude(f64::NAN)), "an attitude that is no rotation"),
            (
                Ok(covariance(negative)),
                "its covariance is not finite, symmetric",
            ),
            (
                Ok(covariance(Matrix3::repeat(f64::INFINITY))),
                "its covariance is not finite",
            ),
            (
                Ok(innovation(f64::NAN, None)),
                "its innovation is not finite",
            ),
            (
                Ok(innovation(1.0, Some(Matrix3::zeros()))),
                "the covariance of its innovation",
            ),
            (
                Err("raises ValueError: no".to_owned()),
                "mine raises ValueError: no (call 2)",
            ),
        ] {
            let mut mine = remote(vec![Ok(GOOD), said]);
            mine.initialize(&start());
            let told = mine.update_accelerometer(&Vector3::z());
            assert!(matches!(told.outcome, Outcome::Skipped(_)), "{reason}");
            let failure = mine.failure().unwrap();
            assert!(failure.contains(reason), "{failure}");
            // It is not asked again, and what it said before stands.
            assert!(!mine.propagate(&Vector3::x(), 0.01).is_done());
            assert_eq!(mine.attitude(), UnitQuaternion::identity());
        }
    }
}
