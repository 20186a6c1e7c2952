//! A line is a spring: `1 / K_displayed = 1 / K_clay + D / b`, with `D` the mean one-way delay, play-out, filter and tick included.

mod rigs;

use std::time::Duration;

use rigs::{TICK, TICK_S, embedded, material, running};
use teleclay_bilateral::Lines;
use teleclay_link::conditioner::Impairment;
use teleclay_link::scheme::wave::FILTER_RAD_S;
use teleclay_operator::Intent;
use teleclay_proto::Scheme;
use teleclay_proto::join::LoopParameters;

#[test]
fn the_wave_line_shows_the_stiffness_that_theory_says() {
    // A wave formed at the end of a tick acts in the next, and the filter holds a steady wave back by (1 - a) / a ticks.
    let filter_share = 1.0 - (-FILTER_RAD_S * TICK_S).exp();
    let built_in_s = TICK_S * (1.0 + (1.0 - filter_share) / filter_share);
    for (up_ticks, down_ticks, modulus_pa, impedance) in [
        (0, 0, 5e4, 20.0),
        (20, 20, 5e4, 20.0),
        (60, 20, 5e4, 20.0),
        (100, 100, 2e4, 20.0),
        (50, 50, 1e4, 10.0),
        (0, 0, 1e5, 20.0),
    ] {
        let by = |ticks| Impairment {
            delay: TICK * ticks,
            ..Impairment::default()
        };
        let lines = Lines {
            up: by(up_ticks),
            up_seed: 1,
            down: by(down_ticks),
            down_seed: 2,
        };
        let parameters = LoopParameters {
            wave_impedance_n_s_per_m: impedance,
            ..running(Scheme::Wave)
        };
        let mut rig = embedded(
            parameters,
            Intent::Idle,
            material(1e4, 1e6, modulus_pa),
            lines,
        );
        // Until the first frames are there and the ramps are up, hand and tool are not coupled.
        rig.run_for(Duration::from_millis(500));
        rig.device_mut()
            .intend(Intent::constant_force([1.5, 0.0, 0.0]).unwrap());
        rig.run_for(Duration::from_secs(12));

        let felt = -rig.last().felt_force_n[0];
        let displayed = felt / rig.device().sample().position_m[0];
        let view = rig.tool().view();
        let clay = -view.force_n[0] / (view.position_m[0] - 0.064);
        let delay_s = built_in_s + 0.5 * f64::from(up_ticks + down_ticks) * TICK_S;
        let expected = 1.0 / (1.0 / clay + delay_s / impedance);
        println!(
            "{up_ticks} + {down_ticks} ticks, clay {clay:.0} N/m: {displayed:.1}, theory {expected:.1} N/m"
        );
        assert!(
            rig.device().sample().velocity_m_s[0].abs() < 1e-6,
            "not at rest"
        );
        assert!(0.5 < felt, "no contact: {felt} N");
        assert!(
            (displayed / expected - 1.0).abs() < 0.03,
            "{displayed} N/m, theory {expected} N/m"
        );
    }
}
