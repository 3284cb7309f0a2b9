import math

import numpy as np
import pytest

from viewer.autorig.correspondence import MatchSettings, Template, match, sheet_normals
from viewer.autorig.surface.welding import weld
from viewer.errors import RigError

FLAT = Template(
    np.array([[-9.0, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]]), np.array([[0, 1, 2], [0, 2, 3]])
)  # faces +z


def triangle(height=0.0, tilt=0.0, flipped=False):
    """Return a triangle around the z axis, raised and rotated about x; it faces +z or -z."""
    positions = 0.1 * np.array([[1.0, 0, 0], [-0.5, 0.8, 0], [-0.5, -0.8, 0]])
    turn = np.array(
        [[1, 0, 0], [0, math.cos(tilt), -math.sin(tilt)], [0, math.sin(tilt), math.cos(tilt)]]
    )
    corners = [[0, 2, 1]] if flipped else [[0, 1, 2]]
    return weld(positions @ turn.T + [0, 0, height], np.array(corners))


def test_match_accepts_by_distance():
    # 5 % of a size of 10.
    assert match(FLAT, triangle(0.499), 10.0, MatchSettings()).matched.all()
    found = match(FLAT, triangle(0.501), 10.0, MatchSettings())
    assert not found.matched.any()
    np.testing.assert_allclose(found.points.distances, 0.501, atol=1e-12)


def test_match_accepts_by_angle():
    for degrees, expected in ((29.0, True), (31.0, False)):
        found = match(FLAT, triangle(0.3, math.radians(degrees)), 10.0, MatchSettings())
        assert found.matched.tolist() == [expected] * 3
        np.testing.assert_allclose(np.degrees(found.angles), degrees, atol=1e-9)


def test_match_accepts_larger_angles_if_the_surfaces_touch():
    # All corners are within 0.1, which is 0.5 % of 20.
    for degrees, expected in ((59.0, True), (61.0, False)):
        found = match(FLAT, triangle(0.0, math.radians(degrees)), 20.0, MatchSettings())
        assert found.matched.tolist() == [expected] * 3


def test_match_flips_an_inside_out_island():
    found = match(FLAT, triangle(0.3, flipped=True), 10.0, MatchSettings())
    assert found.matched.all()
    assert found.inside_out.tolist() == [0]
    np.testing.assert_allclose(found.angles, 0.0, atol=1e-7)


def test_match_does_not_flip_an_island_that_is_partly_folded_over():
    positions = np.array([[0.0, 0, 0.3], [1, 0, 0.3], [1, 1, 0.3], [0, 1, 0.3], [0.5, 0.9, 0.3]])
    triangles = np.array([[0, 1, 2], [0, 2, 3], [2, 3, 4]])
    # The last triangle covers the others; only vertex 4 faces only down.
    found = match(FLAT, weld(positions, triangles), 10.0, MatchSettings())
    assert found.inside_out.tolist() == []
    assert not found.matched[4] or found.angles[4] < math.radians(30)


def test_match_accepts_flipped_normals_if_requested():
    # A strip of two triangles that face up and two that face down.
    positions = np.array([[x, 0.5 * (x % 2), 0.3] for x in range(6)]) * [0.2, 1, 1]
    mesh = weld(positions, np.array([[0, 2, 1], [1, 2, 3], [2, 3, 4], [3, 5, 4]]))
    as_given = match(FLAT, mesh, 10.0, MatchSettings())
    assert as_given.inside_out.tolist() == []
    # Vertices 0 and 1 have only triangles that face up, 4 and 5 only triangles that face down.
    assert as_given.matched[[0, 1]].tolist() == [True, True]
    assert as_given.matched[[4, 5]].tolist() == [False, False]
    either = match(FLAT, mesh, 10.0, MatchSettings(flipped_normals=True))
    assert either.matched.all()
    np.testing.assert_allclose(either.angles, 0.0, atol=1e-7)


def test_match_uses_only_distance_for_vertices_without_normals():
    positions = np.array([[0.0, 0, 0.4], [3, 3, 0.6], [1, 0, 0], [2, 0, 0], [2, 1, 0]])
    found = match(FLAT, weld(positions, np.array([[2, 3, 4]])), 10.0, MatchSettings())
    assert found.matched.tolist() == [True, False, True, True, True]
    assert found.angles[:2].tolist() == [0.0, 0.0]


def test_match_uses_the_side_of_a_thin_sheet_that_faces_the_same_way():
    # The template is a plate of thickness 0.02; the target is its upper side, sunk below the
    # middle.
    x = np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])
    upper = np.column_stack([x, np.full(4, 0.01)])
    lower = np.column_stack([x, np.full(4, -0.01)])
    plate = Template(
        np.concatenate([upper, lower]), np.array([[0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 7, 6]])
    )
    # An island of two triangles is raised on the far right and sunk on the left.
    target = weld(
        np.array([[-0.5, -0.2, -0.006], [-0.3, -0.2, -0.006], [-0.4, 0.2, -0.006],
                  [0.5, -0.2, 0.01], [0.7, -0.2, 0.01], [0.6, 0.2, 0.01], [0.55, 0.3, 0.01],
                  [0.6, -0.4, 0.01]]),
        np.array([[0, 1, 2], [1, 3, 2], [3, 4, 5], [3, 5, 6], [3, 7, 4]]),
    )  # fmt: skip
    found = match(plate, target, 4.0, MatchSettings())  # the near distance is 0.02
    assert found.inside_out.tolist() == []
    assert found.matched.all()
    np.testing.assert_allclose(found.points.positions[:, 2], 0.01, atol=1e-12)
    np.testing.assert_allclose(found.points.distances[:3], 0.016, atol=1e-12)
    far = match(plate, target, 4.0, MatchSettings(near_distance=0.003))  # 0.012 < 0.016
    assert far.matched.tolist() == [False] * 3 + [True] * 5


def test_normals_of_both_sides_of_a_sheet_cancel_out():
    positions = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 2, 2]])
    normals = sheet_normals(weld(positions, np.array([[0, 1, 2], [0, 2, 1]])))
    assert normals.tolist() == np.zeros((4, 3)).tolist()
    normals = sheet_normals(weld(positions, np.array([[0, 1, 2]])))
    assert normals.tolist() == [[0.0, 0.0, 1.0]] * 3 + [[0.0, 0.0, 0.0]]


def test_template_has_smooth_normals_across_seams():
    positions = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    template = Template(positions, np.array([[0, 1, 2], [3, 4, 5]]))  # these face +z and +x
    half = math.sqrt(0.5)
    np.testing.assert_allclose(template.normals[[0, 3]], [[half, 0, half]] * 2, atol=1e-12)


@pytest.mark.parametrize("name", ["max_distance", "max_angle", "near_distance", "near_angle"])
@pytest.mark.parametrize("value", [-0.1, math.nan, math.inf])
def test_match_settings_refuse_invalid_values(name, value):
    with pytest.raises(RigError) as caught:
        MatchSettings(**{name: value})
    assert str(caught.value) == f"{name}: expected a number of at least 0, found {value}"
