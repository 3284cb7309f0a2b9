"""A PIG model of five vertices and three joints for tests, and functions that read it.

Two triangles share the edge from vertex 1 to vertex 2, but are separate in the texture, so these
two vertices have two texture coordinates each. Vertex 4 belongs to no triangle. All values are
multiples of a quarter, for hand calculation.
"""

import shutil
from itertools import pairwise

import numpy as np
import pytest
from faults import fault_of, warnings_of
from numpy.testing import assert_array_equal

import viewer
from viewer.errors import FormatError, RigError
from viewer.formats import Source, pig

CORE = {
    "vertices.txt": "0 0 0\n1 0 0\n0 1 0\n1 1 0\n2 2 -1",  # as published: no final newline
    "t_pose_joints.txt": "0 0 0\n1 0 0\n1 1 0.5",
    "parents.txt": "-1\n0\n1\n",
    "skinning_weights.txt": "0 0 1\n1 1 1\n0 2 0.75\n1 2 0.25\n2 3 1\n2 4 0.5\n1 4 0.5\n",
    "faces_vert.txt": "0 1 2\n1 3 2\n",
    "textures.txt": "0 0\n0.5 0\n0 1\n0.75 0\n1 1\n0.5 1\n",
    "faces_tex.txt": "0 1 2\n3 4 5\n",
    "J_regressor.txt": "0 0 1\n1 1 1\n2 3 0.5\n2 4 0.5\n",
}
MORE = {
    "body_parts.txt": "1\n1\n1\n2\n2\n",
    "body_part_defs.txt": "NOT_BODY\nMAIN_BODY\nHEAD",
    "sym.txt": "0\n2\n1\n3\n4\n",
    "reduced_ids.txt": "0\n1\n3\n",
    "reduced_faces.txt": "0 1 2\n",
}
GOOD = {**CORE, **MORE}


def write(folder, files=GOOD, **changes):
    """Rewrite a folder; a change is the new text or bytes of a file, or None to omit the file."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    for name, text in {**files, **{f"{key}.txt": text for key, text in changes.items()}}.items():
        if text is not None:
            (folder / name).write_bytes(text if isinstance(text, bytes) else text.encode())
    return folder


def read(path):
    """Return the figure of a folder or archive, and its warnings as data."""
    source = Source.open(path)
    return pig.read(source), warnings_of(source.diagnostics)


def silent(path):
    figure, warnings = read(path)
    assert warnings == []
    return figure


def refusal(path):
    """Return the refusal of a model: file name, key, line and values."""
    with pytest.raises((FormatError, RigError)) as caught:
        viewer.load(path)
    assert caught.value.exit_code == 2
    assert str(caught.value).isprintable()
    found = caught.value.diagnostic
    return (found.path.relative_to(path.parent).as_posix(), *fault_of(found))


def arrays(*, dense=True):
    """Return the model as arrays of an archive, with matrices as dense (3, 5) arrays."""
    given = {
        name.removesuffix(".txt"): np.array([row.split() for row in text.splitlines()], float)
        for name, text in GOOD.items()
        if name != "body_part_defs.txt"
    }
    for name in ("parents", "body_parts", "sym", "reduced_ids"):
        given[name] = given[name][:, 0].astype(np.int64)
    for name in ("faces_vert", "faces_tex", "reduced_faces"):
        given[name] = given[name].astype(np.int64)
    if dense:
        for name in ("skinning_weights", "J_regressor"):
            matrix = np.zeros((3, 5))
            for joint, vertex, weight in given[name]:
                matrix[int(joint), int(vertex)] = weight
            given[name] = matrix
    given["body_part_defs"] = np.array(["NOT_BODY", "MAIN_BODY", "HEAD"])
    return given


def influences(figure):
    """Return the sorted (joint, weight) pairs of each vertex."""
    starts = figure.skin.starts
    pairs = list(zip(figure.skin.joints.tolist(), figure.skin.weights.tolist(), strict=True))
    return [sorted(pairs[a:b]) for a, b in pairwise(starts)]


WEIGHTS = [[(0, 1)], [(1, 1)], [(0, 0.75), (1, 0.25)], [(2, 1)], [(1, 0.5), (2, 0.5)]]


def assert_core(figure):
    """Check the parts that all variants have."""
    mesh, skeleton = figure.mesh, figure.skeleton
    rest = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [2, 2, -1]]
    assert_array_equal(mesh.positions, rest)
    assert_array_equal(mesh.triangles, [[0, 1, 2], [1, 3, 2]])
    # Both triangles are in the plane z = 0; the vertex without a triangle gets the normal +y.
    assert_array_equal(mesh.normals, [[0, 0, 1]] * 4 + [[0, 1, 0]])
    assert skeleton.parents.tolist() == [-1, 0, 1]
    assert_array_equal(skeleton.rest_translations, [[0, 0, 0], [1, 0, 0], [0, 1, 0.5]])
    assert influences(figure) == WEIGHTS
    assert_array_equal(figure.skin.inverse_bind[:, :3, 3], [[0, 0, 0], [-1, 0, 0], [-1, -1, -0.5]])
    assert_array_equal(figure.skin.inverse_bind[:, :3, :3], [np.eye(3)] * 3)
    assert (figure.up, figure.unit) == ("z", "m")


def assert_good(figure):
    """Check all parts of ``GOOD``."""
    assert_core(figure)
    mesh = figure.mesh
    assert_array_equal(mesh.uvs, [[0, 0], [0.5, 0], [0, 1], [0.75, 0], [1, 1], [0.5, 1]])
    assert_array_equal(mesh.uv_triangles, [[0, 1, 2], [3, 4, 5]])
    regressor = figure.joint_regressor
    entries = zip(regressor.joints, regressor.vertices, regressor.weights, strict=True)
    assert sorted(entries) == [(0, 0, 1), (1, 1, 1), (2, 3, 0.5), (2, 4, 0.5)]
    assert figure.body_parts.names == ("NOT_BODY", "MAIN_BODY", "HEAD")
    assert figure.body_parts.of_vertex.tolist() == [1, 1, 1, 2, 2]
    assert figure.symmetry.tolist() == [0, 2, 1, 3, 4]
    assert figure.reduced.vertices.tolist() == [0, 1, 3]
    assert figure.reduced.triangles.tolist() == [[0, 1, 2]]
