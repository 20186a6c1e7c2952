//! The command `tune`: compensators for a handle as one wishes it.

use std::ops::ControlFlow;

use clap::{Args, ValueEnum};
use teleclay_proto::http::theory::{TunedScheme, TuningAnswer, TuningRequest};
use teleclay_theory as theory;

use crate::output::Table;
use crate::progress::Showing;
use crate::stability::{Plants, margin_in_words};
use crate::values::{number, range};
use crate::{Answer, Input, Output};

/// A target for a handle. Plants that are left out are the paper's, or ours where the paper leaves them open.
#[derive(Clone, Debug, Args)]
pub struct Tune {
    #[command(flatten)]
    plants: Plants,
    /// Viscous answers of the clay to be ready for, N s/m
    #[arg(long, value_name = "LEAST..GREATEST", default_value = "0..60", value_parser = range)]
    clay_damping_n_s_per_m: [f64; 2],
    /// Elastic answers of the clay to be ready for, N/m
    #[arg(long, value_name = "LEAST..GREATEST", default_value = "0", value_parser = range)]
    clay_stiffness_n_per_m: [f64; 2],
    /// What crosses the network
    #[arg(long, value_enum, default_value_t)]
    scheme: Scheme,
    /// Longest round trip, s
    #[arg(long, value_name = "S", default_value_t = 0.1, value_parser = number)]
    round_trip_s: f64,
    /// Wanted distance from instability (33), above 0 and below 1
    #[arg(long, value_name = "D", default_value_t = 0.5, value_parser = number)]
    distance: f64,
    /// Heaviest handle to put up with: its impedance at 1 Hz, N s/m
    #[arg(long, value_name = "N_S_PER_M", default_value_t = 500.0, value_parser = number)]
    heaviest_n_s_per_m: f64,
    #[command(flatten)]
    input: Input,
    #[command(flatten)]
    output: Output,
}

/// See [`TunedScheme`].
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum Scheme {
    /// Each side integrates its own force and the other's
    #[default]
    ForceExchange,
    /// Position forward, force back
    PositionForce,
}

impl Tune {
    pub(crate) fn answer(&self) -> anyhow::Result<Answer> {
        let request = self.input.request(|| Ok(self.request()))?;
        let mut showing = Showing::new("tuning");
        let answer = theory::tune(&request, || {
            showing.still();
            ControlFlow::Continue(())
        })
        .map_err(|error| self.input.blame(error))?;
        drop(showing);
        Answer::new(self.output, &answer, tables, row)
    }

    fn request(&self) -> TuningRequest {
        let (position_ratio, force_ratio) = self.plants.ratios();
        TuningRequest {
            g_h: self.plants.g_h(),
            s_h: self.plants.s_h(),
            t_h: self.plants.t_h(),
            g_t: self.plants.g_t(),
            s_t: self.plants.s_t(),
            position_ratio,
            force_ratio,
            clay_damping_n_s_per_m: self.clay_damping_n_s_per_m,
            clay_stiffness_n_per_m: self.clay_stiffness_n_per_m,
            scheme: match self.scheme {
                Scheme::ForceExchange => TunedScheme::ForceExchange,
                Scheme::PositionForce => TunedScheme::PositionForce,
            },
            round_trip_s: self.round_trip_s,
            distance: self.distance,
            heaviest_n_s_per_m: self.heaviest_n_s_per_m,
        }
    }
}

fn tables(answer: &TuningAnswer) -> Vec<(String, Table)> {
    let mut table = Table::new(["quantity", "value"]);
    for (name, value) in [
        ("mass, kg", answer.mass_kg),
        ("damping, N s/m", answer.damping_n_s_per_m),
        ("impedance at 1 Hz, N s/m", answer.impedance_n_s_per_m),
        ("distance kept (33)", answer.distance),
    ] {
        table.row([name.into(), value.into()]);
    }
    let margin = margin_in_words(answer.delay_verdict, answer.delay_margin_s);
    vec![
        ("The lightest handle that does".to_owned(), table),
        ("Delay".to_owned(), {
            let mut table = Table::new(["over the whole clay range"]);
            table.row([margin.into()]);
            table
        }),
    ]
}

fn row(answer: &TuningAnswer) -> Table {
    let mut table = Table::new([
        "mass_kg",
        "damping_n_s_per_m",
        "impedance_n_s_per_m",
        "distance",
        "delay_margin_s",
    ]);
    table.row([
        answer.mass_kg.into(),
        answer.damping_n_s_per_m.into(),
        answer.impedance_n_s_per_m.into(),
        answer.distance.into(),
        answer.delay_margin_s.into(),
    ]);
    table
}
