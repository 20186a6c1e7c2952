//! What is told of the clay of one moment after another is that clay, whichever moment comes next.

use std::collections::BTreeMap;

use teleclay_clay::{BRICK_VOXELS, BrickView, Clay, Pose, Shape, Sweep, ToolShape};
use teleclay_film::bricks::Told;
use teleclay_film::{DONE, Film, MORE, REFUSED};
use teleclay_wire::{BricksKind, BricksView};

const BLOCK: Shape = Shape::Block {
    size_m: [0.064, 0.048, 0.032],
};

fn block(voxel_size_m: f64) -> Clay {
    Clay::new(&BLOCK, voxel_size_m).unwrap()
}

fn cut(clay: &mut Clay, from_m: [f64; 3], to_m: [f64; 3]) {
    let shape = ToolShape::ball(0.006).unwrap();
    let [from, to] = [from_m, to_m].map(|at_m| Pose::quantise(at_m).unwrap());
    assert!(0 < clay.carve(&Sweep { shape, from, to }));
}

/// Whoever reads the messages, and nothing else.
#[derive(Default)]
struct Reader {
    counts: [u16; 3],
    bricks: BTreeMap<u32, Vec<u8>>,
    sequence: u32,
}

impl Reader {
    /// How many bricks there were.
    fn read(&mut self, messages: &[Vec<u8>]) -> usize {
        let mut count = 0;
        for message in messages {
            let view = BricksView::decode(message).unwrap();
            assert_eq!(view.header.sequence, self.sequence);
            self.sequence += 1;
            if view.header.kind == BricksKind::Keyframe {
                self.bricks.clear();
                self.counts = view.header.bricks_per_axis;
            }
            assert_eq!(view.header.bricks_per_axis, self.counts);
            for brick in view.iter() {
                let mut voxels = [0; BRICK_VOXELS];
                brick.body.unpack(&mut voxels);
                self.bricks.insert(brick.index, voxels.to_vec());
                count += 1;
            }
        }
        count
    }

    fn assert_has(&self, clay: &Clay) {
        assert_eq!(self.counts, clay.grid().bricks());
        for dense in 0..clay.grid().brick_count() as u32 {
            let wanted = match clay.brick(clay.grid().brick_index(dense).unwrap()) {
                BrickView::Empty => vec![0; BRICK_VOXELS],
                BrickView::Full => vec![255; BRICK_VOXELS],
                BrickView::Voxels(voxels) => voxels.to_vec(),
            };
            let got = self.bricks.get(&dense);
            let got = got.cloned().unwrap_or_else(|| vec![0; BRICK_VOXELS]);
            assert!(got == wanted, "brick {dense}");
        }
    }
}

#[test]
fn moments_in_any_order_are_told_by_what_differs() {
    let mut early = block(1e-3);
    let mut later = early.clone();
    cut(&mut later, [0.01, 0.01, 0.032], [0.03, 0.01, 0.03]);
    let mut last = later.clone();
    // Bricks that are gone altogether.
    for y in 0..13 {
        let y_m = 0.004 * f64::from(y);
        cut(&mut last, [0.001, y_m, 0.026], [0.063, y_m, 0.026]);
        cut(&mut last, [0.001, y_m, 0.018], [0.063, y_m, 0.018]);
    }
    let (mut told, mut reader) = (Told::default(), Reader::default());
    let bricks = early.grid().brick_count();
    assert_eq!(reader.read(&told.tell(&mut early, 1).unwrap()), bricks);
    reader.assert_has(&early);
    let count = reader.read(&told.tell(&mut later, 1).unwrap());
    assert!(0 < count && count <= 6, "{count} bricks of one cut");
    reader.assert_has(&later);
    assert!(told.tell(&mut later, 1).unwrap().is_empty());
    let mut moments = [last, early, later];
    for at in [0, 1, 0, 2] {
        let clay = &mut moments[at];
        reader.read(&told.tell(clay, 1).unwrap());
        reader.assert_has(clay);
    }
    // Another grid is told anew.
    let mut finer = block(5e-4);
    reader.read(&told.tell(&mut finer, 2).unwrap());
    reader.assert_has(&finer);
}

#[test]
fn a_call_that_fails_says_why_and_one_that_is_early_finds_nothing() {
    let mut film = Film::default();
    assert_eq!((film.seek(1.0), film.tell_clay()), (DONE, DONE));
    assert_eq!(film.next_bricks(), DONE);
    film.tell_moment();
    assert!(film.text().contains(r#""clay":null"#), "{}", film.text());
    film.find_envelope(1, 0, 0.0, 1.0, 10);
    assert!(film.envelope().is_empty());
    let no_recording = b"solid teapot\n";
    film.resize_bytes_in(no_recording.len());
    film.bytes_in().copy_from_slice(no_recording);
    assert_eq!(film.push(), REFUSED);
    assert_eq!(film.text(), "this is no MCAP file: it begins otherwise");
    assert_ne!(film.seek(2.0), MORE);
}
