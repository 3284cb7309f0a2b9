"""The option for the rest pose of a skeleton that drives a figure."""

import argparse

import pytest
from faults import told
from formats.bvh_text import person

from viewer.commands._scene import add_capture_arguments
from viewer.errors import RigError
from viewer.loading import MotionSettings, bundled_body, load


def parsed(*words):
    parser = argparse.ArgumentParser(exit_on_error=False)
    add_capture_arguments(parser)
    return parser.parse_args(words).source_rest


def test_source_rest_is_a_frame_or_a_keyword():
    assert parsed() == parsed("--source-rest", "auto") == "auto"
    assert parsed("--source-rest", "zero") == "zero"
    assert parsed("--source-rest", "12") == 12


@pytest.mark.parametrize("word", ["t-pose", "1.5", "", "auto "])
def test_invalid_values_of_source_rest_are_refused(word):
    with pytest.raises(argparse.ArgumentError, match="expected a frame number, zero or auto"):
        parsed("--source-rest", word)


@pytest.fixture
def walk(tmp_path):
    path = tmp_path / "walk.bvh"
    path.write_text(person(100.0))
    return path


def rest_notes(scene):
    return [key for key, _ in told(scene.diagnostics) if ".rest-" in key]


def test_standing_zero_pose_is_used_without_a_message(walk):
    assert not rest_notes(load(walk, bundled_body()))
    assert not rest_notes(load(walk, motion=MotionSettings(model=bundled_body())))


def test_chosen_frame_is_printed(walk):
    asked = MotionSettings(source_rest=1)
    assert rest_notes(load(walk, bundled_body(), motion=asked)) == ["F007.rest-asked"]
    asked = MotionSettings(source_rest=1, model=bundled_body())
    assert rest_notes(load(walk, motion=asked)) == ["F007.rest-asked"]


def test_frame_beyond_the_motion_is_refused_with_its_file(walk):
    with pytest.raises(RigError) as problem:
        load(walk, bundled_body(), motion=MotionSettings(source_rest=-1))
    assert problem.value.diagnostic.path == walk
    assert told([problem.value.diagnostic])[0][0] == "F004.rest-frame"
