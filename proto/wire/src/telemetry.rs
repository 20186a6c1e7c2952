//! Samples of the loop, in batches.

use crate::FrameError;
use crate::bytes::Reader;
use crate::{Kind, MAX_MESSAGE, PREFIX, read_prefix_of, write_prefix};

/// Bytes before the first sample.
const FIXED: usize = PREFIX + 24;

/// Numbers of one sample.
const VALUES: usize = 27;

/// Bytes of one sample.
const SAMPLE: usize = VALUES * 4;

/// Most samples of one batch, so that it keeps within [`MAX_MESSAGE`].
pub const MAX_SAMPLES: usize = (MAX_MESSAGE - FIXED) / SAMPLE;

/// One moment of the loop, as the tool side knows it. 27 `f32` in the order of the fields, 108 bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TelemetrySample {
    /// Force of the hand on the handle, N.
    pub hand_force_n: [f32; 3],
    /// Reaction that the handle renders to the hand, N.
    pub felt_force_n: [f32; 3],
    /// Force of the clay on the tool, N.
    pub tool_force_n: [f32; 3],
    /// Handle position in the handle's frame, m.
    pub handle_position_m: [f32; 3],
    /// Tool position in the clay's frame, m.
    pub tool_position_m: [f32; 3],
    /// Handle velocity, m/s.
    pub handle_velocity_m_s: [f32; 3],
    /// Tool velocity, m/s.
    pub tool_velocity_m_s: [f32; 3],
    /// Energy that flowed into the link at the handle less what left it there, J.
    pub energy_handle_j: f32,
    /// Energy that flowed into the link at the tool less what left it there, J.
    pub energy_tool_j: f32,
    /// Round trip, s.
    pub rtt_s: f32,
    /// How far corrections of the handle's copy of the clay have moved the felt force since the sample before, N.
    pub correction_step_n: f32,
    /// Magnitude of the felt force less the force that the corrected copy gives, N: what is still to be let in.
    pub correction_held_n: f32,
    /// Time since the newest frame from the handle came, s.
    pub age_s: f32,
}

/// What a batch says about its samples. They are evenly spaced and without gap: a gap ends a batch.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TelemetryBatch {
    /// Number of the message on its stream.
    pub sequence: u32,
    /// Whose samples they are: the `id` of a tool of the session.
    pub tool: u32,
    /// From sample to sample, µs.
    pub period_us: u32,
    /// Samples that this reader has lost since its last batch of this tool.
    pub dropped: u32,
    /// Time of the first sample since the session began, s.
    pub first_time_s: f64,
}

/// More samples than a batch may hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{got} samples, a batch holds at most {MAX_SAMPLES}")]
pub struct TooManySamples {
    /// Samples given.
    pub got: usize,
}

/// A batch, decoded in place.
///
/// ```text
///  0        8      12             16          20        24             32
///  +--------+------+--------------+-----------+---------+--------------+--------------------------+
///  | prefix | tool | sample_count | period_us | dropped | first_time_s | sample_count x 108 bytes |
///  |        | u32  |     u32      |    u32    |   u32   |     f64      | samples                  |
///  +--------+------+--------------+-----------+---------+--------------+--------------------------+
/// ```
#[derive(Clone, Copy, Debug)]
pub struct TelemetryView<'a> {
    /// What the batch says about its samples.
    pub batch: TelemetryBatch,
    samples: &'a [u8],
}

impl TelemetryBatch {
    /// Writes a batch in place of whatever `message` holds.
    ///
    /// # Errors
    /// When there are more than [`MAX_SAMPLES`]; `message` is then unchanged.
    pub fn encode(
        &self,
        samples: &[TelemetrySample],
        message: &mut Vec<u8>,
    ) -> Result<(), TooManySamples> {
        if MAX_SAMPLES < samples.len() {
            return Err(TooManySamples { got: samples.len() });
        }
        message.clear();
        message.reserve(FIXED + SAMPLE * samples.len());
        write_prefix(Kind::Telemetry, self.sequence, message);
        for word in [
            self.tool,
            samples.len() as u32,
            self.period_us,
            self.dropped,
        ] {
            message.extend_from_slice(&word.to_le_bytes());
        }
        message.extend_from_slice(&self.first_time_s.to_le_bytes());
        for sample in samples {
            for value in sample.values() {
                message.extend_from_slice(&value.to_le_bytes());
            }
        }
        Ok(())
    }
}

impl<'a> TelemetryView<'a> {
    /// Reads a batch. Does not allocate; lets non-finite floats through.
    ///
    /// # Errors
    /// When the bytes are not exactly one batch of this version.
    pub fn decode(bytes: &'a [u8]) -> Result<Self, FrameError> {
        let mut reader = Reader::new(bytes);
        let sequence = read_prefix_of(Kind::Telemetry, &mut reader)?;
        let tool = reader.u32()?;
        let count = reader.u32()?;
        let period_us = reader.u32()?;
        let dropped = reader.u32()?;
        let first_time_s = reader.f64()?;
        if MAX_SAMPLES < count as usize {
            return Err(FrameError::TooMany {
                field: "samples",
                got: count.into(),
                most: MAX_SAMPLES as u64,
            });
        }
        let samples = reader.slice(SAMPLE * count as usize)?;
        reader.finish()?;
        Ok(Self {
            batch: TelemetryBatch {
                sequence,
                tool,
                period_us,
                dropped,
                first_time_s,
            },
            samples,
        })
    }

    /// How many samples the batch holds.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.samples.len() / SAMPLE
    }

    /// Whether it holds none.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.samples.is_empty()
    }

    /// The samples, oldest first.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = TelemetrySample> + 'a {
        self.samples
            .as_chunks::<SAMPLE>()
            .0
            .iter()
            .map(TelemetrySample::from_bytes)
    }
}

impl TelemetrySample {
    fn values(&self) -> [f32; VALUES] {
        let vectors = [
            self.hand_force_n,
            self.felt_force_n,
            self.tool_force_n,
            self.handle_position_m,
            self.tool_position_m,
            self.handle_velocity_m_s,
            self.tool_velocity_m_s,
        ];
        let mut values = [0.0; VALUES];
        values[..21].copy_from_slice(vectors.as_flattened());
        values[21..24].copy_from_slice(&[self.energy_handle_j, self.energy_tool_j, self.rtt_s]);
        values[24..].copy_from_slice(&[self.correction_step_n, self.correction_held_n, self.age_s]);
        values
    }

    fn from_bytes(bytes: &[u8; SAMPLE]) -> Self {
        let words = bytes.as_chunks().0;
        let value = |index: usize| f32::from_le_bytes(words[index]);
        let vector = |index: usize| [value(3 * index), value(3 * index + 1), value(3 * index + 2)];
        Self {
            hand_force_n: vector(0),
            felt_force_n: vector(1),
            tool_force_n: vector(2),
            handle_position_m: vector(3),
            tool_position_m: vector(4),
            handle_velocity_m_s: vector(5),
            tool_velocity_m_s: vector(6),
            energy_handle_j: value(21),
            energy_tool_j: value(22),
            rtt_s: value(23),
            correction_step_n: value(24),
            correction_held_n: value(25),
            age_s: value(26),
        }
    }
}
