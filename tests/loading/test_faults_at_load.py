"""Faults of figures: every command that loads a file prints what ``viewer lint`` prints."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from formats import pig_text, skel_text, skin_text, synthetic_smpl
from formats.bvh_text import person
from formats.capture_files import body, write_frames
from formats.video_mocap.tool_files import wham_file

import viewer
from viewer.cli import run
from viewer.linting import SEVERITIES, lint_files
from viewer.loading import MotionSettings, bundled_body, load
from viewer.phrases import in_window

GOOD, SMPL = skin_text.GOOD, synthetic_smpl.model("smpl")
PIG = pig_text.GOOD["skinning_weights.txt"]


def skin(*changes: tuple[str, str]) -> Callable[[Path], list[Path]]:
    def write(folder: Path) -> list[Path]:
        text = GOOD
        for old, new in changes:
            assert old in text
            text = text.replace(old, new, 1)
        (folder / "a.skel").write_text(skel_text.GOOD)
        (folder / "a.skin").write_text(text)
        return [folder / "a.skel", folder / "a.skin"]

    return write


def pig(*changes: tuple[str, str]) -> Callable[[Path], list[Path]]:
    def write(folder: Path) -> list[Path]:
        rows = PIG
        for old, new in changes:
            assert old in rows
            rows = rows.replace(old, new, 1)
        return [pig_text.write(folder / "pig", skinning_weights=rows)]

    return write


def smpl(weights: np.ndarray) -> Callable[[Path], list[Path]]:
    def write(folder: Path) -> list[Path]:
        np.savez(folder / "m.npz", **{**SMPL, "weights": weights})
        return [folder / "m.npz"]

    return write


def scaled(vertex: int, factor: float) -> np.ndarray:
    """Return the weights of the body with those of one vertex scaled."""
    return (
        SMPL["weights"] * np.where(np.arange(len(SMPL["weights"])) == vertex, factor, 1.0)[:, None]
    )


def negative(vertex: int) -> np.ndarray:
    """Return the weights of the body with a negative one; the sum of the vertex stays 1."""
    weights = np.array(SMPL["weights"])
    joint = int(weights[vertex].argmax())
    rest = weights[vertex, (joint + 1) % 24]
    weights[vertex, joint] += 0.25 + rest
    weights[vertex, (joint + 1) % 24] = -0.25
    return weights


# Values by name: how to write the files, and the warnings without the folder.
FAULTS: dict[str, tuple[Callable[[Path], list[Path]], list[str]]] = {
    "sum of a skin": (
        skin(("0 1.0", "0 0.98"), ("0.75", "0.5")),
        ["a.skin:13: weights of 2 vertices do not sum to 1 (worst: 0.75 at vertex 1, an error of "
         "0.25)"],
    ),
    # One digit of four influences may be rounded: 0.005 is still a note, which load leaves to lint.
    "sum within the tolerance": (skin(("0 1.0", "0 0.9951")), []),
    "sum beyond the tolerance": (
        skin(("0 1.0", "0 0.994")),
        ["a.skin:12: weights of 1 vertex do not sum to 1 (worst: 0.994 at vertex 0, an error of "
         "0.006)"],
    ),
    "negative weight": (
        skin(("0.25 1 0.75", "-0.25 1 1.25")),
        ["a.skin:13: 1 negative weight (first: -0.25 at vertex 1 for joint root)"],
    ),
    "island without weights": (
        skin(("1 0 1.0", "0"), ("1 1 1\n", "1 1 0\n"), ("2 0 0.25 1 0.75", "0")),
        ["a.skin:12: 1 island with 3 vertices has no weights and stays in the bind pose (first: "
         "at vertex 0)"],
    ),
    "vertices without weights": (
        skin(("1 0 1.0", "0"), ("1 1 1\n", "1 1 0\n")),
        ["a.skin:12: 2 vertices have no influence and stay in the bind pose (first: vertex 0)"],
    ),
    "ill-conditioned binding": (
        skin(("0 0 1\n  5", "0 0 1e-8\n  5")),
        ["a.skin:20: 1 of 2 bind matrices is ill-conditioned: root (condition number 1e+08)"],
    ),
    # Three vertices are sparse, with a median distance of 2 from the first.
    "stray vertex": (
        skin(("  0 2 0\n", "  0 1e30 0\n")),
        ["a.skin:4: 1 stray vertex (worst: vertex 2, 5e+29 times the typical distance from the "
         "centre)"],
    ),
    "sums of a pig": (
        pig(("1 1 1\n", "1 1 0.98\n"), ("2 3 1\n", "2 3 1.5\n")),
        ["skinning_weights.txt:5: weights of 2 vertices do not sum to 1 (worst: 1.5 at vertex 3, "
         "an error of 0.5)"],
    ),
    "negative weight of a pig": (
        pig(("0 2 0.75", "0 2 1.25"), ("1 2 0.25", "1 2 -0.25")),
        ["skinning_weights.txt:3: 1 negative weight (first: -0.25 at vertex 2 for joint joint_1)"],
    ),
    "sum of a body": (
        smpl(scaled(7, 1.25)),
        ["m.npz: weights of 1 vertex do not sum to 1 (worst: 1.25 at vertex 7, an error of 0.25)"],
    ),
    "rounded sum of a body": (smpl(scaled(7, 1.002)), []),
}  # fmt: skip


@pytest.mark.parametrize("name", FAULTS)
def test_fault_is_a_warning_of_load_with_its_place(tmp_path, name):
    write, wanted = FAULTS[name]
    found = viewer.load(*write(tmp_path)).warnings
    assert [line.replace(f"{tmp_path}/", "").replace("pig/", "") for line in found] == wanted


@pytest.mark.parametrize("name", FAULTS)
def test_lint_and_other_commands_print_the_same_text(tmp_path, name, capsys):
    write, wanted = FAULTS[name]
    files = [str(path) for path in write(tmp_path)]
    assert run(["convert", *files, "-o", str(tmp_path / "a.obj")]) == 0
    printed = [
        line.split(": ", 2)
        for line in capsys.readouterr().err.splitlines()
        if line.startswith("warning: ")
    ]
    assert len(printed) == len(wanted)
    run(["lint", *files])
    linted = capsys.readouterr().out.splitlines()
    for _, place, message in printed:  # a file that is opened nevertheless has no errors
        (same,) = [one for one in linted if one.endswith(f": {message}")]
        assert same.startswith(f"{place}: ")


def test_figures_that_load_accepts_have_no_error_in_lint(tmp_path):
    """Negative weights of a body model are used as stored, like those of any other file."""
    files = smpl(negative(11))(tmp_path)
    (warning,) = viewer.load(*files).warnings
    assert "1 negative weight (first: -0.25 at vertex 11 for joint" in warning
    found = [one for one in lint_files(files)[1] if one.severity != "note"]
    assert [(one.code, one.severity) for one in found] == [("W002", "warning")]
    assert found[0].severity in SEVERITIES


FILE = Path("some.file")


def unused(*paths, **settings):
    found = load(*paths, motion=MotionSettings(**settings)).diagnostics
    return [note.key for note in found if ".unused-" in note.key]


@pytest.mark.parametrize(
    ("settings", "name"),
    [
        ({"space": "camera"}, "space"),
        ({"average_shape": True}, "average-shape"),
        ({"video": FILE}, "video"),
        ({"images": FILE}, "images"),
        ({"rig": "mixamo"}, "rig"),
    ],
)
def test_options_of_captures_are_reported_for_other_files(tmp_path, settings, name):
    path = tmp_path / "walk.bvh"
    path.write_text(person(100.0))
    assert unused(path, **settings) == [f"F007.unused-{name}"]
    # A model does not suppress the message, because it is read but has no choice of rigs.
    assert unused(path, model=bundled_body(), **settings) == [f"F007.unused-{name}"]


@pytest.mark.parametrize("suffix", ["obj", "ply"])
def test_up_axis_and_unit_may_be_stated_for_meshes(tmp_path, suffix):
    path = tmp_path / f"triangle.{suffix}"
    triangle = viewer.figure(np.eye(3), [[0, 1, 2]], up="z", unit="m")
    viewer.export(viewer.Actor(triangle), path)
    for settings, expected in (
        ({}, ("z", "m")),
        ({"up": "y"}, ("y", "m")),
        ({"unit": "cm"}, ("z", "cm")),
        ({"up": "-y", "unit": "in"}, ("y", "in")),
    ):
        scene = load(path, motion=MotionSettings(**settings))
        figure = scene[0].figure
        assert (figure.up, figure.unit) == expected
        told = [f"{path}: --up -y applies to motions only: y up"]
        assert list(scene.warnings) == (told if settings.get("up") == "-y" else [])
    with in_window():
        (said,) = load(path, motion=MotionSettings(up="-z")).warnings
    assert said == f"{path}: Up axis -z applies to motions only: z up"
    assert unused(bundled_body(), up="z", unit="cm") == ["F007.unused-unit", "F007.unused-up"]


def test_model_without_a_motion_is_reported():
    assert unused(bundled_body(), model=bundled_body()) == ["F007.unused-model"]


def test_space_and_shape_options_apply_only_to_video_motion_capture(tmp_path):
    path = wham_file(tmp_path)
    assert unused(path, space="camera", average_shape=True) == []
    write_frames(tmp_path / "take" / "smpl", {0: [body(0)]})
    found = unused(tmp_path / "take", space="camera", average_shape=True)
    assert found == ["F007.unused-space", "F007.unused-average-shape"]
