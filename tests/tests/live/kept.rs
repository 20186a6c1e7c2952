//! What outlives the process of a server: sessions, settings, clay, history.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::{Value, json};
use teleclay_proto::http::{Session, StorageState};
use teleclay_tests::kills;
use teleclay_tests::mesh::audit;
use teleclay_tests::process::{PATIENCE, Process, program};
use teleclay_tests::stage::{DEMO, Handle, HandleOptions, Ports, Remains, Server};

use super::endings::cuts;

#[test]
fn three_kills_of_a_server_lose_no_cut_of_two_hands() {
    let report = kills::run(3, 1, |_, _| {}).unwrap();
    println!("{report}");
}

/// What a tool may clear where it stands, before anybody moves it: a hundredth of its ball of 1.1 cm3.
const STANDING_UNITS: u64 = 22_000;

/// A folder that goes with the test.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("teleclay-{name}-{}", std::process::id()));
        fs::create_dir_all(&path).unwrap();
        Self(path)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // What is left behind is only untidy.
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// A disk of so many bytes, in memory.
struct SmallDisk(Folder);

impl SmallDisk {
    fn new(bytes: u32) -> Self {
        let folder = Folder::new("disk");
        let mounted = Command::new("mount")
            .args(["-t", "tmpfs", "-o", &format!("size={bytes}"), "tmpfs"])
            .arg(&folder.0)
            .status();
        assert!(mounted.unwrap().success(), "a test like this runs as root");
        Self(folder)
    }

    fn path(&self) -> &Path {
        &self.0.0
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        // What cannot be unmounted is only untidy.
        let _ = Command::new("umount")
            .arg("--lazy")
            .arg(self.path())
            .status();
    }
}

/// The clay is cut, and every change so far is on disk.
fn is_cut_and_durable(session: &Session) -> bool {
    0 < session.clay.removed_units && session.storage.state == StorageState::Durable
}

/// A hand cuts for a while and goes.
fn cut_a_little(server: &Server, operator: &str) -> Session {
    let options = HandleOptions::new(&server.endpoint()).by(operator);
    let mut hand = Handle::start(&options).unwrap();
    let client = &server.client;
    client.session_when(DEMO, "a cut", PATIENCE, cuts).unwrap();
    client.let_pass(DEMO, 700).unwrap();
    assert!(hand.process.end().unwrap().success());
    client
        .session_when(DEMO, "all of it on disk", PATIENCE, is_cut_and_durable)
        .unwrap()
}

fn segments(data: &Path) -> Vec<PathBuf> {
    let folder = data.join("sessions/of").join(DEMO);
    let mut files: Vec<PathBuf> = fs::read_dir(folder)
        .unwrap()
        .map(|file| file.unwrap().path())
        .filter(|path| path.extension().is_some_and(|ending| ending == "segment"))
        .collect();
    files.sort();
    files
}

#[test]
fn a_second_server_on_the_same_folder_is_refused() {
    let server = Server::on_free_ports().unwrap();
    let ports = Ports::free().unwrap();
    let mut command = Command::new(program("teleclay-server").unwrap());
    command
        .args(["--listen", &format!("127.0.0.1:{}", ports.http)])
        .args(["--zenoh-listen", &format!("tcp/127.0.0.1:{}", ports.zenoh)])
        .arg("--data-dir")
        .arg(server.data());
    let mut second = Process::start("a second server", command).unwrap();
    assert!(!second.ends().unwrap().success());
    let said = second.stderr();
    assert!(
        said.contains("another server keeps its sessions in"),
        "{said}"
    );
    assert!(server.client.is_ready());
}

#[test]
fn a_folder_of_a_later_version_is_refused_in_words() {
    let folder = Folder::new("later");
    fs::create_dir_all(folder.0.join("sessions")).unwrap();
    fs::write(folder.0.join("sessions/version"), "2\n").unwrap();
    let mut command = Command::new(program("teleclay-server").unwrap());
    let ports = Ports::free().unwrap();
    command
        .args(["--listen", &format!("127.0.0.1:{}", ports.http)])
        .args(["--zenoh-listen", &format!("tcp/127.0.0.1:{}", ports.zenoh)])
        .arg("--data-dir")
        .arg(&folder.0);
    let mut server = Process::start("the server", command).unwrap();
    assert!(!server.ends().unwrap().success());
    let said = server.stderr();
    assert!(
        said.contains("later version of this program (2, and this one reads up to 1)"),
        "{said}"
    );
}

#[test]
fn a_damaged_session_is_set_aside_and_the_others_go_on() {
    let server = Server::on_free_ports().unwrap();
    server.client.create(&json!({ "id": "whole" })).unwrap();
    cut_a_little(&server, "Ada");
    let Remains { ports, data } = server.kill_and_keep().unwrap();
    let file = segments(&data).remove(0);
    let mut bytes = fs::read(&file).unwrap();
    // Well within what is durable: the records of the cut.
    bytes[3000] ^= 0x40;
    fs::write(&file, &bytes).unwrap();

    let server = Server::start_again(Remains { ports, data }).unwrap();
    let said = server.beside(&["history", DEMO, "--verify"]).unwrap_err();
    assert!(said.to_string().contains(", record "), "{said}");
    let (status, listed) = server.client.ask("/sessions").unwrap();
    assert_eq!(status, 200);
    let listed = listed.as_array().unwrap();
    assert_eq!(listed.len(), 2);
    assert_eq!(listed[0]["id"], DEMO);
    assert_eq!(listed[0]["state"], "damaged");
    let reason = listed[0]["storage"]["reason"].as_str().unwrap();
    assert!(reason.contains("record"), "{reason}");
    assert_eq!(listed[1]["id"], "whole");
    assert_eq!(listed[1]["state"], "idle");
    let (status, problem) = server.client.ask(&format!("/sessions/{DEMO}")).unwrap();
    assert_eq!(
        (status, &problem["type"]),
        (409, &json!("/problems/session-damaged"))
    );
    assert!(problem["detail"].as_str().unwrap().contains(reason));
    // Not a byte of it has changed.
    assert_eq!(fs::read(&file).unwrap(), bytes);
    server.client.delete(DEMO).unwrap();
    assert!(!file.exists());
    server.client.create(&json!({ "id": DEMO })).unwrap();
}

#[test]
fn a_disk_that_fills_up_pauses_cutting_and_goes_on_by_itself() {
    let disk = SmallDisk::new(12 << 20);
    let data = disk.path().join("data");
    fs::create_dir_all(data.join("sessions/of")).unwrap();
    // Room for names and locks, and none for a segment.
    let filler = disk.path().join("filler");
    fs::write(&filler, vec![0; 9 << 20]).unwrap();
    let server = Server::start_on_data(data).unwrap();
    let client = &server.client;
    let failed = |session: &Session| session.storage.state == StorageState::Failed;
    let full = client
        .session_when(DEMO, "the disk to fail", PATIENCE, failed)
        .unwrap();
    let reason = full.storage.reason.unwrap();
    assert!(reason.contains("No space left"), "{reason}");

    let mut hand = Handle::start(&HandleOptions::new(&server.endpoint())).unwrap();
    let connected = |session: &Session| session.tools.iter().any(|tool| tool.connected);
    client
        .session_when(DEMO, "the hand", PATIENCE, connected)
        .unwrap();
    // A tool that is taken clears the place where it stands, and from then on nothing goes.
    let standing = client.let_pass(DEMO, 100).unwrap();
    let still = client.let_pass(DEMO, 2000).unwrap();
    assert_eq!(
        still.clay.removed_units, standing.clay.removed_units,
        "nothing is cut that cannot be kept"
    );
    assert!(failed(&still));
    // What cannot be kept is not begun, and its name stays free.
    let duplicate = format!("/sessions/{DEMO}/duplicate");
    fs::write(disk.path().join("rest"), vec![0; 4 << 20]).unwrap_err();
    let (status, refused) = client.post(&duplicate, &json!({ "id": "twin" })).unwrap();
    assert_eq!(status, 503, "{refused}");
    assert!(!disk.path().join("data/sessions/of/twin").exists());
    assert!(still.storage.durable_revision < still.revision);

    fs::remove_file(&filler).unwrap();
    fs::remove_file(disk.path().join("rest")).unwrap();
    let (status, made) = client.post(&duplicate, &json!({ "id": "twin" })).unwrap();
    assert_eq!(status, 201, "{made}");
    client
        .session_when(
            DEMO,
            "a cut that is kept",
            PATIENCE,
            is_cut_and_durable_or_behind,
        )
        .unwrap();
    assert!(hand.process.end().unwrap().success());
    client
        .session_when(DEMO, "all of it on disk", PATIENCE, is_cut_and_durable)
        .unwrap();
}

fn is_cut_and_durable_or_behind(session: &Session) -> bool {
    100_000 < session.clay.removed_units && session.storage.state != StorageState::Failed
}

#[test]
fn a_copy_made_while_the_server_cuts_is_a_session() {
    let server = Server::on_free_ports().unwrap();
    let mut hand = Handle::start(&HandleOptions::new(&server.endpoint())).unwrap();
    let client = &server.client;
    client.session_when(DEMO, "a cut", PATIENCE, cuts).unwrap();
    let before = client.session(DEMO).unwrap();
    client.let_pass(DEMO, 200).unwrap();
    let copy = Folder::new("copy");
    let to = copy.0.join("sessions/of").join(DEMO);
    fs::create_dir_all(&to).unwrap();
    let from = server.data().join("sessions/of").join(DEMO);
    for ending in ["snapshot", "segment", "block"] {
        for file in fs::read_dir(&from).unwrap() {
            let path = file.unwrap().path();
            if path.extension().is_some_and(|its| its == ending) {
                fs::copy(&path, to.join(path.file_name().unwrap())).unwrap();
            }
        }
    }
    assert!(hand.process.end().unwrap().success());
    let after = client.session(DEMO).unwrap();
    let again = Server::start_on_data(copy.0.clone()).unwrap();
    let copied = again.client.session(DEMO).unwrap();
    let range = after.clay.remaining_units..=before.clay.remaining_units;
    assert!(range.contains(&copied.clay.remaining_units), "{copied:?}");
    let said = again.beside(&["history", DEMO, "--verify"]).unwrap();
    assert!(
        said.last()
            .unwrap()
            .starts_with("every record and every snapshot agree"),
        "{said:?}"
    );
}

fn history(server: &Server) -> Vec<Value> {
    let (status, history) = server
        .client
        .ask(&format!("/sessions/{DEMO}/history"))
        .unwrap();
    assert_eq!(status, 200, "{history}");
    history["strokes"].as_array().unwrap().clone()
}

#[test]
fn a_stroke_of_one_operator_is_undone_under_the_other_and_redone_and_all_of_it_outlives_a_kill() {
    let server = Server::on_free_ports().unwrap();
    let first = cut_a_little(&server, "Ada");
    let second = cut_a_little(&server, "Bob");
    assert!(second.clay.remaining_units <= first.clay.remaining_units);
    let strokes = history(&server);
    let of = |name: &'static str| {
        strokes
            .iter()
            .filter(move |stroke| stroke["operator"] == name)
    };
    assert!(
        0 < of("Ada").count() && 0 < of("Bob").count(),
        "{strokes:?}"
    );

    // What was before Bob came, to the last bit, and as a file.
    let since = of("Bob").next().unwrap()["number"].clone();
    let path = |what: &str| format!("/sessions/{DEMO}/{what}");
    let (status, undone) = server
        .client
        .post(&path("undo"), &json!({ "since": since }))
        .unwrap();
    assert_eq!(status, 200, "{undone}");
    assert_eq!(
        undone["clay"]["hash"],
        serde_json::to_value(first.clay.hash).unwrap()
    );
    assert_eq!(undone["clay"]["epoch"], first.clay.epoch + 1);
    let at_s = of("Ada").next_back().unwrap()["to_s"].as_f64().unwrap();
    let then = server
        .client
        .bytes(&path(&format!("clay.stl?at_s={at_s}")))
        .unwrap();
    let [then, now] =
        [then, server.client.stl(DEMO).unwrap()].map(|stl| audit(&stl).unwrap().volume);
    assert!(
        (then - now).abs() < 1e-9 * now,
        "{then} mm3 then, {now} now"
    );

    for number in of("Bob").map(|stroke| &stroke["number"]) {
        let (status, redone) = server.client.post(&path("redo"), &json!({})).unwrap();
        assert_eq!(status, 200, "{number}: {redone}");
    }
    let back = server.client.session(DEMO).unwrap();
    assert_eq!(back.clay.hash, second.clay.hash);
    let (status, problem) = server.client.post(&path("redo"), &json!({})).unwrap();
    assert_eq!(
        (status, &problem["type"]),
        (409, &json!("/problems/nothing-there"))
    );

    let (status, undone) = server.client.post(&path("undo"), &json!({})).unwrap();
    assert_eq!(status, 200, "{undone}");
    server
        .client
        .session_when(DEMO, "all of it on disk", PATIENCE, is_cut_and_durable)
        .unwrap();
    let server = Server::start_again(server.kill_and_keep().unwrap()).unwrap();
    let recovered = server.client.session(DEMO).unwrap();
    assert_eq!(
        serde_json::to_value(&recovered.clay).unwrap(),
        undone["clay"]
    );
    assert_eq!(recovered.revision, undone["revision"]);
    assert_eq!(history(&server).len(), strokes.len());
    let said = server.beside(&["history", DEMO, "--verify"]).unwrap();
    assert!(
        said.last()
            .unwrap()
            .starts_with("every record and every snapshot agree"),
        "{said:?}"
    );
}

#[test]
fn a_duplicate_has_the_clay_and_a_history_of_its_own() {
    let server = Server::on_free_ports().unwrap();
    let cut = cut_a_little(&server, "Ada");
    let path = format!("/sessions/{DEMO}/duplicate");
    let (status, made) = server.client.post(&path, &json!({ "id": "twin" })).unwrap();
    assert_eq!(status, 201, "{made}");
    let (status, problem) = server.client.post(&path, &json!({ "id": "twin" })).unwrap();
    assert_eq!(
        (status, &problem["type"]),
        (409, &json!("/problems/session-exists"))
    );
    let twin = server.client.session("twin").unwrap();
    assert_eq!(twin.clay.hash, cut.clay.hash);
    assert_eq!(
        (twin.clay.epoch, twin.scheme, twin.material),
        (1, cut.scheme, cut.material)
    );
    let (_, history) = server.client.ask("/sessions/twin/history").unwrap();
    assert_eq!(history["strokes"], json!([]));
    // A hand that joins sees it as it is, and cuts it; the original stays.
    let options = HandleOptions::new(&server.endpoint()).in_session("twin");
    let mut hand = Handle::start(&options).unwrap();
    server
        .client
        .session_when("twin", "a cut", PATIENCE, cuts)
        .unwrap();
    hand.process
        .logs("a copy of block 1 is here", PATIENCE)
        .unwrap();
    assert!(hand.process.end().unwrap().success());
    // The hashes that the server sends with its frames agree with the hand's copy.
    let copies: BTreeSet<String> = hand
        .ticks()
        .unwrap()
        .into_iter()
        .map(|row| row.copy)
        .collect();
    assert!(
        copies.contains("live") && !copies.contains("diverged"),
        "{copies:?}"
    );
    assert_eq!(
        server.client.session(DEMO).unwrap().clay.hash,
        cut.clay.hash
    );
    server
        .client
        .session_when("twin", "all of it on disk", PATIENCE, is_cut_and_durable)
        .unwrap();
    let twin = server.client.session("twin").unwrap();
    let server = Server::start_again(server.kill_and_keep().unwrap()).unwrap();
    let again = server.client.session("twin").unwrap();
    assert_eq!(again.clay.hash, twin.clay.hash);
}

#[test]
fn any_name_of_a_session_outlives_a_kill_and_a_deletion_that_was_left_half_way() {
    let server = Server::on_free_ports().unwrap();
    let names = ["-", "_", "0", "-demo", "lock", "of"];
    for name in names {
        server.client.create(&json!({ "id": name })).unwrap();
    }
    let remains = server.kill_and_keep().unwrap();
    let of = remains.data.join("sessions/of");
    // As a server leaves it that was killed while it removed a session.
    fs::rename(of.join("0"), of.join("~0")).unwrap();
    // And one that was killed before it had written anything of a session.
    fs::create_dir(of.join("never")).unwrap();
    fs::write(of.join("never/lock"), "").unwrap();
    let server = Server::start_again(remains).unwrap();
    let (_, listed) = server.client.ask("/sessions").unwrap();
    let listed: Vec<&str> = listed
        .as_array()
        .unwrap()
        .iter()
        .map(|session| session["id"].as_str().unwrap())
        .collect();
    assert_eq!(listed, ["-", "-demo", "_", DEMO, "lock", "of"]);
    assert!(!of.join("~0").exists() && !of.join("never").exists());
    server.client.delete("-").unwrap();
    assert!(!of.join("-").exists() && of.join("-demo").exists());
}

/// Whoever looks into the history of a session takes a turn: many at once do not take the threads by which sessions are
/// changed.
#[test]
fn many_who_look_back_at_once_take_turns() {
    const MANY: usize = 64;
    let server = Server::on_free_ports().unwrap();
    cut_a_little(&server, "Ada");
    let status = format!("/proc/{}/status", server.process.id());
    let threads = || -> usize {
        let status = fs::read_to_string(&status).unwrap();
        let line = status
            .lines()
            .find_map(|line| line.strip_prefix("Threads:"));
        line.unwrap().trim().parse().unwrap()
    };
    let before = threads();
    let client = &server.client;
    let mut most = 0;
    std::thread::scope(|scope| {
        let asking: Vec<_> = (0..MANY)
            .map(|_| scope.spawn(|| client.ask(&format!("/sessions/{DEMO}/history")).unwrap().0))
            .collect();
        while !asking
            .iter()
            .all(std::thread::ScopedJoinHandle::is_finished)
        {
            most = most.max(threads());
            client.patch(DEMO, &json!({ "deadband": 0.05 })).unwrap();
        }
        for asked in asking {
            assert_eq!(asked.join().unwrap(), 200);
        }
    });
    println!("{before} threads before, {most} at most");
    assert!(
        most < before + MANY / 4,
        "{before} threads before, {most} at most"
    );
}

#[test]
fn an_imported_mesh_is_the_same_clay_after_a_kill_and_for_a_hand() {
    let server = Server::on_free_ports().unwrap();
    let cut = cut_a_little(&server, "Ada");
    let file = server.client.stl(DEMO).unwrap();
    let path = format!("/sessions/{DEMO}/clay?fit=true");
    let imported = server.client.put_file(&path, "model/stl", &file).unwrap();
    assert_eq!(imported["clay"]["epoch"], cut.clay.epoch + 1);
    let mut hand = Handle::start(&HandleOptions::new(&server.endpoint())).unwrap();
    let client = &server.client;
    let cut_again = |session: &Session| cuts(session) && 0 < session.clay.removed_units;
    client
        .session_when(DEMO, "a cut of it", PATIENCE, cut_again)
        .unwrap();
    client.let_pass(DEMO, 300).unwrap();
    assert!(hand.process.end().unwrap().success());
    let copies: BTreeSet<String> = hand
        .ticks()
        .unwrap()
        .into_iter()
        .map(|row| row.copy)
        .collect();
    assert!(
        copies.contains("live") && !copies.contains("diverged"),
        "{copies:?}"
    );
    let before = client
        .session_when(DEMO, "all of it on disk", PATIENCE, is_cut_and_durable)
        .unwrap();
    let server = Server::start_again(server.kill_and_keep().unwrap()).unwrap();
    let after = server.client.session(DEMO).unwrap();
    assert_eq!(after.clay, before.clay);
    let (status, undone) = server
        .client
        .post(&format!("/sessions/{DEMO}/undo"), &json!({ "since": 1 }))
        .unwrap();
    assert_eq!(status, 200, "{undone}");
    // The mesh as it came, but for the place that the tool has cleared where it stood.
    let removed = undone["clay"]["removed_units"].as_u64().unwrap();
    assert!(removed <= STANDING_UNITS, "{removed} units");
    assert_eq!(
        undone["clay"]["initial_units"],
        imported["clay"]["initial_units"]
    );
}
