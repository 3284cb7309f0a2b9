"""Formatting of counts, lists and names in messages."""

from __future__ import annotations

from collections.abc import Sequence

_PLURALS = {"vertex": "vertices", "matrix": "matrices"}
_BYTES = {"GB": 1e9, "MB": 1e6, "kB": 1e3}


def printable(text: object, limit: int = 200) -> str:
    r"""Return ``text`` on one line: control characters escaped, truncated to ``limit`` characters.

    >>> printable("two\nlines")
    'two\\nlines'
    """
    shown = "".join(
        letter
        if letter.isprintable()
        else letter.encode("unicode_escape", "surrogatepass").decode()
        for letter in str(text)
    )
    return shown if len(shown) <= limit else shown[: limit - 1] + "…"


def quoted(word: bytes | str, limit: int = 40) -> str:
    r"""Return a word from a file in double quotes, on one line, truncated if it is long.

    >>> quoted(b"up\x00"), quoted("left")
    ('"up\\x00"', '"left"')
    """
    text = word[:200].decode("utf-8", "replace") if isinstance(word, bytes) else word
    return f'"{printable(text, limit)}"'


def rounded(value: float, digits: int = 3) -> str:
    """Format a number with some digits, or all integer digits of numbers below a million.

    >>> rounded(0.012345), rounded(1284.0), rounded(12345.6, 5), rounded(3.2e30)
    ('0.0123', '1,284', '12346', '3.2e+30')
    """
    is_long = 10.0**digits - 0.5 <= abs(value) < 1e6
    return format(value, ",.0f" if is_long else f".{digits}g")


def file_size(count: int) -> str:
    """Return a number of bytes as file managers show it: in powers of 1000.

    >>> file_size(958), file_size(1248), file_size(999_999), file_size(3_146_672)
    ('958 bytes', '1.25 kB', '1 MB', '3.15 MB')
    """
    if count < 1000:
        return counted(count, "byte")
    unit = next((unit for unit, one in _BYTES.items() if count >= 0.9995 * one), "kB")
    return f"{rounded(count / _BYTES[unit])} {unit}"


def counted(count: int, noun: str, one: str = "", many: str = "", of: int | None = None) -> str:
    """Return a count with its noun and, if given, the verb that agrees with it.

    ``noun``: singular noun, whose last word is changed to the plural: ``"negative weight"``.
    ``one``, ``many``: verb for one and for several: ``"is"``, ``"are"``; no verb if omitted.

    >>> counted(1, "vertex", "has", "have"), counted(3, "vertex", "has", "have")
    ('1 vertex has', '3 vertices have')
    >>> counted(1, "frame", "is", "are", of=20)
    '1 of 20 frames is'
    """
    head, space, last = noun.rpartition(" ")
    plural = f"{head}{space}{_PLURALS.get(last, f'{last}s')}"
    total = "" if of is None else f"of {of} "
    text = f"{count} {total}{noun if (count if of is None else of) == 1 else plural}"
    return f"{text} {one if count == 1 else many}" if one else text


def one_of(values: Sequence[object]) -> str:
    """Return alternatives joined by commas and "or".

    >>> one_of([9, 48, 63]), one_of([3])
    ('9, 48 or 63', '3')
    """
    *others, last = map(str, values)
    return f"{', '.join(others)} or {last}" if others else last


def listed(names: Sequence[object], limit: int = 6) -> str:
    """Return names on one line, at most ``limit`` of them.

    >>> listed(["a", "b", "c"], 2)
    'a, b and 1 more'
    """
    more = f" and {len(names) - limit} more" * (len(names) > limit)
    return ", ".join(map(str, names[:limit])) + more
