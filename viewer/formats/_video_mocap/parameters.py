"""SMPL parameters in dicts of any layout, found by the usual spellings of their keys.

::

    poses      poses, pose, rotmat … of all joints; or global_orient … and body_pose …
    places     trans, transl … ; cam_t … in the space of a camera, where y points down
    shape      betas, shape …
    frames     frame_ids, frames …; detection_all (N, C) of CLIFF, whose first column they are
    person     person_id, track_id, id …, one number, or one for each frame
    rate       fps, frame_rate, frameRate …, frames per second

Several rows with the same frame are several people. Dicts may be nested: people by number, frames
in a list, or parameters within another dict. AMASS files and single poses have other spellings and
are read by ``amass.py`` and ``pose.py``.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Callable, Iterator, Mapping

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import FormatError
from viewer.formats._archive.checking import within_reach
from viewer.formats._archive.values import Archive
from viewer.formats._source import Source
from viewer.formats._video_mocap.numbers import (
    Frames,
    RowBudget,
    first_rows,
    frames_of,
    person_number,
    places,
    rows,
    shape_of,
)
from viewer.formats._video_mocap.results import Results, Track
from viewer.formats._video_mocap.rotation_arrays import Form, form_of, rotation_vectors
from viewer.phrases import printable
from viewer.rig.arrays import Deferred, Floats
from viewer.rig.motion.timing import is_rate
from viewer.rig.smpl_family import FAMILY, members_by_numbers

__all__ = ["read", "recognises"]

_AMASS = {
    *("poses", "pose", "fullpose", "smpl_poses"),
    *("root_orient", "global_orient", "pose_body", "body_pose"),
}
_WHOLE = (
    *("pose_world", "poses_world", "poses", "pose", "fullpose", "full_pose", "smpl_poses"),
    *("smpl_pose", "thetas", "theta", "pred_thetas", "smpl_thetas"),
    *("rotmat", "pred_rotmat", "pose_rotmat", "pred_pose", "body_rotmat", "bodyPose"),
)
_ROOTS = (
    *("global_orient", "root_orient", "pred_global_orient", "orient", "root_pose", "root_rot"),
    *("smplx_root_pose", "global_rot"),
)
_BODIES = ("body_pose", "pose_body", "pred_body_pose", "smplx_body_pose")
_WORLD = (
    *("trans_world", "trans", "transl", "translation", "smpl_trans", "root_trans"),
    *("smplx_transl", "Th", "bodyTranslation"),
)
_CAMERA = (
    *("cam_t", "pred_cam_t", "cam_trans", "camera_translation", "pred_trans", "pred_cam_trans"),
    *("trans_cam", "cam_transl", "transl_cam", "trans_full", "global_t"),
)
_SHAPES = (
    *("betas", "shape", "shapes", "pred_betas", "pred_shape", "beta", "smpl_shape", "smplx_shape"),
    *("shapeParameters",),
)
_FRAMES = ("frame_ids", "frames", "frame", "frame_id", "frame_idx", "frame_indices")
_RATES = ("fps", "frame_rate", "frameRate", "mocap_framerate", "mocap_frame_rate")
_DETECTIONS = "detection_all"
_PEOPLE = (
    *("person_id", "track_id", "tracklet_id", "person", "pid", "id"),
    *("person_ids", "track_ids", "pids", "ids"),
)
_NAMES = {len(names): names for names in members_by_numbers().values()}
_LARGEST = 1 << 30  # maximum number of a frame or person
_DEEPEST = 3  # maximum depth of dicts inside dicts
_COST = 20  # number of frames that take about as long to read as one dict takes to inspect
_LOOKED_AT = 5000  # number of dicts of which at least one must be recognised
_LISTED = 12  # maximum number of ignored keys that are listed


@dataclass(frozen=True, slots=True)
class _Layout:
    """Keys of one dict of parameters, and the forms of its rotations."""

    poses: tuple[tuple[str, Form], ...]
    place: str
    shape: str
    frames: str
    person: str
    rate: str

    @property
    def keys(self) -> list[str]:
        others = (self.place, self.shape, self.frames, self.person, self.rate)
        return [key for key, _ in self.poses] + [key for key in others if key]


def recognises(archive: Archive) -> bool:
    """Return whether an archive has SMPL parameters in a layout other than AMASS's."""
    layout = _layout(archive)
    if layout is None:
        budget = RowBudget(archive, _COST * _LOOKED_AT)
        try:
            return next(_found(archive, budget), None) is not None
        except FormatError:  # there are thousands of dicts without poses
            return False
    is_plain = all(key in _AMASS and form.size == 3 for key, form in layout.poses)
    return not is_plain or layout.place in _CAMERA or bool(layout.frames)


def read(source: Source, archive: Archive) -> Results:
    """Read all people."""
    found = [*_found(archive)]
    layout = found[0][2]
    people = _people(source, found)
    is_camera = layout.place in _CAMERA
    space = "camera" if is_camera else "world"
    if not layout.place:
        source.warn("F007.motion-place")
    recognised = [f"{key} ({form.title} of {form.n_joints} joints)" for key, form in layout.poses]
    recognised += layout.keys[len(layout.poses) :]
    ignored = [key for key in found[0][1].keys if key not in layout.keys][:_LISTED]
    rest = ", ".join(map(printable, ignored))
    source.warn("F007.video-parameters", n=len(people), recognised=recognised, ignored=rest)
    n_joints = sum(form.n_joints for _, form in layout.poses)
    model = FAMILY[n_joints].title if n_joints in FAMILY else "SMPL"
    facts = (("recognised", ", ".join(recognised)),)
    return Results(
        "SMPL parameters",
        model,
        {space: people},
        {space: "-y" if is_camera else ""},
        frame_rate=_rate(found[0][1], layout.rate),
        facts=facts,
    )


def _rate(archive: Archive, key: str) -> float | None:
    """Return the frame rate; None if the value is not a frame rate."""
    value = archive.get(key) if key else None
    if isinstance(value, Deferred) and value.dtype.kind in "iuf":
        value = float(value.values().reshape(-1)[0])
    if not isinstance(value, int | float) or isinstance(value, bool):
        return None
    return float(value) if is_rate(value) else None


def _layout(archive: Archive) -> _Layout | None:
    """Return the layout of a dict; None if it has no poses."""
    whole = _first_form(archive, _WHOLE, tuple(_NAMES))
    if whole is not None:
        poses: tuple[tuple[str, Form], ...] = (whole,)
    else:
        root, body = _first_form(archive, _ROOTS, (1,)), _first_form(archive, _BODIES, (21, 23))
        if root is None or body is None:
            return None
        if root[1].n_frames != body[1].n_frames:
            return None
        poses = (root, body)
    count = poses[0][1].n_frames
    place = _first(archive, (*_WORLD, *_CAMERA), lambda shape: _is_place(shape, count))
    shape = _first(archive, _SHAPES, lambda shape: _is_shape(shape, count))
    frames = _first(archive, _FRAMES, lambda shape: shape == (count,))
    person = ""
    if count == 1:
        frames = frames or _first_number(archive, _FRAMES)
        person = _first_number(archive, _PEOPLE)
    elif not frames and shape_of(archive, _DETECTIONS)[:1] == (count,):
        frames = _DETECTIONS
    if frames and count > 1:
        person = _first(archive, _PEOPLE, lambda shape: shape == (count,))
    rate = _first(archive, _RATES, lambda shape: shape in ((), (1,)))
    return _Layout(poses, place, shape, frames, person, rate)


def _first_form(
    archive: Archive, keys: tuple[str, ...], joints: tuple[int, ...]
) -> tuple[str, Form] | None:
    for key in keys:
        form = form_of(archive, key, joints) if archive.has(key) else None
        if form is not None:
            return key, form
    return None


def _first(archive: Archive, keys: tuple[str, ...], fits: Callable[[tuple[int, ...]], bool]) -> str:
    return next((key for key in keys if archive.has(key) and fits(shape_of(archive, key))), "")


def _first_number(archive: Archive, keys: tuple[str, ...]) -> str:
    return next((key for key in keys if _number(archive, key) is not None), "")


def _number(archive: Archive, key: str) -> int | None:
    """Return an integer, also as an array of one; None for other values."""
    value = archive.get(key) if key and archive.has(key) else None
    if isinstance(value, Deferred) and value.dtype.kind in "iu" and value.shape in ((), (1,)):
        value = int(value.values().reshape(-1)[0])
    if not isinstance(value, int) or isinstance(value, bool):
        return None
    return value if abs(value) < _LARGEST else None


def _is_place(shape: tuple[int, ...], count: int) -> bool:
    return shape in ((count, 3), (count, 1, 3)) or (count == 1 and shape == (3,))


def _is_shape(shape: tuple[int, ...], count: int) -> bool:
    return (len(shape) == 1 and shape[0] > 0) or (len(shape) == 2 and shape[0] in (1, count))


def _found(
    archive: Archive, budget: RowBudget | None = None, depth: int = 0
) -> Iterator[tuple[tuple[str, ...], Archive, _Layout]]:
    """Yield the path, the dict and the layout of all dicts with poses."""
    layout = _layout(archive)
    budget = budget or RowBudget(archive)
    budget.spend(_COST if layout is None else layout.poses[0][1].n_frames)
    if layout is not None:
        yield (), archive, layout
        return
    for key in archive.keys if depth < _DEEPEST else ():
        inner = archive.inside(key)
        if inner is not None:
            yield from (
                ((key, *path), found, kept)
                for path, found, kept in _found(inner, budget, depth + 1)
            )


def _people(
    source: Source, found: list[tuple[tuple[str, ...], Archive, _Layout]]
) -> dict[int, Track]:
    """Return the tracks of people: dicts of single frames are combined into people.

    Single frames with different joints or numbers of coefficients are different people.
    """
    tracks = [_track(archive, layout) for _, archive, layout in found]
    are_single = all(len(track.frames) == 1 for track in tracks)
    is_alike = len({(track.joint_names, _width(track.shape)) for track in tracks}) == 1
    if are_single and is_alike and len(tracks) > 1:
        kept = [(archive, layout) for _, archive, layout in found]
        return _people_of_frames(source, kept, tracks)
    return _people_of_arrays(source, found, tracks)


def _people_of_arrays(
    source: Source, found: list[tuple[tuple[str, ...], Archive, _Layout]], tracks: list[Track]
) -> dict[int, Track]:
    """Return the people of dicts, each of which has all frames of one or several people."""
    people: dict[int, Track] = {}
    most = 1
    for index, ((path, archive, layout), track) in enumerate(zip(found, tracks, strict=True)):
        persons = _persons(archive, layout, track.frames)
        numbers = np.unique(persons)
        if len(numbers) > 1:
            most = max(most, 0 if layout.person else len(numbers))
            for number in numbers.tolist():
                own = number if number not in people else _unused(people, index)
                people[own] = _rows_of(source, track, np.flatnonzero(persons == number))
            continue
        known = (person_number(part) for part in path)
        number = next((each for each in known if each is not None and each >= 0), index)
        people[number if number not in people else _unused(people, index)] = _rows_of(
            source, track, np.arange(len(persons))
        )
    if most > 1:
        source.warn("F007.video-repeated", n=most)
    return people


def _persons(archive: Archive, layout: _Layout, frames: Frames) -> Frames:
    """Return the person of each row; rows with the same frame are counted if they have no IDs."""
    if len(frames) > 1 and layout.person:
        return frames_of(archive, layout.person, len(frames))
    order = np.argsort(frames, kind="stable")
    firsts = np.searchsorted(frames[order], frames[order], side="left")
    persons = np.zeros(len(frames), dtype=np.int64)
    persons[order] = np.arange(len(frames)) - firsts
    return persons


def _rows_of(source: Source, track: Track, chosen: Frames) -> Track:
    """Return rows of a track in the order of their frames; warn if a frame occurs again."""
    frames, first = first_rows(source, track.frames[chosen])
    kept = chosen[first]
    shape, count = track.shape, len(track.frames)
    if track.vectors is None or track.translations is None:
        return track
    return Track(
        frames,
        track.joint_names,
        track.vectors[kept],
        track.translations[kept],
        shape[kept] if shape is not None and len(shape) == count else shape,
    )


def _people_of_frames(
    source: Source, found: list[tuple[Archive, _Layout]], tracks: list[Track]
) -> dict[int, Track]:
    """Return the people of single frames; without numbers, they are counted within each frame."""
    persons = [_number(archive, layout.person) for archive, layout in found]
    known = [person for person in persons if person is not None and person >= 0]
    if len(known) < len(tracks):
        known = [0] * len(tracks)
        if all(layout.frames for _, layout in found):
            seen: Counter[int] = Counter()
            for row, track in enumerate(tracks):
                frame = int(track.frames[0])
                known[row] = seen[frame]
                seen[frame] += 1
    listed: dict[int, list[Track]] = {person: [] for person in sorted(set(known))}
    for track, person in zip(tracks, known, strict=True):
        listed[person].append(track)
    people = {person: _joined(own) for person, own in listed.items()}
    if len(people) > 1 and not all(layout.person for _, layout in found):
        source.warn("F007.video-repeated", n=len(people))
    return people


def _unused(people: Mapping[int, Track], first: int) -> int:
    """Return the lowest unused number of a person, starting at ``first``."""
    return next(number for number in itertools.count(first) if number not in people)


def _track(archive: Archive, layout: _Layout) -> Track:
    parts = [rotation_vectors(archive, key, form) for key, form in layout.poses]
    vectors = np.concatenate(parts, axis=1)
    count = len(vectors)
    placed = np.zeros((count, 3))
    if layout.place:
        shape = shape_of(archive, layout.place)
        if shape == (3,):
            single = rows(archive, layout.place, shape)[None]
            placed = within_reach(archive, layout.place, single)
        else:
            placed = places(archive, layout.place, count)
    frames = np.arange(count)
    number = _number(archive, layout.frames) if count == 1 else None
    if number is not None:
        frames = np.array([number])
    elif layout.frames:
        frames = frames_of(archive, layout.frames, count)
    coefficients = _coefficients(archive, layout.shape)
    return Track(frames, _NAMES[vectors.shape[1]], vectors, placed, coefficients)


def _coefficients(archive: Archive, key: str) -> Floats | None:
    if not key:
        return None
    found = rows(archive, key, shape_of(archive, key))
    return found.reshape(-1, found.shape[-1])


def _width(shape: Floats | None) -> int:
    return 0 if shape is None else shape.shape[1]


def _joined(tracks: list[Track]) -> Track:
    """Return the frames of one person, each of which is a separate dict.

    The numbers of frames are used if all are different; otherwise frames are in the given order.
    """
    numbers = np.concatenate([track.frames for track in tracks])
    frames, order = np.unique(numbers, return_index=True)
    if len(frames) < len(tracks):
        frames = order = np.arange(len(tracks))
    vectors = [track.vectors for track in tracks if track.vectors is not None]
    placed = [track.translations for track in tracks if track.translations is not None]
    shapes = [track.shape for track in tracks if track.shape is not None]
    return Track(
        frames,
        tracks[0].joint_names,
        np.concatenate(vectors)[order],
        np.concatenate(placed)[order],
        np.concatenate(shapes)[order] if len(shapes) == len(tracks) else None,
    )
