"""Whether anyone can have written the arrays of a pose or an actor since the last look."""

import copy
import weakref

import numpy as np
import pytest
from rigs.hand_made import skeleton

import viewer
from viewer.rigs import watched_arrays
from viewer.rigs.pose import Pose, pose_key, rest_pose
from viewer.rigs.scene import Actor
from viewer.rigs.watched_arrays import Watch


def poses(count: int = 3) -> list[Pose]:
    return [rest_pose(skeleton([-1, 0], [(1, "x", 0.0)])) for _ in range(count)]


def watching(owners) -> Watch:
    watch = Watch("values", "shape_weights")
    assert not watch.look(owners)
    watch.keep()
    assert watch.look(owners) and watch.look(owners)
    return watch


def test_poses_that_nobody_asks_for_arrays_are_unchanged():
    owners = poses()
    watch = watching(owners)
    # Keys, which are made in every frame, read the arrays without handing them out.
    for pose in owners:
        assert pose.skinning_key and pose_key(pose) and pose.copy()
    assert watch.look(owners)
    assert watch.look([]) is False  # others


@pytest.mark.parametrize(
    "name", ["dofs", "translations", "rotations", "scales", "figure_translation", "shape_weights"]
)
def test_every_array_that_was_handed_out_may_have_changed(name):
    owners = poses()
    owners[1].shape_weights = np.zeros(2)
    watch = watching(owners)
    getattr(owners[1], name)[...] = 0.5
    assert not watch.look(owners)
    assert not watch.look(owners)  # until the values are known
    watch.keep()
    assert watch.look(owners)
    setattr(owners[1], name, np.ones_like(getattr(owners[1], name)))
    assert not watch.look(owners)


def test_array_held_by_others_may_change_at_any_time():
    owners = poses()
    watch = watching(owners)
    held = owners[2].dofs
    for _ in range(3):
        assert not watch.look(owners)
        watch.keep()
    held[0] = 1.0  # after the values were read
    del held
    assert not watch.look(owners)
    watch.keep()
    assert watch.look(owners)
    shared = copy.copy(owners[0])  # has the same arrays
    watch.keep()
    assert not watch.look(owners)
    del shared


def test_memory_of_another_array_may_change_at_any_time():
    memory = np.zeros((2, 1 + 10 + 3))
    owners = [Pose(row, 1) for row in memory]
    watch = Watch("values", "shape_weights")
    for _ in range(3):
        assert not watch.look(owners)
        watch.keep()


def test_array_behind_a_weak_reference_may_change_at_any_time():
    owners = poses()
    weak = weakref.ref(owners[1].values)
    watch = Watch("values", "shape_weights")
    for _ in range(3):
        assert not watch.look(owners)
        watch.keep()
        weak()[0] += 1.0
    del weak
    assert not watch.look(owners)
    watch.keep()
    assert watch.look(owners)


def test_everything_may_have_changed_where_references_are_not_counted(monkeypatch):
    owners = poses()
    watch = watching(owners)
    monkeypatch.setattr(watched_arrays, "_COUNTS_REFERENCES", False)
    for _ in range(2):
        assert not watch.look(owners)
        watch.keep()


def test_another_actor_in_the_place_of_one_is_a_change():
    figure = viewer.load("fox").actors[0].figure
    watch, actors = Watch("placement"), [Actor(figure), Actor(figure)]
    watch.look(actors[:1])
    watch.keep()
    assert watch.look(actors[:1])
    assert not watch.look(actors[1:])


def test_another_pose_in_the_place_of_one_is_a_change():
    owners = poses()
    watch = watching(owners)
    assert not watch.look([*owners[:2], owners[0].copy()])
    assert not watch.look(owners)


def test_two_watches_do_not_disturb_each_other():
    owners = poses()
    first, second = watching(owners), watching(owners)
    owners[0].dofs[0] = 1.0
    assert not first.look(owners)
    first.keep()
    assert first.look(owners) and not second.look(owners)
