"""Open Sound Control 1.0: messages and bundles in UDP packets.

::

    message   address, type tags (both text), arguments
    bundle    "#bundle", time (8 bytes), then elements, each after its size (int32)
    text      ends with 1 to 4 zeros, so that its size is a multiple of 4

Numbers are big-endian. This is own code although the package python-osc reads it too: on malformed
packets, that raises errors of three kinds (also of Unicode and recursion), copies them to the log,
and skips arguments of unknown types; VMC needs every such packet to be one counted error.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Sequence
from typing import TypeAlias

from viewer.errors import ViewerError
from viewer.phrases import printable

Argument: TypeAlias = "int | float | str | bytes | bool | None"
OscMessage: TypeAlias = "tuple[str, tuple[Argument, ...]]"

LARGEST = 65_507
"""Bytes of a UDP packet over IPv4."""

_BUNDLE = b"#bundle\0"
_AT_ONCE = struct.pack(">Q", 1)  # the time tag for "immediately"
_MOST = (2.0 - 2.0**-23) * 2.0**127  # largest number in single precision
_DEEPEST = 4  # bundles within each other
_NUMBERS = {"i": ">i", "f": ">f", "h": ">q", "d": ">d", "r": ">I", "m": ">I", "c": ">I", "t": ">Q"}
_PLAIN: dict[str, Argument] = {"T": True, "F": False, "N": None, "I": None}


class OscError(ViewerError):
    """A packet is malformed."""


def messages_of(data: bytes, depth: int = 0) -> list[OscMessage]:
    """Return the messages of a packet, those of bundles included; raises ``OscError``."""
    if not data or len(data) % 4:
        raise OscError(f"expected a multiple of 4 bytes, found {len(data)}")
    if not data.startswith(_BUNDLE):
        return [_message(data)]
    if depth >= _DEEPEST:
        raise OscError(f"expected at most {_DEEPEST} bundles within each other")
    if len(data) < 16:
        raise OscError("expected a time after #bundle")
    found, start = list[OscMessage](), 16
    while start < len(data):
        size = struct.unpack_from(">i", data, start)[0]
        end = start + 4 + size
        if size <= 0 or end > len(data):
            raise OscError(f"expected an element of a bundle, found one of {size} bytes")
        found += messages_of(data[start + 4 : end], depth + 1)
        start = end
    return found


def _message(data: bytes) -> OscMessage:
    address, start = _text(data, 0)
    if not address.startswith("/"):
        raise OscError(f"expected an address, found {printable(address, 40)}")
    if start == len(data):  # old programs leave out the type tags of a message without arguments
        return address, ()
    tags, start = _text(data, start)
    if not tags.startswith(","):
        raise OscError(f"expected type tags, found {printable(tags, 40)}")
    found = list[Argument]()
    for tag in tags[1:]:
        if tag in _PLAIN:
            found.append(_PLAIN[tag])
        elif tag in ("s", "S"):
            text, start = _text(data, start)
            found.append(text)
        elif tag == "b":
            size = _number(">i", data, start)
            end = start + 4 + int(size)
            if size < 0 or end > len(data):
                raise OscError(f"expected a blob, found one of {size} bytes")
            found.append(data[start + 4 : end])
            start = end + -end % 4
        elif tag in _NUMBERS:
            found.append(_number(_NUMBERS[tag], data, start))
            start += struct.calcsize(_NUMBERS[tag])
        else:
            raise OscError(f"unknown type of an argument {printable(tag, 4)}")
    if start != len(data):
        raise OscError(f"expected {start} bytes of {printable(address, 40)}, found {len(data)}")
    return address, tuple(found)


def _text(data: bytes, start: int) -> tuple[str, int]:
    """Return a text, and where the next item begins."""
    end = data.find(b"\0", start)
    if end < 0:
        raise OscError("expected a text that ends with a zero")
    try:
        return data[start:end].decode("utf-8"), end + 4 - end % 4
    except UnicodeDecodeError:
        raise OscError("expected UTF-8 text") from None


def _number(kind: str, data: bytes, start: int) -> int | float:
    if start + struct.calcsize(kind) > len(data):
        raise OscError("expected a number, found the end of the packet")
    found: int | float = struct.unpack_from(kind, data, start)[0]
    return found


def message_bytes(address: str, *arguments: float | str) -> bytes:
    """Return the bytes of a message; integers, floats (single precision) and texts."""
    tags, parts = ",", list[bytes]()
    for each in arguments:
        if isinstance(each, str):
            tags, part = tags + "s", _padded(each)
        elif isinstance(each, int):
            tags, part = tags + "i", struct.pack(">i", each)
        else:
            tags, part = tags + "f", struct.pack(">f", min(max(each, -_MOST), _MOST))
        parts.append(part)
    return b"".join([_padded(address), _padded(tags), *parts])


def _padded(text: str) -> bytes:
    data = text.encode()
    return data + b"\0" * (4 - len(data) % 4)


def bundles(messages: Iterable[bytes], most: int = 1400) -> Sequence[bytes]:
    """Return messages in bundles of at most so many bytes, which networks pass undivided."""
    found, size = list[list[bytes]](), most
    for message in messages:
        part = struct.pack(">i", len(message)) + message
        if size + len(part) > most:
            found.append([_BUNDLE, _AT_ONCE])
            size = len(_BUNDLE) + len(_AT_ONCE)
        found[-1].append(part)
        size += len(part)
    return [b"".join(parts) for parts in found]
