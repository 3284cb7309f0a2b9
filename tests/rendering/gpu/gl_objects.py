"""The number of existing OpenGL objects, as reported by OpenGL."""

import ctypes
import ctypes.util
from collections import Counter

__all__ = ["gl_objects"]

_KINDS = ("Buffer", "Texture", "VertexArray", "Framebuffer", "Renderbuffer", "Query")
_PROGRAMS = ("Program", "Shader")
_LARGEST = 1024  # names are assigned from 1, the smallest free one first


def gl_objects() -> Counter[str]:
    """Return the number of objects of each kind in the current context."""
    library = ctypes.CDLL(ctypes.util.find_library("GL") or "libGL.so.1")
    found: Counter[str] = Counter()
    for kind in (*_KINDS, *_PROGRAMS):
        is_one = getattr(library, f"glIs{kind}")
        is_one.restype = ctypes.c_ubyte
        found[kind] = sum(bool(is_one(name)) for name in range(1, _LARGEST))
    return found
