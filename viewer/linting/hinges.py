"""Check of motions for elbows and knees that bend to the wrong side."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from viewer.linting._finding import Finding
from viewer.linting._subject import Subject, Track, ends_of, track_of, world_turns
from viewer.phrases import counted
from viewer.rigs.arrays import largest_first
from viewer.rigs.geometry.rotation import quaternion_to_matrix
from viewer.rigs.geometry.vectors import unit
from viewer.rigs.retargeting.joint_names import LIMBS, joint_meanings
from viewer.rigs.skeleton import Skeleton, joint_labels

# A hinge bends about one axis, which the motion itself shows: the limb's upper part x lower part,
# in the space of the upper part, points to the same side whenever the limb is bent.
_USUAL = math.radians(10.0)  # bend that most of the motion's larger bends exceed
_LARGER = 0.75  # quantile of these
_WRONG = math.radians(12.0)  # bend to the other side: a straight arm may be 5 to 10 degrees over
_OPPOSITE = -0.8  # maximum cosine of its axis and the usual one: the limb also twists
_RARELY = 0.3  # fraction of frames above which neither side is usual


def check(subject: Subject) -> Iterator[Finding]:
    """Compare each bend with those of the same joint in the rest of the motion."""
    track, skeleton = track_of(subject), subject.actor.figure.skeleton
    if track is None or skeleton is None:
        return
    names = joint_meanings(skeleton)
    for limb in LIMBS:
        ends = ends_of(limb, names, skeleton)
        if limb[0] in names and limb[1] in names and ends:
            # A leg that hardly bends otherwise bends away from the toes.
            toe = limb[2].replace("_ankle", "_foot")
            toes = [names.index(toe)] if toe != limb[2] and toe in names else []
            if not set(toes).isdisjoint(ends):
                continue  # without an ankle, the ball of the foot is ahead of the shin's end
            upper, hinge = (names.index(name) for name in limb[:2])
            yield from _hinge(subject, track, skeleton, (upper, hinge), ends, toes)


def _hinge(
    subject: Subject,
    track: Track,
    skeleton: Skeleton,
    joints: tuple[int, int],
    ends: list[int],
    toes: list[int],
) -> Iterator[Finding]:
    """Check a limb: its upper part and hinge, its ends, and the ball of the foot if known."""
    rows = np.flatnonzero(track.present)
    if len(rows) == 0:
        return
    places, (upper, hinge) = track.positions[rows], joints
    end = places[:, ends].mean(axis=1)
    thigh = unit(places[:, hinge] - places[:, upper])
    shin = unit(end - places[:, hinge])
    # The space of the upper part, in axes of the figure: only its changes matter.
    turns = world_turns(track.rotations[rows], skeleton, upper)
    to_figure = subject.actor.placement[:3, :3] / (track.scale or 1.0)
    spaces = quaternion_to_matrix(turns)
    axes = np.einsum("fba,fb->fa", spaces, np.cross(thigh, shin) @ to_figure)
    lengths = np.linalg.norm(axes, axis=1)
    bends = np.arctan2(lengths, np.einsum("fa,fa->f", thigh, shin))
    usual = unit(np.median(axes, axis=0))
    sides = np.einsum("fa,a->f", axes, usual)
    if np.quantile(np.where(sides > 0.0, bends, 0.0), _LARGER) < _USUAL:
        if not toes:
            return
        # The shin of a bent knee is behind, where the toes do not point: with the thigh down and
        # the toes ahead, thigh x shin points as toes x thigh does.
        forwards = unit(places[:, toes[0]] - end)
        ahead = np.einsum("fba,fb->fa", spaces, np.cross(forwards, thigh) @ to_figure)
        sides = np.einsum("fa,a->f", axes, unit(np.median(ahead, axis=0)))
    wrong = np.flatnonzero((sides < _OPPOSITE * lengths) & (bends > _WRONG))
    if len(wrong) == 0 or len(wrong) > _RARELY * len(rows):
        return
    wrong = largest_first(wrong, bends)
    each, first = track.of_each(rows[wrong]), int(rows[wrong[0]])
    yield subject.found(
        "C024.hinge: {n}: {joint} bends the wrong way by {angle:.0f}° at frame "
        "{frame}, {time:z.3f} s",
        n=counted(len(each), "frame", of=track.n_frames),
        all=track.n_frames,
        joint=joint_labels(skeleton)[hinge],
        angle=math.degrees(bends[wrong[0]]),
        frame=int(track.numbers[first]),
        time=float(track.times[first]),
        part="clip",
        joints=[hinge],
        frames=track.numbers[each],
        times=track.times[each],
        at=("frames", first),
    )
