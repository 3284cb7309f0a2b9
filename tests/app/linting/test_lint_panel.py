"""The Lint panel: checks, its list, where a click leads, marks, and what makes findings stale."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from imgui_bundle import imgui
from lint.sound import FRAMES, RATE, column, keypoints, scene_of, standing
from lint.test_planted_faults import weighted

from viewer.app.linting.actions import check_rig, start_check
from viewer.app.linting.marks import marks_of
from viewer.app.linting.state import Linting
from viewer.app.shown_panels import ShownPanels
from viewer.lint import CODES, Places, describe, lint_scene
from viewer.rendering.camera import camera_axes
from viewer.rendering.overlay.marks import MARK_COLOR
from viewer.rig.figure import Figure
from viewer.rig.scene import Actor, Scene

PINK = np.array([round(255 * channel) for channel in MARK_COLOR])
SIZE = (1000, 700)
# Vertex 5, at (-1, 1, 1), is bound to the foot at the origin, and joint 1 is the knee at y = 2:
# a weight of 0.9 takes it to (-0.9, 0.9, 0.9).
LIGHT = weighted({5: [(0, 0.9)]})


def several() -> Figure:
    """Return the column with an error, two warnings and a note."""
    figure = column()
    triangles = figure.mesh.triangles.copy()
    triangles[3] = triangles[3][::-1]
    figure = weighted(
        {5: [(0, 0.9)], 9: [(0, -0.5), (1, 1.5)]},
        replace(figure, mesh=replace(figure.mesh, triangles=triangles)),
    )
    matrices = figure.skin.inverse_bind.copy()
    matrices[1, 3] = 0.0, 0.0, 0.5, 1.0
    return replace(figure, skin=replace(figure.skin, inverse_bind=matrices))


@pytest.fixture
def lint(drive):
    """Open an app that shows a figure or scene, its Lint panel open and the check done."""

    def open_panel(shown, **settings):
        scene = shown if isinstance(shown, Scene) else scene_of(shown)
        hand = drive(scene=scene, size=SIZE, samples=1, **settings)
        hand.menu("menu Edit", "Check the rig")
        finish(hand)
        return hand

    return open_panel


def finish(hand):
    """Run frames until the check has ended and is shown."""
    running = hand.state.of(Linting).running
    if running is not None:
        running.job.wait()
    hand.step(3)


def codes(hand):
    return [finding.code for finding in hand.state.of(Linting).checked.findings]


def row_of(hand, code):
    return f"finding {codes(hand).index(code)}"


def marked(hand):
    """Return how many pixels of the view have the colour of marks."""
    pixels = hand.scene_picture()[..., :3].astype(int)
    return int((np.abs(pixels - PINK).max(axis=-1) <= 6).sum())


def test_menu_entry_opens_the_panel_and_checks(lint):
    hand = lint(LIGHT)
    assert hand.state.of(ShownPanels).opened == {"lint"}
    assert codes(hand) == ["W001"]
    assert hand.says("Checked: 0 errors, 1 warning, 0 notes")


def test_panel_is_closed_until_it_is_asked_for_and_checks_when_first_shown(drive):
    hand = drive(scene=scene_of(LIGHT), size=SIZE, samples=1)
    assert (
        imgui.internal.find_window_by_name("Lint") is None
        and hand.state.of(Linting).checked is None
    )
    hand.menu("menu Window", "Lint")
    finish(hand)
    assert codes(hand) == ["W001"]
    first = hand.state.of(Linting).checked
    hand.menu("menu Window", "Lint")
    assert not hand.state.of(ShownPanels).opened and "Recheck" not in hand.state.item_rects
    hand.menu("menu Window", "Lint")
    finish(hand)
    assert hand.state.of(Linting).checked is first  # only the first time by itself


def test_reset_layout_closes_it(lint):
    hand = lint(LIGHT)
    hand.menu("menu Window", "Reset layout")
    hand.step(3)
    assert not hand.state.of(ShownPanels).opened and "Recheck" not in hand.state.item_rects


def test_worst_comes_first_and_all_words_are_there(lint, texts):
    hand = lint(several())
    findings = hand.state.of(Linting).checked.findings
    assert findings[0].severity == "error" and findings[0].code == "B006"
    order = [finding.severity for finding in findings]
    assert order == sorted(order, key=["error", "warning", "note"].index)
    texts.clear()
    hand.step()
    for finding in findings:
        assert finding.title in texts and finding.message in texts


def test_severities_and_words_filter_the_list(lint):
    hand = lint(several())
    kinds = {finding.severity for finding in hand.state.of(Linting).checked.findings}
    assert {"error", "warning"} <= kinds
    count = len(codes(hand))
    hand.click("lint warning")
    listed = [name for name in hand.state.item_rects if name.startswith("finding ")]
    assert 0 < len(listed) < count
    hand.click("lint warning")
    hand.click("Filter findings")
    hand.type("w002")
    listed = [name for name in hand.state.item_rects if name.startswith("finding ")]
    assert listed == [row_of(hand, "W002")]


def test_filter_without_a_match_says_so(lint, texts):
    hand = lint(LIGHT)
    hand.state.of(Linting).text = "zebra"
    hand.step(2)
    assert "no finding matches" in texts


def test_sound_figure_has_nothing(lint, texts):
    hand = lint(column())
    assert codes(hand) == [] and "no findings" in texts
    hand.click("Copy text")
    assert not hand.says("copied")


def test_click_marks_the_vertex_and_aims_there(lint):
    hand = lint(LIGHT)
    assert marked(hand) == 0
    hand.click(row_of(hand, "W001"))
    assert hand.state.camera.target == pytest.approx([-0.9, 0.9, 0.9])
    assert hand.state.of(Linting).marks.points == pytest.approx(np.array([[-0.9, 0.9, 0.9]]))
    picture = hand.scene_picture()
    height, width = picture.shape[:2]
    middle = picture[height // 2, width // 2, :3].astype(int)
    assert np.abs(middle - PINK).max() <= 6
    assert marked(hand) > 20


def test_mark_follows_the_pose(lint):
    hand = lint(LIGHT)
    hand.click(row_of(hand, "W001"))
    before = hand.state.of(Linting).marks.points[0].copy()
    hand.state.actor.pose.dofs[0] = 1.5  # the root, along x
    hand.step(2)
    # The vertex weighs 0.9.
    assert hand.state.of(Linting).marks.points[0] - before == pytest.approx([1.35, 0.0, 0.0])


@pytest.mark.parametrize("end", ["same row", "escape"])
def test_marks_end_with_the_row_or_escape(lint, end):
    hand = lint(LIGHT)
    hand.click(row_of(hand, "W001"))
    assert marked(hand)
    if end == "escape":
        hand.key("escape")
    else:
        hand.click(row_of(hand, "W001"))
    hand.step(2)
    assert hand.state.of(Linting).chosen == -1 and not marked(hand)


def test_another_row_takes_the_marks_over(lint):
    hand = lint(several())
    hand.click(row_of(hand, "W002"))
    (first,) = hand.state.of(Linting).marks.points.tolist()[:1]
    hand.click(row_of(hand, "B006"))
    assert hand.state.of(Linting).chosen == 0
    assert hand.state.of(Linting).marks.points.tolist() != [first]


def test_finding_of_a_joint_selects_it(lint):
    hand = lint(several())
    hand.click(row_of(hand, "B006"))
    assert hand.state.selected_joint == 1
    assert hand.state.of(Linting).marks.points.tolist() == [[0.0, 2.0, 0.0]]


def test_flipped_triangle_has_its_edges_marked(lint):
    figure = column()
    triangles = figure.mesh.triangles.copy()
    triangles[3] = triangles[3][::-1]
    hand = lint(replace(figure, mesh=replace(figure.mesh, triangles=triangles)))
    hand.click(row_of(hand, "M002"))
    corners = hand.state.of(Linting).marks.lines[:, 0]
    expected = figure.mesh.positions[triangles[3]]
    assert len(corners) == 3
    assert sorted(map(tuple, corners.round(6))) == sorted(map(tuple, expected))


def test_finding_of_another_actor_chooses_it(lint):
    scene = Scene([Actor(column()), Actor(LIGHT)])
    scene.actors[1].placement[:3, 3] = 10.0, 0.0, 0.0
    hand = lint(scene)
    assert hand.state.chosen_actor == 0
    hand.click(row_of(hand, "W001"))
    assert hand.state.chosen_actor == 1
    assert hand.state.camera.target == pytest.approx([9.1, 0.9, 0.9])


def jump() -> Scene:
    """Return a column that is 40 m away for one frame, file frame 130."""
    figure = column()
    clip = standing(figure)
    places = np.zeros((FRAMES, figure.skeleton.n_joints, 3))
    places[30, 0, 0] = 40.0
    return scene_of(figure, replace(clip, translations=places))


def test_finding_of_a_clip_goes_to_its_time(lint):
    hand = lint(jump())
    hand.state.clock.playing = True
    hand.click(row_of(hand, "C003"))
    finding = hand.state.of(Linting).checked.findings[codes(hand).index("C003")]
    assert not hand.state.clock.playing
    assert hand.state.clock.time == pytest.approx(finding.times[0])
    assert finding.times[0] == pytest.approx(30 / RATE)
    # The camera is where the figure is at that time, not where it was.
    assert hand.state.camera.target[0] == pytest.approx(40.0)
    assert not hand.state.history.can_undo


def test_captured_points_are_marked(lint):
    figure, clip = keypoints()
    points = clip.points.copy()
    points[40:, 2, 3] = 0.1  # the ankle
    hand = lint(scene_of(figure, replace(clip, points=points)))
    hand.click(row_of(hand, "C011"))
    assert hand.state.clock.time >= 40 / RATE - 1e-9
    assert hand.state.of(Linting).marks.points.tolist() == [[0.0, 0.0, 0.0]]


def test_camera_turns_to_the_side_that_faces_it(lint):
    hand = lint(LIGHT)
    camera = hand.state.camera
    camera.azimuth, camera.inclination = 135.0, 0.0  # from behind, +x and -z
    hand.click(row_of(hand, "W001"))
    normal = hand.state.actor.figure.mesh.normals[5]
    assert float(camera_axes(camera)[2] @ normal) > 0.8
    before = camera.azimuth
    hand.click(row_of(hand, "W001"))
    camera.azimuth = before + 40.0  # still from its side: the direction stays
    hand.click(row_of(hand, "W001"))
    assert camera.azimuth == before + 40.0


def stale(hand, texts):
    texts.clear()
    hand.step(2)
    return any(text.startswith("The figure, pose or limits have changed") for text in texts)


def test_findings_are_stale_while_the_pose_is_another(lint, texts):
    hand = lint(LIGHT)
    assert not stale(hand, texts)
    hand.state.actor.pose.dofs[4] = 0.3
    hand.step()
    assert stale(hand, texts)
    hand.key("z", "ctrl")
    assert not stale(hand, texts)


def test_time_makes_nothing_stale_but_posing_does(lint, texts):
    hand = lint(jump())
    hand.state.clock.playing = True
    hand.step(20)
    hand.state.clock.playing = False
    assert not stale(hand, texts)
    hand.click(row_of(hand, "C003"))
    assert not stale(hand, texts)
    hand.state.actor.pose.dofs[4] = 0.3
    assert stale(hand, texts)
    hand.click("Recheck")
    finish(hand)
    assert not stale(hand, texts)


def test_recheck_sees_the_pose_and_other_limits(lint, texts):
    hand = lint(column())
    assert codes(hand) == []
    hand.state.of(Linting).options = replace(hand.state.of(Linting).options, max_rotation=1.0)
    assert stale(hand, texts)
    hand.state.actor.pose.dofs[4] = 3.5  # its limits are -3 and 3
    hand.click("Recheck")
    finish(hand)
    assert codes(hand) == ["S004"] and not stale(hand, texts)


def test_limits_are_set_in_their_window(lint):
    hand = lint(column())
    hand.click("Limits…")
    hand.step(2)
    hand.enter_value("Largest rotation", "180")
    assert hand.state.of(Linting).options.max_rotation == pytest.approx(np.pi)
    hand.enter_value("Low confidence", "0.5")
    assert hand.state.of(Linting).options.confidence == pytest.approx(0.5)
    hand.enter_value("Largest speed", "2.5")
    assert hand.state.of(Linting).options.max_speed == pytest.approx(2.5)
    hand.enter_value("Largest speed", "0")
    assert hand.state.of(Linting).options.max_speed is None
    for text in ("nan", "-5", "1e39"):
        hand.enter_value("Largest rotation", text)
        assert 0.0 <= hand.state.of(Linting).options.max_rotation < np.inf
    hand.click("Default limits")
    assert hand.state.of(Linting).options == type(hand.state.of(Linting).options)()


def test_all_are_copied_as_text_and_json(lint, monkeypatch):
    hand = lint(LIGHT)
    copied = []
    monkeypatch.setattr(imgui, "set_clipboard_text", copied.append)
    hand.click("Copy text")
    lines = copied[-1].splitlines()
    assert lines[0] == (
        "column: warning W001: weights of 1 vertex do not sum to 1 (worst: 0.9 at "
        "vertex 5, an error of 0.1)"
    )
    assert lines[1] == f"    {CODES['W001'].title}: {CODES['W001'].hint}"
    assert lines[-1] == "0 errors, 1 warning, 0 notes"
    hand.click("Copy JSON")
    scene = scene_of(LIGHT)
    assert json.loads(copied[-1]) == describe(lint_scene(scene), scene)
    assert hand.says("1 finding copied as JSON")


def test_another_scene_has_not_been_checked(lint, rig, texts):
    hand = lint(LIGHT)
    hand.click(row_of(hand, "W001"))
    hand.open(*rig)
    texts.clear()
    hand.step(2)
    assert hand.state.of(Linting).checked is None and hand.state.of(Linting).marks is None
    assert "This scene has not been checked yet." in texts
    assert not marked(hand)
    hand.click("Check")
    finish(hand)
    assert hand.state.of(Linting).checked.source is hand.state.scene


def test_marks_go_with_the_figure_they_are_on(lint, texts):
    hand = lint(LIGHT)
    hand.click(row_of(hand, "W001"))
    hand.state.scene.actors[0] = Actor(column())
    assert stale(hand, texts)
    assert hand.state.of(Linting).marks is None and not marked(hand)


def test_posing_while_it_checks_changes_nothing_of_it(drive, monkeypatch):
    hand = drive(scene=scene_of(column()), size=SIZE, samples=1)
    started, seen, is_held = hold_checks(monkeypatch)
    check_rig(hand.state)
    assert is_held.wait(30)
    hand.step(2)
    assert hand.state.job is not None and hand.state.job.progress == (3, 8)
    hand.state.actor.pose.dofs[4] = 3.5
    hand.step()
    started.set()
    finish(hand)
    assert seen and hand.state.of(Linting).checked.findings == ()
    assert hand.state.of(Linting).checked.scene.actors[0].pose.dofs[4] == 0.0


def hold_checks(monkeypatch):
    """Let checks wait after their third step for an event; return it, what came after, and when."""
    import threading

    go, seen, is_held = threading.Event(), [], threading.Event()

    def held(scene, options, report):
        report(3, 8, "column: mesh")
        is_held.set()
        go.wait(30)
        report(4, 8, "column: symmetry")
        seen.append(scene)
        return lint_scene(scene, options)

    monkeypatch.setattr("viewer.lint._again.lint_scene", held)
    return go, seen, is_held


@pytest.mark.parametrize("how", ["Cancel check", "escape"])
def test_check_is_cancelled_between_steps(drive, monkeypatch, how):
    hand = drive(scene=scene_of(LIGHT), size=SIZE, samples=1)
    go, seen, is_held = hold_checks(monkeypatch)
    check_rig(hand.state)
    assert is_held.wait(30)
    hand.step(3)
    running = hand.state.of(Linting).running
    if how == "escape":
        hand.key("escape")
    else:
        hand.click(how)
    hand.step(3)
    assert hand.state.job is None and hand.state.of(Linting).running is None
    go.set()
    running.job.wait()
    hand.step(2)
    assert not seen and hand.state.of(Linting).checked is None
    assert hand.says("Cancelled")


def test_check_waits_for_other_work(lint, monkeypatch):
    hand = lint(LIGHT)
    go, _, is_held = hold_checks(monkeypatch)
    first = hand.state.of(Linting).checked
    start_check(hand.state)
    assert is_held.wait(30)
    hand.step(2)
    job = hand.state.job
    hand.click("Recheck")  # greyed out
    assert hand.state.job is job
    go.set()
    finish(hand)
    assert hand.state.of(Linting).checked is not first


def test_too_many_marks_are_cut_and_said():
    rng = np.random.default_rng(0)
    places = Places(vertices=rng.normal(size=(4000, 3)), triangles=rng.normal(size=(1500, 3, 3)))
    marks, note = marks_of(places)
    assert note == (
        "the worst 3,000 of 4,000 vertices are marked; "
        "the worst 1,000 of 1,500 triangles are marked"
    )
    assert len(marks.points) == 3000 and marks.lines.shape == (3000, 2, 3)
    np.testing.assert_array_equal(marks.points, places.vertices[:3000])


def test_what_is_not_finite_is_not_marked():
    vertices = np.array([[0.0, 0, 0], [np.nan, 0, 0], [1.0, np.inf, 0]])
    marks, note = marks_of(Places(vertices=vertices))
    assert marks.points.tolist() == [[0.0, 0.0, 0.0]]
    assert note == "the worst 1 of 3 vertices are marked"
