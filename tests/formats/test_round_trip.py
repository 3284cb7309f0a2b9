"""Round trips of all writers, and refusal of content that a format cannot store."""

import math
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from viewer.errors import OutputError, UnsupportedFormatError
from viewer.formats import Source, skel, skin, write
from viewer.rigs.figure import Figure
from viewer.rigs.material import Material, Texture
from viewer.rigs.mesh import Mesh
from viewer.rigs.skeleton import Skeleton
from viewer.rigs.skin import skin_from_lists

INF = math.inf
LARGEST = float(np.finfo(np.float32).max)


def skeleton(parents, **changes) -> Skeleton:
    """Build a skeleton with the DOFs of ``.skel``."""
    n_joints = len(parents)
    parts = {
        "names": tuple(f"j{joint}" for joint in range(n_joints)),
        "parents": parents,
        "rest_translations": np.zeros((n_joints, 3)),
        "rest_rotations": np.tile([0.0, 0, 0, 1], (n_joints, 1)),
        "rest_scales": np.ones((n_joints, 3)),
        "dof_joints": np.repeat(np.arange(n_joints), [6] + [3] * (n_joints - 1)),
        "dof_kinds": [0, 1, 2] + [3, 4, 5] * n_joints,
        "rest_dofs": np.zeros(3 + 3 * n_joints),
        "dof_limits": np.tile([-INF, INF], (3 + 3 * n_joints, 1)),
        "boxes": np.tile([[-0.1] * 3, [0.1] * 3], (n_joints, 1, 1)),
    }
    return Skeleton(**{**parts, **changes})


def again(figure, kind):
    """Write a figure and read the file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, f"figure.{kind.__name__.rpartition('.')[2]}")
        write(figure, path)
        source = Source.open(path)
        return kind.read(source), source.warnings


def assert_equal_skeletons(found, wanted):
    assert found.names == wanted.names
    for name in ("parents", "rest_translations", "dof_joints", "dof_kinds", "rest_dofs", "boxes"):
        assert np.array_equal(getattr(found, name), getattr(wanted, name)), name
    assert np.array_equal(found.dof_limits, wanted.dof_limits)
    assert np.array_equal(found.rest_rotations, wanted.rest_rotations)
    assert np.array_equal(found.rest_scales, wanted.rest_scales)


def assert_equal_meshes(found, wanted):
    for name in ("positions", "normals", "triangles", "material_indices"):
        assert np.array_equal(getattr(found, name), getattr(wanted, name)), name
    assert (found.uvs is None) == (wanted.uvs is None)
    assert found.uvs is None or np.array_equal(found.uvs, wanted.uvs)
    names = [(material.name, material.texture) for material in found.materials]
    assert names == [(material.name, material.texture) for material in wanted.materials]


def assert_equal_skins(found, wanted):
    for name in ("starts", "joints", "weights"):
        assert np.array_equal(getattr(found, name), getattr(wanted, name)), name
    # The file stores the bind matrices, not their inverses.
    assert_allclose(found.inverse_bind, wanted.inverse_bind, rtol=1e-12, atol=1e-12)


pytestmark = pytest.mark.slow


def mesh(n_vertices=3, **changes) -> Mesh:
    positions = np.arange(3.0 * n_vertices).reshape(-1, 3)
    parts = {"positions": positions, "normals": positions + 1, "triangles": [[0, 1, 2]]}
    return Mesh(**{**parts, **changes})


def test_handmade_skeleton_round_trips():
    wanted = skeleton(
        [-1, 0, 1, 0, -1],
        names=("root", "left leg", "", "left leg", "\udce9t\u00e9 a\u00a0b"),
        rest_translations=np.array([[0.1, -0.0, 1e-300], [1 / 3, 2, LARGEST], *[[0, 0, 0]] * 3]),
        rest_dofs=[0, 0, 0, 0.5, -1.5, 0, 0.25, *[0] * 11],
        dof_limits=[
            *[[-INF, INF]] * 3,
            *[[0.5, 0.5], [-INF, -1], [-2, INF], [0.25, 99999.0]],
            *[[-INF, INF]] * 11,
        ],
        boxes=np.sort(np.random.default_rng(0).normal(size=(5, 2, 3)), axis=1),
    )
    found, warnings = again(Figure("a", skeleton=wanted), skel)
    assert warnings == []
    assert_equal_skeletons(found.skeleton, wanted)


def test_one_sided_limits_beyond_100000_round_trip():
    limits = np.tile([-INF, INF], (6, 1))
    limits[3], limits[4] = (200_000, INF), (-INF, -200_000)
    wanted = skeleton([-1], dof_limits=limits, rest_dofs=[0, 0, 0, 200_000, -200_000, 0])
    assert_equal_skeletons(again(Figure("a", skeleton=wanted), skel)[0].skeleton, wanted)


def test_skeleton_without_boxes_round_trips_with_default_boxes():
    found, _ = again(Figure("a", skeleton=skeleton([-1], boxes=None)), skel)
    assert found.skeleton.boxes.tolist() == [[[-0.1] * 3, [0.1] * 3]]


def test_5000_nested_joints_round_trip():
    wanted = skeleton(np.arange(-1, 4_999))
    assert_equal_skeletons(again(Figure("a", skeleton=wanted), skel)[0].skeleton, wanted)


def test_handmade_skin_round_trips():
    image = np.zeros((1, 1, 4), np.uint8)
    shape = mesh(
        uvs=[[0.1, 0.2], [1.07, -3], [0, 1]],
        triangles=[[0, 1, 2], [2, 1, 0], [0, 0, 1], [1, 2, 2]],
        materials=(
            Material("face", Texture("a b.png", image)),
            Material("unused one", Texture("x\\b.png")),
            Material(),
        ),
        triangle_materials=[-1, 0, 0, 2],
    )
    bind = np.tile(np.eye(4), (2, 1, 1))
    bind[1, :3] = [[0, -2, 0, 1], [2, 0, 0, 2], [0.5, 0, 2, 3]]
    influences = [[(0, 0.1), (1, 0.2), (0, -0.0)], [], [(1, 1 / 3)]]
    wanted = Figure("a", shape, skin=skin_from_lists(influences, np.linalg.inv(bind)))
    found, _ = again(wanted, skin)
    assert_equal_meshes(found.mesh, wanted.mesh)
    assert_equal_skins(found.skin, wanted.skin)
    assert np.array_equal(found.mesh.materials[0].image, image)  # the texture was written too


def test_mesh_without_skin_round_trips():
    found, warnings = again(Figure("a", mesh()), skin)
    assert_equal_meshes(found.mesh, mesh())
    assert found.skin is None
    assert len(warnings) == 1


def test_existing_different_images_are_not_replaced(tmp_path):
    (tmp_path / "a.png").write_bytes(b"mine")
    textured = mesh(materials=(Material("", Texture("a.png", np.zeros((1, 1, 4), np.uint8))),))
    with pytest.raises(OutputError, match=r"a\.png: a different image already exists"):
        write(Figure("a", textured), tmp_path / "a.skin")
    assert (tmp_path / "a.png").read_bytes() == b"mine"
    assert [path.name for path in tmp_path.iterdir()] == ["a.png"]


def test_textures_in_subfolders_round_trip(tmp_path):
    image = np.arange(16, dtype=np.uint8).reshape(2, 2, 4)
    textured = mesh(materials=(Material("", Texture("sub/b.png", image)),))
    for _ in range(2):  # the second time the same texture exists
        write(Figure("a", textured), tmp_path / "a.skin")
    found = skin.read(Source.open(tmp_path / "a.skin")).mesh.materials[0]
    assert found.texture == "sub/b.png" and np.array_equal(found.image, image)


def test_textures_outside_the_folder_are_not_written(tmp_path):
    image = np.zeros((1, 1, 4), np.uint8)
    textured = mesh(materials=(Material("", Texture("../b.png", image)),))
    (tmp_path / "here").mkdir()
    with pytest.raises(UnsupportedFormatError, match="outside the folder"):
        write(Figure("a", textured), tmp_path / "here" / "a.skin")
    assert not (tmp_path / "b.png").exists()


@pytest.mark.parametrize("name", ["wasp", "tube"])
def test_real_files_round_trip(shared, name):
    skeleton_read = skel.read(Source.open(shared / f"{name}.skel"))
    assert_equal_skeletons(again(skeleton_read, skel)[0].skeleton, skeleton_read.skeleton)
    skin_read = skin.read(Source.open(shared / f"{name}.skin"))
    found, warnings = again(skin_read, skin)
    assert warnings == []
    assert_equal_meshes(found.mesh, skin_read.mesh)
    assert_equal_skins(found.skin, skin_read.skin)


# Content that a format cannot store


def refused_for(caught):
    found = caught.value.diagnostic
    return found.key, found.values


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        (
            {"rest_rotations": [[0, 0, 1, 1]]},
            ("F002.skel-rest", {}),
        ),
        ({"rest_scales": [[1, 2, 1]]}, ("F002.skel-rest", {})),
        (
            {"dof_kinds": [0, 1, 2, 5, 4, 3]},
            ("F002.skel-dofs", {}),
        ),
        (
            {"rest_dofs": [1.0, 0, 0, 0, 0, 0]},
            ("F002.skel-root", {}),
        ),
        (
            {"dof_limits": [[0, 1], *[[-INF, INF]] * 5]},
            ("F002.skel-root", {}),
        ),
        (
            {"dof_limits": [*[[-INF, INF]] * 5, [0, 100_000]]},
            ("F002.skel-limits", {"most": 100000.0}),
        ),
        ({"rest_translations": [[0, 1e39, 0]]}, ("F002.skel-numbers", {"most": LARGEST})),
        ({"boxes": [[[-1e39, 0, 0], [0, 0, 0]]]}, ("F002.skel-numbers", {"most": LARGEST})),
        ({"names": ("a{b",)}, ("F002.skel-name", {"name": "a{b"})),
        ({"names": ("a  b",)}, ("F002.skel-name", {"name": "a  b"})),
        ({"names": ("a\nb",)}, ("F002.skel-name", {"name": "a\nb"})),
        ({"names": (" a",)}, ("F002.skel-name", {"name": " a"})),
        ({"names": ("the pose",)}, ("F002.skel-name", {"name": "the pose"})),
        ({"names": ("\ud800",)}, ("F002.skel-name", {"name": "\ud800"})),
    ],
)
def test_skeleton_that_the_format_cannot_store_is_refused(tmp_path, changes, fault):
    with pytest.raises(UnsupportedFormatError) as caught:
        write(Figure("a", skeleton=skeleton([-1], **changes)), tmp_path / "a.skel")
    assert refused_for(caught) == fault
    assert list(tmp_path.iterdir()) == []


def test_skeleton_not_in_depth_first_order_is_refused(tmp_path):
    breadth_first = skeleton([-1, 0, 0, 1])
    with pytest.raises(UnsupportedFormatError) as caught:
        write(Figure("a", skeleton=breadth_first), tmp_path / "a.skel")
    assert refused_for(caught) == ("F002.skel-order", {"joint": "j3"})


def test_skeleton_with_fewer_dofs_is_refused(tmp_path):
    few = skeleton([-1], dof_joints=[0], dof_kinds=[3], rest_dofs=[0], dof_limits=[[-1, 1]])
    with pytest.raises(UnsupportedFormatError) as caught:
        write(Figure("a", skeleton=few), tmp_path / "a.skel")
    assert refused_for(caught) == ("F002.skel-dofs", {})


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"triangles": np.zeros((0, 3), np.int32)},
            "figure a has no triangles to write as .skin",
        ),
        ({"positions": np.full((3, 3), 1e39)}, ".skin cannot store numbers beyond 3.4e+38"),
        ({"uvs": np.full((3, 2), -1e39)}, ".skin cannot store numbers beyond 3.4e+38"),
        (
            {
                "materials": (Material("x"), Material("y")),
                "triangles": [[0, 1, 2]] * 3,
                "triangle_materials": [0, 1, 0],
            },
            ".skin cannot return to an earlier material",
        ),
        (
            {
                "materials": (Material("x"),),
                "triangles": [[0, 1, 2]] * 2,
                "triangle_materials": [0, -1],
            },
            ".skin cannot return to an earlier material",
        ),
        (
            {"materials": (Material("a{", Texture("b.png")),)},
            '.skin cannot store the material "a{" with the texture "b.png"',
        ),
        (
            {"materials": (Material("my normals", Texture("b.png")),)},
            '.skin cannot store the material "my normals" with the texture "b.png"',
        ),
        (
            {"materials": (Material("a", Texture("b}.png")),)},
            '.skin cannot store the material "a" with the texture "b}.png"',
        ),
        (
            {"materials": (Material("a", Texture(" b.png")),)},
            '.skin cannot store the material "a" with the texture " b.png"',
        ),
        (
            {"materials": (Material("a", Texture("b\nc.png")),)},
            '.skin cannot store the material "a" with the texture "b\\nc.png"',
        ),
        (
            {"materials": (Material("a", Texture("")),)},
            '.skin cannot store the material "a" with the texture ""',
        ),
        (
            {"materials": (Material("\ud800", Texture("\ud800")),)},
            '.skin cannot store the material "\\ud800" with the texture "\\ud800"',
        ),
    ],
)
def test_mesh_that_the_format_cannot_store_is_refused(tmp_path, changes, message):
    with pytest.raises(UnsupportedFormatError) as caught:
        write(Figure("a", mesh(**changes)), tmp_path / "a.skin")
    assert str(caught.value) == message
    assert list(tmp_path.iterdir()) == []


def test_weights_beyond_float32_are_refused(tmp_path):
    heavy = skin_from_lists([[(0, 1e39)], [], []], np.eye(4)[None])
    with pytest.raises(UnsupportedFormatError) as caught:
        write(Figure("a", mesh(), skin=heavy), tmp_path / "a.skin")
    assert str(caught.value) == ".skin cannot store numbers beyond 3.4e+38"


def test_missing_parts_of_a_figure_cannot_be_written(tmp_path):
    with pytest.raises(UnsupportedFormatError) as caught:
        write(Figure("a", mesh()), tmp_path / "a.skel")
    assert str(caught.value) == "figure a has no skeleton to write as .skel"
    with pytest.raises(UnsupportedFormatError) as caught:
        write(Figure("a", skeleton=skeleton([-1])), tmp_path / "a.skin")
    assert str(caught.value) == "figure a has no mesh to write as .skin"


def test_unknown_suffix_cannot_be_written(tmp_path):
    known = ".skel, .skin, .anim, .json, .npz, .txt"
    with pytest.raises(UnsupportedFormatError) as caught:
        write(Figure("a", mesh()), tmp_path / "a.xyz")
    assert str(caught.value) == f'no writer for ".xyz"; supported: {known}'


def test_suffix_in_capitals_is_written(tmp_path):
    write(Figure("a", mesh()), tmp_path / "A.SKIN")
    assert (tmp_path / "A.SKIN").read_text().startswith("positions 3 {\n")


def test_properties_of_materials_that_skin_omits_are_reported(tmp_path):
    plain = Material("a", Texture("a.png", np.full((1, 1, 4), 255, np.uint8)))
    figure = Figure("a", mesh(uvs=np.zeros((3, 2)), materials=(plain,), triangle_materials=[0]))
    assert write(figure, tmp_path / "a.skin") == []
    tinted = replace(plain, base_color=(1.0, 0.0, 0.0, 1.0), alpha_mode="mask")
    more = {"other_uvs": (np.ones((3, 2)),), "colors": np.ones((3, 4)), "parts": ("hat",)}
    shape = replace(figure.mesh, materials=(tinted,), **more)
    (note,) = write(Figure("a", shape), tmp_path / "a.skin")
    parts = [
        "material properties except one texture each",
        "second texture coordinates",
        "vertex colours",
        "names of its parts",
    ]
    assert (note.key, note.values) == ("X003.parts", {"format": ".skin", "parts": parts})


def test_texture_seams_are_split(tmp_path):
    """Vertices 0 and 2 of three have different coordinates in the second of two triangles."""
    uvs = np.arange(10.0).reshape(5, 2)
    shape = mesh(triangles=[[0, 1, 2], [0, 2, 1]], uvs=uvs, uv_triangles=[[0, 1, 2], [3, 4, 1]])
    weights = skin_from_lists([[(0, 1.0)], [(0, 0.5), (1, 0.5)], [(1, 1.0)]], [np.eye(4)] * 2)
    (note,) = write(Figure("a", shape, skin=weights), tmp_path / "a.skin")
    assert (note.key, note.values) == ("X005.seams", {"before": 3, "after": 5})
    found = skin.read(Source.open(tmp_path / "a.skin"))
    assert np.array_equal(found.mesh.uvs[found.mesh.triangles], uvs[shape.uv_triangles])
    corners = found.mesh.positions[found.mesh.triangles]
    assert np.array_equal(corners, shape.positions[shape.triangles])
    assert found.skin.weights.tolist() == [1.0, 1.0, 0.5, 0.5, 1.0, 1.0]


# Generated figures

NUMBERS = st.floats(-LARGEST, LARGEST, allow_nan=False)
SMALL = st.floats(-10, 10)
LETTERS = st.characters(exclude_characters="{} \t\n\r\v\f\ud800", exclude_categories=["Cs"])
WORDS = st.text(LETTERS, min_size=1, max_size=6).filter(
    lambda word: word.encode() not in {*skel.KEYWORDS, b"texture"}
)
NAMES = st.lists(WORDS, max_size=3).map(" ".join)


@st.composite
def skeletons(draw):
    n_joints = draw(st.integers(1, 8))
    parents, path = [-1], [0]
    for joint in range(1, n_joints):
        # In depth-first order, a parent is the previous joint, one of its ancestors, or none.
        parent = draw(st.sampled_from([-1, *path]))
        path = [*path[: path.index(parent) + 1], joint] if parent >= 0 else [joint]
        parents.append(parent)
    bound = st.one_of(st.just(INF), st.floats(-99_999, 99_999))
    limits, dofs = [[-INF, INF]] * 3, [0.0] * 3
    for _ in range(3 * n_joints):
        low, high = -draw(bound), draw(bound)
        low, high = (low, high) if low <= high else (high, low)
        limits, dofs = [*limits, [low, high]], [*dofs, min(max(draw(NUMBERS), low), high)]
    triples = st.lists(NUMBERS, min_size=3, max_size=3)
    corners = st.lists(triples, min_size=2, max_size=2)
    return skeleton(
        parents,
        names=tuple(draw(st.lists(NAMES, min_size=n_joints, max_size=n_joints))),
        rest_translations=draw(st.lists(triples, min_size=n_joints, max_size=n_joints)),
        rest_dofs=dofs,
        dof_limits=limits,
        boxes=np.sort(draw(st.lists(corners, min_size=n_joints, max_size=n_joints)), axis=1),
    )


@st.composite
def skinned_meshes(draw):
    n_vertices, n_joints = draw(st.integers(1, 6)), draw(st.integers(1, 4))
    row = st.lists(NUMBERS, min_size=3, max_size=3)
    rows = st.lists(row, min_size=n_vertices, max_size=n_vertices)
    long_row = row.filter(lambda normal: max(map(abs, normal)) >= 1e-15)
    normals = st.lists(long_row, min_size=n_vertices, max_size=n_vertices)
    corner = st.integers(0, n_vertices - 1)
    triangles = draw(st.lists(st.tuples(corner, corner, corner), min_size=1, max_size=6))
    names = draw(st.lists(NAMES, max_size=3))
    indices = sorted(draw(st.integers(-1, len(names) - 1)) for _ in triangles)
    shape = Mesh(
        positions=draw(rows),
        normals=draw(normals),
        triangles=triangles,
        uvs=draw(st.none() | rows.map(lambda table: [row[:2] for row in table])),
        materials=tuple(Material(name) for name in names),
        triangle_materials=indices,
    )
    pair = st.tuples(st.integers(0, n_joints - 1), NUMBERS)
    influences = draw(
        st.lists(st.lists(pair, max_size=7), min_size=n_vertices, max_size=n_vertices)
    )
    bind = np.tile(np.eye(4), (n_joints, 1, 1))
    for joint in range(n_joints):
        # The diagonal dominates, so the matrix is far enough from singular for 1e-12.
        tilt = draw(st.lists(st.floats(-0.2, 0.2), min_size=9, max_size=9))
        bind[joint, :3, :3] += np.reshape(tilt, (3, 3))
        bind[joint, :3, 3] = draw(st.lists(SMALL, min_size=3, max_size=3))
    return Figure("any", shape, skin=skin_from_lists(influences, np.linalg.inv(bind)))


@given(skeletons())
@settings(max_examples=75)
def test_any_skeleton_round_trips(wanted):
    found, warnings = again(Figure("any", skeleton=wanted), skel)
    assert warnings == []
    assert_equal_skeletons(found.skeleton, wanted)


@given(skinned_meshes())
@settings(max_examples=75)
def test_any_skin_round_trips(wanted):
    found, _ = again(wanted, skin)
    assert_equal_meshes(found.mesh, wanted.mesh)
    assert_equal_skins(found.skin, wanted.skin)
