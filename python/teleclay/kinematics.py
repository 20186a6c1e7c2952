"""The three-armed parallel robot: where joints put the platform, and how it moves there.

Every function takes arrays of any shape whose last axis is a vector, and gives the same shape back: a thousand
positions at once cost one call. A point that has no answer is a :class:`ValueError`, or NaN with
``unreachable="nan"``. Equation numbers are those of the paper; see docs/theory/robot.md.

>>> import numpy as np
>>> joints_rad = inverse([[0.02, -0.03, 0.16], [0, 0, 0.15]])
>>> joints_rad.shape
(2, 8, 3)
>>> positions_m = forward(joints_rad[0, 7])
>>> bool(np.isclose(positions_m, [0.02, -0.03, 0.16]).all(axis=-1).any())
True
"""

from dataclasses import astuple, dataclass, asdict
from typing import Any, Literal, NamedTuple

import json
import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native
from ._shapes import Floats, arrays, body, together, vectors

Unreachable = Literal["raise", "nan"]
Branch = tuple[int, int, int]

OUTWARDS: Branch = (-1, -1, -1)
"""The signs ``K_j`` that put all elbows outwards, with the platform above the base."""

BRANCHES: NDArray[np.int64] = np.array([[x, y, z] for x in (1, -1) for y in (1, -1) for z in (1, -1)])
"""Signs of the eight joint sets, shape (8, 3), in the order in which :func:`inverse` gives them."""


@dataclass(frozen=True)
class Geometry:
    """Dimensions of the robot. The default is one that fits on a desk: the paper prints none."""

    base_radius_m: float = 0.12
    """``r_b``, from the centre of the base to the joints, m."""
    platform_radius_m: float = 0.04
    """``r_p``, from the centre of the platform to the rods, m."""
    upper_link_m: float = 0.10
    """``l_1``, the actuated links, m."""
    lower_link_m: float = 0.20
    """``l_2``, the rods, m."""
    arm_angles_deg: tuple[float, float, float] = (0.0, 120.0, 240.0)
    """Directions of the arms on the base, degrees; no two alike."""

    def _raw(self) -> tuple[float, float, float, float, float, float, float]:
        base, platform, upper, lower, (first, second, third) = astuple(self)
        return (base, platform, upper, lower, first, second, third)


DESKTOP = Geometry()
"""The default robot."""


class Jacobian(NamedTuple):
    """The robot at places, on one branch. Shapes are those of the positions, then what stands here."""

    jacobian: Floats
    """``J`` (15) by rows, (..., 3, 3): from joint rates in rad/s to platform velocity in m/s."""
    condition_number: Floats
    """Greatest over least singular value of ``J``, (...); 1 is best."""
    joints_rad: Floats
    """``rho_j``, rad, (..., 3)."""
    elbows_m: Floats
    """Elbows of the three arms, m, (..., 3, 3)."""
    serial_measures: Floats
    """How far each arm is from stretched or folded, (..., 3), from 0 (singular) to 1."""
    parallel_measure: Floats
    """How far the rods are from one plane, (...), from 0 (singular) to 1."""


@dataclass(frozen=True)
class Workspace:
    """A map of where the robot reaches."""

    dexterity: Floats
    """Inverse condition number at the centre of each cell, (z, y, x): 0 at a singularity to 1, NaN out of reach."""
    region_m: Floats
    """Corners of the box that was mapped, least first, m, (2, 3)."""
    reachable_share: float
    """Share of the cells that is reachable."""
    reachable_volume_m3: float
    """Volume of the reachable cells, m³; 0 for a slice."""
    mean_dexterity: float
    """Mean over the reachable cells; NaN where there are none."""


def inverse(position_m: ArrayLike, geometry: Geometry = DESKTOP, *, unreachable: Unreachable = "raise") -> Floats:
    """All eight joint sets for positions, (6)–(12).

    :param position_m: where the platform is to be, m, (..., 3)
    :return: ``rho_j``, rad, (..., 8, 3), each above -pi and at most pi; the signs of each set are in :data:`BRANCHES`
    """
    flat, shape = vectors("position_m", position_m)
    return _native.inverse(geometry._raw(), flat, unreachable).reshape(*shape, 8, 3)


def inverse_on(
    position_m: ArrayLike, branch: Branch = OUTWARDS, geometry: Geometry = DESKTOP, *, unreachable: Unreachable = "raise"
) -> Floats:
    """The joint set of one branch for positions.

    :param position_m: where the platform is to be, m, (..., 3)
    :param branch: the signs ``K_j``, each 1 or -1
    :return: ``rho_j``, rad, (..., 3)
    """
    flat, shape = vectors("position_m", position_m)
    return _native.inverse_on(geometry._raw(), flat, branch, unreachable).reshape(*shape, 3)


def forward(joints_rad: ArrayLike, geometry: Geometry = DESKTOP, *, unreachable: Unreachable = "raise") -> Floats:
    """Both positions for joint sets, (1)–(5). They mirror each other in the plane of the elbows.

    :param joints_rad: ``rho_j``, rad, (..., 3)
    :return: positions, m, (..., 2, 3)
    """
    flat, shape = vectors("joints_rad", joints_rad)
    return _native.forward(geometry._raw(), flat, unreachable).reshape(*shape, 2, 3)


def elbows(joints_rad: ArrayLike, geometry: Geometry = DESKTOP) -> Floats:
    """Elbows of the three arms for joint sets.

    :param joints_rad: ``rho_j``, rad, (..., 3)
    :return: elbows, m, (..., 3, 3)
    """
    flat, shape = vectors("joints_rad", joints_rad)
    return _native.elbows(geometry._raw(), flat).reshape(*shape, 3, 3)


def jacobian(
    position_m: ArrayLike, branch: Branch = OUTWARDS, geometry: Geometry = DESKTOP, *, unreachable: Unreachable = "raise"
) -> Jacobian:
    """How one branch moves at positions (15), and how far it is from singular.

    :param position_m: where the platform is, m, (..., 3)
    :param branch: the signs ``K_j``, each 1 or -1
    """
    flat, shape = vectors("position_m", position_m)
    numbers = _native.jacobian(geometry._raw(), flat, branch, unreachable).reshape(*shape, 26)
    return Jacobian(
        jacobian=numbers[..., :9].reshape(*shape, 3, 3),
        condition_number=numbers[..., 9],
        joints_rad=numbers[..., 10:13],
        elbows_m=numbers[..., 13:22].reshape(*shape, 3, 3),
        serial_measures=numbers[..., 22:25],
        parallel_measure=numbers[..., 25],
    )


def torques(
    position_m: ArrayLike,
    force_n: ArrayLike,
    branch: Branch = OUTWARDS,
    geometry: Geometry = DESKTOP,
    *,
    unreachable: Unreachable = "raise",
) -> Floats:
    """Joint torques that hold forces on the platform, ``J^T F``.

    :param position_m: where the platform is, m, (..., 3)
    :param force_n: force on it, N, (..., 3)
    :return: torques, N·m, (..., 3)
    """
    flat, shape = together(("position_m", position_m, 3), ("force_n", force_n, 3))
    return _native.torques(geometry._raw(), flat, branch, unreachable).reshape(*shape, 3)


def workspace(
    cells: tuple[int, int, int] = (32, 32, 32),
    region_m: ArrayLike | None = None,
    branch: Branch = OUTWARDS,
    geometry: Geometry = DESKTOP,
) -> Workspace:
    """Where the robot reaches, and how evenly it moves there.

    :param cells: cells along x, y and z, 100,000 in all at most
    :param region_m: corners of the box to map, least first, m, (2, 3); all that is in reach when left out
    """
    corners = None if region_m is None else np.asarray(region_m, dtype=np.float64)
    request: dict[str, Any] = {"geometry": asdict(geometry), "branch": branch, "region_m": corners, "cells": cells}
    answer = json.loads(_native.theory("workspace", body(request)))
    mean = answer["mean_dexterity"]
    dexterity = np.array([np.nan if value is None else value for value in answer["dexterity"]], dtype=np.float64)
    return Workspace(
        dexterity=dexterity.reshape(answer["cells"][::-1]),
        region_m=arrays(answer["region_m"]),
        reachable_share=answer["reachable_share"],
        reachable_volume_m3=answer["reachable_volume_m3"],
        mean_dexterity=np.nan if mean is None else mean,
    )
