"""Products of rotations about axes, compared with one-by-one multiplication."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from viewer.rig.geometry.rotation import axis_rotations
from viewer.rig.pose import axis_products


@pytest.mark.parametrize("shape", [(), (2, 3)])
def test_products_equal_those_multiplied_one_by_one(shape) -> None:
    rng = np.random.default_rng(0)
    # Joints 0 and 3 have three rotations, 1 has none, 2 has five; the DOFs alternate.
    joints = np.array([2, 0, 3, 2, 2, 0, 3, 2, 0, 2, 3], dtype=np.int32)
    axes = rng.integers(0, 3, len(joints)).astype(np.int32)
    rows = 2 * np.arange(len(joints))
    dofs = rng.uniform(-3.0, 3.0, (*shape, 2 * len(joints)))
    expected = np.broadcast_to(np.eye(3), (*shape, 4, 3, 3)).copy()
    for joint, axis, row in zip(joints, axes, rows, strict=True):
        rotation = axis_rotations(int(axis), dofs[..., row])
        expected[..., joint, :, :] = rotation @ expected[..., joint, :, :]
    found = axis_products(4, joints, axes, rows).at(dofs)
    assert found.shape == (*shape, 4, 3, 3)
    assert_allclose(found, expected, atol=1e-15)


def test_joints_without_rotations_have_the_identity() -> None:
    none = np.zeros(0, dtype=np.int32)
    products = axis_products(2, none, none, np.zeros(0, dtype=np.intp))
    assert_array_equal(products.at(np.ones(3)), [np.eye(3)] * 2)
