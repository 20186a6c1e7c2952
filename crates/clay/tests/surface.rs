//! The surface is closed whatever was cut, and encloses the volume that is left.

use std::collections::HashMap;

use proptest::prelude::*;
use teleclay_clay::{
    BRICK_VOXELS, BrickView, Clay, Mesh, Pose, Shape, SteppedBlock, Sweep, ToolShape, stl,
};

fn at(position_m: [f64; 3]) -> Pose {
    Pose::quantise(position_m).unwrap()
}

/// Every directed edge is matched by as many the other way round, and no triangle uses a vertex twice or one that is not there.
fn assert_closed(mesh: &Mesh) {
    let mut edges: HashMap<(u32, u32), i32> = HashMap::new();
    for &[a, b, c] in &mesh.triangles {
        assert!(a != b && b != c && c != a);
        for (from, to) in [(a, b), (b, c), (c, a)] {
            assert!((from as usize) < mesh.positions_m.len());
            *edges.entry((from.min(to), from.max(to))).or_default() +=
                if from < to { 1 } else { -1 };
        }
    }
    assert!(edges.values().all(|&balance| balance == 0));
}

fn assert_encloses(clay: &Clay, tolerance: f64) {
    let mesh = Mesh::of(clay);
    assert_closed(&mesh);
    let error = mesh.volume_m3() / clay.remaining_volume_m3() - 1.0;
    assert!(error.abs() < tolerance, "{error}");
}

#[test]
fn a_fresh_block_has_its_faces_where_they_should_be() {
    let clay = Clay::new(&Shape::default(), 1e-3).unwrap();
    let mesh = Mesh::of(&clay);
    assert_closed(&mesh);
    for (axis, size_m) in [0.128, 0.064, 0.064].into_iter().enumerate() {
        let along = || mesh.positions_m.iter().map(|at_m| f64::from(at_m[axis]));
        assert!(along().fold(f64::INFINITY, f64::min).abs() < 1e-6);
        assert!((along().fold(0.0, f64::max) - size_m).abs() < 1e-6);
    }
    // Edges and corners of the block are bevelled by a fraction of a voxel.
    assert!((mesh.volume_m3() / (0.128 * 0.064 * 0.064) - 1.0).abs() < 2e-3);
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
        assert_encloses(&clay, 5e-3);
    }
    let mut clay = Clay::new(&Shape::Stepped(SteppedBlock::paper()), 1e-3).unwrap();
    let blade = ToolShape::paper_blade();
    clay.carve(&Sweep {
        shape: blade,
        from: at([0.0, 0.032, 0.01]),
        to: at([0.11, 0.032, 0.01]),
    });
    assert_encloses(&clay, 5e-3);
}

#[test]
fn a_cavity_is_closed_and_faces_inwards() {
    let mut clay = Clay::new(&Shape::Block { size_m: [0.064; 3] }, 1e-3).unwrap();
    let before_m3 = Mesh::of(&clay).volume_m3();
    let centre = at([0.032; 3]);
    clay.carve(&Sweep {
        shape: ToolShape::ball(0.010).unwrap(),
        from: centre,
        to: centre,
    });
    let mesh = Mesh::of(&clay);
    assert_closed(&mesh);
    let ball_m3 = 4.0 / 3.0 * std::f64::consts::PI * 1e-6;
    assert!(((before_m3 - mesh.volume_m3()) / ball_m3 - 1.0).abs() < 0.02);
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

/// A triangle's corners, mm.
type Triangle = [[f32; 3]; 3];

/// The triangles of a binary STL file, read by its published layout: 80 bytes, a count, 50 bytes each.
fn read_stl(bytes: &[u8]) -> Vec<Triangle> {
    let count = u32::from_le_bytes(bytes[80..84].try_into().unwrap()) as usize;
    assert_eq!(bytes.len(), 84 + 50 * count);
    let number = |at: usize| f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    let corner = |at: usize| [number(at), number(at + 4), number(at + 8)];
    // The normal comes first.
    (0..count)
        .map(|triangle| [12, 24, 36].map(|offset| corner(84 + 50 * triangle + offset)))
        .collect()
}

/// Every edge is there as often one way as the other: nothing leads out.
fn assert_no_open_edge(triangles: &[Triangle]) {
    let mut edges: HashMap<[[u32; 3]; 2], i32> = HashMap::new();
    for corners in triangles {
        let corners = corners.map(|corner| corner.map(f32::to_bits));
        for (from, to) in [(0, 1), (1, 2), (2, 0)].map(|(a, b)| (corners[a], corners[b])) {
            let (edge, way) = if from < to {
                ([from, to], 1)
            } else {
                ([to, from], -1)
            };
            *edges.entry(edge).or_default() += way;
        }
    }
    assert!(edges.values().all(|&balance| balance == 0));
}

/// By the divergence theorem, m³.
fn volume_m3(triangles: &[Triangle]) -> f64 {
    let six = triangles.iter().map(|corners| {
        let [a, b, c] = corners.map(|corner| corner.map(f64::from));
        a[0] * (b[1] * c[2] - b[2] * c[1])
            + a[1] * (b[2] * c[0] - b[0] * c[2])
            + a[2] * (b[0] * c[1] - b[1] * c[0])
    });
    six.sum::<f64>() / 6.0 * 1e-9
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Whatever strokes of ball and blade leave, the STL of it has no open edge and holds what is left, to 2 %.
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
        // Slivers thinner than a voxel have no surface; a block of them would have no volume.
        prop_assume!(clay.initial_units() < 2 * clay.remaining_units());
        let triangles = read_stl(&stl::encode(&Mesh::of(&clay)));
        assert_no_open_edge(&triangles);
        let error = volume_m3(&triangles) / clay.remaining_volume_m3() - 1.0;
        prop_assert!(error.abs() < 0.02, "{}", error);
    }

    /// Noise is the hardest clay to mesh: every ambiguous face occurs, in bricks, between them and at the border of the grid.
    #[test]
    fn noise_is_closed(seed in any::<u64>(), threshold in 1_u64..255, edge in 14..36_i32) {
        let mut clay = Clay::new(&Shape::Block { size_m: [f64::from(edge) * 1e-3, 0.017, 0.020] }, 1e-3).unwrap();
        let mut state = seed | 1;
        for dense in 0..clay.grid().brick_count() as u32 {
            let index = clay.grid().brick_index(dense).unwrap();
            let mut voxels = [0; BRICK_VOXELS];
            if let BrickView::Voxels(fresh) = clay.brick(index) {
                voxels = *fresh;
            } else if clay.brick(index) == BrickView::Full {
                voxels = [255; BRICK_VOXELS];
            }
            for voxel in &mut voxels {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                let noise = state >> 56;
                *voxel = if noise < threshold { (*voxel).min((state >> 40) as u8) } else { 0 };
            }
            clay.replace_brick(index, BrickView::Voxels(&voxels)).unwrap();
        }
        assert_closed(&Mesh::of(&clay));
    }
}
