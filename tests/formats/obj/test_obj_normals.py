"""Normals of large ``.obj`` files."""

import numpy as np

from viewer.formats import Source, obj


def test_normals_of_many_vertices_are_averaged_without_overflow() -> None:
    # The number of pairs of 50,000 vertices and 50,000 normals does not fit into 32 bits.
    count = 50_000
    text = "v 0 0 0\n" * (count - 3) + "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
    text += "vn 1 0 0\n" * (count - 2) + "vn 0 1 0\nvn 0 0 1\n"
    a, b, c = count - 2, count - 1, count
    text += f"f {a}//{b} {b}//{b} {c}//{b}\nf {a}//{c} {c}//{c} {b}//{c}\n"
    figure = obj.read(Source("large.obj", text.encode()))
    half = 0.5**0.5
    np.testing.assert_allclose(figure.mesh.normals[-3:], [[0, half, half]] * 3, atol=1e-12)
