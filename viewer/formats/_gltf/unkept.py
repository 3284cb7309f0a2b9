"""Members of a glTF document that are not read, and so are not written back."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from viewer.formats._gltf.extensions import KEPT_EXTENSIONS

__all__ = ["unkept_members"]

_EXTRAS, _EXTENSIONS = "extras", "extensions"
# Lists whose items have application data that is written back.
_KEPT = frozenset({"nodes", "meshes", "materials", "scenes", "animations"})
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
            found |= dict.fromkeys(_members(kind, listed, kind in _KEPT))
    return tuple(found)


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


def _extensions(kind: str, told: Any) -> Iterator[str]:
    for name in told if isinstance(told, dict) else ():
        if name not in KEPT_EXTENSIONS:
            yield f"{kind}.{name}"
