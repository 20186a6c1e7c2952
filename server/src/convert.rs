//! From the shapes of the wire to the proven types of the rooms that compute.

use std::time::Duration;

use teleclay_bilateral::Lines;
use teleclay_clay::{Material, Shape, ToolShape};
use teleclay_link::conditioner;
use teleclay_proto::http::{
    self, ClayShape, FieldError, Impairment, JitterDistribution, Network, ToolDescription,
};

pub(crate) fn material(raw: &http::Material) -> Result<Material, FieldError> {
    teleclay_bilateral::material(raw)
        .map_err(|error| FieldError::new("/material", error.to_string()))
}

pub(crate) fn tool(raw: &ToolDescription) -> Result<ToolShape, FieldError> {
    teleclay_bilateral::tool_shape(raw).map_err(|error| FieldError::new("/tool", error.to_string()))
}

pub(crate) fn shape(raw: &ClayShape) -> Result<Shape, FieldError> {
    teleclay_bilateral::clay_shape(raw)
        .map_err(|error| FieldError::new("/shape", error.to_string()))
}

pub(crate) fn lines(raw: &Network) -> Lines {
    Lines {
        up: line(&raw.up),
        up_seed: raw.up.seed,
        down: line(&raw.down),
        down_seed: raw.down.seed,
    }
}

fn line(raw: &Impairment) -> conditioner::Impairment {
    conditioner::Impairment {
        delay: Duration::from_secs_f64(raw.delay_s),
        jitter: Duration::from_secs_f64(raw.jitter_s),
        distribution: match raw.jitter_distribution {
            JitterDistribution::Normal => conditioner::JitterDistribution::Normal,
            JitterDistribution::HeavyTailed => conditioner::JitterDistribution::HeavyTailed,
        },
        loss: raw.loss,
        duplicate: raw.duplicate,
        reorder: raw.reorder,
        bursts: raw.burst.map(|burst| conditioner::Bursts {
            enter: burst.enter,
            leave: burst.leave,
            loss: burst.loss_in_burst,
        }),
        outages: raw.outage.map(|outage| conditioner::Outages {
            every: Duration::from_secs_f64(outage.every_s),
            length: Duration::from_secs_f64(outage.length_s),
        }),
    }
}
