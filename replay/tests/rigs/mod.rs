//! Rigs that are recorded, and what tests do to their files.
#![allow(dead_code, reason = "each test uses a part")]

use std::collections::BTreeMap;
use std::io::Write;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use mcap::write::NoSeek;
use mcap::{Message, MessageStream, WriteOptions};
use rand_core::Rng as _;
use rand_pcg::Pcg32;
use teleclay_clay::{Clay, Shape};
use teleclay_link::conditioner::Impairment;
use teleclay_operator::{Intent, Reach};
use teleclay_proto::http::{ClayReset, SessionPatch};
use teleclay_proto::join::LoopParameters;
use teleclay_proto::{Material, Scheme, ToolDescription};
use teleclay_recording::About;
use teleclay_replay::Studio;
use teleclay_session::{Command, Lines};
use teleclay_sim::rig::{Further, Rig, Setup};

pub(crate) const SCHEMES: [Scheme; 5] = [
    Scheme::ForceExchange,
    Scheme::PositionForce,
    Scheme::Wave,
    Scheme::Tdpa,
    Scheme::Replica,
];

/// A file in memory.
#[derive(Clone, Default)]
pub(crate) struct File(Arc<Mutex<Vec<u8>>>);

impl File {
    pub(crate) fn bytes(&self) -> Vec<u8> {
        self.0.lock().unwrap().clone()
    }
}

impl Write for File {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.lock().unwrap().extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

pub(crate) struct Recorded {
    pub(crate) rig: Rig,
    pub(crate) studio: Studio<File>,
    pub(crate) file: File,
}

impl Recorded {
    /// Two operators over one block, and a recording of them.
    pub(crate) fn new(scheme: Scheme, line: Impairment) -> Self {
        Self::of(rig(scheme, line, &[0.084]))
    }

    /// One operator, and a recording of it.
    pub(crate) fn alone(scheme: Scheme, line: Impairment) -> Self {
        Self::of(rig(scheme, line, &[]))
    }

    fn of(mut rig: Rig) -> Self {
        let tools = rig.session().tools();
        let file = File::default();
        let studio = Studio::new(file.clone(), about(), tools, 1).unwrap();
        rig.hear_with(Some(Box::new(studio.clone())));
        // Until the block is copied.
        rig.run_for(Duration::from_millis(20));
        Self { rig, studio, file }
    }

    /// The operator of a tool leaves, and takes it again.
    pub(crate) fn rejoin(&mut self, slot: usize) {
        let lease = self.rig.session().side(slot).unwrap().lease();
        let now = self.rig.now();
        let session = self.rig.session_mut();
        session.carry_out(now, &Command::Leave { lease }).unwrap();
        self.rig.renew_lease(slot).unwrap();
    }

    /// The whole file, and the hash of the clay at its end.
    pub(crate) fn finish(mut self) -> (Vec<u8>, u64) {
        self.studio.finish(self.rig.session_mut()).unwrap();
        (self.file.bytes(), self.rig.session_mut().clay_mut().hash())
    }
}

pub(crate) fn about() -> About {
    About {
        session: "rig".to_owned(),
        offset_ns: 0,
        topics: None,
        diagnose: None,
    }
}

/// Two operators over a clean line.
pub(crate) fn rig_of_two(scheme: Scheme) -> Rig {
    rig(scheme, line(0, 0.0, 0.0), &[0.084])
}

fn rig(scheme: Scheme, line: Impairment, further_x_m: &[f64]) -> Rig {
    let radius_m = 0.0064;
    let home = |x_m: f64| [x_m, 0.032, 0.064 + radius_m];
    let cutting = || {
        Intent::cutting(Reach {
            x_m: 0.03,
            y_m: 0.018,
            depth_m: 0.020,
        })
        .unwrap()
    };
    Rig::with_further(
        Setup {
            parameters: LoopParameters {
                scheme,
                home_m: home(0.044),
                tool: ToolDescription::Ball { radius_m },
                material: viscous(2e5),
                ..LoopParameters::default()
            },
            clay: Clay::new(
                &Shape::Block {
                    size_m: [0.128, 0.064, 0.064],
                },
                1e-3,
            )
            .unwrap(),
            intent: cutting(),
            lines: Lines {
                up: line,
                up_seed: 1,
                down: line,
                down_seed: 2,
            },
        },
        further_x_m
            .iter()
            .map(|x_m| Further {
                home_m: home(*x_m),
                intent: cutting(),
            })
            .collect(),
    )
    .unwrap()
}

pub(crate) fn viscous(pa_s_per_m: f64) -> Material {
    Material {
        viscosity_pa_s_per_m: pa_s_per_m,
        yield_stress_pa: 0.0,
        stiffness_pa: 0.0,
    }
}

pub(crate) fn line(delay_ms: u64, jitter_ratio: f64, loss: f64) -> Impairment {
    let delay = Duration::from_millis(delay_ms);
    Impairment {
        delay,
        jitter: delay.mul_f64(jitter_ratio),
        loss,
        ..Impairment::default()
    }
}

/// Whatever a session may be told, by chance.
pub(crate) fn command(recorded: &mut Recorded, chance: &mut Pcg32) {
    let patch = SessionPatch::default();
    let rig = &mut recorded.rig;
    match chance.next_u32() % 7 {
        0 => rig.pause(),
        1 => rig.resume(),
        2 => rig.change_scheme(SCHEMES[chance.next_u32() as usize % SCHEMES.len()]),
        3 => {
            let (reset, now) = (ClayReset::default(), rig.now());
            let reset = Command::Reset { reset, lease: None };
            rig.session_mut().carry_out(now, &reset).unwrap();
        }
        4 => rig.patch(SessionPatch {
            material: Some(viscous(1e5 + f64::from(chance.next_u32() % 100) * 1e3).into()),
            ..patch
        }),
        5 => rig.patch(SessionPatch {
            deadband: Some(f64::from(chance.next_u32() % 2) * 0.05),
            ..patch
        }),
        _ => recorded.rejoin(chance.next_u32() as usize % 2),
    }
}

/// The same file with its messages changed, or left out where `change` says no.
pub(crate) fn rewritten(
    file: &[u8],
    mut change: impl FnMut(&mut Message<'static>) -> bool,
) -> Vec<u8> {
    let mut out = Vec::new();
    let mut writer = WriteOptions::new()
        .profile("ros2")
        .compression(None)
        .disable_seeking(true)
        .create(NoSeek::new(&mut out))
        .unwrap();
    for message in MessageStream::new(file).unwrap() {
        let mut message = message.unwrap();
        if change(&mut message) {
            writer.write(&message).unwrap();
        }
    }
    writer.finish().unwrap();
    drop(writer);
    out
}

/// Messages by topic.
pub(crate) fn counts(file: &[u8]) -> BTreeMap<String, usize> {
    let mut counts = BTreeMap::new();
    for message in MessageStream::new(file).unwrap() {
        *counts
            .entry(message.unwrap().channel.topic.clone())
            .or_default() += 1;
    }
    counts
}
