//! More than ten million hostile inputs. No decoder may panic, and whatever one accepts must encode to the very bytes
//! it came from; what a JSON parser accepts must read the same after it is written again. How many inputs each decoder
//! got, and how many it accepted, is printed.

#![allow(clippy::print_stdout, reason = "the counts are the result")]

use serde::Serialize;
use serde::de::DeserializeOwned;
use teleclay_proto::NodeName;
use teleclay_proto::frame::{Gap, HandleFrame, Header, MAX_FRAME, SweepRecord, ToolFrame};
use teleclay_proto::http::{ClayShape, NewSession, Validate, parse};
use teleclay_proto::join::{
    ChallengeReply, ChallengeRequest, ClayDescription, FreshReply, Granted, JoinReply, JoinRequest,
    LeaseRequest, LeaveReply, LoopParameters, SealedJoin, SealedReply,
};
use teleclay_proto::keys::Key;
use teleclay_proto::watch::{
    BRICK_VOXELS, BrickContent, BricksHeader, BricksKind, BricksWriter, ClientText, Message,
    PackedBrick, TelemetryBatch, TelemetrySample, pack, unpack, write_classes,
};

/// Inputs to the binary decoders; each goes to every decoder.
const BINARY_INPUTS: u64 = 10_000_000;

/// Inputs to the text parsers, which are slower.
const TEXT_INPUTS: u64 = 300_000;

/// Inputs to the parsers of joining; each goes to every parser. `TELECLAY_JOIN_INPUTS` asks for more.
const JOIN_INPUTS: u64 = 100_000;

fn join_inputs() -> u64 {
    let asked = std::env::var("TELECLAY_JOIN_INPUTS").ok();
    let asked = asked.map(|count| count.parse().expect("a number of inputs"));
    asked.unwrap_or(JOIN_INPUTS)
}

/// How often each decoder accepted: a fuzzer whose inputs all fall at the first byte tests only that byte.
#[derive(Default)]
struct Accepted {
    handle: u64,
    tool: u64,
    telemetry: u64,
    bricks: u64,
    classes: u64,
    packed: u64,
}

#[test]
fn binary_decoders_survive_anything() {
    let mut random = Random(0x7e1e_c1a4);
    let seeds = binary_seeds();
    let mut accepted = Accepted::default();
    let mut scratch = Scratch::new();
    let mut input = Vec::new();
    for _ in 0..BINARY_INPUTS {
        random.mutate(&seeds, &mut input);
        decode_with_everything(&input, &mut scratch, &mut accepted);
    }
    let Accepted {
        handle,
        tool,
        telemetry,
        bricks,
        classes,
        packed,
    } = accepted;
    println!("fuzz: {BINARY_INPUTS} inputs to each binary decoder, none panicked; accepted");
    println!(
        "  {handle} handle frames, {tool} tool frames, {telemetry} telemetry batches, {bricks} brick messages, {classes} parts of classes, {packed} packed bricks"
    );
    for count in [handle, tool, telemetry, bricks, classes, packed] {
        assert!(
            BINARY_INPUTS / 1000 < count,
            "the inputs hardly reach past this decoder's first checks"
        );
        assert!(
            count < BINARY_INPUTS / 2,
            "the inputs hardly trouble this decoder"
        );
    }
}

#[test]
fn text_parsers_survive_anything() {
    let mut random = Random(0x7e1e_c1a5);
    let seeds = text_seeds();
    let (mut texts, mut keys) = (0, 0);
    let mut input = Vec::new();
    for _ in 0..TEXT_INPUTS {
        random.mutate(&seeds, &mut input);
        let text = String::from_utf8_lossy(&input);
        if let Ok(message) = ClientText::parse(&text) {
            let again = serde_json::to_string(&message).expect("a message prints");
            assert_eq!(ClientText::parse(&again), Ok(message), "{text}");
            texts += 1;
        }
        if let Ok(key) = text.parse::<Key>() {
            assert_eq!(key.to_string(), text);
            keys += 1;
        }
    }
    println!(
        "fuzz: {TEXT_INPUTS} inputs to each text parser, none panicked; accepted {texts} messages, {keys} keys"
    );
    assert!(TEXT_INPUTS / 1000 < texts && TEXT_INPUTS / 1000 < keys);
}

#[test]
fn join_parsers_survive_anything() {
    let mut random = Random(0x7e1e_c1a6);
    let seeds = join_seeds();
    let mut accepted = [0_u64; 10];
    let mut input = Vec::new();
    let inputs = join_inputs();
    for _ in 0..inputs {
        random.mutate(&seeds, &mut input);
        for (count, is_accepted) in accepted.iter_mut().zip([
            survives::<JoinRequest>(&input),
            survives::<JoinReply>(&input),
            survives::<ChallengeRequest>(&input),
            survives::<ChallengeReply>(&input),
            survives::<SealedJoin>(&input),
            survives::<SealedReply>(&input),
            survives::<LeaseRequest>(&input),
            survives::<LeaveReply>(&input),
            survives::<FreshReply>(&input),
            survives::<NewSession>(&input),
        ]) {
            *count += u64::from(is_accepted);
        }
    }
    let [
        join,
        granted,
        challenge,
        given,
        sealed,
        answered,
        lease,
        left,
        fresh,
        session,
    ] = accepted;
    println!("fuzz: {inputs} inputs to each parser of joining, none panicked; accepted");
    println!(
        "  {join} join requests, {granted} replies, {challenge} challenge requests, {given} replies, {sealed} sealed joins, {answered} replies, {lease} lease requests, {left} and {fresh} replies, {session} new sessions"
    );
    assert!(
        accepted
            .iter()
            .all(|count| inputs / 1000 < *count && *count < inputs / 2),
        "the inputs hardly reach past a parser's first checks, or hardly trouble it"
    );
}

/// Whether the parser takes the input; if it does, what it made of it must read the same after it is written again.
fn survives<T>(input: &[u8]) -> bool
where
    T: DeserializeOwned + Serialize + Validate,
{
    let Ok(value) = parse::<T>(input) else {
        return false;
    };
    let written = serde_json::to_string(&value).expect("it prints");
    let again: T = parse(written.as_bytes()).expect("what was accepted is accepted again");
    assert_eq!(
        serde_json::to_string(&again).expect("it prints"),
        written,
        "from {}",
        String::from_utf8_lossy(input)
    );
    true
}

struct Scratch {
    frame: [u8; MAX_FRAME],
    message: Vec<u8>,
    samples: Vec<TelemetrySample>,
    voxels: Box<[u8; BRICK_VOXELS]>,
    repacked: Vec<u8>,
}

impl Scratch {
    fn new() -> Self {
        Self {
            frame: [0; MAX_FRAME],
            message: Vec::new(),
            samples: Vec::new(),
            voxels: Box::new([0; BRICK_VOXELS]),
            repacked: Vec::new(),
        }
    }
}

fn decode_with_everything(input: &[u8], scratch: &mut Scratch, accepted: &mut Accepted) {
    if let Ok(frame) = HandleFrame::decode(input) {
        assert_eq!(frame.encode(&mut scratch.frame), input);
        assert_eq!(frame.sweeps.iter().count(), frame.sweeps.len());
        accepted.handle += 1;
    }
    if let Ok(frame) = ToolFrame::decode(input) {
        assert_eq!(frame.encode(&mut scratch.frame), input);
        accepted.tool += 1;
    }
    match Message::decode(input) {
        Ok(Message::Telemetry(view)) => {
            scratch.samples.clear();
            scratch.samples.extend(view.iter());
            view.batch
                .encode(&scratch.samples, &mut scratch.message)
                .expect("as many as were decoded");
            assert_eq!(scratch.message, input);
            accepted.telemetry += 1;
        }
        Ok(Message::Bricks(view)) => {
            let mut writer = BricksWriter::new(view.header, usize::MAX);
            for brick in view.iter() {
                brick.body.unpack(&mut scratch.voxels);
                writer
                    .push(brick.index, brick.body.into())
                    .expect("a decoded brick lies in the grid");
            }
            match writer.finish().as_slice() {
                [message] => assert_eq!(message, input),
                // Changes of no brick are a message that is read but never written.
                messages => assert!(messages.is_empty() && view.is_empty()),
            }
            accepted.bricks += 1;
        }
        Ok(Message::Classes(view)) => {
            // A part at its offset is what it is, whatever else there is.
            assert!(!view.part.is_empty());
            assert!(u64::from(view.offset) + view.part.len() as u64 <= u64::from(view.total));
            accepted.classes += 1;
        }
        Err(_) => {}
    }
    if let Ok(packed) = PackedBrick::new(input) {
        packed.unpack(&mut scratch.voxels);
        scratch.repacked.clear();
        pack(&scratch.voxels, &mut scratch.repacked);
        let mut again = [0xaa; BRICK_VOXELS];
        unpack(&scratch.repacked, &mut again).expect("what was packed unpacks");
        assert!(again == *scratch.voxels, "packing changed the voxels");
        accepted.packed += 1;
    }
}

fn binary_seeds() -> Vec<Vec<u8>> {
    let mut buffer = [0; MAX_FRAME];
    let mut handle = HandleFrame {
        header: Header {
            sequence: 9,
            ..Header::default()
        },
        ..HandleFrame::default()
    };
    let bare = handle.encode(&mut buffer).to_vec();
    for sequence in 1..=3 {
        handle
            .sweeps
            .push(SweepRecord {
                sequence,
                from: [sequence as i32; 3],
                to: [sequence as i32 + 1; 3],
            })
            .expect("three fit");
    }
    handle
        .relayed_gaps
        .push(Gap {
            missing: 3,
            come: 1,
        })
        .expect("one fits");
    let mut seeds = vec![
        bare,
        handle.encode(&mut buffer).to_vec(),
        ToolFrame::default().encode(&mut buffer).to_vec(),
    ];
    let mut telemetry = Vec::new();
    TelemetryBatch::default()
        .encode(&[TelemetrySample::default(); 2], &mut telemetry)
        .expect("two samples fit");
    seeds.push(telemetry);
    seeds.extend(write_classes(&[7; 60], 3, 1, 50));
    let flat: [u8; BRICK_VOXELS] = std::array::from_fn(|voxel| if voxel < 1800 { 255 } else { 0 });
    for kind in [BricksKind::Delta, BricksKind::Keyframe] {
        let header = BricksHeader {
            bricks_per_axis: [3, 2, 2],
            kind,
            ..BricksHeader::default()
        };
        let mut writer = BricksWriter::new(header, usize::MAX);
        for (index, content) in [
            (0, BrickContent::Full),
            (5, BrickContent::Empty),
            (11, BrickContent::Voxels(&flat)),
        ] {
            writer.push(index, content).expect("the grid has 12 bricks");
        }
        seeds.append(&mut writer.finish());
    }
    let mut packed = Vec::new();
    pack(&flat, &mut packed);
    seeds.push(packed);
    seeds
}

fn text_seeds() -> Vec<Vec<u8>> {
    [
        r#"{"type":"subscribe","telemetry":"on","bricks":"off"}"#,
        r#"{"type":"ping","nonce":12345}"#,
        r#"{"type":"reset","clay":{"shape":{"kind":"block","size_m":[0.1,0.2,0.3]},"material":{"yield_stress_pa":100}}}"#,
        r#"{"type":"reset","clay":{"shape":{"kind":"stepped","edges_m":[0,0.1],"depths_of_cut_m":[0.01]}}}"#,
        r#"{"type":"patch","session":{"scheme":"wave","paused":true,"network":{"up":{"delay_s":0.01,"burst":null}}}}"#,
        "teleclay/lab-1/alive",
        "teleclay/lab-1/session/demo/tool/1/up",
        "teleclay/lab-1/session/demo/operator/4294967295",
    ]
    .map(|text| text.as_bytes().to_vec())
    .to_vec()
}

fn join_seeds() -> Vec<Vec<u8>> {
    let granted = JoinReply::Granted(Box::new(Granted {
        lease: 17,
        ownership_epoch: 1,
        node: NodeName::new("lab-1").expect("a name"),
        tool: 1,
        lease_s: 10.0,
        parameters: LoopParameters::default(),
        clay: ClayDescription {
            shape: ClayShape::stepped(),
            voxel_size_m: 5e-4,
            epoch: 1,
            revision: 0,
        },
        slow_endpoint: Some("tcp/127.0.0.1:7548".to_owned()),
    }));
    let mut seeds = vec![serde_json::to_vec(&granted).expect("it prints")];
    seeds.extend([
        r#"{"protocol":1,"operator":"Ada","device":"simulated"}"#,
        r#"{"protocol":1}"#,
        r#"{"outcome":"given","challenge":"000102030405060708090a0b0c0d0e0f101112131415161718191a1b1c1d1e1f","needs_token":true}"#,
        r#"{"challenge":"000102030405060708090a0b0c0d0e0f101112131415161718191a1b1c1d1e1f","message":"0001feff"}"#,
        r#"{"outcome":"answered","message":"0001feff"}"#,
        r#"{"outcome":"refused","code":"no_free_tool","reason":"all 2 tools are held"}"#,
        r#"{"lease":17}"#,
        r#"{"outcome":"left"}"#,
        r#"{"outcome":"no_such_lease"}"#,
        r#"{"outcome":"fresh","epoch":2}"#,
        r#"{"outcome":"refused","reason":"the session is paused"}"#,
        r#"{"id":"lab","axes":3,"scheme":"wave","tools":2,"tool":{"kind":"blade","width_m":0.01,"height_m":0.04,"thickness_m":0.002}}"#,
    ].map(|text| text.as_bytes().to_vec()));
    seeds
}

/// The generator SplitMix64, so that the same seed gives the same bytes everywhere.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut mixed = self.0;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    }

    fn below(&mut self, limit: usize) -> usize {
        (self.next() % limit.max(1) as u64) as usize
    }

    /// Makes an input of one to four changes to one of the seeds, or one in sixteen times of nothing but noise.
    fn mutate(&mut self, seeds: &[Vec<u8>], input: &mut Vec<u8>) {
        input.clear();
        if self.below(16) == 0 {
            for _ in 0..self.below(300) {
                input.push(self.next() as u8);
            }
            return;
        }
        let seed = self.below(seeds.len());
        input.extend_from_slice(&seeds[seed]);
        for _ in 0..=self.below(4) {
            self.change(seeds, input);
        }
    }

    fn change(&mut self, seeds: &[Vec<u8>], input: &mut Vec<u8>) {
        let at = self.below(input.len());
        match self.below(8) {
            0 => input.truncate(at),
            1 => input.insert(at, self.next() as u8),
            2 if !input.is_empty() => drop(input.remove(at)),
            3 => {
                // The front of this one and the back of another.
                let other = &seeds[self.below(seeds.len())];
                input.truncate(at);
                input.extend_from_slice(&other[at.min(other.len())..]);
            }
            4 => {
                let value = [0, 1, 0x7f, 0x80, 0xff][self.below(5)];
                let end = input.len().min(at + 1 + self.below(8));
                input[at..end].fill(value);
            }
            5 if !input.is_empty() => input[at] ^= 1 << self.below(8),
            _ => {
                if let Some(byte) = input.get_mut(at) {
                    *byte = self.next() as u8;
                }
            }
        }
    }
}
