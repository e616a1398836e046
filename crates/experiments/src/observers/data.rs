//! Data that observers are run over: samples of one rate with a truth, from a simulated flight or a recording.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use northing_core::attitude::wahba;
use northing_core::attitude::{InitialState, References};
use northing_recording::{Event, Recording, Sample};
use northing_simulation::scenario::FlightRun;
use northing_simulation::scenario::flight_schema::{FlightScenario, Metric};
use northing_simulation::world::{STANDARD_GRAVITY_M_S2, specific_force_at_rest};

use northing_evaluation::EvaluationError;

/// Samples of a recording that are averaged into one, as a chip of a third of the rate would see them.
pub const DECIMATION: usize = 3;
/// Decimated samples whose mean gives the start of a recording.
const START_SAMPLES: usize = 50;
/// Rows that a gap is filled with at most: beyond, a recording is two.
const MOST_MISSING: f64 = 10_000.0;
/// A sample later than this after a gyroscope sample does not belong to it, ns.
const LONGEST_NS: i64 = 100_000_000;
/// Variance of each quaternion component at the start is 0.1, that of the angle four times that.
const START_VARIANCE: f64 = 0.4;
/// Standard deviation of the bias at the start, rad/s.
const START_BIAS_STD: f64 = 0.05;

/// Noise of each sample as the EKF is told.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SampleNoise {
    /// Gyroscope, rad/s.
    pub rate_std: f64,
    /// Random walk of its bias, rad/s/sqrt(s).
    pub bias_random_walk: f64,
    /// Accelerometer, m/s^2.
    pub force_std: f64,
    /// Magnetometer, microtesla.
    pub field_std: f64,
}

/// Positions and what is true of them.
#[derive(Debug, Clone, PartialEq)]
pub struct PositionData {
    /// Measured at the start, m.
    pub start: Vector3<f64>,
    /// Index of the sample and position, m.
    pub measured: Vec<(usize, Vector3<f64>)>,
    /// True position (m) and velocity (m/s) at each sample.
    pub truth: Vec<(Vector3<f64>, Vector3<f64>)>,
    /// Pole of the observer, 1/s.
    pub pole: f64,
}

/// Samples with a truth. World axes are east, north, up.
#[derive(Debug, Clone, PartialEq)]
pub struct ObserverData {
    /// Name of the recording, or number of the flight.
    pub name: String,
    /// From one sample to the next, s.
    pub interval_s: f64,
    /// Angular rate over the interval that ends at each sample, rad/s, body axes.
    pub angular_rate: Vec<Vector3<f64>>,
    /// Specific force, m/s^2.
    pub specific_force: Vec<Vector3<f64>>,
    /// Magnetic field, microtesla; empty without magnetometer.
    pub magnetic_field: Vec<Vector3<f64>>,
    /// True attitude where it counts, `world_from_body`.
    pub truth: Vec<Option<UnitQuaternion<f64>>>,
    /// What the observers start from, `world_from_body`.
    pub start: UnitQuaternion<f64>,
    /// The undisturbed field, microtesla.
    pub reference_field: Vector3<f64>,
    /// What the EKF is told about the sensors.
    pub noise: SampleNoise,
    /// Positions, where there are any.
    pub position: Option<PositionData>,
}

impl ObserverData {
    /// A flight of a scenario.
    #[must_use]
    pub fn flight(scenario: &FlightScenario, seed: u64, number: u64) -> Self {
        let run = FlightRun::simulate(scenario, seed, number);
        let scored = scenario.meta.scored_from_s..=scenario.scored_until_s();
        let time = |k: usize| (k + 1) as f64 * run.interval_s;
        let truth = run.truth.iter().enumerate();
        Self {
            name: number.to_string(),
            interval_s: run.interval_s,
            truth: truth
                .map(|(k, t)| scored.contains(&time(k)).then_some(t.world_from_body))
                .collect(),
            start: run.start_attitude,
            reference_field: run.reference_field,
            noise: SampleNoise {
                rate_std: scenario.gyroscope.noise_std_rad_s,
                bias_random_walk: scenario.gyroscope.bias_random_walk_rad_s_sqrt_s,
                force_std: scenario.accelerometer.noise_std_m_s2,
                field_std: scenario.magnetometer.noise_std_ut,
            },
            position: Some(PositionData {
                start: run.start_position,
                measured: run.positions,
                truth: run.truth.iter().map(|t| (t.position, t.velocity)).collect(),
                pole: scenario.position.pole_per_s,
            }),
            angular_rate: run.angular_rate,
            specific_force: run.specific_force,
            magnetic_field: run.magnetic_field,
        }
    }

    /// A recording with reference, decimated by averaging [`DECIMATION`] samples. Samples that are
    /// missing or not finite are filled in linearly; without reference nothing is scored.
    ///
    /// # Errors
    /// The recording ends in an error.
    pub fn recording(recording: &mut Recording) -> Result<Self, EvaluationError> {
        let metadata = recording.metadata().clone();
        let mut rows = Rows::default();
        for event in recording {
            let event = event.map_err(|error| EvaluationError::Recording(Box::new(error)))?;
            rows.add(&event);
        }
        rows.fill_gaps();
        let interval_s = rows.interval_s() * DECIMATION as f64;
        let [rates, forces, fields] =
            [&rows.rates, &rows.forces, &rows.fields].map(|v| decimated(v));
        let truth = rows
            .truth
            .chunks_exact(DECIMATION)
            .map(|c| c[DECIMATION - 1]);
        let stated = metadata
            .extra
            .get("mag_world_mean")
            .and_then(|text| numbers(text));
        let (start, field) = start(&forces, &fields, stated);
        Ok(Self {
            name: metadata.name,
            interval_s,
            truth: truth.collect(),
            start,
            reference_field: field,
            noise: SampleNoise {
                rate_std: 0.005,
                bias_random_walk: 5e-5,
                force_std: 0.0,
                field_std: 0.0,
            },
            position: None,
            angular_rate: rates,
            specific_force: forces,
            magnetic_field: fields,
        })
    }

    /// The same without its magnetometer.
    #[must_use]
    pub fn without_magnetometer(&self) -> Self {
        Self {
            magnetic_field: Vec::new(),
            ..self.clone()
        }
    }

    /// Which error counts: without a magnetometer nobody knows the heading.
    #[must_use]
    pub fn metric(&self) -> Metric {
        if self.magnetic_field.is_empty() {
            Metric::Inclination
        } else {
            Metric::Total
        }
    }

    /// The state that every observer starts from.
    #[must_use]
    pub fn initial_state(&self) -> InitialState<f64> {
        let has_field = !self.magnetic_field.is_empty();
        InitialState {
            attitude: self.start,
            attitude_covariance: Matrix3::from_diagonal_element(START_VARIANCE),
            gyroscope_bias: Vector3::zeros(),
            gyroscope_bias_std: START_BIAS_STD,
            north_known: true,
            references: References {
                specific_force: specific_force_at_rest(),
                magnetic_field: has_field.then_some(self.reference_field),
            },
        }
    }
}

/// The samples of a recording, one row for each gyroscope sample.
#[derive(Debug, Default)]
struct Rows {
    times_ns: Vec<i64>,
    rates: Vec<Vector3<f64>>,
    forces: Vec<Vector3<f64>>,
    fields: Vec<Vector3<f64>>,
    truth: Vec<Option<UnitQuaternion<f64>>>,
}

impl Rows {
    fn add(&mut self, event: &Event) {
        if let Sample::AngularRate(rate) = event.sample {
            self.push(event.time_ns, rate);
            return;
        }
        // What comes between two gyroscope samples belongs to the one before.
        let since = |last: &i64| event.time_ns.saturating_sub(*last);
        if !self
            .times_ns
            .last()
            .map(since)
            .is_some_and(|ns| (0..LONGEST_NS).contains(&ns))
        {
            return;
        }
        let last = self.times_ns.len() - 1;
        match event.sample {
            Sample::SpecificForce(force) => self.forces[last] = force,
            Sample::MagneticField(field) => self.fields[last] = field,
            Sample::Reference(reference) if reference.scored && event.sample.is_finite() => {
                self.truth[last] = Some(reference.attitude);
            }
            _ => {}
        }
    }

    /// Puts rows without samples where the gyroscope is silent for longer than one interval.
    fn fill_gaps(&mut self) {
        let interval = (self.interval_s() * 1e9).max(1.0);
        let mut filled = Self::default();
        for (k, time) in self.times_ns.iter().enumerate() {
            let before = filled.times_ns.last().copied().unwrap_or(*time);
            let missing = ((time.saturating_sub(before)) as f64 / interval).round() - 1.0;
            for _ in 0..missing.clamp(0.0, MOST_MISSING) as usize {
                filled.push(before, Vector3::repeat(f64::NAN));
            }
            filled.push(*time, self.rates[k]);
            let last = filled.times_ns.len() - 1;
            filled.forces[last] = self.forces[k];
            filled.fields[last] = self.fields[k];
            filled.truth[last] = self.truth[k];
        }
        *self = filled;
    }

    fn push(&mut self, time_ns: i64, rate: Vector3<f64>) {
        self.times_ns.push(time_ns);
        self.rates.push(rate);
        self.forces.push(Vector3::repeat(f64::NAN));
        self.fields.push(Vector3::repeat(f64::NAN));
        self.truth.push(None);
    }

    /// Median interval, s.
    fn interval_s(&self) -> f64 {
        let pairs = self.times_ns.windows(2);
        let mut steps: Vec<i64> = pairs.map(|w| w[1] - w[0]).collect();
        steps.sort_unstable();
        steps
            .get(steps.len() / 2)
            .map_or(0.01, |ns| *ns as f64 * 1e-9)
    }
}

/// Means of [`DECIMATION`] samples, after gaps are filled in; nothing where there is no sample at all.
fn decimated(samples: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let good = |v: &Vector3<f64>| v.iter().all(|x| x.is_finite());
    let known: Vec<usize> = (0..samples.len()).filter(|k| good(&samples[*k])).collect();
    if known.is_empty() {
        return Vec::new();
    }
    let filled: Vec<Vector3<f64>> = (0..samples.len())
        .map(|k| {
            let after = known.partition_point(|i| *i < k);
            let next = known.get(after).or(known.last());
            let before = known.get(after.saturating_sub(1));
            match (before, next) {
                (Some(&a), Some(&b)) if a < k && k < b => {
                    let share = (k - a) as f64 / (b - a) as f64;
                    samples[a].lerp(&samples[b], share)
                }
                (_, Some(&b)) => samples[b],
                _ => Vector3::zeros(),
            }
        })
        .collect();
    let means = filled.chunks_exact(DECIMATION);
    means
        .map(|c| c.iter().sum::<Vector3<f64>>() / DECIMATION as f64)
        .collect()
}

/// Attitude and field at the start, from the mean of the first samples by TRIAD. The field's parts
/// along north and up are those that the recording states, or those that are measured there.
fn start(
    forces: &[Vector3<f64>],
    fields: &[Vector3<f64>],
    stated: Option<Vector3<f64>>,
) -> (UnitQuaternion<f64>, Vector3<f64>) {
    let mean = |v: &[Vector3<f64>]| {
        let n = v.len().min(START_SAMPLES);
        v[..n].iter().sum::<Vector3<f64>>() / n.max(1) as f64
    };
    let (force, field) = (mean(forces), mean(fields));
    let up = force / force.norm().max(f64::MIN_POSITIVE);
    let reference = stated.map_or_else(
        || {
            let along_up = field.dot(&up);
            Vector3::new(0.0, (field - up * along_up).norm(), along_up)
        },
        |world| Vector3::new(0.0, world.xy().norm(), world.z),
    );
    let attitude = wahba::triad(&force, &field, &Vector3::z(), &reference)
        .unwrap_or_else(|| wahba::level(&force, &Vector3::new(0.0, 0.0, STANDARD_GRAVITY_M_S2)));
    (attitude, reference)
}

/// Three numbers of a text such as `[0.1, 18.3, -44.0]`.
fn numbers(text: &str) -> Option<Vector3<f64>> {
    let inner = text
        .trim()
        .trim_start_matches(['[', '('])
        .trim_end_matches([']', ')']);
    let parsed: Result<Vec<f64>, _> = inner.split(',').map(|part| part.trim().parse()).collect();
    match parsed.ok()?.as_slice() {
        [x, y, z] if x.is_finite() && y.is_finite() && z.is_finite() => {
            Some(Vector3::new(*x, *y, *z))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_are_filled_before_samples_are_averaged() {
        let nan = f64::NAN;
        let values = [nan, 1.0, nan, nan, 4.0, nan, nan].map(Vector3::repeat);
        // Filled: 1, 1, 2, 3, 4, 4, 4; the seventh has no companions.
        let means: Vec<f64> = decimated(&values).iter().map(|v| v.x).collect();
        assert_eq!(means.len(), 2);
        assert!((means[0] - 4.0 / 3.0).abs() < 1e-12 && (means[1] - 11.0 / 3.0).abs() < 1e-12);
        assert!(decimated(&[Vector3::repeat(nan); 9]).is_empty());
    }

    #[test]
    fn a_silent_gyroscope_leaves_rows_and_late_samples_belong_to_the_row_before() {
        let mut rows = Rows::default();
        let event = |time_ms: i64, sample| Event {
            time_ns: time_ms * 1_000_000,
            sample,
        };
        for time_ms in [0, 10, 20, 50, 60] {
            rows.add(&event(time_ms, Sample::AngularRate(Vector3::x())));
        }
        rows.add(&event(63, Sample::SpecificForce(Vector3::z())));
        rows.add(&event(900, Sample::SpecificForce(Vector3::y())));
        rows.fill_gaps();
        assert!((rows.interval_s() - 0.01).abs() < 0.0101);
        let known: Vec<bool> = rows.rates.iter().map(|r| r.x.is_finite()).collect();
        assert_eq!(known, [true, true, true, false, false, true, true]);
        assert_eq!(rows.forces[6], Vector3::z());
    }

    #[test]
    fn a_stated_field_is_read_and_turned_to_north() {
        assert_eq!(
            numbers("[3.0, 4.0, -40.0]"),
            Some(Vector3::new(3.0, 4.0, -40.0))
        );
        assert_eq!(numbers("[3.0, nan, -40.0]"), None);
        assert_eq!(numbers("none"), None);
        let forces = [Vector3::new(0.0, 0.0, 9.8)];
        let fields = [Vector3::new(0.0, 20.0, -40.0)];
        let (attitude, field) = start(&forces, &fields, numbers("[3, 4, -40]"));
        assert_eq!(field, Vector3::new(0.0, 5.0, -40.0));
        assert!(attitude.angle() < 1e-12);
        let (_, measured) = start(&forces, &fields, None);
        assert!((measured - Vector3::new(0.0, 20.0, -40.0)).norm() < 1e-12);
    }
}
