//! Drawing: figures, axes, maps and their SVG text, in the colours of both themes.

pub(crate) mod axis;
pub(crate) mod curves;
#[cfg(any(test, feature = "interactive"))]
pub(crate) mod data;
pub(crate) mod fate;
pub(crate) mod map;
pub(crate) mod plot;
pub(crate) mod residuals;
pub(crate) mod rows;
pub(crate) mod series;
pub(crate) mod style;
pub(crate) mod svg;
