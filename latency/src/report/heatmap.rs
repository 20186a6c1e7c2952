//! Heatmaps as SVG: one field a scheme, delay across, loss down, every cell with its figure in it.

use std::fmt::Write;

use super::{distinct, of_scheme, schemes};
use crate::table::Row;

/// What a heatmap shows.
#[derive(Clone, Copy, Debug)]
pub struct Measure {
    /// Part of the file's name.
    pub name: &'static str,
    /// Title, with unit.
    pub title: &'static str,
    /// The figure of a row.
    pub value: fn(&Row) -> f64,
    /// Shown as good as nothing, and as bad as can be. Between them the scale is logarithmic.
    pub scale: [f64; 2],
    /// How a figure is written.
    pub write: fn(f64) -> String,
}

impl Measure {
    /// Every measure that has a picture.
    pub const ALL: [Self; 3] = [
        Self {
            name: "force",
            title: "Force error, % of the force without a network",
            value: |row| row.force_nrmse * 100.0,
            scale: [1.0, 200.0],
            write: short,
        },
        Self {
            name: "volume",
            title: "Removed volume, % off",
            value: |row| row.removed_volume_error * 100.0,
            scale: [0.1, 50.0],
            write: short,
        },
        Self {
            name: "coordination",
            title: "Tool and handle apart, mm",
            value: |row| row.coordination_rmse_m * 1e3,
            scale: [0.1, 50.0],
            write: short,
        },
    ];
}

const CELL: [f64; 2] = [48.0, 22.0];
const LEFT: f64 = 72.0;
const GAP: f64 = 32.0;
const TOP: f64 = 62.0;
/// Wide enough for the longest title, however few delays there are.
const LEAST_WIDTH: f64 = 460.0;
/// The bar that explains the colours.
const BAR: [f64; 2] = [120.0, 8.0];
const BAR_STEPS: u32 = 24;

/// The picture of a measure at one jitter, or nothing when no row has it.
pub fn heatmap(rows: &[Row], measure: &Measure, jitter_ratio: f64) -> Option<String> {
    let at_jitter = |row: &&Row| row.jitter_ratio.to_bits() == jitter_ratio.to_bits();
    let schemes: Vec<&str> = schemes(rows)
        .into_iter()
        .filter(|scheme| of_scheme(rows, scheme).any(|row| at_jitter(&row)))
        .collect();
    let all: Vec<&Row> = schemes
        .iter()
        .flat_map(|scheme| of_scheme(rows, scheme).filter(at_jitter))
        .collect();
    if all.is_empty() {
        return None;
    }
    let delays = distinct(all.iter().map(|row| row.one_way_delay_s));
    let losses = distinct(all.iter().map(|row| row.loss));
    let field_height = CELL[1] * losses.len() as f64 + GAP;
    let width = (LEFT + CELL[0] * delays.len() as f64 + 16.0).max(LEAST_WIDTH);
    let height = TOP + field_height * schemes.len() as f64 + 32.0;
    let mut svg = String::new();
    // Writing into a string does not fail.
    let _ = write!(
        svg,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {height:.0}\" width=\"{width:.0}\" height=\"{height:.0}\" \
         font-family=\"system-ui, -apple-system, Segoe UI, Helvetica, Arial, sans-serif\" font-size=\"11\">\
         <rect width=\"100%\" height=\"100%\" rx=\"6\" fill=\"#ffffff\"/>\
         <text x=\"16\" y=\"24\" font-size=\"15\" font-weight=\"600\" fill=\"#222222\">{}</text>\
         <text x=\"16\" y=\"41\" fill=\"#666666\">{}; hatched: swings by itself</text>\
         <defs><pattern id=\"unstable\" width=\"6\" height=\"6\" patternUnits=\"userSpaceOnUse\" patternTransform=\"rotate(45)\">\
         <line x1=\"0\" y1=\"0\" x2=\"0\" y2=\"6\" stroke=\"#ffffff\" stroke-width=\"1.6\" stroke-opacity=\"0.5\"/></pattern></defs>",
        measure.title,
        if 0.0 < jitter_ratio {
            format!("jitter: {:.0} % of the delay", jitter_ratio * 100.0)
        } else {
            "no jitter".to_owned()
        }
    );
    write_bar(&mut svg, measure, [width - BAR[0] - 16.0, 34.0]);
    for (number, scheme) in schemes.iter().enumerate() {
        let top = TOP + field_height * number as f64;
        let _ = write!(
            svg,
            "<text x=\"{LEFT}\" y=\"{:.0}\" font-size=\"12\" font-weight=\"600\" fill=\"#222222\">{}</text>",
            top + 12.0,
            scheme.replace('_', " ")
        );
        for (down, loss) in losses.iter().enumerate() {
            let y = top + 18.0 + CELL[1] * down as f64;
            let _ = write!(
                svg,
                "<text x=\"{:.0}\" y=\"{:.0}\" text-anchor=\"end\" fill=\"#666666\">{:.0} % lost</text>",
                LEFT - 8.0,
                y + 15.0,
                loss * 100.0
            );
            for (across, delay_s) in delays.iter().enumerate() {
                let row = of_scheme(rows, scheme).filter(at_jitter).find(|row| {
                    row.one_way_delay_s.to_bits() == delay_s.to_bits()
                        && row.loss.to_bits() == loss.to_bits()
                });
                let x = LEFT + CELL[0] * across as f64;
                if let Some(row) = row {
                    write_cell(&mut svg, measure, row, [x, y]);
                }
            }
        }
    }
    let y = height - 12.0;
    let _ = write!(
        svg,
        "<text x=\"{:.0}\" y=\"{y:.0}\" text-anchor=\"end\" fill=\"#666666\">one way</text>",
        LEFT - 8.0
    );
    for (across, delay_s) in delays.iter().enumerate() {
        let x = LEFT + CELL[0] * (across as f64 + 0.5);
        let _ = write!(
            svg,
            "<text x=\"{x:.0}\" y=\"{y:.0}\" text-anchor=\"middle\" fill=\"#666666\">{:.0} ms</text>",
            delay_s * 1e3
        );
    }
    svg.push_str("</svg>\n");
    Some(svg)
}

/// From as good as nothing to as bad as can be, with the two figures beside it.
fn write_bar(svg: &mut String, measure: &Measure, [x, y]: [f64; 2]) {
    let [width, height] = BAR;
    let step = width / f64::from(BAR_STEPS);
    for at in 0..BAR_STEPS {
        let [r, g, b] = colour(f64::from(at) / f64::from(BAR_STEPS - 1));
        let _ = write!(
            svg,
            "<rect x=\"{:.1}\" y=\"{y:.0}\" width=\"{:.1}\" height=\"{height:.0}\" fill=\"rgb({r},{g},{b})\"/>",
            x + step * f64::from(at),
            step + 0.3
        );
    }
    let [good, bad] = measure.scale.map(short);
    let _ = write!(
        svg,
        "<text x=\"{x:.0}\" y=\"{0:.0}\" font-size=\"9\" fill=\"#666666\">{good}</text>\
         <text x=\"{1:.0}\" y=\"{0:.0}\" font-size=\"9\" text-anchor=\"end\" fill=\"#666666\">{bad}</text>",
        y + height + 9.0,
        x + width
    );
}

fn write_cell(svg: &mut String, measure: &Measure, row: &Row, [x, y]: [f64; 2]) {
    let value = (measure.value)(row);
    let [good, bad] = measure.scale;
    let heat = ((value.max(good) / good).ln() / (bad / good).ln()).clamp(0.0, 1.0);
    let [r, g, b] = colour(heat);
    let ink = if heat < 0.6 { "#222222" } else { "#ffffff" };
    let [width, height] = CELL;
    let _ = write!(
        svg,
        "<rect x=\"{x:.0}\" y=\"{y:.0}\" width=\"{:.0}\" height=\"{:.0}\" rx=\"2\" fill=\"rgb({r},{g},{b})\"/>",
        width - 2.0,
        height - 2.0
    );
    if !row.stable {
        let _ = write!(
            svg,
            "<rect x=\"{x:.0}\" y=\"{y:.0}\" width=\"{:.0}\" height=\"{:.0}\" rx=\"2\" fill=\"url(#unstable)\"/>",
            width - 2.0,
            height - 2.0
        );
    }
    let _ = write!(
        svg,
        "<text x=\"{:.0}\" y=\"{:.0}\" text-anchor=\"middle\" fill=\"{ink}\">{}</text>",
        x + 0.5 * width,
        y + 15.0,
        (measure.write)(value)
    );
}

/// From pale yellow by orange to dark red, lighter to darker all the way, so that it reads without colours as well.
fn colour(heat: f64) -> [u8; 3] {
    const STOPS: [[f64; 3]; 4] = [
        [255.0, 250.0, 225.0],
        [253.0, 190.0, 110.0],
        [215.0, 70.0, 45.0],
        [90.0, 0.0, 35.0],
    ];
    let place = heat * (STOPS.len() - 1) as f64;
    let first = (place.floor() as usize).min(STOPS.len() - 2);
    let share = place - first as f64;
    std::array::from_fn(|channel| {
        let (from, to) = (STOPS[first][channel], STOPS[first + 1][channel]);
        (from + share * (to - from)).round() as u8
    })
}

fn short(value: f64) -> String {
    if value.abs() <= 0.0 {
        "0".to_owned()
    } else if value < 0.01 {
        "&lt;.01".to_owned()
    } else if value < 1.0 {
        format!("{value:.2}")
    } else if value < 10.0 {
        format!("{value:.1}")
    } else {
        format!("{value:.0}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a browser would refuse: a figure that opens a tag.
    #[test]
    fn figures_are_text_and_nothing_else() {
        for value in [0.0, 1e-9, 5e-3, 0.5, 5.0, 5e3, f64::NAN] {
            assert!(!short(value).contains(['<', '>', '"']), "{value}");
        }
    }

    #[test]
    fn more_heat_is_darker() {
        let light = |heat| {
            let [r, g, b] = colour(heat).map(f64::from);
            0.2126 * r + 0.7152 * g + 0.0722 * b
        };
        let shades: Vec<f64> = (0..=20).map(|step| light(f64::from(step) / 20.0)).collect();
        assert!(
            shades.windows(2).all(|pair| pair[1] < pair[0]),
            "{shades:?}"
        );
    }
}
