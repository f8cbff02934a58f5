//! One file over the line: several requests are under way, so that the line is never idle, and their size follows
//! the noise.
//!
//! The recorder answers in the order it is asked. An answer therefore says that all that was asked before it and is
//! not answered is lost, which is asked again at once; only when the last answers are lost does a time-out tell.

use std::collections::BTreeMap;

use schema::num;
use schema::serial::{Entry, MAX_DATA, Request, Response};

use super::FetchError;
use super::link::{Link, Port};

/// Most bytes that are asked for and not here.
const WINDOW_BYTES: usize = 4 * MAX_DATA;
/// Most requests under way.
const WINDOW: usize = 16;
/// Fewest bytes that are asked for at once.
const LEAST: u16 = 64;
/// Answers in a row after which more is asked for at once.
const GOOD_RUN: u32 = 8;
/// Bytes by which what came may be ahead of the first byte that is missing.
const AHEAD: u64 = 64 << 10;

struct Asked {
    number: u32,
    offset: u64,
    length: u16,
    /// Counts all that is sent.
    order: u64,
}

struct Window {
    asked: Vec<Asked>,
    /// Lost and not asked for again yet: offset and length.
    lost: BTreeMap<u64, u16>,
    /// Came before something that is missing.
    early: BTreeMap<u64, Vec<u8>>,
    next: u64,
    done: u64,
    end: u64,
    size: u16,
    run: u32,
    order: u64,
}

/// Reads a file from an offset on; `take` gets its bytes in order.
///
/// # Errors
/// When the line fails, the recorder refuses, or `take` fails.
pub fn read<P: Port>(
    link: &mut Link<P>,
    entry: &Entry,
    from: u64,
    take: &mut dyn FnMut(&[u8]) -> Result<(), FetchError>,
) -> Result<(), FetchError> {
    let mut window = Window {
        asked: Vec::new(),
        lost: BTreeMap::new(),
        early: BTreeMap::new(),
        next: from,
        done: from,
        end: entry.length,
        size: u16::try_from(MAX_DATA).unwrap_or(LEAST),
        run: 0,
        order: 0,
    };
    while window.done < window.end {
        window.fill(link, entry)?;
        match link.receive()? {
            None => window.all_lost(),
            Some((
                number,
                Response::Data {
                    place,
                    offset,
                    bytes,
                },
            )) if place == entry.place => {
                window.came(number, offset, bytes);
            }
            Some((number, Response::Refused(refusal))) => {
                if window.asked.iter().any(|asked| asked.number == number) {
                    return Err(refusal.into());
                }
            }
            Some(_) => {}
        }
        while let Some(bytes) = window.early.remove(&window.done) {
            take(&bytes)?;
            window.done += num::u64_of(bytes.len());
        }
    }
    Ok(())
}

impl Window {
    fn fill<P: Port>(&mut self, link: &mut Link<P>, entry: &Entry) -> Result<(), FetchError> {
        while self.asked.len() < WINDOW && self.under_way() + usize::from(self.size) <= WINDOW_BYTES
        {
            let (offset, length) = if let Some((offset, length)) = self.lost.pop_first() {
                let now = length.min(self.size);
                if now < length {
                    self.lost.insert(offset + u64::from(now), length - now);
                }
                (offset, now)
            } else if self.next < self.end && self.next < self.done + AHEAD {
                let left = u16::try_from(self.end - self.next).unwrap_or(u16::MAX);
                let (offset, now) = (self.next, left.min(self.size));
                self.next += u64::from(now);
                (offset, now)
            } else {
                return Ok(());
            };
            let number = link.next_number();
            self.order += 1;
            let order = self.order;
            self.asked.push(Asked {
                number,
                offset,
                length,
                order,
            });
            let mut digest = [0; 8];
            digest.copy_from_slice(&entry.sha256[..8]);
            let request = Request::Read {
                place: entry.place,
                digest,
                offset,
                length,
            };
            link.send(number, &request)?;
        }
        Ok(())
    }

    fn under_way(&self) -> usize {
        let lengths = self.asked.iter().map(|asked| usize::from(asked.length));
        lengths.sum()
    }

    fn came(&mut self, number: u32, offset: u64, bytes: Vec<u8>) {
        let fits = |asked: &Asked| {
            asked.number == number
                && asked.offset == offset
                && usize::from(asked.length) == bytes.len()
        };
        // Not asked for, or asked for no more: a doubled or a late answer.
        let Some(at) = self.asked.iter().position(fits) else {
            return;
        };
        let answered = self.asked.swap_remove(at);
        self.early.insert(offset, bytes);
        self.run += 1;
        if self.run >= GOOD_RUN {
            self.run = 0;
            self.size = (self.size * 2).min(u16::try_from(MAX_DATA).unwrap_or(LEAST));
        }
        self.give_up(|asked| asked.order < answered.order);
    }

    fn all_lost(&mut self) {
        self.give_up(|_| true);
    }

    fn give_up(&mut self, lost: impl Fn(&Asked) -> bool) {
        let mut shrink = false;
        for asked in self.asked.extract_if(.., |asked| lost(asked)) {
            self.lost.insert(asked.offset, asked.length);
            // Several of one size that are lost together make it smaller once.
            shrink |= asked.length >= self.size;
            self.run = 0;
        }
        if shrink {
            self.size = (self.size / 2).max(LEAST);
        }
    }
}
