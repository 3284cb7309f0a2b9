"""Weighted offsets: blend shapes, pose correctives, and joints regressed from the mesh."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from rigs.hand_made import mesh, plain_skinning, skeleton, turn_x, turn_y, turn_z

from viewer.errors import RigError
from viewer.rigs.arrays import Deferred
from viewer.rigs.blendshapes import (
    BlendShapes,
    Correctives,
    JointRegressor,
    active_rows,
    corrective_weights,
    regress_joints,
)
from viewer.rigs.expressions import ExpressionRules
from viewer.rigs.figure import Figure, figure_pose
from viewer.rigs.morph_target import MorphTarget, with_morphs
from viewer.rigs.posing.pose_record import apply_record, record_of
from viewer.rigs.shape import rest_joints, shaped
from viewer.rigs.skin import skin_from_lists
from viewer.rigs.skinning import deform

OFFSETS = np.array([[[1.0, 0, 0], [0, 2, 0]], [[0, 0, 4], [0, 0, 0]], [[0, 8, 0], [16, 0, 0]]])


def shapes(**changes):
    return BlendShapes(**{"names": ("a", "b", "c"), "offsets": OFFSETS, **changes})


def test_displacement_is_the_weighted_sum():
    # 2 (1,0,0) - 1 (0,0,4) + 0.5 (0,8,0), and 2 (0,2,0) + 0.5 (16,0,0).
    found = shapes().displacement(np.array([2.0, -1.0, 0.5]))
    assert found.tolist() == [[2, 4, -4], [8, 4, 0]]


def test_missing_weights_are_zero():
    assert shapes().displacement(np.array([3.0])).tolist() == [[3, 0, 0], [0, 6, 0]]
    assert shapes().displacement(np.zeros(0)).tolist() == [[0, 0, 0]] * 2


def test_too_many_weights_are_refused():
    with pytest.raises(RigError) as caught:
        shapes().displacement(np.zeros(4))
    assert str(caught.value) == "expected at most 3 shape weights, found 4"


def test_blend_shapes_belong_to_the_shape_group_by_default():
    assert shapes().groups == ("shape",) * 3
    assert (shapes().n_shapes, shapes().n_vertices) == (3, 2)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"names": ("a",)}, "offsets: expected shape 1 x any x 3, found 3 x 2 x 3"),
        ({"groups": ("shape",)}, "groups: expected 3, found 1"),
        ({"offsets": OFFSETS[0]}, "offsets: expected shape 3 x any x 3, found 2 x 3"),
        (
            {"offsets": Deferred((2, 2, 3), "f8", lambda: OFFSETS)},
            "offsets: expected shape 3 x any x 3, found 2 x 2 x 3",
        ),
    ],
)
def test_blend_shapes_refuse_parts_that_do_not_fit(changes, message):
    with pytest.raises(RigError) as caught:
        shapes(**changes)
    assert str(caught.value) == message


def counted(values):
    """Return a deferred array and the list that grows each time it is loaded."""
    loads = []

    def load():
        loads.append(1)
        return values.copy()

    return Deferred(values.shape, values.dtype, load), loads


def test_deferred_offsets_are_read_once_and_only_for_nonzero_weights():
    deferred, loads = counted(OFFSETS)
    lazy = shapes(offsets=deferred)
    lazy.displacement(np.zeros(3))
    assert loads == []
    assert lazy.displacement(np.array([0.0, 1.0])).tolist() == [[0, 0, 4], [0, 0, 0]]
    lazy.displacement(np.array([1.0]))
    assert loads == [1]


def test_corrective_weights_are_rotation_entries_minus_the_identity():
    rotations = np.array([turn_x(0.3), turn_z(np.pi / 2), np.eye(3)])
    found = corrective_weights(rotations)
    # Rz(90) is ((0,-1,0), (1,0,0), (0,0,1)); the root has no weights.
    assert_allclose(found[:9], [-1, -1, 0, 1, -1, 0, 0, 0, 0], atol=1e-15)
    assert found[9:].tolist() == [0] * 9


def test_single_root_has_no_corrective_weights():
    assert corrective_weights(turn_x(1.0)[None]).shape == (0,)


def random_correctives(n_joints, n_vertices=7, seed=0):
    return np.random.default_rng(seed).normal(size=(9 * (n_joints - 1), n_vertices, 3))


@pytest.mark.parametrize(
    "turned", [(), (1,), (5,), (1, 2), (2, 4), (1, 5), (1, 2, 3, 4, 5)], ids=str
)
def test_correctives_are_the_weighted_sum_for_any_rotated_joints(turned):
    offsets = random_correctives(6)
    rotations = np.tile(np.eye(3), (6, 1, 1))
    for joint in turned:
        rotations[joint] = turn_y(0.4 * joint) @ turn_x(1.0)
    weights = corrective_weights(rotations)
    expected = sum(weight * direction for weight, direction in zip(weights, offsets, strict=True))
    assert_allclose(Correctives(offsets).displacement(weights), expected, atol=1e-13)


def test_active_rows_are_runs_of_rotated_joints():
    weights = np.zeros((5, 9))
    weights[[0, 1, 3], [8, 0, 4]] = 1.0, -2.0, 1e-300
    assert active_rows(weights.ravel()) == [slice(0, 18), slice(27, 36)]
    assert active_rows(np.zeros(45)) == []
    assert active_rows(np.ones(45)) == [slice(0, 45)]
    assert active_rows(np.zeros(0)) == []


def test_deferred_correctives_are_read_when_a_joint_rotates():
    offsets = random_correctives(3)
    deferred, loads = counted(offsets)
    lazy = Correctives(deferred)
    assert lazy.displacement(np.zeros(18)).tolist() == [[0, 0, 0]] * 7
    assert loads == []
    lazy.displacement(np.ones(18))
    assert loads == [1]
    assert np.array_equal(lazy.values(), offsets)


def test_correctives_require_nine_rows_per_joint():
    with pytest.raises(RigError) as caught:
        Correctives(np.zeros((10, 2, 3)))
    assert str(caught.value) == "offsets: expected nine for each joint except the root, found 10"


def test_sparse_regression_matches_the_dense_matrix():
    rng = np.random.default_rng(1)
    dense = rng.normal(size=(6, 20)) * (rng.random((6, 20)) < 0.3)
    dense[4] = 0.0  # a joint with an empty regressor row stays at the origin
    joints, vertices = np.nonzero(dense)
    positions = rng.normal(size=(20, 3))
    order = rng.permutation(len(joints))
    regressor = JointRegressor(6, joints[order], vertices[order], dense[joints, vertices][order])
    assert_allclose(regress_joints(regressor, positions), dense @ positions, atol=1e-14)


def test_entries_listed_twice_are_added():
    regressor = JointRegressor(1, [0, 0], [1, 1], [0.25, 0.5])
    assert regress_joints(regressor, np.array([[9.0, 9, 9], [4, 8, 0]])).tolist() == [[3, 6, 0]]


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ((2, [0, 2], [0, 0], [1.0, 1.0]), "joints: expected indices 0 to 1"),
        ((2, [0, -1], [0, 0], [1.0, 1.0]), "joints: expected indices 0 to 1"),
        ((2, [0, 1], [0, -1], [1.0, 1.0]), "vertices: expected indices from 0 on"),
        ((2, [0, 1], [0], [1.0, 1.0]), "vertices: expected shape 2, found 1"),
        ((2, [0], [0], [np.inf]), "weights: expected finite numbers, found inf at index 0"),
    ],
)
def test_regressor_refuses_indices_that_do_not_exist(parts, message):
    with pytest.raises(RigError) as caught:
        JointRegressor(*parts)
    assert str(caught.value) == message


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
    assert str(caught.value) == "normal_offsets: expected shape 1 x 3 x 3, found 1 x 2 x 3"


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


def _rules(effect: int, is_binary: tuple[bool, bool] = (False, False)) -> ExpressionRules:
    """Return rules by which ``happy``, blend shape 1, affects ``blink``, blend shape 2."""
    return ExpressionRules(
        rows=np.array([1, 2]),
        is_binary=np.array(is_binary),
        kinds=np.array([-1, 1]),
        overrides=np.array([[0, effect, 0], [0, 0, 0]]),
    )


@pytest.mark.parametrize(
    ("effect", "is_binary", "given", "expected"),
    [
        (0, (False, False), (0.5, 0.8), (0.5, 0.8)),
        (1, (False, False), (0.1, 0.8), (0.1, 0.0)),
        (1, (False, False), (0.0, 0.8), (0.0, 0.8)),
        (2, (False, False), (0.25, 0.8), (0.25, 0.6)),
        # The shown value of a binary expression, 0 or 1, affects the others.
        (2, (True, False), (0.4, 0.8), (0.0, 0.8)),
        (2, (True, False), (0.6, 0.8), (1.0, 0.0)),
        # A binary expression that is affected by any amount is off.
        (2, (False, True), (0.1, 0.8), (0.1, 0.0)),
        (0, (False, False), (1.5, -0.5), (1.0, 0.0)),
    ],
)
def test_expressions_override_others_as_vrm_specifies(effect, is_binary, given, expected):
    weights = np.array([2.0, *given])
    assert_allclose(_rules(effect, is_binary).shown(weights), [2.0, *expected], atol=1e-15)


def test_missing_trailing_weights_are_zero():
    assert _rules(1).shown(np.array([0.3, 0.5])).tolist() == [0.3, 0.5]
