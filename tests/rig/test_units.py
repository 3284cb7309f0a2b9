"""Units of length: conversion factors, and detection of metres."""

import numpy as np
import pytest

from viewer.rig.figure import Figure
from viewer.rig.scalars import length_text, length_unit
from viewer.rig.skeleton import ball_skeleton
from viewer.rig.units import METRES, SIZES, UNIT_NAMES, is_metres, unit_of_scaled


def test_factors_convert_units_to_metres():
    assert METRES == {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}
    assert UNIT_NAMES.keys() == METRES.keys() and SIZES.keys() < METRES.keys()


@pytest.mark.parametrize("unit", SIZES)
def test_sizes_cover_people_from_newborn_to_tallest(unit):
    low, high = SIZES[unit]
    smallest = 0.5 if unit != "m" else 0.3
    assert low * METRES[unit] <= smallest and high * METRES[unit] == pytest.approx(3.5)


@pytest.mark.parametrize(
    ("size", "expected"), [(0.0, False), (0.29, False), (0.3, True), (3.5, True), (3.6, False)]
)
def test_metres_are_inferred_for_sizes_between_infant_and_giant(size, expected):
    assert is_metres(size) == expected


@pytest.mark.parametrize(
    ("unit", "text"), [("m", "2 m"), ("cm", "20 mm"), ("mm", "2 mm"), ("in", "50.8 mm")]
)
def test_small_lengths_are_millimetres_in_every_known_unit(unit, text):
    skeleton = ball_skeleton(("a",), np.array([-1]), np.zeros((1, 3)))
    figure = Figure("a", skeleton=skeleton, unit=unit)
    assert length_text(figure, 2.0) == text
    assert length_unit(figure) == (pytest.approx(1000 * METRES[unit]), "mm")


@pytest.mark.parametrize(
    ("unit", "scale", "expected"),
    [
        ("m", 1.0, "m"),
        ("m", 0.6, "m"),  # a child and an adult
        ("m", 110.0, "cm"),
        ("m", 900.0, "mm"),
        ("cm", 0.011, "m"),
        ("in", 1.2, "in"),
        ("in", 2.54, "cm"),
        ("m", 39.37, ""),  # inches are never estimated
        ("m", 7.0, ""),
        ("", 1.0, ""),
        ("furlong", 1.0, ""),
    ],
)
def test_unit_of_a_similar_figure_is_inferred_from_its_size(unit, scale, expected):
    assert unit_of_scaled(unit, scale) == expected
