"""Usual numbers of values in a recording, determined from a few frames spread over it.

The first record alone must not decide for all others, because it may be unusual.
"""

from __future__ import annotations

from collections import Counter

import numpy as np

from viewer.errors import FormatError
from viewer.formats._easymocap.bodies import BodyLayout, body_layout
from viewer.formats._easymocap.files import FrameFiles
from viewer.formats._easymocap.json_frames import RecordError, load_people
from viewer.formats._easymocap.shapes import COEFFICIENTS

__all__ = ["usual_widths"]

_LOOKED_AT = 8  # number of frames


def usual_widths(files: FrameFiles, max_size: int) -> dict[str, int]:
    """Return the most frequent number of ``poses``, and the largest numbers of coefficients.

    Parameters
    ----------
    files : FrameFiles
        Files of the recording.
    max_size : int
        Maximum size of a file in bytes.

    Returns
    -------
    mapping of str to int
        Number of values of a record by key; empty if there are no valid bodies.
    """
    found = [dict(layout.widths) for layout in _layouts(files, max_size)]
    if not found:
        return {}
    # The first of several equally frequent numbers is used.
    ((usual, _),) = Counter(widths["poses"] for widths in found).most_common(1)
    alike = [widths for widths in found if widths["poses"] == usual]
    most = {key: max(widths.get(key, 0) for widths in alike) for key in COEFFICIENTS}
    return {"poses": usual} | most


def _layouts(files: FrameFiles, max_size: int) -> list[BodyLayout]:
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
                people = load_people(str(folder.path / name), max_size)
            except FormatError:  # reported when the frame is read
                continue
            found += [*filter(None, map(_layout, people))]
    return found


def _layout(record: object) -> BodyLayout | None:
    try:
        return body_layout(record) if isinstance(record, dict) else None
    except RecordError:  # reported when the frame is read
        return None
