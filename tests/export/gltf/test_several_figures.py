"""Several figures and cameras in one glTF file, read by an evaluator of the specification."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from exporting import export_clips, export_figures
from formats.gltf.spec_evaluator import Evaluator
from numpy.testing import assert_allclose
from two_parts import clips, two_parts

import viewer
from viewer.rig.captures.cameras import CameraView
from viewer.rig.motion.evaluation import frames_of, pose_of
from viewer.rig.motion.transform_clip import TransformChannel, TransformClip
from viewer.rig.scene import Actor, Scene
from viewer.rig.skinning import deform

SINGLE = 2e-6  # for lengths up to 5
# A rotation by 90 degrees about y with a translation; the second figure is in centimetres with z
# up.
PLACED = np.array([[0.0, 0, 1, 3], [0, 1, 0, 0.5], [-1, 0, 0, 2], [0, 0, 0, 1]])
UP = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])


def other() -> Actor:
    """Return a figure in centimetres with z up, stretched to the size of the first."""
    figure = replace(two_parts(), name="other", unit="cm", up="z")
    return Actor(figure, placement=PLACED @ UP)


def posed(actor: Actor, animation: int, time: float) -> np.ndarray:
    """Return the vertices of an actor's animation in the space of the scene."""
    clip = actor.figure.animations[animation].clip()
    frames = frames_of(actor.figure, clip, np.array([time]))
    points = deform(actor.figure, pose_of(actor.figure, frames, 0))[0]
    return points @ actor.placement[:3, :3].T + actor.placement[:3, 3]


@pytest.mark.parametrize(("optimizes", "up"), [(False, "y"), (True, "y"), (False, "z")])
def test_figures_are_placed_as_in_the_scene(tmp_path: Path, optimizes: bool, up: str) -> None:
    actors, path = [Actor(two_parts()), other()], tmp_path / "both.glb"
    every = [[each.clip() for each in actor.figure.animations] for actor in actors]
    turned = np.linalg.inv(UP) if up == "z" else np.eye(4)
    placed = [replace(each, placement=turned @ each.placement) for each in actors]
    scene = Scene(placed, world_up=up)
    notes = export_figures(placed, path, every, scene, optimizes=optimizes)
    assert [note.key for note in notes if note.code == "X001"] == ["X001.gltf-figures"]
    assert not [note for note in notes if note.values.get("distance", 0.0) > 1e-3]
    plain = Evaluator(path)
    # Both figures are moved by the same animations.
    assert [each["name"] for each in plain.root["animations"]] == ["wave", "jump"]
    for animation, time in ((0, 0.7), (1, 0.6), (1, 1.5)):
        found = np.concatenate(plain.meshes(animation, time))
        expected = np.concatenate([posed(actor, animation, time) for actor in actors])
        apart = np.linalg.norm(found[:, None] - expected, axis=2)
        limit = 1e-3 if optimizes else SINGLE
        assert apart.min(axis=0).max() < limit and apart.min(axis=1).max() < limit


def test_written_figures_are_read_as_several_actors(tmp_path: Path) -> None:
    actors, path = [Actor(two_parts()), other()], tmp_path / "both.glb"
    export_figures(actors, path)
    scene = viewer.load(path)
    assert len(scene.actors) == 2
    expected = [posed(actor, 1, 0.0) for actor in actors]  # no joint has moved at this time
    found = [deform(actor.figure, actor.pose)[0] for actor in scene.actors]
    for one, two in zip(found, expected, strict=True):
        assert_allclose(np.ptp(one, axis=0), np.ptp(two, axis=0), atol=SINGLE)


@pytest.mark.parametrize("units", [("m", "cm"), ("cm", "m"), ("cm", "cm")])
def test_sizes_are_in_metres_whatever_the_unit_of_the_scene(
    tmp_path: Path, units: tuple[str, str]
) -> None:
    metres = [{"m": 1.0, "cm": 0.01}[unit] for unit in units]
    scaled = np.diag([metres[1] / metres[0]] * 3 + [1.0])
    first, second = (replace(two_parts(), unit=unit) for unit in units)
    actors, path = [Actor(first), Actor(second, placement=scaled)], tmp_path / "both.glb"
    every = [[each.clip() for each in actor.figure.animations] for actor in actors]
    export_figures(actors, path, every, Scene(actors))
    expected = np.concatenate([metres[0] * posed(actor, 1, 0.6) for actor in actors])
    found = np.concatenate(Evaluator(path).meshes(1, 0.6))
    apart = np.linalg.norm(found[:, None] - expected, axis=2)
    assert apart.min(axis=0).max() < SINGLE and apart.min(axis=1).max() < SINGLE


def test_animations_of_different_length_remain_separate(tmp_path: Path) -> None:
    longer = [replace(clip, end=clip.end + 1.0) for clip in clips()]
    actors, path = [Actor(two_parts()), Actor(two_parts())], tmp_path / "both.glb"
    export_figures(actors, path, [clips(), longer])
    names = [each["name"] for each in Evaluator(path).root["animations"]]
    assert names == ["wave", "jump", "wave", "jump"]


def test_cameras_are_read_back(tmp_path: Path) -> None:
    intrinsic = np.array([[900.0, 0, 400], [0, 900, 300], [0, 0, 1]])
    turn = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    view = CameraView("front", intrinsic, turn, np.array([0.1, 0.2, 5.0]), (800, 600))
    lens = replace(view, name="lens", distortion=np.array([0.1]), near=0.25, far=40.0)
    path = tmp_path / "seen.glb"
    notes = export_figures([Actor(two_parts())], path, None, Scene([], views=(view, lens)))
    (lost,) = [note for note in notes if note.key == "X003.camera-lenses"]
    assert lost.values["names"] == ["lens"]
    camera = Evaluator(path).root["cameras"][0]["perspective"]
    assert camera["yfov"] == pytest.approx(2.0 * math.atan(300.0 / 900.0), abs=1e-12)
    assert camera["aspectRatio"] == pytest.approx(4.0 / 3.0, abs=1e-12)
    front, back = viewer.load(path).views
    assert (front.near, front.far, back.near, back.far) == (0.01, None, 0.25, 40.0)
    assert front.name == "front"
    assert_allclose(front.rotation, turn, atol=1e-12)
    assert_allclose(front.translation, view.translation, atol=1e-12)


def test_animations_without_effect_are_reported(tmp_path: Path) -> None:
    face = TransformChannel(
        -1, "weights", np.array([0.0, 1.0]), np.array([[0.0], [1.0]]), shapes=np.array([1])
    )
    figure = two_parts()
    idle = TransformClip("blink", (face,), 0.0, 1.0)
    # No part of the file contains the second blend shape.
    none = np.zeros(0, dtype=int)
    record = replace(figure.record, part_shapes=(np.array([0]), none), target_names=(("up",), ()))
    figure = replace(figure, record=record)
    notes = export_clips(Actor(figure), tmp_path / "a.glb", clips=[idle, *clips()])
    lost = {note.key: note.values["names"] for note in notes if note.key.startswith("X003.idle")}
    assert lost == {"X003.idle-animations": ["blink"], "X003.idle-shapes": ["wide"]}


def with_extras(name: str, extras: object) -> Actor:
    figure = two_parts()
    return Actor(replace(figure, name=name, record=replace(figure.record, extras=extras)))


def test_different_application_data_is_listed_by_figure(tmp_path: Path) -> None:
    actors = [with_extras("a", {"k": 1}), with_extras("b", [2]), with_extras("c", {"k": 1})]
    plain = with_extras("d", None)
    export_figures([*actors, plain], tmp_path / "some.glb")
    expected = {
        "sources": [
            {"figures": ["a", "c"], "extras": {"k": 1}},
            {"figures": ["b"], "extras": [2]},
        ]
    }
    assert Evaluator(tmp_path / "some.glb").root["extras"] == expected
    # When a file is read back, with or without further figures, only new data is added.
    back = viewer.load(tmp_path / "some.glb").actors
    export_figures(back, tmp_path / "same.glb")
    assert Evaluator(tmp_path / "same.glb").root["extras"] == expected
    export_figures([*back, with_extras("e", 3)], tmp_path / "more.glb")
    more = {"figures": ["e"], "extras": 3}
    assert Evaluator(tmp_path / "more.glb").root["extras"]["sources"] == [
        *expected["sources"],
        more,
    ]


def test_equal_application_data_is_unchanged(tmp_path: Path) -> None:
    export_figures([with_extras("a", {"k": 1}), with_extras("b", {"k": 1})], tmp_path / "a.glb")
    assert Evaluator(tmp_path / "a.glb").root["extras"] == {"k": 1}
