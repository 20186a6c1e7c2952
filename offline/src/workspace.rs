//! The command `workspace`: a map of where the robot can go, and how well it moves there.

use clap::Args;
use teleclay_proto::http::theory::{WorkspaceAnswer, WorkspaceRequest};
use teleclay_theory as theory;

use crate::kinematics::Robot;
use crate::output::Table;
use crate::progress::Showing;
use crate::values::{counts, signs, triple};
use crate::{Answer, Input, Output};

/// A map of the workspace. Dexterity is the inverse condition number: 1 where the platform moves alike in all
/// directions, 0 at a singularity.
#[derive(Clone, Debug, Args)]
pub struct Workspace {
    /// The branch by its signs; elbows outwards above the base by default
    #[arg(long, value_name = "K,K,K", default_value = "-1,-1,-1", allow_hyphen_values = true, value_parser = signs)]
    branch: [i64; 3],
    /// Cells along x, y and z, or one number for all
    #[arg(long, value_name = "N,N,N", default_value = "32", value_parser = counts)]
    cells: [u32; 3],
    /// Lower corner of the box to map, m [default: everything in reach]
    #[arg(long, value_name = "X,Y,Z", requires = "to_m", allow_hyphen_values = true, value_parser = triple)]
    from_m: Option<[f64; 3]>,
    /// Upper corner of the box to map, m
    #[arg(long, value_name = "X,Y,Z", requires = "from_m", allow_hyphen_values = true, value_parser = triple)]
    to_m: Option<[f64; 3]>,
    #[command(flatten)]
    robot: Robot,
    #[command(flatten)]
    input: Input,
    #[command(flatten)]
    output: Output,
}

impl Workspace {
    pub(crate) fn answer(&self) -> anyhow::Result<Answer> {
        let request = self.input.request(|| {
            Ok(WorkspaceRequest {
                geometry: self.robot.geometry(),
                branch: self.branch,
                region_m: self.from_m.zip(self.to_m).map(|(from, to)| [from, to]),
                cells: self.cells,
            })
        })?;
        let mut showing = Showing::new("mapping");
        let answer = theory::workspace_by_layers(&request, |share| showing.at(share))
            .map_err(|error| self.input.blame(error))?;
        drop(showing);
        Answer::new(self.output, &answer, tables, cells)
    }
}

/// Centre of a cell along an axis, m.
fn centre_m(answer: &WorkspaceAnswer, axis: usize, cell: usize) -> f64 {
    let [low, high] = answer.region_m.map(|corner| corner[axis]);
    low + (high - low) * (cell as f64 + 0.5) / f64::from(answer.cells[axis])
}

fn tables(answer: &WorkspaceAnswer) -> Vec<(String, Table)> {
    let mut whole = Table::new(["quantity", "value"]);
    whole.row([
        "reachable share of the box, %".into(),
        (100.0 * answer.reachable_share).into(),
    ]);
    whole.row([
        "reachable volume, m3".into(),
        answer.reachable_volume_m3.into(),
    ]);
    whole.row(["mean dexterity".into(), answer.mean_dexterity.into()]);
    let mut layers = Table::new(["z_m", "reachable_%", "mean", "least", "greatest"]);
    let [x, y, z] = answer.cells.map(|count| count as usize);
    for (layer, dexterity) in answer.dexterity.chunks(x * y).enumerate().take(z) {
        let reached: Vec<f64> = dexterity.iter().copied().flatten().collect();
        let share = 100.0 * reached.len() as f64 / dexterity.len() as f64;
        let of = |value: f64| (!reached.is_empty()).then_some(value);
        let mean = reached.iter().sum::<f64>() / reached.len() as f64;
        layers.row([
            centre_m(answer, 2, layer).into(),
            share.into(),
            of(mean).into(),
            of(reached.iter().copied().fold(f64::INFINITY, f64::min)).into(),
            of(reached.iter().copied().fold(0.0, f64::max)).into(),
        ]);
    }
    vec![
        ("The workspace".to_owned(), whole),
        ("Dexterity, layer by layer".to_owned(), layers),
    ]
}

fn cells(answer: &WorkspaceAnswer) -> Table {
    let [x_count, y_count, _] = answer.cells.map(|count| count as usize);
    let mut table = Table::new(["x_m", "y_m", "z_m", "dexterity"]);
    for (index, &dexterity) in answer.dexterity.iter().enumerate() {
        let place = [
            index % x_count,
            index / x_count % y_count,
            index / x_count / y_count,
        ];
        let [x, y, z] = [0, 1, 2].map(|axis| centre_m(answer, axis, place[axis]));
        table.row([x.into(), y.into(), z.into(), dexterity.into()]);
    }
    table
}
