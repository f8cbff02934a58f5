//! What the compiler does not see: which crate may know which, and what no file of the project holds.
#![allow(clippy::unwrap_used, reason = "tests")]

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

/// Longest file of Rust, lines.
const LONGEST: usize = 450;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .unwrap()
        .to_path_buf()
}

/// Direct dependencies of each package of the workspace, of any kind (also for tests and builds).
fn dependencies() -> BTreeMap<String, BTreeSet<String>> {
    let output = Command::new(env!("CARGO"))
        .args([
            "metadata",
            "--format-version=1",
            "--no-deps",
            "--offline",
            "--locked",
        ])
        .current_dir(root())
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let metadata: Value = serde_json::from_slice(&output.stdout).unwrap();
    let name = |value: &Value| value["name"].as_str().unwrap().to_owned();
    let of = |package: &Value| {
        let list = package["dependencies"].as_array().unwrap();
        (name(package), list.iter().map(name).collect())
    };
    let packages = metadata["packages"].as_array().unwrap();
    packages.iter().map(of).collect()
}

/// Everything of the workspace that a package reaches.
fn reached(from: &str, all: &BTreeMap<String, BTreeSet<String>>) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    let mut open = vec![from.to_owned()];
    while let Some(package) = open.pop() {
        for next in all.get(&package).into_iter().flatten() {
            if all.contains_key(next) && found.insert(next.clone()) {
                open.push(next.clone());
            }
        }
    }
    found
}

#[test]
fn recorder_and_reconstruct_know_only_the_schema() {
    let all = dependencies();
    let only_schema = BTreeSet::from(["svartboks-schema".to_owned()]);
    for package in ["svartboks-recorder", "svartboks-reconstruct"] {
        assert_eq!(reached(package, &all), only_schema, "{package}");
    }
    assert!(reached("svartboks-schema", &all).is_empty());
}

#[test]
fn the_schema_knows_no_linear_algebra_and_no_program() {
    let all = dependencies();
    for barred in ["nalgebra", "clap", "toml", "can-dbc"] {
        assert!(!all["svartboks-schema"].contains(barred), "{barred}");
    }
}

/// Files under version control; where there is none (an unpacked archive), every file that no build made.
fn files() -> Vec<PathBuf> {
    let root = root();
    let git = Command::new("git")
        .args(["-c", "safe.directory=*", "ls-files", "-z"])
        .current_dir(&root)
        .output();
    if let Ok(output) = git
        && output.status.success()
        && !output.stdout.is_empty()
    {
        let names = String::from_utf8(output.stdout).unwrap();
        let paths = names.split_terminator('\0').map(|name| root.join(name));
        return paths.filter(|path| path.is_file()).collect();
    }
    let made = [".git", "target", "demo-out", ".venv"];
    let mut found = Vec::new();
    let mut open = vec![root.clone()];
    while let Some(folder) = open.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            if path.is_dir() && !made.contains(&name.as_str()) {
                open.push(path);
            } else if path.is_file() {
                found.push(path);
            }
        }
    }
    found
}

/// Text files with their contents.
fn texts() -> Vec<(String, String)> {
    let root = root();
    let found: Vec<_> = files()
        .into_iter()
        .filter_map(|path| {
            let text = String::from_utf8(fs::read(&path).unwrap()).ok()?;
            let name = path.strip_prefix(&root).unwrap();
            Some((name.to_string_lossy().into_owned(), text))
        })
        .collect();
    assert!(found.len() > 50, "found only {} files", found.len());
    found
}

/// Every line for which `wrong` says something, as `file:line: what`.
fn lines(wrong: impl Fn(&str, &str) -> Option<String>) -> String {
    let mut found = String::new();
    for (name, text) in texts() {
        for (number, line) in text.lines().enumerate() {
            if let Some(what) = wrong(&name, line) {
                writeln!(found, "{name}:{}: {what}", number + 1).unwrap();
            }
        }
    }
    found
}

fn is_rust(name: &str) -> bool {
    Path::new(name)
        .extension()
        .is_some_and(|extension| extension == "rs")
}

#[test]
fn no_file_of_rust_is_too_long() {
    let long: Vec<String> = texts()
        .into_iter()
        .filter(|(name, text)| is_rust(name) && text.lines().count() > LONGEST)
        .map(|(name, text)| format!("{name}: {} lines", text.lines().count()))
        .collect();
    assert!(
        long.is_empty(),
        "over {LONGEST} lines:\n{}",
        long.join("\n")
    );
}

#[test]
fn no_file_names_a_folder_of_one_machine() {
    // Put together here, so that this file does not hold them.
    let folders = ["home", "root", "work", "Users"].map(|name| format!("/{name}/"));
    let found = lines(|_, line| {
        let folder = folders.iter().find(|folder| line.contains(*folder))?;
        Some(folder.clone())
    });
    assert!(found.is_empty(), "\n{found}");
}

#[test]
fn every_package_is_locked_to_the_public_index() {
    let lock = fs::read_to_string(root().join("Cargo.lock")).unwrap();
    let public = "source = \"registry+https://github.com/rust-lang/crates.io-index\"";
    let other: Vec<&str> = lock
        .lines()
        .filter(|line| line.starts_with("source = ") && *line != public)
        .collect();
    assert!(other.is_empty(), "{other:?}");
}

#[test]
fn no_test_is_ignored() {
    let mark = format!("#[{}", "ignore");
    let found = lines(|name, line| {
        (is_rust(name) && line.trim_start().starts_with(&mark)).then(|| line.trim().to_owned())
    });
    assert!(found.is_empty(), "\n{found}");
}

#[test]
fn nothing_is_marked_as_unfinished() {
    let words = [["TO", "DO"], ["FIX", "ME"], ["XX", "X"], ["HA", "CK"]].map(|w| w.concat());
    let calls = [["to", "do!("], ["unimple", "mented!("]].map(|w| w.concat());
    let found = lines(|name, line| {
        let mut each = line.split(|c: char| !c.is_alphanumeric() && c != '_');
        let marked = each.any(|word| words.iter().any(|mark| mark == word))
            || is_rust(name) && calls.iter().any(|call| line.contains(call));
        marked.then(|| line.trim().to_owned())
    });
    assert!(found.is_empty(), "\n{found}");
}

#[cfg(unix)]
#[test]
fn the_commands_can_be_run() {
    use std::os::unix::fs::PermissionsExt;
    for name in ["demo", "check", ".ci/run", "fixtures/make"] {
        let mode = fs::metadata(root().join(name))
            .unwrap()
            .permissions()
            .mode();
        assert!(mode & 0o111 == 0o111, "{name}: mode {mode:o}");
    }
}
