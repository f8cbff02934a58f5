//! The token is never sent. Each side sends a random number and proves by HMAC-SHA-256 (RFC 2104) over both that it
//! knows the token; from then on each packet carries a tag by a key of this session alone.

use hmac::{Hmac, KeyInit, Mac};
use sha2::Sha256;

/// Bytes of the random number of each side.
pub const NONCE_BYTES: usize = 16;
/// Bytes of a proof.
pub const PROOF_BYTES: usize = 32;
/// Bytes of a packet's tag: the first of its HMAC.
pub const TAG_BYTES: usize = 8;

const CLIENT: &[u8] = b"svartboks serial v1 client\0";
const SERVER: &[u8] = b"svartboks serial v1 server\0";
const KEY: &[u8] = b"svartboks serial v1 key\0";

/// What both sides know in a session: the proofs they owe each other, and the key of the tags.
#[derive(Clone)]
pub struct Keys {
    client: Hmac<Sha256>,
    server: Hmac<Sha256>,
    tags: Hmac<Sha256>,
}

impl std::fmt::Debug for Keys {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Keys")
    }
}

fn keyed(key: &[u8]) -> Hmac<Sha256> {
    // HMAC takes a key of any length, so the empty one is never used.
    Hmac::new_from_slice(key)
        .unwrap_or_else(|_| Hmac::new(&hmac::digest::Key::<Hmac<Sha256>>::default()))
}

impl Keys {
    /// Of a token, a session's number and both random numbers.
    #[must_use]
    pub fn new(
        token: &str,
        session: u32,
        client_nonce: &[u8; NONCE_BYTES],
        server_nonce: &[u8; NONCE_BYTES],
    ) -> Self {
        let over = |domain: &[u8]| {
            let mut mac = keyed(token.as_bytes());
            mac.update(domain);
            mac.update(&session.to_le_bytes());
            mac.update(client_nonce);
            mac.update(server_nonce);
            mac
        };
        Self {
            client: over(CLIENT),
            server: over(SERVER),
            tags: keyed(&over(KEY).finalize().into_bytes()),
        }
    }

    /// What the client sends.
    #[must_use]
    pub fn client_proof(&self) -> [u8; PROOF_BYTES] {
        self.client.clone().finalize().into_bytes().into()
    }

    /// What the server sends.
    #[must_use]
    pub fn server_proof(&self) -> [u8; PROOF_BYTES] {
        self.server.clone().finalize().into_bytes().into()
    }

    /// True of the client's proof, in a time that does not depend on the bytes.
    #[must_use]
    pub fn is_client_proof(&self, proof: &[u8]) -> bool {
        self.client.clone().verify_slice(proof).is_ok()
    }

    /// True of the server's proof, in a time that does not depend on the bytes.
    #[must_use]
    pub fn is_server_proof(&self, proof: &[u8]) -> bool {
        self.server.clone().verify_slice(proof).is_ok()
    }

    /// The tag of a packet (all of it before the tag).
    #[must_use]
    pub fn tag(&self, packet: &[u8]) -> [u8; TAG_BYTES] {
        let whole: [u8; PROOF_BYTES] = self
            .tags
            .clone()
            .chain_update(packet)
            .finalize()
            .into_bytes()
            .into();
        let mut tag = [0; TAG_BYTES];
        tag.copy_from_slice(&whole[..TAG_BYTES]);
        tag
    }

    /// True of a packet's tag, in a time that does not depend on the bytes.
    #[must_use]
    pub fn is_tag(&self, packet: &[u8], tag: &[u8]) -> bool {
        tag.len() == TAG_BYTES
            && self
                .tags
                .clone()
                .chain_update(packet)
                .verify_truncated_left(tag)
                .is_ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn keys(token: &str) -> Keys {
        Keys::new(token, 7, &[1; NONCE_BYTES], &[2; NONCE_BYTES])
    }

    #[test]
    fn the_proofs_are_plain_hmac_over_the_documented_bytes() {
        let mut mac = keyed(b"correct horse battery");
        mac.update(b"svartboks serial v1 client\0\x07\0\0\0");
        mac.update(&[1; 16]);
        mac.update(&[2; 16]);
        let expected: [u8; 32] = mac.finalize().into_bytes().into();
        assert_eq!(keys("correct horse battery").client_proof(), expected);
    }

    #[test]
    fn the_keyed_digest_is_that_of_rfc_4231() {
        let mac = keyed(b"Jefe").chain_update(b"what do ya want for nothing?");
        let digest: [u8; 32] = mac.finalize().into_bytes().into();
        assert_eq!(
            crate::seal::Hex(&digest).to_string(),
            "5bdcc146bf60754e6a042426089575c75a003f089d2739839dec58b964ec3843"
        );
    }

    #[test]
    fn a_proof_or_tag_of_another_token_session_number_or_side_is_refused() {
        let good = keys("correct horse battery");
        assert!(good.is_client_proof(&good.client_proof()));
        assert!(good.is_server_proof(&good.server_proof()));
        assert!(!good.is_client_proof(&good.server_proof()));
        assert!(!good.is_client_proof(&good.client_proof()[..31]));
        assert!(good.is_tag(b"packet", &good.tag(b"packet")));
        assert!(!good.is_tag(b"packer", &good.tag(b"packet")));
        assert!(!good.is_tag(b"packet", &good.tag(b"packet")[..4]));
        assert!(!good.is_tag(b"packet", &[]));
        let others = [
            keys("correct horse batterz"),
            Keys::new("correct horse battery", 8, &[1; 16], &[2; 16]),
            Keys::new("correct horse battery", 7, &[3; 16], &[2; 16]),
            Keys::new("correct horse battery", 7, &[1; 16], &[3; 16]),
        ];
        for other in others {
            assert!(!good.is_client_proof(&other.client_proof()));
            assert!(!good.is_server_proof(&other.server_proof()));
            assert!(!good.is_tag(b"packet", &other.tag(b"packet")));
        }
    }
}
