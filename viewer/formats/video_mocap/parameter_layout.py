"""Dicts of SMPL parameters in an archive, found by the usual spellings of their keys.

::

    poses      poses, pose, rotmat … of all joints; or global_orient … and body_pose …
    places     trans, transl … ; cam_t … in the space of a camera, where y points down
    shape      betas, shape …
    frames     frame_ids, frames …; detection_all (N, C) of CLIFF, whose first column they are
    person     person_id, track_id, id …, one number or name, or one for each row
    gender     gender, of the body model; one, or one for each row
    model      model_type, model …: SMPL, SMPL+H or SMPL-X
    rate       fps, frame_rate, frameRate …, frames per second
    scale      smpl_scaling, by which places are divided

Dicts may be nested: people by number, frames in a list, or parameters within another dict. All keys
except the poses may also stand in one of the dicts around them, once, or as a list or dict with one
value for each dict. Gender, model and rate may also stand in a dict beside the parameters. Poses
may also be a list with the rows of each frame or person, or an array with an axis more than usual;
other lists and arrays of this length then belong to the frames or people too. ``parameters.py``
assigns the rows to people and frames.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import FormatError
from viewer.formats._archive.values import Archive, Value, describe, texts_in
from viewer.formats._body_keys import GENDERS, MODELS, RATES, gender_in, model_in
from viewer.formats.video_mocap.numbers import (
    Form,
    RowBudget,
    form_of,
    person_number,
    shape_form,
)
from viewer.rigs.arrays import Deferred
from viewer.rigs.bodies.smpl_family import gender_of, members_by_numbers

_WHOLE = (
    *("pose_world", "poses_world", "poses", "pose", "fullpose", "full_pose", "smpl_poses"),
    *("smpl_pose", "thetas", "theta", "pred_thetas", "smpl_thetas"),
    *("rotmat", "pred_rotmat", "pose_rotmat", "pred_pose", "body_rotmat", "bodyPose"),
)
_ROOTS = (
    *("global_orient", "root_orient", "pred_global_orient", "orient", "root_pose", "root_rot"),
    *("smplx_root_pose", "global_rot", "poses_root"),
)
_BODIES = ("body_pose", "pose_body", "pred_body_pose", "smplx_body_pose", "poses_body")
_WORLD = (
    *("trans_world", "trans", "transl", "translation", "smpl_trans", "root_trans"),
    *("smplx_transl", "Th", "bodyTranslation"),
)
_CAMERA = (
    *("cam_t", "pred_cam_t", "cam_trans", "camera_translation", "pred_trans", "pred_cam_trans"),
    *("trans_cam", "cam_transl", "transl_cam", "trans_full", "global_t"),
)
_SHAPES = (
    *("betas", "shape", "shapes", "pred_betas", "pred_shape", "beta", "smpl_shape", "smplx_shape"),
    *("shapeParameters",),
)
_FRAMES = ("frame_ids", "frames", "frame", "frame_id", "frame_idx", "frame_indices")
_COUNTS = ("frames", "frame_ids")  # a single number there is that of all frames
_DETECTIONS = "detection_all"
_PEOPLE = (
    *("person_id", "track_id", "tracklet_id", "person", "pid", "id"),
    *("person_ids", "track_ids", "tracklet_ids", "pids", "ids"),
)
_SCALES = ("smpl_scaling",)

_EACH = (*_PEOPLE, *GENDERS, *_SHAPES)  # keys with one value for each person
# Kinds of archives of the people in an array, whose axis other values tell, or nothing does.
OF_PEOPLE = _TOLD, ASSUMED = "people", "assumed people"
JOINT_NAMES = {len(names): names for names in members_by_numbers().values()}
_LARGEST = 1 << 30  # maximum number of a frame or person
_DEEPEST = 3  # maximum depth of dicts inside dicts; lists between them do not count
COST = 20  # number of frames that take about as long to read as one dict takes to inspect


@dataclass(frozen=True, slots=True, eq=False)
class StatedValue:
    """A value of a dict, or of one around it; ``item``: only this item of the value."""

    archive: Archive
    key: str
    item: int | None = None
    within: str = ""
    """The key of the dict that has the value, if neither has parameters."""

    @property
    def title(self) -> str:
        """Name in messages."""
        return f"{self.within}.{self.key}" if self.within else self.key


@dataclass(frozen=True, slots=True, eq=False)
class ParameterLayout:
    """Keys of one dict of parameters, and the forms of its rotations."""

    poses: tuple[tuple[str, Form], ...]
    place: StatedValue | None
    shape: StatedValue | None
    frames: StatedValue | None  # a number for each of several rows
    frame: StatedValue | None  # one number for all rows
    person: StatedValue | None
    rate: StatedValue | None
    gender: StatedValue | None
    model: StatedValue | None
    scale: StatedValue | None

    @property
    def count(self) -> int:
        """Number of rows."""
        return self.poses[0][1].n_frames

    @property
    def is_in_camera(self) -> bool:
        """Whether the places are in the space of a camera."""
        return self.place is not None and self.place.key in _CAMERA

    @property
    def others(self) -> list[StatedValue]:
        """Values other than the poses."""
        frames = self.frames or self.frame
        found = (self.place, self.shape, frames, self.person, self.rate)
        return [each for each in (*found, self.gender, self.model, self.scale) if each is not None]


@dataclass(frozen=True, slots=True, eq=False)
class ParameterDict:
    """A dict of parameters; its path from the outermost, and the dicts and lists on this path."""

    path: tuple[str, ...]
    around: tuple[Archive, ...]
    archive: Archive
    layout: ParameterLayout


def parameter_dicts(
    archive: Archive,
    budget: RowBudget | None = None,
    around: tuple[Archive, ...] = (),
    path: tuple[str, ...] = (),
) -> Iterator[ParameterDict]:
    """Yield all dicts with poses."""
    layout = parameter_layout(archive, around, path)
    budget = budget or RowBudget(archive)
    budget.spend(COST if layout is None else layout.count)
    if layout is not None:
        # A frame with arrays of no rows has no people.
        if layout.count or not (around and around[-1].is_list):
            yield ParameterDict(path, around, archive, layout)
        return
    parts = None if archive.is_list else _parts(archive)
    if parts is not None:
        key, items = parts
        found = [*parameter_dicts(items, budget, (*around, archive), (*path, key))]
        known = {one.path[len(path) + 1] for one in found}
        if found and all(name in known or items.get(name) is None for name in items.keys):
            yield from found
            return
    depth = sum(not scope.is_list for scope in around)
    for key in archive.keys if depth < _DEEPEST or archive.is_list else ():
        inner = archive.inside(key)
        if inner is not None:
            yield from parameter_dicts(inner, budget, (*around, archive), (*path, key))


def _parts(archive: Archive) -> tuple[str, Archive] | None:
    """Return the key of poses with an axis more than usual, and their items as a list of dicts.

    The items of a list of arrays are the rows of frames or of people (3DPW), and so are those of an
    array with IDs of each person and frame; ``_are_frames`` tells which. Of other arrays, they are
    people: of the axis as long as their shapes, genders or IDs, or else of the shorter one, which a
    note says. None if there are no such poses.
    """
    kinds = ((_WHOLE, tuple(JOINT_NAMES)), (_BODIES, (21, 23)))
    candidates = ((key, joints) for keys, joints in kinds for key in keys if archive.has(key))
    key, joints = next(candidates, ("", ()))
    shape = archive.shape(key) if key else ()
    axis, kind = 0, archive.kind
    if shape:
        is_usual = len(shape) < 3 or shape_form(shape, joints) is not None
        if is_usual or shape[0] * shape[1] < 2 or shape_form(shape[1:], joints) is None:
            return None
        if not any(archive.shape(name) == shape[:2] for name in _PEOPLE):
            told = _axis_of_people(archive, shape)
            axis = int(shape[1] < shape[0]) if told is None else told
            kind = ASSUMED if told is None else _TOLD
    poses = _along(archive, key, axis) if key else ()
    shapes = [
        Archive(archive.source, "item", (key,), {key: item}.__getitem__).shape(key)
        for item in poses
    ]
    forms = [shape_form(one, joints) for one in shapes]
    has_rows = [
        bool(item.shape[:1] != (0,) if isinstance(item, Deferred) else item) for item in poses
    ]
    if not any(forms) or any(has and not form for has, form in zip(has_rows, forms, strict=True)):
        return None

    def column(name: str) -> Sequence[Value]:
        own = archive.shape(name)
        is_table = own[:2] == shape[:2] and (len(own) > 2 or name in (*_PEOPLE, *_FRAMES))
        if kind in OF_PEOPLE and not is_table and name not in _EACH and shape[0] == shape[1]:
            return ()  # one for each frame, or one for each person
        if name in _SHAPES and len(own) == 1:
            return ()  # that of all
        return _along(archive, name, axis if is_table else 0, len(poses))

    found = {name: column(name) for name in archive.keys}
    columns = {name: items for name, items in found.items() if items}
    prefix = "person_" if kind in OF_PEOPLE else ""
    places = {f"{prefix}{index}": index for index in range(len(poses))}

    def item(name: str) -> Archive:
        return Archive(
            archive.source,
            archive.kind,
            tuple(columns),
            lambda key: columns[key][places[name]],
            label=f"{archive.label}{name}.",
        )

    return key, Archive(
        archive.source,
        kind,
        tuple(places),
        lambda name: poses[places[name]] if has_rows[places[name]] else None,
        item,
        archive.label,
        is_list=True,
    )


def _along(archive: Archive, key: str, axis: int, count: int | None = None) -> Sequence[Value]:
    """Return the items of a list, or of an array along an axis; none of other values or counts."""
    value = archive.objects(key)
    if axis == 0 and isinstance(value, list | tuple):
        return value if count in (None, len(value)) else ()
    if axis > 0:
        value = archive.array(key)
    if not isinstance(value, Deferred) or len(value.shape) <= axis:
        return ()
    known = value.shape[axis]
    return [_item(value, index, axis) for index in range(known)] if count in (None, known) else ()


def _item(array: Deferred, index: int, axis: int) -> Deferred:
    shape = (*array.shape[:axis], *array.shape[axis + 1 :])
    return Deferred(shape, array.dtype, lambda: np.asarray(array.values().take(index, axis)))


def _axis_of_people(archive: Archive, shape: tuple[int, ...]) -> int | None:
    """Return which of the first two axes of poses is as long as what each person has once."""
    for key in filter(archive.has, _EACH):
        texts = texts_in(archive.objects(key))
        own = archive.shape(key) or ((len(texts),) if texts else ())
        matches = [axis for axis in (0, 1) if own[:1] == shape[axis : axis + 1]]
        if len(own) == 1 and key in _SHAPES:
            continue  # the shape of all
        if len(own) <= 2 and len(matches) == 1:
            return matches[0]
    for key in filter(archive.has, _FRAMES):
        matches = [axis for axis in (0, 1) if archive.shape(key) == shape[axis : axis + 1]]
        if len(matches) == 1:
            return 1 - matches[0]
    return None


def parameter_layout(
    archive: Archive, around: Sequence[Archive] = (), path: Sequence[str] = ()
) -> ParameterLayout | None:
    """Return the layout of a dict inside others; None if it has no poses."""
    whole = _first_form(archive, _WHOLE, tuple(JOINT_NAMES))
    if whole is not None:
        poses: tuple[tuple[str, Form], ...] = (whole,)
    else:
        root, body = _first_form(archive, _ROOTS, (1,)), _first_form(archive, _BODIES, (21, 23))
        if root is None or body is None:
            return None
        count = body[1].n_frames
        if root[1].n_frames != count and archive.shape(root[0]) == (count, 3):
            root = root[0], Form(count, 1, 3)  # three frames, not one matrix
        if root[1].n_frames != count:
            return None
        poses = (root, body)
    count = poses[0][1].n_frames
    scopes = (archive, *reversed(around))

    def first(keys: Sequence[str], fits: Callable[[Archive, str], bool]) -> StatedValue | None:
        return next(
            (
                StatedValue(scope, key)
                for scope in scopes
                for key in keys
                if scope.has(key) and key not in path and fits(scope, key)
            ),
            None,
        )

    def is_single(scope: Archive, key: str) -> bool:
        return scope.shape(key) in ((), (1,)) and _identity(scope.get(key)) is not None

    def of_item(keys: Sequence[str]) -> StatedValue | None:
        """Find a list with one value for each item of a list, or of a dict, on the path."""
        for level in range(len(around) - 1, 0, -1):
            items, beside = around[level].keys, around[level - 1]
            for key in keys:
                if not beside.has(key) or key in path:
                    continue
                is_free = not archive.has(key) or is_single(archive, key)
                if is_free and _length(beside, key) == len(items):
                    return StatedValue(beside, key, items.index(path[level]))
                named = beside.inside(key)
                if named is not None and not named.is_list and named.has(path[level]):
                    return StatedValue(named, path[level], within=key)
        return None

    frames = frame = None
    if count > 1:
        # A number in the dict itself is that of all rows, whatever stands around it.
        frames = first(
            _FRAMES,
            lambda scope, key: (
                scope.shape(key) == (count,) and (scope is archive or not archive.has(key))
            ),
        )
        frames = frames or first(
            (_DETECTIONS,), lambda scope, key: scope.shape(key)[:1] == (count,)
        )
    if frames is None:
        single = _FRAMES if count == 1 else [key for key in _FRAMES if key not in _COUNTS]
        frame = first(single, is_single) or of_item(_FRAMES)
    person = of_item(_PEOPLE) or first(
        _PEOPLE, lambda scope, key: count > 1 and _length(scope, key) == count
    )
    person = person or first(_PEOPLE, is_single)
    place = first((*_WORLD, *_CAMERA), lambda scope, key: _is_place(scope.shape(key), count))
    shape = first(_SHAPES, lambda scope, key: _is_shape(scope.shape(key), count))
    return ParameterLayout(
        poses,
        place,
        shape,
        frames,
        frame,
        person,
        rate=first(RATES, _is_number),
        gender=of_item(GENDERS) or first(GENDERS, lambda scope, key: _is_gender(scope, key, count)),
        model=first(MODELS, _is_model),
        scale=first(_SCALES, _is_number),
    )


def _first_form(
    archive: Archive, keys: tuple[str, ...], joints: tuple[int, ...]
) -> tuple[str, Form] | None:
    for key in keys:
        form = form_of(archive, key, joints) if archive.has(key) else None
        if form is not None:
            return key, form
    return None


def _is_place(shape: tuple[int, ...], count: int) -> bool:
    return shape in ((count, 3), (count, 1, 3)) or (count == 1 and shape == (3,))


def _is_shape(shape: tuple[int, ...], count: int) -> bool:
    return (len(shape) == 1 and shape[0] > 0) or (len(shape) == 2 and shape[0] in (1, count))


def _is_number(scope: Archive, key: str) -> bool:
    return scope.shape(key) in ((), (1,))


def _is_model(scope: Archive, key: str) -> bool:
    return bool(model_in([scope.objects(key)]))


def _is_gender(scope: Archive, key: str, count: int) -> bool:
    """Return whether a value states one gender, or that of each row."""
    said = texts_in(scope.objects(key))
    is_each = len(said) == count and all(map(gender_of, said))
    return is_each or bool(gender_in(scope.objects(key))[0])


def _length(archive: Archive, key: str) -> int:
    """Return the number of items of a list or array with one axis; -1 for other values."""
    value = archive.get(key)
    if isinstance(value, list | tuple):
        return len(value)
    is_row = isinstance(value, Deferred) and len(value.shape) == 1
    return value.shape[0] if isinstance(value, Deferred) and is_row else -1


def with_facts(found: list[ParameterDict]) -> list[ParameterDict]:
    """Return dicts with the gender, model and rate that a dict beside them, as "meta", states."""
    on_path = {id(scope) for one in found for scope in (one.archive, *one.around)}
    described: dict[int, list[tuple[str, Archive]]] = {}

    def facts(scope: Archive) -> list[tuple[str, Archive]]:
        if id(scope) not in described:
            known = described[id(scope)] = []
            for key in () if scope.is_list else scope.keys:
                try:
                    inner = scope.inside(key)
                except FormatError:  # its values are not needed
                    continue
                if inner is not None and not inner.is_list and id(inner) not in on_path:
                    known.append((key, inner))
        return described[id(scope)]

    def first(
        one: ParameterDict, keys: Sequence[str], fits: Callable[[Archive, str], bool]
    ) -> StatedValue | None:
        for scope in reversed(one.around):
            for name, inner in facts(scope):
                for key in keys:
                    if inner.has(key) and fits(inner, key):
                        return StatedValue(inner, key, within=name)
        return None

    def completed(one: ParameterDict) -> ParameterDict:
        layout = one.layout
        rate = layout.rate or first(one, RATES, _is_number)

        def is_gender(scope: Archive, key: str) -> bool:
            return _is_gender(scope, key, layout.count)

        gender = layout.gender or first(one, GENDERS, is_gender)
        model = layout.model or first(one, MODELS, _is_model)
        return replace(one, layout=replace(layout, rate=rate, gender=gender, model=model))

    return [completed(one) for one in found]


def only_element(value: Value) -> Value:
    """Return the only element of an array, or of lists in lists; other values unchanged."""
    if isinstance(value, Deferred) and value.dtype.kind in "iufSU" and value.shape in ((), (1,)):
        value = value.values().reshape(-1)[0].item()
    if isinstance(value, list | tuple) and len(value) == 1:
        return only_element(value[0])
    return value


def _identity(value: Value) -> int | str | None:
    """Return the number or name of a person or frame; None for other values."""
    value = only_element(value)
    if isinstance(value, bytes):
        value = value.decode("utf-8", "replace")
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    if isinstance(value, str):
        number = person_number(value)
        return value if number is None else number
    if isinstance(value, bool) or not isinstance(value, int):
        return None
    return value if abs(value) < _LARGEST else None


def identities(value: StatedValue, count: int) -> list[int | str]:
    """Return the person of each row, or of all rows."""
    found = value.archive.get(value.key)
    if isinstance(found, Deferred) and len(found.shape) == 1:
        found = [np.asarray(item).item() for item in found.values()]
    items = list(found) if isinstance(found, list | tuple) else [found]
    chosen = items if value.item is None else items[value.item : value.item + 1]
    persons = [_identity(item) for item in chosen]
    if None in persons:
        odd = describe(chosen[persons.index(None)])
        raise value.archive.fault(
            "F002.video-identity: {item}: expected a number or a name for each person or "
            "frame, found {found}",
            item=value.key,
            found=odd,
        )
    known = [person for person in persons if person is not None]
    return known if len(known) == count else known[:1] * count
