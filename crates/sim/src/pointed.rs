//! A pointer on a page that holds a tool of a session, on virtual time: everything that crosses does so in the bytes of
//! a WebSocket, sealed as there. Same seed, same bits.
//!
//! Within a millisecond the pointer wakes first, if it does: it hears what came, makes the ticks that are owed and
//! sends their frames; then the session steps. Snapshots travel beside the lines, as in [`crate::rig`].

use std::iter::Peekable;

use teleclay_clay::{BrickView, Clay};
use teleclay_link::time::Timestamp;
use teleclay_pointer::{MadePath, Pointer, PointerSetup, Refused, Wanted};
use teleclay_proto::frame::{HandleFrame, MAX_FRAME};
use teleclay_proto::http::{ClayShape, ClaySpec, NewSession, SessionPatch};
use teleclay_proto::join::{ClayDescription, Granted, LoopParameters};
use teleclay_proto::watch::{BrickContent, BricksHeader, BricksWriter};
use teleclay_proto::{NodeName, SessionId};
use teleclay_seal::{Channel, Keys, Purpose};
use teleclay_session::{
    Command, Lines, Operator, Refusal, Rules, Session, SessionSetup, Settings, SettingsError,
};
use teleclay_wire::{FramesKind, FramesView, FramesWriter};

const TICK_NS: u64 = 1_000_000;
/// Longest message of bricks, as a server writes them.
const LONGEST: usize = teleclay_wire::MAX_MESSAGE;

/// What a run is made of.
pub struct PointedSetup {
    /// The loop, the tool, and what the clay resists with.
    pub parameters: LoopParameters,
    /// Extent of the block, m.
    pub size_m: [f64; 3],
    /// Edge of a voxel, m.
    pub voxel_size_m: f64,
    /// What the network does.
    pub lines: Lines,
    /// Ticks from wake to wake, 1 at least.
    pub wakes_every: u64,
}

/// Why there is no such run.
#[derive(Debug, thiserror::Error)]
pub enum PointedError {
    /// There is no such block.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// The session lets nobody in.
    #[error(transparent)]
    Session(#[from] Refusal),
    /// The pointer takes no such grant.
    #[error(transparent)]
    Pointer(#[from] Refused),
}

/// Keys that both ends know.
#[must_use]
pub fn keys() -> Keys {
    Keys::new([7; 32], [11; 32])
}

/// A snapshot under way: when it is taken, when it is there, and what it then shows.
struct UnderWay {
    number: u32,
    taken_ns: u64,
    due_ns: u64,
    shows: Option<(ClayDescription, Vec<Vec<u8>>)>,
}

/// A pointer, a session and the lines between them.
pub struct Pointed {
    session: Session,
    slot: usize,
    pointer: Pointer,
    granted: Vec<u8>,
    server: Channel,
    path: Option<Peekable<MadePath>>,
    wakes_every: u64,
    now_ns: u64,
    lines: Lines,
    down: FramesWriter,
    under_way: Vec<Vec<u8>>,
    snapshot: Option<UnderWay>,
    /// What the last wake sent.
    sent: Option<Vec<u8>>,
}

impl Pointed {
    /// Everything at rest at time zero; the hand takes hold at once and follows [`MadePath`].
    ///
    /// # Errors
    /// There is no such loop, block or coupling.
    pub fn new(setup: PointedSetup) -> Result<Self, PointedError> {
        let spec = NewSession {
            axes: setup.parameters.axes,
            scheme: setup.parameters.scheme,
            material: setup.parameters.material,
            tool: setup.parameters.tool,
            clay: ClaySpec {
                shape: ClayShape::Block {
                    size_m: setup.size_m,
                },
                voxel_size_m: setup.voxel_size_m,
                ..ClaySpec::default()
            },
            ..NewSession::new(SessionId::new("pointed").expect("a constant name is valid"))
        };
        let settings = Settings {
            revision: u64::from(setup.parameters.revision),
            spec,
            parameters: setup.parameters,
            is_paused: false,
        };
        let mut session = Session::new(SessionSetup {
            clay: settings.fresh_block()?,
            settings,
            lines: setup.lines,
            rules: Rules::default(),
            first_lease: 1,
            ownership_epoch: 1,
        });
        let (slot, granted) = join(&mut session, Timestamp::ZERO)?;
        let granted = json(&granted);
        let mut pointer = Pointer::new(0, PointerSetup::default(), &granted, &keys())?;
        if setup.parameters.scheme.keeps_a_copy() {
            // The clay comes with the lease.
            let bricks = bricks_of(session.clay(), session.clay_epoch());
            receive(&mut pointer, &describe(&session), &bricks)?;
        }
        pointer.hold();
        Ok(Self {
            slot,
            session,
            pointer,
            granted,
            server: Channel::of_server(&keys()),
            path: Some(MadePath::new(11).peekable()),
            wakes_every: setup.wakes_every.max(1),
            now_ns: 0,
            lines: setup.lines,
            down: FramesWriter::new(FramesKind::Tool),
            under_way: Vec::new(),
            snapshot: None,
            sent: None,
        })
    }

    /// A millisecond.
    pub fn tick(&mut self) {
        self.now_ns += TICK_NS;
        let now_ns = self.now_ns;
        self.sent = None;
        if (now_ns / TICK_NS).is_multiple_of(self.wakes_every) {
            self.wake();
        }
        let now = Timestamp::from_nanos(now_ns);
        self.session.tick(now);
        while let Some((slot, frame)) = self.session.poll_transmit() {
            let mut buffer = [0; MAX_FRAME];
            let bytes = frame.encode(&mut buffer);
            let trailer = self.server.trailer(Purpose::Frame, bytes);
            debug_assert_eq!(slot, self.slot);
            self.down.restart();
            self.down
                .push([bytes, &trailer[..]])
                .expect("a frame fits a message");
            self.under_way
                .extend(self.down.message().map(<[u8]>::to_vec));
        }
        while self.session.poll_event().is_some() {}
        while self.session.poll_retired().is_some() {}
    }

    fn wake(&mut self) {
        let now_ns = self.now_ns;
        if let Some(path) = &mut self.path {
            while let Some((at_ns, place_m)) = path.next_if(|(at_ns, _)| *at_ns <= now_ns) {
                self.pointer.handle_sample(now_ns, at_ns, place_m);
            }
        }
        self.deliver_snapshot();
        if self.pointer.wanted().parameters {
            let revision = self.session.revision();
            let parameters = self.session.settings().parameters_at(revision);
            self.pointer
                .handle_parameters(&json(&parameters))
                .expect("the session's parameters make a loop");
        }
        for message in self.under_way.drain(..) {
            self.pointer
                .handle_frames(now_ns, &message)
                .expect("the session wrote it");
        }
        self.pointer.advance(now_ns);
        if let Some(message) = self.pointer.outgoing() {
            let view = FramesView::decode(message).expect("the pointer wrote it");
            for sealed in view.iter() {
                let frame = self.server.open(Purpose::Frame, sealed);
                let frame = HandleFrame::decode(frame.expect("the pointer sealed it"));
                let now = Timestamp::from_nanos(now_ns);
                let frame = frame.expect("the pointer encoded it");
                self.session.handle_frame(now, self.slot, &frame);
            }
            self.sent = Some(message.to_vec());
        }
        self.pointer.tidy();
    }

    fn deliver_snapshot(&mut self) {
        let now_ns = self.now_ns;
        let Wanted { snapshot, .. } = self.pointer.wanted();
        if let Some(wanted) = snapshot
            && self
                .snapshot
                .as_ref()
                .is_none_or(|under_way| under_way.number != wanted.number)
        {
            let taken_ns = now_ns + self.lines.up.delay.as_nanos() as u64;
            self.snapshot = Some(UnderWay {
                number: wanted.number,
                taken_ns,
                due_ns: taken_ns + self.lines.down.delay.as_nanos() as u64,
                shows: None,
            });
        }
        let Some(under_way) = &mut self.snapshot else {
            return;
        };
        if under_way.shows.is_none() && under_way.taken_ns <= now_ns {
            let clay = describe(&self.session);
            let bricks = bricks_of(self.session.clay(), clay.epoch);
            under_way.shows = Some((clay, bricks));
        }
        if under_way.due_ns <= now_ns
            && let Some((clay, bricks)) = under_way.shows.take()
        {
            self.snapshot = None;
            let taken = receive(&mut self.pointer, &clay, &bricks);
            taken.expect("the session's clay can be received");
        }
    }

    /// The lease is lost, with all that was on its way, and another one is granted in its place.
    ///
    /// # Errors
    /// The session lets nobody in, or the pointer does not go on.
    pub fn renew(&mut self) -> Result<(), PointedError> {
        let now = Timestamp::from_nanos(self.now_ns);
        let lease = self.pointer.side().frame().header.lease;
        self.session.carry_out(now, &Command::Leave { lease })?;
        let (slot, granted) = join(&mut self.session, now)?;
        let keys = Keys::new([13; 32], [17; 32]);
        self.granted = json(&granted);
        self.pointer.renew(self.now_ns, &self.granted, &keys)?;
        self.slot = slot;
        self.server = Channel::of_server(&keys);
        self.under_way.clear();
        Ok(())
    }

    /// Changes settings of the session, as a new revision; the pointer asks for the parameters by itself.
    ///
    /// # Errors
    /// The session refuses.
    pub fn patch(&mut self, patch: SessionPatch) -> Result<(), PointedError> {
        let now = Timestamp::from_nanos(self.now_ns);
        self.session.carry_out(now, &Command::Patch { patch })?;
        Ok(())
    }

    /// The hand lets go, and nothing more is told of it.
    pub fn let_go(&mut self) {
        self.path = None;
        self.pointer.release();
    }

    /// The pointer.
    #[must_use]
    pub fn pointer(&self) -> &Pointer {
        &self.pointer
    }

    /// The pointer, to be given what else may come.
    pub fn pointer_mut(&mut self) -> &mut Pointer {
        &mut self.pointer
    }

    /// The session.
    #[must_use]
    pub fn session(&self) -> &Session {
        &self.session
    }

    /// The session, to change its material or clay.
    pub fn session_mut(&mut self) -> &mut Session {
        &mut self.session
    }

    /// The grant, as JSON.
    #[must_use]
    pub fn granted(&self) -> &[u8] {
        &self.granted
    }

    /// What the pointer sent in this millisecond.
    #[must_use]
    pub fn sent(&self) -> Option<&[u8]> {
        self.sent.as_deref()
    }

    /// Messages that the pointer will hear when it wakes next.
    #[must_use]
    pub fn on_their_way_in(&self) -> &[Vec<u8>] {
        &self.under_way
    }

    /// Virtual time, ns.
    #[must_use]
    pub fn now_ns(&self) -> u64 {
        self.now_ns
    }
}

fn receive(
    pointer: &mut Pointer,
    clay: &ClayDescription,
    bricks: &[Vec<u8>],
) -> Result<(), Refused> {
    pointer.begin_snapshot(&json(clay))?;
    for message in bricks {
        pointer.handle_bricks(message)?;
    }
    pointer.finish_snapshot()
}

/// All of the clay in messages, as a server tells it.
#[must_use]
pub fn bricks_of(clay: &Clay, epoch: u32) -> Vec<Vec<u8>> {
    let grid = clay.grid();
    let header = BricksHeader {
        clay_epoch: epoch,
        bricks_per_axis: grid.bricks(),
        voxel_size_m: grid.voxel_size_m() as f32,
        ..BricksHeader::default()
    };
    let mut writer = BricksWriter::new(header, LONGEST);
    for dense in 0..grid.brick_count() as u32 {
        let index = grid.brick_index(dense).expect("the grid has it");
        let content = match clay.brick(index) {
            BrickView::Empty => BrickContent::Empty,
            BrickView::Full => BrickContent::Full,
            BrickView::Voxels(voxels) => BrickContent::Voxels(voxels),
        };
        writer.push(dense, content).expect("the grid has it");
    }
    writer.finish()
}

/// A lease: the slot of its tool, and what is granted.
fn join(session: &mut Session, now: Timestamp) -> Result<(usize, Granted), Refusal> {
    let operator = Operator {
        name: "somebody".to_owned(),
        device: "pointer".to_owned(),
    };
    let joined = session.carry_out(now, &Command::Join { operator })?;
    let lease = joined.granted.expect("a join grants a lease");
    let granted = Granted {
        lease: lease.lease,
        ownership_epoch: session.ownership_epoch(),
        node: NodeName::new("sim").expect("a constant name is valid"),
        tool: 1,
        lease_s: 10.0,
        parameters: session.settings().parameters_at(joined.revision),
        clay: describe(session),
        slow_endpoint: None,
    };
    Ok((lease.slot, granted))
}

fn describe(session: &Session) -> ClayDescription {
    let clay = &session.settings().spec.clay;
    ClayDescription {
        shape: clay.shape.clone(),
        voxel_size_m: clay.voxel_size_m,
        epoch: session.clay_epoch(),
        revision: 0,
    }
}

fn json(value: &impl serde::Serialize) -> Vec<u8> {
    serde_json::to_vec(value).expect("it has no maps and no values that JSON lacks")
}
