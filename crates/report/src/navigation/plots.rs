//! Plots of a navigation run: the track on a map, the paper's figures, errors, outages, innovations.

use crate::drawing::axis::{self, Axis, quantile};
use crate::drawing::curves::{angle_axis, error_limit, is_drawn};
use crate::drawing::fate::Fate;
use crate::drawing::map::{self, Place, Scale};
use crate::drawing::plot::{DOTS, Figure, Key, Layer, Panel, Sign, WIDTH, key};
use crate::drawing::residuals::{self, Residual};
use crate::drawing::series::{BandPoint, Point};
use northing_core::navigation::Validity;
use northing_evaluation::navigation::score::{CHI_SQUARE_95, OutageScore};
use northing_evaluation::navigation::trace::{AidPoint, NavigationPoint, NavigationTrace};
use northing_evaluation::navigation::{AidKind, NavigationKind, ScoredPoint};

/// Room around a track, m.
const ROOM_M: f64 = 2.0;
/// Ellipses drawn along a track.
const ELLIPSES: usize = 40;
/// Corners of an ellipse.
const CORNERS: usize = 36;
/// The larger half axis of an ellipse worth drawing, in units of the picture.
const LARGEST_ELLIPSE: f64 = 0.12 * WIDTH;
/// Half width of bands, standard deviations.
const SIGMAS: f64 = 3.0;
/// Class of fixes that the estimator got.
const USED: &str = "dots soft device";
/// Class of held-out fixes, and of the reference.
const HELD_OUT: &str = "dots soft reference";

/// Class of what the device itself said, beside an estimate.
const DEVICE: &str = "line thin s2";

/// What the curve of an estimator is called.
fn curve_key(kind: NavigationKind) -> Key {
    let name = match kind {
        NavigationKind::Device => "the device\u{2019}s own estimate",
        _ => "estimate",
    };
    key(Sign::Line, "line estimate", name)
}

/// What the device itself said, where that is not the estimate anyway.
fn beside(trace: &NavigationTrace, kind: NavigationKind) -> &[NavigationPoint] {
    match kind {
        NavigationKind::Device => &[],
        _ => trace.device.items(),
    }
}

fn beside_key() -> Key {
    key(Sign::Line, DEVICE, "the device\u{2019}s own")
}

fn place(position_m: [f64; 3]) -> Place {
    [position_m[0], position_m[1]]
}

/// Seen from above: fixes, reference and estimate with its 95 % ellipses; dead reckoning in the colour of what
/// was refused. `None` without estimates.
pub(crate) fn track(trace: &NavigationTrace, kind: NavigationKind) -> Option<String> {
    let points = trace.points.items();
    let mut places: Vec<Place> = points.iter().map(|p| place(p.position_m)).collect();
    let fixes = |used: bool| -> Vec<Place> {
        let of = trace.fixes.items().iter().filter(move |f| f.used == used);
        of.map(|f| place(f.position_m)).collect()
    };
    let (used, held_out) = (fixes(true), fixes(false));
    let reference: Vec<Place> = trace
        .reference
        .items()
        .iter()
        .map(|f| place(f.position_m))
        .collect();
    if places.is_empty() {
        return None;
    }
    places.extend(&used);
    let rough = Scale::new(&places, ROOM_M)?;
    places.extend(points.iter().filter_map(|p| corner_of(&rough, p)).flatten());
    let scale = Scale::new(&places, ROOM_M)?;
    let dead =
        |p: &NavigationPoint| matches!(p.validity, Validity::DeadReckoning | Validity::Invalid);
    let mut keys = vec![
        curve_key(kind),
        key(Sign::Dot, &format!("{USED} big"), "fixes used"),
    ];
    let ellipses = ellipses(&scale, points);
    if !ellipses.is_empty() {
        keys.push(key(Sign::Line, "line thin soft estimate", "95 % ellipses"));
    }
    if points.iter().any(dead) {
        keys.push(key(Sign::Line, "line gated", "dead reckoning"));
    }
    if !held_out.is_empty() {
        keys.push(key(Sign::Dot, &format!("{HELD_OUT} big"), "held-out fixes"));
    }
    let device: Vec<Place> = beside(trace, kind)
        .iter()
        .map(|p| place(p.position_m))
        .collect();
    if !device.is_empty() {
        keys.push(beside_key());
    }
    if !reference.is_empty() {
        keys.push(key(Sign::Line, "line thin dash reference", "reference"));
    }
    let mut svg = map::open(&scale, "Map of the track with its fixes", &keys);
    svg.dots(&scale.dots(&held_out, DOTS), HELD_OUT);
    svg.dots(&scale.dots(&used, DOTS), USED);
    svg.lines(&ellipses, "line thin soft estimate");
    svg.lines(&[scale.path(&device)], DEVICE);
    svg.lines(&[scale.path(&reference)], "line thin dash reference");
    let pieces = |dead_reckoning: bool| -> Vec<Vec<[f64; 2]>> {
        let mut pieces = vec![Vec::new()];
        for p in points {
            if dead(p) == dead_reckoning {
                if let Some(piece) = pieces.last_mut() {
                    piece.push(place(p.position_m));
                }
            } else if pieces.last().is_some_and(|piece| !piece.is_empty()) {
                pieces.push(Vec::new());
            }
        }
        pieces.retain(|piece| piece.len() > 1);
        pieces.iter().map(|piece| scale.path(piece)).collect()
    };
    svg.lines(&pieces(false), "line estimate");
    svg.lines(&pieces(true), "line gated");
    Some(map::close(svg))
}

/// 95 % ellipses along the track.
fn ellipses(scale: &Scale, points: &[NavigationPoint]) -> Vec<Vec<[f64; 2]>> {
    let step = points.len().div_ceil(ELLIPSES).max(1);
    let drawn = points.iter().step_by(step);
    drawn.filter_map(|point| ellipse(scale, point)).collect()
}

/// The corners of the box around an ellipse that is drawn.
fn corner_of(scale: &Scale, point: &NavigationPoint) -> Option<[Place; 2]> {
    let [north, east] = place(point.position_m);
    let [nn, ee, ..] = point.covariance_m2;
    let [a, b] = [nn, ee].map(|variance| (CHI_SQUARE_95 * variance.max(0.0)).sqrt());
    let drawn = a.max(b) * scale.units_per_m <= LARGEST_ELLIPSE;
    drawn.then_some([[north - a, east - b], [north + a, east + b]])
}

fn ellipse(scale: &Scale, point: &NavigationPoint) -> Option<Vec<[f64; 2]>> {
    let [nn, ee, _, ne] = point.covariance_m2;
    let size = CHI_SQUARE_95.sqrt();
    let largest = size * nn.max(0.0).sqrt().max(ee.max(0.0).sqrt());
    let drawn = largest * scale.units_per_m <= LARGEST_ELLIPSE;
    drawn.then(|| scale.ellipse(place(point.position_m), [nn, ne, ee], size, CORNERS))
}

fn time_of(trace: &NavigationTrace) -> Axis {
    let points = trace.points.items();
    let range = points.first().zip(points.last());
    let (low, high) = range.map_or((0.0, 1.0), |(a, b)| (a.time_s, b.time_s));
    Axis::time(low, high, 10)
}

/// What accelerometer and magnetometer give without a filter over time: roll and pitch, and heading, deg.
struct Alone<'a> {
    tilt: &'a [[f64; 3]],
    heading: &'a [[f64; 2]],
}

/// The paper's figure 3: roll, pitch and heading of the filter over what accelerometer and magnetometer give alone.
pub(crate) fn orientation(trace: &NavigationTrace, kind: NavigationKind) -> Option<Figure> {
    let alone = Alone {
        tilt: trace.raw_tilt.items(),
        heading: trace.raw_heading.items(),
    };
    let device = beside(trace, kind);
    orientation_of(trace.points.items(), &alone, device, kind, time_of(trace))
}

/// The same over the few seconds of the close look, every sample.
pub(crate) fn close_orientation(trace: &NavigationTrace, kind: NavigationKind) -> Option<Figure> {
    let points = &trace.close_look[..];
    let (first, last) = points.first().zip(points.last())?;
    let alone = Alone {
        tilt: &trace.close_tilt,
        heading: &trace.close_heading,
    };
    let within = first.time_s..=last.time_s;
    let device = beside(trace, kind).iter();
    let device: Vec<NavigationPoint> = device
        .filter(|p| within.contains(&p.time_s))
        .copied()
        .collect();
    let time = Axis::time(first.time_s, last.time_s, 8);
    let mut figure = orientation_of(points, &alone, &device, kind, time)?;
    figure.label.push_str(", a few seconds");
    Some(figure)
}

fn orientation_of(
    points: &[NavigationPoint],
    alone: &Alone<'_>,
    device: &[NavigationPoint],
    kind: NavigationKind,
    time: Axis,
) -> Option<Figure> {
    if !is_drawn(&angle(points, 0)) {
        return None;
    }
    let tilt = |i: usize| -> Vec<Point> { alone.tilt.iter().map(|t| [t[0], t[i]]).collect() };
    let heading_band: Vec<BandPoint> = points
        .iter()
        .map(|p| match (p.angles_deg, p.heading_std_deg) {
            (Some([yaw, ..]), Some(std)) => [p.time_s, yaw - SIGMAS * std, yaw + SIGMAS * std],
            _ => [p.time_s, f64::NAN, f64::NAN],
        })
        .collect();
    let panel = |name: &str, i: usize, alone: Vec<Point>, band: Vec<BandPoint>| {
        let curve = angle(points, i);
        let axis = angle_axis(&[&curve, &most(&alone)]);
        let alone = Layer::dots(alone, "soft device");
        let layers = vec![
            Layer::band(band, true),
            alone,
            Layer::line(curve, "estimate", true),
            Layer::line(angle(device, i), "thin s2", true),
        ];
        Panel::new(name, "deg", axis, layers)
    };
    let panels = vec![
        panel("Roll", 2, tilt(1), Vec::new()),
        panel("Pitch", 1, tilt(2), Vec::new()),
        panel("Heading", 0, alone.heading.to_vec(), heading_band),
    ];
    let sensors = match alone.heading {
        [] => "accelerometer alone",
        _ => "accelerometer and magnetometer alone",
    };
    let mut legend = vec![
        curve_key(kind),
        key(Sign::Dot, "dots big soft device", sensors),
        key(
            Sign::Band,
            "band estimate-fill",
            "\u{00b1}3\u{03c3} of the heading",
        ),
    ];
    if is_drawn(&angle(device, 0)) {
        legend.push(beside_key());
    }
    Some(Figure::new(
        "Roll, pitch and heading over time",
        time,
        legend,
        panels,
    ))
}

/// An angle of yaw, pitch, roll over time; what is missing lifts the pen.
fn angle(points: &[NavigationPoint], i: usize) -> Vec<Point> {
    let value = |p: &NavigationPoint| p.angles_deg.map_or(f64::NAN, |a| a[i]);
    points.iter().map(|p| [p.time_s, value(p)]).collect()
}

/// Lowest and highest of a cloud without the one in a hundred on each side that lies far off.
fn most(cloud: &[Point]) -> Vec<Point> {
    let values = axis::sorted(cloud.iter().map(|p| p[1]));
    let ends = [0.01, 0.99].map(|share| [0.0, quantile(&values, share)]);
    if values.is_empty() {
        Vec::new()
    } else {
        ends.into()
    }
}

/// The paper's figure 4: position north, east and up over the fixes.
pub(crate) fn position(trace: &NavigationTrace, kind: NavigationKind) -> Option<Figure> {
    let points = trace.points.items();
    if points.is_empty() {
        return None;
    }
    let panels = coordinates().map(|coordinate| position_panel(trace, kind, points, coordinate));
    Some(Figure::new(
        "Position north, east and up over time, with fixes",
        time_of(trace),
        position_keys(trace, kind),
        panels.into(),
    ))
}

/// Name, index and sign of what is drawn of north, east, down.
type Coordinate = (&'static str, usize, f64);

fn coordinates() -> [Coordinate; 3] {
    [("North", 0, 1.0), ("East", 1, 1.0), ("Up", 2, -1.0)]
}

fn position_keys(trace: &NavigationTrace, kind: NavigationKind) -> Vec<Key> {
    let mut keys = vec![
        curve_key(kind),
        key(Sign::Band, "band estimate-fill", "\u{00b1}3\u{03c3}"),
        key(Sign::Dot, &format!("{USED} big"), "fixes used"),
    ];
    if trace.fixes.items().iter().any(|fix| !fix.used) {
        keys.push(key(Sign::Dot, &format!("{HELD_OUT} big"), "held-out fixes"));
    }
    if !beside(trace, kind).is_empty() {
        keys.push(beside_key());
    }
    keys
}

fn position_panel(
    trace: &NavigationTrace,
    kind: NavigationKind,
    points: &[NavigationPoint],
    (name, i, sign): Coordinate,
) -> Panel {
    let curve: Vec<Point> = points
        .iter()
        .map(|p| [p.time_s, sign * p.position_m[i]])
        .collect();
    let band: Vec<BandPoint> = points
        .iter()
        .map(|p| {
            let half = SIGMAS * p.covariance_m2[i].max(0.0).sqrt();
            let centre = sign * p.position_m[i];
            [p.time_s, centre - half, centre + half]
        })
        .collect();
    let (first, last) = (points[0].time_s, points[points.len() - 1].time_s);
    let dots = |used: bool, class: &str| Layer::Dots {
        points: trace
            .fixes
            .items()
            .iter()
            .filter(|f| f.used == used && (first..=last).contains(&f.time_s))
            .map(|f| [f.time_s, sign * f.position_m[i]])
            .collect(),
        class: class.to_owned(),
    };
    let device: Vec<Point> = beside(trace, kind)
        .iter()
        .filter(|p| (first..=last).contains(&p.time_s))
        .map(|p| [p.time_s, sign * p.position_m[i]])
        .collect();
    let axis = extent(&curve, usual_half(&band));
    let layers = vec![
        Layer::band(band, false),
        dots(false, HELD_OUT),
        dots(true, USED),
        Layer::line(device, "thin s2", false),
        Layer::line(curve, "estimate", false),
    ];
    Panel::new(name, "m", axis, layers)
}

/// An axis around a curve and what lies within `room` of it.
fn extent(curve: &[Point], room: f64) -> Axis {
    let (low, high) = axis::extent(curve.iter().map(|p| p[1]));
    let room = (0.08 * (high - low)).max(0.5).max(room);
    Axis::linear(low - room, high + room, 5)
}

/// Half the width of a band, as it mostly is.
fn usual_half(band: &[BandPoint]) -> f64 {
    let halves = axis::sorted(band.iter().map(|b| 0.5 * (b[2] - b[1])));
    quantile(&halves, 0.5)
}

/// The paper's figure 5: a few seconds, every estimate, between the fixes of a slow receiver.
pub(crate) fn close_look(trace: &NavigationTrace, kind: NavigationKind) -> Option<Figure> {
    let points = &trace.close_look[..];
    let (first, last) = points.first().zip(points.last())?;
    let panels = coordinates().into_iter().take(2);
    let panels = panels.map(|coordinate| close_panel(trace, kind, points, coordinate));
    let mut keys = position_keys(trace, kind);
    keys.retain(|(sign, ..)| *sign != Sign::Band);
    Some(Figure::new(
        "Position over a few seconds: every estimate, and the fixes between which it goes on",
        Axis::time(first.time_s, last.time_s, 8),
        keys,
        panels.collect(),
    ))
}

/// So few fixes shall be seen: on top, large, and all of them; the band would make the curve small.
fn close_panel(
    trace: &NavigationTrace,
    kind: NavigationKind,
    points: &[NavigationPoint],
    coordinate: Coordinate,
) -> Panel {
    let mut panel = position_panel(trace, kind, points, coordinate);
    panel
        .layers
        .retain(|layer| !matches!(layer, Layer::Band { .. }));
    let mut seen = Vec::new();
    for layer in &mut panel.layers {
        match layer {
            Layer::Dots { points, class } => {
                class.push_str(" big");
                seen.extend_from_slice(points);
            }
            Layer::Line { points, .. } => seen.extend_from_slice(points),
            _ => {}
        }
    }
    panel.layers.reverse();
    panel.axis = extent(&seen, 0.0);
    panel
}

/// Errors where they were scored, and what was predicted of them; `None` without scores.
pub(crate) fn errors(trace: &NavigationTrace) -> Option<Figure> {
    let scored = trace.scored.items();
    if scored.is_empty() {
        return None;
    }
    let (error, bound) = horizontal(scored.iter(), 0.0);
    let (limit, note) = error_limit(&error, &[], "m");
    let mut horizontal = Panel::new(
        "Horizontal error",
        "m",
        Axis::linear(0.0, limit, 5),
        vec![Layer::band(bound, false), Layer::dots(error, "estimate")],
    );
    (horizontal.note, horizontal.height) = (note, 220.0);
    let mut panels = vec![horizontal];
    let vertical: Vec<Point> = scored
        .iter()
        .filter(|(_, p)| p.vertical)
        .map(|(t, p)| [*t, -p.error.z])
        .collect();
    if is_drawn(&vertical) {
        let bound = scored.iter().map(|(t, p)| {
            let half = 1.96 * p.vertical_std;
            [*t, -half, half]
        });
        let (limit, note) = error_limit(&vertical, &[], "m");
        let layers = vec![
            Layer::band(bound.collect(), false),
            Layer::dots(vertical, "estimate"),
        ];
        let panel =
            Panel::new("Error upwards", "m", Axis::linear(-limit, limit, 5), layers).note(note);
        panels.push(panel);
    }
    let legend = error_keys("error");
    Some(Figure::new(
        "Position error over time",
        time_of(trace),
        legend,
        panels,
    ))
}

/// Each outage from its start: error, and what was predicted of it; `None` without outages.
pub(crate) fn outages(trace: &NavigationTrace, outages: &[OutageScore]) -> Option<Figure> {
    let first_fix_s = trace.fixes.items().first()?.time_s;
    let mut panels = Vec::new();
    for outage in outages.iter().filter(|o| o.horizontal_error_m.is_some()) {
        let start = first_fix_s + outage.start_s;
        let inside = trace.scored.items().iter();
        let inside = inside.filter(|(t, _)| (start..start + outage.duration_s).contains(t));
        let (error, bound) = horizontal(inside, start);
        let highest = error.iter().map(|p| p[1]);
        let highest = highest
            .chain(bound.iter().map(|b| b[2]))
            .fold(0.1, f64::max);
        let layers = vec![Layer::band(bound, false), Layer::dots(error, "estimate")];
        let name = format!("{:.0} s after the first fix", outage.start_s);
        let panel =
            Panel::new(&name, "m", Axis::linear(0.0, 1.05 * highest, 4), layers).height(96.0);
        panels.push(panel);
    }
    let longest = outages.iter().map(|o| o.duration_s).fold(1.0, f64::max);
    let legend = error_keys("horizontal error");
    let time = Axis::time(0.0, longest, 8);
    let label = "Horizontal error in each outage, over the time since its start";
    (!panels.is_empty()).then(|| Figure::new(label, time, legend, panels))
}

/// Horizontal errors over the time since a start, and the bound of 95 %.
fn horizontal<'a>(
    scored: impl Iterator<Item = &'a (f64, ScoredPoint)>,
    start_s: f64,
) -> (Vec<Point>, Vec<BandPoint>) {
    let half = CHI_SQUARE_95.sqrt() * std::f64::consts::FRAC_1_SQRT_2;
    let each = scored.map(|(t, p)| {
        let time_s = t - start_s;
        let bound = [time_s, 0.0, half * p.horizontal_std];
        ([time_s, p.error.xy().norm()], bound)
    });
    each.unzip()
}

fn error_keys(error: &str) -> Vec<Key> {
    vec![
        key(Sign::Dot, "dots big estimate", error),
        key(Sign::Band, "band estimate-fill", "predicted, 95 %"),
    ]
}

/// Unit of an aid's residual as drawn, and the factor from what the trace has.
const fn unit(aid: AidKind) -> (&'static str, f64) {
    match aid {
        AidKind::GnssPosition | AidKind::GnssHeight | AidKind::Barometer => ("m", 1.0),
        AidKind::GnssVelocity
        | AidKind::ForwardSpeed
        | AidKind::WaterVelocity
        | AidKind::ZeroVelocity
        | AidKind::NonHolonomic => ("m/s", 1.0),
        AidKind::Magnetometer | AidKind::Heading | AidKind::Accelerometer => {
            ("deg", 180.0 / std::f64::consts::PI)
        }
    }
}

/// Innovations of one aid, component by component, with what was expected of them.
pub(crate) fn innovations(trace: &NavigationTrace, aid: AidKind) -> Option<Figure> {
    let points = trace.aids.get(&aid)?.items();
    let components = points.iter().map(|p| p.degrees_of_freedom).max()?;
    let names: &[&str] = match (aid, components) {
        (AidKind::Accelerometer, _) => &["Roll", "Pitch"],
        (AidKind::GnssHeight, _) => &["Down"],
        (_, 1) => &["Residual"],
        _ => &["North", "East", "Down"],
    };
    let panels = names.iter().take(usize::from(components)).enumerate();
    let panels = panels.map(|(i, name)| innovation_panel(points, aid, i, name));
    let mut legend = residuals::keys(&points.iter().map(|p| p.outcome), Fate::name);
    legend.push(residuals::band_key());
    let label = format!("Innovations of {} over time", aid.name());
    Some(Figure::new(
        &label,
        time_of(trace),
        legend,
        panels.collect(),
    ))
}

fn innovation_panel(points: &[AidPoint], aid: AidKind, i: usize, name: &str) -> Panel {
    let (unit, factor) = unit(aid);
    let residual = |p: &AidPoint| Residual {
        time_s: p.time_s,
        value: factor * p.residual[i],
        std: factor * p.std[i],
        outcome: p.outcome,
    };
    let residuals: Vec<_> = points.iter().map(residual).collect();
    residuals::panel(name, unit, &residuals).height(110.0)
}
