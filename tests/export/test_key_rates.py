"""Motions of keyed files, written as frames at the rate of the keys."""

from pathlib import Path

import numpy as np
import pytest
from formats.gltf.files import File, skinned

import viewer
from viewer.cli import run

IRREGULAR = "the keys are at irregular times, so the motion is sampled at 30 frames per second"


def keyed(times: np.ndarray) -> File:
    """Return a skinned triangle whose second joint turns to a new angle at each key."""
    file, angles = skinned(), 0.5 * np.sin(0.7 * np.arange(len(times)))
    zero = 0.0 * angles
    keys = file.accessor(np.stack([zero, zero, np.sin(angles), np.cos(angles)], axis=1))
    samplers = [{"input": file.times(times.tolist()), "output": keys}]
    channels = [{"sampler": 0, "target": {"node": 2, "path": "rotation"}}]
    file.root["animations"] = [{"channels": channels, "samplers": samplers}]
    return file


@pytest.mark.parametrize("suffix", [".bvh", ".glb"])
def test_frames_are_the_keys(tmp_path: Path, suffix: str, capsys: pytest.CaptureFixture) -> None:
    source, path = tmp_path / "keys.glb", tmp_path / f"frames{suffix}"
    source.write_bytes(keyed(np.arange(13) / 120.0).glb())
    assert run(["convert", str(source), "-o", str(path), "--frames", "0:"]) == 0
    assert "13 frames (0 to 12) at 120 fps" in capsys.readouterr().out
    (actor,) = viewer.load(path).actors
    assert actor.clip.frame_rate == pytest.approx(120.0, rel=1e-6)
    assert actor.clip.end - actor.clip.start == pytest.approx(0.1, abs=1e-6)


@pytest.mark.parametrize(("options", "said"), [((), True), (("--fps", "50"), False)])
def test_rate_of_irregular_keys_is_reported(
    tmp_path: Path, options: tuple[str, ...], said: bool, capsys: pytest.CaptureFixture
) -> None:
    source, path = tmp_path / "keys.glb", tmp_path / "frames.npz"
    source.write_bytes(keyed(np.array([0.0, 0.1, 0.1234, 0.2])).glb())
    assert run(["convert", str(source), "-o", str(path), *options]) == 0
    assert (IRREGULAR in capsys.readouterr().out) is said
