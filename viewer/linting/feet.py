"""Checks of a body's feet: sliding during ground contact, sinking into the ground, and floating."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Phrase
from viewer.linting._finding import Finding
from viewer.linting._subject import Subject, Track, track_of, travelling_joints
from viewer.phrases import counted, listed, rounded
from viewer.rigs.arrays import Bools, Floats, largest_first, runs_of
from viewer.rigs.feet import limits
from viewer.rigs.feet.contacts import (
    Contact,
    FootPath,
    along_ground,
    foot_contacts,
    half_window,
    is_upright,
    mean_speeds,
    moving_ground,
    on_moving_ground,
    slowest_points,
)
from viewer.rigs.feet.ground import Ground, ground_under, resting_frames
from viewer.rigs.feet.soles import extent
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.vectors import axis_vector
from viewer.rigs.retargeting.joint_names import name_tokens
from viewer.rigs.scene import Actor
from viewer.rigs.skeleton import joint_labels

# Keyframes are drawn by hand: feet that are shifted or roll below the ground are a matter of style.
# What is reported as a warning there cannot be one: a body that skates, or stands in the ground. So
# are frames that were baked from controls of inverse kinematics, which some BVH files have as
# joints, or which hold the feet of a moving body exactly: standing feet of captures have a median
# speed of 0.02 sizes per second.
# Captures of game skeletons have ik_foot and ik_hand, too, which follow feet and hands: what only
# animators have is where knees and elbows point.
_CONTROLS, _POLES = {"pole", "target", "ctrl", "control"}, {"knee", "elbow"}
_EXACT, _MOVES = 0.003, 0.03  # sizes per second: of a held foot at most, of the hip at least
_HELD = 0.5  # minimum fraction of the rows in which a foot stands while the body moves
_ALONG = 0.5  # minimum ratio of the hip's path to that of a foot that skates
_WITH_BODY = 0.1  # maximum difference of the velocities of foot and body, relative to the foot's
_ALONG_GROUND = 0.5  # the same along the ground, of feet that are slow: the body also sways
_GLIDES = 0.08  # minimum distance, in sizes, of a foot that stands: feet of captures creep a little
_DEEP = 0.08  # minimum depth of a foot that no roll reaches, as a fraction of the height
# Minimum height of the hip above the heel, relative to the leg, of a body that stands: of one that
# sits, it is about 0.6.
_STRAIGHT = 0.75
# Floors of whole motions, as fractions of the figure's height
_BELOW = 0.03  # minimum depth at which a character stands in the ground: as for a guessed ground
_LOW_FLOOR, _OTHER_FLOOR = 0.06, 0.25  # depths between which the floor of a capture is too low
_NEARLY_ALL = 0.9  # fraction of the frames: a jump may begin and end on the ground
_TOUCHING = 0.3  # minimum fraction of frames in which a foot is on the ground
_HOPS = 0.8  # seconds; a hop or dodge takes less
_RARELY = 0.1  # fraction of these frames in which the feet of a body that glides may be slow
_CARRIED = 0.2  # minimum length of this path, as a fraction of the figure's height


@dataclass(frozen=True, slots=True, eq=False)
class _Feet:
    """The feet of a moving body, and the ground below them."""

    subject: Subject
    track: Track
    heights: Floats
    """(F, N): of each foot's lowest point above the ground, in scene units."""
    height: float
    """Of the figure."""
    is_recorded: bool
    """Whether the motion was captured, and not made with inverse kinematics."""

    def label(self, foot: int) -> str:
        """Return the name of a foot's joint."""
        skeleton = self.subject.actor.figure.require_skeleton()
        return joint_labels(skeleton)[int(self.track.feet[foot])]


def check(subject: Subject) -> Iterator[Finding]:
    """Check the feet of a moving body: of two named ankles, or of a quadruped's legs."""
    figure = subject.actor.figure
    track = None if figure.skeleton is None else _moving(subject, figure)
    if track is None or figure.skeleton is None or subject.options.ground == "none":
        return
    n_feet = len(track.feet)
    if n_feet < 2:
        return
    height, heights = extent(track.stance)[1], track.soles
    given = subject.options.ground
    ground, sinks = 0.0, limits.SINKS
    if isinstance(given, float | int):
        ground = float(given)
    else:
        step = float(track.times[1] - track.times[0])
        stance = Actor(track.stance, placement=subject.actor.placement)
        found = ground_under(stance, subject.up, heights, track.present, step)
        if found.height is None:
            # Feet that are below the ground in nearly all frames are so wherever they rest, unless
            # they are those of a swimmer.
            highest = float(np.quantile(heights.min(axis=1)[track.present], _NEARLY_ALL))
            legs = np.concatenate([(path.hip - path.heel)[track.present] for path in track.paths])
            runs = is_upright(legs, axis_vector(subject.up))
            sunk = [*_sunk_throughout(subject, track, highest, height)] if runs else []
            yield from sunk or [_unsure(subject, found, step)]
            return
        ground, sinks = found.height, limits.SINKS_OF_GUESS if found.is_guess else limits.SINKS
        yield from _sunk_throughout(subject, track, ground, height)
        if n_feet == 2 and not found.is_guess:
            yield from _floats_throughout(subject, track, ground, height)
    feet = _Feet(subject, track, heights - ground, height, _is_recorded(subject, track))
    yield from _sunk(feet, sinks * height)
    if n_feet == 2:  # animals also lie on the ground
        yield from _floating(feet, given == "auto")
    yield from _slipped(feet)


def _moving(subject: Subject, figure: Figure) -> Track | None:
    clip = subject.actor.clip
    if clip is None or clip.end <= clip.start or subject.lacks("joints"):
        return None
    track = track_of(subject)
    return track if track is not None and track.size > 0.0 and len(track.times) > 2 else None


def _is_recorded(subject: Subject, track: Track) -> bool:
    """Return whether a motion was captured, and its feet were not held by inverse kinematics."""
    if subject.actor.captured is None or track.body <= 0.0:
        return subject.actor.captured is not None
    names = [set(name_tokens(name)) for name in subject.actor.figure.require_skeleton().names]
    if sum(bool(name & _CONTROLS) or ("ik" in name and bool(name & _POLES)) for name in names) > 1:
        return False
    rate = 1.0 / float(track.times[1] - track.times[0])
    how = runs_of(track.present), rate, track.body, axis_vector(subject.up)
    n_rows = n_held = 0
    for path, contacts in zip(track.paths, foot_contacts(track.paths, *how), strict=True):
        points = (path.toe, path.heel)
        slowest = np.min([mean_speeds(each, rate) for each in points], axis=0) / track.body
        moves = mean_speeds(path.hip, rate) > _MOVES * track.body
        for contact in contacts:
            rows = slice(contact.start, contact.stop)
            n_rows += int(moves[rows].sum())
            n_held += int((moves[rows] & (slowest[rows] < _EXACT)).sum())
    return n_held <= _HELD * n_rows


def _unsure(subject: Subject, found: Ground, step: float) -> Finding:
    """Report that the ground is unknown, and feet were therefore not checked."""
    if not found.levels:
        return subject.found(
            "C013.no-height: feet never rest long enough at one height: ground height unclear, "
            "feet not checked",
            part="clip",
        )
    levels = [
        Phrase("{height} for {seconds} s", height=rounded(height), seconds=rounded(count * step, 2))
        for height, count in found.levels
    ]
    return subject.found(
        "C013.heights: feet rest at {n} ({levels}): ground height unclear, feet not checked",
        n=counted(len(levels), "height"),
        levels=listed(levels),
        part="clip",
    )


def _sunk(feet: _Feet, limit: float) -> Iterator[Finding]:
    """Report feet that sink deeper than a limit in figure units."""
    subject, track = feet.subject, feet.track
    depths = np.where(track.present[:, None], -feet.heights, 0.0)
    deepest = depths.max(axis=1)
    is_deep = np.pad(deepest > limit * track.scale, 1)
    # A single frame may be noise, unless it is far too deep.
    lasts = is_deep[1:-1] & (is_deep[:-2] | is_deep[2:])
    frames = np.flatnonzero(lasts | (deepest > limits.FAR_TOO_DEEP * limit * track.scale))
    if len(frames) == 0:
        return
    frames = largest_first(frames, deepest)
    worst = int(depths[frames[0]].argmax())
    is_serious = (
        feet.is_recorded
        or bool(deepest[frames[0]] > _DEEP * feet.height * track.scale)
        or _stands_sunk(feet, depths, limit)
    )
    each = track.of_each(frames)
    yield subject.found(
        "C008.foot: {n}: {joint} is {depth} below the ground at frame {frame}",
        n=counted(len(each), "frame", of=track.n_frames),
        all=track.n_frames,
        joint=feet.label(worst),
        depth=subject.length(float(deepest[frames[0]] / track.scale)),
        frame=int(track.numbers[frames[0]]),
        severity="warning" if is_serious else "note",
        part="clip",
        joints=track.feet[[worst]],
        frames=track.numbers[each],
        times=track.times[each],
        at=("frames", int(frames[0])),
    )


def _stands_sunk(feet: _Feet, depths: Floats, limit: float) -> bool:
    """Return whether a foot rests below a limit for as long as feet stand."""
    track = feet.track
    step, size = float(track.times[1] - track.times[0]), track.scale * feet.height
    for foot in depths.T:
        rests = resting_frames(-foot, track.present, step, size, limits.RESTS_FOR)
        if (rests & (foot > limit * track.scale)).sum() * step >= limits.RESTS_FOR:
            return True
    return False


def _rest_sole(subject: Subject, figure: Figure) -> float:
    """Return the height of the soles at rest in the scene."""
    row = subject.actor.placement["xyz".index(subject.up)]
    return float(row["xyz".index(figure.up)] * extent(figure)[0] + row[3])


def _sunk_throughout(
    subject: Subject, track: Track, ground: float, height: float
) -> Iterator[Finding]:
    """Report feet that stand below the ground in a whole motion, where the ground is known."""
    # A modelled character stands at rest on the floor of its animations, or they have it at 0. A
    # capture may have any floor, and stand well below 0 if its root counts from the hip; a floor
    # a little below is a fault of its height.
    figure = track.stance
    sole, size = _rest_sole(subject, figure), track.scale * height
    is_modelled = subject.actor.captured is None and figure.is_attached
    floor, least, most = (sole, _BELOW, np.inf) if is_modelled else (0.0, _LOW_FLOOR, _OTHER_FLOOR)
    depth = min(floor, 0.0) - ground
    if not least * size < depth < most * size:
        return
    yield subject.found(
        "C008.throughout: feet are {depth} below the ground in the whole motion",
        depth=subject.length(depth / track.scale),
        part="clip",
        joints=track.feet,
        frames=track.numbers[:1],
        times=track.times[:1],
        at=("frames", 0),
    )


def _floats_throughout(
    subject: Subject, track: Track, ground: float, height: float
) -> Iterator[Finding]:
    """Report a modelled character whose feet rest above the floor in a whole motion."""
    # The nearer of both floors, as above, is meant. Who sits has bent legs, and so do most climbers
    # and riders; who swims has none below the body.
    figure, size = track.stance, track.scale * height
    if subject.actor.captured is not None or not figure.is_attached:
        return
    legs = np.stack([path.hip - path.heel for path in track.paths])[:, track.present]
    reach = (legs @ axis_vector(subject.up)).max(axis=0)
    if float(np.median(reach)) < _STRAIGHT * 0.5 * track.body:
        return
    above = min(ground - _rest_sole(subject, figure), ground, key=abs)
    if not _BELOW * size < above < _OTHER_FLOOR * size:
        return
    yield subject.found(
        "C016.throughout: feet are {height} above the ground in the whole motion",
        height=subject.length(above / track.scale),
        part="clip",
        joints=track.feet,
        frames=track.numbers[:1],
        times=track.times[:1],
        at=("frames", 0),
    )


def _floating(feet: _Feet, may_step: bool) -> Iterator[Finding]:
    """Report a body whose lower foot rests above the ground; ``may_step``: by less than a step."""
    subject, track = feet.subject, feet.track
    lowest, size = feet.heights.min(axis=1), track.scale * feet.height
    step = float(track.times[1] - track.times[0])
    rests = resting_frames(lowest, track.present, step, size, limits.RESTS_FOR)
    most = limits.STEPS * size if may_step else np.inf
    frames = np.flatnonzero(rests & (lowest > limits.FLOATS * size) & (lowest < most))
    if len(frames) == 0:
        return
    frames = largest_first(frames, lowest)
    each = track.of_each(frames)
    yield subject.found(
        "C016.foot: {n}: both feet rest up to {height} above the ground, highest at frame {frame}",
        n=counted(len(each), "frame", of=track.n_frames),
        all=track.n_frames,
        height=subject.length(float(lowest[frames[0]] / track.scale)),
        frame=int(track.numbers[frames[0]]),
        part="clip",
        joints=track.feet,
        frames=track.numbers[each],
        times=track.times[each],
        at=("frames", int(frames[0])),
    )


def _slipped(feet: _Feet) -> Iterator[Finding]:
    """Report a foot that slides along the ground, where feet do not stand."""
    subject, track = feet.subject, feet.track
    if track.body <= 0.0:  # legs without a length
        return
    step = float(track.times[1] - track.times[0])
    paths = list(track.paths)
    how = runs_of(track.present), 1.0 / step, track.body, axis_vector(subject.up)
    ground = moving_ground(paths, *how)
    if ground is not None:  # a motion in place: standing feet move with the ground
        paths = on_moving_ground(paths, (track.times[0] - track.times)[:, None] * ground.velocity)
    slips = 1.0 if ground is None else ground.slips
    speeds = np.stack([slowest_points(path, *how) for path in paths], axis=1)
    stands = np.zeros(speeds.shape, dtype=np.bool_)
    found = foot_contacts(paths, *how, slips=slips)
    for foot, contacts in enumerate(found):
        for contact in contacts:
            stands[contact.start : contact.stop, foot] = True
    touches = (np.abs(feet.heights) < limits.TOUCHES * track.body) & track.present[:, None]
    # Speeds are averaged over a window, so a foot must touch the ground in all of it.
    half, n_frames = half_window(1.0 / step) + 1, len(touches)
    for foot in range(len(paths)):
        for first, last in runs_of(touches[:, foot]):
            touches[first : first + half * (first > 0), foot] = False
            touches[max(last - half * (last < n_frames), 0) : last, foot] = False
    # Of the motion as it is: on moving ground, all that rests moves alike.
    body = track.positions[:, travelling_joints(track, subject.actor.figure.require_skeleton())[-1]]
    glides = np.all([_moves_with(path.heel, body) for path in track.paths], axis=0)
    carried = np.repeat(glides[:, None], len(paths), axis=1)
    if ground is not None:
        # Of a walk in place, the body moves less than half as fast as a foot that swings.
        across = along_ground(axis_vector(subject.up))
        body_speeds = np.linalg.norm(np.gradient(body @ across, step, axis=0), axis=1)
        carried |= body_speeds[:, None] > _ALONG * speeds
    slides = _sliding(speeds / track.body, touches & ~stands, stands, carried, step)
    slides |= _carried_slowly(track, body, speeds, touches & ~stands, axis_vector(subject.up))
    for foot, contacts in enumerate(found):
        for contact in contacts:
            if _drifts(paths[foot], contact, track.body, axis_vector(subject.up)):
                slides[contact.start : contact.stop, foot] = True
    # Distances by the trapezoidal rule; averaged speeds contain less noise than single steps.
    both = slides[1:] & slides[:-1]
    distances = (both * 0.5 * (speeds[1:] + speeds[:-1])).sum(axis=0) * step
    moves = np.zeros(3) if ground is None else ground.velocity
    travels = _drifting(feet, speeds / track.body, touches, moves)
    if not (distances > limits.FAR * track.body).any():
        yield from travels
        return
    worst = int(distances.argmax())
    is_carried = feet.is_recorded or _is_carried(feet, worst, slides[:, worst])
    if not is_carried:
        yield from travels
    fastest = int(np.where(slides[:, worst], speeds[:, worst], 0.0).argmax())
    each = track.of_each(np.concatenate([[fastest], np.flatnonzero(slides.any(axis=1))]))
    yield subject.found(
        "C007.foot: {n}: {joint} slides by {distance} in total, at up to {speed} (frame {frame})",
        n=counted(len(each), "frame", of=track.n_frames),
        all=track.n_frames,
        joint=feet.label(worst),
        distance=subject.length(float(distances[worst] / track.scale)),
        speed=subject.speed(float(speeds[fastest, worst] / track.scale)),
        frame=int(track.numbers[fastest]),
        severity="warning" if is_carried else "note",
        part="clip",
        joints=track.feet[[worst]],
        frames=track.numbers[each],
        times=track.times[each],
        at=("frames", fastest),
    )


def _drifts(path: FootPath, contact: Contact, size: float, up: Floats) -> bool:
    """Return whether a foot that stands is carried along by its hip, however slowly."""
    rows = slice(contact.start, contact.stop)
    across = along_ground(up)
    # The end of the foot that moves least: it may turn about the other one.
    ways = [(point[rows][-1] - point[rows][0]) @ across for point in (path.toe, path.heel)]
    way = min(ways, key=lambda each: float(np.linalg.norm(each)))
    length = float(np.linalg.norm(way))
    hip = path.hip[rows][-1] - path.hip[rows][0]
    return length > _GLIDES * size and float(hip @ way) > _ALONG * length**2


def _drifting(feet: _Feet, speeds: Floats, touches: Bools, ground: Floats) -> Iterator[Finding]:
    """Report a body that travels while its feet walk at another speed, or in place.

    ``ground``: (3,), its velocity below a body in place.
    """
    # A walker travels, and each foot stands for some time; or both feet pass the body on a ground
    # that moves. If the body travels although no foot ever stands, it glides.
    subject, track = feet.subject, feet.track
    rows = np.flatnonzero(touches.any(axis=1))
    there = np.flatnonzero(track.present)
    seconds = float(track.times[there[-1]] - track.times[there[0]]) if len(there) else 0.0
    if seconds < _HOPS or len(rows) < _TOUCHING * len(there):
        return
    slowest = np.where(touches, speeds, np.inf).min(axis=1)[rows]
    path = np.mean([foot.hip for foot in track.paths], axis=0)
    travel = (path[there[-1]] - path[there[0]]) @ along_ground(axis_vector(subject.up))
    distance = float(np.linalg.norm(travel))
    # Faster than any foot that slides, the body runs or flies.
    speed = float(np.quantile(slowest, _RARELY))
    # Ground that moves below a walker moves backwards. If it seems to move along with the body, so
    # do the feet that stand on it.
    is_along = float(ground @ travel) * seconds > _ALONG * distance**2
    if distance < _CARRIED * feet.height * track.scale:
        return
    if not is_along and not limits.FAST < speed < limits.SWINGS:
        return
    yield subject.found(
        "C007.travel: the body travels {distance}, but no foot ever stands",
        distance=subject.length(distance / track.scale),
        part="clip",
        joints=track.feet,
        frames=track.numbers[track.of_each(rows)],
        times=track.times[track.of_each(rows)],
        at=("frames", int(rows[0])),
    )


def _is_carried(feet: _Feet, foot: int, slides: Bools) -> bool:
    """Return whether the hip moves along with a foot while it slides: the body skates."""
    # Animators also shift a foot under a body that stays, and let feet of walks in place glide at
    # speeds that vary. Of the foot's path, only what the hip does in the same steps counts.
    track = feet.track
    both, path = slides[1:] & slides[:-1], track.paths[foot]
    steps, hips = np.diff(path.heel, axis=0)[both], np.diff(path.hip, axis=0)[both]
    lengths = np.linalg.norm(steps, axis=1)
    carried = float((np.einsum("na,na->n", hips, steps) / np.maximum(lengths, 1e-30)).sum())
    return carried > _ALONG * lengths.sum() and carried > _CARRIED * feet.height * track.scale


def _carried_slowly(track: Track, body: Floats, speeds: Floats, low: Bools, up: Floats) -> Bools:
    """Return where low feet (F, N) are too slow to swing, and all move along with the body."""
    # Of a body that stands or walks, at least one foot stays behind.
    across = along_ground(up)
    with_body = [
        _moves_with(path.heel @ across, body @ across, _ALONG_GROUND) for path in track.paths
    ]
    is_slow = (speeds > limits.SLOW * track.body) & (speeds < limits.FAST * track.body)
    result: Bools = low & is_slow & np.all(with_body, axis=0)[:, None]
    return result


def _moves_with(foot: Floats, body: Floats, most: float = _WITH_BODY) -> Bools:
    """Return the frames (F,) in which a foot moves as the body does: it does not swing."""
    steps, body_steps = np.gradient(foot, axis=0), np.gradient(body, axis=0)
    apart = np.linalg.norm(steps - body_steps, axis=1)
    result: Bools = apart < most * np.linalg.norm(steps, axis=1)
    return result


def _sliding(speeds: Floats, low: Bools, stands: Bools, glides: Bools, step: float) -> Bools:
    """Return the frames (F, N) in which low feet slide; ``speeds`` are body sizes per second.

    ``glides``: (F, N), where feet move with the body.
    """
    # A foot also swings close to the ground, but while another foot stands, and only after speeding
    # up. So a foot slides if it stood before or stands afterwards and does not speed up much, or if
    # no other foot stands. Starting and landing feet slide only for short times. A foot that stays
    # low and moves for longer than any swing is dragged.
    # Faster than any foot that slides, a foot swings, unless the whole body moves with it.
    moves = low & (speeds > limits.FAST) & ((speeds < limits.SWINGS) | glides)
    result = np.zeros_like(moves)
    for foot in range(moves.shape[1]):
        is_alone = np.delete(stands, foot, axis=1).sum(axis=1) == 0
        for first, last in runs_of(moves[:, foot]):
            stood = bool(stands[max(first - 1, 0) : last + 1, foot].any())
            drifts = stood and bool(speeds[first:last, foot].max() < limits.DRIFTS)
            is_dragged = (last - first) * step > limits.DRAGS_FOR
            result[first:last, foot] = is_alone[first:last] | drifts | is_dragged
        for first, last in runs_of(result[:, foot]):
            result[first:last, foot] = last - first >= max(1, round(limits.SLIDES_FOR / step))
    return result
