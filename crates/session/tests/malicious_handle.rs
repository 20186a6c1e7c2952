//! One who has joined and means harm: whatever a handle sends, the tools of others do not notice, to the last bit.

mod bench;

use bench::{Bench, Hand, engaged_at, new_session, reset, stroke};
use teleclay_proto::Scheme;
use teleclay_proto::frame::{Engagement, HandleFrame, MAX_FRAME, SweepRecord, Sweeps, ToolFrame};
use teleclay_proto::http::NewSession;

/// Of each scheme.
const TICKS: u32 = 200_000;
/// A fresh block now and then, so that there is always something to feel.
const FRESH_EVERY: u32 = 20_000;

/// The generator SplitMix64.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut mixed = self.0;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    }

    fn below(&mut self, limit: u64) -> u64 {
        self.next() % limit
    }

    /// A frame with anything in it, as far as it is one at all. What is left to it is to cut where a tool may: it stays
    /// above the clay, since cuts of one hand are for all to feel.
    fn frame(&mut self, hand: &mut Hand, bench: &Bench) -> HandleFrame {
        let mut buffer = [0; MAX_FRAME];
        let good = hand.frame(
            bench.now,
            HandleFrame {
                engagement: Engagement::Engaged,
                ..HandleFrame::default()
            },
        );
        if hand.header.sequence < 3 {
            // A tool that has just been taken stands where tools begin, on the block. Up from there, first.
            return HandleFrame {
                position_m: [0.0, 0.0, 0.1],
                ..good
            };
        }
        let mut bytes = good.encode(&mut buffer).to_vec();
        for _ in 0..self.below(6) {
            // Magic, version and kind stay, so that most are frames.
            let at = 4 + self.below(bytes.len() as u64 - 4) as usize;
            bytes[at] = self.next() as u8;
        }
        let mut frame = HandleFrame::decode(&bytes).unwrap_or(good);
        if self.below(3) != 0 {
            frame.header.lease = hand.lease();
        }
        if self.below(3) != 0 {
            frame.header.sequence = hand.header.sequence;
        }
        match self.below(8) {
            0 => frame.hand_force_n[self.below(3) as usize] = f64::NAN,
            1 => frame.position_m = [f64::from_bits(self.next()); 3],
            2 => frame.velocity_m_s = [f64::from_bits(self.next()); 3],
            3 => frame.wave = [f64::from_bits(self.next()); 3],
            _ => {}
        }
        // From time to time nothing else, for as long as it takes to be in fault.
        if bench.session.ticks() % 5000 < 200 {
            frame.hand_force_n[0] = f64::INFINITY;
        }
        frame.position_m[2] = 0.1;
        frame.sweeps = self.sweeps();
        frame
    }

    /// Through the air above the block, or through places where no tool may be.
    fn sweeps(&mut self) -> Sweeps {
        let mut sweeps = Sweeps::default();
        let mut from = self.place();
        for _ in 0..self.below(4) {
            let to = self.place();
            let sweep = SweepRecord {
                sequence: self.next() as u32 % 1000,
                from,
                to,
            };
            // It holds only so many, and only those that follow each other.
            let _ = sweeps.push(sweep);
            from = to;
        }
        sweeps
    }

    fn place(&mut self) -> [i32; 3] {
        let unit = f64::from(1 << 24);
        let [x, y] = [(); 2].map(|()| (self.next() as u32 % (1 << 24)) as i32 - (1 << 23));
        let above = (0.09 * unit) as i32 + self.below(1 << 30) as i32;
        [x, y, above]
    }
}

/// A stroke that drives the tool under every scheme: by place, velocity, force, wave, and cuts.
fn strokes(tick: u32, home_m: [f64; 3]) -> HandleFrame {
    let place = |tick: u32| {
        let at = stroke(tick).position_m;
        std::array::from_fn(|axis| ((home_m[axis] + at[axis]) * f64::from(1 << 24)).round() as i32)
    };
    let phase = f64::from(tick) * 0.01;
    let mut frame = HandleFrame {
        velocity_m_s: [0.08 * phase.cos(), 0.0, 0.0],
        hand_force_n: [4.0 * phase.cos(), 0.0, 0.0],
        wave: [0.25 * phase.cos(), 0.0, 0.0],
        // More than it takes: the tool spends no more than has come.
        energy_in_j: [0.01 * f64::from(tick); 3],
        wave_integral: [0.025 * phase.sin(), 0.0, 0.0],
        ..stroke(tick)
    };
    frame
        .sweeps
        .push(SweepRecord {
            sequence: tick + 1,
            from: place(tick),
            to: place(tick + 1),
        })
        .expect("there is room for one");
    frame
}

/// Ada's strokes beside Bob, who sends what `bob` makes; her frames, but for what tells of Bob: the revision,
/// which counts his faults, and his sweeps.
fn beside(
    scheme: Scheme,
    mut bob: impl FnMut(&mut Hand, &Bench) -> HandleFrame,
) -> (Vec<ToolFrame>, u64, u64) {
    let mut bench = Bench::new(NewSession {
        scheme,
        ..new_session(2)
    });
    let mut ada = bench.join("Ada").unwrap();
    let mut other = bench.join("Bob").unwrap();
    let home_m = bench.session.settings().parameters.home_m;
    let mut felt = Vec::new();
    let mut faults = 0;
    for tick in 0..TICKS {
        if tick % FRESH_EVERY == FRESH_EVERY - 1 {
            bench.command(&reset(None)).unwrap();
        }
        let theirs = bob(&mut other, &bench);
        ada.header.clay_epoch = bench.session.clay_epoch();
        let hers = ada.frame(bench.now, strokes(tick, home_m));
        bench.session.handle_frame(bench.now, other.slot, &theirs);
        bench.session.handle_frame(bench.now, ada.slot, &hers);
        bench.tick();
        if bench.session.fault(other.slot).is_some() || bench.session.side(other.slot).is_none() {
            faults += 1;
            if bench.session.side(other.slot).is_some() {
                let lease = other.lease();
                bench
                    .command(&teleclay_session::Command::Leave { lease })
                    .unwrap();
            }
            other = bench.join("Bob").unwrap();
        }
        let to_her = bench.sent.iter().filter(|(slot, _)| *slot == ada.slot);
        felt.extend(to_her.map(|(_, frame)| {
            let mut frame = *frame;
            frame.header.revision = 0;
            // Sweeps through the air are sweeps: her copy is told of them, and cuts nothing by them.
            frame.relayed = Sweeps::default();
            frame
        }));
    }
    (felt, bench.session.clay_mut().hash(), faults)
}

#[test]
fn whatever_one_handle_sends_the_other_tools_do_not_notice() {
    for &scheme in Scheme::ALL {
        let (calm, clay, faults) = beside(scheme, |hand, bench| {
            hand.frame(bench.now, engaged_at([0.0, 0.0, 0.1]))
        });
        assert_eq!(faults, 0);
        let mut random = Random(scheme.byte().into());
        let (troubled, clay_then, faults) = beside(scheme, |hand, bench| random.frame(hand, bench));
        println!(
            "{scheme:?}: {TICKS} ticks beside a handle that means harm, {faults} times in fault or out"
        );
        assert!(20 < faults, "{faults}");
        assert_eq!(calm.len(), troubled.len());
        for (tick, (calm, troubled)) in calm.iter().zip(&troubled).enumerate() {
            assert_eq!(calm, troubled, "{scheme:?}, frame {tick}");
        }
        assert_eq!(clay, clay_then);
        let pressed = calm
            .iter()
            .filter(|frame| 0.01 < frame.force_n[0].abs())
            .count();
        assert!(
            1000 < pressed,
            "{scheme:?}: she felt clay in {pressed} frames"
        );
    }
}
