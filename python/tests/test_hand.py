"""A hand that a law of Python's moves, at a running server. A machine that others use may hold any thread up for a while,
so laws that are to do well have all the patience there is."""

import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import teleclay
from teleclay import Force, LawFailed, Place
from teleclay.hand import GRASPS, LINKS

HELD = GRASPS.index("held")
ABOVE_M = 0.01


class Kept:
    """Calls a law, keeps what it saw, and ends once that is what is waited for."""

    def __init__(self, law, is_done):
        self.law, self.is_done, self.batches = law, is_done, []

    def __call__(self, batch):
        self.batches.append(batch)
        if self.is_done(self):
            raise StopIteration
        return self.law(batch)

    def all(self, name):
        return np.concatenate([getattr(batch, name) for batch in self.batches])

    def last(self, name, rows):
        """As many of the last rows, or none where there are not so many yet."""
        newest = self.batches[-(rows + 1) :]
        values = np.concatenate([getattr(batch, name) for batch in newest])
        return values[-rows:] if rows <= len(values) else values[:0]


def run(url, session, law, is_done):
    kept = Kept(law, is_done)
    report = teleclay.operate(url, session, kept, duration_s=60, patience_s=1.0)
    assert kept.is_done(kept), "it did not come to that within a minute"
    return kept, report


def is_free(client, session):
    """Whether nobody holds the tool: the server shows it within a fraction of a second."""
    ends_s = time.monotonic() + 10
    while client.session(session)["tools"][0]["operator"]:
        if ends_s < time.monotonic():
            return False
    return True


def test_a_place_is_gone_to(client, session, url):
    def is_there(kept):
        off_m = np.abs(kept.last("position_m", 200)[:, :2] - [0.02, -0.01])
        return 0 < len(off_m) and off_m.max() < 2e-4 and (kept.last("grasp", 200) == HELD).all()

    kept, report = run(url, session, lambda batch: Place([0.02, -0.01, ABOVE_M]), is_there)
    assert report.reason == "it was asked to leave" and report.tool == 1
    # The law saw every tick, and every one that was owed was made or counted.
    ticks = kept.all("ticks").sum() + report.counts["given_up"]
    assert abs(ticks - 1e3 * kept.all("time_s")[-1]) < 200
    assert kept.batches[-1].dropped == 0
    assert is_free(client, session)


@pytest.mark.parametrize("stiffness_n_per_m", [150.0, 50.0], ids=["stiff", "soft"])
def test_a_spring_is_as_stiff_as_told(client, session, url, stiffness_n_per_m):
    """Force over stretch, and beside it the coupling's damper, 5 N s/m at its own stiffness and softer with it."""

    def goal_m(time_s):
        return np.where(time_s % 2 < 1, 0.02, -0.02)

    def stretched(kept):
        # On the way, when the hand itself has arrived, and the thread was not held up for a while.
        time_s = kept.all("time_s")
        is_even = (kept.all("grasp") == HELD) & (kept.all("ticks") < 4)
        uneven_s = np.maximum.accumulate(np.where(is_even, 0.0, time_s))
        return (0.25 < time_s - uneven_s) & (0.25 < time_s % 1) & (1 < time_s)

    def law(batch):
        return Place([goal_m(batch.time_s[-1]), 0, ABOVE_M], stiffness_n_per_m)

    kept, _ = run(url, session, law, lambda kept: 1200 < stretched(kept).sum())
    rows = stretched(kept)
    stretch_m = goal_m(kept.all("time_s")[rows]) - kept.all("position_m")[rows, 0]
    against = np.stack([stretch_m, -kept.all("velocity_m_s")[rows, 0]], axis=-1)
    (found, damper), *_ = np.linalg.lstsq(against, kept.all("hand_force_n")[rows, 0])
    print(f"told {stiffness_n_per_m} N/m, found {found:.1f} N/m and {damper:.1f} N s/m beside it")
    assert abs(found / stiffness_n_per_m - 1) < 0.15
    assert 0 < damper < 8


def test_a_force_is_pushed_and_capped(client, session, url):
    def is_even(kept):
        pushed_n = kept.last("hand_force_n", 200)[:, 0]
        return 0 < len(pushed_n) and np.abs(pushed_n - 0.5).max() < 0.02

    run(url, session, lambda batch: Force([0.5, 0, 0]), is_even)
    kept, _ = run(url, session, lambda batch: Force([1e6, 0, 0]), lambda kept: 5 < kept.all("hand_force_n").max())
    forces_n = np.linalg.norm(kept.all("hand_force_n"), axis=-1)
    assert forces_n.max() <= 20.0 + 1e-9
    assert (np.abs(np.diff(forces_n)) <= 2.0 * kept.all("ticks")[1:] + 1e-9).all()
    assert np.abs(kept.all("velocity_m_s")).max() <= 2.0 + 1e-9


def strokes(batch):
    return Place([0.015 * np.sin(3 * batch.time_s[-1]), 0, -0.004])


def has_cut(kept):
    return 0.01 < np.abs(kept.all("felt_force_n")).max() and 0.01 < np.ptp(kept.all("position_m")[:, 0])


def test_a_hand_that_cuts_is_seen_by_those_who_watch(client, session, url):
    seen = []

    def watch():
        for batch in client.telemetry(session, duration_s=60):
            seen.append(batch)
            if 0.008 < np.ptp(np.concatenate([batch.handle_position_m for batch in seen])[:, 0]):
                return

    watcher = threading.Thread(target=watch)
    watcher.start()
    kept, _ = run(url, session, strokes, lambda kept: has_cut(kept) and not watcher.is_alive())
    watcher.join()
    handle_m = np.concatenate([batch.handle_position_m for batch in seen])
    # What the server tells lies within what the hand did.
    assert kept.all("position_m")[:, 0].min() - 1e-4 < handle_m[:, 0].min()
    assert handle_m[:, 0].max() < kept.all("position_m")[:, 0].max() + 1e-4
    assert 0 < client.session(session)["clay"]["removed_volume_m3"]
    assert len(client.history(session)["strokes"]) >= 1


def test_a_replicas_copy_comes_and_is_cut(client, session, url):
    client.patch(session, scheme="replica")
    kept, _ = run(url, session, strokes, has_cut)
    assert LINKS.index("on_copy") in kept.all("link") or LINKS.index("live") in kept.all("link")
    assert is_free(client, session)
    assert 0 < client.session(session)["clay"]["removed_volume_m3"]


def test_none_lets_go_and_the_law_may_end_it(client, session, url):
    pushed = []

    def law(batch):
        pushed.extend(batch.hand_force_n[0.2 < batch.hand_force_n[:, 0]])
        return None if pushed else Force([0.5, 0, 0])

    def is_off(kept):
        rows = kept.last("grasp", 100)
        return 0 < len(pushed) and 0 < len(rows) and (rows == GRASPS.index("released")).all()

    kept, _ = run(url, session, law, is_off)
    assert (kept.last("hand_force_n", 50) == 0).all()
    assert is_free(client, session)


@pytest.mark.parametrize(
    ("gives", "says"),
    [
        (lambda: 1 / 0, "ZeroDivisionError"),
        (lambda: Place([np.nan, 0, 0]), "position_m holds NaN"),
        (lambda: Force([0, np.inf, 0]), "force_n holds inf"),
        (lambda: Place([0, 0]), "3 numbers"),
        (lambda: "go there", "Place, a Force or None"),
    ],
    ids=["raises", "nan", "infinite", "short", "word"],
)
def test_a_law_that_fails_lets_go_and_says_so(client, session, url, gives, says):
    calls = []

    def law(batch):
        calls.append(batch)
        return gives() if (batch.grasp == HELD).any() else Force([0.5, 0, 0])

    with pytest.raises(LawFailed, match="the hand was let go of") as failed:
        teleclay.operate(url, session, law, patience_s=1.0)
    assert says in str(failed.value)
    assert (calls[-1].grasp == HELD).any()
    assert is_free(client, session)


def test_a_law_that_never_returns_lets_go_and_says_so(client, session, url):
    forever = threading.Event()

    def law(batch):
        if 0.5 < batch.time_s[-1]:
            forever.wait()
        return Force([0.5, 0, 0])

    began_s = time.monotonic()
    with pytest.raises(LawFailed, match=r"the law said nothing for 0\.\d+ s, so the hand was let go of"):
        teleclay.operate(url, session, law, patience_s=0.2)
    assert time.monotonic() - began_s < 30
    assert is_free(client, session)
    forever.set()


KEEPS_THE_LOCK = """
import sys, teleclay

def law(batch):
    if 0.5 < batch.time_s[-1]:
        sum(range(10**11))  # One call of C, which keeps Python's lock for minutes.
    return teleclay.Force([0.5, 0, 0])

teleclay.operate(sys.argv[1], sys.argv[2], law, patience_s=0.2)
"""


def test_a_law_that_keeps_pythons_lock_for_ever_cannot_keep_the_hand(client, session, url):
    stuck = subprocess.Popen([sys.executable, "-c", KEEPS_THE_LOCK, url, session], stderr=subprocess.PIPE, text=True)
    try:
        # The thread of Rust says it, as no Python can.
        assert "the hand was let go of" in stuck.stderr.readline()
        assert is_free(client, session)
        assert stuck.poll() is None
    finally:
        stuck.kill()
        stuck.wait()


def test_a_law_that_keeps_the_lock_for_a_while_costs_the_loop_nothing(client, session, url):
    kept_s = []

    def law(batch):
        if not kept_s and 0.5 < batch.time_s[-1]:
            began_s = time.monotonic()
            sum(range(5 * 10**6))  # One call of C.
            kept_s.append(time.monotonic() - began_s)
        return Place([0.01, 0, ABOVE_M])

    kept, _ = run(url, session, law, lambda kept: kept_s and kept_s[0] < kept.batches[-1].time_s[-1] - 0.6)
    assert 0.02 < kept_s[0]
    longest = max(kept.batches, key=lambda batch: batch.time_s[-1] - batch.time_s[0])
    # All that the loop did while the law sat on the lock came in one batch, wake by wake: it was not held up with it.
    assert 0.8 * kept_s[0] < longest.time_s[-1] - longest.time_s[0]
    assert 20 < len(longest.time_s) and np.diff(longest.time_s).max() < 0.5 * kept_s[0]


def test_a_tool_that_somebody_holds_is_not_granted(client, session, url):
    def law(batch):
        if batch.time_s[-1] < 0.3:
            return None
        with pytest.raises(teleclay.NotGranted, match="refused: "):
            teleclay.operate(url, session, lambda batch: None)
        raise StopIteration

    teleclay.operate(url, session, law, patience_s=1.0)


def test_a_stop_ends_the_hand(client, session, url):
    def law(batch):
        if 0.5 < batch.time_s[-1] < 0.7:
            client.stop(session, reason="enough")
        return Force([0.5, 0, 0])

    with pytest.raises(teleclay.HandLost, match="enough"):
        teleclay.operate(url, session, law, patience_s=1.0)
    client.clear_stop(session)


def test_whom_not_to_ask_is_said(url):
    def law(batch):
        return None

    with pytest.raises(teleclay.NotGranted, match="404"):
        teleclay.operate(url, "nobody", law)
    with pytest.raises(ValueError, match="in the clear"):
        teleclay.operate("http://192.0.2.1:8080", "demo", law)
    with pytest.raises(ValueError, match="doors/authority.pem"):
        teleclay.operate("https://127.0.0.1:1", "demo", law)
    with pytest.raises(ConnectionError):
        teleclay.operate("http://127.0.0.1:1", "demo", law)
    with pytest.raises(ValueError, match="patience_s"):
        teleclay.operate(url, "demo", law, patience_s=10)
