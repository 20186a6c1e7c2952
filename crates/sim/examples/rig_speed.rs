//! How many times faster than real time the whole rig runs: 60 s of cutting across 10 ms each way.

use std::time::{Duration, Instant};

use teleclay_clay::{Clay, Shape};
use teleclay_link::conditioner::Impairment;
use teleclay_operator::{Intent, Reach};
use teleclay_proto::join::LoopParameters;
use teleclay_proto::{Scheme, ToolDescription};
use teleclay_session::Lines;
use teleclay_sim::rig::{Rig, Setup};

fn main() {
    const RADIUS_M: f64 = 0.0064;
    let line = Impairment {
        delay: Duration::from_millis(10),
        ..Impairment::default()
    };
    let mut rig = Rig::new(Setup {
        parameters: LoopParameters {
            scheme: Scheme::ForceExchange,
            home_m: [0.064, 0.032, 0.064 + RADIUS_M],
            tool: ToolDescription::Ball { radius_m: RADIUS_M },
            ..LoopParameters::default()
        },
        clay: Clay::new(
            &Shape::Block {
                size_m: [0.128, 0.064, 0.064],
            },
            5e-4,
        )
        .expect("a block"),
        intent: Intent::cutting(Reach {
            x_m: 0.045,
            y_m: 0.018,
            depth_m: 0.02,
        })
        .expect("a reach"),
        lines: Lines {
            up: line,
            up_seed: 1,
            down: line,
            down_seed: 2,
        },
    })
    .expect("a rig");
    let started = Instant::now();
    rig.run_for(Duration::from_secs(60));
    let removed = rig.session().clay().removed_volume_m3() * 1e6;
    #[allow(clippy::print_stdout, reason = "a program")]
    {
        println!(
            "{:.0} x real time, {removed:.2} cm3 removed",
            60.0 / started.elapsed().as_secs_f64()
        );
    }
}
