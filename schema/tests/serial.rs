//! The read-out's messages: each comes back as it was, no bytes make the reader panic, and none is taken for another.
#![allow(clippy::unwrap_used, reason = "tests")]

use proptest::prelude::*;
use schema::serial::{
    Deframer, Entry, Head, Keys, MAX_DATA, MAX_PACKET, MessageError, Refusal, Request, Response,
    line, name_is_allowed, record_number,
};

fn keys() -> Keys {
    Keys::new("correct horse battery", 7, &[1; 16], &[2; 16])
}

const HEAD: Head = Head {
    session: 0x0403_0201,
    request: 0x0807_0605,
};

fn requests() -> Vec<Request> {
    vec![
        Request::Hello { nonce: [9; 16] },
        Request::Prove { proof: [8; 32] },
        Request::List { first: 13 },
        Request::Read {
            place: 3,
            digest: [5; 8],
            offset: 1 << 33,
            length: 1024,
        },
        Request::Bye,
    ]
}

fn entry(place: u32) -> Entry {
    Entry {
        place,
        length: 61_234,
        changed_s: 1_793_707_200,
        sha256: [0xab; 32],
        name: format!("20261103T120000Z-{place:04}.svb"),
    }
}

fn responses() -> Vec<Response> {
    vec![
        Response::Challenge { nonce: [9; 16] },
        Response::Welcome {
            proof: [8; 32],
            files: 4,
        },
        Response::Page {
            files: 9,
            next: 2,
            entries: vec![entry(0), entry(1)],
        },
        Response::Data {
            place: 3,
            offset: 4096,
            bytes: vec![0; MAX_DATA],
        },
        Response::Farewell,
        Response::Refused(Refusal::NoSession),
        Response::Refused(Refusal::WrongToken(2)),
        Response::Refused(Refusal::Wait(256)),
        Response::Refused(Refusal::Version(1)),
        Response::Refused(Refusal::NotThere),
        Response::Refused(Refusal::Changed),
        Response::Refused(Refusal::Unreadable),
        Response::Refused(Refusal::Unknown),
    ]
}

#[test]
fn every_message_comes_back_and_fits_a_packet() {
    let keys = keys();
    for request in requests() {
        let packet = request.packet(HEAD, Some(&keys));
        assert!(packet.len() <= MAX_PACKET);
        assert_eq!(Request::read(&packet, Some(&keys)), Ok((HEAD, request)));
    }
    for response in responses() {
        let packet = response.packet(HEAD, Some(&keys));
        assert!(packet.len() <= MAX_PACKET);
        assert_eq!(Response::read(&packet, Some(&keys)), Ok((HEAD, response)));
    }
}

#[test]
fn a_full_page_fits_a_packet() {
    let mut used = 0;
    let mut entries = Vec::new();
    while entries
        .last()
        .is_none_or(|last: &Entry| last.fits(&mut used))
    {
        entries.push(entry(u32::try_from(entries.len()).unwrap()));
    }
    entries.pop();
    let page = Response::Page {
        files: 99,
        next: 12,
        entries,
    };
    let packet = page.packet(HEAD, Some(&keys()));
    assert!(packet.len() <= MAX_PACKET && packet.len() > 900);
    assert_eq!(Response::read(&packet, Some(&keys())), Ok((HEAD, page)));
}

#[test]
fn the_bytes_are_those_of_the_protocol_page() {
    let read = Request::Read {
        place: 3,
        digest: *b"12345678",
        offset: 1024,
        length: 512,
    };
    let packet = read.packet(HEAD, Some(&keys()));
    let fixed = b"\x04\x01\x02\x03\x04\x05\x06\x07\x08\x03\0\0\x0012345678\0\x04\0\0\0\0\0\0\0\x02";
    assert_eq!(&packet[..fixed.len()], fixed);
    assert_eq!(packet.len(), fixed.len() + 8);
    let away = Response::Refused(Refusal::Wait(256)).packet(HEAD, None);
    assert_eq!(away, b"\xff\x01\x02\x03\x04\x05\x06\x07\x08\x03\0\x01\0\0");
    let hello = Request::Hello { nonce: [9; 16] }.packet(HEAD, None);
    assert_eq!(hello[..10], *b"\x01\x01\x02\x03\x04\x05\x06\x07\x08\x01");
    assert_eq!(hello.len(), 26);
}

#[test]
fn a_changed_bit_of_a_tagged_packet_is_refused_even_with_a_right_crc() {
    let keys = keys();
    for request in &requests()[2..] {
        let packet = request.packet(HEAD, Some(&keys));
        for bit in 0..packet.len() * 8 {
            let mut bad = packet.clone();
            bad[bit / 8] ^= 1 << (bit % 8);
            let read = Request::read(&bad, Some(&keys));
            assert!(read.is_err(), "bit {bit} of {request:?}: {read:?}");
        }
        assert!(Request::read(&packet, None).is_err());
    }
}

#[test]
fn only_names_of_records_and_the_ledger_are_allowed() {
    for good in ["20261103T120000Z-0007.svb", "a.sve", "ledger.svl"] {
        assert!(name_is_allowed(good), "{good}");
    }
    let long = format!("{}.svb", "a".repeat(61));
    let bad = [
        "",
        ".svb",
        "..svb",
        "../a.svb",
        "a/b.svb",
        "a.svb/",
        "a\\b.svb",
        "a.svb\0",
        "other.svl",
        "recorder.toml",
        "device.key",
        "spool.svs",
        "a b.svb",
        "\u{e5}.svb",
        "a.svb\n",
        &long,
    ];
    for name in bad {
        assert!(!name_is_allowed(name), "{name:?}");
    }
    assert_eq!(record_number("20261103T120000Z-0007.svb"), Some(7));
    assert_eq!(record_number("20261103T120000Z-0007.sve"), Some(7));
    for none in [
        "ledger.svl",
        "a.svb",
        "a-.svb",
        "a-+7.svb",
        "a-99999999999999999999.svb",
    ] {
        assert_eq!(record_number(none), None, "{none}");
    }
}

#[test]
fn a_name_that_leads_elsewhere_is_no_entry() {
    let mut evil = entry(0);
    evil.name = "../../evil.svb".to_owned();
    let page = Response::Page {
        files: 1,
        next: 1,
        entries: vec![evil],
    };
    let packet = page.packet(HEAD, Some(&keys()));
    assert!(matches!(
        Response::read(&packet, Some(&keys())),
        Err(MessageError::Layout { .. })
    ));
}

proptest! {
    #[test]
    fn any_packet_gives_a_message_or_an_error(packet in proptest::collection::vec(any::<u8>(), 0..1200)) {
        let _ = Request::read(&packet, None);
        let _ = Response::read(&packet, None);
        // Also those whose tag holds.
        let mut tagged = packet;
        tagged.extend(keys().tag(&tagged));
        if let Ok((head, request)) = Request::read(&tagged, Some(&keys())) {
            prop_assert_eq!(request.packet(head, Some(&keys())), tagged.clone());
        }
        let _ = Response::read(&tagged, Some(&keys()));
    }

    #[test]
    fn a_noisy_stream_gives_only_packets_that_were_sent(
        lost in proptest::collection::vec((any::<proptest::sample::Index>(), 0..3_u8, any::<u8>()), 0..30),
    ) {
        let sent: Vec<Vec<u8>> = responses().iter().map(|r| r.packet(HEAD, Some(&keys()))).collect();
        let mut stream: Vec<u8> = sent.iter().flat_map(|packet| line::frame(packet)).collect();
        for (place, kind, byte) in lost {
            let at = place.index(stream.len());
            match kind {
                0 => { stream.remove(at); }
                1 => stream.insert(at, stream[at]),
                _ => stream[at] = byte,
            }
        }
        let mut deframer = Deframer::default();
        for packet in stream.into_iter().filter_map(|byte| deframer.push(byte)).flatten() {
            prop_assert!(sent.contains(&packet));
        }
    }
}
