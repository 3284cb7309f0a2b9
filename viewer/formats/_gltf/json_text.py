"""Parser for the JSON of a glTF file, which may be hostile or deviate from the standard."""

from __future__ import annotations

import gc
import json
import math
import re
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from viewer.formats._archive.values import describe
from viewer.formats._source import Source
from viewer.formats._text.json_places import MOST_DIGITS
from viewer.phrases import printable

__all__ = ["parsed"]

_PADDING = b" \t\r\n\0"  # some writers pad the JSON chunk with zeros instead of spaces
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"
_MOST_BYTES = 512 << 20  # maximum size of the text; parsing takes three times as much memory
_THOROUGH = 1 << 20  # size in bytes up to which a text is always searched for repeated keys
_HUGE = re.compile(r"\d[eE]\+?\d{3}|\d{309}")  # parts of numbers that may exceed float64
_UTF_16 = (b"\xff\xfe", b"\xfe\xff")


def parsed(source: Source, data: bytes, has_lines: bool) -> dict[str, Any]:
    """Return the parsed root object.

    Parameters
    ----------
    source : Source
        The file, which records diagnostics.
    data : bytes
        UTF-8 text, possibly padded.
    has_lines : bool
        Whether the text is the whole file, so that errors have a line number.

    Raises
    ------
    FormatError
        If the text is not a valid JSON object.
    """
    if len(data) > _MOST_BYTES:
        raise source.fault("F001.gltf-text", most=_MOST_BYTES, size=len(data))
    text = _text(source, data.rstrip(_PADDING).removeprefix(_BYTE_ORDER_MARK))
    constants: list[str] = []
    repeated: list[str] = []
    overflows: list[str] = []

    def constant(word: str) -> float:
        constants.append(word)
        return float(word)

    def number(word: str) -> float:
        value = float(word)
        if math.isinf(value):
            overflows.append(word)
        return value

    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        values = dict(pairs)
        if len(values) != len(pairs):
            counts = Counter(key for key, _ in pairs)
            repeated.extend(key for key, count in counts.items() if count > 1)
        return values

    # The search for repeated keys takes half as long as parsing.
    looks = len(text) < _THOROUGH or source.diagnostics.keeps_errors
    hook = unique if looks else None
    # Python calls a function for each number only if this is needed, because it is slow.
    of_numbers = number if _HUGE.search(text) else None
    decoder = json.JSONDecoder(
        object_pairs_hook=hook, parse_constant=constant, parse_float=of_numbers
    )
    try:
        with _collection_suspended():
            root = decoder.decode(text)
    except json.JSONDecodeError as problem:
        place = len(text[: problem.pos].encode(errors="replace")) if has_lines else None
        reason = printable(problem.msg, 100)
        raise source.fault("F002.gltf-json", place, reason=reason, at=problem.pos) from None
    except RecursionError:
        raise source.fault("F002.json-nesting") from None
    except ValueError:  # the error is raised only for numbers with too many digits
        raise source.fault("F002.gltf-digits", most=MOST_DIGITS) from None
    if type(root) is not dict:
        raise source.fault("F002.gltf-type", wanted="an object", found=describe(root))
    if constants:
        source.warn("G001.constants", n=len(constants), found=constants[0])
    if overflows:
        source.warn("G001.overflow", n=len(overflows), found=overflows[0])
    if repeated:
        source.warn("G001.repeated", n=len(repeated), found=repeated[0], names=repeated)
    if "null" in text and (n_nulls := _remove_nulls(root)):
        source.warn("G001.nulls", n=n_nulls)
    return root


@contextmanager
def _collection_suspended() -> Iterator[None]:
    """Suspend garbage collection, which takes a quarter of the time and cannot find anything.

    Hundreds of thousands of new objects start it again and again, although JSON has no cycles.
    """
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


def _remove_nulls(root: dict[str, Any]) -> int:
    """Remove null members, which some exporters write instead of omitting them.

    Returns their number. Application data are left unchanged.
    """
    count = 0
    left: list[Any] = [root]
    while left:
        value = left.pop()
        if type(value) is list:
            left.extend(item for item in value if type(item) in (dict, list))
            continue
        for name in [name for name, member in value.items() if member is None]:
            del value[name]
            count += 1
        members = (member for name, member in value.items() if name != "extras")
        left.extend(member for member in members if type(member) in (dict, list))
    return count


def _text(source: Source, data: bytes) -> str:
    if not data:
        raise source.fault("F002.gltf-no-json")
    if data.startswith(_UTF_16):
        raise source.fault("F002.gltf-utf-16")
    try:
        return data.decode()
    except UnicodeDecodeError as problem:
        # Only names can be in another encoding, and they are only displayed; keys are ASCII.
        source.warn("G001.text", at=problem.start)
        return data.decode(errors="replace")
