"""Cameras of EasyMocap: OpenCV's FileStorage, good and broken, beside the frames or above them."""

import numpy as np
import pytest
from capture_files import body, opened, write_frames
from numpy.testing import assert_allclose, assert_array_equal

from viewer.errors import FormatError
from viewer.formats import Source
from viewer.formats._easymocap.cameras import find_cameras, read_storage

HEAD = "%YAML:1.0\n---\n"
# As OpenCV itself wraps long lists.
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


# A quarter turn about x: y goes to z.
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


def test_line_ends_comments_and_marks_do_not_matter():
    text = "\ufeff" + HEAD + "# one\r\nnames:\r\n- '1'\r\n- \"2\"\r\nH_1: 5\r\n...\r\n"
    assert storage(text) == {"names": ["1", "2"], "H_1": "5"}


@pytest.mark.parametrize("level", ["out/smpl", "out", "."])
def test_cameras_are_found_beside_the_frames_and_above(tmp_path, level):
    write_frames(tmp_path / "out" / "smpl", {0: [body(0)]})
    cameras(tmp_path / level)
    for path in (tmp_path / "out", tmp_path / "out" / "smpl"):
        capture, _, warnings = opened(path)
        assert [view.name for view in capture.views] == ["01", "b c"]
        assert (capture.warnings, warnings) == ((), [])


def test_broken_cameras_leave_the_bodies(tmp_path):
    write_frames(tmp_path / "smpl", {0: [body(0)]})
    cameras(tmp_path, intrinsic="nonsense")
    capture, parts, _ = opened(tmp_path)
    assert (capture.views, list(parts[0].bodies)) == ((), [0])
    assert capture.warnings == (
        f'{tmp_path}/intri.yml:1: expected name: value, found "nonsense"; the cameras are left out',
    )


def test_one_file_is_not_enough(tmp_path):
    (tmp_path / "extri.yml").write_text(EXTRINSIC)
    assert find_cameras([tmp_path], 1 << 20) == (
        (),
        [f"{tmp_path}/extri.yml: no intri.yml beside it; the cameras are left out"],
    )
    assert find_cameras([tmp_path / "none"], 1 << 20) == ((), [])


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        ("intri", "K_01", "K_02", "3: K_01: expected 3 x 3 numbers, found no such key"),
        ("intri", "1.2e+03", "-1",
         "6: K_01: expected focal lengths above 0 and the last row 0 0 1"),
        ("intri", "1.2e+03", "1e30", "6: K_01: expected focal lengths of 0.001 to 1e+09 pixels, "
         "found 1e+30 and 1100.5"),
        ("intri", "1100.5", "1e-320", "6: K_01: expected focal lengths of 0.001 to 1e+09 pixels, "
         "found 1200 and 9.99989e-321"),
        ("intri", "512.", "-1e10", "6: K_01: expected numbers up to 1e+09, found -1e+10"),
        ("intri", "-0.1,", "-2e6,", "12: dist_01: expected numbers up to 1e+06, found -2e+06"),
        ("extri", "-1.0, 3.0", "1e38, 3.0", "14: T_01: expected numbers up to 1e+09, found 1e+38"),
        ("extri", "T_01", "T_1", "3: T_01: expected 3 numbers, found no such key"),
        ("extri", "Rot_01: !!opencv-matrix\n  rows: 3\n  cols: 3",
         "Rot_01: !!opencv-matrix\n  rows: 9\n  cols: 1",
         "9: Rot_01: expected 3 x 3 numbers, found 9 x 1"),
        ("extri", "-1.0, 0.0, 1.0, 0.0]", "-1.0, 0.0, -1.0, 0.0]",
         "9: Rot_01: expected a rotation, found a matrix that is none"),
    ],
)  # fmt: skip
def test_one_broken_camera_is_left_out(tmp_path, file, old, new, message):
    texts = {"intri": INTRINSIC, "extri": EXTRINSIC}
    assert old in texts[file]
    texts[file] = texts[file].replace(old, new, 1)
    views, notes = cameras(tmp_path, *texts.values())
    assert [view.name for view in views] == ["b c"]
    assert notes == [f"{tmp_path}/{file}.yml:{message}; this camera is left out"]


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        ("a: 1\na: 2\n", 4, 'expected every key once, found "a"'),
        ("  indented\n", 3, 'expected name: value, found "indented"'),
        ("K: !!opencv-matrix\n  size: 3\n", 4,
         'expected rows, cols, dt or data, found "size: 3"'),
        ("K: !!opencv-matrix\n  rows: three\n", 4, 'expected a size, found "three"'),
        ("K: !!opencv-matrix\n  rows: 1e99\n", 4, 'expected a size, found "1e99"'),
        ("K: !!opencv-matrix\n  rows: 1\n  cols: 2\n  data: 1, 2\n", 6,
         'expected [ numbers ], found "1, 2"'),
        ("K: !!opencv-matrix\n  rows: 1\n  cols: 2\n  data: [ 1, .Nan ]\n", 6,
         'K: expected a number, found ".Nan"'),
        ("K: !!opencv-matrix\n  rows: 1\n  cols: 2\n  data: [ 1, 1e+308 ]\n", 6,
         'K: expected a number below 3.4e+38, found "1e+308"'),
        ("K: !!opencv-matrix\n  rows: 1\n  cols: 2\n  data: [ 1 ]\n", 3,
         "K: expected 1 x 2 numbers, found 1"),
        ("K: !!opencv-matrix\n  rows: 1\n  cols: 2\n  data: [ 1, 2\n", 3,
         "K: expected 1 x 2 numbers, found 2"),
        ("K: !!opencv-matrix\n  data: [ 1, 2 ]\n", 3,
         "K: expected rows, cols and data, found no rows"),
        ("K: !!opencv-matrix\n  rows: 2\n", 3, "K: expected rows, cols and data, found no cols"),
    ],
)  # fmt: skip
def test_broken_storage_is_refused_with_its_line(text, line, message):
    with pytest.raises(FormatError) as caught:
        storage(HEAD + text)
    assert str(caught.value) == f"a.yml:{line}: {message}"
