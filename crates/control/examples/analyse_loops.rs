//! Analyses loops from standard input, one JSON object per line, and prints one JSON object per line: the other side of
//! a comparison with an independent control package.
//!
//! A line holds `g_h`, `c_h1`, `g_t` as `{"numerator": […], "denominator": […]}`, `t_h` as a list, all in descending
//! powers, and `position_ratio`, `force_ratio`, `clay_damping_n_s_per_m`, `clay_stiffness_n_per_m`. An answer holds
//! either `error` or the figures.

use serde_json::{Value, json};
use std::io::BufRead;
use teleclay_control::analysis::{LoopInput, analyse};
use teleclay_control::compensators::Sides;
use teleclay_control::{DelayMargin, GainMargin, Polynomial, RationalFunction};

#[expect(clippy::print_stdout, reason = "the answers are the program's output")]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    for line in std::io::stdin().lock().lines() {
        let line = line?;
        if line.trim().is_empty() {
            continue;
        }
        let answer = answer(&serde_json::from_str(&line)?);
        println!(
            "{}",
            answer.unwrap_or_else(|error| json!({ "error": error.to_string() }))
        );
    }
    Ok(())
}

fn answer(case: &Value) -> Result<Value, Box<dyn std::error::Error>> {
    let input = LoopInput {
        sides: Sides {
            g_h: function(case, "g_h")?,
            s_h: RationalFunction::zero(),
            g_t: function(case, "g_t")?,
            s_t: RationalFunction::zero(),
            c_h1: function(case, "c_h1")?,
            position_ratio: number(case, "position_ratio")?,
            force_ratio: number(case, "force_ratio")?,
        },
        t_h: Polynomial::new(&numbers(&case["t_h"])?)?,
        clay_damping_n_s_per_m: number(case, "clay_damping_n_s_per_m")?,
        clay_stiffness_n_per_m: number(case, "clay_stiffness_n_per_m")?,
        omegas_rad_s: Vec::new(),
    };
    let analysis = analyse(&input)?;
    let gain = |margin: Option<GainMargin>| {
        margin.map(|m| json!({ "factor": m.factor, "omega_rad_s": finite(m.omega_rad_s) }))
    };
    Ok(json!({
        "closed_loop_poles": analysis.closed_loop_poles.iter().map(|p| [p.re, p.im]).collect::<Vec<_>>(),
        "stable_without_delay": analysis.stable_without_delay,
        "delay_margin_force_exchange_s": analysis.delay_margin_force_exchange.seconds(),
        "delay_margin_force_exchange_unbounded": analysis.delay_margin_force_exchange == DelayMargin::Unbounded,
        "delay_margin_position_force_s": analysis.delay_margin_position_force.seconds(),
        "delay_margin_position_force_unbounded": analysis.delay_margin_position_force == DelayMargin::Unbounded,
        "small_gain_holds": analysis.small_gain_holds,
        "small_gain_peak": analysis.small_gain_peak,
        "nyquist_min_distance": finite(analysis.nyquist_min_distance),
        "gain_increase": gain(analysis.classical.gain_increase),
        "gain_decrease": gain(analysis.classical.gain_decrease),
        "phase_margin_rad": analysis.classical.phase.map(|m| m.phase_rad),
        "phase_margin_omega_rad_s": analysis.classical.phase.map(|m| m.omega_rad_s),
    }))
}

fn function(case: &Value, name: &str) -> Result<RationalFunction, Box<dyn std::error::Error>> {
    let parts = &case[name];
    Ok(RationalFunction::new(
        &numbers(&parts["numerator"])?,
        &numbers(&parts["denominator"])?,
    )?)
}

fn numbers(list: &Value) -> Result<Vec<f64>, String> {
    let list = list
        .as_array()
        .ok_or_else(|| format!("{list} is not a list"))?;
    list.iter()
        .map(|v| v.as_f64().ok_or_else(|| format!("{v} is not a number")))
        .collect()
}

fn number(case: &Value, name: &str) -> Result<f64, String> {
    case[name]
        .as_f64()
        .ok_or_else(|| format!("{name} is {}, need a number", case[name]))
}

/// JSON has no infinity: a limit without end is null.
fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}
