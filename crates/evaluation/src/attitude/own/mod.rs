//! Estimators that somebody brings along: a type of Rust or a class of Python, run and judged beside those of the project.
//!
//! [`register`] gives one a name; from then on it is an [`EstimatorKind`] like every other, in runs, comparisons, benchmarks,
//! reports and the lab. What it says is checked before anybody else sees it: a rotation, a covariance, finite numbers. One that
//! fails ends its own run with the reason, and nobody else's.
//!
//! | file | what is in it |
//! |---|---|
//! | `mod.rs` | the interface and the names |
//! | `remote.rs` | one that answers requests: its answers checked |
//! | `protocol.rs` | requests and answers as bytes |
//! | `process.rs` | a class of Python in a process of its own |
//! | `pipelined.rs` | the same for streams that do not wait |
//!
//! ```
//! use northing_core::attitude::{AttitudeConfig, Mekf};
//! use northing_evaluation::attitude::own::{self, OwnEstimator};
//! use northing_evaluation::{EstimatorKind, Profile, RunOptions};
//!
//! // Here a filter of the core; in earnest a type of one's own that implements `AttitudeEstimator<f64>`.
//! #[derive(Debug)]
//! struct Mine(Mekf<f64>);
//! # use northing_core::attitude::*;
//! # use northing_core::{kalman::Innovation, nalgebra::{Matrix3, UnitQuaternion, Vector3}};
//! # impl AttitudeEstimator<f64> for Mine {
//! #     fn initialize(&mut self, initial: &InitialState<f64>) { self.0.initialize(initial); }
//! #     fn propagate(&mut self, w: &Vector3<f64>, dt: f64) -> Propagation { self.0.propagate(w, dt) }
//! #     fn update_accelerometer(&mut self, f: &Vector3<f64>) -> Innovation<f64> { self.0.update_accelerometer(f) }
//! #     fn update_magnetometer(&mut self, m: &Vector3<f64>) -> Innovation<f64> { self.0.update_magnetometer(m) }
//! #     fn update_compass(&mut self, c: &CompassHeading<f64>) -> Innovation<f64> { self.0.update_compass(c) }
//! #     fn add_attitude_variance(&mut self, variance: f64) { self.0.add_attitude_variance(variance); }
//! #     fn attitude(&self) -> UnitQuaternion<f64> { self.0.attitude() }
//! #     fn attitude_covariance(&self) -> Option<Matrix3<f64>> { self.0.attitude_covariance() }
//! #     fn gyroscope_bias(&self) -> Option<(Vector3<f64>, Matrix3<f64>)> { self.0.gyroscope_bias() }
//! #     fn start_uncertainty(&self) -> StartUncertainty<f64> { self.0.start_uncertainty() }
//! #     fn rate_at_rest(&self) -> Vector3<f64> { self.0.rate_at_rest() }
//! # }
//! impl OwnEstimator for Mine {}
//!
//! let make = |_: &_, _| Ok(Box::new(Mine(Mekf::new(AttitudeConfig::lab())?)) as Box<dyn OwnEstimator>);
//! let kind = own::register("mine", "a filter of mine", make);
//! assert_eq!(EstimatorKind::named("mine"), Some(kind));
//! let options = RunOptions::new(kind, Profile::Lab);
//! # assert_eq!(options.estimator.name(), "mine");
//! ```

mod pipelined;
mod process;
mod protocol;
mod remote;

use std::fmt::Debug;
use std::sync::{Arc, PoisonError, RwLock};

use northing_core::attitude::AttitudeEstimator;

use crate::attitude::{EstimatorKind, Parameters};
use crate::error::EvaluationError;
use crate::registry::EstimatorInfo;

pub use process::{PythonClass, register_python, register_python_with};
pub use protocol::{Answer, Request};
pub use remote::{Channel, Remote};

/// An estimator that somebody brings along.
pub trait OwnEstimator: AttitudeEstimator<f64> + Debug + Send {
    /// Why it has failed, in a sentence; `None` while it works. One that has failed is not asked again.
    fn failure(&self) -> Option<String> {
        None
    }
}

/// Which of the registered estimators; its name is [`EstimatorKind::name`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct OwnKind(u16);

/// Whether samples wait for the estimator.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pace {
    /// Runs over recordings: every call is waited for.
    Waits,
    /// A live stream: samples go on, estimates come when they are made.
    Live,
}

/// What a registered estimator is made by.
type Made = Result<Box<dyn OwnEstimator>, EvaluationError>;
/// Makes an estimator for a run with these parameters.
type Make = Arc<dyn Fn(&Parameters, Pace) -> Made + Send + Sync>;

/// An entry of the registry. Names and summaries live as long as the program: there are as many as people bring.
#[derive(Clone)]
struct Entry {
    name: &'static str,
    summary: &'static str,
    make: Make,
}

static REGISTERED: RwLock<Vec<Entry>> = RwLock::new(Vec::new());

fn entry(kind: OwnKind) -> Option<Entry> {
    let registered = REGISTERED.read().unwrap_or_else(PoisonError::into_inner);
    registered.get(usize::from(kind.0)).cloned()
}

/// Gives an estimator a name, by which everything knows it from now on; whoever had that name before is replaced. Names of the
/// project's own estimators cannot be taken: theirs is found first.
pub fn register(
    name: &str,
    summary: &str,
    make: impl Fn(&Parameters, Pace) -> Made + Send + Sync + 'static,
) -> EstimatorKind {
    let mut registered = REGISTERED.write().unwrap_or_else(PoisonError::into_inner);
    let summary: &'static str = summary.to_owned().leak();
    let make: Make = Arc::new(make);
    let known = registered.iter().position(|entry| entry.name == name);
    let place = known.unwrap_or(registered.len());
    match registered.get_mut(place) {
        Some(entry) => (entry.summary, entry.make) = (summary, make),
        None => registered.push(Entry {
            name: name.to_owned().leak(),
            summary,
            make,
        }),
    }
    // More than so many would have filled the memory long before.
    EstimatorKind::Own(OwnKind(u16::try_from(place).unwrap_or(u16::MAX)))
}

/// Every estimator that is registered.
#[must_use]
pub fn registered() -> Vec<EstimatorKind> {
    OwnKind::all().into_iter().map(EstimatorKind::Own).collect()
}

impl OwnKind {
    /// The one of that name.
    pub(crate) fn named(name: &str) -> Option<Self> {
        let registered = REGISTERED.read().unwrap_or_else(PoisonError::into_inner);
        let place = registered.iter().position(|entry| entry.name == name)?;
        u16::try_from(place).ok().map(Self)
    }

    /// Every one.
    pub(crate) fn all() -> Vec<Self> {
        let registered = REGISTERED.read().unwrap_or_else(PoisonError::into_inner);
        (0..registered.len())
            .filter_map(|place| u16::try_from(place).ok().map(Self))
            .collect()
    }

    pub(crate) fn name(self) -> &'static str {
        entry(self).map_or("own", |entry| entry.name)
    }

    pub(crate) fn info(self) -> EstimatorInfo {
        EstimatorInfo {
            name: self.name(),
            summary: entry(self).map_or("an estimator of one's own", |entry| entry.summary),
            // What it states shows when it runs.
            error_states: 0,
            has_covariance: false,
            paper: "-",
            when: "an estimator of one's own",
        }
    }

    pub(crate) fn make(self, parameters: &Parameters, pace: Pace) -> Made {
        let entry = entry(self).ok_or_else(|| EvaluationError::UnknownEstimator {
            name: self.name().to_owned(),
            valid: EstimatorKind::names(),
        })?;
        (entry.make)(parameters, pace)
    }
}
