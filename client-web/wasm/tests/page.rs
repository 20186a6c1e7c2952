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

/// JavaScript numbers buffers as they stand here.
#[test]
fn buffers_have_the_numbers_that_javascript_gives_them() {
    let all = [
        Buffer::BytesIn,
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
    assert_eq!(Buffer::numbered(7), None);
}
