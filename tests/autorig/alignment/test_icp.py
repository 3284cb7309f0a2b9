"""Iterated closest points, which must recover known alignments."""

import numpy as np
import pytest
from autorig.rigged_shapes import tube, turn
from numpy.testing import assert_allclose

from viewer.autorig.alignment.icp import (
    Triangles,
    capped_rms,
    gaps_between,
    iterate,
    slide,
    trimmed_rms,
)
from viewer.autorig.alignment.similarity import Similarity

START = Similarity(1.0, np.eye(3), np.zeros(3), np.ones(3))
ROTATION = turn([1, 3, 2], 0.15)


def sides(scale=1.05, triangles=None):
    positions, all_triangles = tube()
    moved = scale * positions @ ROTATION.T + [0.02, -0.03, 0.05]
    chosen = all_triangles if triangles is None else triangles
    return Triangles(positions, all_triangles, 600), Triangles(moved, chosen, 600)


def test_iterate_followed_by_slide_finds_the_alignment_exactly():
    template, target = sides()
    found = slide(template, target, iterate(template, target, START, 10, True), 25, True)
    assert_allclose(found.rotation, ROTATION, atol=1e-9)
    assert_allclose(found.scale, 1.05, atol=1e-9)
    assert_allclose(found.shift, [0.02, -0.03, 0.05], atol=1e-9)


@pytest.mark.slow
def test_iterate_converges_monotonically_without_slide():
    template, target = sides()
    errors = [
        trimmed_rms(
            gaps_between(template, target, iterate(template, target, START, n, True)).towards
        )
        for n in (0, 5, 20)
    ]
    assert errors[0] > 2 * errors[1] > 3 * errors[2]


def test_fixed_scale_is_kept():
    template, target = sides(scale=1.0)
    found = slide(template, target, iterate(template, target, START, 10, False), 25, False)
    assert found.scale == 1.0
    assert_allclose(found.rotation, ROTATION, atol=1e-9)


@pytest.mark.slow
def test_holes_do_not_attract_points():
    positions, triangles = tube()
    heights = positions[triangles][:, :, 1].mean(axis=1)
    template, target = sides(triangles=triangles[heights < 1.3])
    found = slide(template, target, iterate(template, target, START, 20, True), 25, True)
    assert_allclose(found.rotation, ROTATION, atol=1e-6)
    assert_allclose(found.scale, 1.05, atol=1e-6)


def test_border_edges_are_not_correspondences():
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    side = Triangles(square, np.array([[0, 1, 2], [0, 2, 3]]), 10)
    found = side.find(np.array([[0.5, 0.2, 0.3], [0.5, -0.4, 0.0], [0.5, 0.5, 1.0]]))
    # The last point is over the diagonal, which both triangles share.
    assert found.usable.tolist() == [True, False, True]
    assert_allclose(found.positions[1], [0.5, 0.0, 0.0])


def test_trimmed_rms_ignores_the_largest_distances():
    assert trimmed_rms(np.array([3.0, 4.0, *[0.0] * 7, 1000.0])) == pytest.approx(5 / 3)


def test_uniform_shell_has_uniform_distances():
    plane = np.array([[0.0, 0, 0], [10, 0, 0], [0, 10, 0]])
    one = np.array([[0, 1, 2]])
    template, target = (
        Triangles(plane, one, 100),
        Triangles(plane + np.array([0, 0, 0.5]), one, 100),
    )
    gaps = gaps_between(template, target, START)
    for whole, uneven in ((gaps.towards, gaps.uneven_towards), (gaps.away, gaps.uneven_away)):
        assert_allclose(whole, 0.5, atol=1e-12)
        assert_allclose(uneven, 0.0, atol=1e-12)
    assert_allclose(capped_rms(np.array([3.0, 9.0]), 4.0), np.sqrt(12.5))
