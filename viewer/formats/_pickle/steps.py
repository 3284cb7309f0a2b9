r"""Opcodes of pickles, protocols 0 to 5.

They are named as in Python's ``pickletools``. Opcodes that reach outside the file are refused:
extension codes, out-of-band buffers, and persistent ids except in files of torch. Names are
resolved in ``names.py``.
"""

from __future__ import annotations

import codecs
import re
import struct
from collections.abc import Callable
from typing import TypeVar

from viewer.diagnostics import Phrase
from viewer.formats._misfit import MisfitError
from viewer.formats._pickle import names as names
from viewer.formats._pickle.joblib_arrays import take_array
from viewer.formats._pickle.machine import Machine
from viewer.formats._pickle.values import Instance, Span, StandIn, noun

__all__ = ["run"]

Step = Callable[[Machine], None]
Result = TypeVar("Result")

_STOP = ord(".")
_LAST_PROTOCOL = 5
_MAX_INTEGER = 1024  # maximum length in bytes
_LONGEST_NAME = 256
_FLOAT = re.compile(rb"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?|-?inf|-?nan")
# Escapes of Python 2's repr(). Others are refused, as Python's decoder warns about some of them.
_ODD_ESCAPE = re.compile(rb"\\(?!x[0-9a-fA-F]{2}|[nrt'\"])")


def run(machine: Machine) -> object:
    """Execute all opcodes up to STOP, and return the remaining value.

    Raises
    ------
    FormatError
        At the first opcode that is damaged or refused.
    """
    code = machine.next_step()
    while code != _STOP:
        step = _STEPS.get(code)
        if step is None:
            raise machine.fail(Phrase("pickle-step", found=bytes([code])))
        step(machine)
        code = machine.next_step()
    return machine.pop()


def _guarded(machine: Machine, action: Callable[[], Result]) -> Result:
    """Convert refusals of names, arguments and strings to errors that name the file."""
    try:
        return action()
    except UnicodeError:
        raise machine.fail(Phrase("pickle-bytes")) from None
    except MisfitError as problem:
        raise machine.source.fault("F002.pickle", problem=problem.problem) from None


def _constant(value: object) -> Step:
    return lambda machine: machine.push(value)


def _integer(size: int, *, is_signed: bool = False) -> Step:
    return lambda machine: machine.push(machine.number(size, is_signed=is_signed))


def _span(width: int, coding: str | None = None, *, is_signed: bool = False) -> Step:
    return lambda machine: machine.push(machine.span(width, coding, is_signed=is_signed))


def _refused(found: Phrase) -> Step:
    def refuse(machine: Machine) -> None:
        problem = Phrase("pickle-refused", found=found)
        raise machine.source.fault("F002.pickle", problem=problem)

    return refuse


# Numbers.


def _long_integer(width: int) -> Step:
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


def _tuple(count: int) -> Step:
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
        machine.push(_guarded(machine, lambda: take_array(machine, target, run)))


# Framing.


def _protocol(machine: Machine) -> None:
    protocol = machine.number(1)
    if protocol > _LAST_PROTOCOL:
        raise machine.fail(Phrase("pickle-protocol", found=protocol))


def _frame(machine: Machine) -> None:
    size = machine.number(8)
    if size > machine.end - machine.at:
        raise machine.cut_short(size, machine.end - machine.at)


_STEPS: dict[int, Step] = {
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
