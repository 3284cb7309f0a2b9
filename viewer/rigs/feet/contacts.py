"""Contacts of the feet of a moving body with the ground: the one detector of this program.

A foot touches the ground with its ball, its heel, or both. A point of a foot is in contact while it
moves slowly and is no higher than the other point of the foot; both tests use hysteresis. A contact
is valid only if, at some time during it, the foot is the lowest one, not a foot held still in the
air, and if it is below its hip, not next to it as in a lying person. The ground therefore need not
be flat: every contact has its own height, as on stairs. The limits are those of ``limits``.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from viewer.data_classes import dataclass
from viewer.rigs.arrays import Bools, Floats, Ints, blocks_of_rows, runs_of
from viewer.rigs.feet import limits
from viewer.rigs.feet.curves import falling
from viewer.rigs.geometry.vectors import lengths_of

# Percentage of the rows of a stride in which the faster foot is slower than where it swings.
_SWINGING = 80


@dataclass(frozen=True, slots=True, eq=False)
class FootPath:
    """Path of a foot; that of a source is in the axes and the unit of the driven figure."""

    toe: Floats
    heel: Floats
    """(N, 3). Positions of the ball and of a point below the ankle; equal if there is no ball."""
    hip: Floats
    """(N, 3). Positions of the hip."""

    def lowest(self, up: Floats) -> Floats:
        """Return the height of the lower of both points: (N,)."""
        return np.minimum(self.toe @ up, self.heel @ up)


@dataclass(frozen=True, slots=True, eq=False)
class Contact:
    """Contact of one foot with the ground."""

    start: int
    stop: int
    """Half-open range of rows."""
    on_toe: Bools
    """(N,). Rows of the range in which the ball is on the ground; in all others, only the heel
    is."""
    is_flat: Bools
    """(N,). Rows of the range in which both are on the ground."""
    hold: Floats
    """(N,). 1 in rows in which the foot is slow, less at the beginning and end of the contact."""
    height: float
    """Height of the foot's lower point."""
    tilt: float
    """Height of the heel above the ball."""


def foot_contacts(
    feet: Sequence[FootPath],
    spans: Sequence[tuple[int, int]],
    rate: float,
    size: float,
    up: Floats,
    ease: float = 0.0,
    slips: float = 1.0,
) -> list[list[Contact]]:
    """Return each foot's contacts in time order; ``spans`` are row ranges without gaps.

    ``ease``: seconds over which the hold rises and falls; ``slips``: as ``limits.SLIPS``.
    """
    # For every foot and every span without gaps:
    #   1. ball and heel separately: rows in which the point is low on the foot and slow (_stands);
    #   2. a run of rows in which either stands is a candidate, so that a step that rolls from the
    #      heel to the ball stays one contact;
    #   3. a candidate is dropped if it is shorter than any step, or if the foot is never the
    #      lowest;
    #   4. its rows get a hold of 1 at speeds up to SLOW, falling smoothly to 0 at FAST: the planner
    #      fixes the former and lets go of the latter.
    lows = np.array([foot.lowest(up) for foot in feet])
    pace = _paces(feet, spans, rate, size, up)
    result = []
    for number, foot in enumerate(feet):
        others = np.delete(lows, number, axis=0)
        is_lowest = (lows[number] < others + limits.LOWEST * size).all(axis=0)
        found = []
        for first, last in spans:
            part = slice(first, last)
            (toe, heel), speeds = _stands(
                foot, part, lows[number], rate, size, up, slips, pace[part]
            )
            slow = (np.where(toe, *speeds) / size - limits.SLOW) / (limits.FAST - limits.SLOW)
            hold = falling(slow)
            for a, b in runs_of(toe | heel):
                rows = slice(first + a, first + b)
                if b - a < _shortest(rate, pace[rows]) or not is_lowest[rows].any():
                    continue
                held = hold[a:b] * _eased(b - a, (a > 0, first + b < last), ease * rate)
                one = _contact(foot, rows.start, (toe[a:b], heel[a:b]), hold[a:b], held, up)
                found += [one] if one is not None else []
        result.append(found)
    return result


def is_upright(legs: Floats, up: Floats) -> bool:
    """Return whether vectors from heel to hip (N, 3) mostly are those of a body on its feet."""
    return float(np.median(legs @ up - limits.UPRIGHT * lengths_of(legs))) >= 0.0


def _contact(
    foot: FootPath,
    start: int,
    stands: tuple[Bools, Bools],
    hold: Floats,
    eased: Floats,
    up: Floats,
) -> Contact | None:
    """Return a contact without the loose rows at its ends; None if the person lies down."""
    toe, heel = stands
    slow = np.flatnonzero(hold >= 1.0) + start
    if not is_upright(foot.hip[slow] - foot.heel[slow], up):
        return None
    height = float(np.median(foot.lowest(up)[slow]))
    tilt = float(np.median((foot.heel[slow] - foot.toe[slow]) @ up))
    firm = np.flatnonzero(hold > limits.LOOSE)
    a, b = int(firm[0]), int(firm[-1]) + 1
    on_toe, is_flat = toe[a:b], (toe & heel)[a:b]
    return Contact(start + a, start + b, on_toe, is_flat, eased[a:b], height, tilt)


def _eased(count: int, is_open: tuple[bool, bool], ease: float) -> Floats:
    """Return factors that rise from the open start of a contact and fall to its open end: (N,)."""
    span = min(round(ease), (count - 1) // 3) + 1.0
    rows = np.minimum(np.arange(1.0, count + 1.0), span)
    begin, end = (rows if is_one else np.full(count, span) for is_one in is_open)
    return 1.0 - falling(np.minimum(begin, end[::-1]) / span)


def _shortest(rate: float, pace: Floats) -> int:
    return max(2, round(limits.SHORTEST * rate / float(np.median(pace))))


def _paces(
    feet: Sequence[FootPath], spans: Sequence[tuple[int, int]], rate: float, size: float, up: Floats
) -> Floats:
    """Return how many times faster than in a walk the feet swing around each row: (N,), 1 to 4."""
    from scipy.ndimage import percentile_filter

    # Steps of a run are shorter, and its feet stand less still: they roll faster from heel to ball.
    across, result = along_ground(up), np.ones(len(feet[0].toe))
    for first, last in spans:
        speeds = [
            mean_speeds(points[first:last] @ across, rate)
            for foot in feet
            for points in (foot.toe, foot.heel)
        ]
        # Some foot swings for most of a stride; the percentile ignores a glitch of the recording.
        stride = 2 * round(0.5 * limits.STRIDE * rate) + 1
        usual = percentile_filter(np.max(speeds, axis=0), _SWINGING, stride, mode="nearest")
        result[first:last] = np.clip(usual / (limits.WALKS * size), 1.0, limits.FASTEST)
    return result


def _stands(
    foot: FootPath,
    part: slice,
    lows: Floats,
    rate: float,
    size: float,
    up: Floats,
    slips: float,
    pace: Floats,
) -> tuple[list[Bools], list[Floats]]:
    """Return the rows of a part in which the ball and the heel are in contact, and their speeds."""
    found, paces = [], []
    for points in (foot.toe[part], foot.heel[part]):
        high = points @ up
        above = high - lows[part]
        # Speeds in a space whose horizontal axes are compressed, so that sliding counts less.
        half = np.maximum(1, np.round(0.5 * limits.WINDOW * rate / pace)).astype(np.int32)
        velocities = _mean_velocities(points, rate, half)
        rises = velocities @ up
        slides = lengths_of(velocities - rises[:, None] * up) / (slips * pace)
        speeds = np.hypot(slides, rises)
        begins = (above < limits.LOW * size) & (speeds < limits.SLOW * size)
        lasts = (above < limits.HIGH * size) & (speeds < limits.FAST * size)
        stands = np.zeros(len(points), dtype=np.bool_)
        for a, b in runs_of(lasts):
            if b - a >= _shortest(rate, pace[a:b]) and begins[a:b].any():
                stands[a:b] = True
        found.append(stands)
        paces.append(speeds)
    return found, paces


def ground_level(
    contacts: Sequence[Sequence[Contact]], size: float, clearance: float
) -> tuple[float, bool]:
    """Return the height at which feet stand, and whether the ground is at height 0."""
    # Contacts within LEVEL of one another are on the same floor. For each contact, count the rows
    # of all contacts on its floor: the floor with most rows is where the person stands longest. A
    # floor near height 0, where most files put the ground, wins with a third of that.
    every = [contact for foot in contacts for contact in foot]
    heights = np.array([contact.height for contact in every])
    rows = np.array([contact.stop - contact.start for contact in every])
    near = np.abs(heights[:, None] - heights) < limits.LEVEL * size
    counts = near @ rows
    is_usual = (heights > limits.ON_GROUND[0] * size) & (heights < limits.ON_GROUND[1] * size)
    is_usual &= counts >= limits.SIMILAR * counts.max()
    best = int(counts.argmax())
    if is_usual.any():
        best = int(np.where(is_usual, np.abs(heights - clearance), np.inf).argmin())
    # The weighted median: the height at which half of the floor's rows are passed. Unlike the mean,
    # it ignores a contact on tiptoe or on the edge of a step.
    order = np.argsort(heights[near[best]])
    passed = np.cumsum(rows[near[best]][order])
    middle = int(np.searchsorted(passed, 0.5 * passed[-1]))
    return float(heights[near[best]][order][middle]), bool(is_usual.any())


def step_height(contact: Contact, level: float, size: float) -> float:
    """Return the ground under a contact above ``level``; 0 for small steps and for tiptoe."""
    height = contact.height - level
    is_tiptoe = abs(contact.tilt) > limits.TILTED * size and abs(height) < limits.TIPTOE * size
    return 0.0 if is_tiptoe or abs(height) < limits.LEVEL * size else height


def half_window(rate: float, seconds: float = limits.WINDOW) -> int:
    """Return the number of rows before and after a row over which its speed is averaged."""
    return max(1, round(0.5 * seconds * rate))


def along_ground(up: Floats) -> Floats:
    """Return the projection (3, 3) that removes the part along a unit vector (3,)."""
    return np.eye(3) - np.outer(up, up)


def mean_speeds(places: Floats, rate: float) -> Floats:
    """Return speeds (N,) averaged over a window around each frame."""
    return lengths_of(_mean_velocities(places, rate, half_window(rate)))


def _mean_velocities(places: Floats, rate: float, half: int | Ints) -> Floats:
    """Return velocities (N, 3) averaged over ``half`` rows before and after each row."""
    frames = np.arange(len(places))
    before, after = np.maximum(frames - half, 0), np.minimum(frames + half, len(places) - 1)
    return (places[after] - places[before]) * (rate / np.maximum(after - before, 1))[:, None]


def slowest_points(
    foot: FootPath, spans: Sequence[tuple[int, int]], rate: float, size: float, up: Floats
) -> Floats:
    """Return each row's speed (N,) along the ground of the foot's slowest point on the ground."""
    # A foot that rolls or turns about its ball or its heel does not slide, although the other end
    # moves.
    low, result = foot.lowest(up), np.zeros(len(foot.toe))
    across = along_ground(up)
    for first, last in spans:
        part, found = slice(first, last), []
        for points in (foot.toe[part], foot.heel[part]):
            is_on = points @ up < low[part] + limits.HIGH * size
            found.append(np.where(is_on, mean_speeds(points @ across, rate), np.inf))
        result[part] = np.minimum(*found)
    return result


# Speed of the ground below motions in place, as on a treadmill or with the travel removed.
#
# Standing feet then move at a constant velocity while the body stays in place. Contacts are found
# in the axes of the moving ground.

_MOST = 500  # maximum number of candidates
# Percentage of the rows of standing feet that deviate less from the ground than its unevenness. The
# rows beyond are those in which a foot lands or leaves.
_UNEVEN = 75.0


@dataclass(frozen=True, slots=True, eq=False)
class MovingGround:
    """Ground that moves below a body in place."""

    velocity: Floats
    """(3,). Per second."""
    slips: float
    """How unevenly standing feet move with it, 1 to 2; see ``foot_contacts``."""


def moving_ground(
    feet: Sequence[FootPath], spans: Sequence[tuple[int, int]], rate: float, size: float, up: Floats
) -> MovingGround | None:
    """Return the ground that moves below a body in place; None if it does not move."""
    # The velocity that most rows of the lowest foot share, within GROUND_SAME: every one of up to
    # 500 rows is a candidate, the one with most neighbours wins, and the median of its neighbours
    # is the estimate. A mean over all rows would be biased by the swings, in which the lowest foot
    # moves the other way.
    lows = np.array([foot.lowest(up) for foot in feet])
    is_low = lows < lows.min(axis=0) + limits.LOWEST * size
    for seconds in limits.GROUND_WINDOWS:
        half = half_window(rate, seconds)
        every = [np.arange(first + half, last - half) for first, last in spans]
        rows = np.concatenate([np.zeros(0, np.int32), *every]).astype(np.int32)
        if not len(rows):
            return None
        moved = rate * np.stack([_lowest_velocities(foot, rows, half, up) for foot in feet])
        speeds = moved[lows[:, rows].argmin(axis=0), np.arange(len(rows))]
        near = limits.GROUND_SAME * size
        candidates = speeds[:: -(-len(speeds) // _MOST)]
        best = candidates[int(np.argmax(_neighbours(speeds, candidates, near)))]
        velocity = np.median(speeds[lengths_of(speeds - best) < near], axis=0)
        speed = float(np.linalg.norm(velocity))
        body = rate * np.mean([_velocities(foot.hip, rows, half, up) for foot in feet], axis=0)
        drift = np.linalg.norm(body.mean(axis=0))
        is_moving = speed > limits.GROUND_MOVES * size and drift < limits.BODY_DRIFTS * speed
        # Feet of cycles that are animated by hand move less evenly than those on a treadmill.
        most = max(near, limits.GROUND_ALIKE * speed)
        away = lengths_of(speeds - velocity)
        is_alike = away < most
        n_resting = int((lengths_of(speeds) < near).sum())
        is_usual = is_alike.mean() > limits.GROUND_USUAL
        is_usual &= is_alike.sum() > limits.GROUND_OFTENER * n_resting
        # People step with both feet, and deliver a blow with one.
        steps = (lengths_of(moved - velocity) < most) & is_low[:, rows]
        of_other = np.sort(steps.sum(axis=1))[-2:].min()
        is_usual &= of_other > limits.GROUND_OTHER_FOOT * is_alike.sum()
        if is_moving and is_usual:
            uneven = float(np.percentile(away[is_alike], _UNEVEN)) / near
            return MovingGround(velocity, 1.0 + min(uneven, 1.0))
    return None


def _neighbours(points: Floats, places: Floats, near: float) -> Ints:
    """Return the number of points (N, 3) that are within a distance of each place (M, 3): (M,)."""
    # |p - q|^2 = |p|^2 + |q|^2 - 2 p . q, by one matrix product for many places.
    squares, counts = (points * points).sum(axis=1), np.zeros(len(places), dtype=np.int32)
    for part in blocks_of_rows(len(places), len(points)):
        some = places[part]
        away = squares - 2.0 * some @ points.T + (some * some).sum(axis=1)[:, None]
        counts[part] = (away < near * near).sum(axis=1)
    return counts


def _lowest_velocities(foot: FootPath, rows: Ints, half: int, up: Floats) -> Floats:
    """Return the displacements (M, 3) per row, along the ground, of the lower point of a foot."""
    is_toe = (foot.toe @ up <= foot.heel @ up)[rows, None]
    return np.where(is_toe, *(_velocities(each, rows, half, up) for each in (foot.toe, foot.heel)))


def _velocities(path: Floats, rows: Ints, half: int, up: Floats) -> Floats:
    """Return the displacement per row around each row, along the ground."""
    across = along_ground(up)
    return (path[rows + half] - path[rows - half]) / (2.0 * half) @ across


def on_moving_ground(feet: Sequence[FootPath], travel: Floats) -> list[FootPath]:
    """Return the paths of the feet relative to the ground, moved by ``travel`` (N, 3)."""
    result = []
    for foot in feet:
        toe = foot.toe + travel
        heel = toe if foot.heel is foot.toe else foot.heel + travel
        result.append(FootPath(toe, heel, foot.hip + travel))
    return result
