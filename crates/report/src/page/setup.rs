//! What a report of a run carries to be run again: the setup, as text in the page.
//!
//! [`northing_evaluation::attitude::setup::RunSetup`] writes and reads that text.

/// What stands before the text in a report; no other element of it has this name.
pub(crate) const OPENS: &str = "<pre id=\"setup\">";
const CLOSES: &str = "</pre>";

/// The setup that a page carries; of a text that is one already, the text.
///
/// # Errors
/// The page is cut off, or carries none.
pub fn setup_of(page: &str) -> Result<String, String> {
    match page.split_once(OPENS) {
        Some((_, rest)) => {
            let inside = rest.split_once(CLOSES).ok_or("the report is cut off")?.0;
            Ok(unescaped(inside))
        }
        None if page.trim_start().starts_with('{') => Ok(page.to_owned()),
        None => Err("it carries no setup; expected a report of the lab".to_owned()),
    }
}

/// Takes back what a page does to text.
fn unescaped(text: &str) -> String {
    let pairs = [
        ("&lt;", "<"),
        ("&gt;", ">"),
        ("&quot;", "\""),
        ("&#39;", "'"),
        ("&amp;", "&"),
    ];
    pairs
        .into_iter()
        .fold(text.to_owned(), |text, (from, to)| text.replace(from, to))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::RunReport;
    use northing_evaluation::attitude::setup::RunSetup;
    use northing_evaluation::attitude::trace::Trace;
    use northing_evaluation::{EstimatorKind, Profile, RunOptions};

    #[test]
    fn a_report_carries_it_to_the_last_digit() {
        let mut options = RunOptions::new(EstimatorKind::Usque, Profile::Lab);
        options.set("accelerometer_std=0.1234567890123456").unwrap();
        options.skip_s = 1.0 / 3.0;
        let setup = RunSetup::of(&options);
        let trace = Trace::new(10);
        let mut report = RunReport::new("Lab <1>", &trace);
        report.setup = Some(setup.to_text());
        report.command = Some("northing run".to_owned());
        let text = setup_of(&report.render()).unwrap();
        assert_eq!(RunSetup::parse(&text).unwrap(), setup);
        assert_eq!(setup_of(&setup.to_text()).unwrap(), setup.to_text());
    }

    #[test]
    fn what_carries_none_is_named() {
        let message = |page: &str| setup_of(page).unwrap_err();
        assert!(message("<html></html>").contains("carries no setup"));
        assert!(message("<pre id=\"setup\">{").contains("cut off"));
    }
}
