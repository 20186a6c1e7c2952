//! Whole runs at a terminal, with a session that only writes down what it is told.

use std::cell::RefCell;
use std::fs;
use std::io::{Cursor, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::mpsc;

use anyhow::{Result, bail};
use teleclay_study::file::{Presentation, Study};
use teleclay_study::log;
use teleclay_study_program::answers::{Answers, path};
use teleclay_study_program::conduct::{Desk, Ending};
use teleclay_study_program::session::{Remote, Shown};

const STUDY: &str = r#"{
  "name": "short", "seed": 3, "participants": 4, "question": "Which one was late?", "fresh_clay": true, "record": true,
  "stimulus": { "quantity": "delay_s", "bounds": [0.0, 0.3] },
  "procedure": { "kind": "constant_stimuli", "task": "two_intervals", "levels": [0.05, 0.1], "repetitions": 2 },
  "conditions": [ { "name": "waved", "scheme": "wave" }, { "name": "watched", "scheme": "tdpa" } ]
}"#;
/// Trials of a run.
const TRIALS: usize = 8;

#[derive(Clone, Default)]
struct Noted {
    told: Rc<RefCell<Vec<String>>>,
    refuses_after: Option<usize>,
}

impl Noted {
    fn note(&self, what: String) -> Result<()> {
        let mut told = self.told.borrow_mut();
        if self.refuses_after.is_some_and(|most| most <= told.len()) && what.starts_with("show") {
            bail!("the server has gone");
        }
        told.push(what);
        Ok(())
    }

    fn count(&self, what: &str) -> usize {
        let told = self.told.borrow();
        told.iter().filter(|told| told.starts_with(what)).count()
    }
}

impl Shown for Noted {
    fn show(&mut self, presentation: &Presentation, _line_seeds: [u64; 2]) -> Result<()> {
        self.note(format!(
            "show {} {}",
            presentation.scheme, presentation.line.delay_s
        ))
    }
    fn freshen(&mut self) -> Result<()> {
        self.note("freshen".to_owned())
    }
    fn record(&mut self, name: &str) -> Result<Option<String>> {
        self.note(format!("record {name}"))?;
        Ok(Some(name.to_owned()))
    }
    fn end_recording(&mut self, id: &str) -> Result<()> {
        self.note(format!("end {id}"))
    }
    fn stop(&mut self) -> Result<()> {
        self.note("stop".to_owned())
    }
    fn restore(&mut self) -> Result<()> {
        self.note("restore".to_owned())
    }
}

/// A folder of this test's own, empty.
fn folder(name: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    folder
}

/// Types `typed`; how it ended, what was read, and how many answers there are.
fn conduct(folder: &Path, session: &mut Noted, typed: &str) -> (Result<Ending>, String, usize) {
    let study = Study::from_json(STUDY).unwrap();
    let (mut answers, mut run) = Answers::open(folder, &study, 2).unwrap();
    let mut output = Vec::new();
    let ending = Desk {
        input: &mut Cursor::new(typed.as_bytes()),
        output: &mut output,
        session,
    }
    .conduct(&mut run, &mut answers);
    let read = String::from_utf8(output).unwrap();
    (ending, read, run.records().len())
}

/// A trial as it is typed: two intervals, then an answer.
fn trials(count: usize) -> String {
    "\n\n1\n".repeat(count)
}

#[test]
fn a_run_shows_records_asks_and_sets_the_session_back() {
    let folder = folder("whole");
    let mut session = Noted::default();
    let (ending, read, answered) = conduct(&folder, &mut session, &trials(TRIALS));
    assert_eq!((ending.unwrap(), answered), (Ending::Complete, TRIALS));
    for (what, times) in [
        ("show", 2 * TRIALS),
        ("freshen", 2 * TRIALS),
        ("record short-p002-t", TRIALS),
        ("end short-p002-t", TRIALS),
        ("restore", 1),
        ("stop", 0),
    ] {
        assert_eq!(session.count(what), times, "{what}");
    }
    assert_eq!(session.told.borrow().last().unwrap(), "restore");
    let read = read.to_lowercase();
    for word in ["waved", "watched", "wave", "tdpa", "0.05", "delay"] {
        assert!(!read.contains(word), "{word}: {read}");
    }
    assert!(read.contains("type stop") && read.contains("which one was late?"));
}

/// An end of the input stands for a process that is killed: nothing is written when that happens.
#[test]
fn an_interrupted_run_goes_on_with_the_trial_that_has_no_answer() {
    let folder = folder("interrupted");
    let mut session = Noted::default();
    let (ending, ..) = conduct(&folder, &mut session, &(trials(3) + "\n"));
    assert_eq!(ending.unwrap(), Ending::Interrupted);
    // Half a line, as a kill leaves it.
    let study = Study::from_json(STUDY).unwrap();
    let file = path(&folder, &study, 2);
    let mut text = fs::read_to_string(&file).unwrap();
    text.push_str("{\"trial\":4,\"par");
    fs::write(&file, &text).unwrap();
    let (ending, read, answered) = conduct(&folder, &mut session, &trials(TRIALS - 3));
    assert_eq!((ending.unwrap(), answered), (Ending::Complete, TRIALS));
    assert!(
        read.contains("Trial 4,") && !read.contains("Trial 3,"),
        "{read}"
    );
    let log = log::read(&fs::read_to_string(&file).unwrap())
        .unwrap()
        .unwrap();
    assert_eq!(log.records.len(), TRIALS);
}

#[test]
fn whoever_types_stop_is_let_go_of_at_once_and_for_good() {
    for (number, typed) in ["stop\n", "\nSTOP\n", "\n\nstop\n"].into_iter().enumerate() {
        let folder = folder(&format!("stop-{number}"));
        let mut session = Noted::default();
        let (ending, _, answered) = conduct(&folder, &mut session, &(trials(1) + typed));
        assert_eq!((ending.unwrap(), answered), (Ending::Withdrawn, 1));
        assert_eq!((session.count("stop"), session.count("restore")), (1, 1));
        assert_eq!(session.count("record"), session.count("end"));
        if number < 2 {
            // Nothing is asked of the server between the word and the stop.
            let told = session.told.borrow();
            let last: Vec<&str> = told[told.len() - 3..]
                .iter()
                .map(|told| &told[..4])
                .collect();
            assert_eq!(last, ["stop", "end ", "rest"]);
        }
        let study = Study::from_json(STUDY).unwrap();
        let refused = Answers::open(&folder, &study, 2).map(|_| ()).unwrap_err();
        assert!(
            refused.to_string().contains("has ended this run"),
            "{refused}"
        );
    }
}

#[test]
fn what_answers_nothing_is_asked_again() {
    let folder = folder("asked-again");
    let typed = "\n\n3\nperhaps\n2\n".to_owned() + &trials(TRIALS - 1);
    let (ending, read, answered) = conduct(&folder, &mut Noted::default(), &typed);
    assert_eq!((ending.unwrap(), answered), (Ending::Complete, TRIALS));
    assert!(
        read.contains("`perhaps` answers nothing here, wanted 1 or 2"),
        "{read}"
    );
}

#[test]
fn a_session_that_refuses_ends_the_run_and_keeps_the_answers() {
    let folder = folder("refused");
    let mut session = Noted {
        refuses_after: Some(14),
        ..Noted::default()
    };
    let (ending, _, answered) = conduct(&folder, &mut session, &trials(TRIALS));
    assert_eq!(ending.unwrap_err().to_string(), "the server has gone");
    assert!((1..TRIALS).contains(&answered));
    assert_eq!(session.count("restore"), 1);
    assert_eq!(
        session.count("record"),
        session.count("end"),
        "a recording runs on"
    );
    let (ending, _, whole) = conduct(&folder, &mut Noted::default(), &trials(TRIALS - answered));
    assert_eq!((ending.unwrap(), whole), (Ending::Complete, TRIALS));
}

#[test]
fn two_runs_do_not_write_one_file() {
    let folder = folder("locked");
    let study = Study::from_json(STUDY).unwrap();
    let _first = Answers::open(&folder, &study, 1).unwrap();
    assert!(Answers::open(&folder, &study, 1).is_err());
}

/// Answers requests as a server without recordings does, and tells what came: method, path, token, body.
fn server() -> (String, mpsc::Receiver<String>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("http://{}", listener.local_addr().unwrap());
    let (sender, receiver) = mpsc::channel();
    std::thread::spawn(move || {
        for stream in listener.incoming() {
            let Some(asked) = answer(&mut stream.unwrap()) else {
                continue;
            };
            if sender.send(asked).is_err() {
                return;
            }
        }
    });
    (address, receiver)
}

fn answer(stream: &mut TcpStream) -> Option<String> {
    let mut request = Vec::new();
    let mut byte = [0];
    while !request.ends_with(b"\r\n\r\n") {
        stream.read_exact(&mut byte).ok()?;
        request.push(byte[0]);
    }
    let head = String::from_utf8(request).unwrap();
    let value = |name: &str| {
        let line = head
            .lines()
            .find(|line| line.to_lowercase().starts_with(name))?;
        Some(line.split_once(':')?.1.trim().to_owned())
    };
    let length = value("content-length").map_or(0, |length| length.parse().unwrap());
    let mut body = vec![0; length];
    stream.read_exact(&mut body).ok()?;
    let first = head.lines().next().unwrap().trim_end_matches(" HTTP/1.1");
    let (status, answer) = if first.ends_with("/recordings") {
        ("404 Not Found", r#"{"title":"not found"}"#)
    } else if first.ends_with("/clay/reset") {
        ("409 Conflict", r#"{"detail":"a change is under way"}"#)
    } else {
        (
            "200 OK",
            r#"{"scheme":"replica","material":{"yield_stress_pa":3},"network":{},"revision":7}"#,
        )
    };
    let length = answer.len();
    write!(
        stream,
        "HTTP/1.1 {status}\r\nContent-Type: application/json\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n{answer}"
    )
    .ok()?;
    let token = value("authorization").unwrap_or_default();
    let body = String::from_utf8(body).unwrap();
    let body: String = body.split_whitespace().collect();
    Some(format!("{first} [{token}] {body}"))
}

#[test]
fn a_server_is_asked_for_scheme_line_and_material_and_set_back_to_what_it_had() {
    let (address, asked) = server();
    let study = Study::from_json(STUDY).unwrap();
    let trial = teleclay_study::run::Run::new(&study, 1)
        .unwrap()
        .next_trial()
        .unwrap();
    let mut remote =
        Remote::find(&format!("{address}/"), "demo", Some("secret".to_owned())).unwrap();
    remote.show(&trial.shown[0], [5, 6]).unwrap();
    assert_eq!(remote.record("a").unwrap(), None);
    let refused = remote.freshen().unwrap_err().to_string();
    assert!(
        refused.ends_with("answered 409: a change is under way"),
        "{refused}"
    );
    remote.stop().unwrap();
    remote.restore().unwrap();
    let base = "/api/v1/sessions/demo";
    let asked: Vec<String> = asked.iter().take(6).collect();
    assert_eq!(asked[0], format!("GET {base} [Bearer secret] "));
    assert!(
        asked[1].starts_with(&format!("PATCH {base} [Bearer secret] {{")),
        "{}",
        asked[1]
    );
    let scheme = trial.shown[0].scheme;
    for part in [
        format!("\"scheme\":\"{scheme}\""),
        "\"viscosity_pa_s_per_m\":200000.0".to_owned(),
        "\"seed\":5".to_owned(),
        "\"seed\":6".to_owned(),
        "\"outage\":null".to_owned(),
    ] {
        assert!(asked[1].contains(&part), "{part}: {}", asked[1]);
    }
    assert!(
        asked[2].starts_with(&format!("POST {base}/recordings")),
        "{}",
        asked[2]
    );
    assert!(
        asked[4].starts_with(&format!("POST {base}/stop")),
        "{}",
        asked[4]
    );
    let before = r#"{"material":{"yield_stress_pa":3},"network":{},"scheme":"replica"}"#;
    assert_eq!(asked[5], format!("PATCH {base} [Bearer secret] {before}"));
}
