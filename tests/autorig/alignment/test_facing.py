"""Figures whose front and back look alike: both facings are fitted, and a close second is said."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from autorig.rigged_shapes import mesh_of
from autorig.test_anatomy import ball_chain, both, mesh
from numpy.testing import assert_allclose

from viewer.autorig.alignment import posed_alignment
from viewer.autorig.alignment.posed_alignment import align_posed
from viewer.autorig.alignment.surface_alignment import AlignmentSettings, misfit
from viewer.loading import bundled_body, load
from viewer.rigs.geometry.rotation import rotation_vector_to_matrix
from viewer.rigs.pose import rest_pose


def robot():
    """Return a person without feet whose front and back are mirror images, 1.45 high."""
    parts = [
        ball_chain((0, 0.65, 0, 0.12), (0, 1.0, 0, 0.12)),
        ball_chain((0, 1.05, 0, 0.05), (0, 1.24, 0, 0.05)),
        [(0, 1.3, 0, 0.12)],
        *both((0.1, 0.6, 0, 0.07), (0.1, 0.05, 0, 0.06)),
        *both((0.15, 1.0, 0, 0.05), (0.6, 1.0, 0, 0.045)),
    ]
    return mesh_of(*mesh(*parts))


@pytest.fixture(scope="module")
def twins():
    """The bundled body, fitted to the robot."""
    figure = load(bundled_body()).actors[0].figure
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("viewer.autorig.alignment.pose_fit._VERTICES", 250)
        patch.setattr("viewer.autorig.alignment.pose_fit._ROUNDS", 16)
        patch.setattr("viewer.autorig.alignment.pose_fit._NEARING", 10)
        settings = AlignmentSettings(samples=125)
        return align_posed(figure, rest_pose(figure.skeleton), robot(), settings, fits=True)


def ahead(found):
    """Return the direction in which a fit of the bundled body, which faces +z, faces."""
    return found.alignment.similarity.rotation @ [0, 0, 1]


def questions(found):
    return [line for line in found.lines if line.key == "R004.facing"]


def test_front_and_back_that_look_alike_are_both_fitted(twins):
    # The usual front of such files comes first.
    assert (twins.front, twins.other.front) == ("z", "-z")
    assert_allclose(ahead(twins), [0, 0, 1], atol=0.2)
    assert_allclose(ahead(twins.other), [0, 0, -1], atol=0.2)
    # The only difference between both fits is that the template is no mirror image of itself.
    gaps = [100 * misfit(fit.alignment, False) for fit in (twins, twins.other)]
    assert 0.8 < gaps[0] / gaps[1] < 1.25
    (line,) = questions(twins)
    assert line.severity == "warning" and twins.alike is line
    assert str(line) == (
        f"front and back look alike (facing z leaves a gap of {gaps[0]:.2f} % of the size, "
        f"facing -z {gaps[1]:.2f} %), so check the front, and if it is -z, specify --facing -z"
    )
    assert twins.other.other is None and twins.other.alike is None


def tilted(fit, angle):
    """Return a fit of the template pitched by an angle in degrees, so that it faces up or down."""
    alignment = fit.alignment
    turn = rotation_vector_to_matrix(np.radians([angle, 0.0, 0.0]))
    turned = replace(alignment.similarity, rotation=turn @ alignment.similarity.rotation)
    even = replace(alignment, similarity=turned, uneven=(0.01, 0.01))
    return replace(fit, alignment=even, lines=(), front="", other=None)


def test_fit_that_leans_faces_no_axis_along_the_way_up(twins):
    # After 80 degrees about x, +z has become about -y and -z about +y; level parts keep their side.
    job = SimpleNamespace(
        template=twins.figure, pose=rest_pose(twins.figure.skeleton), settings=AlignmentSettings()
    )
    fits = [tilted(fit, 80.0) for fit in (twins, twins.other)]
    assert [ahead(fit)[1] < -0.9 for fit in fits] == [True, False]
    found = posed_alignment._with_other(job, *fits)
    assert (found.front, found.other.front) == ("z", "-z")
    # Both fits face the same side: there is nothing to ask.
    assert posed_alignment._with_other(job, fits[0], fits[0]).other is None


@pytest.mark.parametrize(
    ("feet", "gap", "is_asked"),
    [(False, 0.0125, True), (False, 0.016, False), (True, 0.0125, False)],
)
def test_only_a_close_second_that_feet_do_not_exclude_is_asked_about(twins, feet, gap, is_asked):
    figure = twins.figure
    job = SimpleNamespace(
        template=figure, pose=rest_pose(figure.skeleton), settings=AlignmentSettings()
    )
    fits = []
    for sign, each, size in ((1.0, twins, 0.01), (-1.0, twins.other, gap)):
        start = SimpleNamespace(
            is_sure=feet, is_usual=sign > 0, plan=SimpleNamespace(left=np.array([sign, 0, 0]))
        )
        alignment = replace(each.alignment, uneven=(size, size), away=0.01)
        fits.append((start, replace(each, alignment=alignment, lines=(), front="", other=None)))
    found = posed_alignment._best_of_limbs(job, fits)
    assert_allclose(ahead(found), ahead(twins))
    assert (found.other is not None) == is_asked == bool(questions(found))
