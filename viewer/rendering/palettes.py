"""Categorical colours for joints, body parts and counts."""

from __future__ import annotations

import numpy as np

from viewer.rendering.colormap import colormap, oklab
from viewer.rendering.part_colors import part_colors
from viewer.rig.arrays import Bytes, Floats, Ints
from viewer.rig.srgb import decode_srgb, encode_srgb

__all__ = ["NOTHING", "count_palette", "joint_palette", "part_palette"]

NOTHING = (52, 54, 58)
"""Colour of missing weights or numbers, sRGB: a dark grey that our own maps do not contain."""

# The first seven are from Okabe and Ito (2008). Each following colour is the colour of a regular
# sRGB grid that is farthest in OKLab from all previous colours, for normal vision, protanopia and
# deuteranopia.
_DISTINCT = np.array(
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


def joint_palette(parents: Ints) -> Bytes:
    """Return a colour for every joint; neighbours differ clearly, even for colour-blind people.

    Neighbours of a joint are its parent, its grandparent, its siblings and its parent's siblings.
    Among the least-used colours, the one farthest from all neighbours is chosen.

    Parameters
    ----------
    parents : (J,)
        Index of each joint's parent, smaller than its own; -1 for a root.

    Returns
    -------
    (J, 4) uint8
        sRGB and alpha.

    >>> joint_palette(np.array([-1, 0, 1])).shape
    (3, 4)
    """
    bright = decode_srgb(_DISTINCT / 255.0)
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


def part_palette(count: int) -> Bytes:
    """Return the colours that the body part shading uses: (count, 4)."""
    return _pixels(part_colors(count))


def count_palette(most: int) -> Bytes:
    """Return a colour for each count from 0 to ``most``: (most + 1, 4), dark grey for 0."""
    pixels = np.full((most + 1, 4), 255, dtype=np.uint8)
    pixels[0, :3] = NOTHING
    # Skip the dark end of the map, which would look like the colour of 0.
    pixels[1:] = colormap(256)[np.linspace(56, 255, max(most, 1)).astype(int)][:most]
    return pixels


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


def _pixels(linear: Floats) -> Bytes:
    pixels = np.full((len(linear), 4), 255, dtype=np.uint8)
    pixels[:, :3] = np.round(255.0 * encode_srgb(linear))
    return pixels
