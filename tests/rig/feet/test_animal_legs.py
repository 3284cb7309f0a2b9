"""Animal legs, found by the shape of the skeleton, and planted paws."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from rig.retargeting.trotting import PAWS, animal, other_animal, stands, trot
from rig.retargeting.two_people import BODY, HIK, figure_of, places

from viewer.loading import load
from viewer.rig.feet.legs import animal_legs
from viewer.rig.retargeting.feet import plant_feet
from viewer.rig.retargeting.retarget import retargeted
from viewer.rig.shape import rest_joints

UP = np.array([0.0, 1.0, 0.0])
EDGE = 6  # frames at either end of a stance in which the paw lands or lifts off


def legs(figure, up=UP):
    skeleton = figure.require_skeleton()
    found = animal_legs(skeleton.parents, rest_joints(figure), up)
    names = skeleton.names
    return [tuple(names[j] for j in (leg.hip, leg.knee, leg.ankle, leg.toe)) for leg in found]


def test_legs_of_the_fox_begin_below_the_scapula():
    found = legs(load().actors[0].figure)
    wanted = {
        tuple(f"{end}_{part}_{side}" for part in ("upper", "lower", "paw", "toes"))
        for end in ("hind", "fore")
        for side in "lr"
    }
    assert len(found) == 4 and set(found) == wanted
    assert all(name.endswith("_l") for leg in found[:2] for name in leg)


@pytest.mark.parametrize("table", [BODY, HIK])
def test_people_have_no_animal_legs(table):
    assert legs(figure_of(table, "person")) == []


def test_toes_belong_to_one_leg_and_a_tail_on_the_ground_is_not_a_leg():
    table = animal()
    for paw in PAWS:
        place = np.array(table[f"{paw}_toe"][1])
        for n in (-1, 0, 1):
            table[f"{paw}_toe{n}"] = f"{paw}_toe", np.add(place, (0.01 * n, -0.015, 0.03))
    table["tail"] = "hips", (0.0, 0.2, -0.2)
    assert len(legs(figure_of(table, "toes"))) == 4
    for n, place in enumerate([(0.0, 0.1, -0.3), (0.0, 0.05, -0.35), (0.0, 0.0, -0.4)]):
        table[f"tail{n}"] = f"tail{n - 1}" if n else "tail", place
    found = legs(figure_of(table, "no mirror image"))
    assert len(found) == 4 and not any("tail" in name for leg in found for name in leg)
    turn = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    lying = figure_of(animal(), "z", turn, up="z")
    assert len(legs(lying, np.array([0.0, 0.0, 1.0]))) == 4


def test_three_legs_or_two_points_are_not_an_animal():
    table = {name: row for name, row in animal().items() if not name.startswith("fore_r")}
    assert legs(figure_of(table, "three")) == []
    assert animal_legs(np.array([-1, 0], dtype=np.int32), np.zeros((2, 3)), UP) == []


def test_paws_are_planted_in_the_stances_of_the_source_animal():
    figure = other_animal()
    found = retargeted(trot(), figure)
    clip, changes = plant_feet(found, figure)
    assert changes.is_better and changes.after < changes.source
    old, new = places(figure, found.clip), places(figure, clip)
    slid = []
    for paw in PAWS:
        flags = stands(paw)
        first = int(np.flatnonzero(flags[1:] & ~flags[:-1])[0]) + 1
        rows = slice(first + EDGE, first + 45 - EDGE)
        slid.append(np.ptp(old[f"{paw}_toe"][rows, 2]))
        assert_allclose(np.ptp(new[f"{paw}_toe"][rows], axis=0), 0.0, atol=1e-9)
        assert_allclose(new[f"{paw}_toe"][rows, 1], 0.0, atol=1e-9)  # the toes serve as soles
    assert max(slid) > 0.009
    source = places(found.source.figure, found.source.clip)
    assert np.ptp(source["hind_l_toe"][EDGE : 45 - EDGE], axis=0).max() < 1e-12
