import gzip
from pathlib import Path

import numpy as np
import pytest
from faults import fault_of, refusal_of, warnings_of

from viewer.errors import FormatError
from viewer.formats import KNOWN, Source, detect

ANY = KNOWN
SKEL = b"balljoint a { }"
SKIN = b"positions 1 { 0 0 0 } triangles 1 { 0 0 0 }"


def found(name, data):
    source = Source(name, data)
    return detect(source), warnings_of(source.diagnostics)


@pytest.mark.parametrize(("data", "key"), [(SKEL, "skel"), (SKIN, "skin")])
@pytest.mark.parametrize("suffix", ["", ".txt", ".{key}", ".{KEY}"])
def test_content_determines_the_format(data, key, suffix):
    name = "a" + suffix.format(key=key, KEY=key.upper())
    assert found(name, data) == (key, [])


@pytest.mark.parametrize(
    ("name", "data", "key", "values"),
    [
        ("a.skin", SKEL, "skel", {"found": ".skel", "suffix": ".skin"}),
        ("a.skel", SKIN, "skin", {"found": ".skin", "suffix": ".skel"}),
        ("A.SKEL", SKIN, "skin", {"found": ".skin", "suffix": ".skel"}),
    ],
)
def test_wrong_suffix_is_reported_as_a_warning(name, data, key, values):
    assert found(name, data) == (key, [("F007.suffix", None, values)])


@pytest.mark.parametrize(
    "data", [b"\xef\xbb\xbf" + SKEL, b"\n" * 200_000 + SKEL, b"balljoint{}", b"x{}balljoint a{}"]
)
def test_skeleton_is_recognised(data):
    assert found("a", data) == ("skel", [])


@pytest.mark.parametrize(
    "data",
    [
        b" " * 200_000 + SKIN,
        b"bindings\r\n3",
        b"foo{}triangles +1",
        b"normals nan",
        b"texcoords\t\t1",
        b"skinweights 3",
    ],
)
def test_skin_is_recognised(data):
    assert found("a", data) == ("skin", [])


@pytest.mark.parametrize(
    ("data", "kind"),
    [
        (b"", "an empty file"),
        (b"\xef\xbb\xbf", "an empty file"),
        (b" \n\t", "only white space"),
        (b"\n" * 100_000, "only white space"),
        (b"\0" * 100, "zeros"),
        (b"\1a\0\0b\2\0\0\0c", "binary data"),
        (gzip.compress(SKEL, mtime=0), "gzip data"),
        (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", "a PNG image"),
        (b"\xff\xd8\xff\xe0\0\x10JFIF", "a JPEG image"),
        (b"BM\x36\0\x0c\0", "a BMP image"),
        (b"GIF89a", "a GIF image"),
        (b"%PDF-1.7", "a PDF document"),
        (b"\x7fELF\2\1\1", "a program (ELF)"),
        ("balljoint a {}".encode("utf-16"), "UTF-16 text"),
        ("balljoint a {}".encode("utf-16-be"), "UTF-16 text"),
        ("balljoint a {}".encode("utf-16-le"), "UTF-16 text"),
        (b"\n<!DOCTYPE html><html>positions</html>", "HTML or XML (a failed download?)"),
        (b"<HTML>", "HTML or XML (a failed download?)"),
        (b"<?xml version='1.0'?>", "HTML or XML (a failed download?)"),
    ],
)
@pytest.mark.parametrize(
    ("name", "wanted"), [("a.skel", ".skel"), ("a.skin", ".skin"), ("a", None)]
)
def test_content_of_other_kinds_is_described(data, kind, name, wanted):
    with pytest.raises(FormatError) as caught:
        found(name, data)
    assert caught.value.path == Path(name)
    values = {"wanted": wanted or ANY, "looks": kind}
    assert fault_of(caught.value.diagnostic) == ("F002.kind", None, values)


def test_expected_suffix_is_that_of_the_file():
    # The suffixes of glTF also include .glb, which comes first in the table.
    fault = refusal_of(lambda: found("a.GLTF", b""))
    assert fault == ("F002.kind", None, {"wanted": ".gltf", "looks": "an empty file"})


def test_text_in_another_format_is_refused():
    fault = refusal_of(lambda: found("a.txt", b"hello world"))
    assert fault == ("F002.unknown-kind", None, {"wanted": ANY})


@pytest.mark.parametrize("name", ["a.glb", "a.vrm", "a", "a.json.gltf"])
@pytest.mark.parametrize("data", [b"glTF\2\0\0\0", b'\n{"scene": 0, "asset" : {"version": "2.0"}}'])
def test_gltf_is_recognised(name, data):
    assert detect(Source(name, data)) == "gltf"


@pytest.mark.parametrize(("name", "key"), [("a.skel", "skel"), ("a.skin", "skin")])
def test_unknown_text_with_a_known_suffix_is_passed_to_its_reader(name, key):
    assert found(name, b"hello world") == (key, [])


@pytest.mark.parametrize(
    ("data", "kind"), [(b"PK\x03\x04\x14", "a ZIP archive"), (b"\x93NUMPY\1\0", "a numpy array")]
)
def test_broken_archive_with_a_text_suffix_is_described(data, kind):
    fault = refusal_of(lambda: detect(Source("a.skel", data)))
    assert fault == ("F002.kind", None, {"wanted": ".skel", "looks": kind})


def test_folder_of_other_files_is_refused(tmp_path):
    (tmp_path / "a.txt").write_text("hello")
    fault = refusal_of(lambda: detect(Source.open(tmp_path)))
    assert fault == ("F002.unknown-folder", None, {"folder": str(tmp_path)})


@pytest.mark.parametrize(
    ("arrays", "key", "found"),
    [({"a": 1, "b": 2}, "F002.unknown-archive", ["a", "b"]), ({}, "F002.empty-archive", None)],
)
def test_archive_with_unknown_keys_is_refused(tmp_path, arrays, key, found):
    np.savez(tmp_path / "a.npz", **arrays)
    other, line, values = refusal_of(lambda: detect(Source.open(tmp_path / "a.npz")))
    assert (other, line, values.get("found")) == (key, None, found)


@pytest.mark.parametrize("keys", [["poses"], ["root_orient", "pose_body"]])
def test_motions_are_recognised_in_spite_of_objects_that_cannot_be_read(tmp_path, keys):
    widths = {"poses": 66, "root_orient": 3, "pose_body": 63}
    arrays = {key: np.zeros((4, widths[key])) for key in keys}
    objects = np.array([gzip.GzipFile], dtype=object)
    np.savez(tmp_path / "a.npz", mocap_framerate=60.0, labels=objects, **arrays)
    assert detect(Source.open(tmp_path / "a.npz")) == "amass"


@pytest.mark.parametrize(
    ("shape", "text"),
    [
        ((6, 263), "probably features of HumanML3D or KIT"),
        ((6, 322), "probably motions of Motion-X"),
        ((6, 22, 3), "probably positions of joints"),
        ((6, 72), "found a single array (6 x 72 float64)"),
    ],
)
def test_array_without_a_name_is_described(tmp_path, shape, text):
    np.save(tmp_path / "a.npy", np.zeros(shape))
    with pytest.raises(FormatError) as caught:
        detect(Source.open(tmp_path / "a.npy"))
    assert caught.value.diagnostic.key == "F002.unnamed-array"
    assert text in str(caught.value)
