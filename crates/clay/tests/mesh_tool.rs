//! A tool from a closed mesh: against the ball and the blade that it stands for, and with the promises of every cut.

use std::f64::consts::PI;

use proptest::prelude::*;
use teleclay_clay::{
    Blade, BladeDimensions, Clay, ContactState, Material, MeshTool, MeshToolError, Motion, Pose,
    Shape, Sweep, ToolShape,
};

const VOXEL_M: f64 = 5e-4;
const EDGE_M: f64 = 0.048;

fn at(position_m: [f64; 3]) -> Pose {
    Pose::quantise(position_m).unwrap()
}

fn cube() -> Clay {
    let shape = Shape::Block {
        size_m: [EDGE_M; 3],
    };
    Clay::new(&shape, VOXEL_M).unwrap()
}

/// A closed mesh that faces outwards.
type Triangles = (Vec<[f64; 3]>, Vec<[u32; 3]>);

/// A ball about the tool's position, of `rings` times twice as many squares.
fn ball(radius_m: f64, rings: u32) -> Triangles {
    let around = 2 * rings;
    let mut vertices_m = vec![[0.0, 0.0, radius_m]];
    for ring in 1..rings {
        let polar = PI * f64::from(ring) / f64::from(rings);
        for step in 0..around {
            let angle = 2.0 * PI * f64::from(step) / f64::from(around);
            let across_m = radius_m * polar.sin();
            vertices_m.push([
                across_m * angle.cos(),
                across_m * angle.sin(),
                radius_m * polar.cos(),
            ]);
        }
    }
    vertices_m.push([0.0, 0.0, -radius_m]);
    let last = vertices_m.len() as u32 - 1;
    let vertex = |ring: u32, step: u32| match ring {
        0 => 0,
        ring if ring == rings => last,
        ring => 1 + (ring - 1) * around + step % around,
    };
    let mut triangles = Vec::new();
    for ring in 0..rings {
        for step in 0..around {
            let (a, b) = (vertex(ring, step), vertex(ring, step + 1));
            let (c, d) = (vertex(ring + 1, step), vertex(ring + 1, step + 1));
            if a != b {
                triangles.push([a, c, b]);
            }
            if c != d {
                triangles.push([b, c, d]);
            }
        }
    }
    (vertices_m, triangles)
}

/// A box whose lower face has its middle at the tool's position.
fn cuboid(size_m: [f64; 3]) -> Triangles {
    let [x, y, z] = size_m;
    let vertices_m = (0..8)
        .map(|corner: u32| {
            let side = |bit: u32, size_m: f64| {
                if corner >> bit & 1 == 0 {
                    -0.5 * size_m
                } else {
                    0.5 * size_m
                }
            };
            [side(0, x), side(1, y), side(2, z) + 0.5 * z]
        })
        .collect();
    let quads = [
        [0, 4, 6, 2],
        [1, 3, 7, 5],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 2, 3, 1],
        [4, 5, 7, 6],
    ];
    let triangles = quads
        .into_iter()
        .flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]])
        .collect();
    (vertices_m, triangles)
}

fn baked((vertices_m, triangles): Triangles) -> MeshTool {
    MeshTool::new(&vertices_m, &triangles).unwrap()
}

fn assert_near(got: f64, want: f64, error: f64, what: &str) {
    assert!(
        (got / want - 1.0).abs() <= error,
        "{what}: {got}, wanted {want} within {error}"
    );
}

/// How far two blocks are apart: the greatest difference of a voxel, in units.
fn apart(a: &Clay, b: &Clay) -> u8 {
    let [x, y, z] = a.grid().voxels().map(i32::from);
    let mut most = 0;
    for k in 0..z {
        for j in 0..y {
            for i in 0..x {
                let voxel = [i, j, k];
                most = most.max(a.occupancy(voxel).abs_diff(b.occupancy(voxel)));
            }
        }
    }
    most
}

const WAYS: [([f64; 3], [f64; 3]); 4] = [
    ([-0.02, 0.0243, 0.0239], [0.07, 0.0243, 0.0239]),
    ([0.013, 0.0151, 0.0147], [0.034, 0.0312, 0.0281]),
    ([0.0241, 0.0243, 0.07], [0.0241, 0.0243, 0.0251]),
    ([0.0241, 0.0243, 0.0239], [0.0241, 0.0243, 0.0239]),
];

/// 12.8 voxels of radius in 32 512 triangles would be too many; 8 064 of them lie 0.03 voxels inside the ball.
#[test]
fn a_fine_ball_cuts_as_the_ball_does() {
    let radius_m = 0.0064;
    let mesh = baked(ball(radius_m, 64));
    assert_near(mesh.thickness_m(), 2.0 * radius_m, 0.03, "thickness");
    let shape = ToolShape::ball(radius_m).unwrap();
    for (from_m, to_m) in WAYS {
        let (from, to) = (at(from_m), at(to_m));
        let (mut by_mesh, mut by_ball) = (cube(), cube());
        by_mesh.carve_mesh(&mesh, from, to);
        by_ball.carve(&Sweep { shape, from, to });
        let what = format!("{from_m:?} to {to_m:?}");
        let (got_m3, want_m3) = (by_mesh.removed_volume_m3(), by_ball.removed_volume_m3());
        assert_near(got_m3, want_m3, 5e-3, &what);
        let units = apart(&by_mesh, &by_ball);
        assert!(units <= 10, "{what}: {units} units");
    }
}

/// A lattice rounds edges by a part of its cell, here 0.8 of a voxel; and what an edge cuts askew to its faces is measured
/// from these, where a blade's hull has planes of its own. So askew a little less goes, along the outline.
#[test]
fn a_box_cuts_as_the_blade_does_but_for_its_edges() {
    let [thickness_m, width_m, height_m] = [0.006, 0.01, 0.02];
    let mesh = baked(cuboid([thickness_m, width_m, height_m]));
    // Its deepest node lies up to half a cell beside the middle.
    assert_near(mesh.thickness_m(), thickness_m, 0.08, "thickness");
    let blade = BladeDimensions {
        width_m,
        height_m,
        thickness_m,
    };
    let shape = ToolShape::Blade(Blade::new(blade).unwrap());
    for (from_m, to_m) in WAYS {
        let (from, to) = (at(from_m), at(to_m));
        let (mut by_mesh, mut by_blade) = (cube(), cube());
        by_mesh.carve_mesh(&mesh, from, to);
        by_blade.carve(&Sweep { shape, from, to });
        let what = format!("{from_m:?} to {to_m:?}");
        let (got_m3, want_m3) = (by_mesh.removed_volume_m3(), by_blade.removed_volume_m3());
        let is_askew = (0..3).all(|axis| from_m[axis] != to_m[axis]);
        assert_near(got_m3, want_m3, if is_askew { 0.04 } else { 0.015 }, &what);
        let units = apart(&by_mesh, &by_blade);
        assert!(units <= 90, "{what}: {units} units");
    }
}

#[test]
fn a_mesh_is_felt_as_what_it_stands_for() {
    let (material, mut contact) = (Material::default(), ContactState::default());
    let radius_m = 0.0064;
    let fine_ball = baked(ball(radius_m, 64));
    let size_m = [0.006, 0.01, 0.02];
    let plate = baked(cuboid(size_m));
    let disc_m2 = PI * radius_m * radius_m;
    for (mesh, direction, want_m2) in [
        (&fine_ball, [1.0, 0.0, 0.0], disc_m2),
        (&fine_ball, [0.0, 0.6, -0.8], disc_m2),
        (&plate, [1.0, 0.0, 0.0], size_m[1] * size_m[2]),
        (
            &plate,
            [-0.6, 0.8, 0.0],
            (0.6 * size_m[1] + 0.8 * size_m[0]) * size_m[2],
        ),
        (&plate, [0.0, 0.0, -1.0], size_m[0] * size_m[1]),
    ] {
        let mut clay = cube();
        let step_m = 0.23 * VOXEL_M;
        let place = |way_m: f64| {
            at(std::array::from_fn(|axis| {
                0.0241 + way_m * direction[axis] - if axis == 2 { 0.01 } else { 0.0 }
            }))
        };
        clay.carve_mesh(mesh, place(-0.01), place(0.0));
        for tick in 0..20_u32 {
            let ends = [tick, tick + 1].map(|tick| place(f64::from(tick) * step_m));
            let velocity_m_s = direction.map(|d| d * step_m / 1e-3);
            let motion = Motion::new(ends[0], ends[1], velocity_m_s).unwrap();
            let worked = clay.work_mesh(mesh, &material, &motion, &mut contact);
            let got_m2 = clay.engaged_area_of_mesh_m2(mesh, ends[1], direction);
            assert_near(got_m2, want_m2, 0.04, &format!("{direction:?}"));
            let along_n: f64 = (0..3)
                .map(|axis| worked.response.force_n[axis] * direction[axis])
                .sum();
            assert_near(-along_n, 2e5 * got_m2 * step_m / 1e-3, 1e-3, "force");
        }
        // In air nothing is felt.
        assert!(clay.engaged_area_of_mesh_m2(mesh, at([0.1; 3]), direction) <= 0.0);
    }
    // Half sunk, half of it.
    let mut clay = cube();
    let half = at([0.0241, 0.0241, EDGE_M]);
    clay.carve_mesh(&fine_ball, at([0.0, 0.0241, EDGE_M]), half);
    let half_m2 = clay.engaged_area_of_mesh_m2(&fine_ball, half, [1.0, 0.0, 0.0]);
    assert_near(half_m2, 0.5 * disc_m2, 0.05, "half sunk");
}

#[test]
fn nothing_stands_behind_a_fast_mesh() {
    let mesh = baked(cuboid([0.002, 0.003, 0.004]));
    let (from_m, to_m) = ([0.004, 0.005, 0.006], [0.044, 0.037, 0.031]);
    let mut clay = cube();
    clay.carve_mesh(&mesh, at(from_m), at(to_m));
    for step in 0..=4000 {
        let share = f64::from(step) / 4000.0;
        let voxel: [i32; 3] = std::array::from_fn(|axis| {
            let place_m = from_m[axis] + share * (to_m[axis] - from_m[axis]);
            ((place_m + if axis == 2 { 0.002 } else { 0.0 }) / VOXEL_M) as i32
        });
        let left = clay.occupancy(voxel);
        assert!(left == 0, "{voxel:?}: {left}");
    }
}

#[test]
fn what_is_no_tool_is_named() {
    let refused = |(vertices_m, triangles): Triangles| {
        MeshTool::new(&vertices_m, &triangles)
            .map(|_| ())
            .unwrap_err()
    };
    let sound = || cuboid([0.01; 3]);
    assert!(MeshTool::new(&sound().0, &sound().1).is_ok());
    let (vertices_m, mut open) = sound();
    open.pop();
    assert_eq!(refused((vertices_m.clone(), open)), MeshToolError::Open);
    let (_, mut inwards) = sound();
    for triangle in &mut inwards {
        triangle.swap(0, 1);
    }
    assert_eq!(refused((vertices_m.clone(), inwards)), MeshToolError::Thin);
    assert_eq!(
        refused((vertices_m.clone(), Vec::new())),
        MeshToolError::Triangles { got: 0 }
    );
    let (_, mut astray) = sound();
    astray[3][1] = 8;
    assert_eq!(
        refused((vertices_m.clone(), astray)),
        MeshToolError::NoVertex { triangle: 3 }
    );
    let mut far_m = vertices_m;
    far_m[5][2] = f64::NAN;
    assert_eq!(
        refused((far_m, sound().1)),
        MeshToolError::Far { vertex: 5 }
    );
    let thin = baked(cuboid([0.0008, 0.01, 0.01]));
    assert!(cube().admits_mesh(&thin).is_err());
    assert!(
        cube()
            .admits_mesh(&baked(cuboid([0.002, 0.01, 0.01])))
            .is_ok()
    );
}

fn wedge() -> MeshTool {
    let (mut vertices_m, triangles) = cuboid([0.008, 0.006, 0.012]);
    // Its forward side tapers to an edge, slanting.
    for vertex in &mut vertices_m {
        if 0.0 < vertex[0] {
            vertex[1] *= 0.2;
            vertex[2] += 0.002;
        }
    }
    baked((vertices_m, triangles))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    /// In order every sweep starts where the last one ended; in reverse none does. Both leave the same bits, with a ball
    /// at work in between, and not a unit gets lost.
    #[test]
    fn order_and_repetition_leave_no_trace(
        places in prop::collection::vec([-0.005..0.05_f64, -0.005..0.05, -0.005..0.05], 3..7),
        short in 0.01..0.4_f64,
    ) {
        let mesh = wedge();
        let shape = ToolShape::ball(0.003).unwrap();
        let way: Vec<Pose> = places
            .iter()
            .map(|place| at(std::array::from_fn(|axis| {
                places[0][axis] + short * (place[axis] - places[0][axis])
            })))
            .collect();
        let (mut forth, mut back) = (cube(), cube());
        let mut removed = 0;
        for ends in way.windows(2) {
            removed += forth.carve_mesh(&mesh, ends[0], ends[1]);
            removed += forth.carve(&Sweep { shape, from: ends[0], to: ends[1] });
            prop_assert_eq!(forth.initial_units(), forth.remaining_units() + removed);
        }
        for ends in way.windows(2).rev() {
            back.carve(&Sweep { shape, from: ends[0], to: ends[1] });
            back.carve_mesh(&mesh, ends[0], ends[1]);
        }
        prop_assert_eq!(forth.hash(), back.hash());
        for ends in way.windows(2) {
            prop_assert_eq!(forth.carve_mesh(&mesh, ends[0], ends[1]), 0);
        }
    }
}

/// A tool made of the same mesh twice is the same tool, and another mesh another one.
#[test]
fn a_mesh_is_known_by_its_digest() {
    let of = |size_m| baked(cuboid(size_m)).digest();
    assert_eq!(of([0.01, 0.02, 0.03]), of([0.01, 0.02, 0.03]));
    assert_ne!(of([0.01, 0.02, 0.03]), of([0.01, 0.02, 0.030_000_000_1]));
}
