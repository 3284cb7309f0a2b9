"""Sparse matrices of SciPy in pickles: compressed columns, compressed rows, and single entries."""

import numpy as np
import pytest
from formats.pickle_bytes import array, created, mapping, matrix, opened, saved, several, shape

from viewer.errors import FormatError
from viewer.formats._archive.values import Sparse


@pytest.mark.parametrize(
    ("module", "name"),
    [
        ("scipy.sparse.csc", "csc_matrix"),
        ("scipy.sparse._csc", "csc_matrix"),
        ("scipy.sparse._csc", "csc_array"),
    ],
)
@pytest.mark.parametrize("shape_key", ["_shape", "shape"])
def test_sparse_columns_are_read(module: str, name: str, shape_key: str) -> None:
    found = opened(saved(v=matrix(module=module, name=name, shape_key=shape_key))).get("v")
    assert isinstance(found, Sparse)
    assert (found.shape, found.layout) == ((2, 3), "csc")
    assert [part.tolist() for part in found.entries()] == [[0, 1, 0], [0, 2, 2], [1, 2, 3]]


@pytest.mark.parametrize("module", ["scipy.sparse.csr", "scipy.sparse._csr"])
def test_sparse_rows_are_read(module: str) -> None:
    built = matrix(sides=(3, 2), module=module, name="csr_matrix")
    found = opened(saved(v=built)).sparse("v", ("J", "V"))
    assert (found.shape, found.layout) == ((3, 2), "csr")
    assert [part.tolist() for part in found.entries()] == [[0, 2, 2], [0, 1, 0], [1, 2, 3]]


def entries(rows: bytes, columns: bytes, is_new: bool, name: str = "coo_matrix") -> bytes:
    """Return a sparse matrix [[0, 5, 0], [0, 4, 0]], with the rows and columns of its entries."""
    numbers = array(np.array([4.0, 2.0, 3.0]))
    places = {"coords": several(rows, columns)} if is_new else {"row": rows, "col": columns}
    state = mapping(_shape=shape(2, 3), data=numbers, **places)
    return created("scipy.sparse._coo" if is_new else "scipy.sparse.coo", name, state)


@pytest.mark.parametrize("is_new", [True, False])
def test_sparse_entries_are_read(is_new: bool) -> None:
    rows, columns = array(np.array([1, 0, 0], "i4")), array(np.array([1, 1, 1], "i4"))
    archive = opened(saved(v=entries(rows, columns, is_new)))
    found = archive.sparse("v", ("J", "V"))
    assert (found.shape, found.layout) == ((2, 3), "coo")
    assert [part.tolist() for part in found.entries()] == [[1, 0, 0], [1, 1, 1], [4, 2, 3]]


@pytest.mark.parametrize("places", [([1, 2, 0], [1, 1, 1]), ([1, 0, 0], [1, -1, 1]), ([0], [0])])
def test_sparse_entries_outside_the_matrix_are_refused(places: tuple[list[int], ...]) -> None:
    rows, columns = (array(np.array(each, "i4")) for each in places)
    with pytest.raises(FormatError) as refused:
        opened(saved(v=entries(rows, columns, is_new=True))).sparse("v")
    count = len(places[0])
    key = (
        "expected indices 0 to {last} in a sparse matrix, found {low} to {high}"
        if count == 3
        else "expected {expected} indices in a sparse matrix, found {found}"
    )
    assert refused.value.diagnostic.values["problem"].sentence == key
