"""OpenGL version offered by a machine that lacks the required version."""

from __future__ import annotations

import ctypes
import os
import re
from collections.abc import Iterable, Mapping
from typing import Any

import glcontext

from viewer.data_classes import dataclass

__all__ = ["Offer", "headless_offer", "offer_of", "offer_text"]

_VERSION, _RENDERER, _LANGUAGE = 0x1F02, 0x1F01, 0x8B8C
_NEEDED, _NEEDED_LANGUAGE = (3, 3), (3, 30)
_TRIED = (320, 310, 210, 100)  # versions to try, newest first; from 3.1 on, they are core profiles
_OVERRIDES = ("MESA_GL_VERSION_OVERRIDE", "MESA_GLSL_VERSION_OVERRIDE")


@dataclass(frozen=True, slots=True)
class Offer:
    """Version strings of a driver: ``"4.5 (Compatibility Profile) Mesa 22.3.6"`` and the like."""

    version: str
    language: str
    renderer: str


def headless_offer(options: Mapping[str, Any]) -> Offer | None:
    """Return the OpenGL version that the machine offers without a window; None if it offers none.

    Parameters
    ----------
    options : mapping
        moderngl's settings ``backend``, ``device_index``, ``libegl`` and ``libgl``.
    """
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


def offer_of(address: int) -> Offer:
    """Return the version strings of the current context's driver.

    Parameters
    ----------
    address : int
        Address of the function ``glGetString``.
    """
    get_string = ctypes.CFUNCTYPE(ctypes.c_char_p, ctypes.c_uint)(address)
    strings = [
        (get_string(name) or b"").decode("utf-8", "replace")
        for name in (_VERSION, _LANGUAGE, _RENDERER)
    ]
    return Offer(*strings)


def offer_text(offer: Offer, environment: Mapping[str, str] = os.environ) -> str:
    """Return a message about the required and the offered version.

    Parameters
    ----------
    offer : Offer
        Version strings of a context with an older version.
    environment : mapping of str to str
        Environment variables, which may limit the version offered by Mesa.
    """
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
