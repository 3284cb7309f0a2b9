"""Inputs of the checks: figure size and default limits."""

import numpy as np
import pytest
from lint.sound import column, legs, make_mesh

from viewer.lint import MAX_ROTATION, LintOptions, Subject
from viewer.rig.captures.points import PointLayout
from viewer.rig.figure import Figure
from viewer.rig.scene import Actor


def cube(*strays: list[float]) -> Figure:
    """Return 5 x 5 x 5 points from 0 to 4 with a diagonal of 4 sqrt(3), and stray points."""
    axis = np.arange(5.0)
    points = np.stack(np.meshgrid(axis, axis, axis), axis=-1).reshape(-1, 3)
    return Figure("cube", make_mesh(np.array([*points, *strays]), [[0, 1, 5]]))


def test_size_is_the_diagonal_of_the_mesh_or_of_the_joints() -> None:
    assert Subject(Actor(column())).size() == pytest.approx(np.sqrt(4 + 16 + 4))
    # The hips are 0.2 apart, the ankles 0.9 below the pelvis, all at one depth.
    assert Subject(Actor(legs())).size() == pytest.approx(np.hypot(0.2, 0.9))
    marks = Figure("marks", points=PointLayout("dots", ("a",), np.zeros((0, 2)), np.zeros(1)))
    assert Subject(Actor(marks)).size() == 0.0


def test_stray_vertices_do_not_affect_the_size() -> None:
    assert Subject(Actor(cube([500.0, 500.0, 500.0]))).size() == pytest.approx(4 * np.sqrt(3))
    # A vertex at a small distance is included, because it may be intended.
    assert Subject(Actor(cube([20.0, 0.0, 0.0]))).size() == pytest.approx(np.sqrt(400 + 16 + 16))


def test_relative_lengths_ignore_stray_vertices() -> None:
    subject = Subject(Actor(cube([500.0, 500.0, 500.0])))
    assert subject.length(0.4 * np.sqrt(3)) == "0.693 units (10 % of its size)"


def test_largest_rotation_is_reported_in_degrees() -> None:
    assert MAX_ROTATION == 3400.0
    assert np.degrees(LintOptions().max_rotation) == pytest.approx(MAX_ROTATION)
