"""Read and write single poses: ``.json``, ``.npz``, or plain numbers in a text file.

::

    .json  {"viewer_pose": 1, "figure": name, "dofs": {"left_knee.x": radians, …},
            "shape": […], "expression": […], "translation": [x, y, z], "scale": s,
            "own_numbers": […], "joint_names": […], "joint_turns": [[x, y, z, w], …],
            "joint_rotations": [[x, y, z, w], …], "joint_shifts": [[x, y, z], …], "up": "y",
            "dof_layout": word}
    .npz   the same arrays, dof_names and dofs apart
    .txt   the model's own numbers, separated by blanks: 190 for PIG, 72 for SMPL …

The turns of the joints, quaternions in the figure's axes, are for figures with other DOFs, which
``dof_layout`` tells. Those with the same take ``dofs``, edited or not, and what lies beneath them:
rotations and shifts of joints within their parents, written only where they are not at rest.

Both kinds of named values may instead hold one frame of what smplx takes: ``global_orient``,
``body_pose``, ``left_hand_pose``, ``right_hand_pose``, ``jaw_pose``, ``leye_pose``, ``reye_pose``,
``poses``, ``betas``, ``expression``, ``transl`` or ``trans``; beside them ``use_pca`` and
``flat_hand_mean``.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.errors import UnsupportedFormatError, printable
from viewer.formats._archive import describe
from viewer.formats._container import archive_of
from viewer.formats._numbers import LARGEST
from viewer.formats._pose_turns import KEYS, named_turns, read_turns
from viewer.formats._save import save_arrays, save_text
from viewer.formats._source import Source
from viewer.formats._table import read_numbers
from viewer.rig.arrays import Deferred, Floats
from viewer.rig.clip import Clip
from viewer.rig.figure import Figure
from viewer.rig.pose_record import PARTS, PoseRecord

__all__ = ["parse_json", "pose_text", "read", "write"]

_HANDS = ("left_hand_pose", "right_hand_pose", "hand_pose")
_VECTORS = ("own_numbers", "poses", "pose", "fullpose")
_NAMES = {
    "shape": ("shape", "betas", "shapes"),
    "expression": ("expression", "expressions"),
    "translation": ("translation", "transl", "trans"),
}
_ALIASES = (key for keys in _NAMES.values() for key in keys)
_PARTS = (*PARTS, "body_pose", *_HANDS)
_FLAGS = ("flat_hand_mean", "use_pca")
_KNOWN = ("viewer_pose", "dofs", "dof_names", "scale", *_ALIASES, *_PARTS, *_VECTORS, *_FLAGS)
_BESIDES = (
    "figure gender model model_type surface_model_type num_betas fps mocap_framerate "
    "mocap_frame_rate mocap_time_length dmpls marker_data marker_labels markers labels vids "
    "markers_latent latent_labels markers_latent_vids"
)
_NOT_NEEDED = _BESIDES.split()  # what files of poses and motions have, and posing does not need
_PER_JOINT = ("body_pose", *_HANDS, *_VECTORS)  # J x 3 numbers are one pose, not J frames
_VERSION = 1


def read(source: Source) -> PoseRecord:
    """Read one pose.

    Parameters
    ----------
    source : Source
        The file; keys that mean nothing here are added to its warnings.

    Returns
    -------
    PoseRecord
        To be applied to a figure.

    Raises
    ------
    FormatError
        If a value is no number, or there are several poses in it.
    """
    if source.peek(2).startswith((b"PK", b"\x80")) or source.archive is not None:
        return _from_values(source, _archive_values(source))
    if source.head(1) == b"{" or source.path.suffix.lower() == ".json":
        return _from_values(source, parse_json(source))
    numbers = read_numbers(source)
    if len(numbers) == 0:
        raise source.error(f"expected the numbers of a pose, found {source.looks_like()}")
    return PoseRecord(vector=numbers)


def parse_json(source: Source) -> dict[str, Any]:
    """Return the object in a JSON file; numbers like NaN are refused.

    Raises
    ------
    FormatError
        With the line of what is no JSON.
    """

    def refuse(word: str) -> None:
        raise ValueError(f"expected a finite number, found {word}")

    try:
        text = source.data.decode("utf-8", "surrogateescape")
        values = json.loads(text, parse_constant=refuse)
    except json.JSONDecodeError as problem:
        offset = len(problem.doc[: problem.pos].encode("utf-8", "surrogateescape"))
        what = printable(problem.msg, 100)
        raise source.error(f"expected JSON, found a mistake: {what}", offset) from None
    except (ValueError, RecursionError) as problem:
        is_deep = isinstance(problem, RecursionError)
        reason = "expected JSON, found too deep a nesting" if is_deep else printable(problem)
        raise source.error(reason) from None
    if not isinstance(values, dict):
        raise source.error(f"expected an object with names, found a {type(values).__name__}")
    return values


def _archive_values(source: Source) -> dict[str, Any]:
    """Return what a pose needs; the other keys, which may be large, stay unread."""
    archive = archive_of(source)
    values: dict[str, Any] = dict.fromkeys(archive.keys)
    wanted = (*_KNOWN, *KEYS) if KEYS[0] in archive.keys else _KNOWN
    for key in set(wanted).intersection(archive.keys):
        value = archive.get(key)
        values[key] = value.values() if isinstance(value, Deferred) else value
    names, dofs = values.pop("dof_names", None), values.get("dofs")
    if names is not None and dofs is not None:
        labels = _checked(source, "dof_names", names, "U", "names")
        numbers = _checked(source, "dofs", dofs, "iuf", "numbers")
        if labels.ndim != 1 or labels.shape != numbers.shape:
            raise source.error(
                f"dof_names: expected {numbers.size} names as in dofs, found {labels.size}"
            )
        values["dofs"] = dict(zip(labels.tolist(), numbers.tolist(), strict=True))
    return values


def _from_values(source: Source, values: Mapping[str, Any]) -> PoseRecord:
    version = values.get("viewer_pose", _VERSION)
    version = version.tolist() if isinstance(version, np.ndarray) else version
    if version != _VERSION:
        raise source.error(f"viewer_pose: expected {_VERSION}, found {describe(version)}")
    found: dict[str, Floats | None] = {
        name: _first(source, values, keys) for name, keys in _NAMES.items()
    }
    parts = {key: array for key in _PARTS if (array := _array(source, values, key)) is not None}
    scale = _array(source, values, "scale")
    record = PoseRecord(
        dofs=_dofs(source, values.get("dofs")),
        vector=_first(source, values, _VECTORS),
        parts=parts,
        shape=found["shape"],
        expression=found["expression"],
        translation=found["translation"],
        scale=None if scale is None else _single(source, "scale", scale),
        flat_hands=_flag(source, values, "flat_hand_mean"),
        hand_coefficients=_flag(source, values, "use_pca"),
        turns=read_turns(source, values),
    )
    is_empty = not record.dofs and not record.parts and record.vector is None
    if is_empty and all(value is None for value in (*found.values(), scale)):
        keys = ", ".join(printable(key, 40) for key in list(values)[:12]) or "none"
        raise source.error(f"expected a pose (dofs, poses, body_pose, betas …), found keys {keys}")
    if record.translation is not None and len(record.translation) != 3:
        raise source.error(f"translation: expected 3 numbers, found {len(record.translation)}")
    used = (*_KNOWN, *_NOT_NEEDED) if record.turns is None else (*_KNOWN, *_NOT_NEEDED, *KEYS)
    odd = [printable(key, 40) for key in values if key not in used]
    if odd:
        source.warn(f"keys that mean nothing in a pose: {', '.join(odd[:12])}")
    return record


def _flag(source: Source, values: Mapping[str, Any], key: str) -> bool | None:
    if values.get(key) is None:
        return None
    return bool(_checked(source, key, values[key], "bi", "true or false").all())


def _single(source: Source, key: str, values: Floats) -> float:
    if len(values) != 1:
        raise source.error(f"{key}: expected one number, found {len(values)}")
    return float(values[0])


def _first(source: Source, values: Mapping[str, Any], keys: tuple[str, ...]) -> Floats | None:
    arrays = (_array(source, values, key) for key in keys)
    return next((array for array in arrays if array is not None), None)


def _array(source: Source, values: Mapping[str, Any], key: str) -> Floats | None:
    """Return the numbers of a key in one row; several frames are refused."""
    if values.get(key) is None:
        return None
    array = _checked(source, key, values[key], "iuf", "numbers").astype(np.float64)
    wrong = array[~(np.abs(array) <= LARGEST)]
    if len(wrong):
        raise source.error(f"{key}: expected finite numbers, found {wrong[0]:g}")
    is_per_joint = key in _PER_JOINT and array.shape[-1:] == (3,)
    frames = math.prod(array.shape[: -2 if is_per_joint else -1])
    if frames > 1:
        raise source.error(f"{key}: expected one pose, found {frames} frames")
    return array.ravel()


def _checked(source: Source, key: str, value: Any, kinds: str, what: str) -> NDArray[Any]:
    """Return an array of some kinds of values, written as an array or as lists."""
    try:
        array = np.asarray(value)
    except ValueError:  # lists of different lengths, or more deeply nested than arrays can be
        array = np.zeros(0, dtype=object)
    if array.dtype.kind in kinds or (array.size == 0 and array.dtype.kind == "f"):
        return array
    found = "a list of other things" if isinstance(value, list | tuple) else _described(value)
    raise source.error(f"{key}: expected {what}, found {found}")


def _described(value: Any) -> str:
    is_array = isinstance(value, np.ndarray)
    return describe(Deferred(value.shape, value.dtype, lambda: value) if is_array else value)


def _dofs(source: Source, given: Any) -> dict[str, float]:
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        raise source.error(f"dofs: expected names with numbers, found {_described(given)}")
    dofs: dict[str, float] = {}
    for name, value in given.items():
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        if not is_number or not abs(value) < 1e9:
            raise source.error(
                f"dofs: {printable(name, 60)}: expected a number, found {describe(value)}"
            )
        dofs[str(name)] = float(value)
    return dofs


def pose_text(record: PoseRecord) -> str:
    """Return a pose as JSON, one DOF a line."""
    values = {"viewer_pose": _VERSION, **_named(record)}
    return json.dumps(values, indent=1, allow_nan=False, ensure_ascii=False) + "\n"


def _named(record: PoseRecord) -> dict[str, Any]:
    named: dict[str, Any] = {"dofs": dict(record.dofs)}
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
    return named if record.turns is None else named | named_turns(record.turns)


def write(content: Figure | Clip | PoseRecord, path: str | Path) -> None:
    """Write one pose, as the suffix asks.

    Parameters
    ----------
    content : PoseRecord
        What to write; anything else is refused.
    path : str or Path
        ``.json``, ``.npz``, or ``.txt`` for the model's own numbers alone.

    Raises
    ------
    UnsupportedFormatError
        If it is no pose.
    OutputError
        If the file cannot be written.
    """
    suffix = Path(path).suffix.lower()
    if not isinstance(content, PoseRecord):
        raise UnsupportedFormatError(f"{suffix} holds a pose, not a figure or clip")
    if suffix == ".json":
        save_text(path, pose_text(content))
    elif suffix == ".txt":
        if content.vector is None:
            raise UnsupportedFormatError("the pose has no numbers of its own to write as .txt")
        save_text(path, "".join(f"{number!r}\n" for number in content.vector.tolist()))
    else:
        named = _named(content)
        dofs = named.pop("dofs")
        arrays = {key: np.asarray(value) for key, value in named.items()}
        arrays["dof_names"] = np.array(list(dofs), dtype=np.str_)
        arrays["dofs"] = np.array(list(dofs.values()))
        save_arrays(path, arrays)
