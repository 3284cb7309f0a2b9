"""Keys of the samplers of an animation: times, values and tangents."""

from __future__ import annotations

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import FormatError
from viewer.formats._gltf.document import Document
from viewer.formats._gltf.elements import Element
from viewer.rig.arrays import Floats
from viewer.rig.motion.transform_clip import Interpolation, TransformPath

__all__ = ["Keys", "read_keys", "read_times"]

_INTERPOLATIONS: dict[str, Interpolation] = {
    "LINEAR": "linear",
    "STEP": "step",
    "CUBICSPLINE": "cubic",
}
_KINDS = {"translation": "VEC3", "rotation": "VEC4", "scale": "VEC3", "weights": "SCALAR"}
_WIDTHS = {"translation": 3, "rotation": 4, "scale": 3}
_TINY = 1e-12  # minimum length of a quaternion with a direction


@dataclass(frozen=True, slots=True, eq=False)
class Keys:
    """Keys as in ``NodeChannel``."""

    times: Floats
    values: Floats
    interpolation: Interpolation
    tangents: Floats | None


def read_times(document: Document, sampler: Element) -> Floats:
    """Return the times of a sampler's keys: (N,) seconds, in ascending order, N > 0.

    Raises
    ------
    FormatError
        If the times are missing, malformed, not finite or not in ascending order.
    """
    accessor = sampler.required_index("input", len(document.accessors), "accessors")
    times = document.accessors.floats(accessor, ("SCALAR",), sampler.at("input"))[:, 0]
    if not len(times):
        raise sampler.fault("F002.gltf-no-keys", "input")
    if not np.isfinite(times).all():
        key = int((~np.isfinite(times)).argmax())
        raise sampler.fault("F003.gltf-keys", "input", index=key, found=float(times[key]))
    is_earlier = times[1:] < times[:-1]
    if is_earlier.any():
        key = int(is_earlier.argmax()) + 1
        found, before = float(times[key]), float(times[key - 1])
        raise sampler.fault("F002.gltf-times", "input", index=key, found=found, before=before)
    return times


def read_keys(
    document: Document, sampler: Element, times: Floats, path: TransformPath, n_shapes: int
) -> Keys:
    """Return the keys of a sampler.

    Parameters
    ----------
    document : Document
        The document.
    sampler : Element
        A sampler.
    times : (N,)
        Times of the keys; of several keys at one time, only the last is used.
    path : str
        Property that the sampler animates.
    n_shapes : int
        Number of weights per key.

    Raises
    ------
    FormatError
        If the values are malformed, not finite, of the wrong number, or not rotations.
    """
    names = tuple(_INTERPOLATIONS)
    interpolation = _INTERPOLATIONS[sampler.choice("interpolation", names, "LINEAR")]
    accessor = sampler.required_index("output", len(document.accessors), "accessors")
    rows = document.accessors.floats(accessor, (_KINDS[path],), sampler.at("output"))
    width = _WIDTHS.get(path, n_shapes)
    per_key = 3 if interpolation == "cubic" else 1
    expected = len(times) * per_key * width
    if rows.size != expected:
        # The count is in elements of the accessor: vectors, or single weights.
        raise _wrong_count(sampler, expected // rows.shape[1], len(rows), len(times))
    keys = rows.reshape(len(times), per_key, width)
    _check_finite(sampler, keys)
    if path == "rotation":
        keys = _rotations(sampler, keys, _is_whole(document, accessor))
    # Each key has an in-tangent, value and out-tangent; tangents are slopes per second (3.11.3.3).
    tangents = keys[:, (0, 2)] if per_key == 3 else None
    return _without_equal(Keys(times, keys[:, per_key // 2], interpolation, tangents))


def _without_equal(keys: Keys) -> Keys:
    """Return the last of several keys at one time, because exporters repeat the final key."""
    is_last = keys.times[1:] > keys.times[:-1]
    if is_last.all():
        return keys
    is_kept = np.append(is_last, True)
    tangents = None if keys.tangents is None else keys.tangents[is_kept]
    return Keys(keys.times[is_kept], keys.values[is_kept], keys.interpolation, tangents)


def _wrong_count(sampler: Element, expected: int, found: int, keys: int) -> FormatError:
    return sampler.fault("F002.gltf-outputs", "output", expected=expected, found=found, keys=keys)


def _check_finite(sampler: Element, keys: Floats) -> None:
    bad = ~np.isfinite(keys)
    if bad.any():
        key, place, column = (int(axis[0]) for axis in np.nonzero(bad))
        found = float(keys[key, place, column])
        raise sampler.fault("F003.gltf-keys", "output", index=key, found=found)


def _is_whole(document: Document, accessor: int) -> bool:
    return document.accessors[accessor].values.get("componentType") != 5126


def _rotations(sampler: Element, keys: Floats, is_whole: bool) -> Floats:
    """Return quaternions of unit length; splines with floating-point keys are left unchanged."""
    middle = keys.shape[1] // 2
    lengths = np.linalg.norm(keys[:, middle], axis=1)
    if (lengths < _TINY).any():
        raise sampler.fault("F002.gltf-rotation", "output", index=int((lengths < _TINY).argmax()))
    return keys if middle and not is_whole else keys / lengths[:, None, None]
