"""DOFs as text: degrees as on sliders, with as many decimals as necessary."""

import math

import numpy as np
import pytest
from lint.sound import make_skeleton

from viewer.rig.posing.dof_text import beyond_text, dof_value_text
from viewer.rig.skeleton import Skeleton


def head(low: float, high: float) -> Skeleton:
    return make_skeleton(("head",), [-1], [[0, 0, 0]], (low, high))


def test_angles_are_in_degrees_and_lengths_in_file_units() -> None:
    skeleton = head(-1.0, 1.0)
    assert dof_value_text(skeleton, 4, math.pi / 6) == "30.0°"
    assert dof_value_text(skeleton, 4, -0.0) == "0.0°"
    assert dof_value_text(skeleton, 1, 0.25) == "0.25"


def test_value_and_limits_are_shown_together() -> None:
    # 0.3 and 0.5 radians are 17.188734 and 28.647890 degrees.
    text = str(beyond_text(head(0.3, 0.5), 4, 0.0, " in frame 7"))
    assert text == "head.y is 0.0° in frame 7; its limits are 17.2° and 28.6°"


def test_value_just_beyond_a_limit_is_distinguishable() -> None:
    # 1e-5 radians are 0.00057 degrees.
    text = str(beyond_text(head(0.3, 0.5), 4, 0.50001))
    assert text == "head.y is 28.6485°; its limits are 17.1887° and 28.6479°"


@pytest.mark.parametrize(
    ("low", "high", "value", "text"),
    [
        (-np.inf, math.pi, 2.0 * math.pi, "head.y is 360.0°; its maximum is 180.0°"),
        (0.0, np.inf, -math.pi, "head.y is -180.0°; its minimum is 0.0°"),
    ],
)
def test_single_limit_is_named(low: float, high: float, value: float, text: str) -> None:
    assert str(beyond_text(head(low, high), 4, value)) == text
