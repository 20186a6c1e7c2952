//! What `import teleclay` has of Rust. The Python around it, in `teleclay/`, gives it shapes, names and documentation.
//!
//! | module | is |
//! |---|---|
//! | [`arrays`] | numpy's arrays as slices, and back |
//! | [`theory`] | the calls of the theory in the JSON of REST |
//! | [`kinematics`] | the robot, for many points at once |
//! | [`control`] | plants, walls, and what grows past a delay margin |
//! | [`clay`] | a block of clay |
//! | [`sim`] | the loop on virtual time |
//! | [`scheme`] | a scheme whose two ends are Python's, on virtual time |
//! | [`wire`] | the telemetry of a stream |
//! | [`hand`] | a hand at a running server: its loop is a thread that never asks for Python's lock |

mod arrays;
mod clay;
mod control;
mod hand;
mod kinematics;
mod scheme;
mod sim;
mod theory;
mod wire;

use pyo3::prelude::*;

/// What is written in Rust. Its callers are the modules beside it.
#[pymodule]
mod _native {
    #[pymodule_export]
    use super::clay::Clay;
    #[pymodule_export]
    use super::control::{
        critical_stiffness, frequency_response, growth, passive_stiffness, plants, respond,
    };
    #[pymodule_export]
    use super::hand::{Hand, NotGranted};
    #[pymodule_export]
    use super::kinematics::{elbows, forward, inverse, inverse_on, jacobian, torques};
    #[pymodule_export]
    use super::sim::{Rig, latency_cell, latency_cells, measured_critical_stiffness};
    #[pymodule_export]
    use super::theory::theory;
    #[pymodule_export]
    use super::wire::decode_telemetry;
}
