"""Pickles by all common writers, from which arrays are read as views of the file."""

import pickle
from collections import OrderedDict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from faults import fault_of, warnings_of
from formats.pickle_bytes import (
    array,
    array_of,
    created,
    element_type,
    fake_class,
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
    unframed,
    unicode,
    whole,
)
from numpy.testing import assert_array_equal

from viewer.diagnostics import Phrase
from viewer.errors import FormatError
from viewer.formats._archive.opening import open_archive
from viewer.formats._archive.values import Opaque, Sparse
from viewer.formats._source import Source
from viewer.rigs.arrays import Deferred, frozen

ROWS = np.arange(12.0).reshape(4, 3) / 8
DATA = Path(__file__).resolve().parents[4] / "shared" / "data"
# Output of cPickle of Python 2.7 with numpy 1.16 for {'v': array([[1.5, -2.0]])}, protocol 0.
PYTHON_2_TEXT = rb"""(dp1
S'v'
p2
cnumpy.core.multiarray
_reconstruct
p3
(cnumpy
ndarray
p4
(I0
tS'b'
tRp5
(I1
(I1
I2
tcnumpy
dtype
p6
(S'f8'
I0
I1
tRp7
(I3
S'<'
NNNI-1
I-1
I0
tbI00
S'\x00\x00\x00\x00\x00\x00\xf8?\x00\x00\x00\x00\x00\x00\x00\xc0'
tbs."""


def values(data: bytes, key: str = "v") -> Any:
    found = opened(data).get(key)
    assert isinstance(found, Deferred), found
    loaded = found.values()
    assert loaded.shape == found.shape
    assert loaded.dtype == found.dtype
    assert not loaded.flags.writeable
    assert loaded.dtype.isnative
    return loaded


def test_protocol_0_of_python_2_is_read():
    assert_array_equal(values(PYTHON_2_TEXT), [[1.5, -2.0]])


def test_protocol_0_escapes_quotes_and_backslashes():
    data = b"(dp1\nS'v'\n" + rb"""S"it's \\ \x41\n\t\'" """.strip() + b"\ns."
    assert opened(data).get("v") == "it's \\ A\n\t'"


def test_protocol_1_of_python_2_is_read():
    assert_array_equal(values(b"}q\x01U\x01vq\x02" + array(ROWS) + b"s."), ROWS)


def test_protocol_2_of_python_2_is_read():
    assert_array_equal(values(saved(v=array(ROWS))), ROWS)


@pytest.mark.parametrize("protocol", [0, 1, 2, 3, 4, 5])
@pytest.mark.parametrize(
    "given",
    [
        ROWS,
        np.asfortranarray(ROWS),
        ROWS.astype(">f4"),
        np.arange(24).reshape(2, 3, 4).transpose(1, 0, 2),
        np.array([1, -1], np.int64),
        np.array([4294967295], np.uint32),
        np.array([True, False]),
        np.zeros((0, 3)),
        np.array(2.5),
        np.array("female"),
        np.array(["a", "bcd"]),
        np.array([b"x", b"yz"]),
        np.array([1.5], np.float16),
    ],
    ids=lambda given: f"{given.dtype.str}-{given.shape}",
)
def test_every_protocol_of_python_3_is_read(given, protocol):
    found = values(pickle.dumps({"v": given}, protocol))
    assert_array_equal(found, given)
    assert found.dtype == given.dtype.newbyteorder("=")


@pytest.mark.parametrize("protocol", [2, 4, 5])
def test_module_names_of_numpy_1_are_read(protocol):
    data = pickle.dumps({"v": ROWS, "s": np.float32(0.5)}, protocol)
    if protocol > 2:
        data = unframed(data)
    for old in (b"numpy._core.multiarray", b"numpy._core.numeric"):
        new = old.replace(b"_core", b"core")
        data = data.replace(bytes([len(old)]) + old, bytes([len(new)]) + new).replace(old, new)
    assert b"_core" not in data
    assert_array_equal(values(data), ROWS)
    assert opened(data).get("s") == 0.5


@pytest.mark.parametrize("protocol", [0, 2, 5])
def test_plain_data_are_read(protocol):
    given = {
        "text": "grün €",
        "bytes": b"\x00\xff",
        "numbers": [1, -2, 300, 70000, 1 << 40, -(1 << 70), 2.5, float("inf"), True, None],
        "nested": {"a": (1, (2,)), 3: [[]], b"c": {}},
        "names": ["head", "ear"],
        "ordered": OrderedDict(a=1, b=2),
    }
    archive = opened(pickle.dumps(given, protocol))
    assert archive.kind == "pickle"
    assert archive.keys == tuple(given)
    for key, value in given.items():
        assert archive.get(key) == value, key


def test_numpy_scalars_are_read_as_python_numbers():
    given = {"f": np.float64(1.5), "i": np.int32(-7), "b": np.True_, "s": np.str_("x"), "e": ""}
    for protocol in (0, 2, 5):
        archive = opened(pickle.dumps(given, protocol))
        assert [archive.get(key) for key in given] == [1.5, -7, True, "x", ""]
        assert type(archive.get("f")) is float


def test_sets_and_ordered_dicts_of_python_2_are_read():
    items = b"](" + text("b") + text("a") + b"e"
    pairs = b"](](" + text("k") + whole(1) + b"ee"
    data = saved(
        s=named("__builtin__", "set") + several(items) + b"R",
        d=named("collections", "OrderedDict") + several(pairs) + b"R",
    )
    archive = opened(data)
    assert archive.get("s") == ["b", "a"]
    assert archive.get("d") == {"k": 1}


def test_sets_of_protocol_4_are_read_as_lists():
    archive = opened(pickle.dumps({"s": {1}, "f": frozenset({2})}, 4))
    assert (archive.get("s"), archive.get("f")) == ([1], [2])


def test_python_2_strings_are_read_as_latin_1():
    assert opened(finished(b"}" + text("gr\xfcn") + text("\xe9") + b"s")).get("grün") == "é"


def test_protocol_0_text_may_have_any_character():
    data = b"(dp0\nV\\u20ac\np1\nVgr\xfcn\ns."
    assert opened(data).get("€") == "grün"


def test_names_may_be_byte_strings():
    assert opened(pickle.dumps({b"v": 1})).get("v") == 1


def test_arrays_are_views_of_the_file():
    data = saved(v=array(ROWS))
    found = values(data)
    base = found
    while isinstance(base, np.ndarray):
        base = base.base
    assert base is data
    assert frozen("v", found, (4, 3)) is found


def test_pickled_values_are_read_once():
    archive = opened(saved(v=array(ROWS)))
    later = archive.get("v")
    assert isinstance(later, Deferred)
    assert not later.is_loaded
    assert later.values() is archive.array("v").values()


@pytest.mark.parametrize("protocol", [0, 2, 4])
def test_objects_pickled_by_python_are_read(monkeypatch, protocol):
    sparse = fake_class(monkeypatch, "scipy.sparse.csc", "csc_matrix")()
    sparse.__dict__ = {"_shape": (1, 1), "data": np.ones(1), "indices": np.zeros(1, "i4")}
    sparse.indptr = np.array([0, 1], "i4")
    ch = fake_class(monkeypatch, "chumpy.ch", "Ch")()
    ch.__dict__ = {"x": ROWS, "_dirty_vars": set(), "_itr": None, "_make_dense": False}
    archive = opened(pickle.dumps({"sparse": sparse, "ch": ch}, protocol))
    assert archive.sparse("sparse").shape == (1, 1)
    assert_array_equal(archive.array("ch", ("V", 3)).values(), ROWS)


def select(inner: bytes, indices: Any, *sides: int) -> bytes:
    state = mapping(
        a=inner, idxs=array(np.array(indices)), preferred_shape=shape(*sides), _status=text("new")
    )
    return created("chumpy.reordering", "Select", state)


def ch(inner: bytes) -> bytes:
    return created("chumpy.ch", "Ch", mapping(x=inner, _dirty_vars=whole(0)))


def test_chumpy_selection_of_an_array_is_read():
    found = values(saved(v=select(ch(array(ROWS)), [0, 3, 11, 0], 2, 2)))
    assert found.tolist() == [[0, 0.375], [1.375, 0]]


def test_chumpy_selection_of_a_selection_is_read():
    inner = select(array(ROWS), [5, 6, 7], 3)
    assert values(saved(v=ch(select(inner, [2, 0], 2)))).tolist() == [0.875, 0.625]


def test_chumpy_handle_is_read():
    data = saved(v=created("chumpy.ch", "ChHandle", mapping(x=ch(array(ROWS)))))
    assert_array_equal(values(data), ROWS)


@pytest.mark.parametrize(
    ("module", "name"),
    [
        ("chumpy.ch", "MatVecMult"),
        ("chumpy.ch_ops", "add"),
        ("chumpy.ch_ops", "dot"),
        ("chumpy.reordering", "transpose"),
        ("chumpy.reordering", "Concatenate"),
        ("chumpy.reordering", "AtleastNd"),
    ],
)
def test_other_chumpy_expressions_are_not_computed(module, name):
    built = created(module, name, mapping(a=ch(array(ROWS)), b=ch(array(ROWS))))
    archive = opened(saved(v=built, w=ch(built), x=select(built, [0], 1), good=array(ROWS)))
    what = Phrase("{name} expression", name=f"{module}.{name}")
    assert [archive.get(key) for key in "vwx"] == [Opaque(what)] * 3
    assert_array_equal(archive.array("good").values(), ROWS)
    with pytest.raises(FormatError) as caught:
        archive.array("v", ("V", 3))
    key, _, values = fault_of(caught.value.diagnostic)
    assert (key, values["found"]) == (
        "F002.value",
        Phrase("an unsupported value ({what})", what=what),
    )


def test_object_arrays_are_opaque():
    given = {"v": np.array({"L_Hip": 1}, dtype=object), "w": np.array([[1], None], dtype=object)}
    for protocol in (2, 5):
        archive = opened(pickle.dumps(given, protocol))
        assert [archive.get(key) for key in "vw"] == [Opaque("object array")] * 2


@pytest.mark.parametrize(
    ("given", "what"),
    [
        (np.zeros(2, "f4,i4"), "structured array"),
        (np.zeros(2, "V8"), "structured array"),
        (np.zeros(2, complex), "array of type c16"),
        (np.zeros(2, "M8[s]"), "array of type M8"),
    ],
    ids=["record", "void", "complex", "date"],
)
def test_arrays_of_other_types_are_opaque(given, what):
    assert opened(pickle.dumps({"v": given}, 2)).get("v") == Opaque(what)


def test_lists_of_arrays_are_read_as_lists():
    found = opened(saved(v=b"](" + array(ROWS) * 2 + b"e")).get("v")
    assert isinstance(found, list)
    assert [part.shape for part in found] == [(4, 3), (4, 3)]


def test_bool_bytes_other_than_0_and_1_are_true():
    assert values(saved(v=array_of((3,), b"\0\1\7", "b1", "|"))).tolist() == [False, True, True]


def test_invalid_code_points_are_refused():
    line = refusal(saved(v=array_of((1,), b"\xff\xff\xff\x7f", "U1")))
    assert line == (
        "F002.archive-value",
        None,
        {"item": "v", "problem": "invalid Unicode code point 2147483647 in a string"},
    )


def test_old_dtype_without_state_is_read():
    plain = named("numpy", "dtype") + several(text("f8"), b"\x89", b"\x88") + b"R"
    built = array(ROWS).replace(element_type(), plain)
    assert plain in built
    assert_array_equal(values(saved(v=built)), ROWS)


def test_array_bytes_stored_as_unicode_are_read():
    built = array(ROWS).replace(payload(ROWS.tobytes()), unicode(ROWS.tobytes().decode("latin-1")))
    assert_array_equal(values(saved(v=built)), ROWS)


def test_bytes_after_the_end_are_reported_in_a_warning():
    source = Source("model.pkl", saved(v=whole(1)) + b"more")
    assert open_archive(source).get("v") == 1
    assert warnings_of(source.diagnostics) == [("F006.pickle-rest", None, {"n": 4})]


def test_synthetic_pickle_equals_its_npz():
    folder = DATA / "smpl_synthetic"
    if not folder.is_dir():
        pytest.skip("no synthetic model next to the checkout")
    archive = open_archive(Source.open(folder / "SMPL_NEUTRAL.pkl"))
    dense = open_archive(Source.open(folder / "SMPL_NEUTRAL.npz"))
    assert set(archive.keys) == set(dense.keys)
    for key in ("v_template", "f", "weights", "shapedirs", "posedirs", "kintree_table", "J"):
        assert_array_equal(archive.array(key).values(), dense.array(key).values())
    for key in ("bs_type", "bs_style"):
        assert archive.text(key) == dense.text(key)
    rows, columns, weights = archive.sparse("J_regressor", ("J", "V")).entries()
    assert_array_equal(weights, dense.array("J_regressor").values()[rows, columns])


def test_pig_pickle_has_the_published_shapes():
    path = DATA / "pig" / "PIG_core.pkl"
    if not path.is_file():
        pytest.skip("no PIG model next to the checkout")
    archive = open_archive(Source.open(path))
    archive.array("vertices", (11239, 3), "f")
    archive.array("faces_vert", (22446, 3), "iu")
    assert len(archive.sparse("skinning_weights", (62, 11239)).data) == 38841
    assert archive.sparse("J_regressor", (62, 11239)).data.dtype == np.float32


@pytest.mark.parametrize(
    ("module", "name"),
    [
        ("scipy.sparse.csc", "csc_matrix"),
        ("scipy.sparse._csc", "csc_matrix"),
        ("scipy.sparse._csc", "csc_array"),
    ],
)
@pytest.mark.parametrize("shape_key", ["_shape", "shape"])
def test_sparse_columns_are_read(module, name, shape_key):
    found = opened(saved(v=matrix(module=module, name=name, shape_key=shape_key))).get("v")
    assert isinstance(found, Sparse)
    assert (found.shape, found.layout) == ((2, 3), "csc")
    assert [part.tolist() for part in found.entries()] == [[0, 1, 0], [0, 2, 2], [1, 2, 3]]


@pytest.mark.parametrize("module", ["scipy.sparse.csr", "scipy.sparse._csr"])
def test_sparse_rows_are_read(module):
    built = matrix(sides=(3, 2), module=module, name="csr_matrix")
    found = opened(saved(v=built)).sparse("v", ("J", "V"))
    assert (found.shape, found.layout) == ((3, 2), "csr")
    assert [part.tolist() for part in found.entries()] == [[0, 2, 2], [0, 1, 0], [1, 2, 3]]


def entries(rows: bytes, columns: bytes, is_new: bool, name: str = "coo_matrix") -> bytes:
    """Return a sparse matrix [[0, 5, 0], [0, 4, 0]], with the rows and columns of its entries."""
    numbers = array(np.array([4.0, 2.0, 3.0]))
    places = {"coords": several(rows, columns)} if is_new else {"row": rows, "col": columns}
    state = mapping(_shape=shape(2, 3), data=numbers, **places)
    return created("scipy.sparse._coo" if is_new else "scipy.sparse.coo", name, state)


@pytest.mark.parametrize("is_new", [True, False])
def test_sparse_entries_are_read(is_new):
    rows, columns = array(np.array([1, 0, 0], "i4")), array(np.array([1, 1, 1], "i4"))
    archive = opened(saved(v=entries(rows, columns, is_new)))
    found = archive.sparse("v", ("J", "V"))
    assert (found.shape, found.layout) == ((2, 3), "coo")
    assert [part.tolist() for part in found.entries()] == [[1, 0, 0], [1, 1, 1], [4, 2, 3]]


@pytest.mark.parametrize("places", [([1, 2, 0], [1, 1, 1]), ([1, 0, 0], [1, -1, 1]), ([0], [0])])
def test_sparse_entries_outside_the_matrix_are_refused(places):
    rows, columns = (array(np.array(each, "i4")) for each in places)
    with pytest.raises(FormatError) as refused:
        opened(saved(v=entries(rows, columns, is_new=True))).sparse("v")
    count = len(places[0])
    key = (
        "expected indices 0 to {last} in a sparse matrix, found {low} to {high}"
        if count == 3
        else "expected {expected} indices in a sparse matrix, found {found}"
    )
    assert refused.value.diagnostic.values["problem"].sentence == key
