//! The whole sealed record: header, second blocks, parts, triggers, completion, seal.

use std::io::{self, Write};

use sha2::{Digest, Sha256};

use crate::block::Block;
use crate::bytes;
use crate::check;
use crate::error::{Fault, SchemaError};
use crate::frame;
use crate::gnss::{self, Gnss};
use crate::header::{FORMAT_VERSION, Header, Origin};
use crate::key::SecretKey;
use crate::limits;
use crate::num;
use crate::parts::{AuxChannel, Clip, Completion, Health, RawFrame, Trigger};
use crate::sample::Sample;
use crate::scale::Scales;
use crate::seal::{ED25519, Seal, UNSIGNED, signed_message};
use crate::time::Grid;
use crate::wire;

/// A record in memory. [`Record::write`] seals it; [`Record::read`] gives it back, or an error.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    /// Header.
    pub header: Header,
    /// Second blocks in order of time.
    pub blocks: Vec<Block>,
    /// Clipped bins.
    pub clipping: Vec<Clip>,
    /// Raw frames about the triggers.
    pub raw: Vec<RawFrame>,
    /// Auxiliary signals.
    pub aux: Vec<AuxChannel>,
    /// Satellite fixes; `None` where the configuration asks for none.
    pub gnss: Option<Gnss>,
    /// Health.
    pub health: Health,
    /// Triggers in order of time; the first is t = 0.
    pub triggers: Vec<Trigger>,
    /// Completion.
    pub completion: Completion,
}

/// A stored sample at its place on the grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridSample {
    /// Index of the (first) 100 Hz bin it is the mean of.
    pub index: u64,
    /// 100, or 20 for a sample that stands for five bins.
    pub rate_hz: u8,
    /// Bins it stands for: 1 or 5.
    pub span: u64,
    /// Bins of the grid before it for which nothing was stored: not 0 only behind a gap between blocks.
    pub gap_before: u64,
    /// The values, SI and radians.
    pub sample: Sample,
}

impl Record {
    /// Whether the record can be written: every bound and value of `FORMAT.md`, without writing it.
    ///
    /// # Errors
    /// The first value that may not be stored, with its place.
    pub fn validate(&self) -> Result<(), SchemaError> {
        check::record(self)
    }

    /// Writes the sealed file and gives its (unsigned) seal. The output is streamed: at most one structure
    /// is held in memory beside the record.
    ///
    /// An auxiliary value that is not finite is stored as missing.
    ///
    /// # Errors
    /// A value that may not be stored (nothing has been written then), a part beyond its bound, or the
    /// output's own error.
    pub fn write(&self, out: &mut impl Write) -> Result<Seal, SchemaError> {
        self.write_signed(out, None)
    }

    /// As [`Record::write`], signed by the device's key if one is given. The same record and key give the same bytes.
    ///
    /// # Errors
    /// As [`Record::write`]; a replay refuses a key.
    pub fn write_signed(
        &self,
        out: &mut impl Write,
        key: Option<&SecretKey>,
    ) -> Result<Seal, SchemaError> {
        if key.is_some() && matches!(self.header.origin, Origin::Replay { .. }) {
            let fault = Fault::new("kind", "0: a replay is never signed by the device", ED25519);
            return Err(fault.at("seal", None));
        }
        self.validate()?;
        let header = wire::encode::<{ limits::MAX_HEADER_BYTES }, _>("header", &self.header)?;
        let health = wire::encode::<{ limits::MAX_HEALTH_BYTES }, _>("health", &self.health)?;
        let triggers =
            wire::encode::<{ limits::MAX_TRIGGERS_BYTES }, _>("triggers", &self.triggers)?;
        let completion =
            wire::encode::<{ limits::MAX_COMPLETION_BYTES }, _>("completion", &self.completion)?;

        let mut out = Hashing::new(out);
        let mut body = Vec::new();
        out.write_all(&frame::MAGIC)?;
        body.extend(FORMAT_VERSION.0.to_le_bytes());
        let minor = if self.gnss.is_some() {
            FORMAT_VERSION.1
        } else {
            0
        };
        body.extend(minor.to_le_bytes());
        body.extend(header);
        frame::write(&mut out, frame::HEADER, &body)?;
        for block in &self.blocks {
            body.clear();
            bytes::put_block(&mut body, block)?;
            frame::write(&mut out, frame::BLOCK, &body)?;
        }
        body.clear();
        bytes::put_clipping(&mut body, &self.clipping)?;
        frame::write(&mut out, frame::CLIPPING, &body)?;
        body.clear();
        bytes::put_raw(&mut body, &self.raw)?;
        frame::write(&mut out, frame::RAW, &body)?;
        body.clear();
        bytes::put_aux(&mut body, &self.aux)?;
        frame::write(&mut out, frame::AUX, &body)?;
        if let Some(part) = &self.gnss {
            body.clear();
            gnss::put(&mut body, part)?;
            frame::write(&mut out, frame::GNSS, &body)?;
        }
        frame::write(&mut out, frame::HEALTH, &health)?;
        frame::write(&mut out, frame::TRIGGERS, &triggers)?;
        frame::write(&mut out, frame::COMPLETION, &completion)?;
        out.seal(key)
    }

    /// UTC of the first trigger, ns since 1970; of the first sample if there is no trigger. The name by which a
    /// ledger entry knows the event.
    #[must_use]
    pub fn utc_ns(&self) -> i64 {
        self.zero_ns().saturating_add(self.header.clock.offset_ns)
    }

    /// Time zero on the monotonic clock, ns: the first trigger, the first sample if there is no trigger, 0 without any.
    #[must_use]
    pub fn zero_ns(&self) -> i64 {
        let sample = || self.blocks.first().map_or(0, |block| block.monotonic_ns);
        let first = self.triggers.first();
        first.map_or_else(sample, |trigger| trigger.monotonic_ns)
    }

    /// The sealed file in memory: see [`Record::write`].
    ///
    /// # Errors
    /// As [`Record::write`].
    pub fn to_bytes(&self) -> Result<Vec<u8>, SchemaError> {
        let mut out = Vec::new();
        self.write(&mut out)?;
        Ok(out)
    }

    /// The scales of its samples.
    #[must_use]
    pub fn scales(&self) -> Scales {
        self.header.scales()
    }

    /// Every stored sample in grid order, as physical values, with each block's remainder where it belongs
    /// ([`Block::values`]). Missing fields are `None`; bins of which
    /// nothing was stored show as [`GridSample::gap_before`].
    pub fn samples(&self) -> impl Iterator<Item = GridSample> + '_ {
        let scales = self.scales();
        let mut next = self.first_index();
        let stored = self.blocks.iter().flat_map(move |block| {
            let place = move |number: usize| block.first_index + num::u64_of(number) * block.span();
            let values = block.values(&scales).enumerate();
            values.map(move |(number, sample)| (block, place(number), sample))
        });
        stored.map(move |(block, index, sample)| {
            let gap_before = index.saturating_sub(next);
            next = index.saturating_add(block.span());
            GridSample {
                index,
                rate_hz: block.rate_hz,
                span: block.span(),
                gap_before,
                sample,
            }
        })
    }

    /// Index of the first stored sample; 0 without any.
    #[must_use]
    pub fn first_index(&self) -> u64 {
        self.blocks.first().map_or(0, |block| block.first_index)
    }

    /// Index behind the last stored sample; 0 without any.
    #[must_use]
    pub fn end_index(&self) -> u64 {
        self.blocks.last().map_or(0, Block::end_index)
    }

    /// The grid of the samples on the monotonic clock and in UTC. Without blocks bin 0 starts at the clock's 0.
    #[must_use]
    pub fn grid(&self) -> Grid {
        let utc_offset_ns = self.header.clock.offset_ns;
        let first = self.blocks.first();
        let grid = first.and_then(|block| {
            Grid::through(block.first_index, block.monotonic_ns, utc_offset_ns).ok()
        });
        grid.unwrap_or(Grid {
            origin_ns: 0,
            utc_offset_ns,
        })
    }

    /// Start of bin `index` on the monotonic clock, ns.
    #[must_use]
    pub fn monotonic_ns(&self, index: u64) -> i64 {
        self.grid().monotonic_ns(index)
    }

    /// Start of bin `index` in seconds from the first trigger (negative before it); from the first sample if
    /// the record has no trigger. A bin ends 10 ms later, at `time_s(index + 1)`.
    #[must_use]
    pub fn time_s(&self, index: u64) -> f64 {
        num::real_i64(self.monotonic_ns(index).saturating_sub(self.zero_ns())) * 1e-9
    }
}

/// Passes bytes on and hashes them.
struct Hashing<'a, W: Write> {
    out: &'a mut W,
    hash: Sha256,
}

impl<'a, W: Write> Hashing<'a, W> {
    fn new(out: &'a mut W) -> Self {
        Self {
            out,
            hash: Sha256::new(),
        }
    }

    /// Writes the seal of all bytes so far: kind under the digest, digest, signature, check.
    fn seal(mut self, key: Option<&SecretKey>) -> Result<Seal, SchemaError> {
        let kind = if key.is_some() { ED25519 } else { UNSIGNED };
        let length = frame::SEAL_BYTES[usize::from(key.is_some())];
        let head = frame::head(frame::SEAL, wire::length32("seal", length)?);
        self.write_all(&head)?;
        self.write_all(&[kind])?;
        let sha256: [u8; 32] = self.hash.finalize().into();
        let signature = key.map(|key| key.sign(&signed_message(&sha256)));
        let signed: &[u8] = signature.as_ref().map_or(&[], |bytes| bytes);
        let check = [&head[..], &[kind], &sha256, signed]
            .iter()
            .fold(0, |check, bytes| crc32c::crc32c_append(check, bytes));
        self.out.write_all(&sha256)?;
        self.out.write_all(signed)?;
        self.out.write_all(&check.to_le_bytes())?;
        Ok(Seal { sha256, signature })
    }
}

impl<W: Write> Write for Hashing<'_, W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.out.write(bytes)?;
        self.hash.update(&bytes[..written.min(bytes.len())]);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}
