"""Clean-up of the captured motions of a scene, with a report of every change."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, Phrase, frame_range, note
from viewer.errors import RigError
from viewer.loading.settings import CleanUp
from viewer.phrases import agree, counted, listed, optional, rounded
from viewer.rigs.arrays import Floats, Ints, runs_of
from viewer.rigs.captures.person import person_label
from viewer.rigs.captures.points import PointClip
from viewer.rigs.cleanup.frames import (
    Captured,
    common_frames,
    interpolate_gaps,
    joined_tracks,
    resampled,
    trimmed,
)
from viewer.rigs.cleanup.smoothing import OneEuro, SavitzkyGolay, run_lengths, smoothed
from viewer.rigs.feet.ground import resting_height
from viewer.rigs.feet.legs import legs_of
from viewer.rigs.feet.planting import lock_feet
from viewer.rigs.figure import Figure
from viewer.rigs.mesh import bounding_box, box_size
from viewer.rigs.motion.evaluation import frames_of, world_frames
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.upright import own_up
from viewer.rigs.retargeting.drive import Drive
from viewer.rigs.scalars import length_text
from viewer.rigs.scene import Actor, Scene, pose_actors
from viewer.rigs.shape import rest_joints
from viewer.rigs.skeleton import joint_labels
from viewer.rigs.units import METRES

Smoothing = OneEuro | SavitzkyGolay
_ROUNDING = 1e-9  # tolerance, scene or figure units
_SAME = 0.25  # maximum distance between two tracks of one person, relative to the body's size


def clean_up(scene: Scene, wanted: CleanUp) -> list[Diagnostic]:
    """Clean up the captured motions of a scene, in place, and pose it again."""
    if wanted.is_empty:
        return []
    if not any(isinstance(actor.clip, Captured) for actor in scene.actors):
        raise RigError("clean-up: expected a captured motion, found none")
    notes = [note for people in wanted.merged for note in _merge_people(scene, people)]
    for actor in scene.actors:
        clip = actor.clip
        if not isinstance(clip, Captured):
            if clip is not None:
                notes.append(
                    note(
                        "X006.keys: {figure}: its motion has keys instead of captured frames and "
                        "is unchanged",
                        figure=actor.name,
                    )
                )
            continue
        actor.clip, said = _cleaned(scene, actor, clip, wanted)
        notes += said
        if actor.drive is not None:
            again = partial(_cleaned_again, scene, actor, wanted)
            actor.drive = replace(actor.drive, finish=again)
    starts = [a.clip.start + a.offset for a in scene.actors if a.clip is not None]
    pose_actors(scene.actors, min(starts, default=0.0) if scene.time is None else scene.time)
    if scene.in_space is not None:
        scene.in_space = partial(_cleaned_in, scene.in_space, wanted)
    return notes


def _cleaned_in(in_space: Callable[[str], Scene], wanted: CleanUp, space: str) -> Scene:
    """Return a scene in another space, cleaned up in the same way."""
    scene = in_space(space)
    scene.diagnostics = (*scene.diagnostics, *clean_up(scene, wanted))
    return scene


def _cleaned_again(scene: Scene, actor: Actor, wanted: CleanUp, clip: SampledClip) -> SampledClip:
    """Return a motion that was retargeted again, cleaned up in the same way."""
    found = _cleaned(scene, replace(actor, clip=clip), clip, wanted)[0]
    return clip if found.points is not None else found


def _cleaned(
    scene: Scene, actor: Actor, clip: Captured, wanted: CleanUp
) -> tuple[Captured, list[Diagnostic]]:
    """Return the cleaned motion of one actor, and notes about it."""
    notes: list[Diagnostic] = []
    if wanted.interpolates:
        clip, notes = _interpolated(actor, clip, wanted.longest_gap)
    if wanted.smoothing is not None:
        found = smoothed(clip, wanted.smoothing, METRES.get(actor.figure.unit, 1.0))
        values = {"filter": _filter_phrase(wanted.smoothing, clip)}
        key = "X006.smoothed: {figure}: smoothed ({filter}): "
        notes.append(_note(key, actor, values, clip, found))
        clip = found
    if wanted.locks_feet:
        clip, locked = _locked(scene, actor, clip)
        notes += locked
    if wanted.grounds:
        clip, said = _grounded(scene, actor, clip)
        notes.append(said)
    if wanted.frames is not None:
        found = trimmed(clip, *wanted.frames)
        number, count = found.timing.first_frame, found.timing.n_frames
        key = "X006.trimmed: {figure}: frames {first} to {last} kept, {n} of {all}"
        kept = {"first": number, "last": number + count - 1, "n": count}
        notes.append(note(key, figure=actor.name, **kept, all=clip.timing.n_frames))
        clip = found
    if wanted.rate is not None and wanted.rate != clip.timing.frame_rate:
        found = resampled(clip, wanted.rate)
        rates = {
            "old": clip.timing.frame_rate,
            "new": wanted.rate,
            "before": counted(clip.timing.n_frames, "frame"),
            "after": found.timing.n_frames,
        }
        key = (
            "X006.resampled: {figure}: resampled from {old:g} to {new:g} fps, {before} to {after}: "
            "at the times of the original frames, "
        )
        notes.append(_note(key, actor, rates, clip, found))
        clip = found
    return clip, notes


def _locked(scene: Scene, actor: Actor, clip: Captured) -> tuple[Captured, list[Diagnostic]]:
    """Return a motion whose feet do not slide during ground contact."""
    figure = actor.figure
    if clip.points is not None or not legs_of(figure.require_skeleton()):
        return clip, [
            note(
                "X006.no-legs: {figure}: feet not held, because no joint has the name of a leg",
                figure=actor.name,
            )
        ]
    axis, hangs = own_up(scene, actor)
    found, lock = lock_feet(figure, clip, "xyz".index(axis), -1.0 if hangs else 1.0)
    if not lock.n_contacts:
        key = (
            "X006.only-glides: {figure}: feet not held, because they glide too far in {n} with "
            "the ground"
            if lock.n_glides
            else "X006.no-contacts: {figure}: no foot is held, because none rests on the ground"
        )
        return clip, [note(key, figure=actor.name, n=counted(lock.n_glides, "contact"))]
    values: dict[str, object] = {
        "n": counted(lock.n_contacts, "contact"),
        "before": length_text(figure, lock.before),
        "after": length_text(figure, lock.after if lock.after > _ROUNDING else 0.0),
    }
    message = (
        "X006.locked: {figure}: feet held in place in {n}, so they slide by {after} instead of "
        "{before}: "
    )
    notes = [_note(message, actor, values, clip, found)]
    if lock.lowered > _ROUNDING:
        notes.append(
            note(
                "X006.locked-lowered: {figure}: lowered by up to {length}, so that its feet reach "
                "the ground",
                figure=actor.name,
                length=length_text(figure, lock.lowered),
            )
        )
    if lock.n_glides:
        notes.append(
            note(
                "X006.locked-glides: {figure}: feet not held in {n}, in which they glide too far",
                figure=actor.name,
                n=counted(lock.n_glides, "more contact"),
            )
        )
    return found, notes


def _grounded(scene: Scene, actor: Actor, clip: Captured) -> tuple[Captured, Diagnostic]:
    """Return a motion whose feet rest at height 0 of the scene."""
    found = resting_height(replace(actor, clip=clip), scene.up)
    if found is None or clip.points is not None:
        return clip, note(
            "X006.no-feet: {figure}: not moved to the ground, because it has neither feet with "
            "a mesh nor joints of known names",
            figure=actor.name,
        )
    height, is_clear = found
    height = 0.0 if abs(height) < _ROUNDING else height
    lift = np.zeros(3)
    lift[2 if scene.up == "z" else 1] = -height
    moved = np.linalg.solve(actor.placement[:3, :3], lift)
    place = (
        np.zeros((clip.n_rows, 3)) if actor.own_pose is None else actor.own_pose.figure_translation
    )
    own = clip.figure_translations
    places = moved + (np.broadcast_to(place, (clip.n_rows, 3)) if own is None else own)
    values = {
        "figure": actor.name,
        "height": length_text(actor.figure, abs(height)),
        "way": Phrase("lowered" if height > 0.0 else "raised"),
    }
    key = (
        "X006.grounded: {figure}: {way} by {height}, so that its feet rest at height 0"
        if is_clear
        else "X006.grounded-lowest: {figure}: {way} by {height}, so that the lowest position of "
        "its feet is at height 0 (they never clearly rest)"
    )
    return replace(clip, figure_translations=places), Diagnostic(key, values=values)


def _interpolated(
    actor: Actor, clip: Captured, longest: int | float
) -> tuple[Captured, list[Diagnostic]]:
    timing = clip.timing
    # A gap of N frames lasts N / rate seconds, so that files at 29.97 and 30 fps agree.
    limit = longest if isinstance(longest, int) else round(longest * timing.frame_rate)
    clip, gaps = interpolate_gaps(clip, limit)
    notes = []
    if gaps.closed:
        first, stop = max(gaps.closed, key=lambda gap: gap[1] - gap[0])
        values = {
            "n": counted(sum(b - a for a, b in gaps.closed), "missing frame"),
            "gaps": counted(len(gaps.closed), "gap"),
            "longest": frame_range(first + timing.first_frame, stop + timing.first_frame - 1),
            "seconds": rounded((stop - first) / timing.frame_rate, 2),
        }
        notes.append(
            note(
                "X006.gaps: {figure}: {n} in {gaps} interpolated; the longest is {longest} "
                "({seconds} s)",
                figure=actor.name,
                **values,
            )
        )
    if gaps.left:
        spans = [
            frame_range(a + timing.first_frame, b + timing.first_frame - 1) for a, b in gaps.left
        ]
        values = {
            "n": counted(len(gaps.left), "gap"),
            "limit": counted(limit, "frame"),
            "gaps": listed(spans),
        }
        notes.append(
            note(
                "X006.gaps-left: {figure}: {n} longer than {limit} {remain}: {gaps}",
                figure=actor.name,
                **values,
                remain=agree(len(gaps.left), "remains", "remain"),
            )
        )
    return clip, notes


def _filter_phrase(chosen: OneEuro | SavitzkyGolay, clip: Captured) -> Phrase:
    """Return the filter with the windows that were used, which are shorter in short runs."""
    if isinstance(chosen, OneEuro):
        return Phrase(
            "One Euro filter, cutoff {cutoff:g} Hz, beta {beta:g}",
            cutoff=chosen.cutoff,
            beta=chosen.beta,
        )
    rate = clip.timing.frame_rate
    used = [chosen.used_frames(count, rate) for count in run_lengths(clip)]
    windows = sorted(set(filter(None, used)))
    values = {
        "order": chosen.order,
        "n": counted(windows[-1] if windows else chosen.frames(rate), "frame"),
    }
    shortest = windows[0] if len(windows) > 1 else 0
    left = (
        Phrase(
            "{n} with too few frames {are} unchanged",
            n=counted(used.count(0), "run"),
            are=agree(used.count(0), "is", "are"),
        )
        if 0 in used
        else ""
    )
    return Phrase(
        "Savitzky-Golay filter, {shortest}{n}, degree {order}{left}",
        **values,
        shortest=optional("{} to ", shortest),
        left=optional("; {}", left),
    )


def _note(
    key: str, actor: Actor, values: Mapping[str, object], before: Captured, after: Captured
) -> Diagnostic:
    """Return a note that ends with the displacement of joints or points."""
    figure = actor.figure
    labels: Sequence[str] = ()
    if before.points is None and after.points is None:
        found = joint_displacement(figure, before, after)
        labels, part = joint_labels(figure.require_skeleton()), Phrase("joints")
    elif before.points is not None and after.points is not None:
        found = point_displacement(before, after)
        labels = () if figure.points is None else figure.points.names
        part = Phrase("points")
    where: object = ""
    if found.largest and found.joint < len(labels):
        where = Phrase("{joint}, frame {frame}", joint=labels[found.joint], frame=found.frame)
    moved = {
        "part": part,
        "mean": length_text(figure, found.mean),
        "largest": length_text(figure, found.largest),
        "where": optional(" ({})", where),
    }
    key += "{part} move by {mean} on average, by {largest} at most{where}"
    return note(key, figure=actor.name, **values, **moved)


def _merge_people(scene: Scene, people: Sequence[int]) -> list[Diagnostic]:
    """Join the tracks of some people, in place; the first one keeps the number."""
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
    part, other = "keypoints" if actor.moves_points else "body", person_label(actor.person or 0)
    key = "X006.renumbered: {part} of {other} assigned to {kept}"
    return note(key, part=Phrase(part), other=other, kept=person_label(person))


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
    names["n"] = counted(int(second.timing.present.sum()), "frame")
    notes = [Diagnostic("X006.merged: {other}: {n} joined to {kept}", values=names)]
    if len(both):
        is_both = np.zeros(int(both[-1]) + 1, dtype=np.bool_)
        is_both[both] = True
        spans = [
            frame_range(a + timing.first_frame, b + timing.first_frame - 1)
            for a, b in runs_of(is_both)
        ]
        values = {"frames": listed(spans), "distance": length_text(kept.figure, apart)}
        notes.append(
            Diagnostic(
                "X006.overlap: {other} and {kept} are both present in {n} ({frames}), {distance} "
                "apart: the frames of {kept} are used",
                values={**names, "n": counted(len(both), "frame"), **values},
            )
        )
    return notes


def _joined_drives(first: Drive | None, second: Drive | None) -> Drive | None:
    """Return the merged drive of a person with two tracks; None if one of them is not driven."""
    if first is None or second is None:
        return None
    motion = first.motion
    clip = joined_tracks(motion.clip, second.motion.clip)
    assert clip.points is None  # both clips move joints
    return replace(first, motion=replace(motion, clip=clip))


def _apart(
    kept: Actor,
    first: Captured,
    other: Actor,
    second: Captured,
    both: Ints,
) -> float:
    """Return the median distance of two tracks in their common frames; raise if it is too large."""
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
    if clip.points is not None:
        points = clip.points[clip.timing.rows[frames]]
        seen = (points[..., 3:] > 0.0).astype(float)
        return (points[..., :3] * seen).sum(axis=1) / np.maximum(seen.sum(axis=1), 1.0)
    times = clip.timing.times[frames]
    return world_frames(figure, frames_of(figure, clip, times))[:, 0, :3, 3]


def _size(figure: Figure, clip: Captured) -> float:
    if clip.points is not None:
        points = clip.points.reshape(-1, clip.points.shape[1], 4)
        sizes = [
            box_size(bounding_box(row[row[:, 3] > 0.0, :3]))
            for row in points[:: max(1, len(points) // 50)]
            if (row[:, 3] > 0.0).any()
        ]
        return float(np.median(sizes)) if sizes else 0.0
    return box_size(bounding_box(rest_joints(figure)))


# Displacement of joints between two versions of a motion.

_TOGETHER = 1000  # frames per batch, which limits the memory for matrices


@dataclass(frozen=True, slots=True)
class Displacement:
    """Distances between the joints of two motions in their common frames."""

    mean: float = 0.0
    largest: float = 0.0
    """Mean and maximum distance over all joints and frames, figure units."""
    joint: int = 0
    frame: int = 0
    """Location of the largest distance; frames are numbered as in the first motion."""
    n_frames: int = 0
    """Number of compared frames."""


def joint_displacement(figure: Figure, before: SampledClip, after: SampledClip) -> Displacement:
    """Return how far joints move, at the times of the first motion's frames."""
    timing = before.timing
    times = timing.times
    inside = (times >= after.start - 1e-9) & (times <= after.end + 1e-9)
    frames = np.flatnonzero(timing.present & inside)
    total, count, worst = 0.0, 0, Displacement()
    for first in range(0, len(frames), _TOGETHER):
        chosen = frames[first : first + _TOGETHER]
        both = [frames_of(figure, clip, times[chosen]) for clip in (before, after)]
        places = [world_frames(figure, found)[..., :3, 3] for found in both]
        distances = np.linalg.norm(places[1] - places[0], axis=-1)[both[1].present]
        chosen = chosen[both[1].present]
        if not distances.size:
            continue
        total, count = total + float(distances.sum()), count + len(distances)
        row, joint = np.unravel_index(distances.argmax(), distances.shape)
        if distances[row, joint] >= worst.largest:
            number = int(chosen[row]) + timing.first_frame
            worst = Displacement(0.0, float(distances[row, joint]), int(joint), number)
    n_joints = before.n_joints
    mean = total / (count * n_joints) if count else 0.0
    return Displacement(mean, worst.largest, worst.joint, worst.frame, count)


def point_displacement(before: PointClip, after: PointClip) -> Displacement:
    """Return how far points move in the frames of the first motion in which both are visible."""
    timing = before.timing
    times = timing.times
    inside = (times >= after.start - 1e-9) & (times <= after.end + 1e-9)
    rows, _, fraction = after.timing.locate(times)
    frames = np.flatnonzero(timing.present & inside & (rows >= 0) & (fraction == 0.0))
    old, new = before.points[timing.rows[frames]], after.points[rows[frames]]
    seen = (old[..., 3] > 0.0) & (new[..., 3] > 0.0)
    if not seen.any():
        return Displacement()
    distances = np.where(seen, np.linalg.norm(new[..., :3] - old[..., :3], axis=-1), 0.0)
    row, point = np.unravel_index(distances.argmax(), distances.shape)
    number = int(frames[row]) + timing.first_frame
    mean = float(distances.sum() / seen.sum())
    return Displacement(mean, float(distances.max()), int(point), number, len(frames))
