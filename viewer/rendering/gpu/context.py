"""Headless OpenGL contexts with their programs, and explanations of all known failures.

A machine that lacks the required version is asked which one it offers, for the message.
"""

from __future__ import annotations

import ctypes
import os
import re
import sys
import threading
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import glcontext
import moderngl

from viewer.data_classes import dataclass
from viewer.errors import RenderError, ViewerError
from viewer.interrupts import deferred
from viewer.rendering.gpu.program import Programs
from viewer.rendering.shader_text import STORAGE_VERSION

_LIBEGL, _LIBGL = "libEGL.so.1", "libGL.so.1"
_INSTALL = "on Debian or Ubuntu: apt install libegl1 libgl1 libgl1-mesa-dri"
_EGL_ERRORS = {
    "0x3001": "EGL could not be initialised: its driver files are missing or broken",
    "0x3002": "EGL was denied access to the graphics device",
    "0x3003": "the driver is out of memory",
    "0x3008": "EGL does not accept this display",
    "0x3009": "OpenGL 3.3 is needed, but the driver does not offer it",
}
_GL_VERSION, _GL_RENDERER, _GL_LANGUAGE = 0x1F02, 0x1F01, 0x8B8C
_NEEDED, _NEEDED_LANGUAGE = (3, 3), (3, 30)  # OpenGL and GLSL
_TRIED = (320, 310, 210, 100)  # versions to try, newest first; from 3.1 on, they are core profiles
_OVERRIDES = ("MESA_GL_VERSION_OVERRIDE", "MESA_GLSL_VERSION_OVERRIDE")
_thread = threading.local()


class Graphics:
    """A headless context and its programs, which outlive the renderers that use them."""

    # In software, a context and its first image take ten times as long as the next image.

    def __init__(self, device: int | None = None) -> None:
        self.context = headless_context(device)
        self.programs = Programs(self.context)
        self._framebuffer = self.context.simple_framebuffer((1, 1))
        self.context.info  # noqa: B018 - cached, so that it is available without a current context

    def rest(self) -> None:
        """Bind a framebuffer that remains valid, before another one is released."""
        self._framebuffer.use()

    def release(self) -> None:
        """Free everything, including the context."""
        with self.context:
            self.programs.release()
            self._framebuffer.release()
        self.context.release()


class _OfThread:
    """Graphics of a thread for each requested device, freed when the thread ends."""

    def __init__(self) -> None:
        self.kept: dict[int | None, Graphics] = {}

    def __del__(self) -> None:
        # At interpreter exit, objects are freed in an undefined order.
        if not sys.is_finalizing():
            for graphics in self.kept.values():
                graphics.release()


def thread_graphics(device: int | None = None) -> Graphics:
    """Return the graphics of this thread on a device, created on first use and never released."""
    if not hasattr(_thread, "graphics"):
        _thread.graphics = _OfThread()
    kept: dict[int | None, Graphics] = _thread.graphics.kept
    if device not in kept:
        kept[device] = Graphics(device)
    return kept[device]


def headless_context(device: int | None = None) -> moderngl.Context:
    """Return a current context, OpenGL 3.3 core or newer, that needs neither display nor window."""
    # Without an index of an EGL device, each one is tried in turn. The caller must release the
    # context.
    if not sys.platform.startswith("linux"):
        return _create({})
    if device is not None:
        check_device(device)
        return _create({"device_index": device})
    try:
        return _create({"device_index": 0})
    except RenderError as first:
        for index in range(1, device_count()):
            try:
                return _create({"device_index": index})
            except RenderError:
                continue
        raise first from None


def _create(options: Mapping[str, int]) -> moderngl.Context:
    settings: dict[str, Any] = {"standalone": True, "require": 330, **options}
    if sys.platform.startswith("linux"):
        # Explicit names avoid a search that starts other programs and takes 60 ms.
        settings |= {"backend": "egl", "libegl": _LIBEGL, "libgl": _LIBGL}
        # Mesa would print its own messages before the useful message.
        os.environ.setdefault("EGL_LOG_LEVEL", "fatal")
    try:
        with deferred():
            return moderngl.create_context(**settings)
    except Exception as problem:  # glcontext raises Exception itself
        text = str(problem)
        offer = _headless_offer(settings) if "0x3009" in text or "version" in text else None
        raise RenderError(explain_failure(text) if offer is None else offer_text(offer)) from None


def check_device(device: int) -> None:
    """Raise for an index without a device; any index is accepted if devices cannot be listed."""
    count = device_count() if sys.platform.startswith("linux") else 0
    if device < 0 or (count and device >= count):
        known = {0: "0 or more", 1: "0, the only one"}.get(count, f"0 to {count - 1}")
        raise ViewerError(
            f"graphics device (--gpu): expected {known}, found {device} (viewer doctor lists them)"
        )


def device_count() -> int:
    """Return the number of devices, taken from the error message about an out-of-range index."""
    try:
        _create({"device_index": 1 << 20})
    except RenderError as problem:
        found = re.search(r"found (\d+) device", str(problem))
        return int(found.group(1)) if found else 0
    return 0


def unreadable_devices() -> list[str]:
    """Return the render nodes of graphics cards that the user has no permission to open."""
    folder = Path("/dev/dri")
    nodes = sorted(folder.glob("renderD*")) if folder.is_dir() else []
    return [str(node) for node in nodes if not os.access(node, os.R_OK | os.W_OK)]


def is_software(context: moderngl.Context) -> bool:
    """Return whether rendering is done in software."""
    renderer = context.info["GL_RENDERER"].lower()
    return any(name in renderer for name in ("llvmpipe", "softpipe", "swrast", "software", "basic"))


def storage_limit(context: moderngl.Context) -> int:
    """Return the size of the largest storage buffer of shaders, bytes; 0 if there are none."""
    info = context.info
    # Drivers of OpenGL 4.3 need not offer storage buffers to vertex shaders.
    if context.version_code < STORAGE_VERSION or not info["GL_MAX_VERTEX_SHADER_STORAGE_BLOCKS"]:
        return 0
    limit: int = info["GL_MAX_SHADER_STORAGE_BLOCK_SIZE"]
    return limit


def gl_function(
    context: moderngl.Context, name: str, result: type | None, arguments: list[type]
) -> Callable[..., int | None] | None:
    """Return a function of OpenGL, called without Python's lock; None if its address is unknown."""
    loader = getattr(getattr(context.mglo, "_context", None), "load_opengl_function", None)
    address = 0 if loader is None else loader(name)
    return ctypes.CFUNCTYPE(result, *arguments)(address) if address else None


def explain_failure(text: str) -> str:
    """Return the cause of a message from glcontext or GLFW, a remedy, and the message."""
    devices = re.search(r"requested device index (\d+), but found (\d+)", text)
    code = re.search(r"0x30[0-9a-fA-F]{2}", text)
    if "not loaded" in text or "cannot open shared object" in text:
        # glcontext lets these environment variables override the given names.
        asked_gl = os.environ.get("GLCONTEXT_LINUX_LIBGL") or _LIBGL
        library = "libGL" if asked_gl in text else "libEGL"
        return f"{library} was not found ({_INSTALL}) [{text}]"
    if devices and int(devices.group(2)) == 0:
        return (
            "EGL found 0 devices: start containers with NVIDIA_DRIVER_CAPABILITIES=all, "
            f"or install Mesa for software rendering ({_INSTALL})"
        )
    if devices:
        count = int(devices.group(2))
        plural = "" if count == 1 else "s"
        return (
            f"there is no graphics device {devices.group(1)}: EGL found {count} device{plural}, "
            "counted from 0"
        )
    if code:
        meaning = _EGL_ERRORS.get(code.group().lower(), "EGL refused")
        return f"{meaning} ({_INSTALL}) [{text}]"
    if "version" in text.lower():
        return f"OpenGL 3.3 is needed: {text}"
    if re.match(r"(GLX|WGL|NSGL|EGL): ", text):
        return f"OpenGL 3.3 is needed, but this display's driver does not offer it [{text}]"
    return f"no OpenGL context: {text} ({_INSTALL})"


def check_errors(context: moderngl.Context, doing: str) -> None:
    """Raise if OpenGL recorded an error, since an oversized buffer or texture does not raise."""
    error = context.error
    if error == "GL_NO_ERROR":
        return
    renderer = context.info["GL_RENDERER"]
    if error == "GL_OUT_OF_MEMORY":
        raise RenderError(f"{doing}: not enough graphics memory on {renderer} ({error})")
    raise RenderError(f"{doing}: {error} on {renderer}")


@dataclass(frozen=True, slots=True)
class OpenGLOffer:
    """Version strings of a driver: ``"4.5 (Compatibility Profile) Mesa 22.3.6"`` and the like."""

    version: str
    language: str
    renderer: str


def _headless_offer(options: Mapping[str, object]) -> OpenGLOffer | None:
    """Return the OpenGL version that moderngl's settings give without a window; None if none."""
    chosen = options.get("backend")
    create = glcontext.get_backend_by_name(chosen) if chosen else glcontext.default_backend()
    names = {key: options[key] for key in ("device_index", "libegl", "libgl") if key in options}
    for version in _TRIED:
        try:
            context = create(mode="standalone", glversion=version, **names)
        except Exception:  # glcontext raises Exception itself
            continue
        try:
            return offer_of(context.load("glGetString"))
        finally:
            context.release()
    return None


def offer_of(address: int) -> OpenGLOffer:
    """Return the version strings of the driver, by the address of its ``glGetString``."""
    get_string = ctypes.CFUNCTYPE(ctypes.c_char_p, ctypes.c_uint)(address)
    strings = [
        (get_string(name) or b"").decode("utf-8", "replace")
        for name in (_GL_VERSION, _GL_LANGUAGE, _GL_RENDERER)
    ]
    return OpenGLOffer(*strings)


def offer_text(offer: OpenGLOffer, environment: Mapping[str, str] = os.environ) -> str:
    """Return a message about the required and the offered version."""
    asked = [f"{name}={environment[name]}" for name in _OVERRIDES if environment.get(name)]
    where = ", ".join([f"renderer {offer.renderer}", *(f"{one} is set" for one in asked)])
    version, language = _numbers(offer.version), _numbers(offer.language)
    forced = re.match(r"(\d)(\d\d)", environment.get(_OVERRIDES[1], ""))
    if forced:
        # The override applies only to core profiles, which the driver may not offer.
        language = min(language, (int(forced[1]), int(forced[2])))
    if version < _NEEDED:
        beside = f" with GLSL {_dotted(language, 2)}" if language < _NEEDED_LANGUAGE else ""
        return f"OpenGL 3.3 is needed; this machine offers {_dotted(version)}{beside} ({where})"
    if language < _NEEDED_LANGUAGE:
        return f"GLSL 3.30 is needed; this machine offers GLSL {_dotted(language, 2)} ({where})"
    return (
        "the core profile of OpenGL 3.3 is needed; this machine offers "
        f"{_dotted(version)} without one ({where})"
    )


def _numbers(text: str) -> tuple[int, int]:
    """Return the version at the beginning of a text, after OpenGL ES's prefix if present.

    >>> _numbers("4.5 (Core Profile) Mesa 22.3.6"), _numbers("OpenGL ES 3.2 Mesa"), _numbers("")
    ((4, 5), (3, 2), (0, 0))
    """
    found = re.search(r"(\d+)\.(\d+)", text)
    return (int(found[1]), int(found[2])) if found else (0, 0)


def _dotted(version: Iterable[int], digits: int = 1) -> str:
    major, minor = version
    return f"{major}.{minor:0{digits}}"
