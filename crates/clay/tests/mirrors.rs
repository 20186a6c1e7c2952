//! A watcher that is fed changed bricks ends up with the same clay, and what it is fed can be checked.

use std::cell::Cell;

use proptest::prelude::*;
use teleclay_clay::{
    BRICK_VOXELS, Blade, BladeDimensions, BrickIndex, BrickView, Clay, Pose, ReplaceError, Shape,
    Sweep, ToolShape,
};

const SHAPE: Shape = Shape::Block {
    size_m: [0.050, 0.040, 0.036],
};

fn clay() -> Clay {
    Clay::new(&SHAPE, 1e-3).unwrap()
}

/// Anything from a scratch to the end of the block.
fn tool() -> impl Strategy<Value = ToolShape> {
    let ball = |radius_m| ToolShape::ball(radius_m).unwrap();
    prop_oneof![
        6 => (0.001..0.012).prop_map(ball),
        1 => (0.012..0.035).prop_map(ball),
        3 => (0.002..0.012, 0.002..0.020, 0.002..0.006).prop_map(|(width_m, height_m, thickness_m)| {
            let dimensions = BladeDimensions { width_m, height_m, thickness_m };
            ToolShape::Blade(Blade::new(dimensions).unwrap())
        }),
    ]
}

fn sweeps() -> impl Strategy<Value = Vec<Sweep>> {
    let place = || [-0.01..0.06, -0.01..0.05, -0.01..0.045];
    let sweep = (tool(), place(), place(), 0.0..1.0_f64).prop_map(|(shape, from, to, share)| {
        // Long ways and, by squaring, short ones.
        let to = std::array::from_fn(|axis| from[axis] + (to[axis] - from[axis]) * share * share);
        Sweep {
            shape,
            from: Pose::quantise(from).unwrap(),
            to: Pose::quantise(to).unwrap(),
        }
    });
    prop::collection::vec(sweep, 1..8)
}

fn cut_by(sweeps: &[&[Sweep]]) -> Clay {
    let mut clay = clay();
    for sweep in sweeps.iter().copied().flatten() {
        clay.carve(sweep);
    }
    clay
}

fn all_bricks(clay: &Clay) -> impl Iterator<Item = BrickIndex> + use<> {
    let grid = *clay.grid();
    (0..grid.brick_count() as u32).map(move |dense| grid.brick_index(dense).unwrap())
}

fn assert_same(a: &mut Clay, b: &mut Clay) {
    for index in all_bricks(a) {
        assert_eq!(a.brick(index), b.brick(index));
        assert_eq!(a.brick_hash(index), b.brick_hash(index));
    }
    assert_eq!(a.remaining_units(), b.remaining_units());
    assert_eq!(a.hash(), b.hash());
}

fn voxels_of(view: BrickView<'_>) -> [u8; BRICK_VOXELS] {
    match view {
        BrickView::Empty => [0; BRICK_VOXELS],
        BrickView::Full => [255; BRICK_VOXELS],
        BrickView::Voxels(voxels) => *voxels,
    }
}

proptest! {
    /// However little is drained at a time, the mirror converges, every brick arrives once per change at most, and
    /// counts and hashes agree.
    #[test]
    fn a_mirror_converges(sweeps in sweeps(), most in 1_usize..6) {
        let (mut original, mut mirror) = (clay(), clay());
        for sweep in &sweeps {
            original.carve(sweep);
            let waiting = original.changed_count();
            let drained = original.drain_changed(most, |index, view| {
                assert!(mirror.replace_brick(index, view).unwrap());
            });
            prop_assert_eq!(drained, most.min(waiting));
            prop_assert_eq!(original.changed_count(), waiting - drained);
        }
        original.drain_changed(usize::MAX, |index, view| {
            mirror.replace_brick(index, view).unwrap();
        });
        assert_same(&mut original, &mut mirror);
    }

    /// Revisions name exactly the bricks whose content differs from before.
    #[test]
    fn revisions_tell_what_changed(sweeps in sweeps()) {
        let mut clay = clay();
        for sweep in &sweeps {
            let before = clay.clone();
            let revision = clay.revision();
            let removed = clay.carve(sweep);
            prop_assert_eq!(clay.revision(), revision + u64::from(0 < removed));
            let changed: Vec<_> = clay.changed_after(revision).collect();
            for index in all_bricks(&clay) {
                let differs = clay.brick(index) != before.brick(index);
                prop_assert_eq!(changed.contains(&index), differs);
                let expected = if differs { clay.revision() } else { before.brick_revision(index) };
                prop_assert_eq!(clay.brick_revision(index), expected);
            }
        }
    }

    /// Hashes kept up to date in parts equal those of a clay that is hashed once, and of one that got there in one
    /// piece.
    #[test]
    fn hashes_do_not_remember_how(sweeps in sweeps(), most in 1_usize..4) {
        let (mut in_parts, mut at_once) = (clay(), clay());
        for sweep in &sweeps {
            in_parts.carve(sweep);
            in_parts.refresh_hashes(most);
            at_once.carve(sweep);
        }
        let mut fed = clay();
        for index in all_bricks(&fed) {
            fed.replace_brick(index, at_once.brick(index)).unwrap();
        }
        prop_assert_eq!(at_once.hash(), in_parts.hash());
        prop_assert_eq!(at_once.hash(), fed.hash());
        if 0 < at_once.removed_units() {
            prop_assert_ne!(at_once.hash(), clay().hash());
        }
    }

    /// A copy that takes the original's bricks, whatever it was itself, and then cuts what the original had not seen of
    /// its own cuts, holds the cuts of both: this is how a replica takes in a snapshot.
    #[test]
    fn a_snapshot_and_the_sweeps_it_lacks_make_the_whole(common in sweeps(), own in sweeps(), others in sweeps(), only_changed in any::<bool>()) {
        let mut copy = cut_by(&[&common, &own]);
        let mut original = cut_by(&[&common]);
        let revision = original.revision();
        for sweep in &others {
            original.carve(sweep);
        }
        let bricks: Vec<_> = if only_changed {
            original.changed_after(revision).collect()
        } else {
            all_bricks(&original).collect()
        };
        for index in bricks {
            copy.replace_brick(index, original.brick(index)).unwrap();
        }
        for sweep in &own {
            copy.carve(sweep);
        }
        let mut whole = cut_by(&[&own, &others, &common]);
        prop_assert_eq!(copy.removed_units(), whole.removed_units());
        assert_same(&mut copy, &mut whole);
    }

    /// The lesser of two clays, voxel by voxel, is the clay that saw the cuts of both.
    #[test]
    fn the_lesser_of_two_clays_holds_the_cuts_of_both(first in sweeps(), second in sweeps()) {
        let (one, other) = (cut_by(&[&first]), cut_by(&[&second]));
        let mut merged = clay();
        for index in all_bricks(&merged) {
            let (one, other) = (voxels_of(one.brick(index)), voxels_of(other.brick(index)));
            let lesser = std::array::from_fn(|at| one[at].min(other[at]));
            merged.replace_brick(index, BrickView::Voxels(&lesser)).unwrap();
        }
        assert_same(&mut merged, &mut cut_by(&[&first, &second]));
        assert_same(&mut merged, &mut cut_by(&[&second, &first]));
    }

    /// Clay put back where a tool has been is cut again by the same tool: nothing remembered about the place survives.
    #[test]
    fn healed_clay_is_cut_again(radius_m in 0.003..0.010) {
        let shape = ToolShape::ball(radius_m).unwrap();
        let at = |x_m: f64| Pose::quantise([x_m, 0.02, 0.02]).unwrap();
        let stroke = |clay: &mut Clay, from: i32, to: i32| {
            (from..to).map(|step| {
                let at = |step: i32| at(f64::from(step) * 2e-4);
                clay.carve(&Sweep { shape, from: at(step), to: at(step + 1) })
            }).sum::<u64>()
        };
        let (mut healed, fresh) = (clay(), clay());
        stroke(&mut healed, 0, 100);
        for index in all_bricks(&fresh) {
            healed.replace_brick(index, fresh.brick(index)).unwrap();
        }
        prop_assert_eq!(healed.removed_units(), 0);
        let mut unhealed = clay();
        // The first sweep after healing starts where the tool stands, in clay.
        let again = stroke(&mut healed, 100, 140);
        prop_assert_eq!(again, stroke(&mut unhealed, 100, 140));
        prop_assert_eq!(healed.hash(), unhealed.hash());
    }
}

#[test]
fn a_busy_brick_does_not_hold_up_the_others() {
    let mut clay = clay();
    let bore = |y_m: f64| Sweep {
        shape: ToolShape::ball(0.003).unwrap(),
        from: Pose::quantise([0.0, y_m, 0.018]).unwrap(),
        to: Pose::quantise([0.05, y_m, 0.018]).unwrap(),
    };
    clay.carve(&bore(0.02));
    let waiting = clay.changed_count();
    let seen = Cell::new(0);
    for round in 0..waiting {
        // Scratches the first brick in every round.
        let corner = Pose::quantise([1e-4 * round as f64, 0.002, 0.002]).unwrap();
        clay.carve(&Sweep {
            shape: ToolShape::ball(0.002).unwrap(),
            from: corner,
            to: corner,
        });
        clay.drain_changed(1, |index, _| {
            if index.as_u32() != 0 {
                seen.set(seen.get() + 1);
            }
        });
    }
    assert!(waiting - 1 <= seen.get(), "{} of {waiting}", seen.get());
}

#[test]
fn what_cannot_be_is_refused_and_changes_nothing() {
    let mut clay = clay();
    let hash = clay.hash();
    // The last brick along x reaches past the block's 50 voxels.
    let last = clay.grid().brick_at([3, 0, 0]).unwrap();
    assert_eq!(clay.grid().brick_extent(last), [2, 16, 16]);
    assert_eq!(
        clay.replace_brick(last, BrickView::Full),
        Err(ReplaceError::OutsideGrid {
            brick: last.as_u32(),
            voxel: 2
        })
    );
    let mut voxels = [0; BRICK_VOXELS];
    voxels[16 + 5] = 1;
    assert_eq!(
        clay.replace_brick(last, BrickView::Voxels(&voxels)),
        Err(ReplaceError::OutsideGrid {
            brick: last.as_u32(),
            voxel: 21
        })
    );
    assert_eq!(clay.hash(), hash);

    // A block with a hole in its shape cannot be filled beyond what it began with.
    let partly = Shape::Block {
        size_m: [0.0165, 0.016, 0.016],
    };
    let mut partly = Clay::new(&partly, 1e-3).unwrap();
    let edge = partly.grid().brick_at([1, 0, 0]).unwrap();
    let BrickView::Voxels(fresh) = partly.brick(edge) else {
        panic!("half voxels are neither full nor empty");
    };
    let mut more = *fresh;
    more[0] += 1;
    let initial_units = partly.initial_units();
    assert_eq!(
        partly.replace_brick(edge, BrickView::Voxels(&more)),
        Err(ReplaceError::MoreThanInitial {
            brick: edge.as_u32(),
            got_units: initial_units + 1,
            initial_units
        })
    );
}

#[test]
fn a_clone_goes_its_own_way() {
    let mut original = clay();
    let sweep = Sweep {
        shape: ToolShape::ball(0.006).unwrap(),
        from: Pose::quantise([0.0, 0.02, 0.02]).unwrap(),
        to: Pose::quantise([0.03, 0.02, 0.02]).unwrap(),
    };
    original.carve(&sweep);
    let mut copy = original.clone();
    assert_same(&mut original, &mut copy);
    let onwards = Sweep {
        from: sweep.to,
        to: Pose::quantise([0.05, 0.01, 0.0]).unwrap(),
        ..sweep
    };
    let removed = copy.carve(&onwards);
    assert!(0 < removed);
    assert_ne!(original.hash(), copy.hash());
    assert_eq!(original.carve(&onwards), removed);
    assert_same(&mut original, &mut copy);
}

#[test]
fn different_grids_have_different_hashes() {
    let fine = Shape::Block { size_m: [0.02; 3] };
    let coarse = Shape::Block { size_m: [0.04; 3] };
    let (mut fine, mut coarse) = (
        Clay::new(&fine, 1e-3).unwrap(),
        Clay::new(&coarse, 2e-3).unwrap(),
    );
    assert_eq!(fine.initial_units(), coarse.initial_units());
    assert_ne!(fine.hash(), coarse.hash());
}
