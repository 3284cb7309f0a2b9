"""Several figures and several motions in one file."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from exporters.stretched import POSITIONS, chain
from exporting import export_clips, export_figures
from formats.gltf.spec_evaluator import Evaluator
from numpy.testing import assert_allclose
from two_parts import clips, two_parts

import viewer
from viewer.errors import RigError
from viewer.exporters import ExportOptions, Part, Selection, export
from viewer.rigs.captures.cameras import CameraView
from viewer.rigs.motion.evaluation import frames_of, pose_of
from viewer.rigs.motion.sampled_animation import upright_animation
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.motion.transform_clip import TransformChannel, TransformClip
from viewer.rigs.scene import Actor, Scene, pose_actors
from viewer.rigs.skinning import deform

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
def test_figures_are_placed_as_in_the_scene(tmp_path, optimizes, up):
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


def test_written_figures_are_read_as_several_actors(tmp_path):
    actors, path = [Actor(two_parts()), other()], tmp_path / "both.glb"
    export_figures(actors, path)
    scene = viewer.load(path)
    assert len(scene.actors) == 2
    expected = [posed(actor, 1, 0.0) for actor in actors]  # no joint has moved at this time
    found = [deform(actor.figure, actor.pose)[0] for actor in scene.actors]
    for one, two in zip(found, expected, strict=True):
        assert_allclose(np.ptp(one, axis=0), np.ptp(two, axis=0), atol=SINGLE)


@pytest.mark.parametrize("units", [("m", "cm"), ("cm", "m"), ("cm", "cm")])
def test_sizes_are_in_metres_whatever_the_unit_of_the_scene(tmp_path, units):
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


def test_animations_of_different_length_remain_separate(tmp_path):
    longer = [replace(clip, end=clip.end + 1.0) for clip in clips()]
    actors, path = [Actor(two_parts()), Actor(two_parts())], tmp_path / "both.glb"
    export_figures(actors, path, [clips(), longer])
    names = [each["name"] for each in Evaluator(path).root["animations"]]
    assert names == ["wave", "jump", "wave", "jump"]


def test_cameras_are_read_back(tmp_path):
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
    selection = Selection([Part(Actor(two_parts()))], Scene([], views=(view, lens)))
    lost = "2 cameras are not written: front, lens"
    for name, is_lost in (("seen.obj", True), ("seen_{person}.glb", True), ("all.glb", False)):
        texts = [str(note) for note in export(selection, tmp_path / name)]
        assert (lost in texts) == is_lost
    assert viewer.load(tmp_path / "seen_1.glb").views == ()


def test_animations_without_effect_are_reported(tmp_path):
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


def test_different_application_data_is_listed_by_figure(tmp_path):
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


def test_equal_application_data_is_unchanged(tmp_path):
    export_figures([with_extras("a", {"k": 1}), with_extras("b", {"k": 1})], tmp_path / "a.glb")
    assert Evaluator(tmp_path / "a.glb").root["extras"] == {"k": 1}


SINGLE_OF_MOTIONS = 8e-6  # metres: 1e-6 of the size of the scene
RATE = 10.0
# Rotated by 90 degrees about y and moved; a z-up figure stands in the scene.


def moving(name: str, present: list[bool], step: float) -> SampledClip:
    """Return a motion that advances by ``step`` along x and 0.1 radians about z per frame."""
    rows = np.arange(sum(present), dtype=float)
    rotations = np.zeros((len(rows), 3, 4))
    rotations[..., 3] = 1.0
    rotations[:, 0, 2], rotations[:, 0, 3] = np.sin(0.05 * rows), np.cos(0.05 * rows)
    place = rows[:, None] * [step, 0.0, 0.0]
    there = np.where(present, np.cumsum(present) - 1, -1)
    return SampledClip(name, Timing(RATE, there, holds=False), rotations, None, place)


def expected(actor: Actor, row: float, step: float) -> np.ndarray:
    """Return the vertices in the scene: those of the chain lie on its y axis."""
    height, angle = POSITIONS[:, 1], 0.1 * row
    x, y = step * row - height * np.sin(angle), height * np.cos(angle)
    points = np.stack([x, y, 0.0 * x], axis=1)
    return points @ actor.placement[:3, :3].T + actor.placement[:3, 3]


def crowd() -> Scene:
    """Return a chain, one in centimetres and with z up that begins 0.25 s later, and a still one.

    The second one is absent in its third frame.
    """
    first = Actor(chain(), clip=moving("take", [True] * 5, 1.0), person=4, color=(0.5, 0.25, 0.0))
    tall = replace(chain("cm"), name="tall", up="z")
    clip = moving("take", [True, True, False, True], 0.5)
    second = Actor(tall, clip=clip, placement=PLACED @ UP, offset=0.25, person=7)
    aside = np.eye(4)
    aside[:3, 3] = -1.0, 0.0, 4.0
    return Scene([first, second, Actor(replace(chain(), name="post"), placement=aside)])


def write(scene: Scene, path: Path, **options: str) -> list:
    chosen = ExportOptions(**options)
    parts = [Part(each, None, *upright_animation(scene, each)) for each in scene.actors[:2]]
    parts += [Part(each) for each in scene.actors[2:]]
    return export(Selection(parts, scene), path, options=chosen)


def apart(one: np.ndarray, two: np.ndarray) -> float:
    """Return the largest distance from a point to the nearest one of the other set."""
    each = np.linalg.norm(one[:, None] - two, axis=2)
    return max(each.min(axis=0).max(), each.min(axis=1).max())


def test_one_animation_moves_all_figures_as_in_the_scene(tmp_path):
    scene, path = crowd(), tmp_path / "crowd.glb"
    notes = write(scene, path)
    plain = Evaluator(path)
    assert [each["name"] for each in plain.root["animations"]] == ["take"]
    first, second, post = scene.actors
    # The second figure begins after 2.5 frames of the first, and holds its pose in the gap.
    for time, one, two in ((0.0, 0, 0), (0.25, 2.5, 0), (0.35, 3.5, 1), (0.45, 4, 1), (0.55, 4, 2)):
        points = [expected(first, one, 1.0), expected(second, two, 0.5), expected(post, 0, 0.0)]
        found = np.concatenate(plain.meshes(0, time))
        assert apart(found, np.concatenate(points)) < SINGLE_OF_MOTIONS, time
    named = {plain.nodes[root].get("name") for root in plain.scene_roots()}
    assert {"tall 7", "post"} <= named
    (summary,) = [note for note in notes if note.code == "X001"]
    assert summary.key == "X001.gltf-motions"
    assert summary.values["figures"] == ["chain 4", "tall 7", "post"]
    assert summary.values["seconds"] == pytest.approx(0.55, abs=1e-12)
    (gap,) = [note for note in notes if note.code == "X004"]
    assert gap.values["figure"] == "tall 7"
    assert not [note for note in notes if note.code == "X002"]


@pytest.mark.parametrize("unit", ["m", "cm"])
def test_sizes_are_in_metres_whatever_figure_is_written_first(tmp_path, unit):
    # The moving figure is written first; the scene has the unit of the still one.
    other, factor = ("cm", 0.01) if unit == "m" else ("m", 100.0)
    scaled = np.diag([factor, factor, factor, 1.0])
    clip = moving("take", [True] * 3, 1.0)
    mover = Actor(chain(other), clip=clip, placement=scaled)
    scene = Scene([Actor(replace(chain(unit), name="post")), mover])
    parts = [Part(mover, None, *upright_animation(scene, mover)), Part(scene.actors[0])]
    export(Selection(parts, scene), tmp_path / "both.glb")
    found = np.concatenate(Evaluator(tmp_path / "both.glb").meshes(0, 0.1))
    metres = 1.0 if unit == "m" else 0.01
    points = np.concatenate([expected(scene.actors[0], 0, 0.0), expected(mover, 1, 1.0)])
    assert apart(found, metres * points) < SINGLE_OF_MOTIONS


def test_figures_are_read_back_as_actors_with_their_motions(tmp_path):
    scene, path = crowd(), tmp_path / "crowd.glb"
    write(scene, path)
    found = viewer.load(path)
    assert len(found.actors) == 3
    moved = [actor for actor in found.actors if actor.clip is not None]
    for time, rows in ((0.0, (0, 0)), (0.25, (2.5, 0)), (0.35, (3.5, 1)), (0.55, (4, 2))):
        points = []
        for actor in moved:
            pose_actors([actor], time)
            points.append(deform(actor.figure, actor.pose)[0])
        places = zip(scene.actors, rows, (1.0, 0.5), strict=False)
        wanted = np.concatenate([expected(actor, row, step) for actor, row, step in places])
        assert apart(np.concatenate(points), wanted) < SINGLE_OF_MOTIONS, time


def test_equal_meshes_are_written_once(tmp_path):
    scene = crowd()
    twins = Scene([scene.actors[0], replace(scene.actors[0], person=5)])
    write(twins, tmp_path / "twins.glb")
    root = Evaluator(tmp_path / "twins.glb").root
    used = [mesh["primitives"][0]["attributes"]["POSITION"] for mesh in root["meshes"]]
    assert len(used) == 2 and len(set(used)) == 1
    samplers = root["animations"][0]["samplers"]
    assert len({sampler["input"] for sampler in samplers}) == 1


def test_motions_with_different_names_get_the_name_of_the_file(tmp_path):
    scene = crowd()
    scene.actors[1].clip = moving("other", [True] * 3, 0.5)
    write(scene, tmp_path / "both.glb")
    assert [each["name"] for each in read_root(tmp_path / "both.glb")["animations"]] == ["both"]


def read_root(path: Path) -> dict:
    return Evaluator(path).root


def test_colours_of_actors_are_written(tmp_path):
    write(crowd(), tmp_path / "a.glb")
    colours = [
        each["pbrMetallicRoughness"]["baseColorFactor"]
        for each in read_root(tmp_path / "a.glb")["materials"]
    ]
    assert [0.5, 0.25, 0.0, 1.0] in colours


def test_pairs_of_files_are_written(tmp_path):
    write(crowd(), tmp_path / "a.gltf")
    assert {path.name for path in tmp_path.iterdir()} == {"a.gltf", "a.bin"}
    assert len(Evaluator(tmp_path / "a.gltf").root["skins"]) == 3


def test_unknown_handling_of_gaps_is_refused(tmp_path):
    with pytest.raises(RigError):
        write(crowd(), tmp_path / "a.glb", gaps="none")
    assert not [*tmp_path.iterdir()]


def test_animations_that_are_not_played_are_reported(tmp_path):
    figure = two_parts()
    played = Actor(figure, clip=figure.animations[1].clip(), animation=1)
    scene = Scene([crowd().actors[0], played])
    notes = write(scene, tmp_path / "both.glb")
    (lost,) = [each for each in notes if "other animation" in str(each)]
    assert lost.values["figure"] == "bender"
    assert lost.values["remark"].values["names"] == ["wave"]
