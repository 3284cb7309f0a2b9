"""Members of a glTF document that are not read, and contents of a document without a figure."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from typing import Any

from viewer.diagnostics import Phrase
from viewer.formats._gltf.extensions import KEPT_EXTENSIONS

__all__ = ["contents_of", "unkept_members"]

_EXTRAS, _EXTENSIONS = "extras", "extensions"
# Lists whose items have application data that is written back.
_KEPT = frozenset({"nodes", "meshes", "materials", "scenes", "animations"})
# Lists whose items lose their names: the writer makes new ones, or names cameras after their nodes.
_UNNAMED = frozenset({"textures", "samplers", "cameras"})
_DRAWN = {0: "points", 1: "lines", 2: "lines", 3: "lines"}
_READ = re.compile(r"POSITION|NORMAL|TANGENT|COLOR_0|(TEXCOORD|JOINTS|WEIGHTS)_\d+")


def unkept_members(root: dict[str, Any]) -> tuple[str, ...]:
    """Return the members that are not written back, each once, such as ``images.extras``.

    Parameters
    ----------
    root : dict
        The document, as parsed from JSON.

    >>> images = [{"extras": 1}, {"extras": 2}]
    >>> attributes = {"POSITION": 0, "_SPEED": 1}
    >>> meshes = [{"extras": 3, "primitives": [{"attributes": attributes}]}]
    >>> unkept_members({"images": images, "meshes": meshes, "extras": 4})
    ('images.extras', 'attributes._SPEED')
    """
    found: dict[str, None] = {}
    for kind, listed in root.items():
        if kind == _EXTENSIONS:
            found |= dict.fromkeys(_extensions(kind, listed))
        if kind == "asset":
            found |= dict.fromkeys(_members(kind, [listed], False))
        elif isinstance(listed, list):
            found |= dict.fromkeys(_names(kind, listed, root))
            found |= dict.fromkeys(_members(kind, listed, kind in _KEPT))
    return tuple(found)


def contents_of(root: dict[str, Any]) -> tuple[Phrase, ...]:
    """Return what a document holds, with numbers, as parts of a message."""
    counts: Counter[str] = Counter()
    for mesh in _objects(root.get("meshes")):
        for primitive in _objects(mesh.get("primitives")):
            counts[_DRAWN.get(primitive.get("mode", 4), "triangles")] += 1
    found = {f"gltf-{kind}": counts[kind] for kind in ("points", "lines", "triangles")}
    for kind in ("cameras", "nodes", "skins", "animations", "materials", "images"):
        found[f"gltf-{kind}"] = len(_objects(root.get(kind)))
    extensions = root.get(_EXTENSIONS)
    told = extensions.get("KHR_lights_punctual") if isinstance(extensions, dict) else None
    found["gltf-lights"] = len(_objects(told.get("lights"))) if isinstance(told, dict) else 0
    return tuple(Phrase(key, n=n) for key, n in found.items() if n)


def _objects(listed: Any) -> list[dict[str, Any]]:
    return [each for each in listed if isinstance(each, dict)] if isinstance(listed, list) else []


def _members(kind: str, listed: list[Any], keeps_extras: bool) -> Iterator[str]:
    """Yield the members of the objects in a list, and of the objects within these."""
    for item in listed:
        if not isinstance(item, dict):
            continue
        for name, value in item.items():
            if name == _EXTRAS:
                yield from () if keeps_extras else (f"{kind}.{name}",)
            elif name == _EXTENSIONS:
                yield from _extensions(kind, value)
            elif name == "attributes" and isinstance(value, dict):
                yield from (f"{name}.{each}" for each in value if not _READ.fullmatch(each))
            elif isinstance(value, list | dict):
                yield from _members(name, value if isinstance(value, list) else [value], False)


def _names(kind: str, listed: list[Any], root: dict[str, Any]) -> Iterator[str]:
    """Yield the name of a list whose items lose names."""
    named = {at: item["name"] for at, item in enumerate(_objects(listed)) if item.get("name")}
    if kind == "cameras":
        # The node's name comes first; without one, the camera keeps its own.
        nodes = [node for node in _objects(root.get("nodes")) if node.get("name")]
        lost = any(
            named.get(node.get("camera", -1), node["name"]) != node["name"] for node in nodes
        )
    else:
        lost = bool(named)
    if lost and kind in _UNNAMED:
        yield f"{kind}.name"


def _extensions(kind: str, told: Any) -> Iterator[str]:
    for name in told if isinstance(told, dict) else ():
        if name not in KEPT_EXTENSIONS:
            yield f"{kind}.{name}"
