"""Swapped IDs of people, and tracks that continue with a different ID."""

from dataclasses import replace

import numpy as np
from lint.planted import exchanged, people
from lint.sound import FRAMES

from viewer.lint import lint_scene
from viewer.rig.scene import Scene

FRAME = np.arange(FRAMES)


def found(scene: Scene):
    return [finding for finding in lint_scene(scene) if finding.code == "C015"]


def test_exchange_is_reported_with_the_other_person_and_the_distance() -> None:
    (finding,) = found(exchanged())
    assert finding.message == ("swaps positions with person 1, 2 m away, in 1 frame: 120")


def test_exchange_and_its_reversal_are_reported_in_two_frames() -> None:
    step = np.where((FRAME >= 20) & (FRAME < 30), 2.0, 0.0)
    (finding,) = found(people(step, 2.0 - step))
    assert finding.frames.tolist() == [120, 130]


def test_exchange_during_a_short_gap_is_found() -> None:
    step = np.where(FRAME < 20, 0.0, 2.0)
    other = 2.0 - step
    step[18:21] = np.nan
    (finding,) = found(people(step, other))
    assert finding.frames.tolist() == [121]


def test_people_who_pass_each_other_are_not_exchanged() -> None:
    walk = 0.05 * (FRAME - 30.0)  # 1.5 m/s
    assert found(people(walk, -walk)) == []


def test_single_person_who_jumps_is_not_exchanged() -> None:
    assert found(people(np.where(FRAME < 20, 0.0, 2.0), np.full(FRAMES, 2.0))) == []


def test_track_that_continues_with_a_different_number_is_a_note() -> None:
    first = np.where(FRAME < 20, 0.0, np.nan)
    second = np.where(FRAME < 25, np.nan, 0.1)
    (finding,) = found(people(first, second))
    assert finding.severity == "note" and finding.actor == 1
    assert finding.frames.tolist() == [125]
    assert "100 mm from where person 0 disappears in frame 119" in finding.message
    assert "--merge-ids 0,1" in finding.message


def test_person_who_appears_elsewhere_or_much_later_is_a_different_person() -> None:
    first = np.where(FRAME < 10, 0.0, np.nan)
    assert found(people(first, np.where(FRAME < 12, np.nan, 1.0))) == []
    assert found(people(first, np.where(FRAME < 50, np.nan, 0.0))) == []


def test_people_of_different_recordings_are_not_compared() -> None:
    scene = exchanged()
    scene.actors[1] = replace(scene.actors[1], called="other")
    assert found(scene) == []
