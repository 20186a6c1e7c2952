//! A join between two sides, and everybody who is neither.

use std::time::Duration;

use proptest::prelude::*;
use teleclay_channel::challenge::{Challenges, Unwelcome};
use teleclay_channel::{Answering, Asking, Challenge, Channel, Context, Forged, Purpose, Secret};
use teleclay_seal::{CHANCE, handshake};

const KEY: &str = "teleclay/local/session/demo/join";

fn secret() -> Secret {
    Secret::of_token("open sesame")
}

fn context(challenge: &Challenge) -> Context<'_> {
    Context {
        key: KEY,
        challenge,
    }
}

/// Two ends that have met.
fn met() -> (Channel, Channel) {
    let challenge = Challenges::new().give(Duration::ZERO);
    let (mut asking, first) = Asking::begin(&secret(), context(&challenge), b"who I am");
    let (heard, answering) = Answering::hear(&secret(), context(&challenge), &first).unwrap();
    assert_eq!(heard, b"who I am");
    let (second, keys) = answering.answer(b"come in");
    let server = Channel::of_server(&keys);
    let (heard, keys) = asking.conclude(&second).unwrap();
    assert_eq!(heard, b"come in");
    (Channel::of_handle(&keys), server)
}

/// A side whose chance is an argument, as in a browser, meets one that has the system's own.
#[test]
fn chance_as_an_argument_makes_the_same_join_and_decides_its_first_message() {
    let challenge = Challenges::new().give(Duration::ZERO);
    let about = context(&challenge);
    let begin = |chance| handshake::Asking::begin(&secret(), about, b"who I am", chance);
    let (mut asking, first) = begin([5; CHANCE]);
    assert_eq!(first, begin([5; CHANCE]).1);
    assert_ne!(first, begin([6; CHANCE]).1);
    let (heard, answering) = Answering::hear(&secret(), about, &first).unwrap();
    assert_eq!(heard, b"who I am");
    let (second, keys) = answering.answer(b"come in");
    let (heard, own) = asking.conclude(&second).unwrap();
    assert_eq!((heard.as_slice(), own), (&b"come in"[..], keys));
}

#[test]
fn two_sides_that_know_the_secret_hear_each_other() {
    let (handle, server) = met();
    let up = handle.seal(Purpose::Frame, b"a frame");
    assert_eq!(server.open(Purpose::Frame, &up), Ok(&b"a frame"[..]));
    let down = server.seal(Purpose::Frame, b"another");
    assert_eq!(handle.open(Purpose::Frame, &down), Ok(&b"another"[..]));
}

#[test]
fn neither_the_secret_nor_what_is_said_can_be_read_on_the_way() {
    let challenge = Challenges::new().give(Duration::ZERO);
    let (mut asking, first) = Asking::begin(&secret(), context(&challenge), b"Ada, on an omega");
    let (_, answering) = Answering::hear(&secret(), context(&challenge), &first).unwrap();
    let (second, _) = answering.answer(b"lease 17");
    asking.conclude(&second).unwrap();
    for (message, said) in [
        (&first, &b"open sesame"[..]),
        (&first, b"Ada"),
        (&second, b"lease"),
    ] {
        assert!(!message.windows(said.len()).any(|part| part == said));
    }
    let (_, again) = Asking::begin(&secret(), context(&challenge), b"Ada, on an omega");
    assert_ne!(first, again, "no two joins look the same");
}

#[test]
fn whoever_lacks_the_secret_is_not_heard_and_the_server_still_is_after_them() {
    let challenge = Challenges::new().give(Duration::ZERO);
    let wrong = [Secret::none(), Secret::of_token("open sesam")];
    let (mut asking, first) = Asking::begin(&secret(), context(&challenge), b"who I am");
    for wrong in &wrong {
        assert!(Answering::hear(wrong, context(&challenge), &first).is_err());
        let (_, theirs) = Asking::begin(wrong, context(&challenge), b"who I am");
        assert!(Answering::hear(&secret(), context(&challenge), &theirs).is_err());
        // One who answers in the server's place hears a question of their own, at best.
        let (_, answering) = Answering::hear(wrong, context(&challenge), &theirs).unwrap();
        assert!(asking.conclude(&answering.answer(b"come in").0).is_err());
    }
    for garbage in [&b""[..], &[0; 48], &[7; 100], &first] {
        assert!(asking.conclude(garbage).is_err());
    }
    let (_, answering) = Answering::hear(&secret(), context(&challenge), &first).unwrap();
    let (second, _) = answering.answer(b"come in");
    assert_eq!(asking.conclude(&second).unwrap().0, b"come in");
}

#[test]
fn a_join_is_for_one_session_and_one_challenge() {
    let challenges = Challenges::new();
    let (one, other) = (
        challenges.give(Duration::ZERO),
        challenges.give(Duration::ZERO),
    );
    let (_, first) = Asking::begin(&secret(), context(&one), b"");
    assert!(Answering::hear(&secret(), context(&other), &first).is_err());
    let elsewhere = Context {
        key: "teleclay/local/session/other/join",
        challenge: &one,
    };
    assert!(Answering::hear(&secret(), elsewhere, &first).is_err());
}

#[test]
fn a_challenge_is_taken_once_for_ten_seconds_and_from_its_giver_alone() {
    let mut challenges = Challenges::new();
    let at = Duration::from_millis;
    let challenge = challenges.give(at(500));
    assert_eq!(challenges.check(at(10_500), &challenge), Ok(()));
    assert_eq!(
        challenges.check(at(10_501), &challenge),
        Err(Unwelcome::Expired)
    );
    assert_eq!(
        Challenges::new().check(at(500), &challenge),
        Err(Unwelcome::Foreign)
    );
    for bit in 0..256 {
        let mut bytes = *challenge.as_bytes();
        bytes[bit / 8] ^= 1 << (bit % 8);
        let changed = Challenge::from_bytes(bytes);
        assert_eq!(challenges.check(at(500), &changed), Err(Unwelcome::Foreign));
    }
    assert_eq!(challenges.take(at(600), &challenge), Ok(()));
    assert_eq!(challenges.take(at(601), &challenge), Err(Unwelcome::Used));
    let next = challenges.give(at(500));
    assert_ne!(next, challenge);
    assert_eq!(challenges.take(at(700), &next), Ok(()));
    assert_eq!(challenges.take(at(700), &challenge), Err(Unwelcome::Used));
}

#[test]
fn the_memory_of_challenges_is_bounded_and_forgets_what_is_old() {
    let mut challenges = Challenges::new();
    let mut taken = 0;
    let now = Duration::from_secs(1);
    loop {
        match challenges.take(now, &challenges.give(now)) {
            Ok(()) => taken += 1,
            Err(error) => break assert_eq!(error, Unwelcome::Crowded),
        }
    }
    assert_eq!(taken, 4096);
    let later = now + Duration::from_secs(11);
    assert_eq!(challenges.take(later, &challenges.give(later)), Ok(()));
}

#[test]
fn a_message_is_heard_once_and_for_what_it_is_for() {
    let (handle, server) = met();
    let sealed = handle.seal(Purpose::Leave, b"17");
    assert_eq!(
        server.open(Purpose::ClayFresh, &sealed),
        Err(Forged::Unauthentic)
    );
    assert_eq!(
        handle.open(Purpose::Leave, &sealed),
        Err(Forged::Unauthentic),
        "one's own"
    );
    assert_eq!(server.open(Purpose::Leave, &sealed), Ok(&b"17"[..]));
    assert_eq!(server.open(Purpose::Leave, &sealed), Err(Forged::Replayed));
    let (_, elsewhere) = met();
    assert_eq!(
        elsewhere.open(Purpose::Leave, &sealed),
        Err(Forged::Unauthentic),
        "another lease"
    );
}

#[test]
fn frames_may_overtake_each_other() {
    let (handle, server) = met();
    let frames: Vec<_> = (0..3000)
        .map(|_| handle.seal(Purpose::Frame, b"f"))
        .collect();
    assert!(server.open(Purpose::Frame, &frames[2999]).is_ok());
    assert!(server.open(Purpose::Frame, &frames[952]).is_ok());
    assert_eq!(
        server.open(Purpose::Frame, &frames[951]),
        Err(Forged::Replayed)
    );
    assert_eq!(
        server.open(Purpose::Frame, &frames[952]),
        Err(Forged::Replayed)
    );
}

#[test]
fn an_answer_is_for_the_question_that_was_asked() {
    let (handle, server) = met();
    let (one, other) = (
        handle.seal(Purpose::State, b"?"),
        handle.seal(Purpose::State, b"?"),
    );
    let answer = server.seal_answer(Purpose::State, &one, b"!");
    assert_eq!(
        handle.open_answer(Purpose::State, &one, &answer),
        Ok(&b"!"[..])
    );
    assert_eq!(
        handle.open_answer(Purpose::State, &other, &answer),
        Err(Forged::Unauthentic)
    );
    assert_eq!(
        handle.open(Purpose::State, &answer),
        Err(Forged::Unauthentic)
    );
}

proptest! {
    /// Whatever is changed, cut off or put on: it is not heard, and what it was made from still is.
    #[test]
    fn a_message_that_was_changed_is_not_heard(
        message in prop::collection::vec(any::<u8>(), 0..1200),
        bit in any::<prop::sample::Index>(),
        cut in any::<prop::sample::Index>(),
        more in any::<u8>(),
    ) {
        let keys = teleclay_channel::Keys::new([1; 32], [2; 32]);
        let (handle, server) = (Channel::of_handle(&keys), Channel::of_server(&keys));
        let sealed = handle.seal(Purpose::Frame, &message);
        let mut changed = sealed.clone();
        let bit = bit.index(8 * sealed.len());
        changed[bit / 8] ^= 1 << (bit % 8);
        prop_assert!(server.open(Purpose::Frame, &changed).is_err());
        prop_assert!(server.open(Purpose::Frame, &sealed[..cut.index(sealed.len())]).is_err());
        let mut longer = sealed.clone();
        longer.push(more);
        prop_assert!(server.open(Purpose::Frame, &longer).is_err());
        prop_assert_eq!(server.open(Purpose::Frame, &sealed), Ok(&message[..]));
    }
}

/// Another implementation's first message: Python's `noiseprotocol`, with the prologue and the pre-shared key that the
/// specification names.
#[test]
fn a_join_is_that_of_the_specification() {
    let first = "ac8b936247a710c23cd3c2e2383f10f3e01213a216acf1a2d201c83945408a5a\
                 0878af6a76594a13a750e6a562ee7e626b54d69afd1fc40d";
    let first: Vec<u8> = (0..first.len() / 2)
        .map(|byte| u8::from_str_radix(&first[2 * byte..2 * byte + 2], 16).unwrap())
        .collect();
    let challenge = Challenge::from_bytes(std::array::from_fn(|n| n as u8));
    let (heard, _) = Answering::hear(&secret(), context(&challenge), &first).unwrap();
    assert_eq!(heard, b"who I am");
}

/// Another implementation's tags: `hmac` of Python's own library.
#[test]
fn trailers_are_those_of_the_specification() {
    let own: [u8; 32] = std::array::from_fn(|n| n as u8);
    let others: [u8; 32] = std::array::from_fn(|n| 32 + n as u8);
    let keys = teleclay_channel::Keys::new(own, others);
    let (handle, server) = (Channel::of_handle(&keys), Channel::of_server(&keys));
    let hex = |bytes: &[u8]| {
        bytes
            .iter()
            .map(|byte| format!("{byte:02x}"))
            .collect::<String>()
    };
    for (number, tag) in [
        ("0100000000000000", "3771d4b1cfb0d77b35729b111f8d44c1"),
        ("0200000000000000", "57e4fa9f351489c82b51e5ac1f188595"),
    ] {
        assert_eq!(
            hex(&handle.trailer(Purpose::Frame, b"a frame")),
            format!("{number}{tag}")
        );
    }
    let answer = server.seal_answer(Purpose::Parameters, b"the question", b"the answer");
    let trailer = "01000000000000008cd2edd831e584898294bf949e21e13d";
    assert_eq!(hex(&answer[10..]), trailer);
}
