"""Rigged meshes in one ``.npz`` file: round trips, and messages about invalid arrays."""

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from faults import NAN, fault_of, refusal_of, warnings_of
from numpy.testing import assert_allclose, assert_array_equal

import viewer
from viewer.errors import FormatError, RigError
from viewer.formats import Source, detect, read
from viewer.formats.rig import NamedFiles
from viewer.formats.rigged import figure_arrays, save
from viewer.rigs.annotations import VertexField
from viewer.rigs.blendshapes import Correctives
from viewer.rigs.figure import Figure
from viewer.rigs.hands import Hand
from viewer.rigs.material import Material, Outline, Rim, Texture
from viewer.rigs.mesh import Mesh, vertex_normals
from viewer.rigs.posing.pose_vector import PoseLayout
from viewer.rigs.skeleton import ball_skeleton
from viewer.rigs.skin import skin_from_lists


def glazed() -> Material:
    """Return a material with every property except a base texture."""
    picture = np.arange(32, dtype=np.uint8).reshape(4, 2, 4)
    rough = Texture("orm.png", picture, channel=1, wrap=("repeat", "mirror"), is_smooth=False)
    rough = replace(rough, minification="nearest_mipmap_linear")
    bumps = Texture("gone.png", uv_set=1, transform=[[0.5, 0.0, 0.25], [0.0, 2.0, -1.0]])
    return Material(
        "glazed",
        base_color=(1.0, 0.5, 0.25, 0.125),
        metallic=1.0,
        roughness=0.1,
        metallic_texture=replace(rough, channel=2),
        roughness_texture=rough,
        normal_texture=bumps,
        normal_scale=-0.5,
        emissive=(0.0, 3.0, 0.0),
        alpha_mode="mask",
        alpha_cutoff=0.75,
        double_sided=False,
        shade_color=(0.5, 0.25, 0.0),
        rim=Rim((0.5, 2.0, 0.0), 2.0, 0.25, 0.5, texture=rough, matcap=replace(bumps, uv_set=0)),
        outline=Outline(0.01, "screen", (0.5, 0.0, 0.0), 0.25, rough),
        is_physical=True,
    )


def figure() -> Figure:
    """Return a figure with all parts that the format can store."""
    positions = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.5]])
    triangles = np.array([[0, 1, 2], [0, 2, 3]])
    mesh = Mesh(
        positions,
        vertex_normals(positions, triangles),
        triangles,
        uvs=np.arange(10.0).reshape(5, 2),
        uv_triangles=np.array([[0, 1, 2], [0, 2, 4]]),
        other_uvs=(np.arange(10.0)[::-1].reshape(5, 2), np.full((5, 2), 0.25)),
        materials=(
            Material("skin", Texture("skin.png", np.arange(48, dtype=np.uint8).reshape(3, 4, 4))),
            glazed(),
        ),
        triangle_materials=np.array([1, 0]),
        colors=np.arange(16.0).reshape(4, 4) / 16.0,
        parts=("body", "hat", "body"),
        triangle_parts=np.array([2, -1]),
    )
    skeleton = ball_skeleton(("root", "tïp"), np.array([-1, 0]), np.array([[0.0, 0, 0], [1, 0, 0]]))
    skeleton = replace(skeleton, boxes=np.arange(12.0).reshape(2, 2, 3))
    skeleton = replace(skeleton, auxiliary=np.array([False, True]))
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
    """Compare two dataclass instances field by field."""
    for part in fields(wanted):
        one, other = getattr(found, part.name), getattr(wanted, part.name)
        if isinstance(other, np.ndarray):
            assert_array_equal(one, other, err_msg=part.name)
        elif isinstance(other, Texture | Rim | Outline):
            same(one, other)
        else:
            assert one == other, part.name


def test_all_written_data_is_read_back(tmp_path):
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
    for part in (
        "positions",
        "normals",
        "triangles",
        "uvs",
        "uv_triangles",
        "other_uvs",
        "triangle_materials",
        "colors",
        "parts",
        "triangle_parts",
    ):
        assert_array_equal(getattr(found.mesh, part), getattr(wanted.mesh, part))
    assert [(m.name, m.texture) for m in found.mesh.materials] == [
        ("skin", "skin.png"),
        ("glazed", None),
    ]
    same(found.mesh.materials[1], wanted.mesh.materials[1])
    assert_array_equal(found.mesh.materials[0].image, wanted.mesh.materials[0].image)
    assert found.mesh.materials[1].image is None
    # Multiples of 1/8 are exact in single precision.
    assert_array_equal(found.correctives.values(), wanted.correctives.values())


def test_missing_parts_of_a_figure_are_left_out(tmp_path):
    whole = figure()
    bare = Figure(
        "bare",
        Mesh(whole.mesh.positions, whole.mesh.normals, whole.mesh.triangles),
        replace(whole.skeleton, boxes=None, auxiliary=None),
        whole.skin,
    )
    save(bare, tmp_path / "bare.npz")
    scene = viewer.load(tmp_path / "bare.npz")
    assert [one.key for one in scene.diagnostics] == ["W004.vertices"]  # the last one has no weight
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
    "version": (
        {"viewer_rig": np.array(2)},
        ("F002.rig-version", None, {"item": "viewer_rig", "expected": 1, "found": 2}),
    ),
    "no version": (
        {"viewer_rig": np.array("one")},
        (
            "F002.value",
            None,
            {"item": "viewer_rig", "expected": "a single number", "found": "a string"},
        ),
    ),
    "up": ({"up": np.array("x")}, ("F002.rig-up", None, {"item": "up", "found": "x"})),
    "no positions": ({"positions": None}, ("F002.no-key", None, {"item": "positions"})),
    "nan": (
        {"positions": np.full((4, 3), np.nan)},
        ("F003.finite", None, {"item": "positions", "found": NAN, "at": "vertex 0"}),
    ),
    "triangles": (
        {"triangles": np.array([[0, 1, 4], [0, 1, 2]])},
        ("F002.vertex-range", None, {"item": "triangles", "last": 3, "found": 4}),
    ),
    "joints": (
        {"parents": np.array([-1, 0, 0])},
        ("F002.value", None, {"item": "parents", "expected": "2 numbers", "found": "3 int64"}),
    ),
    "cycle": (
        {"parents": np.array([1, 0])},
        ("S002.parent", None, {"item": "parents: ", "joint": 0, "found": 1}),
    ),
    "skin": (
        {"skin_joints": np.array([0, 1, 0, 2])},
        ("W010.vertex", None, {"item": "skin_joints", "last": 1, "found": 2, "vertex": 2}),
    ),
    "weights": (
        {"skin_weights": np.ones(3)},
        ("F002.rig-parts", None, {"problem": "weights: expected shape 4, found 3"}),
    ),
    "vertices": (
        {"skin_starts": np.array([0, 1, 4])},
        (
            "F002.rig-parts",
            None,
            {"problem": "figure scan: the skin binds 2 vertices, but the mesh has 4"},
        ),
    ),
    "bindings": (
        {"inverse_bind": np.tile(np.eye(4), (3, 1, 1))},
        ("B001.rig-matrices", None, {"item": "inverse_bind", "expected": 2, "found": 3}),
    ),
    "correctives": (
        {"correctives": np.zeros((18, 4, 3))},
        (
            "F002.value",
            None,
            {
                "item": "correctives",
                "expected": "9 x any x 3 numbers",
                "found": "18 x 4 x 3 float64",
            },
        ),
    ),
    "limits": (
        {"dof_limits": np.full((6, 2), np.nan)},
        ("S003.rig-limits", None, {"item": "dof_limits", "dof": 0, "low": NAN, "high": NAN}),
    ),
    "textures": (
        {"material_textures": np.array(["a"])},
        ("F002.value", None, {"item": "material_textures", "expected": 2, "found": 1}),
    ),
    "material rows": (
        {"material_records": np.array(["{}"])},
        ("F002.value", None, {"item": "material_records", "expected": 2, "found": 1}),
    ),
    "material": (
        {"material_records": np.array(["{}", '{"metallic": 2}'])},
        (
            "F002.rig-material",
            None,
            {
                "item": "material_records",
                "index": 1,
                "problem": "metallic: expected 0 to 1, found 2",
            },
        ),
    ),
    "layout": (
        {"layout_starts": np.array([3, 8])},
        ("F002.rig-layout", None, {"item": "layout_counts", "expected": 11, "found": 10}),
    ),
    "hand": (
        {"hand_0_joints": np.array([2])},
        ("F002.rig-hand", None, {"item": "hand_0_joints", "last": 1}),
    ),
}


@pytest.mark.parametrize(("changes", "message"), BROKEN.values(), ids=BROKEN)
def test_broken_files_are_refused_with_the_key(tmp_path, changes, message):
    path = tmp_path / "scan.npz"
    np.savez(path, **arrays_of(**changes))
    with pytest.raises(FormatError) as problem:
        read(Source.open(path))
    assert problem.value.path == path
    assert fault_of(problem.value.diagnostic) == message


def test_correctives_for_a_different_mesh_are_refused(tmp_path):
    path = tmp_path / "scan.npz"
    np.savez(path, **arrays_of(correctives=np.zeros((9, 5, 3))))
    with pytest.raises(FormatError) as problem:
        read(Source.open(path))
    assert fault_of(problem.value.diagnostic) == (
        (
            "F002.rig-parts",
            None,
            {"problem": "figure scan: the correctives have 5 vertices, but the mesh has 4"},
        )
    )


GOOD = "rig wasp {\n\tskeleton wasp.skel\n\tskin wasp.skin\n\tmorphs 0 {\n\t}\n}\n"
FOLDER = Path("figures")


def parse(text):
    source = Source(FOLDER / "a.rig", text.encode())
    named = read(source)
    assert isinstance(named, NamedFiles)
    return named.name, [path.relative_to(FOLDER).as_posix() for path in named.paths], source


@pytest.mark.parametrize(
    "text",
    [GOOD, GOOD.replace("\n", "\r\r\n"), GOOD.replace("\n\t", " "), GOOD.replace(" {", "{")],
    ids=["plain", "cr cr lf", "one line", "glued"],
)
def test_file_names_are_relative_to_the_rig_file(text):
    name, files, source = parse(text)
    assert (name, files) == ("wasp", ["wasp.skel", "wasp.skin"])
    assert source.warnings == [] and detect(source) == "rig"


def test_morphs_are_listed_in_order():
    text = GOOD.replace("0 {", "2 { head1.morph sub/head2.morph")
    assert parse(text)[1] == ["wasp.skel", "wasp.skin", "head1.morph", "sub/head2.morph"]


def test_names_with_spaces_are_quoted_and_a_rig_may_be_empty():
    name, files, _ = parse('rig { skin "my wasp.skin" }')
    assert (name, files) == ("a", ["my wasp.skin"])


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        (GOOD.rstrip("}\n") + "\n}", ("F006.closing", None, {})),
        (GOOD + "rig two { }", ("F006.rig-after", 7, {"found": b"rig"})),
    ],
)
def test_missing_or_extra_braces_at_the_end_are_reported(text, fault):
    *_, source = parse(text)
    assert warnings_of(source.diagnostics) == [fault]


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("rig a { }", ("F002.rig-empty", 1, {})),
        (
            GOOD.replace("skin wasp.skin", "mesh wasp.skin"),
            ("F002.rig-item", 3, {"found": b"mesh"}),
        ),
        (GOOD.replace("skin wasp.skin", "skin"), ("F002.rig-item", 4, {"found": b"0"})),
        (GOOD.replace("0 {", "1 {"), ("F002.rig-morphs", 4, {"expected": 1, "found": 0})),
        (GOOD.replace("0 {", "-1 {"), ("F002.count", 4, {"item": "morphs", "found": b"-1"})),
        (GOOD.replace("0 {", "many {"), ("F002.count", 4, {"item": "morphs", "found": b"many"})),
        (GOOD.replace("0 {", "0"), ("F002.rig-word", 5, {"expected": "{", "found": b"}"})),
        ("rig a { skeleton", ("F002.rig-name", 1, {"item": "skeleton", "found": None})),
        (
            "rig a { skin ../a.skin }",
            ("F002.rig-outside", 1, {"item": "skin", "found": b"../a.skin"}),
        ),
        ("rig a { skin {", ("F002.rig-name", 1, {"item": "skin", "found": b"{"})),
    ],
)
def test_malformed_files_are_refused_with_their_line(text, fault):
    with pytest.raises(FormatError) as caught:
        parse(text)
    assert caught.value.path == FOLDER / "a.rig"
    assert fault_of(caught.value.diagnostic) == fault


def test_huge_morph_count_is_refused_without_allocation():
    fault = refusal_of(lambda: parse(GOOD.replace("0 {", "2000000000 {")))
    assert fault == ("F002.rig-morphs", 4, {"expected": 2000000000, "found": 0})
