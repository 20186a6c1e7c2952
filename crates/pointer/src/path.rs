//! A hand's path as a page tells it, for tests: strokes along x, slow shifts along y, down into the clay and up again.
//!
//! It is made of additions, multiplications and divisions alone, so that every machine makes the same one.

/// Steps of a screen's pixel, m.
const PIXEL_M: f64 = 0.25e-3;
/// Shortest and longest time between two samples, ns: pages tell a pointer 60 to 125 times a second, with jitter.
const INTERVALS_NS: [u64; 2] = [8_000_000, 16_600_000];

/// Samples, each with its time, ns, and the hand's displacement, m; without end.
#[derive(Clone, Debug)]
pub struct MadePath {
    next_ns: u64,
    chance: u64,
}

impl MadePath {
    /// From time zero on; other seeds tell the same path at other moments.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self {
            next_ns: 0,
            chance: seed,
        }
    }

    /// Where the hand is, m: at home for half a second, then 8 mm down within another, with strokes of 30 mm either way
    /// at 0.6 Hz.
    #[must_use]
    pub fn at(now_ns: u64) -> [f64; 3] {
        let t_s = now_ns as f64 * 1e-9;
        let down = ((t_s - 0.5) / 0.5).clamp(0.0, 1.0);
        [
            0.03 * wave(t_s * 0.6),
            0.006 * wave(t_s * 0.25),
            -0.008 * down,
        ]
    }
}

impl Iterator for MadePath {
    type Item = (u64, [f64; 3]);

    fn next(&mut self) -> Option<Self::Item> {
        let at_ns = self.next_ns;
        self.chance = self
            .chance
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        let [least, most] = INTERVALS_NS;
        self.next_ns += least + (self.chance >> 33) % (most - least);
        let pixels = |m: f64| (m / PIXEL_M).round() * PIXEL_M;
        Some((at_ns, Self::at(at_ns).map(pixels)))
    }
}

/// Like a sine of period 1, of parabolas.
fn wave(turns: f64) -> f64 {
    let part = turns - turns.floor();
    if part < 0.5 {
        16.0 * part * (0.5 - part)
    } else {
        -16.0 * (part - 0.5) * (1.0 - part)
    }
}
