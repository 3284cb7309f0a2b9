"""``viewer lint``: lines for editors, JSON for programs, and exit codes."""

import json
from pathlib import Path

import numpy as np
import pytest
from app.tiny import write_rig
from formats import skel_text, skin_text

from viewer.cli import run
from viewer.linting import CODES
from viewer.loading import bundled_files


@pytest.fixture
def rig(tmp_path: Path) -> list[str]:
    """A skeleton and a skin with one wrong weight sum."""
    (tmp_path / "a.skel").write_text(skel_text.GOOD)
    (tmp_path / "a.skin").write_text(skin_text.GOOD.replace("2 0 0.25", "2 0 0.5", 1))
    return [str(tmp_path / "a.skel"), str(tmp_path / "a.skin")]


def test_finding_is_printed_as_a_line_with_location_and_hint(rig, capsys):
    assert run(["lint", *rig]) == 0
    lines = capsys.readouterr().out.splitlines()
    at = next(index for index, line in enumerate(lines) if " W001: " in line)
    assert lines[at] == (
        f"{rig[1]}:13: warning W001: weights of 1 vertex do not sum to 1 (worst: 1.25 at vertex 1, "
        "an error of 0.25)"
    )
    assert lines[at + 1] == (
        "    weights do not sum to 1; remedy: normalise them (--normalize shows the effect)"
    )
    assert lines[-1].endswith("in 2 files")


@pytest.mark.parametrize(
    ("fail_on", "code"), [("error", 0), ("warning", 1), ("note", 1), ("never", 0)]
)
def test_option_fail_on_sets_the_exit_code(rig, capsys, fail_on, code):
    assert run(["lint", *rig, "--fail-on", fail_on]) == code


def test_errors_fail_by_default_and_are_listed_first(rig, tmp_path, capsys):
    missing = str(tmp_path / "none.skel")
    assert run(["lint", *rig, missing]) == 1
    out = capsys.readouterr().out
    assert out.startswith(f"{missing}: error F001: cannot be read: No such file or directory\n")
    assert " W001: " in out
    assert run(["lint", missing, "--fail-on", "never"]) == 0


def test_ignored_codes_do_not_affect_the_exit_code(rig, capsys):
    arguments = ["lint", *rig, "--fail-on", "warning", "--ignore"]
    found = json_of(["lint", *rig], capsys)["findings"]
    heavy = sorted({f["code"] for f in found if f["severity"] != "note"})
    assert run([*arguments, ",".join(heavy).lower()]) == 0
    assert " W001: " not in capsys.readouterr().out
    assert run([*arguments, "X999"]) == 2
    assert '"X999"' in capsys.readouterr().err
    assert run([*arguments, "W0066"]) == 2
    assert "did you mean W006" in capsys.readouterr().err


def json_of(arguments: list[str], capsys) -> dict:
    run([*arguments, "--json"])
    return json.loads(capsys.readouterr().out)


def test_json_contains_every_location(rig, capsys):
    found = json_of(["lint", *rig], capsys)
    (weights,) = [f for f in found["findings"] if f["code"] == "W001"]
    assert (weights["file"], weights["line"], weights["actor"]) == (rig[1], 13, 0)
    assert weights["vertices"] == [1] and weights["n_vertices"] == 1
    assert weights["title"] == CODES["W001"].title and weights["hint"] == CODES["W001"].hint
    assert weights["hint"].startswith("normalise them (--normalize ")
    assert found["counts"]["warning"] == sum(f["severity"] == "warning" for f in found["findings"])


def test_codes_are_listed(capsys):
    assert run(["lint", "--codes"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == [*CODES, "P000"]
    assert lines[0] == "F001  error    unreadable file: check its path and permissions"


def test_missing_files_argument_is_refused(capsys):
    assert run(["lint", "--fail-on", "never"]) == 2
    said = capsys.readouterr()
    assert "FILES" in said.err and said.err.count("\n") == 1 and not said.out
    assert run(["lint", "--body", "--fail-on", "never"]) == 0


def test_bundled_figure_has_no_warnings(capsys):
    assert run(["lint", *map(str, bundled_files()), "--fail-on", "warning"]) == 0
    assert capsys.readouterr().out.endswith("0 errors, 0 warnings, 3 notes in 2 files\n")


def test_valid_rig_and_body_have_no_findings(tmp_path, capsys):
    assert run(["lint", *map(str, write_rig(tmp_path)), "--body"]) == 0


def test_largest_speed_can_be_set(shared, capsys):
    files = [str(shared / name) for name in ("wasp.skel", "wasp.skin", "wasp_walk.anim")]
    assert run(["lint", *files, "--fail-on", "warning"]) == 0
    assert run(["lint", *files, "--fail-on", "warning", "--max-speed", "0.01"]) == 1
    assert " C003: " in capsys.readouterr().out


def test_exceeded_size_limit_is_a_finding(rig, capsys):
    assert run(["lint", *rig, "--max-size", "10"]) == 1
    assert "expected at most 10 bytes" in capsys.readouterr().out
    assert run(["lint", *rig, "--max-size", "ten"]) == 2


def test_people_in_one_file_are_distinguished(shared_data, capsys):
    points = shared_data / "smpl_synthetic" / "easymocap" / "keypoints3d"
    assert run(["lint", str(points)]) == 0
    lines = [line for line in capsys.readouterr().out.splitlines() if " C012: " in line]
    what = "1 of 25 keypoints is never visible: right_ear"
    assert lines == [f"{points}: note C012: easymocap body25 {person}: {what}" for person in (0, 1)]


def test_ground_height_can_be_set(tmp_path, capsys):
    """A body at 2 m is not below the default ground, but below a ground at 2.5 m."""
    motion = tmp_path / "still.npz"
    rest = np.tile([0.0, 2.0, 0.0], (20, 1))
    np.savez(motion, poses=np.zeros((20, 72)), trans=rest, mocap_framerate=30.0, betas=np.zeros(10))
    files = ["lint", str(motion), "--up", "y"]
    assert run(files) == 0 and " C008: " not in capsys.readouterr().out
    assert run([*files, "--ground", "2.5"]) == 0
    assert " C008: 20 of 20 frames: left_foot is " in capsys.readouterr().out
    assert run([*files, "--ground", "none"]) == 0 and " C008: " not in capsys.readouterr().out
    assert run([*files, "--ground", "low"]) == 2
    assert "--ground" in capsys.readouterr().err


def test_keyed_frames_are_counted_by_fps(rig, tmp_path, capsys):
    still = "channel { extrapolate constant constant keys 1 { 0 0 flat flat } }\n"
    jump = "0 0 linear linear 1 0 linear linear 1.01 90 linear linear 2 90 linear linear"
    first = f"channel {{ extrapolate constant constant keys 4 {{ {jump} }} }}\n"
    (tmp_path / "a.anim").write_text(
        f"animation {{ range 0 2 numchannels 9\n{first}{still * 8}}}\n"
    )
    files = ["lint", rig[0], str(tmp_path / "a.anim")]
    assert run(files) == 0
    assert "1 of 61 frames: root moves" in capsys.readouterr().out
    assert run([*files, "--fps", "24"]) == 0
    out = capsys.readouterr().out
    assert "1 of 49 frames: root moves" in out and "at frame 24, 1.014 s" in out


def test_hints_differ_for_findings_without_a_line(tmp_path, capsys):
    (tmp_path / "empty.skel").write_text("")
    (tmp_path / "bad.skel").write_text("balljoint a { offset 1 }")
    run(["lint", str(tmp_path / "empty.skel"), str(tmp_path / "bad.skel")])
    lines = capsys.readouterr().out.splitlines()
    assert lines[1] == "    malformed file; remedy: export it again, or open another file"
    assert lines[3] == "    malformed file; remedy: fix the line or export the file again"


def test_limits_of_file_sizes_have_separators(tmp_path, capsys):
    (tmp_path / "a.obj").write_bytes(b"#" * 1_234_567)
    run(["lint", str(tmp_path / "a.obj"), "--max-size", "1M"])
    assert "expected at most 1,048,576 bytes, found 1,234,567 " in capsys.readouterr().out
