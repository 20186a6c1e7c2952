"""The robot against its own geometry, written down here once more from the drawing alone."""

import numpy as np
import pytest

from teleclay import kinematics
from teleclay.kinematics import BRANCHES, DESKTOP


def places(random, count):
    return random.uniform([-0.03, -0.03, 0.11], [0.03, 0.03, 0.2], (count, 3))


def directions():
    angles = np.radians(DESKTOP.arm_angles_deg)
    return np.stack([np.cos(angles), np.sin(angles), np.zeros(3)], axis=-1)


def test_the_rods_close_on_every_branch(random):
    position_m = places(random, 200)
    joints_rad = kinematics.inverse(position_m)
    assert joints_rad.shape == (200, 8, 3)
    elbows_m = kinematics.elbows(joints_rad)
    shoulders_m = DESKTOP.base_radius_m * directions()
    wrists_m = position_m[:, None, None, :] + DESKTOP.platform_radius_m * directions()
    upper_m = np.linalg.norm(elbows_m - shoulders_m, axis=-1)
    lower_m = np.linalg.norm(wrists_m - elbows_m, axis=-1)
    np.testing.assert_allclose(upper_m, DESKTOP.upper_link_m, rtol=1e-12)
    np.testing.assert_allclose(lower_m, DESKTOP.lower_link_m, rtol=1e-9)
    # Eight different ones, not one eight times.
    assert all(len(np.unique(np.round(joints, 9), axis=0)) == 8 for joints in joints_rad)


def test_each_branch_is_its_row_of_all(random):
    position_m = places(random, 20)
    every = kinematics.inverse(position_m)
    for number, signs in enumerate(BRANCHES.tolist()):
        np.testing.assert_array_equal(kinematics.inverse_on(position_m, tuple(signs)), every[:, number])


def test_forward_undoes_inverse(random):
    position_m = places(random, 100)
    both_m = kinematics.forward(kinematics.inverse_on(position_m))
    nearest_m = np.linalg.norm(both_m - position_m[:, None], axis=-1).min(axis=-1)
    assert nearest_m.max() < 1e-9


def test_the_jacobian_is_the_slope_of_forward(random):
    position_m = places(random, 50)
    found = kinematics.jacobian(position_m)
    step_rad = 1e-6
    for joint in range(3):
        ways = []
        for side in (1, -1):
            joints = found.joints_rad + side * step_rad * np.eye(3)[joint]
            both_m = kinematics.forward(joints)
            which = np.linalg.norm(both_m - position_m[:, None], axis=-1).argmin(axis=-1)
            ways.append(both_m[np.arange(50), which])
        slope = (ways[0] - ways[1]) / (2 * step_rad)
        np.testing.assert_allclose(found.jacobian[..., joint], slope, atol=1e-7)
    singular = np.linalg.svd(found.jacobian, compute_uv=False)
    np.testing.assert_allclose(found.condition_number, singular[:, 0] / singular[:, 2], rtol=1e-9)


def test_torques_do_the_work_of_the_force(random):
    position_m = places(random, 50)
    force_n = random.normal(size=(50, 3))
    rates_rad_s = random.normal(size=(50, 3))
    velocity_m_s = np.einsum("nij,nj->ni", kinematics.jacobian(position_m).jacobian, rates_rad_s)
    torques_n_m = kinematics.torques(position_m, force_n)
    np.testing.assert_allclose((torques_n_m * rates_rad_s).sum(-1), (force_n * velocity_m_s).sum(-1), atol=1e-12)


def test_shapes_are_kept(random):
    position_m = places(random, 12).reshape(2, 3, 2, 3)
    assert kinematics.inverse(position_m).shape == (2, 3, 2, 8, 3)
    assert kinematics.forward(kinematics.inverse_on(position_m)).shape == (2, 3, 2, 2, 3)
    assert kinematics.inverse_on(position_m[0, 0, 0]).shape == (3,)


def test_what_is_out_of_reach_is_named_or_is_no_number():
    position_m = [[0, 0, 0.15], [0, 0, 5]]
    with pytest.raises(ValueError, match=r"position_m\[1\]: .*arm 1"):
        kinematics.inverse(position_m)
    found = kinematics.inverse(position_m, unreachable="nan")
    assert np.isfinite(found[0]).all() and np.isnan(found[1]).all()
    with pytest.raises(ValueError, match="unreachable"):
        kinematics.inverse(position_m, unreachable="zero")
    with pytest.raises(ValueError, match="3 numbers along the last axis"):
        kinematics.inverse([0.0, 0.1])


def test_dimensions_that_are_no_robot_are_refused():
    with pytest.raises(ValueError, match="arms 1 and 2 point the same way"):
        kinematics.inverse([0, 0, 0.15], kinematics.Geometry(arm_angles_deg=(0, 0, 240)))


def test_a_map_has_the_dexterity_of_its_cells():
    found = kinematics.workspace((8, 6, 5))
    assert found.dexterity.shape == (5, 6, 8)
    low, high = found.region_m
    size = (high - low) / [8, 6, 5]
    axes = [low[axis] + (np.arange(count) + 0.5) * size[axis] for axis, count in enumerate((8, 6, 5))]
    z, y, x = np.meshgrid(axes[2], axes[1], axes[0], indexing="ij")
    there = kinematics.jacobian(np.stack([x, y, z], axis=-1), unreachable="nan")
    both = np.isfinite(found.dexterity) & np.isfinite(there.condition_number)
    assert 10 < both.sum()
    np.testing.assert_allclose(found.dexterity[both], 1 / there.condition_number[both], rtol=1e-9)
