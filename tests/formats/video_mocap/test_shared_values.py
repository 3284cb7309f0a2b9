"""Dicts with repeated references to the same values, which are refused before they are expanded."""

from typing import Any

import numpy as np
import pytest
from formats.archive.joblib_bytes import aligned_array
from formats.npz_bytes import cost
from formats.pickle_bytes import finished, unicode
from formats.torch.torch_bytes import value
from formats.video_mocap.test_sam3d_body import person
from formats.video_mocap.tool_files import phalp, wham

from viewer.errors import FormatError
from viewer.formats import Source, detect
from viewer.formats.video_mocap import read as open_results

BOUND = 64 << 20  # limit of allocated memory in bytes


def repeated(given: Any, times: int, name: str = "{}") -> bytes:
    """Return a dict with the same value under many keys."""
    pairs = b"".join(unicode(name.format(index)) + b"h\1" for index in range(times))
    return b"}(" + pairs + b"u"


def shared(given: Any, times: int, name: str = "{}", outer: int = 0) -> bytes:
    """Return a file of a dict of dicts that share their values."""
    first = value(given, lambda values: aligned_array(np.asarray(values))) + b"q\1" + b"0"
    body = first + repeated(given, times, name)
    if outer:
        body = body + b"q\1" + b"0" + repeated(given, outer, name)
    return finished(body)


def refused(data: bytes) -> str:
    source = Source("a.pkl", data)
    with pytest.raises(FormatError) as caught:
        if detect(source) == "video_mocap":
            open_results(source)
    assert caught.value.diagnostic is not None
    return caught.value.diagnostic.key


@pytest.mark.slow
def test_people_with_shared_frames_are_refused() -> None:
    one = {
        "pose_world": np.zeros((1000, 72), np.float32),
        "trans_world": np.zeros((1000, 3), np.float32),
        "betas": wham()[0]["betas"],
        "frame_ids": np.arange(1000),
    }
    one["betas"] = np.zeros((1000, 10), np.float32)
    data = shared(one, 3000)
    assert refused(data) == "F002.video-rows"
    assert cost(lambda: refused(data)) < BOUND


def test_nested_dicts_without_poses_are_refused() -> None:
    assert refused(shared({"a": 1}, 400, outer=400)) == "F002.unknown-archive"


@pytest.mark.slow
def test_pictures_with_the_same_people_are_refused() -> None:
    nobody = {key: 1 for key in person() if key != "pred_cam_t"}
    assert refused(shared(nobody, 2000, outer=2000)) == "F002.unknown-archive"


def test_frames_with_the_same_detections_are_refused() -> None:
    frame = next(iter(phalp(1).values()))
    frame = {key: value * 90 if isinstance(value, list) else value for key, value in frame.items()}
    frame["tracked_time"] = [1] * len(frame["tid"])
    data = shared(frame, 20, "{}.jpg")
    assert refused(data) == "F002.video-people"
