"""Text of a BVH file, in the subset that all known readers accept.

One item per line and "{" alone on its line (Blender counts lines), one ROOT, six channels on it and
three on the others, positions first, the same rotation order everywhere, no exponents, LF.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from viewer.formats._text.decimals import fixed
from viewer.formats._text.number_text import row_texts
from viewer.progress import report
from viewer.rig.arrays import Bools, Floats, Ints
from viewer.rig.hierarchy import depth_first

_DEEPEST = 32  # maximum indentation in tabs
_BLOCK = 256  # number of frames formatted together
_SECONDS_DIGITS = 9  # minimum decimals of the frame time, for a relative error below 1e-8


def head_text(
    names: Sequence[str],
    parents: Ints,
    offsets: Floats,
    ends: dict[int, Floats],
    moves: Bools,
    rotation_order: str,
    rate: float,
    n_frames: int,
    digits: int,
) -> bytes:
    """Return the text of a file before its frames.

    ``names``: unique names of letters, digits and underscores.
    ``parents`` (J,): parent indices; the first joint is the only root.
    ``offsets`` (J, 3): offsets from the parent; the root's offset is written as 0.
    ``ends``: offset of the End Site of every joint without children.
    ``moves`` (J,) bool: which joints have position channels.
    ``rotation_order``: ``"zyx"`` for Zrotation Yrotation Xrotation.
    ``rate``: frames per second.
    ``n_frames``: number of frames.
    ``digits``: number of decimals.
    """
    order = depth_first(parents)
    lines = _hierarchy(names, parents, order, offsets, ends, moves, rotation_order, digits)
    seconds = 1.0 / rate
    decimals = max(_SECONDS_DIGITS, _SECONDS_DIGITS - 1 - int(np.floor(np.log10(seconds))))
    lines += ["MOTION", f"Frames: {n_frames}", f"Frame Time: {seconds:.{decimals}f}"]
    return ("\n".join(lines) + "\n").encode("ascii")


def frame_texts(
    parents: Ints, moves: Bools, positions: Floats, angles: Floats, digits: int
) -> Iterator[bytes]:
    """Yield the lines of frames, with joints in the order of the file.

    ``parents`` (J,), ``moves`` (J,) bool, ``digits``: see ``head_text``.
    ``positions`` (F, J, 3), ``angles`` (F, J, 3): angles are in radians in the rotation order.
    """
    order = depth_first(parents)
    count = len(angles)
    for start in range(0, count, _BLOCK):
        report(start, count, "frames", "formatting")
        rows = slice(start, start + _BLOCK)
        degrees = np.degrees(angles[rows])
        columns = []
        for joint in order:
            if joint == order[0] or moves[joint]:
                columns.append(positions[rows, joint])
            columns.append(degrees[:, joint])
        yield from row_texts(np.concatenate(columns, axis=1), lambda part: fixed(part, digits))


def _hierarchy(
    names: Sequence[str],
    parents: Ints,
    order: Ints,
    offsets: Floats,
    ends: dict[int, Floats],
    moves: Bools,
    rotation_order: str,
    digits: int,
) -> list[str]:
    lines = ["HIERARCHY"]
    rotations = " ".join(f"{axis.upper()}rotation" for axis in rotation_order)
    open_joints: list[int] = []

    def put(depth: int, text: str) -> None:
        lines.append("\t" * min(depth, _DEEPEST) + text)

    def close(until: int) -> None:
        while open_joints and open_joints[-1] != until:
            open_joints.pop()
            put(len(open_joints), "}")

    for joint in order:
        parent = int(parents[joint])
        close(parent)
        depth = len(open_joints)
        put(depth, f"{'ROOT' if parent < 0 else 'JOINT'} {names[joint]}")
        put(depth, "{")
        put(depth + 1, f"OFFSET {_vector(offsets[joint] if parent >= 0 else np.zeros(3), digits)}")
        has_positions = parent < 0 or moves[joint]
        count = "6 Xposition Yposition Zposition" if has_positions else "3"
        put(depth + 1, f"CHANNELS {count} {rotations}")
        open_joints.append(int(joint))
        if int(joint) in ends:
            put(depth + 1, "End Site")
            put(depth + 1, "{")
            put(depth + 2, f"OFFSET {_vector(ends[int(joint)], digits)}")
            put(depth + 1, "}")
    close(-1)
    return lines


def _vector(values: Floats, digits: int) -> str:
    return " ".join(f"{value:.{digits}f}" for value in np.round(values, digits) + 0.0)
