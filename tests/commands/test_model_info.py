"""``viewer info`` of body models: hand-calculated values as text and as JSON."""

import json
import math

import numpy as np
import pytest
from export.plain_smpl import smpl_forward
from export.small_rigs import pose_190, write_box, write_twist
from formats.synthetic_smpl import model

from viewer.cli import run

HALF_TURN, QUARTER_TURN = math.pi, math.pi / 2
ACROSS = math.sqrt(5)  # distance of the box's corner (1, 2, 3) from the z axis


@pytest.fixture
def box(tmp_path):
    return str(write_box(tmp_path / "box"))


@pytest.fixture
def body(tmp_path):
    arrays = model("smpl", 48)
    np.savez(tmp_path / "body.npz", **arrays)
    return str(tmp_path / "body.npz"), arrays


@pytest.fixture
def describe(capsys):
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


def test_box_has_its_height_volume_and_weight(describe, lines, box):
    # 1 x 2 x 3 m with z up are 6 cubic metres of 985 kg each.
    assert describe(box)["rest"] == pytest.approx({"height": 3, "volume": 6, "mass": 5910})
    assert "rest       3.000 m high, 6 m3, 5,910.0 kg at 985 kg/m3" in lines(box)


def test_inside_out_box_has_the_same_measurements(describe, tmp_path):
    rows = (write_box(tmp_path / "good") / "faces_vert.txt").read_text().splitlines()
    flipped = "\n".join(" ".join(row.split()[::-1]) for row in rows)
    rest = describe(str(write_box(tmp_path / "box", faces_vert=flipped)))["rest"]
    assert rest["volume"] == pytest.approx(6)


def test_pose_does_not_change_the_rest_body(describe, box):
    pose = pose_190(6, n0=5.0, n3=1.0, n21=2.0)  # translated, rotated, and twice as large
    assert describe(box, "--pose", pose)["rest"]["height"] == pytest.approx(3)


def test_shape_changes_the_rest_body(describe, lines, body):
    path, arrays = body
    # The spiral of the synthetic models rises from -1.3 to 0.45 m.
    assert describe(path)["rest"]["height"] == pytest.approx(1.75, abs=1e-6)
    shaped, _ = smpl_forward(arrays, [2, -1])
    a, b, c = (shaped[arrays["f"][:, corner].astype(int)] for corner in range(3))
    volume = sum(np.linalg.det(np.stack(corners)) for corners in zip(a, b, c, strict=True)) / 6
    rest = describe(path, "--shape", "2,-1")["rest"]
    assert rest["height"] == pytest.approx(np.ptp(shaped[:, 1]))
    assert rest["volume"] == pytest.approx(abs(volume))
    assert rest["mass"] == pytest.approx(985 * abs(volume))
    assert "shape      2, -1, 0, 0, 0, 0, 0, 0, 0, 0" in lines(path, "--shape", "2,-1")


# Facts and parts


def test_body_facts_are_reported(describe, lines, body):
    path, _ = body
    found = describe(path)
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


def test_expressions_are_a_separate_group(describe, tmp_path):
    np.savez(tmp_path / "face.npz", **model("flame", 32, n_shapes=10, n_expressions=5))
    found = describe(str(tmp_path / "face.npz"))
    assert [shape["group"] for shape in found["shapes"]] == ["shape"] * 10 + ["expression"] * 5
    assert found["facts"]["coefficients"] == "10 shape, 5 expression"


def test_keypoints_are_counted(describe, lines, tmp_path):
    np.savez(tmp_path / "x.npz", **model("smplx", 64))
    assert len(describe(str(tmp_path / "x.npz"))["keypoints"]) == 51
    assert "keypoints  51" in lines(str(tmp_path / "x.npz"))


def test_parts_of_an_animal_are_counted(describe, lines, box):
    found = describe(box)
    assert found["body_parts"] == {"NOT_BODY": 0, "FEET": 4, "BACK": 4}
    assert found["reduced"] == {"vertices": 4, "triangles": 4}
    assert (
        found["asymmetry"] == 2
    )  # y is 0 and 2, so the mirror counterparts are off the plane y = 0 by 1 each
    told = lines(box)
    assert "parts      NOT_BODY 0, FEET 4, BACK 4" in told
    assert "reduced    4 vertices, 4 triangles" in told
    assert "symmetry   left and right differ by 2 m" in told


def test_placement_and_raw_pose_values_are_reported(describe, box):
    numbers = [1, 2, 3, 0.1, 0.2, 0.3, *[0] * 12, 0, 0, -0.5, 1.5]
    found = describe(box, "--pose", ",".join(map(str, numbers)))
    assert found["figure_translation"] == [1, 2, 3] and found["figure_scale"] == 1.5
    assert found["own_numbers"] == pytest.approx(numbers)


def test_plain_rig_has_no_model_facts(describe, tmp_path):
    found = describe(*write_twist(tmp_path))
    assert not {"facts", "shapes", "rest", "body_parts", "keypoints", "asymmetry"} & set(found)


# Effects of skinning options


def test_effect_of_an_influence_limit_is_measured(describe, lines, box):
    # Vertex 7 follows joint 4 by 0.15; with four influences only joints 0 to 3 remain. With all
    # influences, its distance from the axis is 1 - 2 * 0.15 of that with the limit.
    options = about_z(4, HALF_TURN)
    effects = describe(box, *options)["effects"]
    assert effects["pruned to 4 influences"] == pytest.approx(0.3 * ACROSS)
    assert "pruned to 8 influences" not in effects
    assert "effect     pruned to 4 influences: up to 671 mm in this pose" in lines(box, *options)


def test_ten_influences_are_measured_with_two_limits(describe, tmp_path):
    weights = [f"0 {vertex} 1" for vertex in range(7)] + [f"{joint} 7 0.1" for joint in range(10)]
    box = write_box(
        tmp_path / "box",
        t_pose_joints="0 0 0\n" * 10,
        parents="-1\n" + "0\n" * 9,
        skinning_weights="\n".join(weights),
    )
    effects = describe(str(box), "--pose", pose_190(10, n32=HALF_TURN))["effects"]  # joint 9
    assert effects["pruned to 4 influences"] == pytest.approx(0.2 * ACROSS)
    assert effects["pruned to 8 influences"] == pytest.approx(0.2 * ACROSS)


def test_limit_on_a_figure_at_rest_has_no_effect(describe, lines, box):
    assert describe(box)["effects"] == {}
    assert not [line for line in lines(box) if line.startswith("effect")]


def test_effect_of_normalising_is_measured_in_millimetres(describe, lines, tmp_path):
    rows = [f"0 {vertex} 1" for vertex in range(6)]
    weights = "\n".join([*rows, "0 6 1.002", "0 7 0.6", "1 7 0.395"])
    box = str(write_box(tmp_path / "box", skinning_weights=weights))
    # Vertex 7 is sqrt(14) m from the origin, and its weights sum to 0.995; vertex 6 moves less.
    moved = 0.005 * math.sqrt(14)
    # Dual quaternions are normalised for any weights.
    expected = {"normalised weights": moved, "DQS against LBS": moved}
    assert describe(box)["effects"] == pytest.approx(expected)
    told = lines(box)
    assert "effect     normalised weights: up to 18.7 mm in this pose" in told
    assert "normalising would move rest vertices by up to 18.71 mm" in told
    assert "weights    raw; their sums are 0.995 to 1.002" in told


def test_effect_of_dual_quaternions_is_measured(describe, tmp_path):
    weights = "\n".join([*(f"0 {vertex} 1" for vertex in range(7)), "0 7 0.5", "1 7 0.5"])
    box = str(write_box(tmp_path / "box", skinning_weights=weights))
    effects = describe(box, *about_z(1, QUARTER_TURN))["effects"]
    # At half of 90 degrees, LBS reduces the distance of vertex 7 by a factor of cos 45, and DQS
    # keeps it.
    assert effects == pytest.approx({"DQS against LBS": (1 - math.sqrt(0.5)) * ACROSS})


def test_effect_of_correctives_is_measured(describe, body):
    path, arrays = body
    pose = 0.3 * np.sin(np.arange(72.0))
    whole = smpl_forward(arrays, (), pose)[0]
    plain = smpl_forward(arrays, (), pose, correct=False)[0]
    expected = np.linalg.norm(whole - plain, axis=1).max()
    options = ["--pose", ",".join(map(repr, pose.tolist()))]
    assert describe(path, *options)["effects"]["pose correctives"] == pytest.approx(expected)


def test_scaled_figure_shows_scaled_effects(describe, box):
    pose = pose_190(6, n17=HALF_TURN, n21=2.0)  # joint 4 about z, and twice the figure's size
    effects = describe(box, "--pose", pose)["effects"]
    assert effects["pruned to 4 influences"] == pytest.approx(2 * 0.3 * ACROSS)


def test_bundled_body_has_the_measurements_of_an_adult(describe):
    found = describe("--body")
    assert 1.5 < found["rest"]["height"] < 2.0 and 45 < found["rest"]["mass"] < 100
    assert len(found["shapes"]) == 10 and found["facts"]["correctives"] == "207 columns"
    assert found["asymmetry"] < 1e-6


def test_rounding_is_not_an_effect(describe, tmp_path):
    # The box rotates rigidly by an angle with a sine that is not a round number.
    box = str(write_box(tmp_path / "box", skinning_weights="\n".join(f"0 {v} 1" for v in range(8))))
    for angle in (0.1, 0.7, 2.0, 3.0):
        assert describe(box, "--pose", pose_190(6, n3=angle, n4=0.3))["effects"] == {}
