//! Damaged raw logs give an error or sound rows, and what is accepted can be written and is accepted again.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests")]

#[allow(dead_code, reason = "shared with the other tests of the logs")]
#[path = "support/logs.rs"]
mod logs;

use std::fmt::Debug;

use logs::{bare, fix_text, fixes, layouts, motion_numbers, motion_text, motions, note, numbers};
use reconstruct::gnss::GnssError;
use reconstruct::gnss::notes::NoteKind;
use reconstruct::gnss::read::{Read, Tolerance, read_fixes, read_motions};
use reconstruct::gnss::rows::{Fix, Motion};
use reconstruct::gnss::write::{write_fixes, write_motions};

/// Marsaglia's xorshift of 64 bits.
struct Dice(u64);

impl Dice {
    fn below(&mut self, n: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        usize::try_from(self.0 >> 33).unwrap() % n
    }
}

fn mutated(text: &[u8], dice: &mut Dice) -> Vec<u8> {
    const WORDS: [&[u8]; 12] = [
        b"nan", b"-inf", b"1e999", b"-", b",", b";", b"\t", b" ", b"\r\n", b"\xff", b"\0",
        b"1e-320",
    ];
    let mut bytes = text.to_vec();
    for _ in 0..=dice.below(4) {
        if bytes.is_empty() {
            break;
        }
        let at = dice.below(bytes.len());
        let end = (at + dice.below(40)).min(bytes.len());
        match dice.below(6) {
            0 => bytes[at] ^= 1 << dice.below(8),
            1 => drop(bytes.drain(at..end)),
            2 => {
                let word = WORDS[dice.below(WORDS.len())];
                bytes.splice(at..at, word.iter().copied());
            }
            3 => {
                let copy = bytes[at..end].to_vec();
                bytes.splice(at..at, copy);
            }
            4 if dice.below(8) == 0 => bytes.truncate(at),
            _ => bytes[at] = b'0' + u8::try_from(dice.below(10)).unwrap(),
        }
    }
    bytes
}

/// Reads and writes again: what was accepted can be written and is accepted once more.
fn hold<T: Copy + Debug>(
    read: Result<Read<T>, GnssError>,
    finite: impl Fn(&T) -> bool,
    again: impl Fn(&[T]) -> Result<usize, GnssError>,
) -> bool {
    let Ok(log) = read else {
        return false;
    };
    assert!(!log.rows.is_empty());
    for row in &log.rows {
        assert!(finite(row), "{row:?}");
    }
    match again(&log.rows) {
        Ok(rows) => assert_eq!(rows, log.rows.len()),
        // The one value that is read and not written: it would round to a week that is over.
        Err(e) => assert!(matches!(e, GnssError::Value { column: 7, .. }), "{e}"),
    }
    true
}

#[test]
fn damaged_files_give_an_error_or_sound_rows() {
    let mut dice = Dice(0x9e37_79b9_7f4a_7c15);
    let (mut accepted, mut refused) = (0, 0);
    let layouts = layouts();
    for round in 0..3000 {
        let layout = layouts[round % layouts.len()];
        let tolerance = [Tolerance::Strict, Tolerance::SkipBroken][round / layouts.len() % 2];
        let mut rows = fixes();
        rows.push(bare(20));
        let bytes = mutated(fix_text(&rows[16..], layout).as_bytes(), &mut dice);
        let sound = |fix: &Fix| {
            numbers(fix).iter().all(|x| !x.is_infinite())
                && fix.head.obu_s.is_finite()
                && fix.latitude.is_finite()
                && fix.longitude.is_finite()
        };
        let fixes = hold(
            read_fixes(&bytes[..], "gps.txt", tolerance),
            sound,
            |rows| {
                let mut out = Vec::new();
                write_fixes(&mut out, "out", rows, layout)?;
                Ok(read_fixes(&out[..], "out", Tolerance::Strict)?.rows.len())
            },
        );
        let bytes = mutated(motion_text(&motions()[..6], layout).as_bytes(), &mut dice);
        let sound = |m: &Motion| motion_numbers(m).iter().all(|x| x.is_finite());
        let motions = hold(
            read_motions(&bytes[..], "imu.txt", tolerance),
            sound,
            |rows| {
                let mut out = Vec::new();
                write_motions(&mut out, "out", rows, layout)?;
                Ok(read_motions(&out[..], "out", Tolerance::Strict)?.rows.len())
            },
        );
        for ok in [fixes, motions] {
            *(if ok { &mut accepted } else { &mut refused }) += 1;
        }
    }
    assert!(
        accepted > 1000 && refused > 1000,
        "{accepted} accepted, {refused} refused"
    );
}

#[test]
fn a_file_cut_anywhere_says_so() {
    for layout in layouts() {
        let text = motion_text(&motions()[..3], layout);
        let data = if layout.header {
            text.find('\n').unwrap() + 1
        } else {
            0
        };
        for end in data + 1..text.len() {
            let whole = text[data..end].matches('\n').count();
            let ended = text[..end].ends_with('\n');
            match read_motions(&text.as_bytes()[..end], "imu.txt", Tolerance::Strict) {
                Ok(log) if ended => {
                    assert!(log.rows.len() == whole && log.notes.is_empty());
                }
                // Cut in the digits of the last column, or before the line end.
                Ok(log) => {
                    assert_eq!(log.rows.len(), whole + 1);
                    assert_eq!(
                        log.notes,
                        [note(NoteKind::Unended, 1, log_line(&text, end))]
                    );
                }
                Err(GnssError::CutOff { line, .. }) => {
                    assert!(!ended && line == log_line(&text, end));
                }
                Err(e) => panic!("{layout} {end}: {e}"),
            }
        }
    }
}

fn log_line(text: &str, end: usize) -> u64 {
    u64::try_from(text[..end].matches('\n').count()).unwrap() + 1
}
