"""Corners of faces: the four forms, mixed forms, and invalid corners with the same slashes."""

import pytest

from viewer.errors import FormatError
from viewer.formats import Source, obj

HEAD = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nvn 1 0 0\nvn 0 1 0\nvn 0 0 1\n"
UVS = [[0, 2, 1]]
NORMALS = [[0, 1, 0], [0, 0, 1], [1, 0, 0]]
FLAT = [[0, 0, 1]] * 3


def read(faces: str):
    return obj.read(Source("a.obj", (HEAD + faces).encode())).require_mesh()


@pytest.mark.parametrize("between", ["", "# comment\n", "\n", "g part\n"])
@pytest.mark.parametrize(
    ("face", "uvs", "normals"),
    [
        ("f 1 2 3\n", None, FLAT),
        ("f 1/1 2/3 3/2\n", UVS, FLAT),
        ("f 1//2 2//3 3//1\n", None, NORMALS),
        ("f 1/1/2 2/3/3 3/2/1\n", UVS, NORMALS),
        ("  fo\t-3/-3/-2\t2/3/-1   3/2/1  \r\n", UVS, NORMALS),
    ],
)
def test_all_forms_of_corners_are_read(face, uvs, normals, between):
    mesh = read(face + between + face)
    assert mesh.triangles.tolist() == [[0, 1, 2]] * 2
    assert (mesh.uv_triangles if uvs is None else mesh.uv_triangles.tolist()) == (
        None if uvs is None else uvs * 2
    )
    assert mesh.normals.tolist() == normals


def test_forms_may_be_mixed():
    mesh = read("f 1 2//3 3/2/1\nf 1//2 2 3/2\n")
    assert mesh.triangles.tolist() == [[0, 1, 2]] * 2
    assert mesh.normals.tolist() == [[0, 1, 0], [0, 0, 1], [1, 0, 0]]


def test_slashes_without_a_number_after_them_are_ignored():
    mesh = read("f 1/2/ 2/1/ 3/2/\nf 1/ 2// 3/2/1\nf 1//1\t2//2 3//\r\n")
    assert mesh.triangles.tolist() == [[0, 1, 2]] * 3
    given = read("f 1/2 2/1 3/2\nf 1 2 3/2/1\nf 1//1 2//2 3\n")
    assert mesh.uvs[mesh.uv_triangles].tolist() == given.uvs[given.uv_triangles].tolist()
    assert mesh.normals.tolist() == given.normals.tolist()


@pytest.mark.parametrize(
    "face",
    [
        *("f 1/1/1/1 2 3", "f /1 2/2 3/3", "f 1///1 2/2 3//3", "f //1 2//2 3//3"),
        *("f 1/1 /2 3/3", "f 1 / 2 3", "f 1/\x011 2/2 3/3", "f 1/1.5 2/2 3/3", "f 1/0 2/2 3/3"),
    ],
)
def test_invalid_corners_are_refused_at_their_line(face):
    with pytest.raises(FormatError, match=r"a\.obj:10: "):
        read(face + "\n")
