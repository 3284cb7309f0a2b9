"""Smooth curves through weighted targets."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from viewer.rig.feet.curves import smooth_curves

SPAN = 4.0


@pytest.mark.parametrize("count", [1, 2, 3, 31, 32, 33, 34, 65, 100])
def test_curves_solve_the_normal_equations(count: int) -> None:
    rng = np.random.default_rng(count)
    targets, weights = rng.normal(size=(3, count, 2)), 10.0 ** rng.uniform(-1.0, 6.0, (3, count))
    second = np.diff(np.eye(count), 2, axis=0) if count > 2 else np.zeros((0, count))
    found = smooth_curves(targets, weights, SPAN)
    for target, weight, curve in zip(targets, weights, found, strict=True):
        matrix = np.diag(weight) + SPAN**4 * second.T @ second
        assert_allclose(curve, np.linalg.solve(matrix, weight[:, None] * target), atol=1e-9)


def test_straight_lines_are_unchanged() -> None:
    line = np.stack([np.arange(50.0), 3.0 - 0.5 * np.arange(50.0)], axis=1)[None]
    weights = np.random.default_rng(0).uniform(0.1, 10.0, (1, 50))
    assert_allclose(smooth_curves(line, weights, 10.0), line, atol=1e-9)


def test_effect_of_a_fixed_row_decays_smoothly_over_the_span() -> None:
    targets, weights = np.zeros((1, 401, 1)), np.ones((1, 401))
    targets[0, 200], weights[0, 200] = 1.0, 1e9
    curve = smooth_curves(targets, weights, 20.0)[0, :, 0]
    # The solution of c + s^4 c'''' = 0 is e^-u (cos u + sin u) with u = x / (s sqrt 2).
    u = np.abs(np.arange(401) - 200) / (20.0 * np.sqrt(2.0))
    assert_allclose(curve, np.exp(-u) * (np.cos(u) + np.sin(u)), atol=2e-3)
    assert np.abs(np.diff(curve, 2)).max() < 1.0 / 20.0**2
