//! Checks docker/Dockerfile without Docker: what it copies exists, what it builds on is pinned, what it makes is careful.

use std::fs;

use anyhow::{Context, Result};

use crate::tools::{Version, wanted_node};
use crate::workspace::{Workspace, root};

/// What the build may not be sent: it would be slow, or differ from a fresh clone.
const MUST_BE_IGNORED: [&str; 3] = [".git", "target", "**/node_modules"];

/// What is wrong with the image's description, one sentence each.
pub(super) fn check(workspace: &Workspace) -> Result<Vec<String>> {
    let folder = root().join("docker");
    let read = |name: &str| {
        let path = folder.join(name);
        fs::read_to_string(&path).with_context(|| format!("{} cannot be read", path.display()))
    };
    let recipe = Recipe::parse(&read("Dockerfile")?);
    let exists = |name: &str| root().join(name).exists();
    let programs: Vec<&str> = workspace
        .members
        .iter()
        .flat_map(|member| member.programs.iter().map(String::as_str))
        .collect();
    let mut wrong = recipe.mistakes(exists, &programs);
    wrong.extend(recipe.wrong_versions(&toolchain()?, wanted_node()?));
    let ignored = read("Dockerfile.dockerignore")?;
    for name in MUST_BE_IGNORED {
        if !ignored.lines().any(|line| line.trim() == name) {
            wrong.push(format!("Dockerfile.dockerignore does not name {name}"));
        }
    }
    Ok(wrong)
}

/// The instructions of a Dockerfile, continued lines joined and build arguments filled in.
struct Recipe {
    instructions: Vec<Instruction>,
}

struct Instruction {
    line: usize,
    word: String,
    rest: String,
}

impl Recipe {
    fn parse(text: &str) -> Self {
        let mut instructions: Vec<Instruction> = Vec::new();
        let mut continues = false;
        for (index, line) in text.lines().enumerate() {
            let line = line.trim();
            if line.is_empty() || line.starts_with('#') {
                continue;
            }
            let (part, goes_on) = match line.strip_suffix('\\') {
                Some(part) => (part.trim_end(), true),
                None => (line, false),
            };
            match instructions.last_mut() {
                Some(last) if continues => {
                    last.rest.push(' ');
                    last.rest.push_str(part);
                }
                _ => {
                    let (word, rest) = part.split_once(char::is_whitespace).unwrap_or((part, ""));
                    instructions.push(Instruction {
                        line: index + 1,
                        word: word.to_ascii_uppercase(),
                        rest: rest.trim().to_owned(),
                    });
                }
            }
            continues = goes_on;
        }
        Self { instructions }
    }

    fn all<'a>(&'a self, word: &'a str) -> impl Iterator<Item = &'a Instruction> {
        self.instructions
            .iter()
            .filter(move |instruction| instruction.word == word)
    }

    fn mistakes(&self, exists: impl Fn(&str) -> bool, programs: &[&str]) -> Vec<String> {
        let mut wrong = Vec::new();
        let mut stages: Vec<&str> = Vec::new();
        for instruction in &self.instructions {
            let mut complain =
                |what: String| wrong.push(format!("Dockerfile:{}: {what}", instruction.line));
            match instruction.word.as_str() {
                "FROM" => {
                    let base = instruction.base();
                    if !stages.contains(&base) && tag(base).is_none_or(|tag| tag == "latest") {
                        complain(format!("{base} is not pinned to a version"));
                    }
                    stages.push(instruction.stage().unwrap_or(base));
                }
                "COPY" => match instruction.flag("from") {
                    Some(stage) if !stages.contains(&stage) => {
                        complain(format!("no stage before this one is called {stage}"));
                    }
                    Some(_) => {
                        for program in instruction
                            .programs()
                            .filter(|name| !programs.contains(name))
                        {
                            complain(format!("the workspace makes no program {program}"));
                        }
                    }
                    None => {
                        for source in instruction.sources().filter(|source| !exists(source)) {
                            complain(format!("{source} does not exist"));
                        }
                    }
                },
                "ADD" => {
                    complain("COPY says what it does; ADD also unpacks and downloads".to_owned())
                }
                _ => {}
            }
        }
        wrong.extend(self.careless_end());
        wrong
    }

    /// What the last stage, which is the image, forgets.
    fn careless_end(&self) -> Vec<String> {
        let begin = self
            .instructions
            .iter()
            .rposition(|i| i.word == "FROM")
            .unwrap_or(0);
        let last = |word: &str| {
            let instructions = &self.instructions[begin..];
            instructions
                .iter()
                .rev()
                .find(|i| i.word == word)
                .map(|i| i.rest.as_str())
        };
        let mut wrong = Vec::new();
        let user = last("USER").unwrap_or("root");
        if matches!(user.split(':').next(), Some("root" | "0")) {
            wrong.push("Dockerfile: the image runs as root".to_owned());
        }
        if !last("HEALTHCHECK").is_some_and(|check| check.contains("CMD [")) {
            wrong.push(
                "Dockerfile: the image has no HEALTHCHECK that does without a shell".to_owned(),
            );
        }
        if !last("ENTRYPOINT").is_some_and(|entry| entry.starts_with('[')) {
            wrong.push(
                "Dockerfile: ENTRYPOINT is no list, so a shell would swallow SIGTERM".to_owned(),
            );
        }
        wrong
    }

    /// The image must build with the toolchain that everything else is checked with.
    fn wrong_versions(&self, rust: &str, node: Version) -> Vec<String> {
        let mut wrong = Vec::new();
        for base in self.all("FROM").map(Instruction::base) {
            let version = tag(base).and_then(Version::parse);
            if base.starts_with("rust:") && version != Version::parse(rust) {
                wrong.push(format!(
                    "Dockerfile: {base} is not the toolchain {rust} of rust-toolchain.toml"
                ));
            }
            if base.starts_with("node:") && version.is_none_or(|version| version < node) {
                wrong.push(format!(
                    "Dockerfile: {base} is older than the Node.js {node} that the dashboard needs"
                ));
            }
        }
        wrong
    }
}

impl Instruction {
    fn words(&self) -> impl DoubleEndedIterator<Item = &str> {
        self.rest
            .split_whitespace()
            .filter(|word| !word.starts_with("--"))
    }

    fn flag(&self, name: &str) -> Option<&str> {
        let flags = self
            .rest
            .split_whitespace()
            .filter_map(|word| word.strip_prefix("--"));
        let pairs = flags.filter_map(|flag| flag.split_once('='));
        pairs
            .filter(|(key, _)| *key == name)
            .map(|(_, value)| value)
            .next()
    }

    /// What a stage builds on.
    fn base(&self) -> &str {
        self.words().next().unwrap_or_default()
    }

    /// What a stage is called.
    fn stage(&self) -> Option<&str> {
        let mut words = self.words().skip(1);
        words
            .next()
            .filter(|word| word.eq_ignore_ascii_case("as"))?;
        words.next()
    }

    fn sources(&self) -> impl Iterator<Item = &str> {
        self.words().rev().skip(1)
    }

    /// Programs of ours among the sources.
    fn programs(&self) -> impl Iterator<Item = &str> {
        self.sources()
            .filter_map(|source| source.rsplit('/').next())
            .filter(|name| name.starts_with("teleclay-"))
    }
}

fn tag(base: &str) -> Option<&str> {
    base.rsplit_once(':').map(|(_, tag)| tag)
}

/// The channel that rust-toolchain.toml names.
fn toolchain() -> Result<String> {
    let path = root().join("rust-toolchain.toml");
    let text =
        fs::read_to_string(&path).with_context(|| format!("{} cannot be read", path.display()))?;
    text.lines()
        .find_map(|line| line.strip_prefix("channel"))
        .map(|rest| rest.trim_matches([' ', '=', '"']).to_owned())
        .with_context(|| format!("{} names no channel", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = r#"
# two stages
FROM rust:1.95.0-slim AS programs
COPY crates \
     # a comment in between
     Cargo.toml ./
FROM debian:bookworm-slim
COPY --from=programs /src/target/release/teleclay-server /usr/local/bin/
USER 10001:10001
HEALTHCHECK --interval=5s CMD ["teleclay-server", "health"]
ENTRYPOINT ["teleclay-server"]
"#;

    fn complaints(text: &str) -> String {
        let exists = |name: &str| ["crates", "Cargo.toml"].contains(&name);
        let recipe = Recipe::parse(text);
        let mut wrong = recipe.mistakes(exists, &["teleclay-server"]);
        wrong.extend(recipe.wrong_versions("1.95.0", Version::parse("20.19").unwrap()));
        wrong.join("\n")
    }

    #[test]
    fn a_sound_image_has_no_mistakes() {
        assert_eq!(complaints(GOOD), "");
    }

    #[test]
    fn each_mistake_is_found() {
        for (right, wrong, word) in [
            ("Cargo.toml ./", "Cargo.tml ./", "Cargo.tml does not exist"),
            (
                "COPY crates",
                "COPY crate",
                "Dockerfile:4: crate does not exist",
            ),
            ("--from=programs", "--from=program", "no stage"),
            (
                "teleclay-server /usr",
                "teleclay-sever /usr",
                "no program teleclay-sever",
            ),
            ("USER 10001:10001", "USER 0:0", "root"),
            ("USER 10001:10001", "USER root", "root"),
            ("USER 10001:10001", "", "root"),
            (
                r#"CMD ["teleclay-server", "health"]"#,
                "CMD curl localhost",
                "HEALTHCHECK",
            ),
            (
                r#"ENTRYPOINT ["teleclay-server"]"#,
                "ENTRYPOINT teleclay-server",
                "SIGTERM",
            ),
            ("debian:bookworm-slim", "debian", "not pinned"),
            ("debian:bookworm-slim", "debian:latest", "not pinned"),
            ("rust:1.95.0-slim", "rust:1.94.0-slim", "toolchain"),
            ("debian:bookworm-slim", "node:20.11-slim", "older"),
            ("USER", "ADD x.tar /\nUSER", "ADD"),
        ] {
            let text = GOOD.replace(right, wrong);
            assert_ne!(text, GOOD);
            assert!(
                complaints(&text).contains(word),
                "{word}: {}",
                complaints(&text)
            );
        }
    }
}
