//! Files that were right before something happened to them: every reader comes to an end, and takes no more memory than
//! it says it may.
//!
//! One process for these tests, since they measure what the whole of it holds.

#![allow(unsafe_code, reason = "a global allocator cannot be written without")]

mod archive;
mod shapes;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::collections::BTreeMap;

use teleclay_mesh::threemf::{self, read_3mf};
use teleclay_mesh::{MeshError, Placement, TriangleMesh, fill, read_stl, stl};

use archive::{MODEL, Part, archive, package, parts};
use shapes::{Numbers, Parts, ball, cuboid, grid, tetrahedron, torus};

/// Mutations of each kind of file.
const MUTATIONS: usize = 120_000;
/// What a reader may take besides, bytes: its state, and the words of an error.
const SPARE_BYTES: usize = 64 << 10;

thread_local! {
    /// What is held by a thread that counts, and the most that it held.
    static HELD: Cell<Option<(usize, usize)>> = const { Cell::new(None) };
}

struct Counting;

fn count(taken: usize, given: usize) {
    // A thread that is about to end counts nothing.
    let _ = HELD.try_with(|held| {
        held.set(held.get().map(|(now, most)| {
            // What was taken before counting began may be given back.
            let now = (now + taken).saturating_sub(given);
            (now, most.max(now))
        }));
    });
}

// SAFETY: every call goes to the system's allocator as it came; counting touches no memory of the caller's.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size(), 0);
        // SAFETY: the caller keeps `alloc`'s contract, which is the same one.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(layout.size(), 0);
        // SAFETY: the caller keeps `alloc_zeroed`'s contract, which is the same one.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count(0, layout.size());
        // SAFETY: the pointer came from `alloc` above, so from the system's allocator with this layout.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// What `work` comes to, and the most memory that it held at a time, bytes.
fn measured<T>(work: impl FnOnce() -> T) -> (T, usize) {
    HELD.set(Some((0, 0)));
    let result = work();
    let (_, most) = HELD.take().unwrap();
    (result, most)
}

/// Something happens to a file, once or a few times.
fn mutate(bytes: &mut Vec<u8>, numbers: &mut Numbers) {
    const WORDS: [&[u8]; 12] = [
        &[0xff, 0xff, 0xff, 0xff],
        &[0, 0, 0x80, 0x7f],
        &[0, 0, 0xc0, 0x7f],
        &[0, 0, 0, 0x80],
        b"nan",
        b"1e308",
        b"-",
        b"endsolid",
        b"/>",
        b"<object id=\"1\">",
        b"\"",
        b"PK\x05\x06",
    ];
    for _ in 0..1 + numbers.below(4) {
        let length = bytes.len();
        let at = numbers.below(length);
        let end = (at + 1 + numbers.below(40)).min(length);
        match numbers.below(8) {
            0 | 1 if at < length => bytes[at] ^= 1 << numbers.below(8),
            2 if at < length => bytes[at] = numbers.next() as u8,
            3 => drop(bytes.drain(at..end)),
            4 => {
                let again = bytes[at..end].to_vec();
                bytes.splice(at..at, again);
            }
            5 => {
                let word = WORDS[numbers.below(WORDS.len())];
                let over = (at + word.len()).min(length);
                bytes.splice(at..over, word.iter().copied());
            }
            6 => {
                let word = WORDS[numbers.below(WORDS.len())];
                bytes.splice(at..at, word.iter().copied());
            }
            _ => bytes.truncate(at),
        }
    }
}

/// How often each kind of thing came of it.
#[derive(Debug, Default)]
struct Outcomes(BTreeMap<&'static str, usize>);

impl Outcomes {
    /// Counts it, and makes clay of what is a mesh still.
    fn note(&mut self, read: &Result<TriangleMesh, MeshError>) {
        let kind = match read {
            Ok(mesh) => {
                let clay = fill(mesh, &grid([9, 5, 7]), Placement::Fitted);
                assert!(matches!(clay, Ok(_) | Err(MeshError::Empty)), "{clay:?}");
                "mesh"
            }
            Err(MeshError::Empty) => "empty",
            Err(MeshError::Open { open_edges }) => {
                assert!(0 < *open_edges);
                "open"
            }
            Err(MeshError::OutOfRange { .. }) => "out of range",
            Err(MeshError::Malformed { problem, .. }) => {
                assert!(problem.len() < 400, "{problem}");
                "malformed"
            }
            Err(MeshError::SelfContradicting { said, found, .. }) => {
                assert_ne!(said, found);
                "self-contradicting"
            }
            Err(MeshError::TooMuch { got, most, .. }) => {
                assert!(most < got);
                "too much"
            }
            Err(other) => panic!("a reader knows no block: {other}"),
        };
        *self.0.entry(kind).or_default() += 1;
    }

    /// Each of these came up often enough for the loop to mean something.
    fn assert_has(&self, kinds: &[&str]) {
        for kind in kinds {
            let count = self.0.get(kind).copied().unwrap_or_default();
            assert!(MUTATIONS / 1000 < count, "{kind}: {self:?}");
        }
    }
}

#[test]
fn binary_stl_that_something_happened_to_ends_within_its_memory() {
    let whole = [cuboid([0.0; 3], [0.01; 3]), ball(0.01, 1)].map(|parts| parts.binary_stl());
    let mut numbers = Numbers(11);
    let mut outcomes = Outcomes::default();
    for case in 0..MUTATIONS {
        let mut bytes = whole[case % 2].clone();
        mutate(&mut bytes, &mut numbers);
        // Half of them keep a count that is so, or nothing else would ever be looked at.
        if case / 2 % 2 == 0 && 84 <= bytes.len() {
            let count = (bytes.len() - 84) / 50;
            bytes.truncate(84 + 50 * count);
            bytes[80..84].copy_from_slice(&(count as u32).to_le_bytes());
        }
        let (read, held) = measured(|| read_stl(&bytes));
        assert!(held <= stl::MEMORY_PER_BYTE * bytes.len() + SPARE_BYTES);
        outcomes.note(&read);
    }
    outcomes.assert_has(&["mesh", "open", "out of range", "self-contradicting"]);
}

#[test]
fn text_stl_that_something_happened_to_ends_within_its_memory() {
    let whole = [
        cuboid([0.0; 3], [0.01; 3]).text_stl(),
        tetrahedron([0.01; 3]).text_stl(),
    ];
    let mut numbers = Numbers(12);
    let mut outcomes = Outcomes::default();
    for case in 0..MUTATIONS {
        let mut bytes = whole[case % 2].clone().into_bytes();
        mutate(&mut bytes, &mut numbers);
        let (read, held) = measured(|| read_stl(&bytes));
        assert!(held <= stl::MEMORY_PER_BYTE * bytes.len() + SPARE_BYTES);
        outcomes.note(&read);
    }
    outcomes.assert_has(&["mesh", "open", "malformed"]);
}

fn mesh_text(parts: &Parts) -> String {
    let mut text = String::from("<mesh><vertices>");
    for [x, y, z] in &parts.vertices_m {
        text += &format!(r#"<vertex x="{x}" y="{y}" z="{z}"/>"#);
    }
    text += "</vertices><triangles>";
    for [a, b, c] in &parts.triangles {
        text += &format!(r#"<triangle v1="{a}" v2="{b}" v3="{c}"/>"#);
    }
    text + "</triangles></mesh>"
}

fn model_text(object: &str, placed: usize) -> String {
    let item = r#"<item objectid="2" transform="1 0 0 0 1 0 0 0 1 3 4 5"/>"#;
    format!(
        r#"<?xml version="1.0"?><model unit="inch" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">
        <resources><object id="1">{object}</object><object id="2"><components><component objectid="1"/>
        </components></object></resources><build>{}</build></model>"#,
        item.repeat(placed)
    )
}

#[test]
fn models_that_something_happened_to_end_within_their_memory() {
    let object = mesh_text(&tetrahedron([2.0; 3]));
    let whole = model_text(&object, 2);
    let mut numbers = Numbers(13);
    let mut outcomes = Outcomes::default();
    for _ in 0..MUTATIONS {
        let mut bytes = whole.clone().into_bytes();
        mutate(&mut bytes, &mut numbers);
        let mut with = parts("");
        with[2] = Part::stored(MODEL, &bytes);
        let unpacked = with[1].said_bytes as usize + bytes.len();
        let package = archive(&with);
        let (read, held) = measured(|| read_3mf(&package));
        // Twice four triangles, and what could be doubled of them.
        let most = threemf::MEMORY_PER_BYTE * unpacked + 16 * threemf::MEMORY_PER_TRIANGLE;
        assert!(held <= most + SPARE_BYTES, "{held}");
        outcomes.note(&read);
    }
    outcomes.assert_has(&["mesh", "open", "malformed", "self-contradicting"]);
}

#[test]
fn archives_that_something_happened_to_end_within_their_memory() {
    let model = model_text(&mesh_text(&tetrahedron([2.0; 3])), 2);
    let relationships = parts(&model)[1].clone();
    let whole = [
        package(&model),
        archive(&[relationships, Part::stored(MODEL, model.as_bytes())]),
    ];
    let mut numbers = Numbers(14);
    let mut outcomes = Outcomes::default();
    for case in 0..MUTATIONS {
        let mut bytes = whole[case % 2].clone();
        mutate(&mut bytes, &mut numbers);
        let (read, held) = measured(|| read_3mf(&bytes));
        // Where a size is a lie, as much is taken as could be there.
        let unpacked = (1032 * bytes.len()).min(threemf::MOST_UNPACKED_BYTES);
        assert!(held <= 2 * unpacked + SPARE_BYTES, "{held}");
        outcomes.note(&read);
    }
    outcomes.assert_has(&["mesh", "malformed", "self-contradicting"]);
}

/// What the bounds are for: files so large that nothing else counts.
#[test]
fn large_files_take_no_more_memory_than_is_said() {
    // No vertex twice, which is the worst: everything is kept, and then found to be open.
    let mut numbers = Numbers(15);
    let mut soup = Parts::default();
    for triangle in 0..40_000 {
        for _ in 0..3 {
            soup.vertices_m.push([0; 3].map(|_| numbers.share()));
        }
        soup.triangles
            .push([0, 1, 2].map(|corner| 3 * triangle + corner));
    }
    let ring = torus(0.1, 0.04, 200, 100);
    for bytes in [
        soup.binary_stl(),
        ring.binary_stl(),
        soup.clone()
            .moved(|at| at.map(f64::round))
            .text_stl()
            .into_bytes(),
        ring.text_stl().into_bytes(),
    ] {
        let (_, held) = measured(|| read_stl(&bytes));
        let per_byte = held as f64 / bytes.len() as f64;
        assert!(per_byte <= stl::MEMORY_PER_BYTE as f64, "{per_byte}");
    }
    let short = soup.clone().moved(|at| at.map(f64::round));
    for (parts, placed) in [
        (&soup, 1),
        (&short, 1),
        (&ring, 1),
        (&ring, 10),
        (&soup, 10),
    ] {
        let model = model_text(&mesh_text(parts), placed);
        let package = package(&model);
        let (_, held) = measured(|| read_3mf(&package));
        let built = parts.triangles.len() * placed;
        let most = threemf::MEMORY_PER_BYTE * model.len() + threemf::MEMORY_PER_TRIANGLE * built;
        assert!(held <= most + SPARE_BYTES, "{held} {most}");
    }
}
