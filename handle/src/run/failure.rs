//! Why a run ended, and the exit code that says so.

use teleclay_link::safety::Implausible;
use teleclay_proto::SessionId;
use teleclay_shell::certificate::ProbeError;
use teleclay_shell::network::NetworkError;

use crate::device::DeviceError;
use crate::join::JoinError;
use crate::line::LineError;

/// Why a run ended that was not asked to, or had nothing to show.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// Zenoh cannot be opened.
    #[error(transparent)]
    Network(#[from] NetworkError),
    /// The session cannot be joined.
    #[error("session `{session}`: {source}")]
    Join {
        /// The session.
        session: SessionId,
        /// What the join failed of.
        source: JoinError,
    },
    /// Whoever answers must not be spoken to.
    #[error(transparent)]
    Certificate(#[from] ProbeError),
    /// The lease cannot be used.
    #[error(transparent)]
    Line(#[from] LineError),
    /// The device cannot be opened.
    #[error("the device: {0}")]
    Open(DeviceError),
    /// The device was lost on the way.
    #[error("{0}; force released")]
    Device(DeviceError),
    /// The system has no thread to give.
    #[error("the 1 kHz thread: {0}")]
    Thread(#[from] std::io::Error),
    /// The 1 kHz thread ended without a word.
    #[error("the 1 kHz thread has ended")]
    ThreadEnded,
    /// A value that no loop can work with.
    #[error("fault: {0}; force released")]
    Fault(Implausible),
    /// The time is over and there was no server at the end.
    #[error("no server answers on {endpoint} for session `{session}`, asked for {waited_s:.1} s")]
    NoServer {
        /// Where it should have been.
        endpoint: String,
        /// The session.
        session: SessionId,
        /// How long it was looked for, s.
        waited_s: f64,
    },
}

impl Failure {
    /// The exit code of the program, see [`EXIT_CODES`].
    pub const fn exit_code(&self) -> u8 {
        match self {
            Self::Join { .. } | Self::Certificate(_) => 2,
            Self::Fault(_) | Self::ThreadEnded | Self::Device(_) => 3,
            Self::NoServer { .. } => 4,
            Self::Network(_) | Self::Line(_) | Self::Open(_) | Self::Thread(_) => 1,
        }
    }
}

/// What the program's exit codes mean, for its help.
pub const EXIT_CODES: &str = "\
Exit codes:
  0   ended as asked, by --seconds, Ctrl-C or SIGTERM
  1   could not run: an endpoint, thread or device is not to be had
  2   not let in: the server refuses, or its answer or its certificate cannot be used; the reason is on stderr
  3   fault: a value that is not finite, or the device is lost; force was released
  4   no server: the time is over and none answered at its end
  64  the command line is wrong";
