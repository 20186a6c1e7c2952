//! Control of a tool that is asked for: each rule at its boundary, on virtual time, and orders that mean harm.

mod bench;

use std::sync::Arc;

use bench::{
    Bench, Hand, clear, engaged_at, grant, join, kinds, new_session, recovered, request, stop,
};
use teleclay_proto::frame::HandleFrame;
use teleclay_session::{Command, EventKind, Prepared, Refusal, Release, RequestEnd};

fn withdraw(tool: u32, operator: &str) -> Command {
    Command::Withdraw {
        tool,
        operator: operator.to_owned(),
    }
}

fn deny(tool: u32, operator: &str, lease: Option<u32>) -> Command {
    Command::Deny {
        tool,
        operator: operator.to_owned(),
        reason: "not now".to_owned(),
        lease,
    }
}

fn reserved(holder: &str) -> Refusal {
    Refusal::Reserved {
        holder: holder.into(),
    }
}

fn no_such_request(tool: u32, operator: &str) -> Refusal {
    Refusal::NoSuchRequest {
        tool,
        operator: operator.into(),
    }
}

fn requests(bench: &Bench, tool: usize) -> Vec<Arc<str>> {
    bench.session.snapshot().tools[tool - 1].requests.clone()
}

fn reserved_for(bench: &Bench, tool: usize) -> Option<Arc<str>> {
    bench.session.snapshot().tools[tool - 1]
        .reserved_for
        .clone()
}

/// Time passes in which nobody says anything.
fn wait(bench: &mut Bench, ms: u32) {
    bench.run(ms, &mut [], |_| HandleFrame::default());
}

/// Time passes, and the holder is there.
fn hold(bench: &mut Bench, hand: &mut Hand, ms: u32) {
    bench.run(ms, &mut [hand], |_| engaged_at([0.0; 3]));
}

#[test]
fn a_tool_that_is_handed_over_is_kept_for_ten_seconds_for_the_one_who_asked() {
    for (after_ms, is_kept) in [(9_999, true), (10_002, false)] {
        let mut bench = Bench::new(new_session(1));
        let mut ada = bench.join("Ada").unwrap();
        hold(&mut bench, &mut ada, 10);
        bench.command(&request(1, "Bob")).unwrap();
        bench.command(&request(1, "Eve")).unwrap();
        assert_eq!(requests(&bench, 1), ["Bob".into(), "Eve".into()]);
        kinds(&mut bench);
        bench.command(&grant(1, "Eve", Some(ada.lease()))).unwrap();
        let told = kinds(&mut bench);
        assert!(
            matches!(
                &told[..],
                [EventKind::Released { lease: 1, because: Release::HandedOver { to }, .. }]
                    if **to == *"Eve"
            ),
            "{told:?}"
        );
        assert!(bench.session.side(0).is_none());
        assert!(requests(&bench, 1).is_empty(), "asked of nobody");
        assert_eq!(reserved_for(&bench, 1).as_deref(), Some("Eve"));
        // Not even to the one who has had it.
        assert_eq!(bench.command(&join("Ada")), Err(reserved("Eve")));
        assert_eq!(bench.command(&join("Bob")), Err(reserved("Eve")));
        wait(&mut bench, after_ms);
        let told = kinds(&mut bench);
        if is_kept {
            assert!(told.is_empty(), "{told:?}");
            assert_eq!(bench.command(&join("Ada")), Err(reserved("Eve")));
            bench.join("Eve").unwrap();
            assert_eq!(reserved_for(&bench, 1), None);
        } else {
            assert!(
                matches!(
                    &told[..],
                    [EventKind::ReservationEnded { slot: 0, operator }] if **operator == *"Eve"
                ),
                "{told:?}"
            );
            bench.join("Ada").unwrap();
        }
    }
}

#[test]
fn a_reservation_wins_over_the_own_tool_a_free_one_and_a_takeover() {
    let mut bench = Bench::new(new_session(3));
    let eve = bench.join("Eve").unwrap();
    let mut ada = bench.join("Ada").unwrap();
    bench.command(&request(2, "Eve")).unwrap();
    // Eve falls silent, and tool 3 is free.
    hold(&mut bench, &mut ada, 1_200);
    bench.command(&grant(2, "Eve", None)).unwrap();
    let again = bench.join("Eve").unwrap();
    assert_eq!((again.slot, eve.slot), (1, 0));
    // One that is kept for another is not taken where there is a silent one, nor is it where there is none.
    let mut bench = Bench::new(new_session(2));
    bench.join("Bob").unwrap();
    let mut ada = bench.join("Ada").unwrap();
    bench.command(&request(2, "Eve")).unwrap();
    hold(&mut bench, &mut ada, 1_200);
    bench.command(&grant(2, "Eve", None)).unwrap();
    assert_eq!(bench.join("Joe").unwrap().slot, 0);
    assert_eq!(bench.command(&join("Ida")).unwrap_err(), reserved("Eve"));
    assert_eq!(bench.join("Eve").unwrap().slot, 1);
    let refused = bench.command(&join("Ida"));
    assert_eq!(refused, Err(Refusal::NoFreeTool { tools: 2 }));
}

#[test]
fn a_reservation_outlives_the_process_and_its_time_begins_anew() {
    let mut bench = Bench::new(new_session(1));
    bench.join("Ada").unwrap();
    bench.command(&request(1, "Eve")).unwrap();
    bench.command(&grant(1, "Eve", None)).unwrap();
    wait(&mut bench, 9_000);
    bench.session = recovered(&bench);
    assert_eq!(bench.command(&join("Ada")), Err(reserved("Eve")));
    wait(&mut bench, 9_999);
    assert_eq!(bench.command(&join("Ada")), Err(reserved("Eve")));
    wait(&mut bench, 3);
    bench.join("Ada").unwrap();
}

#[test]
fn a_request_is_forgotten_after_thirty_seconds_and_each_on_its_own() {
    let mut bench = Bench::new(new_session(1));
    let mut ada = bench.join("Ada").unwrap();
    bench.command(&request(1, "Bob")).unwrap();
    hold(&mut bench, &mut ada, 1_000);
    bench.command(&request(1, "Eve")).unwrap();
    hold(&mut bench, &mut ada, 28_999);
    assert_eq!(requests(&bench, 1).len(), 2);
    kinds(&mut bench);
    hold(&mut bench, &mut ada, 3);
    let told = kinds(&mut bench);
    assert!(
        matches!(
            &told[..],
            [EventKind::RequestEnded { slot: 0, operator, because: RequestEnd::RanOut }]
                if **operator == *"Bob"
        ),
        "{told:?}"
    );
    assert_eq!(requests(&bench, 1), ["Eve".into()]);
    assert_eq!(
        bench.command(&grant(1, "Bob", None)),
        Err(no_such_request(1, "Bob"))
    );
    // Bob may ask anew, behind Eve.
    bench.command(&request(1, "Bob")).unwrap();
    assert_eq!(requests(&bench, 1), ["Eve".into(), "Bob".into()]);
}

#[test]
fn a_request_ends_when_it_is_denied_or_withdrawn_and_when_the_holder_has_gone() {
    let mut bench = Bench::new(new_session(1));
    let ada = bench.join("Ada").unwrap();
    for (name, end) in [
        ("Bob", deny(1, "Bob", Some(ada.lease()))),
        ("Eve", withdraw(1, "Eve")),
    ] {
        bench.command(&request(1, name)).unwrap();
        kinds(&mut bench);
        bench.command(&end).unwrap();
        let told = kinds(&mut bench);
        let [
            EventKind::RequestEnded {
                operator, because, ..
            },
        ] = &told[..]
        else {
            panic!("{told:?}")
        };
        assert_eq!(**operator, *name);
        let denied = RequestEnd::Denied {
            reason: "not now".into(),
        };
        assert_eq!(*because == denied, name == "Bob");
        assert_eq!(bench.command(&end), Err(no_such_request(1, name)));
        assert!(bench.session.side(0).is_some(), "the holder goes on");
    }
    let lease = ada.lease();
    bench.command(&request(1, "Bob")).unwrap();
    bench.command(&Command::Leave { lease }).unwrap();
    assert!(requests(&bench, 1).is_empty() && reserved_for(&bench, 1).is_none());
    // Nor does the next holder inherit it.
    bench.join("Joe").unwrap();
    assert!(requests(&bench, 1).is_empty());
    assert_eq!(
        bench.command(&grant(1, "Bob", None)),
        Err(no_such_request(1, "Bob"))
    );
    // Nor one who takes the tool over.
    bench.command(&request(1, "Bob")).unwrap();
    wait(&mut bench, 1_200);
    bench.join("Ida").unwrap();
    assert!(requests(&bench, 1).is_empty());
}

#[test]
fn what_is_not_consistent_is_refused_by_its_name_and_changes_nothing() {
    let mut bench = Bench::new(new_session(2));
    let ada = bench.join("Ada").unwrap();
    bench.command(&request(1, "Bob")).unwrap();
    let before = bench.session.snapshot();
    let [bob, ada_name]: [Arc<str>; 2] = ["Bob".into(), "Ada".into()];
    let lease = None;
    for tool in [0, 3, u32::MAX] {
        for command in [
            request(tool, "Eve"),
            withdraw(tool, "Eve"),
            grant(tool, "Eve", lease),
            deny(tool, "Eve", lease),
            Command::Release { tool, lease },
        ] {
            let refused = Err(Refusal::NoSuchTool { tool, tools: 2 });
            assert_eq!(bench.command(&command), refused);
        }
    }
    for command in [
        request(2, "Eve"),
        withdraw(2, "Eve"),
        grant(2, "Eve", lease),
        deny(2, "Eve", lease),
        Command::Release { tool: 2, lease },
    ] {
        let refused = Err(Refusal::NotHeld { tool: 2 });
        assert_eq!(bench.command(&command), refused);
    }
    for (command, refusal) in [
        (
            request(1, "Bob"),
            Refusal::AskedAlready {
                tool: 1,
                operator: bob,
            },
        ),
        (
            request(1, "Ada"),
            Refusal::HeldByAsker {
                tool: 1,
                operator: ada_name,
            },
        ),
        (withdraw(1, "Eve"), no_such_request(1, "Eve")),
        (grant(1, "Eve", None), no_such_request(1, "Eve")),
        (deny(1, "Eve", None), no_such_request(1, "Eve")),
    ] {
        assert_eq!(bench.command(&command), Err(refusal));
    }
    // Under a lease that is not this tool's.
    let lease = ada.lease() + 1;
    for command in [
        grant(1, "Bob", Some(lease)),
        deny(1, "Bob", Some(lease)),
        Command::Release {
            tool: 1,
            lease: Some(lease),
        },
    ] {
        let refused = Err(Refusal::NoSuchLease { lease });
        assert_eq!(bench.command(&command), refused);
    }
    for name in ["", "E\nve", &"e".repeat(65)] {
        for command in [
            request(1, name),
            withdraw(1, name),
            grant(1, name, None),
            deny(1, name, None),
        ] {
            let refusal = bench.command(&command).unwrap_err();
            assert!(matches!(&refusal, Refusal::Field(error) if error.pointer == "/operator"));
        }
    }
    let no_reason = Command::Deny {
        tool: 1,
        operator: "Bob".to_owned(),
        reason: String::new(),
        lease: None,
    };
    let refusal = bench.command(&no_reason).unwrap_err();
    assert!(matches!(&refusal, Refusal::Field(error) if error.pointer == "/reason"));
    assert_eq!(bench.session.snapshot(), before);
}

/// Who asks under ever other names fills the list of one tool and no more.
#[test]
fn no_more_than_eight_ask_for_one_tool() {
    let mut bench = Bench::new(new_session(2));
    bench.join("Ada").unwrap();
    bench.join("Eve").unwrap();
    for number in 0..8 {
        bench.command(&request(1, &format!("n{number}"))).unwrap();
    }
    for number in 8..1000 {
        assert_eq!(
            bench.command(&request(1, &format!("n{number}"))),
            Err(Refusal::TooManyRequests { tool: 1, most: 8 })
        );
    }
    bench.command(&request(2, "Bob")).unwrap();
    bench.command(&withdraw(1, "n3")).unwrap();
    bench.command(&request(1, "n8")).unwrap();
    let asking: Vec<String> = requests(&bench, 1)
        .iter()
        .map(ToString::to_string)
        .collect();
    assert_eq!(asking, ["n0", "n1", "n2", "n4", "n5", "n6", "n7", "n8"]);
}

#[test]
fn of_two_grants_the_second_is_refused_and_the_first_holds() {
    let mut bench = Bench::new(new_session(1));
    let ada = bench.join("Ada").unwrap();
    for name in ["Bob", "Eve"] {
        bench.command(&request(1, name)).unwrap();
    }
    let orders = ["Bob", "Eve"].map(|name| grant(1, name, Some(ada.lease())));
    bench.command(&orders[0]).unwrap();
    assert_eq!(bench.command(&orders[1]), Err(Refusal::NotHeld { tool: 1 }));
    assert_eq!(reserved_for(&bench, 1).as_deref(), Some("Bob"));
    // Nor once somebody holds it again.
    bench.join("Bob").unwrap();
    bench.command(&request(1, "Eve")).unwrap();
    let lease = ada.lease();
    assert_eq!(
        bench.command(&orders[1]),
        Err(Refusal::NoSuchLease { lease })
    );
    assert!(bench.session.side(0).is_some());
}

#[test]
fn a_stop_ends_what_was_asked_for_and_kept() {
    let mut bench = Bench::new(new_session(2));
    let ada = bench.join("Ada").unwrap();
    let _bob = bench.join("Bob").unwrap();
    bench.command(&request(1, "Eve")).unwrap();
    bench.command(&request(2, "Eve")).unwrap();
    bench.command(&grant(1, "Eve", None)).unwrap();
    let mut late = Prepared::new(&grant(2, "Eve", None), bench.session.settings()).unwrap();
    let mut joining = Prepared::new(&join("Eve"), bench.session.settings()).unwrap();
    bench.command(&stop("Joe", "enough")).unwrap();
    for prepared in [&mut late, &mut joining] {
        assert!(bench.session.handle_command(bench.now, prepared).is_err());
    }
    let free = |bench: &Bench| {
        let tools = bench.session.snapshot().tools;
        tools.iter().all(|tool| *tool == Default::default())
    };
    assert!(free(&bench));
    bench.command(&clear("Joe")).unwrap();
    assert!(free(&bench));
    // By no rule but the usual ones: the first free one.
    assert_eq!(bench.join("Ada").unwrap().slot, ada.slot);
}

#[test]
fn a_tool_is_taken_away_by_its_number() {
    let mut bench = Bench::new(new_session(2));
    bench.join("Ada").unwrap();
    let bob = bench.join("Bob").unwrap();
    bench.command(&request(2, "Eve")).unwrap();
    kinds(&mut bench);
    let lease = Some(bob.lease());
    bench.command(&Command::Release { tool: 2, lease }).unwrap();
    let told = kinds(&mut bench);
    assert!(
        matches!(
            &told[..],
            [EventKind::Released {
                slot: 1,
                lease: 2,
                because: Release::TakenAway,
                ..
            }]
        ),
        "{told:?}"
    );
    assert!(bench.session.side(0).is_some() && bench.session.side(1).is_none());
    // It is free for everybody, whoever has asked for it.
    assert_eq!(bench.join("Ida").unwrap().slot, 1);
}
