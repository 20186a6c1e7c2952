//! Binary messages: what is written is what is read, for any values.

use proptest::array::uniform3;
use proptest::collection::vec;
use proptest::prelude::*;
use teleclay_proto::frame::{
    CopyState, Corrections, Engagement, Gap, Gaps, HandleFrame, Header, LoopStatus, MAX_FRAME,
    MAX_GAPS, MAX_SWEEPS, NoGap, SWEEP_BYTES, SweepRecord, SweepRefusal, Sweeps, SweepsFull,
    ToolFrame,
};
use teleclay_proto::watch::{
    BRICK_VOXELS, BrickBody, BrickContent, BricksHeader, BricksKind, BricksView, BricksWriter,
    MAX_PACKED, MAX_SAMPLES, Message, TelemetryBatch, TelemetrySample, TelemetryView,
    TooManySamples, pack, renumber, unpack,
};
use teleclay_proto::{FrameError, Scheme, is_after};

fn any_header() -> impl Strategy<Value = Header> {
    let numbers = (any::<[u32; 6]>(), any::<[u64; 2]>(), 0..Scheme::ALL.len());
    numbers.prop_map(
        |(
            [
                lease,
                sequence,
                echo_hold_ns,
                clay_epoch,
                ownership_epoch,
                revision,
            ],
            [sent_ns, echo_ns],
            scheme,
        )| {
            Header {
                lease,
                sequence,
                sent_ns,
                echo_ns,
                echo_hold_ns,
                scheme: Scheme::ALL[scheme],
                revision,
                clay_epoch,
                ownership_epoch,
            }
        },
    )
}

/// A list of sweeps as a tool makes them, and the list that was pushed: mostly each goes on from the last by a little,
/// but it leaps, and numbers are missing.
fn any_list() -> impl Strategy<Value = (Sweeps, Vec<SweepRecord>)> {
    let step = prop_oneof![
        4 => any::<[i16; 3]>().prop_map(|step| step.map(i32::from)),
        1 => any::<[i32; 3]>(),
    ];
    let next = prop_oneof![
        6 => Just(None),
        1 => any::<(u32, [i32; 3])>().prop_map(Some),
    ];
    let start = any::<(u32, u32, [i32; 3])>();
    (start, vec((next, step), 0..=2 * MAX_SWEEPS)).prop_map(|((oldest, first, at), steps)| {
        let mut sweeps = Sweeps::new(oldest);
        let mut pushed = Vec::new();
        let (mut sequence, mut at) = (first, at);
        for (leap, step) in steps {
            (sequence, at) = leap.unwrap_or((sequence.wrapping_add(1), at));
            let to = std::array::from_fn(|axis| at[axis].wrapping_add(step[axis]));
            let sweep = SweepRecord {
                sequence,
                from: at,
                to,
            };
            let needed = sweep.bytes_after(pushed.last());
            match sweeps.push(sweep) {
                Ok(()) => pushed.push(sweep),
                Err(SweepsFull) => {
                    assert!(SWEEP_BYTES < sweeps.bytes() + needed);
                    break;
                }
            }
            at = to;
        }
        (sweeps, pushed)
    })
}

fn any_sweeps() -> impl Strategy<Value = Sweeps> {
    any_list().prop_map(|(sweeps, _)| sweeps)
}

fn any_gaps() -> impl Strategy<Value = Gaps> {
    vec((1..=u16::MAX, 1..=u16::MAX), 0..=MAX_GAPS).prop_map(|pairs| {
        let mut gaps = Gaps::default();
        for (missing, come) in pairs {
            gaps.push(Gap { missing, come }).expect("no more than fit");
        }
        gaps
    })
}

/// Any bits at all: infinities, subnormals and every NaN.
fn any_vectors<const N: usize>() -> impl Strategy<Value = [[f64; 3]; N]> {
    proptest::array::uniform::<_, N>(uniform3(any::<u64>().prop_map(f64::from_bits)))
}

fn any_handle_frame() -> impl Strategy<Value = HandleFrame> {
    let engagement = 0..Engagement::ALL.len();
    let copy = (0..CopyState::ALL.len(), any::<u32>(), any_gaps());
    (
        any_header(),
        engagement,
        any_vectors::<7>(),
        any::<u64>(),
        copy,
        any_corrections(),
        any_sweeps(),
    )
        .prop_map(
            |(
                header,
                engagement,
                vectors,
                clay_hash,
                (copy, relayed_acknowledged, relayed_gaps),
                corrections,
                sweeps,
            )| {
                let [
                    position_m,
                    velocity_m_s,
                    hand_force_n,
                    felt_force_n,
                    wave,
                    wave_integral,
                    energy_in_j,
                ] = vectors;
                HandleFrame {
                    header,
                    engagement: Engagement::ALL[engagement],
                    position_m,
                    velocity_m_s,
                    hand_force_n,
                    felt_force_n,
                    wave,
                    wave_integral,
                    energy_in_j,
                    clay_hash,
                    relayed_acknowledged,
                    relayed_gaps,
                    copy: CopyState::ALL[copy],
                    corrections,
                    sweeps,
                }
            },
        )
}

fn any_corrections() -> impl Strategy<Value = Corrections> {
    (any::<[u32; 6]>(), any::<u64>(), any::<u32>()).prop_map(|(bits, moved, count)| {
        let [x, y, z, largest_step_n, injected_j, tank_j] = bits.map(f32::from_bits);
        Corrections {
            moved_n: f64::from_bits(moved),
            held_n: [x, y, z],
            largest_step_n,
            injected_j,
            tank_j,
            count,
        }
    })
}

fn any_tool_frame() -> impl Strategy<Value = ToolFrame> {
    let words = (0..LoopStatus::ALL.len(), 0..SweepRefusal::ALL.len());
    (
        any_header(),
        words,
        any_vectors::<6>(),
        any::<[u64; 2]>(),
        (any::<([u32; 3], u8)>(), any_gaps()),
        any_sweeps(),
    )
        .prop_map(
            |(
                header,
                (status, refusal),
                vectors,
                [area, clay_hash],
                (([sweeps_acknowledged, sweeps_refused, sweeps_durable], epochs_kept), sweep_gaps),
                relayed,
            )| {
                let [
                    position_m,
                    velocity_m_s,
                    force_n,
                    wave,
                    wave_integral,
                    energy_in_j,
                ] = vectors;
                ToolFrame {
                    header,
                    status: LoopStatus::ALL[status],
                    refusal: SweepRefusal::ALL[refusal],
                    position_m,
                    velocity_m_s,
                    force_n,
                    wave,
                    wave_integral,
                    energy_in_j,
                    engaged_area_m2: f64::from_bits(area),
                    sweeps_acknowledged,
                    sweeps_durable,
                    epochs_kept,
                    sweep_gaps,
                    sweeps_refused,
                    clay_hash,
                    relayed,
                }
            },
        )
}

fn any_sample() -> impl Strategy<Value = TelemetrySample> {
    let vectors = proptest::array::uniform7(uniform3(-1e6_f32..1e6));
    let scalars = proptest::array::uniform6(-1e6_f32..1e6);
    (vectors, scalars).prop_map(
        |(
            vectors,
            [
                energy_handle_j,
                energy_tool_j,
                rtt_s,
                correction_step_n,
                correction_held_n,
                age_s,
            ],
        )| {
            let [
                hand_force_n,
                felt_force_n,
                tool_force_n,
                handle_position_m,
                tool_position_m,
                handle_velocity_m_s,
                tool_velocity_m_s,
            ] = vectors;
            TelemetrySample {
                hand_force_n,
                felt_force_n,
                tool_force_n,
                handle_position_m,
                tool_position_m,
                handle_velocity_m_s,
                tool_velocity_m_s,
                energy_handle_j,
                energy_tool_j,
                rtt_s,
                correction_step_n,
                correction_held_n,
                age_s,
            }
        },
    )
}

/// Bricks as clay makes them: runs of a few occupancies, from one voxel long to all of them.
fn any_brick() -> impl Strategy<Value = Box<[u8; BRICK_VOXELS]>> {
    vec(
        (1..400_usize, prop_oneof![Just(0), Just(255), any::<u8>()]),
        1..300,
    )
    .prop_map(|runs| {
        let mut voxels = Box::new([0; BRICK_VOXELS]);
        let mut values = runs
            .iter()
            .cycle()
            .flat_map(|&(length, value)| std::iter::repeat_n(value, length));
        voxels.fill_with(|| values.next().expect("the runs go round"));
        voxels
    })
}

proptest! {
    /// What is pushed is what is read, here and at the other end, and a list that was read can be added to.
    #[test]
    fn lists_of_sweeps((sweeps, pushed) in any_list()) {
        prop_assert!(sweeps.iter().eq(pushed.iter().copied()));
        prop_assert_eq!(sweeps.len(), pushed.len());
        let before = std::iter::once(None).chain(pushed.iter().map(Some));
        let bytes: usize = pushed.iter().zip(before).map(|(sweep, before)| sweep.bytes_after(before)).sum();
        prop_assert_eq!(sweeps.bytes(), bytes);
        let frame = HandleFrame { sweeps, ..HandleFrame::default() };
        let mut buffer = [0xaa; MAX_FRAME];
        let mut decoded = HandleFrame::decode(frame.encode(&mut buffer)).expect("it was encoded");
        prop_assert!(decoded.sweeps.iter().eq(pushed.iter().copied()));
        prop_assert_eq!(decoded.sweeps.len(), pushed.len());
        let more = SweepRecord {
            sequence: pushed.last().map_or(7, |last| last.sequence.wrapping_add(1)),
            from: pushed.last().map_or([0; 3], |last| last.to),
            to: [5; 3],
        };
        if decoded.sweeps.push(more).is_ok() {
            let twice = HandleFrame::decode(decoded.encode(&mut buffer)).expect("it was encoded");
            prop_assert!(twice.sweeps.iter().eq(pushed.into_iter().chain([more])));
        }
    }

    #[test]
    fn handle_frames(frame in any_handle_frame()) {
        let mut buffer = [0xaa; MAX_FRAME];
        let bytes = frame.encode(&mut buffer).to_vec();
        prop_assert_eq!(bytes.len(), 276 + frame.sweeps.bytes() + 4 * frame.relayed_gaps.as_slice().len());
        let decoded = HandleFrame::decode(&bytes).expect("it was encoded");
        // NaN is not equal to itself, so the bytes are compared, and field by field what a swap would show in.
        prop_assert_eq!(decoded.encode(&mut buffer), bytes);
        prop_assert_eq!(decoded.header, frame.header);
        prop_assert_eq!(decoded.engagement, frame.engagement);
        prop_assert_eq!(decoded.clay_hash, frame.clay_hash);
        prop_assert_eq!(&decoded.sweeps, &frame.sweeps);
        prop_assert_eq!(&decoded.relayed_gaps, &frame.relayed_gaps);
        prop_assert_eq!(decoded.sweeps.iter().count(), frame.sweeps.len());
    }

    #[test]
    fn tool_frames(frame in any_tool_frame()) {
        let mut buffer = [0xaa; MAX_FRAME];
        let bytes = frame.encode(&mut buffer).to_vec();
        prop_assert_eq!(bytes.len(), 232 + frame.relayed.bytes() + 4 * frame.sweep_gaps.as_slice().len());
        let decoded = ToolFrame::decode(&bytes).expect("it was encoded");
        prop_assert_eq!(decoded.encode(&mut buffer), bytes);
        prop_assert_eq!(decoded.header, frame.header);
        prop_assert_eq!((decoded.status, decoded.refusal), (frame.status, frame.refusal));
        prop_assert_eq!(decoded.sweeps_acknowledged, frame.sweeps_acknowledged);
        prop_assert_eq!(decoded.sweeps_durable, frame.sweeps_durable);
        prop_assert_eq!(decoded.epochs_kept, frame.epochs_kept);
        prop_assert_eq!(decoded.sweep_gaps, frame.sweep_gaps);
        prop_assert_eq!(decoded.sweeps_refused, frame.sweeps_refused);
    }

    /// A frame that lost its end, at whatever byte, is never taken for a shorter one.
    #[test]
    fn no_front_of_a_frame_is_a_frame(frame in any_handle_frame(), cut in 0.0..1.0) {
        let mut buffer = [0; MAX_FRAME];
        let bytes = frame.encode(&mut buffer);
        let front = &bytes[..(cut * bytes.len() as f64) as usize];
        let error = HandleFrame::decode(front).expect_err("the end is missing");
        let is_short = matches!(error, FrameError::TooShort { got, need } if got == front.len() && got < need);
        prop_assert!(is_short, "{error}");
    }

    #[test]
    fn telemetry(
        numbers: [u32; 4],
        first_time_s in -1e9..1e9,
        samples in vec(any_sample(), 0..40),
    ) {
        let [sequence, tool, period_us, dropped] = numbers;
        let batch = TelemetryBatch { sequence, tool, period_us, dropped, first_time_s };
        let mut message = Vec::new();
        batch.encode(&samples, &mut message).expect("few samples");
        prop_assert_eq!(message.len(), 32 + 108 * samples.len());
        let view = TelemetryView::decode(&message).expect("it was encoded");
        prop_assert_eq!(view.batch, batch);
        prop_assert_eq!(view.len(), samples.len());
        prop_assert_eq!(view.iter().collect::<Vec<_>>(), samples);
    }

    #[test]
    fn packed_bricks(voxels in any_brick()) {
        let mut packed = b"before".to_vec();
        pack(&voxels, &mut packed);
        prop_assert_eq!(&packed[..6], b"before");
        let packed = &packed[6..];
        prop_assert!(packed.len() <= MAX_PACKED);
        let mut again = Box::new([0xaa; BRICK_VOXELS]);
        unpack(packed, &mut again).expect("it was packed");
        prop_assert!(again == voxels);
    }

    /// Residuals of one and zero in any pattern: what is hardest on the longest a packing may get.
    #[test]
    fn packed_patterns_keep_to_the_bound(pattern in vec(1..200_usize, 2..40)) {
        let mut voxels = [0_u8; BRICK_VOXELS];
        let runs = pattern.iter().cycle().enumerate();
        let residuals = runs.flat_map(|(run, &length)| std::iter::repeat_n(run as u8 % 2, length));
        for (voxel, residual) in residuals.take(BRICK_VOXELS).enumerate() {
            let before = if voxel < 16 { 0 } else { voxels[voxel - 16] };
            voxels[voxel] = residual.wrapping_add(before);
        }
        let mut packed = Vec::new();
        pack(&voxels, &mut packed);
        prop_assert!(packed.len() <= MAX_PACKED, "{} bytes", packed.len());
        let mut again = [0xaa; BRICK_VOXELS];
        unpack(&packed, &mut again).expect("it was packed");
        prop_assert!(again == voxels);
    }

    /// However the writer splits, the parts together hold every brick once, in order, and only the first says "forget".
    #[test]
    fn bricks_in_parts(
        bricks in vec((0..600_u32, proptest::option::of(any_brick())), 0..40),
        longest in 0..20_000_usize,
        sequence: u32,
        is_keyframe: bool,
    ) {
        let kind = if is_keyframe { BricksKind::Keyframe } else { BricksKind::Delta };
        let header = BricksHeader {
            sequence, clay_epoch: 9, bricks_per_axis: [10, 10, 6], kind, voxel_size_m: 5e-4,
        };
        let mut writer = BricksWriter::new(header, longest);
        for (index, voxels) in &bricks {
            let content = voxels.as_ref().map_or(BrickContent::Full, |voxels| BrickContent::Voxels(voxels));
            writer.push(*index, content).expect("the grid has 600 bricks");
        }
        let messages = writer.finish();
        prop_assert_eq!(messages.is_empty(), bricks.is_empty() && !is_keyframe);
        let mut told = Vec::new();
        for (part, message) in messages.iter().enumerate() {
            let view = BricksView::decode(message).expect("it was encoded");
            let kind = if part == 0 { kind } else { BricksKind::Delta };
            let sequence = sequence.wrapping_add(part as u32);
            prop_assert_eq!(view.header, BricksHeader { sequence, kind, ..header });
            prop_assert!(message.len() <= longest || view.len() <= 1, "{} bytes", message.len());
            prop_assert!(!view.is_empty() || bricks.is_empty(), "a part that tells nothing");
            for brick in view.iter() {
                let mut voxels = Box::new([0xaa; BRICK_VOXELS]);
                brick.body.unpack(&mut voxels);
                told.push((brick.index, voxels));
            }
        }
        let full = || Box::new([255; BRICK_VOXELS]);
        let wanted: Vec<_> =
            bricks.into_iter().map(|(index, voxels)| (index, voxels.unwrap_or_else(full))).collect();
        prop_assert!(told == wanted);
    }

    #[test]
    fn a_message_takes_another_number(old: u32, new: u32) {
        let mut message = Vec::new();
        let batch = TelemetryBatch { sequence: old, tool: 3, ..TelemetryBatch::default() };
        batch.encode(&[], &mut message).expect("no samples");
        renumber(&mut message, new).expect("it is a message");
        let view = TelemetryView::decode(&message).expect("it still is one");
        prop_assert_eq!(view.batch, TelemetryBatch { sequence: new, ..batch });
    }

    /// The order is that of the numbers before they wrapped.
    #[test]
    fn wrapped_numbers_keep_their_order(start: u64, ahead in 1..1_u64 << 31) {
        let (before, after) = (start as u32, start.wrapping_add(ahead) as u32);
        prop_assert!(is_after(after, before));
        prop_assert!(!is_after(before, after));
    }
}

#[test]
fn a_tool_that_goes_on_finds_room_for_130_sweeps_and_one_that_leaps_for_25() {
    let filled = |from_of: fn(i32) -> [i32; 3]| {
        let mut sweeps = Sweeps::default();
        assert_eq!((sweeps.len(), sweeps.bytes(), sweeps.last()), (0, 0, None));
        for k in 0.. {
            let from = from_of(k);
            let sweep = SweepRecord {
                sequence: k as u32,
                from,
                to: from.map(|coordinate| coordinate + 7),
            };
            if sweeps.push(sweep) == Err(SweepsFull) {
                assert!(sweeps.iter().map(|sweep| sweep.sequence).eq(0..k as u32));
                assert_eq!(
                    sweeps.last().map(|sweep| sweep.sequence),
                    Some(k as u32 - 1)
                );
                return sweeps;
            }
        }
        unreachable!("it has a bound");
    };
    let mut sweeps = filled(|k| [7 * k; 3]);
    assert_eq!(sweeps.len(), MAX_SWEEPS);
    assert_eq!(MAX_SWEEPS, 130);
    assert_eq!(filled(|k| [8 * k; 3]).len(), 800 / 26);
    sweeps.clear();
    assert!(sweeps.is_empty());
    // What is no longer in the list does not make two lists differ, nor reach the wire.
    assert_eq!(sweeps, Sweeps::default());
    let mut buffer = [0; MAX_FRAME];
    let frame = HandleFrame {
        sweeps,
        ..HandleFrame::default()
    };
    assert_eq!(frame.encode(&mut buffer).len(), 276);
}

#[test]
fn gaps_say_which_numbers_have_come() {
    let mut gaps = Gaps::default();
    for (missing, come) in [(1, 2), (3, 1), (2, 4)] {
        gaps.push(Gap { missing, come }).expect("it is one");
    }
    let come: Vec<[u32; 2]> = gaps.come_after(10).collect();
    assert_eq!(come, [[12, 13], [17, 17], [20, 23]]);
    let wrapped: Vec<[u32; 2]> = gaps.come_after(u32::MAX - 1).collect();
    assert_eq!(wrapped[0], [0, 1]);
    for (missing, come) in [(0, 1), (1, 0)] {
        assert_eq!(gaps.push(Gap { missing, come }), Err(NoGap));
    }
    let one = Gap {
        missing: 1,
        come: 1,
    };
    while gaps.push(one).is_ok() {}
    assert_eq!(gaps.as_slice().len(), MAX_GAPS);
    gaps.clear();
    assert_eq!(gaps, Gaps::default());
}

#[test]
fn the_longest_frame_fills_the_buffer() {
    let mut frame = HandleFrame::default();
    let sweep = |sequence, width: i32| SweepRecord {
        sequence,
        from: [0; 3],
        to: [width; 3],
    };
    // A run of two long steps and 29 short ones leave no byte.
    frame.sweeps.push(sweep(1, 0x8000)).expect("it fits");
    for sequence in (10..).step_by(2) {
        if frame.sweeps.push(sweep(sequence, 1)).is_err() {
            break;
        }
    }
    let one = Gap {
        missing: 1,
        come: 1,
    };
    while frame.relayed_gaps.push(one).is_ok() {}
    let left = SWEEP_BYTES - frame.sweeps.bytes();
    assert_eq!(frame.encode(&mut [0; MAX_FRAME]).len(), MAX_FRAME - left);
    assert_eq!(MAX_FRAME, 1140);
}

#[test]
fn a_batch_of_too_many_samples_is_not_written() {
    let mut message = b"as it was".to_vec();
    let samples = vec![TelemetrySample::default(); MAX_SAMPLES + 1];
    let batch = TelemetryBatch::default();
    assert_eq!(
        batch.encode(&samples, &mut message),
        Err(TooManySamples {
            got: MAX_SAMPLES + 1
        })
    );
    assert_eq!(message, b"as it was");
    batch
        .encode(&samples[1..], &mut message)
        .expect("as many as fit");
    assert!(message.len() <= 256 * 1024);
    assert_eq!(
        TelemetryView::decode(&message)
            .expect("it was encoded")
            .len(),
        MAX_SAMPLES
    );
}

#[test]
fn bricks_of_one_value_are_told_in_a_word() {
    let header = BricksHeader {
        bricks_per_axis: [2, 1, 1],
        ..BricksHeader::default()
    };
    let mut writer = BricksWriter::new(header, usize::MAX);
    writer
        .push(0, BrickContent::Voxels(&[0; BRICK_VOXELS]))
        .expect("it lies in the grid");
    writer
        .push(1, BrickContent::Voxels(&[255; BRICK_VOXELS]))
        .expect("it lies in the grid");
    let outside = FrameError::BrickOutsideGrid {
        index: 2,
        bricks: 2,
    };
    assert_eq!(writer.push(2, BrickContent::Full), Err(outside));
    let messages = writer.finish();
    let Message::Bricks(view) = Message::decode(&messages[0]).expect("it was encoded") else {
        panic!("a message of bricks");
    };
    let bodies: Vec<_> = view.iter().map(|brick| brick.body).collect();
    assert_eq!(bodies, [BrickBody::Empty, BrickBody::Full]);
}

#[test]
fn what_is_no_message_keeps_its_number() {
    let mut frame = [0; MAX_FRAME];
    ToolFrame::default().encode(&mut frame);
    let before = frame;
    assert!(renumber(&mut frame, 7).is_err());
    assert!(renumber(&mut [], 7).is_err());
    assert_eq!(frame, before);
}
