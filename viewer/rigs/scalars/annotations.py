"""Quantities that a figure is annotated with: body parts, and fields such as distances."""

from __future__ import annotations

import numpy as np

from viewer.errors import RigError
from viewer.near_names import name_hint
from viewer.rigs.arrays import Floats
from viewer.rigs.scalars._inputs import Asked, field_of


def parts(asked: Asked) -> Floats:
    """Return the body part of each vertex: (V,), integral indices into the parts' names."""
    assert asked.figure.body_parts is not None  # required by the quantity
    return asked.figure.body_parts.of_vertex.astype(np.float64)


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
