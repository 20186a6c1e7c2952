//! Three-vectors as plain arrays: few operations, each rounded alike everywhere.

pub(crate) type Vector = [f64; 3];

pub(crate) fn plus(a: Vector, b: Vector) -> Vector {
    std::array::from_fn(|axis| a[axis] + b[axis])
}

pub(crate) fn minus(a: Vector, b: Vector) -> Vector {
    std::array::from_fn(|axis| a[axis] - b[axis])
}

pub(crate) fn times(a: Vector, factor: f64) -> Vector {
    a.map(|part| part * factor)
}

pub(crate) fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn norm(a: Vector) -> f64 {
    dot(a, a).sqrt()
}

/// `a`, shortened to length `most` where it is longer; its direction is kept.
pub(crate) fn capped(a: Vector, most: f64) -> Vector {
    let length = norm(a);
    if length <= most {
        a
    } else {
        times(a, most / length)
    }
}

/// Whether every part is finite and at most `most` from zero.
pub(crate) fn is_within(a: Vector, most: f64) -> bool {
    // A NaN compares as false.
    a.iter().all(|part| part.abs() <= most)
}
