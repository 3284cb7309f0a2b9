"""Pickles that attack: each gives one line, and nothing of theirs is run, written or allocated."""

from __future__ import annotations

import pickle
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from pickle_bytes import (
    array,
    created,
    element_type,
    empty_array,
    mapping,
    matrix,
    named,
    opened,
    refusal,
    saved,
    several,
    shape,
    text,
    unicode,
    whole,
)

from viewer.formats._archive import Opaque

DAMAGED = (
    "expected a pickle, found Windows line ends: damaged in transfer, "
    "download it again in binary mode"
)
FORBIDDEN = "which is not allowed; nothing was executed"


@pytest.fixture(autouse=True)
def marker(tmp_path: Path) -> Iterator[Path]:
    """A file that every attack here would write."""
    path = tmp_path / "marker"
    yield path
    assert not path.exists()


def reduced(module: str, name: str, *arguments: bytes) -> bytes:
    return named(module, name) + several(*arguments) + b"R"


def written(marker: Path) -> str:
    return f"__import__('pathlib').Path({str(marker)!r}).touch()"


def test_attacks_of_this_file_work_where_they_are_not_refused(tmp_path: Path) -> None:
    path = tmp_path / "proof"
    pickle.loads(saved(v=reduced("builtins", "eval", text(written(path)))))
    assert path.exists()


@pytest.mark.parametrize(
    ("module", "name"),
    [
        ("os", "system"),
        ("posix", "system"),
        ("nt", "system"),
        ("subprocess", "Popen"),
        ("builtins", "eval"),
        ("builtins", "exec"),
        ("__builtin__", "eval"),
        ("__builtin__", "execfile"),
        ("builtins", "getattr"),
        ("builtins", "__import__"),
        ("builtins", "open"),
        ("builtins", "bytearray"),
        ("operator", "attrgetter"),
        ("functools", "partial"),
        ("importlib", "import_module"),
        ("pickle", "loads"),
        ("numpy.testing", "runstring"),
        ("numpy.testing._private.utils", "runstring"),
        ("numpy.f2py.crackfortran", "myeval"),
        ("numpy", "load"),
        ("numpy", "fromfile"),
        ("numpy", "memmap"),
        ("numpy", "core"),
        ("numpy.core.multiarray", "fromfile"),
        ("numpy.core.multiarray", "ndarray"),
        ("scipy.sparse.csc", "os"),
        ("chumpy.ch", "os"),
        ("collections", "defaultdict"),
        ("copy_reg", "add_extension"),
        ("_codecs", "decode"),
        ("_codecs", "register"),
        # Look-alikes of what is allowed
        ("numpy.core.multiarray ", "_reconstruct"),
        (" numpy", "ndarray"),
        ("Numpy", "ndarray"),
        ("numpy", "Ndarray"),
        ("numpy", "ndarray.__class__"),
        ("numpy", "dtype "),
        ("numpy", "_core._methods.os.system"),
        ("numpy._core._methods", "os.system"),
        ("nump\u0443", "ndarray"),  # a Cyrillic letter
        ("numpy\u200b", "ndarray"),
        ("", ""),
        ("numpy.ndarray", ""),
    ],
)
def test_names_outside_the_table(module: str, name: str, marker: Path) -> None:
    from viewer.errors import printable

    argument = text(written(marker))
    shown = printable(f"{module}.{name}")
    line = f'expected arrays and plain data, found the global "{shown}", {FORBIDDEN}'
    stack_name = unicode(module) + unicode(name) + b"\x93"
    bodies = {
        "reduce": reduced(module, name, argument),
        "stack": stack_name + several(argument) + b"R",
        "new": named(module, name) + several(argument) + b"\x81",
        "keywords": stack_name + several(argument) + b"}\x92",
        "object": b"(" + named(module, name) + argument + b"o",
        "instance": b"(" + argument + b"i" + named(module, name)[1:],
        "uncalled": named(module, name),
        "nested": array(np.ones(2)).replace(whole(1), reduced(module, name, argument), 1),
    }
    for kind, body in bodies.items():
        assert refusal(saved(good=array(np.ones(2)), v=body)) == line, kind
    assert refusal(b"(dp0\nS'v'\n" + bodies["reduce"] + b"s.") == line


NDARRAY = named("numpy", "ndarray")
CODE = text("f8")


@pytest.mark.parametrize(
    ("body", "line"),
    [
        (NDARRAY + several(shape(1 << 40)) + b"R", "a call of numpy.ndarray"),
        (named("__builtin__", "object") + b")R", "a call of __builtin__.object"),
        (text("x") + several() + b"R", "a call of a text"),
        (array(np.ones(1)) + several() + b"R", "a call of an array"),
        (reduced("__builtin__", "set") + b")R", "a call of a list"),
        (named("chumpy.ch", "Ch") + b")R", "a call of chumpy.ch.Ch"),
    ],
)
def test_calls_of_what_is_no_function(body: bytes, line: str) -> None:
    assert refusal(saved(v=body)) == f"expected a call of a known function, found {line}"


RECONSTRUCT = ("numpy.core.multiarray", "_reconstruct")


@pytest.mark.parametrize(
    ("module", "name", "arguments", "found"),
    [
        (*RECONSTRUCT, [NDARRAY, shape(1 << 40), text("b")], "numpy.ndarray, a tuple, a text"),
        (*RECONSTRUCT, [NDARRAY, shape(0), text("c")], "numpy.ndarray, a tuple, a text"),
        (
            *RECONSTRUCT,
            [named("numpy", "dtype"), shape(0), text("b")],
            "numpy.dtype, a tuple, a text",
        ),
        (*RECONSTRUCT, [NDARRAY], "numpy.ndarray"),
        ("numpy", "dtype", [b"]", whole(0), whole(1)], "a list, a number, a number"),
        ("numpy", "dtype", [CODE, whole(0), whole(2)], "a text, a number, a number"),
        ("numpy", "dtype", [text("x" * 33), whole(0), whole(1)], "a text, a number, a number"),
        ("_codecs", "encode", [unicode("b"), text("rot13")], "a text, a text"),
        ("_codecs", "encode", [unicode("b"), text("latin1"), text("x")], "a text, a text, a text"),
        ("_codecs", "encode", [whole(1), text("latin1")], "a number, a text"),
        ("__builtin__", "bytes", [whole(1 << 30)], "a number"),
        ("__builtin__", "set", [whole(1)], "a number"),
        ("collections", "OrderedDict", [b"](" + whole(1) + b"e"], "a list"),
        (
            "copy_reg",
            "_reconstructor",
            [NDARRAY, NDARRAY, b"N"],
            "numpy.ndarray, numpy.ndarray, nothing",
        ),
        (
            "copy_reg",
            "_reconstructor",
            [named("chumpy.ch", "Ch"), named("__builtin__", "object"), whole(1)],
            "chumpy.ch.Ch, __builtin__.object, a number",
        ),
        (
            "copy_reg",
            "_reconstructor",
            [named("__builtin__", "set"), named("__builtin__", "object"), b"N"],
            "__builtin__.set, __builtin__.object, nothing",
        ),
        (
            "numpy.core.numeric",
            "_frombuffer",
            [text("x" * 8), element_type(), shape(1), text("A")],
            "a text, a dtype, a tuple, a text",
        ),
        (
            "numpy.core.numeric",
            "_frombuffer",
            [text("x" * 8), element_type(), shape(1), text("K"), shape(1)],
            "a text, a dtype, a tuple, a text, a tuple",
        ),
        ("numpy.core.multiarray", "scalar", [element_type(), whole(1)], "a dtype, a number"),
        ("numpy.core.multiarray", "scalar", [text("f8"), text("x" * 8)], "a text, a text"),
    ],
)
def test_unusual_arguments(module: str, name: str, arguments: list[bytes], found: str) -> None:
    line = refusal(saved(v=reduced(module, name, *arguments)))
    assert line == f"expected the usual arguments of {module}.{name}, found ({found})"


@pytest.mark.parametrize(
    ("body", "found"),
    [
        (named("chumpy.ch", "Ch") + several(whole(1)) + b"\x81", "chumpy.ch.Ch"),
        (NDARRAY + b")\x81", "numpy.ndarray"),
        (NDARRAY + b")}\x92", "numpy.ndarray"),
        (b"(" + named("numpy", "dtype") + CODE + b"o", "numpy.dtype"),
        (b"(o", "nothing"),
        (b"(icollections\nOrderedDict\n", "collections.OrderedDict"),
        (b"])\x81", "a list"),
    ],
)
def test_new_objects_of_other_classes(body: bytes, found: str) -> None:
    assert refusal(saved(v=body)) == f"expected a new object of a known class, found {found}"


MATRIX = "scipy.sparse.csc", "csc_matrix"
SLOTS = several(b"N", mapping(toarray=whole(1)))


@pytest.mark.parametrize(
    ("body", "line"),
    [
        (
            named(*MATRIX) + SLOTS + b"b",
            "an object that takes a state, found scipy.sparse.csc.csc_matrix",
        ),
        (NDARRAY + SLOTS + b"b", "an object that takes a state, found numpy.ndarray"),
        (b"]" + mapping(append=whole(1)) + b"b", "an object that takes a state, found a list"),
        (b"}" + mapping(a=whole(1)) + b"b", "an object that takes a state, found a dict"),
        (
            named(*MATRIX) + b")\x81" + SLOTS + b"b",
            "a dict as state of scipy.sparse.csc.csc_matrix, found a tuple",
        ),
        (named("chumpy.ch", "Ch") + b")\x81]b", "a dict as state of chumpy.ch.Ch, found a list"),
        (empty_array() + b"}b", "the state of an array, found a dict"),
        (empty_array() + several(whole(1)) + b"b", "the state of an array, found a tuple"),
        (
            empty_array() + several(whole(1), shape(1), element_type(), whole(0), b"]") + b"b",
            "the state of an array, found a tuple",
        ),
        (
            empty_array() + several(whole(1), shape(-1), element_type(), whole(0), CODE) + b"b",
            "the state of an array, found a tuple",
        ),
        (element_type() + b"}b", "the state of an element type, found a dict"),
        (element_type(order="?"), "the byte order of an array, found a text"),
        (element_type("S4", "|", size=1 << 30), "the state of an element type, found a tuple"),
    ],
)
def test_states_that_nobody_writes(body: bytes, line: str) -> None:
    assert refusal(saved(v=body)) == f"expected {line}"


def test_states_set_no_attribute(monkeypatch: pytest.MonkeyPatch) -> None:
    state = mapping(
        x=array(np.ones(2)),
        __class__=whole(1),
        __setstate__=whole(2),
        __reduce__=whole(3),
        of=whole(4),
        role=whole(5),
        values=whole(6),
    )
    data = saved(a=created("chumpy.ch", "Ch", state), b=created("chumpy.ch", "Ch", b"}"))
    archive = opened(data)
    assert archive.array("a").values().tolist() == [1, 1]
    assert archive.get("b") == Opaque("chumpy.ch.Ch without values")


def test_one_load_leaves_nothing_for_the_next() -> None:
    refusal(saved(v=named(*MATRIX) + mapping(role=text("x")) + b"b"))
    assert opened(saved(v=matrix())).sparse("v").shape == (2, 3)


@pytest.mark.parametrize(
    ("body", "found"),
    [
        (b"Pos.system\n", "a persistent id"),
        (text("x") + b"Q", "a persistent id"),
        (b"\x82\x01", "an extension code"),
        (b"\x83\x01\x01", "an extension code"),
        (b"\x84\x01\x01\x01\x01", "an extension code"),
        (b"\x97", "an out-of-band buffer"),
        (b"\x98", "an out-of-band buffer"),
    ],
)
def test_steps_that_reach_outside(body: bytes, found: str) -> None:
    assert refusal(saved(v=body)) == f"expected arrays and plain data, found {found}, {FORBIDDEN}"


@pytest.mark.parametrize(
    ("body", "line"),
    [
        (
            b"B\xff\xff\xff\x7f",
            "expected 2147483647 more bytes, found 2 (a file cut short?) at byte 7",
        ),
        (b"T\xff\xff\xff\xff", "expected -1 more bytes, found 2 (a file cut short?) at byte 7"),
        (
            b"X\xff\xff\xff\xff",
            "expected 4294967295 more bytes, found 2 (a file cut short?) at byte 7",
        ),
        (
            b"\x8e" + b"\xff" * 8,
            "expected 18446744073709551615 more bytes, found 2 (a file cut short?) at byte 7",
        ),
        (
            b"\x96" + b"\0" * 7 + b"\x7f",
            "expected 9151314442816847872 more bytes, found 2 (a file cut short?) at byte 7",
        ),
        (
            b"\x95" + b"\xff" * 8,
            "expected 18446744073709551615 more bytes, found 2 (a file cut short?) at byte 7",
        ),
        (b"\x80\x06", "expected a pickle of protocol 0 to 5, found 6 at byte 7"),
        (
            b"\x8b\xff\xff\xff\x00",
            "expected a number of at most 1024 bytes, found 16777215 at byte 7",
        ),
        (b"\x8b\xff\xff\xff\xff", "expected a number of at most 1024 bytes, found -1 at byte 7"),
        (b"I1_0\n", 'expected a whole number, found "1_0" at byte 7'),
        (b"I0x10\n", 'expected a whole number, found "0x10" at byte 7'),
        (b"L12LL\n", 'expected a whole number, found "12L" at byte 7'),
        (
            b"I" + b"9" * 1_000_000 + b"\n",
            "expected at most 256 letters in a line, found 1000000 at byte 7",
        ),
        (
            b"L" + b"9" * 1_000_000 + b"L\n",
            "expected at most 256 letters in a line, found 1000001 at byte 7",
        ),
        (b"F1e5_0\n", 'expected a number, found "1e5_0" at byte 7'),
        (b"S'a\n", 'expected a text in quotes, found "\'a" at byte 7'),
        (
            b"S'\\N{BELL}'\n",
            "expected a text as Python 2 writes it, found another escape at byte 7",
        ),
        (b"S'\\777'\n", "expected a text as Python 2 writes it, found another escape at byte 7"),
        (
            b"S'\\x4\\\\1'\n",
            "expected a text as Python 2 writes it, found another escape at byte 7",
        ),
        (b"S'\\'\n", "expected a text as Python 2 writes it, found another escape at byte 7"),
        (b"Iwhere", "expected the end of a line, found the end of the file (cut short?) at byte 7"),
        (b"h\x07", "expected a value remembered before, found number 7 at byte 7"),
        (b"g99\n", "expected a value remembered before, found number 99 at byte 7"),
        (b"Np-1\n", "expected a number from 0 on, found -1 at byte 8"),
        (b"0" * 9, "expected a value on the stack, found none at byte 9"),
        (b"(R", "expected a value on the stack, found none at byte 8"),
        (b"t1", "expected a mark on the stack, found none at byte 7"),
        (b"Na", "expected a list to add to, found a text at byte 8"),
        (b"(NNu", "expected a dict to add to, found a text at byte 10"),
        (b"(NNNd", "expected keys with values, found a key without at byte 11"),
        (b"\xffx", 'expected a step of a pickle, found "\ufffd" at byte 7'),
        (b"NN\x93", "expected short names, found nothing and nothing at byte 9"),
        (b")}N\x92", "expected no arguments with names, found nothing at byte 10"),
        (
            b"cnumpy\r\nndarray\r\n",
            DAMAGED,
        ),
        (
            b"I1\r\n",
            DAMAGED,
        ),
        (
            b"S'a'\r\n",
            DAMAGED,
        ),
    ],
    ids=lambda value: repr(value[:12]),
)
def test_damage(body: bytes, line: str) -> None:
    assert refusal(b"\x80\x02}" + text("vv") + body + b"s.") == line
