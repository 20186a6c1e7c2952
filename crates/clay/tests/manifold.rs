//! The STL of any clay is a closed two-manifold, and encloses what is left.

mod solid;

use solid::{Noise, Solid, at, clay_of};
use teleclay_clay::{Blade, BladeDimensions, Clay, Mesh, SOLID, Shape, Sweep, ToolShape};

/// Voxels along the edge of the grid in which patterns are laid out, across the seam of eight bricks.
const AROUND_A_SEAM: usize = 20;
/// Where patterns begin: their middle is where bricks meet.
const PATTERN_FROM: usize = 15;

/// Clay like a pattern: a bit for each voxel, x fastest; and by which voxel of the pattern it is, what its occupancy
/// is.
fn clay_like(edges: [usize; 3], bits: u64, mut occupancy: impl FnMut(usize, bool) -> u8) -> Clay {
    clay_of([AROUND_A_SEAM; 3], 1e-3, |voxel| {
        let place = voxel.map(|at| at.wrapping_sub(PATTERN_FROM));
        if (0..3).any(|axis| edges[axis] <= place[axis]) {
            return 0;
        }
        let number = (place[2] * edges[1] + place[1]) * edges[0] + place[0];
        occupancy(number, bits >> number & 1 == 1)
    })
}

/// Every two neighbouring cells there can be: all patterns of 3 x 2 x 2 voxels along each axis, with air about them.
#[test]
fn every_pair_of_cells_is_a_manifold_of_its_volume() {
    for edges in [[3, 2, 2], [2, 3, 2], [2, 2, 3]] {
        for bits in 1..1 << 12 {
            let clay = clay_like(edges, bits, |_, is_clay| if is_clay { SOLID } else { 0 });
            let solid =
                Solid::of(&clay).unwrap_or_else(|error| panic!("{edges:?} {bits:b}: {error}"));
            // No such pattern has a cavity.
            assert!(solid.parts_m3.iter().all(|&part| 0.0 < part), "{bits:b}");
            let error = solid.volume_m3 / clay.remaining_volume_m3() - 1.0;
            assert!(error.abs() < 2e-3, "{edges:?} {bits:b}: {error}");
        }
    }
}

/// The same inside solid clay: all that was clay is air.
#[test]
fn every_pair_of_cells_within_clay_is_a_manifold() {
    for bits in 1..1 << 12 {
        // Bricks meet in the middle of the pattern.
        let clay = clay_of([20, 6, 6], 1e-3, |[x, y, z]| {
            let place = [x.wrapping_sub(15), y.wrapping_sub(2), z.wrapping_sub(2)];
            if 3 <= place[0] || 2 <= place[1] || 2 <= place[2] {
                return SOLID;
            }
            let number = (place[2] * 2 + place[1]) * 3 + place[0];
            if bits >> number & 1 == 1 { 0 } else { SOLID }
        });
        let solid = Solid::of(&clay).unwrap_or_else(|error| panic!("{bits:b}: {error}"));
        assert_eq!(
            solid.parts_m3.iter().filter(|&&part| 0.0 < part).count(),
            1,
            "one outside, and cavities"
        );
        let error = solid.volume_m3 / clay.remaining_volume_m3() - 1.0;
        assert!(error.abs() < 2e-3, "{bits:b}: {error}");
    }
}

/// Patterns of 3 x 3 x 3 voxels, of occupancies about the threshold, at both ends, and all between.
#[test]
fn patterns_of_any_occupancy_are_manifolds() {
    let mut noise = Noise(1);
    for round in 0..6000 {
        let bits = noise.word();
        let clay = clay_like([3; 3], bits, |_, is_clay| {
            let any = noise.word() as u8;
            match (round % 3, is_clay) {
                (0, true) => 128,
                (0, false) => 127,
                (1, true) => any | 128,
                (1, false) => any & 127,
                (_, true) => any.max(1),
                (_, false) => 0,
            }
        });
        Solid::of(&clay).unwrap_or_else(|error| panic!("round {round}, {bits:b}: {error}"));
    }
}

/// A voxel by itself is as large as it is full, down to the least that there can be.
#[test]
fn a_single_voxel_has_its_volume() {
    for occupancy in 1..=SOLID {
        for voxel in [[0, 0, 0], [15, 7, 16]] {
            let clay = clay_of([17; 3], 5e-4, |at| if at == voxel { occupancy } else { 0 });
            let solid = Solid::of(&clay).unwrap();
            let error = solid.volume_m3 / clay.remaining_volume_m3() - 1.0;
            assert!(error.abs() < 2e-3, "{occupancy}: {error}");
        }
    }
    // A speck keeps its volume beside a block, too.
    let clay = clay_of([20; 3], 5e-4, |[x, y, z]| {
        let in_block = x < 12 && y < 12 && z < 12;
        if in_block || [x, y, z] == [16, 17, 15] {
            SOLID
        } else {
            0
        }
    });
    let mut parts_m3 = Solid::of(&clay).unwrap().parts_m3;
    parts_m3.sort_by(f64::total_cmp);
    let voxels: Vec<_> = parts_m3.iter().map(|part| part / 1.25e-10).collect();
    assert!(
        (voxels[0] - 1.0).abs() < 1e-3 && (voxels[1] / 1728.0 - 1.0).abs() < 1e-3,
        "{voxels:?}"
    );
}

/// Films thinner than a voxel, down to a 255th of one: alone, and with a block of which they are most of the clay.
#[test]
fn films_have_their_volume() {
    for occupancy in (1..=SOLID).step_by(2) {
        let clay = clay_of(
            [21, 18, 3],
            1e-3,
            |[_, _, z]| if z == 1 { occupancy } else { 0 },
        );
        let solid = Solid::of(&clay).unwrap();
        let error = solid.volume_m3 / clay.remaining_volume_m3() - 1.0;
        assert!(error.abs() < 2e-3, "{occupancy}: {error}");
        let clay = clay_of([40, 40, 6], 1e-3, |[x, y, z]| {
            if x < 6 && y < 6 {
                SOLID
            } else if z == 1 || z == 4 {
                occupancy
            } else {
                0
            }
        });
        let solid = Solid::of(&clay).unwrap();
        let error = solid.volume_m3 / clay.remaining_volume_m3() - 1.0;
        assert!(error.abs() < 2e-3, "{occupancy}: {error}");
    }
}

/// At the far end of the longest grid, where coordinates are coarsest, with vertices as near to each other as they get:
/// specks of next to nothing, which touch along edges and in corners.
#[test]
fn vertices_are_told_apart_at_the_far_end() {
    let mut noise = Noise(5);
    for round in 0..200 {
        let voxel_m = noise.between(1.1e-5, 3e-3);
        let clay = clay_of([1024, 5, 5], voxel_m, |[x, ..]| {
            let word = noise.word();
            match (x, word % 4) {
                (..1020, _) | (_, 0..2) => 0,
                (_, 2) => (word >> 8) as u8 % 3,
                _ => [1, 2, 127, 128, SOLID][(word >> 8) as usize % 5],
            }
        });
        if 0 < clay.remaining_units() {
            Solid::of(&clay).unwrap_or_else(|error| panic!("round {round}: {error}"));
        }
    }
}

/// Four strokes of a ball that cross each other, at which surfaces once touched along an edge.
#[test]
fn strokes_that_cross_leave_a_manifold() {
    let mut clay = Clay::new(&Shape::default(), 5e-4).unwrap();
    let shape = ToolShape::ball(0.0064).unwrap();
    // On top of the middle of the block, and the way from there.
    let home_m = [0.064, 0.032, 0.0704];
    let waypoints_m = [
        [0.0, 0.0, 0.0],
        [-0.02, -0.02, -0.003],
        [0.11, 0.02, -0.003],
        [0.11, -0.02, -0.003],
        [-0.02, 0.02, -0.003],
    ];
    let places =
        waypoints_m.map(|way_m| at(std::array::from_fn(|axis| home_m[axis] + way_m[axis])));
    for stroke in places.windows(2) {
        let (from, to) = (stroke[0], stroke[1]);
        clay.carve(&Sweep { shape, from, to });
    }
    let solid = Solid::of(&clay).unwrap();
    assert!(300_000 < solid.triangles);
    assert!((solid.volume_m3 / clay.remaining_volume_m3() - 1.0).abs() < 2e-3);
}

/// A block cut by strokes that follow one another, with ends in and about it.
fn cut_block(
    noise: &mut Noise,
    edges_m: [f64; 3],
    voxel_m: f64,
    tool: ToolShape,
    strokes: usize,
) -> Clay {
    let mut clay = Clay::new(&Shape::Block { size_m: edges_m }, voxel_m).unwrap();
    clay.admits(&tool).unwrap();
    let mut place = || at(edges_m.map(|edge_m| noise.between(-0.2, 1.2) * edge_m));
    let mut from = place();
    for _ in 0..strokes {
        let to = place();
        clay.carve(&Sweep {
            shape: tool,
            from,
            to,
        });
        from = to;
    }
    clay
}

/// Blocks cut at random, by balls and blade, in three sizes of voxels, from hardly at all to almost nothing left.
#[test]
fn cut_blocks_are_manifolds_of_what_is_left() {
    let blade = BladeDimensions {
        width_m: 0.007,
        height_m: 0.019,
        thickness_m: 0.0043,
    };
    let tools = [
        ToolShape::ball(0.0064).unwrap(),
        ToolShape::ball(0.0023).unwrap(),
        ToolShape::Blade(Blade::new(blade).unwrap()),
    ];
    let mut noise = Noise(2);
    let (mut cut, mut worst) = (0, 0.0_f64);
    for number in 0..200 {
        for tool in tools {
            let voxel_m = [5e-4, 1e-3, 2e-3][number % 3];
            let edges_m = [0; 3].map(|_| noise.between(6.0, 20.0) * voxel_m);
            let strokes = (noise.word() % 12) as usize + 1;
            let clay = cut_block(&mut noise, edges_m, voxel_m, tool, strokes);
            if clay.remaining_units() == 0 {
                assert_eq!(Mesh::of(&clay), Mesh::default());
                continue;
            }
            let solid =
                Solid::of(&clay).unwrap_or_else(|error| panic!("{number}, {tool:?}: {error}"));
            let error = solid.volume_m3 / clay.remaining_volume_m3() - 1.0;
            worst = worst.max(error.abs());
            assert!(error.abs() < 2e-3, "{number}, {tool:?}: {error}");
            cut += 1;
        }
    }
    println!("{cut} cut blocks, volume within {worst:.5}");
    assert!(400 < cut, "{cut}");
}
