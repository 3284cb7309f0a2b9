"""Options of the look: where the camera aims, opacity, colours of numbers, and their legend."""

from pathlib import Path

import numpy as np
import pytest
from app.tiny import write_rig
from numpy.testing import assert_allclose, assert_array_equal
from PIL import Image

import viewer
from viewer.cli import run
from viewer.commands._view import ViewOptions, camera_of
from viewer.rig.scene import scene_points

_SMALL = ("--size", "160x120", "--quality", "draft", "--no-grid", "--background", "white")


@pytest.fixture
def rig(tmp_path):
    return [str(path) for path in write_rig(tmp_path)]


@pytest.fixture
def drawn(tmp_path, rig):
    """Render the tiny rig and return its pixels."""

    def picture(*options: str) -> np.ndarray:
        out = str(tmp_path / "x.png")
        assert run(["render", *rig, "-o", out, "--force", *_SMALL, *options]) == 0
        with Image.open(out) as image:
            return np.asarray(image.convert("RGB"))

    return picture


@pytest.mark.parametrize("name", ["arm", "tiny/arm", "TINY/ARM"])
def test_camera_aims_at_a_joint(rig, name):
    scene = viewer.load(*rig)
    points = scene_points(scene, "skin")
    aimed = camera_of(ViewOptions(look_at=name), scene, points, (160, 120))
    # The arm is 1 above the root, which the file rotates: R = Rz Ry Rx of (0.25, 0.5, 0.3) rad,
    # with y and z clamped to their limits.
    (sx, sy, sz), (cx, cy, cz) = (f([0.25, 0.5, 0.3]) for f in (np.sin, np.cos))
    wanted = [cz * sy * sx - sz * cx, sz * sy * sx + cz * cx, cy * sx]
    assert_allclose(aimed.target, wanted, atol=1e-12)
    assert aimed.distance == camera_of(ViewOptions(), scene, points, (160, 120)).distance


@pytest.mark.slow
def test_picture_that_follows_a_joint_aims_at_it(drawn):
    assert_array_equal(drawn("--follow", "arm"), drawn("--look-at", "arm"))
    assert (drawn("--look-at", "arm") != drawn()).any()


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (("--look-at", "leg"), 'no actor, joint or point is called "leg"'),
        (("--look-at", "arm", "--follow", "arm"), "expected one of them, found both"),
        (("--opacity", "2"), "--opacity: expected 0 to 1, found 2"),
        (("--colormap", "magma"), "--colormap: expected --scalar NAME, to which it applies"),
        (("--colormap", "magma", "--scalar", "influences"), "has one colour per integer"),
        (("--colormap", "jet", "--scalar", "sums"), "expected one of auto, viridis, magma"),
    ],
)
def test_options_that_do_not_apply_are_refused(tmp_path, rig, capsys, options, text):
    out = tmp_path / "x.png"
    assert run(["render", *rig, "-o", str(out), *options]) == 2
    assert text in capsys.readouterr().err and not out.exists()


@pytest.mark.slow
def test_opacity_is_the_fraction_of_the_surface_in_the_picture(drawn):
    opaque, half = drawn("--opacity", "1").astype(float), drawn("--opacity", "0.5").astype(float)
    assert_array_equal(opaque, drawn())
    assert (drawn("--opacity", "0") == 255).all()
    inside = (np.abs(opaque - 255.0) > 40.0).all(axis=2)
    inside[1:-1] &= inside[2:] & inside[:-2]  # without pixels at edges, which are mixed
    assert inside.sum() > 100
    # The picture is blended as it is stored, over a white background.
    assert np.median(np.abs(half - (opaque + 255.0) / 2.0)[inside]) < 6.0


@pytest.mark.slow
def test_colours_are_those_of_the_named_map(drawn):
    """Weights of 1 have the last colour of viridis, fde725, darkened by up to 40 % by the light."""
    pixels = drawn("--scalar", "weight:arm", "--colormap", "viridis").reshape(-1, 3).astype(float)
    yellow = np.array([0xFD, 0xE7, 0x25]) / 255.0
    seen = pixels[(pixels < 255.0).any(axis=1)] / 255.0
    linear = np.where(seen <= 0.04045, seen / 12.92, ((seen + 0.055) / 1.055) ** 2.4)
    wanted = np.where(yellow <= 0.04045, yellow / 12.92, ((yellow + 0.055) / 1.055) ** 2.4)
    brightness = linear @ wanted / (wanted @ wanted)
    apart = np.abs(linear - brightness[:, None] * wanted).max(axis=1)
    is_yellow = (apart < 0.01) & (brightness > 0.6) & (brightness <= 1.001)
    assert is_yellow.sum() > 50


@pytest.mark.slow
def test_legend_on_white_is_light(drawn, tmp_path: Path):
    """The upper left corner is the panel: nearly white on white, nearly black on the gradient."""
    options = "--scalar", "weight:arm", "--legend", "--size", "320x240"
    corner = drawn(*options)[4:8, 5:9]
    assert (corner > 240).all()
    assert (drawn(*options, "--background", "#303840")[4:8, 5:9] < 60).all()
