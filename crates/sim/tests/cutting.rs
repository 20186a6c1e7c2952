//! The cutting experiment through the clay, against the formula, against a simulation made elsewhere, and where it must
//! refuse.

use std::ops::ControlFlow;

use proptest::prelude::*;
use proptest::test_runner::{RngSeed, TestCaseError};
use serde_json::Value;
use teleclay_control::{Polynomial, paper};
use teleclay_sim::experiment::{
    CuttingExperiment, CuttingInputs, Outcome, Push, Refusal, RunError,
};

fn run(inputs: CuttingInputs) -> (CuttingExperiment, Outcome) {
    let experiment = CuttingExperiment::new(inputs).unwrap();
    let outcome = experiment.run(|_| ControlFlow::Continue(())).unwrap();
    (experiment, outcome)
}

fn refused(change: impl FnOnce(&mut CuttingInputs)) -> Refusal {
    let mut inputs = CuttingInputs::default();
    change(&mut inputs);
    CuttingExperiment::new(inputs).unwrap_err()
}

fn off_by(got: f64, wanted: f64) -> f64 {
    (got / wanted - 1.0).abs()
}

/// [KHMH03] Fig. 7 with our defaults: the formula's velocities within 2 %, steady within 2 %.
#[test]
fn the_experiment_of_figure_7_gives_its_plateaus() {
    let (experiment, outcome) = run(CuttingInputs::default());
    assert!(off_by(experiment.specimen().viscosity_pa_s_per_m, 2e5) < 1e-12);
    assert_eq!(outcome.plateaus.len(), 3);
    for (range, plateau) in outcome.plateaus.iter().enumerate() {
        let wanted = 2.0 / (10.0 + 20.0 * (range as f64 + 1.0));
        assert!(off_by(plateau.theory_m_s, wanted) < 1e-12);
        assert!(off_by(plateau.measured_m_s, wanted) < 0.02);
        assert!(plateau.ripple < 0.02);
    }
    let ticks = (outcome.duration_s * 1e3).ceil() as usize;
    assert_eq!(outcome.trace.t_s.len(), ticks + 1);
}

/// Experiments solved elsewhere, from the equations alone and by another method: it knows no clay, no voxels and no
/// sampled loop (tests/python/references.py).
#[test]
fn experiments_agree_with_the_reference() {
    let cases: Value = serde_json::from_str(include_str!("reference/cutting.json")).unwrap();
    let cases = cases.as_array().unwrap();
    assert_eq!(cases.len(), 3);
    for case in cases {
        let number = |name: &str| case[name].as_f64().unwrap();
        let list = |name: &str| -> Vec<f64> {
            let values = case[name].as_array().unwrap();
            values.iter().map(|value| value.as_f64().unwrap()).collect()
        };
        let (_, outcome) = run(CuttingInputs {
            virtual_mass_kg: number("virtual_mass_kg"),
            virtual_damping_n_s_per_m: number("virtual_damping_n_s_per_m"),
            position_ratio: number("position_ratio"),
            force_ratio: number("force_ratio"),
            hand_force_n: number("hand_force_n"),
            edges_m: list("edges_m"),
            clay_damping_n_s_per_m: list("clay_damping_n_s_per_m"),
            ..CuttingInputs::default()
        });
        for (plateau, wanted) in outcome.plateaus.iter().zip(list("velocity_m_s")) {
            let error = off_by(plateau.measured_m_s, wanted);
            assert!(error < 0.01, "{case}: {plateau:?}, off by {error}");
        }
        let error = off_by(outcome.duration_s, number("duration_s"));
        assert!(error < 0.01, "{case}: {} s", outcome.duration_s);
    }
}

/// Slowest decay of the loop in a range, 1/s, but for the servo's pole near -1/18: a zero all but cancels it.
///
/// Sampling holds the clay's force back by a tick, half of it for the position that is held and half for the velocity,
/// which is a difference. Where the loop rings that costs most of its damping: at 71 rad/s, 2.25 1/s without the tick
/// are 0.87 with it.
fn decay_per_s(inputs: &CuttingInputs, range: usize) -> f64 {
    const HALF_TICK_S: f64 = 0.5e-3;
    let of = |coefficients: &[f64]| Polynomial::new(coefficients).unwrap();
    let servo = paper::g_hx();
    let handle = of(&[inputs.virtual_mass_kg, inputs.virtual_damping_n_s_per_m]);
    let clay = inputs.force_per_position() * inputs.clay_damping_n_s_per_m[range];
    // exp(-s T) as (1 - s T/2) / (1 + s T/2), good to 3e-5 of a radian up to 70 rad/s.
    let prompt = servo
        .denominator()
        .times(&handle)
        .and_then(|free| free.times(&of(&[HALF_TICK_S, 1.0])));
    let delayed = servo
        .numerator()
        .scaled(clay)
        .and_then(|clay| clay.times(&of(&[-HALF_TICK_S, 1.0])));
    let closed = prompt.unwrap().plus(&delayed.unwrap()).unwrap();
    let roots = closed.roots().unwrap();
    roots
        .iter()
        .filter(|root| 0.1 < root.norm())
        .map(|root| -root.re)
        .fold(f64::INFINITY, f64::min)
}

/// Whether every range is long enough for what the change of depth leaves behind to die out to a thousandth.
fn settles(inputs: &CuttingInputs) -> bool {
    (0..inputs.clay_damping_n_s_per_m.len()).all(|range| {
        let length_m = inputs.edges_m[range + 1] - inputs.edges_m[range];
        let before_the_window_s =
            0.7 * length_m / inputs.plateau_velocity_m_s(range, inputs.hand_force_n);
        7.0 < decay_per_s(inputs, range) * before_the_window_s
    })
}

prop_compose! {
    fn experiments()(
        virtual_mass_kg in 0.3..5.0f64,
        virtual_damping_n_s_per_m in 2.0..60.0f64,
        position_ratio in 0.5..2.0f64,
        force_ratio in -2.0..-0.5f64,
        hand_force_n in 0.3..4.0f64,
        start_m in -0.05..0.2f64,
        ranges in prop::collection::vec((0.015..0.03f64, 3.0..90.0f64), 1..=8),
    ) -> CuttingInputs {
        let mut edges_m = vec![start_m];
        for (length_m, _) in &ranges {
            edges_m.push(edges_m[edges_m.len() - 1] + length_m);
        }
        CuttingInputs {
            virtual_mass_kg,
            virtual_damping_n_s_per_m,
            position_ratio,
            force_ratio,
            hand_force_n,
            edges_m,
            clay_damping_n_s_per_m: ranges.iter().map(|(_, damping)| *damping).collect(),
            ..CuttingInputs::default()
        }
    }
}

/// Every range's velocity is the formula's and steady, within 2 %, and the clay that gave it is the clay that was asked
/// for.
fn check_plateaus(inputs: &CuttingInputs, experiment: &CuttingExperiment) -> Result<(), String> {
    let outcome = experiment
        .run(|_| ControlFlow::Continue(()))
        .map_err(|error| error.to_string())?;
    let require = |is_so: bool, what: String| if is_so { Ok(()) } else { Err(what) };
    let specimen = experiment.specimen();
    let (mut volume_m3, mut rounding_m3) = (0.0, 0.0);
    for (range, plateau) in outcome.plateaus.iter().enumerate() {
        let damping = inputs.clay_damping_n_s_per_m[range];
        let wanted = inputs.hand_force_n
            / (inputs.virtual_damping_n_s_per_m
                + damping * inputs.position_ratio / inputs.force_ratio.abs());
        let is_formula = off_by(plateau.measured_m_s, wanted) < 0.02;
        require(
            is_formula,
            format!("range {range}: {plateau:?} for {wanted} m/s"),
        )?;
        require(plateau.ripple < 0.02, format!("range {range}: {plateau:?}"))?;
        // B_i is not typed in: it is what the blade engages, as well as voxels and the rows of points that feel them
        // can show it.
        let wanted_m2 = specimen.blade.width_m * specimen.depths_of_cut_m[range];
        let allowed_m2 = specimen.blade.width_m * specimen.depth_error_m(range);
        let felt_m2 = plateau.engaged_area_m2;
        require(
            (felt_m2 - wanted_m2).abs() < allowed_m2,
            format!("range {range}: {felt_m2} for {wanted_m2} m², {allowed_m2} allowed"),
        )?;
        let asked = off_by(specimen.viscosity_pa_s_per_m * wanted_m2, damping);
        require(
            asked < 1e-12,
            format!("range {range}: {damping} N s/m off by {asked}"),
        )?;
        let length_m = (inputs.edges_m[range + 1] - inputs.edges_m[range]) * inputs.position_ratio;
        volume_m3 += wanted_m2 * length_m;
        // Half a voxel on the floor, and half a one on either side.
        let half_m = 0.5 * specimen.voxel_size_m;
        let sides_m = 2.0 * specimen.depths_of_cut_m[range];
        rounding_m3 += half_m * (specimen.blade.width_m + sides_m) * length_m;
    }
    // And half a one at either end.
    let deepest_m = specimen.depths_of_cut_m.iter().copied().fold(0.0, f64::max);
    rounding_m3 += specimen.voxel_size_m * specimen.blade.width_m * deepest_m;
    let removed_m3 = outcome.removed_volume_m3;
    require(
        (removed_m3 - volume_m3).abs() < rounding_m3,
        format!("removed {removed_m3} of {volume_m3} m³, {rounding_m3} allowed"),
    )
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 24,
        max_global_rejects: 20_000,
        // A failing case is printed whole; nothing is written into the checkout.
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    /// Any masses, dampings, ratios and forces, rising or falling steps of any depth: where the transient has room to
    /// die out, the velocity is the formula's, and it is steady.
    #[test]
    fn every_plateau_that_can_be_reached_is_the_formulas(inputs in experiments()) {
        prop_assume!(settles(&inputs));
        let experiment = CuttingExperiment::new(inputs.clone())
            .map_err(|refusal| TestCaseError::reject(refusal.to_string()))?;
        check_plateaus(&inputs, &experiment).map_err(TestCaseError::fail)?;
    }
}

/// Steps of very different heights make a tall blade, on which the rows of points that feel clay stand further apart
/// than half a voxel.
#[test]
fn a_tall_blade_shows_a_shallow_step_within_what_it_promises() {
    for (virtual_mass_kg, virtual_damping_n_s_per_m, position_ratio, force_ratio) in [
        (2.07, 15.5, 1.49, -0.98),
        (4.20, 17.7, 1.99, -0.69),
        (1.75, 21.9, 1.09, -0.57),
        (3.48, 28.3, 1.95, -0.71),
    ] {
        let inputs = CuttingInputs {
            virtual_mass_kg,
            virtual_damping_n_s_per_m,
            position_ratio,
            force_ratio,
            hand_force_n: 0.3,
            edges_m: vec![0.0, 0.015, 0.03, 0.045, 0.06],
            clay_damping_n_s_per_m: vec![82.00, 10.51, 5.128, 29.30],
            ..CuttingInputs::default()
        };
        assert!(settles(&inputs), "{inputs:?}");
        let experiment = CuttingExperiment::new(inputs.clone()).unwrap();
        check_plateaus(&inputs, &experiment).unwrap();
    }
}

/// Close to where sampling alone makes it swing, a loop takes three times as long to settle as the same loop without a
/// tick: such a range is too short for a plateau, and the run says so by its ripple.
#[test]
fn a_range_too_short_to_settle_in_is_told_by_the_sampled_loop() {
    let inputs = CuttingInputs {
        virtual_mass_kg: 1.946,
        virtual_damping_n_s_per_m: 47.34,
        position_ratio: 1.605,
        force_ratio: -0.6328,
        hand_force_n: 1.034,
        edges_m: vec![0.03888, 0.06097, 0.08178],
        clay_damping_n_s_per_m: vec![89.59, 16.12],
        ..CuttingInputs::default()
    };
    assert!(!settles(&inputs));
    let (_, outcome) = run(inputs.clone());
    assert!(0.02 < outcome.plateaus[0].ripple, "{outcome:?}");
    // Twice as long a range is long enough, and there the plateau is the formula's.
    let longer = CuttingInputs {
        edges_m: vec![0.0, 0.05, 0.07],
        ..inputs
    };
    assert!(settles(&longer));
    let experiment = CuttingExperiment::new(longer.clone()).unwrap();
    check_plateaus(&longer, &experiment).unwrap();
}

/// The seed stands in `.cargo/config.toml`, for every property test of every crate.
#[test]
fn what_property_tests_draw_can_be_drawn_again() {
    let seed = ProptestConfig::default().rng_seed;
    assert_ne!(
        seed,
        RngSeed::Random,
        "run by cargo, or with PROPTEST_RNG_SEED set"
    );
}

/// The trace belongs to one motion: position is the sum of velocity, and on a plateau the forces balance.
#[test]
fn the_trace_is_one_motion() {
    let (experiment, outcome) = run(CuttingInputs {
        position_ratio: 1.5,
        force_ratio: -1.25,
        ..CuttingInputs::default()
    });
    let inputs = experiment.inputs();
    let trace = &outcome.trace;
    assert!((trace.position_m[0] - inputs.edges_m[0]).abs() < 1e-15);
    let mut position_m = inputs.edges_m[0];
    for tick in 1..trace.t_s.len() {
        assert!((trace.t_s[tick] - tick as f64 * 1e-3).abs() < 1e-9);
        position_m += 0.5e-3 * (trace.velocity_m_s[tick - 1] + trace.velocity_m_s[tick]);
        // Between samples the servo answers the step of its command, which a sum of samples does not see.
        let slack_m = 1e-6 + 5e-4 * (position_m - inputs.edges_m[0]);
        assert!(
            (position_m - trace.position_m[tick]).abs() < slack_m,
            "at {tick}"
        );
    }
    for (range, plateau) in outcome.plateaus.iter().enumerate() {
        for tick in 0..trace.t_s.len() {
            let at_m = trace.position_m[tick];
            if !(plateau.window_m[0] <= at_m && at_m < plateau.window_m[1]) {
                continue;
            }
            assert!((trace.hand_force_n[tick] - 2.0).abs() < 1e-12);
            let tool_velocity = 1.5 * trace.velocity_m_s[tick];
            let damping = inputs.clay_damping_n_s_per_m[range];
            assert!(off_by(trace.tool_force_n[tick], -damping * tool_velocity) < 0.03);
            let felt = trace.tool_force_n[tick] / -inputs.force_ratio;
            let net = 2.0 + felt - 10.0 * trace.velocity_m_s[tick];
            assert!(net.abs() < 0.1, "{net} N left over in range {range}");
        }
    }
}

/// (16): with the arm in between the sensor reads what the arm leaves of the push, and the velocity follows that.
#[test]
fn through_the_arm_the_plateaus_lean() {
    let (_, outcome) = run(CuttingInputs {
        push: Push::ThroughArm,
        hand_force_n: 3.0,
        ..CuttingInputs::default()
    });
    let trace = &outcome.trace;
    for plateau in &outcome.plateaus {
        let middle_m = 0.5 * (plateau.window_m[0] + plateau.window_m[1]);
        // The sensor is read while the last command still holds, half a tick of motion behind: by the 900 N/m of the
        // arm's direct term that hides 0.45 N s/m of the arm's 2.
        let arm_n = 6.0 * (middle_m - 0.03) + (2.0 - 0.45) * plateau.measured_m_s;
        assert!(
            off_by(plateau.hand_force_n, 3.0 - arm_n) < 0.01,
            "{plateau:?}"
        );
        assert!(
            off_by(plateau.measured_m_s, plateau.theory_m_s) < 0.02,
            "{plateau:?}"
        );
    }
    let last = trace.t_s.len() - 1;
    assert!(trace.hand_force_n[last] < 0.9 * trace.hand_force_n[200]);
}

/// A gap in the clay is a range like another: there only the handle's own damping holds the hand back.
#[test]
fn a_gap_in_the_clay_lets_the_hand_go() {
    let (_, outcome) = run(CuttingInputs {
        virtual_mass_kg: 0.5,
        virtual_damping_n_s_per_m: 25.0,
        clay_damping_n_s_per_m: vec![30.0, 0.0, 12.5],
        ..CuttingInputs::default()
    });
    assert!(off_by(outcome.plateaus[1].measured_m_s, 2.0 / 25.0) < 0.01);
    assert!(outcome.plateaus[1].engaged_area_m2 < 3e-3 * outcome.plateaus[0].engaged_area_m2);
    assert!(off_by(outcome.plateaus[2].measured_m_s, 2.0 / 37.5) < 0.02);
}

/// The most damping that a handle bears, against the roots of the sampled loop
/// `1 + rho B C_h1(z) G_hx(z) (1 - 1/z) / T`, found with numpy; and a run close to it, 20 times as long as a swing
/// takes to build up, that stays a run.
#[test]
fn the_loop_bears_what_the_analysis_says() {
    for (virtual_mass_kg, virtual_damping_n_s_per_m, most) in [
        (1.0, 10.0, 91.84),
        (0.3, 30.0, 122.64),
        (2.0, 3.0, 153.06),
        (0.5, 10.0, 56.65),
    ] {
        let with = |damping: f64| CuttingInputs {
            virtual_mass_kg,
            virtual_damping_n_s_per_m,
            edges_m: vec![0.0, 0.2],
            clay_damping_n_s_per_m: vec![damping],
            ..CuttingInputs::default()
        };
        assert!(CuttingExperiment::new(with(0.995 * most)).is_ok());
        assert!(matches!(
            CuttingExperiment::new(with(1.005 * most)),
            Err(Refusal::Unstable { range: 0, .. })
        ));
        let (_, outcome) = run(with(0.97 * most));
        let velocity = &outcome.trace.velocity_m_s;
        // Short of the end of the clay, which lets the hand go.
        let late = &velocity[3 * velocity.len() / 4..19 * velocity.len() / 20];
        let swing = late.iter().copied().fold(f64::MIN, f64::max)
            - late.iter().copied().fold(f64::MAX, f64::min);
        let mean = outcome.plateaus[0].measured_m_s;
        assert!(swing < 0.25 * mean, "{swing} around {mean}");
    }
}

/// A servo of finite bandwidth rings where the handle is light; that is reported, not smoothed away.
#[test]
fn a_loop_that_rings_shows_its_ripple() {
    let (_, outcome) = run(CuttingInputs {
        virtual_mass_kg: 0.6,
        ..CuttingInputs::default()
    });
    assert!(outcome.plateaus[0].ripple < 0.02);
    assert!(
        0.1 < outcome.plateaus[2].ripple,
        "{:?}",
        outcome.plateaus[2]
    );
}

#[test]
fn what_cannot_be_run_is_refused_with_the_reason() {
    assert!(matches!(
        refused(|inputs| inputs.virtual_mass_kg = 0.2),
        Refusal::Unstable { range: 1, .. }
    ));
    assert!(matches!(
        refused(|inputs| {
            inputs.virtual_damping_n_s_per_m = 0.0;
            inputs.clay_damping_n_s_per_m[1] = 0.0;
        }),
        Refusal::NoPlateau { range: 1 }
    ));
    assert!(matches!(
        refused(|inputs| inputs.hand_force_n = 0.01),
        Refusal::TooSlow { expected_s } if off_by(expected_s, 450.0) < 1e-9
    ));
    assert!(matches!(
        refused(|inputs| inputs.hand_force_n = 80.0),
        Refusal::TooFast { range: 0, .. }
    ));
    assert!(matches!(
        refused(|inputs| {
            inputs.push = Push::ThroughArm;
            inputs.hand_force_n = 0.5;
        }),
        Refusal::OutOfReach { .. }
    ));
    assert!(matches!(
        refused(|inputs| {
            inputs.virtual_mass_kg = 100.0;
            inputs.virtual_damping_n_s_per_m = 0.1;
            inputs.clay_damping_n_s_per_m = vec![1.0, 500.0, 60.0];
            inputs.hand_force_n = 0.5;
        }),
        Refusal::TooShallow { range: 0, .. }
    ));
    assert!(matches!(
        refused(|inputs| inputs.voxel_size_m = Some(5e-5)),
        Refusal::Shape(_)
    ));
    assert!(matches!(
        refused(|inputs| inputs.edges_m = vec![-9.0, 0.0, 1.0, 9.0]),
        Refusal::Blade(_) | Refusal::TooSlow { .. }
    ));
}

#[test]
fn inputs_out_of_range_are_named() {
    type Change = fn(&mut CuttingInputs, f64);
    let fields: [(&str, Option<usize>, Change); 7] = [
        ("virtual_mass_kg", None, |i, x| i.virtual_mass_kg = x),
        ("virtual_damping_n_s_per_m", None, |i, x| {
            i.virtual_damping_n_s_per_m = x
        }),
        ("position_ratio", None, |i, x| i.position_ratio = x),
        ("force_ratio", None, |i, x| i.force_ratio = -x),
        ("hand_force_n", None, |i, x| i.hand_force_n = x),
        ("edges_m", Some(3), |i, x| i.edges_m[3] = x),
        ("clay_damping_n_s_per_m", Some(2), |i, x| {
            i.clay_damping_n_s_per_m[2] = x
        }),
    ];
    for (name, place, change) in fields {
        for bad in [f64::NAN, f64::INFINITY, -1.0, 1e30] {
            match refused(|inputs| change(inputs, bad)) {
                Refusal::Input { field, index, .. } => assert_eq!((field, index), (name, place)),
                other => panic!("{name} = {bad}: {other}"),
            }
        }
    }
    assert!(matches!(
        refused(|inputs| inputs.edges_m[2] = 0.06),
        Refusal::Input {
            field: "edges_m",
            index: Some(2),
            ..
        }
    ));
    for (edges, dampings) in [(0, 0), (1, 0), (3, 3), (5, 3), (40, 39)] {
        let refusal = refused(|inputs| {
            inputs.edges_m = (0..edges).map(|edge| f64::from(edge) * 0.03).collect();
            inputs.clay_damping_n_s_per_m = vec![20.0; dampings];
        });
        assert!(matches!(refusal, Refusal::Counts { .. }), "{refusal}");
    }
    assert!(matches!(
        refused(|inputs| inputs.most_trace_samples = usize::MAX),
        Refusal::Input {
            field: "most_trace_samples",
            ..
        }
    ));
}

#[test]
fn progress_rises_and_may_call_the_run_off() {
    let experiment = CuttingExperiment::new(CuttingInputs::default()).unwrap();
    let mut shares = Vec::new();
    let outcome = experiment.run(|progress| {
        shares.push(progress.share);
        ControlFlow::Continue(())
    });
    assert!(outcome.is_ok() && 20 <= shares.len());
    assert!(shares.is_sorted() && shares.iter().all(|share| (0.0..=1.0).contains(share)));
    let called_off = experiment.run(|progress| {
        if 1.0 <= progress.time_s {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    });
    assert!(
        matches!(called_off, Err(RunError::Cancelled { time_s }) if off_by(time_s, 1.0) < 1e-9)
    );
}

#[test]
fn the_same_inputs_give_the_same_bits() {
    let once = run(CuttingInputs::default()).1;
    let again = run(CuttingInputs::default()).1;
    assert_eq!(once, again);
}

/// A long run keeps a short trace.
#[test]
fn a_trace_is_bounded() {
    let (_, outcome) = run(CuttingInputs {
        most_trace_samples: 500,
        ..CuttingInputs::default()
    });
    assert!((250..=500).contains(&outcome.trace.t_s.len()));
}
