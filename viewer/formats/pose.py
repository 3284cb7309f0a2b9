"""Reader and writer of single poses: ``.json``, ``.npz``, or plain numbers in a text file.

::

    .json  {"viewer_pose": 1, "figure": name, "dofs": {"left_knee.x": radians, …},
            "model": title, "gender": word, "shape": […], "expression": […],
            "translation": [x, y, z], "scale": s,
            "own_numbers": […], "joint_names": […], "joint_turns": [[x, y, z, w], …],
            "joint_rotations": [[x, y, z, w], …], "joint_shifts": [[x, y, z], …],
            "joint_scales": [[x, y, z], …], "up": "y", "dof_layout": word}
    .npz   the same arrays, with separate dof_names and dofs
    .txt   the model's own pose vector, separated by white space: 190 values for PIG, 72 for SMPL …

``joint_turns`` are rotations as quaternions in the figure's axes, for figures whose DOFs differ
from those that ``dof_layout`` identifies. Figures with the same DOFs use ``dofs``, edited or not,
and the transforms below them, ``joint_rotations``, ``joint_shifts`` and ``joint_scales``: joint
rotations and translations relative to the parents, and scales, written only if not at rest.

Both formats with named values may instead contain one frame of smplx's parameters:
``global_orient``, ``body_pose``, ``left_hand_pose``, ``right_hand_pose``, ``jaw_pose``,
``leye_pose``, ``reye_pose``, ``poses``, ``betas``, ``expression``, ``transl`` or ``trans``; in
addition ``use_pca`` and ``flat_hand_mean``.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, Phrase, note, wording
from viewer.errors import FormatError, RigError, UnsupportedFormatError
from viewer.formats._archive.checking import archive_of
from viewer.formats._archive.opening import is_archive
from viewer.formats._archive.values import describe
from viewer.formats._body_keys import GENDER_REMEDY, GENDERS, MODELS, RATES, gender_in, model_in
from viewer.formats._source import Source
from viewer.formats._text.json_places import (
    constant_place,
    decoded,
    unique,
    value_place,
)
from viewer.formats._text.numbers import LARGEST
from viewer.formats._text.words import read_numbers
from viewer.media.named_arrays import save_arrays
from viewer.media.saving import save_text
from viewer.near_names import did_you_mean, near_names, question
from viewer.phrases import axes, listed, optional, printable, quoted
from viewer.rigs.arrays import Deferred, Floats, deferred
from viewer.rigs.bodies.smpl_family import ShapeSpace
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.vectors import Up
from viewer.rigs.motion.clip import Clip
from viewer.rigs.posing.pose_record import PARTS, PosePartError, PoseRecord
from viewer.rigs.retargeting.pose_transfer import JointRotations

_VERSION = 1  # of the format, the value of "viewer_pose"

# Keys by what they hold; of several for one part of a pose, the first with a value is used.
_NAMES = {
    "shape": ("shape", "betas", "shapes"),
    "expression": ("expression", "expressions"),
    "translation": ("translation", "transl", "trans"),
}
_VECTORS = ("own_numbers", "poses", "pose", "fullpose")
_HANDS = ("left_hand_pose", "right_hand_pose", "hand_pose")
_PARTS = (*PARTS, "body_pose", *_HANDS)
_FLAGS = ("flat_hand_mean", "use_pca")
_ROTATION_KEYS = (
    "joint_turns",
    "joint_names",
    "joint_rotations",
    "joint_shifts",
    "joint_scales",
    "joint_meanings",
    "left",
    "up",
    "dof_layout",
    "figure",
)
"""Keys of joint rotations; all are ignored if the first is missing."""
_KNOWN = (
    *("viewer_pose", "dofs", "dof_names", "scale"),
    *(key for keys in _NAMES.values() for key in keys),
    *(*_PARTS, *_VECTORS, *_FLAGS),
)
_BESIDES = (
    "figure num_betas mocap_time_length dmpls marker_data marker_labels markers labels vids "
    "markers_latent latent_labels markers_latent_vids"
)
# Keys in pose and motion files that are not needed for a pose.
_NOT_NEEDED = (*GENDERS, *MODELS, *RATES, *_BESIDES.split())
# Keys whose J x 3 values are one pose rather than J frames.
_PER_JOINT = ("body_pose", *_HANDS, *_VECTORS)

_UPS: dict[str, Up] = {"y": "y", "z": "z"}  # axes that may be up
_SHORTEST = 1e-6  # minimum length of a quaternion; a shorter one defines no reliable rotation
_LONGEST_WORD = 200  # maximum number of characters of a text
_MOST_DIGITS = 18  # integers with more digits may not fit into 64 bits and are read as floats


def read(source: Source) -> PoseRecord:
    """Read one pose; a file with several is an error."""
    head = source.peek(4096)
    if head.startswith((b"PK", b"\x80")) or is_archive(head):
        return _from_values(_archive_values(source))
    if source.head(1) == b"{" or source.path.suffix.lower() == ".json":
        return _from_values(_parse_json(source))
    numbers = read_numbers(source)
    if len(numbers) == 0:
        raise source.fault(
            "F002.pose-empty: expected pose values, found {found}", found=source.looks_like()
        )
    end = len(source.data.rstrip())
    return PoseRecord(vector=numbers, line_of=lambda part, name: source.line(end))


def _archive_values(source: Source) -> _NamedValues:
    """Return the values needed for a pose; other keys, which may be large, are not read."""
    archive = archive_of(source)
    values: dict[str, Any] = dict.fromkeys(archive.keys)
    wanted = (*_KNOWN, *_ROTATION_KEYS) if _ROTATION_KEYS[0] in archive.keys else _KNOWN
    for key in set(wanted).intersection(archive.keys):
        value = archive.get(key)
        values[key] = value.values() if isinstance(value, Deferred) else value
    for key in {*GENDERS, *MODELS}.intersection(values):
        values[key] = archive.objects(key)
    names, dofs = values.pop("dof_names", None), values.get("dofs")
    if names is not None and dofs is not None:
        both = _NamedValues(source, {"dof_names": names, "dofs": dofs})
        labels = both.array("dof_names", "U", Phrase("names"))
        numbers = both.array("dofs", "iuf", Phrase("numbers"))
        if labels.ndim != 1 or labels.shape != numbers.shape:
            raise source.fault(
                "F002.pose-names: {item}: expected {expected} names to match dofs, found {found}",
                item="dof_names",
                expected=numbers.size,
                found=labels.size,
            )
        values["dofs"] = dict(zip(labels.tolist(), numbers.tolist(), strict=True))
    return _NamedValues(source, values)


def _from_values(named: _NamedValues) -> PoseRecord:
    values = named.values
    version = values.get("viewer_pose", _VERSION)
    version = version.tolist() if isinstance(version, np.ndarray) else version
    if version != _VERSION:
        raise named.fault(
            wording.POSE_ARRAY,
            "viewer_pose",
            item="viewer_pose",
            expected=_VERSION,
            found=describe(version),
        )
    # Key from which each part of the pose is read.
    keys = {part: _first(named, names) for part, names in _NAMES.items()}
    vector = _first(named, _VECTORS)
    translation = _numbers(named, keys["translation"])
    parts = {key: array for key in _PARTS if (array := _numbers(named, key)) is not None}
    record = PoseRecord(
        dofs=_dofs(named),
        vector=_numbers(named, vector),
        parts=parts,
        shape=_numbers(named, keys["shape"]),
        expression=_numbers(named, keys["expression"]),
        translation=translation,
        scale=_single(named, "scale"),
        flat_hands=_flag(named, "flat_hand_mean"),
        hand_coefficients=_flag(named, "use_pca"),
        joint_rotations=_read_rotations(named),
        shape_space=_shape_space(named),
        line_of=_line_of(named, {**keys, "vector": vector}),
    )
    if translation is not None and len(translation) != 3:
        raise named.fault(
            "F002.pose-three: {item}: expected 3 numbers, found {found}",
            keys["translation"],
            item="translation",
            found=len(translation),
        )
    _check_keys(named, record)
    return record


def _first(named: _NamedValues, keys: tuple[str, ...]) -> str:
    """Return the first key with a value; if there is none, the first key."""
    return next((key for key in keys if named.values.get(key) is not None), keys[0])


def _numbers(named: _NamedValues, key: str) -> Floats | None:
    """Return the numbers of a key as one row; several frames are refused."""
    if named.values.get(key) is None:
        return None
    array = named.numbers(key)
    is_per_joint = key in _PER_JOINT and array.shape[-1:] == (3,)
    frames = math.prod(array.shape[: -2 if is_per_joint else -1])
    if frames > 1:
        raise named.fault(
            "F002.pose-frames: {item}: expected a single pose, found {found} frames",
            key,
            item=key,
            found=frames,
        )
    return array.ravel()


def _single(named: _NamedValues, key: str) -> float | None:
    values = _numbers(named, key)
    if values is not None and len(values) != 1:
        raise named.fault(
            "F002.pose-single: {item}: expected a single number, found {found}",
            key,
            item=key,
            found=len(values),
        )
    return None if values is None else float(values[0])


def _flag(named: _NamedValues, key: str) -> bool | None:
    if named.values.get(key) is None:
        return None
    return bool(named.array(key, "bi", Phrase("true or false")).all())


def _dofs(named: _NamedValues) -> dict[str, float]:
    given = named.values.get("dofs")
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        raise named.fault(
            "F002.pose-dofs: dofs: expected an object mapping names to numbers, found {found}",
            "dofs",
            found=_described(given),
        )
    dofs: dict[str, float] = {}
    for name, value in given.items():
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        if not is_number or not abs(value) < 1e9:
            item = printable(name, 60)
            raise named.fault(
                "F002.pose-dof: dofs: {item}: expected a number, found {found}",
                "dofs",
                name,
                item=item,
                found=describe(value),
            )
        dofs[str(name)] = float(value)
    return dofs


def _shape_space(named: _NamedValues) -> ShapeSpace:
    values = named.values
    key = next((key for key in GENDERS if values.get(key) is not None), GENDERS[0])
    gender, odd = gender_in(values.get(key))
    if odd:
        named.warn(wording.MOTION_GENDER, key, found=odd, remedy=GENDER_REMEDY)
    said = [values[key] for key in MODELS if key in values]
    # This program writes the titles of all models, others those of the SMPL family.
    title = str(said[0]) if said and "viewer_pose" in values else ""
    return ShapeSpace(model_in(said) or title, gender)


def _line_of(named: _NamedValues, keys: Mapping[str, str]) -> Callable[[str, str], int | None]:
    """Return a function that finds the line of a part of a record, or of a named DOF."""

    def line(part: str, name: str) -> int | None:
        offset = named.offset(keys.get(part, part), *([name] if name else []))
        return None if offset is None else named.source.line(offset)

    return line


def _check_keys(named: _NamedValues, record: PoseRecord) -> None:
    """Refuse a file without a pose; warn about unknown keys."""
    arrays = (record.vector, record.shape, record.expression, record.translation)
    is_empty = not record.dofs and not record.parts and record.scale is None
    if is_empty and all(array is None for array in arrays):
        known = (*_KNOWN, *_NOT_NEEDED, *_ROTATION_KEYS)
        odd = next((key for key in named.values if key not in known), "")
        if not named.values:
            raise named.fault(
                "F002.pose-no-keys: expected a pose (dofs, poses, body_pose, betas …), found no "
                "keys"
            )
        where = [odd] if odd else []
        near = did_you_mean(odd, (*_KNOWN, *_ROTATION_KEYS))
        raise named.fault(
            "F002.pose-keys: expected a pose (dofs, poses, body_pose, betas …), found keys "
            "{keys}{near}",
            *where,
            keys=listed(list(named.values), 12),
            near=optional("; {}", near),
        )
    used = (
        (*_KNOWN, *_NOT_NEEDED)
        if record.joint_rotations is None
        else (*_KNOWN, *_NOT_NEEDED, *_ROTATION_KEYS)
    )
    unread = [key for key in named.values if key not in used]
    if unread:
        named.warn(
            "F007.pose-keys: ignored unknown keys: {keys}",
            unread[0],
            keys=listed([*map(_with_hint, unread)], 12),
        )


def _with_hint(key: str) -> Phrase | str:
    """Return a description of an unknown key, with the most similar known key."""
    near = [] if key in _ROTATION_KEYS else near_names(key, (*_KNOWN, *_ROTATION_KEYS))[:1]
    shown = printable(key, 40)
    return Phrase("{name} ({near})", name=shown, near=question(near)) if near else shown


def _read_rotations(named: _NamedValues) -> JointRotations | None:
    """Return the joint rotations in a pose file, or None."""
    values = named.values
    if values.get("joint_turns") is None:
        return None
    listed_names = named.array("joint_names", "U", Phrase("names"))
    if listed_names.ndim != 1:
        raise named.fault(
            "F002.pose-list: {item}: expected a one-dimensional list of names, found {found} "
            "dimensions",
            "joint_names",
            item="joint_names",
            found=listed_names.ndim,
        )
    names = tuple(listed_names.tolist())
    turns = _quaternions(named, "joint_turns", names)
    word = _word(named, "up", "y")
    up = _UPS.get(word)
    if up is None:
        raise named.fault(
            'F002.pose-up: up: expected "y" or "z", found {found}',
            "up",
            found=quoted(printable(word, 20)),
        )
    rotations = values.get("joint_rotations")
    shifts, scales = values.get("joint_shifts"), values.get("joint_scales")
    return JointRotations(
        _word(named, "figure", ""),
        names,
        turns / np.linalg.norm(turns, axis=1, keepdims=True),
        np.zeros((len(names), 3))
        if shifts is None
        else _rows(named, "joint_shifts", len(names), 3),
        up,
        _word(named, "dof_layout", ""),
        None if rotations is None else _quaternions(named, "joint_rotations", names),
        _meanings(named, len(names)),
        _left(named),
        None if scales is None else _rows(named, "joint_scales", len(names), 3),
    )


def _quaternions(named: _NamedValues, key: str, names: tuple[str, ...]) -> Floats:
    """Return a quaternion per joint, of any length but 0."""
    rows = _rows(named, key, len(names), 4)
    short = np.flatnonzero(np.linalg.norm(rows, axis=1) < _SHORTEST)
    if len(short):
        row = int(short[0])
        joint = printable(names[row], 60)
        raise named.fault(
            "F002.pose-quaternion: {item}: {joint}: expected a quaternion, found four zeros",
            key,
            row,
            item=key,
            joint=joint,
        )
    return rows


def _rows(named: _NamedValues, key: str, count: int, width: int) -> Floats:
    array = named.array(key, "iuf", Phrase("numbers"))
    if array.shape != (count, width):
        expected = Phrase("{shape} numbers", shape=axes((count, width)))
        shape = Phrase("{shape}", shape=axes(array.shape))
        found = shape if array.shape else Phrase("a single number")
        raise named.fault(wording.POSE_ARRAY, key, item=key, expected=expected, found=found)
    return named.numbers(key)


def _meanings(named: _NamedValues, count: int) -> tuple[str, ...]:
    """Return the meaning of each joint; an empty tuple if their number differs."""
    if named.values.get("joint_meanings") is None:
        return ()
    found = named.array("joint_meanings", "U", Phrase("names"))
    return tuple(found.tolist()) if found.shape == (count,) else ()


def _left(named: _NamedValues) -> Floats:
    """Return the direction of the figure's left, +x by default."""
    if named.values.get("left") is None:
        return np.array([1.0, 0.0, 0.0])
    found = _rows(named, "left", 1, 3)[0]
    length = np.linalg.norm(found)
    return found / length if length > _SHORTEST else np.array([1.0, 0.0, 0.0])


def _word(named: _NamedValues, key: str, default: str) -> str:
    value = named.values.get(key, default)
    word = value.item() if isinstance(value, np.ndarray) and value.ndim == 0 else value
    if not isinstance(word, str):
        raise named.fault(
            "F002.pose-word: {item}: expected a string, found {found}",
            key,
            item=key,
            found=describe(value),
        )
    return word[:_LONGEST_WORD]


@dataclass(frozen=True, slots=True, eq=False)
class _NamedValues:
    """Named values of a file."""

    source: Source
    """The file."""
    values: Mapping[str, Any]
    """Numbers, strings, lists and dicts, or arrays."""
    text: str | None = None
    """The JSON text; None for archives, which have no lines."""

    def offset(self, *path: str | int) -> int | None:
        """Return the offset of a value, or of what should contain it; None for archives."""
        if self.text is None:
            return None
        while (place := value_place(self.text, path)) is None:
            path = path[:-1]
        return _byte_offset(self.text, place)

    def fault(self, key: str, *path: str | int, **values: object) -> FormatError:
        """Return an error with the file, and the line of a value if the file has lines."""
        return self.source.fault(key, self.offset(*path), **values)

    def warn(self, key: str, *path: str | int, **values: Any) -> None:
        """Add a warning with the file, and the line of a value if the file has lines."""
        self.source.warn(key, self.offset(*path), **values)

    def array(self, key: str, kinds: str, expected: Phrase) -> NDArray[Any]:
        """Return an array, or lists as one, if numpy's letter of its kind is among ``kinds``."""
        value = self.values.get(key)
        try:
            array = np.asarray(value)
        except ValueError:  # the lists are ragged, or nested more deeply than an array can be
            array = np.zeros(0, dtype=object)
        if array.dtype.kind in kinds or (array.size == 0 and array.dtype.kind == "f"):
            return array
        path, odd = _odd_value(value, kinds)
        found = Phrase("ragged lists") if path is None else _described(odd)
        raise self.fault(
            wording.POSE_ARRAY, key, *(path or ()), item=key, expected=expected, found=found
        )

    def numbers(self, key: str) -> Floats:
        """Return an array of finite numbers; see ``array``."""
        array = self.array(key, "iuf", Phrase("numbers")).astype(np.float64)
        wrong = np.argwhere(~(np.abs(array) <= LARGEST))
        if len(wrong):
            place = wrong[0].tolist()
            found = float(array[tuple(place)])
            raise self.fault(
                "F003.pose-number: {item}: expected finite numbers, found {found:g}",
                key,
                *place,
                item=key,
                found=found,
            )
        return array


def _described(value: Any) -> Phrase:
    """Return a description of a value for messages: an array by its shape and type."""
    is_array = isinstance(value, np.ndarray)
    return describe(deferred(value) if is_array else value)


def _odd_value(value: object, kinds: str) -> tuple[tuple[int, ...] | None, object]:
    """Return indices and value of the first item of another kind; None for ragged lists."""
    if not isinstance(value, list | tuple):
        return (), value
    waiting: list[tuple[tuple[int, ...], object]] = [((), value)]
    while waiting:
        path, one = waiting.pop()
        if isinstance(one, list | tuple):
            waiting += [((*path, index), part) for index, part in reversed([*enumerate(one)])]
        elif not _is_of(one, kinds):
            return path, one
    return None, value


def _is_of(one: object, kinds: str) -> bool:
    """Return whether a single value is of one of the kinds, given by numpy's letters."""
    if kinds == "U":
        return isinstance(one, str)
    if kinds == "bi":
        return isinstance(one, int)
    return isinstance(one, int | float) and not isinstance(one, bool)


def _parse_json(source: Source) -> _NamedValues:
    """Return the object in a JSON file."""
    text = source.data.decode("utf-8", "surrogateescape")
    constants: list[str] = []  # Python accepts these words, but JSON does not

    def fault(key: str, offset: int | None, **values: object) -> FormatError:
        return source.fault(key, None if offset is None else _byte_offset(text, offset), **values)

    decoder = json.JSONDecoder(
        object_pairs_hook=unique, parse_int=_whole, parse_constant=constants.append
    )
    values = decoded(text, fault, decoder.decode)
    if constants:
        raise fault(
            "F002.json-constant: expected a finite number, found {found}",
            constant_place(text, constants[0]),
            found=constants[0],
        )
    named = _NamedValues(source, values if isinstance(values, dict) else {}, text)
    if not isinstance(values, dict):
        is_word = values is None or isinstance(values, bool)
        found = Phrase("{word}", word=json.dumps(values)) if is_word else describe(values)
        raise named.fault(
            "F002.pose-object: expected a pose (an object with named values), found {found}",
            found=found,
        )
    return named


def _whole(digits: str) -> int | float:
    # Python refuses to convert very long integers. Converted to infinite floats, they are reported
    # with a line.
    return int(digits) if len(digits) <= _MOST_DIGITS else float(digits)


def _byte_offset(text: str, place: int) -> int:
    return len(text[:place].encode("utf-8", "surrogateescape"))


def pose_error(path: Path, record: PoseRecord, problem: RigError) -> FormatError:
    """Return the error for a pose that does not match the figure, with its line if known."""
    line = None
    if isinstance(problem, PosePartError) and record.line_of is not None:
        line = record.line_of(problem.part, problem.name)
    found = problem.diagnostic
    if found is None:
        found = note("F002.pose-misfit: {problem}", problem=str(problem))
    return FormatError(replace(found, path=path, line=line))


def write(content: Figure | Clip | PoseRecord, path: str | Path) -> list[Diagnostic]:
    """Write one pose: ``.json``, ``.npz``, or ``.txt`` for only the model's own pose vector."""
    suffix = Path(path).suffix.lower()
    if not isinstance(content, PoseRecord):
        raise UnsupportedFormatError(f"{suffix} stores a pose, not a figure or clip")
    if suffix == ".json":
        save_text(path, pose_text(content))
    elif suffix == ".txt":
        if content.vector is None:
            raise UnsupportedFormatError("the pose has no raw pose vector to write as .txt")
        save_text(path, "".join(f"{number!r}\n" for number in content.vector.tolist()))
    else:
        named = _values_of(content)
        named.pop("dofs")
        arrays = {key: np.asarray(value) for key, value in named.items()}
        arrays["dof_names"] = np.array(list(content.dofs), dtype=np.str_)
        arrays["dofs"] = np.array(list(content.dofs.values()))
        save_arrays(path, arrays)
    return []


def pose_text(record: PoseRecord) -> str:
    """Return a pose as JSON, one DOF per line."""
    values = {"viewer_pose": _VERSION, **_values_of(record)}
    return json.dumps(values, indent=1, allow_nan=False, ensure_ascii=False) + "\n"


def _values_of(record: PoseRecord) -> dict[str, object]:
    named: dict[str, object] = {"dofs": dict(record.dofs)}
    space = record.shape_space
    named |= {key: text for key, text in (("model", space.model), ("gender", space.gender)) if text}
    for name, array in (
        ("shape", record.shape),
        ("expression", record.expression),
        ("translation", record.translation),
        ("own_numbers", record.vector),
    ):
        if array is not None:
            named[name] = array.tolist()
    named |= {key: np.asarray(array).tolist() for key, array in record.parts.items()}
    for name, single in (
        ("scale", record.scale),
        ("flat_hand_mean", record.flat_hands),
        ("use_pca", record.hand_coefficients),
    ):
        if single is not None:
            named[name] = single
    return (
        named if record.joint_rotations is None else named | named_rotations(record.joint_rotations)
    )


def named_rotations(rotations: JointRotations) -> dict[str, object]:
    """Return joint rotations by their keys in files; rest transforms are omitted."""
    named: dict[str, object] = {
        "figure": printable(rotations.figure, _LONGEST_WORD),
        "up": rotations.up,
        "dof_layout": rotations.layout,
        "joint_names": list(rotations.names),
        "joint_turns": rotations.relative.tolist(),
    }
    if rotations.rotations is not None:
        named["joint_rotations"] = rotations.rotations.tolist()
    if rotations.meanings:
        named["joint_meanings"] = list(rotations.meanings)
        named["left"] = rotations.left[None].tolist()
    if rotations.shifts.any():
        named["joint_shifts"] = rotations.shifts.tolist()
    if rotations.scales is not None:
        named["joint_scales"] = rotations.scales.tolist()
    return named
