"""Folders in the layout of EasyMocap for tests."""

import json
from pathlib import Path

import numpy as np
from faults import Fault, fault_of, warnings_of

from viewer.formats import Source, easymocap


def waves(*shape: int, seed: float = 0.0) -> np.ndarray:
    """Return values from -0.6 to 0.6 with three decimals, all different."""
    count = int(np.prod(shape))
    return np.round(0.6 * np.sin(seed + 1.7 * np.arange(1, count + 1) ** 1.3), 3).reshape(shape)


def body(person: int, count: int = 72, seed: float = 0.0, flat: bool = False, **changes) -> dict:
    """Return a record of body parameters; keys set to None are left out."""
    poses = waves(count, seed=seed)
    if count not in (69, 63):
        poses[:3] = 0.0
    values = {
        "Rh": waves(3, seed=seed + 1),
        "Th": waves(3, seed=seed + 2),
        "poses": poses,
        "shapes": waves(10, seed=person + 3),
    }
    record = {key: value.tolist() if flat else [value.tolist()] for key, value in values.items()}
    record = {"id": person, **record, **changes}
    return {key: value for key, value in record.items() if value is not None}


def points(person: int, count: int = 25, columns: int = 4, seed: float = 0.0, **changes) -> dict:
    """Return a record of keypoints with confidences from 0.4 to 1."""
    rows = waves(count, columns, seed=seed)
    if columns == 4:
        rows[:, 3] = 0.7 + 0.5 * rows[:, 3]
    return {"id": person, "keypoints3d": rows.tolist(), **changes}


def write_frames(folder: Path, frames: dict[int | str, object]) -> Path:
    """Write frame files; numbers become names of six digits, strings are used unchanged."""
    folder.mkdir(parents=True, exist_ok=True)
    for frame, content in frames.items():
        name = f"{frame:06}" if isinstance(frame, int) else frame
        text = content if isinstance(content, str) else json.dumps(content)
        (folder / f"{name}.json").write_text(text)
    return folder


def opened(path: Path, **options):
    """Return a capture, its parts, and the warnings of the source."""
    source = Source.open(path)
    capture = easymocap.read(source, easymocap.Options(**options))
    return capture, list(capture.parts()), warnings_of(source.diagnostics)


def noticed(parts: list, path: Path | None = None) -> list[Fault]:
    """Return the warnings of all parts; if a path is given, check that all are about that file."""
    found = [one for part in parts for one in part.warnings]
    assert all(str(one).isprintable() for one in found)
    assert path is None or all(one.path == path for one in found)
    return [fault_of(one) for one in found]


def rows_of(parts: list, person: int) -> list[int]:
    """Return the frames of all parts in which the body of a person is present."""
    frames = [
        np.flatnonzero(part.bodies[person].timing.present)
        for part in parts
        if person in part.bodies
    ]
    return [int(frame) for part in frames for frame in part]


def standing(person, x):
    """Return keypoints of a person upright along z, of whom only hips and nose are detected."""
    rows = np.zeros((25, 4))
    rows[8], rows[0] = (x, 0, 1, 1.0), (x, 0, 1.6, 0.5)
    return {"id": person, "keypoints3d": rows.tolist()}
