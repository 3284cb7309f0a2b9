"""Choice of an animation by name or number, and its initial pose."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from rig.animated import animated_leg, animation, bow, channel, clip_of, wave

from viewer.errors import FormatError, RigError
from viewer.rig.motion.animation_choice import (
    animation_labels,
    chosen_animation,
    counterpart,
    play_animation,
)
from viewer.rig.motion.evaluation import pose_actors
from viewer.rig.motion.transform_clip import Animation
from viewer.rig.scene import Actor, figure_pose


def test_animation_is_chosen_by_name_number_or_none():
    figure = animated_leg(wave(), bow(), replace(bow(), name="2"))
    one, two, three = figure.animations
    for text, wanted in {
        "": one, "wave": one, "WAVE": one, "Bow": two, "1": one, "2": three, "3": three,
        "none": None, "None": None,
    }.items():  # fmt: skip
        assert chosen_animation([figure], text) is wanted, text
    assert chosen_animation([], "") is None


@pytest.mark.parametrize("text", ["wavy", "0", "4", "-1"])
def test_unknown_name_is_refused_with_the_nearest_names(text):
    figure = animated_leg(wave(), bow())
    with pytest.raises(RigError) as refused:
        chosen_animation([figure], text)
    found = refused.value.diagnostic
    assert found.key == "F004.animation" and found.values["name"] == text
    assert ("wave" in found.values["hint"]) and (
        ("bow" in found.values["hint"]) == (text != "wavy")
    )


def test_labels_distinguish_equal_and_empty_names():
    figure = animated_leg(wave(), replace(bow(), name=""), wave())
    assert animation_labels(figure) == ("wave", "animation 2", "wave (2)")
    assert chosen_animation([figure], "Wave (2)") is figure.animations[2]
    assert chosen_animation([figure], "animation 2") is figure.animations[1]


def test_figures_of_a_file_play_the_same_animation():
    short = clip_of(channel(0, "scale", [0.0, 1.0], np.ones((2, 3))), name="wave")
    hero, hat = animated_leg(wave(), bow(), short), animated_leg(short)
    # The second figure has only the shorter of the two waves, and no bow.
    assert [counterpart(hat, one) for one in hero.animations] == [0, -1, 0]
    assert [counterpart(hero, one) for one in hat.animations] == [2]
    # Numbers refer to the animations of the figure that has the most.
    assert chosen_animation([hat, hero], "2") is hero.animations[1]


def test_values_not_animated_by_the_next_animation_are_reset_to_the_file():
    figure = animated_leg(wave(), bow())
    actor = Actor(figure)
    play_animation(actor, 0)
    actor.pose.figure_translation[:] = 1.0, 2.0, 3.0
    pose_actors([actor], 2.0)
    assert actor.pose.shape_weights[0] == 1.0 and actor.pose.scales[1, 1] == 2.5
    play_animation(actor, 1)
    pose_actors([actor], 0.0)
    assert_array_equal(actor.pose.scales, figure.skeleton.rest_scales)
    assert_array_equal(actor.pose.translations, np.zeros((3, 3)))
    assert_array_equal(actor.pose.dofs, figure_pose(figure).dofs)
    assert_array_equal(actor.pose.shape_weights, [0.0, 0.0])
    assert_array_equal(actor.pose.figure_translation, [1.0, 2.0, 3.0])
    play_animation(actor, -1)
    assert actor.clip is None and actor.animation == -1


def test_invalid_keys_leave_the_actor_unchanged(tmp_path):
    from viewer.diagnostics import Diagnostic

    def refuse():
        raise FormatError(Diagnostic("F002.misfit: {message}", tmp_path, values={"message": "bad"}))

    figure = replace(animated_leg(), animations=(animation(wave()), Animation("bad", 0, 1, refuse)))
    actor = Actor(figure)
    play_animation(actor, 0)
    clip = actor.clip
    with pytest.raises(FormatError):
        play_animation(actor, 1)
    assert actor.clip is clip and actor.animation == 0
