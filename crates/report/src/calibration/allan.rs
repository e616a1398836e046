//! The report of an Allan deviation: the curve on logarithmic axes, its noises, what they mean.

use crate::drawing::axis::Axis;
use crate::drawing::plot::{Figure, Layer, Panel, Sign, key};
use crate::drawing::series::Point;
use crate::page::facts::{Fact, Source};
use crate::page::html::{self, Frame, Page};
use northing_evaluation::calibration::allan::{
    AllanPoint, AllanReport, Coefficient, NoiseCoefficients,
};

/// Points of a model's line.
const MODEL_POINTS: usize = 120;

/// The page about an Allan deviation; `settings` says what became of it, a sentence each.
#[must_use]
pub fn render(report: &AllanReport, settings: &[String], source: &Source<'_>) -> String {
    let mut page = Page::default();
    page.section("curve", "Allan deviation", &curve(report));
    page.section(
        "meaning",
        "What it says",
        &html::sentences(&report.sentences),
    );
    page.section(
        "settings",
        "Settings of a filter",
        &html::sentences(settings),
    );
    page.section("numbers", "Noises", &html::fact_table(&noises(report)));
    let mut facts = vec![
        Fact::new("duration", format!("{:.0} s", report.duration_s)),
        Fact::new("rate", format!("{:.1} Hz", report.rate_hz)),
        Fact::new("samples", report.samples.to_string()),
    ];
    let white = report.coefficients.noise_density;
    facts.extend(white.map(|n| {
        let label = format!("white noise, {}/sqrt(Hz)", report.unit);
        Fact::new(label, format!("{:.2e}", n.value))
    }));
    facts.push(Fact::new(
        format!("lowest point, {}", report.unit),
        format!(
            "{:.2e} at {:.0} s",
            report.floor.deviation, report.floor.tau_s
        ),
    ));
    page.finish(&Frame {
        kicker: "Northing \u{00b7} Allan deviation",
        title: &format!("Noise of {}", source.recording),
        lead: report.sensor.name(),
        summary: &facts,
        verdicts: &[],
        recording: source.recording,
        command: source.command,
        reading: "The Allan deviation at \u{03c4} is how far the means of neighbouring stretches of \u{03c4} \
                  seconds lie apart, divided by \u{221a}2. The band holds the true value with the confidence \
                  that was asked for.",
    })
}

/// One noise of the model: name, class of its line, and its deviation at tau.
type Noise = (
    &'static str,
    &'static str,
    fn(f64, f64) -> f64,
    Option<Coefficient>,
);

/// The four noises (A3): what each alone would show.
fn models(c: &NoiseCoefficients) -> [Noise; 4] {
    let flicker = |b: f64, _: f64| b * (2.0 * std::f64::consts::LN_2 / std::f64::consts::PI).sqrt();
    [
        (
            "quantisation",
            "s4",
            |q, tau| q * 3.0_f64.sqrt() / tau,
            c.quantisation,
        ),
        (
            "white noise",
            "s1",
            |n, tau| n / tau.sqrt(),
            c.noise_density,
        ),
        ("bias instability", "s2", flicker, c.bias_instability),
        (
            "random walk",
            "s3",
            |k, tau| k * (tau / 3.0).sqrt(),
            c.random_walk,
        ),
    ]
}

fn curve(report: &AllanReport) -> String {
    let points = &report.curve;
    let (Some(first), Some(last)) = (points.first(), points.last()) else {
        return String::new();
    };
    let of = |value: fn(&AllanPoint) -> f64| points.iter().map(value);
    let low = of(|p| p.lower)
        .filter(|v| *v > 0.0)
        .fold(f64::MAX, f64::min);
    let high = of(|p| p.upper).fold(0.0, f64::max);
    let mut layers = vec![Layer::band(
        points.iter().map(|p| [p.tau_s, p.lower, p.upper]).collect(),
        false,
    )];
    let mut legend = vec![
        key(
            Sign::Line,
            "line bold estimate",
            "measured, mean of the axes",
        ),
        key(
            Sign::Band,
            "band estimate-fill",
            "where the true value lies",
        ),
    ];
    for (name, class, at, coefficient) in models(&report.coefficients) {
        let Some(coefficient) = coefficient else {
            continue;
        };
        let curve = model(at, coefficient.value, [first.tau_s, last.tau_s]);
        layers.push(Layer::line(curve, &format!("thin dash {class}"), false));
        legend.push(key(Sign::Line, &format!("line dash {class}"), name));
    }
    let all = |p: &AllanPoint| [p.tau_s, p.deviation];
    layers.push(Layer::line(
        points.iter().map(all).collect(),
        "ghost estimate",
        false,
    ));
    layers.push(Layer::line(
        report.trusted().map(all).collect(),
        "bold estimate",
        false,
    ));
    let axis = Axis::logarithmic(0.7 * low, 1.4 * high);
    let panel = Panel::new("Allan deviation", report.unit, axis, layers).height(420.0);
    let figure = Figure::new(
        format!("Allan deviation of the {}", report.sensor.name()),
        Axis::logarithmic(first.tau_s, last.tau_s),
        legend,
        vec![panel],
    )
    .across("averaging time \u{03c4}, s");
    html::figure(
        figure,
        "How steady a mean is, by how long one averages.",
        &format!(
            "Look where the curve stops falling: averaging longer than that does not help. Beyond {:.0} s, \
             where the line is thin, the recording is too short to be trusted.",
            report.trusted_tau_s
        ),
    )
}

fn model(at: fn(f64, f64) -> f64, value: f64, [from, to]: [f64; 2]) -> Vec<Point> {
    let step = (to / from).max(1.0).ln() / MODEL_POINTS as f64;
    let taus = (0..=MODEL_POINTS).map(|k| from * (step * k as f64).exp());
    taus.map(|tau| [tau, at(value, tau)]).collect()
}

/// One of the four noises.
type Pick = fn(&NoiseCoefficients) -> Option<Coefficient>;

/// Every noise that the curve shows: mean of the axes, and each axis.
fn noises(report: &AllanReport) -> Vec<Fact> {
    let unit = report.unit;
    let kinds: [(&str, String, Pick); 4] = [
        ("quantisation Q", format!("{unit} s"), |c| c.quantisation),
        ("white noise N", format!("{unit}/sqrt(Hz)"), |c| {
            c.noise_density
        }),
        ("bias instability B", unit.to_owned(), |c| {
            c.bias_instability
        }),
        ("random walk K", format!("{unit}/sqrt(s)"), |c| {
            c.random_walk
        }),
    ];
    let shown = |c: Option<Coefficient>| {
        c.map_or_else(|| "not seen".to_owned(), |c| format!("{:.3e}", c.value))
    };
    let all = kinds.into_iter().map(|(name, unit, of)| {
        let axes = report.axis_coefficients.each_ref().map(|c| shown(of(c)));
        let value = match of(&report.coefficients) {
            None => "not seen".to_owned(),
            Some(c) => format!(
                "{:.3e} \u{00b1} {:.0e} {unit}; x, y, z: {}",
                c.value,
                c.std,
                axes.join(", ")
            ),
        };
        Fact::new(name, value)
    });
    all.collect()
}
