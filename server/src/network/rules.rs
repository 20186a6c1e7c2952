//! What Zenoh itself lets others do: what no rule allows is not let through, by or to anybody. It knows nobody by name,
//! so this stands beside the trailer of every message and never instead: it keeps strangers from asking others,
//! answering for the server and listening in, not from lying.

use teleclay_proto::RealmName;
use teleclay_proto::keys::{self, Leaf};
use teleclay_shell::network::{Flow, Rule};

/// What may be asked wherever a handle is connected.
const ASKED_ANYWHERE: [Leaf; 3] = [Leaf::Challenge, Leaf::Join, Leaf::Leave];
/// What takes longer to answer, away from the frames.
const ASKED_ASIDE: [Leaf; 4] = [
    Leaf::Parameters,
    Leaf::ClaySnapshot,
    Leaf::ClayFresh,
    Leaf::State,
];
/// What is told without being asked.
const TOLD: [Leaf; 2] = [Leaf::State, Leaf::ClayBricks];

/// On the session that frames fly on: joins and goodbyes, and frames up and down.
pub(super) fn of_control(realm: &RealmName) -> Vec<Rule> {
    let up = keys::every_tool_up_in(realm);
    let down = vec![
        keys::every_tool_down_in(realm),
        keys::every_farewell_in(realm),
    ];
    let mut rules = questions(realm, &ASKED_ANYWHERE);
    rules.extend([
        rule(&["put"], Flow::In, vec![up.clone()]),
        rule(&["declare_subscriber"], Flow::Out, vec![up]),
        rule(&["put"], Flow::Out, down.clone()),
        rule(&["declare_subscriber"], Flow::In, down),
    ]);
    rules.extend(signs_of_life(realm));
    rules
}

/// On the session of everything else: questions under a lease, and what everybody may know.
pub(super) fn of_slow(realm: &RealmName) -> Vec<Rule> {
    let told = every(realm, &TOLD);
    let mut rules = questions(realm, &[&ASKED_ANYWHERE[..], &ASKED_ASIDE].concat());
    rules.extend([
        rule(&["put"], Flow::Out, told.clone()),
        rule(&["declare_subscriber"], Flow::In, told),
    ]);
    rules.extend(signs_of_life(realm));
    rules
}

/// Others ask and the server answers; never the other way round, and nobody asks anybody else.
fn questions(realm: &RealmName, leaves: &[Leaf]) -> Vec<Rule> {
    let asked = every(realm, leaves);
    vec![
        rule(&["query"], Flow::In, asked.clone()),
        rule(&["reply"], Flow::Out, asked),
        // It is declared once for all that is below.
        rule(
            &["declare_queryable"],
            Flow::Out,
            vec![keys::everything_in(realm)],
        ),
    ]
}

/// The server shows its sessions, operators show themselves, and whoever likes looks.
fn signs_of_life(realm: &RealmName) -> Vec<Rule> {
    let both = [
        keys::every_session_alive_in(realm),
        keys::every_operator_in(realm),
    ];
    let [sessions, operators] = both.clone().map(|key| vec![key]);
    vec![
        rule(
            &["declare_liveliness_subscriber", "liveliness_query"],
            Flow::In,
            both.to_vec(),
        ),
        rule(&["liveliness_token", "reply"], Flow::Out, both.to_vec()),
        rule(&["liveliness_token"], Flow::In, operators),
        // Nobody else shows a session through this server.
        rule(&["declare_liveliness_subscriber"], Flow::Out, sessions),
    ]
}

fn every(realm: &RealmName, leaves: &[Leaf]) -> Vec<String> {
    let leaves = leaves.iter();
    leaves
        .map(|leaf| keys::of_every_session_in(realm, *leaf))
        .collect()
}

fn rule(messages: &[&'static str], flow: Flow, keys: Vec<String>) -> Rule {
    Rule {
        messages: messages.to_vec(),
        flow,
        keys,
    }
}
