"""Feet that were planted or held do not slide: detector and limits are those of the planner."""

import functools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from exporting import export_frames
from rigs.retargeting.rest_twins import t_pose, written
from rigs.retargeting.standing_motions import jump, kneel, treadmill
from rigs.retargeting.test_standing_feet import jerky_walk
from rigs.retargeting.walking import RATE, walk

from viewer.exporters import ExportOptions
from viewer.linting import _running, lint_scene
from viewer.loading import MotionSettings, bundled_body, load
from viewer.loading.cleaning import clean_up
from viewer.loading.settings import CleanUp
from viewer.rigs.geometry.quaternion import multiply, rotation_vector_to_quaternion
from viewer.rigs.motion.sampled_animation import sample_animation
from viewer.rigs.retargeting.driven_feet import plant_feet
from viewer.rigs.retargeting.retarget import retarget
from viewer.rigs.scene import Actor, Scene

MOTIONS = {
    "walk": walk,
    "stairs": lambda: walk(rise=8.0),
    "jump": lambda: jump()[:2],
    "kneel": kneel,
    "treadmill": treadmill,
    "jerky walk": jerky_walk,
}


@pytest.fixture(scope="module")
def path_of(tmp_path_factory):
    """The BVH files of motions by name, each written once."""
    folder = tmp_path_factory.mktemp("motions")

    @functools.cache
    def path_of(name: str) -> Path:
        path = folder / f"{name}.bvh"
        motion = written(t_pose(), *MOTIONS[name](), rate=RATE)
        actor = Actor(motion.figure, clip=motion.clip)
        export_frames(sample_animation(actor), path, "bvh", ExportOptions())
        return path

    return path_of


@pytest.fixture(autouse=True)
def only_feet(monkeypatch):
    """Run the check of feet alone: those of the body take longer."""
    monkeypatch.setattr(_running, "CHECKS", {"feet": _running.CHECKS["feet"]})


def slides(scene: Scene) -> list[str]:
    return [str(found.diagnostic) for found in lint_scene(scene) if found.code == "C007"]


@pytest.mark.parametrize("name", MOTIONS)
def test_planted_feet_do_not_slide(name, path_of):
    scene = load(path_of(name), bundled_body())
    assert any(note.key == "F007.feet-planted" for note in scene.diagnostics)
    assert slides(scene) == []


@pytest.mark.parametrize("name", MOTIONS)
def test_locked_feet_of_a_capture_do_not_slide(name, path_of):
    scene = load(path_of(name), bundled_body(), motion=MotionSettings(feet=False))
    assert "X006.locked" in {note.key for note in clean_up(scene, CleanUp(locks_feet=True))}
    assert slides(scene) == []


def test_feet_of_short_legs_do_not_slide_where_those_of_the_motion_are_lifted(
    shared_data: Path, path_of
) -> None:
    knight = shared_data / "rigging" / "animated" / "kk_knight.glb"
    scene = load(path_of("kneel"), knight)
    (actor,) = scene.actors
    assert any(note.key == "F007.feet-planted" for note in scene.diagnostics)
    actor.figure = replace(actor.figure, animations=())  # other motions of its file
    assert slides(scene) == []


@pytest.mark.parametrize("seed", range(3))
def test_feet_on_a_treadmill_are_held_under_noise(seed, path_of):
    scene = load(path_of("treadmill"), bundled_body(), motion=MotionSettings(feet=False))
    (actor,), rng = scene.actors, np.random.default_rng(seed)
    clip = actor.clip
    turns = np.radians(0.5) * rng.normal(size=(*clip.rotations.shape[:2], 3))
    shakes = 0.004 * rng.normal(size=(clip.n_rows, 3))  # metres
    actor.clip = replace(
        clip,
        rotations=multiply(clip.rotations, rotation_vector_to_quaternion(turns)),
        figure_translations=clip.figure_translations + shakes,
    )
    clean_up(scene, CleanUp(locks_feet=True))
    assert slides(scene) == []


def test_feet_that_do_not_follow_their_legs_are_not_planted():
    """Of a rig for animators, whose feet are controls below the root."""
    figure = load(bundled_body()).actors[0].figure
    parents = figure.skeleton.parents.copy()
    parents[[figure.skeleton.names.index(f"{side}_ankle") for side in ("left", "right")]] = 0
    figure = replace(figure, skeleton=replace(figure.skeleton, parents=parents))
    motion = written(t_pose(), *walk(), rate=RATE)
    found = retarget(motion, figure)
    assert plant_feet(found, figure) == (found.clip, None)


def test_planted_feet_of_shared_motions_do_not_slide(shared_data):
    assert slides(load(shared_data / "motion" / "makehuman" / "walk1.bvh", bundled_body())) == []
