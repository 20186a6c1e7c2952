//! The steps of `cargo verify`.

use std::process::Command;

use anyhow::{Result, ensure};

use super::{citations, compose, golden, image, links};
use crate::process::{Interrupt, command, run};
use crate::tools::{WASM, answer, install_chromium, install_wasm_target, require_node};
use crate::workspace::{Workspace, cargo, root};
use crate::{dashboard, demo, promtool, python, release};

/// One check that passes or fails as a whole.
pub(super) struct Step {
    /// What `--only` calls it.
    pub(super) name: &'static str,
    /// What it does, for a person.
    pub(super) what: &'static str,
    pub(super) run: fn(&Workspace, &Interrupt) -> Result<()>,
}

/// In this order: what is quick and often wrong comes first; what needs the release programs comes after they are built,
/// and the dashboard before them, because the server carries it inside.
pub(super) const STEPS: [Step; 16] = [
    Step {
        name: "tools",
        what: "what the tests need is there, or is installed",
        run: tools,
    },
    Step {
        name: "format",
        what: "Rust is formatted",
        run: format,
    },
    Step {
        name: "links",
        what: "what documentation and comments point at is there",
        run: links_step,
    },
    Step {
        name: "docker",
        what: "image and compose file are sound",
        run: docker,
    },
    Step {
        name: "dashboard",
        what: "the dashboard's types, lints, unit tests and build",
        run: dashboard_step,
    },
    Step {
        name: "clippy",
        what: "lints of all Rust code, tests too",
        run: clippy,
    },
    Step {
        name: "rustdoc",
        what: "the documentation of the code builds, its links hold",
        run: rustdoc,
    },
    Step {
        name: "wasm",
        what: "each pure crate builds for a browser",
        run: wasm,
    },
    Step {
        name: "build",
        what: "the release programs",
        run: build,
    },
    Step {
        name: "golden",
        what: "native code and WebAssembly get the same bits",
        run: golden_step,
    },
    Step {
        name: "test",
        what: "every Rust test, unit and integration; the wire's vectors",
        run: test,
    },
    Step {
        name: "doctest",
        what: "examples in the documentation of the code",
        run: doctest,
    },
    Step {
        name: "python",
        what: "the mathematics against python-control, mpmath and scipy, the interface against jsonschema",
        run: python_step,
    },
    Step {
        name: "browser",
        what: "the dashboard in Chromium against real processes",
        run: browser,
    },
    Step {
        name: "demo",
        what: "20 seconds of cargo demo",
        run: demo_step,
    },
    Step {
        name: "tidy",
        what: "the checks left the checkout as it was",
        run: tidy,
    },
];

fn tools(workspace: &Workspace, interrupt: &Interrupt) -> Result<()> {
    require_node()?;
    install_wasm_target(interrupt)?;
    install_chromium(interrupt)?;
    promtool::install(workspace, interrupt)?;
    python::install(workspace, interrupt)?;
    dashboard::install(workspace, interrupt)
}

fn format(_: &Workspace, interrupt: &Interrupt) -> Result<()> {
    run(
        command(cargo()).args(["fmt", "--all", "--check"]),
        interrupt,
    )
}

fn links_step(_: &Workspace, _: &Interrupt) -> Result<()> {
    let mut wrong = links::check(root())?;
    wrong.extend(citations::check(root())?);
    report("broken pointers", wrong)
}

fn docker(workspace: &Workspace, _: &Interrupt) -> Result<()> {
    let mut wrong = image::check(workspace)?;
    wrong.extend(compose::check(&root().join("docker/compose.yaml"))?);
    report("mistakes in docker/", wrong)
}

fn dashboard_step(workspace: &Workspace, interrupt: &Interrupt) -> Result<()> {
    dashboard::install(workspace, interrupt)?;
    for script in ["typecheck", "lint", "test"] {
        run(&mut npm_run(script), interrupt)?;
    }
    dashboard::build(workspace, interrupt)
}

/// In the release profile, so that build scripts and macros are compiled once for this and for the programs.
fn clippy(_: &Workspace, interrupt: &Interrupt) -> Result<()> {
    let arguments = [
        "clippy",
        "--release",
        "--workspace",
        "--all-targets",
        "--locked",
        "--",
        "-D",
        "warnings",
    ];
    run(command(cargo()).args(arguments), interrupt)
}

/// `[KHMH03]` looks like a link to rustdoc; the links step checks such keys against docs/papers.md. Maps name private modules.
const CITATIONS_ALLOWED: &str =
    "-D warnings -A rustdoc::broken_intra_doc_links -A rustdoc::private_intra_doc_links";

fn rustdoc(_: &Workspace, interrupt: &Interrupt) -> Result<()> {
    let arguments = ["doc", "--release", "--workspace", "--no-deps", "--locked"];
    run(
        command(cargo())
            .args(arguments)
            .env("RUSTDOCFLAGS", CITATIONS_ALLOWED),
        interrupt,
    )
}

/// One by one: together they would lend each other features that one of them forgot to ask for.
fn wasm(workspace: &Workspace, interrupt: &Interrupt) -> Result<()> {
    let mut checked = 0;
    for member in workspace.pure_members() {
        println!("{}", member.name);
        let arguments = [
            "check",
            "--quiet",
            "--release",
            "--locked",
            "--target",
            WASM,
            "--package",
            &member.name,
        ];
        run(command(cargo()).args(arguments), interrupt)?;
        checked += 1;
    }
    ensure!(0 < checked, "there is no pure crate to check");
    Ok(())
}

fn build(workspace: &Workspace, interrupt: &Interrupt) -> Result<()> {
    release::build(workspace, interrupt)
}

fn golden_step(workspace: &Workspace, interrupt: &Interrupt) -> Result<()> {
    report("different bits", golden::check(workspace, interrupt)?)
}

fn test(workspace: &Workspace, interrupt: &Interrupt) -> Result<()> {
    let has_nextest = answer(command(cargo()).args(["nextest", "--version"])).is_some();
    let arguments: &[&str] = if has_nextest {
        &[
            "nextest",
            "run",
            "--release",
            "--workspace",
            "--locked",
            "--no-fail-fast",
        ]
    } else {
        &[
            "test",
            "--release",
            "--workspace",
            "--locked",
            "--no-fail-fast",
            "--lib",
            "--bins",
            "--tests",
        ]
    };
    let mut tests = command(cargo());
    tests.args(arguments);
    if let Some(promtool) = promtool::program(workspace) {
        tests.env(promtool::VARIABLE, promtool);
    }
    run(&mut tests, interrupt)
}

/// Apart from the tests, as nextest does not run them.
fn doctest(_: &Workspace, interrupt: &Interrupt) -> Result<()> {
    run(
        command(cargo()).args(["test", "--release", "--workspace", "--locked", "--doc"]),
        interrupt,
    )
}

/// Other people's mathematics about the same loops, robots, plants and experiments; and other people's reading of the
/// interface's schemas.
fn python_step(workspace: &Workspace, interrupt: &Interrupt) -> Result<()> {
    python::install(workspace, interrupt)?;
    // Of the whole workspace, so that nothing is compiled again with other features.
    let arguments = ["build", "--release", "--workspace", "--locked", "--example"];
    run(
        command(cargo()).args(arguments).arg("analyse_loops"),
        interrupt,
    )?;
    let script = |name: &str| {
        let mut script = command(python::python(workspace));
        script.arg(root().join("tests/python").join(name));
        script
    };
    run(script("references.py").arg(root()), interrupt)?;
    let analyse_loops = workspace.program("examples/analyse_loops");
    run(script("python_control.py").arg(analyse_loops), interrupt)?;
    let server = workspace.program("teleclay-server");
    run(script("interface.py").arg(server), interrupt)
}

fn browser(workspace: &Workspace, interrupt: &Interrupt) -> Result<()> {
    let mut npm = npm_run("browser");
    // Only where it is needed: the server under test inherits the variable, and takes each TELECLAY_* for a setting.
    if workspace.target != root().join("target") {
        npm.env("TELECLAY_BIN_DIR", workspace.target.join("release"));
    }
    run(&mut npm, interrupt)
}

fn demo_step(_: &Workspace, interrupt: &Interrupt) -> Result<()> {
    demo::run(&demo::Options::on_free_ports(20)?, interrupt)
}

/// A test that writes into the checkout, or a lock file that no longer fits, shows here.
fn tidy(_: &Workspace, _: &Interrupt) -> Result<()> {
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

fn npm_run(script: &str) -> Command {
    let mut npm = command("npm");
    npm.current_dir(root().join("client-web"))
        .args(["run", script]);
    npm
}

fn report(what: &str, wrong: Vec<String>) -> Result<()> {
    for line in &wrong {
        println!("  {line}");
    }
    ensure!(wrong.is_empty(), "{what}: {}", wrong.len());
    Ok(())
}
