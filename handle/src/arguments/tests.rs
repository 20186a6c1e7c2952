//! Command lines that can be run, and what is said of the others.

use super::*;
use teleclay_operator::Waypoint;

fn read(words: &[&str]) -> Result<(Arguments, Intent), String> {
    let words = ["teleclay-handle"].iter().chain(words);
    Arguments::read_from(words).map_err(|error| error.to_string())
}

#[test]
fn the_command_line_is_well_formed() {
    Arguments::command().debug_assert();
}

#[test]
fn without_arguments_it_joins_the_demo_on_this_machine_and_cuts() {
    let (arguments, intent) = read(&[]).unwrap();
    assert_eq!(arguments.connect.to_string(), "tcp/127.0.0.1:7547");
    assert_eq!(arguments.session.as_str(), "demo");
    assert_eq!(
        (arguments.device, intent),
        (DeviceChoice::Kind(DeviceKind::Simulated), Intent::Cutting)
    );
    assert_eq!(arguments.seconds, None);
    assert_eq!(check_name("", &arguments.operator_name()), Ok(()));
}

#[test]
fn an_invite_says_where_to_and_who_and_is_not_contradicted() {
    let fingerprint = "ab".repeat(32);
    let token = format!("0000001a.{}", "07".repeat(16));
    let line = format!("teleclay:quic/192.0.2.7:7547,lab,clay,{fingerprint},{token}");
    let (arguments, _) = read(&["--invite", &line]).unwrap();
    assert_eq!(arguments.connect.to_string(), "quic/192.0.2.7:7547");
    let names = (arguments.realm.as_str(), arguments.session.as_str());
    assert_eq!(names, ("lab", "clay"));
    assert_eq!(arguments.token, Some(token));
    assert!(arguments.fingerprint.is_some());
    for more in [["--session", "other"], ["--connect", "tcp/127.0.0.1:1"]] {
        let said = read(&[&["--invite", &line], &more[..]].concat()).unwrap_err();
        assert!(said.contains("cannot be used with"), "{said}");
    }
    let elsewhere = line.replace("quic/192.0.2.7:7547", "http/192.0.2.7:80");
    let said = read(&["--invite", &elsewhere]).unwrap_err();
    assert!(said.contains("http/192.0.2.7:80"), "{said}");
}

#[test]
fn a_bound_on_the_hand_is_lowered_and_never_raised() {
    let profile = |words: &[&str]| read(words).unwrap().0.profile();
    let own = DeviceKind::Simulated.profile();
    assert_eq!(profile(&[]), own);
    assert_eq!(
        profile(&["--force-limit-n", "1000", "--speed-limit-m-s", "1e6"]),
        own
    );
    let lowered = profile(&["--force-limit-n", "3", "--power-limit-w", "0.5"]);
    assert_eq!((lowered.force_n, lowered.power_w), (3.0, 0.5));
    assert_eq!(
        (lowered.slew_n_per_s, lowered.speed_m_s),
        (own.slew_n_per_s, own.speed_m_s)
    );
}

#[test]
fn every_intent_takes_its_numbers() {
    let intent = |words: &[&str]| read(words).unwrap().1;
    assert_eq!(intent(&["--intent", "idle"]), Intent::Idle);
    assert_eq!(
        intent(&["--intent", "constant-force", "--force-n", "-2,0,0.5"]),
        Intent::ConstantForce {
            force_n: [-2.0, 0.0, 0.5]
        }
    );
    assert_eq!(
        intent(&["--intent", "sensor-force", "--force-n=2,0,0"]),
        Intent::SensorForce {
            force_n: [2.0, 0.0, 0.0]
        }
    );
    assert_eq!(
        intent(&[
            "--intent",
            "sinusoid",
            "--force-n",
            "1,1,0",
            "--frequency-hz",
            "0.5"
        ]),
        Intent::Sinusoid {
            amplitude_n: [1.0, 1.0, 0.0],
            frequency_hz: 0.5
        }
    );
    let corner = Waypoint {
        position_m: [-0.02, 0.0, 0.0],
        speed_m_s: 0.05,
    };
    assert_eq!(
        intent(&["--intent", "trajectory", "--waypoints", "-0.02,0,0@0.05"]),
        Intent::Trajectory {
            waypoints: vec![corner]
        }
    );
}

#[test]
fn waypoints_come_from_a_file_too() {
    let path = std::env::temp_dir().join(format!("teleclay-waypoints-{}", std::process::id()));
    std::fs::write(&path, "# a corner\n0.01,0,0@0.02\n").unwrap();
    let read = read(&[
        "--intent",
        "trajectory",
        "--waypoints",
        path.to_str().unwrap(),
    ]);
    std::fs::remove_file(&path).unwrap();
    let corner = Waypoint {
        position_m: [0.01, 0.0, 0.0],
        speed_m_s: 0.02,
    };
    assert_eq!(
        read.unwrap().1,
        Intent::Trajectory {
            waypoints: vec![corner]
        }
    );
}

#[test]
fn what_is_wrong_is_named_with_what_would_be_right() {
    for (words, what) in [
        (
            &["--connect", "localhost:7547"][..],
            "want tcp, udp, tls or quic, then /ADDRESS:PORT",
        ),
        (
            &["--connect", "quic/127.0.0.1:1?rel=1"],
            "mixed_rel=1|0|auto",
        ),
        (&["--fingerprint", "ab:cd"], "64 hexadecimal digits"),
        (&["--invite", "hello"], "an invite is one line"),
        (&["--session", "De mo"], "wanted a-z, 0-9, _ or -"),
        (
            &["--intent", "dig"],
            "possible values: idle, constant-force",
        ),
        (
            &["--intent", "constant-force"],
            "--intent constant-force needs --force-n",
        ),
        (
            &["--intent", "sinusoid", "--force-n", "1,0,0"],
            "needs --frequency-hz",
        ),
        (
            &["--intent", "cutting", "--force-n", "1,0,0"],
            "--force-n does not go with --intent cutting",
        ),
        (&["--force-n", "1,0"], "2 number(s), want three: X,Y,Z"),
        (&["--frequency-hz", "0"], "want a finite number above zero"),
        (&["--force-limit-n", "0"], "want a finite number above zero"),
        (
            &["--power-limit-w", "inf"],
            "want a finite number above zero",
        ),
        (&["--clock-drift-ppm", "-200000"], "want -100000 to 100000"),
        (
            &["--intent", "trajectory", "--waypoints", "there.txt"],
            "neither a file nor a list",
        ),
        (&["--seconds", "-1"], "want a number of seconds above zero"),
        (&["--scheduling", "batch"], "want normal or fifo"),
        (&["--spin-us", "5000"], "0..=1000"),
        (&["--device", "omega"], "have simulated, robot, gamepad"),
        (
            &["--device", "gamepad", "--intent", "idle"],
            "--intent is for simulated devices, and --device gamepad is held by a hand",
        ),
        (
            &["--device", "haply", "--force-n", "1,0,0"],
            "--force-n is for simulated devices",
        ),
        (
            &["--haply-url", "ws://192.0.2.7:10001"],
            "want ws://localhost:PORT",
        ),
        (&["--operator", ""], "0 characters, wanted 1 to 64"),
        (&["--operator", "Ada\u{200b}"], "it has U+200B"),
    ] {
        let error = read(words).unwrap_err();
        assert!(error.contains(what), "{words:?}: {error}");
    }
}
