import numpy as np
import pytest
from scipy import sparse

from viewer.autorig.weights.weight_transfer import put_rows, scaled_rows, skin_of, weight_matrix
from viewer.errors import RigError
from viewer.rig.skin import skin_from_lists

BIND = np.tile(np.eye(4), (3, 1, 1))
ALL = np.array([[0, 1, 2]])


def test_weight_matrix_sums_and_normalises_weights():
    skin = skin_from_lists([[(0, 0.5), (2, 1.0), (0, 0.5)], [(1, 4.0)], [(1, 1), (2, 0)]], BIND)
    matrix = weight_matrix(skin, ALL)
    assert matrix.toarray().tolist() == [[0.5, 0.0, 0.5], [0.0, 1.0, 0.0], [0.0, 1.0, 0.0]]
    assert matrix.nnz == 4


def test_weight_matrix_ignores_negative_weights():
    skin = skin_from_lists([[(0, 1.0), (1, -0.25)], [(1, 1.0)], [(1, 1.0)]], BIND)
    assert weight_matrix(skin, ALL).toarray()[0].tolist() == [1.0, 0.0, 0.0]


def test_weight_matrix_requires_weights_only_for_used_vertices():
    skin = skin_from_lists([[(0, 1.0)], [(1, 1.0)], [(1, 1.0)], []], BIND)
    assert weight_matrix(skin, ALL).toarray()[3].tolist() == [0.0, 0.0, 0.0]


def test_weight_matrix_reports_the_first_vertex_without_weights():
    skin = skin_from_lists([[(0, 1.0)], [(1, 0.0)], []], BIND)
    with pytest.raises(RigError) as caught:
        weight_matrix(skin, ALL)
    assert str(caught.value) == (
        "template: expected weights for every vertex, found none for 2 of 3, the first is vertex 1"
    )


def test_weight_matrix_refuses_a_skin_of_a_different_mesh():
    skin = skin_from_lists([[(0, 1.0)], [(1, 1.0)]], BIND)
    with pytest.raises(RigError) as caught:
        weight_matrix(skin, ALL)
    assert str(caught.value) == "template: expected weights for 3 vertices, found 2"


def test_skin_of_is_the_inverse_of_weight_matrix():
    rows = sparse.csr_array(np.array([[0.25, 0, 0.75], [0, 1, 0], [0.5, 0.25, 0.25]]))
    skin = skin_of(rows, BIND)
    assert skin.starts.tolist() == [0, 2, 3, 6]
    assert weight_matrix(skin, ALL).toarray().tolist() == rows.toarray().tolist()


def test_skin_of_keeps_the_strongest_weights_if_requested():
    rows = sparse.csr_array(np.array([[0.25, 0, 0.75], [0, 1, 0], [0.5, 0.125, 0.375]]))
    skin = skin_of(rows, BIND, 1)
    assert skin.joints.tolist() == [2, 1, 0]
    assert skin.weights.tolist() == [1.0, 1.0, 1.0]


def test_scaled_rows_empties_rows_with_factor_zero():
    found = scaled_rows(sparse.csr_array(np.array([[1.0, 2.0], [3.0, 4.0]])), np.array([0.0, 2.0]))
    assert found.toarray().tolist() == [[0.0, 0.0], [6.0, 8.0]]
    assert found.nnz == 2


def test_put_rows_replaces_rows():
    rows = sparse.csr_array(np.array([[1.0, 0], [0, 1], [0.5, 0.5]]))
    values = sparse.csr_array(np.array([[0.25, 0.75], [0, 1]]))
    found = put_rows(rows, np.array([2, 0]), values)
    assert found.toarray().tolist() == [[0, 1], [0, 1], [0.25, 0.75]]
