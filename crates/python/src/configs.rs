//! Parameters of the streaming estimators: the rows of core's tables by name.

use northing_core::attitude::bounded_velocity as core_bounded_velocity;
use northing_core::navigation::GnssInsConfig as CoreGnssInsConfig;
use northing_core::parameters::{Parameter, Range, Table, Value};
use pyo3::exceptions::{PyAttributeError, PyTypeError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::errors::refused;

/// The value of a parameter in Python.
fn to_python<'py>(py: Python<'py>, value: Value<f64>) -> PyResult<Bound<'py, PyAny>> {
    Ok(match value {
        Value::Number(number) => number.into_pyobject(py)?.into_any(),
        Value::Count(count) => count.into_pyobject(py)?.into_any(),
        Value::Flag(flag) => flag.into_pyobject(py)?.to_owned().into_any(),
        Value::Word(word) => word.into_pyobject(py)?.into_any(),
        Value::Vector(vector) => PyList::new(py, vector)?.into_any(),
        Value::Pair(pair) => PyList::new(py, pair)?.into_any(),
        Value::Absent => py.None().into_bound(py),
    })
}

/// A value of Python as this range takes it; `None`: it is of another kind.
fn of_python(value: &Bound<'_, PyAny>, range: &Range) -> Option<Value<f64>> {
    match range {
        Range::Count(_) => value.extract().ok().map(Value::Count),
        Range::Flag => value.extract().ok().map(Value::Flag),
        Range::Words(_) => range.read(&value.extract::<String>().ok()?),
        Range::Vector(_) => value.extract().ok().map(Value::Vector),
        Range::Pair(..) => value.extract().ok().map(Value::Pair),
        Range::Optional(_) if value.is_none() => Some(Value::Absent),
        Range::Optional(range) => of_python(value, range),
        Range::From(..) | Range::Above(..) => value.extract().ok().map(Value::Number),
        Range::Described(_) => None,
    }
}

/// The row of a name; in Python `validity_invalid_after_s` is `validity.invalid_after_s`.
fn row<C: Table>(name: &str) -> Option<&'static Parameter> {
    let is_meant = |row: &&Parameter| row.name == name || attribute(row) == name;
    C::PARAMETERS.iter().find(is_meant)
}

/// The name of a row as one of Python.
fn attribute(row: &Parameter) -> String {
    row.name.replace('.', "_")
}

fn get<'py, C: Table<Number = f64>>(
    config: &C,
    py: Python<'py>,
    name: &str,
) -> PyResult<Bound<'py, PyAny>> {
    let value = row::<C>(name).and_then(|row| config.parameter(row.name));
    let value = value.ok_or_else(|| PyAttributeError::new_err(unknown::<C>(name)))?;
    to_python(py, value)
}

fn set<C: Table<Number = f64>>(
    config: &mut C,
    name: &str,
    value: &Bound<'_, PyAny>,
) -> PyResult<()> {
    let row = row::<C>(name).ok_or_else(|| PyAttributeError::new_err(unknown::<C>(name)))?;
    let said = || value.to_string();
    let of_range = of_python(value, &row.range).ok_or_else(|| {
        PyTypeError::new_err(format!("{name}={}: expected {}", said(), row.range))
    })?;
    let set = config.set_parameter(row.name, of_range);
    set.map_err(|error| refused(format!("{name}={}: expected {}", said(), error.range)))
}

fn unknown<C: Table>(name: &str) -> String {
    let names: Vec<String> = C::PARAMETERS.iter().map(attribute).collect();
    format!("no parameter `{name}`; there are {}", names.join(", "))
}

fn profile<C: Table<Number = f64> + Copy>(
    name: &str,
    changes: Option<&Bound<'_, PyDict>>,
) -> PyResult<C> {
    let found = C::PROFILES.iter().find(|(known, _)| *known == name);
    let mut config = found.map(|(_, make)| make()).ok_or_else(|| {
        let names: Vec<&str> = C::PROFILES.iter().map(|(name, _)| *name).collect();
        refused(format!(
            "no profile \"{name}\"; there are {}",
            names.join(", ")
        ))
    })?;
    for (name, value) in changes.into_iter().flatten() {
        set(&mut config, &name.extract::<String>()?, &value)?;
    }
    Ok(config)
}

/// A class of parameters.
macro_rules! config {
    ($(#[$meaning:meta])* $name:ident: $inner:ty, [$first:ident $($profile:ident)*]) => {
        $(#[$meaning])*
        #[pyclass(module = "northing._northing", eq, from_py_object)]
        #[derive(Clone, Default, PartialEq)]
        pub(crate) struct $name(pub(crate) $inner);

        #[pymethods]
        impl $name {
            #[new]
            #[pyo3(signature = (profile=stringify!($first), **changes))]
            fn new(profile: &str, changes: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
                self::profile(profile, changes).map(Self)
            }

            #[staticmethod]
            #[pyo3(signature = (**changes))]
            fn $first(changes: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
                Self::new(stringify!($first), changes)
            }

            $(
                #[staticmethod]
                #[pyo3(signature = (**changes))]
                fn $profile(changes: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
                    Self::new(stringify!($profile), changes)
                }
            )*

            /// Every parameter with its value.
            fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
                let dict = PyDict::new(py);
                for row in <$inner as Table>::PARAMETERS {
                    dict.set_item(attribute(row), get(&self.0, py, row.name)?)?;
                }
                Ok(dict)
            }

            fn __getattr__<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
                get(&self.0, py, name)
            }

            fn __setattr__(&mut self, name: &str, value: &Bound<'_, PyAny>) -> PyResult<()> {
                set(&mut self.0, name, value)
            }

            fn __dir__(&self) -> Vec<String> {
                let rows = <$inner as Table>::PARAMETERS.iter().map(attribute);
                let methods = ["to_dict", stringify!($first) $(, stringify!($profile))*];
                rows.chain(methods.map(str::to_owned)).collect()
            }

            fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
                let values = self.to_dict(py)?;
                let mut said = Vec::new();
                for (name, value) in values {
                    said.push(format!("{name}={}", value.repr()?));
                }
                Ok(format!(concat!(stringify!($name), "({})"), said.join(", ")))
            }

            fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, (String,))> {
                let text = serde_json::to_string(&slf.borrow().0).map_err(|e| refused(e.to_string()))?;
                Ok((slf.get_type().getattr("_from_json")?, (text,)))
            }

            #[staticmethod]
            fn _from_json(text: &str) -> PyResult<Self> {
                serde_json::from_str(text).map(Self).map_err(|e| refused(e.to_string()))
            }
        }
    };
}
config! {
    /// Parameters of the bounded-velocity filter.
    BoundedVelocityConfig: core_bounded_velocity::BoundedVelocityConfig<f64>, [hand_held lab]
}
config! {
    /// Parameters that the other attitude filters share.
    AttitudeConfig: northing_core::attitude::AttitudeConfig<f64>, [hand_held lab]
}
config! {
    /// Parameters of the GNSS/INS.
    GnssInsConfig: CoreGnssInsConfig<f64>, [default]
}
