//! The calls of a page, as JavaScript makes them: by numbers and buffers.

use teleclay_page::{Buffer, DONE, NO_BRICK, Page, REFUSED, REGRIDDED};
use teleclay_wire::{BRICK_VOXELS, BrickContent, BricksHeader, BricksKind, BricksWriter};

fn message(
    kind: BricksKind,
    bricks_per_axis: [u16; 3],
    bricks: &[(u32, BrickContent<'_>)],
) -> Vec<u8> {
    let header = BricksHeader {
        sequence: 1,
        clay_epoch: 7,
        bricks_per_axis,
        kind,
        voxel_size_m: 5e-4,
    };
    let mut writer = BricksWriter::new(header, usize::MAX);
    for (index, content) in bricks {
        writer.push(*index, *content).unwrap();
    }
    writer.finish().concat()
}

fn take_in(page: &mut Page, message: &[u8]) -> u32 {
    page.resize_bytes_in(message.len());
    page.bytes_in().copy_from_slice(message);
    page.take_in_bricks()
}

fn described(page: &mut Page) -> Vec<f64> {
    page.describe_clay();
    page.numbers().to_vec()
}

/// Finds every mesh that is out of date; the bricks, and their triangles in all.
fn mesh_all(page: &mut Page) -> (Vec<u32>, usize) {
    let (mut bricks, mut triangles) = (Vec::new(), 0);
    loop {
        let index = page.mesh_next_brick();
        if index == NO_BRICK {
            return (bricks, triangles);
        }
        assert_eq!(page.length(Buffer::Coarse), 64);
        let vertices = page.length(Buffer::Positions) / 3;
        assert_eq!(page.length(Buffer::Facing), 4 * vertices);
        triangles += page.length(Buffer::Indices) / 3;
        bricks.push(index);
    }
}

fn all_full(count: u32) -> Vec<(u32, BrickContent<'static>)> {
    (0..count)
        .map(|index| (index, BrickContent::Full))
        .collect()
}

#[test]
fn bricks_in_meshes_out() {
    let mut page = Page::default();
    let whole = message(BricksKind::Keyframe, [3, 2, 2], &all_full(12));
    assert_eq!(take_in(&mut page, &whole), REGRIDDED);
    assert_eq!(
        described(&mut page),
        [7.0, f64::from(5e-4_f32), 3.0, 2.0, 2.0, 12.0]
    );
    let (bricks, triangles) = mesh_all(&mut page);
    assert_eq!(bricks, (0..12).collect::<Vec<_>>());
    assert!(1000 < triangles, "{triangles}");
    assert_eq!(take_in(&mut page, &whole), DONE);
    assert_eq!(mesh_all(&mut page).0.len(), 12);

    // A hole in the middle of a brick is seen by that brick alone.
    let mut voxels = [255; BRICK_VOXELS];
    voxels[8 + 16 * (8 + 16 * 8)] = 0;
    let hole = [(4, BrickContent::Voxels(&voxels))];
    assert_eq!(
        take_in(&mut page, &message(BricksKind::Delta, [3, 2, 2], &hole)),
        DONE
    );
    assert_eq!(mesh_all(&mut page).0, [4]);
    page.mark_all_bricks();
    assert_eq!(described(&mut page)[5..], [12.0]);
}

#[test]
fn another_grid_is_said_to_be_one_and_a_delta_of_it_forgets_what_was() {
    let mut page = Page::default();
    take_in(
        &mut page,
        &message(BricksKind::Keyframe, [2, 2, 2], &all_full(8)),
    );
    let air = [(11, BrickContent::Empty)];
    let delta = message(BricksKind::Delta, [2, 2, 3], &air);
    assert_eq!(take_in(&mut page, &delta), REGRIDDED);
    assert_eq!(mesh_all(&mut page), ((0..12).collect(), 0));
}

#[test]
fn half_the_detail_is_a_grid_of_half_the_bricks() {
    let mut page = Page::default();
    page.halve_clay();
    let whole = message(BricksKind::Keyframe, [3, 2, 2], &all_full(12));
    assert_eq!(take_in(&mut page, &whole), REGRIDDED);
    assert_eq!(
        described(&mut page)[1..],
        [f64::from(1e-3_f32), 2.0, 1.0, 1.0, 2.0]
    );
    let (bricks, _) = mesh_all(&mut page);
    assert_eq!(bricks, [0, 1]);
    // The block is 24 coarse voxels long: it ends in the middle of the second brick.
    let highest_x = page
        .mesh()
        .positions
        .iter()
        .step_by(3)
        .copied()
        .fold(0.0, f32::max);
    assert!((highest_x - 24.0).abs() < 1e-6, "{highest_x}");
    // The brick at (2, 1, 1) is the eighth at (0, 1, 1) of the second one.
    let gone = [(11, BrickContent::Empty)];
    assert_eq!(
        take_in(&mut page, &message(BricksKind::Delta, [3, 2, 2], &gone)),
        DONE
    );
    mesh_all(&mut page);
    let places = page.mesh().positions.as_chunks::<3>().0;
    assert!(
        !places
            .iter()
            .any(|[x, y, z]| 17.0 < *x && 8.5 < *y && 8.5 < *z)
    );
    assert!(
        places
            .iter()
            .any(|[x, y, z]| 17.0 < *x && *y < 7.5 && 8.5 < *z)
    );
}

#[test]
fn what_is_no_message_is_refused_with_a_reason_and_changes_nothing() {
    let mut page = Page::default();
    take_in(
        &mut page,
        &message(BricksKind::Keyframe, [1, 1, 1], &all_full(1)),
    );
    let before = described(&mut page);
    let short = &message(BricksKind::Keyframe, [2, 1, 1], &all_full(2))[..40];
    assert_eq!(take_in(&mut page, short), REFUSED);
    assert_eq!(page.refusal(), "message has 40 bytes, its layout needs 41");
    let large = message(BricksKind::Keyframe, [65, 1, 1], &[]);
    assert_eq!(take_in(&mut page, &large), REFUSED);
    assert_eq!(
        page.refusal(),
        "65 bricks along axis 0, a grid has at most 64"
    );
    assert_eq!(page.length(Buffer::Refusal), page.refusal().len());
    assert_eq!(described(&mut page), before);
}

fn ask(page: &mut Page, numbers: &[f64], call: impl FnOnce(&mut Page) -> u32) -> u32 {
    page.resize_numbers_in(numbers.len());
    page.numbers_in().copy_from_slice(numbers);
    call(page)
}

/// The paper's handle along x, (35) and (37), in clay of 20 N·s/m.
const LOOP: [f64; 22] = [
    2.0, 18.0, 1.0, 4.0, 0.005, 0.4, 18.0, 1.0, 1.0, 1.0, 3.0, 1.0, 10.0, 0.0, 3.0, 0.25, 2.0, 6.0,
    1.0, -1.0, 20.0, 0.0,
];

/// Its delay margin is 146.58 ms with position forward and force back, at 11.4 rad/s; with force exchange it has none.
#[test]
fn a_loop_is_calm_below_its_margin_and_grows_above_it() {
    let mut page = Page::default();
    assert_eq!(ask(&mut page, &LOOP, Page::set_loop), DONE);
    assert_eq!(page.find_outlook(0, 0.146), DONE);
    let [peak, rate, ..] = page
        .numbers()
        .try_into()
        .map(|found: [f64; 4]| found)
        .unwrap();
    assert!(1.0 < peak && rate.is_nan(), "{:?}", page.numbers());
    assert_eq!(page.find_outlook(0, 0.16), DONE);
    let [again, rate, frequency_hz, gain]: [f64; 4] = page.numbers().try_into().unwrap();
    assert!((again - peak).abs() < 1e-12, "a delay only turns the gain");
    assert!(0.01 < rate && 1.0 < frequency_hz && frequency_hz < 5.0 && 1.0 < gain);
    assert_eq!(page.find_outlook(1, 10.0), DONE);
    assert!(page.numbers()[0] < 1.0 && page.numbers()[1].is_nan());
}

/// At rest nothing of `E` is left and `H` is the arm's spring; far up the servo rolls off.
#[test]
fn a_curve_is_three_lists_of_one_length() {
    let mut page = Page::default();
    ask(&mut page, &LOOP, Page::set_loop);
    assert_eq!(page.find_curve(0, 0.2), DONE);
    let numbers = page.numbers();
    let [omega_rad_s, re, im] = [0, 1, 2].map(|list| {
        let length = numbers.len() / 3;
        &numbers[list * length..(list + 1) * length]
    });
    assert!(omega_rad_s.windows(2).all(|pair| pair[0] < pair[1]));
    let last = re.len() - 1;
    // E / (1 + H) is B_t s / 6 for the slowest swings: 20 j 0.01 / 6.
    assert!(
        re[0].abs() < 0.01 && (im[0] - 0.2 / 6.0).abs() < 0.001,
        "{}, {}",
        re[0],
        im[0]
    );
    assert!(re[last].hypot(im[last]) < 1e-3);
}

#[test]
fn numbers_that_describe_nothing_are_refused() {
    let mut page = Page::default();
    assert_eq!(page.find_curve(0, 0.1), REFUSED);
    assert_eq!(page.refusal(), "there is no loop to look at");
    for numbers in [
        &LOOP[..21],
        &[LOOP.as_slice(), &[0.0]].concat(),
        &[f64::NAN],
        &[1e300],
        &[],
    ] {
        assert_eq!(
            ask(&mut page, numbers, Page::set_loop),
            REFUSED,
            "{numbers:?}"
        );
    }
    let mut backwards = LOOP;
    backwards[19] = 1.0;
    assert_eq!(ask(&mut page, &backwards, Page::set_loop), REFUSED);
    assert!(page.refusal().contains("force ratio"), "{}", page.refusal());
    assert_eq!(ask(&mut page, &LOOP, Page::set_loop), DONE);
    for round_trip_s in [-0.1, f64::NAN, f64::INFINITY] {
        assert_eq!(page.find_outlook(0, round_trip_s), REFUSED);
    }
    assert_eq!(page.find_outlook(2, 0.1), REFUSED);
    // A loop that is refused leaves the one before.
    ask(&mut page, &[], Page::set_loop);
    assert_eq!(page.find_outlook(0, 0.1), DONE);
}

#[test]
fn arms_are_told_one_after_the_other_also_where_one_does_not_reach() {
    let mut page = Page::default();
    let robot = [0.12, 0.04, 0.1, 0.2, 0.0, 120.0, 240.0];
    let at = |position_m: [f64; 3]| [robot.as_slice(), &position_m, &[-1.0; 3]].concat();
    assert_eq!(ask(&mut page, &at([0.0, 0.0, 0.17]), Page::find_arms), DONE);
    let arms = page.numbers().as_chunks::<13>().0.to_vec();
    assert_eq!(arms.len(), 3);
    for (j, arm) in arms.iter().enumerate() {
        let [
            ex,
            ey,
            sx,
            sy,
            sz,
            wx,
            wy,
            wz,
            reaches,
            joint_rad,
            bx,
            by,
            bz,
        ] = *arm;
        let angle_rad = (120.0 * j as f64).to_radians();
        assert!((ex - angle_rad.cos()).hypot(ey - angle_rad.sin()) < 1e-12);
        assert!((sx - 0.12 * ex).hypot(sy - 0.12 * ey).hypot(sz) < 1e-12);
        assert!((wx - 0.04 * ex).hypot(wy - 0.04 * ey).hypot(wz - 0.17) < 1e-12);
        assert!(reaches > 0.5);
        // In the middle of its axis the robot bends alike on all sides, elbows outwards.
        assert!((joint_rad - arms[0][9]).abs() < 1e-12 && 0.12 < bx.hypot(by));
        assert!(((bx - wx).hypot(by - wy).hypot(bz - wz) - 0.2).abs() < 1e-12);
    }
    assert_eq!(ask(&mut page, &at([0.3, 0.0, 0.1]), Page::find_arms), DONE);
    let reaches: Vec<f64> = page.numbers().iter().skip(8).step_by(13).copied().collect();
    assert_eq!(reaches, [1.0, 0.0, 0.0]);
    let mut flat = at([0.0, 0.0, 0.17]);
    flat[2] = 0.0;
    assert_eq!(ask(&mut page, &flat, Page::find_arms), REFUSED);
    assert!(
        page.refusal().contains("upper_link_m"),
        "{}",
        page.refusal()
    );
}

/// JavaScript numbers buffers as they stand here.
#[test]
fn buffers_have_the_numbers_that_javascript_gives_them() {
    let all = [
        Buffer::BytesIn,
        Buffer::NumbersIn,
        Buffer::Numbers,
        Buffer::Refusal,
        Buffer::Positions,
        Buffer::Facing,
        Buffer::Indices,
        Buffer::Coarse,
    ];
    for (number, buffer) in all.into_iter().enumerate() {
        assert_eq!(Buffer::numbered(number as u32), Some(buffer));
    }
    assert_eq!(Buffer::numbered(8), None);
}
