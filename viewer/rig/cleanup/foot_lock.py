"""Feet held in place while they stand on the ground (after Kovar et al. 2002)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import cast

import numpy as np

from viewer.rig.arrays import Bools, Floats
from viewer.rig.cleanup.foot_contacts import contacts
from viewer.rig.cleanup.frame_rows import in_frame_order, runs_of
from viewer.rig.cleanup.leg_ik import Leg, bend, reach
from viewer.rig.figure import Figure
from viewer.rig.geometry.quaternion import conjugate, multiply
from viewer.rig.geometry.rotation import matrix_to_quaternion
from viewer.rig.inspection.soles import extent
from viewer.rig.motion.evaluation import frames_of, world_frames
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.motion.timing import Timing
from viewer.rig.retargeting.joint_names import joint_meanings
from viewer.rig.shape import shaped
from viewer.rig.skeleton import Skeleton

__all__ = ["FootLock", "legs_of", "lock_feet"]

_EASE = 0.2  # seconds over which a correction begins and ends outside contacts


@dataclass(frozen=True, slots=True)
class FootLock:
    """Changes made by foot locking.

    Attributes
    ----------
    n_contacts : int
        Number of times a foot stands.
    before, after : float
        Distance that feet slide while they stand, in total, figure units.
    lowered : float
        Largest distance by which the body was lowered for legs that are too short.
    """

    n_contacts: int = 0
    before: float = 0.0
    after: float = 0.0
    lowered: float = 0.0


def legs_of(skeleton: Skeleton) -> list[Leg]:
    """Return the legs of a skeleton, found by the names of its joints."""
    names = joint_meanings(skeleton)
    legs = []
    for side in ("left", "right"):
        joints = [f"{side}_{part}" for part in ("hip", "knee", "ankle")]
        if all(name in names for name in joints):
            hip, knee, ankle = (names.index(name) for name in joints)
            toe = names.index(f"{side}_foot") if f"{side}_foot" in names else ankle
            legs.append(Leg(hip, knee, ankle, toe))
    return legs


def lock_feet(
    figure: Figure, clip: SampledClip, up: int, way: float = 1.0
) -> tuple[SampledClip, FootLock]:
    """Return a motion whose feet do not slide while they stand.

    In a contact of the ball of a foot, or else of its ankle, that joint stays at one place; the
    foot keeps its orientation. Before and after contacts the correction fades. Hips and knees
    rotate to reach the ankles; where a leg is too short, the body is lowered.

    Parameters
    ----------
    figure : Figure
        Figure of the motion.
    clip : SampledClip
        Its motion.
    up : int
        The vertical axis of the figure's space.
    way : float
        1 if it points up, -1 if it points down.
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
    shifts, count, before = [], 0, 0.0
    stands = _stands(places, legs, timing, size, up, way)
    for leg, (toe, ankle) in zip(legs, stands, strict=True):
        shift, slid = _corrections(places, leg, toe, ankle, timing, up)
        shifts.append(shift[frames])
        count, before = count + len(runs_of(toe | ankle)), before + slid
    turned = [way * shift for shift in shifts]
    lowered = _lowered(way * world[..., :3, 3], legs, turned, timing.frame_rate, up)
    drop = np.zeros((len(frames), 3))
    drop[:, up] = -way * lowered
    rotations = _rotations(clip.rotations, world, skeleton, legs, drop, shifts)
    found = replace(clip, rotations=rotations, figure_translations=base.figure_translations + drop)
    after = _slid_again(figure, found, legs, stands, up)
    return found, FootLock(count, before, after, float(lowered.max(initial=0.0)))


def _stands(
    places: Floats, legs: list[Leg], timing: Timing, size: float, up: int, way: float
) -> list[tuple[Bools, Bools]]:
    """Return the contacts of the ball and the ankle of each leg: (F,) each."""
    how = (timing.present, timing.frame_rate, size, up)
    return [
        (contacts(way * places[:, leg.toe], *how), contacts(way * places[:, leg.ankle], *how))
        for leg in legs
    ]


def _rotations(
    rotations: Floats,
    world: Floats,
    skeleton: Skeleton,
    legs: list[Leg],
    drop: Floats,
    shifts: list[Floats],
) -> Floats:
    """Return local rotations (N, J, 4) that bring the ankles of all legs to their targets."""
    result = rotations.copy()
    # Knees bend about the axis from the right to the left.
    across = world[:, legs[0].hip, :3, 3] - world[:, legs[-1].hip, :3, 3]
    for leg, shift in zip(legs, shifts, strict=True):
        _reach_for(result, world, skeleton, leg, drop, shift, across)
    return result


def _corrections(
    places: Floats, leg: Leg, toe: Bools, ankle: Bools, timing: Timing, up: int
) -> tuple[Floats, float]:
    """Return the shifts of a foot (F, 3), and the distance that it slides without them."""
    shift, is_held, slid = np.zeros((len(places), 3)), np.zeros(len(places), dtype=np.bool_), 0.0
    for start, stop in runs_of(toe | ankle):
        held: Floats | None = None
        for joint, a, b in _parts(leg, toe, start, stop):
            part = places[a:b, joint]
            slid += _path(part, up)
            # A contact that follows another one continues from the foot's position there.
            kept = part.mean(axis=0) if held is None else part[0] + held
            shift[a:b] = kept - part
            held = shift[b - 1].copy()
        is_held[start:stop] = True
    ease = round(_EASE * timing.frame_rate)
    return _faded(shift, is_held, timing.present, ease), slid


def _parts(leg: Leg, toe: Bools, start: int, stop: int) -> list[tuple[int, int, int]]:
    """Return the joint that is held in each part of a contact, and the frames of the part."""
    own = np.where(toe[start:stop], leg.toe, leg.ankle)
    edges = [0, *(np.flatnonzero(np.diff(own)) + 1).tolist(), stop - start]
    return [(int(own[a]), start + a, start + b) for a, b in pairwise(edges)]


def _path(places: Floats, up: int) -> float:
    """Return the horizontal distance that a point moves."""
    flat = [axis for axis in range(3) if axis != up]
    return float(np.linalg.norm(np.diff(places[:, flat], axis=0), axis=1).sum())


def _faded(shift: Floats, is_held: Bools, present: Bools, ease: int) -> Floats:
    """Return shifts that fade in and out around the frames that are held; gaps separate runs."""
    result = shift.copy()
    for start, stop in runs_of(present):
        held = np.flatnonzero(is_held[start:stop]) + start
        if len(held) == 0:
            continue
        frames = np.arange(start, stop)
        place = np.searchsorted(held, frames, side="right")
        before, after = held[np.maximum(place - 1, 0)], held[np.minimum(place, len(held) - 1)]
        left = np.where(place > 0, frames - before, ease + 1)
        right = np.where(place < len(held), after - frames, ease + 1)
        first, second = _falling(left / (ease + 1)), _falling(right / (ease + 1))
        # Between two contacts that are near each other the shift moves from one to the other.
        total = np.maximum(first + second, 1.0)[:, None]
        mixed = first[:, None] * shift[before] + second[:, None] * shift[after]
        result[start:stop] = np.where(is_held[start:stop, None], shift[start:stop], mixed / total)
    return result


def _falling(x: Floats) -> Floats:
    """Return 1 at 0 and 0 from 1 on, with slope 0 at both ends."""
    x = np.clip(x, 0.0, 1.0)
    return 1.0 - x * x * (3.0 - 2.0 * x)


def _lowered(places: Floats, legs: list[Leg], shifts: list[Floats], rate: float, up: int) -> Floats:
    """Return how far the body must be lowered so that all ankles are in reach: (F,), smooth."""
    needed = np.zeros(len(places))
    for leg, shift in zip(legs, shifts, strict=True):
        hips, knees, ankles = (places[:, joint] for joint in (leg.hip, leg.knee, leg.ankle))
        away = ankles + shift - hips
        length = reach(hips, knees, ankles)
        flat = np.einsum("fa,fa->f", away, away) - away[:, up] ** 2
        depth = np.sqrt(np.maximum(length**2 - flat, 0.0))
        is_far = (np.linalg.norm(away, axis=1) > length) & shift.any(axis=1)
        needed = np.maximum(needed, np.where(is_far, -away[:, up] - depth, 0.0))
    if not needed.any():
        return needed
    width = 2 * max(1, round(_EASE * rate)) + 1
    padded = np.pad(needed, width - 1, mode="edge")
    highest = np.lib.stride_tricks.sliding_window_view(padded, width).max(axis=1)
    # The mean of maxima over a window is nowhere below the values themselves.
    return np.lib.stride_tricks.sliding_window_view(highest, width).mean(axis=1)


def _reach_for(
    rotations: Floats,
    world: Floats,
    skeleton: Skeleton,
    leg: Leg,
    drop: Floats,
    shift: Floats,
    across: Floats,
) -> None:
    """Rotate a leg, in place, so that its ankle is at its old place plus a shift."""
    hips, knees, ankles = (world[:, j, :3, 3] + drop for j in (leg.hip, leg.knee, leg.ankle))
    turned = matrix_to_quaternion(_unscaled(world[..., :3, :3]))
    moves = (shift - drop).any(axis=1)
    if not moves.any():
        return
    thigh, shin = bend(hips, knees, ankles, ankles - drop + shift, across)
    old = {joint: turned[:, joint] for joint in range(skeleton.n_joints)}
    above = int(skeleton.parents[leg.hip])
    parent = old[above] if above >= 0 else np.array([0.0, 0.0, 0.0, 1.0])
    new_hip = multiply(thigh, old[leg.hip])
    under_knee = multiply(thigh, old[int(skeleton.parents[leg.knee])])
    under_ankle = multiply(shin, old[int(skeleton.parents[leg.ankle])])
    for joint, outer, inner in (
        (leg.hip, parent, new_hip),
        (leg.knee, under_knee, multiply(shin, old[leg.knee])),
        (leg.ankle, under_ankle, old[leg.ankle]),
    ):
        local = multiply(conjugate(np.broadcast_to(outer, inner.shape)), inner)
        rotations[moves, joint] = local[moves]


def _unscaled(linear: Floats) -> Floats:
    return linear / np.maximum(np.linalg.norm(linear, axis=-2, keepdims=True), 1e-30)


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
