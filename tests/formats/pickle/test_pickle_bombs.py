"""Pickles with false sizes, or with repeated or circular values."""

import pickle
import struct
import time
import tracemalloc
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from faults import Fault, fault_of
from formats.pickle.pickle_costs import self_contained
from formats.pickle_bytes import (
    array,
    array_of,
    created,
    element_type,
    finished,
    mapping,
    matrix,
    named,
    opened,
    payload,
    refusal,
    saved,
    several,
    shape,
    text,
    unicode,
    whole,
)

from viewer.diagnostics import Phrase
from viewer.errors import FormatError
from viewer.formats._archive.values import Opaque
from viewer.formats._pickle import machine

pytestmark = pytest.mark.slow
BOUND = 64 << 20  # limit of allocated memory in bytes
PATIENCE = 5.0  # in seconds; far more than needed, even on a busy machine


def is_too_long(fault: Fault) -> bool:
    """Return whether a pickle was refused for its number of opcodes."""
    return fault[2]["problem"] == "expected at most 1000000 opcodes in a pickle, found more"


ENDLESS = Opaque("circular data")


def cost(action: Callable[[], Any]) -> int:
    """Return the peak memory of a call in bytes."""
    started = time.process_time()
    tracemalloc.start()
    try:
        action()
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert time.process_time() - started < PATIENCE * 4  # tracing slows the call down
    return most


@pytest.mark.parametrize(
    ("body", "line"),
    [
        (array_of((1 << 40,), b"12345678"), ("F002.pickle", None,
         {"problem": "expected 1099511627776 float64, found 8 bytes"})),
        (array_of((1 << 20,) * 4, bytes(8)), ("F002.pickle", None,
         {"problem": ("expected 1048576 x 1048576 x 1048576 x 1048576 float64, "
        "found 8 bytes")})),
        (array_of((0, 1 << 61), b""), ("F002.pickle", None,
         {"problem": "expected 0 x 2305843009213693952 float64, found 0 bytes"})),
        (array_of((2,), b"12345678"), ("F002.pickle", None,
         {"problem": "expected 2 float64, found 8 bytes"})),
        (array_of((1,), b"123456789"), ("F002.pickle", None,
         {"problem": "expected 1 float64, found 9 bytes"})),
        (array_of((), b""), ("F002.pickle", None,
         {"problem": "expected a single float64, found 0 bytes"})),
        (array_of((1, 0), b"12345678"), ("F002.pickle", None,
         {"problem": "expected 1 x 0 float64, found 8 bytes"})),
        (array_of((1,), b"12345678", "i4", ">"), ("F002.pickle", None,
         {"problem": "expected 1 int32, found 8 bytes"})),
        (array_of((1 << 40,), b"abcd", "S4", "|"), ("F002.pickle", None,
         {"problem": "expected 1099511627776 bytes32, found 4 bytes"})),
    ],
)  # fmt: skip
def test_shapes_that_do_not_match_their_bytes_are_refused(body, line):
    data = saved(v=body)
    assert refusal(data) == line
    assert cost(lambda: refusal(data)) < BOUND


@pytest.mark.parametrize("code", ["S0", "U0", "S1048577", "f16", "c16", "V8", "O8", "q", "(8)f8"])
def test_element_types_without_numbers_are_not_evaluated(code):
    made = named("numpy", "dtype") + several(text(code), whole(0), whole(1)) + b"R"
    body = array_of((1 << 40,), b"").replace(element_type(), made)
    found = opened(saved(v=body)).get("v")
    assert isinstance(found, Opaque)


@pytest.mark.parametrize("sides", [(1,) * 33, (1,) * 100_000, (1 << 62,), (1 << 2000,)])
def test_shapes_beyond_the_limits_of_numpy_are_refused(sides):
    line = refusal(saved(v=array_of(sides, b"12345678")))
    assert line == (
        "F002.pickle",
        None,
        {"problem": "expected the state of an array, found a tuple"},
    )


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"sides": (1 << 31, 3)}, ("F002.archive-value", None, {"item": "v",
         "problem": ("expected at most 134217728 rows and columns, found "
        "2147483648 x 3")})),
        ({"sides": (2, 1 << 27)}, ("F002.archive-value", None, {"item": "v",
         "problem": ("expected 134217729 index pointers in a sparse 2 x "
        "134217728 matrix, found 4")})),
        ({"sides": (2, 1 << 61)}, ("F002.archive-value", None, {"item": "v",
         "problem": ("expected at most 134217728 rows and columns, found 2 x "
        "2305843009213693952")})),
        ({"indices": (0, 2, 0)}, ("F002.archive-value", None, {"item": "v",
         "problem": "expected indices 0 to 1 in a sparse matrix, found 0 to 2"})),
        ({"indices": (0, -1, 0)}, ("F002.archive-value", None, {"item": "v",
         "problem": "expected indices 0 to 1 in a sparse matrix, found -1 to 0"})),
        ({"indices": (0, 1)}, ("F002.archive-value", None, {"item": "v",
         "problem": "expected 3 indices in a sparse matrix, found 2"})),
        ({"indptr": (0, 2, 1, 3)}, ("F002.archive-value", None, {"item": "v",
         "problem": ("expected index pointers in ascending order from 0 to 3 in "
        "a sparse matrix, found them unsorted")})),
        ({"indptr": (0, 1, 1, 4)}, ("F002.archive-value", None, {"item": "v",
         "problem": ("expected index pointers in ascending order from 0 to 3 in "
        "a sparse matrix, found them unsorted")})),
        ({"indptr": (1, 1, 1, 3)}, ("F002.archive-value", None, {"item": "v",
         "problem": ("expected index pointers in ascending order from 0 to 3 in "
        "a sparse matrix, found them unsorted")})),
        ({"indptr": (0, 1, 3)}, ("F002.archive-value", None, {"item": "v",
         "problem": "expected 4 index pointers in a sparse 2 x 3 matrix, found 3"})),
        ({"indptr": (), "sides": (2, 0)}, ("F002.archive-value", None, {"item": "v",
         "problem": "expected 1 index pointers in a sparse 2 x 0 matrix, found 0"})),
        ({"data": ((1.0, 2.0, 3.0),)}, ("F002.archive-value", None, {"item": "v",
         "problem": ("data, indices and index pointers of a sparse matrix must "
        "be one-dimensional")})),
        ({"shape_key": "form"}, ("F002.archive-value", None, {"item": "v",
         "problem": "expected a sparse matrix with a shape, found none"})),
        ({"sides": (1, 2, 3)}, ("F002.archive-value", None, {"item": "v",
         "problem": "expected a sparse matrix with a shape, found none"})),
    ],
)  # fmt: skip
def test_inconsistent_sparse_matrices_are_refused(changes, line):
    data = saved(v=matrix(**changes))
    assert refusal(data) == line
    assert cost(lambda: refusal(data)) < BOUND


def test_sparse_shape_is_checked_before_densifying():
    archive = opened(saved(v=matrix(sides=(1 << 27, 3))))
    with pytest.raises(FormatError) as caught:
        archive.sparse("v", (24, 3))
    assert fault_of(caught.value.diagnostic) == (
        "F002.value",
        None,
        {
            "item": "v",
            "expected": "24 x 3 numbers",
            "found": "a sparse 134217728 x 3 matrix",
        },
    )


def test_sparse_matrix_without_its_arrays_is_refused():
    state = mapping(_shape=shape(2, 3), data=whole(1))
    body = created("scipy.sparse.csc", "csc_matrix", state)
    assert refusal(saved(v=body)) == (
        "F002.archive-value",
        None,
        {"item": "v", "problem": "expected a sparse matrix with data, found none"},
    )


def selection(indices: list[int], *sides: int) -> bytes:
    state = mapping(
        a=array(np.arange(6.0)), idxs=array(np.array(indices)), preferred_shape=shape(*sides)
    )
    return saved(v=created("chumpy.reordering", "Select", state))


@pytest.mark.parametrize(
    ("data", "line"),
    [
        (selection([0, 6], 2), ("F002.archive-value", None, {"item": "v",
         "problem": "expected indices 0 to 5, found 0 to 6"})),
        (selection([-1, 0], 2), ("F002.archive-value", None, {"item": "v",
         "problem": "expected indices 0 to 5, found -1 to 0"})),
        (selection([0, 1], 1 << 40), ("F002.archive-value", None, {"item": "v",
         "problem": ("expected 1099511627776 indices in "
        "chumpy.reordering.Select, found 2")})),
        (selection([0, 1], *[1 << 61] * 32), ("F002.archive-value", None, {"item": "v",
         "problem": ("expected 407897962615157369808412540087403635887… indices "
        "in chumpy.reordering.Select, found 2")})),
        (selection([0, 1], 3, 1), ("F002.archive-value", None, {"item": "v",
         "problem": "expected 3 indices in chumpy.reordering.Select, found 2"})),
    ],
)  # fmt: skip
def test_selections_out_of_range_are_refused(data, line):
    assert refusal(data) == line


def test_selection_of_long_strings_is_not_evaluated():
    long = array_of((1,), b"x" * 100_000, "S100000", "|")
    state = mapping(a=long, idxs=array(np.zeros(100_000, np.uint8)), preferred_shape=shape(100_000))
    archive = opened(saved(v=created("chumpy.reordering", "Select", state)))
    assert archive.get("v") == Opaque("chumpy.reordering.Select with unsupported indices")


@pytest.mark.parametrize("name", ["Ch", "ChHandle"])
def test_expression_that_contains_itself_is_not_expanded(name):
    body = named("chumpy.ch", name) + b")\x81q\x01}" + text("x") + b"h\x01sb"
    found = opened(saved(v=body)).get("v")
    assert found == Opaque(Phrase("circular {name} expression", name=f"chumpy.ch.{name}"))


def test_containers_that_contain_themselves_are_not_expanded():
    data = saved(
        a=b"]q\x01h\x01a",
        b=b"}q\x02" + text("x") + b"h\x02s",
        c=b"]q\x03h\x03\x85q\x04ah\x04",
        good=array(np.ones(1)),
    )
    archive = opened(data.replace(b"h\x04" + text("good"), text("good")))
    assert [archive.get(key) for key in "abc"] == [ENDLESS] * 3
    assert archive.array("good").shape == (1,)


WRAPPERS = {
    "list": (b"]", b"a"),
    "tuple": (b"", b"\x85"),
    "dict": (b"}" + text("k"), b"s"),
    "chumpy": (named("chumpy.ch", "Ch") + b")\x81}" + text("x"), b"sb"),
}


@pytest.mark.parametrize("kind", WRAPPERS)
def test_nesting_20_000_deep_is_not_expanded(kind):
    before, after = WRAPPERS[kind]
    found = opened(saved(v=before * 20_000 + b"N" + after * 20_000)).get("v")
    assert found == ENDLESS or found == Opaque("circular chumpy.ch.Ch expression")


def doubled(first: bytes, step: Callable[[bytes], bytes], count: int) -> bytes:
    body = first + b"q\x00"
    for number in range(count):
        body += b"0" + step(b"h" + bytes([number])) + b"q" + bytes([number + 1])
    return body


@pytest.mark.parametrize("count", [20, 100])
def test_lists_that_repeatedly_contain_the_same_list_are_not_expanded(count):
    """The "billion laughs" attack: 2^100 items in 800 bytes."""
    for step in (lambda inner: b"](" + inner * 2 + b"e", lambda inner: inner * 2 + b"\x86"):
        data = saved(v=doubled(b"]", step, count))
        assert opened(data).get("v") == ENDLESS
        assert cost(lambda data=data: opened(data).get("v")) < BOUND


def test_repeated_sets_of_the_same_list_are_refused():
    items = b"](" + b"N" * 100_000 + b"eq\x01"
    again = named("__builtin__", "set") + b"(h\x01tR"
    data = saved(v=b"](" + items + again * 1000 + b"e")
    assert is_too_long(refusal(data))


def test_repeated_dicts_with_the_same_keys_are_refused():
    items = b"](" + (text("k") + b"N\x86") * 100_000 + b"eq\x01"
    again = named("collections", "OrderedDict") + b"(h\x01tR"
    data = saved(v=b"](" + items + again * 1000 + b"e")
    assert is_too_long(refusal(data))


def test_repeated_use_of_a_long_string_is_refused():
    long = payload(b"x" * 1_000_000) + b"q\x01"
    encoded = unicode("x" * 1_000_000) + b"q\x02" + unicode("latin1") + b"q\x03"
    encode = named("_codecs", "encode") + b"(h\x02h\x03tR"
    scalar = named("numpy.core.multiarray", "scalar") + b"("
    scalar += element_type("S1000000", "|", 1_000_000) + b"h\x01tR"
    plain = saved(v=b"](" + long + b"h\x01" * 10_000 + b"e")
    found = opened(plain).get("v")
    assert isinstance(found, list) and len(found) == 10_001
    packed = saved(v=b"](" + encoded + encode * 1000 + b"e")
    assert opened(packed).get("v") == ENDLESS
    repeated = saved(v=b"](" + long + scalar * 1000 + b"e")
    assert is_too_long(refusal(repeated))
    for data in (plain, packed, repeated):
        assert cost(lambda data=data: self_contained(data)) < BOUND


def test_strings_are_not_converted_to_an_array():
    """Numpy would allocate the length of the longest string for every element."""
    data = saved(v=b"](" + payload(b"x" * 1_000_000) + b"e" + b"(" + b"K\x01" * 10_000 + b"e")
    assert cost(lambda: self_contained(data)) < BOUND


def test_huge_memo_index_does_not_allocate_memory():
    data = saved(v=b"Nr\xff\xff\xff\x7fj\xff\xff\xff\x7f" + b"0")
    assert opened(data).get("v") is None
    assert cost(lambda: opened(data)) < 1 << 20


def test_nested_tuples_are_refused_as_a_key_before_they_are_hashed():
    """Hashing a tuple hashes its items, on the stack of the process."""
    assert refusal(saved(v=b"}N" + b"\x85" * 900_000 + b"Ns")) == (
        "F002.pickle",
        None,
        {"problem": "expected a string or a number as a key, found a tuple"},
    )


@pytest.mark.parametrize(
    ("step", "most"),
    [(b"N", 1_000_000), *((step, 10_000) for step in (b"(", b"]", b"}", b"2", b")"))],
)
def test_endless_opcodes_terminate(step, most, monkeypatch):
    if most != 1_000_000:  # the usual limit, which takes 0.4 s
        monkeypatch.setattr(machine, "_MAX_STEPS", most)
    assert refusal(b"\x80\x02]" + step * (most + 1000)) == (
        "F002.pickle-step",
        None,
        {"problem": f"expected at most {most} opcodes in a pickle, found more", "at": most + 1},
    )


def test_huge_declared_lengths_do_not_allocate_memory():
    for step in (b"B\xff\xff\xff\x7f", b"\x8e" + b"\xff" * 5 + b"\0" * 3, b"\x96" + b"\xff" * 8):
        assert cost(lambda step=step: refusal(saved(v=step))) < 1 << 20


@pytest.mark.parametrize(
    ("key", "found"),
    [
        (b"N", ("F002.pickle", None,
         {"problem": "expected a string or a number as a key, found None"})),
        (b"G" + struct.pack(">d", 0.5), ("F002.pickle", None,
         {"problem": "expected a string or a number as a key, found a number"})),
        (whole(1 << 60), ("F002.pickle", None,
         {"problem": "expected a string or a number as a key, found a number"})),
        (b")", ("F002.pickle", None,
         {"problem": "expected a string or a number as a key, found a tuple"})),
        (b"]", ("F002.pickle", None,
         {"problem": "expected a string or a number as a key, found a list"})),
        (b"\x88", ("F002.pickle", None,
         {"problem": "expected a string or a number as a key, found a number"})),
        (array(np.ones(1)), ("F002.pickle", None,
         {"problem": "expected a string or a number as a key, found an array"})),
        (named("chumpy.ch", "Ch") + b")\x81", ("F002.pickle", None,
         {"problem": ("expected a string or a number as a key, found an instance "
        "of chumpy.ch.Ch")})),
        (payload(b"x" * 70_000), ("F002.pickle", None,
         {"problem": "expected a string or a number as a key, found a string"})),
    ],
)  # fmt: skip
def test_keys_other_than_strings_are_refused(key, found):
    assert refusal(saved(v=b"}" + key + b"Ns")) == found
    assert refusal(saved(v=b"(" + key + b"Nd")) == found


@pytest.mark.parametrize(
    ("body", "found"),
    [
        (b"]", ("F002.pickle-named", None, {"found": "a list"})),
        (b")", ("F002.pickle-named", None, {"found": "a tuple"})),
        (b"N", ("F002.pickle-named", None, {"found": "None"})),
        (whole(3), ("F002.pickle-named", None, {"found": "a number"})),
        (text("x"), ("F002.pickle-named", None, {"found": "a string"})),
        (b"C\x01x", ("F002.pickle-named", None, {"found": "bytes"})),
        (array(np.ones(1)), ("F002.pickle-named", None, {"found": "an array"})),
        (matrix(), ("F002.pickle-named", None,
         {"found": "an instance of scipy.sparse.csc.csc_matrix"})),
        (named("numpy", "ndarray"), ("F002.pickle-named", None, {"found": "numpy.ndarray"})),
        (b"}K\x05Ns", ("F002.pickle-key", None, {"found": 5})),
    ],
)  # fmt: skip
def test_top_level_object_must_be_a_dict(body, found):
    assert refusal(finished(body)) == found


def test_equal_names_as_str_and_bytes_are_refused():
    assert refusal(pickle.dumps({b"v": 1, "v": 2})) == ("F002.pickle-twice", None, {"item": "v"})
