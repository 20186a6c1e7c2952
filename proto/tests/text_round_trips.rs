//! Texts: what is written is what is read, for any values.

use proptest::array::uniform3;
use proptest::prelude::*;
use teleclay_proto::frame::{Engagement, LoopStatus, SweepRefusal};
use teleclay_proto::http::{
    Burst, ClayHash, ClayShape, ClaySpec, Impairment, JitterDistribution, Material, Network,
    NetworkPatch, NewSession, Outage, Validate, parse,
};
use teleclay_proto::join::{JoinReply, LoopParameters, RefusalCode};
use teleclay_proto::keys::{Key, Leaf, SessionKeys};
use teleclay_proto::{NodeName, RealmName, Scheme, SessionId, ToolDescription};

/// A number as people write it, of a few decimals, or as programs do, with every digit that there is.
fn number(least: i32, most: i32) -> impl Strategy<Value = f64> {
    let decimal = (least * 1000..=most * 1000).prop_map(|thousandths| f64::from(thousandths) / 1e3);
    prop_oneof![decimal, f64::from(least)..f64::from(most)]
}

fn any_impairment() -> impl Strategy<Value = Impairment> {
    let share = || number(0, 1);
    let burst = proptest::option::of([share(), share(), share()]).prop_map(|burst| {
        burst.map(|[enter, leave, loss_in_burst]| Burst {
            enter,
            leave,
            loss_in_burst,
        })
    });
    let outage = proptest::option::of((number(1, 3600), share())).prop_map(|outage| {
        outage.map(|(every_s, part)| Outage {
            every_s,
            length_s: part / 2.0,
        })
    });
    let jitter = prop_oneof![
        Just(JitterDistribution::Normal),
        Just(JitterDistribution::HeavyTailed)
    ];
    (
        (number(0, 2), share(), share(), 0..1_u64 << 53),
        (jitter, share(), share(), burst, outage),
    )
        .prop_map(
            |(
                (delay_s, jitter_s, loss, seed),
                (jitter_distribution, duplicate, reorder, burst, outage),
            )| Impairment {
                delay_s,
                jitter_s,
                loss,
                seed,
                jitter_distribution,
                duplicate,
                reorder,
                burst,
                outage,
            },
        )
}

proptest! {
    #[test]
    fn names_and_keys(
        realm in "[a-z0-9_-]{1,64}",
        session in "[a-z0-9_-]{1,64}",
        number: u32,
        leaf in 0..11_usize,
    ) {
        let leaves = [
            Leaf::Alive, Leaf::Join, Leaf::Leave, Leaf::Parameters, Leaf::ToolUp(number), Leaf::ToolDown(number),
            Leaf::ClayBricks, Leaf::ClaySnapshot, Leaf::ClayFresh, Leaf::State, Leaf::Operator(number),
        ];
        let realm = RealmName::new(realm).expect("the pattern is the rule");
        let session = SessionId::new(session).expect("the pattern is the rule");
        let session = SessionKeys::new(realm, session);
        let leaf = leaves[leaf];
        let text = session.key(leaf);
        prop_assert_eq!(text.parse(), Ok(Key { session, leaf }));
    }

    #[test]
    fn no_other_text_is_a_name(text in ".{0,70}") {
        let good = (1..=64).contains(&text.len())
            && text.bytes().all(|byte| matches!(byte, b'a'..=b'z' | b'0'..=b'9' | b'_' | b'-'));
        prop_assert_eq!(SessionId::new(text.clone()).is_ok(), good);
        let json = serde_json::to_string(&text).expect("text prints");
        prop_assert_eq!(serde_json::from_str::<NodeName>(&json).is_ok(), good);
    }

    #[test]
    fn hashes(hash: u64) {
        let text = ClayHash(hash).to_string();
        prop_assert_eq!(text.len(), 16);
        prop_assert_eq!(text.parse(), Ok(ClayHash(hash)));
        prop_assert!(text.to_uppercase() == text || text.to_uppercase().parse::<ClayHash>().is_err());
        prop_assert!(text[1..].parse::<ClayHash>().is_err());
    }

    #[test]
    fn networks_through_json(up in any_impairment(), down in any_impairment(), before in any_impairment()) {
        let network = Network { up, down };
        prop_assert_eq!(network.validate(), Ok(()));
        let json = serde_json::to_string(&network).expect("it prints");
        prop_assert_eq!(parse::<Network>(json.as_bytes()), Ok(network));
        // A change that names every field leaves nothing of what was before.
        let patch = NetworkPatch::from(network);
        let json = serde_json::to_string(&patch).expect("it prints");
        let patch: NetworkPatch = parse(json.as_bytes()).expect("it keeps the ranges");
        prop_assert_eq!(patch.apply(Network { up: before, down: before }), network);
    }

    #[test]
    fn parameters_through_json(
        mass in number(1, 100),
        viscosity_pa_s_per_m in number(0, 10_000_000),
        home_m in uniform3(number(-1, 1)),
    ) {
        let material = Material { viscosity_pa_s_per_m, ..Material::default() };
        let parameters = LoopParameters {
            virtual_mass_kg: mass, home_m, reach_m: [[-1.0; 3], [1.0; 3]], material, ..LoopParameters::default()
        };
        prop_assert_eq!(parameters.validate(), Ok(()));
        let json = serde_json::to_string(&parameters).expect("it prints");
        prop_assert_eq!(parse::<LoopParameters>(json.as_bytes()), Ok(parameters));
    }

    /// The two sides' clay is the same only if the tool, the block and the voxels are, to the last bit.
    #[test]
    fn lengths_that_both_sides_need_are_the_same_for_every_reader(
        lengths_m in proptest::array::uniform7(1e-3..1e-2f64),
    ) {
        for build in [block_and_ball, steps_and_blade, cylinder, wire_loop] {
            let session = build(lengths_m);
            let json = serde_json::to_string(&session).expect("it prints");
            prop_assert_eq!(parse::<NewSession>(json.as_bytes()), Ok(session));
        }
    }

    /// Any number at all, also one of 17 digits or with an exponent: what is read is what was written, bit by bit.
    #[test]
    fn numbers_survive_to_the_last_bit(bits: u64) {
        let number = f64::from_bits(bits);
        prop_assume!(number.is_finite());
        let json = serde_json::to_string(&number).expect("it prints");
        let read: f64 = serde_json::from_str(&json).expect("it is a number");
        prop_assert_eq!(read.to_bits(), bits, "{}", json);
        let value: serde_json::Value = serde_json::from_str(&json).expect("it is a number");
        prop_assert_eq!(value.as_f64().map(f64::to_bits), Some(bits), "{}", json);
    }
}

fn block_and_ball([radius_m, x, y, z, voxel_size_m, ..]: [f64; 7]) -> NewSession {
    let clay = ClaySpec {
        shape: ClayShape::Block { size_m: [x, y, z] },
        voxel_size_m,
    };
    NewSession {
        clay,
        tool: ToolDescription::Ball { radius_m },
        ..NewSession::new(SessionId::new("a").expect("a name"))
    }
}

fn steps_and_blade(
    [
        edge,
        depth,
        base_m,
        width_m,
        voxel_size_m,
        height_m,
        thickness_m,
    ]: [f64; 7],
) -> NewSession {
    let shape = ClayShape::Stepped {
        edges_m: vec![0.0, edge],
        depths_of_cut_m: vec![depth],
        base_m,
        width_m,
    };
    let clay = ClaySpec {
        shape,
        voxel_size_m,
    };
    let tool = ToolDescription::Blade {
        width_m,
        height_m,
        thickness_m,
    };
    NewSession {
        clay,
        tool,
        ..NewSession::new(SessionId::new("a").expect("a name"))
    }
}

fn cylinder([radius_m, height_m, ..]: [f64; 7]) -> NewSession {
    NewSession {
        tool: ToolDescription::Cylinder { radius_m, height_m },
        ..NewSession::new(SessionId::new("a").expect("a name"))
    }
}

fn wire_loop([length_m, other_m, ..]: [f64; 7]) -> NewSession {
    let tool = ToolDescription::Loop {
        ring_radius_m: length_m.max(other_m),
        wire_diameter_m: length_m.min(other_m),
    };
    NewSession {
        tool,
        ..NewSession::new(SessionId::new("a").expect("a name"))
    }
}

#[test]
fn every_word_is_read_as_it_is_written() {
    for scheme in Scheme::ALL {
        let json = serde_json::to_value(scheme).expect("it prints");
        assert_eq!(json, scheme.to_string());
        assert_eq!(scheme.word().parse(), Ok(*scheme));
    }
    let error = "waves"
        .parse::<Scheme>()
        .expect_err("there is no such scheme");
    assert_eq!(
        error.to_string(),
        r#"`waves` is not a scheme, wanted one of ["force_exchange", "position_force", "wave", "tdpa", "replica"]"#
    );
    assert!("".parse::<LoopStatus>().is_err());
    assert_eq!("out_of_reach".parse(), Ok(SweepRefusal::OutOfReach));
    assert_eq!("leaving".parse(), Ok(Engagement::Leaving));
}

#[test]
fn a_reply_is_one_of_two_and_has_nothing_extra() {
    let refused = br#"{"outcome":"refused","code":"busy","reason":"the loop is late"}"#;
    let reply = JoinReply::Refused {
        code: RefusalCode::Busy,
        reason: "the loop is late".to_owned(),
        holder: None,
    };
    assert_eq!(parse(refused), Ok(reply));
    let reserved = br#"{"outcome":"refused","code":"reserved","reason":"","holder":"Bob"}"#;
    let reply = JoinReply::Refused {
        code: RefusalCode::Reserved,
        reason: String::new(),
        holder: Some("Bob".to_owned()),
    };
    assert_eq!(parse(reserved), Ok(reply));
    for bad in [
        r#"{"outcome":"refused","code":"busy","reason":"","lease":1}"#,
        r#"{"outcome":"refused","code":"boredom","reason":""}"#,
        r#"{"outcome":"granted"}"#,
        r#"{"outcome":"left"}"#,
        r#"{"code":"busy","reason":""}"#,
    ] {
        assert!(parse::<JoinReply>(bad.as_bytes()).is_err(), "{bad}");
    }
}
