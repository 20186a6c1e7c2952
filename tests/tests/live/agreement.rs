//! The same task over the same line, live and on the rig: what virtual time says of a scheme is what two processes do.
//!
//! Both run the same operator, tick by tick. The rig's line takes whole ticks and nothing else does; live, frames also
//! wait for the next tick at each end, threads wake late, and Zenoh and the relay take some tenths of a millisecond.

use std::time::Duration;

use serde_json::json;
use teleclay_bilateral::clay_shape;
use teleclay_clay::Clay;
use teleclay_operator::{Intent, Waypoint};
use teleclay_proto::Scheme;
use teleclay_proto::http::Session;
use teleclay_proto::join::LoopParameters;
use teleclay_session::Lines;
use teleclay_sim::rig::{Rig, Setup};
use teleclay_tests::process::PATIENCE;
use teleclay_tests::recording::{Row, norm};
use teleclay_tests::relay::{Config, Line, Relay};
use teleclay_tests::stage::{Handle, HandleOptions, Ports, Server, Transport, free_udp};
use teleclay_tests::starved::live;

use super::on_virtual_time;

const RADIUS_M: f64 = 0.0064;
/// The task is over by then.
const TASK_TICKS: usize = 4000;

/// Through the air until everything that comes slowly has come, then to and fro in the clay, and out of it.
fn corners() -> Vec<Waypoint> {
    [
        [-0.04, 0.02],
        [0.0, 0.02],
        [0.0, -0.004],
        [0.03, -0.004],
        [-0.03, -0.005],
        [-0.03, 0.01],
    ]
    .map(|[x, z]| Waypoint {
        position_m: [x, 0.0, z],
        speed_m_s: 0.06,
    })
    .to_vec()
}

/// What a run came to.
struct Run {
    /// Where the handle was, m, tick by tick from the first that was coupled on.
    positions_m: Vec<[f64; 3]>,
    /// What the hand felt, N.
    forces_n: Vec<[f64; 3]>,
    /// Volume removed in the end, in units.
    removed_units: u64,
}

fn on_the_rig(scheme: Scheme, session: &Session, [up, down]: [Line; 2]) -> Run {
    let mut reach_m = [[-0.1; 3]; 2];
    let size_m = session.clay.shape.size_m();
    reach_m[1] = size_m.map(|edge_m| edge_m + 0.1);
    let parameters = LoopParameters {
        scheme,
        tool: session.tool,
        material: session.material,
        home_m: session.tools[0].home_m,
        reach_m,
        ..LoopParameters::default()
    };
    let shape = clay_shape(&session.clay.shape).unwrap();
    let mut rig = Rig::new(Setup {
        parameters,
        clay: Clay::new(&shape, session.clay.voxel_size_m).unwrap(),
        intent: Intent::trajectory(&corners()).unwrap(),
        lines: Lines {
            up: up.0,
            up_seed: 1,
            down: down.0,
            down_seed: 2,
        },
    })
    .unwrap();
    let (mut positions_m, mut forces_n) = (Vec::new(), Vec::new());
    for _ in 0..TASK_TICKS {
        positions_m.push(rig.device().sample().position_m);
        rig.tick();
        forces_n.push(rig.last().felt_force_n);
    }
    rig.run_for(Duration::from_secs(1));
    let clay = rig.session().clay();
    Run {
        positions_m,
        forces_n,
        removed_units: clay.initial_units() - clay.remaining_units(),
    }
}

fn through_the_relay(scheme: Scheme, lines: [Line; 2]) -> (Run, Session) {
    let server = Server::start(Ports::free().unwrap(), Transport::Udp).unwrap();
    let client = &server.client;
    client
        .create(&json!({
            "id": "task", "scheme": scheme, "tool": {"kind": "ball", "radius_m": RADIUS_M},
            "material": {"viscosity_pa_s_per_m": 6e5},
        }))
        .unwrap();
    let config = Config {
        listen: free_udp().unwrap(),
        to: server.zenoh_address(),
        seed: 17,
        up: lines[0],
        down: lines[1],
    };
    let mut relay = Relay::start(&config).unwrap();
    let corners: Vec<String> = corners()
        .iter()
        .map(|corner| {
            let [x, y, z] = corner.position_m;
            format!("{x},{y},{z}@{}", corner.speed_m_s)
        })
        .collect();
    let waypoints = corners.join(";");
    let flags = ["--intent", "trajectory", "--waypoints", &waypoints];
    let options = HandleOptions::new(&relay.endpoint()).in_session("task");
    let mut handle = Handle::start(&options.with(&flags)).unwrap();
    client
        .session_when("task", "the hand", PATIENCE, |session| {
            session.tools.iter().any(|tool| tool.connected)
        })
        .unwrap();
    let ended = client.let_pass("task", TASK_TICKS as u64 + 1500).unwrap();
    let report = relay.report().unwrap();
    for (done, line) in [(report.up, lines[0]), (report.down, lines[1])] {
        assert!(TASK_TICKS as u64 <= done.came, "{done:?}");
        let off_s = done.delay_p50_s - line.0.delay.as_secs_f64();
        assert!((0.0..0.001).contains(&off_s), "{done:?}");
    }
    assert!(handle.process.end().unwrap().success());
    let rows = handle.ticks().unwrap();
    let coupled: Vec<&Row> = rows
        .iter()
        .filter(|row| row.mode == "coupled")
        .take(TASK_TICKS)
        .collect();
    let run = Run {
        positions_m: coupled.iter().map(|row| row.position_m).collect(),
        forces_n: coupled.iter().map(|row| row.felt_force_n).collect(),
        removed_units: ended.clay.removed_units,
    };
    (run, ended)
}

/// What a hand feels and where it is, live, beside the same on the rig: root mean square of the difference.
fn rms_apart(live: &[[f64; 3]], rig: &[[f64; 3]]) -> f64 {
    assert_eq!(live.len(), rig.len());
    let squares = live.iter().zip(rig).map(|(a, b)| {
        let off = norm(std::array::from_fn(|axis| a[axis] - b[axis]));
        off * off
    });
    (squares.sum::<f64>() / live.len() as f64).sqrt()
}

/// Means over 20 ms. Where a frame misses its tick, position-force makes of two small steps none and a large one, and
/// of the force a gap and a peak.
fn smoothed(values: &[[f64; 3]]) -> Vec<[f64; 3]> {
    values
        .chunks_exact(20)
        .map(|chunk| {
            std::array::from_fn(|axis| {
                chunk.iter().map(|value| value[axis]).sum::<f64>() / chunk.len() as f64
            })
        })
        .collect()
}

#[test]
fn each_scheme_does_through_the_relay_what_it_does_on_the_rig() {
    live(compare_all_schemes, || {
        let bad = "jitter_ms=3 loss=0.05";
        on_virtual_time::nothing_is_lost_over(
            &format!("delay_ms=15 {bad}"),
            &format!("delay_ms=25 {bad}"),
            4000,
        );
        for scheme in [Scheme::Wave, Scheme::Tdpa] {
            on_virtual_time::no_energy_is_made(scheme, "delay_ms=15", "delay_ms=25");
        }
    });
}

fn compare_all_schemes() {
    for &scheme in Scheme::ALL {
        let lines = ["delay_ms=15", "delay_ms=25"].map(|line| line.parse::<Line>().unwrap());
        let (live_run, session) = through_the_relay(scheme, lines);
        let rig = on_the_rig(scheme, &session, lines);
        let greatest_n = rig.forces_n.iter().copied().map(norm).fold(0.0, f64::max);
        let force = [
            rms_apart(&live_run.forces_n, &rig.forces_n),
            rms_apart(&smoothed(&live_run.forces_n), &smoothed(&rig.forces_n)),
        ]
        .map(|apart_n| apart_n / greatest_n);
        let place_m = rms_apart(&live_run.positions_m, &rig.positions_m);
        let volume = live_run.removed_units as f64 / rig.removed_units as f64 - 1.0;
        println!(
            "{scheme}: force {:.3} % of {greatest_n:.2} N apart, means over 20 ms {:.3} %; place {:.4} mm; removed volume {:+.3} %",
            100.0 * force[0],
            100.0 * force[1],
            1e3 * place_m,
            100.0 * volume
        );
        assert!(1.0 < greatest_n, "{scheme}: hardly any force");
        assert!(1_000_000 < rig.removed_units, "{scheme}: hardly any cut");
        assert!(force[1] < 0.05, "{scheme}");
        assert!(place_m < 3e-4, "{scheme}");
        assert!(volume.abs() < 0.025, "{scheme}");
        if scheme == Scheme::Replica {
            // Once the copy is there the hand knows of no line, so it has cut the same to the last bit.
            assert_eq!(live_run.removed_units, rig.removed_units);
            assert!(force[0] < 0.01);
        }
    }
}
