"""The ratio of leg lengths, calculated by hand for a stick figure with two legs."""

from dataclasses import replace

import numpy as np
import pytest

from viewer.autorig.transfer.rest_skeleton import leg_scale
from viewer.rig.skeleton import ball_skeleton


def stick(up="y", leg=1.0, arm=0.5):
    """Return a root with two legs of two bones, and a raised arm."""
    names = ("root", "knee_l", "foot_l", "knee_r", "foot_r", "hand")
    places = np.zeros((6, 3))
    places[:, 0] = 0.0, 0.1, 0.1, -0.1, -0.1, 0.0
    heights = 3.0 + np.array([0.0, -leg / 2, -leg, -leg / 2, -leg, arm])
    places[:, "xyz".index(up)] = heights
    return ball_skeleton(names, np.array([-1, 0, 1, 0, 3, 0]), places)


@pytest.mark.parametrize("up", ["y", "z"])
def test_only_leg_length_affects_the_ratio(up):
    longer = stick(up, leg=1.4, arm=0.9)
    assert leg_scale(stick(up), longer, up, 7.0) == pytest.approx(1.4)


def test_feet_are_taken_from_the_first_skeleton():
    tiptoe = stick()
    raised = tiptoe.rest_translations.copy()
    raised[4, 1] += 0.2  # one foot is 0.2 higher, so the mean is 0.9 below the root
    assert leg_scale(stick(), replace(tiptoe, rest_translations=raised), "y", 7.0) == (
        pytest.approx(0.9)
    )


@pytest.mark.parametrize("leg", [0.0, 0.1, -1.0])
def test_figures_without_legs_have_no_ratio(leg):
    # The root is (nearly) the lowest joint.
    assert leg_scale(stick(leg=leg), stick(), "y", 7.0) == 7.0


def test_skeleton_of_one_joint_has_no_ratio():
    one = ball_skeleton(("a",), np.array([-1]), np.ones((1, 3)))
    assert leg_scale(one, one, "y", 2.5) == 2.5


def test_feet_above_the_root_result_in_the_fallback():
    assert leg_scale(stick(), stick(leg=-1.0), "y", 2.0) == 2.0
