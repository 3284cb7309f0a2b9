"""The Lint panel: checks, the list of findings, jumps to findings, marks, and stale findings."""

import json
import os
import time
from dataclasses import replace

import numpy as np
import pytest
from imgui_bundle import imgui
from linting.planted import weighted
from linting.sound import FRAMES, RATE, column, keypoints, scene_of, standing
from linting.test_bad_keys import RATE as KEY_RATE
from linting.test_bad_keys import K, about_z, arm, waving
from linting.test_rechecks import TEXTS
from rigs.animated import animated_leg, bow, channel, clip_of

from viewer.app.closing import unsaved_edits
from viewer.app.layout import ShownPanels
from viewer.app.linting.lint_panel import Linting, check_rig, start_check
from viewer.app.linting.marks import marks_of
from viewer.cli import run
from viewer.linting import Places, describe, lint_scene
from viewer.loading import bundled_files
from viewer.progress import report
from viewer.rendering.camera import camera_axes
from viewer.rendering.overlay.annotation import MARK_COLOR
from viewer.rigs.figure import Figure
from viewer.rigs.motion.animation_choice import play_animation
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.motion.transform_clip import Animation, TransformChannel, TransformClip
from viewer.rigs.scene import Actor, Scene

PINK = np.array([round(255 * channel) for channel in MARK_COLOR])
SIZE = (1000, 700)


# Vertex 5 at (-1, 1, 1) is bound to the foot at the origin; joint 1 is the knee at y = 2. A weight
# of 0.9 moves the vertex to (-0.9, 0.9, 0.9).
LIGHT = weighted({5: [(0, 0.9)]})


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
    """Return the number of pixels in the view that have the colour of marks."""
    pixels = hand.scene_picture()[..., :3].astype(int)
    return int((np.abs(pixels - PINK).max(axis=-1) <= 6).sum())


def jump() -> Scene:
    """Return a column that is 40 m away in a single frame, frame 130 of the file."""
    figure = column()
    clip = standing(figure)
    places = np.zeros((FRAMES, figure.skeleton.n_joints, 3))
    places[30, 0, 0] = 40.0
    return scene_of(figure, replace(clip, translations=places))


@pytest.fixture
def lint(drive):
    """Open an app on a figure, scene or files with the Lint panel open and the check finished."""

    def open_panel(*shown, **settings):
        if shown and isinstance(shown[0], Figure | Scene):
            scene = shown[0] if isinstance(shown[0], Scene) else scene_of(shown[0])
            shown, settings = (), {"scene": scene, **settings}
        hand = drive(*shown, size=SIZE, samples=1, **settings)
        hand.menu("menu Edit", "Check the rig")
        finish(hand)
        return hand

    return open_panel


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


def test_menu_entry_opens_the_panel_and_checks(lint):
    hand = lint(LIGHT)
    assert hand.state.of(ShownPanels).opened == {"lint"}
    assert codes(hand) == ["W001"]
    assert hand.says("Checked: 0 errors, 1 warning, 0 notes")


def test_panel_starts_closed_and_checks_when_first_shown(drive):
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
    assert hand.state.of(Linting).checked is first  # only the first check is automatic


def test_reset_layout_closes_the_lint_panel(lint):
    hand = lint(LIGHT)
    hand.menu("menu Window", "Reset layout")
    hand.step(3)
    assert not hand.state.of(ShownPanels).opened and "Recheck" not in hand.state.item_rects


def test_worst_finding_is_first_with_its_full_message(lint, texts):
    hand = lint(several())
    findings = hand.state.of(Linting).checked.findings
    assert findings[0].severity == "error" and findings[0].code == "B006"
    order = [finding.severity for finding in findings]
    assert order == sorted(order, key=["error", "warning", "note"].index)
    texts.clear()
    hand.step()
    for finding in findings:
        assert finding.title in texts and finding.message in texts


def test_severities_and_text_filter_the_list(lint):
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


def test_filter_without_a_match_is_reported(lint, texts):
    hand = lint(LIGHT)
    hand.state.of(Linting).text = "zebra"
    hand.step(2)
    assert "no finding matches" in texts


def test_valid_figure_has_no_findings(lint, texts):
    hand = lint(column())
    assert codes(hand) == [] and "no findings" in texts
    hand.click("Copy text")
    assert not hand.says("copied")


def test_click_marks_the_vertex_and_aims_the_camera_at_it(lint):
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
    # The weights of the vertex sum to 0.9.
    assert hand.state.of(Linting).marks.points[0] - before == pytest.approx([1.35, 0.0, 0.0])


@pytest.mark.parametrize("end", ["same row", "escape"])
def test_marks_disappear_with_the_row_or_escape(lint, end):
    hand = lint(LIGHT)
    hand.click(row_of(hand, "W001"))
    assert marked(hand)
    if end == "escape":
        hand.key("escape")
    else:
        hand.click(row_of(hand, "W001"))
    hand.step(2)
    assert hand.state.of(Linting).chosen == -1 and not marked(hand)


def test_selecting_another_row_moves_the_marks(lint):
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


def test_finding_of_another_actor_activates_it(lint):
    scene = Scene([Actor(column()), Actor(LIGHT)])
    scene.actors[1].placement[:3, 3] = 10.0, 0.0, 0.0
    hand = lint(scene)
    assert hand.state.chosen_actor == 0
    hand.click(row_of(hand, "W001"))
    assert hand.state.chosen_actor == 1
    assert hand.state.camera.target == pytest.approx([9.1, 0.9, 0.9])


def test_finding_in_a_clip_jumps_to_its_time(lint):
    hand = lint(jump())
    hand.state.clock.playing = True
    hand.click(row_of(hand, "C003"))
    finding = hand.state.of(Linting).checked.findings[codes(hand).index("C003")]
    assert not hand.state.clock.playing
    assert hand.state.clock.time == pytest.approx(finding.times[0])
    assert finding.times[0] == pytest.approx(30 / RATE)
    # The camera is aimed at the position of the figure at that time.
    assert hand.state.camera.target[0] == pytest.approx(40.0)
    assert not hand.state.history.undone_next


def test_fix_is_one_step_of_undo_and_is_checked_again(lint):
    """The weight of 0.9 becomes 1: the vertex returns from (-0.9, 0.9, 0.9) to (-1, 1, 1)."""
    hand = lint(LIGHT)
    assert "W001" in codes(hand)
    hand.click("Fix")
    hand.state.job.wait()
    hand.step(3)
    finish(hand)
    assert "W001" not in codes(hand)
    skin = hand.state.scene.actors[0].figure.skin
    assert skin.weights[skin.starts[5]] == 1.0
    assert [edit.text for edit in unsaved_edits(hand.state)] == ["column: rig"]
    hand.key("z", "ctrl")
    hand.step(2)
    assert not unsaved_edits(hand.state)
    assert hand.state.scene.actors[0].figure is LIGHT
    assert not hand.state.history.undone_next


def grown() -> Scene:
    """Return an arm with keys of the scale of a joint, beside those of its elbow."""
    scales = TransformChannel(2, "scale", [0.0, 1.0], np.full((2, 3), 1.4))
    bends = TransformChannel(3, "rotation", K / KEY_RATE, about_z(waving()))
    return scene_of(arm(), TransformClip("x", (scales, bends), 0.0, 1.9))


def test_joints_are_at_rest_once_their_keys_are_deleted(lint):
    hand = lint(grown())
    assert "C023" in codes(hand)
    hand.click("Fix")
    hand.state.job.wait()
    hand.step(3)
    finish(hand)
    assert "C023" not in codes(hand)
    np.testing.assert_array_equal(hand.state.scene.actors[0].pose.scales, 1.0)


def test_scene_that_changes_while_it_is_fixed_stays_as_it_is(lint):
    hand = lint(LIGHT)
    hand.click("Fix")
    hand.state.job.wait()
    other = weighted({6: [(0, 0.9)]})
    hand.state.scene.actors[0].figure = other
    hand.step(3)
    assert hand.state.scene.actors[0].figure is other
    said = [note.text for note in hand.state.messages.notes]
    assert "Nothing was fixed: the scene changed meanwhile" in said


@pytest.mark.parametrize("played", [None, 0, 1])
def test_fixed_motion_is_unsaved_until_it_is_undone(lint, played):
    """A capture, an animation that plays, and one that does not."""
    bends = waving()
    bends[30] += 50.0
    turns = about_z(bends)
    if played is None:
        every = np.tile([0.0, 0.0, 0.0, 1.0], (len(K), 6, 1))
        every[:, 3] = turns
        clip = SampledClip("pop", Timing(KEY_RATE, K), every, np.zeros((len(K), 6, 3)))
        scene = Scene([Actor(arm(), clip=clip)])
    else:
        last = float(K[-1]) / KEY_RATE
        pop, still = (
            TransformClip(name, (TransformChannel(3, "rotation", K / KEY_RATE, values),), 0.0, last)
            for name, values in (("pop", turns), ("still", about_z(waving())))
        )
        animations = [Animation(one.name, 0.0, last, lambda one=one: one) for one in (pop, still)]
        scene = Scene([Actor(replace(arm(), animations=tuple(animations)))])
        play_animation(scene.actors[0], played)
    hand = lint(scene)
    assert "C020" in codes(hand) and not unsaved_edits(hand.state)
    hand.click("Fix")
    hand.state.job.wait()
    hand.step(3)
    finish(hand)
    wanted = "motion" if played is None else "keys of pop"
    name = scene.actors[0].name
    assert [edit.text for edit in unsaved_edits(hand.state)] == [f"{name}: {wanted}"]
    hand.key("z", "ctrl")
    hand.step(2)
    assert not unsaved_edits(hand.state)


def test_captured_points_are_marked(lint):
    figure, clip = keypoints()
    points = clip.points.copy()
    points[40:, 2, 3] = 0.1  # the ankle
    hand = lint(scene_of(figure, replace(clip, points=points)))
    hand.click(row_of(hand, "C011"))
    assert hand.state.clock.time >= 40 / RATE - 1e-9
    assert hand.state.of(Linting).marks.points.tolist() == [[0.0, 0.0, 0.0]]


def test_camera_orbits_to_the_side_that_the_triangle_faces(lint):
    hand = lint(LIGHT)
    camera = hand.state.camera
    camera.azimuth, camera.inclination = 135.0, 0.0  # from behind, between +x and -z
    hand.click(row_of(hand, "W001"))
    normal = hand.state.actor.figure.mesh.normals[5]
    assert float(camera_axes(camera)[2] @ normal) > 0.8
    before = camera.azimuth
    hand.click(row_of(hand, "W001"))
    camera.azimuth = before + 40.0  # still on the facing side, so the direction stays
    hand.click(row_of(hand, "W001"))
    assert camera.azimuth == before + 40.0


def test_limits_are_set_in_their_dialog(lint):
    hand = lint(column())
    hand.click("Limits…")
    hand.step(2)
    # The fields have room for their longest text.
    x0, _, x1, _ = hand.state.item_rects["Largest speed"]
    assert x1 - x0 > 10 * imgui.get_style().font_size_base
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


def test_all_findings_are_copied_as_text_and_json(lint, monkeypatch):
    hand = lint(LIGHT)
    copied = []
    monkeypatch.setattr(imgui, "set_clipboard_text", copied.append)
    hand.click("Copy text")
    lines = copied[-1].splitlines()
    assert lines[0] == (
        "column: warning W001: weights of 1 vertex do not sum to 1 (worst: 0.9 at "
        "vertex 5, an error of 0.1)"
    )
    assert lines[1] == (
        "    weights do not sum to 1; remedy: normalise them (Normalise weights in the Skinning "
        "panel shows the effect)"
    )
    assert lines[-1] == "0 errors, 1 warning, 0 notes"
    hand.click("Copy JSON")
    scene = scene_of(LIGHT)
    assert json.loads(copied[-1]) == describe(lint_scene(scene), scene)
    assert hand.says("1 finding copied as JSON")


def test_too_many_marks_are_truncated_with_a_note():
    rng = np.random.default_rng(0)
    places = Places(vertices=rng.normal(size=(4000, 3)), triangles=rng.normal(size=(1500, 3, 3)))
    marks, note = marks_of(places)
    assert note == (
        "the worst 3,000 of 4,000 vertices are marked; "
        "the worst 1,000 of 1,500 triangles are marked"
    )
    assert len(marks.points) == 3000 and marks.lines.shape == (3000, 2, 3)
    np.testing.assert_array_equal(marks.points, places.vertices[:3000])


def test_non_finite_positions_are_not_marked():
    vertices = np.array([[0.0, 0, 0], [np.nan, 0, 0], [1.0, np.inf, 0]])
    marks, note = marks_of(Places(vertices=vertices))
    assert marks.points.tolist() == [[0.0, 0.0, 0.0]]
    assert note == "the worst 1 of 3 vertices are marked"


@pytest.fixture
def files(tmp_path):
    for name, text in TEXTS.items():
        (tmp_path / name).write_text(text)
    return [tmp_path / name for name in TEXTS]


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


def stale(hand, texts):
    texts.clear()
    hand.step(2)
    return any(text.startswith("The figure, pose or limits have changed") for text in texts)


def test_findings_are_stale_while_the_pose_differs(lint, texts):
    hand = lint(LIGHT)
    assert not stale(hand, texts)
    hand.state.actor.pose.dofs[4] = 0.3
    hand.step()
    assert stale(hand, texts)
    hand.key("z", "ctrl")
    assert not stale(hand, texts)


def test_posing_makes_findings_stale_and_playback_does_not(lint, texts):
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


def test_a_finding_in_another_animation_plays_it(lint, texts):
    leap = clip_of(channel(0, "translation", [0.0, 1.0], [[0.0] * 3, [1000.0, 0, 0]]), name="leap")
    scene = scene_of(animated_leg(bow(), leap))
    play_animation(scene.actors[0], 0)
    hand = lint(scene)
    hand.click(row_of(hand, "C003"))
    assert hand.state.actor.clip is leap and not hand.state.clock.playing
    assert not stale(hand, texts)
    assert any(text.startswith("leap: ") for text in texts)


def test_recheck_uses_the_current_pose_and_limits(lint, texts):
    hand = lint(column())
    assert codes(hand) == []
    hand.state.of(Linting).options = replace(hand.state.of(Linting).options, max_rotation=1.0)
    assert stale(hand, texts)
    hand.state.actor.pose.dofs[4] = 3.5  # the limits of the DOF are -3 and 3
    hand.click("Recheck")
    finish(hand)
    assert codes(hand) == ["S004"] and not stale(hand, texts)


def test_new_scene_is_shown_as_unchecked(lint, rig, texts):
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


def test_marks_disappear_with_their_figure(lint, texts):
    hand = lint(LIGHT)
    hand.click(row_of(hand, "W001"))
    hand.state.scene.actors[0] = Actor(column())
    assert stale(hand, texts)
    assert hand.state.of(Linting).marks is None and not marked(hand)


def test_posing_during_a_check_does_not_affect_it(drive, monkeypatch):
    hand = drive(scene=scene_of(column()), size=SIZE, samples=1)
    started, seen, is_held = hold_checks(monkeypatch)
    check_rig(hand.state)
    assert is_held.wait(30)
    hand.step(2)
    assert hand.state.job is not None and hand.state.job.progress == (3, 8, "")
    hand.state.actor.pose.dofs[4] = 3.5
    hand.step()
    started.set()
    finish(hand)
    assert seen and hand.state.of(Linting).checked.findings == ()
    assert hand.state.of(Linting).checked.scene.actors[0].pose.dofs[4] == 0.0


def hold_checks(monkeypatch):
    """Block checks after three steps until an event is set; return it, later steps and times."""
    import threading

    go, seen, is_held = threading.Event(), [], threading.Event()

    def held(scene, options):
        report(3, 8, what="column: mesh")
        is_held.set()
        go.wait(30)
        report(4, 8, what="column: symmetry")
        seen.append(scene)
        return lint_scene(scene, options)

    monkeypatch.setattr("viewer.linting._files.lint_scene", held)
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
    assert running.job.is_cancelled and hand.says("Cancelled")
    go.set()
    hand.finish_job()
    assert hand.state.job is None and hand.state.of(Linting).running is None
    assert not seen and hand.state.of(Linting).checked is None


def test_check_waits_for_another_running_job(lint, monkeypatch):
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
