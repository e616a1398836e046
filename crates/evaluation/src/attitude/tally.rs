//! Counters of a run, and how they become its outcome.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use northing_core::attitude::{InitialState, Propagation};
use northing_core::calibration::RestCalibration;
use northing_core::faults::{Fault, FaultySensor};
use northing_core::kalman::SkipReason;
use northing_recording::{Sample, SensorKind};

use crate::attitude::field_watch::FieldWatch;
use crate::attitude::final_test::FinalTest;
use crate::attitude::observability::{self, Present};
use crate::attitude::reference::ReferenceWatch;
use crate::attitude::{
    EstimateRecord, EstimatorKind, Gaps, InnovationRecord, Instant, NisOf, PerSensor,
    ReferenceSummary, RunObserver, RunOptions, RunSummary,
};
use crate::calibration::magnetometer::MagnetometerSource;
use crate::statistics::consistency::{self, JudgeBy, SensorVerdict};
use crate::statistics::faults::FaultTally;
use crate::statistics::metrics::{ErrorStatistics, HeadingReference};
use crate::statistics::nis::{NisStatistics, NisSummary, UpdateCounts};
use crate::statistics::seconds_between;
use crate::statistics::verdict::{Diagnosis, Stated};
use crate::used_parameters::{Named, UsedCalibrations, UsedParameter, VERSION};

/// Fewer zeros than this may be chance.
const FEWEST_ZEROS: u64 = 100;

/// Counts samples, updates, gaps, scores; constant memory.
#[derive(Debug, Clone, Default)]
pub(crate) struct Tally {
    /// Whether it counts estimates alone.
    is_idle: bool,
    skip_s: f64,
    first_ns: Option<i64>,
    last_ns: i64,
    samples: [u64; SensorKind::ALL.len()],
    updates: PerSensor<UpdateCounts>,
    nis: [NisStatistics; 3],
    present: Present,
    /// Stamps of the first and last samples of gyroscope, accelerometer, magnetometer and reference, ns.
    spans: [Option<[i64; 2]>; 4],
    last_rate_ns: Option<i64>,
    gaps: Gaps,
    scores: ErrorStatistics,
    reference: ReferenceWatch,
    /// Whether the state at the start knew where north is.
    initial_north: bool,
    final_test: FinalTest,
    estimates: u64,
    first_estimate_s: Option<f64>,
    watch: FieldWatch,
    rates: Rates,
    diagnosis: Diagnosis,
    faults: FaultTally,
    gyroscope_is_faulty: bool,
    parameters: Vec<UsedParameter>,
    calibrations: UsedCalibrations,
}

/// Angular rates read, and those of them that are exactly zero.
#[derive(Debug, Clone, Copy, Default)]
struct Rates {
    all: u64,
    zero: u64,
}

impl Tally {
    pub(crate) fn new(options: &RunOptions) -> Self {
        Self {
            skip_s: options.skip_s,
            gaps: Gaps {
                limit_s: options.driver.gap_limit_s,
                ..Gaps::default()
            },
            reference: ReferenceWatch::new(options),
            ..Self::default()
        }
    }

    /// One that counts estimates alone, for runs that nobody judges.
    pub(crate) fn idle(options: &RunOptions) -> Self {
        Self {
            is_idle: true,
            ..Self::new(options)
        }
    }

    /// Keeps what the estimator was configured with: options in force, and the calibration at rest.
    pub(crate) fn configured(&mut self, options: &RunOptions, rest: Option<&RestCalibration<f64>>) {
        let [rest_name, field_name] = &options.calibration_names;
        self.parameters = options.parameters();
        self.diagnosis.configured(stated(options));
        self.calibrations = UsedCalibrations {
            rest: rest.map(|calibration| Named {
                name: rest_name.clone(),
                values: *calibration,
            }),
            magnetometer: options.magnetometer_calibration.map(|calibration| Named {
                name: field_name.clone(),
                values: calibration,
            }),
        };
    }

    /// Takes what was read at one instant; `force` and `field` are of the sensors in use.
    pub(crate) fn read(
        &mut self,
        instant: &Instant,
        force: Option<Vector3<f64>>,
        field: Option<Vector3<f64>>,
    ) {
        self.first_ns.get_or_insert(instant.time_ns);
        self.last_ns = instant.time_ns;
        if self.is_idle {
            return;
        }
        for kind in instant.sensors() {
            self.samples[kind.order()] += 1;
        }
        self.diagnose(instant, force, field);
        let has = [
            instant.angular_rate.is_some(),
            force.is_some(),
            field.is_some(),
            instant.reference.is_some(),
        ];
        for (span, has) in self.spans.iter_mut().zip(has) {
            if has {
                let [first, _] = span.unwrap_or([instant.time_ns; 2]);
                *span = Some([first, instant.time_ns]);
            }
        }
        self.present.accelerometer |= force.is_some_and(usable);
        self.present.magnetometer |= field.is_some_and(usable);
        self.final_test.measured(instant, field);
        // Rates that are none would show a reference to be another recording's.
        let seen = match self.gyroscope_is_faulty {
            true => Instant {
                angular_rate: None,
                ..*instant
            },
            false => *instant,
        };
        self.reference.read(&seen);
        let time_s = self.time_s(instant.time_ns);
        if let Some(rate) = instant.angular_rate {
            self.rates.all += 1;
            self.rates.zero += u64::from(rate == Vector3::zeros());
            self.watch.rate(&rate);
        }
        if let Some(field) = field {
            self.watch.field(time_s, &field);
        }
        if instant
            .angular_rate
            .is_some_and(|rate| rate.norm_squared().is_finite())
        {
            self.watch_gap(instant.time_ns);
        }
    }

    /// Shows the samples of the sensors in use to what looks for causes.
    fn diagnose(
        &mut self,
        instant: &Instant,
        force: Option<Vector3<f64>>,
        field: Option<Vector3<f64>>,
    ) {
        let samples = [
            instant.angular_rate.map(Sample::AngularRate),
            force.map(Sample::SpecificForce),
            field.map(Sample::MagneticField),
        ];
        self.diagnosis.over_ground(
            instant.time_ns,
            instant.fix.as_ref(),
            instant.ground_velocity.as_ref(),
        );
        for sample in samples.iter().flatten() {
            self.diagnosis
                .sample(instant.time_ns, instant.late_ns, sample);
        }
        self.diagnosis.same_stamp(u64::from(instant.rates_before));
    }

    fn watch_gap(&mut self, now_ns: i64) {
        if let Some(last_ns) = self.last_rate_ns.replace(now_ns) {
            let pause = seconds_between(last_ns, now_ns);
            if pause > self.gaps.limit_s {
                self.gaps.count += 1;
                if pause > self.gaps.longest_s {
                    self.gaps.longest_s = pause;
                    self.gaps.longest_start_s = self.time_s(last_ns);
                }
            }
        }
    }

    /// Seconds since the first sample.
    pub(crate) fn time_s(&self, time_ns: i64) -> f64 {
        seconds_between(self.first_ns.unwrap_or(time_ns), time_ns)
    }

    /// Seconds from the first to the last sample; those of a reference on another clock do not count.
    fn duration_s(&self) -> f64 {
        let [rates, .., reference] = self.spans;
        match rates.filter(|_| self.apart(reference).is_some()) {
            Some([first, last]) => seconds_between(first, last),
            None => self.time_s(self.last_ns),
        }
    }

    /// That a span of stamps has no time in common with the gyroscope's, with both.
    fn apart(&self, span: Option<[i64; 2]>) -> Option<String> {
        let ([from, to], [first, last]) = (self.spans[0]?, span?);
        (last < from || first > to).then(|| {
            let [from, to, first, last] = [from, to, first, last].map(|ns| self.time_s(ns));
            format!(
                "They are from {first:.1} s to {last:.1} s, those of the gyroscope from {from:.1} s to {to:.1} s: two clocks, or two \
                 recordings."
            )
        })
    }

    pub(crate) fn propagated(&mut self, propagation: Propagation) {
        match propagation {
            Propagation::Done => self.updates.gyroscope.fused += 1,
            Propagation::Skipped(reason) => self.updates.gyroscope.skip(reason),
        }
    }

    pub(crate) fn updated(&mut self, record: &InnovationRecord) {
        if self.is_idle {
            return;
        }
        let (sensor, innovation) = (record.sensor, &record.innovation);
        let (counts, nis) = match sensor {
            SensorKind::Accelerometer => (&mut self.updates.accelerometer, &mut self.nis[0]),
            SensorKind::CompassHeading => (&mut self.updates.compass, &mut self.nis[2]),
            _ => (&mut self.updates.magnetometer, &mut self.nis[1]),
        };
        counts.add(innovation.outcome);
        let fused = innovation.outcome.is_fused();
        self.present.compass |= fused && sensor == SensorKind::CompassHeading;
        nis.add(innovation);
        self.diagnosis
            .innovation(record.time_ns, sensor, innovation);
    }

    /// Takes a fault of the samples.
    pub(crate) fn faulted(&mut self, fault: &Fault<f64>) {
        if fault.sensor == FaultySensor::Gyroscope {
            self.gyroscope_is_faulty = !fault.is_over;
        }
        self.faults.add(self.first_ns.unwrap_or_default(), fault);
    }

    /// Samples that went into a calibration instead of an update.
    pub(crate) fn calibrated_with(&mut self, gyroscope: bool, force: bool, field: bool) {
        let used = [
            (gyroscope, &mut self.updates.gyroscope),
            (force, &mut self.updates.accelerometer),
            (field, &mut self.updates.magnetometer),
        ];
        for (_, counts) in used.into_iter().filter(|(present, _)| *present) {
            counts.skip_because("used for the calibration");
        }
    }

    /// Takes what the estimator started from.
    pub(crate) fn started(&mut self, start: &InitialState<f64>) {
        self.initial_north |= start.north_known || start.references.magnetic_field.is_some();
    }

    /// Takes an estimate, tells it, and scores it at the references up to its instant.
    pub(crate) fn estimated(&mut self, record: &EstimateRecord, observer: &mut dyn RunObserver) {
        self.estimates += 1;
        self.first_estimate_s.get_or_insert(record.time_s);
        if self.is_idle {
            observer.estimate(record);
            return;
        }
        self.final_test
            .estimated(&record.attitude, record.attitude_covariance);
        let (scores, skip_s) = (&mut self.scores, self.skip_s);
        self.reference.estimated(record, |scored| {
            if scored.reference.scored && scored.time_s >= skip_s {
                let covariance = scored.attitude_covariance.as_ref();
                scores.add(&scored.attitude, covariance, &scored.reference.attitude);
            }
            observer.scored(scored);
        });
        observer.estimate(record);
    }

    /// What said where north is.
    fn heading(&self, runs_filter: bool) -> HeadingReference {
        let updates = &self.updates;
        if !runs_filter {
            HeadingReference::Device
        } else if updates.magnetometer.fused + updates.compass.fused > 0 {
            HeadingReference::Measured
        } else if self.initial_north {
            HeadingReference::Initial
        } else {
            HeadingReference::Arbitrary
        }
    }

    /// Samples read of one kind.
    fn samples_of(&self, kind: SensorKind) -> u64 {
        self.samples[kind.order()]
    }

    /// What it all comes to. `runs_filter` is false for what only reads a column.
    pub(crate) fn summary(&self, options: &RunOptions, runs_filter: bool) -> RunSummary {
        let [accelerometer, magnetometer, compass] =
            self.nis.each_ref().map(NisStatistics::summary);
        let nis = NisOf {
            accelerometer,
            magnetometer,
            compass,
        };
        let heading = self.heading(runs_filter);
        let error_deg = self.scores.summary(heading);
        let nees = self.scores.nees(heading);
        let scored = error_deg.map_or(0, |error| error.scored_samples);
        let samples = self.samples_of(SensorKind::Reference);
        let reference = self.reference.summary(samples, scored, options);
        let issues = self.issues(reference.as_ref(), runs_filter);
        let verdicts = self.verdicts(&nis, options);
        let mut unobservable = Vec::new();
        if runs_filter {
            let other = match options.sensors.magnetometer_source {
                MagnetometerSource::Device => SensorKind::MagnetometerUncalibrated,
                MagnetometerSource::Uncalibrated => SensorKind::Magnetometer,
            };
            let present = Present {
                other_magnetometer: self.samples_of(other) > 0,
                ..self.present
            };
            unobservable = observability::unobservable(present, &options.sensors);
        }
        RunSummary {
            estimator: options.estimator,
            recording: options.recording.clone(),
            duration_s: self.duration_s(),
            samples: self.sensor_samples(),
            updates: self.updates.clone(),
            heading,
            error_deg,
            reference,
            nees_mean: nees.map(|nees| nees.mean),
            nees,
            nis_mean: NisOf {
                accelerometer: nis.accelerometer.map(|n| n.mean),
                magnetometer: nis.magnetometer.map(|n| n.mean),
                compass: nis.compass.map(|n| n.mean),
            },
            final_test: self.final_test.summary(heading.is_known()),
            findings: match runs_filter {
                true => self.diagnosis.findings(&verdicts),
                false => Vec::new(),
            },
            faults: self.faults.records(),
            verdicts,
            nis,
            unobservable,
            magnetometer: (runs_filter && self.present.magnetometer)
                .then_some(options.sensors.magnetometer_source),
            hard_iron_prior_ut: (options.estimator == EstimatorKind::BoundedVelocity)
                .then_some(options.config.bounded_velocity.initial_hard_iron_std_ut),
            profile: runs_filter.then_some(options.profile),
            calibration: calibration_in_words(options).filter(|_| runs_filter),
            magnetometer_calibration: magnetometer_calibration_in_words(options)
                .filter(|_| runs_filter),
            smoothed: options.smooth,
            estimates: self.estimates,
            first_estimate_s: self.first_estimate_s,
            gaps: self.gaps,
            position: None,
            samples_per_sensor: self.samples_per_sensor(),
            issues,
            parameters: self.parameters.clone(),
            calibrations: self.calibrations.clone(),
            version: VERSION,
        }
    }

    fn sensor_samples(&self) -> u64 {
        SensorKind::ALL
            .into_iter()
            .filter(|kind| !kind.is_reference())
            .map(|kind| self.samples_of(kind))
            .sum()
    }

    fn samples_per_sensor(&self) -> BTreeMap<SensorKind, u64> {
        let counted = SensorKind::ALL
            .into_iter()
            .map(|kind| (kind, self.samples_of(kind)));
        counted.filter(|(_, count)| *count > 0).collect()
    }

    fn verdicts(&self, nis: &NisOf<NisSummary>, options: &RunOptions) -> Vec<SensorVerdict> {
        let updates = &self.updates;
        let judged = [
            (
                SensorKind::Accelerometer,
                nis.accelerometer.as_ref(),
                &updates.accelerometer,
            ),
            (
                SensorKind::Magnetometer,
                nis.magnetometer.as_ref(),
                &updates.magnetometer,
            ),
            (
                SensorKind::CompassHeading,
                nis.compass.as_ref(),
                &updates.compass,
            ),
        ];
        let judged = judged.into_iter().filter_map(|(sensor, nis, counts)| {
            let by = JudgeBy {
                correlation_time_s: options.correlation_time_s(sensor)?,
                is_coarse: self.diagnosis.is_coarse(sensor),
            };
            let all = nis?;
            let unexplained = self.diagnosis.unexplained(sensor).summary();
            let judged = unexplained.filter(|left| 2 * left.samples > all.samples);
            let judged = judged.as_ref().unwrap_or(all);
            Some(consistency::judge(sensor, judged, counts, by))
        });
        judged.collect()
    }

    /// Sensors of which no sample was looked at although the estimator uses them, a sentence each.
    fn unused_sensors(&self) -> Vec<String> {
        /// Fewer samples say nothing.
        const FEWEST: u64 = 10;
        let [_, force, field, _] = self.spans;
        let sensors = [
            (
                SensorKind::Accelerometer,
                force,
                &self.updates.accelerometer,
            ),
            (SensorKind::Magnetometer, field, &self.updates.magnetometer),
        ];
        let unused = sensors.into_iter().filter_map(|(sensor, span, counts)| {
            let (why, most) = (counts.skipped_because.iter()).max_by_key(|(_, count)| **count)?;
            let is_unused = counts.fused + counts.gated == 0 && counts.skipped >= FEWEST;
            if !is_unused || *why == SkipReason::NotUsed.description() {
                return None;
            }
            let apart = self
                .apart(span)
                .map_or(String::new(), |apart| format!(" {apart}"));
            let of_them = match *most == counts.skipped {
                true => String::new(),
                false => format!("{most} of them "),
            };
            Some(format!(
                "None of the {} samples of the {} was used: {of_them}{why}.{apart}",
                counts.skipped,
                sensor.name(),
            ))
        });
        unused.collect()
    }

    fn issues(&self, reference: Option<&ReferenceSummary>, runs_filter: bool) -> Vec<String> {
        let mut issues = Vec::new();
        if self.rates.all >= FEWEST_ZEROS && self.rates.zero == self.rates.all {
            issues.push(format!(
                "Every one of the {} gyroscope samples is exactly zero: the sensor is off, or its columns are \
                 empty; no turn can be followed.",
                self.rates.all
            ));
        }
        if runs_filter {
            issues.extend(self.unused_sensors());
        }
        issues.extend(self.faults.sentences());
        issues.extend(self.watch.sentences());
        if self.scores.not_finite() > 0 {
            issues.push(format!(
                "{} estimates are not finite and are not in the errors: the filter broke down; check its settings.",
                self.scores.not_finite()
            ));
        }
        let fixes = self.samples_of(SensorKind::GnssPosition);
        if runs_filter && fixes > 1 {
            issues.push(format!(
                "{fixes} fixes of a satellite receiver are not used by this estimator. In a vehicle, error-state estimates attitude and \
                 position with them."
            ));
        }
        let has_compass = self.samples_of(SensorKind::CompassHeading) > 0;
        if runs_filter && has_compass && self.present.compass && !self.present.magnetometer {
            issues.push(
                "No magnetometer is used: the heading is that of the device's own compass, with \
                 the uncertainty it states."
                    .to_owned(),
            );
        } else if runs_filter && has_compass && !self.present.compass {
            issues.push(
                "The device's own compass headings are left out: a magnetometer is there, or the \
                 list of sensors does not name `compass`."
                    .to_owned(),
            );
        }
        issues.extend(
            reference
                .iter()
                .flat_map(|r| r.sentences(self.skip_s, self.apart(self.spans[3]))),
        );
        issues
    }
}

/// What the options in force state of the sensors' white noise.
fn stated(options: &RunOptions) -> Stated {
    if options.estimator == EstimatorKind::BoundedVelocity {
        let own = &options.config.bounded_velocity;
        return Stated {
            gyroscope_noise_density: Some(own.gyroscope_noise_density),
            accelerometer_noise_density: Some(own.accelerometer_noise_density),
            accelerometer_std: None,
            magnetometer_std_ut: Some(own.magnetometer_std_ut),
            magnetometer_mean_s: Some(own.update_interval_s),
            hard_iron_std_ut: Some(own.initial_hard_iron_std_ut),
        };
    }
    if !options.estimator.info().has_covariance {
        return Stated::default();
    }
    let own = &options.config.attitude;
    Stated {
        gyroscope_noise_density: Some(own.gyroscope_noise_density),
        accelerometer_noise_density: None,
        accelerometer_std: Some(own.accelerometer_std),
        magnetometer_std_ut: Some(own.magnetometer_std_ut),
        magnetometer_mean_s: None,
        hard_iron_std_ut: None,
    }
}

fn calibration_in_words(options: &RunOptions) -> Option<String> {
    match (&options.calibration, options.calibrate_first_s) {
        (Some(_), _) => Some(made_before(&options.calibration_names[0])),
        (None, Some(seconds)) => Some(format!("from the first {seconds} s of the recording")),
        (None, None) => None,
    }
}

fn made_before(name: &Option<String>) -> String {
    match name {
        Some(name) => format!("made before ({name})"),
        None => "made before".to_owned(),
    }
}

fn magnetometer_calibration_in_words(options: &RunOptions) -> Option<String> {
    let calibration = &options.magnetometer_calibration.as_ref()?.calibration;
    Some(format!(
        "{}: {}, hard iron {:.1} uT, residual {:.2} uT",
        made_before(&options.calibration_names[1]),
        calibration.model.name(),
        calibration.hard_iron().norm(),
        calibration.residual_std_ut
    ))
}

fn usable(v: Vector3<f64>) -> bool {
    v.norm_squared().is_finite() && v.norm_squared() > 0.0
}
