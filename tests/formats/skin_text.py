"""A valid ``.skin`` text that tests modify, and a function that reads it."""

import numpy as np
import pytest

from viewer.errors import FormatError
from viewer.formats import Source, skin

POSITIONS = "positions 3 {\n  0 0 0\n  2 0 0\n  0 2 0\n}\n"
NORMALS = "normals 3 {\n  0 0 1\n  0 0 1\n  0 1 0\n}\n"
WEIGHTS = "skinweights 3 {\n  1 0 1.0\n  2 0 0.25 1 0.75\n  1 1 1\n}\n"
TRIANGLES = "triangles 1 {\n  0 1 2\n}\n"
MATRIX = "matrix {\n  1 0 0\n  0 1 0\n  0 0 1\n  5 6 7\n}\n"
BINDINGS = f"bindings 2 {{\n{MATRIX}{MATRIX.replace('5 6 7', '8 9 10')}}}\n"
GOOD = POSITIONS + NORMALS + WEIGHTS + TRIANGLES + BINDINGS
BARE = POSITIONS + NORMALS + TRIANGLES


def read(text, path="a.skin"):
    """Return the figure and the warnings of a text."""
    source = Source(path, text if isinstance(text, bytes) else text.encode())
    return skin.read(source), source.warnings


def silent(text):
    figure, warnings = read(text)
    assert warnings == []
    return figure


def refusal(text):
    with pytest.raises(FormatError) as caught:
        read(text)
    assert caught.value.exit_code == 2
    return str(caught.value)


def assert_good(figure):
    assert figure.mesh.positions.tolist() == [[0, 0, 0], [2, 0, 0], [0, 2, 0]]
    assert figure.mesh.normals.tolist() == [[0, 0, 1], [0, 0, 1], [0, 1, 0]]
    assert figure.mesh.triangles.tolist() == [[0, 1, 2]]
    assert figure.mesh.material_indices.tolist() == [-1]
    assert figure.skin.starts.tolist() == [0, 1, 3, 4]
    assert figure.skin.joints.tolist() == [0, 0, 1, 1]
    assert figure.skin.weights.tolist() == [1, 0.25, 0.75, 1]
    assert figure.skin.inverse_bind[:, :3, 3].tolist() == [[-5, -6, -7], [-8, -9, -10]]
    assert figure.skin.inverse_bind[:, :3, :3].tolist() == [np.eye(3).tolist()] * 2
