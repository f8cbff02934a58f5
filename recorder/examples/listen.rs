//! Listens on the configured interfaces and says what it heard: `listen CONFIG SECONDS [--dump] [--count FRAMES]`.
//!
//! With `--count` it ends after so many frames, if they come in time. With `--dump` each frame is a line of `candump -L`, its time that on the recorder's line; notes and counts go to
//! standard error, the counts as JSON.

use std::error::Error;
use std::io::{BufWriter, Write};
use std::path::Path;
use std::time::Duration;

use nix::sys::resource::{UsageWho, getrusage};
use recorder::can::{EFF, ERR, FD, Frame, RTR};
use recorder::config::Settings;
use recorder::live::LiveSource;
use recorder::socket::Sockets;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [config, seconds, rest @ ..] = arguments.as_slice() else {
        return Err("expected: listen CONFIG SECONDS [--dump] [--count FRAMES]".into());
    };
    let settings = Settings::load(Path::new(config))?;
    let seconds: f64 = seconds.parse()?;
    let dump = rest.iter().any(|word| word == "--dump");
    let count = rest.iter().position(|word| word == "--count");
    let count = count.and_then(|at| rest.get(at + 1));
    let count = count.map_or(Ok(u64::MAX), |count| count.parse())?;
    let mut sockets = Sockets::open(&settings)?;
    let end_ns = sockets.now_ns() + schema::num::round_i64(seconds * 1e9);
    let mut out = BufWriter::new(std::io::stdout().lock());
    let mut err = std::io::stderr().lock();
    let (mut frames, mut reads, mut backwards, mut last_ns) = (0_u64, 0_u64, 0_u64, i64::MIN);
    while frames < count && sockets.now_ns() < end_ns {
        let before = frames;
        let mut failed = Ok(());
        sockets.read(Duration::from_millis(100), &mut |frame| {
            frames += 1;
            backwards += u64::from(frame.time_ns < last_ns);
            last_ns = last_ns.max(frame.time_ns);
            if dump && failed.is_ok() {
                let name = settings.buses.get(usize::from(frame.interface));
                let name = name.map_or("?", |bus| bus.interface.as_str());
                failed = line(&mut out, name, frame);
            }
        })?;
        failed?;
        reads += u64::from(frames > before);
        while let Some(note) = sockets.next_note() {
            writeln!(err, "{note:?}")?;
        }
    }
    out.flush()?;
    let usage = getrusage(UsageWho::RUSAGE_SELF)?;
    let micros = |time: nix::sys::time::TimeVal| time.tv_sec() * 1_000_000 + time.tv_usec();
    let cpu_us = micros(usage.user_time()) + micros(usage.system_time());
    let counts = serde_json::json!({
        "frames": frames, "reads": reads, "backwards": backwards, "cpu_us": cpu_us,
        "interfaces": sockets.interfaces(),
    });
    writeln!(err, "{counts}")?;
    Ok(())
}

/// One line as `candump -L` writes it.
fn line(out: &mut impl Write, name: &str, frame: &Frame) -> std::io::Result<()> {
    let (seconds, micros) = (
        frame.time_ns.div_euclid(1_000_000_000),
        frame.time_ns.rem_euclid(1_000_000_000) / 1000,
    );
    write!(out, "({seconds:010}.{micros:06}) {name} ")?;
    if frame.id & (EFF | ERR) == 0 {
        write!(out, "{:03X}#", frame.id & 0x7FF)?;
    } else {
        write!(out, "{:08X}#", frame.id & (0x1FFF_FFFF | ERR))?;
    }
    if frame.flags & FD != 0 {
        write!(out, "#{:X}", frame.flags & 0xF)?;
    }
    if frame.id & RTR != 0 {
        write!(out, "R")?;
    }
    for byte in frame.data() {
        write!(out, "{byte:02X}")?;
    }
    writeln!(out)
}
