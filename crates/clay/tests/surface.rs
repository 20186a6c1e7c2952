//! The surface is closed whatever was cut, and encloses the volume that is left.

mod solid;

use proptest::prelude::*;
use solid::{Noise, Solid, at, clay_of};
use teleclay_clay::{Clay, Mesh, SOLID, Shape, SteppedBlock, Sweep, ToolShape, stl};

/// Error of the enclosed volume of the clay's surface, as a share of what is left.
fn volume_error(clay: &Clay) -> f64 {
    let solid = Solid::of(clay).unwrap_or_else(|error| panic!("{error}"));
    solid.volume_m3 / clay.remaining_volume_m3() - 1.0
}

#[test]
fn a_fresh_block_has_its_faces_where_they_should_be() {
    let clay = Clay::new(&Shape::default(), 1e-3).unwrap();
    let mesh = Mesh::of(&clay);
    Solid::of_mesh(&mesh).unwrap();
    for (axis, size_m) in [0.128, 0.064, 0.064].into_iter().enumerate() {
        let along = || mesh.positions_m.iter().map(|at_m| f64::from(at_m[axis]));
        assert!(along().fold(f64::INFINITY, f64::min).abs() < 1e-6);
        assert!((along().fold(0.0, f64::max) - size_m).abs() < 1e-6);
    }
    // Edges and corners of a block of whole voxels are sharp.
    assert!((mesh.volume_m3() / (0.128 * 0.064 * 0.064) - 1.0).abs() < 1e-6);
}

#[test]
fn cut_blocks_enclose_what_is_left() {
    let mut clay = Clay::new(&Shape::default(), 1e-3).unwrap();
    let ball = ToolShape::ball(0.0064).unwrap();
    for (from, to) in [
        ([0.0, 0.03, 0.064], [0.128, 0.035, 0.06]),
        ([0.064, -0.01, 0.03], [0.07, 0.08, 0.031]),
        ([0.1, 0.03, 0.03], [0.1, 0.03, 0.03]),
    ] {
        clay.carve(&Sweep {
            shape: ball,
            from: at(from),
            to: at(to),
        });
        assert!(volume_error(&clay).abs() < 2e-3);
    }
    let mut clay = Clay::new(&Shape::Stepped(SteppedBlock::paper()), 1e-3).unwrap();
    let blade = ToolShape::paper_blade();
    clay.carve(&Sweep {
        shape: blade,
        from: at([0.0, 0.032, 0.01]),
        to: at([0.11, 0.032, 0.01]),
    });
    assert!(volume_error(&clay).abs() < 2e-3);
}

#[test]
fn a_cavity_is_closed_and_faces_inwards() {
    let mut clay = Clay::new(&Shape::Block { size_m: [0.064; 3] }, 1e-3).unwrap();
    let radius_m = 0.010;
    let centre = at([0.032; 3]);
    clay.carve(&Sweep {
        shape: ToolShape::ball(radius_m).unwrap(),
        from: centre,
        to: centre,
    });
    let mut parts_m3 = Solid::of(&clay).unwrap().parts_m3;
    parts_m3.sort_by(f64::total_cmp);
    let [cavity_m3, outside_m3] = parts_m3[..] else {
        panic!("{parts_m3:?}");
    };
    let ball_m3 = 4.0 / 3.0 * std::f64::consts::PI * radius_m.powi(3);
    assert!((-cavity_m3 / ball_m3 - 1.0).abs() < 0.02);
    assert!((outside_m3 / 0.064_f64.powi(3) - 1.0).abs() < 1e-3);
}

/// A ball's cut is where the ball was, to a tenth of a voxel, wherever its centre lies in a voxel.
#[test]
fn a_balls_cut_is_where_the_ball_was() {
    let radius_m = 0.0064;
    let shape = ToolShape::ball(radius_m).unwrap();
    let mut noise = Noise(3);
    for voxel_m in [5e-4, 1e-3, 2e-3] {
        for _ in 0..6 {
            let mut clay = Clay::new(&Shape::Block { size_m: [0.032; 3] }, voxel_m).unwrap();
            let centre_m = [0; 3].map(|_| 0.016 + noise.between(-0.5, 0.5) * voxel_m);
            let (from, to) = (at(centre_m), at(centre_m));
            clay.carve(&Sweep { shape, from, to });
            let distances = Mesh::of(&clay).positions_m.into_iter().map(|place_m| {
                let squares =
                    (0..3).map(|axis| (f64::from(place_m[axis]) - centre_m[axis]).powi(2));
                squares.sum::<f64>().sqrt()
            });
            // The faces of the block are farther away.
            let cut: Vec<_> = distances.filter(|&distance_m| distance_m < 0.012).collect();
            assert!(100 < cut.len());
            for distance_m in cut {
                let voxels = (distance_m - radius_m) / voxel_m;
                assert!(voxels.abs() < 0.15, "{voxels} voxels of {voxel_m} m");
            }
        }
    }
}

/// A plane across voxels is where it is: a block that ends within a voxel ends there on screen and on paper.
#[test]
fn a_face_within_a_voxel_is_where_it_is() {
    for tenth in 0..10 {
        let height_m = 0.020 + 1e-4 * f64::from(tenth);
        let size_m = [0.064, 0.064, height_m];
        let clay = Clay::new(&Shape::Block { size_m }, 1e-3).unwrap();
        let mesh = Mesh::of(&clay);
        let top_m = mesh.positions_m.iter().map(|place_m| f64::from(place_m[2]));
        let error_m = top_m.fold(0.0, f64::max) - height_m;
        assert!(error_m.abs() < 1e-5, "{tenth} tenths: {error_m} m");
    }
}

#[test]
fn nothing_left_has_no_surface() {
    let mut clay = Clay::new(&Shape::Block { size_m: [0.02; 3] }, 1e-3).unwrap();
    let all = ToolShape::ball(0.1).unwrap();
    clay.carve(&Sweep {
        shape: all,
        from: at([0.01; 3]),
        to: at([0.01; 3]),
    });
    assert_eq!(Mesh::of(&clay), Mesh::default());
}

#[test]
fn the_stl_of_a_cut_block_has_every_triangle() {
    let clay = Clay::new(&Shape::Block { size_m: [0.02; 3] }, 1e-3).unwrap();
    let mesh = Mesh::of(&clay);
    assert_eq!(stl::encode(&mesh).len(), 84 + 50 * mesh.triangles.len());
}

/// The parts of all bricks make the whole, whatever noise there is along their seams.
#[test]
fn the_parts_of_bricks_meet() {
    let mut noise = Noise(4);
    for _ in 0..8 {
        let clay = clay_of([33, 20, 17], 1e-3, |_| match noise.word() % 4 {
            0 => noise.word() as u8,
            1 => 0,
            _ => SOLID,
        });
        let mut all = Mesh::default();
        for dense in 0..clay.grid().brick_count() as u32 {
            let index = clay.grid().brick_index(dense).unwrap();
            let part = Mesh::of_brick(&clay, index);
            let before = all.positions_m.len() as u32;
            all.positions_m.extend(part.positions_m);
            all.triangles.extend(
                part.triangles
                    .iter()
                    .map(|corners| corners.map(|at| before + at)),
            );
        }
        let solid = Solid::of_mesh(&all).unwrap();
        assert_eq!(solid.triangles, Mesh::of(&clay).triangles.len());
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Whatever strokes of ball and blade leave, the STL of it is a closed manifold and holds what is left.
    #[test]
    fn the_stl_of_a_cut_block_is_closed_and_holds_what_is_left(
        size in [24.0..60.0, 24.0..48.0, 24.0..40.0],
        strokes in prop::collection::vec(
            (any::<bool>(), 3.0..8.0, [-0.2..1.2, -0.2..1.2, 0.3..1.2], [-0.2..1.2, -0.2..1.2, 0.3..1.2]),
            1..6,
        ),
    ) {
        let voxel_m = 1e-3;
        let mut clay = Clay::new(&Shape::Block { size_m: size.map(|edge| edge * voxel_m) }, voxel_m).unwrap();
        for (blade, radius, from, to) in strokes {
            let shape = if blade { ToolShape::paper_blade() } else { ToolShape::ball(radius * voxel_m).unwrap() };
            let place = |share: [f64; 3]| at(std::array::from_fn(|axis| share[axis] * size[axis] * voxel_m));
            clay.carve(&Sweep { shape, from: place(from), to: place(to) });
        }
        prop_assume!(0 < clay.remaining_units());
        let error = volume_error(&clay);
        prop_assert!(error.abs() < 2e-3, "{}", error);
    }

    /// Noise is the hardest clay to mesh: every ambiguous face occurs, in bricks, between them and at the border of the
    /// grid.
    #[test]
    fn noise_is_closed(seed in any::<u64>(), threshold in 1_u64..255, edge in 14..36_usize) {
        let mut noise = Noise(seed);
        let clay = clay_of([edge, 17, 20], 1e-3, |_| {
            let word = noise.word();
            if word >> 56 < threshold { word as u8 } else { 0 }
        });
        Solid::of(&clay).unwrap_or_else(|error| panic!("{error}"));
    }
}
