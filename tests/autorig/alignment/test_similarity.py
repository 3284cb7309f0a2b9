"""Similarities, fitted to generated and hand-calculated pairs of points."""

import numpy as np
import pytest
from autorig.rigged_shapes import turn
from numpy.testing import assert_allclose

from viewer.autorig.alignment.similarity import Similarity, fit_similarity
from viewer.errors import RigError

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
