"""Evaluation of the animations of a glTF file written by this program.

The evaluation follows glTF 2.0, section 3.11 and appendix C, in double precision, and shares no
code with other parts of the program.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from viewer.export._gltf.reading import GltfFile, Keys
from viewer.rig.arrays import Floats

_PARALLEL = 1.0 - 1e-9  # rotations with a larger cosine are interpolated linearly


def key_times(animation: dict[str, Any], file: GltfFile) -> Floats:
    """Return all key times of an animation, increasing: (T,)."""
    inputs = {sampler["input"] for sampler in animation["samplers"]}
    return np.unique(np.concatenate([file.floats(index)[:, 0] for index in sorted(inputs)]))


def keys_at(file: GltfFile, animation: dict[str, Any], times: Floats) -> Keys:
    """Return the animated values at times (T,), by node and path: (T, C) each."""
    found: Keys = {}
    for channel in animation["channels"]:
        sampler, target = animation["samplers"][channel["sampler"]], channel["target"]
        inputs = file.floats(sampler["input"])[:, 0]
        kind = sampler.get("interpolation", "LINEAR")
        count = len(inputs) * (3 if kind == "CUBICSPLINE" else 1)
        values = file.floats(sampler["output"]).reshape(count, -1)
        is_rotation = target["path"] == "rotation"
        found[target["node"], target["path"]] = _values(inputs, values, kind, is_rotation, times)
    return found


def _values(inputs: Floats, values: Floats, kind: str, is_rotation: bool, times: Floats) -> Floats:
    before = np.clip(np.searchsorted(inputs, times, side="right") - 1, 0, len(inputs) - 1)
    after = np.minimum(before + 1, len(inputs) - 1)
    spans = inputs[after] - inputs[before]
    passed = np.clip(times - inputs[before], 0.0, spans)
    u = np.divide(passed, spans, out=np.zeros_like(passed), where=spans > 0.0)[:, None]
    if kind == "STEP":
        return values[before]
    if kind == "CUBICSPLINE":
        rows = values.reshape(len(inputs), 3, -1)
        h = spans[:, None]
        found = (
            (2 * u**3 - 3 * u**2 + 1) * rows[before, 1]
            + h * (u**3 - 2 * u**2 + u) * rows[before, 2]
            + (3 * u**2 - 2 * u**3) * rows[after, 1]
            + h * (u**3 - u**2) * rows[after, 0]
        )
        return np.asarray(found)
    if is_rotation:
        return _slerp(values[before], values[after], u)
    return np.asarray(values[before] + u * (values[after] - values[before]))


def _slerp(first: Floats, second: Floats, u: Floats) -> Floats:
    """Return sin((1 - u) a) / sin a q0 + sin(u a) / sin a q1 along the shorter arc."""
    first = first / np.linalg.norm(first, axis=1, keepdims=True)
    second = second / np.linalg.norm(second, axis=1, keepdims=True)
    cosines = np.einsum("ta,ta->t", first, second)[:, None]
    second = np.where(cosines < 0.0, -second, second)
    cosines = np.abs(cosines)
    near = cosines > _PARALLEL
    angles = np.arccos(np.where(near, 0.0, cosines))
    sines = np.sin(angles)
    one = np.where(near, 1.0 - u, np.sin((1.0 - u) * angles) / sines)
    other = np.where(near, u, np.sin(u * angles) / sines)
    return np.asarray(one * first + other * second)
