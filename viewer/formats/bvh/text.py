"""Text of a BVH file, in the subset that all known readers accept.

One item per line and "{" alone on its line (Blender counts lines), one ROOT, six channels on it and
three on the others, positions first, the same rotation order everywhere, no exponents, LF. Names
are UTF-8: see ``held_names`` and ``safe_names``.
"""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np

from viewer.formats._text.number_text import fixed_texts
from viewer.progress import report
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.hierarchy import depth_first

_SPACES = " \t\n\r\v\f"  # white space of the format

# Lone surrogates, except those that stand for bytes which are not UTF-8, are not text.
_NOT_HELD = re.compile("[{}\n\r\v\f\ud800-\udc7f\udd00-\udfff]")
_ITEM = re.compile(r"((?:^|[ \t])(?:OFFSET|CHANNELS))[ \t]+(?=[-+.\d])", re.IGNORECASE)
_SPACE = re.compile(r"\s")
_DEEPEST = 32  # maximum indentation in tabs
_BLOCK = 256  # number of frames formatted together
_SECONDS_DIGITS = 9  # minimum decimals of the frame time, for a relative error below 1e-8


def held_names(names: Sequence[str]) -> tuple[str, ...]:
    """Return names with everything replaced that the format cannot hold; others are unchanged.

    It cannot hold braces, line ends, spaces at either end, a keyword followed by a number (which
    begins an item), and characters that are not text.

    >>> held_names(["mixamorig:Hips", "left {leg}", " a"])
    ('mixamorig:Hips', 'left _leg_', 'a')
    """
    kept = [_NOT_HELD.sub("_", name.strip(_SPACES)) for name in names]
    return tuple(_ITEM.sub(r"\1_", name) for name in kept)


def safe_names(names: Sequence[str]) -> tuple[str, ...]:
    """Return names that every program can read: unique, and consisting only of ``[A-Za-z0-9_]``.

    >>> safe_names(["hip", "hip", "", "left knee", "é"])
    ('hip', 'hip_2', 'joint2', 'left_knee', 'e')
    """
    bare = []
    for index, name in enumerate(names):
        letters = unicodedata.normalize("NFKD", name)
        letters = "".join(letter for letter in letters if not unicodedata.combining(letter))
        text = re.sub(r"[^A-Za-z0-9_]", "_", letters)
        bare.append(text if text.strip("_") else f"joint{index}")
    # Valid names are reserved first, so that they stay unchanged wherever they occur.
    taken = {text for text, name in zip(bare, names, strict=True) if text == name}
    result: list[str] = []
    used: set[str] = set()
    numbers: Counter[str] = Counter()
    for text, name in zip(bare, names, strict=True):
        chosen = text
        while chosen in used or (chosen in taken and chosen != name):
            numbers[text] += 1
            chosen = f"{text}_{numbers[text] + 1}"
        used.add(chosen)
        result.append(chosen)
    return tuple(result)


def odd_names(names: Sequence[str]) -> list[str]:
    """Return the names that some programs cannot read: empty, repeated, with spaces, not ASCII."""
    counts = Counter(names)
    return [
        name
        for name, count in counts.items()
        if count > 1 or not name or not name.isascii() or _SPACE.search(name)
    ]


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
    """Return the text before the frames; ``ends`` are End Sites, ``names`` as of held_names."""
    lines = ["HIERARCHY"]
    rotations = " ".join(f"{axis.upper()}rotation" for axis in rotation_order)
    open_joints: list[int] = []

    def put(depth: int, text: str) -> None:
        lines.append("\t" * min(depth, _DEEPEST) + text)

    def close(until: int) -> None:
        while open_joints and open_joints[-1] != until:
            open_joints.pop()
            put(len(open_joints), "}")

    for joint in depth_first(parents):
        parent = int(parents[joint])
        close(parent)
        depth = len(open_joints)
        put(depth, f"{'ROOT' if parent < 0 else 'JOINT'} {names[joint]}".rstrip(" "))
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

    seconds = 1.0 / rate
    decimals = max(_SECONDS_DIGITS, _SECONDS_DIGITS - 1 - int(np.floor(np.log10(seconds))))
    lines += ["MOTION", f"Frames: {n_frames}", f"Frame Time: {seconds:.{decimals}f}"]
    return ("\n".join(lines) + "\n").encode("utf-8", "surrogateescape")


def frame_texts(
    parents: Ints, moves: Bools, positions: Floats, angles: Floats, digits: int
) -> Iterator[bytes]:
    """Yield the lines of frames (F, J, 3), joints in the file's order, angles in radians."""
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
        yield from fixed_texts(np.concatenate(columns, axis=1), digits)


def _vector(values: Floats, digits: int) -> str:
    return " ".join(f"{value:.{digits}f}" for value in np.round(values, digits) + 0.0)
