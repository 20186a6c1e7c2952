"""The clay against volumes and forces that are known in closed form."""

import numpy as np
import pytest

from teleclay import clay
from teleclay.clay import UNITS_PER_VOXEL, Clay, ball, blade, block, cylinder, loop

SIZE_M = [0.04, 0.03, 0.02]


def test_nothing_is_lost():
    made = Clay(block(SIZE_M), 1e-3)
    assert made.initial_units == 40 * 30 * 20 * UNITS_PER_VOXEL
    removed = made.carve(ball(0.005), [[0.01, 0.015, 0.02], [0.03, 0.015, 0.02]], [[0.03, 0.015, 0.02], [0.03, 0.025, 0.01]])
    assert removed.dtype == np.uint64 and (0 < removed).all()
    assert int(removed.sum()) == made.removed_units == made.initial_units - made.remaining_units
    assert int(made.occupancy().astype(np.int64).sum()) == made.remaining_units
    assert made.occupancy().shape == (20, 30, 40)


def test_a_groove_has_the_volume_of_half_a_capsule():
    made = Clay(block([0.06, 0.03, 0.02]), 5e-4)
    radius_m, length_m = 0.006, 0.03
    made.carve(ball(radius_m), [0.015, 0.015, 0.02], [0.015 + length_m, 0.015, 0.02])
    wanted = 0.5 * (np.pi * radius_m**2 * length_m + 4 / 3 * np.pi * radius_m**3)
    assert abs(made.removed_volume_m3 / wanted - 1) < 5e-3


def test_sweeps_may_come_in_any_order_and_twice(random):
    ends = random.uniform([0, 0, 0.01], SIZE_M, (2, 40, 3))
    first, second = Clay(block(SIZE_M), 1e-3), Clay(block(SIZE_M), 1e-3)
    first.carve(ball(0.004), *ends)
    order = random.permutation(np.repeat(np.arange(40), 2))
    second.carve(ball(0.004), *ends[:, order])
    assert first.hash == second.hash
    untouched = Clay(block(SIZE_M), 1e-3)
    assert untouched.hash != first.hash
    twin = first.copy()
    twin.carve(ball(0.004), [0.0, 0.0, 0.0], [0.04, 0.0, 0.0])
    assert twin.hash != first.hash == second.hash


def test_viscous_clay_resists_by_area_and_speed():
    made = Clay(block([0.06, 0.04, 0.02]), 1e-3)
    speed_m_s, depth_m, width_m = 0.02, 0.008, 0.01
    path_m = np.zeros((600, 3))
    path_m[:, 0] = 0.005 + speed_m_s * 1e-3 * np.arange(600)
    path_m[:, 1:] = 0.02, 0.02 - depth_m
    work = made.work(blade(width_m, 0.04, 0.002), path_m, clay.material(viscosity_pa_s_per_m=2e5))
    steady = slice(300, 600)
    # The edges of a blade lie between voxels.
    np.testing.assert_allclose(work.engaged_area_m2[steady], width_m * depth_m, rtol=0.02)
    np.testing.assert_allclose(work.force_n[steady, 0], -2e5 * work.engaged_area_m2[steady] * speed_m_s, rtol=1e-6)
    # What the tool spends is what the clay turns into heat.
    spent_j = -(work.force_n[steady, 0] * speed_m_s * 1e-3).sum()
    np.testing.assert_allclose(work.dissipated_j[steady].sum(), spent_j, rtol=1e-4)
    area = made.engaged_area_m2(blade(width_m, 0.04, 0.002), [0.04, 0.02, 0.02 - depth_m], [[1, 0, 0], [-1, 0, 0]])
    np.testing.assert_allclose(area[0], width_m * depth_m, rtol=0.02)
    assert area.shape == (2,)


def test_a_cylinder_mills_its_width_and_a_loop_takes_a_ribbon():
    y_m, length_m = 0.02, 0.06
    milled = Clay(block([length_m, 0.04, 0.02]), 5e-4)
    radius_m, depth_m = 0.005, 0.008
    milled.carve(cylinder(radius_m, 0.03), [-0.02, y_m, 0.02 - depth_m], [0.08, y_m, 0.02 - depth_m])
    assert abs(milled.removed_volume_m3 / (2 * radius_m * depth_m * length_m) - 1) < 5e-3
    ribbon = Clay(block([length_m, 0.04, 0.04]), 5e-4)
    ring_m, wire_m = 0.006, 0.002
    work = ribbon.work(loop(ring_m, wire_m), [[x_m, y_m, 0.02] for x_m in np.linspace(-0.01, 0.03, 200)], clay.material())
    # The disc has gone half of the way, and the wire alone feels.
    wanted_m3 = np.pi * (ring_m + wire_m / 2) ** 2 * (0.03 + wire_m / 2)
    assert abs(ribbon.removed_volume_m3 / wanted_m3 - 1) < 1e-2
    np.testing.assert_allclose(work.engaged_area_m2[-50:], 2 * np.pi * ring_m * wire_m, rtol=0.02)


def test_the_surface_is_closed_and_encloses_what_is_left():
    made = Clay(block(SIZE_M), 1e-3)
    made.carve(ball(0.006), [0.01, 0.015, 0.02], [0.03, 0.015, 0.015])
    positions_m, triangles = made.surface()
    edges = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] % 2 == 0).all()
    corners = positions_m[triangles].astype(np.float64)
    volume_m3 = np.einsum("ni,ni->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
    assert abs(volume_m3 / made.remaining_volume_m3 - 1) < 1e-3
    assert len(made.stl()) == 84 + 50 * len(triangles)


def test_a_stepped_block_has_its_steps():
    made = Clay(clay.stepped([0.01, 0.02, 0.03], [0.005, 0.01], 0.005, 0.01), 1e-3)
    np.testing.assert_allclose(made.initial_volume_m3, 0.01 * 0.01 * (0.01 + 0.015), rtol=1e-9)


def test_what_cannot_be_is_refused():
    with pytest.raises(ValueError, match="1024"):
        Clay(block([1.0, 0.1, 0.1]), 1e-4)
    made = Clay(block(SIZE_M), 1e-3)
    with pytest.raises(ValueError, match="this clay needs 0.002 m"):
        made.carve(ball(0.0005), [0, 0, 0], [0, 0, 0])
    with pytest.raises(ValueError, match=r"sweep\[1\]: .*finite"):
        made.carve(ball(0.005), np.zeros((2, 3)), [[0, 0, 0], [0, np.inf, 0]])
    with pytest.raises(ValueError, match="kind"):
        made.carve({"kind": "spoon"}, [0, 0, 0], [0, 0, 0])
    assert made.removed_units == 0
