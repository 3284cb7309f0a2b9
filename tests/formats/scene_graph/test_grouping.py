"""Division of node files into figures, and the names of figures and parts."""

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.testing import assert_allclose

from tests.formats.scene_graph.node_files import file_of, mesh, skin, source, tree_of, triangle
from viewer.formats._scene_graph.content import NodeAnimation, NodeCamera, NodeFile, NodeTree
from viewer.formats._scene_graph.figures import figure_group
from viewer.formats._scene_graph.grouping import group_nodes
from viewer.loading.assembly import assemble
from viewer.loading.contents import Contents
from viewer.rig.figure import FigureGroup

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
