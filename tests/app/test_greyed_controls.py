"""Greyed controls and the reasons in their tooltips, for which the window wakes up."""

from dataclasses import replace

import pytest
from app.captured import dots, people
from imgui_bundle import imgui

from viewer.app.core import reasons
from viewer.app.core.jobs import Job
from viewer.app.layout import ShownPanels
from viewer.app.window import awaits_tooltip
from viewer.rig.scene import Scene

NOTHING_MOVES = "no motion: open a clip, a capture or a BVH"


@pytest.fixture
def tooltips(monkeypatch):
    """Tooltip texts."""
    said = []

    def record(text):
        said.append(text)

    monkeypatch.setattr(imgui, "set_tooltip", record)
    return said


def rest(hand, label):
    """Rest the mouse on a widget until its tooltip appears."""
    hand.move(hand.place(label))
    hand.step(40)


@pytest.mark.parametrize(
    ("title", "why"),
    [
        ("Timeline", NOTHING_MOVES),
        ("Curves", NOTHING_MOVES),
        (
            "Actors",
            "one figure and no motion: open several figures together, or a motion",
        ),
        ("Shape", "this figure has no blend shapes"),
        ("Hands", "this figure has no hands"),
    ],
)
def test_inapplicable_panels_are_greyed(hand, tooltips, title, why):
    hand.menu("menu Window", title)
    assert hand.state.of(ShownPanels).closed == set()
    if title not in hand.state.item_rects:
        hand.click("menu Window")
    rest(hand, title)
    assert tooltips[-1] == why


def test_space_key_without_motion_shows_the_reason(hand):
    hand.key("space")
    assert not hand.state.clock.playing and hand.says(NOTHING_MOVES)


def test_motion_controls_are_enabled_with_a_motion(drive, rig, tooltips):
    hand = drive(scene=people(rig, [True] * 9), size=(1280, 800), samples=1)
    rest(hand, "Play")
    assert tooltips[-1] == "play or pause (Space)"
    hand.click("Play")
    assert hand.state.clock.playing


def test_controls_in_a_disabled_block_show_its_reason(hand, tooltips):
    hand.show_panel("Weights")
    rest(hand, "Automatic")
    assert tooltips[-1] == "the heat map is off"


def test_gaps_can_be_filled_if_present(drive, rig):
    hand = drive(scene=people(rig, [True, False, True]), size=(1280, 800), samples=1)
    hand.click("Interpolate gaps")
    assert hand.state.clock.interpolate_gaps


def test_gap_filling_is_greyed_without_gaps(drive, rig, tooltips):
    scene = people(rig, [True] * 9)
    clip = scene.actors[0].clip
    # Frames before the first and after the last frame of a person are not gaps.
    scene.actors[0].clip = replace(clip, timing=replace(clip.timing, holds=True))
    hand = drive(scene=scene, size=(1280, 800), samples=1)
    hand.click("Interpolate gaps")
    assert not hand.state.clock.interpolate_gaps
    rest(hand, "Interpolate gaps")
    assert tooltips[-1].endswith("no motion has missing frames")


def test_undo_with_nothing_to_undo_is_greyed(hand, tooltips):
    hand.click("menu Edit")
    rest(hand, "Undo")
    assert tooltips[-1] == "nothing to undo"
    hand.key("escape")
    hand.drag("arm.x", 0.9)
    assert reasons.no_undo(hand.state) == ""
    assert reasons.no_redo(hand.state) == "nothing to redo"


def test_menu_of_a_figure_without_joints_is_greyed(drive, tooltips):
    hand = drive(scene=Scene([dots([1, 1, 1, 1])]), samples=1)
    hand.click("menu Edit")
    for label in ("Mirror pose", "Copy pose", "Paste pose", "New clip"):
        rest(hand, label)
        assert tooltips[-1] == "a set of captured points has no joints to pose"
    hand.key("escape")
    hand.click("menu File")
    rest(hand, "Export motion…")
    assert tooltips[-1] == "only captured points move; there are no joints to export"


def test_inapplicable_display_modes_are_greyed(drive, tooltips):
    hand = drive(scene=Scene([dots([1, 1, 1, 1])]), size=(1000, 1000), samples=1)
    before = hand.state.options.show
    for label, why in (
        ("Attached skin", "there is no mesh"),
        ("Skeleton", "there is no skeleton"),
        ("Skin in bind pose", "there is no skin attached to a skeleton"),
        ("Wireframe", "there is no mesh"),
    ):
        hand.click(label)
        rest(hand, label)
        assert tooltips[-1] == why
    assert hand.state.options.show == before and not hand.state.options.wireframe


def test_texture_is_greyed_without_a_texture(hand, tooltips):
    hand.click("Texture")
    rest(hand, "Texture")
    assert hand.state.options.texture
    assert tooltips[-1] == "no figure in the scene has a texture: drop a picture on the window"


def test_texture_can_be_toggled_if_present(drive):
    fox = drive(size=(1000, 1000))
    fox.click("Texture")
    assert not fox.state.options.texture and fox.undo_steps == 1
    fox.click("Texture")
    assert fox.state.options.texture


def test_recording_waits_for_other_work(hand, tooltips):
    hand.state.job = Job("Writing walk.bvh")
    hand.click("menu File")
    rest(hand, "Record pictures or video…")
    assert tooltips[-1] == "wait for: Writing walk.bvh"
    hand.state.job = None


def test_window_keeps_drawing_until_a_tooltip_is_due(drive, rig):
    hand = drive(scene=people(rig, [True] * 9), size=(1280, 800), samples=1)
    context = hand.app._imgui
    hand.move(hand.middle)
    hand.step(40)
    assert not awaits_tooltip(context)
    hand.move("Play")
    hand.step(3)
    assert awaits_tooltip(context)
    hand.step(40)
    assert not awaits_tooltip(context)
