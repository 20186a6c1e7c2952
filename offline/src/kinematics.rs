//! `kinematics inverse`, `forward`, `jacobian`.

use clap::{Args, Subcommand};
use teleclay_proto::http::theory::{
    ForwardRequest, InverseRequest, JacobianRequest, RobotGeometry,
};
use teleclay_theory as theory;

use crate::output::Table;
use crate::values::{number, signs, triple};
use crate::{Answer, Input, Output};

/// The robot's kinematics.
#[derive(Clone, Debug, Subcommand)]
pub enum Kinematics {
    /// All eight joint sets for a position
    Inverse(Inverse),
    /// Both positions for a joint set
    Forward(Forward),
    /// The Jacobian of one branch at a position
    Jacobian(Jacobian),
}

/// See [`Kinematics::Inverse`].
#[derive(Clone, Debug, Args)]
pub struct Inverse {
    /// Where the platform is to be, m
    #[arg(long, value_name = "X,Y,Z", default_value = "0,0,0.15", allow_hyphen_values = true, value_parser = triple)]
    position_m: [f64; 3],
    #[command(flatten)]
    robot: Robot,
    #[command(flatten)]
    input: Input,
    #[command(flatten)]
    output: Output,
}

/// See [`Kinematics::Forward`].
#[derive(Clone, Debug, Args)]
pub struct Forward {
    /// The joint angles, rad
    #[arg(long, value_name = "A,B,C", default_value = "0,0,0", allow_hyphen_values = true, value_parser = triple)]
    joints_rad: [f64; 3],
    #[command(flatten)]
    robot: Robot,
    #[command(flatten)]
    input: Input,
    #[command(flatten)]
    output: Output,
}

/// See [`Kinematics::Jacobian`].
#[derive(Clone, Debug, Args)]
pub struct Jacobian {
    /// Where the platform is, m
    #[arg(long, value_name = "X,Y,Z", default_value = "0,0,0.15", allow_hyphen_values = true, value_parser = triple)]
    position_m: [f64; 3],
    /// The branch by its signs; elbows outwards above the base by default
    #[arg(long, value_name = "K,K,K", default_value = "-1,-1,-1", allow_hyphen_values = true, value_parser = signs)]
    branch: [i64; 3],
    #[command(flatten)]
    robot: Robot,
    #[command(flatten)]
    input: Input,
    #[command(flatten)]
    output: Output,
}

/// The robot's dimensions.
#[derive(Clone, Copy, Debug, Args)]
pub(crate) struct Robot {
    /// From the centre of the base to the joints, m
    #[arg(long, value_name = "M", default_value_t = RobotGeometry::default().base_radius_m, value_parser = number)]
    base_radius_m: f64,
    /// From the centre of the platform to the rods, m
    #[arg(long, value_name = "M", default_value_t = RobotGeometry::default().platform_radius_m, value_parser = number)]
    platform_radius_m: f64,
    /// The actuated links, m
    #[arg(long, value_name = "M", default_value_t = RobotGeometry::default().upper_link_m, value_parser = number)]
    upper_link_m: f64,
    /// The rods, m
    #[arg(long, value_name = "M", default_value_t = RobotGeometry::default().lower_link_m, value_parser = number)]
    lower_link_m: f64,
    /// Directions of the arms, degrees
    #[arg(long, value_name = "A,B,C", default_value = "0,120,240", allow_hyphen_values = true, value_parser = triple)]
    arm_angles_deg: [f64; 3],
}

impl Robot {
    pub(crate) fn geometry(&self) -> RobotGeometry {
        RobotGeometry {
            base_radius_m: self.base_radius_m,
            platform_radius_m: self.platform_radius_m,
            upper_link_m: self.upper_link_m,
            lower_link_m: self.lower_link_m,
            arm_angles_deg: self.arm_angles_deg,
        }
    }
}

impl Kinematics {
    pub(crate) fn answer(&self) -> anyhow::Result<Answer> {
        match self {
            Self::Inverse(command) => command.answer(),
            Self::Forward(command) => command.answer(),
            Self::Jacobian(command) => command.answer(),
        }
    }
}

impl Inverse {
    fn answer(&self) -> anyhow::Result<Answer> {
        let request = self.input.request(|| {
            Ok(InverseRequest {
                geometry: self.robot.geometry(),
                position_m: self.position_m,
            })
        })?;
        let answer = theory::inverse(&request).map_err(|error| self.input.blame(error))?;
        let [x, y, z] = request.position_m;
        let table = || {
            let mut table = Table::new([
                "k_1",
                "k_2",
                "k_3",
                "joint_1_rad",
                "joint_2_rad",
                "joint_3_rad",
            ]);
            for solution in &answer.branches {
                let [a, b, c] = solution.branch.map(|sign| sign as f64);
                let [i, j, k] = solution.joints_rad;
                table.row([a, b, c, i, j, k].map(Into::into));
            }
            table
        };
        let heading = format!("Joint angles for {x}, {y}, {z} m, all eight branches");
        Answer::new(
            self.output,
            &answer,
            |_| vec![(heading, table())],
            |_| table(),
        )
    }
}

impl Forward {
    fn answer(&self) -> anyhow::Result<Answer> {
        let request = self.input.request(|| {
            Ok(ForwardRequest {
                geometry: self.robot.geometry(),
                joints_rad: self.joints_rad,
            })
        })?;
        let answer = theory::forward(&request).map_err(|error| self.input.blame(error))?;
        let table = || {
            let mut table = Table::new(["assembly", "x_m", "y_m", "z_m"]);
            for (name, [x, y, z]) in ["front", "back"].into_iter().zip(answer.positions_m) {
                table.row([name.into(), x.into(), y.into(), z.into()]);
            }
            table
        };
        let [a, b, c] = request.joints_rad;
        let heading = format!("Positions for {a}, {b}, {c} rad, both assemblies");
        Answer::new(
            self.output,
            &answer,
            |_| vec![(heading, table())],
            |_| table(),
        )
    }
}

impl Jacobian {
    fn answer(&self) -> anyhow::Result<Answer> {
        let request = self.input.request(|| {
            Ok(JacobianRequest {
                geometry: self.robot.geometry(),
                position_m: self.position_m,
                branch: self.branch,
            })
        })?;
        let answer = theory::jacobian(&request).map_err(|error| self.input.blame(error))?;
        let matrix = || {
            let mut table = Table::new(["row", "d/d rho_1", "d/d rho_2", "d/d rho_3"]);
            for (name, [a, b, c]) in ["x", "y", "z"].into_iter().zip(answer.jacobian) {
                table.row([name.into(), a.into(), b.into(), c.into()]);
            }
            table
        };
        let arms = || {
            let mut table = Table::new(["arm", "joint_rad", "from stretched or folded"]);
            for arm in 0..3 {
                let (joint, measure) = (answer.joints_rad[arm], answer.serial_measures[arm]);
                table.row([(arm + 1).into(), joint.into(), measure.into()]);
            }
            table
        };
        let whole = || {
            let mut table = Table::new(["quantity", "value"]);
            table.row(["condition number".into(), answer.condition_number.into()]);
            table.row(["rods from one plane".into(), answer.parallel_measure.into()]);
            table
        };
        let [x, y, z] = request.position_m;
        let tables = |_: &_| {
            vec![
                (format!("Jacobian at {x}, {y}, {z} m, m/rad"), matrix()),
                ("Arms".to_owned(), arms()),
                ("The robot".to_owned(), whole()),
            ]
        };
        Answer::new(self.output, &answer, tables, |_| matrix())
    }
}
