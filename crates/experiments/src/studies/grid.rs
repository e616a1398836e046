//! The points of a study: a grid of parameter values, or a seeded Latin hypercube.
//!
//! A Latin hypercube of n samples cuts the span of each parameter into n strata of equal width (on its scale) and takes one
//! sample of each (McKay, Beckman & Conover 1979). Its places come from a random stream with the name of the parameter, so another
//! parameter leaves them as they were.

use northing_simulation::random::{Stream, stream};
use rand::Rng as _;
use serde::{Deserialize, Serialize};
use serde_json::Value as Json;

/// How values lie between the ends of a span.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scale {
    /// Equal differences: the default.
    #[default]
    Linear,
    /// Equal ratios; both ends are above zero.
    Log,
}

/// A span of values.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Span {
    /// The first value, in the unit of the parameter.
    pub from: f64,
    /// The last.
    pub to: f64,
    /// How values lie between them.
    #[serde(default)]
    pub scale: Scale,
}

impl Span {
    /// Why it is none, if so.
    pub(super) fn problem(&self) -> Option<&'static str> {
        if !(self.from.is_finite() && self.to.is_finite()) {
            return Some("`from` and `to` are finite numbers");
        }
        if self.from >= self.to {
            return Some("`from` is below `to`");
        }
        (self.scale == Scale::Log && self.from <= 0.0)
            .then_some("both ends of a log scale are above zero")
    }

    /// The value at a share of the span, 0 to 1; the ends are exact.
    #[must_use]
    pub fn at(&self, share: f64) -> f64 {
        if share <= 0.0 {
            return self.from;
        }
        if share >= 1.0 {
            return self.to;
        }
        match self.scale {
            Scale::Linear => self.from + (self.to - self.from) * share,
            // Of a library that is the same on every machine.
            Scale::Log => self.from * libm::pow(self.to / self.from, share),
        }
    }
}

/// The values of one parameter in a grid.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Levels {
    /// These.
    List(Vec<Json>),
    /// So many over a span, its ends among them.
    Steps(Span, u64),
}

impl Levels {
    /// How many.
    #[must_use]
    pub fn count(&self) -> u64 {
        match self {
            Self::List(values) => values.len() as u64,
            Self::Steps(_, steps) => *steps,
        }
    }

    /// One of them.
    #[must_use]
    pub fn value(&self, level: u64) -> Json {
        match self {
            Self::List(values) => values.get(level as usize).cloned().unwrap_or(Json::Null),
            Self::Steps(span, steps) => {
                number(span.at(level as f64 / steps.saturating_sub(1).max(1) as f64))
            }
        }
    }
}

/// A parameter and something about its values.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Axis<V> {
    /// Name of the parameter.
    pub parameter: String,
    /// Its values.
    pub values: V,
}

/// Which points there are.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Design {
    /// Every value of each parameter with every value of the others; one point without any. The last parameter changes fastest.
    Grid(Vec<Axis<Levels>>),
    /// A Latin hypercube.
    LatinHypercube {
        /// How many points.
        samples: u64,
        /// Seed of their places.
        seed: u64,
        /// The parameters.
        axes: Vec<Axis<Span>>,
    },
}

impl Design {
    /// How many points; as large a number as there is where even that is too small.
    #[must_use]
    pub fn points(&self) -> u128 {
        match self {
            Self::Grid(axes) => axes.iter().fold(1, |product: u128, axis| {
                product.saturating_mul(u128::from(axis.values.count()))
            }),
            Self::LatinHypercube { samples, .. } => u128::from(*samples),
        }
    }

    /// The parameters that are varied.
    #[must_use]
    pub fn parameters(&self) -> Vec<&str> {
        match self {
            Self::Grid(axes) => axes.iter().map(|axis| axis.parameter.as_str()).collect(),
            Self::LatinHypercube { axes, .. } => {
                axes.iter().map(|axis| axis.parameter.as_str()).collect()
            }
        }
    }

    /// Whether all values of each parameter are numbers.
    #[must_use]
    pub fn are_numbers(&self) -> Vec<bool> {
        let extremes = self.extremes().into_iter();
        extremes
            .map(|(_, values)| values.iter().all(Json::is_number))
            .collect()
    }

    /// The values of each parameter that say whether all of them are permitted: each of a list, the ends of a span.
    pub(super) fn extremes(&self) -> Vec<(&str, Vec<Json>)> {
        let ends = |span: &Span| vec![number(span.from), number(span.to)];
        match self {
            Self::Grid(axes) => axes
                .iter()
                .map(|axis| {
                    let values = match &axis.values {
                        Levels::List(values) => values.clone(),
                        Levels::Steps(span, _) => ends(span),
                    };
                    (axis.parameter.as_str(), values)
                })
                .collect(),
            Self::LatinHypercube { axes, .. } => axes
                .iter()
                .map(|axis| (axis.parameter.as_str(), ends(&axis.values)))
                .collect(),
        }
    }
}

/// A number as settings and files have it: whole ones without a point.
pub(super) fn number(value: f64) -> Json {
    const EXACT: f64 = 9_007_199_254_740_992.0;
    if value.fract() == 0.0 && value.abs() < EXACT {
        return Json::from(value as i64);
    }
    Json::from(value)
}

/// A design whose points can be asked for.
#[derive(Debug, Clone)]
pub struct Points {
    design: Design,
    /// Of a Latin hypercube: the share of the span of each parameter at each sample.
    shares: Vec<Vec<f64>>,
}

impl Points {
    /// Those of a design.
    #[must_use]
    pub fn of(design: &Design) -> Self {
        let shares = match design {
            Design::Grid(_) => Vec::new(),
            Design::LatinHypercube {
                samples,
                seed,
                axes,
            } => {
                let of = |axis: &Axis<Span>| strata(*samples, stream(*seed, &axis.parameter));
                axes.iter().map(of).collect()
            }
        };
        Self {
            design: design.clone(),
            shares,
        }
    }

    /// Which level of each parameter a point of a grid has; empty for a Latin hypercube, which has none.
    #[must_use]
    pub fn levels(&self, point: u64) -> Vec<u64> {
        let Design::Grid(axes) = &self.design else {
            return Vec::new();
        };
        let mut rest = point;
        let mut levels: Vec<u64> = axes
            .iter()
            .rev()
            .map(|axis| {
                let count = axis.values.count().max(1);
                let level = rest % count;
                rest /= count;
                level
            })
            .collect();
        levels.reverse();
        levels
    }

    /// The value of each parameter at a point, in the order of [`Design::parameters`].
    #[must_use]
    pub fn values(&self, point: u64) -> Vec<Json> {
        match &self.design {
            Design::Grid(axes) => {
                let levels = self.levels(point);
                let each = axes.iter().zip(levels);
                each.map(|(axis, level)| axis.values.value(level)).collect()
            }
            Design::LatinHypercube { axes, .. } => {
                let each = axes.iter().zip(&self.shares);
                let share = |shares: &Vec<f64>| shares.get(point as usize).copied();
                each.map(|(axis, shares)| number(axis.values.at(share(shares).unwrap_or(0.0))))
                    .collect()
            }
        }
    }
}

/// One place in each of so many equal strata of 0 to 1, in a random order.
fn strata(samples: u64, mut draws: Stream) -> Vec<f64> {
    let mut order: Vec<u64> = (0..samples).collect();
    // Fisher and Yates; the multiplication takes a random word to 0..=k.
    for k in (1..order.len()).rev() {
        let other = (u128::from(draws.next_u64()) * (k as u128 + 1)) >> 64;
        order.swap(k, other as usize);
    }
    let mut place = |stratum: u64| {
        let within = (draws.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
        (stratum as f64 + within) / samples as f64
    };
    order.into_iter().map(&mut place).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn steps(parameter: &str, from: f64, to: f64, steps: u64, scale: Scale) -> Axis<Levels> {
        Axis {
            parameter: parameter.to_owned(),
            values: Levels::Steps(Span { from, to, scale }, steps),
        }
    }

    #[test]
    fn a_grid_is_every_value_with_every_other_the_last_fastest() {
        let list = Axis {
            parameter: "use".to_owned(),
            values: Levels::List(vec![Json::from("a"), Json::from("b")]),
        };
        let design = Design::Grid(vec![list, steps("gain", 0.01, 1.0, 3, Scale::Log)]);
        assert_eq!(design.points(), 6);
        let points = Points::of(&design);
        assert_eq!(points.levels(4), [1, 1]);
        let values = points.values(4);
        assert_eq!(values[0], "b");
        assert!((values[1].as_f64().unwrap() - 0.1).abs() < 1e-12);
        // The ends are exact, and whole numbers stay whole.
        assert_eq!(points.values(3)[1], Json::from(0.01));
        assert_eq!(points.values(5)[1], Json::from(1));
        assert_eq!(
            Points::of(&Design::Grid(Vec::new())).values(0),
            [Json::Null; 0]
        );
    }

    #[test]
    fn a_grid_beyond_counting_is_counted_as_far_as_numbers_go() {
        let axis = || steps("gain", 0.0, 1.0, u64::MAX, Scale::Linear);
        assert_eq!(
            Design::Grid(vec![axis(), axis(), axis()]).points(),
            u128::MAX
        );
    }

    #[test]
    fn a_latin_hypercube_has_one_sample_in_each_stratum_of_each_parameter() {
        let span = |parameter: &str, from, to, scale| Axis {
            parameter: parameter.to_owned(),
            values: Span { from, to, scale },
        };
        let axes = vec![
            span("a", 2.0, 4.0, Scale::Linear),
            span("b", 1e-3, 10.0, Scale::Log),
        ];
        let of = |seed, axes: &[_]| {
            Points::of(&Design::LatinHypercube {
                samples: 50,
                seed,
                axes: axes.to_vec(),
            })
        };
        let column = |points: &Points, axis: usize| -> Vec<f64> {
            let value = |point| points.values(point)[axis].as_f64().unwrap();
            (0..50).map(value).collect()
        };
        let points = of(7, &axes);
        let strata = |values: Vec<f64>, share: &dyn Fn(f64) -> f64| {
            let mut strata: Vec<usize> = values
                .iter()
                .map(|value| (share(*value) * 50.0) as usize)
                .collect();
            assert!(!strata.is_sorted());
            strata.sort_unstable();
            assert_eq!(strata, (0..50).collect::<Vec<_>>());
        };
        strata(column(&points, 0), &|a| (a - 2.0) / 2.0);
        strata(column(&points, 1), &|b| (b / 1e-3).ln() / 1e4_f64.ln());
        // The same seed gives the same, another one another, and a parameter's places are its own.
        assert_eq!(column(&of(7, &axes), 0), column(&points, 0));
        assert_ne!(column(&of(8, &axes), 0), column(&points, 0));
        assert_eq!(column(&of(7, &axes[1..]), 0), column(&points, 1));
    }
}
