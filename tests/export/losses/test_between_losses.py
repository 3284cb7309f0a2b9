"""Reported losses between frames of keyed curves, as the maximum over all times."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from exporting import export_frames
from rig import hand_made

from viewer.diagnostics import Diagnostic
from viewer.export import ExportOptions
from viewer.rig.figure import Figure
from viewer.rig.mesh import Mesh
from viewer.rig.motion.clip import Channel, Clip, evaluate
from viewer.rig.motion.sampled_animation import SampledAnimation, sample_animation
from viewer.rig.scene import Actor
from viewer.rig.skin import skin_from_lists

TOLD = 5e-3  # messages have three digits


def write(animation: SampledAnimation, folder: Path, kind: str, name: str) -> list[Diagnostic]:
    return export_frames(animation, folder / name, kind, ExportOptions())


def swinging(extrapolation=("constant", "constant"), end=4.0, times=(0.0, 1, 2, 3, 4)) -> Actor:
    """Return an arm of a metre that swings about z by 2 radians, with one key per second."""
    rows = [(0, kind, 0.0) for kind in ("tx", "ty", "tz", "x", "y", "z")]
    rows += [(1, kind, 0.0) for kind in ("x", "y", "z")]
    skeleton = hand_made.skeleton([-1, 0], rows, None, [[0.0] * 3, [1.0, 0, 0]])
    values = np.array([0.0, 2, 0, -2, 0])[: len(times)]
    pairs = (("smooth", "smooth"),) * len(times)
    turn = Channel(5, np.array(times, dtype=float), values, pairs, extrapolation)
    others = [Channel(dof, np.zeros(0), np.zeros(0), ()) for dof in (0, 1, 2, 3, 4, 6, 7, 8)]
    channels = (*others[:5], turn, *others[5:])
    return Actor(Figure("arm", skeleton=skeleton), clip=Clip("swing", channels, 0.0, end))


def densest(actor: Actor, rate: float) -> float:
    """Return the distance of the arm tip from linear interpolation of angles, sampled at 20 kHz."""
    times = np.linspace(0.0, actor.clip.end, int(actor.clip.end * 20000) + 1)
    frames = np.arange(int(np.floor(actor.clip.end * rate + 1e-9)) + 1) / rate
    times = times[times <= frames[-1]]
    turn = actor.clip.channels[5]
    straight = np.interp(times, frames, evaluate(turn, frames))
    return float(np.max(2.0 * np.abs(np.sin(0.5 * (evaluate(turn, times) - straight)))))


def error_between(notes: list[Diagnostic]) -> Diagnostic:
    """Return the only error between frames."""
    between_frames = "the motion between frames"
    (note,) = [note for note in notes if note.values.get("original") == between_frames]
    return note


def between(notes: list[Diagnostic]) -> float:
    """Return the difference of joints between frames, in units."""
    note = error_between(notes)
    assert note.values["estimate"] == ""
    return note.values["joint"].values["distance"]


@pytest.mark.parametrize(("kind", "name"), [("bvh", "a.bvh"), ("gltf", "a.glb")])
def test_loss_between_keys_on_frames_is_reported(tmp_path, kind, name):
    """From 0 to 2 with slopes 2 and 0, the curve is 2 u^2 (1 - u) above the line: 8/27 at 2/3."""
    notes = write(sample_animation(swinging(), 1.0), tmp_path, kind, name)
    assert between(notes) == pytest.approx(2.0 * np.sin(4.0 / 27.0), rel=TOLD)


@pytest.mark.parametrize("rate", [0.99, 2.0, 2.7, 30.0])
def test_loss_between_frames_matches_dense_sampling(tmp_path, rate):
    actor = swinging()
    size = pytest.approx(densest(actor, rate), rel=TOLD)
    assert between(write(sample_animation(actor, rate), tmp_path, "bvh", "a.bvh")) == size


@pytest.mark.parametrize("mode", ["cycle", "cycle_offset", "bounce"])
def test_loss_of_repeating_curves_is_reported(tmp_path, mode):
    """A clip of 40 s repeats three keys within 1.9 s, with kinks and jumps."""
    actor = swinging((mode, mode), 40.0, (0.0, 0.3, 1.9))
    size = pytest.approx(densest(actor, 1.0), rel=TOLD)
    assert between(write(sample_animation(actor, 1.0), tmp_path, "bvh", "a.bvh")) == size


def test_vertex_loss_between_frames_is_reported(tmp_path):
    """The vertex is three metres away from the rotating joint that it follows."""
    actor = swinging()
    mesh = Mesh(np.diag([3.0, 1, 1]), np.eye(3), np.array([[0, 1, 2]]))
    skin = skin_from_lists([[(0, 1.0)]] * 3, np.tile(np.eye(4), (2, 1, 1)))
    figure = replace(actor.figure, mesh=mesh, skin=skin, unit="m")
    notes = write(sample_animation(Actor(figure, clip=actor.clip), 1.0), tmp_path, "gltf", "a.glb")
    note = error_between(notes)
    joint, vertex = note.values["joint"].values, note.values["vertex"].values
    size = 2.0 * np.sin(4.0 / 27.0)
    assert (joint["joint"], vertex["vertex"]) == ("j1", 0)
    found = [joint["distance"], vertex["distance"]]
    assert found == pytest.approx([size, 3.0 * size], rel=TOLD)


@pytest.mark.slow
def test_motions_too_long_to_check_are_reported(tmp_path):
    """Two minutes at 20 fps have too many frame intervals to sample all."""
    actor = swinging(end=120.0)
    notes = write(sample_animation(actor, 20.0), tmp_path, "bvh", "a.bvh")
    note = error_between(notes)
    assert note.values["estimate"].sentence == "an estimate from {n}"
    assert note.values["joint"].values["distance"] == pytest.approx(densest(actor, 20.0), rel=TOLD)
