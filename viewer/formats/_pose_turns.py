"""How joints are turned, as pose files say it: arrays beside the values of the DOFs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.errors import printable
from viewer.formats._archive import describe
from viewer.formats._numbers import LARGEST
from viewer.formats._source import Source
from viewer.rig.arrays import Floats
from viewer.rig.pose_transfer import JointTurns

__all__ = ["KEYS", "named_turns", "read_turns"]

KEYS = (
    "joint_turns",
    "joint_names",
    "joint_rotations",
    "joint_shifts",
    "up",
    "dof_layout",
    "figure",
)
"""What is read; nothing is unless the first is there."""

_UPS = ("y", "z")
_SHORTEST = 1e-6  # of a quaternion: a shorter one says nothing
_LONGEST_WORD = 200  # characters


def read_turns(source: Source, values: Mapping[str, Any]) -> JointTurns | None:
    """Return the turns in a pose file, None if there are none.

    Parameters
    ----------
    source : Source
        The file, for messages.
    values : mapping of str to object
        What it holds by name.

    Raises
    ------
    FormatError
        If they are incomplete or no quaternions.
    """
    if values.get("joint_turns") is None:
        return None
    names = _names(source, values.get("joint_names"))
    turns = _quaternions(source, "joint_turns", values["joint_turns"], names)
    rotations = values.get("joint_rotations")
    shifts = values.get("joint_shifts")
    return JointTurns(
        _word(source, "figure", values.get("figure", "")),
        names,
        turns / np.linalg.norm(turns, axis=1, keepdims=True),
        np.zeros((len(names), 3))
        if shifts is None
        else _rows(source, "joint_shifts", shifts, len(names), 3),
        _up(source, values.get("up", "y")),
        _word(source, "dof_layout", values.get("dof_layout", "")),
        None if rotations is None else _quaternions(source, "joint_rotations", rotations, names),
    )


def named_turns(turns: JointTurns) -> dict[str, Any]:
    """Return turns by the names that files have for them; what is at rest is left out."""
    named: dict[str, Any] = {
        "figure": printable(turns.figure, _LONGEST_WORD),
        "up": turns.up,
        "dof_layout": turns.layout,
        "joint_names": list(turns.names),
        "joint_turns": turns.turns.tolist(),
    }
    if turns.rotations is not None:
        named["joint_rotations"] = turns.rotations.tolist()
    if turns.shifts.any():
        named["joint_shifts"] = turns.shifts.tolist()
    return named


def _array(source: Source, key: str, value: Any, kinds: str, what: str) -> NDArray[Any]:
    try:
        array = np.asarray(value)
    except ValueError:  # lists of different lengths
        array = np.zeros(0, dtype=object)
    if array.dtype.kind in kinds:
        return array
    found = "a list of other things" if isinstance(value, list | tuple) else describe(value)
    raise source.error(f"{key}: expected {what}, found {found}")


def _names(source: Source, value: Any) -> tuple[str, ...]:
    names = _array(source, "joint_names", value, "U", "names")
    if names.ndim != 1:
        raise source.error(f"joint_names: expected a list of names, found {names.ndim} dimensions")
    return tuple(names.tolist())


def _rows(source: Source, key: str, value: Any, count: int, width: int) -> Floats:
    array = _array(source, key, value, "iuf", "numbers").astype(np.float64)
    if array.shape != (count, width):
        found = " x ".join(map(str, array.shape)) or "one number"
        raise source.error(f"{key}: expected {count} x {width} numbers, found {found}")
    wrong = array[~(np.abs(array) <= LARGEST)]
    if len(wrong):
        raise source.error(f"{key}: expected finite numbers, found {wrong[0]:g}")
    return array


def _quaternions(source: Source, key: str, value: Any, names: tuple[str, ...]) -> Floats:
    """Return a quaternion per joint, of any length but 0."""
    rows = _rows(source, key, value, len(names), 4)
    short = np.flatnonzero(np.linalg.norm(rows, axis=1) < _SHORTEST)
    if len(short):
        name = printable(names[short[0]], 60)
        raise source.error(f"{key}: {name}: expected a quaternion, found four zeros")
    return rows


def _word(source: Source, key: str, value: Any) -> str:
    word = value.item() if isinstance(value, np.ndarray) and value.ndim == 0 else value
    if not isinstance(word, str):
        raise source.error(f"{key}: expected a word, found {describe(value)}")
    return word[:_LONGEST_WORD]


def _up(source: Source, value: Any) -> str:
    word = _word(source, "up", value)
    if word not in _UPS:
        raise source.error(f'up: expected "y" or "z", found "{printable(word, 20)}"')
    return word
