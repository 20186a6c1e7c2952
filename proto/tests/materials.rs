//! Materials by name: what a request may say, and that the page offers what the server knows.

use teleclay_proto::Preset;
use teleclay_proto::http::{
    ClayReset, Material, MaterialPatch, Materials, NewSession, SessionPatch, Validate, parse,
};

fn new_session(material: &str) -> Result<NewSession, (String, String)> {
    let body = format!(r#"{{"id": "a", "material": {material}}}"#);
    parse(body.as_bytes()).map_err(|error| {
        let said = error.to_string();
        let field = match error {
            teleclay_proto::http::BodyError::Field(field) => field.pointer,
            teleclay_proto::http::BodyError::Syntax { .. } => String::new(),
        };
        (field, said)
    })
}

#[test]
fn every_preset_is_a_material_in_its_range_with_words_and_a_source() {
    for entry in Materials::all().materials {
        assert_eq!(entry.material.validate(), Ok(()));
        assert_eq!(entry.preset.word().parse(), Ok(entry.preset));
        assert_eq!(entry.material, entry.preset.material());
        assert!(20 < entry.says.len() && entry.source.contains('['));
    }
    assert_eq!(Materials::all().materials.len(), Preset::ALL.len());
    assert_eq!(Material::default(), Preset::PaperClay.material());
}

#[test]
fn a_preset_stands_for_its_numbers_wherever_a_material_is_named() {
    for preset in Preset::ALL {
        let want = preset.material();
        let named = format!(r#"{{"preset": "{preset}"}}"#);
        assert_eq!(new_session(&named).unwrap().material, want);
        let reset: ClayReset = parse(format!(r#"{{"material": {named}}}"#).as_bytes()).unwrap();
        assert_eq!(reset.material, Some(want));
        let layers = format!(r#"{{"layers": [{{"thickness_m": 0.01, "material": {named}}}]}}"#);
        let reset: ClayReset = parse(layers.as_bytes()).unwrap();
        assert_eq!(reset.layers.unwrap()[0].material, want);
        let patch: SessionPatch = parse(format!(r#"{{"material": {named}}}"#).as_bytes()).unwrap();
        assert_eq!(patch.material, Some(MaterialPatch::from(want)));
        // What is written are numbers, and they read back.
        let written = serde_json::to_string(&new_session(&named).unwrap()).unwrap();
        assert!(!written.contains("preset"));
        assert_eq!(
            parse::<NewSession>(written.as_bytes()).unwrap().material,
            want
        );
    }
}

#[test]
fn numbers_beside_a_preset_hold_in_place_of_its_own() {
    let got = new_session(r#"{"preset": "wax", "yield_stress_pa": 5}"#).unwrap();
    let want = Material {
        yield_stress_pa: 5.0,
        ..Preset::Wax.material()
    };
    assert_eq!(got.material, want);
    // Without a preset a new session's material is the paper's, and a change leaves what it does not name.
    let got = new_session(r#"{"yield_stress_pa": 5}"#).unwrap().material;
    assert!((got.viscosity_pa_s_per_m - 2e5).abs() < 1e-9);
    let patch: SessionPatch = parse(br#"{"material": {"yield_stress_pa": 5}}"#).unwrap();
    let patch = patch.material.unwrap();
    assert_eq!(patch.viscosity_pa_s_per_m, None);
    assert_eq!(patch.apply(Preset::Wax.material()), want);
}

#[test]
fn an_unknown_preset_is_refused_with_the_list() {
    for word in ["butter", "firm clay", "FIRM_CLAY", ""] {
        let (pointer, said) = new_session(&format!(r#"{{"preset": "{word}"}}"#)).unwrap_err();
        assert_eq!(pointer, "/material/preset");
        for preset in Preset::ALL {
            assert!(said.contains(preset.word()), "{said}");
        }
    }
    for (material, want) in [
        (r#"{"preset": null}"#, "/material/preset"),
        (r#"{"preset": 3}"#, "/material/preset"),
        (r#"{"colour": "red"}"#, "/material/colour"),
        (
            r#"{"preset": "wax", "stiffness_pa": -1}"#,
            "/material/stiffness_pa",
        ),
    ] {
        assert_eq!(new_session(material).unwrap_err().0, want);
    }
}

#[test]
fn layers_are_checked_one_by_one() {
    let at = |layers: &str| {
        let body = format!(r#"{{"id": "a", "clay": {{"layers": {layers}}}}}"#);
        match parse::<NewSession>(body.as_bytes()) {
            Ok(_) => String::new(),
            Err(teleclay_proto::http::BodyError::Field(field)) => field.pointer,
            Err(other) => other.to_string(),
        }
    };
    let layer = r#"{"thickness_m": 0.01, "material": {}}"#;
    let several = |count: usize| format!("[{}]", vec![layer; count].join(","));
    assert_eq!(at(&several(7)), "");
    assert_eq!(at(&several(8)), "/clay/layers");
    assert_eq!(
        at(r#"[{"thickness_m": 0.01, "material": {}}, {"thickness_m": 0, "material": {}}]"#),
        "/clay/layers/1/thickness_m"
    );
    assert_eq!(
        at(r#"[{"thickness_m": 0.01, "material": {"yield_stress_pa": 1e9}}]"#),
        "/clay/layers/0/material/yield_stress_pa"
    );
}

/// The page has a table of its own, since it has to show it before it has asked.
#[test]
fn the_page_offers_the_presets_with_the_same_numbers() {
    let page = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../client-web/src/ui/materials.ts"
    );
    let page = std::fs::read_to_string(page).unwrap();
    for preset in Preset::ALL {
        let Material {
            viscosity_pa_s_per_m,
            yield_stress_pa,
            stiffness_pa,
        } = preset.material();
        let line = page
            .lines()
            .find(|line| line.trim_start().starts_with(&format!("{preset}: {{")))
            .unwrap_or_else(|| panic!("the page has no {preset}"));
        let numbers = format!(
            "viscosity_pa_s_per_m: {viscosity_pa_s_per_m}, yield_stress_pa: {yield_stress_pa}, stiffness_pa: {stiffness_pa} }}"
        );
        assert!(line.contains(&numbers), "{line}: wanted {numbers}");
        assert!(
            line.contains(preset.says()),
            "{line}: wanted {}",
            preset.says()
        );
    }
    let lines = page
        .lines()
        .filter(|line| line.contains("viscosity_pa_s_per_m:"));
    assert_eq!(lines.count(), Preset::ALL.len());
}
