"""Python's own unpickler, with other steps for all that a hostile file could misuse.

A pickle is a program for a stack machine. Containers, numbers, marks and the memo are those of
``pickle._Unpickler``, the unpickler in Python: it is not recursive, and its memo is a dict. The
steps that are replaced make strings and bytes (here ranges of the file), import names, call
functions, build objects, put keys into dicts, or reach outside the file. No length is trusted
before the bytes are known to exist, and a budget limits time and memory for any opcodes.

``pickle.Unpickler``, in C, cannot be bounded by ``find_class``: nine bytes with a large memo index
allocate 4 GB, and a megabyte of nested tuples as the key of a dict overflows the stack of the
process. Besides, it reads all arrays of a file, and cannot pause before those of joblib.
"""

from __future__ import annotations

import codecs
import pickle
import re
from collections.abc import Callable
from typing import Any

from viewer.diagnostics import Phrase, wording
from viewer.errors import FormatError
from viewer.formats._archive.values import item_count
from viewer.formats._archive.zip import Data
from viewer.formats._pickle import names
from viewer.formats._pickle.values import Array, Dtype, Instance, Span, StandIn, is_sizes, noun
from viewer.formats._source import InvalidValueError, Source
from viewer.phrases import axes, listed, quoted

# Maximum number of items; a body model needs a few hundred, a motion in plain lists about 100,000.
# Results of trackers, which write a dict per frame and person, need one for every eight bytes.
_MAX_STEPS = 1_000_000
_BYTES_PER_STEP = 4
_MOST_STEPS = 20_000_000
_DEEPEST = 3  # maximum nesting of pickles inside pickles; real files have two levels
_LONGEST_LINE = 256  # maximum number of characters of a name or number in the text protocols
_LAST_PROTOCOL = 5
_MAX_INTEGER = 1024  # maximum length in bytes
_LONGEST_NAME = 256
_STOP = ord(".")

# Escapes of Python 2's repr(). Others are refused, as Python's decoder warns about some of them.
_ODD_ESCAPE = re.compile(rb"\\(?!x[0-9a-fA-F]{2}|[nrt'\"])")

# Raised by the steps of the unpickler for values that do not fit.
_DAMAGE = (
    *(pickle.UnpicklingError, ValueError, TypeError, AttributeError),
    *(LookupError, OverflowError),
)


class Machine(pickle._Unpickler):
    """A pickle being read.

    ``data``: the file; ``at``: offset of the next byte; ``end``: end of the pickle's bytes;
    ``depth``: number of pickles that contain this one; ``persistent``, ``load_bytes``: return the
    value of a persistent id, and of torch's storages saved as bytes; None if the file must not
    contain these.
    """

    append: Callable[[object], None]
    stack: list[object]
    """Values since the last mark."""
    pop_mark: Callable[[], list[object]]

    def __init__(
        self, source: Source, data: Data | None = None, start: int = 0, end: int | None = None
    ) -> None:
        super().__init__(self)
        self.source, self.at = source, start
        self.data: Data = source.data if data is None else data
        self.end = len(self.data) if end is None else end
        self.depth = 0
        self.persistent: Callable[[object], object] | None = None
        self.load_bytes: Callable[[Machine, Span], object] | None = None
        self._most = max(_MAX_STEPS, min((self.end - start) // _BYTES_PER_STEP, _MOST_STEPS))
        self._budget = self._most
        self._step_at = 0

    def run(self) -> object:
        """Execute all opcodes up to STOP, and return the remaining value."""
        self.memo: dict[int, object] = {}
        self.metastack: list[list[object]] = []
        self.stack = []
        self.append = self.stack.append
        try:
            while (code := self.next_step()) != _STOP:
                step = _STEPS.get(code)
                if step is None:
                    raise self.fail(
                        "expected a pickle opcode, found {found}", found=quoted(bytes([code]))
                    )
                step(self)
            return self.stack.pop()
        except UnicodeError:
            raise self.fail(wording.PICKLE_BYTES) from None
        except InvalidValueError as problem:
            raise self.source.fault("F002.pickle: {problem}", problem=problem.problem) from None
        except _DAMAGE:
            raise self.misfit() from None

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
            raise self.fail(
                "expected at most {most} opcodes in a pickle, found more", most=self._most
            )

    def nested(self, data: Data, start: int, end: int) -> Machine:
        """Return a machine for a pickle inside this one; it continues with the same budget."""
        if self.depth >= _DEEPEST:
            raise self.fail("expected at most {most} nested pickles, found more", most=_DEEPEST)
        inner = Machine(self.source, data, start, end)
        inner.depth, inner._budget, inner._most = self.depth + 1, self._budget, self._most
        return inner

    def rejoin(self, inner: Machine) -> None:
        """Continue with the budget that a nested machine has left."""
        self._budget = inner._budget

    # Methods that read bytes; those without a docstring are called by the unpickler.

    def read(self, size: int) -> bytes:
        start = self.skip(size)
        return self.data[start : self.at]

    def readline(self) -> bytes:
        start, end = self.line()
        if self.data[start:end].endswith(b"\r"):
            raise self.damaged_line_ends()
        return self.data[start : self.at]

    def number(self, size: int, *, is_signed: bool = False) -> int:
        """Read an integer of ``size`` bytes, least significant first."""
        return int.from_bytes(self.read(size), "little", signed=is_signed)

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
            raise self.fail("expected the end of a line, found the end of the file (truncated?)")
        if longest is not None and end - start > longest:
            raise self.fail(
                "expected at most {most} characters in a line, found {found}",
                most=longest,
                found=end - start,
            )
        self.at = end + 1
        return start, end

    # Errors.

    def fail(self, problem: str, **values: object) -> FormatError:
        """Return an error with the offset of the current opcode."""
        found = Phrase(problem, **values)
        return self.source.fault(
            "F002.pickle-step: {problem} at byte {at}", problem=found, at=self._step_at
        )

    def misfit(self) -> FormatError:
        """Return the error for an opcode that does not fit the values before it."""
        return self.fail(
            "expected an opcode that fits the values before it, found {found}",
            found=quoted(bytes([self.data[self._step_at]])),
        )

    def cut_short(self, wanted: int, found: int) -> FormatError:
        """Return the error for a length that exceeds the rest of the file."""
        return self.fail(
            "expected {expected} more bytes, found {found} (truncated?)",
            expected=wanted,
            found=found,
        )

    def damaged_line_ends(self) -> FormatError:
        """Return the error for a file damaged by a text-mode transfer."""
        return self.source.fault(
            "F002.pickle-line-ends: expected a pickle, found Windows line endings: damaged in "
            "transfer, download it again in binary mode"
        )

    # What the unpickler would import, make or load.

    def find_class(self, module: str, name: str) -> StandIn:
        """Return a stand-in for a name, which is never imported."""
        return names.find(module, name)

    def persistent_load(self, pid: object) -> object:
        """Replace a persistent id by its value, if files of this kind define one."""
        if self.persistent is None:
            raise InvalidValueError(wording.PICKLE_REFUSED, found=Phrase("a persistent id"))
        return self.persistent(pid)

    def _instantiate(self, klass: object, args: list[object]) -> None:
        self.append(names.create(klass, tuple(args)))


_Step = Callable[[Machine], None]


def _span(width: int, coding: str | None = None, *, is_signed: bool = False) -> _Step:
    return lambda machine: machine.append(machine.span(width, coding, is_signed=is_signed))


def _refused(key: str) -> _Step:
    def refuse(machine: Machine) -> None:
        raise InvalidValueError(wording.PICKLE_REFUSED, found=Phrase(key))

    return refuse


def _protocol(machine: Machine) -> None:
    protocol = machine.number(1)
    if protocol > _LAST_PROTOCOL:
        raise machine.fail("expected pickle protocol 0 to 5, found {found}", found=protocol)


def _frame(machine: Machine) -> None:
    size = machine.number(8)
    if size > machine.end - machine.at:
        raise machine.cut_short(size, machine.end - machine.at)


def _long_integer(machine: Machine) -> None:
    size = machine.number(4, is_signed=True)
    if not 0 <= size <= _MAX_INTEGER:
        raise machine.fail(
            "expected an integer of at most {most} bytes, found {found}",
            most=_MAX_INTEGER,
            found=size,
        )
    machine.append(machine.number(size, is_signed=True))


def _quoted(machine: Machine) -> None:
    start, end = machine.line(None)
    text = machine.data[start:end]
    if text.endswith(b"\r"):
        raise machine.damaged_line_ends()
    if len(text) < 2 or text[:1] not in (b"'", b'"') or text[-1:] != text[:1]:
        raise machine.misfit()
    if b"\\" not in text:
        machine.append(Span(machine.data, start + 1, end - 1, "latin-1"))
        return
    # Pairs of backslashes are matched first, so that every other backslash begins an escape.
    if _ODD_ESCAPE.search(text[1:-1].replace(b"\\\\", b"..")):
        raise machine.fail("expected a string as written by Python 2, found an unknown escape")
    data = codecs.escape_decode(text[1:-1])[0]
    machine.append(Span(data, 0, len(data), "latin-1"))


def _text_line(machine: Machine) -> None:
    start, end = machine.line(None)
    machine.append(Span(machine.data, start, end, "raw-unicode-escape"))


def _put_pairs(machine: Machine, values: list[object]) -> None:
    target = machine.stack[-1]
    if not isinstance(target, dict) or len(values) % 2:
        raise machine.misfit()
    target.update(zip(map(names.as_key, values[0::2]), values[1::2], strict=True))


def _set_item(machine: Machine) -> None:
    value = machine.stack.pop()
    _put_pairs(machine, [machine.stack.pop(), value])


def _dict(machine: Machine) -> None:
    values = machine.pop_mark()
    machine.append({})
    _put_pairs(machine, values)


def _stack_global(machine: Machine) -> None:
    name, module = machine.stack.pop(), machine.stack.pop()
    if not isinstance(name, Span) or not isinstance(module, Span):
        raise machine.misfit()
    if max(len(name), len(module)) > _LONGEST_NAME:
        raise machine.misfit()
    machine.append(machine.find_class(module.text(), name.text()))


def _reduce(machine: Machine) -> None:
    arguments, function = machine.stack.pop(), machine.stack.pop()
    if isinstance(function, StandIn) and function.role == "torch-bytes":
        machine.append(_loaded_bytes(machine, function, arguments))
        return
    value, copied = names.call(function, arguments)
    machine.spend(copied)
    machine.append(value)


def _loaded_bytes(machine: Machine, function: StandIn, arguments: object) -> object:
    """Return the value that torch saved as bytes inside the pickle."""
    match arguments:
        case (Span(coding=None | "latin-1") as data,) if machine.load_bytes is not None:
            return machine.load_bytes(machine, data)
    found = [*map(noun, arguments)] if isinstance(arguments, tuple) else []
    raise InvalidValueError(wording.PICKLE_ARGUMENTS, name=function.name, found=listed(found))


def _new(machine: Machine) -> None:
    arguments, of = machine.stack.pop(), machine.stack.pop()
    machine.append(names.create(of, arguments))


def _instance(machine: Machine) -> None:
    _USUAL[ord("c")](machine)  # the usual step accepts ASCII names only
    of = machine.stack.pop()
    machine.append(names.create(of, tuple(machine.pop_mark())))


def _new_with_keywords(machine: Machine) -> None:
    if machine.stack.pop() != {}:
        raise machine.misfit()
    _new(machine)


def _build(machine: Machine) -> None:
    state, target = machine.stack.pop(), machine.stack[-1]
    names.build(target, state)
    if isinstance(target, Instance) and target.of.role == "joblib":
        machine.stack[-1] = _take_array(machine, target)


# Arrays in joblib's pickles, whose bytes follow the wrapper that describes them.
#
# ::
#
#     array   = BUILD of a NumpyArrayWrapper, [n, n bytes of padding], the values
#     wrapper = {subclass, shape, order: "C" or "F", dtype, allow_mmap, numpy_array_alignment_bytes}
#
# Only files since joblib 1.1 have padding. An array of objects is a separate pickle.


def _take_array(machine: Machine, wrapper: Instance) -> object:
    """Return the array behind a wrapper, and skip its bytes."""
    state = wrapper.state or {}
    shape, dtype, order = state.get("shape"), state.get("dtype"), state.get("order")
    kind, padding = state.get("subclass"), state.get("numpy_array_alignment_bytes")
    is_usual = isinstance(kind, StandIn) and kind.role == "ndarray"
    if not is_usual or not is_sizes(shape) or not isinstance(dtype, Dtype):
        raise InvalidValueError(wording.JOBLIB_WRAPPER, name=wrapper.of.name)
    if not isinstance(order, Span) or order.raw() not in (b"C", b"F"):
        raise InvalidValueError(wording.JOBLIB_WRAPPER, name=wrapper.of.name)
    if dtype.code.startswith("O"):
        inner = machine.nested(machine.data, machine.at, machine.end)
        inner.load_bytes = machine.load_bytes
        found = inner.run()
        machine.at = inner.at
        machine.rejoin(inner)
        if not isinstance(found, Array):
            raise InvalidValueError("expected an array of objects, found a different value")
        return found
    if padding is not None:
        machine.skip(machine.number(1))
    found = dtype.dtype()
    n_items = None if found is None else item_count(shape, found.itemsize)
    if found is None or n_items is None:
        # The size of the elements is unknown, and therefore also the position at which the pickle
        # continues.
        raise InvalidValueError(
            "expected an array of numbers or strings, found {shape} of {dtype}",
            dtype=dtype.what(),
            shape=axes(shape),
        )
    start = machine.skip(n_items * found.itemsize)
    array = Array()
    array.fill(shape, dtype, order.raw() == b"F", Span(machine.data, start, machine.at))
    return array


_USUAL: dict[int, Callable[[Any], None]] = {**pickle._Unpickler.dispatch}
_STEPS: dict[int, Callable[[Any], None]] = {
    **_USUAL,
    0x80: _protocol,
    0x95: _frame,
    0x8B: _long_integer,
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
    # Dicts, and sets, which become lists, so that no hash of an item is computed
    ord("d"): _dict,
    ord("s"): _set_item,
    ord("u"): lambda machine: _put_pairs(machine, machine.pop_mark()),
    0x8F: _USUAL[ord("]")],
    0x90: _USUAL[ord("e")],
    0x91: _USUAL[ord("l")],
    # Names and their uses
    0x93: _stack_global,
    ord("R"): _reduce,
    ord("b"): _build,
    ord("i"): _instance,
    0x81: _new,
    0x92: _new_with_keywords,
    # Opcodes that reach outside the file
    ord("P"): _refused("a persistent id"),
    **dict.fromkeys((0x82, 0x83, 0x84), _refused("an extension code")),
    **dict.fromkeys((0x97, 0x98), _refused("an out-of-band buffer")),
}
