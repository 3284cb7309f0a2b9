"""Writer of ``.skel`` files; see ``skel.py`` for the grammar."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from viewer.diagnostics import Diagnostic
from viewer.errors import UnsupportedFormatError
from viewer.formats._skel.keywords import KEYWORDS, UNLIMITED
from viewer.formats._text.numbers import LARGEST
from viewer.media.saving import as_words, save_text
from viewer.rig.arrays import Floats
from viewer.rig.figure import Figure
from viewer.rig.skeleton import Skeleton, joint_label

__all__ = ["write"]

_DEEPEST = 32  # maximum number of tabs at the beginning of a line


def write(figure: Figure, path: str | Path) -> list[Diagnostic]:
    """Write a figure's skeleton.

    Parameters
    ----------
    figure : Figure
        Figure with a skeleton in depth-first order, with rotation DOFs and without rest rotations.
    path : str or Path
        File, replaced only when the whole text has been written.

    Returns
    -------
    list of Diagnostic
        Empty: the format stores every property of a skeleton that it accepts.

    Raises
    ------
    UnsupportedFormatError
        If the format cannot store the skeleton.
    OutputError
        If the file cannot be written.
    """
    if figure.skeleton is None:
        raise _unsupported("F002.skel-none", figure=figure.name)
    _check_dofs(figure.skeleton)
    _check_numbers(figure.skeleton)
    _check_names(figure.skeleton)
    save_text(path, "".join(_lines(figure.skeleton)))
    return []


def _check_dofs(skeleton: Skeleton) -> None:
    unturned = np.allclose(skeleton.rest_rotations[:, :3], 0.0, atol=1e-12)
    unscaled = np.allclose(skeleton.rest_scales, 1.0, atol=1e-12)
    if not (unturned and unscaled):
        raise _unsupported("F002.skel-rest")
    rotations = np.arange(6, 3 * skeleton.n_joints + 3)
    table = np.concatenate([np.arange(6), np.tile([3, 4, 5], skeleton.n_joints - 1)])
    owners = np.concatenate([np.zeros(6, int), 1 + (rotations - 6) // 3])
    if not (
        np.array_equal(skeleton.dof_kinds, table) and np.array_equal(skeleton.dof_joints, owners)
    ):
        raise _unsupported("F002.skel-dofs")
    if skeleton.rest_dofs[:3].any() or np.isfinite(skeleton.dof_limits[:3]).any():
        raise _unsupported("F002.skel-root")


def _check_numbers(skeleton: Skeleton) -> None:
    limits = skeleton.dof_limits
    finite = np.isfinite(limits)
    if (finite & np.stack([limits[:, 0] <= -UNLIMITED, limits[:, 1] >= UNLIMITED], 1)).any():
        raise _unsupported("F002.skel-limits", most=UNLIMITED)
    arrays = [skeleton.rest_translations, skeleton.boxes, skeleton.rest_dofs, limits[finite]]
    if any(np.abs(array).max(initial=0.0) > LARGEST for array in arrays if array is not None):
        raise _unsupported("F002.skel-numbers", most=LARGEST)


def _check_names(skeleton: Skeleton) -> None:
    ancestors: list[int] = []
    for joint, parent in enumerate(skeleton.parents):
        while ancestors and ancestors[-1] != parent:
            ancestors.pop()
        if parent >= 0 and not ancestors:
            raise _unsupported("F002.skel-order", joint=joint_label(skeleton, joint))
        ancestors.append(joint)
    for name in skeleton.names:
        words = as_words(name)
        if words is None or KEYWORDS & set(words):
            raise _unsupported("F002.skel-name", name=name)


def _unsupported(key: str, **values: Any) -> UnsupportedFormatError:
    return UnsupportedFormatError(Diagnostic(key, values=values))


def _lines(skeleton: Skeleton) -> list[str]:
    lines: list[str] = []
    open_joints: list[int] = []

    def close_until(parent: int) -> None:
        while open_joints and open_joints[-1] != parent:
            open_joints.pop()
            lines.append(_indent(open_joints) + "}\n")

    for joint, parent in enumerate(skeleton.parents):
        close_until(parent)
        indent = _indent(open_joints)
        lines.append(" ".join(filter(None, [f"{indent}balljoint", skeleton.names[joint], "{\n"])))
        lines.extend(f"{indent}\t{item}\n" for item in _items(skeleton, joint))
        open_joints.append(joint)
    close_until(-1)
    return lines


def _indent(open_joints: list[int]) -> str:
    # A fully indented chain of n joints would take n^2 bytes.
    return "\t" * min(len(open_joints), _DEEPEST)


def _items(skeleton: Skeleton, joint: int) -> list[str]:
    items = [f"offset {_numbers(skeleton.rest_translations[joint])}"]
    if skeleton.boxes is not None:
        low, high = skeleton.boxes[joint]
        items += [f"boxmin {_numbers(low)}", f"boxmax {_numbers(high)}"]
    rows = slice(3 + 3 * joint, 6 + 3 * joint)
    for axis, limits in zip("xyz", skeleton.dof_limits[rows], strict=True):
        if np.isfinite(limits).any():
            written = np.nan_to_num(limits, posinf=UNLIMITED, neginf=-UNLIMITED)
            items.append(f"rot{axis}limit {_numbers(written)}")
    return [*items, f"pose {_numbers(skeleton.rest_dofs[rows])}"]


def _numbers(values: Floats) -> str:
    return " ".join(map(repr, values.tolist()))
