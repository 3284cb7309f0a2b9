import math
import random
import struct
from decimal import ROUND_HALF_EVEN, Decimal

import numpy as np
import pytest

from viewer.formats._text.number_text import fixed_texts, row_texts

SPECIAL = [
    *(0.0, -0.0, 1.0, -1.0, 0.1, 0.3, 1e15, 1e16, 9999999999999998.0, 123456789012345680.0),
    *(1e-4, 9.999e-5, 1e-5, 5e-324, 2.2250738585072014e-308, 1.7976931348623157e308, 1e22, 1e23),
    *(123456789.5, 999999999.5, 1234567.125, 99999.99995, 9.9999999995, 0.5, 2.5, 1e100, 1e-100),
    *(9007199254740993.0, 4503599627370496.5, 2.0**-1074, 2.0**60, math.pi, -1e-17, 6.1e-17),
    *(math.inf, -math.inf, math.nan),
]


def several_floats(seed):
    rng = random.Random(seed)
    values = list(SPECIAL)
    for _ in range(800):
        values.append(rng.gauss(0, 1))
        values.append(round(rng.uniform(-1e3, 1e3), rng.randrange(8)))
        values.append(10 ** rng.uniform(-25, 25) * rng.choice([-1, 1]))
        values.append(struct.unpack("<f", struct.pack("<f", rng.gauss(0, 100)))[0])
        # Ties when rounded to few digits.
        values.append(rng.randrange(1 << 40) / (1 << rng.randrange(13)))
        values.append(math.nextafter(10.0 ** rng.randint(-20, 20), rng.choice([0, math.inf])))
        values.append(struct.unpack("<d", rng.randbytes(8))[0])
    return values


def texts(values, digits=None):
    return b"".join(row_texts(np.array(values)[:, None], digits)).decode().splitlines()


@pytest.mark.parametrize("seed", range(3))
def test_shortest_text_has_the_digits_of_repr(seed):
    values = [value for value in several_floats(seed) if math.isfinite(value)]
    found = texts(values)
    assert [*map(float, found)] == values
    for text, value in zip(found, values, strict=True):
        assert Decimal(text) == Decimal(repr(value))
        if value == 0.0 or 1e-4 <= abs(value) < 1e16:
            assert text == repr(value)


@pytest.mark.parametrize("count", [1, 6, 9])
def test_significant_digits_match_the_g_format(count):
    values = [value for value in several_floats(count) if not value or 1e-300 < abs(value) < 1e308]
    for text, value in zip(texts(values, count), values, strict=True):
        wanted = f"{value:.{count}g}"
        # Multiplying by a power of ten rounds, which matters within a millionth of a tie.
        unit = Decimal(10) ** (Decimal(wanted).adjusted() - count + 1)
        assert abs(Decimal(text) - Decimal(value)) <= unit * Decimal("0.500001")
        assert len(Decimal(text).normalize().as_tuple().digits) <= count
        if Decimal(text) == Decimal(wanted) and "e" not in wanted:
            assert text == wanted


@pytest.mark.parametrize("decimals", [1, 6, 7, 8, 9, 15])
def test_fixed_decimals_match_the_exact_decimal_number(decimals):
    # The expected values are exact decimal numbers without rounding.
    rng = random.Random(decimals)
    exact = [Decimal(rng.randrange(-(10**k), 10**k)).scaleb(-decimals) for k in range(1, 16)] * 50
    unit = Decimal(1).scaleb(-decimals)
    expected = [str(v.quantize(unit, ROUND_HALF_EVEN)) if v else f"{0:.{decimals}f}" for v in exact]
    expected = [text if "E" not in text else f"{Decimal(text):f}" for text in expected]
    assert fixed([float(v) for v in exact], decimals) == expected


def fixed(values, decimals):
    rows = np.array(values)[:, None]
    return b"".join(fixed_texts(rows, decimals)).decode().splitlines()


@pytest.mark.parametrize("values", [[0.25, -0.0, -1e-9, 2.5, -0.5], [1e15, -1e22, 1e300, -0.0]])
def test_fixed_decimals_of_any_size_match_the_f_format(values):
    assert fixed(values, 6) == [f"{np.round(value, 6) + 0.0:.6f}" for value in values]


def test_integers_match_str():
    values = [s * (10**k + d) for k in range(18) for d in (-1, 0, 1) for s in (-1, 1)]
    assert texts(values) == [*map(str, values)]


def test_groups_and_rows_have_their_separators():
    rows = np.array([[[1, -22], [333, 4444444444]], [[5, -6], [7, 8]]])
    text = b"".join(row_texts(rows, within=b"//", start=b"f "))
    assert text == b"f 1//-22 333//4444444444\nf 5//-6 7//8\n"
    assert b"".join(row_texts(rows[:0])) == b""
    assert b"".join(row_texts(np.array([[2.0, 10.5], [0.0, -1.0]]), 9)) == b"2 10.5\n0 -1\n"
    assert b"".join(row_texts(rows[0], between=b", ")) == b"1, -22\n333, 4444444444\n"
    assert b"".join(fixed_texts(np.array([[1.0, 2.0]]), 1, b", ")) == b"1.0, 2.0\n"


def test_rows_that_exceed_one_part_are_complete():
    rows = np.arange(60_000).reshape(-1, 3)
    lines = b"".join(row_texts(rows)).splitlines()
    assert lines == [b"%d %d %d" % (k, k + 1, k + 2) for k in range(0, 60_000, 3)]
