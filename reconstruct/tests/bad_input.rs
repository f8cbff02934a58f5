//! Damaged records, impossible options and unusable paths, as the program meets them.
#![allow(clippy::unwrap_used, reason = "tests")]

mod support;

use std::path::Path;

use reconstruct::simulate::Class;
use support::{crash, folder, reconstruct, stderr, stdout};

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

#[test]
fn damaged_records_of_any_length_never_panic() {
    let dir = folder("cut");
    let bytes = crash(Class::Frontal, 21).1.to_bytes().unwrap();
    let (path, out) = (dir.join("cut.svb"), dir.join("out"));
    let step = bytes.len() / 12;
    for length in (0..bytes.len())
        .step_by(step)
        .chain([1, 7, 60, bytes.len() - 1])
    {
        std::fs::write(&path, &bytes[..length]).unwrap();
        let result = reconstruct(&["run", text(&path), "--out", text(&out)]);
        let complaint = stderr(&result);
        assert!(
            matches!(result.status.code(), Some(1 | 3)),
            "{length}: {complaint}"
        );
        assert!(
            !complaint.contains("panicked") && !complaint.is_empty(),
            "{length}: {complaint}"
        );
    }
    for k in 0..12 {
        let mut flipped = bytes.clone();
        flipped[k * step] ^= 0x24;
        std::fs::write(&path, &flipped).unwrap();
        let result = reconstruct(&["run", text(&path), "--out", text(&out)]);
        let complaint = stderr(&result);
        assert!(
            matches!(result.status.code(), Some(1 | 3)),
            "{k}: {complaint}"
        );
        assert!(
            !complaint.contains("panicked") && complaint.contains("offset"),
            "{k}: {complaint}"
        );
    }
}

#[test]
fn options_and_paths() {
    let dir = folder("paths");
    let record = dir.join("crash.svb");
    std::fs::write(&record, crash(Class::Frontal, 22).1.to_bytes().unwrap()).unwrap();
    let (record, out) = (text(&record), dir.join("out"));
    let run = |record: &str, out: &Path, extra: &[&str]| {
        let result = reconstruct(&[&["run", record, "--out", text(out)], extra].concat());
        assert!(!stderr(&result).contains("panicked"), "{}", stderr(&result));
        (result.status.code(), stderr(&result) + &stdout(&result))
    };
    for wrong in [
        ["--confidence", "2"],
        ["--confidence", "0"],
        ["--confidence", "NaN"],
        ["--rest-pose", "nonsense"],
        ["--rest-pose", "-95,0,0"],
        ["--rest-pose", "59,10,0,-1,1"],
        ["--from", "NaN"],
        ["--from", "5000"],
        ["--to", "-5000"],
    ] {
        let (code, message) = run(record, &out, &wrong);
        assert_eq!(code, Some(2), "{wrong:?}: {message}");
        assert!(
            message.contains("expected") || message.contains("spans"),
            "{wrong:?}: {message}"
        );
    }
    // Negative numbers parse; whether this record has gaps is another matter.
    let (code, message) = run(record, &out, &["--rest-pose", "-33.86,-70.6,-12.5"]);
    assert!(matches!(code, Some(0 | 3)), "{message}");
    // A folder for a file, a file for a folder, a folder that cannot be made, a road file that is none.
    let file = dir.join("file");
    std::fs::write(&file, "x").unwrap();
    for (from, to, extra) in [
        (text(&dir), out.as_path(), &[][..]),
        ("no-such-record.svb", &out, &[]),
        (record, &file, &[]),
        (record, &file.join("below"), &[]),
        (record, Path::new("/proc/none/such"), &[]),
        (record, &out, &["--road", text(&dir)]),
        (record, &out, &["--road", text(&file)]),
    ] {
        let (code, message) = run(from, to, extra);
        assert_eq!(code, Some(1), "{from} {to:?} {extra:?}: {message}");
        assert!(message.starts_with("error: "), "{message}");
    }
    for args in [
        ["compare", text(&dir), text(&file)],
        ["export", text(&dir), "--to=csv"],
        ["inspect", text(&dir), "--json"],
    ] {
        assert_eq!(reconstruct(&args).status.code(), Some(1), "{args:?}");
    }
}
