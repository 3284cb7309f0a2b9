"""Undo and redo, for each actor and across actors."""

import numpy as np
import pytest
from app.captured import people

import viewer
from viewer.app.core.scene_version import version_of
from viewer.app.core.undo_history import History
from viewer.rendering.options import DisplayOptions
from viewer.rigs.motion.clip import Clip
from viewer.rigs.scene import Actor

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


def names(hand):
    return [actor.name for actor in hand.state.scene.actors]


def test_added_and_removed_actors_are_undone(hand):
    state = hand.state
    first = state.actor
    other = Actor(first.figure)
    state.scene.actors.append(other)
    state.choose_actor(1)
    hand.step(2)
    assert hand.undo_steps == 1
    state.scene.actors[0] = Actor(first.figure)
    hand.step(2)
    assert hand.undo_steps == 2
    hand.key("z", "ctrl")
    assert state.scene.actors == [first, other] and state.actor is other
    hand.key("z", "ctrl")
    assert state.scene.actors == [first]
    assert state.chosen_actor == 0 and state.actor is first
    hand.key("y", "ctrl")
    hand.step(2)
    assert state.scene.actors == [first, other]
    hand.assert_sane()


def test_active_actor_stays_active_at_its_new_index(hand):
    state = hand.state
    first, other = state.actor, Actor(state.actor.figure)
    state.scene.actors[:] = [other, first]
    state.choose_actor(1)
    hand.step(2)
    hand.key("z", "ctrl")
    assert state.scene.actors == [first] and state.actor is first
    hand.key("y", "ctrl")
    assert state.chosen_actor == 1 and state.actor is first


def test_poses_of_removed_actors_are_restored_with_them(hand):
    state = hand.state
    dof = hand.dof_index("arm.x")
    first = state.actor
    first.pose.dofs[dof] = 0.7
    hand.step(2)
    state.scene.actors[0] = Actor(first.figure)
    hand.step(2)
    first.pose.dofs[dof] = -3.0  # invisible
    hand.key("z", "ctrl")
    assert state.actor is first and first.pose.dofs[dof] == 0.7
    hand.key("z", "ctrl")
    assert first.pose.dofs[dof] == 0.2


def test_display_change_is_not_an_undo_step(hand):
    state = hand.state
    state.options.wireframe = True
    hand.step(2)
    steps = hand.undo_steps
    state.actor.visible = False
    state.history.accept(state.update_version())
    hand.step(2)
    assert hand.undo_steps == steps
    hand.key("z", "ctrl")
    assert not state.options.wireframe and state.actor.visible


def test_people_that_appear_while_loading_are_added_to_every_undo_step(drive, rig):
    hand = drive(scene=people(rig, [True] * 5), samples=1)
    state = hand.state
    state.scene.actors.append(Actor(state.actor.figure))
    hand.step(2)
    late = Actor(state.actor.figure)
    state.scene.actors.append(late)
    state.history.add_actors(state.update_version())
    hand.step(2)
    assert hand.undo_steps == 1
    hand.key("z", "ctrl")
    assert late in state.scene.actors and len(names(hand)) == 2
