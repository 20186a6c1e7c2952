//! Records `vectors/stroke.json`: a pointer that cuts, as a page wakes, tells and hears it, and the digest of what its
//! module then gives. Run it where the loop is meant to give other bits than before.
#![allow(clippy::print_stdout)] // a program's output

use serde_json::{Value, json};
use teleclay_pointer::MadePath;
use teleclay_proto::join::LoopParameters;
use teleclay_proto::{Scheme, ToolDescription};
use teleclay_session::Lines;
use teleclay_sim::pointed::{Pointed, PointedSetup};

/// A page wakes its worker so often, ms, and of the server's messages one in so many comes: a short file.
const WAKE_MS: u64 = 4;
const ONE_IN: usize = 20;

fn main() {
    let mut pointed = Pointed::new(PointedSetup {
        parameters: LoopParameters {
            scheme: Scheme::ForceExchange,
            home_m: [0.064, 0.032, 0.032 + 0.0064],
            tool: ToolDescription::Ball { radius_m: 0.0064 },
            ..LoopParameters::default()
        },
        size_m: [0.128, 0.064, 0.032],
        voxel_size_m: 1e-3,
        lines: Lines::default(),
        wakes_every: WAKE_MS,
    })
    .expect("it can be");
    let granted = String::from_utf8(pointed.granted().to_vec()).expect("it is JSON");
    let mut path = MadePath::new(11).peekable();
    let (mut wakes, mut number) = (Vec::<Value>::new(), 0_usize);
    for now_ms in 1..=1600_u64 {
        if now_ms.is_multiple_of(WAKE_MS) {
            let now_ns = now_ms * 1_000_000;
            let mut samples = Vec::new();
            while let Some((at_ns, [x, y, z])) = path.next_if(|(at_ns, _)| *at_ns <= now_ns) {
                samples.push(json!([at_ns as f64 * 1e-6, x, y, z]));
            }
            let heard = pointed.on_their_way_in().iter().filter(|_| {
                number += 1;
                number.is_multiple_of(ONE_IN)
            });
            let heard: Vec<_> = heard.map(|message| hex(message)).collect();
            wakes.push(json!({ "now_ms": now_ms, "samples": samples, "heard": heard }));
        }
        pointed.tick();
    }
    let stroke = json!({
        "about": "a pointer that cuts under force exchange; digest: FNV-1a of what each wake sends and sees",
        "keys": format!("{}{}", "07".repeat(32), "0b".repeat(32)),
        "granted": granted,
        "wakes": wakes,
        "digest": std::env::args().nth(1).unwrap_or_default(),
    });
    println!("{}", serde_json::to_string(&stroke).expect("it is JSON"));
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
