"""Reported progress of reading and writing, and cancellation at any report."""

import numpy as np
import pytest

from viewer.exporters import export
from viewer.formats import Source, obj, ply, write
from viewer.formats._text.number_text import row_texts
from viewer.media.saving import save_parts
from viewer.progress import Cancelled, receiving, report
from viewer.rigs.scene import Actor

HEAD = "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\n"


HEAD += "property float z\nend_header\n"


@pytest.fixture(scope="module")
def large_files(tmp_path_factory):
    folder, n = tmp_path_factory.mktemp("large"), 170_000
    (folder / "a.ply").write_text(HEAD.format(n) + "1.25 2.5 10.125\n" * n)
    (folder / "a.obj").write_text("v 1.25 2.5 10.125\n" * n + "f 1 2 3\n")
    return folder


@pytest.mark.parametrize(("reader", "size"), [(ply, 2), (obj, 3)])
def test_reading_reports_megabytes_up_to_the_total(large_files, reader, size):
    path = large_files / f"a.{reader.__name__.rpartition('.')[2]}"
    found = []
    with receiving(lambda *step: found.append(step)):
        reader.read(Source(path))
    assert found[0] == (0, 0, "MB", f"reading {path.name}")
    assert found[-1] == (size, size, "MB", "")
    done = [step[0] for step in found]
    assert done == sorted(done) and len(done) > 8


@pytest.mark.parametrize("reader", [ply, obj])
def test_reading_can_be_cancelled_at_any_part(large_files, reader):
    calls = []

    def receive(*_):
        calls.append(None)
        if len(calls) == 6:
            raise Cancelled

    path = large_files / f"a.{reader.__name__.rpartition('.')[2]}"
    with receiving(receive), pytest.raises(Cancelled):
        reader.read(Source(path))
    assert len(calls) == 6


def test_cancelled_writing_keeps_the_old_file(tmp_path):
    def receive(done, total, unit, what):
        assert (total, unit, what) == (0, "MB", "writing a.txt")
        raise Cancelled

    (tmp_path / "a.txt").write_text("old")
    with receiving(receive), pytest.raises(Cancelled):
        save_parts(tmp_path / "a.txt", row_texts(np.zeros((9, 9), np.int32)))
    assert [(file.name, file.read_text()) for file in tmp_path.iterdir()] == [("a.txt", "old")]


def write_mesh(figure, path):
    if path.suffix == ".skin":
        write(figure, path)
    else:
        export(Actor(figure), path)


@pytest.mark.parametrize("suffix", ["obj", "skin"])
def test_writing_a_mesh_reports_lines_up_to_the_total(tmp_path, suffix):
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 3 4\n"
    figure = obj.read(Source("a.obj", text.encode()))
    found = []
    with receiving(lambda *step: found.append(step)):
        write_mesh(figure, tmp_path / f"a.{suffix}")
    # Four positions, four normals and two triangles; an .obj file is then read back.
    written = {step[1:] for step in found if step[2] == "lines"}
    assert written == {(10, "lines", f"writing a.{suffix}")}
    done = [step[0] for step in found]
    assert done == sorted(done) and done[-1] == 10


def test_reports_are_sent_only_to_the_innermost_receiver():
    outer, inner = [], []
    report(1, 2, "steps")
    with receiving(lambda *step: outer.append(step)):
        with receiving(lambda *step: inner.append(step)):
            report(1, 2, "steps", "working")
        report(2, 2, "steps")
    assert inner == [(1, 2, "steps", "working")]
    assert outer == [(2, 2, "steps", "")]


def test_released_files_are_read_again(tmp_path):
    path = tmp_path / "a.obj"
    path.write_bytes(b"\xef\xbb\xbfv 0\nv 1\n")
    source = Source(path)
    assert source.data == b"v 0\nv 1\n"
    source.release()
    path.write_bytes(b"v 0\n\nv 2\n")
    assert source.line(5) == 3


def test_data_without_a_file_is_kept():
    source = Source("a.obj", b"v 0\n")
    source.release()
    assert source.data == b"v 0\n"
