"""The poses in which two actors are compared: frames of their clips, or test poses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, note
from viewer.errors import RigError
from viewer.phrases import counted, rounded
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.comparison.pairs import pair_names
from viewer.rigs.figure import figure_pose
from viewer.rigs.pose import Pose
from viewer.rigs.scene import Actor, pose_actors
from viewer.rigs.skeleton import Skeleton, dof_labels

FrameRange = tuple[int | None, int | None]
"""First frame and end frame (exclusive), in the numbering of the first motion."""

_FREE = 0.7  # radians in either direction in test poses, for rotations without limits
_SHIFT = 0.05  # fraction of the skeleton's extent in either direction, for unlimited translations
_SAME_TIME = 1e-6  # seconds


@dataclass(frozen=True, slots=True, eq=False)
class Steps:
    """Poses to compare."""

    times: Floats
    """(F,). Seconds, for two motions; empty for test poses."""
    dofs: Floats
    """(N, D). Test poses: values of the DOFs that both figures have."""
    first: Ints
    second: Ints
    """(D,) int32. Rows of these DOFs in both skeletons."""
    first_frame: int = 0
    """Number of the first frame."""
    mismatches: tuple[Diagnostic, ...] = ()
    notes: tuple[Diagnostic, ...] = ()
    """DOFs or motions that only one actor has; notes on the choice of steps."""
    own: tuple[Pose | None, Pose | None] = (None, None)
    """(Pose or None, Pose or None). Initial poses of figures without motion."""

    @property
    def count(self) -> int:
        """Number of steps."""
        return len(self.times) or 1 + len(self.dofs)

    def pose(self, number: int, first: Actor, second: Actor) -> str:
        """Pose both actors for one step and return its name; steps may be in any order."""
        if len(self.times):
            # Each motion is timed from its own start, as captures may start at any frame.
            for actor in (first, second):
                time = float(self.times[number]) + actor.require_clip().start + actor.offset
                pose_actors([actor], time)
            return f"frame {self.first_frame + number}"
        for actor, own in zip((first, second), self.own, strict=True):
            actor.own_pose = None if own is None else own.copy()
        if number == 0:
            return "own pose"
        first.pose.dofs[self.first] = self.dofs[number - 1]
        second.pose.dofs[self.second] = self.dofs[number - 1]
        return f"test pose {number}"


def steps_of(first: Actor, second: Actor, n_poses: int, frames: FrameRange | None = None) -> Steps:
    """Choose the poses in which two actors are compared, without changing them.

    Motions are compared frame by frame at the rate of the first, each from its own start, to the
    end of the shorter; figures at rest in the poses of their files and in ``n_poses`` test poses
    within the limits of both. These depend only on names and limits. RigError for an empty range.
    """
    if first.clip is not None and second.clip is not None:
        return _motion_steps(first, second, frames)
    return replace(_still_steps(first, second, n_poses), own=(_own_pose(first), _own_pose(second)))


def _own_pose(actor: Actor) -> Pose | None:
    """Return an actor's initial pose; a motion that the other actor lacks is ignored."""
    if actor.clip is None:
        return None if actor.own_pose is None else actor.own_pose.copy()
    return None if actor.figure.skeleton is None else figure_pose(actor.figure)


def _still_steps(first: Actor, second: Actor, n_poses: int) -> Steps:
    none = np.zeros(0, dtype=np.int32)
    if (first.clip is None) != (second.clip is None):
        lacking = "second" if second.clip is None else "first"
        still = note("D001.no-motion: the {side} has no motion", side=lacking)
        return Steps(np.zeros(0), np.zeros((0, 0)), none, none, 0, (still,))
    if first.figure.skeleton is None or second.figure.skeleton is None or n_poses == 0:
        return Steps(np.zeros(0), np.zeros((0, 0)), none, none)
    return _test_poses(first.figure.skeleton, second.figure.skeleton, n_poses)


def _motion_steps(first: Actor, second: Actor, frames: FrameRange | None) -> Steps:
    clips = first.require_clip(), second.require_clip()
    rates = clips[0].frame_rate, clips[1].frame_rate
    lasts = clips[0].end - clips[0].start, clips[1].end - clips[1].start
    mismatches = []
    if abs(lasts[0] - lasts[1]) > 0.5 / rates[0]:
        values: dict[str, object] = {"first": rounded(lasts[0], 6), "second": rounded(lasts[1], 6)}
        mismatches.append(
            note("D001.durations: durations differ: {first} s and {second} s", **values)
        )
    notes = []
    if abs(rates[0] - rates[1]) > _SAME_TIME * rates[0]:
        values = {"first": rates[0], "second": rates[1]}
        notes.append(
            note(
                "D002.rates: frame rates differ ({first:g} and {second:g} fps): compared at the "
                "first",
                **values,
            )
        )
    base = 0
    if clips[0].timing is not None:
        base = clips[0].timing.first_frame
    last = base + int(np.floor(min(lasts) * rates[0] + _SAME_TIME))
    start, end = (None, None) if frames is None else frames
    chosen = np.arange(
        base if start is None else max(start, base), last + 1 if end is None else min(end, last + 1)
    )
    if not len(chosen):
        raise RigError(f"no frame in {start}:{end}; both have frames {base} to {last}")
    none = np.zeros(0, dtype=np.int32)
    found = tuple(mismatches), tuple(notes)
    times = (chosen - base) / rates[0]
    return Steps(times, np.zeros((0, 0)), none, none, int(chosen[0]), *found)


def _test_poses(first: Skeleton, second: Skeleton, n_poses: int) -> Steps:
    pairs = pair_names(dof_labels(first), dof_labels(second), "DOF")
    limits = np.stack([first.dof_limits[pairs.first], second.dof_limits[pairs.second]])
    mismatches = list(pairs.mismatches)
    other = np.flatnonzero((limits[0] != limits[1]).any(axis=1))
    if len(other):
        dof = int(other[0])
        own, others = limits[0][dof].tolist(), limits[1][dof].tolist()
        values = {
            "n": counted(len(other), "DOF", "has", "have"),
            "dof": pairs.names[dof],
            "low": rounded(own[0], 6),
            "high": rounded(own[1], 6),
            "other_low": rounded(others[0], 6),
            "other_high": rounded(others[1], 6),
        }
        mismatches.append(
            note(
                "D001.limits: {n} different limits, such as {dof}: {low} to {high} and {other_low} "
                "to {other_high}",
                **values,
            )
        )
    dofs = _random_dofs(first, pairs.first, limits, n_poses)
    none = np.zeros(0)
    return Steps(none, dofs, pairs.first, pairs.second, 0, tuple(mismatches), pairs.notes)


def _random_dofs(skeleton: Skeleton, rows: Ints, limits: Floats, count: int) -> Floats:
    """Draw random DOF values within both limits; within the first if the limits are disjoint."""
    is_rotation = skeleton.dof_kinds[rows] >= 3
    # Relative to the skeleton's own extent, as its unit may be unknown.
    reach = _SHIFT * float(np.abs(skeleton.rest_translations).sum(axis=0).max())
    free = np.where(is_rotation, _FREE, reach)
    low = np.maximum(limits[:, :, 0].max(axis=0), -free)
    high = np.minimum(limits[:, :, 1].min(axis=0), free)
    # If the limits lie entirely outside the default range, the range shrinks to the closer limit.
    low, high = np.minimum(low, limits[:, :, 1].min(axis=0)), np.maximum(high, low)
    fractions = np.random.default_rng(0).random((count, len(rows)))
    return np.clip(low + fractions * (high - low), limits[0, :, 0], limits[0, :, 1])
