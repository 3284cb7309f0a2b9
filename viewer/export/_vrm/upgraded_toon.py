"""Materials of VRM 0.x, ``materialProperties``, as extensions of materials of VRM 1.0."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from viewer.formats._vrm.json_parts import part
from viewer.formats._vrm.old_toon import modern_toon

__all__ = ["upgraded_toon"]

_TOON, _UNLIT = "VRMC_materials_mtoon", "KHR_materials_unlit"
_BLENDS, _WRITES_DEPTH = (2, 3), 3  # _BlendMode
_MOST_OFFSET = 9


def upgraded_toon(
    properties: list[Any], known: Mapping[int, Any], lost: list[str]
) -> dict[int, Any]:
    """Return the extensions of each material, by index.

    ``properties``: ``materialProperties``, parallel to the materials.
    ``known``: extensions that the materials already have.
    ``lost``: extended by the properties without a counterpart.
    """
    found: dict[int, Any] = {index: dict(each) for index, each in known.items()}
    offsets = _offsets(properties)
    for index, each in enumerate(properties):
        shader = part(each, "shader")
        if shader == "VRM/MToon":
            toon, omitted = modern_toon(each)
            found[index] = {_TOON: {**toon, "renderQueueOffsetNumber": offsets.get(index, 0)}}
            lost += omitted
        elif isinstance(shader, str) and shader.startswith("VRM/Unlit"):
            found[index] = {_UNLIT: {}}
    return found


def _offsets(properties: list[Any]) -> dict[int, int]:
    """Return the order of transparent materials: 0 is last, or first if they write depth."""
    queues: dict[bool, dict[int, int]] = {False: {}, True: {}}
    for index, each in enumerate(properties):
        mode, queue = part(each, "floatProperties", "_BlendMode"), part(each, "renderQueue")
        if mode in _BLENDS and isinstance(queue, int):
            queues[mode == _WRITES_DEPTH][index] = queue
    found = {}
    for writes, own in queues.items():
        order = sorted(set(own.values()))
        for index, queue in own.items():
            place = order.index(queue) if writes else order.index(queue) - len(order) + 1
            found[index] = min(max(place, -_MOST_OFFSET), _MOST_OFFSET)
    return found
