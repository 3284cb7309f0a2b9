"""Expressions that suppress each other."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from viewer.rig.expressions import ExpressionRules


def _rules(effect: int, is_binary: tuple[bool, bool] = (False, False)) -> ExpressionRules:
    """Return rules by which ``happy``, blend shape 1, affects ``blink``, blend shape 2."""
    return ExpressionRules(
        rows=np.array([1, 2]),
        is_binary=np.array(is_binary),
        kinds=np.array([-1, 1]),
        overrides=np.array([[0, effect, 0], [0, 0, 0]]),
    )


@pytest.mark.parametrize(
    ("effect", "is_binary", "given", "expected"),
    [
        (0, (False, False), (0.5, 0.8), (0.5, 0.8)),
        (1, (False, False), (0.1, 0.8), (0.1, 0.0)),
        (1, (False, False), (0.0, 0.8), (0.0, 0.8)),
        (2, (False, False), (0.25, 0.8), (0.25, 0.6)),
        # The shown value of a binary expression, 0 or 1, affects the others.
        (2, (True, False), (0.4, 0.8), (0.0, 0.8)),
        (2, (True, False), (0.6, 0.8), (1.0, 0.0)),
        # A binary expression that is affected by any amount is off.
        (2, (False, True), (0.1, 0.8), (0.1, 0.0)),
        (0, (False, False), (1.5, -0.5), (1.0, 0.0)),
    ],
)
def test_expressions_override_others_as_vrm_specifies(
    effect: int,
    is_binary: tuple[bool, bool],
    given: tuple[float, float],
    expected: tuple[float, float],
) -> None:
    weights = np.array([2.0, *given])
    assert_allclose(_rules(effect, is_binary).shown(weights), [2.0, *expected], atol=1e-15)


def test_missing_trailing_weights_are_zero() -> None:
    assert _rules(1).shown(np.array([0.3, 0.5])).tolist() == [0.3, 0.5]
