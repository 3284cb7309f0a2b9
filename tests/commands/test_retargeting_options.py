"""Motions of other skeletons: `--joint-map` and `--source-rest`."""

import argparse

import pytest
from faults import told
from formats.bvh_text import person

from viewer.cli import run
from viewer.commands._scene import add_capture_arguments
from viewer.errors import RigError
from viewer.formats import Source
from viewer.formats._joint_map import read_joint_map
from viewer.loading import MotionSettings, bundled_body, load


@pytest.fixture
def walk(tmp_path):
    path = tmp_path / "walk.bvh"
    path.write_text(person(100.0))
    return path


def convert(walk, out, *options):
    return run(["convert", str(walk), "--body", "-o", str(walk.parent / out), *map(str, options)])


@pytest.mark.slow
def test_saved_map_can_be_edited_and_used_again(walk, tmp_path, capsys):
    saved = tmp_path / "map.txt"
    assert convert(walk, "own.bvh", "--save-joint-map", saved) == 0
    assert convert(walk, "same.bvh", "--joint-map", saved) == 0
    assert (tmp_path / "own.bvh").read_bytes() == (tmp_path / "same.bvh").read_bytes()
    text = saved.read_text()
    assert "left_knee = left_knee\n" in text and "neck =\n" in text
    saved.write_text(text.replace("neck =", "neck = head").replace("head = head", "head ="))
    settings = MotionSettings(joint_map=read_joint_map(Source.open(saved)))
    (actor,) = load(walk, bundled_body(), motion=settings).actors
    assert actor.drive.joint_map is settings.joint_map
    assert convert(walk, "neck.bvh", "--joint-map", saved) == 0
    assert "neck by head" in capsys.readouterr().err


def test_errors_in_a_map_are_reported_in_one_line(walk, tmp_path, capsys):
    bad = tmp_path / "bad.txt"
    bad.write_text("# test\nleft_kne = left_knee\n")
    assert convert(walk, "out.bvh", "--joint-map", bad) == 2
    said = capsys.readouterr().err.splitlines()[-1]
    assert said.endswith(
        'bad.txt:2: expected a joint of body, found "left_kne"; did you mean left_knee?'
    )
    bad.write_text("left_knee\n")
    assert convert(walk, "out.bvh", "--joint-map", bad) == 2
    assert "bad.txt:1: " in capsys.readouterr().err
    assert not (tmp_path / "out.bvh").exists()


def test_note_about_feet_far_from_the_ground_ends_when_they_are_moved_there(walk, capsys):
    # The person stands 90 cm too low, as in motions whose origin is the hip.
    head, _, _ = person(100.0).rpartition("\n0.000000 90")
    rows = "\n".join(["0 " * 21] * 2)
    walk.write_text(f"{head}\n{rows}\n")
    assert convert(walk, "low.bvh") == 0
    said = capsys.readouterr().err
    assert "below height 0, as those of walk do; --ground of " in said
    # Notes do not repeat the file of the line above; warnings do.
    lines = [line for line in said.splitlines() if line.startswith(("note: ", "warning: "))]
    named = [str(walk) in line for line in lines]
    assert len(lines) > 3 and named[0]
    assert named[1:] == [line.startswith("warning: ") for line in lines[1:]]
    assert convert(walk, "ground.bvh", "--ground") == 0
    told = capsys.readouterr()
    assert "--ground" not in told.err and "body: raised by " in told.out


def test_maps_without_effect_are_reported(walk, tmp_path, capsys):
    chosen = tmp_path / "map.txt"
    chosen.write_text("head = head\n")
    settings = MotionSettings(joint_map=read_joint_map(Source.open(chosen)))
    assert "F007.unused-joint-map" in dict(told(load(walk, motion=settings).diagnostics))
    out = ["-o", str(tmp_path / "out.bvh"), "--save-joint-map", str(tmp_path / "new.txt")]
    assert run(["convert", str(walk), *out]) == 2
    assert "--save-joint-map: expected a motion that drives" in capsys.readouterr().err
    assert not (tmp_path / "out.bvh").exists() and not (tmp_path / "new.txt").exists()


def test_neither_the_map_nor_the_output_is_overwritten(walk, tmp_path, capsys):
    chosen = tmp_path / "map.txt"
    chosen.write_text("head = head\n")
    for saved, output in ((chosen, "out.bvh"), (tmp_path / "out.bvh", "out.bvh")):
        options = ("--joint-map", chosen, "--save-joint-map", saved, "--force")
        assert convert(walk, output, *options) == 5
    assert chosen.read_text() == "head = head\n" and not (tmp_path / "out.bvh").exists()


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
