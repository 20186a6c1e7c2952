"""A running server: the same values to the last bit, its errors in its own words, and its telemetry."""

import json
import pathlib

import numpy as np
import pytest

import teleclay
from teleclay import clay, control, kinematics, sim

VECTORS = pathlib.Path(__file__).parents[2] / "proto/vectors/telemetry.json"


def same(ours, theirs):
    """To the last bit; zeros of either sign are told apart."""
    ours, theirs = np.asarray(ours, dtype=np.float64), np.array(theirs, dtype=np.float64)
    return ours.shape == theirs.shape and ours.tobytes() == theirs.tobytes()


def test_the_robot_is_the_servers_bit_by_bit(client, random):
    positions_m = random.uniform([-0.03, -0.03, 0.11], [0.03, 0.03, 0.2], (25, 3))
    every = kinematics.inverse(positions_m)
    forward = kinematics.forward(every[:, 3])
    elbows = kinematics.elbows(every[:, 3])
    slope = kinematics.jacobian(positions_m)
    for number, position_m in enumerate(positions_m):
        answer = client.theory("kinematics/inverse", position_m=position_m)
        assert same(every[number], [branch["joints_rad"] for branch in answer["branches"]])
        assert [branch["branch"] for branch in answer["branches"]] == kinematics.BRANCHES.tolist()
        answer = client.theory("kinematics/forward", joints_rad=every[number, 3])
        assert same(forward[number], answer["positions_m"]) and same(elbows[number], answer["elbows_m"])
        answer = client.theory("kinematics/jacobian", position_m=position_m, branch=[-1, -1, -1])
        assert answer.keys() == set(slope._fields)
        assert all(same(getattr(slope, name)[number], answer[name]) for name in slope._fields)


def test_another_robot_and_a_map_are_too(client):
    geometry = {"base_radius_m": 0.1, "platform_radius_m": 0.03, "upper_link_m": 0.11, "lower_link_m": 0.19, "arm_angles_deg": [7, 125, 250]}
    own = kinematics.Geometry(**geometry)
    answer = client.theory("kinematics/inverse", geometry=geometry, position_m=[0.01, 0.02, 0.15])
    assert same(kinematics.inverse([0.01, 0.02, 0.15], own), [branch["joints_rad"] for branch in answer["branches"]])
    answer = client.theory("kinematics/workspace", geometry=geometry, cells=[6, 5, 4])
    found = kinematics.workspace((6, 5, 4), geometry=own)
    assert same(found.dexterity.reshape(-1), answer["dexterity"])
    assert found.reachable_volume_m3 == answer["reachable_volume_m3"]


def test_a_loop_is_the_servers_bit_by_bit(client):
    loop = control.paper_loop(clay_damping_n_s_per_m=60.0, omegas_rad_s=[0.5, 5.0])
    answer = client.theory("analysis/loop", **loop)
    found = control.analyse(**loop)
    poles = found.pop("closed_loop_poles")
    assert same(np.stack([poles.real, poles.imag], axis=-1), answer.pop("closed_loop_poles"))
    points = answer.pop("compensators")
    for name, values in found.pop("compensators").items():
        wanted = [point[name] for point in points]
        assert same(values if name == "omega_rad_s" else np.stack([values.real, values.imag], axis=-1), wanted)
    del found["nyquist"]["value"]
    compare(found, answer)
    compare(sim.cutting(trace_samples=128), client.theory("experiments/cutting", **experiment(), trace_samples=128))


def experiment():
    names = ("virtual_mass_kg", "virtual_damping_n_s_per_m", "position_ratio", "force_ratio", "hand_force_n", "edges_m", "clay_damping_n_s_per_m")
    return {name: control.PAPER[name] for name in names}


def compare(ours, theirs):
    if isinstance(theirs, dict):
        assert ours.keys() == theirs.keys()
        for name, value in theirs.items():
            compare(ours[name], value)
    elif isinstance(ours, np.ndarray):
        assert same(ours, theirs)
    else:
        assert ours == theirs


def test_clay_is_the_servers_bit_by_bit(client, session):
    spec = client.session(session)["clay"]
    made = clay.Clay({"kind": "block", "size_m": [0.064, 0.064, 0.032]}, 1e-3)
    assert made.hash == spec["hash"]
    assert made.stl() == client.clay(session, "stl")
    assert client.clay(session, "3mf")[:2] == b"PK"


def test_a_session_lives_as_it_is_told(client, session):
    assert session in [known["id"] for known in client.sessions()]
    assert client.patch(session, deadband=0.07, material={"viscosity_pa_s_per_m": 1e5})["deadband"] == 0.07
    assert client.session(session)["material"]["viscosity_pa_s_per_m"] == 1e5
    client.stop(session, reason="a test")
    assert client.session(session)["stop"]["reason"] == "a test"
    client.clear_stop(session)
    assert client.session(session)["state"] == "idle"
    assert client.history(session)["strokes"] == []
    assert client.duplicate(session, "a-twin")["id"] == "a-twin"
    client.delete("a-twin")


def test_problems_are_raised_in_the_servers_words(client, session):
    with pytest.raises(teleclay.Problem, match="/network/up/delay_s") as problem:
        client.patch(session, network={"up": {"delay_s": 3}})
    assert (problem.value.status, problem.value.type, problem.value.pointer) == (422, "/problems/field", "/network/up/delay_s")
    assert "3 is not a number from 0 to 2" in problem.value.detail
    with pytest.raises(teleclay.Problem) as problem:
        client.session("nobody")
    assert problem.value.status == 404 and "nobody" in problem.value.detail
    with pytest.raises(teleclay.Problem):
        next(client.telemetry("nobody"))
    with pytest.raises(ValueError, match="no address of a server"):
        teleclay.Client("demo")


def test_a_token_opens_the_door(program):
    from described import running

    with running(program, TELECLAY_TOKEN="a token of good length") as address:
        with pytest.raises(teleclay.Problem) as problem:
            teleclay.Client(f"http://{address}").sessions()
        assert problem.value.status == 401 and "a token is needed" in str(problem.value)
        client = teleclay.Client(f"http://{address}", "a token of good length")
        assert client.create("mine")["id"] == "mine"
        # Nobody holds a tool, so there is nothing to tell; the stream opens all the same.
        assert list(client.telemetry("mine", duration_s=0.3)) == []
        with pytest.raises(teleclay.Problem, match="401"):
            next(teleclay.Client(f"http://{address}", "another").telemetry("mine"))


def test_telemetry_is_read_as_the_specification_lays_it_out():
    for case in json.loads(VECTORS.read_text())["cases"]:
        wanted = case["value"]
        batch = teleclay.client.decode_telemetry(bytes.fromhex(case["hex"]))
        assert (batch.tool, batch.dropped) == (wanted["tool"], wanted["dropped"])
        times_s = wanted["first_time_s"] + wanted["period_us"] * 1e-6 * np.arange(len(wanted["samples"]))
        np.testing.assert_array_equal(batch.time_s, times_s)
        for number, sample in enumerate(wanted["samples"]):
            for name, value in sample.items():
                np.testing.assert_array_equal(getattr(batch, name)[number], np.float32(value), err_msg=name)
    with pytest.raises(ValueError, match="version"):
        teleclay.client.decode_telemetry(b"TC\x09\x01" + bytes(28))
