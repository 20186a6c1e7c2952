//! How the voxels of one brick are packed.
//!
//! A brick is 16³ occupancies, `u8`, 0 empty to 255 full, x fastest, then y, then z. Clay is flat over long stretches,
//! so a row is taken from the row before it: the residual is `r[i] = v[i] − v[i − 16]` modulo 256, with `v` zero before
//! the start. Residuals are written as tokens:
//!
//! ```text
//!  c < 128     c + 1 residuals follow as they are     1 to 128
//!  128 <= c    c − 127 residuals are zero             1 to 128
//! ```
//!
//! The writer's choice is fixed, so that all writers give the same bytes: at each step, when the next two residuals are
//! both zero it takes as many zeros as there are, at most 128; otherwise it takes residuals as they are until two zeros
//! follow, the brick ends or there are 128. A reader takes any tokens that stand for exactly 4096 residuals.

use crate::FrameError;

/// Voxels along an edge of a brick.
pub const BRICK_EDGE: usize = 16;

/// Voxels of a brick.
pub const BRICK_VOXELS: usize = BRICK_EDGE * BRICK_EDGE * BRICK_EDGE;

/// Most bytes that [`pack`] writes: a token for each 128 residuals, and the residuals. A run of zeros never costs more
/// than it saves, because it stands for two residuals at least and takes one byte, and one more for the token after it.
pub const MAX_PACKED: usize = BRICK_VOXELS + BRICK_VOXELS / LONGEST;

/// Most residuals of one token.
const LONGEST: usize = 128;

/// Packed bytes that are known to unpack.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PackedBrick<'a>(&'a [u8]);

impl<'a> PackedBrick<'a> {
    /// Checks that the bytes unpack to one brick.
    ///
    /// # Errors
    /// When the tokens do not stand for exactly 4096 residuals.
    pub fn new(packed: &'a [u8]) -> Result<Self, FrameError> {
        let mut voxels = 0;
        let mut rest = packed;
        while let Some((&token, after)) = rest.split_first() {
            let (residuals, length) = match token_of(token) {
                Token::AsTheyAre(residuals) => (residuals, residuals),
                Token::Zeros(residuals) => (residuals, 0),
            };
            let Some(after) = after.get(length..) else {
                let got = packed.len();
                return Err(FrameError::TooShort {
                    got,
                    need: got - after.len() + length,
                });
            };
            voxels += residuals;
            if BRICK_VOXELS < voxels {
                break;
            }
            rest = after;
        }
        if voxels != BRICK_VOXELS {
            return Err(FrameError::WrongVoxelCount {
                got: voxels,
                want: BRICK_VOXELS,
            });
        }
        Ok(Self(packed))
    }

    /// The packed bytes.
    #[must_use]
    pub const fn as_bytes(self) -> &'a [u8] {
        self.0
    }

    /// The voxels.
    pub fn unpack(self, voxels: &mut [u8; BRICK_VOXELS]) {
        let mut at = 0;
        let mut rest = self.0;
        while let Some((&token, after)) = rest.split_first() {
            rest = match token_of(token) {
                Token::AsTheyAre(residuals) => {
                    let (plain, after) = after.split_at(residuals);
                    voxels[at..at + residuals].copy_from_slice(plain);
                    at += residuals;
                    after
                }
                Token::Zeros(residuals) => {
                    voxels[at..at + residuals].fill(0);
                    at += residuals;
                    after
                }
            };
        }
        let mut row = [0; BRICK_EDGE];
        for residuals in voxels.as_chunks_mut::<BRICK_EDGE>().0 {
            for (residual, before) in residuals.iter_mut().zip(row) {
                *residual = residual.wrapping_add(before);
            }
            row = *residuals;
        }
    }
}

/// Packs a brick onto the end of `packed`: at most [`MAX_PACKED`] bytes.
pub fn pack(voxels: &[u8; BRICK_VOXELS], packed: &mut Vec<u8>) {
    packed.reserve(MAX_PACKED);
    let residuals = residuals(voxels);
    let mut at = 0;
    while at < BRICK_VOXELS {
        let rest = &residuals[at..];
        let zeros = rest
            .iter()
            .take(LONGEST)
            .take_while(|&&residual| residual == 0)
            .count();
        if 1 < zeros {
            packed.push((LONGEST - 1 + zeros) as u8);
            at += zeros;
            continue;
        }
        let plain = rest
            .windows(2)
            .take(LONGEST)
            .position(|pair| pair == [0, 0])
            .unwrap_or(rest.len().min(LONGEST));
        packed.push((plain - 1) as u8);
        packed.extend_from_slice(&rest[..plain]);
        at += plain;
    }
}

/// Unpacks a brick.
///
/// # Errors
/// When the tokens do not stand for exactly 4096 residuals; `voxels` is then unchanged.
pub fn unpack(packed: &[u8], voxels: &mut [u8; BRICK_VOXELS]) -> Result<(), FrameError> {
    PackedBrick::new(packed)?.unpack(voxels);
    Ok(())
}

enum Token {
    AsTheyAre(usize),
    Zeros(usize),
}

const fn token_of(byte: u8) -> Token {
    let byte = byte as usize;
    if byte < LONGEST {
        Token::AsTheyAre(byte + 1)
    } else {
        Token::Zeros(byte - (LONGEST - 1))
    }
}

fn residuals(voxels: &[u8; BRICK_VOXELS]) -> [u8; BRICK_VOXELS] {
    let mut residuals = *voxels;
    for (residual, before) in residuals[BRICK_EDGE..].iter_mut().zip(voxels) {
        *residual = residual.wrapping_sub(*before);
    }
    residuals
}
