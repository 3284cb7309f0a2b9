"""Points that are spread evenly over a surface."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from viewer.errors import RigError
from viewer.rigs.geometry.samples import even_vertices, sample_surface, triangle_normals

# Two triangles in different planes, the second with three times the area of the first.
POSITIONS = np.array([[0.0, 0, 0], [2, 0, 0], [0, 2, 0], [0, 0, 1], [0, 0, 4], [0, 4, 1]])
TRIANGLES = np.array([[0, 1, 2], [3, 4, 5]])


def test_samples_are_distributed_by_area_and_are_on_their_triangle():
    found = sample_surface(POSITIONS, TRIANGLES, 800)
    on_first = found.positions[:, 2] == 0.0
    assert on_first.sum() == 200
    flat = found.positions[on_first]
    assert (flat[:, :2] >= 0).all() and (flat[:, :2].sum(axis=1) <= 2).all()
    assert_allclose(found.positions[~on_first][:, 0], 0.0, atol=1e-15)
    assert_allclose(found.normals[on_first], np.tile([0.0, 0, 1], (200, 1)))
    # The barycentric coordinates give the same points.
    corners = POSITIONS[TRIANGLES[found.triangles]]
    assert_allclose(np.einsum("nk,nka->na", found.weights, corners), found.positions, atol=1e-15)
    assert_allclose(found.normals[~on_first], np.tile([-1.0, 0, 0], (600, 1)))


def test_samples_are_uniform_within_a_triangle():
    flat = sample_surface(POSITIONS, TRIANGLES[:1], 4000).positions
    # The centroid of the samples is that of the triangle, and each quarter has a quarter of them.
    assert_allclose(flat.mean(axis=0), [2 / 3, 2 / 3, 0.0], atol=0.01)
    assert abs((flat[:, :2].max(axis=1) < 1).mean() - 0.5) < 0.01


def test_same_mesh_has_the_same_samples():
    first, second = (sample_surface(POSITIONS, TRIANGLES, 50).positions for _ in range(2))
    assert (first == second).all()


def test_triangle_without_area_has_no_normal():
    assert (triangle_normals(POSITIONS, np.array([[0, 1, 1]])) == 0.0).all()


@pytest.mark.parametrize("triangles", [np.zeros((0, 3), int), [[0, 1, 1]]])
def test_mesh_without_area_is_refused(triangles):
    with pytest.raises(RigError) as problem:
        sample_surface(POSITIONS, np.asarray(triangles), 10)
    assert str(problem.value) == "expected a mesh with an area, found none"


def test_vertices_are_sampled_by_area_without_repetition():
    # One large and one small triangle are apart, so at most three vertices are of the large one.
    positions = np.concatenate([100.0 * POSITIONS[:3], POSITIONS[3:]])
    assert even_vertices(positions, TRIANGLES, 10).tolist() == [0]
    line = np.arange(101.0)
    strip = np.concatenate([np.stack([line, 0 * line, 0 * line], 1),
                            np.stack([line, 0 * line + 1, 0 * line], 1)])  # fmt: skip
    low = np.arange(100)
    cells = np.concatenate([np.stack([low, low + 1, low + 101], 1),
                            np.stack([low + 1, low + 102, low + 101], 1)])  # fmt: skip
    chosen = even_vertices(strip, cells, 50)
    assert len(chosen) == len(set(chosen.tolist())) and 25 <= len(chosen) <= 50
    assert np.diff(np.sort(strip[chosen, 0])).max() <= 8.0


def test_vertices_of_a_mesh_without_area_are_refused():
    with pytest.raises(RigError) as problem:
        even_vertices(np.zeros((3, 3)), np.array([[0, 1, 2]]), 5)
    assert str(problem.value) == "expected a mesh with an area, found none"
