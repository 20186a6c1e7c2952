//! Orders to the tick, and the wait until they are carried out.

use std::sync::Mutex;
use std::time::{Duration, Instant};

use rtrb::Producer;
use teleclay_proto::http::FieldError;
use teleclay_session::Refusal;
use teleclay_shell::realtime::Claim;
use teleclay_shell::ticker::Waker;
use tokio::sync::oneshot;
use tokio::time::timeout;

use crate::engine::{Answer, Order, TICK, Task};

/// Longest wait for the tick to carry out an order. It takes one tick; this is for a machine that is badly overloaded.
pub(super) const ORDER_TIMEOUT: Duration = Duration::from_secs(2);

/// Why a session was not changed. Nothing of the change has been carried out, and nothing of it will be.
#[derive(Debug, thiserror::Error)]
pub enum ChangeError {
    /// A field cannot be.
    #[error("{}: {}", .0.pointer, .0.detail)]
    Field(FieldError),
    /// There is no memory for so much clay.
    #[error(transparent)]
    NoMemory(#[from] NoMemory),
    /// The session refuses, as things stand.
    #[error(transparent)]
    Refused(Refusal),
    /// The session is gone.
    #[error("the session is gone")]
    Gone,
    /// The loop did not take the order in time.
    #[error("the loop did not take the order within {} s", ORDER_TIMEOUT.as_secs())]
    Timeout,
}

impl From<Refusal> for ChangeError {
    fn from(refusal: Refusal) -> Self {
        match refusal {
            Refusal::Field(error) => Self::Field(error),
            other => Self::Refused(other),
        }
    }
}

/// There is no memory for so much clay.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the block takes {} MiB, {} of the {} MiB for all sessions are free",
    wanted_bytes.div_ceil(1 << 20), free_bytes >> 20, most_bytes >> 20
)]
pub struct NoMemory {
    /// What the block takes, bytes.
    pub wanted_bytes: u64,
    /// What is left, bytes.
    pub free_bytes: u64,
    /// What there is for all sessions, bytes.
    pub most_bytes: u64,
}

/// The way to a thread's tick.
pub(super) struct Orders {
    waiting: Mutex<Producer<Box<Order>>>,
    waker: Waker,
}

impl Orders {
    /// Orders go into this ring, and `waker` wakes the thread that may sleep over it.
    pub(super) fn new(waiting: Producer<Box<Order>>, waker: Waker) -> Self {
        Self {
            waiting: Mutex::new(waiting),
            waker,
        }
    }

    /// Hands an order to the tick and waits until it is carried out. An order that is not carried out in time is taken
    /// back.
    pub(super) async fn carry_out(&self, task: Task) -> Result<Answer, ChangeError> {
        let started = Instant::now();
        let claim = Claim::default();
        let (reply, mut answer) = oneshot::channel();
        let mut order = Some(Box::new(Order {
            claim: claim.clone(),
            task,
            reply,
            answer: Answer::Undone,
        }));
        while let Some(waiting) = order.take() {
            let pushed = self.waiting.lock().expect("no holder panics").push(waiting);
            self.waker.wake();
            if let Err(rtrb::PushError::Full(back)) = pushed {
                if ORDER_TIMEOUT < started.elapsed() {
                    return Err(ChangeError::Timeout);
                }
                order = Some(back);
                tokio::time::sleep(TICK).await;
            }
        }
        if let Ok(answer) = timeout(ORDER_TIMEOUT, &mut answer).await {
            return answer.map_err(|_| ChangeError::Gone);
        }
        if claim.take_back() {
            return Err(ChangeError::Timeout);
        }
        // It was carried out just now: the answer is on its way.
        answer.await.map_err(|_| ChangeError::Gone)
    }
}
