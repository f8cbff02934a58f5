//! `recorder key` as a person and a script meet it.
#![allow(clippy::unwrap_used, reason = "tests")]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use schema::ledger::audit::audit;
use schema::{Ledger, PublicKey};

fn folder(name: &str) -> PathBuf {
    let name = format!("svartboks-key-{name}-{}", std::process::id());
    let folder = std::env::temp_dir().join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

fn recorder(folder: &Path, words: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_recorder"))
        .args(words)
        .current_dir(folder)
        .env_remove("CREDENTIALS_DIRECTORY")
        .output()
        .unwrap()
}

fn json(output: &Output) -> serde_json::Value {
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn keys_are_made_shown_and_changed() {
    let folder = folder("cli");
    let made = json(&recorder(
        &folder,
        &["key", "new", "--out", "a.key", "--json"],
    ));
    let again = recorder(&folder, &["key", "new", "--out", "a.key"]);
    assert_eq!(again.status.code(), Some(1));
    assert!(!String::from_utf8_lossy(&again.stderr).contains("secret-key"));
    for file in ["a.key", "a.key.pub"] {
        assert_eq!(
            json(&recorder(&folder, &["key", "show", file, "--json"])),
            made
        );
    }
    let secret = std::fs::read_to_string(folder.join("a.key")).unwrap();
    let shown = recorder(&folder, &["key", "show", "a.key"]);
    let shown = String::from_utf8(shown.stdout).unwrap();
    assert!(shown.contains(made["fingerprint"].as_str().unwrap()));
    assert!(!shown.contains(secret[23..].trim()));

    let new = json(&recorder(
        &folder,
        &["key", "new", "--out", "b.key", "--json"],
    ));
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fixtures/can");
    let config = std::fs::read_dir(example)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .find(|path| path.extension().is_some_and(|ending| ending == "toml"))
        .unwrap();
    let text = std::fs::read_to_string(&config).unwrap();
    let beside = config.parent().unwrap();
    for entry in std::fs::read_dir(beside).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|ending| ending == "dbc") {
            std::fs::copy(&path, folder.join(path.file_name().unwrap())).unwrap();
        }
    }
    let text = if text.contains("[device]") {
        text.replace("[device]", "[device]\nkey = \"a.key\"")
    } else {
        format!("{text}\n[device]\nkey = \"a.key\"\n")
    };
    std::fs::write(folder.join("car.toml"), text).unwrap();
    let rotate = [
        "key", "rotate", "--config", "car.toml", "--new", "b.key", "--json",
    ];
    let changed = json(&recorder(&folder, &rotate));
    assert_eq!(changed["old_fingerprint"], made["fingerprint"]);
    assert_eq!(changed["fingerprint"], new["fingerprint"]);
    // A second time the old key is not the one in force any more.
    assert_eq!(recorder(&folder, &rotate).status.code(), Some(1));
    let ledger = find(&folder, "ledger.svl");
    let found = audit(&Ledger::read(&std::fs::read(ledger).unwrap()));
    assert_eq!((found.breaks.len(), found.keys.len()), (0, 2));
    let key = |value: &serde_json::Value| {
        PublicKey::from_text(value["public_key"].as_str().unwrap()).unwrap()
    };
    assert!(found.vouches(&key(&made), &key(&new)));
    std::fs::remove_dir_all(&folder).unwrap();
}

fn find(folder: &Path, name: &str) -> PathBuf {
    let mut folders = vec![folder.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.file_name().is_some_and(|found| found == name) {
                return path;
            }
        }
    }
    PathBuf::new()
}
