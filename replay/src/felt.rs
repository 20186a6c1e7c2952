//! The recorded hand in another loop: what would it have felt?
//!
//! A simulated person goes the recorded hand's way with its force, on the paper's handle, from the clay with which the
//! recording began. Where the other loop answers otherwise, the hand is pulled off its way and the person pulls it
//! back, as people do; so this is an estimate, and no more than that. What the network did in the recording is over:
//! the line is the one that the session was told to have, or the one that is asked for.

use std::collections::BTreeMap;
use std::time::Duration;

use teleclay_history::{Malformed, State};
use teleclay_operator::{Intent, Track, TrackError, TrackPoint};
use teleclay_proto::Scheme;
use teleclay_proto::frame::HandleFrame;
use teleclay_proto::join::LoopParameters;
use teleclay_recording::{About, WriteError};
use teleclay_reel::{ReadError, Recorded, Step};
use teleclay_session::Lines;
use teleclay_sim::rig::{Rig, RigError, Setup};

use crate::studio::Studio;

/// A person takes this long to be on the way.
const SETTLING: Duration = Duration::from_millis(500);

/// Why there is no answer.
#[derive(Debug, thiserror::Error)]
pub enum FeltError {
    /// The file.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// Its state.
    #[error("the state in it: {0}")]
    State(#[from] Malformed),
    /// There is no hand in it.
    #[error("no frame of {} is in the recording", .tool.map_or("any tool".to_owned(), |tool| format!("tool {tool}")))]
    NoHand {
        /// The tool that was asked for.
        tool: Option<u32>,
    },
    /// The hand's way.
    #[error(transparent)]
    Track(#[from] TrackError),
    /// The loop.
    #[error(transparent)]
    Rig(#[from] RigError),
    /// The new recording.
    #[error("the new recording: {0}")]
    Write(#[from] WriteError),
}

/// What is asked.
#[derive(Clone, Copy, Debug, Default)]
pub struct Question {
    /// Whose hand, by tool; else the one of which there is most.
    pub tool: Option<u32>,
    /// Under which scheme, if not the recorded one.
    pub scheme: Option<Scheme>,
    /// Over which line, if not the one that the session was told to have.
    pub lines: Option<Lines>,
}

/// A force over time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Force {
    /// Root of its mean square, N.
    pub rms_n: f64,
    /// Its largest, N.
    pub peak_n: f64,
}

/// What was felt, then and now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Felt {
    /// Whose hand it is, by tool.
    pub tool: u32,
    /// The scheme then and now.
    pub schemes: [Scheme; 2],
    /// How long the hand moved, s.
    pub lasts_s: f64,
    /// What was felt then.
    pub then: Force,
    /// What is felt now.
    pub now: Force,
    /// Root mean square of the difference, over that of what was felt then; `None` where nothing was.
    pub force_nrmse: Option<f64>,
    /// Root mean square of how far the hand is from where it was, m.
    pub position_rmse_m: f64,
}

/// A hand that was recorded, and what it was recorded with.
pub struct Hand {
    state: State,
    tool: u32,
    points: Vec<TrackPoint>,
    felt_n: Vec<[f64; 3]>,
}

impl Hand {
    /// Finds the hand in a recording.
    ///
    /// # Errors
    /// There is none, or the recording cannot be read.
    pub fn read(file: &[u8], tool: Option<u32>) -> Result<Self, FeltError> {
        let mut state = None;
        let mut frames: BTreeMap<(usize, u32), BTreeMap<u64, HandleFrame>> = BTreeMap::new();
        for step in Recorded::new(file)? {
            match step? {
                Step::State(bytes) if state.is_none() => state = Some(State::decode(&bytes)?),
                Step::State(_) | Step::Hash(_) => {}
                Step::Ticked(tick) => {
                    for came in tick.frames {
                        if let Ok(frame) = HandleFrame::decode(&came.bytes) {
                            let of = frames.entry((came.slot, frame.header.lease)).or_default();
                            of.insert(frame.header.sent_ns, frame);
                        }
                    }
                }
            }
        }
        let wanted = |slot: usize| tool.is_none_or(|tool| slot as u32 + 1 == tool);
        let most = frames
            .into_iter()
            .filter(|((slot, _), _)| wanted(*slot))
            .max_by_key(|(_, frames)| frames.len());
        let (Some(state), Some(((slot, _), frames))) = (state, most) else {
            return Err(FeltError::NoHand { tool });
        };
        let tick_s = state.session.settings.parameters.tick_s;
        let (points, felt_n) = by_tick(&frames, tick_s);
        Ok(Self {
            state,
            tool: slot as u32 + 1,
            points,
            felt_n,
        })
    }

    /// Has it feel another loop; `record` hears the rig, if somebody wants a recording of it.
    ///
    /// # Errors
    /// The loop cannot be, or the recording cannot be written.
    pub fn feel<W: std::io::Write + Send + 'static>(
        &self,
        question: &Question,
        sink: Option<W>,
    ) -> Result<Felt, FeltError> {
        let settings = &self.state.session.settings;
        let was = settings.parameters;
        let parameters = LoopParameters {
            scheme: question.scheme.unwrap_or(was.scheme),
            ..was
        };
        let track = Track::new(self.points.clone(), was.tick_s)?;
        let lasts_s = track.lasts_s();
        let mut rig = Rig::new(Setup {
            parameters,
            clay: self.state.clay.clone(),
            intent: Intent::Played(track),
            lines: question.lines.unwrap_or_else(|| settings.lines()),
        })?;
        let about = About {
            session: settings.spec.id.to_string(),
            offset_ns: 0,
            topics: None,
            diagnose: None,
        };
        let studio = sink
            .map(|sink| Studio::new(sink, about, 1, 1))
            .transpose()?;
        if let Some(studio) = &studio {
            rig.hear_with(Some(Box::new(studio.clone())));
        }
        let (mut now_n, mut off_m) = (Vec::new(), Vec::new());
        for point in &self.points {
            rig.tick();
            now_n.push(rig.last().felt_force_n);
            off_m.push(difference(
                rig.device().sample().position_m,
                point.position_m,
            ));
        }
        if let Some(studio) = studio {
            studio.finish(rig.session_mut())?;
        }
        let settling = (SETTLING.as_secs_f64() / was.tick_s) as usize;
        let skipped = settling.min(self.points.len() / 2);
        let (then_n, now_n) = (&self.felt_n[skipped..], &now_n[skipped..]);
        let apart: Vec<_> = then_n
            .iter()
            .zip(now_n)
            .map(|(then, now)| difference(*now, *then))
            .collect();
        let then = force(then_n);
        Ok(Felt {
            tool: self.tool,
            schemes: [was.scheme, parameters.scheme],
            lasts_s,
            then,
            now: force(now_n),
            force_nrmse: (0.0 < then.rms_n).then(|| force(&apart).rms_n / then.rms_n),
            position_rmse_m: force(&off_m[skipped..]).rms_n,
        })
    }
}

/// Where the hand was in each tick, and what it felt. Ticks whose frame was lost or left out are as the one before.
fn by_tick(frames: &BTreeMap<u64, HandleFrame>, tick_s: f64) -> (Vec<TrackPoint>, Vec<[f64; 3]>) {
    let mut points: Vec<TrackPoint> = Vec::new();
    let mut felt_n = Vec::new();
    let first_ns = frames.keys().next().copied().unwrap_or(0);
    for (sent_ns, frame) in frames {
        let since_s = sent_ns.saturating_sub(first_ns) as f64 * 1e-9;
        let tick = (since_s / tick_s).round() as usize;
        // A handle that was silent for longer has stopped.
        let missing = tick.saturating_sub(points.len()).min(1000);
        let point = TrackPoint {
            position_m: frame.position_m,
            velocity_m_s: frame.velocity_m_s,
            hand_force_n: frame.hand_force_n,
        };
        let before = points.last().copied().unwrap_or(point);
        let felt_before = felt_n.last().copied().unwrap_or(frame.felt_force_n);
        points.extend(std::iter::repeat_n(before, missing));
        felt_n.extend(std::iter::repeat_n(felt_before, missing));
        points.push(point);
        felt_n.push(frame.felt_force_n);
    }
    (points, felt_n)
}

fn difference(one: [f64; 3], other: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|axis| one[axis] - other[axis])
}

fn force(over_time: &[[f64; 3]]) -> Force {
    let squares = over_time
        .iter()
        .map(|vector| vector.iter().map(|part| part * part).sum::<f64>());
    let (mut sum, mut largest) = (0.0, 0.0_f64);
    for square in squares {
        sum += square;
        largest = largest.max(square);
    }
    Force {
        rms_n: (sum / over_time.len().max(1) as f64).sqrt(),
        peak_n: largest.sqrt(),
    }
}
