"""A server's interface: what it does over HTTP, and the telemetry of its streams."""

import http.client
import json
import ssl
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any
from urllib.parse import quote, urlencode, urlsplit

import numpy as np
from numpy.typing import NDArray

from . import _native
from ._shapes import body as json_body

_PATIENCE_S = 60
"""The server's own calculations take no longer than this, s."""

Samples = NDArray[np.float32]


class Problem(Exception):
    """The server's answer where it does not do what it was asked, as its problem details say it."""

    def __init__(self, status: int, problem: dict[str, Any]) -> None:
        self.status: int = status
        """Of HTTP."""
        self.type: str = problem.get("type", "about:blank")
        """What kind of problem it is, such as ``/problems/field``. Stable."""
        self.title: str = problem.get("title", "")
        """The same for people."""
        self.detail: str = problem.get("detail", "")
        """What happened this time."""
        self.pointer: str | None = problem.get("pointer")
        """JSON pointer of the field at fault, where it is a field's fault."""
        place = f" at {self.pointer}" if self.pointer else ""
        super().__init__(f"{status} {self.title}{place}: {self.detail}")


@dataclass(frozen=True)
class Telemetry:
    """A batch of samples of one tool, evenly spaced."""

    tool: int
    """Its id within the session."""
    dropped: int
    """Samples of this tool that this reader has lost since the batch before."""
    time_s: NDArray[np.float64]
    """When, since the session began, s, (N,)."""
    hand_force_n: Samples
    """Force of the hand on the handle, N, (N, 3)."""
    felt_force_n: Samples
    """Force of the handle on the hand, N, (N, 3)."""
    tool_force_n: Samples
    """Force of the clay on the tool, N, (N, 3)."""
    handle_position_m: Samples
    """Handle, in its own frame, m, (N, 3)."""
    tool_position_m: Samples
    """Tool, in the clay's frame, m, (N, 3)."""
    handle_velocity_m_s: Samples
    """Handle, m/s, (N, 3)."""
    tool_velocity_m_s: Samples
    """Tool, m/s, (N, 3)."""
    energy_handle_j: Samples
    """Into the link at the handle, less what left it there, J, (N,)."""
    energy_tool_j: Samples
    """Likewise at the tool, J, (N,)."""
    rtt_s: Samples
    """Round trip, s, (N,)."""
    correction_step_n: Samples
    """How far corrections moved the felt force since the sample before, N, (N,)."""
    correction_held_n: Samples
    """Magnitude of the felt force less what the corrected copy gives, N, (N,)."""
    age_s: Samples
    """Since the newest frame from the handle came, s, (N,)."""


def decode_telemetry(message: bytes) -> Telemetry:
    """A binary message of telemetry of a stream. One that is none is a :class:`ValueError`."""
    (_, tool, period_us, dropped, first_time_s), flat = _native.decode_telemetry(message)
    numbers = flat.reshape(-1, 27)
    vectors = [np.ascontiguousarray(numbers[:, start : start + 3]) for start in range(0, 21, 3)]
    rest = [np.ascontiguousarray(numbers[:, column]) for column in range(21, 27)]
    time_s = first_time_s + period_us * 1e-6 * np.arange(len(numbers), dtype=np.float64)
    return Telemetry(tool, dropped, time_s, *vectors, *rest)


class Client:
    """A server. Every call is one request; answers are those of the interface, at ``/api/v1/openapi.json``."""

    def __init__(self, url: str, token: str | None = None, *, authority: str | None = None) -> None:
        """
        :param url: ``http://127.0.0.1:8080``, or ``https://...`` beyond this machine
        :param token: the server's, or that of an invite
        :param authority: a PEM file of whoever vouches for the server: ``doors/authority.pem`` of its data folder.
            Without it, the system's authorities do.
        """
        parts = urlsplit(url)
        if parts.scheme not in ("http", "https") or parts.hostname is None:
            raise ValueError(f"{url!r} is no address of a server, such as http://127.0.0.1:8080")
        self.url = f"{parts.scheme}://{parts.netloc}"
        self._netloc = parts.netloc
        self._token = token
        self._tls = ssl.create_default_context(cafile=authority) if parts.scheme == "https" else None

    def call(self, method: str, path: str, body: Any = None, **query: Any) -> Any:
        """Any call of the interface: ``client.call("GET", "/sessions")``. JSON comes decoded, all else as bytes.

        :param path: below ``/api/v1``
        :param body: bytes, or what becomes JSON; arrays become lists
        """
        content = body if isinstance(body, bytes | None) else json_body(body).encode()
        media = {} if body is None else {"Content-Type": "application/octet-stream" if isinstance(body, bytes) else "application/json"}
        return self._send(method, f"/api/v1{path}", content, media, query)

    def sessions(self) -> list[dict[str, Any]]:
        """Every session, as it is."""
        return list(self.call("GET", "/sessions"))

    def session(self, session: str) -> dict[str, Any]:
        """A session, as it is."""
        return dict(self.call("GET", _of(session)))

    def create(self, session: str, **fields: Any) -> dict[str, Any]:
        """A new session; ``fields`` are those of ``POST /sessions``, such as ``scheme`` and ``clay``."""
        return dict(self.call("POST", "/sessions", {"id": session} | fields))

    def delete(self, session: str) -> None:
        """Ends a session and forgets it."""
        self.call("DELETE", _of(session))

    def patch(self, session: str, **changes: Any) -> dict[str, Any]:
        """Changes settings in one tick, or none of them: ``scheme``, ``material``, ``network``, ``deadband``,
        ``operation``, ``paused``."""
        return dict(self.call("PATCH", _of(session), changes))

    def reset_clay(self, session: str, **block: Any) -> dict[str, Any]:
        """A fresh block; ``shape`` and ``material`` stay as they were when left out."""
        return dict(self.call("POST", f"{_of(session)}/clay/reset", block))

    def undo(self, session: str, **which: Any) -> dict[str, Any]:
        """Undoes the last stroke, of a ``tool`` or of all."""
        return dict(self.call("POST", f"{_of(session)}/undo", which))

    def redo(self, session: str, **which: Any) -> dict[str, Any]:
        """Takes an undo back."""
        return dict(self.call("POST", f"{_of(session)}/redo", which))

    def duplicate(self, session: str, as_session: str) -> dict[str, Any]:
        """Another session with the same clay and settings, and a history of its own."""
        return dict(self.call("POST", f"{_of(session)}/duplicate", {"id": as_session}))

    def history(self, session: str) -> dict[str, Any]:
        """The strokes of a session, and from when to when, s."""
        return dict(self.call("GET", f"{_of(session)}/history"))

    def stop(self, session: str, reason: str = "stopped from Python", operator: str = "Python") -> None:
        """Stops a session: every tool holds, forces ramp to zero, and nothing starts again until it is cleared."""
        self.call("POST", f"{_of(session)}/stop", {"operator": operator, "reason": reason})

    def clear_stop(self, session: str, operator: str = "Python") -> None:
        """Takes a stop back; every operator joins anew."""
        self.call("POST", f"{_of(session)}/stop/clear", {"operator": operator})

    def clay(self, session: str, ending: str = "stl", at_s: float | None = None) -> bytes:
        """The clay as a file, ``stl``, ``3mf`` or ``glb``, now or as it was at a moment of the session, s."""
        query = {} if at_s is None else {"at_s": at_s}
        return bytes(self.call("GET", f"{_of(session)}/clay.{ending}", **query))

    def put_clay(self, session: str, mesh: bytes, media_type: str = "model/stl", *, fit: bool = False) -> dict[str, Any]:
        """A closed mesh as the clay of a session, ``model/stl`` or ``model/3mf``; ``fit`` scales it into the block."""
        query = {"fit": "true"} if fit else {}
        return dict(self._send("PUT", f"/api/v1{_of(session)}/clay", mesh, {"Content-Type": media_type}, query))

    def theory(self, path: str, **fields: Any) -> dict[str, Any]:
        """A call of the theory, such as ``kinematics/inverse`` or ``analysis/loop``."""
        return dict(self.call("POST", f"/{path}", fields))

    def telemetry(self, session: str, duration_s: float | None = None) -> Iterator[Telemetry]:
        """The telemetry of every tool of a session, batch by batch, for as long as told, or as somebody asks for more.

        While nobody holds a tool there may be none, and the next batch is waited for.
        """
        from websockets.exceptions import ConnectionClosed, InvalidStatus
        from websockets.sync.client import connect
        from websockets.typing import Subprotocol

        url = f"{self.url.replace('http', 'ws', 1)}/api/v1{_of(session)}/stream"
        try:
            stream = connect(url, ssl=self._tls, subprotocols=[Subprotocol("teleclay.v1")], additional_headers=self._headers())
        except InvalidStatus as refusal:
            raise _problem(refusal.response.status_code, bytes(refusal.response.body or b"")) from None
        with stream:
            stream.send(json.dumps({"type": "subscribe", "telemetry": "on", "bricks": "off"}))
            ends_s = np.inf if duration_s is None else time.monotonic() + duration_s
            try:
                while 0 < (left_s := ends_s - time.monotonic()):
                    message = stream.recv(None if left_s == np.inf else left_s)
                    if isinstance(message, bytes) and message[3:4] == b"\x01":
                        yield decode_telemetry(message)
            except TimeoutError:
                return
            except ConnectionClosed as closed:
                reason = closed.rcvd.reason if closed.rcvd else "the line broke"
                raise ConnectionError(f"the stream of {session} ended: {reason}") from None

    def _headers(self) -> dict[str, str]:
        return {} if self._token is None else {"Authorization": f"Bearer {self._token}"}

    def _send(self, method: str, path: str, content: bytes | None, headers: dict[str, str], query: dict[str, Any]) -> Any:
        if query:
            path = f"{path}?{urlencode(query)}"
        connection: http.client.HTTPConnection
        if self._tls is None:
            connection = http.client.HTTPConnection(self._netloc, timeout=_PATIENCE_S)
        else:
            connection = http.client.HTTPSConnection(self._netloc, timeout=_PATIENCE_S, context=self._tls)
        try:
            connection.request(method, path, content, headers | self._headers())
            with connection.getresponse() as response:
                answer = response.read()
                media = (response.getheader("Content-Type") or "").partition(";")[0]
        finally:
            connection.close()
        if 300 <= response.status:
            raise _problem(response.status, answer)
        return json.loads(answer) if media.endswith("json") else answer


def _of(session: str) -> str:
    return f"/sessions/{quote(session, safe='')}"


def _problem(status: int, answer: bytes) -> Problem:
    try:
        problem = json.loads(answer)
    except ValueError:
        problem = None
    if not isinstance(problem, dict):
        problem = {"title": "an answer that is no problem details", "detail": answer[:200].decode(errors="replace")}
    return Problem(status, problem)
