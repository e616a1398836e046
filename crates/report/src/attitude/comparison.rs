//! The report of a comparison: several estimators, over one recording or many.

use std::fmt::Write as _;

use crate::attitude::comparison_plots;
use crate::drawing::svg::escape;
use crate::page::facts::{Fact, Verdict};
use crate::page::html::{self, Frame, Page};
use crate::page::table::{self, Table};
use northing_evaluation::UsedParameter;
use northing_evaluation::attitude::Trace;

/// What a comparison's report shows. Sections without data are left out.
#[derive(Debug, Clone, Default)]
pub struct ComparisonReport<'a> {
    /// Heading of the page.
    pub title: String,
    /// What was compared over: name of the recording, or how many there are.
    pub recording: String,
    /// The command that makes this report again.
    pub command: Option<String>,
    /// The numbers that matter most, shown large.
    pub summary: Vec<Fact>,
    /// What they mean, in words.
    pub verdicts: Vec<Verdict>,
    /// Tables, in this order.
    pub tables: Vec<Table>,
    /// Errors of each estimator over all recordings.
    pub distributions: Vec<Distribution>,
    /// Estimators on the same recording, whose errors are drawn over time.
    pub runs: Vec<ComparedRun<'a>>,
    /// What was odd about the recordings, one sentence each.
    pub issues: Vec<String>,
    /// Parameters of each estimator, by name.
    pub settings: Vec<(String, Vec<UsedParameter>)>,
}

/// One estimator of a comparison over a single recording.
#[derive(Debug, Clone, Copy)]
pub struct ComparedRun<'a> {
    /// Name of the estimator.
    pub name: &'a str,
    /// Its estimates.
    pub trace: &'a Trace,
    /// Constant part of the heading error, deg, that plots leave out: where the heading is arbitrary.
    pub heading_offset_deg: Option<f64>,
}

/// Errors of one estimator over many recordings.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Distribution {
    /// Name of the estimator.
    pub name: String,
    /// One error of each recording, deg.
    pub errors_deg: Vec<f64>,
}

impl ComparisonReport<'_> {
    /// The report as one HTML page that needs nothing else.
    #[must_use]
    pub fn render(&self) -> String {
        let mut page = Page::default();
        page.section(
            "results",
            "Results",
            &self.tables.iter().map(table::table).collect::<String>(),
        );
        page.section("distribution", "Over all recordings", &self.distribution());
        page.section("errors", "Errors over time", &self.errors());
        page.section("heading", "Heading", &self.heading());
        page.section("recordings", "Recordings", &html::sentences(&self.issues));
        page.section("settings", "Settings", &self.settings());
        page.finish(&Frame {
            kicker: "Northing \u{00b7} comparison of estimators",
            title: &self.title,
            lead: &self.recording,
            summary: &self.summary,
            verdicts: &self.verdicts,
            recording: &self.recording,
            command: self.command.as_deref(),
            reading: html::ATTITUDE_READING,
        })
    }

    fn distribution(&self) -> String {
        html::picture(
            comparison_plots::distribution(&self.distributions, &self.runs),
            "One dot for each recording.",
            "Look at the median (the bar) for what to expect, and at the dots far to the right for \
             what can go wrong; the axis is logarithmic.",
        )
    }

    fn errors(&self) -> String {
        html::figure(
            comparison_plots::errors(&self.runs),
            "Errors of each estimator, root mean square over short windows.",
            "Look which lines rise for ever (nothing corrects them) and which ones come back \
             after a disturbance; the axis is logarithmic.",
        )
    }

    fn heading(&self) -> String {
        html::figure(
            comparison_plots::headings(&self.runs),
            "The heading that each estimator gives.",
            "Look who stays with the dashed reference, and who leaves it, when and which way.",
        )
    }

    fn settings(&self) -> String {
        let mut content = String::new();
        for (estimator, settings) in &self.settings {
            let table = html::settings(settings);
            if !table.is_empty() {
                let _ = write!(content, "<h3>{}</h3>\n{table}", escape(estimator));
            }
        }
        content
    }
}
