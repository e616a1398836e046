//! The report of a navigation run: track, errors, consistency, and the innovations of each aid.

use crate::navigation::plots;
use crate::page::facts::{Fact, Tone, Verdict};
use crate::page::html::{self, Frame, Page};
use crate::page::table;
use crate::page::table::{Cell, Column, Table};
use northing_evaluation::navigation::score::{OutageScore, PositionScore};
use northing_evaluation::navigation::trace::NavigationTrace;
use northing_evaluation::navigation::{AidKind, NavigationKind, NavigationSummary};
use northing_evaluation::statistics::consistency::aid_in_words;
use northing_evaluation::statistics::median;

/// How the page is read.
const READING: &str = "Positions are metres from the first fix. An ellipse, or a band of 95 %, holds the truth 95 times \
                       of 100 when the stated uncertainty is consistent. \u{03c3} is a standard deviation.";
/// Shares inside the 95 % bound that are consistent.
const CONSISTENT: std::ops::RangeInclusive<f64> = 0.88..=0.99;

/// What the report of a navigation run shows.
#[derive(Debug, Clone)]
pub struct NavigationReport<'a> {
    /// Name of the recording, for the heading.
    pub name: String,
    /// The outcome.
    pub summary: &'a NavigationSummary,
    /// What the plots show.
    pub trace: &'a NavigationTrace,
    /// The command that makes it again.
    pub command: Option<String>,
}

impl NavigationReport<'_> {
    /// The report as one HTML page that needs nothing else.
    #[must_use]
    pub fn render(&self) -> String {
        let mut page = Page::default();
        page.section("track", "Track", &self.track());
        page.section("position", "Position", &self.position());
        page.section("errors", "Errors", &self.errors());
        page.section("outages", "Outages", &self.outages());
        page.section("orientation", "Orientation", &self.orientation());
        page.section("aids", "Aiding innovations", &self.aids());
        if !self.summary.parameters.is_empty() {
            let settings = html::settings(&self.summary.parameters);
            page.section("settings", "Settings", &settings);
        }
        page.section("recording", "Recording", &self.recording());
        let summary = self.summary;
        let lead = format!(
            "{} \u{00b7} {} \u{00b7} {:.0} s",
            summary.recording,
            estimator_words(summary.estimator),
            summary.duration_s
        );
        page.finish(&Frame {
            kicker: "Northing \u{00b7} navigation",
            title: &format!("Where was {}?", self.name),
            lead: &lead,
            summary: &facts(summary),
            verdicts: &navigation_verdicts(summary),
            recording: &summary.recording,
            command: self.command.as_deref(),
            reading: READING,
        })
    }

    fn track(&self) -> String {
        html::picture(
            plots::track(self.trace, self.summary.estimator),
            "Where it went, seen from above.",
            "Ellipses hold the true position 95 times of 100. Look whether the line runs through the fixes, how it \
             takes curves between them, and where dead reckoning leaves the road.",
        )
    }

    fn position(&self) -> String {
        let position = html::figure(
            plots::position(self.trace, self.summary.estimator),
            "Position over time, and the fixes.",
            "Where line and dots cannot be told apart, the filter follows the receiver; that alone does not make it \
             better than the receiver: see the errors.",
        );
        let close_look = html::figure(
            plots::close_look(self.trace, self.summary.estimator),
            "The same over a few seconds.",
            "Between two fixes the inertial samples carry the position on. A step at each fix means that they carry \
             it wrongly.",
        );
        position + &close_look
    }

    fn errors(&self) -> String {
        html::figure(
            plots::errors(self.trace),
            "Position errors where there was something to score against.",
            "Dots should fill the band and seldom leave it. What stands out far are the outages.",
        )
    }

    fn outages(&self) -> String {
        let outages = &self.summary.outages;
        let Some(figure) = plots::outages(self.trace, outages) else {
            return String::new();
        };
        let plot = html::figure(
            figure,
            "Without fixes: the error grows, and so does what the filter predicts.",
            "A curve above the band means a filter that is surer than it should be.",
        );
        format!("{}{plot}", table::table(&outage_table(outages)))
    }

    fn orientation(&self) -> String {
        let kind = self.summary.estimator;
        let Some(figure) = plots::orientation(self.trace, kind) else {
            return String::new();
        };
        let mut content = html::figure(
            figure,
            "Which way it pointed.",
            match (self.trace.raw_tilt.items(), self.trace.raw_heading.items()) {
                ([], []) => "No accelerometer or magnetometer stands beside it.",
                (_, []) => {
                    "The dots are what the accelerometer says without a filter: every acceleration of the vehicle tilts \
                     them."
                }
                (_, _) => {
                    "The dots are what accelerometer and magnetometer say without a filter: every acceleration of the \
                     vehicle tilts them, and that tilt turns their heading, which counts from magnetic north."
                }
            },
        );
        content.push_str(&html::figure(
            plots::close_orientation(self.trace, kind),
            "The same over a few seconds.",
            "The curve should be as quiet as the motion is, and follow it without delay.",
        ));
        content
    }

    fn aids(&self) -> String {
        if self.summary.aids.is_empty() {
            return String::new();
        }
        let mut content = table::table(&aid_table(self.summary));
        for kind in self.trace.aids.keys() {
            content.push_str(&html::figure(
                plots::innovations(self.trace, *kind),
                &format!("Measured minus predicted: {}.", kind.name()),
                "Without pattern and mostly inside the band: the stated noise is right.",
            ));
        }
        content
    }

    fn recording(&self) -> String {
        let summary = self.summary;
        let mut rows = vec![
            Fact::new("inertial samples", summary.inertial_samples.to_string()),
            Fact::new(
                "fixes used",
                format!("{} of {}", summary.fixes_used, summary.fixes),
            ),
        ];
        rows.extend(summary.origin.map(|origin| {
            Fact::new(
                "first fix",
                format!(
                    "{:.6}\u{00b0}, {:.6}\u{00b0}, {:.1} m",
                    origin.latitude_deg, origin.longitude_deg, origin.height_m
                ),
            )
        }));
        for (reason, count) in &summary.fixes_unusable {
            rows.push(Fact::new(format!("not used: {reason}"), count.to_string()));
        }
        format!(
            "{}{}",
            html::fact_table(&rows),
            html::sentences(&summary.issues)
        )
    }
}

/// The estimator as the page's lead calls it.
pub(crate) fn estimator_words(kind: NavigationKind) -> &'static str {
    match kind {
        NavigationKind::Device => "what the device itself reported",
        _ => kind.name(),
    }
}

/// The large numbers.
fn facts(summary: &NavigationSummary) -> Vec<Fact> {
    let mut facts = Vec::new();
    if let Some(position) = &summary.position {
        let metres = |value: f64| format!("{} m", metres(value));
        facts.push(Fact::new(
            "horizontal error, RMS",
            metres(position.horizontal_rmse_m),
        ));
        let vertical = position.vertical_rmse_m.map(metres);
        facts.extend(vertical.map(|v| Fact::new("vertical error, RMS", v)));
        facts.push(Fact::new(
            "inside the 95 % ellipse",
            format!("{:.0} %", 100.0 * position.inside_95),
        ));
        facts.extend(position.vertical_inside_95.map(|share| {
            Fact::new(
                "heights inside their 95 %",
                format!("{:.0} %", 100.0 * share),
            )
        }));
    }
    let velocity = summary.velocity_rmse_m_s;
    facts.extend(velocity.map(|v| Fact::new("velocity error, RMS", format!("{v:.2} m/s"))));
    if let Some(heading) = &summary.heading {
        let against = if heading.against_course {
            "heading against course, RMS"
        } else {
            "heading error, RMS"
        };
        facts.push(Fact::new(
            against,
            format!("{:.1}\u{00b0}", heading.rmse_deg),
        ));
    }
    let aided = summary.validity.aided_s + summary.validity.heading_unknown_s;
    facts.push(Fact::new("time with fixes", format!("{aided:.0} s")));
    facts
}

/// Metres with as many digits as they deserve.
pub(crate) fn metres(value: f64) -> String {
    match value {
        v if v < 0.095 => format!("{v:.3}"),
        v if v < 9.95 => format!("{v:.2}"),
        v => format!("{v:.0}"),
    }
}

/// Usable fixes that the estimator did not get.
fn held_out(summary: &NavigationSummary) -> Option<u64> {
    let unusable: u64 = summary.fixes_unusable.values().sum();
    summary
        .fixes
        .checked_sub(unusable)?
        .checked_sub(summary.fixes_given)
}

/// What the numbers mean, in words.
#[must_use]
pub fn navigation_verdicts(summary: &NavigationSummary) -> Vec<Verdict> {
    let mut verdicts = Vec::new();
    if let Some(position) = &summary.position {
        verdicts.push(better_than_nothing(position));
        verdicts.push(consistency(position));
        verdicts.extend(vertical_consistency(position));
    }
    verdicts.extend(outage_consistency(&summary.outages));
    if summary.validity.heading_unknown_s > summary.validity.aided_s {
        verdicts.push(Verdict::new(
            Tone::Warn,
            format!(
                "For {:.0} s the heading was not known, or the fixes disagreed with it: accelerations in the horizontal \
                 show it, straight driving and standing do not.",
                summary.validity.heading_unknown_s
            ),
        ));
    }
    if summary.validity.invalid_s > 0.0 {
        verdicts.push(Verdict::new(
            Tone::Warn,
            format!(
                "For {:.0} s the position was not worth to be called one: no fix for too long, or too uncertain.",
                summary.validity.invalid_s
            ),
        ));
    }
    if verdicts.is_empty() {
        let mut issues = summary.issues.iter();
        let text = if issues.any(|issue| issue.contains("--score-from")) {
            "Nothing to judge by yet: the recording ends before scores count; see --score-from."
                .to_owned()
        } else if summary.estimator == NavigationKind::Device {
            "Nothing to judge by: the device has used every fix, and there is no reference. A manifest puts one \
             beside the recording (docs/formats.md)."
                .to_owned()
        } else if let Some(kept @ 1..) = held_out(summary) {
            format!(
                "Nothing to judge by: of {kept} held-out fixes none was scored, and there is no reference: the \
                 estimator used {} of the {} fixes that it got.",
                summary.fixes_used, summary.fixes_given
            )
        } else {
            "Nothing to judge by: no fix was held out and there is no reference. Hold some out with --gnss-every 2 or \
             --outage 120:30."
                .to_owned()
        };
        verdicts.push(Verdict::new(Tone::Warn, text));
    }
    let aids = summary
        .aids
        .iter()
        .filter(|(kind, _)| AidKind::MEASURED.contains(kind));
    verdicts.extend(aids.filter_map(|(kind, aid)| {
        let text = aid_in_words(kind.name(), aid.nis.as_ref()?)?;
        Some(Verdict::new(Tone::Warn, text))
    }));
    verdicts
}

/// A filter whose error is more than this share of that without a filter is no better.
const NO_BETTER: f64 = 0.95;

fn better_than_nothing(position: &PositionScore) -> Verdict {
    let own = position.horizontal_rmse_m;
    let rivals = [
        ("holding the last fix", position.hold_rmse_m),
        (
            "the last fix moved on with its velocity",
            position.extrapolation_rmse_m,
        ),
    ];
    let known = rivals.into_iter().filter_map(|(name, v)| Some((name, v?)));
    let best = known.min_by(|a, b| a.1.total_cmp(&b.1));
    match best {
        Some((name, value)) if value < own => Verdict::new(
            Tone::Bad,
            format!(
                "Worse than no filter: {} m horizontally against {} m of {name}.",
                metres(own),
                metres(value)
            ),
        ),
        Some((name, value)) if NO_BETTER * value < own => Verdict::new(
            Tone::Warn,
            format!(
                "No better than no filter: {} m horizontally, and {} m of {name}.",
                metres(own),
                metres(value)
            ),
        ),
        Some((name, value)) => Verdict::new(
            // An error that is small beside an ellipse that does not hold it is nothing to rely on.
            if position.inside_95 < *CONSISTENT.start() {
                Tone::Info
            } else {
                Tone::Good
            },
            format!(
                "{} m horizontally where {name}, the better of the two answers without a filter, has {} m.",
                metres(own),
                metres(value)
            ),
        ),
        None => Verdict::new(Tone::Info, format!("{} m horizontally.", metres(own))),
    }
}

fn consistency(position: &PositionScore) -> Verdict {
    let share = position.inside_95;
    let percent = 100.0 * share;
    if CONSISTENT.contains(&share) {
        let text = format!(
            "The stated uncertainty is consistent: {percent:.0} % of {} points inside the 95 % ellipse.",
            position.scored_fixes
        );
        Verdict::new(Tone::Good, text)
    } else if share < *CONSISTENT.start() {
        let text =
            format!("Overconfident: only {percent:.0} % of the points inside the 95 % ellipse.");
        Verdict::new(Tone::Bad, text)
    } else {
        let text = format!("Conservative: {percent:.1} % of the points inside the 95 % ellipse.");
        Verdict::new(Tone::Warn, text)
    }
}

/// The mean of an error is nearly all of it.
const SAME_ALL_THE_TIME: f64 = 0.95;

/// Heights that are not where they are stated; where they are, the numbers say so.
fn vertical_consistency(position: &PositionScore) -> Option<Verdict> {
    let share = position.vertical_inside_95?;
    let (rms, mean) = (position.vertical_rmse_m?, position.vertical_mean_m?);
    if share >= *CONSISTENT.start() {
        return None;
    }
    let way = if mean > 0.0 { "low" } else { "high" };
    let mut text = format!(
        "Overconfident vertically: only {:.0} % of the heights inside their 95 %; the error is {} m RMS, and {} m too {way} in the mean.",
        100.0 * share,
        metres(rms),
        metres(mean.abs()),
    );
    if mean.abs() > SAME_ALL_THE_TIME * rms {
        text.push_str(
            " It is nearly the same all the time: heights above the sea beside heights above the ellipsoid would look so.",
        );
    }
    Some(Verdict::new(Tone::Bad, text))
}

fn outage_consistency(outages: &[OutageScore]) -> Option<Verdict> {
    let judged = outages.iter().filter_map(|o| o.inside_95);
    let (inside, all) = judged.fold((0, 0), |(inside, all), ok| {
        (inside + u32::from(ok), all + 1)
    });
    let mut errors: Vec<f64> = outages
        .iter()
        .filter_map(|o| o.horizontal_error_m)
        .collect();
    errors.sort_by(f64::total_cmp);
    let median = median(&errors)?;
    // Of a dozen, one or two outside are chance.
    let tone = if 10 * inside >= 8 * all {
        Tone::Good
    } else {
        Tone::Bad
    };
    Some(Verdict::new(
        tone,
        format!(
            "Outages: {inside} of {all} ended inside the 95 % ellipse that was predicted, with a median error of {} m.",
            metres(median)
        ),
    ))
}

fn columns<const N: usize>(names: [&str; N]) -> Vec<Column> {
    names.map(|name| Column::new(name, "", None)).into()
}

fn outage_table(outages: &[OutageScore]) -> Table {
    let number = |value: Option<f64>| {
        let decimals = value.map_or(0, |v| if v.abs() < 1.0 { 3 } else { 1 });
        Cell::number(value, decimals)
    };
    let row = |o: &OutageScore| {
        vec![
            Cell::Text(format!(
                "{:.0} s to {:.0} s",
                o.start_s,
                o.start_s + o.duration_s
            )),
            number(o.horizontal_error_m),
            number(o.predicted_std_m),
            Cell::Text(match o.inside_95 {
                Some(true) => "yes".to_owned(),
                Some(false) => "no".to_owned(),
                None => "\u{2013}".to_owned(),
            }),
            number(o.hold_error_m),
            number(o.extrapolation_error_m),
        ]
    };
    Table {
        title: "Outages".to_owned(),
        caption: "Horizontal error at the last point inside, m; beside it what needs no filter."
            .to_owned(),
        columns: columns([
            "after the first fix",
            "error",
            "predicted \u{03c3}",
            "inside 95 %",
            "last fix held",
            "moved on",
        ]),
        rows: outages.iter().map(row).collect(),
    }
}

fn aid_table(summary: &NavigationSummary) -> Table {
    let rows = summary.aids.iter().map(|(kind, aid)| {
        let counts = &aid.updates;
        let count = |n: u64| Cell::Text(n.to_string());
        let nis = aid.nis.as_ref();
        vec![
            Cell::Text(kind.name().to_owned()),
            count(counts.fused),
            count(counts.gated),
            count(counts.skipped),
            Cell::number(nis.map(|n| n.mean), 2),
            nis.map_or(Cell::Missing, |n| count(n.degrees_of_freedom.into())),
        ]
    });
    Table {
        title: "Aids".to_owned(),
        caption: "The mean NIS of a consistent filter is the number of components measured."
            .to_owned(),
        columns: columns([
            "aid",
            "used",
            "refused",
            "not looked at",
            "mean NIS",
            "components",
        ]),
        rows: rows.collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn score(own: f64, hold: f64, inside_95: f64) -> Vec<(Tone, String)> {
        let position = PositionScore {
            horizontal_rmse_m: own,
            hold_rmse_m: Some(hold),
            extrapolation_rmse_m: None,
            inside_95,
            vertical_rmse_m: None,
            vertical_inside_95: None,
            vertical_mean_m: None,
            scored_fixes: 100,
        };
        [better_than_nothing(&position), consistency(&position)]
            .map(|verdict| (verdict.tone, verdict.text))
            .into()
    }

    #[test]
    fn nothing_is_good_that_is_no_better_than_no_filter_or_stands_beside_an_ellipse_that_does_not_hold_it()
     {
        assert_eq!(score(1.0, 5.0, 0.95)[0].0, Tone::Good);
        let same = &score(41.2, 41.3, 0.95)[0];
        assert!(
            same.0 == Tone::Warn && same.1.starts_with("No better than no filter"),
            "{same:?}"
        );
        let heights = |share, mean| {
            vertical_consistency(&PositionScore {
                horizontal_rmse_m: 1.0,
                hold_rmse_m: None,
                extrapolation_rmse_m: None,
                inside_95: 1.0,
                vertical_rmse_m: Some(38.0),
                vertical_inside_95: Some(share),
                vertical_mean_m: Some(mean),
                scored_fixes: 100,
            })
        };
        assert_eq!(heights(0.95, 0.0), None);
        let far = heights(0.26, 20.0).unwrap();
        assert!(
            far.tone == Tone::Bad && far.text.ends_with("20 m too low in the mean."),
            "{far:?}"
        );
        let level = heights(0.0, -37.9).unwrap();
        assert!(
            level
                .text
                .contains("38 m too high in the mean. It is nearly the same"),
            "{level:?}"
        );
        let both = score(1.0, 5.0, 0.0);
        assert!(
            both[0].0 == Tone::Info && both[1].0 == Tone::Bad,
            "{both:?}"
        );
    }
}
