"""``viewer render --view`` with lens distortion that is ignored and reported with its size."""

import pytest
from formats.capture_files import points, write_frames

from viewer.cli import run

pytestmark = pytest.mark.slow

# Cameras without a size have the principal point in the middle, so the picture is 1000 x 1000
# pixels.
_NAMES = "".join(
    f"""{key}_{name}: !!opencv-matrix
  rows: {rows}
  cols: {columns}
  dt: d
  data: [{data}]
"""
    for name, k1 in (("01", "0.0005"), ("02", "0.1"))
    for key, rows, columns, data in (
        ("K", 3, 3, "1000., 0., 500., 0., 1000., 500., 0., 0., 1."),
        ("dist", 1, 5, f"{k1}, 0., 0., 0., 0."),
    )
)
_PLACES = "".join(
    f"""Rot_{name}: !!opencv-matrix
  rows: 3
  cols: 3
  dt: d
  data: [1., 0., 0., 0., 0., -1., 0., 1., 0.]
T_{name}: !!opencv-matrix
  rows: 3
  cols: 1
  dt: d
  data: [0., 0., 5.]
"""
    for name in ("01", "02")
)
_HEAD = '%YAML:1.0\n---\nnames: [ "01", "02" ]\n'


@pytest.fixture
def recording(tmp_path):
    folder = tmp_path / "take"
    write_frames(folder / "keypoints3d", {frame: [points(0)] for frame in range(2)})
    (folder / "intri.yml").write_text(_HEAD + _NAMES)
    (folder / "extri.yml").write_text(_HEAD + _PLACES)
    return folder


def draw(recording, out, *options):
    return run(
        [
            "render",
            str(recording),
            "-o",
            str(out),
            "--size",
            "32x32",
            "--quality",
            "draft",
            *options,
        ]
    )


# The corner (0, 0) is at x = y = -1/2, so r^2 = 1/2; k1 = 0.1 moves it by k1 r^2 of its distance
# from the middle, 0.1 * 0.5 * 500 sqrt(2) = 35.36 pixels.
NOTE = "warning: camera 02: its lens distortion of up to 35.4 pixels is not drawn\n"


@pytest.mark.parametrize("view", ["02", "2"])
def test_ignored_lens_distortion_is_reported_with_its_size(recording, tmp_path, capsys, view):
    assert draw(recording, tmp_path / "a.png", "--view", view) == 0
    assert capsys.readouterr().err.endswith(NOTE)


def test_sequences_report_distortion_once(recording, tmp_path, capsys):
    assert draw(recording, tmp_path / "a_{frame}.png", "--view", "02") == 0
    assert capsys.readouterr().err.count(NOTE) == 1


@pytest.mark.parametrize("options", [[], ["--view", "01"]])
def test_invisible_distortion_is_not_reported(recording, tmp_path, capsys, options):
    # 0.0005 * 0.5 * 500 sqrt(2) = 0.18 pixels.
    assert draw(recording, tmp_path / "a.png", *options) == 0
    assert "lens" not in capsys.readouterr().err


def test_unknown_camera_is_refused(recording, tmp_path, capsys):
    assert draw(recording, tmp_path / "a.png", "--view", "9") == 2
    assert capsys.readouterr().err.endswith(
        '--view: no camera is called "9"; there are 2: 01, 02\n'
    )
    assert draw(recording, tmp_path / "a.png", "--view", "021") == 2
    assert capsys.readouterr().err.endswith("did you mean 01 or 02?\n")
