"""DOFs of a joint for a given rotation: explicit matrix products, limits, and ties."""

import itertools

import numpy as np
import pytest
from numpy.testing import assert_allclose

from viewer.rig.pose import joint_rotations, rest_pose
from viewer.rig.posing.joint_rotation import nearest_dofs, rotates_freely, rotation_dofs
from viewer.rig.skeleton import Skeleton

FREE = (-np.inf, np.inf)


def about(axis: int, angle: float) -> np.ndarray:
    """Return the rotation about a coordinate axis, written out."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array(
        [
            [[1, 0, 0], [0, c, -s], [0, s, c]],
            [[c, 0, s], [0, 1, 0], [-s, 0, c]],
            [[c, -s, 0], [s, c, 0], [0, 0, 1]],
        ][axis]
    )


def single(axes: str, *limits: tuple[float, float], quaternion=(0, 0, 0, 1)) -> Skeleton:
    """Return one joint that rotates about some axes, the first letter applied first."""
    bounds = np.array([*limits, *([FREE] * (len(axes) - len(limits)))], float).reshape(-1, 2)
    return Skeleton(
        names=("joint",),
        parents=np.array([-1]),
        rest_translations=np.zeros((1, 3)),
        rest_rotations=np.array([quaternion], float),
        rest_scales=np.ones((1, 3)),
        dof_joints=np.zeros(len(axes), int),
        dof_kinds=np.array([3 + "xyz".index(axis) for axis in axes], int),
        rest_dofs=np.clip(np.zeros(len(axes)), *bounds.T),
        dof_limits=bounds,
    )


@pytest.mark.parametrize("order", ["".join(order) for order in itertools.permutations("xyz")])
def test_rotation_about_three_axes_in_any_order_is_exact(order) -> None:
    skeleton = single(order, quaternion=(0.1, -0.3, 0.2, 0.9))
    pose = rest_pose(skeleton)
    for seed in range(20):
        random = np.random.default_rng(seed)
        q = random.standard_normal(4)
        q /= np.linalg.norm(q)
        x, y, z, w = q
        wanted = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )
        found = nearest_dofs(skeleton, pose, 0, wanted)
        pose.dofs[:] = found.dofs
        assert_allclose(joint_rotations(skeleton, pose)[0], wanted, atol=1e-12)
        assert found.error < 1e-7 and len(found.limited) == 0


def test_axes_are_applied_in_the_order_of_the_rows() -> None:
    # Rows z, x, y: z is applied first, so R = Ry Rx Rz.
    angles = np.array([0.3, -0.4, 1.1])
    wanted = about(1, 1.1) @ about(0, -0.4) @ about(2, 0.3)
    skeleton = single("zxy")
    found = nearest_dofs(skeleton, rest_pose(skeleton), 0, wanted)
    assert_allclose(found.dofs, angles, atol=1e-12)


def test_solution_nearer_the_current_values_is_chosen() -> None:
    skeleton = single("xyz")
    pose = rest_pose(skeleton)
    # With y beyond a right angle, the rotation equals that of (x + pi, pi - y, z + pi).
    pose.dofs[:] = 0.1, 2.0, 0.2
    wanted = about(2, 0.25) @ about(1, 2.1) @ about(0, 0.05)
    assert_allclose(nearest_dofs(skeleton, pose, 0, wanted).dofs, [0.05, 2.1, 0.25], atol=1e-9)
    # Multiples of 360 degrees are preserved too.
    pose.dofs[:] = 0.1 + 4 * np.pi, 2.0, 0.2
    found = nearest_dofs(skeleton, pose, 0, wanted).dofs
    assert_allclose(found, [0.05 + 4 * np.pi, 2.1, 0.25], atol=1e-9)


def test_limits_select_the_allowed_solution() -> None:
    # Only y between 1.6 and 2.5 is allowed; the principal solution has y below pi / 2.
    skeleton = single("xyz", FREE, (1.6, 2.5), FREE)
    wanted = about(2, 0.4) @ about(1, 2.2) @ about(0, -0.3)
    found = nearest_dofs(skeleton, rest_pose(skeleton), 0, wanted)
    assert_allclose(found.dofs, [-0.3, 2.2, 0.4], atol=1e-9)


def test_solution_360_degrees_away_within_the_limits_is_found() -> None:
    skeleton = single("x", (2 * np.pi + 0.1, 2 * np.pi + 1.0))
    found = nearest_dofs(skeleton, rest_pose(skeleton), 0, about(0, 0.5))
    assert_allclose(found.dofs, [2 * np.pi + 0.5], atol=1e-12)


def test_rotation_beyond_a_limit_is_replaced_by_the_nearest_and_its_dof_named() -> None:
    skeleton = single("xyz", (-0.5, 0.5), (-0.5, 0.5), (-0.5, 0.5))
    found = nearest_dofs(skeleton, rest_pose(skeleton), 0, about(1, 0.8))
    assert_allclose(found.dofs, [0, 0.5, 0], atol=1e-9)
    assert found.limited.tolist() == [1]
    assert found.error == pytest.approx(0.3)


def test_no_rotation_within_the_limits_is_nearer() -> None:
    limits = ((-0.6, 0.4), (-0.3, 0.7), (-0.5, 0.2))
    skeleton = single("xyz", *limits)
    grids = [np.linspace(low, high, 15) for low, high in limits]
    for seed in range(6):
        a, b, c = np.random.default_rng(seed).uniform(-1.2, 1.2, 3)
        wanted = about(2, c) @ about(1, b) @ about(0, a)
        found = nearest_dofs(skeleton, rest_pose(skeleton), 0, wanted)
        best = max(
            np.trace(wanted.T @ about(2, z) @ about(1, y) @ about(0, x))
            for x, y, z in itertools.product(*grids)
        )
        x, y, z = found.dofs
        ours = np.trace(wanted.T @ about(2, z) @ about(1, y) @ about(0, x))
        assert ours >= best - 1e-9
        assert (found.dofs >= skeleton.dof_limits[:, 0]).all()
        assert (found.dofs <= skeleton.dof_limits[:, 1]).all()


def test_single_axis_takes_the_twist_about_it() -> None:
    skeleton = single("y")
    # For Ry(0.7) Rx(0.2), a single axis y is rotated by 0.7, because the trace is symmetric in x.
    found = nearest_dofs(skeleton, rest_pose(skeleton), 0, about(1, 0.7) @ about(0, 0.2))
    t = np.linspace(-np.pi, np.pi, 100_001)
    wanted = about(1, 0.7) @ about(0, 0.2)
    traces = (
        wanted[1, 1]
        + (wanted[0, 0] + wanted[2, 2]) * np.cos(t)
        + (wanted[0, 2] - wanted[2, 0]) * np.sin(t)
    )
    assert found.dofs[0] == pytest.approx(t[traces.argmax()], abs=1e-4)
    assert found.error > 0.1 and len(found.limited) == 0


def test_joint_without_rotations_is_unchanged() -> None:
    skeleton = single("")
    found = nearest_dofs(skeleton, rest_pose(skeleton), 0, about(2, 0.5))
    assert found.dofs.shape == (0,) and found.error == pytest.approx(0.5)


def test_start_is_not_modified() -> None:
    skeleton = single("xyz")
    pose = rest_pose(skeleton)
    nearest_dofs(skeleton, pose, 0, about(2, 0.5))
    assert not pose.dofs.any()


def test_locked_dofs_are_ignored() -> None:
    assert rotates_freely(single("zyx"), 0)
    assert not rotates_freely(single("xyz", (0.2, 0.2)), 0)
    assert not rotates_freely(single("xyx"), 0)
    assert not rotates_freely(single("xy"), 0)
    assert rotation_dofs(single("xyz", (0.2, 0.2)), 0, free=True).tolist() == [1, 2]
    assert rotation_dofs(single("xyz", (0.2, 0.2)), 0).tolist() == [0, 1, 2]
