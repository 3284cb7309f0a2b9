"""Strain quantities of a square whose corners slide, against closed forms."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from rig.hand_made import mesh, skeleton

from viewer.rig.blendshapes import BlendShapes
from viewer.rig.figure import Figure
from viewer.rig.pose import rest_pose
from viewer.rig.scalars import compute
from viewer.rig.skin import skin_from_lists
from viewer.rig.skinning import Skinning

# 3 --- 2   Corners 0 and 3 follow joint 0, corners 1 and 2 joint 1, which slides along x;
# |   / |   vertex 4 is in no triangle.
# 0 --- 1
CORNERS = [[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [5, 5, 5]]
TRIANGLES = [[0, 1, 2], [0, 2, 3]]


def square(**parts) -> Figure:
    bones = skeleton([-1, -1], [(1, "tx", 0.0), (1, "x", 0.0), (0, "z", 0.0), (1, "z", 0.0)])
    rows = [[(0, 1.0)], [(1, 1.0)], [(1, 1.0)], [(0, 1.0)], []]
    skin = skin_from_lists(rows, np.tile(np.eye(4), (2, 1, 1)))
    return Figure("square", mesh(CORNERS, triangles=TRIANGLES), bones, skin, **parts)


def found(name, slide=0.0, figure=None, change=lambda pose: None):
    figure = figure or square()
    pose = rest_pose(figure.skeleton)
    pose.dofs[0] = slide
    change(pose)
    return compute(name, figure, pose, Skinning())


@pytest.mark.parametrize("name", ["stretch", "stretch-mean", "area"])
def test_figure_at_rest_is_not_strained(name):
    assert found(name).tolist() == [0] * 5


@pytest.mark.parametrize("name", ["stretch", "stretch-mean", "area"])
def test_placement_scale_and_rotation_cause_no_strain(name):
    def change(pose):
        pose.figure_scale, pose.figure_translation[:] = 3.0, (7, 8, 9)
        pose.dofs[2:] = 1.2

    assert found(name, change=change).tolist() == [0] * 5


def test_stretch_is_that_of_the_edge_with_the_largest_change():
    # At twice the width, horizontal edges double, the diagonal grows from sqrt 2 to sqrt 5, and
    # vertical edges keep their lengths.
    assert_allclose(found("stretch", 1.0), [100, 100, 100, 100, 0])
    # At half the width, the stretch is -50 %, more than sqrt(1.25 / 2) - 1 = -21 % of the diagonal.
    assert_allclose(found("stretch", -0.5), [-50, -50, -50, -50, 0])


def test_stretch_keeps_its_sign_where_edges_differ():
    # Vertices 1 and 2 move up by 0.5 and joint 1 rotates about x by 60 degrees: y of 2 halves.
    def change(pose):
        pose.dofs[1] = np.pi / 3

    # Corner 2 moves from (1, 1, 0) to (1, 0.5, 0.866). Edge 2-3 grows from 1 to sqrt(1 + 0.25 +
    # 0.75) = sqrt 2; all other edges keep their lengths, as 0-2 is still sqrt 2.
    expected = [0, 0, 100 * (np.sqrt(2) - 1), 100 * (np.sqrt(2) - 1), 0]
    assert_allclose(found("stretch", change=change), expected, atol=1e-9)


def test_mean_stretch_is_the_mean_over_all_edges_around_a_vertex():
    diagonal = 100 * (np.sqrt(2.5) - 1)
    # Corner 0 has the edges 0-1, 0-2 and 0-3; corner 1 has 1-0 and 1-2.
    expected = [(100 + diagonal) / 3, 50, (100 + diagonal) / 3, 50, 0]
    assert_allclose(found("stretch-mean", 1.0), expected)


def test_area_change_is_the_mean_over_all_triangles_around_a_vertex():
    assert_allclose(found("area", 1.0), [100, 100, 100, 100, 0])
    assert_allclose(found("area", -0.75), [-75, -75, -75, -75, 0])
    assert_allclose(found("area", -1.0), [-100, -100, -100, -100, 0], atol=1e-9)


def test_area_change_is_weighted_by_triangle_area():
    # A triangle of area 1.5 is next to one of area 0.5; only the smaller one doubles.
    corners = [[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [-3, 0, 0]]
    skin = skin_from_lists([[(0, 1.0)], [(1, 1.0)], [(0, 1.0)], [(0, 1.0)]],
                           np.tile(np.eye(4), (2, 1, 1)))  # fmt: skip
    shape = mesh(corners, triangles=[[0, 1, 2], [0, 2, 3]])
    figure = Figure("two", shape, square().skeleton, skin)
    # Corner 0: (1 + 1.5) / 2 = 1.25.
    assert_allclose(found("area", 1.0, figure), [25, 100, 25, 0])


def test_strain_is_relative_to_the_shaped_rest_mesh():
    offsets = np.zeros((1, 5, 3))
    offsets[0, 1:3, 0] = 1.0  # the shape is twice as wide
    figure = square(blend_shapes=BlendShapes(("wide",), offsets))

    def change(pose):
        pose.shape_weights = np.ones(1)

    for name in ("stretch", "stretch-mean", "area"):
        assert found(name, figure=figure, change=change).tolist() == [0] * 5
    # The width changes from 2 to 3.
    assert_allclose(found("area", 1.0, figure, change), [50, 50, 50, 50, 0])


def test_degenerate_edges_and_triangles_are_ignored():
    corners = [[0.0, 0, 0], [1, 0, 0], [1, 0, 0], [0, 1, 0]]
    rows = [[(0, 1.0)], [(0, 1.0)], [(1, 1.0)], [(0, 1.0)]]
    skin = skin_from_lists(rows, np.tile(np.eye(4), (2, 1, 1)))
    shape = mesh(corners, triangles=[[0, 1, 3], [1, 2, 1], [1, 2, 2]])
    figure = Figure("flat", shape, square().skeleton, skin)
    # Corner 2 moves away from corner 1; an edge with a rest length of 0 has no ratio.
    for name in ("stretch", "stretch-mean", "area"):
        assert found(name, 1.0, figure).tolist() == [0] * 4
