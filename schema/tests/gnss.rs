//! Satellite fixes in a record: every value back to the bit, every bound refused by name, none without being asked.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests")]

#[path = "support/mutate.rs"]
mod mutate;
mod support;

use schema::gnss::{Fix, FixQuality, Gnss, Sentence};
use schema::limits::{MAX_FIXES, MAX_GNSS_BYTES};
use schema::{Record, SchemaError};

fn part() -> Gnss {
    support::placed().gnss.unwrap()
}

#[test]
fn fixes_come_back_to_the_bit_and_make_the_minor_version_1() {
    let sound = support::placed();
    let file = sound.to_bytes().unwrap();
    let (back, _) = Record::read(&file).unwrap();
    assert_eq!(back, sound);
    assert_eq!(back.to_bytes().unwrap(), file);
    let minor = |file: &[u8]| u16::from_le_bytes([file[22], file[23]]);
    assert_eq!(minor(&file), 1);
    assert_eq!(minor(&support::small().to_bytes().unwrap()), 0);
    // Nothing of what it costs a record without: the two differ by the version and the part alone.
    let without: Vec<_> = mutate::parse(&file)
        .into_iter()
        .filter(|(tag, _)| tag != b"GNSS")
        .collect();
    let small = mutate::parse(&support::small().to_bytes().unwrap());
    assert_eq!(without[1..], small[1..]);
    assert_eq!(
        Gnss::from_bytes(&part().to_bytes().unwrap()).unwrap(),
        part()
    );
}

#[test]
fn the_version_says_whether_there_is_a_part() {
    let file = support::placed().to_bytes().unwrap();
    let structures = mutate::parse(&file);
    let mut without = structures.clone();
    without.retain(|(tag, _)| tag != b"GNSS");
    let error = Record::read(&mutate::build(&without, None)).unwrap_err();
    assert!(error.to_string().contains("satellite fixes"), "{error}");
    let salvaged = Record::salvage(&mutate::build(&without, None)).unwrap();
    assert!(
        salvaged
            .damage
            .iter()
            .any(|damage| damage.error.to_string().contains("satellite fixes")),
        "{:?}",
        salvaged.damage
    );
    for at in 0..structures.len() {
        if structures[at].0 == *b"GNSS" {
            let mut twice = structures.clone();
            twice.insert(at, structures[at].clone());
            let error = Record::read(&mutate::build(&twice, None)).unwrap_err();
            assert!(matches!(error, SchemaError::Order { .. }), "{error}");
        }
    }
}

#[test]
fn damage_of_the_part_leaves_the_rest() {
    let sound = support::placed();
    let mut file = sound.to_bytes().unwrap();
    let at = file.windows(4).position(|four| four == b"GNSS").unwrap();
    file[at + 40] ^= 4;
    let salvaged = Record::salvage(&file).unwrap();
    assert_eq!(salvaged.record.gnss, None);
    assert_eq!(salvaged.record.blocks, sound.blocks);
    assert_eq!(salvaged.record.health, sound.health);
    assert!(!salvaged.damage.is_empty());
}

#[test]
fn a_body_cut_anywhere_or_with_a_byte_more_is_refused() {
    let body = part().to_bytes().unwrap();
    for length in 0..body.len() {
        let error = Gnss::from_bytes(&body[..length]).unwrap_err();
        assert!(matches!(error, SchemaError::Truncated { .. }), "{error}");
    }
    let more = [&body[..], &[0]].concat();
    assert!(matches!(
        Gnss::from_bytes(&more),
        Err(SchemaError::Trailing { .. })
    ));
}

#[test]
fn every_flipped_bit_gives_a_value_that_is_written_the_same_or_an_error() {
    let body = part().to_bytes().unwrap();
    for bit in 0..body.len() * 8 {
        let mut flipped = body.clone();
        flipped[bit / 8] ^= 1 << (bit % 8);
        if let Ok(gnss) = Gnss::from_bytes(&flipped) {
            assert_eq!(gnss.to_bytes().unwrap(), flipped, "bit {bit}");
        }
    }
}

#[test]
fn what_can_not_be_is_refused_by_name() {
    type Change = fn(&mut Gnss);
    let cases: [(&str, Change); 16] = [
        ("antenna_position_m", |g| {
            g.sheet.antenna_position_m = Some([f64::NAN, 0.0, 0.0]);
        }),
        ("antenna_position_sd_m", |g| {
            g.sheet.antenna_position_sd_m[1] = -0.1;
        }),
        ("latency_s", |g| g.sheet.latency_s = 61.0),
        ("latency_sd_s", |g| g.sheet.latency_sd_s = f64::INFINITY),
        ("horizontal_sd_m", |g| g.sheet.horizontal_sd_m = 0.0),
        ("speed_sd_mps", |g| g.sheet.speed_sd_mps = -1.0),
        ("fix 0, latitude", |g| {
            g.fixes[0].position = Some([1.6, 0.0]);
        }),
        ("fix 0, longitude", |g| {
            g.fixes[0].position = Some([1.0, -3.2]);
        }),
        ("fix 0, speed_mps", |g| g.fixes[0].speed_mps = Some(-0.1)),
        ("fix 0, course", |g| g.fixes[0].course = Some(6.3)),
        ("fix 0, north-east covariance", |g| {
            g.fixes[0].horizontal_m2 = Some([4.0, 4.0, 4.1]);
        }),
        ("fix 0, satellites", |g| g.fixes[0].satellites = Some(255)),
        ("fix 0, UTC", |g| g.fixes[0].utc_ns = Some(i64::MIN)),
        ("fix 1, position", |g| {
            g.fixes[1].position = Some([1.0, 0.1]);
        }),
        ("fix 1, time", |g| g.fixes[1].monotonic_ns = -1),
        ("sentence 0", |g| g.sentences[0].text = "$GP\u{e6}".into()),
    ];
    for (field, change) in cases {
        let mut record = support::placed();
        change(record.gnss.as_mut().unwrap());
        let error = record.to_bytes().unwrap_err().to_string();
        assert!(error.contains(field), "{field}: {error}");
        let error = record.gnss.unwrap().to_bytes().unwrap_err().to_string();
        assert!(error.contains(field), "{field}: {error}");
    }
}

#[test]
fn both_lists_are_bounded() {
    let mut many = part();
    many.fixes = vec![Fix::new(0, FixQuality::None); MAX_FIXES];
    assert_eq!(
        Gnss::from_bytes(&many.to_bytes().unwrap())
            .unwrap()
            .fixes
            .len(),
        MAX_FIXES
    );
    many.fixes.push(Fix::new(0, FixQuality::None));
    assert!(many.to_bytes().unwrap_err().to_string().contains("16384"));
    let mut long = part();
    let sentence = Sentence {
        monotonic_ns: 0,
        text: "x".repeat(255),
    };
    long.sentences = vec![sentence; MAX_GNSS_BYTES / 255];
    assert!(matches!(long.to_bytes(), Err(SchemaError::TooLarge { .. })));
    // A count that the body can not hold costs nothing.
    let mut body = part().to_bytes().unwrap();
    let fixes_at = body.len() - (9 + part().sentences[0].text.len()) - 4 - 2 * 122 - 4;
    body[fixes_at..fixes_at + 4].copy_from_slice(&u32::MAX.to_le_bytes());
    assert!(matches!(
        Gnss::from_bytes(&body),
        Err(SchemaError::Truncated { .. })
    ));
}

#[test]
fn qualities_are_known_by_their_numbers() {
    for (number, quality) in (0_u8..).zip(FixQuality::ALL) {
        assert_eq!(quality.number(), number);
        assert_eq!(FixQuality::from_number(number), Some(quality));
    }
    assert_eq!(FixQuality::from_number(10), None);
    let measured = FixQuality::ALL.iter().filter(|q| q.is_measured()).count();
    assert_eq!(measured, 6);
}
