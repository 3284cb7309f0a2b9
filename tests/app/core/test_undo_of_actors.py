"""Undo restores the set of actors, not only their poses."""

from app.captured import people

from viewer.rig.scene import Actor


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
