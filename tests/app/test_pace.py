"""The number of passes that the window draws in each frame, and fading of shadows."""

import numpy as np
import pytest

from viewer.app.pace import Pace
from viewer.rendering.options import DisplayOptions

DRAFT, FINAL = DisplayOptions(), DisplayOptions(quality="final", passes=4)


def test_draft_quality_is_drawn_once_for_each_change():
    pace = Pace()
    assert pace.step("a", DRAFT, 0.0) is not None
    assert pace.step("a", DRAFT, 0.1) is None and not pace.is_unfinished
    assert pace.step("b", DRAFT, 0.2) is not None


def test_final_quality_adds_passes_while_nothing_changes():
    pace = Pace()
    steps = [pace.step("a", FINAL, 0.1 * frame) for frame in range(5)]
    assert [step.passes for step in steps[:4]] == [range(i, i + 1) for i in range(4)]
    assert steps[4] is None and not pace.is_unfinished
    assert pace.step("b", FINAL, 1.0).passes == range(1)
    assert pace.is_unfinished


@pytest.mark.parametrize("rate", [60, 3])
def test_slow_drivers_fade_shadows_out_during_motion_and_in_again_after_it(rate):
    pace, strengths, qualities = Pace(), [], []
    for frame in range(90):
        key = min(frame, 30)  # nothing moves from the 31st frame on
        step = pace.step(key, FINAL, frame / rate)
        if step is not None:
            pace.measured(step, 0.08 if rate == 60 else 0.3)
            strengths.append(step.strength)
            qualities.append(step.options.quality)
    assert "draft" in qualities and qualities[-1] == "final" and strengths[-1] == 1.0
    # Shadows do not jump: they fade out over a fifth of a second and at least two frames.
    assert np.abs(np.diff(strengths)).max() <= (1 / 12 if rate == 60 else 0.5) + 1e-9


def test_fast_drivers_keep_their_shadows():
    pace = Pace()
    for frame in range(60):
        step = pace.step(frame, FINAL, frame / 60)
        pace.measured(step, 0.004)
        assert step.strength == 1.0 and step.options.quality == "final"


def test_final_picture_is_the_average_of_all_passes(drive, rig):
    hand = drive(*rig, samples=1)
    hand.step(3)
    draft = hand.scene_picture()
    hand.state.options.quality, hand.state.options.passes = "final", 3
    hand.step()
    while hand.app.frame.pace.is_unfinished:
        hand.step()
    final = hand.scene_picture()
    assert (final != draft).any()
    hand.step(3)
    assert (hand.scene_picture() == final).all()
