"""Large ``.obj`` files: tables that grow row by row, and numbers beyond 32 bits."""

import numpy as np

from viewer.formats import Source, obj
from viewer.formats._text.growing_table import GrowingTable


def test_rows_are_those_that_were_added():
    rng = np.random.default_rng(0)
    parts = [rng.normal(size=(size, 3)) for size in (0, 1, 5, 0, 300, 2)]
    table = GrowingTable((3,), np.float64)
    for part in parts:
        table.add(part)
    np.testing.assert_array_equal(table.rows(), np.concatenate(parts))
    assert GrowingTable((2,)).rows().shape == (0, 2)


def test_table_is_widened_for_large_numbers():
    table = GrowingTable((), np.int32)
    table.add(np.array([1], np.int32))
    table.add(np.array([1 << 40], np.int64))
    assert table.rows().tolist() == [1, 1 << 40]


def test_hard_edges_of_large_meshes_get_mean_normals() -> None:
    # The product of the numbers of vertices and normals does not fit into 32 bits.
    count = 50_000
    places = "".join(f"v {n} {n % 7} {n % 3}\n" for n in range(count))
    normals = "vn 0 0 1\n" * (count - 2) + "vn 1 0 0\nvn 0 1 0\n"
    faces = f"f 1//1 2//1 {count}//{count - 1}\nf 1//1 3//1 {count}//{count}\n"
    mesh = obj.read(Source("a.obj", (places + normals + faces).encode())).require_mesh()
    half = np.sqrt(0.5)
    np.testing.assert_allclose(mesh.normals[-1], [half, half, 0.0], atol=1e-15)
