//! Connections that do not do as they should.

use std::io::{Read as _, Write as _};
use std::time::Instant;

use crate::rig::{PATIENCE, shared};
use crate::wire::{Answer, Ask, Site};

/// One byte more than a body may have.
const TOO_MANY: usize = 64 * 1024 + 1;

fn raw(site: &Site, bytes: &[u8]) -> Answer {
    let mut stream = site.connect();
    stream.write_all(bytes).unwrap();
    Answer::read(&mut stream)
}

#[test]
fn a_body_that_is_too_large_is_refused_however_it_is_framed() {
    let site = shared().site();
    let head = format!(
        "POST /api/v1/sessions HTTP/1.1\r\nHost: {}\r\nConnection: close\r\nContent-Type: application/json\r\n",
        site.address
    );
    let spaces = " ".repeat(TOO_MANY);
    let answers = [
        raw(
            &site,
            format!("{head}Content-Length: {TOO_MANY}\r\n\r\n{spaces}").as_bytes(),
        ),
        // Announced only: nothing needs to be read to refuse it.
        raw(
            &site,
            format!("{head}Content-Length: 99999999999\r\n\r\n").as_bytes(),
        ),
        raw(
            &site,
            format!(
                "{head}Transfer-Encoding: chunked\r\n\r\n{TOO_MANY:x}\r\n{spaces}\r\n0\r\n\r\n"
            )
            .as_bytes(),
        ),
    ];
    for answer in answers {
        assert_eq!((answer.status, &*answer.word()), (413, "too-large"));
    }
    let fits = " ".repeat(TOO_MANY - 1);
    let answer = raw(
        &site,
        format!("{head}Content-Length: {}\r\n\r\n{fits}", TOO_MANY - 1).as_bytes(),
    );
    assert_eq!((answer.status, &*answer.word()), (400, "syntax"));
}

#[test]
fn a_body_that_never_comes_is_given_up() {
    let site = shared().site();
    let asked = Instant::now();
    let answer = site.send(
        &Ask::new("POST", "/api/v1/sessions")
            .json("{")
            .with("Content-Length", "100"),
    );
    assert_eq!((answer.status, &*answer.word()), (408, "slow-body"));
    assert!(asked.elapsed() < PATIENCE / 2, "{:?}", asked.elapsed());
}

#[test]
fn a_body_that_is_framed_wrongly_is_refused() {
    let site = shared().site();
    let head = format!(
        "POST /api/v1/sessions HTTP/1.1\r\nHost: {}\r\nConnection: close\r\nContent-Type: application/json\r\n",
        site.address
    );
    for rest in [
        "Transfer-Encoding: chunked\r\n\r\nzz\r\n{}\r\n0\r\n\r\n",
        "Transfer-Encoding: chunked\r\n\r\nfffffffffffffffff\r\n{}\r\n0\r\n\r\n",
        "Transfer-Encoding: gzip\r\n\r\n{}",
        "Content-Length: -1\r\n\r\n{}",
        "Content-Length: 2\r\nContent-Length: 3\r\n\r\n{}",
    ] {
        let answer = raw(&site, format!("{head}{rest}").as_bytes());
        assert!((400..500).contains(&answer.status), "{rest:?}: {answer:?}");
    }
}

/// What is no HTTP at all never reaches the interface; the connection ends, and the server goes on.
#[test]
fn nonsense_ends_the_connection_and_nothing_else() {
    let site = shared().site();
    let endless = format!("GET /healthz HTTP/1.1\r\nX: {}", "y".repeat(1 << 20));
    let many: String = (0..5000).map(|n| format!("X{n}: y\r\n")).collect();
    let many = format!("GET /healthz HTTP/1.1\r\n{many}\r\n");
    for bytes in [
        &b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03"[..],
        b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n",
        b"\0\0\0\0\r\n\r\n",
        b"GET\r\n\r\n",
        b"GET /healthz HTTP/9.9\r\n\r\n",
        b"GET /healthz HTTP/1.1\r\nHost\r\n\r\n",
        b"GET /healthz HTTP/1.1\r\nHo st: x\r\n\r\n",
        b"GET /healthz HTTP/1.1\r\nX: \x01\r\n\r\n",
        endless.as_bytes(),
        many.as_bytes(),
    ] {
        let mut stream = site.connect();
        // The server may hang up before everything is written.
        stream.write_all(bytes).ok();
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).ok();
        let is_refusal = answer.is_empty() || answer.starts_with(b"HTTP/1.1 4");
        let shown = String::from_utf8_lossy(&answer);
        assert!(is_refusal, "{:?}: {shown}", &bytes[..bytes.len().min(60)]);
        assert_eq!(site.get("/healthz").status, 200);
    }
}

#[test]
fn a_connection_answers_one_request_after_the_other() {
    let site = shared().site();
    let mut stream = site.connect();
    let ask = |path: &str, connection: &str| {
        format!(
            "GET {path} HTTP/1.1\r\nHost: {}\r\nConnection: {connection}\r\n\r\n",
            site.address
        )
    };
    // All at once: the answers must come in the same order.
    let asked = [
        ask("/api/v1/sessions/none", "keep-alive"),
        ask("/nothing", "keep-alive"),
        ask("/healthz", "close"),
    ];
    stream.write_all(asked.concat().as_bytes()).unwrap();
    let mut answers = String::new();
    stream.read_to_string(&mut answers).unwrap();
    let statuses: Vec<_> = answers
        .match_indices("HTTP/1.1 ")
        .map(|(at, head)| &answers[at + head.len()..at + head.len() + 3])
        .collect();
    assert_eq!(statuses, ["404", "404", "200"]);
}

/// More connections than there may be, all of one address, none of which asks for anything.
#[test]
fn connections_that_ask_for_nothing_keep_nobody_out() {
    let site = shared().serve(|_| {});
    let mut silent = Vec::new();
    for number in 0..700 {
        silent.push(site.connect());
        if number % 50 == 0 {
            let asked = Instant::now();
            assert_eq!(site.get("/healthz").status, 200, "beside {number}");
            assert!(asked.elapsed().as_secs() < 1, "{:?}", asked.elapsed());
        }
    }
    // Half a head is nothing either.
    for stream in &mut silent {
        stream.write_all(b"GET /healthz HT").ok();
    }
    assert_eq!(site.get("/healthz").status, 200);
    // Of all these, the server has kept a page's worth or two.
    let mut kept = 0;
    for mut stream in silent {
        stream.set_nonblocking(true).unwrap();
        let mut byte = [0];
        match stream.read(&mut byte) {
            Err(error) if error.kind() == std::io::ErrorKind::WouldBlock => kept += 1,
            _ => {}
        }
    }
    assert!(kept <= 32, "{kept} were kept");
}
