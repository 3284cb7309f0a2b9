"""Pose files: everything in .json, and what .txt cannot hold, with the true difference."""

from pathlib import Path

import faults
import numpy as np
from numpy.testing import assert_array_equal
from seamed import POSITIONS, seamed_actor

from viewer.exporters import export
from viewer.formats import Source, pose
from viewer.rigs.blendshapes import BlendShapes
from viewer.rigs.figure import figure_pose
from viewer.rigs.pose import Pose
from viewer.rigs.posing.pose_record import apply_record
from viewer.rigs.scene import Actor


def posed() -> Actor:
    """Return the roof with every kind of number in its pose."""
    raised = np.zeros((1, *POSITIONS.shape))
    raised[0, 4] = 0.0, 0.0, 4.0
    actor = seamed_actor(unit="m", blend_shapes=BlendShapes(("peak",), raised))
    actor.pose.dofs[:] = 0.1, 0.2, 0.3, -0.4, 0.5, -0.6
    actor.pose.translations[1] = 0.0, 0.25, 0.0
    actor.pose.scales[1] = 1.0, 2.0, 3.0
    actor.pose.rotations[1] = 0.0, 0.6, 0.0, 0.8
    actor.pose.shape_weights[:] = 0.5
    actor.pose.figure_scale, actor.pose.figure_translation[:] = 1.5, [1.0, 0.0, 0.0]
    return actor


def read(actor: Actor, path: Path) -> Pose:
    again = figure_pose(actor.figure)
    assert apply_record(pose.read(Source.open(path)), actor.figure, again) == []
    return again


def test_json_holds_the_whole_pose(tmp_path):
    actor, path = posed(), tmp_path / "out.json"
    assert faults.lines(export(actor, path)) == [f"{path}: 6 DOFs"]
    again = read(actor, path)
    for name in ("dofs", "translations", "scales", "rotations", "shape_weights"):
        assert_array_equal(getattr(again, name), getattr(actor.pose, name))
    assert again.figure_scale == 1.5 and again.figure_translation.tolist() == [1, 0, 0]


def test_text_says_what_it_cannot_hold_and_how_far_that_moves_vertices(tmp_path):
    actor, path = posed(), tmp_path / "out.txt"
    actor.pose.dofs[:] = 0.0
    notes = faults.lines(export(actor, path))
    # In the pose, vertex 4 is at (3, 3, 5), the tip at (1, 0.25, 0), and everything is scaled by
    # 1.5 and moved by 1. In the file, vertex 4 is at (3, 3, 3), and the tip at (1, 0, 0).
    vertex = np.linalg.norm(1.5 * np.array([3, 3, 5]) + [1, 0, 0] - np.array([3, 3, 3]))
    joint = np.linalg.norm(1.5 * np.array([1, 0.25, 0]) + [1, 0, 0] - np.array([1, 0, 0]))
    assert notes[1] == (
        f"{path}: joints differ from the pose by up to {joint:.3g} m (tip); vertices by up to "
        f"{vertex:.3g} m (vertex 4)"
    )
    assert notes[2] == (
        "not stored in .txt: rotations of joints that their DOFs cannot express, shape and "
        "expression, translations of joints, scales of joints, the figure's position, the "
        "figure's scale"
    )
    assert len(notes) == 3
