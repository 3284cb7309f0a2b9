"""Fields of a figure by name."""

from __future__ import annotations

from typing import TYPE_CHECKING

from viewer.rig.figure import Figure

if TYPE_CHECKING:
    from viewer.rig.annotations import VertexField


def field_of(figure: Figure, name: str, is_class: bool) -> VertexField | None:
    """Return a figure's field or class by its case-insensitive name; if empty, the first one."""
    suited = [field for field in figure.fields if bool(field.names) == is_class]
    named = [field for field in suited if not name or field.name.lower() == name.lower()]
    return named[0] if named else None
