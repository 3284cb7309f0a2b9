"""Merging of people in a scene whose tracks belong to one person."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from viewer.diagnostics import Diagnostic, Phrase, frame_range
from viewer.errors import RigError
from viewer.rig.arrays import Floats, Ints
from viewer.rig.captures.person import person_label
from viewer.rig.captures.points import PointClip
from viewer.rig.cleanup.frame_rows import Captured, runs_of
from viewer.rig.cleanup.joining_tracks import common_frames, joined_tracks
from viewer.rig.figure import Figure
from viewer.rig.mesh import bounding_box, box_size
from viewer.rig.motion.evaluation import frames_of, world_frames
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.retargeting.drive import Drive
from viewer.rig.scalars import length_text
from viewer.rig.scene import Actor, Scene
from viewer.rig.shape import rest_joints

__all__ = ["merge_people"]

_SAME = 0.25  # maximum distance between two tracks of one person, relative to the body's size


def merge_people(scene: Scene, people: Sequence[int]) -> list[Diagnostic]:
    """Join the tracks of some people, in place; the first one keeps the number.

    Parameters
    ----------
    scene : Scene
        Scene with captured people; bodies and keypoints are joined separately.
    people : sequence of int
        At least two numbers of people.

    Returns
    -------
    list of Diagnostic
        Joined frames, and frames in which both were present.

    Raises
    ------
    RigError
        If there is no such person, or they are too far apart in a frame.
    """
    notes: list[Diagnostic] = []
    known = sorted({actor.person for actor in scene.actors if actor.person is not None})
    if not known:
        raise RigError("people to merge: expected people with numbers, found none")
    for person in people:
        if person not in known:
            named = ", ".join(map(str, known))
            raise RigError(f"people to merge: expected numbers among {named}, found {person}")
    for kind in (SampledClip, PointClip):
        tracks = {actor.person: actor for actor in scene.actors if isinstance(actor.clip, kind)}
        kept = next((tracks[person] for person in people if person in tracks), None)
        for person in people:
            other = tracks.get(person)
            if kept is None or other is None or other is kept:
                continue
            if isinstance(kept.clip, Captured) and isinstance(other.clip, Captured):
                notes += _merge(kept, kept.clip, other, other.clip)
            scene.actors.remove(other)
        if kept is not None and kept.person != people[0]:
            notes.append(_renumbered(kept, people[0]))
            kept.person = people[0]
    return notes


def _renumbered(actor: Actor, person: int) -> Diagnostic:
    """Return a note about a body or keypoints that the first person did not have."""
    part = Phrase("part-points" if isinstance(actor.clip, PointClip) else "part-body")
    values = {"part": part, "other": person_label(actor.person or 0), "kept": person_label(person)}
    return Diagnostic("X006.renumbered", values=values)


def _merge(kept: Actor, first: Captured, other: Actor, second: Captured) -> list[Diagnostic]:
    """Transfer the frames of one actor to another; return notes."""
    names: dict[str, object] = {
        "kept": person_label(kept.person or 0),
        "other": person_label(other.person or 0),
    }
    both = common_frames(first, second)
    apart = _apart(kept, first, other, second, both)
    kept.clip = joined_tracks(first, second)
    kept.drive = _joined_drives(kept.drive, other.drive)
    timing = first.timing
    names["n"] = int(second.timing.present.sum())
    notes = [Diagnostic("X006.merged", values=names)]
    if len(both):
        is_both = np.zeros(int(both[-1]) + 1, dtype=np.bool_)
        is_both[both] = True
        spans = [
            frame_range(a + timing.first_frame, b + timing.first_frame - 1)
            for a, b in runs_of(is_both)
        ]
        values = {"frames": spans, "distance": length_text(kept.figure, apart)}
        notes.append(Diagnostic("X006.overlap", values={**names, "n": len(both), **values}))
    return notes


def _joined_drives(first: Drive | None, second: Drive | None) -> Drive | None:
    """Return the merged drive of a person with two tracks; None if one of them is not driven."""
    if first is None or second is None:
        return None
    motion = first.motion
    clip = joined_tracks(motion.clip, second.motion.clip)
    assert isinstance(clip, SampledClip)  # both clips are sampled
    return replace(first, motion=replace(motion, clip=clip))


def _apart(
    kept: Actor,
    first: Captured,
    other: Actor,
    second: Captured,
    both: Ints,
) -> float:
    """Return the median distance of two tracks in their common frames.

    Raises RigError if it is too large for two tracks of one person.
    """
    if not len(both):
        return 0.0
    places = [_places(kept.figure, first, both), _places(other.figure, second, both)]
    apart = float(np.nanmedian(np.linalg.norm(places[1] - places[0], axis=1)))
    if apart > _SAME * _size(kept.figure, first):
        a, b = person_label(kept.person or 0), person_label(other.person or 0)
        number = int(both[0]) + first.timing.first_frame
        raise RigError(
            f"people to merge: {a} and {b} are both present in {len(both)} frames (first: frame "
            f"{number}), {length_text(kept.figure, apart)} apart: they are two people"
        )
    return apart


def _places(figure: Figure, clip: Captured, frames: Ints) -> Floats:
    """Return the positions of a person, of the root or the mean of the visible points: (F, 3)."""
    if isinstance(clip, PointClip):
        points = clip.points[clip.timing.rows[frames]]
        seen = (points[..., 3:] > 0.0).astype(float)
        return (points[..., :3] * seen).sum(axis=1) / np.maximum(seen.sum(axis=1), 1.0)
    times = clip.timing.start + frames / clip.timing.frame_rate
    return world_frames(figure, frames_of(figure, clip, times))[:, 0, :3, 3]


def _size(figure: Figure, clip: Captured) -> float:
    if isinstance(clip, PointClip):
        points = clip.points.reshape(-1, clip.points.shape[1], 4)
        sizes = [
            box_size(bounding_box(row[row[:, 3] > 0.0, :3]))
            for row in points[:: max(1, len(points) // 50)]
            if (row[:, 3] > 0.0).any()
        ]
        return float(np.median(sizes)) if sizes else 0.0
    return box_size(bounding_box(rest_joints(figure)))
