"""Writes every ROS 2 message of crates/ros a second time, by rosbags, and compares bytes and type hashes.

    python ros_messages.py ROOT [--write]

ROOT is the checkout. crates/ros/tests/reference/messages.json holds, per message, the values that went in beside the hash and
the bytes that came out; the Rust tests compare the same file. rosbags has the texts of ROS 2's own messages, and reads those of
teleclay_msgs where ROS 2 would. With --write hashes and bytes are replaced by the ones computed here.

Exits with 0 when everything agrees.
"""

import argparse
import json
import pathlib
import sys

import numpy
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

# Standard services, which rosbags does not bring.
SERVICES = {
    "std_srvs/srv/SetBool": "bool data\n---\nbool success\nstring message\n",
    "std_srvs/srv/Trigger": "---\nbool success\nstring message\n",
}
# rosbags takes `char` for a type of its own; ROS 2 has made it `uint8`.
EVENT_INFO = "uint8 event_type\nbuiltin_interfaces/Time stamp\nuint8[16] client_gid\nint64 sequence_number\n"
NOTHING = "uint8 structure_needs_at_least_one_member\n"


def main():
    parser = argparse.ArgumentParser(description="Writes the ROS 2 messages of crates/ros a second time.")
    parser.add_argument("root", type=pathlib.Path)
    parser.add_argument("--write", action="store_true", help="replace hashes and bytes that differ")
    arguments = parser.parse_args()
    file = arguments.root / "crates/ros/tests/reference/messages.json"
    cases = json.loads(file.read_text())
    store = types(arguments.root / "ros2/teleclay_msgs")
    differing = []
    for case in cases:
        name = case["name"]
        computed = {"hash": store.hash_rihs01(name)}
        if "values" in case:
            computed["cdr"] = bytes(store.serialize_cdr(message(store, name, case["values"]), name)).hex()
        for key, value in computed.items():
            if case.get(key) != value:
                differing.append(f"{name}: {key} is {case.get(key)}, computed {value}")
        case.update(computed)
    missing = {name for name in store.fielddefs if name.startswith("teleclay_msgs/") and "_Event" not in name}
    missing -= {case["name"] for case in cases}
    differing += [f"{name} is not compared" for name in sorted(missing)]
    for difference in differing:
        print(difference)
    print(f"{file.name}: {len(cases)} messages written again, {len(differing)} differ")
    if arguments.write:
        file.write_text("[\n" + ",\n".join(json.dumps(case) for case in cases) + "\n]\n")
    elif differing or not cases:
        sys.exit(1)


def types(package):
    store = get_typestore(Stores.ROS2_JAZZY)
    store.fielddefs.pop("service_msgs/msg/ServiceEventInfo")
    store.register(get_types_from_msg(EVENT_INFO, "service_msgs/msg/ServiceEventInfo"))
    for file in sorted((package / "msg").glob("*.msg")):
        store.register(get_types_from_msg(file.read_text(), f"teleclay_msgs/msg/{file.stem}"))
    services = dict(SERVICES)
    for file in (package / "srv").glob("*.srv"):
        services[f"teleclay_msgs/srv/{file.stem}"] = file.read_text()
    for name, text in services.items():
        request, response = (half or NOTHING for half in text.split("---\n"))
        # rosbags reads no services, so their three parts are put together here.
        for suffix, half in (("_Request", request), ("_Response", response)):
            ((_, fields),) = get_types_from_msg(half, name.replace("/srv/", "/msg/")).values()
            store.register({name + suffix: ([], fields)})
        one, some = ((lambda of: (Nodetype.NAME, of)), (lambda of: (Nodetype.SEQUENCE, ((Nodetype.NAME, of), 1))))
        event = [("info", one("service_msgs/msg/ServiceEventInfo"))]
        event += [(part.lower(), some(f"{name}_{part}")) for part in ("Request", "Response")]
        whole = [(f"{part.lower()}_message", one(f"{name}_{part}")) for part in ("Request", "Response", "Event")]
        store.register({f"{name}_Event": ([], event)})
        store.register({name: ([], whole)})
    return store


def message(store, name, values):
    """Makes a message of its class from numbers, texts, lists and nested dictionaries."""
    def made(description, value):
        kind, about = description
        if kind.name == "BASE":
            return value
        if kind.name == "NAME":
            return message(store, about, value)
        inner, _ = about
        if inner[0].name == "BASE":
            return numpy.array(value, dtype=inner[1][0])
        return [made(inner, one) for one in value]

    fields = store.fielddefs[name][1]
    assert {field for field, _ in fields} == set(values), f"{name}: {sorted(values)}"
    return store.types[name](**{field: made(description, values[field]) for field, description in fields})


if __name__ == "__main__":
    main()
