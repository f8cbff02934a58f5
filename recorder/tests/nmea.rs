//! NMEA 0183 read: one sentence of each kind with its values by hand, every split and every cut of a stream, fields that
//! are empty or none.
#![allow(clippy::unwrap_used, reason = "tests")]

mod receiver;
mod support;

use std::cell::RefCell;
use std::f64::consts::TAU;
use std::io::Write;
use std::time::Duration;

use receiver::sentence;
use recorder::config::Device;
use recorder::gnss::line::{Line, Told};
use recorder::nmea::{Framer, Heard, Kind, LONGEST, Message, Reading, Text, read};
use schema::num;
use serialport::{SerialPort, TTYPort};

const DAY: i64 = 86_400_000_000_000;
const S: i64 = 1_000_000_000;
const MS: i64 = 1_000_000;

/// One of each kind, as the manual of a receiver in many cars has them.
const GOLDEN: [&str; 7] = [
    "$GPRMC,083559.00,A,4717.11437,N,00833.91522,E,0.004,77.52,091202,,,A*57",
    "$GPGGA,092725.00,4717.11399,N,00833.91590,E,1,08,1.01,499.6,M,48.0,M,,*5B",
    "$GPVTG,77.52,T,,M,0.004,N,0.008,K,A*06",
    "$GPGSA,A,3,23,29,07,08,09,18,26,28,,,,,1.94,1.18,1.54*0D",
    "$GPGST,082356.00,1.8,,,,1.7,1.3,2.2*7E",
    "$GPGLL,4717.11364,N,00833.91565,E,092321.00,A,A*60",
    "$GPZDA,082710.00,16,09,2002,00,00*64",
];

fn hear(bytes: &[u8]) -> Vec<Heard> {
    let mut framer = Framer::default();
    bytes
        .iter()
        .filter_map(|byte| framer.push(*byte, 0))
        .collect()
}

fn text(sentence: &str) -> Text {
    Text::new(sentence.as_bytes()).unwrap_or_else(|| unreachable!("{sentence}"))
}

fn message(body: &str) -> Message {
    match read(&text(&sentence(body))) {
        Reading::Message(_, message) => message,
        other => unreachable!("{body}: {other:?}"),
    }
}

fn near(found: Option<f64>, expected: f64) {
    let found = found.unwrap();
    assert!((found - expected).abs() < 1e-9, "{found}, not {expected}");
}

fn near_degrees(found: Option<[f64; 2]>, latitude: f64, longitude: f64) {
    let [north, east] = found.unwrap().map(f64::to_degrees);
    assert!((north - latitude).abs() < 1e-8 && (east - longitude).abs() < 1e-8);
}

fn clock(h: i64, m: i64, s: i64) -> i64 {
    (h * 3600 + m * 60 + s) * S
}

#[test]
fn one_sentence_of_each_kind_says_what_its_text_says() {
    for (golden, kind) in GOLDEN.iter().zip(Kind::ALL) {
        assert_eq!(Kind::of(&text(golden)), Some(kind));
        match read(&text(golden)) {
            Reading::Message(talker, message) => {
                assert_eq!((talker, message.kind()), (*b"GP", kind));
                check_golden(message);
            }
            other => unreachable!("{golden}: {other:?}"),
        }
    }
    // Fix data of several systems: known, not interpreted.
    let gns = sentence("GNGNS,103600.01,5114.51176,N,00012.29380,W,ANNN,07,1.18,111.5,45.6,,,V");
    assert_eq!(read(&text(&gns)), Reading::Unknown);
}

fn check_golden(message: Message) {
    match message {
        Message::Rmc(rmc) => {
            assert_eq!((rmc.time, rmc.valid), (Some(clock(8, 35, 59)), true));
            near_degrees(rmc.position, 47.285_239_5, 8.565_253_666_7);
            near(rmc.speed, 0.002_057_777_777_8);
            near(rmc.course, 77.52 * TAU / 360.0);
            // 9 December 2002 is the 343rd day of that year; 11,688 days lie before it.
            assert_eq!(
                (rmc.date, rmc.mode, rmc.status),
                (Some(12_030), Some(b'A'), None)
            );
        }
        Message::Gga(gga) => {
            assert_eq!((gga.time, gga.quality), (Some(clock(9, 27, 25)), 1));
            near_degrees(gga.position, 47.285_233_166_7, 8.565_265);
            assert_eq!(gga.satellites, Some(8));
            near(gga.hdop, 1.01);
            near(gga.altitude, 499.6);
            near(gga.separation, 48.0);
        }
        Message::Vtg(vtg) => {
            near(vtg.course, 77.52 * TAU / 360.0);
            near(vtg.speed, 0.002_057_777_777_8);
            assert_eq!(vtg.mode, Some(b'A'));
        }
        Message::Gsa(gsa) => {
            assert_eq!(gsa.fix, Some(3));
            near(gsa.hdop, 1.18);
        }
        Message::Gst(gst) => {
            assert_eq!((gst.time, gst.ellipse), (Some(clock(8, 23, 56)), None));
            assert_eq!((gst.sd, gst.height_sd), (Some([1.7, 1.3]), Some(2.2)));
        }
        Message::Gll(gll) => {
            assert_eq!((gll.time, gll.valid), (Some(clock(9, 23, 21)), true));
            near_degrees(gll.position, 47.285_227_333_3, 8.565_260_833_3);
            assert_eq!(gll.mode, Some(b'A'));
        }
        // 16 September is the 259th day.
        Message::Zda(zda) => {
            assert_eq!((zda.time, zda.date), (Some(clock(8, 27, 10)), Some(11_946)));
        }
    }
}

#[test]
fn south_and_west_are_negative_and_a_speed_may_stand_in_one_unit_only() {
    let Message::Gll(gll) = message("GPGLL,3352.128,S,15112.558,W,235959.999,A") else {
        unreachable!()
    };
    near_degrees(gll.position, -33.868_8, -151.209_3);
    assert_eq!(gll.time, Some(DAY - MS));
    let Message::Vtg(vtg) = message("GPVTG,,T,,M,,N,36.0,K") else {
        unreachable!()
    };
    near(vtg.speed, 10.0);
    let Message::Gst(gst) = message("GPGST,,,3.0,2.0,90.0,2.0,3.0,4.0") else {
        unreachable!()
    };
    let [major, minor, direction] = gst.ellipse.unwrap();
    assert_eq!((major, minor), (3.0, 2.0));
    near(Some(direction), TAU / 4.0);
}

#[test]
fn a_stream_that_is_split_or_cut_anywhere_gives_the_same_sentences_or_a_count() {
    let stream = GOLDEN.join("\r\n") + "\r\n";
    let whole = hear(stream.as_bytes());
    assert_eq!(whole.len(), GOLDEN.len());
    for at in 0..=stream.len() {
        // Cut off, and whatever comes next begins anew: all before it is there, and one count at most.
        let (before, after) = stream.as_bytes().split_at(at);
        let cut = [before, stream.as_bytes()].concat();
        let heard = hear(&cut);
        let complete = GOLDEN.iter().scan(0, |end, golden| {
            *end += golden.len() + 2;
            Some(*end)
        });
        let complete = complete.filter(|end| *end <= at + 2).count();
        assert_eq!(heard[..complete], whole[..complete], "{at}");
        let rest: Vec<&Heard> = heard[complete..]
            .iter()
            .filter(|heard| **heard != Heard::Malformed)
            .collect();
        assert_eq!(rest, whole.iter().collect::<Vec<_>>(), "{at}");
        assert!(heard.len() - complete - rest.len() <= 1, "{at}");
        // Begun in the middle: nothing that is not there.
        let heard = hear(after);
        let sentences = heard.iter().filter(|heard| **heard != Heard::Malformed);
        assert!(sentences.eq(&whole[GOLDEN.len() - heard.len()..]), "{at}");
    }
}

/// Through a device: whatever the reads, the sentences are the same.
#[test]
fn reads_that_end_anywhere_in_a_sentence_change_nothing() {
    let (mut ours, theirs) = TTYPort::pair().unwrap();
    let device = Device {
        path: theirs.name().unwrap(),
        baud: 921_600,
    };
    let line = Line::start(&device).unwrap();
    let wait = |what: &str, done: &dyn Fn() -> bool| {
        for _ in 0..200_000 {
            if done() {
                return;
            }
            std::thread::sleep(Duration::from_micros(100));
        }
        unreachable!("{what}: {:?}", line.state());
    };
    wait("open", &|| line.state().open);
    let stream = GOLDEN.join("\r\n") + "\r\n";
    let mut bytes = 0;
    for at in 1..stream.len() {
        let (before, after) = stream.as_bytes().split_at(at);
        for part in [before, after] {
            ours.write_all(part).unwrap();
            bytes += num::u64_of(part.len());
            wait("the bytes", &|| line.state().bytes == bytes);
        }
        let heard = RefCell::new(Vec::new());
        wait("the sentences", &|| {
            let told = std::iter::from_fn(|| line.next());
            heard
                .borrow_mut()
                .extend(told.filter_map(|told| match told {
                    Told::Heard(Heard::Sentence { text, .. }) => Some(text.as_str().to_owned()),
                    Told::Heard(_) => unreachable!("{at}: {told:?}"),
                    Told::Note { .. } => None,
                }));
            heard.borrow().len() == GOLDEN.len()
        });
        assert_eq!(heard.into_inner(), GOLDEN, "{at}");
    }
    assert_eq!((line.state().lost, line.state().outages), (0, 0));
}

#[test]
fn a_checksum_may_be_in_small_letters_and_must_be_there() {
    let small = GOLDEN[1].replace("*5B", "*5b");
    assert_eq!(read(&text(&small)), read(&text(GOLDEN[1])));
    assert_eq!(hear(b"$GPGGA,1*5\r\n$GPGGA,1\r\n$GPGGA,1*\r\n").len(), 3);
    for (bytes, expected) in [
        (&b"$GPZDA,,,,,,*49\r\n"[..], Heard::BadChecksum),
        (b"$GPZDA,,,,,,\r\n", Heard::Malformed),
        (b"$GPZDA,,,,,,*4\r\n", Heard::Malformed),
        (b"$GPZDA,,,,,,*4G\r\n", Heard::Malformed),
        (b"$GPZDA,,\x07,,,,*48\r\n", Heard::Malformed),
    ] {
        assert_eq!(
            hear(bytes),
            [expected],
            "{:?}",
            String::from_utf8_lossy(bytes)
        );
    }
    // What is too long is none, however long it goes on.
    let long = format!("${}*00", ",".repeat(LONGEST));
    assert_eq!(hear(long.as_bytes()), [Heard::Malformed]);
    let many = sentence(&format!("GPGGA{}", ",".repeat(100)));
    assert_eq!(read(&text(&many)), Reading::Malformed);
}

#[test]
fn any_talker_is_heard_and_other_kinds_are_told_apart() {
    for talker in ["GP", "GN", "GL", "GA", "GB", "GQ", "GI", "BD", "QZ", "IN"] {
        let body = GOLDEN[1]
            .trim_start_matches("$GP")
            .split('*')
            .next()
            .unwrap();
        let sentence = sentence(&format!("{talker}{body}"));
        let Reading::Message(found, Message::Gga(_)) = read(&text(&sentence)) else {
            unreachable!("{sentence}")
        };
        assert_eq!(found, talker.as_bytes());
    }
    for body in [
        "GPGSV,3,1,10,23,38,230,44",
        "PUBX,00,083559.00",
        "PGRME,15.0,M,22.5,M,15.0,M",
        "gpGGA,1",
        "GPGGAX,1",
        "GGA,1",
        "GPTXT,01,01,02,ANTARIS",
        "",
    ] {
        assert_eq!(read(&text(&sentence(body))), Reading::Unknown, "{body}");
    }
}

#[test]
fn empty_fields_say_nothing_and_wrong_ones_are_none() {
    // What receivers send before their first fix.
    for body in [
        "GPRMC,,V,,,,,,,,,,N",
        "GPGGA,,,,,,0,00,99.99,,,,,,",
        "GPGGA,,,,,,,,,,,,,,",
        "GPVTG,,,,,,,,,N",
        "GPGSA,A,1,,,,,,,,,,,,,99.99,99.99,99.99",
        "GPGST,,,,,,,,",
        "GPGLL,,,,,,V,N",
        "GPZDA,,,,,,",
    ] {
        let message = message(body);
        assert_eq!(message.time(), None, "{body}");
        match message {
            Message::Rmc(rmc) => assert!(!rmc.valid && rmc.position.is_none()),
            Message::Gga(gga) => assert!(gga.quality == 0 && gga.position.is_none()),
            Message::Gll(gll) => assert!(!gll.valid && gll.position.is_none()),
            _ => {}
        }
    }
    let wrong = [
        ("GPRMC,240000,A,4717.1,N,00833.9,E,1,2,091202,,,A", "hour"),
        ("GPRMC,236000,A,4717.1,N,00833.9,E,1,2,091202,,,A", "minute"),
        ("GPRMC,235961,A,4717.1,N,00833.9,E,1,2,091202,,,A", "second"),
        ("GPRMC,23595,A,4717.1,N,00833.9,E,1,2,091202,,,A", "digits"),
        (
            "GPRMC,235959.1x,A,4717.1,N,00833.9,E,1,2,091202,,,A",
            "digits",
        ),
        ("GPRMC,235959,B,4717.1,N,00833.9,E,1,2,091202,,,A", "status"),
        ("GPRMC,235959,A,9000.1,N,00833.9,E,1,2,091202,,,A", "pole"),
        (
            "GPRMC,235959,A,4760.0,N,00833.9,E,1,2,091202,,,A",
            "minutes",
        ),
        ("GPRMC,235959,A,4717.1,E,00833.9,E,1,2,091202,,,A", "letter"),
        ("GPRMC,235959,A,4717.1,N,18000.1,E,1,2,091202,,,A", "east"),
        ("GPRMC,235959,A,4717.1,N,,,1,2,091202,,,A", "half"),
        ("GPRMC,235959,A,47-7.1,N,00833.9,E,1,2,091202,,,A", "sign"),
        ("GPRMC,235959,A,4717.1,N,00833.9,E,-1,2,091202,,,A", "speed"),
        (
            "GPRMC,235959,A,4717.1,N,00833.9,E,1,361,091202,,,A",
            "course",
        ),
        (
            "GPRMC,235959,A,4717.1,N,00833.9,E,1,2,311102,,,A",
            "November",
        ),
        (
            "GPRMC,235959,A,4717.1,N,00833.9,E,1,2,290223,,,A",
            "February",
        ),
        ("GPRMC,235959,A,4717.1,N,00833.9,E,1,2,011302,,,A", "month"),
        ("GPRMC,235959,A,4717.1,N,00833.9,E", "fields"),
        ("GPGGA,235959,4717.1,N,00833.9,E,9,8,1,9,M,8,M,,", "quality"),
        (
            "GPGGA,235959,4717.1,N,00833.9,E,1,255,1,9,M,8,M,,",
            "satellites",
        ),
        ("GPGGA,235959,4717.1,N,00833.9,E,1,8,-1,9,M,8,M,,", "hdop"),
        ("GPGGA,235959,4717.1,N,00833.9,E,1,8,1,9,F,8,M,,", "feet"),
        ("GPVTG,77,M,,T,1,N,2,K,A", "units"),
        ("GPVTG,1e3,T,,M,1,N,2,K,A", "exponent"),
        ("GPGST,235959,1,inf,1,1,1,1,1", "infinite"),
        ("GPZDA,235959,16,,2002,00,00", "half a date"),
        ("GPZDA,235959,16,09,2262,00,00", "year"),
        ("GPGSA,A,4,,,,,,,,,,,,,1,1,1", "dimensions"),
    ];
    for (body, what) in wrong {
        assert_eq!(
            read(&text(&sentence(body))),
            Reading::Malformed,
            "{what}: {body}"
        );
    }
}
