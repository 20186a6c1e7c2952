//! The telemetry of a stream.

use pyo3::prelude::*;
use teleclay_wire::TelemetryView;

use crate::arrays::{Made, array, refused};

/// Header of a batch: sequence, tool, period in µs, samples dropped, time of the first sample in s.
type Header = (u32, u32, u32, u32, f64);

/// A batch of telemetry: its header, and 27 numbers a sample in the order of the specification.
#[pyfunction]
pub(crate) fn decode_telemetry<'py>(
    py: Python<'py>,
    message: &[u8],
) -> PyResult<(Header, Made<'py, f32>)> {
    let view = TelemetryView::decode(message).map_err(refused)?;
    let mut numbers = Vec::with_capacity(27 * view.len());
    for sample in view.iter() {
        for vector in [
            sample.hand_force_n,
            sample.felt_force_n,
            sample.tool_force_n,
            sample.handle_position_m,
            sample.tool_position_m,
            sample.handle_velocity_m_s,
            sample.tool_velocity_m_s,
        ] {
            numbers.extend(vector);
        }
        numbers.extend([
            sample.energy_handle_j,
            sample.energy_tool_j,
            sample.rtt_s,
            sample.correction_step_n,
            sample.correction_held_n,
            sample.age_s,
        ]);
    }
    let batch = view.batch;
    let header = (
        batch.sequence,
        batch.tool,
        batch.period_us,
        batch.dropped,
        batch.first_time_s,
    );
    Ok((header, array(py, numbers)))
}
