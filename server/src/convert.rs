//! From the shapes of the wire to the proven types of the rooms that compute.

use std::time::Duration;

use teleclay_bilateral::Lines;
use teleclay_clay::{
    Ball, Blade, BladeDimensions, Coefficients, Material, Shape, SteppedBlock, SteppedDimensions,
    ToolShape,
};
use teleclay_link::conditioner;
use teleclay_proto::http::{
    self, ClayShape, FieldError, Impairment, JitterDistribution, Network, ToolDescription,
};

pub(crate) fn material(raw: &http::Material) -> Result<Material, FieldError> {
    let coefficients = Coefficients {
        viscosity_pa_s_per_m: raw.viscosity_pa_s_per_m,
        yield_stress_pa: raw.yield_stress_pa,
        stiffness_pa: raw.stiffness_pa,
    };
    Material::new(coefficients).map_err(|error| FieldError::new("/material", error.to_string()))
}

pub(crate) fn tool(raw: &ToolDescription) -> Result<ToolShape, FieldError> {
    let refused = |error: teleclay_clay::ToolError| FieldError::new("/tool", error.to_string());
    Ok(match *raw {
        ToolDescription::Ball { radius_m } => {
            ToolShape::Ball(Ball::new(radius_m).map_err(refused)?)
        }
        ToolDescription::Blade {
            width_m,
            height_m,
            thickness_m,
        } => ToolShape::Blade(
            Blade::new(BladeDimensions {
                width_m,
                height_m,
                thickness_m,
            })
            .map_err(refused)?,
        ),
    })
}

pub(crate) fn shape(raw: &ClayShape) -> Result<Shape, FieldError> {
    Ok(match raw {
        ClayShape::Block { size_m } => Shape::Block { size_m: *size_m },
        ClayShape::Stepped {
            edges_m,
            depths_of_cut_m,
            base_m,
            width_m,
        } => {
            let dimensions = SteppedDimensions {
                edges_m: edges_m.clone(),
                depths_of_cut_m: depths_of_cut_m.clone(),
                base_m: *base_m,
                width_m: *width_m,
            };
            let stepped = SteppedBlock::new(dimensions)
                .map_err(|error| FieldError::new("/shape", error.to_string()))?;
            Shape::Stepped(stepped)
        }
    })
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
