//! Several operators in one session, and the clay that they leave.

use serde_json::json;
use teleclay_tests::process::PATIENCE;
use teleclay_tests::recording::norm;
use teleclay_tests::stage::{DEMO, Handle, HandleOptions, Server};

use super::endings::{cuts, held};

#[test]
fn two_operators_hold_two_tools_and_a_third_is_refused_with_the_reason() {
    let server = Server::on_free_ports().unwrap();
    let client = &server.client;
    client
        .create(&json!({
            "id": "shared", "scheme": "force_exchange", "tools": 2,
            "tool": {"kind": "ball", "radius_m": 0.0064},
        }))
        .unwrap();
    let options = HandleOptions::new(&server.endpoint()).in_session("shared");
    let ada = Handle::start(&options).unwrap();
    client
        .session_when("shared", "Ada's cut", PATIENCE, cuts)
        .unwrap();
    let _bob = Handle::start(&options.clone().by("Bob")).unwrap();

    // Both feel clay, not necessarily in the same look.
    let mut has_felt = [false; 2];
    let both = client
        .session_when("shared", "both to feel clay", PATIENCE, |session| {
            for (felt, tool) in has_felt.iter_mut().zip(&session.tools) {
                *felt |= tool.connected && 0.05 < norm(tool.felt_force_n);
            }
            has_felt == [true; 2]
        })
        .unwrap();
    let names: Vec<(u32, &str)> = both
        .tools
        .iter()
        .map(|tool| (tool.id, tool.operator.as_str()))
        .collect();
    assert_eq!(names, [(1, "Ada"), (2, "Bob")]);

    let mut third = Handle::start(&options.by("Cyd")).unwrap();
    let status = third.process.ends().unwrap();
    assert_eq!(status.code(), Some(2));
    let said = third.process.stderr();
    assert!(
        said.contains("all 2 tools of session `shared` are held"),
        "{said}"
    );

    // One goodbye makes room at once, and only for one.
    let mut ada = ada;
    assert!(ada.process.end().unwrap().success());
    let room = client
        .session_when("shared", "Ada's slot", PATIENCE, |session| {
            held(session).len() == 1
        })
        .unwrap();
    assert_eq!(room.tools[1].operator, "Bob");
    assert!(room.tools[1].connected, "Bob goes on");
    assert_eq!(room.tools.len(), 2, "a free tool is shown, too");
}

/// The volume balance holds at every look of every test here, see the client; this one looks as often as it can, over
/// several blocks.
#[test]
fn volume_is_conserved_at_every_look_while_blocks_come_and_go() {
    let server = Server::on_free_ports().unwrap();
    let client = &server.client;
    let _ada = Handle::start(&HandleOptions::new(&server.endpoint())).unwrap();
    let _bob = Handle::start(&HandleOptions::new(&server.endpoint()).by("Bob")).unwrap();
    let mut looks = 0_u32;
    for _ in 0..3 {
        let before = client
            .session_when(DEMO, "a two-hundredth to be cut", PATIENCE, |session| {
                looks += 1;
                session.clay.initial_units / 200 < session.clay.removed_units
            })
            .unwrap();
        client.reset(DEMO).unwrap();
        let fresh = client.session(DEMO).unwrap();
        assert_eq!(fresh.clay.epoch, before.clay.epoch + 1);
        assert!(
            fresh.clay.removed_units < before.clay.removed_units / 2,
            "{:?} after {:?}",
            fresh.clay,
            before.clay
        );
        // Nobody has left over it.
        client.session_when(DEMO, "a cut", PATIENCE, cuts).unwrap();
    }
    println!("{looks} looks while cutting");
    assert!(100 < looks);
}

/// A hand that cannot tell a change of 7 % misses nothing where such changes are not sent, and the line carries a
/// fraction.
#[test]
fn with_a_deadband_most_frames_are_left_out_and_the_cut_goes_on() {
    let server = Server::on_free_ports().unwrap();
    let client = &server.client;
    for scheme in ["force_exchange", "replica"] {
        client
            .create(&json!({
                "id": scheme, "scheme": scheme, "deadband": 0.07,
                "tool": {"kind": "ball", "radius_m": 0.0064},
            }))
            .unwrap();
        let options = HandleOptions::new(&server.endpoint()).in_session(scheme);
        let mut handle = Handle::start(&options).unwrap();
        let began = client
            .session_when(scheme, "a cut", PATIENCE, cuts)
            .unwrap();
        let ended = client.let_pass(scheme, 4000).unwrap();
        assert!(ended.clay.remaining_units < began.clay.remaining_units);
        let state = &ended.control_loop;
        println!(
            "{scheme}: {:.0} frames a second up, {:.0} down",
            state.packets_up_per_s, state.packets_down_per_s
        );
        assert!((40.0..500.0).contains(&state.packets_up_per_s), "{state:?}");
        // A running session changes over, both ends of it, and back.
        for (deadband, frames) in [(0.0, 900.0..1100.0), (0.07, 40.0..500.0)] {
            client
                .patch(scheme, &json!({ "deadband": deadband }))
                .unwrap();
            let state = client.let_pass(scheme, 4000).unwrap();
            assert_eq!(state.deadband, deadband);
            let state = state.control_loop;
            let rates = [state.packets_up_per_s, state.packets_down_per_s];
            println!("{scheme}, deadband {deadband}: {rates:.0?} frames a second");
            assert!(rates.iter().all(|rate| frames.contains(rate)), "{rates:?}");
        }
        assert!(handle.process.end().unwrap().success());
        let rows = handle.ticks().unwrap();
        let alive = rows.iter().filter(|row| row.link_state == "live").count();
        assert!(11_900 < alive, "{alive} ticks with frames");
    }
}

/// Strokes to and fro along x, each a little deeper than the one before.
fn strokes(first: f64) -> String {
    let corner = |leg: i32| {
        let side = if leg % 2 == 0 { first } else { -first };
        let depth_m = 0.004 + 0.002 * f64::from(leg);
        format!("{:.3},0,{:.3}@0.06", 0.03 * side, -depth_m)
    };
    (0..12).map(corner).collect::<Vec<_>>().join(";")
}

/// Two hands cut along one line, from both ends. What the one cuts comes to the other a delay late and moves its force,
/// in bounded steps; the server, and whoever asks it, knows of that what the hands themselves wrote down.
#[test]
fn what_one_hand_cuts_moves_the_force_of_the_other_gently_and_the_server_tells() {
    const RANGE_N: f64 = 20.0;
    let server = Server::on_free_ports().unwrap();
    let client = &server.client;
    client
        .create(&json!({
            "id": "both", "scheme": "replica", "tools": 2,
            "tool": {"kind": "ball", "radius_m": 0.0064},
            "material": {"viscosity_pa_s_per_m": 6e5},
            "network": {"up": {"delay_s": 0.04}, "down": {"delay_s": 0.04}},
        }))
        .unwrap();
    let hands = ["Ada", "Bob"].map(|name| {
        let waypoints = strokes(if name == "Ada" { 1.0 } else { -1.0 });
        let flags = ["--intent", "trajectory", "--waypoints", &waypoints];
        let options = HandleOptions::new(&server.endpoint()).in_session("both");
        let hand = Handle::start(&options.by(name).with(&flags)).unwrap();
        (name, hand)
    });
    client
        .session_when("both", "corrections of both copies", PATIENCE, |session| {
            session.tools.len() == 2 && session.tools.iter().all(|tool| 10 < tool.corrections.count)
        })
        .unwrap();
    client.patch("both", &json!({"paused": true})).unwrap();
    let told = client.let_pass("both", 1000).unwrap().tools;
    for (name, mut hand) in hands {
        // Whoever came first holds the first tool.
        let tool = told.iter().find(|tool| tool.operator == name).unwrap();
        assert!(hand.process.end().unwrap().success());
        let rows = hand.ticks().unwrap();
        let steps = rows
            .windows(2)
            .map(|pair| pair[1].correction_moved_n - pair[0].correction_moved_n);
        let largest_n = steps.fold(0.0, f64::max);
        let corrections = tool.corrections;
        println!("{name}: {corrections:?}");
        let last = rows.last().unwrap();
        assert_eq!(corrections.moved_n, last.correction_moved_n);
        assert!((corrections.largest_step_n - largest_n).abs() < 1e-6);
        assert!(0.0 < largest_n && largest_n <= 0.07 * RANGE_N);
        assert_eq!(norm(corrections.held_n), 0.0, "all of it was let in");
        assert!(corrections.injected_j <= 0.05);
    }
}

#[test]
fn the_stl_of_a_cut_block_has_no_open_edge_and_holds_what_is_left() {
    let server = Server::on_free_ports().unwrap();
    let client = &server.client;
    let _ada = Handle::start(&HandleOptions::new(&server.endpoint())).unwrap();
    client
        .session_when(DEMO, "a hundredth to be cut", PATIENCE, |session| {
            session.clay.initial_units / 100 < session.clay.removed_units
        })
        .unwrap();
    client.patch(DEMO, &json!({"paused": true})).unwrap();
    let left = client.let_pass(DEMO, 200).unwrap().clay;
    let audit = teleclay_tests::mesh::audit(&client.stl(DEMO).unwrap()).unwrap();
    // Millimetres in the file, metres in the session.
    let share = audit.volume * 1e-9 / left.remaining_volume_m3;
    println!("{} triangles, {share:.5} of the volume", audit.triangles);
    assert!(10_000 < audit.triangles);
    assert_eq!(audit.open_edges, 0);
    assert!((share - 1.0).abs() < 2e-3, "{share}");
    // The whole block would be no answer: what was cut is a hundredth.
    let initial_mm3 = left.initial_volume_m3 * 1e9;
    assert!(audit.volume < 0.995 * initial_mm3, "{} mm3", audit.volume);
}
