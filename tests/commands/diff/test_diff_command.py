"""``viewer diff``: known differences, exit codes, the table and JSON."""

import json

import numpy as np
import pytest
from formats.gltf.files import skinned
from PIL import Image

from viewer.cli import run

pytestmark = pytest.mark.slow

SKEL = """balljoint base {
  offset 0 0 0
  boxmin -1 -1 -1
  boxmax 1 1 1
  balljoint tip {
    offset %s 0 0
    boxmin -1 -1 -1
    boxmax 1 1 1
  }
}
"""
SKIN = """positions 4 { 0 0 0  3 0 0  3 %s 0  0 4 0 }
normals 4 { 0 0 1  0 0 1  0 0 1  0 0 1 }
skinweights 4 { 1 0 1  1 1 1  2 0 %s 1 %s  1 0 1 }
triangles 2 { 0 1 2  0 2 3 }
bindings 2 {
  matrix { 1 0 0  0 1 0  0 0 1  0 0 0 }
  matrix { 1 0 0  0 1 0  0 0 1  3 0 0 }
}
"""
ANIM = """animation {
  range 0 1
  numchannels %d
"""
CHANNEL = """  channel {
    extrapolate constant constant
    keys 2 { 0 0 linear linear  1 %s linear linear }
  }
"""


def write(folder, tip="3", height="4", weights=("0.5", "0.5")):
    """Write a rig of two joints and a rectangle of 3 x ``height``, with a size of 5 at height 4."""
    folder.mkdir(exist_ok=True)
    (folder / "a.skel").write_text(SKEL % tip)
    (folder / "a.skin").write_text(SKIN % (height, *weights))
    return str(folder)


def said(capsys, *arguments):
    code = run(["diff", *arguments])
    caught = capsys.readouterr()
    return code, caught.out.splitlines(), caught.err


def picture(path):
    with Image.open(path) as image:
        return np.asarray(image).astype(int)


def test_folder_equals_itself_at_any_tolerance(tmp_path, capsys):
    folder = write(tmp_path / "a")
    code, lines, _ = said(capsys, folder, folder, "--tolerance", "0")
    assert code == 0
    assert lines == [
        f"{folder}:",
        "    joint positions: at most 0 (0 % of the size), mean 0 (0 % of the size)",
        "    joint orientations: at most 0°, mean 0°",
        "    vertices: at most 0 (0 % of the size), mean 0 (0 % of the size)",
        "    weights: at most 0, mean 0",
        "  within the tolerance of 0",
    ]


def test_worst_joint_vertex_and_weight_are_reported_and_exit_code_is_set(tmp_path, capsys):
    first = write(tmp_path / "a")
    second = write(tmp_path / "b", height="4.5", weights=("0.25", "0.75"))
    arguments = (first, second, "--poses", "0")
    code, lines, _ = said(capsys, *arguments, "--tolerance", "0.09")
    assert code == 1
    assert "    vertices: at most 0.5 (10 % of the size) (vertex 2, own pose)," in lines[3]
    assert lines[4] == "    weights: at most 0.5 (vertex 2), mean 0.125"
    assert lines[-1] == "  differs by more than the tolerance of 0.09"
    # The 0.5 of the weights is within the tolerance.
    assert said(capsys, *arguments, "--tolerance", "0.5")[0] == 0
    assert said(capsys, *arguments)[0] == 0  # no tolerance is given


def test_several_comparisons_are_printed_as_a_table_and_errors_do_not_stop_them(tmp_path, capsys):
    reference = write(tmp_path / "ref")
    good, other = write(tmp_path / "good"), write(tmp_path / "other", tip="3.5")
    broken = write(tmp_path / "broken")
    (tmp_path / "broken" / "a.skel").write_text("balljoint base {\n offset 0 zero 0\n}\n")
    code, lines, _ = said(
        capsys, reference, good, other, broken, "--tolerance", "1e-4", "--poses", "0"
    )
    assert code == 2
    assert lines[0].split() == ["joints", "orientations", "vertices", "weights", "result"]
    assert lines[1].endswith("within")
    assert "0.5 (10 % of the size)" in lines[2] and lines[2].endswith("DIFFERS")
    assert lines[3].endswith('a.skel:2: offset of joint base: expected a number, found "zero"')


def test_extra_skeleton_is_reported_and_the_figure_of_equal_name_compared(tmp_path, capsys):
    reference, other = write(tmp_path / "ref"), write(tmp_path / "other", tip="3.5")
    # It precedes a.skel and equals the skeleton of the reference.
    (tmp_path / "other" / "0.skel").write_text(SKEL % "3")
    code, lines, _ = said(capsys, reference, other, "--poses", "0", "--tolerance", "1")
    assert code == 1  # one mismatch has no tolerance
    assert lines[:3] == [
        f"{other}:",
        f"  only in {other}: 0 (a skeleton)",
        "  a:",
    ]
    assert lines[3].startswith(
        "    joint positions: at most 0.5 (10 % of the size) (tip, own pose)"
    )
    _, lines, _ = said(capsys, reference, other, reference, "--poses", "0")
    assert lines[1].split("  ")[1:2] == ["0.5 (10 % of the size)"]
    assert lines[1].endswith("1 mismatch")
    _, lines, _ = said(capsys, other, reference, "--poses", "0")
    assert lines[1] == "  only in the reference: 0 (a skeleton)"


def test_pairing_by_different_names_is_reported(tmp_path, capsys):
    reference, other = write(tmp_path / "ref"), write(tmp_path / "other")
    (tmp_path / "other" / "a.skel").rename(tmp_path / "other" / "b.skel")
    (tmp_path / "other" / "a.skin").rename(tmp_path / "other" / "b.skin")
    _, lines, _ = said(capsys, reference, other, "--poses", "0")
    assert not any("compared with" in line for line in lines)  # the only figure is compared
    (tmp_path / "other" / "c.skel").write_text(SKEL % "3")
    _, lines, _ = said(capsys, reference, other, "--poses", "0")
    assert lines[1:4] == [
        f"  only in {other}: c (a skeleton)",
        "  a:",
        "    note: compared with b",
    ]


def test_json_contains_mismatches_as_text_and_as_data(tmp_path, capsys):
    reference, other = write(tmp_path / "ref"), write(tmp_path / "other")
    (tmp_path / "other" / "0.skel").write_text(SKEL % "3")
    assert run(["diff", reference, other, "--json", "--poses", "0", "--tolerance", "1"]) == 1
    (row,) = json.loads(capsys.readouterr().out)["comparisons"]
    assert row["mismatches"] == [f"only in {other}: 0 (a skeleton)"]
    (found,) = row["diagnostics"]
    assert found["key"] == "D001.actor"
    assert found["values"]["side"] == other
    assert found["values"]["actor"] == {"text": "0 (a skeleton)", "values": {"name": "0"}}


def test_json_contains_every_joint_and_the_position_of_the_worst(tmp_path, capsys):
    first, second = write(tmp_path / "a"), write(tmp_path / "b", tip="3.5")
    assert run(["diff", first, second, "--json", "--poses", "0", "--tolerance", "1"]) == 0
    found = json.loads(capsys.readouterr().out)
    (row,) = found["comparisons"]
    assert row["within"] and row["error"] is None
    (actor,) = row["actors"]
    assert actor["size"] == pytest.approx(5.0)
    places = actor["measures"][0]
    assert places["name"] == "joint positions" and places["item"] == "tip"
    assert places["maxima"] == {"base": 0.0, "tip": 0.5}
    assert places["relative"] == pytest.approx(0.1) and places["mean"] == pytest.approx(0.25)


def test_clips_are_compared_on_a_shared_skeleton(tmp_path, capsys):
    write(tmp_path / "a")
    for name, height in (("one", "0"), ("two", "0.25")):
        # The channels are root translation x, y, z, then the angles of base and tip; y moves.
        channels = [CHANNEL % (height if channel == 1 else "0") for channel in range(9)]
        text = ANIM % 9 + "".join(channels) + "}\n"
        (tmp_path / f"{name}.anim").write_text(text)
    code, lines, _ = said(
        capsys,
        str(tmp_path / "one.anim"),
        str(tmp_path / "two.anim"),
        "--with",
        str(tmp_path / "a" / "a.skel"),
    )
    assert code == 0
    # The distance rises from 0 to 0.25 in a second, so the mean of all frames is half of the
    # maximum.
    assert "joint positions: at most 0.25 " in lines[1] and ", mean 0.125 " in lines[1]


def test_heat_map_shows_the_location_of_the_difference(tmp_path, capsys):
    first, second = write(tmp_path / "a"), write(tmp_path / "b", height="5")
    output = tmp_path / "heat.png"
    code, lines, _ = said(capsys, first, second, "--poses", "0", "-o", str(output))
    assert code == 0 and lines[-1] == f"{output}: the largest distance at each vertex"
    pixels = picture(output)
    assert pixels.shape == (960, 1280, 3)
    # The colour map is from dark violet to bright yellow; only the moved vertex is bright.
    bright = (pixels[200:, :, 0] > 220) & (pixels[200:, :, 2] < 160)
    dark = pixels[200:, :, :3].max(axis=2) < 90
    assert 100 < bright.sum() < dark.sum()
    code, _, error = said(capsys, first, second, "-o", str(output))
    assert code == 5 and "already exists (--force replaces it)" in error


def test_heat_maps_of_several_pairs_form_one_sheet(tmp_path, capsys):
    first, second = write(tmp_path / "a"), write(tmp_path / "b", height="5")
    output = tmp_path / "heat.png"
    _, lines, _ = said(capsys, first, second, first, "--poses", "0", "-o", str(output))
    assert lines[-1] == f"{output}: 2 heat maps with a common scale"
    # The second figure has no differences and is dark, next to the bright corner of the first.
    sheet = picture(output)
    bright = (sheet[:, :, 0] > 220) & (sheet[:, :, 2] < 160)
    height = sheet.shape[0] // 2
    tops = bright[height // 4 : height].sum(), bright[height + height // 4 :].sum()
    assert tops[0] > 100 and tops[1] == 0


def test_picture_that_cannot_be_written_is_refused_before_the_comparison(tmp_path, capsys):
    folder = write(tmp_path / "a")
    for other in (folder, str(tmp_path / "missing.skel")):
        code, lines, error = said(capsys, folder, other, "-o", str(tmp_path / "heat.mp4"))
        assert code == 2 and lines == [] and ".png" in error and 'found ".mp4"' in error


def test_folder_without_a_rig_is_refused(tmp_path, capsys):
    folder = write(tmp_path / "a")
    (tmp_path / "empty").mkdir()
    code, lines, _ = said(capsys, folder, str(tmp_path / "empty"))
    assert code == 2 and "expected a folder with rig files (.skel, .skin, " in lines[1]
    code, _, error = said(capsys, str(tmp_path / "empty"), folder)
    assert code == 2 and error.startswith(f"{tmp_path / 'empty'}: expected a folder with rig files")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--tolerance", "-1"), "--tolerance: expected 0 or more, found -1"),
        (("--poses", "-1"), "--poses: expected 0 to 10000, found -1"),
        (("--frames", "1:9:2"), "--frames: expected A:B without a step, found 1:9:2"),
    ],
)
def test_invalid_tolerances_are_refused(tmp_path, capsys, arguments, message):
    folder = write(tmp_path / "a")
    code, _, error = said(capsys, folder, folder, *arguments)
    assert code == 2 and error == f"viewer: {message}\n"


@pytest.mark.parametrize(
    ("shift", "shown"), [(0.0125, "12.5 mm"), (2.5, "2.5 m"), (12345.0, "12,345 m")]
)
def test_lengths_of_a_known_unit_are_millimetres_or_metres(tmp_path, capsys, shift, shown):
    paths = []
    for name, offset in (("a", 0.0), ("b", shift)):
        folder = tmp_path / name
        folder.mkdir()
        file = skinned()
        file.root["nodes"][1]["translation"] = [offset, 0, 0]
        (folder / "rig.glb").write_bytes(file.glb())
        paths.append(str(folder / "rig.glb"))
    _, lines, _ = said(capsys, *paths, "--poses", "0")
    [positions] = [line for line in lines if "joint positions" in line]
    assert f"at most {shown} " in positions
