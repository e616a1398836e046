//! The report of one run as plain data that any runner can fill.

use northing_evaluation::UsedParameter;
use northing_evaluation::attitude::Trace;

use crate::page::facts::{Fact, Verdict};

/// What became of one sensor's measurements.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SensorUpdates {
    /// Name of the sensor.
    pub sensor: String,
    /// Measurements used (with inflated noise included).
    pub fused: u64,
    /// Measurements refused by the gate.
    pub gated: u64,
    /// Measurements not looked at.
    pub skipped: u64,
    /// Mean NIS.
    pub nis_mean: Option<f64>,
    /// What the mean NIS should be: the number of components measured.
    pub nis_expected: Option<f64>,
}

/// The final test: the device is put back in its reference pose, and the error that shows is
/// compared with the one that the filter believes in.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FinalTest {
    /// Angle of the calculated error quaternion, deg.
    pub calculated_error_deg: Option<f64>,
    /// Root of the trace of the covariances of both ends, deg: the prediction that judges.
    pub estimated_error_deg: Option<f64>,
    /// Its part about each body axis, deg.
    pub axis_std_deg: Option<[f64; 3]>,
    /// Calculated and estimated error of the tilt, deg, where the tilt alone is judged.
    pub tilt_deg: Option<[f64; 2]>,
    /// Normalised estimation error squared of what is judged: 3 degrees of freedom, 2 of the tilt.
    pub nees: Option<f64>,
    /// Whether both agree.
    pub verdict: Option<Verdict>,
}

/// What the report of one run shows. Sections without data are left out.
#[derive(Debug, Clone)]
pub struct RunReport<'a> {
    /// Heading of the page.
    pub title: String,
    /// Name of the estimator.
    pub estimator: String,
    /// Name of the recording.
    pub recording: String,
    /// The command that makes this report again.
    pub command: Option<String>,
    /// Everything the run depends on beside the recording ([`northing_evaluation::attitude::setup::RunSetup::to_text`]).
    pub setup: Option<String>,
    /// The numbers that matter most, shown large. Four to eight read best.
    pub summary: Vec<Fact>,
    /// What those numbers mean, in words.
    pub verdicts: Vec<Verdict>,
    /// Measurements used and refused, sensor by sensor.
    pub updates: Vec<SensorUpdates>,
    /// The final test, where one was made.
    pub final_test: Option<FinalTest>,
    /// Facts about the recording: device, duration, rates, frame.
    pub recording_facts: Vec<Fact>,
    /// What was odd about the recording, one sentence each.
    pub issues: Vec<String>,
    /// Every parameter of the estimator.
    pub settings: Vec<UsedParameter>,
    /// Constant part of the heading error, deg, that plots leave out: where the heading is arbitrary.
    pub heading_offset_deg: Option<f64>,
    /// What the plots show.
    pub trace: &'a Trace,
}

impl<'a> RunReport<'a> {
    /// A report with plots alone; the other fields are empty.
    #[must_use]
    pub fn new(title: impl Into<String>, trace: &'a Trace) -> Self {
        Self {
            title: title.into(),
            estimator: String::new(),
            recording: String::new(),
            command: None,
            setup: None,
            summary: Vec::new(),
            verdicts: Vec::new(),
            updates: Vec::new(),
            final_test: None,
            recording_facts: Vec::new(),
            issues: Vec::new(),
            settings: Vec::new(),
            heading_offset_deg: None,
            trace,
        }
    }
}
