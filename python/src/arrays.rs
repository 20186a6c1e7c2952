//! Numpy's arrays as numbers of Rust, and back. All of them are flat here; shapes are the business of the Python
//! around.

use std::fmt::Display;

use numpy::{Element, PyArray1, PyReadonlyArray1};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// A flat array that Python has made.
pub(crate) type Flat<'py> = PyReadonlyArray1<'py, f64>;

/// A flat array for Python.
pub(crate) type Made<'py, T> = Bound<'py, PyArray1<T>>;

/// An error in the words of whoever found it.
pub(crate) fn refused(error: impl Display) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// A copy of the numbers, so that nobody changes them while Python's lock is let go of.
pub(crate) fn numbers(array: &Flat<'_>) -> PyResult<Vec<f64>> {
    Ok(array.as_slice().map_err(refused)?.to_vec())
}

/// The same as rows of `N`.
pub(crate) fn rows<const N: usize>(array: &Flat<'_>) -> PyResult<Vec<[f64; N]>> {
    let numbers = array.as_slice().map_err(refused)?;
    let (rows, rest) = numbers.as_chunks::<N>();
    if !rest.is_empty() {
        return Err(refused(format!(
            "{} numbers make no rows of {N}",
            numbers.len()
        )));
    }
    Ok(rows.to_vec())
}

/// For Python.
pub(crate) fn array<T: Element>(py: Python<'_>, numbers: Vec<T>) -> Made<'_, T> {
    PyArray1::from_vec(py, numbers)
}

/// Which of many points an error is about, where there are many.
pub(crate) fn at(what: &str, number: usize, of: usize, error: impl Display) -> PyErr {
    if of == 1 {
        refused(error)
    } else {
        refused(format!("{what}[{number}]: {error}"))
    }
}
