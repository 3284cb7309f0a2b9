"""Text of a ``.ply`` that is parsed part by part: the same values and error lines."""

import pytest

from viewer.errors import FormatError
from viewer.formats import Source, ply
from viewer.formats.ply import elements

HEAD = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
element face 4
property list uchar int vertex_indices
property float quality
end_header
0 0 0
1 0 0
0 1 -2.5

0 0 1
"""
FACES = "3 0 1 2 1\n3 1 2 3 2\n3 2 3 0 3\n"


@pytest.fixture(params=[1, 2, 3, 100], autouse=True)
def _parts(request, monkeypatch):
    monkeypatch.setattr(elements, "_PART", request.param)


@pytest.mark.parametrize("quality", ["4", "0.5", "5e9"])
def test_parts_make_up_the_mesh(quality):
    mesh = ply.read(Source("a.ply", f"{HEAD}{FACES}3 0 1 3 {quality}\n".encode())).require_mesh()
    assert mesh.positions.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, -2.5], [0, 0, 1]]
    assert mesh.triangles.tolist() == [[0, 1, 2], [1, 2, 3], [2, 3, 0], [0, 1, 3]]


@pytest.mark.parametrize("corner", ["9", "0.5", "5e9", "up"])
def test_invalid_corner_is_refused_at_its_line(corner):
    with pytest.raises(FormatError, match=r"a\.ply:19: "):
        ply.read(Source("a.ply", f"{HEAD}{FACES}3 0 1 {corner} 4\n".encode()))
