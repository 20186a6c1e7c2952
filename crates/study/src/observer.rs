//! A simulated participant whose threshold is known.

use crate::chance::Chance;
use crate::psychometric::Psychometric;

/// Answers by chance, as often right as its psychometric function says.
pub struct Observer {
    function: Psychometric,
    chance: Chance,
}

impl Observer {
    /// With chances of its own for every seed.
    pub fn new(function: Psychometric, seed: u64) -> Self {
        Self {
            function,
            chance: Chance::new(seed, "observer", &[]),
        }
    }

    /// Whether this one notices what is shown at a level.
    pub fn notices(&mut self, level: f64) -> bool {
        self.chance.share() < self.function.share(level)
    }

    /// The function that its answers follow.
    pub fn function(&self) -> &Psychometric {
        &self.function
    }
}
