"""The loop on virtual time."""

import threading
import time

import numpy as np
import pytest

from teleclay import clay, sim
from teleclay.sim import Heard, HandlePort, Line, Rig, Said, Scheme, ToolPort

LINE = {"delay_s": 0.02, "jitter_s": 0.004, "loss": 0.05}
NETWORK = {"up": LINE | {"seed": 3}, "down": LINE | {"seed": 4}}


def cutting_rig(scheme, **fields):
    rig = Rig(scheme, tool=clay.ball(0.006), **fields)
    rig.intend_cutting((0.04, 0.015, 0.008))
    return rig


def test_the_same_seed_gives_the_same_bits():
    first, second = (cutting_rig("tdpa", network=NETWORK).run(3.0) for _ in range(2))
    np.testing.assert_array_equal(first.felt_force_n, second.felt_force_n)
    other = cutting_rig("tdpa", network=NETWORK | {"up": LINE | {"seed": 5}}).run(3.0)
    assert (first.felt_force_n != other.felt_force_n).any()


def test_a_copy_is_the_servers_clay_once_the_line_is_drained():
    rig = cutting_rig("replica", network=NETWORK)
    rig.run(4.0)
    # The arm swings for a while, and cuts.
    rig.intend_rest()
    rig.run(6.0)
    copy, authority = rig.hashes
    assert copy == authority == rig.clay.hash
    assert 0 < rig.clay.removed_units
    assert cutting_rig("wave").hashes[0] is None


def test_the_hand_moves_as_it_is_pushed():
    rig = Rig("force_exchange", parameters={"home_m": [0.064, 0.032, 0.15]}, tool=clay.ball(0.006))
    rig.intend_force([2.0, 0, 0], at_sensor=True)
    record = rig.run(2.0)
    # B v = f, far above the clay; a little later the tool is at the end of its reach.
    np.testing.assert_allclose(record.handle_velocity_m_s[800, 0], 2.0 / 10.0, rtol=1e-3)
    np.testing.assert_allclose(np.diff(record.time_s), 1e-3, rtol=1e-9)
    assert record.tool_force_n.any() == 0 == rig.clay.removed_units
    fewer = rig.run(0.5, every=10)
    assert fewer.time_s.shape == (50,)


def test_ten_seconds_take_less_than_a_hundredth_of_it():
    rig = cutting_rig("force_exchange", network=NETWORK)
    rig.run(0.1)
    began_s = time.thread_time()
    record = rig.run(10.0)
    took_s = time.thread_time() - began_s
    assert record.time_s.shape == (10_000,)
    print(f"10 s of the loop took {took_s * 1e3:.1f} ms of a processor: {10 / took_s:.0f} x real time")
    assert took_s < 0.1


def test_a_run_leaves_pythons_lock_to_others():
    rig = cutting_rig("replica", network=NETWORK)
    turns, ends = [0], threading.Event()

    def count():
        while not ends.is_set():
            turns[0] += 1

    other = threading.Thread(target=count)
    other.start()
    before = turns[0]
    rig.run(20.0, every=1000)
    counted = turns[0] - before
    ends.set()
    other.join()
    # With the lock held there would be none: a run gives it back once in 20 s of virtual time.
    assert 1000 < counted


def test_settings_change_as_a_patch_does():
    rig = cutting_rig("force_exchange")
    rig.patch(scheme="wave", material={"viscosity_pa_s_per_m": 1e5})
    rig.run(0.1)
    assert rig.parameters["scheme"] == "wave" and rig.parameters["material"]["viscosity_pa_s_per_m"] == 1e5
    with pytest.raises(ValueError, match="scheme"):
        rig.patch(scheme="telepathy")


def test_what_is_no_rig_is_refused():
    with pytest.raises(ValueError, match="/network/up/delay_s"):
        Rig(network={"up": {"delay_s": 3.0}})
    with pytest.raises(ValueError, match="virtual_mass_kg"):
        Rig(parameters={"virtual_mass_kg": 0.0})
    with pytest.raises(ValueError, match="waypoint 1"):
        Rig().intend_path([[0, 0, 0], [0, 0, np.nan]])


class PositionForce(Scheme):
    """The built-in scheme of that name, told once more."""

    def __init__(self):
        self.force_n = self.position_m = np.zeros(3)

    def handle(self, port: HandlePort, heard: Heard | None) -> Said:
        if heard is not None:
            self.force_n = heard.force_n
        return Said(self.force_n)

    def tool(self, port: ToolPort, heard: Heard | None) -> Said:
        if heard is not None:
            self.position_m = heard.position_m
        return Said(self.position_m)

    def restart(self, handle_position_m):
        self.position_m = handle_position_m


def test_a_scheme_in_python_is_the_same_scheme_in_rust_bit_by_bit():
    # As a scheme of one's own is, the built-in one is changed to before the first tick.
    rig = cutting_rig("force_exchange", network=NETWORK)
    rig.patch(scheme="position_force")
    ours, own = rig.run(3.0), cutting_rig(PositionForce(), network=NETWORK).run(3.0)
    assert np.abs(ours.felt_force_n).max() > 0.1
    for name in ("felt_force_n", "handle_position_m", "tool_position_m"):
        np.testing.assert_array_equal(getattr(own, name), getattr(ours, name), err_msg=name)


def test_what_an_end_says_along_reaches_the_other_end_a_delay_later():
    heard_at_s = []

    class Clocks(PositionForce):
        def handle(self, port, heard):
            return super().handle(port, heard)._replace(first=[port.now_s, 0, 0])

        def tool(self, port, heard):
            if heard is not None:
                heard_at_s.append((heard.first[0], port.now_s))
            return super().tool(port, heard)

    rig = cutting_rig(Clocks(), network={"up": {"delay_s": 0.03}, "down": {}})
    rig.run(0.5)
    sent_s, came_s = np.array(heard_at_s[50:]).T
    assert 300 < sent_s.size
    np.testing.assert_allclose(came_s - sent_s, 0.03, atol=1e-9)


def test_a_scheme_that_fails_ends_the_run_with_its_own_error():
    class Broken(PositionForce):
        def tool(self, port, heard):
            if 0.2 < port.now_s:
                raise KeyError("lost")
            return super().tool(port, heard)

    with pytest.raises(KeyError, match="lost"):
        cutting_rig(Broken()).run(1.0)

    class Numberless(PositionForce):
        def handle(self, port, heard):
            return Said([np.nan, 0, 0])

    with pytest.raises(ValueError, match="NaN for number 0"):
        cutting_rig(Numberless()).run(1.0)


def test_rows_of_the_latency_table():
    lines = sim.latency_lines("quick")
    assert Line(25) in lines and all(line.profile != "second_writer" for line in lines)
    still = sim.latency_row("replica", Line(0), [1])
    assert still["force_nrmse"] == 0 and still["stable"]
    ours = sim.latency_row("position_force", Line(5), [1, 2])
    own = sim.latency_row(PositionForce, Line(5), [1, 2])
    assert own.pop("scheme") == "PositionForce" and ours.pop("scheme") == "position_force"
    # One begins with its scheme, the other changes to it before the first tick.
    assert 0.1 < ours["force_nrmse"]
    for name in ("force_nrmse", "position_rmse_m", "coordination_rmse_m", "removed_volume_error"):
        assert abs(own[name] / ours[name] - 1) < 1e-4, name
    with pytest.raises(ValueError, match="second writer"):
        sim.latency_row(PositionForce, Line(5, profile="second_writer"), [1])


def test_the_experiment_gives_the_papers_plateaus():
    answer = sim.cutting(trace_samples=256)
    np.testing.assert_allclose(answer["plateau_velocity_m_s"], [2 / 30, 2 / 50, 2 / 70], rtol=1e-12)
    np.testing.assert_allclose(answer["simulated_velocity_m_s"], answer["plateau_velocity_m_s"], rtol=0.02)
    assert answer["trace"]["t_s"].shape == answer["trace"]["velocity_m_s"].shape
