"""4D-Humans and PHALP: ``results/NAME.pkl``, a joblib file with the detections of each frame.

::

    "img/000001.jpg": time, shot; and per person: tid, tracked_ids, tracked_time, camera (3,),
                      size (height, width), smpl {global_orient (1, 3, 3), body_pose (23, 3, 3),
                      betas (10,)}; bbox, mask, 3d_joints … are not read

SMPL in the camera's space, with ``camera`` as its translation. Trackers continue to list lost
people in ``tid`` for a while, but ``tracked_time`` counts the frames since they were last seen.
"""

from __future__ import annotations

from collections import defaultdict

import numpy as np

from viewer.diagnostics import note, wording
from viewer.errors import FormatError
from viewer.formats._archive.checking import finite_or_nan, within_reach
from viewer.formats._archive.values import Archive, Value
from viewer.formats._source import Source
from viewer.formats.video_mocap.numbers import (
    RowBudget,
    first_rows,
    intrinsics_of,
    sole,
    vectors_of,
)
from viewer.formats.video_mocap.results import Cameras, Results, Track
from viewer.phrases import counted, listed
from viewer.rigs.arrays import Deferred, Floats
from viewer.rigs.bodies.smpl_family import FAMILY

# Focal length and image size of the network, pixels; the image is scaled to the longer side.
_FOCAL, _IMAGE = 5000.0, 256.0
_SIZES = {"global_orient": 9, "body_pose": 207, "betas": 10}
_N_JOINTS = 24
_LARGEST = 1 << 20  # maximum size of an image, pixels


def recognises(archive: Archive) -> bool:
    """Return whether an archive contains results of this tool."""
    first = archive.inside(archive.keys[0]) if archive.keys else None
    return first is not None and all(map(first.has, ("tid", "smpl", "camera", "time")))


def read(source: Source, archive: Archive) -> Results:
    """Read all visible people, frame by frame."""
    found: dict[int, list[tuple[int, Floats]]] = defaultdict(list)
    size, n_ghosts, n_cuts = None, 0, 0
    budget = RowBudget(archive)
    for key in archive.keys:
        frame = archive.inside(key)
        if frame is None:
            raise archive.fault(
                "F002.video-frame: {item}: expected the detections of a frame, found a different "
                "value",
                item=key,
            )
        number = int(sole(frame, "time"))
        n_cuts += bool(frame.has("shot") and frame.get("shot"))
        budget.spend(len(_whole_numbers(frame, "tid")))
        present = _people(frame)
        n_ghosts += sum(row is None for _, row in present)
        for person, row in present:
            if row is not None:
                found[person].append((number, row))
        size = size or _size(frame)
    people = {person: _track(archive, rows) for person, rows in sorted(found.items())}
    ghosts = note(
        "F007.video-ghosts: {n} of people who are not visible omitted",
        source.path,
        n=counted(n_ghosts, "detection"),
    )
    facts = (("shots", f"{n_cuts + 1}"),) if n_cuts else ()
    return Results(
        "4D-Humans (PHALP)",
        "SMPL",
        {"camera": people},
        {"camera": "-y"},
        {} if size is None else {"camera": _camera(size)},
        facts=facts,
        notes=(ghosts,) if n_ghosts else (),
    )


def _people(frame: Archive) -> list[tuple[int, Floats | None]]:
    """Return the tracks of a frame, each with its 229 numbers, or None for a lost person."""
    tracks = _whole_numbers(frame, "tid")
    ages = _whole_numbers(frame, "tracked_time") if frame.has("tracked_time") else []
    seen = _whole_numbers(frame, "tracked_ids") if frame.has("tracked_ids") else tracks
    bodies, places = frame.inside("smpl"), frame.get("camera")
    n_bodies = 0 if bodies is None else len(bodies.keys)
    n_places = len(places) if isinstance(places, list | tuple) else 0
    if not len(tracks) == n_bodies == n_places or (ages and len(ages) != len(tracks)):
        counts = [len(tracks), n_bodies, n_places]
        raise frame.fault(
            "F002.video-lists: {item}: expected as many bodies and cameras as tracks, found "
            "{counts}",
            item="tid",
            counts=listed(counts),
        )
    found: list[tuple[int, Floats | None]] = []
    for index, track in enumerate(tracks):
        is_lost = (ages and ages[index] != 0) or track not in seen
        if is_lost or bodies is None or not isinstance(places, list | tuple):
            found.append((track, None))
            continue
        body = bodies.inside(str(index)) or bodies
        parts = [_as_numbers(body, key, body.array(key), n) for key, n in _SIZES.items()]
        place = _as_numbers(frame, "camera", places[index], 3)
        found.append((track, np.concatenate([*parts, place])))
    return found


def _as_numbers(archive: Archive, key: str, value: Value, count: int) -> Floats:
    values = value.values() if isinstance(value, Deferred) else np.zeros(0)
    if values.dtype.kind not in "iuf" or values.size != count:
        raise archive.fault(
            wording.VIDEO_COUNT, item=key, expected=counted(count, "number"), found=values.size
        )
    return values.reshape(count).astype(np.float64)


def _whole_numbers(frame: Archive, key: str) -> list[int]:
    """Return a list of whole numbers, which may be empty."""
    values = frame.get(key)
    if isinstance(values, Deferred):
        values = values.values().reshape(-1).tolist()
    items = values if isinstance(values, list | tuple) else [None]
    numbers = [int(item) for item in items if isinstance(item, int)]
    if len(numbers) < len(items):
        raise frame.fault(
            "F002.video-whole: {item}: expected a list of integers, found a different value",
            item=key,
        )
    return numbers


def _track(archive: Archive, rows: list[tuple[int, Floats]]) -> Track:
    frames, first = first_rows(archive.source, [frame for frame, _ in rows])
    stacked = np.array([row for _, row in rows])[first]
    numbers = finite_or_nan(archive, "smpl or camera", stacked)
    turned = numbers[:, :216].reshape(-1, _N_JOINTS, 3, 3)
    return Track(
        frames,
        FAMILY[24].names,
        vectors_of(archive, "smpl", turned),
        within_reach(archive, "camera", numbers[:, 226:229]),
        numbers[:, 216:226],
    )


def _size(frame: Archive) -> tuple[int, int] | None:
    """Return width and height of the video, from the first detection that states them."""
    try:
        sizes = frame.array("size", (None, 2)).values() if frame.has("size") else np.zeros((0, 2))
    except FormatError:
        return None
    if not len(sizes) or not 0 < sizes[0].min() <= sizes[0].max() < _LARGEST:
        return None
    return int(sizes[0][1]), int(sizes[0][0])


def _camera(size: tuple[int, int]) -> Cameras:
    focal = _FOCAL / _IMAGE * max(size)
    return Cameras.still(intrinsics_of(focal, np.array(size) / 2), size)
