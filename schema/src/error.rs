//! What can be wrong with a record: where, what was expected, what was found.

/// An error of the record format.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SchemaError {
    /// The file ends before the structure does.
    #[error(
        "{place}: offset {offset}: expected {expected} more bytes, found {found} before the end of the file"
    )]
    Truncated {
        /// Structure being read.
        place: String,
        /// Byte offset in the file.
        offset: u64,
        /// Bytes needed.
        expected: u64,
        /// Bytes left.
        found: u64,
    },
}
