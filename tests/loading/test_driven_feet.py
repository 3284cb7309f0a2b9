"""Feet of figures driven by a file, and the option ``--feet``."""

import numpy as np
import pytest
from exporting import export_frames
from faults import told
from rig.retargeting.rest_twins import t_pose, written
from rig.retargeting.walking import RATE, walk

from viewer.cli import run
from viewer.export import ExportOptions
from viewer.loading import MotionSettings, bundled_body, load
from viewer.rig.motion.sampled_animation import sample_animation
from viewer.rig.scene import Actor


@pytest.fixture(scope="module")
def walking(tmp_path_factory):
    path = tmp_path_factory.mktemp("walk") / "walk.bvh"
    motion = written(t_pose(), *walk(), rate=RATE)
    actor = Actor(motion.figure, clip=motion.clip)
    export_frames(sample_animation(actor), path, "bvh", ExportOptions())
    return path


def feet_notes(scene):
    return [key for key, _ in told(scene.diagnostics) if ".feet-" in key]


def test_feet_are_planted_by_default(walking):
    (planted,) = load(walking, bundled_body()).actors
    plain = load(walking, bundled_body(), motion=MotionSettings(feet=False))
    assert feet_notes(plain) == []
    legs = [planted.figure.skeleton.names.index(f"left_{part}") for part in ("knee", "hip")]
    rotations = plain.actors[0].clip.rotations
    assert np.abs(planted.clip.rotations - rotations)[:, legs].max() > 1e-3
    named = load(walking, motion=MotionSettings(model=bundled_body()))
    assert feet_notes(named)[:2] == ["F007.feet-planted", "F007.feet-gap"]
    np.testing.assert_array_equal(named.actors[0].clip.rotations, planted.clip.rotations)


@pytest.mark.slow
def test_option_and_note_are_the_same_in_every_command(walking, capsys):
    out = str(walking.with_name("out.bvh"))
    for words, is_said in ((), True), (("--feet", "on"), True), (("--feet", "off"), False):
        assert run(["convert", str(walking), "--body", "-o", out, "--force", *words]) == 0
        assert ("feet of body planted during 6 contacts" in capsys.readouterr().err) is is_said
    assert run(["render", str(walking), "--feet", "no", "-o", "x.png"]) == 2
    assert "--feet" in capsys.readouterr().err
