"""The Lint panel: agreement with ``viewer lint``, which reads files again, and jumps to gaps."""

import os
import time
from dataclasses import replace

import numpy as np
import pytest
from imgui_bundle import imgui
from lint.sound import FRAMES, RATE, column, keypoints, scene_of, standing
from lint.test_rechecks import TEXTS

from viewer.app.linting.lint_panel import Linting
from viewer.cli import run
from viewer.loading import bundled_files
from viewer.rig.motion.timing import Timing
from viewer.rig.scene import Scene

SIZE = (1000, 700)


@pytest.fixture
def files(tmp_path):
    for name, text in TEXTS.items():
        (tmp_path / name).write_text(text)
    return [tmp_path / name for name in TEXTS]


@pytest.fixture
def lint(drive):
    """Open an app that shows files or a scene with the Lint panel open and the check finished."""

    def open_panel(*paths, **settings):
        hand = drive(*paths, size=SIZE, samples=1, **settings)
        hand.menu("menu Edit", "Check the rig")
        finish(hand)
        return hand

    return open_panel


def finish(hand):
    running = hand.state.of(Linting).running
    if running is not None:
        running.job.wait()
    hand.step(3)


def row_of(hand, code):
    codes = [finding.code for finding in hand.state.of(Linting).checked.findings]
    return f"finding {codes.index(code)}"


def test_panel_copies_the_text_that_the_command_prints(lint, files, monkeypatch, capsys):
    hand = lint(*files)
    copied = []
    monkeypatch.setattr(imgui, "set_clipboard_text", copied.append)
    hand.click("Copy text")
    run(["lint", *map(str, files)])
    assert copied[-1] + "\n" == capsys.readouterr().out
    assert " S003: " in copied[-1] and copied[-1].endswith(" in 3 files")


def test_files_of_the_bundled_figure_are_checked(lint, monkeypatch, capsys):
    hand = lint()
    copied = []
    monkeypatch.setattr(imgui, "set_clipboard_text", copied.append)
    hand.click("Copy text")
    run(["lint", *map(str, bundled_files())])
    assert copied[-1] + "\n" == capsys.readouterr().out


def test_rows_show_file_and_line_and_can_be_filtered_by_them(lint, files, texts):
    hand = lint(*files)
    texts.clear()
    hand.step()
    assert "limit with minimum above maximum (a.skel:5)" in texts
    hand.click("Filter findings")
    hand.type("a.anim")
    listed = [name for name in hand.state.item_rects if name.startswith("finding ")]
    assert row_of(hand, "C001") in listed and row_of(hand, "W001") not in listed


def test_click_on_a_reader_finding_jumps_to_its_vertex(lint, files):
    hand = lint(*files)
    hand.click(row_of(hand, "M007"))
    assert hand.state.of(Linting).marks.points.shape == (1, 3)
    assert hand.state.camera.target == pytest.approx(hand.state.of(Linting).marks.points[0])


def test_missing_or_changed_files_are_reported(lint, files, texts):
    hand = lint(*files)
    files[1].unlink()
    os.utime(files[0], (time.time() + 100.0,) * 2)
    texts.clear()
    hand.click("Recheck")
    finish(hand)
    assert "a.skin is missing: only the open scene was checked" in texts
    assert "a.skel was changed after opening: readers' messages are about the new contents" in texts


def test_finding_about_a_file_states_this_and_copies_its_location(lint, files, texts, monkeypatch):
    hand = lint(*files)
    copied = []
    monkeypatch.setattr(imgui, "set_clipboard_text", copied.append)
    # The second vertex is on the third line; the scene was loaded before the change.
    files[1].write_text(TEXTS["a.skin"].replace("2 0 0", "2 nan 0", 1))
    hand.click("Recheck")
    finish(hand)
    row = row_of(hand, "F003")
    assert hand.state.of(Linting).checked.findings[int(row.split()[1])].actor is None
    texts.clear()
    hand.move(row)
    hand.step(60)
    words = "this finding is about the file, not the figure shown: click to copy its path and line"
    assert words in texts and f"{files[1]}:3" in texts
    target = hand.state.camera.target.copy()
    hand.click(row)
    assert copied == [f"{files[1]}:3"] and hand.says(f"Copied {files[1]}:3")
    assert hand.state.of(Linting).chosen == -1 and (hand.state.camera.target == target).all()


def test_rows_describe_what_a_click_does(lint, files, texts):
    hand = lint(*files)
    row = row_of(hand, "M007")
    hand.move(row)
    hand.step(60)
    assert "click to show it in the view; click again or press Esc to stop" in texts
    actor = hand.state.actor
    hand.state.scene.actors[0] = replace(actor, figure=replace(actor.figure))
    texts.clear()
    hand.step(2)
    assert "click to select the actor: its figure has changed since the check" in texts


def gappy() -> Scene:
    """Return a column that is at x = 7 in frame 109 and missing in frames 110 to 112."""
    figure = column()
    rows = np.arange(FRAMES)
    rows[10:13] = -1
    places = np.zeros((FRAMES, figure.skeleton.n_joints, 3))
    places[:13, 0, 0] = 7.0
    clip = replace(
        standing(figure), translations=places, timing=Timing(RATE, rows, first_frame=100)
    )
    return scene_of(figure, clip)


def test_click_on_a_gap_jumps_to_the_frame_before_it(lint):
    hand = lint(scene=gappy())
    hand.click(row_of(hand, "C005"))
    playback, view = hand.state.clock, hand.state.of(Linting)
    assert playback.frame + playback.first_frame == 109
    assert view.finding.message == "3 of 60 frames are missing in 1 gap: frames 110 to 112"
    assert hand.state.actor.is_present
    # The root of the figure is marked, and the whole figure is visible.
    assert view.marks.points.tolist() == [[7.0, 0.0, 0.0]]
    assert hand.state.camera.target == pytest.approx([7.0, 2.0, 0.0])
    assert hand.says("Last frame before the gap: the person is absent in the next frame")


def test_gap_in_captured_points_marks_their_centre(lint):
    figure, clip = keypoints()
    rows = np.arange(FRAMES)
    rows[30] = -1
    hand = lint(scene=scene_of(figure, replace(clip, timing=Timing(RATE, rows))))
    hand.click(row_of(hand, "C005"))
    assert hand.state.clock.frame == 29
    # The points are at heights 1, 0.5 and 0.
    np.testing.assert_allclose(hand.state.of(Linting).marks.points, [[0.0, 0.5, 0.0]])


def test_ground_height_is_a_limit(lint):
    hand = lint(scene=scene_of(column()))
    hand.click("Limits…")
    hand.step(2)
    assert "Ground height" not in hand.state.item_rects
    hand.state.of(Linting).options = replace(hand.state.of(Linting).options, ground=0.0)
    hand.step(2)
    hand.enter_value("Ground height", "1.25")
    assert hand.state.of(Linting).options.ground == pytest.approx(1.25)
    hand.state.of(Linting).options = replace(hand.state.of(Linting).options, ground="none")
    hand.step(2)
    assert hand.state.of(Linting).options.ground == "none"
    assert "Ground height" not in hand.state.item_rects


def test_keyed_frames_are_numbered_as_in_the_timeline(lint, files):
    hand = lint(*files)
    assert hand.state.of(Linting).checked.options.frame_rate == 30.0
    hand.state.clock.count_by(24.0)
    hand.step(2)
    hand.click("Recheck")
    finish(hand)
    assert hand.state.of(Linting).checked.options.frame_rate == 24.0
