"""Morphs: conversion of absolute targets to blend shapes, morphed normals, and skinning."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from rig.hand_made import mesh, plain_skinning, skeleton, turn_z

from viewer.errors import RigError
from viewer.rig.arrays import Deferred
from viewer.rig.blendshapes import BlendShapes
from viewer.rig.figure import Figure
from viewer.rig.morph_target import MorphTarget, with_morphs
from viewer.rig.posing.pose_record import apply_record, record_of
from viewer.rig.scene import figure_pose
from viewer.rig.shape import rest_joints, shaped
from viewer.rig.skin import skin_from_lists
from viewer.rig.skinning import deform

POSITIONS = [[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]
NORMALS = [[0.0, 0, 1], [0, 0, 2], [0, 0, 1]]
LIFTED = MorphTarget("lifted", [2], [[0.0, 1, 4]], [[0.0, 1, 0]])
WIDE = MorphTarget("wide", [2, 1], [[0.0, 3, 0], [5, 0, 0]], [[0.0, 0, 1], [2, 0, 0]])


def figure(**changes) -> Figure:
    rows = [(0, axis, 0.0) for axis in ("tx", "ty", "tz", "x", "y", "z")]
    parts = {
        "mesh": mesh(POSITIONS, NORMALS, [[0, 1, 2]]),
        "skeleton": skeleton([-1], rows),
        "skin": skin_from_lists([[(0, 1.0)]] * 3, np.eye(4)[None]),
        **changes,
    }
    return Figure("head", **parts)


def test_targets_are_absolute_and_reached_at_weight_1():
    changed = shaped(with_morphs(figure(), [LIFTED]), np.array([1.0]))
    assert changed.mesh.positions.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 4]]
    assert changed.mesh.normals.tolist() == [[0, 0, 1], [0, 0, 2], [0, 1, 0]]


def test_several_weighted_morphs_are_added_to_the_base():
    changed = shaped(with_morphs(figure(), [LIFTED, WIDE]), np.array([0.5, 2.0]))
    # Vertex 2: (0,1,0) + 0.5 (0,0,4) + 2 (0,2,0); vertex 1: (1,0,0) + 2 (4,0,0).
    assert changed.mesh.positions.tolist() == [[0, 0, 0], [9, 0, 0], [0, 5, 2]]
    # Normals: (0,0,1) + 0.5 (0,1,-1) + 2 (0,0,0); (0,0,2) + 2 (2,0,-2).
    assert changed.mesh.normals.tolist() == [[0, 0, 1], [4, 0, -2], [0, 0.5, 0.5]]


def test_skinning_rotates_the_morphed_normals_then_normalises_them():
    whole = with_morphs(figure(), [LIFTED, WIDE])
    pose = figure_pose(whole)
    pose.shape_weights[:] = 0.5, 2.0
    pose.dofs[5], pose.dofs[0] = 0.7, 3.0
    palette = np.eye(4)
    palette[:3, :3], palette[0, 3] = turn_z(0.7), 3.0
    wanted = plain_skinning(
        [[0, 0, 0], [9, 0, 0], [0, 5, 2]],
        [[0, 0, 1], [4, 0, -2], [0, 0.5, 0.5]],
        [[(0, 1.0)]] * 3,
        [palette],
    )
    for found, right in zip(deform(whole, pose), wanted, strict=True):
        assert_allclose(found, right, atol=1e-14)


def test_joints_bindings_and_zero_weights_are_unchanged():
    plain = figure()
    whole = with_morphs(plain, [WIDE])
    assert shaped(whole, np.zeros(1)) is whole
    changed = shaped(whole, np.array([1.0]))
    assert_array_equal(rest_joints(changed), rest_joints(plain))
    assert_array_equal(changed.skin.inverse_bind, plain.skin.inverse_bind)


def test_target_without_normals_keeps_those_of_the_mesh():
    bare = MorphTarget("bare", [0], [[1.0, 1, 1]])
    changed = shaped(with_morphs(figure(), [bare]), np.array([1.0]))
    assert changed.mesh.normals.tolist() == NORMALS


def test_names_and_groups_are_those_of_the_targets():
    shapes = with_morphs(figure(), [LIFTED, WIDE]).blend_shapes
    assert shapes.names == ("lifted", "wide") and shapes.groups == ("morph", "morph")


def test_additional_morphs_are_appended():
    one_by_one = with_morphs(with_morphs(figure(), [LIFTED]), [WIDE]).blend_shapes
    together = with_morphs(figure(), [LIFTED, WIDE]).blend_shapes
    assert one_by_one.names == together.names
    assert_array_equal(one_by_one.offsets, together.offsets)
    assert_array_equal(one_by_one.normal_offsets, together.normal_offsets)


def test_figure_is_unchanged_without_targets():
    plain = figure()
    assert with_morphs(plain, []) is plain


@pytest.mark.parametrize("index", [3, -1])
def test_vertex_outside_the_mesh_is_refused_with_index_and_count(index):
    target = MorphTarget("smile", [0, index], np.zeros((2, 3)), np.zeros((2, 3)))
    with pytest.raises(RigError) as caught:
        with_morphs(figure(), [target])
    values = {"morph": "smile", "figure": "head", "found": index, "n": 3}
    assert caught.value.diagnostic.key == "F004.morph-vertex"
    assert caught.value.diagnostic.values == values


def test_figures_without_mesh_or_with_other_shapes_are_refused():
    with pytest.raises(RigError) as caught:
        with_morphs(figure(mesh=None, skin=None), [LIFTED])
    assert caught.value.diagnostic.key == "F004.morph-mesh"
    assert caught.value.diagnostic.values == {"morph": "lifted", "figure": "head"}
    own = BlendShapes(("taller",), np.zeros((1, 3, 3)))
    with pytest.raises(RigError) as caught:
        with_morphs(figure(blend_shapes=own), [LIFTED])
    assert caught.value.diagnostic.key == "F004.morph-shapes"


def test_target_that_lists_a_vertex_twice_is_refused():
    with pytest.raises(RigError) as caught:
        MorphTarget("smile", [1, 1], np.zeros((2, 3)))
    assert str(caught.value) == "morph smile: a vertex is listed twice"


def test_normal_offsets_may_be_read_lazily():
    asked = []

    def load():
        asked.append(True)
        return np.full((1, 3, 3), 2.0)

    shapes = BlendShapes(("a",), np.zeros((1, 3, 3)), (), Deferred((1, 3, 3), "f8", load))
    assert not asked
    assert shapes.normal_displacement(np.array([0.5])).tolist() == [[1.0] * 3] * 3
    shapes.normal_displacement(np.array([1.0]))
    assert len(asked) == 1


def test_normal_offsets_with_a_different_array_shape_are_refused():
    with pytest.raises(RigError) as caught:
        BlendShapes(("a",), np.zeros((1, 3, 3)), (), np.zeros((1, 2, 3)))
    assert str(caught.value) == "normal_offsets: expected shape (1, 3, 3), found (1, 2, 3)"


def test_recorded_pose_restores_morph_weights():
    whole = with_morphs(figure(), [LIFTED, WIDE])
    pose = figure_pose(whole)
    pose.shape_weights[:] = 0.25, 0.75
    other = figure_pose(whole)
    assert apply_record(record_of(whole, pose), whole, other) == []
    assert other.shape_weights.tolist() == [0.25, 0.75]


def test_additional_targets_keep_the_weights_of_the_file():
    first = with_morphs(figure(), [LIFTED]).blend_shapes
    known = BlendShapes(
        first.names, first.offsets, first.groups, first.normal_offsets, np.array([0.5])
    )
    both = with_morphs(figure(blend_shapes=known), [WIDE])
    assert both.blend_shapes.names == ("lifted", "wide")
    assert figure_pose(both).shape_weights.tolist() == [0.5, 0.0]
    # If no pose is given, the figure has that of the file.
    assert_array_equal(deform(both)[0], deform(both, figure_pose(both))[0])
    assert deform(both)[0][2].tolist() == [0.0, 1.0, 2.0]
