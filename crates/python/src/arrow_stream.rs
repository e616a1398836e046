//! Columns as a table of Arrow, handed over by the PyCapsule interface: whoever reads Arrow takes it, without pyarrow.

use std::sync::Arc;

use arrow_array::ffi_stream::FFI_ArrowArrayStream;
use arrow_array::{
    Array, ArrayRef, Float64Array, Int64Array, RecordBatch, RecordBatchIterator, StringArray,
    UInt8Array,
};
use arrow_schema::{ArrowError, Field, Schema};
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use pyo3::types::{PyCapsule, PyDict};

use crate::errors::refused;

/// The name that the interface gives such a capsule.
const NAME: &std::ffi::CStr = c"arrow_array_stream";

/// A column of numbers or words; what is NaN is null, for nothing is known there.
#[derive(FromPyObject)]
enum Column<'py> {
    Float64(PyReadonlyArray1<'py, f64>),
    Int64(PyReadonlyArray1<'py, i64>),
    UInt8(PyReadonlyArray1<'py, u8>),
    Words(Vec<String>),
}

impl Column<'_> {
    fn into_arrow(self) -> ArrayRef {
        match self {
            Self::Float64(numbers) => {
                let known = |x: &f64| (!x.is_nan()).then_some(*x);
                let numbers = numbers.as_array();
                Arc::new(numbers.iter().map(known).collect::<Float64Array>())
            }
            Self::Int64(numbers) => Arc::new(Int64Array::from(numbers.as_array().to_vec())),
            Self::UInt8(numbers) => Arc::new(UInt8Array::from(numbers.as_array().to_vec())),
            Self::Words(words) => Arc::new(StringArray::from(words)),
        }
    }
}

/// Columns of one length by name, as a capsule with a stream of one batch.
///
/// # Errors
/// Columns of other kinds or of different lengths, as `ValueError`.
#[pyfunction]
pub(crate) fn arrow_stream<'py>(
    py: Python<'py>,
    columns: &Bound<'py, PyDict>,
) -> PyResult<Bound<'py, PyCapsule>> {
    let (mut fields, mut arrays) = (Vec::new(), Vec::new());
    for (name, column) in columns {
        let array = column.extract::<Column<'_>>()?.into_arrow();
        let may_be_null = array.data_type().is_floating();
        let name: String = name.extract()?;
        fields.push(Field::new(name, array.data_type().clone(), may_be_null));
        arrays.push(array);
    }
    let schema = Arc::new(Schema::new(fields));
    let batch = RecordBatch::try_new(Arc::clone(&schema), arrays);
    let batch = batch.map_err(|error: ArrowError| refused(error.to_string()))?;
    let reader = RecordBatchIterator::new([Ok(batch)], schema);
    PyCapsule::new_with_value(py, FFI_ArrowArrayStream::new(Box::new(reader)), NAME)
}
