//! The command `experiment`: the paper's cutting experiment.

use std::ops::ControlFlow;

use clap::{Args, ValueEnum};
use teleclay_control::paper;
use teleclay_proto::http::theory::{CuttingAnswer, CuttingRequest, HandForceAt};
use teleclay_theory as theory;

use crate::output::Table;
use crate::progress::Showing;
use crate::stability::Numbers;
use crate::values::number;
use crate::{Answer, Input, Output};

/// The cutting experiment. Whatever is left out is that of Fig. 7.
#[derive(Clone, Debug, Args)]
pub struct Experiment {
    /// M of C_h1 = 1 / (M s^2 + B s), kg
    #[arg(long, value_name = "KG", default_value_t = paper::HANDLE_MASS_KG, value_parser = number)]
    virtual_mass_kg: f64,
    /// B of C_h1, N s/m
    #[arg(long, value_name = "N_S_PER_M", default_value_t = paper::HANDLE_DAMPING_N_S_PER_M, value_parser = number)]
    virtual_damping_n_s_per_m: f64,
    /// A_h1, tool position over handle position
    #[arg(long, value_name = "RATIO", default_value_t = paper::POSITION_RATIO, value_parser = number)]
    position_ratio: f64,
    /// A_h2, clay force over hand force; below zero
    #[arg(long, value_name = "RATIO", default_value_t = paper::FORCE_RATIO, allow_hyphen_values = true, value_parser = number)]
    force_ratio: f64,
    /// The hand's steady force, N
    #[arg(long, value_name = "N", default_value_t = paper::HAND_FORCE_N, value_parser = number)]
    hand_force_n: f64,
    /// Where the hand's force acts
    #[arg(long, value_enum, default_value_t)]
    hand_force_at: At,
    /// Handle positions at which the ranges begin and end, m
    #[arg(long, value_name = "X,X,...", default_value = "0.03,0.06,0.09,0.12", value_parser = Numbers::parse, allow_hyphen_values = true)]
    edges_m: Numbers,
    /// The clay's damping in each range, N s/m
    #[arg(long, value_name = "B,B,...", default_value = "20,40,60", value_parser = Numbers::parse)]
    clay_damping_n_s_per_m: Numbers,
    /// Edge of a voxel, m [default: what fits]
    #[arg(long, value_name = "M", value_parser = number)]
    voxel_size_m: Option<f64>,
    /// Most samples of the trace
    #[arg(long, value_name = "N", default_value_t = 8192)]
    trace_samples: u32,
    #[command(flatten)]
    input: Input,
    #[command(flatten)]
    output: Output,
}

/// See [`HandForceAt`].
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum At {
    /// Constant at the sensor, whatever the arm does
    #[default]
    Sensor,
    /// Constant in the muscles; the arm takes its share
    Muscles,
}

impl Experiment {
    pub(crate) fn answer(&self) -> anyhow::Result<Answer> {
        let request = self.input.request(|| Ok(self.request()))?;
        let mut showing = Showing::new("cutting");
        let answer = theory::cutting(&request, |progress| {
            showing.at(progress.share);
            ControlFlow::Continue(())
        })
        .map_err(|error| self.input.blame(error))?;
        drop(showing);
        Answer::new(
            self.output,
            &answer,
            |answer| tables(&request, answer),
            trace,
        )
    }

    fn request(&self) -> CuttingRequest {
        CuttingRequest {
            virtual_mass_kg: self.virtual_mass_kg,
            virtual_damping_n_s_per_m: self.virtual_damping_n_s_per_m,
            position_ratio: self.position_ratio,
            force_ratio: self.force_ratio,
            hand_force_n: self.hand_force_n,
            edges_m: self.edges_m.0.clone(),
            clay_damping_n_s_per_m: self.clay_damping_n_s_per_m.0.clone(),
            hand_force_at: match self.hand_force_at {
                At::Sensor => HandForceAt::Sensor,
                At::Muscles => HandForceAt::Muscles,
            },
            voxel_size_m: self.voxel_size_m,
            trace_samples: self.trace_samples,
        }
    }
}

fn tables(request: &CuttingRequest, answer: &CuttingAnswer) -> Vec<(String, Table)> {
    let mut ranges = Table::new([
        "from_m",
        "to_m",
        "clay_n_s_per_m",
        "depth_m",
        "theory_m_s",
        "measured_m_s",
        "off_%",
        "ripple_%",
    ]);
    for (range, &measured) in answer.simulated_velocity_m_s.iter().enumerate() {
        let theory = answer.plateau_velocity_m_s[range];
        let numbers = [
            request.edges_m[range],
            request.edges_m[range + 1],
            request.clay_damping_n_s_per_m[range],
            answer.specimen.depth_of_cut_m[range],
            theory,
            measured,
            100.0 * (measured / theory - 1.0),
            100.0 * answer.ripple[range],
        ];
        ranges.row(numbers.map(Into::into));
    }
    let mut whole = Table::new(["quantity", "value"]);
    let specimen = &answer.specimen;
    for (name, value) in [
        ("duration, s", answer.duration_s),
        ("clay removed, cm3", 1e6 * answer.removed_volume_m3),
        ("viscosity, Pa s/m", specimen.viscosity_pa_s_per_m),
        ("width of the blade, m", specimen.blade_width_m),
        ("edge of a voxel, m", specimen.voxel_size_m),
    ] {
        whole.row([name.into(), value.into()]);
    }
    vec![
        ("Velocity of the handle, range by range".to_owned(), ranges),
        ("The run".to_owned(), whole),
    ]
}

fn trace(answer: &CuttingAnswer) -> Table {
    let trace = &answer.trace;
    let mut table = Table::new([
        "t_s",
        "position_m",
        "velocity_m_s",
        "hand_force_n",
        "tool_force_n",
    ]);
    for (index, &t_s) in trace.t_s.iter().enumerate() {
        let numbers = [
            t_s,
            trace.position_m[index],
            trace.velocity_m_s[index],
            trace.hand_force_n[index],
            trace.tool_force_n[index],
        ];
        table.row(numbers.map(Into::into));
    }
    table
}
