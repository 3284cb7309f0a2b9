"""The pickle machine: its state, its opcodes, and the arrays in pickles of joblib.

A pickle is a program for a stack machine. Its state is the bytes, a stack with marks, the memo and
a budget. Nothing is recursive, no length is trusted before the bytes are known to exist, and the
budget limits time and memory for any sequence of opcodes.
"""

from __future__ import annotations

import codecs
import re
import struct
from collections.abc import Callable
from typing import TypeVar

from viewer.diagnostics import Phrase
from viewer.errors import FormatError
from viewer.formats._archive.values import item_count
from viewer.formats._archive.zip import Data
from viewer.formats._pickle import names as names
from viewer.formats._pickle.values import Array, Dtype, Instance, Span, StandIn, is_sizes, noun
from viewer.formats._source import InvalidValueError, Source

# Maximum number of items; a body model needs a few hundred, a motion in plain lists about 100,000.
# Results of trackers, which write a dict per frame and person, need one for every eight bytes.
_MAX_STEPS = 1_000_000
_BYTES_PER_STEP = 4
_MOST_STEPS = 20_000_000
_DEEPEST = 3  # maximum nesting of pickles inside pickles; real files have two levels
_LONGEST_LINE = 256  # maximum number of characters of a name or number in the text protocols
_INTEGER = re.compile(rb"[+-]?[0-9]+")


class Machine:
    """A pickle being read.

    ``at``: offset of the next byte. ``end``: offset of the end of the pickle's bytes.
    ``persistent``, ``load_bytes``: functions that return the value of a persistent id, and the
    value of torch's storages saved as bytes; None if the file must not contain these.
    """

    def __init__(
        self, source: Source, data: Data | None = None, start: int = 0, end: int | None = None
    ) -> None:
        self.source, self.at = source, start
        self.data: Data = source.data if data is None else data
        self.end = len(self.data) if end is None else end
        self.depth = 0
        self.persistent: Callable[[object], object] | None = None
        self.load_bytes: Callable[[Machine, Span], object] | None = None
        self.stack: list[object] = []
        self.memo: dict[int, object] = {}
        self._marks: list[int] = []
        self._floor = 0  # height of the stack at the last mark
        self._most = max(_MAX_STEPS, min((self.end - start) // _BYTES_PER_STEP, _MOST_STEPS))
        self._budget = self._most
        self._step_at = 0

    def fail(self, problem: Phrase) -> FormatError:
        """Return an error with the offset of the current opcode."""
        return self.source.fault("F002.pickle-step", problem=problem, at=self._step_at)

    def next_step(self) -> int:
        """Return the next opcode, and deduct it from the budget."""
        self._step_at = self.at
        if self.at >= self.end:
            raise self.cut_short(1, 0)
        self.spend(1)
        self.at += 1
        return self.data[self.at - 1]

    def spend(self, count: int) -> None:
        """Deduct a number of items from the budget; reject a pickle that exceeds it."""
        self._budget -= count
        if self._budget < 0:
            raise self.fail(Phrase("pickle-steps", most=self._most))

    def nested(self, data: Data, start: int, end: int) -> Machine:
        """Return a machine for a pickle inside this one; it continues with the same budget.

        Raises ``FormatError`` if pickles are nested too deeply.
        """
        if self.depth >= _DEEPEST:
            raise self.fail(Phrase("pickle-nested", most=_DEEPEST))
        inner = Machine(self.source, data, start, end)
        inner.depth, inner._budget, inner._most = self.depth + 1, self._budget, self._most
        return inner

    def rejoin(self, inner: Machine) -> None:
        """Continue with the budget that a nested machine has left."""
        self._budget = inner._budget

    # Methods that read bytes.

    def number(self, size: int, *, is_signed: bool = False) -> int:
        """Read an integer of ``size`` bytes, least significant first."""
        start = self.skip(size)
        return int.from_bytes(self.data[start : self.at], "little", signed=is_signed)

    def skip(self, size: int) -> int:
        """Skip bytes, which must exist, and return the offset of the first."""
        start = self.at
        if size < 0 or size > self.end - start:
            raise self.cut_short(size, self.end - start)
        self.at = start + size
        return start

    def span(self, width: int, coding: str | None = None, *, is_signed: bool = False) -> Span:
        """Read a length stored in ``width`` bytes, and return the span of that length after it."""
        start = self.skip(self.number(width, is_signed=is_signed))
        return Span(self.data, start, self.at, coding)

    def line(self, longest: int | None = _LONGEST_LINE) -> tuple[int, int]:
        """Skip a line, and return the start and end of its text."""
        start = self.at
        end = self.data.find(b"\n", start, self.end)
        if end < 0:
            raise self.fail(Phrase("pickle-line-end"))
        if longest is not None and end - start > longest:
            raise self.fail(Phrase("pickle-line", most=longest, found=end - start))
        self.at = end + 1
        return start, end

    def word(self) -> bytes:
        """Read a line with a name or a number."""
        start, end = self.line()
        if self.data[start:end].endswith(b"\r"):
            raise self.damaged_line_ends()
        return self.data[start:end]

    def decimal(self, word: bytes) -> int:
        """Return a number of the text protocols, whose length has been checked."""
        if not _INTEGER.fullmatch(word):
            raise self.fail(Phrase("pickle-decimal", found=word))
        return int(word)

    def cut_short(self, wanted: int, found: int) -> FormatError:
        """Return the error for a length that exceeds the rest of the file."""
        return self.fail(Phrase("pickle-cut", expected=wanted, found=found))

    def damaged_line_ends(self) -> FormatError:
        """Return the error for a file damaged by a text-mode transfer."""
        return self.source.fault("F002.pickle-line-ends")

    # Methods of the stack.

    def push(self, value: object) -> None:
        """Push a value onto the stack."""
        self.stack.append(value)

    def top(self) -> object:
        """Return the topmost value."""
        if len(self.stack) <= self._floor:
            raise self.fail(Phrase("pickle-stack"))
        return self.stack[-1]

    def pop(self) -> object:
        """Pop the topmost value, but never one below a mark."""
        value = self.top()
        self.stack.pop()
        return value

    def mark(self) -> None:
        """Set a mark, the start of a list of values."""
        self._marks.append(self._floor)
        self._floor = len(self.stack)

    def pop_mark(self) -> list[object]:
        """Pop all values since the last mark, and the mark."""
        if not self._marks:
            raise self.fail(Phrase("pickle-mark"))
        values = self.stack[self._floor :]
        del self.stack[self._floor :]
        self._floor = self._marks.pop()
        return values

    def drop(self) -> None:
        """Pop the topmost value, or the last mark if there is no value above it."""
        if self._marks and len(self.stack) == self._floor:
            self.pop_mark()
        else:
            self.pop()

    # Methods of the memo.

    def remember(self, index: int) -> None:
        """Store the topmost value in the memo."""
        if index < 0:
            raise self.fail(Phrase("pickle-memo", found=index))
        self.memo[index] = self.top()

    def recall(self, index: int) -> None:
        """Push a value from the memo onto the stack."""
        if index not in self.memo:
            raise self.fail(Phrase("pickle-recall", found=index))
        self.stack.append(self.memo[index])


# Opcodes of pickles, protocols 0 to 5.
#
# They are named as in Python's ``pickletools``. Opcodes that reach outside the file are refused:
# extension codes, out-of-band buffers, and persistent ids except in files of torch. Names are
# resolved in ``names.py``.

_Step = Callable[[Machine], None]
_Result = TypeVar("_Result")
_STOP = ord(".")
_LAST_PROTOCOL = 5
_MAX_INTEGER = 1024  # maximum length in bytes
_LONGEST_NAME = 256
_FLOAT = re.compile(rb"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?|-?inf|-?nan")

# Escapes of Python 2's repr(). Others are refused, as Python's decoder warns about some of them.
_ODD_ESCAPE = re.compile(rb"\\(?!x[0-9a-fA-F]{2}|[nrt'\"])")


def run(machine: Machine) -> object:
    """Execute all opcodes up to STOP, and return the remaining value.

    Raises ``FormatError``: at the first opcode that is damaged or refused.
    """
    code = machine.next_step()
    while code != _STOP:
        step = _STEPS.get(code)
        if step is None:
            raise machine.fail(Phrase("pickle-step", found=bytes([code])))
        step(machine)
        code = machine.next_step()
    return machine.pop()


def _guarded(machine: Machine, action: Callable[[], _Result]) -> _Result:
    """Convert refusals of names, arguments and strings to errors that name the file."""
    try:
        return action()
    except UnicodeError:
        raise machine.fail(Phrase("pickle-bytes")) from None
    except InvalidValueError as problem:
        raise machine.source.fault("F002.pickle", problem=problem.problem) from None


def _constant(value: object) -> _Step:
    return lambda machine: machine.push(value)


def _integer(size: int, *, is_signed: bool = False) -> _Step:
    return lambda machine: machine.push(machine.number(size, is_signed=is_signed))


def _span(width: int, coding: str | None = None, *, is_signed: bool = False) -> _Step:
    return lambda machine: machine.push(machine.span(width, coding, is_signed=is_signed))


def _refused(found: Phrase) -> _Step:
    def refuse(machine: Machine) -> None:
        problem = Phrase("pickle-refused", found=found)
        raise machine.source.fault("F002.pickle", problem=problem)

    return refuse


# Numbers.


def _long_integer(width: int) -> _Step:
    def step(machine: Machine) -> None:
        size = machine.number(width, is_signed=width == 4)
        if not 0 <= size <= _MAX_INTEGER:
            raise machine.fail(Phrase("pickle-long", most=_MAX_INTEGER, found=size))
        machine.push(machine.number(size, is_signed=True))

    return step


def _decimal(machine: Machine) -> None:
    word = machine.word()
    # Protocol 1 has no other way to write True and False.
    truth = {b"00": False, b"01": True}.get(word)
    machine.push(machine.decimal(word) if truth is None else truth)


def _long_decimal(machine: Machine) -> None:
    machine.push(machine.decimal(machine.word().removesuffix(b"L")))


def _float_text(machine: Machine) -> None:
    word = machine.word()
    if not _FLOAT.fullmatch(word):
        raise machine.fail(Phrase("pickle-number", found=word))
    machine.push(float(word))


def _float(machine: Machine) -> None:
    machine.push(struct.unpack(">d", machine.data[machine.skip(8) : machine.at])[0])


# Strings.


def _quoted(machine: Machine) -> None:
    start, end = machine.line(None)
    text = machine.data[start:end]
    if text.endswith(b"\r"):
        raise machine.damaged_line_ends()
    if len(text) < 2 or text[:1] not in (b"'", b'"') or text[-1:] != text[:1]:
        raise machine.fail(Phrase("pickle-quotes", found=text))
    if b"\\" not in text:
        machine.push(Span(machine.data, start + 1, end - 1, "latin-1"))
        return
    # Pairs of backslashes are matched first, so that every other backslash begins an escape.
    if _ODD_ESCAPE.search(text[1:-1].replace(b"\\\\", b"..")):
        raise machine.fail(Phrase("pickle-escape"))
    data = codecs.escape_decode(text[1:-1])[0]
    machine.push(Span(data, 0, len(data), "latin-1"))


def _text_line(machine: Machine) -> None:
    machine.push(Span(machine.data, *machine.line(None), "raw-unicode-escape"))


# Containers.


def _tuple(count: int) -> _Step:
    def step(machine: Machine) -> None:
        values = [machine.pop() for _ in range(count)]
        machine.push(tuple(reversed(values)))

    return step


def _list_of(machine: Machine) -> list[object]:
    target = machine.top()
    if not isinstance(target, list):
        raise machine.fail(Phrase("pickle-list", found=noun(target)))
    return target


def _append(machine: Machine) -> None:
    value = machine.pop()
    _list_of(machine).append(value)


def _appends(machine: Machine) -> None:
    values = machine.pop_mark()
    _list_of(machine).extend(values)


def _put_pairs(machine: Machine, values: list[object]) -> None:
    target = machine.top()
    if not isinstance(target, dict):
        raise machine.fail(Phrase("pickle-dict", found=noun(target)))
    if len(values) % 2:
        raise machine.fail(Phrase("pickle-pairs"))
    keys = _guarded(machine, lambda: [names.as_key(key) for key in values[0::2]])
    target.update(zip(keys, values[1::2], strict=True))


def _set_item(machine: Machine) -> None:
    value = machine.pop()
    _put_pairs(machine, [machine.pop(), value])


def _set_items(machine: Machine) -> None:
    values = machine.pop_mark()
    _put_pairs(machine, values)


def _dict(machine: Machine) -> None:
    values = machine.pop_mark()
    machine.push({})
    _put_pairs(machine, values)


# Names and their uses.


def _find(machine: Machine, module: str, name: str) -> object:
    if module.endswith("\r") or name.endswith("\r"):
        raise machine.damaged_line_ends()
    return _guarded(machine, lambda: names.find(module, name))


def _global_line(machine: Machine) -> object:
    module, name = (machine.data[slice(*machine.line())].decode("utf-8", "replace") for _ in "mn")
    return _find(machine, module, name)


def _global(machine: Machine) -> None:
    machine.push(_global_line(machine))


def _stack_global(machine: Machine) -> None:
    parts = [machine.pop(), machine.pop()]
    texts = [part for part in parts if isinstance(part, Span) and len(part) <= _LONGEST_NAME]
    if len(texts) < len(parts):
        found = [noun(part) for part in parts]
        raise machine.fail(Phrase("pickle-names", module=found[1], name=found[0]))
    name, module = _guarded(machine, lambda: [text.text() for text in texts])
    machine.push(_find(machine, module, name))


def _persistent(machine: Machine) -> None:
    """Replace a persistent id by its value, if files of this kind define one."""
    found = machine.pop()
    if machine.persistent is None:
        _refused(Phrase("noun-persistent"))(machine)
        return
    ask = machine.persistent
    machine.push(_guarded(machine, lambda: ask(found)))


def _reduce(machine: Machine) -> None:
    arguments, function = machine.pop(), machine.pop()
    if isinstance(function, StandIn) and function.role == "torch-bytes":
        machine.push(_loaded_bytes(machine, function, arguments))
        return
    value, copied = _guarded(machine, lambda: names.call(function, arguments))
    machine.spend(copied)
    machine.push(value)


def _loaded_bytes(machine: Machine, function: StandIn, arguments: object) -> object:
    """Return the value that torch saved as bytes inside the pickle."""
    match arguments:
        case (Span(coding=None | "latin-1") as data,) if machine.load_bytes is not None:
            return machine.load_bytes(machine, data)
    found = [*map(noun, arguments)] if isinstance(arguments, tuple) else []
    problem = Phrase("pickle-arguments", name=function.name, found=found)
    raise machine.source.fault("F002.pickle", problem=problem)


def _create(machine: Machine, of: object, arguments: object) -> None:
    machine.push(_guarded(machine, lambda: names.create(of, arguments)))


def _new(machine: Machine) -> None:
    arguments, of = machine.pop(), machine.pop()
    _create(machine, of, arguments)


def _new_with_keywords(machine: Machine) -> None:
    keywords = machine.pop()
    if keywords != {}:
        raise machine.fail(Phrase("pickle-keywords", found=noun(keywords)))
    _new(machine)


def _instance(machine: Machine) -> None:
    of = _global_line(machine)
    _create(machine, of, tuple(machine.pop_mark()))


def _object(machine: Machine) -> None:
    of, *arguments = machine.pop_mark() or [None]
    _create(machine, of, tuple(arguments))


def _build(machine: Machine) -> None:
    state, target = machine.pop(), machine.top()
    _guarded(machine, lambda: names.build(target, state))
    if isinstance(target, Instance) and target.of.role == "joblib":
        machine.pop()
        machine.push(_guarded(machine, lambda: _take_array(machine, target, run)))


# Framing.


def _protocol(machine: Machine) -> None:
    protocol = machine.number(1)
    if protocol > _LAST_PROTOCOL:
        raise machine.fail(Phrase("pickle-protocol", found=protocol))


def _frame(machine: Machine) -> None:
    size = machine.number(8)
    if size > machine.end - machine.at:
        raise machine.cut_short(size, machine.end - machine.at)


# Arrays in joblib's pickles, whose bytes follow the wrapper that describes them.
#
# ::
#
#     array   = BUILD of a NumpyArrayWrapper, [n, n bytes of padding], the values
#     wrapper = {subclass, shape, order: "C" or "F", dtype, allow_mmap, numpy_array_alignment_bytes}
#
# Only files since joblib 1.1 have padding. An array of objects is a separate pickle.


def _take_array(machine: Machine, wrapper: Instance, run: Callable[[Machine], object]) -> object:
    """Return the array behind a wrapper, and skip its bytes."""
    state = wrapper.state or {}
    shape, dtype, order = state.get("shape"), state.get("dtype"), state.get("order")
    kind, padding = state.get("subclass"), state.get("numpy_array_alignment_bytes")
    is_usual = isinstance(kind, StandIn) and kind.role == "ndarray"
    if not is_usual or not is_sizes(shape) or not isinstance(dtype, Dtype):
        raise InvalidValueError(Phrase("joblib-wrapper", name=wrapper.of.name))
    if not isinstance(order, Span) or order.raw() not in (b"C", b"F"):
        raise InvalidValueError(Phrase("joblib-wrapper", name=wrapper.of.name))
    if dtype.code.startswith("O"):
        return _objects(machine, run)
    if padding is not None:
        machine.skip(machine.number(1))
    found = dtype.dtype()
    n_items = None if found is None else item_count(shape, found.itemsize)
    if found is None or n_items is None:
        # The size of the elements is unknown, and therefore also the position at which the pickle
        # continues.
        raise InvalidValueError(Phrase("joblib-dtype", dtype=dtype.what(), shape=shape))
    start = machine.skip(n_items * found.itemsize)
    array = Array()
    array.fill(shape, dtype, order.raw() == b"F", Span(machine.data, start, machine.at))
    return array


def _objects(machine: Machine, run: Callable[[Machine], object]) -> object:
    inner = machine.nested(machine.data, machine.at, machine.end)
    inner.load_bytes = machine.load_bytes
    found = run(inner)
    machine.at = inner.at
    machine.rejoin(inner)
    if not isinstance(found, Array):
        raise InvalidValueError(Phrase("joblib-objects"))
    return found


_STEPS: dict[int, _Step] = {
    # Numbers and constants
    ord("N"): _constant(None),
    0x88: _constant(True),
    0x89: _constant(False),
    ord("I"): _decimal,
    ord("L"): _long_decimal,
    ord("K"): _integer(1),
    ord("M"): _integer(2),
    ord("J"): _integer(4, is_signed=True),
    0x8A: _long_integer(1),
    0x8B: _long_integer(4),
    ord("F"): _float_text,
    ord("G"): _float,
    # Strings and bytes
    ord("S"): _quoted,
    ord("T"): _span(4, "latin-1", is_signed=True),
    ord("U"): _span(1, "latin-1"),
    ord("V"): _text_line,
    ord("X"): _span(4, "utf-8"),
    0x8C: _span(1, "utf-8"),
    0x8D: _span(8, "utf-8"),
    ord("B"): _span(4),
    ord("C"): _span(1),
    0x8E: _span(8),
    0x96: _span(8),  # BYTEARRAY8
    # Containers
    ord(")"): _constant(()),
    0x85: _tuple(1),
    0x86: _tuple(2),
    0x87: _tuple(3),
    ord("t"): lambda machine: machine.push(tuple(machine.pop_mark())),
    ord("]"): lambda machine: machine.push([]),
    ord("l"): lambda machine: machine.push(machine.pop_mark()),
    ord("a"): _append,
    ord("e"): _appends,
    ord("}"): lambda machine: machine.push({}),
    ord("d"): _dict,
    ord("s"): _set_item,
    ord("u"): _set_items,
    # Sets become lists, so that no hash of an item is computed
    0x8F: lambda machine: machine.push([]),
    0x90: _appends,
    0x91: lambda machine: machine.push(machine.pop_mark()),
    # Stack and memo
    ord("("): Machine.mark,
    ord("0"): Machine.drop,
    ord("1"): lambda machine: machine.pop_mark().clear(),
    ord("2"): lambda machine: machine.push(machine.top()),
    ord("p"): lambda machine: machine.remember(machine.decimal(machine.word())),
    ord("q"): lambda machine: machine.remember(machine.number(1)),
    ord("r"): lambda machine: machine.remember(machine.number(4)),
    0x94: lambda machine: machine.remember(len(machine.memo)),
    ord("g"): lambda machine: machine.recall(machine.decimal(machine.word())),
    ord("h"): lambda machine: machine.recall(machine.number(1)),
    ord("j"): lambda machine: machine.recall(machine.number(4)),
    # Names
    ord("c"): _global,
    0x93: _stack_global,
    ord("R"): _reduce,
    ord("b"): _build,
    ord("i"): _instance,
    ord("o"): _object,
    0x81: _new,
    0x92: _new_with_keywords,
    # Framing
    0x80: _protocol,
    0x95: _frame,
    # Opcodes that reach outside the file
    ord("P"): _refused(Phrase("noun-persistent")),
    ord("Q"): _persistent,
    0x82: _refused(Phrase("noun-extension")),
    0x83: _refused(Phrase("noun-extension")),
    0x84: _refused(Phrase("noun-extension")),
    0x97: _refused(Phrase("noun-buffer")),
    0x98: _refused(Phrase("noun-buffer")),
}
