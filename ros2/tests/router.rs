//! What comes out at the other side of a router: keys and bytes are spelled out here, not made by the room.

mod rig;

use teleclay_ros::from_cdr;
use teleclay_ros::own::{Event as EventMessage, SetSchemeResponse, Settings};
use teleclay_ros::standard::{
    DiagnosticArray, SetBoolResponse, TfMessage, TriggerResponse, Vector3, WrenchStamped,
};
use teleclay_ros2::Commands;
use teleclay_ros2::host::{Call, Level};

use rig::{Rig, Router, answer, attachment, config, sample, until};

const WRENCH: &str = "0/teleclay/demo/tool_1/tool_wrench/geometry_msgs::msg::dds_::WrenchStamped_/\
    RIHS01_8dc3deaf06b2ab281f9f9a742a8961c328ca7cec16e3fd6586d3a5c83fa78f77";
const TF: &str = "0/tf/tf2_msgs::msg::dds_::TFMessage_/\
    RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087";
const DIAGNOSTICS: &str = "0/diagnostics/diagnostic_msgs::msg::dds_::DiagnosticArray_/\
    RIHS01_5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e";
const PAUSE: &str = "0/teleclay/demo/pause/std_srvs::srv::dds_::SetBool_/\
    RIHS01_abe9e4bb6b41b40e6789712c00ec8871923e089af3f667a79992a428cff2da0a";
const RESET: &str = "0/teleclay/demo/reset_clay/std_srvs::srv::dds_::Trigger_/\
    RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f";
const SCHEME: &str = "0/teleclay/demo/set_scheme/teleclay_msgs::srv::dds_::SetScheme_/\
    RIHS01_0eac1b2f6880b3f2d6d34deaa37251f84f28834a5ff486ea6f22ee165b5cba8a";

/// A truth, a text without letters, and a request without fields, as ROS 2 writes them.
const TRUE: &[u8] = &[0, 1, 0, 0, 1];
const REPLICA: &[u8] = b"\0\x01\0\0\x08\0\0\0replica\0";
const EMPTY: &[u8] = &[0, 1, 0, 0, 0];

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn forces_and_frames_are_heard_with_their_numbers_and_times() {
    let rig = Rig::start(Commands::Refused).await;
    let wrenches = rig.client.declare_subscriber(WRENCH).await.unwrap();
    let frames = rig.client.declare_subscriber(TF).await.unwrap();
    rig.is_shown("%teleclay%demo%tool_1%tool_wrench", true)
        .await;
    // Nobody is told when a subscription has reached the other side: samples come until one is heard.
    let mut heard = Vec::new();
    let mut tick = 0;
    while heard.len() < 3 {
        tick += 1;
        rig.demo.samples.send(sample(1, tick)).unwrap();
        while let Ok(Some(put)) = wrenches.try_recv() {
            heard.push(put);
        }
        rig::pause().await;
    }
    let mut before: Option<(i64, i64)> = None;
    for put in &heard {
        let bytes = put.payload().to_bytes();
        let WrenchStamped { header, wrench } = from_cdr(&bytes).unwrap();
        assert_eq!(header.frame_id, "teleclay/demo/tool_1");
        assert_eq!(wrench.force, Vector3::from([0.5, -1.25, 3.0]));
        let (sequence, sent_ns, gid) = attachment(put.attachment().unwrap());
        assert!(0 < sequence && gid != [0; 16]);
        let stamp_ns =
            i64::from(header.stamp.sec) * 1_000_000_000 + i64::from(header.stamp.nanosec);
        // No later than it was sent, and of this minute.
        assert!(stamp_ns <= sent_ns && sent_ns - stamp_ns < 60_000_000_000);
        if let Some((earlier, stamped)) = before {
            assert!(earlier < sequence);
            assert!(stamped < stamp_ns);
        }
        before = Some((sequence, stamp_ns));
    }
    let put = frames.recv_async().await.unwrap();
    let bytes = put.payload().to_bytes();
    let transforms = from_cdr::<TfMessage<'_>>(&bytes).unwrap().transforms;
    let names: Vec<_> = transforms
        .iter()
        .map(|one| (one.header.frame_id, one.child_frame_id))
        .collect();
    assert_eq!(
        names,
        [
            ("teleclay/demo", "teleclay/demo/tool_1"),
            ("teleclay/demo", "teleclay/demo/handle_1")
        ]
    );
    assert!(3 <= rig.ros2.status().messages());
    rig.end().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_changes_slowly_is_told_within_a_second_and_events_as_they_come() {
    let rig = Rig::start(Commands::Refused).await;
    let settings = rig
        .client
        .declare_subscriber("0/teleclay/demo/settings/**")
        .await
        .unwrap();
    let diagnostics = rig.client.declare_subscriber(DIAGNOSTICS).await.unwrap();
    let events = rig
        .client
        .declare_subscriber("0/teleclay/demo/events/**")
        .await
        .unwrap();
    let put = settings.recv_async().await.unwrap();
    let bytes = put.payload().to_bytes();
    let told: Settings<'_> = from_cdr(&bytes).unwrap();
    assert_eq!((told.revision, told.json), (7, "{\"axes\":3}"));
    let put = diagnostics.recv_async().await.unwrap();
    let bytes = put.payload().to_bytes();
    let told: DiagnosticArray<'_> = from_cdr(&bytes).unwrap();
    let status = &told.status[0];
    assert_eq!(
        (status.name, status.message, status.level),
        ("teleclay/demo", "stopped", 1)
    );
    assert_eq!(
        (status.values[0].key, status.values[0].value),
        ("rtt_s", "0.08")
    );
    // The subscription was there when the two above came.
    rig.demo.event(Level::Error, "a tool rests");
    let put = events.recv_async().await.unwrap();
    let bytes = put.payload().to_bytes();
    let told: EventMessage<'_> = from_cdr(&bytes).unwrap();
    assert_eq!(
        (told.level, told.text),
        (EventMessage::ERROR, "a tool rests")
    );
    rig.end().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn services_do_nothing_and_say_so_unless_the_server_was_told_to_take_commands() {
    let rig = Rig::start(Commands::Refused).await;
    rig.is_shown("%teleclay%demo%set_scheme", true).await;
    for (key, request) in [(PAUSE, TRUE), (RESET, EMPTY), (SCHEME, REPLICA)] {
        let bytes = answer(&rig.client, key, request, 9).await;
        // The answers of all three are alike.
        let told: TriggerResponse<'_> = from_cdr(&bytes).unwrap();
        assert!(!told.success, "{key}");
        assert!(told.message.contains("--ros2-commands"), "{}", told.message);
    }
    assert_eq!(rig.demo.calls(), []);
    rig.end().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn services_reach_the_session_and_bring_its_answer() {
    let rig = Rig::start(Commands::Taken).await;
    rig.is_shown("%teleclay%demo%set_scheme", true).await;
    let bytes = answer(&rig.client, PAUSE, TRUE, 1).await;
    let told: SetBoolResponse<'_> = from_cdr(&bytes).unwrap();
    assert_eq!((told.success, told.message), (true, "done"));
    let bytes = answer(&rig.client, RESET, EMPTY, i64::MAX).await;
    assert!(from_cdr::<TriggerResponse<'_>>(&bytes).unwrap().success);
    let bytes = answer(&rig.client, SCHEME, REPLICA, 3).await;
    // The session in this test refuses schemes.
    let told: SetSchemeResponse<'_> = from_cdr(&bytes).unwrap();
    assert_eq!((told.success, told.message), (false, "no such scheme"));
    let asked = [
        Call::Pause(true),
        Call::ResetClay,
        Call::SetScheme("replica".to_owned()),
    ];
    assert_eq!(rig.demo.calls(), asked);
    for no_request in [&TRUE[..4], &[0; 5], &[7; 2000]] {
        let bytes = answer(&rig.client, PAUSE, no_request, 4).await;
        assert!(!from_cdr::<SetBoolResponse<'_>>(&bytes).unwrap().success);
    }
    assert_eq!(rig.demo.calls().len(), asked.len());
    rig.end().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn calls_without_end_are_told_that_it_is_busy() {
    let rig = Rig::start(Commands::Taken).await;
    rig.is_shown("%teleclay%demo%pause", true).await;
    let calls = (1..=40).map(|number| answer(&rig.client, PAUSE, TRUE, number));
    let answers = rig::together(calls).await;
    let told = answers
        .iter()
        .map(|bytes| from_cdr::<SetBoolResponse<'_>>(bytes).unwrap());
    let busy = told
        .filter(|told| !told.success && told.message.contains("other calls"))
        .count();
    let done = rig.demo.calls().len();
    assert_eq!(busy + done, 40);
    // Eight wait, one is being carried out, and some more as long as the calls take to come.
    assert!((8..40).contains(&done), "{done}");
    rig.end().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn sessions_come_and_go_and_one_that_cannot_be_told_apart_waits() {
    let rig = Rig::start(Commands::Refused).await;
    rig.is_shown("%teleclay%demo%events", true).await;
    rig.host.add("two-parts", 2);
    rig.is_shown("%teleclay%two_parts%events", true).await;
    // The same name on ROS 2: nothing of it until the other is gone.
    let twin = rig.host.add("two_parts", 3);
    rig.host.add("last", 4);
    rig.is_shown("%teleclay%last%events", true).await;
    assert_eq!(twin.samples.receiver_count(), 0);
    rig.host.remove(2);
    until("the twin is told of", || 0 < twin.samples.receiver_count()).await;
    rig.is_shown("%teleclay%two_parts%events", true).await;
    rig.host.remove(3);
    rig.is_shown("%teleclay%two_parts%events", false).await;
    rig.is_shown("%teleclay%two_parts%pause", false).await;
    rig.end().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_router_that_is_missing_or_goes_is_known_and_one_that_comes_is_found() {
    let port = rig::free_port();
    let host = rig::FakeHost::default();
    let demo = host.add("demo", 1);
    let ros2 = teleclay_ros2::Ros2::start(config(port, Commands::Refused), host);
    assert!(!ros2.status().router_is_up());
    let mut heard_after = Vec::new();
    for _ in 0..2 {
        let router = Router::open(port).await;
        until("the router is found", || ros2.status().router_is_up()).await;
        let client = rig::client(port).await;
        let wrenches = client.declare_subscriber(WRENCH).await.unwrap();
        let mut tick = 0;
        let first = loop {
            tick += 1;
            let _ = demo.samples.send(sample(1, tick));
            if let Ok(Some(put)) = wrenches.try_recv() {
                break put;
            }
            rig::pause().await;
        };
        heard_after.push(first);
        client.close().await.unwrap();
        router.close().await;
        until("the router is missed", || !ros2.status().router_is_up()).await;
    }
    assert_eq!(heard_after.len(), 2);
    ros2.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_character_of_type_or_hash_is_noticed_of_topics_and_of_services() {
    let rig = Rig::start(Commands::Refused).await;
    rig.is_shown("%teleclay%demo%pause", true).await;
    let zid = rig.client.zid();
    let show = async |end: u32, kind: &str, topic: &str| {
        let token = format!("@ros2_lv/0/{zid}/0/{end}/{kind}/%/%/viewer/{topic}/2::,1:,:,:,,");
        rig.client.liveliness().declare_token(token).await.unwrap()
    };
    let strangers = || rig.ros2.status().strangers();
    let parts = |key: &str| {
        let (name, typed) = key.trim_start_matches("0/").rsplit_once('/').unwrap();
        let (name, dds_type) = name.rsplit_once('/').unwrap();
        (
            format!("%{}", name.replace('/', "%")),
            dds_type.to_owned(),
            typed.to_owned(),
        )
    };
    let (topic, dds_type, hash) = parts(WRENCH);
    let (service, service_type, service_hash) = parts(PAUSE);
    let alike = show(1, "MS", &format!("{topic}/{dds_type}/{hash}")).await;
    let other_hash = show(
        2,
        "MS",
        &format!("{topic}/{dds_type}/{}8", &hash[..hash.len() - 1]),
    )
    .await;
    until("another hash is noticed", || strangers() == 1).await;
    let other_type = dds_type.replace("Stamped_", "stamped_");
    let other_type = show(3, "MP", &format!("{topic}/{other_type}/{hash}")).await;
    until("another type is noticed", || strangers() == 2).await;
    let service_hash = service_hash.replace("RIHS01_a", "RIHS01_b");
    let caller = show(4, "SC", &format!("{service}/{service_type}/{service_hash}")).await;
    until("a caller with another hash is noticed", || strangers() == 3).await;
    for token in [other_hash, other_type, caller] {
        token.undeclare().await.unwrap();
    }
    until("nobody is left of them", || strangers() == 0).await;
    alike.undeclare().await.unwrap();
    rig.end().await;
}
