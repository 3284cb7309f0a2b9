"""Sliding feet: drifts are found; swings close to the ground, landings and steps are not."""

from dataclasses import replace

import numpy as np
import pytest
from lint.sound import FRAMES, RATE, legs, scene_of, standing

from viewer.lint import lint_scene

_K = np.arange(FRAMES)


def codes(left: np.ndarray, right: np.ndarray, root: np.ndarray | None = None) -> list[str]:
    """Check legs whose ankles move along z by given distances, always 2 mm above the ground.

    ``root``: distance by which the body moves, in addition.
    """
    figure = legs()
    clip, count = standing(figure), len(left)
    places = np.zeros((count, figure.skeleton.n_joints, 3))
    names = figure.skeleton.names
    for name, path in (("left_ankle", left), ("right_ankle", right)):
        places[:, names.index(name), 2] = path
    places[:, 0, 2] = 0.0 if root is None else root
    clip = replace(clip, rotations=np.tile(clip.rotations[:1], (count, 1, 1)), translations=places)
    return [finding.code for finding in lint_scene(scene_of(figure, clip))]


def steps(start: int, length: int, distance: float) -> np.ndarray:
    """Return a path that moves smoothly by a distance in some frames and rests otherwise."""
    x = np.clip((_K - start) / length, 0.0, 1.0)
    return distance * x * x * (3.0 - 2.0 * x)


STILL = np.zeros(FRAMES)


def test_low_swings_next_to_a_standing_foot_are_not_slides() -> None:
    # 0.5 m in 0.4 s, at up to 1.9 m/s.
    swings = steps(5, 12, 0.5) + steps(40, 12, 0.5)
    assert codes(swings, STILL) == []
    assert codes(STILL, swings) == []


@pytest.mark.parametrize("speed", [0.35, 0.5, 0.8])
def test_feet_that_slide_together_are_found(speed: float) -> None:
    # The body moves with the feet, as if on wheels. Feet slide above 0.2 * 1.6 = 0.32 m/s.
    assert "C007" in codes(STILL, STILL, speed * _K / RATE)


def test_feet_that_stand_on_moving_ground_are_not_slides() -> None:
    # The body stays in place, as on a treadmill or in a motion whose travel was removed.
    assert codes(-0.5 * _K / RATE, -0.5 * _K / RATE) == []
    # The feet move back at 0.4 m/s and the body ahead at 0.4 m/s.
    assert "C007" in codes(-0.8 * _K / RATE, -0.8 * _K / RATE, 0.4 * _K / RATE)


def test_standing_foot_that_starts_to_drift_is_found() -> None:
    assert "C007" in codes(steps(10, 20, 0.2), STILL)


@pytest.mark.parametrize("speed", [0.4, 0.8])
def test_foot_dragged_next_to_a_standing_foot_is_found(speed: float) -> None:
    assert "C007" in codes(speed * _K / RATE, STILL)
    assert "C007" in codes(STILL, speed * _K / RATE)


def test_short_landings_are_not_slides() -> None:
    # Each foot lands within 0.13 s.
    assert codes(steps(10, 4, 0.06), steps(30, 4, 0.06)) == []
