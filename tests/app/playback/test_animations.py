"""Animations of a file in the window, chosen by list, key or palette, and undo of the choice."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from app.core.test_view_fit import reach
from app.curves.plotted import _pick
from numpy.testing import assert_allclose, assert_array_equal
from rigs.animated import animated_leg, animation, bow, channel, clip_of, leg, wave

from viewer.app.core.undo_actions import redo, undo
from viewer.app.features import entries
from viewer.app.playback.animations import choose_animation, played
from viewer.diagnostics import Diagnostic
from viewer.errors import FormatError
from viewer.loading import Contents, begin
from viewer.rigs.figure import figure_pose, read_from
from viewer.rigs.motion.transform_clip import Animation
from viewer.rigs.scene import Actor, Scene

SIZE = (1180, 760)


def scene_of(*figures) -> Scene:
    path = Path("hero.glb")
    return begin(Contents(figures=[(path, read_from(path, figure)) for figure in figures]))[0]


@pytest.fixture
def hand(drive):
    hat = replace(leg(name="hat"), animations=(animation(bow()),))
    return drive(scene=scene_of(animated_leg(), hat), size=SIZE)


def names(hand) -> list[str | None]:
    return [None if a.clip is None else a.clip.name for a in hand.state.scene.actors]


def test_first_animation_is_shown_with_its_own_time_range(hand):
    assert names(hand) == ["wave", None]
    assert hand.state.clock.whole == (0.5, 2.5) and hand.state.clock.time == 0.5
    assert hand.state.clock.frame_rate == 30.0


def test_the_list_switches_all_figures_of_the_file(hand):
    _pick(hand, "Animation", 2)
    assert names(hand) == ["bow", "bow"]
    assert hand.state.clock.whole == (0.0, pytest.approx(5 / 24)) and hand.state.clock.time == 0.0
    # Frames are counted at the rate of the current animation's keys.
    assert hand.state.clock.frame_rate == 24.0
    actor = hand.state.actor
    assert_array_equal(actor.pose.scales, figure_pose(actor.figure).scales)
    undo(hand.state)
    hand.step(2)
    assert names(hand) == ["wave", None] and hand.state.clock.time == 0.5
    assert [played(a) for a in hand.state.scene.actors] == [0, -1]
    redo(hand.state)
    hand.step(2)
    assert names(hand) == ["bow", "bow"] and [a.animation for a in hand.state.scene.actors] == [
        1,
        0,
    ]


def test_timeline_offers_the_animations_when_none_plays(hand):
    _pick(hand, "Animation", 0)
    assert names(hand) == [None, None] and not hand.state.clock.has_motion
    assert_array_equal(hand.state.actor.pose.dofs, figure_pose(hand.state.actor.figure).dofs)
    _pick(hand, "Animation", 1)
    assert names(hand) == ["wave", None] and hand.state.clock.has_motion


def test_keys_step_through_the_animations(hand):
    for key, wanted in (("right_bracket", "bow"), ("right_bracket", "wave"),
                        ("left_bracket", "bow")):  # fmt: skip
        hand.key(key)
        hand.step(2)
        assert names(hand)[0] == wanted
    assert hand.says("Animation: bow")


def test_the_palette_plays_animations_by_name(hand):
    found = {entry.text: entry for entry in entries(hand.state) if entry.kind == "animation"}
    assert [*found] == ["Play animation: wave", "Play animation: bow", "Play no animation"]
    found["Play animation: bow"].run(hand.state)
    assert names(hand) == ["bow", "bow"]


def test_edited_keys_stay_when_another_animation_plays(hand):
    actor = hand.state.actor
    edited = replace(actor.clip, end=2.0)
    actor.clip = edited
    hand.step(2)
    choose_animation(hand.state, 1)
    hand.step(2)
    assert actor.clip is actor.figure.animations[1].clip()
    choose_animation(hand.state, 0)
    hand.step(2)
    assert actor.clip is edited
    for _ in range(3):  # back to the edit, then to the state before it
        undo(hand.state)
        hand.step(2)
    assert actor.clip is actor.figure.animations[0].clip()
    choose_animation(hand.state, 1)
    hand.step(2)
    choose_animation(hand.state, 0)
    assert actor.clip is actor.figure.animations[0].clip()


def test_invalid_keys_are_reported_without_changes(drive, tmp_path):
    def refuse():
        raise FormatError(
            Diagnostic("F002.misfit: {message}", tmp_path, values={"message": "bad keys"})
        )

    figure = leg(animations=(animation(wave()), Animation("bad", 0.0, 1.0, refuse)))
    hand = drive(scene=scene_of(figure), size=SIZE)
    hand.key("right_bracket")
    assert "bad keys" in hand.state.error and names(hand) == ["wave"]


def test_another_motion_is_listed_by_its_name(drive):
    actor = Actor(animated_leg(), clip=replace(bow(), name="other"))
    hand = drive(scene=Scene([actor]), size=SIZE)
    hand.key("right_bracket")
    assert actor.clip.name == "wave"
    assert_allclose(actor.pose.shape_weights, [0.0, 0.5])
    assert np.isfinite(actor.pose.dofs).all()


@pytest.fixture
def walker(drive):
    """A test driver on a leg that can wave, or travel by 20 m, with a camera fitted to it."""
    travel = clip_of(
        channel(0, "translation", [0.0, 1.0], [[0.0, 0, 0], [20, 0, 0]]), name="travel"
    )
    figure = animated_leg(wave(), travel)
    hand = drive(scene=scene_of(figure), size=SIZE)
    hand.state.framing.restart()
    hand.step(5)
    return hand


def test_camera_is_fitted_to_another_animation(walker):
    near = walker.state.camera.distance
    choose_animation(walker.state, 1)
    walker.step(5)
    walker.state.clock.seek(1.0)
    walker.step(2)
    assert reach(walker).max() < 1.0  # in view at the far end
    choose_animation(walker.state, 0)
    walker.step(5)
    assert walker.state.camera.distance == pytest.approx(near)


def test_moved_camera_stays_when_another_animation_is_chosen(walker):
    walker.state.camera.distance = 7.0
    walker.step(2)
    choose_animation(walker.state, 1)
    walker.step(5)
    assert walker.state.camera.distance == 7.0


def test_camera_stays_after_an_edited_motion(walker):
    walker.state.actor.offset = 0.5
    walker.step(5)
    distance = walker.state.camera.distance
    choose_animation(walker.state, 1)
    walker.step(5)
    assert walker.state.camera.distance == distance
