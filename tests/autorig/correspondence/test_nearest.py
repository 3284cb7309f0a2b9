import numpy as np
import pytest

from viewer.autorig.weights.weight_transfer import nearest_vertices
from viewer.errors import RigError


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
