"""Holds a server to its own OpenAPI document, read by the jsonschema library.

    python interface.py SERVER

SERVER is the program teleclay-server. Every call is made, with every status that can be brought about from outside, and

    answers   each has a status and a media type that are described, and a body that keeps to its schema; no detail
              speaks of types of the program
    bounds    each number of each request is set to each bound that its schema tells, and to its neighbours: what the
              schema allows is accepted, what it forbids is refused
    shapes    likewise with other kinds of value, words in disguise, fields left out and lists of another length at
              every place of every body
    messages  likewise with the text messages of a stream, both ways

Exits with 0 when everything agrees.
"""

import argparse
import contextlib
import copy
import json
import sys
from concurrent.futures import ThreadPoolExecutor

from described import Interface, Stream, running, small, with_damage

TOKEN = "a token of good length"


def main():
    parser = argparse.ArgumentParser(description="Holds a server to its own OpenAPI document.")
    parser.add_argument("server")
    arguments = parser.parse_args()
    with running(arguments.server) as address:
        interface = Interface(address)
        bodies = bodies_of(interface)
        check_bodies(interface, bodies)
        check_statuses(interface)
        with running(arguments.server, TELECLAY_TOKEN=TOKEN) as guarded:
            check_token(interface, guarded)
        with with_damage(arguments.server, "hurt") as damaged:
            check_damaged(interface, damaged, bodies)
        check_bounds(interface, bodies)
        check_shapes(interface, bodies)
        check_messages(interface)
        check_coverage(interface)
    for fault in interface.faults[:40]:
        print(fault)
    print(f"{interface.asked} answers held against the description, {interface.judged} requests judged by schema and server alike")
    if interface.faults:
        sys.exit(f"{len(interface.faults)} faults")


# What is asked


def bodies_of(interface):
    """Full bodies of every call that takes one."""
    material = {"preset": "wax", "viscosity_pa_s_per_m": 1e5, "yield_stress_pa": 10, "stiffness_pa": 1000}
    layers = [{"thickness_m": 0.002, "material": material}]
    line = {
        "delay_s": 0.02, "jitter_s": 0.003, "loss": 0.01, "seed": 7, "jitter_distribution": "heavy_tailed", "duplicate": 0.001,
        "reorder": 0.002, "burst": {"enter": 0.01, "leave": 0.3, "loss_in_burst": 0.9}, "outage": {"every_s": 10, "length_s": 0.2},
    }  # fmt: skip
    network = {"up": line, "down": line}
    block = {"kind": "block", "size_m": [0.03, 0.02, 0.01]}
    stepped = {"kind": "stepped", "edges_m": [0.01, 0.02, 0.03], "depths_of_cut_m": [0.01, 0.02], "base_m": 0.01, "width_m": 0.02}
    blade = {"kind": "blade", "width_m": 0.01, "height_m": 0.04, "thickness_m": 0.002}
    cylinder = {"kind": "cylinder", "radius_m": 0.004, "height_m": 0.03}
    wire = {"kind": "loop", "ring_radius_m": 0.006, "wire_diameter_m": 0.0025}

    def session(shape, tool):
        return {
            "id": "made", "axes": 2, "scheme": "force_exchange", "material": material, "network": network, "tool": tool, "tools": 3,
            "clay": {"shape": shape, "voxel_size_m": 1e-3, "layers": layers}, "operation": "smooth", "deadband": 0.07,
        }  # fmt: skip

    geometry = {"base_radius_m": 0.12, "platform_radius_m": 0.04, "upper_link_m": 0.1, "lower_link_m": 0.2, "arm_angles_deg": [0, 120, 240]}
    place = [0.01, -0.02, 0.15]
    servo = {"numerator": [18, 1], "denominator": [0.005, 0.4, 18, 1]}
    give = {"numerator": [1e-4], "denominator": [0.01, 1]}
    actuator = {"numerator": [1], "denominator": [0.5, 20, 0]}
    plants = {"g_h": servo, "s_h": give, "t_h": [0.25, 2, 6], "g_t": actuator, "s_t": give, "position_ratio": 1, "force_ratio": -1}
    one = interface.session()
    return [
        (
            "POST", "/api/v1/sessions",
            [session(block, {"kind": "ball", "radius_m": 0.004}), session(stepped, blade), session(block, cylinder), session(block, wire)],
        ),
        (
            "PATCH", f"/api/v1/sessions/{one}",
            [{"scheme": "force_exchange", "material": material, "network": network, "deadband": 0.1, "operation": "add", "paused": False}],
        ),
        ("POST", f"/api/v1/sessions/{one}/clay/reset", [{"shape": block, "material": material, "layers": layers}, {"shape": stepped, "material": material, "layers": layers}]),
        ("POST", f"/api/v1/sessions/{one}/undo", [{"tool": 1}, {"since": 1}]),
        ("POST", f"/api/v1/sessions/{one}/redo", [{"tool": 1}]),
        ("POST", f"/api/v1/sessions/{one}/stop/clear", [{"operator": "Ada"}]),
        ("POST", f"/api/v1/sessions/{one}/tools/1/request", [{"operator": "Ada"}]),
        ("POST", f"/api/v1/sessions/{one}/tools/1/withdraw", [{"operator": "Ada"}]),
        ("POST", f"/api/v1/sessions/{one}/tools/1/grant", [{"operator": "Ada"}]),
        ("POST", f"/api/v1/sessions/{one}/tools/1/deny", [{"operator": "Ada", "reason": "in a moment"}]),
        ("POST", f"/api/v1/sessions/{one}/recordings", [{"name": "first", "rate_hz": 250, "topics": ["tool_pose", "felt_wrench"]}]),
        ("POST", f"/api/v1/sessions/{one}/duplicate", [{"id": "twin"}]),
        ("POST", "/api/v1/kinematics/inverse", [{"geometry": geometry, "position_m": place}]),
        ("POST", "/api/v1/kinematics/forward", [{"geometry": geometry, "joints_rad": [0.1, -0.2, 0.3]}]),
        ("POST", "/api/v1/kinematics/jacobian", [{"geometry": geometry, "position_m": place, "branch": [1, -1, 1]}]),
        (
            "POST", "/api/v1/kinematics/workspace",
            [{"geometry": geometry, "branch": [-1, -1, -1], "region_m": [[-0.1, -0.1, 0.1], [0.1, 0.1, 0.2]], "cells": [4, 3, 2]}],
        ),
        (
            "POST", "/api/v1/analysis/loop",
            [{
                **plants, "c_h1": {"numerator": [1], "denominator": [1, 10, 0]}, "clay_damping_n_s_per_m": 20, "clay_stiffness_n_per_m": 5,
                "omegas_rad_s": [0.5, 5],
            }],
        ),
        (
            "POST", "/api/v1/analysis/tuning",
            [{
                **plants, "s_h": {"numerator": [0], "denominator": [1]}, "s_t": {"numerator": [0], "denominator": [1]},
                "clay_damping_n_s_per_m": [0, 60], "clay_stiffness_n_per_m": [0, 10], "scheme": "position_force", "round_trip_s": 0.05,
                "distance": 0.4, "heaviest_n_s_per_m": 500,
            }],
        ),
        (
            "POST", "/api/v1/experiments/cutting",
            [{
                "virtual_mass_kg": 1, "virtual_damping_n_s_per_m": 20, "position_ratio": 1, "force_ratio": -1, "hand_force_n": 2,
                "edges_m": [0.03, 0.04, 0.05, 0.06], "clay_damping_n_s_per_m": [20, 40, 60], "hand_force_at": "sensor", "voxel_size_m": 1e-3,
                "trace_samples": 64,
            }],
        ),
    ]  # fmt: skip


def check_bodies(interface, bodies):
    """The bodies are good, and leave nothing out that there is."""
    for method, path, fulls in bodies:
        place = interface.request_schema(method, path)
        lacking = None
        for full in fulls:
            if interface.fault(place, full):
                sys.exit(f"{method} {path}: the body breaks its schema: {interface.fault(place, full)}")
            answer = interface.ask(method, path, full)
            # Nobody has cut anything.
            if 300 <= answer.status and answer.status != 409:
                sys.exit(f"{method} {path}: the good body is answered with {answer.status} {answer.text}")
            interface.undo(answer)
            left_out = {at for at, _ in fields_of(interface, place) if at not in places_in(full)}
            lacking = left_out if lacking is None else lacking & left_out
        if lacking:
            sys.exit(f"{method} {path}: no body has {sorted(lacking)}")
    covered = {(method.lower(), interface.template(path)) for method, path, _ in bodies}
    wanted = {(method, path) for path, method, operation in interface.operations() if interface.takes_json(operation)}
    if covered != wanted:
        sys.exit(f"no body for {sorted(wanted - covered)}")


def check_statuses(interface):
    """Every status that can be brought about from outside, but for those of a token."""
    one = interface.session()
    path = f"/api/v1/sessions/{one}"
    upgrade = {
        "Connection": "Upgrade", "Upgrade": "websocket", "Sec-WebSocket-Version": "13", "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
    }  # fmt: skip
    calls = [(method, path.replace("{id}", one).replace("{tool}", "1").replace("{recording}", "none.mcap"), operation) for path, method, operation in interface.operations()]
    # What goes wrong in the same way everywhere.
    for method, where, operation in calls:
        body = {"content": b"{"} if interface.takes_json(operation) else {}
        headers = {"Content-Type": "application/json"} if body else {}
        for status, more in [
            (421, {"Host": "evil.example"}),
            (403, {"Origin": "https://evil.example"} | headers),
            (400, {"Host": ""}),
        ]:
            answer = interface.send(method, where, headers=headers | more, **body)
            # Reading is nobody's harm: it is the browser that keeps the answer from the page. A stream is not asked for
            # without an upgrade.
            may_read = status == 403 and method == "get"
            none = {404} if where.endswith("/none.mcap") else set()
            interface.expect(answer, {200, 403, 426} | none if may_read else {status})
        answer = interface.send("TRACE", where)
        interface.expect(answer, {405})
        if where not in json.loads(answer.text)["detail"]:
            interface.faults.append(f"TRACE {where}: {answer.text} does not name the path asked")
        if body:
            interface.expect(interface.send(method, where, content=b"{", headers=headers), {400})
            interface.expect(interface.send(method, where, content=b"{}", headers={"Content-Type": "text/plain"}), {415})
            interface.expect(interface.send(method, where, content=b" " * 70_000, headers=headers), {413})
            interface.expect(interface.ask(method, where, {"surplus": 1}), {422})
            interface.expect(interface.ask(method, where, []), {422})
        if "{id}" in interface.template(where):
            for name, status in [("none", 404), ("UPPER", 404), ("%ff", 400)]:
                there = where.replace(one, name)
                answer = interface.send(method, there, content=b"{}" if body else None, headers=headers)
                interface.expect(answer, {status})
                if status == 404 and there not in json.loads(answer.text)["detail"]:
                    interface.faults.append(f"{method} {there}: {answer.text} does not name the path asked")
    # What goes well, or wrong in a way of its own.
    for where in ["/healthz", "/readyz", "/metrics", "/api/v1/openapi.json", "/api/v1/sessions", path, f"{path}/clay.stl"]:
        interface.expect(interface.send("GET", where), {200})
    for where in [f"{path}/history", f"{path}/clay.3mf", f"{path}/clay.glb"]:
        interface.expect(interface.send("GET", where), {200})
    for ending in ["stl", "3mf", "glb"]:
        interface.expect(interface.send("GET", f"{path}/clay.{ending}?at_s=-1"), {422})
    check_import(interface, path)
    check_manners(interface, one)
    check_recordings(interface, one)
    stream = f"{path}/stream"
    interface.expect(interface.send("GET", stream), {426})
    interface.expect(interface.send("GET", stream, headers=upgrade), {400})
    speaks = {"Sec-WebSocket-Protocol": "teleclay.v1"}
    interface.expect(interface.send("GET", stream, headers=upgrade | speaks | {"Sec-WebSocket-Version": "8"}), {400})
    interface.expect(interface.ask("POST", "/api/v1/sessions", {"id": one}), {409})
    interface.expect(interface.send("GET", stream, headers=upgrade | speaks | {"Origin": "https://evil.example"}), {403})
    # Each waits for seconds, so all do at once.
    slow = {"Content-Type": "application/json", "Content-Length": "100"}
    with ThreadPoolExecutor() as threads:
        waiting = [
            threads.submit(interface.send, method, where, content=b"{", headers=slow)
            for method, where, operation in calls
            if interface.takes_json(operation)
        ]
        for answer in waiting:
            interface.expect(answer.result(), {408})
    far = {"position_m": [0, 0, 1e6]}
    interface.expect(interface.ask("POST", "/api/v1/kinematics/inverse", far), {422})
    with contextlib.ExitStack() as streams:
        for _ in range(64):
            streams.enter_context(Stream(interface.address, one))
        interface.expect(interface.send("GET", stream, headers=upgrade | speaks), {503})
    made = []
    while True:
        answer = interface.ask("POST", "/api/v1/sessions", small(f"many-{len(made)}"))
        if answer.status != 201:
            break
        made.append(answer)
    interface.expect(answer, {409})
    for answer in made:
        interface.undo(answer)
    interface.expect(interface.send("DELETE", path), {204})
    interface.expect(interface.send("DELETE", path), {404})


def check_manners(interface, one):
    """Who holds which tool, and the stop."""
    path = f"/api/v1/sessions/{one}"
    device = {"name": "a", "axes": 2, "force_n": 1, "rate_hz": 60, "measures_force": False}

    def join(stream, operator):
        stream.say({"type": "join", "operator": operator, "device": device})
        stream.say({"type": "ping", "nonce": 4711})
        if "granted" not in [text["type"] for text in stream.until_pong(4711)]:
            sys.exit(f"{operator} got no tool")

    def control(call, status, body=None):
        tool = f"{path}/tools/1/{call}"
        interface.expect(interface.ask("POST", tool, body) if body else interface.send("POST", tool), {status})
        elsewhere = f"{path}/tools/9/{call}"
        interface.expect(interface.ask("POST", elsewhere, body) if body else interface.send("POST", elsewhere), {404})

    interface.expect(interface.ask("POST", f"{path}/stop/clear", {"operator": "Ada"}), {200, 409})
    with Stream(interface.address, one) as ada, Stream(interface.address, one) as bob:
        join(ada, "Ada")
        asker = {"operator": "Bob"}
        for call, status in [("request", 200), ("request", 409), ("withdraw", 200), ("withdraw", 409), ("request", 200)]:
            control(call, status, asker)
        for call, status in [("deny", 200), ("deny", 409), ("grant", 409), ("request", 200), ("grant", 200)]:
            control(call, status, asker)
        join(bob, "Bob")
        control("release", 200)
        control("release", 409)
    for body in [b"", b"{", b'{"operator": "Ada", "reason": "enough"}']:
        interface.expect(interface.send("POST", f"{path}/stop", content=body), {200})
    interface.expect(interface.ask("POST", f"{path}/stop/clear", {"operator": "Ada"}), {200})
    interface.expect(interface.ask("POST", f"{path}/stop/clear", {"operator": "Ada"}), {409})


def check_recordings(interface, one):
    """A recording from its beginning to its end."""
    path = f"/api/v1/sessions/{one}/recordings"
    for method, where in [("POST", f"{path}/none/stop"), ("GET", f"{path}/none.mcap"), ("DELETE", f"{path}/none")]:
        interface.expect(interface.send(method, where), {404})
    interface.expect(interface.ask("POST", path, {"name": "first"}), {201})
    interface.expect(interface.ask("POST", path, {"name": "second"}), {409})
    interface.expect(interface.send("GET", path), {200})
    interface.expect(interface.send("POST", f"{path}/first/stop"), {200})
    answer = interface.send("GET", f"{path}/first.mcap")
    interface.expect(answer, {200})
    if not answer.body.startswith(b"\x89MCAP0\r\n") or not answer.body.endswith(b"\x89MCAP0\r\n"):
        interface.faults.append("a recording that has ended is no whole MCAP file")
    check_ranges(interface, f"{path}/first.mcap", answer.body)
    interface.expect(interface.ask("POST", path, {"name": "first"}), {409})
    interface.expect(interface.send("DELETE", f"{path}/first"), {204})


def check_ranges(interface, path, whole):
    """Bytes of a file: those that are asked for, or all of them where another kind of range is."""
    for text, status, wanted in [
        ("bytes=0-7", 206, whole[:8]),
        ("bytes=-8", 206, whole[-8:]),
        (f"bytes={len(whole) - 3}-{len(whole) + 90}", 206, whole[-3:]),
        (f"bytes={len(whole)}-", 416, None),
        ("bytes=0-1,4-5", 200, whole),
        ("lines=0-1", 200, whole),
    ]:
        answer = interface.send("GET", path, headers={"Range": text})
        interface.expect(answer, {status})
        if wanted is not None and answer.body != wanted:
            interface.faults.append(f"Range: {text} is answered with other bytes")


def check_import(interface, path):
    """A file in place of a body of JSON."""
    stl = interface.send("GET", f"{path}/clay.stl").body
    clay = f"{path}/clay"
    for content, media_type, status in [(stl, "model/stl", 200), (b"no mesh", "model/3mf", 422), (b"{}", "application/json", 415)]:
        interface.expect(interface.send("PUT", clay, content=content, headers={"Content-Type": media_type}), {status})
    header = b"NRRD0004\ntype: uchar\ndimension: 3\nsizes: 8 8 8\nencoding: raw\nspacings: 1 1 1\n\n"
    scan = header + bytes(100 if voxel < 256 else 200 for voxel in range(512))
    for query, content, status in [
        ("?thresholds=50,150&materials=firm_clay", scan, 200), ("?thresholds=50", scan, 200), ("", scan, 422), ("?thresholds=50", scan[1:], 422),
        ("?thresholds=50&materials=butter", scan, 422), ("?thresholds=250", scan, 422),
    ]:  # fmt: skip
        interface.expect(interface.send("PUT", clay + query, content=content, headers={"Content-Type": "application/x-nrrd"}), {status})
    huge = {"Content-Type": "model/stl", "Content-Length": str(1 << 30)}
    interface.expect(interface.send("PUT", clay, content=b"", headers=huge), {413})


def check_damaged(interface, damaged, bodies):
    """What is asked of a session whose files are damaged is answered with that; it is listed, and can be deleted."""
    content = {interface.template(path): json.dumps(fulls[0]).encode() for _, path, fulls in bodies}
    answer = interface.send("GET", "/api/v1/sessions", address=damaged)
    interface.expect(answer, {200})
    if [session["state"] for session in json.loads(answer.body) if session["id"] == "hurt"] != ["damaged"]:
        interface.faults.append(f"the damaged session is listed as {answer.text}")
    asked = [(path, method) for path, method, _ in interface.operations() if "{id}" in path]
    for path, method in sorted(asked, key=lambda call: call[1] == "delete" and call[0].endswith("{id}")):
        body = content.get(path) if method != "get" else None
        headers = {"Content-Type": "application/json"} if body else {}
        if path.endswith("/stream"):
            headers = {
                "Connection": "Upgrade", "Upgrade": "websocket", "Sec-WebSocket-Version": "13",
                "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==", "Sec-WebSocket-Protocol": "teleclay.v1",
            }  # fmt: skip
        answer = interface.send(method, path.replace("{id}", "hurt").replace("{tool}", "1").replace("{recording}", "none"), content=body, headers=headers, address=damaged)
        interface.expect(answer, {204} if method == "delete" and path.endswith("{id}") else {409})


def check_token(interface, guarded):
    """A server with a token says what it wants, and to whom it does not matter."""
    for path, method, operation in interface.operations():
        is_open = operation.get("security") == [{}]
        body = b"{" if "requestBody" in operation else None
        headers = {"Content-Type": "application/json"} if body else {}
        answer = interface.send(method, path.replace("{id}", "none").replace("{tool}", "1"), content=body, headers=headers, address=guarded)
        interface.expect(answer, {200} if is_open else {401})
    answer = interface.send("GET", "/api/v1/sessions", headers={"Authorization": f"Bearer {TOKEN}"}, address=guarded)
    interface.expect(answer, {200})
    # Twenty wrong ones are looked at, and then one a second.
    for path, method, operation in interface.operations():
        if operation.get("security") == [{}]:
            continue
        for _ in range(30):
            wrong = {"Authorization": "Bearer another token, as long"}
            answer = interface.send(method, path.replace("{id}", "none").replace("{tool}", "1"), headers=wrong, address=guarded)
            interface.expect(answer, {401, 429})
            if answer.status == 429:
                break


def check_bounds(interface, bodies):
    bounded = 0
    for method, path, full, at in numbers_of(bodies):
        schemas = interface.schemas_at(interface.request_schema(method, path), full, at)
        if not any("type" in schema or "enum" in schema for schema in schemas):
            interface.faults.append(f"{method} {path}: {at} has no type")
        bounded += any(key in schema for schema in schemas for key in ("minimum", "maximum", "enum"))
        for value in draws(schemas):
            interface.judge(method, path, put(full, at, value), f"{value!r} at {at}")
    if bounded < 100:
        sys.exit(f"only {bounded} numbers have bounds")


def check_shapes(interface, bodies):
    for method, path, fulls in bodies:
        for full in fulls:
            for at in sorted(places_in(full)):
                now = get(full, at)
                for value in disguises(now):
                    interface.judge(method, path, put(full, at, value), f"{value!r:.80} at {at!r}")


def check_messages(interface):
    one = interface.session()
    place = "/components/schemas/ClientText"
    messages = [
        {"type": "subscribe", "telemetry": "on", "bricks": "off"},
        {"type": "patch", "session": {"scheme": "wave", "paused": True, "deadband": 0.1, "operation": "smooth", "network": {"up": {"seed": 3, "loss": 0.1}}}},
        {"type": "reset", "clay": {"shape": {"kind": "block", "size_m": [0.02, 0.02, 0.02]}}},
        {"type": "ping", "nonce": 7},
        {"type": "join", "operator": "Ada", "device": {"name": "a", "axes": 2, "force_n": 1, "rate_hz": 60, "measures_force": False}},
        {"type": "parameters"},
        {"type": "snapshot", "epoch": 1},
        {"type": "leave"},
        {"type": "request", "tool": 1, "operator": "Bob"},
        {"type": "withdraw", "tool": 1, "operator": "Bob"},
        {"type": "grant", "tool": 1, "operator": "Bob"},
        {"type": "deny", "tool": 1, "operator": "Bob", "reason": "in a moment"},
        {"type": "release", "tool": 1},
        {"type": "stop", "operator": "Ada", "reason": "enough"},
        {"type": "clear_stop", "operator": "Ada"},
    ]
    with Stream(interface.address, one) as stream:
        for message in messages:
            for at in sorted(places_in(message)):
                now = get(message, at)
                values = [now, *disguises(now), 1.0, 2.5, -1, 2**32 - 1, 2**32]
                for value in values:
                    body = put(message, at, value)
                    stream.say(body)
                    stream.say({"type": "ping", "nonce": 4711})
                    refusal = None
                    for text in stream.until_pong(4711):
                        fault = interface.fault("/components/schemas/ServerText", text)
                        if fault:
                            interface.faults.append(f"a stream said {text}: {fault}")
                        # Whether it can be done as things stand is not the schema's to say.
                        if text["type"] == "problem" and text["problem"]["status"] in (400, 422):
                            refusal = text["problem"]
                    # A stop is carried out whatever is wrong with its words.
                    is_stop = isinstance(body, dict) and body.get("type") == "stop"
                    if not (is_stop and refusal is None):
                        interface.hold(place, body, refusal, f"message {body}")


def check_coverage(interface):
    """Every status of every call was seen, but for what cannot be brought about from here."""
    never = {"500", "503", "101"}
    # What takes a hand that has cut, or minutes: other tests see these.
    elsewhere = {
        ("post", "/api/v1/sessions/{id}/undo", 200),
        ("post", "/api/v1/sessions/{id}/redo", 200),
        ("put", "/api/v1/sessions/{id}/clay", 408),
    }
    for path, method, operation in interface.operations():
        for status in operation["responses"]:
            # What a page of another origin may not read, its browser keeps from it: the server answers.
            is_read = status == "403" and method == "get" and not path.endswith("/stream")
            was_seen = (method, path, int(status)) in interface.seen | elsewhere if status not in never else True
            if not was_seen and not is_read:
                interface.faults.append(f"{method} {path}: status {status} was never seen")


# What is put where


def numbers_of(bodies):
    for method, path, fulls in bodies:
        for full in fulls:
            for at in sorted(places_in(full)):
                if isinstance(get(full, at), (int, float)) and not isinstance(get(full, at), bool):
                    yield method, path, full, at


def draws(schemas):
    """Whole and broken numbers in every spelling; bounds and their neighbours; other kinds of value."""
    found = [0, 1, 1.0, 2.0, -1, 2.5, "1", None, True, [1], 1e300, -1e300]
    is_whole = any(schema.get("type") == "integer" for schema in schemas)
    for schema in schemas:
        for key in ("minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum"):
            if key in schema:
                found += around(schema[key], is_whole)
        found += schema.get("enum", [])
    return found


def around(bound, is_whole):
    if is_whole:
        return [int(bound) - 1, int(bound), int(bound) + 1, float(bound)]
    # Of 15 digits at most: so many every reader keeps.
    step = max(abs(bound) * 1e-13, 1e-300)
    return [float(f"{number:.14e}") for number in (bound - step, bound, bound + step)]


def disguises(now):
    """Other kinds of value than `now`, and some that look like it."""
    found = [None, {}, [], [now], {"surplus": 1}, 0, "no such word"]
    if isinstance(now, str):
        found += [{now: None}, {now: {}}, now.upper(), f"{now} "]
    if isinstance(now, dict):
        found += [list(now.values()), now | {"surplus": 1}, *({k: v for k, v in now.items() if k != key} for key in now)]
    if isinstance(now, list):
        found += [now + now, now[1:], now[:1], {str(n): item for n, item in enumerate(now)}]
    return found


def places_in(value, at=""):
    """JSON pointers of a value and of everything in it."""
    found = {at}
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else []
    for key, inner in items:
        found |= places_in(inner, f"{at}/{key}")
    return found


def fields_of(interface, place, at=""):
    """Every field that a schema names, with its pointer; of choices, those of all of them."""
    for schema in interface.flat([interface.look_up(place)], None):
        for key, inner in schema.get("properties", {}).items():
            yield f"{at}/{key}", inner
            yield from ((found, field) for found, field in fields_below(interface, inner, f"{at}/{key}"))


def fields_below(interface, schema, at):
    for inner in interface.flat([schema], None):
        for key, field in inner.get("properties", {}).items():
            yield f"{at}/{key}", field
            yield from fields_below(interface, field, f"{at}/{key}")


def get(value, at):
    for key in at.split("/")[1:]:
        value = value[int(key)] if isinstance(value, list) else value[key]
    return value


def put(value, at, new):
    if at == "":
        return new
    changed = copy.deepcopy(value)
    parent, _, key = at.rpartition("/")
    inside = get(changed, parent)
    inside[int(key) if isinstance(inside, list) else key] = new
    return changed

if __name__ == "__main__":
    main()
