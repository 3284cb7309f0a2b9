import math
import random
import struct
from decimal import ROUND_HALF_EVEN, Decimal
from itertools import product

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from viewer.formats._text import numbers
from viewer.formats._text.number_text import fixed_texts, row_texts
from viewer.formats._text.numbers import LARGEST, is_number, parse_numbers, to_number

DIGITS = st.text("0123456789", min_size=1, max_size=24)
SIGNS = st.sampled_from(["", "+", "-"])
MANTISSAS = st.one_of(
    DIGITS,
    DIGITS.map(lambda digits: f"{digits}."),
    DIGITS.map(lambda digits: f".{digits}"),
    st.builds("{}.{}".format, DIGITS, DIGITS),
)
EXPONENTS = st.one_of(
    st.just(""),
    st.builds("{}{}{}".format, st.sampled_from("eE"), SIGNS, st.integers(0, 45)),
)
SPELLINGS = st.builds(
    "{}{}{}{}".format, SIGNS, MANTISSAS, EXPONENTS, st.sampled_from(["", "f", "F"])
)
NUMBERS = SPELLINGS.filter(lambda text: abs(float(text.rstrip("fF"))) <= LARGEST)
SPACES = st.text(" \t\n\r\v\f", min_size=1, max_size=9)
NO_NUMBERS = [
    *("", "up", "-", "+", ".", "-.", "+.", "e5", ".e5", "1e", "1e+", "--1", "+-1", "-+1", "1-"),
    *("1.0-2.0", "1-2", "1+2", "1.2.3", "1..2", "..1", "1,5", "1_000", "1__0", "0x10", "1e5e5"),
    *("nan", "NaN", "-nan", "inf", "-inf", "Infinity", "1e999", "-1e999", "3.5e38", "-3.5e38"),
    *("\u0663", "\u0663\u0664", "\uff11", "1\u0663", "\xbc", "1ff", "1fF", "f", "-f", ".f", "1d5"),
    *("1\0", "\x001", "\0", "1\x1f2", "\x1a", "1\x85", "12345678:", "/1234567", "1\xa0000", "1l"),
    *("1234567.1234567.1", "12345678.2345678.", "1.345678901234.6", "1234567890123456x", "0b1"),
    *("9" * 39, "9" * 400, "1" + "0" * 39, "1234567890abcdef", ":2345678", "1.23456789/", "1e39"),
    *("(1)", "1;", "#1", "$", "1e1.5", "1+"),
]  # fmt: skip


def bits(values):
    return [struct.pack("<d", value) for value in values]


def parsed(text):
    data = text.encode() if isinstance(text, str) else text
    values, bad = parse_numbers(data, 0, len(data))
    return values.tolist(), bad


@pytest.mark.slow
@given(st.lists(st.tuples(NUMBERS, SPACES), max_size=40))
@settings(max_examples=200)
@example([("-0", " "), ("-0.0", " "), ("+0", " "), ("-.0", " "), ("-0.", "\n"), ("0e0", " ")])
@example([("999999999999999", " "), ("9007199254740993", " "), (".000000000000001", " ")])
@example([("1.7976931348623157", " "), ("2.2250738585072014e-308", " "), ("5e-324", " ")])
def test_numbers_match_float_bit_for_bit(pairs):
    values, bad = parsed("".join(number + space for number, space in pairs))
    assert bad == -1
    assert bits(values) == bits(float(number.rstrip("fF")) for number, _ in pairs)


@pytest.mark.parametrize("length", range(1, 25))
def test_every_decimal_point_position_matches_float_bit_for_bit(length):
    rng = random.Random(length)
    words = []
    for place in range(length + 1):
        for sign in ("", "-", "+"):
            digits = "".join(rng.choices("0123456789", k=length))
            words += [f"{sign}{digits[:place]}.{digits[place:]}", f"{sign}{digits}"]
    values, bad = parsed(" ".join(words))
    assert bad == -1
    assert bits(values) == bits(map(float, words))


@pytest.mark.parametrize("most", [8, 17, 20, 24])
def test_exponents_and_ties_match_float_bit_for_bit(most):
    rng = random.Random(most)
    words = ["9007199254740993e0", "9007199254740992.5e1", "18446744073709551615e-30", "0e999"]
    for _ in range(3000):
        length = rng.randint(1, most)
        place = rng.randint(0, length)
        digits = "".join(rng.choices("0123456789", k=length))
        exponent = f"{rng.choice('eE')}{rng.choice(['', '+', '-'])}{rng.randint(0, 19)}"
        words.append(f"{rng.choice(['', '-'])}{digits[:place]}.{digits[place:]}{exponent}")
        # An odd integer of 54 bits over a power of two is halfway between two floats.
        half = Decimal(rng.randrange(1 << 53, 1 << 54) | 1) / (1 << rng.randint(0, 8))
        words.append(f"{half:.20e}" if most > 20 else str(half)[:most])
    words = [word for word in words if abs(float(word)) <= LARGEST]
    values, bad = parsed(" \r\n\t".join(words))
    assert bad == -1
    assert bits(values) == bits(map(float, words))


def test_repr_of_random_floats_round_trips_exactly():
    rng = random.Random(3)
    numbers = [rng.choice([rng.gauss(0, 1), rng.uniform(-1e6, 1e6), 10 ** rng.uniform(-300, 38)])
               for _ in range(20_000)]  # fmt: skip
    values, bad = parsed(" ".join(map(repr, numbers)))
    assert bad == -1
    assert bits(values) == bits(numbers)


@pytest.mark.parametrize("chunk", [1, 2, 3, 7, 8, 9, 16, 17, 31, 64, 100])
def test_numbers_are_not_split_at_chunk_boundaries(monkeypatch, chunk):
    monkeypatch.setattr(numbers, "_CHUNK", chunk)
    rng = random.Random(chunk)
    words = [repr(round(rng.uniform(-1e5, 1e5), rng.randrange(12))) for _ in range(300)]
    text = "".join(word + rng.choice([" ", "\n", "\t\t", " " * 40, "\r\n"]) for word in words)
    values, bad = parsed(text)
    assert bad == -1
    assert bits(values) == bits(map(float, words))


@pytest.mark.parametrize("chunk", [1, 5, 8, 64, 1 << 17])
def test_invalid_number_is_reported_at_its_index(monkeypatch, chunk):
    monkeypatch.setattr(numbers, "_CHUNK", chunk)
    for word, index in product(filter(None, NO_NUMBERS), (0, 1, 6)):
        text = [*["0", "-1.5", "2e1", "3", "4", "5"][:index], word, "7", "bad", "8"]
        assert parsed(" ".join(text)) == ([0.0, -1.5, 20.0, 3.0, 4.0, 5.0][:index], index), word


def test_single_invalid_number_is_refused():
    for word in NO_NUMBERS:
        assert not is_number(word.encode()), word
        assert to_number(word.encode()) is None, word


@pytest.mark.slow
@given(st.lists(st.text("0123456789.+-eEf_x \n\x00\u0663", max_size=20), max_size=10))
@settings(max_examples=200)
def test_parsing_of_blocks_and_single_words_agrees(parts):
    data = " ".join(parts).encode()
    single = [to_number(word) for word in data.split()]
    first_bad = single.index(None) if None in single else -1
    values, bad = parse_numbers(data, 0, len(data))
    assert bad == first_bad
    assert bits(values) == bits(single[: len(single) if first_bad < 0 else first_bad])


def test_control_characters_are_part_of_a_word():
    for control in (*range(9), *range(14, 32)):
        letter = bytes([control])
        assert parsed(b"1 2" + letter + b" 3") == ([1.0], 1), control
        assert parsed(b"1 " + letter + b" 3") == ([1.0], 1), control
        assert parsed(letter) == ([], 0), control
        assert parsed(letter * 3) == ([], 0), control


def test_non_ascii_letters_are_part_of_a_word():
    for code in range(128, 256):
        assert parsed(b"1 2" + bytes([code]) + b"3") == ([1.0], 1), code


def test_six_kinds_of_white_space_separate_words():
    assert parsed("1 2\t3\n4\r5\v6\f7") == ([1, 2, 3, 4, 5, 6, 7], -1)


@pytest.mark.parametrize("text", ["", " ", "\n\n", " " * 5000])
def test_empty_text_has_no_numbers(text):
    assert parsed(text) == ([], -1)


def test_only_the_given_range_is_parsed():
    values, bad = parse_numbers(b"x 12345 y", 3, 6)
    assert (values.tolist(), bad) == ([234.0], -1)


def test_largest_float32_is_the_limit():
    assert parsed("340282346638528859811704183484516925440") == ([LARGEST], -1)
    assert parsed("-3.4028234663852886e38") == ([-LARGEST], -1)
    assert parsed("340282346638528900000000000000000000000") == ([], 0)


@pytest.mark.slow
@pytest.mark.parametrize(
    "word", [b"9" * 2_000_000 + b"x", b"0." + b"0" * 2_000_000 + b"e", b"." * 2_000_000]
)
def test_word_of_2_mb_is_refused_in_linear_time(word):
    assert to_number(word) is None
    assert parse_numbers(b"1 " + word, 0, len(word) + 2)[1] == 1


def test_number_of_2_mb_is_read():
    assert parsed("0." + "0" * 2_000_000 + "1") == ([5e-324], -1)
    assert parsed("0" * 2_000_000 + "7") == ([7.0], -1)


@pytest.mark.parametrize("word", ["1e-400", "1e-324", ".0001e-330f", "0." + "0" * 400 + "1"])
def test_underflow_does_not_produce_an_integer(word):
    assert parsed(f"{word} -{word}") == ([5e-324, -5e-324], -1)
    assert parsed(f"{word}\x01 1")[1] == 0


@pytest.mark.parametrize("word", ["0e-400", "-0.0e-999", ".0e5", "0" * 400, "0." + "0" * 400])
def test_zero_is_parsed_in_any_notation(word):
    assert parsed(word) == ([0.0], -1)


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
