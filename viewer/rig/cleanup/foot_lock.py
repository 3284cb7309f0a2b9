"""Locking of feet in place while they are on the ground (after Kovar et al. 2002)."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import cast

import numpy as np

from viewer.data_classes import dataclass
from viewer.rig.arrays import Bools, Floats
from viewer.rig.cleanup.foot_contacts import contacts
from viewer.rig.cleanup.frames import in_frame_order, runs_of
from viewer.rig.feet.curves import EASE, faded
from viewer.rig.feet.legs import Leg, leg_rotations, legs_of, lowering
from viewer.rig.feet.soles import extent
from viewer.rig.figure import Figure
from viewer.rig.motion.evaluation import frames_of, world_frames
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.motion.timing import Timing
from viewer.rig.shape import shaped

_FARTHEST = 0.15  # maximum horizontal correction of a foot, relative to the figure's height at rest


@dataclass(frozen=True, slots=True)
class FootLock:
    """Changes made by foot locking."""

    n_contacts: int = 0
    """Number of contacts of a foot with the ground."""
    before: float = 0.0
    after: float = 0.0
    """Total distance that feet slide while they are on the ground, figure units."""
    lowered: float = 0.0
    """Largest distance by which the body was lowered because a leg was too short."""
    n_glides: int = 0
    """Number of contacts in which a foot is not held because it glides too far, as on skates or
    where the whole body drifts."""


def lock_feet(
    figure: Figure, clip: SampledClip, up: int, way: float = 1.0
) -> tuple[SampledClip, FootLock]:
    """Return a motion whose feet do not slide while they are on the ground.

    During a contact of the ball of a foot, or of its ankle if the ball is not in contact, that
    joint stays fixed; the foot keeps its orientation. Before and after contacts, the correction
    fades. Hips and knees rotate so that the ankles reach their targets; if a leg is too short, the
    body is lowered. Feet that glide farther than legs can follow are not held.

    ``up``: the vertical axis of the figure's space. ``way``: 1 if it points up, -1 if it points
    down.
    """
    skeleton = figure.require_skeleton()
    legs, clip = legs_of(skeleton), cast("SampledClip", in_frame_order(clip))
    timing = clip.timing
    if not legs or not timing.present.any():
        return clip, FootLock()
    frames = np.flatnonzero(timing.present)
    base = frames_of(figure, clip, timing.start + frames / timing.frame_rate)
    world = world_frames(figure, base)
    places = np.full((timing.n_frames, skeleton.n_joints, 3), 0.0)
    places[frames] = world[..., :3, 3]
    size = float(base.figure_scales[0]) * extent(shaped(figure, base.shape_weights[0]))[1]
    shifts, count, before, n_glides = [], 0, 0.0, 0
    stands = _stands(places, legs, timing, size, up, way)
    for leg, (toe, ankle) in zip(legs, stands, strict=True):
        shift, slid, glides = _corrections(places, leg, (toe, ankle), timing, _FARTHEST * size, up)
        shifts.append(shift[frames])
        count, before = count + len(runs_of(toe | ankle)), before + slid
        n_glides += glides
    upward = way * np.eye(3)[up]
    lowered = lowering(world[..., :3, 3], legs, shifts, timing.frame_rate, upward)
    drop = -lowered[:, None] * upward
    rotations = leg_rotations(clip.rotations, world, skeleton.parents, legs, drop, shifts)
    locked = replace(clip, rotations=rotations, figure_translations=base.figure_translations + drop)
    after = _slid_again(figure, locked, legs, stands, up)
    return locked, FootLock(count, before, after, float(lowered.max(initial=0.0)), n_glides)


def _stands(
    places: Floats, legs: list[Leg], timing: Timing, size: float, up: int, way: float
) -> list[tuple[Bools, Bools]]:
    """Return the contacts of the ball and the ankle of each leg: (F,) each."""
    how = (timing.present, timing.frame_rate, size, up)
    return [
        (contacts(way * places[:, leg.toe], *how), contacts(way * places[:, leg.ankle], *how))
        for leg in legs
    ]


def _corrections(
    places: Floats, leg: Leg, stands: tuple[Bools, Bools], timing: Timing, farthest: float, up: int
) -> tuple[Floats, float, int]:
    """Return the shifts of a foot (F, 3), how far it slides without them, and its glides.

    Contacts that would need a horizontal shift of more than ``farthest`` are removed from
    ``stands``; the last result is their number.
    """
    toe, ankle = stands
    flat = [axis for axis in range(3) if axis != up]
    shift, is_held = np.zeros((len(places), 3)), np.zeros(len(places), dtype=np.bool_)
    slid, n_glides = 0.0, 0
    for start, stop in runs_of(toe | ankle):
        held, path = _held(places, leg, toe, (start, stop), up)
        if np.linalg.norm(held[:, flat], axis=1).max() > farthest:
            toe[start:stop] = ankle[start:stop] = False
            n_glides += 1
            continue
        shift[start:stop], is_held[start:stop] = held, True
        slid += path
    ease = round(EASE * timing.frame_rate)
    return faded(shift, is_held, timing.present, ease), slid, n_glides


def _held(
    places: Floats, leg: Leg, toe: Bools, run: tuple[int, int], up: int
) -> tuple[Floats, float]:
    """Return the shifts that hold a foot in a run of frames (N, 3), and how far it slides there."""
    start, stop = run
    shift, slid, held = np.zeros((stop - start, 3)), 0.0, None
    for joint, a, b in _parts(leg, toe, start, stop):
        part = places[a:b, joint]
        slid += _path(part, up)
        # A contact that follows another one continues from the foot's position there.
        kept = part.mean(axis=0) if held is None else part[0] + held
        shift[a - start : b - start] = kept - part
        held = shift[b - 1 - start].copy()
    return shift, slid


def _parts(leg: Leg, toe: Bools, start: int, stop: int) -> list[tuple[int, int, int]]:
    """Return the joint that is held in each part of a contact, and the frames of the part."""
    own = np.where(toe[start:stop], leg.toe, leg.ankle)
    edges = [0, *(np.flatnonzero(np.diff(own)) + 1).tolist(), stop - start]
    return [(int(own[a]), start + a, start + b) for a, b in pairwise(edges)]


def _path(places: Floats, up: int) -> float:
    """Return the horizontal distance that a point moves."""
    flat = [axis for axis in range(3) if axis != up]
    return float(np.linalg.norm(np.diff(places[:, flat], axis=0), axis=1).sum())


def _slid_again(
    figure: Figure, clip: SampledClip, legs: list[Leg], stands: list[tuple[Bools, Bools]], up: int
) -> float:
    """Return the distance that feet slide in the given contacts."""
    timing = clip.timing
    frames = np.flatnonzero(timing.present)
    found = frames_of(figure, clip, timing.start + frames / timing.frame_rate)
    places = np.zeros((timing.n_frames, clip.n_joints, 3))
    places[frames] = world_frames(figure, found)[..., :3, 3]
    total = 0.0
    for leg, (toe, ankle) in zip(legs, stands, strict=True):
        for start, stop in runs_of(toe | ankle):
            for joint, a, b in _parts(leg, toe, start, stop):
                total += _path(places[a:b, joint], up)
    return total
