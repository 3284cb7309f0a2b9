"""Wording of all diagnostics: codes and their messages, one table per area.

``template.py`` lists the specifications that braces may contain. A key is the code, a dot and a
name that is unique within the code. ``PHRASES`` are parts of messages, keyed by a name alone.
"""

from __future__ import annotations

from viewer.diagnostics.codes import Code
from viewer.diagnostics.wording import (
    archives,
    captures,
    export,
    figures,
    gltf,
    motions,
    reading,
    rigging,
    text_formats,
)

TABLES = (reading, text_formats, archives, captures, gltf, figures, motions, rigging, export)

CODES: dict[str, Code] = {
    code: row
    for table in (reading, figures, motions, gltf, rigging, export)
    for code, row in table.CODES.items()
}
"""By code, in the order of lists; a code is never reused with a different meaning."""

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
"""Plural noun for the elements of a part."""

FURTHER = "; first of {}"
"""Suffix of a message that reports several errors."""

NOTHING_ELSE = "; the rest of the file was not checked"
"""Suffix of a message about an error that stopped parsing."""
