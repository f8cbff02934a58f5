//! A satellite receiver at the end of a pseudo-terminal, for the tests of the daemon that listens to it.
#![allow(
    dead_code,
    unreachable_pub,
    reason = "support of several test files, each of which uses a part of it"
)]

use std::fmt::Write as _;
use std::fs;
use std::io::Write as _;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::time::Duration;

use recorder::clock::realtime_ns;
use recorder::nmea::checksum;
use schema::gnss::Sentence;
use schema::time::Stamp;
use serialport::{SerialPort, TTYPort};

/// A body between `$` and `*` with its checksum.
pub fn sentence(body: &str) -> String {
    format!("${body}*{:02X}", checksum(body.as_bytes()))
}

/// RMC, GGA and VTG of a fix on the millisecond.
pub fn epoch(utc_ns: i64, minutes: f64, quality: u8) -> Vec<String> {
    let at = Stamp::from_utc_ns(utc_ns);
    let time = format!(
        "{:02}{:02}{:02}.{:03}",
        at.hour,
        at.minute,
        at.second,
        utc_ns.rem_euclid(1_000_000_000) / 1_000_000
    );
    let date = format!("{:02}{:02}{:02}", at.day, at.month, at.year % 100);
    let (status, place) = if quality > 0 {
        ('A', format!("48{minutes:07.4},N,01131.0000,E"))
    } else {
        ('V', ",,,".to_owned())
    };
    let bodies = [
        format!("GNRMC,{time},{status},{place},019.4,084.4,{date},,,A"),
        format!("GNGGA,{time},{place},{quality},12,0.7,500.0,M,46.0,M,,"),
        "GNVTG,084.4,T,,M,019.4,N,035.9,K,A".to_owned(),
    ];
    bodies.iter().map(|body| sentence(body)).collect()
}

/// A sentence that was sent, and the times before and after it was written.
#[derive(Clone, Debug)]
pub struct Sent {
    pub text: String,
    pub from_ns: i64,
    pub to_ns: i64,
}

/// A receiver whose device the daemon knows under a name that outlives it, as one of `/dev/serial/by-id` does.
pub struct Receiver {
    link: PathBuf,
    ours: Option<TTYPort>,
    pub sent: Vec<Sent>,
    /// UTC of the fixes.
    pub fixes: Vec<i64>,
}

impl Receiver {
    /// Not plugged in.
    pub fn new(link: &Path) -> Self {
        Self {
            link: link.to_path_buf(),
            ours: None,
            sent: Vec::new(),
            fixes: Vec::new(),
        }
    }

    pub fn device(&self) -> &str {
        self.link.to_str().unwrap()
    }

    pub fn plug_in(&mut self) {
        self.pull();
        let (mut ours, theirs) = TTYPort::pair().unwrap();
        ours.set_timeout(Duration::from_millis(500)).unwrap();
        symlink(theirs.name().unwrap(), &self.link).unwrap();
        self.ours = Some(ours);
    }

    /// The device goes away, and its name.
    pub fn pull(&mut self) {
        let _ = fs::remove_file(&self.link);
        self.ours = None;
    }

    /// Sends bytes; what the line does not take is lost, as on a real one.
    pub fn send(&mut self, bytes: &[u8]) -> bool {
        let ours = self.ours.as_mut().unwrap();
        ours.write_all(bytes).is_ok()
    }

    /// A fix of now, of which the minutes of latitude tell the number; sentence by sentence.
    pub fn fix(&mut self) {
        let utc_ns = realtime_ns() / 1_000_000 * 1_000_000;
        let minutes = f64::from(u32::try_from(self.fixes.len()).unwrap()) / 1000.0;
        self.fixes.push(utc_ns);
        self.say(&epoch(utc_ns, minutes, 4));
    }

    pub fn say(&mut self, sentences: &[String]) {
        for text in sentences {
            let from_ns = realtime_ns();
            if self.send(format!("{text}\r\n").as_bytes()) {
                let to_ns = realtime_ns();
                self.sent.push(Sent {
                    text: text.clone(),
                    from_ns,
                    to_ns,
                });
            }
        }
    }

    /// The sentences sent, as text.
    pub fn texts(&self) -> Vec<&str> {
        self.sent.iter().map(|sent| sent.text.as_str()).collect()
    }
}

/// The sentences of a record, as text.
pub fn texts(sentences: &[Sentence]) -> Vec<&str> {
    sentences
        .iter()
        .map(|sentence| sentence.text.as_str())
        .collect()
}

/// A log of sentences for a replay: seconds, body.
pub fn log(lines: &[(f64, String)]) -> String {
    lines.iter().fold(String::new(), |mut text, (t, body)| {
        let nanos = schema::num::round_i64(t * 1e9) + crate::support::EPOCH * 1_000_000_000;
        let (s, ns) = (nanos / 1_000_000_000, nanos % 1_000_000_000);
        writeln!(text, "({s}.{ns:09}) {}", sentence(body)).unwrap();
        text
    })
}
