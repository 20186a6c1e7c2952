//! Clay that a mesh becomes has the mesh's volume, known in closed form; and what is inside is what the mesh goes
//! around.

mod shapes;

use teleclay_clay::{Clay, Grid, Mesh, Shape};
use teleclay_mesh::{MeshError, Placement, TriangleMesh, fill};

use shapes::{
    Numbers, Parts, ball, ball_volume_m3, carved, cuboid, grid, tetrahedron, torus, torus_volume_m3,
};

/// So many places and turns of each shape.
const PLACES: usize = 25;
const VOXEL_M: f64 = 1e-3;

/// A shape of about one edge, and its exact volume.
struct Known {
    name: &'static str,
    parts: fn(f64) -> Parts,
    volume_m3: fn(f64) -> f64,
    /// How far the volume may be off, of what is 20 voxels large: the worst and the mean over all places. A face
    /// across x or y that is nowhere turned is the hardest, as all of it is off by the same.
    worst: f64,
    mean: f64,
}

const KNOWN: [Known; 4] = [
    Known {
        name: "box",
        parts: |edge_m| cuboid([0.0; 3], [edge_m, 0.9 * edge_m, 0.8 * edge_m]),
        volume_m3: |edge_m| 0.72 * edge_m.powi(3),
        worst: 2e-3,
        mean: 8e-4,
    },
    Known {
        name: "tetrahedron",
        parts: |edge_m| tetrahedron([edge_m; 3]),
        volume_m3: |edge_m| edge_m.powi(3) / 6.0,
        worst: 2e-3,
        mean: 8e-4,
    },
    Known {
        name: "ball",
        parts: |edge_m| ball(edge_m / 2.0, 6),
        volume_m3: |edge_m| ball_volume_m3(edge_m / 2.0),
        worst: 1.5e-3,
        mean: 1e-3,
    },
    Known {
        name: "ring",
        parts: |edge_m| torus(0.35 * edge_m, 0.15 * edge_m, 320, 192),
        volume_m3: |edge_m| torus_volume_m3(0.35 * edge_m, 0.15 * edge_m),
        worst: 2e-3,
        mean: 1.2e-3,
    },
];

/// How far the volume of the clay is from what it should be, as a share of it.
fn error(parts: Parts, volume_m3: f64, voxels: u16) -> f64 {
    let mesh = parts.mesh().unwrap();
    let clay = fill(&mesh, &grid([voxels; 3]), Placement::AsIs).unwrap();
    assert_eq!(clay.removed_units(), 0);
    clay.remaining_volume_m3() / volume_m3 - 1.0
}

#[test]
fn clay_has_the_volume_of_its_mesh() {
    let mut numbers = Numbers(1);
    for known in &KNOWN {
        for (edge_voxels, finer) in [(20, 1.0), (60, 0.6)] {
            let edge_m = f64::from(edge_voxels) * VOXEL_M;
            let (mut worst, mut sum) = (0.0_f64, 0.0);
            for place in 0..PLACES {
                // Every other one as it stands, where faces are across axes.
                let angle_rad = if place % 2 == 0 {
                    0.0
                } else {
                    6.0 * numbers.share()
                };
                let middle_m = [0; 3].map(|_| edge_m + VOXEL_M * numbers.share());
                let parts = (known.parts)(edge_m).turned(angle_rad).shifted(middle_m);
                let error = error(parts, (known.volume_m3)(edge_m), 3 * edge_voxels).abs();
                worst = worst.max(error);
                sum += error;
            }
            let (name, mean) = (known.name, sum / PLACES as f64);
            let said =
                format!("{name} of {edge_voxels} voxels: worst {worst:.1e}, mean {mean:.1e}");
            assert!(
                worst < finer * known.worst && mean < finer * known.mean,
                "{said}"
            );
        }
    }
}

/// Against the mesh itself there is no curvature in between, and turned faces average out.
#[test]
fn turned_meshes_are_met_to_a_ten_thousandth() {
    let mut numbers = Numbers(2);
    for _ in 0..PLACES {
        let angle_rad = 0.3 + numbers.share();
        let middle_m = [0; 3].map(|_| 0.05 + VOXEL_M * numbers.share());
        for parts in [
            cuboid([0.0; 3], [0.040, 0.036, 0.032]),
            torus(0.014, 0.006, 30, 18),
        ] {
            let parts = parts.turned(angle_rad).shifted(middle_m);
            let volume_m3 = parts.mesh().unwrap().volume_m3();
            let error = error(parts, volume_m3, 120);
            assert!(error.abs() < 1e-4, "{error:.1e}");
        }
    }
}

#[test]
fn a_box_on_voxels_is_exactly_these_voxels() {
    let mesh = cuboid([0.003, 0.005, 0.001], [0.020, 0.021, 0.018]);
    let clay = fill(&mesh.mesh().unwrap(), &grid([24; 3]), Placement::AsIs).unwrap();
    assert_eq!(clay.remaining_units(), 17 * 16 * 17 * 255);
    for (voxel, occupancy) in [
        ([3, 5, 1], 255),
        ([19, 20, 17], 255),
        ([2, 5, 1], 0),
        ([3, 4, 1], 0),
        ([3, 5, 0], 0),
        ([20, 20, 17], 0),
        ([19, 21, 17], 0),
        ([19, 20, 18], 0),
    ] {
        assert_eq!(clay.occupancy(voxel), occupancy, "{voxel:?}");
    }
}

#[test]
fn a_voxel_holds_the_share_that_is_inside() {
    // 3/4 of a voxel along x, 1/2 along y, and 1/5 along z, which is no whole number of lines.
    let mesh = cuboid([0.002, 0.002, 0.002], [0.00475, 0.0045, 0.0042]);
    let clay = fill(&mesh.mesh().unwrap(), &grid([8; 3]), Placement::AsIs).unwrap();
    for (voxel, share) in [
        ([3, 3, 3], 1.0),
        ([4, 3, 3], 0.75),
        ([3, 4, 3], 0.5),
        ([3, 3, 4], 0.2),
        ([4, 4, 3], 0.375),
        ([4, 4, 4], 0.075),
    ] {
        let got = f64::from(clay.occupancy(voxel)) / 255.0;
        assert!((got - share).abs() < 1.0 / 255.0, "{voxel:?}: {got}");
    }
}

/// Shells that overlap are one body; a hollow faces inwards.
#[test]
fn inside_is_what_the_mesh_goes_around() {
    let cube = |edge_m: f64| {
        let (lower, upper) = (0.016 - edge_m / 2.0, 0.016 + edge_m / 2.0);
        cuboid([lower; 3], [upper; 3])
    };
    let outer = || cube(0.024);
    let units = |parts: Parts| {
        let mesh = parts.mesh().unwrap();
        let clay = fill(&mesh, &grid([40; 3]), Placement::AsIs).unwrap();
        clay.remaining_units() / 255
    };
    let (whole, hole) = (24_u64.pow(3), 12_u64.pow(3));
    assert_eq!(
        units(outer().and(cube(0.012))),
        whole,
        "within: twice around"
    );
    assert_eq!(
        units(outer().and(cube(0.012).inside_out())),
        whole - hole,
        "within, facing inwards"
    );
    assert_eq!(
        units(outer().inside_out().and(cube(0.012))),
        whole - hole,
        "turned round as a whole"
    );
    let within_the_hole = cube(0.012).inside_out().and(cube(0.004));
    assert_eq!(
        units(outer().and(within_the_hole)),
        whole - hole + 64,
        "in the hollow"
    );
    assert_eq!(units(outer().and(outer())), whole, "the same again");
    let across = cuboid([0.016, 0.016, 0.016], [0.036, 0.036, 0.036]);
    assert_eq!(
        units(outer().and(across)),
        whole + 20_u64.pow(3) - hole,
        "overlapping: the corner counts once"
    );
    let apart = cuboid([0.030; 3], [0.038; 3]).inside_out();
    assert_eq!(
        units(outer().and(apart)),
        whole + 512,
        "apart, facing inwards"
    );
    let beside = cuboid([0.028, 0.004, 0.004], [0.038, 0.028, 0.028]);
    assert_eq!(
        units(outer().and(beside)),
        whole + 10 * 24 * 24,
        "touching at a face"
    );
    let on_edge = cuboid([0.028, 0.028, 0.004], [0.038, 0.038, 0.028]);
    assert_eq!(
        units(outer().and(on_edge)),
        whole + 10 * 10 * 24,
        "touching at an edge"
    );
}

/// Lower and upper corner of the voxels that hold clay.
fn extent(clay: &Clay) -> ([i32; 3], [i32; 3]) {
    let count = clay.grid().voxels().map(i32::from);
    let (mut lower, mut upper) = ([i32::MAX; 3], [0; 3]);
    for z in 0..count[2] {
        for y in 0..count[1] {
            for x in 0..count[0] {
                if clay.occupancy([x, y, z]) != 0 {
                    for (axis, at) in [x, y, z].into_iter().enumerate() {
                        lower[axis] = lower[axis].min(at);
                        upper[axis] = upper[axis].max(at + 1);
                    }
                }
            }
        }
    }
    (lower, upper)
}

#[test]
fn a_fitted_mesh_touches_the_block_and_stands_in_its_middle() {
    let block = grid([40, 30, 20]);
    for (size_m, lower, upper) in [
        ([2.0, 1.0, 0.5], [0, 5, 5], [40, 25, 15]),
        ([2.0, 3.0, 1.0], [10, 0, 5], [30, 30, 15]),
        ([2e-5, 1e-5, 2e-5], [10, 10, 0], [30, 20, 20]),
        ([4.0, 3.0, 2.0], [0; 3], [40, 30, 20]),
    ] {
        let corner_m = [7.0, -100.0, 0.0];
        let parts = cuboid([0.0; 3], size_m).shifted(corner_m);
        let clay = fill(&parts.mesh().unwrap(), &block, Placement::Fitted).unwrap();
        assert_eq!(extent(&clay), (lower, upper), "{size_m:?}");
        let voxels: i32 = (0..3).map(|axis| upper[axis] - lower[axis]).product();
        let share = clay.remaining_units() as f64 / 255.0 / f64::from(voxels);
        assert!((share - 1.0).abs() < 1e-6, "{size_m:?}: {share}");
    }
}

#[test]
fn a_centred_mesh_keeps_its_size() {
    let parts = cuboid([-3.0; 3], [-2.99, -2.988, -2.994]);
    let clay = fill(&parts.mesh().unwrap(), &grid([20; 3]), Placement::Centred).unwrap();
    assert_eq!(extent(&clay), ([5, 4, 7], [15, 16, 13]));
}

#[test]
fn what_does_not_lie_in_the_block_is_refused_with_both_sizes() {
    let block = grid([20, 20, 10]);
    let filled = |parts: Parts, placement| fill(&parts.mesh().unwrap(), &block, placement);
    let close = |got_m: [f64; 3], want_m: [f64; 3]| {
        (0..3).all(|axis| (got_m[axis] - want_m[axis]).abs() < 1e-12)
    };
    let large = || cuboid([0.0; 3], [0.010, 0.010, 0.012]);
    for placement in [Placement::AsIs, Placement::Centred] {
        match filled(large(), placement) {
            Err(MeshError::TooLarge { mesh_m, block_m }) => assert!(
                close(mesh_m, [0.010, 0.010, 0.012]) && close(block_m, [0.020, 0.020, 0.010])
            ),
            other => panic!("{placement:?}: {other:?}"),
        }
    }
    assert!(filled(large(), Placement::Fitted).is_ok());
    let beside = || cuboid([0.012, 0.0, 0.0], [0.022, 0.010, 0.010]);
    match filled(beside(), Placement::AsIs) {
        Err(MeshError::Outside {
            lower_m, upper_m, ..
        }) => assert!(close(lower_m, [0.012, 0.0, 0.0]) && close(upper_m, [0.022, 0.010, 0.010])),
        other => panic!("{other:?}"),
    }
    assert!(filled(beside(), Placement::Centred).is_ok());
    // Half a voxel is what the surface of clay may stand out by.
    let stands_out = |by_m: f64| cuboid([-by_m; 3], [0.020 + by_m, 0.020 + by_m, 0.010 + by_m]);
    let clay = filled(stands_out(4.9e-4), Placement::AsIs).unwrap();
    assert_eq!(clay.remaining_units(), 20 * 20 * 10 * 255);
    assert!(filled(stands_out(5.1e-4), Placement::AsIs).is_err());
}

#[test]
fn a_mesh_between_the_lines_is_no_clay() {
    let speck = cuboid([0.0051; 3], [0.005_100_01; 3]).mesh().unwrap();
    let filled = fill(&speck, &grid([16; 3]), Placement::AsIs);
    assert!(matches!(filled, Err(MeshError::Empty)));
}

/// Which triangle comes first, and at which corner it begins, changes nothing.
#[test]
fn the_order_of_triangles_does_not_matter() {
    let parts = torus(0.012, 0.006, 40, 24).turned(1.0).shifted([0.02; 3]);
    let hash = |parts: &Parts| {
        let mesh = parts.mesh().unwrap();
        fill(&mesh, &grid([40; 3]), Placement::AsIs).unwrap().hash()
    };
    let wanted = hash(&parts);
    let mut numbers = Numbers(3);
    let mut shuffled = parts;
    for last in (1..shuffled.triangles.len()).rev() {
        shuffled.triangles.swap(last, numbers.below(last + 1));
        shuffled.triangles[last].rotate_left(numbers.below(3));
    }
    assert_eq!(hash(&shuffled), wanted);
}

/// A number that every machine must come to.
#[test]
fn the_same_mesh_is_the_same_clay_everywhere() {
    let parts = tetrahedron([0.031, 0.029, 0.033]).and(cuboid([0.004; 3], [0.0213; 3]));
    let mesh = parts.mesh().unwrap();
    let mut clay = fill(&mesh, &grid([40, 35, 37]), Placement::Fitted).unwrap();
    assert_eq!(clay.hash(), 2_594_534_898_839_578_318);
}

fn surface(clay: &Clay) -> TriangleMesh {
    TriangleMesh::try_from(&Mesh::of(clay)).unwrap()
}

#[test]
fn clay_that_was_a_mesh_meanwhile_is_as_much_as_before() {
    let clay = carved();
    let again = fill(&surface(&clay), clay.grid(), Placement::AsIs).unwrap();
    let share = again.remaining_volume_m3() / clay.remaining_volume_m3();
    assert!((share - 1.0).abs() < 3e-3, "{share}");
    // And in the same place: no voxel that was full is air, nor the other way round.
    let count = clay.grid().voxels().map(i32::from);
    for z in 0..count[2] {
        for y in 0..count[1] {
            for x in 0..count[0] {
                let (before, after) = (clay.occupancy([x, y, z]), again.occupancy([x, y, z]));
                assert!(
                    before.abs_diff(after) < 160,
                    "{x} {y} {z}: {before}, then {after}"
                );
            }
        }
    }
}

#[test]
fn a_fresh_block_that_was_a_mesh_meanwhile_is_a_fresh_block() {
    let size_m = [0.020, 0.012, 0.016];
    let mut clay = Clay::new(&Shape::Block { size_m }, 1e-3).unwrap();
    let mut again = fill(&surface(&clay), clay.grid(), Placement::AsIs).unwrap();
    assert_eq!(again.hash(), clay.hash());
}

#[test]
fn the_largest_grid_holds_a_mesh_of_many_triangles() {
    let mesh = torus(0.1, 0.04, 250, 200).mesh().unwrap();
    let block = Grid::of_voxels([256, 256, 128], 5e-4).unwrap();
    let clay = fill(&mesh, &block, Placement::Fitted).unwrap();
    let scale = 0.128 / 0.28;
    let share = clay.remaining_volume_m3() / (mesh.volume_m3() * f64::powi(scale, 3));
    assert!((share - 1.0).abs() < 1e-5, "{share}");
}
