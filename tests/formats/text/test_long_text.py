"""Long text files, which are read part by part: the same content, offsets and lines."""

import re
from itertools import pairwise

import numpy as np
import pytest

from viewer.errors import FormatError
from viewer.formats import Source, _source, read
from viewer.formats._source import LongText, count_line_ends, line_parts, without_marks
from viewer.formats.obj import lines

MARK = b"\xef\xbb\xbf"
TEXTS = [
    b"",
    b"\n",
    b"one line",
    b"a\nb\r\nc\rd\r\r\ne\n\n\r\r\rf",
    b"a\r" * 4 + b"\n" + b"b\r\n" * 3,
    MARK + b"a\nb\n\x1a\x1a",
    MARK + b"\x1a",
    b"x\nends with a letter\x1a",
    b"ply\r\n\x1a",
    b"a\n" + b"\x1a" * 5000,
]


@pytest.fixture(autouse=True)
def _short_is_long(monkeypatch):
    monkeypatch.setattr(_source, "_LONG", 0)


def stored(folder, data: bytes) -> LongText:
    path = folder / "a.txt"
    path.write_bytes(data)
    return LongText(path, len(data))


@pytest.mark.parametrize("length", [1, 2, 3, 7, 1000])
@pytest.mark.parametrize("data", TEXTS)
def test_parts_of_whole_lines_make_up_the_text(tmp_path, data, length):
    wanted = without_marks(data)
    text = stored(tmp_path, data)
    parts = list(line_parts(text, length))
    assert b"".join(parts) == wanted
    assert parts == list(line_parts(wanted, length))
    assert len(text) == len(wanted)
    assert all(part.endswith((b"\n", b"\r")) for part in parts[:-1])
    assert all(parts)
    assert not any(
        one.endswith(b"\r") and next_.startswith(b"\n") for one, next_ in pairwise(parts)
    )


@pytest.mark.parametrize("block", [1, 2, 3, 5, 1000])
@pytest.mark.parametrize("data", TEXTS)
def test_line_ends_are_counted_across_blocks(tmp_path, monkeypatch, data, block):
    monkeypatch.setattr(_source, "_BLOCK", block)
    wanted, text = without_marks(data), stored(tmp_path, data)
    for start in range(len(wanted) + 1):
        for end in range(start, len(wanted) + 1):
            ends = len(re.findall(rb"\r*\n|\r", wanted[start:end]))
            assert count_line_ends(wanted, start, end) == ends
            assert count_line_ends(text, start, end) == ends


def test_line_that_is_longer_than_many_parts_is_one_part(tmp_path):
    line = b"f" + b" 1" * 5000 + b"\n"
    parts = list(line_parts(stored(tmp_path, b"v\n" + line + b"v\n"), 16))
    assert parts == [b"v\n", line + b"v\n"]


FACES = b"""# a comment\rv 0 0 0\r\nv 1 \\
0 0
v 0 \\\r\n \\\r\r\n1 0
v 0 0 1
vn 0 \\\r0 1
f 1 2 \\
3
o part
f -1 -2 -3
f 2 3 4
curv 1
l 1 2
"""


def obj_of(source: Source):
    figure = read(source)
    return figure.mesh, source.warnings, source.place("triangles", 1)


@pytest.mark.parametrize("marks", [(b"", b""), (MARK, b"\x1a")])
@pytest.mark.parametrize("piece", [5, 16, 1 << 18])
def test_long_obj_gives_the_same_mesh_and_lines(tmp_path, monkeypatch, marks, piece):
    first, last = marks
    wanted, warnings, place = obj_of(Source(tmp_path / "a.obj", FACES))
    assert wanted.triangles.tolist() == [[0, 1, 2], [3, 2, 1], [1, 2, 3]]
    assert place == (tmp_path / "a.obj", 14)
    monkeypatch.setattr(lines, "_PIECE", piece)
    (tmp_path / "a.obj").write_bytes(first + FACES + last)
    # The whole file is never in memory.
    monkeypatch.setattr(_source, "read_bytes", lambda *_: pytest.fail("read as a whole"))
    mesh, also, there = obj_of(Source.open(tmp_path / "a.obj"))
    np.testing.assert_array_equal(mesh.positions, wanted.positions)
    np.testing.assert_array_equal(mesh.normals, wanted.normals)
    np.testing.assert_array_equal(mesh.triangles, wanted.triangles)
    assert (also, there) == (warnings, place)


def test_error_in_a_long_obj_states_its_line(tmp_path):
    (tmp_path / "a.obj").write_bytes(FACES + b"f 1 2 9\n")
    with pytest.raises(FormatError, match=r"a\.obj:18: "):
        read(Source.open(tmp_path / "a.obj"))


def test_missing_or_too_large_file_is_refused(tmp_path):
    (tmp_path / "a.obj").write_bytes(FACES)
    with pytest.raises(FormatError, match="at most 9 bytes"):
        list(Source(tmp_path / "a.obj", max_size=9).line_parts(4))
    with pytest.raises(FormatError):
        list(Source(tmp_path / "b.obj").line_parts(4))


def test_long_file_that_begins_with_blanks_is_recognised(tmp_path):
    path = tmp_path / "a.dat"
    path.write_bytes(b" \n" * 200_000 + FACES)
    assert read(Source.open(path)).mesh.n_triangles == 3
