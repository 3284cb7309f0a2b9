"""Files with many errors, each of which is found once at its line."""

from pathlib import Path

import numpy as np
import pytest
from faults import told
from formats import bvh_text, skel_text, skin_text, synthetic_smpl
from lint.sound import column

from viewer.formats import write
from viewer.lint import Finding, lint_files
from viewer.rig.figure import Figure


def saved(folder: Path, figure: Figure) -> list[str]:
    """Write the valid column as ``.skel`` and ``.skin`` and return the lines of the ``.skin``."""
    write(figure, folder / "a.skel")
    write(figure, folder / "a.skin")
    return (folder / "a.skin").read_text().splitlines()


def section(lines: list[str], name: str) -> int:
    """Return the index of the line after the header of a section."""
    return next(k for k, line in enumerate(lines) if line.startswith(f"{name} ")) + 1


def linted(folder: Path, lines: list[str]) -> list[Finding]:
    (folder / "a.skin").write_text("\n".join(lines) + "\n")
    return lint_files([folder / "a.skel", folder / "a.skin"])[1]


def heavy(findings: list[Finding]) -> list[tuple[str, int | None]]:
    """Return code and line of errors and warnings."""
    return [(f.code, f.line) for f in findings if f.severity != "note"]


def test_valid_column_has_no_findings(tmp_path: Path) -> None:
    assert heavy(linted(tmp_path, saved(tmp_path, column()))) == []


def test_ten_errors_in_one_skin_are_ten_findings(tmp_path: Path) -> None:
    lines = saved(tmp_path, column())
    positions, weights = section(lines, "positions"), section(lines, "skinweights")
    triangles, bindings = section(lines, "triangles"), section(lines, "bindings")
    lines[positions + 2] = "nan 0 -1"
    lines[positions + 18] = "1 4 nan"
    lines[weights + 1] = "1 0 0.5"
    lines[weights + 4] = "2 0 -0.25 1 1.25"
    lines[weights + 5] = "0"
    lines[weights + 6] = "1 0 nan"
    lines[weights + 7] = "1 9 1.0"
    lines[triangles + 5] = "1 2 77"
    lines[triangles + 8] = " ".join(reversed(lines[triangles + 8].split()))
    lines[triangles + 9] = "0 1 1.5"
    assert lines[bindings].strip() == "matrix {"
    lines[bindings + 2] = "0 0 0"
    assert heavy(linted(tmp_path, lines)) == [
        ("F003", positions + 3),
        ("W003", weights + 7),
        ("F002", triangles + 10),
        ("F002", triangles + 6),
        ("B002", bindings + 1),
        ("W010", weights + 8),
        ("W001", weights + 2),
        ("W002", weights + 5),
        ("W004", weights + 6),
        ("M002", triangles + 9),
    ]


def test_findings_of_one_code_have_a_count_and_locations(tmp_path: Path) -> None:
    lines = saved(tmp_path, column())
    positions = section(lines, "positions")
    for vertex in (3, 8, 9):
        lines[positions + vertex] = "inf 1 nan"
    found = next(f for f in linted(tmp_path, lines) if f.code == "F003")
    item = "positions of vertex 3"
    assert told([found.diagnostic]) == [("F003.number", {"item": item, "found": b"inf"})]
    assert found.diagnostic.count == 6
    assert found.vertices.tolist() == [3, 8, 9] and found.line == positions + 4


@pytest.mark.parametrize("vertex", range(20))
def test_invalid_position_causes_no_other_finding(tmp_path: Path, vertex: int) -> None:
    lines = saved(tmp_path, column())
    lines[section(lines, "positions") + vertex] = "nan nan nan"
    assert [f.code for f in linted(tmp_path, lines) if f.severity != "note"] == ["F003"]
    assert "M005" not in {f.code for f in linted(tmp_path, lines)}


@pytest.mark.parametrize("triangle", [0, 7, 33, 35])
def test_invalid_triangle_causes_no_border_finding(tmp_path: Path, triangle: int) -> None:
    lines = saved(tmp_path, column())
    place = section(lines, "triangles") + triangle
    lines[place] = " ".join([*lines[place].split()[:2], "1000"])
    assert [f.code for f in linted(tmp_path, lines)] == ["F002"]


def test_invalid_weight_causes_no_other_finding(tmp_path: Path) -> None:
    lines = saved(tmp_path, column())
    lines[section(lines, "skinweights") + 9] = "2 0 nan 1 0.5"
    assert [f.code for f in linted(tmp_path, lines)] == ["W003"]


def test_singular_matrix_does_not_hide_other_findings(tmp_path: Path) -> None:
    lines = saved(tmp_path, column())
    bindings = section(lines, "bindings")
    lines[bindings + 1 : bindings + 4] = ["0 0 0"] * 3
    lines[bindings + 7] = "-1 0 0"  # the second matrix mirrors
    assert heavy(linted(tmp_path, lines)) == [("B002", bindings + 1), ("B005", bindings + 7)]


def test_skin_without_bind_matrices_is_checked_without_its_skeleton(tmp_path: Path) -> None:
    lines = saved(tmp_path, column())
    weights = section(lines, "skinweights")
    lines[weights] = "1 0 0.5"
    del lines[section(lines, "bindings") - 1 :]
    assert heavy(linted(tmp_path, lines)) == [("B001", weights), ("W001", weights + 1)]


def test_unparsable_file_is_reported_as_unchecked(tmp_path: Path) -> None:
    lines = saved(tmp_path, column())
    lines[section(lines, "positions") + 3] = "normals 4 {"
    (found,) = [f for f in linted(tmp_path, lines) if f.severity == "error"]
    assert (found.code, found.line) == ("F002", 5)
    values = {"section": "positions", "line": 1, "found": b"normals"}
    assert told([found.diagnostic]) == [("F002.unclosed", values)] and found.diagnostic.is_final


def test_invalid_joint_offset_is_not_a_bind_pose_mismatch(tmp_path: Path) -> None:
    texts = {"a.skel": skel_text.GOOD.replace("offset 0 1 0", "offset 0 nan 0"),
             "a.skin": skin_text.GOOD}  # fmt: skip
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    found = lint_files([tmp_path / name for name in texts])[1]
    assert [(f.code, f.line, f.joints.tolist()) for f in found if f.severity == "error"] == [
        ("F003", 10, [1])
    ]
    # The root is bound at a different position, 5 6 7.
    (bound,) = [f for f in found if f.code == "B004"]
    assert bound.joints.tolist() == [0] and bound.line == 20


def test_all_errors_in_a_rig_file_are_found(tmp_path: Path) -> None:
    """The files of a .rig are checked one by one, so that errors in one do not hide others."""
    (tmp_path / "a.rig").write_text("rig a { skeleton a.skel skin a.skin }")
    (tmp_path / "a.skel").write_text(skel_text.GOOD.replace("{", "[", 1))
    (tmp_path / "a.skin").write_text(skin_text.GOOD.replace("2 0 0.25", "2 0 0.5", 1))
    found = lint_files([tmp_path / "a.rig"])[1]
    files = [(f.code, f.file.name if f.file else "", f.line) for f in found]
    assert ("F002", "a.skel", 2) in files and ("W001", "a.skin", 13) in files


def test_body_errors_are_found_including_lazily_read_ones(tmp_path: Path) -> None:
    arrays = {key: np.array(values) for key, values in synthetic_smpl.model("smpl").items()}
    arrays["v_template"][3] = np.nan
    arrays["weights"][4, 0] = np.nan
    arrays["weights"][5] *= 0.5
    arrays["shapedirs"][0, 0, 0] = np.inf
    arrays["posedirs"][0, 0, 0] = np.nan
    np.savez(tmp_path / "m.npz", **arrays)
    found = lint_files([tmp_path / "m.npz"])[1]
    assert [(f.code, f.severity) for f in found if f.severity != "note"] == [
        ("F003", "error"), ("W003", "error"), ("F003", "error"), ("F003", "error"),
        ("W001", "warning"),
    ]  # fmt: skip
    assert found[0].vertices.tolist() == [3] and found[1].vertices.tolist() == [4]
    assert [f.diagnostic.values["item"] for f in found[2:4]] == ["shapedirs", "posedirs"]


def test_invalid_frames_are_not_jumps(tmp_path: Path) -> None:
    head = bvh_text.GOOD[: bvh_text.GOOD.index("MOTION")]
    rows = [f"{k} 100 0" + " 0" * 12 for k in range(30)]
    rows[10] = rows[10].replace("100", "nan")
    rows[20] = "90000" + rows[20][2:]
    text = "\n".join([f"{head}MOTION", "Frames: 30", "Frame Time: 0.1", *rows])
    (tmp_path / "a.bvh").write_text(text + "\n")
    found = lint_files([tmp_path / "a.bvh"])[1]
    first = text[: text.index(rows[0])].count("\n") + 1
    gap, jump = (next(f for f in found if f.code == code) for code in ("C005", "C003"))
    assert gap.frames.tolist() == [10]
    assert jump.line in (first + 20, first + 21) and sorted(jump.frames.tolist()) == [20, 21]


def test_lengths_without_a_unit_are_in_figure_units(tmp_path: Path) -> None:
    lines = saved(tmp_path, column())
    skel = (tmp_path / "a.skel").read_text()
    assert "offset 0.0 2.0 0.0" in skel
    (tmp_path / "a.skel").write_text(skel.replace("offset 0.0 2.0 0.0", "offset 0.0 3.0 0.0"))
    (bound,) = [f for f in linted(tmp_path, lines) if f.code == "B004"]
    # One unit of a column of 2 x 4 x 2 with a diagonal of sqrt(24).
    values = {"n": 1, "joint": "knee", "distance": "1 units (20.4 % of its size)"}
    assert told([bound.diagnostic]) == [("B004.joints", values)]
    assert bound.line == section(lines, "bindings") + 7
