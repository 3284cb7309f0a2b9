"""Frames of a motion whose numbers are not finite or too large: they become gaps.

Readers leave NaN in place of such numbers (``finite_or_nan``, ``within_reach``), compute with it,
and finally omit each frame in which a number of a person is NaN.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from viewer.diagnostics import Diagnostic, Phrase, frame_range, note
from viewer.errors import FormatError
from viewer.formats._source import Source
from viewer.phrases import agree, counted, listed, optional
from viewer.rigs.arrays import Bools, Floats
from viewer.rigs.captures.person import person_label


def invalid_rows(*tables: Floats | None) -> Bools:
    """Return a mask of the rows, (N,), in which any of several (N, ...) tables has NaN."""
    found = [table for table in tables if table is not None]
    bad: Bools = np.zeros(len(found[0]) if found else 0, dtype=np.bool_)
    for table in found:
        if np.isnan(table.sum()):  # most files have no gaps, so this test must be cheap
            bad |= np.isnan(table).reshape(len(table), -1).any(axis=1)
    return bad


def gap_notes(source: Source, lost: Mapping[int | None, NDArray[np.integer]]) -> list[Diagnostic]:
    """Return a note about the frames (N,) of each person that became gaps, if there are any."""
    frames = [
        Phrase(
            "{person}{frames}",
            person=optional("{}, ", "" if person is None else person_label(person)),
            frames=span,
        )
        for person, numbers in lost.items()
        for span in frame_spans(numbers)
    ]
    if not frames:
        return []
    count = sum(map(len, lost.values()))
    return [
        note(
            "F007.frames-lost: {n} with invalid numbers {are}: {frames}; first error: {problem}",
            source.path,
            n=counted(count, "frame"),
            frames=listed(frames),
            problem=_problem(source),
            are=agree(count, "is a gap", "are gaps"),
        )
    ]


def no_frames(source: Source, count: int) -> FormatError:
    """Return the error for a motion in which no frame is valid."""
    return source.fault(
        "F003.frames-lost: expected at least one valid frame, found none in {n}; first "
        "error: {problem}",
        n=counted(count, "frame"),
        problem=_problem(source),
    )


def _problem(source: Source) -> Diagnostic:
    return replace(source.frame_faults[0], path=None, line=None)


def frame_spans(numbers: NDArray[np.integer], step: int = 1) -> list[Phrase]:
    """Return phrases for the runs of frames in ascending numbers, ``step`` apart."""
    runs = np.split(numbers, np.flatnonzero(np.diff(numbers) > step) + 1)
    return [frame_range(int(run[0]), int(run[-1])) for run in runs if len(run)]
