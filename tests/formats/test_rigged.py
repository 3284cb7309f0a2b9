"""Rigged meshes in one ``.npz``: what is written is read, and what is broken is named."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import viewer
from viewer.errors import FormatError, RigError
from viewer.formats import Source, detect, read
from viewer.formats.rigged import figure_arrays, save
from viewer.rig.annotations import VertexField
from viewer.rig.blendshapes import Correctives
from viewer.rig.figure import Figure
from viewer.rig.hands import Hand
from viewer.rig.mesh import Material, Mesh, vertex_normals
from viewer.rig.posing.pose_vector import PoseLayout
from viewer.rig.skeleton import ball_skeleton
from viewer.rig.skin import skin_from_lists


def figure() -> Figure:
    """Return a figure that has everything the format can hold."""
    positions = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.5]])
    triangles = np.array([[0, 1, 2], [0, 2, 3]])
    mesh = Mesh(
        positions,
        vertex_normals(positions, triangles),
        triangles,
        uvs=np.arange(10.0).reshape(5, 2),
        uv_triangles=np.array([[0, 1, 2], [0, 2, 4]]),
        materials=(
            Material("skin", "skin.png", np.arange(48, dtype=np.uint8).reshape(3, 4, 4)),
            Material("plain"),
        ),
        triangle_materials=np.array([1, 0]),
    )
    skeleton = ball_skeleton(("root", "tïp"), np.array([-1, 0]), np.array([[0.0, 0, 0], [1, 0, 0]]))
    skeleton = replace(skeleton, boxes=np.arange(12.0).reshape(2, 2, 3))
    rows = [[(0, 1.0)], [(1, 0.25), (0, 0.75)], [(1, 1.0)], []]
    return Figure(
        "scan",
        mesh,
        skeleton,
        skin_from_lists(rows, np.tile(np.eye(4), (2, 1, 1))),
        up="z",
        unit="m",
        correctives=Correctives(np.arange(108.0).reshape(9, 4, 3) / 8.0),
        hands=(Hand("left", np.array([1]), np.ones((2, 3)), np.zeros(3)),),
        pose_layout=PoseLayout(10, np.array([3, 6]), np.array([True, False]), 0, 9),
        fields=(
            VertexField("how", "How found", np.array([0, 1, 1, 0]), names=("near", "filled")),
            VertexField("far", "How far", np.array([0.5, 0, 2, 1]), "length"),
        ),
    )


def arrays_of(**changes):
    arrays = figure_arrays(figure()) | changes
    return {key: value for key, value in arrays.items() if value is not None}


def same(found, wanted):
    """Compare two of our dataclasses, part by part."""
    for part in fields(wanted):
        one, other = getattr(found, part.name), getattr(wanted, part.name)
        if isinstance(other, np.ndarray):
            assert_array_equal(one, other, err_msg=part.name)
        else:
            assert one == other, part.name


def test_everything_that_is_written_is_read(tmp_path):
    path, wanted = tmp_path / "scan.npz", figure()
    save(wanted, path, {"alignment": np.eye(4)})
    source = Source.open(path)
    assert detect(source) == "rigged"
    found = read(source)
    assert source.warnings == []
    assert (found.name, found.up, found.unit) == ("scan", "z", "m")
    for part in ("skeleton", "skin", "pose_layout"):
        same(getattr(found, part), getattr(wanted, part))
    same(found.hands[0], wanted.hands[0])
    assert len(found.fields) == 2
    for one, other in zip(found.fields, wanted.fields, strict=True):
        same(one, other)
    for part in ("positions", "normals", "triangles", "uvs", "uv_triangles", "triangle_materials"):
        assert_array_equal(getattr(found.mesh, part), getattr(wanted.mesh, part))
    assert [(m.name, m.texture) for m in found.mesh.materials] == [
        ("skin", "skin.png"),
        ("plain", None),
    ]
    assert_array_equal(found.mesh.materials[0].image, wanted.mesh.materials[0].image)
    assert found.mesh.materials[1].image is None
    # Eighths are exact in float32, too.
    assert_array_equal(found.correctives.values(), wanted.correctives.values())


def test_parts_that_a_figure_lacks_are_left_out(tmp_path):
    whole = figure()
    bare = Figure(
        "bare",
        Mesh(whole.mesh.positions, whole.mesh.normals, whole.mesh.triangles),
        replace(whole.skeleton, boxes=None),
        whole.skin,
    )
    save(bare, tmp_path / "bare.npz")
    scene = viewer.load(tmp_path / "bare.npz")
    assert scene.warnings == ()
    found = scene.actors[0].figure
    assert found.is_attached and found.mesh.uvs is None and found.mesh.materials == ()
    assert (found.correctives, found.pose_layout, found.hands) == (None, None, ())
    assert found.skeleton.boxes is None
    assert_allclose(viewer.deform(found)[0], viewer.deform(bare)[0])


@pytest.mark.parametrize("part", ["mesh", "skeleton", "skin"])
def test_figure_without_a_rig_is_not_written(tmp_path, part):
    lacking = {"skin": None, part: None, "correctives": None}
    with pytest.raises(RigError) as problem:
        save(replace(figure(), fields=(), **lacking), tmp_path / "x.npz")
    assert str(problem.value) == "figure scan: expected mesh, skeleton and skin to write a rig"
    assert list(tmp_path.iterdir()) == []


BROKEN = {
    "version": ({"viewer_rig": np.array(2)}, "viewer_rig: expected version 1, found 2"),
    "no version": (
        {"viewer_rig": np.array("one")},
        "viewer_rig: expected a single number, found a text",
    ),
    "up": ({"up": np.array("x")}, 'up: expected y or z, found "x"'),
    "no positions": ({"positions": None}, "positions: expected a value, found no such key"),
    "nan": (
        {"positions": np.full((4, 3), np.nan)},
        "positions: expected finite numbers, found 12 that are not",
    ),
    "triangles": (
        {"triangles": np.array([[0, 1, 4], [0, 1, 2]])},
        "triangles: expected a vertex from 0 to 3, found 4",
    ),
    "joints": (
        {"parents": np.array([-1, 0, 0])},
        "parents: expected 2 numbers, found 3 int64",
    ),
    "cycle": (
        {"parents": np.array([1, 0])},
        "joint root: expected a parent before it, found 1",
    ),
    "skin": (
        {"skin_joints": np.array([0, 1, 0, 2])},
        "joints: expected indices 0 to 1, found 0 to 2",
    ),
    "weights": ({"skin_weights": np.ones(3)}, "weights: expected shape 4, found 3"),
    "vertices": (
        {"skin_starts": np.array([0, 1, 4])},
        "figure scan: the skin binds 2 vertices, the mesh has 4",
    ),
    "bindings": (
        {"inverse_bind": np.tile(np.eye(4), (3, 1, 1))},
        "figure scan: the skin has 3 binding matrices, the skeleton has 2 joints",
    ),
    "correctives": (
        {"correctives": np.zeros((18, 4, 3))},
        "correctives: expected 9 x any x 3 numbers, found 18 x 4 x 3 float64",
    ),
    "limits": (
        {"dof_limits": np.full((6, 2), np.nan)},
        "dof_limits: expected shape 6 x 2 without NaN",
    ),
    "textures": (
        {"material_textures": np.array(["a"])},
        "material_textures: expected 2, found 1",
    ),
    "layout": (
        {"layout_starts": np.array([3, 8])},
        "layout_counts: expected at least 11, found 10",
    ),
    "hand": (
        {"hand_0_joints": np.array([2])},
        "hand_0_joints: expected joints 0 to 1, found others",
    ),
}


@pytest.mark.parametrize(("changes", "message"), BROKEN.values(), ids=BROKEN)
def test_broken_files_are_refused_by_key(tmp_path, changes, message):
    path = tmp_path / "scan.npz"
    np.savez(path, **arrays_of(**changes))
    with pytest.raises(FormatError) as problem:
        read(Source.open(path))
    assert str(problem.value) == f"{path}: {message}"


def test_correctives_of_another_mesh_are_refused(tmp_path):
    path = tmp_path / "scan.npz"
    np.savez(path, **arrays_of(correctives=np.zeros((9, 5, 3))))
    with pytest.raises(FormatError) as problem:
        read(Source.open(path))
    assert str(problem.value) == (
        f"{path}: figure scan: the correctives have 5 vertices, the mesh has 4"
    )
