"""Phenotypes of Anny: age, gender, height and others, as blends of MakeHuman's targets.

Brégier et al., Human Mesh Modeling for Anny Body. A target belongs to one variation of several
phenotypes (``female``, ``young``, ``maxmuscle`` ...). A value between two anchors of a phenotype
assigns weights to two variations; a target's coefficient is the product of the weights of its
variations::

    c_t = prod_{v in t} w_v        w_v: piecewise linear in the phenotype, sums to 1

The values of the origins are normalised to a sum of 1.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from viewer.rig.arrays import Bools, Floats

__all__ = ["PHENOTYPES", "TYPICAL", "VARIATIONS", "phenotype_range", "target_masks", "weights_of"]

VARIATIONS = {
    "gender": ("male", "female"),
    "age": ("newborn", "baby", "child", "young", "old"),
    "muscle": ("minmuscle", "averagemuscle", "maxmuscle"),
    "weight": ("minweight", "averageweight", "maxweight"),
    "height": ("minheight", "maxheight"),
    "proportions": ("idealproportions", "uncommonproportions"),
    "cupsize": ("mincup", "averagecup", "maxcup"),
    "firmness": ("minfirmness", "averagefirmness", "maxfirmness"),
}
"""Variations of each phenotype, at equal distances from the lowest value to 1."""

ORIGINS = ("african", "asian", "caucasian")
"""Phenotypes that are variations themselves."""

PHENOTYPES = (*VARIATIONS, *ORIGINS)
"""Names of the phenotypes, in the order of Anny's sliders."""

TYPICAL = 0.5
"""Value of every phenotype of the mean body."""

_NEWBORN = -1.0 / 3.0  # age value of the first anchor; a baby has the value 0
_ALL = tuple(name for names in VARIATIONS.values() for name in names) + ORIGINS


def phenotype_range(name: str) -> tuple[float, float]:
    """Return the smallest and largest value of a phenotype.

    >>> phenotype_range("muscle")
    (0.0, 1.0)
    """
    return (_NEWBORN if name == "age" else 0.0), 1.0


def target_masks(targets: Sequence[Sequence[str]]) -> Bools:
    """Return which variations each target belongs to.

    Parameters
    ----------
    targets : sequence of R sequences of str
        Names of the variations of each target.

    Returns
    -------
    (R, N) bool
        One column for each of the N variations.
    """
    mask = np.zeros((len(targets), len(_ALL)), dtype=np.bool_)
    for row, names in enumerate(targets):
        mask[row, [_ALL.index(name) for name in names]] = True
    return mask


def weights_of(values: Floats, masks: Bools) -> Floats:
    """Return the coefficients of targets.

    Parameters
    ----------
    values : (11,)
        Values of ``PHENOTYPES``, clamped to their ranges.
    masks : (R, N) bool
        From ``target_masks``.

    Returns
    -------
    (R,)
        Products of the weights of the targets' variations.
    """
    parts = [
        _anchored(float(value), len(names), phenotype_range(name)[0])
        for value, (name, names) in zip(values[: len(VARIATIONS)], VARIATIONS.items(), strict=True)
    ]
    weights = np.concatenate([*parts, _fractions(values[len(VARIATIONS) :])])
    return np.where(masks, weights, 1.0).prod(axis=1)


def _anchored(value: float, count: int, low: float) -> Floats:
    """Return the weights of ``count`` anchors at equal distances from ``low`` to 1."""
    anchors = np.linspace(low, 1.0, count)
    return np.array([np.interp(value, anchors, row) for row in np.eye(count)])


def _fractions(values: Floats) -> Floats:
    """Return the fractions of the origins; equal ones if all values are 0."""
    total = float(values.sum())
    return values / total if total else np.full(len(values), 1.0 / len(values))
