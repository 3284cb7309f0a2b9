"""``viewer render --panels``: pictures of the whole interface."""

import numpy as np
import pytest
from app.tiny import write_rig
from PIL import Image

from viewer.cli import run

pytestmark = pytest.mark.slow


@pytest.fixture
def rig(tmp_path):
    return write_rig(tmp_path)


def test_picture_with_panels_shows_the_whole_interface(rig, tmp_path):
    out = tmp_path / "panels.png"
    assert run(["render", *map(str, rig), "-o", str(out), "--panels", "--size", "640x480"]) == 0
    picture = np.array(Image.open(out).convert("RGBA"))
    assert picture.shape == (480, 640, 4) and (picture[..., 3] == 255).all()
    assert picture[240, 628, :3].max() < 100  # the panels are dark


def test_picture_with_panels_has_shadows(rig, tmp_path):
    pictures = []
    for extra in ([], ["--no-shadows"]):
        out = tmp_path / "panels.png"
        command = ["render", *map(str, rig), "-o", str(out), "--panels", "--size", "480x320"]
        assert run([*command, "--force", *extra]) == 0
        pictures.append(np.array(Image.open(out).convert("RGB")).astype(int))
    # Left of the panels, the shadow darkens the ground, and no pixel is brighter.
    lit, shadowed = pictures[1][:, :200], pictures[0][:, :200]
    assert (lit - shadowed).max() > 20 and (shadowed - lit).max() < 5


def test_picture_with_panels_keeps_the_given_distance(rig, tmp_path):
    pictures = []
    for distance in ("2", "30"):
        out = tmp_path / f"{distance}.png"
        options = ["--panels", "--size", "640x480", "--distance", distance]
        assert run(["render", *map(str, rig), "-o", str(out), *options]) == 0
        pictures.append(np.array(Image.open(out))[:, 200:400].astype(int))
    assert np.abs(pictures[0] - pictures[1]).mean() > 3


def test_picture_with_panels_requires_a_minimum_size(rig, tmp_path, capsys):
    out = tmp_path / "x.png"
    assert run(["render", str(rig[0]), "-o", str(out), "--panels", "--size", "100x100"]) == 2
    assert "200 x 200" in capsys.readouterr().err
