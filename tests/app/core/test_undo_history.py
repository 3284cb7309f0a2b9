"""Changes detected by the undo history, and what undo restores."""

import numpy as np
import pytest

import viewer
from viewer.app.core.scene_version import version_of
from viewer.app.core.undo_history import History
from viewer.rendering.options import DisplayOptions
from viewer.rig.motion.clip import Clip

ARRAYS = (
    "dofs",
    "translations",
    "rotations",
    "scales",
    "shape_weights",
    "figure_translation",
)


@pytest.fixture
def watched():
    """A history, its scene of one figure with shape weights, and the display."""
    scene, options, history = viewer.load(), DisplayOptions(), History()
    scene.actors[0].pose.shape_weights = np.zeros(2)
    history.start(version_of(scene, options), 0.0)
    return history, scene, options


@pytest.mark.parametrize("name", ARRAYS)
def test_edited_array_element_is_an_undo_step(watched, name):
    history, scene, options = watched
    array = getattr(scene.actors[0].pose, name)
    old = array.copy()
    # The smallest possible change.
    array.flat[-1] = np.nextafter(array.flat[-1], 9.0)
    new = array.copy()
    assert history.observe(version_of(scene, options), busy=False)
    assert not history.observe(version_of(scene, options), busy=False)
    history.undo(scene, options, lambda time: None)
    np.testing.assert_array_equal(getattr(scene.actors[0].pose, name), old)
    history.redo(scene, options, lambda time: None)
    np.testing.assert_array_equal(getattr(scene.actors[0].pose, name), new)


@pytest.mark.parametrize(
    ("name", "value"),
    [("offset", 0.5), ("visible", False), ("color", (1.0, 0.0, 0.0)), ("clip", None)],
)
def test_edited_setting_of_an_actor_is_an_undo_step(watched, name, value):
    history, scene, options = watched
    scene.actors[0].clip = Clip("c", (), 0.0, 1.0) if name == "clip" else None
    history.start(version_of(scene, options), 0.0)
    setattr(scene.actors[0], name, value)
    assert history.observe(version_of(scene, options), busy=False)


def test_edited_placement_is_an_undo_step(watched):
    history, scene, options = watched
    scene.actors[0].placement[0, 3] = np.nextafter(0.0, 1.0)
    assert history.observe(version_of(scene, options), busy=False)


def test_poses_set_by_the_clock_are_not_undo_steps(watched):
    history, scene, options = watched
    scene.actors[0].pose.dofs[0] += 0.25
    history.follow(version_of(scene, options), 1.0)
    assert not history.observe(version_of(scene, options), busy=False)
