"""Colours that stand for data: maps for numbers; palettes for joints, body parts and counts.

Two maps are our own; the others are those that other programs name.
"""

from __future__ import annotations

import colorsys
from collections.abc import Sequence
from functools import cache

import numpy as np

from viewer.rendering.options import Color
from viewer.resources import resource
from viewer.rigs.arrays import Bytes, Floats, Ints
from viewer.rigs.srgb import decode_srgb, encode_srgb

_GOLDEN = 0.618033988749895  # spacing of hues, which never repeat

# Our own maps are perceptually uniform and colour-blind safe. The anchors are in OKLab (Ottosson
# 2020): lightness rises linearly from violet through red to yellow, so the map works in greyscale
# and for colour-blind people, like matplotlib's "inferno".
_ANCHORS = np.array(
    [
        [0.24, 0.020, -0.075],
        [0.42, 0.100, -0.115],
        [0.60, 0.165, 0.020],
        [0.78, 0.085, 0.130],
        [0.96, -0.020, 0.130],
    ]
)
# From blue through white to red: lightness falls symmetrically towards both ends, and the two hues
# remain distinguishable with red-green colour blindness.
_DIVERGING = np.array(
    [
        [0.36, -0.020, -0.130],
        [0.60, -0.035, -0.115],
        [0.97, 0.000, 0.000],
        [0.60, 0.140, 0.080],
        [0.36, 0.120, 0.070],
    ]
)
_DIVERGING_PLACES = np.array([0.0, 0.2, 0.5, 0.8, 1.0])
_FROM_OKLAB = np.array(
    [
        [1.0, 0.3963377774, 0.2158037573],
        [1.0, -0.1055613458, -0.0638541728],
        [1.0, -0.0894841775, -1.2914855480],
    ]
)
_TO_LINEAR_RGB = np.array(
    [
        [4.0767416621, -3.3077115913, 0.2309699292],
        [-1.2684380046, 2.6097574011, -0.3413193965],
        [-0.0041960863, -0.7034186147, 1.7076147010],
    ]
)

NOTHING = (52, 54, 58)
"""Colour of missing weights or numbers, sRGB: a dark grey that our own maps do not contain."""

# The first seven are from Okabe and Ito (2008). Each following colour is the colour of a regular
# sRGB grid that is farthest in OKLab from all previous colours, for normal vision, protanopia and
# deuteranopia.
_JOINT_COLORS = np.array(
    [
        [86, 180, 233], [230, 159, 0], [0, 158, 115], [240, 228, 66],
        [0, 114, 178], [213, 94, 0], [204, 121, 167], [85, 255, 221],
        [119, 136, 255], [153, 204, 136], [170, 51, 51], [153, 68, 119],
        [153, 255, 153], [153, 221, 255], [221, 170, 187], [119, 136, 204],
    ]
)  # fmt: skip

_ROUNDS = (1.0, 0.55, 0.3)  # brightness levels of each colour
_RELUCTANCE = 0.04  # additional OKLab distance from its neighbours that a darker colour needs
# Linear colours as seen with normal vision, protanopia and deuteranopia (Machado et al. 2009).
_EYES = np.array(
    [
        np.eye(3),
        [
            [0.152286, 1.052583, -0.204868],
            [0.114503, 0.786281, 0.099216],
            [-0.003882, -0.048116, 1.051998],
        ],
        [
            [0.367322, 0.860646, -0.227968],
            [0.280085, 0.672501, 0.047413],
            [-0.011820, 0.042940, 0.968881],
        ],
    ]
)
_ENOUGH = 0.3  # OKLab distance beyond which colours are equally distinct
# Okabe and Ito 2008, "Color Universal Design": distinguishable for colour-blind people; sRGB.
_PART_COLORS = np.array(
    [
        [153, 153, 153],
        [86, 180, 233],
        [230, 159, 0],
        [0, 158, 115],
        [240, 228, 66],
        [0, 114, 178],
        [213, 94, 0],
        [204, 121, 167],
    ]
)
_DARKER = 0.55  # factor of the brightness for each repetition of the list


def colormap(count: int = 256) -> Bytes:
    """Return the map as pixels: (count, 4) sRGB with alpha, from lowest to highest."""
    return _map_pixels(_ANCHORS, np.linspace(0.0, 1.0, len(_ANCHORS)), count)


def diverging_map(count: int = 256) -> Bytes:
    """Return the diverging map as pixels: (count, 4) sRGB with alpha, white in the middle."""
    return _map_pixels(_DIVERGING, _DIVERGING_PLACES, count)


@cache
def named_map(name: str) -> Bytes:
    """Return a map of ``assets/colormaps.txt`` as pixels: (256, 4) sRGB with alpha."""
    lines = resource("assets", "colormaps.txt").read_text("ascii").splitlines()
    first = lines.index(name) + 1
    pixels = np.full((256, 4), 255, dtype=np.uint8)
    digits = bytes.fromhex("".join(lines[first : first + 16]))
    pixels[:, :3] = np.frombuffer(digits, dtype=np.uint8).reshape(256, 3)
    pixels.flags.writeable = False
    return pixels


def _map_pixels(anchors: Floats, places: Floats, count: int) -> Bytes:
    """Return ``count`` colours interpolated between anchors in OKLab."""
    wanted = np.linspace(0.0, 1.0, count)
    lab = np.stack([np.interp(wanted, places, column) for column in anchors.T], axis=1)
    return _pixels((lab @ _FROM_OKLAB.T) ** 3 @ _TO_LINEAR_RGB.T)


def _pixels(linear: Floats) -> Bytes:
    """Return linear colours, (N, 3), as pixels: (N, 4) sRGB with alpha."""
    pixels = np.full((len(linear), 4), 255, dtype=np.uint8)
    pixels[:, :3] = np.round(255.0 * encode_srgb(linear))
    return pixels


def oklab(colors: Floats) -> Floats:
    """Return linear colours, (..., 3), in OKLab, where distances are perceptually uniform."""
    cones = np.cbrt(np.maximum(colors @ np.linalg.inv(_TO_LINEAR_RGB).T, 0.0))
    return cones @ np.linalg.inv(_FROM_OKLAB).T


def joint_palette(parents: Ints) -> Bytes:
    """Return a clearly different colour for neighbouring joints: (J, 4) uint8, sRGB and alpha."""
    # Neighbours of a joint are its parent, its grandparent, its siblings and its parent's siblings.
    # Among the least-used colours, the one farthest from all neighbours is chosen, also as
    # colour-blind people see it.
    bright = decode_srgb(_JOINT_COLORS / 255.0)
    linear = np.concatenate([brightness * bright for brightness in _ROUNDS])
    distances = _distances(linear)
    # Prefer bright colours if both are distinct enough.
    reluctance = np.repeat(_RELUCTANCE * np.arange(len(_ROUNDS)), len(bright))
    chosen = np.zeros(len(parents), dtype=np.int32)
    uses = np.zeros(len(linear), dtype=np.int32)
    for joint, parent in enumerate(parents):
        near = _neighbours(parents, joint, parent)
        score = distances[:, chosen[near]].min(axis=1, initial=_ENOUGH) - reluctance
        score[uses > uses.min()] -= 1.0
        chosen[joint] = score.argmax()
        uses[chosen[joint]] += 1
    return _pixels(linear[chosen])


def _neighbours(parents: Ints, joint: int, parent: int) -> Ints:
    """Return the earlier joints whose colours must differ from a joint's."""
    before = parents[:joint]
    near = before == parent
    if parent >= 0:
        near[parent] = True
        above = parents[parent]
        near |= before == above
        if above >= 0:
            near[above] = True
    return np.flatnonzero(near).astype(np.int32)


def _distances(linear: Floats) -> Floats:
    """Return the smallest distances between colours over all types of vision: (C, C)."""
    seen = oklab(np.clip(np.einsum("eab,cb->eca", _EYES, linear), 0.0, 1.0))
    return np.linalg.norm(seen[:, :, None] - seen[:, None], axis=-1).min(axis=0)


def part_palette(count: int) -> Bytes:
    """Return the colours that the body part shading uses: (count, 4)."""
    return _pixels(part_colors(count))


def joint_colors(count: int) -> Floats:
    """Return a pale colour for each joint: (J, 3), linear."""
    return _spaced_hues(count, 0.58, 0.42, 0.72)


def actor_colors(parts: Floats, colors: Sequence[Color | None]) -> Floats:
    """Return the colours of the parts of each actor, (A, N, 3): its own colour if it has one."""
    found = np.tile(parts, (len(colors), 1, 1))
    for row, color in enumerate(colors):
        if color is not None:
            found[row] = color
    return found


def path_colors(count: int) -> Floats:
    """Return a saturated colour for each path: (N, 3), sRGB."""
    return _spaced_hues(count, 0.1, 0.85, 0.95)


def _spaced_hues(count: int, first: float, saturation: float, value: float) -> Floats:
    """Return colours whose hues are spaced by the golden ratio, so that neighbours differ."""
    hues = (first + _GOLDEN * np.arange(count)) % 1.0
    colors = [colorsys.hsv_to_rgb(hue, saturation, value) for hue in hues]
    return np.array(colors).reshape(-1, 3)


def part_colors(count: int) -> Floats:
    """Return a colour for each of ``count`` parts: (count, 3), linear."""
    numbers = np.arange(count)
    linear = (_PART_COLORS / 255.0) ** 2.2
    return linear[numbers % len(linear)] * _DARKER ** (numbers // len(linear))[:, None]


def count_palette(most: int) -> Bytes:
    """Return a colour for each count from 0 to ``most``: (most + 1, 4), dark grey for 0."""
    pixels = np.full((most + 1, 4), 255, dtype=np.uint8)
    pixels[0, :3] = NOTHING
    # Skip the dark end of the map, which would look like the colour of 0.
    pixels[1:] = colormap(256)[np.linspace(56, 255, max(most, 1)).astype(int)][:most]
    return pixels
