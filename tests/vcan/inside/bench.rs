//! What every test needs: folders, programs that end with the test, interfaces, configurations, listening.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::Duration;

use recorder::can::Frame;
use recorder::config::Settings;
use recorder::live::{LiveSource, Note};
use recorder::log_source::{LogInput, LogSource};
use recorder::socket::Sockets;

/// A test: its name, whether it sets the system's clock, and what it does.
pub(crate) type Test = (&'static str, bool, fn(&Lane));

/// Where things are.
#[derive(Clone, Debug, Default)]
pub(crate) struct Lane {
    /// The built programs.
    pub(crate) bin: PathBuf,
    /// The project.
    pub(crate) root: PathBuf,
    /// Where to write.
    pub(crate) work: PathBuf,
    name: String,
}

impl Lane {
    /// A test begins, in a folder of its own.
    pub(crate) fn begin(&mut self, name: &str) {
        name.clone_into(&mut self.name);
        fs::create_dir_all(self.dir()).unwrap();
    }

    /// It is over: what it wrote goes, so that the next has the room.
    pub(crate) fn end(&self) {
        let _ = fs::remove_dir_all(self.dir());
    }

    /// The test's folder.
    pub(crate) fn dir(&self) -> PathBuf {
        self.work.join(&self.name)
    }

    /// A configuration on these interfaces; `changes` are pairs of text to replace, `tail` is added.
    pub(crate) fn config(&self, interfaces: &[&str], raw: &str, tail: &str) -> PathBuf {
        let dbc = self.root.join("recorder/etc/example.dbc");
        let dbc = dbc.display();
        let buses: Vec<String> = interfaces
            .iter()
            .map(|name| format!("[[bus]]\ninterface = \"{name}\"\ndbc = \"{dbc}\"\n"))
            .collect();
        let buses = buses.concat();
        let bus = if interfaces.len() > 1 { "vcan0:" } else { "" };
        let signals = |message: &str, names: [&str; 3]| {
            names
                .map(|name| format!("\"{bus}{message}.{name}\""))
                .join(", ")
        };
        let text = format!(
            "[vehicle]\ntrack_width_m = 1.5\n{buses}[imu]\naxes = \"front-left-up\"\naccel = [{}]\nrate = [{}]\n\
             accel_counter = \"{bus}IMU_ACCEL.AccelCounter\"\n[wheels]\nleft = \"{bus}WHEELS.RearLeft\"\nright = \
             \"{bus}WHEELS.RearRight\"\n[raw]\nframes = \"{raw}\"\n{tail}\n",
            signals("IMU_ACCEL", ["Forward", "Left", "Up"]),
            signals("IMU_RATE", ["RollRate", "PitchRate", "YawRate"]),
        );
        let path = self.dir().join("config.toml");
        fs::write(&path, text).unwrap();
        path
    }

    /// Sockets on these interfaces.
    pub(crate) fn sockets(
        &self,
        interfaces: &[&str],
        raw: &str,
        tail: &str,
    ) -> (Sockets, Settings) {
        let settings = Settings::load(&self.config(interfaces, raw, tail)).unwrap();
        (Sockets::open(&settings).unwrap(), settings)
    }

    /// Starts `candump` with these words, its output into a file of the test's folder.
    pub(crate) fn candump(&self, words: &[&str]) -> (Process, PathBuf) {
        let path = self.dir().join("candump.log");
        let mut all = vec!["-L", "-D", "-r", "33554432"];
        all.extend(words);
        let process = Process::start("candump", &all, &path);
        // Until it listens.
        sleep(Duration::from_millis(500));
        (process, path)
    }
}

/// A program that does not outlive its test.
pub(crate) struct Process(Child);

impl Process {
    /// Starts it, standard output into a file.
    pub(crate) fn start(program: impl AsRef<Path>, words: &[&str], out: &Path) -> Self {
        let program = program.as_ref();
        let child = Command::new(program)
            .args(words)
            .current_dir(out.parent().unwrap())
            .stdin(Stdio::null())
            .stdout(File::create(out).unwrap())
            .stderr(File::create(out.with_extension("err")).unwrap())
            .spawn()
            .unwrap_or_else(|error| panic!("{}: {error}", program.display()));
        Self(child)
    }

    /// Number of the process.
    pub(crate) fn id(&self) -> u32 {
        self.0.id()
    }

    /// True while it runs.
    pub(crate) fn running(&mut self) -> bool {
        self.0.try_wait().unwrap().is_none()
    }

    /// Waits for its end; gives its exit code.
    pub(crate) fn wait(&mut self) -> Option<i32> {
        self.0.wait().unwrap().code()
    }

    /// Sends it a signal by name.
    pub(crate) fn signal(&self, name: &str) {
        run("kill", &[&format!("-{name}"), &self.id().to_string()]);
    }

    /// Interrupts it, so that it writes what it holds, and waits for its end; gives its exit code.
    pub(crate) fn stop(&mut self, signal: &str) -> Option<i32> {
        if self.running() {
            self.signal(signal);
        }
        self.0.wait().unwrap().code()
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Runs a program to its end; it must succeed. Gives its output.
pub(crate) fn run(program: impl AsRef<Path>, words: &[&str]) -> String {
    let program = program.as_ref();
    let output = Command::new(program)
        .args(words)
        .stdin(Stdio::null())
        .output()
        .unwrap_or_else(|error| panic!("{}: {error}", program.display()));
    assert!(
        output.status.success(),
        "{} {words:?}: {}{}",
        program.display(),
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr),
    );
    String::from_utf8(output.stdout).unwrap()
}

/// `ip link ...`
pub(crate) fn link(words: &str) {
    let words: Vec<&str> = ["link"]
        .into_iter()
        .chain(words.split_whitespace())
        .collect();
    run("ip", &words);
}

/// Both interfaces as a test expects them, whatever the one before did.
pub(crate) fn restore() {
    for name in ["vcan0", "vcan1"] {
        let quiet = |words: &[&str]| {
            let _ = Command::new("ip")
                .args(words)
                .stderr(Stdio::null())
                .status();
        };
        quiet(&["link", "add", "dev", name, "type", "vcan"]);
        quiet(&["link", "set", name, "mtu", "72", "up"]);
    }
}

/// Sends frames: `cangen WORDS`, to its end.
pub(crate) fn cangen(words: &str) {
    run("cangen", &words.split_whitespace().collect::<Vec<_>>());
}

/// Listens until `enough` says so of what was heard; fails after `most` seconds.
pub(crate) fn listen(
    sockets: &mut Sockets,
    most: i64,
    mut enough: impl FnMut(&[Frame], &mut Sockets) -> bool,
) -> Vec<Frame> {
    let mut frames = Vec::new();
    let end = sockets.now_ns() + most * 1_000_000_000;
    while !enough(&frames, sockets) {
        assert!(
            sockets.now_ns() < end,
            "heard {} frames in {most} s, and it was not enough: {:?}",
            frames.len(),
            sockets.interfaces()
        );
        sockets
            .read(Duration::from_millis(20), &mut |frame| frames.push(*frame))
            .unwrap();
    }
    frames
}

/// Listens for so long, seconds.
pub(crate) fn listen_for(sockets: &mut Sockets, seconds: f64) -> Vec<Frame> {
    let end = sockets.now_ns() + schema::num::round_i64(seconds * 1e9);
    listen(sockets, 600, |_, sockets| sockets.now_ns() >= end)
}

/// Everything noted so far.
pub(crate) fn notes(sockets: &mut Sockets) -> Vec<Note> {
    std::iter::from_fn(|| sockets.next_note()).collect()
}

/// The frames of a log, in the order of its lines.
pub(crate) fn read_log(path: &Path, interfaces: &[&str]) -> Vec<Frame> {
    use recorder::can::{FrameSource, Interfaces};
    let names: Vec<String> = interfaces.iter().map(|&name| name.to_owned()).collect();
    let known = Interfaces::new(&names, &[]).unwrap();
    let mut source = LogSource::open(LogInput::File(path.to_path_buf()), known).unwrap();
    let mut frames = Vec::new();
    let mut frame = Frame::empty();
    while source.next_frame(&mut frame).unwrap() {
        frames.push(frame);
    }
    assert_eq!(source.health().malformed, 0, "{:?}", source.health());
    frames
}
