use super::*;

#[test]
fn entries_come_back() {
    let frame = Frame::new(1_000_000_123, 1, 0x8000_1234, 0x81, &[1, 2, 3]);
    let fired = Fired {
        kind: TriggerKind::DeltaV,
        monotonic_ns: 77,
        index: 0,
        value: 2.5,
        threshold: 2.2,
        source: 1,
    };
    let others = [
        Entry::Session {
            at_ns: -5,
            bundle: [7; 32],
            utc_offset_ns: 5,
        },
        Entry::Trigger {
            fired,
            utc_offset_ns: -6,
        },
        Entry::ClockStep {
            at_ns: 1,
            step_ns: -3_600_000_000_000,
        },
        Entry::Note {
            at_ns: 2,
            text: "can0 går ned".to_owned(),
        },
        Entry::Sealed {
            first_ns: 9,
            last_ns: 10,
        },
        Entry::Counts {
            at_ns: 4,
            bundle: [3; 32],
            clock: 2,
            uncertainty_ns: None,
            dropped: 5,
            error_frames: 6,
            utc_offset_ns: -7,
        },
        Entry::Sentence {
            at_ns: 6,
            text: Text::new(b"$GPZDA,,,,,,*48").unwrap(),
        },
        Entry::Closed { at_ns: 7 },
        Entry::End { at_ns: 8 },
    ];
    let mut bytes = Vec::new();
    assert!(put_frame(&mut bytes, 1_000_000_000, &frame));
    for entry in &others {
        put(&mut bytes, entry);
    }
    let mut read = Entries::new(&bytes, 1_000_000_000);
    assert_eq!(read.next(), Some(Entry::Frame(frame)));
    for entry in others {
        assert_eq!(read.next(), Some(entry));
    }
    assert_eq!(read.next(), None);
    assert!(!put_frame(&mut bytes, 9_000_000_000, &frame), "too far");
}

#[test]
fn any_cut_of_a_payload_gives_whole_entries_only() {
    let mut bytes = Vec::new();
    let frame = Frame::new(5, 0, 0x10, 0, &[1; 8]);
    assert!(put_frame(&mut bytes, 0, &frame));
    put(
        &mut bytes,
        &Entry::Note {
            at_ns: 2,
            text: "x".repeat(1000),
        },
    );
    assert!(bytes.len() <= LARGEST + frame_bytes(&frame));
    for end in 0..=bytes.len() {
        let read: Vec<Entry> = Entries::new(&bytes[..end], 0).collect();
        let whole = usize::from(end >= frame_bytes(&frame)) + usize::from(end == bytes.len());
        assert_eq!(read.len(), whole, "{end}");
    }
}
