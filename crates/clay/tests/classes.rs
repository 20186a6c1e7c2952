//! Clay of several classes of material: what each answers, against closed forms; what they cost; their bytes.

use std::f64::consts::PI;
use std::sync::Arc;

use proptest::prelude::*;
use teleclay_clay::classes::Layer;
use teleclay_clay::{
    BRICK_VOXELS, Blade, BladeDimensions, Classes, ClassesError, Clay, Coefficients, ContactState,
    Grid, MAX_CLASSES, Material, Motion, Pose, Regime, Response, Shape, Tool, ToolShape,
};

const EDGE_M: f64 = 0.048;
const VOXEL_M: f64 = 1e-3;
const TICK_S: f64 = 1e-3;

fn material(viscosity: f64, yield_stress: f64, stiffness: f64) -> Material {
    Material::new(Coefficients {
        viscosity_pa_s_per_m: viscosity,
        yield_stress_pa: yield_stress,
        stiffness_pa: stiffness,
    })
    .unwrap()
}

fn at(position_m: [f64; 3]) -> Pose {
    Pose::quantise(position_m).unwrap()
}

fn cube() -> Clay {
    Clay::new(
        &Shape::Block {
            size_m: [EDGE_M; 3],
        },
        VOXEL_M,
    )
    .unwrap()
}

/// A cube with a layer on top.
fn layered(thickness_m: f64, top: Material) -> Clay {
    let mut clay = cube();
    let layer = Layer {
        thickness_m,
        material: top,
    };
    let classes = Classes::layers(clay.grid(), EDGE_M, &[layer]).unwrap();
    clay.assign_classes(Some(Arc::new(classes))).unwrap();
    clay
}

/// A cube whose further class fills what `is_further` says, by voxel.
fn parted(further: Material, is_further: impl Fn([usize; 3]) -> bool) -> Clay {
    let mut clay = cube();
    let grid = *clay.grid();
    let classes = Classes::new(&grid, vec![further], |index, voxels| {
        let first = grid.brick_coordinates(index).map(|at| usize::from(at) * 16);
        for (place, class) in voxels.iter_mut().enumerate() {
            let voxel = [place % 16, place / 16 % 16, place / 256];
            let voxel = std::array::from_fn(|axis| first[axis] + voxel[axis]);
            *class = u8::from(is_further(voxel));
        }
    });
    clay.assign_classes(Some(Arc::new(classes.unwrap())))
        .unwrap();
    clay
}

/// Goes from one place to another at a speed; gives what every tick answered.
fn stroke(
    clay: &mut Clay,
    tool: &Tool,
    first: &Material,
    (from_m, to_m): ([f64; 3], [f64; 3]),
    speed_m_s: f64,
) -> Vec<Response> {
    let mut contact = ContactState::default();
    let way_m: [f64; 3] = std::array::from_fn(|axis| to_m[axis] - from_m[axis]);
    let length_m = way_m.iter().map(|m| m * m).sum::<f64>().sqrt();
    let velocity_m_s = way_m.map(|m| m / length_m * speed_m_s);
    let ticks = (length_m / speed_m_s / TICK_S) as usize;
    let mut pose = at(from_m);
    (1..=ticks)
        .map(|tick| {
            let share = tick as f64 / ticks as f64;
            let to = at(std::array::from_fn(|axis| {
                from_m[axis] + way_m[axis] * share
            }));
            let motion = Motion::new(pose, to, velocity_m_s).unwrap();
            pose = to;
            clay.work(tool, first, &motion, &mut contact).response
        })
        .collect()
}

fn norm(a: [f64; 3]) -> f64 {
    a.iter().map(|a| a * a).sum::<f64>().sqrt()
}

/// A drill that goes down through one class into the other answers in the ratio that was set: the acceptance of a
/// drilled volume, on each law that the classes may have.
#[test]
fn a_drill_feels_each_class_in_the_ratio_that_was_set() {
    let cases = [
        (material(2e5, 0.0, 0.0), material(6e5, 0.0, 0.0), 3.0),
        (material(0.0, 4e4, 0.0), material(0.0, 1e4, 0.0), 0.25),
        (material(0.0, 2e4, 2e6), material(0.0, 5e4, 5e6), 2.5),
        (material(1e5, 1e4, 1e6), material(3e5, 3e4, 9e6), 3.0),
    ];
    let tool = Tool::new(ToolShape::ball(0.005).unwrap());
    for (below, above, ratio) in cases {
        let mut clay = layered(0.024, above);
        let way = ([0.0243, 0.0241, 0.0500], [0.0243, 0.0241, 0.0060]);
        let speed_m_s = 0.02;
        let seen = stroke(&mut clay, &tool, &below, way, speed_m_s);
        let height_m = |tick: usize| way.0[2] - speed_m_s * TICK_S * tick as f64;
        let mean = |from_m: f64, to_m: f64| {
            let forces: Vec<f64> = seen
                .iter()
                .enumerate()
                .filter(|(tick, _)| (to_m..from_m).contains(&height_m(*tick)))
                .map(|(_, response)| response.force_n[2])
                .collect();
            assert!(100 < forces.len());
            let mean = forces.iter().sum::<f64>() / forces.len() as f64;
            let (least, most) = forces
                .iter()
                .fold((f64::INFINITY, 0.0_f64), |(a, b), f| (a.min(*f), b.max(*f)));
            assert!(
                (most - least) / mean < 0.05,
                "ripple of {}",
                (most - least) / mean
            );
            mean
        };
        // Wholly in the upper class, and wholly in the lower one.
        let (upper_n, lower_n) = (mean(0.038, 0.031), mean(0.021, 0.010));
        let got = upper_n / lower_n;
        assert!((got / ratio - 1.0).abs() < 0.02, "{got}, set {ratio}");
        let c = below.coefficients();
        let pressure_pa = c.yield_stress_pa + c.viscosity_pa_s_per_m * speed_m_s;
        let want_n = pressure_pa * PI * 0.005 * 0.005;
        assert!(
            (lower_n / want_n - 1.0).abs() < 0.02,
            "{lower_n} N, law {want_n} N"
        );
    }
}

/// A flat face astride a boundary feels each class over its own part of the area, wherever between the voxels it is.
#[test]
fn a_face_astride_a_boundary_feels_the_sum_of_the_parts() {
    let (below, above) = (material(1e5, 0.0, 0.0), material(7e5, 0.0, 0.0));
    let dimensions = BladeDimensions {
        width_m: 0.010,
        height_m: 0.016,
        thickness_m: 0.003,
    };
    let tool = Tool::new(ToolShape::Blade(Blade::new(dimensions).unwrap()));
    for lower_edge_m in [0.010, 0.0123, 0.0147, 0.0181, 0.021] {
        let mut clay = layered(0.024, above);
        let way = ([0.012, 0.024, lower_edge_m], [0.030, 0.024, lower_edge_m]);
        let seen = stroke(&mut clay, &tool, &below, way, 0.1);
        let force_n = -seen.last().unwrap().force_n[0];
        let share_above = ((lower_edge_m + 0.016 - 0.024) / 0.016).clamp(0.0, 1.0);
        let want_n = 0.1 * 0.010 * 0.016 * (1e5 * (1.0 - share_above) + 7e5 * share_above);
        assert!(
            (force_n / want_n - 1.0).abs() < 0.02,
            "{lower_edge_m}: {force_n} N, {want_n} N"
        );
    }
}

/// Below yield two classes are one spring: `K = 2 E sqrt(A / pi)` with the mean modulus by area, up to
/// `sum sigma_c A_c`.
#[test]
fn below_yield_two_classes_are_one_spring() {
    let (left, right) = (material(0.0, 1e4, 1e6), material(0.0, 5e4, 4e6));
    let radius_m: f64 = 0.005;
    let area_m2 = PI * radius_m * radius_m;
    let tool = Tool::new(ToolShape::ball(radius_m).unwrap());
    // The boundary lies in the middle of the ball's way.
    let mut clay = parted(right, |[x, ..]| 24 <= x);
    let path = ([0.024, 0.024, 0.0495], [0.024, 0.024, 0.020]);
    stroke(&mut clay, &tool, &left, path, 0.05);
    let mut contact = ContactState::default();
    let mut pose = at(path.1);
    let mut forces = Vec::new();
    for tick in 1..=200 {
        let to = at([0.024, 0.024, 0.020 - 1e-6 * f64::from(tick)]);
        let motion = Motion::new(pose, to, [0.0, 0.0, -1e-3]).unwrap();
        pose = to;
        let response = clay.work(&tool, &left, &motion, &mut contact).response;
        forces.push((response.force_n[2], response.regime));
    }
    let modulus_pa = (1e6 + 4e6) / 2.0;
    let stiffness_n_per_m = 2.0 * modulus_pa * (area_m2 / PI).sqrt();
    let yield_n = area_m2 * (1e4 + 5e4) / 2.0;
    let elastic = forces
        .iter()
        .filter(|(_, regime)| *regime == Regime::Elastic)
        .count();
    assert!(20 < elastic && elastic < 190, "{elastic}");
    for (tick, (force_n, regime)) in forces.iter().enumerate() {
        let want_n = (stiffness_n_per_m * 1e-6 * (tick + 1) as f64).min(yield_n);
        assert!(
            (force_n - want_n).abs() < 0.02 * yield_n,
            "{tick}: {force_n}, {want_n} {regime:?}"
        );
    }
}

/// What no classes and classes of one material answer is the same, and so is what is cut.
#[test]
fn classes_of_the_same_material_change_nothing_that_is_felt() {
    for same in [
        material(2e5, 0.0, 0.0),
        material(1e5, 2e4, 0.0),
        material(5e4, 2e4, 1e6),
    ] {
        for shape in [ToolShape::ball(0.0048).unwrap(), ToolShape::paper_blade()] {
            let tool = Tool::new(shape);
            let way = ([0.010, 0.020, 0.040], [0.038, 0.027, 0.018]);
            let mut one = cube();
            let mut several = parted(same, |[x, y, z]| (x / 3 + y / 5 + z / 2) % 2 == 0);
            let want = stroke(&mut one, &tool, &same, way, 0.15);
            let got = stroke(&mut several, &tool, &same, way, 0.15);
            for (want, got) in want.iter().zip(&got) {
                let difference: [f64; 3] =
                    std::array::from_fn(|axis| want.force_n[axis] - got.force_n[axis]);
                assert!(
                    norm(difference) <= 1e-5 * norm(want.force_n) + 1e-9,
                    "{want:?} {got:?}"
                );
                assert!(
                    (want.engaged_area_m2 - got.engaged_area_m2).abs()
                        < 1e-5 * want.engaged_area_m2 + 1e-15
                );
                assert_eq!(want.regime, got.regime);
            }
            assert_eq!(one.removed_units(), several.removed_units());
        }
    }
}

#[test]
fn cutting_takes_clay_away_and_leaves_the_classes() {
    let mut clay = layered(0.02, material(6e5, 0.0, 0.0));
    let before = Arc::clone(clay.classes().unwrap());
    let tool = Tool::new(ToolShape::ball(0.006).unwrap());
    let way = ([0.0243, 0.0241, 0.0500], [0.0243, 0.0241, 0.0060]);
    stroke(&mut clay, &tool, &material(2e5, 0.0, 0.0), way, 0.1);
    assert!(0 < clay.removed_units());
    assert!(Arc::ptr_eq(&before, clay.classes().unwrap()));
    assert!(
        Arc::ptr_eq(&before, clay.clone().classes().unwrap()),
        "a copy shares them"
    );
    // The boundary is between the voxels at 28 mm.
    for (z, class) in [(0, 0), (27, 0), (28, 1), (47, 1), (48, 0), (-1, 0)] {
        assert_eq!(before.at([24, 24, z]), class, "{z}");
    }
}

#[test]
fn the_hash_of_one_class_is_as_it_was_and_others_have_their_own() {
    let soft = material(1e5, 0.0, 0.0);
    let mut hashes = vec![cube().hash()];
    for (thickness_m, top) in [
        (0.010, soft),
        (0.011, soft),
        (0.010, material(1.1e5, 0.0, 0.0)),
        (0.048, soft),
    ] {
        let hash = layered(thickness_m, top).hash();
        assert_eq!(hash, layered(thickness_m, top).hash());
        hashes.push(hash);
    }
    hashes.sort_unstable();
    hashes.dedup();
    assert_eq!(hashes.len(), 5);
    let mut again = layered(0.010, soft);
    again.assign_classes(None).unwrap();
    assert_eq!(again.hash(), cube().hash());
}

#[test]
fn layers_cost_next_to_nothing() {
    let grid = Grid::of_voxels([1024, 1024, 512], 1e-4).unwrap();
    let layers: Vec<Layer> = (1..MAX_CLASSES)
        .map(|layer| Layer {
            thickness_m: 0.00313,
            material: material(1e5 * layer as f64, 0.0, 0.0),
        })
        .collect();
    let classes = Classes::layers(&grid, 0.0512, &layers).unwrap();
    let bytes = classes.memory_bytes();
    assert!(bytes < 8 * grid.brick_count(), "{bytes} bytes");
    assert!(
        classes.encoded().len() < 64 * 1024,
        "{}",
        classes.encoded().len()
    );
}

#[test]
fn what_are_no_classes_is_refused() {
    let grid = Grid::of_voxels([20, 20, 20], 1e-3).unwrap();
    let soft = material(1e5, 0.0, 0.0);
    let count = |further: usize| Classes::new(&grid, vec![soft; further], |_, _| {}).err();
    assert_eq!(count(0), Some(ClassesError::Count { got: 1 }));
    assert_eq!(count(7), None);
    assert_eq!(count(8), Some(ClassesError::Count { got: 9 }));
    let unknown = Classes::new(&grid, vec![soft], |index, voxels| {
        voxels[1] = if index.as_u32() == 3 { 2 } else { 1 };
    });
    assert_eq!(
        unknown.err(),
        Some(ClassesError::Unknown {
            brick: 3,
            got: 2,
            classes: 2
        })
    );
    for got_m in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let layer = Layer {
            thickness_m: got_m,
            material: soft,
        };
        assert!(matches!(
            Classes::layers(&grid, 0.02, &[layer]),
            Err(ClassesError::Thickness { index: 0, .. })
        ));
    }
    let classes = Classes::new(&grid, vec![soft], |_, _| {}).unwrap();
    assert!(matches!(
        cube().assign_classes(Some(Arc::new(classes))),
        Err(ClassesError::OtherGrid { .. })
    ));
}

fn random_classes(seed: u64, further: usize, coarse: usize) -> (Grid, Classes) {
    let grid = Grid::of_voxels([37, 16, 50], 1e-3).unwrap();
    let mut state = seed | 1;
    let mut draw = move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (state >> 40) as usize
    };
    let materials = (0..further)
        .map(|_| material(draw() as f64, draw() as f64, 0.0))
        .collect();
    let classes = Classes::new(&grid, materials, |_, voxels| {
        if draw() % 3 == 0 {
            voxels.fill((draw() % (further + 1)) as u8);
            return;
        }
        for run in voxels.chunks_mut(coarse) {
            run.fill((draw() % (further + 1)) as u8);
        }
    });
    (grid, classes.unwrap())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn bytes_give_back_the_classes(seed: u64, further in 1_usize..8, coarse in prop_oneof![Just(1_usize), 2_usize..4096]) {
        let (grid, classes) = random_classes(seed, further, coarse);
        let read = Classes::decode(&grid, classes.encoded()).unwrap();
        prop_assert!(read == classes);
        prop_assert_eq!(read.further(), classes.further());
        for z in -1..51 {
            for x in -1..38 {
                prop_assert_eq!(read.at([x, 7, z]), classes.at([x, 7, z]));
            }
        }
        // No worse than a byte for each voxel, and a few for each brick.
        prop_assert!(classes.encoded().len() <= grid.brick_count() * (BRICK_VOXELS + 8) + 256);
    }

    #[test]
    fn whatever_the_bytes_nothing_panics_and_nothing_is_read_in_two_ways(
        seed: u64,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        cut in any::<prop::sample::Index>(),
        is_cut: bool,
    ) {
        let (grid, classes) = random_classes(seed, 3, 64);
        let mut bytes = classes.encoded().to_vec();
        for (place, byte) in changes {
            let place = place.index(bytes.len());
            bytes[place] = byte;
        }
        if is_cut {
            bytes.truncate(cut.index(bytes.len()));
        }
        if let Ok(read) = Classes::decode(&grid, &bytes) {
            prop_assert_eq!(read.encoded(), &bytes[..]);
        }
    }

    /// Round any closed loop through classes of all kinds the tool never gets out more than it put in.
    #[test]
    fn no_closed_loop_through_classes_yields_energy(
        laws in prop::collection::vec(
            (prop_oneof![Just(0.0), 1e3..1e6], prop_oneof![Just(0.0), 1e2..1e5], prop_oneof![Just(0.0), 1e4..1e7]),
            2..6,
        ),
        blade in any::<bool>(),
        grain in 1_usize..9,
        start in [0.018..0.030, 0.018..0.030, 0.030..0.052],
        corners in prop::collection::vec([-0.004..0.004, -0.004..0.004, -0.004..0.004], 1..6),
        steps in 1_usize..40,
    ) {
        let shape = if blade { ToolShape::paper_blade() } else { ToolShape::ball(0.0048).unwrap() };
        let laws: Vec<Material> = laws.into_iter().map(|(k, s, e)| material(k, s, e)).collect();
        let mut clay = cube();
        let grid = *clay.grid();
        let classes = Classes::new(&grid, laws[1..].to_vec(), |index, voxels| {
            let first = grid.brick_coordinates(index).map(|at| usize::from(at) * 16);
            for (place, class) in voxels.iter_mut().enumerate() {
                let [x, y, z] = [place % 16 + first[0], place / 16 % 16 + first[1], place / 256 + first[2]];
                *class = ((x / grain + 2 * (y / grain) + 3 * (z / grain)) % laws.len()) as u8;
            }
        });
        clay.assign_classes(Some(Arc::new(classes.unwrap()))).unwrap();
        let tool = Tool::new(shape);
        let mut contact = ContactState::default();
        let (mut given_j, mut dissipated_j, mut handled_j) = (0.0, 0.0, 0.0_f64);
        let place = |corner: [f64; 3]| at(std::array::from_fn(|axis| start[axis] + corner[axis]));
        let mut from = place([0.0; 3]);
        for corner in corners.iter().copied().chain([[0.0; 3]]) {
            let (begin, end) = (from.position_m(), place(corner).position_m());
            for step in 1..=steps {
                let share = step as f64 / steps as f64;
                let to = at(std::array::from_fn(|axis| begin[axis] + (end[axis] - begin[axis]) * share));
                let way_m = to.displacement_from_m(from);
                let motion = Motion::new(from, to, way_m.map(|m| m / TICK_S)).unwrap();
                let response = clay.work(&tool, &laws[0], &motion, &mut contact).response;
                let work_j = -(0..3).map(|axis| response.force_n[axis] * way_m[axis]).sum::<f64>();
                given_j += work_j;
                handled_j += work_j.abs();
                dissipated_j += response.dissipated_j;
                prop_assert!(-1e-12 * handled_j <= given_j, "{given_j} J of {handled_j} J");
                prop_assert!((given_j - dissipated_j - response.stored_j).abs() <= 1e-9 * handled_j + 1e-15);
                from = to;
            }
        }
    }
}
