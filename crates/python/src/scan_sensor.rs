//! A sensor of the multi-target tracker: what it is like, and its detections of arrays as the tracker takes them.

use northing_core::tracking::{Detection, DetectionNoise, OwnShip, ScanSensor as CoreScanSensor};
use northing_evaluation::named;
use northing_evaluation::tracking::{SensorLooks, detection};
use northing_recording::tracking::Detection as Seen;
use numpy::PyReadonlyArrayDyn;
use pyo3::prelude::*;
use serde::{Deserialize, Serialize};

use crate::errors::refused;

/// Range of a sensor that has none, m, as in manifests.
const UNLIMITED_M: f64 = 1e7;

named! {
    /// What a row of detections is.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum Kind {
        /// Range (m) and bearing from the bow (rad).
        RangeBearing = "range-bearing",
        /// Bearing from the bow (rad).
        Bearing = "bearing",
        /// North and east of the own ship, m.
        Relative = "relative",
        /// North and east, m, placed with the own ship's pose.
        Placed = "placed",
        /// North and east that a target reports of itself, m.
        Reported = "reported",
    }
}

impl Kind {
    /// Numbers of a detection.
    const fn columns(self) -> usize {
        match self {
            Self::Bearing => 1,
            _ => 2,
        }
    }

    /// What a row is made of, in words.
    const fn row(self) -> &'static str {
        match self {
            Self::RangeBearing => "range in m, above 0, and bearing in rad",
            Self::Bearing => "bearing in rad",
            Self::Relative => "north and east of the own ship in m, not both 0",
            Self::Placed => "north and east in m, apart from the own ship",
            Self::Reported => "north and east in m",
        }
    }

    fn detection(self, row: [f64; 2], own: &OwnShip<f64>) -> Detection<f64> {
        let [first, second] = row;
        let seen = match self {
            Self::RangeBearing => Seen::RangeBearing {
                range_m: first,
                bearing_rad: second,
            },
            Self::Bearing => Seen::Bearing { bearing_rad: first },
            Self::Relative => Seen::Relative {
                north_m: first,
                east_m: second,
            },
            Self::Placed => Seen::Placed {
                north_m: first,
                east_m: second,
            },
            Self::Reported => {
                return Detection::Position {
                    north_m: first,
                    east_m: second,
                };
            }
        };
        detection(&seen, own)
    }
}

/// A sensor as it was stated.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Stated {
    detections: Kind,
    range_std: f64,
    bearing_std: f64,
    extent_std: f64,
    detection_probability: f64,
    clutter_per_km2: Option<f64>,
    clutter_per_rad: Option<f64>,
    largest_range: Option<f64>,
    typical_range: Option<f64>,
    scan_interval: Option<f64>,
    covers_all: bool,
    initiates: bool,
}

impl Stated {
    /// What cannot be, in words.
    fn problem(&self) -> Option<String> {
        for (name, unit, std) in [
            ("range_std", "m", self.range_std),
            ("bearing_std", "rad", self.bearing_std),
            ("extent_std", "m", self.extent_std),
        ] {
            if !(std >= 0.0 && std.is_finite()) {
                return Some(format!(
                    "{name}={std}: expected a standard deviation in {unit}, 0 or above"
                ));
            }
        }
        if self.bearing_std <= 0.0 && self.extent_std <= 0.0 {
            return Some(
                "the sensor has no noise; give bearing_std= (rad) or extent_std= (m) above 0"
                    .to_owned(),
            );
        }
        let probability = self.detection_probability;
        if !(probability > 0.0 && probability < 1.0) {
            return Some(format!(
                "detection_probability={probability}: expected above 0 and below 1, e.g. 0.9"
            ));
        }
        if self.clutter_per_km2.is_some() == self.clutter_per_rad.is_some() {
            return Some(
                "false detections a scan: give one of clutter_per_km2= and, for sensors of bearings, clutter_per_rad="
                    .to_owned(),
            );
        }
        for (name, unit, value) in [
            (
                "clutter_per_km2",
                "detections in a square kilometre",
                self.clutter_per_km2,
            ),
            (
                "clutter_per_rad",
                "detections in a radian",
                self.clutter_per_rad,
            ),
            ("largest_range", "m", self.largest_range),
            ("typical_range", "m", self.typical_range),
            ("scan_interval", "s", self.scan_interval),
        ] {
            if let Some(value) = value.filter(|value| !(*value > 0.0 && value.is_finite())) {
                return Some(format!("{name}={value}: expected {unit}, above 0"));
            }
        }
        None
    }

    fn sensor(&self) -> CoreScanSensor<f64> {
        let per_m2 = self.clutter_per_km2.map(|density| density * 1e-6);
        CoreScanSensor {
            noise: DetectionNoise {
                range_std_m: self.range_std,
                bearing_std_rad: self.bearing_std,
                extent_std_m: self.extent_std,
            },
            detection_probability: self.detection_probability,
            clutter_density: self.clutter_per_rad.or(per_m2).unwrap_or(0.0),
            largest_range_m: self.largest_range.unwrap_or(UNLIMITED_M),
            covers_all: self.covers_all,
            initiates: self.initiates,
        }
    }
}

/// What a sensor of the tracker is like, as in the manifest of a recording.
#[pyclass(frozen, module = "northing._northing", eq, from_py_object)]
#[derive(Clone, Copy, PartialEq)]
pub(crate) struct ScanSensor(Stated);

#[pymethods]
impl ScanSensor {
    #[new]
    #[pyo3(signature = (*, detection_probability, clutter_per_km2=None, clutter_per_rad=None, range_std=0.0, bearing_std=0.0,
        extent_std=0.0, largest_range=None, typical_range=None, scan_interval=None, covers_all=true, initiates=true,
        detections="range-bearing"))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments of Python")]
    fn new(
        detection_probability: f64,
        clutter_per_km2: Option<f64>,
        clutter_per_rad: Option<f64>,
        range_std: f64,
        bearing_std: f64,
        extent_std: f64,
        largest_range: Option<f64>,
        typical_range: Option<f64>,
        scan_interval: Option<f64>,
        covers_all: bool,
        initiates: bool,
        detections: &str,
    ) -> PyResult<Self> {
        let kind = Kind::named(detections).ok_or_else(|| {
            refused(format!(
                "detections=\"{detections}\": expected one of {}",
                Kind::names()
            ))
        })?;
        let stated = Stated {
            detections: kind,
            range_std,
            bearing_std,
            extent_std,
            detection_probability,
            clutter_per_km2,
            clutter_per_rad,
            largest_range,
            typical_range,
            scan_interval,
            covers_all,
            initiates,
        };
        match stated.problem() {
            Some(problem) => Err(refused(problem)),
            None => Ok(Self(stated)),
        }
    }

    fn __repr__(&self) -> String {
        let own = &self.0;
        let mut said = vec![
            format!("detections=\"{}\"", own.detections.name()),
            format!("detection_probability={}", own.detection_probability),
        ];
        for (name, value) in [
            ("range_std", Some(own.range_std)),
            ("bearing_std", Some(own.bearing_std)),
            ("extent_std", Some(own.extent_std)),
            ("clutter_per_km2", own.clutter_per_km2),
            ("clutter_per_rad", own.clutter_per_rad),
            ("largest_range", own.largest_range),
            ("typical_range", own.typical_range),
            ("scan_interval", own.scan_interval),
        ] {
            said.extend(value.map(|value| format!("{name}={value}")));
        }
        format!("ScanSensor({})", said.join(", "))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, (String,))> {
        let text = serde_json::to_string(&slf.get().0).map_err(|e| refused(e.to_string()))?;
        Ok((slf.get_type().getattr("_from_json")?, (text,)))
    }

    #[staticmethod]
    fn _from_json(text: &str) -> PyResult<Self> {
        let stated: Stated = serde_json::from_str(text).map_err(|e| refused(e.to_string()))?;
        match stated.problem() {
            Some(problem) => Err(refused(problem)),
            None => Ok(Self(stated)),
        }
    }
}

impl ScanSensor {
    pub(crate) fn sensor(&self) -> CoreScanSensor<f64> {
        self.0.sensor()
    }

    /// How it looks at a scene, from which the tracker's settings follow.
    pub(crate) fn looks(&self) -> SensorLooks {
        SensorLooks {
            sensor: self.sensor(),
            scan_interval_s: self.0.scan_interval,
            range_m: self.0.largest_range.or(self.0.typical_range),
        }
    }

    /// Rows of numbers as the tracker takes them.
    pub(crate) fn detections(
        &self,
        rows: Option<&Bound<'_, PyAny>>,
        own: &OwnShip<f64>,
    ) -> PyResult<Vec<Detection<f64>>> {
        let kind = self.0.detections;
        let rows = rows.map(|rows| numbers(rows, kind)).transpose()?;
        let rows = rows.unwrap_or_default();
        let seen: Vec<_> = rows.iter().map(|row| kind.detection(*row, own)).collect();
        let mut bad = seen.iter().zip(&rows).enumerate();
        let mut bad = bad.by_ref().filter(|(_, (seen, _))| !seen.is_valid());
        let Some((place, (_, row))) = bad.next() else {
            return Ok(seen);
        };
        let shown: Vec<String> = row[..kind.columns()].iter().map(f64::to_string).collect();
        let others = match bad.count() {
            0 => String::new(),
            more => format!(" (and {more} more rows like it)"),
        };
        Err(refused(format!(
            "detections: row {place} is ({}){others}; expected {}, finite and on Earth; leave such detections out",
            shown.join(", "),
            kind.row()
        )))
    }
}

/// Rows of one or two numbers of whatever numpy makes an array of.
fn numbers(rows: &Bound<'_, PyAny>, kind: Kind) -> PyResult<Vec<[f64; 2]>> {
    let columns = kind.columns();
    let shape = match columns {
        1 => "(N,)",
        _ => "(N, 2)",
    };
    let expected = format!("expected {}, shape {shape}, a row a detection", kind.row());
    let array = rows.py().import("numpy")?;
    let array = array.call_method1("asarray", (rows, "float64"));
    let array = array.ok().and_then(|array| {
        let array: PyReadonlyArrayDyn<'_, f64> = array.extract().ok()?;
        Some(array)
    });
    let array =
        array.ok_or_else(|| refused(format!("detections: not an array of numbers; {expected}")))?;
    let array = array.as_array();
    if array.is_empty() {
        return Ok(Vec::new());
    }
    match (array.shape(), columns) {
        ([_], 1) | ([_, 1], 1) => Ok(array.iter().map(|bearing| [*bearing, 0.0]).collect()),
        ([_, 2], 2) => {
            let rows = array.outer_iter();
            Ok(rows.map(|row| [row[[0]], row[[1]]]).collect())
        }
        (shape, _) => {
            let hint = match shape {
                [2, _] if columns == 2 => "; transpose it",
                _ => "",
            };
            let shape: Vec<String> = shape.iter().map(usize::to_string).collect();
            let comma = if shape.len() == 1 { "," } else { "" };
            Err(refused(format!(
                "detections: shape ({}{comma}); {expected}{hint}",
                shape.join(", ")
            )))
        }
    }
}
