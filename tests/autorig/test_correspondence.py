import math
from dataclasses import replace

import numpy as np
import pytest
from autorig.rigged_shapes import mesh_of, tube
from numpy.testing import assert_allclose

from viewer.autorig.correspondence import (
    MatchSettings,
    Template,
    at_vertices,
    match,
    same_vertices,
    sheet_normals,
    with_reversed_winding,
    wound_backwards,
)
from viewer.autorig.surface.welding import weld
from viewer.autorig.weights.weight_transfer import nearest_vertices
from viewer.errors import RigError
from viewer.rigs.geometry.closest_point import Surface
from viewer.rigs.mesh import volume

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


CUBE = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
OUTWARD = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
     [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
)  # fmt: skip


def two(first, second):
    """Return two unit cubes side by side with the given triangles of each."""
    positions = np.concatenate([CUBE, CUBE + np.array([3.0, 0.0, 0.0])])
    return positions, np.concatenate([first, np.asarray(second) + 8]).astype(np.int32)


def backwards(positions, triangles, islands):
    return wound_backwards(weld(positions, triangles), np.array(islands)).tolist()


def test_cube_of_the_tests_is_wound_outward():
    assert volume(CUBE, OUTWARD) == pytest.approx(1.0)


def test_closed_inside_out_part_is_detected():
    positions, triangles = two(OUTWARD, OUTWARD[:, ::-1])
    assert backwards(positions, triangles, [1]) == [False] * 8 + [True] * 8


def test_correctly_wound_part_facing_away_is_kept():
    positions, triangles = two(OUTWARD, OUTWARD)
    assert not any(backwards(positions, triangles, [0, 1]))


def test_unrequested_part_is_kept():
    positions, triangles = two(OUTWARD, OUTWARD[:, ::-1])
    assert not any(backwards(positions, triangles, []))


def test_open_lining_is_kept_and_open_mesh_is_flipped():
    inner = OUTWARD[2:, ::-1]  # a face of two triangles is missing
    lining = two(OUTWARD, inner)
    assert not any(backwards(*lining, [1]))
    assert all(backwards(CUBE, inner.astype(np.int32), [0]))


def test_vertices_without_triangles_belong_to_no_part():
    positions = np.concatenate([CUBE, [[9.0, 9.0, 9.0]]])
    assert backwards(positions, OUTWARD[:, ::-1].astype(np.int32), [0, 1]) == [True] * 8 + [False]


def test_flipping_keeps_materials_and_texture_at_their_corners():
    positions, triangles = tube()
    mesh = mesh_of(positions, triangles[:, ::-1])
    again = with_reversed_winding(mesh, np.ones(len(positions), dtype=bool))
    assert (again.triangles == triangles).all()
    assert np.allclose(again.normals, mesh_of(positions, triangles).normals)
    assert with_reversed_winding(mesh, np.zeros(len(positions), dtype=bool)) is mesh


def test_texture_corners_flip_with_the_triangles():
    corners = np.arange(36, dtype=np.int32).reshape(-1, 3)
    mesh = replace(mesh_of(CUBE, OUTWARD), uvs=np.zeros((36, 2)), uv_triangles=corners)
    again = with_reversed_winding(mesh, np.ones(8, dtype=bool))
    assert (again.uv_triangles == corners[:, ::-1]).all()


def test_nearest_vertices_match_a_search_of_all_distances():
    rng = np.random.default_rng(1)
    template, points = rng.normal(size=(200, 3)), rng.normal(size=(100, 3))
    table = np.linalg.norm(points[:, None] - template[None], axis=2)
    vertices, distances = nearest_vertices(template, points)
    assert vertices.tolist() == table.argmin(axis=1).tolist()
    np.testing.assert_allclose(distances, table.min(axis=1), atol=1e-12)


def test_nearest_vertices_refuses_an_empty_template():
    with pytest.raises(RigError) as caught:
        nearest_vertices(np.zeros((0, 3)), np.zeros((2, 3)))
    assert str(caught.value) == "expected a template with vertices, found none"


COUNT = 9


def grid(step=1.0, start=0.0):
    """Return a grid in the plane z = 0 with two triangles per cell."""
    line = start + step * np.arange(COUNT)
    x, y = np.meshgrid(line, line, indexing="ij")
    positions = np.stack([x.ravel(), y.ravel(), np.zeros(COUNT * COUNT)], axis=1)
    number = np.arange(COUNT * COUNT).reshape(COUNT, COUNT)
    a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    triangles = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)])
    return positions, triangles.reshape(-1, 3).astype(np.int32)


def found_same(template, target):
    distances = Surface(*template).closest(target[0]).distances
    one, other = weld(*template), weld(*target)
    return same_vertices(one, other, distances)


def test_moved_vertices_are_recognised_in_any_order():
    rng = np.random.default_rng(4)
    positions, triangles = grid()
    order = rng.permutation(len(positions))
    rank = np.argsort(order)
    moved = positions[order] + rng.uniform(-0.2, 0.2, positions.shape)
    assert (
        found_same((positions, triangles), (moved, rank[triangles].astype(np.int32))) == order
    ).all()


def test_offset_shell_has_the_same_vertices():
    positions, triangles = grid()
    lifted = positions + np.array([0.0, 0.0, 3.0])
    assert (found_same((positions, triangles), (lifted, triangles)) == np.arange(81)).all()


@pytest.mark.parametrize(("step", "start"), [(0.5, 0.0), (1.0, 0.5), (2.0, 0.0)])
def test_different_tessellation_has_different_vertices(step, start):
    same = found_same(grid(), grid(step, start))
    assert (same >= 0).mean() < 0.05


def test_rotated_tessellation_has_different_vertices():
    positions, triangles = grid()
    cosine, sine = np.cos(0.5), np.sin(0.5)
    rotated = (positions - 4.0) @ np.array([[cosine, sine, 0], [-sine, cosine, 0], [0, 0, 1]]) + 4.0
    same = found_same((positions, triangles), (rotated, triangles))
    assert (same >= 0).mean() < 0.2  # vertices near the centre of rotation remain


def test_points_snap_to_near_vertices_only():
    positions, triangles = grid()
    asked = np.array([[0.2, 0.1, 1.0], [3.4, 3.3, 0.0]])
    points = Surface(positions, triangles).closest(asked)
    moved = at_vertices(points, asked, triangles, positions, np.array([0, -1]))
    assert_allclose(moved.positions, [[0, 0, 0], [3.4, 3.3, 0]], atol=1e-12)
    assert_allclose(moved.distances, [np.sqrt(1.05), 0.0], atol=1e-12)
    corner = triangles[moved.triangles[0]][moved.barycentric[0].argmax()]
    assert corner == 0 and sorted(moved.barycentric[0]) == [0, 0, 1]
    assert moved.triangles[1] == points.triangles[1]


def test_vertex_without_triangles_is_not_on_the_surface():
    positions, triangles = grid()
    places = np.concatenate([positions, [[0.1, 0.1, 0.0]]])
    asked = np.array([[0.1, 0.1, 0.0]])
    points = Surface(positions, triangles).closest(asked)
    same = at_vertices(points, asked, triangles, places, np.array([81]))
    assert_allclose(same.positions, asked, atol=1e-12)
