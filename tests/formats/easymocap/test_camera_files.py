"""EasyMocap cameras: valid and broken files of OpenCV's FileStorage, and the search for them."""

import numpy as np
import pytest
from faults import fault_of
from formats.capture_files import body, opened, write_frames
from numpy.testing import assert_allclose, assert_array_equal

from viewer.errors import FormatError
from viewer.formats import Source
from viewer.formats.easymocap.cameras import find_cameras, read_storage

HEAD = "%YAML:1.0\n---\n"
# Lists are wrapped like long lists of OpenCV.
INTRINSIC = (
    HEAD
    + """names:
  - "01"
  - "b c"
K_01: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 1.2e+03, 0., 512., 0., 1100.5,
       3.84e2, 0., 0., 1. ]
dist_01: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ -0.1, 2.5e-02, 0., 0., 0. ]
H_01: 768
W_01: 1024.
"K_b c": !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 900., 0., 500., 0., 900., 400., 0., 0., 1. ]
"""
)


def matrix(key, rows, columns, numbers):
    data = ", ".join(map(repr, numbers))
    text = f"{key}: !!opencv-matrix\n  rows: {rows}\n  cols: {columns}\n  dt: d\n"
    return f"{text}  data: [{data}]\n"


# A rotation by 90 degrees about x, which maps y to z.
QUARTER = [1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0]
EXTRINSIC = HEAD + 'names: [ "01", "b c" ]\n'
EXTRINSIC += matrix("R_01", 3, 1, [9.0, 9.0, 9.0]) + matrix("Rot_01", 3, 3, QUARTER)
EXTRINSIC += matrix("T_01", 3, 1, [0.5, -1.0, 3.0])
EXTRINSIC += matrix('"R_b c"', 3, 1, [np.pi / 2, 0.0, 0.0])
EXTRINSIC += matrix('"T_b c"', 1, 3, [0.0, 0.0, 2.0])


def cameras(folder, intrinsic=INTRINSIC, extrinsic=EXTRINSIC):
    (folder / "intri.yml").write_text(intrinsic)
    (folder / "extri.yml").write_text(extrinsic)
    return find_cameras([folder], 1 << 20)


def storage(text):
    return read_storage(Source("a.yml", text.encode())).values


def test_cameras_are_read(tmp_path):
    views, notes = cameras(tmp_path)
    assert (notes, [view.name for view in views]) == ([], ["01", "b c"])
    assert_array_equal(views[0].intrinsic, [[1200, 0, 512], [0, 1100.5, 384], [0, 0, 1]])
    assert_array_equal(views[0].distortion, [-0.1, 0.025, 0, 0, 0])
    assert (views[0].size, views[1].size) == ((1024, 768), None)
    for view in views:
        assert_allclose(view.rotation, np.reshape(QUARTER, (3, 3)), rtol=0, atol=1e-15)
    assert_array_equal(views[0].translation, [0.5, -1, 3])
    assert_array_equal(views[1].distortion, [])


def test_line_endings_comments_and_headers_are_ignored():
    text = "\ufeff" + HEAD + "# one\r\nnames:\r\n- '1'\r\n- \"2\"\r\nH_1: 5\r\n...\r\n"
    assert storage(text) == {"names": ["1", "2"], "H_1": "5"}


@pytest.mark.parametrize("level", ["out/smpl", "out", "."])
def test_cameras_are_found_next_to_the_frames_and_above(tmp_path, level):
    write_frames(tmp_path / "out" / "smpl", {0: [body(0)]})
    cameras(tmp_path / level)
    for path in (tmp_path / "out", tmp_path / "out" / "smpl"):
        capture, _, warnings = opened(path)
        assert [view.name for view in capture.views] == ["01", "b c"]
        assert (capture.warnings, warnings) == ((), [])


def test_invalid_cameras_do_not_affect_bodies(tmp_path):
    write_frames(tmp_path / "smpl", {0: [body(0)]})
    cameras(tmp_path, intrinsic="nonsense")
    capture, parts, _ = opened(tmp_path)
    assert (capture.views, list(parts[0].bodies)) == ((), [0])
    assert tuple(map(fault_of, capture.warnings)) == (
        ("F007.cameras", 1, {"problem": ("F002.camera-value", None, {"found": b"nonsense"})}),
    )


def test_camera_file_without_its_counterpart_is_reported(tmp_path):
    (tmp_path / "extri.yml").write_text(EXTRINSIC)
    views, (note,) = find_cameras([tmp_path], 1 << 20)
    assert (views, note.path) == ((), tmp_path / "extri.yml")
    assert fault_of(note) == ("F007.cameras-beside", None, {"name": "intri.yml"})
    assert find_cameras([tmp_path / "none"], 1 << 20) == ((), [])


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        ("intri", "K_01", "K_02", ("F002.camera-no-key", 3, {"item": "K_01", "shape": (3, 3)})),
        ("intri", "1.2e+03", "-1", ("F002.camera-focal", 6, {"item": "K_01"})),
        ("intri", "1.2e+03", "1e30", ("F002.camera-focal-range", 6, {"item": "K_01", "low": 0.001,
         "high": 1000000000.0, "first": 1e30, "second": 1100.5})),
        ("intri", "1100.5", "1e-320", ("F002.camera-focal-range", 6, {"item": "K_01",
         "low": 0.001, "high": 1000000000.0, "first": 1200.0, "second": 1e-320})),
        ("intri", "512.", "-1e10", ("F003.camera-limit", 6, {"item": "K_01",
         "limit": 1000000000.0, "found": -10000000000.0})),
        ("intri", "-0.1,", "-2e6,", ("F003.camera-limit", 12, {"item": "dist_01",
         "limit": 1000000.0, "found": -2000000.0})),
        ("extri", "-1.0, 3.0", "1e38, 3.0", ("F003.camera-limit", 14, {"item": "T_01",
         "limit": 1000000000.0, "found": 1e38})),
        ("extri", "T_01", "T_1", ("F002.camera-no-key", 3, {"item": "T_01", "shape": (3,)})),
        ("extri", "Rot_01: !!opencv-matrix\n  rows: 3\n  cols: 3",
         "Rot_01: !!opencv-matrix\n  rows: 9\n  cols: 1", ("F002.camera-shape", 9,
         {"item": "Rot_01", "shape": (3, 3), "found": (9, 1)})),
        ("extri", "-1.0, 0.0, 1.0, 0.0]", "-1.0, 0.0, -1.0, 0.0]", ("F002.camera-rotation", 9,
         {"item": "Rot_01"})),
    ],
)  # fmt: skip
def test_one_broken_camera_is_left_out(tmp_path, file, old, new, message):
    texts = {"intri": INTRINSIC, "extri": EXTRINSIC}
    assert old in texts[file]
    texts[file] = texts[file].replace(old, new, 1)
    views, notes = cameras(tmp_path, *texts.values())
    assert [view.name for view in views] == ["b c"]
    (note,) = notes
    key, line, values = message
    assert note.path == tmp_path / f"{file}.yml"
    assert fault_of(note) == ("F007.camera", line, {"problem": (key, None, values)})


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        ("a: 1\na: 2\n", 4, ("F002.camera-twice", 4, {"found": "a"})),
        ("  indented\n", 3, ("F002.camera-value", 3, {"found": b"indented"})),
        ("K: !!opencv-matrix\n  size: 3\n", 4, ("F002.camera-part", 4, {"found": b"size: 3"})),
        ("K: !!opencv-matrix\n  rows: three\n", 4, ("F002.camera-size", 4, {"found": b"three"})),
        ("K: !!opencv-matrix\n  rows: 1e99\n", 4, ("F002.camera-size", 4, {"found": b"1e99"})),
        ("K: !!opencv-matrix\n  rows: 1\n  cols: 2\n  data: 1, 2\n", 6, ("F002.camera-data", 6,
         {"found": b"1, 2"})),
        ("K: !!opencv-matrix\n  rows: 1\n  cols: 2\n  data: [ 1, .Nan ]\n", 6, ("F002.number", 6,
         {"item": "K", "found": b".Nan"})),
        ("K: !!opencv-matrix\n  rows: 1\n  cols: 2\n  data: [ 1, 1e+308 ]\n", 6,
         ("F003.too-large", 6, {"item": "K", "found": b"1e+308"})),
        ("K: !!opencv-matrix\n  rows: 1\n  cols: 2\n  data: [ 1 ]\n", 3, ("F002.camera-count", 3,
         {"found": 1, "item": "K", "shape": (1, 2)})),
        ("K: !!opencv-matrix\n  rows: 1\n  cols: 2\n  data: [ 1, 2\n", 3, ("F002.camera-count", 3,
         {"found": 2, "item": "K", "shape": (1, 2)})),
        ("K: !!opencv-matrix\n  data: [ 1, 2 ]\n", 3, ("F002.camera-lacks", 3, {"item": "K",
         "name": "rows"})),
        ("K: !!opencv-matrix\n  rows: 2\n", 3, ("F002.camera-lacks", 3, {"item": "K",
         "name": "cols"})),
    ],
)  # fmt: skip
def test_invalid_yaml_is_refused_with_its_line(text, line, message):
    with pytest.raises(FormatError) as caught:
        storage(HEAD + text)
    assert str(caught.value).startswith(f"a.yml:{line}: ")
    assert fault_of(caught.value.diagnostic) == message
