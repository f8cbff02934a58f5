//! A reader in another language, written from `schema/FORMAT.md` alone, reads every record to the same values.
#![allow(clippy::unwrap_used, reason = "tests")]

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use schema::header::Layout;
use schema::seal::Hex;
use schema::{Block, Record};
use serde_json::{Map, Value, json};

#[path = "../../schema/tests/support/mod.rs"]
mod support;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .unwrap()
        .to_path_buf()
}

fn python(file: &Path) -> Output {
    Command::new("python3")
        .arg(root().join("tests/reader.py"))
        .arg(file)
        .output()
        .unwrap()
}

/// A record as the other reader prints it.
fn expected(file: &[u8]) -> Value {
    let (record, seal) = Record::read(file).unwrap();
    let scales = record.scales();
    let block = |block: &Block| {
        let stamp = block.stamp;
        let small = [
            stamp.month,
            stamp.day,
            stamp.hour,
            stamp.minute,
            stamp.second,
        ]
        .map(u16::from);
        let stamp = [&[stamp.year][..], &small].concat();
        json!({
            "first_index": block.first_index,
            "monotonic_ns": block.monotonic_ns,
            "rate_hz": block.rate_hz,
            "stamp": stamp,
            "codes": block.samples.iter().map(|codes| codes.0).collect::<Vec<_>>(),
            "remainder": block.remainder,
            "values": block.values(&scales).map(|sample| sample.fields()).collect::<Vec<_>>(),
        })
    };
    let mut raw = serde_json::to_value(&record.raw).unwrap();
    for (frame, value) in record.raw.iter().zip(raw.as_array_mut().unwrap()) {
        value["data"] = Hex(&frame.data).to_string().into();
    }
    let mut value = json!({
        "header": record.header,
        "blocks": record.blocks.iter().map(block).collect::<Vec<_>>(),
        "clipping": record.clipping,
        "raw": raw,
        "aux": record.aux,
        "gnss": record.gnss,
        "health": record.health,
        "triggers": record.triggers,
        "completion": record.completion,
        "sha256": seal.sha256,
        "signature": seal.signature.map(|signature| Hex(&signature).to_string()),
    });
    digests_as_hex(&mut value);
    value
}

/// Lists of bytes under a name that ends in `sha256` become hexadecimal digits.
fn digests_as_hex(value: &mut Value) {
    let each = |(name, value): (&String, &mut Value)| match value {
        Value::Array(bytes) if name.ends_with("sha256") => {
            let bytes: Vec<u8> = bytes
                .iter()
                .map(|byte| u8::try_from(byte.as_u64().unwrap()).unwrap())
                .collect();
            *value = Hex(&bytes).to_string().into();
        }
        other => digests_as_hex(other),
    };
    match value {
        Value::Object(fields) => Map::iter_mut(fields).for_each(each),
        Value::Array(items) => items.iter_mut().for_each(digests_as_hex),
        _ => {}
    }
}

/// Panics at the first value that differs, with its path.
fn same(path: &str, ours: &Value, theirs: &Value) {
    match (ours, theirs) {
        (Value::Object(a), Value::Object(b)) => {
            let names =
                |fields: &Map<String, Value>| fields.keys().cloned().collect::<BTreeSet<_>>();
            assert_eq!(names(a), names(b), "{path}");
            a.iter()
                .for_each(|(name, value)| same(&format!("{path}.{name}"), value, &b[name]));
        }
        (Value::Array(a), Value::Array(b)) => {
            assert_eq!(a.len(), b.len(), "{path}");
            let pairs = a.iter().zip(b).enumerate();
            pairs.for_each(|(number, (a, b))| same(&format!("{path}[{number}]"), a, b));
        }
        // One language prints a whole float with a point where the other does not: the values decide, to the bit.
        (Value::Number(a), Value::Number(b)) if a.is_f64() || b.is_f64() => {
            assert_eq!(
                a.as_f64().unwrap().to_bits(),
                b.as_f64().unwrap().to_bits(),
                "{path}"
            );
        }
        (a, b) => assert_eq!(a, b, "{path}"),
    }
}

fn compare(file: &Path) {
    let output = python(file);
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let theirs: Value = serde_json::from_slice(&output.stdout).unwrap();
    same("record", &expected(&std::fs::read(file).unwrap()), &theirs);
}

/// Writes a record to a file of this test and gives its path.
fn written(name: &str, record: &Record) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}.svb"));
    std::fs::write(&path, record.to_bytes().unwrap()).unwrap();
    path
}

#[test]
fn both_layouts_are_read_to_the_same_values() {
    compare(&written("small", &support::small()));
    compare(&written("placed", &support::placed()));
    compare(&written(
        "full",
        &support::record(Layout::Full, 1, 4003, 3000),
    ));
    let two_rate = support::record(Layout::TwoRate, 1, 4003, 1000);
    let rates: Vec<u8> = two_rate.blocks.iter().map(|block| block.rate_hz).collect();
    assert!(rates.contains(&20) && rates.contains(&100));
    compare(&written("two-rate", &two_rate));
}

#[test]
fn empty_parts_and_absent_fields_are_read_too() {
    let mut record = support::small();
    record.header.origin = schema::header::Origin::Live;
    record.header.parent_sha256 = Some([3; 32]);
    record.header.vehicle.imu_position_m = None;
    record.header.imu.accel_range = None;
    record.header.channel_frequency_class = Some(180);
    record.header.clock.leap_second = true;
    record.header.interfaces.clear();
    record.clipping.clear();
    record.raw.clear();
    record.aux.clear();
    record.triggers.clear();
    record.health = schema::parts::Health::default();
    record.completion.reasons.clear();
    compare(&written("empty", &record));
}

#[test]
fn the_committed_records_are_read_to_the_same_values() {
    compare(&root().join("schema/tests/data/small.svb"));
    let Ok(fixtures) = std::fs::read_dir(root().join("fixtures/record")) else {
        return;
    };
    for entry in fixtures {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "svb") {
            compare(&path);
        }
    }
}

#[test]
fn the_other_reader_refuses_damage_too() {
    let sound = support::small().to_bytes().unwrap();
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("damaged.svb");
    for byte in (0..sound.len()).step_by(97) {
        let mut file = sound.clone();
        file[byte] ^= 0x10;
        std::fs::write(&path, &file).unwrap();
        assert!(Record::read(&file).is_err());
        assert_eq!(python(&path).status.code(), Some(1), "byte {byte}");
    }
    std::fs::write(&path, &sound[..sound.len() - 1]).unwrap();
    assert_eq!(python(&path).status.code(), Some(1));
}
