//! The thread of a hand: it has the socket and the loop, and nothing of Python's holds it up.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use rtrb::{Consumer, Producer};
use teleclay_bilateral::LinkState;
use teleclay_impedance::GraspState;
use teleclay_pointer::{Counts, Mode, Pointer};
use tungstenite::Message;

use super::Ended;
use super::conversation::{Joined, Questions};
use super::drawing::{Drawing, Intent};
use super::line::Line;

/// Numbers of a row: see `_batch` in `teleclay/hand.py`, which names them.
pub(super) const ROW: usize = 24;
/// Messages that one wake hears at most; a burst is heard over several.
const MOST_HEARD: usize = 64;
/// A hand that was let go of has come off by then, and its handle is at rest.
const COMES_OFF: Duration = Duration::from_millis(150);
const COMES_TO_REST: Duration = Duration::from_millis(500);
/// A goodbye that is not answered by then is none.
const GOODBYE: Duration = Duration::from_millis(1000);

/// A row of what happened, for the law.
pub(super) type Row = [f64; ROW];

/// What Python tells the thread, and it tells Python, beside the rings.
#[derive(Default)]
pub(super) struct Shared {
    /// The hand is to leave.
    pub(super) leave: AtomicBool,
    /// The law is being run: from now on it may be late.
    pub(super) is_watched: AtomicBool,
    /// Rows that found no room.
    pub(super) dropped: AtomicU64,
    /// The hand was let go of, since the law was late.
    pub(super) was_late: AtomicBool,
}

/// A hand under way.
pub(super) struct HandThread {
    pub(super) line: Line,
    pub(super) joined: Joined,
    pub(super) clock: Clock,
    pub(super) shared: Arc<Shared>,
    pub(super) rows: Producer<Row>,
    pub(super) intents: Consumer<Intent>,
    /// A law that says nothing for so long is late.
    pub(super) patience: Duration,
}

/// What a hand did, once it is over.
pub(super) struct Report {
    pub(super) ended: Ended,
    pub(super) counts: Counts,
    /// Wakes whose frames did not leave, since earlier ones had not.
    pub(super) unsent: u64,
    /// Most ticks that one wake had to make.
    pub(super) most_ticks: u32,
}

/// Nanoseconds since a second before it was made: a stamp is never zero.
#[derive(Clone, Copy)]
pub(super) struct Clock(Instant);

impl Clock {
    pub(super) fn start() -> Self {
        Self(Instant::now())
    }

    pub(super) fn now_ns(self) -> u64 {
        1_000_000_000 + self.0.elapsed().as_nanos() as u64
    }
}

/// How far a hand has come with leaving.
enum Stage {
    Working,
    /// The hand comes off the handle.
    LettingGo {
        until_ns: u64,
    },
    /// The handle comes to rest.
    Resting {
        until_ns: u64,
    },
    /// The server was told.
    SaidGoodbye {
        until_ns: u64,
    },
}

impl HandThread {
    /// Runs until the hand has left. The handle is at rest then, or the line is gone.
    pub(super) fn run(mut self) -> Report {
        let mut state = State {
            drawing: Drawing::new(self.clock.now_ns(), self.joined.has_lift),
            questions: Questions::default(),
            stage: Stage::Working,
            why: None,
            heard_law_ns: self.clock.now_ns(),
            unsent: 0,
            most_ticks: 0,
        };
        let ended = loop {
            let now_ns = self.clock.now_ns();
            let due_ns = self.joined.pointer.next_ns();
            if now_ns < due_ns {
                thread::sleep(Duration::from_nanos(due_ns - now_ns));
            }
            match self.wake(&mut state) {
                Ok(None) => {}
                Ok(Some(ended)) | Err(ended) => break ended,
            }
        };
        Report {
            ended: state.why.unwrap_or(ended),
            counts: *self.joined.pointer.counts(),
            unsent: state.unsent,
            most_ticks: state.most_ticks,
        }
    }

    fn wake(&mut self, state: &mut State) -> Result<Option<Ended>, Ended> {
        let now_ns = self.clock.now_ns();
        self.hear(state)?;
        self.listen_to_law(state, now_ns);
        let over = self.leave_by_stages(state, now_ns)?;
        let pointer = &mut self.joined.pointer;
        state.drawing.draw(now_ns, pointer);
        let gaps = pointer.counts().gaps;
        let ticks = pointer.advance(now_ns).ticks;
        if gaps < pointer.counts().gaps {
            // Nobody knows what a law would have said meanwhile: it has to say it anew.
            state.drawing.intend(Intent::Off);
        }
        state.most_ticks = state.most_ticks.max(ticks);
        if let Some(message) = pointer.outgoing()
            && !self.line.send_fresh(message)?
        {
            state.unsent += 1;
        }
        pointer.tidy();
        if 0 < ticks && self.rows.push(row(pointer, ticks)).is_err() {
            self.shared.dropped.fetch_add(1, Ordering::Relaxed);
        }
        let wanted = self.joined.pointer.wanted();
        if matches!(state.stage, Stage::Working) {
            state.questions.ask(&mut self.line, &wanted)?;
            if wanted.lease {
                let silence_s = self.joined.pointer.view().silence_s;
                state.leave_for(Ended::Silent { silence_s }, now_ns);
            } else if self.joined.pointer.view().is_in_fault {
                state.leave_for(Ended::Fault, now_ns);
            }
        }
        Ok(over)
    }

    fn hear(&mut self, state: &mut State) -> Result<(), Ended> {
        for _ in 0..MOST_HEARD {
            let Some(message) = self.line.hear()? else {
                break;
            };
            let now_ns = self.clock.now_ns();
            let pointer = &mut self.joined.pointer;
            match message {
                Message::Text(text) => {
                    if let Err(why) = state.questions.on_text(&text, pointer) {
                        if matches!(why, Ended::Farewell(_)) {
                            pointer.handle_peer_gone(now_ns);
                        }
                        state.leave_for(why, now_ns);
                    }
                }
                // Bricks are kind 2; all else in binary are frames, or nothing, which the pointer counts.
                Message::Binary(bytes) if bytes.get(3) == Some(&2) => {
                    state.questions.on_bricks(&bytes, pointer);
                    // One of them is as much work as a tick has time for.
                    break;
                }
                Message::Binary(bytes) => {
                    let _ = pointer.handle_frames(now_ns, &bytes);
                }
                Message::Close(frame) => {
                    let reason = frame.map_or_else(String::new, |frame| frame.reason.to_string());
                    return Err(Ended::Line(format!("the server closed it: {reason}")));
                }
                _ => {}
            }
        }
        Ok(())
    }

    fn listen_to_law(&mut self, state: &mut State, now_ns: u64) {
        while let Ok(intent) = self.intents.pop() {
            state.heard_law_ns = now_ns;
            if matches!(state.stage, Stage::Working) {
                state.drawing.intend(intent);
            }
        }
        if !self.shared.is_watched.load(Ordering::Relaxed) {
            state.heard_law_ns = now_ns;
        }
        let silent_ns = now_ns.saturating_sub(state.heard_law_ns);
        if matches!(state.stage, Stage::Working) && self.patience.as_nanos() < silent_ns.into() {
            self.shared.was_late.store(true, Ordering::Relaxed);
            let silent_s = silent_ns as f64 * 1e-9;
            state.leave_for(Ended::LawLate { silent_s }, now_ns);
        }
        if matches!(state.stage, Stage::Working) && self.shared.leave.load(Ordering::Relaxed) {
            state.leave_for(Ended::Asked, now_ns);
        }
    }

    /// Off the handle, to rest, goodbye: each as soon as it is reached, or when its time is up.
    fn leave_by_stages(&mut self, state: &mut State, now_ns: u64) -> Result<Option<Ended>, Ended> {
        let after = |span: Duration| now_ns + span.as_nanos() as u64;
        let view = self.joined.pointer.view();
        match state.stage {
            Stage::Working => {}
            Stage::LettingGo { until_ns } => {
                if view.grasp == GraspState::Released || until_ns <= now_ns {
                    self.joined.pointer.leave();
                    state.stage = Stage::Resting {
                        until_ns: after(COMES_TO_REST),
                    };
                }
            }
            Stage::Resting { until_ns } => {
                if view.mode == Mode::Resting || until_ns <= now_ns {
                    state.questions.leave(&mut self.line)?;
                    state.stage = Stage::SaidGoodbye {
                        until_ns: after(GOODBYE),
                    };
                }
            }
            Stage::SaidGoodbye { until_ns } => {
                if state.questions.has_left() || until_ns <= now_ns {
                    return Ok(Some(Ended::Asked));
                }
            }
        }
        Ok(None)
    }
}

struct State {
    drawing: Drawing,
    questions: Questions,
    stage: Stage,
    /// Why it leaves, once it does.
    why: Option<Ended>,
    heard_law_ns: u64,
    unsent: u64,
    most_ticks: u32,
}

impl State {
    fn leave_for(&mut self, why: Ended, now_ns: u64) {
        self.drawing.intend(Intent::Off);
        if self.why.is_none() {
            self.why = Some(why);
            self.stage = Stage::LettingGo {
                until_ns: now_ns + COMES_OFF.as_nanos() as u64,
            };
        }
    }
}

fn row(pointer: &Pointer, ticks: u32) -> Row {
    let view = pointer.view();
    let mut row = [0.0; ROW];
    row[0] = view.at_ns as f64 * 1e-9 - 1.0;
    row[1] = f64::from(ticks);
    let vectors = [
        view.handle_m,
        pointer.side().frame().velocity_m_s,
        view.tool_m,
        view.felt_force_n,
        view.hand_force_n,
        view.hand_m,
    ];
    for (to, vector) in row[2..20].as_chunks_mut::<3>().0.iter_mut().zip(vectors) {
        *to = vector;
    }
    row[20] = view.round_trip_s.unwrap_or(f64::NAN);
    row[21] = view.silence_s;
    row[22] = grasp(view.grasp);
    row[23] = link(view.link_state);
    row
}

/// By its place in `GRASPS` of `teleclay/hand.py`.
fn grasp(state: GraspState) -> f64 {
    match state {
        GraspState::Released => 0.0,
        GraspState::Waiting => 1.0,
        GraspState::Held => 2.0,
        GraspState::LettingGo => 3.0,
        GraspState::Clutched => 4.0,
        GraspState::Stopped => 5.0,
    }
}

/// By its place in `LINKS` there.
fn link(state: LinkState) -> f64 {
    match state {
        LinkState::Live => 0.0,
        LinkState::NotYet => 1.0,
        LinkState::Silent => 2.0,
        LinkState::OnCopy => 3.0,
        LinkState::OnStaleCopy => 4.0,
        LinkState::Gone => 5.0,
        LinkState::Paused => 6.0,
        LinkState::Fault => 7.0,
    }
}
