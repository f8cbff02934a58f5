//! Garbled logs through `gnss analyse`: whatever the reader takes is analysed, told and drawn without a panic or a NaN in a figure.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    missing_docs,
    reason = "a test fails by panicking and prints what it measured"
)]

#[path = "support/analyse.rs"]
mod made;

use made::{made, settings};
use reconstruct::gnss::analyse::{Logs, Settings, analyse, json, page, pictures, tables};
use reconstruct::gnss::layout::Layout;
use reconstruct::gnss::logs;
use reconstruct::gnss::read::{Tolerance, read_fixes, read_motions};
use reconstruct::gnss::rows::{Fix, Motion};
use reconstruct::gnss::write::{write_fixes, write_motions};
use reconstruct::simulate::tumble::{TumbleSheet, tumble};

/// Marsaglia's xorshift of 64 bits.
struct Dice(u64);

impl Dice {
    fn below(&mut self, n: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        usize::try_from(self.0 >> 33).unwrap() % n.max(1)
    }
}

/// Cells replaced, lines lost, doubled, exchanged.
fn garbled(text: &str, dice: &mut Dice) -> String {
    const WORDS: [&str; 12] = [
        "", "0", "-0", "1e308", "-1e300", "1e-320", "nan", "180", "-90", "99999999", "0.02", "x",
    ];
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    for _ in 0..dice.below(60) {
        let at = dice.below(lines.len());
        match dice.below(6) {
            0 => {
                let to = (at + dice.below(400)).min(lines.len());
                lines.drain(at..to);
            }
            1 => {
                let line = lines.get(at).cloned().unwrap_or_default();
                lines.insert(at, line);
            }
            2 => {
                let other = dice.below(lines.len());
                if at < lines.len() && other < lines.len() {
                    lines.swap(at, other);
                }
            }
            // A whole column made one value.
            3 if dice.below(6) == 0 => {
                let column = dice.below(35);
                let word = WORDS[dice.below(WORDS.len())];
                for line in &mut lines {
                    *line = with(line, column, word);
                }
            }
            _ => {
                let column = dice.below(35);
                let word = WORDS[dice.below(WORDS.len())];
                if let Some(line) = lines.get_mut(at) {
                    *line = with(line, column, word);
                }
            }
        }
        if lines.is_empty() {
            break;
        }
    }
    lines.join("\n") + "\n"
}

fn with(line: &str, column: usize, word: &str) -> String {
    let mut cells: Vec<&str> = line.split(',').collect();
    let at = column % cells.len();
    cells[at] = word;
    cells.join(",")
}

fn whole(fixes: &[Fix], motions: &[(u64, Motion)], reference: &[Fix], rest: &[[f64; 2]]) {
    let logs = Logs {
        fixes,
        motions,
        reference,
    };
    let settings = Settings {
        rest: rest.to_vec(),
        ..settings()
    };
    let analysis = analyse(&logs, &settings);
    let sections = tables::sections(&analysis);
    let text = tables::text(&sections);
    let drawn = pictures::draw(&analysis);
    let html = page::html(&sections, &drawn, &["a.txt".to_owned()], &[]);
    let json = json::json(&analysis).to_string();
    for (name, out) in [("text", &text), ("page", &html), ("json", &json)] {
        assert!(!out.contains("NaN"), "{name}: {:?}", out.find("NaN"));
    }
    let _ = analysis.gaps(&logs);
}

#[test]
fn garbled_logs_are_analysed_or_refused() {
    let mut m = made(5);
    m.motions.truncate(4000);
    let layout = Layout::default();
    let as_text = |rows: &[Fix]| {
        let mut out = Vec::new();
        write_fixes(&mut out, "out", rows, layout).unwrap();
        String::from_utf8(out).unwrap()
    };
    let sheet = TumbleSheet {
        still_s: 4.0,
        ..TumbleSheet::default()
    };
    let boxed = logs::positions(&tumble(5, &sheet));
    let of_motions = |rows: &[Motion]| {
        let mut out = Vec::new();
        write_motions(&mut out, "out", rows, layout).unwrap();
        String::from_utf8(out).unwrap()
    };
    let texts = [of_motions(&m.motions), of_motions(&boxed)];
    let (fixes, reference) = (as_text(&m.fixes), as_text(&m.reference));
    let mut dice = Dice(0x0dd0_5eed_1234_5678);
    let (mut taken, mut refused) = (0, 0);
    for round in 0..120 {
        let read =
            |text: &str| read_fixes(text.as_bytes(), "gps", Tolerance::SkipBroken).map(|r| r.rows);
        let f = read(&garbled(&fixes, &mut dice)).unwrap_or_default();
        let r = read(&garbled(&reference, &mut dice)).unwrap_or_default();
        let imu = garbled(&texts[round % 2], &mut dice);
        let m = read_motions(imu.as_bytes(), "imu", Tolerance::SkipBroken)
            .map(|r| r.numbered(None, None, None))
            .unwrap_or_default();
        for empty in [f.is_empty(), r.is_empty(), m.is_empty()] {
            *(if empty { &mut refused } else { &mut taken }) += 1;
        }
        let rest = [[
            1010.0,
            1010.0 + 0.5 * f64::from(u8::try_from(round % 60).unwrap()),
        ]];
        whole(&f, &m, &r, if round % 3 == 0 { &rest } else { &[] });
    }
    println!("{taken} garbled logs taken, {refused} refused");
    assert!(taken > 150);
}

#[test]
fn odd_logs_are_told() {
    let m = made(6);
    let numbered =
        |rows: &[Motion]| -> Vec<(u64, Motion)> { (1..).zip(rows.iter().copied()).collect() };
    let all = numbered(&m.motions);
    whole(&[], &[], &[], &[]);
    for n in [1, 2, 3, 30] {
        whole(&m.fixes[..n], &all[..n], &m.reference[..n], &[[0.0, 1e9]]);
    }
    // All stamps the same, all values zero, all values the same huge one.
    for change in 0..3 {
        let mut rows = m.motions[..2000].to_vec();
        for r in &mut rows {
            match change {
                0 => r.head.obu_s = 1.0,
                1 => (r.accel, r.rate) = ([0.0; 3], [0.0; 3]),
                _ => (r.accel, r.rate) = ([1e5; 3], [-1e3; 3]),
            }
        }
        whole(&m.fixes, &numbered(&rows), &m.reference, &[]);
    }
}
