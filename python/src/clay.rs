//! A block of clay.

use pyo3::prelude::*;
use pyo3::types::PyBytes;
use teleclay_bilateral::{fresh_clay, material, tool_shape};
use teleclay_clay::{
    BrickView, ContactState, Mesh, Motion, Pose, Sweep, Tool, ToolShape, UNITS_PER_VOXEL, stl,
};
use teleclay_proto::http::{ClaySpec, Material, ToolDescription, parse};

use crate::arrays::{Flat, Made, array, at, refused, rows};

/// Numbers of a surface: vertices in m, then vertex numbers of triangles.
type Surface<'py> = (Made<'py, f32>, Made<'py, u32>);
/// What work gave, tick by tick: forces, engaged areas, units removed, energies stored and dissipated.
type Work<'py> = (
    Made<'py, f64>,
    Made<'py, f64>,
    Made<'py, u64>,
    Made<'py, f64>,
    Made<'py, f64>,
);

/// A block of voxels, and what a tool that works in it has stretched.
#[pyclass]
#[derive(Clone)]
pub(crate) struct Clay {
    pub(crate) clay: teleclay_clay::Clay,
    contact: ContactState,
}

impl From<teleclay_clay::Clay> for Clay {
    fn from(clay: teleclay_clay::Clay) -> Self {
        Self {
            clay,
            contact: ContactState::default(),
        }
    }
}

#[pymethods]
impl Clay {
    /// From a `ClaySpec`, JSON.
    #[new]
    fn new(py: Python<'_>, spec: &str) -> PyResult<Self> {
        let spec: ClaySpec = parse(spec.as_bytes()).map_err(refused)?;
        let made = py.detach(|| fresh_clay(&spec));
        Ok(made.map_err(refused)?.into())
    }

    fn copy(&self) -> Self {
        self.clone()
    }

    /// What each sweep removes, in units of a 255th of a voxel; a row is where it begins and where it ends, m.
    fn carve<'py>(
        &mut self,
        py: Python<'py>,
        tool: &str,
        from_m_to_m: Flat<'py>,
    ) -> PyResult<Made<'py, u64>> {
        let shape = self.tool(tool)?;
        let rows = rows::<6>(&from_m_to_m)?;
        let mut sweeps = Vec::with_capacity(rows.len());
        for (number, row) in rows.iter().enumerate() {
            let [x, y, z, to @ ..] = *row;
            let pose = |place| {
                Pose::quantise(place).map_err(|error| at("sweep", number, rows.len(), error))
            };
            sweeps.push(Sweep {
                shape,
                from: pose([x, y, z])?,
                to: pose(to)?,
            });
        }
        let clay = &mut self.clay;
        let removed = py.detach(|| sweeps.iter().map(|sweep| clay.carve(sweep)).collect());
        Ok(array(py, removed))
    }

    /// Moves a tool along places, one a tick, cuts, and tells what the clay answers.
    fn work<'py>(
        &mut self,
        py: Python<'py>,
        tool: &str,
        material: &str,
        path_m: Flat<'py>,
        tick_s: f64,
    ) -> PyResult<Work<'py>> {
        if !(1e-5..=0.1).contains(&tick_s) {
            return Err(refused(format!(
                "tick_s is {tick_s}, need a number from 0.00001 to 0.1"
            )));
        }
        let tool = Tool::new(self.tool(tool)?);
        let material = proven_material(material)?;
        let places = rows::<3>(&path_m)?;
        let mut motions = Vec::with_capacity(places.len());
        for (number, place) in places.iter().enumerate() {
            let before = places[number.saturating_sub(1)];
            let said = |error: &dyn std::fmt::Display| at("path_m", number, places.len(), error);
            let from = Pose::quantise(before).map_err(|error| said(&error))?;
            let to = Pose::quantise(*place).map_err(|error| said(&error))?;
            let velocity = std::array::from_fn(|axis| (place[axis] - before[axis]) / tick_s);
            motions.push(Motion::new(from, to, velocity).map_err(|error| said(&error))?);
        }
        let (clay, contact) = (&mut self.clay, &mut self.contact);
        let worked: Vec<_> = py.detach(|| {
            let work = |motion| clay.work(&tool, &material, motion, contact);
            motions.iter().map(work).collect()
        });
        let each = |value: fn(&teleclay_clay::Worked) -> f64| worked.iter().map(value).collect();
        let forces = worked.iter().flat_map(|worked| worked.response.force_n);
        Ok((
            array(py, forces.collect()),
            array(py, each(|worked| worked.response.engaged_area_m2)),
            array(py, worked.iter().map(|worked| worked.moved_units).collect()),
            array(py, each(|worked| worked.response.stored_j)),
            array(py, each(|worked| worked.response.dissipated_j)),
        ))
    }

    /// Engaged area of a tool at each place in a direction, m²; a row is a place and a direction.
    fn engaged_area<'py>(
        &self,
        py: Python<'py>,
        tool: &str,
        at_m_direction: Flat<'py>,
    ) -> PyResult<Made<'py, f64>> {
        let tool = Tool::new(self.tool(tool)?);
        let rows = rows::<6>(&at_m_direction)?;
        let mut asked = Vec::with_capacity(rows.len());
        for (number, row) in rows.iter().enumerate() {
            let [x, y, z, direction @ ..] = *row;
            let pose = Pose::quantise([x, y, z])
                .map_err(|error| at("position_m", number, rows.len(), error))?;
            asked.push((pose, direction));
        }
        let clay = &self.clay;
        let areas = py.detach(|| {
            let area = |(pose, direction): &(Pose, [f64; 3])| {
                clay.engaged_area_m2(&tool, *pose, *direction)
            };
            asked.iter().map(area).collect()
        });
        Ok(array(py, areas))
    }

    /// Every voxel, x fastest, then y, then z: 0 empty to 255 full. Bricks are whole, so there are `shape` of them.
    fn occupancy<'py>(&self, py: Python<'py>) -> Made<'py, u8> {
        let clay = &self.clay;
        let grid = clay.grid();
        let [nx, ny, nz] = grid.voxels().map(usize::from);
        let voxels = py.detach(|| {
            let mut voxels = vec![0; nx * ny * nz];
            for dense in 0..grid.brick_count() as u32 {
                let Some(index) = grid.brick_index(dense) else {
                    continue;
                };
                let corner = grid.brick_coordinates(index).map(|at| 16 * usize::from(at));
                let view = clay.brick(index);
                for z in 0..16.min(nz - corner[2]) {
                    for y in 0..16.min(ny - corner[1]) {
                        let start = corner[0] + nx * (corner[1] + y + ny * (corner[2] + z));
                        let length = 16.min(nx - corner[0]);
                        let row = &mut voxels[start..start + length];
                        match view {
                            BrickView::Empty => {}
                            BrickView::Full => row.fill(u8::MAX),
                            BrickView::Voxels(brick) => {
                                let from = 16 * (y + 16 * z);
                                row.copy_from_slice(&brick[from..from + length]);
                            }
                        }
                    }
                }
            }
            voxels
        });
        array(py, voxels)
    }

    /// The surface: vertices, m, and triangles.
    fn surface<'py>(&self, py: Python<'py>) -> Surface<'py> {
        let clay = &self.clay;
        let mesh = py.detach(|| Mesh::of(clay));
        (
            array(py, mesh.positions_m.into_iter().flatten().collect()),
            array(py, mesh.triangles.into_iter().flatten().collect()),
        )
    }

    fn stl<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        let clay = &self.clay;
        let bytes = py.detach(|| stl::encode(&Mesh::of(clay)));
        PyBytes::new(py, &bytes)
    }

    #[getter]
    fn hash(&mut self) -> String {
        format!("{:016x}", self.clay.hash())
    }

    /// Voxels along z, y and x: as an array of numpy counts its axes.
    #[getter]
    fn shape(&self) -> (u16, u16, u16) {
        let [x, y, z] = self.clay.grid().voxels();
        (z, y, x)
    }

    #[getter]
    fn voxel_size_m(&self) -> f64 {
        self.clay.grid().voxel_size_m()
    }

    #[getter]
    fn initial_units(&self) -> u64 {
        self.clay.initial_units()
    }

    #[getter]
    fn remaining_units(&self) -> u64 {
        self.clay.remaining_units()
    }

    #[getter]
    fn removed_units(&self) -> u64 {
        self.clay.removed_units()
    }

    #[getter]
    fn initial_volume_m3(&self) -> f64 {
        self.clay.initial_volume_m3()
    }

    #[getter]
    fn remaining_volume_m3(&self) -> f64 {
        self.clay.remaining_volume_m3()
    }

    #[getter]
    fn removed_volume_m3(&self) -> f64 {
        self.clay.removed_volume_m3()
    }

    #[classattr]
    #[pyo3(name = "UNITS_PER_VOXEL")]
    fn units_per_voxel() -> u64 {
        UNITS_PER_VOXEL
    }
}

impl Clay {
    /// A tool that is thick enough for this clay.
    fn tool(&self, description: &str) -> PyResult<ToolShape> {
        let description: ToolDescription = parse(description.as_bytes()).map_err(refused)?;
        let shape = tool_shape(&description).map_err(refused)?;
        self.clay.admits(&shape).map_err(refused)?;
        Ok(shape)
    }
}

fn proven_material(description: &str) -> PyResult<teleclay_clay::Material> {
    let description: Material = parse(description.as_bytes()).map_err(refused)?;
    material(&description).map_err(refused)
}
