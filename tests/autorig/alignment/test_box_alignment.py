"""Alignment of bounding boxes."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from viewer.autorig.seed import align_boxes
from viewer.errors import RigError
from viewer.rig.geometry.transform import apply_transform


def test_boxes_are_aligned_axis_by_axis():
    points = np.array([[0.0, 0, 0], [1, 2, 4], [0.5, 1, 1]])
    onto = np.array([[10.0, 0, -1], [12, 2, 1], [11, 1, 0.9]])
    moved = apply_transform(align_boxes(points, onto), points)
    assert_allclose(moved, [[10.0, 0, -1], [12, 2, 1], [11, 1, -0.5]], atol=1e-12)


def test_axis_along_which_both_are_flat_keeps_its_scale():
    flat = np.array([[0.0, 0, 5], [1, 1, 5]])
    matrix = align_boxes(flat, np.array([[0.0, 0, 7], [2, 3, 7]]))
    assert_allclose(np.diag(matrix)[:3], [2.0, 3.0, 1.0])
    assert_allclose(matrix[2, 3], 2.0)


def test_flat_mesh_is_not_scaled_to_a_solid_one():
    with pytest.raises(RigError) as problem:
        align_boxes(np.array([[0.0, 0, 5], [1, 1, 5]]), np.array([[0.0, 0, 0], [2, 3, 7]]))
    assert str(problem.value) == (
        "alignment of boxes: expected both meshes to extend along z, found 0 and 7"
    )
