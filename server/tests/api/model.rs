//! The clay as a file, and as the session tells of it.

use std::collections::HashMap;
use std::io::{Read as _, Write as _};
use std::net::TcpStream;

use serde_json::json;
use teleclay_proto::http::{ClayShape, ClayState, Session};

use crate::rig::{eventually, shared};
use crate::wire::Site;

/// The triangles of a binary STL, mm.
fn triangles(file: &[u8]) -> Vec<[[f32; 3]; 3]> {
    assert!(!file.starts_with(b"solid"), "that would be the text form");
    let count = u32::from_le_bytes(file[80..84].try_into().unwrap()) as usize;
    assert_eq!(file.len(), 84 + 50 * count);
    let number = |at: usize| f32::from_le_bytes(file[at..at + 4].try_into().unwrap());
    (0..count)
        .map(|index| {
            let corner = |corner: usize| {
                let at = 84 + 50 * index + 12 * (corner + 1);
                [number(at), number(at + 4), number(at + 8)]
            };
            [corner(0), corner(1), corner(2)]
        })
        .collect()
}

/// Volume within a closed surface, by the divergence theorem, mm³.
fn volume(triangles: &[[[f32; 3]; 3]]) -> f64 {
    let six_fold: f64 = triangles
        .iter()
        .map(|triangle| {
            let [a, b, c] = triangle.map(|corner| corner.map(f64::from));
            a[0] * (b[1] * c[2] - b[2] * c[1])
                + a[1] * (b[2] * c[0] - b[0] * c[2])
                + a[2] * (b[0] * c[1] - b[1] * c[0])
        })
        .sum();
    six_fold / 6.0
}

#[test]
fn the_model_is_closed_and_as_large_as_the_clay() {
    let rig = shared();
    let site = rig.site();
    let id = rig.session(&site);
    let path = format!("/api/v1/sessions/{id}");
    let stepped = json!({
        "kind": "stepped", "edges_m": [0.01, 0.02, 0.03], "depths_of_cut_m": [0.01, 0.02], "base_m": 0.01, "width_m": 0.02,
    });
    let session: Session = site
        .post(&format!("{path}/clay/reset"), &json!({ "shape": stepped }))
        .json();
    let answer = site.get(&format!("{path}/clay.stl"));
    assert_eq!(answer.status, 200);
    assert_eq!(answer.header("content-type"), Some("model/stl"));
    let disposition = format!("attachment; filename=\"{id}.stl\"");
    assert_eq!(answer.header("content-disposition"), Some(&*disposition));
    assert_eq!(
        answer.header("content-length"),
        Some(&*answer.body.len().to_string())
    );

    let triangles = triangles(&answer.body);
    let mut edges: HashMap<[[u32; 3]; 2], usize> = HashMap::new();
    for triangle in &triangles {
        let corners = triangle.map(|corner| corner.map(f32::to_bits));
        for (from, to) in [(0, 1), (1, 2), (2, 0)] {
            *edges.entry([corners[from], corners[to]]).or_default() += 1;
        }
    }
    for ([from, to], passed) in &edges {
        let back = edges.get(&[*to, *from]);
        assert_eq!((*passed, back), (1, Some(&1)), "an edge has two triangles");
    }
    let got_m3 = volume(&triangles) * 1e-9;
    let want_m3 = session.clay.remaining_volume_m3;
    assert!(
        (got_m3 / want_m3 - 1.0).abs() < 2e-3,
        "{got_m3} m3, wanted {want_m3} m3"
    );
    // The file says its volume, for whoever measures.
    let header = std::str::from_utf8(&answer.body[..80]).unwrap();
    let words: Vec<_> = header.split_whitespace().collect();
    let [.., "encloses", said, "mm3"] = words[..] else {
        panic!("{header}");
    };
    assert!((said.parse::<f64>().unwrap() * 1e-9 / got_m3 - 1.0).abs() < 1e-5);
    site.delete(&path);
}

/// Asks for a model, and reads no further than the first line of the answer.
fn begin(site: &Site, path: &str) -> (TcpStream, String) {
    let mut stream = site.connect();
    let ask = format!(
        "GET {path} HTTP/1.1\r\nHost: {}\r\nConnection: close\r\n\r\n",
        site.address
    );
    stream.write_all(ask.as_bytes()).unwrap();
    let mut line = [0; 12];
    stream.read_exact(&mut line).unwrap();
    (stream, String::from_utf8_lossy(&line).into_owned())
}

#[test]
fn only_so_many_models_are_on_their_way_at_once() {
    let rig = shared();
    let site = rig.site();
    let id = rig.session(&site);
    let path = format!("/api/v1/sessions/{id}");
    // So large that no connection holds it.
    let large = json!({ "shape": { "kind": "block", "size_m": [0.512, 0.512, 0.032] } });
    assert_eq!(site.post(&format!("{path}/clay/reset"), &large).status, 200);
    let path_of_model = format!("{path}/clay.stl");
    let (first, line) = begin(&site, &path_of_model);
    assert_eq!(line, "HTTP/1.1 200");
    let (_second, line) = begin(&site, &path_of_model);
    assert_eq!(line, "HTTP/1.1 200");
    let refusal = site.get(&path_of_model);
    assert_eq!((refusal.status, &*refusal.word()), (503, "busy"));
    drop(first);
    eventually("a place is free again", || {
        begin(&site, &path_of_model).1 == "HTTP/1.1 200"
    });
    site.delete(&path);
}

/// Two people put fresh blocks of different sizes, over and over, while a third looks: every answer tells of one block,
/// whole, and whoever put one is answered with that one.
#[test]
fn fresh_blocks_that_are_put_at_once_are_never_mixed_up() {
    const BLOCKS: u32 = 20;
    let rig = shared();
    let site = rig.site();
    let id = rig.session(&site);
    let path = format!("/api/v1/sessions/{id}");
    let volume_of = |clay: &ClayState| clay.shape.size_m().iter().product::<f64>();
    let is_one_block = |clay: &ClayState| {
        let off = clay.initial_volume_m3 / volume_of(clay) - 1.0;
        off.abs() < 1e-9 && clay.removed_units == 0
    };
    let put = |edge_m: f64| {
        for _ in 0..BLOCKS {
            let block = json!({ "shape": { "kind": "block", "size_m": [edge_m, edge_m, edge_m] } });
            let put: Session = site.post(&format!("{path}/clay/reset"), &block).json();
            let shape = ClayShape::Block {
                size_m: [edge_m; 3],
            };
            assert_eq!(put.clay.shape, shape);
            assert!(is_one_block(&put.clay), "{:?}", put.clay);
        }
    };
    let looks = std::thread::scope(|scope| {
        let both = [0.016, 0.032].map(|edge_m| scope.spawn(move || put(edge_m)));
        let (mut looks, mut epoch) = (0, 0);
        while both.iter().any(|one| !one.is_finished()) {
            let clay = site.get(&path).json::<Session>().clay;
            assert!(is_one_block(&clay), "{clay:?}");
            assert!(epoch <= clay.epoch, "{epoch} was over");
            (epoch, looks) = (clay.epoch, looks + 1);
        }
        looks
    });
    println!("{looks} looks at {} blocks", 2 * BLOCKS);
    assert!(BLOCKS < looks, "hardly looked");
    let last = site.get(&path).json::<Session>().clay;
    assert_eq!(last.epoch, 1 + 2 * BLOCKS);
    site.delete(&path);
}

/// A session is deleted while a large block for it is being made: whoever asked for that is told that the session is
/// gone, and is not shown one.
#[test]
fn a_change_of_a_session_that_is_deleted_meanwhile_is_refused() {
    let rig = shared();
    let site = rig.site();
    let id = rig.session(&site);
    let path = format!("/api/v1/sessions/{id}");
    let large = json!({ "shape": { "kind": "block", "size_m": [0.256, 0.256, 0.128] } });
    std::thread::scope(|scope| {
        let changing = scope.spawn(|| site.post(&format!("{path}/clay/reset"), &large));
        assert_eq!(site.delete(&path).status, 204);
        let answer = changing.join().unwrap();
        assert_eq!(answer.status, 404, "{answer:?}");
    });
}
