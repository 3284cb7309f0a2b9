"""Quantities of precomputed fields, such as distances to another figure."""

from __future__ import annotations

from viewer.errors import RigError
from viewer.near_names import name_hint
from viewer.rig.arrays import Floats
from viewer.rig.scalars._asked import Asked, field_of

__all__ = ["class_", "field"]


def field(asked: Asked) -> Floats:
    """Return the values of a field: (V,), in the unit of the field."""
    return _values(asked, is_class=False)


def class_(asked: Asked) -> Floats:
    """Return the class of each vertex: (V,), integral indices into the field's names."""
    return _values(asked, is_class=True)


def _values(asked: Asked, is_class: bool) -> Floats:
    found = field_of(asked.figure, asked.about, is_class)
    if found is None:
        names = [one.name for one in asked.figure.fields if bool(one.names) == is_class]
        raise RigError(f'no field is called "{asked.about}"; {name_hint(asked.about, names)}')
    return found.values.copy()
