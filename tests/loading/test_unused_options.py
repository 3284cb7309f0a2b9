"""Options that do not apply to the opened files and are reported."""

from pathlib import Path

import pytest
from formats.bvh_text import person
from formats.capture_files import body, write_frames
from formats.video_mocap.tool_files import wham_file

from viewer.loading import MotionSettings, bundled_body, load

FILE = Path("some.file")


def unused(*paths, **settings):
    found = load(*paths, motion=MotionSettings(**settings)).diagnostics
    return [note.key for note in found if ".unused-" in note.key]


@pytest.mark.parametrize(
    ("settings", "name"),
    [
        ({"space": "camera"}, "space"),
        ({"average_shape": True}, "average-shape"),
        ({"video": FILE}, "video"),
        ({"images": FILE}, "images"),
        ({"rig": "mixamo"}, "rig"),
    ],
)
def test_options_of_captures_are_reported_for_other_files(tmp_path, settings, name):
    path = tmp_path / "walk.bvh"
    path.write_text(person(100.0))
    assert unused(path, **settings) == [f"F007.unused-{name}"]
    # A model does not suppress the message, because it is read but has no choice of rigs.
    assert unused(path, model=bundled_body(), **settings) == [f"F007.unused-{name}"]


def test_model_without_a_motion_is_reported():
    assert unused(bundled_body(), model=bundled_body()) == ["F007.unused-model"]


def test_space_and_shape_options_apply_only_to_video_motion_capture(tmp_path):
    path = wham_file(tmp_path)
    assert unused(path, space="camera", average_shape=True) == []
    write_frames(tmp_path / "take" / "smpl", {0: [body(0)]})
    found = unused(tmp_path / "take", space="camera", average_shape=True)
    assert found == ["F007.unused-space", "F007.unused-average-shape"]
