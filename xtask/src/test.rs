//! `cargo xtask test`: everything that has to pass. The tests come last, so that the output ends with their summary.

use super::{licences, tidy, viewer};
use anyhow::{Context, Result, ensure};
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

/// Runs all checks; stops at the first that fails.
pub fn run(root: &Path) -> Result<()> {
    let tools = Tools::find();
    let cargo = |title: &str, line: &str| step(title, command(root, env!("CARGO"), line));
    cargo("formatting", "fmt --all --check")?;
    println!("== rules of the source tree");
    tidy::run(root)?;
    println!("== licences");
    licences::run(root)?;
    // Before anything is built that embeds it.
    if tools.node {
        viewer::build(root)?;
        viewer::test(root)?;
    } else {
        println!("== page: not built, because Node.js and npm are missing (nodejs npm)");
    }
    let packages = if tools.message_passing {
        "--workspace"
    } else {
        println!("== ringlight-mpi: left out, because mpicc, mpirun or libclang is missing ({MPI_PACKAGES})");
        "--workspace --exclude ringlight-mpi"
    };
    cargo("lints", &format!("clippy {packages} --all-targets --quiet -- -D warnings"))?;
    if tools.message_passing {
        cargo(
            "lints of the command over MPI",
            "clippy -p ringlight-cli --features mpi --all-targets --quiet -- -D warnings",
        )?;
    }
    let mut documentation = command(root, env!("CARGO"), &format!("doc {packages} --no-deps --quiet"));
    documentation.env("RUSTDOCFLAGS", "-D warnings");
    step("documentation", documentation)?;
    if tools.node {
        validate_scenes(root)?;
    } else {
        println!("== scenes: not validated, because Node.js and npm are missing");
    }
    cargo("examples in the documentation", &format!("test {packages} --doc --release --quiet"))?;
    if tools.message_passing {
        cargo("tests of the command over MPI", "test -p ringlight-cli --features mpi --test mpirun --release --quiet")?;
    }
    if tools.node && tools.chromium {
        let features = if tools.message_passing { " --features mpi" } else { "" };
        cargo("command for the browser", &format!("build -p ringlight-cli{features} --release --quiet"))?;
        let target =
            std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root.join("target"), |folder| root.join(folder));
        viewer::test_in_browser(root, &target.join("release/ringlight"), tools.message_passing)?;
    } else {
        println!(
            "== tests in the browser: left out, because Node.js, npm or Chromium is missing (nodejs npm chromium)"
        );
    }
    if tools.nextest {
        cargo("tests", &format!("nextest run {packages} --release --no-fail-fast"))
    } else {
        let words = format!("test {packages} --all-targets --release --no-fail-fast");
        cargo("tests (cargo-nextest is missing)", &words)
    }
}

/// Optional tools.
struct Tools {
    node: bool,
    chromium: bool,
    nextest: bool,
    message_passing: bool,
}

/// Debian's names of what ringlight-mpi needs.
const MPI_PACKAGES: &str = "libopenmpi-dev openmpi-bin libclang-dev";

impl Tools {
    /// Looks for the tools. Installs what is missing where that is expected (`CI=true`).
    fn find() -> Tools {
        let here = Path::new(".");
        let installs = std::env::var("CI").is_ok_and(|value| value == "true");
        let has_node = || works(command(here, "node", "--version")) && works(command(here, "npm", "--version"));
        let has_chromium = || {
            ["chromium", "chromium-browser", "google-chrome"].iter().any(|name| works(command(here, name, "--version")))
        };
        let has_nextest = || works(command(here, env!("CARGO"), "nextest --version"));
        if installs && !has_node() && works(command(here, "apt-get", "update")) {
            works(command(here, "apt-get", "install --yes --no-install-recommends nodejs npm"));
        }
        if installs && !has_chromium() && works(command(here, "apt-get", "update")) {
            works(command(here, "apt-get", "install --yes --no-install-recommends chromium"));
        }
        if installs && !has_nextest() {
            works(command(here, env!("CARGO"), "install cargo-nextest --locked --quiet"));
        }
        let has_mpi = || {
            works(command(here, "mpicc", "--version")) && works(command(here, "mpirun", "--version")) && has_libclang()
        };
        if installs && !has_mpi() && works(command(here, "apt-get", "update")) {
            works(command(here, "apt-get", &format!("install --yes --no-install-recommends {MPI_PACKAGES}")));
        }
        Tools { node: has_node(), chromium: has_chromium(), nextest: has_nextest(), message_passing: has_mpi() }
    }
}

/// Whether the library is there that reads MPI's headers at build time: where its own variable says, in the folders of
/// Debian's versions, or where the linker looks.
fn has_libclang() -> bool {
    let versions = fs::read_dir("/usr/lib").into_iter().flatten().flatten().map(|entry| entry.path());
    let llvm = versions.filter(|path| path.file_name().is_some_and(|name| name.to_string_lossy().starts_with("llvm-")));
    let holds = |folder: &Path| folder.join("libclang.so").exists() || folder.join("libclang.so.1").exists();
    std::env::var_os("LIBCLANG_PATH").is_some()
        || llvm.map(|path| path.join("lib")).any(|folder| holds(&folder))
        || ["/usr/lib", "/usr/lib64", "/usr/lib/x86_64-linux-gnu", "/usr/lib/aarch64-linux-gnu"]
            .iter()
            .any(|folder| holds(Path::new(folder)))
}

/// Checks the generated scenes with the Khronos validator, which is installed under `target/tools`.
fn validate_scenes(root: &Path) -> Result<()> {
    let (source, folder) = (root.join("xtask/tools"), root.join("target/tools"));
    fs::create_dir_all(&folder)?;
    let lock = fs::read(source.join("package-lock.json"))?;
    let installed = folder.join("node_modules").exists() && fs::read(folder.join("installed.json")).ok() == Some(lock);
    for file in ["package.json", "package-lock.json", "validate.js"] {
        fs::copy(source.join(file), folder.join(file)).with_context(|| format!("cannot copy {file}"))?;
    }
    if !installed {
        step("tools", command(&folder, "npm", "ci --no-audit --no-fund --silent"))?;
        fs::copy(folder.join("package-lock.json"), folder.join("installed.json"))?;
    }
    let mut scenes = Vec::new();
    for entry in fs::read_dir(root.join("scenes"))? {
        let path = entry?.path();
        if path.extension().is_some_and(|ending| ending == "glb" || ending == "gltf") {
            scenes.push(path);
        }
    }
    ensure!(!scenes.is_empty(), "there are no scenes to validate");
    scenes.sort();
    let mut validator = command(root, "node", "target/tools/validate.js");
    validator.args(scenes.iter().map(|path| path.strip_prefix(root).unwrap_or(path)));
    step("scenes", validator)
}

/// A command from its words.
pub fn command(folder: &Path, program: &str, words: &str) -> Command {
    let mut command = Command::new(program);
    command.args(words.split_whitespace()).current_dir(folder).stdin(Stdio::null());
    command
}

/// Whether a command can be run and succeeds; its output is not shown.
fn works(mut command: Command) -> bool {
    command.stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok_and(|status| status.success())
}

/// Runs a command that has to succeed.
pub fn step(title: &str, mut command: Command) -> Result<()> {
    println!("== {title}");
    let status = command.status().with_context(|| format!("cannot run {:?}", command.get_program()))?;
    ensure!(status.success(), "{title} failed ({status})");
    Ok(())
}
