"""Alignment by a similarity: of axes, boxes, matched points and closest points."""

import numpy as np
import pytest
from autorig.rigged_shapes import tube, turn
from numpy.testing import assert_allclose

from viewer.autorig.alignment.axes_fit import fit_axes
from viewer.autorig.alignment.icp import (
    Triangles,
    capped_rms,
    gaps_between,
    iterate,
    slide,
    trimmed_rms,
)
from viewer.autorig.alignment.similarity import Similarity, fit_similarity
from viewer.autorig.seed import align_boxes
from viewer.errors import RigError
from viewer.rigs.geometry.transform import apply_transform

START = Similarity(1.0, np.eye(3), np.zeros(3), np.ones(3))
FACTORS = np.array([1.2, 1.0, 0.9])


def stretched_sides(rotation):
    positions, triangles = tube()
    moved = positions @ rotation.T * FACTORS + [0.01, 0.02, -0.01]
    return Triangles(positions, triangles, 800), Triangles(moved, triangles, 800)


def test_axes_are_scaled_independently():
    template, target = stretched_sides(np.eye(3))
    found = fit_axes(template, target, START, 20)
    assert_allclose(found.scale * found.factors, FACTORS, atol=1e-6)
    assert_allclose(found.shift, [0.01, 0.02, -0.01], atol=1e-6)
    assert_allclose(np.prod(found.factors), 1.0, atol=1e-12)
    assert (found.rotation == np.eye(3)).all()


def test_tilted_rotation_is_corrected():
    rotation = turn([1, 2, -1], 0.12)
    template, target = stretched_sides(rotation)
    found = fit_axes(template, target, START, 40, rotations=True)
    assert_allclose(found.scale * found.factors, FACTORS, atol=1e-6)
    assert_allclose(found.rotation, rotation, atol=1e-6)
    assert_allclose(found.shift, [0.01, 0.02, -0.01], atol=1e-6)


def test_rotation_is_kept_unless_requested():
    template, target = stretched_sides(turn([1, 2, -1], 0.12))
    assert (fit_axes(template, target, START, 10).rotation == np.eye(3)).all()


def test_boxes_are_aligned_axis_by_axis():
    points = np.array([[0.0, 0, 0], [1, 2, 4], [0.5, 1, 1]])
    onto = np.array([[10.0, 0, -1], [12, 2, 1], [11, 1, 0.9]])
    moved = apply_transform(align_boxes(points, onto), points)
    assert_allclose(moved, [[10.0, 0, -1], [12, 2, 1], [11, 1, -0.5]], atol=1e-12)


def test_axis_along_which_both_are_flat_keeps_its_scale():
    flat = np.array([[0.0, 0, 5], [1, 1, 5]])
    matrix = align_boxes(flat, np.array([[0.0, 0, 7], [2, 3, 7]]))
    assert_allclose(np.diag(matrix)[:3], [2.0, 3.0, 1.0])
    assert_allclose(matrix[2, 3], 2.0)


def test_flat_mesh_is_not_scaled_to_a_solid_one():
    with pytest.raises(RigError) as problem:
        align_boxes(np.array([[0.0, 0, 5], [1, 1, 5]]), np.array([[0.0, 0, 0], [2, 3, 7]]))
    assert str(problem.value) == (
        "alignment of boxes: expected both meshes to extend along z, found 0 and 7"
    )


EXACT = 1e-12


def cloud(count=20):
    return np.random.default_rng(3).normal(size=(count, 3))


def test_fit_recovers_the_similarity():
    rotation, points = turn([1, 2, -1], 2.5), cloud()
    found = fit_similarity(points, 40.0 * points @ rotation.T + [1.0, -2.0, 3.0])
    assert_allclose(found.rotation, rotation, atol=EXACT)
    assert_allclose(found.scale, 40.0, rtol=EXACT)
    assert_allclose(found.shift, [1.0, -2.0, 3.0], atol=1e-10)


def test_fit_never_reflects():
    points = cloud()
    found = fit_similarity(points, points * [-1.0, 1.0, 1.0])
    assert_allclose(np.linalg.det(found.rotation), 1.0, atol=EXACT)


def test_fixed_scale_is_kept_and_rotation_and_translation_fitted():
    # The lengths are 1 and 3; the fit may only move their centre.
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    found = fit_similarity(points, 3.0 * points, scale=1.0)
    assert found.scale == 1.0
    assert_allclose(found.shift, [2 / 3, 2 / 3, 0.0], atol=EXACT)


def test_matrix_scales_after_rotating_and_undo_is_its_inverse():
    similarity = Similarity(2.0, turn([0, 0, 1], np.pi / 2), np.array([1.0, 0, 0]), [1, 2, 0.5])
    assert_allclose(similarity.apply(np.array([1.0, 0, 1])), [1.0, 4.0, 1.0], atol=EXACT)
    assert_allclose(similarity.matrix @ [1, 0, 1, 1], [1.0, 4.0, 1.0, 1.0], atol=EXACT)
    assert_allclose(similarity.undo(similarity.apply(cloud())), cloud(), atol=EXACT)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (np.eye(3)[:2], "alignment: expected 3 or more pairs of points, found 2 and 2"),
        (
            np.array([[0.0, 0, 0], [1, 1, 1], [3, 3, 3]]),
            "alignment: expected points in a plane or in space, found a line",
        ),
    ],
)
def test_pairs_that_do_not_determine_the_rotation_are_refused(points, message):
    with pytest.raises(RigError) as problem:
        fit_similarity(points, points)
    assert str(problem.value) == message


def test_scale_of_coincident_points_is_refused():
    with pytest.raises(RigError) as problem:
        Similarity(0.0, np.eye(3), np.zeros(3), np.ones(3))
    assert str(problem.value) == "alignment: expected a scale above 0, found 0"


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
