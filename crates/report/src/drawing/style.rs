//! Colours and style sheets of reports: one visual language for page, plots and README picture.
//!
//! Plots never name a colour. They name a [`Role`] through a CSS class; the page defines the roles
//! twice (light and dark), a picture that stands alone gets the light ones. The hues are those of
//! Okabe and Ito, which people with any of the common colour deficiencies can tell apart; where
//! one colour must be told from another, shape or dash says it too.

use std::fmt::Write as _;

/// What a colour stands for: its name in CSS, without dashes in front, and the colour on light and on dark paper.
struct Role(&'static str, &'static str, &'static str);

const PAPER: Role = Role("paper", "#f6f7f9", "#0f1419");
const PANEL: Role = Role("panel", "#ffffff", "#171d24");
const INK: Role = Role("ink", "#15202b", "#eef2f5");
const MUTED: Role = Role("muted", "#55626f", "#a3b0bc");
const GRID: Role = Role("grid", "#dfe4e9", "#2b343d");
const GOOD: Role = Role("good", "#007a59", "#2fc79b");
/// Buttons, links and what has the focus.
const ACCENT: Role = Role("accent", "#0f5c6e", "#7fd1de");

/// The roles of curves; each gives a stroke and a fill of its name.
const CURVES: [Role; 5] = [
    Role("estimate", "#0072b2", "#56b4e9"),
    Role("reference", "#15202b", "#eef2f5"),
    Role("device", "#b8578c", "#e59cc3"),
    Role("gated", "#d55e00", "#ff8a3d"),
    Role("inflated", "#b27b00", "#f0c544"),
];

/// Number of colours for the lines of a comparison; further lines repeat them dashed.
pub(crate) const SERIES: usize = 13;

/// Thirteen colours that are told apart on light and on dark paper; estimators have theirs everywhere, see [`ESTIMATORS`].
const LINES: [Role; SERIES] = [
    Role("s0", "#0397d7", "#49d9fb"),
    Role("s1", "#b26d12", "#f2a023"),
    Role("s2", "#115f11", "#05942d"),
    Role("s3", "#a40f94", "#ffb3d5"),
    Role("s4", "#5e13b3", "#ac34de"),
    Role("s5", "#3c4a57", "#c3ced8"),
    Role("s6", "#c8719b", "#ab989a"),
    Role("s7", "#105280", "#3885aa"),
    Role("s8", "#763748", "#b35a87"),
    Role("s9", "#5f7771", "#64ffb2"),
    Role("s10", "#9275ff", "#4e69fa"),
    Role("s11", "#ff21c8", "#f039b2"),
    Role("s12", "#9f02fa", "#d184ee"),
];

/// The place among the colours of each attitude estimator, the same as on the lab's page.
const ESTIMATORS: [(&str, usize); 12] = [
    ("mekf", 0),
    ("integration", 1),
    ("bounded-velocity", 2),
    ("quaternion-ekf", 3),
    ("usque", 4),
    ("device", 6),
    ("mekf3", 7),
    ("complementary", 8),
    ("complementary-passive", 9),
    ("complementary-direct", 10),
    ("cascade", 11),
    ("cascade-ekf", 12),
];

/// The places among the colours of lines with these names, one after the other: an estimator's own, where it is free, for
/// others the first that is free. More names of the same beginning keep what it has.
pub(crate) fn places(names: &[&str]) -> Vec<usize> {
    let mut taken: Vec<usize> = Vec::new();
    for name in names {
        let own = ESTIMATORS.iter().find(|(estimator, _)| estimator == name);
        let own = own
            .map(|(_, place)| *place)
            .filter(|place| !taken.contains(place));
        let place = own.or_else(|| (0..).find(|place| !taken.contains(place)));
        taken.extend(place);
    }
    taken
}

/// Class of the n-th line: a colour, dashed once the colours are used up.
pub(crate) fn series_class(i: usize) -> String {
    let dash = if i < SERIES { "" } else { " dash" };
    format!("s{}{dash}", i % SERIES)
}

fn roles() -> impl Iterator<Item = Role> {
    let paper = [PAPER, PANEL, INK, MUTED, GRID].into_iter();
    paper.chain(CURVES).chain([GOOD, ACCENT]).chain(LINES)
}

/// The rules that colour a plot, with `paint` naming the colour of a role.
fn plot_rules(paint: impl Fn(&Role) -> String) -> String {
    let mut css = String::from(PLOT_SHAPES);
    let role = |css: &mut String, selector: &str, property: &str, role: &Role| {
        // Writing to a String cannot fail.
        let _ = writeln!(css, "{selector}{{{property}:{}}}", paint(role));
    };
    role(&mut css, ".frame", "fill", &PANEL);
    role(&mut css, ".grid", "stroke", &GRID);
    role(&mut css, ".tick,.unit,.note", "fill", &MUTED);
    role(&mut css, ".name,.key,.tag", "fill", &INK);
    role(&mut css, ".zero,.rule", "stroke", &MUTED);
    role(&mut css, ".mean", "stroke", &INK);
    for of in CURVES.iter().chain(&LINES) {
        let Role(class, ..) = of;
        role(&mut css, &format!(".{class}"), "stroke", of);
        role(&mut css, &format!(".{class}-fill"), "fill", of);
    }
    css
}

/// Widths, dashes and type of plots; colours come from [`plot_rules`].
const PLOT_SHAPES: &str = "\
.plot text{font-family:system-ui,-apple-system,'Segoe UI',Roboto,Helvetica,Arial,sans-serif}
.tick{font-size:13.5px;font-variant-numeric:tabular-nums}
.unit{font-size:14px;font-weight:400}
.name{font-size:15.5px;font-weight:650}
.key{font-size:14.5px}
.tag{font-size:14px;font-weight:650}
.note{font-size:13.5px}
.end{text-anchor:end}
.mid{text-anchor:middle}
.line,.dots,.grid,.zero,.rule{fill:none}
.line{stroke-width:2;stroke-linejoin:round;stroke-linecap:round}
.thin{stroke-width:1.3}
.bold{stroke-width:2.8}
.ghost{opacity:.75;stroke-width:1.6}
.dash{stroke-dasharray:7 5;stroke-linecap:butt}
.dots{stroke-width:3.2;stroke-linecap:round}
.big{stroke-width:6}
.soft{opacity:.68}
.grid{stroke-width:1}
.zero{stroke-width:1;opacity:.6}
.rule{stroke-width:1.4;stroke-dasharray:3 4}
.band{opacity:.2;stroke:none}
.bar{stroke:none}
";

/// Style of a picture that stands alone: the light colours, written out.
pub(crate) fn standalone_css() -> String {
    plot_rules(|Role(_, light, _)| (*light).to_owned())
}

/// The style sheet of the page.
pub(crate) fn page_css() -> String {
    let variables = |dark: bool| {
        let mut css = String::new();
        for Role(name, on_light, on_dark) in roles() {
            let colour = if dark { on_dark } else { on_light };
            let _ = write!(css, "--{name}:{colour};");
        }
        css
    };
    let (light, dark) = (variables(false), variables(true));
    let plots = plot_rules(|Role(name, ..)| format!("var(--{name})"));
    format!(
        ":root{{color-scheme:light dark;{light}}}\n\
         @media (prefers-color-scheme:dark){{:root{{{dark}}}}}\n\
         {PAGE_RULES}{plots}\
         @media print{{:root{{color-scheme:light;{light}}}{PRINT_RULES}}}\n"
    )
}

/// Layout and type of the page.
const PAGE_RULES: &str = "\
*{box-sizing:border-box}
html{-webkit-text-size-adjust:100%;scroll-behavior:smooth}
body{margin:0;background:var(--paper);color:var(--ink);font:17px/1.55 system-ui,-apple-system,'Segoe UI',Roboto,Helvetica,Arial,sans-serif;font-variant-numeric:tabular-nums}
main,header,footer{max-width:1180px;margin:0 auto;padding:0 clamp(16px,3vw,40px)}
header{padding-top:clamp(24px,4vw,52px)}
.kicker{margin:0 0 6px;color:var(--muted);font-size:15px;font-weight:600;letter-spacing:.06em;text-transform:uppercase}
h1{margin:0;font-size:clamp(30px,4vw,46px);line-height:1.12;letter-spacing:-.02em;overflow-wrap:anywhere}
h2{margin:60px 0 14px;font-size:27px;line-height:1.2;letter-spacing:-.012em}
h3{margin:30px 0 8px;font-size:20px}
p{margin:0 0 14px}
.lead{margin:10px 0 0;color:var(--muted);font-size:19px;overflow-wrap:anywhere}
nav{margin:22px 0 0;padding:12px 0;border-top:1px solid var(--grid);border-bottom:1px solid var(--grid)}
nav ul{display:flex;flex-wrap:wrap;gap:4px 24px;margin:0;padding:0;list-style:none}
a{color:var(--estimate);text-decoration-thickness:1px;text-underline-offset:3px}
nav a{text-decoration:none;font-weight:550}
nav a:hover{text-decoration:underline}
.facts{display:grid;grid-template-columns:repeat(auto-fit,minmax(178px,1fr));gap:14px;margin:22px 0 0}
.facts div{background:var(--panel);border:1px solid var(--grid);border-radius:12px;padding:14px 18px 13px}
.facts dt{color:var(--muted);font-size:15px;line-height:1.3}
.facts dd{margin:5px 0 0;font-size:26px;font-weight:650;line-height:1.2;letter-spacing:-.012em;overflow-wrap:anywhere}
.verdicts{margin:18px 0 0;padding:0;list-style:none;display:grid;gap:10px}
.verdicts li,.verdict{display:flex;gap:14px;align-items:baseline;background:var(--panel);border:1px solid var(--grid);border-left:6px solid var(--tone);border-radius:10px;padding:11px 18px}
.verdicts b,.verdict b{flex:none;min-width:5.2em;color:var(--tone);font-weight:700}
.good{--tone:var(--good)}.info{--tone:var(--muted)}.warn{--tone:var(--inflated)}.bad{--tone:var(--gated)}
.toned{background:color-mix(in srgb,var(--tone) 24%,transparent)}
figure{margin:0 0 30px;background:var(--panel);border:1px solid var(--grid);border-radius:14px;padding:20px 18px 16px}
figure .plot{display:block;width:100%;height:auto}
.picture{overflow-x:auto}
@media screen and (max-width:640px){.picture .plot{min-width:720px}}
figcaption{max-width:62em;margin:10px 6px 4px;color:var(--muted);font-size:16.5px}
figcaption b{color:var(--ink)}
.wide{overflow-x:auto;background:var(--panel);border:1px solid var(--grid);border-radius:14px;margin:0 0 22px}
.verdicts+.wide{margin-top:14px}
table{width:100%;border-collapse:collapse;font-size:16.5px}
caption{padding:14px 18px 2px;text-align:left;color:var(--muted)}
th,td{padding:9px 18px;text-align:left;vertical-align:baseline;border-bottom:1px solid var(--grid)}
tbody tr:last-child>*{border-bottom:0}
thead th{color:var(--muted);font-size:15px;font-weight:600;white-space:nowrap}
tbody th{font-weight:600}
.num{text-align:right;white-space:nowrap}
.best{font-weight:750;color:var(--good)}
.best::before{content:'\\25B8\\2009'}
.none{color:var(--muted)}
code{font:.93em/1.4 ui-monospace,SFMono-Regular,Menlo,Consolas,'DejaVu Sans Mono',monospace;overflow-wrap:anywhere}
pre{margin:10px 0;padding:12px 16px;overflow-x:auto;background:var(--panel);border:1px solid var(--grid);border-radius:10px;font:.85em/1.4 ui-monospace,SFMono-Regular,Menlo,Consolas,'DejaVu Sans Mono',monospace}
summary{cursor:pointer}
.small{color:var(--muted);font-size:15.5px}
.issues{margin:0 0 22px;padding-left:1.2em}
footer{margin-top:64px;padding-top:18px;padding-bottom:44px;color:var(--muted);font-size:15px}
footer p{margin:0 0 5px;overflow-wrap:anywhere}
@media (min-width:1700px){body{font-size:20px}main,header,footer{max-width:1500px}table,figcaption{font-size:19px}}
";

/// What differs on paper.
const PRINT_RULES: &str = "\
@page{margin:14mm}
body{font-size:10.5pt;background:#fff}
nav{display:none}
main,header,footer{max-width:none;padding-left:0;padding-right:0}
h2{margin-top:22pt}
h2,h3{break-after:avoid}
.wide{overflow:visible}
th,td{padding:4pt 7pt}
thead th{white-space:normal;font-size:9pt}
footer{margin-top:24pt;padding-bottom:0;font-size:9pt}
figure,.facts div,.verdicts li,tr{break-inside:avoid}
figure,.wide,.facts div,.verdicts li{border-color:#ccc}
table,figcaption{font-size:9.5pt}
.facts dd{font-size:14pt}
";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn page_defines_every_colour_for_light_and_dark_and_reaches_outside_for_nothing() {
        let css = page_css();
        for Role(name, ..) in roles() {
            let definition = format!("--{name}:#");
            assert_eq!(css.matches(&definition).count(), 3, "{definition}");
        }
        assert!(!css.contains("url(") && !css.contains("@import") && !css.contains('<'));
    }

    /// One colour has one meaning: the lab's page names the estimators' colours, and they are these.
    #[test]
    fn estimators_have_the_colours_that_the_lab_gives_them() {
        let lab = include_str!("../../../../web/lab/style.css");
        let of = |name: &str| -> Vec<&str> {
            let key = format!("--{name}:");
            let starts = lab
                .match_indices(&key)
                .map(|(at, _)| &lab[at + key.len()..]);
            starts.map(|rest| &rest[..7]).collect()
        };
        for (name, place) in ESTIMATORS {
            let Role(_, light, dark) = LINES[place];
            assert_eq!(of(name), [light, dark], "{name}");
        }
        assert_eq!(places(&["mekf", "usque"]), [0, 4]);
        assert_eq!(places(&["another", "mekf", "device"]), [0, 1, 6]);
        assert_eq!(places(&["usque", "a", "usque", "b"]), [4, 0, 1, 2]);
    }

    #[test]
    fn picture_that_stands_alone_needs_no_variables() {
        assert!(!standalone_css().contains("var("));
    }
}
