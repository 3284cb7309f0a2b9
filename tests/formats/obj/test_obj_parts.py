"""Objects and groups of ``.obj`` files as parts of the mesh."""

from viewer.formats import Source
from viewer.formats.obj import read
from viewer.rigs.mesh import Mesh

SQUARE = "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\n"


def mesh_of(text: str) -> Mesh:
    return read(Source("a.obj", text.encode())).require_mesh()


def test_several_objects_or_else_groups_are_parts():
    text = SQUARE + "f 1 2 3\no box\ng low\nf 1 2 4\ng high\nf 2 3 4\no lid\no ball\nf 1 3 4\n"
    mesh = mesh_of(text)
    assert mesh.parts == ("box", "ball")
    assert mesh.part_indices.tolist() == [-1, 0, 0, 1]
    mesh = mesh_of(text.replace("o ball", "o box"))
    assert mesh.parts == ("low", "high")
    assert mesh.part_indices.tolist() == [-1, 0, 1, 1]
    mesh = mesh_of(SQUARE + "o box\nf 1 2 3\n")
    assert mesh.parts == ()


def test_faces_of_two_corners_are_omitted_without_moving_other_parts():
    text = SQUARE + "f 1 2\no low\nf 1 2 3\nf 3 4\no high\nf 2\nf 2 3 4\n"
    source = Source("a.obj", text.encode())
    mesh = read(source).require_mesh()
    assert mesh.triangles.tolist() == [[0, 1, 2], [1, 2, 3]]
    assert [mesh.parts[part] for part in mesh.part_indices] == ["low", "high"]
    (warning,) = source.warnings
    assert warning == "a.obj:5: 3 faces with fewer than 3 corners not drawn"
    only = Source("a.obj", (SQUARE + "f 1 2\n").encode())
    assert read(only).require_mesh().n_triangles == 0
