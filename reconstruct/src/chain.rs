//! Whether records are what one recorder sealed, all of it, and whose: signatures, chain, ledger.
//!
//! What is checked here goes beyond one file. [`judge`] takes what is known of each record and of the ledger, and gives
//! one sentence for each thing that does not hold. A chain can not show that the *newest* records were taken away; the
//! ledger can, unless its own newest entries were cut off with them.

use std::collections::BTreeMap;

use schema::ledger::audit::Audit;
use schema::seal::Hex;
use schema::{PublicKey, Seal};

use crate::export::fixed::utc;

/// What is known of one record.
#[derive(Clone, Debug)]
pub struct Link {
    /// Its file's name.
    pub file: String,
    /// Its number.
    pub number: u64,
    /// Digest of the record before, as it says.
    pub previous_sha256: [u8; 32],
    /// UTC of its first trigger, ns since 1970.
    pub utc_ns: i64,
    /// Received live; a replay is in no chain.
    pub live: bool,
    /// Its seal; `None` where the file is not as it was sealed.
    pub seal: Option<Seal>,
}

/// Who signed a record.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Identity {
    /// This key, which was given or is vouched for by one that was.
    Proven(PublicKey),
    /// Signed; no key was given.
    Unchecked,
    /// It carries no signature: a replay never does.
    Unsigned,
    /// Signed by none of the keys that were given or are vouched for.
    Stranger,
    /// Nothing can be said of a file that is not as it was sealed.
    Broken,
}

/// The ledger as it was found.
#[derive(Clone, Debug)]
pub struct Book {
    /// What it shows.
    pub audit: Audit,
    /// All records of its folder were given, so that one that is not there is missing.
    pub whole_folder: bool,
}

/// The finding over all records.
#[derive(Clone, Debug, Default)]
pub struct Finding {
    /// Who signed each record, in the order given.
    pub identities: Vec<Identity>,
    /// What does not hold, one sentence each.
    pub breaks: Vec<String>,
    /// What a reader should know and is no break.
    pub notes: Vec<String>,
}

impl Finding {
    /// Everything holds and every record is proven to be of a given key.
    #[must_use]
    pub fn sound(&self) -> bool {
        let proven = |identity: &Identity| matches!(identity, Identity::Proven(_));
        self.breaks.is_empty() && self.identities.iter().all(proven)
    }
}

/// Checks records, chain and ledger against the keys that are trusted.
#[must_use]
pub fn judge(links: &[Link], book: Option<&Book>, trusted: &[PublicKey]) -> Finding {
    let mut finding = Finding::default();
    if let Some(book) = book {
        finding.breaks.extend(book.audit.breaks.iter().cloned());
        ledger_identity(book, trusted, &mut finding);
    }
    for link in links {
        let identity = identity(link, book, trusted);
        if identity == Identity::Stranger {
            finding.breaks.push(format!(
                "{}: expected a signature by the given key, or by one that the ledger links to it, found another signature",
                link.file
            ));
        }
        finding.identities.push(identity);
    }
    let mut chain: BTreeMap<u64, &Link> = BTreeMap::new();
    for link in links.iter().filter(|link| link.live) {
        if let Some(other) = chain.get(&link.number) {
            twins(other, link, &mut finding);
            continue;
        }
        chain.insert(link.number, link);
        if let Some(book) = book {
            entered(link, book, &mut finding);
        }
    }
    order(&chain, book, &mut finding);
    if let Some(book) = book {
        absent(&chain, book, &mut finding);
    }
    finding
}

fn ledger_identity(book: &Book, trusted: &[PublicKey], finding: &mut Finding) {
    let keys = &book.audit.keys;
    if book.audit.unsigned > 0 {
        let unsigned = book.audit.unsigned;
        finding.notes.push(format!(
            "the ledger has {unsigned} entries without a signature: who made them is unproven"
        ));
    }
    if !trusted.is_empty() && !keys.iter().any(|change| trusted.contains(&change.key)) {
        finding.breaks.push(match keys.last() {
            None => "ledger: expected the given key among its own, found none: it is not signed"
                .to_owned(),
            Some(last) => format!(
                "ledger: expected the given key among its own, found {}",
                last.key
            ),
        });
    }
    for change in keys.iter().filter(|change| change.by_the_old) {
        let when = match change.change.utc_ns {
            0 => String::new(),
            at => format!(" on {}", utc(at)),
        };
        finding.notes.push(format!(
            "the key was changed to {}{when}, signed by the key before",
            change.key
        ));
    }
}

fn identity(link: &Link, book: Option<&Book>, trusted: &[PublicKey]) -> Identity {
    let Some(seal) = &link.seal else {
        return Identity::Broken;
    };
    if seal.signature.is_none() {
        return Identity::Unsigned;
    }
    if trusted.is_empty() {
        return Identity::Unchecked;
    }
    if let Some(key) = trusted.iter().find(|key| seal.signed_by(key)) {
        return Identity::Proven(*key);
    }
    // A key that the ledger links to a trusted one: only by a ledger in which nothing is wrong, and for records in it.
    let vouched = book.filter(|book| book.audit.breaks.is_empty());
    let vouched = vouched.and_then(|book| {
        let entry = book.audit.records.get(&link.number)?;
        let key = entry.key.filter(|key| seal.signed_by(key))?;
        let linked = trusted
            .iter()
            .any(|trusted| book.audit.vouches(trusted, &key));
        (linked && entry.sealed.sha256 == seal.sha256).then_some(key)
    });
    vouched.map_or(Identity::Stranger, Identity::Proven)
}

fn twins(one: &Link, other: &Link, finding: &mut Finding) {
    let digest = |link: &Link| link.seal.map(|seal| seal.sha256);
    if digest(one) == digest(other) {
        finding.notes.push(format!(
            "{} and {} are the same record",
            one.file, other.file
        ));
    } else {
        finding.breaks.push(format!(
            "{}: expected the only record {}, found another in {}",
            other.file, one.number, one.file
        ));
    }
}

fn entered(link: &Link, book: &Book, finding: &mut Finding) {
    let Some(entry) = book.audit.records.get(&link.number) else {
        finding.breaks.push(format!(
            "{}: expected record {} in the ledger, found no entry of it",
            link.file, link.number
        ));
        return;
    };
    let Some(seal) = &link.seal else {
        return;
    };
    if seal.sha256 != entry.sealed.sha256 {
        finding.breaks.push(format!(
            "{}: expected the digest that the ledger has for record {}, {}, found {}",
            link.file,
            link.number,
            Hex(&entry.sealed.sha256),
            Hex(&seal.sha256)
        ));
        return;
    }
    if link.utc_ns != entry.sealed.utc_ns {
        finding.breaks.push(format!(
            "{}: expected the time that the ledger has for record {}, {}, found {}",
            link.file,
            link.number,
            utc(entry.sealed.utc_ns),
            utc(link.utc_ns)
        ));
    }
    if let Some(key) = entry.key
        && !seal.signed_by(&key)
        && !entry.sealed.flags.adopted
    {
        finding.breaks.push(format!(
            "{}: expected a signature by {key}, the key in force when it was entered, found {}",
            link.file,
            if seal.signature.is_some() {
                "another"
            } else {
                "none"
            }
        ));
    }
    if entry.sealed.flags.adopted {
        finding.notes.push(format!(
            "{}: entered in the ledger after the fact, when its own entry was not found",
            link.file
        ));
    }
    if entry.removed.is_some() {
        finding.notes.push(format!(
            "{}: the ledger says that record {} was removed by the keep rule; here it is",
            link.file, link.number
        ));
    }
}

/// Each record names the one before; what lies between two is explained by the ledger or is missing.
fn order(chain: &BTreeMap<u64, &Link>, book: Option<&Book>, finding: &mut Finding) {
    let mut before: Option<&Link> = None;
    for (&number, &link) in chain {
        let known = before
            .filter(|before| before.number + 1 == number)
            .and_then(|before| before.seal.map(|seal| seal.sha256));
        let entered = number
            .checked_sub(1)
            .and_then(|number| book?.audit.records.get(&number))
            .map(|entered| entered.sealed.sha256);
        let expected = match (known, entered) {
            (None, None) if number == 1 => Some([0; 32]),
            (known, entered) => known.or(entered),
        };
        if link.seal.is_some()
            && let Some(expected) = expected
            && expected != link.previous_sha256
        {
            finding.breaks.push(format!(
                "{}: expected it to name {} as the record before it, found {}: record {} was changed or replaced, or is of another chain",
                link.file,
                Hex(&expected),
                Hex(&link.previous_sha256),
                number.saturating_sub(1)
            ));
        }
        if let Some(before) = before {
            gap(before.number, number, book, finding);
        } else if number > 1 && book.is_none() {
            finding.notes.push(format!(
                "records before {number} were not given, and no ledger to tell of them"
            ));
        }
        before = Some(link);
    }
    if book.is_none() && !chain.is_empty() {
        finding.notes.push(
            "no ledger was found: that newer records were taken away can not be told".to_owned(),
        );
    }
}

fn gap(from: u64, to: u64, book: Option<&Book>, finding: &mut Finding) {
    let missing = to - from - 1;
    if missing == 0 {
        return;
    }
    let range = from + 1..to;
    let name = if missing == 1 {
        format!("record {}", from + 1)
    } else {
        format!("records {} to {}", from + 1, to - 1)
    };
    let Some(book) = book else {
        finding.breaks.push(format!(
            "chain: expected {name} between {from} and {to}, found a gap: removed by the keep rule or taken away, which only a ledger tells"
        ));
        return;
    };
    let removed = book
        .audit
        .records
        .range(range)
        .filter(|(_, r)| r.removed.is_some())
        .count();
    if schema::num::u64_of(removed) == missing {
        let text = format!("chain: {name} removed by the keep rule, as the ledger says");
        finding.notes.push(text);
    } else {
        finding.breaks.push(format!(
            "chain: expected {name} between {from} and {to}, found a gap of which the ledger explains {removed} of {missing}"
        ));
    }
}

/// Records that the ledger has, that were not removed, and that are not here.
fn absent(chain: &BTreeMap<u64, &Link>, book: &Book, finding: &mut Finding) {
    let missing: Vec<_> = book
        .audit
        .records
        .iter()
        .filter(|(number, entered)| entered.removed.is_none() && !chain.contains_key(number))
        .collect();
    if !book.whole_folder {
        if !missing.is_empty() && !chain.is_empty() {
            finding.notes.push(format!(
                "the ledger has {} more records that were not given",
                missing.len()
            ));
        }
        return;
    }
    let all = book.audit.records.values();
    let removed = all.filter(|entered| entered.removed.is_some()).count();
    if removed > 0 {
        finding.notes.push(format!(
            "{removed} of the {} records of the ledger were removed by the keep rule, as it says",
            book.audit.records.len()
        ));
    }
    for (number, entered) in missing {
        finding.breaks.push(format!(
            "ledger: expected record {number} of {} in the folder, found no such record: taken away or lost",
            utc(entered.sealed.utc_ns)
        ));
    }
}
