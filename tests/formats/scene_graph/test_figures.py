"""Figures of node files, posed as glTF defines."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from tests.formats.scene_graph.node_files import (
    affine,
    file_of,
    local,
    mesh,
    skin,
    source,
    tree_of,
    triangle,
    vertices,
)
from viewer.errors import FormatError
from viewer.formats._scene_graph.content import NodeFile, NodeMesh, NodeSkin
from viewer.formats._scene_graph.figures import figure_group
from viewer.rig.figure import Figure
from viewer.rig.geometry.rotation import axis_rotations
from viewer.rig.scene import figure_pose
from viewer.rig.skinning import deform

TURNED = [0.3, -0.5, 0.1, 0.8]


def figures_of(file: NodeFile) -> tuple[Figure, ...]:
    return figure_group(file, source()).figures


def posed(file: NodeFile, figure: Figure) -> tuple[np.ndarray, np.ndarray]:
    """Return the vertices of a randomly posed figure, and those by the definition."""
    pose = figure_pose(figure)
    pose.dofs[:] = np.random.default_rng(5).uniform(-2.0, 2.0, len(pose.dofs))
    moved = {}
    for joint, name in enumerate(figure.skeleton.names):
        rows = np.flatnonzero(figure.skeleton.dof_joints == joint)
        if len(rows) == 0:
            continue
        x, y, z = (axis_rotations(axis, pose.dofs[rows[axis]]) for axis in range(3))
        node = file.tree.names.index(name)
        moved[node] = local(file.tree, node, z @ y @ x)
    return deform(figure, pose)[0], vertices(file, moved)


def check(file: NodeFile) -> Figure:
    """Compare a file's only figure with the definition, at rest and posed; return the figure."""
    (figure,) = figures_of(file)
    for found, wanted in ((deform(figure)[0], vertices(file)), posed(file, figure)):
        assert_allclose(found, wanted, atol=1e-12 * np.abs(wanted).max())
    return figure


def arm(**more):
    """Return a root, two joints with scales that shear, and a mesh node with unused transform."""
    return tree_of(
        {"name": "root", "rotation": TURNED, "translation": [1, 2, 3], "scale": [1, -2, 0.5]},
        {"name": "hip", "parent": 0, "rotation": [0.1, 0.7, 0, 0.5], "scale": [-1, 3, 1]},
        {"name": "knee", "parent": 1, "translation": [0, 1, 0], "rotation": [0.4, 0, 0.2, 0.7]},
        {"name": "body", "parent": 0, "mesh": 0, "skin": 0, "translation": [9, 9, 9]},
        *more.pop("nodes", ()),
    )


def test_skin_ignores_its_node_and_follows_parents_that_are_not_joints():
    file = file_of(arm(), meshes=(mesh(triangle(1, 2)),), skins=(skin([1, 2], 3),))
    figure = check(file)
    assert figure.skeleton.names == ("root", "hip", "knee")
    assert figure.skeleton.auxiliary is None
    assert figure.mesh.parts == ("body",)
    assert figure.unit == "m"


def test_rigid_mesh_on_a_joint_needs_no_auxiliary_joint():
    helmet = {
        "name": "helmet",
        "parent": 2,
        "mesh": 1,
        "translation": [0, 1, 1],
        "scale": [2, 1, 1],
    }
    sword = {"name": "sword", "parent": 4, "mesh": 1, "rotation": TURNED}
    on_joint = {"name": "knee-pad", "parent": 2, "mesh": 1}
    tree = arm(nodes=(helmet, sword, on_joint))
    meshes = mesh(triangle(1, 2)), mesh(triangle(2))
    figure = check(file_of(tree, meshes=meshes, skins=(skin([1, 2], 3),)))
    assert figure.skeleton.names == ("root", "hip", "knee", "helmet", "sword", "knee-pad")
    assert_array_equal(figure.mesh.triangle_parts, [0, 1, 2, 3])


def test_sheared_matrix_is_represented_by_two_joints():
    sheared = affine(8)
    sheared[:3, 0] *= -1.0
    node = {"name": "bent", "parent": 1, "matrix": sheared, "mesh": 1}
    below = {"name": "below", "parent": 4, "mesh": 1, "translation": [1, 0, 0]}
    tree = arm(nodes=(node, below))
    meshes = mesh(triangle(1, 3)), mesh(triangle(2))
    file = file_of(tree, meshes=meshes, skins=(skin([1, 2, 4], 3),))
    (figure,) = figures_of(file)
    assert_allclose(deform(figure)[0], vertices(file), atol=1e-12)
    assert figure.skeleton.names == ("root", "hip", "knee", "bent", "", "below")
    assert_array_equal(figure.skeleton.auxiliary, [0, 0, 0, 0, 1, 0])
    assert 4 not in figure.skeleton.dof_joints
    moved = {1: local(tree, 1, axis_rotations(1, 0.7))}
    pose = figure_pose(figure)
    pose.dofs[4] = 0.7  # hip.y
    assert_allclose(deform(figure, pose)[0], vertices(file, moved), atol=1e-12)


@pytest.mark.parametrize("agrees", [True, False])
def test_skins_may_share_joints(agrees):
    # If two joints disagree, one of them determines the transform of the vertices.
    first = skin([1, 2], 3)
    other = first.inverse_bind @ affine(9) if agrees else skin([1, 2], 7).inverse_bind
    second = NodeSkin("second", np.array([2, 1], dtype=np.int32), other[::-1])
    tree = arm(nodes=({"name": "shirt", "parent": 1, "mesh": 1, "skin": 1},))
    meshes = mesh(triangle(1, 2)), mesh(triangle(2, 2), triangle(3, 2))
    figure = check(file_of(tree, meshes=meshes, skins=(first, second)))
    assert figure.skeleton.n_joints == (3 if agrees else 4)
    assert figure.mesh.parts == ("shirt", "body")


def test_skin_with_one_different_bind_matrix_gets_one_auxiliary_joint():
    first = skin([0, 1, 2], 3)
    other = first.inverse_bind @ affine(9)
    other[2] = affine(20)
    second = NodeSkin("second", first.joints, other)
    tree = arm(nodes=({"name": "shirt", "parent": 1, "mesh": 1, "skin": 1},))
    meshes = mesh(triangle(1, 3)), mesh(triangle(2, 3))
    figure = check(file_of(tree, meshes=meshes, skins=(first, second)))
    assert figure.skeleton.n_joints == 4


def test_mesh_on_several_nodes_and_singular_matrices_is_posed():
    flat = {"name": "flat", "mesh": 0, "scale": [1, 0, 1], "rotation": TURNED}
    below = {"name": "below", "parent": 0, "mesh": 0, "translation": [0, 1, 2]}
    tree = tree_of(flat, below, {"name": "free", "mesh": 0, "scale": [1, -1, 1]})
    figure = check(file_of(tree, meshes=(mesh(triangle(1)),)))
    assert figure.mesh.n_vertices == 9
    assert figure.mesh.parts == ("flat", "below", "free")
    # Under the reflection, the triangle is flipped to stay counter-clockwise from outside.
    assert_array_equal(figure.mesh.triangles[2], [8, 7, 6])


def test_singular_inverse_bind_matrix_is_applied():
    bound = skin([1, 2], 3)
    matrices = bound.inverse_bind.copy()
    matrices[0, :3, :3] = 0.0
    tree = arm(nodes=({"name": "hat", "parent": 1, "mesh": 1},))
    meshes = mesh(triangle(1, 2)), mesh(triangle(2))
    check(file_of(tree, meshes=meshes, skins=(NodeSkin("", bound.joints, matrices),)))


def test_mesh_can_be_used_with_and_without_a_skin():
    tree = arm(nodes=({"name": "statue", "parent": 2, "mesh": 0, "translation": [5, 0, 0]},))
    check(file_of(tree, meshes=(mesh(triangle(1, 2)),), skins=(skin([1, 2], 3),)))


def test_weights_are_divided_by_their_sum_and_the_deviation_is_reported():
    joints = np.array([[0, 1], [1, 0], [1, 0]], dtype=np.int32)
    weights = np.array([[0.1, 0.1], [1.0, 0.0], [0.0, 0.0]])
    primitive = triangle(1, joints=joints, weights=weights)
    file = file_of(arm(), meshes=(mesh(primitive),), skins=(skin([1, 2], 3),))
    notes = source()
    (figure,) = figure_group(file, notes).figures
    found = {note.key: note.values for note in notes.diagnostics.warnings}
    assert found["W001.divided"]["n"] == 1
    assert found["W001.divided"]["most"] == pytest.approx(0.8)
    assert found["W004.first-joint"]["n"] == 1
    # The last vertex follows the joint of its first slot.
    assert_allclose(figure.skin.weights, [0.5, 0.5, 1.0, 1.0])
    assert_array_equal(figure.skin.joints[-1], 2)


def test_skinning_method_stated_by_the_file_is_recommended():
    bound = skin([1, 2], 3)
    dual = NodeSkin("body", bound.joints, bound.inverse_bind, "dqs")
    notes = source()
    figure_group(file_of(arm(), meshes=(mesh(triangle(1, 2)),), skins=(dual,)), notes)
    (note,) = notes.diagnostics.warnings
    assert (note.key, note.values) == (
        "F007.skinning-method",
        {"names": ["body"], "n": 1, "method": "dqs"},
    )


def test_empty_file_is_refused_and_a_skeleton_is_read():
    with pytest.raises(FormatError) as caught:
        figures_of(file_of(tree_of({"name": "lonely"})))
    assert caught.value.diagnostic.key == "F002.no-figure"
    chain = tree_of({"name": "hip"}, {"name": "knee", "parent": 0, "translation": [0, 1, 0]})
    (figure,) = figures_of(file_of(chain))
    assert figure.mesh is None
    assert figure.skeleton.names == ("hip", "knee")


def test_files_with_only_points_or_lines_are_refused_as_such():
    with pytest.raises(FormatError) as caught:
        figures_of(file_of(tree_of({"name": "cloud", "mesh": 0}), meshes=(NodeMesh("", ()),)))
    assert caught.value.diagnostic.key == "F002.no-figure"
    with pytest.raises(FormatError) as caught:
        figures_of(file_of(tree_of({"name": "a"}), meshes=(mesh(triangle(0)),)))
    assert caught.value.diagnostic.key == "F002.no-figure"
