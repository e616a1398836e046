//! A figure as data: what the script of the page needs to make instruments of its panels.

use serde_json::{Value, json};

use crate::drawing::plot::{Figure, Layer, Panel, Sign, TIME};
use crate::drawing::series::{self, BandPoint, Point};

/// Points of one curve at most; a band has two.
const POINTS: usize = 1500;
/// Figures of a value: more than a screen shows, fewer than a file wants.
const FIGURES: i32 = 5;

/// The x of all layers: most of them share theirs, so each is written once.
#[derive(Default)]
struct Instants(Vec<Vec<f64>>);

impl Instants {
    fn place(&mut self, x: Vec<f64>) -> usize {
        let known = self.0.iter().position(|known| *known == x);
        known.unwrap_or_else(|| {
            self.0.push(x);
            self.0.len() - 1
        })
    }
}

/// A number with as many figures as are worth their bytes; null where there is none.
fn rounded(value: f64, figures: i32) -> Value {
    if !value.is_finite() {
        return Value::Null;
    }
    let size = value.abs();
    if size < 1e-12 {
        return json!(0);
    }
    let decimals = (figures - 1 - size.log10().floor() as i32).clamp(-300, 300);
    let scale = 10_f64.powi(decimals.abs());
    // Multiplying and dividing by whole powers of ten alone, so that the text is short.
    let short = match decimals {
        0.. => (value * scale).round() / scale,
        _ => (value / scale).round() * scale,
    };
    if short.fract() == 0.0 && short.abs() < 1e15 {
        return json!(short as i64);
    }
    json!(short)
}

fn column(values: impl Iterator<Item = f64>) -> Vec<Value> {
    values.map(|value| rounded(value, FIGURES)).collect()
}

impl Figure {
    /// As JSON that may stand in a script element.
    pub(crate) fn data(&self) -> String {
        let mut instants = Instants::default();
        let panels: Vec<Value> = self
            .panels
            .iter()
            .map(|p| self.panel_data(p, &mut instants))
            .collect();
        // Times of a long recording have more figures than values.
        let x: Vec<Vec<Value>> = instants
            .0
            .iter()
            .map(|x| x.iter().map(|v| rounded(*v, 8)).collect())
            .collect();
        let (low, high) = self.time.range();
        let data = json!({
            "label": self.label,
            "across": self.across,
            "linked": self.across == TIME,
            "x_range": [rounded(low, 8), rounded(high, 8)],
            "log_x": self.time.is_logarithmic(),
            "x": x,
            "panels": panels,
        });
        // The one character that could end the element.
        data.to_string().replace('<', "\\u003c")
    }

    fn panel_data(&self, panel: &Panel, instants: &mut Instants) -> Value {
        let (low, high) = panel.axis.range();
        let layers: Vec<Value> = panel
            .layers
            .iter()
            .filter_map(|layer| self.layer_data(panel, layer, instants))
            .collect();
        json!({
            "title": panel.title,
            "unit": panel.unit,
            "note": panel.note,
            "height": panel.height,
            "y_range": [rounded(low, FIGURES), rounded(high, FIGURES)],
            "log_y": panel.axis.is_logarithmic(),
            "layers": layers,
        })
    }

    /// What a layer is called: in the legend, or at the end of its line.
    fn name_of(&self, panel: &Panel, class: &str) -> Option<String> {
        let in_legend = |(_, known, _): &&(Sign, String, String)| {
            class == known
                || class
                    .split(' ')
                    .all(|part| part == "thin" || known.split(' ').any(|k| k == part))
        };
        let named = self
            .legend
            .iter()
            .find(in_legend)
            .map(|(_, _, name)| name.clone());
        let hue = class
            .split(' ')
            .find(|part| *part != "line" && *part != "dots")?;
        let tagged = |(_, of, _): &&(f64, String, String)| {
            of.split(' ').any(|part| part == format!("{hue}-fill"))
        };
        named.or_else(|| {
            panel
                .tags
                .iter()
                .find(tagged)
                .map(|(_, _, name)| name.clone())
        })
    }

    fn layer_data(&self, panel: &Panel, layer: &Layer, instants: &mut Instants) -> Option<Value> {
        let name = |class: &str| self.name_of(panel, class).unwrap_or_default();
        let values = |points: &[Point], instants: &mut Instants| {
            let x = instants.place(points.iter().map(|p| p[0]).collect());
            (x, column(points.iter().map(|p| p[1])))
        };
        Some(match layer {
            Layer::Band {
                points,
                class,
                angle,
            } => {
                let points: Vec<BandPoint> = series::thin_band(points, POINTS);
                let x = instants.place(points.iter().map(|p| p[0]).collect());
                let (low, high) = (points.iter().map(|p| p[1]), points.iter().map(|p| p[2]));
                json!({"kind": "band", "class": class, "name": name(class), "angle": angle, "x": x, "low": column(low), "high": column(high)})
            }
            Layer::Line {
                points,
                class,
                angle,
            } => {
                let (x, y) = values(&series::thin(points, POINTS), instants);
                json!({"kind": "line", "class": class, "name": name(class), "angle": angle, "x": x, "y": y})
            }
            Layer::Dots { points, class } => {
                let (x, y) = values(&series::pick(points, POINTS), instants);
                json!({"kind": "dots", "class": class, "name": name(class), "x": x, "y": y})
            }
            Layer::Bars { bars, class } => {
                // A step at the beginning of each bar, and the end of the last one.
                let last = bars.last()?;
                let points: Vec<Point> = bars
                    .iter()
                    .map(|b| [b[0], b[2]])
                    .chain([[last[1], last[2]]])
                    .collect();
                let (x, y) = values(&points, instants);
                json!({"kind": "bars", "class": class, "name": name(class), "x": x, "y": y})
            }
            Layer::Rule { value, label, .. } => {
                json!({"kind": "rule", "name": label, "value": rounded(*value, FIGURES)})
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drawing::axis::Axis;
    use crate::drawing::plot::{key, line_key};

    fn figure(points: Vec<Point>) -> Figure {
        let band = points
            .iter()
            .map(|p| [p[0], p[1] - 1.0, p[1] + 1.0])
            .collect();
        let layers = vec![
            Layer::band(band, false),
            Layer::line(points, "estimate thin", false),
            Layer::rule(3.0, "</script>"),
        ];
        let panel = Panel::new("Error", "deg", Axis::linear(-2.0, 2.0, 5), layers);
        let legend = vec![
            line_key("estimate", "error"),
            key(Sign::Band, "band estimate-fill", "3 sigma"),
        ];
        Figure::new("A figure", Axis::time(0.0, 10.0, 5), legend, vec![panel])
    }

    #[test]
    fn curves_keep_their_names_and_their_values_and_share_their_instants() {
        let points: Vec<Point> = (0..100)
            .map(|i| [f64::from(i) * 0.1, (f64::from(i) * 0.1).sin()])
            .collect();
        let text = figure(points.clone()).data();
        assert!(!text.contains('<'));
        let data: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(data["x"].as_array().unwrap().len(), 1);
        let layers = &data["panels"][0]["layers"];
        assert_eq!(
            (&layers[0]["name"], &layers[1]["name"]),
            (&json!("3 sigma"), &json!("error"))
        );
        assert_eq!(layers[2]["name"], "</script>");
        for (i, [x, y]) in points.iter().enumerate() {
            assert!((data["x"][0][i].as_f64().unwrap() - x).abs() < 1e-6);
            assert!((layers[1]["y"][i].as_f64().unwrap() - y).abs() < 1e-4 * y.abs() + 1e-9);
        }
        assert_eq!(data["linked"], true);
    }

    #[test]
    fn a_long_curve_is_thinned_and_a_gap_stays_one() {
        let points = (0..50_000).map(|i| {
            [
                f64::from(i),
                if i == 25_000 {
                    f64::NAN
                } else {
                    1.0 / f64::from(i + 1)
                },
            ]
        });
        let mut points: Vec<Point> = points.collect();
        let text = figure(points.clone()).data();
        assert!(text.len() < 100_000, "{}", text.len());
        points.truncate(1000);
        points[500][1] = f64::NAN;
        let data: Value = serde_json::from_str(&figure(points).data()).unwrap();
        assert_eq!(data["panels"][0]["layers"][1]["y"][500], Value::Null);
    }

    #[test]
    fn numbers_are_short() {
        let written = |v: f64| rounded(v, FIGURES).to_string();
        let short = [
            1.0,
            -0.1234567,
            12_345.678,
            1.23456e-7,
            6.02214e23,
            f64::NAN,
        ]
        .map(written);
        assert_eq!(
            short,
            ["1", "-0.12346", "12346", "1.2346e-7", "6.0221e+23", "null"]
        );
    }
}
