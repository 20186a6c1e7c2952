//! Rows of the trailer that every frame carries: what it takes to make one, and to check one.

use std::hint::black_box;
use std::time::Instant;

use teleclay_channel::{Channel, Keys, Purpose};
use teleclay_proto::frame::{HandleFrame, MAX_FRAME};

use crate::row::{Row, quantile};

const FRAMES: usize = 1000;
const ROUNDS: usize = 101;

/// Of a handle frame without sweeps, and of the longest frame there is.
pub(crate) fn rows() -> Vec<Row> {
    let mut buffer = [0; MAX_FRAME];
    let usual = HandleFrame::default().encode(&mut buffer).to_vec();
    let [usual_seal, usual_open] = per_frame(&usual);
    let [longest_seal, longest_open] = per_frame(&[0x5a; MAX_FRAME]);
    vec![
        Row::new("frame_seal_s", "s", 1e-6, usual_seal),
        Row::new("frame_open_s", "s", 1e-6, usual_open),
        Row::new("longest_frame_seal_s", "s", 1e-6, longest_seal),
        Row::new("longest_frame_open_s", "s", 1e-6, longest_open),
    ]
}

/// Medians over rounds of what a frame takes to seal and to open, s.
fn per_frame(frame: &[u8]) -> [f64; 2] {
    let keys = Keys::new([1; 32], [2; 32]);
    let (handle, server) = (Channel::of_handle(&keys), Channel::of_server(&keys));
    let mut seals = Vec::with_capacity(ROUNDS);
    let mut opens = Vec::with_capacity(ROUNDS);
    for _ in 0..ROUNDS {
        let began = Instant::now();
        for _ in 0..FRAMES {
            black_box(handle.trailer(Purpose::Frame, black_box(frame)));
        }
        seals.push(began.elapsed().as_nanos() as u64);
        let sealed: Vec<_> = (0..FRAMES)
            .map(|_| handle.seal(Purpose::Frame, frame))
            .collect();
        let began = Instant::now();
        for frame in &sealed {
            black_box(server.open(Purpose::Frame, black_box(frame))).ok();
        }
        opens.push(began.elapsed().as_nanos() as u64);
    }
    [seals, opens].map(|mut times| quantile(&mut times, 0.5) / FRAMES as f64)
}
