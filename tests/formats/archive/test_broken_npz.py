"""Archives with false headers or damage, which are refused in one line with little memory."""

import io
import random
import struct
import zipfile

import numpy as np
import pytest
from faults import Fault, fault_of
from formats.npz_bytes import ROWS, cost, header, look, npy, npz, opened, refusal, zipped
from numpy.testing import assert_array_equal

from viewer.errors import FormatError
from viewer.formats._archive.opening import open_archive
from viewer.formats._source import Source

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
def test_headers_with_false_sizes_are_refused(data: bytes, line: Fault) -> None:
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
def test_headers_with_syntax_errors_are_refused(text: str) -> None:
    key, _, values = refusal(zipped({"v.npy": npy(text, bytes(8))}))
    assert (key, values["item"], values["problem"].sentence) == (
        "F002.archive-value",
        "v",
        "expected a header with descr, fortran_order and shape, found {found}",
    )
    assert len(str(values["problem"])) < 400


@pytest.mark.slow
def test_bomb_is_refused_before_it_is_unpacked() -> None:
    lead = npy(header(shape=f"({60 << 20},)"))
    size = len(lead) + 8 * (60 << 20)
    stream = io.BytesIO()
    with (
        zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open("v.npy", "w") as member,
    ):
        member.write(lead)
        for _ in range(60 * 8):
            member.write(bytes(1 << 20))
    data = stream.getvalue()
    assert len(data) < 1 << 19
    line = ("F002.npz-ratio", None, {"most": 100, "found": size, "size": len(data)})
    assert refusal(data) == line
    assert cost(lambda: refusal(data)) < 4 << 20


def test_max_size_limits_the_sum_of_all_members() -> None:
    data = npz(packed=True, a=np.zeros(1000), b=np.zeros(1000))
    assert refusal(data, 10_000) == ("F001.too-large", None, {"most": 10000, "size": 16256})
    stream = io.BytesIO()
    np.save(stream, np.zeros(0))
    with pytest.raises(FormatError) as caught:
        open_archive(Source("x.npy", stream.getvalue(), 100))
    found = fault_of(caught.value.diagnostic)
    assert found == ("F001.too-large", None, {"most": 100, "size": 128})


def test_many_directory_entries_for_one_member_are_refused() -> None:
    """Entries that share the same data can unpack to any size (Fifield 2019)."""
    data = npz(packed=True, v=np.zeros(1 << 20))
    start = data.index(b"PK\1\2")
    end = data.index(b"PK\5\6")
    entry = data[start:end]
    entries = b"".join(entry.replace(b"v.npy", b"%c.npy" % (65 + n)) for n in range(26))
    tail = struct.pack("<4s4H2LH", b"PK\5\6", 0, 0, 26, 26, len(entries), start, 0)
    key, _, values = refusal(data[:start] + entries + tail)
    assert (key, values["most"]) == ("F002.npz-ratio", 100)
    assert str(values["found"]).startswith("218107")


def test_oversized_directory_is_refused() -> None:
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


def test_encrypted_member_is_refused() -> None:
    line = ("F002.npz-encrypted", None, {"item": "v"})
    assert refusal(changed(npz(v=ROWS), 6, 8, 1)) == line
    assert refusal(changed(npz(v=ROWS), 6, 8, 0x41)) == line


@pytest.mark.parametrize(
    ("method", "found"),
    [
        (12, ("F002.npz-method-name", None, {"item": "v", "method": "bzip2"})),
        (14, ("F002.npz-method-name", None, {"item": "v", "method": "LZMA"})),
        (93, ("F002.npz-method-name", None, {"item": "v", "method": "Zstandard"})),
        (99, ("F002.npz-method", None, {"item": "v", "method": 99})),
    ],
)
def test_unsupported_compression_is_refused(method: int, found: Fault) -> None:
    assert refusal(changed(npz(v=ROWS), 8, 10, method)) == found


@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_duplicate_name_is_refused() -> None:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for _ in "ab":
            archive.writestr("v.npy", npy(header(), bytes(8)))
    assert refusal(stream.getvalue()) == ("F002.npz-twice", None, {"item": "v", "found": 2})
    one = npy(header(), bytes(8))
    assert refusal(zipped({"v.npy": one, "v": one})) == (
        "F002.npz-twice",
        None,
        {"item": "v", "found": 2},
    )


@pytest.mark.parametrize("packed", [False, True])
def test_damaged_values_are_refused(packed: bool) -> None:
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
def test_file_truncated_anywhere_is_refused(data: bytes) -> None:
    for length in range(len(data)):
        with pytest.raises(FormatError):
            look(data[:length])


@pytest.mark.parametrize("data", [SMALL, PACKED, SINGLE], ids=["stored", "deflated", "npy"])
def test_file_with_any_byte_changed_is_read_or_refused(data: bytes) -> None:
    for place in range(len(data)):
        for change in (0x01, 0x20, 0x80, 0xFF):
            survive(data[:place] + bytes([data[place] ^ change]) + data[place + 1 :])


@pytest.mark.parametrize("data", [SMALL, PACKED, SINGLE], ids=["stored", "deflated", "npy"])
def test_file_with_random_damage_is_read_or_refused(data: bytes) -> None:
    dice = random.Random(len(data))
    for _ in range(1000):
        damaged = bytearray(data)
        for _ in range(dice.randint(1, 4)):
            place, length = dice.randrange(len(damaged)), dice.choice([1, 1, 2, 4, 30])
            piece = dice.choice([dice.randbytes(length), b"\xff" * length, b""])
            damaged[place : place + dice.randint(0, length)] = piece
        survive(bytes(damaged))
