"""Reads recordings with other people's readers: mcap, and mcap-ros2-support for the messages.

    python recordings.py RECORD REPLAY SERVER

RECORD is the example `record` of teleclay-replay, REPLAY and SERVER are the programs teleclay-replay and
teleclay-server.

    virtual   a minute of two tools that cut, on virtual time: each topic has a message for each tick, each message can
              be decoded, and the replay gives the clay
    live      a recording of a server that runs, from its beginning to its end, over HTTP
    killed    the same of a server that is killed while it records: all but the last second is there
    minute    only with --handle HANDLE: a minute of a server in which the program teleclay-handle cuts

At random moments of each, `teleclay-replay --at-s` has to tell what these readers find there. Exits with 0 when
everything agrees.
"""

import argparse
import json
import math
import pathlib
import random
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
    parser.add_argument("--handle", help="also record a minute in which this program, teleclay-handle, cuts")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        check_virtual(arguments, pathlib.Path(folder))
        check_live(arguments, pathlib.Path(folder))
        check_killed(arguments)
        if arguments.handle:
            check_minute(arguments, pathlib.Path(folder))


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
    compared = check_moments(arguments, path)
    print(f"virtual: {sum(counts.values())} messages on {len(counts)} topics decoded, the clay comes out, {compared} numbers of moments are theirs")


# What a moment tells of a tool: where its numbers begin, and where they stand in which topic's messages.
TOLD = [
    (0, "hand_wrench", lambda message: xyz(message.wrench.force)),
    (3, "felt_wrench", lambda message: xyz(message.wrench.force)),
    (6, "tool_wrench", lambda message: xyz(message.wrench.force)),
    (9, "handle_pose", lambda message: xyz(message.pose.position)),
    (12, "tool_pose", lambda message: xyz(message.pose.position)),
    (15, "handle_twist", lambda message: xyz(message.twist.linear)),
    (18, "tool_twist", lambda message: xyz(message.twist.linear)),
    (21, "energy", lambda message: [message.handle_j, message.tool_j]),
    (23, "link", lambda message: [message.rtt_s]),
    (24, "corrections", lambda message: [message.step_n, message.held_n]),
    (26, "link", lambda message: [message.age_s]),
]


def xyz(vector):
    return [vector.x, vector.y, vector.z]


def check_moments(arguments, path, count=24):
    """What is shown of a recording at random moments is what these readers find there."""
    first = last = None
    with open(path, "rb") as file:
        for _, _, message in NonSeekingReader(file).iter_messages(log_time_order=False):
            first = message.log_time if first is None else first
            last = message.log_time
    chance = random.Random(13)
    # Milliseconds are ticks, so that no moment falls between a float and its neighbour.
    moments_s = sorted(chance.randrange((last - first) // 1_000_000) / 1000 for _ in range(count))
    flags = [flag for at_s in moments_s for flag in ["--at-s", str(at_s)]]
    told = subprocess.run([arguments.replay, path, *flags], check=True, capture_output=True, text=True).stdout.splitlines()
    require(len(told) == count, f"{len(told)} moments are told of {count}")
    waiting = [(first + round(at_s * 1e9), json.loads(line)) for at_s, line in zip(moments_s, told)]
    latest, compared = {}, 0
    with open(path, "rb") as file:
        for _, channel, message, decoded in NonSeekingReader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages(log_time_order=False):
            while waiting and waiting[0][0] < message.log_time:
                compared += compare(waiting.pop(0)[1], latest)
            latest[channel.topic.split("/", 3)[3] if channel.topic.count("/") > 2 else channel.topic] = decoded
    for _, moment in waiting:
        compared += compare(moment, latest)
    require(0 < compared, "no number was compared")
    return compared


def compare(moment, latest):
    """How many numbers of a moment are the ones that were found."""
    require(moment["tick"] == latest["ticks"].tick, f"tick {moment['tick']} is told, {latest['ticks'].tick} is found")
    compared = 0
    for tool in moment["tools"]:
        for at, topic, numbers in TOLD:
            message = latest.get(f"tool_{tool['tool']}/{topic}")
            found = [None] * 3 if message is None else [number if math.isfinite(number) else None for number in numbers(message)]
            shown = tool["values"][at : at + len(found)]
            if message is not None:
                require(shown == found, f"tick {moment['tick']}: {topic} is shown as {shown}, and is {found}")
                compared += len(found)
    return compared


def ask(address, method, path, body=None):
    content = json.dumps(body).encode() if body is not None else None
    headers = {"Content-Type": "application/json"} if content else {}
    request = urllib.request.Request(f"http://{address}/api/v1/sessions/demo{path}", content, headers, method=method)
    with urllib.request.urlopen(request, timeout=PATIENCE_S) as answer:
        return answer.read()


def until_it_has(address, ticks, patience_s=PATIENCE_S):
    """Waits until a recording has so many ticks."""
    began = time.monotonic()
    while True:
        (recording,) = json.loads(ask(address, "GET", "/recordings"))
        if ticks <= recording["ticks"]:
            return recording
        require(time.monotonic() - began < patience_s, f"{recording} after {patience_s} s")
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


def check_minute(arguments, folder):
    path, data = folder / "minute.mcap", folder / "data"
    with running(arguments.server, TELECLAY_DATA_DIR=str(data)) as address:
        # As `running` places it.
        zenoh = f"tcp/127.0.0.1:{int(address.rsplit(':', 1)[1]) + 1}"
        handle = subprocess.Popen([arguments.handle, "--connect", zenoh, "--session", "demo", "--device", "simulated", "--intent", "cutting"])
        try:
            ask(address, "POST", "/recordings", {"name": "minute"})
            until_it_has(address, 60_000, 90)
            ended = json.loads(ask(address, "POST", "/recordings/minute/stop"))
        finally:
            handle.terminate()
            handle.wait()
        path.write_bytes(ask(address, "GET", "/recordings/minute.mcap"))
        part = ask_part(address, "/recordings/minute.mcap", 1000, 1999)
    require(path.read_bytes()[1000:2000] == part, "a range of bytes is another one")
    counts = Counter()
    with open(path, "rb") as file:
        for _, channel, _, _ in make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages():
            counts[channel.topic] += 1
    require(abs(counts["/diagnostics"] - len(ticks_of(path)) / 1000) <= 1, f"{counts['/diagnostics']} messages of diagnostics")
    require(counts["/teleclay/demo/ticks"] == ended["ticks"], f"{counts['/teleclay/demo/ticks']} ticks are in the file, {ended['ticks']} as told")
    ticks = ticks_of(path)
    require(ticks[-1] - ticks[0] + 1 == len(ticks) + ended["dropped"], "ticks are missing that nobody counts")
    held = {topic: counts[f"/teleclay/demo/tool_1/{topic}"] for topic in SHOWN}
    require(len(set(held.values())) == 1 and 0 < held["tool_pose"] <= len(ticks), f"a tool is shown unevenly: {held}")
    verified = subprocess.run([arguments.replay, path, "--verify"], capture_output=True, text=True)
    require(verified.returncode == 0, f"the replay: {verified.stdout}{verified.stderr}")
    compared = check_moments(arguments, path)
    hashes = check_history(arguments, path, data)
    print(
        f"minute: {len(ticks)} ticks, {ended['dropped']} dropped, {held['tool_pose']} messages of each topic of the tool, "
        f"{sum(counts.values())} in all, {path.stat().st_size} bytes, {compared} numbers of moments are theirs, {hashes} clays the history's\n{verified.stdout}"
    )


def check_history(arguments, path, data):
    """The clay of a moment of a recording is the one that the session's own files lead to at that tick."""
    moments_s = [1, 7.5, 20.25, 33.125, 48, 59.5]
    told = subprocess.run([arguments.replay, path, *(flag for at_s in moments_s for flag in ["--at-s", str(at_s)])], check=True, capture_output=True, text=True)
    hashes = set()
    for line in told.stdout.splitlines():
        moment = json.loads(line)
        command = [arguments.server, "history", "demo", "--data-dir", data, "--at-s", str(moment["tick"] / 1000)]
        history = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        require(f"hash {moment['clay']['hash']}," in history, f"tick {moment['tick']} has the clay {moment['clay']['hash']}, and the history: {history}")
        hashes.add(moment["clay"]["hash"])
    require(len(hashes) == len(moments_s), "the clay is the same at several moments: nothing was cut")
    return len(hashes)


def ask_part(address, path, first, last):
    """Bytes of a file by a range."""
    request = urllib.request.Request(f"http://{address}/api/v1/sessions/demo{path}", headers={"Range": f"bytes={first}-{last}"})
    with urllib.request.urlopen(request, timeout=PATIENCE_S) as answer:
        size = answer.headers["Content-Range"]
        require(answer.status == 206 and size.startswith(f"bytes {first}-{last}/"), f"a range is answered {answer.status}, {size}")
        return answer.read()


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
