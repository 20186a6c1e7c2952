//! Calculations beside the interface's own work: on threads that may take their time, and only a few at once.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use teleclay_theory::Unanswered;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::task::spawn_blocking;
use tokio::time::timeout;

use crate::api::problem::{BUSY, Failure, INTERNAL};

/// How much runs at once, and for how long.
#[derive(Clone, Copy)]
struct Limits {
    /// Calculations of some milliseconds that run at once.
    calculations: usize,
    /// Experiments that run at once: each keeps a processor busy for a second or so, and the loop needs one too.
    experiments: usize,
    /// Longest wait for a place.
    queue: Duration,
    /// Longest calculation or experiment that can be called off.
    longest: Duration,
}

/// Wait and experiment together end before the time limit of a request.
const LIMITS: Limits = Limits {
    calculations: 2,
    experiments: 1,
    queue: Duration::from_secs(4),
    longest: Duration::from_secs(5),
};

/// Where calculations queue and run. Copies are the same.
#[derive(Clone)]
pub(crate) struct ComputePool {
    calculations: Arc<Semaphore>,
    experiments: Arc<Semaphore>,
    limits: Limits,
}

/// Until when a calculation may go on: to its time limit, or until nobody waits for it any more.
pub(crate) struct Deadline {
    until: Instant,
    gone: Arc<AtomicBool>,
}

/// Held by whoever asked: dropping it cancels the calculation.
struct CancelOnDrop(Arc<AtomicBool>);

impl Default for ComputePool {
    fn default() -> Self {
        Self::new(LIMITS)
    }
}

impl ComputePool {
    fn new(limits: Limits) -> Self {
        Self {
            calculations: Arc::new(Semaphore::new(limits.calculations)),
            experiments: Arc::new(Semaphore::new(limits.experiments)),
            limits,
        }
    }

    /// Runs a calculation: milliseconds for most inputs, seconds for a few.
    pub(crate) async fn calculate<T: Send + 'static>(
        &self,
        work: impl FnOnce(&Deadline) -> Result<T, Unanswered> + Send + 'static,
    ) -> Result<T, Failure> {
        self.run(&self.calculations, work).await
    }

    /// Runs an experiment.
    pub(crate) async fn experiment<T: Send + 'static>(
        &self,
        work: impl FnOnce(&Deadline) -> Result<T, Unanswered> + Send + 'static,
    ) -> Result<T, Failure> {
        self.run(&self.experiments, work).await
    }

    /// The place is given back when the work ends, not when whoever asked goes away; the work is told of that, and of
    /// the time that it has had.
    async fn run<T: Send + 'static>(
        &self,
        places: &Arc<Semaphore>,
        work: impl FnOnce(&Deadline) -> Result<T, Unanswered> + Send + 'static,
    ) -> Result<T, Failure> {
        let place = self.place(places).await?;
        let cancel = CancelOnDrop(Arc::new(AtomicBool::new(false)));
        let deadline = Deadline {
            until: Instant::now() + self.limits.longest,
            gone: Arc::clone(&cancel.0),
        };
        let work = move || {
            let outcome = work(&deadline);
            drop(place);
            outcome
        };
        spawn_blocking(work)
            .await
            .map_err(|_| INTERNAL.because("the calculation broke off"))?
            .map_err(Failure::from)
    }

    async fn place(&self, places: &Arc<Semaphore>) -> Result<OwnedSemaphorePermit, Failure> {
        let queue = self.limits.queue;
        let waited = || {
            BUSY.because(format!(
                "waited {} s for the ones before",
                queue.as_secs_f64()
            ))
        };
        timeout(queue, Arc::clone(places).acquire_owned())
            .await
            .map_err(|_| waited())?
            .map_err(|_| INTERNAL.because("calculations have ended"))
    }
}

impl Deadline {
    /// Whether to go on.
    pub(crate) fn check(&self) -> ControlFlow<()> {
        if self.gone.load(Ordering::Relaxed) || self.until < Instant::now() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }
}

impl Drop for CancelOnDrop {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc;

    use super::*;

    const PATIENCE: Duration = Duration::from_secs(20);

    /// One experiment at a time: the second begins when the first has ended.
    #[tokio::test(flavor = "multi_thread")]
    async fn experiments_queue() {
        let pool = ComputePool::default();
        let (go, wait) = mpsc::channel();
        let (tell, told) = mpsc::channel();
        let first = tokio::spawn({
            let (pool, tell) = (pool.clone(), tell.clone());
            async move {
                pool.experiment(move |_| {
                    tell.send("first begins").unwrap();
                    wait.recv_timeout(PATIENCE).unwrap();
                    tell.send("first ends").unwrap();
                    Ok(1)
                })
                .await
            }
        });
        assert_eq!(told.recv_timeout(PATIENCE), Ok("first begins"));
        let second = tokio::spawn(async move {
            pool.experiment(move |_| {
                tell.send("second begins").unwrap();
                Ok(2)
            })
            .await
        });
        go.send(()).unwrap();
        assert_eq!(first.await.unwrap(), Ok(1));
        assert_eq!(second.await.unwrap(), Ok(2));
        assert_eq!(told.recv_timeout(PATIENCE), Ok("first ends"));
        assert_eq!(told.recv_timeout(PATIENCE), Ok("second begins"));
    }

    /// An experiment whose asker went away is told, and its place is free again.
    #[tokio::test(flavor = "multi_thread")]
    async fn who_goes_away_calls_it_off() {
        let pool = ComputePool::default();
        let (tell, told) = mpsc::channel();
        let asked = tokio::spawn({
            let pool = pool.clone();
            async move {
                pool.experiment(move |deadline| {
                    tell.send("runs").unwrap();
                    while deadline.check().is_continue() {
                        std::hint::spin_loop();
                    }
                    tell.send("ends").unwrap();
                    Ok(())
                })
                .await
            }
        });
        assert_eq!(told.recv_timeout(PATIENCE), Ok("runs"));
        let began = Instant::now();
        asked.abort();
        assert_eq!(told.recv_timeout(PATIENCE), Ok("ends"));
        assert!(began.elapsed() < LIMITS.longest, "it ran to its own end");
        assert_eq!(pool.experiment(|_| Ok(3)).await, Ok(3));
    }

    /// Who waits in vain is told to come back; what is quick does not wait for what is long; and what is too long is
    /// ended.
    #[tokio::test(flavor = "multi_thread")]
    async fn what_is_too_long_for_the_next_one_is_said_and_ended() {
        let pool = ComputePool::new(Limits {
            queue: Duration::from_millis(20),
            longest: Duration::from_millis(500),
            ..LIMITS
        });
        let (tell, told) = mpsc::channel();
        let endless = tokio::spawn({
            let pool = pool.clone();
            async move {
                pool.experiment(move |deadline| {
                    tell.send("runs").unwrap();
                    while deadline.check().is_continue() {
                        std::hint::spin_loop();
                    }
                    Err::<(), _>(Unanswered::CalledOff("it was called off".to_owned()))
                })
                .await
            }
        });
        assert_eq!(told.recv_timeout(PATIENCE), Ok("runs"));
        let refused = pool.experiment(|_| Ok(())).await.unwrap_err();
        assert_eq!(refused.into_problem().kind, "/problems/busy");
        assert_eq!(pool.calculate(|_| Ok(4)).await, Ok(4));
        let ended = endless.await.unwrap().unwrap_err();
        assert_eq!(ended.into_problem().kind, "/problems/no-answer");
    }
}
