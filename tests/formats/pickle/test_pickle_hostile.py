"""Malicious pickles, which are refused in one line without execution, writing or allocation."""

import pickle
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from formats.pickle_bytes import (
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

from viewer.diagnostics import Phrase
from viewer.formats._archive.values import Opaque
from viewer.phrases import printable

DAMAGED = (
    "expected a pickle, found Windows line endings: damaged in transfer, download it "
    "again in binary mode"
)
FORBIDDEN = "which is not allowed; nothing was executed"


@pytest.fixture(autouse=True)
def marker(tmp_path: Path) -> Iterator[Path]:
    """A file that every attack writes if it succeeds."""
    path = tmp_path / "marker"
    yield path
    assert not path.exists()


def reduced(module: str, name: str, *arguments: bytes) -> bytes:
    return named(module, name) + several(*arguments) + b"R"


def written(marker: Path) -> str:
    return f"__import__('pathlib').Path({str(marker)!r}).touch()"


def test_attacks_in_this_file_work_with_the_standard_unpickler(tmp_path):
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
        ("copy_reg", "add_extension"),
        ("_codecs", "decode"),
        ("_codecs", "register"),
        # Names similar to allowed ones
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
def test_globals_outside_the_table_are_refused(module, name, marker):
    argument = text(written(marker))
    problem = Phrase(
        'expected arrays and plain data, found the global "{name}", which is not allowed; '
        "nothing was executed",
        name=printable(f"{module}.{name}"),
    )
    fault = ("F002.pickle", None, {"problem": problem})
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
        assert refusal(saved(good=array(np.ones(2)), v=body)) == fault, kind
    assert refusal(b"(dp0\nS'v'\n" + bodies["reduce"] + b"s.") == fault


NDARRAY = named("numpy", "ndarray")
CODE = text("f8")


@pytest.mark.parametrize(
    ("body", "line"),
    [
        (NDARRAY + several(shape(1 << 40)) + b"R", ("F002.pickle", None,
         {"problem": ("expected a call of a known function, found a call of "
        "numpy.ndarray")})),
        (named("__builtin__", "object") + b")R", ("F002.pickle", None,
         {"problem": ("expected a call of a known function, found a call of "
        "__builtin__.object")})),
        (text("x") + several() + b"R", ("F002.pickle", None,
         {"problem": ("expected a call of a known function, found a call of a "
        "string")})),
        (array(np.ones(1)) + several() + b"R", ("F002.pickle", None,
         {"problem": ("expected a call of a known function, found a call of an "
        "array")})),
        (reduced("__builtin__", "set") + b")R", ("F002.pickle", None,
         {"problem": "expected a call of a known function, found a call of a list"})),
        (named("chumpy.ch", "Ch") + b")R", ("F002.pickle", None,
         {"problem": ("expected a call of a known function, found a call of "
        "chumpy.ch.Ch")})),
    ],
)  # fmt: skip
def test_calls_of_non_functions_are_refused(body, line):
    assert refusal(saved(v=body)) == line


RECONSTRUCT = ("numpy.core.multiarray", "_reconstruct")


@pytest.mark.parametrize(
    ("module", "name", "arguments", "found"),
    [
        (*RECONSTRUCT, [NDARRAY, shape(1 << 40), text("b")], "numpy.ndarray, a tuple, a string"),
        (*RECONSTRUCT, [NDARRAY, shape(0), text("c")], "numpy.ndarray, a tuple, a string"),
        (*RECONSTRUCT, [named("numpy", "dtype"), shape(0), text("b")],
         "numpy.dtype, a tuple, a string"),
        (*RECONSTRUCT, [NDARRAY], "numpy.ndarray"),
        ("numpy", "dtype", [b"]", whole(0), whole(1)], "a list, a number, a number"),
        ("numpy", "dtype", [CODE, whole(0), whole(2)], "a string, a number, a number"),
        ("numpy", "dtype", [text("x" * 33), whole(0), whole(1)], "a string, a number, a number"),
        ("_codecs", "encode", [unicode("b"), text("rot13")], "a string, a string"),
        ("_codecs", "encode", [unicode("b"), text("latin1"), text("x")], (
            "a string, a string, a string"
        )),
        ("_codecs", "encode", [whole(1), text("latin1")], "a number, a string"),
        ("__builtin__", "bytes", [whole(1 << 30)], "a number"),
        ("__builtin__", "set", [whole(1)], "a number"),
        ("collections", "OrderedDict", [b"](" + whole(1) + b"e"], "a list"),
        ("copy_reg", "_reconstructor", [NDARRAY, NDARRAY, b"N"],
         "numpy.ndarray, numpy.ndarray, None"),
        ("copy_reg", "_reconstructor", [named("chumpy.ch", "Ch"), named("__builtin__", "object"),
         whole(1)], "chumpy.ch.Ch, __builtin__.object, a number"),
        ("copy_reg", "_reconstructor", [named("__builtin__", "set"), named("__builtin__",
         "object"), b"N"], "__builtin__.set, __builtin__.object, None"),
        ("numpy.core.numeric", "_frombuffer", [text("x" * 8), element_type(), shape(1),
         text("A")], "a string, a dtype, a tuple, a string"),
        ("numpy.core.numeric", "_frombuffer", [text("x" * 8), element_type(), shape(1), text("K"),
         shape(1)], "a string, a dtype, a tuple, a string, a tuple"),
        ("numpy.core.multiarray", "scalar", [element_type(), whole(1)], "a dtype, a number"),
        ("numpy.core.multiarray", "scalar", [text("f8"), text("x" * 8)], "a string, a string"),
    ],
)  # fmt: skip
def test_unusual_arguments_are_refused(module, name, arguments, found):
    key, _, values = refusal(saved(v=reduced(module, name, *arguments)))
    problem = values["problem"]
    assert (key, problem.sentence) == (
        "F002.pickle",
        "expected the usual arguments of {name}, found ({found})",
    )
    assert problem.values["name"] == f"{module}.{name}"
    assert ", ".join(map(str, problem.values["found"])) == found


@pytest.mark.parametrize(
    ("body", "found"),
    [
        (named("chumpy.ch", "Ch") + several(whole(1)) + b"\x81", ("F002.pickle", None,
         {"problem": ("expected a new instance of a known class, found "
        "chumpy.ch.Ch")})),
        (NDARRAY + b")\x81", ("F002.pickle", None,
         {"problem": ("expected a new instance of a known class, found "
        "numpy.ndarray")})),
        (NDARRAY + b")}\x92", ("F002.pickle", None,
         {"problem": ("expected a new instance of a known class, found "
        "numpy.ndarray")})),
        (b"(" + named("numpy", "dtype") + CODE + b"o", ("F002.pickle", None,
         {"problem": "expected a new instance of a known class, found numpy.dtype"})),
        (b"(icollections\nOrderedDict\n", ("F002.pickle", None,
         {"problem": ("expected a new instance of a known class, found "
        "collections.OrderedDict")})),
        (b"])\x81", ("F002.pickle", None,
         {"problem": "expected a new instance of a known class, found a list"})),
    ],
)  # fmt: skip
def test_new_objects_of_other_classes_are_refused(body, found):
    assert refusal(saved(v=body)) == found


MATRIX = "scipy.sparse.csc", "csc_matrix"
SLOTS = several(b"N", mapping(toarray=whole(1)))


@pytest.mark.parametrize(
    ("body", "line"),
    [
        (named(*MATRIX) + SLOTS + b"b", ("F002.pickle", None,
         {"problem": ("expected an object that accepts a state, found "
        "scipy.sparse.csc.csc_matrix")})),
        (NDARRAY + SLOTS + b"b", ("F002.pickle", None,
         {"problem": ("expected an object that accepts a state, found "
        "numpy.ndarray")})),
        (b"]" + mapping(append=whole(1)) + b"b", ("F002.pickle", None,
         {"problem": "expected an object that accepts a state, found a list"})),
        (b"}" + mapping(a=whole(1)) + b"b", ("F002.pickle", None,
         {"problem": "expected an object that accepts a state, found a dict"})),
        (named(*MATRIX) + b")\x81" + SLOTS + b"b", ("F002.pickle", None,
         {"problem": ("expected a dict as the state of "
        "scipy.sparse.csc.csc_matrix, found a tuple")})),
        (named("chumpy.ch", "Ch") + b")\x81]b", ("F002.pickle", None,
         {"problem": "expected a dict as the state of chumpy.ch.Ch, found a list"})),
        (empty_array() + b"}b", ("F002.pickle", None,
         {"problem": "expected the state of an array, found a dict"})),
        (empty_array() + several(whole(1)) + b"b", ("F002.pickle", None,
         {"problem": "expected the state of an array, found a tuple"})),
        (empty_array() + several(whole(1), shape(1), element_type(), whole(0), b"]") + b"b",
         ("F002.pickle", None, {"problem": "expected the state of an array, found a tuple"})),
        (empty_array() + several(whole(1), shape(-1), element_type(), whole(0), CODE) + b"b",
         ("F002.pickle", None, {"problem": "expected the state of an array, found a tuple"})),
        (element_type() + b"}b", ("F002.pickle", None,
         {"problem": "expected the state of a dtype, found a dict"})),
        (element_type(order="?"), ("F002.pickle", None,
         {"problem": "expected the byte order of an array, found a string"})),
        (element_type("S4", "|", size=1 << 30), ("F002.pickle", None,
         {"problem": "expected the state of a dtype, found a tuple"})),
    ],
)  # fmt: skip
def test_malformed_states_are_refused(body, line):
    assert refusal(saved(v=body)) == line


def test_states_set_no_attributes_of_objects(monkeypatch):
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


def test_pickles_share_no_state():
    refusal(saved(v=named(*MATRIX) + mapping(role=text("x")) + b"b"))
    assert opened(saved(v=matrix())).sparse("v").shape == (2, 3)


@pytest.mark.parametrize(
    ("body", "found"),
    [
        (b"Pos.system\n", ("F002.pickle", None,
         {"problem": ("expected arrays and plain data, found a persistent id, "
        "which is not allowed; nothing was executed")})),
        (text("x") + b"Q", ("F002.pickle", None,
         {"problem": ("expected arrays and plain data, found a persistent id, "
        "which is not allowed; nothing was executed")})),
        (b"\x82\x01", ("F002.pickle", None,
         {"problem": ("expected arrays and plain data, found an extension code, "
        "which is not allowed; nothing was executed")})),
        (b"\x83\x01\x01", ("F002.pickle", None,
         {"problem": ("expected arrays and plain data, found an extension code, "
        "which is not allowed; nothing was executed")})),
        (b"\x84\x01\x01\x01\x01", ("F002.pickle", None,
         {"problem": ("expected arrays and plain data, found an extension code, "
        "which is not allowed; nothing was executed")})),
        (b"\x97", ("F002.pickle", None,
         {"problem": ("expected arrays and plain data, found an out-of-band "
        "buffer, which is not allowed; nothing was executed")})),
        (b"\x98", ("F002.pickle", None,
         {"problem": ("expected arrays and plain data, found an out-of-band "
        "buffer, which is not allowed; nothing was executed")})),
    ],
)  # fmt: skip
def test_opcodes_with_out_of_range_references_are_refused(body, found):
    assert refusal(saved(v=body)) == found


@pytest.mark.parametrize(
    ("body", "line"),
    [
        (b"B\xff\xff\xff\x7f", ("F002.pickle-step", None,
         {"problem": "expected 2147483647 more bytes, found 2 (truncated?)", "at": 7})),
        (b"T\xff\xff\xff\xff", ("F002.pickle-step", None,
         {"problem": "expected -1 more bytes, found 2 (truncated?)", "at": 7})),
        (b"X\xff\xff\xff\xff", ("F002.pickle-step", None,
         {"problem": "expected 4294967295 more bytes, found 2 (truncated?)", "at": 7})),
        (b"\x8e" + b"\xff" * 8, ("F002.pickle-step", None,
         {"problem": ("expected 18446744073709551615 more bytes, found 2 "
        "(truncated?)"), "at": 7})),
        (b"\x96" + b"\0" * 7 + b"\x7f", ("F002.pickle-step", None,
         {"problem": ("expected 9151314442816847872 more bytes, found 2 "
        "(truncated?)"), "at": 7})),
        (b"\x95" + b"\xff" * 8, ("F002.pickle-step", None,
         {"problem": ("expected 18446744073709551615 more bytes, found 2 "
        "(truncated?)"), "at": 7})),
        (b"\x80\x06", ("F002.pickle-step", None,
         {"problem": "expected pickle protocol 0 to 5, found 6",
         "at": 7})),
        (b"\x8b\xff\xff\xff\x00", ("F002.pickle-step", None,
         {"problem": "expected an integer of at most 1024 bytes, found 16777215", "at": 7})),
        (b"\x8b\xff\xff\xff\xff", ("F002.pickle-step", None,
         {"problem": "expected an integer of at most 1024 bytes, found -1", "at": 7})),
        (b"L12LL\n", ("F002.pickle-step", None,
         {"problem": ("expected an opcode that fits the values before it, found "
        "\"L\""), "at": 7})),
        (b"I" + b"9" * 1_000_000 + b"\n", ("F002.pickle-step", None,
         {"problem": "expected at most 256 characters in a line, found 1000000", "at": 7})),
        (b"L" + b"9" * 1_000_000 + b"L\n", ("F002.pickle-step", None,
         {"problem": "expected at most 256 characters in a line, found 1000001", "at": 7})),
        (b"S'a\n", ("F002.pickle-step", None,
         {"problem": ("expected an opcode that fits the values before it, found "
        "\"S\""), "at": 7})),
        (b"S'\\N{BELL}'\n", ("F002.pickle-step", None,
         {"problem": ("expected a string as written by Python 2, found an "
        "unknown escape"),
         "at": 7})),
        (b"S'\\777'\n", ("F002.pickle-step", None,
         {"problem": ("expected a string as written by Python 2, found an "
        "unknown escape"), "at": 7})),
        (b"S'\\x4\\\\1'\n", ("F002.pickle-step", None,
         {"problem": ("expected a string as written by Python 2, found an "
        "unknown escape"),
         "at": 7})),
        (b"S'\\'\n", ("F002.pickle-step", None,
         {"problem": ("expected a string as written by Python 2, found an "
        "unknown escape"), "at": 7})),
        (b"Iwhere", ("F002.pickle-step", None,
         {"problem": ("expected the end of a line, found the end of the file "
        "(truncated?)"), "at": 7})),
        (b"h\x07", ("F002.pickle-step", None,
         {"problem": ("expected an opcode that fits the values before it, found "
        "\"h\""), "at": 7})),
        (b"g99\n", ("F002.pickle-step", None,
         {"problem": ("expected an opcode that fits the values before it, found "
        "\"g\""), "at": 7})),
        (b"Np-1\n", ("F002.pickle-step", None,
         {"problem": ("expected an opcode that fits the values before it, found "
        "\"p\""), "at": 8})),
        (b"0" * 9, ("F002.pickle-step", None,
         {"problem": ("expected an opcode that fits the values before it, found "
        "\"0\""), "at": 9})),
        (b"(o", ("F002.pickle-step", None,
         {"problem": ("expected an opcode that fits the values before it, found "
        "\"o\""), "at": 8})),
        (b"(R", ("F002.pickle-step", None,
         {"problem": ("expected an opcode that fits the values before it, found "
        "\"R\""), "at": 8})),
        (b"t1", ("F002.pickle-step", None,
         {"problem": ("expected an opcode that fits the values before it, found "
        "\"t\""), "at": 7})),
        (b"Na", ("F002.pickle-step", None,
         {"problem": ("expected an opcode that fits the values before it, found "
        "\"a\""), "at": 8})),
        (b"(NNu", ("F002.pickle-step", None,
         {"problem": ("expected an opcode that fits the values before it, found "
        "\"u\""), "at": 10})),
        (b"(NNNd", ("F002.pickle-step", None,
         {"problem": ("expected an opcode that fits the values before it, found "
        "\"d\""), "at": 11})),
        (b"\xffx", ("F002.pickle-step", None, {"problem": "expected a pickle opcode, found \"�\"",
         "at": 7})),
        (b"NN\x93", ("F002.pickle-step", None,
         {"problem": ("expected an opcode that fits the values before it, found "
        "\"�\""), "at": 9})),
        (b")}N\x92", ("F002.pickle-step", None,
         {"problem": ("expected an opcode that fits the values before it, found "
        "\"�\""), "at": 10})),
        (b"cnumpy\r\nndarray\r\n", ("F002.pickle-line-ends", None, {})),
        (b"I1\r\n", ("F002.pickle-line-ends", None, {})),
        (b"S'a'\r\n", ("F002.pickle-line-ends", None, {})),
    ],
    ids=lambda value: repr(value[:12]),
)  # fmt: skip
def test_damaged_opcodes_are_refused(body, line):
    assert refusal(b"\x80\x02}" + text("vv") + body + b"s.") == line
