//! Reports: one self-contained HTML file about a run or a comparison, with plots.
//!
//! Read first: [`RunReport`] and [`ComparisonReport`], plain data that any runner can fill;
//! `render` turns them into text. Nothing here reads a clock, a file or the network, and the page
//! needs none of them either: no scripts, no fonts, no images, only HTML, CSS and inline SVG.
//!
//! | file | what is in it |
//! |---|---|
//! | `html.rs` | the page: head, tables, figures with captions |
//! | `run.rs` | sections of [`RunReport`] |
//! | `from_summary.rs` | a summary as the data of its page |
//! | `comparison.rs`, `comparison_plots.rs` | sections and plots of [`ComparisonReport`] |
//! | `field_page.rs`, `allan_page.rs` | pages about a magnetometer calibration and an Allan deviation |
//! | `observers.rs` | the page of the experiment on observers in cascade |
//! | `hero.rs` | [`hero_svg`], the picture for a README |
//! | `attitude_plots.rs`, `innovation_plots.rs`, `position_plots.rs` | which curves stand in which panel |
//! | `plot.rs`, `axis.rs`, `series.rs`, `svg.rs` | figures, ticks, thinning, SVG text |
//! | `tracking.rs`, `tracking_map.rs` | sections of [`TrackingReport`], the map of tracks |
//! | `navigation.rs`, `navigation_plots.rs` | the page of a navigation run: track, outages, the paper's figures |
//! | `navigation_picture.rs` | those figures as one picture |
//! | `map.rs` | a map with its scale and grid |
//! | `style.rs` | colours of both themes, layout, print |
//!
//! The plots are written here and not by a plotting library because they need fractions of a
//! pixel, dashes, translucent bands and colours that follow the reader's theme.

mod allan_page;
mod attitude_plots;
mod axis;
mod campaign;
mod comparison;
mod comparison_plots;
mod field_page;
mod from_summary;
mod hero;
mod html;
mod innovation_plots;
mod map;
#[cfg(test)]
mod markup_checks;
mod navigation;
mod navigation_picture;
mod navigation_plots;
mod observers;
mod plot;
mod position_plots;
mod run;
mod series;
mod style;
mod svg;
#[cfg(test)]
mod tests;
mod tracking;
mod tracking_map;

pub use allan_page::render as allan_html;
pub use campaign::{CampaignReport, TrackerCurves};
pub use comparison::{Best, Cell, Column, ComparedRun, ComparisonReport, Distribution, Table};
pub use field_page::render as field_html;
pub use from_summary::settings;
pub use hero::{HeroPicture, hero_svg};
pub use navigation::{NavigationReport, navigation_settings, navigation_verdicts, validity_word};
pub use observers::{render as observers_html, verdicts as observers_verdicts};
pub use tracking::TrackingReport;

use crate::trace::Trace;

/// Program and version, as pages name it.
pub(crate) const PROGRAM: &str = concat!("northing ", env!("CARGO_PKG_VERSION"));

/// Where a page about a calibration comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Source<'a> {
    /// Name of the recording.
    pub recording: &'a str,
    /// The command that makes the page again.
    pub command: Option<&'a str>,
}

/// A short statement: what, and its value with unit.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Fact {
    /// What it is, e.g. `heading error, RMS`.
    pub label: String,
    /// Its value with unit, e.g. `1.83 deg`.
    pub value: String,
}

/// How welcome a verdict is; shown as a word and a colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tone {
    /// As it should be.
    Good,
    /// Worth a look.
    Warn,
    /// Wrong: results should not be trusted before it is mended.
    Bad,
}

/// A judgement in words, e.g. "your accelerometer R is about 9 times too small".
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Verdict {
    /// How welcome it is.
    pub tone: Tone,
    /// One sentence.
    pub text: String,
}

/// One parameter of an estimator.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Setting {
    /// Its name in configuration files.
    pub name: String,
    /// The value used.
    pub value: String,
    /// Its unit; empty without one.
    pub unit: String,
    /// What it means, in a sentence.
    pub meaning: String,
}

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
    /// Root of the trace of the attitude covariance, deg.
    pub estimated_error_deg: Option<f64>,
    /// Standard deviation about each body axis, deg.
    pub axis_std_deg: Option<[f64; 3]>,
    /// Normalised estimation error squared of the final attitude (3 degrees of freedom).
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
    /// Program and version, e.g. `northing 0.1.0`.
    pub program: String,
    /// The command that makes this report again.
    pub command: Option<String>,
    /// Everything the run depends on beside the recording ([`crate::setup::RunSetup::to_text`]).
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
    pub settings: Vec<Setting>,
    /// What the plots show.
    pub trace: &'a Trace,
}

impl Fact {
    /// A fact from its two texts.
    pub fn new(label: impl Into<String>, value: impl Into<String>) -> Self {
        Self {
            label: label.into(),
            value: value.into(),
        }
    }
}

impl Verdict {
    /// A verdict from its tone and its sentence.
    pub fn new(tone: Tone, text: impl Into<String>) -> Self {
        Self {
            tone,
            text: text.into(),
        }
    }
}

impl Tone {
    /// Class in the style sheet, and word on the page.
    const fn class_and_word(self) -> (&'static str, &'static str) {
        match self {
            Self::Good => ("good", "\u{2713} Good"),
            Self::Warn => ("warn", "! Look"),
            Self::Bad => ("bad", "\u{2717} Wrong"),
        }
    }
}

impl<'a> RunReport<'a> {
    /// A report with plots alone; the other fields are empty.
    #[must_use]
    pub fn new(title: impl Into<String>, trace: &'a Trace) -> Self {
        Self {
            title: title.into(),
            estimator: String::new(),
            recording: String::new(),
            program: PROGRAM.to_owned(),
            command: None,
            setup: None,
            summary: Vec::new(),
            verdicts: Vec::new(),
            updates: Vec::new(),
            final_test: None,
            recording_facts: Vec::new(),
            issues: Vec::new(),
            settings: Vec::new(),
            trace,
        }
    }

    /// The report as one HTML page that needs nothing else, usually below 1 MB.
    #[must_use]
    pub fn render(&self) -> String {
        run::render(self)
    }
}
