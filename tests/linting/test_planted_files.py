"""Errors introduced into files, which are reader errors and reader warnings."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from faults import told
from formats import bvh_text, capture_files, pig_text, skel_text, skin_text, synthetic_smpl

from viewer.linting import CODES, Finding, LintOptions, lint_files

STILL = "channel { extrapolate constant constant keys 1 { 0 0 flat flat } }\n"
CLIP = (
    "animation { range 0 1 numchannels 9\n"
    + STILL * 8
    + "channel { extrapolate constant constant keys 2 {\n0 0 flat flat\n1 1 flat flat } } }\n"
)
LATE_KEYS = CLIP.replace("0 0 flat flat\n1 1", "1 0 flat flat\n0.5 1")


def linted(folder: Path, texts: dict[str, str | bytes]) -> list[Finding]:
    """Write files, lint them together, and return the findings with file names without folders."""
    paths = []
    for name, text in texts.items():
        paths.append(folder / name)
        paths[-1].write_bytes(text if isinstance(text, bytes) else text.encode())
    return lint_files(paths)[1]


def skin(old: str, new: str) -> dict[str, str]:
    assert old in skin_text.GOOD
    return {"a.skel": skel_text.GOOD, "a.skin": skin_text.GOOD.replace(old, new, 1)}


def skel(old: str, new: str) -> dict[str, str]:
    assert old in skel_text.GOOD
    return {"a.skel": skel_text.GOOD.replace(old, new, 1)}


# A leg with a knee, which the motion lacks.
LEG = """balljoint Hips { offset 0 1 0
  balljoint LeftUpLeg { offset 0.1 0 0
    balljoint LeftLeg { offset 0 -0.4 0
      balljoint LeftFoot { offset 0 -0.5 0 } } } }
"""
LEG_SKIN = skin_text.POSITIONS + skin_text.NORMALS + skin_text.TRIANGLES + (
    "skinweights 3 { 1 0 1 1 0 1 1 0 1 }\n"
    f"bindings 4 {{ {skin_text.MATRIX * 4} }}\n"
)  # fmt: skip
RIG = {"a.skel": skel_text.GOOD, "a.skin": skin_text.GOOD}

# Values by name: (texts, code, severity, file, line).
FAULTS: dict[str, tuple[dict[str, str], str, str, str, int | None]] = {
    "not a number": (skin("2 0 0", "2 up 0"), "F002", "error", "a.skin", 3),
    "not finite": (skin("2 0 0", "2 nan 0"), "F003", "error", "a.skin", 3),
    "weight not finite": (skin("1 0 1.0", "1 0 nan"), "W003", "error", "a.skin", 12),
    "weight of no joint": (skin("1 1 1\n}", "1 2 1\n}"), "W010", "error", "a.skin", 14),
    "weights without bindings": (
        {"a.skin": skin_text.GOOD.replace(skin_text.BINDINGS, "")}, "B001", "error", "a.skin", 11
    ),
    "singular binding": (skin("0 1 0\n  0 0 1\n  5", "0 0 0\n  0 0 1\n  5"), "B002", "error",
                         "a.skin", 20),
    "too few bindings": (
        {"a.skel": skel_text.GOOD.replace("offset 0 1 0\n", "balljoint b { }\n"),
         "a.skin": skin_text.GOOD}, "B001", "error", "a.skin", None,
    ),
    "sum not 1": (skin("2 0 0.25", "2 0 0.5"), "W001", "warning", "a.skin", 13),
    "negative weight": (skin("0.25 1 0.75", "-0.25 1 1.25"), "W002", "warning", "a.skin", 13),
    "no weight": (skin("1 1 1\n}", "0\n}"), "W004", "warning", "a.skin", 14),
    "normal of length 0": (skin("0 0 1\n  0 1 0", "0 0 0\n  0 1 0"), "M007", "warning",
                           "a.skin", 8),
    "texture missing": (
        skin("triangles 1",
             "texcoords 3 { 0 0 0 0 0 0 }\nmaterial { texture gone.png\n}\ntriangles 1"),
        "F005", "warning", "a.skin", 17,
    ),
    "unknown section": (skin("triangles 1", "colours 1 { 2 }\ntriangles 1"), "F006", "warning",
                        "a.skin", 16),
    "limit turned around": (skel("rotxlimit -1 1", "rotxlimit 1 -1"), "S003", "error",
                            "a.skel", 5),
    "pose outside limits": (skel("pose 0.5", "pose 1.5"), "S004", "warning", "a.skel", 1),
    "same name": (skel("arm", "root"), "S006", "warning", "a.skel", 1),
    "clip for another skeleton": (
        {"a.skel": skel_text.GOOD,
         "a.anim": CLIP.replace("channels 9", "channels 6").replace(STILL * 3, "", 1)},
        "C009", "error", "a.anim", None,
    ),
    "keys out of order": ({"a.skel": skel_text.GOOD, "a.anim": LATE_KEYS}, "C001", "warning",
                          "a.anim", 12),
    "clip alone": ({"a.anim": CLIP}, "F004", "error", "a.anim", None),
    "obj index": ({"a.obj": "v 0 0 0\nf 1 1 2\n"}, "F002", "error", "a.obj", 2),
    "knee at rest": ({"leg.skel": LEG, "leg.skin": LEG_SKIN, "a.bvh": bvh_text.GOOD}, "C018",
                     "warning", "a.bvh", None),
    "bvh frame rate": ({"a.bvh": bvh_text.GOOD.replace("0.0333333", "25")}, "C017", "warning",
                       "a.bvh", None),
    "second offset": ({"a.bvh": bvh_text.GOOD.replace("0.1 0.0 0.0", "0.1 0 0 1 2 3")}, "F006",
                      "warning", "a.bvh", 8),
    "bvh number": ({"a.bvh": bvh_text.GOOD.replace("0.1 0.0 0.0", "0.1 nan 0.0")}, "F003",
                   "error", "a.bvh", 8),
}  # fmt: skip


@pytest.mark.parametrize("name", FAULTS)
def test_planted_fault_is_found_with_its_file_and_line(tmp_path, name):
    texts, code, severity, file, line = FAULTS[name]
    found = [finding for finding in linted(tmp_path, texts) if finding.code == code]
    assert [(f.severity, f.file, f.line) for f in found] == [(severity, tmp_path / file, line)]
    assert "\n" not in found[0].message and str(tmp_path / file) + ":" not in found[0].message


def test_base_files_of_planted_faults_are_valid(tmp_path):
    clip = {"a.skel": skel_text.GOOD, "a.anim": CLIP}
    for texts in (RIG, clip, {"a.bvh": bvh_text.GOOD}):
        heavy = [f.message for f in linted(tmp_path, texts) if f.severity == "error"]
        assert heavy == []


def test_other_files_are_still_checked(tmp_path):
    texts = {
        "bad.skel": "balljoint a { offset 1 }",
        **skin("2 0 0.25", "2 0 0.5"),
        "none.obj": "v 1",
    }
    found = linted(tmp_path, texts)
    assert [(f.code, f.file.name, f.line) for f in found if f.severity == "error"] == [
        ("F002", "bad.skel", 1),
        ("F002", "none.obj", 1),
        ("F004", "none.obj", None),  # the skin does not match the remaining joint
    ]
    assert [f.code for f in found if f.code == "W001"] == ["W001"]


def test_missing_file_is_a_finding(tmp_path):
    scene, found = lint_files([tmp_path / "none.npz"])
    assert [(f.code, f.severity, f.message) for f in found] == [
        ("F001", "error", "cannot be read: No such file or directory")
    ]
    assert scene.actors == []


def test_skin_that_does_not_match_is_checked_without_its_skeleton(tmp_path):
    texts, *_ = FAULTS["too few bindings"]
    texts = {**texts, "a.skin": texts["a.skin"].replace("2 0 0.25", "2 0 0.5", 1)}
    assert {"B001", "W001"} <= {finding.code for finding in linted(tmp_path, texts)}


def smpl(change: Callable[[dict[str, np.ndarray]], None]) -> Callable[[Path], Path]:
    def write(folder: Path) -> Path:
        arrays = synthetic_smpl.model("smpl")
        change(arrays)
        np.savez(folder / "m.npz", **arrays)
        return folder / "m.npz"

    return write


def parents(joint: int, parent: int) -> Callable[[dict[str, np.ndarray]], None]:
    def change(arrays: dict[str, np.ndarray]) -> None:
        arrays["kintree_table"] = arrays["kintree_table"].copy()
        arrays["kintree_table"][0, joint] = parent

    return change


def put(key: str, place: tuple[int, ...], value: float) -> Callable[[dict[str, np.ndarray]], None]:
    def change(arrays: dict[str, np.ndarray]) -> None:
        arrays[key] = arrays[key].copy()
        arrays[key][place] = value

    return change


MODELS = {
    "parent after its child": (smpl(parents(1, 9)), "S001"),  # 9 is a descendant of 6, 3 and 0
    "own parent": (smpl(parents(5, 5)), "S002"),
    "cycle": (smpl(parents(1, 4)), "S002"),  # the knee 4 is a child of the hip 1
    "late parent": (smpl(parents(1, 2)), "S001"),
    "negative weight": (smpl(put("weights", (3, 0), -0.5)), "W002"),
    "weight not finite": (smpl(put("weights", (3, 0), np.nan)), "W003"),
    "position not finite": (smpl(put("v_template", (3, 0), np.inf)), "F003"),
    "sum not 1": (smpl(put("weights", (3, 0), 7.0)), "W001"),
}


@pytest.mark.parametrize("name", MODELS)
def test_planted_faults_of_body_models_are_found(tmp_path, name):
    write, code = MODELS[name]
    path = write(tmp_path)
    found = [f for f in lint_files([path])[1] if (name, f.code) != ("negative weight", "W001")]
    severity = "warning" if code in ("W001", "W002") else "error"
    assert [(f.code, f.severity, f.file) for f in found] == [(code, severity, path)]


@pytest.mark.parametrize(
    ("parents_text", "code", "line"), [("-1\n2\n1\n", "S002", 2), ("-1\n2\n0\n", "S001", 2)]
)
def test_invalid_parents_in_pig_are_found(tmp_path, parents_text, code, line):
    folder = pig_text.write(tmp_path / "pig", parents=parents_text)
    found = [f for f in lint_files([folder])[1] if f.severity == "error"]
    assert [(f.code, f.file, f.line) for f in found] == [(code, folder / "parents.txt", line)]


def test_motion_of_another_gender_is_found(tmp_path):
    model, motion = tmp_path / "SMPLH_MALE.npz", tmp_path / "walk.npz"
    np.savez(model, **synthetic_smpl.model("smplh"))
    still = {"poses": np.zeros((2, 156)), "trans": np.zeros((2, 3)), "betas": np.zeros(10)}
    np.savez(motion, **still, gender="female", mocap_framerate=60.0)
    (found,) = [f for f in lint_files([model, motion])[1] if f.severity != "note"]
    assert (found.code, found.severity, found.file) == ("C019", "warning", motion)


def test_gaps_and_low_confidence_in_captures_are_found(tmp_path):
    frames = {frame: [capture_files.points(0)] for frame in range(20)}
    del frames[7], frames[8]
    folder = capture_files.write_frames(tmp_path / "keypoints3d", frames)
    found = lint_files([folder], LintOptions(confidence=0.7))[1]
    (gap,) = [f for f in found if f.code == "C005"]
    assert gap.frames.tolist() == [7, 8]
    gaps = ["frames 7 to 8"]
    values = {"n": 2, "all": 20, "n_gaps": 1, "gaps": gaps}
    assert told([gap.diagnostic]) == [("C005.gaps", values)]
    # The confidence of all 25 points in all 18 frames is 0.7 + 0.5 * waves.
    low = np.flatnonzero(0.5 * capture_files.waves(25, 4)[:, 3] < 0.0)
    named = [f for f in found if f.code == "C011"]
    assert sorted(np.concatenate([f.joints for f in named]).tolist()) == low.tolist()
    assert [len(f.joints) for f in named] == [1] * 6 + [len(low) - 6]
    ((key, values),) = told([named[0].diagnostic])
    del values["name"]
    assert (key, values) == ("C011.point", {"limit": 0.7, "percent": 100.0, "n": 18, "frame": 0})
    rest = named[6].diagnostic
    assert (rest.key, rest.values["limit"]) == ("C011.more-points", 0.7)
    assert rest.values["n"] == len(rest.values["points"]) == len(low) - 6


def test_damaged_frame_is_a_gap_and_is_reported(tmp_path):
    frames: dict[int | str, object] = {frame: [capture_files.points(0)] for frame in range(9)}
    folder = capture_files.write_frames(tmp_path / "keypoints3d", {**frames, 4: "[{"})
    found = lint_files([folder])[1]
    assert [f.frames.tolist() for f in found if f.code == "C005" and len(f.frames)] == [[4]]
    assert any("000004" in f"{f.file} {f.message}" for f in found)


def test_model_that_cannot_be_read_is_a_finding(tmp_path):
    from viewer.loading import MotionSettings

    frames = {frame: [capture_files.body(0)] for frame in range(3)}
    folder = capture_files.write_frames(tmp_path / "smpl", frames)
    found = lint_files([folder], settings=MotionSettings(model=tmp_path / "gone.npz"))[1]
    assert [(f.code, f.file) for f in found if f.severity == "error"] == [
        ("F001", tmp_path / "gone.npz")
    ]


def test_files_given_as_motions_are_checked(tmp_path):
    from viewer.loading import MotionSettings

    good, bad = tmp_path / "good.bvh", tmp_path / "bad.bvh"
    good.write_text(bvh_text.GOOD)
    bad.write_text(bvh_text.GOOD.replace("0.1 0.0 0.0", "0.1 nan 0.0"))
    found = lint_files([good], settings=MotionSettings(motions=(bad,)))[1]
    assert ("F003", bad, 8) in [(f.code, f.file, f.line) for f in found]


def test_every_code_is_produced_by_a_planted_fault():
    from formats.gltf.planted_gltf import PLANTED as GLTF
    from linting.planted import FAULTS as FIGURES
    from linting.test_bad_keys import FAULTS as KEYS
    from linting.test_bad_rigs import FAULTS as RIGS

    planted = {code for _, code, *_ in FAULTS.values()} | {c for _, c, *_ in FIGURES.values()}
    # C019: test_motion_of_another_gender_is_found.
    planted |= {code for _, code in MODELS.values()} | {"F001", "C019"}
    planted |= set(GLTF)
    # test_bad_keys and test_bad_rigs
    planted |= {key.partition(".")[0] for _, key, *_ in [*KEYS.values(), *RIGS.values()]}
    planted |= {"C025", "S013", "W012", "W014", "W017"}
    # A readable file cannot cause these codes, which are remarks and not errors.
    assert set(CODES) - planted == {"F007"}
