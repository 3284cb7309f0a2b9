"""The scripts of ``viewer help examples``: each runs as printed and does what it says."""

import csv
import re
import runpy
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from app.tiny import write_rig
from live_screen import screen_at
from manual.test_commands import shown_without_display
from PIL import Image

import viewer
from viewer.cli import run
from viewer.examples import EXAMPLES
from viewer.resources import resource

pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


class Script:
    """Runs a script as ``python NAME.py ARGUMENTS`` does, but in this process."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
        self._monkeypatch, self._capsys = monkeypatch, capsys
        self.code: Any = 0
        self.text = ""

    def __call__(self, name: str, *arguments: object) -> dict[str, Any]:
        """Run the script and return its names; its text and exit code are attributes."""
        path, names = resource("examples", f"{name}.py"), {}
        self._monkeypatch.setattr(sys, "argv", [str(path), *map(str, arguments)])
        self.code = 0
        try:
            names = runpy.run_path(str(path), run_name="__main__")
        except SystemExit as stop:
            self.code = int(stop.code or 0)
        self.text = self._capsys.readouterr().out
        return names


@pytest.fixture
def script(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Script:
    return Script(monkeypatch, capsys)


def floats(text: str) -> list[float]:
    return [float(number) for number in re.findall(r"-?\d+\.?\d*", text)]


def pixels(name: str) -> np.ndarray:
    with Image.open(name) as picture:
        return np.asarray(picture.convert("RGB")).astype(int)


def positions_in(path: str) -> np.ndarray:
    lines = Path(path).read_text().splitlines()
    return np.array([line.split()[1:4] for line in lines if line.startswith("v ")], float)


def written_weights() -> np.ndarray:
    """Return the weights of the fox as a table, parsed here: (V, J)."""
    text = resource("assets", "samples", "fox.skin").read_text()
    rows = text.partition("skinweights")[2].partition("{")[2].partition("}")[0].strip()
    lines = [line.split()[1:] for line in rows.splitlines()]
    table = np.zeros((len(lines), 1 + max(int(j) for line in lines for j in line[::2])))
    for row, line in zip(table, lines, strict=True):
        np.add.at(row, np.array(line[::2], int), np.array(line[1::2], float))
    return table


def test_open_and_pose_rotates_the_head_by_30_degrees(script):
    names = script("open_and_pose")
    assert "fox.obj: 7561 vertices" in script.text
    assert pixels("fox.png").shape == (360, 640, 3)
    viewer.export(viewer.load().actors[0], "rest.obj")
    before, after = positions_in("rest.obj"), positions_in("fox.obj")
    only = written_weights()[:, names["head"]] == 1.0
    assert only.sum() > 100
    centred = [points[only] - points[only].mean(axis=0) for points in (before, after)]
    rotation = np.linalg.lstsq(*centred, rcond=None)[0]
    assert np.trace(rotation) == pytest.approx(1.0 + 2.0 * np.cos(np.pi / 6), abs=1e-3)
    paws = before[:, 1] < before[:, 1].min() + 0.05
    np.testing.assert_array_equal(after[paws], before[paws])


def test_own_arrays_bend_the_tube_to_the_side(script):
    script("own_arrays")
    # The end, 1 above the elbow at (0, 1, 0), rotates by 90 degrees about z.
    assert floats(script.text) == [-1.0, 1.0, 0.0]
    figure = viewer.load("tube.glb").actors[0].figure
    assert figure.require_skin().n_joints == 2 and figure.require_mesh().n_vertices == 36
    assert figure.require_mesh().n_triangles == 64


def test_joint_weights_are_those_of_the_file(script):
    head = script("joint_weights")["skeleton"].names.index("head")
    weights = written_weights()[:, head]
    first, *rest = script.text.splitlines()
    assert floats(first) == [np.count_nonzero(weights), len(weights)]
    found = dict(map(floats, rest))
    assert len(found) == 5
    assert all(weights[int(vertex)] == weight == weights.max() for vertex, weight in found.items())
    assert pixels("head.png").shape == (360, 640, 3)


def test_retargeted_hand_moves_on_a_circle(script):
    script("retarget_bvh")
    assert "left_shoulder by LeftArm" in script.text
    frames = [floats(line)[1:] for line in script.text.splitlines() if line.startswith("frame")]
    start, middle, end = np.array(frames)
    # Chords of 45 and 90 degrees about one centre.
    first, second, whole = (
        np.linalg.norm(b - a) for a, b in ((start, middle), (middle, end), (start, end))
    )
    assert first == pytest.approx(second, abs=0.02) and first > 0.2
    ratio = np.sin(np.pi / 4) / np.sin(np.pi / 8)
    assert whole / first == pytest.approx(ratio, abs=0.06)  # the script prints centimetres


def test_retarget_takes_a_motion_and_a_character(script):
    samples = resource("assets", "samples")
    script("retarget_bvh", samples / "lift.bvh", samples / "body.npz")
    assert script.text.count("\nframe") == 3


def test_capture_becomes_a_bvh_with_the_bent_knee(script):
    script("capture_to_bvh")
    assert script.code == 0
    hierarchy, _, motion = Path("bvh/capture.bvh").read_text().partition("MOTION")
    assert "left_knee" in hierarchy
    straight, bent = (line.split() for line in motion.strip().splitlines()[-2:])
    changed = [float(b) for a, b in zip(straight, bent, strict=True) if float(a) != float(b)]
    assert changed == pytest.approx([np.degrees(0.5)], abs=1e-3)


def test_lint_in_ci_fails_for_a_bad_rig_only(script, tmp_path):
    script("lint_in_ci")
    assert script.code == 0 and "body.npz: done, exit code 0" in script.text
    _, skin = write_rig(tmp_path)
    skin.write_text(skin.read_text().replace("1 0 1\n", "1 0 0.5\n"))
    script("lint_in_ci", skin)
    assert script.code == 1 and "W001" in script.text
    with Path("findings.csv").open(encoding="utf-8", newline="") as stream:
        (row,) = csv.DictReader(stream)
    assert row["name"] == "tiny.skin" and "W001" in row["codes"]


def test_compare_rigs_prints_the_distance_of_an_independent_sum(script):
    names = script("compare_rigs")
    figure = names["reference"]
    mesh, skeleton, skin = figure.attached()
    exact = written_weights()
    tenths = exact.round(1)
    points = np.concatenate([mesh.positions, np.ones((mesh.n_vertices, 1))], axis=1)
    worst = 0.0
    for seed in range(20):
        random = np.random.default_rng(seed)
        pose = viewer.rest_pose(skeleton)
        pose.dofs += random.uniform(-0.3, 0.3, skeleton.n_dofs) * (skeleton.dof_kinds >= 3)
        palette = viewer.joint_matrices(figure, pose) @ skin.inverse_bind
        a, b = (
            np.einsum("vj,jab,vb->va", table / table.sum(axis=1)[:, None], palette, points)
            for table in (exact, tenths)
        )
        worst = max(worst, np.linalg.norm((b - a)[:, :3], axis=1).max())
    printed, length = floats(script.text)
    # The reference is not scaled; the sums in its file differ from 1 by up to 0.002.
    assert printed == pytest.approx(worst, abs=0.003)
    assert length == pytest.approx(np.ptp(a[:, :3], axis=0).max(), abs=0.003)


def test_paper_figure_is_a_silhouette_on_white(script):
    figure = script("paper_figure")["scene"].actors[0].figure
    drawn = pixels("figure.png")
    assert drawn.shape == (600, 800, 3)
    rows, columns = np.nonzero((drawn != 255).any(axis=2))
    high, wide = np.ptp(rows), np.ptp(columns)
    _, up, along = np.ptp(viewer.deform(figure)[0], axis=0)
    assert wide > 400 and wide / high == pytest.approx(along / up, rel=0.02)


def test_batch_runs_the_function_in_workers(tmp_path):
    """Workers import the script again, so it runs as a program."""
    path = resource("examples", "batch.py")
    done = subprocess.run(
        [sys.executable, path], capture_output=True, text=True, cwd=tmp_path, timeout=120
    )
    assert done.returncode == 0, done.stderr
    with Path("heights.csv").open(encoding="utf-8", newline="") as stream:
        (row,) = csv.DictReader(stream)
    body = np.load(resource("assets", "samples", "body.npz"))["v_template"]
    assert row["name"] == "body.npz" and row["status"] == "done"
    assert int(row["vertices"]) == len(body)
    assert float(row["height"]) == pytest.approx(body[:, 1].max(), abs=1e-3)


def test_live_training_moves_the_jaw_to_its_target(script, tmp_path, monkeypatch):
    path = tmp_path / "window.json"
    monkeypatch.setenv("VIEWER_CONNECTION_FILE", str(path))
    monkeypatch.setattr("viewer.show", shown_without_display)
    with screen_at(path) as screen:
        names = script("live_training")
        fox, jaw = screen.state.scene.actors[0], names["jaw"]
        # It begins 0.07 away, and the next frame of the window shows the last step.
        assert float(re.findall(r"([\d.]+) from the target", script.text)[0]) < 0.02
        screen.wait(lambda: np.linalg.norm(fox.joints()[0, jaw] - names["target"]) < 0.02)


def test_own_scalar_is_brightest_at_the_tip_of_the_tail(script):
    script("own_scalar")
    drawn = pixels("distance.png")
    yellow = (drawn[..., 0] > 225) & (drawn[..., 1] > 150) & (drawn[..., 2] < 120)
    violet = (drawn[..., 0] < 80) & (drawn[..., 1] < 40) & (drawn[..., 2] > 60)
    legend = np.s_[:70, :170]
    assert yellow[legend].any() and violet[legend].any()
    yellow[legend] = violet[legend] = False
    assert yellow.sum() > 100 and violet.sum() > 1000
    # The figure looks to the left of the picture, so its tail is on the right.
    assert np.nonzero(yellow)[1].mean() > np.nonzero(violet)[1].mean() + 100


@pytest.mark.parametrize("name", EXAMPLES)
def test_help_prints_the_script_as_it_is(name, capsys):
    assert run(["help", "examples", name]) == 0
    assert capsys.readouterr().out == resource("examples", f"{name}.py").read_text()


def test_help_lists_all_scripts(capsys):
    assert run(["help", "examples"]) == 0
    printed = capsys.readouterr().out
    assert all(f"  {name} " in printed and text in printed for name, text in EXAMPLES.items())


def test_example_after_another_topic_is_an_error(capsys):
    assert run(["help", "keys", "batch"]) == 2
    assert "expected one topic, found keys and batch" in capsys.readouterr().err


def test_unknown_example_suggests_the_nearest(capsys):
    assert run(["help", "examples", "retarget"]) == 2
    assert "retarget_bvh" in capsys.readouterr().err
