"""Headless OpenGL contexts, and explanations of all known failures."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import moderngl

from viewer.errors import RenderError, ViewerError
from viewer.interrupts import deferred

__all__ = [
    "check_device",
    "check_errors",
    "device_count",
    "explain",
    "headless_context",
    "is_software",
    "unreadable_devices",
]

NEEDED_VERSION = 330

_LIBEGL, _LIBGL = "libEGL.so.1", "libGL.so.1"
_INSTALL = "on Debian or Ubuntu: apt install libegl1 libgl1 libgl1-mesa-dri"
_EGL_ERRORS = {
    "0x3001": "EGL could not be initialised: its driver files are missing or broken",
    "0x3002": "EGL was denied access to the graphics device",
    "0x3003": "the driver is out of memory",
    "0x3008": "EGL does not accept this display",
    "0x3009": "OpenGL 3.3 is needed, but the driver does not offer it",
}


def headless_context(device: int | None = None) -> moderngl.Context:
    """Return a context that needs neither display nor window.

    Parameters
    ----------
    device : int, optional
        Index of the EGL device; if omitted, each one is tried in turn.

    Returns
    -------
    moderngl.Context
        OpenGL 3.3 core or newer, current in this thread; the caller must release it.

    Raises
    ------
    RenderError
        If there is no usable OpenGL; the message gives the cause and a remedy.
    ViewerError
        If there are devices, but none with this index.
    """
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
    settings: dict[str, Any] = {"standalone": True, "require": NEEDED_VERSION, **options}
    if sys.platform.startswith("linux"):
        # Explicit names avoid a search that starts other programs and takes 60 ms.
        settings |= {"backend": "egl", "libegl": _LIBEGL, "libgl": _LIBGL}
        # Mesa would print its own messages before the useful message.
        os.environ.setdefault("EGL_LOG_LEVEL", "fatal")
    try:
        with deferred():
            return moderngl.create_context(**settings)
    except Exception as problem:  # glcontext raises Exception itself
        from viewer.rendering.gpu.offer import headless_offer, offer_text

        text = str(problem)
        offer = headless_offer(settings) if "0x3009" in text or "version" in text else None
        raise RenderError(explain(text) if offer is None else offer_text(offer)) from None


def check_device(device: int) -> None:
    """Raise for an index without a device; any index is accepted if devices cannot be listed.

    Raises
    ------
    ViewerError
        If the index is invalid; the message gives the valid numbers.
    """
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


def explain(text: str) -> str:
    """Return an explanation of a message from glcontext or GLFW, with a remedy.

    Parameters
    ----------
    text : str
        The library's message.

    Returns
    -------
    str
        One line: cause and remedy, and the library's message in brackets.

    >>> explain("libEGL.so.1 not loaded").startswith("libEGL was not found")
    True
    """
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


def is_software(context: moderngl.Context) -> bool:
    """Return whether rendering is done in software."""
    renderer = context.info["GL_RENDERER"].lower()
    return any(name in renderer for name in ("llvmpipe", "softpipe", "swrast", "software", "basic"))


def unreadable_devices() -> list[str]:
    """Return the render nodes of graphics cards that the user has no permission to open."""
    folder = Path("/dev/dri")
    nodes = sorted(folder.glob("renderD*")) if folder.is_dir() else []
    return [str(node) for node in nodes if not os.access(node, os.R_OK | os.W_OK)]


def check_errors(context: moderngl.Context, doing: str) -> None:
    """Raise if OpenGL has recorded an error, since an oversized buffer or texture does not raise.

    Parameters
    ----------
    context : moderngl.Context
        The context in use.
    doing : str
        Name of the attempted operation, for the message.

    Raises
    ------
    RenderError
        If there is an error; the message gives the renderer's name.
    """
    error = context.error
    if error == "GL_NO_ERROR":
        return
    renderer = context.info["GL_RENDERER"]
    if error == "GL_OUT_OF_MEMORY":
        raise RenderError(f"{doing}: not enough graphics memory on {renderer} ({error})")
    raise RenderError(f"{doing}: {error} on {renderer}")
