//! The steps of `cargo verify`.

use anyhow::{Result, ensure};

use super::members::{all_members, members};
use super::{docker, golden, unit};
use teleclay_rules::{citations, imports, links, source, unused};

use crate::dashboard::npm;
use crate::demo::PROGRAMS;
use crate::process::{answer, command, run};
use crate::tools::{WASM, install_chromium, install_wasm_target, require_node};
use crate::workspace::{cargo, program, root, target};
use crate::{dashboard, promtool, python, release};

/// One check that passes or fails as a whole.
pub(super) struct Step {
    /// What `--only` calls it.
    pub(super) name: &'static str,
    /// What it does, for a person.
    pub(super) what: &'static str,
    pub(super) run: fn() -> Result<()>,
}

const fn step(name: &'static str, what: &'static str, run: fn() -> Result<()>) -> Step {
    Step { name, what, run }
}

/// In this order: what is quick and often wrong comes first; what needs the release programs comes after they are
/// built, and the dashboard before them, because the server carries it inside.
#[rustfmt::skip]
pub(super) const STEPS: [Step; 17] = [
    step("tools", "what the tests need is there, or is installed", tools),
    step("format", "Rust is formatted", format),
    step("source", "prose, files, imports and dependencies are as CONTRIBUTING says", source_step),
    step("links", "what documentation and comments point at is there", links_step),
    step("docker", "image, compose file and systemd unit are sound", docker_step),
    step("dashboard", "the dashboard's types, lints, unit tests and build", dashboard_step),
    step("clippy", "lints of all Rust code, tests too", clippy),
    step("rustdoc", "the documentation of the code builds, its links hold", rustdoc),
    step("wasm", "each pure crate builds for a browser", wasm),
    step("build", "the release programs", build),
    step("golden", "native code and WebAssembly get the same bits", golden_step),
    step("test", "every Rust test, unit and integration; the wire's vectors", test),
    step("doctest", "examples in the documentation of the code", doctest),
    step("python", "other people's mathematics and schemas; the wheel of python/, its lints, tests and notebooks", python_step),
    step("browser", "the dashboard in Chromium against real processes", browser),
    step("demo", "20 seconds of cargo demo", demo),
    step("tidy", "the checks left the checkout as it was", tidy),
];

fn tools() -> Result<()> {
    require_node()?;
    install_wasm_target()?;
    install_chromium()?;
    promtool::install()?;
    python::install()?;
    dashboard::install()
}

fn format() -> Result<()> {
    cargo_with("fmt --all --check")?;
    run(&mut python::wheel_cargo("fmt --check"))
}

fn source_step() -> Result<()> {
    let mut wrong = source::check(root())?;
    wrong.extend(imports::check(&all_members()?)?);
    wrong.extend(unused::check(root(), &all_members()?)?);
    report("against the rules", wrong)
}

fn links_step() -> Result<()> {
    let mut wrong = links::check(root())?;
    wrong.extend(citations::check(root())?);
    report("broken pointers", wrong)
}

fn docker_step() -> Result<()> {
    unit::check()?;
    report("mistakes in docker/", docker::check()?)
}

fn dashboard_step() -> Result<()> {
    dashboard::prepare()?;
    for script in ["typecheck", "lint", "test"] {
        run(&mut npm(&["run", script]))?;
    }
    dashboard::build()
}

/// In the release profile, so that build scripts and macros are compiled once for this and for the programs.
fn clippy() -> Result<()> {
    cargo_with("clippy --release --workspace --all-targets --locked -- -D warnings")
}

/// `[KHMH03]` looks like a link to rustdoc; the links step checks such keys against docs/papers.md. Maps name private
/// modules.
const CITATIONS_ALLOWED: &str =
    "-D warnings -A rustdoc::broken_intra_doc_links -A rustdoc::private_intra_doc_links";

fn rustdoc() -> Result<()> {
    let arguments = ["doc", "--release", "--workspace", "--no-deps", "--locked"];
    run(command(cargo())
        .args(arguments)
        .env("RUSTDOCFLAGS", CITATIONS_ALLOWED))
}

/// One by one: together they would lend each other features that one of them forgot to ask for.
fn wasm() -> Result<()> {
    let pure = [
        "crates",
        "proto",
        "channel/seal",
        "client-web/wasm",
        "client-web/mathematics",
        "client-web/hand",
        "client-web/film",
    ]
    .map(|folder| root().join(folder));
    let mut members = members()?;
    members.retain(|member| pure.iter().any(|folder| member.folder.starts_with(folder)));
    ensure!(!members.is_empty(), "there is no pure crate to check");
    for member in members {
        println!("{}", member.name);
        cargo_with(&format!(
            "check --quiet --release --locked --target {WASM} --package {}",
            member.name
        ))?;
    }
    Ok(())
}

fn build() -> Result<()> {
    release::build(&[])
}

fn golden_step() -> Result<()> {
    report("different bits", golden::check()?)
}

fn test() -> Result<()> {
    let has_nextest = answer(command(cargo()).args(["nextest", "--version"])).is_some();
    let (how, which) = if has_nextest {
        ("nextest run", "")
    } else {
        ("test", " --lib --bins --tests")
    };
    let arguments = format!("{how} --release --workspace --locked --no-fail-fast{which}");
    let mut tests = command(cargo());
    tests.args(arguments.split(' '));
    if let Some(promtool) = promtool::program() {
        tests.env(promtool::VARIABLE, promtool);
    }
    run(&mut tests)
}

/// Apart from the tests, as nextest does not run them.
fn doctest() -> Result<()> {
    cargo_with("test --release --workspace --locked --doc")
}

/// Other people's mathematics about the same loops, robots, plants and experiments, other people's ROS 2 messages, and
/// other people's reading of the interface's schemas.
fn python_step() -> Result<()> {
    python::install()?;
    // Of the whole workspace, so that nothing is compiled again with other features.
    cargo_with("build --release --workspace --locked --example analyse_loops --example record")?;
    let script = |name: &str| {
        let mut script = python::script("python");
        script.arg(root().join("tests/python").join(name));
        script
    };
    run(script("references.py").arg(root()))?;
    run(script("ros_messages.py").arg(root()))?;
    run(script("python_control.py").arg(program("examples/analyse_loops")))?;
    run(script("exact_loops.py").arg(program("examples/analyse_loops")))?;
    run(script("ros2.py")
        .arg(root())
        .arg(program("teleclay-server"))
        .arg(program("teleclay-handle")))?;
    run(script("recordings.py")
        .arg(program("examples/record"))
        .arg(program("teleclay-replay"))
        .arg(program("teleclay-server")))?;
    run(script("interface.py").arg(program("teleclay-server")))?;
    wheel_step()
}

/// The wheel of python/, as whoever installs it has it.
fn wheel_step() -> Result<()> {
    python::install_wheel()?;
    run(&mut python::wheel_cargo(
        "clippy --release --locked -- -D warnings",
    ))?;
    let mut tests = python::script("python");
    tests
        .args([
            "-m",
            "pytest",
            "-p",
            "no:cacheprovider",
            "--quiet",
            "--durations=10",
        ])
        .arg(root().join("python/tests"))
        .arg("--server")
        .arg(program("teleclay-server"))
        .env("PYTHONDONTWRITEBYTECODE", "1");
    run(&mut tests)
}

fn browser() -> Result<()> {
    let mut npm = npm(&["run", "browser"]);
    // Only where it is needed: the server under test inherits the variable, and takes each TELECLAY_* for a setting.
    if target() != root().join("target") {
        npm.env("TELECLAY_BIN_DIR", target().join("release"));
    }
    run(&mut npm)
}

/// On free ports, so that it does not matter what else runs on this machine.
fn demo() -> Result<()> {
    dashboard::build()?;
    release::build(&PROGRAMS)?;
    let mut demo = command(program("teleclay-demo"));
    run(demo
        .args(["--seconds", "20", "--data"])
        .arg(target().join("demo-data")))
}

/// A test that writes into the checkout, or a lock file that no longer fits, shows here.
fn tidy() -> Result<()> {
    let Some(changed) =
        answer(command("git").args(["status", "--porcelain", "--untracked-files=normal"]))
    else {
        println!("this is no git checkout, so nothing can be compared");
        return Ok(());
    };
    // Someone at work has changes of their own; only an automatic run starts from a clean checkout.
    if std::env::var_os("CI").is_none() {
        println!("not an automatic run: changes in the checkout are yours");
        return Ok(());
    }
    ensure!(
        changed.is_empty(),
        "the checks changed the checkout:\n{changed}"
    );
    Ok(())
}

fn cargo_with(arguments: &str) -> Result<()> {
    run(command(cargo()).args(arguments.split(' ')))
}

fn report(what: &str, wrong: Vec<String>) -> Result<()> {
    for line in &wrong {
        println!("  {line}");
    }
    ensure!(wrong.is_empty(), "{what}: {}", wrong.len());
    Ok(())
}
