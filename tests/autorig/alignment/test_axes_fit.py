"""Fit of a scale along each axis, with the rotation if requested."""

import numpy as np
from autorig.rigged_shapes import tube, turn
from numpy.testing import assert_allclose

from viewer.autorig.alignment.axes_fit import fit_axes
from viewer.autorig.alignment.icp import Triangles
from viewer.autorig.alignment.similarity import Similarity

START = Similarity(1.0, np.eye(3), np.zeros(3), np.ones(3))
FACTORS = np.array([1.2, 1.0, 0.9])


def sides(rotation):
    positions, triangles = tube()
    moved = positions @ rotation.T * FACTORS + [0.01, 0.02, -0.01]
    return Triangles(positions, triangles, 800), Triangles(moved, triangles, 800)


def test_axes_are_scaled_independently():
    template, target = sides(np.eye(3))
    found = fit_axes(template, target, START, 20)
    assert_allclose(found.scale * found.factors, FACTORS, atol=1e-6)
    assert_allclose(found.shift, [0.01, 0.02, -0.01], atol=1e-6)
    assert_allclose(np.prod(found.factors), 1.0, atol=1e-12)
    assert (found.rotation == np.eye(3)).all()


def test_tilted_rotation_is_corrected():
    rotation = turn([1, 2, -1], 0.12)
    template, target = sides(rotation)
    found = fit_axes(template, target, START, 40, rotations=True)
    assert_allclose(found.scale * found.factors, FACTORS, atol=1e-6)
    assert_allclose(found.rotation, rotation, atol=1e-6)
    assert_allclose(found.shift, [0.01, 0.02, -0.01], atol=1e-6)


def test_axes_may_be_those_of_the_template():
    rotation = turn([1, 2, -1], 0.9)
    positions, triangles = tube()
    moved = positions * FACTORS @ rotation.T
    template, target = (Triangles(each, triangles, 800) for each in (positions, moved))
    start = Similarity(1.0, turn([1, 2, -1], 0.85), np.zeros(3), np.ones(3))
    found = fit_axes(template, target, start, 40, rotations=True, own=True)
    assert_allclose(found.scale * found.own_factors, FACTORS, atol=1e-6)
    assert_allclose(found.rotation, rotation, atol=1e-6)
    assert (found.factors == 1.0).all()
    assert_allclose(found.apply(positions), moved, atol=1e-6)
    assert_allclose(found.undo(moved), positions, atol=1e-6)


def test_rotation_is_kept_unless_requested():
    template, target = sides(turn([1, 2, -1], 0.12))
    assert (fit_axes(template, target, START, 10).rotation == np.eye(3)).all()
