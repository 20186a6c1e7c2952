//! The frame that goes up: what the hand does.

use utoipa::ToSchema;

use super::{
    Corrections, Gaps, Header, KIND_HANDLE, MAX_FRAME, Sweeps, corrections, header, sweeps,
};
use crate::FrameError;
use crate::word::words;
use teleclay_wire::bytes::{Reader, Writer};

/// Bytes before the first sweep.
pub(super) const FIXED: usize =
    header::LENGTH + 7 * 24 + 8 + 8 + corrections::LENGTH + sweeps::HEAD;

words! {
    /// What the handle's copy of the clay is good for.
    #[derive(Default, ToSchema)]
    #[serde(rename_all = "snake_case")]
    pub enum CopyState: "copy state" {
        /// There is none: the scheme needs none, or it has not come yet.
        #[default]
        None = 0 "none",
        /// It is cut here at once, and the cuts are in `sweeps`.
        Live = 1 "live",
        /// No frame has come for too long: the copy is felt but no longer cut.
        Stale = 2 "stale",
        /// It was found to differ from the server's: a snapshot has been asked for.
        Diverged = 3 "diverged",
    }
}

words! {
    /// Whether the hand drives the tool.
    #[derive(Default)]
    pub enum Engagement: "engagement" {
        /// The operator has joined but does not drive the tool.
        #[default]
        Idle = 0 "idle",
        /// The tool follows the handle.
        Engaged = 1 "engaged",
        /// The operator is about to leave; the tool is to stop now.
        Leaving = 2 "leaving",
    }
}

/// The frame from the handle to the tool side, one each tick. 276 bytes, then the runs of [`Sweeps`] and the [`Gaps`].
///
/// ```text
///   0        48           72             96              120             144    168             192
///   +--------+------------+--------------+---------------+---------------+------+---------------+-------------+
///   | header | position_m | velocity_m_s | hand_force_n  | felt_force_n  | wave | wave_integral | energy_in_j |
///   |        | f64x3      | f64x3        | f64x3         | f64x3         | f64x3| f64x3         | f64x3       |
///   +--------+------------+--------------+---------------+---------------+------+---------------+-------------+
///   216         224                   228    229    230    232           268
///   +-----------+---------------------+------+------+------+-------------+
///   | clay_hash | relayed_acknowledged| copy | gaps | zero | 36 bytes of |
///   |    u64    |         u32         |  u8  |  u8  | u8x2 | corrections |
///   +-----------+---------------------+------+------+------+-------------+
///   268                     272    273    276
///   +-----------------------+------+------+-----------------+--------------------+
///   | oldest_unacknowledged | runs | zero | runs of sweeps, | gaps x 4 bytes of  |
///   |          u32          |  u8  | u8x3 | one by one      | relayed_gaps       |
///   +-----------------------+------+------+-----------------+--------------------+
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HandleFrame {
    /// Who speaks, when, and under which parameters.
    pub header: Header,
    /// Whether the hand drives the tool.
    pub engagement: Engagement,
    /// Handle position in the handle's frame, m.
    pub position_m: [f64; 3],
    /// Handle velocity, m/s.
    pub velocity_m_s: [f64; 3],
    /// Force of the hand on the handle, as its sensor measures it, N.
    pub hand_force_n: [f64; 3],
    /// Reaction that this side renders to the hand, N.
    pub felt_force_n: [f64; 3],
    /// Outgoing wave `u` per axis, √W; zero unless the scheme is `wave`.
    pub wave: [f64; 3],
    /// Time integral of `u` per axis, √W·s: lets the other end undo the drift that lost waves cause.
    pub wave_integral: [f64; 3],
    /// Energy that has flowed into the channel at this end per axis since joining, J. Never falls.
    pub energy_in_j: [f64; 3],
    /// Hash of the handle's copy of the clay; 0 when it keeps none.
    pub clay_hash: u64,
    /// Every relayed sweep up to this number has come; 0 when the first is missing.
    pub relayed_acknowledged: u32,
    /// Which relayed sweeps beyond that have come as well.
    pub relayed_gaps: Gaps,
    /// What the handle's copy of the clay is good for.
    pub copy: CopyState,
    /// What corrections of the copy have done to the hand.
    pub corrections: Corrections,
    /// Cuts that the server has not acknowledged.
    pub sweeps: Sweeps,
}

impl HandleFrame {
    /// How many bytes [`HandleFrame::encode`] writes.
    #[must_use]
    pub const fn encoded_len(&self) -> usize {
        FIXED + self.sweeps.bytes() + self.relayed_gaps.bytes()
    }

    /// Writes the frame to the front of `buffer` and gives back the bytes written. Does not allocate.
    pub fn encode<'a>(&self, buffer: &'a mut [u8; MAX_FRAME]) -> &'a [u8] {
        let mut writer = Writer::new(buffer);
        self.header
            .write(KIND_HANDLE, self.engagement.byte(), &mut writer);
        writer.f64x3(self.position_m);
        writer.f64x3(self.velocity_m_s);
        writer.f64x3(self.hand_force_n);
        writer.f64x3(self.felt_force_n);
        writer.f64x3(self.wave);
        writer.f64x3(self.wave_integral);
        writer.f64x3(self.energy_in_j);
        writer.put(self.clay_hash.to_le_bytes());
        writer.put(self.relayed_acknowledged.to_le_bytes());
        writer.put([self.copy.byte(), self.relayed_gaps.count(), 0, 0]);
        self.corrections.write(&mut writer);
        self.sweeps.write(&mut writer);
        self.relayed_gaps.write(&mut writer);
        writer.finish()
    }

    /// Reads a frame. Does not allocate; lets non-finite floats through.
    ///
    /// # Errors
    /// When the bytes are not exactly one handle frame of this version.
    pub fn decode(bytes: &[u8]) -> Result<Self, FrameError> {
        let mut reader = Reader::new(bytes);
        let (header, engagement) = Header::read(KIND_HANDLE, &mut reader)?;
        let position_m = reader.f64x3()?;
        let velocity_m_s = reader.f64x3()?;
        let hand_force_n = reader.f64x3()?;
        let felt_force_n = reader.f64x3()?;
        let wave = reader.f64x3()?;
        let wave_integral = reader.f64x3()?;
        let energy_in_j = reader.f64x3()?;
        let clay_hash = reader.u64()?;
        let relayed_acknowledged = reader.u32()?;
        let copy = CopyState::from_byte(reader.u8()?)?;
        let gaps = reader.u8()?;
        reader.zeros::<2>("copy state")?;
        let corrections = Corrections::read(&mut reader)?;
        let sweeps = Sweeps::read(&mut reader)?;
        let relayed_gaps = Gaps::read(gaps, &mut reader)?;
        reader.finish()?;
        Ok(Self {
            header,
            engagement: Engagement::from_byte(engagement)?,
            position_m,
            velocity_m_s,
            hand_force_n,
            felt_force_n,
            wave,
            wave_integral,
            energy_in_j,
            clay_hash,
            relayed_acknowledged,
            relayed_gaps,
            copy,
            corrections,
            sweeps,
        })
    }
}
