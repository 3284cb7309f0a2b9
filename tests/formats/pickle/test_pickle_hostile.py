"""Malicious pickles, which are refused in one line without execution, writing or allocation."""

from __future__ import annotations

import pickle
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from faults import Fault
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


def test_attacks_in_this_file_work_with_the_standard_unpickler(tmp_path: Path) -> None:
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
def test_globals_outside_the_table_are_refused(module: str, name: str, marker: Path) -> None:
    argument = text(written(marker))
    problem = Phrase("pickle-global", name=printable(f"{module}.{name}"))
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
         {"problem": Phrase("pickle-call", found=Phrase("noun", name="numpy.ndarray"))})),
        (named("__builtin__", "object") + b")R", ("F002.pickle", None,
         {"problem": Phrase("pickle-call", found=Phrase("noun", name="__builtin__.object"))})),
        (text("x") + several() + b"R", ("F002.pickle", None, {"problem": Phrase("pickle-call",
         found=Phrase("noun-text"))})),
        (array(np.ones(1)) + several() + b"R", ("F002.pickle", None,
         {"problem": Phrase("pickle-call", found=Phrase("noun-array"))})),
        (reduced("__builtin__", "set") + b")R", ("F002.pickle", None,
         {"problem": Phrase("pickle-call", found=Phrase("noun-other", kind="list"))})),
        (named("chumpy.ch", "Ch") + b")R", ("F002.pickle", None, {"problem": Phrase("pickle-call",
         found=Phrase("noun", name="chumpy.ch.Ch"))})),
    ],
)  # fmt: skip
def test_calls_of_non_functions_are_refused(body: bytes, line: Fault) -> None:
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
def test_unusual_arguments_are_refused(
    module: str, name: str, arguments: list[bytes], found: str
) -> None:
    key, _, values = refusal(saved(v=reduced(module, name, *arguments)))
    problem = values["problem"]
    assert (key, problem.key) == ("F002.pickle", "pickle-arguments")
    assert problem.values["name"] == f"{module}.{name}"
    assert ", ".join(map(str, problem.values["found"])) == found


@pytest.mark.parametrize(
    ("body", "found"),
    [
        (named("chumpy.ch", "Ch") + several(whole(1)) + b"\x81", ("F002.pickle", None,
         {"problem": Phrase("pickle-create", found=Phrase("noun", name="chumpy.ch.Ch"))})),
        (NDARRAY + b")\x81", ("F002.pickle", None, {"problem": Phrase("pickle-create",
         found=Phrase("noun", name="numpy.ndarray"))})),
        (NDARRAY + b")}\x92", ("F002.pickle", None, {"problem": Phrase("pickle-create",
         found=Phrase("noun", name="numpy.ndarray"))})),
        (b"(" + named("numpy", "dtype") + CODE + b"o", ("F002.pickle", None,
         {"problem": Phrase("pickle-create", found=Phrase("noun", name="numpy.dtype"))})),
        (b"(icollections\nOrderedDict\n", ("F002.pickle", None,
         {"problem": Phrase("pickle-create", found=Phrase("noun",
         name="collections.OrderedDict"))})),
        (b"])\x81", ("F002.pickle", None, {"problem": Phrase("pickle-create",
         found=Phrase("noun-other", kind="list"))})),
    ],
)  # fmt: skip
def test_new_objects_of_other_classes_are_refused(body: bytes, found: Fault) -> None:
    assert refusal(saved(v=body)) == found


MATRIX = "scipy.sparse.csc", "csc_matrix"
SLOTS = several(b"N", mapping(toarray=whole(1)))


@pytest.mark.parametrize(
    ("body", "line"),
    [
        (named(*MATRIX) + SLOTS + b"b", ("F002.pickle", None, {"problem": Phrase("pickle-build",
         found=Phrase("noun", name="scipy.sparse.csc.csc_matrix"))})),
        (NDARRAY + SLOTS + b"b", ("F002.pickle", None, {"problem": Phrase("pickle-build",
         found=Phrase("noun", name="numpy.ndarray"))})),
        (b"]" + mapping(append=whole(1)) + b"b", ("F002.pickle", None,
         {"problem": Phrase("pickle-build", found=Phrase("noun-other", kind="list"))})),
        (b"}" + mapping(a=whole(1)) + b"b", ("F002.pickle", None,
         {"problem": Phrase("pickle-build", found=Phrase("noun-other", kind="dict"))})),
        (named(*MATRIX) + b")\x81" + SLOTS + b"b", ("F002.pickle", None,
         {"problem": Phrase("pickle-state", name="scipy.sparse.csc.csc_matrix",
         found=Phrase("noun-other", kind="tuple"))})),
        (named("chumpy.ch", "Ch") + b")\x81]b", ("F002.pickle", None,
         {"problem": Phrase("pickle-state", name="chumpy.ch.Ch", found=Phrase("noun-other",
         kind="list"))})),
        (empty_array() + b"}b", ("F002.pickle", None, {"problem": Phrase("pickle-array-state",
         found=Phrase("noun-other", kind="dict"))})),
        (empty_array() + several(whole(1)) + b"b", ("F002.pickle", None,
         {"problem": Phrase("pickle-array-state", found=Phrase("noun-other", kind="tuple"))})),
        (empty_array() + several(whole(1), shape(1), element_type(), whole(0), b"]") + b"b",
         ("F002.pickle", None, {"problem": Phrase("pickle-array-state", found=Phrase("noun-other",
         kind="tuple"))})),
        (empty_array() + several(whole(1), shape(-1), element_type(), whole(0), CODE) + b"b",
         ("F002.pickle", None, {"problem": Phrase("pickle-array-state", found=Phrase("noun-other",
         kind="tuple"))})),
        (element_type() + b"}b", ("F002.pickle", None, {"problem": Phrase("pickle-dtype-state",
         found=Phrase("noun-other", kind="dict"))})),
        (element_type(order="?"), ("F002.pickle", None, {"problem": Phrase("pickle-byte-order",
         found=Phrase("noun-text"))})),
        (element_type("S4", "|", size=1 << 30), ("F002.pickle", None,
         {"problem": Phrase("pickle-dtype-state", found=Phrase("noun-other", kind="tuple"))})),
    ],
)  # fmt: skip
def test_malformed_states_are_refused(body: bytes, line: Fault) -> None:
    assert refusal(saved(v=body)) == line


def test_states_set_no_attributes_of_objects(monkeypatch: pytest.MonkeyPatch) -> None:
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
    assert archive.get("b") == Opaque(Phrase("unread-chumpy", name="chumpy.ch.Ch"))


def test_pickles_share_no_state() -> None:
    refusal(saved(v=named(*MATRIX) + mapping(role=text("x")) + b"b"))
    assert opened(saved(v=matrix())).sparse("v").shape == (2, 3)


@pytest.mark.parametrize(
    ("body", "found"),
    [
        (b"Pos.system\n", ("F002.pickle", None, {"problem": Phrase("pickle-refused",
         found=Phrase("noun-persistent"))})),
        (text("x") + b"Q", ("F002.pickle", None, {"problem": Phrase("pickle-refused",
         found=Phrase("noun-persistent"))})),
        (b"\x82\x01", ("F002.pickle", None, {"problem": Phrase("pickle-refused",
         found=Phrase("noun-extension"))})),
        (b"\x83\x01\x01", ("F002.pickle", None, {"problem": Phrase("pickle-refused",
         found=Phrase("noun-extension"))})),
        (b"\x84\x01\x01\x01\x01", ("F002.pickle", None, {"problem": Phrase("pickle-refused",
         found=Phrase("noun-extension"))})),
        (b"\x97", ("F002.pickle", None, {"problem": Phrase("pickle-refused",
         found=Phrase("noun-buffer"))})),
        (b"\x98", ("F002.pickle", None, {"problem": Phrase("pickle-refused",
         found=Phrase("noun-buffer"))})),
    ],
)  # fmt: skip
def test_opcodes_with_out_of_range_references_are_refused(body: bytes, found: Fault) -> None:
    assert refusal(saved(v=body)) == found


@pytest.mark.parametrize(
    ("body", "line"),
    [
        (b"B\xff\xff\xff\x7f", ("F002.pickle-step", None, {"problem": Phrase("pickle-cut",
         expected=2147483647, found=2), "at": 7})),
        (b"T\xff\xff\xff\xff", ("F002.pickle-step", None, {"problem": Phrase("pickle-cut",
         expected=-1, found=2), "at": 7})),
        (b"X\xff\xff\xff\xff", ("F002.pickle-step", None, {"problem": Phrase("pickle-cut",
         expected=4294967295, found=2), "at": 7})),
        (b"\x8e" + b"\xff" * 8, ("F002.pickle-step", None, {"problem": Phrase("pickle-cut",
         expected=18446744073709551615, found=2), "at": 7})),
        (b"\x96" + b"\0" * 7 + b"\x7f", ("F002.pickle-step", None,
         {"problem": Phrase("pickle-cut", expected=9151314442816847872, found=2), "at": 7})),
        (b"\x95" + b"\xff" * 8, ("F002.pickle-step", None, {"problem": Phrase("pickle-cut",
         expected=18446744073709551615, found=2), "at": 7})),
        (b"\x80\x06", ("F002.pickle-step", None, {"problem": Phrase("pickle-protocol", found=6),
         "at": 7})),
        (b"\x8b\xff\xff\xff\x00", ("F002.pickle-step", None, {"problem": Phrase("pickle-long",
         most=1024, found=16777215), "at": 7})),
        (b"\x8b\xff\xff\xff\xff", ("F002.pickle-step", None, {"problem": Phrase("pickle-long",
         most=1024, found=-1), "at": 7})),
        (b"L12LL\n", ("F002.pickle-step", None,
         {"problem": Phrase("pickle-misfit", found=b"L"), "at": 7})),
        (b"I" + b"9" * 1_000_000 + b"\n", ("F002.pickle-step", None,
         {"problem": Phrase("pickle-line", most=256, found=1000000), "at": 7})),
        (b"L" + b"9" * 1_000_000 + b"L\n", ("F002.pickle-step", None,
         {"problem": Phrase("pickle-line", most=256, found=1000001), "at": 7})),
        (b"S'a\n", ("F002.pickle-step", None,
         {"problem": Phrase("pickle-misfit", found=b"S"), "at": 7})),
        (b"S'\\N{BELL}'\n", ("F002.pickle-step", None, {"problem": Phrase("pickle-escape"),
         "at": 7})),
        (b"S'\\777'\n", ("F002.pickle-step", None, {"problem": Phrase("pickle-escape"), "at": 7})),
        (b"S'\\x4\\\\1'\n", ("F002.pickle-step", None, {"problem": Phrase("pickle-escape"),
         "at": 7})),
        (b"S'\\'\n", ("F002.pickle-step", None, {"problem": Phrase("pickle-escape"), "at": 7})),
        (b"Iwhere", ("F002.pickle-step", None, {"problem": Phrase("pickle-line-end"), "at": 7})),
        (b"h\x07", ("F002.pickle-step", None,
         {"problem": Phrase("pickle-misfit", found=b"h"), "at": 7})),
        (b"g99\n", ("F002.pickle-step", None,
         {"problem": Phrase("pickle-misfit", found=b"g"), "at": 7})),
        (b"Np-1\n", ("F002.pickle-step", None,
         {"problem": Phrase("pickle-misfit", found=b"p"), "at": 8})),
        (b"0" * 9, ("F002.pickle-step", None,
         {"problem": Phrase("pickle-misfit", found=b"0"), "at": 9})),
        (b"(o", ("F002.pickle-step", None,
         {"problem": Phrase("pickle-misfit", found=b"o"), "at": 8})),
        (b"(R", ("F002.pickle-step", None,
         {"problem": Phrase("pickle-misfit", found=b"R"), "at": 8})),
        (b"t1", ("F002.pickle-step", None,
         {"problem": Phrase("pickle-misfit", found=b"t"), "at": 7})),
        (b"Na", ("F002.pickle-step", None,
         {"problem": Phrase("pickle-misfit", found=b"a"), "at": 8})),
        (b"(NNu", ("F002.pickle-step", None,
         {"problem": Phrase("pickle-misfit", found=b"u"), "at": 10})),
        (b"(NNNd", ("F002.pickle-step", None,
         {"problem": Phrase("pickle-misfit", found=b"d"), "at": 11})),
        (b"\xffx", ("F002.pickle-step", None, {"problem": Phrase("pickle-step", found=b"\xff"),
         "at": 7})),
        (b"NN\x93", ("F002.pickle-step", None,
         {"problem": Phrase("pickle-misfit", found=b"\x93"), "at": 9})),
        (b")}N\x92", ("F002.pickle-step", None,
         {"problem": Phrase("pickle-misfit", found=b"\x92"), "at": 10})),
        (b"cnumpy\r\nndarray\r\n", ("F002.pickle-line-ends", None, {})),
        (b"I1\r\n", ("F002.pickle-line-ends", None, {})),
        (b"S'a'\r\n", ("F002.pickle-line-ends", None, {})),
    ],
    ids=lambda value: repr(value[:12]),
)  # fmt: skip
def test_damaged_opcodes_are_refused(body: bytes, line: Fault) -> None:
    assert refusal(b"\x80\x02}" + text("vv") + body + b"s.") == line
