"""A block of clay that is cut, and the force that it answers with.

The clay's frame has its origin at a corner of the block, z up. Volumes are counted in units of a 255th of a voxel, and
``initial_units == remaining_units + removed_units`` holds exactly at every moment. The same sweeps give the same
``hash`` on every machine, the server's among them.

>>> clay = Clay(block([0.03, 0.02, 0.02]), voxel_size_m=1e-3)
>>> removed_units = clay.carve(ball(0.005), [0.005, 0.01, 0.02], [0.025, 0.01, 0.02])
>>> int(removed_units[0]) == clay.removed_units
True
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native
from ._shapes import Floats, body, together, vectors

Description = dict[str, Any]
"""A tool, a shape or a material, as the server's interface describes it."""

UNITS_PER_VOXEL: int = _native.Clay.UNITS_PER_VOXEL
"""Units of a full voxel."""


def ball(radius_m: float) -> Description:
    """A ball as a tool; its place is its centre."""
    return {"kind": "ball", "radius_m": radius_m}


def blade(width_m: float = 0.01, height_m: float = 0.04, thickness_m: float = 0.002) -> Description:
    """A blade as a tool, along y, z and x; its place is the middle of its lower edge."""
    return {"kind": "blade", "width_m": width_m, "height_m": height_m, "thickness_m": thickness_m}


def cylinder(radius_m: float, height_m: float) -> Description:
    """An upright rod with flat ends as a tool, as an end mill is; its place is the middle of its lower end."""
    return {"kind": "cylinder", "radius_m": radius_m, "height_m": height_m}


def loop(ring_radius_m: float, wire_diameter_m: float) -> Description:
    """A sculptor's loop as a tool: a ring of round wire, upright across x; its place is the middle of the ring.

    Its wire feels, and the disc within it removes: what passes through the ring is severed and taken away.
    """
    return {"kind": "loop", "ring_radius_m": ring_radius_m, "wire_diameter_m": wire_diameter_m}


def block(size_m: ArrayLike) -> Description:
    """A cuboid that fills ``[0, size_m]``, m, (3,)."""
    return {"kind": "block", "size_m": np.asarray(size_m, dtype=np.float64)}


def stepped(edges_m: ArrayLike, depths_of_cut_m: ArrayLike, base_m: float, width_m: float) -> Description:
    """A block that rises along x in steps: between ``edges_m[i]`` and ``edges_m[i + 1]`` it is
    ``base_m + depths_of_cut_m[i]`` high, m."""
    return {
        "kind": "stepped",
        "edges_m": np.asarray(edges_m, dtype=np.float64),
        "depths_of_cut_m": np.asarray(depths_of_cut_m, dtype=np.float64),
        "base_m": base_m,
        "width_m": width_m,
    }


def material(viscosity_pa_s_per_m: float = 2e5, yield_stress_pa: float = 0.0, stiffness_pa: float = 0.0) -> Description:
    """What clay resists with: Pa·s/m, Pa and Pa, each times the area that a tool engages."""
    return {
        "viscosity_pa_s_per_m": viscosity_pa_s_per_m,
        "yield_stress_pa": yield_stress_pa,
        "stiffness_pa": stiffness_pa,
    }


_VISCOUS = material()


@dataclass(frozen=True)
class Work:
    """What a tool met on its way, tick by tick."""

    force_n: Floats
    """Force of the clay on the tool, N, (N, 3)."""
    engaged_area_m2: Floats
    """Area of the tool that meets clay, m², (N,)."""
    removed_units: NDArray[np.uint64]
    """What was removed, in units of a 255th of a voxel, (N,)."""
    stored_j: Floats
    """Energy that the clay would give back, J, (N,)."""
    dissipated_j: Floats
    """Energy turned into heat during the tick, J, (N,)."""


class Clay:
    """A block of voxels."""

    def __init__(self, shape: Description, voxel_size_m: float = 5e-4) -> None:
        """
        :param shape: as :func:`block` or :func:`stepped` describe it
        :param voxel_size_m: edge of a voxel, m; at most 512 of them along an axis
        """
        self._native = _native.Clay(body({"shape": shape, "voxel_size_m": voxel_size_m}))

    @classmethod
    def _of(cls, native: _native.Clay) -> "Clay":
        clay = cls.__new__(cls)
        clay._native = native
        return clay

    def copy(self) -> "Clay":
        """The same clay, to be cut otherwise."""
        return self._of(self._native.copy())

    def carve(self, tool: Description, from_m: ArrayLike, to_m: ArrayLike) -> NDArray[np.uint64]:
        """Removes what straight sweeps pass through, one after another.

        :param tool: as :func:`ball`, :func:`blade`, :func:`cylinder` or :func:`loop` describe it; at least two voxels thick
        :param from_m: where each sweep begins, m, (..., 3)
        :param to_m: where it ends, m, (..., 3)
        :return: what each removed, in units of a 255th of a voxel, (N,)
        """
        flat, _ = together(("from_m", from_m, 3), ("to_m", to_m, 3))
        return self._native.carve(body(tool), flat)

    def work(self, tool: Description, path_m: ArrayLike, material: Description | None = None, tick_s: float = 1e-3) -> Work:
        """Moves a tool along places, one a tick; it cuts, and the clay answers.

        :param path_m: places of the tool, m, (N, 3), the first at rest
        :param material: as :func:`material` describes it; purely viscous when left out
        """
        flat, shape = vectors("path_m", path_m)
        resists = _VISCOUS if material is None else material
        force_n, area_m2, removed, stored_j, dissipated_j = self._native.work(body(tool), body(resists), flat, tick_s)
        return Work(force_n.reshape(-1, 3), area_m2, removed, stored_j, dissipated_j)

    def engaged_area_m2(self, tool: Description, position_m: ArrayLike, direction: ArrayLike) -> Floats:
        """Area of a tool that meets clay when it moves in a direction, m².

        :param position_m: places of the tool, m, (..., 3)
        :param direction: of its motion, (..., 3)
        """
        flat, shape = together(("position_m", position_m, 3), ("direction", direction, 3))
        return self._native.engaged_area(body(tool), flat).reshape(shape)

    def occupancy(self) -> NDArray[np.uint8]:
        """Every voxel, (z, y, x), from 0 (empty) to 255 (full)."""
        return self._native.occupancy().reshape(self._native.shape)

    def surface(self) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
        """The surface as a closed mesh: vertices, m, (V, 3), and vertex numbers of triangles, (T, 3)."""
        positions_m, triangles = self._native.surface()
        return positions_m.reshape(-1, 3), triangles.reshape(-1, 3)

    def stl(self) -> bytes:
        """The surface as binary STL, lengths in millimetres: the bytes of the server's ``clay.stl``."""
        return self._native.stl()

    @property
    def hash(self) -> str:
        """Of all voxels, 16 hexadecimal digits; the server's ``clay.hash`` for the same clay."""
        return self._native.hash

    @property
    def voxel_size_m(self) -> float:
        """Edge of a voxel, m."""
        return self._native.voxel_size_m

    @property
    def initial_units(self) -> int:
        """What there was at first, in units of a 255th of a voxel."""
        return self._native.initial_units

    @property
    def remaining_units(self) -> int:
        """What is left, in units of a 255th of a voxel."""
        return self._native.remaining_units

    @property
    def removed_units(self) -> int:
        """What was removed, in units of a 255th of a voxel."""
        return self._native.removed_units

    @property
    def initial_volume_m3(self) -> float:
        """What there was at first, m³."""
        return self._native.initial_volume_m3

    @property
    def remaining_volume_m3(self) -> float:
        """What is left, m³."""
        return self._native.remaining_volume_m3

    @property
    def removed_volume_m3(self) -> float:
        """What was removed, m³."""
        return self._native.removed_volume_m3
