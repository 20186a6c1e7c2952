"""The two sides of a haptic loop as transfer functions: compensators, margins, and what grows past them.

A transfer function is ``{"numerator": [...], "denominator": [...]}``, coefficients with the highest power first. See
docs/theory/stability.md and docs/theory/compensators.md.

>>> found = analyse(**paper_loop(clay_damping_n_s_per_m=60))
>>> found["stable_without_delay"]
True
>>> found["closed_loop_poles"].dtype
dtype('complex128')
"""

import json
from dataclasses import dataclass
from typing import Any, Literal, TypedDict

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native
from ._shapes import Floats, arrays, body, scalars

DelayedScheme = Literal["force_exchange", "position_force"]


class TransferFunction(TypedDict):
    """A rational function of ``s``, coefficients with the highest power first."""

    numerator: list[float]
    denominator: list[float]


PAPER: dict[str, Any] = json.loads(_native.plants())
"""The paper's plants, and our values for what it does not print: ``g_h`` (35), ``g_h_y`` (36), ``t_h`` (37), ``c_h1``,
``g_t``, the ratios, and the cutting experiment's ``hand_force_n``, ``edges_m`` and ``clay_damping_n_s_per_m``."""


def paper_loop(**changes: Any) -> dict[str, Any]:
    """The paper's loop at its x axis, as :func:`analyse` takes it, with fields changed."""
    plants = {name: PAPER[name] for name in ("g_h", "t_h", "c_h1", "g_t", "position_ratio", "force_ratio")}
    return plants | {"clay_damping_n_s_per_m": 20.0, "clay_stiffness_n_per_m": 0.0} | changes


def admittance(mass_kg: float, damping_n_s_per_m: float) -> TransferFunction:
    """``C_h1 = 1 / (M s² + B s)``: what the handle is to the hand."""
    return {"numerator": [1.0], "denominator": [mass_kg, damping_n_s_per_m, 0.0]}


def analyse(**loop: Any) -> dict[str, Any]:
    """Everything about a loop: ``POST /api/v1/analysis/loop``, bit for bit.

    The fields are the interface's, :func:`paper_loop` has all of them. Of the answer, lists are arrays, ``null`` among
    numbers is NaN, and complex numbers are complex: ``closed_loop_poles`` in rad/s, ``compensators`` by name with
    ``omega_rad_s``, ``nyquist`` (its points as ``value`` too) and ``bode`` along ``omega_rad_s``; the delay margins are
    round trips in s.
    """
    answer = json.loads(_native.theory("analyse", body(loop)))
    points = answer.pop("compensators")
    poles = np.array(answer.pop("closed_loop_poles"), dtype=np.float64).reshape(-1, 2)
    found: dict[str, Any] = arrays(answer)
    found["closed_loop_poles"] = poles[:, 0] + 1j * poles[:, 1]
    found["compensators"] = {
        name: np.array([complex(*(point[name] or (np.nan, np.nan))) for point in points])
        for name in ("c_h1", "c_t1", "c_h2", "c_t2")
    } | {"omega_rad_s": np.array([point["omega_rad_s"] for point in points])}
    nyquist = found["nyquist"]
    nyquist["value"] = np.asarray(nyquist["re"]) + 1j * np.asarray(nyquist["im"])
    return found


def tune(**target: Any) -> dict[str, Any]:
    """The lightest handle that keeps a distance from the verge: ``POST /api/v1/analysis/tuning``, bit for bit.

    Fields beside the plants of :func:`paper_loop`: ``clay_damping_n_s_per_m`` and ``clay_stiffness_n_per_m``, least and
    greatest; ``scheme``, ``round_trip_s``, ``distance``, ``heaviest_n_s_per_m``. Ctrl-C calls the search off.
    """
    return dict(arrays(json.loads(_native.theory("tune", body(target)))))


@dataclass(frozen=True)
class StabilityMap:
    """What grows by itself in a loop, over clay and delay."""

    clay_damping_n_s_per_m: Floats
    """Clays, N·s/m, (C,)."""
    round_trip_s: Floats
    """Round trips, s, (R,)."""
    rate_per_s: Floats
    """Rate at which the fastest motion grows, 1/s, (C, R); NaN where nothing grows."""
    frequency_hz: Floats
    """How often it swings, Hz, (C, R); NaN where nothing grows."""
    delay_margin_s: Floats
    """Round trip that each clay bears, s, (C,): infinite for any, below zero where it is unstable without delay.
    Calculated from the loop alone, not from the map."""

    @property
    def is_stable(self) -> NDArray[np.bool_]:
        """Whether nothing grows, (C, R)."""
        return np.isnan(self.rate_per_s)


def stability_map(
    loop: dict[str, Any],
    clay_damping_n_s_per_m: ArrayLike,
    round_trip_s: ArrayLike,
    scheme: DelayedScheme = "force_exchange",
    slowest_per_s: float = 1e-6,
) -> StabilityMap:
    """What grows fastest in a loop, for every clay and every round trip.

    :param loop: as for :func:`analyse`; its own clay damping does not count
    :param clay_damping_n_s_per_m: clays, N·s/m, (C,)
    :param round_trip_s: round trips, s, (R,), each from 0 to 10
    :param scheme: the paper's own, or position forward and force back
    :param slowest_per_s: what grows more slowly counts as stable, 1/s
    """
    clays = np.ascontiguousarray(clay_damping_n_s_per_m, dtype=np.float64).reshape(-1)
    delays = np.ascontiguousarray(round_trip_s, dtype=np.float64).reshape(-1)
    grown, margins = _native.growth(body(loop), scheme, clays, delays, slowest_per_s)
    grown = grown.reshape(clays.size, delays.size, 2)
    return StabilityMap(clays, delays, grown[..., 0], grown[..., 1], margins)


def frequency_response(function: TransferFunction, omega_rad_s: ArrayLike) -> NDArray[np.complex128]:
    """A transfer function at frequencies; NaN at a pole.

    :param omega_rad_s: frequencies, rad/s, any shape
    """
    omegas = np.ascontiguousarray(omega_rad_s, dtype=np.float64)
    flat = _native.frequency_response(function["numerator"], function["denominator"], omegas.reshape(-1))
    return flat.view(np.complex128).reshape(omegas.shape)


def respond(
    function: TransferFunction, input: ArrayLike, tick_s: float = 1e-3, method: Literal["zoh", "tustin"] = "zoh"
) -> Floats:
    """What a plant gives for an input, sample by sample, from rest.

    :param input: samples, (N,)
    :param method: the input is held from sample to sample (``zoh``), or goes straight (``tustin``)
    :return: samples, (N,)
    """
    samples = np.ascontiguousarray(input, dtype=np.float64).reshape(-1)
    return _native.respond(function["numerator"], function["denominator"], samples, tick_s, method)


def critical_stiffness(mass_kg: ArrayLike, damping_n_s_per_m: ArrayLike, rtt_s: ArrayLike, tick_s: ArrayLike = 1e-3) -> Floats:
    """Stiffness at which a wall across a network begins to oscillate, N/m. Shapes are broadcast.

    :param mass_kg: of the handle, kg
    :param damping_n_s_per_m: of the handle, N·s/m
    :param rtt_s: round trip, s
    :param tick_s: sample time of the wall, s
    """
    flat, shape = scalars(mass_kg, damping_n_s_per_m, rtt_s, tick_s)
    return _native.critical_stiffness(flat).reshape(shape)


def passive_stiffness(damping_n_s_per_m: ArrayLike, wall_damping_n_s_per_m: ArrayLike, tick_s: ArrayLike = 1e-3) -> Floats:
    """Greatest stiffness of a sampled wall with damping of its own that stays passive, N/m. Shapes are broadcast."""
    flat, shape = scalars(damping_n_s_per_m, wall_damping_n_s_per_m, tick_s)
    return _native.passive_stiffness(flat).reshape(shape)
