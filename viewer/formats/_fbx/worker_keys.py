"""Keys of one animation stack of a scene of ufbx, baked at the file's frame rate."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.formats._fbx.worker_contents import KeptScene

__all__ = ["keys_of"]

_PERCENT = "DeformPercent"  # animated property of a blend channel


def keys_of(kept: KeptScene, stack: int) -> list[dict[str, Any]]:
    """Return a list of channels: node or element, path, and the name of the arrays.

    ufbx evaluates curves, pivots and layers at the file's frame rate and at their keys, and returns
    keys for linear interpolation, or slerp for rotations.
    """
    stacks = kept.items(kept.scene, "anim_stacks")
    animation = kept.get(stacks[stack], "anim")
    rate = float(kept.get(kept.scene, "settings").frames_per_second)
    baked = kept.keep(
        kept.ufbx.bake_anim(
            kept.scene,
            animation,
            resample_rate=rate,
            minimum_sample_rate=rate,
            maximum_sample_rate=max(rate, 240.0),
            step_handling=kept.ufbx.BakeStepHandling.ADJACENT_DOUBLE,
            max_keyframe_segments=1024,
        )
    )
    told: list[dict[str, Any]] = []
    for node in kept.items(baked, "nodes"):
        for path in ("translation", "rotation", "scale"):
            keys = kept.get(node, f"{path}_keys")
            only = 1 if kept.get(node, f"constant_{path}") else len(keys)
            _add(kept, told, {"node": int(node.typed_id), "path": path}, keys, only)
    for element in kept.items(baked, "elements"):
        for prop in kept.items(element, "props"):
            if str(kept.get(prop, "name")) == _PERCENT:
                keys = kept.get(prop, "keys")
                only = 1 if kept.get(prop, "constant_value") else len(keys)
                _add(kept, told, {"element": int(element.element_id), "path": "weight"}, keys, only)
    return told


def _add(
    kept: KeptScene, told: list[dict[str, Any]], channel: dict[str, Any], keys: Any, only: int
) -> None:
    """Add a channel and its first ``only`` keys."""
    if not only:
        return
    name = f"keys{len(told)}"
    rows = [(key.time, *key.value) for key in (keys[index] for index in range(only))]
    values: NDArray[np.float64] = np.array(rows, dtype=np.float64)
    kept.arrays[name] = values
    told.append({**channel, "keys": name})
