"""Machines without usable OpenGL, simulated by environment variables, and their messages."""

import os
import sys
import threading
from pathlib import Path

import moderngl
import numpy as np
import pytest
from forked_programs import VIEWER, Forker

import viewer
from viewer.cli import run
from viewer.errors import RenderError, ViewerError
from viewer.rendering.gpu import upload
from viewer.rendering.gpu.context import (
    Graphics,
    OpenGLOffer,
    check_errors,
    device_count,
    explain_failure,
    headless_context,
    offer_text,
    thread_graphics,
)
from viewer.rendering.gpu.egl_devices import (
    EglDevice,
    device_of_worker,
    egl_devices,
)
from viewer.rendering.gpu.mesh_buffers import MeshBuffers
from viewer.rendering.gpu.ownership import Owner
from viewer.rendering.gpu.posed_mesh import PosedMesh
from viewer.rendering.gpu.program import Programs
from viewer.rendering.gpu.upload import buffer
from viewer.rendering.offscreen import Offscreen, default_camera
from viewer.rendering.options import DisplayOptions
from viewer.rendering.passes.joint_pass import SkeletonBuffers
from viewer.rigs.scene import scene_box

ROOT = Path(__file__).resolve().parents[3]
LINUX = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="EGL is used only on Linux")
TINY_SKEL = """balljoint root {
  boxmin -0.1 0 -0.1
  boxmax 0.1 1 0.1
}
"""


@pytest.fixture(scope="module")
def program():
    """A function that runs the viewer, forked from a process that has imported it."""
    forker = Forker()

    def run_viewer(*arguments: str, **environment: str):
        result = forker.run(VIEWER, arguments, ROOT, {**os.environ, **environment})
        result.stdout, result.stderr = result.stdout.decode(), result.stderr.decode()
        return result

    yield run_viewer
    forker.close()


@pytest.fixture
def viewer_render(program, tmp_path):
    """A function that runs ``viewer render`` on one joint; it also returns the picture's path."""

    def render(*arguments: str, **environment: str):
        skel, output = tmp_path / "one.skel", tmp_path / "one.png"
        skel.write_text(TINY_SKEL)
        size = [] if "--size" in arguments else ["--size", "64x48"]
        size += [] if "--quality" in arguments else ["--quality", "draft"]
        words = ("render", str(skel), "-o", str(output), *size, *arguments)
        return program(*words, **environment), output

    return render


def check_refusal(result, output: Path, code: int, message: str) -> None:
    assert result.returncode == code, result.stderr
    assert result.stderr == f"viewer: {message}\n"
    assert result.stdout == ""
    assert not output.exists()


INSTALL = "(on Debian or Ubuntu: apt install libegl1 libgl1 libgl1-mesa-dri)"


@LINUX
def test_missing_egl_device_is_reported_with_remedies(viewer_render):
    result = viewer_render(__EGL_VENDOR_LIBRARY_FILENAMES="/nonexistent")
    check_refusal(
        *result,
        code=4,
        message="EGL found 0 devices: start containers with "
        "NVIDIA_DRIVER_CAPABILITIES=all, or install Mesa for software rendering " + INSTALL,
    )


@LINUX
@pytest.mark.usefixtures("mesa")
def test_missing_driver_files_are_reported_in_one_line(viewer_render):
    """Warnings printed by Mesa must not precede the message."""
    result = viewer_render(LIBGL_DRIVERS_PATH="/nonexistent")
    check_refusal(
        *result,
        code=4,
        message="EGL could not be initialised: its driver files are missing or broken "
        f"{INSTALL} [eglInitialize failed (0x3001)]",
    )


@LINUX
@pytest.mark.usefixtures("mesa")
def test_old_opengl_is_reported_with_its_version_and_renderer(viewer_render):
    result, output = viewer_render(MESA_GL_VERSION_OVERRIDE="3.1")
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
def test_old_shading_language_is_distinguished_from_old_opengl(viewer_render, name, value, words):
    result, output = viewer_render(**{name: value})
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
def test_doctor_reports_the_same_message(request, program, environment, code, words):
    if any(name.startswith("MESA_") for name in environment):
        request.getfixturevalue("mesa")
    done = program("doctor", **{"WAYLAND_DISPLAY": "", **environment})
    assert (done.returncode, done.stderr) == (code, "")
    assert all(word in done.stdout for word in words)


@LINUX
def test_missing_libegl_is_reported_with_its_package(viewer_render):
    result = viewer_render(GLCONTEXT_LINUX_LIBEGL="libnope.so")
    check_refusal(
        *result, code=4, message=f"libEGL was not found {INSTALL} [libnope.so not loaded]"
    )


@LINUX
def test_missing_libgl_is_reported_with_its_package(viewer_render):
    result = viewer_render(GLCONTEXT_LINUX_LIBGL="libnope.so")
    check_refusal(*result, code=4, message=f"libGL was not found {INSTALL} [libnope.so not loaded]")


@LINUX
def test_missing_device_is_reported_with_the_number_of_devices(viewer_render):
    count = device_count()
    known = "0, the only one," if count == 1 else f"0 to {count - 1},"
    for number in ("99", "-1"):
        result, output = viewer_render("--gpu", number)
        assert result.returncode == 2 and result.stderr.count("\n") == 1
        for word in ("--gpu", f"expected {known}", f"found {number} "):
            assert word in result.stderr
        assert not output.exists()


@LINUX
def test_missing_device_is_reported_before_files_are_read(tmp_path, capsys):
    assert run(["render", "missing.skel", "-o", str(tmp_path / "x.png"), "--gpu", "-1"]) == 2
    assert "found -1" in capsys.readouterr().err


@LINUX
def test_only_a_negative_device_number_is_a_usage_error(viewer_render):
    for number, code, word in (("0", 4, "EGL found 0 devices"), ("-1", 2, "expected 0 or more")):
        result, _ = viewer_render("--gpu", number, __EGL_VENDOR_LIBRARY_FILENAMES="/nonexistent")
        assert result.returncode == code and word in result.stderr


@LINUX
def test_first_device_can_be_requested(viewer_render):
    result, output = viewer_render("--gpu", "0")
    assert (result.returncode, result.stderr) == (0, "")
    assert output.is_file()


@pytest.mark.parametrize("size", ["0x48", "64x0", "0x0", "100000x48", "64x100000"])
def test_size_that_cannot_be_drawn_is_a_usage_error(viewer_render, size):
    result, output = viewer_render("--size", size)
    width, height = size.split("x")
    assert result.returncode == 2
    assert "Traceback" not in result.stderr
    assert result.stderr.rstrip().endswith((f"found {width} x {height}", f"found {size}"))
    assert result.stderr.count("\n") == 1
    assert not output.exists()


def test_too_many_samples_are_reduced_to_the_maximum(viewer_render):
    result, output = viewer_render("--samples", "4096")
    assert result.returncode == 0
    assert result.stderr.startswith("warning: 4096 samples per pixel requested, ")
    assert result.stderr.count("\n") == 1
    assert output.is_file()


@LINUX
@pytest.mark.usefixtures("mesa")
def test_different_rasteriser_draws_without_warnings(viewer_render):
    result, output = viewer_render(
        "--quality", "normal", "--samples", "1", GALLIUM_DRIVER="softpipe"
    )
    assert (result.returncode, result.stderr) == (0, "")
    assert output.is_file()


@LINUX
def test_drawing_does_not_need_a_display(viewer_render):
    result, output = viewer_render(DISPLAY="", WAYLAND_DISPLAY="")
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


SOFTWARE = EglDevice(2, None, True)
# EGL lists cards in a different order than CUDA.
CARDS = [EglDevice(0, 1), EglDevice(1, 0), SOFTWARE]
# This driver numbers only the card in CUDA_VISIBLE_DEVICES.
ONE_VISIBLE = [EglDevice(0, None), EglDevice(1, 0), SOFTWARE]


@pytest.mark.parametrize(
    ("devices", "visible", "chosen"),
    [
        (CARDS, "", [0, 1, 0]),
        (CARDS, "0", [1, 1, 1]),
        (CARDS, "1,0", [0, 0, 0]),
        (ONE_VISIBLE, "3", [1, 1, 1]),
        (CARDS, "GPU-5c0f", [0, 1, 0]),
        ([EglDevice(0), EglDevice(1)], "1", [0, 1, 0]),
        ([SOFTWARE], "0", [None, None, None]),
    ],
    ids=["in-turn", "by-cuda", "first", "relative", "uuid", "no-cuda", "software"],
)
def test_workers_draw_on_the_visible_card_or_take_cards_in_turn(devices, visible, chosen):
    assert [device_of_worker(rank, devices, visible) for rank in range(3)] == chosen


def test_listed_devices_are_those_used_by_contexts():
    devices = egl_devices()
    assert [one.index for one in devices] == [*range(device_count())]


SIZE = (40, 30)


def picture(offscreen):
    scene = viewer.load()
    camera = default_camera(scene, SIZE)
    return offscreen.render(scene, SIZE, camera, DisplayOptions(), scene_box(scene))


def test_renderers_that_share_a_context_draw_equal_images():
    with Offscreen() as alone:
        expected = picture(alone)
    graphics = Graphics()
    for _ in range(2):
        with Offscreen(graphics=graphics) as borrowing:
            np.testing.assert_array_equal(picture(borrowing), expected)
    with graphics.context:
        assert graphics.context.error == "GL_NO_ERROR"
    graphics.release()
    assert isinstance(graphics.context.mglo, moderngl.InvalidObject)


def test_programs_are_compiled_once_for_all_renderers():
    graphics = Graphics()
    with Offscreen(graphics=graphics) as borrowing, graphics.context:
        program = graphics.programs.drawing("motion_path")
    with Offscreen(graphics=graphics) as borrowing, graphics.context:
        assert borrowing.renderer.programs.drawing("motion_path") is program
        assert not isinstance(program.mglo, moderngl.InvalidObject)
    graphics.release()


def test_each_thread_has_a_separate_context():
    found = []
    mine = thread_graphics()

    def look():
        found.extend([thread_graphics(), thread_graphics()])

    thread = threading.Thread(target=look)
    thread.start()
    thread.join()
    assert found[0] is found[1] and found[0] is not mine is thread_graphics()


MESA = "llvmpipe (LLVM 15.0.6, 256 bits)"


@pytest.mark.parametrize(
    ("version", "language", "environment", "needed", "offered"),
    [
        ("3.1 Mesa 22.3.6", "4.50", {}, "OpenGL 3.3", "offers 3.1 ("),
        ("2.1 Mesa 22.3.6", "1.20", {}, "OpenGL 3.3", "offers 2.1 with GLSL 1.20 ("),
        ("OpenGL ES 3.2 Mesa", "OpenGL ES GLSL ES 3.20", {}, "OpenGL 3.3", "offers 3.2 with GLSL"),
        ("3.3 (Core Profile)", "1.50", {}, "GLSL 3.30", "offers GLSL 1.50 ("),
        # The override applies to core profiles; compatibility profiles do not report it.
        (
            "4.5 (Compatibility Profile) Mesa 22.3.6",
            "4.50",
            {"MESA_GLSL_VERSION_OVERRIDE": "130"},
            "GLSL 3.30",
            "offers GLSL 1.30 (",
        ),
        ("4.5 (Compatibility Profile)", "4.50", {}, "core profile of OpenGL 3.3", "offers 4.5 "),
        ("4.5 (Compatibility)", "4.50", {"MESA_GLSL_VERSION_OVERRIDE": "x"}, "core", "offers 4.5 "),
        ("", "", {}, "OpenGL 3.3", "offers 0.0"),
    ],
)
def test_required_and_available_versions_are_reported(
    version, language, environment, needed, offered
):
    text = offer_text(OpenGLOffer(version, language, MESA), environment)
    before, after = text.split("; ")
    assert needed in before and offered in after and f"renderer {MESA}" in after
    assert all(f"{name}={value} is set" in after for name, value in environment.items())


def test_no_message_states_that_a_newer_version_is_too_old():
    for version in ("3.3", "4.5", "4.6 (Core Profile)"):
        text = offer_text(OpenGLOffer(version, "4.60", MESA), {"MESA_GLSL_VERSION_OVERRIDE": "140"})
        assert "OpenGL 3.3 is needed" not in text and "GLSL 1.40" in text


class Item:
    def __init__(self, log, name):
        self.log, self.name = log, name

    def release(self):
        self.log.append(self.name)


def test_owner_frees_in_reverse_order_and_only_once():
    log, owner = [], Owner()
    for name in "abc":
        owner.keep(Item(log, name))
    owner.release()
    owner.release()
    assert log == ["c", "b", "a"]


def test_guard_frees_on_failure():
    log, owner = [], Owner()
    with pytest.raises(RenderError), owner.guard():
        owner.keep(Item(log, "a"))
        raise RenderError("refused")
    assert log == ["a"]


class Alive:
    """A count of the objects that were created and not released."""

    def __init__(self, monkeypatch, refused: int) -> None:
        self.made, self.objects = 0, []

        def check(context: moderngl.Context, what: str) -> None:
            self.made += 1
            if self.made == refused:
                raise RenderError(f"{what}: refused")

        monkeypatch.setattr(upload, "check_errors", check)

    def left(self) -> list[object]:
        return [item for item in self.objects if not isinstance(item.mglo, moderngl.InvalidObject)]


def makers():
    figure = viewer.load().actors[0].figure
    return {
        "mesh": lambda ctx: MeshBuffers(ctx, figure, []),
        "skeleton": lambda ctx: SkeletonBuffers(ctx, figure, None),
    }


@pytest.mark.parametrize("name", ["mesh", "skeleton"])
@pytest.mark.parametrize("refused", range(1, 13))
def test_refused_upload_leaves_no_objects(ctx, monkeypatch, name, refused):
    alive = Alive(monkeypatch, refused)
    context = Spy(ctx, alive)
    try:
        made = makers()[name](context)
    except RenderError:
        assert alive.made == refused
    else:
        assert alive.made < refused
        made.release()
    assert alive.objects and alive.left() == []


def test_refused_posed_mesh_leaves_no_objects(ctx, monkeypatch):
    programs, mesh = Programs(ctx), makers()["mesh"](ctx)
    for refused in (1, 2):
        with monkeypatch.context() as patch:
            alive = Alive(patch, refused)
            with pytest.raises(RenderError):
                PosedMesh(Spy(ctx, alive), programs, mesh)
            assert alive.left() == []
    mesh.release()
    programs.release()


class Spy:
    """A context that records the objects it creates."""

    def __init__(self, context: moderngl.Context, alive: Alive) -> None:
        self._context, self._alive = context, alive

    def __getattr__(self, name: str):
        value = getattr(self._context, name)
        if name not in ("buffer", "texture"):
            return value

        def make(*args, **keywords):
            self._alive.objects.append(value(*args, **keywords))
            return self._alive.objects[-1]

        return make
