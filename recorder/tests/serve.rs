//! The server's side of the read-out, without a line: what it gives, to whom, and what it refuses.
#![allow(clippy::unwrap_used, reason = "tests")]

use std::fs;
use std::path::PathBuf;

use recorder::serve::session::{SILENCE_MS, Session};
use recorder::serve::shelf::Shelf;
use schema::serial::line::{MAX_STUFFED, frame};
use schema::serial::{Deframer, Entry, Head, Keys, Refusal, Request, Response};
use sha2::{Digest, Sha256};

const TOKEN: &str = "correct horse battery";
const SERVER_NONCE: [u8; 16] = [0x5e; 16];

struct Bench {
    dir: PathBuf,
    server: Session,
    keys: Option<Keys>,
    session: u32,
    request: u32,
}

impl Bench {
    fn new(name: &str, files: &[(&str, &[u8])]) -> Self {
        let dir =
            std::env::temp_dir().join(format!("recorder-serve-{name}-{}", std::process::id()));
        let _ = fs::remove_dir_all(&dir);
        fs::create_dir_all(&dir).unwrap();
        for (name, bytes) in files {
            fs::write(dir.join(name), bytes).unwrap();
        }
        Self {
            server: Session::new(TOKEN, Shelf::new(&dir)),
            dir,
            keys: None,
            session: 7,
            request: 0,
        }
    }

    /// What comes back on these bytes.
    fn raw(&mut self, bytes: &[u8]) -> Vec<Vec<u8>> {
        let mut back = Vec::new();
        let mut nonce = || Some(SERVER_NONCE);
        self.server.receive(bytes, &mut nonce, &mut |bytes| {
            back.extend_from_slice(bytes);
        });
        let mut deframer = Deframer::default();
        back.into_iter()
            .filter_map(|byte| deframer.push(byte))
            .map(Result::unwrap)
            .collect()
    }

    fn ask(&mut self, request: &Request) -> Response {
        self.request += 1;
        let head = Head {
            session: self.session,
            request: self.request,
        };
        let packet = request.packet(head, self.keys.as_ref());
        let back = self.raw(&frame(&packet));
        assert_eq!(back.len(), 1, "{request:?}");
        let (found, response) = Response::read(&back[0], self.keys.as_ref()).unwrap();
        assert_eq!(found, head);
        response
    }

    fn prove(&mut self, token: &str) -> Response {
        let nonce = [1; 16];
        match self.ask(&Request::Hello { nonce }) {
            Response::Challenge { nonce: theirs } => {
                let keys = Keys::new(token, self.session, &nonce, &theirs);
                let proof = keys.client_proof();
                let response = self.ask(&Request::Prove { proof });
                if let Response::Welcome { proof, .. } = &response {
                    assert!(keys.is_server_proof(proof));
                    self.keys = Some(keys);
                }
                response
            }
            other => other,
        }
    }

    fn list(&mut self) -> Vec<Entry> {
        let (mut first, mut all) = (0, Vec::new());
        loop {
            let Response::Page {
                files,
                next,
                entries,
            } = self.ask(&Request::List { first })
            else {
                unreachable!("a page");
            };
            all.extend(entries);
            if next >= files {
                return all;
            }
            assert!(next > first);
            first = next;
        }
    }

    fn read(&mut self, entry: &Entry, offset: u64, length: u16) -> Response {
        let mut digest = [0; 8];
        digest.copy_from_slice(&entry.sha256[..8]);
        let place = entry.place;
        self.ask(&Request::Read {
            place,
            digest,
            offset,
            length,
        })
    }
}

impl Drop for Bench {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.dir);
    }
}

fn refused(refusal: Refusal) -> Response {
    Response::Refused(refusal)
}

#[test]
fn without_the_token_there_is_nothing_but_refusal() {
    let mut bench = Bench::new("token", &[("a.svb", b"record")]);
    let asked = [Request::List { first: 0 }, Request::Bye];
    for request in &asked {
        assert_eq!(bench.ask(request), refused(Refusal::NoSession));
    }
    assert_eq!(
        bench.prove("correct horse batterz"),
        refused(Refusal::WrongToken(2))
    );
    for request in &asked {
        assert_eq!(bench.ask(request), refused(Refusal::NoSession));
    }
    // A guessed tag is none.
    bench.keys = Some(Keys::new("guess", 7, &[1; 16], &SERVER_NONCE));
    let head = Head {
        session: 7,
        request: 99,
    };
    let packet = asked[0].packet(head, bench.keys.as_ref());
    let back = bench.raw(&frame(&packet));
    assert_eq!(
        Response::read(&back[0], None).unwrap().1,
        refused(Refusal::NoSession)
    );
}

#[test]
fn wrong_tokens_are_answered_ever_more_seldom_and_only_quiet_time_counts() {
    let mut bench = Bench::new("wait", &[]);
    for wait in [2_u32, 4, 8, 16, 32, 64, 128, 256, 256] {
        bench.session += 1;
        assert_eq!(
            bench.prove("wrong wrong wrong"),
            refused(Refusal::WrongToken(wait))
        );
        assert_eq!(bench.prove(TOKEN), refused(Refusal::Wait(wait)));
        bench.server.quiet(u64::from(wait) * 1000 - 500);
        bench.raw(&[0x55; 5000]);
        assert_eq!(bench.prove(TOKEN), refused(Refusal::Wait(1)));
        bench.server.quiet(500);
    }
    bench.session += 1;
    assert!(matches!(bench.prove(TOKEN), Response::Welcome { .. }));
    // It is forgotten after the right one.
    bench.keys = None;
    bench.session += 1;
    assert_eq!(
        bench.prove("wrong wrong wrong"),
        refused(Refusal::WrongToken(2))
    );
}

#[test]
fn only_records_and_the_ledger_are_listed_and_read() {
    let mut bench = Bench::new(
        "only",
        &[
            ("b.svb", b"a record"),
            ("a.sve", b"encrypted"),
            ("ledger.svl", b"ledger"),
            ("device.key", b"secret"),
            ("spool.svs", b"ring"),
            (".b.svb", b"hidden"),
            ("other.svl", b"other"),
        ],
    );
    std::os::unix::fs::symlink(bench.dir.join("device.key"), bench.dir.join("link.svb")).unwrap();
    fs::create_dir(bench.dir.join("folder.svb")).unwrap();
    assert!(matches!(
        bench.prove(TOKEN),
        Response::Welcome { files: 3, .. }
    ));
    let list = bench.list();
    let names: Vec<&str> = list.iter().map(|entry| entry.name.as_str()).collect();
    assert_eq!(names, ["a.sve", "b.svb", "ledger.svl"]);
    let digest: [u8; 32] = Sha256::digest(b"a record").into();
    assert_eq!((list[1].sha256, list[1].length), (digest, 8));
    let bytes = b"record".to_vec();
    let data = Response::Data {
        place: 1,
        offset: 2,
        bytes,
    };
    assert_eq!(bench.read(&list[1], 2, 1024), data);
    // The same request again gives the same.
    assert_eq!(bench.read(&list[1], 2, 1024), data);
    for (offset, length) in [(8, 1), (0, 0), (0, 1025), (u64::MAX, 1)] {
        assert_eq!(
            bench.read(&list[1], offset, length),
            refused(Refusal::NotThere)
        );
    }
    let mut other = list[1].clone();
    other.place = 3;
    assert_eq!(bench.read(&other, 0, 8), refused(Refusal::NotThere));
    other.place = 0;
    assert_eq!(bench.read(&other, 0, 8), refused(Refusal::Changed));
    // There is no request that writes, or names a path: any other kind is refused.
    let keys = bench.keys.clone().unwrap();
    for kind in (6..=0x7f).chain([0]) {
        let mut packet = vec![kind, 7, 0, 0, 0, 1, 2, 3, 4];
        packet.extend(b"../../etc/passwd");
        packet.extend(keys.tag(&packet));
        let back = bench.raw(&frame(&packet));
        let response = Response::read(&back[0], Some(&keys)).unwrap().1;
        assert_eq!(response, refused(Refusal::Unknown));
    }
}

#[test]
fn a_file_that_was_replaced_is_refused_and_a_ledger_may_grow() {
    let mut bench = Bench::new("changed", &[("a.svb", b"a record"), ("ledger.svl", b"one")]);
    bench.prove(TOKEN);
    let list = bench.list();
    fs::write(bench.dir.join("ledger.svl"), b"one two").unwrap();
    let bytes = b"one".to_vec();
    assert_eq!(
        bench.read(&list[1], 0, 100),
        Response::Data {
            place: 1,
            offset: 0,
            bytes
        }
    );
    fs::remove_file(bench.dir.join("a.svb")).unwrap();
    assert_eq!(bench.read(&list[0], 0, 8), refused(Refusal::Changed));
    fs::write(bench.dir.join("secret"), b"a secret").unwrap();
    std::os::unix::fs::symlink(bench.dir.join("secret"), bench.dir.join("a.svb")).unwrap();
    assert_eq!(bench.read(&list[0], 0, 8), refused(Refusal::Changed));
}

#[test]
fn many_files_are_listed_page_by_page() {
    let mut bench = Bench::new("many", &[]);
    for k in 0..100_u32 {
        fs::write(
            bench.dir.join(format!("20261103T120000Z-{k:04}.svb")),
            k.to_le_bytes(),
        )
        .unwrap();
    }
    bench.prove(TOKEN);
    let list = bench.list();
    assert_eq!(list.len(), 100);
    for (place, entry) in (0..).zip(&list) {
        assert_eq!(entry.place, place);
        assert!(
            matches!(bench.read(entry, 0, 4), Response::Data { bytes, .. } if bytes == place.to_le_bytes())
        );
    }
}

#[test]
fn a_session_ends_by_silence_goodbye_or_noise_and_another_hello_does_not_end_it() {
    let mut bench = Bench::new("ends", &[("a.svb", b"record")]);
    for end in 0..3 {
        bench.keys = None;
        bench.session += 1;
        bench.prove(TOKEN);
        assert_eq!(bench.list().len(), 1);
        // Somebody without the token says hello: the session goes on.
        let head = Head {
            session: 1000,
            request: 1,
        };
        bench.raw(&frame(
            &Request::Hello { nonce: [3; 16] }.packet(head, None),
        ));
        bench.raw(&frame(
            &Request::Prove { proof: [3; 32] }.packet(head, None),
        ));
        bench.server.quiet(SILENCE_MS - 100);
        assert_eq!(bench.list().len(), 1);
        match end {
            0 => bench.server.quiet(SILENCE_MS),
            1 => assert_eq!(bench.ask(&Request::Bye), Response::Farewell),
            _ => drop(bench.raw(&vec![0x55; 2 << 20])),
        }
        assert_eq!(bench.server.ended(), end + 1);
        bench.keys = None;
        let gone = bench.ask(&Request::List { first: 0 });
        assert_eq!(gone, refused(Refusal::NoSession));
        bench.server.quiet(300_000);
    }
}

#[test]
fn sixteen_megabytes_of_garbage_hold_no_more_than_a_packet() {
    let mut bench = Bench::new("garbage", &[("a.svb", b"record")]);
    let mut state = 1_u32;
    for _ in 0..4096 {
        let mut block = [0_u8; 4096];
        for byte in &mut block {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            *byte = u8::try_from(state >> 24).unwrap();
        }
        assert!(bench.raw(&block).is_empty());
        assert!(bench.server.held() <= MAX_STUFFED);
        assert!(bench.server.news().is_empty());
    }
    assert!(matches!(bench.prove(TOKEN), Response::Welcome { .. }));
    assert_eq!(bench.list().len(), 1);
}
