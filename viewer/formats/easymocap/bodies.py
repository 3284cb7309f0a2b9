"""Body parameters of EasyMocap's records: layouts by length, and rows collected per person.

The first three values of ``poses`` are the rotation of the root, which EasyMocap writes as 0:
``Rh`` and ``Th`` move the body about the model's origin. Hand components of SMPL-X and MANO exclude
the mean hand; those of SMPL+H include it.
"""

from __future__ import annotations

from array import array
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import field, replace

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import wording
from viewer.errors import FormatError
from viewer.formats._text.numbers import LARGEST
from viewer.formats._translation_limit import within_text
from viewer.formats.easymocap.files import (
    FrameFiles,
    Record,
    RecordError,
    has_numbers,
    limit_of,
    load_people,
    row_of,
    take_row,
    width_of,
)
from viewer.phrases import one_of
from viewer.rigs.arrays import Bools, Floats
from viewer.rigs.bodies.smpl_family import FAMILY, members_by_numbers
from viewer.rigs.geometry.vectors import StatedUp
from viewer.rigs.motion.body_motion import BodyMotion
from viewer.rigs.motion.timing import Timing

COEFFICIENTS = ("shapes", "expression")
"""Keys of a record that later records of the same person may omit."""
_SMPL, _SMPLH, _SMPLX, _MANO = FAMILY[24], FAMILY[52], FAMILY[55], FAMILY[16]
_BODY = members_by_numbers()[66]
_FACE = _SMPLX.names[22:25]
_VPOSER = 32
_SHAPES = 10  # shape components that precede the expression components in the legacy code
_LOOKED_AT = 8  # number of frames that determine the usual numbers of values


@dataclass(frozen=True, slots=True)
class BodyLayout:
    """Assignment of the values in ``poses`` to joints."""

    model: str
    """Member of the SMPL family."""
    names: tuple[str, ...]
    """Joints that are rotated, the root first."""
    columns: tuple[tuple[int, int], ...]
    """Ranges of ``poses`` for all joints except the root, in the order of ``names``."""
    root: int = 3
    """Number of values at the beginning that rotate the root: 3 or 0."""
    hands: tuple[tuple[str, int, int], ...] = ()
    """Side, and the range of ``poses`` with its components."""
    is_flat: bool = True
    """Whether the mean hand is excluded by default."""
    widths: tuple[tuple[str, int], ...] = ()
    """Keys of a record that are read, with their number of values."""


_LAYOUTS = {
    72: BodyLayout("SMPL", _SMPL.names, ((3, 72),)),
    69: BodyLayout("SMPL", _SMPL.names, ((0, 69),), root=0),
    78: BodyLayout(
        "SMPL+H", _BODY, ((3, 66),), hands=(("left", 66, 72), ("right", 72, 78)), is_flat=False
    ),
    63: BodyLayout("SMPL+H", _BODY, ((0, 63),), root=0, is_flat=False),
    156: BodyLayout("SMPL+H", _SMPLH.names, ((3, 156),)),
    # The face is last here, but precedes the hands in SMPL-X.
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


def body_layout(record: Record, usual: Mapping[str, int] | None = None) -> BodyLayout:
    """Return the layout of a valid record, found by the length of its ``poses``."""
    usual = usual or {}
    count = len(row_of(record, "poses"))
    if count == _VPOSER:
        raise RecordError(
            "poses",
            "expected rotations, found {found} numbers, a VPoser latent vector, which needs "
            "the VPoser network to decode: export full poses from EasyMocap",
            found=count,
        )
    layout = _LAYOUTS.get(count)
    if layout is None:
        raise _odd_length(sorted(_LAYOUTS), count)
    widths = [("Rh", 3), ("Th", 3), ("poses", count)]
    keys = [key for key in COEFFICIENTS if has_numbers(record, key)]
    if count == 63:
        keys += [key for key in ("handl", "handr") if has_numbers(record, key)]
    widths = [(key, width_of(record, key, width)) for key, width in widths]
    widths += [(key, max(width_of(record, key), usual.get(key, 0))) for key in keys]
    if count != usual.get("poses", count):
        raise _odd_length([usual["poses"]], count)
    return replace(layout, widths=tuple(widths))


def _odd_length(expected: list[int], found: int) -> RecordError:
    return RecordError(
        "poses",
        "expected {expected} numbers, found {found}",
        expected=one_of(expected),
        found=found,
    )


def with_coefficients(layout: BodyLayout, record: Record, usual: Mapping[str, int]) -> BodyLayout:
    """Return a layout extended by coefficients that occur in a record for the first time."""
    known = [key for key, _ in layout.widths]
    new = [key for key in COEFFICIENTS if has_numbers(record, key) and key not in known]
    more = [(key, max(width_of(record, key), usual.get(key, 0))) for key in new]
    return replace(layout, widths=(*layout.widths, *more))


def usual_widths(files: FrameFiles) -> dict[str, int]:
    """Return the most frequent number of ``poses``, and the largest numbers of coefficients."""
    # The first record alone must not decide for all others, because it may be unusual.
    found = [dict(layout.widths) for layout in _layouts(files)]
    if not found:
        return {}
    # The first of several equally frequent numbers is used.
    ((usual, _),) = Counter(widths["poses"] for widths in found).most_common(1)
    alike = [widths for widths in found if widths["poses"] == usual]
    most = {key: max(widths.get(key, 0) for widths in alike) for key in COEFFICIENTS}
    return {"poses": usual} | most


def _layouts(files: FrameFiles) -> list[BodyLayout]:
    """Return the layouts of all valid records in some frames."""
    last = len(files.frames) - 1
    chosen = np.unique(np.linspace(0, last, min(last + 1, _LOOKED_AT)).round().astype(int))
    found: list[BodyLayout] = []
    for folder in files.folders if files.frames else ():
        for index in chosen.tolist() if folder.has_bodies else ():
            name = folder.names.get(files.frames[index])
            if name is None:
                continue
            try:
                people = load_people(str(folder.path / name), files.max_size)
            except FormatError:  # reported when the frame is read
                continue
            found += [*filter(None, map(_layout, people))]
    return found


def _layout(record: object) -> BodyLayout | None:
    try:
        return body_layout(record) if isinstance(record, dict) else None
    except RecordError:  # reported when the frame is read
        return None


RowFault = tuple[int, str, RecordError]
"""An invalid record: its row, the name of the invalid part, and the problem."""
_Remark = tuple[str, str, str]
"""A note, not an error: message key, file, and key within the record."""


@dataclass(slots=True)
class Rows:
    """Values of one person in some frames, in reading order, with their origins."""

    frames: list[int] = field(default_factory=list)
    paths: list[str] = field(default_factory=list)
    # Indices of the records in the files' lists of people.
    places: list[int] = field(default_factory=list)

    def keep_origin(self, frame: int, path: str, place: int) -> None:
        """Store the origin of an accepted record."""
        self.frames.append(frame)
        self.paths.append(path)
        self.places.append(place)

    def timing(
        self, n_frames: int, rate: float, first_frame: int, keep: Bools | None = None
    ) -> Timing:
        """Return the timing of the valid rows; the person is absent in all other frames."""
        rows = np.full(n_frames, -1, dtype=np.int32)
        frames = np.array(self.frames, dtype=np.int64)
        frames = frames if keep is None else frames[keep]
        rows[frames] = np.arange(len(frames))
        return Timing(rate, rows, first_frame, holds=False)


@dataclass(slots=True, kw_only=True)
class BodyRows(Rows):
    """Body parameters of one person."""

    layout: BodyLayout
    """Layout of all records."""
    known: dict[str, Floats] | None = None
    """The person's last coefficients (C,) by key, which ``values`` updates; None for people without
    an identity, whose rows are independent of each other."""
    buffers: list[array[float]] = field(default_factory=list)
    """Values of the layout's keys, record after record."""
    remarks: list[_Remark] = field(default_factory=list)
    """Remarks that ``values`` adds."""
    _lacking: dict[str, list[int]] = field(default_factory=dict)
    _plan: list[tuple[str, int, Callable[[list[float]], None]]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.widen(self.layout)

    def widen(self, layout: BodyLayout) -> None:
        """Add coefficients that no earlier record had; see ``with_coefficients``."""
        self.layout = layout
        for key, count in layout.widths[len(self.buffers) :]:
            self.buffers.append(array("d", bytes(8 * count * len(self.frames))))
            self._lacking[key] = [*range(len(self.frames))]
        self._plan = [(key, count, buffer.fromlist) for (key, count), buffer in self._buffers()]

    def add(self, record: Record, frame: int, path: str, place: int) -> None:
        """Add one record, or raise ``RecordError`` if a value is missing or its length differs."""
        try:
            for key, count, put in self._plan:
                if key not in record:
                    self._lack(key, count, put)
                    continue
                values = record[key]
                if len(values) == 1:
                    values = values[0]
                if len(values) != count:
                    values = _completed(key, values, count)
                put(values)
        except (KeyError, TypeError, ValueError, OverflowError):
            self._take_slowly(record)
        self.keep_origin(frame, path, place)

    def _take_slowly(self, record: Record) -> None:
        """Add a record that may be invalid; the first error is raised with its exact location."""
        self._drop_unfinished()
        try:
            for key, count, put in self._plan:
                if has_numbers(record, key) or key not in COEFFICIENTS:
                    given = row_of(record, key)
                    if key in COEFFICIENTS and len(given) < count:
                        record = {**record, key: _completed(key, given, count)}
                    take_row(record, key, count, put)
                else:
                    self._lack(key, count, put)
        except RecordError:
            self._drop_unfinished()
            raise

    def _lack(self, key: str, count: int, put: Callable[[list[float]], None]) -> None:
        """Add placeholders for coefficients that the person's other records have."""
        if key not in COEFFICIENTS:
            raise KeyError(key)
        put([0.0] * count)
        self._lacking[key].append(len(self.frames))

    def _drop_unfinished(self) -> None:
        row = len(self.frames)
        for (_, count), buffer in self._buffers():
            del buffer[count * row :]
        for rows in self._lacking.values():
            if rows and rows[-1] == row:
                rows.pop()

    def _buffers(self) -> Iterator[tuple[tuple[str, int], array[float]]]:
        return zip(self.layout.widths, self.buffers, strict=True)

    def values(self) -> tuple[dict[str, Floats], Bools, list[RowFault]]:
        """Return values (N, C) by key, whether each row (N,) is valid, and the faults of others."""
        keep: Bools = np.ones(len(self.frames), dtype=np.bool_)
        values: dict[str, Floats] = {}
        faults: list[RowFault] = []
        for (key, count), buffer in self._buffers():
            rows = np.frombuffer(buffer, dtype=np.float64).reshape(-1, count)
            if key in COEFFICIENTS:
                rows = self._with_missing(key, rows)
            values[key] = rows
            # A single sum detects NaN; rows are examined only then.
            limit = limit_of(key)
            if rows.size and not -limit <= rows.min() <= rows.max() <= limit:
                is_good = (np.abs(rows) <= limit).all(axis=1)
                for row in np.flatnonzero(~is_good & keep):
                    odd = rows[row][~(np.abs(rows[row]) <= limit)][0]
                    problem = RecordError(key, within_text(odd, limit), code="F003")
                    faults.append((int(row), key, problem))
                keep &= is_good
        if faults:
            values = {key: rows[keep] for key, rows in values.items()}
        return values, keep, faults

    def _with_missing(self, key: str, rows: Floats) -> Floats:
        """Repeat earlier coefficients in records that omit them, and add a note."""
        lacking = self._lacking[key]
        is_given: Bools = np.ones(len(rows), dtype=np.bool_)
        is_given[lacking] = False
        if self.known is None:
            if lacking:
                self.remarks.append((wording.RECORD_NO_LAST, self.paths[lacking[0]], key))
            return rows
        before = self.known.get(key)
        filled = hold(rows, is_given, before)
        last = last_given(rows, is_given)
        if last is not None:
            self.known[key] = last
        if lacking:
            is_first = before is None and lacking[0] == 0
            message = (
                wording.RECORD_NO_LAST
                if is_first
                else "F007.record-last: no {item} in this record: the person's last known values "
                "are used"
            )
            self.remarks.append((message, self.paths[lacking[0]], key))
        return filled

    def motion(
        self,
        name: str,
        values: dict[str, Floats],
        timing: Timing,
        flat_hands: bool | None,
        legacy_expression: bool,
        up: StatedUp,
    ) -> BodyMotion:
        """Return the rows as a motion; see ``BodyMotion`` for the meaning of the values."""
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
        vectors.flags.writeable = False  # a read-only array is not copied again
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
            world_rotations=turns,
        )


def _completed(key: str, values: list[object], count: int) -> list[object]:
    """Return coefficients with zeros for those that a record lacks; raise ValueError for others."""
    if key not in COEFFICIENTS or not 0 < len(values) < count:
        raise ValueError(key)
    return [*values, *([0.0] * (count - len(values)))]


def _constant(rows: Floats | None) -> Floats | None:
    """Return a single row if all rows are equal."""
    return rows[:1] if rows is not None and (rows == rows[:1]).all() else rows


def hold(rows: Floats, is_given: Bools, known: Floats | None) -> Floats:
    """Return rows (N, C) whose missing ones repeat the last finite given one, or ``known``."""
    if is_given.all():
        return rows
    last = _last_good(rows, is_given)
    before = np.zeros(rows.shape[1]) if known is None else known
    table = np.concatenate([rows, before[None]])
    # If there is no earlier row, the index -1 selects the row that was appended.
    return np.asarray(np.where(is_given[:, None], rows, table[last]))


def last_given(rows: Floats, is_given: Bools) -> Floats | None:
    """Return the last valid row of (N, C), or None; see ``hold`` for the arguments."""
    last = int(_last_good(rows, is_given)[-1]) if len(rows) else -1
    return rows[last].copy() if last >= 0 else None


def _last_good(rows: Floats, is_given: Bools) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """Return the index of the last valid row up to each row; -1 for none."""
    is_good = is_given & (np.abs(rows) <= LARGEST).all(axis=1)
    return np.maximum.accumulate(np.where(is_good, np.arange(len(rows)), -1))
