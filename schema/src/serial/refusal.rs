//! Why a request is refused.

/// Why a request is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Refusal {
    /// There is no such session, or it has ended: begin anew.
    #[error("there is no such session")]
    NoSession,
    /// The proof is wrong.
    #[error("the token is wrong; the next attempt is answered after {0} s")]
    WrongToken(u32),
    /// After wrong proofs nothing is answered for a time.
    #[error("too many wrong tokens; the next attempt is answered after {0} s")]
    Wait(u32),
    /// Another version of the protocol.
    #[error("the recorder speaks version {0} of the protocol")]
    Version(u32),
    /// There is no such file in the list, or no such bytes in the file.
    #[error("there is no such file or part of it")]
    NotThere,
    /// The file is not as it was listed: list anew.
    #[error("the file has changed since it was listed, or is gone")]
    Changed,
    /// The file could not be read.
    #[error("the recorder could not read the file")]
    Unreadable,
    /// No request that this version knows.
    #[error("the recorder does not know this request")]
    Unknown,
    /// A reason that this version does not know.
    #[error("refused for reason {0}")]
    Other(u8),
}

impl Refusal {
    pub(super) fn code(self) -> (u8, u32) {
        match self {
            Self::NoSession => (1, 0),
            Self::WrongToken(seconds) => (2, seconds),
            Self::Wait(seconds) => (3, seconds),
            Self::Version(version) => (4, version),
            Self::NotThere => (5, 0),
            Self::Changed => (6, 0),
            Self::Unreadable => (7, 0),
            Self::Unknown => (8, 0),
            Self::Other(code) => (code, 0),
        }
    }

    pub(super) fn from_code(code: u8, detail: u32) -> Self {
        match code {
            1 => Self::NoSession,
            2 => Self::WrongToken(detail),
            3 => Self::Wait(detail),
            4 => Self::Version(detail),
            5 => Self::NotThere,
            6 => Self::Changed,
            7 => Self::Unreadable,
            8 => Self::Unknown,
            other => Self::Other(other),
        }
    }
}
