"""EGL devices: detection of graphics cards, and assignment to worker processes."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Sequence
from typing import Any

from viewer.data_classes import dataclass

_MOST = 64  # maximum number of devices
_EXTENSIONS = 0x3055
_CUDA_DEVICE = 0x323A  # EGL_CUDA_DEVICE_NV of EGL_NV_device_cuda
_SOFTWARE = "EGL_MESA_device_software"


@dataclass(frozen=True, slots=True)
class EglDevice:
    """A device that EGL lists."""

    index: int
    """Index in EGL's list, as ``--gpu`` takes it."""
    cuda: int | None = None
    """CUDA index of the same graphics card; None for other vendors."""
    is_software: bool = False
    """Whether it renders on the CPU."""


def egl_devices() -> list[EglDevice]:
    """Return the devices that EGL lists; an empty list if EGL is missing or cannot list them."""
    egl = _library()
    if egl is None:
        return []
    text_of = _function(egl, "eglQueryDeviceStringEXT", ctypes.c_char_p)
    number_of = _function(egl, "eglQueryDeviceAttribEXT", ctypes.c_uint)
    if text_of is None:
        return []
    found = []
    for index, handle in enumerate(_handles(egl)):
        device = ctypes.c_void_p(handle)
        extensions = (text_of(device, _EXTENSIONS) or b"").decode("ascii", "replace").split()
        value = ctypes.c_ssize_t()
        is_cuda = "EGL_NV_device_cuda" in extensions and number_of is not None
        if is_cuda and number_of is not None:
            is_cuda = bool(number_of(device, _CUDA_DEVICE, ctypes.byref(value)))
        cuda = value.value if is_cuda else None
        found.append(EglDevice(index, cuda, _SOFTWARE in extensions))
    return found


def _library() -> ctypes.CDLL | None:
    """Return EGL; None if it is missing."""
    if not sys.platform.startswith("linux"):
        return None
    try:
        return ctypes.CDLL("libEGL.so.1")
    except OSError:
        return None


def _handles(egl: ctypes.CDLL) -> list[int | None]:
    """Return EGL's handles of its devices; an empty list if it cannot list them."""
    query = _function(egl, "eglQueryDevicesEXT", ctypes.c_uint)
    handles, count = (ctypes.c_void_p * _MOST)(), ctypes.c_int()
    if query is None or not query(_MOST, handles, ctypes.byref(count)):
        return []
    return handles[: count.value]


def _function(egl: ctypes.CDLL, name: str, result: Any) -> Any:
    """Return an extension function, or None if there is none."""
    find = egl.eglGetProcAddress
    find.restype = ctypes.c_void_p
    address = find(name.encode())
    return ctypes.CFUNCTYPE(result)(address) if address else None


def device_of_worker(
    rank: int, devices: Sequence[EglDevice] | None = None, visible: str | None = None
) -> int | None:
    """Return the EGL device on which a worker process draws; None without a graphics card."""
    # The first device of CUDA_VISIBLE_DEVICES is used, which schedulers set for each job, but EGL
    # ignores. If the variable is not set, graphics cards are assigned to workers in turn.
    cards = [one for one in (devices or egl_devices()) if not one.is_software]
    if visible is None:
        visible = os.environ.get("CUDA_VISIBLE_DEVICES", "")
    if not cards:
        return None
    entries = [entry.strip() for entry in visible.split(",") if entry.strip()]
    if entries and entries[0].isdecimal():
        known = [one for one in cards if one.cuda is not None]
        # Drivers that number only visible cards report no number for the others.
        is_relative = len(known) == len(entries) < len(cards)
        wanted = 0 if is_relative else int(entries[0])
        for card in known:
            if card.cuda == wanted:
                return card.index
    return cards[rank % len(cards)].index
