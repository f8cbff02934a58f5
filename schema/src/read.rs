//! Reading a sealed record: strict and total. Every check must hold, or there is an error that says where.

use sha2::{Digest, Sha256};

use crate::block::Block;
use crate::bytes;
use crate::check;
use crate::error::{Fault, SchemaError};
use crate::frame::{self, Head, Tag};
use crate::gnss::{self, Gnss};
use crate::header::{FORMAT_VERSION, Header, Origin};
use crate::limits;
use crate::num;
use crate::parts::{AuxChannel, Clip, Completion, Health, RawFrame, Trigger};
use crate::record::Record;
use crate::seal::{ED25519, Seal, UNSIGNED};
use crate::wire::{self, Cursor, too_large};

impl Record {
    /// Reads a sealed file and gives the record and its seal, or an error: any flipped bit, missing or
    /// additional byte is refused. A signature is handed out as it stands, not verified (that takes a key).
    ///
    /// # Errors
    /// The first thing found wrong, with its place.
    pub fn read(file: &[u8]) -> Result<(Self, Seal), SchemaError> {
        if file.len() > limits::MAX_FILE_BYTES {
            return Err(too_large(
                "file",
                num::u64_of(limits::MAX_FILE_BYTES),
                file.len(),
                "bytes",
            ));
        }
        magic(file)?;
        let head = frame::read_head(file, frame::MAGIC.len())?;
        let mut parts = header(file, &head)?;
        let mut at = head.end();
        let mut rank = 0;
        loop {
            let head = frame::read_head(file, at)?;
            let body = frame::read_body(file, &head)?;
            if let Some(here) = frame::rank(head.tag) {
                if here < rank || here == 0 {
                    return Err(out_of_order(
                        &head,
                        &format!("{} or what follows it", frame::name(frame::ORDER[rank])),
                    ));
                }
                rank = here;
            }
            at = head.end();
            if head.tag == frame::SEAL {
                let seal = seal(file, &head, body)?;
                if file.len() > at {
                    return Err(SchemaError::Trailing {
                        place: "file".to_owned(),
                        offset: num::u64_of(at),
                        found: num::u64_of(file.len() - at),
                    });
                }
                return Ok((parts.finish(&head, &seal)?, seal));
            }
            parts.add(&head, body)?;
        }
    }
}

/// The magic bytes, or an error that tells text mode and encryption from another kind of file.
pub(crate) fn magic(file: &[u8]) -> Result<(), SchemaError> {
    let found = file.get(..frame::MAGIC.len()).unwrap_or(file);
    if found == frame::MAGIC {
        return Ok(());
    }
    if found == frame::ENCRYPTED_MAGIC {
        return Err(SchemaError::Encrypted);
    }
    let text_mode: [&[u8]; 4] = [
        b"\x89SVB\n\x1a\n",
        b"\x89SVB\r\r\n\x1a",
        b"\x89SVB\r\r\x1a",
        b"\x09SVB\r\n\x1a\n",
    ];
    let found = found.to_vec();
    if text_mode.iter().any(|changed| found.starts_with(changed)) {
        return Err(SchemaError::TextMode { found });
    }
    Err(SchemaError::Magic { found })
}

/// The header structure at `head`, to which the others are added.
pub(crate) fn header(file: &[u8], head: &Head) -> Result<Assembly, SchemaError> {
    if head.tag != frame::HEADER {
        return Err(out_of_order(head, "the header"));
    }
    let mut cursor = Cursor::new("header", frame::read_body(file, head)?, head.body_at());
    let (major, minor) = (cursor.u16()?, cursor.u16()?);
    if major != FORMAT_VERSION.0 {
        let offset = num::u64_of(head.body_at());
        return Err(SchemaError::Version {
            offset,
            major,
            minor,
        });
    }
    let fields = cursor.take(cursor.left())?;
    let header: Header =
        wire::decode::<{ limits::MAX_HEADER_BYTES }, _>("header", head.body_at() + 4, fields)?;
    check::header(&header).map_err(|fault| fault.at("header", Some(num::u64_of(head.at))))?;
    Ok(Assembly::new(header, minor))
}

fn out_of_order(head: &Head, expected: &str) -> SchemaError {
    SchemaError::Order {
        offset: num::u64_of(head.at),
        expected: expected.to_owned(),
        found: frame::name(head.tag),
    }
}

/// The seal whose structure is at `head`: its digest must be that of every byte before the digest.
pub(crate) fn seal(file: &[u8], head: &Head, body: &[u8]) -> Result<Seal, SchemaError> {
    let mut cursor = Cursor::new("seal", body, head.body_at());
    let kind = cursor.u8()?;
    let stored: [u8; 32] = cursor.array()?;
    let signature = match kind {
        UNSIGNED => None,
        ED25519 => Some(cursor.array()?),
        other => {
            let fault = Fault::new("kind", "0 (unsigned) or 1 (Ed25519)", other);
            return Err(fault.at("seal", Some(num::u64_of(head.at))));
        }
    };
    cursor.end()?;
    let digest_at = head.body_at() + 1;
    let computed: [u8; 32] = Sha256::digest(file.get(..digest_at).unwrap_or(file)).into();
    if stored != computed {
        return Err(SchemaError::Digest {
            offset: num::u64_of(digest_at),
            stored,
            computed,
        });
    }
    Ok(Seal {
        sha256: stored,
        signature,
    })
}

/// The record as it comes together, structure by structure.
pub(crate) struct Assembly {
    header: Header,
    /// By its version the record has satellite fixes.
    has_gnss: bool,
    blocks: Vec<Block>,
    clipping: Option<Vec<Clip>>,
    raw: Option<Vec<RawFrame>>,
    aux: Option<Vec<AuxChannel>>,
    gnss: Option<Gnss>,
    health: Option<Health>,
    triggers: Option<Vec<Trigger>>,
    completion: Option<Completion>,
}

impl Assembly {
    fn new(header: Header, minor: u16) -> Self {
        Self {
            header,
            has_gnss: minor == FORMAT_VERSION.1,
            blocks: Vec::new(),
            clipping: None,
            raw: None,
            aux: None,
            gnss: None,
            health: None,
            triggers: None,
            completion: None,
        }
    }

    /// Decodes, checks and keeps one structure; a tag that is not known is skipped.
    pub(crate) fn add(&mut self, head: &Head, body: &[u8]) -> Result<(), SchemaError> {
        let (at, offset) = (head.body_at(), Some(num::u64_of(head.at)));
        match head.tag {
            frame::BLOCK => self.add_block(head, body),
            frame::CLIPPING => {
                let clips = bytes::clipping(body, at)?;
                check::each(&clips, check::clip).map_err(|fault| fault.at("clipping", offset))?;
                once(&mut self.clipping, clips, head)
            }
            frame::RAW => {
                let frames = bytes::raw(body, at)?;
                check::each(&frames, |number, frame| {
                    check::raw(number, frame, &self.header)
                })
                .map_err(|fault| fault.at("raw frames", offset))?;
                once(&mut self.raw, frames, head)
            }
            frame::AUX => once(&mut self.aux, bytes::aux(body, at)?, head),
            frame::GNSS => {
                let part = gnss::parse(body, at)?;
                gnss::check(&part).map_err(|fault| fault.at("satellite fixes", offset))?;
                once(&mut self.gnss, part, head)
            }
            frame::HEALTH => {
                let health = wire::decode::<{ limits::MAX_HEALTH_BYTES }, _>("health", at, body)?;
                once(&mut self.health, health, head)
            }
            frame::TRIGGERS => {
                let triggers: Vec<Trigger> =
                    wire::decode::<{ limits::MAX_TRIGGERS_BYTES }, _>("triggers", at, body)?;
                check::each(&triggers, check::trigger)
                    .map_err(|fault| fault.at("triggers", offset))?;
                once(&mut self.triggers, triggers, head)
            }
            frame::COMPLETION => {
                let completion =
                    wire::decode::<{ limits::MAX_COMPLETION_BYTES }, _>("completion", at, body)?;
                once(&mut self.completion, completion, head)
            }
            frame::HEADER | frame::SEAL => Err(out_of_order(head, "blocks or parts")),
            _ => Ok(()),
        }
    }

    fn add_block(&mut self, head: &Head, body: &[u8]) -> Result<(), SchemaError> {
        let place = format!("block {}", self.blocks.len());
        if self.blocks.len() >= limits::MAX_BLOCKS {
            let limit = num::u64_of(limits::MAX_BLOCKS);
            return Err(too_large("file", limit, self.blocks.len() + 1, "blocks"));
        }
        let block = bytes::block(&place, body, head.body_at())?;
        check::block(&block, &self.header)
            .and_then(|()| check::follows(self.blocks.last(), &block))
            .map_err(|fault| fault.at(place, Some(num::u64_of(head.at))))?;
        self.blocks.push(block);
        Ok(())
    }

    /// The tags of the parts that were not found.
    pub(crate) fn lost(&self) -> Vec<Tag> {
        let found = [
            (frame::BLOCK, !self.blocks.is_empty()),
            (frame::CLIPPING, self.clipping.is_some()),
            (frame::RAW, self.raw.is_some()),
            (frame::AUX, self.aux.is_some()),
            (frame::GNSS, self.gnss.is_some() || !self.has_gnss),
            (frame::HEALTH, self.health.is_some()),
            (frame::TRIGGERS, self.triggers.is_some()),
            (frame::COMPLETION, self.completion.is_some()),
        ];
        found
            .iter()
            .filter(|(_, found)| !found)
            .map(|(tag, _)| *tag)
            .collect()
    }

    /// What was found; what was not is empty.
    pub(crate) fn salvage(self) -> Record {
        Record {
            header: self.header,
            blocks: self.blocks,
            clipping: self.clipping.unwrap_or_default(),
            raw: self.raw.unwrap_or_default(),
            aux: self.aux.unwrap_or_default(),
            gnss: self.gnss,
            health: self.health.unwrap_or_default(),
            triggers: self.triggers.unwrap_or_default(),
            completion: self.completion.unwrap_or_else(|| Completion {
                complete: false,
                reasons: vec![
                    "the part that says whether the record is complete is damaged".to_owned(),
                ],
                ends_at_rest: false,
            }),
        }
    }

    /// The whole record; `head` is that of the seal, before which everything must stand.
    fn finish(self, head: &Head, seal: &Seal) -> Result<Record, SchemaError> {
        if seal.signature.is_some() && matches!(self.header.origin, Origin::Replay { .. }) {
            let fault = Fault::new("kind", "0: a replay is never signed by the device", ED25519);
            return Err(fault.at("seal", Some(num::u64_of(head.at))));
        }
        let missing = |tag| out_of_order(head, &frame::name(tag));
        if self.blocks.is_empty() {
            return Err(missing(frame::BLOCK));
        }
        if self.has_gnss && self.gnss.is_none() {
            return Err(missing(frame::GNSS));
        }
        Ok(Record {
            header: self.header,
            blocks: self.blocks,
            clipping: self.clipping.ok_or_else(|| missing(frame::CLIPPING))?,
            raw: self.raw.ok_or_else(|| missing(frame::RAW))?,
            aux: self.aux.ok_or_else(|| missing(frame::AUX))?,
            gnss: self.gnss,
            health: self.health.ok_or_else(|| missing(frame::HEALTH))?,
            triggers: self.triggers.ok_or_else(|| missing(frame::TRIGGERS))?,
            completion: self.completion.ok_or_else(|| missing(frame::COMPLETION))?,
        })
    }
}

/// Keeps a part that may stand in a record but once.
fn once<T>(place: &mut Option<T>, part: T, head: &Head) -> Result<(), SchemaError> {
    if place.is_some() {
        return Err(out_of_order(
            head,
            &format!("{} only once", frame::name(head.tag)),
        ));
    }
    *place = Some(part);
    Ok(())
}
