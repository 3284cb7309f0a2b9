"""Sampled motions of several figures in one glTF file, compared with closed forms."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from export.stretched import POSITIONS, chain
from formats.gltf.spec_evaluator import Evaluator
from two_parts import two_parts

import viewer
from viewer.errors import RigError
from viewer.export import ExportOptions, Part, Selection, export
from viewer.rig.motion.evaluation import pose_actors
from viewer.rig.motion.sampled_animation import upright_animation
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.motion.timing import Timing
from viewer.rig.scene import Actor, Scene
from viewer.rig.skinning import deform

SINGLE = 8e-6  # metres: 1e-6 of the size of the scene
RATE = 10.0
# Rotated by 90 degrees about y and moved; a z-up figure stands in the scene.
PLACED = np.array([[0.0, 0, 1, 3], [0, 1, 0, 0.5], [-1, 0, 0, 2], [0, 0, 0, 1]])
UP = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])


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
        assert apart(found, np.concatenate(points)) < SINGLE, time
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
    assert apart(found, metres * points) < SINGLE


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
        assert apart(np.concatenate(points), wanted) < SINGLE, time


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


def test_animations_that_are_not_played_are_reported(tmp_path: Path) -> None:
    figure = two_parts()
    played = Actor(figure, clip=figure.animations[1].clip(), animation=1)
    scene = Scene([crowd().actors[0], played])
    notes = write(scene, tmp_path / "both.glb")
    (lost,) = [each for each in notes if "other animation" in str(each)]
    assert lost.values["figure"] == "bender"
    assert lost.values["remark"].values["names"] == ["wave"]
