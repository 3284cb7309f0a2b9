"""Alignment by search, by landmarks or as given, and its report; skipped if unnecessary."""

import numpy as np
import pytest
from autorig.rigged_shapes import tube, turn
from numpy.testing import assert_allclose

from viewer.autorig.alignment.similarity import Similarity
from viewer.autorig.alignment.surface_alignment import (
    Alignment,
    AlignmentSettings,
    Posed,
    align,
    alignment_lines,
    similarity_of,
)
from viewer.errors import RigError
from viewer.progress import Cancelled, receiving
from viewer.rigs.mesh import vertex_normals

pytestmark = pytest.mark.slow

POSITIONS, TRIANGLES = tube()
# With an eighth of the usual number of points, a search is much faster.
SAMPLES = 125
TEMPLATE = Posed(POSITIONS, TRIANGLES)


def aligned(positions, triangles=TRIANGLES, up="y", **settings):
    settings = {"samples": SAMPLES, **settings}
    return align(TEMPLATE, Posed(positions, triangles), up, AlignmentSettings(**settings))


def test_alignment_of_an_aligned_target_is_unchanged():
    found = aligned(POSITIONS)
    assert found.how == "in place"
    assert (found.similarity.matrix == np.eye(4)).all() and found.error < 1e-12


def test_alignment_of_an_aligned_part_with_an_offset_is_unchanged():
    # The target is like a shirt, the middle of the tube offset by 2 % of its size.
    middle = (POSITIONS[TRIANGLES][:, :, 1] > 0.5).all(axis=1)
    middle &= (POSITIONS[TRIANGLES][:, :, 1] < 1.5).all(axis=1)
    shirt = POSITIONS * [1.06, 1.0, 1.06]
    used, corners = np.unique(TRIANGLES[middle], return_inverse=True)
    found = aligned(shirt[used], corners.reshape(-1, 3).astype(np.int32))
    assert found.how == "in place"
    assert (found.similarity.matrix == np.eye(4)).all()
    assert found.away > 0.05 > found.error


def test_alignment_of_a_shell_is_unchanged_although_a_larger_template_is_nearer():
    # The shell is 2 % of the size away on all sides, so a larger tube would be closer almost
    # everywhere.
    normals = vertex_normals(POSITIONS, TRIANGLES)
    found = aligned(POSITIONS + 0.05 * normals)
    assert found.how == "in place"
    assert (found.similarity.matrix == np.eye(4)).all()
    assert found.error > 0.015 and max(found.uneven) < 0.005


def test_rotated_scaled_and_moved_target_is_found_exactly():
    rotation = turn([0.3, 1, -0.2], 2.0)
    found = aligned(130.0 * POSITIONS @ rotation.T + [5.0, 6.0, 7.0])
    assert found.how == "search" and found.error < 1e-9
    assert_allclose(found.similarity.rotation, rotation, atol=1e-8)
    assert_allclose(found.similarity.scale, 130.0, rtol=1e-8)
    assert_allclose(found.similarity.shift, [5.0, 6.0, 7.0], atol=1e-6)


def test_small_rotation_is_found_although_the_boxes_nearly_agree():
    rotation = turn([0, 1, 0], 0.3)
    found = aligned(POSITIONS @ rotation.T)
    assert found.how == "search"
    assert_allclose(found.similarity.rotation, rotation, atol=1e-8)


def test_template_keeps_its_size_if_requested():
    rotation = turn([0, 1, 0], 0.4)
    found = aligned(POSITIONS @ rotation.T + [0.5, 0, 0], scale="none")
    assert found.similarity.scale == 1.0
    assert_allclose(found.similarity.rotation, rotation, atol=1e-8)


def test_axes_are_scaled_independently_if_requested():
    found = aligned(POSITIONS * [1.15, 1.0, 0.9] + [1.0, 0, 0], scale="axes")
    assert_allclose(found.similarity.scale * found.similarity.factors, [1.15, 1.0, 0.9], atol=0.02)
    assert (found.similarity.factors != 1.0).any()


def test_only_landmarks_are_used_without_refinement():
    rotation = turn([0, 0, 1], 1.1)
    points = POSITIONS[[3, 50, 200, 300]]
    pairs = np.stack([points, 2.0 * points @ rotation.T + [9.0, 0, 0]], axis=1)
    found = aligned(POSITIONS, landmarks=pairs, refines=False)
    assert found.how == "landmarks"
    assert_allclose(found.similarity.rotation, rotation, atol=1e-12)
    assert_allclose(found.similarity.scale, 2.0, rtol=1e-12)


def test_rough_landmarks_are_refined():
    rotation = turn([0, 1, 0], 2.0)
    target = POSITIONS @ rotation.T + [1.0, 2.0, 3.0]
    rough = target[[3, 50, 200, 300]] + np.random.default_rng(1).normal(0, 0.05, (4, 3))
    pairs = np.stack([POSITIONS[[3, 50, 200, 300]], rough], axis=1)
    found = aligned(target, landmarks=pairs)
    assert_allclose(found.similarity.rotation, rotation, atol=1e-8)


def test_given_matrix_is_used_unchanged():
    matrix = np.eye(4)
    matrix[:3, :3] *= 3.0
    matrix[:3, 3] = 1.0
    found = aligned(POSITIONS, matrix=matrix)
    assert found.how == "given"
    assert_allclose(found.similarity.matrix, matrix, atol=1e-12)


def test_cancelling_from_the_report_ends_the_search():
    def receive(done, total, unit, what):
        if done > 30:
            raise Cancelled

    with pytest.raises(Cancelled), receiving(receive):
        aligned(POSITIONS @ turn([0, 1, 0], 0.3).T)


def test_progress_increases():
    fractions = []
    with receiving(lambda done, total, unit, what: fractions.append(done / total)):
        aligned(POSITIONS @ turn([0, 1, 0], 0.3).T)
    assert fractions == sorted(fractions) and fractions[0] == 0.0 and fractions[-1] <= 1.0


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"scale": "some"}, 'scale: expected uniform, axes, none, found "some"'),
        ({"landmarks": np.zeros((0, 2, 3))}, "landmarks: expected 1 or more pairs, found 0"),
        ({"landmarks": np.zeros((3, 3))}, "landmarks: expected shape any x 2 x 3, found 3 x 3"),
    ],
)
def test_invalid_settings_are_refused(settings, message):
    with pytest.raises(RigError) as problem:
        AlignmentSettings(**settings)
    assert str(problem.value) == message


def test_matrices_that_reflect_or_shear_are_refused():
    with pytest.raises(RigError) as problem:
        similarity_of(np.diag([1.0, 1, -1, 1]))
    assert str(problem.value) == ("alignment: expected a matrix without reflection or singularity")
    shear = np.eye(4)
    shear[0, 1] = 0.5
    with pytest.raises(RigError) as problem:
        similarity_of(shear)
    assert str(problem.value) == (
        "alignment: expected a rotation, a shift, and one scale or one along each axis, found a "
        "shear"
    )


def test_matrices_that_stretch_along_axes_of_either_space_are_accepted():
    rotation = turn([1, 2, 3], 0.7)
    stretch, matrix = np.diag([1.2, 1.0, 0.7]), np.eye(4)
    matrix[:3, 3] = 4.0, 5.0, 6.0
    for linear, stretched, plain in (
        (stretch @ rotation, "factors", "own_factors"),
        (rotation @ stretch, "own_factors", "factors"),
    ):
        matrix[:3, :3] = 3.0 * linear
        found = similarity_of(matrix)
        assert_allclose(found.matrix, matrix, atol=1e-12)
        assert_allclose(found.rotation, rotation, atol=1e-12)
        assert_allclose(found.scale * getattr(found, stretched), [3.6, 3.0, 2.1])
        assert (getattr(found, plain) == 1.0).all() and not found.is_plain


@pytest.mark.parametrize(
    ("scale", "angle", "words"),
    [
        (
            1.0,
            0.0,
            "the target already coincides with the template; scale 1, rotation 0.00 degrees",
        ),
        (
            1000.0,
            np.pi / 2,
            "the template is scaled and rotated about the shared origin; scale 1000, "
            "rotation 90.00 degrees",
        ),
    ],
)
def test_report_for_a_shared_origin_states_whether_the_template_was_moved(scale, angle, words):
    similarity = Similarity(scale, turn([1, 0, 0], angle), np.zeros(3), np.ones(3))
    lines = alignment_lines(Alignment(similarity, 0.0, 0.0, (0.0, 0.0), "in place"))
    assert str(lines[0]) == f"alignment: {words}, translation (0, 0, 0)"


def test_report_is_complete_and_warns_of_a_poor_fit():
    similarity = Similarity(2.0, turn([0, 1, 0], np.pi / 2), np.array([1.0, 0, -2]), np.ones(3))
    lines = alignment_lines(Alignment(similarity, 0.05, 0.1, (0.05, 0.1), "search"))
    assert [line.labelled for line in lines] == [
        "alignment: found by matching closest points; scale 2, rotation 90.00 degrees, "
        "translation (1, 0, -2)",
        "alignment error: 5.00 % of the target's size (RMS of the best 90 %), 10.00 % from "
        "template to target",
        "warning: unreliable alignment, with an error above 3 %: specify --up, --facing or "
        "--landmarks, or pose the template like the target (--template-pose)",
    ]
