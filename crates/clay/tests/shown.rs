//! What a screen shows of clay: brick by brick the same closed surface as everywhere, found again where it has to be.

mod solid;

use std::collections::BTreeMap;

use proptest::prelude::*;
use solid::{Noise, Solid, clay_of};
use teleclay_clay::mirror::{COARSE_VOXELS, COARSENESS};
use teleclay_clay::{
    BRICK_EDGE, BRICK_VOXELS, BrickMesh, BrickView, Clay, Mesh, Mirror, SOLID, Shape,
};

/// Metres in a voxel.
const VOXEL_M: f64 = 1e-3;

/// Occupancy by the place of a voxel's centre, in voxels.
type Field = fn([f64; 3]) -> u8;

/// Occupancy of a voxel whose centre lies so many voxels inside of a plane.
fn band(depth: f64) -> u8 {
    (255.0 * (0.5 + depth / 2.0).clamp(0.0, 1.0)).round() as u8
}

/// A block of 42³ voxels with air around it.
fn block(at: [f64; 3]) -> u8 {
    let is_inside = |along: f64| (3.0..45.0).contains(&along);
    if at.into_iter().all(is_inside) {
        SOLID
    } else {
        0
    }
}

/// Along, across and diagonal to the bricks, and right through.
const CUTS: [(&str, Field); 4] = [
    ("along", |at| {
        block(at).min(band((at[1] - 20.4).hypot(at[2] - 43.0) - 7.3))
    }),
    ("across", |at| {
        block(at).min(band((at[0] - 16.0).hypot(at[2] - 45.0) - 9.1))
    }),
    ("diagonal", |at| {
        let across = (at[0] - at[1]) / 2.0_f64.sqrt();
        block(at).min(band(across.hypot(at[2] - 40.0) - 6.2))
    }),
    ("through", |at| {
        block(at).min(band((at[0] + 0.7 * at[1] - 40.0).abs() / 1.22 - 3.0))
    }),
];

fn voxels_of(brick: [u16; 3], mut field: impl FnMut([f64; 3]) -> u8) -> [u8; BRICK_VOXELS] {
    std::array::from_fn(|number| {
        let place = [number % 16, number / 16 % 16, number / 256];
        field(std::array::from_fn(|axis| {
            f64::from(brick[axis]) * 16.0 + place[axis] as f64 + 0.5
        }))
    })
}

fn coordinates([nx, ny, nz]: [u16; 3]) -> impl Iterator<Item = [u16; 3]> {
    (0..nz).flat_map(move |z| (0..ny).flat_map(move |y| (0..nx).map(move |x| [x, y, z])))
}

fn fill(mirror: &mut Mirror, mut field: impl FnMut([f64; 3]) -> u8) {
    for (index, at) in coordinates(mirror.counts()).enumerate() {
        mirror.replace(index as u32, BrickView::Voxels(&voxels_of(at, &mut field)));
    }
}

fn mirror_of(counts: [u16; 3], field: impl FnMut([f64; 3]) -> u8) -> Mirror {
    let mut mirror = Mirror::default();
    mirror.start_anew(counts).unwrap();
    fill(&mut mirror, field);
    mirror
}

/// Finds again what is stale.
fn renew(mirror: &mut Mirror, meshes: &mut BTreeMap<u32, BrickMesh>) {
    while let Some(index) = mirror.take_stale() {
        let mut mesh = BrickMesh::default();
        mirror.mesh(index, &mut mesh);
        meshes.insert(index, mesh);
    }
}

fn meshes_of(mirror: &mut Mirror) -> BTreeMap<u32, BrickMesh> {
    let mut meshes = BTreeMap::new();
    mirror.mark_all();
    renew(mirror, &mut meshes);
    meshes
}

/// All parts side by side, in metres.
fn together(meshes: &BTreeMap<u32, BrickMesh>) -> Mesh {
    let mut whole = Mesh::default();
    for mesh in meshes.values() {
        let before = whole.positions_m.len() as u32;
        let places = mesh.positions.as_chunks::<3>().0.iter();
        whole
            .positions_m
            .extend(places.map(|place| place.map(|along| along * VOXEL_M as f32)));
        let triangles = mesh.indices.as_chunks::<3>().0.iter();
        whole
            .triangles
            .extend(triangles.map(|corners| corners.map(|at| before + u32::from(at))));
    }
    whole
}

/// Volume inside, in voxels; fails where the surface is not closed.
fn volume_of(meshes: &BTreeMap<u32, BrickMesh>) -> f64 {
    let solid = Solid::of_mesh(&together(meshes)).unwrap_or_else(|error| panic!("{error}"));
    solid.volume_m3 / VOXEL_M.powi(3)
}

fn triangles_of(meshes: &BTreeMap<u32, BrickMesh>) -> usize {
    meshes.values().map(|mesh| mesh.indices.len() / 3).sum()
}

#[test]
fn a_fresh_block_is_closed_and_sharp_and_its_flat_faces_cost_little() {
    let mut mirror = mirror_of([4, 3, 2], |_| SOLID);
    let meshes = meshes_of(&mut mirror);
    let volume = volume_of(&meshes);
    assert!(
        (volume / (64.0 * 48.0 * 32.0) - 1.0).abs() < 1e-6,
        "{volume}"
    );
    // Two triangles for each face of a voxel on each of six sides, and at most half of them.
    let in_full = 2 * 2 * (64 * 48 + 48 * 32 + 32 * 64);
    assert!(
        triangles_of(&meshes) < in_full / 2,
        "{}",
        triangles_of(&meshes)
    );
}

#[test]
fn a_block_that_ends_within_a_voxel_is_flat_where_it_ends() {
    let top = |at: [f64; 3]| {
        if at[2] < 20.0 {
            SOLID
        } else if at[2] < 21.0 {
            77
        } else {
            0
        }
    };
    let meshes = meshes_of(&mut mirror_of([3, 3, 2], top));
    let in_full = 2 * (2 * 48 * 48 + 4 * 48 * 20);
    assert!(
        triangles_of(&meshes) < in_full * 3 / 5,
        "{}",
        triangles_of(&meshes)
    );
    let heights = together(&meshes)
        .positions_m
        .into_iter()
        .map(|at_m| at_m[2]);
    let highest = f64::from(heights.fold(0.0, f32::max)) / VOXEL_M;
    assert!((highest - 20.0 - 77.0 / 255.0).abs() < 0.01, "{highest}");
}

#[test]
fn cut_blocks_are_closed_and_hold_what_is_left() {
    for (name, field) in CUTS {
        let mut left = 0.0;
        let mut mirror = mirror_of([3, 3, 3], |at| {
            left += f64::from(field(at)) / 255.0;
            field(at)
        });
        let volume = volume_of(&meshes_of(&mut mirror));
        assert!(
            (volume / left - 1.0).abs() < 0.005,
            "{name}: {volume} of {left}"
        );
    }
}

/// Light on a ball tells a ball.
#[test]
fn a_ball_faces_away_from_its_centre() {
    let (centre, radius) = (24.3, 14.6);
    let distance = |at: [f64; 3]| {
        at.map(|along| (along - centre).powi(2))
            .iter()
            .sum::<f64>()
            .sqrt()
    };
    let meshes = meshes_of(&mut mirror_of([3, 3, 3], |at| band(radius - distance(at))));
    let mut vertices = 0;
    for mesh in meshes.values() {
        let facing = mesh.facing.as_chunks::<4>().0.iter();
        for (place, facing) in mesh.positions.as_chunks::<3>().0.iter().zip(facing) {
            let place = place.map(f64::from);
            let facing = facing.map(f64::from);
            let length = facing.iter().map(|n| n * n).sum::<f64>().sqrt();
            let cosine: f64 = (0..3)
                .map(|axis| (place[axis] - centre) / distance(place) * facing[axis] / length)
                .sum();
            assert!(cosine.min(1.0).acos() < 0.03, "{place:?} faces {facing:?}");
            assert!((distance(place) - radius).abs() < 0.2);
            assert!((facing[3], (length - 127.0).abs()) < (0.1, 1.0));
            vertices += 1;
        }
    }
    assert!(1000 < vertices, "{vertices}");
}

/// Screen and STL show one surface: the same cells have vertices in the same places, and where nothing is flat enough
/// for a fan the triangles are the same.
#[test]
fn a_screen_shows_the_surface_of_the_stl() {
    let mut noise = Noise(9);
    let clay = clay_of([37, 20, 33], VOXEL_M, |_| match noise.word() % 3 {
        0 => noise.word() as u8,
        1 => 0,
        _ => SOLID,
    });
    let mut mirror = mirror_of_clay(&clay);
    let meshes = meshes_of(&mut mirror);
    for dense in 0..clay.grid().brick_count() as u32 {
        let part = Mesh::of_brick(&clay, clay.grid().brick_index(dense).unwrap());
        let shown = together(&BTreeMap::from([(dense, meshes[&dense].clone())]));
        let corners = |mesh: &Mesh| {
            let all = mesh.triangles.iter();
            all.map(|corners| corners.map(|at| mesh.positions_m[at as usize]))
                .collect::<Vec<_>>()
        };
        let (wanted, got) = (corners(&part), corners(&shown));
        assert_eq!(wanted.len(), got.len());
        for (wanted, got) in wanted.as_flattened().iter().zip(got.as_flattened()) {
            for axis in 0..3 {
                let apart = f64::from((wanted[axis] - got[axis]).abs());
                assert!(apart < 1e-5 * VOXEL_M, "{wanted:?} and {got:?}");
            }
        }
    }
}

fn mirror_of_clay(clay: &Clay) -> Mirror {
    let mut mirror = Mirror::default();
    mirror.start_anew(clay.grid().bricks()).unwrap();
    for dense in 0..clay.grid().brick_count() as u32 {
        mirror.replace(dense, clay.brick(clay.grid().brick_index(dense).unwrap()));
    }
    mirror
}

#[test]
fn a_block_of_clay_looks_in_the_mirror_as_large_as_it_is() {
    let clay = Clay::new(
        &Shape::Block {
            size_m: [0.050, 0.040, 0.036],
        },
        VOXEL_M,
    )
    .unwrap();
    let volume = volume_of(&meshes_of(&mut mirror_of_clay(&clay)));
    assert!(
        (volume / (50.0 * 40.0 * 36.0) - 1.0).abs() < 1e-6,
        "{volume}"
    );
}

/// Where light does not fall evenly on a level face, every vertex of it is drawn: a hollow just below makes its
/// vertices face aside, though all lie in one plane.
#[test]
fn a_level_face_that_is_not_lit_evenly_is_no_fan() {
    let top = 24.0;
    let hollow = |at: [f64; 3]| {
        let is_over = at[..2].iter().all(|along| (18.0..20.0).contains(along));
        let is_air = top < at[2] || is_over && (20.0..22.0).contains(&at[2]);
        if is_air { 0 } else { SOLID }
    };
    let meshes = meshes_of(&mut mirror_of([3, 3, 2], hollow));
    let middle = &meshes[&(4 + 9)];
    let above = middle.positions.as_chunks::<3>().0.iter().filter(|place| {
        let [x, y, z] = place.map(f64::from);
        (z - top).abs() < 1e-6 && (18.5..19.5).contains(&x) && (18.5..19.5).contains(&y)
    });
    assert_eq!(above.count(), 1);
    volume_of(&meshes);
}

/// A brick of its own cannot make a mesh that 16 bits do not count: the worst clay there is, single voxels in air.
#[test]
fn vertices_of_a_brick_are_counted_by_sixteen_bits() {
    let mut mirror = mirror_of([3, 3, 3], |at| {
        if (at[0] + at[1] + at[2]).floor() as i32 % 2 == 0 {
            SOLID
        } else {
            0
        }
    });
    let meshes = meshes_of(&mut mirror);
    let most = meshes
        .values()
        .map(|mesh| mesh.positions.len() / 3)
        .max()
        .unwrap();
    assert!(10_000 < most && most < usize::from(u16::MAX), "{most}");
    volume_of(&meshes);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn any_occupancies_are_closed(seed in any::<u64>(), air in 0_u64..8) {
        let mut noise = Noise(seed);
        let mut mirror = mirror_of([2, 2, 2], |_| if noise.word() % 8 < air { 0 } else { noise.word() as u8 });
        volume_of(&meshes_of(&mut mirror));
    }

    /// Found again only where it is stale, the surface is the same as found anew: whatever is cut, and wherever.
    #[test]
    fn what_is_not_stale_is_not_changed(
        before in 0..CUTS.len(),
        centre in [0.0..48.0, 0.0..48.0, 0.0..48.0_f64],
        radius in 0.3..7.0_f64,
    ) {
        let (_, before) = CUTS[before];
        let after = |at: [f64; 3]| {
            let distance = (0..3).map(|axis| (at[axis] - centre[axis]).powi(2)).sum::<f64>().sqrt();
            before(at).min(band(distance - radius))
        };
        let mut mirror = mirror_of([3, 3, 3], before);
        let mut meshes = meshes_of(&mut mirror);
        fill(&mut mirror, after);
        prop_assert!(mirror.stale_count() < 27);
        renew(&mut mirror, &mut meshes);
        prop_assert!(meshes == meshes_of(&mut mirror_of([3, 3, 3], after)));
    }
}

#[test]
fn nothing_is_stale_when_a_brick_comes_again_unchanged() {
    let (_, field) = CUTS[2];
    let mut mirror = mirror_of([3, 3, 3], field);
    assert_eq!(mirror.stale_count(), 27);
    meshes_of(&mut mirror);
    fill(&mut mirror, field);
    assert_eq!((mirror.stale_count(), mirror.take_stale()), (0, None));
}

#[test]
fn only_the_brick_itself_is_stale_where_no_neighbour_sees_the_change() {
    let mut mirror = mirror_of([3, 3, 3], |_| SOLID);
    for (hole, stale) in [
        ([8, 8, 8], 1),
        ([2, 8, 8], 2),
        ([8, 3, 12], 1),
        ([8, 3, 13], 2),
        ([15, 0, 2], 8),
    ] {
        meshes_of(&mut mirror);
        let mut voxels = [SOLID; BRICK_VOXELS];
        voxels[hole[0] + 16 * (hole[1] + 16 * hole[2])] = 0;
        mirror.replace(13, BrickView::Voxels(&voxels));
        assert_eq!(mirror.stale_count(), stale, "{hole:?}");
        mirror.replace(13, BrickView::Full);
    }
}

#[test]
fn a_grid_beyond_every_server_is_refused_and_changes_nothing() {
    let mut mirror = mirror_of([1, 2, 1], |_| SOLID);
    let error = mirror.start_anew([32, 65, 1]).unwrap_err();
    assert_eq!(
        error.to_string(),
        "65 bricks along axis 1, a grid has at most 64"
    );
    assert!(mirror.start_anew([u16::MAX; 3]).is_err());
    assert_eq!(
        (mirror.counts(), mirror.brick([0, 1, 0])),
        ([1, 2, 1], BrickView::Full)
    );
    // The largest there is, solid throughout, fits in a page many times over.
    mirror.start_anew([64, 64, 32]).unwrap();
    for index in 0..64 * 64 * 32 {
        mirror.replace(index, BrickView::Full);
    }
    assert_eq!(mirror.brick([63, 63, 31]), BrickView::Full);
}

#[test]
fn what_was_is_forgotten_when_a_grid_starts_anew() {
    let mut mirror = mirror_of([2, 2, 2], |_| SOLID);
    meshes_of(&mut mirror);
    mirror.start_anew([2, 2, 2]).unwrap();
    assert_eq!(mirror.stale_count(), 8);
    assert_eq!(triangles_of(&meshes_of(&mut mirror)), 0);
    // Bricks and meshes beyond the grid, as of a message that came too late, are nothing.
    mirror.replace(8, BrickView::Full);
    mirror.replace_eighth(8, [0; 3], BrickView::Full);
    assert_eq!(
        (mirror.stale_count(), mirror.coarse(8)),
        (0, [0; COARSE_VOXELS])
    );
}

#[test]
fn voxels_that_are_all_alike_are_known_again() {
    let mut mirror = mirror_of([1, 1, 1], |_| SOLID);
    assert_eq!(mirror.brick([0; 3]), BrickView::Full);
    mirror.replace(0, BrickView::Voxels(&[0; BRICK_VOXELS]));
    assert_eq!(mirror.brick([0; 3]), BrickView::Empty);
}

/// Clay of which no axis may be taken for another, and whose means are no whole numbers.
fn speckled(at: [f64; 3]) -> u8 {
    let [x, y, z] = at.map(|along| along.floor() as u32);
    ((7 * x + 13 * y + 29 * z + x * y) % 256) as u8
}

/// Feeds a mirror of half the resolution with a grid of 3 by 2 by 2 bricks.
fn halved(mirror: &mut Mirror, mut field: impl FnMut([f64; 3]) -> u8) {
    for at in coordinates([3, 2, 2]) {
        let index = u32::from(at[0] / 2);
        let eighth = at.map(|along| usize::from(along % 2));
        mirror.replace_eighth(index, eighth, BrickView::Voxels(&voxels_of(at, &mut field)));
    }
}

#[test]
fn half_the_resolution_keeps_every_voxels_clay_in_its_place() {
    let mut mirror = Mirror::default();
    mirror.start_anew([2, 1, 1]).unwrap();
    halved(&mut mirror, speckled);
    for [x, y, z] in [
        [0, 0, 0],
        [17, 3, 9],
        [23, 15, 1],
        [9, 12, 15],
        [31, 15, 15],
    ] {
        let mut sum = 0;
        for eighth in 0..8 {
            let fine = [
                2 * x + (eighth & 1),
                2 * y + (eighth >> 1 & 1),
                2 * z + (eighth >> 2),
            ];
            if fine[0] < 48 {
                sum += u32::from(speckled(fine.map(f64::from)));
            }
        }
        let at = (x % 16 + 16 * (y + 16 * z)) as usize;
        let got = match mirror.brick([(x / 16) as u16, 0, 0]) {
            BrickView::Voxels(voxels) => voxels[at],
            BrickView::Empty => 0,
            BrickView::Full => SOLID,
        };
        assert_eq!(u32::from(got), (sum + 4) / 8, "{x}, {y}, {z}");
    }
}

#[test]
fn half_the_resolution_changes_only_the_eighth_that_a_brick_is_of() {
    let mut mirror = Mirror::default();
    mirror.start_anew([2, 1, 1]).unwrap();
    halved(&mut mirror, |_| SOLID);
    assert_eq!(mirror.brick([0; 3]), BrickView::Full);
    mirror.replace_eighth(0, [1, 1, 0], BrickView::Empty);
    let BrickView::Voxels(voxels) = mirror.brick([0; 3]) else {
        panic!("an eighth is gone");
    };
    for (number, &voxel) in voxels.iter().enumerate() {
        let [x, y, z] = [number % 16, number / 16 % 16, number / 256];
        let is_gone = 8 <= x && 8 <= y && z < 8;
        assert_eq!(voxel, if is_gone { 0 } else { SOLID });
    }
    mirror.replace_eighth(0, [1, 1, 0], BrickView::Full);
    assert_eq!(mirror.brick([0; 3]), BrickView::Full);
}

#[test]
fn coarse_occupancies_are_the_means_of_their_blocks() {
    let mut mirror = mirror_of([2, 1, 1], speckled);
    let edge = BRICK_EDGE / COARSENESS;
    for brick in 0..2 {
        let coarse = mirror.coarse(brick as u32);
        for (number, &got) in coarse.iter().enumerate() {
            let [x, y, z] = [number % edge, number / edge % edge, number / edge / edge];
            let mut sum = 0.0;
            for within in 0..64 {
                let [i, j, k] = [within % 4, within / 4 % 4, within / 16];
                let at = [16 * brick + 4 * x + i, 4 * y + j, 4 * z + k];
                sum += f64::from(speckled(at.map(|along| along as f64)));
            }
            assert!(
                (f64::from(got) - sum / 64.0).abs() <= 0.5,
                "{got} is {sum} / 64"
            );
        }
    }
    mirror.replace(0, BrickView::Full);
    mirror.replace(1, BrickView::Empty);
    assert_eq!(mirror.coarse(0), [SOLID; COARSE_VOXELS]);
    assert_eq!(mirror.coarse(1), [0; COARSE_VOXELS]);
}
