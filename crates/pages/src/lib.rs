//! The pages of the lab and the script of reports, as they lie in `web/dist`, embedded in the program.
//!
//! The build script makes them with npm where they are missing or old; without npm nothing is embedded, the lab says how to
//! build its pages, and reports have their pictures without the script.

/// The files that the build script found, by name such as `lab/index.html`.
const FILES: &[(&str, &[u8])] = include!(concat!(env!("OUT_DIR"), "/assets.rs"));

/// A file of `web/dist`, by its path in there, such as `lab/index.html`; text files are there compressed, too, as `lab/lab.js.gz`.
#[must_use]
pub fn file(path: &str) -> Option<&'static [u8]> {
    let found = FILES.iter().find(|(known, _)| *known == path);
    found.map(|(_, bytes)| *bytes)
}

/// The paths of all files.
pub fn paths() -> impl Iterator<Item = &'static str> {
    FILES.iter().map(|(path, _)| *path)
}

/// What makes the plots of a report work like instruments; `None` where the pages were not built.
#[must_use]
pub fn report_script() -> Option<ReportScript> {
    let text = |path| file(path).and_then(|bytes| std::str::from_utf8(bytes).ok());
    Some(ReportScript {
        script: text("report/report.js")?,
        style: text("report/report.css")?,
    })
}

/// A script with its style sheet, to be put into a page as they are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ReportScript {
    /// JavaScript without imports.
    pub script: &'static str,
    /// Its style sheet.
    pub style: &'static str,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Both are put into one HTML file: nothing in them may end its element, or ask for another file.
    #[test]
    fn what_reports_carry_stays_within_its_element_and_asks_for_nothing() {
        let Some(report) = report_script() else {
            return assert!(paths().next().is_none(), "pages without the report's");
        };
        let script = report.script.to_ascii_lowercase();
        assert!(!script.contains("</script") && !script.contains("<!--"));
        let style = report.style.to_ascii_lowercase();
        assert!(
            !style.contains("</style") && !style.contains("url(") && !style.contains("@import")
        );
        for asks in [
            "fetch(",
            "xmlhttprequest",
            "import(",
            "websocket",
            "sendbeacon",
        ] {
            assert!(!script.contains(asks), "{asks}");
        }
    }

    #[test]
    fn every_page_is_whole() {
        for page in ["lab", "phone", "join"] {
            let Some(index) = file(&format!("{page}/index.html")) else {
                return assert!(paths().next().is_none(), "{page} is missing");
            };
            let index = std::str::from_utf8(index).unwrap();
            let named = index.split("assets/").skip(1);
            for name in named.map(|rest| rest.split('"').next().unwrap()) {
                assert!(file(&format!("{page}/{name}")).is_some(), "{page}/{name}");
            }
        }
    }
}
