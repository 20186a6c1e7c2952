//! Both 1 kHz threads allocate nothing, in a steady tick and in one that brings a change: counted by thread, in one
//! process that runs the whole server (frames from Zenoh, cut clay, changed bricks, records, a watcher of the
//! WebSocket) and the whole handle, as they run apart.

#![allow(unsafe_code, reason = "a global allocator cannot be written without")]
#![allow(clippy::print_stdout, reason = "the count is a result")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use serde_json::json;
use teleclay_handle::device::{DeviceKind, open};
use teleclay_handle::door::Door;
use teleclay_handle::intent::Intent;
use teleclay_handle::run::{Ending, Options, Until};
use teleclay_proto::http::Session;
use teleclay_proto::{NodeName, RealmName, Scheme, SessionId};
use teleclay_server::Server;
use teleclay_server::doors::certificates::Source;
use teleclay_server::settings::Settings;
use teleclay_shell::Drift;
use teleclay_shell::endpoint::Endpoint;
use teleclay_shell::log::LogFormat;
use teleclay_shell::ticker::Scheduling;
use teleclay_tests::client::Client;
use teleclay_tests::stage::{DEMO, Ports};
use teleclay_tests::watcher::Watcher;

/// The threads whose allocations count, by how the name begins that the system knows them by.
const TICKING: [&[u8]; 2] = [b"teleclay-loop", b"handle-tick"];
/// Ticks that are counted.
const STEADY_TICKS: u64 = 5000;
const PATIENCE: Duration = Duration::from_secs(60);

static COUNTS: [AtomicU64; 2] = [AtomicU64::new(0), AtomicU64::new(0)];
static IS_COUNTING: AtomicBool = AtomicBool::new(false);

struct Counting;

#[derive(Clone, Copy, PartialEq)]
enum Thread {
    Unknown,
    Ticking(usize),
}

thread_local! {
    static THREAD: Cell<Thread> = const { Cell::new(Thread::Unknown) };
}

fn count() {
    if !IS_COUNTING.load(Ordering::Relaxed) {
        return;
    }
    // A thread that is about to end has no name any more; no ticking thread ends while it counts.
    let thread = THREAD.try_with(|thread| {
        if thread.get() == Thread::Unknown
            && let Some(index) = ticking_thread()
        {
            thread.set(Thread::Ticking(index));
        }
        thread.get()
    });
    if let Ok(Thread::Ticking(index)) = thread {
        COUNTS[index].fetch_add(1, Ordering::Relaxed);
    }
}

/// Which of the threads that count this one is. Asks the system, which takes no memory.
fn ticking_thread() -> Option<usize> {
    let mut name = [0_u8; 16];
    // SAFETY: the system writes at most 16 bytes.
    if unsafe { libc::prctl(libc::PR_GET_NAME, name.as_mut_ptr()) } != 0 {
        return None;
    }
    let length = name.iter().position(|&byte| byte == 0)?;
    TICKING
        .iter()
        .position(|ticking| name[..length].starts_with(ticking))
}

// SAFETY: every call goes to the system's allocator as it came; counting touches no memory of the caller's.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: the caller keeps `alloc`'s contract, which is the same one.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count();
        // SAFETY: the pointer came from `alloc` above, so from the system's allocator with this layout.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn zenoh(port: u16) -> Endpoint {
    format!("tcp/127.0.0.1:{port}").parse().unwrap()
}

fn settings(ports: Ports, data_dir: std::path::PathBuf) -> Settings {
    Settings {
        listen: SocketAddr::from(([127, 0, 0, 1], ports.http)),
        zenoh_control: zenoh(ports.zenoh),
        zenoh_slow: zenoh(ports.zenoh + 1),
        data_dir,
        certificate: Source::Own,
        is_https: false,
        hosts: Vec::new(),
        demo_session: true,
        is_ephemeral: false,
        clay_bytes: 4 << 30,
        realm: RealmName::new("local").unwrap(),
        node: NodeName::new("local").unwrap(),
        token: None,
        ros2: None,
        allow_origins: Vec::new(),
        scheduling: Scheduling::Normal,
        spin: Duration::ZERO,
        tick_threads: 2,
        tick_budget: 0.6,
        log_format: LogFormat::default(),
    }
}

fn options(ports: Ports) -> Options {
    Options {
        door: Door {
            endpoint: zenoh(ports.zenoh),
            fingerprint: None,
        },
        invite: None,
        session: SessionId::new(DEMO).unwrap(),
        realm: RealmName::new("local").unwrap(),
        operator: "Ada".to_owned(),
        token: None,
        device: "simulated".to_owned(),
        profile: DeviceKind::Simulated.profile(),
        waits_out_stops: false,
        open_device: Box::new(|setup| open(DeviceKind::Simulated, &Intent::Cutting, setup)),
        scheduling: Scheduling::Normal,
        spin: Duration::ZERO,
        clock_drift: Drift::default(),
        recording: None,
    }
}

/// Looks from another thread, so that the runtime goes on.
async fn session_when(
    client: &Client,
    what: &'static str,
    is_wanted: impl FnMut(&Session) -> bool + Send + 'static,
) -> Session {
    let client = client.clone();
    tokio::task::spawn_blocking(move || client.session_when(DEMO, what, PATIENCE, is_wanted))
        .await
        .unwrap()
        .unwrap()
}

/// Allocations of each ticking thread while `work` goes on.
async fn counted<T>(work: impl Future<Output = T>) -> (T, [u64; 2]) {
    COUNTS
        .iter()
        .for_each(|count| count.store(0, Ordering::Relaxed));
    IS_COUNTING.store(true, Ordering::Relaxed);
    let result = work.await;
    IS_COUNTING.store(false, Ordering::Relaxed);
    (
        result,
        COUNTS.each_ref().map(|count| count.load(Ordering::Relaxed)),
    )
}

/// Calls the server from another thread, so that the runtime goes on.
async fn call<T: Send + 'static>(
    client: &Client,
    call: impl FnOnce(&Client) -> anyhow::Result<T> + Send + 'static,
) -> T {
    let client = client.clone();
    tokio::task::spawn_blocking(move || call(&client))
        .await
        .unwrap()
        .unwrap()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn neither_a_steady_tick_nor_a_change_allocates_at_either_end() {
    assert_that_an_allocation_is_seen();
    let ports = Ports::free().unwrap();
    let data = std::env::temp_dir().join(format!("teleclay-allocations-{}", std::process::id()));
    let server = Server::start(settings(ports, data.clone())).await.unwrap();
    let ada = Operating::start(ports, "Ada");
    let client = Client::new(server.address, None);
    // A line with everything that a line can do, so that frames wait in it.
    let line = json!({
        "delay_s": 0.01, "jitter_s": 0.002, "loss": 0.01, "duplicate": 0.01, "reorder": 0.01,
    });
    call(&client, move |client| {
        client.patch(DEMO, &json!({"network": {"up": line, "down": line}}))
    })
    .await;
    let address = server.address;
    let watcher = tokio::task::spawn_blocking(move || Watcher::open(address, DEMO))
        .await
        .unwrap()
        .unwrap();

    let before = session_when(&client, "a cut", |session| {
        session.clay.initial_units / 1000 < session.clay.removed_units
    })
    .await;
    let began = Instant::now();
    let (after, steady) =
        counted(call(&client, |client| client.let_pass(DEMO, STEADY_TICKS))).await;
    println!(
        "{} ticks of each side in {:.1} s allocated {steady:?} times",
        after.control_loop.ticks - before.control_loop.ticks,
        began.elapsed().as_secs_f64()
    );
    assert!(
        before.clay.removed_units < after.clay.removed_units
            && after.tools.iter().any(|tool| tool.connected),
        "the ticks that were counted had frames to take in and clay to cut"
    );
    assert_eq!(steady, [0, 0], "steady ticks, allocations of {TICKING:?}");

    // Every scheme twice, with all that a change can bring, and a fresh block after each.
    let changes = call(&client, |client| {
        for scheme in Scheme::ALL.iter().chain(Scheme::ALL) {
            client.patch(
                DEMO,
                &json!({"scheme": scheme, "material": {"viscosity_pa_s_per_m": 1e5}, "deadband": 0.02}),
            )?;
            client.let_pass(DEMO, 200)?;
            client.reset(DEMO)?;
            client.let_pass(DEMO, 200)?;
        }
        client.session(DEMO)
    });
    let (changed, changing) = counted(changes).await;
    let ticks = changed.control_loop.ticks - after.control_loop.ticks;
    println!("{ticks} ticks with ten changes and ten fresh blocks: {changing:?}");
    assert_eq!(changed.clay.epoch, after.clay.epoch + 10);
    assert_eq!(changing, [0, 0], "changes, allocations of {TICKING:?}");

    // From thread to thread and back, while the hand cuts.
    let demo = SessionId::new(DEMO).unwrap();
    let (moved, moving) = counted(async {
        for thread in [1, 0, 1, 0, 1] {
            server.directory().move_to(&demo, thread).await.unwrap();
            call(&client, |client| client.let_pass(DEMO, 200)).await;
        }
        session_when(&client, "its new thread", |session| {
            session.control_loop.thread == 1
        })
        .await
    })
    .await;
    assert!(
        changed.clay.removed_units != moved.clay.removed_units
            && moved.tools.iter().any(|tool| tool.connected),
        "the hand went on"
    );
    assert_eq!(moving, [0, 0], "moves, allocations of {TICKING:?}");

    // Somebody comes and goes. The newcomer's own thread takes memory where it begins; the server's may not.
    let (bob, [joining, _]) = counted(async {
        let bob = Operating::start(ports, "Bob");
        session_when(&client, "two operators", |session| {
            session.tools.iter().filter(|tool| tool.connected).count() == 2
        })
        .await;
        bob.end().await
    })
    .await;
    bob.outcome.unwrap();
    assert_eq!(joining, 0, "somebody who comes and goes");

    drop(watcher);
    let ending = ada.end().await;
    ending.outcome.unwrap();
    assert!(STEADY_TICKS < ending.summary.ticks && STEADY_TICKS / 2 < ending.summary.received);
    server.stop().await;
    // What is left behind here is only untidy.
    std::fs::remove_dir_all(data).ok();
}

/// A handle at work in this process.
struct Operating {
    stop: tokio::sync::watch::Sender<bool>,
    run: tokio::task::JoinHandle<Ending>,
}

impl Operating {
    fn start(ports: Ports, operator: &str) -> Self {
        let (stop, stopped) = tokio::sync::watch::channel(false);
        let until = Until {
            stop: stopped,
            deadline: None,
        };
        let options = Options {
            operator: operator.to_owned(),
            ..options(ports)
        };
        // Nobody listens to what it tells.
        let (emit, _) = tokio::sync::mpsc::unbounded_channel();
        Self {
            stop,
            run: tokio::spawn(teleclay_handle::run(options, until, emit)),
        }
    }

    async fn end(self) -> Ending {
        self.stop.send_replace(true);
        self.run.await.unwrap()
    }
}

/// The count counts: a thread of that name that allocates is found out.
fn assert_that_an_allocation_is_seen() {
    let seen = std::thread::Builder::new()
        .name("handle-tick".to_owned())
        .spawn(|| {
            IS_COUNTING.store(true, Ordering::Relaxed);
            drop(std::hint::black_box(vec![1_u8]));
            IS_COUNTING.store(false, Ordering::Relaxed);
        })
        .unwrap()
        .join();
    seen.unwrap();
    assert_eq!(COUNTS[1].swap(0, Ordering::Relaxed), 2);
}
