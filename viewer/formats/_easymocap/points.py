"""Keypoints of EasyMocap records, collected per person.

``keypoints3d`` has rows of x, y, z and confidence, or of x, y, z with full confidence; hands and
face may have separate keys. A confidence of 0 means "not detected".
"""

from __future__ import annotations

from array import array
from dataclasses import field
from itertools import chain
from typing import Any

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Phrase
from viewer.formats._archive.values import describe
from viewer.formats._easymocap.bodies import RowFault, Rows
from viewer.formats._easymocap.json_frames import RecordError
from viewer.formats._text.numbers import LARGEST
from viewer.rig.arrays import Bools, Floats
from viewer.rig.captures.keypoint_layouts import TITLES, joined_layout, keypoint_layout
from viewer.rig.captures.points import PointLayout

__all__ = ["KEY", "PointRows", "point_layout"]

KEY = "keypoints3d"
_BESIDE = ("handl3d", "handr3d", "face3d")
_MOST = 1 << 16  # maximum number of keypoints of one person
_FOUR, _THREE = {4}, {3}

Parts = tuple[tuple[str, int], ...]


def point_layout(record: dict[str, Any], title: str = "") -> tuple[PointLayout, Parts]:
    """Return the layout of a record's keypoints, and its keys with their numbers of points.

    Parameters
    ----------
    record : dict
        Record of one person.
    title : str
        Name of the layout, used if ``keypoints3d`` has its number of points.

    Raises
    ------
    RecordError
        If the value of a key is not a list of rows.
    """
    parts = [(key, _count(record, key)) for key in (KEY, *_BESIDE) if key in record]
    counts = [count for _, count in parts]
    body = keypoint_layout(counts[0], title if title in TITLES.get(counts[0], ()) else "")
    if len(parts) == 1:
        return body, tuple(parts)
    beside = {key: keypoint_layout(count) for key, count in parts[1:]}
    for key, side in (("handl3d", 0), ("handr3d", 1)):
        if key in beside and len(beside[key].names) == 21:
            beside[key] = _one_hand(side)
    joined = joined_layout("", [body, *beside.values()])
    whole = keypoint_layout(len(joined.names))
    # Body, hands and face in the standard order form a layout with its own name.
    named = whole if whole.names == joined.names else None
    text = " + ".join([body.title, *beside])
    return named or PointLayout(text, joined.names, joined.limbs, joined.sides), tuple(parts)


def _one_hand(side: int) -> PointLayout:
    both = keypoint_layout(42)
    first, stop = 21 * side, 21 * side + 21
    inside = (both.limbs >= first).all(axis=1) & (both.limbs < stop).all(axis=1)
    limbs = both.limbs[inside] - first
    return PointLayout("hand", both.names[first:stop], limbs, both.sides[first:stop])


def _count(record: dict[str, Any], key: str) -> int:
    rows = record[key]
    if not isinstance(rows, list) or not rows or not all(isinstance(row, list) for row in rows):
        raise RecordError(key, Phrase("record-rows", found=describe(rows)))
    if len(rows) > _MOST:
        raise RecordError(key, Phrase("record-most-points", most=_MOST, found=len(rows)))
    return len(rows)


@dataclass(slots=True, kw_only=True)
class PointRows(Rows):
    """Keypoints of one person.

    Attributes
    ----------
    layout : PointLayout
        Layout of all records.
    parts : tuple of (str, int)
        Keys of a record, with their number of points.
    buffer : array
        x, y, z, confidence of all points, record after record.
    """

    layout: PointLayout
    parts: Parts
    buffer: array[float] = field(default_factory=lambda: array("d"))

    def add(self, record: dict[str, Any], frame: int, path: str, place: int) -> None:
        """Add one record.

        Raises
        ------
        RecordError
            If a key is missing, or its number of points has changed.
        """
        before = len(self.buffer)
        try:
            for key, count in self.parts:
                self._take(record.get(key), key, count)
        except RecordError:
            del self.buffer[before:]
            raise
        self.keep_origin(frame, path, place)

    def check_any(self) -> None:
        """Refuse rows without a valid keypoint, which must not determine the layout of others.

        Raises
        ------
        RecordError
            If every keypoint is invalid.
        """
        if _is_odd(self._rows()).all():
            raise RecordError(KEY, Phrase("record-no-rows"))

    def _take(self, rows: Any, key: str, count: int) -> None:
        try:
            if len(rows) == count:
                widths = set(map(len, rows))
                if widths == _FOUR:
                    self.buffer.fromlist(list(chain.from_iterable(rows)))
                    return
                if widths == _THREE:
                    certain = [[*row, 1.0] for row in rows]
                    self.buffer.fromlist(list(chain.from_iterable(certain)))
                    return
        except (TypeError, ValueError, OverflowError):
            pass  # the error is reported below
        if not isinstance(rows, list):
            raise RecordError(key, Phrase("record-points", expected=count, found=describe(rows)))
        if len(rows) != count:
            raise RecordError(key, Phrase("record-points", expected=count, found=len(rows)))
        raise RecordError(key, Phrase("record-other-rows"))

    def points(self) -> tuple[Floats, list[RowFault]]:
        """Return the points (N, K, 4), and the errors in invalid rows."""
        points = self._rows().copy()
        is_odd, is_unseen = _is_odd(points), points[..., 3] == 0.0
        points[is_odd | is_unseen] = 0.0
        faults = [
            (int(row), "", RecordError(KEY, Phrase("record-unseen", n=int(is_odd[row].sum()))))
            for row in np.flatnonzero(is_odd.any(axis=1))
        ]
        points.flags.writeable = False  # a read-only array is not copied again
        return points, faults

    def _rows(self) -> Floats:
        count = sum(size for _, size in self.parts)
        return np.frombuffer(self.buffer, dtype=np.float64).reshape(-1, count, 4)


def _is_odd(points: Floats) -> Bools:
    """Return a mask of the invalid points, (N, K, 4), whose confidence is not 0."""
    confidence = points[..., 3]
    is_good = (np.abs(points) <= LARGEST).all(axis=-1) & (confidence >= 0.0)
    return ~is_good & (confidence != 0.0)
