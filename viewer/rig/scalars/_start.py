"""Initial joint or field of a scalar quantity: one that is not 0 everywhere."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from viewer.rig.arrays import Floats
from viewer.rig.figure import Figure
from viewer.rig.scalars._joints import joint_text


def joint_influences(figure: Figure) -> Floats:
    """Return the sum of the absolute weights of each joint: (J,)."""
    skin = figure.skin
    if skin is None:
        return np.zeros(0)
    sums = np.bincount(skin.joints, np.abs(skin.weights), skin.n_joints)
    return sums.astype(np.float64, copy=False)


def most_influential(figure: Figure) -> int:
    """Return the joint with the largest sum of weights, or -1 if no joint has influence."""
    sums = joint_influences(figure)
    return int(sums.argmax()) if sums.any() else -1


def informative_field(figure: Figure) -> str:
    """Return the name of the first numeric field that is not 0 everywhere, or an empty string."""
    fields = [field for field in figure.fields if not field.names]
    return next((field.name for field in fields if field.values.any()), "")


def informative_quantity(key: str, figures: Iterable[Figure]) -> str:
    """Return the name of a quantity with the first joint or field that is not 0 everywhere.

    For quantities without a joint or field, the key is already the name.
    """
    for figure in figures:
        if key == "weight" and (joint := most_influential(figure)) >= 0:
            return f"weight:{joint_text(figure, joint)}"
        if key == "field" and (field := informative_field(figure)):
            return f"field:{field}"
    return key
