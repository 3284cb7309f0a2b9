"""The wording of all diagnostics: one template per message, one table per area.

See ``template.py`` for what may stand in braces. A key is the code, a dot and a name; within a
code the name is unique. ``PHRASES`` are parts of messages, by a name alone.
"""

from __future__ import annotations

from viewer.diagnostics.wording import (
    bindings,
    clips,
    loading,
    meshes,
    motion,
    obj,
    reading,
    rigging,
    skeletons,
    skin,
    weights,
)

_TABLES = (
    reading,
    skin,
    obj,
    weights,
    bindings,
    skeletons,
    meshes,
    clips,
    motion,
    loading,
    rigging,
)

MESSAGES: dict[str, str] = {
    key: template for table in _TABLES for key, template in table.MESSAGES.items()
}
"""Templates by key."""

PHRASES: dict[str, str] = {
    key: template for table in _TABLES for key, template in table.PHRASES.items()
}
"""Templates of parts of messages, by name."""

PLACES = {
    "positions": "vertices",
    "weights": "vertices",
    "triangles": "triangles",
    "bindings": "joints",
    "joints": "joints",
    "frames": "frames",
}
"""What the places of a part are called."""

FURTHER = ", the first of {}"
"""Ends a message that stands for several faults."""

NOTHING_ELSE = "; nothing else in this file was checked"
"""Ends a message of a fault that ended the reading."""
