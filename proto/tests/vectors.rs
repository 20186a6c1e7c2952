//! The conformance vectors: every message decodes to the values beside it and encodes to the same bytes again. One
//! message of each kind is also laid out here by hand from SPEC.md, field by field, so that the files cannot just
//! repeat the code.

#[allow(dead_code, unreachable_pub, reason = "the example uses it too")]
#[path = "../examples/vectors/cases/mod.rs"]
mod cases;

use std::fs;
use std::path::Path;
use std::str::FromStr;

use cases::values::{
    bricks_value, handle_frame_value, hex, runs, telemetry_value, tool_frame_value,
};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use teleclay_proto::FrameError;
use teleclay_proto::frame::{HandleFrame, MAX_FRAME, ToolFrame};
use teleclay_proto::http::{BodyError, NewSession, Validate, parse};
use teleclay_proto::join::{
    ChallengeReply, ChallengeRequest, Farewell, FreshReply, JoinReply, JoinRequest, LeaseRequest,
    LeaveReply, LoopParameters, SealedJoin, SealedReply,
};
use teleclay_proto::keys::Key;
use teleclay_proto::watch::{
    BRICK_VOXELS, BricksView, BricksWriter, ClientText, Message, PackedBrick, ServerText,
    TelemetryView, pack,
};

#[test]
fn the_files_are_what_the_example_writes() {
    for (name, text) in cases::files() {
        let written: Value = serde_json::from_str(&text).expect("the example writes JSON");
        assert_eq!(
            file(name),
            written,
            "{name} is stale: run the example `vectors`"
        );
    }
}

#[test]
fn handle_frames_decode_and_encode_to_the_same_bytes() {
    for case in list(&file("handle_frames.json"), "cases") {
        let frame = HandleFrame::decode(&bytes(&case["hex"])).expect("the vector decodes");
        assert_eq!(
            handle_frame_value(&frame),
            case["value"],
            "{}",
            case["name"]
        );
        assert_eq!(
            hex(frame.encode(&mut [0xaa; MAX_FRAME])),
            case["hex"],
            "{}",
            case["name"]
        );
    }
}

#[test]
fn tool_frames_decode_and_encode_to_the_same_bytes() {
    for case in list(&file("tool_frames.json"), "cases") {
        let frame = ToolFrame::decode(&bytes(&case["hex"])).expect("the vector decodes");
        assert_eq!(tool_frame_value(&frame), case["value"], "{}", case["name"]);
        assert_eq!(
            hex(frame.encode(&mut [0xaa; MAX_FRAME])),
            case["hex"],
            "{}",
            case["name"]
        );
    }
}

#[test]
fn telemetry_decodes_and_encodes_to_the_same_bytes() {
    for case in list(&file("telemetry.json"), "cases") {
        let message = bytes(&case["hex"]);
        let view = TelemetryView::decode(&message).expect("the vector decodes");
        assert_eq!(telemetry_value(&view), case["value"], "{}", case["name"]);
        let mut again = b"whatever was there".to_vec();
        view.batch
            .encode(&view.iter().collect::<Vec<_>>(), &mut again)
            .expect("few samples");
        assert_eq!(hex(&again), case["hex"], "{}", case["name"]);
    }
}

#[test]
fn bricks_decode_and_encode_to_the_same_bytes() {
    for case in list(&file("bricks.json"), "cases") {
        let message = bytes(&case["hex"]);
        let view = BricksView::decode(&message).expect("the vector decodes");
        assert_eq!(bricks_value(&view), case["value"], "{}", case["name"]);
        let mut writer = BricksWriter::new(view.header, usize::MAX);
        for brick in view.iter() {
            // Through the voxels, so that the packing is done again too.
            let mut voxels = [0; BRICK_VOXELS];
            brick.body.unpack(&mut voxels);
            let content = teleclay_proto::watch::BrickContent::Voxels(&voxels);
            writer
                .push(brick.index, content)
                .expect("the brick lies in the grid");
        }
        assert_eq!(writer.finish(), [message], "{}", case["name"]);
    }
}

#[test]
fn packed_bricks_unpack_and_pack_to_the_same_bytes() {
    let file = file("packed_bricks.json");
    for case in list(&file, "cases") {
        let voxels = unpacked(case);
        let mut packed = Vec::new();
        pack(&voxels, &mut packed);
        assert_eq!(hex(&packed), case["hex"], "{}", case["name"]);
    }
    for case in list(&file, "other_tokens") {
        unpacked(case);
    }
}

#[test]
fn bad_bytes_are_refused_for_the_reason_given() {
    for case in list(&file("refused.json"), "cases") {
        let bytes = bytes(&case["hex"]);
        let error = match case["decoder"].as_str() {
            Some("handle_frame") => HandleFrame::decode(&bytes).map(drop),
            Some("tool_frame") => ToolFrame::decode(&bytes).map(drop),
            Some("watch") => Message::decode(&bytes).map(drop),
            Some("packed") => PackedBrick::new(&bytes).map(drop),
            other => panic!("no decoder {other:?}"),
        };
        assert_eq!(
            error.map_err(word),
            Err(case["error"].as_str().expect("an error is text")),
            "{}",
            case["name"]
        );
    }
}

#[test]
fn texts_parse_and_print_the_same_again() {
    for case in list(&file("server_texts.json"), "cases") {
        let text: ServerText =
            serde_json::from_value(case["value"].clone()).expect("the vector parses");
        assert_eq!(
            serde_json::to_value(text).expect("it prints"),
            case["value"]
        );
    }
    for case in list(&file("client_texts.json"), "cases") {
        assert_parses_and_prints::<ClientText>(case);
    }
    let hand = file("hand_texts.json");
    for case in list(&hand, "from_the_server") {
        let text: ServerText =
            serde_json::from_value(case["value"].clone()).expect("the vector parses");
        assert_eq!(
            serde_json::to_value(text).expect("it prints"),
            case["value"]
        );
    }
    for case in list(&hand, "to_the_server") {
        assert_parses_and_prints::<ClientText>(case);
    }
    let join = file("join.json");
    list(&join, "requests")
        .iter()
        .for_each(assert_parses_and_prints::<JoinRequest>);
    list(&join, "replies")
        .iter()
        .for_each(assert_parses_and_prints::<JoinReply>);
    list(&join, "lease_requests")
        .iter()
        .for_each(assert_parses_and_prints::<LeaseRequest>);
    list(&join, "leave_replies")
        .iter()
        .for_each(assert_parses_and_prints::<LeaveReply>);
    list(&join, "challenge_requests")
        .iter()
        .for_each(assert_parses_and_prints::<ChallengeRequest>);
    list(&join, "challenge_replies")
        .iter()
        .for_each(assert_parses_and_prints::<ChallengeReply>);
    list(&join, "sealed_joins")
        .iter()
        .for_each(assert_parses_and_prints::<SealedJoin>);
    list(&join, "sealed_replies")
        .iter()
        .for_each(assert_parses_and_prints::<SealedReply>);
    list(&join, "farewells")
        .iter()
        .for_each(assert_parses_and_prints::<Farewell>);
    list(&join, "fresh_replies")
        .iter()
        .for_each(assert_parses_and_prints::<FreshReply>);
    list(&join, "parameters")
        .iter()
        .for_each(assert_parses_and_prints::<LoopParameters>);
    list(&join, "new_sessions")
        .iter()
        .for_each(assert_parses_and_prints::<NewSession>);
}

#[test]
fn bad_texts_are_refused_with_the_field_named() {
    let (client, hand) = (file("client_texts.json"), file("hand_texts.json"));
    for case in list(&client, "refused")
        .iter()
        .chain(list(&hand, "refused"))
    {
        let text = case["text"].as_str().expect("the text is a string");
        match (ClientText::parse(text), case["pointer"].as_str()) {
            (Err(BodyError::Field(error)), Some(pointer)) => {
                assert_eq!(error.pointer, pointer, "{text}");
                assert!(!error.detail.is_empty(), "{text}");
            }
            (Err(BodyError::Syntax { .. }), None) => {}
            (got, want) => panic!("{text}: {got:?}, wanted an error at {want:?}"),
        }
    }
}

#[test]
fn keys_parse_and_print_the_same_again() {
    let file = file("keys.json");
    for key in list(&file, "good") {
        let key = key.as_str().expect("a key is text");
        assert_eq!(
            Key::from_str(key).map(|key| key.to_string()).as_deref(),
            Ok(key)
        );
    }
    for key in list(&file, "bad") {
        let key = key.as_str().expect("a key is text");
        assert!(Key::from_str(key).is_err(), "{key:?} was accepted");
    }
}

#[test]
fn a_handle_frame_laid_out_by_hand() {
    let by_hand = [
        "5446 01 01",                                         // "TF", version 1, kind 1
        "01020304 05060708 090a0b0c",                         // lease, sequence, echo_hold_ns
        "1112131415161718 2122232425262728",                  // sent_ns, echo_ns
        "31323334 35363738 393a3b3c 03 01 0000", // clay_epoch, ownership_epoch, revision, tdpa, engaged
        "000000000000e03f 000000000000d0bf 000000000000c03f", // position 1/2, -1/4, 1/8
        "000000000000f03f 00000000000000c0 0000000000000840", // velocity 1, -2, 3
        "0000000000001040 00000000000014c0 0000000000001840", // hand force 4, -5, 6
        "0000000000001cc0 0000000000002040 00000000000022c0", // felt force -7, 8, -9
        "9a9999999999b93f 9a9999999999c93f 333333333333d33f", // wave 0.1, 0.2, 0.3
        "0000000000002540 0000000000002740 0000000000002940", // its integral 10.5, 11.5, 12.5
        "fca9f1d24d62503f fca9f1d24d62603f fa7e6abc7493683f", // energy 0.001, 0.002, 0.003
        "1032547698badcfe",                      // clay hash fedcba9876543210
        "51525354 02 02 0000", // relayed sweeps acknowledged, a stale copy, two gaps
        "000000000000f83f",    // corrections: moved 1.5 N so far
        "0000003f 000040bf 0000803d 0000c03e", // 1/2, -3/4, 1/16 N held, a step of 3/8 N
        "0000003b 0000003d 61626364", // 2^-9 J brought in, 2^-5 J in the tank, count
        "feffffff 03 000000",  // oldest 2^32 - 2, three runs
        "feffffff 01 04 0000 00000000 01000000 ffffffff", // one sweep, four bytes a coordinate, from 0, 1, -1
        "00000080 feffff7f 02020304",                     // by -2^31, 2^31 - 2, 0x04030202
        "ffffffff 02 02 0000 02000000 03000000 04000000", // two sweeps, two bytes a coordinate
        "0300 0300 0300 0080 ff7f 0000",                  // by 3, 3, 3, then by -2^15, 2^15 - 1, 0
        "02000000 01 02 0000 feffffff fdffffff fcffffff", // number 2, from -2, -3, -4
        "fdff fdff fdff",                                 // by -3 each
        "0100 0200 71727374", // one missing and two come, 0x7271 and 0x7473
    ];
    assert_eq!(
        list(&file("handle_frames.json"), "cases")[1]["hex"],
        joined(&by_hand)
    );
}

#[test]
fn a_tool_frame_laid_out_by_hand() {
    let by_hand = [
        "5446 01 02",                                         // "TF", version 1, kind 2
        "01020304 05060708 090a0b0c",                         // lease, sequence, echo_hold_ns
        "1112131415161718 2122232425262728",                  // sent_ns, echo_ns
        "31323334 35363738 393a3b3c 02 01 0000", // clay_epoch, ownership_epoch, revision, wave, running
        "000000000000e03f 000000000000d0bf 000000000000c03f", // position 1/2, -1/4, 1/8
        "000000000000f03f 00000000000000c0 0000000000000840", // velocity 1, -2, 3
        "0000000000001040 00000000000014c0 0000000000001840", // force 4, -5, 6
        "9a9999999999b93f 9a9999999999c93f 333333333333d33f", // wave 0.1, 0.2, 0.3
        "0000000000002540 0000000000002740 0000000000002940", // its integral 10.5, 11.5, 12.5
        "fca9f1d24d62503f fca9f1d24d62603f fa7e6abc7493683f", // energy 0.001, 0.002, 0.003
        "2d431cebe2361a3f 1032547698badcfe",     // 1e-4 m2, clay hash
        "41424344 45464748 02 01 393a3b3c 17 00", // acknowledged, refused, too_fast, one gap, durable, 23 epochs
        "08000000 01 000000",                     // oldest 8, one run of relayed sweeps
        "09000000 01 02 0000 02000000 03000000 04000000",
        "fcff faff f8ff", // by -4, -6, -8
        "51525354",       // 0x5251 missing, 0x5453 come
    ];
    assert_eq!(
        list(&file("tool_frames.json"), "cases")[1]["hex"],
        joined(&by_hand)
    );
}

#[test]
fn a_batch_of_telemetry_laid_out_by_hand() {
    let nothing = "00000000".repeat(22);
    let by_hand = [
        "5443 01 01 05060708",        // "TC", version 1, kind 1, sequence
        "02000000 02000000 a00f0000", // tool 2, two samples, 4000 us
        "00000000 5839b4c8d61cc840",  // none dropped, from 12345.678 s
        "0000803f 00000040 00004040", // hand force 1, 2, 3
        "000080bf 000000c0 000040c0", // felt force -1, -2, -3
        "0000c0bf 000020c0 000060c0", // tool force -1.5, -2.5, -3.5
        "0000003e 0000803e 0000003f", // handle position 1/8, 1/4, 1/2
        "0000803d 0000003d 0000803c", // tool position 1/16, 1/32, 1/64
        "00002041 0000a041 0000f041", // handle velocity 10, 20, 30
        "00002042 00004842 00007042", // tool velocity 40, 50, 60
        "0000403f 000040bf 0000003c", // energies 3/4, -3/4, round trip 1/128
        "0000803e 0000003f 0000803c", // correction step 1/4, held 1/2, age 1/64
        nothing.as_str(),
        "00000080 0000c07f",          // energy -0, round trip NaN
        "00000000 00000000 00000000", // nothing corrected, just heard
    ];
    assert_eq!(
        list(&file("telemetry.json"), "cases")[1]["hex"],
        joined(&by_hand)
    );
}

#[test]
fn a_change_of_a_brick_laid_out_by_hand() {
    // Seven planes of 255, one of 128, eight of 0. Row by row the residual is what the row adds to the row before it.
    let (row_of_255, row_of_129, row_of_128) = ("ff".repeat(16), "81".repeat(16), "80".repeat(16));
    let by_hand = [
        "5443 01 02 05060708",     // "TC", version 1, kind 2, sequence
        "03000000 1000 0800 0800", // epoch 3, 16 x 8 x 8 bricks
        "0000 6f12033a 01000000",  // a change, voxels of 0.5 mm, one brick
        "00020000 02 00 5300",     // brick 512, packed, 83 bytes
        "0f",
        row_of_255.as_str(), // 16 residuals of 255
        &"ff".repeat(13),
        "ef", // 7 x 256 - 16 = 1776 zeros: 13 x 128 + 112
        "0f",
        row_of_129.as_str(), // 128 - 255 = 129 modulo 256
        "ff ef",             // 256 - 16 = 240 zeros: 128 + 112
        "0f",
        row_of_128.as_str(), // 0 - 128 = 128 modulo 256
        &"ff".repeat(15),
        "ef", // 8 x 256 - 16 = 2032 zeros: 15 x 128 + 112
    ];
    assert_eq!(
        list(&file("bricks.json"), "cases")[2]["hex"],
        joined(&by_hand)
    );
}

#[test]
fn texts_laid_out_by_hand() {
    let hello = r#"{"type":"hello","protocol":1,"session":"demo","server_version":"0.1.0"}"#;
    assert_eq!(
        list(&file("server_texts.json"), "cases")[0]["value"],
        value(hello)
    );
    let subscribe = r#"{"type":"subscribe","telemetry":"on","bricks":"off"}"#;
    assert_eq!(
        list(&file("client_texts.json"), "cases")[0]["value"],
        value(subscribe)
    );
    let patch = r#"{"type":"patch","session":{"network":{"up":{"delay_s":0.05}}}}"#;
    assert_eq!(
        list(&file("client_texts.json"), "cases")[2]["value"],
        value(patch)
    );
    let request = r#"{"protocol":1,"operator":"Ada","device":"simulated"}"#;
    assert_eq!(
        list(&file("join.json"), "requests")[0]["value"],
        value(request)
    );
    let refused = r#"{"outcome":"refused","code":"no_free_tool",
        "reason":"the only tool of session `demo` is held by Ada"}"#;
    assert_eq!(
        list(&file("join.json"), "replies")[1]["value"],
        value(refused)
    );
    let reserved = r#"{"outcome":"refused","code":"reserved",
        "reason":"the tool of session `demo` that is free is kept for Bob","holder":"Bob"}"#;
    let replies = file("join.json");
    assert_eq!(list(&replies, "replies")[3]["value"], value(reserved));
    let stopped = r#"{"outcome":"refused","code":"stopped",
        "reason":"session `demo` was stopped by Eve: a hand in the way"}"#;
    assert_eq!(list(&replies, "replies")[2]["value"], value(stopped));
    let texts = file("server_texts.json");
    let states: Vec<&Value> = list(&texts, "cases")
        .iter()
        .filter(|case| case["value"]["type"] == "state")
        .map(|case| &case["value"]["session"])
        .collect();
    let [running, stopped, handed_over] = states[..] else {
        panic!("{} states", states.len())
    };
    assert_eq!(running["stop"], Value::Null);
    assert_eq!(running["tools"][0]["requests"], value(r#"["Bob","Eve"]"#));
    assert_eq!(running["tools"][0]["reserved_for"], Value::Null);
    let stop = r#"{"by":"Eve","reason":"a hand in the way"}"#;
    assert_eq!(stopped["stop"], value(stop));
    assert_eq!(stopped["state"], "stopped");
    assert_eq!(handed_over["tools"][0]["reserved_for"], "Bob");
    let keys = [
        "teleclay/lab-1/session/demo/alive",
        "teleclay/lab-1/session/demo/challenge",
        "teleclay/lab-1/session/demo/join",
    ];
    assert_eq!(list(&file("keys.json"), "good")[..3], keys);
    let sealed = r#"{"challenge":"000102030405060708090a0b0c0d0e0f101112131415161718191a1b1c1d1e1f","message":"0001feff"}"#;
    assert_eq!(
        list(&file("join.json"), "sealed_joins")[0]["value"],
        value(sealed)
    );
}

fn assert_parses_and_prints<T: DeserializeOwned + Serialize + Validate>(case: &Value) {
    let parsed: T = parse(case["value"].to_string().as_bytes()).expect("the vector parses");
    assert_eq!(
        serde_json::to_value(parsed).expect("it prints"),
        case["value"],
        "{}",
        case["name"]
    );
}

fn unpacked(case: &Value) -> [u8; BRICK_VOXELS] {
    let packed = bytes(&case["hex"]);
    let mut voxels = [0xaa; BRICK_VOXELS];
    PackedBrick::new(&packed)
        .expect("the vector unpacks")
        .unpack(&mut voxels);
    assert_eq!(runs(&voxels), case["voxel_runs"], "{}", case["name"]);
    voxels
}

fn word(error: FrameError) -> &'static str {
    match error {
        FrameError::TooShort { .. } => "too_short",
        FrameError::TrailingBytes { .. } => "trailing_bytes",
        FrameError::WrongMagic { .. } => "wrong_magic",
        FrameError::WrongVersion { .. } => "wrong_version",
        FrameError::WrongKind { .. } => "wrong_kind",
        FrameError::UnknownValue { .. } => "unknown_value",
        FrameError::ReservedNotZero { .. } => "reserved_not_zero",
        FrameError::TooMany { .. } => "too_many",
        FrameError::BrickOutsideGrid { .. } => "brick_outside_grid",
        FrameError::WrongVoxelCount { .. } => "wrong_voxel_count",
        FrameError::WrongBrickLength { .. } => "wrong_brick_length",
        other => panic!("{other} has no word"),
    }
}

fn file(name: &str) -> Value {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("vectors")
        .join(name);
    let text = fs::read_to_string(&path).expect("the file of vectors is there");
    value(&text)
}

fn value(text: &str) -> Value {
    serde_json::from_str(text).expect("it is JSON")
}

/// The cases under `name`, of which there must be some.
fn list<'a>(file: &'a Value, name: &str) -> &'a [Value] {
    let cases = file[name].as_array().expect("the file has the list");
    assert!(!cases.is_empty(), "{name} is empty");
    cases
}

fn bytes(hex: &Value) -> Vec<u8> {
    let digits = hex.as_str().expect("bytes are text").as_bytes();
    let (pairs, rest) = digits.as_chunks::<2>();
    assert!(rest.is_empty(), "half a byte");
    let digit = |digit: u8| char::from(digit).to_digit(16).expect("a hexadecimal digit") as u8;
    pairs
        .iter()
        .map(|[high, low]| digit(*high) << 4 | digit(*low))
        .collect()
}

fn joined(parts: &[&str]) -> String {
    parts.concat().replace(' ', "")
}
