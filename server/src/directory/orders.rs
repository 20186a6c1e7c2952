//! Orders to the tick, and the wait until they are carried out.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use rtrb::Producer;
use teleclay_proto::http::FieldError;

use crate::engine::{Order, Shared, TICK};

/// Longest wait for the tick to carry out an order. It takes one tick; this is for a machine that is badly overloaded.
pub(super) const ORDER_TIMEOUT: Duration = Duration::from_secs(2);

/// Why a session was not changed.
#[derive(Debug, thiserror::Error)]
pub enum ChangeError {
    /// A field cannot be.
    #[error("{}: {}", .0.pointer, .0.detail)]
    Field(FieldError),
    /// The session is gone.
    #[error("the session is gone")]
    Gone,
    /// The loop did not take the order in time.
    #[error("the loop did not take the order within {} s", ORDER_TIMEOUT.as_secs())]
    Timeout,
}

/// The way to the tick.
pub(super) struct Orders {
    waiting: Mutex<Producer<Order>>,
    sent: AtomicU64,
    shared: Arc<Shared>,
}

impl Orders {
    pub(super) fn new(waiting: Producer<Order>, shared: Arc<Shared>) -> Self {
        Self {
            waiting: Mutex::new(waiting),
            sent: AtomicU64::new(0),
            shared,
        }
    }

    /// Hands an order to the tick and waits until it is carried out.
    pub(super) async fn carry_out(&self, order: Order) -> Result<(), ChangeError> {
        let started = Instant::now();
        let mut order = Some(order);
        let number = loop {
            {
                let mut waiting = self.waiting.lock().expect("no holder panics");
                match waiting.push(order.take().expect("taken once a round")) {
                    Ok(()) => break self.sent.fetch_add(1, Ordering::Relaxed) + 1,
                    Err(rtrb::PushError::Full(back)) => order = Some(back),
                }
            }
            if ORDER_TIMEOUT < started.elapsed() {
                return Err(ChangeError::Timeout);
            }
            tokio::time::sleep(TICK).await;
        };
        while self.shared.orders_done.load(Ordering::Acquire) < number {
            if ORDER_TIMEOUT < started.elapsed() {
                return Err(ChangeError::Timeout);
            }
            tokio::time::sleep(TICK).await;
        }
        Ok(())
    }
}
