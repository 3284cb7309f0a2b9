"""WHAM (yohanshin/WHAM): ``wham_output.pkl``, a joblib file with the results of each track.

::

    track: pose (T, 72)  trans (T, 3)  pose_world (T, 72)  trans_world (T, 3)  betas (T, 10)
           frame_ids (T,)  verts (T, 6890, 3), which are not read

SMPL with a shape per frame. The world has y up; its ``trans_world`` is read as SMPL's translation,
whereas WHAM's renderings place the midpoint of the hips there. The camera's focal length is the
diagonal of the video, whose size is not in the file.
"""

from __future__ import annotations

from viewer.diagnostics import wording
from viewer.formats._archive.values import Archive
from viewer.formats._source import Source
from viewer.formats.video_mocap.numbers import (
    RowBudget,
    first_rows,
    frames_of,
    has,
    person_number,
    places,
    rows,
)
from viewer.formats.video_mocap.results import Results, Track
from viewer.rigs.bodies.smpl_family import FAMILY

_KEYS = {"world": ("pose_world", "trans_world"), "camera": ("pose", "trans")}


def recognises(archive: Archive) -> bool:
    """Return whether an archive contains results of this tool."""
    if not archive.keys or person_number(archive.keys[0]) is None:
        return False
    person = archive.inside(archive.keys[0])
    # Other tools also use the keys of the camera's space, but in any space and without vertices.
    return has(person, *_KEYS["world"], "betas", "frame_ids") or has(
        person, *_KEYS["camera"], "betas", "frame_ids", "verts"
    )


def read(source: Source, archive: Archive) -> Results:
    """Read both spaces of all people."""
    found = [
        (_number(archive, key), space, person, names)
        for key in archive.keys
        if (person := archive.inside(key)) is not None
        for space, names in _KEYS.items()
        if has(person, *names, "frame_ids")
    ]
    budget = RowBudget(archive)
    for _, _, person, names in found:  # checked before any array is read
        budget.spend(sum(person.shape(names[0])[:1]))
    people: dict[str, dict[int, Track]] = {}
    for number, space, person, names in found:
        people.setdefault(space, {})[number] = _track(person, *names)
    return Results("WHAM", "SMPL", people, {"world": "y", "camera": "-y"})


def _number(archive: Archive, key: str) -> int:
    number = person_number(key)
    if number is None:
        raise archive.fault(wording.VIDEO_PERSON, item=key)
    return number


def _track(person: Archive, poses: str, translations: str) -> Track:
    vectors = rows(person, poses, (None, 72))
    count = len(vectors)
    frames, first = first_rows(person.source, frames_of(person, "frame_ids", count))
    shape = rows(person, "betas", (count, None))[first] if person.has("betas") else None
    return Track(
        frames,
        FAMILY[24].names,
        vectors.reshape(count, 24, 3)[first],
        places(person, translations, count)[first],
        shape,
    )
