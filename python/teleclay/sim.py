"""The loop on virtual time: a simulated person, both sides of the loop, and the lines between them.

The two sides are the very ones that run in the server and the handle; the same seed gives the same bits.

>>> rig = Rig(scheme="replica", network={"up": {"delay_s": 0.04}, "down": {"delay_s": 0.04}}, tool=clays.ball(0.006))
>>> rig.intend_cutting(reach_m=(0.04, 0.015, 0.008))
>>> record = rig.run(2.0)
>>> record.felt_force_n.shape
(2000, 3)

A scheme of your own is a :class:`Scheme`: two functions that are called in every tick. On virtual time they may hold
Python's lock; in a running loop nothing of Python's is on the tick, see :func:`teleclay.operate`.
"""

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from . import _native
from . import clay as clays
from ._shapes import Floats, arrays, body, vectors

SchemeName = Literal["force_exchange", "position_force", "wave", "tdpa", "replica"]

SCHEMES: tuple[SchemeName, ...] = ("force_exchange", "position_force", "wave", "tdpa", "replica")
"""The schemes that are built in."""

_NOTHING: Floats = np.zeros(3)


@dataclass(frozen=True)
class Record:
    """What happened in a run, sample by sample. Names are those of the telemetry."""

    time_s: Floats
    """Virtual time, s, (N,)."""
    hand_force_n: Floats
    """Force of the hand on the handle, N, (N, 3)."""
    felt_force_n: Floats
    """Force of the handle on the hand, N, (N, 3)."""
    tool_force_n: Floats
    """Force of the clay on the tool, N, (N, 3)."""
    handle_position_m: Floats
    """Handle, in its own frame, m, (N, 3)."""
    tool_position_m: Floats
    """Tool, in the clay's frame, m, (N, 3)."""
    handle_velocity_m_s: Floats
    """Handle, m/s, (N, 3)."""
    tool_velocity_m_s: Floats
    """Tool, m/s, (N, 3)."""
    energy_j: Floats
    """Energy in the channel between hand and clay, J, (N,), from true work at both ends: a passive one never gives more
    than it got."""


class HandlePort(NamedTuple):
    """What is measured at the handle in a tick. Vectors are (3,)."""

    now_s: float
    """Virtual time, s."""
    position_m: Floats
    """Displacement of the handle from its home, m."""
    velocity_m_s: Floats
    """Its rate, m/s."""
    hand_force_n: Floats
    """Net force of the hand at the sensor, N."""
    displacement_m: Floats
    """How far it moved since the last tick, m; zero on axes that reflect no force."""
    felt_force_n: Floats
    """What the hand felt meanwhile, N, after all limits."""


class ToolPort(NamedTuple):
    """What is measured at the tool in a tick. Vectors are (3,)."""

    now_s: float
    """Virtual time, s."""
    position_m: Floats
    """Displacement of the tool from the image of the handle's home, m."""
    velocity_m_s: Floats
    """Its rate, m/s."""
    clay_force_n: Floats
    """Force of the clay on the tool, N; zero on axes that reflect no force."""
    spring_force_n: Floats
    """The part of it that is the clay's spring, N."""
    displacement_m: Floats
    """How far it moved in the last tick, m; zero on axes that reflect no force."""
    remote_gain: float
    """The watchdog's, 0 to 1: scales whatever the scheme makes of old news."""


class Heard(NamedTuple):
    """The newest frame of the other end. Vectors are (3,)."""

    position_m: Floats
    """Handle in its own frame, or tool in the clay's, m."""
    velocity_m_s: Floats
    """Its velocity, m/s."""
    force_n: Floats
    """At the handle: force of the clay on the tool, N. At the tool: force of the hand on the handle, N."""
    first: Floats
    """The first vector that the other end's :class:`Said` sent along; in units of its own."""
    second: Floats
    """The second."""
    third: Floats
    """The third."""


class Said(NamedTuple):
    """What an end gives: its answer, and up to three vectors that go to the other end. Each is (3,)."""

    answer: ArrayLike
    """At the handle: the force on the hand, N. At the tool: where it should be a tick later, m, as displacement."""
    first: ArrayLike = _NOTHING
    """Goes along; of magnitude 10⁹ at most."""
    second: ArrayLike = _NOTHING
    """Goes along; of magnitude 10¹² at most."""
    third: ArrayLike = _NOTHING
    """Goes along; of magnitude 10¹² at most."""


class Scheme:
    """A scheme of your own: derive from it, and give both ends a function.

    Limits, ramps, watchdogs and motion bounds stay those of every scheme. A new object is needed for every run.
    """

    incremental: bool = False
    """Whether the tool's reference is a sum of steps: then the tool goes on from where it was held."""

    def handle(self, port: HandlePort, heard: Heard | None) -> Said:
        """A tick at the handle. ``heard`` is the newest frame of the tool side, if one has come since the last tick."""
        raise NotImplementedError

    def tool(self, port: ToolPort, heard: Heard | None) -> Said:
        """A tick at the tool. ``heard`` is the newest frame of the handle, if one has come since the last tick."""
        raise NotImplementedError

    def restart(self, handle_position_m: Floats) -> None:
        """The tool side starts anew with the handle there, m, at rest."""

    def _handle(self, now_s: float, port: Floats, heard: Floats | None, _gain: float) -> list[float]:
        position, velocity, hand, way, felt = port.reshape(5, 3)
        return _given(self.handle(HandlePort(now_s, position, velocity, hand, way, felt), _heard(heard)))

    def _tool(self, now_s: float, port: Floats, heard: Floats | None, gain: float) -> list[float]:
        position, velocity, clay, spring, way = port.reshape(5, 3)
        return _given(self.tool(ToolPort(now_s, position, velocity, clay, spring, way, gain), _heard(heard)))

    def _restart(self, handle_position_m: Floats) -> None:
        self.restart(handle_position_m)


class Rig:
    """A session on virtual time, and the one who works in it."""

    def __init__(
        self,
        scheme: SchemeName | Scheme = "replica",
        *,
        axes: Literal[2, 3] = 2,
        tool: clays.Description | None = None,
        material: clays.Description | None = None,
        clay: clays.Description | None = None,
        network: dict[str, Any] | None = None,
        deadband: float = 0.0,
        parameters: dict[str, Any] | None = None,
    ) -> None:
        """A session as ``POST /api/v1/sessions`` makes it from the same fields, everything at rest.

        :param scheme: a built-in one by name, or one of your own
        :param clay: ``{"shape": ..., "voxel_size_m": ...}``
        :param network: ``{"up": ..., "down": ...}``, an impairment each: ``delay_s``, ``jitter_s``, ``loss``, ``seed`` ...
        :param parameters: parameters of the loop to change, such as ``virtual_mass_kg`` or ``home_m``
        """
        own = scheme if isinstance(scheme, Scheme) else None
        named = "force_exchange" if isinstance(scheme, Scheme) else scheme
        session = {
            "id": "rig", "axes": axes, "scheme": named, "tool": tool, "material": material, "clay": clay, "network": network,
            "deadband": deadband,
        }  # fmt: skip
        self._native = _native.Rig(body(session), body(parameters or {}), own)

    def run(self, duration_s: float, every: int = 1) -> Record:
        """Runs the loop for a while of virtual time, without Python's lock.

        :param every: of so many ticks one sample is kept
        """
        tick_s = self.parameters["tick_s"]
        if not 0 <= duration_s <= 3600:
            raise ValueError(f"duration_s is {duration_s}, need a number from 0 to 3600")
        numbers = self._native.run(round(duration_s / tick_s), every).reshape(-1, 23)
        vectors = (
            "hand_force_n", "felt_force_n", "tool_force_n", "handle_position_m", "tool_position_m", "handle_velocity_m_s",
            "tool_velocity_m_s",
        )  # fmt: skip
        named = {name: np.ascontiguousarray(numbers[:, 3 * at + 1 : 3 * at + 4]) for at, name in enumerate(vectors)}
        return Record(time_s=numbers[:, 0].copy(), energy_j=numbers[:, 22].copy(), **named)

    def intend_rest(self) -> None:
        """The hand rests on the handle, without a force of its own."""
        self._native.intend("idle", [])

    def intend_force(self, force_n: ArrayLike, *, at_sensor: bool = False) -> None:
        """The muscles push, N, (3,); or the force at the sensor is this, whatever the arm does, as in the paper."""
        flat, _ = vectors("force_n", force_n)
        self._native.intend("sensor_force" if at_sensor else "force", flat.tolist())

    def intend_sinusoid(self, amplitude_n: ArrayLike, frequency_hz: float) -> None:
        """The muscles push to and fro, N, (3,)."""
        flat, _ = vectors("amplitude_n", amplitude_n)
        self._native.intend("sinusoid", [*flat.tolist(), frequency_hz])

    def intend_cutting(self, reach_m: Sequence[float] = (0.045, 0.018, 0.02)) -> None:
        """Strokes over the block, level by level: within so much along them and across, and down to a depth, m."""
        self._native.intend("cutting", list(reach_m))

    def intend_path(self, waypoints_m: ArrayLike, speed_m_s: ArrayLike = 0.05) -> None:
        """A path from home through waypoints, m, (N, 3), each leg at its speed, m/s, (N,)."""
        flat, shape = vectors("waypoints_m", waypoints_m)
        speeds = np.broadcast_to(np.asarray(speed_m_s, dtype=np.float64), shape)
        self._native.intend("path", np.column_stack([flat.reshape(-1, 3), speeds.reshape(-1)]).reshape(-1).tolist())

    def patch(self, **session: Any) -> None:
        """Changes settings as ``PATCH /api/v1/sessions/{id}`` does."""
        self._native.patch(body(session))

    @property
    def clay(self) -> clays.Clay:
        """A copy of the clay as the server has it."""
        return clays.Clay._of(self._native.clay())

    @property
    def hashes(self) -> tuple[str | None, str]:
        """Of the handle's copy of the clay, where the scheme keeps one, and of the server's."""
        return self._native.hashes()

    @property
    def parameters(self) -> dict[str, Any]:
        """How both sides run the loop."""
        return dict(json.loads(self._native.parameters()))

    @property
    def now_s(self) -> float:
        """Virtual time, s."""
        return self._native.now_s

    @property
    def least_energy_j(self) -> float:
        """The least that the channel's energy has been, J: zero for one that never gave more than it got."""
        return self._native.least_energy_j

    @property
    def frames_sent(self) -> tuple[int, int]:
        """Frames that left each side: up, down."""
        up, down = self._native.frames_sent
        return up, down


def cutting(**experiment: Any) -> dict[str, Any]:
    """The cutting experiment through the clay, Fig. 7: ``POST /api/v1/experiments/cutting``, bit for bit.

    Fields that are left out are the paper's. Of the answer, lists are arrays: ``plateau_velocity_m_s`` of theory and
    ``simulated_velocity_m_s``, m/s, one for each range; ``trace`` with ``t_s``, ``position_m``, ``velocity_m_s``,
    ``hand_force_n``, ``tool_force_n``. Ctrl-C calls it off.
    """
    from .control import PAPER

    names = (
        "virtual_mass_kg", "virtual_damping_n_s_per_m", "position_ratio", "force_ratio", "hand_force_n", "edges_m",
        "clay_damping_n_s_per_m",
    )  # fmt: skip
    request = {name: PAPER[name] for name in names} | experiment
    return dict(arrays(json.loads(_native.theory("cutting", body(request)))))


def measured_critical_stiffness(
    mass_kg: float,
    damping_n_s_per_m: float,
    rtt_s: float,
    tick_s: float = 1e-3,
    between_n_per_m: tuple[float, float] = (1.0, 1e6),
) -> float:
    """Stiffness at which the naive wall turns unstable in a run, N/m, to a thousandth.

    The round trip is to be a whole number of ticks: lines deliver at ticks. :func:`teleclay.control.critical_stiffness` says what must come out.
    """
    return _native.measured_critical_stiffness(mass_kg, damping_n_s_per_m, rtt_s, tick_s, between_n_per_m)


class Line(NamedTuple):
    """A line of the latency table."""

    delay_ms: int
    """Mean one-way delay, ms."""
    jitter_ratio: float = 0.0
    """Standard deviation of the one-way delay over its mean."""
    loss: float = 0.0
    """Share of frames lost, independently."""
    profile: str = "iid"
    """What else: ``iid`` for nothing, ``bursts``, ``outage``, or ``second_writer``, which is for the replica."""


def latency_lines(extent: Literal["quick", "full"] = "quick") -> list[Line]:
    """The lines of the latency table, as every scheme is run over them."""
    lines = [Line(*line) for line in _native.latency_cells(extent)]
    return [line for line in lines if line.profile != "second_writer"]


def latency_row(scheme: SchemeName | Callable[[], Scheme], line: Line, seeds: Iterable[int] = range(1, 4)) -> dict[str, Any]:
    """A row of the latency table: one task over one line, from seeds, against the same without a network.

    Fields are those of docs/latency.md. A scheme of your own is told as what makes it, its class for one: every run
    takes a new object.
    """
    own = scheme if callable(scheme) else None
    cell = (line.delay_ms, line.jitter_ratio, line.loss, line.profile)
    if own is not None and line.profile == "second_writer":
        raise ValueError("a scheme of one's own has no second writer")
    row = arrays(json.loads(_native.latency_cell("" if callable(scheme) else scheme, cell, list(seeds), own)))
    if callable(scheme):
        row["scheme"] = getattr(scheme, "__name__", "own")
    return dict(row)


def _heard(numbers: Floats | None) -> Heard | None:
    return None if numbers is None else Heard(*numbers.reshape(6, 3))


def _given(said: Said) -> list[float]:
    given = np.concatenate([np.asarray(vector, dtype=np.float64) for vector in said])
    if given.shape != (12,):
        raise ValueError(f"a scheme's end gave {given.size} numbers, need four vectors of three")
    return [float(number) for number in given]
