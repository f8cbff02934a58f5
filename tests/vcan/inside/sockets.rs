//! What is heard, against what `candump` logs beside it and against what was sent.

use std::path::Path;
use std::thread::sleep;
use std::time::Duration;

use recorder::can::{EFF, ERR, FD, Frame, RTR};
use recorder::config::Settings;
use recorder::live::{LiveSource, Note};

use crate::bench::{Lane, Process, Test, cangen, link, listen, listen_for, notes, read_log, run};

/// The tests of this file.
pub(crate) const TESTS: &[Test] = &[
    (
        "frames_and_stamps_are_those_of_candump",
        false,
        equal_to_candump,
    ),
    ("two_full_buses_stay_in_order", false, two_floods),
    ("filters_let_in_the_mapped_frames_only", false, filters),
    ("overflow_is_counted_exactly", false, overflow),
    ("error_frames_are_counted_and_told", false, error_frames),
    ("five_outages_are_noted_and_survived", false, outages),
    (
        "an_interface_may_go_and_come_back_as_another",
        false,
        unplugged,
    ),
    ("an_interface_may_be_missing_at_the_start", false, missing),
    ("settings_change_while_it_listens", false, reconfigured),
    (
        "a_clock_set_back_and_forward_moves_no_frame",
        true,
        clock_set,
    ),
];

/// What must be equal of a frame in a log and one heard: stamps have microseconds in the log, and of an FD frame's
/// flags the kernel may add one.
fn key(frame: &Frame) -> (i64, u8, u32, u8, Vec<u8>) {
    (
        frame.time_ns.div_euclid(1000),
        frame.interface,
        frame.id,
        frame.flags & (FD | 3),
        frame.data().to_vec(),
    )
}

fn equal_to_candump(lane: &Lane) {
    let (mut sockets, _) = lane.sockets(&["vcan0", "vcan1"], "all", "");
    let (mut candump, log) = lane.candump(&["vcan0", "vcan1"]);
    let out = lane.dir().join("cangen");
    let mut senders = [
        Process::start("cangen", &["vcan0", "-m", "-g", "1", "-n", "1500"], &out),
        Process::start("cangen", &["vcan1", "-f", "-g", "1", "-n", "1500"], &out),
        Process::start("cangen", &["vcan1", "-e", "-g", "2", "-n", "500"], &out),
    ];
    let heard = listen(&mut sockets, 60, |frames, _| frames.len() == 3500);
    for sender in &mut senders {
        assert_eq!(sender.stop("INT"), Some(0));
    }
    candump.stop("INT");
    let logged = read_log(&log, &["vcan0", "vcan1"]);
    assert_eq!(logged.len(), 3500);
    for bus in 0..2 {
        let of = |frames: &[Frame]| -> Vec<_> {
            frames
                .iter()
                .filter(|frame| frame.interface == bus)
                .map(key)
                .collect()
        };
        assert_eq!(of(&heard), of(&logged), "bus {bus}");
    }
    for what in [EFF, RTR] {
        assert!(heard.iter().any(|frame| frame.id & what != 0));
    }
    assert!(
        heard
            .iter()
            .any(|frame| frame.flags & FD != 0 && frame.len() > 8)
    );
    in_order(&heard);
    for state in sockets.interfaces() {
        assert!(state.up && state.malformed == 0 && state.dropped == 0 && state.outages == 0);
        assert_eq!(state.stamps, "kernel", "vcan has no clock of its own");
    }
    assert!(notes(&mut sockets).is_empty());
}

/// A frame that comes between the reading of one socket and of the other waits for the next reading. Only one that the
/// kernel stamped and has not yet put into its queue can be handed on behind a later one.
fn in_order(heard: &[Frame]) {
    let mut newest = i64::MIN;
    let (mut backwards, mut farthest) = (0, 0);
    for frame in heard {
        let back = newest.saturating_sub(frame.time_ns).max(0);
        backwards += usize::from(back > 0);
        farthest = farthest.max(back);
        newest = newest.max(frame.time_ns);
    }
    let count = heard.len();
    println!(
        "of {count} frames of two interfaces {backwards} were handed on behind a later one, by {farthest} ns at most"
    );
    assert!(farthest < 5_000_000 && backwards <= count / 100);
}

fn two_floods(lane: &Lane) {
    let (mut sockets, _) = lane.sockets(&["vcan0", "vcan1"], "all", "");
    let out = lane.dir().join("cangen");
    let senders = ["vcan0", "vcan1"].map(|name| {
        let words = [name, "-g", "0", "-L", "8", "-n", "15000"];
        Process::start("cangen", &words, &out)
    });
    let heard = listen(&mut sockets, 60, |frames, sockets| {
        let states = sockets.interfaces().iter();
        let dropped: u64 = states.map(|state| state.dropped).sum();
        schema::num::u64_of(frames.len()) + dropped == 30_000
    });
    for mut sender in senders {
        assert_eq!(sender.wait(), Some(0));
    }
    for bus in 0..2 {
        let of = heard.iter().filter(|frame| frame.interface == bus);
        assert_eq!(of.count(), 15_000, "bus {bus}");
    }
    in_order(&heard);
}

fn filters(lane: &Lane) {
    let (mut sockets, _) = lane.sockets(&["vcan0"], "mapped", "");
    cangen("vcan0 -g 0 -n 3000 -I i");
    cangen("vcan0 -g 0 -n 50 -I 120 -L 8");
    cangen("vcan0 -g 0 -n 50 -I 122 -L 5");
    cangen("vcan0 -g 0 -n 50 -I 120 -R");
    cangen("vcan0 -g 0 -n 50 -I 120 -e");
    let heard = listen_for(&mut sockets, 0.3);
    // Counting through 3000 identifiers goes over 2048 at 0: two or one of each mapped one.
    assert!(
        heard
            .iter()
            .all(|frame| (0x120..=0x122).contains(&frame.id))
    );
    let count = |id| heard.iter().filter(|frame| frame.id == id).count();
    assert!((51..=52).contains(&count(0x120)), "{}", count(0x120));
    assert!((1..=2).contains(&count(0x121)), "{}", count(0x121));
    assert!((51..=52).contains(&count(0x122)), "{}", count(0x122));
}

fn overflow(lane: &Lane) {
    let tail = "[run]\nreceive_buffer_kib = 64";
    let (mut sockets, _) = lane.sockets(&["vcan0"], "all", tail);
    let told = notes(&mut sockets);
    assert!(
        matches!(told.as_slice(), [Note::Text { text, .. }] if text.contains("receive buffer in force")),
        "{told:?}"
    );
    let mut heard = 0;
    let mut sent = 0;
    for burst in [500_u64, 20, 3000, 1, 700] {
        cangen(&format!("vcan0 -g 0 -n {burst} -I 120 -L 8"));
        sent += burst;
        heard += schema::num::u64_of(listen_for(&mut sockets, 0.3).len());
        let state = &sockets.interfaces()[0];
        assert_eq!(heard + state.dropped, sent, "{state:?}");
        assert_eq!((state.malformed, state.frames), (0, heard));
    }
    let state = &sockets.interfaces()[0];
    println!(
        "a buffer of {} bytes: of {sent} frames {heard} heard, {} dropped",
        state.receive_buffer, state.dropped
    );
    assert!(state.dropped > 3000, "{state:?}");
}

fn error_frames(lane: &Lane) {
    let (mut sockets, _) = lane.sockets(&["vcan0"], "mapped", "");
    for text in [
        "20000004#0008000000000000",
        "20000020#0000000000000000",
        "20000040#0000000000000000",
        "20000100#0000000000000000",
    ] {
        run("cansend", &["vcan0", text]);
    }
    let heard = listen(&mut sockets, 20, |frames, _| frames.len() == 4);
    assert!(heard.iter().all(|frame| frame.id & ERR != 0));
    let state = &sockets.interfaces()[0];
    assert_eq!((state.error_frames, state.bus_off), (4, 1));
    let told = format!("{:?}", notes(&mut sockets));
    for part in ["error-warning", "bus-off", "restarted"] {
        assert!(told.contains(part), "{told}");
    }
}

/// Sends a frame and hears it.
fn heard_on(sockets: &mut recorder::socket::Sockets, name: &str, bus: u8) {
    run("cansend", &[name, "120#0102030405060708"]);
    listen(sockets, 10, |frames, _| {
        frames.iter().any(|frame| frame.interface == bus)
    });
}

fn texts(told: &[Note], part: &str) -> usize {
    told.iter()
        .filter(|note| matches!(note, Note::Text { text, .. } if text.contains(part)))
        .count()
}

fn outages(lane: &Lane) {
    let (mut sockets, _) = lane.sockets(&["vcan0", "vcan1"], "all", "");
    for round in 1..=5 {
        heard_on(&mut sockets, "vcan0", 0);
        // A frame that waits when the interface goes down is still heard.
        run("cansend", &["vcan0", "120#AA"]);
        link("set vcan0 down");
        let last = listen(&mut sockets, 10, |_, sockets| !sockets.interfaces()[0].up);
        assert_eq!(last.len(), 1, "round {round}");
        assert!(sockets.interfaces()[1].up);
        heard_on(&mut sockets, "vcan1", 1);
        listen_for(&mut sockets, 0.4);
        assert!(!sockets.interfaces()[0].up);
        link("set vcan0 up");
        if round % 2 == 0 {
            heard_on(&mut sockets, "vcan0", 0);
        }
        listen(&mut sockets, 10, |_, sockets| sockets.interfaces()[0].up);
        assert_eq!(sockets.interfaces()[0].outages, round);
    }
    let told = notes(&mut sockets);
    assert_eq!(
        (texts(&told, "went down"), texts(&told, "is up")),
        (5, 5),
        "{told:?}"
    );
    // So short that nobody looked meanwhile.
    link("set vcan0 down");
    link("set vcan0 up");
    heard_on(&mut sockets, "vcan0", 0);
    assert_eq!(sockets.interfaces()[0].outages, 6);
    assert_eq!(sockets.interfaces()[0].malformed, 0);
}

fn unplugged(lane: &Lane) {
    let (mut sockets, _) = lane.sockets(&["vcan0", "vcan1"], "all", "");
    for round in 1..=3 {
        heard_on(&mut sockets, "vcan1", 1);
        link("del vcan1");
        listen(&mut sockets, 10, |_, sockets| !sockets.interfaces()[1].up);
        listen_for(&mut sockets, 0.6);
        link("add dev vcan1 type vcan");
        listen_for(&mut sockets, 0.6);
        assert!(!sockets.interfaces()[1].up, "it is there, but down");
        link("set vcan1 up");
        listen(&mut sockets, 10, |_, sockets| sockets.interfaces()[1].up);
        assert_eq!(sockets.interfaces()[1].outages, round);
    }
    // Another takes its name, and it gets it back.
    link("set vcan1 down");
    link("set vcan1 name vcan8");
    link("set vcan8 up");
    listen_for(&mut sockets, 0.6);
    assert!(!sockets.interfaces()[1].up);
    run("cansend", &["vcan8", "120#01"]);
    assert!(
        listen_for(&mut sockets, 0.6).is_empty(),
        "vcan8 is not configured"
    );
    link("set vcan8 down");
    link("set vcan8 name vcan1");
    link("set vcan1 up");
    listen(&mut sockets, 10, |_, sockets| sockets.interfaces()[1].up);
    heard_on(&mut sockets, "vcan1", 1);
    assert_eq!(sockets.interfaces()[1].outages, 4);
    assert_eq!(sockets.interfaces()[0].outages, 0);
}

fn missing(lane: &Lane) {
    let (mut sockets, _) = lane.sockets(&["vcan0", "vcan9"], "all", "");
    assert_eq!(sockets.interfaces()[1].outages, 1);
    assert_eq!(texts(&notes(&mut sockets), "vcan9 is not there"), 1);
    heard_on(&mut sockets, "vcan0", 0);
    listen_for(&mut sockets, 0.6);
    assert!(notes(&mut sockets).is_empty(), "told once");
    link("add dev vcan9 type vcan");
    link("set vcan9 up");
    listen(&mut sockets, 10, |_, sockets| sockets.interfaces()[1].up);
    heard_on(&mut sockets, "vcan9", 1);
    link("del vcan9");
}

fn reconfigured(lane: &Lane) {
    let (mut sockets, _) = lane.sockets(&["vcan0"], "mapped", "");
    heard_on(&mut sockets, "vcan0", 0);
    run("cansend", &["vcan0", "333#01"]);
    assert!(listen_for(&mut sockets, 0.2).is_empty());
    let both = Settings::load(&lane.config(&["vcan1", "vcan0"], "all", "")).unwrap();
    run("cansend", &["vcan0", "120#02"]);
    sockets.reconfigure(&both).unwrap();
    run("cansend", &["vcan0", "333#03"]);
    run("cansend", &["vcan1", "333#04"]);
    let heard = listen(&mut sockets, 10, |frames, _| frames.len() == 3);
    let parts: Vec<(u8, u8)> = heard
        .iter()
        .map(|frame| (frame.interface, frame.data()[0]))
        .collect();
    assert_eq!(
        parts,
        [(1, 2), (1, 3), (0, 4)],
        "what waited in the kernel is not lost"
    );
    let names: Vec<&str> = sockets
        .interfaces()
        .iter()
        .map(|state| state.name.as_str())
        .collect();
    assert_eq!(names, ["vcan1", "vcan0"]);
}

fn set_clock(by: &str) {
    run("date", &["-s", by]);
}

fn clock_set(lane: &Lane) {
    let (mut sockets, _) = lane.sockets(&["vcan0"], "all", "");
    let (mut candump, log) = lane.candump(&["vcan0"]);
    let began = sockets.now_ns();
    let out: &Path = &lane.dir().join("cangen");
    let mut sender = Process::start("cangen", &["vcan0", "-g", "2", "-I", "120", "-L", "8"], out);
    let mut heard = listen_for(&mut sockets, 1.0);
    set_clock("-1 hour");
    heard.extend(listen_for(&mut sockets, 1.0));
    set_clock("+1 day");
    // Frames before and after the step wait side by side.
    sleep(Duration::from_millis(300));
    heard.extend(listen_for(&mut sockets, 0.5));
    sleep(Duration::from_millis(300));
    set_clock("-23 hours");
    sleep(Duration::from_millis(300));
    heard.extend(listen_for(&mut sockets, 0.5));
    sender.stop("INT");
    heard.extend(listen_for(&mut sockets, 0.3));
    candump.stop("INT");
    let logged = read_log(&log, &["vcan0"]);
    assert_eq!(heard.len(), logged.len());
    let steps: Vec<i64> = notes(&mut sockets)
        .iter()
        .filter_map(|note| match note {
            Note::ClockStep { step_ns, .. } => Some(*step_ns),
            Note::Text { .. } => None,
        })
        .collect();
    println!("{} frames, steps noted: {steps:?} ns", heard.len());
    assert_eq!(steps.len(), 3);
    for (step, hours) in steps.iter().zip([-1.0, 24.0, -23.0]) {
        // `date` works by whole seconds.
        let off = schema::num::real_i64(*step) * 1e-9 - 3600.0 * hours;
        assert!(off.abs() < 2.0, "{off} s");
    }
    // Each frame's stamp in the log differs from its place on the line by the steps up to it, and by nothing else.
    let mut sum = 0;
    let mut left = steps.iter();
    let mut widest = 0;
    for (at, (frame, line)) in heard.iter().zip(&logged).enumerate() {
        let mut differs = line.time_ns - frame.time_ns;
        if (differs - sum).abs() > 1_000_000_000 {
            sum += left.next().unwrap();
            differs = line.time_ns - frame.time_ns;
        }
        assert!((differs - sum).abs() <= 1000, "frame {at}: {differs} {sum}");
        assert_eq!(frame.data(), line.data());
        if at > 0 {
            let step = frame.time_ns - heard[at - 1].time_ns;
            assert!(step >= 0, "frame {at} goes back by {step} ns");
            widest = widest.max(step);
        }
    }
    assert!(left.next().is_none());
    println!("widest step between two frames on the line: {widest} ns");
    assert!(widest < 500_000_000);
    let span = heard.last().unwrap().time_ns - began;
    assert!(span < 60_000_000_000, "{span}");
    assert_eq!(sockets.interfaces()[0].malformed, 0);
    let clock = sockets.clock();
    assert_eq!(clock.offset_ns, steps.iter().sum::<i64>());
    assert!(!clock.leap_second);
}
