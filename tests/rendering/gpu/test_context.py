"""Machines without usable OpenGL, simulated by environment variables, and their messages."""

import os
import subprocess
import sys
from pathlib import Path

import moderngl
import numpy as np
import pytest

from viewer.cli import run
from viewer.errors import RenderError, ViewerError
from viewer.rendering.gpu.context import (
    check_errors,
    device_count,
    explain_failure,
    headless_context,
)
from viewer.rendering.gpu.upload import buffer
from viewer.rendering.offscreen import Offscreen

ROOT = Path(__file__).resolve().parents[3]
LINUX = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="EGL is used only on Linux")

TINY_SKEL = """balljoint root {
  boxmin -0.1 0 -0.1
  boxmax 0.1 1 0.1
}
"""


def viewer_render(tmp_path, *arguments: str, **environment: str):
    """Run ``viewer render`` on one joint in a new process; return it and the path of the image."""
    skel, output = tmp_path / "one.skel", tmp_path / "one.png"
    skel.write_text(TINY_SKEL)
    command = [sys.executable, "-m", "viewer", "render", str(skel), "-o", str(output)]
    size = [] if "--size" in arguments else ["--size", "64x48"]
    size += [] if "--quality" in arguments else ["--quality", "draft"]
    result = subprocess.run(
        [*command, *size, *arguments],
        cwd=ROOT,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    return result, output


def check_refusal(result, output: Path, code: int, message: str) -> None:
    assert result.returncode == code, result.stderr
    assert result.stderr == f"viewer: {message}\n"
    assert result.stdout == ""
    assert not output.exists()


INSTALL = "(on Debian or Ubuntu: apt install libegl1 libgl1 libgl1-mesa-dri)"


@LINUX
def test_missing_egl_device_is_reported_with_remedies(tmp_path):
    result = viewer_render(tmp_path, __EGL_VENDOR_LIBRARY_FILENAMES="/nonexistent")
    check_refusal(
        *result,
        code=4,
        message="EGL found 0 devices: start containers with "
        "NVIDIA_DRIVER_CAPABILITIES=all, or install Mesa for software rendering " + INSTALL,
    )


@LINUX
@pytest.mark.usefixtures("mesa")
def test_missing_driver_files_are_reported_in_one_line(tmp_path):
    """Warnings printed by Mesa must not precede the message."""
    result = viewer_render(tmp_path, LIBGL_DRIVERS_PATH="/nonexistent")
    check_refusal(
        *result,
        code=4,
        message="EGL could not be initialised: its driver files are missing or broken "
        f"{INSTALL} [eglInitialize failed (0x3001)]",
    )


@LINUX
@pytest.mark.usefixtures("mesa")
def test_old_opengl_is_reported_with_its_version_and_renderer(tmp_path):
    result, output = viewer_render(tmp_path, MESA_GL_VERSION_OVERRIDE="3.1")
    assert result.returncode == 4
    assert result.stderr.startswith(
        "viewer: OpenGL 3.3 is needed; this machine offers 3.1 (renderer "
    )
    assert "MESA_GL_VERSION_OVERRIDE=3.1" in result.stderr
    assert result.stderr.count("\n") == 1
    assert not output.exists()


@LINUX
@pytest.mark.usefixtures("mesa")
@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("MESA_GLSL_VERSION_OVERRIDE", "130", ("GLSL 3.30 is needed", "offers GLSL 1.30")),
        ("MESA_GLSL_VERSION_OVERRIDE", "150", ("OpenGL 3.3 is needed", "3.2 with GLSL 1.50")),
        ("MESA_GL_VERSION_OVERRIDE", "2.1", ("OpenGL 3.3 is needed", "offers 2.1")),
    ],
)
def test_old_shading_language_is_distinguished_from_old_opengl(tmp_path, name, value, words):
    result, output = viewer_render(tmp_path, **{name: value})
    assert result.returncode == 4 and result.stderr.count("\n") == 1, result.stderr
    for word in (*words, "renderer ", f"{name}={value}"):
        assert word in result.stderr
    assert not output.exists()


@LINUX
@pytest.mark.parametrize(
    ("environment", "code", "words"),
    [
        ({"DISPLAY": ""}, 0, ("note    display", "DISPLAY is not set")),
        ({"MESA_GLSL_VERSION_OVERRIDE": "130", "DISPLAY": ""}, 4, ("missing drawing", "GLSL 1.30")),
        ({"MESA_GL_VERSION_OVERRIDE": "3.1", "DISPLAY": ""}, 4, ("missing drawing", "offers 3.1")),
        (
            {"__EGL_VENDOR_LIBRARY_FILENAMES": "/nonexistent", "DISPLAY": ""},
            4,
            ("missing drawing", "EGL found 0 devices"),
        ),
        # No X server has this display number.
        ({"DISPLAY": ":654321"}, 0, ("note    display", ":654321", "-> ")),
    ],
)
def test_doctor_reports_the_same_message(request, environment, code, words):
    if any(name.startswith("MESA_") for name in environment):
        request.getfixturevalue("mesa")
    variables = {**os.environ, "WAYLAND_DISPLAY": "", **environment}
    done = subprocess.run(
        [sys.executable, "-m", "viewer", "doctor"],
        cwd=ROOT, env=variables, capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (code, "")
    assert all(word in done.stdout for word in words)


@LINUX
def test_missing_libegl_is_reported_with_its_package(tmp_path):
    result = viewer_render(tmp_path, GLCONTEXT_LINUX_LIBEGL="libnope.so")
    check_refusal(
        *result, code=4, message=f"libEGL was not found {INSTALL} [libnope.so not loaded]"
    )


@LINUX
def test_missing_libgl_is_reported_with_its_package(tmp_path):
    result = viewer_render(tmp_path, GLCONTEXT_LINUX_LIBGL="libnope.so")
    check_refusal(*result, code=4, message=f"libGL was not found {INSTALL} [libnope.so not loaded]")


@LINUX
def test_missing_device_is_reported_with_the_number_of_devices(tmp_path):
    count = device_count()
    known = "0, the only one," if count == 1 else f"0 to {count - 1},"
    for number in ("99", "-1"):
        result, output = viewer_render(tmp_path, "--gpu", number)
        assert result.returncode == 2 and result.stderr.count("\n") == 1
        for word in ("--gpu", f"expected {known}", f"found {number} "):
            assert word in result.stderr
        assert not output.exists()


@LINUX
def test_missing_device_is_reported_before_files_are_read(tmp_path, capsys):
    assert run(["render", "missing.skel", "-o", str(tmp_path / "x.png"), "--gpu", "-1"]) == 2
    assert "found -1" in capsys.readouterr().err


@LINUX
def test_only_a_negative_device_number_is_a_usage_error(tmp_path):
    for number, code, word in (("0", 4, "EGL found 0 devices"), ("-1", 2, "expected 0 or more")):
        result, _ = viewer_render(
            tmp_path, "--gpu", number, __EGL_VENDOR_LIBRARY_FILENAMES="/nonexistent"
        )
        assert result.returncode == code and word in result.stderr


@LINUX
def test_first_device_can_be_requested(tmp_path):
    result, output = viewer_render(tmp_path, "--gpu", "0")
    assert (result.returncode, result.stderr) == (0, "")
    assert output.is_file()


@pytest.mark.parametrize("size", ["0x48", "64x0", "0x0", "100000x48", "64x100000"])
def test_size_that_cannot_be_drawn_is_a_usage_error(tmp_path, size):
    result, output = viewer_render(tmp_path, "--size", size)
    width, height = size.split("x")
    assert result.returncode == 2
    assert "Traceback" not in result.stderr
    assert result.stderr.rstrip().endswith((f"found {width} x {height}", f"found {size}"))
    assert result.stderr.count("\n") == 1
    assert not output.exists()


def test_too_many_samples_are_reduced_to_the_maximum(tmp_path):
    result, output = viewer_render(tmp_path, "--samples", "4096")
    assert result.returncode == 0
    assert result.stderr.startswith("warning: 4096 samples per pixel requested, ")
    assert result.stderr.count("\n") == 1
    assert output.is_file()


@LINUX
@pytest.mark.usefixtures("mesa")
def test_different_rasteriser_draws_without_warnings(tmp_path):
    result, output = viewer_render(
        tmp_path, "--quality", "normal", "--samples", "1", GALLIUM_DRIVER="softpipe"
    )
    assert (result.returncode, result.stderr) == (0, "")
    assert output.is_file()


@LINUX
def test_drawing_does_not_need_a_display(tmp_path):
    result, output = viewer_render(tmp_path, DISPLAY="", WAYLAND_DISPLAY="")
    assert (result.returncode, result.stderr) == (0, "")
    assert output.is_file()


@pytest.mark.parametrize(
    ("text", "start"),
    [
        ("requested device index 0, but found 0 devices", "EGL found 0 devices: start containers"),
        (
            "requested device index 9, but found 1 devices",
            "there is no graphics device 9: EGL found 1 device, counted from 0",
        ),
        (
            "requested device index 9, but found 3 devices",
            "there is no graphics device 9: EGL found 3 devices, counted from 0",
        ),
        ("eglInitialize failed (0x3001)", "EGL could not be initialised: its driver files"),
        ("eglInitialize failed (0x3002)", "EGL was denied access to the graphics device"),
        ("eglCreateContext failed (0x3003)", "the driver is out of memory"),
        ("eglGetDisplay failed (0x3008)", "EGL does not accept this display"),
        ("eglCreateContext failed (0x3009)", "OpenGL 3.3 is needed, but the driver"),
        ("eglMakeCurrent failed (0x300B)", "EGL refused"),
        ("libEGL.so.1 not loaded", "libEGL was not found"),
        ("libGL.so.1 not loaded", "libGL was not found"),
        ("Requested OpenGL version 330, got version 310", "OpenGL 3.3 is needed: Requested"),
        ("something new", "no OpenGL context: something new"),
    ],
)
def test_library_messages_are_explained(text, start):
    assert explain_failure(text).startswith(start)
    assert "\n" not in explain_failure(text)


@LINUX
def test_invalid_device_is_also_an_error_within_the_process():
    for number in (99, -1):
        with pytest.raises(ViewerError, match=f"found {number} ") as caught:
            headless_context(number)
        assert caught.value.exit_code == 2


def test_opengl_errors_are_raised_with_the_operation(ctx):
    check_errors(ctx, "nothing")
    ctx.enable_direct(0xFFFF)  # this capability does not exist
    with pytest.raises(RenderError, match=r"^a mistake: GL_INVALID_ENUM on "):
        check_errors(ctx, "a mistake")


def test_upload_without_memory_reports_the_requested_size(ctx, monkeypatch):
    """moderngl raises nothing; only the error state of the context shows the failure."""
    monkeypatch.setattr(moderngl.Context, "error", property(lambda self: "GL_OUT_OF_MEMORY"))
    with pytest.raises(
        RenderError,
        match=r"^a mesh buffer of 2\.4 MB: not enough graphics memory on .* \(GL_OUT_OF_MEMORY\)$",
    ):
        buffer(ctx, np.zeros((200_000, 3)), "f4")
    monkeypatch.undo()


def test_two_contexts_coexist():
    first, second = headless_context(), headless_context()
    with first:
        ours = first.buffer(b"ours")
    with second:
        theirs = second.buffer(b"theirs")
    with first:
        assert ours.read() == b"ours"
    with second:
        assert theirs.read() == b"theirs"
    second.release()
    with first:
        assert ours.read() == b"ours"
    first.release()


def test_inaccessible_graphics_card_is_reported_in_a_note(monkeypatch):
    monkeypatch.setattr("viewer.rendering.offscreen.is_software", lambda context: True)
    nodes = ["/dev/dri/renderD128"]
    monkeypatch.setattr("viewer.rendering.offscreen.unreadable_devices", lambda: nodes)
    with Offscreen() as offscreen:
        assert offscreen.renderer.notes == [
            "rendering in software: /dev/dri/renderD128 exists but you have no permission to open "
            "it (group render)"
        ]


def test_display_without_opengl_3_reports_the_requirement():
    assert explain_failure("GLX: Failed to create context: GLXBadFBConfig") == (
        "OpenGL 3.3 is needed, but this display's driver does not offer it "
        "[GLX: Failed to create context: GLXBadFBConfig]"
    )
