"""The cache key of the view, which changes with every visible change, and only then."""

import copy
from dataclasses import fields, replace

import numpy as np
import pytest
from app.driver import make_state

import viewer
from viewer.app.pace import picture_key
from viewer.rendering.options import DisplayOptions, Light, Lights
from viewer.rendering.overlay.annotation import Marks
from viewer.rigs.captures.cameras import CameraView
from viewer.rigs.figure import figure_pose
from viewer.rigs.motion.clip_edit import clip_from_pose
from viewer.rigs.scene import Actor, Scene
from viewer.rigs.skinning import Skinning

SIZE = (64, 48)


@pytest.fixture(scope="module")
def figure():
    return viewer.load().actors[0].figure


@pytest.fixture
def state(figure):
    state = make_state(Scene([Actor(figure, figure_pose(figure))], (), figure.up))
    state.actor.points = np.zeros((2, 4))
    state.actor.pose.shape_weights = np.zeros(3)
    return state


OTHERS = {
    "up": "z",
    "fixed": CameraView("front", np.eye(3), np.eye(3), np.zeros(3)),
    "shading": "scalar",
    "method": "dqs",
    "scalar_range": (0.0, 1.0),
    "path_joints": ((0, 0),),
    "isolines": True,
    "skeleton_opacity": 0.5,
}
"""Values of fields whose other values do not follow from their type."""


def another(owner, name):
    """Return a different valid value of a field."""
    value, facts = getattr(owner, name), owner.__dataclass_fields__[name].metadata
    if name in OTHERS:
        return OTHERS[name]
    if "choices" in facts:
        return next(one for one in facts["choices"] if one != value)
    if isinstance(value, bool):
        return not value
    if isinstance(value, int | float):
        most = facts.get("limits", (0.0, np.inf))[1]
        return value + 1 if value + 1 <= most else value / 2
    if isinstance(value, str):
        return f"{value} else"
    return (0, 0, 0) if value != (0, 0, 0) else None


def put(owner, name):
    setattr(owner, name, another(owner, name))


CAMERA = {
    name: lambda state, name=name: put(state.camera, name)
    for name in ("distance", "azimuth", "inclination", "fov", "orthographic", "up", "fixed")
}
NESTED = ("lights", "skinning")
OPTIONS = {
    one.name: lambda state, name=one.name: put(state.options, name)
    for one in fields(DisplayOptions)
    if one.name not in NESTED
}
LIGHTS = {
    f"lights.{one.name}": lambda state, name=one.name: put(state.options.lights, name)
    for one in fields(Lights)
    if one.name not in ("key", "rim")
}
KEY_LIGHT = {
    f"lights.{light}.{one.name}": lambda state, light=light, name=one.name: put(
        getattr(state.options.lights, light), name
    )
    for light in ("key", "rim")
    for one in fields(Light)
}


def skin_otherwise(state, name):
    how = state.options.skinning
    state.options.skinning = replace(how, **{name: another(how, name)})


SKINNING = {
    f"skinning.{one.name}": lambda state, name=one.name: skin_otherwise(state, name)
    for one in fields(Skinning)
}


def add_in_place(array):
    array[(0,) * array.ndim] += 0.25


def move_pose(name):
    return lambda state: add_in_place(getattr(state.actor.pose, name))


POSE = {
    name: move_pose(name)
    for name in (
        "dofs",
        "translations",
        "rotations",
        "scales",
        "shape_weights",
        "figure_translation",
    )
}


def swap_actor(state):
    state.scene.actors[0] = Actor(state.actor.figure, own_pose=state.actor.pose)


def swap_figure(state):
    state.actor.figure = replace(state.actor.figure)


def key_pose(state):
    actor = state.actor
    actor.clip = clip_from_pose(actor.figure.skeleton, actor.pose, "walk", 0.0, 1.0)


ACTOR = {
    "figure scale": lambda state: put(state.actor.pose, "figure_scale"),
    "placement": lambda state: add_in_place(state.actor.placement),
    "other placement": lambda state: setattr(state.actor, "placement", 2.0 * np.eye(4)),
    "points": lambda state: add_in_place(state.actor.points),
    "no points": lambda state: setattr(state.actor, "points", None),
    "other pose": lambda state: setattr(state.actor, "pose", _turned(state.actor.pose)),
    "no pose": lambda state: setattr(state.actor, "own_pose", None),
    "visible": lambda state: put(state.actor, "visible"),
    "present": lambda state: put(state.actor, "is_present"),
    "color": lambda state: put(state.actor, "color"),
    "clip": key_pose,
    "offset": lambda state: put(state.actor, "offset"),
    "other actor": swap_actor,
    "another actor": lambda state: state.scene.actors.append(Actor(state.actor.figure)),
    "no actor": lambda state: state.scene.actors.clear(),
    "figure": swap_figure,
}


def _turned(pose):
    other = pose.copy()
    other.dofs[0] += 0.5
    return other


REST = {
    "target": lambda state: add_in_place(state.camera.target),
    "ground": lambda state: add_in_place(state.box),
    "chosen actor": lambda state: put(state, "chosen_actor"),
    "selected joint": lambda state: put(state, "selected_joint"),
}
CHANGES = CAMERA | OPTIONS | LIGHTS | KEY_LIGHT | SKINNING | POSE | ACTOR | REST


def key_of(state, *given):
    """Return the key of the current picture."""
    state.update_version()
    return picture_key(state, *given)


@pytest.mark.parametrize("name", CHANGES)
def test_every_visible_change_changes_the_key(state, name):
    before = key_of(state, SIZE)
    assert key_of(state, SIZE) == before
    CHANGES[name](state)
    after = key_of(state, SIZE)
    assert after != before
    assert key_of(state, SIZE) == after


def test_size_and_overlays_are_part_of_the_key(state):
    marks = Marks(np.zeros((0, 3)), np.zeros(0), np.zeros((0, 2, 3)))
    known = [
        key_of(state, SIZE),
        key_of(state, (64, 49)),
        key_of(state, SIZE, marks),
        key_of(state, SIZE, copy.copy(marks)),
        key_of(state, SIZE, None, "ghost"),
        key_of(state, SIZE, None, None, ("annotation",)),
    ]
    assert all(one != other for row, one in enumerate(known) for other in known[:row])
    assert key_of(state, SIZE, marks) == known[2]


def test_key_includes_time_only_if_motion_paths_are_drawn(state):
    before = key_of(state, SIZE)
    state.scene.time = 1.0
    assert key_of(state, SIZE) == before
    state.options.path_joints = ((0, 0),)
    before = key_of(state, SIZE)
    state.scene.time = 2.0
    assert key_of(state, SIZE) != before


def test_restored_values_have_an_equal_key(state):
    before = key_of(state, SIZE)
    state.actor.pose.dofs[0] += 0.5
    key_of(state, SIZE)
    state.actor.pose.dofs[0] -= 0.5
    assert key_of(state, SIZE) == before


def test_unchanged_scene_is_not_copied(state, monkeypatch):
    before = key_of(state, SIZE)
    monkeypatch.setattr("viewer.app.core.scene_version.copy.deepcopy", None)
    monkeypatch.setattr("viewer.rigs.pose.NumberKey", None)
    assert key_of(state, SIZE) == before


def test_frame_is_drawn_if_and_only_if_the_key_changes(hand, monkeypatch):
    renderer, drawn = hand.app.frame.renderer, []
    draw = renderer.draw
    monkeypatch.setattr(renderer, "draw", lambda *args: (drawn.append(1), draw(*args)))
    hand.step(3)
    assert drawn == []
    hand.state.actor.pose.dofs[hand.dof_index("arm.x")] += 0.1
    hand.step(3)
    assert drawn == [1]
