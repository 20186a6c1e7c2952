//! A mesh or a volume as clay, and what is no such mesh or volume.

use serde_json::json;
use teleclay_proto::http::Session;

use crate::rig::shared;
use crate::wire::{Answer, Ask, Site};

/// The twelve triangles of a box, its lower corner at the origin, in a binary STL's millimetres.
fn box_of(edges_mm: [f32; 3]) -> Vec<[[f32; 3]; 3]> {
    let corner = |bits: usize| -> [f32; 3] {
        std::array::from_fn(|axis| {
            if bits >> axis & 1 == 1 {
                edges_mm[axis]
            } else {
                0.0
            }
        })
    };
    // Each face as a loop of corners that is passed with the clay on its left, seen from outside.
    let faces = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let halves = faces
        .iter()
        .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]);
    halves.map(|half| half.map(corner)).collect()
}

fn stl(triangles: &[[[f32; 3]; 3]]) -> Vec<u8> {
    let mut file = vec![b' '; 80];
    file.extend((triangles.len() as u32).to_le_bytes());
    for triangle in triangles {
        file.extend([0; 12]);
        for corner in triangle {
            corner
                .iter()
                .for_each(|number| file.extend(number.to_le_bytes()));
        }
        file.extend([0; 2]);
    }
    file
}

fn put(site: &Site, session: &str, query: &str, media_type: &str, body: &[u8]) -> Answer {
    let path = format!("/api/v1/sessions/{session}/clay{query}");
    let ask = Ask::new("PUT", &path).with("Content-Type", media_type);
    site.send(
        &ask.with("Content-Length", &body.len().to_string())
            .body(body),
    )
}

#[test]
fn a_closed_mesh_becomes_the_block_under_a_new_epoch() {
    let site = shared().site();
    let id = shared().session(&site);
    let as_it_is = stl(&box_of([20.0, 30.0, 10.0]));
    let session: Session = put(&site, &id, "", "model/stl", &as_it_is).json();
    assert_eq!(session.clay.epoch, 2);
    assert_eq!(session.clay.removed_units, 0, "nothing of it was cut");
    let volume_m3 = session.clay.initial_volume_m3;
    assert!((volume_m3 / 6e-6 - 1.0).abs() < 1e-3, "{volume_m3} m3");

    // Scaled into 64 x 64 x 32 mm: 2 x 3 x 1 are 42.67 x 64 x 21.33.
    let session: Session = put(&site, &id, "?fit=true", "model/stl", &as_it_is).json();
    let fitted_m3 = 6e-6 * (64.0_f64 / 30.0).powi(3);
    let volume_m3 = session.clay.initial_volume_m3;
    assert!((volume_m3 / fitted_m3 - 1.0).abs() < 1e-3, "{volume_m3} m3");
    assert_eq!(session.clay.epoch, 3);

    // What leaves as a file comes back as the same clay, in either format.
    let file = site.get(&format!("/api/v1/sessions/{id}/clay.3mf"));
    assert_eq!(file.header("content-type"), Some("model/3mf"));
    let again: Session = put(&site, &id, "", "model/3mf", &file.body).json();
    let ratio = again.clay.initial_volume_m3 / volume_m3;
    assert!((ratio - 1.0).abs() < 2e-3, "{ratio}");
    let file = site.get(&format!("/api/v1/sessions/{id}/clay.glb"));
    assert_eq!(file.header("content-type"), Some("model/gltf-binary"));
    assert!(file.body.starts_with(b"glTF\x02\0\0\0"));
    assert_eq!(file.body[8..12], (file.body.len() as u32).to_le_bytes());
    // A fresh block is the one of the settings.
    let reset = site.post(&format!("/api/v1/sessions/{id}/clay/reset"), &json!({}));
    let block_m3 = reset.json::<Session>().clay.initial_volume_m3;
    assert!(
        (block_m3 / (0.064 * 0.064 * 0.032) - 1.0).abs() < 1e-12,
        "{block_m3} m3"
    );
    site.delete(&format!("/api/v1/sessions/{id}"));
}

#[test]
fn what_is_no_closed_mesh_within_the_block_is_refused_and_changes_nothing() {
    let site = shared().site();
    let id = shared().session(&site);
    let whole = box_of([20.0, 30.0, 10.0]);
    let before: Session = site.get(&format!("/api/v1/sessions/{id}")).json();
    let cases: [(&[u8], &str, &str); 6] = [
        (&stl(&whole[..10]), "mesh_open", "4 edges"),
        (
            &stl(&[&whole[..1], &whole[2..]].concat()),
            "mesh_open",
            "3 edges",
        ),
        (&stl(&[]), "mesh_empty", "nothing"),
        (&stl(&box_of([20.0, 300.0, 10.0])), "mesh_too_large", "0.3"),
        (&stl(&whole)[..300], "mesh", "STL"),
        (b"", "mesh", "STL"),
    ];
    for (file, word, said) in cases {
        let answer = put(&site, &id, "", "model/stl", file);
        assert_eq!((answer.status, &*answer.word()), (422, word), "{answer:?}");
        let detail = answer.problem().detail;
        assert!(detail.contains(said), "{detail}");
    }
    let file = stl(&whole);
    for (query, media_type, status) in [
        ("", "application/json", 415),
        ("?fit=perhaps", "model/stl", 422),
        ("?fits=true", "model/stl", 422),
        ("", "model/3mf", 422),
    ] {
        let answer = put(&site, &id, query, media_type, &file);
        assert_eq!(answer.status, status, "{query} {media_type}: {answer:?}");
    }
    let huge = Ask::new("PUT", &format!("/api/v1/sessions/{id}/clay"))
        .with("Content-Type", "model/stl")
        .with("Content-Length", "67108865");
    assert_eq!(site.send(&huge).status, 413);
    let after: Session = site.get(&format!("/api/v1/sessions/{id}")).json();
    assert_eq!(
        (after.revision, &after.clay),
        (before.revision, &before.clay)
    );
    site.delete(&format!("/api/v1/sessions/{id}"));
}

/// This server keeps nothing, and says so; what asks for a moment has to name one.
#[test]
fn a_server_that_keeps_nothing_has_no_past() {
    let site = shared().site();
    let id = shared().session(&site);
    let path = |what: &str| format!("/api/v1/sessions/{id}/{what}");
    let session: Session = site.get(&format!("/api/v1/sessions/{id}")).json();
    assert_eq!(
        serde_json::to_value(&session.storage).unwrap()["state"],
        "ephemeral"
    );
    let past = [
        site.get(&path("history")),
        site.get(&path("clay.stl?at_s=1")),
        site.post(&path("undo"), &json!({})),
        site.post(&path("redo"), &json!({ "tool": 1 })),
    ];
    for answer in past {
        assert_eq!(
            (answer.status, &*answer.word()),
            (409, "not-kept"),
            "{answer:?}"
        );
    }
    for (what, body) in [
        ("undo", json!({ "tool": 0 })),
        ("undo", json!({ "tool": 9 })),
        ("undo", json!({ "since": 0 })),
        ("undo", json!({ "tool": 1, "since": 1 })),
        ("undo", json!({ "stroke": 1 })),
        ("redo", json!({ "since": 1 })),
        ("duplicate", json!({ "id": "no name" })),
    ] {
        let answer = site.post(&path(what), &body);
        assert_eq!(
            (answer.status, &*answer.word()),
            (422, "field"),
            "{what} {body}"
        );
    }
    for moment in ["-1", "NaN", "1e12", "soon", ""] {
        let answer = site.get(&path(&format!("clay.stl?at_s={moment}")));
        assert_eq!(
            (answer.status, &*answer.word()),
            (422, "field"),
            "{moment}: {answer:?}"
        );
    }
    let made = site.post(&path("duplicate"), &json!({ "id": format!("{id}-2") }));
    assert_eq!(made.status, 201);
    let twin: Session = made.json();
    assert_eq!(twin.clay.hash, session.clay.hash);
    for id in [format!("{id}-2"), id] {
        assert_eq!(site.delete(&format!("/api/v1/sessions/{id}")).status, 204);
    }
}

/// Tissue over bone, 32 x 32 x 24 samples of a millimetre.
fn scan() -> Vec<u8> {
    let mut file =
        b"NRRD0004\ntype: uchar\ndimension: 3\nsizes: 32 32 24\nencoding: raw\nspacings: 1 1 1\n\n"
            .to_vec();
    file.extend((0..32 * 32 * 24).map(|at| if at < 32 * 32 * 12 { 200 } else { 90 }));
    file
}

#[test]
fn a_scan_becomes_clay_of_classes() {
    let site = shared().site();
    let id = shared().session(&site);
    let nrrd = "application/x-nrrd";
    let one: Session = put(&site, &id, "?thresholds=50", nrrd, &scan()).json();
    let volume_m3 = one.clay.initial_volume_m3;
    assert!((volume_m3 / 24.576e-6 - 1.0).abs() < 2e-3, "{volume_m3} m3");
    assert_eq!((one.clay.epoch, one.clay.removed_units), (2, 0));

    // The same clay, part of which is of another class: another hash, and each material has its own.
    let hashes: Vec<_> = ["firm_clay", "wax", "6e5:0:0"]
        .iter()
        .map(|material| {
            let query = format!("?thresholds=50,150&materials={material}");
            let session: Session = put(&site, &id, &query, nrrd, &scan()).json();
            assert!((session.clay.initial_volume_m3 / volume_m3 - 1.0).abs() < 1e-12);
            session.clay.hash
        })
        .collect();
    assert!(hashes.iter().all(|hash| *hash != one.clay.hash));
    assert!(hashes[0] != hashes[1] && hashes[1] != hashes[2] && hashes[0] != hashes[2]);

    // A duplicate has the classes, too.
    let twin = format!("{id}-twin");
    let path = format!("/api/v1/sessions/{id}/duplicate");
    let copy: Session = site.post(&path, &json!({ "id": twin })).json();
    assert_eq!(copy.clay.hash, hashes[2]);
    site.delete(&format!("/api/v1/sessions/{twin}"));
    site.delete(&format!("/api/v1/sessions/{id}"));
}

#[test]
fn what_is_no_volume_or_has_no_thresholds_is_refused_in_words() {
    let site = shared().site();
    let id = shared().session(&site);
    let scan = scan();
    let detached = b"NRRD0004\ntype: uchar\ndata file: scan.raw\n\n";
    let cases: [(&str, &str, &[u8], &str, &str); 9] = [
        ("", "application/x-nrrd", &scan, "field", "needs thresholds"),
        (
            "?thresholds=9,8&materials=wax",
            "application/x-nrrd",
            &scan,
            "field",
            "above the one before",
        ),
        (
            "?thresholds=1,2",
            "application/x-nrrd",
            &scan,
            "field",
            "one material fewer",
        ),
        (
            "?thresholds=1,2&materials=butter",
            "application/x-nrrd",
            &scan,
            "field",
            "paper_clay",
        ),
        (
            "?thresholds=1,2&materials=1:2",
            "application/x-nrrd",
            &scan,
            "field",
            "viscosity:yield:stiffness",
        ),
        (
            "?thresholds=50",
            "application/x-nrrd",
            detached,
            "volume",
            "detached header",
        ),
        (
            "?thresholds=50",
            "application/x-metaimage",
            &scan,
            "volume",
            "no key",
        ),
        (
            "?thresholds=250",
            "application/x-nrrd",
            &scan,
            "volume_empty",
            "250",
        ),
        (
            "?thresholds=50",
            "model/stl",
            &stl(&box_of([20.0; 3])),
            "field",
            "a mesh has no values",
        ),
    ];
    for (query, media_type, body, kind, words) in cases {
        let answer = put(&site, &id, query, media_type, body);
        assert_eq!(answer.status, 422, "{query} {media_type}");
        let problem = answer.problem();
        assert!(
            problem.detail.contains(words),
            "{:?}, wanted {words:?}",
            problem.detail
        );
        assert!(
            problem.kind.ends_with(kind),
            "{}, wanted {kind}",
            problem.kind
        );
    }
    let session: Session = site.get(&format!("/api/v1/sessions/{id}")).json();
    assert_eq!(session.clay.epoch, 1, "nothing has changed");
    site.delete(&format!("/api/v1/sessions/{id}"));
}

#[test]
fn layers_and_presets_make_a_block_and_are_told() {
    let site = shared().site();
    let id = shared().session(&site);
    let reset = format!("/api/v1/sessions/{id}/clay/reset");
    let plain: Session = site.post(&reset, &json!({})).json();
    let layers = json!([{"thickness_m": 0.01, "material": {"preset": "foam"}}]);
    let asked = json!({"material": {"preset": "firm_clay"}, "layers": layers});
    let layered: Session = site.post(&reset, &asked).json();
    assert!((layered.material.yield_stress_pa - 7.5e4).abs() < 1e-9);
    assert_ne!(layered.clay.hash, plain.clay.hash);
    // What is left out stays, and an empty list takes them away.
    let again: Session = site.post(&reset, &json!({})).json();
    assert_eq!(again.clay.hash, layered.clay.hash);
    let without: Session = site.post(&reset, &json!({"layers": []})).json();
    assert_eq!(without.clay.hash, plain.clay.hash);
    let list: serde_json::Value = site.get("/api/v1/materials").json();
    let named = list["materials"].as_array().unwrap();
    assert!(named.iter().any(|entry| entry["preset"] == "firm_clay"));
    site.delete(&format!("/api/v1/sessions/{id}"));
}
