"""Numbers as text, without negative zeros."""

import math

import pytest

from viewer.app.core.widgets import plain_zero
from viewer.rig.number_text import angle_text, number_text, short_number


@pytest.mark.parametrize(
    ("value", "spec", "text"),
    [
        (-0.0, "g", "0"),
        (-0.0, ".3f", "0.000"),
        (-0.00049, ".3f", "0.000"),
        (-0.00051, ".3f", "-0.001"),
        (-0.4, ",.0f", "0"),
        (-0.0, "+.3g", "+0"),
        (-0.0, ">8.2f", "    0.00"),
        (-0.0, ".2e", "0.00e+00"),
        (-1e-300, "g", "-1e-300"),
        (-math.inf, "g", "-inf"),
        (math.nan, "g", "nan"),
        (-30.0, ".0f", "-30"),
    ],
)
def test_zero_has_no_minus_sign(value, spec, text):
    assert number_text(value, spec) == text


def test_angles_use_the_shown_unit():
    assert angle_text(math.pi / 2, in_degrees=True) == "90.0\N{DEGREE SIGN}"
    assert angle_text(0.5, in_degrees=False) == "0.500 rad"
    assert angle_text(-1e-6, in_degrees=True, sign="+") == "+0.0\N{DEGREE SIGN}"
    assert angle_text(-1e-6, in_degrees=False) == "0.000 rad"


def test_short_numbers_keep_three_digits():
    assert [short_number(x) for x in (-0.0, -0.01234, 1234.5)] == ["0", "-0.0123", "1,234"]


@pytest.mark.parametrize(
    ("value", "text", "shown"),
    [
        (-0.0, "%.2f", 0.0),
        (-0.004, "%.2f", 0.0),
        (-0.006, "%.2f", -0.006),
        (-0.04, "%.1f\N{DEGREE SIGN}", 0.0),
        (-0.4, "%.0f\N{DEGREE SIGN}", 0.0),
        (0.001, "%.2f", 0.001),
        (-0.0, "%.6g", 0.0),
        (-1e-9, "%.6g", -1e-9),
        (-math.inf, "%.2f", -math.inf),
        (-0.00004, "%.4f rad", 0.0),
    ],
)
def test_widgets_get_zero_instead_of_negative_zero(value, text, shown):
    found = plain_zero(value, text)
    assert found == shown and math.copysign(1.0, found) == (-1.0 if shown < 0.0 else 1.0)
