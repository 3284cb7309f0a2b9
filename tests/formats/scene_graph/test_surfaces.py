"""Normals, colours, materials, blend shapes and animations of figures created from nodes."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from tests.formats.scene_graph.node_files import (
    affine,
    file_of,
    mesh,
    skin,
    source,
    tree_of,
    triangle,
    vertices,
)
from viewer.formats._scene_graph import surfaces
from viewer.formats._scene_graph.content import (
    MorphTargets,
    NodeAnimation,
    NodeChannel,
    NodeSkin,
    Primitive,
)
from viewer.formats._scene_graph.figures import figure_group
from viewer.rigs.figure import figure_pose
from viewer.rigs.material import Material
from viewer.rigs.skinning import deform

CUBE = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
SIDES = np.array(
    [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
)
FACES = np.concatenate([SIDES[:, [0, 1, 2]], SIDES[:, [0, 2, 3]]]).astype(np.int32)


def figure_of(file):
    return figure_group(file, source()).figures[0]


def test_missing_normals_are_flat_and_coplanar_triangles_share_vertices():
    cube = Primitive(CUBE, FACES)
    notes = source()
    (figure,) = figure_group(file_of(tree_of({"mesh": 0}), meshes=(mesh(cube),)), notes).figures
    assert figure.mesh.n_vertices == 24
    corners = figure.mesh.positions[figure.mesh.triangles]
    faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    # The sides have unit length, so their cross product is the unit normal.
    assert_allclose(figure.mesh.normals[figure.mesh.triangles], np.repeat(faces[:, None], 3, 1))
    (note,) = notes.diagnostics.warnings
    assert (note.key, note.values["vertices"]) == ("F007.flat-normals", 16)


def test_nodes_that_share_a_mesh_without_normals_shade_it_once(monkeypatch):
    calls, shade = [], surfaces.flat_shaded
    monkeypatch.setattr(surfaces, "flat_shaded", lambda *given: calls.append(1) or shade(*given))
    many = tree_of(*({"mesh": 0, "translation": [index, 0, 0]} for index in range(5)))
    figure = figure_of(file_of(many, meshes=(mesh(Primitive(CUBE, FACES)),)))
    assert len(calls) == 1
    assert figure.mesh.n_vertices == 5 * 24
    low = figure.mesh.positions.reshape(5, 24, 3).min(axis=1)
    assert_allclose(low, [[index, 0, 0] for index in range(5)])


def test_normals_are_perpendicular_under_a_second_skin_that_shears():
    first = skin([0], 3)
    second = type(first)("", first.joints, first.inverse_bind @ affine(9))
    primitive = triangle(1, 1)
    a, b, c = primitive.positions
    normal = np.cross(b - a, c - a)
    primitive = triangle(1, 1, normals=np.tile(normal, (3, 1)))
    tree = tree_of({"name": "hip"}, {"mesh": 0, "skin": 0}, {"mesh": 0, "skin": 1})
    figure = figure_of(file_of(tree, meshes=(mesh(primitive),), skins=(first, second)))
    moved, normals = deform(figure)
    for rows in (slice(0, 3), slice(3, 6)):
        a, b, c = moved[rows]
        assert_allclose(normals[rows] @ np.stack([b - a, c - a]).T, 0.0, atol=1e-12)


def test_missing_colours_and_materials_of_some_primitives_get_defaults():
    colors = np.full((3, 4), 0.5)
    primitives = triangle(1, colors=colors, material=2), triangle(2), triangle(3, material=0)
    materials = tuple(Material(name) for name in "abc")
    file = file_of(tree_of({"mesh": 0}), meshes=(mesh(*primitives),), materials=materials)
    found = figure_of(file).mesh
    assert [material.name for material in found.materials] == ["a", "c"]
    assert_array_equal(found.triangle_materials, [1, -1, 0])
    assert_array_equal(found.colors, np.concatenate([colors, np.ones((6, 4))]))
    assert_array_equal(found.triangle_parts, 0)


def faces_with_targets():
    """Return nodes, meshes and skins of a face and its teeth, with the targets smile and blink."""
    random = np.random.default_rng(4)
    face = triangle(1, 1, targets=MorphTargets(3, random.normal(size=(2, 3, 3))))
    teeth = triangle(2, 1, targets=MorphTargets(3, random.normal(size=(2, 3, 3))))
    names = {"target_names": ("smile", "blink"), "shape_weights": np.array([0.25, 0.0])}
    tree = tree_of(
        {"name": "hip"},
        {"name": "face", "mesh": 0, "skin": 0},
        {"name": "teeth", "mesh": 1, "skin": 0},
    )
    return tree, (mesh(face, **names), mesh(teeth, **names)), (skin([0], 3),)


def test_targets_of_one_face_share_sliders_and_start_at_their_default_weights():
    tree, meshes, skins = faces_with_targets()
    file = file_of(tree, meshes=meshes, skins=skins)
    figure = figure_of(file)
    assert figure.blend_shapes.names == ("smile", "blink")
    pose = figure_pose(figure)
    assert pose.shape_weights.tolist() == [0.25, 0.0]
    for found in (deform(figure)[0], deform(figure, pose)[0]):
        assert_allclose(found, vertices(file), atol=1e-12)
    pose.shape_weights[:] = 0.5, -1.5
    wanted = vertices(file, morphs={1: pose.shape_weights, 2: pose.shape_weights})
    assert_allclose(deform(figure, pose)[0], wanted, atol=1e-12)


def test_differently_animated_targets_have_separate_sliders():
    tree, meshes, skins = faces_with_targets()
    reads = []

    def channels():
        reads.append(1)
        times, values = np.array([0.0, 1.0]), np.array([[0.0, 1.0], [1.0, 0.5]])
        moved = np.array([[0.0, 0, 0], [1, 0, 0]])
        return (
            NodeChannel(2, "weights", times, values),
            NodeChannel(0, "translation", times, moved),
        )

    animation = NodeAnimation("talk", 0.0, 1.0, frozenset([0, 2]), channels)
    figure = figure_of(file_of(tree, meshes=meshes, skins=skins, animations=(animation,)))
    assert figure.blend_shapes.names == (
        *("face.smile", "face.blink"),
        *("teeth.smile", "teeth.blink"),
    )
    assert reads == [1]
    weights, moved = figure.animations[0].clip().channels
    assert_array_equal(weights.shapes, [2, 3])
    assert (moved.path, moved.joint) == ("translation", 0)
    assert figure.animations[0].clip() is figure.animations[0].clip()
    assert reads == [1]


def test_equally_animated_targets_share_sliders():
    tree, meshes, skins = faces_with_targets()
    times, values = np.array([0.0, 1.0]), np.array([[0.0, 1.0], [1.0, 0.5]])

    def talk():
        return tuple(NodeChannel(node, "weights", times, values.copy()) for node in (1, 2))

    animation = NodeAnimation("talk", 0.0, 1.0, frozenset([1, 2]), talk)
    figure = figure_of(file_of(tree, meshes=meshes, skins=skins, animations=(animation,)))
    assert figure.blend_shapes.names == ("smile", "blink")
    (channel,) = figure.animations[0].clip().channels
    assert_array_equal(channel.shapes, [0, 1])


@pytest.mark.parametrize("key", ["generator", "copyright"])
def test_facts_contain_the_asset_metadata(key):
    file = file_of(tree_of({"mesh": 0}), meshes=(mesh(triangle(1)),), asset={key: "somebody"})
    assert (key, "somebody") in figure_of(file).facts


def test_vertices_are_stored_in_scene_space():
    """A triangle is bound at rest by two joints with matrices that undo a quantisation."""
    tree = tree_of(
        {"name": "hip", "translation": [0, 1, 0]},
        {"name": "knee", "parent": 0, "translation": [0, 2, 0]},
        {"mesh": 0, "skin": 0},
    )
    decode = np.diag([2.0, 2.0, 4.0, 1.0])
    decode[:3, 3] = 5.0, 6.0, 7.0
    matrices = np.stack([decode, decode])
    matrices[:, 1, 3] -= 1.0, 3.0
    bound = NodeSkin("", np.array([0, 1], dtype=np.int32), matrices)
    primitive = triangle(1, 2, normals=np.tile([0.6, 0.0, 0.8], (3, 1)))
    figure = figure_of(file_of(tree, meshes=(mesh(primitive),), skins=(bound,)))
    x, y, z = primitive.positions.T
    scene = np.column_stack([2.0 * x + 5.0, 2.0 * y + 6.0, 4.0 * z + 7.0])
    assert_allclose(figure.mesh.positions, scene, atol=1e-12)
    assert_allclose(deform(figure)[0], scene, atol=1e-12)
    # The normal is divided by the scale, (0.3, 0, 0.2), and keeps its length.
    assert_allclose(figure.mesh.normals[0], np.array([3.0, 0.0, 2.0]) / 13.0**0.5, atol=1e-12)
    inverse = np.tile(np.eye(4), (2, 1, 1))
    inverse[:, 1, 3] = -1.0, -3.0
    assert_allclose(figure.skin.inverse_bind[:2], inverse, atol=1e-12)
