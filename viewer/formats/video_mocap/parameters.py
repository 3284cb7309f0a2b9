"""SMPL parameters in dicts of any layout: whose they are, and in which frame.

``parameter_layout.py`` finds the dicts, and which of their keys hold what. A dict has all frames of
one or several people, or one frame of one or several people. Several rows with the same frame are
several people. In a list of frames, None, an empty list, no rows and a dict without poses are
frames without people. What the file does not tell, such as which of two lists has the people, is
derived from the values, and a note says what was assumed. AMASS files and single poses have other
spellings and are read by ``amass.py`` and ``pose.py``.
"""

from __future__ import annotations

import itertools
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import wording
from viewer.errors import FormatError
from viewer.formats._archive.checking import finite, finite_or_nan, within_reach
from viewer.formats._archive.values import Archive, Value, describe, texts_in
from viewer.formats._body_keys import GENDER_REMEDY, gender_in, model_in, scale_in
from viewer.formats._frame_gaps import frame_spans
from viewer.formats._source import Source
from viewer.formats.video_mocap.numbers import (
    Frames,
    RowBudget,
    first_rows,
    frames_of,
    person_number,
    places,
    rotation_vectors,
    rows,
)
from viewer.formats.video_mocap.parameter_layout import (
    ASSUMED,
    COST,
    JOINT_NAMES,
    OF_PEOPLE,
    ParameterDict,
    ParameterLayout,
    StatedValue,
    identities,
    only_element,
    parameter_dicts,
    parameter_layout,
    with_facts,
)
from viewer.formats.video_mocap.results import Results, Track
from viewer.phrases import agree, counted, listed, optional, printable
from viewer.rigs.arrays import Deferred, Floats
from viewer.rigs.bodies.smpl_family import FAMILY, gender_of
from viewer.rigs.motion.timing import FASTEST, SLOWEST, is_rate

_AMASS = {
    *("poses", "pose", "fullpose", "smpl_poses"),
    *("root_orient", "global_orient", "pose_body", "body_pose"),
}
_OF_SMPLX = ("jaw_pose", "leye_pose", "reye_pose", "pose_jaw", "pose_eye", "expression")
_BODY_JOINTS = 22  # of a body without hands, which SMPL, SMPL+H and SMPL-X share
_LISTED = 12  # maximum number of ignored keys that are listed
_NAMED_PERSON = re.compile(r"(?:subj|subject|person|people|pid|id|track|tracklet)[_ -]?(\d{1,9})")
_NAMED_FRAME = re.compile(r"\D*(?:.*\D)?(\d{1,9})(?:\.[A-Za-z]\w*)?")
_LOOKED_AT = 5000  # number of dicts of which at least one must be recognised

# Maximum number of frames of a numbered dict: this many for every item, plus a constant.
_MOST_HOLES, _FEW = 10, 1000
# Ratio of variances of one person and of several; they have the same number of rows.
_STEADIER = 0.1
_Person = int | str | tuple[int, ...]
"""A person of a row: an ID or name of the file, or the index of a dict and the person in it."""


@dataclass(frozen=True, slots=True, eq=False)
class _Rows:
    """A track of several people: the frame and person of each row."""

    track: Track
    frames: Frames
    persons: Sequence[_Person]
    genders: Sequence[str]


def recognises(archive: Archive) -> bool:
    """Return whether an archive has SMPL parameters in a layout other than AMASS's."""
    layout = parameter_layout(archive)
    if layout is None:
        budget = RowBudget(archive, COST * _LOOKED_AT)
        try:
            return next(parameter_dicts(archive, budget), None) is not None
        except FormatError:  # there are thousands of dicts without poses
            return False
    is_plain = all(key in _AMASS and form.size == 3 for key, form in layout.poses)
    is_plain &= not layout.is_in_camera
    has_people = layout.person is not None and layout.count > 1
    is_numbered = layout.frames is not None or (layout.frame is not None and layout.count == 1)
    return not is_plain or is_numbered or has_people


def read(source: Source, archive: Archive) -> Results:
    """Read all people."""
    found = with_facts([*parameter_dicts(archive)])
    layout = found[0].layout
    people, span = _people(source, found)
    is_camera = layout.is_in_camera
    space = "camera" if is_camera else "world"
    if any(scope.kind == ASSUMED for one in found for scope in one.around):
        source.warn(
            "F007.video-axes: poses with two axes before the joints: {people} people in "
            "{frames} assumed, because the shorter axis is usually that of the people; add "
            "person_id with a number for each person to be certain",
            people=len(found),
            frames=counted(layout.count, "frame"),
        )
    if layout.place is None:
        source.warn(wording.MOTION_PLACE)
    recognised = [
        f"{key} ({form.title} of {counted(form.n_joints, 'joint')})" for key, form in layout.poses
    ]
    recognised += [value.title for value in layout.others]
    used = {key for one in found for key in one.path}
    used |= {key for one in found for key, _ in one.layout.poses}
    used |= {
        key for one in found for value in one.layout.others for key in (value.key, value.within)
    }
    scopes = [scope for scope in (found[0].archive, *found[0].around) if not scope.is_list]
    ignored = [*dict.fromkeys(key for scope in scopes for key in scope.keys if key not in used)]
    rest = ", ".join(map(printable, ignored[:_LISTED]))
    source.warn(
        "F007.video-parameters: SMPL parameters of {n} {people}: {recognised}{ignored}",
        n=len(people),
        recognised=listed(recognised, 12),
        ignored=optional("; ignored: {}", rest),
        people=agree(len(people), "person", "people"),
    )
    n_joints = sum(form.n_joints for _, form in layout.poses)
    model = FAMILY[n_joints].title if n_joints in FAMILY else "SMPL"
    if layout.model is not None:
        model = model_in([layout.model.archive.objects(layout.model.key)])
    elif n_joints == _BODY_JOINTS and any(map(found[0].archive.has, _OF_SMPLX)):
        model = "SMPL-X"
    facts = (("recognised", ", ".join(recognised)),)
    return Results(
        "SMPL parameters",
        model,
        {space: people},
        {space: "-y" if is_camera else ""},
        frame_rate=_rate(source, found),
        facts=facts,
        span=span,
    )


def _rate(source: Source, found: list[ParameterDict]) -> float | None:
    """Return the first frame rate; note values that differ from it, or are not frame rates."""
    values = [one.layout.rate for one in found if one.layout.rate is not None]
    rates: list[float] = []
    for archive, key in dict.fromkeys((value.archive, value.key) for value in values):
        rate = _number(archive.get(key))
        if rate is None or not is_rate(rate):
            shown = describe(archive.get(key)) if rate is None else f"{rate:g}"
            source.warn(
                "F007.rate-ignored: {item}: expected {low:g} to {high:,.0f} frames per second, "
                "found {found}: ignored",
                item=key,
                low=SLOWEST,
                high=FASTEST,
                found=shown,
            )
        elif rate not in rates:
            rates.append(rate)
    if len(rates) > 1:
        source.warn(wording.MOTION_RATES, rates=listed([f"{rate:g}" for rate in rates]))
    return rates[0] if rates else None


def _number(value: Value) -> float | None:
    """Return a number, also as text or an array of one; None for other values."""
    value = only_element(value)
    if isinstance(value, bool) or not isinstance(value, int | float | str | bytes):
        return None
    try:
        return float(value)
    except (ValueError, OverflowError):
        return None


def _people(source: Source, found: list[ParameterDict]) -> tuple[dict[int, Track], tuple[int, ...]]:
    """Return the tracks of people, and the first and last frame of a list of frames."""
    tracks = [_track(one) for one in found]
    is_alike = len({(track.joint_names, _width(track.shape)) for track in tracks}) == 1
    if is_alike and _are_frames(found):
        rows, span = _rows_of_frames(source, found, tracks)
    else:
        rows, span = _rows_of_people(source, found, tracks), ()
    return _assembled(source, rows), span


def _are_frames(found: list[ParameterDict]) -> bool:
    """Return whether dicts are frames, and not people.

    A single dict is one if it is an item of a longer list, whose other items are missing. Dicts of
    several rows are frames if they have one frame number each, if each row is another person, or if
    they are items of a list that has more items than any of them has rows.
    """
    most = max(one.layout.count for one in found)
    if len(found) == 1 and not any(
        scope.is_list and len(scope.keys) > 1 for scope in found[0].around
    ):
        return False
    if most == 1:
        return True
    if any(scope.kind in OF_PEOPLE for one in found for scope in one.around):
        return False
    if any(one.layout.frames is not None for one in found):
        return False
    if all(one.layout.frame is not None for one in found):
        return True
    listed = [
        identities(one.layout.person, one.layout.count)
        for one in found
        if one.layout.person is not None
    ]
    if len(listed) == len(found):
        return all(len(set(persons)) == len(persons) for persons in listed)
    container = found[0].around[-1]
    return container.is_list and len(container.keys) > most


def _rows_of_people(source: Source, found: list[ParameterDict], tracks: list[Track]) -> list[_Rows]:
    """Return the rows of dicts, each of which has all frames of one or several people."""
    rows: list[_Rows] = []
    taken: dict[int, int] = {}
    for index, (one, track) in enumerate(zip(found, tracks, strict=True)):
        frames = track.frames
        again = _occurrences(frames.tolist())
        persons: list[_Person]
        if one.layout.person is not None:
            persons = [*identities(one.layout.person, len(frames))]
            if one.layout.frames is None and len(set(persons)) > 1:
                frames = _occurrences(persons)
                source.warn(
                    "F007.video-rows: no frame numbers: the rows of each {item} are its frames, "
                    "in order",
                    item=one.layout.person.key,
                )
        elif again.any():
            persons = [(index, person) for person in again.tolist()]
            source.warn(wording.VIDEO_REPEATED, n=int(again.max()) + 1)
        else:
            known = (_person_named(part) for part in one.path)
            number = next((each for each in known if each is not None), None)
            is_free = number is not None and taken.setdefault(number, index) == index
            persons = [number if number is not None and is_free else (index, 0)] * len(frames)
        rows.append(_Rows(track, frames, persons, _genders(one.layout.gender, len(frames))))
    return rows


def _rows_of_frames(
    source: Source, found: list[ParameterDict], tracks: list[Track]
) -> tuple[list[_Rows], tuple[int, ...]]:
    """Return the rows of dicts of single frames, and the first and last frame of their list."""
    frames, persons, span = _on_timeline(source, found, tracks)
    is_known = all(one.layout.person is not None for one in found)
    rows: list[_Rows] = []
    seen: Counter[int] = Counter()
    for one, track, frame, number in zip(found, tracks, frames, persons, strict=True):
        count = one.layout.count
        own: list[_Person] = [*range(seen[frame], seen[frame] + count)]
        if is_known and one.layout.person is not None:
            own = [*identities(one.layout.person, count)]
        elif number is not None and count == 1:
            own = [number]
        seen[frame] += count
        genders = _genders(one.layout.gender, count)
        rows.append(_Rows(track, np.full(count, frame), own, genders))
    most = max(seen.values())
    if most > 1 and not is_known:
        source.warn(wording.VIDEO_REPEATED, n=most)
    return rows, span


def _on_timeline(
    source: Source, found: list[ParameterDict], tracks: list[Track]
) -> tuple[list[int], list[int | None], tuple[int, ...]]:
    """Return each dict's frame, its person if its place tells it, and the range of frames."""
    depth = min(len(one.path) for one in found)
    levels = [
        level
        for level in range(depth)
        if found[0].around[level].is_list
        or len({one.path[: level + 1] for one in found}) > len({one.path[:level] for one in found})
    ]
    numbers = [
        None if one.layout.frame is None else identities(one.layout.frame, 1)[0] for one in found
    ]
    keyed = [number for number in numbers if isinstance(number, int)]
    of_people = [level for level in levels if _are_people(found, level)]
    if len(keyed) == len(found):
        # Keys of dicts only tell people apart if frames repeat.
        is_repeated = len(set(keyed)) < len(keyed)
        level = next((one for one in levels if not found[0].around[one].is_list), None)
        persons = [
            _person_named(one.path[level]) if is_repeated and level is not None else None
            for one in found
        ]
        return keyed, persons, ()
    if len(levels) > 1 and not of_people:
        of_people = [_level_of_people(source, found, tracks, levels[:2])]
    of_frames = next((level for level in levels if level not in of_people), None)
    others = [level for level in range(depth) if level != of_frames]
    names = [[_person_named(one.path[level]) for level in others] for one in found]
    persons = [next((one for one in each if one is not None), None) for each in names]
    if of_frames is None:
        return [0] * len(found), persons, ()
    frames, missing, span = _numbered(found, of_frames)
    if missing:
        spans = frame_spans(np.array(missing))
        source.warn(
            "F007.frames-empty: {n} without people: {frames}",
            n=counted(len(missing), "frame"),
            frames=listed(spans),
        )
    return frames, persons, span


def _are_people(found: list[ParameterDict], level: int) -> bool:
    """Return whether the keys of a dict on the path say that they are people."""
    return all(_NAMED_PERSON.fullmatch(one.path[level].lower()) for one in found)


def _level_of_people(
    source: Source, found: list[ParameterDict], tracks: list[Track], levels: Sequence[int]
) -> int:
    """Return which of two lists or dicts, one inside the other, has the people.

    No identity occurs twice in a frame. Otherwise, it is the one whose items keep their gender or
    shape in all items of the other one. Shapes that vary from frame to frame vary less than between
    people, and so do places. A note says what was assumed if nothing but places, or the longer
    list, tells it.
    """
    keys = {level: [one.path[level] for one in found] for level in levels}
    persons = [
        None if one.layout.person is None else identities(one.layout.person, 1)[0] for one in found
    ]
    genders = [_genders(one.layout.gender, 1)[0] for one in found]
    shapes = [None if one.shape is None else one.shape.tobytes() for one in tracks]
    outer, inner = levels
    if all(isinstance(one, str) or (one is not None and one >= 0) for one in persons):
        is_once = [_most_repeated(keys[level], persons) == 1 for level in levels]
        if any(is_once):
            return inner if is_once[0] else outer
    # Items of one dict each have the same values in any case.
    is_table = all(len(set(keys[level])) < len(found) for level in levels)
    for values in (genders, shapes) if is_table else ():
        is_same = [_are_constant(keys[level], values) for level in levels]
        if is_same[0] != is_same[1] and not {None, ""}.intersection(values):
            return outer if is_same[0] else inner
    by_shape = by_place = None
    if is_table:
        by_shape = _steadier_level(keys, [one.shape for one in tracks])
        by_place = _steadier_level(keys, [one.translations for one in tracks])
    if by_shape is not None:
        return by_shape
    sizes = {level: max(len(one.around[level].keys) for one in found) for level in levels}
    chosen = by_place if by_place is not None else outer if sizes[outer] < sizes[inner] else inner
    if min(sizes.values()) > 1:
        other = outer if chosen == inner else inner
        source.warn(
            "F007.video-lists: nested lists: {people} people in {frames} assumed, because no "
            "ID, gender or shape tells the people apart; add person_id to each dict",
            people=sizes[chosen],
            frames=counted(sizes[other], "frame"),
        )
    return chosen


def _most_repeated(groups: Sequence[str], values: Sequence[object]) -> int:
    """Return how often the most frequent value of any group occurs in it."""
    return max(Counter(zip(groups, values, strict=True)).values())


def _are_constant(groups: Sequence[str], values: Sequence[object]) -> bool:
    """Return whether all values of a group are the same, but not those of all groups."""
    pairs = set(zip(groups, values, strict=True))
    return len(pairs) == len(set(groups)) and len(set(values)) > 1


def _steadier_level(
    keys: Mapping[int, Sequence[str]], values: Sequence[Floats | None]
) -> int | None:
    """Return the level within whose items values vary much less; None if neither is."""
    rows = [value for value in values if value is not None and len(value) == 1]
    if len(rows) < len(values) or len({row.shape for row in rows}) > 1:
        return None
    table = np.concatenate(rows)
    spreads: dict[int, float] = {}
    for level, groups in keys.items():
        members = np.unique(np.array(groups), return_inverse=True)[1]
        counts = np.bincount(members)[:, None]
        means = np.stack([np.bincount(members, column) for column in table.T], axis=1) / counts
        # The variance within items has a degree of freedom less for the mean of each item.
        spreads[level] = float(((table - means[members]) ** 2).sum()) / (len(table) - len(counts))
    low = min(spreads, key=spreads.__getitem__)
    high = max(spreads, key=spreads.__getitem__)
    return low if spreads[low] < _STEADIER * spreads[high] else None


def _numbered(
    found: list[ParameterDict], level: int
) -> tuple[list[int], list[int], tuple[int, ...]]:
    """Return the frames of items of lists or dicts, those without people, and their range."""
    keys = [one.path[level] for one in found]
    scopes = dict.fromkeys(one.around[level] for one in found)
    known = set(keys)
    slots = [
        key
        for key in dict.fromkeys(key for scope in scopes for key in scope.keys)
        if key in known
        or any(scope.has(key) and scope.get(key) in (None, [], (), {}) for scope in scopes)
        or any(scope.is_list for scope in scopes)
    ]
    matches = [_NAMED_FRAME.fullmatch(key) for key in slots]
    numbers = [int(match[1]) for match in matches if match is not None]
    is_plausible = len(set(numbers)) == len(slots)
    if not is_plausible or max(numbers) - min(numbers) > _MOST_HOLES * len(slots) + _FEW:
        numbers = [*range(len(slots))]
    place = dict(zip(slots, numbers, strict=True))
    missing = sorted(place[key] for key in slots if key not in known)
    return [place[key] for key in keys], missing, (min(numbers), max(numbers))


def _person_named(name: str) -> int | None:
    """Return the person of a key that is a number, or a number after a word; None for others."""
    match = _NAMED_PERSON.fullmatch(name.lower())
    number = int(match[1]) if match else person_number(name)
    return number if number is not None and number >= 0 else None


def _occurrences(values: Sequence[object]) -> Frames:
    """Return how often each value has occurred before (N,): 0, 1, 0, 2 for 5, 5, 6, 5."""
    seen: Counter[object] = Counter()
    found = []
    for value in values:
        found.append(seen[value])
        seen[value] += 1
    return np.array(found, dtype=np.int64)


def _assembled(source: Source, rows: list[_Rows]) -> dict[int, Track]:
    """Return the tracks of people, each with the rows of one or several dicts."""
    numbers = _numbers_of(source, [person for each in rows for person in each.persons])
    listed: dict[int, list[tuple[Track, Frames]]] = {}
    genders: dict[int, dict[str, None]] = {}
    untracked: Counter[int] = Counter()
    for each in rows:
        own = np.zeros(len(each.frames), dtype=np.int64)
        for row, (frame, person) in enumerate(zip(each.frames.tolist(), each.persons, strict=True)):
            own[row] = numbers.get(person, 0)
            if isinstance(person, int) and person < 0:  # the number is unique only in its frame
                untracked[frame] += 1
                own[row] = -untracked[frame]
        for number in np.unique(own).tolist():
            chosen = np.flatnonzero(own == number)
            part = each.track.selected(chosen)
            genders.setdefault(number, {}).update(
                dict.fromkeys(each.genders[row] for row in chosen.tolist())
            )
            listed.setdefault(number, []).append((part, each.frames[chosen]))
    if untracked:
        source.warn(wording.RECORD_UNTRACKED)
    people: dict[int, Track] = {}
    for number, parts in sorted(listed.items()):
        frames, first = first_rows(source, np.concatenate([own for _, own in parts]))
        whole = _joined([track for track, _ in parts]).selected(first)
        said = [*filter(None, genders[number])]
        if len(said) > 1:
            source.warn(wording.MOTION_GENDER, found=", ".join(said), remedy=GENDER_REMEDY)
        people[number] = replace(whole, frames=frames, gender=said[0] if len(said) == 1 else "")
    return people


def _numbers_of(source: Source, persons: Sequence[_Person]) -> dict[_Person, int]:
    """Return the number of each person; names, and people without IDs, get unused numbers."""
    found = dict.fromkeys(persons)
    numbers: dict[_Person, int] = {one: one for one in found if isinstance(one, int)}
    used = set(numbers.values())
    for one in found:
        if not isinstance(one, int):
            start = one[0] + one[1] if isinstance(one, tuple) else 0
            numbers[one] = next(each for each in itertools.count(start) if each not in used)
            used.add(numbers[one])
    names = [
        f"{number}: {printable(one, 40)}" for one, number in numbers.items() if isinstance(one, str)
    ]
    if names:
        source.warn(wording.PERSON_NAMES, names=listed(names))
    return numbers


def _joined(tracks: list[Track]) -> Track:
    """Return the rows of one person, which are in several dicts."""
    if len(tracks) == 1:
        return tracks[0]
    counts = [len(track.frames) for track in tracks]
    shapes = [
        np.broadcast_to(track.shape, (count, track.shape.shape[1]))
        for track, count in zip(tracks, counts, strict=True)
        if track.shape is not None
    ]
    return Track(
        np.concatenate([track.frames for track in tracks]),
        tracks[0].joint_names,
        np.concatenate([track.vectors for track in tracks if track.vectors is not None]),
        np.concatenate([track.translations for track in tracks if track.translations is not None]),
        np.concatenate(shapes) if len(shapes) == len(tracks) else None,
    )


def _track(one: ParameterDict) -> Track:
    archive, layout = one.archive, one.layout
    parts = [rotation_vectors(archive, key, form) for key, form in layout.poses]
    vectors = np.concatenate(parts, axis=1)
    count = len(vectors)
    placed = np.zeros((count, 3))
    if layout.place is not None:
        beside, key = layout.place.archive, layout.place.key
        if beside.shape(key) == (3,):
            placed = within_reach(beside, key, rows(beside, key, (3,))[None])
        else:
            placed = places(beside, key, count)
    if layout.scale is not None:
        placed = placed / scale_in(layout.scale.archive, layout.scale.key)
    frames = np.arange(count)
    if layout.frames is not None:
        frames = frames_of(layout.frames.archive, layout.frames.key, count)
    elif layout.frame is not None and count == 1:
        number = identities(layout.frame, 1)[0]
        frames = np.array([number if isinstance(number, int) else 0])
    return Track(
        frames,
        JOINT_NAMES[vectors.shape[1]],
        vectors,
        placed,
        _coefficients(layout, count),
    )


def _genders(value: StatedValue | None, count: int) -> tuple[str, ...]:
    """Return the gender of each row; empty if the file does not state it."""
    if value is None:
        return ("",) * count
    found = value.archive.objects(value.key)
    if value.item is not None:
        items = found.values().tolist() if isinstance(found, Deferred) else found
        found = items[value.item] if isinstance(items, list | tuple) else None
    said = texts_in(found)
    if len(said) == count:
        return tuple(map(gender_of, said))
    return (gender_in(found)[0],) * count


def _coefficients(layout: ParameterLayout, count: int) -> Floats | None:
    if layout.shape is None:
        return None
    archive, key = layout.shape.archive, layout.shape.key
    shape = archive.shape(key)
    is_constant = count > 1 and (len(shape) == 1 or shape[0] == 1)
    check = finite if is_constant else finite_or_nan
    return check(archive, key, archive.array(key).values()).reshape(-1, shape[-1])


def _width(shape: Floats | None) -> int:
    return 0 if shape is None else shape.shape[1]
