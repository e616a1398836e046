//! The script that makes instruments of a page's figures: hover, zoom, pan, curves to switch, picture and table.
//!
//! It is in the page like everything else, so that a report stays one file that asks nobody. Without the feature
//! `interactive`, or where the pages were not built, figures are the pictures that print has anyway.

use crate::drawing::plot::Figure;

/// What the script needs to know of a figure stands beside its picture.
#[cfg(feature = "interactive")]
pub(crate) fn with_data(figure: &Figure) -> String {
    let picture = figure.render();
    if northing_pages::report_script().is_none() {
        return picture;
    }
    let data = figure.data();
    format!("{picture}<script type=\"application/json\" class=\"figure-data\">{data}</script>\n")
}

#[cfg(not(feature = "interactive"))]
pub(crate) fn with_data(figure: &Figure) -> String {
    figure.render()
}

/// The style sheet of instruments.
pub(crate) fn style() -> &'static str {
    #[cfg(feature = "interactive")]
    return northing_pages::report_script().map_or("", |report| report.style);
    #[cfg(not(feature = "interactive"))]
    ""
}

/// The script element, for the end of the page.
pub(crate) fn script() -> String {
    let script = inline_script();
    if script.is_empty() {
        return String::new();
    }
    format!("<script>{script}</script>\n")
}

/// The text of the one script that runs in a report, for those who must permit it by its hash; empty where there is none.
#[must_use]
pub fn inline_script() -> &'static str {
    #[cfg(feature = "interactive")]
    return northing_pages::report_script().map_or("", |report| report.script);
    #[cfg(not(feature = "interactive"))]
    ""
}
