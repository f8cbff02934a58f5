//! Golden bytes: the layout of `FORMAT.md`, pinned. A change here is a change of the format.
//!
//! `BLESS=1 cargo test -p svartboks-schema --test golden` writes the file anew after such a change.
#![allow(clippy::unwrap_used, reason = "tests")]

mod support;

use schema::seal::{Hex, signed_message};
use schema::time::Stamp;
use schema::{Codes, Record};
use support::small;

const SMALL: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/small.svb");

fn hex(bytes: &[u8]) -> String {
    Hex(bytes).to_string()
}

#[test]
fn a_small_record_has_the_bytes_it_always_had() {
    let bytes = small().to_bytes().unwrap();
    if std::env::var_os("BLESS").is_some() {
        std::fs::write(SMALL, &bytes).unwrap();
    }
    let golden = std::fs::read(SMALL).unwrap();
    assert_eq!(hex(&bytes), hex(&golden));
    let (record, seal) = Record::read(&golden).unwrap();
    assert_eq!(record, small());
    assert_eq!(hex(&seal.sha256), GOLDEN_SHA256);
}

const GOLDEN_SHA256: &str = "9c87d19688c447e9b440a7fa07baf71f3d85bf149203d29e0d6bb0bbf43d8c69";

#[test]
fn a_sample_is_eighty_bits_most_significant_first() {
    // 0000000000 0000000001 1000000000 1111111111 0111111111 1111111110 0000000010 0101010101
    let codes = Codes([0, 1, 512, 1023, 511, 1022, 2, 0x155]);
    assert_eq!(hex(&codes.to_bytes()), "00001803ff7fffe00955");
    assert_eq!(hex(&Codes::default().to_bytes()), "ffffffffffffffffffff");
    assert_eq!(hex(&Codes([511; 8]).to_bytes()), "7fdff7fdff7fdff7fdff");
}

#[test]
fn a_stamp_is_48_bits() {
    let stamp = Stamp {
        year: 2026,
        month: 3,
        day: 14,
        hour: 15,
        minute: 9,
        second: 26,
    };
    // 101110000 0011111101010 0011 01110 01111 001001 011010
    assert_eq!(hex(&stamp.to_bytes()), "b81fa8dcf25a");
    assert_eq!(stamp.to_utc_s(), 1_773_500_966);
    assert_eq!(Stamp::from_utc_ns(1_773_500_966_999_999_999), stamp);
}

#[test]
fn the_file_begins_with_magic_and_header() {
    let bytes = small().to_bytes().unwrap();
    // Magic; HEAD, length, check; version 1.0; record number 7; digest of the record before.
    assert_eq!(
        hex(&bytes[..20]),
        "895356420d0a1a0a48454144730200008856cded"
    );
    assert_eq!(
        hex(&bytes[20..40]),
        "010000000700000000000000a5a5a5a5a5a5a5a5"
    );
}

#[test]
fn a_block_lies_where_format_md_says() {
    let bytes = small().to_bytes().unwrap();
    let block = bytes.windows(4).position(|four| four == b"SECS").unwrap();
    // The first block: two samples from index 1, 20 ms before 15:09:21.
    assert_eq!(hex(&bytes[block..block + 8]), "5345435339000000");
    let body = &bytes[block + 12..];
    assert_eq!(hex(&body[..19]), "010000000000000000d3cefeffffffff020064");
    // What the two samples left out, acceleration x, y, z, rate x, y, z; then the stamp.
    assert_eq!(hex(&body[19..31]), "0000beff9aff2300aafffcff");
    assert_eq!(hex(&body[31..37]), "b81fa8dcf254");
}

#[test]
fn what_is_signed_is_the_domain_and_the_digest() {
    let message = signed_message(&[7; 32]);
    assert_eq!(
        hex(&message[..20]),
        "7376617274626f6b73207265636f726420763100"
    );
    assert_eq!(message[20..], [7; 32]);
}
