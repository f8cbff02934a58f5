//! A serial line for tests: two pseudo-terminals and what is between them, which loses, doubles and changes bytes, is
//! slow, or is cut; and the two built programs at its ends.

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStderr, Command, Stdio};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, OnceLock};
use std::thread::{JoinHandle, sleep, spawn};
use std::time::Duration;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serialport::{SerialPort, TTYPort};

/// Token of the tests.
pub const TOKEN: &str = "correct horse battery";
/// Pause of a line that has nothing to carry.
const PAUSE: Duration = Duration::from_millis(2);

/// What a line does to what it carries.
#[derive(Clone, Debug, Default)]
pub struct Noise {
    /// Chance of each byte to be lost, doubled, and changed: each of the three.
    pub rate: f64,
    /// Chance of each byte to begin a burst of up to 40 random bytes in place of what was sent.
    pub burst: f64,
    /// Pause after each 64 bytes, zero for none.
    pub pause: Duration,
}

/// One end of a line: the side that a test holds, and the name of the device that a program opens.
pub fn end() -> (TTYPort, String) {
    let (mut ours, theirs) = TTYPort::pair().unwrap();
    ours.set_timeout(Duration::from_millis(20)).unwrap();
    let name = theirs.name().unwrap();
    (ours, name)
}

/// A line that carries bytes until it is dropped.
pub struct Line {
    stop: Arc<AtomicBool>,
    /// Nothing gets through while it is set.
    pub cut: Arc<AtomicBool>,
    /// Bytes that went to the second end.
    pub forward: Arc<AtomicU64>,
    threads: Vec<JoinHandle<()>>,
}

impl Line {
    /// Joins two ends.
    pub fn join(a: &TTYPort, b: &TTYPort, noise: &Noise, seed: u64) -> Self {
        let mut line = Self {
            stop: Arc::default(),
            cut: Arc::default(),
            forward: Arc::default(),
            threads: Vec::new(),
        };
        for (from, to, number) in [(a, b, 0), (b, a, 1)] {
            let (mut from, mut to) = (
                from.try_clone_native().unwrap(),
                to.try_clone_native().unwrap(),
            );
            let (noise, stop, cut) = (noise.clone(), line.stop.clone(), line.cut.clone());
            let count = if number == 0 {
                line.forward.clone()
            } else {
                Arc::default()
            };
            let mut rng = ChaCha8Rng::seed_from_u64(seed * 2 + number);
            line.threads.push(spawn(move || {
                let mut bytes = [0; 64];
                while !stop.load(Ordering::Relaxed) {
                    let Ok(read) = from.read(&mut bytes) else {
                        // Nothing came, or nobody has the other side open.
                        sleep(PAUSE);
                        continue;
                    };
                    if cut.load(Ordering::Relaxed) {
                        continue;
                    }
                    let carried = noise.apply(&bytes[..read], &mut rng);
                    count.fetch_add(carried.len() as u64, Ordering::Relaxed);
                    let mut rest = &carried[..];
                    while !rest.is_empty() && !stop.load(Ordering::Relaxed) {
                        match to.write(rest) {
                            Ok(written) => rest = &rest[written..],
                            Err(_) => sleep(PAUSE),
                        }
                    }
                    sleep(noise.pause);
                }
            }));
        }
        line
    }
}

impl Drop for Line {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            let _ = thread.join();
        }
    }
}

impl Noise {
    fn apply(&self, bytes: &[u8], rng: &mut ChaCha8Rng) -> Vec<u8> {
        let mut out = Vec::with_capacity(bytes.len() + 8);
        let mut burst = 0;
        for byte in bytes {
            if rng.random_bool(self.burst) {
                burst = rng.random_range(1..40);
            }
            if burst > 0 {
                burst -= 1;
                out.push(rng.random());
                continue;
            }
            let [lost, doubled, changed] = [(); 3].map(|()| rng.random_bool(self.rate));
            let flip = if changed {
                1 << rng.random_range(0..8)
            } else {
                0
            };
            if !lost {
                out.push(byte ^ flip);
            }
            if doubled {
                out.push(byte ^ flip);
            }
        }
        out
    }
}

/// A built program of the workspace; builds it, where the tests are run alone, in the profile they were built in.
pub fn program(name: &str) -> PathBuf {
    static BUILT: OnceLock<PathBuf> = OnceLock::new();
    let folder = BUILT.get_or_init(|| {
        let this = std::env::current_exe().unwrap();
        let folder = this.parent().and_then(Path::parent).unwrap().to_path_buf();
        let profile = match folder.file_name().and_then(|name| name.to_str()).unwrap() {
            "debug" => "dev".to_owned(),
            other => other.to_owned(),
        };
        let packages = ["-p", "svartboks-recorder", "-p", "svartboks-reconstruct"];
        let built = Command::new(env!("CARGO"))
            .args([
                "build",
                "--locked",
                "--offline",
                "--quiet",
                "--bins",
                "--profile",
                &profile,
            ])
            .args(packages)
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .status()
            .unwrap();
        assert!(built.success(), "the programs could not be built");
        folder
    });
    folder.join(name)
}

/// A running `recorder serve`, ended when it is dropped.
pub struct Server {
    child: Child,
    said: Receiver<String>,
    heard: Vec<String>,
}

impl Server {
    /// Serves the folder `records` in `folder` on a device.
    pub fn start(folder: &Path, device: &str, more: &[&str]) -> Self {
        let mut child = Command::new(program("recorder"))
            .arg("serve")
            .arg("--config")
            .arg(folder.join("recorder.toml"))
            .args(["--serial", device])
            .args(more)
            .stderr(Stdio::piped())
            .stdin(Stdio::null())
            .spawn()
            .unwrap();
        let (tell, said) = channel();
        let err: ChildStderr = child.stderr.take().unwrap();
        spawn(move || {
            for line in BufReader::new(err).lines().map_while(Result::ok) {
                let _ = tell.send(line);
            }
        });
        Self {
            child,
            said,
            heard: Vec::new(),
        }
    }

    /// Waits until it says a line that holds these words.
    pub fn wait_for(&mut self, words: &str) -> String {
        while let Ok(line) = self.said.recv_timeout(Duration::from_mins(2)) {
            self.heard.push(line.clone());
            if line.contains(words) {
                return line;
            }
        }
        panic!("expected {words:?} of the server, found {:#?}", self.heard);
    }

    /// Most memory it ever held, kB.
    pub fn peak_kb(&self) -> u64 {
        let status = fs::read_to_string(format!("/proc/{}/status", self.child.id())).unwrap();
        let line = status
            .lines()
            .find(|line| line.starts_with("VmHWM:"))
            .unwrap();
        line.split_whitespace().nth(1).unwrap().parse().unwrap()
    }

    /// Asks it to end, and gives its exit code.
    pub fn terminate(&mut self) -> Option<i32> {
        let pid = self.child.id().to_string();
        let killed = Command::new("kill").args(["-TERM", &pid]).status().unwrap();
        assert!(killed.success());
        self.child.wait().unwrap().code()
    }

    /// Waits for its own end, and gives its exit code.
    pub fn ended(&mut self) -> Option<i32> {
        self.child.wait().unwrap().code()
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// `reconstruct fetch` on a device.
pub fn fetch(device: &str, out: &Path, token: &str, more: &[&str]) -> Command {
    let mut command = Command::new(program("reconstruct"));
    command
        .args(["fetch", "--json", "--serial", device, "--out"])
        .arg(out)
        .args(more)
        .env("SVARTBOKS_TOKEN", token)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    command
}

/// A folder with a configuration and records to serve, removed when dropped.
pub struct Bench {
    /// The folder.
    pub folder: PathBuf,
    /// Names and bytes of what can be fetched.
    pub files: Vec<(String, Vec<u8>)>,
}

impl Bench {
    /// With the records of the fixtures, an encrypted one and a ledger, and things that are not to be had.
    pub fn new(name: &str) -> Self {
        let folder =
            std::env::temp_dir().join(format!("svartboks-serial-{name}-{}", std::process::id()));
        let _ = fs::remove_dir_all(&folder);
        let records = folder.join("records");
        fs::create_dir_all(&records).unwrap();
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
        let etc = root.join("recorder/etc");
        fs::copy(etc.join("example.dbc"), folder.join("example.dbc")).unwrap();
        let config = fs::read_to_string(etc.join("recorder.toml")).unwrap();
        let config = format!("{config}\n[serial]\ntoken = \"{TOKEN}\"\n");
        fs::write(folder.join("recorder.toml"), config).unwrap();
        let fixture = |name: &str| fs::read(root.join("fixtures/record").join(name)).unwrap();
        let mut encrypted = b"\x89SVE\r\n\x1a\n".to_vec();
        encrypted.extend((0..5_000_u32).map(|k| (k.wrapping_mul(2_654_435_761) >> 24) as u8));
        let mut ledger = b"\x89SVL\r\n\x1a\n".to_vec();
        ledger.extend([0; 400]);
        let files = vec![
            (
                "20261103T120000Z-0001.svb".to_owned(),
                fixture("oblique-1.svb"),
            ),
            (
                "20261103T120500Z-0002.svb".to_owned(),
                fixture("oblique-1-two-rate.svb"),
            ),
            ("20261103T121000Z-0003.sve".to_owned(), encrypted),
            ("ledger.svl".to_owned(), ledger),
        ];
        for (name, bytes) in &files {
            fs::write(records.join(name), bytes).unwrap();
        }
        // Not to be had.
        fs::write(records.join("device.key"), "secret").unwrap();
        fs::write(records.join("spool.svs"), "ring").unwrap();
        fs::write(records.join(".20261103T121500Z-0004-17.part"), "unfinished").unwrap();
        fs::create_dir(records.join("folder.svb")).unwrap();
        std::os::unix::fs::symlink(folder.join("recorder.toml"), records.join("link.svb")).unwrap();
        Self { folder, files }
    }

    /// Fails unless exactly these files are in a folder, the same to the byte.
    pub fn assert_fetched(&self, out: &Path) {
        let mut found: Vec<String> = fs::read_dir(out)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        found.sort();
        let names: Vec<String> = self.files.iter().map(|(name, _)| name.clone()).collect();
        assert_eq!(found, names);
        for (name, bytes) in &self.files {
            assert!(
                &fs::read(out.join(name)).unwrap() == bytes,
                "{name} differs"
            );
        }
    }
}

impl Drop for Bench {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.folder);
    }
}
