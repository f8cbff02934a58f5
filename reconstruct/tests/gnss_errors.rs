//! Each complaint about a raw log, to the letter.
#![allow(clippy::unwrap_used, reason = "tests")]

#[allow(dead_code, reason = "shared with the other tests of the logs")]
#[path = "support/logs.rs"]
mod logs;

use std::io::{BufReader, Read as _};

use logs::{
    BARE, bare, fix_line, fix_text, fixes, fixes_of, motion_line, motion_text, motions, motions_of,
    note, with,
};
use reconstruct::gnss::GnssError;
use reconstruct::gnss::layout::{Decimal, Delimiter, Layout};
use reconstruct::gnss::notes::NoteKind;
use reconstruct::gnss::read::{Tolerance, read_motions};
use reconstruct::gnss::rows::Fix;
use reconstruct::gnss::write::{write_fixes, write_motions};

/// Column, what stands there, the complaint.
const FIX_COMPLAINTS: [(usize, &str, &str); 24] = [
    (
        1,
        "",
        "column 1 (equipment): expected a whole number, found an empty field",
    ),
    (
        1,
        "x",
        "column 1 (equipment): expected a finite number, found \"x\"",
    ),
    (
        2,
        "1.5",
        "column 2 (drive): expected a whole number, found \"1.5\"",
    ),
    (
        3,
        "-1",
        "column 3 (leg): expected 0 to 4294967295, found -1",
    ),
    (
        4,
        "2013-13-01",
        "column 4 (date_utc): expected a date yyyy-mm-dd, found \"2013-13-01\"",
    ),
    (
        4,
        "",
        "column 4 (date_utc): expected a date yyyy-mm-dd, found an empty field",
    ),
    (
        5,
        "24:00:00.000",
        "column 5 (time_utc): expected a time hh:mm:ss.fff, found \"24:00:00.000\"",
    ),
    (
        5,
        "",
        "column 5 (time_utc): expected a time hh:mm:ss.fff, found an empty field",
    ),
    (
        6,
        "-3",
        "column 6 (gps_week): expected 0 to 20000, found -3",
    ),
    (
        7,
        "604800",
        "column 7 (gps_tow_s): expected 0 to below 604800 s, found 604800",
    ),
    (
        7,
        "-0.1",
        "column 7 (gps_tow_s): expected 0 to below 604800 s, found -0.1",
    ),
    (
        8,
        "",
        "column 8 (obu_s): expected a number, found an empty field",
    ),
    (
        8,
        "NaN",
        "column 8 (obu_s): expected a finite number, found \"NaN\"",
    ),
    (
        8,
        "inf",
        "column 8 (obu_s): expected a finite number, found \"inf\"",
    ),
    (
        8,
        "1e999",
        "column 8 (obu_s): expected a finite number, found \"1e999\"",
    ),
    (9, "2", "column 9 (good): expected 0 or 1, found \"2\""),
    (
        11,
        "90.1",
        "column 11 (latitude_deg): expected -90 to 90 deg, found 90.1",
    ),
    (
        11,
        "",
        "column 11 (latitude_deg): expected a number, found an empty field",
    ),
    (
        12,
        "-180.5",
        "column 12 (longitude_deg): expected -180 to 180 deg, found -180.5",
    ),
    (
        15,
        "1,5",
        "column 15 (speed_mps): expected a finite number, found \"1,5\"",
    ),
    (
        15,
        "-1",
        "column 15 (speed_mps): expected 0 to 1000 m/s, found -1",
    ),
    (
        28,
        "",
        "column 28 (v_east_mps): expected a number, found an empty field",
    ),
    (
        32,
        "true",
        "column 32 (sbas): expected a finite number, found \"true\"",
    ),
    (
        35,
        "-1",
        "column 35 (integrity_down_m): expected 0 to 10000000 m, found -1",
    ),
];

#[test]
fn every_field_has_its_complaint() {
    let good = fix_line();
    for (column, text, complaint) in FIX_COMPLAINTS {
        let found = fixes_of(&format!("{good}{}{good}", with(&good, column, text))).unwrap_err();
        assert_eq!(found, format!("gps.txt: line 2, {complaint}"));
    }
    let flat = with(&with(&good, 13, ""), 14, "");
    assert_eq!(
        fixes_of(&flat).unwrap_err(),
        "gps.txt: line 1, column 14 (sea_height_m): expected a height here or in column 13, found an empty field"
    );
    assert!(fixes_of(&with(&good, 13, "")).is_ok() && fixes_of(&with(&good, 14, "")).is_ok());
    for (column, text, complaint) in [
        (
            9,
            "",
            "column 9 (accel_x_mg): expected a number, found an empty field",
        ),
        (
            11,
            "200001",
            "column 11 (accel_z_mg): expected -200000 to 200000 milli-g, found 200001",
        ),
        (
            12,
            "-1e8",
            "column 12 (gyro_x_mdegps): expected -10000000 to 10000000 millideg/s, found -1e8",
        ),
        (
            14,
            "-",
            "column 14 (gyro_z_mdegps): expected a finite number, found \"-\"",
        ),
    ] {
        let found = motions_of(&with(&motion_line(), column, text)).unwrap_err();
        assert_eq!(found, format!("imu.txt: line 1, {complaint}"));
    }
}

#[test]
fn a_decimal_comma_is_kept_to() {
    let comma = Layout {
        decimal: Decimal::Comma,
        ..BARE
    };
    let good = fix_text(&fixes()[..1], comma);
    for (text, complaint) in [
        ("1.5", "a number with a decimal comma, found \"1.5\""),
        (
            "1,5,5",
            "a finite number with a decimal comma, found \"1,5,5\"",
        ),
        ("nan", "a finite number with a decimal comma, found \"nan\""),
    ] {
        assert_eq!(
            fixes_of(&with(&good, 15, text)).unwrap_err(),
            format!("gps.txt: line 1, column 15 (speed_mps): expected {complaint}")
        );
    }
    // Times may have a sign of their own.
    assert!(fixes_of(&with(&good, 5, "10:00:00.250")).is_ok());
}

#[test]
fn every_file_has_its_complaint() {
    let line = motion_line();
    let long = format!("{line}{}\n", "1".repeat(5000));
    let cases: [(&[u8], &str); 11] = [
        (b"", "expected lines of 14 columns, found no line of data"),
        (
            b"# a\n\n",
            "expected lines of 14 columns, found no line of data",
        ),
        (
            b"a;b;c\n",
            "expected lines of 14 columns, found no line of data",
        ),
        (
            b"1;2;3\n",
            "line 1: expected 14 columns separated by semicolon, found 3",
        ),
        (
            b"a;b\n1;2;3\n",
            "line 2: expected 14 columns separated by semicolon, found 3",
        ),
        (
            fix_line().leak().as_bytes(),
            "line 1: expected 14 columns separated by semicolon, found 35",
        ),
        (
            long.as_bytes(),
            "line 2: expected at most 4096 bytes, found more",
        ),
        (
            b"\n\xe6\n",
            "line 2: expected text in UTF-8, found other bytes",
        ),
        (
            b"1;1;1;;;;;0;0;0;0;0;0;0\n1;1;1;;;;;0;0;0",
            "line 2: the file is cut off: expected 14 columns and a line end, found 10 columns",
        ),
        (
            b"1;1;1;;;;;0;0;0;0;0;0;0\n1;1;1;;;;;0;0;0;0;0;0;-",
            "line 2: the file is cut off: expected 14 columns and a line end, found \"-\" in the last column",
        ),
        (
            b"1;1;1;;;;;0;0;0;0;0;0;",
            "line 1: the file is cut off: expected 14 columns and a line end, found an empty field in the last column",
        ),
    ];
    for (bytes, complaint) in cases {
        let found = read_motions(bytes, "imu.txt", Tolerance::Strict).unwrap_err();
        assert_eq!(found.to_string(), format!("imu.txt: {complaint}"));
    }
    let broken = BufReader::new(line.as_bytes().chain(Failing));
    let found = read_motions(broken, "imu.txt", Tolerance::Strict).unwrap_err();
    assert!(matches!(&found, GnssError::Io { .. }));
    assert_eq!(found.to_string(), "imu.txt: the cable is out");
}

struct Failing;

impl std::io::Read for Failing {
    fn read(&mut self, _: &mut [u8]) -> std::io::Result<usize> {
        Err(std::io::Error::other("the cable is out"))
    }
}

#[test]
fn every_row_that_cannot_be_written_has_its_complaint() {
    let written = |fix: Fix| {
        write_fixes(Vec::new(), "out.txt", &[bare(0), fix], BARE)
            .unwrap_err()
            .to_string()
    };
    let good = fixes()[0];
    let mut head = good.head;
    head.utc_ms = Some(i64::MAX);
    for (fix, complaint) in [
        (
            Fix { head, ..good },
            "column 4 (date_utc): expected a UTC of the years 1970 to 2261, found 9223372036854775807 ms",
        ),
        (
            Fix {
                latitude: f64::NAN,
                ..good
            },
            "column 11 (latitude_deg): expected -90 to 90 deg, found NaN",
        ),
        (
            Fix {
                speed: Some(f64::INFINITY),
                ..good
            },
            "column 15 (speed_mps): expected 0 to 1000 m/s, found inf",
        ),
        (
            Fix {
                ellipsoid_height: None,
                sea_height: None,
                ..good
            },
            "column 14 (sea_height_m): expected a height here or in column 13, found neither",
        ),
    ] {
        assert_eq!(written(fix), format!("out.txt: row 2, {complaint}"));
    }
    // It would round to a week that is over.
    let mut head = good.head;
    head.tow_s = Some(604_799.999_9);
    assert!(
        written(Fix { head, ..good })
            .contains("column 7 (gps_tow_s): expected 0 to below 604800 s")
    );
    let both = Layout {
        delimiter: Delimiter::Comma,
        decimal: Decimal::Comma,
        header: false,
    };
    let found = write_motions(Vec::new(), "out.txt", &motions(), both).unwrap_err();
    assert_eq!(
        found.to_string(),
        "out.txt: expected a delimiter other than the decimal sign, found a comma for both"
    );
    let full = write_motions(&mut [0_u8; 10][..], "out.txt", &motions(), BARE).unwrap_err();
    assert!(matches!(full, GnssError::Io { .. }), "{full}");
}

#[test]
fn broken_lines_are_skipped_where_that_is_asked_for() {
    let mut rows: Vec<String> = motions().iter().map(|m| motion_text(&[*m], BARE)).collect();
    rows[3] = "x;y\n".to_owned();
    rows[7].replace_range(0..1, "?");
    let mut bytes = rows.concat().into_bytes();
    bytes.extend_from_slice(b"\xff\n");
    bytes.extend(vec![b'1'; 9000]);
    bytes.extend_from_slice(b"\n2;1;3;2013-08");
    let log = read_motions(&bytes[..], "imu.txt", Tolerance::SkipBroken).unwrap();
    assert_eq!(log.rows.len(), 48);
    let first = "imu.txt: line 4: expected 14 columns separated by semicolon, found 2".to_owned();
    let gap = &log.notes[0];
    assert_eq!((gap.count, gap.first_line), (2, 5));
    assert!(
        matches!(gap.kind, NoteKind::Gap { period_s, longest_s } if (period_s - 0.02).abs() < 1e-9 && (longest_s - 0.04).abs() < 1e-9)
    );
    assert_eq!(log.notes[1..], [note(NoteKind::Broken { first }, 5, 4)]);
    let found = read_motions(&b"1;2\n3;4"[..], "imu.txt", Tolerance::SkipBroken).unwrap_err();
    assert_eq!(
        found.to_string(),
        "imu.txt: expected at least one usable line, found 2 unusable; the first: imu.txt: line 1: expected 14 columns separated by semicolon, found 2"
    );
}
