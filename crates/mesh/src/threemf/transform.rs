//! How an object is moved where it is placed.

/// `(x, y, z, 1)` times this matrix of four rows: three for the axes, one for the origin.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Transform([[f64; 3]; 4]);

impl Transform {
    pub(super) const NONE: Self = Self([
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
        [0.0, 0.0, 0.0],
    ]);

    /// Twelve numbers, row by row.
    pub(super) fn parse(text: &str) -> Result<Self, &'static str> {
        let mut rows = [[0.0; 3]; 4];
        let mut words = text.split_ascii_whitespace();
        for number in rows.iter_mut().flatten() {
            let parsed = words.next().and_then(|word| word.parse::<f64>().ok());
            let finite = parsed.filter(|number| number.is_finite());
            *number = finite.ok_or("a transform is not twelve numbers")?;
        }
        if words.next().is_some() {
            return Err("a transform is not twelve numbers");
        }
        let transform = Self(rows);
        // Zero is not normal, and neither is what no longer is a number.
        if !transform.determinant().is_normal() {
            return Err("a transform flattens what it moves");
        }
        Ok(transform)
    }

    pub(super) fn apply(&self, at: [f64; 3]) -> [f64; 3] {
        let [x, y, z, origin] = self.0;
        [0, 1, 2].map(|axis| at[0] * x[axis] + at[1] * y[axis] + at[2] * z[axis] + origin[axis])
    }

    /// This, and another one after it.
    pub(super) fn then(&self, outer: &Self) -> Self {
        let [x, y, z, origin] = self.0;
        let turned = |row| {
            let moved = outer.apply(row);
            [0, 1, 2].map(|axis| moved[axis] - outer.0[3][axis])
        };
        Self([turned(x), turned(y), turned(z), outer.apply(origin)])
    }

    pub(super) fn determinant(&self) -> f64 {
        let [x, y, z, _] = self.0;
        x[0] * (y[1] * z[2] - y[2] * z[1])
            + x[1] * (y[2] * z[0] - y[0] * z[2])
            + x[2] * (y[0] * z[1] - y[1] * z[0])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_after_the_other_is_both() {
        let first = Transform::parse("1 2 3 0 1 4 5 6 1 7 8 9").unwrap();
        let second = Transform::parse("0 1 0 -1 0 0 0 0 2 3 -2 1").unwrap();
        let both = first.then(&second);
        for at in [[0.0; 3], [1.0, 2.0, 3.0], [-4.0, 0.5, 8.0]] {
            let (got, wanted) = (both.apply(at), second.apply(first.apply(at)));
            assert!((0..3).all(|axis| (got[axis] - wanted[axis]).abs() < 1e-12));
        }
        assert!((both.determinant() - first.determinant() * second.determinant()).abs() < 1e-9);
        assert_eq!(first.then(&Transform::NONE), first);
    }
}
