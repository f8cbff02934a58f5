//! A daemon that runs, for the tests of it.
#![allow(unreachable_pub, reason = "a module of a test")]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::thread::sleep;
use std::time::Duration;

use schema::Record;
use serde_json::Value;

use crate::support::etc;

/// How long anything is waited for, in steps of 50 ms: a slow machine is no failure.
pub const PATIENCE: u32 = 400;

pub struct Daemon {
    pub dir: PathBuf,
    pub child: Child,
}

pub fn folder(name: &str) -> PathBuf {
    let dir = std::env::temp_dir().join(format!("recorder-daemon-{name}-{}", std::process::id()));
    let _ = fs::remove_dir_all(&dir);
    fs::create_dir_all(&dir).unwrap();
    dir
}

pub fn write_config(dir: &Path, changes: &[(&str, &str)]) {
    let mut text = fs::read_to_string(etc().join("recorder.toml")).unwrap();
    let dbc = format!("\"{}\"", etc().join("example.dbc").display());
    text = text
        .replace("\"example.dbc\"", &dbc)
        .replace("[run]", "[run]\nsocket = \"sock\"");
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replace(from, to);
    }
    fs::write(dir.join("recorder.toml"), text).unwrap();
}

pub fn program(dir: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_recorder"))
        .args(args)
        .current_dir(dir)
        .stdin(Stdio::null())
        .output()
        .unwrap()
}

impl Daemon {
    pub fn start(dir: PathBuf, log: String, changes: &[(&str, &str)]) -> Self {
        write_config(&dir, changes);
        fs::write(dir.join("drive.log"), log).unwrap();
        let child = Self::spawn(&dir);
        let daemon = Self { dir, child };
        daemon.until("recording", |status| status["state"] == "recording");
        daemon
    }

    pub fn spawn(dir: &Path) -> Child {
        Command::new(env!("CARGO_BIN_EXE_recorder"))
            .args(["run", "--config", "recorder.toml", "--paced", "drive.log"])
            .current_dir(dir)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(fs::File::create(dir.join("err.txt")).unwrap())
            .spawn()
            .unwrap()
    }

    pub fn status(&self) -> Option<Value> {
        let output = program(
            &self.dir,
            &["status", "--config", "recorder.toml", "--json"],
        );
        serde_json::from_slice(&output.stdout).ok()
    }

    pub fn until(&self, what: &str, wanted: impl Fn(&Value) -> bool) -> Value {
        for _ in 0..PATIENCE {
            if let Some(status) = self.status()
                && wanted(&status)
            {
                return status;
            }
            sleep(Duration::from_millis(50));
        }
        unreachable!("{what}: {:?}\n{}", self.status(), self.said());
    }

    pub fn said(&self) -> String {
        fs::read_to_string(self.dir.join("err.txt")).unwrap()
    }

    pub fn signal(&self, name: &str) {
        let id = self.child.id().to_string();
        assert!(
            Command::new("kill")
                .args([name, &id])
                .status()
                .unwrap()
                .success()
        );
    }

    pub fn stop(&mut self) {
        self.signal("-TERM");
        assert!(self.child.wait().unwrap().success(), "{}", self.said());
    }

    pub fn records(&self) -> Vec<Record> {
        let mut paths: Vec<PathBuf> = fs::read_dir(self.dir.join("records"))
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .filter(|path| path.extension().is_some_and(|end| end == "svb"))
            .collect();
        paths.sort();
        let read = |path: &PathBuf| Record::read(&fs::read(path).unwrap()).unwrap().0;
        paths.iter().map(read).collect()
    }
}

impl Drop for Daemon {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
        let _ = fs::remove_dir_all(&self.dir);
    }
}
