"""Figures in different units in one scene."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from rig.animated import leg

from viewer.loading import Contents, begin
from viewer.rig.scene import scene_unit


def opened(*units):
    figures = [(Path(f"{unit}.glb"), replace(leg(name=unit), unit=unit)) for unit in units]
    return begin(Contents(figures=figures))[0]


@pytest.mark.parametrize(
    ("units", "factors", "unit"),
    [
        (("m", "cm"), (1.0, 0.01), "m"),
        (("cm", "m", "in"), (1.0, 100.0, 2.54), "cm"),
        (("", "mm", "m"), (1.0, 1.0, 1000.0), "mm"),  # unknown units are not scaled
        (("cm", "cm"), (1.0, 1.0), "cm"),
    ],
)
def test_figures_are_scaled_to_the_unit_of_the_first(units, factors, unit):
    scene = opened(*units)
    linear = [actor.placement[:3, :3] for actor in scene.actors]
    assert_allclose(linear, [factor * np.eye(3) for factor in factors], atol=1e-12)
    assert scene_unit(scene) == unit
    notes = [found for found in scene.diagnostics if found.key == "F007.unit-matched"]
    assert [note.values["factor"] for note in notes] == pytest.approx(
        [factor for factor in factors if factor != 1.0]
    )
    assert all(note.severity == "note" for note in notes)


def test_scaled_figures_stand_side_by_side():
    scene = opened("m", "cm")
    sides = [actor.placement[0, 3] for actor in scene.actors]
    # The second is 0.01 times as wide as the first.
    assert 0.0 < sides[1] - sides[0] < 3.0
