"""Landmark files: pairs of corresponding points on two meshes.

One pair per line: three numbers of the posed template and three of the target, or the name of a
joint of the template and three numbers of the target; ``#`` begins a comment::

    0.0 1.62 0.1      0.0 162.0 9.5
    left_wrist        71.2 140.0 -3.0
"""

from __future__ import annotations

import numpy as np

from viewer.diagnostics import Diagnostic
from viewer.errors import FormatError
from viewer.formats import Source
from viewer.formats._text.numbers import to_number
from viewer.near_names import name_hint
from viewer.phrases import printable
from viewer.rig.arrays import Floats
from viewer.rig.figure import Figure
from viewer.rig.pose import Pose
from viewer.rig.skinning import joint_matrices

_FARTHEST = 1e9  # largest coordinate, in any unit
_LARGEST_SCALE = 1e9  # largest ratio of the extents of both meshes, or of its inverse


def read_landmarks(source: Source, template: Figure, pose: Pose) -> Floats:
    """Read pairs of points.

    ``source``: the file.
    ``template``: figure with the joints that the file refers to.
    ``pose``: pose of the template.
    Returns (N, 2, 3): the template's point and the target's for each pair.
    Raises FormatError at a line that is not a pair or names an unknown joint, or at the last line
      if there are fewer than three pairs, or if no scale fits them.
    """
    skeleton = template.require_skeleton()
    joints = joint_matrices(template, pose)[:, :3, 3]
    pairs = []
    for line_number, data in enumerate(source.data.splitlines(), start=1):
        line = data.decode("utf-8", "replace")
        words = line.partition("#")[0].split()
        if not words:
            continue
        values = _floats(words if len(words) == 6 else words[-3:])
        if values is None or len(words) < 4 or (len(words) != 6 and _floats(words) is not None):
            found = {"found": printable(line.strip(), 60)}
            raise FormatError(Diagnostic("F002.landmark", source.path, line_number, values=found))
        if len(values) == 6:
            pairs.append([values[:3], values[3:]])
            continue
        name = " ".join(words[:-3])
        if name not in skeleton.names:
            raise _unknown_joint(source, line_number, name, template)
        pairs.append([joints[skeleton.names.index(name)].tolist(), values])
    last = max(len(source.data.splitlines()), 1)
    if len(pairs) < 3:
        count = {"found": len(pairs)}
        raise FormatError(Diagnostic("F002.landmarks", source.path, last, values=count))
    points = np.array(pairs, dtype=np.float64)
    own, other = np.ptp(points, axis=0).max(axis=1).tolist()
    if not (own < _LARGEST_SCALE * other and other < _LARGEST_SCALE * own):
        extents = {"own": own, "other": other}
        raise FormatError(Diagnostic("F002.landmark-extents", source.path, last, values=extents))
    return points


def _unknown_joint(source: Source, line: int, name: str, template: Figure) -> FormatError:
    names = () if template.skeleton is None else template.skeleton.names
    values = {"figure": printable(template.name, 60), "found": name, "near": name_hint(name, names)}
    return FormatError(Diagnostic("F002.landmark-joint", source.path, line, values=values))


def _floats(words: list[str]) -> list[float] | None:
    found = [to_number(word.encode()) for word in words]
    values = [value for value in found if value is not None and abs(value) < _FARTHEST]
    return values if len(values) == len(found) else None
