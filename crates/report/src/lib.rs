//! Reports: one self-contained HTML file about a run or a comparison, with plots.
//!
//! Read first: [`RunReport`] and [`ComparisonReport`], plain data that any runner can fill;
//! `render` turns them into text. Nothing here reads a clock, a file or the network, and the page
//! needs none of them either: no fonts, no images, only HTML, CSS, inline SVG, and with the feature `interactive` one script
//! in the page that makes instruments of the plots.
//!
//! | file | what is in it |
//! |---|---|
//! | `html.rs` | the page: head, tables, figures with captions |
//! | `run.rs` | sections of [`RunReport`] |
//! | `from_summary.rs` | a summary as the data of its page |
//! | `comparison.rs`, `comparison_plots.rs` | sections and plots of [`ComparisonReport`] |
//! | `calibration/` | pages about a magnetometer calibration and an Allan deviation |
//! | `observers.rs` | the page of the experiment on observers in cascade |
//! | `attitude_worlds.rs` | the page of attitude on random worlds |
//! | `navigation_worlds.rs` | the page of GNSS/INS on random worlds |
//! | `faults.rs` | the page of the fault campaign |
//! | `files/` | parts of campaigns and studies as Parquet |
//! | `elements.rs` | cells, columns and figures that pages of experiments share |
//! | `hero.rs` | [`hero_svg`], the picture for a README |
//! | `attitude_plots.rs`, `innovation_plots.rs`, `position_plots.rs` | which curves stand in which panel |
//! | `plot.rs`, `axis.rs`, `series.rs`, `svg.rs` | figures, ticks, thinning, SVG text |
//! | `tracking/` | the page of a tracking run, the map of tracks |
//! | `navigation.rs`, `navigation_plots.rs` | the page of a navigation run: track, outages, the paper's figures |
//! | `navigation_picture.rs` | those figures as one picture |
//! | `map.rs` | a map with its scale and grid |
//! | `rows.rs`, `residuals.rs` | marks in rows, residuals by what became of each |
//! | `style.rs` | colours of both themes, layout, print |
//!
//! The plots are written here and not by a plotting library because they need fractions of a
//! pixel, dashes, translucent bands and colours that follow the reader's theme.

mod attitude;
mod calibration;
mod drawing;
mod experiments;
#[cfg(feature = "parquet")]
mod files;
mod navigation;
mod page;
#[cfg(test)]
mod tests;
mod tracking;

/// Points that a series of a report has at most.
pub const TRACE_CAPACITY: usize = 6000;

pub use attitude::compared_runs;
pub use attitude::comparison::{ComparedRun, ComparisonReport, Distribution};
pub use attitude::hero::{HeroPicture, hero_svg};
pub use attitude::run_page;
pub use attitude::run_report::{FinalTest, RunReport, SensorUpdates};
pub use calibration::allan::render as allan_html;
pub use calibration::magnetometer::render as magnetometer_html;
pub use experiments::attitude_worlds::render as attitude_worlds_html;
pub use experiments::campaign_outcome;
pub use experiments::faults::render as faults_html;
pub use experiments::navigation_worlds::render as navigation_worlds_html;
pub use experiments::observers::{render as observers_html, verdicts as observers_verdicts};
#[cfg(feature = "parquet")]
pub use files::{campaign_part, study_part};
pub use navigation::page::{NavigationReport, navigation_verdicts};
pub use page::facts::{Fact, Source, Tone, Verdict};
pub use page::instrument::inline_script;
pub use page::setup::setup_of;
pub use page::table::{Best, Cell, Column, Table};
pub use tracking::followed_targets;
