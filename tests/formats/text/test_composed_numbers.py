import math
import random
import struct
from decimal import ROUND_HALF_EVEN, Decimal

import numpy as np
import pytest

from viewer.formats._text.number_text import fixed, integers, row_texts, shortest, significant

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


def texts(values, digits_of):
    return b"".join(row_texts(np.array(values)[:, None], digits_of)).decode().splitlines()


@pytest.mark.parametrize("seed", range(3))
def test_shortest_text_equals_repr(seed):
    values = several_floats(seed)
    assert texts(values, shortest) == [*map(repr, values)]


@pytest.mark.parametrize("count", [1, 6, 9, 15])
def test_significant_digits_match_the_g_format(count):
    values = several_floats(count)
    assert texts(values, lambda part: significant(part, count)) == [
        f"{v:.{count}g}" for v in values
    ]


@pytest.mark.parametrize("decimals", [1, 6, 7, 8, 9, 15])
def test_fixed_decimals_match_the_exact_decimal_number(decimals):
    # The expected values are exact decimal numbers without rounding.
    rng = random.Random(decimals)
    exact = [Decimal(rng.randrange(-(10**k), 10**k)).scaleb(-decimals) for k in range(1, 16)] * 50
    unit = Decimal(1).scaleb(-decimals)
    expected = [str(v.quantize(unit, ROUND_HALF_EVEN)) if v else f"{0:.{decimals}f}" for v in exact]
    expected = [text if "E" not in text else f"{Decimal(text):f}" for text in expected]
    found = texts([float(v) for v in exact], lambda part: fixed(part, decimals))
    assert found == expected


def test_fixed_decimals_out_of_range_match_the_f_format():
    values = [1e15, -1e22, 1e300, 123456789012345678.0, 0.25, -0.0, -1e-9]
    values += [1.5, math.nan, math.inf, 2.5, -math.inf]
    found = texts(values, lambda part: fixed(part, 6))
    assert found == [f"{np.round(value, 6) + 0.0:.6f}" for value in values]


def test_integers_of_up_to_16_digits_match_str():
    values = [s * (10**k + d) for k in range(16) for d in (-1, 0, 1) for s in (-1, 1)]
    assert texts(values, integers) == [*map(str, values)]


def test_separators_are_written_after_their_columns():
    rows = np.array([[1, -22, 333], [4444444444, 5, -6]])
    text = b"".join(row_texts(rows, integers, [b"//", b", "], b"\r\nf "))
    assert text == b"1//-22, 333\r\nf 4444444444//5, -6\r\nf "
    assert b"".join(row_texts(rows[:0], integers)) == b""


def test_rows_that_exceed_one_part_are_complete():
    rows = np.arange(60_000).reshape(-1, 3)
    lines = b"".join(row_texts(rows, integers)).splitlines()
    assert lines == [b"%d %d %d" % (k, k + 1, k + 2) for k in range(0, 60_000, 3)]
