"""PromptHMR (yufu-wang/PromptHMR): ``results.pkl``, a joblib file of people and a camera.

::

    people      id: frames (L,)
                    smplx_world: pose (L, 165)  shape (L, 10)  trans (L, 3)
                    smplx_cam: rotmat (L, 55, 3, 3)  shape  trans; pose, contact … are not read
    camera_world    Rcw (F, 3, 3)  Tcw (F, 3), or Rwc and Twc;  img_focal  img_center

SMPL-X with flat hands; fingers that the tool leaves as zero matrices are not rotated. The world has
y up. Masks, keypoints and features are not read.
"""

from __future__ import annotations

import numpy as np

from viewer.diagnostics import wording
from viewer.formats._archive.values import Archive
from viewer.formats._source import Source
from viewer.formats.video_mocap.numbers import (
    RowBudget,
    first_rows,
    frames_of,
    has,
    intrinsics_of,
    matrices,
    numbers,
    person_number,
    places,
    pose_of,
    rows,
)
from viewer.formats.video_mocap.results import Cameras, Results, Track, inverse
from viewer.rigs.arrays import Floats
from viewer.rigs.bodies.smpl_family import FAMILY

_SPACES = {"world": "smplx_world", "camera": "smplx_cam"}
_WAYS = (("Rcw", "Tcw", False), ("Rwc", "Twc", True), ("pred_cam_R", "pred_cam_T", True))


def recognises(archive: Archive) -> bool:
    """Return whether an archive contains results of this tool."""
    people = archive.inside("people")
    persons = [] if people is None else [people.inside(key) for key in people.keys[:1]]
    return any(has(person, "frames", key) for person in persons for key in _SPACES.values())


def read(source: Source, archive: Archive) -> Results:
    """Read all people in both spaces."""
    tracks, budget = archive.inside("people"), RowBudget(archive)
    found: list[tuple[int, str, Archive, Archive]] = []
    for key in () if tracks is None else tracks.keys:
        person = None if tracks is None else tracks.inside(key)
        number = person_number(key)
        if person is None or number is None:
            raise archive.fault(wording.VIDEO_PERSON, item=f"people.{key}")
        for space, part in _SPACES.items():
            body = person.inside(part)
            if body is not None and body.has("trans"):
                budget.spend(sum(body.shape("trans")[:1]))
                found.append((number, space, person, body))
    people: dict[str, dict[int, Track]] = {}
    for number, space, person, body in found:
        count = (person.array("frames").shape or (0,))[0]
        if body.has("rotmat"):
            vectors = matrices(body, "rotmat", (count, 55, 3, 3))
        else:
            vectors = rows(body, "pose", (count, 165)).reshape(count, 55, 3)
        frames, first = first_rows(person.source, frames_of(person, "frames", count))
        shape = rows(body, "shape", (count, None))[first] if body.has("shape") else None
        people.setdefault(space, {})[number] = Track(
            frames, FAMILY[55].names, vectors[first], places(body, "trans", count)[first], shape
        )
    ordered = {space: people[space] for space in _SPACES if space in people}
    return Results(
        "PromptHMR", "SMPL-X", ordered, {"world": "y", "camera": "-y"}, _cameras(archive)
    )


def _cameras(archive: Archive) -> dict[str, Cameras]:
    found: dict[str, Cameras] = {}
    world, camera = archive.inside("camera_world"), archive.inside("camera")
    source = next((part for part in (world, camera) if has(part, "img_focal", "img_center")), None)
    if source is None:
        return found
    center = numbers(source, "img_center", 2)
    matrix = intrinsics_of(numbers(source, "img_focal", 1), center)
    size = round(2 * float(center[0])), round(2 * float(center[1]))
    found["camera"] = Cameras.still(matrix, size)
    if world is not None:
        pose = _pose(world)
        if pose is not None:
            found["world"] = Cameras(np.arange(len(pose[1])), matrix, *pose, size)
    return found


def _pose(world: Archive) -> tuple[Floats, Floats] | None:
    """Return R and T from the world to the camera."""
    for turned, placed, is_inverse in _WAYS:
        pose = pose_of(world, turned, placed)
        if pose is not None:
            return inverse(*pose) if is_inverse else pose
    return None
