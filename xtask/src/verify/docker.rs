//! docker/ without Docker: other people's linters say whether image and compose file are sound; what this project
//! promises of them is asked here.

use std::fs;

use anyhow::{Context, Result};

use super::members::members;
use crate::process::run;
use crate::python;
use crate::tools::{version, wanted_node};
use crate::workspace::root;

/// What each container gives up.
const GIVEN_UP: [&str; 3] = [
    "cap_drop: [ALL]",
    "no-new-privileges:true",
    "read_only: true",
];

/// What is wrong in docker/, one sentence each.
pub(super) fn check() -> Result<Vec<String>> {
    python::install()?;
    run(python::script("hadolint").arg(root().join("docker/Dockerfile")))?;
    let compose = root().join("docker/compose.yaml");
    let schema = ["--builtin-schema", "vendor.compose-spec"];
    run(python::script("check-jsonschema").args(schema).arg(compose))?;
    Ok(Texts::read()?.broken_promises(|path| root().join(path).exists()))
}

/// Whether it is kept, and what is wrong when it is not.
type Promise = (bool, String);

fn of_a_service(service: &str) -> Vec<Promise> {
    let name = service.lines().next().unwrap_or_default().trim();
    let has = |text: &str| service.contains(text);
    // `${NAME:?words}` has compose stop with those words when the variable is unset or empty.
    let is_guarded = !has("0.0.0.0") || has("TELECLAY_TOKEN: ${TELECLAY_TOKEN:?");
    let waits = !has("depends_on:") || has("condition: service_healthy");
    let mut promises = vec![
        (
            is_guarded,
            format!("{name} listens beyond loopback and does not insist on a token"),
        ),
        (
            waits,
            format!("{name} starts before what it needs is healthy"),
        ),
    ];
    let published = service
        .lines()
        .filter_map(|line| line.trim().strip_prefix("ports: "));
    for port in published.flat_map(|list| list.split('"').skip(1).step_by(2)) {
        let is_local = port.starts_with("127.0.0.1:");
        promises.push((
            is_local,
            format!("{name} port {port} is published beyond this machine"),
        ));
    }
    promises
        .extend(GIVEN_UP.map(|given_up| (has(given_up), format!("{name} is without {given_up}"))));
    promises
}

/// What is looked at.
#[derive(Clone)]
struct Texts {
    image: String,
    compose: String,
    ignored: String,
    toolchain: String,
    node: String,
    settings: String,
    members: Vec<String>,
}

impl Texts {
    fn read() -> Result<Self> {
        let read = |name: &str| {
            fs::read_to_string(root().join(name)).with_context(|| format!("{name} cannot be read"))
        };
        let member = |folder: &std::path::Path| {
            let place = folder.strip_prefix(root()).unwrap_or(folder);
            place.to_string_lossy().trim_end_matches('/').to_owned()
        };
        Ok(Self {
            image: read("docker/Dockerfile")?,
            compose: read("docker/compose.yaml")?,
            ignored: read("docker/Dockerfile.dockerignore")?,
            toolchain: read("rust-toolchain.toml")?,
            node: wanted_node()?,
            settings: read("server/src/settings.rs")?,
            members: members()?
                .iter()
                .map(|found| member(&found.folder))
                .collect(),
        })
    }

    fn broken_promises(&self, exists: impl Fn(&str) -> bool) -> Vec<String> {
        let mut promises = self.of_the_image();
        let copied = self.said("COPY ").filter(|rest| !rest.starts_with("--"));
        let copied = copied.flat_map(|rest| rest.split(' ').rev().skip(1));
        for needed in copied.chain(self.members.iter().map(String::as_str)) {
            let is_sent = exists(needed) && !self.is_ignored(needed);
            promises.push((is_sent, format!("{needed} does not reach the build")));
        }
        for ignored in [".git", "target", "client-web/node_modules"] {
            promises.push((
                self.is_ignored(ignored),
                format!("{ignored} is sent to the build"),
            ));
        }
        let services = self
            .compose
            .split("\nservices:\n")
            .nth(1)
            .unwrap_or_default();
        let services: Vec<&str> = services
            .split("\n\n")
            .filter(|block| block.starts_with("  "))
            .collect();
        promises.push((
            services.len() == 2,
            format!("{} services, not server and handle", services.len()),
        ));
        promises.extend(services.into_iter().flat_map(of_a_service));
        promises.retain(|(is_kept, _)| !is_kept);
        promises.into_iter().map(|(_, broken)| broken).collect()
    }

    /// What follows a word of the Dockerfile, for each line that begins with it.
    fn said(&self, word: &'static str) -> impl DoubleEndedIterator<Item = &str> {
        self.image
            .lines()
            .filter_map(move |line| line.strip_prefix(word))
    }

    fn of_the_image(&self) -> Vec<Promise> {
        let last = |word: &'static str| self.said(word).next_back().unwrap_or_default();
        let user = last("USER ").split(':').next().unwrap_or_default();
        let asks_itself = last("HEALTHCHECK ").contains(r#"CMD ["teleclay-server""#);
        let data = last("ENV TELECLAY_DATA_DIR=");
        let mut promises = vec![
            (
                !data.is_empty() && last("VOLUME ") == data,
                "the server cannot write to its data folder: it is no volume".to_owned(),
            ),
            (
                !["", "root", "0"].contains(&user),
                "the image runs as root".to_owned(),
            ),
            (
                asks_itself,
                "the image does not ask its own server whether it is healthy".to_owned(),
            ),
        ];
        let channel = self
            .toolchain
            .lines()
            .find(|line| line.starts_with("channel"));
        for base in self.said("FROM ") {
            let is_pinned =
                !base.starts_with("rust:") || version(base) == version(channel.unwrap_or_default());
            promises.push((
                is_pinned,
                format!("{base}: not the toolchain of rust-toolchain.toml"),
            ));
            let is_new = !base.starts_with("node:") || version(&self.node) <= version(base);
            promises.push((
                is_new,
                format!("{base}: the dashboard needs Node.js {}", self.node),
            ));
        }
        for port in last("EXPOSE ").split_whitespace() {
            // Zenoh's slow state goes over the port after its own.
            let before = port
                .parse()
                .map_or(0, |port: u16| port.saturating_sub(1))
                .to_string();
            let is_known = [port, &before]
                .iter()
                .any(|port| self.settings.contains(port));
            promises.push((is_known, format!("port {port} is none of the server's")));
        }
        promises
    }

    /// Whether Docker leaves this path out; the last line that speaks of it decides.
    fn is_ignored(&self, path: &str) -> bool {
        let speaks_of = |pattern: &str| match pattern.strip_prefix("**/") {
            Some(name) => path.split('/').any(|part| match name.strip_prefix('*') {
                Some(end) => part.ends_with(end),
                None => part == name,
            }),
            None => path
                .strip_prefix(pattern)
                .is_some_and(|rest| rest.is_empty() || rest.starts_with('/')),
        };
        let lines = self.ignored.lines().filter(|line| !line.starts_with('#'));
        let mut said = lines.filter_map(|line| match line.strip_prefix('!') {
            Some(pattern) => speaks_of(pattern).then_some(false),
            None => speaks_of(line).then_some(true),
        });
        said.next_back().unwrap_or(false)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn complaints(texts: &Texts) -> String {
        texts
            .broken_promises(|path| root().join(path).exists())
            .join("\n")
    }

    #[test]
    fn each_promise_that_is_broken_is_found() {
        let sound = Texts::read().unwrap();
        assert_eq!(complaints(&sound), "");
        for (right, wrong, word) in [
            ("USER 10001:10001", "USER 0:0", "root"),
            ("USER 10001:10001", "", "root"),
            (
                r#"CMD ["teleclay-server", "--health"#,
                "CMD curl localhost",
                "healthy",
            ),
            ("VOLUME /data", "", "no volume"),
            ("FROM rust:1.", "FROM rust:0.", "toolchain"),
            ("FROM node:20.19", "FROM node:20.18", "Node.js"),
            ("EXPOSE 8080", "EXPOSE 8088", "port 8088"),
            ("COPY client-web ./", "COPY client-wev ./", "client-wev"),
            (
                "\n!docs/latency/table.json",
                "",
                "docs/latency/table.json does not reach",
            ),
            ("\ndocs\n", "\ndocs\ncrates\n", "crates/clay does not reach"),
            ("**/node_modules", "", "node_modules is sent"),
            (
                "\"127.0.0.1:8080:8080\"",
                "\"8080:8080\"",
                "beyond this machine",
            ),
            ("{TELECLAY_TOKEN:?a", "{TELECLAY_TOKEN:-a", "token"),
            ("service_healthy", "service_started", "starts before"),
            ("cap_drop: [ALL]", "", "cap_drop"),
            ("\nservices:\n", "\nservice:\n", "0 services"),
        ] {
            let mut texts = sound.clone();
            for text in [&mut texts.image, &mut texts.compose, &mut texts.ignored] {
                *text = text.replace(right, wrong);
            }
            assert!(
                complaints(&texts).contains(word),
                "{word}: {}",
                complaints(&texts)
            );
        }
    }
}
