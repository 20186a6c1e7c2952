//! What a session does on a tick takes no memory and gives none back: a steady tick, and every command.
//!
//! One test alone in its process, since it counts every allocation of its thread.

#![allow(unsafe_code, reason = "a global allocator cannot be written without")]
#![allow(clippy::print_stdout, reason = "the counts are a result")]

mod bench;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use bench::{Bench, Hand, engaged_at, join, new_session};
use teleclay_proto::Scheme;
use teleclay_proto::frame::Engagement;
use teleclay_proto::http::{ClayReset, ClayShape, MaterialPatch, SessionPatch};
use teleclay_session::{Command, Event, Prepared};

thread_local! {
    static CALLS: Cell<Option<u64>> = const { Cell::new(None) };
}

struct Counting;

fn count() {
    // A thread that is about to end counts nothing.
    let _ = CALLS.try_with(|calls| {
        if let Some(count) = calls.get() {
            calls.set(Some(count + 1));
        }
    });
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

/// How often `work` takes memory or gives some back.
fn calls<T>(work: impl FnOnce() -> T) -> (T, u64) {
    CALLS.set(Some(0));
    let result = work();
    let count = CALLS.take().unwrap();
    (result, count)
}

/// A tick, with everything that the thread does around it. What leaves is dropped elsewhere, before the next one: so
/// nothing that the session still has to give away is kept alive by it.
fn tick(bench: &mut Bench, left: &mut Vec<Event>) -> u64 {
    left.clear();
    let (session, now) = (&mut bench.session, bench.now);
    let mut sides = Vec::with_capacity(8);
    let ((), count) = calls(|| {
        session.tick(now);
        while session.poll_transmit().is_some() {}
        while let Some(event) = session.poll_event() {
            left.push(event);
        }
        while let Some(side) = session.poll_retired() {
            sides.push(side);
        }
    });
    bench.now = now.after(bench::TICK);
    count
}

fn drive(bench: &mut Bench, hands: &mut [Hand], ticks: u32, left: &mut Vec<Event>) -> u64 {
    let mut worst = 0;
    for number in 0..ticks {
        let phase = f64::from(number) * 0.02;
        for hand in &mut *hands {
            hand.header.scheme = bench.session.settings().spec.scheme;
            hand.header.revision = bench.session.revision() as u32;
            hand.header.clay_epoch = bench.session.clay_epoch();
            let frame = hand.frame(bench.now, engaged_at([0.008 * phase.sin(), 0.0, -0.003]));
            let (session, now) = (&mut bench.session, bench.now);
            worst = worst.max(calls(|| session.handle_frame(now, hand.slot, &frame)).1);
        }
        worst = worst.max(tick(bench, left));
    }
    worst
}

#[test]
fn neither_a_steady_tick_nor_a_command_touches_the_heap() {
    assert!(0 < calls(|| vec![1_u8]).1, "the count counts");
    let mut left = Vec::with_capacity(8192);
    let mut bench = Bench::new(new_session(3));
    let mut hands = vec![bench.join("Ada").unwrap(), bench.join("Bob").unwrap()];
    assert_eq!(
        drive(&mut bench, &mut hands, 500, &mut left),
        0,
        "steady tick"
    );
    assert!(0 < bench.session.clay().removed_units());

    let change = |patch| Command::Patch { patch };
    let mut commands: Vec<(String, Command)> = Vec::new();
    for scheme in Scheme::ALL {
        commands.push((
            format!("change to {scheme}"),
            change(SessionPatch {
                scheme: Some(*scheme),
                deadband: Some(0.05),
                material: Some(MaterialPatch {
                    viscosity_pa_s_per_m: Some(1e5),
                    ..MaterialPatch::default()
                }),
                ..SessionPatch::default()
            }),
        ));
    }
    commands.push((
        "reset".to_owned(),
        Command::Reset {
            reset: ClayReset {
                shape: Some(ClayShape::Block {
                    size_m: [0.040, 0.030, 0.016],
                }),
                material: None,
                layers: None,
            },
            lease: None,
        },
    ));
    commands.push(("join".to_owned(), join("Eve")));
    commands.push(("a join that is refused".to_owned(), join("Joe")));
    commands.push((
        "leave".to_owned(),
        Command::Leave {
            lease: hands[1].lease(),
        },
    ));
    let (tool, lease) = (1, None);
    let named = |name: &str| name.to_owned();
    for name in ["Joe", "Ida", "Leo"] {
        let operator = named(name);
        commands.push((
            format!("a request of {name}"),
            Command::Request { tool, operator },
        ));
    }
    let operator = named("Ida");
    commands.push((named("withdraw"), Command::Withdraw { tool, operator }));
    let (operator, reason) = (named("Joe"), named("not now"));
    let deny = Command::Deny {
        tool,
        operator,
        reason,
        lease,
    };
    commands.push((named("deny"), deny.clone()));
    commands.push((named("a denial that is refused"), deny));
    let operator = named("Ida");
    commands.push((
        named("a request in a place that was left"),
        Command::Request { tool, operator },
    ));
    let operator = named("Leo");
    commands.push((
        named("grant"),
        Command::Grant {
            tool,
            operator,
            lease,
        },
    ));
    commands.push((named("a reserved tool is taken"), join("Leo")));
    commands.push((
        named("a tool is taken away"),
        Command::Release { tool: 3, lease },
    ));
    let operator = named("Joe");
    commands.push((
        named("a request before a stop"),
        Command::Request { tool, operator },
    ));
    let operator = named("Joe");
    commands.push((
        named("a grant before a stop"),
        Command::Grant {
            tool,
            operator,
            lease,
        },
    ));
    let stop = |by: &str| Command::Stop {
        by: named(by),
        reason: named("enough"),
    };
    commands.push((named("stop"), stop("Eve")));
    commands.push((named("another stop"), stop("Joe")));
    commands.push((named("a join that is refused by a stop"), join("Joe")));
    commands.push((
        named("clear the stop"),
        Command::ClearStop { by: named("Eve") },
    ));
    for (name, command) in &commands {
        let mut prepared = Prepared::new(command, bench.session.settings()).unwrap();
        let (session, now) = (&mut bench.session, bench.now);
        let (outcome, count) = calls(|| session.handle_command(now, &mut prepared));
        println!("{name}: {outcome:?}");
        assert_eq!(count, 0, "{name}");
        assert_eq!(outcome.is_err(), name.contains("refused"), "{name}");
        assert_eq!(
            drive(&mut bench, &mut hands, 100, &mut left),
            0,
            "{name}, the ticks after it"
        );
    }

    let mut hands = vec![bench.join("Ada").unwrap(), bench.join("Bob").unwrap()];
    // A request and a reservation whose time is over.
    let ask = |tool, name: &str| Command::Request {
        tool,
        operator: named(name),
    };
    bench.command(&ask(1, "Joe")).unwrap();
    bench.command(&ask(2, "Joe")).unwrap();
    let operator = named("Joe");
    let grant = Command::Grant {
        tool: 2,
        operator,
        lease,
    };
    bench.command(&grant).unwrap();
    hands.truncate(1);
    // The lease goes on, by a frame now and then.
    for _ in 0..4 {
        bench.now = bench.now.after(bench::TICK * 9_000);
        assert_eq!(
            drive(&mut bench, &mut hands, 3, &mut left),
            0,
            "time that is over"
        );
    }
    let tools = bench.session.snapshot().tools;
    assert!(tools[0].holder.is_some() && tools[0].requests.is_empty());
    assert!(tools[1].reserved_for.is_none());
    // A stop where nothing else finds room, with every tool held.
    for name in ["Bob", "Eve"] {
        bench.join(name).unwrap();
    }
    assert!((0..3).all(|slot| bench.session.side(slot).is_some()));
    let nothing = change(SessionPatch::default());
    while bench.command(&nothing).is_ok() {}
    let mut prepared = Prepared::stop("Ada", "enough");
    let (session, now) = (&mut bench.session, bench.now);
    let (outcome, count) = calls(|| session.handle_command(now, &mut prepared));
    assert_eq!((outcome.is_ok(), count), (true, 0), "a stop without room");
    assert_eq!(tick(&mut bench, &mut left), 0, "after it");
    bench
        .command(&Command::ClearStop { by: named("Ada") })
        .unwrap();
    let mut hands = vec![bench.join("Ada").unwrap(), bench.join("Bob").unwrap()];
    drive(&mut bench, &mut hands, 100, &mut left);

    // Goodbye in a frame, and a lease that runs out.
    let goodbye = hands[0].frame(
        bench.now,
        teleclay_proto::frame::HandleFrame {
            engagement: Engagement::Leaving,
            ..engaged_at([0.0; 3])
        },
    );
    bench
        .session
        .handle_frame(bench.now, hands[0].slot, &goodbye);
    bench.now = bench.now.after(bench::TICK * 11_000);
    for _ in 0..3 {
        assert_eq!(tick(&mut bench, &mut left), 0, "leases that end");
    }
    assert!((0..3).all(|slot| bench.session.side(slot).is_none()));
}
