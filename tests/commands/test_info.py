"""``viewer info``: hand-counted values as text and as JSON."""

import json
import math
import re

import numpy as np
import pytest
from app.tiny import write_rig
from exporters.plain_smpl import smpl_forward
from exporters.small_rigs import pose_190, write_box, write_twist
from formats.capture_files import body, standing, write_frames
from formats.gltf.files import File, skinned
from formats.synthetic_smpl import model

from viewer.cli import run


@pytest.fixture
def describe(capsys):
    def info(*arguments):
        assert run(["info", *map(str, arguments), "--json"]) == 0
        return json.loads(capsys.readouterr().out)

    return info


def test_joints_are_listed_with_their_places_in_the_scene(capsys, tmp_path):
    rig = [*map(str, write_rig(tmp_path)), "--dof", "figure.tx=10"]
    assert run(["info", *rig, "--joints"]) == 0
    said = capsys.readouterr().out
    assert re.search(r"joint +name +parent +position\n", said)
    # Moved by 10 along x; the arm is one unit from the root.
    (root,) = re.findall(r"^ +0 +root +\((10), (0), (0)\)$", said, re.M)
    (arm,) = re.findall(r"^ +1 +arm +root +\((.+), (.+), (.+)\)$", said, re.M)
    offset = np.subtract(np.array(arm, dtype=float), np.array(root, dtype=float))
    assert np.linalg.norm(offset) == pytest.approx(1.0, abs=2e-3)
    assert run(["info", *map(str, write_rig(tmp_path))]) == 0
    assert "parent" not in capsys.readouterr().out


def test_tiny_rig_is_described_exactly(describe, tmp_path):
    described = describe(*write_rig(tmp_path))
    (actor,) = described["actors"]
    assert described["warnings"] == [] and actor["name"] == "tiny" and actor["attached"]
    skeleton = actor["skeleton"]
    assert skeleton["joints"] == 2 and skeleton["roots"] == 1
    assert skeleton["dofs"] == 9 and skeleton["limited_dofs"] == 3 and skeleton["locked_dofs"] == 1
    assert [joint["parent"] for joint in skeleton["joint_table"]] == [-1, 0]
    # Rz(0.3) Ry(0.5) Rx(0.25) turns the offset (0, 1, 0) of the arm.
    sx, cx, sy, cy, sz, cz = (f(a) for a in (0.25, 0.5, 0.3) for f in (math.sin, math.cos))
    arm = [cz * sy * sx - sz * cx, sz * sy * sx + cz * cx, cy * sx]
    places = [joint["position"] for joint in skeleton["joint_table"]]
    np.testing.assert_allclose(places, [[0, 0, 0], arm], atol=1e-12)
    assert skeleton["dof_table"][3:6] == [
        {"name": "root.x", "value": 0.25, "minimum": -1.0, "maximum": 1.0},
        {"name": "root.y", "value": 0.5, "minimum": 0.5, "maximum": 2.0},
        {"name": "root.z", "value": 0.3, "minimum": 0.3, "maximum": 0.3},
    ]
    assert skeleton["dof_table"][6]["minimum"] is None
    mesh = actor["mesh"]
    assert (mesh["vertices"], mesh["triangles"]) == (12, 20)
    assert mesh["degenerate_triangles"] == 0 and mesh["unused_vertices"] == 0
    assert not mesh["has_uvs"] and mesh["materials"] == []
    skin = actor["skin"]
    assert skin["influences"] == 4 + 8 + 4 and skin["bindings"] == 2
    assert skin["influence_histogram"] == {"1": 8, "2": 4}
    assert skin["mean_influences"] == pytest.approx(16 / 12)
    assert skin["weight_sums"] == [1.0, 1.0] and skin["joints_without_vertices"] == []


def test_text_output_matches_json(tmp_path, capsys):
    assert run(["info", *map(str, write_rig(tmp_path))]) == 0
    text = capsys.readouterr().out
    for words in (
        "2 joints, 9 DOFs (3 limited, 1 of them locked)",
        "12 vertices, 20 triangles (0 degenerate), without texture coordinates",
        "2 bindings, 16 influences, mean 1.33 per vertex",
        "1: 8  2: 4",
        "weight sums 1 to 1",
        "locked",
    ):
        assert words in text


def test_size_has_a_unit_if_the_file_states_one(tmp_path, capsys):
    rig = write_rig(tmp_path)
    assert run(["convert", *map(str, rig), "-o", str(tmp_path / "a.glb")]) == 0
    for path, unit in ((tmp_path / "a.glb", "m"), (rig[0], None)):
        capsys.readouterr()
        assert run(["info", str(path)]) == 0
        box = capsys.readouterr().out.splitlines()[1].split(", ")
        assert box[-2].endswith(" m") == (unit == "m") and box[-2].startswith("size ")
        assert run(["info", str(path), "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["actors"][0]["unit"] == unit


def test_skeleton_and_skin_are_described_separately(describe, tmp_path):
    skel, skin = write_rig(tmp_path)
    assert set(describe(skel)["actors"][0]) >= {"skeleton"}
    assert "mesh" not in describe(skel)["actors"][0]
    assert "skeleton" not in describe(skin)["actors"][0]
    # The height of a skeleton without a skin is that of its boxes.
    assert describe(skel)["actors"][0]["size"] > 1.8


def test_given_dofs_are_described(describe, tmp_path):
    described = describe(*write_rig(tmp_path), "--dof", "arm.x=0.5")
    assert described["actors"][0]["skeleton"]["dof_table"][6]["value"] == 0.5


def test_warnings_are_described_and_printed(tmp_path, capsys):
    path = tmp_path / "odd.skel"
    path.write_text("balljoint a { rotxlimit 2 1 }")
    assert run(["info", str(path), "--json"]) == 0
    captured = capsys.readouterr()
    warnings = json.loads(captured.out)["warnings"]
    assert len(warnings) == 1 and captured.err == f"warning: {warnings[0]}\n"


def test_names_are_printed_on_one_line(tmp_path, capsys):
    path = tmp_path / "two\nlines.skel"
    path.write_text("balljoint a { pose 1 0 0 }")
    assert run(["info", str(path)]) == 0
    assert capsys.readouterr().out.splitlines()[0] == "two\\nlines"


def test_joints_and_dofs_of_skel_files_are_counted(describe, shared):
    (actor,) = describe(shared / "test.skel")["actors"]
    skeleton = actor["skeleton"]
    # Six balljoints have 18 rotations and three translations of the root; knee_r has three limits.
    assert (skeleton["joints"], skeleton["dofs"]) == (6, 21)
    assert (skeleton["limited_dofs"], skeleton["locked_dofs"]) == (3, 2)
    values = {dof["name"]: dof["value"] for dof in skeleton["dof_table"]}
    assert values["root.y"] == 0.1
    assert [values[f"knee_r.{axis}"] for axis in "xyz"] == [-2.0, 0.0, 0.0]  # clamped


@pytest.mark.parametrize(
    ("name", "joints", "vertices", "triangles"), [("tube", 2, 240, 456), ("wasp", 23, 694, 1236)]
)
def test_vertices_and_bindings_of_skin_files_are_counted(
    describe, shared, name, joints, vertices, triangles
):
    (actor,) = describe(shared / f"{name}.skel", shared / f"{name}.skin")["actors"]
    # These are the counts declared in the files.
    assert actor["skeleton"]["joints"] == joints == actor["skin"]["bindings"]
    assert (actor["mesh"]["vertices"], actor["mesh"]["triangles"]) == (vertices, triangles)
    assert sum(actor["skin"]["influence_histogram"].values()) == vertices
    assert actor["skin"]["weight_sums"] == pytest.approx([1.0, 1.0], abs=2e-2)


@pytest.mark.parametrize(
    ("joints", "dofs_listed", "summary"),
    [
        (8, 24, "6 more are 0 and unlimited"),
        (9, 0, "33 are unlimited"),
    ],
)
def test_many_unlimited_dofs_are_only_counted(tmp_path, capsys, joints, dofs_listed, summary):
    # A root whose six DOFs are 0, and below it ball joints that are each rotated about x, y and z.
    text = "".join(f"balljoint j{n} {{ pose 0.1 0.2 0.3 }}\n" for n in range(joints))
    path = tmp_path / "hand.skel"
    path.write_text(f"balljoint root {{\n{text}}}\n")
    assert run(["info", str(path)]) == 0
    lines = [line.strip() for line in capsys.readouterr().out.splitlines()]
    assert sum(line.startswith("j") for line in lines) == dofs_listed
    assert f"{summary} (--json lists all)" in lines


def test_triangles_are_degenerate_by_the_criterion_of_lint(tmp_path, capsys):
    # The third corner is 1e-9 from the line through the others: the area is not exactly 0.
    (tmp_path / "flat.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 0.3 1e-9 0\nv 0 1 0\nf 1 2 3\nf 1 2 4\n"
    )
    assert run(["info", str(tmp_path / "flat.obj")]) == 0
    assert "2 triangles (1 degenerate)" in capsys.readouterr().out
    run(["lint", str(tmp_path / "flat.obj")])
    assert "M001: 1 of 2 triangles have zero area" in capsys.readouterr().out.replace("has", "have")


@pytest.mark.parametrize(
    ("corner", "box"),
    [
        # Three more digits than the power of ten of the size: 1.732 has thousandths.
        ("1 1 0.9999", "(0, 0, 0) to (1, 1, 1), size 1.732"),
        ("123.456 0 0.00004", "(0, 0, 0) to (123.5, 0, 0), size 123.5"),
        ("0.00123456 0 0", "(0, 0, 0) to (0.001235, 0, 0), size 0.001235"),
    ],
)
def test_boxes_have_the_digits_of_their_size(corner, box, tmp_path, capsys):
    (tmp_path / "a.obj").write_text(f"v 0 0 0\nv {corner}\nv 0 0 0\nf 1 2 3\n")
    assert run(["info", str(tmp_path / "a.obj")]) == 0
    assert f"  box        {box}, y up" in capsys.readouterr().out.splitlines()


@pytest.mark.parametrize(("scale", "height"), [(0.0, "0.000"), (2.5, "2.500")])
def test_height_at_rest_is_that_of_the_scaled_joints(scale, height, tmp_path, capsys):
    # A triangle of height 1 on a joint that the file scales at rest.
    file = skinned()
    file.root["nodes"][1]["scale"] = [scale] * 3
    (tmp_path / "a.glb").write_bytes(file.glb())
    assert run(["info", str(tmp_path / "a.glb")]) == 0
    assert f"rest       {height} m high, " in capsys.readouterr().out


def test_mass_is_that_of_people(tmp_path, capsys):
    # A tetrahedron with three edges of 6 m has 36 cubic metres.
    corners = [[0, 0, 0], [6, 0, 0], [0, 6, 0], [0, 0, 6]]
    file = File(scene=0, scenes=[{"nodes": [0]}])
    mesh = file.mesh(corners)
    file.primitive["indices"] = file.accessor([0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3], "H")
    file.add("nodes", {"mesh": mesh})
    (tmp_path / "a.glb").write_bytes(file.glb())
    assert run(["info", str(tmp_path / "a.glb")]) == 0
    line = next(one for one in capsys.readouterr().out.splitlines() if "  rest " in one)
    assert line == "  rest       6.000 m high, 36 m3"


@pytest.fixture
def info(capsys):
    def lines(*arguments):
        assert run(["info", *map(str, arguments)]) == 0
        captured = capsys.readouterr()
        assert run(["info", *map(str, arguments), "--json"]) == 0
        return captured.out.splitlines(), json.loads(capsys.readouterr().out), captured.err

    return lines


def test_up_axis_is_that_of_the_scene(info, tmp_path):
    np.savez(tmp_path / "SMPL.npz", **model("smpl"))
    folder = write_frames(tmp_path / "take" / "smpl", {0: [body(0)]})
    lines, found, _ = info(folder, "--model", tmp_path / "SMPL.npz", "--up", "z")
    assert lines[0] == "take 0" and lines[1].endswith(", z up")
    assert lines[2] == "  figure     SMPL" and found["actors"][0]["figure"] == "SMPL"
    assert found["actors"][0]["up"] == "z"


def test_bounding_boxes_contain_only_present_people(info, tmp_path):
    frames = {3: [standing(0, 0.0)], 4: [standing(0, 0.0), standing(4, 2.0)]}
    folder = write_frames(tmp_path / "kp" / "keypoints3d", {**frames, 5: [standing(4, 2.0)]})
    lines, found, _ = info(folder)
    assert lines[:4] == [
        "kp body25 0",
        "  box        (0, 0, 1) to (0, 0, 1.6), size 0.6, z up",
        "  clip       kp: 0 to 0.067 s, 3 frames (3 to 5) at 30 fps, 25 points, 8.0 % visible",
        "    1 frame is missing: 5",
    ]
    assert lines[4:6] == ["kp body25 4", "  box        none: absent at this time, z up"]
    assert lines[7] == "    1 frame is missing: 3"
    away = found["actors"][1]
    assert (away["box"], away["size"], away["present"]) == (None, None, False)


def test_several_gaps_are_listed(info, tmp_path):
    there = [standing(0, 0.0)]
    frames = dict.fromkeys((0, 2, 5, 7), there)
    lines, _, _ = info(write_frames(tmp_path / "kp" / "keypoints3d", frames))
    assert lines[3] == "    4 frames are missing: 1, 3 to 4, 6"


def test_undetected_keypoints_have_no_bounding_box(info, tmp_path):
    unseen = {"id": 0, "keypoints3d": [[0.0] * 4] * 25}
    folder = write_frames(tmp_path / "kp" / "keypoints3d", {0: [unseen], 1: [unseen]})
    lines, found, err = info(folder, "--fps", "30")
    assert lines[1] == "  box        none: nothing is visible, z up"
    assert found["actors"][0]["present"] and found["actors"][0]["box"] is None
    assert err == "note: kp: no keypoint of person 0 is ever visible: every confidence is 0\n"


def test_morphs_are_listed_with_their_vertex_counts(info, tmp_path):
    skel, skin = write_rig(tmp_path)
    (tmp_path / "smile.morph").write_text(
        "positions 2 { 0 5 6 7  3 1 1 1 } normals 2 { 0 0 0 1  3 0 0 1 }"
    )
    (tmp_path / "frown.morph").write_text("positions 1 { 2 5 6 7 } normals 1 { 2 0 0 1 }")
    lines, found, _ = info(skel, skin, tmp_path / "smile.morph", tmp_path / "frown.morph")
    assert "  morph      smile: moves 2 vertices" in lines
    assert "  morph      frown: moves 1 vertex" in lines
    assert found["actors"][0]["morphs"] == [
        {"name": "smile", "vertices": 2, "materials": 0},
        {"name": "frown", "vertices": 1, "materials": 0},
    ]
    assert "morphs" not in info(skel, skin)[1]["actors"][0]


HALF_TURN, QUARTER_TURN = math.pi, math.pi / 2
ACROSS = math.sqrt(5)  # distance of the box's corner (1, 2, 3) from the z axis


@pytest.fixture
def box(tmp_path):
    return str(write_box(tmp_path / "box"))


@pytest.fixture
def body_file(tmp_path):
    arrays = model("smpl", 48)
    np.savez(tmp_path / "body.npz", **arrays)
    return str(tmp_path / "body.npz"), arrays


@pytest.fixture
def describe_model(capsys):
    """Return the ``model`` part of ``info --json``."""

    def info(*arguments):
        assert run(["info", *arguments, "--json"]) == 0
        return json.loads(capsys.readouterr().out)["actors"][0]["model"]

    return info


@pytest.fixture
def lines(capsys):
    """Return the lines of ``info`` as headings and texts."""

    def info(*arguments):
        assert run(["info", *arguments]) == 0
        return [line.strip() for line in capsys.readouterr().out.splitlines()]

    return info


def about_z(joint, angle):
    """Return the option that rotates a joint of the box below the root about z."""
    return ["--pose", pose_190(6, **{f"n{3 + 3 * joint + 2}": angle})]


# The rest body


def test_box_has_its_height_volume_and_weight(describe_model, lines, box):
    # 1 x 2 x 3 m with z up are 6 cubic metres of 985 kg each.
    assert describe_model(box)["rest"] == pytest.approx({"height": 3, "volume": 6, "mass": 5910})
    assert "rest       3.000 m high, 6 m3, 5,910.0 kg at 985 kg/m3" in lines(box)


def test_inside_out_box_has_the_same_measurements(describe_model, tmp_path):
    rows = (write_box(tmp_path / "good") / "faces_vert.txt").read_text().splitlines()
    flipped = "\n".join(" ".join(row.split()[::-1]) for row in rows)
    rest = describe_model(str(write_box(tmp_path / "box", faces_vert=flipped)))["rest"]
    assert rest["volume"] == pytest.approx(6)


def test_pose_does_not_change_the_rest_body(describe_model, box):
    pose = pose_190(6, n0=5.0, n3=1.0, n21=2.0)  # translated, rotated, and twice as large
    assert describe_model(box, "--pose", pose)["rest"]["height"] == pytest.approx(3)


def test_shape_changes_the_rest_body(describe_model, lines, body_file):
    path, arrays = body_file
    # The spiral of the synthetic models rises from -1.3 to 0.45 m.
    assert describe_model(path)["rest"]["height"] == pytest.approx(1.75, abs=1e-6)
    shaped, _ = smpl_forward(arrays, [2, -1])
    a, b, c = (shaped[arrays["f"][:, corner].astype(int)] for corner in range(3))
    volume = sum(np.linalg.det(np.stack(corners)) for corners in zip(a, b, c, strict=True)) / 6
    rest = describe_model(path, "--shape", "2,-1")["rest"]
    assert rest["height"] == pytest.approx(np.ptp(shaped[:, 1]))
    assert rest["volume"] == pytest.approx(abs(volume))
    assert rest["mass"] == pytest.approx(985 * abs(volume))
    assert "shape      2, -1, 0, 0, 0, 0, 0, 0, 0, 0" in lines(path, "--shape", "2,-1")


# Facts and parts


def test_body_facts_are_reported(describe_model, lines, body_file):
    path, _ = body_file
    found = describe_model(path)
    assert found["facts"] == {
        "model": "SMPL",
        "coefficients": "10 shape, 0 expression",
        "correctives": "207 columns",
        "keys used": "v_template, f, kintree_table, J_regressor, shapedirs, posedirs, weights",
        "keys not needed": "J, bs_style, bs_type",
    }
    assert found["shapes"][9] == {"name": "shape 9", "group": "shape"}
    assert found["shape_weights"] == [0] * 10 and found["own_numbers"] == [0] * 72
    told = lines(path)
    assert "model      SMPL" in told and "correctives 207 columns" in told


def test_expressions_are_a_separate_group(describe_model, tmp_path):
    np.savez(tmp_path / "face.npz", **model("flame", 32, n_shapes=10, n_expressions=5))
    found = describe_model(str(tmp_path / "face.npz"))
    assert [shape["group"] for shape in found["shapes"]] == ["shape"] * 10 + ["expression"] * 5
    assert found["facts"]["coefficients"] == "10 shape, 5 expression"


def test_keypoints_are_counted(describe_model, lines, tmp_path):
    np.savez(tmp_path / "x.npz", **model("smplx", 64))
    assert len(describe_model(str(tmp_path / "x.npz"))["keypoints"]) == 51
    assert "keypoints  51" in lines(str(tmp_path / "x.npz"))


def test_parts_of_an_animal_are_counted(describe_model, lines, box):
    found = describe_model(box)
    assert found["body_parts"] == {"NOT_BODY": 0, "FEET": 4, "BACK": 4}
    assert found["reduced"] == {"vertices": 4, "triangles": 4}
    assert (
        found["asymmetry"] == 2
    )  # y is 0 and 2, so the mirror counterparts are off the plane y = 0 by 1 each
    told = lines(box)
    assert "parts      NOT_BODY 0, FEET 4, BACK 4" in told
    assert "reduced    4 vertices, 4 triangles" in told
    assert "symmetry   left and right differ by 2 m" in told


def test_placement_and_raw_pose_values_are_reported(describe_model, box):
    numbers = [1, 2, 3, 0.1, 0.2, 0.3, *[0] * 12, 0, 0, -0.5, 1.5]
    found = describe_model(box, "--pose", ",".join(map(str, numbers)))
    assert found["figure_translation"] == [1, 2, 3] and found["figure_scale"] == 1.5
    assert found["own_numbers"] == pytest.approx(numbers)


def test_plain_rig_has_no_model_facts(describe_model, tmp_path):
    found = describe_model(*write_twist(tmp_path))
    assert not {"facts", "shapes", "rest", "body_parts", "keypoints", "asymmetry"} & set(found)


# Effects of skinning options


def test_effect_of_an_influence_limit_is_measured(describe_model, lines, box):
    # Vertex 7 follows joint 4 by 0.15; with four influences only joints 0 to 3 remain. With all
    # influences, its distance from the axis is 1 - 2 * 0.15 of that with the limit.
    options = about_z(4, HALF_TURN)
    effects = describe_model(box, *options)["effects"]
    assert effects["pruned to 4 influences"] == pytest.approx(0.3 * ACROSS)
    assert "pruned to 8 influences" not in effects
    assert "effect     pruned to 4 influences: up to 671 mm in this pose" in lines(box, *options)


def test_ten_influences_are_measured_with_two_limits(describe_model, tmp_path):
    weights = [f"0 {vertex} 1" for vertex in range(7)] + [f"{joint} 7 0.1" for joint in range(10)]
    box = write_box(
        tmp_path / "box",
        t_pose_joints="0 0 0\n" * 10,
        parents="-1\n" + "0\n" * 9,
        skinning_weights="\n".join(weights),
    )
    effects = describe_model(str(box), "--pose", pose_190(10, n32=HALF_TURN))["effects"]  # joint 9
    assert effects["pruned to 4 influences"] == pytest.approx(0.2 * ACROSS)
    assert effects["pruned to 8 influences"] == pytest.approx(0.2 * ACROSS)


def test_limit_on_a_figure_at_rest_has_no_effect(describe_model, lines, box):
    assert describe_model(box)["effects"] == {}
    assert not [line for line in lines(box) if line.startswith("effect")]


def test_effect_of_normalising_is_measured_in_millimetres(describe_model, lines, tmp_path):
    rows = [f"0 {vertex} 1" for vertex in range(6)]
    weights = "\n".join([*rows, "0 6 1.002", "0 7 0.6", "1 7 0.395"])
    box = str(write_box(tmp_path / "box", skinning_weights=weights))
    # Vertex 7 is sqrt(14) m from the origin, and its weights sum to 0.995; vertex 6 moves less.
    moved = 0.005 * math.sqrt(14)
    # Dual quaternions are normalised for any weights.
    expected = {"normalised weights": moved, "DQS against LBS": moved}
    assert describe_model(box)["effects"] == pytest.approx(expected)
    told = lines(box)
    assert "effect     normalised weights: up to 18.7 mm in this pose" in told
    assert "normalising would move rest vertices by up to 18.71 mm" in told
    assert "weights    raw; their sums are 0.995 to 1.002" in told


def test_effect_of_dual_quaternions_is_measured(describe_model, tmp_path):
    weights = "\n".join([*(f"0 {vertex} 1" for vertex in range(7)), "0 7 0.5", "1 7 0.5"])
    box = str(write_box(tmp_path / "box", skinning_weights=weights))
    effects = describe_model(box, *about_z(1, QUARTER_TURN))["effects"]
    # At half of 90 degrees, LBS reduces the distance of vertex 7 by a factor of cos 45, and DQS
    # keeps it.
    assert effects == pytest.approx({"DQS against LBS": (1 - math.sqrt(0.5)) * ACROSS})


def test_effect_of_correctives_is_measured(describe_model, body_file):
    path, arrays = body_file
    pose = 0.3 * np.sin(np.arange(72.0))
    whole = smpl_forward(arrays, (), pose)[0]
    plain = smpl_forward(arrays, (), pose, correct=False)[0]
    expected = np.linalg.norm(whole - plain, axis=1).max()
    options = ["--pose", ",".join(map(repr, pose.tolist()))]
    assert describe_model(path, *options)["effects"]["pose correctives"] == pytest.approx(expected)


def test_scaled_figure_shows_scaled_effects(describe_model, box):
    pose = pose_190(6, n17=HALF_TURN, n21=2.0)  # joint 4 about z, and twice the figure's size
    effects = describe_model(box, "--pose", pose)["effects"]
    assert effects["pruned to 4 influences"] == pytest.approx(2 * 0.3 * ACROSS)


def test_bundled_body_has_the_measurements_of_an_adult(describe_model):
    found = describe_model("--body")
    assert 1.5 < found["rest"]["height"] < 2.0 and 45 < found["rest"]["mass"] < 100
    assert len(found["shapes"]) == 10 and found["facts"]["correctives"] == "207 columns"
    assert found["asymmetry"] < 1e-6


def test_rounding_is_not_an_effect(describe_model, tmp_path):
    # The box rotates rigidly by an angle with a sine that is not a round number.
    box = str(write_box(tmp_path / "box", skinning_weights="\n".join(f"0 {v} 1" for v in range(8))))
    for angle in (0.1, 0.7, 2.0, 3.0):
        assert describe_model(box, "--pose", pose_190(6, n3=angle, n4=0.3))["effects"] == {}
