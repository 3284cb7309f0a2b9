"""Distances by which a skinning option moves each vertex: method, influences, correctives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.rigs.arrays import Floats
from viewer.rigs.geometry.vectors import reflected
from viewer.rigs.retargeting.mirror import mirror_axis
from viewer.rigs.scalars._inputs import Asked, influences_kept
from viewer.rigs.skinning import PURE, Skinning, deform


def pruning(asked: Asked) -> Floats:
    """Return the distance between skinning with all and with few influences: (V,), figure units."""
    count = influences_kept(asked.skinning)
    # The reference has normalised weights, as the effect of normalising is a separate quantity.
    whole = replace(asked.skinning, max_influences=0, normalize=True)
    return _distance(asked, whole, replace(asked.skinning, max_influences=count))


def normalized(asked: Asked) -> Floats:
    """Return the distance between skinning with weights as stored and normalised: (V,)."""
    stored = replace(asked.skinning, normalize=False, max_influences=0)
    return _distance(asked, stored, replace(stored, normalize=True))


def methods(asked: Asked) -> Floats:
    """Return the largest distance of all other methods from the reference: (V,), figure units."""
    first, *others = (replace(asked.skinning, method=name) for name in PURE)
    return np.max([_distance(asked, first, other) for other in others], axis=0)


def correctives(asked: Asked) -> Floats:
    """Return the distance by which pose correctives move each vertex: (V,), figure units."""
    how = asked.skinning
    return _distance(asked, replace(how, correctives=True), replace(how, correctives=False))


def asymmetry(asked: Asked) -> Floats:
    """Return each vertex's distance from its counterpart's mirror image: (V,), figure units."""
    figure, pose = asked.figure, asked.pose
    assert figure.symmetry is not None and pose is not None  # required by the quantity
    positions = deform(figure, pose, asked.skinning)[0]
    # A translation of the whole figure does not affect its symmetry.
    positions -= pose.figure_translation
    images = reflected(positions[figure.symmetry], mirror_axis(figure))
    return np.linalg.norm(positions - images, axis=1)


def _distance(asked: Asked, one: Skinning, other: Skinning) -> Floats:
    a, b = (deform(asked.figure, asked.pose, how)[0] for how in (one, other))
    return np.linalg.norm(a - b, axis=1)
