import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from rig.hand_made import mesh, skeleton

from viewer.errors import RigError
from viewer.rig.figure import Figure, skeleton_points
from viewer.rig.pose import rest_pose
from viewer.rig.skin import skin_from_lists

ONE = np.eye(4)[None]
SHAPE = mesh([[0, 0, 0], [1, 0, 0]])
SKIN = skin_from_lists([[(0, 1.0)], [(0, 1.0)]], ONE)


def test_figure_requires_a_mesh_or_a_skeleton():
    assert not Figure("a", mesh=SHAPE).is_attached
    assert not Figure("a", skeleton=skeleton([-1])).is_attached
    assert not Figure("a", mesh=SHAPE, skin=SKIN).is_attached
    assert not Figure("a", mesh=SHAPE, skeleton=skeleton([-1])).is_attached
    assert Figure("a", SHAPE, skeleton([-1]), SKIN).is_attached


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({}, "figure a: expected a mesh or a skeleton, found neither"),
        (
            {"mesh": mesh([[0, 0, 0]]), "skin": SKIN},
            "figure a: the skin binds 2 vertices, but the mesh has 1",
        ),
        (
            {"skeleton": skeleton([-1]), "skin": SKIN},
            "figure a: the skin binds 2 vertices, but the mesh has 0",
        ),
        (
            {"mesh": SHAPE, "skin": SKIN, "skeleton": skeleton([-1, 0])},
            "figure a: the skin has 1 binding matrices, but the skeleton has 2 joints",
        ),
    ],
)
def test_figure_refuses_inconsistent_parts(parts, message):
    with pytest.raises(RigError) as caught:
        Figure("a", **parts)
    assert str(caught.value) == message


def test_skeleton_points_without_boxes_are_the_joints():
    arm = skeleton([-1, 0], [(0, "z", math.pi / 2)], offsets=[[0, 1, 0], [2, 0, 0]])
    assert_allclose(skeleton_points(arm, rest_pose(arm)), [[0, 1, 0], [0, 3, 0]], atol=1e-15)


def test_skeleton_points_include_all_corners_of_rotated_boxes():
    box = [[[0, 0, 0], [1, 2, 3]]]
    arm = skeleton([-1], [(0, "z", math.pi / 2)], offsets=[[10, 0, 0]], boxes=box)
    points = skeleton_points(arm, rest_pose(arm))
    # A rotation by 90 degrees about z maps (x, y) to (-y, x).
    corners = {(10 - y, x, z) for x in (0, 1) for y in (0, 2) for z in (0, 3)}
    assert {tuple(np.round(point, 12) + 0.0) for point in points} == corners


def test_assembled_figure_has_all_its_parts():
    bones = skeleton([-1])
    whole = Figure("whole", mesh=SHAPE, skeleton=bones, skin=SKIN).attached()
    assert (whole.mesh, whole.skeleton, whole.skin) == (SHAPE, bones, SKIN)


@pytest.mark.parametrize(
    ("parts", "missing"),
    [
        ({"skeleton": skeleton([-1])}, "mesh"),
        ({"mesh": SHAPE, "skin": SKIN}, "skeleton"),
        ({"mesh": SHAPE, "skeleton": skeleton([-1])}, "skin"),
    ],
)
def test_missing_part_of_an_assembled_figure_is_named(parts, missing):
    figure = Figure("a", **parts)
    for ask in (figure.attached, getattr(figure, f"require_{missing}")):
        with pytest.raises(RigError, match=f"^figure a has no {missing}$"):
            ask()
