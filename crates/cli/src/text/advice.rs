//! Advice that fits a command: what names options that it does not have is left out of a sentence.

/// A text without the brackets and clauses that name options of other commands; `has` says which the command has.
pub(crate) fn fitting(text: &str, has: &dyn Fn(&str) -> bool) -> String {
    let fits = |part: &str| options(part).all(has);
    if fits(text) {
        return text.to_owned();
    }
    let text = without_brackets(text, &fits);
    let (body, end) = match text.strip_suffix('.') {
        Some(body) => (body, "."),
        None => (text.as_str(), ""),
    };
    let sentences = body.split(". ").filter_map(|sentence| {
        let clauses: Vec<&str> = sentence.split("; ").filter(|part| fits(part)).collect();
        (!clauses.is_empty()).then(|| clauses.join("; "))
    });
    let sentences: Vec<String> = sentences.collect();
    match sentences.is_empty() {
        true => String::new(),
        false => format!("{}{end}", sentences.join(". ")),
    }
}

/// The names of the options in a text.
fn options(text: &str) -> impl Iterator<Item = &str> {
    text.split("--").skip(1).filter_map(|rest| {
        let is_name = |c: char| c.is_ascii_lowercase() || c == '-';
        let name = rest.split(|c| !is_name(c)).next()?;
        (!name.is_empty()).then_some(name)
    })
}

fn without_brackets(text: &str, fits: &dyn Fn(&str) -> bool) -> String {
    let mut kept = String::new();
    let mut rest = text;
    while let Some((before, behind)) = rest.split_once(" (") {
        let Some((inside, after)) = behind.split_once(')') else {
            break;
        };
        kept.push_str(before);
        if fits(inside) {
            kept.push_str(&format!(" ({inside})"));
        }
        rest = after;
    }
    kept + rest
}

#[cfg(test)]
mod tests {
    use super::fitting;

    #[test]
    fn options_that_a_command_does_not_have_are_not_advised() {
        let has = |name: &str| name == "set";
        for (told, expected) in [
            (
                "A magnet is near, or the numbers are milligauss (--magnetometer-unit milligauss). Calibrate it (`northing calibrate`), \
                 or leave it out (--sensors gyro,acc).",
                "A magnet is near, or the numbers are milligauss. Calibrate it (`northing calibrate`), or leave it out.",
            ),
            (
                "No fix was held out. Hold some out with --gnss-every 2 or --outage 120:30.",
                "No fix was held out.",
            ),
            (
                "Its rates are in degrees per second; say --gyroscope-unit deg-per-s.",
                "Its rates are in degrees per second.",
            ),
            (
                "It is left out, unless --set declination=RADIANS says (see --help) where north is.",
                "It is left out, unless --set declination=RADIANS says where north is.",
            ),
            ("See --score-from.", ""),
            (
                "1.0 m (0.5; see there) -- good.",
                "1.0 m (0.5; see there) -- good.",
            ),
        ] {
            assert_eq!(fitting(told, &has), expected);
        }
    }
}
