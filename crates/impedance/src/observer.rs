//! The energy that a coupling has taken, less what it has given.
//!
//! Over one tick the coupling pushes the handle with `f` and the device with `-f`; the handle moves by `dy`, the device
//! by `dx`, all in the handle's coordinates. It takes `f·(dx - dy)`. The dampings of the two sides take
//! `b |dx|² / T + b_h |dy|² / T` of the same tick at least, whatever the way in between, and they are what pays for a
//! value that is held: a sampled spring alone gives energy, [C94]. So passive is what never falls below zero is the sum
//!
//! ```text
//! E = sum f·(dx - dy) + b |dx|² / T + b_h |dy|² / T
//! ```
//!
//! For `f = cap(K s + B v)`, `s` the stretch at the beginning of the tick and `v` an average of earlier `d / T` with
//! `d = dx - dy`, that is a theorem wherever `K T/2 + |B| <= b_s`: let `V(s)` be the energy of the capped spring,
//! convex, with a slope that changes by `K` a metre at most.
//!
//! ```text
//! cap(K s)·d                        >= V(s + d) - V(s) - K |d|² / 2       a tangent lies below its curve
//! (cap(K s + B v) - cap(K s))·d     >= -B |v| |d|                        a cap to a ball brings nothing farther apart
//! b |dx|² + b_h |dy|²               >= b_s |d|²                          dampers in series
//! ```
//!
//! Summed, `E >= V(s) + (b_s - K T/2 - |B|) sum |d|² / T >= V(s)`. Letting go multiplies a force that fades with the
//! spring held where it was: what can be drawn from `|f|` within the time is `|f|² t / (4 b_s)`, `t` the hold and a
//! third of the ramp, and no more than the spring stores where `K t / 2 <= b_s`, which
//! [`Coupling::new`](crate::Coupling::new) asks for. A new grip starts at `s = 0`: it gives nothing.
//!
//! Joules are the handle's; the device's are these times [`Scale::power_ratio`](crate::Scale::power_ratio).

use crate::stiffness::{DeviceTiming, LoopHandle};
use crate::vector::{Vector, dot};

/// Counts the energy at both ends of a coupling, tick by tick.
#[derive(Clone, Copy, Debug)]
pub struct Observer {
    device_n_s_per_m: f64,
    handle_n_s_per_m: f64,
    tick_s: f64,
    energy_j: f64,
    least_j: f64,
}

impl Observer {
    /// At rest, between a device in the handle's coordinates and a handle.
    ///
    /// A side that no force moves pays nothing here, though its damping is infinite: a hand on a mouse gives what it
    /// likes, and no sum that it is part of is promised to stay above anything.
    pub fn new(device: &DeviceTiming, handle: &LoopHandle) -> Self {
        Self {
            device_n_s_per_m: paid(device.damping_n_s_per_m),
            handle_n_s_per_m: paid(handle.damping_n_s_per_m),
            tick_s: handle.tick_s,
            energy_j: 0.0,
            least_j: 0.0,
        }
    }

    /// The device is behind another scale from now on.
    pub fn on_scale(&mut self, device: &DeviceTiming) {
        self.device_n_s_per_m = paid(device.damping_n_s_per_m);
    }

    /// Over one tick the handle was pushed with `force_n` and moved by `handle_way_m`, and the device by `device_way_m`
    /// in the handle's coordinates.
    pub fn on_tick(&mut self, force_n: [f64; 3], device_way_m: [f64; 3], handle_way_m: [f64; 3]) {
        let taken = dot(force_n, device_way_m) - dot(force_n, handle_way_m);
        let damped = self.device_n_s_per_m * squared(device_way_m)
            + self.handle_n_s_per_m * squared(handle_way_m);
        self.energy_j += taken + damped / self.tick_s;
        self.least_j = self.least_j.min(self.energy_j);
    }

    /// What was taken and not given back, with what the dampings took, J.
    pub fn energy_j(&self) -> f64 {
        self.energy_j
    }

    /// The least that it has been, J: zero for what is passive.
    pub fn least_j(&self) -> f64 {
        self.least_j
    }
}

fn paid(damping_n_s_per_m: f64) -> f64 {
    if damping_n_s_per_m.is_finite() {
        damping_n_s_per_m
    } else {
        0.0
    }
}

fn squared(v: Vector) -> f64 {
    dot(v, v)
}
