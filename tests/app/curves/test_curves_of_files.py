"""The Curves panel: keys of whole poses, opened files, and motions without keys."""

import numpy as np
import pytest
from app.curves.plotted import ARM_X, SIZE, _arm, _center, _clip, _pick, _type_into, clip_text
from app.test_panel_pictures import _compare
from imgui_bundle import imgui
from numpy.testing import assert_array_equal

import viewer
from viewer.app.curves.editing import Curves
from viewer.app.files.files import Files
from viewer.formats import Source, read
from viewer.rigs.captures.points import PointClip, PointLayout
from viewer.rigs.figure import Figure
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.scene import Actor, Scene

# Keys of whole poses, and files


def test_key_pose_and_key_changes_add_the_expected_keys(curves):
    curves.state.clock.seek(0.5)
    curves.step(2)
    curves.state.actor.pose.dofs[curves.dof_index("arm.y")] = 0.75
    curves.step(2)
    curves.click("Key changes")
    assert _clip(curves).channels[ARM_X + 1].times.tolist() == [0.0, 0.5]
    assert len(_arm(curves).times) == 3
    curves.step(2)
    assert curves.dof("arm.y") == 0.75
    curves.click("Key pose")
    assert all(0.5 in channel.times for channel in _clip(curves).channels)
    assert curves.dof("arm.y") == 0.75


def test_new_clip_adds_keys_to_a_static_figure(drive, rig):
    hand = drive(*rig, size=SIZE, samples=1)
    assert "curves" not in hand.state.item_rects and hand.state.actor.clip is None
    before = hand.dofs()
    hand.menu("menu Edit", "New clip")
    assert [len(channel.times) for channel in _clip(hand).channels] == [1] * 9
    assert (_clip(hand).start, _clip(hand).end) == (0.0, 2.0)
    hand.step(3)
    assert_array_equal(hand.dofs(), before)
    hand.show_panel("Curves")
    assert "plot" in hand.state.item_rects
    hand.key("z", "ctrl")
    hand.step(2)
    assert hand.state.actor.clip is None


def test_edited_clip_is_saved_and_read_back(curves, tmp_path):
    curves.click(_center(curves, "key arm.x 1"))
    curves.click("Delete")
    curves.click("Save clip…")
    curves.step(3)
    assert curves.state.of(Files).dialog.name == "tiny_edited.anim"
    curves.click("Save###Save")
    curves.step(3)
    saved = read(Source.open(tmp_path / "tiny_edited.anim"))
    assert saved.channels[ARM_X].times.tolist() == [0, 2]
    assert saved.channels[ARM_X].extrapolation == ("cycle", "cycle")
    assert curves.says("Saved")


def test_opened_clip_is_never_replaced(curves, tmp_path):
    from viewer.app.curves.editing import save_clip

    save_clip(curves.state, tmp_path / "wave.anim")
    assert "input files are never overwritten" in curves.state.error
    assert (tmp_path / "wave.anim").read_text() == clip_text()


def test_keys_are_unchanged_while_typing(curves):
    curves.click(_center(curves, "key arm.x 1"))
    curves.click("Curve filter")
    curves.type("arm")
    curves.key("delete")
    curves.key("insert")
    curves.step(2)
    assert len(_arm(curves).times) == 3


# Motions without keys


def _sampled(rig):
    scene = viewer.load(*rig)
    angles = np.linspace(0, 6.0, 31)
    turns = np.zeros((31, 2, 4))
    turns[:, :, 3] = 1.0
    turns[:, 1, 0], turns[:, 1, 3] = np.sin(angles / 2), np.cos(angles / 2)
    rows = np.arange(31)
    rows[10:13] = -1
    scene.actors[0].clip = SampledClip("turn", Timing(15.0, rows), turns)
    return scene


def test_frames_are_shown_read_only(drive, rig):
    hand = drive(scene=_sampled(rig), size=SIZE, samples=1)
    hand.show_panel("Curves")
    hand.state.selected_joint = 1
    hand.step(3)
    clip = _clip(hand)
    assert hand.state.of(Curves).rows == (6, 7, 8)
    assert not {"Add key", "Key pose", "Before"} & set(hand.state.item_rects)
    x0, y0, x1, y1 = hand.state.item_rects["plot"]
    hand.double_click(((x0 + x1) / 2, (y0 + y1) / 2))
    hand.key("insert")
    hand.key("delete")
    end = _center(hand, "range end")
    hand.pull(end, (end[0] - 90, end[1]))
    assert _clip(hand) is clip and hand.undo_steps == 0


def test_captured_points_have_curves(drive):
    layout = PointLayout("pair", ("left", "right"), np.array([[0, 1]]), np.array([1, -1]))
    points = np.zeros((20, 2, 4))
    points[..., 3] = 1.0
    points[:, 1, 0] = np.linspace(0, 1, 20)
    points[5:8, 1, 3] = 0.0
    actor = Actor(
        Figure("pair", points=layout), clip=PointClip("p", Timing(10.0, np.arange(20)), points)
    )
    hand = drive(scene=Scene([actor]), size=SIZE, samples=1)
    hand.show_panel("Curves")
    hand.step(3)
    assert hand.state.of(Curves).rows == (0, 1, 2)
    hand.click("curve right.x")
    hand.step(2)
    assert hand.state.of(Curves).rows == (3,) and not hand.state.error


def test_selection_resets_with_another_actor(drive, rig, tmp_path):
    (tmp_path / "wave.anim").write_text(clip_text())
    scene = viewer.load(*rig, tmp_path / "wave.anim")
    scene.actors += _sampled(rig).actors
    hand = drive(scene=scene, size=SIZE, samples=1)
    hand.show_panel("Curves")
    hand.step(2)
    hand.click("curve root.tx")
    hand.state.choose_actor(1)
    hand.step(3)
    assert hand.state.of(Curves).rows == (0, 1, 2)
    hand.state.choose_actor(0)
    hand.step(3)
    assert hand.state.of(Curves).rows == (0, 1, 2, 3, 4, 5)


def test_thousands_of_keys_are_drawn_but_cannot_be_dragged(curves):
    from viewer.rigs.motion.clip_edit import clip_from_frames

    times = np.linspace(0, 2, 4000)
    dofs = np.tile(curves.dofs(), (4000, 1))
    dofs[:, ARM_X] = np.sin(9 * times)
    curves.state.actor.clip = clip_from_frames("baked", dofs, times)
    curves.click("Fit")
    curves.step(3)
    assert not [label for label in curves.state.item_rects if label.startswith("key ")]
    x0, y0, x1, y1 = curves.state.item_rects["plot"]
    for _ in range(4):
        curves.wheel(9, ((x0 + x1) / 2, (y0 + y1) / 2))
    curves.step(2)
    shown = [label for label in curves.state.item_rects if label.startswith("key ")]
    assert len(shown) < 300
    curves.assert_sane()


def test_extreme_times_and_values_are_harmless(curves):
    curves.click(_center(curves, "key arm.x 1"))
    curves.step(2)
    _type_into(curves, "Value", "900000000")
    curves.click("Fit")
    for _ in range(3):
        curves.wheel(-9, "plot")
    curves.step(3)
    curves.assert_sane()
    assert curves.screen().any()


@pytest.mark.golden("app_curves")
def test_curves_panel_matches_golden_image(show_curves):
    curves = show_curves(pixels_per_point=1.0)
    curves.click("curves of arm")
    curves.state.clock.seek(0.5)
    curves.step(3)
    for _ in range(4):
        curves.wheel(-2, "plot")
    curves.click(_center(curves, "key arm.x 1"))
    _pick(curves, "After", 4)
    _pick(curves, "Out", 3)
    curves.state.messages.notes.clear()
    curves.move((5.0, 5.0))
    top = imgui.internal.find_window_by_name("Curves").pos.y
    _compare(curves.screen()[round(top) :], "curves")


def test_curves_window_appears_only_with_a_motion(drive, rig):
    hand = drive(*rig, size=SIZE, samples=1)
    window = imgui.internal.find_window_by_name("Curves")
    assert window is None or not window.active
    assert hand.state.actor.clip is None
