"""Holds a server's side of ROS 2 against another reading of the same wire.

    python ros2.py ROOT SERVER HANDLE

ROOT is the checkout, SERVER and HANDLE are the programs. Here is a router and a node as rmw_zenoh's design document has them:
keys, tokens and attachments are put together from that document, types are hashed and bytes are read by rosbags, and Zenoh is
its library for Python. Nothing is taken from the server but its name.

    router    one that is missing is said in the log and in /metrics, and found when it comes
    topics    every topic of a session is in the graph with its type, and is heard at 100 messages a second and more while a
              simulated hand cuts, numbered and stamped in order; poses, frames and REST agree
    services  every service does what it says, as REST shows; a stop stays whatever is asked for
    others    a subscriber and a publisher whose type or hash differs in one character are errors in the log

Exits with 0 when everything agrees.
"""

import argparse
import http.client
import json
import pathlib
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time

import zenoh
from ros_messages import message, types

from described import running

PATIENCE_S = 60
DOMAIN = 3
NODE = "teleclay_local"
STAMPED = {
    "handle_pose": "geometry_msgs/msg/PoseStamped", "tool_pose": "geometry_msgs/msg/PoseStamped",
    "handle_twist": "geometry_msgs/msg/TwistStamped", "tool_twist": "geometry_msgs/msg/TwistStamped",
    "hand_wrench": "geometry_msgs/msg/WrenchStamped", "felt_wrench": "geometry_msgs/msg/WrenchStamped",
    "tool_wrench": "geometry_msgs/msg/WrenchStamped",
}  # fmt: skip
FRAMES = {name: "handle_1" for name in ("handle_pose", "handle_twist", "hand_wrench", "felt_wrench")} | {"tool_wrench": "tool_1"}
OWN = {"link": "teleclay_msgs/msg/Link", "energy": "teleclay_msgs/msg/Energy", "corrections": "teleclay_msgs/msg/Corrections"}
SLOW = {
    "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray", "/teleclay/demo/settings": "teleclay_msgs/msg/Settings",
    "/teleclay/demo/events": "teleclay_msgs/msg/Event",
}  # fmt: skip
FAST = {f"/teleclay/demo/tool_1/{name}": kind for name, kind in (STAMPED | OWN).items()} | {"/tf": "tf2_msgs/msg/TFMessage"}
SERVICES = {"pause": "std_srvs/srv/SetBool", "reset_clay": "std_srvs/srv/Trigger", "set_scheme": "teleclay_msgs/srv/SetScheme"}


def main():
    parser = argparse.ArgumentParser(description="Holds a server's side of ROS 2 against another reading of the same wire.")
    parser.add_argument("root", type=pathlib.Path)
    parser.add_argument("server")
    parser.add_argument("handle")
    arguments = parser.parse_args()
    store = types(arguments.root / "ros2/teleclay_msgs")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{free.getsockname()[1]}"
    told = {"TELECLAY_ROS2": endpoint, "TELECLAY_ROS2_DOMAIN": str(DOMAIN), "TELECLAY_ROS2_COMMANDS": "true"}
    with tempfile.NamedTemporaryFile() as said, running(arguments.server, said, **told) as address:
        server = Server(address, said.name)
        wait("a missing router is said", lambda: "no Zenoh router answers" in server.log())
        check(server.figure("teleclay_ros2_router_up") == 0, "a missing router is in the figures")
        with opened("router", "listen", endpoint), opened("client", "connect", endpoint) as session:
            wait("the router is found", lambda: server.figure("teleclay_ros2_router_up") == 1)
            node = Node(session, store)
            check_graph(node)
            hear = [arguments.handle, "--connect", server.zenoh, "--session", "demo", "--device", "simulated", "--seconds", "600"]
            hand = subprocess.Popen([*hear, "--intent", "cutting"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            try:
                check_topics(node, server)
            finally:
                hand.terminate()
                hand.wait()
            check_services(node, server)
            check_others(node, server)
    print(f"{CHECKED[0]} statements about ROS 2 hold")


CHECKED = [0]


def check(holds, what):
    CHECKED[0] += 1
    if not holds:
        sys.exit(f"does not hold: {what}")


def wait(what, holds):
    began = time.monotonic()
    while not holds():
        if PATIENCE_S < time.monotonic() - began:
            sys.exit(f"not in time: {what}")
        time.sleep(0.05)
    CHECKED[0] += 1


def opened(mode, way, endpoint):
    config = zenoh.Config()
    for key, value in {
        "mode": mode, f"{way}/endpoints": [endpoint], "scouting/multicast/enabled": False, "scouting/gossip/enabled": False,
    }.items():  # fmt: skip
        config.insert_json5(key, json.dumps(value))
    return zenoh.open(config)


class Server:
    """The server, as REST, its figures and its log show it."""

    def __init__(self, address, log):
        self.address, self.log_file = address, pathlib.Path(log)
        host, port = address.split(":")
        self.zenoh = f"tcp/{host}:{int(port) + 1}"

    def ask(self, method, path, body=None):
        connection = http.client.HTTPConnection(self.address, timeout=PATIENCE_S)
        connection.request(method, path, None if body is None else json.dumps(body), {"content-type": "application/json"})
        answer = connection.getresponse()
        text = answer.read().decode()
        check(answer.status < 300, f"{method} {path}: {answer.status} {text[:200]}")
        return text

    def session(self):
        return json.loads(self.ask("GET", "/api/v1/sessions/demo"))

    def figure(self, name):
        lines = self.ask("GET", "/metrics").splitlines()
        return float(next(line.split(" ")[1] for line in lines if line.startswith(f"{name} ")))

    def log(self):
        return self.log_file.read_text()


class Node:
    """A node of ROS 2, as rmw_zenoh makes one."""

    def __init__(self, session, store):
        self.session, self.store, self.ends = session, store, 0
        self.zid = session.info.zid()
        self.kept = [session.liveliness().declare_token(f"@ros2_lv/{DOMAIN}/{self.zid}/0/0/NN/%/%/listener")]

    def typed(self, kind):
        package, folder, name = kind.split("/")
        return f"{package}::{folder}::dds_::{name}_", self.store.hash_rihs01(kind)

    def key(self, name, kind):
        return "/".join([str(DOMAIN), name.strip("/"), *self.typed(kind)])

    def token(self, name, what, dds_type, type_hash):
        self.ends += 1
        topic = name.replace("/", "%")
        return f"@ros2_lv/{DOMAIN}/{self.zid}/0/{self.ends}/{what}/%/%/listener/{topic}/{dds_type}/{type_hash}/2::,10:,:,:,,"

    def show(self, *about):
        self.kept.append(self.session.liveliness().declare_token(self.token(*about)))

    def graph(self):
        """Names and types of what others have, by kind."""
        found = {}
        for reply in self.session.liveliness().get(f"@ros2_lv/{DOMAIN}/**"):
            parts = str(reply.ok.key_expr).split("/")
            if parts[2] != str(self.zid) and len(parts) == 13:
                check(parts[6:9] == ["%", "%", NODE] and parts[12].count(":") == 5, f"the form of {reply.ok.key_expr}")
                found[parts[5], parts[9].replace("%", "/")] = tuple(parts[10:12])
        return found

    def listen(self, name, kind):
        heard = Heard(self.store, kind)
        self.kept.append(self.session.declare_subscriber(self.key(name, kind), heard))
        self.show(name, "MS", *self.typed(kind))
        return heard

    def call(self, name, kind, sequence, **values):
        request = message(self.store, f"{kind}_Request", values)
        payload = bytes(self.store.serialize_cdr(request, f"{kind}_Request"))
        gid = bytes(range(16))
        replies = self.session.get(
            self.key(name, kind), payload=payload, attachment=struct.pack("<qqB", sequence, time.time_ns(), 16) + gid,
            target=zenoh.QueryTarget.ALL_COMPLETE, consolidation=zenoh.ConsolidationMode.NONE, timeout=PATIENCE_S,
        )  # fmt: skip
        samples = [reply.ok for reply in replies]
        check(len(samples) == 1, f"{len(samples)} answers of {name}")
        answered, _, length = struct.unpack("<qqB", bytes(samples[0].attachment)[:17])
        check((answered, length, bytes(samples[0].attachment)[17:]) == (sequence, 16, gid), f"whom {name} answers")
        response = self.store.deserialize_cdr(bytes(samples[0].payload), f"{kind}_Response")
        return response.success, response.message


class Heard:
    """What came on a topic: number, source and message of each."""

    def __init__(self, store, kind):
        self.store, self.kind, self.lock, self.list = store, kind, threading.Lock(), []

    def __call__(self, sample):
        attachment = bytes(sample.attachment)
        sequence, sent_ns, length = struct.unpack("<qqB", attachment[:17])
        told = self.store.deserialize_cdr(bytes(sample.payload), self.kind)
        with self.lock:
            self.list.append((time.monotonic(), sequence, sent_ns, (length, attachment[17:]), told))

    def all(self):
        with self.lock:
            return list(self.list)


def check_graph(node):
    wanted = {("MP", name): node.typed(kind) for name, kind in (FAST | SLOW).items()}
    wanted |= {("SS", f"/teleclay/demo/{name}"): node.typed(kind) for name, kind in SERVICES.items()}
    wait("everything is in the graph", lambda: wanted.items() <= node.graph().items())


def check_topics(node, server):
    fast = {name: node.listen(name, kind) for name, kind in FAST.items()}
    slow = {name: node.listen(name, kind) for name, kind in SLOW.items()}
    wait("a hand holds the tool", lambda: server.session()["tools"][0]["connected"])
    for name, heard in fast.items():
        wait(f"{name} is heard", lambda heard=heard: 500 < len(heard.all()))
    for name, heard in slow.items():
        wait(f"{name} is heard", lambda heard=heard: heard.all())
    now_ns = time.time_ns()
    for name, heard in fast.items():
        messages = heard.all()
        rate = (len(messages) - 1) / (messages[-1][0] - messages[0][0])
        check(100 <= rate, f"{name} at {rate:.0f} Hz")
        # Best effort: a router that is slow for a moment costs messages, and their numbers show it.
        check(all(a[1] < b[1] for a, b in zip(messages, messages[1:])), f"{name} is numbered in order")
        check((messages[-1][1] - messages[0][1]) / 2 < len(messages), f"more than half of {name} is heard")
        check(len({source for _, _, _, source, _ in messages}) == 1 and messages[0][3][0] == 16, f"{name} has one source")
        stamps = [stamp_ns(told) for *_, told in messages]
        check(stamps == sorted(stamps) and abs(stamps[-1] - now_ns) < 60e9, f"{name} is stamped in order")
        check(all(stamp <= sent_ns for stamp, (_, _, sent_ns, _, _) in zip(stamps, messages)), f"{name} is stamped no later than sent")
    for name in STAMPED:
        frames = {told.header.frame_id for *_, told in fast[f"/teleclay/demo/tool_1/{name}"].all()}
        wanted = "/".join(["teleclay/demo", *([FRAMES[name]] if name in FRAMES else [])])
        check(frames == {wanted}, f"{name} is in {frames}, wanted {wanted}")
    check_values(fast, slow, server)


def stamp_ns(told):
    header = told.transforms[0].header if hasattr(told, "transforms") else getattr(told, "header", told)
    return header.stamp.sec * 10**9 + header.stamp.nanosec


def check_values(fast, slow, server):
    """The figures of one moment agree with each other, and the last with what REST tells of a tool that is let go of."""
    poses, felt = ({stamp_ns(m): m for *_, m in fast[f"/teleclay/demo/tool_1/{name}"].all()} for name in ("tool_pose", "felt_wrench"))
    places = {}
    for *_, told in fast["/tf"].all():
        for one in told.transforms:
            if one.child_frame_id == "teleclay/demo/tool_1":
                places[stamp_ns(told)] = one.transform.translation
    both = poses.keys() & places.keys()
    check(200 < len(both), f"{len(both)} moments have a pose and a place")
    for stamp in both:
        position, place = poses[stamp].pose.position, places[stamp]
        check((position.x, position.y, position.z) == (place.x, place.y, place.z), f"pose and place of {stamp}")
    moved = max(pose.pose.position.x for pose in poses.values()) - min(pose.pose.position.x for pose in poses.values())
    check(1e-3 < moved, f"the tool moved {moved} m")
    strongest = max(abs(told.wrench.force.x) for told in felt.values())
    check(0.05 < strongest < 20.5, f"the hand felt {strongest} N")
    link = fast["/teleclay/demo/tool_1/link"].all()[-1][-1]
    check(link.connected and link.operator_name == server.session()["tools"][0]["operator"], f"the line: {link}")
    diagnosis = slow["/diagnostics"].all()[-1][-1].status[0]
    check((diagnosis.name, diagnosis.level) == ("teleclay/demo", 0), f"the diagnosis: {diagnosis}")
    settings = json.loads(slow["/teleclay/demo/settings"].all()[-1][-1].json)
    check(settings["spec"]["scheme"] == server.session()["scheme"], "the settings are the session's")


def check_services(node, server):
    names = {name: (f"/teleclay/demo/{name}", kind) for name, kind in SERVICES.items()}
    success, told = node.call(*names["pause"], 1, data=True)
    check(success and server.session()["state"] == "paused", f"paused: {told}")
    success, told = node.call(*names["pause"], 2, data=False)
    check(success and server.session()["state"] != "paused", f"goes on: {told}")
    epoch = server.session()["clay"]["epoch"]
    success, told = node.call(*names["reset_clay"], 3, structure_needs_at_least_one_member=0)
    clay = server.session()["clay"]
    check(success and epoch < clay["epoch"] and clay["removed_volume_m3"] == 0, f"a fresh block: {told}")
    for sequence, scheme in enumerate(["wave", "replica"]):
        success, told = node.call(*names["set_scheme"], sequence, scheme=scheme)
        check(success and server.session()["scheme"] == scheme, f"another scheme: {told}")
    success, told = node.call(*names["set_scheme"], 9, scheme="magic")
    check(not success and "magic" in told and server.session()["scheme"] == "replica", f"no scheme: {told}")
    server.ask("POST", "/api/v1/sessions/demo/stop", {"operator": "Ada", "reason": "a test"})
    node.call(*names["pause"], 10, data=False)
    node.call(*names["reset_clay"], 11, structure_needs_at_least_one_member=0)
    node.call(*names["set_scheme"], 12, scheme="wave")
    check(server.session()["state"] == "stopped", "a stop stays")


def check_others(node, server):
    check(server.figure("teleclay_ros2_mismatched_ends") == 0, "who means the same is no stranger")
    name = "/teleclay/demo/tool_1/tool_pose"
    dds_type, type_hash = node.typed("geometry_msgs/msg/PoseStamped")
    other_hash = type_hash[:-1] + ("0" if type_hash[-1] != "0" else "1")
    other_type = dds_type.replace("::PoseStamped_", "::PoseStampet_")
    for count, (what, word, a_type, a_hash) in enumerate(
        [("MS", "subscriber", dds_type, other_hash), ("MP", "publisher", other_type, type_hash)], start=1
    ):
        node.show(name, what, a_type, a_hash)
        wait(f"a {word} that means another type is counted", lambda: server.figure("teleclay_ros2_mismatched_ends") == count)
        altered = a_hash if a_hash != type_hash else a_type
        said = [line for line in server.log().splitlines() if f"{word} /listener of {name}" in line]
        check(len(said) == 1 and "ERROR" in said[0] and altered in said[0], f"it is an error in the log: {said}")


if __name__ == "__main__":
    main()
