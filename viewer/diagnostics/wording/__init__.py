"""The wording of all diagnostics: codes and their messages, one table per area.

See ``template.py`` for what may stand in braces. A key is the code, a dot and a name; within a
code the name is unique. ``PHRASES`` are parts of messages, by a name alone.
"""

from __future__ import annotations

from viewer.diagnostics.codes import Code
from viewer.diagnostics.wording import (
    anim,
    archives,
    bindings,
    body_models,
    bvh,
    clips,
    easymocap,
    joints,
    kinds,
    loading,
    meshes,
    morph,
    motion,
    obj,
    pictures,
    ply,
    poses,
    reading,
    rig,
    rigging,
    skeletons,
    skin,
    weights,
)

TABLES = (
    *(reading, kinds, skin, obj, ply, morph, rig, joints, bvh, anim, weights),
    *(archives, body_models, easymocap, poses, pictures),
    *(bindings, skeletons, meshes, clips, motion, loading, rigging),
)
_CODED = (reading, weights, bindings, skeletons, meshes, clips, rigging)

CODES: dict[str, Code] = {
    code: row for table in _CODED for code, row in sorted(table.CODES.items())
}
"""By code; a code is never given to another fault."""

MESSAGES: dict[str, str] = {
    key: template for table in TABLES for key, template in table.MESSAGES.items()
}
"""Templates by key."""

PHRASES: dict[str, str] = {
    key: template for table in TABLES for key, template in table.PHRASES.items()
}
"""Templates of parts of messages, by name."""

PLACES = {
    "positions": "vertices",
    "weights": "vertices",
    "triangles": "triangles",
    "bindings": "joints",
    "joints": "joints",
    "items": "joints",
    "frames": "frames",
}
"""What the places of a part are called."""

FURTHER = ", the first of {}"
"""Ends a message that stands for several faults."""

NOTHING_ELSE = "; nothing else in this file was checked"
"""Ends a message of a fault that ended the reading."""
