"""``viewer render``: the effects of all options, and protection of existing files."""

import io
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import viewer
from viewer.cli import run
from viewer.commands._pose import apply_dofs
from viewer.rendering.camera import Camera, fit
from viewer.rendering.options import DisplayOptions
from viewer.rigs.scene import scene_points

pytestmark = pytest.mark.slow
ROOT = Path(__file__).resolve().parents[3]
SMALL = ("--size", "40x30", "--quality", "draft")


def _size(path):
    with Image.open(path) as picture:
        return picture.size


@pytest.fixture
def draw(rig, tmp_path):
    """Return a function that renders the tiny figure with options and returns the pixels."""

    def picture(*options, files=rig):
        out = tmp_path / "drawn.png"
        quick = ("--force", "--size", "64x48", "--quality", "draft")
        code = run(["render", *map(str, files), "-o", str(out), *quick, *options])
        assert code == 0
        return np.array(Image.open(out).convert("RGBA"))

    return picture


def test_image_matches_that_of_the_library(draw, rig):
    scene = viewer.load(*rig)
    assert (draw("--quality", "normal") == viewer.render(scene, size=(64, 48))).all()


@pytest.mark.parametrize("size", ["64x48", "1x1", "33X17"])
def test_size_is_width_by_height(rig, tmp_path, size, capsys):
    out = tmp_path / "x.png"
    assert run(["render", *map(str, rig), "-o", str(out), "--size", size]) == 0
    width, height = map(int, size.lower().split("x"))
    assert _size(out) == (width, height)
    assert f"{width} x {height}" in capsys.readouterr().out


@pytest.mark.parametrize(
    "size", ["0x5", "5x0", "-5x5", "5", "x", "5x", "axb", "5x5x5", "999999x9", ""]
)
def test_invalid_size_is_refused(rig, tmp_path, size, capsys):
    out = tmp_path / "x.png"
    assert run(["render", str(rig[0]), "-o", str(out), f"--size={size}"]) == 2
    assert "size" in capsys.readouterr().err and not out.exists()


@pytest.mark.parametrize(
    ("options", "change"),
    [
        (["--azimuth", "-35"], {"azimuth": -35.0}),
        (["--azimuth=-35.5"], {"azimuth": -35.5}),
        (["--inclination", "-20"], {"inclination": -20.0}),
        (["--inclination", "90"], {"inclination": 90.0}),
        (["--orthographic"], {"orthographic": True}),
    ],
)
def test_camera_options_aim_and_fit(draw, rig, options, change):
    scene = viewer.load(*rig)
    camera = Camera()
    for name, value in change.items():
        setattr(camera, name, value)
    fit(camera, scene_points(scene), 64 / 48)
    assert (draw(*options) == viewer.render(scene, (64, 48), camera, DisplayOptions())).all()


def test_distance_is_used_as_given(draw, rig):
    scene = viewer.load(*rig)
    camera = Camera()
    fit(camera, scene_points(scene), 64 / 48)
    camera.distance = 12.5
    assert (
        draw("--distance", "12.5") == viewer.render(scene, (64, 48), camera, DisplayOptions())
    ).all()


@pytest.mark.parametrize(
    "options",
    [
        ["--distance", "0"],
        ["--distance", "-1"],
        ["--distance", "1e30"],
        ["--distance", "inf"],
        ["--inclination", "91"],
        ["--samples", "0"],
        ["--background", "blue"],
        ["--background", "#12345"],
        ["--max-size", "lots"],
        ["--gpu", "99"],
        ["--gpu", "-1"],
        ["--show", "nothing"],
    ],
)
def test_invalid_value_is_refused_in_one_line(rig, tmp_path, options, capsys):
    out = tmp_path / "x.png"
    assert run(["render", str(rig[0]), "-o", str(out), *options]) in (2, 4)
    error = capsys.readouterr().err
    assert error.startswith("viewer: ") and error.count("\n") == 1
    assert not out.exists()


@pytest.mark.parametrize(
    ("options", "change"),
    [
        (["--show", "skeleton"], {"show": "skeleton"}),
        (["--show", "both"], {"show": "both"}),
        (["--show", "binding"], {"show": "binding"}),
        (["--flat"], {"flat": True}),
        (["--wireframe"], {"wireframe": True}),
        (["--normals"], {"normals": True}),
        (["--no-grid"], {"grid": False}),
        (["--background", "#204060"], {"background": "#204060"}),
        (["--background", "transparent"], {"background": "transparent"}),
        (["--samples", "1"], {"samples": 1}),
    ],
)
def test_display_options_take_effect(draw, rig, options, change):
    scene, wanted = viewer.load(*rig), DisplayOptions(**change)
    picture = draw(*options)
    assert (picture == viewer.render(scene, (64, 48), options=wanted)).all()
    if options != ["--flat"]:
        assert (picture != draw()).any()


def test_option_no_texture_shows_the_plain_colour(draw):
    assert (draw("--no-texture", files=()) != draw(files=())).any()


def test_transparent_background_is_transparent(draw):
    picture = draw("--background", "transparent", "--no-grid")
    assert picture[0, 0, 3] == 0 and picture[24, 32, 3] == 255


def test_coloured_background_has_the_given_colour(draw):
    picture = draw("--background", "#204060", "--no-grid")
    assert picture[0, 0].tolist() == [0x20, 0x40, 0x60, 255]


def test_max_size_refuses_larger_files(rig, tmp_path, capsys):
    arguments = ["render", str(rig[1]), "-o", str(tmp_path / "x.png"), "--max-size", "100"]
    assert run(arguments) == 2
    assert "tiny.skin" in capsys.readouterr().err


# DOFs


@pytest.fixture
def scene(rig):
    return viewer.load(*rig)


@pytest.mark.parametrize(
    ("setting", "index", "value"),
    [
        ("arm.x=0.5", 6, 0.5),
        ("arm.x=0.5rad", 6, 0.5),
        ("arm.x=90deg", 6, math.pi / 2),
        ("arm.x=-90deg", 6, -math.pi / 2),
        ("#1.z= 1e-3 ", 8, 1e-3),
        ("ARM.Y=7", 7, 7.0),
        ("root.tx=2.5", 0, 2.5),
        ("root.x=1", 3, 1.0),
    ],
)
def test_dof_is_set_in_radians_degrees_or_lengths(scene, setting, index, value):
    before = scene.actors[0].pose.dofs.copy()
    assert apply_dofs(scene, [setting]) == []
    after = scene.actors[0].pose.dofs
    assert after[index] == pytest.approx(value, rel=1e-12)
    assert np.delete(after, index).tolist() == np.delete(before, index).tolist()


@pytest.mark.parametrize(
    ("text", "value", "limits"),
    [
        ("5", 1.0, "-1 to 1 rad"),
        ("-5", -1.0, "-1 to 1 rad"),
        ("180deg", 1.0, "-57.2958 to 57.2958deg"),
    ],
)
def test_dof_beyond_a_limit_is_clamped_with_a_warning(scene, text, value, limits):
    notes = apply_dofs(scene, [f"root.x={text}"])
    assert scene.actors[0].pose.dofs[3] == value
    assert notes == [f"root.x={text} is clamped to its limits {limits}"]


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("arm.x", "expected NAME.X=VALUE"),
        ("=1", "expected JOINT.KIND"),
        ("arm=1", "expected JOINT.KIND"),
        ("leg.x=1", 'no joint is called "leg"; there are 2: root, arm'),
        ("arm.tx=1", "joint arm has no DOF tx"),
        ("arm.q=1", "KIND one of"),
        ("arm.x=", "expected a number"),
        ("arm.x=nan", "expected a number"),
        ("arm.x=1e999", "expected a number"),
        ("arm.x=ninety", "expected a number"),
        ("#7.x=1", "no joint is called"),
    ],
)
def test_invalid_dof_reports_what_was_expected(rig, tmp_path, setting, words, capsys):
    arguments = ["render", *map(str, rig), "-o", str(tmp_path / "x.png"), "--dof", setting]
    assert run(arguments) == 2
    error = capsys.readouterr().err
    assert error.startswith("viewer: --dof: ") and words in error and error.count("\n") == 1


def test_ambiguous_joint_is_chosen_by_index(tmp_path, capsys):
    path = tmp_path / "twins.skel"
    path.write_text("balljoint a { balljoint knee { } balljoint knee { offset 1 0 0 } }")
    assert run(["info", str(path), "--dof", "knee.x=1"]) == 2
    assert "knee#1, knee#2" in capsys.readouterr().err
    assert run(["info", str(path), "--dof", "knee#2.x=0.5"]) == 0
    assert "knee#2.x" in capsys.readouterr().out


def test_dof_moves_the_figure_in_the_image(draw):
    assert (draw("--dof", "arm.z=90deg", "--dof", "root.x=-1") != draw()).any()


# Outputs


def test_existing_image_is_replaced_only_with_force(rig, tmp_path, capsys):
    out = tmp_path / "x.png"
    out.write_bytes(b"precious")
    arguments = ["render", *map(str, rig), "-o", str(out), *SMALL]
    assert run(arguments) == 5
    assert "--force" in capsys.readouterr().err and out.read_bytes() == b"precious"
    assert run([*arguments, "--force"]) == 0
    assert _size(out) == (40, 30)


def test_input_is_never_replaced(rig, tmp_path, capsys):
    kept = rig[0].read_bytes()
    link = tmp_path / "link.png"
    link.symlink_to(rig[0])
    for out in (rig[0], link, tmp_path / "." / "tiny.skel"):
        assert run(["render", *map(str, rig), "-o", str(out), "--force"]) == 5
        assert "input file" in capsys.readouterr().err
    assert rig[0].read_bytes() == kept


@pytest.mark.parametrize(
    ("out", "words"),
    [
        ("", "is a folder"),
        ("missing/x.png", "does not exist"),
        ("tiny.skel/x.png", ""),
        ("x" * 300 + ".png", "too long"),
    ],
)
def test_unwritable_output_is_exit_code_5(rig, tmp_path, out, words, capsys):
    before = sorted(tmp_path.iterdir())
    assert run(["render", *map(str, rig), "-o", str(tmp_path / out), *SMALL]) == 5
    error = capsys.readouterr().err
    assert words in error and error.count("\n") == 1
    assert sorted(tmp_path.iterdir()) == before


def test_full_device_is_exit_code_5(rig, capsys):
    assert run(["render", *map(str, rig), "-o", "/dev/full", *SMALL]) == 5
    assert capsys.readouterr().err == "viewer: /dev/full: No space left on device\n"


@pytest.mark.parametrize("suffix", [".jpg", ".bmp", ".webp", ".tiff", ".png", ""])
def test_suffix_chooses_the_format(rig, tmp_path, suffix):
    out = tmp_path / f"x{suffix}"
    assert run(["render", *map(str, rig), "-o", str(out), *SMALL]) == 0
    kinds = {".jpg": "JPEG", ".bmp": "BMP", ".webp": "WEBP", ".tiff": "TIFF"}
    with Image.open(out) as picture:
        assert picture.format == kinds.get(suffix, "PNG") and picture.size == (40, 30)


@pytest.mark.parametrize("suffix", [".psd", ".fits"])
def test_non_image_suffix_is_refused_before_files_are_read(tmp_path, suffix, capsys):
    out = tmp_path / f"x{suffix}"
    assert run(["render", "missing.skel", "-o", str(out), "--size", "40x30"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and ".png" in error and f"found {suffix}" in error
    assert not out.exists()


def test_non_image_suffix_is_reported_before_an_existing_file(tmp_path, capsys):
    out = tmp_path / "x.psd"
    out.write_text("precious")
    assert run(["render", "missing.skel", "-o", str(out)]) == 2
    assert "found .psd" in capsys.readouterr().err
    assert run(["render", str(out), "-o", str(out)]) == 5
    assert "input files are never overwritten" in capsys.readouterr().err


@pytest.mark.parametrize("suffix", [".xyz", ".svg", ".skin", ".avi"])
def test_image_with_a_wrong_suffix_is_refused(rig, tmp_path, suffix, capsys):
    out = tmp_path / f"x{suffix}"
    out.write_text("precious")
    assert run(["render", *map(str, rig), "-o", str(out), "--force"]) == 2
    assert capsys.readouterr().err == (
        f"viewer: {out}: expected an image (.png, .jpg, .jpeg, .bmp, .gif, .ppm, .tga, .tif, "
        f".tiff, .webp) or a video (.mp4, .webm, .gif), found {suffix}\n"
    )
    assert out.read_text() == "precious"


def test_video_formats_are_also_listed_for_frame_ranges(rig, tmp_path, capsys):
    out = tmp_path / "x.mov"
    assert run(["render", *map(str, rig), "-o", str(out), "--frames", "0:5"]) == 2
    assert " or a video (.mp4, .webm, .gif), found .mov\n" in capsys.readouterr().err


def test_transparency_unsupported_by_the_format_is_a_warning(rig, tmp_path, capsys):
    out = tmp_path / "x.jpg"
    arguments = ["-o", str(out), *SMALL, "--background", "transparent"]
    assert run(["render", *map(str, rig), *arguments]) == 0
    assert "this format has no transparency" in capsys.readouterr().err


@pytest.mark.parametrize("into", ["pipe", "file"])
def test_image_can_be_written_to_standard_output(rig, tmp_path, into):
    command = [
        sys.executable,
        "-m",
        "viewer",
        "render",
        *rig,
        "-o",
        "/dev/stdout",
        *SMALL,
    ]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    target = tmp_path / "through.png"
    with target.open("wb") as stream:
        done = subprocess.run(
            command, env=environment, stdout=stream if into == "file" else subprocess.PIPE,
            stderr=subprocess.PIPE, timeout=60, check=False,
        )  # fmt: skip
    assert done.returncode == 0
    data = target.read_bytes() if into == "file" else done.stdout
    assert Image.open(io.BytesIO(data)).size == (40, 30)
    assert data.endswith(b"IEND\xaeB`\x82")  # no text follows the image
    assert b"40 x 30" in done.stderr


def test_mesh_beyond_the_squares_of_float32_is_drawn_without_warnings(tmp_path):
    # Warnings are errors in tests. The sides of the ground's patches are 1e20, their product 1e40.
    mesh = tmp_path / "huge.obj"
    mesh.write_text("v 0 0 0\nv 1e20 0 0\nv 0 1e20 0\nf 1 2 3\n")
    image = tmp_path / "huge.png"
    assert run(["render", str(mesh), "-o", str(image), "--size", "64x64"]) == 0
    with Image.open(image) as found:
        red, _, blue = found.convert("RGB").getpixel((28, 36))
    assert red > blue  # the mesh is beige, the background blue


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
