"""Onion skins: poses of a motion in one scene."""

import numpy as np
import pytest
from rendering.moving import MISSING, RATE, SPEED, moving_arm

from viewer.errors import RigError
from viewer.rig.motion.onion import FAINTEST, onion
from viewer.rig.scene import Actor, Scene


def test_onion_has_poses_at_even_times_with_rising_opacity():
    scene = Scene([moving_arm(), Actor(moving_arm().figure)])
    still, *poses = onion(scene, 6).actors
    assert still.clip is None and still.opacity == 1.0
    # The six times in one second do not include frame 5, the only missing frame.
    places = [actor.require_pose().figure_translation[0] for actor in poses]
    np.testing.assert_allclose(places, SPEED * np.array([1.0, 0.8, 0.6, 0.4, 0.2, 0.0]), atol=1e-12)
    expected = np.linspace(1.0, FAINTEST, 6)
    np.testing.assert_allclose([actor.opacity for actor in poses], expected)
    assert scene.actors[0].clip is not None and scene.actors[0].opacity == 1.0


def test_onion_omits_absent_people_unless_gaps_are_interpolated():
    scene = Scene([moving_arm()])
    times = [0.0, MISSING / RATE, 1.0]
    opacities = [actor.opacity for actor in onion(scene, times).actors]
    assert opacities == pytest.approx([1.0, FAINTEST])
    assert len(onion(scene, times, interpolate=True).actors) == 3


def test_onion_without_motion_is_refused():
    with pytest.raises(RigError, match="nothing moves"):
        onion(Scene([Actor(moving_arm().figure)]), 4)
    with pytest.raises(RigError, match="expected at least one time"):
        onion(Scene([moving_arm()]), [])
