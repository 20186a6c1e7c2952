//! Tool shapes, parsed once: afterwards their sizes are known to be finite and above zero.

use thiserror::Error;

/// Largest tool dimension, m.
pub const MAX_TOOL_SIZE_M: f64 = 1.0;

/// The solid that cuts. Its faces stay parallel to the axes of the clay frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ToolShape {
    /// A ball; the pose is its centre.
    Ball(Ball),
    /// An upright flat blade; the pose is the centre of its lower edge.
    Blade(Blade),
}

/// A ball. Invariant: radius finite, above zero, at most half of [`MAX_TOOL_SIZE_M`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    radius_m: f64,
}

/// An upright plate. Invariant: every dimension finite, above zero, at most [`MAX_TOOL_SIZE_M`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blade {
    width_m: f64,
    height_m: f64,
    thickness_m: f64,
}

/// A tool that cannot be, or cannot cut a given grid.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum ToolError {
    /// A dimension is not finite, not above zero, or too large.
    #[error("tool {dimension} is {got_m} m, wanted above 0 to {MAX_TOOL_SIZE_M} m")]
    Dimension {
        /// Which dimension.
        dimension: &'static str,
        /// Its value as it came, m.
        got_m: f64,
    },
    /// The tool is thinner than two voxels, so it would pass through clay and leave part of it standing.
    #[error("tool is {got_m} m across at its thinnest, this clay needs {need_m} m")]
    TooThin {
        /// Least extent of the tool, m.
        got_m: f64,
        /// Two voxels, m.
        need_m: f64,
    },
}

impl ToolShape {
    /// A ball of this radius, m.
    ///
    /// # Errors
    /// When the radius is not finite, not above zero or above half of [`MAX_TOOL_SIZE_M`].
    pub fn ball(radius_m: f64) -> Result<Self, ToolError> {
        Ball::new(radius_m).map(Self::Ball)
    }

    /// The blade of the published cutting experiment \[KHMH03\]: 10 mm wide, 40 mm tall, 2 mm thick, cutting along x.
    #[must_use]
    pub const fn paper_blade() -> Self {
        Self::Blade(Blade {
            width_m: 0.010,
            height_m: 0.040,
            thickness_m: 0.002,
        })
    }

    /// Extents of the tool along x, y, z, m.
    #[must_use]
    pub fn extents_m(&self) -> [f64; 3] {
        match self {
            Self::Ball(ball) => [2.0 * ball.radius_m; 3],
            Self::Blade(blade) => [blade.thickness_m, blade.width_m, blade.height_m],
        }
    }

    /// From the pose to the middle of the tool's bounding box, m.
    #[must_use]
    pub fn middle_from_pose_m(&self) -> [f64; 3] {
        match self {
            Self::Ball(_) => [0.0; 3],
            Self::Blade(blade) => [0.0, 0.0, 0.5 * blade.height_m],
        }
    }
}

impl Ball {
    /// A ball of this radius, m.
    ///
    /// # Errors
    /// When the radius is not finite, not above zero or above half of [`MAX_TOOL_SIZE_M`].
    pub fn new(radius_m: f64) -> Result<Self, ToolError> {
        if 0.0 < radius_m && radius_m <= 0.5 * MAX_TOOL_SIZE_M {
            return Ok(Self { radius_m });
        }
        Err(ToolError::Dimension {
            dimension: "radius",
            got_m: radius_m,
        })
    }

    /// Radius, m.
    #[must_use]
    pub const fn radius_m(&self) -> f64 {
        self.radius_m
    }
}

/// The dimensions of a [`Blade`], before they are checked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BladeDimensions {
    /// Extent along y, m.
    pub width_m: f64,
    /// Extent along z, upwards from the lower edge, m.
    pub height_m: f64,
    /// Extent along x, m.
    pub thickness_m: f64,
}

impl Blade {
    /// A blade of these dimensions.
    ///
    /// # Errors
    /// When a dimension is not finite, not above zero or above [`MAX_TOOL_SIZE_M`].
    pub fn new(dimensions: BladeDimensions) -> Result<Self, ToolError> {
        let BladeDimensions {
            width_m,
            height_m,
            thickness_m,
        } = dimensions;
        for (dimension, got_m) in [
            ("width", width_m),
            ("height", height_m),
            ("thickness", thickness_m),
        ] {
            let valid = 0.0 < got_m && got_m <= MAX_TOOL_SIZE_M;
            if !valid {
                return Err(ToolError::Dimension { dimension, got_m });
            }
        }
        Ok(Self {
            width_m,
            height_m,
            thickness_m,
        })
    }

    /// Extent along y, m.
    #[must_use]
    pub const fn width_m(&self) -> f64 {
        self.width_m
    }

    /// Extent along z, m.
    #[must_use]
    pub const fn height_m(&self) -> f64 {
        self.height_m
    }

    /// Extent along x, m.
    #[must_use]
    pub const fn thickness_m(&self) -> f64 {
        self.thickness_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tools_without_a_size_are_refused() {
        for radius_m in [0.0, -1e-3, f64::NAN, f64::INFINITY, 0.51] {
            assert!(matches!(
                ToolShape::ball(radius_m),
                Err(ToolError::Dimension {
                    dimension: "radius",
                    ..
                })
            ));
        }
        let sound = BladeDimensions {
            width_m: 0.01,
            height_m: 0.04,
            thickness_m: 0.002,
        };
        assert!(Blade::new(sound).is_ok());
        for (broken, name) in [
            (
                BladeDimensions {
                    width_m: f64::NAN,
                    ..sound
                },
                "width",
            ),
            (
                BladeDimensions {
                    height_m: 0.0,
                    ..sound
                },
                "height",
            ),
            (
                BladeDimensions {
                    thickness_m: -1.0,
                    ..sound
                },
                "thickness",
            ),
        ] {
            assert!(matches!(
                Blade::new(broken),
                Err(ToolError::Dimension { dimension, .. }) if dimension == name
            ));
        }
    }

    #[test]
    fn the_blade_stands_on_its_pose() {
        let blade = ToolShape::paper_blade();
        let [thickness_m, width_m, height_m] = blade.extents_m();
        assert!(thickness_m < width_m && width_m < height_m);
        let [x_m, y_m, z_m] = blade.middle_from_pose_m();
        let feet_m = [x_m, y_m, z_m - 0.5 * height_m];
        assert!(feet_m.iter().all(|at_m| at_m.abs() < 1e-15));
    }
}
