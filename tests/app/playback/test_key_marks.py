"""Keys on the tracks of the timeline: of all channels, or of the selected joint."""

import numpy as np
from app.captured import people
from numpy.testing import assert_array_equal
from rig.animated import animated_leg, wave

from viewer.app.playback.tracks import key_times
from viewer.rig.motion.clip import Channel, Clip
from viewer.rig.scene import Actor

SMOOTH = ("smooth", "smooth")


def test_track_shows_keys_of_the_selected_joint_or_all_keys():
    actor = Actor(animated_leg(), clip=wave(), offset=1.0)
    assert_array_equal(key_times(actor, -1), [1.5, 2.0, 2.5, 3.0, 3.5])
    assert_array_equal(key_times(actor, 1), [1.5, 2.0, 3.5])
    assert_array_equal(key_times(actor, 2), [])


def test_keys_of_dofs_belong_to_their_joint():
    channels = (
        Channel(0, np.array([0.0, 1.0]), np.zeros(2), (SMOOTH,) * 2),
        Channel(5, np.array([0.5]), np.zeros(1), (SMOOTH,)),
    )
    actor = Actor(animated_leg(), clip=Clip("c", channels, 0.0, 1.0))
    assert_array_equal(key_times(actor, 1), [0.5])
    assert_array_equal(key_times(actor, -1), [0.0, 0.5, 1.0])


def test_captures_have_no_keys(rig):
    assert all(len(key_times(actor, -1)) == 0 for actor in people(rig, [True] * 3).actors)
