//! An Inverse3 in a person's hand, by way of a stand-in for its service, in a real session.

use std::time::Duration;

use teleclay_proto::http::{Session, SessionState};
use teleclay_tests::inverse_service::{InverseService, Seen, Trouble, Version};
use teleclay_tests::process::{PATIENCE, wait_for};
use teleclay_tests::stage::{DEMO, Handle, HandleOptions, Server};

use super::endings::cuts;

/// What an Inverse3 may do to a hand, from `devices/src/profile.rs`: N and N/s.
const MOST_N: f64 = 5.0;
const SLEW_N_PER_S: f64 = 1000.0;
/// Exchanges of the run without trouble: 3 s at a thousand a second. `TELECLAY_EXCHANGES` asks for others.
const EXCHANGES: u64 = 3000;

/// What says that the clay is felt.
const FELT_N: f64 = 0.2;

struct Held {
    server: Server,
    service: InverseService,
    handle: Handle,
}

impl Held {
    /// A hand that cuts.
    fn cutting(version: Version) -> Self {
        let server = Server::on_free_ports().unwrap();
        let service = InverseService::start(version).unwrap();
        let options = HandleOptions::new(&server.endpoint()).with(&service.flags());
        let handle = Handle::start(&options).unwrap();
        let held = Self {
            server,
            service,
            handle,
        };
        held.session_when("a cut", cuts);
        held.seen_when("a force of the clay", |seen| FELT_N < seen.most_n);
        held
    }

    fn session_when(&self, what: &str, wanted: impl Fn(&Session) -> bool) -> Session {
        let session = self
            .server
            .client
            .session_when(DEMO, what, PATIENCE, wanted);
        session.unwrap_or_else(|error| {
            panic!(
                "{error:#}\n{:?}\n{}",
                self.service.seen(),
                self.handle.process.stderr()
            )
        })
    }

    fn seen_when(&self, what: &str, wanted: impl Fn(&Seen) -> bool) -> Seen {
        let seen = || Some(self.service.seen()).filter(|seen| wanted(seen));
        wait_for(what, 4 * PATIENCE, seen).unwrap_or_else(|error| {
            panic!(
                "{error:#}\n{:?}\n{}",
                self.service.seen(),
                self.handle.process.stderr()
            )
        })
    }
}

/// No force beyond the device's own law, and no faster change than it allows in the time between two messages.
fn keeps_the_law(seen: &Seen) {
    assert_eq!(seen.wrong, None);
    assert!(seen.most_n <= MOST_N + 1e-9, "{seen:?}");
    let most_step_n = SLEW_N_PER_S * seen.longest_gap_s.max(2e-3);
    assert!(seen.largest_step_n <= most_step_n, "{seen:?}");
}

#[test]
fn a_hand_at_an_inverse3_cuts_and_feels_the_clay_in_either_spelling() {
    let exchanges = std::env::var("TELECLAY_EXCHANGES");
    let exchanges = exchanges.map_or(EXCHANGES, |exchanges| exchanges.parse().unwrap());
    for version in [Version::Old, Version::New] {
        let mut held = Held::cutting(version);
        let seen = held.seen_when("its exchanges", |seen| exchanges <= seen.exchanges);
        keeps_the_law(&seen);
        let session = held.session_when("a cut", cuts);
        println!(
            "{version:?}: {} exchanges, {:.2} N at most, {:.3} N from message to message, {:.1} ms between two at most, {:.4} J given, {} units cut",
            seen.exchanges,
            seen.most_n,
            seen.largest_step_n,
            1e3 * seen.longest_gap_s,
            seen.given_j,
            session.clay.removed_units,
        );
        let (used, other) = match version {
            Version::Old => (seen.values, seen.vectors),
            Version::New => (seen.vectors, seen.values),
        };
        assert_eq!((used, other), (seen.exchanges, 0));
        // Clay pushes back, and takes more than it gives.
        assert!(seen.given_j < 0.0, "{seen:?}");
        assert!(held.handle.process.end().unwrap().success());
        let last = held.seen_when("its goodbye", |seen| seen.is_over);
        assert_eq!(last.force_n, Some([0.0; 3]));
    }
}

#[test]
fn an_inverse3_that_is_lost_ends_in_words_without_force_and_frees_its_tool() {
    for (trouble, why) in [
        (Trouble::Unplugged, "unplugged"),
        (Trouble::Brake, "the emergency brake was put on"),
        (
            Trouble::Silent,
            "the service did not answer for a quarter of a second",
        ),
    ] {
        let mut held = Held::cutting(Version::New);
        held.service.make(trouble);
        let ended = held.handle.process.ends().unwrap();
        assert_eq!(ended.code(), Some(3), "{trouble:?}");
        let said = held.handle.process.stderr();
        let words = [why, "force released"];
        assert!(words.iter().all(|words| said.contains(words)), "{said}");
        let last = held.seen_when("its goodbye", |seen| seen.is_over);
        assert_eq!(last.force_n, Some([0.0; 3]), "{trouble:?}");
        keeps_the_law(&last);
        let free = held.session_when("the tool to be free", |session| {
            session.tools.iter().all(|tool| tool.operator.is_empty())
        });
        assert_ne!(free.state, SessionState::Fault, "{trouble:?}");
    }
}

/// The force goes after 20 ms, by a message that nobody asked for; the hand keeps its tool, and moves it once it is
/// held again.
#[test]
fn a_late_answer_of_the_service_costs_the_force_and_not_the_session() {
    let held = Held::cutting(Version::New);
    let before = held.service.seen();
    held.service.make(Trouble::Late(Duration::from_millis(80)));
    let later = held.seen_when("the late answer", |seen| {
        0.08 <= seen.longest_gap_s && before.exchanges + 500 < seen.exchanges
    });
    keeps_the_law(&later);
    // Where the hand takes hold again is its own affair, and there may be no clay there; but the tool goes on with it.
    let after = held.server.client.session(DEMO).unwrap();
    let went_on = held.session_when("the tool to move on", |session| {
        let [tool, was] = [session, &after].map(|session| &session.tools[0]);
        tool.connected && tool.position_m != was.position_m
    });
    assert_eq!(went_on.tools[0].operator, after.tools[0].operator);
    assert_ne!(went_on.state, SessionState::Fault);
}
