//! What the program writes on standard error, for programs that collect such lines.

use std::io::{BufRead as _, BufReader, Write as _};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use serde_json::Value;

/// Ends the program whatever happens to the test.
struct Program(Child);

impl Drop for Program {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Two ports in a row that nobody listens on; the server takes the second one, too.
fn free_ports() -> u16 {
    loop {
        let first = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = first.local_addr().unwrap().port();
        if port < u16::MAX && TcpListener::bind(("127.0.0.1", port + 1)).is_ok() {
            return port;
        }
    }
}

#[test]
fn each_line_of_a_log_in_json_says_when_how_grave_and_of_which_session() {
    let http = free_ports();
    let data = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("logs-{}", std::process::id()));
    let child = Command::new(env!("CARGO_BIN_EXE_teleclay-server"))
        .args(["--log-format", "json", "--ephemeral", "--no-demo-session"])
        .args(["--listen", &format!("127.0.0.1:{http}")])
        .args(["--zenoh-listen", &format!("tcp/127.0.0.1:{}", free_ports())])
        .arg("--data-dir")
        .arg(&data)
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut program = Program(child);
    let lines = BufReader::new(program.0.stderr.take().unwrap()).lines();
    let (mut seen, mut of_a_session) = (0, false);
    for line in lines {
        let line = line.unwrap();
        let told: Value =
            serde_json::from_str(&line).unwrap_or_else(|error| panic!("{line}: {error}"));
        let text = |field: &str| told[field].as_str().unwrap_or_else(|| panic!("{line}"));
        assert!(text("timestamp").ends_with('Z'), "{line}");
        assert!(["INFO", "WARN", "ERROR"].contains(&text("level")), "{line}");
        assert!(text("target").starts_with("teleclay"), "{line}");
        seen += 1;
        if text("message").starts_with("dashboard at") {
            // Something of a session.
            make_and_stop(http);
        }
        if text("message").contains("has stopped the session") {
            assert_eq!((text("session"), text("level")), ("logged", "WARN"));
            of_a_session = true;
            break;
        }
    }
    assert!(of_a_session && 3 < seen, "{seen} lines");
    std::fs::remove_dir_all(&data).unwrap();
}

fn make_and_stop(port: u16) {
    for (path, body) in [
        ("/api/v1/sessions", r#"{"id":"logged"}"#),
        ("/api/v1/sessions/logged/stop", r#"{"reason":"a test"}"#),
    ] {
        let mut connection = TcpStream::connect(("127.0.0.1", port)).unwrap();
        let ask = format!(
            "POST {path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nContent-Type: application/json\r\n\
             Connection: close\r\nContent-Length: {}\r\n\r\n{body}",
            body.len()
        );
        connection.write_all(ask.as_bytes()).unwrap();
        let mut status = String::new();
        BufReader::new(connection).read_line(&mut status).unwrap();
        assert!(status.starts_with("HTTP/1.1 20"), "{path}: {status}");
    }
}
