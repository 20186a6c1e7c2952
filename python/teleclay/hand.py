"""A hand at a running server, moved by a function of yours.

The loop itself runs in Rust, a thousand times a second, on a thread that never asks for Python's lock. It is the one of
the page's pointer: what you intend is where a mouse would be, so the coupling bounds your force, the guard bounds the
coupling, and the watchdogs hold for you as for every other hand.

Your *law* is called on a thread of its own, at its own rate: it gets what happened since the last call and gives back
what the hand intends from now on. A law that raises, gives what is no intent, or says nothing for longer than its
patience has the hand let go of: at once, by Rust, whatever Python is doing. :func:`operate` then raises.

::

    def law(batch):
        if batch.time_s[-1] > 5:
            raise StopIteration
        return Place([0.02 * np.sin(batch.time_s[-1]), 0, -0.004])

    report = operate("http://127.0.0.1:8080", "demo", law)
"""

import threading
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass


import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native
from ._native import NotGranted
from ._shapes import Floats, vectors

__all__ = ["Batch", "Force", "HandLost", "Law", "LawFailed", "NotGranted", "Place", "Report", "operate"]

GRASPS = ("released", "waiting", "held", "letting_go", "clutched", "stopped")
"""Who holds the handle: :attr:`Batch.grasp` counts these."""

LINKS = ("live", "not_yet", "silent", "on_copy", "on_stale_copy", "gone", "paused", "fault")
"""Whether the far side is felt, and if not, why: :attr:`Batch.link` counts these."""

# What a row of Rust holds: `row` in src/hand/thread.rs.
_VECTORS = ("position_m", "velocity_m_s", "tool_position_m", "felt_force_n", "hand_force_n", "hand_position_m")

# The law's thread looks this often whether it is still wanted, s.
_LOOK_S = 0.02


@dataclass(frozen=True)
class Batch:
    """What happened since the last call, a row for each time that the loop woke: every millisecond, on an idle machine."""

    time_s: Floats
    """Since the hand began, s, (N,)."""
    ticks: NDArray[np.int64]
    """Ticks that were made then, (N,): more than one where the thread was held up."""
    position_m: Floats
    """Handle: displacement from its home, m, (N, 3)."""
    velocity_m_s: Floats
    """Its velocity, m/s, (N, 3)."""
    tool_position_m: Floats
    """Tool in the clay's frame, m, (N, 3): in the copy, or as last heard."""
    felt_force_n: Floats
    """Force of the far side on the handle, N, (N, 3), after every limit."""
    hand_force_n: Floats
    """Force of the hand on the handle, N, (N, 3): what the coupling made of the intent."""
    hand_position_m: Floats
    """Where the hand draws the handle to, m, (N, 3)."""
    rtt_s: Floats
    """Round trip as last seen, s, (N,); NaN before the first."""
    silence_s: Floats
    """Time without a frame, s, (N,)."""
    grasp: NDArray[np.int64]
    """Who holds the handle, (N,), as places in :data:`GRASPS`."""
    link: NDArray[np.int64]
    """Whether the far side is felt, (N,), as places in :data:`LINKS`."""
    dropped: int
    """Rows that were lost so far, since the law took too long to fetch them."""


@dataclass(frozen=True)
class Place:
    """The hand wants the handle to be somewhere, and draws it there by a spring.

    However far that is, the hand goes there at 0.5 m/s at most.
    """

    position_m: ArrayLike
    """Displacement of the handle from its home, m, (3,). With two axes the third is a lift, which follows as it is."""
    stiffness_n_per_m: float = np.inf
    """Spring, N/m. The coupling's own, 150 N/m as a rule, is the stiffest; more counts as that."""


@dataclass(frozen=True)
class Force:
    """The hand pushes. A force builds up at 75 N/s at most, and the coupling caps it at 20 N."""

    force_n: ArrayLike
    """Force on the handle, N, (3,). With two axes the third does not count."""


Law = Callable[[Batch], Place | Force | None]
"""What the hand intends after what happened; ``None`` lets go. ``StopIteration`` ends it well."""


@dataclass(frozen=True)
class Report:
    """How it went."""

    tool: int
    """The tool that was held, from 1."""
    reason: str
    """Why it ended."""
    calls: int
    """How often the law was called."""
    counts: dict[str, int]
    """Of the loop: ``ticks``, ``given_up``, ``gaps``, ``guarded``, ``sent``, ``stale``, ``unheard``, ``undecodable``,
    ``foreign``, ``overflowed``, ``unsent``, and ``most_ticks`` that one wake had to make."""


class LawFailed(RuntimeError):
    """The law raised, gave what is no intent, or was late. The hand was let go of."""


class HandLost(ConnectionError):
    """The server or the line to it ended the hand."""


class _LawThread(threading.Thread):
    """Calls the law again and again. Nobody waits for it: a law may never come back."""

    def __init__(self, hand: _native.Hand, law: Law, period_s: float) -> None:
        super().__init__(name="law", daemon=True)
        self._hand, self._law, self._period_s = hand, law, period_s
        self._stops = threading.Event()
        self.is_over = threading.Event()
        self.calls = 0
        self.error: BaseException | None = None

    def run(self) -> None:
        try:
            while not self._stops.is_set():
                taken = self._hand.take(_LOOK_S)
                if taken is not None:
                    self._call(_batch(*taken))
                elif not self._hand.is_running:
                    return
                self._stops.wait(self._period_s)
        except StopIteration:
            pass
        except BaseException as error:
            self.error = error
        finally:
            self.is_over.set()

    def stop(self) -> None:
        self._stops.set()

    def _call(self, batch: Batch) -> None:
        self.calls += 1
        intent = self._law(batch)
        if intent is None:
            self._hand.let_go()
        elif isinstance(intent, Place):
            self._hand.go_to(_three("position_m", intent.position_m), float(intent.stiffness_n_per_m))
        elif isinstance(intent, Force):
            self._hand.push(_three("force_n", intent.force_n))
        else:
            raise TypeError(f"a law gives a Place, a Force or None, not {intent!r}")


def operate(
    url: str,
    session: str,
    law: Law,
    *,
    duration_s: float | None = None,
    operator: str = "Python",
    token: str | None = None,
    authority: str | None = None,
    patience_s: float = 0.1,
    period_s: float = 0.0,
) -> Report:
    """Takes a tool of a session and lets a law move it. Returns when the law raises ``StopIteration``, after
    ``duration_s``, or raises.

    :param url: ``http://127.0.0.1:8080``; another machine needs ``https``, as the keys of a hand go over its socket
    :param law: called with a :class:`Batch` again and again, on a thread of its own
    :param duration_s: how long, s; without it until the law ends it
    :param operator: who holds the tool, for people to read
    :param token: the server's, or that of an operator's invite
    :param authority: a PEM file of whoever vouches for an https server: ``doors/authority.pem`` of its data folder
    :param patience_s: a law that says nothing for longer is late, 0.01 to 1 s
    :param period_s: pause between two calls, s, below the patience; without one the law is called as soon as there is news
    :raises LawFailed: the law raised, gave what is no intent, or was late; the hand was let go of
    :raises HandLost: the server or the line ended it
    :raises NotGranted: the server grants no tool
    """
    if not 0.0 <= period_s < patience_s:
        raise ValueError(f"period_s is {period_s}, need a number from 0 to below the patience of {patience_s}")
    hand = _native.Hand(url, session, operator, token, authority, patience_s)
    thread = _LawThread(hand, law, period_s)
    thread.start()
    try:
        # In short waits, so that Ctrl-C and a late law are seen.
        ends_s = time.monotonic() + (np.inf if duration_s is None else duration_s)
        while hand.is_running and not hand.was_late:
            left_s = ends_s - time.monotonic()
            if left_s <= 0 or thread.is_over.wait(min(_LOOK_S, left_s)):
                break
    finally:
        thread.stop()
        word, reason, counts = hand.finish()
    report = Report(hand.tool, reason, thread.calls, dict(counts))
    thread.join(timeout=0.0 if hand.was_late else patience_s)
    if thread.error is not None:
        raise LawFailed(f"the law failed, and the hand was let go of: {thread.error!r}") from thread.error
    if word == "law_late":
        raise LawFailed(reason)
    if word != "asked":
        raise HandLost(reason)
    if 0 < report.counts["gaps"]:
        warnings.warn("the loop was held up for half a second or more; the handle was let go of meanwhile", stacklevel=2)
    return report


def _batch(flat: Floats, dropped: int) -> Batch:
    rows = flat.reshape(-1, 24)
    named = {name: np.ascontiguousarray(rows[:, 2 + 3 * at : 5 + 3 * at]) for at, name in enumerate(_VECTORS)}
    return Batch(
        time_s=rows[:, 0].copy(),
        ticks=rows[:, 1].astype(np.int64),
        rtt_s=rows[:, 20].copy(),
        silence_s=rows[:, 21].copy(),
        grasp=rows[:, 22].astype(np.int64),
        link=rows[:, 23].astype(np.int64),
        dropped=dropped,
        **named,
    )


def _three(name: str, given: ArrayLike) -> tuple[float, float, float]:
    flat, shape = vectors(name, given)
    if shape:
        raise ValueError(f"{name} has shape {(*shape, 3)}, need three numbers")
    x, y, z = flat.tolist()
    return (x, y, z)
