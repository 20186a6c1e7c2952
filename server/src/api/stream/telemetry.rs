//! Samples of the loop, thinned to what a screen shows and put into batches without gaps.

use std::collections::BTreeMap;

use teleclay_proto::watch::{MAX_SAMPLES, TelemetryBatch, TelemetrySample};
use tokio::sync::broadcast::Receiver;
use tokio::sync::broadcast::error::TryRecvError;

use crate::Sample;

/// Samples closer together than this are thinned: 250 Hz is beyond what any plot resolves.
const LEAST_PERIOD_US: u32 = 4000;

/// A batch that is ready to be sent.
pub(super) struct Ready {
    pub(super) message: Vec<u8>,
    /// Samples that the watcher lost before it.
    pub(super) dropped: u32,
}

/// Makes the telemetry messages of one stream.
#[derive(Default)]
pub(super) struct Batcher {
    sequence: u32,
    tracks: BTreeMap<u32, Track>,
    sealed: Vec<Batch>,
    /// Samples that the channel dropped and that are not yet known to belong to a tool.
    unaccounted: u64,
}

/// The samples of one tool.
#[derive(Default)]
struct Track {
    period_us: u32,
    /// When the last sample was, taken or not.
    last_time_s: Option<f64>,
    /// Samples to leave out before the next one is taken.
    skip: u32,
    open: Option<Batch>,
    dropped: u32,
    /// The channel has dropped samples since the last one of this tool.
    lags: bool,
}

struct Batch {
    head: TelemetryBatch,
    samples: Vec<TelemetrySample>,
}

impl Batcher {
    /// Takes whatever waits in the channel and writes it into messages. What the channel had to drop is counted.
    pub(super) fn drain(&mut self, channel: &mut Receiver<Sample>) -> Vec<Ready> {
        loop {
            match channel.try_recv() {
                Ok(sample) => self.push(&sample),
                Err(TryRecvError::Lagged(lost)) => self.lose(lost),
                Err(TryRecvError::Empty | TryRecvError::Closed) => return self.flush(),
            }
        }
    }

    /// Forgets what it holds: the watcher does not want telemetry for a while, which is no loss. Sequence numbers go
    /// on.
    pub(super) fn rest(&mut self) {
        *self = Self {
            sequence: self.sequence,
            ..Self::default()
        };
    }

    fn push(&mut self, sample: &Sample) {
        let period_us = sample.period_us.max(1);
        let stride = LEAST_PERIOD_US.div_ceil(period_us);
        let track = self.tracks.entry(sample.tool).or_default();
        let steps = track.last_time_s.map_or(0.0, |last_time_s| {
            ((sample.time_s - last_time_s) * 1e6 / f64::from(period_us)).round()
        });
        // The next sample is one period later; anything else is a gap, or another beat.
        let follows = track.period_us == period_us && (0.5..1.5).contains(&steps);
        if !follows {
            self.sealed.extend(track.open.take());
            track.skip = 0;
            if track.lags {
                // A tool that was silent while the channel overflowed has lost no more than the channel did.
                let missing = (steps - 1.0).clamp(0.0, self.unaccounted as f64) as u64;
                self.unaccounted -= missing;
                let missing = missing.div_ceil(stride.into());
                track.dropped = track
                    .dropped
                    .saturating_add(u32::try_from(missing).unwrap_or(u32::MAX));
            }
        }
        track.lags = false;
        track.period_us = period_us;
        track.last_time_s = Some(sample.time_s);
        if 0 < track.skip {
            track.skip -= 1;
            return;
        }
        track.skip = stride - 1;
        let open = track.open.get_or_insert_with(|| Batch {
            head: TelemetryBatch {
                sequence: 0,
                tool: sample.tool,
                period_us: period_us.saturating_mul(stride),
                dropped: std::mem::take(&mut track.dropped),
                first_time_s: sample.time_s,
            },
            samples: Vec::with_capacity(16),
        });
        open.samples.push(sample.sample);
        if open.samples.len() == MAX_SAMPLES {
            self.sealed.extend(track.open.take());
        }
    }

    fn lose(&mut self, lost: u64) {
        self.unaccounted = self.unaccounted.saturating_add(lost);
        for track in self.tracks.values_mut() {
            track.lags = true;
        }
    }

    fn flush(&mut self) -> Vec<Ready> {
        let open = self
            .tracks
            .values_mut()
            .filter_map(|track| track.open.take());
        let batches: Vec<Batch> = self.sealed.drain(..).chain(open).collect();
        batches
            .into_iter()
            .filter_map(|mut batch| {
                batch.head.sequence = self.sequence;
                let mut message = Vec::new();
                // A batch is sealed before it is too long, so none is left out here.
                batch.head.encode(&batch.samples, &mut message).ok()?;
                self.sequence = self.sequence.wrapping_add(1);
                let dropped = batch.head.dropped;
                Some(Ready { message, dropped })
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use teleclay_proto::watch::TelemetryView;
    use tokio::sync::broadcast;

    use super::*;

    /// A sample whose force says which one it is.
    fn sample(tool: u32, index: u32, period_us: u32) -> Sample {
        Sample {
            tool,
            time_s: f64::from(index) * f64::from(period_us) * 1e-6,
            period_us,
            sample: TelemetrySample {
                hand_force_n: [index as f32, 0.0, 0.0],
                ..TelemetrySample::default()
            },
        }
    }

    /// What a watcher reads: per batch its head and the numbers of its samples.
    fn read(ready: &[Ready]) -> Vec<(TelemetryBatch, Vec<u32>)> {
        ready
            .iter()
            .map(|ready| {
                let view = TelemetryView::decode(&ready.message).unwrap();
                let indices = view.iter().map(|sample| sample.hand_force_n[0] as u32);
                (view.batch, indices.collect())
            })
            .collect()
    }

    #[test]
    fn samples_at_1_khz_are_thinned_to_every_fourth_across_batches() {
        let mut batcher = Batcher::default();
        let mut taken = Vec::new();
        for tick in 0..10 {
            for index in 37 * tick..37 * (tick + 1) {
                batcher.push(&sample(1, index, 1000));
            }
            for (head, indices) in read(&batcher.flush()) {
                assert_eq!((head.sequence, head.tool), (tick, 1));
                assert_eq!((head.period_us, head.dropped), (4000, 0));
                assert!((head.first_time_s - f64::from(indices[0]) * 1e-3).abs() < 1e-9);
                taken.extend(indices);
            }
        }
        assert_eq!(taken, (0..370).step_by(4).collect::<Vec<_>>());
    }

    #[test]
    fn samples_at_250_hz_are_all_taken() {
        let mut batcher = Batcher::default();
        for index in 5..15 {
            batcher.push(&sample(3, index, 4000));
        }
        let read = read(&batcher.flush());
        assert_eq!(read.len(), 1);
        assert_eq!(read[0].0.period_us, 4000);
        assert_eq!(read[0].1, (5..15).collect::<Vec<_>>());
        assert!(batcher.flush().is_empty(), "nothing new, nothing sent");
    }

    #[test]
    fn a_gap_ends_a_batch_and_a_silent_tool_has_lost_nothing() {
        let mut batcher = Batcher::default();
        for index in [0, 1, 2, 50, 51] {
            batcher.push(&sample(1, index, 4000));
        }
        let read = read(&batcher.flush());
        let parts: Vec<_> = read.iter().map(|(_, indices)| indices.clone()).collect();
        assert_eq!(parts, [vec![0, 1, 2], vec![50, 51]]);
        assert_eq!(read[1].0.dropped, 0);
    }

    #[test]
    fn each_tool_has_batches_of_its_own() {
        let mut batcher = Batcher::default();
        for index in 0..3 {
            batcher.push(&sample(1, index, 4000));
            batcher.push(&sample(2, 7 + index, 4000));
        }
        let read = read(&batcher.flush());
        assert_eq!(read[0].1, [0, 1, 2]);
        assert_eq!(read[1].1, [7, 8, 9]);
        assert_eq!([read[0].0.tool, read[1].0.tool], [1, 2]);
        assert_eq!([read[0].0.sequence, read[1].0.sequence], [0, 1]);
    }

    #[test]
    fn what_the_channel_drops_is_told_to_the_tool_that_lost_it() {
        let (sender, mut channel) = broadcast::channel(8);
        let mut batcher = Batcher::default();
        for index in 0..4 {
            sender.send(sample(1, index, 4000)).unwrap();
        }
        assert_eq!(read(&batcher.drain(&mut channel))[0].1, [0, 1, 2, 3]);
        for index in 4..104 {
            sender.send(sample(1, index, 4000)).unwrap();
        }
        let ready = batcher.drain(&mut channel);
        assert_eq!(ready[0].dropped, 92);
        let read = read(&ready);
        assert_eq!(read[0].0.dropped, 92);
        assert_eq!(read[0].1, (96..104).collect::<Vec<_>>());
    }

    /// Dropped samples are counted as the watcher would have seen them: thinned.
    #[test]
    fn losses_at_1_khz_are_counted_at_250_hz() {
        let (sender, mut channel) = broadcast::channel(16);
        let mut batcher = Batcher::default();
        sender.send(sample(1, 0, 1000)).unwrap();
        batcher.drain(&mut channel);
        for index in 1..=416 {
            sender.send(sample(1, index, 1000)).unwrap();
        }
        assert_eq!(batcher.drain(&mut channel)[0].dropped, 100);
    }

    #[test]
    fn a_pause_of_the_watchers_is_no_loss() {
        let mut batcher = Batcher::default();
        batcher.push(&sample(1, 0, 4000));
        assert_eq!(batcher.flush().len(), 1);
        batcher.lose(10);
        batcher.rest();
        batcher.push(&sample(1, 11, 4000));
        let read = read(&batcher.flush());
        assert_eq!((read[0].0.dropped, read[0].0.sequence), (0, 1));
    }
}
