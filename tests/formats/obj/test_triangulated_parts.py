"""Triangulation of many polygons, part by part."""

import numpy as np
import pytest

from viewer.formats import _polygons
from viewer.formats._polygons import triangulate


@pytest.mark.parametrize("part", [1, 2, 3, 7])
def test_parts_give_the_triangles_of_single_polygons(monkeypatch, part):
    rng = np.random.default_rng(0)
    counts = np.array([4, 3, 5, 3, 3, 4, 8, 6, 3, 4])
    points = rng.normal(size=(40, 3))
    corners = rng.integers(0, 40, counts.sum())
    monkeypatch.setattr(_polygons, "_PART", part)
    picks, owners = triangulate(points, corners, counts)
    assert owners.tolist() == np.repeat(np.arange(10), counts - 2).tolist()
    starts = np.cumsum(counts) - counts
    for face, (start, size) in enumerate(zip(starts, counts, strict=True)):
        alone, _ = triangulate(points, corners[start : start + size], np.array([size]))
        np.testing.assert_array_equal(picks[owners == face], alone + start)
