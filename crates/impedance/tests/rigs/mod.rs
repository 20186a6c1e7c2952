//! What several tests share: chance from a seed, a device whose motion is exact between samples, a handle likewise.
#![allow(dead_code, reason = "each test uses a part")]

use teleclay_device::DeviceProfile;
use teleclay_impedance::{CouplingSetup, DeviceTiming, LoopHandle, Playback, Scale};

pub(crate) const TICK_NS: u64 = 1_000_000;
pub(crate) const TICK_S: f64 = 1e-3;
pub(crate) const PROFILE: DeviceProfile = DeviceProfile {
    force_n: 20.0,
    slew_n_per_s: 2000.0,
    speed_m_s: 2.0,
    power_w: 15.0,
    silence_s: 0.1,
    ramp_s: 0.05,
};

/// Chance from a seed: splitmix64.
pub(crate) struct Chance(pub(crate) u64);

impl Chance {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub(crate) fn between(&mut self, least: f64, most: f64) -> f64 {
        least + (most - least) * (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Spread evenly over the orders of magnitude.
    pub(crate) fn scale(&mut self, least: f64, most: f64) -> f64 {
        self.between(least.ln(), most.ln()).exp()
    }

    pub(crate) fn below(&mut self, n: u64) -> u64 {
        self.next() % n
    }

    pub(crate) fn happens(&mut self, odds: f64) -> bool {
        self.between(0.0, 1.0) < odds
    }

    pub(crate) fn vector(&mut self, most: f64) -> [f64; 3] {
        [(); 3].map(|()| self.between(-most, most))
    }
}

/// A mass with viscous damping on three axes. Under a constant force it moves exactly as the differential equation
/// says.
#[derive(Clone, Copy)]
pub(crate) struct Body {
    pub(crate) mass_kg: f64,
    pub(crate) damping_n_s_per_m: f64,
    pub(crate) x: [f64; 3],
    pub(crate) v: [f64; 3],
}

impl Body {
    pub(crate) fn at_rest(mass_kg: f64, damping_n_s_per_m: f64) -> Self {
        Self {
            mass_kg,
            damping_n_s_per_m,
            x: [0.0; 3],
            v: [0.0; 3],
        }
    }

    pub(crate) fn pass(&mut self, force_n: [f64; 3], span_s: f64) {
        let rate = self.damping_n_s_per_m / self.mass_kg;
        let faded = -(-rate * span_s).exp_m1();
        for axis in 0..3 {
            let terminal = force_n[axis] / self.damping_n_s_per_m;
            let excess = self.v[axis] - terminal;
            self.x[axis] += terminal * span_s + excess * faded / rate;
            self.v[axis] -= excess * faded;
        }
    }
}

pub(crate) fn norm(v: [f64; 3]) -> f64 {
    v.iter().map(|part| part * part).sum::<f64>().sqrt()
}

pub(crate) fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|axis| a[axis] - b[axis])
}

pub(crate) fn plus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|axis| a[axis] + b[axis])
}

/// A device that renders forces at a kilohertz, and the loop's own handle.
pub(crate) fn rendering() -> CouplingSetup {
    CouplingSetup {
        axes: 3,
        stiffness_n_per_m: 300.0,
        damping_n_s_per_m: 0.5,
        filter_s: 0.005,
        device: DeviceTiming {
            rate_hz: 1000.0,
            damping_n_s_per_m: 2.0,
            latency_s: 0.0,
        },
        playback: Playback::Held,
        device_speed_m_s: 1.0,
        handle: LoopHandle {
            tick_s: TICK_S,
            damping_n_s_per_m: 10.0,
            latency_s: TICK_S,
        },
        handle_speed_m_s: 2.0,
        profile: PROFILE,
        hold_s: 0.003,
        ramp_s: 0.01,
        stop_force_n: f64::INFINITY,
        scale: Scale::default(),
    }
}
