"""Rotations of joints in pose files: arrays in addition to the values of the DOFs."""

from __future__ import annotations

from typing import Any

import numpy as np

from viewer.diagnostics import Phrase
from viewer.formats._archive.values import describe
from viewer.formats._pose.named_values import NamedValues
from viewer.phrases import printable
from viewer.rig.arrays import Floats
from viewer.rig.retargeting.pose_transfer import JointRotations

__all__ = ["KEYS", "named_rotations", "read_rotations"]

KEYS = (
    "joint_turns",
    "joint_names",
    "joint_rotations",
    "joint_shifts",
    "joint_scales",
    "joint_meanings",
    "left",
    "up",
    "dof_layout",
    "figure",
)
"""Keys that are read; all are ignored if the first is missing."""

_UPS = ("y", "z")
_SHORTEST = 1e-6  # minimum length of a quaternion; a shorter one defines no reliable rotation
_LONGEST_WORD = 200  # maximum number of characters of a text


def read_rotations(named: NamedValues) -> JointRotations | None:
    """Return the joint rotations in a pose file, or None.

    Parameters
    ----------
    named : NamedValues
        Values of the file by name.

    Raises
    ------
    FormatError
        If the rotations are incomplete or not quaternions.
    """
    values = named.values
    if values.get("joint_turns") is None:
        return None
    names = _names(named)
    turns = _quaternions(named, "joint_turns", names)
    rotations = values.get("joint_rotations")
    shifts, scales = values.get("joint_shifts"), values.get("joint_scales")
    return JointRotations(
        _word(named, "figure", ""),
        names,
        turns / np.linalg.norm(turns, axis=1, keepdims=True),
        np.zeros((len(names), 3))
        if shifts is None
        else _rows(named, "joint_shifts", len(names), 3),
        _up(named),
        _word(named, "dof_layout", ""),
        None if rotations is None else _quaternions(named, "joint_rotations", names),
        _meanings(named, len(names)),
        _left(named),
        None if scales is None else _rows(named, "joint_scales", len(names), 3),
    )


def named_rotations(rotations: JointRotations) -> dict[str, Any]:
    """Return joint rotations by their keys in files; rest transforms are omitted."""
    named: dict[str, Any] = {
        "figure": printable(rotations.figure, _LONGEST_WORD),
        "up": rotations.up,
        "dof_layout": rotations.layout,
        "joint_names": list(rotations.names),
        "joint_turns": rotations.relative.tolist(),
    }
    if rotations.rotations is not None:
        named["joint_rotations"] = rotations.rotations.tolist()
    if rotations.meanings:
        named["joint_meanings"] = list(rotations.meanings)
        named["left"] = rotations.left[None].tolist()
    if rotations.shifts.any():
        named["joint_shifts"] = rotations.shifts.tolist()
    if rotations.scales is not None:
        named["joint_scales"] = rotations.scales.tolist()
    return named


def _names(named: NamedValues) -> tuple[str, ...]:
    names = named.array("joint_names", "U", Phrase("pose-names"))
    if names.ndim != 1:
        key = "joint_names"
        raise named.fault("F002.pose-list", key, item=key, found=names.ndim)
    return tuple(names.tolist())


def _meanings(named: NamedValues, count: int) -> tuple[str, ...]:
    """Return the meaning of each joint; an empty tuple if their number differs."""
    if named.values.get("joint_meanings") is None:
        return ()
    found = named.array("joint_meanings", "U", Phrase("pose-names"))
    return tuple(found.tolist()) if found.shape == (count,) else ()


def _left(named: NamedValues) -> Floats:
    """Return the direction of the figure's left, +x by default."""
    if named.values.get("left") is None:
        return np.array([1.0, 0.0, 0.0])
    found = _rows(named, "left", 1, 3)[0]
    length = np.linalg.norm(found)
    return found / length if length > _SHORTEST else np.array([1.0, 0.0, 0.0])


def _rows(named: NamedValues, key: str, count: int, width: int) -> Floats:
    array = named.array(key, "iuf", Phrase("pose-numbers"))
    if array.shape != (count, width):
        expected = Phrase("wanted-numbers", shape=(count, width))
        shape = Phrase("pose-shape", shape=array.shape)
        found = shape if array.shape else Phrase("pose-one-number")
        raise named.fault("F002.pose-array", key, item=key, expected=expected, found=found)
    return named.numbers(key)


def _quaternions(named: NamedValues, key: str, names: tuple[str, ...]) -> Floats:
    """Return a quaternion per joint, of any length but 0."""
    rows = _rows(named, key, len(names), 4)
    short = np.flatnonzero(np.linalg.norm(rows, axis=1) < _SHORTEST)
    if len(short):
        row = int(short[0])
        joint = printable(names[row], 60)
        raise named.fault("F002.pose-quaternion", key, row, item=key, joint=joint)
    return rows


def _word(named: NamedValues, key: str, default: str) -> str:
    value = named.values.get(key, default)
    word = value.item() if isinstance(value, np.ndarray) and value.ndim == 0 else value
    if not isinstance(word, str):
        raise named.fault("F002.pose-word", key, item=key, found=describe(value))
    return word[:_LONGEST_WORD]


def _up(named: NamedValues) -> str:
    word = _word(named, "up", "y")
    if word not in _UPS:
        raise named.fault("F002.pose-up", "up", found=printable(word, 20))
    return word
