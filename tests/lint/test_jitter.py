"""Estimated noise of motions, compared with its known size; jumps and gaps are not noise."""

from dataclasses import replace

import numpy as np
import pytest
from lint.planted import moving
from lint.sound import FRAMES, RATE

from viewer.lint import lint_scene
from viewer.lint.jitter import noise_of

TIME = np.arange(FRAMES) / RATE


def codes(change) -> set[str]:
    return {finding.code for finding in lint_scene(moving(change))}


def test_noise_is_measured_as_its_quadratic_mean() -> None:
    places = np.random.default_rng(0).normal(0.0, 0.01, (3000, 4, 3))
    found = noise_of(places, np.ones(3000, dtype=np.bool_), 15)
    middle = found[10:-10]
    # The noise is 17.3 mm in three dimensions; the fifth of 15 overlapping values varies by some 20
    # %.
    assert np.median(middle) == pytest.approx(0.01 * np.sqrt(3.0), rel=0.05)
    assert found[:9].max() == found[-9:].max() == 0.0


def test_noise_of_many_frames_is_that_of_each_batch() -> None:
    places = np.random.default_rng(1).normal(size=(4100, 1, 3))
    whole = noise_of(places, np.ones(4100, dtype=np.bool_), 15)
    part = noise_of(places[1990:2030], np.ones(40, dtype=np.bool_), 15)
    np.testing.assert_allclose(whole[2000:2020], part[10:30], atol=1e-15)


@pytest.mark.parametrize(("hertz", "metres"), [(1.0, 0.5), (2.0, 0.12), (0.2, 3.0)])
def test_fast_smooth_motion_is_not_reported_as_jitter(hertz: float, metres: float) -> None:
    def swing(root, _):
        root[:, 0] = metres * np.sin(2.0 * np.pi * hertz * TIME)

    assert "C014" not in codes(swing)


def test_jumps_are_not_reported_as_jitter() -> None:
    def jump(root, _):
        root[:, 0] = 0.5 * (np.arange(FRAMES) // 8)

    assert "C014" not in codes(jump)


def test_noise_does_not_span_gaps() -> None:
    places = np.zeros((60, 1, 3))
    places[30:] = 5.0
    present = np.ones(60, dtype=np.bool_)
    present[29] = False
    assert noise_of(places, present, 5).max() == 0.0


def test_slow_recordings_are_not_checked() -> None:
    def shake(root, _):
        root[:, 0] = np.random.default_rng(2).normal(0.0, 0.05, FRAMES)

    scene = moving(shake)
    assert "C014" in {finding.code for finding in lint_scene(scene)}
    clip = scene.actors[0].clip
    scene.actors[0].clip = replace(clip, timing=replace(clip.timing, frame_rate=12.0))
    assert "C014" not in {finding.code for finding in lint_scene(scene)}
