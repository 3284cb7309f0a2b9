"""Lazy and exact reading of ``.npz`` and ``.npy`` files, and refusal of inconsistent files."""

import io
import random
import struct
import warnings
import zipfile

import numpy as np
import pytest
from faults import fault_of
from formats.npz_bytes import ROWS, cost, header, look, npy, npz, opened, refusal, zipped
from numpy.testing import assert_array_equal

from viewer.diagnostics import Phrase
from viewer.errors import FormatError
from viewer.formats._archive.opening import open_archive
from viewer.formats._archive.values import Opaque
from viewer.formats._source import Source
from viewer.rigs.arrays import Deferred

GIVEN = {
    "rows": ROWS,
    "fortran": np.asfortranarray(ROWS),
    "big": np.arange(5).astype(">i4"),
    "cube": np.arange(24, dtype=np.float32).reshape(2, 3, 4),
    "bool": np.array([True, False]),
    "single": np.array(120.5),
    "text": np.array("female"),
    "bytes": np.array(b"female"),
    "names": np.array(["a", "bcd"]),
    "none": np.zeros((0, 3), np.uint32),
    "half": np.ones(3, np.float16),
}


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("in_file", [False, True])
def test_every_array_is_read(packed, in_file, tmp_path):
    data = npz(packed=packed, **GIVEN)
    path = tmp_path / "x.npz"
    path.write_bytes(data)
    archive = open_archive(Source.open(path) if in_file else Source("x.npz", data))
    assert (archive.kind, archive.keys) == ("npz", tuple(GIVEN))
    for key, given in GIVEN.items():
        later = archive.get(key)
        assert isinstance(later, Deferred)
        assert not later.is_loaded
        found = later.values()
        assert_array_equal(found, given)
        assert (later.shape, later.dtype) == (given.shape, given.dtype.newbyteorder("="))
        assert (found.shape, found.dtype) == (later.shape, later.dtype)
        assert found.flags.c_contiguous
        assert not found.flags.writeable


def test_only_requested_arrays_are_read(tmp_path):
    path = tmp_path / "x.npz"
    np.savez(path, large=np.zeros(4 << 20), small=ROWS)
    source = Source.open(path)
    assert cost(lambda: open_archive(source).array("small").values()) < 1 << 20


def test_compressed_arrays_are_not_decompressed_on_opening():
    data = npz(packed=True, large=np.zeros(6 << 20))
    assert cost(lambda: opened(data).get("large")) < 1 << 20


def test_reading_makes_no_second_copy(tmp_path):
    path = tmp_path / "x.npz"
    np.savez(path, large=np.ones(2 << 20))
    archive = open_archive(Source.open(path))
    assert cost(lambda: archive.array("large").values()) < (16 << 20) + (5 << 20)


def test_changed_file_is_not_read(tmp_path):
    path = tmp_path / "x.npz"
    np.savez(path, v=ROWS)
    archive = open_archive(Source.open(path))
    np.savez(path, v=ROWS + 1, w=ROWS)
    with pytest.raises(FormatError) as caught:
        archive.array("v").values()
    assert fault_of(caught.value.diagnostic) == ("F002.changed", None, {})
    path.unlink()
    with pytest.raises(FormatError) as caught:
        archive.array("v").values()
    assert fault_of(caught.value.diagnostic) == (
        "F001.unreadable",
        None,
        {"reason": "No such file or directory", "near": ""},
    )


def test_headers_from_other_writers_are_read():
    one = struct.pack("<d", 2.5)
    headers = [
        npy("{'descr':'<f8','fortran_order':False,'shape':(1,)}", one),
        npy("{'shape': (1L,), 'fortran_order': False, 'descr': '<f8'}\n", one),
        npy("{'descr': '<f8', 'fortran_order': True, 'shape': (1, 1L), }", one),
        npy(header(), one, b"\2\0"),
        npy(header(), one, b"\3\0"),
        npy(header() + " " * 60_000, one),
        npy(header("'f8'"), one),
    ]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for data in headers:
            found = opened(zipped({"v.npy": data})).array("v").values()
            assert found.reshape(-1).tolist() == [2.5], data


@pytest.mark.parametrize(
    ("given", "what"),
    [
        (np.array({"L_Hip": 1}, dtype=object), "object array"),
        (np.array([None, "a"], dtype=object), "object array"),
        (np.zeros(2, "f4,i4"), "structured array"),
        (np.zeros(2, [("a", "f4", 3)]), "structured array"),
        (np.zeros(2, "V8"), "array of type |V8"),
        (np.zeros(2, complex), "array of type <c16"),
        (np.zeros(2, "M8[s]"), "array of type <M8[s]"),
    ],
    ids=["object", "objects", "record", "sub-array", "void", "complex", "date"],
)
def test_unsupported_dtypes_are_refused_without_evaluation(given, what):
    archive = opened(npz(v=given, good=ROWS))
    assert archive.get("v") == Opaque(what)
    assert_array_equal(archive.array("good").values(), ROWS)
    with pytest.raises(FormatError) as caught:
        archive.array("v")
    key, _, values = fault_of(caught.value.diagnostic)
    assert (key, values["found"]) == (
        "F002.value",
        Phrase("an unsupported value ({what})", what=what),
    )


def test_pickles_inside_are_never_opened(tmp_path):
    marker = tmp_path / "marker"
    attack = b"cos\nsystem\n(S'touch " + str(marker).encode() + b"'\ntR."
    data = zipped({"v.npy": npy(header("'|O'", shape="()"), attack), "w.pkl": attack})
    archive = opened(data)
    assert archive.get("v") == Opaque("object array")
    assert archive.get("w.pkl") == Opaque("not an array")
    assert not marker.exists()


def test_names_with_parent_folders_are_treated_as_plain_names():
    data = zipped({"../../etc/x.npy": npy(header(), bytes(8)), "a\nb.npy": npy(header(), b"")})
    problem = "expected 1 float64, found 0 bytes"
    assert refusal(data) == ("F002.archive-value", None, {"item": r"a\nb", "problem": problem})


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("count", [1, 4, 100])
def test_blocks_of_rows_are_those_of_the_whole_array(packed, count):
    given = GIVEN | {"many": np.arange(66.0).reshape(11, 3, 2)}
    archive = opened(npz(packed=packed, **given))
    for key, value in given.items():
        if value.ndim and value.dtype.kind in "biuf":
            array = archive.array(key)
            blocks = [block.copy() for block in array.blocks(count)]
            assert all(len(block) <= count for block in blocks)
            joined = np.concatenate(blocks) if blocks else np.zeros((0, *value.shape[1:]))
            assert_array_equal(joined, value)
            # Rows in C order and in the machine's byte order are not read as a whole.
            if key == "many":
                assert not array.is_loaded


def test_single_arrays_are_read_by_blocks(tmp_path):
    values = np.arange(66.0).reshape(11, 3, 2)
    np.save(tmp_path / "v.npy", values)
    array = open_archive(Source.open(tmp_path / "v.npy")).array("arr_0")
    assert_array_equal(np.concatenate([block.copy() for block in array.blocks(4)]), values)
    assert not array.is_loaded


def test_damage_is_detected_while_reading_blocks():
    values = np.arange(60_000.0).reshape(-1, 3)
    data = bytearray(npz(v=values))
    data[len(data) // 2] ^= 1
    array = opened(bytes(data)).array("v")
    with pytest.raises(FormatError):
        for _ in array.blocks(100):
            pass


BOUND = 64 << 20  # limit of allocated memory in bytes


@pytest.mark.parametrize(
    ("data", "line"),
    [
        (npy(header(shape="(1099511627776,)"), bytes(8)), ("F002.archive-value", None,
         {"item": "v", "problem": "expected 1099511627776 float64, found 8 bytes"})),
        (npy(header(shape="(0, 4611686018427387904)")), ("F002.archive-value", None, {"item": "v",
         "problem": "expected 0 x 4611686018427387904 float64, found 0 bytes"})),
        (npy(header(shape="(2,)"), bytes(8)), ("F002.archive-value", None, {"item": "v",
         "problem": "expected 2 float64, found 8 bytes"})),
        (npy(header(shape="(1,)"), bytes(9)), ("F002.archive-value", None, {"item": "v",
         "problem": "expected 1 float64, found 9 bytes"})),
        (npy(header(shape="()")), ("F002.archive-value", None, {"item": "v",
         "problem": "expected a single float64, found 0 bytes"})),
        (npy(header("'|S4'", shape="(9,)"), bytes(8)), ("F002.archive-value", None, {"item": "v",
         "problem": "expected 9 bytes32, found 8 bytes"})),
        (npy("")[:10], ("F002.archive-value", None, {"item": "v",
         "problem": ("expected a header with descr, fortran_order and shape, "
        "found b''")})),
        (npy("{}"), ("F002.archive-value", None, {"item": "v",
         "problem": ("expected a header with descr, fortran_order and shape, "
        "found b'{}'")})),
        (npy(header(), version=b"\4\0"), ("F002.archive-value", None, {"item": "v",
         "problem": "expected an .npy header, found b'\\x93NUMPY\\x04\\x00'"})),
        (b"cos\nsystem\n", ("F002.archive-value", None, {"item": "v",
         "problem": "expected an .npy header, found b'cos\\nsyst'"})),
        (b"", ("F002.archive-value", None, {"item": "v",
         "problem": "expected an .npy header, found b''"})),
        (npy(b"x" * 10)[:15], ("F002.archive-value", None, {"item": "v",
         "problem": "expected a header of 10 bytes, found 5"})),
        (npy("")[:6] + b"\2\0\0\0\1\0", ("F002.archive-value", None, {"item": "v",
         "problem": "expected a header smaller than 64 KiB, found 65536 bytes"})),
        (npy("", version=b"\2\0")[:8], ("F002.archive-value", None, {"item": "v",
         "problem": ("expected a header with descr, fortran_order and shape, "
        "found b''")})),
    ],
)  # fmt: skip
def test_headers_with_false_sizes_are_refused(data, line):
    whole = zipped({"v.npy": data})
    assert refusal(whole) == line
    assert cost(lambda: refusal(whole)) < BOUND


@pytest.mark.parametrize(
    "text",
    [
        header(shape="(-1,)"),
        header(shape="(1.5,)"),
        header(shape="(1_0,)"),
        header(shape="(,)"),
        header(shape="(1,,2)"),
        header(shape="(" + "1," * 33 + ")"),
        header(shape="(" + "9" * 5000 + ",)"),
        header(shape="(" * 20_000),
        header(shape="[1]"),
        header(order="0"),
        header(descr="'<f8"),
        header(descr="1"),
        header(descr="'" + "x" * 30 + "'"),
        header()[:-10],
        header() + header(),
        header() + "__import__('os')",
        "{" * 60_000,
        "[" * 60_000,
        "'descr': " * 7_000,
        header().replace("'shape'", "'size'"),
        header().replace("{", "{'extra': 1, "),
    ],
    ids=lambda text: text[:40],
)
def test_headers_with_syntax_errors_are_refused(text):
    key, _, values = refusal(zipped({"v.npy": npy(text, bytes(8))}))
    assert (key, values["item"], values["problem"].sentence) == (
        "F002.archive-value",
        "v",
        "expected a header with descr, fortran_order and shape, found {found}",
    )
    assert len(str(values["problem"])) < 400


@pytest.mark.slow
def test_bomb_is_refused_before_it_is_unpacked():
    lead = npy(header(shape=f"({9 << 20},)"))
    size = len(lead) + 8 * (9 << 20)
    stream = io.BytesIO()
    with (
        zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open("v.npy", "w") as member,
    ):
        member.write(lead)
        for _ in range(9 * 8):
            member.write(bytes(1 << 20))
    data = stream.getvalue()
    assert len(data) < 1 << 19
    line = ("F002.zip-ratio", None, {"most": 100, "found": size, "size": len(data)})
    assert refusal(data) == line
    assert cost(lambda: refusal(data)) < 4 << 20


def test_max_size_limits_the_sum_of_all_members():
    data = npz(packed=True, a=np.zeros(1000), b=np.zeros(1000))
    assert refusal(data, 10_000) == ("F001.too-large", None, {"most": 10000, "size": 16256})
    stream = io.BytesIO()
    np.save(stream, np.zeros(0))
    with pytest.raises(FormatError) as caught:
        open_archive(Source("x.npy", stream.getvalue(), 100))
    found = fault_of(caught.value.diagnostic)
    assert found == ("F001.too-large", None, {"most": 100, "size": 128})


def test_many_directory_entries_for_one_member_are_refused():
    """Entries that share the same data can unpack to any size (Fifield 2019)."""
    data = npz(packed=True, v=np.zeros(1 << 20))
    start = data.index(b"PK\1\2")
    end = data.index(b"PK\5\6")
    entry = data[start:end]
    entries = b"".join(entry.replace(b"v.npy", b"%c.npy" % (65 + n)) for n in range(26))
    tail = struct.pack("<4s4H2LH", b"PK\5\6", 0, 0, 26, 26, len(entries), start, 0)
    key, _, values = refusal(data[:start] + entries + tail)
    assert (key, values["most"]) == ("F002.zip-ratio", 100)
    assert str(values["found"]).startswith("218107")


def test_oversized_directory_is_refused():
    data = zipped({f"{number:0>50}": b"" for number in range(25_000)})
    line = refusal(data)
    assert line == (("F002.npz", None, {"reason": "a directory of 2400000 bytes"}))
    assert cost(lambda: refusal(data)) < BOUND


def changed(data: bytes, local: int, central: int, value: int) -> bytes:
    """Set two bytes in the first local header and the first directory entry."""
    buffer = bytearray(data)
    struct.pack_into("<H", buffer, data.index(b"PK\3\4") + local, value)
    struct.pack_into("<H", buffer, data.index(b"PK\1\2") + central, value)
    return bytes(buffer)


def test_encrypted_member_is_refused():
    line = ("F002.zip-encrypted", None, {"item": "v"})
    assert refusal(changed(npz(v=ROWS), 6, 8, 1)) == line
    assert refusal(changed(npz(v=ROWS), 6, 8, 0x41)) == line


@pytest.mark.parametrize(
    ("method", "found"),
    [
        (12, ("F002.zip-method", None, {"item": "v", "method": "bzip2"})),
        (14, ("F002.zip-method", None, {"item": "v", "method": "LZMA"})),
        (93, ("F002.zip-method", None, {"item": "v", "method": "Zstandard"})),
        (99, ("F002.zip-method", None, {"item": "v", "method": "compression method 99"})),
    ],
)
def test_unsupported_compression_is_refused(method, found):
    assert refusal(changed(npz(v=ROWS), 8, 10, method)) == found


@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_duplicate_name_is_refused():
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for _ in "ab":
            archive.writestr("v.npy", npy(header(), bytes(8)))
    assert refusal(stream.getvalue()) == ("F002.zip-twice", None, {"item": "v", "found": 2})
    one = npy(header(), bytes(8))
    assert refusal(zipped({"v.npy": one, "v": one})) == (
        "F002.zip-twice",
        None,
        {"item": "v", "found": 2},
    )


@pytest.mark.parametrize("packed", [False, True])
def test_damaged_values_are_refused(packed):
    data = bytearray(npz(packed=packed, v=np.arange(1000.0), w=ROWS))
    data[600] ^= 0xFF
    key, _, values = refusal(bytes(data))
    assert (key, values["item"]) == ("F002.archive-value", "v")
    archive = opened(bytes(data))
    assert_array_equal(archive.array("w").values(), ROWS)


SMALL = npz(v=ROWS, t=np.array("lbs"))
PACKED = npz(packed=True, v=np.zeros((30, 3)), f=np.asfortranarray(ROWS))
stream = io.BytesIO()


np.save(stream, ROWS)


SINGLE = stream.getvalue()


def survive(data: bytes) -> None:
    try:
        look(data)
    except FormatError as problem:
        assert "\n" not in str(problem)


@pytest.mark.parametrize("data", [SMALL, PACKED, SINGLE], ids=["stored", "deflated", "npy"])
def test_file_truncated_anywhere_is_refused(data):
    for length in range(len(data)):
        with pytest.raises(FormatError):
            look(data[:length])


@pytest.mark.parametrize("data", [SMALL, PACKED, SINGLE], ids=["stored", "deflated", "npy"])
def test_file_with_any_byte_changed_is_read_or_refused(data):
    for place in range(len(data)):
        for change in (0x01, 0x20, 0x80, 0xFF):
            survive(data[:place] + bytes([data[place] ^ change]) + data[place + 1 :])


@pytest.mark.parametrize("data", [SMALL, PACKED, SINGLE], ids=["stored", "deflated", "npy"])
def test_file_with_random_damage_is_read_or_refused(data):
    dice = random.Random(len(data))
    for _ in range(1000):
        damaged = bytearray(data)
        for _ in range(dice.randint(1, 4)):
            place, length = dice.randrange(len(damaged)), dice.choice([1, 1, 2, 4, 30])
            piece = dice.choice([dice.randbytes(length), b"\xff" * length, b""])
            damaged[place : place + dice.randint(0, length)] = piece
        survive(bytes(damaged))
