//! Changes of a session: whole or not at all, under one revision, on virtual time.

mod bench;

use std::sync::Arc;

use bench::{Bench, cutting, engaged_at, join, kinds, new_session, patch, reset, stroke};
use teleclay_proto::Scheme;
use teleclay_proto::frame::LoopStatus;
use teleclay_proto::http::{ImpairmentPatch, MaterialPatch, NetworkPatch, Operation, SessionPatch};
use teleclay_session::{Command, Prepared, Refusal};

/// All of a patch in one tick under one revision.
#[test]
fn a_patch_is_one_revision_and_the_tool_frames_name_it() {
    let mut bench = Bench::new(new_session(1));
    let mut ada = bench.join("Ada").unwrap();
    bench.run(5, &mut [&mut ada], |_| engaged_at([0.0; 3]));
    kinds(&mut bench);
    let before = bench.session.revision();
    let outcome = bench
        .command(&patch(SessionPatch {
            scheme: Some(Scheme::Wave),
            material: Some(MaterialPatch {
                viscosity_pa_s_per_m: Some(3e5),
                ..MaterialPatch::default()
            }),
            network: Some(NetworkPatch {
                up: Some(ImpairmentPatch {
                    loss: Some(0.25),
                    ..ImpairmentPatch::default()
                }),
                ..NetworkPatch::default()
            }),
            deadband: Some(0.07),
            operation: Some(Operation::Smooth),
            paused: Some(true),
        }))
        .unwrap();
    assert_eq!(outcome.revision, before + 1);
    let told = bench.take_events();
    assert_eq!(told.len(), 1, "{told:?}");
    bench.tick();
    let (_, frame) = bench.sent[0];
    assert_eq!(u64::from(frame.header.revision), outcome.revision);
    assert_eq!(frame.header.scheme, Scheme::Wave);
    assert_eq!(frame.status, LoopStatus::Paused);
    let settings = bench.session.settings();
    assert_eq!(settings.revision, outcome.revision);
    assert_eq!(settings.spec.scheme, Scheme::Wave);
    assert_eq!(settings.parameters.material, settings.spec.material);
    assert!(settings.is_paused && settings.spec.network.up.loss.to_bits() == 0.25_f64.to_bits());
}

/// Frames name the revision whatever changed, and to every holder.
#[test]
fn every_change_is_named_by_the_frames_of_the_next_tick() {
    let mut bench = Bench::new(new_session(3));
    let mut ada = bench.join("Ada").unwrap();
    bench.run(3, &mut [&mut ada], |_| engaged_at([0.0; 3]));
    let pause = patch(SessionPatch {
        paused: Some(true),
        ..SessionPatch::default()
    });
    let changes = [pause, reset(None), join("Bob"), Command::Leave { lease: 2 }];
    for change in &changes {
        let outcome = bench.command(change).unwrap();
        bench.tick();
        let told: Vec<u32> = bench
            .sent
            .iter()
            .map(|(_, frame)| frame.header.revision)
            .collect();
        assert!(!told.is_empty());
        let is_named = told
            .iter()
            .all(|&revision| u64::from(revision) == outcome.revision);
        assert!(
            is_named,
            "{told:?} after {change:?}, which made {}",
            outcome.revision
        );
    }
}

/// What was under way to or from a holder goes with the holder.
#[test]
fn nothing_of_a_holder_is_on_the_line_of_the_next() {
    let mut new = new_session(1);
    new.network.up.delay_s = 0.05;
    new.network.down.delay_s = 0.05;
    let mut bench = Bench::new(new);
    let mut ada = bench.join("Ada").unwrap();
    bench.run(200, &mut [&mut ada], |_| engaged_at([0.0; 3]));
    assert_eq!(bench.sent.len(), 1);
    bench
        .command(&Command::Leave { lease: ada.lease() })
        .unwrap();
    let bob = bench.join("Bob").unwrap();
    for tick in 0..120 {
        bench.tick();
        for (_, frame) in &bench.sent {
            assert_eq!(frame.header.lease, bob.lease(), "tick {tick}");
        }
        assert_eq!(bench.sent.is_empty(), tick < 50, "tick {tick}");
    }
}

/// Every part of one patch, each by what the loop then does: the force of a stroke whose motion the hand dictates
/// follows the viscosity, frames come as late as the line says, and frames that tell nothing new are left out.
#[test]
fn a_patch_reaches_the_loop_whole() {
    let cut = |change: Option<SessionPatch>| {
        let mut bench = Bench::new(cutting(Scheme::PositionForce));
        let mut ada = bench.join("Ada").unwrap();
        bench.run(300, &mut [&mut ada], stroke);
        if let Some(change) = change {
            bench.command(&patch(change)).unwrap();
        }
        let mut first_frame = None;
        let mut frames = 0;
        for tick in 0..1000 {
            // The hand goes on for a while, and then rests.
            bench.run(1, &mut [&mut ada], |_| stroke(300 + tick.min(40)));
            if first_frame.is_none() && !bench.sent.is_empty() {
                first_frame = Some(tick);
            }
            frames += bench.sent.len();
            if tick == 0 {
                ada.header.scheme = bench.session.settings().spec.scheme;
            }
        }
        (bench, first_frame, frames)
    };
    let (usual, first_frame, frames) = cut(None);
    assert_eq!((first_frame, frames), (Some(0), 1000));

    let network = NetworkPatch {
        down: Some(ImpairmentPatch {
            delay_s: Some(0.05),
            ..ImpairmentPatch::default()
        }),
        ..NetworkPatch::default()
    };
    let material = MaterialPatch {
        viscosity_pa_s_per_m: Some(4e5),
        ..MaterialPatch::default()
    };
    let (changed, first_frame, frames) = cut(Some(SessionPatch {
        material: Some(material),
        network: Some(network),
        deadband: Some(0.07),
        ..SessionPatch::default()
    }));
    assert_eq!(first_frame, Some(50), "the line is not as the patch has it");
    assert!(frames < 300, "{frames} frames of a tool that rests");
    assert_eq!(
        changed.session.clay().removed_units(),
        usual.session.clay().removed_units()
    );

    let force_n = |viscosity: Option<f64>| {
        let mut bench = Bench::new(cutting(Scheme::PositionForce));
        let mut ada = bench.join("Ada").unwrap();
        bench.run(300, &mut [&mut ada], stroke);
        if viscosity.is_some() {
            let change = SessionPatch {
                material: Some(MaterialPatch {
                    viscosity_pa_s_per_m: viscosity,
                    ..MaterialPatch::default()
                }),
                network: Some(NetworkPatch::default()),
                ..SessionPatch::default()
            };
            bench.command(&patch(change)).unwrap();
        }
        bench.run(1, &mut [&mut ada], |tick| stroke(300 + tick));
        bench.sent[0].1.force_n[0]
    };
    let (soft, hard) = (force_n(None), force_n(Some(4e5)));
    assert!(1e-3 < soft.abs(), "{soft} N: the stroke meets no clay");
    assert!(
        (hard / soft - 2.0).abs() < 1e-9,
        "{hard} N, wanted twice {soft} N"
    );
}

#[test]
fn a_patch_with_one_bad_field_changes_nothing_at_all() {
    let mut bench = Bench::new(new_session(1));
    let mut ada = bench.join("Ada").unwrap();
    bench.run(5, &mut [&mut ada], |_| engaged_at([0.0; 3]));
    kinds(&mut bench);
    let before = bench.session.snapshot();
    let refused = bench.command(&patch(SessionPatch {
        scheme: Some(Scheme::Tdpa),
        paused: Some(true),
        network: Some(NetworkPatch {
            down: Some(ImpairmentPatch {
                delay_s: Some(2.5),
                ..ImpairmentPatch::default()
            }),
            ..NetworkPatch::default()
        }),
        ..SessionPatch::default()
    }));
    let Err(Refusal::Field(error)) = refused else {
        panic!("{refused:?}")
    };
    assert_eq!(error.pointer, "/network/down/delay_s");
    assert_eq!(bench.session.snapshot(), before);
    assert!(kinds(&mut bench).is_empty());
}

/// What was prepared from settings that have changed since is refused, and carried out when it is prepared again.
#[test]
fn a_command_that_was_overtaken_is_prepared_anew() {
    let mut bench = Bench::new(new_session(1));
    let settings = Arc::clone(bench.session.settings());
    let change = |scheme| {
        patch(SessionPatch {
            scheme: Some(scheme),
            ..SessionPatch::default()
        })
    };
    let mut stale = Prepared::new(&change(Scheme::Wave), &settings).unwrap();
    let revision = bench.command(&change(Scheme::Tdpa)).unwrap().revision;
    let before = bench.session.snapshot();
    let refused = bench.session.handle_command(bench.now, &mut stale);
    assert_eq!(
        refused,
        Err(Refusal::Overtaken {
            prepared_from: 0,
            settings_from: revision
        })
    );
    assert_eq!(bench.session.snapshot(), before);
    assert!(bench.command(&change(Scheme::Wave)).is_ok());
}
