"""Exports of keyed transforms: scales of joints, rates of keys, and limits of formats."""

import numpy as np
import pytest
from builders import family_figure
from exporting import export_frames
from gltf_files import assert_drawn
from plain_bvh import PlainBvh
from plain_gltf import Gltf
from rigs.animated import NAMES, about, bow, channel, clip_of, leg, wave

from viewer.exporters import ExportOptions
from viewer.rigs.figure import Figure
from viewer.rigs.motion.evaluation import pose_of, world_frames
from viewer.rigs.motion.sampled_animation import sample_animation
from viewer.rigs.scene import Actor
from viewer.rigs.skeleton import Skeleton

GROWS = channel(1, "scale", [0.0, 1.0], [[1.0, 1, 1], [2, 0.5, 1]])


def written(animation, path, kind):
    """Return the notes of an export by key; all of them can be shown."""
    notes = export_frames(animation, path, kind, ExportOptions())
    assert all(str(note) for note in notes)
    return {note.key: note for note in notes}


def test_gltf_animates_scales_translations_and_weights(tmp_path):
    animation = sample_animation(Actor(leg(), clip=wave()))
    path = tmp_path / "leg.glb"
    written(animation, path, "gltf")
    gltf = Gltf(path)
    for frame in (0, 1, 17, 44, 60):
        pose = pose_of(animation.figure, animation.frames, frame)
        assert_drawn(gltf, animation.figure, pose, time=frame / 30.0)
    (played,) = gltf.root["animations"]
    found = [
        (gltf.nodes[one["target"]["node"]]["name"], one["target"]["path"])
        for one in played["channels"]
        if one["target"]["path"] != "rotation"
    ]
    assert found == [("hip", "translation"), ("knee", "scale"), ("leg mesh", "weights")]


def test_frames_have_the_rate_of_the_keys(tmp_path):
    animation = sample_animation(Actor(leg(), clip=bow()))
    found = written(animation, tmp_path / "bow.glb", "gltf")
    assert found["X001.gltf-motion"].values["rate"] == 24.0
    # Linear keys at frames are also reproduced between the frames.
    assert not [key for key in found if key.startswith("X002")]


def test_steps_between_frames_are_measured(tmp_path):
    stepped = channel(1, "rotation", [0.0, 0.5], [about(2, 0.0), about(2, 90.0)], "step")
    animation = sample_animation(Actor(leg(), clip=clip_of(stepped)))
    found = written(animation, tmp_path / "step.glb", "gltf")
    assert [key for key in found if key.startswith("X002")]


def test_bvh_represents_scales_by_positions_and_reports_the_loss(tmp_path):
    animation = sample_animation(Actor(leg(), clip=clip_of(GROWS)))
    found = written(animation, tmp_path / "leg.bvh", "bvh")
    lost = found["X003.bvh-joint-scales"].values
    assert (lost["low"], lost["high"]) == (0.5, 2.0)
    assert "scales of joints (0.5 to 2)" in str(found["X003.bvh-joint-scales"])
    bvh = PlainBvh(tmp_path / "leg.bvh")
    places = world_frames(animation.figure, animation.frames)[..., :3, 3]
    for frame in (0, 12, 30):
        found = bvh.places(frame)
        wanted = 100.0 * places[frame]
        np.testing.assert_allclose([found[name] for name in NAMES], wanted, atol=1e-3)


def course_rig() -> Figure:
    every = np.arange(2)
    return Figure("rig", skeleton=Skeleton(
        ("a", "b"), [-1, 0], [[0.0, 0, 0], [0, 1, 0]], [[0.0, 0, 0, 1]] * 2, np.ones((2, 3)),
        [0, 0, 0, *np.repeat(every, 3)], [0, 1, 2, *np.tile([3, 4, 5], 2)], np.zeros(9),
        np.tile([-np.inf, np.inf], (9, 1)),
    ))  # fmt: skip


def test_anim_reports_lost_scales(tmp_path):
    animation = sample_animation(Actor(course_rig(), clip=clip_of(GROWS)))
    found = written(animation, tmp_path / "rig.anim", "anim")
    assert found["X003.clip-joint-scales"].values == {"low": 0.5, "high": 2.0}


def test_amass_reports_lost_scales(tmp_path):
    figure = family_figure("smpl", tmp_path)
    turn = channel(0, "rotation", [0.0, 1.0], [about(1, 0.0), about(1, 90.0)])
    animation = sample_animation(Actor(figure, clip=clip_of(GROWS, turn)))
    found = written(animation, tmp_path / "body.npz", "amass")
    assert found["X003.body-joint-scales"].values == {"low": 0.5, "high": 2.0}
    still = sample_animation(Actor(figure, clip=clip_of(turn)))
    assert "X003.body-joint-scales" not in written(still, tmp_path / "still.npz", "amass")


@pytest.mark.parametrize("kind", ["bvh", "gltf"])
def test_scales_at_rest_are_not_lost(tmp_path, kind):
    animation = sample_animation(Actor(leg(), clip=bow()))
    found = written(animation, tmp_path / f"bow.{'glb' if kind == 'gltf' else kind}", kind)
    assert not [key for key in found if "joint-scales" in key]
