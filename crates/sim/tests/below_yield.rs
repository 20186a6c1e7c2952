//! Clay below yield, as a hand feels it.

mod rigs;

use std::time::Duration;

use rigs::{both_ways, carving, running};
use teleclay_link::conditioner::{Impairment, Outages};
use teleclay_operator::Intent;
use teleclay_proto::join::LoopParameters;
use teleclay_proto::{Axes, Preset, Scheme};

struct Seen {
    mean_n: f64,
    ripple: f64,
    speed_m_s: f64,
    energy_j: f64,
    left_n: f64,
}

fn press(scheme: Scheme, material: teleclay_proto::Material, share: f64, line: Impairment) -> Seen {
    let parameters = LoopParameters {
        axes: Axes::Three,
        ..running(scheme)
    };
    let radius_m: f64 = 0.0064;
    let yield_n = material.yield_stress_pa * std::f64::consts::PI * radius_m * radius_m;
    let mut rig = carving(parameters, Intent::Idle, material, both_ways(line, 3));
    rig.run_for(Duration::from_millis(1500));
    let press_n = (share * yield_n).min(8.0);
    // Go in until the clay holds.
    rig.device_mut()
        .intend(Intent::constant_force([0.0, 0.0, -press_n]).unwrap());
    rig.run_for(Duration::from_secs(4));
    let (mut least, mut most, mut sum, mut fastest) =
        (f64::INFINITY, f64::NEG_INFINITY, 0.0, 0.0_f64);
    let ticks = 2000;
    for _ in 0..ticks {
        rig.tick();
        let f = rig.last().felt_force_n[2];
        least = least.min(f);
        most = most.max(f);
        sum += f;
        fastest = fastest.max(rig.device().sample().velocity_m_s[2].abs());
    }
    let mean_n = sum / f64::from(ticks);
    rig.device_mut()
        .intend(Intent::constant_force([0.0, 0.0, 1.0]).unwrap());
    rig.run_for(Duration::from_secs(1));
    let left_n = rig.last().felt_force_n[2];
    Seen {
        mean_n,
        ripple: (most - least) / mean_n.abs(),
        speed_m_s: fastest,
        energy_j: rig.least_energy_j(),
        left_n,
    }
}

#[test]
fn measure() {
    let _ = Outages {
        every: Duration::from_secs(1),
        length: Duration::from_millis(100),
    };
    for scheme in [
        Scheme::ForceExchange,
        Scheme::PositionForce,
        Scheme::Wave,
        Scheme::Tdpa,
        Scheme::Replica,
    ] {
        for delay in [0, 50] {
            for preset in Preset::ALL {
                let material = preset.material();
                if material.yield_stress_pa <= 0.0 {
                    continue;
                }
                let line = Impairment {
                    delay: Duration::from_millis(delay),
                    ..Impairment::default()
                };
                let s = press(scheme, material, 0.4, line);
                println!(
                    "{scheme:14} {delay:3} ms {preset:14} mean {:7.3} N ripple {:9.5} speed {:.2e} energy {:.2e} left {:.4}",
                    s.mean_n, s.ripple, s.speed_m_s, s.energy_j, s.left_n
                );
            }
        }
    }
}
