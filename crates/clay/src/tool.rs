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
    /// An upright rod, as a flat end mill; the pose is the centre of its lower end.
    Cylinder(Cylinder),
    /// A loop of wire upright across x; the pose is the centre of its ring.
    Loop(WireLoop),
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

/// An upright rod with flat ends. Invariant: radius finite, above zero, at most half of [`MAX_TOOL_SIZE_M`]; height
/// finite, above zero, at most [`MAX_TOOL_SIZE_M`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cylinder {
    radius_m: f64,
    height_m: f64,
}

/// A sculptor's loop tool: a round wire bent into a ring, which stands in the plane across x.
///
/// What cuts and what is felt are two things. Clay is severed by the wire, and so the wire alone feels it. But a ribbon
/// that passes through the ring is severed all around, hangs on nothing and is taken away; a field that only ever loses
/// clay has no loose pieces to lay it down as. So the solid that removes is the whole disc that the ring encloses, as
/// thick as the wire. Moved edgewise the disc opens a slot of its thickness, as the wire's front does; set down, it
/// takes what stands within the ring.
///
/// Invariant: ring radius and wire diameter finite and above zero, the wire no thicker than the ring's radius, and the
/// whole at most [`MAX_TOOL_SIZE_M`] across.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WireLoop {
    ring_radius_m: f64,
    wire_diameter_m: f64,
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
    /// A loop's wire is thicker than the radius of its ring.
    #[error(
        "wire is {wire_diameter_m} m thick, its ring of radius {ring_radius_m} m takes no thicker than that"
    )]
    ThickWire {
        /// Diameter of the wire, m.
        wire_diameter_m: f64,
        /// From the ring's centre to the wire's, m.
        ring_radius_m: f64,
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
            Self::Cylinder(cylinder) => {
                let across_m = 2.0 * cylinder.radius_m;
                [across_m, across_m, cylinder.height_m]
            }
            Self::Loop(wire_loop) => {
                let across_m = 2.0 * wire_loop.disc_radius_m();
                [wire_loop.wire_diameter_m, across_m, across_m]
            }
        }
    }

    /// From the pose to the middle of the tool's bounding box, m.
    #[must_use]
    pub fn middle_from_pose_m(&self) -> [f64; 3] {
        match self {
            Self::Ball(_) | Self::Loop(_) => [0.0; 3],
            Self::Blade(blade) => [0.0, 0.0, 0.5 * blade.height_m],
            Self::Cylinder(cylinder) => [0.0, 0.0, 0.5 * cylinder.height_m],
        }
    }
}

impl Ball {
    /// A ball of this radius, m.
    ///
    /// # Errors
    /// When the radius is not finite, not above zero or above half of [`MAX_TOOL_SIZE_M`].
    pub fn new(radius_m: f64) -> Result<Self, ToolError> {
        check("radius", radius_m, 0.5 * MAX_TOOL_SIZE_M)?;
        Ok(Self { radius_m })
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
            check(dimension, got_m, MAX_TOOL_SIZE_M)?;
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

impl Cylinder {
    /// An upright rod of this radius and height, m.
    ///
    /// # Errors
    /// When the radius is not finite, not above zero or above half of [`MAX_TOOL_SIZE_M`], or the height likewise above
    /// all of it.
    pub fn new(radius_m: f64, height_m: f64) -> Result<Self, ToolError> {
        check("radius", radius_m, 0.5 * MAX_TOOL_SIZE_M)?;
        check("height", height_m, MAX_TOOL_SIZE_M)?;
        Ok(Self { radius_m, height_m })
    }

    /// Radius, m.
    #[must_use]
    pub const fn radius_m(&self) -> f64 {
        self.radius_m
    }

    /// Extent along z, upwards from the lower end, m.
    #[must_use]
    pub const fn height_m(&self) -> f64 {
        self.height_m
    }
}

impl WireLoop {
    /// A loop whose wire, of this diameter, runs at this distance from the ring's centre, m.
    ///
    /// # Errors
    /// When a length is not finite or not above zero, the wire is thicker than the ring's radius, or the whole is more
    /// than [`MAX_TOOL_SIZE_M`] across.
    pub fn new(ring_radius_m: f64, wire_diameter_m: f64) -> Result<Self, ToolError> {
        check("ring radius", ring_radius_m, 0.5 * MAX_TOOL_SIZE_M)?;
        check("wire diameter", wire_diameter_m, MAX_TOOL_SIZE_M)?;
        if ring_radius_m < wire_diameter_m {
            return Err(ToolError::ThickWire {
                wire_diameter_m,
                ring_radius_m,
            });
        }
        let wire_loop = Self {
            ring_radius_m,
            wire_diameter_m,
        };
        let across_m = 2.0 * wire_loop.disc_radius_m();
        check("extent", across_m, MAX_TOOL_SIZE_M)?;
        Ok(wire_loop)
    }

    /// From the ring's centre to the wire's, m.
    #[must_use]
    pub const fn ring_radius_m(&self) -> f64 {
        self.ring_radius_m
    }

    /// Diameter of the wire, which is also the thickness of the disc that removes, m.
    #[must_use]
    pub const fn wire_diameter_m(&self) -> f64 {
        self.wire_diameter_m
    }

    /// Radius of the disc that removes: from the ring's centre to the wire's outer side, m.
    #[must_use]
    pub fn disc_radius_m(&self) -> f64 {
        self.ring_radius_m + 0.5 * self.wire_diameter_m
    }
}

/// A dimension above zero and up to a bound.
fn check(dimension: &'static str, got_m: f64, most_m: f64) -> Result<(), ToolError> {
    if 0.0 < got_m && got_m <= most_m {
        return Ok(());
    }
    Err(ToolError::Dimension { dimension, got_m })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rods_and_loops_are_checked_and_measured() {
        assert!(matches!(
            Cylinder::new(0.51, 0.1),
            Err(ToolError::Dimension {
                dimension: "radius",
                ..
            })
        ));
        assert!(matches!(
            Cylinder::new(0.1, f64::NAN),
            Err(ToolError::Dimension {
                dimension: "height",
                ..
            })
        ));
        let rod = ToolShape::Cylinder(Cylinder::new(0.003, 0.02).unwrap());
        assert_eq!(rod.extents_m(), [0.006, 0.006, 0.02]);
        assert_eq!(rod.middle_from_pose_m(), [0.0, 0.0, 0.01]);
        assert_eq!(
            WireLoop::new(0.002, 0.003),
            Err(ToolError::ThickWire {
                wire_diameter_m: 0.003,
                ring_radius_m: 0.002
            })
        );
        for (ring_radius_m, wire_diameter_m, name) in [
            (f64::INFINITY, 0.1, "ring radius"),
            (0.1, 0.0, "wire diameter"),
            (0.4, 0.3, "extent"),
        ] {
            assert!(matches!(
                WireLoop::new(ring_radius_m, wire_diameter_m),
                Err(ToolError::Dimension { dimension, .. }) if dimension == name
            ));
        }
        let wire = ToolShape::Loop(WireLoop::new(0.008, 0.002).unwrap());
        let [thick_m, across_m, tall_m] = wire.extents_m();
        assert!(thick_m == 0.002 && (across_m - 0.018).abs() < 1e-15 && across_m == tall_m);
        assert_eq!(wire.middle_from_pose_m(), [0.0; 3]);
    }

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
