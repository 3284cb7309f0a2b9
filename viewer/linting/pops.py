"""Check of motions for pops: a joint that leaves its path for a frame or a few, or stays off it."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from viewer.data_classes import dataclass
from viewer.linting._finding import Finding
from viewer.linting._subject import Indices, Subject, Track, track_of, travelling_joints
from viewer.phrases import counted
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.geometry.vectors import lengths_of
from viewer.rigs.inspection.faults import distinct
from viewer.rigs.retargeting.joint_names import joint_meanings, name_tokens
from viewer.rigs.skeleton import Skeleton, joint_labels

# A value that leaves a smooth path by a for n frames, and returns, adds a box of height a to it,
# and nothing around; one that stays off adds a step. Differences of the values leave little of a
# smooth path, but all of the edges: of order 2, a single frame adds a (1, -2, 1), two frames add
# a (1, -1, -1, 1), and a step adds a (1, -1). In quick motions of limbs, second differences are as
# large as those of a pop, but fourth ones are smaller: of a swing of w radians a frame, they are
# (2 - 2 cos w)^2, which is 0.07 for a period of 12 frames, while those of a pop reach 6.
_LONGEST = 8  # maximum number of frames of a pop; longer ones are two steps
# Of 120 clips of artists, blows and landings come near such a pattern, but with larger differences
# beside it, with steps around that are half as long, without returning, or, if they end in a hold,
# with unlike steps before and after.
_SHAPE = 0.25  # maximum distance of differences from the pattern, relative to its largest value
_RETURNS = 1.5  # minimum ratio of a to the distance between the frames before and after
_ALIKE = 0.5  # minimum ratio of the steps before and after, unless both are much shorter than a
_SHORT = 0.1  # length of such steps, relative to a
# When one joint of a body snaps to another pose in earnest, so do some others: in the same clips,
# their edges are at least 0.38 times as large. Keys that were shifted move one joint.
_ALONE = 0.25  # maximum edge of another joint in the same frame, relative to a
_GO_ON, _MOVES = 3, 1e-3  # minimum number of others that move meanwhile, by more than this angle
# The first and the last pose are held for the longest difference beyond the motion, so that the
# frames there are seen, too: one that leaves the path there is a step between a hold and the rest.
_HELD = 4
_NEAR = 4  # number of steps before and after
_AROUND = 8  # differences before and after that are compared
_SEEN = 2  # minimum number of frames before and after
_ANGLE = math.radians(6.0)  # smallest rotation that is seen as a pop
_DISTANCE = 0.04  # the same of a travelling joint, relative to its size: 70 mm for a person
_RATE = 30.0  # frames per second below which a body does more within a frame than these
_LIDS = {"eyelid", "eyelids", "lid", "lids", "blink"}


@dataclass(frozen=True)
class _Shape:
    """A pop of some frames, or a step, as differences of one order show it."""

    n_frames: int
    """Frames off the path; 0 if the value stays there."""
    order: int
    others: float
    """Minimum ratio of the pattern's largest value to the differences around it."""
    steps: float
    """Maximum length of the usual steps, relative to a."""
    returns: bool = False
    """Whether the path must go on near where it was left."""
    alike: bool = False
    """Whether the steps before and after must be alike."""

    def pattern(self) -> Floats:
        """Return the differences of a box or step of height 1 that are not 0: (P,)."""
        outside = np.zeros(self.order)
        box = np.ones(self.n_frames or self.order)
        back = outside if self.n_frames else outside[:0]
        return np.diff(np.concatenate([outside, box, back]), n=self.order)


# A joint that is fast and steady pops by less than two of its steps, and meanwhile goes on.
_POPS = tuple(
    shape
    for n in range(1, _LONGEST + 1)
    for shape in (
        _Shape(n, 2, 4.0 if n == 1 else 6.0, 0.5, returns=True),
        _Shape(n, 2, 10.0, 0.7),
        _Shape(n, 4, 6.0, 1.0, alike=True),
    )
)
# Where nothing else of the body has an edge in the frame, much less must stand out of the joint's
# own movement: such a pop cannot be a blow or a landing.
_LONE_POPS = tuple(
    shape
    for n in range(1, _LONGEST + 1)
    for shape in (_Shape(n, 2, 1.5, 1.0, returns=True), _Shape(n, 4, 2.0, 2.0))
)
_STEPS = (_Shape(0, 2, 4.0, 0.5), _Shape(0, 3, 4.0, 0.5), _Shape(0, 4, 6.0, 1.0))


def check(subject: Subject) -> Iterator[Finding]:
    """Check the rotations of all joints, and the paths of those that carry the body."""
    track, skeleton = track_of(subject), subject.actor.figure.skeleton
    if track is None or skeleton is None or not track.size > 0.0:
        return
    rows = track.on_frames()
    if len(rows) < 2 * _AROUND or track.is_blocked():
        return
    known, joints = _known(track, rows), np.arange(skeleton.n_joints)
    known[:, _blinks(skeleton)] = False
    longer = _longer(track, rows)
    # Close to each other, unit quaternions are half the angle of their rotation apart.
    turns = 2.0 * track.turns(rows)
    found = _together(
        _found(turns, known, _POPS, _ANGLE * longer),
        _alone(_found(turns, known, _LONE_POPS, _ANGLE * longer), turns),
    )
    if found is not None:
        yield _finding(
            subject,
            track,
            found.of(rows, joints),
            "C020.rotation: {n}: {joint} rotates away by {size} at frame {frame}, {time:z.3f} s, "
            "and back",
            f"{math.degrees(found.size):.0f}°",
        )
    found = _alone(_found(turns, known, _STEPS, _ANGLE * longer), turns)
    if found is not None:
        yield _finding(
            subject,
            track,
            found.of(rows, joints),
            "C020.turn: {n}: {joint} rotates by {size} within frame {frame}, {time:z.3f} s, while "
            "the others go on",
            f"{math.degrees(found.size):.0f}°",
        )
    carriers = travelling_joints(track, skeleton)
    places = track.positions[rows][:, carriers]
    found = _found(places, known[:, carriers], _POPS, _DISTANCE * longer * track.size)
    if found is not None:
        yield _finding(
            subject,
            track,
            found.of(rows, carriers),
            "C020.position: {n}: {joint} jumps away by {size} at frame {frame}, {time:z.3f} s, and "
            "back",
            subject.length(found.size / track.scale),
        )


def shifts(track: Track, rows: Indices, joints: Ints, is_step: Bools) -> OffPath | None:
    """Return where joints (N,) shift within a frame and stay there; ``is_step``: (F - 1,) allowed.

    ``rows``: of the track, (F,).
    """
    known = _known(track, rows)[:, joints]
    known[1:] &= is_step[:, None]
    least = _DISTANCE * _longer(track, rows) * track.size
    found = _found(track.positions[rows][:, joints], known, _STEPS, least)
    return None if found is None else found.of(rows, joints)


@dataclass(frozen=True, slots=True, eq=False)
class OffPath:
    """Pops or steps of joints, the largest first."""

    sizes: Floats
    """(P,): distances from the path."""
    frames: tuple[Indices, ...]
    """Of each, the frames off the path, or the first one that stays off it."""
    columns: Indices
    """(P,): their joints."""

    @property
    def size(self) -> float:
        """The largest distance."""
        return float(self.sizes[0])

    def of(self, rows: Indices, joints: Indices | Ints) -> OffPath:
        """Return the same with rows of the track and joints of the skeleton."""
        each = tuple(rows[frames] for frames in self.frames)
        return OffPath(self.sizes, each, np.asarray(joints, dtype=np.int64)[self.columns])


def _finding(subject: Subject, track: Track, pops: OffPath, message: str, size: str) -> Finding:
    each, first = track.of_each(np.concatenate(pops.frames)), int(pops.frames[0][0])
    return subject.found(
        message,
        n=counted(len(each), "frame", of=track.n_frames),
        all=track.n_frames,
        joint=joint_labels(subject.actor.figure.require_skeleton())[int(pops.columns[0])],
        size=size,
        frame=int(track.numbers[first]),
        time=float(track.times[first]),
        part="clip",
        joints=distinct(pops.columns),
        frames=track.numbers[each],
        times=track.times[each],
        at=("frames", first),
    )


def _held(values: Floats) -> Floats:
    """Return values (F, N, C) with the first and the last ones held beyond the motion."""
    return np.pad(values, ((_HELD, _HELD), (0, 0), (0, 0)), mode="edge")


def _found(
    values: Floats, known: Bools, shapes: tuple[_Shape, ...], least: float
) -> OffPath | None:
    """Return what has one of the shapes in values (F, N, C), and exceeds a size."""
    values, known = _held(values), np.pad(known, ((_HELD, _HELD), (0, 0)), mode="edge")
    orders = sorted({1, *(shape.order for shape in shapes)})
    differences = {order: np.diff(values, n=order, axis=0) for order in orders}
    ends = ((_AROUND + 1, _AROUND + _LONGEST), (0, 0))
    lengths = {order: np.pad(lengths_of(each), ends) for order, each in differences.items()}
    each = [
        _matches(values, differences[shape.order], lengths, known, shape, least) for shape in shapes
    ]
    size = np.concatenate([sizes for sizes, _, _ in each])
    if len(size) == 0:
        return None
    order = np.argsort(-size, kind="stable")
    frames = [
        np.arange(first, first + max(shape.n_frames, 1)) - _HELD
        for shape, (_, firsts, _) in zip(shapes, each, strict=True)
        for first in firsts.tolist()
    ]
    columns = np.concatenate([columns for _, _, columns in each])
    return OffPath(size[order], tuple(frames[k] for k in order.tolist()), columns[order])


def _matches(
    values: Floats,
    differences: Floats,
    lengths: dict[int, Floats],
    known: Bools,
    shape: _Shape,
    least: float,
) -> tuple[Floats, Indices, Indices]:
    """Return the sizes, first frames and columns of what has a shape: (P,) each."""
    pattern, order, n_frames = shape.pattern(), shape.order, max(shape.n_frames, 1)
    highest = float(np.abs(pattern).max())
    # Row r of the differences is about frames r to r + order, so the shape begins ``order`` later.
    beyond = max(_SEEN, order)
    start = beyond - order
    count = len(values) - beyond - n_frames - order + 1 - start
    is_near = np.ones((max(count, 0), values.shape[1]), dtype=np.bool_)
    # The largest part first: few values of most motions exceed it.
    for k in np.argsort(-np.abs(pattern), kind="stable").tolist():
        part = float(np.abs(pattern[k]))
        if part > _SHAPE * highest and is_near.any():
            there = lengths[order][_AROUND + 1 + start + k :][: len(is_near)]
            is_near &= there > (part - _SHAPE * highest) * least
    rows, columns = np.nonzero(is_near)
    rows += start
    first, last = rows + order, rows + order + n_frames - 1
    if len(rows) == 0:
        return np.zeros(0), first, columns
    # By least squares, the size is that of the projection onto the pattern.
    windows = differences[rows[:, None] + np.arange(len(pattern)), columns[:, None]]
    factors = np.einsum("npc,p->nc", windows, pattern) / (pattern @ pattern)
    left = lengths_of(windows - factors[:, None] * pattern[:, None]).max(axis=1)
    size = np.linalg.norm(factors, axis=1)

    def most(order: int, at: Indices, shifts: range) -> Floats:
        """Return the largest of the lengths some rows away from others, 0 outside: (P,)."""
        index = at[:, None] + np.array(shifts, dtype=np.int64) + _AROUND + 1
        largest: Floats = lengths[order][index, columns[:, None]].max(axis=1, initial=0.0)
        return largest

    end = rows + len(pattern) - 1
    others = np.maximum(
        most(order, rows, range(-_AROUND, 0)), most(order, end, range(1, _AROUND + 1))
    )
    # The step into a frame is in the row before; another one leads back.
    into, out = first - 1, last if shape.n_frames else first - 1
    usual = np.maximum(most(1, into, range(-_NEAR, 0)), most(1, out, range(1, _NEAR + 1)))
    usual = np.maximum(usual, most(1, into, range(1, shape.n_frames)))
    is_found = (size > least) & (left < _SHAPE * highest * size)
    is_found &= (highest * size > shape.others * others) & (usual < shape.steps * size)
    if shape.returns:
        across = np.linalg.norm(values[last + 1, columns] - values[into, columns], axis=1)
        is_found &= size > _RETURNS * across
    if shape.alike:
        beside = np.stack([most(1, into, range(-1, 0)), most(1, out, range(1, 2))])
        alike = beside.min(axis=0) > _ALIKE * beside.max(axis=0)
        is_found &= alike | (beside.max(axis=0) < _SHORT * size)
    frames = np.arange(-order, n_frames + order)
    is_found &= known[first[:, None] + frames, columns[:, None]].all(axis=1)
    return size[is_found], first[is_found], columns[is_found]


def _alone(found: OffPath | None, values: Floats) -> OffPath | None:
    """Return those in whose first frames other joints move, but none has an edge."""
    if found is None:
        return None
    # Half a third difference is the edge of a step: x = 0 0 1 1 has -2 = 1 - 3.
    edges = 0.5 * lengths_of(np.diff(_held(values), n=3, axis=0))
    firsts = np.array([int(frames[0]) for frames in found.frames])
    others = edges[firsts + _HELD - 2]
    others[np.arange(len(firsts)), found.columns] = 0.0
    moving = lengths_of(np.diff(values, axis=0))[firsts - 1] > _MOVES
    go_on = moving.sum(axis=1) - 1 >= _GO_ON
    keep = np.flatnonzero(go_on & (others.max(axis=1) < _ALONE * found.sizes))
    if len(keep) == 0:
        return None
    each = tuple(found.frames[k] for k in keep.tolist())
    return OffPath(found.sizes[keep], each, found.columns[keep])


def _together(found: OffPath | None, more: OffPath | None) -> OffPath | None:
    """Return what either has, the largest first."""
    if found is None or more is None:
        return found or more
    sizes, frames = np.concatenate([found.sizes, more.sizes]), (*found.frames, *more.frames)
    order = np.argsort(-sizes, kind="stable")
    columns = np.concatenate([found.columns, more.columns])
    return OffPath(sizes[order], tuple(frames[k] for k in order.tolist()), columns[order])


def _longer(track: Track, rows: Indices) -> float:
    """Return by how much frames are longer than those for which the smallest sizes are meant."""
    return max(1.0, _RATE * float(track.times[rows[1]] - track.times[rows[0]]))


def _blinks(skeleton: Skeleton) -> Bools:
    """Return the joints that dart within a frame, or close for some frames: eyes and lids (J,)."""
    meanings = joint_meanings(skeleton)
    return np.array(
        [
            meaning.endswith("eye") or bool(_LIDS & set(name_tokens(name)))
            for meaning, name in zip(meanings, skeleton.names, strict=True)
        ]
    )


def _known(track: Track, rows: Indices) -> Bools:
    """Return where frames and their neighbours are defined and no jump is intended: (F, J)."""
    known = track.present[rows]
    known[1:-1] &= known[:-2] & known[2:]
    stepped = track.stepped[rows]
    for k in range(1, track.per_frame):
        stepped[1:] |= track.stepped[rows[1:] - k]
    stepped[:-1] |= stepped[1:]
    return known[:, None] & ~stepped
