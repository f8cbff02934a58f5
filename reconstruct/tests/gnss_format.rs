//! The raw logs of [S00, 6.1 and 6.2] from outside: what is written is read again under every layout, and what is
//! not as it should be and can be read is noted.
#![allow(clippy::unwrap_used, reason = "tests")]

#[allow(dead_code, reason = "shared with the other tests of the logs")]
#[path = "support/logs.rs"]
mod logs;

use std::io::BufReader;

use logs::{
    BARE, bare, fix_text, fixes, fixes_of, layouts, motion_numbers, motion_text, motions,
    motions_of, note, numbers, with,
};
use reconstruct::gnss::notes::NoteKind;
use reconstruct::gnss::read::{Tolerance, read_motions, without_repeats};
use reconstruct::gnss::rows::{Fix, MILLI_G};

fn close(a: &[f64], b: &[f64], within: f64) {
    assert_eq!(a.len(), b.len());
    for (a, b) in a.iter().zip(b) {
        let same = a.is_nan() && b.is_nan() || (a - b).abs() <= within;
        assert!(same, "{a} {b}");
    }
}

#[test]
fn fixes_come_back_under_every_layout() {
    let mut rows = fixes();
    rows.extend([bare(20), bare(21)]);
    for layout in layouts() {
        let text = fix_text(&rows, layout);
        let log = fixes_of(&text).unwrap();
        assert_eq!(log.layout, layout);
        assert_eq!(log.rows.len(), rows.len());
        for (found, sent) in log.rows.iter().zip(&rows) {
            close(&numbers(found), &numbers(sent), 5.1e-10);
            assert_eq!(found.head.utc_ms, sent.head.utc_ms);
            let plain = |f: &Fix| {
                (
                    f.good,
                    f.fix_type,
                    f.satellites,
                    f.sbas,
                    f.head.leg,
                    f.head.week,
                )
            };
            assert_eq!(plain(found), plain(sent));
        }
        assert_eq!(fix_text(&log.rows, layout), text, "once more, to the byte");
        assert!((log.gps_minus_utc_s().unwrap() - 16.0).abs() < 1e-6);
        let kinds: Vec<_> = log.notes.iter().map(|n| (&n.kind, n.count)).collect();
        assert_eq!(kinds, [(&NoteKind::BadFix, 2)]);
    }
}

#[test]
fn motions_come_back_under_every_layout() {
    let rows = motions();
    for layout in layouts() {
        let text = motion_text(&rows, layout);
        let log = motions_of(&text).unwrap();
        assert_eq!(log.layout, layout);
        assert!(log.notes.is_empty(), "{:?}", log.notes);
        for (found, sent) in log.rows.iter().zip(&rows) {
            close(&motion_numbers(found), &motion_numbers(sent), 1e-9);
            assert_eq!(
                (found.head.utc_ms, found.head.week),
                (sent.head.utc_ms, sent.head.week)
            );
        }
        assert_eq!(motion_text(&log.rows, layout), text);
    }
}

#[test]
fn what_is_written_is_rounded_to_the_decimals_of_its_column() {
    let mut fix = bare(0);
    fix.latitude = 63.123_456_789_4_f64.to_radians();
    fix.longitude = -1e-12;
    fix.head.obu_s = 12.000_4;
    fix.sea_height = Some(1.234_56);
    let text = fix_text(&[fix], BARE);
    assert_eq!(
        text,
        "2;1;3;;;;;12.000;;;63.123456789;0.000000000;;1.2346;;;;;;;;;;;;;;;;;;;;;\n"
    );
    let mut motion = motions()[0];
    motion.accel[0] = 1.234_56 * MILLI_G;
    motion.rate[0] = (-0.004_f64 / 1000.0).to_radians();
    assert_eq!(
        motion_text(&[motion], BARE),
        "2;1;3;2013-08-26;10:00:00.000;1755;122416.000;17.020;1.235;-1000.125;999.500;0.00;-0.01;-70.25\n"
    );
}

#[test]
fn marks_comments_blank_lines_and_line_ends_are_let_pass() {
    for layout in layouts() {
        let plain = motions_of(&motion_text(&motions(), layout)).unwrap();
        let text = motion_text(&motions(), layout);
        let dressed =
            format!("\u{feff}# a comment\n\n  % another\n{text}\n   \n#end").replace('\n', "\r\n");
        let mut found = motions_of(&dressed).unwrap();
        let small = BufReader::with_capacity(7, dressed.as_bytes());
        assert_eq!(
            read_motions(small, "imu.txt", Tolerance::Strict).unwrap(),
            found
        );
        // Three lines stand before; everything else is the same.
        for line in &mut found.lines {
            *line -= 3;
        }
        assert_eq!(found, plain);
    }
}

#[test]
fn a_last_line_that_is_whole_but_has_no_end_is_noted() {
    let text = motion_text(&motions(), BARE);
    let log = motions_of(text.trim_end()).unwrap();
    assert_eq!(log.rows.len(), 50);
    assert_eq!(log.notes, [note(NoteKind::Unended, 1, 50)]);
}

#[test]
fn gaps_repeats_and_disorder_are_noted_and_the_rows_sorted() {
    let mut rows = motions();
    let mut twin = rows[5];
    twin.accel[0] = MILLI_G;
    rows.insert(6, twin);
    rows.swap(20, 21);
    rows.drain(30..35);
    let log = motions_of(&motion_text(&rows, BARE)).unwrap();
    assert!(log.rows.is_sorted_by(|a, b| a.head.obu_s <= b.head.obu_s));
    assert!(
        (log.rows[6].accel[0] - MILLI_G).abs() < 1e-9,
        "twins stay in the order of the file"
    );
    let [unordered, repeated, gap] = &log.notes[..] else {
        unreachable!("{:?}", log.notes);
    };
    assert_eq!(*unordered, note(NoteKind::Unordered, 1, 22));
    assert_eq!(*repeated, note(NoteKind::Repeated, 1, 7));
    assert_eq!((gap.count, gap.first_line), (1, 31));
    assert_eq!(
        gap.to_string(),
        "gaps in the on-board stamps: 1, first at line 31, longest 0.120 s at a period of 0.020 s"
    );
    assert_eq!(without_repeats(&log.rows).len(), log.rows.len() - 1);
}

#[test]
fn legs_and_fixes_without_a_position() {
    let mut rows = fixes();
    for row in &mut rows[10..] {
        row.head.leg.equipment = 6;
    }
    let text = fix_text(&rows, BARE);
    let lost = with(&with(text.lines().nth(6).unwrap(), 11, ""), 12, "");
    let text = text.replace(text.lines().nth(6).unwrap(), lost.trim_end());
    let log = fixes_of(&text).unwrap();
    assert_eq!(log.select(Some(6), Some(1), Some(3)).len(), 10);
    assert_eq!(log.select(Some(2), None, None).len(), 9);
    let gap = NoteKind::Gap {
        period_s: 1.0,
        longest_s: 2.0,
    };
    assert_eq!(
        log.notes,
        [
            note(NoteKind::LegChange, 1, 11),
            note(gap, 1, 8),
            note(NoteKind::BadFix, 1, 14),
            note(NoteKind::NoPosition, 1, 7)
        ]
    );
    let found = fixes_of(&lost).unwrap_err();
    assert_eq!(
        found,
        "gps.txt: expected at least one usable line, found 1 unusable; the first: a fix without a position"
    );
}
