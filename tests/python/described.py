"""A server as its OpenAPI document describes it. Every answer is held against the document, by the jsonschema library."""

import base64
import contextlib
import http.client
import json
import os
import pathlib
import re
import socket
import struct
import subprocess
import sys
import tempfile
import time
from urllib.parse import urlsplit

from jsonschema import Draft202012Validator
from referencing import Registry
from referencing.jsonschema import DRAFT202012

# Nothing waits as long as this unless it fails, s.
PATIENCE_S = 60

# Fields whose value must fit another's, which no schema can say: where one of them is named, or something in it, its
# own schema need not be at fault.
MUST_FIT = [
    "/outage/length_s",  # shorter than every_s
    "/outage",  # one that begins is whole
    "/burst",
    "/voxel_size_m",  # at most 1024 voxels along an axis
    "/shape",
    "/edges_m",  # ascending, one more than there are depths or dampings
    "/depths_of_cut_m",
    "/clay_damping_n_s_per_m",  # one for each range; of tuning, the least first
    "/clay_stiffness_n_per_m",
    "/denominator",  # not all zero
    "/region_m",  # the least corner first
    "/wire_diameter_m",  # no thicker than ring_radius_m
    "/cells",  # at most 100,000 in all
    "/since",  # not beside a tool
    "/arm_angles_deg",  # no two alike
    "/operation",  # under a scheme that keeps the order of all that is done
    "/scheme",
]

# What nobody outside of the program knows.
FOREIGN = re.compile(
    r"\b(struct|enum|variant|tuple|newtype|sequence|u8|u16|u32|u64|i64|f64|usize|serde|Option|Vec)\b|\b(?!WebSocket)[A-Z][a-z]+[A-Z]\w*"
)


def small(name):
    return {"id": name, "clay": {"shape": {"kind": "block", "size_m": [0.016] * 3}, "voxel_size_m": 1e-3}}


class Answer:
    def __init__(self, method, path, response):
        self.method, self.path, self.status = method, path, response.status
        self.media_type = (response.getheader("Content-Type") or "").split(";")[0]
        self.location = response.getheader("Location")
        self.body = response.read()
        self.text = self.body[:400].decode(errors="replace")


class Interface:
    def __init__(self, address):
        self.address = address
        self.faults, self.seen, self.asked, self.judged, self.made = [], set(), 0, 0, 0
        self.validators = {}
        self.document = {"paths": {}}
        self.document = json.loads(self.send("GET", "/api/v1/openapi.json").body)
        self.registry = Registry().with_resource("urn:interface", DRAFT202012.create_resource(self.document))

    def operations(self):
        for path, item in self.document["paths"].items():
            for method, operation in item.items():
                yield path, method, operation

    def session(self):
        self.made += 1
        name = f"s{self.made}"
        answer = self.ask("POST", "/api/v1/sessions", small(name))
        if answer.status != 201:
            sys.exit(f"no session could be made: {answer.text}")
        return name

    def ask(self, method, path, body):
        return self.send(method, path, content=json.dumps(body).encode(), headers={"Content-Type": "application/json"})

    def takes_json(self, operation):
        # A stop is carried out whatever its body is.
        is_asked = not operation.get("operationId", "").startswith("stop")
        return is_asked and "application/json" in operation.get("requestBody", {}).get("content", {})

    def send(self, method, path, content=None, headers=None, address=None):
        method = method.upper()
        connection = http.client.HTTPConnection(address or self.address, timeout=PATIENCE_S)
        connection.putrequest(method, path, skip_host=True, skip_accept_encoding=True)
        headers = {"Host": address or self.address} | (headers or {})
        if content is not None:
            headers = {"Content-Length": str(len(content))} | headers
        elif method in ("POST", "PATCH", "PUT"):
            headers = {"Content-Length": "0"} | headers
        for name, value in headers.items():
            if value != "":
                connection.putheader(name, value)
        connection.endheaders(content)
        with connection.getresponse() as response:
            answer = Answer(method, path, response)
        connection.close()
        self.asked += 1
        if fault := self.fault_of(answer):
            self.faults.append(f"{method} {path}: {fault}: {answer.status} {answer.text:.200}")
        return answer

    def undo(self, answer):
        if answer.status == 201:
            self.expect(self.send("DELETE", answer.location), {204})

    def expect(self, answer, statuses):
        if answer.status not in statuses:
            self.faults.append(f"{answer.method} {answer.path}: {answer.status} {answer.text}, wanted {statuses}")

    def template(self, path):
        """The path of the description that `path` is one of."""
        asked = urlsplit(path).path.split("/")
        for template in self.document["paths"]:
            parts = template.split("/")
            if len(parts) == len(asked) and all(part == own or part.startswith("{") for part, own in zip(parts, asked)):
                return template
        return None

    def fault_of(self, answer):
        """What is wrong with an answer by the description; nothing when it is as described."""
        if not self.document["paths"]:
            return None
        if answer.media_type == "application/problem+json":
            problem = json.loads(answer.body)
            if FOREIGN.search(problem["detail"]):
                return "the detail speaks of types of the program"
            if fault := self.fault("/components/schemas/Problem", problem):
                return fault
        template = self.template(answer.path)
        operation = self.document["paths"].get(template, {}).get(answer.method.lower())
        if operation is None:
            return None if answer.status in (404, 405, 421) else "nothing is described here"
        self.seen.add((answer.method.lower(), template, answer.status))
        response = operation["responses"].get(str(answer.status))
        if response is None:
            return "the status is not described"
        content = response.get("content", {})
        if not content:
            return "there is a body, and none is described" if answer.body else None
        if answer.media_type not in content:
            return f"the media type {answer.media_type!r} is not described"
        if not answer.media_type.endswith("json") or "schema" not in content[answer.media_type]:
            return None
        place = pointer("paths", template, answer.method.lower(), "responses", str(answer.status), "content", answer.media_type, "schema")
        return self.fault(place, json.loads(answer.body))

    def request_schema(self, method, path):
        return pointer("paths", self.template(path), method.lower(), "requestBody", "content", "application/json", "schema")

    def fault(self, place, value):
        """What is wrong with a value by the schema at a place; nothing when it keeps to it."""
        if place not in self.validators:
            schema = {"$ref": f"urn:interface#{place.replace('{', '%7B').replace('}', '%7D')}"}
            self.validators[place] = Draft202012Validator(schema, registry=self.registry)
        error = next(self.validators[place].iter_errors(value), None)
        return None if error is None else f"{error.json_path}: {error.message:.200}"

    def judge(self, method, path, body, what):
        """Asks the server for its verdict on a body, and the schema for its own."""
        answer = self.ask(method, path, body)
        self.undo(answer)
        refusal = None
        if answer.status == 422:
            problem = json.loads(answer.body)
            # Whatever the calculation makes of it, the body was accepted.
            refusal = problem if problem["type"] == "/problems/field" else None
        elif answer.status == 409 and json.loads(answer.body)["type"] in AS_THINGS_STAND:
            pass  # The body was accepted; nobody has cut anything, nor holds a tool.
        elif 400 <= answer.status and answer.status != 503:
            self.faults.append(f"{method} {path} with {what}: {answer.status} {answer.text}")
        self.hold(self.request_schema(method, path), body, refusal, f"{method} {path} with {what}")

    def hold(self, place, body, refusal, what):
        """Holds the verdict of the server against the schema's."""
        self.judged += 1
        fault = self.fault(place, body)
        if fault and refusal is None:
            self.faults.append(f"{what}: it is accepted, and the schema forbids it: {fault}")
        if fault is None and refusal is not None:
            at = refusal.get("pointer", "")
            starts = ["/".join(at.split("/")[: n + 1]) for n in range(at.count("/") + 1)]
            if not any(start.endswith(field) for start in starts for field in MUST_FIT):
                self.faults.append(f"{what}: it is refused at {at!r} ({refusal['detail']}), and the schema allows it")

    def look_up(self, place):
        value = self.document
        for key in place.split("/")[1:]:
            value = value[key.replace("~1", "/").replace("~0", "~")]
        return value

    def flat(self, schemas, value):
        """Schemas with references followed; of choices, those that the value may keep to."""
        found, left = [], list(schemas)
        while left:
            schema = left.pop()
            if "$ref" in schema:
                left.append(self.look_up(schema["$ref"].removeprefix("#")))
            for choice in schema.get("oneOf", []):
                kinds = choice.get("properties", {}).get("kind", {}).get("enum")
                if kinds is None or not isinstance(value, dict) or value.get("kind") in kinds:
                    left.append(choice)
            found.append(schema)
        return found

    def schemas_at(self, place, body, at):
        """Every schema that the value at `at` of a body has to keep to."""
        here, value = self.flat([self.look_up(place)], body), body
        for key in at.split("/")[1:]:
            value = value[int(key)] if isinstance(value, list) else value[key]
            below = [schema.get("properties", {}).get(key) or schema.get("items") for schema in here]
            here = self.flat([schema for schema in below if schema], value)
        return here


def pointer(*keys):
    return "".join("/" + key.replace("~", "~0").replace("/", "~1") for key in keys)


AS_THINGS_STAND = {f"/problems/{word}" for word in ["nothing-there", "control", "not-stopped", "recording"]}


class Stream:
    """A WebSocket, as much of one as it takes: texts in one frame both ways, anything else passed over."""

    def __init__(self, address, session):
        host, port = address.split(":")
        self.socket = socket.create_connection((host, int(port)), timeout=PATIENCE_S)
        self.socket.sendall(
            f"GET /api/v1/sessions/{session}/stream HTTP/1.1\r\nHost: {address}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
            f"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: {base64.b64encode(os.urandom(16)).decode()}\r\n"
            "Sec-WebSocket-Protocol: teleclay.v1\r\n\r\n".encode()
        )
        self.file = self.socket.makefile("rb")
        if b" 101 " not in self.file.readline():
            sys.exit("a stream did not open")
        while self.file.readline() != b"\r\n":
            pass

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.file.close()
        self.socket.close()

    def say(self, message):
        text = json.dumps(message).encode()
        mask = os.urandom(4)
        masked = bytes(byte ^ mask[n % 4] for n, byte in enumerate(text))
        length = bytes([0x80 | len(text)]) if len(text) < 126 else b"\xfe" + struct.pack(">H", len(text))
        self.socket.sendall(b"\x81" + length + mask + masked)

    def until_pong(self, nonce):
        """Texts up to the pong, and that too."""
        while True:
            first, length = self.file.read(2)
            if length == 126:
                (length,) = struct.unpack(">H", self.file.read(2))
            elif length == 127:
                (length,) = struct.unpack(">Q", self.file.read(8))
            payload = self.file.read(length)
            if first == 0x88:
                sys.exit(f"the stream ended: {payload}")
            if first != 0x81:
                continue
            text = json.loads(payload)
            yield text
            if text == {"type": "pong", "nonce": nonce}:
                return


@contextlib.contextmanager
def with_damage(program, session):
    """A server that has found the files of a session damaged."""
    with tempfile.TemporaryDirectory() as folder:
        with running(program, TELECLAY_DATA_DIR=folder) as address:
            body = json.dumps(small(session)).encode()
            connection = http.client.HTTPConnection(address, timeout=PATIENCE_S)
            connection.request("POST", "/api/v1/sessions", body, {"Content-Type": "application/json"})
            if connection.getresponse().status != 201:
                sys.exit("no session could be made that was to be damaged")
        for file in pathlib.Path(folder, "sessions/of", session).glob("*.s*"):
            content = bytearray(file.read_bytes())
            # In the first record of a segment, and in the state of a snapshot.
            content[110] ^= 1
            file.write_bytes(content)
        with running(program, TELECLAY_DATA_DIR=folder) as address:
            yield address


@contextlib.contextmanager
def running(program, said=None, **environment):
    """A server on ports of its own, until the end; what it says goes into a file, where one is given."""
    port = next(port for port in range(20_000 + os.getpid() % 10_000, 32_000, 3) if all(is_free(port + n) for n in range(3)))
    address = f"127.0.0.1:{port}"
    kept = {name: value for name, value in os.environ.items() if not name.startswith("TELECLAY_")}
    with tempfile.TemporaryDirectory() as folder, contextlib.nullcontext(said) if said else tempfile.TemporaryFile() as said:
        arguments = ["--listen", address, "--zenoh-listen", f"tcp/127.0.0.1:{port + 1}"]
        environment = {"TELECLAY_DATA_DIR": folder} | environment
        server = subprocess.Popen([program, *arguments], env=kept | environment, stdout=said, stderr=said)
        try:
            began = time.monotonic()
            while not is_ready(address):
                if server.poll() is not None or PATIENCE_S < time.monotonic() - began:
                    said.seek(0)
                    sys.exit(f"the server does not start: {said.read().decode()}")
                time.sleep(0.05)
            yield address
        finally:
            server.terminate()
            server.wait()


def is_free(port):
    """Whether somebody may listen there. Ports of so low a number are given to nobody unasked, so it stays so."""
    with socket.socket() as tried:
        try:
            tried.bind(("127.0.0.1", port))
        except OSError:
            return False
        return True


def is_ready(address):
    try:
        connection = http.client.HTTPConnection(address, timeout=5)
        connection.request("GET", "/readyz")
        return connection.getresponse().status == 200
    except OSError:
        return False
