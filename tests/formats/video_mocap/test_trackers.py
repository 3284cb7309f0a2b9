"""4D-Humans and PHALP results: detections frame by frame, with people out of sight."""

import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formats.archive.joblib_bytes import joblib_file
from formats.synthetic_smpl import model
from formats.video_mocap.plain_smpl import vertices
from formats.video_mocap.tool_files import assert_drawn, drawn, phalp, phalp_body, scene_of
from numpy.testing import assert_allclose

from viewer.errors import FormatError
from viewer.formats import Source, detect
from viewer.formats.video_mocap import read as open_results


def phalp_file(folder: Path) -> Path:
    path = folder / "demo_video.pkl"
    path.write_bytes(zlib.compress(joblib_file(phalp()), 3))
    return path


def test_vertices_follow_the_tools_formula(tmp_path: Path) -> None:
    scene = scene_of(phalp_file(tmp_path), "smpl")
    for person, frame in ((2, 0), (2, 1), (2, 2), (5, 0)):
        body, place = phalp_body(person, frame)
        turned = np.concatenate([body["global_orient"], body["body_pose"]])
        wanted = vertices("smpl", model("smpl"), body["betas"], turned, place)[0]
        assert_drawn(scene, person, frame, wanted)


def test_people_out_of_sight_are_omitted_and_counted(tmp_path: Path) -> None:
    scene = scene_of(phalp_file(tmp_path), "smpl")
    assert [drawn(scene, 5, frame) is not None for frame in range(3)] == [True, False, False]
    found = {one.key: one.values for one in scene.diagnostics}
    assert found["F007.video-ghosts"] == {"n": 2}


def test_camera_is_that_of_the_network(tmp_path: Path) -> None:
    capture = open_results(Source.open(phalp_file(tmp_path)))
    (view,) = capture.views
    assert view.size == (1280, 720)
    assert_allclose(view.intrinsic, [[25000, 0, 640], [0, 25000, 360], [0, 0, 1]])
    assert (capture.space, capture.in_space, capture.up) == ("", None, "-y")


def test_files_are_recognised_by_their_frames(tmp_path: Path) -> None:
    assert detect(Source.open(phalp_file(tmp_path))) == "video_mocap"


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"tid": [2]}, "F002.video-lists"),
        ({"camera": []}, "F002.video-lists"),
        ({"tracked_time": [0]}, "F002.video-lists"),
        ({"tid": [2.5, 5]}, "F002.video-whole"),
        ({"tid": "x"}, "F002.video-whole"),
        ({"time": -3}, "F002.video-frames"),
        ({"time": 1 << 40}, "F002.video-frames"),
        ({"smpl": [{}, {}]}, "F002.no-key"),
        ({"smpl": [{"global_orient": np.ones(9)}] * 2}, "F002.no-key"),
        ({"camera": [np.zeros(2)] * 2}, "F002.video-count"),
    ],
)  # fmt: skip
def test_inconsistent_frames_are_refused(changes: dict[str, Any], key: str) -> None:
    frames = phalp()
    frames["out/img/000001.jpg"] |= changes
    with pytest.raises(FormatError) as caught:
        open_results(Source("a.pkl", joblib_file(frames)))
    assert caught.value.diagnostic is not None
    assert caught.value.diagnostic.key == key
