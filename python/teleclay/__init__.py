"""teleclay from Python: the mathematics, the clay and the loop on virtual time, and a hand at a running server.

======================  ================================================================================
:mod:`~.kinematics`     the three-armed parallel robot, for many points at once
:mod:`~.control`        plants, loops, their margins, and what grows past them
:mod:`~.clay`           a block of clay that is cut, and the force it answers with
:mod:`~.sim`            the loop on virtual time, the cutting experiment, the latency table's cells
:class:`Client`         a server's REST interface and its telemetry
:func:`operate`         a hand that a function of yours moves, a thousand times a second
======================  ================================================================================

Arrays go in and come out. Names are those of the server's interface, and end in their unit; all units are SI. What is
no input is a :class:`ValueError` in the words of whoever found it.
"""

from . import clay, control, kinematics, sim
from .client import Client, Problem, Telemetry
from .hand import Batch, Force, HandLost, LawFailed, NotGranted, Place, Report, operate

__all__ = [
    "Batch",
    "Client",
    "Force",
    "HandLost",
    "LawFailed",
    "NotGranted",
    "Place",
    "Problem",
    "Report",
    "Telemetry",
    "clay",
    "control",
    "kinematics",
    "operate",
    "sim",
]
