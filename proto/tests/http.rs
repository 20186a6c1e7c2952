//! Ranges, defaults and changes of the HTTP types, and the field that each error names.

use serde_json::{Value, json};
use teleclay_proto::http::{
    Axes, BodyError, Burst, ClayReset, ClayShape, ClaySpec, FieldError, Impairment, Material,
    Network, NewSession, Outage, Problem, SessionId, SessionPatch, ToolDescription, Validate,
    parse,
};
use teleclay_proto::join::{JoinRequest, LoopParameters};
use utoipa::openapi::RefOr;
use utoipa::openapi::schema::Schema;
use utoipa::{PartialSchema, ToSchema};

/// The field that `body` is refused for.
fn refused_at<T>(body: Value) -> String
where
    T: serde::de::DeserializeOwned + serde::Serialize + Validate + std::fmt::Debug,
{
    match parse::<T>(body.to_string().as_bytes()) {
        Err(BodyError::Field(FieldError { pointer, .. })) => pointer,
        other => panic!("{body}: {other:?}, wanted an error of a field"),
    }
}

fn rod(session: &mut NewSession) -> &mut ToolDescription {
    session.tool = ToolDescription::Cylinder {
        radius_m: 0.01,
        height_m: 0.02,
    };
    &mut session.tool
}

fn ring(session: &mut NewSession) -> &mut ToolDescription {
    session.tool = ToolDescription::Loop {
        ring_radius_m: 0.01,
        wire_diameter_m: 1e-4,
    };
    &mut session.tool
}

#[test]
fn a_tool_has_what_its_kind_has_and_nothing_else() {
    let with = |tool: Value| json!({ "id": "a", "tool": tool });
    let sound = [
        json!({ "kind": "cylinder", "radius_m": 0.004, "height_m": 0.03 }),
        json!({ "kind": "loop", "ring_radius_m": 0.006, "wire_diameter_m": 0.006 }),
    ];
    for tool in sound {
        let session: NewSession = parse(with(tool.clone()).to_string().as_bytes()).expect("sound");
        assert_eq!(serde_json::to_value(session.tool).expect("it prints"), tool);
    }
    for (tool, pointer) in [
        (json!({ "kind": "cylinder", "radius_m": 0.004 }), "/tool"),
        (
            json!({ "kind": "cylinder", "radius_m": 0.004, "height_m": 0.03, "width_m": 0.1 }),
            "/tool",
        ),
        (
            json!({ "kind": "loop", "radius_m": 0.004, "wire_diameter_m": 0.002 }),
            "/tool",
        ),
        (
            json!({ "kind": "loop", "ring_radius_m": 0.004, "wire_diameter_m": 0.0041 }),
            "/tool/wire_diameter_m",
        ),
        (json!({ "kind": "spoon", "radius_m": 0.004 }), "/tool/kind"),
    ] {
        assert_eq!(refused_at::<NewSession>(with(tool)), pointer);
    }
}

/// Every range: the greatest and least number are in, the next one outside is out.
#[test]
fn ranges_hold_their_ends_and_nothing_beyond() {
    type Place = fn(&mut NewSession) -> &mut f64;
    let places: [(&str, f64, f64, Place); 22] = [
        ("/material/viscosity_pa_s_per_m", 0.0, 1e7, |s| {
            &mut s.material.viscosity_pa_s_per_m
        }),
        ("/material/yield_stress_pa", 0.0, 1e6, |s| {
            &mut s.material.yield_stress_pa
        }),
        ("/material/stiffness_pa", 0.0, 1e9, |s| {
            &mut s.material.stiffness_pa
        }),
        ("/network/up/delay_s", 0.0, 2.0, |s| {
            &mut s.network.up.delay_s
        }),
        ("/network/down/delay_s", 0.0, 2.0, |s| {
            &mut s.network.down.delay_s
        }),
        ("/network/up/jitter_s", 0.0, 1.0, |s| {
            &mut s.network.up.jitter_s
        }),
        ("/network/down/loss", 0.0, 1.0, |s| &mut s.network.down.loss),
        ("/network/up/duplicate", 0.0, 1.0, |s| {
            &mut s.network.up.duplicate
        }),
        ("/network/up/reorder", 0.0, 1.0, |s| {
            &mut s.network.up.reorder
        }),
        ("/network/up/burst/enter", 0.0, 1.0, |s| &mut burst(s).enter),
        ("/network/up/burst/leave", 0.0, 1.0, |s| &mut burst(s).leave),
        ("/network/up/burst/loss_in_burst", 0.0, 1.0, |s| {
            &mut burst(s).loss_in_burst
        }),
        ("/network/down/outage/every_s", 0.01, 3600.0, |s| {
            &mut outage(s).every_s
        }),
        ("/network/down/outage/length_s", 0.0, 60.0, |s| {
            &mut outage(s).length_s
        }),
        ("/tool/width_m", 1e-4, 0.5, |s| match &mut s.tool {
            ToolDescription::Blade { width_m, .. } => width_m,
            _ => unreachable!("the default is a blade"),
        }),
        ("/tool/height_m", 1e-4, 0.5, |s| match &mut s.tool {
            ToolDescription::Blade { height_m, .. } => height_m,
            _ => unreachable!("the default is a blade"),
        }),
        ("/tool/thickness_m", 1e-4, 0.5, |s| match &mut s.tool {
            ToolDescription::Blade { thickness_m, .. } => thickness_m,
            _ => unreachable!("the default is a blade"),
        }),
        ("/tool/radius_m", 1e-4, 0.1, |s| {
            if !matches!(s.tool, ToolDescription::Ball { .. }) {
                s.tool = ToolDescription::Ball { radius_m: 0.01 };
            }
            match &mut s.tool {
                ToolDescription::Ball { radius_m } => radius_m,
                _ => unreachable!("it was just made a ball"),
            }
        }),
        ("/tool/radius_m", 1e-4, 0.1, |s| match rod(s) {
            ToolDescription::Cylinder { radius_m, .. } => radius_m,
            _ => unreachable!("it was just made a cylinder"),
        }),
        ("/tool/height_m", 1e-4, 0.5, |s| match rod(s) {
            ToolDescription::Cylinder { height_m, .. } => height_m,
            _ => unreachable!("it was just made a cylinder"),
        }),
        ("/tool/ring_radius_m", 1e-4, 0.1, |s| match ring(s) {
            ToolDescription::Loop { ring_radius_m, .. } => ring_radius_m,
            _ => unreachable!("it was just made a loop"),
        }),
        ("/tool/wire_diameter_m", 1e-4, 0.1, |s| match ring(s) {
            ToolDescription::Loop {
                ring_radius_m,
                wire_diameter_m,
            } => {
                *ring_radius_m = 0.1;
                wire_diameter_m
            }
            _ => unreachable!("it was just made a loop"),
        }),
    ];
    for (pointer, least, most, place) in places {
        let outcome = |value: f64| {
            let mut session = NewSession::new(SessionId::new("a").expect("a name"));
            outage(&mut session).length_s = 0.0;
            *place(&mut session) = value;
            session.validate().map_err(|error| error.pointer)
        };
        assert_eq!(outcome(least), Ok(()), "{pointer}");
        if pointer != "/network/down/outage/length_s" {
            assert_eq!(outcome(most), Ok(()), "{pointer}");
        }
        for out in [
            least.next_down(),
            most.next_up(),
            f64::NAN,
            f64::INFINITY,
            f64::NEG_INFINITY,
        ] {
            assert_eq!(outcome(out), Err(pointer.to_owned()), "{out}");
        }
    }
}

fn burst(session: &mut NewSession) -> &mut Burst {
    session.network.up.burst.get_or_insert(Burst {
        enter: 0.1,
        leave: 0.1,
        loss_in_burst: 1.0,
    })
}

fn outage(session: &mut NewSession) -> &mut Outage {
    session.network.down.outage.get_or_insert(Outage {
        every_s: 50.0,
        length_s: 1.0,
    })
}

#[test]
fn an_outage_is_shorter_than_its_period() {
    let outage = |every_s, length_s| {
        Outage { every_s, length_s }
            .validate()
            .map_err(|error| error.pointer)
    };
    assert_eq!(outage(100.0, 60.0), Ok(()));
    assert_eq!(outage(2.0, 1.999), Ok(()));
    assert_eq!(outage(2.0, 2.0), Err("/length_s".to_owned()));
}

#[test]
fn only_a_name_is_needed_for_a_session() {
    let session: NewSession = parse(br#"{"id":"demo"}"#).expect("the name is enough");
    assert_eq!(
        session,
        NewSession::new(SessionId::new("demo").expect("a name"))
    );
    let plain = json!({
        "id": "demo", "axes": 2, "deadband": 0.0, "scheme": "replica", "tools": 1,
        "material": { "viscosity_pa_s_per_m": 2e5, "yield_stress_pa": 0.0, "stiffness_pa": 0.0 },
        "network": { "up": undisturbed(), "down": undisturbed() },
        "clay": { "shape": { "kind": "block", "size_m": [0.128, 0.064, 0.064] }, "voxel_size_m": 5e-4 },
        "tool": { "kind": "blade", "width_m": 0.01, "height_m": 0.04, "thickness_m": 0.002 },
    });
    assert_eq!(serde_json::to_value(session).expect("it prints"), plain);
}

fn undisturbed() -> Value {
    json!({
        "delay_s": 0.0, "jitter_s": 0.0, "loss": 0.0, "seed": 1,
        "jitter_distribution": "normal", "duplicate": 0.0, "reorder": 0.0,
    })
}

#[test]
fn fields_at_fault_are_named() {
    let at = refused_at::<NewSession>;
    assert_eq!(at(json!({})), "");
    assert_eq!(at(json!([])), "");
    assert_eq!(at(json!("demo")), "");
    assert_eq!(at(json!({"id": "Demo"})), "/id");
    assert_eq!(at(json!({"id": ""})), "/id");
    assert_eq!(at(json!({"id": 7})), "/id");
    assert_eq!(at(json!({"id": "a", "speed": 1})), "/speed");
    assert_eq!(at(json!({"id": "a", "a/b~c": 1})), "/a~1b~0c");
    assert_eq!(at(json!({"id": "a", "axes": 1})), "/axes");
    assert_eq!(at(json!({"id": "a", "axes": 2.5})), "/axes");
    assert_eq!(at(json!({"id": "a", "tools": 0})), "/tools");
    assert_eq!(at(json!({"id": "a", "tools": 9})), "/tools");
    assert_eq!(at(json!({"id": "a", "scheme": "Wave"})), "/scheme");
    assert_eq!(at(json!({"id": "a", "scheme": 2})), "/scheme");
    assert_eq!(
        at(json!({"id": "a", "material": {"viscosity": 1}})),
        "/material/viscosity"
    );
    assert_eq!(at(json!({"id": "a", "material": [1, 2, 3]})), "/material");
    assert_eq!(
        at(json!({"id": "a", "network": {"up": {"seed": 1_u64 << 53}}})),
        "/network/up/seed"
    );
    assert_eq!(
        at(json!({"id": "a", "network": {"up": {"burst": {"enter": 1}}}})),
        "/network/up/burst"
    );
    assert_eq!(at(json!({"id": "a", "tool": {"kind": "ball"}})), "/tool");
    assert_eq!(
        at(json!({"id": "a", "tool": {"kind": "drill"}})),
        "/tool/kind"
    );
    assert_eq!(
        at(json!({"id": "a", "tool": {"kind": "ball", "radius_m": true}})),
        "/tool/radius_m"
    );
    assert_eq!(
        at(json!({"id": "a", "tool": {"kind": "ball", "radius_m": 0.01, "width_m": 0.1}})),
        "/tool"
    );
    let stepped = |edges: Value, depths: Value| json!({"id": "a", "clay": {"shape": {"kind": "stepped", "edges_m": edges, "depths_of_cut_m": depths}}});
    assert_eq!(
        at(stepped(json!([0, 0.1]), json!([]))),
        "/clay/shape/depths_of_cut_m"
    );
    assert_eq!(
        at(stepped(json!([0, 0.1]), json!([0.01, 0.01]))),
        "/clay/shape/edges_m"
    );
    assert_eq!(
        at(stepped(json!([0.1, 0.1]), json!([0.01]))),
        "/clay/shape/edges_m/1"
    );
    assert_eq!(
        at(stepped(json!([-0.1, 0.1]), json!([0.01]))),
        "/clay/shape/edges_m/0"
    );
    assert_eq!(
        at(stepped(json!([0, "b"]), json!([0.01]))),
        "/clay/shape/edges_m/1"
    );
    assert_eq!(
        at(stepped(json!([0, 0.1]), json!([0]))),
        "/clay/shape/depths_of_cut_m/0"
    );
    let too_many = |steps: usize| {
        let edges: Vec<f64> = (0..=steps).map(|step| step as f64 * 1e-3).collect();
        stepped(json!(edges), json!(vec![0.01; steps]))
    };
    assert_eq!(at(too_many(65)), "/clay/shape/depths_of_cut_m");
    assert!(parse::<NewSession>(too_many(64).to_string().as_bytes()).is_ok());
    assert_eq!(refused_at::<ClayReset>(json!({"shape": null})), "/shape");
    assert_eq!(
        refused_at::<JoinRequest>(json!({"protocol": 1, "operator": "", "device": "d"})),
        "/operator"
    );
    assert_eq!(
        refused_at::<JoinRequest>(json!({"protocol": 1, "operator": "o", "device": "d\n"})),
        "/device"
    );
}

#[test]
fn a_body_that_is_not_json_is_another_error() {
    for body in [
        "",
        "{",
        "{\"id\":\"a\"}x",
        "{\"id\":\"a\",\"axes\":NaN}",
        "{\"id\":\"a\",\"axes\":1e999}",
        "\u{feff}{}",
    ] {
        let error = parse::<NewSession>(body.as_bytes()).expect_err(body);
        assert!(
            matches!(error, BodyError::Syntax { line: 1, .. }),
            "{body}: {error:?}"
        );
        let problem = Problem::from(error);
        assert_eq!((problem.status, problem.pointer), (400, None));
    }
    let error = parse::<NewSession>(br#"{"id":"a","id":"b"}"#).expect_err("a field twice");
    let problem = Problem::from(error);
    assert_eq!(
        (problem.status, problem.pointer.as_deref()),
        (422, Some(""))
    );
    assert_eq!(problem.detail, "duplicate field `id`");
}

#[test]
fn nesting_does_not_exhaust_the_stack() {
    let body = format!("{}{}", "[".repeat(100_000), "]".repeat(100_000));
    assert!(matches!(
        parse::<NewSession>(body.as_bytes()),
        Err(BodyError::Syntax { .. })
    ));
}

#[test]
fn a_grid_has_at_most_1024_voxels_along_each_axis_and_half_as_many_in_all_as_that_would_allow() {
    let spec = |size_m: [f64; 3], voxel_size_m| {
        let shape = ClayShape::Block { size_m };
        ClaySpec {
            shape,
            voxel_size_m,
        }
        .validate()
        .map_err(|error| error.pointer)
    };
    for axis in 0..3 {
        let mut size_m = [0.512; 3];
        size_m[axis] = 0.256;
        assert_eq!(spec(size_m, 5e-4), Ok(()));
        size_m[axis] = 0.2561;
        assert_eq!(spec(size_m, 5e-4), Err("/voxel_size_m".to_owned()));
        let mut size_m = [0.1; 3];
        size_m[axis] = 0.5121;
        assert_eq!(spec(size_m, 5e-4), Err("/voxel_size_m".to_owned()));
    }
    // 0.1 is 100 times 0.001 only to rounding.
    assert_eq!(spec([0.1 + 0.2, 0.3, 0.15], 0.3 / 1024.0), Ok(()));
    let stepped = ClaySpec {
        shape: ClayShape::stepped(),
        voxel_size_m: 5e-4,
    };
    assert_eq!(stepped.validate(), Ok(()));
    assert!((stepped.shape.size_m()[2] - 0.04).abs() < 1e-12);
}

#[test]
fn a_patch_changes_what_it_names_and_nothing_else() {
    let before = Network {
        up: Impairment {
            delay_s: 0.1,
            loss: 0.2,
            burst: Some(Burst {
                enter: 0.1,
                leave: 0.2,
                loss_in_burst: 0.3,
            }),
            outage: Some(Outage {
                every_s: 5.0,
                length_s: 0.2,
            }),
            ..Impairment::default()
        },
        down: Impairment {
            delay_s: 0.3,
            ..Impairment::default()
        },
    };
    let network = |body: &str| {
        let patch: SessionPatch = parse(body.as_bytes()).expect("the patch is good");
        patch.network.expect("it names the network").apply(before)
    };
    assert_eq!(network(r#"{"network":{}}"#), before);
    assert_eq!(network(r#"{"network":{"up":{}}}"#), before);
    let mut after = before;
    after.up.loss = 0.0;
    assert_eq!(network(r#"{"network":{"up":{"loss":0}}}"#), after);
    let mut after = before;
    after.up.burst = None;
    assert_eq!(network(r#"{"network":{"up":{"burst":null}}}"#), after);
    let mut after = before;
    after.down.outage = Some(Outage {
        every_s: 1.0,
        length_s: 0.5,
    });
    assert_eq!(
        network(r#"{"network":{"down":{"outage":{"every_s":1,"length_s":0.5}}}}"#),
        after
    );

    let patch: SessionPatch =
        parse(br#"{"material":{"yield_stress_pa":10}}"#).expect("the patch is good");
    let material = patch
        .material
        .expect("it names the material")
        .apply(Material {
            stiffness_pa: 3.0,
            ..Material::default()
        });
    assert_eq!(
        material,
        Material {
            viscosity_pa_s_per_m: 2e5,
            yield_stress_pa: 10.0,
            stiffness_pa: 3.0
        }
    );
    assert_eq!(
        (patch.scheme, patch.network, patch.paused),
        (None, None, None)
    );
}

#[test]
fn nothing_is_left_out_by_saying_null() {
    for (body, pointer) in [
        (json!({"paused": null}), "/paused"),
        (json!({"scheme": null}), "/scheme"),
        (json!({"material": null}), "/material"),
        (
            json!({"material": {"stiffness_pa": null}}),
            "/material/stiffness_pa",
        ),
        (json!({"network": {"up": null}}), "/network/up"),
        (
            json!({"network": {"down": {"loss": null}}}),
            "/network/down/loss",
        ),
    ] {
        assert_eq!(refused_at::<SessionPatch>(body), pointer);
    }
}

#[test]
fn parameters_that_no_loop_could_run_on_are_refused() {
    let sound = LoopParameters::default();
    assert_eq!(sound.validate(), Ok(()));
    let at = |parameters: LoopParameters| parameters.validate().map_err(|error| error.pointer);
    let bad = |pointer: &str| Err(pointer.to_owned());
    assert_eq!(
        at(LoopParameters {
            tick_s: 0.0,
            ..sound
        }),
        bad("/tick_s")
    );
    assert_eq!(
        at(LoopParameters {
            virtual_mass_kg: 0.0,
            ..sound
        }),
        bad("/virtual_mass_kg")
    );
    assert_eq!(
        at(LoopParameters {
            force_ratio: -1.0,
            ..sound
        }),
        bad("/force_ratio")
    );
    assert_eq!(
        at(LoopParameters {
            wave_impedance_n_s_per_m: 0.0,
            ..sound
        }),
        bad("/wave_impedance_n_s_per_m")
    );
    assert_eq!(
        at(LoopParameters {
            force_limit_n: f64::INFINITY,
            ..sound
        }),
        bad("/force_limit_n")
    );
    assert_eq!(
        at(LoopParameters {
            silence_s: f64::NAN,
            ..sound
        }),
        bad("/silence_s")
    );
    assert_eq!(
        at(LoopParameters {
            home_m: [0.0, 0.0, 1.0],
            ..sound
        }),
        bad("/home_m/2")
    );
    assert_eq!(
        at(LoopParameters {
            reach_m: [[0.0; 3], [1.0, -1.0, 1.0]],
            ..sound
        }),
        bad("/reach_m/1/1")
    );
    let material = Material {
        stiffness_pa: -1.0,
        ..sound.material
    };
    assert_eq!(
        at(LoopParameters { material, ..sound }),
        bad("/material/stiffness_pa")
    );
}

#[test]
fn the_schema_says_what_may_be_left_out() {
    let object = |schema: RefOr<Schema>| match schema {
        RefOr::T(Schema::Object(object)) => object,
        _ => panic!("the schema is not an object"),
    };
    let new_session = object(NewSession::schema());
    assert_eq!(new_session.required, ["id"]);
    assert!(object(SessionPatch::schema()).required.is_empty());
    assert!(object(ClayReset::schema()).required.is_empty());
    let patch = serde_json::to_value(SessionPatch::schema()).expect("it prints");
    assert_eq!(
        patch["properties"]["paused"]["type"], "boolean",
        "null is refused"
    );
    assert_eq!(patch["additionalProperties"], false);
    let id = serde_json::to_value(SessionId::schema()).expect("it prints");
    assert_eq!(id["pattern"], "^[a-z0-9_-]{1,64}$");
    assert_eq!(SessionId::name(), "SessionId");
    let axes = serde_json::to_value(Axes::schema()).expect("it prints");
    assert_eq!(axes["enum"], json!([2, 3]));
}
