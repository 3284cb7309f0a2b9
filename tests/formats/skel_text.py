"""A valid ``.skel`` text that tests modify, and a function that reads it."""

import math
from pathlib import Path

import pytest
from faults import fault_of, warnings_of

from viewer.errors import FormatError
from viewer.formats import Source, skel

INF = math.inf
ROOT_MOVES = [[-INF, INF]] * 3
GOOD = """balljoint root {
  offset 1 2 3
  boxmin -0.5 -0.25 -1
  boxmax 0.5 0.25 1
  rotxlimit -1 1
  rotylimit 0 0.5
  rotzlimit -100000 100000
  pose 0.5 0.25 7
  balljoint arm {
    offset 0 1 0
  }
}
"""


def read(text):
    """Return the skeleton of a text, and its warnings as (key, line, values)."""
    source = Source("a.skel", text if isinstance(text, bytes) else text.encode())
    return skel.read(source).skeleton, warnings_of(source.diagnostics)


def silent(text):
    skeleton, warnings = read(text)
    assert warnings == []
    return skeleton


def refusal(text):
    with pytest.raises(FormatError) as caught:
        read(text)
    assert caught.value.exit_code == 2
    assert caught.value.path == Path("a.skel")
    return fault_of(caught.value.diagnostic)


def assert_good(skeleton):
    assert skeleton.names == ("root", "arm")
    assert skeleton.parents.tolist() == [-1, 0]
    assert skeleton.rest_translations.tolist() == [[1, 2, 3], [0, 1, 0]]
    assert skeleton.boxes.tolist() == [
        [[-0.5, -0.25, -1], [0.5, 0.25, 1]],
        [[-0.1] * 3, [0.1] * 3],
    ]
    assert skeleton.dof_joints.tolist() == [0] * 6 + [1] * 3
    assert skeleton.dof_kinds.tolist() == [0, 1, 2, 3, 4, 5, 3, 4, 5]
    limits = [*ROOT_MOVES, [-1, 1], [0, 0.5], [-INF, INF], *[[-INF, INF]] * 3]
    assert skeleton.dof_limits.tolist() == limits
    assert skeleton.rest_dofs.tolist() == [0, 0, 0, 0.5, 0.25, 7, 0, 0, 0]
