"""Messages between a program and a window: JSON and arrays of numbers, never pickled objects.

::

    "SKL1"   size of the header, uint32   size of the body, uint64       little-endian
    header   UTF-8 JSON: {"do": name, "arrays": [[type, [side, ...]], ...], ...}
    body     the arrays in this order, little-endian, C order

The sizes are limited before anything else is read. Every message is answered by one message:
``"ok"`` with the result, or ``"error"`` with ``"text"``.
"""

from __future__ import annotations

import json
import math
import socket
import struct
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias, TypeGuard

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.errors import ViewerError
from viewer.phrases import printable
from viewer.rigs.file_record import Json

VERSION = 2
"""Version of the protocol; programs and windows of different versions refuse each other."""

_MARK = b"SKL1"
_START = struct.Struct("<4sIQ")
_TYPES = ("<f8", "<f4", "<i4", "<i8", "|u1", "|b1")
_MOST_ARRAYS, _MOST_SIDES = 100_000, 8
_BLOCK = 1 << 20  # bytes received at a time: a false size costs no memory

Values: TypeAlias = NDArray[np.generic]


class MessageError(ViewerError):
    """A message is malformed; the next one can be read."""


class BrokenStreamError(MessageError):
    """Where the next message begins is unknown: the connection has to be closed."""


@dataclass(frozen=True, slots=True)
class Limits:
    """Largest parts of a message, bytes."""

    header: int
    body: int


FIRST = Limits(4096, 0)
"""Of the handshake, before the token is known."""
USUAL = Limits(16 << 20, 1 << 30)
"""Of all others: names and settings, and the vertices of a scene."""


@dataclass(frozen=True, slots=True, eq=False)
class Message:
    """What to do, facts as JSON, and arrays."""

    do: str
    facts: Mapping[str, Any]
    arrays: Sequence[Values] = ()

    def number(self, name: str) -> float:
        """Return a finite number among the facts."""
        return finite(name, self.facts.get(name))

    def numbers(self, name: str, count: int) -> list[float]:
        """Return a list of finite numbers among the facts."""
        value = self.facts.get(name)
        if not isinstance(value, list) or len(value) != count:
            raise MessageError(f"{name}: expected {count} numbers, found {_shown(value)}")
        return [finite(name, each) for each in value]

    def index(self, name: str) -> int:
        """Return an integer among the facts."""
        value = self.facts.get(name)
        if isinstance(value, bool) or not isinstance(value, int):
            raise MessageError(f"{name}: expected an integer, found {_shown(value)}")
        return value

    def text(self, name: str) -> str:
        """Return a text among the facts."""
        value = self.facts.get(name)
        if not isinstance(value, str):
            raise MessageError(f"{name}: expected a text, found {_shown(value)}")
        return value

    def array(self, index: int, shape: tuple[int | None, ...]) -> NDArray[np.float64]:
        """Return an array of finite numbers as float64; None in a shape stands for any length."""
        if index >= len(self.arrays):
            raise MessageError(f"{self.do}: expected array {index}, found {len(self.arrays)}")
        found = self.arrays[index]
        fits = len(shape) == found.ndim and all(
            side in (None, length) for side, length in zip(shape, found.shape, strict=True)
        )
        if not fits:
            wanted = ", ".join("N" if side is None else str(side) for side in shape)
            raise MessageError(
                f"{self.do}: array {index}: expected shape ({wanted}), found {found.shape}"
            )
        values = found.astype(np.float64)
        if not np.isfinite(values).all():
            raise MessageError(f"{self.do}: array {index}: expected finite numbers")
        return values


def finite(name: str, value: object) -> float:
    """Return a finite number; ``MessageError`` for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise MessageError(f"{name}: expected a number, found {_shown(value)}")
    try:
        number = float(value)
    except OverflowError:  # integers of JSON may be of any size
        number = math.inf
    if not math.isfinite(number):
        raise MessageError(f"{name}: expected a finite number, found {_shown(value)}")
    return number


def packed(message: Message) -> bytes:
    """Return the bytes of a message."""
    arrays = [_plain(array) for array in message.arrays]
    told: Json = {**message.facts, "do": message.do}
    told["arrays"] = [[array.dtype.str, list(array.shape)] for array in arrays]
    header = json.dumps(told, allow_nan=False).encode()
    size = sum(array.nbytes for array in arrays)
    if len(header) > USUAL.header or size > USUAL.body:
        raise ViewerError(
            f"{message.do}: expected at most {USUAL.body >> 20} MiB, found {size / (1 << 20):.0f}"
        )
    start = _START.pack(_MARK, len(header), size)
    return b"".join([start, header, *(array.tobytes() for array in arrays)])


def _plain(array: Values) -> Values:
    """Return an array in one of the types of messages."""
    kind = array.dtype.newbyteorder("<")
    if kind.str not in _TYPES:
        kind = np.dtype({"f": "<f8", "i": "<i8", "u": "<i8"}.get(kind.kind, "V"))
        if kind.kind == "V":
            raise ViewerError(f"expected an array of numbers, found {array.dtype}")
    return np.asarray(array, kind)


def read(receive: Callable[[int], bytes], limits: Limits = USUAL) -> Message:
    """Read one message; ``receive`` returns so many bytes, or raises."""
    mark, header_size, body_size = _START.unpack(receive(_START.size))
    if mark != _MARK:
        raise BrokenStreamError("expected a message, found other data")
    if header_size > limits.header or body_size > limits.body:
        raise BrokenStreamError(
            f"expected a message of at most {limits.header:,} + {limits.body:,} bytes, "
            f"found {header_size:,} + {body_size:,}"
        )
    header, body = receive(header_size), receive(body_size)
    told = _json(header)
    do, listed = told.pop("do", None), told.pop("arrays", [])
    if not isinstance(do, str):
        raise MessageError(f"do: expected a text, found {_shown(do)}")
    return Message(do, told, _arrays(listed, body))


def _json(data: bytes) -> Json:
    try:
        told = json.loads(data.decode("utf-8"), parse_constant=_refuse)
    except (ValueError, RecursionError) as problem:
        raise MessageError(f"expected JSON, found {printable(problem, 100)}") from None
    if not isinstance(told, dict):
        raise MessageError(f"expected a JSON object, found {_shown(told)}")
    return told


def _refuse(word: str) -> None:
    raise ValueError(word)


def _arrays(listed: object, body: bytes) -> list[Values]:
    """Return the arrays of a body; their sizes must add up to its size."""
    if not isinstance(listed, list) or len(listed) > _MOST_ARRAYS:
        raise MessageError(f"arrays: expected a list, found {_shown(listed)}")
    found, start = list[Values](), 0
    for item in listed:
        kind, shape = item if isinstance(item, list) and len(item) == 2 else (None, None)
        if kind not in _TYPES or not _is_shape(shape):
            raise MessageError(f"arrays: expected a type and a shape, found {_shown(item)}")
        # Python's integers do not overflow, whatever sides the shape has.
        count = math.prod(shape)
        end = start + count * np.dtype(kind).itemsize
        if end > len(body):
            raise MessageError(f"arrays: expected {end:,} bytes, found {len(body):,}")
        if kind == "|b1" and np.frombuffer(body, np.uint8, count, start).max(initial=0) > 1:
            raise MessageError("arrays: expected 0 or 1 in an array of truth values")
        found.append(np.frombuffer(body, kind, count, start).reshape(shape))
        start = end
    if start != len(body):
        raise MessageError(f"arrays: expected {start:,} bytes, found {len(body):,}")
    return found


def _is_shape(shape: object) -> TypeGuard[list[int]]:
    if not isinstance(shape, list) or len(shape) > _MOST_SIDES:
        return False
    return all(type(side) is int and 0 <= side < 1 << 40 for side in shape)


def _shown(value: object) -> str:
    return printable(repr(value), 60)


def receiver(stream: socket.socket, seconds: float | None = None) -> Callable[[int], bytes]:
    """Return a function that receives a number of bytes; ``EOFError`` at the end of the stream.

    ``TimeoutError`` once it has received for some seconds in all, from now on.
    """
    deadline = None if seconds is None else time.monotonic() + seconds

    def receive(size: int) -> bytes:
        data = bytearray()
        while len(data) < size:
            if deadline is not None:
                stream.settimeout(max(deadline - time.monotonic(), 1e-3))
            part = stream.recv(min(size - len(data), _BLOCK))
            if not part:
                raise EOFError
            data += part
        return bytes(data)

    return receive


def told_of(problem: Exception) -> str:
    """Return the text of an error that another process or thread is to hear of."""
    if isinstance(problem, ViewerError):
        return str(problem)
    return f"{type(problem).__name__}: {printable(problem, 300)}"
