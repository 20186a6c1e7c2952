//! The command `analyse`: poles, margins and delay margins of a loop.

use clap::Args;
use teleclay_control::paper;
use teleclay_proto::http::theory::{
    ComplexPair, DelayVerdict, GainMargin, LoopAnswer, LoopRequest, TransferFunction,
};
use teleclay_theory as theory;

use crate::output::{Cell, Table, rounded};
use crate::values::{list, number, printed, transfer_function};
use crate::{Answer, Input, Output};

/// A loop by its parts. Whatever is left out is the paper's, or ours where the paper leaves it open.
#[derive(Clone, Debug, Args)]
pub struct Analyse {
    #[command(flatten)]
    plants: Plants,
    /// C_h1 as a whole, in place of mass and damping
    #[arg(long, value_name = "NUM/DEN", conflicts_with_all = ["mass_kg", "damping_n_s_per_m"], value_parser = transfer_function, allow_hyphen_values = true)]
    c_h1: Option<TransferFunction>,
    /// M of C_h1 = 1 / (M s^2 + B s), kg
    #[arg(long, value_name = "KG", default_value_t = paper::HANDLE_MASS_KG, value_parser = number)]
    mass_kg: f64,
    /// B of C_h1, N s/m
    #[arg(long, value_name = "N_S_PER_M", default_value_t = paper::HANDLE_DAMPING_N_S_PER_M, value_parser = number)]
    damping_n_s_per_m: f64,
    /// Viscous part of the clay, N s/m
    #[arg(long, value_name = "N_S_PER_M", default_value_t = paper::CUTTING_DAMPING_N_S_PER_M[0], value_parser = number)]
    clay_damping_n_s_per_m: f64,
    /// Elastic part of the clay, N/m
    #[arg(long, value_name = "N_PER_M", default_value_t = 0.0, value_parser = number)]
    clay_stiffness_n_per_m: f64,
    /// Where the compensators are evaluated, rad/s
    #[arg(long, value_name = "W,W,...", default_value = "0.1,1,10,60,300", value_parser = Numbers::parse)]
    omegas_rad_s: Numbers,
    #[command(flatten)]
    input: Input,
    #[command(flatten)]
    output: Output,
}

/// The plants that analysis and tuning share.
#[derive(Clone, Debug, Args)]
pub(crate) struct Plants {
    /// Handle servo: x or y for the paper's, or coefficients such as 18,1/0.005,0.4,18,1
    #[arg(long, value_name = "NUM/DEN", default_value = "x", value_parser = transfer_function, allow_hyphen_values = true)]
    g_h: TransferFunction,
    /// The handle's give under the hand
    #[arg(long, value_name = "NUM/DEN", default_value = "0", value_parser = transfer_function, allow_hyphen_values = true)]
    s_h: TransferFunction,
    /// The operator's arm, N per m
    #[arg(long, value_name = "A,B,C", default_value = "0.25,2,6", value_parser = Numbers::parse, allow_hyphen_values = true)]
    t_h: Numbers,
    /// Tool actuator
    #[arg(long, value_name = "NUM/DEN", default_value = "1/0.5,20,0", value_parser = transfer_function, allow_hyphen_values = true)]
    g_t: TransferFunction,
    /// The tool's give under the clay
    #[arg(long, value_name = "NUM/DEN", default_value = "0", value_parser = transfer_function, allow_hyphen_values = true)]
    s_t: TransferFunction,
    /// A_h1, tool position over handle position
    #[arg(long, value_name = "RATIO", default_value_t = paper::POSITION_RATIO, value_parser = number)]
    position_ratio: f64,
    /// A_h2, clay force over hand force; below zero
    #[arg(long, value_name = "RATIO", default_value_t = paper::FORCE_RATIO, allow_hyphen_values = true, value_parser = number)]
    force_ratio: f64,
}

/// A list of numbers as one option: the parser of options would take a bare list for several.
#[derive(Clone, Debug)]
pub(crate) struct Numbers(pub(super) Vec<f64>);

impl Numbers {
    pub(crate) fn parse(text: &str) -> Result<Self, String> {
        list(text).map(Self)
    }
}

impl Plants {
    pub(crate) fn g_h(&self) -> TransferFunction {
        self.g_h.clone()
    }

    pub(crate) fn s_h(&self) -> TransferFunction {
        self.s_h.clone()
    }

    pub(crate) fn t_h(&self) -> Vec<f64> {
        self.t_h.0.clone()
    }

    pub(crate) fn g_t(&self) -> TransferFunction {
        self.g_t.clone()
    }

    pub(crate) fn s_t(&self) -> TransferFunction {
        self.s_t.clone()
    }

    pub(crate) fn ratios(&self) -> (f64, f64) {
        (self.position_ratio, self.force_ratio)
    }
}

impl Analyse {
    pub(crate) fn answer(&self) -> anyhow::Result<Answer> {
        let request = self.input.request(|| self.request())?;
        let answer = theory::analyse(&request).map_err(|error| self.input.blame(error))?;
        Answer::new(self.output, &answer, tables, curve)
    }

    fn request(&self) -> anyhow::Result<LoopRequest> {
        let c_h1 = match &self.c_h1 {
            Some(c_h1) => c_h1.clone(),
            None => printed(&paper::c_h1(self.mass_kg, self.damping_n_s_per_m)?),
        };
        let (position_ratio, force_ratio) = self.plants.ratios();
        Ok(LoopRequest {
            g_h: self.plants.g_h(),
            s_h: self.plants.s_h(),
            t_h: self.plants.t_h(),
            c_h1,
            g_t: self.plants.g_t(),
            s_t: self.plants.s_t(),
            position_ratio,
            force_ratio,
            clay_damping_n_s_per_m: self.clay_damping_n_s_per_m,
            clay_stiffness_n_per_m: self.clay_stiffness_n_per_m,
            omegas_rad_s: self.omegas_rad_s.0.clone(),
        })
    }
}

/// A delay margin in words.
pub(crate) fn margin_in_words(verdict: DelayVerdict, seconds: Option<f64>) -> String {
    match (verdict, seconds) {
        (DelayVerdict::Finite, Some(seconds)) => {
            format!("stable below a round trip of {} ms", rounded(1e3 * seconds))
        }
        (DelayVerdict::Finite, None) | (DelayVerdict::Unbounded, _) => {
            "stable at every delay".to_owned()
        }
        (DelayVerdict::UnstableWithoutDelay, _) => "unstable even without delay".to_owned(),
        (DelayVerdict::UnstableAdmittance, _) => {
            "unstable at any delay: the two copies of the admittance part".to_owned()
        }
    }
}

fn tables(answer: &LoopAnswer) -> Vec<(String, Table)> {
    let mut tables = vec![
        ("The loop".to_owned(), summary(answer)),
        ("Closed-loop poles, rad/s".to_owned(), poles(answer)),
    ];
    if !answer.compensators.is_empty() {
        tables.push(("Compensators".to_owned(), compensators(answer)));
    }
    tables
}

fn summary(answer: &LoopAnswer) -> Table {
    let yes_or_no = |holds: bool| if holds { "yes" } else { "no" };
    let gain = |margin: Option<GainMargin>| match margin {
        Some(GainMargin {
            factor,
            omega_rad_s: Some(omega),
        }) => {
            format!("{} at {} rad/s", rounded(factor), rounded(omega))
        }
        Some(GainMargin {
            factor,
            omega_rad_s: None,
        }) => {
            format!("{} at infinite frequency", rounded(factor))
        }
        None => "none".to_owned(),
    };
    let mut table = Table::new(["quantity", "value"]);
    let mut row = |name: &str, value: String| table.row([name.into(), value.into()]);
    row(
        "stable without delay",
        yes_or_no(answer.stable_without_delay).to_owned(),
    );
    let exchange = (
        answer.delay_verdict_force_exchange,
        answer.delay_margin_force_exchange_s,
    );
    row("force exchange", margin_in_words(exchange.0, exchange.1));
    let position = (
        answer.delay_verdict_position_force,
        answer.delay_margin_position_force_s,
    );
    row(
        "position forward, force back",
        margin_in_words(position.0, position.1),
    );
    let distance = answer
        .nyquist_min_distance
        .map_or_else(|| "unbounded".to_owned(), rounded);
    let at = answer.nyquist_min_omega_rad_s.map_or_else(
        || "in the limit of high frequency".to_owned(),
        |omega| format!("at {} rad/s", rounded(omega)),
    );
    row("least distance from -1 (33)", format!("{distance} {at}"));
    let peak = answer
        .small_gain_peak
        .map_or_else(|| "unbounded".to_owned(), rounded);
    row(
        "small gain holds (34)",
        format!("{}; its peak is {peak}", yes_or_no(answer.small_gain_holds)),
    );
    row("gain margin upwards", gain(answer.gain_margin_increase));
    row("gain margin downwards", gain(answer.gain_margin_decrease));
    let phase = answer.phase_margin.map_or_else(
        || "none".to_owned(),
        |margin| {
            let degrees = rounded(margin.phase_rad.to_degrees());
            format!("{degrees} degrees at {} rad/s", rounded(margin.omega_rad_s))
        },
    );
    row("phase margin", phase);
    if !answer.improper_compensators.is_empty() {
        let names = answer
            .improper_compensators
            .iter()
            .map(|name| format!("{name:?}"));
        let names: Vec<String> = names.collect();
        row("compensators no machine can run", names.join(", "));
    }
    table
}

fn poles(answer: &LoopAnswer) -> Table {
    let mut table = Table::new(["re", "im", "damping ratio"]);
    for &[re, im] in &answer.closed_loop_poles {
        let magnitude = re.hypot(im);
        let ratio = (0.0 < magnitude).then(|| -re / magnitude);
        table.row([re.into(), im.into(), ratio.into()]);
    }
    table
}

fn compensators(answer: &LoopAnswer) -> Table {
    let magnitude_and_phase = |value: Option<ComplexPair>| match value {
        Some([re, im]) => Cell::Text(format!(
            "{} at {} deg",
            rounded(re.hypot(im)),
            rounded(im.atan2(re).to_degrees())
        )),
        None => Cell::Nothing,
    };
    let mut table = Table::new(["omega_rad_s", "C_h1", "C_t1", "C_h2", "C_t2"]);
    for point in &answer.compensators {
        let [a, b, c, d] =
            [point.c_h1, point.c_t1, point.c_h2, point.c_t2].map(magnitude_and_phase);
        table.row([point.omega_rad_s.into(), a, b, c, d]);
    }
    table
}

fn curve(answer: &LoopAnswer) -> Table {
    let mut table = Table::new(["omega_rad_s", "re", "im", "magnitude_db", "phase_rad"]);
    for (index, &omega) in answer.nyquist.omega_rad_s.iter().enumerate() {
        let [re, im] = [answer.nyquist.re[index], answer.nyquist.im[index]];
        let [db, phase] = [
            answer.bode.magnitude_db[index],
            answer.bode.phase_rad[index],
        ];
        table.row([omega.into(), re.into(), im.into(), db.into(), phase.into()]);
    }
    table
}
