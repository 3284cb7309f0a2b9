"""Skeletons of a hundred thousand joints, drawn in seconds even with all boxes in one place."""

import subprocess
import sys


def test_hundred_thousand_coincident_boxes_are_drawn(tmp_path):
    deep = tmp_path / "deep.skel"
    deep.write_text("balljoint a { " * 100_000 + "} " * 100_000)
    out = tmp_path / "deep.png"
    # In final quality, a slow machine would print the time that the image takes.
    options = ["--size", "320x240", "--quality", "normal"]
    command = [sys.executable, "-m", "viewer", "render", deep, "-o", out, *options]
    done = subprocess.run([*map(str, command)], capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stderr) == (0, "") and out.stat().st_size > 1000
