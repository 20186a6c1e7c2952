//! What the link conditioner does to the packets of a session.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::validate::{FieldError, Validate, check};
use crate::word::words;

/// Largest whole number that every JSON reader keeps exactly, 2⁵³ − 1.
const MAX_SEED: u64 = (1 << 53) - 1;

/// Impairments of both directions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Network {
    /// From the handle to the server.
    pub up: Impairment,
    /// From the server to the handle.
    pub down: Impairment,
}

/// What happens to the packets of one direction, on top of what the real network does.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Impairment {
    /// Mean delay, s.
    #[schema(minimum = 0, maximum = 2)]
    pub delay_s: f64,
    /// Standard deviation of the delay, s.
    #[schema(minimum = 0, maximum = 1)]
    pub jitter_s: f64,
    /// Share of packets lost, each independently of the others.
    #[schema(minimum = 0, maximum = 1)]
    pub loss: f64,
    /// Seed of every random draw of this direction.
    #[schema(maximum = 9007199254740991_u64)]
    pub seed: u64,
    /// How delays scatter.
    pub jitter_distribution: JitterDistribution,
    /// Share of packets delivered twice.
    #[schema(minimum = 0, maximum = 1)]
    pub duplicate: f64,
    /// Share of packets that overtake: they skip the delay altogether.
    #[schema(minimum = 0, maximum = 1)]
    pub reorder: f64,
    /// Losses in bursts, on top of `loss`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub burst: Option<Burst>,
    /// Outages of the line, at regular intervals.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub outage: Option<Outage>,
}

words! {
    /// How delays scatter about their mean.
    #[derive(Default, ToSchema)]
    #[serde(rename_all = "snake_case")]
    pub enum JitterDistribution: "jitter distribution" {
        /// Normal, cut off at a delay of zero.
        #[default]
        Normal "normal",
        /// Pareto of the same mean and deviation: most packets a little early, a few very late.
        HeavyTailed "heavy_tailed",
    }
}

/// The model of `[G60]` and `[E63]`: a channel that is good or bad, and changes from packet to packet.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Burst {
    /// Probability per packet that a good channel turns bad.
    #[schema(minimum = 0, maximum = 1)]
    pub enter: f64,
    /// Probability per packet that a bad channel turns good.
    #[schema(minimum = 0, maximum = 1)]
    pub leave: f64,
    /// Share of packets lost while the channel is bad.
    #[schema(minimum = 0, maximum = 1)]
    pub loss_in_burst: f64,
}

/// A channel that passes nothing for the last `length_s` of every `every_s`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Outage {
    /// From the start of one outage to the start of the next, s.
    #[schema(minimum = 0.01, maximum = 3600)]
    pub every_s: f64,
    /// Length of each, s; shorter than `every_s`.
    #[schema(minimum = 0, maximum = 60)]
    pub length_s: f64,
}

impl Default for Impairment {
    /// Nothing happens to a packet. The seed is 1.
    fn default() -> Self {
        Self {
            delay_s: 0.0,
            jitter_s: 0.0,
            loss: 0.0,
            seed: 1,
            jitter_distribution: JitterDistribution::default(),
            duplicate: 0.0,
            reorder: 0.0,
            burst: None,
            outage: None,
        }
    }
}

impl Validate for Network {
    fn validate(&self) -> Result<(), FieldError> {
        self.up.validate_under("/up")?;
        self.down.validate_under("/down")
    }
}

impl Validate for Impairment {
    fn validate(&self) -> Result<(), FieldError> {
        check("/delay_s", self.delay_s, 0.0..=2.0)?;
        check("/jitter_s", self.jitter_s, 0.0..=1.0)?;
        check("/loss", self.loss, 0.0..=1.0)?;
        if MAX_SEED < self.seed {
            return Err(FieldError::new(
                "/seed",
                format!("{} is above 2^53 - 1, which JSON keeps exactly", self.seed),
            ));
        }
        check("/duplicate", self.duplicate, 0.0..=1.0)?;
        check("/reorder", self.reorder, 0.0..=1.0)?;
        self.burst.validate_under("/burst")?;
        self.outage.validate_under("/outage")
    }
}

impl Validate for Burst {
    fn validate(&self) -> Result<(), FieldError> {
        check("/enter", self.enter, 0.0..=1.0)?;
        check("/leave", self.leave, 0.0..=1.0)?;
        check("/loss_in_burst", self.loss_in_burst, 0.0..=1.0)
    }
}

impl Validate for Outage {
    fn validate(&self) -> Result<(), FieldError> {
        check("/every_s", self.every_s, 0.01..=3600.0)?;
        check("/length_s", self.length_s, 0.0..=60.0)?;
        if self.every_s <= self.length_s {
            let detail = format!(
                "{} leaves nothing of every_s = {}",
                self.length_s, self.every_s
            );
            return Err(FieldError::new("/length_s", detail));
        }
        Ok(())
    }
}
