//! The conditions of the experiment, simulated and real, and what came out: `experiment observers`.

use std::path::PathBuf;

use northing_recording::OpenOptions;
use northing_simulation::scenario::flight_schema::{FlightScenario, Metric};
use rayon::prelude::*;
use serde::Serialize;

use super::cost::{self, Cost};
use super::data::ObserverData;
use super::interval::{Gain, error_ci95};
use super::schemes::{self, Form, Gains, Score};
use super::tuning::{Aggregate, Grid, Scheme, best, scores};
use northing_evaluation::EvaluationError;

/// The conditions that are flown unless others are given.
pub const SCENARIO: &str = include_str!("../../../../scenarios/observers/cascade.toml");
/// Where they are kept.
pub const SCENARIO_NAME: &str = "scenarios/observers/cascade.toml";

/// Samples of all flights that are scored, at most: as many again are tuned on, 160 bytes each.
const MOST_SAMPLES: f64 = 6e6;

/// Gains that the literature recommends: `k_P` 1, `k_I` 0.3.
#[must_use]
pub fn default_gains(linear_acceleration_std: f64, field_std: f64) -> Gains {
    Gains {
        attitude_gain: 1.0,
        bias_gain: 0.3,
        accelerometer_weight: 1.0,
        linear_acceleration_std,
        field_std,
    }
}

/// What is asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct Experiment {
    /// Flights that are scored in each simulated condition; as many others are tuned on.
    pub flights: u64,
    /// Seed of the flights.
    pub seed: u64,
}

/// The errors of the three schemes in one condition.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// Error of the original, deg.
    pub original_deg: f64,
    /// Its 95 % interval over flights, deg.
    #[serde(rename = "original_ci95_deg")]
    pub original_ci95: [f64; 2],
    /// Error of the modified scheme, deg.
    pub modified_deg: f64,
    /// Its interval, deg.
    #[serde(rename = "modified_ci95_deg")]
    pub modified_ci95: [f64; 2],
    /// Error of the EKF alone, deg.
    pub ekf_deg: f64,
    /// Its interval, deg.
    #[serde(rename = "ekf_ci95_deg")]
    pub ekf_ci95: [f64; 2],
    /// How much smaller the modified scheme's error is than the original's, percent.
    pub gain_percent: f64,
    /// Its interval over flights.
    pub gain_ci95: [f64; 2],
    /// The same for the position error, percent; absent without positions.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub position_gain_percent: Option<f64>,
    /// The same for the velocity error, percent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub velocity_gain_percent: Option<f64>,
    /// Scores of original, modified and EKF: root mean square over flights, mean over recordings, of
    /// `settled_s` the median.
    pub scores: [Score; 3],
}

/// Gains that tuning chose.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ChosenGains {
    /// Of the original.
    pub original: Gains,
    /// Of the modified scheme.
    pub modified: Gains,
    /// Of the EKF.
    pub ekf: Gains,
}

/// One condition. The numbers at its top are those of the tuned schemes as the literature prints them;
/// `northing` has those of our forms.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Condition {
    /// Its name: the variant of the scenario, or the folder of the recordings.
    pub name: String,
    /// What it is, in a few words.
    pub title: String,
    /// Which error counts.
    pub metric: Metric,
    /// What was tuned on, in words.
    pub tuned_on: String,
    /// What was scored, in words.
    pub scored_on: String,
    /// How many flights or recordings were scored.
    pub scored: usize,
    /// The tuned schemes.
    #[serde(flatten)]
    pub tuned: Comparison,
    /// Error of the original with the accelerometer's weight tuned too, deg.
    pub original_weighted_deg: f64,
    /// The gains of that one.
    pub original_weighted_gains: Gains,
    /// What the modified scheme gains over that one, percent.
    pub gain_over_weighted_percent: f64,
    /// The schemes at the literature's gains.
    pub default: Comparison,
    /// Northing's forms of the schemes, tuned.
    pub northing: Comparison,
    /// The gains that tuning chose for the literature's forms.
    pub gains: ChosenGains,
    /// The gains that tuning chose for Northing's.
    pub northing_gains: ChosenGains,
    /// Position error of the original without the rotation-rate term, m; where there are positions.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub position_without_rate_term_m: Option<f64>,
    /// Nanoseconds per step with the sensors of this condition.
    pub cost_ns: Cost,
}

/// Everything that came out.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ExperimentOutcome {
    /// Seed of the flights.
    pub seed: u64,
    /// Flights that were scored in each simulated condition.
    pub flights: u64,
    /// The conditions.
    pub conditions: Vec<Condition>,
    /// Nanoseconds per step in the condition `cost_of`.
    pub cost_ns: Cost,
    /// The first condition with magnetometer and positions, or else the first.
    pub cost_of: String,
}

impl ExperimentOutcome {
    /// The outcome of these conditions; `None` when there are none.
    #[must_use]
    pub fn of(experiment: &Experiment, conditions: Vec<Condition>) -> Option<Self> {
        let whole = |c: &&Condition| c.metric == Metric::Total && c.cost_ns.cascade.is_some();
        let timed = conditions.iter().find(whole).or(conditions.first())?;
        Some(Self {
            seed: experiment.seed,
            flights: experiment.flights,
            cost_ns: timed.cost_ns,
            cost_of: timed.name.clone(),
            conditions,
        })
    }
}

/// Why an experiment could not be made.
#[derive(Debug, thiserror::Error)]
pub enum ExperimentError {
    /// A scheme could not be run, or a recording not be read.
    #[error(transparent)]
    Evaluation(#[from] EvaluationError),
    /// A recording could not be opened.
    #[error(transparent)]
    Recording(#[from] northing_recording::RecordingError),
    /// Too many flights, or too few.
    #[error("{flights} flights of {name}: expected from 2 to {most} of this length")]
    Flights {
        /// Condition.
        name: String,
        /// What was asked for.
        flights: u64,
        /// What fits into memory.
        most: u64,
    },
    /// Nothing to score.
    #[error(
        "{name}: {found} of its recordings have gyroscope, accelerometer, magnetometer and a reference attitude; expected \
         at least 2, one to tune on and one to score"
    )]
    TooFew {
        /// Folder.
        name: String,
        /// How many there are.
        found: usize,
    },
}

impl Experiment {
    /// One simulated condition.
    ///
    /// # Errors
    /// The scenario asks for something that no scheme can do.
    pub fn simulated(&self, scenario: &FlightScenario) -> Result<Condition, ExperimentError> {
        self.check(scenario)?;
        let flights = |from: u64| -> Vec<ObserverData> {
            (from..from + self.flights)
                .into_par_iter()
                .map(|number| ObserverData::flight(scenario, self.seed, number))
                .collect()
        };
        let (scored, tuned_on) = (flights(0), flights(self.flights));
        let acceleration = scenario.ekf.linear_acceleration_std_m_s2;
        let case = Case {
            scored: &scored,
            tuned_on: &tuned_on,
            metric: scenario.meta.metric,
            aggregate: Aggregate::RootMeanSquare,
            grid: Grid {
                attitude_gains: vec![0.1, 0.2, 0.5, 1.0, 2.0, 5.0],
                bias_gains: vec![0.0, 0.005, 0.02, 0.1, 0.3],
                accelerometer_weights: vec![0.1, 0.3, 1.0],
                linear_acceleration_stds: [1.0, 2.0, 4.0].map(|x| x * acceleration).to_vec(),
                field_stds: vec![0.0],
            },
            default: default_gains(acceleration, 0.0),
        };
        let last = 2 * self.flights - 1;
        case.judge(
            &scenario.meta.name,
            &scenario.meta.title,
            format!("flights {} to {last}", self.flights),
            format!("flights 0 to {}", self.flights - 1),
        )
    }

    /// Whether the flights of a condition fit into memory.
    ///
    /// # Errors
    /// There are less than two, or too many of that length.
    pub fn check(&self, scenario: &FlightScenario) -> Result<(), ExperimentError> {
        let samples = scenario.meta.duration_s * scenario.gyroscope.rate_hz;
        let most = (MOST_SAMPLES / samples.max(1.0)) as u64;
        if (2..=most).contains(&self.flights) {
            return Ok(());
        }
        Err(ExperimentError::Flights {
            name: scenario.meta.name.clone(),
            flights: self.flights,
            most,
        })
    }

    /// Recordings with reference, in the order given: the odd ones are tuned on, the even ones scored,
    /// once with the magnetometer and once without.
    ///
    /// # Errors
    /// There are less than two.
    pub fn recorded(name: &str, data: &[ObserverData]) -> Result<Vec<Condition>, ExperimentError> {
        check_recordings(name, data)?;
        let without: Vec<ObserverData> = data
            .iter()
            .map(ObserverData::without_magnetometer)
            .collect();
        let title = format!("{} recordings of {name}", data.len());
        let blind = format!("{title}, accelerometer alone");
        Ok(vec![
            judge_recordings(name, &title, data)?,
            judge_recordings(&format!("{name}-accelerometer-only"), &blind, &without)?,
        ])
    }
}

/// Whether recordings can be halved.
///
/// # Errors
/// There are less than two.
pub fn check_recordings(name: &str, data: &[ObserverData]) -> Result<(), ExperimentError> {
    if data.len() < 2 {
        return Err(ExperimentError::TooFew {
            name: name.to_owned(),
            found: data.len(),
        });
    }
    Ok(())
}

/// Recordings that have a reference and all three sensors, decimated.
///
/// # Errors
/// A recording cannot be opened or read.
pub fn read_all(
    paths: &[PathBuf],
    options: &OpenOptions,
) -> Result<Vec<ObserverData>, ExperimentError> {
    let read = |path: &PathBuf| -> Result<ObserverData, ExperimentError> {
        let mut recording = northing_recording::open(path, options)?;
        Ok(ObserverData::recording(&mut recording)?)
    };
    let all: Result<Vec<_>, _> = paths.par_iter().map(read).collect();
    let complete = |data: &ObserverData| {
        let rows = data.angular_rate.len();
        data.truth.iter().any(Option::is_some)
            && data.specific_force.len() == rows
            && data.magnetic_field.len() == rows
    };
    Ok(all?.into_iter().filter(complete).collect())
}

fn judge_recordings(
    name: &str,
    title: &str,
    data: &[ObserverData],
) -> Result<Condition, ExperimentError> {
    let half =
        |odd: usize| -> Vec<ObserverData> { data.iter().skip(odd).step_by(2).cloned().collect() };
    let (scored, tuned_on) = (half(0), half(1));
    let case = Case {
        scored: &scored,
        tuned_on: &tuned_on,
        metric: data[0].metric(),
        aggregate: Aggregate::Mean,
        grid: Grid {
            attitude_gains: vec![0.1, 0.2, 0.4, 0.8, 1.6, 4.0],
            bias_gains: vec![0.0, 0.005, 0.02, 0.1, 0.3],
            accelerometer_weights: vec![0.1, 0.3, 1.0, 3.0],
            linear_acceleration_stds: vec![0.5, 1.0, 3.0, 8.0],
            field_stds: vec![2.0, 4.0, 16.0],
        },
        default: default_gains(0.5, 2.0),
    };
    let names = |half: &[ObserverData]| {
        let names: Vec<&str> = half.iter().map(|d| d.name.as_str()).collect();
        names.join(", ")
    };
    case.judge(name, title, names(&tuned_on), names(&scored))
}

/// One condition on its way to a verdict.
struct Case<'a> {
    scored: &'a [ObserverData],
    tuned_on: &'a [ObserverData],
    metric: Metric,
    aggregate: Aggregate,
    grid: Grid,
    default: Gains,
}

impl Case<'_> {
    fn judge(
        &self,
        name: &str,
        title: &str,
        tuned_on: String,
        scored_on: String,
    ) -> Result<Condition, ExperimentError> {
        let gains = self.chosen(Form::Printed)?;
        let northing_gains = self.chosen(Form::Northing)?;
        let compare = |form, g: &ChosenGains| self.compare(form, [g.original, g.modified, g.ekf]);
        let tuned = compare(Form::Printed, &gains)?;
        let weighted_gains = self.best(Scheme::OriginalWeighted, Form::Printed)?;
        let weighted = self.scores(Scheme::OriginalWeighted, Form::Printed, &weighted_gains)?;
        let weighted = self.aggregate.of(&self.errors(&weighted));
        Ok(Condition {
            name: name.to_owned(),
            title: title.to_owned(),
            metric: self.metric,
            tuned_on,
            scored_on,
            scored: self.scored.len(),
            original_weighted_deg: weighted,
            original_weighted_gains: weighted_gains,
            gain_over_weighted_percent: 100.0 * (1.0 - tuned.modified_deg / weighted),
            tuned,
            default: self.compare(Form::Printed, [self.default; 3])?,
            northing: compare(Form::Northing, &northing_gains)?,
            gains,
            northing_gains,
            position_without_rate_term_m: self.without_rate_term()?,
            cost_ns: cost::measure(&self.scored[0], &self.default)?,
        })
    }

    fn best(&self, scheme: Scheme, form: Form) -> Result<Gains, EvaluationError> {
        let (data, grid) = (self.tuned_on, &self.grid);
        best(data, scheme, form, grid, self.metric, self.aggregate)
    }

    fn chosen(&self, form: Form) -> Result<ChosenGains, EvaluationError> {
        Ok(ChosenGains {
            original: self.best(Scheme::Original, form)?,
            modified: self.best(Scheme::Modified, form)?,
            ekf: self.best(Scheme::Ekf, form)?,
        })
    }

    fn scores(
        &self,
        scheme: Scheme,
        form: Form,
        gains: &Gains,
    ) -> Result<Vec<Score>, EvaluationError> {
        let one = |data: &ObserverData| Ok(scores(data, scheme, form, &[*gains])?[0]);
        self.scored.par_iter().map(one).collect()
    }

    fn errors(&self, scores: &[Score]) -> Vec<f64> {
        scores.iter().map(|s| s.of(self.metric)).collect()
    }

    fn compare(
        &self,
        form: Form,
        [original, modified, ekf]: [Gains; 3],
    ) -> Result<Comparison, EvaluationError> {
        let all = [
            self.scores(Scheme::Original, form, &original)?,
            self.scores(Scheme::Modified, form, &modified)?,
            self.scores(Scheme::Ekf, form, &ekf)?,
        ];
        let errors = [0, 1, 2].map(|i| self.errors(&all[i]));
        let [original_deg, modified_deg, ekf_deg] =
            [0, 1, 2].map(|i| self.aggregate.of(&errors[i]));
        let intervals = [0, 1, 2].map(|i| error_ci95(&errors[i], self.aggregate));
        let gain = Gain::between(&errors[0], &errors[1], self.aggregate);
        let means = [0, 1, 2].map(|i| self.mean(&all[i]));
        let has_position = self.scored[0].position.is_some();
        let better = |of: fn(&Score) -> f64| {
            has_position.then(|| 100.0 * (1.0 - of(&means[1]) / of(&means[0])))
        };
        Ok(Comparison {
            original_deg,
            original_ci95: intervals[0],
            modified_deg,
            modified_ci95: intervals[1],
            ekf_deg,
            ekf_ci95: intervals[2],
            gain_percent: gain.percent,
            gain_ci95: gain.ci95,
            position_gain_percent: better(|s| s.position_m),
            velocity_gain_percent: better(|s| s.velocity_m_s),
            scores: means,
        })
    }

    /// Each number over the flights; the time to settle as the median.
    fn mean(&self, scores: &[Score]) -> Score {
        let over = |of: fn(&Score) -> f64| {
            let values: Vec<f64> = scores.iter().map(of).collect();
            self.aggregate.of(&values)
        };
        let mut settled: Vec<f64> = scores.iter().map(|s| s.settled_s).collect();
        settled.sort_by(f64::total_cmp);
        Score {
            total_deg: over(|s| s.total_deg),
            inclination_deg: over(|s| s.inclination_deg),
            heading_deg: over(|s| s.heading_deg),
            position_m: over(|s| s.position_m),
            velocity_m_s: over(|s| s.velocity_m_s),
            settled_s: settled.get(settled.len() / 2).copied().unwrap_or(f64::NAN),
        }
    }

    /// What the position observer behind the original would do without its rotation-rate term, m.
    fn without_rate_term(&self) -> Result<Option<f64>, EvaluationError> {
        let one = |data: &ObserverData| -> Result<Option<f64>, EvaluationError> {
            let Some(position) = &data.position else {
                return Ok(None);
            };
            let explicit = northing_core::attitude::complementary::ComplementaryForm::Explicit;
            let form = Form::Printed;
            let estimates = schemes::original(data, explicit, &self.default, form)?;
            let [error, _] = schemes::position_errors(data, position, &estimates, false)?;
            Ok(Some(error))
        };
        let errors: Result<Vec<Option<f64>>, _> = self.scored.par_iter().map(one).collect();
        let errors: Option<Vec<f64>> = errors?.into_iter().collect();
        Ok(errors.map(|e| self.aggregate.of(&e)))
    }
}
