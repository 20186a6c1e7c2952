//! The frame that comes down: what the tool meets.

use utoipa::ToSchema;

use super::{Gaps, Header, KIND_TOOL, MAX_FRAME, Sweeps, header, sweeps};
use crate::FrameError;
use crate::word::words;
use teleclay_wire::bytes::{Reader, Writer};

/// Bytes before the first relayed sweep.
const FIXED: usize = header::LENGTH + 6 * 24 + 8 + 8 + 4 + 4 + 8 + sweeps::HEAD;

words! {
    /// What the tool side's loop does.
    #[derive(Default)]
    pub enum LoopStatus: "loop status" {
        /// No operator is engaged; the tool rests.
        #[default]
        Idle = 0 "idle",
        /// The tool works.
        Running = 1 "running",
        /// Somebody has paused the session; the tool rests.
        Paused = 2 "paused",
        /// The loop met a value it cannot work with; forces are zero until the session is started again.
        Fault = 3 "fault",
    }
}

words! {
    /// Why the server did not merge a sweep.
    #[derive(Default, ToSchema)]
    #[serde(rename_all = "snake_case")]
    pub enum SweepRefusal: "sweep refusal" {
        /// No sweep has been refused.
        #[default]
        None = 0 "none",
        /// A pose lies outside of the reach that the parameters grant.
        OutOfReach = 1 "out_of_reach",
        /// From pose to pose in one tick would be faster than the speed limit.
        TooFast = 2 "too_fast",
        /// The frame that carried it was meant for an earlier server of the session.
        WrongOwner = 3 "wrong_owner",
        /// The sweep cut an earlier block of clay.
        WrongEpoch = 4 "wrong_epoch",
        /// The session is paused.
        Paused = 5 "paused",
        /// The tool is in fault.
        Fault = 6 "fault",
    }
}

/// The frame from the tool side to the handle, one each tick. 232 bytes, then the runs of relayed [`Sweeps`] and the
/// [`Gaps`].
///
/// ```text
///   0        48           72             96        120    144             168
///   +--------+------------+--------------+---------+------+---------------+-------------+
///   | header | position_m | velocity_m_s | force_n | wave | wave_integral | energy_in_j |
///   |        | f64x3      | f64x3        | f64x3   | f64x3| f64x3         | f64x3       |
///   +--------+------------+--------------+---------+------+---------------+-------------+
///   192               200         208                   212              216       217
///   +-----------------+-----------+---------------------+----------------+---------+------+
///   | engaged_area_m2 | clay_hash | sweeps_acknowledged | sweeps_refused | refusal | gaps |
///   |       f64       |    u64    |         u32         |      u32       |   u8    |  u8  |
///   +-----------------+-----------+---------------------+----------------+---------+------+
///   218              222           223    224
///   +----------------+-------------+------+
///   | sweeps_durable | epochs_kept | zero |
///   |      u32       |     u8      |  u8  |
///   +----------------+-------------+------+
///   224                     228    229    232
///   +-----------------------+------+------+-----------------+-------------------+
///   | oldest_unacknowledged | runs | zero | runs of relayed | gaps x 4 bytes of |
///   |          u32          |  u8  | u8x3 | sweeps          | sweep_gaps        |
///   +-----------------------+------+------+-----------------+-------------------+
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ToolFrame {
    /// Who speaks, when, and under which parameters.
    pub header: Header,
    /// What the loop does.
    pub status: LoopStatus,
    /// Why the newest refused sweep was refused.
    pub refusal: SweepRefusal,
    /// Tool position in the clay's frame, m.
    pub position_m: [f64; 3],
    /// Tool velocity, m/s.
    pub velocity_m_s: [f64; 3],
    /// Force of the clay on the tool, N.
    pub force_n: [f64; 3],
    /// Returning wave `w` per axis, √W; zero unless the scheme is `wave`.
    pub wave: [f64; 3],
    /// Time integral of `w` per axis, √W·s.
    pub wave_integral: [f64; 3],
    /// Energy that has flowed into the channel at this end per axis since joining, J. Never falls.
    pub energy_in_j: [f64; 3],
    /// Area of the tool that meets clay, m².
    pub engaged_area_m2: f64,
    /// Every sweep up to this number has been merged or refused; 0 before the first.
    pub sweeps_acknowledged: u32,
    /// Which sweeps beyond that have come as well: they will be merged or refused, and need not come again.
    pub sweep_gaps: Gaps,
    /// Every sweep up to this number stays decided whatever happens to the server, and need not be kept by who made it.
    /// Never above `sweeps_acknowledged`.
    pub sweeps_durable: u32,
    /// Sweeps of so many earlier epochs of the clay cut this one as well: it was only exchanged since, with strokes
    /// undone or redone. Saturates.
    pub epochs_kept: u8,
    /// How many sweeps were refused since joining.
    pub sweeps_refused: u32,
    /// Hash of the server's clay as of this frame; 0 while it is not known.
    pub clay_hash: u64,
    /// Sweeps of other operators' tools, for the handle's copy of the clay.
    pub relayed: Sweeps,
}

impl ToolFrame {
    /// How many bytes [`ToolFrame::encode`] writes.
    #[must_use]
    pub const fn encoded_len(&self) -> usize {
        FIXED + self.relayed.bytes() + self.sweep_gaps.bytes()
    }

    /// Writes the frame to the front of `buffer` and gives back the bytes written. Does not allocate.
    pub fn encode<'a>(&self, buffer: &'a mut [u8; MAX_FRAME]) -> &'a [u8] {
        let mut writer = Writer::new(buffer);
        self.header
            .write(KIND_TOOL, self.status.byte(), &mut writer);
        writer.f64x3(self.position_m);
        writer.f64x3(self.velocity_m_s);
        writer.f64x3(self.force_n);
        writer.f64x3(self.wave);
        writer.f64x3(self.wave_integral);
        writer.f64x3(self.energy_in_j);
        writer.put(self.engaged_area_m2.to_le_bytes());
        writer.put(self.clay_hash.to_le_bytes());
        writer.put(self.sweeps_acknowledged.to_le_bytes());
        writer.put(self.sweeps_refused.to_le_bytes());
        writer.put([self.refusal.byte(), self.sweep_gaps.count()]);
        writer.put(self.sweeps_durable.to_le_bytes());
        writer.put([self.epochs_kept, 0]);
        self.relayed.write(&mut writer);
        self.sweep_gaps.write(&mut writer);
        writer.finish()
    }

    /// Reads a frame. Does not allocate; lets non-finite floats through.
    ///
    /// # Errors
    /// When the bytes are not exactly one tool frame of this version.
    pub fn decode(bytes: &[u8]) -> Result<Self, FrameError> {
        let mut reader = Reader::new(bytes);
        let (header, status) = Header::read(KIND_TOOL, &mut reader)?;
        let status = LoopStatus::from_byte(status)?;
        let position_m = reader.f64x3()?;
        let velocity_m_s = reader.f64x3()?;
        let force_n = reader.f64x3()?;
        let wave = reader.f64x3()?;
        let wave_integral = reader.f64x3()?;
        let energy_in_j = reader.f64x3()?;
        let engaged_area_m2 = reader.f64()?;
        let clay_hash = reader.u64()?;
        let sweeps_acknowledged = reader.u32()?;
        let sweeps_refused = reader.u32()?;
        let refusal = SweepRefusal::from_byte(reader.u8()?)?;
        let gaps = reader.u8()?;
        let sweeps_durable = reader.u32()?;
        let epochs_kept = reader.u8()?;
        reader.zeros::<1>("refusal")?;
        let relayed = Sweeps::read(&mut reader)?;
        let sweep_gaps = Gaps::read(gaps, &mut reader)?;
        reader.finish()?;
        Ok(Self {
            header,
            status,
            refusal,
            position_m,
            velocity_m_s,
            force_n,
            wave,
            wave_integral,
            energy_in_j,
            engaged_area_m2,
            sweeps_acknowledged,
            sweeps_durable,
            epochs_kept,
            sweep_gaps,
            sweeps_refused,
            relayed,
            clay_hash,
        })
    }
}
