//! The keys of a lease.

/// The keys of a lease, one for each direction.
#[derive(Clone, PartialEq, Eq)]
pub struct Keys {
    pub(crate) of_handle: [u8; 32],
    pub(crate) of_server: [u8; 32],
}

impl Keys {
    /// Those of the handle's messages and of the server's.
    #[must_use]
    pub const fn new(of_handle: [u8; 32], of_server: [u8; 32]) -> Self {
        Self {
            of_handle,
            of_server,
        }
    }

    /// The handle's, then the server's: for a handle on a line that nobody else can read.
    #[must_use]
    pub fn to_bytes(&self) -> [u8; 64] {
        let mut bytes = [0; 64];
        bytes[..32].copy_from_slice(&self.of_handle);
        bytes[32..].copy_from_slice(&self.of_server);
        bytes
    }
}

impl std::fmt::Debug for Keys {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Keys")
    }
}
