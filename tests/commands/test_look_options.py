"""Options of the look: where the camera aims, opacity, colours of numbers, and their legend."""

from pathlib import Path

import numpy as np
import pytest
from formats.archive.joblib_bytes import joblib_file
from formats.torch.torch_bytes import torch_zip
from formats.video_mocap.tool_files import gvhmr
from media.small_videos import counting, write
from numpy.testing import assert_allclose, assert_array_equal
from PIL import Image

import viewer
from viewer.cli import run
from viewer.commands._view import ViewOptions, camera_of
from viewer.media.video import VideoSink
from viewer.rigs.scene import scene_points

_SMALL = ("--size", "160x120", "--quality", "draft", "--no-grid", "--background", "white")


@pytest.fixture
def drawn(tmp_path, rig):
    """Render the tiny rig and return its pixels."""

    def picture(*options: str) -> np.ndarray:
        out = str(tmp_path / "x.png")
        assert run(["render", *map(str, rig), "-o", out, "--force", *_SMALL, *options]) == 0
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
    assert run(["render", *map(str, rig), "-o", str(out), *options]) == 2
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
def test_legend_on_white_is_light(drawn, tmp_path):
    """The upper left corner is the panel: nearly white on white, nearly black on the gradient."""
    options = "--scalar", "weight:arm", "--legend", "--size", "320x240"
    corner = drawn(*options)[4:8, 5:9]
    assert (corner > 240).all()
    assert (drawn(*options, "--background", "#303840")[4:8, 5:9] < 60).all()


@pytest.mark.parametrize(
    "options", [["--roughness", "1.5"], ["--metallic", "-1"], ["--matcap", "wood"]]
)
def test_invalid_surface_options_are_refused(tmp_path, capsys, options):
    try:
        code = run(["render", "-o", str(tmp_path / "out.png"), *options])
    except SystemExit as stopped:  # argparse
        code = stopped.code
    assert code == 2
    assert options[0] in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_files_with_metallic_materials_use_metallic_roughness_shading(tmp_path):
    """Pr in the .mtl is sufficient; without it, or with --shading phong, shading is Blinn-Phong."""
    shape = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n"
    (tmp_path / "a.obj").write_text(shape)

    def drawn(statements: str, *options: str) -> np.ndarray:
        (tmp_path / "m.mtl").write_text(f"newmtl a\nKd 0.8 0.2 0.1\n{statements}")
        out = str(tmp_path / "out.png")
        command = ["render", str(tmp_path / "a.obj"), "-o", out, "--size", "40x40", "--force"]
        assert run([*command, *options]) == 0
        with Image.open(out) as picture:
            return np.asarray(picture.convert("RGB"))

    metal = drawn("Pr 0.4\nPm 1\n")
    assert np.array_equal(metal, drawn("Pr 0.4\nPm 1\n", "--shading", "pbr"))
    plain = drawn("")
    assert np.array_equal(plain, drawn("Pr 0.4\nPm 1\n", "--shading", "phong"))
    assert not np.array_equal(metal, plain)


SIZE = (128, 72)
GREY = 60  # of frame 3, see counting


@pytest.fixture
def files(tmp_path: Path) -> tuple[str, str]:
    """Return a person who stands in front of the camera in 4 frames, and the camera's video."""
    given = gvhmr()
    given["smpl_params_incam"]["body_pose"][:] = 0.0
    given["smpl_params_incam"]["global_orient"][:] = [np.pi, 0.0, 0.0]
    given["smpl_params_incam"]["transl"][:] = [0.0, 0.0, 6.0]
    (tmp_path / "a.pt").write_bytes(torch_zip(given))
    sink = VideoSink(tmp_path / "v.mp4", SIZE, 30.0)
    write(sink, [counting(frame, SIZE) for frame in range(4)])
    return str(tmp_path / "a.pt"), str(tmp_path / "v.mp4")


def overlaid(tmp_path: Path, *options: str) -> np.ndarray:
    out = tmp_path / "out.png"
    quick = ("--quality", "draft", "--force", "--frame", "3", "--samples", "1", "-o", str(out))
    assert run(["render", *options, *quick]) == 0
    return np.array(Image.open(out).convert("RGB")).astype(int)


@pytest.mark.slow
def test_people_are_drawn_over_their_video(files, tmp_path):
    pixels = overlaid(tmp_path, files[0], "--overlay", files[1])
    assert pixels.shape == (SIZE[1], SIZE[0], 3)
    is_body = np.abs(pixels - GREY).max(axis=2) > 12
    # K projects x / z to 1000 x / z + 640 of 1280 pixels: a body of 1.7 m, 6 m away, is 1000 * 1.7
    # / 6 / 10 = 28 pixels high. Its pelvis is at J0 + transl, and J0 of SMPL-X at y = -0.351 in
    # the camera's axes: 1000 * 0.351 / 6 / 10 = 6 pixels above the middle. Nothing else is drawn.
    rows, columns = np.nonzero(is_body)
    assert abs(rows.max() - rows.min() - 28) <= 3
    assert abs((columns.max() + columns.min()) / 2 - SIZE[0] / 2) <= 2
    assert is_body[SIZE[1] // 2 - 6, SIZE[0] // 2]


@pytest.mark.slow
def test_a_video_implies_the_view_of_its_camera(files, tmp_path):
    options = (files[0], "--space", "camera", "--video", files[1], "--no-grid", "--size", "128x72")
    pixels = overlaid(tmp_path, *options)
    assert abs(pixels[2, 2] - 0.6 * GREY).max() <= 3  # dimmed to 60 %


@pytest.mark.slow
def test_a_video_without_its_view_is_reported(files, tmp_path, capsys):
    overlaid(tmp_path, files[0], "--video", files[1], "--azimuth", "30", "--size", "32x32")
    assert "--video: not drawn, because --azimuth asks for another view" in capsys.readouterr().err


@pytest.mark.parametrize("other", ["--video=v.mp4", "--view=1", "--images=a", "--distance=3"])
def test_options_that_contradict_an_overlay_are_refused(other, tmp_path, capsys):
    command = ["render", "a.pt", "--overlay", "v.mp4", other, "-o", str(tmp_path / "a.png")]
    assert run(command) == 2
    name = other.partition("=")[0]
    assert capsys.readouterr().err.endswith(
        f"--overlay and {name}: expected one of them, found both\n"
    )


def test_overlay_of_people_in_the_world_only_is_refused(files, tmp_path, capsys):
    path = tmp_path / "world.pkl"
    path.write_bytes(joblib_file({"rotmat": np.tile(np.eye(3), (2, 24, 1, 1)),
                                  "trans": np.zeros((2, 3))}))  # fmt: skip
    out = str(tmp_path / "a.png")
    assert run(["render", str(path), "--overlay", files[1], "-o", out]) == 2
    assert "expected people in camera space, found them only in world" in capsys.readouterr().err


@pytest.mark.slow
def test_people_in_camera_space_only_get_an_assumed_camera(files, tmp_path, capsys):
    path = tmp_path / "camera.pkl"
    turned = np.tile(np.diag([1.0, -1.0, -1.0]), (4, 1, 1, 1))
    poses = np.concatenate([turned, np.tile(np.eye(3), (4, 23, 1, 1))], axis=1)
    path.write_bytes(joblib_file({"rotmat": poses, "cam_t": np.tile([0.0, 0.0, 6.0], (4, 1))}))
    pixels = overlaid(tmp_path, str(path), "--overlay", files[1])
    is_body = np.abs(pixels - GREY).max(axis=2) > 12
    # The focal length is the diagonal, 147 pixels: 147 * 1.7 / 6 = 42 pixels.
    rows = np.flatnonzero(is_body.any(axis=1))
    assert abs(np.ptp(rows) - 42) <= 3
    assert "a focal length of 147 pixels, the diagonal of 128 x 72, is assumed" in (
        capsys.readouterr().err
    )
