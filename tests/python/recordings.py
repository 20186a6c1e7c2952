"""Reads recordings with other people's readers: mcap, and mcap-ros2-support for the messages.

    python recordings.py RECORD REPLAY SERVER

RECORD is the example `record` of teleclay-replay, REPLAY and SERVER are the programs teleclay-replay and
teleclay-server.

    virtual   a minute of two tools that cut, on virtual time: each topic has a message for each tick, each message can
              be decoded, and the replay gives the clay
    live      a recording of a server that runs, from its beginning to its end, over HTTP
    killed    the same of a server that is killed while it records: all but the last second is there

Exits with 0 when everything agrees.
"""

import argparse
import json
import pathlib
import signal
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections import Counter

from described import running
from mcap.exceptions import EndOfFile
from mcap.reader import NonSeekingReader, make_reader
from mcap_ros2.decoder import DecoderFactory

SHOWN = [
    "handle_pose", "tool_pose", "handle_twist", "tool_twist", "hand_wrench", "felt_wrench", "tool_wrench", "link", "energy", "corrections",
]  # fmt: skip
PATIENCE_S = 30


def main():
    parser = argparse.ArgumentParser(description="Reads recordings with other people's readers.")
    parser.add_argument("record")
    parser.add_argument("replay")
    parser.add_argument("server")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        check_virtual(arguments, pathlib.Path(folder))
        check_live(arguments, pathlib.Path(folder))
        check_killed(arguments)


def require(is_so, words):
    if not is_so:
        sys.exit(words)


def check_virtual(arguments, folder):
    path = folder / "virtual.mcap"
    clay = subprocess.run([arguments.record, path, "60"], check=True, capture_output=True, text=True).stdout.strip()
    counts, last = Counter(), {}
    with open(path, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        require(reader.get_header().profile == "ros2", "the profile is another one")
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            require((schema.encoding, channel.message_encoding) == ("ros2msg", "cdr"), f"{channel.topic} is encoded otherwise")
            counts[channel.topic] += 1
            last[channel.topic] = decoded
    ticks = last["/teleclay/rig/ticks"]
    require(59_900 < counts["/teleclay/rig/ticks"], f"{counts['/teleclay/rig/ticks']} ticks of 60000")
    require(ticks.dropped == 0, f"{ticks.dropped} ticks were dropped")
    for tool in [1, 2]:
        for topic in SHOWN + ["handle_frame"]:
            got = counts[f"/teleclay/rig/tool_{tool}/{topic}"]
            require(got == counts["/teleclay/rig/ticks"], f"{got} messages of {topic} in {counts['/teleclay/rig/ticks']} ticks")
    require(f"{last['/teleclay/rig/clay'].hash:016x}" == clay, "the clay at the end is another one")
    require(last["/teleclay/rig/tool_1/tool_pose"].pose.orientation.w == 1, "a tool is turned")
    require(json.loads(last["/teleclay/rig/settings"].json)["parameters"]["tick_s"] == 1e-3, "the settings tell of no loop")
    verified = subprocess.run([arguments.replay, path, "--verify"], capture_output=True, text=True)
    require(verified.returncode == 0 and clay in verified.stdout, f"the replay: {verified.stdout}{verified.stderr}")
    print(f"virtual: {sum(counts.values())} messages on {len(counts)} topics decoded, the clay comes out")


def ask(address, method, path, body=None):
    content = json.dumps(body).encode() if body is not None else None
    headers = {"Content-Type": "application/json"} if content else {}
    request = urllib.request.Request(f"http://{address}/api/v1/sessions/demo{path}", content, headers, method=method)
    with urllib.request.urlopen(request, timeout=PATIENCE_S) as answer:
        return answer.read()


def until_it_has(address, ticks):
    """Waits until a recording has so many ticks."""
    began = time.monotonic()
    while True:
        (recording,) = json.loads(ask(address, "GET", "/recordings"))
        if ticks <= recording["ticks"]:
            return recording
        require(time.monotonic() - began < PATIENCE_S, f"{recording} after {PATIENCE_S} s")
        time.sleep(0.05)


def ticks_of(path):
    """The ticks that a file has, up to wherever it ends."""
    ticks = []
    with open(path, "rb") as file:
        reader = NonSeekingReader(file, decoder_factories=[DecoderFactory()])
        try:
            for _, _, _, decoded in reader.iter_decoded_messages(topics=["/teleclay/demo/ticks"], log_time_order=False):
                ticks.append(decoded.tick)
        except EndOfFile:
            pass
    return ticks


def check_live(arguments, folder):
    path = folder / "live.mcap"
    with running(arguments.server) as address:
        ask(address, "POST", "/recordings", {"name": "live"})
        until_it_has(address, 2000)
        ended = json.loads(ask(address, "POST", "/recordings/live/stop"))
        path.write_bytes(ask(address, "GET", "/recordings/live.mcap"))
    require(ended["state"] == "ended" and ended["bytes"] == path.stat().st_size, f"{ended}")
    ticks = ticks_of(path)
    require(len(ticks) == ended["ticks"], f"{len(ticks)} ticks in the file, {ended} as told")
    require(ticks[-1] - ticks[0] + 1 == len(ticks) + ended["dropped"], "ticks are missing that nobody counts")
    verified = subprocess.run([arguments.replay, path, "--verify"], capture_output=True, text=True)
    require(verified.returncode == 0, f"the replay: {verified.stdout}{verified.stderr}")
    print(f"live: {len(ticks)} ticks, {ended['dropped']} dropped")


def check_killed(arguments):
    with tempfile.TemporaryDirectory() as data:
        with running(arguments.server, TELECLAY_DATA_DIR=data) as address:
            ask(address, "POST", "/recordings", {"name": "killed"})
            told = until_it_has(address, 3000)
            kill(arguments.server, data)
        path = pathlib.Path(data) / "recordings/demo/killed.mcap"
        ticks = ticks_of(path)
        # What was told has at most a second, and half of one for a disk that is slow, that was not synced yet.
        require(ticks and told["ticks"] - 1500 <= len(ticks), f"{len(ticks)} ticks of {told}")
        with running(arguments.server, TELECLAY_DATA_DIR=data) as address:
            (recording,) = json.loads(ask(address, "GET", "/recordings"))
        require(recording["state"] == "interrupted", f"{recording}")
        verified = subprocess.run([arguments.replay, path, "--verify"], capture_output=True, text=True)
        require(verified.returncode == 0, f"the replay: {verified.stdout}{verified.stderr}")
        print(f"killed: {len(ticks)} ticks of at least {told['ticks']}, told as interrupted")


def kill(program, data):
    """Kills the server whose data lie there."""
    for process in pathlib.Path("/proc").glob("[0-9]*"):
        try:
            environment = (process / "environ").read_bytes()
            is_it = (process / "exe").resolve() == pathlib.Path(program).resolve()
        except OSError:
            continue
        if is_it and f"TELECLAY_DATA_DIR={data}\0".encode() in environment:
            subprocess.run(["kill", f"-{signal.SIGKILL.value}", process.name], check=True)


if __name__ == "__main__":
    main()
