"""Figures of node files, posed as glTF defines."""

import time
from dataclasses import replace
from pathlib import Path

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
from viewer.formats._scene_graph.content import (
    MorphTargets,
    NodeAnimation,
    NodeCamera,
    NodeFile,
    NodeMesh,
    NodeSkin,
    NodeTree,
)
from viewer.formats._scene_graph.figures import figure_group
from viewer.formats._scene_graph.grouping import group_nodes
from viewer.loading.assembly import assemble
from viewer.loading.contents import Contents
from viewer.rigs.figure import Figure, FigureGroup, figure_pose
from viewer.rigs.geometry.rotation import axis_rotations
from viewer.rigs.skinning import deform

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
    # The last vertex follows the joint of its first slot, which the file does not say.
    assert_array_equal(figure.skin.unweighted, [False, False, True])
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


EYE = (NodeCamera("eye", 0.8, 1.5),)


def group_of(file: NodeFile) -> FigureGroup:
    return figure_group(file, source())


def moved(*nodes: int) -> NodeAnimation:
    return NodeAnimation("wave", 0.0, 1.0, frozenset(nodes), lambda: ())


def two_characters(cameras=EYE, **more) -> NodeFile:
    tree = tree_of(
        {"name": "scene"},
        {"name": "hero", "parent": 0},
        {"name": "hip", "parent": 1},
        {"name": "skin", "parent": 1, "mesh": 0, "skin": 0},
        {"name": "villain", "parent": 0, "translation": [5, 0, 0]},
        {"name": "hip", "parent": 4},
        {"name": "skin", "parent": 4, "mesh": 0, "skin": 1},
        {"name": "chair", "parent": 0, "mesh": 1},
        {"name": "hat", "parent": 5, "mesh": 1},
        {"name": "eye", "parent": 0, "camera": 0, "translation": [0, 0, 4]},
    )
    meshes = mesh(triangle(1, 1)), mesh(triangle(2))
    return file_of(tree, meshes=meshes, skins=(skin([2], 3), skin([5], 4)), cameras=cameras, **more)


def test_independent_characters_and_remaining_meshes_are_separate_figures():
    hero, villain, rest = group_of(two_characters()).figures
    assert [figure.name for figure in (hero, villain, rest)] == ["hero", "villain", "chair"]
    assert hero.skeleton.names == ("hip",)
    assert villain.skeleton.names == ("villain", "hip", "hat")
    assert villain.mesh.parts == ("hat", "skin")
    assert rest.mesh.parts == ("chair",)


def test_skins_name_figures_whose_topmost_node_is_a_joint():
    tree = tree_of(
        {"name": "root"},
        {"name": "skin", "mesh": 0, "skin": 0},
        {"name": "hip"},
        {"name": "skin", "mesh": 0, "skin": 1},
    )
    skins = replace(skin([0], 3), name="fox"), replace(skin([2], 4), name="")
    file = file_of(tree, meshes=(mesh(triangle(1, 1)),), skins=skins)
    assert [figure.name for figure in group_of(file).figures] == ["fox", "hip"]


def test_nested_skins_are_one_figure_named_after_the_file():
    tree = tree_of(
        {"name": "hip"},
        {"name": "spine", "parent": 0},
        {"name": "neck", "parent": 1},
        {"name": "body", "mesh": 0, "skin": 0},
        {"name": "", "mesh": 1, "skin": 1},
    )
    meshes = mesh(triangle(1, 1)), mesh(triangle(2, 1), name="head")
    file = file_of(tree, meshes=meshes, skins=(skin([0], 3), skin([2], 4)))
    (figure,) = group_of(file).figures
    assert figure.name == "hero"
    assert figure.mesh.parts == ("body", "head")


def test_identity_ancestors_are_dropped_unless_animated():
    def names(*animations: NodeAnimation) -> tuple[str, ...]:
        tree = tree_of(
            {"name": "scene"},
            {"name": "armature", "parent": 0},
            {"name": "hip", "parent": 1, "translation": [0, 1, 0]},
            {"name": "body", "mesh": 0, "skin": 0},
        )
        file = file_of(
            tree, meshes=(mesh(triangle(1, 1)),), skins=(skin([2], 3),), animations=animations
        )
        return group_of(file).figures[0].skeleton.names

    assert names() == ("hip",)
    assert names(moved(0)) == ("scene", "armature", "hip")
    assert names(moved(1)) == ("armature", "hip")


def test_meshes_without_skins_are_one_figure():
    tree = tree_of({"name": "a", "mesh": 0}, {"name": "b", "mesh": 0}, {"name": "c", "parent": 1})
    (figure,) = group_of(file_of(tree, meshes=(mesh(triangle(1)),), animations=(moved(2),))).figures
    assert figure.skeleton.names == ("a", "b", "c")
    assert [animation.name for animation in figure.animations] == ["wave"]


def test_animations_are_assigned_to_the_figures_that_they_move():
    file = two_characters(animations=(moved(5), moved(0), moved(2)))
    hero, villain, rest = group_of(file).figures
    assert len(hero.animations) == len(villain.animations) == 2
    assert len(rest.animations) == 1


def test_actors_and_cameras_of_a_file_keep_their_relative_positions():
    first, second = (group_of(two_characters()) for _ in range(2))
    assert first.views[0].name == "eye"
    contents = Contents()
    for path, group in ((Path("a.glb"), first), (Path("b.glb"), second)):
        contents.figures += [(path, figure) for figure in group.figures]
        contents.groups.append(group)
    scene = assemble(contents)
    assert [actor.title for actor in scene.actors] == [
        *("hero", "villain", "chair"),
        *("hero-2", "villain-2", "chair-2"),
    ]
    placements = [actor.placement for actor in scene.actors]
    assert_allclose(placements[:3], np.tile(np.eye(4), (3, 1, 1)))
    assert_allclose(placements[3:], np.tile(placements[3], (3, 1, 1)))
    shift = placements[3][:3, 3]
    assert shift[0] > 0.0
    # In the file, the camera is at (0, 0, 4) and looks along -z.
    for view, eye in zip(scene.views, ([0, 0, 4], np.add([0, 0, 4], shift)), strict=True):
        assert_allclose(-view.rotation.T @ view.translation, eye, atol=1e-12)
        assert_allclose(view.rotation.T @ [0, 0, 1], [0, 0, -1], atol=1e-12)
        assert view.size == (1620, 1080)


def test_omitted_orthographic_cameras_are_reported():
    notes = source()
    group = figure_group(two_characters(cameras=(NodeCamera("plan", None, None, 2.0),)), notes)
    assert group.views == ()
    (note,) = notes.diagnostics.warnings
    assert (note.key, note.values["names"]) == ("F007.orthographic", ["eye"])


def test_deep_chain_of_nodes_is_grouped_in_linear_time():
    def seconds(count: int) -> float:
        parents = np.arange(-1, count - 1, dtype=np.int32)
        meshes = np.full(count, -1, dtype=np.int32)
        meshes[-1] = 0
        tree = NodeTree(
            names=("n",) * count,
            parents=parents,
            translations=np.zeros((count, 3)),
            rotations=np.tile([0.0, 0, 0, 1], (count, 1)),
            scales=np.ones((count, 3)),
            meshes=meshes,
            skins=np.full(count, -1, dtype=np.int32),
            cameras=np.full(count, -1, dtype=np.int32),
        )
        file = NodeFile("deep", tree, (0,), meshes=(mesh(triangle(1)),))
        start = time.process_time()
        assert len(group_nodes(file)) == 1
        return time.process_time() - start

    seconds(1000)
    # Quadratic time would be 256 times as long.
    assert seconds(32000) < 100.0 * max(seconds(2000), 1e-3)


def test_animations_of_other_nodes_are_reported():
    """A camera moves on its own, a lamp does not; the transform of a skinned mesh has no effect."""
    tree = tree_of(
        {"name": "root"},
        {"name": "hip", "parent": 0},
        {"name": "skin", "parent": 0, "mesh": 0, "skin": 0},
        {"name": "eye", "parent": 0, "camera": 0},
        {"name": "lamp"},
    )
    meshes, cameras = (mesh(triangle(1, 1)),), (NodeCamera("plan", 1.0),)
    sweep = NodeAnimation("sweep", 0.0, 1.0, frozenset({1, 2, 3, 4}), tuple)
    file = file_of(tree, meshes=meshes, skins=(skin([1], 3),), cameras=cameras)
    notes = source()
    figure_group(replace(file, animations=(sweep,)), notes)
    (note,) = notes.diagnostics.warnings
    assert (note.key, note.values["names"]) == ("F007.animated-others", ["lamp"])


UP = np.array([[0, 0, 0], [0, 1, 0], [0, 0, 0], [0, 2, 0]], dtype=np.float32)
ASIDE = np.array([[1, 0, 0], [1, 0, 0], [1, 0, 0], [1, 0, 0]], dtype=np.float32)


def test_only_moved_vertices_are_stored():
    targets = MorphTargets(4, [UP, None, ASIDE])
    vertices, offsets = targets.moved(0)
    assert_array_equal(vertices, [1, 3])
    assert_array_equal(offsets, [[0, 1, 0], [0, 2, 0]])
    assert len(targets) == 3 and len(targets.moved(1)[0]) == 0


def test_weighted_sum_matches_the_dense_array():
    targets = MorphTargets(4, [UP, None, ASIDE])
    expected = [[-3, 0, 0], [-3, 0.5, 0], [-3, 0, 0], [-3, 1, 0]]
    assert_array_equal(targets.weighted(np.array([0.5, 7.0, -3.0])), expected)
    assert_array_equal(targets.dense(), [UP, np.zeros((4, 3)), ASIDE])


def test_rows_select_vertices_of_the_file():
    targets = MorphTargets(2, [UP, ASIDE], rows=np.array([3, 0]))
    assert_array_equal(targets.dense(), [UP[[3, 0]], ASIDE[[3, 0]]])
