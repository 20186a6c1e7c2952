//! What the hand would feel: areas against closed forms, forces against the law, and no ripple on the way.

use std::f64::consts::{FRAC_1_SQRT_2, PI};

use proptest::prelude::*;
use teleclay_clay::{
    BrickView, Clay, Coefficients, ContactState, Material, Motion, Pose, RIGID_YIELD_SPEED_M_S,
    Regime, Shape, SteppedBlock, Sweep, Tool, ToolShape, Worked,
};

const VOXEL_M: f64 = 5e-4;
const TICK_S: f64 = 1e-3;
const EDGE_M: f64 = 0.048;

fn at(position_m: [f64; 3]) -> Pose {
    Pose::quantise(position_m).unwrap()
}

fn material(viscosity_pa_s_per_m: f64, yield_stress_pa: f64, stiffness_pa: f64) -> Material {
    Material::new(Coefficients {
        viscosity_pa_s_per_m,
        yield_stress_pa,
        stiffness_pa,
    })
    .unwrap()
}

fn norm(v: [f64; 3]) -> f64 {
    (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt()
}

/// A tool on a straight way at constant speed.
struct Stroke {
    clay: Clay,
    tool: Tool,
    material: Material,
    contact: ContactState,
    position_m: [f64; 3],
    velocity_m_s: [f64; 3],
}

impl Stroke {
    /// In a cube of fresh clay of 48 mm.
    fn in_cube(shape: ToolShape, start_m: [f64; 3], velocity_m_s: [f64; 3]) -> Self {
        Self {
            clay: Clay::new(
                &Shape::Block {
                    size_m: [EDGE_M; 3],
                },
                VOXEL_M,
            )
            .unwrap(),
            tool: Tool::new(shape),
            material: Material::default(),
            contact: ContactState::default(),
            position_m: start_m,
            velocity_m_s,
        }
    }

    fn with(mut self, material: Material) -> Self {
        self.material = material;
        self
    }

    /// Cuts the way here from a tool's length behind, as if the stroke had begun there.
    fn already_under_way(mut self) -> Self {
        let speed = norm(self.velocity_m_s);
        let behind = std::array::from_fn(|axis| {
            self.position_m[axis] - 0.02 * self.velocity_m_s[axis] / speed
        });
        let sweep = Sweep {
            shape: *self.tool.shape(),
            from: at(behind),
            to: at(self.position_m),
        };
        self.clay.carve(&sweep);
        self
    }

    fn tick(&mut self) -> Worked {
        let from = at(self.position_m);
        self.position_m =
            std::array::from_fn(|axis| self.position_m[axis] + self.velocity_m_s[axis] * TICK_S);
        let motion = Motion::new(from, at(self.position_m), self.velocity_m_s).unwrap();
        self.clay
            .work(&self.tool, &self.material, &motion, &mut self.contact)
    }

    /// Forces along the way, N, over so many voxels, by as many ticks as that takes.
    fn resistance_n(&mut self, voxels: f64) -> Vec<f64> {
        let speed = norm(self.velocity_m_s);
        let ticks = (voxels * VOXEL_M / (speed * TICK_S)).ceil() as usize;
        (0..ticks)
            .map(|_| {
                let force_n = self.tick().response.force_n;
                -(0..3)
                    .map(|axis| force_n[axis] * self.velocity_m_s[axis])
                    .sum::<f64>()
                    / speed
            })
            .collect()
    }
}

fn assert_steady(forces_n: &[f64], want_n: f64, error: f64, ripple: f64, what: &str) {
    let low = forces_n.iter().copied().fold(f64::INFINITY, f64::min);
    let high = forces_n.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mean = forces_n.iter().sum::<f64>() / forces_n.len() as f64;
    assert!(
        (mean / want_n - 1.0).abs() < error,
        "{what}: {mean} N, wanted {want_n} N"
    );
    assert!(
        (high - low) / mean < ripple,
        "{what}: from {low} N to {high} N"
    );
}

const SPEEDS_M_S: [f64; 4] = [5e-4, 0.02, 0.125, 0.5];

#[test]
fn a_ball_in_clay_feels_its_disc_at_every_speed_in_every_direction() {
    for radius_m in [0.0032, 0.0064] {
        for direction in [
            [1.0, 0.0, 0.0],
            [0.0, -1.0, 0.0],
            [0.0, 0.0, 1.0],
            [FRAC_1_SQRT_2, FRAC_1_SQRT_2, 0.0],
            [0.6, -0.64, -0.48],
        ] {
            for speed in SPEEDS_M_S {
                let middle = [0.0241, 0.02407, 0.02403];
                let shape = ToolShape::ball(radius_m).unwrap();
                let mut stroke = Stroke::in_cube(shape, middle, direction.map(|d| d * speed))
                    .already_under_way();
                let forces_n = stroke.resistance_n(if speed < 1e-3 { 1.5 } else { 12.0 });
                let want_n = 2e5 * PI * radius_m * radius_m * speed;
                assert_steady(
                    &forces_n,
                    want_n,
                    0.01,
                    0.01,
                    &format!("{radius_m} {direction:?} {speed}"),
                );
            }
        }
    }
}

#[test]
fn a_ball_half_sunk_feels_half_of_it_and_deeper_or_shallower_the_segment() {
    let radius_m = 0.0064;
    let shape = ToolShape::ball(radius_m).unwrap();
    for (share, error) in [(0.0, 0.02), (0.5, 0.02), (-0.5, 0.05)] {
        for direction in [[1.0, 0.0, 0.0], [FRAC_1_SQRT_2, -FRAC_1_SQRT_2, 0.0]] {
            for speed in SPEEDS_M_S {
                // The ball's middle is this share of its radius below the top of the block.
                let start_m = [0.0241, 0.02407, EDGE_M - share * radius_m];
                let mut stroke = Stroke::in_cube(shape, start_m, direction.map(|d| d * speed))
                    .already_under_way();
                let forces_n = stroke.resistance_n(if speed < 1e-3 { 1.5 } else { 12.0 });
                // The segment of the disc below the top, which is at the angle acos(share) from straight up.
                let angle = (-share).acos();
                let segment_m2 = radius_m * radius_m * (angle - angle.sin() * angle.cos());
                let want_n = 2e5 * segment_m2 * speed;
                assert_steady(
                    &forces_n,
                    want_n,
                    error,
                    0.02,
                    &format!("{share} {direction:?} {speed}"),
                );
            }
        }
    }
}

#[test]
fn the_blade_feels_its_width_times_its_depth() {
    for depth_m in [0.01, 0.02, 0.03] {
        // Along, across and askew; where voxels are off their places too.
        for (direction, width_m) in [
            ([1.0, 0.0, 0.0], 0.010),
            ([0.0, 1.0, 0.0], 0.002),
            ([FRAC_1_SQRT_2, FRAC_1_SQRT_2, 0.0], 0.012 * FRAC_1_SQRT_2),
        ] {
            for speed in SPEEDS_M_S {
                for off_m in [0.0, 1.7e-4] {
                    let start_m = [0.0241, 0.0243 + off_m, EDGE_M - depth_m];
                    let velocity_m_s = direction.map(|d| d * speed);
                    let mut stroke =
                        Stroke::in_cube(ToolShape::paper_blade(), start_m, velocity_m_s)
                            .already_under_way();
                    let forces_n = stroke.resistance_n(if speed < 1e-3 { 1.5 } else { 12.0 });
                    let want_n = 2e5 * width_m * depth_m * speed;
                    assert_steady(
                        &forces_n,
                        want_n,
                        0.02,
                        0.01,
                        &format!("{depth_m} {direction:?} {speed}"),
                    );
                }
            }
        }
    }
}

/// The published experiment: 20, 40 and 60 N s/m over its three steps, and free before the first.
#[test]
fn the_stepped_block_has_the_papers_damping() {
    let clay = Clay::new(&Shape::Stepped(SteppedBlock::paper()), VOXEL_M).unwrap();
    let mut stroke = Stroke {
        clay,
        tool: Tool::new(ToolShape::paper_blade()),
        material: Material::default(),
        contact: ContactState::default(),
        position_m: [0.0, 0.032, 0.010],
        velocity_m_s: [0.04, 0.0, 0.0],
    };
    let mut inside = [0; 4];
    while stroke.position_m[0] < 0.115 {
        let worked = stroke.tick();
        let damping = -worked.response.force_n[0] / 0.04;
        let face_m = stroke.position_m[0] + 0.001;
        for (range, edges_m, want) in [
            (0, [0.0, 0.03], 0.0),
            (1, [0.03, 0.06], 20.0),
            (2, [0.06, 0.09], 40.0),
            (3, [0.09, 0.12], 60.0),
        ] {
            // Within a voxel of an edge the area changes over.
            if edges_m[0] + 2.0 * VOXEL_M < face_m && face_m < edges_m[1] - 2.0 * VOXEL_M {
                assert!(
                    (damping - want).abs() < 0.02 * 60.0_f64.min(want) + 1e-9,
                    "{damping} N s/m at {face_m} m"
                );
                inside[range] += 1;
            }
        }
    }
    assert!(inside.iter().all(|&ticks| 500 < ticks), "{inside:?}");
}

#[test]
fn bingham_clay_yields_at_its_stress_and_flows_on_top_of_it() {
    let radius_m = 0.0064;
    let area_m2 = PI * radius_m * radius_m;
    let shape = ToolShape::ball(radius_m).unwrap();
    for stiffness_pa in [0.0, 4e5] {
        for speed in SPEEDS_M_S {
            let mut stroke = Stroke::in_cube(shape, [0.02, 0.0243, 0.0241], [speed, 0.0, 0.0])
                .already_under_way()
                .with(material(1e5, 8e3, stiffness_pa));
            // The spring loads over the first voxel.
            let _loading = stroke.resistance_n(1.0);
            let forces_n = stroke.resistance_n(if speed < 1e-3 { 1.0 } else { 8.0 });
            let want_n = (8e3 + 1e5 * speed) * area_m2;
            assert_steady(
                &forces_n,
                want_n,
                0.01,
                0.01,
                &format!("{stiffness_pa} {speed}"),
            );
        }
    }
}

#[test]
fn below_yield_the_clay_is_a_flat_punchs_spring_and_lets_go_of_what_it_stored() {
    let radius_m = 0.0064;
    let area_m2 = PI * radius_m * radius_m;
    let stiffness_n_per_m = 2.0 * 4e5 * (area_m2 / PI).sqrt();
    let yield_n = 8e3 * area_m2;
    let shape = ToolShape::ball(radius_m).unwrap();
    let mut stroke = Stroke::in_cube(shape, [0.02, 0.0243, 0.0241], [1e-3, 0.0, 0.0])
        .already_under_way()
        .with(material(0.0, 8e3, 4e5));
    let start_m = stroke.position_m[0];
    let most_m = yield_n / stiffness_n_per_m;
    let mut regimes = [0; 2];
    // Load to twice the yield stretch: linear, then constant.
    while stroke.position_m[0] < start_m + 2.0 * most_m {
        let response = stroke.tick().response;
        let stretch_m = stroke.position_m[0] - start_m;
        let want_n = (stiffness_n_per_m * stretch_m).min(yield_n);
        assert!(
            (-response.force_n[0] - want_n).abs() < 0.01 * yield_n,
            "{stretch_m} m: {:?}",
            response.force_n
        );
        match response.regime {
            Regime::Elastic => regimes[0] += 1,
            Regime::Flowing => regimes[1] += 1,
            Regime::Free => panic!("clay stands ahead"),
        }
    }
    assert!(100 < regimes[0] && 100 < regimes[1], "{regimes:?}");
    // Unload: back along the same slope, while the tool still touches.
    let turned_m = stroke.position_m[0];
    stroke.velocity_m_s = [-1e-3, 0.0, 0.0];
    let mut work_j = 0.0;
    while turned_m - 0.9 * most_m < stroke.position_m[0] {
        let response = stroke.tick().response;
        let want_n = stiffness_n_per_m * (most_m - (turned_m - stroke.position_m[0]));
        assert!(
            (-response.force_n[0] - want_n).abs() < 0.01 * yield_n,
            "{want_n}: {:?}",
            response.force_n
        );
        assert_eq!(response.regime, Regime::Elastic);
        work_j += response.force_n[0] * -1e-6;
    }
    let stored_j = 0.5 * stiffness_n_per_m * most_m * most_m * (1.0 - 0.1 * 0.1);
    assert!(
        (work_j / stored_j - 1.0).abs() < 0.03,
        "{work_j} J of {stored_j} J came back"
    );
    // Farther back nothing holds the tool: clay does not pull.
    let lost = stroke.resistance_n(2.0);
    let left_n = lost.last().unwrap().abs();
    assert!(left_n < 0.005 * yield_n, "{left_n} N");
}

#[test]
fn rigid_clay_does_not_jump_at_rest() {
    let shape = ToolShape::ball(0.0064).unwrap();
    let clay = material(0.0, 8e3, 0.0);
    let force_n = |speed: f64| {
        let mut stroke = Stroke::in_cube(shape, [0.02, 0.0243, 0.0241], [speed, 0.0, 0.0])
            .already_under_way()
            .with(clay);
        -stroke.tick().response.force_n[0]
    };
    let full_n = force_n(RIGID_YIELD_SPEED_M_S);
    assert!((force_n(0.1 * RIGID_YIELD_SPEED_M_S) / full_n - 0.1).abs() < 0.01);
    assert!((force_n(10.0 * RIGID_YIELD_SPEED_M_S) / full_n - 1.0).abs() < 0.01);
}

#[test]
fn air_and_a_finished_cut_do_not_resist() {
    let shape = ToolShape::ball(0.0064).unwrap();
    let stiff = material(1e5, 8e3, 4e5);
    let mut above =
        Stroke::in_cube(shape, [0.024, 0.024, EDGE_M + 0.0075], [0.1, 0.0, 0.0]).with(stiff);
    let mut away = Stroke::in_cube(shape, [1.0, 2.0, -3.0], [0.1, 0.2, -0.1]).with(stiff);
    let mut through = Stroke::in_cube(shape, [0.02, 0.024, 0.024], [0.1, 0.0, 0.0]).with(stiff);
    let bore = Sweep {
        shape,
        from: at([-0.02, 0.024, 0.024]),
        to: at([0.08, 0.024, 0.024]),
    };
    through.clay.carve(&bore);
    for stroke in [&mut above, &mut away] {
        for _ in 0..20 {
            let worked = stroke.tick();
            assert!(norm(worked.response.force_n) <= 0.0, "{worked:?}");
            assert_eq!(
                (worked.moved_units, worked.response.regime),
                (0, Regime::Free)
            );
        }
    }
    // The wall of the bore touches the ball all round; of its disc less than half a percent may count.
    let full_n = (8e3 + 1e5 * 0.1) * PI * 0.0064 * 0.0064;
    for _ in 0..20 {
        let worked = through.tick();
        assert!(norm(worked.response.force_n) < 0.005 * full_n, "{worked:?}");
        assert_eq!(worked.moved_units, 0);
    }
}

#[test]
fn feeling_does_not_cut() {
    let shape = ToolShape::ball(0.0064).unwrap();
    let mut stroke =
        Stroke::in_cube(shape, [0.02, 0.024, 0.024], [0.1, 0.0, 0.0]).already_under_way();
    let (hash, left) = (stroke.clay.hash(), stroke.clay.remaining_units());
    let motion = Motion::new(
        at([0.02, 0.024, 0.024]),
        at([0.0203, 0.024, 0.024]),
        [0.3, 0.0, 0.0],
    )
    .unwrap();
    let response = stroke
        .clay
        .feel(&stroke.tool, &stroke.material, &motion, &mut stroke.contact);
    assert!(response.force_n[0] < -0.1);
    assert_eq!(
        (stroke.clay.hash(), stroke.clay.remaining_units()),
        (hash, left)
    );
}

/// The longest grid along each axis in turn: what is felt at one end is felt at the other, but for the rounding of
/// places between voxels there.
#[test]
fn the_area_does_not_depend_on_the_place_in_the_largest_grid() {
    const VOXEL_M: f64 = 5e-4;
    let tool = Tool::new(ToolShape::ball(0.005).unwrap());
    for axis in 0..3 {
        let mut size_m = [0.03; 3];
        size_m[axis] = 1024.0 * VOXEL_M;
        let mut clay = Clay::new(&Shape::Block { size_m }, VOXEL_M).unwrap();
        let area_m2 = |clay: &Clay, along_m: f64, ahead: f64| {
            let mut place_m = [0.015; 3];
            place_m[axis] = along_m;
            let mut direction = [0.0; 3];
            direction[axis] = ahead;
            clay.engaged_area_m2(&tool, at(place_m), direction)
        };
        for into_m in [0.0, 1.0 * VOXEL_M, 11.3 * VOXEL_M, 300.0 * VOXEL_M] {
            let near_m2 = area_m2(&clay, into_m, 1.0);
            let far_m2 = area_m2(&clay, size_m[axis] - into_m, -1.0);
            assert!(0.0 < near_m2, "{axis}, {into_m}");
            let share = (far_m2 / near_m2 - 1.0).abs();
            assert!(share < 2e-3, "{axis}, {into_m}: {near_m2}, {far_m2}");
        }
        // Likewise where the last bricks are all there is.
        let near_m2 = area_m2(&clay, 0.0, 1.0);
        for number in 0..clay.grid().brick_count() {
            let index = clay.grid().brick_index(number as u32).unwrap();
            if clay.grid().brick_coordinates(index)[axis] < 63 {
                clay.replace_brick(index, BrickView::Empty).unwrap();
            }
        }
        let far_m2 = area_m2(&clay, size_m[axis], -1.0);
        let share = (far_m2 / near_m2 - 1.0).abs();
        assert!(share < 2e-3, "{axis}: {near_m2}, {far_m2}");
    }
}

#[test]
fn the_area_does_not_depend_on_the_length_of_the_direction() {
    let stroke = Stroke::in_cube(
        ToolShape::ball(0.005).unwrap(),
        [0.02, 0.024, 0.048],
        [0.1, 0.0, 0.0],
    );
    let area_m2 = |direction| {
        stroke
            .clay
            .engaged_area_m2(&stroke.tool, at([0.02, 0.024, 0.048]), direction)
    };
    assert!(0.0 < area_m2([1.0, 0.0, 0.0]));
    assert!((area_m2([1e-9, 0.0, 0.0]) - area_m2([7.0, 0.0, 0.0])).abs() < 1e-12);
    for none in [[0.0; 3], [f64::NAN, 0.0, 0.0], [f64::INFINITY, 0.0, 0.0]] {
        assert!(area_m2(none).abs() <= 0.0);
    }
}

#[test]
fn what_no_motion_has_is_refused() {
    for velocity_m_s in [
        [f64::NAN, 0.0, 0.0],
        [0.0, f64::INFINITY, 0.0],
        [0.0, 0.0, -1e4],
    ] {
        assert!(Motion::new(Pose::default(), Pose::default(), velocity_m_s).is_err());
    }
    for broken in [-1.0, f64::NAN, f64::INFINITY, 1e13] {
        let sound = Coefficients {
            viscosity_pa_s_per_m: 0.0,
            yield_stress_pa: 0.0,
            stiffness_pa: 0.0,
        };
        assert!(
            Material::new(Coefficients {
                viscosity_pa_s_per_m: broken,
                ..sound
            })
            .is_err()
        );
        assert!(
            Material::new(Coefficients {
                yield_stress_pa: broken,
                ..sound
            })
            .is_err()
        );
        assert!(
            Material::new(Coefficients {
                stiffness_pa: broken,
                ..sound
            })
            .is_err()
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    /// Round any closed loop in real clay, carved as it goes, the tool never gets out more than it put in. Work is
    /// counted with the force at the end of each step, as the law's derivation has it.
    #[test]
    fn no_closed_loop_yields_energy(
        viscosity in prop_oneof![Just(0.0), 1e3..1e6],
        yield_stress in prop_oneof![Just(0.0), 1e2..1e5],
        stiffness in prop_oneof![Just(0.0), 1e4..1e7],
        blade in any::<bool>(),
        start in [0.018..0.030, 0.018..0.030, 0.030..0.052],
        corners in prop::collection::vec([-0.004..0.004, -0.004..0.004, -0.004..0.004], 1..6),
        steps in 1_usize..40,
        laps in 1_usize..3,
    ) {
        let shape = if blade { ToolShape::paper_blade() } else { ToolShape::ball(0.0048).unwrap() };
        let mut clay = Clay::new(&Shape::Block { size_m: [EDGE_M; 3] }, 1e-3).unwrap();
        let (tool, law) = (Tool::new(shape), material(viscosity, yield_stress, stiffness));
        let mut contact = ContactState::default();
        let mut given_j = 0.0;
        let mut dissipated_j = 0.0;
        let mut handled_j = 0.0;
        let place = |corner: [f64; 3]| at(std::array::from_fn(|axis| start[axis] + corner[axis]));
        let mut from = place([0.0; 3]);
        for _ in 0..laps {
            for corner in corners.iter().copied().chain([[0.0; 3]]) {
                let (begin, end) = (from.position_m(), place(corner).position_m());
                for step in 1..=steps {
                    let share = step as f64 / steps as f64;
                    let to = at(std::array::from_fn(|axis| begin[axis] + (end[axis] - begin[axis]) * share));
                    let way_m = to.displacement_from_m(from);
                    let motion = Motion::new(from, to, way_m.map(|m| m / TICK_S)).unwrap();
                    let response = clay.work(&tool, &law, &motion, &mut contact).response;
                    prop_assert!(response.force_n.iter().all(|f| f.is_finite()));
                    let work_j = -(0..3).map(|axis| response.force_n[axis] * way_m[axis]).sum::<f64>();
                    given_j += work_j;
                    handled_j += work_j.abs();
                    dissipated_j += response.dissipated_j;
                    prop_assert!(0.0 <= response.stored_j && 0.0 <= response.dissipated_j);
                    // At every moment, not only at the end: what came back was stored before.
                    prop_assert!(-1e-12 * handled_j <= given_j, "{given_j} J of {handled_j} J");
                    prop_assert!((given_j - dissipated_j - response.stored_j).abs() <= 1e-9 * handled_j + 1e-15);
                    from = to;
                }
            }
            prop_assert_eq!(from, place([0.0; 3]));
        }
    }
}
