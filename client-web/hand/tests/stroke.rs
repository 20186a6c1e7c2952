//! A recorded stroke through the calls that JavaScript makes: the bits of `vectors/stroke.json`, which
//! `client-web/src/protocol/hand_module.test.ts` has the module work out, too.

use serde_json::Value;
use teleclay_hand::{Buffer, DONE, Hand, REFUSED, numbers};

const STROKE: &str = include_str!("../vectors/stroke.json");

fn give(hand: &mut Hand, bytes: &[u8]) {
    hand.resize_bytes_in(bytes.len());
    hand.bytes_in().copy_from_slice(bytes);
}

fn unhex(text: &Value) -> Vec<u8> {
    let text = text.as_str().unwrap();
    let byte = |at| u8::from_str_radix(&text[at..at + 2], 16).unwrap();
    (0..text.len()).step_by(2).map(byte).collect()
}

/// FNV-1a, 32 bits.
fn fold(digest: u32, bytes: &[u8]) -> u32 {
    bytes.iter().fold(digest, |digest, byte| {
        (digest ^ u32::from(*byte)).wrapping_mul(0x0100_0193)
    })
}

#[test]
fn a_recorded_stroke_gives_the_recorded_bits() {
    let stroke: Value = serde_json::from_str(STROKE).unwrap();
    let mut hand = Hand::default();
    let keys = unhex(&stroke["keys"]);
    let granted = stroke["granted"].as_str().unwrap().as_bytes();
    give(&mut hand, &[&keys[..], granted].concat());
    assert_eq!(hand.begin(0.0, 60.0, 1.0), DONE, "{}", hand.refusal());
    hand.hold();
    let (mut digest, mut felt) = (0x811C_9DC5, 0.0_f64);
    for wake in stroke["wakes"].as_array().unwrap() {
        let now_ms = wake["now_ms"].as_f64().unwrap();
        for sample in wake["samples"].as_array().unwrap() {
            let part = |at: usize| sample[at].as_f64().unwrap();
            hand.tell(now_ms, part(0), [part(1), part(2), part(3)]);
        }
        for message in wake["heard"].as_array().unwrap() {
            give(&mut hand, &unhex(message));
            assert_eq!(hand.hear(now_ms), DONE, "{}", hand.refusal());
        }
        hand.advance(now_ms);
        hand.look();
        assert_eq!(hand.numbers().len(), numbers::LENGTH);
        felt = felt.max(hand.numbers()[15].abs());
        digest = fold(digest, hand.outgoing());
        for number in hand.numbers() {
            // Which NaN it is no machine promises.
            let number = if number.is_nan() { -1.0 } else { *number };
            digest = fold(digest, &number.to_le_bytes());
        }
        hand.tidy();
    }
    assert!(0.1 < felt, "the stroke cuts: {felt} N");
    assert!(hand.numbers()[38] <= 0.0, "each message was heard");
    assert_eq!(format!("{digest:08x}"), stroke["digest"].as_str().unwrap());
}

#[test]
fn what_cannot_be_done_is_said_in_words_and_changes_nothing() {
    let mut hand = Hand::default();
    assert_eq!(hand.hear(0.0), REFUSED);
    assert_eq!(hand.refusal(), "no grant was taken yet");
    hand.tell(0.0, 0.0, [0.0; 3]);
    hand.hold();
    assert_eq!(hand.advance(1000.0), 0);
    hand.look();
    assert!(hand.numbers().is_empty() && hand.outgoing().is_empty());
    give(&mut hand, &[0; 63]);
    assert_eq!(hand.begin(0.0, 60.0, 1.0), REFUSED);
    assert_eq!(hand.refusal(), "a grant comes after 64 bytes of keys");
    give(&mut hand, &[0; 64]);
    assert_eq!(
        (hand.begin(0.0, 60.0, 1.0), hand.length(Buffer::Outgoing)),
        (REFUSED, 0)
    );
    assert!(hand.refusal().starts_with("line 1"), "{}", hand.refusal());
}
