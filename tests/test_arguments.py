"""Wrong values of public functions are errors that say what is expected."""

import re

import numpy as np
import pytest

import viewer

FACE = [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]
BONED = viewer.figure(*FACE, weights=[[1], [1], [1]], joints=[[0, 0, 0]])
PLAIN = viewer.figure(*FACE)
ACTOR = viewer.Actor(BONED)
POSE = ACTOR.pose
WRONG = {
    "path: expected a text or Path, found int": lambda: viewer.write(BONED, 3),
    "path: expected a text or Path or None, found int": lambda: viewer.connect(3),
    "texture: expected a text or Path or ndarray or None, found int": lambda: viewer.figure(
        *FACE, texture=3
    ),
    "names: expected Sequence, found int": lambda: viewer.figure(*FACE, names=3),
    "up: expected a text, found list": lambda: viewer.figure(*FACE, up=["y"]),
    "name: expected a text, found int": lambda: viewer.figure(*FACE, name=3),
    "representation: expected a text or None, found list": lambda: viewer.animate(
        BONED, np.zeros((1, 1, 3)), representation=["6d"]
    ),
    "positions: expected shape 3 x 3, found a single number": lambda: viewer.with_rest_mesh(
        PLAIN, 3
    ),
    "weights: expected numbers": lambda: viewer.shaped(PLAIN, "x"),
    "channel: expected Channel, found int": lambda: viewer.evaluate(3, 3),
    "times: expected numbers": lambda: viewer.evaluate(viewer.Channel(0, [0], [1], ((0, 0),)), "x"),
    "clip: expected Clip, found int": lambda: viewer.sample(3, BONED.skeleton, 0.0, POSE),
    "paths: expected a text or PathLike or Iterable, found int": lambda: viewer.batch(3, "info"),
    "paths: expected a text or PathLike, found int": lambda: viewer.batch([3], "info"),
    "job: expected a text or Callable, found int": lambda: viewer.batch([], 4),
    "job: expected a text or Callable, found list": lambda: viewer.batch("nope", ["x"]),
    "report: expected a text or PathLike, found int": lambda: viewer.batch([], "info", report=3),
    "clean: expected a scene or an actor, found int": lambda: viewer.clean(3),
    "times: expected an integer or Iterable, found float": lambda: viewer.onion(ACTOR, 0.5),
    "times: expected at least one, found -1": lambda: viewer.onion(
        viewer.animate(BONED, np.zeros((2, 1, 3))), -1
    ),
    "record: expected PoseRecord, found int": lambda: viewer.apply_record(3, BONED, POSE),
    "pose: expected Pose, found int": lambda: viewer.record_of(BONED, 3),
    "method: expected a text or Skinning, found int": lambda: viewer.deform(BONED, POSE, 3),
    "poses: expected Pose, found int": lambda: viewer.deform_frames(BONED, [3]),
    "skinning: expected Skinning or None, found int": lambda: ACTOR.vertices(skinning=3),
    "time: expected a number, found str": lambda: ACTOR.vertices(time="x"),
    "time: expected a number, found list": lambda: ACTOR.joints(time=[1]),
    "time: expected a number, found tuple": lambda: viewer.Actor(PLAIN).vertices(time=()),
    "time: expected seconds, found nan": lambda: ACTOR.joints(time=float("nan")),
    "actors: expected a sequence of Actor, found int": lambda: viewer.Scene(3),
    "own_pose: expected Pose or None, found int": lambda: viewer.Actor(BONED, 3),
    "target: expected shape 3, found a single number": lambda: viewer.Camera(3),
    "distance: expected a number, found str": lambda: viewer.Camera(distance="x"),
    "azimuth: expected a number, found str": lambda: viewer.Light("x"),
    "color: expected 3 numbers, found int": lambda: viewer.Light(color=3),
    "key: expected Light, found int": lambda: viewer.Lights(3),
    "sky: expected 3 numbers, found int": lambda: viewer.Lights(sky=3),
    "name: expected a text, found float": lambda: viewer.Texture(3.0),
    'wrap: expected ("clamp" or "repeat"': lambda: viewer.Texture("t", wrap=3),
    "name: expected a text, found NoneType": lambda: viewer.Material(None),
    "base_texture: expected Texture or None, found int": lambda: viewer.Material("", 3),
    "metallic: expected a number, found str": lambda: viewer.Material(metallic="x"),
    "emissive: expected 3 numbers, found int": lambda: viewer.Material(emissive=3),
    "options: expected ExportOptions or None, found int": lambda: viewer.export(
        ACTOR, "a.glb", options=3
    ),
    "speed: expected a number or None, found str": lambda: viewer.video(ACTOR, "a.gif", speed="x"),
    "orthographic: expected True or False, found list": lambda: viewer.render(
        ACTOR, orthographic=[1]
    ),
    "azimuth: expected a finite number, found inf": lambda: viewer.render(
        ACTOR, azimuth=float("inf")
    ),
    "camera: expected Camera or None, found int": lambda: viewer.show(ACTOR, 3),
    "gender: expected a text or None, found list": lambda: viewer.load(gender=["male"]),
    "max_size: expected a number, found str": lambda: viewer.load(max_size="x"),
}


@pytest.mark.parametrize("message", WRONG)
def test_wrong_argument_is_an_error_that_says_what_is_expected(message):
    with pytest.raises(viewer.ViewerError, match=f"^{re.escape(message)}"):
        WRONG[message]()
