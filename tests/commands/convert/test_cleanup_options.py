"""Clean-up options of ``viewer convert``: values, errors, printed changes, and written frames."""

import argparse

import numpy as np
import pytest
from formats.capture_files import body, write_frames
from formats.synthetic_smpl import model

from viewer.cli import run
from viewer.commands._cleanup import add_gap_arguments, clean_up_of
from viewer.commands._usage import Parser
from viewer.commands.convert import add_arguments
from viewer.rigs.cleanup.smoothing import OneEuro, SavitzkyGolay


def parsed(*arguments):
    parser = Parser()
    add_arguments(parser)
    return clean_up_of(parser.parse_args([*arguments, "-o", "a.npz"]))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("--smooth", SavitzkyGolay()),
        ("--smooth=savgol:window=9,order=3", SavitzkyGolay(9, 3)),
        ("--smooth=one-euro", OneEuro()),
        ("--smooth=one-euro:cutoff=1.5,beta=0,speed-cutoff=2", OneEuro(1.5, 0.0, 2.0)),
    ],
)
def test_filters_are_parsed(text, expected):
    assert parsed(text).smoothing == expected


def test_other_options_are_parsed():
    found = parsed("--merge-ids", "3,7", "--merge-ids=1, 2", "--trim=5:", "--fill-gaps")
    assert found.merged == ((3, 7), (1, 2))
    assert found.frames == (5, None) and found.interpolates and found.longest_gap == 1.0
    assert parsed("--fill-gaps", "12").longest_gap == 12
    assert parsed().is_empty


@pytest.mark.parametrize(
    ("text", "older", "results"),
    [
        ("hold", ["--gaps", "hold"], ("hold", False, None)),
        ("interpolate", ["--interpolate-gaps"], (None, True, None)),
        ("interpolate:12", ["--fill-gaps", "12"], (None, False, 12)),
        ("interpolate:1s", ["--fill-gaps"], (None, False, 1.0)),
        ("interpolate:2s", ["--gaps=interpolate:2.0s"], (None, False, 2.0)),
        ("interpolate:0.5s,split", ["--gaps=interpolate:0.50s,split"], ("split", False, 0.5)),
        ("interpolate:12,split", ["--gaps=split", "--fill-gaps=12"], ("split", False, 12)),
    ],
)
def test_option_of_gaps_has_the_meaning_of_its_older_names(text, older, results):
    def parse(words):
        parser = Parser()
        add_arguments(parser)
        found = parser.parse_args([*words, "-o", "a.npz"])
        return found.gaps, found.interpolate_gaps, found.fill_gaps

    assert parse(["--gaps", text]) == parse(older) == results


@pytest.mark.parametrize(
    ("use", "text"),
    [
        *(("write", text) for text in ("", "fill", "split,hold", "interpolate,split")),
        *(("write", f"interpolate:{limit}") for limit in ("0", "s", "2 s", "-1s", "5,", "5,5", "")),
        *(("view", text) for text in ("hold", "interpolate:5,split")),
        *(("check", text) for text in ("hold", "interpolate:5")),
    ],
)
def test_unknown_values_of_gaps_are_refused(use, text):
    parser = argparse.ArgumentParser(exit_on_error=False)
    add_gap_arguments(parser.add_argument_group(), use)
    with pytest.raises(argparse.ArgumentError, match="expected "):
        parser.parse_args(["--gaps", text])


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("--smooth=median", "expected one-euro or savgol"),
        ("--smooth=savgol:window=8", "odd window"),
        ("--smooth=savgol:order=1.5", "integer order"),
        ("--smooth=savgol:cutoff=3", "window=NUMBER, order=NUMBER"),
        ("--smooth=one-euro:cutoff=0", "above 0 Hz"),
        ("--merge-ids=3", "at least two"),
        ("--merge-ids=3,3", "at least two"),
        ("--fill-gaps=0", "number of frames"),
        ("--trim=1:2:3", "expected A:B with A below B"),
        ("--trim=5:2", "expected A:B with A below B"),
        ("--resample=0", "frames per second"),
    ],
)
def test_invalid_values_are_refused_before_anything_is_read(text, expected, capsys, tmp_path):
    write_frames(tmp_path / "take" / "smpl", {0: [body(0)]})
    assert run(["convert", str(tmp_path / "take"), "-o", str(tmp_path / "a.npz"), text]) == 2
    assert expected in capsys.readouterr().err


def test_changes_are_printed_and_written(tmp_path, capsys):
    np.savez(tmp_path / "SMPL.npz", **model("smpl"))
    frames = {number: [body(0)] if number < 4 else [body(5)] for number in (0, 1, 2, 3, 6, 7, 8)}
    write_frames(tmp_path / "take" / "smpl", frames)
    out = tmp_path / "m.npz"
    options = ["--merge-ids", "0,5", "--fill-gaps", "--trim", "1:8", "--resample", "60"]
    files = [str(tmp_path / "take"), "--model", str(tmp_path / "SMPL.npz")]
    assert run(["convert", *files, "-o", str(out), *options]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "person 5: 3 frames joined to person 0"
    assert lines[1].startswith("take 0: 2 missing frames in 1 gap interpolated")
    assert lines[2] == "take 0: frames 1 to 7 kept, 7 of 9"
    assert lines[3].startswith("take 0: resampled from 30 to 60 fps, 7 frames to 13")
    with np.load(out) as arrays:
        assert len(arrays["poses"]) == 13 and float(arrays["mocap_framerate"]) == 60.0


def test_video_together_with_a_folder_of_images_is_refused(capsys):
    command = ["convert", "a.bvh", "-o", "b.bvh", "--video", "a.mp4", "--images", "pictures"]
    assert run(command) == 2
    assert "--video and --images: expected one of them" in capsys.readouterr().err
