//! Pages about attitude: a run, a comparison, the picture of a README.

mod angle_plots;
pub mod compared_runs;
pub(crate) mod comparison;
mod comparison_plots;
pub(crate) mod from_summary;
pub(crate) mod hero;
mod innovation_plots;
mod position_plots;
mod run;
pub mod run_page;
pub(crate) mod run_report;
