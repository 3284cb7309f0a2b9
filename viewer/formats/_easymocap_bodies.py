"""Body parameters of EasyMocap's records: their layouts by length, gathered person by person.

The first three numbers of ``poses`` are the root's own rotation, 0 in what EasyMocap writes: ``Rh``
and ``Th`` place the body about the model's origin. Hand components of SMPL-X and MANO leave the
mean hand out; those of SMPL+H add it.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from viewer.formats._easymocap_json import MisfitError, row_of, take_row
from viewer.formats._numbers import LARGEST
from viewer.rig.arrays import Bools, Floats
from viewer.rig.body_motion import BodyMotion
from viewer.rig.smpl_family import FAMILY, members_by_numbers
from viewer.rig.timing import Timing

__all__ = ["BodyLayout", "BodyRows", "Rows", "body_layout"]

_SMPL, _SMPLH, _SMPLX, _MANO = FAMILY[24], FAMILY[52], FAMILY[55], FAMILY[16]
_BODY = members_by_numbers()[66]
_FACE = _SMPLX.names[22:25]
_VPOSER = 32
_SHAPES = 10  # shape numbers that the legacy code puts before those of the expression


@dataclass(frozen=True, slots=True)
class BodyLayout:
    """Where the numbers of ``poses`` go.

    Attributes
    ----------
    model : str
        The member of the SMPL family.
    names : tuple of K str
        Joints that are turned, the root first.
    columns : tuple of (int, int)
        Parts of ``poses`` that turn all but the root, in the order of ``names``.
    root : int
        Numbers of the root's own rotation at the beginning: 3 or 0.
    hands : tuple of (str, int, int)
        Side, and the part of ``poses`` with components.
    is_flat : bool
        Whether the mean hand is left out unless someone says otherwise.
    widths : tuple of (str, int)
        Keys of a record that are read, and their numbers.
    """

    model: str
    names: tuple[str, ...]
    columns: tuple[tuple[int, int], ...]
    root: int = 3
    hands: tuple[tuple[str, int, int], ...] = ()
    is_flat: bool = True
    widths: tuple[tuple[str, int], ...] = ()


_LAYOUTS = {
    72: BodyLayout("SMPL", _SMPL.names, ((3, 72),)),
    69: BodyLayout("SMPL", _SMPL.names, ((0, 69),), root=0),
    78: BodyLayout(
        "SMPL+H", _BODY, ((3, 66),), hands=(("left", 66, 72), ("right", 72, 78)), is_flat=False
    ),
    63: BodyLayout("SMPL+H", _BODY, ((0, 63),), root=0, is_flat=False),
    156: BodyLayout("SMPL+H", _SMPLH.names, ((3, 156),)),
    # The face comes last here, and before the hands in SMPL-X.
    87: BodyLayout(
        "SMPL-X",
        (*_BODY, *_FACE),
        ((3, 66), (78, 87)),
        hands=(("left", 66, 72), ("right", 72, 78)),
    ),
    165: BodyLayout("SMPL-X", _SMPLX.names, ((3, 165),)),
    9: BodyLayout("MANO", _MANO.names[:1], (), hands=(("", 3, 9),)),
    48: BodyLayout("MANO", _MANO.names, ((3, 48),)),
}


def body_layout(record: dict[str, Any]) -> BodyLayout:
    """Return the layout of a record, as the length of its ``poses`` tells.

    Raises
    ------
    MisfitError
        If no layout has this length.
    """
    count = len(row_of(record, "poses"))
    if count == _VPOSER:
        raise MisfitError(
            f"poses: expected rotations, found {count} numbers, a code of VPoser that only its "
            "network can decode: write full poses in EasyMocap"
        )
    layout = _LAYOUTS.get(count)
    if layout is None:
        known = ", ".join(str(number) for number in sorted(_LAYOUTS))
        raise MisfitError(f"poses: expected {known} numbers, found {count}")
    widths = [("Rh", 3), ("Th", 3), ("poses", count)]
    widths += [(key, len(row_of(record, key))) for key in ("shapes", "expression") if key in record]
    hands = layout.hands
    if count == 63:
        keys = [key for key in ("handl", "handr") if key in record]
        widths += [(key, len(row_of(record, key))) for key in keys]
    return BodyLayout(
        layout.model,
        layout.names,
        layout.columns,
        layout.root,
        hands,
        layout.is_flat,
        tuple(widths),
    )


@dataclass(slots=True)
class Rows:
    """What one person has in some frames: numbers as they come, and where they come from."""

    frames: list[int] = field(default_factory=list)
    paths: list[str] = field(default_factory=list)

    def timing(
        self, n_frames: int, rate: float, first_frame: int, keep: Bools | None = None
    ) -> Timing:
        """Return on which frames of the whole recording the kept rows are; absent elsewhere."""
        rows = np.full(n_frames, -1, dtype=np.int32)
        frames = np.array(self.frames, dtype=np.int64)
        frames = frames if keep is None else frames[keep]
        rows[frames] = np.arange(len(frames))
        return Timing(rate, rows, first_frame, holds=False)


@dataclass(slots=True, kw_only=True)
class BodyRows(Rows):
    """Body parameters of one person.

    Attributes
    ----------
    layout : BodyLayout
        Of all records.
    buffers : list of array
        Numbers of the layout's keys, one record behind the other.
    """

    layout: BodyLayout
    buffers: list[array[float]] = field(default_factory=list)
    _plan: list[tuple[str, int, Callable[[list[Any]], None]]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.buffers = [array("d") for _ in self.layout.widths]
        self._plan = [(key, count, buffer.fromlist) for (key, count), buffer in self._buffers()]

    def add(self, record: dict[str, Any], frame: int, path: str) -> None:
        """Take in one record.

        Raises
        ------
        MisfitError
            If something is missing, or has another length than before.
        """
        try:
            for key, count, put in self._plan:
                values = record[key]
                if len(values) == 1:
                    values = values[0]
                if len(values) != count:
                    raise ValueError
                put(values)
        except (KeyError, TypeError, ValueError, OverflowError):
            self._take_slowly(record)
        self.frames.append(frame)
        self.paths.append(path)

    def _take_slowly(self, record: dict[str, Any]) -> None:
        """Take in what may be odd, and say what is wrong with it."""
        widths = [(count, buffer) for (_, count), buffer in self._buffers()]
        for count, buffer in widths:
            del buffer[count * len(self.frames) :]
        try:
            for key, count, put in self._plan:
                take_row(record, key, count, put)
        except MisfitError:
            for count, buffer in widths:
                del buffer[count * len(self.frames) :]
            raise

    def _buffers(self) -> Iterator[tuple[tuple[str, int], array[float]]]:
        return zip(self.layout.widths, self.buffers, strict=True)

    def values(self) -> tuple[dict[str, Floats], Bools, list[tuple[str, str]]]:
        """Return the numbers by key, which rows are finite, and the faults of the others.

        Returns
        -------
        values : mapping of str to (N, C)
            Of the finite rows.
        keep : (rows,) bool
            Which ones those are.
        faults : list of (str, str)
            File and text for each of the others.
        """
        keep: Bools = np.ones(len(self.frames), dtype=np.bool_)
        values, faults = {}, []
        for (key, count), buffer in self._buffers():
            rows = np.frombuffer(buffer, dtype=np.float64).reshape(-1, count)
            values[key] = rows
            # NaN passes through the sum; the rows are looked at only if something is wrong.
            if rows.size and not -LARGEST <= rows.min() <= rows.max() <= LARGEST:
                is_good = (np.abs(rows) <= LARGEST).all(axis=1)
                for row in np.flatnonzero(~is_good & keep):
                    odd = rows[row][~(np.abs(rows[row]) <= LARGEST)][0]
                    text = f"{key}: expected finite numbers, found {odd:g}"
                    faults.append((self.paths[row], text))
                keep &= is_good
        if faults:
            values = {key: rows[keep] for key, rows in values.items()}
        return values, keep, faults

    def motion(
        self,
        name: str,
        values: dict[str, Floats],
        timing: Timing,
        flat_hands: bool | None,
        legacy_expression: bool,
        up: str,
    ) -> BodyMotion:
        """Return the rows as a motion; see ``BodyMotion`` for what the numbers mean."""
        layout, poses = self.layout, values["poses"]
        vectors = np.zeros((len(poses), len(layout.names), 3))
        joint = 1
        for start, stop in layout.columns:
            count = (stop - start) // 3
            vectors[:, joint : joint + count] = poses[:, start:stop].reshape(-1, count, 3)
            joint += count
        own = poses[:, : layout.root]
        turns = values["Rh"] if own.any() else None
        vectors[:, 0] = values["Rh"] if turns is None else own
        vectors.flags.writeable = False  # so that it is not copied again
        hands = {side: poses[:, start:stop] for side, start, stop in layout.hands}
        hands |= {
            side: values[key]
            for side, key in (("left", "handl"), ("right", "handr"))
            if key in values
        }
        shape, expression = values.get("shapes"), values.get("expression")
        if legacy_expression and shape is not None and expression is not None:
            first = np.zeros((len(shape), _SHAPES))
            first[:, : shape.shape[1]] = shape[:, :_SHAPES]
            shape, expression = np.concatenate([first, expression], axis=1), None
        return BodyMotion(
            name,
            timing,
            layout.names,
            vectors,
            values["Th"],
            about_origin=turns is None,
            shape=_constant(shape),
            expression=_constant(expression),
            hands=hands,
            flat_hands=layout.is_flat if flat_hands is None else flat_hands,
            up=up,
            world_turns=turns,
        )


def _constant(rows: Floats | None) -> Floats | None:
    """Return one row where all are the same."""
    return rows[:1] if rows is not None and (rows == rows[:1]).all() else rows
