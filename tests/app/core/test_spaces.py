"""Switching the space of captured people: their positions, cameras, time and selection."""

from dataclasses import replace

import numpy as np
import pytest
from formats.synthetic_smpl import model
from numpy.testing import assert_allclose

from viewer.app.actors.actors_panel import switch_space
from viewer.errors import RigError
from viewer.loading import assembly
from viewer.loading.cleaning import clean_up
from viewer.loading.contents import Contents
from viewer.loading.settings import CleanUp, MotionSettings
from viewer.rigs.captures.cameras import CameraView
from viewer.rigs.captures.capture import Capture, CapturePart
from viewer.rigs.motion.body_motion import BodyMotion
from viewer.rigs.motion.timing import Timing

K = np.array([[100.0, 0.0, 32.0], [0.0, 100.0, 24.0], [0.0, 0.0, 1.0]])
PLACES = {"world": 0.0, "camera": 5.0}


def body(space: str, person: int, first: int) -> BodyMotion:
    """Return a person at z = 0 in world space and z = 5 in camera space."""
    rows = np.where(np.arange(6) >= first, np.arange(6) - first, -1).astype(np.int32)
    count = 6 - first
    places = np.tile([float(person), 0.0, PLACES[space]], (count, 1))
    timing = Timing(30.0, rows, holds=False)
    return BodyMotion("take", timing, ("pelvis",), np.zeros((count, 1, 3)), places, up="y")


def capture(space: str) -> Capture:
    """Return two people; the second appears later, in a second part."""
    parts = (
        CapturePart(2, {0: body(space, 0, 0)}),
        CapturePart(6, {7: body(space, 7, 3)}),
    )
    view = CameraView("video", K, np.eye(3), np.array([0.0, 0.0, 9.0 - PLACES[space]]), (64, 48))
    return Capture("take", 6, 0, lambda: iter(parts), "y", (view,), space=space,
                   in_space=capture)  # fmt: skip


@pytest.fixture
def contents(tmp_path):
    path = tmp_path / "SMPL.npz"
    np.savez(path, **model("smpl"))
    return Contents(captures=[(tmp_path / "take", capture("world"))]), MotionSettings(model=path)


@pytest.fixture
def scene(contents):
    return assembly.assemble(*contents)


def test_scene_offers_both_spaces(scene):
    assert scene.space == "world"
    other = scene.in_space("camera")
    assert other.space == "camera" and other.in_space is not None
    assert [actor.person for actor in other.actors] == [0, 7]
    assert_allclose(other.actors[0].pose.figure_translation[2], 5.0)
    assert_allclose(other.views[0].translation, [0, 0, 4])


def test_switching_the_space_stops_reading_of_captures(contents):
    scene, builders = assembly.begin(*contents)
    assert not builders[0].is_done
    scene.in_space("camera")
    assert builders[0].is_cut


def test_clean_up_also_applies_to_the_other_space(scene):
    clean_up(scene, CleanUp(frames=(1, 5)))
    other = scene.in_space("camera")
    assert other.actors[0].clip.timing.n_frames == 4
    assert "X006.trimmed" in [note.key for note in other.diagnostics]


def test_panel_switches_the_space_and_keeps_time_selection_colour_and_camera(drive, scene):
    driver = drive(scene=scene, size=(1000, 900))
    state = driver.state
    driver.show_panel("Actors")
    state.clock.seek(4 / 30)
    state.select_actor(1)
    state.selected_joint = 3
    state.scene.actors[1].color = (0.1, 0.2, 0.3)
    driver.step(2)
    state.camera.fixed = state.scene.views[0]
    driver.pick("Space", 1)
    assert state.scene.space == "camera"
    assert state.clock.time == pytest.approx(4 / 30)
    assert (state.chosen_actor, state.selected_joint, state.is_actor_selected) == (1, 3, True)
    assert state.actor.person == 7 and state.actor.color == (0.1, 0.2, 0.3)
    assert_allclose(state.actor.pose.figure_translation, [7.0, 0.0, 5.0])
    assert state.camera.fixed is state.scene.views[0]
    driver.pick("Space", 0)
    assert state.scene.space == "world" and state.actor.person == 7


def test_scene_stays_if_its_files_cannot_be_read_again(drive, scene):
    driver = drive(scene=scene)

    def fail(space: str):
        raise RigError("gone")

    driver.state.scene = replace(scene, in_space=fail)
    before = driver.state.scene
    switch_space(driver.state, "camera")
    assert driver.state.scene is before and driver.state.error == "gone"
